"""The membership functions that rule bases do not have, and formulas among them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, Final

from fuzzytree.model.algebra import N, Numbers, as_number, square
from fuzzytree.model.functions import (
    MembershipFunction,
    Shape,
    around,
    scaled,
    smaller_slope,
)
from fuzzytree.model.mistakes import name_choice
from fuzzytree.model.values import Value

MOST_LEVELS = 100
"""The deepest nesting of conditions and formulas."""


class Trapezoid(MembershipFunction, frozen=True, tag="trapezoid"):
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

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the smaller slope; an upright side is cut off last."""
        a, b, c, d = self.a, self.b, self.c, self.d
        slopes: list[N] = []
        if a is not None and a < b:
            slopes.append(scaled(n, x, a, b))
        if d is not None and c < d:
            slopes.append((d - x) / (n.constant(d) - c))
        degree = n.constant(1.0)
        if slopes:
            is_peak = len(slopes) == 2 and b == c
            degree = smaller_slope(n, slopes, is_peak=is_peak)
        if a is not None and a == b:
            degree = n.where(n.less(x, a), 0.0, degree)
        if d is not None and c == d:
            degree = n.where(n.less(d, x), 0.0, degree)
        return degree

    def knots(self) -> tuple[float, ...]:
        """Return the corners."""
        corners = (self.a, self.b, self.c, self.d)
        return tuple(corner for corner in corners if corner is not None)

    @property
    def is_open(self) -> bool:
        """Whether a side is left open."""
        return self.a is None or self.d is None

    def mistakes(self) -> Iterator[str]:
        """Yield that the corners do not rise."""
        corners = list(self.knots())
        shown = ", ".join(map(repr, corners))
        if not all(map(math.isfinite, corners)) or corners != sorted(corners):
            yield f"the corners must be finite and rise: {shown}"
        elif not math.isfinite(corners[-1] - corners[0]):
            yield f"the corners are too far apart: {shown}"


class Gaussian(MembershipFunction, frozen=True, tag="gaussian"):
    """`exp(-(x - mean)^2 / (2 deviation^2))`."""

    mean: float
    deviation: float

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return `exp(-t^2 / 2)`, t in deviations from the mean."""
        return _bell_curve(n, x, self.mean, self.deviation)

    def knots(self) -> tuple[float, ...]:
        """Return the mean, and where it bends the other way."""
        low, high = self.mean - self.deviation, self.mean + self.deviation
        return (*around(low, high), self.mean, *around(high, low))

    @property
    def extent(self) -> tuple[float, float]:
        """Three deviations on either side."""
        return self.mean - 3 * self.deviation, self.mean + 3 * self.deviation


class TwoGaussians(MembershipFunction, frozen=True, tag="two gaussians"):
    """The product of a gaussian below `left` and another one above `right`, else 1.

    Fuzzylite calls it GaussianProduct, MATLAB gauss2mf. The factors are 1 for
    `x >= left` and for `x <= right`.
    """

    left: float
    left_deviation: float
    right: float
    right_deviation: float

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the product of both, each of a value clamped to its own side."""
        below = n.minimum(x, self.left)
        above = n.maximum(x, self.right)
        return _bell_curve(n, below, self.left, self.left_deviation) * _bell_curve(
            n, above, self.right, self.right_deviation
        )

    def knots(self) -> tuple[float, ...]:
        """Return the two means, and what lies between them where both fall."""
        below, above = self.left_deviation, self.right_deviation
        knots = {self.left, self.right}
        if self.left <= self.right:
            knots |= {*around(self.left - below), *around(self.right + above)}
            return tuple(sorted(knots))
        knots |= {x for x in around(self.left - below) if x < self.right}
        knots |= {x for x in around(self.right + above) if x > self.left}
        # Between them it is a gaussian of their precisions' sum.
        ratio = below / above
        mean = self.right + (self.left - self.right) / (1.0 + ratio * ratio)
        spread = below * (above / math.hypot(below, above))
        inner = (
            near for x in (mean - spread, mean, mean + spread) for near in around(x)
        )
        return tuple(
            sorted({*knots, *(x for x in inner if self.right < x < self.left)})
        )

    @property
    def extent(self) -> tuple[float, float]:
        """Three deviations outside of both."""
        low = self.left - 3 * self.left_deviation
        return low, self.right + 3 * self.right_deviation


