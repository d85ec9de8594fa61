"""A fuzzy system of simpful as a system of ours; pyFUME's models are such systems.

The library itself is not imported: what is read are the objects that it made. Their
meaning is that of simpful 2.12: a Sugeno system divides the sum of `degree number
weight` by the sum of the degrees, and a Mamdani system takes the centroid of its curve
at 1,000 values from end to end. Both answer 0 where no rule fires.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

from fuzzytree.errors import LossError
from fuzzytree.formats.formulas import parse
from fuzzytree.formats.yaml.conditions import blocks_of, joined
from fuzzytree.model import (
    And,
    Conclusion,
    Condition,
    Curve,
    Defuzzifier,
    Formula,
    FuzzySystem,
    Gaussian,
    Linear,
    Not,
    Or,
    Points,
    Proposition,
    Sigmoid,
    Singleton,
    SNorm,
    SystemOutput,
    SystemRule,
    Term,
    TNorm,
    Trapezoid,
    TwoGaussians,
    Variable,
)

_SAMPLES = 1000  # simpful's `subdivisions`, unless the caller of inference() gives some
_AND: Final[Mapping[str, TNorm]] = {"AND": "minimum", "AND_p": "product"}
_OR: Final[Mapping[str, SNorm]] = {"OR": "maximum", "OR_p": "algebraic sum"}


def from_simpful(system: object, *, name: str = "simpful system") -> FuzzySystem:
    """Return a `FuzzySystem` of simpful as a system that answers like `inference()`.

    Args:
        system: A Mamdani system, or a Sugeno system whose functions are linear.
        name: The system's name.

    Raises:
        TypeError: If it is no system of simpful.
        LossError: If it holds what a system of ours cannot.
        InvalidModelError: If its parts contradict each other.

    Example:
        >>> from simpful import AutoTriangle, FuzzySystem as Simpful
        >>> washer = Simpful(show_banner=False)
        >>> washer.add_linguistic_variable("dirt", AutoTriangle(2, ["low", "high"]))
        >>> washer.set_crisp_output_value("long", 60.0)
         * Detected Sugeno model type
        >>> washer.add_rules(["IF (dirt IS high) THEN (time IS long)"])
        >>> from_simpful(washer).inputs
        ('dirt',)
    """
    if not _is_of_simpful(system, "FuzzySystem"):
        raise TypeError(
            "from_simpful reads a FuzzySystem of simpful, and not a value of type "
            f"{type(system).__name__}"
        )
    source: Any = system
    if source._detected_type not in (None, "Sugeno"):
        raise _refusal(f"its type is {source._detected_type}")
    if source._constants:
        raise _refusal(f"{source._constants[0]!r} is set to a constant")
    is_sugeno = source._detected_type == "Sugeno"
    ends = [_End.of(k, then) for k, (_, then) in enumerate(source._rules, 1)]
    outputs = dict.fromkeys(end.output for end in ends)
    functions = {end.term: _function(end.term, source) for end in ends if is_sugeno}
    columns = dict.fromkeys(one for one in source._lvs if one not in outputs)
    columns |= dict.fromkeys(
        one for weights, _ in functions.values() for one in weights
    )
    rules = []
    for number, (end, (when, _)) in enumerate(zip(ends, source._rules, strict=True), 1):
        operators: dict[str, str] = {}
        condition = _condition(when, source, operators, f"rule {number}")
        then = Conclusion(end.output, end.label if is_sugeno else end.term)
        rule = SystemRule(condition, (then,), 1.0 if is_sugeno else end.weight)
        conjunction = _AND[operators.get("AND", "AND")]
        rules.append((rule, conjunction, _OR[operators.get("OR", "OR")]))
    part = [
        _sugeno(one, ends, functions, [*columns])
        if is_sugeno
        else _mamdani(one, source)
        for one in outputs
    ]
    inputs = tuple(_input(column, source) for column in columns)
    blocks = blocks_of(rules, None if is_sugeno else "minimum")
    return FuzzySystem(name, inputs, tuple(part), blocks)


class _End(NamedTuple):
    """What a rule concludes, and its weight."""

    output: str
    term: str
    weight: float

    @staticmethod
    def of(number: int, then: tuple[str, ...]) -> _End:
        if len(then) not in (2, 3):
            raise _refusal(f"rule {number} does not conclude one term of one output")
        return _End(then[0], then[1], float(then[2]) if len(then) == 3 else 1.0)

    @property
    def label(self) -> str:
        """The name of the weighted number."""
        return self.term if self.weight == 1.0 else f"{self.term} times {self.weight}"


def _condition(
    part: Any, source: Any, operators: dict[str, str], where: str
) -> Condition:
    """Return the condition of a rule, and note which AND and which OR it uses."""
    if _is_of_simpful(part, "Clause"):
        if part._variable not in source._lvs:
            raise _refusal(f"{where} uses {part._variable!r}, which is no variable")
        return Proposition(part._variable, (part._term,))
    if not _is_of_simpful(part, "Functional"):
        raise _refusal(f"{where} has an empty condition")
    sign = part._fun
    kind = sign.partition("_")[0]
    if sign not in (*_AND, *_OR, "NOT") or (sign == "NOT") != (part._A == ""):
        raise _refusal(f"{where} uses the operator {sign!r}")
    if operators.setdefault(kind, sign) != sign:
        raise _refusal(f"{where} uses both {operators[kind]} and {sign}")
    right = _condition(part._B, source, operators, where)
    if kind == "NOT":
        return Not(right)
    left = _condition(part._A, source, operators, where)
    return joined(And if kind == "AND" else Or, left, right)


def _input(column: str, source: Any) -> Variable:
    variable = source._lvs.get(column)
    if variable is None:  # used by functions alone
        return Variable(column)
    low, high = _range(variable) or (None, None)
    return Variable(column, _labels(column, variable), low=low, high=high)


def _mamdani(output: str, source: Any) -> SystemOutput:
    variable = source._lvs.get(output)
    if variable is None:
        raise _refusal(f"a rule concludes {output!r}, which is no variable")
    part = _range(variable)
    if part is None:
        raise _refusal(f"the output {output!r} has no universe of discourse")
    return SystemOutput(
        output,
        _labels(output, variable),
        *part,
        Defuzzifier("centroid", _SAMPLES, "ends"),
        aggregation="maximum",
        default=0.0,
    )


def _sugeno(
    output: str,
    ends: list[_End],
    functions: Mapping[str, tuple[Mapping[str, float], float]],
    columns: list[str],
) -> SystemOutput:
    labels: dict[str, Term] = {}
    for end in ends:
        if end.output == output:
            weights, offset = functions[end.term]
            results = [weights.get(column, 0.0) * end.weight for column in columns]
            number = offset * end.weight
            curve = Linear(tuple(results), number) if weights else Singleton(number)
            labels[end.label] = Term(end.label, curve)
    how = Defuzzifier("weighted average")
    return SystemOutput(output, (*labels.values(),), None, None, how, default=0.0)


def _function(term: str, source: Any) -> tuple[Mapping[str, float], float]:
    """Return the weights and the offset of a Sugeno rule's number."""
    if term in source._crispvalues:
        return {}, float(source._crispvalues[term])
    text = source._outputfunctions.get(term)
    if not isinstance(text, str):
        raise _refusal(f"a rule concludes {term!r}, which has no number")
    try:
        return _linear(ast.parse(text.strip(), mode="eval").body)
    except (SyntaxError, ValueError, RecursionError, ZeroDivisionError) as error:
        raise _refusal(
            f"the function {text!r} of {term!r} is no weighted sum of inputs"
        ) from error


