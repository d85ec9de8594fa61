"""From a frame to the features that a model uses, and no others.

The features of a sensor's frames are a few exact sums over the pressed cells and a
program on these sums (`FrameProgram`). Numpy, ONNX and C all run that program, so that
a frame has the same features, bit for bit, wherever they are computed.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Literal

from msgspec import structs

from fuzzytree.errors import InvalidModelError
from fuzzytree.model import Value
from fuzzytree.semantics import Maker, Place, Program, Result, result_of
from fuzzytree.tactile.features.moments import (
    ORDER,
    Centred,
    Complex,
    angle,
    signed_log,
    sum_name,
)
from fuzzytree.tactile.features.names import INVARIANTS, Feature, feature_of
from fuzzytree.tactile.sensor import Sensor

PRESSED = "pressed"
"""The name of the last result of a frame's program: 1 where anything presses."""

_LARGEST = 2**53  # whole numbers below it, and their sums, are exact in double


class Sum(Value, frozen=True):
    """A number that is made of all cells of a frame.

    Attributes:
        name: Of the input of the program.
        of: `cells`: the sum of the pressed cells times the weights. `count`: how many
            are pressed. `peak`: the largest.
        weights: A whole number for each cell, row by row; empty for the others.
    """

    name: str
    of: Literal["cells", "count", "peak"]
    weights: tuple[int, ...] = ()


class FrameProgram(Value, frozen=True):
    """What is computed of a frame.

    Attributes:
        sensor: Whose frames they are.
        features: The names, in order.
        sums: What is taken from the cells, in the order of the program's inputs.
        program: From the sums to a result for each feature and `PRESSED` at the end.
    """

    sensor: Sensor
    features: tuple[str, ...]
    sums: tuple[Sum, ...]
    program: Program

    @property
    def cost(self) -> int:
        """How many operations a frame takes, those on cells included."""
        cells = self.sensor.rows * self.sensor.columns
        each = {"cells": 2, "count": 1, "peak": 1}
        return self.program.size + cells * sum(each[one.of] for one in self.sums)


def frame_program(sensor: Sensor, names: Sequence[str]) -> FrameProgram:
    """Return what computes some features of a sensor's frames.

    Where nothing presses, every feature is 0. Values within the noise of their
    rounding are exactly 0.

    Raises:
        TableError: If a name is no feature's.
        InvalidModelError: If a block or cell lies outside the sensor, or if sums for
            a feature are beyond what doubles hold exactly.

    Example:
        >>> made = frame_program(Sensor(16, 16), ["S1", "cell r0 c2"])
        >>> [one.name for one in made.sums]
        ['sum 00', 'sum 10', 'sum 01', 'sum 20', 'sum 02', 'cell r0 c2']
    """
    features = [feature_of(name) for name in names]
    every = _every_sum(sensor, features)
    values, results = _Values(sensor), list[Result]()
    make = values.make
    is_pressed = make.where(values.moments.is_pressed, 1.0, 0.0)
    for feature in features:
        with make.topic(feature.name):
            results.append(result_of("output", feature.name, values.of(feature)))
    results.append(result_of("output", PRESSED, is_pressed))
    inputs = tuple(one.name for one in every)
    whole = make.program("features", inputs, tuple(results))
    used = {step.name for step in whole.steps if step.operation == "input"}
    sums = tuple(one for one in every if one.name in used)
    _check_exact(sensor, sums)
    program = structs.replace(whole, inputs=tuple(one.name for one in sums))
    return FrameProgram(sensor, tuple(names), sums, program)


def costs(sensor: Sensor, names: Sequence[str]) -> Mapping[str, float]:
    """Return how many operations each feature takes by itself.

    `learn` divides by its cost what a further feature of a combination gains, and
    counts of thousands keep nearly all of them out: give it `1 + 1e-6 * cost` where
    costs decide between equals alone (paper, 2.3, step 4).

    Raises:
        TableError: As `frame_program`.
        InvalidModelError: As `frame_program`.

    Example:
        >>> found = costs(Sensor(16, 16), ["S1", "S7"])
        >>> found["S1"] < found["S7"]
        True
    """
    return {name: float(frame_program(sensor, [name]).cost) for name in names}


