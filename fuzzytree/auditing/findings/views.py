"""The rules of a model as an audit sees them, and what is left out of it.

Rule bases and trees are audited as they are. A fuzzy system that only stands for a rule
base is audited as that one. Of any other system the conditions are audited, as rules
whose classes are the texts of what they conclude; `fuzzytree.auditing.decide.rules`
says how. What outputs make of them, their curves and numbers, is not part of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from fractions import Fraction

import msgspec

from fuzzytree.auditing.decide.axes import function_lines
from fuzzytree.auditing.decide.domain import Domain, DomainSide, span
from fuzzytree.auditing.decide.lines import Hedged
from fuzzytree.auditing.decide.rules import BaseRule, LeftOut, rules_of
from fuzzytree.auditing.decide.states import Declined, Proved
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, Policy, TermName
from fuzzytree.auditing.findings.subject import AuditView, Name
from fuzzytree.model import (
    And,
    Band,
    Conjunction,
    Document,
    Formula,
    FuzzySystem,
    FuzzyTree,
    Linear,
    MembershipFunction,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Shape,
    Term,
    Variable,
    joints,
    questions,
)
from fuzzytree.numerics import outwards
from fuzzytree.semantics import as_rules, rules_from_tree, shape_of


def view(model: Document, domain: Domain) -> AuditView:
    """Return the rules of a model as they are audited.

    Args:
        model: A tree: its relative rules, which decide as it does. A rule base: itself.
            A system: the rule base it stands for, or its conditions.
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
    every = rules_of(rules).rules
    return AuditView(
        rules, every, policy, domain, numbers=tuple(one.number for one in every)
    )


# --- systems


