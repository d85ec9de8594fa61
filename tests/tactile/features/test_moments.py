"""Moments about the centre of pressure, their noise, and what must not change them."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
import pytest
from exact_features import exact_features

from fuzzytree.errors import InvalidModelError
from fuzzytree.runtimes.programs import plan_program, run_program
from fuzzytree.semantics.programs.steps import Maker, Program, result_of
from fuzzytree.tactile.features import frame_program, moments
from fuzzytree.tactile.features.moments import Centred, Noisy, sum_name
from fuzzytree.tactile.features.names import FEATURES, PAPER
from fuzzytree.tactile.runtimes.frames import FramePlan
from fuzzytree.tactile.sensor import Cells, Sensor
from tests.tactile.frames import hard_frames

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

ORDERS = [(2, 0), (1, 1), (3, 0), (2, 1), (4, 0), (3, 1), (2, 2)]
SENSORS = [
    Sensor(16, 16),
    Sensor(10, 7, full=4095),
    pytest.param(Sensor(64, 64, full=65535), marks=pytest.mark.heavy),
    Sensor(1, 9),
    Sensor(5, 1, full=1),
]
RATIONAL = [
    name for name in FEATURES if name not in ("angle", "cos2", "sin2")
]  # fmt: skip


def bounded(sensor: Sensor) -> tuple[Program, FramePlan]:
    """Return a program of all complex moments with their bounds, and the sums' plan."""
    make = Maker()
    centred = Centred(make)
    results = []
    for p, q in ORDERS:
        for part, found in zip("ri", centred.complex_moment(p, q), strict=True):
            error = make.constant(0.0) if found.error is None else found.error
            results.append(result_of("output", f"{part}{p}{q}", found.value))
            results.append(result_of("output", f"error {part}{p}{q}", error))
    plan = FramePlan(sensor, PAPER)
    inputs = tuple(one.name for one in plan.made.sums)
    return make.program("moments", inputs, tuple(results)), plan


def sums_of(plan: FramePlan, frames: Cells) -> FloatArray:
    cells = frames.reshape(len(frames), -1).astype(object)
    weights = np.array([one.weights for one in plan.made.sums], object)
    return np.array(weights @ cells.T, np.float64)


def exact_moments(sensor: Sensor, frame: Cells) -> list[Fraction]:
    names = [f"{part} C{p}{q}" for p, q in ORDERS for part in ("Re", "Im")]
    real = {"Re C11": "S1", "Re C22": "S9"}
    known = [real.get(name, name) for name in names if name not in ("Im C11", "Im C22")]
    values = dict(zip(known, exact_features(sensor, frame, known), strict=True))
    return [
        values.get(real.get(name, name), Fraction(0)) * sensor.full for name in names
    ]


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda s: f"{s.rows}x{s.columns}")
def test_the_bound_of_a_moment_holds_what_rounding_did(sensor: Sensor) -> None:
    program, plan = bounded(sensor)
    frames = np.stack([*hard_frames(sensor, 1, 24)])
    found = run_program(plan_program(program), sums_of(plan, frames))
    for column, frame in enumerate(frames):
        for line, exact in enumerate(exact_moments(sensor, frame)):
            value, error = found[2 * line : 2 * line + 2, column]
            assert abs(Fraction(value) - exact) <= Fraction(error) * (
                1 + Fraction(2) ** -40
            )


def test_a_bound_without_the_error_of_what_is_moved_would_not_hold(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    honest = Centred._moved

    def careless(self: Centred, one: Noisy, other: Noisy, axis: int) -> Noisy:
        return Noisy(honest(self, one, other, axis).value, self.make.constant(0.0))

    monkeypatch.setattr(moments.Centred, "_moved", careless)
    with pytest.raises(AssertionError):
        test_the_bound_of_a_moment_holds_what_rounding_did(Sensor(16, 16))


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda s: f"{s.rows}x{s.columns}")
def test_features_are_the_exact_ones_but_for_rounding(sensor: Sensor) -> None:
    frames = np.stack([*hard_frames(sensor, 2, 16)])
    found = FramePlan(sensor, list(FEATURES))(frames)
    assert np.isfinite(found.values).all()
    for column, frame in enumerate(frames):
        exact = exact_features(sensor, frame, list(FEATURES))
        for name, value, wanted in zip(
            FEATURES, found.values[:, column], exact, strict=True
        ):
            slack = 1e-9 if name in ("S5", "S6", "S10") else 1e-11
            allowed = slack * float(abs(wanted)) + 1e-12 * _size(name, sensor, frame)
            assert abs(float(Fraction(value) - wanted)) <= allowed, name


