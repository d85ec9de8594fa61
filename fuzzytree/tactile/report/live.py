"""What is recognised, as lines of a terminal: a picture in colour, bars and counts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple
from itertools import zip_longest
from typing import TYPE_CHECKING, Literal

import numpy as np
from rich.cells import cell_len, set_cell_size
from rich.color import Color, ColorSystem

from fuzzytree.model import printable
from fuzzytree.tactile.interpolation import interpolated
from fuzzytree.tactile.recognition.live import (
    SENTENCES,
    STATES,
    LiveResult,
    LiveView,
)

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.tactile.sensor import Cells

Look = Literal["full", "256", "plain"]
"""Colours of 24 bits, the 256 of most terminals, or signs of ASCII without colour."""

SILENT_S = 1.0
"""After how long without a frame a display says so."""

_BOLD, _DIM = "1", "2"
_NAME = 18  # the widest column of classes
_LEAST_LEGEND = 4  # signs of colours
_SIDE = 34  # columns beside a picture


def _palette() -> tuple[tuple[int, int, int], ...]:
    """Return 256 colours from dark to light, evenly brighter (Green 2011, cubehelix).

    A turn in colour around the line of greys: the picture reads the same in grey.
    """
    light = 0.07 + 0.90 * np.arange(256) / 255
    angle = 2 * math.pi * (0.2 / 3 + 1 - 0.6 * light)
    turn = 0.75 * light * (1 - light) * np.array([np.cos(angle), np.sin(angle)])
    mixed = np.array([(-0.14861, 1.78277), (-0.29227, -0.90649), (1.97294, 0.0)]) @ turn
    colours = np.rint(255 * (light + mixed)).clip(0, 255).astype(int)
    return tuple((r, g, b) for r, g, b in colours.T.tolist())


PALETTE = _palette()
"""The colour of each share of full, from 0 to 255."""


_SIGNS = [
    (" .", "::", "--", "==", "++", "**", "##", "%%", "@@")[-(-shade * 8 // 255)]
    for shade in range(256)
]
_CODES: dict[Look, list[str]] = {
    "full": [f"2;{r};{g};{b}" for r, g, b in PALETTE],
    "256": [
        f"5;{Color.from_rgb(*colour).downgrade(ColorSystem.EIGHT_BIT).number}"
        for colour in PALETTE
    ],
}


def shades(cells: Cells, full: int, times: int) -> npt.NDArray[np.uint8]:
    """Return what presses as shares of full, from 0 to 255, interpolated.

    Cells of shape (rows, columns), from 0 to `full`, become points of shape
    (times rows, times columns).

    Example:
        >>> shades(np.array([[0, 1023]]), 1023, 3)[0].tolist()
        [0, 0, 102, 153, 255, 255]
    """
    values = interpolated(cells, times, dtype=np.float32)
    values *= 255.0 / full
    found: npt.NDArray[np.uint8] = np.rint(values).clip(0, 255).astype(np.uint8)
    return found


def picture(
    cells: Cells, full: int, columns: int, lines: int, *, look: Look, times: int
) -> list[str]:
    """Return a frame as lines that fit; the largest number of points that does.

    A line shows two rows of points where there are colours. If not even the cells
    fit, a point shows the largest of several.

    Args:
        cells: What presses, of shape (rows, columns), from 0 to `full`.
        full: What a cell reads that takes no more.
        columns: The most signs in a line.
        lines: The most lines.
        look: With which colours.
        times: The most points for a cell on each side.

    Example:
        >>> picture(np.array([[0, 255]]), 255, 80, 9, look="plain", times=1)
        [' .@@']
    """
    wide, high = (columns // 2, lines) if look == "plain" else (columns, 2 * lines)
    width, height = max(wide, 1), max(high, 1)
    rows, across = cells.shape
    fits = min(width // across, height // rows, times)
    if fits < 1:
        step = max(-(-across // width), -(-rows // height))
        for axis, size in enumerate(cells.shape):
            cells = np.maximum.reduceat(cells, range(0, size, step), axis)
    points = shades(cells, full, max(fits, 1)).tolist()
    if look == "plain":
        return [_line(row, row, look) for row in points]
    pairs = zip_longest(points[::2], points[1::2], fillvalue=[0] * len(points[0]))
    return [_line(upper, lower, look) for upper, lower in pairs]


def _line(upper: Sequence[int], lower: Sequence[int], look: Look) -> str:
    """Return two rows of points as one line of half blocks; without colour, one row."""
    if look == "plain":
        return "".join(_SIGNS[shade] for shade in upper)
    codes, parts, before = _CODES[look], [], (-1, -1)
    for pair in zip(upper, lower, strict=True):
        if pair != before:
            parts.append(f"\x1b[38;{codes[pair[0]]};48;{codes[pair[1]]}m")
            before = pair
        parts.append("▀")
    return "".join([*parts, "\x1b[0m"])


def headline(view: LiveView) -> str:
    """Return what is recognised in a few words: a class, or why there is none."""
    answer = view.answer
    if answer is None:
        return "waiting for the first frame"
    if answer.state is None:
        return "a frame that does not fit"
    names = [one.label or SENTENCES[one.state] for one in answer.objects]
    return printable(" + ".join(names)) or SENTENCES[answer.state]


def status(view: LiveView) -> str:
    """Return a sentence about what is wrong now; empty if nothing is."""
    if view.is_over:
        return "the source is gone: no more frames"
    parts = [view.trouble] if view.trouble else []
    if view.silent_s >= SILENT_S:
        parts.append(f"no frame for {view.silent_s:.0f} s")
    return printable("; ".join(parts))


def places(answer: LiveResult) -> list[str]:
    """Return where the centre of pressure of each object is, and how many cells press.

    From the middle of the sensor, to the right and upwards; of the first three.
    """
    found: list[str] = []
    for one in answer.objects[:3]:
        unit = one.recogniser.sensor.unit
        number = f"{one.number} " if len(answer.objects) > 1 else ""
        force = f"; force {one.force:.3g} {unit}" if unit else ""
        centre = f"centre {one.x:+.1f}, {one.y:+.1f}; {one.region.area} cells"
        found.append(f"{number}{centre}{force}")
    return found


def counts(view: LiveView) -> str:
    """Return the counters that a display shows, those of failures only above 0."""
    known = {**view.counters, "refused": view.refused}
    parts = [f"{known.pop('frames')} frames"]
    parts += [f"{count} {name}" for name, count in known.items() if count]
    return ", ".join(part.replace(" bytes", " B") for part in parts)


def timing(view: LiveView) -> str:
    """Return the rate, and how long answers took from a frame's last byte."""
    found = view.latency
    if found is None:
        return ""
    median, most, largest = (f"{1e3 * part:.2f}" for part in astuple(found))
    spread = f"{median} ms (99 %: {most}, largest: {largest})"
    return f"{view.rate:.1f} frames/s; answer after {spread}"


