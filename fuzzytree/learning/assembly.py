"""From a sketch over patterns to the frozen tree: sets, bands, names."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fuzzytree.learning.cuts import Sketch, SplitAxis, TreeSplit
from fuzzytree.learning.patterns import Patterns
from fuzzytree.learning.shapes import (
    REACH,
    FittedSets,
    SetRepairs,
    fitted_sets,
    window_counts,
)
from fuzzytree.learning.statistics import Statistics
from fuzzytree.learning.sums import Totals, totals_of
from fuzzytree.learning.units import ColumnUnits, FloatArray, IntArray
from fuzzytree.model import (
    LR,
    Band,
    Branch,
    FuzzyTree,
    Leaf,
    Node,
    Part,
    Sets,
    Side,
    Term,
    Variable,
    interval_names,
)

ZERO_SPREAD_SHARE = 0.1
"""A set without spread gets this share of the spread within the other patterns."""

_NEAREST = 16
_NOTHING = 0.005  # a ratio that counts as 0 where a flank's end is sought
_PART = np.linspace(0.0, 1.0, 65)


@dataclass(frozen=True)
class TermNames:
    """How people call the parts of the table.

    Attributes:
        tree: The tree's name.
        columns: Of the table.
        classes: Of the target.
        units: By column.
        whole: The columns that hold whole numbers alone.
    """

    tree: str
    columns: Sequence[str]
    classes: Sequence[str]
    units: Mapping[str, str]
    whole: Collection[str]


@dataclass(frozen=True)
class AssembledTree:
    """A tree and what fitting its sets repaired."""

    tree: FuzzyTree
    sets: int
    zero_spreads: int
    repairs: SetRepairs
    largest_flank_error: float


@dataclass(frozen=True)
class _Unit:
    """The unit of an axis: places are `(value - origin) / 2**exponent`."""

    origin: float = 0.0
    exponent: int = 0

    @staticmethod
    def of(axis: SplitAxis, units: ColumnUnits) -> _Unit:
        """Return the unit of an axis; a combination has the table's."""
        if axis.is_combined:
            return _Unit()
        feature = int(axis.features[0])
        return _Unit(float(units.origins[feature]), int(units.exponents[feature]))

    def place(self, value: float) -> float:
        """Return where a value lies."""
        return math.ldexp(value - self.origin, -self.exponent)

    def value(self, place: float) -> float:
        """Return the value at a place, rounded once from the place on."""
        return self.origin + math.ldexp(place, self.exponent)

    def ulp(self, values: FloatArray) -> FloatArray:
        """Return the distance to the next float, in this unit."""
        return np.ldexp(np.spacing(np.abs(values)), -self.exponent)


@dataclass(frozen=True)
class _AxisSets:
    """The sets of the patterns that one axis divides, fitted in its unit.

    `means` are those of the table; `place` finds a pattern.
    """

    axis: SplitAxis
    unit: _Unit
    patterns: IntArray
    place: dict[int, int]
    means: FloatArray
    fitted: FittedSets
    zero_spreads: int


def assembled(
    sketch: Sketch,
    patterns: Patterns,
    statistics: Statistics,
    names: TermNames,
    *,
    points: int,
    separate_sides: bool,
    keeps_flaws: bool,
    supports: FloatArray,
) -> AssembledTree:
    """Return the frozen tree of a sketch.

    Args:
        sketch: The tree.
        patterns: What it was grown from.
        statistics: Of the table; a class with one pattern has its mean and spread.
        names: For people.
        points: n of the 2n + 1 windows.
        separate_sides: Whether a set's sides are fitted apart.
        keeps_flaws: Whether a polynomial that leaves [0, 1] or rises stays.
        supports: How many rows of the table reach each leaf, by class.
    """
    keys = [
        (-1, node) if axis.is_combined else (int(axis.features[0]), -1)
        for node, axis in enumerate(split.axis for split in sketch.splits)
    ]
    fit = _Fit(patterns, statistics, points, separate_sides, keeps_flaws)
    axes = _axis_sets(sketch, keys, fit)
    flanks, largest = _all_flanks(sketch, keys, axes)
    called = _axis_names(axes, names)
    pattern_names = _pattern_names(patterns, names)
    nodes, terms = _nodes(sketch, keys, called, flanks, pattern_names)
    inputs = sorted({int(f) for a in axes.values() for f in a.axis.features})
    variables = [
        Variable(
            name := names.columns[feature],
            terms.get((feature, -1), ()),
            names.units.get(name, ""),
            *statistics.extent(feature),
            is_whole=name in names.whole,
        )
        for feature in inputs
    ]
    for key, found in axes.items():
        if found.axis.is_combined:
            variables.append(
                _combination(called[key], found.axis, statistics, names, terms[key])
            )
    tree = FuzzyTree(
        name=names.tree,
        classes=tuple(names.classes),
        variables=tuple(variables),
        nodes=nodes,
        leaves=_leaves(sketch, supports, names, pattern_names),
        sets=tuple(_frozen_sets(called[k], a, pattern_names) for k, a in axes.items()),
        columns=tuple(names.columns),
    )
    return AssembledTree(
        tree,
        sum(len(a.patterns) for a in axes.values()),
        sum(a.zero_spreads for a in axes.values()),
        _added([a.fitted.repairs for a in axes.values()]),
        largest,
    )


