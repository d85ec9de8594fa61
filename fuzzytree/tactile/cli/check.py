"""`fuzzytree tactile check`: compare files of frames with their model."""

from __future__ import annotations

from collections.abc import Sequence

import click

from fuzzytree.cli import (
    answer,
    answer_json,
    argument,
    option,
    rows_only_option,
    say,
    takes,
    wrong_options,
)
from fuzzytree.tactile.cli.sensors import (
    SensorOptions,
    data_option,
    sensor_of_options,
)


class TactileCheckOptions(SensorOptions):
    """The arguments and options of the verb."""

    model: str = argument("MODEL")
    files: Sequence[str] = argument("FILE.onnx...", nargs=-1, required=True)
    data: str | None = data_option
    reject: float = option(
        "--reject",
        "Value of `reject` that the files were exported with.",
        type=click.FloatRange(0.0, 1.0),
        default=0.0,
    )
    rows_only: bool = rows_only_option


@click.command("check", short_help="Compare files of frames with their model.")
@takes(TactileCheckOptions)
def command(options: TactileCheckOptions) -> int:
    """Compare ONNX files that take frames with MODEL, as `tactile export` wrote them.

    Metadata, graph and predictions of a file must be those of the model, bit by bit;
    generated frames are aimed at bounds and cuts. Exit 1 if not.
    """
    from fuzzytree.files import read_bounded
    from fuzzytree.report import agreement_lines, agreement_verdict
    from fuzzytree.tactile.presses import read_frames
    from fuzzytree.tactile.recognition.checking import check_frames
    from fuzzytree.tactile.recognition.recogniser import frames_model

    settings = (options.board, options.sensor, options.full, options.threshold)
    is_named = any(one is not None for one in settings)
    with wrong_options():
        found = check_frames(
            frames_model(options.model),
            sensor_of_options(options) if is_named else None,
            None if options.data is None else read_frames(options.data).frames,
            files={name: read_bounded(name) for name in options.files},
            reject=options.reject,
            rows_only=options.rows_only,
        )
    if options.as_json:
        answer_json({"check": found, "ok": found.ok})
        say(agreement_verdict(found), quiet=options.quiet and found.ok)
    else:
        answer("\n".join(agreement_lines(found)))
    return 0 if found.ok else 1
