"""Bounds of numbers on many boxes at once, rounded outwards; of averages and slopes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fuzzytree.model import FloatArray

_UNIT = 2.0**-52


class Bounds(NamedTuple):
    """The least and the largest value, of shape (boxes,) or (summands, boxes)."""

    low: FloatArray
    high: FloatArray

    def __neg__(self) -> Bounds:
        return Bounds(-self.high, -self.low)

    def plus(self, other: Bounds) -> Bounds:
        """Return bounds of the sum."""
        return _outwards(self.low + other.low, self.high + other.high)

    def times(self, other: Bounds) -> Bounds:
        """Return bounds of the product, where 0 times infinity is 0."""
        products = [a * b for a in self for b in other]
        products = [np.where(np.isnan(product), 0.0, product) for product in products]
        return _outwards(np.minimum.reduce(products), np.maximum.reduce(products))

    def over(self, divisor: Bounds) -> Bounds:
        """Return bounds of the quotient by something that is never negative."""
        return self.times(_outwards(1.0 / divisor.high, 1.0 / divisor.low))

    def total(self) -> Bounds:
        """Return bounds of the sum over all summands."""
        slack = len(self.low) * _UNIT
        low = self.low.sum(0) - slack * np.abs(self.low).sum(0)
        return _outwards(low, self.high.sum(0) + slack * np.abs(self.high).sum(0))


def _outwards(low: FloatArray, high: FloatArray) -> Bounds:
    """Return bounds moved outwards; of what is not known, infinite ones."""
    low, high = low - _UNIT * np.abs(low), high + _UNIT * np.abs(high)
    return Bounds(
        np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)
    )


def exact(values: FloatArray) -> Bounds:
    """Return bounds of numbers that are known."""
    return Bounds(values, values)


def stack(parts: Sequence[Bounds]) -> Bounds:
    """Return bounds of several numbers as summands."""
    return Bounds(*map(np.array, zip(*parts, strict=True)))


def average(values: Bounds, weights: Bounds) -> Bounds:
    """Return bounds of an average; infinite ones, low above high, without any weight.

    The least average gives small values their largest weights and large values their
    least: it is the least over all ways to part the sorted values in two.

    Example:
        >>> values = exact(np.array([[0.0], [10.0]]))
        >>> weights = Bounds(np.array([[0.5], [0.25]]), np.array([[0.5], [0.5]]))
        >>> [round(float(end[0]), 3) for end in average(values, weights)]
        [3.333, 5.0]
    """
    least, most = (_least_average(x, weights) for x in (values.low, -values.high))
    return Bounds(least, -most)


def _least_average(values: FloatArray, weights: Bounds) -> FloatArray:
    values = np.broadcast_to(values, weights.low.shape)
    order = np.argsort(values, axis=0, kind="stable")
    x, low, high = (np.take_along_axis(of, order, 0) for of in (values, *weights))
    with np.errstate(divide="ignore", invalid="ignore"):
        sums = _split_sums(high, low)
        averages = np.where(sums > 0.0, _split_sums(x * high, x * low) / sums, np.inf)
    slack = 2 * (len(values) + 4) * _UNIT * np.abs(values).max(0)
    return np.array(averages.min(0) - slack)


def _split_sums(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the sums of the first entries up to each, and of the second behind it."""
    rest = np.zeros_like(second)
    rest[:-1] = second[:0:-1].cumsum(0)[::-1]
    return np.array(first.cumsum(0) + rest)


class Change(NamedTuple):
    """Bounds of a number, and of its slope with an input."""

    value: Bounds
    slope: Bounds

    def __neg__(self) -> Change:
        return Change(-self.value, -self.slope)

    def times(self, other: Change) -> Change:
        """Return the product."""
        slope = self.slope.times(other.value).plus(self.value.times(other.slope))
        return Change(self.value.times(other.value), slope)


def largest(changes: Sequence[Change]) -> Change:
    """Return the largest of some numbers.

    Its slope is that of a number that may be larger than all others, or of the one
    that is surely as large as the rest.
    """
    values, slopes = (stack(parts) for parts in zip(*changes, strict=True))
    low = values.low.max(0)
    may_be = values.high > low
    np.put_along_axis(may_be, values.low.argmax(0)[None], values=True, axis=0)
    falls = np.where(may_be, slopes.low, np.inf).min(0)
    rises = np.where(may_be, slopes.high, -np.inf).max(0)
    return Change(Bounds(low, values.high.max(0)), Bounds(falls, rises))
