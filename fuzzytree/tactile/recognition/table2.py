"""The simulator's means beside the paper's: the 77 numbers of its Table 2."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.tactile.runtimes.frames import features_of
from fuzzytree.tactile.simulation.objects import OBJECTS
from fuzzytree.tactile.simulation.physics import PAPER, Settings, press

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

FEATURES = tuple(f"S{number}" for number in range(1, 12))
"""The complex moment invariants, in the order of the table's rows."""

TABLE_2 = (
    (27.55, 22.50, 32.18, 6.72, 23.49, 972.12, 804.93),
    (512.47, 237.06, 625.92, 1.94, 1.05, 1.92e5, 1.59e5),
    (2.49, 21.05, 42.49, 1.90, 3.11, 1.19e6, 1.71e6),
    (1.87, 2.37, 9.96, 0.12, 1.40, 5.81e6, 5.19e6),
    (2.49, 41.21, 212.25, 0.37, 4.68, 4.62e9, 6.06e9),
    (58.61, 55.49, 412.59, 0.08, 2.37, 5.03e9, 4.04e9),
    (7088.0, 1566.4, 9512.8, 2.56, 358.88, 7.70e7, 1.07e8),
    (1.35e4, 4497.7, 1.91e4, 10.81, 18.83, 4.12e8, 4.01e8),
    (129.68, 82.85, 157.84, 10.78, 63.37, 3.83e4, 3.29e4),
    (2.28e6, 3.65e5, 3.78e6, 32.46, 577.80, 7.06e12, 8.03e12),
    (5260.1, 2060.9, 6918.1, 9.10, 8.83, 1.77e7, 1.58e7),
)
"""A row for each feature, a column for each of `OBJECTS`: means of 50 presses.

The paper's last two rows have lost their labels; they are S10 and S11.
"""

NO_ORACLE = "S5"
"""Table 2's S5 fits C21 to the power 2, which is no invariant: it tests nothing."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """Means of simulated presses beside the paper's.

    Attributes:
        objects: The names of the columns.
        means: Shape (features, objects): this simulator's.
        paper: The same shape: Table 2's.
    """

    objects: tuple[str, ...]
    means: FloatArray
    paper: FloatArray

    @property
    def ratios(self) -> FloatArray:
        """Return the means divided by the paper's; below 0 if the signs differ."""
        return self.means / self.paper

    def within(self, factor: float) -> tuple[int, int]:
        """Return how many means lie within a factor of the paper's, and of how many.

        S5 is left out: see `NO_ORACLE`.
        """
        rows = [name != NO_ORACLE for name in FEATURES]
        ratios = self.ratios[rows]
        near = (ratios <= factor) & (ratios * factor >= 1)
        return int(near.sum()), near.size


def compare(
    settings: Settings = PAPER,
    seed: int = 0,
    *,
    count: int = 50,
    objects: tuple[str, ...] = tuple(OBJECTS),
) -> Comparison:
    """Press objects and compare the means of their invariants with Table 2.

    Args:
        settings: Of the simulator.
        seed: Of the presses.
        count: Presses of each object.
        objects: Names of `OBJECTS`.

    Raises:
        ValueError: If there is no such object, or the count is out of its range.
    """
    columns = [list(OBJECTS).index(name) for name in objects]
    means: list[FloatArray] = []
    for name in objects:
        found = press(name, count, seed, settings)
        values = features_of(found.sensor, found.frames, FEATURES).values
        means.append(values.mean(axis=1))
    paper = np.array(TABLE_2)[:, columns]
    return Comparison(objects, np.stack(means, axis=1), paper)
