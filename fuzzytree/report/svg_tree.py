"""A tree as a picture, on a page or alone: questions, branches, rows that pass."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import msgspec

from fuzzytree.model import Document
from fuzzytree.report.audit_rows import Counts, Passing
from fuzzytree.report.drawing import (
    EDGE,
    LOOKS,
    Sheet,
    legend,
    listing,
    text_block,
    text_width,
)
from fuzzytree.report.markup import Markup, mark
from fuzzytree.report.models import branch_text
from fuzzytree.report.pictures import Picture, class_mark
from fuzzytree.report.svg_terms import sum_words
from fuzzytree.report.text import counted

MOST_LEAVES = 200
"""Of a tree that is drawn; the page prints a larger one as an outline."""

_LEAST_WIDE, _MOST_WIDE = 100.0, 230.0  # of a box, in points; longer words are wrapped
_ACROSS, _DOWN = 44.0, 11.0  # between boxes
_INSIDE = 10.0  # around the words of a box
_LEAST, _MOST = 1.5, 9.0  # points: how thick a branch is
_MOST_CLASSES = 3  # whose rows a leaf names
_ABOUT = (
    "From left to right: each box tests one variable, each branch takes a part of "
    "its values, and each rounded box is a class"
)


class Box(msgspec.Struct):
    """A node or a leaf, the branch that leads to it, and where it stands.

    The code is the number of a leaf's class, None for a node; the rows are those that
    reach it, and the counts are these by class, where they are known. `span` is the
    height that it takes with all below it.
    """

    level: int
    title: str
    note: str
    branch: str = ""
    code: int | None = None  # of the class of a leaf
    rows: int | None = None
    counts: Counts = ()
    left: float = 0.0
    top: float = 0.0
    wide: float = 0.0
    lead: float = 0.0  # the height of the words of its branch
    high: float = 0.0
    span: float = 0.0
    marks: list[Markup] = []
    above: Box | None = None
    below: list[Box] = []

    @property
    def middle(self) -> float:
        """How far its middle is from the top of the tree."""
        return self.top + self.lead + self.high / 2.0


def tree_picture(tree: Document, rows: Passing | None) -> Markup:
    """Return a tree from left to right.

    With rows, a box holds a bar: the rows that pass, by their class; without them it
    is that of the training rows, where their classes are known. A branch is the
    thicker the more rows take it.
    """
    marks, wide, high = _tree_marks(boxes_of(tree, rows))
    title = f"The tree {_size_text(tree)}"
    marks = [mark("group", marks, move=f"translate({EDGE} {EDGE})")]
    return mark("svg", wide + 2 * EDGE, high + 2 * EDGE, "tree", title, _ABOUT, marks)


def draw_tree(tree: Document, *, title: str | None = None) -> Picture:
    """Draw a tree of at most `MOST_LEAVES` leaves, all names whole.

    A box shows how many training rows reached it, and a bar of these by class; where
    that is known of all leaves, a branch is the thicker the more rows took it. Below
    the tree stand the combinations of variables that nodes test.
    """
    if len(tree.leaves) > MOST_LEAVES:
        raise ValueError(
            f"a picture shows at most {MOST_LEAVES} leaves, and {tree.name} has "
            f"{len(tree.leaves)}; learn a smaller tree, or read its rules"
        )
    boxes = boxes_of(tree, None)
    marks, wide, high = _tree_marks(boxes)
    title = _size_text(tree) if title is None else title
    least = min(text_width(title, LOOKS["strong"][0]), 2 * _MOST_WIDE)
    sheet = Sheet(max(wide, least), title)
    if boxes[0].counts:
        signs = [
            (mark("rect", 0, -9, 18, 9, f"bar {class_mark(code)}"), f"rows of {label}")
            for code, label in enumerate(tree.classes)
        ]
        sheet.row([legend(signs, sheet.inside)])
    sheet.row([(marks, high + _DOWN)])
    names = {node.variable for node in tree.nodes}
    for variable in tree.variables:
        if variable.name in names:
            sheet.words(sum_words(variable, tree.variables))
    return sheet.picture(_ABOUT)


def _size_text(tree: Document) -> str:
    nodes = counted(len(tree.nodes), "node")
    return f"{tree.name}: {nodes}, {counted(len(tree.leaves), 'leaf', 'leaves')}"


def _tree_marks(boxes: Sequence[Box]) -> tuple[list[Markup], float, float]:
    """Return boxes with their branches, and the width and height of all."""
    arrange(boxes)
    wide = max(box.left + box.wide for box in boxes)
    whole = boxes[0].rows or 0
    marks = [_branch(box, whole) for box in boxes if box.above is not None]
    for box in boxes:
        counts = ", ".join(map(str, box.counts))
        counts = f"rows by class: {counts}" if counts else ""
        about = "; ".join(filter(None, [box.branch, box.title, box.note, counts]))
        move = f"translate({box.left:.1f} {box.top:.1f})"
        marks.append(mark("group", box.marks, about, move))
    return marks, wide, boxes[0].span - _DOWN


def boxes_of(tree: Document, rows: Passing | None) -> list[Box]:
    """Return all nodes and leaves, depth first; `arrange` puts them in their places."""
    codes = {label: code for code, label in enumerate(tree.classes)}
    known = {one.name: one for one in tree.variables}
    boxes: list[Box] = []
    todo: list[tuple[int | None, int | None, str, Box | None]]
    todo = [(1, None, "", None) if tree.nodes else (None, 1, "", None)]
    while todo:
        node, leaf, branch, above = todo.pop()
        level = above.level + 1 if above else 0
        if node is not None:
            tested = tree.nodes[node - 1]
            box = Box(level, f"{tested.variable}?", "", branch)
            box.counts = rows.nodes[node - 1] if rows else ()
            of = known[tested.variable]
            for place, way in reversed([*enumerate(tested.branches)]):
                words = branch_text(of, tested, place, "{}: {}", "≤")
                todo.append((way.node, way.leaf, words, box))
        else:
            position = leaf or 1
            end = tree.leaves[position - 1]
            box = Box(level, end.label, f"rule {position}", branch, codes[end.label])
            box.rows = end.support
            box.counts = rows.leaves[position - 1] if rows else end.counts
        box.above = above
        if above:
            above.below.append(box)
        boxes.append(box)
    for box in reversed(boxes):  # what is not known of a node its leaves show
        if not box.counts and box.below and all(below.counts for below in box.below):
            columns = zip(*(below.counts for below in box.below), strict=True)
            box.counts = tuple(map(sum, columns))
        reached = [below.rows for below in box.below if below.rows is not None]
        if box.counts:
            box.rows = sum(box.counts)
        elif box.rows is None and box.below and len(reached) == len(box.below):
            box.rows = sum(reached)
        if box.rows is not None:
            box.note += f"{', ' if box.note else ''}{counted(box.rows, 'row')}"
        if box.code is not None:
            box.note += _classes_text(box.counts, tree.classes)
    return boxes


def _classes_text(counts: Counts, classes: Sequence[str]) -> str:
    """Return the rows of the largest classes of a leaf, if there are several."""
    order = sorted(range(len(counts)), key=lambda code: -counts[code])
    names = [*classes, "no class"]
    shown = [f"{counts[k]} {names[k]}" for k in order if counts[k]]
    if len(shown) < 2:
        return ""
    rest = sum(counts[k] for k in order[_MOST_CLASSES:])
    more = [f"{rest} of other classes"] if rest else []
    return f": {', '.join([*shown[:_MOST_CLASSES], *more])}"


def arrange(boxes: Sequence[Box]) -> None:
    """Put boxes of one level below one another, each beside the middle of what follows.

    A level is as wide as its words, within bounds; in these words are wrapped.
    """
    left = 0.0
    for level in range(max(box.level for box in boxes) + 1):
        column = [box for box in boxes if box.level == level]
        wide = _LEAST_WIDE
        for box in column:
            words = {"strong": box.title, "small": box.note}
            sizes = [text_width(text, LOOKS[look][0]) for look, text in words.items()]
            branch = text_width(box.branch, LOOKS["small"][0])
            wide = max(wide, branch, max(sizes) + 2 * _INSIDE)
        for box in column:
            box.left, box.wide = left, min(wide, _MOST_WIDE)
            _fill(box)
        left += column[0].wide + _ACROSS
    for box in reversed(boxes):
        spans = [below.span for below in box.below]
        box.span = max(box.lead + box.high + _DOWN, sum(spans))
    for box in boxes:  # at first `top` is where what it takes begins
        start = box.top + (box.span - sum(below.span for below in box.below)) / 2.0
        for below in box.below:
            below.top, start = start, start + below.span
        box.top += (box.span - box.lead - box.high - _DOWN) / 2.0


def _fill(box: Box) -> None:
    """Make the marks of a box of known width, below the words of its branch."""
    own = "" if box.code is None else f" {class_mark(box.code)}"
    inside = box.wide - 2 * _INSIDE
    branch, high = text_block(2.0, 0.0, box.branch, box.wide)
    box.lead = high + 3.0 if branch else 0.0
    title, high = text_block(_INSIDE, box.lead + 4.0, box.title, inside, f"strong{own}")
    words = listing(box.note.split(", "), ",")
    note, more = text_block(_INSIDE, box.lead + high + 3.0, words, inside)
    under = box.lead + high + more + 6.0
    bar = [*_bar(box.counts, _INSIDE, under, inside)]
    box.high = under - box.lead + (12.0 if bar else 3.0)
    edge = mark("rect", 0, box.lead, box.wide, box.high, f"box{own}", 14 if own else 4)
    box.marks = [edge, *branch, *title, *note, *bar]


def _branch(box: Box, whole: int) -> Markup:
    above = box.above
    assert above is not None  # the root has no branch
    share = (box.rows or 0) / whole if whole else 0.0
    start, end = above.left + above.wide, box.left
    bend = (start + end) / 2.0
    way = f"M{start:.1f} {above.middle:.1f}C{bend:.1f} {above.middle:.1f} "
    way += f"{bend:.1f} {box.middle:.1f} {end:.1f} {box.middle:.1f}"
    thick = _LEAST + (_MOST - _LEAST) * share
    return mark("branch", way, thick)


def _bar(counts: Counts, left: float, top: float, wide: float) -> Iterator[Markup]:
    """Yield the parts of a bar, the rows of each class; none if they are unknown."""
    whole = sum(counts)
    if counts:
        yield mark("rect", left, top, wide, 6.0, "track")
    for code, count in enumerate(counts):
        if count:
            part = wide * count / whole
            look = f"bar {class_mark(code)}"
            yield mark("rect", left, top, max(part - 0.6, 0.6), 6.0, look)
            left += part
