"""`fuzzytree tactile live`: recognise what lies on a sensor while frames come in."""

from __future__ import annotations

import contextlib
import sys
from collections import Counter
from collections.abc import Callable, Generator
from typing import TYPE_CHECKING

import click
import msgspec

from fuzzytree.cli import (
    argument,
    flag,
    option,
    output_option,
    quiet_option,
    say,
    say_rows,
    takes,
    wrong_options,
)
from fuzzytree.model import printable

if TYPE_CHECKING:
    from fuzzytree.tactile.recognition.live import Live, LiveResult

SWITCH_S = 2e-4
"""How soon a thread that reads or draws gives way to an answer."""


class TactileLiveOptions:
    """The arguments and options of the verb."""

    source: str = argument("SOURCE")
    model: str = option(
        "--model MODEL", "Model to run: a tree or a rule base.", required=True
    )
    board: str | None = option(
        "--board BOARD.yaml",
        "File of the board on the port, or of that which sent the frames of .npz or "
        ".csv.",
    )
    reject: float | None = option(
        "--reject SHARE",
        "Firing strength below which an object is unknown; "
        "default that of the model, else 0.001, or 0 for relative rules and few rows.",
        type=click.FloatRange(0.0, 1.0),
    )
    hold: int = option(
        "--hold N",
        "Frames that a result must last before its line is printed.",
        type=click.IntRange(1),
        default=3,
    )
    vote: float = option(
        "--vote SECONDS",
        "How long the answers to an object vote; 0 for each frame's own.",
        type=click.FloatRange(0.0, 60.0),
        default=0.0,
    )
    area: int = option(
        "--area CELLS",
        "Fewest cells of an object; smaller regions are counted and left out.",
        type=click.IntRange(1),
        default=2,
    )
    lines: bool = flag("--lines", "Print lines, also on a terminal.")
    as_json: bool = flag("--json", "Print each line as JSON.")
    page: int | None = option(
        "--serve [PORT]",
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
    record: str | None = output_option(
        "--record FILE", "Recording to write the frames to."
    )
    speed: float = option(
        "--speed X",
        "Speed of frames that are recorded; 0 for no pauses.",
        type=click.FloatRange(0.0),
        default=1.0,
    )
    frames: int | None = option(
        "--frames N", "Number of frames to recognise.", type=click.IntRange(1)
    )
    quiet: bool = quiet_option


@click.command("live", short_help="Recognise what lies on a sensor, on-line.")
@takes(TactileLiveOptions)
def command(options: TactileLiveOptions) -> int:
    """Recognise the objects on the sensor, frame by frame.

    SOURCE is a serial port, a recording, or frames in a numpy archive (.npz) or a table
    (.csv). A terminal shows a picture, the classes and the strengths, and takes the
    keys t (tare), s and i; elsewhere there is a line for each object that is newly
    recognised. Ctrl-C ends. Exit 1 if --record ended before.
    """
    from fuzzytree.tactile.recognition.sensing import open as opened
    from fuzzytree.tactile.report.page import LivePage

    def tell(word: str, text: str) -> None:
        say_rows((word, text, ""), quiet=options.quiet)

    labels: Counter[str] = Counter()
    frames = 0
    with contextlib.ExitStack() as stack:
        stack.callback(sys.setswitchinterval, sys.getswitchinterval())
        sys.setswitchinterval(SWITCH_S)
        with wrong_options():
            sensor = opened(
                options.source,
                model=options.model,
                board=options.board,
                reject=options.reject,
                vote_s=options.vote,
                least_area=options.area,
                record=options.record,
                speed=options.speed,
                say=tell,
            )
        stack.callback(sensor.close)
        for remark in sensor.remarks:
            tell("remark", remark)
        live = sensor.live
        if options.page is not None:
            page = LivePage(live, options.page, times=options.times)
            tell("serves", stack.enter_context(page).url)
        try:
            with _display(live, options) as write:
                for answer in live.answers(options.frames):
                    write(answer)
                    labels.update(_words(answer))
                    frames += 1
        except KeyboardInterrupt:
            pass
    _report(live, labels, frames, options)
    recorded = sensor.recorded
    if recorded is None:
        return 0
    tell("wrote", f"{options.record} {recorded.written} frames")
    if recorded.failure:
        say(recorded.failure)
    return 1 if recorded.failure else 0


@contextlib.contextmanager
def _display(
    live: Live, options: TactileLiveOptions
) -> Generator[Callable[[LiveResult], None]]:
    """Show a picture on a terminal; elsewhere yield what writes new, stable results."""
    from fuzzytree.tactile.cli.screen import Screen, ended_by_signals, look_of
    from fuzzytree.tactile.recognition.live import Hold
    from fuzzytree.tactile.report.live import line_facts, lines

    hold, said = Hold(options.hold), [""]

    def write(answer: LiveResult) -> None:
        trouble = live.source.trouble
        if trouble not in ("", said[-1]):
            said.append(trouble)
            say(trouble)
        for event in answer.events:
            say(event.text, quiet=options.quiet)
        shown = tuple(sorted((one.number, one.code) for one in answer.objects))
        if answer.state is None or not hold(shown):
            return
        text = lines(answer)
        if options.as_json:
            facts = map(msgspec.json.encode, line_facts(answer))
            text = "\n".join(one.decode() for one in facts)
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


def _words(answer: LiveResult) -> list[str]:
    """Return what is counted of a frame: each object, or that there is none."""
    from fuzzytree.tactile.recognition.live import STATES

    if answer.state is None:
        return ["refused"]
    found = [one.label or STATES[one.state] for one in answer.objects]
    return found or [STATES[answer.state]]


def _report(
    live: Live, labels: Counter[str], frames: int, options: TactileLiveOptions
) -> None:
    """Say what was answered, how fast, and what was out of the ordinary."""
    from fuzzytree.tactile.recognition.live import STATES
    from fuzzytree.tactile.recognition.recogniser import State
    from fuzzytree.tactile.report.live import counts, timing

    view, word = live.view(), STATES[State.UNKNOWN]
    found = [f"{printable(label)} {count}" for label, count in sorted(labels.items())]
    unknown = labels[word]
    reject = live.recogniser.reject
    floor = f"no rule, or one below {reject:g}, decides; --reject sets it"
    if options.vote:
        floor += "; or the vote was not over"
    small = f"regions below {options.area} cells, no objects; --area sets it"
    say_rows(
        ("answered", f"{frames} frames", ", ".join(found)),
        *([(word, f"{unknown} frames", floor)] if unknown else []),
        *([("left out", f"{live.left_out}", small)] if live.left_out else []),
        ("counted", counts(view), ""),
        *([("took", timing(view), "")] if view.latency else []),
        quiet=options.quiet,
    )
    if live.rest.is_taring:
        say(f"the tare did not end: {live.rest.tare_text}")
