"""`fuzzytree tactile export`: one file from the raw frame to the class."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from fuzzytree.cli import (
    OUTPUT,
    answer,
    answer_bytes,
    answer_json,
    argument,
    option,
    option_values,
    say,
    say_rows,
    setting,
    several,
    takes,
    wrong_options,
)
from fuzzytree.files import write_atomically
from fuzzytree.tactile.cli.sensors import (
    SensorOptions,
    data_option,
    frames_of_file,
    sensor_of_options,
)

_FORMS = ("onnx", "c")


class TactileExportOptions(SensorOptions):
    """The arguments and options of the verb."""

    model: str = argument("MODEL")
    output: str = argument("OUT", type=OUTPUT)
    to: str | None = option(
        "--to", "Format; default by the suffix of OUT.", choices=_FORMS
    )
    data: str | None = data_option
    settings: Sequence[str] = several(
        "--set NAME=VALUE",
        "Option (repeat): outputs, reject, opset, ir, plain of graphs; "
        "name, reject of C.",
    )


@click.command("export", short_help="Write one file from raw frame to class.")
@takes(TactileExportOptions)
def command(options: TactileExportOptions) -> int:
    """Write MODEL as file OUT (.onnx or .c) that takes frames as a board sends them.

    All implementations from frame to class are compared first, bit by bit, the graph
    to be written among them. If one disagrees, nothing is written: exit 1. `-` is
    stdout.
    """
    from fuzzytree.exporters import require
    from fuzzytree.model import Format
    from fuzzytree.report import agreement_lines, agreement_verdict
    from fuzzytree.tactile.exporters import onnx_frames
    from fuzzytree.tactile.exporters.c_frames import write_frames_c
    from fuzzytree.tactile.recognition.checking import check_frames
    from fuzzytree.tactile.recognition.recogniser import (
        Recogniser,
        State,
        check_inputs,
        frames_model,
    )
    from fuzzytree.tactile.sensor import saturated

    form = options.to or Path(options.output).suffix.lower()[1:]
    if form not in _FORMS:
        text = "a file from frame to class ends in .onnx or .c"
        raise click.UsageError(f"{options.output}: {text}")
    write: Any = write_frames_c if form == "c" else onnx_frames.write_frames
    with wrong_options():
        known = Format(form, (f".{form}",), write, ("tree", "rules"))  # for its options
        values: dict[str, Any] = option_values(known, map(setting, options.settings))
    if form == "onnx":
        require("onnxruntime", "verifying a written onnx file needs")
    sensor = sensor_of_options(options)
    source = frames_model(options.model)
    check_inputs(source)
    frames = frames_of_file(options.data, sensor, quiet=options.quiet)
    with wrong_options():
        written = write(source, sensor, **values)
        reject = values.get("reject", 0.0)
        graphs = {"onnx": written.content} if form == "onnx" else None
        found = check_frames(source, sensor, frames, files=graphs, reject=reject)
    lines, shown = [*agreement_lines(found)], {}
    if frames is not None:
        seen = Recogniser(source, sensor, reject)(frames)
        shown = {
            "frames": len(frames),
            "empty": int((seen.states == State.NOTHING).sum()),
            "unknown": int((seen.states == State.UNKNOWN).sum()),
            "saturated": int((saturated(sensor, frames) > 0).sum()),
        }
        text = ", ".join(f"{count} {name}" for name, count in shown.items())
        lines.append(f"{options.data}: {text}")
    if found.ok and options.output != "-":
        write_atomically(options.output, written.content)
    if options.output == "-":
        for line in lines:
            say(line, quiet=options.quiet)
    elif options.as_json:
        size = len(written.content)
        facts = {"file": options.output, "format": form, "bytes": size}
        answer_json({**facts, "check": found, "shown": shown, "ok": found.ok})
    else:
        answer("\n".join(lines))
    if not found.ok:
        say(f"{agreement_verdict(found)}; nothing is written")
        return 1
    if options.output == "-":
        answer_bytes(written.content)
    digest = hashlib.sha256(written.content).hexdigest()
    said = f"{form}, {len(written.content)} bytes, sha256 {digest}"
    say_rows(("wrote", options.output, said), quiet=options.quiet)
    return 0
