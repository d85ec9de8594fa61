"""Formulas as steps: the operations of `fuzzytree.semantics.inference.formulas`."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from fuzzytree.model import Call, Expression, Name, Number
from fuzzytree.semantics.programs.steps import Maker

_SAME: Mapping[str, str] = {
    "+": "add",
    "-": "subtract",
    "*": "multiply",
    "/": "divide",
    "^": "power",
    "negate": "negate",
    "min": "minimum",
    "max": "maximum",
    "abs": "absolute",
    "sqrt": "square_root",
    "exp": "exponential",
    "log": "logarithm",
    "log10": "logarithm_10",
    "log1p": "logarithm_1p",
    "sin": "sine",
    "cos": "cosine",
    "tan": "tangent",
    "asin": "arc_sine",
    "acos": "arc_cosine",
    "atan": "arc_tangent",
    "atan2": "arc_tangent_2",
    "sinh": "hyperbolic_sine",
    "cosh": "hyperbolic_cosine",
    "tanh": "hyperbolic_tangent",
    "asinh": "area_sine",
    "acosh": "area_cosine",
    "atanh": "area_tangent",
    "floor": "floor",
    "ceil": "ceiling",
    "round": "round",
    "fmod": "remainder",
}
"""Functions of formulas that are one operation each."""


def value_of(make: Maker, expression: Expression, names: Mapping[str, int]) -> int:
    """Return the value of a formula.

    Raises:
        KeyError: If a name has no value.
    """
    match expression:
        case Number(value=value):
            return make.constant(value)
        case Name(name=name):
            return names[name]
        case Call(function=function, arguments=arguments):
            operands = [value_of(make, argument, names) for argument in arguments]
            if function in _SAME:
                return make(_SAME[function], *operands)
            if function == "not":
                zero = make.constant(0.0)
                return as_number(make, make("equal", operands[0], zero))
            one, other = operands
            return _OTHERS[function](make, one, other)


def is_nan(make: Maker, a: int) -> int:
    """Return whether a number is NaN."""
    return make("not", make("equal", a, a))


def as_number(make: Maker, truth: int) -> int:
    """Return 1 for a truth and 0 for an untruth."""
    return make("where", truth, make.constant(1.0), make.constant(0.0))


def _is_true(make: Maker, a: int) -> int:
    return make("not", make("equal", a, make.constant(0.0)))


def _is_same(make: Maker, a: int, b: int) -> int:
    both = make("and", is_nan(make, a), is_nan(make, b))
    return make("or", make("equal", a, b), both)


def _le(make: Maker, a: int, b: int) -> int:
    holds = make("or", make("at_most", a, b), _is_same(make, a, b))
    return as_number(make, holds)


def _modulo(make: Maker, a: int, b: int) -> int:
    """Return what is left of a, with the sign of b."""
    zero = make.constant(0.0)
    rest = make("remainder", a, b)
    is_below, divides_below = make("less", rest, zero), make("less", b, zero)
    is_above, divides_above = make("less", zero, rest), make("less", zero, b)
    one = make("and", is_below, divides_above)
    two = make("and", is_above, divides_below)
    return make("where", make("or", one, two), make("add", rest, b), rest)


_OTHERS: Mapping[str, Callable[[Maker, int, int], int]] = {
    "%": _modulo,
    "and": lambda make, a, b: as_number(
        make, make("and", _is_true(make, a), _is_true(make, b))
    ),
    "or": lambda make, a, b: as_number(
        make, make("or", _is_true(make, a), _is_true(make, b))
    ),
    "lt": lambda make, a, b: as_number(make, make("less", a, b)),
    "le": _le,
    "gt": lambda make, a, b: as_number(make, make("less", b, a)),
    "ge": lambda make, a, b: _le(make, b, a),
    "eq": lambda make, a, b: as_number(make, _is_same(make, a, b)),
    "neq": lambda make, a, b: as_number(make, make("not", _is_same(make, a, b))),
}
"""Functions of two numbers that are several operations."""
