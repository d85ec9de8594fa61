"""Every way from frame to class is held against the others; what differs is told."""

from fractions import Fraction

import numpy as np
import pytest
from exact_features import ALLOWED, errors, exact_features

from fuzzytree.errors import TableError
from fuzzytree.tactile.features.aimed import aimed_frames
from fuzzytree.tactile.features.names import FEATURES
from fuzzytree.tactile.recognition import agreement
from fuzzytree.tactile.recognition.agreement import check_frames_agree
from fuzzytree.tactile.recognition.runners import Answers, Runner, as_sent, runners
from fuzzytree.tactile.runtimes.frames import frame_features
from fuzzytree.tactile.sensor import Cells, Sensor
from fuzzytree.testing import random_tree
from tests.tactile.frame_models import PLAIN, SMALL, WIDE, learnt_tree, raw_rules

MIXED = ("force", "area", "peak", "angle", "log S1", "cell r1 c3", "block r1 c0 of 2x2")


@pytest.mark.parametrize("sensor", [PLAIN, WIDE], ids=["16x16", "5x7"])
def test_every_way_gives_the_same_bits_and_classes(sensor: Sensor) -> None:
    tree = learnt_tree(sensor, MIXED)
    found = check_frames_agree(tree, sensor, aimed_frames(sensor, 40, seed=5))
    assert found.ok
    pairs = {(one.representation, one.against) for one in found.comparisons}
    assert {("numpy", "plain Python"), ("onnx", "numpy"), ("c", "numpy")} < pairs
    assert found.shown.nothing > 0
    assert found.shown.saturated > 0


@pytest.mark.heavy
def test_what_is_too_weak_is_counted_as_unknown() -> None:
    rules = raw_rules(learnt_tree(PLAIN, ("S1", "S9")))
    found = check_frames_agree(rules, PLAIN, reject=0.5)
    assert found.ok
    assert 0 < found.shown.unknown < found.shown.frames
    assert found.shown.aimed == found.shown.frames


@pytest.mark.heavy
@pytest.mark.parametrize("sensor", [PLAIN, WIDE, SMALL], ids=["16x16", "5x7", "6x4"])
def test_every_feature_is_the_exact_one_but_for_rounding(sensor: Sensor) -> None:
    names = [*FEATURES, *(f"log {name}" for name in FEATURES)]
    names += ["S10 / force", "log S5 / force", "cell r1 c1 / force"]
    frames = aimed_frames(sensor, 60, seed=8)
    values = frame_features(sensor, frames, names).values.T.tolist()
    for frame, found in zip(frames, values, strict=True):
        exact = exact_features(sensor, frame, names)
        assert max(errors(sensor, frame, names, found, exact)) < ALLOWED


def test_an_error_is_measured_against_what_could_cancel() -> None:
    cells = np.zeros((5, 5), np.uint8)
    cells[1:4, 1:4] = 255  # S2 is 0, of two parts of 12
    found = errors(Sensor(5, 5), cells, ["S2"], [1.44], [Fraction(0)])
    assert found == pytest.approx((0.01,))
    none = np.zeros((5, 5), np.uint8)
    assert errors(Sensor(5, 5), none, ["S2"], [1.0], [Fraction(0)]) == (np.inf,)
    turned = errors(Sensor(5, 5), cells, ["angle"], [-90.0], [Fraction(90)])
    assert turned == (0.0,)


def turned(one: Runner) -> Runner:
    """Return a runner that is wrong about its third frame."""

    def answer(frames: Cells) -> Answers:
        found = one(frames)
        features = found["features"].copy()
        features[2:3, 0] = np.nextafter(features[2:3, 0], np.inf)
        return {**found, "features": features}

    return answer


def test_a_bit_that_differs_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    tree = learnt_tree(SMALL, ("area",))

    def broken(
        *given: object, **settings: object
    ) -> tuple[dict[str, Runner], list[str]]:
        ways, missing = runners(tree, SMALL)
        return ways | {"onnx": turned(ways["onnx"])}, missing

    monkeypatch.setattr(agreement, "runners", broken)
    found = check_frames_agree(tree, SMALL)
    wrong = [one for one in found.comparisons if one.verdict == "DISAGREES"]
    assert [(one.representation, one.against, one.differing) for one in wrong[:2]] == [
        ("onnx", "numpy", 1),
        ("onnx", "plain Python", 1),
    ]
    assert wrong[0].detail == ("frame 2: area 24.000000000000004, not 24.0",)


def test_frames_of_another_size_are_refused_by_every_way() -> None:
    for run in runners(learnt_tree(SMALL, ("area",)), SMALL)[0].values():
        with pytest.raises(TableError) as caught:
            run(np.zeros((1, 4, 6), np.uint8))
        assert str(caught.value) == (
            "a frame of 4 x 6 cells does not fit a sensor of 6 x 4"
        )


def test_frames_become_what_a_sensor_sends() -> None:
    sensor = Sensor(1, 3, full=1000)
    found = as_sent(sensor, np.array([[-5, 7, 90_000]]))
    assert found.dtype == np.uint16
    assert found.tolist() == [[[0, 7, 1000]]]


def test_a_model_for_other_features_is_refused_by_its_name() -> None:
    model = random_tree(1)
    with pytest.raises(TableError, match=f"^{model.name} uses other features: "):
        check_frames_agree(model, SMALL)
