"""Membership functions of the numbers in a file: one constructor for all readers.

Engines agree on numbers in order. What is made of a function that ends where it starts,
or before, depends on the engine.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, Literal

from fuzzytree.formats.formulas import parse
from fuzzytree.model import (
    Binary,
    Curve,
    Formula,
    Points,
    SCurve,
    SigmoidDifference,
    Trapezoid,
)

Engine = Literal["fuzzylite", "jfuzzylogic", "jfml", "matlab", "octave"]
Maker = Callable[[Sequence[float], Engine], Curve]
"""Makes a membership function of numbers; raises ValueError if an engine has none."""

FAR: Final = 1e300
"""Corners beyond it stand for none: a file of FIS has no way to say `1 up to here`."""


def triangle(numbers: Sequence[float], engine: Engine) -> Curve:
    """Return a triangle of its left end, its peak and its right end."""
    left, peak, right = numbers
    return trapezoid((left, peak, peak, right), engine)


def trapezoid(numbers: Sequence[float], engine: Engine) -> Trapezoid:
    """Return a trapezoid; corners beyond `FAR` leave a side open, but in JFML.

    A side to the next double is a step: no value lies on it.

    Example:
        >>> trapezoid((-2e300, -1e300, 3.0, 5.0), "matlab").a is None
        True
    """
    a, b, c, d = numbers
    if engine == "jfml":
        return Trapezoid(a, b, c, d)
    low = None if a == -math.inf or b <= -FAR else a
    high = None if d == math.inf or c >= FAR else d
    b = b if b > -FAR else min(c, 0.0) if c >= FAR else c
    c = c if c < FAR else b
    low = b if low == math.nextafter(b, -math.inf) else low
    high = c if high == math.nextafter(c, math.inf) else high
    return Trapezoid(low, b, c, high)


def rectangle(numbers: Sequence[float], engine: Engine) -> Curve:
    """Return 1 between two ends, which fuzzylite takes in any order."""
    start, end = sorted(numbers) if engine == "fuzzylite" else numbers
    return Trapezoid(start, start, end, end)


def s_shape(numbers: Sequence[float], engine: Engine, *, falls: bool = False) -> Curve:
    """Return an S curve; a step where it ends at its start, or before.

    In MATLAB the step is in the middle, with degree 1 there; fuzzylite and JFML look
    at the start first, and the step is behind it; Octave refuses such numbers.
    """
    start, end = numbers
    if start < end:
        return SCurve(end, start) if falls else SCurve(start, end)
    if engine == "matlab":
        return Binary((start + end) / 2.0, is_above=not falls)
    if engine == "octave":
        raise ValueError(f"Octave takes no curve from {start!r} to {end!r}")
    return Points((start, start), (1.0, 0.0) if falls else (0.0, 1.0))


def line(numbers: Sequence[float], engine: Engine, *, falls: bool = False) -> Curve:
    """Return a line from 0 to 1; without width a step, behind its start in JFML."""
    start, end = numbers
    if start < end or engine == "jfml":
        degrees = (1.0, 0.0) if falls else (0.0, 1.0)
        return Points((start, max(start, end)), degrees)
    if end < start:
        raise ValueError(f"the line ends at {end!r}, before its start {start!r}")
    before = math.nextafter(start, -math.inf)
    return Binary(before, is_above=False) if falls else Binary(start)


def ramp(numbers: Sequence[float], engine: Engine) -> Curve:
    """Return a ramp of fuzzylite, which falls if it ends before it starts."""
    start, end = numbers
    if start == end:
        raise ValueError("a Ramp must end elsewhere than where it starts")
    low, high = sorted(numbers)
    return Points((low, high), (0.0, 1.0) if start < end else (1.0, 0.0))


def binary(numbers: Sequence[float], engine: Engine) -> Curve:
    """Return 1 on the side of a start where the direction is."""
    start, direction = numbers
    if start == direction:
        raise ValueError("the direction of Binary must be above or below its start")
    return Binary(start, direction > start)


def difference_of(curve: Curve, engine: Engine) -> Curve:
    """Return a difference of sigmoids as an engine has it; other curves stay.

    Octave and jFuzzyLogic answer 0 where it is negative, the others its size.
    """
    if (
        engine not in ("octave", "jfuzzylogic")
        or not isinstance(curve, SigmoidDifference)
        or is_plain(curve)
    ):
        return curve
    one, two = (
        f"1 / (1 + exp({-part.slope!r} * (x - {part.inflection!r})))"
        for part in (curve.first, curve.second)
    )
    return Formula(parse(f"max(0, {one} - {two})"))


def is_plain(curve: SigmoidDifference) -> bool:
    """Return whether the first sigmoid is nowhere below the second one."""
    one, two = curve.first, curve.second
    return one.slope == two.slope > 0.0 and one.inflection <= two.inflection
