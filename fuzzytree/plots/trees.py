"""A fuzzy tree as a picture: from the root at the left to its leaves at the right.

Words are measured before anything is placed: each level is as wide as its widest node
and each way between levels as its longest terms, so no two words can meet.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from fuzzytree.plots.labels import SIZE
from fuzzytree.plots.saving import style
from fuzzytree.plots.words import LINE, MARGIN, TITLE, WORD, Sheet, short
from fuzzytree.tree import Branch, FuzzyTree

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
"""Of classes, in their order: told apart by the colour-blind as far as ten can be, and
dark enough for letters. More than ten classes share them; the words tell them apart."""

_ROW = 0.37  # inches for a leaf
_LEAF_HIGH, _NODE_HIGH = 0.25, 0.4
_PAD = 0.09  # between words and the border of a box
_WAY = 0.38  # a way between levels without its words
_TRUNK = 0.14  # from the widest box of a level to where branches turn
_NOTE = 0.19  # a line below the picture
_LONGEST = 34  # letters of a text; what is longer is cut and ends in dots
_LEAST, _MOST = 0.8, 4.5  # points: how thick a branch is
_PARTS = 6  # of a combination that are written
_TINT = 0.13  # how much of the colour of its class a leaf has


@dataclass(slots=True)
class Box:
    """A node or leaf of the picture; places and sizes in inches.

    Attributes:
        texts: The words, in bold, and what stands behind them.
        colour: Of its class; None for a node.
        terms: On the branch that leads to it.
        level: 0 for the root.
        rows: How many training rows reach it, if known.
        below: Where its branches lead.
        x: Its left.
        y: Its middle.
        width: Of the box.
        trunk: Where the branch to it turns.
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
    trunk: float = 0.0


def draw_tree(tree: FuzzyTree, *, title: str | None = None) -> Figure:
    """Draw a tree: what each node asks, the terms of its branches, and the classes.

    A node shows its variable and where it cuts. A leaf shows its class, the pattern if
    the class has several, and how many training rows reached it; where that is known
    of all leaves, a branch is the thicker the more rows took it. Below stand the
    combinations of variables that nodes ask.

    Args:
        tree: At most `MOST_LEAVES` leaves.
        title: Above the picture; the name and size of the tree unless given.

    Returns:
        A figure of its own, outside of any state of the library.

    Raises:
        ValueError: If the tree has more leaves than that.
        MissingExtraError: If matplotlib is not installed.
    """
    if len(tree.leaves) > MOST_LEAVES:
        raise ValueError(
            f"a picture shows at most {MOST_LEAVES} leaves, and {tree.name} has "
            f"{len(tree.leaves)}; learn a smaller tree, or read its rules"
        )
    words = _title(tree) if title is None else title
    notes = [*_notes(tree)]
    boxes = boxes_of(tree)
    with style():
        sheet = Sheet()
        width = _place(boxes, sheet)
        width = max([width, *(sheet.width(note) for note in notes)])
        width = max(width, sheet.width(words, SIZE + 3, bold=True))
        top = MARGIN + (TITLE if words else 0.0)
        end = top + len(tree.leaves) * _ROW
        below = 0.1 + _NOTE * len(notes) if notes else 0.0
        sheet.resize(width + 2.0 * MARGIN, end + below + MARGIN)
        sheet.write_title(words)
        _draw(sheet, boxes, top)
        for number, note in enumerate(notes):
            sheet.write(MARGIN, end + 0.1 + (number + 0.5) * _NOTE, note)
    return sheet.figure


def class_colours(classes: Sequence[str]) -> dict[str, str]:
    """Return a colour for each class, the same in every picture of a model.

    Example:
        >>> class_colours(["circle", "square"])
        {'circle': '#0072b2', 'square': '#c04d00'}
    """
    return {name: COLOURS[k % len(COLOURS)] for k, name in enumerate(classes)}


def boxes_of(tree: FuzzyTree) -> list[Box]:
    """Return all nodes and leaves, depth first, and what is written in them."""
    colours = class_colours(tree.classes)
    is_known = all(leaf.support is not None for leaf in tree.leaves)
    found: list[Box] = []
    first = Branch((), node=1) if tree.nodes else Branch((), leaf=1)
    todo: list[tuple[Branch, Box | None]] = [(first, None)]
    while todo:
        branch, above = todo.pop()
        level = above.level + 1 if above else 0
        terms = _short(" or ".join(branch.terms))
        if branch.node is not None:
            node = tree.nodes[branch.node - 1]
            cuts = ", ".join(f"{cut:.4g}" for cut in node.cuts)
            texts = (_short(f"{node.variable}?"), _short(f"cut at {cuts}"))
            box = Box(texts, None, terms, level, 0 if is_known else None)
            todo.extend((one, box) for one in reversed(node.branches))
        else:
            leaf = tree.leaves[(branch.leaf or 1) - 1]
            name = leaf.pattern or leaf.label
            rows = "" if leaf.support is None else _count(leaf.support)
            box = Box(
                (_short(name), rows), colours[leaf.label], terms, level, leaf.support
            )
        if above:
            above.below.append(box)
        found.append(box)
    for box in reversed(found):
        if box.below and is_known:
            box.rows = sum(one.rows or 0 for one in box.below)
    return found


