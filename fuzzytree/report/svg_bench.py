"""Error against run time as a picture: a point for each way of running a model."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Literal, NamedTuple

from fuzzytree.benchmarking import Kind, Point, Question, Study, Timing, error_of
from fuzzytree.report.bench import sizes, timed_of, unbeaten
from fuzzytree.report.drawing import Scale, legend, path_of, text_width
from fuzzytree.report.markup import Markup, mark
from fuzzytree.report.pictures import Picture, class_mark, picture
from fuzzytree.report.text import UNITS, counted

_LOOKS: Mapping[Question, str] = {
    "tree": class_mark(1),
    "relative rules": class_mark(0),
    "raw rules": class_mark(2),
    "rules": class_mark(0),
    "system": class_mark(0),
}  # the colour of forms of a model

Measure = Literal["strength", "output", "class"]

_TITLES: Mapping[Measure, tuple[str, str, str]] = {
    "strength": ("error of a strength", "(its certified bound, if any)", "exact"),
    "output": ("error of an output, as a", "share of its range (or bound)", "exact"),
    "class": ("rows with", "another class", "none"),
}
"""The label of each vertical axis, and the word for an error of 0."""

_KINDS: tuple[Kind, ...] = ("runtime", "variant", "peer")  # a floor is a line
_HIGH: Mapping[Measure, float] = {"strength": 300.0, "output": 300.0, "class": 200.0}
_FLAT = 80.0  # the height of a panel in which all errors are 0
_WIDE, _LEFT, _RIGHT, _TOP = 800.0, 92.0, 788.0, 58.0
_GAP, _BELOW = 14.0, 66.0  # between panels, and for times and the legend
_LOWEST = 1e-18  # observed errors below it are not followed
_FEW = 100  # points, up to which peers are named as well
_MARKER = 5.5  # half the width of a marker of the front
_HOLLOW = 4.0  # and of another
_DISTANCES = (9, 16, 24, 34, 48, 64, 82, 104, 130, 160)  # of a name from its marker
_SIDES = ((1, -1), (-1, -1), (1, 1), (-1, 1), (0, -1), (0, 1), (-1, 0), (1, 0))
_ANCHORS = ("middle", "start", "end")  # of a name to the right (1) or left (-1)
_STYLE = """
.form { fill: none; stroke: var(--k, var(--quiet)); }
.form.full { fill: var(--k, var(--quiet)); }
.form.hollow { fill: var(--card); }
.form.key { stroke-width: 4; }
.form.step { opacity: .5; }
.lead { stroke-width: .6; }
.bold { font-weight: 700; }
"""

Box = tuple[float, float, float, float]  # left, top, right, bottom, in points


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
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of that median."""
        return (
            self.timing.low_ns / self.timing.rows,
            self.timing.high_ns / self.timing.rows,
        )

    @property
    def observed(self) -> float | None:
        """The largest observed error, if a larger bound is drawn."""
        largest = self.point.error.largest if self.point.error else None
        is_drawn = largest is None or largest >= self.error
        return None if self.measure == "class" or is_drawn else largest

    @property
    def look(self) -> str:
        """The class of its colour in the picture's style."""
        return f"form {_LOOKS[self.point.question]}"


