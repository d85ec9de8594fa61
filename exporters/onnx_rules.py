"""A rule base as a graph of wide operations, features first.

The operations on a number are those of `fuzzytree.semantics.reference`, in the same
order, so that strengths have the same bits as its own. What is rearranged changes no
bit:

- A band is one or two *edges*. `x <= low` is `x < next(low)`, and a right edge is a
  left edge of `-x`: negated operands give negated differences, and equal quotients.
- At any x at most one edge of a band is below 1, so the smallest edge is the degree.
- An LR set is two *slopes*, or one of `|x - m|` if both sides are the same.
- Points are a chain, where the line behind each point takes the place of the one before
  it, or many of them are searched by halving, whichever onnxruntime does faster: five
  passes over the rows for each halving instead of eight for each point.
- Shorter curves are filled up with zeros at the high end: `0 * q + c` is `c`.
- Max and min may repeat operands; a product takes them in their stored order.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.exporters.onnx_ends import (
    InputBlock,
    axes,
    is_known,
)
from fuzzytree.exporters.onnx_graph import DegreeRows, OnnxGraph, np_to_onnx
from fuzzytree.model import LR, Points, Proposition, RuleBase, Shape, Side, shapes_of
from fuzzytree.numerics import RealArray, RealKind, Segments, rounded, segments_of

if TYPE_CHECKING:
    from fuzzytree.numerics import Real

Key = tuple[str, str]  # variable and term
Curve = tuple[float, ...]
Sequences = list[tuple[int, ...]]


class EdgePart(msgspec.Struct, frozen=True):
    """One end of a band: below it the degree is that of the flank, otherwise 1.

    Attributes:
        variable: The variable of the value.
        sign: 1 for a left end; -1 for a right one, which lies left of it in `-x`.
        bound: The band's `low` or `high`.
        end: Where the degree has fallen to 0; None is a step.
    """

    variable: str
    sign: int
    bound: float
    end: float | None


class SlopePart(msgspec.Struct, frozen=True):
    """One side of an LR set; with sign 0 both sides, which are the same."""

    variable: str
    sign: int
    mean: float
    side: Side


class PointsPart(msgspec.Struct, frozen=True):
    """Points on one variable, joined by lines."""

    variable: str
    points: Points
    sign: int = 1


Part = EdgePart | SlopePart | PointsPart

GUARD = ""
"""In place of a variable: 0, or NaN in a row with a missing value."""

NOTHING = EdgePart(GUARD, 1, 1.0, None)
"""No rule: degree 0, or 1 where a value is missing: before all rules, as the first."""

MOST_CHAINED = 8
"""Points up to which a chain is the faster way; from 8 to 12 they are even."""

ALWAYS = EdgePart(GUARD, 1, -math.inf, None)
"""Degree 1."""


def rules_graph(
    graph: OnnxGraph,
    rules: RuleBase,
    columns: Sequence[str],
) -> tuple[InputBlock, str]:
    """Add a rule base up to the strengths of no rule and of every rule.

    Row 0 of the strengths is `NOTHING` and row k is rule k: the position of the first
    largest is the number of the winning rule, or 0.

    Returns:
        The values of the variables, and the strengths, of shape (1 + rules, rows).
    """
    frame = axes(graph, rules, columns)
    table = DegreeRows(graph)
    sequences = _degrees(graph, table, rules, frame)
    is_product = rules.semantics.conjunction == "product"
    with graph.about("rules"):
        return frame, _strengths(graph, table, sequences, is_product=is_product)


def _parts(variable: str, shape: Shape) -> list[Part]:
    """Return the parts whose smallest degree is that of a shape."""
    if isinstance(shape, LR):
        mean, left, right = shape.mean, shape.left, shape.right
        if left == right:
            return [SlopePart(variable, 0, mean, left)]
        return [
            SlopePart(variable, -1, mean, left),
            SlopePart(variable, 1, mean, right),
        ]
    if isinstance(shape, Points):
        return [PointsPart(variable, shape)]
    edges: list[Part] = []
    if shape.low is not None:
        edges.append(EdgePart(variable, 1, shape.low, shape.left))
    if shape.high is not None:
        edges.append(EdgePart(variable, -1, shape.high, shape.right))
    return edges


def _degrees(
    graph: OnnxGraph,
    table: DegreeRows,
    rules: RuleBase,
    frame: InputBlock,
) -> Sequences:
    """Add the degrees of all propositions.

    Returns:
        The rows whose AND is the strength of no rule, of the first rule, and so on.
    """
    shapes = shapes_of(rules.variables)
    propositions = list(dict.fromkeys(c for rule in rules.rules for c in rule.when))
    used = dict.fromkeys((c.variable, term) for c in propositions for term in c.terms)
    parts = {key: _parts(key[0], shapes[key]) for key in used}
    # A term without ends is always 1: so is its proposition, and its negation always 0.
    constant = {
        c for c in propositions if any(not parts[c.variable, t] for t in c.terms)
    }
    true = {proposition for proposition in constant if not proposition.negated}
    kept = [[c for c in rule.when if c not in true] for rule in rules.rules]
    live = [[c for c in when if c not in constant] for when in kept]
    wanted = {NOTHING: None} if all(kept) else {NOTHING: None, ALWAYS: None}
    result: dict[Part, None] = dict.fromkeys(
        part
        for proposition in propositions
        if proposition not in constant
        for term in proposition.terms
        for part in parts[proposition.variable, term]
    )
    row = _primitives(graph, table, [*wanted, *result], frame)
    with graph.about("terms"):
        rows_of = _propositions(graph, table, live, parts, row)
    rows_of |= dict.fromkeys(constant - true, (row[NOTHING],))
    always = (row[ALWAYS],) if ALWAYS in row else ()
    sequences = [tuple(r for c in when for r in rows_of[c]) for when in kept]
    return [(row[NOTHING],), *(rows or always for rows in sequences)]


def _primitives(
    graph: OnnxGraph,
    table: DegreeRows,
    parts: Sequence[Part],
    frame: InputBlock,
) -> dict[Part, int]:
    """Add a block for each kind of part; return the row of each part."""
    edges = [part for part in parts if isinstance(part, EdgePart)]
    slopes = [part for part in parts if isinstance(part, SlopePart)]
    slopes.sort(key=lambda slope: abs(slope.sign))  # |x - m| first
    lines = [part for part in parts if isinstance(part, PointsPart)]
    block = frame.block
    if slopes or lines:  # an edge of NaN is 1, but a slope of NaN is NaN
        zero = graph.number(0.0, graph.types.axis)
        known = is_known(graph, frame)
        block = graph.node("Where", known, block, zero, hint="finite_variables")
    values, place = DegreeRows(graph), {(GUARD, 1): 0}
    values.append(frame.guard, 1)
    for sign in (1, -1):
        if any(part.sign in (sign, sign - 1) and part.variable for part in parts):
            signed = block
            if sign < 0:
                signed = graph.node("Neg", block, hint="minus_variables")
            first = values.append(signed, len(frame.order))
            place |= {(name, sign): first + i for name, i in frame.order.items()}
    row: dict[Part, int] = {}
    with graph.about("edges"):
        taken = values.take([place[edge.variable, edge.sign] for edge in edges])
        first = table.append(_edges(graph, taken, edges), len(edges))
    row |= {edge: first + number for number, edge in enumerate(edges)}
    if slopes:
        with graph.about("slopes"):
            taken = values.take([place[s.variable, s.sign or 1] for s in slopes])
            first = table.append(_slopes(graph, taken, slopes), len(slopes))
        row |= {slope: first + number for number, slope in enumerate(slopes)}
    for is_short in (True, False):
        group = [
            line
            for line in lines
            if (len(line.points.values) <= MOST_CHAINED) == is_short
        ]
        if group:
            shapes = [line.points for line in group]
            with graph.about("points"):
                taken = values.take([place[line.variable, 1] for line in group])
                block = _polylines(graph, taken, shapes)
            first = table.append(block, len(group))
            row |= {line: first + number for number, line in enumerate(group)}
    return row


def _edges(graph: OnnxGraph, values: str, edges: Sequence[EdgePart]) -> str:
    """Add the degrees of edges, given their values, as one block."""
    numbers = graph.types
    bounds = graph.column(_bounds(edges, numbers.axis), "bounds")
    beyond = graph.node("Less", values, bounds)
    one = graph.number(1.0, numbers.degree)
    if all(edge.end is None for edge in edges):
        return graph.node("Where", beyond, graph.number(0.0, numbers.degree), one)
    flanks = [(e.sign, e.bound, e.bound if e.end is None else e.end) for e in edges]
    # A step's position is at most 0 beyond the bound: its width may be anything.
    ends = rounded([sign * end for sign, _, end in flanks], numbers.axis)
    spans = [sign * (bound - end) or 1.0 for sign, bound, end in flanks]
    widths = rounded(spans, numbers.axis, is_divisor=True)
    distance = graph.node("Sub", values, graph.column(ends, "ends"))
    position = graph.node("Div", distance, graph.column(widths, "widths"))
    degree = numbers.degree
    zero, below_one = graph.number(0.0, degree), graph.number(numbers.below_one, degree)
    flank = graph.node("Clip", _cast(graph, position), zero, below_one)
    return graph.node("Where", beyond, flank, one)


def _bounds(edges: Sequence[EdgePart], kind: type[RealKind]) -> RealArray:
    """Return for each edge the smallest value, times its sign, at which it is 1."""
    bounds = rounded([edge.sign * edge.bound for edge in edges], kind)
    is_left = np.array([edge.sign > 0 for edge in edges])
    with np.errstate(over="ignore"):  # nothing lies above the largest number
        above = np.nextafter(bounds, kind(np.inf))
    bounds = np.where(is_left, above, bounds)
    is_always = np.array([edge == ALWAYS for edge in edges])
    return np.where(is_always, kind(-np.inf), bounds)


def _slopes(
    graph: OnnxGraph,
    values: str,
    slopes: Sequence[SlopePart],
) -> str:
    """Add the degrees of slopes, given their values, as one block."""
    numbers = graph.types
    means = [-s.mean if s.sign < 0 else s.mean for s in slopes]
    middle = graph.column(rounded(means, numbers.axis), "means")
    distance = graph.node("Sub", values, middle)
    both = sum(1 for slope in slopes if slope.sign == 0)
    if both == len(slopes):
        distance = graph.node("Abs", distance)
    elif both:
        split = DegreeRows(graph)
        split.append(distance, len(slopes))
        absolute = graph.node("Abs", split.take(range(both)))
        others = split.take(range(both, len(slopes)))
        distance = graph.node("Concat", absolute, others, axis=0)
    sides = [slope.side for slope in slopes]
    spreads = rounded([s.spread for s in sides], numbers.axis, is_divisor=True)
    u = graph.node("Div", distance, graph.column(spreads, "spreads"))
    reaches = rounded([side.reach for side in sides], numbers.degree)
    rooms = [side.reach - 1.0 for side in sides]
    room = rounded(rooms, numbers.degree, is_divisor=True)
    reach = graph.column(reaches, "reaches")
    tail = graph.column(room, "rooms")
    curve = _coefficients(graph, [side.curve for side in sides])
    u = _cast(graph, u)
    zero, one = (graph.number(value, numbers.degree) for value in (0.0, 1.0))
    u = graph.node("Min", graph.node("Max", u, zero), reach)
    t = graph.node("Min", u, one)
    fall = curve[0]
    if len(curve) > 1:
        two = graph.number(2.0, numbers.degree)
        v = graph.node("Sub", graph.node("Mul", two, t), one)
        fall = _horner(graph, curve, v)
    body = graph.node("Sub", one, graph.node("Mul", t, fall))
    body = graph.node("Clip", body, zero, one)
    w = graph.node("Div", graph.node("Sub", reach, u), tail)
    w = graph.node("Clip", w, zero, one)
    square = graph.node("Mul", w, w)
    return graph.node("Mul", body, graph.node("Mul", square, square))


def _cast(graph: OnnxGraph, value: str) -> str:
    if not graph.types.is_mixed:
        return value
    return graph.node("Cast", value, to=np_to_onnx(graph.types.degree))


def _coefficients(graph: OnnxGraph, curves: Sequence[Curve]) -> list[str]:
    """Return the columns of c0, c1, ... of all curves, of the longest's length."""
    columns: list[str] = []
    for power in range(max(map(len, curves))):
        values = [curve[power] if power < len(curve) else 0.0 for curve in curves]
        numbers = rounded(values, graph.types.degree)
        columns.append(graph.column(numbers, f"c{power}"))
    return columns