def _count(rows: int) -> str:
    return "1 row" if rows == 1 else f"{rows:,} rows"


def _short(text: str) -> str:
    return short(text, _LONGEST)


def _title(tree: FuzzyTree) -> str:
    nodes, leaves = len(tree.nodes), len(tree.leaves)
    words = (
        f"{nodes} node{'s' * (nodes != 1)}, {leaves} lea{'f' if leaves == 1 else 'ves'}"
    )
    return f"{_short(tree.name)}: {words}"


def _notes(tree: FuzzyTree) -> Iterator[str]:
    """Yield how each combination that a node asks is made, with three digits."""
    asked = {node.variable for node in tree.nodes}
    for variable in tree.variables:
        parts = variable.parts
        if not parts or variable.name not in asked:
            continue
        terms = [f"{_signed(part.weight)} {_short(part.input)}" for part in parts]
        more = len(terms) - _PARTS
        if more > 0:
            terms[_PARTS:] = [f"and {more} more inputs"]
        offset = math.fsum(-part.weight * part.centre for part in parts)
        terms += [_signed(offset)] * (offset != 0.0)
        shown = " ".join(terms).removeprefix("+ ")
        yield f"{_short(variable.name)} ≈ {shown}"


def _signed(number: float) -> str:
    """Return a number as a summand.

    Example:
        >>> _signed(0.12345), _signed(-2.0)
        ('+ 0.123', '- 2')
    """
    return f"{'+' if number >= 0.0 else '-'} {abs(number):.3g}"


def _place(boxes: Sequence[Box], sheet: Sheet) -> float:
    """Give every box its place and width; return the width of them all."""
    levels = max(box.level for box in boxes) + 1
    wide, ways = [0.0] * levels, [0.0] * levels
    for box in boxes:
        bold = sheet.width(box.texts[0], SIZE, bold=True)
        faint = sheet.width(box.texts[1], SIZE - 1) if box.texts[1] else 0.0
        beside = bold + 1.5 * _PAD * (faint > 0.0) + faint
        inner = max(bold, faint) if box.below else beside
        box.width = inner + 2.0 * _PAD
        wide[box.level] = max(wide[box.level], box.width)
        terms = sheet.width(box.terms, SIZE - 1) if box.terms else 0.0
        ways[box.level] = max(ways[box.level], terms + _WAY)
    starts = [0.0]
    for level in range(1, levels):
        starts.append(starts[-1] + wide[level - 1] + ways[level])
    leaves = 0
    for box in boxes:
        box.x = starts[box.level]
        box.trunk = box.x - ways[box.level] + _TRUNK
        if not box.below:
            box.y = (leaves + 0.5) * _ROW
            leaves += 1
    for box in reversed(boxes):
        if box.below:
            box.y = (box.below[0].y + box.below[-1].y) / 2.0
    return starts[-1] + wide[-1]


def _draw(sheet: Sheet, boxes: Sequence[Box], top: float) -> None:
    for box in boxes:
        box.x, box.trunk = box.x + MARGIN, box.trunk + MARGIN
        box.y += top
    whole = boxes[0].rows or 0
    for box in boxes:
        for child in box.below:
            _draw_branch(sheet, box, child, whole)
    for box in boxes:
        _draw_box(sheet, box)


def _draw_branch(sheet: Sheet, box: Box, child: Box, whole: int) -> None:
    """Draw a branch: out of the node, along its trunk and into the child."""
    thick = _LEAST
    if child.rows is not None and whole:
        thick += (_MOST - _LEAST) * (child.rows / whole) ** 0.5
    sheet.axes.plot(
        [box.x + box.width, child.trunk, child.trunk, child.x],
        [box.y, box.y, child.y, child.y],
        color=LINE,
        linewidth=thick,
        solid_joinstyle="round",
        solid_capstyle="butt",
        zorder=1,
    )
    above = 0.035 + thick / 144.0
    sheet.write(child.trunk + 0.07, child.y - above, child.terms, va="baseline")


def _draw_box(sheet: Sheet, box: Box) -> None:
    from matplotlib.colors import to_rgb
    from matplotlib.patches import FancyBboxPatch

    is_leaf = box.colour is not None
    high = _LEAF_HIGH if is_leaf else _NODE_HIGH
    tint = [1.0 - _TINT * (1.0 - part) for part in to_rgb(box.colour or LINE)]
    sheet.axes.add_patch(
        FancyBboxPatch(
            (box.x, box.y - high / 2.0),
            box.width,
            high,
            boxstyle=f"round,pad=0,rounding_size={high / 2.0 if is_leaf else 0.06}",
            facecolor=tint,
            edgecolor=box.colour or LINE,
            linewidth=1.0,
            zorder=2,
        )
    )
    bold, faint = box.texts
    left = box.x + _PAD
    if is_leaf:
        sheet.write(left, box.y, bold, colour=box.colour or WORD, bold=True)
        sheet.write(box.x + box.width - _PAD, box.y, faint, ha="right")
    else:
        sheet.write(left, box.y - 0.085, bold, colour=WORD, bold=True)
        sheet.write(left, box.y + 0.095, faint)
