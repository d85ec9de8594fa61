"""Error against run time: a point for each way of running a model."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from fuzzytree.plots.labels import SIZE, Label, dots_of, place
from fuzzytree.plots.saving import style
from fuzzytree.timing.front import error_of
from fuzzytree.timing.records import Kind, Point, Question, Study, Timing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS: dict[Question, str] = {
    "tree": "#c04d00",
    "relative rules": "#0072b2",
    "raw rules": "#00795a",
    "rules": "#0072b2",
}
"""Of questions: told apart by the colour-blind, and dark enough for letters."""

MARKERS: dict[Kind, str] = {"runtime": "o", "variant": "^", "peer": "D"}
"""Of kinds; a floor is a line."""

Measure = Literal["strength", "class"]

AXES: dict[Measure, str] = {
    "strength": "error of a strength\n(its certified bound, if any)",
    "class": "share of rows\nwith another class",
}
"""What is drawn upwards: both on a log axis, with a strip for 0."""

_WIDTH = 8.0  # inches
_HEIGHTS: dict[Measure, float] = {"strength": 3.4, "class": 1.9}
_LANE = 0.34
_FRAME = 1.45  # inches around the panels: title, legend, names of axes
_GREY = "#555555"
_FEW = 40  # points, up to which peers are named as well
_UNITS = (("s", 1e9), ("ms", 1e6), ("µs", 1e3), ("ns", 1.0))


class Mark(NamedTuple):
    """A point of the picture.

    Attributes:
        point: Of the study.
        timing: Its time that is drawn.
        measure: Which panel it is in.
        error: The number drawn there.
        is_front: Whether nobody beats it in both.
    """

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
    def name(self) -> str:
        """The candidate's name without its question, which the colour tells."""
        return self.point.name.removesuffix(f": {self.point.question}")


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


