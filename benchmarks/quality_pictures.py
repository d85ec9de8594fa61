"""The pictures of the study of quality."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from quality_statistics import BINS, cliques, critical_difference

from fuzzytree.report import (
    Markup,
    Picture,
    mark,
    picture,
    text_width,
    tick_words,
    ticks,
)
from fuzzytree.report.drawing import Scale, path_of
from fuzzytree.report.pictures import class_mark

_STYLE = """
.alike { stroke: var(--quiet); stroke-width: 4; }
svg .name.ours { fill: var(--c1); font-weight: 600; }
.mean { fill: var(--quiet); }
.mean.ours { fill: var(--c1); }
"""
_LINES = (1, 0, 2, 5, 4, 9, 6)  # colours of classes
_WIDE, _ROW = 760.0, 20.0


def ranking(means: Mapping[str, float], tables: int) -> Picture:
    """Draw mean ranks, and lines beside learners that no test tells apart.

    Args:
        means: The mean rank of each learner.
        tables: How many tables were ranked on.
    """
    names = sorted(means, key=means.__getitem__)
    ordered = [means[name] for name in names]
    difference = critical_difference(len(names), tables)
    runs = cliques(ordered, difference)
    base = 60.0
    bottom = base + _ROW * len(names)
    x = Scale(1.0, float(len(names)), 270.0, _WIDE - 30.0 - 9.0 * len(runs))
    marks = []
    for rank in range(1, len(names) + 1):
        marks.append(mark("line", x.at(rank), x.at(rank), base - 8, bottom, "grid"))
        marks.append(mark("words", x.at(rank), base - 14, str(rank), "small", "middle"))
    end = x.at(1.0 + difference)
    said = f"critical difference {difference:.2f} (Nemenyi, p < .05), {tables} tables"
    marks.append(mark("line", x.start, end, 24, 24, "axis"))
    marks += [mark("line", at, at, 20, 28, "axis") for at in (x.start, end)]
    marks.append(mark("words", x.start, 14, said, "small"))
    for row, (name, mean) in enumerate(zip(names, ordered, strict=True)):
        y = base + _ROW * (row + 0.5)
        look = _look(name)
        marks.append(
            mark("words", x.start - 14, y + 4, name, f"name {look}".rstrip(), "end")
        )
        marks.append(mark("line", x.start - 8, x.at(mean), y, y, "lead"))
        marks.append(_disc(x.at(mean), y, look))
        marks.append(mark("words", x.at(mean) + 8, y + 4, f"{mean:.1f}", "small"))
    for column, (first, last) in enumerate(runs):
        at = x.end + 34.0 + 9.0 * column
        top, low = (base + _ROW * (row + 0.5) for row in (first, last))
        marks.append(mark("line", at, at, top - 5, low + 5, "alike"))
    return picture(marks, _WIDE + 10, bottom + 10, "mean ranks of learners", _STYLE)


def accuracy_against_leaves(
    points: Mapping[str, tuple[float, float]], tables: int
) -> Picture:
    """Draw mean accuracy against leaves; those that have none at the right edge.

    Args:
        points: Median leaves, nan where there are none, and mean accuracy.
        tables: Over how many tables, on which all of them finished.
    """
    sized = {name: one for name, (one, _) in points.items() if not math.isnan(one)}
    found = [accuracy for _, accuracy in points.values()]
    y = Scale(min(found) - 0.01, max(found) + 0.01, 430.0, 30.0)
    most = math.log10(max(sized.values()) * 1.15)
    x = Scale(math.log10(min(sized.values()) / 1.15), most, 60.0, 540.0)
    marks = list(_frame(x, y))
    for power in range(4):
        for digit in (1, 2, 5):
            at = math.log10(digit * 10**power)
            if x.low <= at <= x.high:
                marks.append(mark("line", x.at(at), x.at(at), 430, 434, "axis"))
                text = str(digit * 10**power)
                marks.append(mark("words", x.at(at), 446, text, "small", "middle"))
    said = f"median of leaves or rules; accuracy is a mean over {tables} tables"
    marks.append(mark("words", 300, 464, said, "small", "middle"))
    places = {
        name: (x.end if math.isnan(size) else x.at(math.log10(size)), y.at(accuracy))
        for name, (size, accuracy) in points.items()
    }
    taken = [(at - 5, at + 5, high + 4) for at, high in places.values() if at < x.end]
    for name, (at, height) in sorted(places.items(), key=lambda place: place[1][1]):
        left, right = at + 8.0, at + 8.0 + text_width(name, 11.0)
        base = next(
            height + 4.0 + shift
            for shift in sorted(range(-400, 401), key=abs)
            if not any(
                abs(height + 4.0 + shift - other) < 11.0
                and left < end
                and start < right
                for start, end, other in taken
            )
        )
        taken.append((left, right, base))
        marks.append(mark("line", at, left - 1, height, base - 4.0, "lead"))
        marks.append(mark("words", left, base, name, f"name {_look(name)}".rstrip()))
    marks += [_disc(*places[name], _look(name)) for name in sized]
    low = max(470.0, max(base for *_, base in taken) + 10.0)
    return picture(marks, _WIDE + 20, low, "accuracy against leaves", _STYLE)


def reliability_lines(
    bins: Mapping[str, Sequence[Sequence[Sequence[float]]]],
) -> Picture:
    """Draw the share of right answers against confidence, each table weighted alike.

    Args:
        bins: For each learner the bins of each table, as `reliability` returns them.
    """
    x, y = Scale(0.0, 1.0, 60.0, 460.0), Scale(0.0, 1.0, 430.0, 30.0)
    marks = list(_frame(x, y))
    for value in ticks(0.0, 1.0):
        marks.append(mark("words", x.at(value), 446, f"{value:g}", "small", "middle"))
    marks.append(mark("line", x.at(0), x.at(1), y.at(0), y.at(1), "dashed"))
    marks.append(mark("words", 260, 464, "probability given", "small", "middle"))
    for row, (name, of_tables) in enumerate(bins.items()):
        look = f"line {class_mark(_LINES[row % len(_LINES)])}"
        shares = [np.array(one) / np.sum(one, axis=0)[0] for one in of_tables]
        rows, confidence, hits = np.mean(shares, axis=0).T
        seen = rows > 1.0 / (100 * BINS)
        dots = zip(confidence[seen] / rows[seen], hits[seen] / rows[seen], strict=True)
        ways = [(x.at(given), y.at(right)) for given, right in dots]
        marks.append(mark("path", path_of(ways), look))
        high = 44.0 + _ROW * row
        marks.append(mark("line", 490, 520, high - 4, high - 4, look))
        marks.append(mark("words", 528, high, name, "name"))
    return picture(marks, _WIDE, 470, "reliability of probabilities")


def _frame(x: Scale, y: Scale) -> Iterator[Markup]:
    for value, word in zip(
        values := ticks(y.low, y.high, 8), tick_words(values), strict=True
    ):
        yield mark("line", x.start, x.end, y.at(value), y.at(value), "grid")
        yield mark("words", x.start - 6, y.at(value) + 4, word, "small", "end")
    yield mark("rect", x.start, y.end, x.end - x.start, y.start - y.end, "axis")


def _disc(x: float, y: float, look: str) -> Markup:
    way = f"M{x - 4:.1f} {y:.1f}a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z"
    return mark("path", way, f"mean {look}".rstrip())


def _look(name: str) -> str:
    return "ours" if name.startswith("fuzzytree") else ""
