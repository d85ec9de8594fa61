"""`fuzzytree tactile record`: the frames of a board, kept in a file."""

from __future__ import annotations

import contextlib
import itertools
import shlex
import threading
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fuzzytree.cli import (
    ResultOptions,
    answer_json,
    argument,
    flag,
    option,
    output_option,
    progress_bar,
    say,
    say_rows,
    takes,
)
from fuzzytree.errors import PortError, WriteError
from fuzzytree.tactile.cli.signals import stop_signal

if TYPE_CHECKING:
    from fuzzytree.tactile.link import Connection
    from fuzzytree.tactile.sensor import Frame

_LOOK_S = 0.1  # how often a signal and the time are looked at while no frame comes


class TactileRecordOptions(ResultOptions):
    """The arguments and options of the verb."""

    board: str = argument("BOARD.yaml")
    port: str = argument("PORT")
    output: str = output_option(
        "-o --output FILE", "Recording to write.", required=True
    )
    frames: int | None = option(
        "--frames N", "Number of frames to record.", type=click.IntRange(1)
    )
    seconds: float | None = option(
        "--seconds S", "Seconds to record.", type=click.FloatRange(0.0, min_open=True)
    )
    force: bool = flag("--force", "Replace FILE if it exists.")
    no_wait: bool = flag("--no-wait", "End when the port goes away.")


@click.command("record", short_help="Record the frames of a board in a file.")
@takes(TactileRecordOptions)
def command(options: TactileRecordOptions) -> int:
    """Record the frames that BOARD.yaml sends through PORT in FILE, until Ctrl-C.

    The first frames measure the baseline: leave the sensor empty. The recording waits
    for a port that goes away. Exit 1 if the port does not come back.
    """
    from fuzzytree.report import counted
    from fuzzytree.tactile.board_file import load_board
    from fuzzytree.tactile.link import open_connection, room, start
    from fuzzytree.tactile.link.recording import Recorder

    if options.output == "-":
        raise click.UsageError("a recording is a file, and not standard output")
    known, quiet = load_board(options.board), options.quiet
    if Path(options.output).exists() and not options.force:
        raise WriteError(f"{options.output}: is there already; --force replaces it")
    count, first, last = 0, 0.0, 0.0
    with (
        stop_signal() as stop,
        open_connection(
            known, options.port, wait=not options.no_wait, most_waiting=room(known)
        ) as line,
        progress_bar(quiet=quiet) as show,
    ):
        opened = f"{known.name}, {known.port.baud} baud"
        say_rows(("opened", options.port, opened), quiet=quiet)
        try:
            board, remarks = start(known, _frames(line, stop, options))
        except PortError:
            if not stop.is_set():
                raise
            say("ended before the baseline was measured; nothing was written")
            return 0
        rest = board.sensor.baseline
        text = f"baseline {min(rest)} to {max(rest)}" if rest else "baseline none"
        measured = f"from {counted(board.start.frames, 'frame')}"
        say_rows(("measured", text, measured), quiet=quiet)
        for remark in remarks:
            say(f"remark   {remark}", quiet=quiet)
        with Recorder(options.output, board, replace=options.force) as recorder:
            frames = _frames(line, stop, options)
            for frame in itertools.islice(frames, options.frames):
                first = first if count else frame.time
                if options.seconds and frame.time - first >= options.seconds:
                    break
                counters = line.counters
                recorder.write(frame, counters)
                count, last = count + 1, frame.time
                wrong = f"{counters.damaged} damaged, {counters.dropped} dropped"
                show(f"{last - first:.0f} s, {count} frames, {wrong}", None)
        if count == options.frames:
            end = "frames"
        elif stop.is_set():
            end = "told"
        else:
            end = "port" if line.state == "ended" else "seconds"
    seconds, facts = last - first, asdict(line.counters)
    rate = f", {(count - 1) / seconds:.1f} a second" if seconds else ""
    risk = counted(recorder.most_at_risk, "frame")
    say_rows(
        ("wrote", options.output, f"{counted(count, 'frame')}, {seconds:.1f} s{rate}"),
        ("counted", ", ".join(f"{name} {n}" for name, n in facts.items()), ""),
        ("at risk", f"{risk} at most, if the power had failed", ""),
        ("next", shlex.join(["fuzzytree", "tactile", "replay", options.output]), ""),
        quiet=quiet,
    )
    if options.as_json:
        answer_json(
            {
                "file": options.output,
                "board": board.name,
                "masked": board.sensor.masked,
                "remarks": remarks,
                "frames": count,
                "seconds": seconds,
                "end": end,
                "counters": facts,
                "most_at_risk": recorder.most_at_risk,
            }
        )
    return 1 if end == "port" else 0


def _frames(
    line: Connection, stop: threading.Event, options: TactileRecordOptions
) -> Iterator[Frame]:
    """Give frames until the line ends, no frame comes in time, or a signal comes.

    Say what happens to the line. After a signal, what came before it is given.

    Raises:
        PortError: If bytes come that are no frames, before the first frame.
    """
    quiet, begun = options.quiet, line.now()
    trouble, reconnects = "", line.counters.reconnects
    while not stop.is_set():
        frame = None
        try:
            frame = line.take(_LOOK_S)
        except PortError as error:
            if not line.counters.frames:
                raise
            say(str(error))
        if line.counters.reconnects != reconnects:
            trouble, reconnects = line.trouble, line.counters.reconnects
            say(f"{line.port}: went away, and is back", quiet=quiet)
        elif line.trouble != trouble and line.state != "ended":
            trouble = line.trouble
            say(trouble or f"{line.port}: frames come again", quiet=quiet)
        is_late = options.seconds and line.now() - begun >= options.seconds
        if frame is not None:
            yield frame
        elif is_late or line.state == "ended":
            return
    line.close()
    with contextlib.suppress(PortError):  # it comes too late to matter
        yield from line
