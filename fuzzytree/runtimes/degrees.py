"""Degrees of terms for many rows: few wide operations on blocks that fit the cache.

The operations on one number, and their order, are those of
`fuzzytree.semantics.reference`. What is rearranged changes no bit:

- A band is one or two *edges*; at any value at most one of them is below 1, so the
  smaller is the band's degree. An LR set is two *slopes* in the same way, or one
  slope of |x - m| if its sides are equal. Points are one *polyline*.
- `max(min(p, CAP), core)` with a core of 0 or 1 is both `min(max(p, 0), CAP)` off the
  plateau and 1 on it.
- The line between points on which a value lies is found by halving (`place_of`).
- (-d) / s is d / (-s); x - x and similar signs of zero are compared equal.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.model import (
    LR,
    Dtype,
    FloatArray,
    IntArray,
    Points,
    Shape,
    Side,
    checkpoint,
)
from fuzzytree.numerics import segments_of

if TYPE_CHECKING:
    from fuzzytree.numerics import Reals, Segments

    Real = np.dtype[np.floating[Any]]

BLOCK = 1 << 15
"""Numbers in a block: with its scratch it fits into a second-level cache."""


_LARGE_BLOCK = 1 << 17  # numbers: of points, which go through in small blocks
_SMALL_BLOCK = 1 << 14  # numbers: scratch that the allocator keeps at hand


@dataclass(frozen=True, slots=True)
class NumberTypes:
    """The types of one evaluation.

    Attributes:
        axis: Of values, differences and divisions.
        degree: Of everything after the division.
    """

    axis: Real
    degree: Real

    @property
    def cap(self) -> Reals:
        """The largest number below 1 of the degrees' type."""
        return np.nextafter(np.ones((), self.degree), np.zeros((), self.degree))


DOUBLE: Real = np.dtype(np.float64)
SINGLE: Real = np.dtype(np.float32)

NUMBERS: dict[Dtype, NumberTypes] = {
    "float64": NumberTypes(DOUBLE, DOUBLE),
    "mixed": NumberTypes(DOUBLE, SINGLE),
    "float32": NumberTypes(SINGLE, SINGLE),
}


@dataclass(frozen=True, slots=True)
class BandEdge:
    """One end of a band on one variable, and where its flank is 0; None is a step."""

    line: int
    bound: float
    is_right: bool
    end: float | None


@dataclass(frozen=True, slots=True)
class SetSide:
    """One side of an LR set; `sign` 0 is both sides at once, which are equal."""

    line: int
    mean: float
    sign: int
    side: Side


@dataclass(frozen=True, slots=True)
class Polyline:
    """Points on one variable, joined by lines."""

    line: int
    points: Points


Atom = BandEdge | SetSide | Polyline


@dataclass(frozen=True, slots=True)
class AtomBlock:
    """Atoms of one kind and one length of curve.

    Attributes:
        lines: The line of each atom's variable among the axes.
        run: Computes degrees of shape (atoms, rows) from the values, in place, with
            scratch of the same shape.
    """

    lines: IntArray
    run: Callable[[Reals, Reals, Reals], None]


def atoms_of(line: int, shape: Shape) -> tuple[Atom, ...]:
    """Return the atoms whose smallest degree is that of a shape; none if it is 1."""
    if isinstance(shape, LR):
        mean, left, right = shape.mean, shape.left, shape.right
        if left == right:
            return (SetSide(line, mean, 0, left),)
        return SetSide(line, mean, -1, left), SetSide(line, mean, 1, right)
    if isinstance(shape, Points):
        return (Polyline(line, shape),)
    result: list[Atom] = []
    if shape.low is not None:
        result.append(BandEdge(line, shape.low, False, shape.left))
    if shape.high is not None:
        result.append(BandEdge(line, shape.high, True, shape.right))
    return tuple(result)


