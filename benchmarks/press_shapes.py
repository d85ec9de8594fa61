"""The paper's seven objects as exact shapes, and how much of each cell they cover.

Lengths are in cells of 0.2 inch; x runs right, y runs up. An object's origin is the
centre of its pressure.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from fuzzytree.model import Value

FloatArray = npt.NDArray[np.float64]

_SIDES = 32  # of the polygon that stands for a disc
_TINY = 1e-300  # instead of a height of 0, which nothing is divided by


class ShapePart(Value, frozen=True):
    """A polygon that presses evenly.

    Attributes:
        corners: (x, y), counterclockwise.
        weight: Its pressure beside that of the object's other parts.
    """

    corners: tuple[tuple[float, float], ...]
    weight: float = 1.0


class Object(Value, frozen=True):
    """A thing that is pressed on the sensor.

    Attributes:
        name: As in the paper's Table 1.
        parts: Where parts overlap, their pressures add.
        force_n: The force that it is pressed with, in newtons.
        turned_deg: How far it is turned counterclockwise.
    """

    name: str
    parts: tuple[ShapePart, ...]
    force_n: float
    turned_deg: float = 0.0


def rectangle(width: float, height: float) -> ShapePart:
    """Return a rectangle about the origin.

    Example:
        >>> rectangle(4.0, 2.0).corners
        ((-2.0, -1.0), (2.0, -1.0), (2.0, 1.0), (-2.0, 1.0))
    """
    x, y = width / 2, height / 2
    return ShapePart(((-x, -y), (x, -y), (x, y), (-x, y)))


def disc(radius: float) -> ShapePart:
    """Return a regular polygon of 32 corners about the origin, of a disc's area.

    Its mean square distance from the middle is 0.01 per cent above the disc's.
    """
    step = 2 * math.pi / _SIDES
    outer = radius * math.sqrt(step / math.sin(step))
    angles = [step * (side + 0.5) for side in range(_SIDES)]
    return ShapePart(tuple((outer * math.cos(a), outer * math.sin(a)) for a in angles))


def finger(
    start: tuple[float, float], angle_deg: float, length: float, width: float
) -> ShapePart:
    """Return a bar that ends in half a round, as a finger does.

    Args:
        start: The middle of its straight end.
        angle_deg: Where it points to, counterclockwise from x.
        length: From the straight end to the tip.
        width: Of the bar; the tip is half a regular polygon of 12 corners.
    """
    angle, radius = math.radians(angle_deg), width / 2
    along, across = math.cos(angle), math.sin(angle)
    turns = [math.pi * (k / 6 - 0.5) for k in range(7)]
    outline = [(0.0, -radius)]
    outline += [
        (length - radius + radius * math.cos(t), radius * math.sin(t)) for t in turns
    ]
    outline += [(0.0, radius)]
    return ShapePart(
        tuple(
            (start[0] + u * along - v * across, start[1] + u * across + v * along)
            for u, v in outline
        )
    )


def area_and_middle(part: ShapePart) -> tuple[float, float, float]:
    """Return a polygon's area and the x and y of its middle."""
    corners = np.array(part.corners)
    after = np.roll(corners, -1, axis=0)
    cross = corners[:, 0] * after[:, 1] - after[:, 0] * corners[:, 1]
    area = float(cross.sum()) / 2
    x, y = ((corners + after) * cross[:, np.newaxis]).sum(axis=0) / (6 * area)
    return area, float(x), float(y)


