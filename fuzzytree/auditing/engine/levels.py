"""Irrational critical levels, compared exactly.

At an irrational place, the one root of q in an interval, a curve has the value of its
polynomial p there: an algebraic number. It is a zero of the first linear relation among
the powers of p modulo q. Two such numbers within one narrow interval are equal if all
that their two relations have there is a single zero; otherwise narrower intervals part
them, and that ends because numbers that differ are some distance apart.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Final, NamedTuple

from fuzzytree.auditing.engine.pieces import (
    ONE,
    ZERO,
    ChangePoint,
    RuleCurve,
    piece_at,
    pieces,
)
from fuzzytree.auditing.engine.polynomials import (
    Polynomial,
    Root,
    difference,
    division,
    magnitude,
    multiplied,
    refined,
    roots,
    squarefree,
    values_near,
)
from fuzzytree.model import checkpoint

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from fuzzytree.model import IntArray

_BITS: Final = (0, 512, 1024, 4096)  # to which places are known, one after another


class AlgebraicLevel(NamedTuple):
    """A value of a curve at an irrational place.

    Attributes:
        polynomial: The curve there.
        of: What is 0 at the place, and nowhere else in the interval of the root.
        root: The place.
        least: The curve is at least this.
        most: The curve is at most this.
    """

    polynomial: Polynomial
    of: Polynomial
    root: Root
    least: Fraction = ZERO
    most: Fraction = ONE

    def between(self, bits: int) -> tuple[Fraction, Fraction]:
        """Return bounds of the value, from so many bits of the place; 0: as it is."""
        at = self.root
        if bits:
            size = max(abs(at.low), abs(at.high)) or ONE
            at = refined(self.of, at, bits - magnitude(size))
        return values_near(self.polynomial, at.low, at.high)


@functools.lru_cache(maxsize=1 << 14)
def level_at(
    element: RuleCurve, place: ChangePoint, low: Fraction, high: Fraction
) -> AlgebraicLevel | Fraction | None:
    """Return a curve's value at an irrational place; None if it is not certain."""
    if place.of is None or not place.of[1].is_sure:
        return None
    polynomial, root = place.of[0], Root(low, high)
    piece = piece_at(pieces(element.shape), place.low)
    least, most, own = ZERO, piece.cap, piece.polynomial
    if element.is_complement:
        least, most, own = 1 - most, ONE, difference((ONE,), own)
    polynomial = difference(polynomial, (ZERO,))
    _, own = division(own, polynomial)
    if len(own) == 1:
        return min(max(own[0], least), most)
    level = AlgebraicLevel(own, polynomial, root, least, most)
    low, high = level.between(_BITS[0])
    known = level if least < low and high < most else _clipped(level)
    # A fraction of few digits in so narrow an interval is hardly there by chance.
    near = ((low + high) / 2).limit_denominator(1 << 64)
    is_near = isinstance(known, AlgebraicLevel) and low <= near <= high
    return near if is_near and _compared(level, near) == 0 else known


def _clipped(level: AlgebraicLevel) -> AlgebraicLevel | Fraction | None:
    """Return the end of its range that a value is at or beyond, or the value."""
    for end, sign in ((level.least, -1), (level.most, 1)):
        order = _compared(level, end)
        if order is None:
            return None
        if order * sign >= 0:
            return end
    return level


def _compared(one: AlgebraicLevel, other: AlgebraicLevel | Fraction) -> int | None:
    """Return the sign of one value minus another; None if they are too near to tell."""
    for bits in _BITS:
        checkpoint()
        low, high = one.between(bits)
        least, most = _span(other, bits)
        if high < least:
            return -1
        if low > most:
            return 1
        joint = _joint(_relation(one), _relation(other))
        margin = high - low or ONE
        ends = min(low, least) - margin, max(high, most) + margin
        met = roots(joint, *ends)
        if len(met) == 1 and met[0].is_sure:
            return 0
    return None


def _relation(level: AlgebraicLevel | Fraction) -> Polynomial:
    if isinstance(level, Fraction):
        return (-level, ONE)
    return relation(level.polynomial, level.of)


@functools.lru_cache(maxsize=1 << 10)
def _joint(one: Polynomial, other: Polynomial) -> Polynomial:
    """Return a polynomial that is 0 where one of two is, and there only once."""
    return squarefree(one if one == other else multiplied(one, other))


