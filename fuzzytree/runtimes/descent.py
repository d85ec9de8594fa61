"""Following one path of a tree for many rows, in numpy.

A node of several cuts becomes a balanced cascade of questions `x > cut`. The questions
at the top, which nearly every row meets, are asked of all rows at once and joined to a
one-byte answer, with one wide comparison and at most three byte operations each. The
rows that are not at a leaf by then walk on together, one question a round, and leave
the walk when they arrive. A single row is walked in plain Python.
"""

from __future__ import annotations

import heapq
import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.contracts import IntArray

    Reals = npt.NDArray[np.floating[Any]]
    Bytes = npt.NDArray[np.uint8]

_SMALL = 24  # questions up to which all of them are asked of all rows
_SHARE = 0.08  # of the leaves: what a question at the top must decide to pay
_MOST_EXITS = 255
_LIVE = 0.7  # share of rows still walking below which the others leave
CHUNK = 1 << 14
"""Rows that go through together: their values and answers stay in the cache."""


@dataclass(frozen=True, slots=True)
class Split:
    """A node: interval i of its cuts leads to `targets[i]`.

    Attributes:
        line: The line of its variable.
        cuts: Increasing; interval i is (cuts[i-1], cuts[i]].
        targets: The position of the next split, or -k for leaf k.
    """

    line: int
    cuts: tuple[float, ...]
    targets: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Walk:
    """Questions as parallel lists; the two answers to one stand side by side.

    Attributes:
        line: The line of the variable; 0 at a leaf.
        cut: Asked is `x > cut`; infinity at a leaf.
        child: Where the answer no leads; yes leads one further. A leaf leads to
            itself.
        leaf: The number of the leaf, or 0 for a question.
        weight: How many leaves lie below.
    """

    line: IntArray
    cut: Reals
    child: IntArray
    leaf: IntArray
    weight: IntArray


@dataclass(frozen=True, slots=True)
class Ask:
    """One question of the top: `x > cut`, and what its answers give.

    An answer is a number of a byte, or None: a result on the stack (of `yes` on top).
    """

    line: int
    cut: np.floating[Any]
    no: int | None
    yes: int | None


@dataclass(frozen=True, slots=True)
class Descent:
    """A tree, ready to be descended.

    Attributes:
        splits: The nodes, for a single row; the first is the root, none if there is
            one leaf only.
        walk: The questions.
        top: The questions asked of all rows, in the order of evaluation.
        exits: Where each answer of the top leads: positions in `walk`.
    """

    splits: tuple[Split, ...]
    walk: Walk
    top: tuple[Ask, ...]
    exits: IntArray
    is_whole: bool


def plan_descent(
    splits: Sequence[Split], kind: type[np.float64] | type[np.float32] = np.float64
) -> Descent:
    """Return a tree as lists of questions.

    Args:
        splits: The nodes, a parent before its children; none for a single leaf.
        kind: The type of values and cuts, to which cuts are rounded.
    """
    walk = _plan_walk(splits, kind)
    top, exits = _plan_top(walk)
    return Descent(
        tuple(splits), walk, top, np.array(exits, np.int64), bool(walk.leaf[exits].all())
    )


@dataclass(slots=True)
class _Draft:
    """The lists of a `Walk` while they grow."""

    line: list[int]
    cut: list[float]
    child: list[int]
    leaf: list[int]
    weight: list[int]

    def add(self) -> int:
        """Add a place and return it."""
        for column in (self.line, self.child, self.leaf):
            column.append(0)
        self.cut.append(math.inf)
        self.weight.append(1)
        return len(self.line) - 1

    def copy(self, source: int, place: int) -> None:
        """Make a place ask what another asks: both then lead to the same answers."""
        self.line[place], self.cut[place] = self.line[source], self.cut[source]
        self.child[place], self.weight[place] = self.child[source], self.weight[source]


def _plan_walk(
    splits: Sequence[Split], kind: type[np.float64] | type[np.float32]
) -> Walk:
    """Lay the questions out breadth-first, so that early rounds touch few lines."""
    weights = _leaves_below(splits)
    draft = _Draft([], [], [], [], [])
    draft.add()
    known: dict[int, int] = {}  # a branch may own several intervals of its node
    # A place, and what shall stand there: intervals first to last of a split.
    todo = [(0, 0, 0, len(splits[0].cuts))] if splits else []
    for place, number, first, last in todo:
        split = splits[number]
        if first == last:
            target = split.targets[first]
            if target < 0:
                draft.leaf[place], draft.child[place] = -target, place
            elif target in known:
                draft.copy(known[target], place)
            else:
                todo.append((place, target, 0, len(splits[target].cuts)))
            continue
        if (first, last) == (0, len(split.cuts)):
            if number in known:
                draft.copy(known[number], place)
                continue
            known[number] = place
        middle = (first + last) // 2
        draft.line[place], draft.cut[place] = split.line, split.cuts[middle]
        below = set(split.targets[first : last + 1])
        draft.weight[place] = sum(1 if t < 0 else weights[t] for t in below)
        draft.child[place] = child = draft.add()
        todo.append((child, number, first, middle))
        todo.append((draft.add(), number, middle + 1, last))
    if not splits:
        draft.leaf[0] = 1
    return Walk(
        np.array(draft.line, np.int64),
        np.array(draft.cut, kind),
        np.array(draft.child, np.int64),
        np.array(draft.leaf, np.int64),
        np.array(draft.weight, np.int64),
    )


