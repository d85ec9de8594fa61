"""Formulas: what each of their functions is, in operations of programs.

Truth is 1 and untruth 0; what is not 0 is true, NaN too, and NaN equals NaN. `round`
takes a half to the even neighbour, `%` has the sign of its second number and `fmod`
that of its first.
"""

from __future__ import annotations

from collections.abc import Mapping

from fuzzytree.model import Call, Expression, Name, Number
from fuzzytree.semantics.programs.operations import N, Numbers

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


def value_of(make: Numbers[N], expression: Expression, names: Mapping[str, N]) -> N:
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
                return as_number(make, make("equal", *operands, zero))
            one, other = operands
            if function == "%":
                return _modulo(make, one, other)
            return as_number(make, _truth(make, function, one, other))


def is_nan(make: Numbers[N], a: N) -> N:
    """Return whether a number is NaN."""
    return make("not", make("equal", a, a))


def as_number(make: Numbers[N], truth: N) -> N:
    """Return 1 for a truth and 0 for an untruth."""
    return make("where", truth, make.constant(1.0), make.constant(0.0))


def _is_true(make: Numbers[N], a: N) -> N:
    return make("not", make("equal", a, make.constant(0.0)))


def _is_same(make: Numbers[N], a: N, b: N) -> N:
    both = make("and", is_nan(make, a), is_nan(make, b))
    return make("or", make("equal", a, b), both)


def _truth(make: Numbers[N], function: str, a: N, b: N) -> N:
    """Return whether a relation of two numbers is true."""
    match function:
        case "and" | "or":
            return make(function, _is_true(make, a), _is_true(make, b))
        case "lt":
            return make("less", a, b)
        case "gt":
            return make("less", b, a)
        case "le":
            return make("or", make("at_most", a, b), _is_same(make, a, b))
        case "ge":
            return _truth(make, "le", b, a)
        case "eq":
            return _is_same(make, a, b)
        case "neq":
            return make("not", _is_same(make, a, b))
        case _:
            raise KeyError(function)


def _modulo(make: Numbers[N], a: N, b: N) -> N:
    """Return what is left of a, with the sign of b."""
    zero = make.constant(0.0)
    rest = make("remainder", a, b)
    is_below, divides_below = make("less", rest, zero), make("less", b, zero)
    is_above, divides_above = make("less", zero, rest), make("less", zero, b)
    one = make("and", is_below, divides_above)
    two = make("and", is_above, divides_below)
    return make("where", make("or", one, two), make("add", rest, b), rest)
