"""A grown tree tuned as a whole: its cuts and combinations move together.

Nodes were split one by one, each for its own rows. Here a cut becomes a gate, the
logistic of a row's distance from it in units of the node's spread; a row reaches every
leaf by the product of its gates, and a leaf gives each class a chance. Directions,
cuts, widths of gates and chances that make the rows' own classes likely are found by a
fixed number of quasi-Newton steps from the grown tree, with a penalty on leaving it.

What comes back is a tree like any other: directions are rounded, rows take one branch,
leaves have the class of most of their rows, and those that no row reaches are gone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fuzzytree.learning.binary import BinaryTree, pruned
from fuzzytree.learning.cuts import TreeSplit, single
from fuzzytree.learning.directions import axis_of, spread_of
from fuzzytree.learning.rows import TrainingRows
from fuzzytree.learning.units import BoolArray, FloatArray, IntArray, tallied

SHARPNESS = 8
"""The power of the strengths in a tuned tree: flanks are as much longer than gates."""

_MOST_ROWS = 4_000
_MOST_CELLS = 1 << 22  # rows times nodes
_MOST_NODES = 1 << 12
_WIDTH = 0.2  # of a gate, in spreads of the node's rows
_STEPS = 15
_MEMORY = 8
_EVEN_ROWS = 1.0  # at each leaf, that belong to all classes evenly
_FARTHEST = 40.0
_LEAST = 1e-12
_SMALLEST = 1e-300

_Loss = Callable[[FloatArray], tuple[float, FloatArray]]


@dataclass(frozen=True)
class _Seen:
    """What a tree sees of some rows, ordered by class.

    Attributes:
        points: In standard units, shape (rows, combinable columns).
        codes: Their classes.
        weights: How many rows of the table each stands for.
        starts: Where each class begins.
        cuts: Their branches in gates that stay cuts, by the place of the gate.
    """

    points: FloatArray
    codes: IntArray
    weights: FloatArray
    starts: IntArray
    cuts: dict[int, FloatArray]


@dataclass(frozen=True)
class SoftTree:
    """A tree whose cuts are gates.

    Attributes:
        tree: What it was made of.
        rows: To learn from.
        at: Those that it was grown from, ordered by class.
        nodes: The nodes with a split, parents before children.
        below: The nodes of their two branches, shape (gates, 2).
        leaves: The others.
        weights: Of the gates over the combinable columns, shape (gates, columns).
        offsets: Of the gates.
        is_free: Which of the weights may move; none of a gate that stays a cut.
        shares: Of the classes at each leaf, shape (leaves, classes).
        is_tuned: Whether anything has moved.
    """

    tree: BinaryTree
    rows: TrainingRows
    at: IntArray
    nodes: IntArray
    below: IntArray
    leaves: IntArray
    weights: FloatArray
    offsets: FloatArray
    is_free: BoolArray
    shares: FloatArray
    is_tuned: bool = False

    @staticmethod
    def of(tree: BinaryTree, rows: TrainingRows, at: IntArray) -> SoftTree:
        """Read a tree that was grown from some rows, ordered by class."""
        is_leaf = np.array([split is None for split in tree.splits])
        nodes, leaves = np.flatnonzero(~is_leaf), np.flatnonzero(is_leaf)
        below = np.array([tree.children[node] for node in nodes.tolist()])
        reached = tree.reaching(rows, at)
        weights = np.zeros((len(nodes), len(rows.combinable)))
        offsets = np.zeros(len(nodes))
        is_free = np.zeros(weights.shape, bool)
        for place, node in enumerate(nodes.tolist()):
            gate = _gate_of(_split_at(tree, node), rows, reached[node])
            if gate is not None:
                columns, own, offsets[place] = gate
                weights[place, columns] = own
                is_free[place, columns] = True
        counts = np.full((len(leaves), rows.classes), _EVEN_ROWS / rows.classes)
        for place, leaf in enumerate(leaves.tolist()):
            inside = reached[leaf]
            codes, sizes = rows.codes[inside], rows.weights[inside]
            counts[place] += tallied(codes, sizes, rows.classes)
        shares = counts / counts.sum(axis=1, keepdims=True)
        return SoftTree(
            tree, rows, at, nodes, below, leaves, weights, offsets, is_free, shares
        )

    def tuned(self, penalty: float) -> SoftTree:
        """Return the tree with less log-loss on its rows.

        A tree of single columns, or of very many nodes, stays as it is.

        Args:
            penalty: On moving a gate by its own length, in rows.
        """
        size = len(self.tree.splits)
        if size > _MOST_NODES or not _has_combinations(self.tree):
            return self
        most = min(_MOST_ROWS, _MOST_CELLS // size)
        at = self.at[:: -(-len(self.at) // most)]
        start = np.concatenate(
            [self.weights[self.is_free], self.offsets, np.log(self.shares).ravel()]
        )
        seen = self._seen(at)
        point = _descended(start, lambda point: self._loss(point, seen, penalty))
        weights, offsets, shares = self._parts(point)
        return replace(
            self, weights=weights, offsets=offsets, shares=shares, is_tuned=True
        )

    def chances(self, at: IntArray) -> FloatArray:
        """Return the chances of the classes, shape (rows, classes)."""
        gates = self._gates(self.weights, self.offsets, self._seen(at))
        return self._reach(gates)[self.leaves].T @ self.shares

    def crisp(self, min_rows: int) -> BinaryTree:
        """Return the tree with a cut in the middle of each gate.

        Args:
            min_rows: How many rows a branch needs at least.
        """
        if not self.is_tuned:
            return self.tree
        moved = replace(self.tree, splits=list(self.tree.splits))
        for place, node in enumerate(self.nodes.tolist()):
            offset = float(self.offsets[place])
            split = _split_of(self.rows, self.weights[place], offset, self.at)
            if split is not None:
                moved.splits[node] = split
        result = _labelled(moved, self.rows, self.at, min_rows)
        if result.splits[0] is None:
            return self.tree
        return pruned(result, 0.0)

    def _seen(self, at: IntArray) -> _Seen:
        """Return what the tree sees of some rows."""
        rows, values = self.rows, self.rows.values[at]
        cuts = {
            place: _split_at(self.tree, int(self.nodes[place]))
            .branches(values)
            .astype(np.float64)
            for place in np.flatnonzero(~self.is_free.any(axis=1)).tolist()
        }
        codes = rows.codes[at]
        starts = np.flatnonzero(np.diff(codes, prepend=-1))
        return _Seen(rows.standard[at], codes, rows.weights[at], starts, cuts)

    def _gates(
        self, weights: FloatArray, offsets: FloatArray, seen: _Seen
    ) -> FloatArray:
        """Return how far each row takes the second branch, shape (gates, rows)."""
        along = weights @ seen.points.T + offsets[:, None]
        gates = 1.0 / (1.0 + np.exp(-np.clip(along, -_FARTHEST, _FARTHEST)))
        for place, taken in seen.cuts.items():
            gates[place] = taken
        return np.asarray(gates, np.float64)

    def _reach(self, gates: FloatArray) -> FloatArray:
        """Return how far each row reaches each node, shape (nodes, rows)."""
        reach = np.ones((len(self.tree.splits), gates.shape[1]))
        forks = zip(self.nodes.tolist(), self.below.tolist(), gates, strict=True)
        for node, (left, right), gate in forks:
            np.multiply(reach[node], gate, out=reach[right])
            np.subtract(reach[node], reach[right], out=reach[left])
        return reach

    def _parts(self, point: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the gates' weights and offsets, and the leaves' shares, of a point."""
        size = int(np.count_nonzero(self.is_free))
        weights = np.zeros(self.weights.shape)
        weights[self.is_free] = point[:size]
        offsets = point[size : size + len(self.nodes)]
        scores = point[size + len(self.nodes) :].reshape(self.shares.shape)
        shares = np.exp(scores - scores.max(axis=1, keepdims=True))
        return weights, offsets, shares / shares.sum(axis=1, keepdims=True)

    def _loss(
        self, point: FloatArray, seen: _Seen, penalty: float
    ) -> tuple[float, FloatArray]:
        """Return the penalised log-loss of some rows, and its gradient."""
        classes = self.rows.classes
        weights, offsets, shares = self._parts(point)
        gates = self._gates(weights, offsets, seen)
        reach = self._reach(gates)
        likely = np.empty_like(reach)  # the chance of a row's class from a node on
        likely[self.leaves] = shares[:, seen.codes]
        forks = zip(self.nodes.tolist(), self.below.tolist(), gates, strict=True)
        for node, (left, right), gate in reversed([*forks]):
            likely[node] = likely[left] + gate * (likely[right] - likely[left])
        whole = np.maximum(likely[0], _LEAST)
        scale = seen.weights / whole
        steep = likely[self.below[:, 0]] - likely[self.below[:, 1]]
        steep *= reach[self.nodes] * gates * (1.0 - gates) * scale
        owned = reach[self.leaves] * likely[self.leaves] * scale
        of_shares = shares * (owned.sum(axis=1, keepdims=True) + _EVEN_ROWS)
        of_shares -= _EVEN_ROWS / classes
        of_class = np.add.reduceat(owned, seen.starts, axis=1)
        of_shares[:, seen.codes[seen.starts]] -= of_class
        even = np.log(np.maximum(shares, _SMALLEST)).sum() * _EVEN_ROWS / classes
        lengths = np.maximum(np.sqrt((self.weights**2).sum(axis=1)), _LEAST)
        away = (weights - self.weights) / lengths[:, None]
        aside = (offsets - self.offsets) / lengths
        loss = penalty * float((away**2).sum() + (aside**2).sum())
        loss -= float(seen.weights @ np.log(whole)) + float(even)
        of_weights = steep @ seen.points + 2.0 * penalty * away / lengths[:, None]
        of_offsets = steep.sum(axis=1) + 2.0 * penalty * aside / lengths
        slopes = of_weights[self.is_free], of_offsets, of_shares.ravel()
        return loss, np.concatenate(slopes)


