"""What a picture of a study shows: a mark for each candidate, and the floors."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

from fuzzytree.benchmarking.front import error_of
from fuzzytree.benchmarking.records import Kind, Point, Question, Study, Timing

COLOURS: dict[Question, str] = {
    "tree": "#c04d00",
    "relative rules": "#0072b2",
    "raw rules": "#00795a",
    "rules": "#0072b2",
}
"""Of questions: told apart by the colour-blind, and dark enough for letters."""

MARKERS: dict[Kind, str] = {"runtime": "o", "variant": "^", "peer": "D"}
"""Of kinds; a floor is a line."""

Measure = Literal["strength", "class"]
"""What is drawn upwards."""


class Mark(NamedTuple):
    """A point of the picture.

    Attributes:
        point: Of the study.
        timing: Its time that is drawn.
        measure: Which panel it is in.
        error: The number drawn there.
        is_front: Whether nobody beats it in both.
    """

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
        """The ends of its confidence interval, for one row as well."""
        timing = self.timing
        return timing.low_ns / timing.rows, timing.high_ns / timing.rows

    @property
    def observed(self) -> float | None:
        """The largest error that was seen, where a larger one is drawn."""
        seen = self.point.error.largest if self.point.error else None
        if self.measure == "class" or seen is None or seen >= self.error:
            return None
        return seen

    @property
    def name(self) -> str:
        """The candidate's name without its question, which the colour tells."""
        return self.point.name.removesuffix(f": {self.point.question}")


def marks_of(study: Study, rows: int, threads: int) -> Iterator[Mark]:
    """Yield what is to be drawn, the front first, then by time."""
    fronts = {
        name
        for front in study.fronts
        if (front.rows, front.threads) == (rows, threads)
        for name in front.names
    }
    found: list[Mark] = []
    for point, timing in _timed(study, rows, threads):
        if point.error is None or not point.error.rows:
            continue
        error = error_of(point)
        measure: Measure = "strength"
        if point.question == "tree" or error is None:
            measure, error = "class", point.error.flips / point.error.rows
        found.append(Mark(point, timing, measure, _shown(error), point.name in fronts))
    yield from sorted(found, key=lambda m: (not m.is_front, m.nanoseconds, m.name))


def _shown(error: float) -> float:
    """Return an error as it is drawn: at 1 if it is larger, or no number."""
    return error if error <= 1.0 else 1.0


def _timed(study: Study, rows: int, threads: int) -> Iterator[tuple[Point, Timing]]:
    for point in study.points:
        for timing in point.timings:
            if (timing.rows, timing.threads) == (rows, threads):
                yield point, timing


def floors_of(study: Study, rows: int, threads: int) -> Iterator[tuple[str, float]]:
    """Yield the name of each floor and its nanoseconds for a row."""
    for point, timing in _timed(study, rows, threads):
        if point.kind == "floor":
            yield point.name.removeprefix("floor: "), timing.median_ns / timing.rows


def nothing_text(study: Study, rows: int, threads: int) -> str:
    """Say that there is nothing to draw, and what there is."""
    known = sorted(
        {(one.rows, one.threads) for point in study.points for one in point.timings}
    )
    text = ", ".join(f"{rows} with {threads}" for rows, threads in known)
    return (
        f"nothing was measured with {rows} rows and {threads} threads; "
        f"rows and threads in this study: {text or 'none'}"
    )
