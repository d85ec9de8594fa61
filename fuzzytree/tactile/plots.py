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
_GAP = 0.14
_MARGIN = 0.14
_WORDS = 0.22  # above each row of frames, if they have titles
_TITLE = 0.3
_BAR = (0.2, 0.12, 0.62)  # left of, of, and right of the scale
_DOTS = 420  # a picture of fewer dots than this is enlarged, each cell to a square
_LONGEST = 26  # letters above a frame; what is longer is cut and ends in dots
_LETTER = 0.115  # inches, the most that one of a title takes on average
_COLOURS = 240  # of 256: without the ones that are black
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
    largest = max(float(frame.max()) for frame in drawn)
    end = largest if largest > 0.0 else 1.0
    across = columns or len(drawn)
    if not columns and across > 4:
        across = math.ceil(math.sqrt(across))  # about a square
    with style():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure()
        FigureCanvasAgg(figure)
        panels = _panels(figure, drawn, across, words=titles, title=title)
        shapes = cells or [frame.shape for frame in drawn]
        for number, (panel, frame) in enumerate(zip(panels, drawn, strict=True)):
            image = _draw(panel, frame, end)
            if titles:
                words = short(titles[number], _LONGEST)
                panel.set_title(words, fontsize=SIZE, pad=4, parse_math=False)
            if axes and (axis := axes[number]) is not None:
                _mark(panel, axis, frame.shape, shapes[number])
            if panel is panels[-1]:
                _draw_scale(figure, image, unit)
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


def _panels(
    figure: Figure,
    frames: Sequence[Cells],
    across: int,
    *,
    words: Sequence[str],
    title: str,
) -> list[Axes]:
    """Make room for all frames, each as large as its longer side allows."""
    across = min(across, len(frames))
    down = math.ceil(len(frames) / across)
    sides = [_sides(frame.shape) for frame in frames]
    width, height = max(w for w, _ in sides), max(h for _, h in sides)
    above = _WORDS if words else 0.0
    top = _MARGIN + (_TITLE if title else 0.0)
    total_width = 2 * _MARGIN + across * width + (across - 1) * _GAP + sum(_BAR)
    total_height = top + _MARGIN + down * (height + above) + (down - 1) * _GAP
    figure.set_size_inches(total_width, total_height)
    if title:
        x, y = _MARGIN / total_width, 1.0 - _MARGIN / total_height
        words = short(title, max(int(total_width / _LETTER), 1))
        bold: dict[str, Any] = {"fontweight": "bold", "fontsize": SIZE + 3}
        figure.text(x, y, words, va="top", parse_math=False, **bold)
    found: list[Axes] = []
    for number, (wide, high) in enumerate(sides):
        row, column = divmod(number, across)
        left = _MARGIN + column * (width + _GAP) + (width - wide) / 2.0
        bottom = total_height - top - (row + 1) * (height + above) - row * _GAP
        bottom += (height - high) / 2.0
        box = left / total_width, bottom / total_height
        found.append(figure.add_axes((*box, wide / total_width, high / total_height)))
    return found


def _sides(shape: tuple[int, ...]) -> tuple[float, float]:
    """Return the width and height of a frame in inches; a line has some height."""
    rows, columns = shape[0], shape[1]
    scale = _PANEL / max(rows, columns)
    return max(columns * scale, 0.1), max(rows * scale, 0.1)


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
        spine.set(color="#8c959f", linewidth=0.6)
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


def _draw_scale(figure: Figure, image: Any, unit: str) -> None:
    """Draw the scale of colours at the right, as high as the frames."""
    width, height = figure.get_size_inches()
    left = (width - _MARGIN - sum(_BAR[1:])) / width
    bottom = _MARGIN / height
    boxes = [axes.get_position() for axes in figure.axes]
    top = max(box.y1 for box in boxes)
    high = min(top - bottom, 2.0 * _PANEL / height)
    axes = figure.add_axes((left, top - high, _BAR[1] / width, high))
    bar = figure.colorbar(image, cax=axes)
    bar.set_label(unit, fontsize=SIZE)
    bar.outline.set(color="#8c959f", linewidth=0.6)
    axes.tick_params(labelsize=SIZE - 1, length=2.5, color="#8c959f")
    axes.locator_params(nbins=5)