class Panel(NamedTuple):
    """The marks of one measure; times and errors are drawn as powers of ten."""

    measure: Measure
    marks: Sequence[Mark]
    low: int
    high: int
    x: Scale
    y: Scale

    @property
    def frame(self) -> Box:
        """Where it is."""
        return self.x.start, self.y.end, self.x.end, self.y.start

    def across(self, nanoseconds: float) -> float:
        """Return where a time is drawn."""
        return self.x.at(math.log10(nanoseconds))

    def height(self, error: float) -> float:
        """Return where an error is drawn; 0 has a line of its own, a decade below."""
        return self.y.at(math.log10(error) if error else self.low - 1)

    def ticks(self) -> Iterator[tuple[float, str]]:
        """Yield where the vertical axis has numbers, and which."""
        if self.high > self.low:
            for k in range(self.low, self.high + 1, 1 + (self.high - self.low) // 8):
                share = f"{100.0 * 10.0**k:.6g} %"
                yield self.y.at(k), share if self.measure == "class" else f"1e{k}"
        if any(one.error == 0.0 for one in self.marks):
            yield self.height(0.0), _TITLES[self.measure][2]


def work_precision(study: Study, *, rows: int, threads: int = 1) -> Picture:
    """Draw the error of every candidate against its time for one row.

    Rules and systems lie at the certified bound of their strengths or outputs, or at
    the largest observed error where nothing is certified; a thin line leads from the
    bound down to what was observed. Trees, and peers without strengths, lie at the
    share of rows whose class is not the exact one. Both axes are logarithmic; an error
    of 0 lies on a grey line of its own. Bars are 95 % intervals of the median.

    Args:
        study: What was measured.
        rows: The number of rows in each call.
        threads: The number of threads of each call.

    Raises:
        ValueError: If nothing was measured with so many rows and threads.
    """
    marks = marks_of(study, rows, threads)
    if not marks:
        known = ", ".join(f"{one} with {k}" for one, k in sizes(study.points))
        raise ValueError(
            f"nothing was measured with {rows} rows and {threads} threads; "
            f"rows and threads in this study: {known or 'none'}"
        )
    floors = [
        (point.name.removeprefix("floor: "), one.median_ns / one.rows)
        for point, one in timed_of(study, rows, threads).values()
        if point.kind == "floor"
    ]
    panels = panels_of(marks, [time for _, time in floors])
    base = panels[-1].y.start
    early = "" if study.is_complete else " (ended early)"
    title = (
        f"{study.model}: error against run time, {rows:,} row"
        f"{'' if rows == 1 else 's'} a call, {counted(threads, 'thread')}{early}"
    )
    machine = study.machine
    place = f"{machine.processor}, {counted(machine.cores, 'core')}, {machine.system}"
    drawn = [
        mark("words", 10, 22, title, "strong"),
        mark("words", 10, 40, f"{place}; {study.data}", "small"),
    ]
    for panel in panels:
        drawn += _panel(panel)
        drawn += _floors(floors, panel, has_names=panel is panels[0])
    drawn += _times(panels[-1])
    drawn += _names(panels, [time for _, time in floors])
    drawn += _legend(marks, base + _BELOW - 14.0, has_floors=bool(floors))
    return picture(drawn, _WIDE, base + _BELOW, title, _STYLE)


def marks_of(study: Study, rows: int, threads: int) -> list[Mark]:
    """Return what is to be drawn, the front first, then by time."""
    marks: list[Mark] = []
    for point, timing in timed_of(study, rows, threads).values():
        if point.error is None or not point.error.rows:
            continue
        error = error_of(point)
        measure: Measure = "output" if point.question == "system" else "strength"
        if point.question == "tree" or error is None:
            measure, error = "class", point.error.flips / point.error.rows
        height = error if error <= 1.0 else 1.0  # NaN and infinity are drawn at 1
        is_front = point.name in unbeaten(study, point.question, rows, threads)
        marks.append(Mark(point, timing, measure, height, is_front))
    return sorted(marks, key=lambda m: (not m.is_front, m.nanoseconds, m.point.name))


def panels_of(marks: Sequence[Mark], floors: Sequence[float]) -> list[Panel]:
    """Return the panels of a picture, from the top: one for each measure."""
    times = [*floors, *(end for one in marks for end in one.interval)]
    left, right = math.log10(min(times) / 1.7), math.log10(max(times) * 1.7)
    wider = max(0.0, 0.65 - (right - left) / 2.0)  # so that a power of ten is inside
    x = Scale(left - wider, right + wider, _LEFT, _RIGHT)
    panels: list[Panel] = []
    top = _TOP
    for measure in _TITLES:
        own = [one for one in marks if one.measure == measure]
        if own:
            low, high = _decades(own)
            base = top + (_HIGH[measure] if any(one.error for one in own) else _FLAT)
            least = low - 1.6 * any(one.error == 0.0 for one in own)
            y = Scale(least, high + 0.3, base, top)
            panels.append(Panel(measure, own, low, high, x, y))
            top = base + _GAP
    return panels


def _decades(marks: Sequence[Mark]) -> tuple[int, int]:
    """Return the exponents of ten around all errors above 0, and the observed ones."""
    errors = [one.error for one in marks if one.error > 0.0]
    errors += [low for one in marks if one.is_front and (low := one.observed)]
    if not errors:
        return 0, 0
    low = math.floor(math.log10(max(min(errors), _LOWEST)))
    return low, max(math.ceil(math.log10(max(errors))), low + 1)


def _panel(panel: Panel) -> Iterator[Markup]:
    """Yield the frame of a panel, its front, its bars and markers."""
    left, top, right, base = panel.frame
    if any(one.error == 0.0 for one in panel.marks):
        line = panel.y.at(panel.low - 0.5)
        yield mark("rect", left, line, right - left, base - line, "track")
    for k in _powers(panel.x):
        yield mark("line", panel.x.at(k), panel.x.at(k), top, base, "grid")
    for at, word in panel.ticks():
        yield mark("line", left, right, at, at, "grid")
        yield mark("words", left - 6, at + 4, word, "small", "end")
    yield mark("rect", left, top, right - left, base - top, "axis")
    said = [
        mark("words", 0, 14 * k, line, "term", "middle")
        for k, line in enumerate(_TITLES[panel.measure][:2])
    ]
    turned = f"translate(14 {(top + base) / 2.0:.1f}) rotate(-90)"
    yield mark("group", said, move=turned)
    for question in _LOOKS:
        front = sorted(
            (panel.across(one.nanoseconds), panel.height(one.error))
            for one in panel.marks
            if one.is_front and one.point.question == question
        )
        steps = [(at, high) for (_, high), (at, _) in itertools.pairwise(front)]
        if front:
            stairs = sorted([*front, *steps, (right, front[-1][1])])
            yield mark("path", path_of(stairs), f"form step {_LOOKS[question]}")
    yield from (_marker(one, panel) for one in reversed(panel.marks))


def _marker(one: Mark, panel: Panel) -> Markup:
    """Return a marker with the interval of its time, and what was observed below it."""
    at, height = panel.across(one.nanoseconds), panel.height(one.error)
    left, right = map(panel.across, one.interval)
    parts = [mark("line", left, right, height, height, one.look)]
    if one.is_front and one.observed is not None:
        low = panel.height(max(one.observed, 10.0**panel.low))
        parts.append(mark("line", at, at, height, low, one.look))
    sign = marker(one.point.kind, at, height, one.look, is_full=one.is_front)
    return mark("group", [*parts, sign], one.point.name)


def marker(kind: Kind, x: float, y: float, look: str, *, is_full: bool) -> Markup:
    """Return the marker of a kind of candidates: a disc, a triangle or a diamond."""
    r = _MARKER if is_full else _HOLLOW
    way = {
        "variant": f"M{x - r:.1f} {y + r:.1f}h{2 * r:.1f}L{x:.1f} {y - r:.1f}z",
        "peer": f"M{x - r:.1f} {y:.1f}l{r} {r}l{r} {-r}l{-r} {-r}z",
    }
    disc = f"M{x - r:.1f} {y:.1f}a{r} {r} 0 1 0 {2 * r} 0a{r} {r} 0 1 0 {-2 * r} 0z"
    return mark(
        "path", way.get(kind, disc), f"{look} {'full' if is_full else 'hollow'}"
    )


def _floors(
    floors: Sequence[tuple[str, float]], panel: Panel, *, has_names: bool
) -> Iterator[Markup]:
    """Yield the line of each floor; of two, the faster has its name on the left."""
    fastest = min((time for _, time in floors), default=0.0)
    for name, time in floors:
        at = panel.across(time)
        yield mark("line", at, at, panel.y.end, panel.y.start, "dashed")
        if has_names:
            is_left = len(floors) > 1 and time == fastest
            move = (
                f"translate({at - 12 if is_left else at + 4:.1f} {_TOP + 5}) rotate(90)"
            )
            yield mark("group", [mark("words", 0, 0, name, "small")], move=move)


def _times(panel: Panel) -> Iterator[Markup]:
    """Yield the numbers of the axis of times, below the last panel."""
    left, _, right, base = panel.frame
    for k in _powers(panel.x):
        word = time_text(10.0**k)
        yield mark("words", panel.x.at(k), base + 16, word, "small", "middle")
    middle = (left + right) / 2.0
    yield mark("words", middle, base + 32, "time for one row", "term", "middle")


def _powers(x: Scale) -> range:
    return range(math.ceil(x.low), math.floor(x.high) + 1)


def _legend(
    marks: Sequence[Mark], base: float, *, has_floors: bool
) -> Iterator[Markup]:
    """Yield what explains colours and markers, in one line."""
    looks = {one.point.question: f"{one.look} key" for one in marks}
    kinds = {one.point.kind for one in marks}
    signs: list[tuple[str, Markup]] = []
    for question in _LOOKS:
        if question in looks:
            signs.append((question, mark("line", 0, 18, -4, -4, looks[question])))
    for kind in _KINDS:
        if kind in kinds:
            signs.append((kind, marker(kind, 9, -4, "form", is_full=False)))
    signs.append(("best trade-off", marker("runtime", 9, -4, "form", is_full=True)))
    if has_floors:
        signs.append(("floor", mark("line", 0, 18, -4, -4, "dashed")))
    parts, _ = legend([(sign, name) for name, sign in signs], _RIGHT - _LEFT)
    yield mark("group", parts, move=f"translate({_LEFT:.1f} {base - 11.0:.1f})")


def _names(panels: Sequence[Panel], floors: Sequence[float]) -> Iterator[Markup]:
    """Yield the names of the front, and of the peers where there are few points.

    Each name takes the nearest side of its marker where it covers nothing else; that
    of a peer is left out if there is none.
    """
    places = [
        (panel.across(one.nanoseconds), panel.height(one.error), one, panel.frame)
        for panel in panels
        for one in panel.marks
    ]
    places.sort(key=lambda place: not place[2].is_front)
    boxes = [(at - 6, down - 6, at + 6, down + 6) for at, down, *_ in places]
    lines = [panels[0].across(time) for time in floors]
    boxes += [(at - 15, 0.0, at + 15, panels[-1].y.start) for at in lines]
    for across, down, one, frame in places:
        is_few = one.point.kind == "peer" and len(places) <= _FEW
        if not (one.is_front or is_few):
            continue
        name = one.point.name.removesuffix(f": {one.point.question}")
        spots = [*_spots(across, down, text_width(name, 11.0))]
        free = (
            spot
            for spot in spots
            if _holds(frame, spot.box)
            and not any(_meet(spot.box, other) for other in boxes)
        )
        spot = next(free, spots[-1] if one.is_front else None)
        if spot is not None:
            boxes.append(spot.box)
            yield mark("line", across, spot.at, down, spot.base - 4.0, "lead")
            own = _LOOKS[one.point.question]
            look = f"name {own}{' bold' if one.is_front else ''}"
            yield mark("words", spot.at, spot.base, name, look, spot.anchor)


class _Spot(NamedTuple):
    """Where a name can stand, and what it covers there."""

    at: float
    base: float
    anchor: str
    box: Box


def _spots(across: float, down: float, wide: float) -> Iterator[_Spot]:
    """Yield the spots around a marker, the nearest first."""
    for distance, (right, up) in itertools.product(_DISTANCES, _SIDES):
        at, base = across + right * distance, down + up * distance + 4.0
        left = at - wide * (0.5, 0.0, 1.0)[right]
        box = left, base - 10.0, left + wide, base + 3.0
        yield _Spot(at, base, _ANCHORS[right], box)


def _holds(frame: Box, box: Box) -> bool:
    across = frame[0] <= box[0] and box[2] <= frame[2]
    return across and frame[1] <= box[1] and box[3] <= frame[3]


def _meet(one: Box, other: Box) -> bool:
    across = one[0] < other[2] and other[0] < one[2]
    return across and one[1] < other[3] and other[1] < one[3]


def time_text(nanoseconds: float) -> str:
    """Return a time as an axis shows it.

    Example:
        >>> time_text(10.0), time_text(2500.0), time_text(1e9)
        ('10 ns', '2.5 µs', '1 s')
    """
    for size, unit in UNITS:
        if nanoseconds >= size:
            return f"{nanoseconds / size:g} {unit}"
    return f"{nanoseconds:g} ns"
