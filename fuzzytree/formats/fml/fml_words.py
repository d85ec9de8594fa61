"""The words of FML (IEEE 1855-2016), for the reader and for the writer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from fuzzytree.formats.fml.xml import FmlElement
from fuzzytree.formats.text_files import ReaderNotes, number_of
from fuzzytree.formats.words import (
    HEDGE_WORDS,
    METHOD_WORDS,
    S_NORM_WORDS,
    T_NORM_WORDS,
    FunctionWord,
    FunctionWords,
    function_words,
    in_words,
    meanings,
)
from fuzzytree.model import (
    Curve,
    Defuzzifier,
    PiCurve,
    Points,
    SCurve,
    Singleton,
    Trapezoid,
    TwoGaussians,
    name_choice,
)

NAMESPACE: Final = "http://www.ieee1855.org"
FML_FAR: Final = 1e300
"""The flat side of a right or left gaussian ends beyond all values."""

FML_TNORMS: Final = meanings(T_NORM_WORDS, "fml")
FML_SNORMS: Final = meanings(S_NORM_WORDS, "fml")
FML_METHODS: Final = meanings(METHOD_WORDS, "fml")
USUAL: Final = Defuzzifier("centroid", 1000, "middle")
"""FML says nothing of samples; its reference implementation takes 1000."""

MODIFIERS: Final = meanings(HEDGE_WORDS, "fml")
"""The modifiers with a meaning here; above, below, norm and slightly have none."""

OTHER_MODIFIERS: Final = ("above", "below", "norm", "slightly")


SHAPES: Final[FunctionWords] = {
    **function_words("fml"),
    "piShape": FunctionWord(
        "a b", lambda n, _: PiCurve(n[0], n[1], n[1], n[1] + abs(n[1] - n[0]))
    ),
    "rightGaussianShape": FunctionWord(
        "c s", lambda n, _: TwoGaussians(n[0], abs(n[1]), FML_FAR, 1.0)
    ),
    "leftGaussianShape": FunctionWord(
        "c s", lambda n, _: TwoGaussians(-FML_FAR, 1.0, n[0], abs(n[1]))
    ),
    "singletonShape": FunctionWord("a", lambda n, _: Singleton(n[0])),
}


def shape_in_words(curve: Curve) -> tuple[str, Sequence[float]] | None:
    """Return the shape of a curve and its parameters; None if it must be points."""
    match curve:
        case Points(values=(a, b), degrees=(0.0, 1.0)):
            return "rightLinearShape", (a, b)
        case Points(values=(a, b), degrees=(1.0, 0.0)):
            return "leftLinearShape", (a, b)
        case Trapezoid(a=float(a), b=b, c=c, d=float(d)) if a < b and c < d:
            is_peak = b == c
            numbers = (a, b, d) if is_peak else (a, b, c, d)
            return "triangularShape" if is_peak else "trapezoidShape", numbers
        case Singleton(value=value):
            return "singletonShape", (value,)
        case TwoGaussians(left=c, left_deviation=s, right=right) if right >= FML_FAR:
            return "rightGaussianShape", (c, s)
        case TwoGaussians(left=left, right=c, right_deviation=s) if left <= -FML_FAR:
            return "leftGaussianShape", (c, s)
        case SCurve(start=a, end=b) if a != b:
            return ("sShape", (a, b)) if a < b else ("zShape", (b, a))
        case _:
            return in_words(curve, SHAPES)


POINTS: Final = ("pointSetShape", "pointSetMonotonicShape")
CIRCULAR: Final = "circularDefinition"


def number(
    element: FmlElement, key: str, notes: ReaderNotes, default: float | None = None
) -> float:
    """Return an attribute as a number; NaN, and a mistake, if it is none."""
    text = element.attributes.get(key)
    if text is None:
        if default is None:
            notes.mistake(
                element.position, f"<{element.name}> needs the attribute {key}"
            )
            return math.nan
        return default
    value = number_of(text.strip())
    if value is None:
        what = f"{key} of <{element.name}> must be a number, not {text[:40]!r}"
        notes.mistake(element.position, what)
        return math.nan
    return value


def curve_of(term: FmlElement, where: str, notes: ReaderNotes) -> Curve | None:
    """Return the curve of a term; None, and a mistake, if there is none."""
    shapes = [child for child in term.children if child.name != CIRCULAR]
    if len(shapes) != 1:
        notes.mistake(term.position, f"{where} needs one shape, and has {len(shapes)}")
        return None
    shape = shapes[0]
    before = len(notes.mistakes)
    if shape.name in POINTS:
        curve: Curve = _points(shape, where, notes)
    elif shape.name in SHAPES:
        word = SHAPES[shape.name]
        numbers = [number(shape, f"param{k + 1}", notes) for k in range(word.arity)]
        if len(notes.mistakes) > before:
            return None
        curve = word.make(numbers, "jfml")
        if shape.name == "piShape":
            what = "a piShape falls behind its second number as it rose before it"
            notes.remark(f"{where}: {what}, as in the reference implementation")
    else:
        known = [*SHAPES, *POINTS, CIRCULAR]
        choice = name_choice(shape.name[:40], known)
        notes.mistake(
            shape.position, f"{where}: no shape <{shape.name[:40]}>; {choice}"
        )
        return None
    if len(notes.mistakes) > before:
        return None
    for text in curve.mistakes():
        notes.mistake(shape.position, f"{where}: {text}")
    if isinstance(curve, Trapezoid) and curve.a == curve.d:
        return Singleton(curve.b)  # JFML samples the corners of each shape
    return curve


def _points(shape: FmlElement, where: str, notes: ReaderNotes) -> Points:
    method = shape.attributes.get("interpolationMethod", "linear")
    if method.lower() != "linear":
        what = f"points joined by {method} are joined by lines here"
        notes.loss(where, what)
    points = shape.all("point")
    values = tuple(number(point, "x", notes) for point in points)
    return Points(values, tuple(number(point, "y", notes) for point in points))
