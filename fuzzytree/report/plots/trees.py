"""A fuzzy tree as a figure: the boxes of the audit's page, drawn by matplotlib."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from fuzzytree.model import FuzzyTree
from fuzzytree.report.plots.sheet import (
    LINE,
    MARGIN,
    SIZE,
    TITLE,
    WORD,
    Sheet,
    short,
    style,
)
from fuzzytree.report.svg_tree import EDGE, HIGH, WIDE, Box, boxes_of, placed
from fuzzytree.report.text import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_LEAVES = 200
"""The most leaves in a picture; about 40 can be read on a screen."""

COLOURS = (
    "#0072b2",
    "#c04d00",
    "#00795a",
    "#a3407f",
    "#7a6000",
    "#5b4db2",
    "#b3261e",
    "#00788a",
    "#5f6b1f",
    "#57606a",
)
"""Of classes, in their order; more than ten classes share them."""

_LARGEST = 2500.0  # square inches: 400 MB of dots
_NOTE = 0.19  # inches: a line below the picture
_LONGEST = 28  # letters of a text; what is longer is cut and ends in dots
_LEAST, _MOST = 0.8, 4.5  # points: how thick a branch is
_PARTS = 6  # of a combination that are written
_POINTS = 72.0  # of an inch


def draw_tree(tree: FuzzyTree, *, title: str | None = None) -> Figure:
    """Draw a tree: the variable of each node, the terms of its branches, the classes.

    A node shows its variable and its cuts. A leaf shows its class, the pattern if the
    class has several, and how many training rows reached it; where that is known of
    all leaves, a branch is the thicker the more rows took it. Below the tree stand the
    combinations of variables that nodes test.

    Args:
        tree: At most `MOST_LEAVES` leaves.
        title: Above the picture; by default the name and size of the tree.

    Returns:
        A figure of its own, outside of any state of the library.

    Raises:
        ValueError: If the tree has more leaves than that, or is so deep that its
            picture would be larger than 50 x 50 inches.
        MissingExtraError: If matplotlib is not installed.
    """
    if len(tree.leaves) > MOST_LEAVES:
        raise ValueError(
            f"a picture shows at most {MOST_LEAVES} leaves, and {tree.name} has "
            f"{len(tree.leaves)}; learn a smaller tree, or read its rules"
        )
    leaves = counted(len(tree.leaves), "leaf", "leaves")
    size = f"{counted(len(tree.nodes), 'node')}, {leaves}"
    words = f"{short(tree.name, _LONGEST)}: {size}" if title is None else title
    notes = [*_notes(tree)]
    boxes = boxes_of(tree, None)
    height = placed(boxes) / _POINTS
    width = (max(box.left for box in boxes) + WIDE + EDGE) / _POINTS
    if width * height > _LARGEST:
        raise ValueError(
            f"a picture of {short(tree.name, _LONGEST)} would be {width:.0f} x "
            f"{height:.0f} inches; learn a smaller tree, or read its rules"
        )
    with style():
        sheet = Sheet()
        widths = [sheet.width(note) + 2.0 * MARGIN for note in notes]
        widths.append(sheet.width(words, SIZE + 3, bold=True) + 2.0 * MARGIN)
        top = MARGIN + (TITLE if words else 0.0)
        end = top + height
        sheet.resize(max(width, *widths), end + _NOTE * len(notes) + MARGIN)
        sheet.write_title(words)
        for box in boxes:
            _draw_branch(sheet, box, top, sum(boxes[0].counts))
            _draw_box(sheet, box, top)
        for number, note in enumerate(notes):
            sheet.write(MARGIN, end + (number + 0.5) * _NOTE, note)
    return sheet.figure


def _notes(tree: FuzzyTree) -> Iterator[str]:
    """Yield how each combination that a node tests is computed, with three digits."""
    used = {node.variable for node in tree.nodes}
    for variable in tree.variables:
        parts = variable.parts
        if not parts or variable.name not in used:
            continue
        terms = [f"{_signed(one.weight)} {short(one.input, _LONGEST)}" for one in parts]
        more = len(terms) - _PARTS
        if more > 0:
            terms[_PARTS:] = [f"and {more} more inputs"]
        offset = math.fsum(-part.weight * part.centre for part in parts)
        terms += [_signed(offset)] * (offset != 0.0)
        shown = " ".join(terms).removeprefix("+ ")
        yield f"{short(variable.name, _LONGEST)} ≈ {shown}"


def _signed(number: float) -> str:
    """Return a number as a summand.

    Example:
        >>> _signed(0.12345), _signed(-2.0)
        ('+ 0.123', '- 2')
    """
    return f"{'+' if number >= 0.0 else '-'} {abs(number):.3g}"


def _draw_branch(sheet: Sheet, box: Box, top: float, whole: int) -> None:
    """Draw the branch that leads to a box."""
    if box.above is None:
        return
    thick = _LEAST
    if box.counts and whole:
        thick += (_MOST - _LEAST) * (sum(box.counts) / whole) ** 0.5
    start, end = (box.above.left + WIDE) / _POINTS, box.left / _POINTS
    high, low = top + box.above.middle / _POINTS, top + box.middle / _POINTS
    middle = (start + end) / 2.0
    sheet.axes.plot(
        [start, middle, middle, end],
        [high, high, low, low],
        color=LINE,
        linewidth=thick,
        solid_joinstyle="round",
        zorder=1,
    )


def _draw_box(sheet: Sheet, box: Box, top: float) -> None:
    from matplotlib.colors import to_rgb
    from matplotlib.patches import FancyBboxPatch

    is_leaf = box.code is not None
    colour = COLOURS[(box.code or 0) % len(COLOURS)] if is_leaf else LINE
    left, width, high = box.left / _POINTS, WIDE / _POINTS, HIGH / _POINTS
    begin = top + box.middle / _POINTS - high / 2.0
    sheet.axes.add_patch(
        FancyBboxPatch(
            (left, begin),
            width,
            high,
            boxstyle=f"round,pad=0,rounding_size={0.2 if is_leaf else 0.06}",
            facecolor=[1.0 - 0.13 * (1.0 - part) for part in to_rgb(colour)],
            edgecolor=colour,
            zorder=2,
        )
    )
    title, note, branch = (
        short(text, _LONGEST) for text in (box.title, box.note, box.branch)
    )
    ink = colour if is_leaf else WORD
    sheet.write(left + 0.12, begin + 0.24, title, color=ink, fontweight="bold")
    sheet.write(left + 0.12, begin + 0.5, note, fontsize=SIZE - 1.0)
    sheet.write(left + 0.03, begin - 0.09, branch, fontsize=SIZE - 1.0)
