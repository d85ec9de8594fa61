"""Every way from frame to class: its answers, however it is called, and its errors."""

from fractions import Fraction

import numpy as np
import numpy.typing as npt
import pytest
from exact_features import ALLOWED, errors, exact_features

from fuzzytree.errors import TableError
from fuzzytree.tactile.features.aimed import aimed_frames
from fuzzytree.tactile.features.names import FEATURES
from fuzzytree.tactile.recognition.runners import as_sent, plain_runner, runners
from fuzzytree.tactile.runtimes.frames import FramePlan
from fuzzytree.tactile.sensor import Sensor
from tests.tactile.frame_models import PLAIN, SMALL, WIDE, learnt_tree, raw_rules

MIXED = ("force", "area", "peak", "angle", "log S1", "cell r1 c3", "block r1 c0 of 2x2")


@pytest.mark.parametrize("sensor", [PLAIN, WIDE], ids=["16x16", "5x7"])
@pytest.mark.parametrize("reject", [0.0, 0.5])
def test_calls_of_every_kind_get_the_same_answers(
    sensor: Sensor, reject: float
) -> None:
    tree = learnt_tree(sensor, MIXED)
    model = raw_rules(tree) if reject else tree
    frames = aimed_frames(sensor, 12, seed=5)
    ways, _ = runners(model, sensor, reject)
    for run in (*ways.values(), plain_runner(model, sensor, reject)):
        whole = run(frames)
        alone = [run(frames[place : place + 1]) for place in range(len(frames))]
        some = run(as_sent(sensor, np.asfortranarray(frames[::3])))
        for name, answers in whole.items():
            assert texts(np.concatenate([one[name] for one in alone])) == texts(answers)
            assert texts(some[name]) == texts(answers[::3])
        assert not any(map(len, run(frames[:0]).values()))


def texts(answers: npt.NDArray[np.generic]) -> list[str]:
    """Return answers so that every bit counts."""
    return [repr(one) for one in answers.tolist()]


def test_frames_of_another_size_are_refused() -> None:
    with pytest.raises(TableError) as caught:
        as_sent(SMALL, np.zeros((1, 4, 6), np.uint8))
    assert str(caught.value) == "a frame of 4 x 6 cells does not fit a sensor of 6 x 4"


@pytest.mark.heavy
@pytest.mark.parametrize("sensor", [PLAIN, WIDE, SMALL], ids=["16x16", "5x7", "6x4"])
def test_every_feature_is_the_exact_one_but_for_rounding(sensor: Sensor) -> None:
    names = [*FEATURES, *(f"log {name}" for name in FEATURES)]
    names += ["S10 / force", "log S5 / force", "cell r1 c1 / force"]
    frames = aimed_frames(sensor, 60, seed=8)
    values = FramePlan(sensor, names)(frames).values.T.tolist()
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


def test_frames_become_what_a_sensor_sends() -> None:
    sensor = Sensor(1, 3, full=1000)
    found = as_sent(sensor, np.array([[-5, 7, 90_000]]))
    assert found.dtype == np.uint16
    assert found.tolist() == [[[0, 7, 1000]]]
