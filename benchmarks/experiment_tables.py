"""The simulator compared with the paper's Table 2, and the effects of its sensor.

python benchmarks/experiment_tables.py all --means
python benchmarks/experiment_tables.py all --effects
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import click
import msgspec
import numpy as np
from commands import run
from press import physics_settings
from press_physics import (
    FULL,
    PAPER,
    SIDE,
    PhysicsSettings,
    press,
)
from press_shapes import OBJECTS

from fuzzytree.cli.console import (
    ResultOptions,
    answer,
    answer_json,
    argument,
    flag,
    option,
    say,
    takes,
    wrong_options,
)
from fuzzytree.tactile.runtimes.frames import FramePlan
from fuzzytree.tactile.sensor import Sensor

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
class TableMeans:
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
    settings: PhysicsSettings = PAPER,
    seed: int = 0,
    *,
    count: int = 50,
    objects: tuple[str, ...] = tuple(OBJECTS),
) -> TableMeans:
    """Press objects and compare the means of their invariants with Table 2.

    Args:
        settings: Of the simulator.
        seed: Of the presses.
        count: Presses of each object.
        objects: Names of `OBJECTS`.

    Raises:
        ValueError: If there is no such object, or the count is out of its range.
    """
    for name in objects:
        if name not in OBJECTS:
            raise ValueError(f"no object {name!r}; there is {', '.join(OBJECTS)}")
    columns = [list(OBJECTS).index(name) for name in objects]
    means: list[FloatArray] = []
    for name in objects:
        found = press(name, count, seed, settings)
        values = FramePlan(found.sensor, FEATURES)(found.frames).values
        means.append(values.mean(axis=1))
    paper = np.array(TABLE_2)[:, columns]
    return TableMeans(objects, np.stack(means, axis=1), paper)


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
    settings: PhysicsSettings = PAPER, seed: int = 0, *, count: int = 50
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
        table = TableMeans(tuple(OBJECTS), means.T, np.array(TABLE_2))
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


class TablesOptions(ResultOptions):
    """The arguments and options of the verb."""

    name: str = argument("OBJECT")
    count: int = option("--count NUMBER", "Presses of each class.", default=50)
    seed: int = option(
        "--seed NUMBER", "Random seed.", type=click.IntRange(0), default=0
    )
    changes: Sequence[str] = option(
        "--set NAME=VALUE",
        "A number of the simulator (repeat); docs/explanation/simulator.md.",
        multiple=True,
    )
    means: bool = flag("--means", "Print mean invariants beside Table 2.")
    is_each: bool = flag(
        "--effects", "Print the recognition rates without each effect of the sensor."
    )


@click.command("experiment_tables.py")
@takes(TablesOptions)
def command(options: TablesOptions) -> None:
    """Compare simulated presses of OBJECT, or of `all`, with the paper's."""
    if not (options.means or options.is_each):
        raise click.UsageError("choose --means or --effects")
    if options.is_each and (options.name != "all" or options.count < 2):
        raise click.UsageError("--effects needs all objects, and 2 presses of each")
    names = tuple(OBJECTS) if options.name == "all" else (options.name,)
    facts: dict[str, object] = {}
    with wrong_options():
        settings = physics_settings(options.changes)
        if options.means:
            table = compare(settings, options.seed, count=options.count, objects=names)
            facts["means"] = _means_facts(table)
            if not options.as_json:
                _print_means(table, quiet=options.quiet)
        if options.is_each:
            facts["effects"] = _print_effects(
                settings, options.seed, options.count, is_silent=options.as_json
            )
    if options.as_json:
        answer_json(facts)


def _means_facts(found: TableMeans) -> dict[str, object]:
    return {
        "features": FEATURES,
        "objects": found.objects,
        "means": found.means.tolist(),
        "paper": found.paper.tolist(),
        "within_2": found.within(2.0)[0],
        "within_1.25": found.within(1.25)[0],
        "of": found.within(2.0)[1],
    }


def _print_means(found: TableMeans, *, quiet: bool) -> None:
    """Print a line for each feature: each object's mean and its ratio to Table 2."""
    rows = zip(FEATURES, found.means, found.ratios, strict=True)
    answer(_line("feature", found.objects))
    for feature, means, ratios in rows:
        pairs = zip(means, ratios, strict=True)
        answer(_line(feature, [f"{mean:.3g} x{ratio:.2f}" for mean, ratio in pairs]))
    near, near_all = found.within(1.25)[0], found.within(2.0)
    say(
        f"x: times Table 2's mean; {near_all[0]} of {near_all[1]} lie within a factor "
        f"of 2, {near} within 1.25; {NO_ORACLE} is not counted",
        quiet=quiet,
    )


def _print_effects(
    settings: PhysicsSettings, seed: int, count: int, *, is_silent: bool
) -> list[dict[str, object]]:
    """Print a line for each effect that is switched off, and return the facts."""
    facts: list[dict[str, object]] = []
    if not is_silent:
        heads = ["all", *OBJECTS, "within 2"]
        answer(" ".join([f"{'without':18}", *(f"{head:>12}" for head in heads)]))
    with wrong_options():
        for one in effects(settings, seed, count=count):
            shares = [one.all, *one.objects.values()]
            cells = [*(f"{100 * share:.0f} %" for share in shares), str(one.near)]
            if not is_silent:
                row = (f"{cell:>12}" for cell in cells)
                answer(" ".join([f"{one.name:18}", *row]))
            facts.append(
                {
                    "name": one.name,
                    "all": one.all,
                    "objects": one.objects,
                    "within_2": one.near,
                }
            )
    return facts


def _line(title: str, cells: Iterable[str]) -> str:
    return " ".join([f"{title:7}", *(f"{cell:>17}" for cell in cells)])


if __name__ == "__main__":
    sys.exit(run(command))
