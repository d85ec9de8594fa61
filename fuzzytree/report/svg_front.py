"""Accuracy over the number of leaves, a line for each number of columns per node."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import TYPE_CHECKING

from fuzzytree.report.drawing import Scale, frame_marks, path_of
from fuzzytree.report.markup import mark
from fuzzytree.report.pictures import Picture, class_mark, picture
from fuzzytree.report.text import counted

if TYPE_CHECKING:
    from fuzzytree.learning import Front

_WIDE, _HIGH = 484.0, 330.0
_LEFT, _RIGHT, _TOP, _BASE = 74.0, 374.0, 50.0, 276.0
_LETTERING = 13.0  # points from one line of words to the next


def draw_front(front: Front, *, title: str = "") -> Picture:
    """Draw the accuracy of small trees over their leaves.

    Args:
        front: The accuracies, as `learn` reports them.
        title: Above the picture.

    Returns:
        A picture; `picture.save("front.svg")` writes it.
    """
    heading = title or "Accuracy of small trees"
    shares = [share for row in front.accuracy for share in row]
    low = min(front.majority, *shares)
    high = max(front.majority, *shares)
    margin = max(0.02, 0.05 * (high - low))
    y = Scale(max(0.0, low - margin), min(1.0, high + margin), _BASE, _TOP)
    x = Scale(min(front.leaves), max(front.leaves) + 1e-9, _LEFT, _RIGHT)
    level = y.at(front.majority)
    facts = f"on {counted(front.rows, 'row')} held out, by columns per node"
    marks = [
        mark("words", 10, 20, heading, "strong"),
        mark("words", 10, 38, facts, "small"),
        mark("line", _LEFT, _RIGHT, level, level, "dashed"),
        mark("words", _LEFT + 6, level - 4, "majority class", "small"),
        *frame_marks(x, y, "leaves", "accuracy"),
    ]
    places = _apart([y.at(row[-1]) for row in front.accuracy])
    for number, (columns, row) in enumerate(
        zip(front.columns, front.accuracy, strict=True)
    ):
        points = [
            (x.at(k), y.at(share)) for k, share in zip(front.leaves, row, strict=True)
        ]
        marks.append(mark("path", path_of(points), f"line {class_mark(number)}"))
        word = "all columns" if columns is None else counted(columns, "column")
        look = f"small {class_mark(number)}"
        marks.append(mark("words", _RIGHT + 8, places[number] + 4, word, look))
    return picture(marks, _WIDE, _HIGH, f"{heading} {facts}")


def _apart(places: Sequence[float]) -> dict[int, float]:
    """Return a place near each of those, by its number, a line of words apart.

    Places that are too close become a group, which lies around their mean.
    """
    order = sorted(range(len(places)), key=lambda number: places[number])
    groups: list[list[float]] = []
    for rank, number in enumerate(order):
        groups.append([places[number] - _LETTERING * rank])
        while len(groups) > 1 and fmean(groups[-2]) > fmean(groups[-1]):
            groups[-2:] = [groups[-2] + groups[-1]]
    means = [fmean(group) for group in groups for _ in group]
    return {k: means[rank] + _LETTERING * rank for rank, k in enumerate(order)}
