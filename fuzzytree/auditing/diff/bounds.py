"""How far the outputs of two systems can be apart, in real numbers.

A weighted average moves by no more than its numbers do while the degrees stay, and
always lies between them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from operator import itemgetter

from fuzzytree.auditing.decide.answers import ZERO
from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.diff.keys import Entry, Keys, facts_of
from fuzzytree.model import (
    Formula,
    FuzzySystem,
    Linear,
    Singleton,
    SystemOutput,
    Term,
    Variable,
    sampled_values,
)
from fuzzytree.semantics import joined_outputs

Point = Mapping[str, Fraction]
_Sum = tuple[Point, Fraction]
_Ends = tuple[Fraction, Fraction]
_Bound = tuple[Fraction, str]


def _clamped(variable: SystemOutput | Variable, value: Fraction) -> Fraction:
    low, high = variable.low, variable.high
    value = value if low is None else max(value, Fraction(low))
    return value if high is None else min(value, Fraction(high))


def _linear(term: Term, system: FuzzySystem) -> _Sum | None:
    """Return the number of a term as a sum of columns; None if it is none."""
    match term.function:
        case Singleton(value=value):
            return {}, Fraction(value)
        case Linear(weights=weights, offset=offset):
            pairs = zip(system.inputs, weights, strict=True)
            return {name: Fraction(w) for name, w in pairs if w}, Fraction(offset)
        case _:
            return None


# --- bounds


def most(
    old: FuzzySystem, new: FuzzySystem, output: str, domain: Domain
) -> _Bound | None:
    """Return how far an output of two systems is apart at most, and why.

    It holds in real numbers, for points of the domain at which both answer a number.

    Returns:
        None where nothing bounds the output, such as a formula.
    """
    one, other = (_Numbers(system, output, domain) for system in (old, new))
    bounds = [bound for bound in (_moved(one, other), _apart(one, other)) if bound]
    return min(bounds, key=itemgetter(0), default=None)


class _Numbers:
    """An output of a system on a domain, and what its rules conclude of it."""

    def __init__(self, system: FuzzySystem, output: str, domain: Domain) -> None:
        keys = Keys(system, domain)
        self.system, self.domain = system, domain
        self.output = keys.outputs[output]
        self.entries: Sequence[Entry] = [*keys.entries(output)]
        self.is_joined = output in joined_outputs(system)
        self.is_sum = self.output.defuzzifier.method == "weighted sum"

    @property
    def is_small(self) -> bool:
        """Whether no degree of a condition is above 1."""
        variables, blocks = self.system.variables, self.system.blocks
        curves = [term.function for v in variables for term in v.terms]
        is_sum = any(block.disjunction == "sum" for block in blocks)
        return not (is_sum or any(isinstance(curve, Formula) for curve in curves))

    def sums(self) -> Iterable[_Sum | None]:
        """Yield each number as a sum of columns; None if it is none that is bounded."""
        clipped = {v.name for v in self.system.variables if v.clips}
        for entry in self.entries:
            linear = _linear(entry.term, self.system)
            is_plain = linear is not None and not clipped & {*linear[0]}
            yield linear if is_plain else None

    def span(self) -> _Ends | None:
        """Return between which ends the output lies."""
        output = self.output
        spans: list[_Ends | None] = []
        if self.is_sum:
            return None
        if self.output.defuzzifier.is_weighted:
            spans += [sum_ and _ends(*sum_, self.domain) for sum_ in self.sums()]
        else:  # singletons may lie beyond the range
            xs = [output.low or 0.0, output.high or 0.0, *sampled_values(output)]
            spans.append((Fraction(min(xs)), Fraction(max(xs))))
        if output.default is not None:
            spans.append((Fraction(output.default), Fraction(output.default)))
        ends = [end for span in spans if span for end in span]
        if None in spans or not ends:
            return None
        low, high = min(ends), max(ends)
        if output.clips:
            return _clamped(output, low), _clamped(output, high)
        return low, high


def _ends(weights: Point, offset: Fraction, domain: Domain) -> _Ends | None:
    """Return between which ends a sum of columns lies."""
    low = high = offset
    for name, weight in weights.items():
        side = domain.side(name)
        if side is None:
            return None
        ends = sorted(weight * end for end in side.ends)
        low, high = low + ends[0], high + ends[1]
    return low, high


def _apart(one: _Numbers, other: _Numbers) -> _Bound | None:
    """Return how far apart numbers are that lie between some ends."""
    span, other_span = one.span(), other.span()
    if span is None or other_span is None:
        return None
    apart = max(abs(other_span[1] - span[0]), abs(span[1] - other_span[0]))
    return apart, "both answers lie between the numbers that rules conclude"


def _moved(one: _Numbers, other: _Numbers) -> _Bound | None:
    """Return the bound where only numbers differ, and all degrees are the same."""
    degrees, others = (
        [facts_of(of.output), *((e.strength, e.term.height) for e in of.entries)]
        for of in (one, other)
    )
    is_large = one.is_sum and not (one.is_small and other.is_small)
    is_weighted = one.output.defuzzifier.is_weighted
    is_free = is_weighted and not (is_large or one.is_joined or other.is_joined)
    if degrees != others or not is_free:
        return None
    moves = [ZERO]
    for entry, a, b in zip(one.entries, one.sums(), other.sums(), strict=True):
        if a is None or b is None:
            return None
        weights = {n: a[0].get(n, ZERO) - b[0].get(n, ZERO) for n in {**a[0], **b[0]}}
        ends = _ends(weights, a[1] - b[1], one.domain)
        if ends is None:
            return None
        scale = Fraction(entry.most) if one.is_sum else 1
        moves.append(scale * max(abs(ends[0]), abs(ends[1])))
    bound = sum(moves, ZERO) if one.is_sum else max(moves)
    before, after = one.output.default, other.output.default
    if before != after:
        if before is None or after is None:
            return None
        bound = max(bound, abs(Fraction(before) - Fraction(after)))
    return (
        bound,
        "degrees are the same, and no number that rules conclude moves by more",
    )
