"""Frames as pictures: one scale of colours for all, white where nothing presses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fuzzytree.report import SIZE, short, style

if TYPE_CHECKING:
    import numpy.typing as npt
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

    Cells = npt.NDArray[np.integer | np.floating]

MOST_FRAMES = 100
"""The most frames in one picture."""

_PANEL = 1.9  # inches, the longer side of a frame
_ROOM = (1.1, 0.5)  # beside and above the frames
_THIN = 19.0  # a frame that is longer is drawn wider than it is
_DOTS = 420  # a picture of fewer dots than this is enlarged, each cell to a square
_LONGEST = 26  # letters above a frame; what is longer is cut and ends in dots
_LETTER = 0.115  # inches, the most that one of a title takes on average
_COLOURS = 240  # of 256: without the ones that are black
_EDGE = "#8c959f"
_AXIS = "#00a3c4"  # seen on white and on the darkest colour


class FrameAxis(NamedTuple):
    """The centre of pressure and the principal axis of a frame.

    Attributes:
        x: In cells to the right of the middle, as the feature `x`.
        y: In cells above the middle, as the feature `y`.
        angle_deg: Of the principal axis, from right to up, as the feature `angle`;
            None for no axis.
        length: Of the axis to either side, in cells.
    """

    x: float
    y: float
    angle_deg: float | None = None
    length: float = 3.0


def colours() -> Colormap:
    """Return the colours of pressure, from pale to dark; white for nothing.

    Lightness falls evenly, so that the order is the same for the colour-blind and on
    paper without colour.
    """
    import matplotlib as mpl
    from matplotlib.colors import ListedColormap

    found = mpl.colormaps["magma_r"](range(_COLOURS))
    return ListedColormap(found, name="pressure").with_extremes(bad="white")


def draw_frames(
    frames: Sequence[Cells],
    *,
    titles: Sequence[str] = (),
    title: str = "",
    axes: Sequence[FrameAxis | None] = (),
    cells: Sequence[tuple[int, int]] = (),
    columns: int | None = None,
    unit: str = "pressure",
) -> Figure:
    """Draw frames beside each other, in one scale of colours.

    What is 0 or less is white, and the largest number of all has the darkest colour.

    Args:
        frames: Each of shape (rows, columns), the first row at the top; they may have
            different shapes.
        titles: One above each, or none at all.
        title: Above all.
        axes: What to mark in each; empty for nothing.
        cells: The rows and columns of cells that the axes of each frame count in, if
            it was interpolated; its own shape unless given.
        columns: How many stand in a row; about as many as there are rows unless given.
        unit: What the scale is called.

    Returns:
        A figure of its own, outside of any state of the library.

    Raises:
        ValueError: If there is no frame, too many, or one that is none; if titles,
            axes or cells are not as many.
        MissingExtraError: If matplotlib is not installed.
    """
    drawn = [np.asarray(frame, np.float64) for frame in frames]
    _check(drawn, titles=titles, axes=axes, cells=cells)
    end = max(float(frame.max()) for frame in drawn)
    across = min(columns or len(drawn), len(drawn))
    if not columns and across > 4:
        across = math.ceil(math.sqrt(across))  # about a square
    down = math.ceil(len(drawn) / across)
    with style():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        width = across * _PANEL + _ROOM[0]
        figure = Figure((width, down * _PANEL + _ROOM[1]), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(down, across, squeeze=False).ravel().tolist()
        shapes = cells or [frame.shape for frame in drawn]
        full = end if end > 0.0 else 1.0
        images = [_draw(*pair, full) for pair in zip(panels, drawn, strict=False)]
        for number, frame in enumerate(drawn):
            if titles:
                words = short(titles[number], _LONGEST)
                panels[number].set_title(words, fontsize=SIZE, pad=4, parse_math=False)
            if axes and (axis := axes[number]) is not None:
                _mark(panels[number], axis, frame.shape, shapes[number])
        for panel in panels[len(drawn) :]:
            panel.remove()
        bar = figure.colorbar(images[-1], ax=panels[: len(drawn)], shrink=0.9)
        bar.set_label(unit, fontsize=SIZE)
        bar.outline.set(color=_EDGE, linewidth=0.6)
        bar.ax.tick_params(labelsize=SIZE - 1, length=2.5, color=_EDGE)
        bar.ax.locator_params(nbins=5)
        if title:
            words = short(title, max(int(width / _LETTER), 1))
            bold: Any = {"fontweight": "bold", "fontsize": SIZE + 3}
            figure.suptitle(words, x=0.02, ha="left", parse_math=False, **bold)
        figure.draw_without_rendering()  # which makes the layout
    return figure


def _check(frames: Sequence[Cells], **others: Sequence[object]) -> None:
    if not 1 <= len(frames) <= MOST_FRAMES:
        raise ValueError(f"a picture has 1 to {MOST_FRAMES} frames, not {len(frames)}")
    for number, frame in enumerate(frames, 1):
        if frame.ndim != 2 or not frame.size or not np.isfinite(frame).all():
            raise ValueError(
                f"frame {number} of shape {frame.shape} is no matrix of finite numbers"
            )
    for name, found in others.items():
        if found and len(found) != len(frames):
            raise ValueError(f"{len(found)} {name} for {len(frames)} frames")


def _draw(panel: Axes, frame: Cells, end: float) -> Any:
    """Draw a frame; each of its cells is a square of the same dots."""
    times = max(1, -(-_DOTS // max(frame.shape)))
    dots = np.repeat(np.repeat(frame, times, axis=0), times, axis=1)
    image = panel.imshow(
        np.ma.masked_less_equal(dots, 0.0),
        cmap=colours(),
        vmin=0.0,
        vmax=end,
        interpolation="none",
        aspect="auto",
        extent=(0.0, frame.shape[1], 0.0, frame.shape[0]),
    )
    panel.set_xticks([])
    panel.set_yticks([])
    for spine in panel.spines.values():
        spine.set(color=_EDGE, linewidth=0.6)
    panel.set_box_aspect(min(max(frame.shape[0] / frame.shape[1], 1 / _THIN), _THIN))
    return image


def _mark(
    panel: Axes, axis: FrameAxis, shape: tuple[int, ...], cells: tuple[int, ...]
) -> None:
    """Draw the centre of pressure and the principal axis of a frame."""
    from matplotlib.patheffects import withStroke

    up, right = shape[0] / cells[0], shape[1] / cells[1]
    x, y = shape[1] / 2.0 + axis.x * right, shape[0] / 2.0 + axis.y * up
    if axis.angle_deg is not None:
        turn = math.radians(axis.angle_deg)
        along = axis.length * math.cos(turn) * right
        rise = axis.length * math.sin(turn) * up
        (line,) = panel.plot(
            [x - along, x + along], [y - rise, y + rise], color=_AXIS, linewidth=1.3
        )
        line.set_path_effects([withStroke(linewidth=3.0, foreground="white")])
        line.set_gid("axis")
    (dot,) = panel.plot([x], [y], "o", color=_AXIS, markersize=4.5, mec="white")
    dot.set_gid("centre")
    panel.set_xlim(0.0, shape[1])
    panel.set_ylim(0.0, shape[0])
