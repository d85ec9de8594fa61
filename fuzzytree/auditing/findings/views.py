"""The rules of a model as an audit sees them: a rule base with all its meaning.

Rule bases and trees are audited as they are. A fuzzy system that only stands for a rule
base is audited as that one. Of any other system a *view* is made: its conditions as
rules whose classes are the texts of what they conclude. A rule of `a and (b
or c)` becomes two rules, one for each way in which it can hold: under minimum or
product, and maximum, its strength is that of the stronger one, exactly. A curve
without an exact counterpart is bounded by two lines of points, and a weight is part
of a rule (see `rule_bounds`). What has no place here is left out, and an answer says
so for each term and each rule.

A view shows how strongly conditions hold, at every double. What outputs make of it,
their curves and numbers, is not part of it.
"""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.states import Declined, Proved
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, Policy
from fuzzytree.auditing.findings.rule_bounds import bounded_rules
from fuzzytree.auditing.findings.subject import AuditView
from fuzzytree.auditing.findings.system_conditions import (
    MOST_QUESTIONS,
    Conditions,
    DecliningError,
    SystemTerms,
    Way,
    decline,
    ranges_of,
    terms_of,
)
from fuzzytree.model import (
    And,
    Conclusion,
    Conjunction,
    Document,
    FuzzySystem,
    FuzzyTree,
    Rule,
    RuleBase,
    RuleBlock,
    Semantics,
    SystemRule,
    Variable,
    joints,
    questions,
)
from fuzzytree.semantics import as_rules, rules_from_tree


