"""`fuzzytree tactile record`: the frames of a board, kept in a file."""

from __future__ import annotations

import contextlib
import shlex
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from fuzzytree.cli import (
    ResultOptions,
    answer_json,
    argument,
    flag,
    option,
    say,
    say_rows,
    takes,
)
from fuzzytree.errors import PortError, WriteError
from fuzzytree.files import check_place
from fuzzytree.tactile.cli.signals import stop_signal

if TYPE_CHECKING:
    from fuzzytree.tactile.link import Connection, Started
    from fuzzytree.tactile.link.recording import Recorder
    from fuzzytree.tactile.sensor import Frame

End = Literal["frames", "seconds", "told", "port"]
"""Enough frames, or seconds; Ctrl-C and its like; or the port went away."""

_LOOK_S = 0.1


class TactileRecordOptions(ResultOptions):
    """The arguments and options of the verb."""

    board: str = argument("BOARD.yaml")
    port: str = argument("PORT")
    output: str = option("-o --output FILE", "Recording to write.", required=True)
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
    from fuzzytree.tactile.board_file import load_board
    from fuzzytree.tactile.link import open_connection, room, start
    from fuzzytree.tactile.link.recording import Recorder

    if options.output == "-":
        raise click.UsageError("a recording is a file, and not standard output")
    known = load_board(options.board)
    check_place(options.output)
    if Path(options.output).exists() and not options.force:
        raise WriteError(f"{options.output}: is there already; --force replaces it")
    with (
        stop_signal() as stop,
        open_connection(
            known, options.port, wait=not options.no_wait, most_waiting=room(known)
        ) as line,
    ):
        coming = _Coming(line, stop, options)
        say_rows(
            ("opened", options.port, f"{known.name}, {known.port.baud} baud"),
            quiet=options.quiet,
        )
        try:
            started = start(known, coming.frames())
        except PortError:
            if not stop.is_set():
                raise
            say("ended before the baseline was measured; nothing was written")
            return 0
        _tell_start(started, quiet=options.quiet)
        with Recorder(options.output, started.board, replace=options.force) as recorder:
            end = coming.record(recorder)
    _tell(options, line, recorder, coming)
    if options.as_json:
        facts: dict[str, object] = {
            "file": options.output,
            "board": started.board.name,
            "masked": started.board.sensor.masked,
            "remarks": started.remarks,
            "frames": coming.count,
            "seconds": coming.seconds,
            "end": end,
            "counters": asdict(line.counters),
            "most_at_risk": recorder.most_at_risk,
        }
        answer_json(facts)
    return 1 if end == "port" else 0


class _Coming:
    """The frames of a line, with a word on whatever happens to it.

    Attributes:
        count: How many were written.
        seconds: From the first to the last of these.
    """

    def __init__(
        self, line: Connection, stop: threading.Event, options: TactileRecordOptions
    ) -> None:
        self.count, self.seconds = 0, 0.0
        self._line, self._stop, self._options = line, stop, options
        self._trouble, self._reconnects = "", 0
        self._first_s = 0.0
        self._begun = self._said = time.monotonic()

    def record(self, recorder: Recorder) -> End:
        """Write frames until it is enough; return why it ended."""
        self._begun = self._said = time.monotonic()
        limit_s, most = self._options.seconds, self._options.frames
        for frame in self.frames():
            if self.count and limit_s and frame.time - self._first_s >= limit_s:
                return "seconds"
            if self._written(frame, recorder) == most:
                return "frames"
        if self._line.state == "ended":
            return "port"
        if not self._stop.is_set():
            return "seconds"
        self._line.close()  # what came before is kept
        with contextlib.suppress(PortError):  # whatever it is, it comes too late
            for frame in self._line:
                if self._written(frame, recorder) == most:
                    break
        return "told"

    def _written(self, frame: Frame, recorder: Recorder) -> int:
        """Write a frame; return how many there are."""
        recorder.write(frame, self._line.counters)
        if not self.count:
            self._first_s = frame.time
        self.seconds = frame.time - self._first_s
        self.count += 1
        return self.count

    def frames(self) -> Iterator[Frame]:
        """Yield frames until a signal, the time limit or the end of the connection.

        Raises:
            PortError: If bytes come that are no frames, before the first frame.
        """
        limit_s = self._options.seconds
        while not self._stop.is_set():
            frame = None
            try:
                frame = self._line.take(_LOOK_S)
            except PortError as error:
                if self._line.state != "ended" and not self._line.counters.frames:
                    raise
                say(str(error))
            self._tell()
            if frame is not None:
                yield frame
                continue
            is_late = limit_s and time.monotonic() - self._begun >= limit_s
            if is_late or self._line.state == "ended":
                return

    def _tell(self) -> None:
        """Say when the line changes, and each second, on a terminal, how far it is."""
        trouble, quiet = self._line.trouble, self._options.quiet
        counters, port = self._line.counters, self._line.port
        if counters.reconnects != self._reconnects:
            self._reconnects, self._trouble = counters.reconnects, trouble
            say(f"{port}: went away, and is back", quiet=quiet)
        elif trouble != self._trouble and self._line.state != "ended":
            self._trouble = trouble
            say(trouble or f"{port}: frames come again", quiet=quiet)
        now = time.monotonic()
        if now - self._said >= 1 and self.count:
            self._said = now
            if sys.stderr.isatty():
                text = f"{now - self._begun:.0f} s, {self.count} frames"
                wrong = f"{counters.damaged} damaged, {counters.dropped} dropped"
                say(f"{text}, {wrong}", quiet=quiet)


def _tell_start(started: Started, *, quiet: bool) -> None:
    from fuzzytree.report import counted

    board = started.board
    baseline = board.sensor.baseline
    text = f"{min(baseline)} to {max(baseline)}" if baseline else "none"
    frames = counted(board.start.frames, "frame")
    say_rows(("measured", f"baseline {text}", f"from {frames}"), quiet=quiet)
    for remark in started.remarks:
        say(f"remark   {remark}", quiet=quiet)


def _tell(
    options: TactileRecordOptions,
    line: Connection,
    recorder: Recorder,
    coming: _Coming,
) -> None:
    from fuzzytree.report import counted

    rate = ""
    if coming.seconds:
        rate = f", {(coming.count - 1) / coming.seconds:.1f} a second"
    frames = counted(coming.count, "frame")
    facts = asdict(line.counters).items()
    risk = counted(recorder.most_at_risk, "frame")
    after = shlex.join(["fuzzytree", "tactile", "replay", options.output])
    say_rows(
        ("wrote", options.output, f"{frames}, {coming.seconds:.1f} s{rate}"),
        ("counted", ", ".join(f"{name} {count}" for name, count in facts), ""),
        ("at risk", f"{risk} at most, if the power had failed", ""),
        ("next", after, ""),
        quiet=options.quiet,
    )
