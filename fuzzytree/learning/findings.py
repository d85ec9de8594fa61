"""What learning counted and repaired, as a frozen report."""

from __future__ import annotations

import msgspec


class LearningReport(msgspec.Struct, frozen=True, kw_only=True):
    """How a tree came about, and how its table departed from the paper's assumptions.

    Attributes:
        mode: `default` or `paper`.
        rows: Rows that were learnt from.
        rows_dropped: Rows left out: a value or the class is missing or not finite.
        rows_sampled: Rows kept for clusters, combinations and window counts.
        classes_without_rows: Classes that nothing was learnt about.
        features_ignored: Columns left out: constant, or its range overflows.
        patterns: Patterns by class name.
        patterns_refused: Clusters that were not made, for want of rows.
        single_rows: Patterns of one row.
        zero_spreads: Pairs of pattern and variable whose values are all equal; their
            sets are given a tenth of the spread within the other patterns.
        leaves: Leaves of the tree; at most one per pattern.
        features_per_node: How many features each node needs, in node order.
        inseparable: Patterns that share a leaf though their classes differ.
        levels_raised: Levels passed over until the threshold T split a node.
        reversals: Far intervals, where a wide set overtakes again, left out.
        sets: Fitted sets.
        off_peak: Sets in which another window holds more than the middle one.
        empty_centre: Sets whose middle window is empty.
        clipped: Points above 1, set to 1.
        lowered: Points above an inner neighbour, lowered to it.
        overshooting: Sides whose polynomial leaves [0, 1] between its points.
        rising: Sides whose polynomial rises somewhere.
        largest_flank_error: Largest difference of a relative term from its ratio.
        chosen: What inner validation chose, by setting; empty if it chose nothing.
        inner_accuracy: Share of right answers in inner validation, if there was one.
    """

    mode: str
    rows: int
    rows_dropped: int
    rows_sampled: int
    classes_without_rows: tuple[str, ...]
    features_ignored: tuple[str, ...]
    patterns: dict[str, int]
    patterns_refused: int
    single_rows: int
    zero_spreads: int
    leaves: int
    features_per_node: tuple[int, ...]
    inseparable: int
    levels_raised: int
    reversals: int
    sets: int
    off_peak: int
    empty_centre: int
    clipped: int
    lowered: int
    overshooting: int
    rising: int
    largest_flank_error: float
    chosen: dict[str, float | str] = {}
    inner_accuracy: float | None = None

    @property
    def repairs(self) -> tuple[str, ...]:
        """What had to be repaired in the fitted sets, with counts; empty if nothing."""
        told = (_told(self, name, text) for name, text in _REPAIRS.items())
        return tuple(line for line in told if line)

    def __str__(self) -> str:
        """Show the facts that are not zero, one a line."""
        lines = [f"{self.rows} rows, {sum(self.patterns.values())} patterns"]
        nodes = ", ".join(map(str, self.features_per_node)) or "none"
        lines.append(f"{self.leaves} leaves; features per node: {nodes}")
        if self.features_ignored:
            lines.append(f"columns ignored: {', '.join(self.features_ignored)}")
        lines += [_told(self, name, text) for name, text in _TABLE.items()]
        lines += self.repairs
        lines = [line for line in lines if line]
        lines.extend(f"chosen {name}: {value}" for name, value in self.chosen.items())
        return "\n".join(lines)


def _told(report: LearningReport, name: str, text: str) -> str:
    count: int = getattr(report, name)
    return f"{text}: {count}" if count else ""


_TABLE = {
    "rows_dropped": "rows dropped, a value is missing or not finite",
    "patterns_refused": "patterns refused, too few rows",
    "single_rows": "patterns of one row",
    "inseparable": "patterns of different classes that nothing tells apart",
    "levels_raised": "levels passed over until the threshold split a node",
}
"""What was left out of the table, or could not be told apart."""

_REPAIRS = {
    "zero_spreads": "sets whose values are all equal",
    "reversals": "far reversals left out",
    "off_peak": "sets with a fuller window than the middle one",
    "empty_centre": "sets with an empty middle window",
    "clipped": "points clipped to 1",
    "lowered": "points lowered to an inner neighbour",
    "overshooting": "sides whose polynomial leaves [0, 1]",
    "rising": "sides whose polynomial rises",
}
"""Where the data departed from what the paper assumes of fuzzy sets."""
