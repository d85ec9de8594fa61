"""Is there a row whose two best classes are nearly tied, or that two ensembles part?

Branch and bound over boxes of rows without missing values: of a box, each tree adds at
least the least and at most the largest of the leaves that the box reaches. A box in
which one class must win is done; another is cut in two at a cut of the tree that is
least known. What is spent are numbers that were looked at, so that the answer is the
same on each machine.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from fuzzytree.ensembles.trees import Ensemble, Tree
from fuzzytree.ensembles.walking import Box, Domain, in_type
from fuzzytree.model import FloatArray, IntArray

_MOST_SPENT = 1 << 29  # of numbers that a search looks at, with what a box costs beside
_BOX_COST = 1 << 13
_MOST_BOUNDS = 1 << 24  # of all leaves and columns
_MOST_PAIRS = 66  # of classes
_RANGE = 0.2  # weight of the range of a difference in the order of the search


class Side:
    """The leaves of an ensemble as boxes, and the differences that decide.

    Attributes:
        low, high: Of each leaf and column, shape (leaves, columns).
        differences: What a leaf adds to each difference of two classes.
        base: What is there before.
        trees: The tree of each leaf.
        is_small: Whether there are few enough.
    """

    def __init__(self, ensemble: Ensemble, domain: Domain, columns: Sequence[int]):
        scores = len(ensemble.base)
        self._pairs: list[tuple[int, int]] = []
        signs = np.eye(scores)[:, -1:]  # from scores to what decides
        bar = ensemble.bar
        if ensemble.decides == "largest":
            self._pairs = [(c, d) for d in range(scores) for c in range(d)]
            ups, downs = ([pair[side] for pair in self._pairs] for side in (0, 1))
            signs, bar = np.eye(scores)[:, ups] - np.eye(scores)[:, downs], 0.0
        self.is_small = (
            ensemble.leaf_count * len(columns) <= _MOST_BOUNDS
            and signs.shape[1] <= _MOST_PAIRS
            and not (domain.is_infinite and _is_at_end(ensemble))
        )
        if not self.is_small:
            return
        self.base = ensemble.base @ signs - bar
        values = [tree.values @ signs for tree in ensemble.trees]
        parts = [_bounds(tree, domain, columns) for tree in ensemble.trees]
        self.low = np.concatenate([part[0] for part in parts])
        self.high = np.concatenate([part[1] for part in parts])
        kept = [value[part[2]] for value, part in zip(values, parts, strict=True)]
        self.differences = np.concatenate(kept)
        self.trees = np.repeat(np.arange(len(parts)), [len(each) for each in kept])

    def winners(self, least: FloatArray, most: FloatArray, slack: float) -> set[int]:
        """Return the classes that may win where differences lie in a range."""
        if not self._pairs:
            return {1} if least[0] > slack else {0} if most[0] <= -slack else {0, 1}
        able = set(itertools.chain(*self._pairs))
        for (up, down), low, high in zip(self._pairs, least, most, strict=True):
            if low > slack:
                able.discard(down)
            if high < -slack:
                able.discard(up)
        return able


def _is_at_end(ensemble: Ensemble) -> bool:
    """Return whether a cut is minus infinity, which parts infinite rows alone."""
    return any(bool((tree.cuts == -np.inf).any()) for tree in ensemble.trees)


def _bounds(
    tree: Tree, domain: Domain, columns: Sequence[int]
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return low and high of the leaves that rows of a domain reach, and which."""
    places = {column: place for place, column in enumerate(columns)}
    cuts = in_type(tree.cuts, domain.rows).tolist()
    tested = [places[column] for column in tree.columns.tolist()]
    left, right = tree.left.tolist(), tree.right.tolist()
    todo: list[tuple[int, dict[int, tuple[float, float]]]]
    todo = [(0 if cuts else -1, {})]
    reached: list[tuple[int, dict[int, tuple[float, float]]]] = []
    whole = (-np.inf, domain.high)
    while todo:
        at, box = todo.pop()
        if at < 0:
            reached.append((~at, box))
            continue
        place, cut = tested[at], cuts[at]
        low, high = box.get(place, whole)
        if cut < high:
            todo.append((right[at], {**box, place: (max(low, cut), high)}))
        if low < cut:
            todo.append((left[at], {**box, place: (low, min(high, cut))}))
    lows = np.full((len(reached), len(columns)), -np.inf)
    highs = np.full((len(reached), len(columns)), domain.high)
    for number, (_, box) in enumerate(reached):
        for place, (low, high) in box.items():
            lows[number, place], highs[number, place] = low, high
    return lows, highs, np.array([leaf for leaf, _ in reached], np.int64)


