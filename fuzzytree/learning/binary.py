"""A tree of splits in two: grown from rows, pruned, and turned into its nodes.

Pruning is by cost and complexity. In the end several cuts of a column become one node,
and cuts lie between the rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from fuzzytree.learning.clouds import clouds_of
from fuzzytree.learning.cuts import Sketch, SplitCuts, TreeSplit
from fuzzytree.learning.patterns import Patterns, leaf_patterns
from fuzzytree.learning.rows import Clouds, SplitRules, TrainingRows, between
from fuzzytree.learning.sampling import Sample
from fuzzytree.learning.splitting import Style, best_split
from fuzzytree.learning.statistics import Moments
from fuzzytree.learning.units import BoolArray, FloatArray, IntArray, tallied


@dataclass
class BinaryTree:
    """A tree in flat lists; node 0 is the root, and parents stand before children.

    Attributes:
        splits: Of each node; None for a leaf.
        children: The nodes of the two branches; (0, 0) for a leaf.
        labels: The class of most rows, by weight.
        wrong: The weight of the rows of each node that are of other classes.
    """

    splits: list[TreeSplit | None] = field(default_factory=list[TreeSplit | None])
    children: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])
    labels: list[int] = field(default_factory=list[int])
    wrong: list[float] = field(default_factory=list[float])

    @property
    def leaves(self) -> int:
        """How many leaves there are."""
        return sum(split is None for split in self.splits)

    def is_alike(self, other: BinaryTree) -> bool:
        """Return whether two prunings of a tree have kept the same splits."""
        return [*map(id, self.splits)] == [*map(id, other.splits)]

    def add(self, rows: TrainingRows, at: IntArray) -> int:
        """Add a leaf of some rows and return its number."""
        counts = tallied(rows.codes[at], rows.weights[at], rows.classes)
        label = int(np.round(counts, 9).argmax())
        self.splits.append(None)
        self.children.append((0, 0))
        self.labels.append(label)
        self.wrong.append(float(counts.sum() - counts[label]))
        return len(self.splits) - 1

    def attach(self, parent: int, branch: int, child: int) -> None:
        """Make a node the branch of another one; the root has the parent -1."""
        if parent >= 0:
            left, right = self.children[parent]
            self.children[parent] = (left, child) if branch else (child, right)

    def reaching(
        self, rows: TrainingRows, at: IntArray, start: int = 0
    ) -> dict[int, IntArray]:
        """Return the rows that reach each node from a node on, where there are any."""
        reached = {start: at}
        todo = [start]
        while todo:
            node = todo.pop()
            split = self.splits[node]
            if split is None:
                continue
            inside = reached[node]
            taken = split.branches(rows.values[inside])
            for branch, child in enumerate(self.children[node]):
                found = inside[taken == branch]
                if len(found):
                    reached[child] = found
                    todo.append(child)
        return reached

    def answers(self, rows: TrainingRows, at: IntArray, start: int = 0) -> IntArray:
        """Return the class that each row is given from a node on."""
        found = np.zeros(rows.size, np.int64)
        for node, inside in self.reaching(rows, at, start).items():
            if self.splits[node] is None:
                found[inside] = self.labels[node]
        return found[at]

    def kept(self, is_leaf: BoolArray) -> BinaryTree:
        """Return the tree in which some nodes have become leaves."""
        result = BinaryTree()
        todo = [(0, -1, 0)]
        while todo:
            node, parent, branch = todo.pop()
            place = len(result.splits)
            ends = bool(is_leaf[node]) or self.splits[node] is None
            result.splits.append(None if ends else self.splits[node])
            result.children.append((0, 0))
            result.labels.append(self.labels[node])
            result.wrong.append(self.wrong[node])
            result.attach(parent, branch, place)
            if not ends:
                for k in (1, 0):
                    todo.append((self.children[node][k], place, k))
        return result


@dataclass
class GrowingTree:
    """A tree that grows as far as it is needed.

    Attributes:
        rows: To learn from.
        at: Which of them.
        rules: What a split must keep to.
        style: What splits a node.
        depth: How many nodes a path may have.
        tree: What has grown so far.
    """

    rows: TrainingRows
    at: IntArray
    rules: SplitRules
    style: Style
    depth: int
    tree: BinaryTree = field(default_factory=BinaryTree)
    _todo: list[tuple[int, IntArray, int]] = field(
        default_factory=list[tuple[int, IntArray, int]]
    )
    _whole: Clouds | None = None

    def __post_init__(self) -> None:
        """Plant the root."""
        self._todo.append((self.tree.add(self.rows, self.at), self.at, 0))
        if self.style == "centres":
            self._whole = clouds_of(self.rows, self.at)

    def grown(
        self, cost: float, progress: Callable[[float], None] | None = None
    ) -> BinaryTree:
        """Return the tree, grown until no split pays that pruning could leave.

        A node with no more wrong rows than a leaf costs has none, the root excepted.

        Args:
            cost: Of a leaf, in rows; no larger than at the last call.
            progress: Called with the share of rows that have a leaf.
        """
        tree, waiting, settled = self.tree, [], 0
        while self._todo:
            node, inside, level = self._todo.pop()
            split = None
            if node and tree.wrong[node] <= cost:
                waiting.append((node, inside, level))
            elif level < self.depth:
                split = best_split(
                    self.rows, inside, self.rules, self.style, self._whole
                )
            if split is None:
                settled += len(inside)
                if progress is not None:
                    progress(settled / len(self.at))
                continue
            taken = split.branches(self.rows.values[inside])
            tree.splits[node] = split
            parts = [inside[taken == 0], inside[taken == 1]]
            left, right = (tree.add(self.rows, part) for part in parts)
            tree.children[node] = (left, right)
            self._todo += [(right, parts[1], level + 1), (left, parts[0], level + 1)]
        self._todo = waiting
        return tree


@dataclass(frozen=True)
class Pruning:
    """What each cost of a leaf leaves of a tree.

    Attributes:
        ends: Whether a node is a leaf then, shape (nodes, costs).
        leaves: How many leaves are left, by cost.
    """

    ends: BoolArray
    leaves: IntArray


def pruning(tree: BinaryTree, costs: FloatArray) -> Pruning:
    """Return which nodes become leaves for each cost of a leaf.

    A node does where its branches save no more rows than their leaves cost.
    """
    size = len(tree.splits)
    lost = np.zeros((size, len(costs)))
    leaves = np.ones((size, len(costs)), np.int64)
    ends = np.ones((size, len(costs)), bool)
    for node in reversed(range(size)):
        lost[node] = tree.wrong[node]
        if tree.splits[node] is None:
            continue
        left, right = tree.children[node]
        below, count = lost[left] + lost[right], leaves[left] + leaves[right]
        stays = below + costs * (count - 1) < tree.wrong[node] - 1e-9
        lost[node] = np.where(stays, below, lost[node])
        leaves[node] = np.where(stays, count, 1)
        ends[node] = ~stays
    return Pruning(ends, leaves[0])


def pruned(tree: BinaryTree, cost: float) -> BinaryTree:
    """Return a tree pruned by the cost of a leaf.

    The split at the root stays, so that there is a question at all.
    """
    ends = pruning(tree, np.array([cost])).ends[:, 0]
    ends[0] = False
    return tree.kept(ends)


def limited(tree: BinaryTree, most: int) -> list[BoolArray]:
    """Return which nodes become leaves in the best trees of 1, 2, ... `most` leaves.

    The best tree loses the fewest rows, and has no more leaves than it needs to.
    """
    size = len(tree.splits)
    lost = np.full((size, most + 1), np.inf)
    share = np.zeros((size, most + 1), np.int64)  # leaves of the left branch; 0: a leaf
    for node in reversed(range(size)):
        lost[node, 1:] = tree.wrong[node]
        if tree.splits[node] is None:
            continue
        left, right = tree.children[node]
        for count in range(2, most + 1):
            parts = lost[left, 1:count] + lost[right, count - 1 : 0 : -1]
            k = int(parts.argmin())
            if parts[k] < lost[node, count - 1] - 1e-9:
                lost[node, count], share[node, count] = parts[k], k + 1
            else:
                lost[node, count] = lost[node, count - 1]
                share[node, count] = -1 if share[node, count - 1] else 0
    return [_ends(tree, share, count) for count in range(1, most + 1)]


def _ends(tree: BinaryTree, share: IntArray, count: int) -> BoolArray:
    is_leaf = np.ones(len(tree.splits), bool)
    todo = [(0, count)]
    while todo:
        node, leaves = todo.pop()
        while share[node, leaves] < 0:  # no better than with one leaf less
            leaves -= 1
        first = int(share[node, leaves])
        if first:
            is_leaf[node] = False
            left, right = tree.children[node]
            todo += [(left, first), (right, leaves - first)]
    return is_leaf


@dataclass(frozen=True)
class FinishedTree:
    """A tree over the patterns that its leaves hold.

    Attributes:
        sketch: The tree.
        patterns: One for each leaf.
        leaves: The leaf that each row reaches.
    """

    sketch: Sketch
    patterns: Patterns
    leaves: IntArray


def finished_tree(
    tree: BinaryTree, rows: TrainingRows, sample: Sample, moments: Moments
) -> FinishedTree:
    """Return the nodes of a tree, and the patterns of its leaves.

    Splits by the same column that follow each other become one node.

    Args:
        tree: Of splits in two.
        rows: What it was grown from.
        sample: The same rows.
        moments: Of the classes.
    """
    sketch = Sketch()
    leaves = np.zeros(rows.size, np.int64)
    todo = [(0, np.arange(rows.size), -1, 0)]
    while todo:
        node, at, parent, branch = todo.pop()
        split = tree.splits[node]
        if split is None:
            place = ~len(sketch.leaf_classes)
            leaves[at] = ~place
            sketch.leaf_classes.append(tree.labels[node])
        else:
            place = len(sketch.splits)
            joined, below = _joined(tree, node, rows)
            placed = _placed(joined, rows, at)
            sketch.splits.append(placed)
            sketch.children.append([0] * len(below))
            taken = placed.branches(rows.values[at])
            for k in reversed(range(len(below))):
                todo.append((below[k], at[taken == k], place, k))
        if parent >= 0:
            sketch.children[parent][branch] = place
    labels = np.array(sketch.leaf_classes, np.int64)
    patterns, held = leaf_patterns(moments, sample, leaves, labels)
    sketch.leaves.extend(held[[k]] for k in range(len(labels)))
    for node, split in enumerate(sketch.splits):
        groups = [_below(sketch, child) for child in sketch.children[node]]
        found = tuple(np.sort(held[np.array(group)]) for group in groups)
        sketch.splits[node] = replace(split, groups=found)
    return FinishedTree(sketch, patterns, leaves)


def _joined(
    tree: BinaryTree, node: int, rows: TrainingRows
) -> tuple[TreeSplit, list[int]]:
    """Return a split with those below it on the same column, and the nodes it leads to.

    Combinations and categories stay as they are.
    """
    split = tree.splits[node]
    assert split is not None
    axis = split.axis
    if axis.is_combined or rows.categories[axis.features[0]] > 2:
        return split, [*tree.children[node]]
    column = axis.features[0]
    cuts: list[float] = []
    flanks: list[float] = []
    below: list[int] = []
    todo = [node]
    while todo:  # in the order of the intervals
        one = todo.pop()
        found = tree.splits[one] if one >= 0 else None
        if one < 0:
            split = tree.splits[~one]
            assert split is not None  # its node is split
            cuts.append(float(split.cuts[0]))
            flanks += [] if split.flanks is None else split.flanks.tolist()
        elif (
            found is None or found.axis.is_combined or found.axis.features[0] != column
        ):
            below.append(one)
        else:
            left, right = tree.children[one]
            todo += [right, ~one, left]
    owners = np.arange(len(cuts) + 1)
    ends = np.array(flanks) if len(flanks) == len(cuts) else None
    return TreeSplit(axis, np.array(cuts), owners, (), ends), below


def _placed(split: TreeSplit, rows: TrainingRows, at: IntArray) -> TreeSplit:
    """Return a split with cuts of few digits in the middle between the node's rows."""
    axis = split.axis
    if not axis.is_combined and rows.categories[axis.features[0]] > 2:
        return split
    values, moved = rows.values[at], rows.moved[at]
    along, places = axis.values(values), axis.places(values, moved)
    middle = [
        between(float(places[along <= cut].max()), float(places[along > cut].min()))
        for cut in split.cuts.tolist()
    ]
    cuts = SplitCuts(np.array(middle), split.owners)
    found = axis.settled(cuts, values, moved, rows.units)
    flanks = split.flanks if len(found.cuts) == len(split.cuts) else None
    return TreeSplit(axis, found.cuts, found.owners, (), flanks)


def _below(sketch: Sketch, child: int) -> list[int]:
    """Return the leaves below a child."""
    found: list[int] = []
    todo = [child]
    while todo:
        one = todo.pop()
        if one < 0:
            found.append(~one)
        else:
            todo += sketch.children[one]
    return found
