"""The operations that programs consist of, and what each does to one number.

The functions here are the meaning: IEEE double, each rounded once where the operation
is one of arithmetic. Where Python would raise, they answer as C does: division by zero
and overflow give infinities, the square root of a negative number gives NaN. Functions
beyond `square_root` are those of the C library; elsewhere they may differ by a few
units in the last place, which is what `INEXACT` is for.
"""

from __future__ import annotations

import math
import operator
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, Literal

import msgspec

from fuzzytree.model import Numbers

Kind = Literal["number", "truth"]


class Operation(msgspec.Struct, frozen=True):
    """What an operation takes and gives."""

    takes: tuple[Kind, ...]
    gives: Kind
    says: str
    is_inexact: bool = False


def _numbers(count: int, says: str, gives: Kind = "number") -> Operation:
    kind: Kind = "number"
    return Operation((kind,) * count, gives, says)


def _inexact(count: int, says: str) -> Operation:
    return msgspec.structs.replace(_numbers(count, says), is_inexact=True)


def _truths(count: int, says: str) -> Operation:
    kind: Kind = "truth"
    return Operation((kind,) * count, kind, says)


OPERATIONS: Mapping[str, Operation] = {
    "constant": _numbers(0, "the step's number"),
    "input": _numbers(0, "the value of the input of the step's name"),
    "index": _numbers(0, "0, 1, 2, ... for the samples, in order"),
    "add": _numbers(2, "a + b"),
    "subtract": _numbers(2, "a - b"),
    "multiply": _numbers(2, "a b"),
    "divide": _numbers(2, "a / b"),
    "minimum": _numbers(2, "the smaller of a and b; NaN if either is"),
    "maximum": _numbers(2, "the larger of a and b; NaN if either is"),
    "negate": _numbers(1, "-a"),
    "absolute": _numbers(1, "|a|"),
    "floor": _numbers(1, "the largest whole number up to a"),
    "ceiling": _numbers(1, "the smallest whole number from a on"),
    "round": _numbers(1, "the nearest whole number, of two equally near ones the even"),
    "square_root": _numbers(1, "the square root of a"),
    "exponential": _inexact(1, "e to the power a"),
    "logarithm": _inexact(1, "the natural logarithm of a"),
    "logarithm_10": _inexact(1, "the logarithm of a to base 10"),
    "logarithm_1p": _inexact(1, "the natural logarithm of 1 + a"),
    "sine": _inexact(1, "sin a"),
    "cosine": _inexact(1, "cos a"),
    "tangent": _inexact(1, "tan a"),
    "arc_sine": _inexact(1, "asin a"),
    "arc_cosine": _inexact(1, "acos a"),
    "arc_tangent": _inexact(1, "atan a"),
    "hyperbolic_sine": _inexact(1, "sinh a"),
    "hyperbolic_cosine": _inexact(1, "cosh a"),
    "hyperbolic_tangent": _inexact(1, "tanh a"),
    "area_sine": _inexact(1, "asinh a"),
    "area_cosine": _inexact(1, "acosh a"),
    "area_tangent": _inexact(1, "atanh a"),
    "power": _inexact(2, "a to the power b"),
    "remainder": _numbers(2, "a - b trunc(a / b), exact; of the sign of a"),
    "arc_tangent_2": _inexact(2, "the angle of the point (b, a)"),
    "below": _numbers(1, "how many numbers of the step's rising table are below a"),
    "pick": _numbers(1, "the number of the step's table at place a, from 0"),
    "less": _numbers(2, "a < b", "truth"),
    "at_most": _numbers(2, "a <= b", "truth"),
    "equal": _numbers(2, "a = b", "truth"),
    "is_finite": _numbers(1, "a is neither infinite nor NaN", "truth"),
    "and": _truths(2, "both a and b"),
    "or": _truths(2, "a or b or both"),
    "not": _truths(1, "not a"),
    "where": Operation(("truth", "number", "number"), "number", "b if a, else c"),
    "total": _numbers(1, "the sum over the samples, by halves"),
    "running": _numbers(1, "the sum of the samples up to each, in order"),
    "last": _numbers(1, "the last of the samples"),
    "highest": _numbers(1, "the largest of the samples; NaN if any is"),
    "lowest": _numbers(1, "the smallest of the samples; NaN if any is"),
}
"""Every operation by name. `total` pads the samples with zeros up to a power of two
and adds the second half to the first until one number is left."""

OVER_SAMPLES = frozenset(("total", "last", "highest", "lowest"))
"""Operations that make one number of all samples."""

INEXACT = frozenset(name for name, one in OPERATIONS.items() if one.is_inexact)
"""Operations whose last digits are the library's own; all others have one result."""


def divide(a: float, b: float) -> float:
    """Return a / b as IEEE 754 has it, also for b = 0.

    Example:
        >>> divide(1.0, -0.0), divide(0.0, 0.0)
        (-inf, nan)
    """
    if b:
        return a / b
    if not a or math.isnan(a) or math.isnan(b):
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1.0, b)


