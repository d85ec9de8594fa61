"""Where a decision changes on one axis.

Between groups of patterns a cut stands where the densities of the groups cross, taken
for gaussians (`crossing_cuts`). A cut never lies on a value of the table.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from fuzzytree.learning.units import ColumnUnits, FloatArray, IntArray

NEGLIGIBLE = 0.01
"""An outer interval that holds less of each of its patterns is a far reversal."""

_ENVELOPE = 48


@dataclass(frozen=True)
class SplitCuts:
    """Cuts on an axis and the owner of each interval.

    Attributes:
        cuts: Increasing, shape (k,).
        owners: Shape (k + 1,); neighbours differ.
        reversals: How many far reversals were left out.
    """

    cuts: FloatArray
    owners: IntArray
    reversals: int = 0


def crossing_cuts(
    means: FloatArray,
    spreads: FloatArray,
    groups: IntArray,
    *,
    keep_reversals: bool,
) -> SplitCuts:
    """Return where the largest gaussian density passes from group to group.

    Args:
        means: M of each pattern on the axis.
        spreads: SD of each pattern; 0 counts as a thousandth of the axis' extent.
        groups: The group of each pattern, from 0.
        keep_reversals: Whether far intervals of next to no mass are kept.
    """
    extent = float(means.max() / 2 - means.min() / 2) + float(spreads.max())
    floor = max(1e-3 * extent, 4 * math.ulp(float(np.abs(means).max())))
    widths = np.maximum(spreads, floor)
    order = np.argsort(means, kind="stable")
    first, unit = float(means[order[0]]), float(widths.max())
    found = _standard_cuts(
        (means[order] - first) / unit,
        widths[order] / unit,
        groups[order],
        keep_reversals=keep_reversals,
    )
    return SplitCuts(first + unit * found.cuts, found.owners, found.reversals)


def _standard_cuts(
    means: FloatArray, widths: FloatArray, groups: IntArray, *, keep_reversals: bool
) -> SplitCuts:
    """Return the cuts for patterns ordered by mean, in units of the widest."""
    if len(means) > _ENVELOPE:
        left = np.flatnonzero(np.diff(groups))
        right = left + 1
        points = means[left] * widths[right] + means[right] * widths[left]
        points = np.maximum.accumulate(points / (widths[left] + widths[right]))
        return SplitCuts(points, groups[np.concatenate([[0], right])])
    points = _all_crossings(means, widths, groups)
    inner = (points[1:] + points[:-1]) / 2
    ends = points if len(points) else means
    probes = np.concatenate([[ends[0] - 10.0], inner, [ends[-1] + 10.0]])
    height = -0.5 * ((probes[:, None] - means) / widths) ** 2 - np.log(widths)
    owners = groups[height.argmax(axis=1)]
    keep = np.flatnonzero(np.diff(owners))
    cuts = SplitCuts(points[keep], owners[np.concatenate([[0], keep + 1])])
    cuts = _with_everybody(cuts, means, widths, groups)
    if keep_reversals:
        return cuts
    return _without_reversals(cuts, means, widths, groups)


def _with_everybody(
    cuts: SplitCuts, means: FloatArray, widths: FloatArray, groups: IntArray
) -> SplitCuts:
    """Fall back to neighbours in mean order where a group owns no interval."""
    if len(np.unique(cuts.owners)) == len(np.unique(groups)):
        return cuts
    leaders = [np.flatnonzero(groups == g) for g in np.unique(groups)]
    middle = np.array([means[k].mean() for k in leaders])
    order = np.argsort(middle, kind="stable")
    wide = np.array([widths[k].mean() for k in leaders])[order]
    middle = middle[order]
    tiny = 4 * np.spacing(np.abs(middle).max()) * np.arange(1, len(middle))
    points = (middle[:-1] * wide[1:] + middle[1:] * wide[:-1]) / (wide[1:] + wide[:-1])
    points = np.maximum.accumulate(points) + tiny
    return SplitCuts(points, np.unique(groups)[order])


def _all_crossings(
    means: FloatArray, widths: FloatArray, groups: IntArray
) -> FloatArray:
    """Return every point where two densities of different groups are equal."""
    i, j = np.nonzero(groups[:, None] < groups)
    a = 0.5 / widths[i] ** 2 - 0.5 / widths[j] ** 2
    gap = means[j] - means[i]
    b = gap / widths[j] ** 2
    c = np.log(widths[i] / widths[j]) - 0.5 * (gap / widths[j]) ** 2
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        root = np.sqrt(b * b - 4 * a * c)
        q = -0.5 * (b + np.where(b < 0, -root, root))
        found = np.concatenate([means[i] + q / a, means[i] + c / q])
    return np.unique(found[np.isfinite(found)])


def _without_reversals(
    cuts: SplitCuts, means: FloatArray, widths: FloatArray, groups: IntArray
) -> SplitCuts:
    """Give an outer interval of next to no mass to its inner neighbour."""
    points, owners, reversals = cuts.cuts, cuts.owners, cuts.reversals
    for end in (0, -1):
        while len(points) > 1 and np.count_nonzero(owners == owners[end]) > 1:
            mine = groups == owners[end]
            u = (points[end] - means[mine]) / widths[mine]
            mass = tail(-u if end == 0 else u).max()
            if mass >= NEGLIGIBLE:
                break
            points = np.delete(points, end)
            owners = np.delete(owners, end)
            reversals += 1
    return SplitCuts(points, owners, reversals)


def tail(u: FloatArray) -> FloatArray:
    """Return the share of a gaussian beyond u spreads, to about 1e-3."""
    v = np.minimum(np.abs(u), 37.0)
    upper = 0.5 * np.exp(-v * (0.717 + 0.416 * v))
    return np.where(u >= 0, upper, 1.0 - upper)


def settled_cuts(
    cuts: FloatArray,
    values: FloatArray,
    places: FloatArray | None = None,
    *,
    origin: float = 0.0,
    exponent: int = 0,
) -> FloatArray:
    """Return cuts that lie between the values of the table, with few binary digits.

    A cut keeps the rows that it has on either side and stays a quarter of the gap away
    from the values next to it. It is rounded to the largest power of two that keeps it
    there: 2.5 for 2.45 between 2 and 3. Unlike a decimal number it remains so where a
    column is multiplied by a power of two, or moved by a large one. The arithmetic is
    exact.

    Args:
        cuts: Increasing, in the axis' unit.
        values: The rows on the axis, in the table's unit and any order.
        places: The same rows in the axis' unit; `values` unless given.
        origin: Of the axis' unit.
        exponent: Of the axis' unit.

    Returns:
        Cuts in the table's unit. Between neighbouring floats it is the lower one.

    Example:
        >>> settled_cuts(np.array([2.45]), np.array([2.0, 3.0])).tolist()
        [2.5]
    """
    ordered, first = np.unique(values, return_index=True)
    at = (values if places is None else places)[first]
    unit = Fraction(2) ** exponent
    result: list[float] = []
    for cut in cuts.tolist():
        k = int(np.searchsorted(at, cut, side="right"))
        exact = Fraction(origin) + Fraction(cut) * unit
        if 0 < k < len(ordered):
            result.append(_tidy(exact, float(ordered[k - 1]), float(ordered[k])))
        else:
            result.append(float(exact))
    return np.array(result)


def without_empty(cuts: SplitCuts) -> SplitCuts:
    """Drop intervals between equal cuts, unless one is all that its owner has.

    Example:
        >>> found = without_empty(
        ...     SplitCuts(np.array([2.0, 2.0, 5.0]), np.array([0, 2, 1, 2]))
        ... )
        >>> found.cuts.tolist(), found.owners.tolist()
        ([2.0, 5.0], [0, 1, 2])
    """
    points, owners = cuts.cuts, cuts.owners
    k = 1
    while k < len(points):
        is_spare = np.count_nonzero(owners == owners[k]) > 1
        if points[k] > points[k - 1] or not is_spare:
            k += 1
            continue
        is_same = bool(owners[k - 1] == owners[k + 1])  # then no cut is left of both
        points = np.delete(points, [k - 1, k] if is_same else [k])
        owners = np.delete(owners, [k, k + 1] if is_same else [k])
        k = max(k - 1, 1)
    return SplitCuts(points, owners, cuts.reversals)


def _tidy(cut: Fraction, low: float, high: float) -> float:
    """Return the roundest number near a cut, a quarter of the gap from its ends."""
    gap = Fraction(high) - Fraction(low)
    ends = Fraction(low) + gap / 4, Fraction(high) - gap / 4
    near = min(max(cut, ends[0]), ends[1])
    # All denominators are powers of two: the largest one makes all of them whole.
    scale = max(near.denominator, ends[0].denominator, ends[1].denominator)
    place, first, last = (int(number * scale) for number in (near, *ends))
    # Twice the ends: of a larger power of two, too, 0 is the nearest multiple.
    highest = math.frexp(max(abs(low), abs(high)))[1] + 1
    for exponent in range(highest, max(highest - 55, -1075), -1):
        step = scale << exponent if exponent >= 0 else scale >> -exponent
        shown = _nearest_multiple(place, max(step, 1))
        if first <= shown <= last:
            return shown / scale
    return low


def _nearest_multiple(value: int, step: int) -> int:
    """Return the nearest multiple of a step; of two the even one."""
    times, rest = divmod(value, step)
    is_up = 2 * rest > step or (2 * rest == step and times % 2 == 1)
    return (times + is_up) * step


def rounded_to(value: float, exponent: int) -> float:
    """Return the nearest multiple of `2**exponent`; of two the even one.

    Example:
        >>> rounded_to(2.3, -2), rounded_to(-5.0, 1), rounded_to(0.3, 0)
        (2.25, -4.0, 0.0)
    """
    return math.ldexp(round(math.ldexp(value, -exponent)), exponent)


# --- a tree in the making: axes, splits and leaves over patterns, as arrays


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
        flanks: How far beyond each cut the relative terms fall to 0; None where the
            sets of the patterns say it.
    """

    axis: SplitAxis
    cuts: FloatArray
    owners: IntArray
    groups: tuple[IntArray, ...]
    flanks: FloatArray | None = None

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

    @property
    def is_tuned(self) -> bool:
        """Whether a split has flanks of its own, from tuning."""
        return any(split.flanks is not None for split in self.splits)

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
