"""A stability study as plain text."""

from __future__ import annotations

from collections.abc import Iterator

from fuzzytree.checking.stability.results import (
    Criterion,
    CurveFault,
    OffsetCost,
    Stability,
    Stiff,
)
from fuzzytree.report.text import aligned, counted, number

_CURVES_TOLD = 10
_SKIPPED_TOLD = 3

_CRITERION = ("code", "criterion", "cases", "worst", "verdict")
_STIFF = ("input", "spread/size", "float32 costs", "observed", "flips", "advice")
_OFFSET = ("form", "spread/distance", "float32", "mixed", "double", "flips in float32")
_CURVE = ("curve", "form", "size", "leaves [0, 1]", "rises", "advice")


def stability_lines(found: Stability, *, is_full: bool = False) -> Iterator[str]:
    """Yield a study: criteria, stiff inputs, offsets, curves, and what to do.

    Args:
        found: The study.
        is_full: Whether to tell everything that was left out, and every curve.
    """
    rows = f", {counted(found.rows, 'row')} of data" if found.rows else ""
    rows += f", {found.tried} of them tried" if found.tried < found.rows else ""
    yield f"{found.model}: {counted(found.probes, 'probe')}{rows}"
    yield f"run by   {', '.join(found.runtimes) or 'nothing'}"
    yield ""
    yield from aligned([_CRITERION, *map(_criterion_row, found.criteria)])
    for one in found.criteria:
        yield from _detail(one, is_full=is_full)
    if found.stiff:
        yield ""
        yield from aligned([_STIFF, *map(_stiff_row, found.stiff)])
    if found.offsets:
        yield ""
        yield from _offset_lines(found.offsets)
    if found.curves:
        yield ""
        shown = found.curves if is_full else found.curves[:_CURVES_TOLD]
        yield from aligned([_CURVE, *map(_curve_row, shown)])
        if len(shown) < len(found.curves):
            yield f"and {len(found.curves) - len(shown)} more; --rows tells all"
    todo = tuple(advice(found))
    if todo:
        yield ""
        yield from (f"what to do: {text}" for text in todo)


def advice(found: Stability) -> Iterator[str]:
    """Yield what to do, the most urgent first."""
    for one in found.criteria:
        if one.advice:
            yield f"{one.code}: {one.advice}"
    for stiff in found.stiff:
        if stiff.advice != "float32 is safe":
            yield f"{stiff.input}: {stiff.advice}"


def _criterion_row(one: Criterion) -> tuple[str, ...]:
    cases = str(one.cases) if one.cases else "-"
    worst = "-" if one.worst is None else f"{one.worst:.2g}"
    return one.code, one.title, cases, worst, one.verdict


def _detail(one: Criterion, *, is_full: bool) -> Iterator[str]:
    for text in one.detail:
        yield f"{one.code}: {text}"
    shown = one.skipped if is_full else one.skipped[:_SKIPPED_TOLD]
    for text in shown:
        yield f"{one.code}: not tried: {text}"
    if len(shown) < len(one.skipped):
        yield f"{one.code}: not tried: {len(one.skipped) - len(shown)} more"


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
            one.carrier,
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
