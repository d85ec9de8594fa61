"""`fuzzytree tactile live`: recognise what lies on a sensor while frames come in."""

from __future__ import annotations

import contextlib
import sys
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click
import msgspec

from fuzzytree.cli import argument, option, quiet_option, say_rows, takes, wrong_options
from fuzzytree.tactile.cli.sensors import frames_model

if TYPE_CHECKING:
    from fuzzytree.tactile.boards import Board
    from fuzzytree.tactile.link import Connection
    from fuzzytree.tactile.link.recording import Recorder
    from fuzzytree.tactile.recognition.live import FrameSource, Hold, Live, LiveResult
    from fuzzytree.tactile.sensor import Frame

SIMULATOR = "simulator"
MOST_WAITING = 4
"""Frames that wait for an answer before older ones are dropped: the newest count."""
_PATIENCE_S = 2.0  # for a first frame
SWITCH_S = 2e-4
"""How soon a thread that reads or draws gives way to an answer."""


class TactileLiveOptions:
    """The arguments and options of the verb."""

    source: str = argument(metavar="SOURCE")
    model: str = option(
        "--model",
        required=True,
        metavar="MODEL",
        help="Model to run: a tree or a rule base.",
    )
    board: str | None = option(
        "--board", metavar="BOARD.yaml", help="File of the board on the port."
    )
    reject: float | None = option(
        "--reject",
        type=click.FloatRange(0.0, 1.0),
        metavar="SHARE",
        help="Firing strength below which an object is unknown; "
        "default 0.001, or 0 for relative rules.",
    )
    hold: int = option(
        "--hold",
        type=click.IntRange(1),
        default=3,
        show_default=True,
        metavar="N",
        help="Frames that a result must last before its line is printed.",
    )
    lines: bool = option(
        "--lines", is_flag=True, help="Print lines, also on a terminal."
    )
    as_json: bool = option("--json", is_flag=True, help="Print each line as JSON.")
    page: int | None = option(
        "--page",
        is_flag=False,
        flag_value=0,
        type=click.IntRange(0, 65535),
        metavar="[PORT]",
        help="Serve a page on this computer; a free port if none is named.",
    )
    times: int = option(
        "--times",
        type=click.IntRange(1, 9),
        default=3,
        show_default=True,
        metavar="N",
        help="Largest number of picture points for a cell, on each side.",
    )
    record: str | None = option(
        "--record", metavar="FILE", help="Recording to write the frames to."
    )
    speed: float = option(
        "--speed",
        type=click.FloatRange(0.0),
        default=1.0,
        show_default=True,
        metavar="X",
        help="Speed of a recording or the simulator; 0 for no pauses.",
    )
    seed: int = option(
        "--seed",
        type=click.IntRange(0),
        default=0,
        help="Random seed of the simulator; default 0.",
    )
    frames: int | None = option(
        "--frames",
        type=click.IntRange(1),
        metavar="N",
        help="Number of frames to recognise.",
    )
    quiet: bool = quiet_option


@click.command("live", short_help="Recognise what lies on a sensor, on-line.")
@takes(TactileLiveOptions)
def command(options: TactileLiveOptions) -> None:
    """Recognise the object on the sensor, frame by frame.

    SOURCE is a serial port, a recording, or `simulator`: the paper's objects one after
    another. A terminal shows a picture, the class and the strengths; elsewhere there
    is a line for each object that is newly recognised. Ctrl-C ends.
    """
    from fuzzytree.tactile.recognition.live import Hold, Live
    from fuzzytree.tactile.recognition.recogniser import Recogniser, usual_floor

    known = frames_model(options.model)
    floor = usual_floor(known) if options.reject is None else options.reject
    with contextlib.ExitStack() as stack:
        stack.callback(_switched(SWITCH_S))
        with wrong_options():
            found, used = _opened(options)
            stack.callback(found.close)
            recogniser = Recogniser(known, used.sensor, floor)
        live = Live(recogniser, found, options.source)
        recorder = _recorder(options.record, used)
        if recorder is not None:
            stack.callback(recorder.close)
        if options.page is not None:
            url = _served(live, options.page, options.times, stack)
            say_rows(("serves", url, ""), quiet=options.quiet)
        tally = _Tally()
        try:
            with _display(
                live, options.times, is_wanted=not (options.lines or options.as_json)
            ) as shows:
                write = (
                    None
                    if shows
                    else _writer(Hold(options.hold), as_json=options.as_json)
                )
                for answer in live.answers(options.frames):
                    if write is not None:
                        write(answer)
                    tally.add(answer)
                    if recorder is not None:
                        recorder.write(answer.frame, found.counters)
        except KeyboardInterrupt:
            pass
    tally.report(live, floor, options.record, quiet=options.quiet)


