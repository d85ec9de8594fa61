"""Where fuzzylite 6 and pyfuzzylite 8 give one file different meanings."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from fuzzytree.model import (
    Arc,
    Call,
    Concave,
    Curve,
    Expression,
    Formula,
    FuzzySystem,
    Linear,
    Loss,
    Number,
    Points,
    SCurve,
    SemiEllipse,
    Singleton,
    SNorm,
    SystemOutput,
    Term,
    names_in,
)
from fuzzytree.semantics import value_at


def differences(system: FuzzySystem) -> Iterator[str]:
    """Yield where fuzzylite 6 and pyfuzzylite 8 mean other things by a file."""
    concluded_names = {
        (one.output, one.term) for rule in system.rules for one in rule.then
    }
    for output in system.outputs:
        yield from constant_degrees(output)
        if output.defuzzifier.is_weighted:
            concluded = [
                label
                for label in output.terms
                if (output.name, label.name) in concluded_names
            ]
            if any(map(_is_infinite_at_zero, concluded)):
                yield (
                    f"output {output.name!r}: a rule of degree 0 counts nothing, as in "
                    "fuzzylite 6; pyfuzzylite multiplies 0 by an infinite number"
                )
            yield from _inverse_remarks(output, concluded)
    hedges = {
        hedge for rule in system.rules for one in rule.then for hedge in one.hedges
    }
    if hedges & {"any", "not"}:
        yield (
            "a rule of degree 0 concludes nothing, as in fuzzylite 6; in pyfuzzylite "
            "'any' and 'not' in a conclusion make 1 of 0"
        )
    yield from _area_remarks(system.outputs)
    yield from _curve_remarks(system)


def _area_remarks(outputs: Sequence[SystemOutput]) -> Iterator[str]:
    """Yield what fuzzylite 6 does with curves in another way."""
    looked_at = [one for one in outputs if not one.defuzzifier.is_weighted]
    methods = {one.defuzzifier.method for one in looked_at}
    if "bisector" in methods:
        yield (
            "Bisector is one of the values that are looked at, as in pyfuzzylite; "
            "fuzzylite 6 takes one between them"
        )
    if "mean of maximum" in methods:
        yield (
            "the mean of all values of the largest degree answers, as in pyfuzzylite; "
            "fuzzylite 6 takes the first stretch of such values, and degrees within "
            "1e-6 as equal"
        )
    if methods & {"smallest of maximum", "largest of maximum"}:
        yield "fuzzylite 6 counts degrees within 1e-6 of the maximum to the maxima"
    if any(one.default is not None for one in looked_at):
        yield (
            "where conclusions have no area the default answers, as in pyfuzzylite; "
            "fuzzylite 6 answers NaN"
        )


def joined_twice(system: FuzzySystem) -> Iterator[tuple[SystemOutput, str, SNorm]]:
    """Yield outputs with numbers that engines join differently, and a sentence on it.

    Fuzzylite 6 takes each rule alone. The last value is how pyfuzzylite joins those
    that conclude the same term.
    """
    counts = Counter(
        (one.output, one.term) for rule in system.rules for one in rule.then
    )
    for output in system.outputs:
        twice = [one for one in output.terms if counts[output.name, one.name] > 1]
        if not twice or not output.defuzzifier.is_weighted:
            continue
        names = ", ".join(repr(one.name) for one in twice[:3])
        same = f"rules that conclude the same term ({names}) are"
        if output.aggregation is not None:
            what = "joined by the aggregation, as in pyfuzzylite; fuzzylite 6 adds each"
            yield output, f"{same} {what}", output.aggregation
        elif any(map(_depends_on_degree, twice)):
            what = "weighted one by one, as in fuzzylite 6; pyfuzzylite adds their "
            yield output, f"{same} {what}degrees first", "sum"


def _depends_on_degree(label: Term) -> bool:
    """Return whether a label's number depends on its degree of activation."""
    match label.function:
        case Singleton() | Linear():
            return False
        case Formula(expression=expression):
            return "x" in names_in(expression)
        case _:
            return True


def _is_infinite_at_zero(label: Term) -> bool:
    """Return whether a label's number at degree 0 is, or may be, no finite number."""
    if isinstance(label.function, Formula):
        uses_degree = "x" in names_in(label.function.expression)
        functions = {call.function for call in _calls([label.function])}
        return uses_degree and bool(functions & {"/", "^", "log", "log10", "%", "fmod"})
    result = value_at(label.function, 0.0)
    return result is not None and not math.isfinite(result)


def _inverse_remarks(output: SystemOutput, concluded: Sequence[Term]) -> Iterator[str]:
    """Yield whether fuzzylite 6 finds other values at which a term has a degree."""
    if any(
        value_at(one.function, 0.5) is not None
        and (one.height != 1.0 or not isinstance(one.function, Points))
        for one in concluded
    ):
        yield (
            f"output {output.name!r}: where a term has a degree is what pyfuzzylite "
            "says; fuzzylite 6 finds other values for SShape, ZShape, Concave and "
            "terms with a height, and within 1e-6 of 0 and 1"
        )


_TRUTHS = frozenset({"le", "ge", "eq", "neq", "and", "or", "not"})
_SAFE = frozenset({*_TRUTHS, "lt", "gt", "*", "/", "^", "min", "max"})