class Search:
    """Boxes in which two classes may be tied within a slack.

    Attributes:
        is_whole: Whether all boxes were looked at.
        looked_at: How many boxes.
    """

    def __init__(
        self, ensembles: Sequence[Ensemble], domain: Domain, slack: float
    ) -> None:
        tested = [tree.columns for each in ensembles for tree in each.trees]
        self._columns = np.unique(
            np.concatenate([*tested, np.zeros(0, np.int64)])
        ).tolist()
        self._sides = [Side(each, domain, self._columns) for each in ensembles]
        self._slack, self._domain = slack, domain
        self.is_whole = False
        self.looked_at = 0

    def boxes(self) -> Iterator[Box]:
        """Yield boxes of rows with the same scores, in which no class is sure to win.

        Of two ensembles: in which not both are sure of the same one.
        """
        if not all(side.is_small for side in self._sides):
            return
        order = itertools.count()
        low = np.full(len(self._columns), -np.inf)
        high = np.full(len(self._columns), self._domain.high)
        whole = [np.arange(len(side.trees)) for side in self._sides]
        heap: list[tuple[float, int, FloatArray, FloatArray, list[IntArray]]]
        heap = [(0.0, 0, low, high, whole)]
        spent = 0
        while heap:
            _, _, low, high, leaves = heapq.heappop(heap)
            spent += _BOX_COST + sum(
                len(some) * side.differences.shape[1]
                for side, some in zip(self._sides, leaves, strict=True)
            )
            if spent > _MOST_SPENT:
                return
            self.looked_at += 1
            able: list[set[int]] = []
            widest, target = -1.0, (0, 0, 0)
            for number, (side, some) in enumerate(
                zip(self._sides, leaves, strict=True)
            ):
                trees = side.trees[some]
                starts = np.flatnonzero(np.diff(trees, prepend=-1))
                added = side.differences[some]
                least = np.minimum.reduceat(added, starts)
                most = np.maximum.reduceat(added, starts)
                sums = side.base + least.sum(axis=0), side.base + most.sum(axis=0)
                able.append(side.winners(*sums, self._slack))
                ranges = (most - least).max(axis=1)
                counts = np.diff(starts, append=len(some))
                place = int(np.argmax(ranges))
                if ranges[place] == 0:
                    place = int(np.argmax(counts))
                value = float(ranges[place])
                if counts[place] > 1 and value > widest:
                    widest = value
                    target = number, int(starts[place]), int(counts[place])
            if len(set().union(*able)) == 1:
                continue
            if widest <= 0:  # each row of the box has the same scores
                yield {
                    column: (float(low[place]), float(high[place]), False)
                    for place, column in enumerate(self._columns)
                }
                continue
            number, start, count = target
            mine = leaves[number][start : start + count]
            place, cut = self._cut(self._sides[number], mine, low, high)
            for is_left in (True, False):
                lower, upper = low.copy(), high.copy()
                if is_left:
                    upper[place] = cut
                else:
                    lower[place] = cut
                kept = [
                    some[
                        side.low[some, place] < cut
                        if is_left
                        else side.high[some, place] > cut
                    ]
                    for side, some in zip(self._sides, leaves, strict=True)
                ]
                key = self._key(kept[0])
                heapq.heappush(heap, (key, next(order) + 1, lower, upper, kept))
        self.is_whole = True

    def _key(self, leaves: IntArray) -> float:
        """Return how far from a tie a box may be; small ones come first."""
        side = self._sides[0]
        starts = np.flatnonzero(np.diff(side.trees[leaves], prepend=-1))
        added = side.differences[leaves]
        least = side.base + np.minimum.reduceat(added, starts).sum(axis=0)
        most = side.base + np.maximum.reduceat(added, starts).sum(axis=0)
        return float(np.abs(least + most).min() + _RANGE * (most - least).sum())

    @staticmethod
    def _cut(
        side: Side, leaves: IntArray, low: FloatArray, high: FloatArray
    ) -> tuple[int, float]:
        """Return the column and the cut that parts most leaves of a tree."""
        best = (0, 0, 0.0)
        for place in range(len(low)):
            ends = np.concatenate([side.low[leaves, place], side.high[leaves, place]])
            ends = ends[(ends > low[place]) & (ends < high[place])]
            if len(ends):
                values, counts = np.unique(ends, return_counts=True)
                at = int(np.argmax(counts))
                best = max(best, (int(counts[at]), place, float(values[at])))
        return best[1], best[2]
