"""The paper's task on the simulated sensor."""

from __future__ import annotations

import numpy as np
import pytest
from experiment_simulated import TABLE_3, paper_task
from experiment_study import experiment
from press_shapes import OBJECTS


def test_presses_to_learn_from_and_to_test_on_are_as_many_and_others() -> None:
    task = paper_task(repeats=2, presses=3)
    for split in task.splits:
        assert np.bincount(task.codes[split.train]).tolist() == [3] * 7
        assert np.bincount(task.codes[split.test]).tolist() == [3] * 7
        assert not set(split.train.tolist()) & set(split.test.tolist())
    frames = task.frames.reshape(len(task.frames), -1)
    assert len(np.unique(frames, axis=0)) == len(frames)


def test_a_repeat_is_that_of_its_seed() -> None:
    two, one = (
        paper_task(repeats=2, presses=2),
        paper_task(seed=1, repeats=1, presses=2),
    )
    later = two.splits[1]
    assert later.name == one.splits[0].name == "seed 1"
    assert (two.frames[later.test] == one.frames[one.splits[0].test]).all()


def test_the_classes_are_those_of_table_3() -> None:
    assert set(TABLE_3) == set(OBJECTS)
    assert sum(TABLE_3.values()) == 314


def test_numbers_out_of_their_range_are_refused() -> None:
    with pytest.raises(ValueError, match="seed") as stated:
        paper_task(repeats=0)
    assert str(stated.value) == (
        "the seed is at least 0, and repeats and presses at least 1, not 0, 0 and 50"
    )


def test_few_presses_are_distinguished_much_better_than_by_chance() -> None:
    study = experiment(paper_task(repeats=1, presses=20)).study
    assert study.accuracy > 0.7
    assert study.unit == "press"
