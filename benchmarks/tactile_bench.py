"""What each way from frame to class costs, and its error against exact arithmetic.

python benchmarks/tactile_bench.py MODEL --sensor 16x16
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import click
from commands import run
from tactile_timing import FramesStudy, Point, time_frames

from fuzzytree.benchmarking.records import Timing
from fuzzytree.cli.console import (
    answer,
    answer_json,
    argument,
    option,
    progress_bar,
    say,
    takes,
    wrong_options,
)
from fuzzytree.report.bench import machine_rows
from fuzzytree.report.text import aligned, duration
from fuzzytree.tactile.cli.sensors import (
    SensorOptions,
    frames_of_file,
    sensor_of_options,
)
from fuzzytree.tactile.recognition.recogniser import frames_model


class TactileBenchOptions(SensorOptions):
    """The arguments and options of the verb."""

    model: str = argument("MODEL")
    data: str | None = option("--data FRAMES", "Frames of your own; made ones if none.")
    rows: Sequence[int] = option(
        "--rows N",
        "Frames in a call.",
        type=click.IntRange(1, 1_000_000),
        multiple=True,
        default=(1, 10_000),
    )
    reject: float = option(
        "--reject SHARE",
        "What is weaker is none of the known objects; for raw rules.",
        type=click.FloatRange(0.0, 1.0),
        default=0.0,
    )
    rounds: int = option(
        "--rounds N",
        "Samples of each; the interval needs 6.",
        type=click.IntRange(1, 1_000),
        default=15,
    )
    budget: float = option(
        "--budget SECONDS",
        "About how long it may take.",
        type=click.FloatRange(0.1),
        default=120.0,
    )
    seed: int = option("--seed", "Random seed.", type=click.IntRange(0), default=0)


@click.command("tactile_bench.py")
@takes(TactileBenchOptions)
def command(options: TactileBenchOptions) -> None:
    """Measure every way from a board's frames to the classes of MODEL, one thread.

    NumPy, ONNX, C and plain Python answer the same frames in interleaved rounds;
    errors are those against exact arithmetic.
    """
    sensor = sensor_of_options(options)
    asked = frames_model(options.model)
    frames = frames_of_file(options.data, sensor, quiet=options.quiet)
    with wrong_options(), progress_bar(quiet=options.quiet) as progress:
        found = time_frames(
            asked,
            sensor,
            frames,
            data=Path(options.data).name if options.data else "",
            rows=options.rows,
            reject=options.reject,
            rounds=options.rounds,
            seconds=options.budget,
            seed=options.seed,
            progress=progress,
        )
    if options.as_json:
        answer_json(found)
    else:
        answer("\n".join(study_lines(found)))
    flips = sum(point.flips for point in found.points)
    if flips:
        say(f"{flips} answers are not those of the exact features")


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


if __name__ == "__main__":
    sys.exit(run(command))