def power(a: float, b: float) -> float:
    """Return a to the power b as C has it."""
    try:
        return math.pow(a, b)
    except OverflowError:
        is_negative = a < 0.0 and math.fmod(b, 2.0) != 0.0
        return -math.inf if is_negative else math.inf
    except ValueError:  # 0 to a negative power, or a root of a negative number
        if a != 0.0:
            return math.nan
        is_negative = math.copysign(1.0, a) < 0.0 and abs(math.fmod(b, 2.0)) == 1.0
        return -math.inf if is_negative else math.inf


def minimum(a: float, b: float) -> float:
    """Return the smaller of two numbers; NaN if either is."""
    return a if a < b or a != a else b


def maximum(a: float, b: float) -> float:
    """Return the larger of two numbers; NaN if either is."""
    return a if a > b or a != a else b


def picked(table: tuple[float, ...], place: float) -> float:
    """Return the number of a table at a place, its first one if there is none."""
    inside = 0.0 <= place < len(table)
    return table[int(place) if inside else 0]


def _whole(function: Callable[[float], int]) -> Callable[[float], float]:
    """Return a function to whole numbers that keeps the sign of 0."""

    def whole(a: float) -> float:
        return math.copysign(float(function(a)), a) if math.isfinite(a) else a

    return whole


def _quiet(function: Callable[[float], float]) -> Callable[[float], float]:
    """Return a function that answers NaN outside its domain and inf on overflow."""

    def quiet(a: float) -> float:
        try:
            return function(a)
        except ValueError:
            return math.nan
        except OverflowError:
            return math.copysign(math.inf, a) if function is math.sinh else math.inf

    return quiet


def _logarithm(function: Callable[[float], float], pole: float) -> Callable[..., float]:
    quiet = _quiet(function)

    def logarithm(a: float) -> float:
        return -math.inf if a == pole else quiet(a)

    return logarithm


def _area_tangent(a: float) -> float:
    return math.copysign(math.inf, a) if abs(a) == 1.0 else _ATANH(a)


_ATANH = _quiet(math.atanh)


def _remainder(a: float, b: float) -> float:
    try:
        return math.fmod(a, b)
    except ValueError:
        return math.nan


def _where(a: bool, b: float, c: float) -> float:
    return b if a else c


NUMERIC: Mapping[str, Callable[..., float]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": divide,
    "minimum": minimum,
    "maximum": maximum,
    "negate": operator.neg,
    "absolute": abs,
    "floor": _whole(math.floor),
    "ceiling": _whole(math.ceil),
    "round": _whole(round),
    "square_root": _quiet(math.sqrt),
    "exponential": _quiet(math.exp),
    "logarithm": _logarithm(math.log, 0.0),
    "logarithm_10": _logarithm(math.log10, 0.0),
    "logarithm_1p": _logarithm(math.log1p, -1.0),
    "sine": _quiet(math.sin),
    "cosine": _quiet(math.cos),
    "tangent": _quiet(math.tan),
    "arc_sine": _quiet(math.asin),
    "arc_cosine": _quiet(math.acos),
    "arc_tangent": math.atan,
    "hyperbolic_sine": _quiet(math.sinh),
    "hyperbolic_cosine": _quiet(math.cosh),
    "hyperbolic_tangent": math.tanh,
    "area_sine": math.asinh,
    "area_cosine": _quiet(math.acosh),
    "area_tangent": _area_tangent,
    "power": power,
    "remainder": _remainder,
    "arc_tangent_2": math.atan2,
    "where": _where,
}
"""What each operation makes of numbers."""

LOGICAL: Mapping[str, Callable[..., bool]] = {
    "less": operator.lt,
    "at_most": operator.le,
    "equal": operator.eq,
    "is_finite": math.isfinite,
    "and": operator.and_,
    "or": operator.or_,
    "not": operator.not_,
}
"""What each operation that gives a truth makes of its arguments."""


NOTHING: Final[Mapping[str, Any]] = MappingProxyType({})
"""The values of no variable."""


class Doubles(Numbers[float]):
    """Computes each operation at once; truths are 0 and 1.

    Attributes:
        names: The values of variables, for formulas.
    """

    def __init__(self, names: Mapping[str, float] = NOTHING) -> None:
        self.names = names

    def constant(self, number: float, /) -> float:
        """Return the number."""
        return number

    def __call__(self, operation: str, /, *operands: float) -> float:
        """Return what an operation of `OPERATIONS` makes of numbers or truths."""
        return _MEANINGS[operation](*operands)

    def table(self, operation: str, place: float, table: Sequence[float], /) -> float:
        """Return what `below` or `pick` finds in a table for a number."""
        return of_table(operation, tuple(table), place)


_MEANINGS: Mapping[str, Callable[..., float]] = {**NUMERIC, **LOGICAL}
DOUBLES: Final = Doubles()


def of_table(operation: str, table: tuple[float, ...], a: float) -> float:
    """Return what `below` or `pick` makes of a number."""
    if operation == "below":
        return float(bisect_left(table, a))
    return picked(table, a)


def total(samples: list[float]) -> float:
    """Return the sum by halves (see `OPERATIONS`).

    Example:
        >>> total([1.0, 2.0, 4.0])
        7.0
    """
    size = 1 << max(len(samples) - 1, 0).bit_length()
    padded = samples + [0.0] * (size - len(samples))
    while size > 1:
        size //= 2
        padded = [padded[i] + padded[i + size] for i in range(size)]
    return padded[0]
