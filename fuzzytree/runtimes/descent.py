"""Following one path of a tree for many rows, in numpy.

A node of several cuts becomes a balanced cascade of tests `x > cut`. The tests at the
top, which nearly every row meets, are evaluated on all rows at once and joined to a
one-byte result, with one wide comparison and at most three byte operations each. The
rows that are not at a leaf by then walk on together, one test a round, and leave the
walk when they arrive. A single row is walked in plain Python.

Of a tree with many combinations a row meets few: there each node computes its own
variable, and only in the rows that reach it.
"""

from __future__ import annotations

import heapq
import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.model import Dtype, FloatArray, FuzzyTree, IntArray, Outcome, Run
from fuzzytree.runtimes.degrees import NUMBERS
from fuzzytree.runtimes.rows import (
    Axes,
    Chains,
    axis_lines,
    axis_row,
    axis_values,
    chain_value,
    checked,
    input_lines,
    input_row,
    known_rows,
    missing_rows,
    plan_axes,
)

if TYPE_CHECKING:
    import numpy.typing as npt

    Real = np.dtype[np.floating[Any]]
    Reals = npt.NDArray[np.floating[Any]]
    Bytes = npt.NDArray[np.uint8]

_SMALL = 24  # tests up to which all of them are evaluated on all rows
_SHARE = 0.05  # of the leaves: what a test at the top must decide to pay
_MOST_EXITS = 255
_LIVE = 0.6  # share of rows still walking below which the others leave
_FEW_CHAINS = 32  # combinations up to which all of them are computed in all rows
_NODE_COST = 12_000  # of a visit to a node, in parts of a combination of one row
CHUNK = 1 << 16
"""Rows that go through together: their values and answers stay in the cache."""


@dataclass(frozen=True, slots=True)
class AxisSplit:
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
    """Tests and leaves at numbered places, breadth-first, a list for each field.

    Attributes:
        line: The line of the variable; any at a leaf.
        cut: The test is `x > cut`; infinity at a leaf.
        child: The place that no leads to; yes leads to the one after it. A leaf leads
            to itself.
        leaf: The number of the leaf, or 0 at a test.
        sure: How many tests nearly every row meets after those of the top.
    """

    line: IntArray
    cut: Reals
    child: IntArray
    leaf: IntArray
    sure: int


@dataclass(frozen=True, slots=True)
class CutTest:
    """One test of the top: `x > cut`, and what its results give.

    Attributes:
        line: The line of its variable.
        cut: Of no dimension, as the others: numpy takes such arrays fastest.
        no: A byte, or None: the last result on the stack but for that of `yes`.
        yes: A byte, or None: the last result on the stack.
    """

    line: int
    cut: Reals
    no: Bytes | None
    yes: Bytes | None


@dataclass(frozen=True, slots=True)
class Descent:
    """A tree, ready to be descended.

    Attributes:
        splits: The nodes, for a single row; the first is the root, none if there is
            one leaf only.
        walk: All tests.
        top: The tests evaluated on all rows, in the order of evaluation.
        exits: Where each answer of the top leads: places; leaves if it is the whole.
        is_whole: Whether the top has every test.
    """

    splits: tuple[AxisSplit, ...]
    walk: Walk
    top: tuple[CutTest, ...]
    exits: IntArray
    is_whole: bool


def plan_descent(splits: Sequence[AxisSplit], kind: Real) -> Descent:
    """Return a tree as lists of tests.

    A parent stands before its children; a single leaf has no splits. Cuts are rounded
    to `kind`.
    """
    draft = _plan_walk(splits)
    top, exits = _plan_top(draft, kind)
    is_whole = all(draft.leaf[place] for place in exits)
    walk = Walk(
        np.array(draft.line, np.int64),
        np.array(draft.cut, kind),
        np.array(draft.child, np.int64),
        np.array(draft.leaf, np.int64),
        _sure_rounds(draft, exits),
    )
    ends = [draft.leaf[place] for place in exits] if is_whole else exits
    return Descent(tuple(splits), walk, top, np.array(ends, np.int64), is_whole)


