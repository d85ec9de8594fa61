"""`fuzzytree tactile replay`: what is in a recording, and its frames in other files."""

from __future__ import annotations

import contextlib
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
    say_rows,
    takes,
)
from fuzzytree.files import check_place, open_atomically, write_atomically

if TYPE_CHECKING:
    from fuzzytree.tactile.link.recording import RecordingFile, Review


class TactileReplayOptions(ResultOptions):
    """The arguments and options of the verb."""

    recording: str = argument("FILE")
    output: str | None = option(
        "-o --output FILE", "File for the frames (.csv, .npz) or for the board (.yaml)."
    )


@click.command("replay", short_help="Summarise or convert a recording.")
@takes(TactileReplayOptions)
def command(options: TactileReplayOptions) -> None:
    """Summarise a recording: board, frames, seconds, counters, gaps, damage."""
    from fuzzytree.tactile.link.recording import RecordingFile, review

    if options.output is not None:
        check_place(options.output)
        if Path(options.output).suffix not in _WRITERS:
            raise click.UsageError(
                f"-o writes .csv, .npz or .yaml, not {options.output}"
            )
    with RecordingFile(options.recording) as file:
        found = review(file)
        if options.as_json:
            facts = {"board": file.board, "started": _started(file)}
            answer_json({**facts, **asdict(found)})
        else:
            answer("\n".join(_lines(options.recording, file, found)))
        if options.output is not None:
            _WRITERS[Path(options.output).suffix](
                options.output, options.recording, file
            )
            sensor = file.board.sensor
            rests = any(sensor.baseline) or bool(sensor.masked)
            is_bare = Path(options.output).suffix == ".npz" and rests
            hint = "without baseline and mask: give its board with --board"
            say_rows(
                ("wrote", options.output, hint if is_bare else ""), quiet=options.quiet
            )


def _lines(name: str, file: RecordingFile, found: Review) -> Iterator[str]:
    """Yield what is in a recording, in words."""
    from fuzzytree.report import counted
    from fuzzytree.tactile.link.starting import named

    board, sensor = file.board, file.board.sensor
    family = type(board.protocol).__name__.lower()
    size = f"{sensor.rows} x {sensor.columns} cells, full {sensor.full}"
    # A recording may come from anywhere, and a name may hold commands for a terminal.
    shown = board.name if board.name.isprintable() else repr(board.name)
    yield f"{name}: {shown}, {size}, {family}, {board.port.baud} baud"
    seconds = found.seconds
    rate = f", {(found.frames - 1) / seconds:.1f} a second" if seconds > 0 else ""
    frames = counted(found.frames, "frame")
    yield f"frames    {frames} in {seconds:.1f} s{rate}; begun {_started(file)}"
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


def _started(file: RecordingFile) -> str:
    begin = datetime(1970, 1, 1, tzinfo=UTC)
    with contextlib.suppress(OverflowError):
        begin += timedelta(microseconds=file.started_ns // 1000)
    return begin.isoformat(timespec="milliseconds")


def _write_table(output: str, _: str, file: RecordingFile) -> None:
    """Write a line for each frame: its time, its number, and its cells."""
    sensor = file.board.sensor
    names = [f"r{r}c{c}" for r in range(sensor.rows) for c in range(sensor.columns)]
    with open_atomically(output) as table:
        table.write(",".join(["time", "number", *names]).encode() + b"\n")
        for frame, _counters in file:
            cells = ",".join(map(str, frame.cells.reshape(-1).tolist()))
            table.write(f"{frame.time!r},{frame.number},{cells}\n".encode())


def _write_arrays(output: str, name: str, _: RecordingFile) -> None:
    """Write a numpy archive that the other actions read."""
    import numpy as np

    from fuzzytree.tactile.link.recording import read_recording
    from fuzzytree.tactile.presses import packed_arrays

    found = read_recording(name)
    arrays = {
        "frames": found.frames,
        "full": np.array(found.board.sensor.full),
        "threshold": np.array(found.board.sensor.threshold),
        "times": found.times,
        "numbers": found.numbers,
    }
    write_atomically(output, packed_arrays(arrays))


def _write_board(output: str, _: str, file: RecordingFile) -> None:
    """Write the board, with what was measured, as its file."""
    from fuzzytree.tactile.board_file import board_text

    write_atomically(output, board_text(file.board).encode())


_WRITERS = {".csv": _write_table, ".npz": _write_arrays, ".yaml": _write_board}
