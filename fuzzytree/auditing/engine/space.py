"""Boxes of inputs, many at a time: what rules can reach on each, by doubles.

A segment is an input's interval, halved again and again; a box is a row with the number
of a part of each segment. What the propositions of a rule reach on a part is computed
once and looked up by all boxes that use it. Two rules are compared cell by cell on a
part: where one degree falls as the other does, their ratio says more than both ranges.
A combination of inputs lies, on a box, between the sums of its summands' ends, rounded
outwards.
"""

from __future__ import annotations

import functools
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.auditing.decide.lines import together
from fuzzytree.auditing.engine.arrangement import Arrangement
from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.levels import LevelAxis, levels_of
from fuzzytree.auditing.engine.linear import feasible, row_of
from fuzzytree.auditing.engine.pieces import bends, proposition_ranges
from fuzzytree.model import (
    Proposition,
    RuleBase,
    Shape,
    Variable,
    checkpoint,
    shapes_of,
)
from fuzzytree.numerics import LEAST, Enclosure, U, outwards

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray, IntArray


_CELLS = 16  # of a part, in which degrees are enclosed
_FINEST = 2.0**-52  # the share of a line that is not parted any more
_WIDEST = 20.0  # a logarithm: what can be 0 is not infinitely worth parting


class RivalPair(NamedTuple):
    """Two rules that are compared, by position: is `one` above `other`?"""

    one: int
    other: int


class BoundTable(NamedTuple):
    """What is known on each of some intervals."""

    # shape (intervals, rules): at least this is the degree of a rule's propositions
    low: FloatArray
    high: FloatArray  # at most this
    at: FloatArray  # about this at the interval's middle
    # shape (intervals, pairs). Under the product, at most this many times is `one` as
    # large as `other`, propositions of both left out. Under the minimum, at least this
    # is `other` where it is below `one`; infinite if it never is
    most: FloatArray
    least: FloatArray  # at least this many times under the product; 0 under the minimum
    spread: FloatArray  # how far apart both are, for choosing which line to part
    width: FloatArray  # shape (intervals, rules): the same for a rule alone


class Intervals(NamedTuple):
    """Intervals `low < x <= high`, in order and apart from each other."""

    low: FloatArray
    high: FloatArray

    def hold(self, a: FloatArray, b: FloatArray) -> npt.NDArray[np.bool_]:
        """Return which cells `a < x <= b` lie within one of the intervals."""
        if not len(self.low):
            return np.zeros(a.shape, dtype=bool)
        place = np.searchsorted(self.high, b).clip(max=len(self.low) - 1)
        starts: npt.NDArray[np.bool_] = self.low[place] <= a
        ends: npt.NDArray[np.bool_] = b <= self.high[place]
        return starts & ends & (a < b)


