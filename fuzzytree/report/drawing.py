"""What the pictures of a page share: scales, ticks, curves and words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import date
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

from fuzzytree.auditing import Domain
from fuzzytree.model import (
    DATE_UNIT,
    Document,
    Formula,
    Linear,
    Part,
    SystemOutput,
    Term,
    Variable,
    printable,
)
from fuzzytree.report.markup import Markup, mark, trimmed
from fuzzytree.report.pictures import Picture, picture
from fuzzytree.semantics import curve_degree

EDGE = 12.0
"""Points around what a sheet holds."""

LOOKS = {
    **{"strong": (14.0, 17.0), "words": (12.0, 15.0)},
    **{"term": (11.0, 14.0), "small": (10.5, 13.0)},
}
"""How large letters of a look are at most, and how far lines are apart, in points."""

Block = tuple[list[Markup], float]
"""Marks from (0, 0) on, and how high they are."""

_MOST_WIDE = 900.0  # lines of words
_STEPS = 72  # at which a curve is evaluated, beside its corners
_CORNERS = 160  # of one curve that are drawn exactly
_KEPT = 1024  # letters
_FIRST_DAY = date(1970, 1, 1).toordinal()
_NARROW = "fijlrtI.,:;'|!()[] -"
_FLAT = 0.04  # points of a picture below what is visible
_SQUARE = 256.0  # points of a side, in which a curve is thinned; a power of two


class Scale(NamedTuple):
    """A map from values to points of a picture."""

    low: float
    high: float
    start: float
    end: float

    def at(self, value: float) -> float:
        """Return the point of a value, clamped to the ends.

        Example:
            >>> Scale(0.0, 4.0, 100.0, 200.0).at(1.0)
            125.0
        """
        width = self.high / 2 - self.low / 2  # halves: no range overflows
        part = (value / 2 - self.low / 2) / width if width > 0.0 else 0.5
        return self.start + min(max(part, 0.0), 1.0) * (self.end - self.start)


class Curve(NamedTuple):
    """A term's curve as it is drawn; at its corners it may turn or step."""

    name: str
    degree: Callable[[float], float]
    corners: tuple[float, ...]

    def corners_between(self, low: float, high: float) -> list[float]:
        """Return the corners between two values; some of them if they are many."""
        inside = [one for one in self.corners if low <= one <= high]
        return inside[:: 1 + len(inside) // _CORNERS]


class Axis(NamedTuple):
    """A variable as it is drawn: its terms, and the ends of its domain, if any."""

    name: str
    unit: str
    curves: tuple[Curve, ...]
    undrawn: tuple[str, ...]
    low: float | None
    high: float | None
    parts: tuple[Part, ...] = ()
    categories: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """The name with the unit, which of dates the ticks show."""
        has_unit = self.unit and self.unit != DATE_UNIT
        return f"{self.name} ({self.unit})" if has_unit else self.name

    def ticks(self, x: Scale, most: int = 4) -> list[tuple[float, str]]:
        """Return round values with their words: dates, categories if they fit."""
        places = [(float(k), name) for k, name in enumerate(self.categories)]
        wide = sum(text_width(name, LOOKS["small"][0]) + 12.0 for _, name in places)
        if places and wide < abs(x.end - x.start):
            return places
        if self.unit == DATE_UNIT and (days := _round_days(x.low, x.high, most)):
            dates = [str(date.fromordinal(_FIRST_DAY + int(day))) for day in days]
            has_months = all(one.endswith("-01") for one in dates)
            return [
                *zip(days, [d[:-3] if has_months else d for d in dates], strict=True)
            ]
        values = ticks(x.low, x.high, most)
        return [*zip(values, tick_words(values), strict=True)]


NUMBERS = Axis("", "", (), (), None, None)
"""What is no variable: an axis with numbers."""


def axes_of(model: Document, domain: Domain) -> dict[str, Axis]:
    """Return every input and combination of a model as it is drawn, by name."""
    variables = model.variables
    axes: dict[str, Axis] = {}
    for axis in map(axis_of, variables):
        side = domain.side(axis.name)
        if side is not None:
            axes[axis.name] = axis._replace(low=side.low, high=side.high)
        else:
            low, high = _reached(axis.parts, axes)
            axes[axis.name] = axis._replace(low=low, high=high)
    return axes


def _reached(
    parts: Sequence[Part], axes: dict[str, Axis]
) -> tuple[float | None, float | None]:
    """Return the ends that a combination has on the domain of its inputs."""
    low = high = 0.0
    for part in parts:
        axis = axes[part.input]
        if axis.low is None or axis.high is None:
            return None, None
        ends = [part.weight * (end - part.centre) for end in (axis.low, axis.high)]
        low, high = low + min(ends), high + max(ends)
    is_known = bool(parts) and math.isfinite(low) and math.isfinite(high)
    return (low, high) if is_known else (None, None)


def axis_of(variable: Variable | SystemOutput) -> Axis:
    """Return a variable or an output as it is drawn, on its own range."""
    others = tuple(
        t.name for t in variable.terms if isinstance(t.function, (Linear, Formula))
    )
    curves = tuple(term_curve(t) for t in variable.terms if t.name not in others)
    ends = variable.low, variable.high
    if variable.categories:
        ends = 0.0, len(variable.categories) - 1.0
    return Axis(
        variable.name,
        variable.unit,
        curves,
        others,
        *ends,
        variable.parts,
        variable.categories,
    )


def term_curve(term: Term, values: Mapping[str, float] = MappingProxyType({})) -> Curve:
    """Return the curve of a term that is no sum of inputs, a formula's at some values.

    Example:
        >>> from fuzzytree.model import Band
        >>> term_curve(Term("low", Band(high=1.0, right=3.0))).degree(2.5)
        0.25
    """

    def degree(value: float) -> float:
        return term.height * curve_degree(term.function, value, values)

    knots = {knot for knot in term.function.knots() if math.isfinite(knot)}
    return Curve(term.name, degree, tuple(sorted(knots)))


def curve_points(curve: Curve, low: float, high: float) -> list[tuple[float, float]]:
    """Return values and degrees that a curve between two values is drawn through.

    There is a point at each corner and on both sides of each step. Points that lie on a
    line between others, as far as one sees, are left out.

    Example:
        >>> from fuzzytree.model import Band
        >>> low = term_curve(Term("low", Band(high=1.0, right=3.0)))
        >>> curve_points(low, 0.0, 4.0)
        [(0.0, 1.0), (1.0, 1.0), (3.0, 0.0), (4.0, 0.0)]
    """
    values = {between(low, high, k / _STEPS) for k in range(_STEPS + 1)}
    for corner in curve.corners_between(low, high):
        values.add(corner)
        for way in (-math.inf, math.inf):
            near = min(max(math.nextafter(corner, way), low), high)
            if abs(curve.degree(near) - curve.degree(corner)) * _SQUARE > _FLAT:
                values.add(near)  # a step
    x, dots = Scale(low, high, 0.0, _SQUARE), dict[tuple[float, float], float]()
    for value in sorted(values):
        dots.setdefault((x.at(value), _SQUARE * curve.degree(value)), value)
    return [(dots[dot], dot[1] / _SQUARE) for dot in thinned([*dots])]


def polyline(curve: Curve, x: Scale, y: Scale) -> Markup:
    """Return a curve as the path of a picture, with its corners and steps."""
    points = curve_points(curve, x.low, x.high)
    return path_of([(x.at(value), y.at(degree)) for value, degree in points])


def between(low: float, high: float, part: float) -> float:
    """Return a value a part of the way from one to another; no range overflows.

    Example:
        >>> between(2.0, 4.0, 0.25), between(-1.5e308, 1.5e308, 0.5)
        (2.5, 0.0)
    """
    return min(max(low * (1.0 - part) + high * part, low), high)


def thinned(dots: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the dots of a line without those that lie on a straight part of it.

    Example:
        >>> thinned([(0.0, 0.0), (1.0, 1.0), (2.0, 2.0), (3.0, 0.0)])
        [(0.0, 0.0), (2.0, 2.0), (3.0, 0.0)]
    """
    kept: list[tuple[float, float]] = []
    for dot in dots:
        while len(kept) >= 2 and _is_between(kept[-2], kept[-1], dot):
            kept.pop()
        kept.append(dot)
    return kept


def _is_between(
    a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]
) -> bool:
    across = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    least = max(math.dist(a, c), _FLAT)
    return abs(across) <= _FLAT * least and math.dist(a, b) <= least


def path_of(dots: Sequence[tuple[float, float]]) -> Markup:
    """Return dots joined by lines, as the path of a picture.

    Example:
        >>> print(path_of([(0.0, 1.5), (2.0, 3.0)]))
        M0 1.5L2 3
    """
    return Markup("M" + "L".join(f"{trimmed(a)} {trimmed(b)}" for a, b in dots))


def ticks(low: float, high: float, most: int = 4) -> list[float]:
    """Return round values between two, so that few digits name them.

    Example:
        >>> ticks(0.3, 9.2)
        [2.0, 4.0, 6.0, 8.0]
    """
    width = high - low
    if not 0.0 < width < math.inf:
        return [low]
    power = 10.0 ** math.floor(math.log10(width / most))
    for size in (1.0, 2.0, 5.0, 10.0, 20.0):
        step = size * power
        first, last = math.ceil(low / step), math.floor(high / step)
        if last - first < most:
            return [k * step for k in range(first, last + 1)] or [low]
    return [low]


def _round_days(low: float, high: float, most: int) -> list[float]:
    """Return firsts of months between two dates, in days, or else whole days."""
    try:
        first, last = (date.fromordinal(_FIRST_DAY + int(end)) for end in (low, high))
    except (OverflowError, ValueError):
        return []
    begin, end = (12 * one.year + one.month - 1 for one in (first, last))
    days: list[float] = []
    for step in (1, 3, 6, *(12 * years for years in (1, 2, 5, 10, 20, 50, 100, 1000))):
        months = (divmod(m, 12) for m in range(begin, end + 1) if m % step == 0)
        firsts = (
            date(year, month + 1, 1).toordinal() for year, month in months if year
        )
        days = [float(day - _FIRST_DAY) for day in firsts]
        days = [day for day in days if low <= day <= high]
        if len(days) <= most:
            break
    return days if len(days) > 1 else [t for t in ticks(low, high, most) if t % 1 == 0]


def tick_words(values: Sequence[float]) -> list[str]:
    """Return values with as few digits, three at least, as distinguish them.

    Example:
        >>> tick_words([1000.25, 1000.5])
        ['1000.2', '1000.5']
    """
    words: list[str] = []
    for digits in range(3, 18):
        words = [f"{value:.{digits}g}" for value in values]
        shown = len(set(words)) == len(set(values))
        if shown and all("e" not in word for word in words):
            break
        if shown and digits >= 6:
            break
    return words


def cut(words: str, letters: float) -> str:
    """Return words that fit; what is longer ends in dots.

    Example:
        >>> cut("above 1.75", 6)
        'above…'
    """
    words, most = printable(words), max(int(letters), 2)
    return words if len(words) <= most else f"{words[: most - 1].rstrip()}…"


def text_width(words: str, size: float) -> float:
    """Return how wide words are at most in usual fonts, in points.

    Example:
        >>> text_width("il", 10.0), text_width("WW", 10.0)
        (8.0, 20.0)
    """
    return size * sum(map(_letter_width, words))


@lru_cache(maxsize=_KEPT)
def _letter_width(letter: str) -> float:
    if letter in _NARROW:
        return 0.4
    is_broad = letter in "mwMW%@" or not letter.isascii()
    return 1.0 if is_broad else 0.64 if letter.islower() or letter.isdigit() else 0.76


def lines_within(words: str | Sequence[str], wide: float, size: float) -> list[str]:
    """Return words in lines that fit a width; a word that is too long is broken.

    Words in a sequence are kept together with the blanks in them.

    Example:
        >>> lines_within("area of the worst nucleus", 90.0, 12.0)
        ['area of the', 'worst', 'nucleus']
    """
    lines = [""]
    for word in map(printable, words.split() if isinstance(words, str) else words):
        line = f"{lines[-1]} {word}".lstrip()
        if text_width(line, size) <= wide:
            lines[-1] = line
            continue
        lines += [""] if lines[-1] else []
        for letter in word:
            if lines[-1] and text_width(lines[-1] + letter, size) > wide:
                lines.append("")
            lines[-1] += letter
    return [line for line in lines if line]


def listing(words: Sequence[str], sign: str = ";") -> list[str]:
    """Return words with a sign behind each but the last.

    Example:
        >>> listing(["a = 1", "b = 2"])
        ['a = 1;', 'b = 2']
    """
    return [*(f"{word}{sign}" for word in words[:-1]), *words[-1:]]


def text_block(
    x: float,
    top: float,
    words: str | Sequence[str],
    wide: float,
    look: str = "small",
    anchor: str = "",
) -> Block:
    """Return words in lines that fit a width, and how high they are."""
    size, step = LOOKS[look.partition(" ")[0]]
    lines = lines_within(words, wide, size)
    marks = [
        mark("words", x, top + step * place - 3.0, line, look, anchor)
        for place, line in enumerate(lines, 1)
    ]
    return marks, step * len(lines)


def legend(entries: Sequence[tuple[Markup, str]], wide: float) -> Block:
    """Return signs with their names, in rows that fit a width.

    A sign lies right of its origin, and above it: 18 points wide, 9 high.
    """
    marks: list[Markup] = []
    left = top = high = 0.0
    for sign, name in entries:
        words, size = text_block(24.0, -11.0, name, wide - 24.0, "term")
        lines = lines_within(name, wide - 24.0, LOOKS["term"][0])
        room = 24.0 + max(text_width(line, LOOKS["term"][0]) for line in lines or [""])
        if left and left + room > wide:
            left, top, high = 0.0, top + high, 0.0
        move = f"translate({left:.1f} {top + 11.0:.1f})"
        marks.append(mark("group", [sign, *words], move=move))
        left, high = left + room + 16.0, max(high, size + 4.0)
    return marks, top + high


class Sheet:
    """A picture that grows downwards, from its heading on."""

    def __init__(self, wide: float, heading: str) -> None:
        self.inside, self.heading = wide, heading
        self.top = 4.0
        self.marks: list[Markup] = []
        self.words(heading, "strong")

    def words(self, words: str | Sequence[str], look: str = "small") -> None:
        """Add words in lines, which are not too long to be read."""
        wide = min(self.inside, _MOST_WIDE)
        self.row([text_block(0.0, 0.0, words, wide, look)])

    def row(
        self, blocks: Sequence[Block], step: float = 0.0, about: str | None = None
    ) -> None:
        """Add blocks beside each other, each a step further to the right."""
        parts = [
            mark("group", marks, move=f"translate({step * place:.1f} 0)")
            for place, (marks, _) in enumerate(blocks)
            if marks
        ]
        move = f"translate({EDGE:.1f} {self.top:.1f})"
        self.marks.append(mark("group", parts, about, move))
        self.top += max((high for _, high in blocks), default=0.0)

    def picture(self, about: str, rules: str = "") -> Picture:
        """Return what was added; readers of a screen say the heading and more."""
        wide, high = self.inside + 2 * EDGE, self.top + EDGE
        return picture(self.marks, wide, high, self.heading, rules, about)


def axis_marks(x: Scale, base: float, axis: Axis = NUMBERS) -> Iterator[Markup]:
    """Yield the ticks of an axis with their numbers, dates or categories."""
    previous = -math.inf
    for value, word in axis.ticks(x):
        at = x.at(value)
        half = text_width(word, LOOKS["small"][0]) / 2.0
        yield mark("line", at, at, base, base + 4, "tick")
        left = min(max(at, x.start - 6 + half), x.end + 6 - half)
        if left - half > previous + 4:
            previous = left + half
            yield mark("words", left, base + 15, word, "small", "middle")


def frame_marks(
    x: Scale, y: Scale, across: str | Axis, up: str | Axis
) -> Iterator[Markup]:
    """Yield a frame with the ticks and the names of both axes."""
    names = [one if isinstance(one, str) else one.title for one in (across, up)]
    lower, left = (NUMBERS if isinstance(one, str) else one for one in (across, up))
    wide, high = x.end - x.start, y.start - y.end
    yield mark("rect", x.start, y.end, wide, high, "axis")
    yield from axis_marks(x, y.start, lower)
    for value, word in left.ticks(y, 5):
        yield mark("line", x.start - 4.0, x.start, y.at(value), y.at(value), "tick")
        yield mark("words", x.start - 8.0, y.at(value) + 4.0, word, "small", "end")
    middle = (x.start + x.end) / 2.0
    yield from text_block(middle, y.start + 21.0, names[0], wide, "term", "middle")[0]
    words, size = text_block(0.0, 0.0, names[1], high, "term", "middle")
    turn = f"translate({x.start - 52.0 - size:.1f} {(y.start + y.end) / 2.0:.1f})"
    yield mark("group", words, move=f"{turn} rotate(-90)")


def spread(values: Sequence[float], share: float = 0.03) -> tuple[float, float]:
    """Return ends around values with some room; never an empty range.

    Example:
        >>> spread([0.0, 10.0], 0.1)
        (-1.0, 11.0)
    """
    low, high = min(values), max(values)
    room = share * (high - low)
    if not room > 0.0:
        room = max(abs(low), 1.0) * share
    ends = low - room, high + room
    return ends if all(map(math.isfinite, ends)) else (low, high)
