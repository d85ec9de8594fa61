"""A fuzzy system as it is audited: its conditions as rules, and what they mean.

A rule of `a and (b or c)` becomes two rules of an audit, its ways; under minimum
or product it holds as far as the best of them. The classes of the rules are the texts
of their conclusions.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import Literal, NamedTuple

from fuzzytree.auditing.recheck.audit_records import Audit, Declined, Label
from fuzzytree.auditing.recheck.enclosing import Between, bounds, hedged, joined
from fuzzytree.auditing.recheck.meaning import Point, value_of
from fuzzytree.auditing.recheck.model_records import (
    And,
    Block,
    Clause,
    Conclusion,
    Condition,
    Input,
    Is,
    Not,
    Or,
    Rule,
    Rules,
    Scaled,
    Semantics,
    System,
    Term,
    Variable,
)
from fuzzytree.auditing.recheck.outcomes import (
    DoesNotHoldError,
    UndecidedError,
    require,
)
from fuzzytree.auditing.recheck.polynomials import ONE

MOST_WAYS = 64
Way = tuple[Clause, ...]


class Owner(NamedTuple):
    """The rule of the system that a way belongs to."""

    number: int
    name: str
    block: Block
    when: Condition | None
    weight: Fraction


class View:
    """The rules of a system as its audit numbers them.

    Attributes:
        rules: A rule for each way.
        owners: Whose way each rule is.
        ways: The numbers of the rules that are ways of each owner.
        names: What answers call each rule.
        silent: The names of the rules that never fire, as their text says.
        labels: The terms of the audit.
        is_whole: Whether no rule is left out.
    """

    def __init__(self, system: System, audit: Audit) -> None:
        self.system = system
        self.left_out = {
            (one.subject, *one.terms): one
            for one in audit.answers
            if isinstance(one.state, Declined) and one.code.startswith("FTD")
        }
        self.inputs = {one.name: one for one in system.inputs}
        self.conjunction = _conjunction(system)
        self.is_whole, self.is_plain = True, True
        self.owners: list[Owner] = []
        self.names: list[str] = []
        self.silent: list[str] = []
        items: list[Rule] = []
        for owner, then in _owners(system):
            for way in self._ways_of(owner):
                items.append(Rule(way, then, None))
                self.owners.append(owner)
        self.ways = {
            owner: [n for n, one in enumerate(self.owners, 1) if one is owner]
            for owner in dict.fromkeys(self.owners)
        }
        for owner, ways in self.ways.items():
            of_one = [owner.name]
            several = [f"way {n} of {owner.name}" for n in range(1, len(ways) + 1)]
            self.names += several if len(ways) > 1 else of_one
        self.labels = [
            Label(one.name, label.name)
            for one in system.inputs
            for label in one.labels
            if not self._is_left_out(one.name, label.name)
        ]
        kept = dict.fromkeys(clause for rule in items for clause in rule.when)
        self.rules = Rules(
            system.name,
            tuple(dict.fromkeys(rule.then for rule in items)),
            tuple(_variable(one, kept) for one in system.inputs),
            tuple(items),
            Semantics(self.conjunction, None, None),
            None,
            (),
        )

        self.shapes = {
            (v.name, t.name): t.shape for v in self.rules.variables for t in v.terms
        }

    def _is_left_out(self, variable: str, term: str) -> bool:
        subject = f"term {term!r} of {variable!r}"
        return (subject, Label(variable, term)) in self.left_out

    def _ways_of(self, owner: Owner) -> list[Way]:
        """Return the ways of a rule; none if it is left out, or never fires.

        Raises:
            DoesNotHoldError: If it is left out, and need not be.
        """
        is_left_out = (owner.name,) in self.left_out
        try:
            ways = [] if not owner.weight else self._ways(owner.when, owner.block)
        except UndecidedError:
            ways = [()]
            self.is_plain &= is_left_out
        else:
            clause = [
                (c.variable, term) for way in ways for c in way for term in c.terms
            ]
            is_easy = owner.weight == 1 and all(
                not self._is_left_out(*pair) and "\0" not in pair[1] for pair in clause
            )
            text = f"{owner.name} is left out, and can be audited"
            require(not (is_left_out and is_easy), text)
        if is_left_out:
            self.is_whole = False
            return []
        if not ways:
            self.silent.append(owner.name)
        return ways

    def _ways(
        self, condition: Condition | None, block: Block, *, negated: bool = False
    ) -> list[Way]:
        """Return the ways in which a condition holds, or does not; none if never.

        Raises:
            UndecidedError: If it has no exact ones.
        """
        match condition:
            case None:
                return [()]
            case Is():
                return self._ways_of_clause(condition, negated=negated)
            case Not(part=part):
                return self._ways(part, block, negated=not negated)
            case And(parts=(part,)) | Or(parts=(part,)):
                return self._ways(part, block, negated=negated)
            case And(parts=parts):
                is_fit = block.conjunction == "minimum" or not negated
                is_fit &= negated or _NAMES.get(block.conjunction) == self.conjunction
                is_union = negated
            case Or(parts=parts):
                one = self._one_clause(parts, block, negated=negated)
                if one is not None:
                    return [(one,)]
                is_fit = block.disjunction == "maximum"
                is_fit &= not negated or self.conjunction == "min"
                is_union = not negated
        if not is_fit:
            raise UndecidedError("a condition that does not hold by its ways")
        result: list[Way] = [] if is_union else [()]
        for part in parts:
            ways = self._ways(part, block, negated=negated)
            if is_union:
                result += ways
            else:
                result = [self._both(*pair) for pair in itertools.product(result, ways)]
            result = [*dict.fromkeys(result)]
            if len(result) > MOST_WAYS:
                raise UndecidedError("a condition that holds in too many ways")
        return result

    def _both(self, one: Way, other: Way) -> Way:
        both = (*one, *other)
        return tuple(dict.fromkeys(both)) if self.conjunction == "min" else both

    def _ways_of_clause(self, clause: Is, *, negated: bool) -> list[Way]:
        hedges = clause.hedges
        while hedges[:1] == ("not",):
            negated, hedges = not negated, hedges[1:]
        if hedges[:1] == ("any",):
            return [] if negated else [()]
        known = self.inputs.get(clause.variable)
        if known is None or clause.label not in {one.name for one in known.labels}:
            raise UndecidedError("it uses an output")
        term = "\0".join((clause.label or "", *hedges))
        return [(Clause(clause.variable, (term,), negated),)]

    def _one_clause(
        self, parts: tuple[Condition, ...], block: Block, *, negated: bool
    ) -> Clause | None:
        """Return `x is a or b` as one clause, if it is that and a maximum."""
        clause = [*_plain(parts)]
        if block.disjunction != "maximum" or None in clause:
            return None
        result = [
            way[0]
            for one in clause
            if one
            for way in self._ways_of_clause(one, negated=False)
        ]
        if len({clause.variable for clause in result}) > 1:
            return None
        terms = dict.fromkeys(term for clause in result for term in clause.terms)
        return Clause(result[0].variable, tuple(terms), negated)

    def questions(self) -> set[tuple[str, str]]:
        """Return the variable and term of every proposition of the rules."""
        result: set[tuple[str, str]] = set()
        todo = [rule.when for block in self.system.blocks for rule in block.rules]
        while todo:
            match todo.pop():
                case Is(variable=variable, label=label):
                    result.add((variable, label or ""))
                case And(parts=parts) | Or(parts=parts):
                    todo += parts
                case Not(part=part):
                    todo.append(part)
                case None:
                    pass
        return result

    def absent(self, name: str) -> list[int]:
        """Return the number, from 0, of a rule of which no way is taken over."""
        if any(owner.name == name for owner in self.owners):
            return []
        return [one.number for one, _ in _owners(self.system) if one.name == name]

    def may_conflict(self, one: int, other: int) -> bool:
        """Return whether two rules say different things of one output."""
        entries = [
            {(c.output, _text((c,))) for c in self._then(number)}
            for number in (one, other)
        ]
        shared = {name for name, _ in entries[0]} & {name for name, _ in entries[1]}
        return any(name in shared for name, _ in entries[0] ^ entries[1])

    def _then(self, number: int) -> tuple[Conclusion, ...]:
        place = self.owners[number - 1].number
        return [rule for block in self.system.blocks for rule in block.rules][
            place
        ].then

    def strengths(self, point: Point, numbers: Iterable[int]) -> dict[int, Between]:
        """Return between which numbers the strengths of some rules lie.

        Raises:
            DoesNotHoldError: If a rule's ways are not its own condition.
        """
        values = {v.name: value_of(v, point) for v in self.rules.variables}
        known: dict[Clause, Between] = {}
        result: dict[int, Between] = {}
        for owner in dict.fromkeys(self.owners[number - 1] for number in numbers):
            ways = self.ways[owner]
            own = _times(owner.weight, self.condition(owner.when, owner.block, values))
            if not self.rules.rules[ways[0] - 1].when:
                result[ways[0]] = own  # of no clauses, or not of ways alone
                continue
            for number in ways:
                one = (ONE, ONE)
                for clause in self.rules.rules[number - 1].when:
                    if clause not in known:
                        known[clause] = self._degree(clause, values[clause.variable])
                    join = "minimum" if self.conjunction == "min" else "product"
                    one = joined(join, one, known[clause])
                result[number] = _times(owner.weight, one)
            best = [max(result[number][end] for number in ways) for end in (0, 1)]
            if own[1] < best[0] or best[1] < own[0]:
                raise DoesNotHoldError(f"{owner.name} holds otherwise than its ways")
        return result

    def _degree(self, clause: Clause, x: Fraction) -> Between:
        every = [bounds(self.shapes[clause.variable, t], x) for t in clause.terms]
        one = max(low for low, _ in every), max(high for _, high in every)
        return hedged("not", one) if clause.negated else one

    def condition(
        self, condition: Condition | None, block: Block, values: Point
    ) -> Between:
        """Return between which numbers the degree of a condition lies.

        Raises:
            UndecidedError: If it uses an output.
        """
        match condition:
            case None:
                return ONE, ONE
            case Not(part=part):
                return hedged("not", self.condition(part, block, values))
            case Is(variable=variable, label=label, hedges=hedges):
                one = (ONE, ONE)
                if variable not in self.inputs:
                    raise UndecidedError("what is concluded of an output")
                for term in self.inputs[variable].labels:
                    if term.name == label:
                        whole = Scaled(term.curve, term.height, ())
                        one = bounds(whole, values[variable])
                for hedge in reversed(hedges):
                    one = hedged(hedge, one)
                return one
            case And(parts=parts) | Or(parts=parts):
                norm = block.conjunction
                if isinstance(condition, Or):
                    norm = block.disjunction
                result = [self.condition(part, block, values) for part in parts]
                whole_of = result[0]
                for other in result[1:]:
                    whole_of = joined(norm or "", whole_of, other)
                return whole_of


_NAMES: dict[str | None, Literal["min", "product"]] = {
    "minimum": "min",
    "product": "product",
}


def _times(weight: Fraction, one: Between) -> Between:
    return weight * one[0], weight * one[1]


def _conjunction(system: System) -> Literal["min", "product"]:
    """Return the AND of most rules that have one, of minimum and product."""
    counts = {"min": 0, "product": 0}
    for block in system.blocks:
        norm = _NAMES.get(block.conjunction)
        if norm:
            counts[norm] += sum(_has_and(rule.when) for rule in block.rules)
    return "product" if counts["product"] > counts["min"] else "min"


def _has_and(condition: Condition | None) -> bool:
    match condition:
        case And():
            return True
        case Or(parts=parts):
            return any(map(_has_and, parts))
        case Not(part=part):
            return _has_and(part)
        case _:
            return False


def _owners(system: System) -> Iterator[tuple[Owner, str]]:
    """Yield every rule of a system with the text of what it concludes."""
    number = 0
    for position, block in enumerate(system.blocks, 1):
        of_block = f" of block {position}" if len(system.blocks) > 1 else ""
        for index, rule in enumerate(block.rules, 1):
            name, weight = f"rule {index}{of_block}", Fraction(rule.weight)
            yield Owner(number, name, block, rule.when, weight), _text(rule.then)
            number += 1


def _text(then: Iterable[Conclusion]) -> str:
    texts = (" ".join((c.output, "is", *c.hedges, c.label)) for c in then)
    return " and ".join(texts)


def _plain(parts: tuple[Condition, ...]) -> Iterator[Is | None]:
    """Yield the questions that parts join by OR alone; None for anything else."""
    for part in parts:
        match part:
            case Or(parts=inner):
                yield from _plain(inner)
            case Is(hedges=(), label=str()):
                yield part
            case _:
                yield None


def _variable(one: Input, clauses: dict[Clause, None]) -> Variable:
    """Return an input with the terms of its propositions, hedged ones by both names."""
    curves = {label.name: label for label in one.labels}
    names = dict.fromkeys(curves)
    names |= dict.fromkeys(
        t for c in clauses if c.variable == one.name for t in c.terms
    )
    terms: list[Term] = []
    for name in names:
        label, *hedges = name.split("\0")
        shape = curves[label].curve
        if curves[label].height != 1 or hedges:
            shape = Scaled(shape, curves[label].height, tuple(hedges))
        terms.append(Term(name, shape))
    return Variable(one.name, tuple(terms), one.unit, one.low, one.high, one.parts)
