"""What is recognised, as lines of a terminal: a picture in colour, bars and counts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple
from typing import TYPE_CHECKING, Literal

import numpy as np
from rich.cells import cell_len, set_cell_size

from fuzzytree.model import printable
from fuzzytree.tactile.interpolation import interpolated
from fuzzytree.tactile.recognition.live import (
    SENTENCES,
    STATES,
    LiveResult,
    LiveView,
    SensorObject,
)

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.tactile.sensor import Cells

Look = Literal["full", "256", "plain"]
"""Colours of 24 bits, the 256 of most terminals, or signs of ASCII without colour."""

SILENT_S = 1.0
"""After how long without a frame a display says so."""

_RAMP = (" .", "::", "--", "==", "++", "**", "##", "%%", "@@")
_EIGHTHS = " ▏▎▍▌▋▊▉"
_BOLD, _DIM, _END = "\x1b[1m", "\x1b[2m", "\x1b[0m"
_NAME = 18  # the widest column of classes
_BAR = 150  # the shade of a bar: it can be seen on white and on black
_LEAST_LEGEND = 4  # signs of colours
_SIDE = 34  # columns beside a picture


def _palette() -> tuple[tuple[int, int, int], ...]:
    """Return 256 colours from dark to light, evenly brighter (Green 2011, cubehelix).

    A turn in colour around the line of greys: the picture reads the same in grey.
    """
    colours: list[tuple[int, int, int]] = []
    for number in range(256):
        light = 0.07 + 0.90 * number / 255
        angle = 2 * math.pi * (0.2 / 3 + 1 - 0.6 * light)
        reach = 1.5 * light * (1 - light) / 2
        cos, sin = reach * math.cos(angle), reach * math.sin(angle)
        red = light - 0.14861 * cos + 1.78277 * sin
        green = light - 0.29227 * cos - 0.90649 * sin
        blue = light + 1.97294 * cos
        r, g, b = (min(max(round(255 * part), 0), 255) for part in (red, green, blue))
        colours.append((r, g, b))
    return tuple(colours)


PALETTE = _palette()
"""The colour of each share of full, from 0 to 255."""


def _near_256(colour: tuple[int, int, int]) -> int:
    """Return the number of the colour of the 6 x 6 x 6 cube that is nearest."""
    steps = (0, 95, 135, 175, 215, 255)
    r, g, b = (
        min(range(6), key=lambda step: abs(steps[step] - part)) for part in colour
    )
    return 16 + 36 * r + 6 * g + b


_CODES: dict[Look, list[str]] = {
    "full": [f"2;{r};{g};{b}" for r, g, b in PALETTE],
    "256": [f"5;{_near_256(colour)}" for colour in PALETTE],
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
        cells = _coarse(cells, max(-(-across // width), -(-rows // height)))
    points = shades(cells, full, max(fits, 1))
    if look == "plain":
        last = len(_RAMP) - 1
        signs = [_RAMP[-(-shade * last // 255)] for shade in range(256)]
        return ["".join(signs[shade] for shade in row) for row in points.tolist()]
    if len(points) % 2:
        points = np.vstack([points, np.zeros_like(points[:1])])
    codes = _CODES[look]
    pairs = zip(points[::2].tolist(), points[1::2].tolist(), strict=True)
    return [_halves(upper, lower, codes) for upper, lower in pairs]


def _coarse(cells: Cells, step: int) -> Cells:
    """Return the largest cell of each square of `step` cells on a side."""
    rows, columns = (-(-side // step) for side in cells.shape)
    wide = np.zeros((rows * step, columns * step), cells.dtype)
    wide[: cells.shape[0], : cells.shape[1]] = cells
    largest: Cells = wide.reshape(rows, step, columns, step).max(axis=(1, 3))
    return largest


def _halves(upper: Sequence[int], lower: Sequence[int], codes: Sequence[str]) -> str:
    """Return two rows of points as one line of half blocks."""
    parts: list[str] = []
    before = ("", "")
    for up, down in zip(upper, lower, strict=True):
        colours = codes[up], codes[down]
        if colours != before:
            parts.append(f"\x1b[38;{colours[0]};48;{colours[1]}m")
            before = colours
        parts.append("▀")
    return "".join([*parts, _END])


def visible(text: str) -> str:
    """Return a text in which no sign controls the terminal.

    Example:
        >>> visible("soft" + chr(27) + "[2J")
        'soft?[2J'
    """
    return "".join(sign if sign.isprintable() else "?" for sign in text)


def headline(view: LiveView) -> str:
    """Return what is recognised in a few words: a class, or why there is none."""
    answer = view.answer
    if answer is None:
        return "waiting for the first frame"
    if answer.state is None:
        return "a frame that does not fit"
    names = [one.label or SENTENCES[one.state] for one in answer.objects]
    return visible(" + ".join(names)) or SENTENCES[answer.state]


def status(view: LiveView) -> str:
    """Return a sentence about what is wrong now; empty if nothing is."""
    if view.is_over:
        return "the source is gone: no more frames"
    parts = [view.trouble] if view.trouble else []
    if view.silent_s >= SILENT_S:
        parts.append(f"no frame for {view.silent_s:.0f} s")
    return visible("; ".join(parts))


def whereabouts(found: SensorObject) -> str:
    """Return where the centre of pressure of an object is, and how many cells press.

    From the middle of the sensor, to the right and upwards.
    """
    unit = found.recogniser.sensor.unit
    force = f"; force {found.force:.3g} {unit}" if unit else ""
    return f"centre {found.x:+.1f}, {found.y:+.1f}; {found.region.area} cells{force}"


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
    view: LiveView,
    columns: int,
    lines: int,
    *,
    look: Look,
    times: int,
    keys: str = "Ctrl-C ends",
) -> str:
    """Return a whole screen: at most `lines` lines of at most `columns` signs."""
    bold, dim = (_BOLD, _DIM) if look != "plain" else ("", "")
    end = _END if bold else ""
    head = f"{visible(view.source)} -> {visible(view.model)}"
    foot = [counts(view), timing(view), status(view) or keys]
    styles = [dim, dim, bold if status(view) else dim]
    room = max(lines - len(foot) - 2, 1)
    is_wide = columns >= 2 * _SIDE
    beside = columns - _SIDE if is_wide else columns
    above = room if is_wide else max(room - min(len(view.classes), 4) - 2, 1)
    drawn: list[str] = []
    cells = view.answer.cells if view.answer else None
    if cells is not None:
        full = view.sensor.full
        drawn = picture(cells, full, beside, above - 1, look=look, times=times)
        drawn.append(_legend(view.sensor.range_text, drawn, look=look))
    facts = _facts(view, room if is_wide else room - len(drawn), look=look)
    body = _side_by_side(drawn, facts) if is_wide else [*drawn, *facts]
    footer = [
        f"{style}{_cut(text, columns)}{end}"
        for style, text in zip(styles, foot, strict=True)
    ]
    title = f"{bold}{_cut(head, columns)}{end}"
    return "\n".join([title, *body[:room], "", *footer][:lines])


def _legend(full: str, drawn: Sequence[str], *, look: Look) -> str:
    """Return the colours of 0 to full in a line as wide as a picture."""
    width = drawn[0].count("▀") or len(drawn[0])
    low, high = "0 ", f" {full}"
    room = width - len(low) - len(high)
    if room < _LEAST_LEGEND:
        return " " * width
    shades_shown = [255 * place // (room - 1) for place in range(room)]
    if look == "plain":
        last = len(_RAMP) - 1
        bar = "".join(_RAMP[-(-one * last // 255)][1] for one in shades_shown)
    else:
        codes = _CODES[look]
        bar = "".join(f"\x1b[38;{codes[one]}m▀" for one in shades_shown) + _END
    return f"{low}{bar}{high}"


def _side_by_side(drawn: Sequence[str], facts: Sequence[str]) -> list[str]:
    """Put facts right of a picture, whose lines are all of one width."""
    if not drawn:
        return [*facts]
    rows = max(len(drawn), len(facts))
    width = drawn[0].count("▀") or len(drawn[0])
    left = [*drawn, *[" " * width] * (rows - len(drawn))]
    right = [*facts, *[""] * (rows - len(facts))]
    return [f"{a}  {b}" for a, b in zip(left, right, strict=True)]


def _facts(view: LiveView, lines: int, *, look: Look) -> list[str]:
    """Return the answer and the strengths of the classes."""
    bold, end = ("", "") if look == "plain" else (_BOLD, _END)
    found = [f"{bold}{_cut(headline(view), _SIDE - 2)}{end}"]
    answer = view.answer
    if answer is None or not answer.objects:
        return [*found, ""]
    for one in answer.objects[:3]:
        name = f"{one.number} " if len(answer.objects) > 1 else ""
        found.append(_cut(name + whereabouts(one), _SIDE - 2))
    found.append("")
    room = max(lines - len(found), 0)
    count = room if room >= len(view.classes) else max(room - 1, 0)
    first = answer.objects[0]
    order = sorted(
        range(len(first.strengths)), key=lambda place: -first.strengths[place]
    )
    places = sorted(order[:count])  # in the order of the classes
    names = [visible(name) for name in view.classes]
    width = min(max(map(cell_len, names)), _NAME)
    for place in places:
        name = set_cell_size(names[place], width)
        own = first.strengths[place]
        bar = _bar(own, _SIDE - 9 - width, look=look)
        style = bold if place == first.code else ""
        found.append(f"{style}{name} {own:4.2f} {bar}{end if style else ''}")
    if len(places) < len(view.classes) and room:
        found.append(f"and {len(view.classes) - len(places)} weaker ones")
    return found


def _bar(share: float, width: int, *, look: Look) -> str:
    """Return a bar of so many signs for a share of 1."""
    if look == "plain":
        return "#" * round(share * width)
    eighths = round(share * width * 8)
    bar = "█" * (eighths // 8) + _EIGHTHS[eighths % 8].strip()
    return f"\x1b[38;{_CODES[look][_BAR]}m{bar}{_END}" if bar else ""


def _cut(text: str, columns: int) -> str:
    return text if cell_len(text) <= columns else set_cell_size(text, columns)


def line_facts(answer: LiveResult) -> list[dict[str, object]]:
    """Return what a frame shows as facts for other programs: a line for each object.

    Without an object there is one line, whose fields of an object are None.
    """
    state = "unknown" if answer.state is None else STATES[answer.state]
    begin: dict[str, object] = {
        "time": round(answer.frame.time, 6),
        "frame": answer.frame.number,
    }
    if not answer.objects:
        begin |= {"state": state, "class": None, "strength": 0.0}
        begin |= {"saturated": answer.saturated, "object": None}
        begin.update(dict.fromkeys(_PLACE))
        return [begin]
    return [
        begin
        | {
            "state": STATES[one.state],
            "class": one.label or None,
            "strength": one.strength,
            "saturated": answer.saturated,
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


_PLACE: tuple[str, ...] = ("x", "y", "angle", "area", "force", "box")


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
        if isinstance(value, str):
            return escaped(value)
        return "" if value is None else str(value)

    return "\n".join(
        "\t".join(map(text, facts.values())) for facts in line_facts(answer)
    )


def escaped(text: str) -> str:
    r"""Return a text that fits between tabs, and commands no terminal.

    Example:
        >>> print(escaped("a\tb" + chr(27)))
        a\tb\x1b
    """
    return printable(text.replace("\\", "\\\\"))
