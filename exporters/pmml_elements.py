"""Elements of PMML, and degrees as its expressions.

Degrees use the operations of the reference in its
order; functions that several terms need are defined once in the file. So a degree has
the bits of the reference in every engine that computes in doubles.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence

from fuzzytree.exporters.xml_text import XmlElement, element
from fuzzytree.model import Points, Variable

NUMBER = {"optype": "continuous", "dataType": "double"}
TEXT = {"optype": "categorical", "dataType": "string"}
TRUTH = {"optype": "categorical", "dataType": "boolean"}
"""The attributes of a field's type."""


def constant(value: float) -> XmlElement:
    """Return a number of an expression."""
    return XmlElement("Constant", {"dataType": "double"}, (), repr(float(value)))


def ref(name: str) -> XmlElement:
    """Return the value of a field, or of a parameter of a function."""
    return XmlElement("FieldRef", {"field": name})


def apply(function: str, *arguments: XmlElement) -> XmlElement:
    """Return a function of some expressions."""
    return XmlElement("Apply", {"function": function}, arguments)


def derived(name: str, expression: XmlElement) -> XmlElement:
    """Return a field that is computed."""
    return element("DerivedField", expression, name=name, **NUMBER)


def definition(
    name: str,
    parameters: Mapping[str, Mapping[str, str]],
    body: XmlElement,
    gives: Mapping[str, str] = NUMBER,
) -> XmlElement:
    """Return the definition of a function, from its parameters and their types."""
    fields = [element("ParameterField", name=p, **t) for p, t in parameters.items()]
    return element("DefineFunction", *fields, body, name=name, **gives)


def schema(inputs: Iterable[Variable], target: str) -> XmlElement:
    """Return the fields that a model takes as they are, and the one it predicts.

    What stands for a missing value replaces an infinite one as well, which is invalid.
    """
    fields = [
        element("MiningField", name=one.name, invalidValueTreatment="asIs")
        if one.missing is None
        else element(
            "MiningField",
            name=one.name,
            missingValueReplacement=repr(float(one.missing)),
            invalidValueTreatment="asMissing",
        )
        for one in inputs
        if not one.parts
    ]
    target_field = element("MiningField", name=target, usageType="target")
    return element("MiningSchema", *fields, target_field)


def bisection(
    x: XmlElement,
    last: int,
    limit: Callable[[int], float],
    end: Callable[[int], XmlElement],
) -> XmlElement:
    """Return nested questions that find the first place up to whose limit x is.

    Args:
        x: The value.
        last: The last place, which has no limit; the first one is 0.
        limit: Gives the limit of a place.
        end: Gives the expression of a place.
    """

    def within(low: int, high: int) -> XmlElement:
        if low == high:
            return end(low)
        middle = (low + high) // 2
        is_low = _up_to(x, limit(middle))
        return apply("if", is_low, within(low, middle), within(middle + 1, high))

    return within(0, last)


def joined(function: str, parts: list[XmlElement]) -> XmlElement:
    """Return a function of as many expressions as there are; one stays itself."""
    return parts[0] if len(parts) == 1 else apply(function, *parts)


class Functions:
    """The functions that a file needs, in the order of their first use.

    Attributes:
        defined: Each function's definition, by name; what another one needs stands
            before it.
    """

    def __init__(self) -> None:
        self.defined: dict[str, XmlElement] = {}

    def finite(self, x: XmlElement) -> XmlElement:
        """Return 1 where a value is there and finite, and 0 elsewhere."""
        value, zero = ref("value"), constant(0.0)
        is_small = apply(
            "lessOrEqual", apply("abs", value), constant(sys.float_info.max)
        )
        known = apply("if", is_small, constant(1.0), zero)
        body = apply("if", apply("isMissing", value), zero, known)
        return apply(self._define("finite", ("value",), body), x)

    def total(self, summands: Sequence[XmlElement]) -> XmlElement:
        """Return a sum from left to right, missing if a summand is not finite.

        So infinities of both signs never meet: engines differ about what that is.
        """
        names = tuple(f"p{k}" for k in range(len(summands)))
        parts = [ref(name) for name in names]
        total = parts[0]
        for part in parts[1:]:
            total = apply("+", total, part)
        usable = joined("min", [self.finite(part) for part in parts])
        whole = apply("if", apply("equal", usable, constant(1.0)), total)
        return apply(self._define(f"sum{len(names)}", names, whole), *summands)

    def _define(self, name: str, parameters: Sequence[str], body: XmlElement) -> str:
        if name not in self.defined:
            self.defined[name] = definition(
                name, dict.fromkeys(parameters, NUMBER), body
            )
        return name


def norm_continuous(points: Points, field: str) -> XmlElement:
    """Return points as PMML's own lists, one for each stretch between steps.

    An engine rounds in its own order: a stretch whose degrees are below 1 is clamped to
    the highest of them, so that no rounding makes it 1.
    """
    runs: list[list[tuple[float, float]]] = [[]]
    for point in zip(points.values, points.degrees, strict=True):
        if runs[-1] and runs[-1][-1][0] == point[0]:
            runs.append([])
        runs[-1].append(point)
    result = _run(runs[-1], field)
    for run in reversed(runs[:-1]):
        result = apply("if", _up_to(ref(field), run[-1][0]), _run(run, field), result)
    return result


def _run(run: list[tuple[float, float]], field: str) -> XmlElement:
    if len({degree for _, degree in run}) == 1:
        return constant(run[0][1])
    norms = [element("LinearNorm", orig=repr(x), norm=repr(d)) for x, d in run]
    result = element("NormContinuous", *norms, field=field, outliers="asExtremeValues")
    highest = max(degree for _, degree in run)
    return result if highest == 1.0 else apply("min", result, constant(highest))


def _up_to(x: XmlElement, value: float) -> XmlElement:
    return apply("lessOrEqual", x, constant(value))
