"""Which effect of the simulated sensor lets invariants tell objects apart.

The mean of a rotation invariant is nearly the same at every angle on an even sensor, so
learners that compare means cannot tell angles apart. Each effect is switched off alone,
on the same presses, and Fisher's linear discriminants say what is left.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.tactile.recognition.table2 import FEATURES, TABLE_2, Comparison
from fuzzytree.tactile.runtimes.frames import FramePlan
from fuzzytree.tactile.sensor import Sensor
from fuzzytree.tactile.simulation.objects import OBJECTS
from fuzzytree.tactile.simulation.physics import FULL, PAPER, SIDE, Settings, press

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

_EVEN_LINES: Mapping[str, object] = MappingProxyType(
    {"wiring": "diodes", "drive_ohm": 0.0, "load_ohm": 0.0}
)
_EVEN_GAINS: Mapping[str, object] = MappingProxyType(
    {"row_spread": 0.0, "column_spread": 0.0}
)
_EVEN: Mapping[str, object] = MappingProxyType({**_EVEN_LINES, **_EVEN_GAINS})
_LINEAR: Mapping[str, object] = MappingProxyType(
    {
        "aperture": 1.0,
        "break_n": 0.0,
        "bend_n": math.inf,
        "full_us": 5000.0,  # so that nothing is clipped
        "noise": 0.0,
        "threshold": 0,
    }
)

EFFECTS: Mapping[str, Mapping[str, object]] = MappingProxyType(
    {
        "everything on": MappingProxyType({}),
        "no cross-talk": _EVEN_LINES,
        "equal gains": _EVEN_GAINS,
        "no tilt": MappingProxyType({"tilt": 0.0}),
        "equal forces": MappingProxyType({"force_spread": 0.0}),
        "no turning": MappingProxyType({"turn_deg": 0.0}),
        "no noise": MappingProxyType({"noise": 0.0}),
        "no break force": MappingProxyType({"break_n": 0.0}),
        "no bend": MappingProxyType({"bend_n": math.inf}),
        "whole cells feel": MappingProxyType({"aperture": 1.0}),
        "fixed places": MappingProxyType({"roam": 0.0}),
        "even sensor": _EVEN,
        "even and linear": MappingProxyType({**_EVEN, **_LINEAR}),
        "even, other gains": MappingProxyType(
            {**_EVEN_LINES, "row_spread": 0.2, "column_spread": 0.2}
        ),
        "even, fixed places": MappingProxyType({**_EVEN, "roam": 0.0}),
    }
)
"""What is switched off, by name."""


@dataclass(frozen=True, slots=True)
class Effect:
    """What becomes of recognition without an effect.

    Attributes:
        name: Of `EFFECTS`.
        objects: The share of each object's presses that is recognised.
        near: How many of 70 means lie within a factor of 2 of Table 2.
    """

    name: str
    objects: Mapping[str, float]
    near: int

    @property
    def all(self) -> float:
        """Return the share of all presses that is recognised."""
        return sum(self.objects.values()) / len(self.objects)


def effects(
    settings: Settings = PAPER, seed: int = 0, *, count: int = 50
) -> Iterator[Effect]:
    """Switch off one effect after another; learn on a seed, test on the next.

    Args:
        settings: Of the simulator, with everything on.
        seed: Of the presses to learn from; those to test on have the next.
        count: Presses of each object, for each; at least 2.

    Raises:
        ValueError: If the count is out of its range.
    """
    if count < 2:
        raise ValueError(f"2 presses at least are needed to learn from, not {count}")
    for name, changes in EFFECTS.items():
        changed = msgspec.structs.replace(settings, **changes)
        sensor = Sensor(SIDE, SIDE, FULL, changed.threshold)
        plan = FramePlan(sensor, [*FEATURES, *(f"log {one}" for one in FEATURES)])
        learnt = [plan(press(one, count, seed, changed).frames) for one in OBJECTS]
        tested = [plan(press(one, count, seed + 1, changed).frames) for one in OBJECTS]
        answers = discriminate(
            [one.values[len(FEATURES) :].T for one in learnt],
            np.concatenate([one.values[len(FEATURES) :].T for one in tested]),
        )
        known = np.repeat(np.arange(len(OBJECTS)), count)
        right = (answers == known).reshape(len(OBJECTS), count).mean(axis=1)
        means = np.stack([one.values[: len(FEATURES)].mean(axis=1) for one in learnt])
        table = Comparison(tuple(OBJECTS), means.T, np.array(TABLE_2))
        share = dict(zip(OBJECTS, right.tolist(), strict=True))
        yield Effect(name, share, table.within(2.0)[0])


def discriminate(
    learnt: list[FloatArray], rows: FloatArray
) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return the class of each row by Fisher's linear discriminants.

    That is the class whose mean is nearest, in units of the scatter within classes;
    directions without scatter are left out. All classes are equally likely.

    Args:
        learnt: Rows of each class, shape (rows, features).
        rows: Shape (rows, features).

    Example:
        >>> two = [np.array([[0.0], [1.0]]), np.array([[4.0], [5.0]])]
        >>> discriminate(two, np.array([[2.4], [2.6]])).tolist()
        [0, 1]
    """
    means = np.stack([one.mean(axis=0) for one in learnt])
    within = np.concatenate([one - one.mean(axis=0) for one in learnt])
    unit = within.std(axis=0)
    unit[unit == 0] = 1.0
    _, sizes, directions = np.linalg.svd(within / unit, full_matrices=False)
    is_seen = sizes > 1e-6 * sizes[0]
    axes = (directions[is_seen] / sizes[is_seen, np.newaxis]).T / unit[:, np.newaxis]
    apart = (rows @ axes)[:, np.newaxis] - means @ axes
    nearest: np.ndarray[tuple[int], np.dtype[np.int64]] = (apart**2).sum(2).argmin(1)
    return nearest