def _switched(seconds: float) -> Callable[[], None]:
    """Let threads give way sooner; return what makes it as it was."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(seconds)
    return lambda: sys.setswitchinterval(before)


def _opened(options: TactileLiveOptions) -> tuple[FrameSource, Board]:
    """Return where frames come from, and the board that they fit."""
    from fuzzytree.tactile.recognition import frame_sources as sources

    source, board, speed = options.source, options.board, options.speed
    is_file = Path(source).is_file()
    if board is None and source != SIMULATOR and not is_file:
        raise click.UsageError(
            f"{source} is no recording; for a port, name its board with --board"
        )
    if board is not None and (source == SIMULATOR or is_file):
        raise click.UsageError(f"--board is for a port; {source} has its own")
    if source == SIMULATOR:
        return sources.Paced(
            sources.simulated(options.seed), speed
        ), sources.PAPER_BOARD
    if is_file:
        replayed = sources.Replayed(source, speed)
        return replayed, replayed.board
    assert board is not None  # refused above
    is_kept = options.record is not None
    return _line(source, board, is_kept=is_kept, quiet=options.quiet)


def _line(
    port: str, board: str, *, is_kept: bool, quiet: bool
) -> tuple[FrameSource, Board]:
    """Open a port, and measure what its board reads when nothing presses."""
    from fuzzytree.tactile import link as lines
    from fuzzytree.tactile.board_file import load_board
    from fuzzytree.tactile.recognition.frame_sources import FromPort

    known = load_board(board)
    most = lines.MOST_WAITING if is_kept else MOST_WAITING
    line = lines.open_connection(known, port, most_waiting=most)
    try:
        return FromPort(line), _rested(known, line, quiet=quiet)
    except BaseException:
        line.close()
        raise


def _rested(board: Board, line: Connection, *, quiet: bool) -> Board:
    """Return a board with the baseline that its first frames show."""
    from fuzzytree.tactile.link import start

    count = board.start.frames
    if count:
        what = f"the baseline in {count} frames: nothing may lie on the sensor"
        say_rows(("measures", what, ""), quiet=quiet)
    found = start(board, _coming(line, quiet=quiet))
    for remark in found.remarks:
        say_rows(("remark", remark, ""), quiet=quiet)
    return found.board


def _coming(line: Connection, *, quiet: bool) -> Iterator[Frame]:
    """Give the frames of a line; say once that none comes."""
    is_told = False
    while line.state != "ended":
        frame = line.take(_PATIENCE_S)
        if frame is not None:
            yield frame
        elif not is_told:
            is_told = True
            say_rows(("waits", "no frame comes", "Ctrl-C ends"), quiet=quiet)


def _served(live: Live, port: int, times: int, stack: contextlib.ExitStack) -> str:
    from fuzzytree.tactile.report.page import LivePage

    return stack.enter_context(LivePage(live, port, times=times)).url


def _recorder(path: str | None, board: Board) -> Recorder | None:
    from fuzzytree.tactile.link.recording import Recorder

    return None if path is None else Recorder(path, board)


@contextlib.contextmanager
def _display(live: Live, times: int, *, is_wanted: bool) -> Generator[bool]:
    """Show a picture on a terminal; yield whether there is one."""
    from fuzzytree.tactile.cli.screen import Screen, ended_by_signals, look_of

    look = look_of(sys.stdout) if is_wanted else None
    if look is None:
        with ended_by_signals(None):
            yield False
        return
    shown = Screen(live, sys.stdout, look, times)
    with ended_by_signals(shown), shown:
        yield True


def _writer(hold: Hold, *, as_json: bool) -> Callable[[LiveResult], None]:
    """Return a function that writes a line for each new, stable result."""
    from fuzzytree.tactile.report.live import line, line_facts

    def write(answer: LiveResult) -> None:
        if answer.state is None or not hold((answer.state, answer.code)):
            return
        text = msgspec.json.encode(line_facts(answer)).decode() if as_json else ""
        sys.stdout.write(f"{text or line(answer)}\n")
        sys.stdout.flush()

    return write


class _Tally:
    """Counts the answers."""

    def __init__(self) -> None:
        self._labels: Counter[str] = Counter()

    def add(self, answer: LiveResult) -> None:
        """Take an answer."""
        from fuzzytree.tactile.recognition.live import STATES

        word = "refused" if answer.state is None else STATES[answer.state]
        self._labels[answer.label or word] += 1

    def report(
        self, live: Live, reject: float, record: str | None, *, quiet: bool
    ) -> None:
        """Say what was answered, how fast, and what was out of the ordinary."""
        from fuzzytree.tactile.recognition.live import STATES
        from fuzzytree.tactile.recognition.recogniser import State
        from fuzzytree.tactile.report.live import counts, timing, visible

        view = live.view()
        found = [f"{visible(label)} {n}" for label, n in sorted(self._labels.items())]
        total = sum(self._labels.values())
        word = STATES[State.UNKNOWN]
        unknown = self._labels[word]
        floor = f"no rule, or one below {reject:g}, decides; --reject sets it"
        say_rows(
            ("answered", f"{total} frames", ", ".join(found)),
            *([(word, f"{unknown} frames", floor)] if unknown else []),
            ("counted", counts(view), ""),
            *([("took", timing(view), "")] if view.latency else []),
            *([("wrote", record, "")] if record else []),
            quiet=quiet,
        )
