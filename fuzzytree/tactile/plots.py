"""Frames as pictures: one scale of colours for all, white where nothing presses."""

from __future__ import annotations

import base64
import math
import struct
import zlib
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.report import (
    LETTER,
    Markup,
    Picture,
    cut,
    mark,
    picture,
    tick_words,
    ticks,
)
from fuzzytree.tactile.report.live import PALETTE

if TYPE_CHECKING:
    import numpy.typing as npt

    Cells = npt.NDArray[np.integer | np.floating]

MOST_FRAMES = 100
"""The most frames in one picture."""

COLOURS = ((255, 255, 255), *PALETTE[235:8:-1])
"""White for nothing, then from pale to dark: the palette without its ends."""

_PANEL, _GAP = 150.0, 14.0  # points: the longer side of a frame, and between frames
_TITLE, _WORDS = 26.0, 18.0  # the heights of words above all, and above each frame
_BAR = 62.0  # wide, the scale of colours with its numbers
_DOTS = 420  # a frame of fewer dots than this is enlarged, each cell to a square
_STYLE = """
.frame { fill: none; stroke: #8c959f; stroke-width: .8; }
.axis { fill: none; stroke: #00a3c4; stroke-width: 2; }
.halo { fill: none; stroke: #ffffff; stroke-width: 4.5; }
.centre { fill: #00a3c4; stroke: #ffffff; stroke-width: 1.2; }
"""


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


def draw_frames(
    frames: Sequence[Cells],
    *,
    titles: Sequence[str] = (),
    title: str = "",
    axes: Sequence[FrameAxis | None] = (),
    cells: Sequence[tuple[int, int]] = (),
    columns: int | None = None,
    unit: str = "pressure",
) -> Picture:
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

    Raises:
        ValueError: If there is no frame, too many, or one that is none; if titles,
            axes or cells are not as many.
    """
    drawn = [np.asarray(frame, np.float64) for frame in frames]
    _check(drawn, titles=titles, axes=axes, cells=cells)
    full = max(float(frame.max()) for frame in drawn)
    full = full if full > 0.0 else 1.0
    across = min(columns or len(drawn), len(drawn))
    if not columns and across > 4:
        across = math.ceil(math.sqrt(across))  # about a square
    head = _TITLE if title else 6.0
    above = _WORDS if titles else 0.0
    wide = across * (_PANEL + _GAP) + _BAR
    high = head + math.ceil(len(drawn) / across) * (_PANEL + above + _GAP)
    marks = [mark("words", 8, 18, cut(title, wide / 8.0), "strong")] if title else []
    for number, frame in enumerate(drawn):
        down, right = divmod(number, across)
        parts = [*_frame(frame, full)]
        if titles:
            words = cut(titles[number], _PANEL / (LETTER * 10.5))
            parts.append(mark("words", _PANEL / 2.0, -6, words, "small", "middle"))
        if axes and (axis := axes[number]) is not None:
            shape = cells[number] if cells else frame.shape
            parts += _axis(axis, shape, *_size(frame.shape))
        left = 8.0 + right * (_PANEL + _GAP)
        top = head + above + down * (_PANEL + above + _GAP)
        marks.append(mark("group", parts, move=f"translate({left:.1f} {top:.1f})"))
    scale = [*_scale(full, unit, high - head - above - _GAP)]
    move = f"translate({wide - _BAR + 4:.1f} {head + above:.1f})"
    marks.append(mark("group", scale, move=move))
    return picture(marks, wide, high, title or unit, _STYLE)


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


def _size(shape: tuple[int, ...]) -> tuple[float, float]:
    """Return how wide and high a frame is drawn: never thinner than can be seen."""
    rows, columns = shape
    longer, least = max(rows, columns), _PANEL / 19.0
    wide, high = (max(_PANEL * side / longer, least) for side in (columns, rows))
    return wide, high


def _frame(frame: npt.NDArray[np.float64], full: float) -> Iterator[Markup]:
    wide, high = _size(frame.shape)
    yield mark("image", *_corner(wide, high), wide, high, image(frame, full))
    yield mark("rect", *_corner(wide, high), wide, high, "frame")


def _corner(wide: float, high: float) -> tuple[float, float]:
    return (_PANEL - wide) / 2.0, (_PANEL - high) / 2.0


def shades(frame: npt.NDArray[np.float64], full: float) -> npt.NDArray[np.uint8]:
    """Return the number of each cell's colour in `COLOURS`; only nothing has 0.

    Example:
        >>> shades(np.array([[-1.0, 0.0, 1e-9, 4.0]]), 4.0).tolist()
        [[0, 0, 1, 227]]
    """
    last = len(COLOURS) - 1
    shares = np.ceil(np.clip(frame / full, 0.0, 1.0) * last)
    return shares.astype(np.uint8)


def image(frame: npt.NDArray[np.float64], full: float) -> Markup:
    """Return a frame as a PNG in a link; each cell is a square of the same dots."""
    times = max(1, -(-_DOTS // max(frame.shape)))
    dots = np.repeat(np.repeat(shades(frame, full), times, axis=0), times, axis=1)
    rows, columns = dots.shape
    lines = np.hstack([np.zeros((rows, 1), np.uint8), dots])  # no line has a filter
    head = struct.pack(">IIBBBBB", columns, rows, 8, 3, 0, 0, 0)  # 8 bits, a palette
    chunks = (
        (b"IHDR", head),
        (b"PLTE", bytes(part for colour in COLOURS for part in colour)),
        (b"IDAT", zlib.compress(lines.tobytes(), 9)),
        (b"IEND", b""),
    )
    content = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data
        + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )  # fmt: skip
    return Markup(f"data:image/png;base64,{base64.b64encode(content).decode()}")


def _axis(
    axis: FrameAxis, cells: tuple[int, ...], wide: float, high: float
) -> Iterator[Markup]:
    """Yield the centre of pressure and the principal axis of a frame."""
    left, top = _corner(wide, high)
    right, down = wide / cells[1], high / cells[0]  # the size of a cell
    x, y = left + wide / 2.0 + axis.x * right, top + high / 2.0 - axis.y * down
    if axis.angle_deg is not None:
        turn = math.radians(axis.angle_deg)
        along = axis.length * math.cos(turn) * right
        rise = axis.length * math.sin(turn) * down
        for look in ("halo", "axis"):
            yield mark("line", x - along, x + along, y + rise, y - rise, look)
    yield mark("rect", x - 3.5, y - 3.5, 7, 7, "centre", 3.5)


def _scale(full: float, unit: str, high: float) -> Iterator[Markup]:
    """Yield the scale of colours with its numbers."""
    colours = np.linspace(full, 0.0, 200).reshape(-1, 1)
    yield mark("image", 0, 0, 10, high, image(colours, full))
    yield mark("rect", 0, 0, 10, high, "frame")
    values = ticks(0.0, full, 5)
    for value, word in zip(values, tick_words(values), strict=True):
        yield mark("words", 14, high * (1.0 - value / full) + 4, word, "small")
    turned = f"translate(54 {high / 2.0:.1f}) rotate(-90)"
    yield mark("group", [mark("words", 0, 0, unit, "small", "middle")], move=turned)
