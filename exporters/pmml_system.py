"""Fuzzy systems as PMML: their program, a derived field for each of its steps.

What has no number (NaN) is a missing value in the file. PMML's own functions differ in
what they make of one, so each operation is a function of the file that says it: a
comparison with a missing value does not hold, arithmetic with one gives one, and so
does what has no result, such as 0 / 0 or the root of a negative number.

A step that has many samples becomes a field for each of them.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping, Sequence

from fuzzytree.errors import LossError
from fuzzytree.exporters.pmml_elements import (
    NUMBER,
    TRUTH,
    apply,
    bisection,
    constant,
    definition,
    joined,
    ref,
)
from fuzzytree.exporters.xml_text import XmlElement, element
from fuzzytree.model import FuzzySystem, unlike
from fuzzytree.semantics import (
    INEXACT,
    LOGICAL,
    NUMERIC,
    OPERATIONS,
    Program,
    Step,
    from_system,
    unrolled,
)

MOST_FIELDS = 20_000
"""The most derived fields of a file: engines look each other's values up one by one."""

_MISSING = XmlElement("Constant", {"dataType": "double", "missing": "true"})
_A, _B = ref("a"), ref("b")
_PLAIN: Mapping[str, str] = {
    "add": "+",
    "subtract": "-",
    "multiply": "*",
    "absolute": "abs",
    "floor": "floor",
    "ceiling": "ceil",
    "round": "rint",
    "exponential": "exp",
    "arc_tangent": "atan",
    "hyperbolic_sine": "sinh",
    "hyperbolic_cosine": "cosh",
    "hyperbolic_tangent": "tanh",
    "minimum": "min",
    "maximum": "max",
}
_ZERO, _ONE = constant(0.0), constant(1.0)
_ENDLESS = apply("greaterThan", apply("abs", _A), constant(sys.float_info.max))
_PARTIAL: Mapping[str, tuple[XmlElement, XmlElement]] = {
    # The result, and where there is none.
    "divide": (
        apply("/", _A, _B),
        apply("and", apply("equal", _A, _ZERO), apply("equal", _B, _ZERO)),
    ),
    "square_root": (apply("sqrt", _A), apply("lessThan", _A, _ZERO)),
    "logarithm": (apply("ln", _A), apply("lessThan", _A, _ZERO)),
    "logarithm_10": (apply("log10", _A), apply("lessThan", _A, _ZERO)),
    "logarithm_1p": (apply("ln1p", _A), apply("lessThan", _A, constant(-1.0))),
    "sine": (apply("sin", _A), _ENDLESS),
    "cosine": (apply("cos", _A), _ENDLESS),
    "tangent": (apply("tan", _A), _ENDLESS),
    "arc_sine": (apply("asin", _A), apply("greaterThan", apply("abs", _A), _ONE)),
    "arc_cosine": (apply("acos", _A), apply("greaterThan", apply("abs", _A), _ONE)),
    "power": (
        apply("pow", _A, _B),
        apply(
            "and",
            apply("lessThan", _A, _ZERO),
            apply("notEqual", _B, apply("floor", _B)),
        ),
    ),
}
_COMPARED: Mapping[str, str] = {
    "less": "lessThan",
    "at_most": "lessOrEqual",
    "equal": "equal",
}
_LOGIC: Mapping[str, str] = {"and": "and", "or": "or", "not": "not"}

Value = XmlElement | float | bool  # an expression, or what it is


class SystemFields:
    """The functions and fields of a system.

    Attributes:
        functions: The definition of each operation that is used, by name.
        fields: A derived field for each value that is computed, in order.
        outputs: The field of each output of the system.
        is_inexact: Whether an operation's last digits are the engine's own.
    """

    def __init__(self, system: FuzzySystem, taken: set[str]) -> None:
        samples = from_system(system)
        if samples.size > MOST_FIELDS:
            raise LossError(
                f"cannot write {system.name} as pmml: it would need {samples.size:,} "
                f"fields, and engines handle no more than {MOST_FIELDS:,} well"
            )
        program = unrolled(samples)
        _refuse_unknown(system.name, program)
        self.is_inexact = any(step.operation in INEXACT for step in program.steps)
        self.functions: dict[str, XmlElement] = {}
        self.fields: list[XmlElement] = []
        self._prefix = _prefix(taken)
        values: list[Value] = []
        for place, step in enumerate(program.steps):
            operands = [values[argument] for argument in step.arguments]
            values.append(self._value(f"{place}", step, operands))
        self.outputs = [_expression(values[place]) for place in program.of("output")]

    def _value(self, name: str, step: Step, operands: list[Value]) -> Value:
        match step.operation:
            case "constant":
                return step.number
            case "input":
                return ref(step.name)
            case "below" | "pick":
                return self._field(name, _table(step, operands[0]), "number")
            case operation:
                return self._one(name, operation, operands)

    def _one(self, name: str, operation: str, operands: list[Value]) -> Value:
        """Return an operation on some values, as a field unless it is known now."""
        if not any(isinstance(one, XmlElement) for one in operands):
            known = NUMERIC.get(operation) or LOGICAL[operation]
            return known(*operands)
        kind = OPERATIONS[operation].gives
        if operation == "where":
            condition, *others = operands
            if not isinstance(condition, XmlElement):
                return others[0] if condition else others[1]
            expression = apply("if", condition, *map(_expression, others))
        else:
            self._define(operation)
            expression = apply(_own(operation), *map(_expression, operands))
        return self._field(name, expression, kind)

    def _field(self, name: str, expression: XmlElement, kind: str) -> XmlElement:
        full = f"{self._prefix}{name}"
        how = TRUTH if kind == "truth" else NUMBER
        self.fields.append(element("DerivedField", expression, name=full, **how))
        return ref(full)

    def _define(self, operation: str) -> None:
        """Define an operation, for numbers that may be missing."""
        if operation in self.functions:
            return
        known = OPERATIONS[operation]
        kinds = {"number": NUMBER, "truth": TRUTH}
        takes = dict(zip("abc", (kinds[one] for one in known.takes), strict=False))
        self.functions[operation] = definition(
            _own(operation), takes, _body(operation, takes), kinds[known.gives]
        )


