"""The words of FML (IEEE 1855-2016), for the reader and for the writer."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from fuzzytree.formats.fml.xml import FmlElement
from fuzzytree.formats.text_files import ReaderNotes, number_of
from fuzzytree.model import (
    Curve,
    Defuzzifier,
    DefuzzifierMethod,
    Gaussian,
    Hedge,
    PiCurve,
    Points,
    SCurve,
    Singleton,
    SNorm,
    TNorm,
    Trapezoid,
    TwoGaussians,
    name_choice,
)

NAMESPACE: Final = "http://www.ieee1855.org"
FML_FAR: Final = 1e300
"""The flat side of a right or left gaussian ends beyond all values."""

FML_TNORMS: Final[Mapping[str, TNorm]] = {
    "MIN": "minimum",
    "PROD": "product",
    "BSUM": "bounded difference",  # so the published schema; BDIF in the text
    "BDIF": "bounded difference",
    "DRS": "drastic product",
    "DRP": "drastic product",
    "EPROD": "einstein product",
    "HPROD": "hamacher product",
    "NILMIN": "nilpotent minimum",
}
FML_SNORMS: Final[Mapping[str, SNorm]] = {
    "MAX": "maximum",
    "PROBOR": "algebraic sum",
    "BSUM": "bounded sum",
    "DRS": "drastic sum",
    "ESUM": "einstein sum",
    "HSUM": "hamacher sum",
    "NILMAX": "nilpotent maximum",
}
FML_METHODS: Final[Mapping[str, DefuzzifierMethod]] = {
    "COG": "centroid",
    "COA": "bisector",
    "LM": "smallest of maximum",
    "RM": "largest of maximum",
    "MOM": "mean of maximum",
}
USUAL: Final = Defuzzifier("centroid", 1000, "middle")
"""FML says nothing of samples; its reference implementation takes 1000."""

MODIFIERS: Final[Mapping[str, Hedge]] = {
    "any": "any",
    "not": "not",
    "very": "very",
    "somewhat": "somewhat",
    "seldom": "seldom",
    "plus": "plus",
    "extremely": "cubed",
    "intensify": "extremely",
    "more_or_less": "cube root",
}
"""The modifiers with a meaning here; above, below, norm and slightly have none."""

OTHER_MODIFIERS: Final = ("above", "below", "norm", "slightly")


_Make = Callable[[Sequence[float]], Curve]

SHAPES: Final[Mapping[str, tuple[int, _Make]]] = {
    "rightLinearShape": (2, lambda n: Points((n[0], n[1]), (0.0, 1.0))),
    "leftLinearShape": (2, lambda n: Points((n[0], n[1]), (1.0, 0.0))),
    "piShape": (2, lambda n: PiCurve(n[0], n[1], n[1], n[1] + abs(n[1] - n[0]))),
    "triangularShape": (3, lambda n: Trapezoid(n[0], n[1], n[1], n[2])),
    "trapezoidShape": (4, lambda n: Trapezoid(n[0], n[1], n[2], n[3])),
    "gaussianShape": (2, lambda n: Gaussian(n[0], abs(n[1]))),
    "rightGaussianShape": (2, lambda n: TwoGaussians(n[0], abs(n[1]), FML_FAR, 1.0)),
    "leftGaussianShape": (2, lambda n: TwoGaussians(-FML_FAR, 1.0, n[0], abs(n[1]))),
    "singletonShape": (1, lambda n: Singleton(n[0])),
    "rectangularShape": (2, lambda n: Trapezoid(n[0], n[0], n[1], n[1])),
    "sShape": (2, lambda n: SCurve(n[0], n[1])),
    "zShape": (2, lambda n: SCurve(n[1], n[0])),
}
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
        count, make = SHAPES[shape.name]
        numbers = [number(shape, f"param{k + 1}", notes) for k in range(count)]
        if len(notes.mistakes) > before:
            return None
        curve = make(numbers)
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
