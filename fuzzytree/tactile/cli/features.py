"""`fuzzytree tactile features`: frames as a table that a tree can be learnt from."""

from __future__ import annotations

import csv
import io
import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from fuzzytree.cli import (
    answer,
    answer_bytes,
    answer_json,
    argument,
    option,
    output_option,
    say_rows,
    takes,
    wrong_options,
)
from fuzzytree.errors import ReadError
from fuzzytree.files import write_atomically
from fuzzytree.tactile.cli.sensors import FramesOptions, board_of_options

if TYPE_CHECKING:
    from fuzzytree.tactile.runtimes.frames import Features
    from fuzzytree.tactile.sensor import Cells, Sensor

USUAL = "log orientation / force,log area"
"""Features that depend little on the force of a press and on the gain of the sensor."""

CLASS, SUBJECT = "class", "subject"

PLACEMENT = "placement"
"""The column of the placements, from 1, of frames that follow each other."""

_ALIKE = {SUBJECT: "states subjects", PLACEMENT: "is a recording"}
"""The columns that all files have or none, and what a file does that has them."""


class TactileFeaturesOptions(FramesOptions):
    """The arguments and options of the verb."""

    frames: tuple[str, ...] = argument("FRAMES...", nargs=-1, required=True)
    text: str = option(
        "--features NAMES",
        "Names and sets of features, separated by commas.",
        default=USUAL,
    )
    label: str = option(
        "--label ARRAY", "Array of FRAMES with the classes.", default="label"
    )
    output: str | None = output_option(
        "-o --output FILE", "CSV file to write; `-` is stdout."
    )


@click.command("features", short_help="Turn frames into a table of features.")
@takes(TactileFeaturesOptions)
def command(options: TactileFeaturesOptions) -> None:
    """Compute features of FRAMES: a recording, an archive (.npz) or a table (.csv).

    With -o they become a table for `fuzzytree learn`; without it, the cost of each
    feature in operations is listed. Empty frames are left out and counted. For files
    of one class each, write CLASS=FILE: cup=cup.ftr pen=pen.ftr. Of a recording each
    frame is seen as `live` sees it: the object of the largest force, without drift.
    """
    from fuzzytree.tactile.features import costs
    from fuzzytree.tactile.features.names import names_of

    with wrong_options():
        names = names_of(options.text)
    parts = [*_parts(options)]
    _check_alike(options.frames, parts)
    found = costs(parts[0].sensor, names)
    if options.output is not None:
        _table(options, options.output, parts, found)
    elif options.as_json:
        answer_json({"costs": found})
    else:
        for name in names:
            answer(f"{found[name]:8.0f}  {name}")


class _Part(NamedTuple):
    """The frames of a file, the sensor they fit, and the columns that are known.

    And how many frames have saturated cells, and several objects.
    """

    frames: Cells
    sensor: Sensor
    columns: dict[str, Sequence[Any]]
    saturated: int
    several: int


def _parts(options: TactileFeaturesOptions) -> Iterator[_Part]:
    """Yield the frames of each file, of the class that stands before its name."""
    import numpy as np

    from fuzzytree.tactile.link.recording import Recording
    from fuzzytree.tactile.presses import open_frames
    from fuzzytree.tactile.recognition.objects import followed
    from fuzzytree.tactile.rest import Rest
    from fuzzytree.tactile.sensor import saturated

    placed, board = 0, board_of_options(options)
    own = {"full": options.full, "threshold": options.threshold}
    for text in options.frames:
        word, sign, path = text.partition("=")
        if not sign or Path(text).exists():
            word, path = "", text
        if not word and len(options.frames) > 1:
            raise click.UsageError(
                f"of several files, each has a class: CLASS={path}, not {path}"
            )
        columns: dict[str, Sequence[Any]] = {CLASS: ()} if word else {}
        label = options.label
        with open_frames(path, board, **own, label=label, is_strict=False) as file:
            if isinstance(file, Recording):
                if len(file.label):
                    columns[CLASS] = [file.label_names[code] for code in file.label]
                if len(file.subject):
                    columns[SUBJECT] = file.subject.tolist()
            if isinstance(file, Recording) and not file.is_stream:
                frames, sensor = file.frames, file.sensor
                full, several = int((saturated(sensor, frames) > 0).sum()), 0
                if file.board.calibration is not None:
                    rest = Rest(sensor, 0.0, file.board.calibration)
                    frames = np.array([rest(frame, 0.0) for frame in frames])
                    sensor = rest.bare
            else:
                seen = followed(file)
                frames, sensor = seen.frames, seen.sensor
                full, several = seen.saturated, seen.several
                columns[PLACEMENT] = (seen.placements + placed).tolist()
                placed += int(seen.placements.max(initial=0))
        if not len(frames):
            raise ReadError(f"{path}: holds no frame")
        if word:
            columns[CLASS] = [word] * len(frames)
        yield _Part(frames, sensor, columns, full, several)


