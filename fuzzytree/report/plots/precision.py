"""Error against run time: a point for each way of running a model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.benchmarking.records import Study
from fuzzytree.report.plots.labels import SIZE, Label, dots_of, place
from fuzzytree.report.plots.marks import (
    COLOURS,
    MARKERS,
    Mark,
    floors_of,
    marks_of,
    nothing_text,
)
from fuzzytree.report.plots.panels import WIDTH, Panel, panels_of, scale_panels
from fuzzytree.report.plots.saving import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_GREY = "#555555"
_DASHES = (0, (4, 3))
_FEW = 100  # points, up to which peers are named as well


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
        raise ValueError(nothing_text(study, rows, threads))
    with style():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 1.0))
        FigureCanvasAgg(figure)
        panels = panels_of(figure, marks)
        floors = [*floors_of(study, rows, threads)]
        scale_panels(panels, marks, floors)
        for panel in panels:
            _draw_marks(panel, [m for m in marks if m.measure == panel.measure])
        _draw_fronts(panels, marks)
        _draw_floors(panels, floors)
        _draw_words(figure, study, rows, threads)
        _draw_legend(figure, marks, has_floors=bool(floors))
        _draw_labels(figure, panels, marks)
    return figure


def _draw_marks(panel: Panel, marks: Sequence[Mark]) -> None:
    """Draw markers by kind, colours by question, bars, and the front filled."""
    for mark in reversed(marks):
        axes, time, height = panel.spot(mark)
        colour = COLOURS[mark.point.question]
        low, high = mark.interval
        axes.errorbar(
            [time],
            [height],
            xerr=[[time - low], [high - time]],
            fmt=MARKERS[mark.point.kind],
            markersize=6.0 if mark.is_front else 4.5,
            color=colour,
            markerfacecolor=colour if mark.is_front else axes.get_facecolor(),
            markeredgewidth=1.0,
            ecolor=(colour, 1.0 if mark.is_front else 0.5),
            elinewidth=0.8,
            label=mark.point.name,
            zorder=5 if mark.is_front else 3,
        )
        if mark.is_front and mark.observed is not None:
            _draw_observed(axes, time, height, mark.observed, colour)


def _draw_observed(
    axes: Axes, time: float, bound: float, observed: float, colour: str
) -> None:
    """Lead from a bound down to what was observed, or to the end of the axis."""
    bottom = axes.get_ylim()[0]
    low = max(observed, bottom)
    axes.plot([time, time], [low, bound], color=colour, linewidth=0.8, zorder=2)
    if observed >= bottom:
        axes.plot([time], [low], "_", color=colour, markersize=6)


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
            bottom, right = panel.logs.get_ylim()[0], panel.logs.get_xlim()[1]
            times = [time for time, _ in members] + [right]
            errors = [max(error, bottom) for _, error in members]
            panel.logs.plot(
                [times[0], *(t for time in times[1:] for t in (time, time))][:-1],
                [error for error in errors for _ in range(2)],
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
                axes.axvline(time, color=_GREY, linewidth=0.9, linestyle=_DASHES)
    first = panels[0].logs or panels[0].strip
    if first is None:
        return
    fastest = min(floors, key=lambda floor: floor[1], default=None)
    for name, time in floors:
        is_left = len(floors) > 1 and (name, time) == fastest  # two may nearly coincide
        first.annotate(
            name,
            (time, 1.0),
            xycoords=first.get_xaxis_transform(),
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


def _draw_legend(figure: Figure, marks: Sequence[Mark], *, has_floors: bool) -> None:
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
    entries.append(Line2D([], [], color=_GREY, marker="o", label="unbeaten"))
    if any(m.is_front and m.observed is not None for m in marks):
        seen = Line2D([], [], color=_GREY, marker="_", linestyle="", label="observed")
        entries.append(seen)
    if has_floors:
        line = Line2D([], [], color=_GREY, linestyle=_DASHES, label="floor")
        entries.append(line)
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
        axes, time, height = by_measure[mark.measure].spot(mark)
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
