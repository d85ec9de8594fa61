"""A stability study as plain text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fuzzytree.checking import Criterion, Stability, Stiff
from fuzzytree.report.text import aligned, counted, first_lines

_INPUTS_SHOWN = 6  # inputs that float32 is not safe for, unless all are printed
_SAFE = "float32 is safe"

CRITERION = ("code", "stability check", "cases", "worst", "verdict")
_STIFF = ("input", "spread/size", "float32 costs", "observed", "changed", "advice")
_MOVE = ("input", "moved by", "answer moves by", "changed", "most at")


def stability_lines(study: Stability, *, is_verbose: bool = False) -> Iterator[str]:
    """Yield a study: verdict, checks, and the inputs with a problem.

    Args:
        study: The study.
        is_verbose: Whether to print every measurement, and not only the problems.
    """
    rows = f", {counted(study.rows, 'row')} of data" if study.rows else ""
    rows += f", {study.tried} of them tried" if study.tried < study.rows else ""
    runtimes = counted(len(study.runtimes), "runtime")
    made = counted(study.probes, "generated row")
    yield f"{study.model}: {stability_verdict(study)} ({made}{rows}; {runtimes})"
    if is_verbose:
        yield f"runtimes: {', '.join(study.runtimes) or 'none'}"
    yield from aligned([CRITERION, *map(criterion_row, study.criteria)])
    for one in study.criteria:
        if is_verbose or one.verdict == "FAILS":
            yield from (f"{one.code}: {text}" for text in one.detail)
        if is_verbose:
            yield from (f"{one.code}: not tried: {text}" for text in one.skipped)
    yield from _inputs(study, is_verbose=is_verbose)
    yield from _move_lines(study.stiff, is_verbose=is_verbose)
    todo = [f"what to do: {text}" for text in advice(study)]
    yield from first_lines(
        todo, None if is_verbose else 5, "thing to do", "things to do"
    )


def stability_verdict(study: Stability) -> str:
    """Return how many stability checks pass, and which fail."""
    total = counted(len(study.criteria), "stability check")
    failed = [one.code for one in study.criteria if one.verdict == "FAILS"]
    if failed:
        verb = "fails" if len(failed) == 1 else "fail"
        return f"{len(failed)} of {total} {verb}: {', '.join(failed)}"
    passed = sum(one.verdict == "holds" for one in study.criteria)
    return f"{passed} of {total} {'passes' if passed == 1 else 'pass'}, none fails"


def _inputs(study: Stability, *, is_verbose: bool) -> Iterator[str]:
    """Yield what float32 costs each input, or how many inputs it is safe for."""
    unsafe = [one for one in study.stiff if one.advice != _SAFE]
    shown = study.stiff if is_verbose else unsafe[:_INPUTS_SHOWN]
    if shown:
        yield from aligned([_STIFF, *map(_stiff_row, shown)])
    if study.stiff and not is_verbose:
        count = len(study.stiff) - len(unsafe)
        yield f"float32 is safe for {count} of {counted(len(study.stiff), 'input')}"


def advice(study: Stability) -> Iterator[str]:
    """Yield what to do, the most urgent first."""
    for one in study.criteria:
        if one.advice:
            yield f"{one.code}: {one.advice}"
    for stiff in study.stiff:
        if stiff.advice != _SAFE:
            yield f"{stiff.input}: {stiff.advice}"


def criterion_row(one: Criterion) -> tuple[str, ...]:
    """Return the cells of a stability check, below `CRITERION`."""
    cases = str(one.cases) if one.cases else "-"
    worst = "-" if one.worst is None else f"{one.worst:.2g}"
    verdict = one.verdict.replace("holds", "passes")
    return one.code, one.title, cases, worst, verdict


def _stiff_row(one: Stiff) -> tuple[str, ...]:
    flips = f"{one.flips} of {one.rows}"
    return (
        one.input,
        "-" if one.ratio is None else f"{one.ratio:.1e}",
        f"{one.predicted:.1e}",
        f"{one.observed:.1e}",
        flips,
        one.advice,
    )


def _move_lines(inputs: Sequence[Stiff], *, is_verbose: bool) -> Iterator[str]:
    """Yield how far answers move with an input, or the jumps of outputs alone."""
    rows = [
        (
            one.input,
            move.step,
            f"{move.largest:.1e}{move.output and f' of the range of {move.output}'}",
            f"{move.changed} of {one.rows}",
            move.row or "-",
        )
        for one in inputs
        for move in one.moves[: None if is_verbose else 1]
        if is_verbose or (move.output and move.changed)
    ]
    if rows:
        yield from aligned([_MOVE, *rows])
