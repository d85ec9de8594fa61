"""`fuzzytree tactile bench`: what each way from frame to class costs, and its error."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from fuzzytree.cli.talk import (
    answer,
    answer_json,
    json_option,
    progress_bar,
    quiet_option,
    say,
    wrong_options,
)
from fuzzytree.tactile.cli.sensors import (
    asked_model,
    frames_of,
    sensor_options,
    wanted_sensor,
)


@click.command("bench", short_help="Measure run time and error, frame to class.")
@click.argument("model", metavar="MODEL")
@sensor_options
@click.option("--data", metavar="FRAMES", help="Frames of your own; made ones if none.")
@click.option(
    "--rows",
    metavar="N",
    type=click.IntRange(1, 1_000_000),
    multiple=True,
    default=(1, 10_000),
    show_default=True,
    help="Frames in a call.",
)
@click.option(
    "--reject",
    type=click.FloatRange(0.0, 1.0),
    default=0.0,
    metavar="SHARE",
    help="What is weaker is none of the known objects; for raw rules.",
)
@click.option(
    "--rounds",
    metavar="N",
    type=click.IntRange(1, 1_000),
    default=15,
    show_default=True,
    help="Samples of each; the interval needs 6.",
)
@click.option(
    "--budget",
    metavar="SECONDS",
    type=click.FloatRange(0.1),
    default=120.0,
    show_default=True,
    help="About how long it may take.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@json_option
@quiet_option
def command(
    model: str,
    board: str | None,
    size: str | None,
    full: int | None,
    threshold: int | None,
    data: str | None,
    rows: Sequence[int],
    reject: float,
    rounds: int,
    budget: float,
    seed: int,
    as_json: bool,
    quiet: bool,
) -> int:
    """Measure every way from a board's frames to the classes of MODEL, one thread.

    NumPy, ONNX, C and plain Python answer the same frames in interleaved rounds;
    errors are those against exact arithmetic.
    """
    from fuzzytree.tactile.recognition.timing import time_frames
    from fuzzytree.tactile.report.frames import study_lines

    sensor = wanted_sensor(board, size, full, threshold)
    asked = asked_model(model)
    frames = frames_of(data, sensor, quiet=quiet)
    with wrong_options(), progress_bar(quiet=quiet) as tell:
        found = time_frames(
            asked,
            sensor,
            frames,
            data=Path(data).name if data else "",
            rows=rows,
            reject=reject,
            rounds=rounds,
            seconds=budget,
            seed=seed,
            tell=tell,
        )
    if as_json:
        answer_json(found)
    else:
        answer("\n".join(study_lines(found)))
    flips = sum(point.flips for point in found.points)
    if flips:
        say(f"{flips} answers are not those of the exact features")
    return 0