class Bell(MembershipFunction, frozen=True, tag="bell"):
    """`1 / (1 + |(x - center) / width|^(2 slope))`."""

    center: float
    width: float
    slope: float

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the degree; at the center it is 1, for a slope below 0 it is 0."""
        size = n.absolute((x - self.center) / self.width)
        return 1.0 / (1.0 + n.power(size, 2.0 * self.slope))

    def knots(self) -> tuple[float, ...]:
        """Return the center, and where it bends the other way."""
        power = 2.0 * abs(self.slope)
        if power <= 1.0:
            return (self.center,)
        reach = self.width * math.pow((power - 1.0) / (power + 1.0), 1.0 / power)
        low, high = self.center - reach, self.center + reach
        return (*around(low, high), self.center, *around(high, low))

    @property
    def extent(self) -> tuple[float, float]:
        """Three widths on either side."""
        return self.center - 3 * self.width, self.center + 3 * self.width

    @property
    def is_unit(self) -> bool:
        """Whether the slope is not 0."""
        return self.slope != 0.0


class _Open(MembershipFunction, frozen=True):
    """A function that stays above 0 without end."""

    @property
    def is_open(self) -> bool:
        """Always."""
        return True


class _Rise(_Open, frozen=True):
    """A function that rises from 0 at `start` to 1 at `end`, or falls."""

    start: float
    end: float

    @property
    def is_unit(self) -> bool:
        """Whether its width is finite."""
        return math.isfinite(self.end - self.start)

    def mistakes(self) -> Iterator[str]:
        """Yield what is wrong with its ends."""
        yield from super().mistakes()
        yield from width_mistakes(self.start, self.end)


class Sigmoid(_Open, frozen=True, tag="sigmoid"):
    """`1 / (1 + exp(-slope (x - inflection)))`."""

    inflection: float
    slope: float

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the logistic function."""
        return 1.0 / (1.0 + n.exponential(-self.slope * (x - self.inflection)))

    def inverse(self, n: Numbers[N], degree: N) -> N:
        """Return where it has a degree; an infinity for 0 and 1."""
        steep = n.divide(n("logarithm", _odds(n, degree)), self.slope)
        return self.inflection - steep

    def knots(self) -> tuple[float, ...]:
        """Return where it bends the other way."""
        return (self.inflection,)

    @property
    def extent(self) -> tuple[float, float]:
        """Where it is near 0 and near 1."""
        reach = _STEEP / abs(self.slope) if self.slope else 0.0
        return self.inflection - reach, self.inflection + reach

    @property
    def is_unit(self) -> bool:
        """Whether the slope is not 0."""
        return self.slope != 0.0


class _TwoSigmoids(MembershipFunction, frozen=True):
    """What is made of two sigmoids."""

    first: Sigmoid
    second: Sigmoid

    @property
    def extent(self) -> tuple[float, float]:
        """That of both together."""
        (a, b), (c, d) = self.first.extent, self.second.extent
        return min(a, c), max(b, d)

    @property
    def is_bent_once(self) -> bool:
        """Not surely."""
        return False

    @property
    def is_unit(self) -> bool:
        """Whether no slope is 0."""
        return self.first.is_unit and self.second.is_unit

    def mistakes(self) -> Iterator[str]:
        """Yield what is wrong with either."""
        yield from self.first.mistakes()
        yield from self.second.mistakes()