def _has_combinations(tree: BinaryTree) -> bool:
    return any(split is not None and split.axis.is_combined for split in tree.splits)


def _split_at(tree: BinaryTree, node: int) -> TreeSplit:
    split = tree.splits[node]
    assert split is not None  # it is one of the nodes with a split
    return split


def _labelled(
    tree: BinaryTree, rows: TrainingRows, at: IntArray, min_rows: int
) -> BinaryTree:
    """Return the tree with the classes of the rows that reach its nodes.

    A node with a branch that too few rows reach is replaced by its other branch.
    """
    result = BinaryTree()
    todo: list[tuple[int, IntArray, int, int]] = [(0, at, -1, 0)]
    while todo:
        node, inside, parent, branch = todo.pop()
        split = tree.splits[node]
        taken = np.zeros(0, np.int64)
        while split is not None:
            taken = split.branches(rows.values[inside])
            sizes = np.bincount(taken, minlength=2)
            if sizes.min() >= min_rows:
                break
            node = tree.children[node][int(sizes.argmax())]
            split = tree.splits[node]
        place = result.add(rows, inside)
        result.attach(parent, branch, place)
        if split is not None:
            result.splits[place] = split
            for k in (1, 0):
                todo.append((tree.children[node][k], inside[taken == k], place, k))
    return result