def _horner(graph: OnnxGraph, curve: Sequence[str], x: str) -> str:
    *lower, total = curve
    for coefficient in reversed(lower):
        total = graph.node("Add", graph.node("Mul", total, x), coefficient)
    return total


def _polylines(graph: OnnxGraph, values: str, shapes: Sequence[Points]) -> str:
    """Add the degrees of shapes, given their finite values, as one block."""
    axis: Real = np.dtype(graph.types.axis)
    degree: Real = np.dtype(graph.types.degree)
    lines = segments_of(shapes, axis, degree)
    longest = max(len(shape.values) for shape in shapes)
    if longest > MOST_CHAINED:
        return _searched(graph, values, lines)
    return _chained(graph, values, lines, longest)


def _chained(
    graph: OnnxGraph,
    values: str,
    lines: Segments,
    longest: int,
) -> str:
    """Go from point to point; behind a shape's last one nothing changes."""
    degree = graph.column(lines.far[lines.first], "degrees")
    point_count = 2 * lines.room - 1
    for number in range(longest):
        has_line = number < point_count
        here = lines.first + np.where(has_line, number, 0)
        behind = lines.first + np.where(has_line, number + 1, 0)
        point = np.where(has_line, lines.values[here], lines.values[-1])
        is_above = graph.node("Greater", values, graph.column(point, "points"))
        line = far = graph.column(lines.far[behind], "degrees")
        if (lines.near[behind] != lines.far[behind]).any():
            anchor = graph.column(lines.anchor[behind], "anchors")
            width = graph.column(lines.width[behind], "widths")
            near = graph.column(lines.near[behind], "degrees")
            line = _line(graph, values, (anchor, width, near, far))
        degree = graph.node("Where", is_above, line, degree)
    return degree


