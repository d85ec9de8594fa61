"""`fuzzytree tactile simulate`: a board of our own behind a port, to try hosts with."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import cycle, islice
from typing import TYPE_CHECKING

import click

from fuzzytree.cli import (
    ResultOptions,
    answer,
    answer_json,
    argument,
    flag,
    option,
    say_rows,
    several,
    takes,
    wrong_options,
)
from fuzzytree.tactile.cli.signals import stop_signal

if TYPE_CHECKING:
    from fuzzytree.tactile.boards import Board
    from fuzzytree.tactile.sensor import Cells

ALL = "all"
_LOOK_S = 0.05


class TactileSimulateOptions(ResultOptions):
    """The arguments and options of the verb."""

    board: str = argument("BOARD.yaml")
    name: str | None = option(
        "--object NAME", "Object of the paper to show, or `all` in turn."
    )
    recording: str | None = option(
        "--recording FILE", "Recording whose frames are repeated."
    )
    faults: Sequence[str] = several(
        "--fault NAME=VALUE",
        "Fault to simulate, `stall=SECONDS` or `unplug=SECONDS` (repeat).",
    )
    link: str | None = option(
        "--link PATH", "Path of the port; a new one in a folder of its own if none."
    )
    seed: int = option(
        "--seed",
        "Random seed of the simulated object.",
        type=click.IntRange(0),
        default=0,
    )
    fast: bool = flag("--fast", "Send as fast as the host reads.")
    frames: int | None = option(
        "--frames N", "Number of frames to send.", type=click.IntRange(1)
    )


@click.command("simulate", short_help="Simulate a board on a new port.")
@takes(TactileSimulateOptions)
def command(options: TactileSimulateOptions) -> None:
    """Simulate the board of BOARD.yaml on a new port, until Ctrl-C.

    A disc wanders over the sensor, unless an object or a recording is named. After a
    host has opened the port, the first frames are empty, as many as the baseline of
    the board needs; --frames does not count them.
    """
    if options.name is not None and options.recording is not None:
        raise click.UsageError("--object and --recording exclude each other")
    from fuzzytree.tactile.board_file import load_board
    from fuzzytree.tactile.recognition.frame_sources import FRAMES_A_SECOND
    from fuzzytree.tactile.simulation.device import Device, faults_of

    known = load_board(options.board)
    rest, coming = _frames(known, options)
    with stop_signal() as stop:
        with wrong_options():
            device = Device(
                known,
                coming if options.frames is None else islice(coming, options.frames),
                faults_of(options.faults),
                None if options.fast else 1.0,
                link=options.link,
                first=[rest] * known.start.frames,
                frames_a_second=0.0 if options.fast else FRAMES_A_SECOND,
            )
        with device:
            if not options.as_json:
                answer(device.port)
            speed = f"{known.port.baud} baud, {FRAMES_A_SECOND} frames a second at most"
            speed = "as fast as it is read" if options.fast else speed
            say_rows(
                ("opened", device.port, f"{known.name}, {speed}"), quiet=options.quiet
            )
            while not stop.wait(_LOOK_S):
                if device.over.is_set() and not device.is_open:
                    break
    facts = asdict(device.counts)
    counts = ", ".join(f"{what} {count}" for what, count in facts.items() if count)
    say_rows(("counted", counts or "nothing", ""), quiet=options.quiet)
    if options.as_json:
        answer_json({"port": device.port, "board": known.name, "truth": facts})


def _frames(
    board: Board, options: TactileSimulateOptions
) -> tuple[Cells, Iterator[Cells]]:
    """Return a frame without pressure and those to send, fitted to the board."""
    from fuzzytree.tactile.simulation.device import blob, empty, fitted
    from fuzzytree.tactile.simulation.physics import FULL, SIDE

    name, recording, quiet = options.name, options.recording, options.quiet
    if recording is not None:
        import numpy as np

        from fuzzytree.tactile.link.recording import read_recording

        found = read_recording(recording)
        if not len(found.frames):
            raise click.UsageError(f"{recording}: holds no frames")
        sensor = found.board.sensor
        _say_fit(board, (sensor.rows, sensor.columns), sensor.full, quiet=quiet)
        rest = empty(board)
        if sensor.baseline:
            cells = np.array(sensor.baseline).reshape(sensor.rows, sensor.columns)
            rest = fitted(board, cells, sensor.full)
        frames = cycle(list(found.frames))
        return rest, (fitted(board, one, sensor.full) for one in frames)
    if name is None:
        return empty(board), blob(board, options.seed)
    from fuzzytree.tactile.recognition.frame_sources import simulated
    from fuzzytree.tactile.simulation.objects import OBJECTS

    if name not in (*OBJECTS, ALL):
        known = ", ".join(OBJECTS)
        raise click.UsageError(f"no object {name!r}; there is {known}, or {ALL}")
    names = tuple(OBJECTS) if name == ALL else (name,)
    _say_fit(board, (SIDE, SIDE), FULL, quiet=quiet)
    records = simulated(options.seed, names=names)
    return empty(board), (fitted(board, one.frame.cells, FULL) for one in records)


def _say_fit(board: Board, sides: tuple[int, int], full: int, *, quiet: bool) -> None:
    """Say how frames are changed, so that the board can send them."""
    from fuzzytree.tactile.simulation.device import bounds

    wanted, (low, high) = (board.sensor.rows, board.sensor.columns), bounds(board)
    if wanted != sides:
        was, now = (" x ".join(map(str, pair)) for pair in (sides, wanted))
        say_rows(("fitted", f"{was} cells to {now}", ""), quiet=quiet)
    if (low, high) != (0, full):
        say_rows(("fitted", f"0 to {full} to {low} to {high}", ""), quiet=quiet)
