"""From frames to what lies on the sensor."""

from __future__ import annotations

import numpy as np
import pytest

from fuzzytree import table
from fuzzytree.api.verbs import learn
from fuzzytree.errors import TableError
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.tactile.recognition.recogniser import Recogniser, State, check_inputs
from fuzzytree.tactile.runtimes.frames import FramePlan
from fuzzytree.tactile.sensor import Cells, Sensor

SENSOR = Sensor(8, 8, threshold=2)
NAMES = ["S1", "force"]


def squares(count: int, size: int, seed: int) -> Cells:
    draw = np.random.default_rng(seed)
    frames = np.zeros((count, 8, 8), np.uint8)
    for frame in frames:
        row, column = draw.integers(0, 8 - size, 2)
        frame[row : row + size, column : column + size] = draw.integers(80, 120)
    return frames


def tree() -> FuzzyTree:
    frames = np.concatenate([squares(20, 2, 0), squares(20, 5, 1)])
    values = FramePlan(SENSOR, NAMES)(frames).values.T
    labels = ["small"] * 20 + ["large"] * 20
    return learn(table(values, columns=NAMES), target=labels)


def test_a_tree_recognises_what_it_has_learnt() -> None:
    found = Recogniser(tree(), SENSOR)(
        np.concatenate([squares(5, 2, 7), squares(5, 5, 8)])
    )
    assert [found.label(k) for k in range(10)] == ["small"] * 5 + ["large"] * 5
    assert (found.strengths.argmax(0) == found.codes).all()


def test_an_empty_frame_shows_nothing_and_has_no_strengths() -> None:
    found = Recogniser(tree(), SENSOR)(np.full((8, 8), 2))
    assert found.label() == "nothing"
    assert found.states.tolist() == [State.NOTHING]
    assert found.codes.tolist() == [-1]
    assert not found.strengths.any()


def test_what_no_rule_knows_well_enough_is_unknown() -> None:
    full = np.full((8, 8), 250)
    assert Recogniser(tree(), SENSOR)(full).label() != "unknown"
    assert Recogniser(tree(), SENSOR, reject=0.05)(full).label() == "unknown"
    known = Recogniser(tree(), SENSOR, reject=0.05)(squares(1, 5, 3))
    assert known.label() == "large"


def test_raw_rules_answer_with_their_own_strengths() -> None:
    rules = rules_from_tree(tree(), "raw")
    frames = squares(4, 2, 5)
    found = Recogniser(rules, SENSOR)(frames)
    same = Recogniser(tree(), SENSOR)(frames)
    assert (found.strengths == same.strengths).all()


def test_relative_rules_cannot_reject() -> None:
    rules = rules_from_tree(tree())
    with pytest.raises(ValueError, match="relative rules reject nothing") as caught:
        Recogniser(rules, SENSOR, reject=0.1)
    assert str(caught.value) == (
        "tree: relative rules reject nothing, for one of them always has the strength "
        "1; give the raw rules"
    )


@pytest.mark.parametrize("reject", [-0.1, 1.5, float("nan")])
def test_a_floor_outside_0_to_1_is_refused(reject: float) -> None:
    with pytest.raises(ValueError, match="reject lies in 0 to 1"):
        Recogniser(tree(), SENSOR, reject=reject)


def test_a_model_for_other_features_is_refused() -> None:
    wine = learn(
        table(np.array([[1.0], [2.0]]), columns=["flavanoids"]), target=["a", "b"]
    )
    with pytest.raises(TableError) as caught:
        check_inputs(wine)
    assert str(caught.value).startswith(
        "tree uses other features: 'flavanoids' is no feature of a frame"
    )


def test_a_frame_of_another_size_is_refused() -> None:
    with pytest.raises(TableError) as caught:
        Recogniser(tree(), SENSOR)(np.zeros((4, 4), np.uint8))
    assert str(caught.value) == "a frame of 4 x 4 cells does not fit a sensor of 8 x 8"
