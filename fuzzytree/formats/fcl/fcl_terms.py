"""Terms of FCL: numbers, lists of points, and the curves that dialects add."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from lark import Token
from msgspec.structs import astuple

from fuzzytree.formats.fcl.fcl_dialects import Dialect
from fuzzytree.formats.fcl.fcl_syntax import TermStatement, place
from fuzzytree.formats.fll.fll_terms import CLASSES, FllTerm, TermScope, read_term
from fuzzytree.formats.shapes import Engine, is_plain
from fuzzytree.formats.text_files import PartError, Word, number_of
from fuzzytree.formats.words import (
    FunctionWord,
    FunctionWords,
    function_words,
    in_words,
)
from fuzzytree.model import (
    Curve,
    Points,
    Term,
    curves,
    name_choice,
)

_FORMULA = "FUNCTION"


def read(text: TermStatement, where: TermScope, dialect: Dialect) -> FllTerm:
    """Return the term of a statement.

    Raises:
        TermError: With the mistakes of the term.
    """
    name = str(text.name)
    first = text.tokens[0]
    if text.kind == "number":
        kind = Word("Constant", *place(first))
        if dialect == "fuzzylite" or where.is_weighted:
            return read_term(name, kind, _words(text.tokens), where)
        return _checked(first, name, curves.Singleton(_number(first)), where)
    if text.kind == "points":
        numbers = [_number(one) for one in text.tokens]
        points = Points(tuple(numbers[::2]), tuple(numbers[1::2]))
        return _checked(first, name, points, where)
    if first.upper() == _FORMULA:
        kind = Word("Function", *place(first))
        words = _formula_words(text, dialect)
        formula = ""
        for word in words:
            formula = formula.ljust(word.column - words[0].column) + word.text
        return read_term(name, kind, words, where, formula)
    if str(first) not in CLASSES and first.upper() in FCL_SHAPES:
        return _shape(text, where)
    exact = next((one for one in CLASSES if one.upper() == first.upper()), "")
    if not exact:
        known = ["FUNCTION", *FCL_SHAPES, *CLASSES]
        sentence = f"no shape {str(first)!r}; {name_choice(str(first)[:99], known)}"
        raise PartError((*place(first), sentence))
    kind = Word(exact, *place(first))
    plain = [one for one in text.tokens[1:] if one.type not in ("LPAR", "RPAR")]
    rest = [one for one in plain if one.type != "COMMA"]
    return read_term(name, kind, _words(rest), where)


def _words(tokens: Sequence[Token]) -> list[Word]:
    return [Word(str(one), *place(one)) for one in tokens]


def _number(token: Token) -> float:
    value = number_of(str(token))
    if value is None or not math.isfinite(value):
        sentence = (
            f"{str(token)!r} where a number must stand; curves that depend on "
            "variables are not supported"
        )
        raise PartError((*place(token), sentence))
    return value


def _checked(token: Token, name: str, curve: Curve, where: TermScope) -> FllTerm:
    for sentence in curve.mistakes():
        whose = f"term {name!r} of {where.variable!r}"
        raise PartError((*place(token), f"{whose}: {sentence}"))
    return FllTerm(Term(name, curve), "")


_FUNCTIONS = {"LN": "log", "LOG": "log10"}
"""Functions of jFuzzyLogic that fuzzylite calls otherwise."""


def _formula_words(text: TermStatement, dialect: Dialect) -> list[Word]:
    """Return a formula's words as fuzzylite writes them, on one line."""
    results: list[Word] = []
    column = place(text.tokens[0])[1]
    tokens = text.tokens[1:]
    for index, one in enumerate(tokens):
        after = tokens[index + 1].type if index + 1 < len(tokens) else ""
        shown = str(one)
        if one.type == "WORD" and after == "LPAR" and dialect != "fuzzylite":
            shown = _FUNCTIONS.get(shown.upper(), shown.lower())
        line, start = place(one)
        is_far = line != place(text.tokens[0])[0]
        column = max(column + 1, 0 if is_far else start)
        results.append(Word(shown, place(text.tokens[0])[0], column))
        column += len(shown)
    return results


def _shape(text: TermStatement, where: TermScope) -> FllTerm:
    first, *rest = text.tokens
    word = FCL_SHAPES[first.upper()]
    numbers = [_number(one) for one in rest]
    if len(numbers) != word.arity:
        sentence = f"{first} takes {word.arity} numbers, not {len(numbers)}"
        raise PartError((*place(first), sentence))
    try:
        curve = word.make(numbers, "jfuzzylogic")
    except ValueError as error:
        raise PartError((*place(first), str(error))) from error
    return _checked(first, str(text.name), curve, where)


def _two_gaussians(n: Sequence[float], engine: Engine) -> Curve:
    if n[0] > n[2]:
        raise ValueError(f"the first mean {n[0]!r} must not lie above {n[2]!r}")
    return curves.TwoGaussians(*n)


FCL_SHAPES: Final[FunctionWords] = {
    **function_words("fcl"),
    "GAUSS2": FunctionWord("mean deviation mean deviation", _two_gaussians),
    "COSINE": FunctionWord("half center", lambda n, _: curves.Cosine(n[1], 2.0 * n[0])),
}
"""The curves of jFuzzyLogic."""


def shape_in_fcl(curve: Curve) -> tuple[str, Sequence[float]] | None:
    """Return the word of jFuzzyLogic for a curve and its numbers, if there is one."""
    match curve:
        case curves.Trapezoid(a=float(a), b=b, c=c, d=float(d)):
            return ("TRIAN", (a, b, d)) if b == c else ("TRAPE", (a, b, c, d))
        case curves.Cosine(center=center, width=width):
            return "COSINE", (width / 2.0, center)
        case curves.TwoGaussians() if curve.left <= curve.right:
            return "GAUSS2", astuple(curve)
        case curves.Bell(slope=slope) if slope < 0.0:
            return None
        case curves.SigmoidDifference() if not is_plain(curve):
            return None
        case _:
            return in_words(curve, FCL_SHAPES)


def extent(curve: Curve) -> tuple[float, float] | None:
    """Return the range that jFuzzyLogic takes for a term; None if there is none."""
    match curve:
        case Points(values=values):
            return values[0], values[-1]
        case curves.Trapezoid(a=a, d=d):
            return None if a is None or d is None else (a, d)
        case curves.Gaussian(mean=mean, deviation=deviation):
            return mean - 4.0 * deviation, mean + 4.0 * deviation
        case curves.TwoGaussians():
            low = curve.left - 4.0 * curve.left_deviation
            return low, curve.right + 4.0 * curve.right_deviation
        case curves.Bell(center=center, width=width, slope=slope):
            reach = abs(width) * 999.0 ** (1.0 / (2.0 * slope)) if slope > 0 else 0.0
            return center - reach, center + reach
        case curves.Sigmoid(inflection=inflection, slope=slope):
            reach = 9.0 / abs(slope) if slope else 0.0
            return inflection - reach, inflection + reach
        case (
            curves.SigmoidDifference(first=first, second=second)
            | curves.SigmoidProduct(first=first, second=second)
        ):
            ends = [one for one in (extent(first), extent(second)) if one is not None]
            return min(low for low, _ in ends), max(high for _, high in ends)
        case curves.Cosine(center=center, width=width):
            return center - width / 2.0, center + width / 2.0
        case curves.PiCurve(a=a, d=d):
            return a, d
        case _:
            return None