def screen(
    view: LiveView, columns: int, lines: int, *, look: Look, times: int, keys: str = ""
) -> str:
    """Return a whole screen: at most `lines` lines of at most `columns` signs.

    Its last line says what is wrong, or what `keys` do.
    """
    room = max(lines - 5, 1)  # beside the title and the last lines
    is_wide = columns >= 2 * _SIDE
    beside = _SIDE if is_wide else 0
    below = 0 if is_wide else min(len(view.classes), 4) + 2
    body: list[str] = []
    width = 0
    if view.answer is not None and view.answer.cells is not None:
        size = columns - beside, max(room - below, 1) - 1
        cells, sensor = view.answer.cells, view.sensor
        body = picture(cells, sensor.full, *size, look=look, times=times)
        width = body[0].count("▀") or len(body[0])
        body.append(_legend(sensor.range_text, width, look))
    facts = _facts(view, room if is_wide else room - len(body), look)
    if is_wide and body:
        pairs = zip_longest(body, facts, fillvalue="")
        body = [f"{left or ' ' * width}  {right}" for left, right in pairs]
    else:
        body += facts
    wrong = status(view)
    title = f"{printable(view.source)} -> {printable(view.model)}"

    def line(text: str, code: str) -> str:
        return _styled(_cut(text, columns), code, look)

    foot = [line(counts(view), _DIM), line(timing(view), _DIM)]
    foot.append(line(wrong or f"{keys}Ctrl-C ends", _BOLD if wrong else _DIM))
    return "\n".join([line(title, _BOLD), *body[:room], "", *foot][:lines])


