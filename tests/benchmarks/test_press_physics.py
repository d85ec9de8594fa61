"""The physical simulator, against what physics and geometry say it must do."""

from __future__ import annotations

import itertools
import math

import msgspec
import numpy as np
import numpy.typing as npt
import pytest
from press_physics import (
    PAPER,
    SIDE,
    PhysicsSettings,
    PressTruth,
    Wiring,
    forces_of,
    fsr,
    gains,
    press,
    quantised,
    read_matrix,
)
from press_shapes import (
    OBJECTS,
    FloatArray,
    Object,
    ShapePart,
    area_and_middle,
    covered,
    disc,
    finger,
    radius_of,
    rectangle,
)

from fuzzytree.errors import InvalidModelError

IDEAL = PhysicsSettings(
    aperture=1.0,
    roam=0.0,
    turn_deg=0.0,
    tilt=0.0,
    force_spread=0.0,
    row_spread=0.0,
    column_spread=0.0,
    break_n=0.0,
    bend_n=math.inf,
    wiring="diodes",
    drive_ohm=0.0,
    load_ohm=0.0,
    noise=0.0,
)
"""Everything off: what is left is the geometry and 8 bits."""


def _truth(*, x: float = 0.3, y: float = -0.2, angle: float = 11.0) -> PressTruth:
    values = (x, y, angle, 10.0, 0.0, 0.0)
    return PressTruth(*(np.array([value]) for value in values))


def _clipped_area(
    corners: npt.NDArray[np.float64], x: float, y: float, size: float
) -> float:
    """Return the area of a polygon in a square, by cutting it with four lines."""
    found = [complex(a, b) for a, b in corners]
    middle = complex(x + size / 2, y + size / 2)
    for quarter in range(4):
        normal = 1j**quarter
        outside = [((p - middle) / normal).real - size / 2 for p in found]
        kept: list[complex] = []
        for k, point in enumerate(found):
            before, depth, last = found[k - 1], outside[k], outside[k - 1]
            if depth * last < 0:
                kept.append(before + (point - before) * last / (last - depth))
            if depth <= 0:
                kept.append(point)
        found = kept
    pairs = itertools.pairwise([*found, found[0]]) if found else ()
    return sum((a.conjugate() * b).imag for a, b in pairs) / 2


def test_covered_areas_are_those_of_cut_polygons() -> None:
    random = np.random.default_rng(3)
    angles = np.sort(random.uniform(0, 2 * np.pi, (4, 9)), axis=1)
    radii = random.uniform(0.5, 3.0, (4, 9))  # a star: not convex
    stars = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=-1)
    lines = np.arange(-4.0, 5.0)
    cells = np.diff(np.diff(covered(stars, lines, lines), axis=1), axis=2)
    wanted = [
        [[_clipped_area(star, x, y, 1.0) for x in lines[:-1]] for y in lines[:-1]]
        for star in stars
    ]
    np.testing.assert_allclose(cells, wanted, atol=1e-13)


def test_an_upright_edge_between_lines_counts_in_part() -> None:
    square = np.array([rectangle(1.0, 1.0).corners])
    assert covered(square, np.array([0.25]), np.array([0.0])).item() == 0.375


def test_a_disc_has_its_area_and_nearly_its_radius_of_gyration() -> None:
    area, x, y = area_and_middle(disc(2.0))
    assert area == pytest.approx(4 * math.pi, rel=1e-14)
    assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-14)
    mean_square = radius_of(Object("disc", (disc(2.0),), 1.0)) ** 2
    assert mean_square == pytest.approx(2.0, rel=1e-4)


def test_a_bar_has_the_radius_of_gyration_of_the_text_book() -> None:
    bar = Object("bar", (rectangle(6.0, 2.0),), 1.0)
    assert radius_of(bar) == pytest.approx(math.sqrt(40 / 12), rel=1e-14)