def _linear(node: ast.expr) -> tuple[dict[str, float], float]:
    """Return a formula's weights and offset; raise ValueError if it has none."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return {}, float(value)
        case ast.Name(id=column):
            return {column: 1.0}, 0.0
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return _scaled(_linear(operand), -1.0)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as sign, right=right):
            weights, offset = _linear(left)
            scale = -1.0 if isinstance(sign, ast.Sub) else 1.0
            others, other = _scaled(_linear(right), scale)
            for column, weight in others.items():
                weights[column] = weights.get(column, 0.0) + weight
            return weights, offset + other
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as sign, right=right):
            one, two = _linear(left), _linear(right)
            if two[0] and not one[0] and isinstance(sign, ast.Mult):
                one, two = two, one
            if not two[0]:
                scale = two[1] if isinstance(sign, ast.Mult) else 1.0 / two[1]
                return _scaled(one, scale)
        case _:
            pass
    raise ValueError("not linear")


def _scaled(
    linear: tuple[dict[str, float], float], scale: float
) -> tuple[dict[str, float], float]:
    weights, offset = linear
    return {column: scale * one for column, one in weights.items()}, scale * offset


def _range(variable: Any) -> tuple[float, float] | None:
    """Return the ends of a variable's universe, None if nothing says them."""
    ends = variable._universe_of_discourse
    if ends is None:
        if any(one._type != "pointbased" for one in variable._FSlist):
            return None
        ends = variable.get_universe_of_discourse()
    return float(ends[0]), float(ends[1])