def _check_alike(frames: Sequence[str], parts: Sequence[_Part]) -> None:
    """Refuse files that make no table together.

    Sensors may only differ in what rests on them, and all state subjects or none does.
    """

    def kind(found: Sensor) -> str:
        size = f"{found.rows} x {found.columns} cells"
        return f"{size}, full {found.range_text}, threshold {found.threshold}"

    columns, own = parts[0].columns, kind(parts[0].sensor)
    for name, part in zip(frames, parts, strict=True):
        other = kind(part.sensor)
        if other != own:
            text = f"is of another sensor ({other}) than {frames[0]} ({own})"
            raise ReadError(f"{name}: {text}")
        for column, text in _ALIKE.items():
            if (column in part.columns) != (column in columns):
                raise ReadError(f"of {name} and {frames[0]}, only one {text}")


def _table(
    options: TactileFeaturesOptions,
    output: str,
    parts: Sequence[_Part],
    costs: Mapping[str, float],
) -> None:
    """Write the table, and say what is in it and how to learn from it."""
    from fuzzytree.report import counted
    from fuzzytree.tactile.features.names import feature_of, has_unit
    from fuzzytree.tactile.runtimes.frames import FramePlan

    names = [*costs]
    found = [FramePlan(part.sensor, names)(part.frames) for part in parts]
    content = _csv(parts, found).encode()
    if output == "-":
        answer_bytes(content)
        return
    write_atomically(output, content)
    known, sensor = parts[0].columns, parts[0].sensor
    counts = [len(part.frames) for part in parts]
    full = sum(part.saturated for part in parts)
    several = sum(part.several for part in parts)
    none = sum(int((~part.is_pressed).sum()) for part in found)
    size = f"{sensor.rows} x {sensor.columns} cells"
    rows = [
        ("read", source, f"{counted(count, 'frame')} of {size}")
        for source, count in zip(options.frames, counts, strict=True)
    ]
    noticed = (
        ("left out", none, "nothing presses"),
        ("full", full, "a cell takes no more"),
        ("several", several, "several objects: the one of the largest force counts"),
    )
    rows += [(word, counted(n, "frame"), text) for word, n, text in noticed if n]
    after = ["fuzzytree", "learn", output, "--target", CLASS, "-o", "tree.yaml"]
    groups = next((one for one in (SUBJECT, PLACEMENT) if one in known), "")
    after += ["--groups", groups] if groups else []
    if sensor.unit:
        for name in filter(lambda one: has_unit(feature_of(one)), names):
            after += ["--unit", f"{name}={sensor.unit}"]
    text = f"next: {shlex.join(after)}" if CLASS in known else "without classes"
    rows.append(("wrote", output, f"{counted(len(names), 'feature')}; {text}"))
    say_rows(*rows, quiet=options.quiet)
    if options.as_json:
        facts: dict[str, object] = {"file": output, "frames": sum(counts)}
        facts |= {"nothing": none, "placements": _placed(parts, found)}
        facts |= {"saturated": full, "several": several}
        answer_json({**facts, "features": names, "costs": costs})


def _placed(parts: Sequence[_Part], found: Sequence[Features]) -> Counter[str]:
    """Return how often something was put down, for each class that is known."""
    placed: Counter[str] = Counter()
    for part, features in zip(parts, found, strict=True):
        classes = part.columns.get(CLASS, ())
        numbers = part.columns.get(PLACEMENT, range(len(part.frames)))
        pairs = zip(classes, numbers, features.is_pressed, strict=False)
        placed.update(dict.fromkeys(classes, 0))
        placed.update(name for name, _ in {one[:2] for one in pairs if one[2]})
    return placed


def _csv(parts: Sequence[_Part], found: Sequence[Features]) -> str:
    """Return the table: features, and class, subject and placement where known."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([*found[0].names, *parts[0].columns])
    for part, features in zip(parts, found, strict=True):
        columns: list[list[object]] = features.values[:, features.is_pressed].tolist()
        columns += [[*compress(c, features.is_pressed)] for c in part.columns.values()]
        table.writerows(zip(*columns, strict=True))
    return text.getvalue()
