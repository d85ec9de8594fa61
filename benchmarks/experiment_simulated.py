"""The paper's experiment on the simulated sensor (section 4)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import msgspec
import numpy as np
from experiment_splits import Split
from experiment_tables import EFFECTS
from experiment_tasks import Task
from press_physics import PAPER, press
from press_physics import PhysicsSettings as Physics
from press_shapes import OBJECTS

from fuzzytree.learning import LearningSettings

PRESSES = 50
"""Presses of each object to learn from, and as many others to test on (4.1, 3)."""

IDEAL: Physics = msgspec.structs.replace(PAPER, **EFFECTS["even and linear"])
"""A sensor that measures how hard each cell is pressed and nothing else: but for its
few cells the moments of an object do not depend on its angle."""

TABLE_3: Mapping[str, int] = MappingProxyType(
    {
        "rectangle-0": 46,
        "rectangle-27": 48,
        "rectangle-45": 44,
        "circle": 47,
        "square": 40,
        "hand-0": 45,
        "hand-45": 44,
    }
)
"""How many of 50 presses the paper's tree recognised (Table 3)."""


def paper_task(
    *,
    seed: int = 0,
    repeats: int = 5,
    presses: int = PRESSES,
    physics: Physics = PAPER,
    about: str = "the paper's seven objects on the simulated sensor",
) -> Task:
    """Return the paper's task: seven objects, pressed to learn and pressed to test.

    Args:
        seed: Of the first repeat; the others follow it.
        repeats: How often everything is pressed anew.
        presses: Of each object to learn from, and as many others to test on.
        physics: Of the sensor.
        about: The task in a sentence.

    Raises:
        ValueError: If a number is below 1, or the seed below 0.

    Example:
        >>> task = paper_task(repeats=1, presses=2)
        >>> task.frames.shape, [len(split.test) for split in task.splits]
        ((28, 16, 16), [14])
    """
    if seed < 0 or repeats < 1 or presses < 1:
        raise ValueError(
            "the seed is at least 0, and repeats and presses at least 1, "
            f"not {seed}, {repeats} and {presses}"
        )
    made = [
        press(name, 2 * presses, seed + number, physics)
        for number in range(repeats)
        for name in OBJECTS
    ]
    count = len(OBJECTS) * 2 * presses  # frames of a repeat
    is_test = np.arange(count) // presses % 2 == 1
    splits = tuple(
        Split(
            f"seed {seed + number}",
            number * count + np.flatnonzero(~is_test),
            number * count + np.flatnonzero(is_test),
        )
        for number in range(repeats)
    )
    return Task(
        "paper",
        about,
        f"{presses} presses of each to learn from, {presses} others to test on; "
        f"{repeats} times, each with a seed of its own",
        made[0].sensor,
        np.concatenate([one.frames for one in made]),
        np.tile(np.repeat(np.arange(len(OBJECTS)), 2 * presses), repeats),
        tuple(OBJECTS),
        np.zeros(0, np.int64),
        splits,
        "paper",
        LearningSettings(),
        conditions=_text(physics),
        is_whole=False,
    )


def _text(physics: Physics) -> str:
    facts = msgspec.structs.asdict(physics)
    return ", ".join(f"{name} {value}" for name, value in facts.items())
