"""Curves as the words and numbers of FIS files."""

from __future__ import annotations

import math
from collections.abc import Iterable

from fuzzytree.formats import (
    FAR,
    FIS_KINDS,
    PRIVATE,
    Dialect,
    curve_of,
    fuzzylite_text_of,
    in_words,
    is_plain,
)
from fuzzytree.model import (
    LR,
    Band,
    Bell,
    Binary,
    Curve,
    Formula,
    FuzzySystem,
    Linear,
    Loss,
    PiCurve,
    Points,
    SCurve,
    SigmoidDifference,
    Singleton,
    SystemCurve,
    SystemOutput,
    Term,
    Trapezoid,
    Variable,
)
from fuzzytree.semantics import has_numbers, pointed, shape_of

FisTerm = tuple[str, str]
"""A kind such as `trimf`, and its numbers as text."""


def with_known_curves(
    system: FuzzySystem, dialect: Dialect, tolerance: float
) -> tuple[FuzzySystem, tuple[Loss, ...]]:
    """Return a system whose curves a dialect knows, and how far points are off.

    Raises:
        LossError: If a curve cannot become points within the tolerance.
    """

    def is_known(variable: Variable | SystemOutput, term: Term) -> bool:
        return has_numbers(variable) or term_of(term.function, dialect) is not None

    return pointed(system, tolerance, keeps=is_known)


def term_of(curve: Curve, dialect: Dialect) -> FisTerm | None:
    """Return a curve as a file writes it; None if the dialect cannot.

    Example:
        >>> from fuzzytree.model import Cosine
        >>> term_of(Trapezoid(0.0, 1.0, 1.0, 2.5), "octave")
        ('trimf', '0.0 1.0 2.5')
        >>> term_of(Points((1.0, 2.0), (1.0, 0.0)), "matlab")
        ('trapmf', '-2e+300 -1e+300 1.0 2.0')
        >>> term_of(Cosine(0.0, 1.0), "octave") is None
        True
    """
    match curve:
        case Band() | LR():
            return None
        case Points(values=values, degrees=degrees):
            pairs = zip(values, degrees, strict=True)
            exact = _corners_of(curve)
            if exact is not None:
                return _trapezoid(exact)
            return "discretemf", _text(number for pair in pairs for number in pair)
        case Trapezoid() | Singleton() | Binary():
            result = _corners(curve)
            return None if result is None else _trapezoid(result)
        case Formula(expression=expression):
            is_known = dialect == "fuzzylite"
            return ("function", fuzzylite_text_of(expression)) if is_known else None
        case _:
            return _formed(curve, dialect)


def number_of(curve: Curve, dialect: Dialect) -> FisTerm | None:
    """Return the term of a weighted output; None if the dialect has none."""
    match curve:
        case Singleton(value=value):
            return "constant", repr(float(value))
        case Linear(weights=weights, offset=offset):
            return "linear", _text((*weights, offset))
        case Points(values=(first, last), degrees=(0.0, 1.0)) if dialect == "fuzzylite":
            return "rampmf", _text((first, last))
        case Points(values=(first, last), degrees=(1.0, 0.0)) if dialect == "fuzzylite":
            return "rampmf", _text((last, first))
        case _:
            return term_of(curve, dialect) if dialect == "fuzzylite" else None


def _formed(curve: SystemCurve, dialect: Dialect) -> FisTerm | None:
    match curve:
        case SCurve(start=start, end=end) if start != end:
            kind = "smf" if start < end else "zmf"
            return kind, _text((min(start, end), max(start, end)))
        case PiCurve(a=a, b=b, c=c, d=d) if a == b or c == d:
            return None
        case Bell(slope=slope) if dialect == "octave" and slope != int(slope):
            return None
        case SigmoidDifference() if dialect == "octave" and not is_plain(curve):
            return None
        case _:
            is_known = dialect == "fuzzylite"
            kinds = FIS_KINDS.items()
            known = {k: v for k, v in kinds if is_known or k not in PRIVATE}
            result = in_words(curve, known)
            return None if result is None else (result[0], _text(result[1]))


_Corners = tuple[float, float, float, float]


def _corners(curve: Trapezoid | Singleton | Binary) -> _Corners | None:
    """Return four corners that rise, with the same degrees at every double.

    A side that is a step ends at the next double. An open side is stretched far beyond
    all values: exact from -1e300 to 1e300.
    """
    match curve:
        case Singleton(value=value):
            return _corners(Trapezoid(value, value, value, value))
        case Binary(start=start, is_above=True):
            return _corners(Trapezoid(start, start, start, None))
        case Binary(start=start):
            return _corners(Trapezoid(None, start, start, start))
        case Trapezoid(a=a, b=b, c=c, d=d):
            inner = [corner for corner in (a, b, c, d) if corner is not None]
            if max(map(abs, inner)) >= FAR / 2:
                return None
            left = (-2 * FAR, -FAR) if a is None else (a, b)
            right = (FAR, 2 * FAR) if d is None else (c, d)
            if left[0] == left[1]:
                left = (math.nextafter(b, -math.inf), b)
            if right[0] == right[1]:
                right = (c, math.nextafter(c, math.inf))
            return (*left, *right)


def _corners_of(points: Points) -> _Corners | None:
    """Return corners that are read back as these very points, if there are any."""
    degrees, values = points.degrees, points.values
    if 1.0 not in degrees or max(map(abs, values)) >= FAR / 2:
        return None
    first = degrees.index(1.0)
    last = len(degrees) - 1 - degrees[::-1].index(1.0)
    left, right = (-2 * FAR, -FAR), (FAR, 2 * FAR)
    if first > 0:
        a, b = values[first - 1], values[first]
        left = (a, b if a < b else math.nextafter(b, math.inf))
    if last < len(degrees) - 1:
        c, d = values[last], values[last + 1]
        right = (c, d if c < d else math.nextafter(c, math.inf))
    if left[1] > right[0]:
        return None
    corners = (*left, *right)
    result = curve_of("trapmf", corners)
    is_same = not isinstance(result, str) and shape_of(result) == points
    return corners if is_same else None


def _trapezoid(corners: _Corners) -> FisTerm:
    a, b, c, d = corners
    return ("trimf", _text((a, b, d))) if b == c else ("trapmf", _text(corners))


def _text(numbers: Iterable[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)
