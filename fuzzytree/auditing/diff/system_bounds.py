"""The number of a system's output in fractions, and how far two outputs can be apart.

Outputs that weight numbers are evaluated exactly where every strength is a fraction. A
bound holds for real numbers: a weighted average moves by no more than its numbers do
while the degrees stay, and always lies between them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType
from typing import TypeVar

from fuzzytree.auditing.decide import Base
from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.diff.system_keys import Contribution, contributions, facts_of
from fuzzytree.model import (
    Formula,
    FuzzySystem,
    Linear,
    Singleton,
    SystemOutput,
    Term,
    Variable,
)
from fuzzytree.semantics import joined_outputs

_HEDGES: Mapping[str, Callable[[Fraction], Fraction]] = MappingProxyType(
    {
        "any": lambda _: Fraction(1),
        "not": lambda d: 1 - d,
        "very": lambda d: d**2,
        "cubed": lambda d: d**3,
        "very very": lambda d: d**4,
    }
)

Point = Mapping[str, Fraction]


class NotExactError(Exception):
    """A part of a system has no value in fractions."""


class ExactSystem:
    """A system whose outputs are evaluated in fractions."""

    def __init__(self, system: FuzzySystem, domain: Domain) -> None:
        self.system, self.base = system, Base.of(system, domain)
        self.left_out = {one.number for one in self.base.left_out}

    def number(self, output: str, point: Point) -> Fraction | None:
        """Return the number of an output at a point, None where it is no number.

        Raises:
            NotExactError: If the output looks at a curve, or a strength is none of
                fractions, or a rule uses an output.
        """
        system, one = self.system, _named(self.system.outputs, output)
        if not one.defuzzifier.is_weighted or output in joined_outputs(system):
            raise NotExactError(output)
        inner = (v for v in system.variables if v.clips and not v.parts)
        point = {**point, **{v.name: _clamped(v, point[v.name]) for v in inner}}
        low, high = self.base.strengths(point)
        total = weight = Fraction(0)
        blocks = [block for block in system.blocks for _ in block.rules]
        for number, (rule, block) in enumerate(
            zip(system.rules, blocks, strict=True), 1
        ):
            if not rule.weight or all(each.output != output for each in rule.then):
                continue
            ways = [k for k, of in enumerate(self.base.rules) if of.number == number]
            is_exact = number not in self.left_out and all(
                low[k] == high[k] for k in ways
            )
            if not is_exact or block.activation.method != "general":
                raise NotExactError(output)
            degree = max((low[k] for k in ways), default=Fraction(0))
            for conclusion in rule.then if degree else ():
                for hedge in reversed(conclusion.hedges):
                    if hedge not in _HEDGES:
                        raise NotExactError(hedge)
                    degree = _HEDGES[hedge](degree)
                if conclusion.output == output and degree > 0:
                    known = _linear(_named(one.terms, conclusion.term), system)
                    if known is None:
                        raise NotExactError(output)
                    parts = (w * point[name] for name, w in known[0].items())
                    total += degree * sum(parts, known[1])
                    weight += degree
        result = None if one.default is None else Fraction(one.default)
        if weight:
            is_average = one.defuzzifier.method == "weighted average"
            result = total / weight if is_average else total
        return _clamped(one, result) if one.clips and result is not None else result


def _clamped(one: SystemOutput | Variable, value: Fraction) -> Fraction:
    value = value if one.low is None else max(value, Fraction(one.low))
    return value if one.high is None else min(value, Fraction(one.high))


_Named = TypeVar("_Named", SystemOutput, Term)
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
        ends = sorted(weight * end for end in side.ends)
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
