"""Who is worth using: the front of error against run time, and advice in a sentence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import msgspec

from fuzzytree.benchmarking.candidates import title
from fuzzytree.benchmarking.clock import CONFIDENCE, times_faster
from fuzzytree.benchmarking.records import Front, Point, Question, Timing
from fuzzytree.runtimes import baseline

_LEVELS = (0.0, *(10.0**power for power in range(-16, 1)))


class FrontEntry(msgspec.Struct, frozen=True):
    """A point at one number of rows and threads, with the one error that counts."""

    point: Point
    timing: Timing
    error: float

    @property
    def name(self) -> str:
        """The name of the candidate."""
        return self.point.name

    @property
    def short(self) -> str:
        """Its name without the question."""
        return self.point.name.removesuffix(f": {self.point.question}")


def error_of(point: Point) -> float | None:
    """Return the one number by which a point's error is judged.

    For a tree it is the share of rows whose class differs from the exact one. For
    rules it is the certified bound of a strength where there is one, and the largest
    error that was observed where there is none. None: a floor, or a peer that
    returns classes alone.

    Example:
        >>> from fuzzytree.benchmarking.records import Error
        >>> error = Error(rows=10, largest=None, bound=None, origin="", flips=1)
        >>> error_of(Point("a", "tree", "peer", error, (), 0.0))
        0.1
    """
    error = point.error
    if error is None or not error.rows:
        return None
    if point.question == "tree":
        return error.flips / error.rows
    return error.largest if error.bound is None else error.bound


def entries(
    points: Sequence[Point], question: Question, rows: int, threads: int
) -> list[FrontEntry]:
    """Return the points that can be compared, the fastest first.

    What was observed alone counts as no better than the least certified bound.
    """
    own = [one for one in points if one.question == question and one.kind != "floor"]
    bounds = [one.error.bound for one in own if one.error and one.error.bound]
    least = 0.0 if question == "tree" else min(bounds, default=0.0)
    comparable = [
        FrontEntry(point, timing, max(error, least))
        for point in own
        if (error := error_of(point)) is not None
        for timing in point.timings
        if (timing.rows, timing.threads) == (rows, threads)
    ]
    return sorted(
        comparable, key=lambda one: (one.timing.median_ns, one.error, one.name)
    )


def front(ordered: Sequence[FrontEntry]) -> list[FrontEntry]:
    """Return whom nobody beats: each is slower than the one before, and more exact."""
    kept: list[FrontEntry] = []
    for one in ordered:
        if not kept or one.error < kept[-1].error:
            kept.append(one)
    return kept


def fronts(points: Sequence[Point]) -> tuple[Front, ...]:
    """Return the front of each question, number of rows and number of threads."""
    records: list[Front] = []
    for question, rows, threads in settings(points):
        best = front(entries(points, question, rows, threads))
        if best:
            names = tuple(one.name for one in best)
            records.append(Front(question, rows, threads, names))
    return tuple(records)


def settings(points: Sequence[Point]) -> list[tuple[Question, int, int]]:
    """Return what was measured: questions in their order, then rows, then threads."""
    in_order: dict[Question, None] = {point.question: None for point in points}
    sizes = sorted(
        {(one.rows, one.threads) for point in points for one in point.timings}
    )
    return [
        (question, rows, threads) for question in in_order for rows, threads in sizes
    ]


def advice(points: Sequence[Point], most: float | None = None) -> tuple[str, ...]:
    """Return what to use, a sentence for each question and number of rows.

    Without a wanted error there is a sentence for the strictest level that anything
    keeps, and one for each coarser power of ten at which something else is faster for
    sure: the interval of the quotient lies above 1.

    Errors of strengths up to `most` are allowed. A tree's answer is right or wrong, so
    there the classes must all be right whatever is allowed.

    Returns:
        Sentences, those for most rows last; the last one is the one to remember.
    """
    sentences: list[str] = []
    fewest = min((t.threads for point in points for t in point.timings), default=1)
    sizes: list[tuple[Question, int]] = [
        (question, rows)
        for question, rows, threads in reversed(settings(points))
        if threads == fewest
    ]
    for question, rows in sorted(sizes, key=lambda size: size[1]):
        known = entries(points, question, rows, fewest)
        wanted = None if question == "tree" else most
        sentences += reversed([*_sentences(known, question, rows, wanted)])
    return tuple(sentences)


def _sentences(
    known: Sequence[FrontEntry], question: Question, rows: int, most: float | None
) -> Iterator[str]:
    if not known:
        return
    smallest = min(one.error for one in known)
    if most is not None:
        if smallest <= most:
            yield _sentence(known, question, rows, most)
        else:
            nearest = min(known, key=lambda one: one.error)
            yield (
                f"{_where(question, rows)}: nothing measured is "
                f"{_level(nearest, most)}; the nearest is {nearest.short} with "
                f"{smallest:.2g}"
            )
        return
    before: FrontEntry | None = None
    for level in (level for level in _LEVELS if level >= smallest):
        best = _choice(known, question, level)
        if before is None or _is_surely_faster(best, before):
            yield _sentence(known, question, rows, level)
            before = best
        if question == "tree":
            return


def _is_surely_faster(one: FrontEntry, other: FrontEntry) -> bool:
    ratio = times_faster(other.timing, one.timing)
    if one.name == other.name or ratio is None:
        return False
    return ratio.low > 1.0 and ratio.confidence >= CONFIDENCE


def _choice(
    known: Sequence[FrontEntry], question: Question, level: float
) -> FrontEntry:
    """Return the fastest within a level, or the default if nothing is surely faster."""
    within = [one for one in known if one.error <= level]
    default = _default(within, question)
    if default is not None and not _is_surely_faster(within[0], default):
        return default
    return within[0]


def _default(known: Sequence[FrontEntry], question: Question) -> FrontEntry | None:
    name = title(baseline().name, question)
    return next((one for one in known if one.name == name), None)


def _sentence(
    known: Sequence[FrontEntry], question: Question, rows: int, level: float
) -> str:
    """Say what to use within a level, and against what.

    That is the default; or, for the default, the fastest of the others.
    """
    best = _choice(known, question, level)
    others = [one for one in known if one.error <= level and one.name != best.name]
    head = f"{_where(question, rows)}: fastest {_level(best, level)}: {_what(best)}"
    other = _default(known, question)
    if other is None or best.name == other.name:
        other = others[0] if others else None
    if other is None:
        return f"{head}, the only one"
    ratio = times_faster(other.timing, best.timing)
    if ratio is None:
        return f"{head}; {other.short} shares no round with it"
    sure = f"95 % CI {_times(ratio.low)} to {_times(ratio.high)}"
    if ratio.confidence < CONFIDENCE:
        sure = "in too few rounds to be sure"
    elif ratio.low > 1.0:
        times = f"{_times(ratio.median)} times as fast as {other.short}"
        return f"{head}, {times} ({sure}){_at_cuts(best)}"
    took = f"{other.short} takes {_times(ratio.median)} times as long"
    return f"{head}; nothing is surely faster ({took}, {sure}){_at_cuts(best)}"


def _what(best: FrontEntry) -> str:
    """Name a candidate, and what it leaves out of the answer to its question."""
    error = best.point.error
    is_mute = error is not None and error.largest is None
    if best.point.question != "tree" and is_mute:
        return f"{best.short} (which returns no strengths)"
    return best.short


def _where(question: Question, rows: int) -> str:
    return f"{question}, {rows:,} row{'' if rows == 1 else 's'}"


def _level(best: FrontEntry, level: float) -> str:
    """Say what is demanded, and for a tree on how many rows it was seen."""
    error = best.point.error
    if best.point.question != "tree" or error is None:
        return f"within an error of {level:g}"
    changed = "without a changed class"
    if level > 0.0:
        changed = f"with at most {level:.2%} of classes changed"
    return f"{changed} in {error.rows:,} row{'' if error.rows == 1 else 's'}"


def _at_cuts(best: FrontEntry) -> str:
    """Say how many of the rows that lie on a cut of a tree change their class."""
    edges = best.point.probes
    if best.point.question != "tree" or edges is None or not edges.flips:
        return ""
    return f"; changed in {edges.flips} of {edges.rows} rows generated at its cuts"


def _times(ratio: float) -> str:
    return (
        f"{ratio:.2f}"
        if ratio < 2
        else f"{ratio:.1f}"
        if ratio < 100
        else f"{ratio:.0f}"
    )
