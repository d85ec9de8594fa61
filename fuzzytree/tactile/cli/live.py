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

from fuzzytree.cli import (
    argument,
    flag,
    option,
    quiet_option,
    say,
    say_rows,
    takes,
    wrong_options,
)
from fuzzytree.tactile.cli.sensors import frames_model

if TYPE_CHECKING:
    from fuzzytree.tactile.boards import Board
    from fuzzytree.tactile.link import Connection
    from fuzzytree.tactile.recognition.live import FrameSource, Live, LiveResult
    from fuzzytree.tactile.sensor import Frame

SIMULATOR = "simulator"
MOST_WAITING = 4
"""Frames that wait for an answer before older ones are dropped: the newest count."""
_PATIENCE_S = 2.0  # for a first frame
SWITCH_S = 2e-4
"""How soon a thread that reads or draws gives way to an answer."""


class TactileLiveOptions:
    """The arguments and options of the verb."""

    source: str = argument("SOURCE")
    model: str = option(
        "--model MODEL", "Model to run: a tree or a rule base.", required=True
    )
    board: str | None = option("--board BOARD.yaml", "File of the board on the port.")
    reject: float | None = option(
        "--reject SHARE",
        "Firing strength below which an object is unknown; "
        "default 0.001, or 0 for relative rules.",
        type=click.FloatRange(0.0, 1.0),
    )
    hold: int = option(
        "--hold N",
        "Frames that a result must last before its line is printed.",
        type=click.IntRange(1),
        default=3,
    )
    lines: bool = flag("--lines", "Print lines, also on a terminal.")
    as_json: bool = flag("--json", "Print each line as JSON.")
    page: int | None = option(
        "--page [PORT]",
        "Serve a page on this computer; a free port if none is named.",
        is_flag=False,
        flag_value=0,
        type=click.IntRange(0, 65535),
    )
    times: int = option(
        "--times N",
        "Largest number of picture points for a cell, on each side.",
        type=click.IntRange(1, 9),
        default=3,
    )
    record: str | None = option("--record FILE", "Recording to write the frames to.")
    speed: float = option(
        "--speed X",
        "Speed of a recording or the simulator; 0 for no pauses.",
        type=click.FloatRange(0.0),
        default=1.0,
    )
    seed: int = option(
        "--seed",
        "Random seed of the simulator.",
        type=click.IntRange(0),
        default=0,
    )
    frames: int | None = option(
        "--frames N", "Number of frames to recognise.", type=click.IntRange(1)
    )
    quiet: bool = quiet_option


@click.command("live", short_help="Recognise what lies on a sensor, on-line.")
@takes(TactileLiveOptions)
def command(options: TactileLiveOptions) -> int:
    """Recognise the object on the sensor, frame by frame.

    SOURCE is a serial port, a recording, or `simulator`: the paper's objects one after
    another. A terminal shows a picture, the class and the strengths; elsewhere there
    is a line for each object that is newly recognised. Ctrl-C ends. Exit 1 if
    --record ended before.
    """
    from fuzzytree.tactile.link.recording import Recorder
    from fuzzytree.tactile.recognition.frame_sources import Newest, Recorded
    from fuzzytree.tactile.recognition.live import Live
    from fuzzytree.tactile.recognition.recogniser import Recogniser, usual_floor
    from fuzzytree.tactile.report.page import LivePage

    known = frames_model(options.model)
    floor = usual_floor(known) if options.reject is None else options.reject
    labels: Counter[str] = Counter()
    recorded: Recorded | None = None
    with contextlib.ExitStack() as stack:
        stack.callback(sys.setswitchinterval, sys.getswitchinterval())
        sys.setswitchinterval(SWITCH_S)
        with wrong_options():
            found, used = _opened(options)
            stack.callback(found.close)
            recogniser = Recogniser(known, used.sensor, floor)
        if options.record is not None:
            found = recorded = Recorded(found, Recorder(options.record, used))
            stack.callback(recorded.end)
            if options.board is not None:
                found = Newest(recorded, MOST_WAITING)
                stack.callback(found.close)
        live = Live(recogniser, found, options.source)
        if options.page is not None:
            page = LivePage(live, options.page, times=options.times)
            url = stack.enter_context(page).url
            say_rows(("serves", url, ""), quiet=options.quiet)
        try:
            with _display(live, options) as write:
                for answer in live.answers(options.frames):
                    write(answer)
                    labels[_word(answer)] += 1
        except KeyboardInterrupt:
            pass
    _report(live, labels, floor, options)
    if recorded is None or options.record is None:
        return 0
    kept = f"{recorded.written} frames"
    say_rows(("wrote", options.record, kept), quiet=options.quiet)
    if recorded.failure:
        say(recorded.failure)
    return 1 if recorded.failure else 0


