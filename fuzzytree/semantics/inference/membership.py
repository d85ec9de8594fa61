"""The membership functions of a fuzzy system: the degree at a value, and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, assert_never

from fuzzytree.model import (
    LR,
    Arc,
    Band,
    Bell,
    Binary,
    Concave,
    Cosine,
    Curve,
    Formula,
    Gaussian,
    Linear,
    PiCurve,
    Points,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    Spike,
    Trapezoid,
    TwoGaussians,
)
from fuzzytree.semantics.inference.formulas import (
    exponential,
    logarithm,
    power,
    quotient,
    square_root,
    value_of,
)
from fuzzytree.semantics.reference import degree as shape_degree

_NOTHING: Final[Mapping[str, float]] = {}


def curve_degree(
    curve: Curve, x: float, names: Mapping[str, float] = _NOTHING
) -> float:
    """Return the degree of a finite value, without the label's height.

    Args:
        curve: The curve. A `Linear` one, a sum of inputs, has the degree NaN.
        x: The value.
        names: The values of the variables, for formulas; `x` itself is added.

    Returns:
        A degree in [0, 1]. Of a formula any number, also NaN or an infinity.

    Raises:
        KeyError: If a formula needs a name that has no value.

    Example:
        >>> curve_degree(Trapezoid(0.0, 2.0, 3.0, 4.0), 0.5)
        0.25
        >>> curve_degree(Arc(0.0, 1.0), 0.0), curve_degree(Arc(0.0, 1.0), 2.0)
        (0.0, 1.0)
    """
    match curve:
        case Band() | LR() | Points():
            return shape_degree(curve, x)
        case Trapezoid():
            return _trapezoid(curve, x)
        case Gaussian(mean=mean, deviation=deviation):
            return _gaussian(x, mean, deviation)
        case TwoGaussians():
            below = _gaussian(min(x, curve.left), curve.left, curve.left_deviation)
            above = _gaussian(max(x, curve.right), curve.right, curve.right_deviation)
            return below * above
        case Bell(center=center, width=width, slope=slope):
            return 1.0 / (1.0 + power(abs((x - center) / width), 2.0 * slope))
        case Sigmoid(inflection=inflection, slope=slope):
            return 1.0 / (1.0 + exponential(-slope * (x - inflection)))
        case SigmoidDifference(first=first, second=second):
            return abs(curve_degree(first, x) - curve_degree(second, x))
        case SigmoidProduct(first=first, second=second):
            return curve_degree(first, x) * curve_degree(second, x)
        case SCurve(start=start, end=end):
            return _s(x, start, end)
        case PiCurve(a=a, b=b, c=c, d=d):
            falling = 1.0 if x <= c else 0.0 if x >= d else _s(x, d, c)
            return _s(x, a, b) * falling
        case Cosine(center=center, width=width):
            return _cosine((x - center) / width)
        case Concave(inflection=inflection, end=end):
            return _concave(x, inflection, end)
        case Spike(center=center, width=width):
            return exponential(-abs(10.0 * ((x - center) / width)))
        case Arc(start=start, end=end):
            return _arc((x - start) / (end - start))
        case SemiEllipse(start=start, end=end):
            return _semi_ellipse(x, start, end)
        case Binary(start=start, is_above=is_above):
            return float(x >= start if is_above else x <= start)
        case Singleton(value=value):
            return float(x == value)
        case Linear():
            return math.nan
        case Formula(expression=expression):
            return value_of(expression, {**names, "x": x})
        case _:
            assert_never(curve)


def value_at(curve: Curve, degree: float) -> float | None:
    """Return where a monotone curve has a degree, after Tsukamoto.

    Monotone are `Sigmoid`, `SCurve`, `Concave` and `Arc`, and a ramp: two points of
    which one has degree 0 and the other 1. Degrees above 1, which sums can make, follow
    the same formulas: on along the line of a ramp, NaN for roots and logarithms.

    Returns:
        The value; None for every other curve. Where only the infinite has the degree
        (1 of a sigmoid), an infinity.

    Example:
        >>> value_at(SCurve(0.0, 4.0), 0.125), value_at(Concave(0.0, 1.0), 0.5)
        (1.0, 0.0)
        >>> value_at(Gaussian(0.0, 1.0), 0.5) is None
        True
    """
    match curve:
        case Points(values=(first, last), degrees=(0.0, 1.0)) if first < last:
            return first + (last - first) * degree
        case Points(values=(first, last), degrees=(1.0, 0.0)) if first < last:
            return last + (first - last) * degree
        case Sigmoid(inflection=inflection, slope=slope):
            odds = logarithm(quotient(1.0, degree) - 1.0)
            return inflection - quotient(odds, slope)
        case SCurve(start=start, end=end):
            if degree <= 0.5:
                return start + (end - start) * square_root(0.5 * degree)
            return end - (end - start) * square_root(0.5 * (1.0 - degree))
        case Concave(inflection=inflection, end=end):
            return end - (end - inflection) * (quotient(1.0, degree) - 1.0)
        case Arc(start=start, end=end):
            root = square_root((1.0 - degree) * (1.0 + degree))
            return end - (end - start) * root
        case _:
            return None


def _trapezoid(curve: Trapezoid, x: float) -> float:
    a, b, c, d = curve.a, curve.b, curve.c, curve.d
    if (a is not None and x < a) or (d is not None and x > d):
        return 0.0
    if x < b and a is not None:
        return (x - a) / (b - a)
    if x > c and d is not None:
        return (d - x) / (d - c)
    return 1.0


def _gaussian(x: float, mean: float, deviation: float) -> float:
    t = (x - mean) / deviation
    return exponential(-0.5 * (t * t))


def _s(x: float, start: float, end: float) -> float:
    """Return the degree of an S curve; one without width is a step behind `start`."""
    if start == end:
        return 0.0 if x <= start else 1.0
    t = (x - start) / (end - start)
    if t <= 0.0:
        return 0.0
    if t <= 0.5:
        return 2.0 * (t * t)
    if t >= 1.0:
        return 1.0
    rest = (x - end) / (end - start)
    return 1.0 - 2.0 * (rest * rest)


def _cosine(t: float) -> float:
    if not -0.5 <= t <= 0.5:
        return 0.0
    return 0.5 * (1.0 + math.cos(2.0 * math.pi * t))


def _concave(x: float, inflection: float, end: float) -> float:
    if inflection <= end and x < end:
        return (end - inflection) / ((end - inflection) + (end - x))
    if inflection > end and x > end:
        return (inflection - end) / ((inflection - end) + (x - end))
    return 1.0


def _arc(u: float) -> float:
    """Return the degree of an arc, u of its width behind its start."""
    if u <= 0.0:
        return 0.0
    return 1.0 if u >= 1.0 else square_root(u * (2.0 - u))


def _semi_ellipse(x: float, start: float, end: float) -> float:
    if not start <= x <= end:
        return 0.0
    width = end - start
    return 2.0 * square_root(((x - start) / width) * ((end - x) / width))
