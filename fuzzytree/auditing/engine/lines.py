"""Degrees along an axis as straight lines in fractions.

Bands and points are lines as they are. Any other membership function is enclosed
between two: on each of some parts of its range by the chord of the part, and no farther
from that than the bounds of its bend ask (`fuzzytree.semantics.jet`).
"""

from __future__ import annotations

import functools
import itertools
import math
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Final, NamedTuple

from fuzzytree.auditing.engine.pieces import ONE, ZERO
from fuzzytree.model import LR, Band, MembershipFunction, Points, checkpoint
from fuzzytree.numerics import exact_degree, outwards
from fuzzytree.semantics import degree_bounds, jet

_BLOCKS: Final = 4  # between two knots of a curve; each with one bound of its bend
_PARTS: Final = 4  # of a block; each with two lines around the curve
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
        return _on(self.x[place - 1], self.x[place], *self._ends(place - 1), x)

    def _ends(self, piece: int) -> tuple[Fraction, Fraction]:
        return self.after[piece], self.before[piece]

    @property
    def values(self) -> set[Fraction]:
        """All values and limits at knots."""
        return {*self.at, *self.after, *self.before}

    @property
    def highest(self) -> Fraction:
        """The least number that no value exceeds."""
        return max(self.values)

    def jumps(self, place: int) -> bool:
        """Return whether the value at a knot, by number, differs from a limit."""
        value = self.at[place]
        return (place > 0 and self.before[place - 1] != value) or (
            place < len(self.after) and self.after[place] != value
        )

    def crossings(self, level: Fraction) -> Iterator[Fraction]:
        """Yield the places strictly within lines where they have a value."""
        for a, b, p, q in self.pieces():
            if (p < level < q) or (q < level < p):
                yield a + (b - a) * (level - p) / (q - p)

    def lowered(self, by: Fraction) -> Lines:
        """Return the same, lower by a number."""
        return self._each(lambda value: value - by)

    def negated(self) -> Lines:
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

    def negated(self) -> Between:
        """Return 1 minus it."""
        upper = self.lower.negated()
        return Between(upper if self.is_exact else self.upper.negated(), upper)


def _on(a: Fraction, b: Fraction, p: Fraction, q: Fraction, x: Fraction) -> Fraction:
    return p if p == q else p + (q - p) * (x - a) / (b - a)


def constant(value: Fraction, low: Fraction, high: Fraction) -> Lines:
    """Return a function that is the same everywhere between two ends."""
    if low == high:
        return Lines((low,), (value,), (), ())
    return Lines((low, high), (value, value), (value,), (value,))


@functools.lru_cache(maxsize=1 << 12)
def lines_of(function: MembershipFunction, low: Fraction, high: Fraction) -> Between:
    """Return the degrees of a membership function between two ends as lines.

    Example:
        >>> band = Band(1.0, 2.0, left=0.0)
        >>> lines_of(band, Fraction(0), Fraction(4)).lower.value(Fraction(1, 2))
        Fraction(1, 2)
    """
    checkpoint()
    inner = (Fraction(k) for k in function.knots() if math.isfinite(k))
    knots = sorted({low, high, *(k for k in inner if low < k < high)})
    if not isinstance(function, Band | Points):
        return _enclosed(function, knots)
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


def _enclosed(function: MembershipFunction, knots: Sequence[Fraction]) -> Between:
    x = [knots[0]]
    rest: list[tuple[Fraction, Fraction]] = []  # what chords are off by at most
    for a, b in itertools.pairwise(knots):
        for block in range(_BLOCKS):
            first, last = (a + (b - a) * (block + k) / _BLOCKS for k in (0, 1))
            off = _off(function, first, last)
            x += (first + (last - first) * k / _PARTS for k in range(1, _PARTS + 1))
            rest += [off] * _PARTS if off else [(ONE, ONE)] * _PARTS
    at = [_degree(function, value) for value in x]
    sides: tuple[list[Fraction], ...] = ([], [], [], [])
    for place, (below, above) in enumerate(rest):
        checkpoint()
        (p, q), (r, s) = at[place], at[place + 1]
        ends = p - below, r - below, q + above, s + above
        if below == above == 1:  # nothing is known of the bend
            least, most = _range(function, x[place], x[place + 1])
            ends = least, least, most, most
        for side, value in zip(sides, ends, strict=True):
            side.append(value)
    lower, upper = (tuple(one[k] for one in at) for k in (0, 1))
    return Between(
        Lines(tuple(x), lower, tuple(sides[0]), tuple(sides[1])),
        Lines(tuple(x), upper, tuple(sides[2]), tuple(sides[3])),
    )


