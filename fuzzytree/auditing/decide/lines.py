"""Degrees along an axis as straight lines in fractions.

Bands and points are lines as they are. Any other membership function is enclosed
between two: on each of some parts of its range by the chord of the part, and no farther
from that than the bounds of its bend ask (`fuzzytree.semantics.jet`).
"""

from __future__ import annotations

import functools
import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Final, NamedTuple

from fuzzytree.auditing.decide.answers import ONE, ZERO
from fuzzytree.model import (
    LR,
    Band,
    Curve,
    Hedge,
    MembershipFunction,
    N,
    Numbers,
    Points,
    checkpoint,
    hedged,
)
from fuzzytree.numerics import CAP, degree_between, exact_degree, outwards
from fuzzytree.semantics import Enclosed, Interval, Jet, degree_bounds, jet

APART: Final = Fraction(1, 1 << 10)
"""How far two lines around a function are apart at most, where their number allows."""

_MOST_BLOCKS: Final = 160  # between two knots of a curve; each with a bound of its bend
_PARTS: Final = 8  # of a block at most; each with two lines around the curve
_MORE: Final = 1 + 2.0**-20  # for what rounding takes
_GRID: Final = 1 << 32  # bounds are multiples of 1 by this


class Lines(NamedTuple):
    """A function of one variable made of straight lines, which may jump at its knots.

    Attributes:
        x: The knots in ascending order, the ends included; one for a single value.
        at: The value at each knot.
        after: The limit from the right at each knot but the last.
        before: The limit from the left at each knot but the first.
    """

    x: tuple[Fraction, ...]
    at: tuple[Fraction, ...]
    after: tuple[Fraction, ...]
    before: tuple[Fraction, ...]

    def pieces(self) -> Iterator[tuple[Fraction, Fraction, Fraction, Fraction]]:
        """Yield each line: its two ends, and the values that it has there."""
        return zip(self.x, self.x[1:], self.after, self.before, strict=False)

    def value(self, x: Fraction) -> Fraction:
        """Return the value at a place from the first knot to the last."""
        place = bisect_left(self.x, x)
        if self.x[place] == x:
            return self.at[place]
        return _on(self.x[place - 1], self.x[place], *self.ends(place - 1), x)

    def ends(self, piece: int) -> tuple[Fraction, Fraction]:
        """Return the values that a line, by number, has at its two ends."""
        return self.after[piece], self.before[piece]

    def slope(self, x: Fraction) -> Fraction:
        """Return the slope from a place on, up to the next knot."""
        piece = min(bisect_right(self.x, x), len(self.x) - 1) - 1
        if piece < 0:
            return ZERO
        p, q = self.ends(piece)
        return (q - p) / (self.x[piece + 1] - self.x[piece])

    @property
    def is_flat(self) -> bool:
        """Whether it is the same between each two knots."""
        return self.after == self.before

    @property
    def values(self) -> set[Fraction]:
        """All values and limits at knots."""
        return {*self.at, *self.after, *self.before}

    @property
    def highest(self) -> Fraction:
        """The least number that no value exceeds."""
        return max(self.values)

    def jumps(self) -> Iterator[tuple[Fraction, Fraction, Fraction]]:
        """Yield where it jumps, and the least and largest of value and limits there."""
        left, right = (self.at[:1] + self.before), (self.after + self.at[-1:])
        for x, *values in zip(self.x, self.at, left, right, strict=True):
            low, high = min(values), max(values)
            if low < high:
                yield x, low, high

    def minus(self, by: Fraction) -> Lines:
        """Return the same, lower by a number."""
        return self._each(lambda value: value - by)

    def complement(self) -> Lines:
        """Return 1 minus it."""
        return self._each(lambda value: 1 - value)

    def _each(self, change: Callable[[Fraction], Fraction]) -> Lines:
        parts = (tuple(map(change, of)) for of in (self.at, self.after, self.before))
        return Lines(self.x, *parts)


