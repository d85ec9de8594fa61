"""The ANDs, the ORs and the hedges of a fuzzy system, as operations on degrees."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from fuzzytree.model import Hedge, SNorm, TNorm
from fuzzytree.semantics.inference.formulas import (
    maximum,
    minimum,
    power,
    quotient,
    square_root,
)


def hedged(hedge: Hedge, degree: float) -> float:
    """Return what a hedge makes of a degree.

    Example:
        >>> hedged("very", 0.5), hedged("not", 0.25), hedged("any", 0.25)
        (0.25, 0.75, 1.0)
    """
    return _HEDGES[hedge](degree)


def hedges_applied(hedges: Sequence[Hedge], degree: float) -> float:
    """Return what hedges make of a degree, the last first."""
    for hedge in reversed(hedges):
        degree = hedged(hedge, degree)
    return degree


def _extremely(d: float) -> float:
    return 2.0 * (d * d) if d <= 0.5 else 1.0 - 2.0 * ((1.0 - d) * (1.0 - d))


def _seldom(d: float) -> float:
    if d <= 0.5:
        return square_root(0.5 * d)
    return 1.0 - square_root(0.5 * (1.0 - d))


_HEDGES: Final[Mapping[Hedge, Callable[[float], float]]] = {
    "any": lambda d: 1.0,
    "not": lambda d: 1.0 - d,
    "very": lambda d: d * d,
    "somewhat": square_root,
    "extremely": _extremely,
    "seldom": _seldom,
    "cubed": lambda d: d * d * d,
    "very very": lambda d: (d * d) * (d * d),
    "plus": lambda d: power(d, 1.25),
    "minus": lambda d: power(d, 0.75),
    "cube root": lambda d: power(d, 1.0 / 3.0),
}


def t_norm(name: TNorm, a: float, b: float) -> float:
    """Return the AND of two degrees.

    Example:
        >>> t_norm("bounded difference", 0.5, 0.75)
        0.25
    """
    return T_NORMS[name](a, b)


def s_norm(name: SNorm, a: float, b: float) -> float:
    """Return the OR of two degrees.

    Example:
        >>> s_norm("algebraic sum", 0.5, 0.5), s_norm("sum", 1.0, 1.0)
        (0.75, 2.0)
    """
    return S_NORMS[name](a, b)


def _hamacher_product(a: float, b: float) -> float:
    return 0.0 if a + b == 0.0 else quotient(a * b, a + b - a * b)


def _hamacher_sum(a: float, b: float) -> float:
    product = a * b
    return 1.0 if product == 1.0 else quotient(a + b - 2.0 * product, 1.0 - product)


T_NORMS: Final[Mapping[TNorm, Callable[[float, float], float]]] = {
    "minimum": minimum,
    "product": lambda a, b: a * b,
    "bounded difference": lambda a, b: maximum(0.0, a + b - 1.0),
    "drastic product": lambda a, b: minimum(a, b) if maximum(a, b) == 1.0 else 0.0,
    "einstein product": lambda a, b: quotient(a * b, 2.0 - (a + b - a * b)),
    "hamacher product": _hamacher_product,
    "nilpotent minimum": lambda a, b: minimum(a, b) if a + b > 1.0 else 0.0,
}

S_NORMS: Final[Mapping[SNorm, Callable[[float, float], float]]] = {
    "maximum": maximum,
    "algebraic sum": lambda a, b: a + b - a * b,
    "bounded sum": lambda a, b: minimum(1.0, a + b),
    "drastic sum": lambda a, b: maximum(a, b) if minimum(a, b) == 0.0 else 1.0,
    "einstein sum": lambda a, b: quotient(a + b, 1.0 + a * b),
    "hamacher sum": _hamacher_sum,
    "nilpotent maximum": lambda a, b: maximum(a, b) if a + b < 1.0 else 1.0,
    "normalized sum": lambda a, b: quotient(a + b, maximum(1.0, a + b)),
    "sum": lambda a, b: a + b,
}

RELATIONS: Final[Mapping[str, Callable[[float, float], bool]]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    ">=": lambda a, b: a >= b,
    ">": lambda a, b: a > b,
}
