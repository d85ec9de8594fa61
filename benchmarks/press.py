"""Presses of the paper's objects on a simulated sensor, as a file.

python benchmarks/press.py all --count 50 --seed 0 -o presses.npz
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import msgspec
import numpy as np

from fuzzytree.errors import FuzzyTreeError
from fuzzytree.files import write_atomically
from fuzzytree.tactile.presses import Presses, presses_content
from fuzzytree.tactile.simulation.objects import OBJECTS
from fuzzytree.tactile.simulation.physics import PAPER, PhysicsSettings, press


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
    add("-o", dest="output", metavar="FILE.npz", required=True)
    add("--count", type=int, default=50, help="presses of each object; default 50")
    add("--seed", type=int, default=0, help="of the presses; default 0")
    add("--set", dest="changes", metavar="NAME=VALUE", action="append", default=[])
    options = parser.parse_args(words)
    names = tuple(OBJECTS) if options.object == "all" else (options.object,)
    try:
        settings = physics_settings(options.changes)
        found = [press(name, options.count, options.seed, settings) for name in names]
        frames = np.concatenate([one.frames for one in found])
        label = np.repeat(np.arange(len(names)), options.count)
        presses = Presses(frames, found[0].sensor, label, names)
        write_atomically(options.output, presses_content(presses))
    except (FuzzyTreeError, ValueError) as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
