"""Terms of fuzzylite: a class and its numbers, such as `Triangle 0 1 2`, to a curve."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Final

import msgspec

from fuzzytree.formats.formulas import FUZZYLITE, FormulaError, Operators, parse
from fuzzytree.formats.text_files import FileMistake, PartError, Word, number_of
from fuzzytree.formats.words import (
    FunctionWord,
    FunctionWords,
    function_words,
    in_words,
)
from fuzzytree.model import (
    Call,
    Curve,
    Expression,
    Name,
    Number,
    Points,
    Term,
    curves,
    name_choice,
)
from fuzzytree.semantics import stepped

_FURTHEST: Final = 1e308  # an end that no value comes near


class TermScope(msgspec.Struct, frozen=True):
    """What a term's meaning depends on beside its own line.

    Attributes:
        variable: The name of its variable.
        inputs: The names of all inputs, in order.
        names: The names of all variables.
        is_weighted: Whether its variable is an output of weighted numbers.
        is_inverse: Whether a weighted output takes where monotone terms have a degree.
        operators: What those of formulas mean.
    """

    variable: str
    inputs: tuple[str, ...]
    names: Collection[str]
    is_weighted: bool = False
    is_inverse: bool = False
    operators: Operators = FUZZYLITE


class FllTerm(msgspec.Struct, frozen=True):
    """A term as it was read."""

    label: Term
    kind: str

    @property
    def is_number(self) -> bool:
        """Whether it is a number for weighted outputs."""
        return self.kind in ("Constant", "Linear", "Function")

    @property
    def is_monotone(self) -> bool:
        """Whether a weighted output takes the value at which it has a degree."""
        return self.kind in _MONOTONE


_MONOTONE = frozenset({"Arc", "Concave", "Ramp", "Sigmoid", "SShape", "ZShape"})


def read_term(
    name: str, kind: Word, rest: Sequence[Word], place: TermScope, formula: str = ""
) -> FllTerm:
    """Return a term of a class and its parameters.

    Raises:
        TermError: If it is none.
    """
    if kind.text == "Function":
        return FllTerm(Term(name, _function(kind, rest, place, formula)), kind.text)
    numbers = _numbers(rest)
    height = 1.0
    match kind.text:
        case "Constant":
            _check_count(kind, numbers, (1,), "1 number")
            curve: Curve = curves.Singleton(numbers[0])
            if not place.is_weighted:
                curve = curves.Formula(Number(numbers[0]))
        case "Linear":
            curve = _linear(kind, numbers, place)
        case "Discrete":
            if len(numbers) % 2:
                height = numbers.pop()
            if not numbers:
                raise _error(kind, "Discrete takes pairs of a value and a degree")
            curve = Points(stepped(numbers[::2]), tuple(numbers[1::2]))
        case known if known in FLL_CLASSES:
            count = FLL_CLASSES[known].arity
            wanted = f"{count} numbers, or {count + 1} with the height"
            _check_count(kind, numbers, (count, count + 1), wanted)
            if len(numbers) > count:
                height = numbers.pop()
            try:
                curve = FLL_CLASSES[known].make(numbers, "fuzzylite")
            except ValueError as error:
                raise _error(kind, str(error)) from error
            if place.is_inverse and known in ("SShape", "ZShape"):
                # Where it has a degree has a formula, though it ends before it starts.
                start, end = numbers if known == "SShape" else reversed(numbers)
                curve = curves.SCurve(start, end)
        case _:
            choice = name_choice(kind.text, CLASSES)
            raise _error(kind, f"no term {kind.text!r}; {choice}")
    result = Term(name, curve, height)
    _check(kind, result, place)
    return FllTerm(result, kind.text)


def _error(word: Word, sentence: str) -> PartError:
    return PartError(word.mistake(sentence))


def _check(kind: Word, label: Term, place: TermScope) -> None:
    where = f"term {label.name!r} of {place.variable!r}"
    for sentence in label.function.mistakes():
        raise _error(kind, f"{where}: {sentence}")
    if not 0.0 < label.height <= 1.0:
        sentence = f"{where}: the height must lie in (0, 1], not {label.height!r}"
        raise _error(kind, sentence)


def _check_count(
    kind: Word, numbers: Sequence[float], counts: tuple[int, ...], wanted: str
) -> None:
    if len(numbers) not in counts:
        raise _error(kind, f"{kind.text} takes {wanted}, not {len(numbers)}")


def _numbers(words: Sequence[Word]) -> list[float]:
    values: list[float] = []
    mistakes: list[FileMistake] = []
    for word in words:
        value = number_of(word.text)
        if value is None or math.isnan(value):
            mistakes.append(word.mistake(f"{word.text!r} where a number must stand"))
        else:
            values.append(value)
    if mistakes:
        raise PartError(*mistakes)
    return values


def _function(
    kind: Word, rest: Sequence[Word], place: TermScope, formula: str
) -> curves.Formula:
    if not rest:
        raise _error(kind, "Function takes a formula")
    if "x" in place.names:
        sentence = "'x' in a formula is the value itself; rename the variable 'x'"
        raise _error(rest[0], sentence)
    try:
        return curves.Formula(parse(formula, place.names, place.operators))
    except FormulaError as error:
        column = rest[0].column + error.column - 1
        raise PartError((rest[0].line, column, error.sentence)) from error


def _linear(kind: Word, numbers: Sequence[float], place: TermScope) -> Curve:
    count = len(place.inputs)
    wanted = f"{count} weights, one for each input, and perhaps an offset"
    _check_count(kind, numbers, (count, count + 1), wanted)
    offset = numbers[count] if len(numbers) > count else 0.0
    if place.is_weighted:
        return curves.Linear(tuple(numbers[:count]), offset)
    total: Expression = Number(offset)
    parts = [
        Call("*", (Number(weight), Name(name)))
        for weight, name in zip(numbers[:count], place.inputs, strict=True)
    ]
    if parts:
        first, *others = parts
        total = first
        for part in others:
            total = Call("+", (total, part))
        total = Call("+", (total, Number(offset)))
    return curves.Formula(total)


FLL_CLASSES: Final[FunctionWords] = {
    **function_words("fll"),
    "SemiEllipse": FunctionWord(
        "start end", lambda n, _: curves.SemiEllipse(*sorted(n))
    ),
}
"""The classes with a fixed number of parameters."""
CLASSES: Final = ("Constant", "Discrete", "Function", "Linear", *FLL_CLASSES)
"""The classes of terms, by their names in files."""


def term_in_words(curve: curves.SystemCurve) -> tuple[str | float, ...]:
    """Return the class of a curve and its numbers.

    Example:
        >>> term_in_words(curves.Trapezoid(0.0, 1.0, 1.0, 2.5))
        ('Triangle', 0.0, 1.0, 2.5)
    """
    match curve:
        case curves.Trapezoid(a=a, b=b, c=c, d=d):
            low = -math.inf if a is None else a
            high = math.inf if d is None else d
            if low == b and c == high:
                return "Rectangle", b, c
            return (
                ("Triangle", low, b, high) if b == c else ("Trapezoid", low, b, c, high)
            )
        case curves.SCurve(start=start, end=end):
            rises = start <= end
            return ("SShape", start, end) if rises else ("ZShape", end, start)
        case curves.Binary(start=start, is_above=is_above):
            return "Binary", start, math.inf if is_above else -math.inf
        case curves.SemiEllipse(start=start, end=end):
            return "SemiEllipse", start, end
        case curves.Singleton(value=value):
            return "Rectangle", value, value
        case _:
            name, numbers = in_words(curve, FLL_CLASSES) or ("", [])
            return name, *numbers


def as_degree(label: Term) -> Term:
    """Return a monotone term as one whose own degree is a weighted output's number.

    Of a monotone term a weighted output takes the value at which it has a degree
    (after Tsukamoto), and of any other term the degree at the activation. The curve
    that comes back has the same degrees and does not count as monotone.
    """
    match label.function:
        case Points(values=(a, b) as values, degrees=degrees) if a < b:
            # A second point at the end is a step of no height.
            again = Points((*values, values[-1]), (*degrees, degrees[-1]))
            return msgspec.structs.replace(label, function=again)
        case curves.SCurve(start=start, end=end) if start < end:
            rising = curves.PiCurve(start, end, _FURTHEST, _FURTHEST)
            return msgspec.structs.replace(label, function=rising)
        case curves.SCurve(start=start, end=end):
            falling = curves.PiCurve(-_FURTHEST, -_FURTHEST, end, start)
            return msgspec.structs.replace(label, function=falling)
        case curves.Sigmoid(inflection=inflection, slope=slope):
            text = f"1 / (1 + exp({-slope!r} * (x - {inflection!r})))"
        case curves.Concave(inflection=inflection, end=end) if inflection <= end:
            text = (
                f"{end - inflection!r} / ({end - inflection!r} + max({end!r} - x, 0))"
            )
        case curves.Concave(inflection=inflection, end=end):
            text = (
                f"{inflection - end!r} / ({inflection - end!r} + max(x - {end!r}, 0))"
            )
        case curves.Arc(start=start, end=end):
            part = f"min(max((x - {start!r}) / {end - start!r}, 0), 1)"
            text = f"sqrt({part} * (2 - {part}))"
        case _:
            return label
    return Term(label.name, curves.Formula(parse(f"{label.height!r} * ({text})")))