def _size(name: str, sensor: Sensor, frame: Cells) -> float:
    """Return how large a feature of as many cells can be: noise is relative to it."""
    reach = float(max(sensor.rows, sensor.columns))
    degrees = {"S1": 2, "S2": 4, "S3": 6, "S4": 6, "S5": 12, "S6": 8, "S7": 8, "S8": 8}
    degrees |= {"S9": 4, "S10": 12, "S11": 6}
    power = degrees.get(name, int(name[-2]) + int(name[-1]) if " " in name else 1)
    force = float(frame.sum()) / sensor.full
    in_force = {2: 2, 3: 2, 4: 2, 5: 4, 6: 3, 7: 2, 8: 2, 10: 3, 11: 2}
    number = int(name[1:]) if name[0] == "S" else 0
    return reach**power * max(force, 1.0) ** in_force.get(number, 1)


@pytest.mark.parametrize("sensor", SENSORS[:3], ids=lambda s: f"{s.rows}x{s.columns}")
def test_a_frame_that_a_half_turn_does_not_change_has_no_odd_moments(
    sensor: Sensor,
) -> None:
    names = ["S3", "S4", "S5", "S6", "Re C21", "Im C21", "Re C30", "Im C30"]
    for frame in hard_frames(sensor, 3, 16):
        turned = np.maximum(frame, frame[::-1, ::-1])
        assert not FramePlan(sensor, names)(turned).values.any()


def test_a_mirror_image_of_itself_has_no_imaginary_parts() -> None:
    sensor = Sensor(12, 13)
    names = ["Im C20", "Im C21", "Im C30", "Im C31", "Im C40"]
    for frame in hard_frames(sensor, 4, 16):
        same = np.maximum(frame, frame[::-1])
        assert not FramePlan(sensor, names)(same).values.any()


def test_a_square_has_neither_direction_nor_odd_moments() -> None:
    cells = np.zeros((16, 16), np.uint8)
    cells[3:8, 6:11] = 200
    names = ["S2", "S3", "S4", "S8", "S11", "angle", "cos2", "sin2"]
    assert not FramePlan(Sensor(16, 16), names)(cells).values.any()


def test_moving_a_frame_by_whole_cells_changes_no_bit() -> None:
    sensor = Sensor(24, 24)
    small = np.stack([*hard_frames(Sensor(10, 9), 5, 24)])
    wide = np.zeros((2, len(small), 24, 24), np.int64)
    wide[0, :, 1:11, 2:11] = small
    wide[1, :, 12:22, 7:16] = small
    names = [name for name in FEATURES if name not in ("x", "y")]
    one, two = (FramePlan(sensor, names)(frames).values for frames in wide)
    assert one.tobytes() == two.tobytes()


def test_a_flip_changes_no_bit_of_an_invariant() -> None:
    sensor = Sensor(11, 14, full=1023)
    frames = np.stack([*hard_frames(sensor, 6, 24)])
    names = [*PAPER, "force", "area", "peak"]
    wanted = FramePlan(sensor, names)(frames).values.tobytes()
    for flipped in (frames[:, ::-1], frames[:, :, ::-1], frames[:, ::-1, ::-1]):
        assert FramePlan(sensor, names)(flipped).values.tobytes() == wanted


def test_a_quarter_turn_changes_invariants_by_rounding_alone() -> None:
    sensor = Sensor(12, 12)
    frames = np.stack([*hard_frames(sensor, 7, 24)])
    one = FramePlan(sensor, PAPER)(frames).values
    two = FramePlan(sensor, PAPER)(np.rot90(frames, axes=(1, 2))).values
    for name, a, b in zip(PAPER, one, two, strict=True):
        sizes = np.array([_size(name, sensor, frame) for frame in frames])
        assert (abs(a - b) <= 1e-11 * abs(a) + 1e-13 * sizes).all()