def _searched(graph: OnnxGraph, values: str, lines: Segments) -> str:
    """Halve the room of all shapes at once; a smaller one stays where it is."""
    points = graph.constant(lines.values, "points")
    room = lines.room.astype(np.int32).reshape(-1, 1)
    place = graph.constant(lines.first.astype(np.int32).reshape(-1, 1), "firsts")
    zero = graph.constant(np.array(0, np.int32), "zero")
    while room.any():
        before = graph.constant(room - np.int32(1), "rooms")
        point = graph.node("Gather", points, graph.node("Add", place, before), axis=0)
        is_above = graph.node("Greater", values, point)
        step = graph.node("Where", is_above, graph.constant(room, "rooms"), zero)
        place = graph.node("Add", place, step)
        room = room >> 1
    parts = [
        graph.node("Gather", graph.constant(table, name), place, axis=0)
        for name, table in (
            ("anchor", lines.anchor),
            ("width", lines.width),
            ("near", lines.near),
            ("far", lines.far),
        )
    ]
    return _line(graph, values, parts)


def _line(graph: OnnxGraph, x: str, parts: Sequence[str]) -> str:
    """Add the degree on a line, as in `fuzzytree.numerics.segments`."""
    anchor, width, near, far = parts
    position = graph.node("Div", graph.node("Sub", x, anchor), width)
    change = graph.node("Mul", _cast(graph, position), graph.node("Sub", far, near))
    degree = graph.node("Add", change, near)
    degree = graph.node("Max", degree, graph.node("Min", near, far))
    return graph.node("Min", degree, graph.node("Max", near, far))