def _curve_remarks(system: FuzzySystem) -> Iterator[str]:
    curves = [label.function for one in system.all_variables for label in one.terms]
    calls = list(_calls(curves))
    used = {call.function for call in calls}
    if "%" in used:
        yield (
            "formulas: '%' has the sign of its second number, as in pyfuzzylite; "
            "fuzzylite 6 takes the first one's"
        )
    if "round" in used:
        yield (
            "formulas: 'round' takes a half to the even neighbour, as in pyfuzzylite; "
            "fuzzylite 6 takes it away from 0"
        )
    if any(map(_asks_numbers, calls)):
        yield (
            "formulas: what is not 0 is true for 'and', 'or' and 'not', as in "
            "pyfuzzylite; in fuzzylite 6 only 1 is true"
        )
    degrees = [label.function for one in system.variables for label in one.terms]
    formulas = [one.expression for one in degrees if isinstance(one, Formula)]
    if any({*names_in(one)} - {"x"} for one in formulas):
        yield "formulas: fuzzylite 6 knows no variables in those of inputs' terms"
    if formulas:
        yield (
            "formulas: a degree below 0 concludes nothing, as in fuzzylite 6; "
            "pyfuzzylite counts it"
        )
    looked_at = [
        label.function
        for one in system.outputs
        if not one.defuzzifier.is_weighted
        for label in one.terms
    ]
    if {"min", "max"} & {call.function for call in _calls(looked_at)}:
        yield "formulas: pyfuzzylite fails at 'min' and 'max' in an output's curve"
    outputs = {one.name for one in system.outputs}
    if any(
        call.function in ("min", "max") and outputs & {*names_in(call)}
        for call in calls
    ):
        yield (
            "formulas: 'min' and 'max' of an output without a number have none; the "
            "engines take the other argument"
        )
    if any(map(_computes_with_truths, calls)):
        yield (
            "formulas: le, ge, eq, neq, and, or, not are the numbers 0 and 1; "
            "pyfuzzylite fails at sums and functions of them, adds them as truths, or "
            "computes in half precision"
        )
    if any(isinstance(one, Concave) and one.inflection == one.end for one in curves):
        yield (
            "a Concave term that ends at its inflection is 1 above it, as in "
            "fuzzylite 6; in pyfuzzylite it is 0 there"
        )
    if any(isinstance(one, Arc | SemiEllipse) for one in curves):
        yield "fuzzylite 6 does not know Arc and SemiEllipse; pyfuzzylite does"


def _calls(curves: Iterable[Curve]) -> Iterator[Call]:
    todo: list[Expression] = [
        one.expression for one in curves if isinstance(one, Formula)
    ]
    while todo:
        one = todo.pop()
        if isinstance(one, Call):
            yield one
            todo += one.arguments


def _computes_with_truths(call: Call) -> bool:
    """Return whether pyfuzzylite computes something else with truths than numbers."""
    return call.function not in _SAFE and all(map(_is_truth, call.arguments))


def _asks_numbers(call: Call) -> bool:
    """Return whether a logical function gets a number that may be neither 0 nor 1."""
    return call.function in ("and", "or", "not") and not all(
        _is_truth(one) or (isinstance(one, Call) and one.function in ("lt", "gt"))
        for one in call.arguments
    )


def _is_truth(expression: Expression) -> bool:
    """Return whether pyfuzzylite can have a truth there, and no number."""
    if not isinstance(expression, Call):
        return False
    if expression.function in ("min", "max"):
        return any(map(_is_truth, expression.arguments))
    if expression.function == "*":
        return all(map(_is_truth, expression.arguments))
    return expression.function in _TRUTHS


def fuzzylite_losses(output: SystemOutput) -> Iterator[Loss]:
    """Yield where fuzzylite 6 finds other numbers for an output of its own dialects.

    Example:
        >>> from fuzzytree.model import Defuzzifier, Term
        >>> how = Defuzzifier("weighted average")
        >>> falling = Term("little", Concave(0.5, 0.4))
        >>> output = SystemOutput("tip", (falling,), 0.0, 1.0, how)
        >>> [loss.where for loss in fuzzylite_losses(output)]
        ["output 'tip'"]
    """
    where = f"output {output.name!r}"
    if output.defuzzifier.method == "mean of maximum":
        yield Loss(
            where,
            "the mean of all values of the largest degree answers; fuzzylite 6 takes "
            "the first stretch of such values, and degrees within 1e-6 as equal",
        )
    curves = {type(label.function) for label in output.terms}
    if output.defuzzifier.is_weighted and curves & {SCurve, Concave, Arc}:
        yield Loss(
            where,
            "where a term has a degree is computed exactly; fuzzylite 6 finds other "
            "values for SShape, ZShape and Concave",
        )


def constant_degrees(output: SystemOutput) -> Iterator[str]:
    """Yield a remark on each number that is a degree because a curve is sampled.

    Example:
        >>> from fuzzytree.model import Defuzzifier, Term
        >>> low = Term("low", Formula(Number(0.3)))
        >>> how = Defuzzifier("centroid")
        >>> len([*constant_degrees(SystemOutput("tip", (low,), 0.0, 1.0, how))])
        1
    """
    if output.defuzzifier.is_weighted:
        return
    for label in output.terms:
        match label.function:
            case Formula(Number(value)):
                yield (
                    f"term {label.name!r} of {output.name!r} has the degree {value!r} "
                    "everywhere, as in fuzzylite; to answer numbers, choose a weighted "
                    "defuzzifier"
                )
            case _:
                pass