def _leaves_below(splits: Sequence[Split]) -> list[int]:
    weights = [0] * len(splits)
    for number in range(len(splits) - 1, -1, -1):
        targets = set(splits[number].targets)
        weights[number] = sum(1 if t < 0 else weights[t] for t in targets)
    return weights


def _plan_top(walk: Walk) -> tuple[tuple[Ask, ...], list[int]]:
    """Choose the questions that most leaves lie below; return them and their exits."""
    count = int(np.count_nonzero(walk.leaf == 0))
    least = 0.0 if count <= _SMALL else _SHARE * float(walk.weight[0])
    inner: set[int] = set()
    heap = [(-int(walk.weight[0]), 0)]
    while heap and len(inner) < _MOST_EXITS - 1:
        weight, place = heapq.heappop(heap)
        if -weight < least:
            break
        if walk.leaf[place]:
            continue
        inner.add(place)
        child = int(walk.child[place])
        for below in (child, child + 1):
            heapq.heappush(heap, (-int(walk.weight[below]), below))
    return _order_top(walk, inner)


def _order_top(walk: Walk, inner: set[int]) -> tuple[tuple[Ask, ...], list[int]]:
    """Put the chosen questions in an order in which answers come before their use."""
    asks: list[Ask] = []
    todo: list[tuple[int, bool]] = [(0, False)]
    code: dict[int, int] = {}
    given: dict[int, int] = {}  # an answer that is a constant, until it is used
    visits = min(2 * len(inner), _MOST_EXITS - 1)  # shared places are asked again
    while todo:
        place, is_done = todo.pop()
        child = int(walk.child[place])
        if is_done:
            asks.append(
                Ask(
                    int(walk.line[place]),
                    walk.cut[place],
                    given.pop(child, None),
                    given.pop(child + 1, None),
                )
            )
        elif place not in inner or not visits:
            given[place] = code.setdefault(place, len(code))
        else:
            visits -= 1
            todo += [(place, True), (child + 1, False), (child, False)]
    return tuple(asks), list(code) or [0]


def descend_rows(descent: Descent, lines: Reals, out: IntArray) -> None:
    """Write the number of each row's leaf.

    Args:
        descent: The tree.
        lines: Values of shape (variables, rows); at most `CHUNK` rows or so. Where a
            value is NaN, the leaf is any.
        out: One number for each row.
    """
    walk = descent.walk
    if not descent.top:
        out[:] = walk.leaf[0]
        return
    code = _ask_top(descent.top, lines)
    if descent.is_whole:
        walk.leaf[descent.exits].take(code, out=out, mode="clip")
        return
    places = descent.exits.take(code)
    _walk_on(walk, lines, places)
    walk.leaf.take(places, out=out, mode="clip")


def _ask_top(top: Sequence[Ask], lines: Reals) -> Bytes:
    """Return a byte for each row: which exit of the top it takes."""
    rows = lines.shape[1]
    answer = np.empty(rows, np.bool_)
    bit = answer.view(np.uint8)
    stack: list[Bytes] = []
    spare: list[Bytes] = []
    for ask in top:
        np.greater(lines[ask.line], ask.cut, out=answer)
        if ask.no is not None and ask.yes is not None:
            out = spare.pop() if spare else np.empty(rows, np.uint8)
            np.multiply(bit, np.uint8(ask.no ^ ask.yes), out=out)
            np.bitwise_xor(out, np.uint8(ask.no), out=out)
        elif ask.no is None and ask.yes is None:
            yes, out = stack.pop(), stack.pop()
            np.bitwise_xor(yes, out, out=yes)
            np.multiply(yes, bit, out=yes)
            np.bitwise_xor(out, yes, out=out)
            spare.append(yes)
        else:
            out = stack.pop()
            _mix(out, bit, answer, ask)
        stack.append(out)
    return stack[0]


def _mix(out: Bytes, bit: Bytes, answer: npt.NDArray[np.bool_], ask: Ask) -> None:
    """Put a constant where one answer was given, and keep `out` where the other."""
    constant = np.uint8((ask.yes or 0) if ask.no is None else ask.no)
    np.bitwise_xor(out, constant, out=out)
    if ask.no is None:
        np.logical_not(answer, out=answer)
    np.multiply(out, bit, out=out)
    np.bitwise_xor(out, constant, out=out)


def _walk_on(walk: Walk, lines: Reals, places: IntArray) -> None:
    """Move every place to its leaf, a question a round."""
    flat = lines.ravel()  # no copy: lines are contiguous
    offsets = walk.line * lines.shape[1]
    rows = np.arange(len(places))
    here = places
    is_part = False
    while True:
        where = offsets.take(here)
        where += rows
        yes = flat.take(where) > walk.cut.take(here)
        new = walk.child.take(here, mode="clip")
        new += yes
        moved = new != here
        live = int(np.count_nonzero(moved))
        here = new
        if live == 0:
            break
        if live < _LIVE * len(here):
            places[rows] = here
            keep = np.flatnonzero(moved)
            rows, here = rows.take(keep), here.take(keep)
            is_part = True
    places[rows if is_part else slice(None)] = here


def descend_row(splits: Sequence[Split], row: Sequence[float]) -> int:
    """Return the number of the leaf of one row of finite values, in plain Python.

    Example:
        >>> descend_row([Split(0, (1.0, 2.0), (-1, -2, -1))], [1.5])
        2
    """
    number = 0 if splits else -1
    while number >= 0:
        split = splits[number]
        number = split.targets[bisect_left(split.cuts, row[split.line])]
    return -number