def _gate_of(
    split: TreeSplit, rows: TrainingRows, inside: IntArray
) -> tuple[IntArray, FloatArray, float] | None:
    """Return the columns, weights and offset of a cut's gate, in standard units.

    None for a split of several cuts, or by a column that combinations do not use.

    Args:
        split: The split.
        rows: To learn from.
        inside: Those that reach it.
    """
    axis = split.axis
    columns = np.searchsorted(rows.combinable, axis.features)
    if len(split.cuts) != 1 or (columns == len(rows.combinable)).any():
        return None
    if (rows.combinable[columns] != axis.features).any():
        return None
    weights, cut = np.ones(1), float(split.cuts[0])
    exponents = rows.units.exponents[axis.features]
    if axis.is_combined:
        weights = np.ldexp(axis.weights, exponents)
    else:
        origin = rows.units.origins[axis.features[0]]
        cut = float(np.ldexp(cut - origin, -exponents[0]))
    places = axis.places(rows.values[inside], rows.moved[inside])
    width = max(float(places.std()) * _WIDTH, _LEAST)
    offset = float(weights @ rows.centres[columns]) - cut
    return columns, weights * rows.spreads[columns] / width, offset / width


def _split_of(
    rows: TrainingRows, weights: FloatArray, offset: float, at: IntArray
) -> TreeSplit | None:
    """Return the split in two at the middle of a gate, None where no row is beyond it.

    Args:
        rows: To learn from.
        weights: Of the gate, over the combinable columns.
        offset: Of the gate.
        at: Rows whose spread is the unit of the split.
    """
    columns = np.flatnonzero(weights)
    if not len(columns):
        return None
    own = weights[columns]
    if len(columns) == 1:
        feature = int(rows.combinable[columns[0]])
        place = rows.centres[columns[0]] - rows.spreads[columns[0]] * offset / own[0]
        place = float(np.ldexp(place, rows.units.exponents[feature]))
        cuts = np.array([place + rows.units.origins[feature]])
        owners = np.arange(2)[:: int(np.sign(own[0]))]
        unit = np.ldexp(rows.spreads[columns], rows.units.exponents[feature])
        return TreeSplit(
            single(feature), cuts, owners, (), SHARPNESS * unit / np.abs(own)
        )
    places = rows.standard[np.ix_(at, columns)] @ own
    is_right = places > -offset
    if is_right.all() or not is_right.any():
        return None
    unit = spread_of(places, is_right)
    axis = axis_of(rows, columns, own, unit)
    if axis is None:
        return None
    kept = np.searchsorted(rows.combinable, axis.features)
    rounded = np.ldexp(axis.weights, rows.units.exponents[axis.features])
    length = float(own[np.isin(columns, kept)] / rows.spreads[kept] @ rounded)
    length /= float(rounded @ rounded)  # of the gate in the split's unit
    cut = float(rounded @ rows.centres[kept]) - offset / length
    flanks = np.array([SHARPNESS / length])
    return TreeSplit(axis, np.array([cut]), np.arange(2), (), flanks)


