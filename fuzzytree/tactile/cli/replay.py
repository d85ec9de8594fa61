"""`fuzzytree tactile replay`: what is in a recording, and its frames in other files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fuzzytree.cli import (
    ResultOptions,
    answer,
    answer_json,
    argument,
    option,
    output_option,
    say_rows,
    takes,
)
from fuzzytree.model import printable

if TYPE_CHECKING:
    from fuzzytree.tactile.link.recording import FrameFile, Review


class TactileReplayOptions(ResultOptions):
    """The arguments and options of the verb."""

    frames: str = argument("FRAMES")
    output: str | None = output_option(
        "-o --output FILE",
        "File for the frames (.ftr, .csv, .npz, .h5), for pictures of them (.gif, "
        ".mp4), for one of a frame (.svg, .png) or for the board (.yaml).",
    )
    frame: int | None = option(
        "--frame N",
        "Frame of the picture, from 0; the first in which something presses if none.",
        type=click.IntRange(0),
    )
    board: str | None = option(
        "--board BOARD.yaml", "File of the board that sent the frames of .npz or .csv."
    )


@click.command("replay", short_help="Summarise or convert a recording.")
@takes(TactileReplayOptions)
def command(options: TactileReplayOptions) -> None:
    """Summarise a recording: board, frames, seconds, counters, gaps, damage.

    FRAMES is a recording, a numpy archive (.npz) or a table (.csv); -o x.ftr makes a
    recording of these. Without times there are 44 frames a second, and without --board
    a plain board.
    """
    from fuzzytree.report import SUFFIXES, counted
    from fuzzytree.tactile.board_file import load_board
    from fuzzytree.tactile.link.recording import review
    from fuzzytree.tactile.presses import open_frames
    from fuzzytree.tactile.writers import WRITERS

    suffix = Path(options.output or "").suffix.lower()
    if options.output is not None and suffix not in WRITERS:
        known = ", ".join(WRITERS)
        raise click.UsageError(f"-o writes {known}, not {options.output}")
    chosen = () if options.frame is None else (options.frame,)
    if chosen and suffix not in SUFFIXES:
        known = " or ".join(SUFFIXES)
        raise click.UsageError(f"--frame needs a picture of one frame: -o with {known}")
    board = None if options.board is None else load_board(options.board)
    with open_frames(options.frames, board) as file:
        found = review(file)
        if chosen and found.frames <= chosen[0]:
            known = f"{options.frames} has {counted(found.frames, 'frame')}"
            raise click.UsageError(f"--frame {chosen[0]}: {known}, numbered from 0")
        if options.output is not None:
            WRITERS[suffix](options.output, file, *chosen)
        if options.as_json:
            facts = {"board": file.board, "started": _started(file)}
            answer_json({**facts, **asdict(found)})
        else:
            answer("\n".join(_lines(options.frames, file, found)))
        if options.output is not None:
            sensor = file.board.sensor
            rests = any(sensor.baseline) or bool(sensor.masked)
            is_bare = suffix in (".csv", ".npz") and rests
            hint = "without baseline and mask: give its board with --board"
            say_rows(
                ("wrote", options.output, hint if is_bare else ""), quiet=options.quiet
            )


def _lines(name: str, file: FrameFile, found: Review) -> Iterator[str]:
    """Yield what is in a recording, in words."""
    from fuzzytree.report import counted
    from fuzzytree.tactile.link.starting import named

    board, sensor = file.board, file.board.sensor
    family = type(board.protocol).__name__.lower()
    size = f"{sensor.rows} x {sensor.columns} cells, full {sensor.full}"
    yield f"{name}: {printable(board.name)}, {size}, {family}, {board.port.baud} baud"
    seconds = found.seconds
    rate = f", {(found.frames - 1) / seconds:.1f} a second" if seconds > 0 else ""
    frames = counted(found.frames, "frame")
    begun = f"; begun {_started(file)}" if file.started_ns else ""
    yield f"frames    {frames} in {seconds:.1f} s{rate}{begun}"
    if sensor.baseline:
        yield f"baseline  {min(sensor.baseline)} to {max(sensor.baseline)}"
    if sensor.masked:
        yield f"masked    {named(sensor.masked)}"
    if found.still:
        cells = named(found.still)
        yield f"still     {cells}: never moved though both neighbours did"
    missing = counted(found.missing, "frame")
    yield f"missing   {missing} in {counted(found.gaps, 'gap')}"
    yield f"pause     {found.longest_s:.3f} s at most between two frames"
    damaged = counted(found.damaged, "record")
    cut = counted(found.cut_bytes, "byte")
    yield f"damaged   {damaged}, and {cut} of one that is cut off at the end"
    counters = asdict(found.counters).items()
    yield f"counted   {', '.join(f'{name} {count}' for name, count in counters)}"


def _started(file: FrameFile) -> str | None:
    """Return when a recording began; None if that is not known."""
    if not file.started_ns:
        return None
    past = timedelta(microseconds=file.started_ns // 1000)
    return (datetime(1970, 1, 1, tzinfo=UTC) + past).isoformat(timespec="milliseconds")
