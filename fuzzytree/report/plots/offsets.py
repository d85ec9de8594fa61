"""Error against the distance from zero: what stiff inputs cost in each number type."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.model.contracts import Dtype
from fuzzytree.report.plots.labels import SIZE, Label, dots_of, place
from fuzzytree.report.plots.panels import scale_strip
from fuzzytree.report.plots.saving import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fuzzytree.checking.stability.results import OffsetCost
    from fuzzytree.model.contracts import FloatArray

COLOURS: dict[Dtype, str] = {
    "float64": "#00795a",
    "mixed": "#0072b2",
    "float32": "#c04d00",
}
"""Of number types."""

_MARKERS = "os^D"  # of the forms of a model, in their order
_SIZE = (8.0, 4.4)  # inches
_STRIP = 0.16  # of the height, for an error of 0
_RIGHT = 50.0  # times the last ratio: room for the names of number types


class Curve(NamedTuple):
    """What one form of a model costs in one number type.

    Attributes:
        carrier: The form.
        dtype: The number type.
        ratios: Spread over distance, falling.
        errors: The largest error of a strength at each of them.
    """

    carrier: str
    dtype: Dtype
    ratios: tuple[float, ...]
    errors: tuple[float, ...]


def error_against_offset(name: str, costs: Sequence[OffsetCost]) -> Figure:
    """Draw what each number type costs the farther a model lies from zero.

    To the right, the narrowest term becomes small against its distance from zero.
    Upwards is the largest error of a strength against the exact answers of the moved
    model; an error of 0 lies in a strip of its own, and where a number type cannot
    hold the model its line ends.

    Args:
        name: Of the model.
        costs: As the stability study found them.

    Returns:
        A figure of its own, outside of any state of the library.

    Raises:
        ValueError: If there is nothing to draw.
        MissingExtraError: If matplotlib is not installed.
    """
    curves = [*curves_of(costs)]
    if not curves:
        raise ValueError(f"{name}: no error was measured at any distance from zero")
    with style():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=_SIZE)
        FigureCanvasAgg(figure)
        logs, strip = _axes(figure, curves)
        carriers = [*dict.fromkeys(curve.carrier for curve in curves)]
        shapes = dict(zip(carriers, itertools.cycle(_MARKERS), strict=False))
        for curve in curves:
            _draw(logs, strip, curve, shapes[curve.carrier])
        _draw_words(figure, name, shapes)
        figure.draw_without_rendering()
        taken = np.concatenate([*_dots(logs, strip, curves, figure.dpi / 72.0)])
        place(figure, [*_labels(logs, strip, curves)], taken)
    return figure


def curves_of(costs: Sequence[OffsetCost]) -> Iterator[Curve]:
    """Yield a curve for each form and number type that was measured at all."""
    for carrier in dict.fromkeys(cost.carrier for cost in costs):
        mine = sorted(
            (c for c in costs if c.carrier == carrier), key=lambda c: -c.ratio
        )
        for dtype in COLOURS:
            known = [
                (c.ratio, error) for c in mine if (error := _of(c, dtype)) is not None
            ]
            if known:
                ratios, errors = zip(*known, strict=True)
                yield Curve(carrier, dtype, ratios, errors)


def _of(cost: OffsetCost, dtype: Dtype) -> float | None:
    """Return an error as it is drawn: at 1 if it is larger, or no number."""
    errors = {"float64": cost.float64, "mixed": cost.mixed, "float32": cost.float32}
    error = errors[dtype]
    return error if error is None or error <= 1.0 else 1.0


def _axes(figure: Figure, curves: Sequence[Curve]) -> tuple[Axes, Axes]:
    """Return the log axes and, below, the strip of those without an error.

    The strip is the log axes themselves where no error is 0.
    """
    errors = [error for curve in curves for error in curve.errors]
    heights = (1.0 - _STRIP, _STRIP) if 0.0 in errors else (1.0,)
    grid = figure.add_gridspec(
        len(heights),
        1,
        height_ratios=heights,
        left=0.1,
        right=0.985,
        top=0.9,
        bottom=0.19,
        hspace=0.08,
    )
    axes = [figure.add_subplot(grid[i]) for i in range(len(heights))]
    logs, strip = axes[0], axes[-1]
    ratios = [ratio for curve in curves for ratio in curve.ratios]
    for one in axes:
        one.set_xscale("log")
        one.set_xlim(max(ratios) * 3.0, min(ratios) / _RIGHT)
        one.tick_params(labelsize=SIZE, labelbottom=one is strip)
        one.grid(visible=True, which="major", color="#e4e4e4", linewidth=0.6)
        one.set_axisbelow(True)
    strip.set_xlabel("spread over distance from zero", fontsize=SIZE + 1)
    _scale(logs, [error for error in errors if error > 0.0] or [1.0])
    if strip is not logs:
        scale_strip(strip, 1, "exact")
    return logs, strip


def _scale(logs: Axes, errors: Sequence[float]) -> None:
    lowest = math.floor(math.log10(min(errors)) - 0.3)
    highest = math.ceil(math.log10(max(errors))) + 0.3
    logs.set_yscale("log")
    logs.set_ylim(10.0**lowest, 10.0**highest)
    logs.yaxis.set_minor_formatter("")
    logs.set_ylabel("largest error of a strength", fontsize=SIZE + 1)


def _draw(logs: Axes, strip: Axes, curve: Curve, marker: str) -> None:
    """Draw a curve; its points without error stand in the strip."""
    colour = COLOURS[curve.dtype]
    points = [*zip(curve.ratios, curve.errors, strict=True)]
    above = [(ratio, error) for ratio, error in points if error > 0.0]
    exact = [(ratio, error) for ratio, error in points if error == 0.0]
    name = f"{curve.dtype}: {curve.carrier}"
    for axes, some, line in ((logs, above, "-"), (strip, exact, "")):
        if not some:
            continue
        ratios, heights = zip(*some, strict=True)
        axes.plot(
            ratios,
            heights,
            marker=marker,
            linestyle=line,
            color=colour,
            markersize=4.5,
            markerfacecolor=axes.get_facecolor(),
            linewidth=1.1,
            label=name,
        )


def _draw_words(figure: Figure, name: str, shapes: dict[str, str]) -> None:
    from matplotlib.lines import Line2D

    figure.text(
        0.012,
        0.97,
        f"{name}: error against the distance from zero",
        fontsize=SIZE + 3,
        fontweight="bold",
        va="top",
    )
    entries = [
        Line2D([], [], color="#555555", marker=marker, markerfacecolor="white", label=c)
        for c, marker in shapes.items()
    ]
    figure.legend(
        handles=entries,
        loc="lower center",
        ncols=len(entries),
        fontsize=SIZE,
        frameon=False,
    )


def _labels(logs: Axes, strip: Axes, curves: Sequence[Curve]) -> Iterator[Label]:
    """Yield the name of each number type, at the end of its first curve."""
    for dtype, colour in COLOURS.items():
        curve = next((curve for curve in curves if curve.dtype == dtype), None)
        if curve is not None:
            ratio, error = curve.ratios[-1], curve.errors[-1]
            yield Label(dtype, logs if error > 0.0 else strip, ratio, error, colour)


def _dots(
    logs: Axes, strip: Axes, curves: Sequence[Curve], scale: float
) -> Iterator[FloatArray]:
    """Yield the boxes of all markers, in pixels."""
    for curve in curves:
        for ratio, error in zip(curve.ratios, curve.errors, strict=True):
            axes = logs if error > 0.0 else strip
            yield dots_of(axes, np.array([[ratio, error]]), scale)