def work_precision(study: Study, *, rows: int, threads: int = 1) -> Figure:
    """Draw the error of every candidate against its time for one row.

    Rules lie at the certified bound of their strengths, or at the largest error that
    was observed where nothing is certified; a thin line leads from the bound down to
    what was observed. Trees, and peers that tell no strengths, lie at the share of rows
    whose class is not the exact one. Logarithmic axes have no 0: who makes no error
    lies in a strip of its own. Bars are 95 % intervals of the median.

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
    with style():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(_WIDTH, 1.0))
        FigureCanvasAgg(figure)
        panels = _panels(figure, marks)
        floors = [*_floors(study, rows, threads)]
        _scale(panels, marks, floors)
        for panel in panels:
            _draw_marks(panel, [m for m in marks if m.measure == panel.measure])
        _draw_fronts(panels, marks)
        _draw_floors(panels, floors)
        _draw_words(figure, study, rows, threads)
        _draw_legend(figure, marks)
        _draw_labels(figure, panels, marks)
    return figure


def marks_of(study: Study, rows: int, threads: int) -> Iterator[Mark]:
    """Yield what is to be drawn, the front first, then by time."""
    fronts = {
        name
        for front in study.fronts
        if (front.rows, front.threads) == (rows, threads)
        for name in front.names
    }
    found: list[Mark] = []
    for point, timing in _timed(study, rows, threads):
        if point.error is None or not point.error.rows:
            continue
        error = error_of(point)
        measure: Measure = "strength"
        if point.question == "tree" or error is None:
            measure, error = "class", point.error.flips / point.error.rows
        found.append(Mark(point, timing, measure, error, point.name in fronts))
    yield from sorted(found, key=lambda m: (not m.is_front, m.nanoseconds, m.name))


def _timed(study: Study, rows: int, threads: int) -> Iterator[tuple[Point, Timing]]:
    for point in study.points:
        for timing in point.timings:
            if (timing.rows, timing.threads) == (rows, threads):
                yield point, timing


def _floors(study: Study, rows: int, threads: int) -> Iterator[tuple[str, float]]:
    for point, timing in _timed(study, rows, threads):
        if point.kind == "floor":
            yield point.name.removeprefix("floor: "), timing.median_ns / timing.rows


def _nothing_text(study: Study, rows: int, threads: int) -> str:
    known = sorted(
        {(one.rows, one.threads) for point in study.points for one in point.timings}
    )
    text = ", ".join(f"{rows} with {threads}" for rows, threads in known)
    return (
        f"nothing was measured with {rows} rows and {threads} threads; "
        f"rows and threads in this study: {text or 'none'}"
    )


def _panels(figure: Figure, marks: Sequence[Mark]) -> list[Panel]:
    """Return the axes, one below the other, as high as what they hold."""
    plans: list[tuple[Measure, bool, tuple[Question, ...]]] = []
    for measure in AXES:
        errors = [(m.error, m.point.question) for m in marks if m.measure == measure]
        lanes = tuple(question for question in COLOURS if (0.0, question) in errors)
        if errors:
            plans.append((measure, any(error > 0.0 for error, _ in errors), lanes))
    heights: list[float] = []
    for measure, has_logs, lanes in plans:
        heights += [_HEIGHTS[measure]] * has_logs
        heights += [_LANE * (len(lanes) + 0.6)] * bool(lanes)
    figure.set_size_inches(_WIDTH, sum(heights) + _FRAME)
    grid = figure.add_gridspec(
        len(heights),
        1,
        height_ratios=heights,
        left=0.115,
        right=0.985,
        top=1.0 - 0.62 / (sum(heights) + _FRAME),
        bottom=0.83 / (sum(heights) + _FRAME),
        hspace=0.08,
    )
    axes = [figure.add_subplot(grid[i]) for i in range(len(heights))]
    found: list[Panel] = []
    for measure, has_logs, lanes in plans:
        logs = axes.pop(0) if has_logs else None
        strip = axes.pop(0) if lanes else None
        found.append(Panel(measure, logs, strip, lanes))
    return found


def _scale(
    panels: Sequence[Panel], marks: Sequence[Mark], floors: Sequence[tuple[str, float]]
) -> None:
    """Give all axes the same times, and each log axis the decades of its errors."""
    times = [time for _, time in floors]
    times += [t / m.timing.rows for m in marks for t in _interval(m.timing)]
    low, high = min(times) / 1.7, max(times) * 1.7
    drawn = [axes for p in panels for axes in (p.logs, p.strip) if axes is not None]
    for axes in drawn:
        axes.set_xscale("log")
        axes.set_xlim(low, high)
        axes.xaxis.set_major_formatter(time_text)
        axes.tick_params(labelsize=SIZE, labelbottom=axes is drawn[-1])
        axes.grid(visible=True, which="major", color="#e4e4e4", linewidth=0.6)
        axes.set_axisbelow(True)
    drawn[-1].set_xlabel("time for one row", fontsize=SIZE + 1)
    for panel in panels:
        errors = [m.error for m in marks if m.measure == panel.measure if m.error > 0.0]
        if panel.logs is not None:
            panel.logs.set_yscale("log")
            lowest = math.floor(math.log10(min(errors)) - 0.3)
            highest = math.ceil(math.log10(max(errors)) + 0.3)
            panel.logs.set_ylim(10.0**lowest, 10.0**highest)
            panel.logs.set_ylabel(AXES[panel.measure], fontsize=SIZE + 1)
        if panel.strip is not None:
            _scale_strip(panel.strip, len(panel.lanes), is_alone=panel.logs is None)


def _interval(timing: Timing) -> tuple[float, float, float]:
    return timing.low_ns, timing.median_ns, timing.high_ns


def _scale_strip(strip: Axes, lanes: int, *, is_alone: bool) -> None:
    """Make a strip look like what it is: no part of the axis above."""
    strip.set_ylim(-(lanes - 0.5) - 0.3, 0.8)
    strip.set_yticks([(1 - lanes) / 2.0], ["exact"])
    strip.tick_params(axis="y", length=0)
    strip.set_facecolor("#f4f4f4")
    strip.grid(visible=False, axis="y")
    if is_alone:
        strip.set_ylabel("classes", fontsize=SIZE + 1)


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


def _spot(panel: Panel, mark: Mark) -> tuple[Axes, float, float]:
    """Return where a mark lies: its axes, its time and its height there."""
    if mark.error == 0.0 and panel.strip is not None:
        lane = panel.lanes.index(mark.point.question)
        return panel.strip, mark.nanoseconds, -float(lane)
    if panel.logs is None:
        raise AssertionError(f"{mark.name} has an error and no axis for it")
    return panel.logs, mark.nanoseconds, mark.error


def _draw_marks(panel: Panel, marks: Sequence[Mark]) -> None:
    """Draw markers by kind, colours by question, bars, and the front in full colour."""
    for mark in reversed(marks):
        axes, time, height = _spot(panel, mark)
        colour = COLOURS[mark.point.question]
        low, median, high = _interval(mark.timing)
        rows = mark.timing.rows
        axes.errorbar(
            [time],
            [height],
            xerr=[[(median - low) / rows], [(high - median) / rows]],
            fmt=MARKERS[mark.point.kind],
            markersize=6.0 if mark.is_front else 4.5,
            color=colour,
            markerfacecolor=colour if mark.is_front else "white",
            markeredgewidth=1.0,
            elinewidth=0.8,
            alpha=1.0 if mark.is_front else 0.75,
            label=mark.point.name,
            zorder=5 if mark.is_front else 3,
        )
        seen = mark.point.error.largest if mark.point.error else None
        if mark.is_front and mark.measure == "strength" and seen is not None:
            floor = axes.get_ylim()[0]
            if mark.error > seen and axes is panel.logs:
                ends = [max(seen, floor), mark.error]
                axes.plot([time, time], ends, color=colour, linewidth=0.8, zorder=2)
                if seen > floor:
                    axes.plot([time], [seen], "_", color=colour, markersize=6)


def _draw_fronts(panels: Sequence[Panel], marks: Sequence[Mark]) -> None:
    """Join the members of each front by steps, down to the strip for the exact one."""
    for panel in panels:
        if panel.logs is None:
            continue
        for question, colour in COLOURS.items():
            members = sorted(
                (
                    (m.nanoseconds, m.error)
                    for m in marks
                    if m.is_front and m.point.question == question
                    if m.measure == panel.measure
                ),
            )
            if not members:
                continue
            times = [time for time, _ in members]
            errors = [max(error, panel.logs.get_ylim()[0]) for _, error in members]
            panel.logs.plot(
                [*times, panel.logs.get_xlim()[1]],
                [*errors, errors[-1]],
                drawstyle="steps-post",
                color=colour,
                linewidth=1.1,
                alpha=0.5,
                zorder=1.5,
            )


def _draw_floors(panels: Sequence[Panel], floors: Sequence[tuple[str, float]]) -> None:
    for panel in panels:
        for axes in (panel.logs, panel.strip):
            if axes is None:
                continue
            for _, time in floors:
                axes.axvline(time, color=_GREY, linewidth=0.9, linestyle=(0, (4, 3)))
    first = panels[0].logs or panels[0].strip
    if first is None:
        return
    for name, time in floors:
        first.annotate(
            name,
            (time, 1.0),
            xycoords=first.get_xaxis_transform(),
            xytext=(2, -3),
            textcoords="offset points",
            rotation=90,
            ha="left",
            va="top",
            fontsize=SIZE - 1,
            color=_GREY,
            gid="floor",
        )


def _draw_words(figure: Figure, study: Study, rows: int, threads: int) -> None:
    height = figure.get_figheight()
    calls = f"{rows:,} row{'' if rows == 1 else 's'} a call"
    with_threads = f"{threads} thread{'' if threads == 1 else 's'}"
    machine = study.machine
    cores = f"{machine.cores} core{'' if machine.cores == 1 else 's'}"
    early = "" if study.is_complete else " (ended early)"
    figure.text(
        0.012,
        1.0 - 0.14 / height,
        f"{study.model}: error against run time, {calls}, {with_threads}{early}",
        fontsize=SIZE + 3,
        fontweight="bold",
        va="top",
    )
    figure.text(
        0.012,
        1.0 - 0.38 / height,
        f"{machine.processor}, {cores}, {machine.system}; {study.data}",
        fontsize=SIZE - 0.5,
        color=_GREY,
        va="top",
    )


def _draw_legend(figure: Figure, marks: Sequence[Mark]) -> None:
    """Say what colours and markers mean, in one line at the bottom."""
    from matplotlib.lines import Line2D

    entries = [
        Line2D([], [], color=colour, linewidth=4, label=question)
        for question, colour in COLOURS.items()
        if any(m.point.question == question for m in marks)
    ]
    entries += [
        Line2D(
            [],
            [],
            color=_GREY,
            marker=marker,
            linestyle="",
            markerfacecolor="white",
            markersize=5,
            label=kind,
        )
        for kind, marker in MARKERS.items()
        if any(m.point.kind == kind for m in marks)
    ]
    entries.append(
        Line2D([], [], color=_GREY, marker="o", linestyle="-", label="nobody beats it")
    )
    entries.append(
        Line2D([], [], color=_GREY, linestyle=(0, (4, 3)), linewidth=0.9, label="floor")
    )
    figure.legend(
        handles=entries,
        loc="lower center",
        ncols=len(entries),
        fontsize=SIZE,
        frameon=False,
        handletextpad=0.5,
        columnspacing=1.4,
        borderaxespad=0.3,
    )


def _draw_labels(
    figure: Figure, panels: Sequence[Panel], marks: Sequence[Mark]
) -> None:
    """Name the front, and the peers where there are few points."""
    figure.draw_without_rendering()
    scale = figure.dpi / 72.0
    by_measure = {panel.measure: panel for panel in panels}
    boxes: list[np.ndarray[tuple[int, int], np.dtype[np.float64]]] = []
    labels: list[Label] = []
    for mark in marks:
        axes, time, height = _spot(by_measure[mark.measure], mark)
        boxes.append(dots_of(axes, np.array([[time, height]]), scale))
        is_peer = mark.point.kind == "peer" and len(marks) <= _FEW
        if mark.is_front or is_peer:
            colour = COLOURS[mark.point.question]
            one = Label(mark.name, axes, time, height, colour, mark.is_front)
            labels.append(one)
    for axes in figure.axes:
        for text in axes.texts:
            box = text.get_window_extent()
            boxes.append(np.array([[box.x0, box.y0, box.x1, box.y1]]))
    place(figure, labels, np.concatenate(boxes))
