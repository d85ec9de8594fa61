"""The simulator's means beside the paper's, and what moves them with the angle."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from experiment_tables import (
    FEATURES,
    TABLE_2,
    TableMeans,
    compare,
)
from press_physics import (
    PAPER,
    PhysicsSettings,
    press,
)
from press_shapes import OBJECTS, FloatArray, Object, rectangle

from fuzzytree.tactile.runtimes.frames import FramePlan

EVEN = msgspec.structs.replace(
    PAPER,
    wiring="diodes",
    drive_ohm=0.0,
    load_ohm=0.0,
    row_spread=0.0,
    column_spread=0.0,
)
"""The same sensor with every cell alike and alone."""

BARS = ("rectangle-0", "rectangle-45")


def test_the_papers_table_has_77_numbers_that_its_own_laws_allow() -> None:
    table = np.array(TABLE_2)
    assert table.shape == (len(FEATURES), len(OBJECTS)) == (11, 7)
    s1, s2, s9 = table[0], table[1], table[8]
    assert np.all(np.sqrt(s2) <= s1)  # |C20| <= C11
    assert np.all(np.sqrt(table[7]) <= s9)  # |C31| <= C22


def test_nearness_counts_both_sides_and_leaves_out_s5() -> None:
    means = np.ones((11, 1))
    paper = np.full((11, 1), 2.0)
    paper[:4, 0] = 0.5, 0.4, -1.0, 1.0
    found = TableMeans(("circle",), means, paper)
    assert found.within(2.0) == (8, 10)  # neither 2.5 times nor the other sign
    assert found.within(1.25) == (1, 10)
    assert found.ratios[2, 0] == -1.0


def test_the_means_come_as_near_table_2_as_the_page_says() -> None:
    found = compare()
    near, count = found.within(2.0)
    assert count == 70
    assert near >= 45


def test_means_of_some_objects_are_those_of_all() -> None:
    few = compare(count=4, objects=("square", "circle"))
    every = compare(count=4)
    assert np.array_equal(few.means[:, 0], every.means[:, 4])
    assert few.paper[0].tolist() == [23.49, 6.72]


def test_a_bar_that_reads_full_on_an_ideal_sensor_has_the_papers_means() -> None:
    ideal = msgspec.structs.replace(
        EVEN,
        aperture=1.0,
        turn_deg=0.0,
        tilt=0.0,
        force_spread=0.0,
        break_n=0.0,
        bend_n=math.inf,
        slope_us=100.0,
        full_us=100.0,
        rest_us=1e-3,
        noise=0.0,
        threshold=0,
    )
    width, height = 5.55, 1.735
    bar = Object("bar", (rectangle(width, height),), width * height)  # 1 N a cell
    found = press(bar, 400, 0, ideal)
    means = FramePlan(found.sensor, FEATURES)(found.frames).values.mean(axis=1)
    ratios = dict(zip(FEATURES, means / np.array(TABLE_2)[:, 0], strict=True))
    for name in ("S1", "S2", "S7", "S8", "S9", "S10", "S11"):
        assert ratios[name] == pytest.approx(1.0, abs=0.15), name


def _apart(settings: PhysicsSettings) -> float:
    """Return how far S1 of the bars at 0 and 45 degrees lies apart, in spreads.

    S1 is divided by the force: what is left is shape.
    """
    logs: list[FloatArray] = []
    for name in BARS:
        found = press(name, 200, 2, settings)
        values = FramePlan(found.sensor, ["S1 / force"])(found.frames).values[0]
        logs.append(np.log(values))
    apart = abs(logs[0].mean() - logs[1].mean())
    return float(apart / np.sqrt((logs[0].var() + logs[1].var()) / 2))


def test_only_the_stated_asymmetry_moves_an_invariant_with_the_angle() -> None:
    assert _apart(EVEN) < 0.8 < _apart(PAPER)