class Between(NamedTuple):
    """A function that is nowhere below one and nowhere above another of two lines."""

    lower: Lines
    upper: Lines

    @property
    def is_exact(self) -> bool:
        """Whether it is known exactly."""
        return self.lower is self.upper

    def complement(self) -> Between:
        """Return 1 minus it."""
        upper = self.lower.complement()
        return Between(upper if self.is_exact else self.upper.complement(), upper)


def _on(a: Fraction, b: Fraction, p: Fraction, q: Fraction, x: Fraction) -> Fraction:
    return p if p == q else p + (q - p) * (x - a) / (b - a)


def constant(value: Fraction, low: Fraction, high: Fraction) -> Lines:
    """Return a function that is the same everywhere between two ends."""
    if low == high:
        return Lines((low,), (value,), (), ())
    return Lines((low, high), (value, value), (value,), (value,))


class Hedged(MembershipFunction, frozen=True, tag="hedged"):
    """A membership function times a height, and what hedges make of that.

    The last hedge is the first to act.
    """

    function: MembershipFunction
    height: float
    hedges: tuple[Hedge, ...]

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the degree at a value."""
        return hedged(n, self.hedges, self.height * self.function.degree(n, x))

    def knots(self) -> tuple[float, ...]:
        """Return where the function changes its formula."""
        return self.function.knots()


@functools.lru_cache(maxsize=1 << 12)
def lines_of(function: MembershipFunction, low: Fraction, high: Fraction) -> Between:
    """Return the degrees of a membership function between two ends as lines.

    Example:
        >>> band = Band(1.0, 2.0, left=0.0)
        >>> lines_of(band, Fraction(0), Fraction(4)).lower.value(Fraction(1, 2))
        Fraction(1, 2)
    """
    checkpoint()
    inner = [Fraction(k) for k in function.knots() if math.isfinite(k)]
    if isinstance(function, Band):  # beside its plateau a degree is at most `CAP`
        for edge, end in function.flanks:
            zero = Fraction(end)
            inner.append(zero + CAP * (Fraction(edge) - zero))
    knots = sorted({low, high, *(k for k in inner if low < k < high)})
    if not isinstance(function, Band | Points):
        return _enclose(function, knots)
    at = tuple(exact_degree(function, x) for x in knots)
    ends = [_straight(function, a, b) for a, b in itertools.pairwise(knots)]
    lines = Lines(
        tuple(knots), at, tuple(p for p, _ in ends), tuple(q for _, q in ends)
    )
    return Between(lines, lines)


def _straight(
    function: Band | Points, a: Fraction, b: Fraction
) -> tuple[Fraction, Fraction]:
    """Return the limits at both ends of a line, from two values on it."""
    third = (b - a) / 3
    p, q = (exact_degree(function, a + k * third) for k in (1, 2))
    return 2 * p - q, 2 * q - p


class _Chord(NamedTuple):
    """A line of one side of a function, from one place to another."""

    a: Fraction
    b: Fraction
    p: Fraction  # its values there
    q: Fraction


def _enclose(function: MembershipFunction, knots: Sequence[Fraction]) -> Between:
    if len(knots) == 1:
        low, high = degree_within(function, knots[0])
        x = knots[0]
        return Between(constant(low, x, x), constant(high, x, x))
    blocks = [
        block for a, b in itertools.pairwise(knots) for block in _blocks(function, a, b)
    ]
    degrees = {x: degree_within(function, x) for x in knots}
    # Elsewhere it is continuous.
    limits = {(x, to): _limit(function, x, to) for x in knots for to in (-1, 1)}
    sides: tuple[list[_Chord], list[_Chord]] = ([], [])
    for block in blocks:
        for a, b in block.parts:
            checkpoint()
            if b not in degrees:
                degrees[b] = degree_within(function, b)
            ends = limits.get((a, 1), degrees[a]), limits.get((b, -1), degrees[b])
            for side, chord in zip(sides, _chords(block, (a, b), ends), strict=True):
                side.append(chord)
    least = min((block.range[0] for block in blocks), default=ZERO)
    caps = min(least, *(low for low, _ in degrees.values())), ONE
    lower, upper = (
        _line(
            [*_limit_chords(chords, limit, max if side == 0 else min)],
            {x: bounds[side] for x, bounds in degrees.items()},
        )
        for side, (chords, limit) in enumerate(zip(sides, caps, strict=True))
    )
    knots = sorted({*lower.x, *upper.x})
    return Between(refine(lower, knots), refine(upper, knots))


class _Block(NamedTuple):
    """Neighbouring parts of an axis, with one bound of a function's bend."""

    parts: tuple[tuple[Fraction, Fraction], ...]
    bend: tuple[Fraction, Fraction] | None
    range: tuple[Fraction, Fraction]  # bounds of all values strictly inside

    def off(self, length: Fraction) -> tuple[Fraction, Fraction]:
        """Return by how much a function is below and above the chord of a part.

        Between a and b it is the chord less f''(y) (x - a) (b - x) / 2 for some y, and
        the product is at most a quarter of the square of b - a.
        """
        assert self.bend is not None
        low, high = self.bend
        share = length**2 / 8
        return (
            _on_grid(max(high, ZERO) * share)[1],
            _on_grid(max(-low, ZERO) * share)[1],
        )

    @property
    def apart(self) -> Fraction:
        """How far its two lines are apart at most."""
        low, high = self.range
        if self.bend is None:
            return high - low
        length = max(b - a for a, b in self.parts)
        return min(sum(self.off(length), ZERO), high - low)


