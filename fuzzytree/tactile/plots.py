"""Pictures of frames: their cells and finer points, in one scale of colours."""

from __future__ import annotations

import base64
import math
import struct
import zlib
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.report import Markup, Picture, cut, mark, picture, tick_words, ticks
from fuzzytree.tactile.report.live import PALETTE, shades
from fuzzytree.tactile.runtimes.frames import FramePlan
from fuzzytree.tactile.sensor import Cells, Sensor, pressed

if TYPE_CHECKING:
    import numpy.typing as npt

TIMES = (1, 3, 5, 7)
"""How many points a cell has on each side, in the pictures of a frame."""

_PANEL, _GAP = 150.0, 14.0  # points: the longer side of a frame, and between frames
_HEAD, _BAR = 44.0, 62.0  # above each frame, and the scale of colours with its numbers
_STYLE = """
image { image-rendering: pixelated; }
.frame { fill: none; stroke: #8c959f; stroke-width: .8; }
.axis { fill: none; stroke: #00a3c4; stroke-width: 2; }
.halo { fill: none; stroke: #ffffff; stroke-width: 4.5; }
.centre { fill: #00a3c4; stroke: #ffffff; stroke-width: 1.2; }
"""


def draw_frames(sensor: Sensor, frames: Cells, titles: Sequence[str]) -> Picture:
    """Draw what presses, a frame in a row: its cells, and interpolated.

    The largest number of all has the lightest colour. The centre of pressure and the
    principal axis are marked where something presses.

    Args:
        sensor: Whose frames they are.
        frames: Whole numbers of shape (frames, rows, columns), at least one frame.
        titles: One above each frame.

    Raises:
        TableError: If the frames do not fit the sensor, or have too many points.
    """
    cells = pressed(sensor, frames)
    peak = max(int(cells.max()), 1)
    found = FramePlan(sensor, ["x", "y", "angle"])(frames)
    wide = len(TIMES) * (_PANEL + _GAP) + _BAR
    high = len(cells) * (_HEAD + _PANEL + _GAP)
    names = [f"{sensor.rows} x {sensor.columns} cells"]
    names += [f"{times} times" for times in TIMES[1:]]
    marks: list[Markup] = []
    for row, title in enumerate(titles):
        top = row * (_HEAD + _PANEL + _GAP) + _HEAD
        marks.append(mark("words", 8, top - 26, cut(title, wide / 8.0), "strong"))
        for column, (times, name) in enumerate(zip(TIMES, names, strict=True)):
            parts = [mark("words", _PANEL / 2.0, -6, name, "small", "middle")]
            parts += _image(shades(cells[row], peak, times), *_box(sensor))
            if found.is_pressed[row]:
                parts += _axis(sensor, *found.values[:, row].tolist())
            move = f"translate({8.0 + column * (_PANEL + _GAP):.1f} {top:.1f})"
            marks.append(mark("group", parts, move=move))
    full = peak * sensor.top / sensor.full if sensor.unit else float(peak)
    scale = _scale(full, sensor.unit or "reading", high - _HEAD - _GAP)
    move = f"translate({wide - _BAR + 4:.1f} {_HEAD:.1f})"
    marks.append(mark("group", [*scale], move=move))
    return picture(marks, wide, high, titles[0], _STYLE)


def _box(sensor: Sensor) -> tuple[float, float, float, float]:
    """Return where a frame is drawn, and its size: never thinner than can be seen."""
    size = _PANEL / max(sensor.rows, sensor.columns)
    wide, high = (max(size * n, 8.0) for n in (sensor.columns, sensor.rows))
    return (_PANEL - wide) / 2.0, (_PANEL - high) / 2.0, wide, high


def _image(
    dots: npt.NDArray[np.uint8], x: float, y: float, wide: float, high: float
) -> list[Markup]:
    """Return dots, each the number of a colour, as a PNG in a link, with a border."""
    rows, columns = dots.shape
    lines = np.insert(dots, 0, 0, axis=1)  # no line has a filter
    parts = (
        b"IHDR" + struct.pack(">IIBBBBB", columns, rows, 8, 3, 0, 0, 0),  # a palette
        b"PLTE" + np.array(PALETTE, np.uint8).tobytes(),
        b"IDAT" + zlib.compress(lines.tobytes(), 9),
        b"IEND",
    )
    content = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(part) - 4) + part + struct.pack(">I", zlib.crc32(part))
        for part in parts
    )
    link = Markup(f"data:image/png;base64,{base64.b64encode(content).decode()}")
    box = (x, y, wide, high)
    return [mark("image", *box, link), mark("rect", *box, "frame")]


def _axis(sensor: Sensor, x: float, y: float, angle_deg: float) -> Iterator[Markup]:
    """Yield the centre of pressure and the principal axis of a frame."""
    left, top, wide, high = _box(sensor)
    right, down = wide / sensor.columns, high / sensor.rows  # the size of a cell
    across, over = left + wide / 2.0 + x * right, top + high / 2.0 - y * down
    length, turn = min(sensor.rows, sensor.columns) / 5.0, math.radians(angle_deg)
    along, rise = length * math.cos(turn) * right, length * math.sin(turn) * down
    for look in ("halo", "axis"):
        yield mark(
            "line", across - along, across + along, over + rise, over - rise, look
        )
    yield mark("rect", across - 3.5, over - 3.5, 7, 7, "centre", 3.5)


def _scale(full: float, unit: str, high: float) -> Iterator[Markup]:
    """Yield the scale of colours with its numbers."""
    yield from _image(np.arange(255, -1, -1).astype(np.uint8)[:, None], 0, 0, 10, high)
    values = ticks(0.0, full, 5)
    for value, word in zip(values, tick_words(values), strict=True):
        yield mark("words", 14, high * (1.0 - value / full) + 4, word, "small")
    turned = f"translate(54 {high / 2.0:.1f}) rotate(-90)"
    yield mark("group", [mark("words", 0, 0, unit, "small", "middle")], move=turned)
