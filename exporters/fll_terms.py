"""Terms for FLL: curves as a class of fuzzylite and its numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from fuzzytree.formats.formulas import fuzzylite_text_of, parse
from fuzzytree.model.rulebase import LR, Band, Points
from fuzzytree.model.system import (
    Arc,
    Bell,
    Binary,
    Call,
    Concave,
    Cosine,
    Curve,
    Expression,
    Formula,
    Gaussian,
    Label,
    Linear,
    Name,
    Number,
    PiCurve,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    Spike,
    SystemOutput,
    Trapezoid,
    TwoGaussians,
)
from fuzzytree.semantics.inference import value_at

KNOWN: tuple[type, ...] = (
    *(Trapezoid, Gaussian, TwoGaussians, Bell, Sigmoid, SigmoidDifference),
    *(SigmoidProduct, SCurve, PiCurve, Cosine, Concave, Spike, Arc, SemiEllipse),
    *(Binary, Singleton, Formula, Linear),
)
"""The curves that FLL has, beside points."""


def degree_text(label: Label, names: Mapping[str, str]) -> str | None:
    """Return the class and numbers of a label whose degrees count.

    Args:
        label: The label.
        names: The names of variables in the file, for formulas.

    Returns:
        None if FLL has no such term.
    """
    match label.curve:
        case Formula(expression=expression):
            if label.height != 1.0:
                expression = Call("*", (Number(label.height), expression))
            return f"Function {fuzzylite_text_of(_renamed(expression, names))}"
        case Linear() | Band() | LR():
            return None
        case Points():
            parts = _points(label.curve)
        case curve:
            parts = _parts(curve)
    if label.height != 1.0:
        parts = (*parts, label.height)
    kind, *numbers = parts
    return " ".join([str(kind), *(_number(float(one)) for one in numbers)])


def weighted_type(output: SystemOutput) -> str:
    """Return how a weighted output takes its terms: all of them in one way.

    `Tsukamoto` where it asks each of them where it has a degree, else `TakagiSugeno`.
    """
    curves = [label.curve for label in output.labels]
    is_inverse = [value_at(one, 0.5) is not None for one in curves]
    return "Tsukamoto" if is_inverse and all(is_inverse) else "TakagiSugeno"


def number_text(label: Label, kind: str, names: Mapping[str, str]) -> str | None:
    """Return the class and numbers of a label of a weighted output.

    Args:
        label: The label.
        kind: The type of the output.
        names: The names of variables in the file, for formulas.

    Returns:
        None if FLL has no such term.
    """
    match label.curve:
        case Singleton(value=value):
            return f"Constant {_number(value)}"
        case Linear(weights=weights, offset=offset):
            return " ".join(["Linear", *map(_number, (*weights, offset))])
        case Formula(expression=expression):
            return f"Function {fuzzylite_text_of(_renamed(expression, names))}"
        case curve if kind == "TakagiSugeno" and value_at(curve, 0.5) is not None:
            return f"Function {fuzzylite_text_of(_inverse(label))}"
        case _:
            return degree_text(label, names)


def _number(value: float) -> str:
    return repr(float(value))


def _parts(curve: Curve) -> tuple[str | float, ...]:
    match curve:
        case Trapezoid(a=a, b=b, c=c, d=d):
            low = -math.inf if a is None else a
            high = math.inf if d is None else d
            if low == b and c == high:
                return "Rectangle", b, c
            return (
                ("Triangle", low, b, high) if b == c else ("Trapezoid", low, b, c, high)
            )
        case Gaussian(mean=mean, deviation=deviation):
            return "Gaussian", mean, deviation
        case TwoGaussians(left=a, left_deviation=s, right=b, right_deviation=t):
            return "GaussianProduct", a, s, b, t
        case Bell(center=center, width=width, slope=slope):
            return "Bell", center, width, slope
        case Sigmoid(inflection=inflection, slope=slope):
            return "Sigmoid", inflection, slope
        case SigmoidDifference(first=one, second=two):
            return (
                "SigmoidDifference",
                one.inflection,
                one.slope,
                two.slope,
                two.inflection,
            )
        case SigmoidProduct(first=one, second=two):
            return (
                "SigmoidProduct",
                one.inflection,
                one.slope,
                two.slope,
                two.inflection,
            )
        case SCurve(start=start, end=end):
            rises = start <= end
            return ("SShape", start, end) if rises else ("ZShape", end, start)
        case PiCurve(a=a, b=b, c=c, d=d):
            return "PiShape", a, b, c, d
        case Cosine(center=center, width=width):
            return "Cosine", center, width
        case Concave(inflection=inflection, end=end):
            return "Concave", inflection, end
        case Spike(center=center, width=width):
            return "Spike", center, width
        case Arc(start=start, end=end):
            return "Arc", start, end
        case SemiEllipse(start=start, end=end):
            return "SemiEllipse", start, end
        case Binary(start=start, is_above=is_above):
            return "Binary", start, math.inf if is_above else -math.inf
        case Singleton(value=value):
            return "Rectangle", value, value
        case _:
            raise TypeError(f"no class of FLL for {type(curve).__name__}")


def _points(points: Points) -> tuple[str | float, ...]:
    pairs = list(_pairs(points))
    values, degrees = zip(*pairs, strict=True)
    if degrees == (0.0, 1.0):
        return "Ramp", *values
    if degrees == (1.0, 0.0):
        return "Ramp", *reversed(values)
    return "Discrete", *(number for pair in pairs for number in pair)


def _pairs(points: Points) -> Iterator[tuple[float, float]]:
    """Yield values and degrees; the second point of a step stands one double higher.

    So fuzzylite 6 and pyfuzzylite, which take the degrees at the step itself from
    different sides, and the formula of points agree at every double.
    """
    last: tuple[float, float] | None = None
    pairs = [*zip(points.values, points.degrees, strict=True)]
    for place, (value, degree) in enumerate(pairs):
        if last is not None and value == last[0]:
            value = math.nextafter(value, math.inf)
            is_hidden = place + 1 < len(pairs) and pairs[place + 1][0] == value
            if degree == last[1] or is_hidden or math.isinf(value):
                continue
        last = (pairs[place][0], degree)
        yield value, degree


def _renamed(expression: Expression, names: Mapping[str, str]) -> Expression:
    match expression:
        case Name(name=name):
            return Name(names.get(name, name))
        case Call(function=function, arguments=arguments):
            return Call(function, tuple(_renamed(one, names) for one in arguments))
        case Number():
            return expression


def _inverse(label: Label) -> Expression:
    """Return where a monotone label has the degree `x`, as a formula."""
    d = "x" if label.height == 1.0 else f"(x / {label.height!r})"
    match label.curve:
        case Points(values=(first, last), degrees=(low, _)):
            start, end = (first, last) if low == 0.0 else (last, first)
            return parse(f"{start!r} + {end - start!r} * {d}")
        case Sigmoid(inflection=inflection, slope=slope):
            return parse(f"{inflection!r} - log(1 / {d} - 1) / {slope!r}")
        case SCurve(start=start, end=end):
            low_part = f"{start!r} + {end - start!r} * sqrt(0.5 * {d})"
            high_part = f"{end!r} - {end - start!r} * sqrt(0.5 * (1 - {d}))"
            return parse(f"le({d}, 0.5) * ({low_part}) + gt({d}, 0.5) * ({high_part})")
        case Concave(inflection=inflection, end=end):
            return parse(f"{end!r} - {end - inflection!r} * (1 / {d} - 1)")
        case Arc(start=start, end=end):
            root = f"sqrt((1 - {d}) * (1 + {d}))"
            return parse(f"{end!r} - {end - start!r} * {root}")
        case curve:
            raise TypeError(f"{type(curve).__name__} is not monotone")
