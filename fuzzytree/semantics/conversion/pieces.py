"""Pieces of curves, and how far a chord can be from what lies above it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

Function = Callable[[float], float]
Error = Callable[[float, float], float]


class Piece(NamedTuple):
    """A stretch of a curve.

    Attributes:
        start: Where it starts.
        end: Where it ends; above `start`.
        error: How far the chord between two of its values can be from the curve.
    """

    start: float
    end: float
    error: Error


class Plan(NamedTuple):
    """How points can be placed along a curve.

    Attributes:
        parts: Pieces, and points that must be there, from left to right; the curve is
            constant between two that do not meet.
        tail: How far it can be from its outermost points' degrees beyond them.
        slack: What rounding can add to any error.
        first: The degree of the first point, if it is known better than computed.
        last: The degree of the last one.
    """

    parts: tuple[Piece | tuple[float, float], ...]
    tail: float = 0.0
    slack: float = 0.0
    first: float | None = None
    last: float | None = None


def bent(value: Function, slope: Function) -> Error:
    """Return the error of chords of a curve that bends to one side only.

    Args:
        value: The curve.
        slope: Its slope within the piece; an infinity at an upright end.

    Example:
        >>> bent(lambda x: x * x, lambda x: 2.0 * x)(0.0, 1.0)
        0.25
    """

    def error(a: float, b: float) -> float:
        middle = a + (b - a) / 2
        if not a < middle < b:
            return 0.0  # no double lies between
        at_a, at_m, at_b = value(a), value(middle), value(b)
        rise = slope(middle)
        chord = (at_b - at_a) / (b - a)

        def apart(x: float) -> float:
            return abs((at_a + chord * (x - a)) - (at_m + rise * (x - middle)))

        left = _meeting(a, at_a, slope(a), middle, at_m, rise)
        right = _meeting(b, at_b, slope(b), middle, at_m, rise)
        return max(apart(left), apart(right))

    return error


def _meeting(
    end: float, at_end: float, outer: float, middle: float, at_m: float, rise: float
) -> float:
    """Return where the tangent at an end meets that in the middle, between the two."""
    if math.isinf(outer) or outer == rise:
        return end
    chord = (at_m - at_end) / (middle - end)
    share = (rise - chord) / (rise - outer)
    return end + (middle - end) * min(max(share, 0.0), 1.0)
