"""Trees of any size to measure with: grown by scikit-learn, or made to a plan.

Both expect rows of independent standard normal columns.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Mapping
from statistics import NormalDist

import numpy as np
from sklearn.tree import DecisionTreeClassifier

from fuzzytree.model.rulebase import LR, Band, Side, Term, Variable
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node, Sets, intervals

FEATURES = 11
COLUMNS = tuple(f"x{number}" for number in range(FEATURES))

Cell = dict[str, tuple[float, float]]
"""The shares of a normal column below the ends of an interval, by column."""


def multiway_tree(leaves: int, *, seed: int = 0) -> FuzzyTree:
    """Return a tree of two to five branches a node whose leaves are equally likely.

    Each leaf holds one row in `leaves` of normal data, up to rounding: this is the case
    in which "n rules" says most about the work of a rule base. A leaf has a set on each
    variable that its path asks, with the mean and the spread of the rows in its cell.
    """
    plan = _Plan(random.Random(seed))
    plan.grow(leaves, dict.fromkeys(COLUMNS, (0.0, 1.0)))
    below = plan.below
    nodes = tuple(
        Node(name, cuts, tuple(range(len(ways))), _branches(number, ways, below))
        for number, (name, cuts, ways) in enumerate(plan.asked, 1)
    )
    used = [name for name in COLUMNS if name in plan.terms]
    patterns: dict[str, set[int]] = {name: set() for name in used}
    for number, (name, _, _) in enumerate(plan.asked, 1):
        patterns[name].update(below["node", number])
    return FuzzyTree(
        f"multiway {leaves}",
        tuple(f"class {number}" for number in range(1, min(leaves, 3) + 1)),
        tuple(Variable(name, tuple(plan.terms[name])) for name in used),
        nodes,
        tuple(
            Leaf(f"class {number % 3 + 1}", f"pattern {number + 1}")
            for number in range(leaves)
        ),
        tuple(
            Sets(
                name,
                tuple(
                    Term(f"pattern {leaf}", _set_in(plan.cells[leaf - 1][name]))
                    for leaf in sorted(patterns[name])
                ),
            )
            for name in used
        ),
        columns=COLUMNS,
    )


class _Plan:
    """A multiway tree while it grows: nodes and leaves in depth-first order."""

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.asked: list[tuple[str, tuple[float, ...], tuple[tuple[str, int], ...]]]
        self.asked = []
        self.cells: list[Cell] = []
        self.terms: dict[str, list[Term]] = {}
        self.below: dict[tuple[str, int], tuple[int, ...]] = {}

    def grow(self, size: int, cell: Cell) -> tuple[str, int]:
        """Add a subtree of so many leaves; return what leads to it."""
        if size == 1:
            self.cells.append(cell)
            key = "leaf", len(self.cells)
            self.below[key] = (key[1],)
            return key
        number = len(self.asked) + 1
        self.asked.append(("", (), ()))
        # The widest columns first, or the cells would become slivers.
        widest = sorted(COLUMNS, key=lambda name: cell[name][0] - cell[name][1])
        name = self.chance.choice(widest[:3])
        count = min(size, self.chance.randint(2, 5))
        sizes = [size // count + (k < size % count) for k in range(count)]
        low, high = cell[name]
        ends = [low + (high - low) * sum(sizes[:k]) / size for k in range(count)]
        ends.append(high)
        cuts = tuple(NormalDist().inv_cdf(end) for end in ends[1:-1])
        self._add_terms(number, name, cuts, _spread(cell[name]))
        ways = tuple(
            self.grow(part, {**cell, name: (ends[k], ends[k + 1])})
            for k, part in enumerate(sizes)
        )
        self.asked[number - 1] = (name, cuts, ways)
        self.below["node", number] = tuple(
            leaf for way in ways for leaf in self.below[way]
        )
        return "node", number

    def _add_terms(
        self, number: int, name: str, cuts: tuple[float, ...], spread: float
    ) -> None:
        known = self.terms.setdefault(name, [])
        for place, (low, high) in enumerate(intervals(Node(name, cuts, (), ()))):
            left = None if low is None else low - spread
            right = None if high is None else high + spread
            band = Band(low, high, left, right)
            known.append(Term(f"{number}, {place + 1}", band))


def _branches(
    number: int,
    ways: tuple[tuple[str, int], ...],
    below: Mapping[tuple[str, int], tuple[int, ...]],
) -> tuple[Branch, ...]:
    return tuple(
        Branch(
            (f"{number}, {place}",),
            tuple(f"pattern {leaf}" for leaf in below[way]),
            way[1] if way[0] == "node" else None,
            way[1] if way[0] == "leaf" else None,
        )
        for place, way in enumerate(ways, 1)
    )


def _set_in(shares: tuple[float, float]) -> LR:
    mean, spread = _moments(shares)
    side = Side(spread, (0.45, 0.1))
    return LR(mean, side, side)


def _spread(shares: tuple[float, float]) -> float:
    return _moments(shares)[1]


def _moments(shares: tuple[float, float]) -> tuple[float, float]:
    """Return mean and standard deviation of a normal column between two shares."""
    normal = NormalDist()
    width = shares[1] - shares[0]
    ends = [0.0 if p in (0.0, 1.0) else normal.inv_cdf(p) for p in shares]
    heights = [
        0.0 if p in (0.0, 1.0) else normal.pdf(end)
        for p, end in zip(shares, ends, strict=True)
    ]
    mean = (heights[0] - heights[1]) / width
    square = 1.0 + (ends[0] * heights[0] - ends[1] * heights[1]) / width
    return mean, math.sqrt(square - mean * mean)


def grow(leaves: int, *, is_many: bool) -> DecisionTreeClassifier:
    """Return a tree of scikit-learn with so many leaves, on seeded data."""
    chance = np.random.default_rng(0)
    values = chance.normal(size=(100_000, FEATURES)).astype(np.float32)
    scores = values @ chance.normal(size=(FEATURES, 3))
    labels = (scores + 0.5 * chance.normal(size=scores.shape)).argmax(axis=1)
    grown = DecisionTreeClassifier(max_leaf_nodes=leaves, random_state=0)
    grown.fit(values, labels)
    if not is_many:
        return grown
    kinds = grown.apply(values)
    grown = DecisionTreeClassifier(max_leaf_nodes=leaves, random_state=0)
    return grown.fit(values, kinds)


def walk(grown: DecisionTreeClassifier) -> Iterable[int]:
    """Yield the nodes of a scikit-learn tree depth-first, left before right."""
    todo = [0]
    while todo:
        place = todo.pop()
        yield place
        if grown.tree_.feature[place] >= 0:
            todo.append(grown.tree_.children_right[place])
            todo.append(grown.tree_.children_left[place])


def tree_of(grown: DecisionTreeClassifier) -> FuzzyTree:
    """Return a fuzzy tree with the cuts of a tree of scikit-learn.

    Flanks are one unit wide; each leaf has a set on each variable, around the mean of
    its cell.
    """
    inner = [p for p in walk(grown) if grown.tree_.feature[p] >= 0]
    leaves = [p for p in walk(grown) if grown.tree_.feature[p] < 0]
    node_of = {place: number for number, place in enumerate(inner, 1)}
    leaf_of = {place: number for number, place in enumerate(leaves, 1)}
    below = _below(grown, leaf_of)
    terms: dict[str, dict[str, Term]] = {}
    nodes: list[Node] = []
    for place in inner:
        name = COLUMNS[grown.tree_.feature[place]]
        cut = float(grown.tree_.threshold[place])
        low, high = f"below {cut!r}", f"above {cut!r}"
        known = terms.setdefault(name, {})
        known[low] = Term(low, Band(high=cut, right=cut + 1.0))
        known[high] = Term(high, Band(low=cut, left=cut - 1.0))
        children = (grown.tree_.children_left[place], grown.tree_.children_right[place])
        branches = tuple(
            Branch(
                (term,),
                tuple(f"pattern {leaf}" for leaf in below[child]),
                node_of.get(child),
                leaf_of.get(child),
            )
            for term, child in zip((low, high), children, strict=True)
        )
        nodes.append(Node(name, (cut,), (0, 1), branches))
    used = [name for name in COLUMNS if name in terms]
    labels = grown.classes_[grown.tree_.value[:, 0, :].argmax(axis=1)]
    return FuzzyTree(
        "benchmark",
        tuple(str(label) for label in grown.classes_),
        tuple(Variable(name, tuple(terms[name].values())) for name in used),
        tuple(nodes),
        tuple(
            Leaf(
                str(labels[p]),
                f"pattern {leaf_of[p]}",
                int(grown.tree_.n_node_samples[p]),
            )
            for p in leaves
        ),
        tuple(Sets(name, _sets(grown, name, leaf_of)) for name in used),
        columns=COLUMNS,
    )


def _below(
    grown: DecisionTreeClassifier, leaf_of: Mapping[int, int]
) -> dict[int, list[int]]:
    below: dict[int, list[int]] = {}
    for place in reversed(list(walk(grown))):
        if place in leaf_of:
            below[place] = [leaf_of[place]]
        else:
            left, right = grown.tree_.children_left, grown.tree_.children_right
            below[place] = below[left[place]] + below[right[place]]
    return below


def _sets(
    grown: DecisionTreeClassifier, name: str, leaf_of: Mapping[int, int]
) -> tuple[Term, ...]:
    """Return the set of each leaf on a variable, as wide as its cell."""
    cells: dict[int, tuple[float, float]] = {0: (-8.0, 8.0)}
    found: dict[int, Term] = {}
    for place in walk(grown):
        low, high = cells[place]
        if place in leaf_of:
            side = Side((high - low) / 2.0, (0.6, 0.1))
            label = f"pattern {leaf_of[place]}"
            found[leaf_of[place]] = Term(label, LR((low + high) / 2.0, side, side))
            continue
        left = grown.tree_.children_left[place]
        right = grown.tree_.children_right[place]
        cut = float(grown.tree_.threshold[place])
        is_asked = COLUMNS[grown.tree_.feature[place]] == name
        cells[left] = (low, min(high, cut)) if is_asked else (low, high)
        cells[right] = (max(low, cut), high) if is_asked else (low, high)
    return tuple(found[number] for number in sorted(found))