@functools.lru_cache(maxsize=1 << 10)
def relation(polynomial: Polynomial, of: Polynomial) -> Polynomial:
    """Return what is 0 at the values of p where q is 0: p's relation modulo q.

    `of`: q, of degree 1 at least.

    Example:
        >>> square = (Fraction(0), Fraction(0), Fraction(1))
        >>> golden = (Fraction(-1), Fraction(-1), Fraction(1))  # x * x = x + 1
        >>> [int(one) for one in relation(square, golden)]  # t * t = 3 t - 1
        [1, -3, 1]
    """
    size = len(of) - 1
    rows: list[tuple[int, list[Fraction], list[Fraction]]] = []
    power: Polynomial = (ONE,)
    for degree in range(size + 1):
        row = [*power, *(ZERO,) * (size - len(power))]
        combination = [ZERO] * degree + [ONE]
        for pivot, known, by in rows:
            share = row[pivot]
            if share:
                row = [a - share * b for a, b in zip(row, known, strict=True)]
                for place, one in enumerate(by):
                    combination[place] -= share * one
        left = [place for place, one in enumerate(row) if one]
        if not left:
            return tuple(combination)
        scale = row[left[0]]
        rows.append(
            (left[0], [a / scale for a in row], [a / scale for a in combination])
        )
        _, power = division(multiplied(power, polynomial), of)
    raise AssertionError  # size + 1 rows of size numbers are dependent


# --- many levels


def separate_levels(
    band: IntArray,
    low: npt.NDArray[np.object_],
    high: npt.NDArray[np.object_],
    level_of: Callable[[int], AlgebraicLevel | Fraction | None],
) -> list[int]:
    """Set bounds of levels of one band to be the same, or apart, where that is known.

    `low`: the lower bounds, which are changed; `level_of`: what a level is, by number.

    Returns:
        The numbers of those that are known exactly now.
    """
    members: dict[int, list[int]] = {}
    for number, of in enumerate(band.tolist()):
        members.setdefault(of, []).append(number)
    sure: list[int] = []
    for numbers in members.values():
        if all(low[n] == high[n] == low[numbers[0]] for n in numbers):
            continue
        checkpoint()
        levels = [level_of(number) for number in numbers]
        known = [level for level in levels if level is not None]
        groups = equal_levels(known) if len(known) == len(levels) else None
        for span, places in (groups or {}).items():
            # All bounds of equal ones hold, and none leaves the band.
            equal = [numbers[place] for place in places]
            low[equal] = max(span[0], *low[equal])
            high[equal] = min(span[1], *high[equal])
            sure += equal
    return sure


def equal_levels(
    levels: Sequence[AlgebraicLevel | Fraction],
) -> dict[tuple[Fraction, Fraction], list[int]] | None:
    """Return levels, by position, that are one number, by bounds that are apart.

    None if some are too near to tell.

    Example:
        >>> two = (Fraction(-2), Fraction(0), Fraction(1))
        >>> root = roots(two, Fraction(1), Fraction(2))[0]
        >>> side, square = (ZERO, Fraction(1, 2)), (ZERO, ZERO, Fraction(1, 4))
        >>> a, b = (AlgebraicLevel(one, two, root) for one in (side, square))
        >>> list(equal_levels([a, b, Fraction(1, 2), a]).values())
        [[1, 2], [0, 3]]
    """
    for bits in _BITS:
        groups: list[tuple[Fraction, Fraction, list[int]]] = []
        spans = sorted((*_span(level, bits), n) for n, level in enumerate(levels))
        for low, high, number in spans:
            if groups and low <= groups[-1][1]:
                first, last, places = groups.pop()
                groups.append((min(first, low), max(last, high), [*places, number]))
            else:
                groups.append((low, high, [number]))
        if all(_are_one([levels[n] for n in places]) for _, _, places in groups):
            return {(low, high): places for low, high, places in groups}
    return None


def _span(level: AlgebraicLevel | Fraction, bits: int) -> tuple[Fraction, Fraction]:
    return (level, level) if isinstance(level, Fraction) else level.between(bits)


def _are_one(levels: Sequence[AlgebraicLevel | Fraction]) -> bool:
    """Return whether levels are known to be one number."""
    first, *others = sorted(
        dict.fromkeys(levels), key=lambda one: isinstance(one, Fraction)
    )
    return not others or (
        isinstance(first, AlgebraicLevel)
        and all(_compared(first, other) == 0 for other in others)
    )