def test_a_finger_points_where_it_is_reported() -> None:
    straight = finger((1.0, 2.0), 90.0, 4.0, 1.0)
    corners = np.array(straight.corners)
    assert corners.max(axis=0) == pytest.approx((1.5, 6.0))
    assert corners.min(axis=0) == pytest.approx((0.5, 2.0))
    assert area_and_middle(straight)[0] == pytest.approx(3.5 + 0.375)


@pytest.mark.parametrize("name", OBJECTS)
def test_every_object_presses_at_its_middle_and_counterclockwise(name: str) -> None:
    sizes = np.array([area_and_middle(part) for part in OBJECTS[name].parts])
    weights = [part.weight for part in OBJECTS[name].parts]
    assert np.all(sizes[:, 0] > 0)
    moment = (sizes[:, 0] * weights) @ sizes[:, 1:]
    np.testing.assert_allclose(moment, 0.0, atol=1e-12)


@pytest.mark.parametrize("name", OBJECTS)
def test_the_cells_feel_the_whole_force(name: str) -> None:
    truth = press(name, 5, settings=msgspec.structs.replace(IDEAL, roam=1.0)).truth
    felt = forces_of(OBJECTS[name], truth, 1.0)
    np.testing.assert_allclose(felt.sum(axis=(1, 2)), truth.force_n, rtol=1e-12)


def test_an_aperture_feels_its_share_under_an_even_press() -> None:
    whole = Object("mat", (rectangle(32.0, 32.0),), 10.0)
    felt = forces_of(whole, _truth(angle=0.0), 0.25)
    np.testing.assert_allclose(felt, 10.0 / 32**2 / 4, rtol=1e-12)


def test_the_forces_of_parts_add_up() -> None:
    parts = (rectangle(4.0, 1.0), finger((0.0, 0.5), 70.0, 3.0, 1.0))
    sizes = [area_and_middle(part)[0] for part in parts]
    both = forces_of(Object("both", parts, 10.0), _truth(), 1.0)
    each = [forces_of(Object("one", (part,), 10.0), _truth(), 1.0) for part in parts]
    added = (sizes[0] * each[0] + sizes[1] * each[1]) / sum(sizes)
    np.testing.assert_allclose(both, added, atol=1e-12)


def test_a_tilted_object_presses_more_on_one_side_and_never_pulls() -> None:
    x = np.zeros(1)
    truth = PressTruth(x, x, x, np.array([10.0]), np.array([0.5]), x)
    felt = forces_of(Object("bar", (rectangle(8.0, 2.0),), 1.0), truth, 1.0)
    row = felt[0, 7]
    mean = 10.0 / 16
    np.testing.assert_allclose(
        row[4:12] / mean, [0.0, 0.0, 0.25, 0.75, 1.25, 1.75, 2.25, 2.75]
    )


def test_an_object_turned_by_a_quarter_gives_frames_turned_by_a_quarter() -> None:
    bar = Object("bar", (ShapePart(((-2.0, -1.0), (3.0, -0.7), (1.0, 1.5))),), 12.0)
    turned = Object("bar", bar.parts, 12.0, turned_deg=90.0)
    frames = press(bar, 5, settings=IDEAL).frames
    assert frames.any()
    across = press(turned, 5, settings=IDEAL).frames
    assert np.array_equal(across, np.rot90(frames, axes=(1, 2)))


def test_a_column_with_a_load_makes_rows_and_columns_unequal() -> None:
    loaded = msgspec.structs.replace(IDEAL, wiring="grounded", load_ohm=5000.0)
    bar = Object("bar", (rectangle(6.0, 2.0),), 20.0)
    upright = Object("bar", bar.parts, 20.0, turned_deg=90.0)
    lying = press(bar, 1, settings=loaded).frames.astype(int)
    standing = press(upright, 1, settings=loaded).frames.astype(int)
    assert lying.sum() > 1.5 * standing.sum()