class SigmoidDifference(_TwoSigmoids, frozen=True, tag="sigmoid difference"):
    """The absolute difference of two sigmoids."""

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return how far the two are apart."""
        return n.absolute(self.first.degree(n, x) - self.second.degree(n, x))

    def knots(self) -> tuple[float, ...]:
        """Return where either bends the other way, and where they are equal."""
        inner = {self.first.inflection, self.second.inflection}
        one, two = self.first, self.second
        if one.slope != two.slope:
            rise = one.slope * one.inflection - two.slope * two.inflection
            place = rise / (one.slope - two.slope)
            sizes = (one.slope * one.inflection, two.slope * two.inflection)
            off = math.ulp(max(map(abs, sizes))) / abs(one.slope - two.slope)
            if math.isfinite(place) and math.isfinite(off):
                inner |= {place - 8.0 * off, place + 8.0 * off, *around(place)}
        return tuple(sorted(inner))


class SigmoidProduct(_TwoSigmoids, frozen=True, tag="sigmoid product"):
    """The product of two sigmoids."""

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return one times the other."""
        return self.first.degree(n, x) * self.second.degree(n, x)

    def knots(self) -> tuple[float, ...]:
        """Return where either bends the other way."""
        return tuple(sorted({self.first.inflection, self.second.inflection}))


class SCurve(_Rise, frozen=True, tag="s"):
    """Two parabolas that rise from 0 at `start` to 1 at `end`; with end < start, falls.

    With `t = (x - start) / (end - start)`: `2 t^2` up to t = 1/2, then
    `1 - 2 (1 - t)^2`; 0 and 1 beyond. MATLAB's smf, and zmf where `end < start`.
    """

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the first parabola up to the middle, then the second one."""
        return _s(n, x, self.start, self.end)

    def inverse(self, n: Numbers[N], degree: N) -> N:
        """Return where it has a degree."""
        width = n.constant(self.end) - self.start
        low = self.start + width * n.root(0.5 * degree)
        high = self.end - width * n.root(0.5 * (1.0 - degree))
        return n.where(n.at_most(degree, 0.5), low, high)

    def knots(self) -> tuple[float, ...]:
        """Return the ends and the middle."""
        return _s_knots(self.start, self.end)


class PiCurve(MembershipFunction, frozen=True, tag="pi"):
    """An S curve from `a` to `b`, 1 up to `c`, then one that falls to `d`."""

    a: float
    b: float
    c: float
    d: float

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the rising S times the falling one."""
        falling = n.where(n.at_most(self.d, x), 0.0, _s(n, x, self.d, self.c))
        falling = n.where(n.at_most(x, self.c), 1.0, falling)
        return _s(n, x, self.a, self.b) * falling

    def knots(self) -> tuple[float, ...]:
        """Return the corners and the middles of both sides."""
        rising = _s_knots(self.a, self.b)
        return tuple(sorted({*rising, *_s_knots(self.c, self.d)}))

    @property
    def is_unit(self) -> bool:
        """Whether the widths of its sides are finite."""
        return math.isfinite(self.b - self.a) and math.isfinite(self.d - self.c)

    def mistakes(self) -> Iterator[str]:
        """Yield that the corners do not rise."""
        yield from super().mistakes()
        if not self.a <= self.b <= self.c <= self.d:
            corners = self.a, self.b, self.c, self.d
            yield f"the corners must rise: {', '.join(map(repr, corners))}"
        yield from width_mistakes(self.a, self.d)


