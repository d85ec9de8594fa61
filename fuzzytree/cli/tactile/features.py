"""`fuzzytree tactile features`: frames as a table that a tree can be learnt from."""

from __future__ import annotations

import csv
import io
import shlex
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import click

from fuzzytree.cli.tactile.sensors import given_options, wanted_frames
from fuzzytree.cli.talk import (
    answer_bytes,
    answer_json,
    json_option,
    quiet_option,
    say_rows,
    wrong_options,
)
from fuzzytree.files import check_place, write_atomically

if TYPE_CHECKING:
    from fuzzytree.runtimes.frames import Features
    from fuzzytree.tactile.given import Given

CLASS = "class"
"""The column of the classes."""


@click.command("features", short_help="Turn frames into a table of features.")
@click.argument("frames", metavar="FRAMES")
@click.option(
    "--features",
    "text",
    metavar="NAMES",
    default="paper",
    show_default=True,
    help="Names and sets of features, with commas between them.",
)
@given_options
@click.option(
    "--label", metavar="ARRAY", default="label", help="The classes in FRAMES; `label`."
)
@click.option("-o", "--output", metavar="FILE", help="A CSV file; `-` is stdout.")
@json_option
@quiet_option
def command(
    frames: str,
    text: str,
    board: str | None,
    full: int | None,
    threshold: int | None,
    label: str,
    output: str | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Compute features of FRAMES, a numpy archive (.npz) or a recording.

    With -o they become a table for `fuzzytree learn`; without it, what each feature
    costs is listed. Frames on which nothing presses are left out and counted.
    """
    from fuzzytree.tactile.features import costs
    from fuzzytree.tactile.features.sets import names_of

    if output and output != "-":
        check_place(output)
    with wrong_options():
        names = names_of(text)
    given = wanted_frames(frames, board, full, threshold, label=label)
    found = costs(given.sensor, names)
    if output is None:
        if as_json:
            answer_json({"costs": found})
        else:
            for name in names:
                click.echo(f"{found[name]:8.0f}  {name}")
        return 0
    return _table(frames, given, names, found, output, as_json=as_json, quiet=quiet)


def _table(
    source: str,
    given: Given,
    names: Sequence[str],
    costs: object,
    output: str,
    *,
    as_json: bool,
    quiet: bool,
) -> int:
    from fuzzytree.report.text import counted
    from fuzzytree.runtimes.frames import features_of
    from fuzzytree.tactile.sensor import saturated

    presses, sensor = given.presses, given.sensor
    features = features_of(sensor, presses.frames, names)
    full = int((saturated(sensor, presses.frames) > 0).sum())
    none = int((~features.is_pressed).sum())
    content = "".join(_lines(given, features)).encode()
    if output == "-":
        answer_bytes(content)
        return 0
    write_atomically(output, content)
    size = f"{sensor.rows} x {sensor.columns} cells"
    rows = [("read", source, f"{counted(len(presses.frames), 'frame')} of {size}")]
    if none:
        rows.append(("left out", counted(none, "frame"), "nothing presses"))
    if full:
        text = f"a cell reads {sensor.full} or more"
        rows.append(("full", counted(full, "frame"), text))
    after = ["fuzzytree", "learn", output, "--target", CLASS, "-o", "tree.yaml"]
    after += ["--ignore", "subject"] if len(presses.subject) else []
    told = f"next: {shlex.join(after)}" if len(presses.label) else "without classes"
    rows.append(("wrote", output, f"{counted(len(names), 'feature')}; {told}"))
    say_rows(*rows, quiet=quiet)
    if as_json:
        answer_json(
            {
                "file": output,
                "frames": len(presses.frames),
                "nothing": none,
                "saturated": full,
                "features": list(names),
                "costs": costs,
            }
        )
    return 0


def _lines(given: Given, features: Features) -> Iterator[str]:
    """Yield the lines of a table: features, and class and subject where known."""
    presses = given.presses
    heads = [*features.names]
    heads += [CLASS] if len(presses.label) else []
    heads += ["subject"] if len(presses.subject) else []
    line = io.StringIO()
    writer = csv.writer(line, lineterminator="\n")
    for number in [-1, *features.is_pressed.nonzero()[0].tolist()]:
        cells: list[object] = [*heads]
        if number >= 0:
            cells = [*features.values[:, number].tolist()]
            if len(presses.label):
                cells.append(presses.label_names[int(presses.label[number])])
            if len(presses.subject):
                cells.append(int(presses.subject[number]))
        writer.writerow(cells)
        yield line.getvalue()
        line.seek(0)
        line.truncate()