_Key = tuple[int, int]


def _added(parts: Sequence[SetRepairs]) -> SetRepairs:
    return SetRepairs(
        **{
            name: sum(getattr(part, name) for part in parts)
            for name in SetRepairs.__dataclass_fields__
        }
    )


@dataclass(frozen=True)
class _Fit:
    """What sets are fitted to, and how."""

    patterns: Patterns
    statistics: Statistics
    points: int
    separate_sides: bool
    keeps_flaws: bool


def _axis_sets(
    sketch: Sketch, keys: Sequence[_Key], fit: _Fit
) -> dict[_Key, _AxisSets]:
    """Fit the sets of every pattern on every axis that divides it."""
    groups_of: dict[_Key, list[IntArray]] = {}
    axis_of: dict[_Key, SplitAxis] = {}
    for key, split in zip(keys, sketch.splits, strict=True):
        groups_of.setdefault(key, []).extend(split.groups)
        axis_of[key] = split.axis
    return {
        key: _sets_on(axis_of[key], np.unique(np.concatenate(groups)), fit)
        for key, groups in groups_of.items()
    }


def _sets_on(axis: SplitAxis, chosen: IntArray, fit: _Fit) -> _AxisSets:
    patterns = fit.patterns
    members = patterns.members(chosen)
    values = axis.values(patterns.rows[members])
    owners = np.searchsorted(chosen, patterns.owners[members])
    totals = totals_of(values, owners, len(chosen))
    unit, usual = _Unit(), 1.0
    if not axis.is_combined:
        feature = int(axis.features[0])
        totals = _with_classes(totals, chosen, patterns, fit.statistics.totals(feature))
        unit, usual = _Unit.of(axis, patterns.units), float(patterns.scale[feature])
    counts = window_counts(values, owners, totals, fit.points)
    means = totals.means()
    spreads = totals.spreads(unit.exponent)
    is_zero = ~(spreads > 0)
    floor = np.maximum(ZERO_SPREAD_SHARE * usual, 8 * unit.ulp(means))
    widths = np.where(is_zero, floor, np.maximum(spreads, unit.ulp(means)))
    moved = totals.means(unit.origin, unit.exponent)
    fitted = fitted_sets(
        moved,
        widths,
        counts,
        separate_sides=fit.separate_sides,
        keeps_flaws=fit.keeps_flaws,
    )
    place = {int(p): k for k, p in enumerate(chosen)}
    zeros = int(np.count_nonzero(is_zero))
    return _AxisSets(axis, unit, chosen, place, means, fitted, zeros)


def _with_classes(
    own: Totals, chosen: IntArray, patterns: Patterns, classes: Totals
) -> Totals:
    """Return totals in which a class' only pattern has those of the whole class."""
    several = np.bincount(patterns.labels) > 1
    unit = min(own.unit, classes.unit)
    picked: list[tuple[int, int, int]] = []
    for place, label in enumerate(patterns.labels[chosen].tolist()):
        source, k = (own, place) if several[label] else (classes, label)
        step = source.unit - unit
        picked.append(
            (source.counts[k], source.sums[k] << step, source.squares[k] << 2 * step)
        )
    counts, sums, squares = zip(*picked, strict=True)
    return Totals(counts, sums, squares, unit)


