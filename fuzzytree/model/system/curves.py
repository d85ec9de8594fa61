"""The curves of a fuzzy system's terms as frozen values, and formulas among them.

What they *mean* is computed in `fuzzytree.semantics.inference`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Final

from fuzzytree.model.rulebase import (
    LR,
    Band,
    Points,
    Value,
    name_choice,
    shape_mistakes,
)

MOST_LEVELS = 100
"""The deepest nesting of conditions and formulas."""


class Trapezoid(Value, frozen=True, tag="trapezoid"):
    """Rises from `a` to `b`, is 1 on the closed plateau `b <= x <= c`, falls to `d`.

    A triangle has `b == c`, a rectangle `a == b` and `c == d`. Below `b` the degree is
    `(x - a) / (b - a)`, above `c` it is `(d - x) / (d - c)`; 0 outside `[a, d]`.

    Attributes:
        a: Where it leaves 0; None makes it 1 up to `c`.
        b: Where it reaches 1; at least `a`.
        c: Where it leaves 1; at least `b`.
        d: Where it reaches 0; at least `c`; None makes it 1 from `b` on.
    """

    a: float | None
    b: float
    c: float
    d: float | None


class Gaussian(Value, frozen=True, tag="gaussian"):
    """`exp(-(x - mean)^2 / (2 deviation^2))`."""

    mean: float
    deviation: float


class TwoGaussians(Value, frozen=True, tag="two gaussians"):
    """The product of a gaussian below `left` and another one above `right`, else 1.

    Fuzzylite calls it GaussianProduct, MATLAB gauss2mf. The factors are 1 for
    `x >= left` and for `x <= right`.
    """

    left: float
    left_deviation: float
    right: float
    right_deviation: float


class Bell(Value, frozen=True, tag="bell"):
    """`1 / (1 + |(x - center) / width|^(2 slope))`."""

    center: float
    width: float
    slope: float


class Sigmoid(Value, frozen=True, tag="sigmoid"):
    """`1 / (1 + exp(-slope (x - inflection)))`."""

    inflection: float
    slope: float


class SigmoidDifference(Value, frozen=True, tag="sigmoid difference"):
    """The absolute difference of two sigmoids."""

    first: Sigmoid
    second: Sigmoid


class SigmoidProduct(Value, frozen=True, tag="sigmoid product"):
    """The product of two sigmoids."""

    first: Sigmoid
    second: Sigmoid


class SCurve(Value, frozen=True, tag="s"):
    """Two parabolas that rise from 0 at `start` to 1 at `end`; with end < start, falls.

    With `t = (x - start) / (end - start)`: `2 t^2` up to t = 1/2, then
    `1 - 2 (1 - t)^2`; 0 and 1 beyond. MATLAB's smf, and zmf where `end < start`.
    """

    start: float
    end: float


class PiCurve(Value, frozen=True, tag="pi"):
    """An S curve from `a` to `b`, 1 up to `c`, then one that falls to `d`."""

    a: float
    b: float
    c: float
    d: float


class Cosine(Value, frozen=True, tag="cosine"):
    """`(1 + cos(2 pi / width (x - center))) / 2` within half a width, else 0."""

    center: float
    width: float


class Concave(Value, frozen=True, tag="concave"):
    """`(end - inflection) / (2 end - inflection - x)` before `end`, 1 from it on.

    Where `inflection > end` it falls: `(inflection - end) / (inflection - 2 end + x)`
    behind `end`, 1 up to it.
    """

    inflection: float
    end: float


class Spike(Value, frozen=True, tag="spike"):
    """`exp(-|10 / width (x - center)|)`."""

    center: float
    width: float


class Arc(Value, frozen=True, tag="arc"):
    """A quarter of an ellipse that rises from 0 at `start` to 1 at `end`, then 1.

    With `end < start` it falls: 1 up to `end`, 0 from `start` on.
    """

    start: float
    end: float


class SemiEllipse(Value, frozen=True, tag="semi ellipse"):
    """The upper half of an ellipse from `start` to `end`, 0 outside."""

    start: float
    end: float


class Binary(Value, frozen=True, tag="binary"):
    """1 on one side of `start`, `start` included, and 0 on the other."""

    start: float
    is_above: bool = True


class Singleton(Value, frozen=True, tag="singleton"):
    """1 at one value, 0 elsewhere; as a conclusion, the number itself."""

    value: float


class Linear(Value, frozen=True, tag="linear"):
    """A conclusion that is a weighted sum of the inputs, in order, plus an offset.

    Summed from left to right, the offset last. As many weights as the system has
    inputs.
    """

    weights: tuple[float, ...]
    offset: float = 0.0


class Number(Value, frozen=True, tag="number"):
    """A number of a formula."""

    value: float


class Name(Value, frozen=True, tag="name"):
    """A variable of a formula: an input, an output before this one, or `x` itself.

    `x` is the value whose degree is computed; in a weighted conclusion it is the
    conclusion's degree. A term of an input may name inputs only.
    """

    name: str


class Call(Value, frozen=True, tag="call"):
    """An operation or a function of a formula, such as `+`, `^`, `sqrt` or `max`.

    `FUNCTIONS` lists them, and `fuzzytree.semantics.programs.formulas` says what they
    do.
    """

    function: str
    arguments: tuple[Expression, ...]


Expression = Number | Name | Call

_OF_TWO: tuple[str, ...] = (
    *("+", "-", "*", "/", "%", "^", "and", "or", "lt", "le", "gt", "ge", "eq", "neq"),
    *("min", "max", "atan2", "fmod"),
)
_OF_ONE: tuple[str, ...] = (
    *("negate", "not", "abs", "sqrt", "exp", "log", "log10", "log1p", "floor", "ceil"),
    *("round", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"),
    *("asinh", "acosh", "atanh"),
)
FUNCTIONS: Final[Mapping[str, int]] = MappingProxyType(
    {**dict.fromkeys(_OF_TWO, 2), **dict.fromkeys(_OF_ONE, 1)}
)
"""How many arguments each function of a formula takes."""


class Formula(Value, frozen=True, tag="formula"):
    """An arithmetic expression; `x` is the value whose degree is computed."""

    expression: Expression


SystemCurve = (
    Trapezoid
    | Gaussian
    | TwoGaussians
    | Bell
    | Sigmoid
    | SigmoidDifference
    | SigmoidProduct
    | SCurve
    | PiCurve
    | Cosine
    | Concave
    | Spike
    | Arc
    | SemiEllipse
    | Binary
    | Singleton
    | Linear
    | Formula
)
"""The membership functions that rule bases do not have."""
Curve = Band | LR | Points | SystemCurve


def names_in(expression: Expression) -> Iterator[str]:
    """Yield the names that a formula uses, from left to right."""
    match expression:
        case Name(name=name):
            yield name
        case Call(arguments=arguments):
            for argument in arguments:
                yield from names_in(argument)
        case Number():
            return


def curve_mistakes(curve: Curve) -> Iterator[str]:
    """Yield what is wrong with a curve, without saying whose it is."""
    match curve:
        case Band() | LR() | Points():
            yield from shape_mistakes(curve)
        case Trapezoid(a=a, b=b, c=c, d=d):
            corners = [corner for corner in (a, b, c, d) if corner is not None]
            shown = ", ".join(map(repr, corners))
            if not all(map(math.isfinite, corners)) or corners != sorted(corners):
                yield f"the corners must be finite and rise: {shown}"
            elif not math.isfinite(corners[-1] - corners[0]):
                yield f"the corners are too far apart: {shown}"
        case (
            SigmoidDifference(first=first, second=second)
            | SigmoidProduct(first=first, second=second)
        ):
            yield from curve_mistakes(first)
            yield from curve_mistakes(second)
        case Linear(weights=weights, offset=offset):
            if not all(map(math.isfinite, (*weights, offset))):
                yield "the weights and the offset must be finite"
        case Formula(expression=expression):
            if _depth(expression) > MOST_LEVELS:
                yield f"the formula is nested deeper than {MOST_LEVELS} levels"
            else:
                yield from _formula_mistakes(expression)
        case _:
            yield from _number_mistakes(curve)


def _formula_mistakes(expression: Expression) -> Iterator[str]:
    match expression:
        case Number(value=value) if not math.isfinite(value):
            yield f"the numbers of a formula must be finite, not {value!r}"
        case Call(function=function, arguments=arguments):
            needed = FUNCTIONS.get(function)
            if needed is None:
                yield f"no function {function!r}; {name_choice(function, FUNCTIONS)}"
            elif len(arguments) != needed:
                yield f"{function!r} takes {needed} arguments, not {len(arguments)}"
            for argument in arguments:
                yield from _formula_mistakes(argument)
        case _:
            return


_ABOVE_ZERO = {"deviation", "left_deviation", "right_deviation", "width"}


def _number_mistakes(curve: Curve) -> Iterator[str]:
    for field in curve.__struct_fields__:
        value: float = getattr(curve, field)
        name = field.replace("_", " ")
        if not math.isfinite(value):
            yield f"the {name} must be finite, not {value!r}"
        elif field in _ABOVE_ZERO and value <= 0.0:
            yield f"the {name} must be above 0, not {value!r}"
    match curve:
        case PiCurve(a=a, b=b, c=c, d=d):
            if not a <= b <= c <= d:
                yield f"the corners must rise: {a!r}, {b!r}, {c!r}, {d!r}"
            yield from width_mistakes(a, d)
        case SCurve(start=start, end=end) | Concave(inflection=start, end=end):
            yield from width_mistakes(start, end)
        case Arc(start=start, end=end):
            if start == end:
                yield f"an arc must start and end at different values, not at {end!r}"
            yield from width_mistakes(start, end)
        case SemiEllipse(start=start, end=end):
            if start >= end:
                yield f"the end must lie above the start {start!r}, not at {end!r}"
            yield from width_mistakes(start, end)
        case _:
            return


def width_mistakes(start: float, end: float) -> Iterator[str]:
    """Yield that two numbers are too far apart for their difference, if they are."""
    if math.isfinite(start) and math.isfinite(end) and not math.isfinite(end - start):
        yield f"{start!r} and {end!r} are too far apart"


def _depth(expression: Expression) -> int:
    deepest, todo = 0, [(expression, 1)]
    while todo:
        one, level = todo.pop()
        deepest = max(deepest, level)
        if isinstance(one, Call) and level <= MOST_LEVELS:
            todo += [(argument, level + 1) for argument in one.arguments]
    return deepest