@dataclass(slots=True)
class _Draft:
    """The places of a walk, a list for each field, while they grow.

    The weight of a place is the number of leaves below it.
    """

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
        """Make a place test what another tests: both then lead to the same leaves."""
        self.line[place], self.cut[place] = self.line[source], self.cut[source]
        self.child[place], self.weight[place] = self.child[source], self.weight[source]


def _plan_walk(splits: Sequence[AxisSplit]) -> _Draft:
    """Lay the tests out breadth-first, so that early rounds touch few lines."""
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
    return draft


def _leaves_below(splits: Sequence[AxisSplit]) -> list[int]:
    weights = [0] * len(splits)
    for number in range(len(splits) - 1, -1, -1):
        targets = set(splits[number].targets)
        weights[number] = sum(1 if t < 0 else weights[t] for t in targets)
    return weights


def _plan_top(draft: _Draft, kind: Real) -> tuple[tuple[CutTest, ...], list[int]]:
    """Choose the tests that most leaves lie below; return them and their exits."""
    count = draft.leaf.count(0)
    least = 0.0 if count <= _SMALL else _SHARE * draft.weight[0]
    chosen: set[int] = set()
    heap = [(-draft.weight[0], 0)]
    while heap and len(chosen) < _MOST_EXITS - 1:
        weight, place = heapq.heappop(heap)
        if -weight < least:
            break
        if draft.leaf[place] or place in chosen:
            continue
        chosen.add(place)
        for below in (draft.child[place], draft.child[place] + 1):
            heapq.heappush(heap, (-draft.weight[below], below))
    return _order_top(draft, chosen, kind)


def _order_top(
    draft: _Draft, chosen: set[int], kind: Real
) -> tuple[tuple[CutTest, ...], list[int]]:
    """Put the chosen tests in an order in which answers come before their use."""
    tests: list[CutTest] = []
    code: dict[int, int] = {}  # of each exit
    results: dict[int, Bytes] = {}  # an answer that is an exit, until it is used
    visits = min(2 * len(chosen), _MOST_EXITS - 1)  # shared places are tested again
    todo: list[tuple[int, bool]] = [(0, False)]
    while todo:
        place, is_done = todo.pop()
        child = draft.child[place]
        if is_done:
            cut = np.array(draft.cut[place], kind)
            no, yes = results.pop(child, None), results.pop(child + 1, None)
            tests.append(CutTest(draft.line[place], cut, no, yes))
        elif place not in chosen or not visits:
            number = code.setdefault(place, len(code))
            results[place] = np.array(number, np.uint8)
        else:
            visits -= 1
            todo += [(place, True), (child + 1, False), (child, False)]
    return tuple(tests), list(code)


def _sure_rounds(draft: _Draft, exits: Sequence[int]) -> int:
    """Return after how many rounds the first tenth of the leaves is reached."""
    early, rounds = 0, 0
    here = list(exits)
    while True:
        early += sum(1 for place in here if draft.leaf[place])
        if early > 0.1 * draft.weight[0]:
            return rounds
        children = [draft.child[place] for place in here if not draft.leaf[place]]
        here = [place for child in children for place in (child, child + 1)]
        rounds += 1


class Desk:
    """Room for the walk of a chunk: fresh memory costs more than the work done in it.

    It belongs to one call, and is written over by every chunk.
    """

    def __init__(self, rows: int, kind: Real) -> None:
        self.order = np.arange(rows)
        self.rows = np.empty((3, rows), np.int64)
        self.here = np.empty((3, rows), np.int64)
        self.where = np.empty(rows, np.int64)
        self.value = np.empty(rows, kind)
        self.cut = np.empty(rows, kind)
        self.yes = np.empty(rows, np.bool_)


def descend_rows(
    descent: Descent, lines: Reals, start: int, out: IntArray, desk: Desk
) -> None:
    """Write the number of the leaf of some rows.

    `lines` are values of shape (variables, rows), contiguous. The answer to the rows
    from `start` on goes to `out`, best not more than `CHUNK` of them; where a value is
    NaN, the leaf is any. The `desk` has room for as many rows, of the type of the
    values.
    """
    if not descent.top:
        out[:] = 1
        return
    code = _test_top(descent.top, lines[:, start : start + len(out)])
    if descent.is_whole:
        descent.exits.take(code, out=out, mode="clip")
        return
    here = desk.here[0, : len(out)]
    descent.exits.take(code, out=here, mode="clip")
    _walk_on(descent.walk, lines, start, here, desk)
    descent.walk.leaf.take(here, out=out, mode="clip")


