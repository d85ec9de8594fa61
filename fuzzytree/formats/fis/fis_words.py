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
    FunctionWord,
    FunctionWords,
    function_words,
    meanings,
)
from fuzzytree.model import (
    MOST_POINTS,
    Curve,
    Hedge,
    Points,
    curves,
)

Dialect = Literal["matlab", "octave", "fuzzylite"]
DIALECTS: Final[tuple[Dialect, ...]] = get_args(Dialect)

FIS_FAR: Final = 1e300
"""Corners beyond it stand for none: a trapezoid has no way to say `1 up to here`."""

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


def trapezoid(a: float, b: float, c: float, d: float) -> curves.Trapezoid:
    """Return a trapezoid; two corners beyond `FAR` leave a side open.

    A side to the next double is a step: no value lies on it.

    Example:
        >>> trapezoid(-2e300, -1e300, 3.0, 5.0).a is None
        True
    """
    is_left, is_right = b <= -FIS_FAR, c >= FIS_FAR
    a = b if a == math.nextafter(b, -math.inf) else a
    d = c if d == math.nextafter(c, math.inf) else d
    if is_left and is_right:
        return curves.Trapezoid(None, 0.0, 0.0, None)
    if is_left:
        return curves.Trapezoid(None, c, c, d)
    if is_right:
        return curves.Trapezoid(a, b, b, None)
    return curves.Trapezoid(a, b, c, d)


def _ramp(numbers: Sequence[float]) -> Curve:
    start, end = numbers
    if start == end:
        return Points((start,), (0.0,))  # as fuzzylite
    if start < end:
        return Points((start, end), (0.0, 1.0))
    return Points((end, start), (1.0, 0.0))


def _rising(numbers: Sequence[float]) -> Curve:
    start, end = numbers
    if start < end:
        return curves.SCurve(start, end)
    return curves.Binary((start + end) / 2)  # as MATLAB's smf


def _falling(numbers: Sequence[float]) -> Curve:
    start, end = numbers
    if start < end:
        return curves.SCurve(end, start)
    return curves.Binary((start + end) / 2, is_above=False)


def _rectangle(numbers: Sequence[float]) -> Curve:
    start, end = numbers
    return curves.Trapezoid(start, start, end, end)


def _binary(numbers: Sequence[float]) -> Curve:
    start, direction = numbers
    return curves.Binary(start, is_above=direction > start)


_FUZZYLITE: Final = {
    **function_words("fuzzylite_fis"),
    "rampmf": FunctionWord("start end", _ramp),
    "rectmf": FunctionWord("start end", _rectangle),
    "binarymf": FunctionWord("start direction", _binary),
}
FIS_KINDS: Final[FunctionWords] = {
    "trimf": FunctionWord("a b c", lambda n: trapezoid(n[0], n[1], n[1], n[2])),
    "trapmf": FunctionWord("a b c d", lambda n: trapezoid(*n)),
    "linzmf": FunctionWord("a b", lambda n: _ramp([n[1], n[0]])),
    "linsmf": FunctionWord("a b", _ramp),
    "smf": FunctionWord("start end", _rising),
    "zmf": FunctionWord("start end", _falling),
    **function_words("fis"),
    **_FUZZYLITE,
}
"""The curves with a fixed number of parameters, by their name in a file."""

OTHER_KINDS: Final = ("discretemf", "constant", "linear", "function")
PRIVATE: Final = frozenset({*_FUZZYLITE, "discretemf", "function"})
"""Kinds that MATLAB lacks; all of them are fuzzylite's."""

_MAY_BE_INFINITE: Final = frozenset({"trapmf", "binarymf"})


def curve_of(kind: str, numbers: Sequence[float]) -> Curve | str:
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
        return f"a {kind!r} has {needed} numbers ({word.numbers}), not {len(numbers)}"
    if any(number != number for number in numbers):
        return "the numbers must be finite"
    curve = word.make(numbers)
    for text in curve.mistakes():
        return text
    return curve


def _points(numbers: Sequence[float]) -> Curve | str:
    if len(numbers) % 2 or not numbers:
        return f"a 'discretemf' has pairs of numbers (x y x y ...), not {len(numbers)}"
    if len(numbers) > 2 * MOST_POINTS:
        return f"{len(numbers) // 2} points are more than the {MOST_POINTS} of a curve"
    curve = Points(tuple(numbers[0::2]), tuple(numbers[1::2]))
    for text in curve.mistakes():
        return text
    return curve
