"""Error against run time: a point for each way of running a model."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

from fuzzytree.benchmarking import Kind, Point, Question, Study, Timing, error_of
from fuzzytree.report.plots.sheet import SIZE, style
from fuzzytree.report.text import UNITS, counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS: Mapping[Question, str] = {
    "tree": "#c04d00",
    "relative rules": "#0072b2",
    "raw rules": "#00795a",
    "rules": "#0072b2",
}
"""Of forms of a model: the colour-blind can distinguish them; letters are readable."""

MARKERS: Mapping[Kind, str] = {"runtime": "o", "variant": "^", "peer": "D"}
"""Of kinds of candidates; a floor is a line."""

Measure = Literal["strength", "class"]

_TITLES: Mapping[Measure, tuple[str, str]] = {
    "strength": ("error of a strength\n(its certified bound, if any)", "exact"),
    "class": ("rows with\nanother class", "none"),
}
"""The label of each vertical axis, and the word for an error of 0."""

_HEIGHTS: Mapping[Measure, float] = {"strength": 3.4, "class": 2.3}  # inches
_LOWEST = 1e-18  # observed errors below it are not followed
_GREY = "#555555"
_DASHES = (0, (4, 3))
_FEW = 100  # points, up to which peers are named as well
_MARKER = 4.5  # half the width of a marker, in pixels
_DISTANCES = (7, 12, 18, 26, 36, 48, 62, 80, 100, 125)  # of a name, in points
_SIDES = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
_ACROSS: Final = ("center", "left", "right")  # by a side's -1, 0 or 1
_UP: Final = ("center", "bottom", "top")


class Mark(NamedTuple):
    """A candidate in the picture; of the front none is both faster and more exact."""

    point: Point
    timing: Timing
    measure: Measure
    error: float
    is_front: bool

    @property
    def nanoseconds(self) -> float:
        """The median time of one row."""
        return self.timing.median_ns / self.timing.rows

    @property
    def observed(self) -> float | None:
        """The largest observed error, if a larger bound is drawn."""
        largest = self.point.error.largest if self.point.error else None
        is_drawn = largest is None or largest >= self.error
        return None if self.measure == "class" or is_drawn else largest


def work_precision(study: Study, *, rows: int, threads: int = 1) -> Figure:
    """Draw the error of every candidate against its time for one row.

    Rules lie at the certified bound of their strengths, or at the largest observed
    error where nothing is certified; a thin line leads from the bound down to what
    was observed. Trees, and peers without strengths, lie at the share of rows whose
    class is not the exact one. Both axes are logarithmic; an error of 0 lies on a
    grey line of its own. Bars are 95 % intervals of the median.

    Args:
        study: What was measured.
        rows: The number of rows in each call.
        threads: The number of threads of each call.

    Returns:
        A figure of its own, outside of any state of the library.

    Raises:
        ValueError: If nothing was measured with so many rows and threads.
        MissingExtraError: If matplotlib is not installed.
    """
    marks = [*marks_of(study, rows, threads)]
    if not marks:
        raise ValueError(_nothing_text(study, rows, threads))
    floors = [
        (point.name.removeprefix("floor: "), one.median_ns / one.rows)
        for point, one in _timed(study, rows, threads)
        if point.kind == "floor"
    ]
    measures: list[Measure] = [
        m for m in _TITLES if any(mark.measure == m for mark in marks)
    ]
    with style():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        heights = [
            _HEIGHTS[one] if any(m.error for m in marks if m.measure == one) else 1.1
            for one in measures
        ]
        figure = Figure(figsize=(8.0, sum(heights) + 1.1))
        FigureCanvasAgg(figure)
        whole = figure.get_figheight()
        figure.subplots_adjust(0.115, 0.75 / whole, 0.985, 1.0 - 0.62 / whole, 0, 0.1)
        ratios = {"height_ratios": heights}
        panels = figure.subplots(len(measures), sharex=True, gridspec_kw=ratios)
        axes: dict[Measure, Axes] = dict(zip(measures, _flat(panels), strict=True))
        _scale_times([*axes.values()], marks, [time for _, time in floors])
        places: dict[str, float] = {}  # the height of each candidate's marker
        for measure, panel in axes.items():
            mine = [mark for mark in marks if mark.measure == measure]
            places |= _draw_panel(panel, measure, mine)
            for _, time in floors:
                panel.axvline(time, color=_GREY, linewidth=0.9, linestyle=_DASHES)
        _name_floors(axes[measures[0]], floors)
        _draw_words(figure, study, rows, threads)
        _draw_legend(figure, marks, has_floors=bool(floors))
        _name_marks(figure, axes, marks, places)
    return figure


def marks_of(study: Study, rows: int, threads: int) -> Iterator[Mark]:
    """Yield what is to be drawn, the front first, then by time."""
    key = (rows, threads)
    fronts = {
        name
        for front in study.fronts
        if (front.rows, front.threads) == key
        for name in front.names
    }
    marks: list[Mark] = []
    for point, timing in _timed(study, rows, threads):
        if point.error is None or not point.error.rows:
            continue
        error = error_of(point)
        measure: Measure = "strength"
        if point.question == "tree" or error is None:
            measure, error = "class", point.error.flips / point.error.rows
        height = error if error <= 1.0 else 1.0  # NaN and infinity are drawn at 1
        marks.append(Mark(point, timing, measure, height, point.name in fronts))
    yield from sorted(
        marks, key=lambda m: (not m.is_front, m.nanoseconds, m.point.name)
    )


def _timed(study: Study, rows: int, threads: int) -> Iterator[tuple[Point, Timing]]:
    for point in study.points:
        for timing in point.timings:
            if (timing.rows, timing.threads) == (rows, threads):
                yield point, timing


def _nothing_text(study: Study, rows: int, threads: int) -> str:
    known = {(one.rows, one.threads) for point in study.points for one in point.timings}
    text = ", ".join(f"{rows} with {threads}" for rows, threads in sorted(known))
    return (
        f"nothing was measured with {rows} rows and {threads} threads; "
        f"rows and threads in this study: {text or 'none'}"
    )


def _flat(axes: Any) -> list[Axes]:
    return [*getattr(axes, "flat", [axes])]


def _scale_times(
    panels: Sequence[Axes], marks: Sequence[Mark], floors: Sequence[float]
) -> None:
    """Give all axes the same times, among them at least one power of ten."""
    ends = [end / m.timing.rows for m in marks for end in _interval(m.timing)]
    low, high = min([*ends, *floors]) / 1.7, max([*ends, *floors]) * 1.7
    widening = max(1.0, math.sqrt(20.0 * low / high))
    for axes in panels:
        axes.set_xscale("log")
        axes.set_xlim(low / widening, high * widening)
        axes.xaxis.set_major_formatter(time_text)
        axes.xaxis.set_minor_formatter("")
        axes.tick_params(labelsize=SIZE)
        axes.grid(visible=True, which="major", color="#e4e4e4", linewidth=0.6)
        axes.set_axisbelow(True)
    panels[-1].set_xlabel("time for one row", fontsize=SIZE + 1)


def _interval(timing: Timing) -> tuple[float, float]:
    return timing.low_ns, timing.high_ns


def _draw_panel(
    axes: Axes, measure: Measure, marks: Sequence[Mark]
) -> dict[str, float]:
    """Draw markers, bars and the front; return the height of each marker by name."""
    title, nothing = _TITLES[measure]
    low, high = _decades(marks)
    has_zero = any(mark.error == 0.0 for mark in marks)
    zero = 10.0 ** (low - 1)  # where an error of 0 is drawn
    axes.set_yscale("log")
    axes.set_ylim(10.0 ** (low - 1.6 * has_zero), 10.0 ** (high + 0.3))
    steps = [*range(low, high + 1, 1 + (high - low) // 8)] if high > low else []
    ticks = {10.0**k: f"{100.0 * 10.0**k:.6g} %" for k in steps}
    if measure == "strength":
        ticks = {10.0**k: f"$10^{{{k}}}$" for k in steps}
    if has_zero:
        ticks[zero] = nothing
        axes.axhspan(10.0 ** (low - 2), zero * 10.0**0.5, color="#f4f4f4", zorder=0)
    axes.set_yticks([*ticks], [*ticks.values()])
    axes.yaxis.set_minor_formatter("")
    axes.tick_params(axis="y", which="minor", length=0)
    axes.set_ylabel(title, fontsize=SIZE + 1)
    for mark in reversed(marks):
        colour, time = COLOURS[mark.point.question], mark.nanoseconds
        ends = [end / mark.timing.rows for end in _interval(mark.timing)]
        height = mark.error or zero
        axes.errorbar(
            [time],
            [height],
            xerr=[[time - ends[0]], [ends[1] - time]],
            fmt=MARKERS[mark.point.kind],
            markersize=6.0 if mark.is_front else 4.5,
            color=colour,
            markerfacecolor=colour if mark.is_front else "white",
            ecolor=(colour, 1.0 if mark.is_front else 0.5),
            elinewidth=0.8,
            label=mark.point.name,
            zorder=5 if mark.is_front else 3,
        )
        if mark.is_front and mark.observed is not None:
            end = max(mark.observed, 10.0**low)
            axes.plot([time, time], [end, height], color=colour, linewidth=0.8)
    for question, colour in COLOURS.items():
        front = sorted(
            (m.nanoseconds, m.error or zero)
            for m in marks
            if m.is_front and m.point.question == question
        )
        if front:
            times, errors = zip(*front, (axes.get_xlim()[1], front[-1][1]), strict=True)
            axes.step(times, errors, where="post", color=colour, alpha=0.5, zorder=1.5)
    return {mark.point.name: mark.error or zero for mark in marks}


def _decades(marks: Sequence[Mark]) -> tuple[int, int]:
    """Return the exponents of ten around all errors above 0, and the observed ones."""
    errors = [mark.error for mark in marks if mark.error > 0.0]
    errors += [low for mark in marks if mark.is_front and (low := mark.observed)]
    if not errors:
        return 0, 0
    low = math.floor(math.log10(max(min(errors), _LOWEST)))
    return low, max(math.ceil(math.log10(max(errors))), low + 1)


def _name_floors(axes: Axes, floors: Sequence[tuple[str, float]]) -> None:
    fastest = min((time for _, time in floors), default=0.0)
    for name, time in floors:
        is_left = len(floors) > 1 and time == fastest  # two may nearly coincide
        axes.annotate(
            name,
            (time, 1.0),
            xycoords=axes.get_xaxis_transform(),
            xytext=(-2 if is_left else 2, -3),
            textcoords="offset points",
            rotation=90,
            ha="right" if is_left else "left",
            va="top",
            fontsize=SIZE - 1,
            color=_GREY,
            gid="floor",
        )


def _draw_words(figure: Figure, study: Study, rows: int, threads: int) -> None:
    calls = f"{rows:,} row{'' if rows == 1 else 's'} a call"
    early = "" if study.is_complete else " (ended early)"
    machine = study.machine
    title = f"{study.model}: error against run time, {calls}, "
    title += f"{counted(threads, 'thread')}{early}"
    place = f"{machine.processor}, {counted(machine.cores, 'core')}, {machine.system}"
    height = figure.get_figheight()
    bold: Any = {"fontsize": SIZE + 3, "fontweight": "bold"}
    figure.text(0.012, 1.0 - 0.14 / height, title, va="top", **bold)
    faint: Any = {"fontsize": SIZE - 0.5, "color": _GREY}
    figure.text(0.012, 1.0 - 0.38 / height, f"{place}; {study.data}", va="top", **faint)


def _draw_legend(figure: Figure, marks: Sequence[Mark], *, has_floors: bool) -> None:
    """Explain colours and markers in one line at the bottom."""
    from matplotlib.lines import Line2D

    looks: dict[str, Any] = {
        question: {"color": colour, "linewidth": 4}
        for question, colour in COLOURS.items()
        if any(m.point.question == question for m in marks)
    }
    for kind, marker in MARKERS.items():
        if any(m.point.kind == kind for m in marks):
            look = {"marker": marker, "linestyle": "", "markerfacecolor": "w"}
            looks[kind] = {"color": _GREY, **look}
    looks["unbeaten"] = {"color": _GREY, "marker": "o"}
    if has_floors:
        looks["floor"] = {"color": _GREY, "linestyle": _DASHES}
    figure.legend(
        handles=[Line2D([], [], label=name, **look) for name, look in looks.items()],
        loc="lower center",
        ncols=len(looks),
        fontsize=SIZE,
        frameon=False,
    )


def _name_marks(
    figure: Figure,
    panels: Mapping[Measure, Axes],
    marks: Sequence[Mark],
    heights: Mapping[str, float],
) -> None:
    """Write the names of the front, and of the peers where there are few points.

    Each name takes the nearest side of its marker where it covers no other name; that
    of a peer is left out if there is none.
    """
    from matplotlib.text import Text
    from matplotlib.transforms import Bbox

    canvas: Any = figure.canvas
    renderer = canvas.get_renderer()
    figure.draw_without_rendering()
    taken = [t.get_window_extent() for axes in figure.axes for t in axes.texts]
    for mark in marks:
        spot = (mark.nanoseconds, heights[mark.point.name])
        middle = panels[mark.measure].transData.transform(spot)
        taken.append(Bbox([middle - _MARKER, middle + _MARKER]))
    for mark in marks:
        is_peer = mark.point.kind == "peer" and len(marks) <= _FEW
        if not (mark.is_front or is_peer):
            continue
        axes = panels[mark.measure]
        frame = axes.get_window_extent()
        name = axes.annotate(
            mark.point.name.removesuffix(f": {mark.point.question}"),
            (mark.nanoseconds, heights[mark.point.name]),
            textcoords="offset points",
            xytext=(0, 0),
            color=COLOURS[mark.point.question],
            fontsize=SIZE if mark.is_front else SIZE - 1,
            fontweight="bold" if mark.is_front else "normal",
            arrowprops={"arrowstyle": "-", "color": "#bbbbbb", "linewidth": 0.5},
            zorder=6,
        )
        for distance, (right, up) in itertools.product(_DISTANCES, _SIDES):
            name.set_position((right * distance, up * distance))
            name.set_horizontalalignment(_ACROSS[right])
            name.set_verticalalignment(_UP[up])
            name.update_positions(renderer)
            box = Text.get_window_extent(name)
            inside = frame.x0 <= box.x0 <= box.x1 <= frame.x1
            inside &= frame.y0 <= box.y0 <= box.y1 <= frame.y1
            if inside and not any(box.overlaps(other) for other in taken):
                taken.append(box)
                break
        else:
            if not mark.is_front:
                name.remove()


def time_text(nanoseconds: float, _position: object = None) -> str:
    """Return a time as an axis shows it.

    Example:
        >>> time_text(10.0), time_text(2500.0), time_text(1e9)
        ('10 ns', '2.5 µs', '1 s')
    """
    for size, unit in UNITS:
        if nanoseconds >= size:
            return f"{nanoseconds / size:g} {unit}"
    return f"{nanoseconds:g} ns"