def descend_nodes(
    axes: Axes, splits: Sequence[AxisSplit], inputs: Reals, out: IntArray
) -> None:
    """Write the number of the leaf of each row, node by node, in double.

    `inputs` has shape (inputs, rows). A variable is computed in the rows that reach a
    test of it.
    """
    todo = [(0 if splits else -1, np.arange(len(out)))]
    while todo:
        number, rows = todo.pop()
        if number < 0:
            out[rows] = -number
        elif len(rows):
            split = splits[number]
            values = axis_values(axes, inputs, split.line, rows)
            if len(split.cuts) == 1:
                is_above = values > split.cuts[0]
                todo += zip(
                    split.targets, (rows[~is_above], rows[is_above]), strict=True
                )
                continue
            ends = np.take(split.targets, np.searchsorted(split.cuts, values))
            todo += [(end, rows[ends == end]) for end in dict.fromkeys(split.targets)]


def _test_top(top: Sequence[CutTest], lines: Reals) -> Bytes:
    """Return a byte for each row: which exit of the top it takes."""
    rows = lines.shape[1]
    answer = np.empty(rows, np.bool_)
    bit = answer.view(np.uint8)
    stack: list[Bytes] = []
    spare: list[Bytes] = []
    for test in top:
        np.greater(lines[test.line], test.cut, answer)
        if test.no is not None and test.yes is not None:
            out = spare.pop() if spare else np.empty(rows, np.uint8)
            np.multiply(bit, test.no ^ test.yes, out)
            if test.no:
                np.bitwise_xor(out, test.no, out)
        elif test.no is not None:
            out = stack.pop()
            np.bitwise_xor(out, test.no, out)
            np.multiply(out, bit, out)
            np.bitwise_xor(out, test.no, out)
        elif test.yes is not None:
            out = stack.pop()
            np.logical_not(answer, answer)
            np.bitwise_xor(out, test.yes, out)
            np.multiply(out, bit, out)
            np.bitwise_xor(out, test.yes, out)
        else:
            yes, out = stack.pop(), stack.pop()
            np.bitwise_xor(yes, out, yes)
            np.multiply(yes, bit, yes)
            np.bitwise_xor(out, yes, out)
            spare.append(yes)
        stack.append(out)
    return stack[0]


def _walk_on(
    walk: Walk, lines: Reals, start: int, places: IntArray, desk: Desk
) -> None:
    """Move every place to the leaf below it."""
    here, order = places, desk.order[: len(places)]
    rows = np.add(order, start, desk.rows[0, : len(places)])
    offsets = walk.line * lines.shape[1]
    flat = lines.reshape(-1)

    def step(rows: IntArray, here: IntArray, out: IntArray) -> None:
        """Answer one test for each row: write the place that it leads to."""
        count = len(here)
        yes, value, cut = desk.yes[:count], desk.value[:count], desk.cut[:count]
        offsets.take(here, out=out, mode="clip")
        np.add(out, rows, out)
        flat.take(out, out=value, mode="clip")
        walk.cut.take(here, out=cut, mode="clip")
        np.greater(value, cut, yes)
        walk.child.take(here, out=out, mode="clip")
        np.add(out, yes, out)

    other = desk.where[: len(places)]
    for _ in range(walk.sure):
        step(rows, here, other)
        here, other = other, here
    if here is not places:
        places[:] = here
        here = places
    spare = 1
    while True:
        new, moved = desk.where[: len(here)], desk.yes[: len(here)]
        step(rows, here, new)
        np.not_equal(new, here, moved)
        here[:] = new
        live = int(np.count_nonzero(moved))
        if here is not places and live < _LIVE * len(here):
            np.subtract(rows, start, rows)
            places[rows] = here
            np.add(rows, start, rows)
        if live == 0:
            return
        if live < _LIVE * len(here):
            keep = np.flatnonzero(moved)
            rows = rows.take(keep, out=desk.rows[spare, :live], mode="clip")
            here = here.take(keep, out=desk.here[spare, :live], mode="clip")
            spare = 3 - spare