class VariableUse:
    """What some rules ask of one variable.

    Attributes:
        propositions: The propositions that differ, by what they say.
        rules: For each rule the positions of its propositions.
        pairs: For each pair the propositions that only one of both has.
        ordered: For each pair where `other` is at least as large, exactly known.
        steps: Where a curve jumps.
        marks: Where a curve turns or one of its pieces ends.
    """

    def __init__(
        self,
        rules: RuleBase,
        variable: Variable,
        chosen: Sequence[int],
        pairs: Sequence[RivalPair],
        ordered: Sequence[Intervals] = (),
    ) -> None:
        self.is_product = rules.semantics.conjunction == "product"
        self.shapes = shapes_of([variable])
        known: dict[tuple[frozenset[Shape], bool], int] = {}
        self.propositions: list[Proposition] = []
        self.rules: list[tuple[int, ...]] = []
        for position in chosen:
            positions: list[int] = []
            for proposition in rules.rules[position].when:
                if proposition.variable == variable.name:
                    said = frozenset(
                        self.shapes[variable.name, t] for t in proposition.terms
                    )
                    key = (said, proposition.negated)
                    if key not in known:
                        known[key] = len(known)
                        self.propositions.append(proposition)
                    positions.append(known[key])
            self.rules.append(tuple(sorted(positions)))
        place = {position: n for n, position in enumerate(chosen)}
        self.pairs = [
            _apart(self.rules[place[one]], self.rules[place[other]])
            for one, other in pairs
        ]
        self.ordered = ordered or [Intervals(np.empty(0), np.empty(0))] * len(pairs)
        self.ones = [place[pair.one] for pair in pairs]
        self.others = [place[pair.other] for pair in pairs]
        turns = [bends(shape) for shape in dict.fromkeys(self.shapes.values())]
        nothing = np.empty(0)
        self.steps = np.unique(np.concatenate([nothing, *(t.steps for t in turns)]))
        self.marks = np.unique([place[0] for t in turns for place in t.places])

    def table(self, edges: FloatArray, middle: FloatArray) -> BoundTable:
        """Return what is known on intervals.

        `edges`: shape (intervals, cells + 1): the ends of each interval's cells;
        `middle`: shape (intervals,): a value in each.
        """
        lows: list[FloatArray] = []
        highs: list[FloatArray] = []
        ats: list[FloatArray] = []
        for proposition in self.propositions:
            _, cells = proposition_ranges(proposition, self.shapes, edges)
            here, _ = proposition_ranges(
                proposition, self.shapes, middle[:, np.newaxis]
            )
            lows.append(cells.low)
            highs.append(cells.high)
            ats.append((here.low + here.high)[:, 0] / 2)
        size = edges.shape[0], edges.shape[1] - 1
        low = [self._joined(lows, positions, size, -1) for positions in self.rules]
        high = [self._joined(highs, positions, size, 1) for positions in self.rules]
        at = [self._joined(ats, positions, size[:1], 0) for positions in self.rules]
        compare = _ratios if self.is_product else _losses
        apart: list[tuple[FloatArray, FloatArray]] = []
        for (mine, theirs), one, spans in zip(
            self.pairs, self.ones, self.ordered, strict=True
        ):
            ours, others = (
                Enclosure(
                    self._joined(lows, positions, size, -1),
                    self._joined(highs, positions, size, 1),
                )
                for positions in (mine, theirs)
            )
            is_below = spans.hold(edges[:, :-1], edges[:, 1:])
            apart.append(compare(ours, others, high[one], is_below))
        least_low = _columns([one.min(axis=1) for one in low], size[0])
        most_high = _columns([one.max(axis=1) for one in high], size[0])
        most = _columns([one for one, _ in apart], size[0])
        least = _columns([one for _, one in apart], size[0])
        width = self._width(least_low, most_high)
        spread = self._width(least, most) if self.is_product else width[:, self.ones]
        if not self.is_product:
            spread = np.maximum(spread, width[:, self.others])
        return BoundTable(
            least_low, most_high, _columns(at, size[0]), most, least, spread, width
        )

    def _width(self, low: FloatArray, high: FloatArray) -> FloatArray:
        if not self.is_product:
            return high - low
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            wide = np.log(high / low)
        return np.where(high > low, np.clip(wide, 0.0, _WIDEST), 0.0)

    def _joined(
        self,
        degrees: Sequence[FloatArray],
        positions: Sequence[int],
        size: tuple[int, ...],
        side: int,
    ) -> FloatArray:
        """Return the degree of some propositions together, rounded down, up or not."""
        checkpoint()
        chosen = [degrees[place] for place in positions]
        if not self.is_product:
            return functools.reduce(np.minimum, chosen, np.ones(size))
        return product_of(chosen, side) if chosen else np.ones(size)


def product_of(factors: Sequence[FloatArray], side: int) -> FloatArray:
    """Return a product of factors, at least 0, as a bound from below (-1) or above (1).

    Each multiplication is off by one rounding, relative to the product; what could
    underflow becomes 0 or `LEAST`. A factor of 0 makes exactly 0, and factors of 1 do
    not round.
    """
    result = factors[0]
    for factor in factors[1:]:
        before = result
        with np.errstate(invalid="ignore", over="ignore", under="ignore"):
            result = before * factor
            off = result * (1.0 + side * 2 * U)
        if not side:
            continue
        off = np.where((before == 1.0) | (factor == 1.0), result, off)
        if side < 0:
            result = np.where(off >= LEAST, off, 0.0)  # infinity times 0 is not known
        else:
            off = np.maximum(off, LEAST)
            result = np.where((before == 0.0) | (factor == 0.0), 0.0, off)
    return result