class Cosine(MembershipFunction, frozen=True, tag="cosine"):
    """`(1 + cos(2 pi / width (x - center))) / 2` within half a width, else 0."""

    center: float
    width: float

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the wave within half a width."""
        t = (x - self.center) / self.width
        wave = n("cosine", math.tau * t)
        return n.where(n.at_most(n.absolute(t), 0.5), 0.5 * (1.0 + wave), 0.0)

    def knots(self) -> tuple[float, ...]:
        """Return the ends, the center, and where it bends the other way."""
        low, high = self.center - self.width / 2.0, self.center + self.width / 2.0
        knots = {self.center, *around(low, high), *around(high, low)}
        for share in (-0.25, 0.25):
            knots |= {*around(self.center + share * self.width, low, high)}
        return tuple(sorted(knots))


class Concave(_Open, frozen=True, tag="concave"):
    """`(end - inflection) / (2 end - inflection - x)` before `end`, 1 from it on.

    Where `inflection > end` it falls: `(inflection - end) / (inflection - 2 end + x)`
    behind `end`, 1 up to it.
    """

    inflection: float
    end: float

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the width's share of itself and the distance to the end."""
        if self.inflection <= self.end:
            width, gap = n.constant(self.end) - self.inflection, self.end - x
            outside = n.less(x, self.end)
        else:
            width, gap = n.constant(self.inflection) - self.end, x - self.end
            outside = n.less(self.end, x)
        return n.where(outside, n.divide(width, width + gap), 1.0)

    def inverse(self, n: Numbers[N], degree: N) -> N:
        """Return where it has a degree."""
        return self.end - (n.constant(self.end) - self.inflection) * _odds(n, degree)

    def knots(self) -> tuple[float, ...]:
        """Return the end."""
        return (self.end,)

    @property
    def extent(self) -> tuple[float, float]:
        """Its two numbers."""
        return min(self.inflection, self.end), max(self.inflection, self.end)

    @property
    def is_unit(self) -> bool:
        """Whether twice its width is finite."""
        return math.isfinite(2.0 * (self.end - self.inflection))

    def mistakes(self) -> Iterator[str]:
        """Yield what is wrong with its ends."""
        yield from super().mistakes()
        yield from width_mistakes(self.inflection, self.end)


class Spike(MembershipFunction, frozen=True, tag="spike"):
    """`exp(-|10 / width (x - center)|)`."""

    center: float
    width: float

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return what falls by half in 1/14 of the width."""
        t = (x - self.center) / self.width
        return n.exponential(-n.absolute(10.0 * t))

    def knots(self) -> tuple[float, ...]:
        """Return the center."""
        return (self.center,)

    @property
    def extent(self) -> tuple[float, float]:
        """Half a width on either side."""
        return self.center - self.width / 2, self.center + self.width / 2


class Arc(_Rise, frozen=True, tag="arc"):
    """A quarter of an ellipse that rises from 0 at `start` to 1 at `end`, then 1.

    With `end < start` it falls: 1 up to `end`, 0 from `start` on.
    """

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the quarter of an ellipse, 0 before it and 1 behind it."""
        u = scaled(n, x, self.start, self.end)
        before, behind = _beyond(n, x, self.start, self.end)
        arc = n.where(behind, 1.0, n.root(u * (2.0 - u)))
        return n.where(before, 0.0, arc)

    def inverse(self, n: Numbers[N], degree: N) -> N:
        """Return where it has a degree."""
        root = n.root((1.0 - degree) * (1.0 + degree))
        return self.end - (n.constant(self.end) - self.start) * root

    def knots(self) -> tuple[float, ...]:
        """Return the ends."""
        return min(self.start, self.end), max(self.start, self.end)

    def mistakes(self) -> Iterator[str]:
        """Yield what is wrong with its ends."""
        yield from super().mistakes()
        if self.start == self.end:
            text = "an arc must start and end at different values"
            yield f"{text}, not at {self.end!r}"


class SemiEllipse(MembershipFunction, frozen=True, tag="semi ellipse"):
    """The upper half of an ellipse from `start` to `end`, 0 outside."""

    start: float
    end: float

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return twice the root of the product of the shares on both sides."""
        width = n.constant(self.end) - self.start
        degree = 2.0 * n.root(((x - self.start) / width) * ((self.end - x) / width))
        inside = n("and", n.at_most(self.start, x), n.at_most(x, self.end))
        return n.where(inside, degree, 0.0)

    def knots(self) -> tuple[float, ...]:
        """Return the ends and the middle."""
        middle = self.start + (self.end - self.start) / 2.0
        return (self.start, *around(middle, self.start, self.end), self.end)

    @property
    def is_unit(self) -> bool:
        """Never surely: a root may be rounded above 1."""
        return False

    def mistakes(self) -> Iterator[str]:
        """Yield what is wrong with its ends."""
        yield from super().mistakes()
        if self.start >= self.end:
            text = f"the end must lie above the start {self.start!r}"
            yield f"{text}, not at {self.end!r}"
        yield from width_mistakes(self.start, self.end)


class Binary(_Open, frozen=True, tag="binary"):
    """1 on one side of `start`, `start` included, and 0 on the other."""

    start: float
    is_above: bool = True

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return whether the value lies on that side."""
        one_side = (
            n.at_most(self.start, x) if self.is_above else n.at_most(x, self.start)
        )
        return as_number(n, one_side)

    def knots(self) -> tuple[float, ...]:
        """Return the start."""
        return (self.start,)


