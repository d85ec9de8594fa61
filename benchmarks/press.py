"""Presses of the paper's objects on a simulated sensor, as a file.

    python benchmarks/press.py all --count 50 --seed 0 -o presses.npz
    python benchmarks/press.py all --frames 300 -o objects.ftr

An archive (.npz) holds each object's presses with their labels, a recording (.ftr) what
a board sends while the objects are pressed one after another.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from itertools import islice

import msgspec
import numpy as np
from press_physics import PAPER, PhysicsSettings, press
from press_shapes import OBJECTS

from fuzzytree.errors import FuzzyTreeError
from fuzzytree.files import write_atomically
from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.link.recording import FrameRecord, Recorder
from fuzzytree.tactile.presses import labelled, presses_content
from fuzzytree.tactile.sensor import FRAMES_A_SECOND, Counters, Frame

_RISE, _STAY, _REST = 8, 64, 22  # frames of a press


def simulated(
    seed: int = 0,
    *,
    names: Sequence[str] = tuple(OBJECTS),
    settings: PhysicsSettings = PAPER,
) -> Iterator[FrameRecord]:
    """Give frames without end: the paper's objects, pressed one after another.

    Between two of them the sensor is empty for half a second.

    Raises:
        ValueError: If there is no object of a name.

    Example:
        >>> first = next(simulated())
        >>> first.frame.cells.shape, first.frame.time
        ((16, 16), 0.0)
    """
    random = np.random.default_rng(seed)
    shares = [*np.linspace(0.0, 1.0, _RISE), *[1.0] * _STAY]
    shares += [*np.linspace(1.0, 0.0, _RISE), *[0.0] * _REST]
    number = 0
    while True:
        for name in names:
            place = int(random.integers(2**31))
            cells = press(name, 1, place, settings).frames[0]
            for share in shares:
                noisy = share * cells + random.normal(0.0, 0.5, cells.shape)
                whole = np.rint(noisy).clip(0, 255).astype(np.uint8)
                frame = Frame(whole, number / FRAMES_A_SECOND, number)
                number += 1
                yield FrameRecord(frame, Counters(frames=number))


def physics_settings(changes: Sequence[str]) -> PhysicsSettings:
    """Return the simulator's settings, changed as `NAME=VALUE` says.

    Raises:
        ValueError: If there is no such setting, or its value is none.

    Example:
        >>> physics_settings(["tilt=0"]).tilt
        0.0
    """
    known = msgspec.structs.asdict(PAPER)
    given = dict(change.partition("=")[::2] for change in changes)
    for name in given:
        if name not in known:
            there = ", ".join(known)
            raise ValueError(f"the simulator has no setting {name!r}; it has {there}")
    values = {name: type(known[name])(text) for name, text in given.items()}
    return msgspec.structs.replace(PAPER, **values)


def main(words: Sequence[str] | None = None) -> None:
    """Write a file."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    add = parser.add_argument
    add("object", choices=[*OBJECTS, "all"])
    add("-o", dest="output", metavar="FILE", required=True, help=".npz or .ftr")
    add("--count", type=int, default=50, help="presses of each, in .npz; default 50")
    add("--frames", type=int, default=714, help="in .ftr; default 714: each once")
    add("--seed", type=int, default=0, help="of the presses; default 0")
    add("--set", dest="changes", metavar="NAME=VALUE", action="append", default=[])
    options = parser.parse_args(words)
    names = tuple(OBJECTS) if options.object == "all" else (options.object,)
    try:
        settings = physics_settings(options.changes)
        if options.output.endswith(".ftr"):
            records = simulated(options.seed, names=names, settings=settings)
            sensor = press(names[0], 1, settings=settings).sensor
            board = Board("simulator", sensor, Marker("AA 55"))
            with Recorder(options.output, board, started_ns=0, replace=True) as file:
                for record in islice(records, options.frames):
                    file.write(*record)
            return
        found = [press(name, options.count, options.seed, settings) for name in names]
        frames = np.concatenate([one.frames for one in found])
        label = np.repeat(np.arange(len(names)), options.count)
        presses = labelled(frames, found[0].sensor, label, names)
        write_atomically(options.output, presses_content(presses))
    except (FuzzyTreeError, ValueError) as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
