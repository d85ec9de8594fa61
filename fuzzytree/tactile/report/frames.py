"""What was found of frames, as plain text: a check's counts, a study of run times."""

from __future__ import annotations

from collections.abc import Iterator

from fuzzytree.benchmarking.records import Timing
from fuzzytree.report.bench import machine_rows
from fuzzytree.report.text import agreement_lines, aligned, counted, duration
from fuzzytree.tactile.recognition.carriers import FramesAgreement
from fuzzytree.tactile.recognition.timing import FramesStudy, Point


def check_lines(found: FramesAgreement, *, is_full: bool = False) -> Iterator[str]:
    """Yield a check of frames: the table, and what the frames show.

    Args:
        found: The check.
        is_full: Whether to tell also what did not fail.
    """
    yield from agreement_lines(found, is_full=is_full)
    shown = found.shown
    yield (
        f"of {counted(shown.frames, 'frame')}, {shown.aimed} aimed at bounds and cuts, "
        f"{shown.nothing} show nothing, {shown.unknown} nothing known, "
        f"{shown.saturated} a cell that takes no more, {shown.ties} a tie"
    )
    yield (
        f"largest error of a feature against {found.comparisons[0].against}: "
        f"{found.largest_error:.2g} of its scale"
    )


def study_lines(found: FramesStudy) -> Iterator[str]:
    """Yield a study of frames: what and where, a table for each number of frames."""
    sensor = found.sensor
    yield f"{found.model}: from frame to class, in {found.seconds:.0f} s"
    yield from aligned(
        [
            ("features", ", ".join(found.features) or "none"),
            ("frames", f"{found.data}; {sensor.rows} x {sensor.columns} cells"),
            *machine_rows(found.machine),
        ]
    )
    rows = {one.rows for point in found.points for one in point.timings}
    for count in sorted(rows):
        timed = [
            (point, one)
            for point in found.points
            for one in point.timings
            if one.rows == count
        ]
        yield ""
        yield f"{count:,} frame{'' if count == 1 else 's'} in a call, 1 thread"
        yield from aligned([_HEAD, *(_row(*one, found) for one in timed)])
    yield ""
    yield "time is that of a frame: the median, and the ends of its 95 % interval;"
    yield "error is the largest of a feature, as a share of its scale; flips are"
    yield "classes that are not those of the exact features"
    yield from (f"left out: {text}" for text in found.omissions)
    if not found.is_complete:
        yield "ended early: some was measured less often"


_HEAD = ("way", "time", "from", "to", "error", "flips", "file")


def _row(point: Point, timing: Timing, found: FramesStudy) -> tuple[str, ...]:
    ends = (timing.median_ns, timing.low_ns, timing.high_ns)
    times = (duration(one / timing.rows) for one in ends)
    is_floor = point.error is None
    error = "" if point.error is None else f"{point.error:.2g}"
    flips = "" if is_floor else f"{point.flips} of {found.judged}"
    size = f"{point.bytes:,} bytes" if point.bytes else ""
    return (point.name, *times, error, flips, size)
