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

from msgspec.structs import replace

from fuzzytree.auditing.decide.axes import function_lines
from fuzzytree.auditing.decide.domain import Domain, DomainSide, span
from fuzzytree.auditing.decide.lines import Hedged
from fuzzytree.auditing.decide.rules import LeftOut, rules_of
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
    """Return the rules of a model as they are audited on a domain.

    Of a tree these are its relative rules, which decide as it does; of a system those
    of the rule base that it stands for, or its conditions.
    """
    match model:
        case RuleBase():
            return _of_rules(model, domain)
        case FuzzyTree():
            raw = rules_from_tree(model, "raw") if model.sets else None
            whole = _of_rules(rules_from_tree(model), domain)
            return replace(whole, tree=model, raw=raw)
        case FuzzySystem():
            rules = as_rules(model)
            if rules is None:
                return _of_system(model, domain)
            return replace(_of_rules(rules, domain), system=model)


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
        if not _is_moved(v) and (shape := _shape(t)) is not None
    }
    curves = dict(_curves(system, sides, shapes))
    answers += _of_terms(system, shapes, curves, sides)
    every = rules_of(system)
    left = {rule.number: rule for rule in every.left_out}
    for rule in every.rules:
        if len(rule.literals) > 1 and rule.norm != conjunction:
            text = f"its 'and' is the {rule.norm}, and that of most rules is another"
            name = rule.name.partition(" of ")[2] if "way " in rule.name else rule.name
            left[rule.number] = LeftOut(name, rule.number, "FTD01", text)
    kept = [rule for rule in every.rules if rule.number not in left]
    for position, block in enumerate(system.blocks, 1):
        if block.activation.method != "general":
            why = f"it is {block.activation.method!r}; only conditions are audited"
            name = f"the activation of block {position}"
            answers.append(_declined("FTD07", name, why))
    answers += (_declined(one.code, one.name, one.reason) for one in left.values())
    proof = Proved("read off the rule; no input was needed")
    answers += (
        audit_answer(f"FT101.{why}", name, proof) for name, _, why in every.silent
    )
    whens = [tuple(map(_readable, rule.when)) for rule in kept]
    terms = dict.fromkeys(
        (one.variable, term) for when in whens for one in when for term in one.terms
    )
    terms |= {(v.name, t.name): None for v in system.variables for t in v.terms}
    rules = None
    if kept:
        pairs = zip(whens, kept, strict=True)
        rules = RuleBase(
            system.name,
            tuple(dict.fromkeys(rule.then for rule in kept)),
            tuple(_named(one, shapes, terms) for one in system.variables),
            tuple(Rule(when, rule.then) for when, rule in pairs),
            Semantics(conjunction),
        )
    return AuditView(
        rules,
        tuple(kept),
        Policy(conjunction, "all"),
        sides,
        system=system,
        rule_names=tuple(rule.name for rule in kept),
        numbers=tuple(rule.number for rule in kept),
        declined=tuple(answers),
        left_out={one.name: one.number for one in left.values()}
        | {name: number for name, number, _ in every.silent},
        is_whole=not left,
        curves=curves,
        inexact=frozenset(terms.keys() - shapes.keys()),
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
        ends = [side.low, side.high]
        if variable := clipped.get(side.variable):
            if variable.low is not None:
                ends = [max(end, variable.low) for end in ends]
            if variable.high is not None:
                ends = [min(end, variable.high) for end in ends]
        low, high = ends
        if (low, high) != (side.low, side.high):
            why = (
                f"values outside its range are moved to its ends, so its domain is "
                f"from {low!r} to {high!r}"
            )
            answers.append(_declined("FTD07", f"input {side.variable!r}", why))
        sides.append(replace(side, low=low, high=high))
    return Domain(tuple(sides)), answers


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
    exact = [Fraction(degree) * Fraction(term.height) for degree in shape.degrees]
    return Points(shape.values, degrees) if [*map(Fraction, degrees)] == exact else None


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
    for variable in system.variables:
        names = [part.input for part in variable.parts] or [variable.name]
        if any(domain.side(name) is None for name in names) or _is_moved(variable):
            continue
        for term in variable.terms:
            shape = shape_of(term.function)
            is_wrong = shape is not None and any(shape.mistakes())
            is_free = isinstance(term.function, Formula | Linear) or is_wrong
            if (variable.name, term.name) not in shapes and not is_free:
                function = Hedged(term.function, term.height, ())
                yield (variable.name, term.name), function


def _is_moved(variable: Variable) -> bool:
    """Return whether a combination is moved into a range."""
    return bool(variable.parts and variable.clips)


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
    every = [
        (variable, term) for variable in system.variables for term in variable.terms
    ]
    for variable, term in every:
        key = variable.name, term.name
        if key in shapes:
            continue
        message, facts = "FTD.left-out", dict[str, float]()
        tag = term.function.__struct_config__.tag
        reason = f"its curve ({tag}) has no exact method"
        if _is_moved(variable):
            reason = "a combination that is moved into a range has no exact method"
        if key in curves:
            message = "FTD.bounded"
            reason += "; its shape and its overlaps are not checked"
            both = function_lines(curves[key], *span(variable, domain))
            pairs = zip(both.lower.at, both.upper.at, strict=True)
            apart = max((high - low for low, high in pairs), default=Fraction(0))
            facts = {"apart": outwards(apart)[1]}
        few = {0: "no rule uses it", 1: "1 rule uses it"}
        reason += f"; {few.get(uses[key], f'{uses[key]} rules use it')}"
        title, state = f"term {term.name!r} of {key[0]!r}", Declined("FTD02", reason)
        names = (TermName(*key),)
        yield audit_answer(message, title, state, terms=names, facts=facts)
