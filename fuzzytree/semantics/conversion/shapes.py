"""Curves of systems as shapes of rule bases, where that is exact."""

from __future__ import annotations

import math
from collections.abc import Iterable

from fuzzytree.model.rulebase import LR, Band, Points, Shape
from fuzzytree.model.system import Binary, Curve, Singleton, Trapezoid

_Points = list[tuple[float, float]]


def shape_of(curve: Curve) -> Shape | None:
    """Return a shape with the degrees of a curve, the same bits at every double.

    A step of points has its first degree at the value itself. Where a curve is 1 at its
    left edge already, the step stands one double below.

    Returns:
        The shape, or None if none has these degrees.

    Example:
        >>> shape_of(Trapezoid(0.0, 1.0, 1.0, 3.0))
        Points(values=(0.0, 1.0, 3.0), degrees=(0.0, 1.0, 0.0))
    """
    match curve:
        case Band() | LR() | Points():
            return curve
        case Trapezoid(a=a, b=b, c=c, d=d):
            left = [(b, 1.0)] if a is None else _rise(a, b)
            right = [(c, 1.0)] if d is None else _fall(c, d)
            if a is None:
                left = []
            elif d is None:
                right = []
            return _joined(left, right)
        case Singleton(value=value):
            return _joined(_rise(value, value), _fall(value, value))
        case Binary(start=start, is_above=is_above):
            return _joined(_rise(start, start) if is_above else _fall(start, start), [])
        case _:
            return None


def stepped(values: Iterable[float]) -> tuple[float, ...]:
    """Return the values of points; of two neighbouring doubles the first comes twice.

    No double lies between such two, so a step at the first has the same degrees. A
    value that comes twice already stays.

    Example:
        >>> import math
        >>> stepped((0.0, 1.0, math.nextafter(1.0, 2.0), 2.0))
        (0.0, 1.0, 1.0, 2.0)
    """
    found: list[float] = []
    for value in values:
        is_second = len(found) > 1 and found[-1] == found[-2]
        is_next = bool(found) and value == math.nextafter(found[-1], math.inf)
        found.append(found[-1] if is_next and not is_second else value)
    return tuple(found)


def _rise(start: float, end: float) -> _Points:
    if start < end:
        return [(start, 0.0), (end, 1.0)]
    before = math.nextafter(end, -math.inf)
    if math.isinf(before):
        return [(end, 1.0)]
    return [(before, 0.0), (before, 1.0)]


def _fall(start: float, end: float) -> _Points:
    return [(start, 1.0), (end, 0.0)]


def _joined(left: _Points, right: _Points) -> Points:
    if left and right and left[-1] == right[0]:
        right = right[1:]
    values, degrees = zip(*left, *right, strict=True)
    return Points(values, degrees)