def _legend(full: str, width: int, look: Look) -> str:
    """Return the colours of 0 to full in a line as wide as a picture."""
    signs = 2 if look == "plain" else 1
    count, rest = divmod(width - len(f"0  {full}"), signs)
    if count < _LEAST_LEGEND:
        return " " * width
    row = [255 * place // (count - 1) for place in range(count)]
    return f"0 {_line(row, row, look)} {' ' * rest}{full}"


def _facts(view: LiveView, lines: int, look: Look) -> list[str]:
    """Return the answer and the strengths of the classes, the largest if few fit."""
    found = [_styled(_cut(headline(view), _SIDE - 2), _BOLD, look)]
    answer = view.answer
    if answer is None or not answer.objects:
        return [*found, ""]
    found += [*(_cut(text, _SIDE - 2) for text in places(answer)), ""]
    first = answer.objects[0]
    strengths, count = first.strengths, len(view.classes)
    room = max(lines - len(found), 0)
    most = room if room >= count else max(room - 1, 0)
    largest = sorted(range(count), key=lambda place: -strengths[place])[:most]
    names = [printable(name) for name in view.classes]
    width = min(max(map(cell_len, names)), _NAME)
    # A shade that can be seen on white and on black.
    colour = "" if look == "plain" else f"38;{_CODES[look][150]}"
    for place in sorted(largest):  # in the order of the classes
        name, own = set_cell_size(names[place], width), strengths[place]
        text = f"{name} {own:4.2f} "
        if place == first.code:
            text = _styled(text, _BOLD, look)
        bar = ("#" if look == "plain" else "█") * round(own * (_SIDE - 9 - width))
        found.append(text + _styled(bar, colour, look))
    if most < count and room:
        found.append(f"and {count - most} weaker ones")
    return found


def _styled(text: str, code: str, look: Look) -> str:
    return text if look == "plain" else f"\x1b[{code}m{text}\x1b[0m"


def _cut(text: str, columns: int) -> str:
    return set_cell_size(text, columns).rstrip()


def line_facts(answer: LiveResult) -> list[dict[str, object]]:
    """Return what a frame shows as facts for other programs: a line for each object.

    Without an object there is one line, whose fields of an object are None.
    """
    state = "unknown" if answer.state is None else STATES[answer.state]
    facts: dict[str, object] = {
        "time": round(answer.frame.time, 6),
        "frame": answer.frame.number,
        "state": state,
        "class": None,
        "strength": 0.0,
        "saturated": answer.saturated,
        **dict.fromkeys(("object", "x", "y", "angle", "area", "force", "box")),
    }
    found = [
        facts
        | {
            "state": STATES[one.state],
            "class": one.label or None,
            "strength": one.strength,
            "object": one.number,
            "x": round(one.x, 3),
            "y": round(one.y, 3),
            "angle": round(one.angle, 3),
            "area": one.region.area,
            "force": round(one.force, 4),
            "box": one.box,
        }
        for one in answer.objects
    ]
    return found or [facts]


def lines(answer: LiveResult) -> str:
    r"""Return what a frame shows as lines of fields with tabs between them.

    A backslash, tab or end of line within a class's name is written as `\\`, `\t`,
    `\n` or `\r`, as in the text format of PostgreSQL; what else cannot be printed,
    such as commands for a terminal, as `\x1b` or `\u202e`. A box is four numbers
    with commas between them.
    """

    def text(value: object) -> str:
        if isinstance(value, tuple):
            return ",".join(map(str, value))
        return "" if value is None else printable(str(value).replace("\\", "\\\\"))

    return "\n".join(
        "\t".join(map(text, facts.values())) for facts in line_facts(answer)
    )