@dataclass(frozen=True)
class _Flanks:
    """Where the flanks at the cuts of one node end: `left[i]` and `right[i]` at i."""

    left: tuple[float, ...]
    right: tuple[float, ...]


def _all_flanks(
    sketch: Sketch, keys: Sequence[_Key], axes: dict[_Key, _AxisSets]
) -> tuple[list[_Flanks], float]:
    """Fit the flanks of all nodes; return them and the largest error of a fit."""
    result: list[_Flanks] = []
    largest = 0.0
    for key, split in zip(keys, sketch.splits, strict=True):
        if split.flanks is not None:
            result.append(_tuned_flanks(split.cuts, split.flanks))
            continue
        field = _Field.of(split, axes[key])
        ends: dict[int, list[float]] = {-1: [], 1: []}
        for cut in range(len(split.cuts)):
            for sign, found in ends.items():
                end, error = _flank_end(split, axes[key], field, cut, sign)
                found.append(end)
                largest = max(largest, error)
        result.append(_Flanks(tuple(ends[-1]), tuple(ends[1])))
    return result, largest


def _tuned_flanks(cuts: FloatArray, reach: FloatArray) -> _Flanks:
    left = np.minimum(cuts - reach, np.nextafter(cuts, -np.inf))
    right = np.maximum(cuts + reach, np.nextafter(cuts, np.inf))
    return _Flanks(tuple(left.tolist()), tuple(right.tolist()))


def _flank_end(
    split: TreeSplit, sets: _AxisSets, field: _Field, cut: int, sign: int
) -> tuple[float, float]:
    """Return where the line from 1 at a cut to 0 is nearest to a ratio, and how near.

    All is reckoned in the axis' unit. The flank with sign 1 leaves the interval below
    the cut upwards, with sign -1 the interval above it downwards. The ratio is the
    branch's raw degree divided by the largest degree of its siblings, taken as 1 at the
    cut, where it must be, and never rising away from it.
    """
    start = sets.unit.place(float(split.cuts[cut]))
    owner = int(split.owners[cut if sign > 0 else cut + 1])
    mine, others = field.contestants(owner, start)
    reach = _flank_reach(split, sets, field, mine, cut, sign)
    ratio = _ratio(sets, mine, others, start + sign * reach * _PART)
    low = np.flatnonzero(ratio <= max(_NOTHING, float(ratio[-1])))
    reach *= float(_PART[max(1, int(low[0]))])
    ratio = _ratio(sets, mine, others, start + sign * reach * _PART)
    lines = np.maximum(1.0 - _PART / _PART[1:, np.newaxis], 0.0)
    errors = np.abs(lines - ratio).max(axis=1)
    best = int(errors.argmin())
    cut_value = float(split.cuts[cut])
    end = sets.unit.value(start + sign * reach * float(_PART[best + 1]))
    if sign * (end - cut_value) <= 0:
        end = math.nextafter(cut_value, sign * math.inf)
    return end, float(errors[best])


