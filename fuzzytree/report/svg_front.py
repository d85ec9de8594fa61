"""Accuracy over the number of leaves, a line for each number of columns a node."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from fuzzytree.report.drawing import Scale, path_of
from fuzzytree.report.markup import Markup, mark
from fuzzytree.report.pictures import Picture, picture
from fuzzytree.report.text import counted

if TYPE_CHECKING:
    from fuzzytree.learning import Front

_WIDE, _HIGH = 460.0, 330.0
_LEFT, _RIGHT, _TOP, _BASE = 50.0, 350.0, 50.0, 276.0
_COLOURS = ("#2458b3", "#b3482b", "#4a7a2e", "#5b4a8a")
_RULES = """
.axis { fill: none; stroke: #595d66; }
.majority { fill: none; stroke: #9aa0aa; stroke-dasharray: 4 3; }
""" + "".join(
    f".line{k} {{ fill: none; stroke: {colour}; stroke-width: 2; }}\n"
    for k, colour in enumerate(_COLOURS)
)


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
    facts = f"on {counted(front.rows, 'row')} held out, by columns a node"
    marks = [
        mark("words", 10, 20, heading, "strong"),
        mark("words", 10, 38, facts, "small"),
        *_axes(front, x, y),
    ]
    places: list[float] = []
    for number, (columns, row) in enumerate(
        zip(front.columns, front.accuracy, strict=True)
    ):
        points = [
            (x.at(k), y.at(share)) for k, share in zip(front.leaves, row, strict=True)
        ]
        marks.append(mark("path", path_of(points), f"line{number}"))
        place = points[-1][1]
        while any(abs(place - other) < 13 for other in places):
            place -= 13
        places.append(place)
        word = "all columns" if columns is None else counted(columns, "column")
        marks.append(mark("words", _RIGHT + 8, place + 4, word, "small"))
    return picture(marks, _WIDE, _HIGH, f"{heading} {facts}", _RULES)


def _axes(front: Front, x: Scale, y: Scale) -> Iterator[Markup]:
    yield mark("rect", _LEFT, _TOP, _RIGHT - _LEFT, _BASE - _TOP, "axis")
    level = y.at(front.majority)
    yield mark("path", path_of([(_LEFT, level), (_RIGHT, level)]), "majority")
    yield mark("words", _LEFT + 6, level - 4, "majority class", "small")
    for leaves in front.leaves:
        if leaves % 2 == 0:
            word = str(leaves)
            yield mark("words", x.at(leaves), _BASE + 15, word, "small", "middle")
    for part in range(5):
        share = y.low + (y.high - y.low) * part / 4
        word = f"{share:.2f}"
        yield mark("words", _LEFT - 6, y.at(share) + 4, word, "small", "end")
    middle = (_LEFT + _RIGHT) / 2
    yield mark("words", middle, _BASE + 36, "leaves", "small", "middle")
