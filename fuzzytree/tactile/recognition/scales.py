"""How large a feature of a frame could be: what an error is measured against.

A moment whose parts cancel is small, and rounding is relative to the parts. The scale
of a feature is what it would be without cancelling: the same expression of the sums of
g r^n, r the distance from the centre of pressure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.tactile.features.names import Feature, features_of_names
from fuzzytree.tactile.sensor import Cells, Sensor, pressed

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

_PARTS = {
    1: (1, (2,)),
    2: (1, (2, 2)),
    3: (1, (3, 3)),
    4: (1, (3, 3)),
    5: (2, (3, 3, 3, 3)),
    6: (2, (3, 3, 2)),
    7: (1, (4, 4)),
    8: (1, (4, 4)),
    9: (1, (4,)),
    10: (2, (4, 4, 4)),
    11: (2, (4, 2)),
}
"""Of each invariant: a factor, and the orders of the moments that it is made of."""

_DEGREES = 90.0 / math.pi  # of half an angle, for each radian of the whole


def errors(
    sensor: Sensor,
    frame: Cells,
    names: Sequence[str],
    values: Sequence[float],
    exact: Sequence[Fraction],
) -> tuple[float, ...]:
    """Return how far features are from the exact ones, as shares of their scales.

    Args:
        sensor: The sensor.
        frame: Shape (rows, columns).
        names: Of the features.
        values: What was computed.
        exact: What is right.

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
    every = zip(features_of_names(names), values, exact, strict=True)
    for feature, value, right in every:
        apart = abs(Fraction(value) - right)
        if feature.base == "angle":
            apart = min(apart, 180 - apart)  # -90 and 90 are one direction
        if not apart:
            found.append(0.0)
            continue
        scale = _scale(feature, sizes, cells, float(right))
        found.append(float(apart) / scale if scale else math.inf)
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


def _scale(
    feature: Feature,
    sizes: Sequence[float],
    cells: FloatArray,
    right: float,
) -> float:
    """Return the scale of a feature."""
    scale = _own_scale(feature, sizes, cells)
    if feature.is_log:  # an error of v is one of v / (1 + |v|) in log(1 + |v|)
        value = math.expm1(abs(right))
        return scale / (1.0 + value) + max(abs(right), 1.0)
    return scale


def _own_scale(
    feature: Feature,
    sizes: Sequence[float],
    cells: FloatArray,
) -> float:
    unit = sizes[0] if feature.per_force else 1.0
    base, direction = feature.base, sizes[2] / (sizes[5] or math.inf)
    if feature.kind != "moment" or base in ("force", "area", "peak"):
        return sizes[0] / unit
    match base:
        case "x" | "y":
            return float(max(cells.shape))
        case "angle":
            return 90.0 + _DEGREES * direction
        case "cos2" | "sin2":
            return 1.0 + direction
        case _ if base[0] == "S":
            factor, orders = _PARTS[int(base[1:])]
            return factor * math.prod(sizes[order] / unit for order in orders)
        case _:
            return sizes[int(base[-2]) + int(base[-1])] / unit