def test_a_cell_conducts_nothing_then_a_line_then_no_more() -> None:
    law = PhysicsSettings(break_n=0.5, slope_us=100.0, bend_n=8.0)
    force = np.array([0.0, 0.5, 0.50001, 8.5, 1e9])
    found = fsr(force, law)
    assert found[:2].tolist() == [0.0, 0.0]
    assert found[2] == pytest.approx(1e-3, rel=1e-5)
    assert found[3] == pytest.approx(400.0)
    assert found[4] == pytest.approx(800.0)
    straight = fsr(force, PhysicsSettings(break_n=0.5, slope_us=100.0, bend_n=math.inf))
    assert straight[3] == pytest.approx(800.0)


def test_gains_are_a_rows_times_a_columns_and_a_boards_own() -> None:
    own = gains(PhysicsSettings(row_spread=0.2, column_spread=0.1, board=5))
    assert np.linalg.matrix_rank(own) == 1
    assert not np.allclose(own, gains(PhysicsSettings(board=6)))
    assert np.all(gains(PhysicsSettings(row_spread=0.0, column_spread=0.0)) == 1.0)


def _nodal(
    conductance: FloatArray, wiring: Wiring, drive_ohm: float, load_ohm: float
) -> FloatArray:
    """Read every cell by its own node equations, resistor after resistor."""
    rows, columns = conductance.shape
    drive, load = 1e6 / drive_ohm, 1e6 / load_ohm
    found = np.zeros((rows, columns))
    for row, column in itertools.product(range(rows), range(columns)):
        nodes = np.zeros((rows + columns, rows + columns))
        for i, j in itertools.product(range(rows), range(columns)):
            ends = np.zeros(rows + columns)
            ends[[i, rows + j]] = 1.0, -1.0
            nodes += conductance[i, j] * np.outer(ends, ends)
        for i in range(rows):
            if i == row or wiring == "grounded":
                nodes[i, i] += drive
        for j in range(columns):
            if j == column or wiring == "grounded":
                nodes[rows + j, rows + j] += load
        source = np.zeros(rows + columns)
        source[row] = drive  # one volt behind the driver
        found[row, column] = load * np.linalg.solve(nodes, source)[rows + column]
    return found


@pytest.mark.parametrize("wiring", ["grounded", "floating"])
def test_a_matrix_reads_what_its_node_equations_say(wiring: Wiring) -> None:
    random = np.random.default_rng(7)
    conductance = random.uniform(0.1, 300.0, (2, 4, 6))
    conductance[0, 1:, 2:] = 0.1
    found = read_matrix(conductance, wiring, drive_ohm=150.0, load_ohm=2200.0)
    wanted = [_nodal(one, wiring, 150.0, 2200.0) for one in conductance]
    np.testing.assert_allclose(found, wanted, rtol=1e-9)


def test_diodes_keep_cells_apart() -> None:
    alone = np.full((1, 4, 4), 0.1)
    alone[0, 1, 1] = 200.0
    crowd = np.where(alone > 1, alone, 150.0)
    seen = [
        read_matrix(one, "diodes", drive_ohm=100.0, load_ohm=900.0)[0, 1, 1]
        for one in (alone, crowd)
    ]
    assert seen == pytest.approx([200 / 1.2, 200 / 1.2])


def test_a_virtual_ground_and_ideal_drivers_leave_no_cross_talk() -> None:
    conductance = np.random.default_rng(1).uniform(0.1, 300.0, (3, 16, 16))
    found = read_matrix(conductance, "grounded", drive_ohm=0.0, load_ohm=0.0)
    np.testing.assert_allclose(found, conductance, rtol=1e-14)


def test_open_lines_show_a_ghost_at_the_fourth_corner() -> None:
    conductance = np.full((1, 4, 4), 1e-3)
    conductance[0, [0, 0, 2], [1, 3, 1]] = 90.0
    seen = read_matrix(conductance, "floating", drive_ohm=0.0, load_ohm=0.0)
    assert seen[0, 2, 3] == pytest.approx(30.0, rel=1e-3)  # three in a line