def view(model: Document, domain: Domain) -> AuditView:
    """Return the rules of a model as they are audited.

    Args:
        model: A tree: its relative rules, which decide as it does. A rule base: itself.
            A system: the rule base it stands for, or a view of it.
        domain: The domain of the audit.

    Example:
        >>> from fuzzytree.testing import random_system
        >>> rules = view(random_system(3), Domain(()))
        >>> rules.policy.decision, rules.rules is None or len(rules.numbers) > 0
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


def _of_rules(rules: RuleBase, domain: Domain) -> AuditView:
    meant = rules.semantics
    policy = Policy(meant.conjunction, "strongest", meant.uncovered, meant.missing)
    numbers = tuple(range(1, len(rules.rules) + 1))
    return AuditView(rules, policy, domain, numbers=numbers)


# --- systems


def _of_system(system: FuzzySystem, domain: Domain) -> AuditView:
    conjunction = _conjunction(system)
    sides, moved = _within(system, domain)
    ranges = ranges_of(system, sides)
    terms, declined = terms_of(system, ranges)
    taken = _Taken(conjunction, terms, [*moved, *declined])
    number = 0
    for position, block in enumerate(system.blocks, 1):
        if block.activation.method != "general":
            taken.note_activation(position, block)
        for index, rule in enumerate(block.rules, 1):
            number += 1
            of_block = f" of block {position}" if len(system.blocks) > 1 else ""
            taken.take(f"rule {index}{of_block}", number, rule, block)
    rules = both = None
    if taken.rules:
        rules = RuleBase(
            system.name,
            tuple(dict.fromkeys(rule.then for rule in taken.rules)),
            tuple(terms.variable(one) for one in system.variables),
            tuple(taken.rules),
            Semantics(conjunction),
        )
        both = bounded_rules(
            rules, taken.weights, {**terms.bounds, **terms.hedged_terms}, ranges
        )
    return AuditView(
        rules,
        Policy(conjunction, "all"),
        sides,
        system=system,
        rule_names=tuple(taken.rule_names),
        numbers=tuple(taken.numbers),
        declined=tuple(taken.answers),
        left_out=taken.left_out,
        is_whole=taken.is_whole,
        bounds=both,
    )


def _conjunction(system: FuzzySystem) -> Conjunction:
    """Return the AND of most rules that have one, of those with an exact method."""
    counts: dict[Conjunction, int] = {"minimum": 0, "product": 0}
    for block in system.blocks:
        norm = block.conjunction
        if norm == "minimum" or norm == "product":
            counts[norm] += sum(And in joints(rule.when) for rule in block.rules)
    return "product" if counts["product"] > counts["minimum"] else "minimum"


def _within(system: FuzzySystem, domain: Domain) -> tuple[Domain, list[AuditAnswer]]:
    """Return the domain within the ranges that inputs are moved into."""
    clipped = {one.name: one for one in system.variables if one.clips and not one.parts}
    sides: list[DomainSide] = []
    answers: list[AuditAnswer] = []
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
                    f"values outside its range are moved to its ends, so its domain is "
                    f"from {low!r} to {high!r}",
                )
            )
            side = msgspec.structs.replace(side, low=low, high=high)
        sides.append(side)
    return Domain(tuple(sides)), answers


def _moved(one: Variable, value: float) -> float:
    value = value if one.low is None else max(value, one.low)
    return value if one.high is None else min(value, one.high)


def _declined(code: str, subject: str, reason: str) -> AuditAnswer:
    return audit_answer("FTD.left-out", subject, Declined(code, reason))


class _Taken:
    """The rules that were taken over so far, and what was left out."""

    def __init__(
        self, conjunction: Conjunction, terms: SystemTerms, answers: list[AuditAnswer]
    ) -> None:
        self.conjunction: Conjunction = conjunction
        self.terms = terms
        self.answers = answers
        self.rules: list[Rule] = []
        self.weights: list[float] = []
        self.rule_names: list[str] = []
        self.numbers: list[int] = []
        self.left_out: dict[str, int] = {}
        self.is_whole = True

    def note_activation(self, position: int, block: RuleBlock) -> None:
        """Note that a block activates only some of the rules that fire."""
        subject = f"the activation of block {position}"
        reason = f"it is {block.activation.method!r}; only conditions are audited"
        self.answers.append(_declined("FTD07", subject, reason))

    def take(self, name: str, number: int, rule: SystemRule, block: RuleBlock) -> None:
        """Take over a rule, or note why not."""
        taken = len(self.rules)
        self._take(name, number, rule, block)
        if len(self.rules) == taken:
            self.left_out[name] = number

    def _take(self, name: str, number: int, rule: SystemRule, block: RuleBlock) -> None:
        if rule.weight == 0.0:
            self._never("FT101.weight-0", name)
            return
        try:
            if sum(1 for _ in questions(rule.when)) > MOST_QUESTIONS:
                decline("FTD05", f"it has more than {MOST_QUESTIONS} propositions")
            if rule.weight != 1.0 and not self.terms.plain:
                decline("FTD07", "there is no input that its weight could stand for")
            ways = Conditions(self.conjunction, self.terms, block).ways(rule.when)
            if rule.weight != 1.0 and self.conjunction == "minimum":
                self._check_weight(ways)
        except DecliningError as error:
            self.is_whole = False
            self.answers.append(_declined(error.code, name, error.reason))
            return
        if not ways:
            self._never("FT101.never-true", name)
        for position, way in enumerate(ways, 1):
            self.rules.append(Rule(way, _text(rule.then)))
            self.weights.append(rule.weight)
            self.rule_names.append(
                name if len(ways) == 1 else f"way {position} of {name}"
            )
            self.numbers.append(number)

    def _check_weight(self, ways: Iterable[Way]) -> None:
        """Refuse a weight on a curve that has no points in its place.

        Raises:
            DecliningError: If there is one.
        """
        for proposition in dict.fromkeys(
            proposition for way in ways for proposition in way
        ):
            for term in proposition.terms:
                if self.terms.pointed(proposition.variable, term) is None:
                    where = f"{term!r} of {proposition.variable!r}"
                    text = f"{where} has no points to be weighted"
                    decline("FTD07", f"the curve of {text}")

    def _never(self, message: str, name: str) -> None:
        proof = Proved("read off the rule; no input was needed")
        self.answers.append(audit_answer(message, name, proof))


def _text(then: Iterable[Conclusion]) -> str:
    """Return what a rule concludes, as people read it."""
    return " and ".join(
        " ".join((one.output, "is", *one.hedges, one.term)) for one in then
    )
