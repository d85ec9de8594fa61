"""`fuzzytree tactile check`: compare files of frames with their model."""

from __future__ import annotations

from collections.abc import Sequence

import click

from fuzzytree.cli import (
    answer,
    answer_json,
    json_option,
    quiet_option,
    rows_only_option,
    say,
)
from fuzzytree.tactile.cli.sensors import (
    frames_model,
    sensor_of_options,
    sensor_options,
)


@click.command("check", short_help="Compare files of frames with their model.")
@click.argument("model", metavar="MODEL")
@click.argument("files", metavar="FILE.onnx...", nargs=-1, required=True)
@click.option(
    "--data", metavar="FRAMES", help="Frames to check with, beside generated ones."
)
@sensor_options
@click.option(
    "--reject",
    type=click.FloatRange(0.0, 1.0),
    default=0.0,
    help="Value of `reject` that the files were exported with; default 0.",
)
@rows_only_option
@json_option
@quiet_option
def command(
    model: str,
    files: Sequence[str],
    data: str | None,
    board: str | None,
    size: str | None,
    full: int | None,
    threshold: int | None,
    reject: float,
    rows_only: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Compare ONNX files that take frames with MODEL, as `tactile export` wrote them.

    Metadata, graph and predictions of a file must be those of the model, bit by bit;
    generated frames are aimed at bounds and cuts. Exit 1 if not.
    """
    from fuzzytree.files import read_bounded
    from fuzzytree.report import agreement_lines, agreement_verdict
    from fuzzytree.tactile.presses import read_frames
    from fuzzytree.tactile.recognition.onnx_files import check_onnx_files

    is_named = any(one is not None for one in (board, size, full, threshold))
    sensor = sensor_of_options(board, size, full, threshold) if is_named else None
    source = frames_model(model)
    contents = {name: read_bounded(name) for name in files}
    frames = None if data is None else read_frames(data).presses.frames
    found = check_onnx_files(
        source, contents, frames, sensor=sensor, reject=reject, rows_only=rows_only
    )
    if as_json:
        answer_json({"check": found, "ok": found.ok})
        say(agreement_verdict(found), quiet=quiet and found.ok)
    else:
        answer("\n".join(agreement_lines(found)))
    return 0 if found.ok else 1