class Singleton(MembershipFunction, frozen=True, tag="singleton"):
    """1 at one value, 0 elsewhere; as a conclusion, the number itself."""

    value: float

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return whether it is the value."""
        return as_number(n, n.equal(x, self.value))

    def knots(self) -> tuple[float, ...]:
        """Return the value."""
        return (self.value,)


class Linear(MembershipFunction, frozen=True, tag="linear"):
    """A conclusion that is a weighted sum of the inputs, in order, plus an offset.

    Summed from left to right, the offset last. As many weights as the system has
    inputs.
    """

    weights: tuple[float, ...]
    offset: float = 0.0

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return NaN: it is a conclusion and has no degrees."""
        del x
        return n.constant(math.nan)

    @property
    def is_unit(self) -> bool:
        """Never."""
        return False

    def mistakes(self) -> Iterator[str]:
        """Yield that a number is not finite."""
        if not all(map(math.isfinite, (*self.weights, self.offset))):
            yield "the weights and the offset must be finite"


_STEEP = 5.0  # a sigmoid is within 0.7 % of its ends so many times 1 / slope away


def _bell_curve(n: Numbers[N], x: N, mean: float, deviation: float) -> N:
    return n.exponential(-0.5 * square((x - mean) / deviation))


def _odds(n: Numbers[N], degree: N) -> N:
    return n.divide(1.0, degree) - 1.0


def _beyond(n: Numbers[N], x: N, start: float, end: float) -> tuple[N, N]:
    """Return whether a value lies up to the start, and from the end on."""
    if start < end:
        return n.at_most(x, start), n.at_most(end, x)
    return n.at_most(start, x), n.at_most(x, end)


def _s(n: Numbers[N], x: N, start: float, end: float) -> N:
    if start == end:
        return n.where(n.at_most(x, start), 0.0, 1.0)
    t = scaled(n, x, start, end)
    rest = (x - end) / (n.constant(end) - start)
    before, behind = _beyond(n, x, start, end)
    degree = n.where(n.at_most(t, 0.5), 2.0 * square(t), 1.0 - 2.0 * square(rest))
    degree = n.where(behind, 1.0, degree)
    return n.where(before, 0.0, degree)


