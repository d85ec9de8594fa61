"""What the pictures of a page share: scales, ticks, curves and words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

from fuzzytree.auditing import Domain
from fuzzytree.model import (
    LR,
    Band,
    Document,
    Formula,
    Linear,
    Part,
    Points,
    Shape,
    SystemOutput,
    Term,
    Variable,
    printable,
)
from fuzzytree.model import Curve as SystemCurve
from fuzzytree.numerics import exact_degree
from fuzzytree.report.markup import Markup, mark, trimmed
from fuzzytree.semantics import curve_degree

LETTER = 0.58
"""How wide a letter of a picture is on average, in sizes of its font."""

_STEPS = 72  # at which a curve is evaluated, beside its corners
_CORNERS = 160  # of one curve that are drawn exactly
_KEPT = 1024  # degrees of one curve
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

    @property
    def title(self) -> str:
        """The name with the unit."""
        return f"{self.name} ({self.unit})" if self.unit else self.name


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
    is_undrawn = {
        term.name: isinstance(term.function, (Linear, Formula))
        for term in variable.terms
    }
    curves = tuple(term_curve(t) for t in variable.terms if not is_undrawn[t.name])
    others = tuple(name for name, is_left in is_undrawn.items() if is_left)
    ends = variable.low, variable.high
    if variable.categories:
        ends = 0.0, len(variable.categories) - 1.0
    return Axis(variable.name, variable.unit, curves, others, *ends, variable.parts)


def curve_of(name: str, shape: Shape) -> Curve:
    """Return a shape's curve: its degrees are computed in fractions.

    Example:
        >>> curve_of("low", Band(0.0, 1.0)).corners
        (0.0, 1.0)
    """

    @lru_cache(maxsize=_KEPT)  # pictures of findings use the same values again
    def degree(value: float) -> float:
        return float(exact_degree(shape, Fraction(value)))

    return Curve(name, degree, _corners(shape))


def _corners(curve: SystemCurve) -> tuple[float, ...]:
    """Return where a curve may turn or step, in order."""
    return tuple(sorted({one for one in curve.knots() if math.isfinite(one)}))


def term_curve(label: Term) -> Curve:
    """Return the curve of a term that is neither a sum of inputs nor a formula."""
    curve = label.function
    if isinstance(curve, (Band, LR, Points)) and label.height == 1.0:
        return curve_of(label.name, curve)

    def degree(value: float) -> float:
        return min(max(label.height * curve_degree(curve, value), 0.0), 1.0)

    return Curve(label.name, degree, _corners(curve))


def curve_points(curve: Curve, low: float, high: float) -> list[tuple[float, float]]:
    """Return values and degrees that a curve between two values is drawn through.

    Degrees are exact, and there is a point at each corner and on both sides of each
    step. Points that lie on a line between others, as far as one sees, are left out.

    Example:
        >>> curve_points(curve_of("low", Band(high=1.0, right=3.0)), 0.0, 4.0)
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
    parts = words.split() if isinstance(words, str) else words
    for word in map(printable, parts):
        joined = f"{lines[-1]} {word}".lstrip()
        if text_width(joined, size) <= wide:
            lines[-1] = joined
            continue
        lines += [""] if lines[-1] else []
        for letter in word:
            if lines[-1] and text_width(lines[-1] + letter, size) > wide:
                lines.append("")
            lines[-1] += letter
    return lines if lines != [""] else []


def word_lines(
    x: float, y: float, lines: Sequence[str], look: str, step: float, anchor: str = ""
) -> Iterator[Markup]:
    """Yield lines of words below one another, from the base of the first."""
    for place, line in enumerate(lines):
        yield mark("words", x, y + step * place, line, look, anchor)


def legend(
    entries: Sequence[tuple[Markup, str]], left: float, top: float, wide: float
) -> tuple[list[Markup], float]:
    """Return signs with their names, in rows that fit a width, and how high they are.

    A sign lies right of its origin, and above it: 18 points wide, 9 high.
    """
    marks: list[Markup] = []
    at, base, high = left, top + 11.0, 0.0
    for sign, name in entries:
        lines = lines_within(name, wide - 24.0, 11.0)
        size = 24.0 + max((text_width(line, 11.0) for line in lines), default=0.0)
        if at > left and at + size > left + wide:
            at, base = left, base + high
            high = 0.0
        words = word_lines(24.0, 0.0, lines, "term", 14.0)
        marks.append(
            mark("group", [sign, *words], move=f"translate({at:.1f} {base:.1f})")
        )
        at, high = at + size + 16.0, max(high, 14.0 * len(lines) + 4.0)
    return marks, base + high - top - 11.0


def axis_marks(x: Scale, base: float) -> Iterator[Markup]:
    """Yield the ticks of an axis with their numbers."""
    values = ticks(x.low, x.high, 4)
    previous = -math.inf
    for value, word in zip(values, tick_words(values), strict=True):
        at = x.at(value)
        half = 0.5 * LETTER * 10 * len(word)
        yield mark("line", at, at, base, base + 4, "tick")
        left = min(max(at, x.start - 6 + half), x.end + 6 - half)
        if left - half > previous + 4:
            previous = left + half
            yield mark("words", left, base + 15, word, "small", "middle")


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
