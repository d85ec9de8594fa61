"""A tree as a picture, on a page or alone: questions, branches, rows that pass."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import msgspec

from fuzzytree.model import Document, Node
from fuzzytree.report.audit_rows import Counts, Passing
from fuzzytree.report.drawing import LETTER, cut
from fuzzytree.report.markup import Markup, mark
from fuzzytree.report.models import sum_text, taken
from fuzzytree.report.pictures import Picture, picture
from fuzzytree.report.text import counted, number

MOST_LEAVES = 200
"""Of a tree that is drawn; the page prints a larger one as an outline."""

_WIDE, _HIGH = 176.0, 52.0  # of a box, in points
_ACROSS, _DOWN = 60.0, 26.0  # between boxes
_EDGE = 8.0  # around a picture
_LINE = 20.0  # of words above or below a tree
_LEAST, _MOST = 1.5, 9.0  # points: how thick a branch is
_PALETTE = (
    *("#0072b2", "#c04d00", "#00795a", "#a3407f", "#7a6000"),
    *("#5b4db2", "#b3261e", "#00788a", "#5f6b1f", "#57606a"),
)  # of classes, in their order; more than ten classes share them
_STYLE = """
.box { fill: #ffffff; stroke: #595d66; stroke-width: 1.5; }
.branch { fill: none; stroke: #c8cacd; }
.track { fill: #efefeb; }
"""  # of a picture in a file of its own


class Box(msgspec.Struct):
    """A node or a leaf, the branch that leads to it, and where it stands.

    The code is the number of a leaf's class, None for a node; the rows are those that
    reach it, and the counts are these by class, where they are known; its middle is in
    points below the top.
    """

    level: int
    title: str
    note: str
    branch: str = ""
    code: int | None = None  # of the class of a leaf
    rows: int | None = None
    counts: Counts = ()
    middle: float = 0.0
    above: Box | None = None
    below: list[Box] = msgspec.field(default_factory=lambda: [])

    @property
    def left(self) -> float:
        """How far from the left it begins, in points."""
        return _EDGE + self.level * (_WIDE + _ACROSS)


def tree_picture(tree: Document, rows: Passing | None) -> Markup:
    """Return a tree from left to right.

    With rows, a box holds a bar: the rows that pass, by their class. A branch is the
    thicker the more rows take it; without rows, the more training rows.
    """
    drawn, wide, high = _laid(boxes_of(tree, rows))
    desc = (
        "From left to right: each box tests one variable, each branch takes a part of "
        "its values, and each rounded box is a class; the same as an outline follows"
    )
    return mark("svg", wide, high, "tree", f"The tree {_size_text(tree)}", desc, drawn)


def draw_tree(tree: Document, *, title: str | None = None) -> Picture:
    """Draw a tree: the variable of each node, the terms of its branches, the classes.

    A node shows its variable and its cuts. A leaf shows its class, and how many
    training rows reached it; where that is known of all leaves, a branch is the thicker
    the more rows took it. Below the tree stand the
    combinations of variables that nodes test.

    Args:
        tree: At most `MOST_LEAVES` leaves.
        title: Above the picture; by default the name and size of the tree.

    Raises:
        ValueError: If the tree has more leaves than that.
    """
    if len(tree.leaves) > MOST_LEAVES:
        raise ValueError(
            f"a picture shows at most {MOST_LEAVES} leaves, and {tree.name} has "
            f"{len(tree.leaves)}; learn a smaller tree, or read its rules"
        )
    drawn, wide, high = _laid(boxes_of(tree, None))
    said = _size_text(tree) if title is None else title
    used = {node.variable for node in tree.nodes}
    notes = [
        f"{one.name} = {sum_text(one.parts)}"
        for one in tree.variables
        if one.parts and one.name in used
    ]
    wide = max([wide, *(LETTER * 14 * min(len(one), 400) for one in (said, *notes))])
    colours = "".join(
        f".box.k{k} {{ stroke: {colour}; }}\n"
        f".bar.k{k}, .strong.k{k} {{ fill: {colour}; }}\n"
        for k, colour in enumerate(_PALETTE)
    )
    marks = [
        mark("words", _EDGE, _LINE, said, "strong"),
        mark("group", drawn, move=f"translate(0 {_LINE:.0f})"),
        *(
            mark("words", _EDGE, high + _LINE * (k + 1.5), note, "small")
            for k, note in enumerate(notes)
        ),
    ]
    return picture(marks, wide, high + _LINE * (len(notes) + 1), said, _STYLE + colours)


def _size_text(tree: Document) -> str:
    nodes = counted(len(tree.nodes), "node")
    return f"{tree.name}: {nodes}, {counted(len(tree.leaves), 'leaf', 'leaves')}"


def _laid(boxes: Sequence[Box]) -> tuple[list[Markup], float, float]:
    """Return boxes with their branches, and the width and height of all."""
    high = placed(boxes)
    wide = max(box.left for box in boxes) + _WIDE + _EDGE
    whole = boxes[0].rows or 0
    drawn = [_branch(box, whole) for box in boxes if box.above is not None]
    return [*drawn, *map(_drawn, boxes)], wide, high


def class_mark(code: int) -> str:
    """Return the name of a class's colour in the page's style."""
    return f"k{code % len(_PALETTE)}"


def boxes_of(tree: Document, rows: Passing | None) -> list[Box]:
    """Return all nodes and leaves, depth first; `placed` puts them in their places."""
    codes = {label: code for code, label in enumerate(tree.classes)}
    boxes: list[Box] = []
    todo: list[tuple[int | None, int | None, str, Box | None]]
    todo = [(1, None, "", None) if tree.nodes else (None, 1, "", None)]
    while todo:
        node, leaf, branch, above = todo.pop()
        level = above.level + 1 if above else 0
        if node is not None:
            tested = tree.nodes[node - 1]
            cuts = ", ".join(map(number, tested.cuts))
            box = Box(level, f"{tested.variable}?", f"cut at {cuts}", branch)
            if rows:
                _count(box, rows.nodes[node - 1])
            todo += [
                (one.node, one.leaf, _branch_words(tested, place), box)
                for place, one in reversed([*enumerate(tested.branches)])
            ]
        else:
            position = leaf or 1
            end = tree.leaves[position - 1]
            box = Box(level, end.label, "", branch, codes[end.label])
            box.rows = end.support
            if rows:
                _count(box, rows.leaves[position - 1])
            box.note = ", ".join(filter(None, [f"rule {position}", _rows_text(box)]))
        box.above = above
        if above:
            above.below.append(box)
        boxes.append(box)
    for box in reversed(boxes):  # what is not known of a node its leaves show
        reached = [below.rows for below in box.below if below.rows is not None]
        if box.rows is None and box.below and len(reached) == len(box.below):
            box.rows = sum(reached)
    return boxes


def _count(box: Box, counts: Counts) -> None:
    box.rows, box.counts = sum(counts), counts


def _branch_words(node: Node, place: int) -> str:
    return f"{' or '.join(node.branches[place].terms)}: {taken(node, place, '≤')}"


def placed(boxes: Sequence[Box]) -> float:
    """Put leaves below one another and nodes in their middle; return the height."""
    down = _EDGE + 14.0
    for box in boxes:
        if not box.below:
            box.middle = down + _HIGH / 2.0
            down += _HIGH + _DOWN
    for box in reversed(boxes):
        if box.below:
            box.middle = (box.below[0].middle + box.below[-1].middle) / 2.0
    return down - _DOWN + _EDGE


def _branch(box: Box, whole: int) -> Markup:
    above = box.above
    assert above is not None  # the root has no branch
    share = (box.rows or 0) / whole if whole else 0.0
    start, end = above.left + _WIDE, box.left
    bend = (start + end) / 2.0
    way = f"M{start:.1f} {above.middle:.1f}C{bend:.1f} {above.middle:.1f} "
    way += f"{bend:.1f} {box.middle:.1f} {end:.1f} {box.middle:.1f}"
    thick = _LEAST + (_MOST - _LEAST) * share
    return mark("branch", way, thick)


def _drawn(box: Box) -> Markup:
    left, top = box.left, box.middle - _HIGH / 2.0
    is_leaf = box.code is not None
    own = f" {class_mark(box.code or 0)}" if is_leaf else ""
    rx = 14.0 if is_leaf else 4.0
    room = (_WIDE - 20.0) / (LETTER * 13.0)
    rows = "" if is_leaf else _rows_text(box)
    counts = ", ".join(map(str, box.counts))
    counts = f"rows by class: {counts}" if counts else ""
    title = [box.branch, box.title, box.note, rows, counts]
    marks = [
        mark("rect", left, top, _WIDE, _HIGH, f"box{own}", rx),
        mark("words", left + 2, top - 6, cut(box.branch, _WIDE / 6.1), "small"),
        mark("words", left + 10, top + 18, cut(box.title, room), f"strong{own}"),
        mark("words", left + 10, top + 33, cut(box.note, _WIDE / 6.4), "small"),
        *_bar(box.counts, left + 10, top + 40, _WIDE - 20),
    ]
    return mark("group", marks, "; ".join(filter(None, title)))


def _rows_text(box: Box) -> str:
    return "" if box.rows is None else counted(box.rows, "row")


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
