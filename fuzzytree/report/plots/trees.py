"""A fuzzy tree as a picture: what it asks, its branches and its leaves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from fuzzytree.model.tree import Branch, FuzzyTree
from fuzzytree.report.plots.boxes import FAINT_SIZE, PAD, Box, place
from fuzzytree.report.plots.labels import SIZE
from fuzzytree.report.plots.saving import style
from fuzzytree.report.plots.words import LINE, MARGIN, TITLE, WORD, Sheet, short

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

_LARGEST = 2500.0  # square inches: 400 MB of dots
_NOTE = 0.19  # a line below the picture
_LONGEST = 34  # letters of a text; what is longer is cut and ends in dots
_LEAST, _MOST = 0.8, 4.5  # points: how thick a branch is
_PARTS = 6  # of a combination that are written
_TINT = 0.13  # how much of the colour of its class a leaf has


def draw_tree(tree: FuzzyTree, *, title: str | None = None) -> Figure:
    """Draw a tree: what each node asks, the terms of its branches, and the classes.

    A node shows its variable and where it cuts. A leaf shows its class, the pattern if
    the class has several, and how many training rows reached it; where that is known
    of all leaves, a branch is the thicker the more rows took it. Below stand the
    combinations of variables that nodes ask. A deep tree is drawn as an outline.

    Args:
        tree: At most `MOST_LEAVES` leaves.
        title: Above the picture; the name and size of the tree unless given.

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
    words = _title(tree) if title is None else title
    notes = [*_notes(tree)]
    boxes = boxes_of(tree)
    with style():
        sheet = Sheet()
        width, height = place(boxes, sheet)
        if width * height > _LARGEST:
            raise ValueError(
                f"a picture of {_short(tree.name)} would be {width:.0f} x {height:.0f} "
                "inches; learn a smaller tree, or read its rules"
            )
        width = max([width, *(sheet.width(note) for note in notes)])
        width = max(width, sheet.width(words, SIZE + 3, bold=True))
        top = MARGIN + (TITLE if words else 0.0)
        end = top + height
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


def _draw(sheet: Sheet, boxes: Sequence[Box], top: float) -> None:
    whole = boxes[0].rows or 0
    for box in boxes:
        box.x, box.y = box.x + MARGIN, box.y + top
        box.way = [(x + MARGIN, y + top) for x, y in box.way]
        if box.way:
            _draw_branch(sheet, box, whole)
    for box in boxes:
        _draw_box(sheet, box)


def _draw_branch(sheet: Sheet, box: Box, whole: int) -> None:
    """Draw the branch that leads to a box."""
    thick = _LEAST
    if box.rows is not None and whole:
        thick += (_MOST - _LEAST) * (box.rows / whole) ** 0.5
    right, down = zip(*box.way, strict=True)
    sheet.axes.plot(
        right,
        down,
        color=LINE,
        linewidth=thick,
        solid_joinstyle="round",
        solid_capstyle="butt",
        zorder=1,
    )
    x, y = box.words
    above = y - 0.035 - thick / 144.0
    sheet.write(x, above, box.terms, size=FAINT_SIZE, va="baseline")


def _draw_box(sheet: Sheet, box: Box) -> None:
    from matplotlib.colors import to_rgb
    from matplotlib.patches import FancyBboxPatch

    is_leaf = box.colour is not None
    tint = [1.0 - _TINT * (1.0 - part) for part in to_rgb(box.colour or LINE)]
    sheet.axes.add_patch(
        FancyBboxPatch(
            (box.x, box.y - box.high / 2.0),
            box.width,
            box.high,
            boxstyle=f"round,pad=0,rounding_size={box.high / 2.0 if is_leaf else 0.06}",
            facecolor=tint,
            edgecolor=box.colour or LINE,
            linewidth=1.0,
            zorder=2,
        )
    )
    bold, faint = box.texts
    left, right = box.x + PAD, box.x + box.width - PAD
    colour = box.colour or WORD
    if box.is_one_line:
        sheet.write(left, box.y, bold, colour=colour, bold=True)
        sheet.write(right, box.y, faint, size=FAINT_SIZE, ha="right")
    else:
        sheet.write(left, box.y - 0.085, bold, colour=colour, bold=True)
        sheet.write(left, box.y + 0.095, faint, size=FAINT_SIZE)
