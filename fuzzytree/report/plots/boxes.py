"""Where the nodes and leaves of a tree stand in its picture.

Words are measured before anything is placed, so that no two can meet. A tree that is
not too deep runs from its root at the left to its leaves at the right: each level is
as wide as its widest box. A deeper one is an outline: every box has a row of its own,
and stands a step to the right of the node that leads to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from fuzzytree.report.plots.labels import SIZE
from fuzzytree.report.plots.words import Sheet

WIDEST = 14.0
"""Inches; a tree that would be wider is drawn as an outline."""

PAD = 0.09
"""Between words and the border of a box."""

FAINT_SIZE = SIZE - 1.0
"""Of the words behind the bold ones, and of terms."""

_ROW, _OUTLINE_ROW = 0.37, 0.34  # inches for a leaf, and for any box of an outline
_LOW, _HIGH = 0.25, 0.4  # a box of one line, and of two
_WAY = 0.38  # a way between boxes without its words
_TRUNK = 0.14  # from a box to where its branches turn
_WORDS = 0.07  # from there to the words


@dataclass(slots=True)
class Box:
    """A node or leaf of the picture; places and sizes in inches.

    Attributes:
        texts: The words, in bold, and what stands behind or below them.
        colour: Of its class; None for a node.
        terms: On the branch that leads to it.
        level: 0 for the root.
        rows: How many training rows reach it, if known.
        below: Where its branches lead.
        x: Its left.
        y: Its middle, from the top.
        width: Of the box.
        high: The same, upwards.
        way: The corners of the branch that leads to it.
    """

    texts: tuple[str, str]
    colour: str | None
    terms: str
    level: int
    rows: int | None
    below: list[Box] = field(default_factory=list)
    x: float = 0.0
    y: float = 0.0
    width: float = 0.0
    high: float = _LOW
    way: list[tuple[float, float]] = field(default_factory=list)

    @property
    def is_one_line(self) -> bool:
        """Whether the words stand beside each other."""
        return self.high == _LOW

    @property
    def words(self) -> tuple[float, float]:
        """Where the terms of its branch stand: left, and on the branch."""
        return self.way[-2][0] + _WORDS, self.y


def place(boxes: Sequence[Box], sheet: Sheet) -> tuple[float, float]:
    """Give every box its place; return the width and height of them all.

    Args:
        boxes: Depth first, the root first.
        sheet: On which words are measured.
    """
    width, height = _place_levels(boxes, sheet)
    if width > WIDEST:
        return _place_outline(boxes, sheet)
    return width, height


def _place_levels(boxes: Sequence[Box], sheet: Sheet) -> tuple[float, float]:
    levels = max(box.level for box in boxes) + 1
    wide, ways = [0.0] * levels, [0.0] * levels
    for box in boxes:
        _size(box, sheet, high=_HIGH if box.below else _LOW)
        wide[box.level] = max(wide[box.level], box.width)
        ways[box.level] = max(ways[box.level], _way(box, sheet))
    starts = [0.0]
    for level in range(1, levels):
        starts.append(starts[-1] + wide[level - 1] + ways[level])
    leaves = 0
    for box in boxes:
        box.x = starts[box.level]
        if not box.below:
            box.y = (leaves + 0.5) * _ROW
            leaves += 1
    for box in reversed(boxes):
        if box.below:
            box.y = (box.below[0].y + box.below[-1].y) / 2.0
            end, trunk = box.x + box.width, starts[box.level] + wide[box.level] + _TRUNK
            for child in box.below:
                turns = [(trunk, box.y), (trunk, child.y)]
                child.way = [(end, box.y), *turns, (child.x, child.y)]
    return starts[-1] + wide[-1], leaves * _ROW


def _place_outline(boxes: Sequence[Box], sheet: Sheet) -> tuple[float, float]:
    for row, box in enumerate(boxes):
        _size(box, sheet, high=_LOW)
        box.y = (row + 0.5) * _OUTLINE_ROW
    for box in boxes:  # a node stands before all below it
        trunk = box.x + _TRUNK
        step = max((_way(child, sheet) for child in box.below), default=0.0)
        for child in box.below:
            child.x = box.x + step
            child.way = [(trunk, box.y), (trunk, child.y), (child.x, child.y)]
    width = max(box.x + box.width for box in boxes)
    return width, len(boxes) * _OUTLINE_ROW


def _size(box: Box, sheet: Sheet, *, high: float) -> None:
    box.high = high
    bold = sheet.width(box.texts[0], SIZE, bold=True)
    faint = sheet.width(box.texts[1], FAINT_SIZE) if box.texts[1] else 0.0
    beside = bold + 1.5 * PAD * (faint > 0.0) + faint
    box.width = (beside if box.is_one_line else max(bold, faint)) + 2.0 * PAD


def _way(box: Box, sheet: Sheet) -> float:
    """Return how far a box stands from what leads to it."""
    return (sheet.width(box.terms, FAINT_SIZE) if box.terms else 0.0) + _WAY
