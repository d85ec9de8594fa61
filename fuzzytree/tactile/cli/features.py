"""`fuzzytree tactile features`: frames as a table that a tree can be learnt from."""

from __future__ import annotations

import csv
import io
import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fuzzytree.cli import (
    answer_bytes,
    answer_json,
    argument,
    option,
    say_rows,
    takes,
    wrong_options,
)
from fuzzytree.errors import ReadError
from fuzzytree.files import check_place, write_atomically
from fuzzytree.tactile.cli.sensors import FramesOptions, frames_of_options

if TYPE_CHECKING:
    from fuzzytree.tactile.presses import Presses
    from fuzzytree.tactile.runtimes.frames import Features

USUAL = "log orientation / force,log area"
"""Features that depend little on the force of a press and on the gain of the sensor."""

FEW_PLACEMENTS = 10
CLASS = "class"
"""The column of the classes."""

PLACEMENT = "placement"
"""The column of the placements, from 1, of frames that follow each other."""


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
    output: str | None = option("-o --output FILE", "CSV file to write; `-` is stdout.")


@click.command("features", short_help="Turn frames into a table of features.")
@takes(TactileFeaturesOptions)
def command(options: TactileFeaturesOptions) -> int:
    """Compute features of FRAMES: a recording, an archive (.npz) or a table (.csv).

    With -o they become a table for `fuzzytree learn`; without it, the cost of each
    feature in operations is listed. Empty frames are left out and counted. For files
    of one class each, write CLASS=FILE: cup=cup.ftr pen=pen.ftr. Of a recording each
    frame is seen as `live` sees it: the object of the largest force, without drift.
    """
    from fuzzytree.tactile.features import costs
    from fuzzytree.tactile.features.names import names_of

    if options.output and options.output != "-":
        check_place(options.output)
    with wrong_options():
        names = names_of(options.text)
    counts: Counter[str] = Counter()
    parts = [*_parts(options, counts)]
    _check_alike(options.frames, parts)
    found = costs(parts[0].sensor, names)
    if options.output is not None:
        return _table(options, options.output, parts, found, counts)
    if options.as_json:
        answer_json({"costs": found})
    else:
        for name in names:
            click.echo(f"{found[name]:8.0f}  {name}")
    return 0


def _parts(options: TactileFeaturesOptions, counts: Counter[str]) -> Iterator[Presses]:
    """Yield the frames of each file, of the class that stands before its name.

    Count frames with saturated cells, with several objects, and placements.
    """
    from fuzzytree.tactile.boards import Board, Marker
    from fuzzytree.tactile.presses import open_frames
    from fuzzytree.tactile.recognition.objects import followed
    from fuzzytree.tactile.sensor import saturated

    placed = 0
    for text in options.frames:
        word, sign, path = text.partition("=")
        if not sign or Path(text).exists():
            word, path = "", text
        if not word and len(options.frames) > 1:
            raise click.UsageError(
                f"of several files, each has a class: CLASS={path}, not {path}"
            )
        found = frames_of_options(path, options, label=options.label)
        if found.is_stream:
            plain = Board("frames", found.sensor, Marker("AA 55", found.sensor.bits))
            is_table = Path(path).suffix.lower() == ".csv"
            with open_frames(path, plain if is_table else None) as file:
                seen = followed(file, found.sensor)
            counts["saturated"] += seen.saturated
            counts["several"] += seen.several
            placements = seen.placements + placed
            placed = int(placements.max(initial=placed))
            found = replace(
                found, frames=seen.frames, sensor=seen.sensor, placement=placements
            )
        else:
            full = saturated(found.sensor, found.frames) > 0
            counts["saturated"] += int(full.sum())
        yield found.of_class(word) if word else found


def _check_alike(frames: Sequence[str], parts: Sequence[Presses]) -> None:
    """Refuse files that make no table together.

    Sensors may only differ in what rests on them, and all state subjects or none does.
    """

    def kind(part: Presses) -> str:
        found = part.sensor
        size = f"{found.rows} x {found.columns} cells"
        return f"{size}, full {found.full}, threshold {found.threshold}"

    for name, part in zip(frames, parts, strict=True):
        if kind(part) != kind(parts[0]):
            raise ReadError(
                f"{name}: is of another sensor ({kind(part)}) than {frames[0]} "
                f"({kind(parts[0])})"
            )
        if bool(len(part.subject)) != bool(len(parts[0].subject)):
            raise ReadError(f"of {name} and {frames[0]}, only one states subjects")
        if bool(len(part.placement)) != bool(len(parts[0].placement)):
            raise ReadError(f"of {name} and {frames[0]}, only one is a recording")