def _blocks(function: MembershipFunction, a: Fraction, b: Fraction) -> Iterator[_Block]:
    """Yield blocks from one knot to the next, halved until both lines are near."""
    todo, count = [(a, b)], 0
    while todo:
        checkpoint()
        first, last = todo.pop()
        block = _block(function, first, last)
        middle = Fraction(float((first + last) / 2))
        count += 1
        if block.apart <= APART or count > _MOST_BLOCKS or not first < middle < last:
            yield block
        else:
            todo += [(middle, last), (first, middle)]


def _block(function: MembershipFunction, a: Fraction, b: Fraction) -> _Block:
    bounds = jet(function, outwards(a)[0], outwards(b)[1])
    range_ = _within(bounds.value.low, bounds.value.high)
    if range_[0] == range_[1] or not math.isfinite(bounds.bend.size):
        return _Block(((a, b),), None, range_)
    bend = Fraction(bounds.bend.low), Fraction(bounds.bend.high)
    off = max(bounds.bend.high, 0.0) + max(-bounds.bend.low, 0.0)
    needed = (float(b) - float(a)) * math.sqrt(off / (8 * float(APART))) * _MORE
    count = math.ceil(min(max(needed, 1.0), _PARTS))
    inner = (Fraction(float(a + (b - a) * k / count)) for k in range(1, count))
    places = sorted({a, b, *(x for x in inner if a < x < b)})
    return _Block((*itertools.pairwise(places),), bend, range_)


def _chords(
    block: _Block,
    part: tuple[Fraction, Fraction],
    ends: tuple[tuple[Fraction, Fraction], tuple[Fraction, Fraction]],
) -> tuple[_Chord, _Chord]:
    """Return a part's line from below and from above, by bounds at both ends."""
    (p, r), (q, s) = ends
    low, high = block.range
    level = _Chord(*part, low, low), _Chord(*part, high, high)
    if block.bend is None:
        return level
    below, above = block.off(part[1] - part[0])
    if below + above > high - low:
        return level
    return _Chord(*part, p - below, q - below), _Chord(*part, r + above, s + above)