def _propositions(
    graph: OnnxGraph,
    table: DegreeRows,
    rules: Sequence[Sequence[Proposition]],
    parts: dict[Key, list[Part]],
    row: dict[Part, int],
) -> dict[Proposition, tuple[int, ...]]:
    """Add terms of two parts, OR and negation where there are any.

    Returns:
        The rows whose AND is the degree of each proposition: two if its only term has
        two parts and it costs less to let the rules take both.
    """
    propositions = dict.fromkeys(proposition for when in rules for proposition in when)
    terms = dict.fromkeys((c.variable, term) for c in propositions for term in c.terms)
    of_term = {key: row[parts[key][0]] for key in terms}
    pairs = {
        c: (row[result[0]], row[result[1]])
        for c in propositions
        if len(c.terms) == 1 and not c.negated
        for result in [parts[c.variable, c.terms[0]]]
        if len(result) == 2
    }
    flat = [[part for c in when for part in pairs.get(c, (c,))] for when in rules]
    if _cost(flat) > _cost(rules) + 3 * len(pairs) + 20:
        pairs = {}
    single = [proposition for proposition in propositions if proposition not in pairs]
    joined = dict.fromkeys((c.variable, term) for c in single for term in c.terms)
    ends = {
        key: (row[parts[key][0]], row[parts[key][1]])
        for key in joined
        if len(parts[key]) == 2
    }
    double = list(dict.fromkeys(ends.values()))  # terms of one curve are one
    if double:
        left, right = (table.take([pair[i] for pair in double]) for i in (0, 1))
        block = graph.node("Min", left, right, hint="terms")
        first = table.append(block, len(double))
        place = {pair: first + number for number, pair in enumerate(double)}
        of_term |= {key: place[pair] for key, pair in ends.items()}
    lists = {
        c: list(dict.fromkeys(of_term[c.variable, term] for term in c.terms))
        for c in single
    }
    of_proposition = _largest(graph, table, lists)
    negated = [proposition for proposition in propositions if proposition.negated]
    if negated:
        degrees = table.take([of_proposition[proposition] for proposition in negated])
        one = graph.number(1.0, graph.types.degree)
        block = graph.node("Sub", one, degrees, hint="negations")
        first = table.append(block, len(negated))
        of_proposition |= {
            proposition: first + number for number, proposition in enumerate(negated)
        }
    return pairs | {
        proposition: (result,) for proposition, result in of_proposition.items()
    }


