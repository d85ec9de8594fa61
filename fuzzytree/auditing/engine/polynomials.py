"""Polynomials with rational coefficients, and where they are zero: in integers.

A polynomial is a tuple of fractions, the constant first. Roots are isolated by the
signs of Bernstein coefficients (Descartes' rule: no change of sign, no root; one
change, exactly one) and halving; nothing is rounded.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from fractions import Fraction

from fuzzytree.model import Value, checkpoint

Polynomial = tuple[Fraction, ...]

_DEEPEST = 96  # halvings, after which roots that are not apart stay one place
_FINE = 48  # bits of the place of a root within its interval


class Root(Value, frozen=True):
    """A place where a polynomial is zero, or nearly is: from `low` to `high`."""

    low: Fraction  # at most the root; the root itself if `low == high`
    high: Fraction  # at least the root
    # whether there is exactly one root; otherwise there are none or several within less
    # than 2**-96 of the interval that was searched
    is_sure: bool = True


def value_at(polynomial: Polynomial, x: Fraction) -> Fraction:
    """Return the exact value of a polynomial, in integers but for one division.

    Example:
        >>> value_at((Fraction(1), Fraction(2)), Fraction(1, 2))
        Fraction(2, 1)
    """
    numbers, common = integers(polynomial)
    top, bottom = x.numerator, x.denominator
    total, power = numbers[-1], 1
    for number in reversed(numbers[:-1]):
        power *= bottom
        total = total * top + number * power
    return Fraction(total, common * power)


Integers = tuple[int, ...]

_KNOWN: dict[int, tuple[Polynomial, Integers, int]] = {}  # by identity: no hashing
_MOST_KNOWN = 1 << 14


def integers(polynomial: Polynomial) -> tuple[Integers, int]:
    """Return the coefficients over their common denominator, and the denominator."""
    known = _KNOWN.get(id(polynomial))
    if known is not None and known[0] is polynomial:
        return known[1], known[2]
    common = math.lcm(*(one.denominator for one in polynomial))
    scaled = tuple(one.numerator * (common // one.denominator) for one in polynomial)
    if len(_KNOWN) >= _MOST_KNOWN:
        _KNOWN.clear()
    _KNOWN[id(polynomial)] = polynomial, scaled, common
    return scaled, common


def derivative(polynomial: Polynomial) -> Polynomial:
    """Return the derivative; of a constant, 0.

    Example:
        >>> derivative((Fraction(5), Fraction(3), Fraction(1)))
        (Fraction(3, 1), Fraction(2, 1))
    """
    if len(polynomial) < 2:
        return (Fraction(0),)
    return tuple(power * one for power, one in enumerate(polynomial[1:], 1))


def difference(one: Polynomial, other: Polynomial) -> Polynomial:
    """Return one polynomial minus another, without zeros at its end."""
    size = max(len(one), len(other))
    padded = [(*each, *(Fraction(0),) * (size - len(each))) for each in (one, other)]
    result = [a - b for a, b in zip(*padded, strict=True)]
    while len(result) > 1 and not result[-1]:
        result.pop()
    return tuple(result)


def composed(polynomial: Polynomial, offset: Fraction, slope: Fraction) -> Polynomial:
    """Return p(offset + slope x) as a polynomial in x.

    Example:
        >>> composed((Fraction(0), Fraction(0), Fraction(1)), Fraction(1), Fraction(2))
        (Fraction(1, 1), Fraction(4, 1), Fraction(4, 1))
    """
    numbers, common = integers(polynomial)
    bottom = math.lcm(offset.denominator, slope.denominator)
    shifted, power = _shifted(
        numbers,
        offset.numerator * (bottom // offset.denominator),
        slope.numerator * (bottom // slope.denominator),
        bottom,
    )
    return tuple(Fraction(one, common * power) for one in shifted)


def _shifted(
    numbers: Sequence[int], offset: int, slope: int, bottom: int
) -> tuple[list[int], int]:
    """Return bottom**n p((offset + slope z) / bottom), and bottom**n."""
    result = [numbers[-1]]
    power = 1
    for number in reversed(numbers[:-1]):
        power *= bottom
        scaled = [offset * one for one in result]
        scaled.append(0)
        for place, one in enumerate(result):
            scaled[place + 1] += slope * one
        scaled[0] += number * power
        result = scaled
    return result, power


def roots(polynomial: Polynomial, low: Fraction, high: Fraction) -> tuple[Root, ...]:
    """Return the places in the open interval where a polynomial is zero, in order.

    The places are apart from each other, and each is at most 2**-48 of the interval
    wide. A polynomial that is 0 everywhere has none.

    Raises:
        ValueError: If the interval is empty.

    Example:
        >>> [(p.low, p.high) for p in roots((Fraction(-1), Fraction(3)), *map(Fraction, (0, 1)))]
        [(Fraction(1, 3), Fraction(1, 3))]
        >>> two = roots((Fraction(-2), Fraction(0), Fraction(1)), *map(Fraction, (0, 9)))
        >>> len(two), two[0].low ** 2 < 2 < two[0].high ** 2
        (1, True)
    """  # noqa: E501
    if not low < high:
        raise ValueError(f"no interval from {low} to {high}")
    checkpoint()
    numbers, _ = integers(polynomial)
    while len(numbers) > 1 and not numbers[-1]:
        numbers = numbers[:-1]
    if len(numbers) == 1:
        return ()
    if len(numbers) == 2:
        at = Fraction(-numbers[0], numbers[1])
        return (Root(at, at),) if low < at < high else ()
    bottom = math.lcm(low.denominator, high.denominator)
    start = low.numerator * (bottom // low.denominator)
    width = high.numerator * (bottom // high.denominator) - start
    unit, _ = _shifted(numbers, start, width, bottom)
    size = high - low
    return tuple(
        Root(low + size * a, low + size * b, is_sure)
        for a, b, is_sure in _unit_roots(unit)
    )


def _unit_roots(numbers: list[int]) -> list[tuple[Fraction, Fraction, bool]]:
    """Return the places in (0, 1) where a polynomial with integer coefficients is 0."""
    degree, polynomial = len(numbers) - 1, tuple(map(Fraction, numbers))
    result: list[tuple[Fraction, Fraction, bool]] = []
    todo = [(0, 0, _bernstein(numbers))]
    while todo:
        level, index, bends = todo.pop()
        changes = _changes(bends)
        if changes == 0:
            continue
        size = Fraction(1, 1 << level)
        if changes == 1:
            place = Root(index * size, (index + 1) * size)
            root = refined(polynomial, place, _FINE)
            result.append((root.low, root.high, True))
            continue
        if level == _DEEPEST:
            result.append((index * size, (index + 1) * size, False))
            continue
        left, right = _halves(bends, degree)
        if right[0] == 0:
            middle = (2 * index + 1) * size / 2
            result.append((middle, middle, True))
        todo += [(level + 1, 2 * index, left), (level + 1, 2 * index + 1, right)]
    return _apart(sorted(result))


def _apart(
    result: list[tuple[Fraction, Fraction, bool]],
) -> list[tuple[Fraction, Fraction, bool]]:
    """Join places that touch; two roots there become one place."""
    kept: list[tuple[Fraction, Fraction, bool]] = []
    for low, high, is_sure in result:
        if kept and low <= kept[-1][1]:
            kept[-1] = (kept[-1][0], max(high, kept[-1][1]), False)
        else:
            kept.append((low, high, is_sure))
    return kept


@functools.cache
def _weights(degree: int) -> tuple[int, ...]:
    """Return degree! over each binomial coefficient: whole numbers i! (degree - i)!."""
    return tuple(
        math.factorial(i) * math.factorial(degree - i) for i in range(degree + 1)
    )


def bernstein(polynomial: Polynomial) -> Polynomial:
    """Return the Bernstein coefficients of a polynomial on [0, 1].

    The least and the largest bound it there; the first and the last are its values at
    0 and 1.

    Example:
        >>> [str(one) for one in bernstein((Fraction(1), Fraction(2), Fraction(0)))]
        ['1', '2', '3']
    """
    numbers, common = integers(polynomial)
    common *= math.factorial(len(numbers) - 1)
    return tuple(Fraction(one, common) for one in _bernstein(numbers))


def _bernstein(numbers: Sequence[int]) -> list[int]:
    """Return degree! times the Bernstein coefficients: sums of C(j, i) over C(n, i)."""
    degree = len(numbers) - 1
    result = [a * b for a, b in zip(numbers, _weights(degree), strict=True)]
    for step in range(degree):  # Pascal's triangle, by additions
        for place in range(degree, step, -1):
            result[place] += result[place - 1]
    return result


def _changes(bends: Sequence[int]) -> int:
    signs = [one > 0 for one in bends if one]
    return sum(a != b for a, b in itertools.pairwise(signs))


def _halves(bends: Sequence[int], degree: int) -> tuple[list[int], list[int]]:
    """Return the coefficients on both halves, times 2**degree (de Casteljau)."""
    row = list(bends)
    left, right = [row[0] << degree], [row[-1] << degree]
    for step in range(1, degree + 1):
        row = [a + b for a, b in itertools.pairwise(row)]
        left.append(row[0] << (degree - step))
        right.append(row[-1] << (degree - step))
    return left, right[::-1]


def magnitude(number: Fraction) -> int:
    """Return the power of 2 that a number, not 0, is about; also beyond doubles.

    Example:
        >>> magnitude(Fraction(10) ** 400), magnitude(Fraction(-1, 1000))
        (1329, -8)
    """
    return abs(number.numerator).bit_length() - number.denominator.bit_length() + 1


def refined(polynomial: Polynomial, root: Root, bits: int) -> Root:
    """Return a sure root's place, at most 2**-bits wide, by signs in fractions.

    On scales far above 1 the number of bits may be below 0.

    Example:
        >>> two = (Fraction(-2), Fraction(0), Fraction(1))
        >>> result = refined(two, Root(Fraction(1), Fraction(2)), 100)
        >>> result.high - result.low <= Fraction(1, 2**100)
        True
    """
    low, high = root.low, root.high
    goal = Fraction(2) ** -bits
    if not root.is_sure or high - low <= goal:
        return root
    below, above = value_at(polynomial, low), value_at(polynomial, high)
    rising = above > 0 or below < 0
    power = 2  # the interval is cut into 2**power parts
    while (size := high - low) > goal:
        power = max(min(power, magnitude(size / goal)), 1)
        share = Fraction(1, 2)
        if below * above < 0:  # an end that is 0 is another root
            share = below / (below - above)
        part = size / (1 << power)
        place = min(max(math.floor(share * (1 << power)), 0), (1 << power) - 1)
        first = low + place * part
        for at in (first, first + part):  # where the chord crosses, if it is straight
            if not low < at < high:
                continue
            result = value_at(polynomial, at)
            if result == 0:
                return Root(at, at)
            if (result > 0) == rising:
                high, above = at, result
                break
            low, below = at, result
        power = power * 2 if high - low <= part else power // 2
    return Root(low, high, root.is_sure)