def _s_knots(start: float, end: float) -> tuple[float, ...]:
    if start == end:
        return (start,)
    low, high = min(start, end), max(start, end)
    return (low, *around(start + (end - start) / 2.0, low, high, high - low), high)


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

    `FUNCTIONS` lists them.
    """

    function: str
    arguments: tuple[Expression, ...]


Expression = Number | Name | Call


def _same(operation: str) -> _Meaning:
    def meaning(n: Numbers[N], *operands: N) -> N:
        return n(operation, *operands)

    return meaning


def _truth(test: _Test) -> _Meaning:
    def meaning(n: Numbers[N], *operands: N) -> N:
        truth: N = test(n, *operands)
        return as_number(n, truth)

    return meaning


def _both(n: Numbers[N], a: N, b: N) -> N:
    return n("and", n("not", _is_false(n, a)), n("not", _is_false(n, b)))


def _either(n: Numbers[N], a: N, b: N) -> N:
    return n("or", n("not", _is_false(n, a)), n("not", _is_false(n, b)))


def _is_false(n: Numbers[N], a: N) -> N:
    return n.equal(a, 0.0)


def _is_up_to(n: Numbers[N], a: N, b: N) -> N:
    return n("or", n.at_most(a, b), _is_same(n, a, b))


def _is_same(n: Numbers[N], a: N, b: N) -> N:
    return n("or", n.equal(a, b), n("and", is_nan(n, a), is_nan(n, b)))


def _modulo(n: Numbers[N], a: N, b: N) -> N:
    """Return what is left of a, with the sign of b."""
    rest = n("remainder", a, b)
    one = n("and", n.less(rest, 0.0), n.less(0.0, b))
    two = n("and", n.less(0.0, rest), n.less(b, 0.0))
    return n.where(n("or", one, two), rest + b, rest)


_Meaning = Callable[..., Any]
_Test = Callable[[Numbers[Any], Any], Any] | Callable[[Numbers[Any], Any, Any], Any]
_OPERATIONS: Final[Mapping[str, str]] = {
    **{"negate": "negate", "abs": "absolute", "sqrt": "square_root"},
    **{"exp": "exponential", "log": "logarithm", "log10": "logarithm_10"},
    **{"log1p": "logarithm_1p", "sin": "sine", "cos": "cosine", "tan": "tangent"},
    **{"asin": "arc_sine", "acos": "arc_cosine", "atan": "arc_tangent"},
    **{"sinh": "hyperbolic_sine", "cosh": "hyperbolic_cosine"},
    **{"tanh": "hyperbolic_tangent", "asinh": "area_sine", "acosh": "area_cosine"},
    **{"atanh": "area_tangent", "floor": "floor", "ceil": "ceiling", "round": "round"},
}
_CALLS: Final[Mapping[str, tuple[int, _Meaning]]] = MappingProxyType(
    {
        "+": (2, _same("add")),
        "-": (2, _same("subtract")),
        "*": (2, _same("multiply")),
        "/": (2, _same("divide")),
        "%": (2, _modulo),
        "^": (2, _same("power")),
        "and": (2, _truth(_both)),
        "or": (2, _truth(_either)),
        "lt": (2, _truth(lambda n, a, b: n.less(a, b))),
        "le": (2, _truth(_is_up_to)),
        "gt": (2, _truth(lambda n, a, b: n.less(b, a))),
        "ge": (2, _truth(lambda n, a, b: _is_up_to(n, b, a))),
        "eq": (2, _truth(_is_same)),
        "neq": (2, _truth(lambda n, a, b: n("not", _is_same(n, a, b)))),
        "min": (2, _same("minimum")),
        "max": (2, _same("maximum")),
        "atan2": (2, _same("arc_tangent_2")),
        "fmod": (2, _same("remainder")),
        "not": (1, _truth(_is_false)),
        **{name: (1, _same(operation)) for name, operation in _OPERATIONS.items()},
    }
)
"""How many arguments each function of a formula takes, and what it makes of them.

Truth is 1 and untruth 0; what is not 0 is true, NaN too, and NaN equals NaN. `round`
takes a half to the even neighbour, `%` has the sign of its second number and `fmod`
that of its first.
"""
FUNCTIONS: Final = MappingProxyType({name: one for name, (one, _) in _CALLS.items()})
"""How many arguments each function of a formula takes."""


def is_nan(n: Numbers[N], a: N) -> N:
    """Return whether a number is NaN."""
    return n("not", n.equal(a, a))


def value_of(n: Numbers[N], expression: Expression, names: Mapping[str, N]) -> N:
    """Return the value of a formula.

    Raises:
        KeyError: If a name has no value, or there is no such function.
    """
    match expression:
        case Number(value=value):
            return n.constant(value)
        case Name(name=name):
            return names[name]
        case Call(function=function, arguments=arguments):
            operands = [value_of(n, argument, names) for argument in arguments]
            result: N = _CALLS[function][1](n, *operands)
            return result


class Formula(MembershipFunction, frozen=True, tag="formula"):
    """An arithmetic expression; `x` is the value whose degree is computed."""

    expression: Expression

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the value of the formula."""
        return value_of(n, self.expression, {**n.names, "x": x})

    @property
    def is_unit(self) -> bool:
        """Never surely."""
        return False

    def mistakes(self) -> Iterator[str]:
        """Yield what is wrong with the formula."""
        if _depth(self.expression) > MOST_LEVELS:
            yield f"the formula is nested deeper than {MOST_LEVELS} levels"
        else:
            yield from _formula_mistakes(self.expression)


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
Curve = Shape | SystemCurve


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
