"""Points and studies made by hand, for tests that measure nothing."""

from __future__ import annotations

from fuzzytree.benchmarking.clock import interval
from fuzzytree.benchmarking.front import advice, fronts
from fuzzytree.benchmarking.records import (
    Error,
    Kind,
    Machine,
    Omission,
    Point,
    Question,
    Study,
    Timing,
)


def timing(
    ns: float, *, rows: int = 1000, threads: int = 1, spread: float = 0.01
) -> Timing:
    """Return fifteen samples of a call, evenly around a time."""
    samples = tuple(ns * (1 + spread * (k - 7) / 7) for k in range(15))
    result = interval(samples)
    return Timing(
        rows,
        threads,
        samples,
        result.median,
        result.low,
        result.high,
        result.confidence,
        rounds=tuple(range(15)),
        stolen=0.0,
    )


def error(
    largest: float | None,
    bound: float | None = None,
    *,
    flips: int = 0,
    rows: int = 200,
) -> Error:
    return Error(rows, largest, bound, "by hand", flips)


def point(
    name: str,
    ns: float,
    judged: Error | None,
    *,
    question: Question = "rules",
    kind: Kind = "runtime",
    more: tuple[Timing, ...] = (),
    probes: Error | None = None,
) -> Point:
    timings = (timing(ns), *more)
    return Point(
        f"{name}: {question}" if kind != "floor" else name,
        question,
        kind,
        judged,
        timings,
        1.5,
        probes=probes,
    )


def study(*points: Point, most: float | None = None) -> Study:
    machine = Machine(
        "a processor",
        2,
        "Linux 6",
        "CPython 3.11.7",
        {"numpy": "2.4.6"},
        (0.5, 0.4, 0.3),
        (0.6, 0.4, 0.3),
        0.01,
    )
    return Study(
        "grip",
        "0" * 64,
        "grasps.csv, 200 rows",
        machine,
        points,
        (Omission("treelite: rules", "not installed (pip install treelite)"),),
        advice=advice(points, most),
        fronts=fronts(points),
        seconds=12.3,
    )
