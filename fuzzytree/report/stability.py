"""A stability study as plain text."""

from __future__ import annotations

from collections.abc import Iterator

from fuzzytree.checking import Criterion, CurveFault, OffsetCost, Stability, Stiff
from fuzzytree.report.text import aligned, counted, number

_CURVES_SHOWN = 5  # curves with a fault, unless all are printed
_INPUTS_SHOWN = 6  # inputs that float32 is not safe for, unless all are printed
_SAFE = "float32 is safe"

CRITERION = ("code", "stability check", "cases", "worst", "verdict")
_STIFF = ("input", "spread/size", "float32 costs", "observed", "flips", "advice")
_OFFSET = ("form", "spread/distance", "float32", "mixed", "double", "flips in float32")
_CURVE = ("curve", "form", "size", "leaves [0, 1]", "rises", "advice")


def stability_lines(found: Stability, *, is_verbose: bool = False) -> Iterator[str]:
    """Yield a study: verdict, checks, and the inputs and curves with a problem.

    Args:
        found: The study.
        is_verbose: Whether to print every measurement, and not only the problems.
    """
    rows = f", {counted(found.rows, 'row')} of data" if found.rows else ""
    rows += f", {found.tried} of them tried" if found.tried < found.rows else ""
    runtimes = counted(len(found.runtimes), "runtime")
    probes = counted(found.probes, "probe")
    yield f"{found.model}: {stability_verdict(found)} ({probes}{rows}; {runtimes})"
    if is_verbose:
        yield f"runtimes: {', '.join(found.runtimes) or 'none'}"
    yield from aligned([CRITERION, *map(criterion_row, found.criteria)])
    for one in found.criteria:
        yield from _detail(one, is_verbose=is_verbose)
    yield from _inputs(found, is_verbose=is_verbose)
    if is_verbose and found.offsets:
        yield from _offset_lines(found.offsets)
    faults = [one for one in found.curves if is_verbose or one.fails]
    if faults:
        shown = faults if is_verbose else faults[:_CURVES_SHOWN]
        yield from aligned([_CURVE, *map(_curve_row, shown)])
        if len(shown) < len(faults):
            yield f"{len(faults) - len(shown)} more curves; --verbose lists all"
    todo = [*advice(found)]
    yield from (f"what to do: {text}" for text in todo[: None if is_verbose else 5])
    if len(todo) > 5 and not is_verbose:
        yield f"{len(todo) - 5} more things to do; --verbose lists all"


def stability_verdict(found: Stability) -> str:
    """Return how many stability checks pass, and which fail."""
    total = counted(len(found.criteria), "stability check")
    failed = [one.code for one in found.criteria if one.verdict == "FAILS"]
    if failed:
        verb = "fails" if len(failed) == 1 else "fail"
        return f"{len(failed)} of {total} {verb}: {', '.join(failed)}"
    passed = sum(one.verdict == "holds" for one in found.criteria)
    return f"{passed} of {total} {'passes' if passed == 1 else 'pass'}, none fails"


def _inputs(found: Stability, *, is_verbose: bool) -> Iterator[str]:
    """Yield what float32 costs each input, or how many inputs it is safe for."""
    unsafe = [one for one in found.stiff if one.advice != _SAFE]
    shown = found.stiff if is_verbose else unsafe[:_INPUTS_SHOWN]
    if shown:
        yield from aligned([_STIFF, *map(_stiff_row, shown)])
    if found.stiff and not is_verbose:
        count = len(found.stiff) - len(unsafe)
        yield f"float32 is safe for {count} of {counted(len(found.stiff), 'input')}"


def advice(found: Stability) -> Iterator[str]:
    """Yield what to do, the most urgent first."""
    for one in found.criteria:
        if one.advice:
            yield f"{one.code}: {one.advice}"
    for stiff in found.stiff:
        if stiff.advice != _SAFE:
            yield f"{stiff.input}: {stiff.advice}"


def criterion_row(one: Criterion) -> tuple[str, ...]:
    """Return the cells of a stability check, below `CRITERION`."""
    cases = str(one.cases) if one.cases else "-"
    worst = "-" if one.worst is None else f"{one.worst:.2g}"
    verdict = one.verdict.replace("holds", "passes")
    return one.code, one.title, cases, worst, verdict


def _detail(one: Criterion, *, is_verbose: bool) -> Iterator[str]:
    if is_verbose or one.verdict == "FAILS":
        yield from (f"{one.code}: {text}" for text in one.detail)
    if is_verbose:
        yield from (f"{one.code}: not tried: {text}" for text in one.skipped)


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


def _offset_lines(costs: tuple[OffsetCost, ...]) -> Iterator[str]:
    rows = [
        (
            one.representation,
            f"{one.ratio:.0e}",
            *(
                "cannot" if error is None else f"{error:.1e}"
                for error in (one.float32, one.mixed, one.float64)
            ),
            "-" if one.float32 is None else f"{one.flips} of {one.rows}",
        )
        for one in costs
    ]
    yield from aligned([_OFFSET, *rows])


def _curve_row(one: CurveFault) -> tuple[str, ...]:
    where = ""
    if one.where is not None:
        where = f" from {number(one.where[0])} to {number(one.where[1])}"
    rise = f"by {one.rise:.2g}{where}" if one.rise else "-"
    leaves = f"by {one.overshoot:.2g}" if one.overshoot else "-"
    name = f"{one.variable} {one.term}"
    return name, one.form, f"{one.condition:.2g}", leaves, rise, one.advice
