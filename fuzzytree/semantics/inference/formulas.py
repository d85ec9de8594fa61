"""Formulas as numbers: each operation in plain floats, and none of them fails.

Where an operation has no value the answer is what IEEE 754 and the C library say: NaN,
or an infinity. `exp(1000)` is infinite, `1 / 0` too, `log(-1)` and `0 / 0` are NaN.
Truth is 1 and untruth 0; what is not 0 is true, NaN too, and NaN equals NaN. `round`
takes a half to the even neighbour, `%` has the sign of its second number and `fmod`
that of its first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

from fuzzytree.model import Call, Expression, Name, Number


def value_of(expression: Expression, names: Mapping[str, float]) -> float:
    """Return the value of a formula.

    Raises:
        KeyError: If a name has no value, or no function takes so many arguments.

    Example:
        >>> twice = Call("*", (Number(2.0), Name("dirt")))
        >>> value_of(Call("+", (twice, Number(1.0))), {"dirt": 0.25})
        1.5
    """
    match expression:
        case Number(value=value):
            return float(value)
        case Name(name=name):
            return names[name]
        case Call(function=function, arguments=(one,)):
            return UNARY[function](value_of(one, names))
        case Call(function=function, arguments=(one, other)):
            return BINARY[function](value_of(one, names), value_of(other, names))
        case Call(function=function):
            raise KeyError(function)


def quotient(a: float, b: float) -> float:
    """Return a / b; by 0 it is infinite, or NaN for 0 / 0 and NaN / 0.

    Example:
        >>> quotient(-1.0, 0.0), quotient(0.0, 0.0)
        (-inf, nan)
    """
    if b != 0.0:
        return a / b
    if a == 0.0 or a != a:
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1.0, b)


def minimum(a: float, b: float) -> float:
    """Return the smaller one; NaN if either is NaN."""
    return a if a < b or a != a else b


def maximum(a: float, b: float) -> float:
    """Return the larger one; NaN if either is NaN."""
    return a if a > b or a != a else b


def exponential(a: float) -> float:
    """Return e to the power of a; too large a power is infinite."""
    try:
        return math.exp(a)
    except OverflowError:
        return math.inf


def square_root(a: float) -> float:
    """Return the square root; NaN below 0."""
    return math.sqrt(a) if a >= 0.0 else math.nan


def logarithm(a: float) -> float:
    """Return the natural logarithm; minus infinity at 0, NaN below."""
    return _or_pole(math.log, a, 0.0)


def power(a: float, b: float) -> float:
    """Return a to the power of b, as C's `pow` says.

    Example:
        >>> power(0.0, -1.0), power(-8.0, 0.5), power(-10.0, 309.0)
        (inf, nan, -inf)
    """
    is_odd = math.isfinite(b) and math.fmod(b, 2.0) in (1.0, -1.0)
    try:
        return math.pow(a, b)
    except OverflowError:
        return -math.inf if a < 0.0 and is_odd else math.inf
    except ValueError:
        if a != 0.0:
            return math.nan
        return math.copysign(math.inf, a) if is_odd else math.inf


def _or_pole(function: Callable[[float], float], a: float, pole: float) -> float:
    """Return a logarithm, which is minus infinite at its pole and NaN below."""
    if a == pole:
        return -math.inf
    return function(a) if a > pole else math.nan


def _or_nan(function: Callable[[float], float]) -> Callable[[float], float]:
    """Return a function that is NaN where Python's has no value."""

    def result(a: float) -> float:
        try:
            return function(a)
        except ValueError:
            return math.nan

    return result


def _rounded(function: Callable[[float], int]) -> Callable[[float], float]:
    """Return a function to whole numbers, with the sign of 0 kept."""

    def result(a: float) -> float:
        return math.copysign(float(function(a)), a) if math.isfinite(a) else a

    return result


def _fmod(a: float, b: float) -> float:
    try:
        return math.fmod(a, b)
    except ValueError:
        return math.nan


def _modulo(a: float, b: float) -> float:
    """Return what is left of a, with the sign of b."""
    return a % b if math.isfinite(a) and b != 0.0 else math.nan


def _hyperbolic_sine(a: float) -> float:
    try:
        return math.sinh(a)
    except OverflowError:
        return math.copysign(math.inf, a)


def _hyperbolic_cosine(a: float) -> float:
    try:
        return math.cosh(a)
    except OverflowError:
        return math.inf


def _area_tangent(a: float) -> float:
    if abs(a) == 1.0:
        return math.copysign(math.inf, a)
    return math.atanh(a) if abs(a) < 1.0 else math.nan


def _same(a: float, b: float) -> bool:
    """Return whether two numbers are equal; NaN equals NaN."""
    return a == b or (a != a and b != b)


UNARY: Final[Mapping[str, Callable[[float], float]]] = {
    "negate": lambda a: -a,
    "not": lambda a: float(a == 0.0),
    "abs": abs,
    "sqrt": square_root,
    "exp": exponential,
    "log": logarithm,
    "log10": lambda a: _or_pole(math.log10, a, 0.0),
    "log1p": lambda a: _or_pole(math.log1p, a, -1.0),
    "sin": _or_nan(math.sin),
    "cos": _or_nan(math.cos),
    "tan": _or_nan(math.tan),
    "asin": _or_nan(math.asin),
    "acos": _or_nan(math.acos),
    "atan": math.atan,
    "sinh": _hyperbolic_sine,
    "cosh": _hyperbolic_cosine,
    "tanh": math.tanh,
    "asinh": math.asinh,
    "acosh": _or_nan(math.acosh),
    "atanh": _area_tangent,
    "floor": _rounded(math.floor),
    "ceil": _rounded(math.ceil),
    "round": _rounded(round),
}

BINARY: Final[Mapping[str, Callable[[float, float], float]]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": quotient,
    "%": _modulo,
    "^": power,
    "and": lambda a, b: float(a != 0.0 and b != 0.0),
    "or": lambda a, b: float(a != 0.0 or b != 0.0),
    "lt": lambda a, b: float(a < b),
    "le": lambda a, b: float(a <= b or _same(a, b)),
    "gt": lambda a, b: float(a > b),
    "ge": lambda a, b: float(a >= b or _same(a, b)),
    "eq": lambda a, b: float(_same(a, b)),
    "neq": lambda a, b: float(not _same(a, b)),
    "min": minimum,
    "max": maximum,
    "atan2": math.atan2,
    "fmod": _fmod,
}