def step_value(
    program: Program, place: int, known: Mapping[int, XmlElement]
) -> XmlElement:
    """Return a step of a program whose numbers all have a value, as an expression.

    Args:
        program: The program.
        place: Of the step.
        known: The fields of steps that have one.
    """
    step = program.steps[place]
    operands = [
        known.get(one) or step_value(program, one, known) for one in step.arguments
    ]
    match step.operation:
        case "constant":
            return constant(step.number)
        case "input":
            return ref(step.name)
        case "below" | "pick":
            return _table(step, operands[0])
        case "negate":
            return apply("-", _ZERO, *operands)
        case "where":
            return apply("if", *operands)
        case "divide":
            return apply("/", *operands)
        case operation:
            return apply({**_PLAIN, **_COMPARED, **_LOGIC}[operation], *operands)


def _refuse_unknown(name: str, program: Program) -> None:
    known = {*_PLAIN, *_PARTIAL, *_COMPARED, *_LOGIC, "negate", "is_finite", "where"}
    known |= {"constant", "input", "below", "pick"}
    unknown = sorted({step.operation for step in program.steps} - known)
    if unknown:
        words = ", ".join(one.replace("_", " ") for one in unknown)
        raise LossError(f"cannot write {name} as pmml, which has no {words}")


def _own(operation: str) -> str:
    """Return what an operation is called in a file: unlike any of PMML's own."""
    return f"number {operation.replace('_', ' ')}"


def _prefix(taken: set[str]) -> str:
    """Return how the names of fields start: as no other name does."""
    result = "step"
    while any(name.startswith(f"{result} ") for name in taken):
        result = unlike(result, {result, *taken})
    return f"{result} "


def _body(operation: str, names: Iterable[str]) -> XmlElement:
    operands = [ref(name) for name in names]
    if operation in _LOGIC:
        return apply(_LOGIC[operation], *operands)
    is_missing = [apply("isMissing", one) for one in operands]
    nothing = joined("or", is_missing)
    if operation in _COMPARED:
        return apply(
            "if", nothing, _truth(False), apply(_COMPARED[operation], *operands)
        )
    if operation == "is_finite":
        largest = constant(sys.float_info.max)
        is_small = apply("lessOrEqual", apply("abs", _A), largest)
        return apply("if", nothing, _truth(False), is_small)
    if operation in _PARTIAL:
        result, none = _PARTIAL[operation]
        return apply("if", nothing, _MISSING, apply("if", none, _MISSING, result))
    if operation == "negate":
        return apply("if", nothing, _MISSING, apply("-", _ZERO, _A))
    return apply("if", nothing, _MISSING, apply(_PLAIN[operation], *operands))


def _truth(value: bool) -> XmlElement:
    return XmlElement("Constant", {"dataType": "boolean"}, (), str(value).lower())


def _expression(value: Value) -> XmlElement:
    """Return a value as an expression; an infinity as what overflows to it."""
    match value:
        case XmlElement():
            return value
        case bool():
            return _truth(value)
        case float() if math.isnan(value):
            return _MISSING
        case float() if math.isinf(value):
            largest = math.copysign(sys.float_info.max, value)
            return apply("*", constant(largest), constant(2.0))
        case _:
            return constant(value)


def _table(step: Step, value: Value) -> XmlElement:
    """Return a number that is looked up by halving."""
    table, x = step.table, _expression(value)
    if step.operation == "pick":
        numbers: Sequence[float] = table
        whole = bisection(
            x, len(table) - 1, lambda k: k + 0.5, lambda k: constant(table[k])
        )
    else:
        numbers = (0.0,)
        whole = bisection(
            x, len(table), table.__getitem__, lambda k: constant(float(k))
        )
    return apply("if", apply("isMissing", x), constant(numbers[0]), whole)
