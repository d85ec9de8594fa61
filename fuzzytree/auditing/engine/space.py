"""Boxes of inputs, many at a time: what rules can reach on each, by doubles.

A box is a row of numbers: for each input the part of its line. A combination of inputs
takes, on a box, values between the sums of its summands' ends, rounded outwards.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.auditing.engine.domain import Domain, Side
from fuzzytree.auditing.engine.ground import Ground, Laid
from fuzzytree.auditing.engine.linear import Row, feasible
from fuzzytree.auditing.engine.lines import Asked, Line, Pair, Spans, Table, product_of
from fuzzytree.auditing.engine.variables import linear_form
from fuzzytree.model.rulebase import Variable
from fuzzytree.numerics.enclosures import U
from fuzzytree.numerics.exact import outwards

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model.contracts import FloatArray, IntArray

_MIX_CELLS = 4  # of a combination's values on one box


class Mix(NamedTuple):
    """A combination of inputs.

    Attributes:
        asked: What the rules ask of it.
        weights: The summands' weights, each with the position of its line.
        constant: Bounds of what is added to them.
        side: Its limits in the domain, if it has any.
    """

    asked: Asked
    weights: tuple[tuple[int, float], ...]
    constant: tuple[float, float]
    side: Side | None


class Seen(NamedTuple):
    """What is known of each of some boxes.

    Attributes:
        table: As of `lines.Table`, of all clauses together.
        is_empty: Whether a box has no point of the domain.
        spreads: For each line how far pairs are apart, shape (boxes, pairs).
        widths: For each line how far rules vary, shape (boxes, rules).
    """

    table: Table
    is_empty: npt.NDArray[np.bool_]
    spreads: list[FloatArray]
    widths: list[FloatArray]


class Space:
    """The inputs that some rules need, on a domain.

    Args:
        given: The rules and their domain.
        chosen: The positions of the rules that matter.
        pairs: Which of them are compared.
        is_ordered: Whether it is worked out exactly where one's curve is above the
            other's: it takes longer, and proves what doubles leave open.

    Attributes:
        names: The inputs.
        lines: One for each.
        mixes: The combinations that are asked or limited.
        is_product: Whether AND is the product.
    """

    def __init__(
        self,
        given: Ground,
        chosen: Sequence[int],
        pairs: Sequence[Pair] = (),
        *,
        is_ordered: bool = False,
    ) -> None:
        rules, domain = given.rules, given.domain
        self.is_product = rules.semantics.conjunction == "product"
        self.domain = domain
        asked = {c.variable for n in chosen for c in rules.rules[n].when}
        mixed = [
            v
            for v in rules.variables
            if v.parts and (v.name in asked or domain.side(v.name) is not None)
        ]
        needed = asked | {part.input for v in mixed for part in v.parts}
        inputs = [v for v in rules.variables if not v.parts and v.name in needed]
        # At least one, so that there is a box at all.
        inputs = inputs or [v for v in rules.variables if not v.parts][:1]
        self.names = tuple(v.name for v in inputs)
        self.lines: list[Line] = []
        ordered = _ordered(given, pairs) if is_ordered else {}
        for variable in inputs:
            side = domain.side(variable.name)
            if side is None:
                raise ValueError(f"the domain has no side for {variable.name!r}")
            of = Asked(rules, variable, chosen, pairs, ordered.get(variable.name, ()))
            self.lines.append(Line(of, side.low, side.high, is_open=side.is_open))
        number = {name: n for n, name in enumerate(self.names)}
        self.mixes = [
            _mix(
                v,
                Asked(rules, v, chosen, pairs, ordered.get(v.name, ())),
                number,
                domain,
            )
            for v in mixed
        ]

        self.limits = [*_limits(mixed, domain, number)]

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
        found = [
            line.can_part[boxes[:, number]] for number, line in enumerate(self.lines)
        ]
        return np.stack(found, axis=1)

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
        found = [*map(Fraction, self.middles(box[np.newaxis])[0].tolist())]
        if self.limits:
            low, high = (ends[0].tolist() for ends in self.ends(box[np.newaxis]))
            ranges = [*zip(map(Fraction, low), map(Fraction, high), strict=True)]
            found = feasible(ranges, self.limits) or found
        return dict(zip(self.names, found, strict=True))

    def look(self, boxes: IntArray) -> Seen:
        """Return what is known of boxes."""
        tables = [
            Table(*(field[boxes[:, number]] for field in line.table))
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
            if not mix.asked.clauses:
                continue
            table = mix.asked.table(*_mix_cells(mix, low, high, middle))
            tables.append(table)
            _share(mix, end - start, table, spreads, widths)
        return Seen(self._together(tables), is_empty, spreads, widths)

    def _together(self, tables: Sequence[Table]) -> Table:
        low, high, at, most, least, _, _ = zip(*tables, strict=True)
        nothing = np.empty((len(low[0]), 0))
        if self.is_product:
            return Table(
                product_of(low, -1),
                product_of(high, 1),
                product_of(at, 0),
                product_of(most, 1),
                product_of(least, -1),
                nothing,
                nothing,
            )
        return Table(
            np.minimum.reduce(low),
            np.minimum.reduce(high),
            np.minimum.reduce(at),
            np.minimum.reduce(most),
            np.minimum.reduce(least),
            nothing,
            nothing,
        )


def _ordered(given: Ground, pairs: Sequence[Pair]) -> dict[str, list[Spans]]:
    """Return, for each variable and pair, where `other` is at least as large.

    Only where each of both is one curve: a product of several has no order there.
    """
    if not pairs or given.is_empty or not given.is_kept:
        return {}
    is_product = given.rules.semantics.conjunction == "product"
    found: dict[str, list[Spans]] = {}
    for laid in given.laid[0]:
        of: list[Spans] = []
        for pair in pairs:
            asked = (laid.axis.asked[pair.one], laid.axis.asked[pair.other])
            if is_product and max(map(len, asked)) > 1:
                of.append(Spans(np.empty(0), np.empty(0)))
            else:
                of.append(_spans(laid, laid.of[pair.one], laid.of[pair.other]))
        found[laid.axis.variable.name] = of
    return found


def _spans(laid: Laid, one: IntArray, other: IntArray) -> Spans:
    """Return where one element is at most another, given both for each cell.

    Cells are joined at a place that is known exactly, for curves are continuous from
    the left; and at any other where bounds of both tell the order.
    """
    cells, rows = laid.cells, np.arange(len(one))
    holds = cells.rank[rows, one] <= cells.rank[rows, other]
    joins = [a == b for a, b in cells.zones]
    inner = np.arange(1, len(one))  # the places between cells
    told = np.ones(len(inner), dtype=bool)
    for mine, theirs in ((one[:-1], other[:-1]), (one[1:], other[1:])):
        for values in (cells.left, cells.right):
            below = values[1, mine, inner] <= values[0, theirs, inner]
            told &= below | (mine == theirs)
    ends: list[list[Fraction]] = []
    for cell in np.flatnonzero(holds).tolist():
        low, high = cells.zones[cell][1], cells.zones[cell + 1][0]
        is_next = bool(ends) and ends[-1][1] == cells.zones[cell][0]
        if is_next and (joins[cell] or told[cell - 1]):
            ends[-1][1] = high
        else:
            ends.append([low, high])
    lows = [outwards(low)[1] for low, _ in ends]
    highs = [outwards(high)[0] for _, high in ends]
    return Spans(np.array(lows), np.array(highs))


def _limits(
    mixed: Sequence[Variable], domain: Domain, number: Mapping[str, int]
) -> Iterator[Row]:
    for variable in mixed:
        side = domain.side(variable.name)
        if side is not None:
            weights, constant = linear_form(variable, number)
            low, high = Fraction(side.low) - constant, Fraction(side.high) - constant
            yield Row(weights, low, high, side.is_open)


def _mix(
    variable: Variable, asked: Asked, number: Mapping[str, int], domain: Domain
) -> Mix:
    constant = -sum(
        (Fraction(p.weight) * Fraction(p.centre) for p in variable.parts), Fraction(0)
    )
    weights = tuple((number[part.input], part.weight) for part in variable.parts)
    return Mix(asked, weights, outwards(constant), domain.side(variable.name))


def mix_range(
    mix: Mix, start: FloatArray, end: FloatArray
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
    mix: Mix, low: FloatArray, high: FloatArray, middle: FloatArray
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
    mix: Mix,
    sizes: FloatArray,
    table: Table,
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