def test_readings_above_full_are_clipped_and_counted() -> None:
    share = np.array([[[0.5, 1.0], [1.01, 7.0]], [[0.0, 0.001], [0.1, 0.2]]])
    counts, clipped = quantised(share, np.zeros((2, 2, 2)))
    assert counts.tolist() == [[[128, 255], [255, 255]], [[0, 0], [26, 51]]]
    assert clipped.tolist() == [2, 0]
    below, none = quantised(np.zeros((1, 1, 1)), np.full((1, 1, 1), -9.0))
    assert (below.item(), none.item()) == (0, 0)


def test_the_same_seed_gives_the_same_frames_and_another_one_others() -> None:
    found = press("circle", 100, 4)
    again = press("circle", 100, 4)
    assert found.frames.shape == (100, SIDE, SIDE)
    assert found.frames.dtype == np.uint8
    assert np.array_equal(found.frames, again.frames)
    assert not np.array_equal(found.frames, press("circle", 100, 5).frames)
    assert len(np.unique(found.truth.x)) == 100


def test_more_presses_begin_with_the_same_ones() -> None:
    many, few = press("square", 70), press("square", 40)
    assert np.array_equal(many.frames[:40], few.frames)
    assert np.array_equal(many.truth.force_n[:40], few.truth.force_n)


def test_two_settings_are_compared_on_the_same_presses() -> None:
    one = press("square", 20, 1, PhysicsSettings(force_spread=0.0, noise=0.0))
    two = press("square", 20, 1, PhysicsSettings(wiring="diodes", bend_n=3.0))
    assert np.array_equal(one.truth.x, two.truth.x)
    assert np.array_equal(one.truth.angle_deg, two.truth.angle_deg)
    assert set(one.truth.force_n.tolist()) == {OBJECTS["square"].force_n}


@pytest.mark.parametrize("name", OBJECTS)
def test_an_object_lies_whole_on_the_sensor_wherever_it_roams(name: str) -> None:
    found = press(name, 30)
    assert np.all(found.outside < 1e-12)
    assert found.sensor.threshold == PAPER.threshold
    assert np.all((found.frames > found.sensor.threshold).any(axis=(1, 2)))


def test_what_hangs_over_the_edge_is_reported() -> None:
    large = Object("board", (rectangle(20.0, 16.0),), 10.0)
    found = press(large, 2, settings=IDEAL)
    np.testing.assert_allclose(found.outside, 0.2)


def test_numbers_out_of_range_are_reported_all_at_once() -> None:
    with pytest.raises(InvalidModelError) as caught:
        PhysicsSettings(roam=1.5, aperture=0.0, wiring="crossed")  # type: ignore[arg-type] # wrong on purpose
    assert str(caught.value) == (
        "roam lies in 0 to 1, not 1.5\n"
        "aperture lies in 0.001 to 1, not 0\n"
        "wiring is one of diodes, grounded, floating, not 'crossed'"
    )


def test_no_number_is_no_setting() -> None:
    with pytest.raises(InvalidModelError, match=r"^tilt lies in 0 to 10, not nan$"):
        PhysicsSettings(tilt=math.nan)


def test_an_object_that_is_not_there_is_reported() -> None:
    with pytest.raises(ValueError, match=r"^no object 'foot'; the objects are ") as one:
        press("foot", 1)
    assert str(one.value) == (
        "no object 'foot'; the objects are rectangle-0, rectangle-27, rectangle-45, "
        "circle, square, hand-0, hand-45"
    )


@pytest.mark.parametrize("count", [0, 100_001])
def test_a_count_out_of_range_is_reported(count: int) -> None:
    with pytest.raises(ValueError, match="presses can be made") as caught:
        press("circle", count)
    text = f"1 to 100000 presses can be made at a time, not {count}"
    assert str(caught.value) == text