def covered(corners: FloatArray, xs: FloatArray, ys: FloatArray) -> FloatArray:
    """Return how much of polygons lies left of each x and below each y.

    The area below `Y` and left of `X` is `-(the integral of min(y, Y) dx)` along the
    edges with every x cut at X: exact for any polygon, convex or not.

    Args:
        corners: Shape (polygons, corners, 2), counterclockwise.
        xs: Shape (m,).
        ys: Shape (n,).

    Returns:
        Areas of shape (polygons, n, m).

    Example:
        >>> square = np.array([rectangle(2.0, 2.0).corners])
        >>> covered(square, np.array([0.0, 9.0]), np.array([0.5])).tolist()
        [[[1.5, 3.0]]]
    """
    x, y = corners[:, :, 0, np.newaxis], corners[:, :, 1, np.newaxis]
    after_x, after_y = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
    run = after_x - x
    slope = np.divide(after_y - y, run, out=np.zeros_like(run), where=run != 0)
    begin, end = np.minimum(x, xs), np.minimum(after_x, xs)
    bottom, top = np.minimum(y, after_y), np.maximum(y, after_y)
    first = np.clip(y + (begin - x) * slope, bottom, top)
    last = np.clip(y + (end - x) * slope, bottom, top)
    low = np.minimum(first, last)[:, :, np.newaxis]
    high = np.maximum(first, last)[:, :, np.newaxis]
    level = ys[:, np.newaxis]
    # The mean of min(y, Y) over an edge: Y on the share of it that lies above Y.
    above = (high - level) / np.maximum(high - low, _TINY)
    np.clip(above, 0.0, 1.0, out=above)
    below = (low + np.minimum(high, level)) / 2
    mean = below + above * (level - below)
    areas: FloatArray = -np.einsum("pex,peyx->pyx", end - begin, mean)
    return areas


def _centred(parts: list[ShapePart]) -> tuple[ShapePart, ...]:
    """Move parts so that the centre of their pressure is the origin."""
    weights = [part.weight * area_and_middle(part)[0] for part in parts]
    middles = [area_and_middle(part)[1:] for part in parts]
    x, y = np.average(np.array(middles), axis=0, weights=weights).tolist()
    return tuple(
        ShapePart(tuple((a - x, b - y) for a, b in part.corners), part.weight)
        for part in parts
    )


def radius_of(thing: Object) -> float:
    """Return an object's radius of gyration: its root mean square distance, in cells.

    Each polygon's sum of squares is exact (Green's theorem).
    """
    squares = total = 0.0
    for part in thing.parts:
        corners = np.array(part.corners)
        after = np.roll(corners, -1, axis=0)
        cross = corners[:, 0] * after[:, 1] - after[:, 0] * corners[:, 1]
        both = (corners**2 + corners * after + after**2).sum(axis=1)
        squares += part.weight * float((cross * both).sum()) / 12
        total += part.weight * float(cross.sum()) / 2
    return math.sqrt(squares / total)


_FINGERS = (  # from the thumb: where it begins in x, where it points to, its length
    (-2.19, 102.5, 7.24),
    (-0.73, 94.2, 7.87),
    (0.73, 85.8, 7.4),
    (2.19, 77.5, 5.9),
)


def _hand(turned_deg: float) -> Object:
    """Return a right hand from its back, fitted once to Table 2 of the paper."""
    palm = rectangle(5.85, 6.99)
    low = -3.495
    heel = ShapePart(
        ((-2.925, low - 1.0), (2.925, low - 1.0), (2.925, low), (-2.925, low))
    )
    fingers = [finger((x, -low), angle, length, 0.81) for x, angle, length in _FINGERS]
    thumb = finger((-2.925, -2.31), 151, 3.1, 1.7)
    parts = [
        palm,
        ShapePart(heel.corners, 3.4),
        *(ShapePart(one.corners, 0.21) for one in fingers),
        ShapePart(thumb.corners, 1.1),
    ]
    return Object(f"hand-{turned_deg:g}", _centred(parts), 217.0, turned_deg)


def _bar(turned_deg: float) -> Object:
    return Object(
        f"rectangle-{turned_deg:g}", (rectangle(5.55, 1.74),), 24.7, turned_deg
    )


OBJECTS: Mapping[str, Object] = MappingProxyType(
    {
        thing.name: thing
        for thing in (
            _bar(0.0),
            _bar(27.0),
            _bar(45.0),
            Object("circle", (disc(1.55),), 10.9),
            Object("square", (rectangle(3.4, 3.4),), 24.3),
            _hand(0.0),
            _hand(45.0),
        )
    }
)
"""The paper's seven, in the order of its Table 1 (C1 to C7)."""
