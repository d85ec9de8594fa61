"""What an audit asks about: a model's rules, as a rule base with all its meaning.

Rule bases and trees are asked as they are. A fuzzy system that only stands for a rule
base of ours is asked as that one. Of any other system a *view* is made: its conditions
as rules whose classes are the texts of what they conclude. A rule that asks `a and (b
or c)` becomes two rules, one for each way in which it can hold: under minimum or
product, and maximum, its strength is that of the stronger one, exactly. What has no
exact counterpart is left out, and an answer says so for each term and each rule.

A view tells how strongly conditions hold, at every double. What outputs make of it,
their curves and numbers, is not part of it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Final, Literal, NoReturn

import msgspec

from fuzzytree.auditing.records import Answer, Label, Policy
from fuzzytree.casting import as_rules
from fuzzytree.casting.shapes import shape_of
from fuzzytree.contracts import Document
from fuzzytree.lowering import rules_from_tree
from fuzzytree.proving.domain import Domain, Side
from fuzzytree.proving.states import Declined, Proved
from fuzzytree.rulebase import (
    Clause,
    Conjunction,
    Points,
    Rule,
    RuleBase,
    Semantics,
    Shape,
    Term,
    Variable,
    shape_mistakes,
)
from fuzzytree.system import (
    And,
    Conclusion,
    Condition,
    FuzzySystem,
    Is,
    Not,
    Or,
    RuleBlock,
    SystemInput,
    SystemRule,
    joints,
    questions,
)
from fuzzytree.system import Label as SystemLabel
from fuzzytree.tree import FuzzyTree

MOST_WAYS: Final = 64
"""The most rules that one rule of a system becomes."""

_NORMS: Mapping[str | None, Conjunction] = {"minimum": "min", "product": "product"}


class View(msgspec.Struct, frozen=True, eq=False):
    """A model's rules as they are audited.

    Attributes:
        rules: The rules; None if not one rule of a system could be taken over.
        policy: How they decide.
        domain: Where they are asked: where inputs are moved into their range, not
            beyond it.
        tree: The tree they come from.
        raw: Its raw rules, if it has fitted sets.
        system: The system they come from.
        places: What to call each rule, such as `rule 2 of block 1`; empty where rules
            are simply numbered.
        numbers: The number in the model of each rule, from 1, over all blocks.
        declined: What was left out, and why; and rules that can never fire.
        is_whole: Whether no rule is left out that may fire. Otherwise where no rule of
            the view fires another one may.
    """

    rules: RuleBase | None
    policy: Policy
    domain: Domain
    tree: FuzzyTree | None = None
    raw: RuleBase | None = None
    system: FuzzySystem | None = None
    places: tuple[str, ...] = ()
    numbers: tuple[int, ...] = ()
    declined: tuple[Answer, ...] = ()
    is_whole: bool = True


def view(model: Document, domain: Domain) -> View:
    """Return the rules of a model as they are audited.

    Args:
        model: A tree: its relative rules, which decide as it does. A rule base: itself.
            A system: the rule base it stands for, or a view of it.
        domain: Where everything is to be asked.

    Example:
        >>> from fuzzytree.testing import random_system
        >>> found = view(random_system(3), Domain(()))
        >>> found.policy.decision, found.rules is None or len(found.numbers) > 0
        ('all', True)
    """
    match model:
        case RuleBase():
            return _of_rules(model, domain)
        case FuzzyTree():
            raw = rules_from_tree(model, "raw") if model.sets else None
            whole = _of_rules(rules_from_tree(model), domain)
            return msgspec.structs.replace(whole, tree=model, raw=raw)
        case FuzzySystem():
            rules = as_rules(model)
            if rules is None:
                return _of_system(model, domain)
            return msgspec.structs.replace(_of_rules(rules, domain), system=model)


def _of_rules(rules: RuleBase, domain: Domain) -> View:
    meant = rules.semantics
    policy = Policy(meant.conjunction, "strongest", meant.uncovered, meant.missing)
    numbers = tuple(range(1, len(rules.rules) + 1))
    return View(rules, policy, domain, numbers=numbers)


# --- systems


def _of_system(system: FuzzySystem, domain: Domain) -> View:
    conjunction = _conjunction(system)
    terms, declined = _terms(system)
    sides, moved = _within(system, domain)
    taken = _Taken(conjunction, terms, [*moved, *declined])
    number = 0
    for position, block in enumerate(system.blocks, 1):
        if block.activation.method != "general":
            taken.note_activation(position, block)
        for index, rule in enumerate(block.rules, 1):
            number += 1
            of_block = f" of block {position}" if len(system.blocks) > 1 else ""
            taken.take(f"rule {index}{of_block}", number, rule, block)
    rules = None
    if taken.rules:
        rules = RuleBase(
            system.name,
            tuple(dict.fromkeys(rule.then for rule in taken.rules)),
            tuple(_variable(one, terms[one.name]) for one in system.inputs),
            tuple(taken.rules),
            Semantics(conjunction),
        )
    return View(
        rules,
        Policy(conjunction, "all"),
        sides,
        system=system,
        places=tuple(taken.places),
        numbers=tuple(taken.numbers),
        declined=tuple(taken.answers),
        is_whole=taken.is_whole,
    )


def _conjunction(system: FuzzySystem) -> Conjunction:
    """Return the AND of most rules that have one, of those with an exact method."""
    counts: dict[Conjunction, int] = {"min": 0, "product": 0}
    for block in system.blocks:
        norm = _NORMS.get(block.conjunction)
        if norm:
            counts[norm] += sum(And in joints(rule.when) for rule in block.rules)
    return "product" if counts["product"] > counts["min"] else "min"


Terms = Mapping[str, Mapping[str, Shape]]


def _terms(system: FuzzySystem) -> tuple[Terms, list[Answer]]:
    """Return the terms of the inputs that have an exact shape, and the others."""
    terms: dict[str, dict[str, Shape]] = {}
    others: list[Answer] = []
    for one in system.inputs:
        terms[one.name] = {}
        for label in one.labels:
            shape = None if one.parts and one.clips else _shape(label)
            if shape is not None:
                terms[one.name][label.name] = shape
                continue
            kind = str(label.curve.__struct_config__.tag)
            reason = f"its curve ({kind}) has no exact method"
            if one.parts and one.clips:
                reason = "a combination that is moved into a range has no exact method"
            asking = sum(
                any(q.variable == one.name and q.label == label.name for q in asked)
                for asked in ([*questions(rule.when)] for rule in system.rules)
            )
            count = "1 rule asks" if asking == 1 else f"{asking} rules ask"
            name = f"term {label.name!r} of {one.name!r}"
            found = _declined("FTD02", name, f"{reason}; {count} for it")
            terms_of = (Label(one.name, label.name),)
            others.append(msgspec.structs.replace(found, terms=terms_of))
    return terms, others


def _shape(label: SystemLabel) -> Shape | None:
    """Return the exact shape of a term, with its height; None if there is none."""
    shape = shape_of(label.curve)
    if shape is None or label.height == 1.0:
        return None if shape is None or any(shape_mistakes(shape)) else shape
    if not isinstance(shape, Points):
        return None
    degrees = tuple(degree * label.height for degree in shape.degrees)
    height = Fraction(label.height)
    is_exact = all(
        Fraction(scaled) == Fraction(degree) * height
        for scaled, degree in zip(degrees, shape.degrees, strict=True)
    )
    return Points(shape.values, degrees) if is_exact else None


def _variable(one: SystemInput, terms: Mapping[str, Shape]) -> Variable:
    found = tuple(Term(name, shape) for name, shape in terms.items())
    return Variable(one.name, found, one.unit, one.low, one.high, one.parts)


def _within(system: FuzzySystem, domain: Domain) -> tuple[Domain, list[Answer]]:
    """Return the domain within the ranges that inputs are moved into."""
    clipped = {one.name: one for one in system.inputs if one.clips and not one.parts}
    sides: list[Side] = []
    answers: list[Answer] = []
    for side in domain.sides:
        one = clipped.get(side.variable)
        low, high = side.low, side.high
        if one is not None:
            low, high = _moved(one, low), _moved(one, high)
        if (low, high) != (side.low, side.high):
            answers.append(
                _declined(
                    "FTD07",
                    f"input {side.variable!r}",
                    f"values outside its range are moved to its ends, so it is asked "
                    f"from {low!r} to {high!r}",
                )
            )
            side = msgspec.structs.replace(side, low=low, high=high)
        sides.append(side)
    return Domain(tuple(sides)), answers


def _moved(one: SystemInput, value: float) -> float:
    value = value if one.low is None else max(value, one.low)
    return value if one.high is None else min(value, one.high)


def _declined(code: str, subject: str, reason: str) -> Answer:
    sentence = f"{subject} is not taken over: {reason}"
    return Answer(code, subject, sentence, Declined(code, reason), is_finding=False)


class _Taken:
    """The rules that were taken over so far, and what was left out."""

    def __init__(
        self, conjunction: Conjunction, terms: Terms, answers: list[Answer]
    ) -> None:
        self.conjunction: Conjunction = conjunction
        self.terms = terms
        self.answers = answers
        self.rules: list[Rule] = []
        self.places: list[str] = []
        self.numbers: list[int] = []
        self.is_whole = True

    def note_activation(self, position: int, block: RuleBlock) -> None:
        """Note that a block activates only some of the rules that fire."""
        subject = f"the activation of block {position}"
        reason = f"it is {block.activation.method!r}; only conditions are asked"
        self.answers.append(_declined("FTD07", subject, reason))

    def take(self, name: str, number: int, rule: SystemRule, block: RuleBlock) -> None:
        """Take over a rule, or note why not."""
        if rule.weight == 0.0:
            self._never(name, "its weight is 0")
            return
        try:
            if rule.weight != 1.0:
                _decline("FTD07", f"its weight of {rule.weight!r} has no exact method")
            ways = _Conditions(self.conjunction, self.terms, block).ways(rule.when)
        except _DecliningError as error:
            self.is_whole = False
            self.answers.append(_declined(error.code, name, error.reason))
            return
        if not ways:
            self._never(name, "its condition is never true")
        for position, way in enumerate(ways, 1):
            self.rules.append(Rule(way, _text(rule.then)))
            self.places.append(name if len(ways) == 1 else f"way {position} of {name}")
            self.numbers.append(number)

    def _never(self, name: str, why: str) -> None:
        sentence = f"{name} never fires: {why}"
        proof = Proved("read off the rule; no input was needed")
        self.answers.append(
            Answer("FT101", name, sentence, proof, is_finding=True, severity="error")
        )


def _text(then: Iterable[Conclusion]) -> str:
    """Return what a rule concludes, as people read it."""
    return " and ".join(
        " ".join((one.output, "is", *one.hedges, one.label)) for one in then
    )


# --- conditions


class _DecliningError(Exception):
    """A condition has no exact counterpart."""

    def __init__(self, code: str, reason: str) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason


def _decline(code: str, reason: str) -> NoReturn:
    raise _DecliningError(code, reason)


Way = tuple[Clause, ...]
"""Clauses that all hold."""

_ALWAYS: tuple[Way, ...] = ((),)
_NEVER: tuple[Way, ...] = ()


class _Conditions:
    """Makes ways of a block's conditions: each holds as far as the best of them."""

    def __init__(
        self, conjunction: Conjunction, terms: Terms, block: RuleBlock
    ) -> None:
        self.conjunction = conjunction
        self.terms = terms
        self.block = block

    def ways(self, condition: Condition | None, *, negated: bool = False) -> list[Way]:
        """Return the ways in which a condition holds; none if it never does.

        Args:
            condition: The condition; None holds always.
            negated: Whether the ways in which it does not hold are asked for.
        """
        match condition:
            case None:
                return [*_ALWAYS]
            case Is():
                return self._asked(condition, negated=negated)
            case Not(part=part):
                return self.ways(part, negated=not negated)
            case And(parts=(part,)) | Or(parts=(part,)):
                return self.ways(part, negated=negated)
            case And(parts=parts):
                self._check_joint("and", negated=negated)
                return self._joined(parts, is_union=negated, negated=negated)
            case Or(parts=parts):
                whole = self._one_clause(parts, negated=negated)
                if whole is not None:
                    return [(whole,)]
                self._check_joint("or", negated=negated)
                return self._joined(parts, is_union=not negated, negated=negated)

    def _asked(self, asked: Is, *, negated: bool) -> list[Way]:
        """Return the only way of a question: a clause, or always, or never."""
        hedges = asked.hedges
        while hedges and hedges[0] == "not":
            negated, hedges = not negated, hedges[1:]
        if hedges and hedges[0] == "any":
            return [*(_NEVER if negated else _ALWAYS)]
        if hedges:
            _decline("FTD07", f"the hedge {hedges[0]!r} has no exact method")
        terms = self.terms.get(asked.variable)
        if terms is None:
            _decline("FTD07", f"it asks the output {asked.variable!r}")
        if asked.label is None or asked.label not in terms:
            name = f"{asked.label!r} of {asked.variable!r}"
            _decline("FTD02", f"the curve of {name} has no exact method")
        return [(Clause(asked.variable, (asked.label,), negated),)]

    def _one_clause(
        self, parts: Sequence[Condition], *, negated: bool
    ) -> Clause | None:
        """Return `x is a or b` as one clause, if it is that and a maximum."""
        if self.block.disjunction != "maximum":
            return None
        found = [self.ways(part) for part in parts]
        clauses = [ways[0][0] for ways in found if len(ways) == 1 and len(ways[0]) == 1]
        names = {clause.variable for clause in clauses}
        is_plain = len(clauses) == len(parts) and not any(c.negated for c in clauses)
        if len(names) > 1 or not is_plain:
            return None
        terms = dict.fromkeys(term for clause in clauses for term in clause.terms)
        return Clause(names.pop(), tuple(terms), negated)

    def _check_joint(self, word: Literal["and", "or"], *, negated: bool) -> None:
        """Raise unless a joint is a minimum, maximum or product where that is exact."""
        block = self.block
        norm = block.conjunction if word == "and" else block.disjunction
        exact = {"and": ("minimum", "product"), "or": ("maximum",)}[word]
        if norm not in exact:
            _decline("FTD01", f"its {word!r} is the {norm}, which has no exact method")
        if word == "and" and negated and norm == "product":
            _decline("FTD07", "it negates a product, which has no exact method")
        if word == "or" and negated and self.conjunction == "product":
            _decline("FTD07", "it negates an 'or' within rules that multiply")
        if word == "and" and not negated and _NORMS[norm] != self.conjunction:
            text = f"its 'and' is the {norm}, and that of most rules is another"
            _decline("FTD01", text)

    def _joined(
        self, parts: Sequence[Condition], *, is_union: bool, negated: bool
    ) -> list[Way]:
        found = [*(_NEVER if is_union else _ALWAYS)]
        for part in parts:
            ways = self.ways(part, negated=negated)
            count = len(found) + len(ways) if is_union else len(found) * len(ways)
            if count > MOST_WAYS:
                _decline("FTD05", f"it can hold in more than {MOST_WAYS} ways")
            if is_union:
                found += ways
            else:
                pairs = itertools.product(found, ways)
                found = [self._both(one, other) for one, other in pairs]
            found = [*dict.fromkeys(found)]
        return found

    def _both(self, one: Way, other: Way) -> Way:
        """Return clauses of both; a minimum does not change by asking twice."""
        both = (*one, *other)
        return tuple(dict.fromkeys(both)) if self.conjunction == "min" else both
