"""The number of a system's output in fractions, and how far two outputs can be apart.

Outputs that weight numbers are evaluated exactly where every curve and operation is one
of fractions. A bound holds for real numbers: a weighted average moves by no more than
its numbers do while the degrees stay, and always lies between them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import reduce
from types import MappingProxyType
from typing import TypeVar

from fuzzytree.auditing.diff.system_keys import Contribution, contributions, facts_of
from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.model import (
    And,
    Condition,
    Formula,
    FuzzySystem,
    Linear,
    Not,
    Or,
    Proposition,
    RuleBlock,
    Singleton,
    SystemOutput,
    Term,
    Variable,
)
from fuzzytree.numerics import exact_degree
from fuzzytree.semantics import joined_outputs, shape_of

_ONE = Fraction(1)
_Operation = Callable[[Fraction, Fraction], Fraction]
_NORMS: Mapping[str, _Operation] = MappingProxyType(
    {
        "minimum": min,
        "product": lambda a, b: a * b,
        "bounded difference": lambda a, b: max(Fraction(0), a + b - 1),
        "maximum": max,
        "algebraic sum": lambda a, b: a + b - a * b,
        "bounded sum": lambda a, b: min(_ONE, a + b),
        "sum": lambda a, b: a + b,
    }
)
_HEDGES: Mapping[str, Callable[[Fraction], Fraction]] = MappingProxyType(
    {
        "any": lambda _: _ONE,
        "not": lambda d: 1 - d,
        "very": lambda d: d**2,
        "cubed": lambda d: d**3,
        "very very": lambda d: d**4,
    }
)

Point = Mapping[str, Fraction]


class NotExactError(Exception):
    """A part of a system has no value in fractions."""


def number_at(system: FuzzySystem, output: str, point: Point) -> Fraction | None:
    """Return the number of an output at a point, None where it is no number.

    Raises:
        NotExactError: If the output looks at a curve, or some curve, norm, hedge or
            activation is none of fractions, or a rule uses an output.
    """
    one = _named(system.outputs, output)
    how = one.defuzzifier
    if not how.is_weighted or output in joined_outputs(system):
        raise NotExactError(output)
    values = _values(system.variables, point)
    total = weight = Fraction(0)
    is_number = False
    for block in system.blocks:
        for rule in block.rules:
            then = [each.output for each in rule.then]
            if output not in then or not rule.weight:
                continue
            if block.activation.method != "general":
                raise NotExactError(block.activation.method)
            degree = Fraction(rule.weight)
            degree *= 1 if rule.when is None else _at(rule.when, block, system, values)
            for conclusion in rule.then if degree > 0 else ():
                degree = _hedged(conclusion.hedges, degree)
                if conclusion.output == output and degree > 0:
                    label = _named(one.terms, conclusion.term)
                    total += degree * _number(label, system, values)
                    weight += degree
                    is_number = True
    if not is_number:
        return _answered(one, None)
    is_average = how.method == "weighted average"
    return _answered(one, total / weight if is_average else total)


def _values(inputs: Sequence[Variable], point: Point) -> dict[str, Fraction]:
    values: dict[str, Fraction] = {}
    for one in inputs:
        value = point.get(one.name, Fraction(0))
        if one.parts:
            centred = ((p, values[p.input] - Fraction(p.centre)) for p in one.parts)
            value = sum((Fraction(p.weight) * x for p, x in centred), Fraction(0))
        values[one.name] = _clamped(one, value) if one.clips else value
    return values


def _clamped(one: Variable | SystemOutput, value: Fraction) -> Fraction:
    value = value if one.low is None else max(value, Fraction(one.low))
    return value if one.high is None else min(value, Fraction(one.high))


def _answered(one: SystemOutput, number: Fraction | None) -> Fraction | None:
    if number is None and one.default is not None:
        number = Fraction(one.default)
    return _clamped(one, number) if one.clips and number is not None else number


_Named = TypeVar("_Named", Variable, SystemOutput, Term)
_Sum = tuple[Mapping[str, Fraction], Fraction]


def _named(parts: Iterable[_Named], name: str) -> _Named:
    """Return the part of a name.

    Raises:
        NotExactError: If there is none.
    """
    for one in parts:
        if one.name == name:
            return one
    raise NotExactError(name)


def _linear(label: Term, system: FuzzySystem) -> _Sum | None:
    """Return the number of a label as a sum of columns; None if it is none."""
    match label.function:
        case Singleton(value=value):
            return {}, Fraction(value)
        case Linear(weights=weights, offset=offset):
            pairs = zip(system.inputs, weights, strict=True)
            return {name: Fraction(w) for name, w in pairs if w}, Fraction(offset)
        case _:
            return None


def _number(label: Term, system: FuzzySystem, values: Point) -> Fraction:
    known = _linear(label, system)
    if known is None:
        raise NotExactError(str(label.function))
    weights, offset = known
    return sum((w * values[name] for name, w in weights.items()), offset)


def _hedged(hedges: Sequence[str], degree: Fraction) -> Fraction:
    for hedge in reversed(hedges):
        if hedge not in _HEDGES:
            raise NotExactError(hedge)
        degree = _HEDGES[hedge](degree)
    return degree


def _at(
    when: Condition, block: RuleBlock, system: FuzzySystem, values: Point
) -> Fraction:
    match when:
        case Proposition(variable=name, term=label, hedges=hedges):
            if label is None:
                return _hedged(hedges, Fraction(0))  # the last, `any`, makes 1 of it
            term = _named(_named(system.variables, name).terms, label)
            shape = shape_of(term.function)
            if shape is None:
                raise NotExactError(name)
            degree = Fraction(term.height) * exact_degree(shape, values[name])
            return _hedged(hedges, degree)
        case Not(part=part):
            return 1 - _at(part, block, system, values)
        case And(parts=parts):
            norm: str = block.conjunction or "minimum"
        case Or(parts=parts):
            norm = block.disjunction or "maximum"
    if norm not in _NORMS:
        raise NotExactError(norm)
    return reduce(_NORMS[norm], (_at(part, block, system, values) for part in parts))


# --- bounds

_Ends = tuple[Fraction, Fraction]


def most(
    old: FuzzySystem, new: FuzzySystem, output: str, domain: Domain
) -> tuple[Fraction, str] | None:
    """Return how far an output of two systems is apart at most, and why.

    It holds in real numbers, for points of the domain at which both answer a number.

    Returns:
        None where nothing bounds the output, such as a formula.
    """
    one, other = _named(old.outputs, output), _named(new.outputs, output)
    known = contributions(old, output, domain), contributions(new, output, domain)
    bound = _moved(old, new, (one, other), known, domain)
    ends = _span(old, one, known[0], domain)
    other_ends = _span(new, other, known[1], domain)
    if ends is None or other_ends is None:
        return bound
    (a, b), (c, d) = ends, other_ends
    apart = max(abs(d - a), abs(b - c), Fraction(0))
    if bound is not None and bound[0] <= apart:
        return bound
    return apart, "both answers lie between the numbers that rules conclude"


def _moved(
    old: FuzzySystem,
    new: FuzzySystem,
    outputs: tuple[SystemOutput, SystemOutput],
    known: tuple[Sequence[Contribution], Sequence[Contribution]],
    domain: Domain,
) -> tuple[Fraction, str] | None:
    """Return the bound where only numbers differ, and all degrees are the same."""
    one, other = outputs
    same = [entry.strength for entry in known[0]] == [e.strength for e in known[1]]
    is_other = facts_of(one)[1:] != facts_of(other)[1:]
    if not same or is_other or not one.defuzzifier.is_weighted:
        return None
    joined = joined_outputs(old) | joined_outputs(new)
    is_sum = one.defuzzifier.method == "weighted sum"
    if one.name in joined or (is_sum and not (_is_small(old) and _is_small(new))):
        return None
    moves: list[Fraction] = []
    for a, b in zip(*known, strict=True):
        move = _move(old, new, (a, b), domain)
        if move is None:
            return None
        moves.append(move * Fraction(a.most) if is_sum else move)
    bound = sum(moves, Fraction(0)) if is_sum else max(moves, default=Fraction(0))
    if one.default != other.default:
        if one.default is None or other.default is None:
            return None
        bound = max(bound, abs(Fraction(one.default) - Fraction(other.default)))
    return (
        bound,
        "degrees are the same, and no number that rules conclude moves by more",
    )


def _is_small(system: FuzzySystem) -> bool:
    """Return whether no degree of a condition is above 1."""
    curves = [label.function for one in system.variables for label in one.terms]
    norms = {block.disjunction for block in system.blocks}
    return "sum" not in norms and not any(isinstance(one, Formula) for one in curves)


def _move(
    old: FuzzySystem,
    new: FuzzySystem,
    pair: tuple[Contribution, Contribution],
    domain: Domain,
) -> Fraction | None:
    """Return how far the numbers of two entries are apart on the domain, at most."""
    one, other = pair[0].label, pair[1].label
    if one is None or other is None or one.height != other.height:
        return None
    a, b = _weights(old, one), _weights(new, other)
    if a is None or b is None:
        return None
    zero = Fraction(0)
    apart = {n: a[0].get(n, zero) - b[0].get(n, zero) for n in {**a[0], **b[0]}}
    ends = _linear_span(apart, a[1] - b[1], domain)
    return None if ends is None else max(abs(ends[0]), abs(ends[1]))


def _weights(system: FuzzySystem, label: Term) -> _Sum | None:
    """Return the number of a label as a sum of columns that no range clamps."""
    known = _linear(label, system)
    clipped = {one.name for one in system.variables if one.clips}
    return None if known is None or clipped & {*known[0]} else known


def _linear_span(
    weights: Mapping[str, Fraction], offset: Fraction, domain: Domain
) -> _Ends | None:
    low = high = offset
    for name, weight in weights.items():
        side = domain.side(name)
        if side is None:
            return None
        ends = sorted((weight * Fraction(side.low), weight * Fraction(side.high)))
        low, high = low + ends[0], high + ends[1]
    return low, high


def _span(
    system: FuzzySystem,
    one: SystemOutput,
    known: Sequence[Contribution],
    domain: Domain,
) -> _Ends | None:
    """Return between which ends an output's numbers lie."""
    spans: list[_Ends] = []
    if not one.defuzzifier.is_weighted:
        assert one.low is not None  # a system without range is refused
        assert one.high is not None
        spans.append((Fraction(one.low), Fraction(one.high)))
    elif one.defuzzifier.method == "weighted sum":
        return None
    else:
        for entry in known:
            weights = None if entry.label is None else _weights(system, entry.label)
            ends = None if weights is None else _linear_span(*weights, domain)
            if ends is None:
                return None
            spans.append(ends)
    if one.default is not None:
        default = Fraction(one.default)
        spans.append((default, default))
    if not spans:
        return None
    low, high = min(low for low, _ in spans), max(high for _, high in spans)
    return (_clamped(one, low), _clamped(one, high)) if one.clips else (low, high)