def _largest(
    graph: OnnxGraph, table: DegreeRows, lists: dict[Proposition, list[int]]
) -> dict[Proposition, int]:
    """Add the maxima of lists of rows, halving all lists at once until one is left."""
    lists = dict(lists)
    while active := [
        proposition for proposition, rows in lists.items() if len(rows) > 1
    ]:
        left = [row for proposition in active for row in lists[proposition][::2]]
        right: list[int] = []
        for proposition in active:
            rows = lists[proposition]
            right += rows[1::2] + rows[-1:] * (len(rows) % 2)
        either = table.take(left), table.take(right)
        block = graph.node("Max", *either, hint="alternatives")
        first = table.append(block, len(left))
        for proposition in active:
            half = (len(lists[proposition]) + 1) // 2
            lists[proposition] = list(range(first, first + half))
            first += half
    return {proposition: rows[0] for proposition, rows in lists.items()}


def _levels(
    sequences: Sequence[Sequence[Hashable]],
) -> tuple[list[dict[tuple[int, Hashable], int]], list[int]]:
    """Return the distinct beginnings of each length, and where each sequence ends.

    A beginning is known by its number among those of its length, given the number of
    the beginning that is shorter by one, and its last element.
    """
    levels: list[dict[tuple[int, Hashable], int]] = []
    here = [0] * len(sequences)
    for position in range(max(map(len, sequences), default=0)):
        level: dict[tuple[int, Hashable], int] = {}
        for number, rows in enumerate(sequences):
            if len(rows) > position:
                step = (here[number], rows[position])
                here[number] = level.setdefault(step, len(level))
        levels.append(level)
    return levels, here


def _slot_cost(sequences: Sequence[Sequence[Hashable]]) -> int:
    """Return the passes over one row of a block; a node counts as five of them."""
    longest = max(map(len, sequences), default=0)
    return 2 * len(sequences) * longest + 5 * longest


def _prefix_cost(sequences: Sequence[Sequence[Hashable]]) -> int:
    levels, _ = _levels(sequences)
    steps = sum(3 * len(level) for level in levels[1:])
    return steps + 15 * len(levels) + 2 * len(sequences)


def _cost(sequences: Sequence[Sequence[Hashable]]) -> int:
    return min(_slot_cost(sequences), _prefix_cost(sequences))


def _strengths(
    graph: OnnxGraph, table: DegreeRows, sequences: Sequences, *, is_product: bool
) -> str:
    """Add the AND of each sequence of rows, in the cheaper of two ways."""
    lengths = {len(rows) for rows in sequences[1:]}
    can_repeat = not is_product or len(lengths) == 1  # NOTHING is 0 or 1
    if can_repeat and _slot_cost(sequences) <= _prefix_cost(sequences):
        return _by_slots(graph, table, sequences, is_product=is_product)
    return _by_prefix(graph, table, sequences, is_product=is_product)


def _and(graph: OnnxGraph, operands: Sequence[str], *, is_product: bool) -> str:
    """Add the minimum of blocks, or their product from left to right."""
    if len(operands) > 1 and not is_product:
        return graph.node("Min", *operands)
    total = operands[0]
    for other in operands[1:]:
        total = graph.node("Mul", total, other)
    return total


def _by_slots(
    graph: OnnxGraph, table: DegreeRows, sequences: Sequences, *, is_product: bool
) -> str:
    """Take the k-th rows of all sequences at once; a short one repeats its first."""
    slots = [
        table.take([rows[k] if k < len(rows) else rows[0] for rows in sequences])
        for k in range(max(map(len, sequences)))
    ]
    return _and(graph, slots, is_product=is_product)


def _by_prefix(
    graph: OnnxGraph, table: DegreeRows, sequences: Sequences, *, is_product: bool
) -> str:
    """Compute each common beginning of sequences once, one length after another."""
    levels, end = _levels(sequences)
    lengths = {len(rows) for rows in sequences}
    ends, first = DegreeRows(graph), dict[int, int]()
    shorter, block = DegreeRows(graph), ""
    for length, level in enumerate(levels, 1):
        rows = [row for _, row in level if isinstance(row, int)]
        longer = table.take(rows)
        if length > 1:
            before = shorter.take([number for number, _ in level])
            longer = _and(graph, [before, longer], is_product=is_product)
        shorter, block = DegreeRows(graph), longer
        shorter.append(block, len(level))
        if length in lengths:
            first[length] = ends.append(block, len(level))
    places = zip(sequences, end, strict=True)
    return ends.take([first[len(rows)] + number for rows, number in places])