class _Values:
    """The values of features as steps, with each part made once."""

    def __init__(self, sensor: Sensor) -> None:
        self.sensor, self.make = sensor, Maker()
        self.moments = Centred(self.make)
        self._parts: dict[str, Complex] = {}

    def of(self, feature: Feature) -> Place:
        """Return the value of a feature, 0 where nothing presses."""
        value = self._value(feature)
        if feature.is_log:
            value = signed_log(value)
        return self.make.where(self.moments.is_pressed, value, 0.0)

    def _value(self, feature: Feature) -> Place:
        make, base = self.make, feature.base
        if feature.kind != "moment":
            count = math.prod(map(len, _cells_of(self.sensor, feature)))
            return self._scaled(make.input(base) / float(count), 1, feature)
        match base:
            case "force" | "peak":
                name = sum_name(0, 0) if base == "force" else base
                return self._scaled(make.input(name), 1, feature)
            case "area":
                return make.input(base)
            case "x" | "y":
                return self._centre(base)
            case "angle" | "cos2" | "sin2":
                return self._direction(base)
            case _ if base in INVARIANTS:
                return self._invariant(feature)
            case _:
                part, name = base.split()
                value = self._part(name)[part == "Im"].settled()
                return self._scaled(value, 1, feature)

    def _part(self, name: str) -> Complex:
        """Return a complex moment by its name, such as C20."""
        if name not in self._parts:
            with self.make.topic(name):
                found = self.moments.complex_moment(int(name[1]), int(name[2]))
                self._parts[name] = found
        return self._parts[name]

    def _scaled(self, value: Place, degree: int, feature: Feature) -> Place:
        """Return a value of some degree in g, a share of full or a pressure.

        Or in g divided by its sum, which has no unit.
        """
        unit: Place | float = float(self.sensor.full**degree)
        if self.sensor.top != 1.0:
            unit = (self.sensor.full / self.sensor.top) ** degree
        if feature.per_force:
            unit = self.make.chain("multiply", [self.moments.total] * degree)
        return value / unit

    def _centre(self, base: str) -> Place:
        x, y = self.moments.centre()
        side = self.sensor.columns if base == "x" else self.sensor.rows
        offset = 0.0 if side % 2 else 0.5
        return x + offset if base == "x" else y + -offset

    def _direction(self, base: str) -> Place:
        make = self.make
        real, imaginary = (part.settled() for part in self._part("C20"))
        if base == "angle":
            return angle(imaginary, real) * 0.5
        length = make.root(real * real + imaginary * imaginary)
        length = make.where(make.equal(length, 0.0), 1.0, length)
        return (real if base == "cos2" else imaginary) / length

    def _invariant(self, feature: Feature) -> Place:
        """Return an invariant (paper, 2.1)."""
        scale, factors, conjugated = INVARIANTS[feature.base]
        product = functools.reduce(Complex.times, map(self._part, factors))
        value = product.real
        if conjugated:
            value = product.along(self._part(conjugated))
        if scale != 1.0:
            value = value * scale
        degree = len(factors) + bool(conjugated)
        return self._scaled(value.settled(), degree, feature)


def _every_sum(sensor: Sensor, features: Sequence[Feature]) -> list[Sum]:
    """Return all sums that features could ask for, moments first."""
    found = [
        Sum(sum_name(order - q, q), "cells", _weights(sensor, order - q, q))
        for order in range(ORDER + 1)
        for q in range(order + 1)
    ]
    found += [Sum("area", "count"), Sum("peak", "peak")]
    for kind in ("block", "cell"):
        parts = {feature.base: feature for feature in features if feature.kind == kind}
        found += [Sum(base, "cells", _inside(sensor, f)) for base, f in parts.items()]
    return found


def _weights(sensor: Sensor, p: int, q: int) -> tuple[int, ...]:
    """Return x^p y^q of each cell, from the cell at rows // 2, columns // 2."""
    return tuple(
        (column - sensor.columns // 2) ** p * (sensor.rows // 2 - row) ** q
        for row in range(sensor.rows)
        for column in range(sensor.columns)
    )


def _cells_of(sensor: Sensor, feature: Feature) -> tuple[range, range]:
    """Return the rows and columns of a block; a cell is one of the finest division.

    Raises:
        InvalidModelError: If it lies outside the sensor.
    """
    sides = sensor.rows, sensor.columns
    counts = sides if feature.kind == "cell" else (feature.rows, feature.columns)
    numbers = feature.row, feature.column
    parts = [*zip(sides, numbers, counts, strict=True)]
    if not all(number < count <= side for side, number, count in parts):
        text = f"{feature.base!r} lies outside a sensor of {sensor.rows} x "
        raise InvalidModelError([((), f"{text}{sensor.columns} cells")])
    high, wide = (
        range(side * number // count, side * (number + 1) // count)
        for side, number, count in parts
    )
    return high, wide


def _inside(sensor: Sensor, feature: Feature) -> tuple[int, ...]:
    rows, columns = _cells_of(sensor, feature)
    return tuple(
        int(row in rows and column in columns)
        for row in range(sensor.rows)
        for column in range(sensor.columns)
    )


def _check_exact(sensor: Sensor, sums: Sequence[Sum]) -> None:
    """Refuse sums that are not exact, before or after they are moved.

    A move takes x to x - r, with r inside the sensor.
    """
    right, up = sensor.columns // 2, sensor.rows // 2
    widths = [abs(column - right) + right for column in range(sensor.columns)]
    heights = [abs(up - row) + up for row in range(sensor.rows)]
    for one in sums:
        p, q = map(int, one.name[4:]) if one.name.startswith("sum ") else (0, 0)
        most = sum(width**p for width in widths) * sum(h**q for h in heights)
        if sensor.full * most >= _LARGEST:
            text = (
                f"a sensor of {sensor.rows} x {sensor.columns} cells up to "
                f"{sensor.full} is too large for exact moments of order {p + q}"
            )
            raise InvalidModelError([((), text)])
