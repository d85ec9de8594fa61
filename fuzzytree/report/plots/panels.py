"""The axes of a picture: errors upwards, run time to the right, both logarithmic."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, get_args

from fuzzytree.benchmarking.records import Question
from fuzzytree.report.plots.labels import SIZE
from fuzzytree.report.plots.marks import Mark, Measure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AXES: dict[Measure, str] = {
    "strength": "error of a strength\n(its certified bound, if any)",
    "class": "rows with\nanother class",
}
"""What the axes are called."""

NOTHING: dict[Measure, str] = {"strength": "exact", "class": "none"}
"""What an error of 0 is called."""

WIDTH = 8.0
"""Of the picture, in inches."""

_LOWEST = 1e-18  # observed errors below it are not followed
_HEIGHTS: dict[Measure, float] = {"strength": 3.4, "class": 1.9}
_LANE = 0.34  # of a question in a strip
_ROOM = 1.1  # of a strip alone, for names
_LEAST_RATIO = 20.0  # of times, so that one power of ten is among them
_TOP, _BOTTOM = 0.62, 0.83  # for words above, and the legend below
_UNITS = (("s", 1e9), ("ms", 1e6), ("µs", 1e3), ("ns", 1.0))


class Panel(NamedTuple):
    """The axes of one measure: a log axis, and below it a strip for an error of 0.

    Attributes:
        measure: What is drawn upwards.
        logs: None if every error is 0.
        strip: None if none is.
        lanes: The question of each line of the strip, from the top.
    """

    measure: Measure
    logs: Axes | None
    strip: Axes | None
    lanes: tuple[Question, ...]

    def spot(self, mark: Mark) -> tuple[Axes, float, float]:
        """Return where a mark of this measure lies: axes, time and height."""
        if self.logs is None or (mark.error == 0.0 and self.strip is not None):
            lane = self.lanes.index(mark.point.question)
            axes = self.strip
            height = -float(lane)
        else:
            axes, height = self.logs, mark.error
        assert axes is not None  # it was made for this mark
        return axes, mark.nanoseconds, height


def panels_of(figure: Figure, marks: Sequence[Mark]) -> list[Panel]:
    """Return the axes, one below the other, as high as what they hold."""
    plans: list[tuple[Measure, bool, tuple[Question, ...]]] = []
    for measure in AXES:
        errors = [(m.error, m.point.question) for m in marks if m.measure == measure]
        lanes = tuple(q for q in get_args(Question) if (0.0, q) in errors)
        if errors:
            plans.append((measure, any(error > 0.0 for error, _ in errors), lanes))
    heights: list[float] = []
    for measure, has_logs, lanes in plans:
        heights += [_HEIGHTS[measure]] * has_logs
        high = _LANE * (len(lanes) + 0.6)
        heights += [high if has_logs else max(high, _ROOM)] * bool(lanes)
    height = sum(heights) + _TOP + _BOTTOM
    figure.set_size_inches(WIDTH, height)
    grid = figure.add_gridspec(
        len(heights),
        1,
        height_ratios=heights,
        left=0.115,
        right=0.985,
        top=1.0 - _TOP / height,
        bottom=_BOTTOM / height,
        hspace=0.08,
    )
    axes = [figure.add_subplot(grid[i]) for i in range(len(heights))]
    found: list[Panel] = []
    for measure, has_logs, lanes in plans:
        logs = axes.pop(0) if has_logs else None
        strip = axes.pop(0) if lanes else None
        found.append(Panel(measure, logs, strip, lanes))
    return found


def scale_panels(
    panels: Sequence[Panel], marks: Sequence[Mark], floors: Sequence[tuple[str, float]]
) -> None:
    """Give all axes the same times, and each log axis the decades of its errors."""
    times = [time for _, time in floors]
    times += [time for m in marks for time in m.interval]
    low, high = min(times) / 1.7, max(times) * 1.7
    widening = max(1.0, math.sqrt(_LEAST_RATIO * low / high))
    low, high = low / widening, high * widening
    drawn = [axes for p in panels for axes in (p.logs, p.strip) if axes is not None]
    for axes in drawn:
        axes.set_xscale("log")
        axes.set_xlim(low, high)
        axes.xaxis.set_major_formatter(time_text)
        axes.xaxis.set_minor_formatter("")
        axes.tick_params(labelsize=SIZE, labelbottom=axes is drawn[-1])
        axes.grid(visible=True, which="major", color="#e4e4e4", linewidth=0.6)
        axes.set_axisbelow(True)
    drawn[-1].set_xlabel("time for one row", fontsize=SIZE + 1)
    for panel in panels:
        mine = [m for m in marks if m.measure == panel.measure]
        if panel.logs is not None:
            panel.logs.set_yscale("log")
            panel.logs.set_ylim(*_decades(mine))
            panel.logs.set_ylabel(AXES[panel.measure], fontsize=SIZE + 1)
            panel.logs.yaxis.set_minor_formatter("")
            if panel.measure == "class":
                panel.logs.yaxis.set_major_formatter(share_text)
        if panel.strip is not None:
            scale_strip(panel.strip, len(panel.lanes), NOTHING[panel.measure])
            if panel.logs is None:
                panel.strip.set_ylabel(AXES[panel.measure], fontsize=SIZE + 1)


def _decades(marks: Sequence[Mark]) -> tuple[float, float]:
    """Return the whole decades around all errors, and what the front showed of them."""
    errors = [m.error for m in marks if m.error > 0.0]
    errors += [seen for m in marks if m.is_front if (seen := m.observed)]
    lowest = math.floor(math.log10(max(min(errors), _LOWEST)) - 0.3)
    highest = math.ceil(math.log10(max(errors)) + 0.2)
    highest = min(highest, 0) if max(errors) < 1.0 else highest
    return 10.0**lowest, 10.0**highest


def scale_strip(strip: Axes, lanes: int, word: str) -> None:
    """Make a strip look like what it is: no part of the axis above."""
    strip.set_ylim(-(lanes - 0.5) - 0.3, 0.8)
    strip.set_yticks([(1 - lanes) / 2.0], [word])
    strip.tick_params(axis="y", length=0)
    strip.set_facecolor("#f4f4f4")
    strip.grid(visible=False, axis="y")


def time_text(nanoseconds: float, _position: object = None) -> str:
    """Return a time as an axis shows it.

    Example:
        >>> time_text(10.0), time_text(2500.0), time_text(1e9)
        ('10 ns', '2.5 µs', '1 s')
    """
    for unit, size in _UNITS:
        if nanoseconds >= size:
            return f"{nanoseconds / size:g} {unit}"
    return f"{nanoseconds:g} ns"


def share_text(share: float, _position: object = None) -> str:
    """Return a share of rows as an axis shows it.

    Example:
        >>> share_text(0.1), share_text(0.001)
        ('10 %', '0.1 %')
    """
    return f"{share * 100.0:.6g} %"
