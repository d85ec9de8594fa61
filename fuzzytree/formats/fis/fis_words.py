"""The words of FIS files, for the reader and for the writer.

MATLAB wrote the format down; Octave's fuzzy-logic-toolkit and fuzzylite have words of
their own, and mean some of the shared ones otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, Literal, get_args

from fuzzytree.formats.words import (
    METHOD_WORDS,
    S_NORM_WORDS,
    T_NORM_WORDS,
    FunctionWords,
    function_words,
    meanings,
)
from fuzzytree.model import (
    MOST_POINTS,
    Curve,
    DefuzzifierMethod,
    Hedge,
    Points,
)

Dialect = Literal["matlab", "octave", "fuzzylite"]
DIALECTS: Final[tuple[Dialect, ...]] = get_args(Dialect)

FIS_TNORMS: Final = meanings(T_NORM_WORDS, "fis")
FIS_SNORMS: Final = meanings(S_NORM_WORDS, "fis")
FIS_METHODS: Final = meanings(METHOD_WORDS, "fis")

_BASIC_HEDGES: Final[Mapping[int, tuple[Hedge, ...]]] = {
    0: (),
    5: ("somewhat",),
    20: ("very",),
    40: ("very very",),
}
FIS_HEDGES: Final[Mapping[Dialect, Mapping[int, tuple[Hedge, ...]]]] = {
    "matlab": {0: ()},
    "octave": {**_BASIC_HEDGES, 10: (), 30: ("cubed",)},
    "fuzzylite": {
        **_BASIC_HEDGES,
        1: ("seldom",),
        30: ("extremely",),
        99: ("any",),
    },
}
"""What the hundredths of a term's number do to its degree."""

CONCLUDING_HEDGES: Final[Mapping[int, tuple[Hedge, ...]]] = {
    0: (),
    10: (),
    5: ("very",),
    20: ("somewhat",),
    30: ("cube root",),
    40: ("somewhat", "somewhat"),
}
"""The same behind the comma of a Sugeno rule in Octave, which takes the root there."""


def method_loss(
    method: DefuzzifierMethod, low: float | None, dialect: Dialect
) -> str | None:
    """Return what an engine means by a method that no output has here, if it does.

    Example:
        >>> method_loss("largest of maximum", -10.0, "matlab")
        "MATLAB's lom is the value of the largest size, and here the largest value"
    """
    match dialect, method:
        case "octave", "bisector":
            return "Octave's bisector is the number of a sample, and here its value"
        case "matlab", "bisector":
            what = "MATLAB's bisector is the first sample with half of the area"
            return f"{what}, and here the nearest to it"
        case "fuzzylite", "bisector":
            return "fuzzylite 6's bisector lies between two samples, and here on one"
        case "matlab", ("smallest of maximum" | "largest of maximum"):
            size = method.partition(" ")[0]
            word = {"smallest": "som", "largest": "lom"}[size]
            what = f"MATLAB's {word} is the value of the {size} size"
            is_same = low is not None and low >= 0.0
            return None if is_same else f"{what}, and here the {size} value"
        case _:
            return None


FIS_KINDS: Final[FunctionWords] = function_words("fis", "fuzzylite_fis")
"""The curves with a fixed number of parameters, by their name in a file."""

OTHER_KINDS: Final = ("discretemf", "constant", "linear", "function")
PRIVATE: Final = frozenset({*function_words("fuzzylite_fis"), "discretemf", "function"})
"""Kinds that MATLAB lacks; all of them are fuzzylite's."""

_MAY_BE_INFINITE: Final = frozenset({"trapmf", "binarymf"})


def curve_of(
    kind: str, numbers: Sequence[float], dialect: Dialect = "matlab"
) -> Curve | str:
    """Return the curve that a kind of `FIS_KINDS` or `discretemf` makes of its numbers.

    Returns:
        The curve, or a sentence on what is wrong with the numbers.

    Example:
        >>> curve_of("smf", [1.0, 2.0])
        SCurve(start=1.0, end=2.0)
        >>> curve_of("trimf", [1.0, 2.0])
        "a 'trimf' has 3 numbers (a b c), not 2"
    """
    if kind not in _MAY_BE_INFINITE and not all(map(math.isfinite, numbers)):
        return "the numbers must be finite"
    if kind == "discretemf":
        return _points(numbers)
    word = FIS_KINDS[kind]
    needed = word.arity
    if len(numbers) != needed:
        what = f"a {kind!r} has {needed} numbers ({word.numbers}), not {len(numbers)}"
        if len(numbers) == needed + 1:
            what += "; one more is a height in fuzzylite's files (--from fis:fuzzylite)"
        return what
    if any(number != number for number in numbers):
        return "the numbers must be finite"
    try:
        curve = word.make(numbers, dialect)
    except ValueError as error:
        return str(error)
    return next(curve.mistakes(), curve)


def _points(numbers: Sequence[float]) -> Curve | str:
    if len(numbers) % 2 or not numbers:
        return f"a 'discretemf' has pairs of numbers (x y x y ...), not {len(numbers)}"
    if len(numbers) > 2 * MOST_POINTS:
        return f"{len(numbers) // 2} points are more than the {MOST_POINTS} of a curve"
    curve = Points(tuple(numbers[0::2]), tuple(numbers[1::2]))
    for text in curve.mistakes():
        return text
    return curve