def _descended(start: FloatArray, loss_of: _Loss) -> FloatArray:
    """Return a point of less loss, by limited-memory BFGS (Nocedal 1980).

    The number of steps is fixed, so that the last bits of sums, which depend on the
    machine, do not decide when to stop.

    Args:
        start: Where to begin.
        loss_of: The loss and its gradient.
    """
    point = start
    loss, slope = loss_of(point)
    moves: list[tuple[FloatArray, FloatArray, float]] = []
    for _ in range(_STEPS):
        way = slope.copy()
        shares: list[float] = []
        for move, bend, curvature in reversed(moves):
            shares.append(float(move @ way) / curvature)
            way -= shares[-1] * bend
        if moves:
            move, bend, curvature = moves[-1]
            way *= curvature / float(bend @ bend)
        else:
            way /= max(float(np.sqrt(slope @ slope)), 1.0)
        for move, bend, curvature in moves:
            way += (shares.pop() - float(bend @ way) / curvature) * move
        down = float(slope @ way)
        if not down > 0.0:
            break
        size = 1.0
        further = loss_of(point - way)
        while not further[0] <= loss - 1e-4 * size * down:
            size /= 2.0
            if size < 2.0**-20:
                return point
            further = loss_of(point - size * way)
        move, bend = -size * way, further[1] - slope
        curvature = float(move @ bend)
        point, (loss, slope) = point + move, further
        if curvature > 1e-10 * float(bend @ bend):
            moves = [*moves[1 - _MEMORY :], (move, bend, curvature)]
    return point