def _table(
    options: TactileFeaturesOptions,
    output: str,
    parts: Sequence[Presses],
    costs: Mapping[str, float],
    counted_frames: Counter[str],
) -> int:
    from fuzzytree.report import counted
    from fuzzytree.tactile.features.names import feature_of, has_unit
    from fuzzytree.tactile.runtimes.frames import frame_features

    names = [*costs]
    found = [frame_features(part.sensor, part.frames, names) for part in parts]
    content = _csv(parts, found).encode()
    if output == "-":
        answer_bytes(content)
        return 0
    write_atomically(output, content)
    presses, sensor = parts[0], parts[0].sensor
    counts = [len(part.frames) for part in parts]
    full, several = counted_frames["saturated"], counted_frames["several"]
    none = sum(int((~part.is_pressed).sum()) for part in found)
    size = f"{sensor.rows} x {sensor.columns} cells"
    rows = [
        ("read", source, f"{counted(count, 'frame')} of {size}")
        for source, count in zip(options.frames, counts, strict=True)
    ]
    if none:
        rows.append(("left out", counted(none, "frame"), "nothing presses"))
    if full:
        rows.append(("full", counted(full, "frame"), "a cell takes no more"))
    if several:
        text = "several objects: the one of the largest force counts"
        rows.append(("several", counted(several, "frame"), text))
    placed = _placed(parts, found)
    for name, count in placed.items():
        if count < FEW_PLACEMENTS:
            text = f"below {FEW_PLACEMENTS}, `live` finds more of its presses unknown"
            rows.append(("few", name, f"{counted(count, 'placement')}: {text}"))
    after = ["fuzzytree", "learn", output, "--target", CLASS, "-o", "tree.yaml"]
    if len(presses.subject):
        after += ["--groups", "subject"]
    elif len(presses.placement):
        after += ["--groups", PLACEMENT]
    if sensor.unit:
        for name in filter(lambda one: has_unit(feature_of(one)), names):
            after += ["--unit", f"{name}={sensor.unit}"]
    text = f"next: {shlex.join(after)}" if len(presses.label) else "without classes"
    rows.append(("wrote", output, f"{counted(len(names), 'feature')}; {text}"))
    say_rows(*rows, quiet=options.quiet)
    if options.as_json:
        answer_json(
            {
                "file": output,
                "frames": sum(counts),
                "nothing": none,
                "placements": placed,
                "saturated": full,
                "several": several,
                "features": names,
                "costs": costs,
            }
        )
    return 0


def _placed(parts: Sequence[Presses], found: Sequence[Features]) -> dict[str, int]:
    """Return how often something was put down, for each class that is known."""
    placed: Counter[str] = Counter()
    for part, features in zip(parts, found, strict=True):
        for code, name in enumerate(part.label_names if len(part.label) else ()):
            rows = (part.label == code) & features.is_pressed
            numbers = part.placement[rows] if len(part.placement) else []
            placed[name] += len({*numbers}) if len(part.placement) else int(rows.sum())
    return dict(placed)


def _csv(parts: Sequence[Presses], found: Sequence[Features]) -> str:
    """Return the table: features, and class and subject where known."""
    has_class = bool(len(parts[0].label))
    has_subject = bool(len(parts[0].subject))
    heads = [*found[0].names]
    heads += [CLASS] if has_class else []
    heads += ["subject"] if has_subject else []
    heads += [PLACEMENT] if len(parts[0].placement) else []
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(heads)
    for part, features in zip(parts, found, strict=True):
        rows = features.is_pressed.nonzero()[0]
        columns: list[list[object]] = features.values[:, rows].tolist()
        if has_class:
            columns.append([part.label_names[code] for code in part.label[rows]])
        if has_subject:
            columns.append(part.subject[rows].tolist())
        if len(part.placement):
            columns.append(part.placement[rows].tolist())
        table.writerows(zip(*columns, strict=True))
    return text.getvalue()
