"""`fuzzytree tactile interpolate`: frames of more points than the sensor has cells."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fuzzytree.cli import (
    answer_json,
    argument,
    flag,
    option,
    say_rows,
    takes,
    wrong_options,
)
from fuzzytree.files import check_place, write_atomically
from fuzzytree.tactile.cli.sensors import FramesOptions, frames_of_options

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from fuzzytree.tactile.plots import FrameAxis
    from fuzzytree.tactile.presses import Presses

    Pressed = npt.NDArray[np.int64]

ARCHIVE = ".npz"
MOST_BYTES = 2**30
"""The most bytes of the arrays of an archive."""


class TactileInterpolateOptions(FramesOptions):
    """The arguments and options of the verb."""

    frames: str = argument("FRAMES")
    text: str = option(
        "--times NUMBERS",
        "Points for a cell on each side, separated by commas.",
        default="3,5,7",
    )
    frame: int | None = option(
        "--frame NUMBER",
        "Number of the frame, from 0; a picture shows the first pressed one if none.",
        type=int,
    )
    is_marked: bool = flag(
        "--axis", "Mark the centre of pressure and the principal axis."
    )
    output: str = option(
        "-o --output FILE",
        "Picture of a frame (.svg, .png), or values of all frames (.npz).",
        required=True,
    )


@click.command("interpolate", short_help="Interpolate frames; a picture or numbers.")
@takes(TactileInterpolateOptions)
def command(options: TactileInterpolateOptions) -> int:
    """Interpolate FRAMES by fuzzy numbers: a recording, an archive (.npz) or a .csv.

    An archive gets an array `frames` of what presses on each cell, and an array
    `times_N` of each number of times. `docs/explanation/interpolation.md` has the
    mathematics.
    """
    from fuzzytree.report import SUFFIXES
    from fuzzytree.tactile.sensor import pressed

    suffix = Path(options.output).suffix.lower()
    if suffix not in (*SUFFIXES, ARCHIVE):
        names = ", ".join(SUFFIXES)
        raise click.UsageError(
            f"{options.output}: the name ends in {names} or {ARCHIVE}"
        )
    times = _times(options.text)
    check_place(options.output)
    given = frames_of_options(options.frames, options)
    values = pressed(given.sensor, given.frames)
    number = _chosen(options, values, is_picture=suffix != ARCHIVE)
    if number is not None:
        values = values[number : number + 1]
    with wrong_options():
        if number is None or suffix == ARCHIVE:
            content = _archive(values, times)
        else:
            content = _picture(options, given, number, values[0], times)
    write_atomically(options.output, content)
    facts = _facts(given, number, values, times)
    if not options.quiet:
        _tell(options, facts, full=given.sensor.full, size=len(content))
    if options.as_json:
        answer_json({"file": options.output, "bytes": len(content), **facts})
    return 0


def _facts(
    given: Presses, number: int | None, values: Pressed, times: Sequence[int]
) -> dict[str, Any]:
    from fuzzytree.tactile.sensor import saturated

    raw = given.frames
    taken = raw if number is None else raw[number : number + 1]
    rows, columns = values.shape[1:]
    return {
        "frame": number,
        "frames": len(values),
        "of": len(raw),
        "rows": rows,
        "columns": columns,
        "times": [*times],
        "nothing": int((values == 0).all(axis=(1, 2)).sum()),
        "saturated": int((saturated(given.sensor, taken) > 0).sum()),
    }


def _tell(
    options: TactileInterpolateOptions,
    facts: Mapping[str, Any],
    *,
    full: int,
    size: int,
) -> None:
    from fuzzytree.report import counted

    rows, columns = facts["rows"], facts["columns"]
    one = f"frame {facts['frame']} of {counted(facts['of'], 'frame')}"
    read = counted(facts["frames"], "frame") if facts["frame"] is None else one
    lines = [("read", options.frames, f"{read}, {rows} x {columns} cells")]
    if facts["nothing"]:
        lines.append(("empty", counted(facts["nothing"], "frame"), "nothing presses"))
    if facts["saturated"]:
        text = f"a cell reads {full} or more"
        lines.append(("full", counted(facts["saturated"], "frame"), text))
    sizes = ", ".join(f"{n * rows} x {n * columns}" for n in facts["times"])
    lines.append(("wrote", options.output, f"{sizes} points, {size} bytes"))
    say_rows(*lines)


def _times(text: str) -> list[int]:
    parts = [part.strip() for part in text.split(",")]
    if not all(re.fullmatch("0*[1-9][0-9]{0,3}", part) for part in parts):
        raise click.UsageError(
            f"--times {text}: must be whole numbers from 1 to 9999, such as 3,5,7"
        )
    times = [int(part) for part in parts]
    if len({*times}) < len(times):
        raise click.UsageError(f"--times {text}: names a number twice")
    return times


def _chosen(
    options: TactileInterpolateOptions, values: Pressed, *, is_picture: bool
) -> int | None:
    """Return the frame to take; None for all."""
    frame = options.frame
    if frame is None:
        return int(values.any(axis=(1, 2)).argmax()) if is_picture else None
    if not 0 <= frame < len(values):
        known = f"{options.frames} has frames 0 to {len(values) - 1}"
        raise click.UsageError(f"--frame {frame}: {known}")
    return frame


def _archive(values: Pressed, times: Sequence[int]) -> bytes:
    from fuzzytree.tactile.interpolation import interpolated
    from fuzzytree.tactile.presses import packed_arrays

    size = 8 * values.size * sum(number**2 for number in times)
    if size > MOST_BYTES:
        raise click.UsageError(
            f"{len(values)} interpolated frames are {size} bytes, more than "
            f"{MOST_BYTES}; name one --frame, or fewer --times"
        )
    arrays = {f"times_{number}": interpolated(values, number) for number in times}
    return packed_arrays({"frames": values, **arrays})


def _picture(
    options: TactileInterpolateOptions,
    given: Presses,
    number: int,
    cells: Pressed,
    times: Sequence[int],
) -> bytes:
    from fuzzytree.tactile.interpolation import interpolated
    from fuzzytree.tactile.plots import draw_frames

    sensor = given.sensor
    images = [cells, *(interpolated(cells, n) for n in times)]
    title = f"{Path(options.frames).name}, frame {number}"
    if len(given.label):
        title = f"{title}, {given.label_names[given.label[number]]}"
    axis = _axis(given, number) if options.is_marked else None
    names = [f"{n} times" if n > 1 else "once" for n in times]
    picture = draw_frames(
        images,
        titles=[f"{sensor.rows} x {sensor.columns} cells", *names],
        title=title,
        axes=[axis] * len(images),
        cells=[(sensor.rows, sensor.columns)] * len(images),
        unit="reading",
    )
    return picture.content(Path(options.output).suffix.lower())


def _axis(given: Presses, number: int) -> FrameAxis | None:
    """Return the centre and axis of a frame; None where nothing presses."""
    from fuzzytree.tactile.plots import FrameAxis
    from fuzzytree.tactile.runtimes.frames import frame_features

    frame = given.frames[number]
    found = frame_features(given.sensor, frame, ["x", "y", "angle"])
    if not found.is_pressed[0]:
        return None
    x, y, angle_deg = found.values[:, 0].tolist()
    return FrameAxis(
        x, y, angle_deg, length=min(given.sensor.rows, given.sensor.columns) / 5
    )