def _ratio(
    sets: _AxisSets, mine: IntArray, others: IntArray, points: FloatArray
) -> FloatArray:
    """Return own degree / largest other degree along points that start at a cut."""
    own = sets.fitted.degrees(mine, points).max(axis=0)
    rival = sets.fitted.degrees(others, points).max(axis=0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio = own / rival
    ratio = np.where(rival > 0, ratio, np.where(own > 0, 1.0, 0.0))
    first = float(ratio[0])
    ratio = ratio / first if 0 < first < 1 else ratio
    ratio[0] = 1.0
    return np.minimum.accumulate(np.clip(ratio, 0.0, 1.0))


@dataclass(frozen=True)
class _Field:
    """The sets of one node, ordered by mean."""

    place: IntArray
    branch: IntArray
    means: FloatArray
    before: IntArray
    after: IntArray

    @staticmethod
    def of(split: TreeSplit, sets: _AxisSets) -> _Field:
        """Return the field of a node."""
        everything = np.concatenate(split.groups)
        sizes = [len(group) for group in split.groups]
        branch = np.repeat(np.arange(len(sizes)), sizes)
        place = np.searchsorted(sets.patterns, everything)
        order = np.argsort(sets.fitted.means[place], kind="stable")
        place = place[order]
        before, after = _owned_neighbours(split.owners)
        means = sets.fitted.means[place]
        return _Field(place, branch[order], means, before, after)

    def contestants(self, owner: int, start: float) -> tuple[IntArray, IntArray]:
        """Return the places of the owner's sets and of its siblings' near a cut.

        Of very many sets those count whose means lie nearest: one of the owner and
        one of a sibling at least.
        """
        middle = int(np.searchsorted(self.means, start))
        reach = _NEAREST
        while True:
            near = slice(max(0, middle - reach), middle + reach)
            is_mine = self.branch[near] == owner
            found = self.place[near]
            if is_mine.any() and not is_mine.all():
                return found[is_mine], found[~is_mine]
            reach *= 2


def _owned_neighbours(owners: IntArray) -> tuple[IntArray, IntArray]:
    """Return the interval of the same branch before and after each one; -1 for none."""
    order = np.argsort(owners, kind="stable")
    is_same = np.diff(owners[order]) == 0
    before = np.full(len(owners), -1, np.int64)
    after = before.copy()
    before[order[1:][is_same]] = order[:-1][is_same]
    after[order[:-1][is_same]] = order[1:][is_same]
    return before, after


def _flank_reach(
    split: TreeSplit,
    sets: _AxisSets,
    field: _Field,
    mine: IntArray,
    cut: int,
    sign: int,
) -> float:
    """Return how far a flank may go: to the end of its sets, or of what it left."""
    start = sets.unit.place(float(split.cuts[cut]))
    means, spreads = sets.fitted.means[mine], sets.fitted.spreads[mine]
    reach = float((sign * (means - start) + REACH * spreads).max())
    other = int(field.after[cut] if sign > 0 else field.before[cut + 1])
    if other >= 0:
        edge = split.cuts[other - 1] if sign > 0 else split.cuts[other]
        reach = min(reach, sign * (sets.unit.place(float(edge)) - start))
    if not reach > 0:
        reach = ZERO_SPREAD_SHARE * float(spreads.max())
    return max(reach, 16 * float(sets.unit.ulp(split.cuts[cut : cut + 1])[0]))


def _axis_names(axes: dict[_Key, _AxisSets], names: TermNames) -> dict[_Key, str]:
    """Return the column's name, or `combination 1`, ... for combinations."""
    called: dict[_Key, str] = {}
    taken = set(names.columns)
    number = 0
    for key, found in axes.items():
        if not found.axis.is_combined:
            called[key] = names.columns[key[0]]
            continue
        number += 1
        name = f"combination {number}"
        while name in taken:
            name += "'"
        taken.add(name)
        called[key] = name
    return called


def _pattern_names(patterns: Patterns, names: TermNames) -> list[str]:
    """Return `class`, or `class #1`, `class #2`, ... where it has several patterns."""
    several = np.bincount(patterns.labels, minlength=len(names.classes)) > 1
    taken = set(names.classes)
    result: list[str] = []
    pairs = zip(patterns.labels.tolist(), patterns.numbers.tolist(), strict=True)
    for label, number in pairs:
        name = names.classes[int(label)]
        if several[label]:
            name = f"{name} #{number}"
            while name in taken:
                name += "'"
            taken.add(name)
        result.append(name)
    return result


def _nodes(
    sketch: Sketch,
    keys: Sequence[_Key],
    called: dict[_Key, str],
    flanks: Sequence[_Flanks],
    pattern_names: Sequence[str],
) -> tuple[tuple[Node, ...], dict[_Key, tuple[Term, ...]]]:
    """Return the nodes, and the relative terms of each axis."""
    by_axis: dict[_Key, list[int]] = {}
    for node, key in enumerate(keys):
        by_axis.setdefault(key, []).append(node)
    own_terms: dict[int, list[str]] = {}
    terms: dict[_Key, tuple[Term, ...]] = {}
    for key, numbers in by_axis.items():
        cuts = [sketch.splits[node].cuts.tolist() for node in numbers]
        made: dict[str, Term] = {}
        for node, wanted in zip(numbers, interval_names(cuts), strict=True):
            bands = _bands(sketch.splits[node], flanks[node])
            own_terms[node] = [
                _place_term(made, name, band)
                for name, band in zip(wanted, bands, strict=True)
            ]
        terms[key] = tuple(made.values())
    nodes = tuple(
        _node(sketch, node, called[key], own_terms[node], pattern_names)
        for node, key in enumerate(keys)
    )
    return nodes, terms


def _place_term(made: dict[str, Term], name: str, band: Band) -> str:
    """Add a term, under a name of its own if another one has that name."""
    number = 1
    unique = name
    while unique in made and made[unique].shape != band:
        number += 1
        unique = f"{name} ({number})"
    made[unique] = Term(unique, band)
    return unique


def _bands(split: TreeSplit, flanks: _Flanks) -> list[Band]:
    cuts = split.cuts.tolist()
    last = len(cuts)
    return [
        Band(
            low=cuts[k - 1] if k > 0 else None,
            high=cuts[k] if k < last else None,
            left=flanks.left[k - 1] if k > 0 else None,
            right=flanks.right[k] if k < last else None,
        )
        for k in range(last + 1)
    ]


def _node(
    sketch: Sketch,
    node: int,
    variable: str,
    terms: Sequence[str],
    pattern_names: Sequence[str],
) -> Node:
    split = sketch.splits[node]
    owners = [int(owner) for owner in split.owners]
    branches: list[Branch] = []
    owned: list[list[str]] = [[] for _ in split.groups]
    for term, owner in zip(terms, owners, strict=True):
        owned[owner].append(term)
    for branch, child in enumerate(sketch.children[node]):
        branches.append(
            Branch(
                terms=tuple(owned[branch]),
                sets=tuple(
                    pattern_names[int(p)] for p in np.sort(split.groups[branch])
                ),
                node=child + 1 if child >= 0 else None,
                leaf=~child + 1 if child < 0 else None,
            )
        )
    return Node(variable, tuple(split.cuts.tolist()), tuple(owners), tuple(branches))


def _combination(
    name: str,
    axis: SplitAxis,
    statistics: Statistics,
    names: TermNames,
    terms: tuple[Term, ...],
) -> Variable:
    """Return a combination, whose range is that of all rows in its columns' ranges.

    Rounding is monotone, so no such row lies outside it in double either.
    """
    extents = np.zeros((2, int(axis.features.max()) + 1))
    for feature, weight in zip(
        axis.features.tolist(), axis.weights.tolist(), strict=True
    ):
        ends = statistics.extent(feature)
        extents[:, feature] = ends if weight > 0.0 else ends[::-1]
    low, high = (
        end if np.isfinite(end) else None for end in axis.values(extents).tolist()
    )
    parts = tuple(
        Part(names.columns[int(feature)], weight, centre)
        for feature, weight, centre in zip(
            axis.features.tolist(),
            axis.weights.tolist(),
            axis.centres.tolist(),
            strict=True,
        )
    )
    return Variable(name, terms, "", low, high, parts)


def _leaves(
    sketch: Sketch,
    supports: FloatArray,
    names: TermNames,
    pattern_names: Sequence[str],
) -> tuple[Leaf, ...]:
    counts = np.rint(supports).astype(np.int64).tolist()
    return tuple(
        Leaf(
            names.classes[label],
            " or ".join(pattern_names[int(p)] for p in owned),
            sum(rows),
            counts=tuple(rows),
        )
        for owned, label, rows in zip(
            sketch.leaves, sketch.leaf_classes, counts, strict=True
        )
    )


def _frozen_sets(name: str, found: _AxisSets, pattern_names: Sequence[str]) -> Sets:
    fitted = found.fitted
    terms = tuple(
        Term(
            pattern_names[int(pattern)],
            LR(
                mean,
                Side(spread, tuple(left), REACH),
                Side(spread, tuple(right), REACH),
            ),
        )
        for pattern, mean, spread, left, right in zip(
            found.patterns.tolist(),
            found.means.tolist(),
            np.ldexp(fitted.spreads, found.unit.exponent).tolist(),
            fitted.left.tolist(),
            fitted.right.tolist(),
            strict=True,
        )
    )
    return Sets(name, terms)
