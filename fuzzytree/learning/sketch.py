"""A tree in the making: axes, splits and leaves over patterns, as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fuzzytree.learning.cuts import SplitCuts, settled_cuts, without_empty
from fuzzytree.learning.units import ColumnUnits, FloatArray, IntArray


@dataclass(frozen=True)
class SplitAxis:
    """A feature, or a combination of features as a fixed chain.

    Attributes:
        features: Column numbers, in the order of the chain.
        weights: One per feature; not used for a single feature.
        centres: One per feature; not used for a single feature.
        is_combined: Whether it is a combination.
    """

    features: IntArray
    weights: FloatArray
    centres: FloatArray
    is_combined: bool

    def values(self, rows: FloatArray) -> FloatArray:
        """Return the axis value of each row, rounded as every runtime rounds it."""
        if not self.is_combined:
            return rows[:, self.features[0]]
        with np.errstate(over="ignore", invalid="ignore"):
            parts = np.ascontiguousarray(rows[:, self.features].T)
            parts -= self.centres[:, None]
            parts *= self.weights[:, None]
            total: FloatArray = parts[0]
            for part in parts[1:]:
                total += part
        return total

    def places(self, rows: FloatArray, moved: FloatArray) -> FloatArray:
        """Return where each row lies in the axis' own unit.

        That of a combination is the table's, for its weights hold the units.

        Args:
            rows: As in the table.
            moved: In the columns' units.
        """
        if self.is_combined:
            return self.values(rows)
        return moved[:, self.features[0]]

    def settled(
        self, cuts: SplitCuts, rows: FloatArray, moved: FloatArray, units: ColumnUnits
    ) -> SplitCuts:
        """Return cuts in the table's unit, increasing strictly, between the rows.

        Cuts without a row between them become one where that leaves every branch an
        interval.

        Args:
            cuts: In the axis' own unit.
            rows: As in the table.
            moved: In the columns' units.
            units: The columns' units.
        """
        values, places = self.values(rows), self.places(rows, moved)
        origin, exponent = 0.0, 0
        if not self.is_combined:
            origin = float(units.origins[self.features[0]])
            exponent = int(units.exponents[self.features[0]])
        points = settled_cuts(
            cuts.cuts, values, places, origin=origin, exponent=exponent
        )
        found = without_empty(SplitCuts(points, cuts.owners, cuts.reversals))
        points = found.cuts
        for k in range(1, len(points)):
            if points[k] <= points[k - 1]:
                points[k] = np.nextafter(points[k - 1], np.inf)
        return found


def single(feature: int) -> SplitAxis:
    """Return the axis of one feature."""
    return SplitAxis(np.array([feature]), np.ones(1), np.zeros(1), False)


@dataclass(frozen=True)
class TreeSplit:
    """A question and its answers.

    Attributes:
        axis: What it looks at.
        cuts: Increasing; interval i is (cuts[i - 1], cuts[i]].
        owners: The branch of each interval; neighbours differ.
        groups: The patterns of each branch.
    """

    axis: SplitAxis
    cuts: FloatArray
    owners: IntArray
    groups: tuple[IntArray, ...]

    def branches(self, rows: FloatArray) -> IntArray:
        """Return the branch that each row takes."""
        values = self.axis.values(rows)
        return self.owners[np.searchsorted(self.cuts, values, side="left")]


@dataclass
class Sketch:
    """A tree over patterns; node 0 is the root.

    Attributes:
        splits: One per node.
        children: Per node and branch: a node number, or ~leaf number.
        leaves: The patterns of each leaf.
        leaf_classes: The class of each leaf.
    """

    splits: list[TreeSplit] = field(default_factory=list[TreeSplit])
    children: list[list[int]] = field(default_factory=list[list[int]])
    leaves: list[IntArray] = field(default_factory=list[IntArray])
    leaf_classes: list[int] = field(default_factory=list[int])

    def descend(self, rows: FloatArray, start: int = 0) -> IntArray:
        """Return the leaf that each row reaches from a node (or from ~leaf)."""
        leaves = np.zeros(len(rows), np.int64)
        start = start if self.splits else ~0
        todo: list[tuple[int, IntArray]] = [(start, np.arange(len(rows)))]
        while todo:
            node, chosen = todo.pop()
            if node < 0:
                leaves[chosen] = ~node
                continue
            taken = self.splits[node].branches(rows[chosen])
            for branch, child in enumerate(self.children[node]):
                inside = chosen[taken == branch]
                if len(inside):
                    todo.append((child, inside))
        return leaves

    def classify(self, rows: FloatArray, start: int = 0) -> IntArray:
        """Return the class that each row is given from a node on."""
        return np.asarray(self.leaf_classes, np.int64)[self.descend(rows, start)]