def _off(
    function: MembershipFunction, a: Fraction, b: Fraction
) -> tuple[Fraction, Fraction] | None:
    """Return by how much a function is below and above the chords of a block's parts.

    Between a and b it is the chord less f''(y) (x - a) (b - x) / 2 for some y, and the
    product is at most a quarter of the square of b - a. None if nothing is known.
    """
    bend = jet(function, outwards(a)[0], outwards(b)[1]).bend
    if not math.isfinite(bend.size):
        return None
    share = ((b - a) / _PARTS) ** 2 / 8
    off = (
        _rounded(max(Fraction(one), ZERO) * share)[1] for one in (bend.high, -bend.low)
    )
    below, above = off
    return None if max(below, above) >= 1 else (below, above)


def _rounded(value: Fraction) -> tuple[Fraction, Fraction]:
    """Return two numbers of few digits around one: later steps are faster with them."""
    low = Fraction(math.floor(value * _GRID), _GRID)
    return low, low if low == value else low + Fraction(1, _GRID)


def _degree(function: MembershipFunction, x: Fraction) -> tuple[Fraction, Fraction]:
    if isinstance(function, LR):
        return _rounded(exact_degree(function, x))
    known = degree_bounds(function, x)
    return _within(known.low, known.high)


def _range(
    function: MembershipFunction, a: Fraction, b: Fraction
) -> tuple[Fraction, Fraction]:
    known = jet(function, outwards(a)[0], outwards(b)[1]).value
    return _within(known.low, known.high)


def _within(low: float, high: float) -> tuple[Fraction, Fraction]:
    """Return bounds of a degree as fractions of few digits, from 0 to 1."""
    ends = Fraction(min(max(low, 0.0), 1.0)), Fraction(max(min(high, 1.0), 0.0))
    return _rounded(ends[0])[0], _rounded(ends[1])[1]


def combined(
    every: Sequence[Lines], pick: Callable[[tuple[Fraction, Fraction]], Fraction]
) -> Lines:
    """Return the least (`min`), largest (`max`) or sum of functions of one range.

    Example:
        >>> rise = lines_of(Points((0.0, 1.0), (0.0, 1.0)), Fraction(0), Fraction(1))
        >>> combined([rise.lower, rise.lower.negated()], min).highest
        Fraction(1, 2)
    """
    if len(every) == 1:
        return every[0]
    result = every[0]
    for other in every[1:]:
        result = _joined(result, other, pick)
    return result


def _joined(
    one: Lines, other: Lines, pick: Callable[[tuple[Fraction, Fraction]], Fraction]
) -> Lines:
    checkpoint()
    x: list[Fraction] = []
    at: list[Fraction] = []
    after: list[Fraction] = []
    before: list[Fraction] = []
    values = at_knots(one, other)
    for a, b, p, q, r, s in together(one, other):
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
    x.append(one.x[-1])
    at.append(pick((one.at[-1], other.at[-1])))
    return Lines(tuple(x), tuple(at), tuple(after), tuple(before))


def together(
    one: Lines, other: Lines
) -> Iterator[tuple[Fraction, Fraction, Fraction, Fraction, Fraction, Fraction]]:
    """Yield where both are straight: the ends, and both values at both ends."""
    i = j = 0
    a = one.x[0]
    p, r = (of.after[0] if of.after else ZERO for of in (one, other))
    while i < len(one.after) and j < len(other.after):
        b = min(one.x[i + 1], other.x[j + 1])
        q = _on(one.x[i], one.x[i + 1], one.after[i], one.before[i], b)
        s = _on(other.x[j], other.x[j + 1], other.after[j], other.before[j], b)
        yield a, b, p, q, r, s
        p, r = q, s
        if one.x[i + 1] == b:
            i += 1
            p = one.after[i] if i < len(one.after) else ZERO
        if other.x[j + 1] == b:
            j += 1
            r = other.after[j] if j < len(other.after) else ZERO
        a = b


def at_knots(one: Lines, other: Lines) -> Iterator[tuple[Fraction, Fraction, Fraction]]:
    """Yield all knots of two functions, with both values there."""
    mine, theirs = (
        dict(zip(one.x, one.at, strict=True)),
        dict(zip(other.x, other.at, strict=True)),
    )
    for a, _, p, _, r, _ in together(one, other):
        yield a, mine.get(a, p), theirs.get(a, r)
    yield one.x[-1], one.at[-1], other.at[-1]


@functools.lru_cache(maxsize=1 << 14)
def meetings(one: Lines, other: Lines) -> frozenset[Fraction]:
    """Return the values that two functions have where they cross or begin to differ."""
    found: set[Fraction] = set()
    for a, b, p, q, r, s in together(one, other):
        if (p - r) * (q - s) < 0:
            place = a + (b - a) * (p - r) / (p - r - q + s)
            found.add(_on(a, b, p, q, place))
        elif (p == r) != (q == s):
            found.add(p if p == r else q)
    return frozenset(found)
