"""Features of a frame in fractions, and how far other computations are from them.

Written from the definitions (paper, 2.1), sum by sum about the exact centre of
pressure, and not from the steps of `fuzzytree.tactile.features`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Context, Decimal, localcontext
from fractions import Fraction

import numpy as np

from fuzzytree.model.contracts import FloatArray
from fuzzytree.tactile.features.names import Feature, feature_of
from fuzzytree.tactile.sensor import Cells, Sensor, pressed

_DIGITS = Context(prec=80)
"""Angles, roots and logarithms are within 1e-60 of their size, at least."""

Point = tuple[Fraction, Fraction]
"""A complex number."""


def exact_features(
    sensor: Sensor, frame: Cells, names: Sequence[str]
) -> tuple[Fraction, ...]:
    """Return features of one frame, rational ones exactly, the others to 60 digits.

    Raises:
        TableError: If a name is no feature's, or the frame does not fit the sensor.

    Example:
        >>> import numpy as np
        >>> exact_features(Sensor(1, 3), np.array([[255, 0, 51]]), ["force", "S1"])
        (Fraction(6, 5), Fraction(2, 3))
    """
    cells = pressed(sensor, frame)[0].tolist()
    shown = _Frame(sensor, cells)
    if not shown.force:
        return (Fraction(0),) * len(names)
    return tuple(shown.feature(feature) for feature in map(feature_of, names))


class _Frame:
    """A frame with its sums in whole numbers."""

    def __init__(self, sensor: Sensor, cells: list[list[int]]) -> None:
        self.sensor = sensor
        self.cells = [
            (column, sensor.rows - 1 - row, value)
            for row, line in enumerate(cells)
            for column, value in enumerate(line)
            if value
        ]
        self.lines = cells
        self.force = sum(value for _, _, value in self.cells)
        # the centre of pressure, from the cell at the lower left, times the force
        self.x = sum(x * value for x, _, value in self.cells)
        self.y = sum(y * value for _, y, value in self.cells)

    def moment(self, p: int, q: int) -> Point:
        """Return C_pq with cells as they read: the sum of z^p conj(z)^q g."""
        away = [
            (x * self.force - self.x, y * self.force - self.y, value)
            for x, y, value in self.cells
        ]
        real = imaginary = 0
        for x, y, value in away:
            one, two = 1, 0
            for turn in [1] * p + [-1] * q:
                one, two = one * x - turn * two * y, turn * one * y + two * x
            real += value * one
            imaginary += value * two
        unit = self.force ** (p + q)
        return Fraction(real, unit), Fraction(imaginary, unit)

    def feature(self, feature: Feature) -> Fraction:
        """Return a feature of a frame on which something presses."""
        value = self._value(feature)
        if not feature.is_log:
            return value
        size = _logarithm(1 + abs(value))
        return -size if value < 0 else size

    def _value(self, feature: Feature) -> Fraction:
        unit = self.force if feature.per_force else self.sensor.full
        base, rows, columns = feature.base, self.sensor.rows, self.sensor.columns
        if feature.kind == "cell":
            return Fraction(self.lines[feature.row][feature.column], unit)
        if feature.kind == "block":
            return self._block(feature) / unit
        match base:
            case "force":
                return Fraction(self.force, unit)
            case "peak":
                return Fraction(max(value for _, _, value in self.cells), unit)
            case "area":
                return Fraction(len(self.cells))
            case "x":
                return Fraction(self.x, self.force) - Fraction(columns - 1, 2)
            case "y":
                return Fraction(self.y, self.force) - Fraction(rows - 1, 2)
            case "angle":
                real, imaginary = self.moment(2, 0)
                return degrees(imaginary, real) / 2
            case "cos2" | "sin2":
                part = self.moment(2, 0)
                length = _root(part[0] ** 2 + part[1] ** 2)
                return part[base == "sin2"] / length if length else Fraction(0)
            case _ if base[0] == "S":
                value, degree = _invariant(self, int(base[1:]))
                return value / Fraction(unit) ** degree
            case _:
                which, name = base.split()
                return self.moment(int(name[1]), int(name[2]))[which == "Im"] / unit

    def _block(self, feature: Feature) -> Fraction:
        rows, columns = self.sensor.rows, self.sensor.columns
        top = rows * feature.row // feature.rows
        bottom = rows * (feature.row + 1) // feature.rows
        left = columns * feature.column // feature.columns
        right = columns * (feature.column + 1) // feature.columns
        total = sum(sum(line[left:right]) for line in self.lines[top:bottom])
        return Fraction(total, (bottom - top) * (right - left))


def _times(*factors: Point) -> Point:
    real, imaginary = factors[0]
    for a, b in factors[1:]:
        real, imaginary = real * a - imaginary * b, real * b + imaginary * a
    return real, imaginary


def _conj(one: Point) -> Point:
    return one[0], -one[1]


def _invariant(frame: _Frame, number: int) -> tuple[Fraction, int]:
    """Return S_number (paper, 2.1, with the powers that S5 and S6 lack in print)."""
    c = frame.moment
    match number:
        case 1:
            return c(1, 1)[0], 1
        case 9:
            return c(2, 2)[0], 1
        case 5:
            return 2 * _times(_conj(c(3, 0)), *[c(2, 1)] * 3)[0], 4
        case 6:
            return 2 * _times(c(2, 1), c(2, 1), _conj(c(2, 0)))[0], 3
        case 10:
            return 2 * _times(_conj(c(4, 0)), c(3, 1), c(3, 1))[0], 3
        case 11:
            return 2 * _times(c(3, 1), _conj(c(2, 0)))[0], 2
        case _:
            p, q = {2: (2, 0), 3: (3, 0), 4: (2, 1), 7: (4, 0), 8: (3, 1)}[number]
            return _times(c(p, q), _conj(c(p, q)))[0], 2


def degrees(y: Fraction, x: Fraction) -> Fraction:
    """Return the angle of the point (x, y) in degrees, above -180 and up to 180.

    Example:
        >>> degrees(Fraction(0), Fraction(-1)), float(degrees(Fraction(1), Fraction(1)))
        (Fraction(180, 1), 45.0)
    """
    if not x and not y:
        return Fraction(0)
    low, high = sorted((abs(x), abs(y)))
    found = Fraction(45)
    if low != high:
        with localcontext(_DIGITS):
            found = Fraction(_arc_tangent(_decimal(low / high)) * 45)
            found /= Fraction(_arc_tangent(Decimal(1)))
    if abs(y) > abs(x):
        found = 90 - found
    if x < 0:
        found = 180 - found
    return -found if y < 0 else found


def _decimal(value: Fraction) -> Decimal:
    return Decimal(value.numerator) / Decimal(value.denominator)


def _root(value: Fraction) -> Fraction:
    with localcontext(_DIGITS):
        return Fraction(_decimal(value).sqrt())


def _logarithm(value: Fraction) -> Fraction:
    with localcontext(_DIGITS):
        return Fraction(_decimal(value).ln())


def _arc_tangent(t: Decimal) -> Decimal:
    """Return the angle of a tangent of at most 1: six halvings, then the series."""
    for _ in range(6):
        t = t / (1 + (1 + t * t).sqrt())
    terms = ((-1) ** k * t ** (2 * k + 1) / (2 * k + 1) for k in range(32))
    return 64 * sum(terms, Decimal(0))


ALLOWED = 1e-12
"""The largest error of a feature as a share of its scale: some thousand roundings, and
what the series of angles and logarithms leave out (`docs/explanation/moments.md`)."""

_ORDERS = ("2", "22", "33", "33", "3333", "332", "44", "44", "4", "444", "42")
"""Of S1 to S11: the orders of the moments that it is a product of."""

_TWICE = (5, 6, 10, 11)  # of the invariants: twice the real part of the product

_DEGREES = 90.0 / math.pi  # of half an angle, for each radian of the whole


def errors(
    sensor: Sensor,
    frame: Cells,
    names: Sequence[str],
    values: Sequence[float],
    exact: Sequence[Fraction],
) -> tuple[float, ...]:
    """Return how far features are from the exact ones, as shares of their scales.

    Example:
        >>> bar = np.array([[0, 255, 255]])
        >>> errors(Sensor(1, 3), bar, ["S1"], [0.75], [Fraction(1, 2)])
        (0.5,)
    """
    cells = pressed(sensor, frame)[0] / sensor.full
    if not cells.any():
        return tuple(0.0 if value == 0.0 else math.inf for value in values)
    sizes = _sizes(cells)
    found: list[float] = []
    every = zip(map(feature_of, names), values, exact, strict=True)
    for feature, value, right in every:
        apart = abs(Fraction(value) - right)
        if feature.base == "angle":
            apart = min(apart, 180 - apart)  # -90 and 90 are one direction
        scale = _scale(feature, sizes, max(cells.shape))
        if feature.is_log:  # an error of v is one of v / (1 + |v|) in log(1 + |v|)
            size = abs(float(right))
            scale = scale / (1.0 + math.expm1(size)) + max(size, 1.0)
        share = float(apart) / scale if scale else math.inf
        found.append(share if apart else 0.0)
    return tuple(found)


def _sizes(cells: FloatArray) -> list[float]:
    """Return the sums of g r^n for n from 0 to 4; |C20| at the end."""
    force = cells.sum()
    down, along = np.mgrid[0 : cells.shape[0], 0 : cells.shape[1]]
    z = (along - (along * cells).sum() / force) + 1j * (
        (down * cells).sum() / force - down
    )
    found = [float((cells * np.abs(z) ** order).sum()) for order in range(5)]
    return [*found, float(abs((cells * z**2).sum()))]


def _scale(feature: Feature, sizes: Sequence[float], side: int) -> float:
    """Return the scale of a feature, of its value itself if it is a logarithm."""
    unit = sizes[0] if feature.per_force else 1.0
    base, direction = feature.base, sizes[2] / (sizes[5] or math.inf)
    if feature.kind != "moment" or base in ("force", "area", "peak"):
        return sizes[0] / unit
    match base:
        case "x" | "y":
            return float(side)
        case "angle":
            return 90.0 + _DEGREES * direction
        case "cos2" | "sin2":
            return 1.0 + direction
        case _ if base[0] == "S":
            number = int(base[1:])
            product = math.prod(sizes[int(n)] / unit for n in _ORDERS[number - 1])
            return 2 * product if number in _TWICE else product
        case _:
            return sizes[int(base[-2]) + int(base[-1])] / unit