def descend_row(
    splits: Sequence[AxisSplit], row: Sequence[float], chains: Chains = ()
) -> int:
    """Return the number of the leaf of one row of finite values, in plain Python.

    Combinations that are not in the row are computed when a node tests them.

    Example:
        >>> descend_row([AxisSplit(0, (1.0, 2.0), (-1, -2, -1))], [1.5])
        2
    """
    number = 0 if splits else -1
    while number >= 0:
        split = splits[number]
        place = split.line - len(row)
        value = row[place] if place < 0 else chain_value(chains[place], row)
        number = split.targets[bisect_left(split.cuts, value)]
    return -number


def follow(tree: FuzzyTree, dtype: Dtype = "float64") -> Run:
    """Return a function that follows one path of a tree for every row.

    The dtype `mixed` compares in double.

    Returns:
        A function from values of shape (inputs, rows) to an outcome without strengths.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(0)
        >>> follow(tree)(np.zeros((len(tree.inputs), 2))).status.tolist()
        [0, 0]
    """
    kind = NUMBERS[dtype].axis
    axes = plan_axes(tree.variables, kind)
    return descend_by(axes, plan_descent(_splits(tree, axes), kind), tree.inputs)


def descend_by(axes: Axes, descent: Descent, inputs: tuple[str, ...]) -> Run:
    """Return a function that descends planned splits on planned axes."""
    is_double = axes.dtype == np.float64
    is_plain = not axes.steps and is_double and axes.stand_ins is None
    parts, fewest = sum(map(len, axes.chains)), math.inf
    if is_double and len(axes.chains) > _FEW_CHAINS:
        fewest = _NODE_COST * len(descent.splits) / parts

    def run(values: FloatArray) -> Outcome:
        array = checked(values, inputs)
        count = array.shape[1]
        if count == 1 and is_double:
            return _one(axes, descent.splits, array[:, 0].tolist())
        rule = np.empty(count, np.int64)
        status = np.zeros(count, np.int64)
        desk = Desk(min(count, CHUNK), axes.dtype)
        with np.errstate(all="ignore"):
            for start in range(0, count, CHUNK):
                part = slice(start, start + CHUNK)
                if is_plain and array.flags.c_contiguous:
                    descend_rows(descent, array, start, rule[part], desk)
                    missing = missing_rows(array[:, part])
                elif len(rule[part]) >= fewest:
                    lines = input_lines(axes, array[:, part])
                    descend_nodes(axes, descent.splits, lines, rule[part])
                    missing = ~known_rows(axes, array[:, part])
                else:
                    lines = np.ascontiguousarray(axis_lines(axes, array[:, part]))
                    descend_rows(descent, lines, 0, rule[part], desk)
                    missing = missing_rows(lines)
                if missing is not None:
                    rule[part][missing] = 0
                    status[part][missing] = 3
        return Outcome(rule, status)

    return run


def _one(axes: Axes, splits: tuple[AxisSplit, ...], row: list[float]) -> Outcome:
    values = input_row(axes, row)
    is_small = all(abs(value) <= axes.limit for value in values)  # NaN is not
    if is_small or all(map(math.isfinite, axis_row(axes, row))):
        leaf = descend_row(splits, values, axes.chains)
        return Outcome(np.array([leaf]), np.array([0]))
    return Outcome(np.array([0]), np.array([3]))


def _splits(tree: FuzzyTree, axes: Axes) -> list[AxisSplit]:
    result: list[AxisSplit] = []
    for node in tree.nodes:
        ends = [
            -branch.leaf if branch.leaf is not None else (branch.node or 0) - 1
            for branch in node.branches
        ]
        targets = tuple(ends[owner] for owner in node.owners)
        result.append(AxisSplit(axes.line[node.variable], node.cuts, targets))
    return result