def _limit_chords(
    chords: Sequence[_Chord],
    limit: Fraction,
    pick: Callable[[Fraction, Fraction], Fraction],
) -> Iterator[_Chord]:
    """Yield lines that a limit holds; they meet it at doubles, on the safe side."""
    for a, b, p, q in chords:
        first, last = pick(p, limit), pick(q, limit)
        if (first == p) == (last == q) or limit in (p, q):
            yield _Chord(a, b, first, last)
            continue
        exact = a + (b - a) * (limit - p) / (q - p)
        x = Fraction(outwards(exact)[0 if first == p else 1])
        x = min(max(x, a), b)
        if a < x:
            yield _Chord(a, x, first, limit)
        if x < b:
            yield _Chord(x, b, limit, last)


def _line(chords: Sequence[_Chord], degrees: Mapping[Fraction, Fraction]) -> Lines:
    x = (*(chord.a for chord in chords), chords[-1].b)
    at = (degrees.get(chord.a, chord.p) for chord in chords)
    return Lines(
        x,
        (*at, degrees[x[-1]]),
        tuple(chord.p for chord in chords),
        tuple(chord.q for chord in chords),
    )


def value_at(lines: Lines, x: Fraction) -> Fraction:
    """Return the value of lines at a place, beyond their ends that of the end."""
    if x <= lines.x[0]:
        return lines.at[0]
    if x >= lines.x[-1]:
        return lines.at[-1]
    return lines.value(x)


def refine(lines: Lines, xs: Sequence[Fraction]) -> Lines:
    """Return lines on more knots, none of them before the first or behind the last."""
    if len(xs) == len(lines.x) and lines.x == tuple(xs):
        return lines
    piece, last = 0, len(lines.x) - 1
    if not last:
        more = lines.at * (len(xs) - 1)
        return Lines(tuple(xs), lines.at * len(xs), more, more)
    columns: list[tuple[Fraction, Fraction, Fraction]] = []  # value, limits at a knot
    for x in xs:
        while piece < last and lines.x[piece + 1] <= x:
            piece += 1
        if x == lines.x[piece]:
            ends = lines.after[min(piece, last - 1)], lines.before[max(piece - 1, 0)]
            columns.append((lines.at[piece], *ends))
        else:
            a, b = lines.x[piece : piece + 2]
            value = _on(a, b, *lines.ends(piece), x)
            columns.append((value, value, value))
    at, after, before = zip(*columns, strict=True)
    return Lines(tuple(xs), at, after[:-1], before[1:])


def _limit(
    function: MembershipFunction, x: Fraction, to: int
) -> tuple[Fraction, Fraction]:
    """Return bounds of the limit at a place, from the right (1) or the left (-1).

    LR sets do not jump; bands and points jump behind a value. Of the others some do,
    but from 0 to 1.
    """
    if isinstance(function, Hedged):
        return _apply_hedges(function, _limit(function.function, x, to))
    if isinstance(function, Band | Points) and to > 0:
        return _on_grid(lines_of(function, x, x + 1).lower.after[0])
    if isinstance(function, LR | Band | Points):
        return _on_grid(exact_degree(function, x))
    at = degree_within(function, x)
    if x != Fraction(float(x)):
        return at
    ends = sorted((float(x), math.nextafter(float(x), to * math.inf)))
    near = jet(function, *ends).value
    if near.high - float(at[0]) < 0.5 and float(at[1]) - near.low < 0.5:
        return at  # it does not jump
    return _within(near.low, near.high)


def _on_grid(value: Fraction) -> tuple[Fraction, Fraction]:
    """Return two numbers of few digits around one: later steps are faster with them."""
    low = Fraction(math.floor(value * _GRID), _GRID)
    return low, low if low == value else low + Fraction(1, _GRID)


def degree_within(
    function: MembershipFunction, x: Fraction
) -> tuple[Fraction, Fraction]:
    """Return between which fractions of few digits a degree lies."""
    if isinstance(function, LR):
        return _on_grid(exact_degree(function, x))
    if isinstance(function, Hedged):
        return _apply_hedges(function, degree_within(function.function, x))
    bounds = None
    if (
        isinstance(function, Curve) and float(x) in function.knots()
    ):  # where it may be 0 or 1 exactly
        bounds = degree_between(function, x)
    low, high = bounds or degree_bounds(function, x)
    return _within(low, high)