def _apart(
    one: Sequence[int], other: Sequence[int]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    mine, theirs = Counter(one), Counter(other)
    return tuple((mine - theirs).elements()), tuple((theirs - mine).elements())


def _columns(columns: Sequence[FloatArray], rows: int) -> FloatArray:
    return np.stack(columns, axis=1) if columns else np.empty((rows, 0))


def _ratios(
    one: Enclosure, other: Enclosure, whole: FloatArray, is_below: npt.NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Return how many times one is as large as the other, at most and at least.

    Cells where one's rule cannot fire do not count for the most; where the other is
    known to be as large (`is_below`), it is at most 1.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        most = one.high / other.low * (1.0 + 4 * U)
        least = one.low / other.high * (1.0 - 4 * U)
    most = np.where(other.low == 0.0, np.inf, np.maximum(most, LEAST))
    is_below = is_below | (one.high <= other.low)
    most = np.where(is_below, np.minimum(most, 1.0), most)
    most = np.where(whole == 0.0, 0.0, most)
    least = np.where(other.high == 0.0, np.inf, least)
    least = np.where((one.low == 0.0) | (least < LEAST), 0.0, least)
    return most.max(axis=1), least.min(axis=1)


def _losses(
    one: Enclosure, other: Enclosure, whole: FloatArray, is_below: npt.NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Return how small the other is, at least, where it is below one's rule."""
    del one
    is_below = is_below | (other.low >= whole)
    most = np.where(is_below, np.inf, other.low).min(axis=1)
    return most, np.zeros(most.shape)


class Segment:
    """An input's interval and its parts, each `start < x <= end`, or a point.

    Attributes:
        start: Shape (parts,): where each part begins.
        end: Where it ends.
        middle: Where it is parted: a double in it; a step or mark of a curve if
            there is a good one.
        child: The number of the lower half; the upper one follows. -1 before it is
            parted.
        table: What is known on each part.
        roots: The parts that make up the whole.
    """

    def __init__(
        self, use: VariableUse, low: float, high: float, *, is_open: bool
    ) -> None:
        self.use = use
        self.finest = float(high - low) * _FINEST
        first = [(low, high)] if low < high else []
        # A curve may jump just behind the lower end, which is then a part of its own.
        if not is_open and (low == high or low in use.steps):
            first.append((low, low))
        ends = np.array(first).reshape(-1, 2)
        self.start, self.end = ends[:, 0], ends[:, 1]
        self.middle = self._middles(self.start, self.end)
        self.child = np.full(len(first), -1)
        self.table = use.table(_edges(self.start, self.end), self.middle)
        self.roots = range(len(first))

    @property
    def can_part(self) -> npt.NDArray[np.bool_]:
        """Shape (parts,): whether each is wide enough, and a double lies within."""
        is_within = (self.start < self.middle) & (self.middle < self.end)
        is_wide: npt.NDArray[np.bool_] = self.end - self.start > self.finest
        return is_within & is_wide

    def halves(self, parts: IntArray) -> IntArray:
        """Return the lower half of each part; the number after is the upper one."""
        new = np.unique(parts[self.child[parts] < 0])
        if len(new):
            count = len(self.child)
            self.child[new] = count + 2 * np.arange(len(new))
            start = np.stack([self.start[new], self.middle[new]], axis=1).ravel()
            end = np.stack([self.middle[new], self.end[new]], axis=1).ravel()
            middle = self._middles(start, end)
            table = self.use.table(_edges(start, end), middle)
            self.start = np.concatenate([self.start, start])
            self.end = np.concatenate([self.end, end])
            self.middle = np.concatenate([self.middle, middle])
            self.child = np.concatenate([self.child, np.full(len(start), -1)])
            self.table = BoundTable(
                *map(np.concatenate, zip(self.table, table, strict=True))
            )
        return self.child[parts]

    def _middles(self, start: FloatArray, end: FloatArray) -> FloatArray:
        middle = start * 0.5 + end * 0.5
        middle = np.where((start < middle) & (middle < end), middle, end)
        quarter = (end - start) * 0.25
        for mark in _neighbours(self.use.marks, middle):
            is_central = (start + quarter < mark) & (mark < end - quarter)
            middle = np.where(is_central, mark, middle)
        for step in _neighbours(self.use.steps, middle):
            middle = np.where((start < step) & (step < end), step, middle)
        return middle


def _neighbours(marks: FloatArray, x: FloatArray) -> tuple[FloatArray, ...]:
    """Return the marks about each value, the nearer one last."""
    if not len(marks):
        return ()
    after = np.searchsorted(marks, x)
    below = marks[np.maximum(after - 1, 0)]
    above = marks[np.minimum(after, len(marks) - 1)]
    is_below = x - below < above - x
    return np.where(is_below, above, below), np.where(is_below, below, above)


def _edges(start: FloatArray, end: FloatArray) -> FloatArray:
    share = np.arange(_CELLS + 1) / _CELLS
    edges = start[:, np.newaxis] * (1.0 - share) + end[:, np.newaxis] * share
    edges = np.clip(edges, start[:, np.newaxis], end[:, np.newaxis])
    return np.maximum.accumulate(edges, axis=1)


# --- boxes

_ROUNDED = (-1, 1, 0, 1, -1)  # each bound of a table: down, up or not
_MIX_CELLS = 4  # of a combination's values on one box


class Combination(NamedTuple):
    """A combination of inputs."""

    use: VariableUse  # the propositions of rules on it
    # the summands' weights, each with the position of its line
    weights: tuple[tuple[int, float], ...]
    constant: tuple[float, float]  # bounds of what is added to them
    side: DomainSide | None  # its limits in the domain, if it has any


class BoxReach(NamedTuple):
    """What is known of each of some boxes."""

    table: BoundTable  # as of `lines.Table`, of all propositions together
    is_empty: npt.NDArray[np.bool_]  # whether a box has no point of the domain
    # for each line how far pairs are apart, shape (boxes, pairs)
    spreads: list[FloatArray]
    widths: list[FloatArray]  # for each line how far rules vary, shape (boxes, rules)


class Space:
    """The inputs that some rules need, on a domain.

    `is_ordered`: whether it is worked out exactly where one's curve is above the
    other's: it takes longer, and proves what doubles leave open.

    Attributes:
        names: The inputs.
        lines: One for each.
        mixes: The combinations with propositions or limits.
        is_product: Whether AND is the product.
    """

    def __init__(
        self,
        base: Arrangement,
        chosen: Sequence[int],
        pairs: Sequence[RivalPair] = (),
        *,
        is_ordered: bool = False,
    ) -> None:
        rules, domain = base.rules, base.domain
        self.is_product = rules.semantics.conjunction == "product"
        self.base = base
        used = {c.variable for n in chosen for c in rules.rules[n].when}
        mixed = [
            v
            for v in rules.variables
            if v.parts and (v.name in used or domain.side(v.name) is not None)
        ]
        needed = used | {part.input for v in mixed for part in v.parts}
        inputs = [v for v in rules.variables if not v.parts and v.name in needed]
        # At least one, so that there is a box at all.
        inputs = inputs or [v for v in rules.variables if not v.parts][:1]
        self.names = tuple(v.name for v in inputs)
        self.lines: list[Segment] = []
        ordered = _ordered(base, pairs) if is_ordered else {}
        for variable in inputs:
            side = domain.side(variable.name)
            if side is None:
                raise ValueError(f"the domain has no side for {variable.name!r}")
            of = VariableUse(
                rules, variable, chosen, pairs, ordered.get(variable.name, ())
            )
            self.lines.append(Segment(of, side.low, side.high, is_open=side.is_open))
        number = {name: n for n, name in enumerate(self.names)}
        self.mixes = [
            _mix(
                v,
                VariableUse(rules, v, chosen, pairs, ordered.get(v.name, ())),
                number,
                domain,
            )
            for v in mixed
        ]
        self.limits = [
            row_of(v, number, side.ends, is_open_low=side.is_open)
            for v in mixed
            if (side := domain.side(v.name)) is not None
        ]

    @property
    def root_count(self) -> int:
        """How many boxes make up the domain."""
        return math.prod(len(line.roots) for line in self.lines)

    def roots(self) -> IntArray:
        """Return the boxes that make up the domain, shape (boxes, inputs)."""
        boxes = np.zeros((1, 0), dtype=np.int64)
        for line in self.lines:
            parts = np.tile(line.roots, len(boxes))
            before = np.repeat(boxes, len(line.roots), axis=0)
            boxes = np.column_stack([before, parts])
        return boxes

    def halves(self, boxes: IntArray, on: IntArray) -> IntArray:
        """Return both halves of each box, parted on a line: first all lower ones."""
        lower = boxes.copy()
        upper = boxes.copy()
        for number, line in enumerate(self.lines):
            rows = np.flatnonzero(on == number)
            if len(rows):
                child = line.halves(boxes[rows, number])
                lower[rows, number], upper[rows, number] = child, child + 1
        return np.concatenate([lower, upper])

    def can_part(self, boxes: IntArray) -> npt.NDArray[np.bool_]:
        """Return whether each line of each box can be parted, shape (boxes, inputs)."""
        result = [
            line.can_part[boxes[:, number]] for number, line in enumerate(self.lines)
        ]
        return np.stack(result, axis=1)

    def ends(self, boxes: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return where each box begins and ends, each of shape (boxes, inputs)."""
        return (
            self._chosen([line.start for line in self.lines], boxes),
            self._chosen([line.end for line in self.lines], boxes),
        )

    def middles(self, boxes: IntArray) -> FloatArray:
        """Return a point of each box, shape (boxes, inputs)."""
        return self._chosen([line.middle for line in self.lines], boxes)

    def _chosen(self, of: Sequence[FloatArray], boxes: IntArray) -> FloatArray:
        return np.stack([one[boxes[:, n]] for n, one in enumerate(of)], axis=1)

    def point(self, box: IntArray) -> dict[str, Fraction]:
        """Return a point of one box for the inputs that are needed: its middle.

        Where combinations are limited it is one within the limits, if there is one.
        """
        result = [*map(Fraction, self.middles(box[np.newaxis])[0].tolist())]
        if self.limits:
            low, high = (ends[0].tolist() for ends in self.ends(box[np.newaxis]))
            ranges = [*zip(map(Fraction, low), map(Fraction, high), strict=True)]
            result = feasible(ranges, self.limits) or result
        return dict(zip(self.names, result, strict=True))

    def look(self, boxes: IntArray) -> BoxReach:
        """Return what is known of boxes."""
        tables = [
            BoundTable(*(field[boxes[:, number]] for field in line.table))
            for number, line in enumerate(self.lines)
        ]
        spreads = [table.spread for table in tables]
        widths = [table.width for table in tables]
        is_empty = np.zeros(len(boxes), dtype=bool)
        start, end = self.ends(boxes)
        middle = self.middles(boxes)
        for mix in self.mixes:
            low, high = mix_range(mix, start, end)
            if mix.side is not None:
                is_empty |= (high < mix.side.low) | (low > mix.side.high)
                if mix.side.is_open:
                    is_empty |= high <= mix.side.low
            if not mix.use.propositions:
                continue
            table = mix.use.table(*_mix_cells(mix, low, high, middle))
            tables.append(table)
            _share(mix, end - start, table, spreads, widths)
        return BoxReach(self._together(tables), is_empty, spreads, widths)

    def _together(self, tables: Sequence[BoundTable]) -> BoundTable:
        fields = [*zip(*tables, strict=True)][:5]
        nothing = np.empty((len(fields[0][0]), 0))
        joined = (
            [product_of(of, side) for of, side in zip(fields, _ROUNDED, strict=True)]
            if self.is_product
            else [np.minimum.reduce(of) for of in fields]
        )
        return BoundTable(*joined, *[nothing] * 2)


def _ordered(
    base: Arrangement, pairs: Sequence[RivalPair]
) -> dict[str, list[Intervals]]:
    """Return, for each variable and pair, where `other` is at least as large.

    Only where each of both is one curve: a product of several has no order there.
    """
    if not pairs or base.is_empty:
        return {}
    is_product = base.rules.semantics.conjunction == "product"
    result: dict[str, list[Intervals]] = {}
    for axis, levels in zip(base.axes, levels_of(base).axes, strict=True):
        of: list[Intervals] = []
        for pair in pairs:
            propositions = (axis.propositions[pair.one], axis.propositions[pair.other])
            if is_product and max(map(len, propositions)) > 1:
                of.append(Intervals(np.empty(0), np.empty(0)))
            else:
                of.append(_spans(levels, pair))
        result[axis.variable.name] = of
    return result


def _spans(axis: LevelAxis, pair: RivalPair) -> Intervals:
    """Return where one rule's degree on an axis is surely at most another's."""
    one, other = axis.function(pair.one).upper, axis.function(pair.other).lower
    if set(axis.propositions[pair.other]) <= set(axis.propositions[pair.one]):
        one = other
    ends: list[tuple[Fraction, Fraction, bool]] = []  # and whether the upper one is in
    for a, b, p, q, r, s in together(one, other):
        low, high = a, b
        if (p > r and q >= s) or (p >= r and q > s):
            continue
        if (p - r) * (q - s) < 0:
            place = a + (b - a) * (p - r) / (p - r - q + s)
            low, high = (a, place) if p < r else (place, b)
        is_in = high < b or one.value(high) <= other.value(high)
        if ends and ends[-1][1:] == (low, True):
            low = ends.pop()[0]
        ends.append((low, high, is_in))
    lows = [outwards(low)[1] for low, _, _ in ends]
    highs = [
        outwards(high)[0] if is_in else math.nextafter(outwards(high)[0], -math.inf)
        for _, high, is_in in ends
    ]
    return Intervals(np.array(lows), np.array(highs))


def _mix(
    variable: Variable, use: VariableUse, number: Mapping[str, int], domain: Domain
) -> Combination:
    constant = -sum(
        (Fraction(p.weight) * Fraction(p.centre) for p in variable.parts), Fraction(0)
    )
    weights = tuple((number[part.input], part.weight) for part in variable.parts)
    return Combination(use, weights, outwards(constant), domain.side(variable.name))


def mix_range(
    mix: Combination, start: FloatArray, end: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return what a combination's exact values lie between on boxes.

    A sum of n products of doubles is off by less than (n + 2) U of the sum of their
    sizes; twice that covers the rounding of the bound itself.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        low = np.full(len(start), mix.constant[0])
        high = np.full(len(start), mix.constant[1])
        size = np.maximum(np.abs(low), np.abs(high))
        for line, weight in mix.weights:
            a, b = weight * start[:, line], weight * end[:, line]
            low, high = low + np.minimum(a, b), high + np.maximum(a, b)
            size = size + np.maximum(np.abs(a), np.abs(b))
        off = size * (2 * (len(mix.weights) + 2) * U) + 2.0**-1000
        low, high = low - off, high + off
    largest = float(np.finfo(np.float64).max)
    low = np.nan_to_num(low, nan=-largest, neginf=-largest)
    return low, np.nan_to_num(high, nan=largest, posinf=largest)


def _mix_cells(
    mix: Combination, low: FloatArray, high: FloatArray, middle: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the cells of a combination's values, and its value in the middle."""
    low = np.nextafter(low, -np.finfo(np.float64).max)  # a cell is open below
    share = np.arange(_MIX_CELLS + 1) / _MIX_CELLS
    edges = low[:, np.newaxis] * (1.0 - share) + high[:, np.newaxis] * share
    edges = np.clip(edges, low[:, np.newaxis], high[:, np.newaxis])
    value = np.full(len(low), sum(mix.constant) / 2)
    for line, weight in mix.weights:
        value = value + weight * middle[:, line]
    return np.maximum.accumulate(edges, axis=1), np.clip(value, low, high)


def _share(
    mix: Combination,
    sizes: FloatArray,
    table: BoundTable,
    spreads: list[FloatArray],
    widths: list[FloatArray],
) -> None:
    """Add to each line its part of how far a combination makes rules vary."""
    whole = sum(abs(weight) * sizes[:, line] for line, weight in mix.weights)
    for line, weight in mix.weights:
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            part = abs(weight) * sizes[:, line] / whole
        part = np.nan_to_num(part)[:, np.newaxis]
        spreads[line] = spreads[line] + part * table.spread
        widths[line] = widths[line] + part * table.width
