"""Terms of FCL: numbers, lists of points, and the curves that a dialect has."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec.structs import replace

from fuzzytree.exporters.fcl_dialects import FclWords
from fuzzytree.exporters.fll_text import degree_text, number, number_text, weighted_type
from fuzzytree.exporters.fuzzy_files import with_labels, without_heights
from fuzzytree.formats import shape_in_fcl
from fuzzytree.model import (
    Call,
    Expression,
    Formula,
    FuzzySystem,
    Linear,
    Loss,
    Name,
    Number,
    Points,
    Singleton,
    SystemOutput,
    Term,
    Variable,
)
from fuzzytree.semantics import has_numbers, pointed

Names = Mapping[str, str]


def term_text(
    variable: Variable | SystemOutput,
    label: Term,
    words: FclWords,
    names: Names,
) -> str | None:
    """Return the curve of a label; None if the dialect has none for it."""
    is_weighted = has_numbers(variable)
    curve = label.function
    if isinstance(curve, Singleton) and (is_weighted or words.name == "jfuzzylogic"):
        return number(curve.value)
    if isinstance(curve, Points) and not is_weighted and label.height == 1.0:
        pairs = zip(curve.values, curve.degrees, strict=True)
        return " ".join(f"({number(x)}, {number(y)})" for x, y in pairs)
    if words.name == "fuzzylite":
        text = degree_text(label, names)
        if isinstance(variable, SystemOutput) and is_weighted:
            text = number_text(label, weighted_type(variable), names)
        is_new = text is not None and text.startswith(("Arc ", "SemiEllipse "))
        return None if is_new else text  # fuzzylite 6 does not know the two
    if words.name != "jfuzzylogic" or label.height != 1.0:
        return None
    if is_weighted and isinstance(curve, Formula):
        text = _formula_text(curve.expression, names)
        return None if text is None else f"FUNCTION {text}"
    if is_weighted:
        return None
    shape = shape_in_fcl(curve)
    return None if shape is None else " ".join([shape[0], *map(number, shape[1])])


_OPERATORS = {**{sign: sign for sign in "+-*/^"}, "fmod": "%"}
_FUNCTIONS = {
    **{name: name.upper() for name in ("exp", "sin", "cos", "tan", "abs")},
    "log": "LN",
    "log10": "LOG",
}


def _formula_text(expression: Expression, names: Names) -> str | None:
    """Return a formula for jFuzzyLogic, with all parentheses; None if it has none."""
    match expression:
        case Number(value=value) if value - value == 0.0:
            return f"({number(value)})" if value < 0 else number(value)
        case Name(name=name):
            return names.get(name)
        case Call(function=function, arguments=arguments):
            given = [_formula_text(one, names) for one in arguments]
            inner = [one for one in given if one is not None]
            if len(inner) < len(given):
                return None
            if function in _OPERATORS:
                return f"({f' {_OPERATORS[function]} '.join(inner)})"
            word = _FUNCTIONS.get(function)
            return None if word is None else f"{word}({inner[0]})"
        case _:
            return None


def as_points(
    system: FuzzySystem, words: FclWords, tolerance: float
) -> tuple[FuzzySystem, list[Loss]]:
    """Return a system whose curves the dialect has words for, or points in their place.

    Raises:
        LossError: With every curve that points cannot stand for.
    """

    def is_known(variable: Variable | SystemOutput, term: Term) -> bool:
        return has_numbers(variable) or term_text(variable, term, words, {}) is not None

    system, lost = pointed(system, tolerance, keeps=is_known)
    losses = [*lost]
    if words.name != "fuzzylite":
        system = without_heights(system, "FCL", losses)
    return system, losses


def unspeakable(system: FuzzySystem, words: FclWords) -> Iterator[str]:
    """Yield the terms that a dialect has no words for."""
    names = {one.name: one.name for one in system.all_variables}
    for variable in system.all_variables:
        for label in variable.terms:
            if term_text(variable, label, words, names) is None:
                kind = type(label.function).__name__
                where = f"term {label.name!r} of {variable.name!r}"
                yield f"{where}: the dialect {words.name} has no {kind} there"


def plain_linear(system: FuzzySystem) -> FuzzySystem:
    """Return a system whose weighted sums of inputs are formulas."""

    def formula(label: Term) -> Term:
        if not isinstance(label.function, Linear):
            return label
        total: Expression = Number(0.0)
        pairs = zip(label.function.weights, system.inputs, strict=True)
        parts = [Call("*", (Number(weight), Name(name))) for weight, name in pairs]
        if parts:
            total = parts[0]
        for part in parts[1:]:
            total = Call("+", (total, part))
        total = Call("+", (total, Number(label.function.offset)))
        return replace(label, function=Formula(total))

    return with_labels(system, lambda one: map(formula, one.terms))