def _apply_hedges(
    function: Hedged, bounds: tuple[Fraction, Fraction]
) -> tuple[Fraction, Fraction]:
    """Return what becomes of bounds of a degree."""
    near = Jet(Interval(outwards(bounds[0])[0], outwards(bounds[1])[1]))
    algebra = Enclosed(is_open=False)
    return _within(*hedged(algebra, function.hedges, function.height * near).value)


def _within(low: float | Fraction, high: float | Fraction) -> tuple[Fraction, Fraction]:
    """Return bounds of a degree as fractions of few digits, from 0 to 1."""
    ends = Fraction(min(max(low, 0), 1)), Fraction(max(min(high, 1), 0))
    return _on_grid(ends[0])[0], _on_grid(ends[1])[1]


def combine(
    every: Sequence[Lines], pick: Callable[[tuple[Fraction, Fraction]], Fraction]
) -> Lines:
    """Return the least (`min`), largest (`max`) or sum of functions of one range.

    Example:
        >>> rise = lines_of(Points((0.0, 1.0), (0.0, 1.0)), Fraction(0), Fraction(1))
        >>> combine([rise.lower, rise.lower.complement()], min).highest
        Fraction(1, 2)
    """
    if len(every) == 1:
        return every[0]
    result = every[0]
    for other in every[1:]:
        result = _combine_two(result, other, pick)
    return result


def _combine_two(
    first: Lines, second: Lines, pick: Callable[[tuple[Fraction, Fraction]], Fraction]
) -> Lines:
    checkpoint()
    x: list[Fraction] = []
    at: list[Fraction] = []
    after: list[Fraction] = []
    before: list[Fraction] = []
    values = at_knots(first, second)
    for a, b, p, q, r, s in together(first, second):
        x.append(a)
        at.append(pick(next(values)[1:]))
        if (p - r) * (q - s) < 0:
            place = a + (b - a) * (p - r) / (p - r - q + s)
            value = _on(a, b, p, q, place)
            value = pick((value, value))
            x.append(place)
            at.append(value)
            after += [pick((p, r)), value]
            before += [value, pick((q, s))]
        else:
            after.append(pick((p, r)))
            before.append(pick((q, s)))
    x.append(first.x[-1])
    at.append(pick((first.at[-1], second.at[-1])))
    return Lines(tuple(x), tuple(at), tuple(after), tuple(before))


def together(
    first: Lines, second: Lines
) -> Iterator[tuple[Fraction, Fraction, Fraction, Fraction, Fraction, Fraction]]:
    """Yield where both are straight: the ends, and both values at both ends."""
    i = j = 0
    a = first.x[0]
    p, r = (of.after[0] if of.after else ZERO for of in (first, second))
    while i < len(first.after) and j < len(second.after):
        end, rival_end = first.x[i + 1], second.x[j + 1]
        is_first, is_last = end <= rival_end, end >= rival_end
        b = end if is_first else rival_end
        q, s = first.before[i], second.before[j]
        if not is_first:
            q = _on(first.x[i], end, first.after[i], q, b)
        if not is_last:
            s = _on(second.x[j], rival_end, second.after[j], s, b)
        yield a, b, p, q, r, s
        p, r = q, s
        if is_first:
            i += 1
            p = first.after[i] if i < len(first.after) else ZERO
        if is_last:
            j += 1
            r = second.after[j] if j < len(second.after) else ZERO
        a = b


def at_knots(
    first: Lines, second: Lines
) -> Iterator[tuple[Fraction, Fraction, Fraction]]:
    """Yield all knots of two functions, with both values there."""
    mine, theirs = (
        dict(zip(first.x, first.at, strict=True)),
        dict(zip(second.x, second.at, strict=True)),
    )
    for a, _, p, _, r, _ in together(first, second):
        yield a, mine.get(a, p), theirs.get(a, r)
    yield first.x[-1], first.at[-1], second.at[-1]