def _of_system(system: FuzzySystem, domain: Domain) -> AuditView:
    conjunction = _conjunction(system)
    sides, answers = _within(system, domain)
    shapes = {
        (v.name, t.name): shape
        for v in system.variables
        for t in v.terms
        if not (v.parts and v.clips) and (shape := _shape(t)) is not None
    }
    curves = dict(_curves(system, sides, shapes))
    answers += _of_terms(system, shapes, curves, sides)
    known = rules_of(system)
    left, kept = [*known.left_out], list[BaseRule]()
    for rule in known.rules:
        if len(rule.literals) > 1 and rule.norm != conjunction:
            text = f"its 'and' is the {rule.norm}, and that of most rules is another"
            name = rule.name.partition(" of ")[2] if "way " in rule.name else rule.name
            left.append(LeftOut(name, rule.number, "FTD01", text))
    numbers = {one.number for one in left}
    kept = [rule for rule in known.rules if rule.number not in numbers]
    answers += (
        _declined("FTD07", f"the activation of block {position}", why)
        for position, block in enumerate(system.blocks, 1)
        if block.activation.method != "general"
        for why in [f"it is {block.activation.method!r}; only conditions are audited"]
    )
    once = {one.number: one for one in left}
    answers += (_declined(one.code, one.name, one.reason) for one in once.values())
    proof = Proved("read off the rule; no input was needed")
    answers += (
        audit_answer(f"FT101.{why}", name, proof) for name, _, why in known.silent
    )
    rules = None
    asked = [one for rule in kept for one in map(_readable, rule.when)]
    made = dict.fromkeys((one.variable, term) for one in asked for term in one.terms)
    made |= {(v.name, t.name): None for v in system.variables for t in v.terms}
    if kept:
        rules = RuleBase(
            system.name,
            tuple(dict.fromkeys(rule.then for rule in kept)),
            tuple(_named(one, shapes, made) for one in system.variables),
            tuple(Rule(tuple(map(_readable, rule.when)), rule.then) for rule in kept),
            Semantics(conjunction),
        )
    absent = [(one.name, one.number) for one in once.values()]
    absent += [(name, number) for name, number, _ in known.silent]
    return AuditView(
        rules,
        tuple(kept),
        Policy(conjunction, "all"),
        sides,
        system=system,
        rule_names=tuple(rule.name for rule in kept),
        numbers=tuple(rule.number for rule in kept),
        declined=tuple(answers),
        left_out=dict(absent),
        is_whole=not left,
        curves=curves,
        inexact=frozenset(made.keys() - shapes.keys()),
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


# --- terms


def _shape(term: Term) -> Shape | None:
    """Return the exact shape of a term, with its height; None if there is none."""
    shape = shape_of(term.function)
    if shape is None or any(shape.mistakes()):
        return None
    if term.height == 1.0:
        return shape
    if not isinstance(shape, Points):
        return None
    degrees = tuple(degree * term.height for degree in shape.degrees)
    ratios = (float(a).as_integer_ratio() for a in (*shape.degrees, term.height))
    *_, by = exact = [Fraction(*ratio) for ratio in ratios]
    is_exact = all(
        Fraction(d) == own * by for d, own in zip(degrees, exact[:-1], strict=True)
    )
    return Points(shape.values, degrees) if is_exact else None


def _readable(one: Proposition) -> Proposition:
    """Return a proposition whose hedges are part of the name of its term."""
    hedges = one.hedges[one.negated :]
    terms = tuple(" ".join((*hedges, term)) for term in one.terms)
    return Proposition(one.variable, terms, ("not",) if one.negated else ())


def _named(one: Variable, shapes: dict[Name, Shape], names: Iterable[Name]) -> Variable:
    """Return an input with some terms; a plateau stands for one without a shape."""
    terms = tuple(
        Term(name, shapes.get((of, name), Band()))
        for of, name in names
        if of == one.name
    )
    return Variable(one.name, terms, one.unit, one.low, one.high, one.parts)


def _curves(
    system: FuzzySystem, domain: Domain, shapes: dict[Name, Shape]
) -> Iterator[tuple[Name, MembershipFunction]]:
    """Yield the functions of terms that lines enclose, and that are none."""
    for one in system.variables:
        names = [part.input for part in one.parts] or [one.name]
        if any(domain.side(name) is None for name in names) or (
            one.parts and one.clips
        ):
            continue
        for term in one.terms:
            shape = shape_of(term.function)
            is_wrong = shape is not None and any(shape.mistakes())
            is_free = isinstance(term.function, Formula | Linear) or is_wrong
            if (one.name, term.name) not in shapes and not is_free:
                yield (one.name, term.name), Hedged(term.function, term.height, ())


def _of_terms(
    system: FuzzySystem,
    shapes: dict[Name, Shape],
    curves: dict[Name, MembershipFunction],
    domain: Domain,
) -> Iterator[AuditAnswer]:
    """Yield what becomes of terms without an exact shape, and why."""
    uses = Counter(
        key
        for rule in system.rules
        for key in {(one.variable, one.term) for one in questions(rule.when)}
    )
    for one in system.variables:
        for term in one.terms:
            key = one.name, term.name
            if key in shapes:
                continue
            message, facts = "FTD.left-out", dict[str, float]()
            reason = f"its curve ({term.function.__struct_config__.tag}) has no exact"
            reason += " method"
            if one.parts and one.clips:
                reason = "a combination that is moved into a range has no exact method"
            if key in curves:
                message = "FTD.bounded"
                reason += "; its shape and its overlaps are not checked"
                both = function_lines(curves[key], *span(one, domain))
                pairs = zip(both.lower.at, both.upper.at, strict=True)
                apart = max((high - low for low, high in pairs), default=Fraction(0))
                facts = {"apart": outwards(apart)[1]}
            count = uses[key]
            few = {0: "no rule uses it", 1: "1 rule uses it"}
            reason += f"; {few.get(count, f'{count} rules use it')}"
            yield audit_answer(
                message,
                f"term {term.name!r} of {one.name!r}",
                Declined("FTD02", reason),
                terms=(TermName(*key),),
                facts=facts,
            )
