"""A tree as a picture of the page: questions, branches, and the rows that pass."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import msgspec

from fuzzytree.model import FuzzyTree, Node
from fuzzytree.report.audit_rows import Counts, Passing
from fuzzytree.report.drawing import LETTER, Markup, cut, rect, svg, tag, words
from fuzzytree.report.text import counted, number, taken

MOST_LEAVES = 120
"""Of a tree that is drawn; a larger one is printed as an outline."""

WIDE, HIGH = 176.0, 52.0
"""Of a box, in points."""

_ACROSS, _DOWN = 60.0, 26.0  # between boxes
EDGE = 8.0
"""Around a picture, in points."""

_LEAST, _MOST = 1.5, 9.0  # points: how thick a branch is
_PALETTE = 10


class Box(msgspec.Struct):
    """A node or a leaf, the branch that leads to it, and where it stands.

    The code is the number of a leaf's class, None for a node; the counts are the rows
    that reach it by class, empty if they are not known; its middle is in points below
    the top.
    """

    level: int
    title: str
    note: str
    branch: str = ""
    code: int | None = None  # of the class of a leaf
    counts: Counts = ()
    middle: float = 0.0
    above: Box | None = None
    below: list[Box] = msgspec.field(default_factory=lambda: [])

    @property
    def left(self) -> float:
        """How far from the left it begins, in points."""
        return EDGE + self.level * (WIDE + _ACROSS)


def tree_picture(tree: FuzzyTree, rows: Passing | None) -> Markup:
    """Return a tree from left to right.

    A box holds a bar: the rows that pass, by their class; without rows the training
    rows of the leaves behind it, by the leaves' class. A branch is the thicker the
    more of them take it.
    """
    boxes = boxes_of(tree, rows)
    high = placed(boxes)
    wide = max(box.left for box in boxes) + WIDE + EDGE
    whole = sum(boxes[0].counts)
    drawn = [_branch(box, whole) for box in boxes if box.above is not None]
    drawn += [_drawn(box) for box in boxes]
    nodes = counted(len(tree.nodes), "node")
    leaves = counted(len(tree.leaves), "leaf", "leaves")
    return svg(
        wide,
        high,
        f"The tree {tree.name}: {nodes}, {leaves}",
        "From left to right: each box tests one variable, each branch takes a part of "
        "its values, and each rounded box is a class; the same as an outline follows",
        *drawn,
        name="tree",
    )


def class_mark(code: int) -> str:
    """Return the name of a class's colour in the page's style."""
    return f"k{code % _PALETTE}"


def boxes_of(tree: FuzzyTree, rows: Passing | None) -> list[Box]:
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
            box.counts = rows.nodes[node - 1] if rows else ()
            todo += [
                (one.node, one.leaf, _branch_words(tested, place), box)
                for place, one in reversed([*enumerate(tested.branches)])
            ]
        else:
            position = leaf or 1
            end = tree.leaves[position - 1]
            box = Box(level, end.pattern or end.label, "", branch, codes[end.label])
            if rows:
                box.counts = rows.leaves[position - 1]
            elif end.support is not None:
                box.counts = tuple(
                    end.support * (code == box.code) for code in codes.values()
                )
            reached = counted(sum(box.counts), "row") if box.counts else ""
            box.note = f"rule {position}" + (f", {reached}" if reached else "")
        box.above = above
        if above:
            above.below.append(box)
        boxes.append(box)
    _add_up(boxes)
    return boxes


def _add_up(boxes: Sequence[Box]) -> None:
    """Give each node without counts those of the leaves behind it."""
    for box in reversed(boxes):
        if not box.counts and box.below and all(one.counts for one in box.below):
            columns = zip(*(one.counts for one in box.below), strict=True)
            box.counts = tuple(map(sum, columns))


def _branch_words(node: Node, place: int) -> str:
    return f"{' or '.join(node.branches[place].terms)}: {taken(node, place, '≤')}"


def placed(boxes: Sequence[Box]) -> float:
    """Put leaves below one another and nodes in their middle; return the height."""
    down = EDGE + 14.0
    for box in boxes:
        if not box.below:
            box.middle = down + HIGH / 2.0
            down += HIGH + _DOWN
    for box in reversed(boxes):
        if box.below:
            box.middle = (box.below[0].middle + box.below[-1].middle) / 2.0
    return down - _DOWN + EDGE


def _branch(box: Box, whole: int) -> Markup:
    above = box.above
    assert above is not None  # the root has no branch
    share = sum(box.counts) / whole if whole else 0.0
    start, end = above.left + WIDE, box.left
    bend = (start + end) / 2.0
    way = f"M{start:.1f} {above.middle:.1f}C{bend:.1f} {above.middle:.1f} "
    way += f"{bend:.1f} {box.middle:.1f} {end:.1f} {box.middle:.1f}"
    thick = _LEAST + (_MOST - _LEAST) * share
    return tag("path", d=way, class_="branch", stroke_width=thick)


def _drawn(box: Box) -> Markup:
    left, top = box.left, box.middle - HIGH / 2.0
    is_leaf = box.code is not None
    mark = class_mark(box.code or 0) if is_leaf else ""
    room = (WIDE - 20.0) / (LETTER * 13.0)
    said = [box.branch, box.title, box.note, _counts_text(box.counts)]
    return tag(
        "g",
        tag("title", "; ".join(filter(None, said))),
        tag(
            "rect",
            x=left,
            y=top,
            width=WIDE,
            height=HIGH,
            rx=14.0 if is_leaf else 4.0,
            class_=f"box {mark}".rstrip(),
        ),
        words(left + 2, top - 6, cut(box.branch, WIDE / 6.1), "small"),
        words(left + 10, top + 18, cut(box.title, room), f"strong {mark}".rstrip()),
        words(left + 10, top + 33, cut(box.note, WIDE / 6.4), "small"),
        *_bar(box.counts, left + 10, top + 40, WIDE - 20),
    )


def _counts_text(counts: Counts) -> str:
    return f"rows by class: {', '.join(map(str, counts))}" if counts else ""


def _bar(counts: Counts, left: float, top: float, wide: float) -> Iterator[Markup]:
    """Yield the parts of a bar, the rows of each class."""
    whole = sum(counts)
    yield rect(left, top, wide, 6.0, "track")
    for code, count in enumerate(counts):
        if count:
            part = wide * count / whole
            mark = class_mark(code)
            yield rect(left, top, max(part - 0.6, 0.6), 6.0, f"bar {mark}")
            left += part
