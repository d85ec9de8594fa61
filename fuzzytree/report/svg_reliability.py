"""How often predictions are right, over the probability that they claim."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.report.drawing import Scale, frame_marks, path_of
from fuzzytree.report.markup import Markup, mark
from fuzzytree.report.pictures import Picture, picture
from fuzzytree.report.text import counted

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray, IntArray

_WIDE, _HIGH = 348.0, 372.0
_X = Scale(0.0, 1.0, 74.0, 334.0)
_Y = Scale(0.0, 1.0, 316.0, 56.0)
_BAR = 40.0  # high, of the most rows
_BINS = 10  # parts of equal width of [0, 1]


def draw_reliability(
    probabilities: FloatArray, codes: IntArray, *, title: str = ""
) -> Picture:
    """Draw how often the likeliest class is right, over its probability.

    Rows are sorted into bins by the probability of their likeliest class. A dot stands
    at the mean of a bin's probabilities and the share of its rows that are right: on
    the diagonal, probabilities are what they claim. Grey bars count the rows.

    Args:
        probabilities: Shape (rows, classes), as `predict_proba` returns them.
        codes: The column of each row's own class.
        title: Above the picture.

    Returns:
        A picture, which a notebook shows; `picture.save("reliability.svg")` writes it.

    Raises:
        ValueError: If the shapes do not fit, or there is no row.

    Example:
        >>> shares, codes = np.array([[0.9, 0.1], [0.2, 0.8]]), np.array([0, 1])
        >>> "2 rows" in draw_reliability(shares, codes).svg
        True
    """
    shares, own = np.asarray(probabilities, np.float64), np.asarray(codes, np.int64)
    if shares.ndim != 2 or not shares.size or own.shape != shares.shape[:1]:
        raise ValueError(
            f"probabilities of shape (rows, classes) and a code for each row, not "
            f"{shares.shape} and {own.shape}"
        )
    claimed, is_right = shares.max(axis=1), shares.argmax(axis=1) == own
    place = np.minimum((claimed * _BINS).astype(np.int64), _BINS - 1)
    rows = np.bincount(place, minlength=_BINS)
    filled = np.flatnonzero(rows)
    claims = np.bincount(place, claimed, minlength=_BINS)[filled] / rows[filled]
    rights = np.bincount(place, is_right, minlength=_BINS)[filled] / rows[filled]
    error = float((rows[filled] * np.abs(claims - rights)).sum() / len(own))
    chances = shares[np.arange(len(own)), own]
    loss = -float(np.log(np.maximum(chances, 1e-15)).mean())
    facts = f"{counted(len(own), 'row')}: log-loss {loss:.3f}, calibration error "
    facts += f"{error:.3f}"
    heading = title or "How often predictions are right"
    dots = [
        (_X.at(x), _Y.at(y))
        for x, y in zip(claims.tolist(), rights.tolist(), strict=True)
    ]
    marks = [
        mark("words", 10, 22, heading, "strong"),
        mark("words", 10, 40, facts, "small"),
        *_frame(rows.tolist()),
        mark("path", path_of(dots), "line"),
        *(mark("rect", x - 3, y - 3, 6, 6, "dot") for x, y in dots),
    ]
    return picture(marks, _WIDE, _HIGH, f"{heading}; {facts}")


def _frame(rows: list[int]) -> Iterator[Markup]:
    """Yield the bars of the rows, the diagonal, and the axes with their numbers."""
    base, top = _Y.start, _Y.end
    step = (_X.end - _X.start) / len(rows)
    for place, count in enumerate(rows):
        high = _BAR * count / max(rows)
        left = _X.start + step * place
        yield mark("rect", left + 1, base - high, step - 2, high, "bin")
    yield mark("path", path_of([(_X.start, base), (_X.end, top)]), "dashed")
    about = "probability of the predicted class"
    yield from frame_marks(_X, _Y, about, "share of rows that are right")