def _opened(options: TactileLiveOptions) -> tuple[FrameSource, Board]:
    """Return where frames come from, and the board that they fit."""
    from fuzzytree.tactile.recognition import frame_sources as sources

    source, board, speed = options.source, options.board, options.speed
    is_file = Path(source).is_file()
    if board is not None and (source == SIMULATOR or is_file):
        raise click.UsageError(f"--board is for a port; {source} has its own")
    if source == SIMULATOR:
        frames = sources.simulated(options.seed)
        return sources.Paced(frames, speed), sources.PAPER_BOARD
    if is_file:
        replayed = sources.Replayed(source, speed)
        return replayed, replayed.board
    if board is None:
        raise click.UsageError(
            f"{source} is no recording; for a port, name its board with --board"
        )
    return _line(board, options)


def _line(board: str, options: TactileLiveOptions) -> tuple[FrameSource, Board]:
    """Open a port, and measure what its board reads when nothing presses."""
    from fuzzytree.tactile import link as lines
    from fuzzytree.tactile.board_file import load_board

    known, quiet = load_board(board), options.quiet
    most = MOST_WAITING if options.record is None else lines.room(known)
    line = lines.open_connection(known, options.source, most_waiting=most)
    try:
        count = known.start.frames
        if count:
            what = f"the baseline in {count} frames: nothing may lie on the sensor"
            say_rows(("measures", what, ""), quiet=quiet)
        found = lines.start(known, _coming(line, quiet=quiet))
        for remark in found.remarks:
            say_rows(("remark", remark, ""), quiet=quiet)
        return line, found.board
    except BaseException:
        line.close()
        raise


def _coming(line: Connection, *, quiet: bool) -> Iterator[Frame]:
    """Give the frames of a line; say once that none comes."""
    is_late = False
    while line.state != "ended":
        frame = line.take(_PATIENCE_S)
        if frame is not None:
            yield frame
        elif not is_late:
            is_late = True
            say_rows(("waits", "no frame comes", "Ctrl-C ends"), quiet=quiet)


@contextlib.contextmanager
def _display(
    live: Live, options: TactileLiveOptions
) -> Generator[Callable[[LiveResult], None]]:
    """Show a picture on a terminal; elsewhere yield what writes new, stable results."""
    from fuzzytree.tactile.cli.screen import Screen, ended_by_signals, look_of
    from fuzzytree.tactile.recognition.live import Hold
    from fuzzytree.tactile.report.live import line, line_facts, visible

    hold, said = Hold(options.hold), [""]

    def write(answer: LiveResult) -> None:
        trouble = live.source.trouble
        if trouble not in ("", said[-1]):
            said.append(trouble)
            say(visible(trouble))
        if answer.state is None or not hold((answer.state, answer.code)):
            return
        facts = line_facts(answer)
        text = msgspec.json.encode(facts).decode() if options.as_json else line(answer)
        sys.stdout.write(f"{text}\n")
        sys.stdout.flush()

    is_wanted = not (options.lines or options.as_json)
    look = look_of(sys.stdout) if is_wanted else None
    if look is None:
        with ended_by_signals(None):
            yield write
        return
    shown = Screen(live, sys.stdout, look, options.times)
    with ended_by_signals(shown), shown:
        yield lambda _answer: None


def _word(answer: LiveResult) -> str:
    from fuzzytree.tactile.recognition.live import STATES

    return answer.label or ("refused" if answer.state is None else STATES[answer.state])


def _report(
    live: Live, labels: Counter[str], reject: float, options: TactileLiveOptions
) -> None:
    """Say what was answered, how fast, and what was out of the ordinary."""
    from fuzzytree.tactile.recognition.live import STATES
    from fuzzytree.tactile.recognition.recogniser import State
    from fuzzytree.tactile.report.live import counts, timing, visible

    view, word = live.view(), STATES[State.UNKNOWN]
    found = [f"{visible(label)} {count}" for label, count in sorted(labels.items())]
    unknown = labels[word]
    floor = f"no rule, or one below {reject:g}, decides; --reject sets it"
    say_rows(
        ("answered", f"{labels.total()} frames", ", ".join(found)),
        *([(word, f"{unknown} frames", floor)] if unknown else []),
        ("counted", counts(view), ""),
        *([("took", timing(view), "")] if view.latency else []),
        quiet=options.quiet,
    )