def plan_blocks(
    atoms: Sequence[Atom], numbers: NumberTypes, rows: int
) -> tuple[list[Atom], tuple[AtomBlock, ...]]:
    """Return atoms in the order in which blocks compute them, and the blocks.

    `rows` is how many rows a chunk has.
    """
    ordered = sorted(atoms, key=_kind)
    blocks: list[AtomBlock] = []
    for (kind, _), group in itertools.groupby(ordered, key=_kind):
        members = list(group)
        size = max((BLOCK if kind < 4 else _LARGE_BLOCK) // rows, 1)
        for start in range(0, len(members), size):
            checkpoint()
            part = members[start : start + size]
            lines = np.array([atom.line for atom in part], np.int64)
            blocks.append(AtomBlock(lines, _block_run(kind, part, numbers)))
    return ordered, tuple(blocks)


def _block_run(
    kind: int, atoms: Sequence[Atom], numbers: NumberTypes
) -> Callable[[Reals, Reals, Reals], None]:
    if kind <= 1:
        edges = [atom for atom in atoms if isinstance(atom, BandEdge)]
        return _steps(edges, numbers) if kind == 0 else _flanks(edges, numbers)
    if kind <= 3:
        return _slopes([atom for atom in atoms if isinstance(atom, SetSide)], numbers)
    return _polylines([atom for atom in atoms if isinstance(atom, Polyline)], numbers)


def _kind(atom: Atom) -> tuple[int, int]:
    match atom:
        case BandEdge():
            return int(atom.end is not None), 0
        case SetSide(sign=0):
            return 2, len(atom.side.curve)
        case SetSide():
            return 3, len(atom.side.curve)
        case Polyline():
            return 4, 0


def _column(values: Sequence[float], kind: Real) -> Reals:
    """Return one number for each atom, to nearest and never infinite."""
    largest = np.finfo(kind).max
    exact = np.array(values, np.float64).reshape(-1, 1)
    return np.clip(exact, -float(largest), float(largest)).astype(kind)


def _curve(curves: Sequence[tuple[float, ...]], kind: Real) -> list[Reals]:
    """Return one column for each coefficient, the lowest first."""
    return [_column(line, kind) for line in zip(*curves, strict=True)]


def _core(edges: Sequence[BandEdge], numbers: NumberTypes) -> Callable[[Reals], Reals]:
    """Return what finds where edges are on the plateau: x > low, or x <= high."""
    bound = _column([edge.bound for edge in edges], numbers.axis)
    is_right = np.array([[edge.is_right] for edge in edges])

    def core(x: Reals) -> Reals:
        inside = np.greater(x, bound)
        np.not_equal(inside, is_right, out=inside)
        return inside.astype(numbers.degree)

    return core


def _steps(
    edges: Sequence[BandEdge], numbers: NumberTypes
) -> Callable[[Reals, Reals, Reals], None]:
    core = _core(edges, numbers)

    def run(x: Reals, out: Reals, _: Reals) -> None:
        out[:] = core(x)

    return run


def _flanks(
    edges: Sequence[BandEdge], numbers: NumberTypes
) -> Callable[[Reals, Reals, Reals], None]:
    core = _core(edges, numbers)
    flanks = [(edge.bound, edge.end) for edge in edges if edge.end is not None]
    end = _column([end for _, end in flanks], numbers.axis)
    span = _column([start - end for start, end in flanks], numbers.axis)
    zero = np.array(0, numbers.degree)
    cap = numbers.cap

    def run(x: Reals, out: Reals, _: Reals) -> None:
        inside = core(x)
        x -= end
        x /= span
        out[:] = x
        np.maximum(out, zero, out=out)
        np.minimum(out, cap, out=out)
        np.maximum(out, inside, out=out)

    return run


def _horner(curve: Sequence[Reals], x: Reals, out: Reals) -> None:
    """Put c0 + x (c1 + x (c2 + ...)) into `out`, from the inside out."""
    if len(curve) == 1:
        out[:] = curve[0]
        return
    np.multiply(curve[-1], x, out=out)
    for coefficient in curve[-2:0:-1]:
        out += coefficient
        out *= x
    out += curve[0]


def _slopes(
    slopes: Sequence[SetSide], numbers: NumberTypes
) -> Callable[[Reals, Reals, Reals], None]:
    """Return what computes sides of LR sets (paper, 2.2.2, with a tail)."""
    is_both = slopes[0].sign == 0
    kind = numbers.degree
    zero, one, two = (np.array(value, kind) for value in (0, 1, 2))
    mean = _column([slope.mean for slope in slopes], numbers.axis)
    spread = _column([(s.sign or 1) * s.side.spread for s in slopes], numbers.axis)
    reach = _column([slope.side.reach for slope in slopes], kind)
    length = _column([slope.side.reach - 1.0 for slope in slopes], kind)
    curve = _curve([slope.side.curve for slope in slopes], kind)

    def run(x: Reals, out: Reals, u: Reals) -> None:
        x -= mean
        if is_both:
            np.abs(x, out=x)
        x /= spread
        u[:] = x
        np.maximum(u, zero, out=u)
        np.minimum(u, reach, out=u)
        t = np.minimum(u, one)
        v = np.multiply(t, two)
        v -= one
        _horner(curve, v, out)
        out *= t
        np.subtract(one, out, out=out)
        np.maximum(out, zero, out=out)
        np.minimum(out, one, out=out)
        np.subtract(reach, u, out=u)
        u /= length
        np.minimum(u, one, out=u)
        u *= u
        u *= u
        out *= u

    return run


def _polylines(
    atoms: Sequence[Polyline], numbers: NumberTypes
) -> Callable[[Reals, Reals, Reals], None]:
    shapes = [atom.points for atom in atoms]
    lines = segments_of(shapes, numbers.axis, numbers.degree)
    shape = np.arange(len(atoms)).reshape(-1, 1)

    def run(x: Reals, out: Reals, _: Reals) -> None:
        size = max(_SMALL_BLOCK // max(x.shape[1], 1), 1)
        for start in range(0, len(x), size):
            part, which = x[start : start + size], shape[start : start + size]
            place = place_of(lines, which, part)
            out[start : start + size] = join(lines, place, part)

    return run


def shape_degrees(shape: Shape, values: FloatArray) -> FloatArray:
    """Return the degree of each of some finite doubles, bit-equal to the reference.

    Example:
        >>> from fuzzytree.model.rulebase import Band
        >>> band = Band(0.0, 1.0, right=2.0)
        >>> shape_degrees(band, np.array([0.0, 1.0, 1.25])).tolist()
        [0.0, 1.0, 0.75]
    """
    result = np.ones(len(values))
    atoms = atoms_of(0, shape)
    _, blocks = plan_blocks(atoms, NUMBERS["float64"], max(len(values), 1))
    with np.errstate(all="ignore"):
        for block in blocks:
            lines = np.repeat(values[np.newaxis], len(block.lines), axis=0)
            out = np.empty_like(lines)
            block.run(lines, out, np.empty_like(lines))
            np.minimum(result, out.min(axis=0), out=result)
    return result


def join(lines: Segments, place: IntArray, x: Reals) -> Reals:
    """Return the degree of each value on its line.

    `place` is that of each finite value's line.
    """
    position = _taken(lines.anchor, place)
    np.subtract(x, position, out=position)
    position /= _taken(lines.width, place)
    near, far = _taken(lines.near, place), _taken(lines.far, place)
    result = position.astype(near.dtype, copy=False)
    result *= far - near
    result += near
    np.maximum(result, np.minimum(near, far), out=result)
    np.minimum(result, np.maximum(near, far, out=far), out=result)
    return result


def place_of(lines: Segments, shape: IntArray, x: Reals) -> IntArray:
    """Return the place of the line on which each value lies, by halving.

    `shape` has numbers of shapes and broadcasts to the values.
    """
    place = np.empty(x.shape, np.int64)
    place[:] = lines.first.take(shape)
    room = lines.room.take(shape)
    probe = np.empty_like(place)
    is_above = np.empty(x.shape, np.bool_)
    for _ in range(int(room.max(initial=0)).bit_length()):
        np.add(place, room - 1, out=probe)
        np.greater(x, _taken(lines.values, probe), out=is_above)
        np.multiply(is_above, room, out=probe)
        place += probe
        room = room >> 1
    return place


def _taken(table: Reals, place: IntArray) -> Reals:
    """Return entries of a table; a place outside of it gives that at its end."""
    return table.take(place, mode="clip")  # faster than a check of each place