def _labels(name: str, variable: Any) -> tuple[Term, ...]:
    return tuple(
        Term(one._term, _curve(one, f"term {one._term!r} of {name!r}"))
        for one in variable._FSlist
    )


def _curve(part: Any, where: str) -> Curve:
    """Return the curve of a fuzzy set."""
    if part._type == "pointbased":
        return _points(part)
    function = part._funpointer
    build = _CURVES.get(type(function).__name__)
    if build is None or not _is_of_simpful(function, type(function).__name__):
        raise _refusal(f"{where} is a {type(function).__name__}")
    return build(function)


def _points(part: Any) -> Points:
    """Return points, and beyond the first and the last one what simpful answers."""
    (xs, degrees), ends = part._points.T.tolist(), part.boundary_values
    if ends[0] != degrees[0]:
        xs, degrees = [math.nextafter(xs[0], -math.inf), *xs], [ends[0], *degrees]
    if ends[1] != degrees[-1]:
        xs, degrees = [*xs, xs[-1]], [*degrees, ends[1]]
    return Points(tuple(map(float, xs)), tuple(map(float, degrees)))


def _trapezoid(a: float, b: float, c: float, d: float) -> Trapezoid:
    """Return a trapezoid; an upright side of simpful's is a shoulder."""
    left = None if a == b else float(a)
    return Trapezoid(left, float(b), float(c), None if c == d else float(d))


_CURVES: Final[Mapping[str, Callable[[Any], Curve]]] = {
    "Triangular_MF": lambda one: _trapezoid(one._a, one._b, one._b, one._c),
    "Trapezoidal_MF": lambda one: _trapezoid(one._a, one._b, one._c, one._d),
    "Crisp_MF": lambda one: Trapezoid(
        *map(float, (one._left, one._left, one._right, one._right))
    ),
    "Sigmoid_MF": lambda one: Sigmoid(float(one._c), float(one._a)),
    "InvSigmoid_MF": lambda one: Sigmoid(float(one._c), -float(one._a)),
    "Gaussian_MF": lambda one: Gaussian(float(one._mu), float(one._sigma)),
    "InvGaussian_MF": lambda one: Formula(
        parse(f"1 - exp(-((x - {one._mu!r}) / {one._sigma!r})^2 / 2)")
    ),
    "DoubleGaussian_MF": lambda one: TwoGaussians(
        *map(float, (one._mu1, one._sigma1, one._mu2, one._sigma2))
    ),
}
"""What each membership function of simpful becomes."""


def _is_of_simpful(part: object, name: str) -> bool:
    kind = type(part)
    return kind.__module__.startswith("simpful.") and kind.__name__ == name


def _refusal(reason: str) -> LossError:
    return LossError(f"cannot read a FuzzySystem of simpful: {reason}")
