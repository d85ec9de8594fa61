"""A study of run times as plain text: a table for each number of rows and threads."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import get_args

from fuzzytree.benchmarking import (
    CONFIDENCE,
    READING,
    Machine,
    Omission,
    Point,
    Question,
    Study,
    Timing,
    times_faster,
    title,
)
from fuzzytree.report.text import aligned, counted, digits, duration, more_line, wrapped
from fuzzytree.runtimes import baseline

_HEAD = (
    *("time per row", "+-", "speed", "floor x"),
    *("error", "certified", "changed", "at edges"),
)
_UNBEATEN = (
    *("computes", "rows", "threads", "fastest", "time per row", "speed"),
    *("error", "certified", "changed"),
)
_MOST_UNBEATEN = 18  # rows of the short table
Timed = dict[str, tuple[Point, Timing]]

_WIDTH = 96  # of a line of words
_LEGEND = (
    "* no candidate is both faster and more exact; +- the 95 % interval of the median;",
    "speed: times as fast as the default runtime; floor x: as reading the columns;",
    "error: the largest observed of a strength, or of an output as a share of its",
    "range (below outputs in its unit); certified: the bound of it; changed: classes",
    "(statuses of systems) other than the exact ones; at edges: in rows on a cut",
)


def study_lines(study: Study, *, is_verbose: bool = False) -> Iterator[str]:
    """Yield a study: what to use, the unbeaten candidates, how many were left out.

    Args:
        study: The study.
        is_verbose: Whether to print every table, omission and advice.
    """
    nothing = "measured" if study.points else "nothing could be measured"
    advice = study.advice[-1] if study.advice else nothing
    yield from wrapped(advice, _WIDTH, rest="  ")
    yield f"{study.model}: {study.data}; {study.seconds:.0f} s"
    names = {point.name for point in study.points}
    left = [one for one in study.omissions if one.name not in names]
    for line in _grouped(one for one in left if one.is_peer):
        yield from wrapped(f"peers left out: {line}", _WIDTH, rest="  ")
    if is_verbose:
        yield from _tables(study)
        return
    if study.points:
        yield from aligned([_UNBEATEN, *_unbeaten(study)][: _MOST_UNBEATEN + 1])
    for text in study.warnings[:2]:
        yield from wrapped(f"doubtful: {text}", _WIDTH, rest="  ")
    yield from more_line(len(study.warnings) - 2, "doubt")
    names = {one.name for one in study.omissions if one not in left or not one.is_peer}
    if names:
        yield f"{counted(len(names), 'candidate')} left out"
    yield "--verbose lists every time, error, omission and advice"


def _unbeaten(study: Study) -> Iterator[tuple[str, ...]]:
    """Yield the fastest unbeaten candidate of each question and number of rows."""
    for front in study.fronts:
        here = timed_of(study, front.rows, front.threads)
        members = [here[name] for name in front.names if name in here]
        if not members:
            continue
        point, timing = min(
            members, key=lambda one: (one[0].kind == "variant", one[1].median_ns)
        )
        time, _, speed, _ = _time_cells(timing, here, front.question)
        yield (
            front.question,
            f"{front.rows:,}",
            str(front.threads),
            point.name.removesuffix(f": {front.question}"),
            time,
            speed,
            *_errors(point)[:3],
        )


def _tables(study: Study) -> Iterator[str]:
    yield from aligned(machine_rows(study.machine))
    for rows, threads in sizes(study.points):
        yield ""
        yield f"{rows:,} row{'' if rows == 1 else 's'}, {counted(threads, 'thread')}"
        table = [*_table(study, rows, threads)]
        width = max(map(len, table))
        yield from aligned([(*row, *[""] * (width - len(row))) for row in table])
    outputs = [*_outputs(study)]
    if outputs:
        yield ""
        yield from aligned([("outputs", "error", "of range", "certified"), *outputs])
    if study.points:
        yield ""
        yield from _LEGEND
    yield from _section("left out", _grouped(study.omissions))
    yield from _section("doubtful", study.warnings)
    yield from _section("advice", study.advice)


def _outputs(study: Study) -> Iterator[tuple[str, ...]]:
    """Yield the largest error of each output: its own, in its unit, and as a share."""
    for point in study.points:
        for name, one in point.error.outputs.items() if point.error else ():
            yield (
                f"  {name}, {point.name.removesuffix(f': {point.question}')}",
                *(
                    "-" if number is None else f"{number:.1e}"
                    for number in (one.largest, one.share, one.bound)
                ),
            )


def machine_rows(machine: Machine) -> Iterator[tuple[str, str]]:
    """Yield where it was measured, with what, and how busy the machine was."""
    yield (
        "machine",
        f"{machine.processor}, {counted(machine.cores, 'core')}, {machine.system}",
    )
    versions = [f"{name} {version}" for name, version in machine.versions.items()]
    yield "with", ", ".join([machine.python, *versions])
    if machine.load_before and machine.load_after:
        first, last = machine.load_before[0], machine.load_after[0]
        load = f"{first:.2f} before, {last:.2f} after"
        if machine.stolen is not None:
            load += f"; {machine.stolen:.0%} of the time went to others"
        yield "load", load


def sizes(points: Iterable[Point]) -> list[tuple[int, int]]:
    """Return the numbers of rows and threads that were measured."""
    sizes = {(one.rows, one.threads) for point in points for one in point.timings}
    return sorted(sizes)


def timed_of(study: Study, rows: int, threads: int) -> Timed:
    """Return what was measured at one number of rows and threads, by name."""
    return {
        point.name: (point, timing)
        for point in study.points
        for timing in point.timings
        if (timing.rows, timing.threads) == (rows, threads)
    }


def _table(study: Study, rows: int, threads: int) -> Iterator[tuple[str, ...]]:
    """Yield the cells of one table, question by question, the fastest first."""
    yield ("", *_HEAD)
    timed = timed_of(study, rows, threads)
    questions: dict[Question, None] = {}
    for point, timing in timed.values():
        if point.kind == "floor":
            yield (f"  {point.name}", *_time_cells(timing, timed))
        else:
            questions[point.question] = None
    for question in questions:
        best = unbeaten(study, question, rows, threads)
        yield from _rows(question, timed, best)


def _rows(
    question: Question, timed: Timed, best: Sequence[str]
) -> Iterator[tuple[str, ...]]:
    """Yield the cells of one question, the fastest first."""
    yield (question,)
    for point, timing in sorted(timed.values(), key=lambda one: one[1].median_ns):
        if point.question != question or point.kind == "floor":
            continue
        mark = "*" if point.name in best else " "
        short = point.name.removesuffix(f": {question}")
        yield (
            f"{mark} {short}",
            *_time_cells(timing, timed, question),
            *_errors(point),
        )


def unbeaten(
    study: Study, question: Question, rows: int, threads: int
) -> Sequence[str]:
    """Return the names of what nothing beats in both run time and error."""
    for front in study.fronts:
        if (front.question, front.rows, front.threads) == (question, rows, threads):
            return front.names
    return ()


def _time_cells(
    timing: Timing, timed: Timed, question: Question | None = None
) -> tuple[str, ...]:
    """Return time, spread, and the ratios to the default and to reading the columns."""
    middle = timing.median_ns
    reach = max(timing.high_ns - middle, middle - timing.low_ns) / middle
    sure = "" if timing.confidence >= CONFIDENCE else f" at {timing.confidence:.0%}"
    base = timed.get(title(baseline().name, question)) if question else None
    ratio = times_faster(base[1], timing) if base else None
    floor = timed.get(READING)
    return (
        duration(middle / timing.rows),
        f"{reach:.0%}{sure}",
        digits(ratio.median) if ratio else "",
        digits(middle / floor[1].median_ns) if floor else "",
    )


def _errors(point: Point) -> tuple[str, ...]:
    error = point.error
    if error is None:
        return ()
    edges = point.probes
    return (
        "-" if error.largest is None else f"{error.largest:.1e}",
        "-" if error.bound is None else f"{error.bound:.1e}",
        f"{error.flips} of {error.rows}",
        f"{edges.flips} of {edges.rows}" if edges else "",
    )


def _grouped(omissions: Iterable[Omission]) -> Iterator[str]:
    """Yield each reason once, with all that were left out for it."""
    groups: dict[str, dict[str, list[str]]] = {}
    for one in omissions:
        short, _, question = one.name.rpartition(": ")
        who = groups.setdefault(one.why, {})
        if question in get_args(Question):
            who.setdefault(short, []).append(question)
        else:
            who.setdefault(one.name, [])
    for why, who in groups.items():
        names = [
            f"{k} ({', '.join(questions)})" if questions else k
            for k, questions in who.items()
        ]
        yield f"{', '.join(names)}: {why}"


def _section(name: str, lines: Iterable[str]) -> Iterator[str]:
    """Yield a heading and its sentences, those that are long in several lines."""
    for position, line in enumerate(lines):
        if not position:
            yield ""
            yield name
        yield from wrapped(line, _WIDTH, "  ", "    ")