def test_a_turn_that_keeps_to_the_grid_changes_no_exact_invariant() -> None:
    """Points whose places are multiples of 5 turn by the angle of 3, 4 and 5."""
    sensor = Sensor(48, 48)
    draw = np.random.default_rng(8)
    for _ in range(6):
        one, two = np.zeros((2, 48, 48), np.int64)
        for x, y in draw.integers(-3, 4, (9, 2)) * 5:
            value = draw.integers(1, 256)
            one[24 - y, 24 + x] = value
            two[24 - (4 * x + 3 * y) // 5, 24 + (3 * x - 4 * y) // 5] = value
        exact = exact_features(sensor, one, PAPER)
        assert exact_features(sensor, two, PAPER) == exact
        wanted = [float(value) for value in exact]
        found = FramePlan(sensor, PAPER)(two).values[:, 0]
        assert found == pytest.approx(wanted, rel=1e-11)


def test_a_quarter_turn_turns_the_angle() -> None:
    cells = np.zeros((8, 8), np.uint8)
    cells[3, 1:7] = 90
    sensor = Sensor(8, 8)
    flat = FramePlan(sensor, ["angle", "cos2"])(cells).values[:, 0]
    upright = FramePlan(sensor, ["angle", "cos2"])(np.rot90(cells)).values[:, 0]
    assert flat.tolist() == [0.0, 1.0]
    assert upright.tolist() == [90.0, -1.0]


def test_a_diagonal_has_an_angle_of_exactly_45_degrees() -> None:
    rising = np.fliplr(np.eye(6, dtype=np.uint8))
    sensor = Sensor(6, 6, full=1)
    assert FramePlan(sensor, ["angle"])(rising).values.tolist() == [[45.0]]
    falling = np.eye(6, dtype=np.uint8)
    assert FramePlan(sensor, ["angle"])(falling).values.tolist() == [[-45.0]]


def test_where_nothing_presses_every_feature_is_0_and_none_is_missing() -> None:
    sensor = Sensor(4, 4, threshold=3, baseline=(7,) * 16)
    names = [*FEATURES, "log S1", "S10 / force", "cell r1 c1", "block r0 c0 of 2x2"]
    found = FramePlan(sensor, names)(np.full((2, 4, 4), 10))
    assert not found.values.any()
    assert not found.is_pressed.any()


def test_only_the_sums_that_features_need_are_taken() -> None:
    def sums(names: Sequence[str]) -> list[str]:
        return [one.name for one in frame_program(Sensor(8, 8), names).sums]

    assert sums(["force"]) == ["sum 00"]
    assert sums(["S1"]) == ["sum 00", "sum 10", "sum 01", "sum 20", "sum 02"]
    assert sum_name(3, 1) not in sums(["S1", "S9"])
    assert sums(["area"]) == ["sum 00", "area"]


def test_a_tree_on_s1_and_s9_computes_neither_c30_nor_c40() -> None:
    sensor = Sensor(16, 16)
    both = frame_program(sensor, ["S1", "S9"]).program.size
    more = frame_program(sensor, ["S1", "S9", "Re C30", "Re C40"]).program.size
    alone = frame_program(sensor, ["S9"]).program.size
    assert both - alone < 20
    assert more > both + 50


def test_a_sensor_whose_sums_are_not_exact_is_refused() -> None:
    with pytest.raises(InvalidModelError) as caught:
        frame_program(Sensor(256, 256, full=65535), ["S9"])
    assert str(caught.value) == (
        "a sensor of 256 x 256 cells up to 65535 is too large for exact moments "
        "of order 3"
    )
    frame_program(Sensor(256, 256, full=65535), ["S1"])


def test_a_block_outside_the_sensor_is_refused() -> None:
    for name, base in (
        ("block r2 c0 of 2x2", "block r2 c0 of 2x2"),
        ("log block r0 c0 of 9x1", "block r0 c0 of 9x1"),
        ("cell r8 c0", "cell r8 c0"),
    ):
        with pytest.raises(InvalidModelError) as caught:
            frame_program(Sensor(8, 8), [name])
        text = f"{base!r} lies outside a sensor of 8 x 8 cells"
        assert str(caught.value) == text


def test_blocks_share_all_cells_among_them() -> None:
    sensor = Sensor(7, 5)
    frame = np.arange(35).reshape(7, 5)
    names = [f"block r{r} c{c} of 3x2" for r in range(3) for c in range(2)]
    means = FramePlan(sensor, names)(frame).values[:, 0]
    sizes = [h * w for h in (2, 2, 3) for w in (2, 3)]
    assert means @ sizes == pytest.approx(frame.sum() / 255, rel=1e-15)
