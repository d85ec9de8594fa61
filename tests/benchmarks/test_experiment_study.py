"""Experiments: what is learnt from, what is counted, and who else was asked."""

from __future__ import annotations

import dataclasses
import importlib.util

import experiment_peers as peers
import numpy as np
import pytest
from experiment_choosing import CANDIDATES, Candidate, chosen
from experiment_peers import PEERS, peer_answers
from experiment_splits import leave_one_out
from experiment_study import experiment
from experiment_tasks import Task, known_task

from fuzzytree.errors import LearningError, MissingExtraError, TableError
from fuzzytree.learning import LearningSettings
from fuzzytree.tactile.sensor import Sensor

has_sklearn = pytest.mark.skipif(
    not importlib.util.find_spec("sklearn"), reason="needs scikit-learn"
)


def bars(subjects: int = 3, each: int = 8) -> Task:
    """Return flat and upright bars of several people, and one frame without any."""
    random = np.random.default_rng(5)
    frames, codes = [], []
    for k in range(subjects * each):
        frame = np.zeros((6, 6), np.int64)
        row, column = random.integers(0, 3, 2)
        if k % 2:
            frame[row, 1 : random.integers(4, 6)] = random.integers(90, 200)
        else:
            frame[1 : random.integers(4, 6), column] = random.integers(90, 200)
        frames.append(frame)
        codes.append(k % 2)
    frames[0][:] = 0
    frames[1][5, 5] = 999
    frames[2][5, 5] = -7
    subject = np.repeat(np.arange(subjects) + 1, each)
    return Task(
        "bars",
        "bars",
        "by subject",
        Sensor(6, 6),
        np.array(frames),
        np.array(codes),
        ("upright", "flat"),
        subject,
        leave_one_out(subject),
        "axis, area",
    )


def test_an_experiment_counts_every_frame_once() -> None:
    study = experiment(bars()).study
    assert sum(map(sum, study.confusion)) == study.frames == 24
    assert [trial.tested for trial in study.trials] == [8, 8, 8]
    right = sum(line[place] for place, line in enumerate(study.confusion))
    assert right == sum(trial.right for trial in study.trials)
    assert study.accuracy == np.mean([t.right / 8 for t in study.trials])


def test_an_empty_frame_is_no_class_and_is_not_learnt_from() -> None:
    study = experiment(bars()).study
    assert study.confusion[0][2] == 1  # upright, and nothing was there
    assert [trial.left_out for trial in study.trials] == [0, 1, 1]
    assert study.trials[0].right < 8


def test_readings_that_a_sensor_cannot_give_are_counted() -> None:
    study = experiment(bars()).study
    assert (study.clipped, study.negative) == (1, 1)


def test_who_is_tested_does_not_change_what_is_learnt() -> None:
    task = bars()
    first = experiment(task).study
    codes = np.where(task.subject == 2, 1 - task.codes, task.codes)
    second = experiment(dataclasses.replace(task, codes=codes)).study
    assert first.trials[1].leaves == second.trials[1].leaves
    assert first.trials[1].right + second.trials[1].right == 8


def test_the_tree_is_learnt_from_everyone_or_from_the_first_division() -> None:
    task = bars()
    whole = experiment(task).tree
    part = experiment(dataclasses.replace(task, is_whole=False)).tree
    assert sum(leaf.support or 0 for leaf in whole.leaves) == 23
    assert sum(leaf.support or 0 for leaf in part.leaves) == 16


def test_the_cheaper_of_equal_features_is_requested() -> None:
    task = bars()
    loud = np.where(task.frames > 0, 60 + 90 * task.codes[:, None, None], 0)
    task = dataclasses.replace(task, frames=loud)
    for text in ("log peak, peak", "peak, log peak"):
        tree = experiment(
            task, features=text, settings=LearningSettings(mode="paper")
        ).tree
        assert tree.inputs == ("peak",)


def test_a_class_that_only_the_tested_person_has_is_mistaken_and_no_other() -> None:
    task = bars()
    codes = np.where(task.subject == 2, 0, 2 * task.codes)
    codes[task.subject == 2] = 1
    study = experiment(
        dataclasses.replace(task, codes=codes, classes=("upright", "odd", "flat"))
    ).study
    assert study.trials[1].right == 0
    assert study.confusion[1][1] == 0
    assert sum(study.confusion[1]) == 8


def test_the_same_experiment_gives_the_same_study() -> None:
    assert experiment(bars()) == experiment(bars())


def test_settings_are_chosen_by_subjects_that_are_not_tested() -> None:
    study = experiment(bars(), choose=CANDIDATES[:2]).study
    texts = {one.text for one in CANDIDATES[:2]}
    assert {trial.settings for trial in study.trials} <= texts
    assert study.settings == "chosen in each division"


def test_the_settings_that_carry_over_to_other_people_are_chosen() -> None:
    random = np.random.default_rng(1)
    values = random.normal(size=(2, 120))
    codes = (values.sum(axis=0) > 0).astype(np.int64)
    subject = np.repeat(np.arange(6), 20)
    few = (Candidate(0.1, 1e9), Candidate(0.1, 2.0))
    assert chosen(values, codes, subject, LearningSettings(), few) == few[1]


def test_frames_without_pressure_are_reported_with_the_division() -> None:
    task = bars()
    with pytest.raises(LearningError) as stated:
        experiment(dataclasses.replace(task, frames=0 * task.frames))
    assert str(stated.value) == (
        "without subject 1: nothing presses on any of 16 frames"
    )


def test_one_class_to_learn_from_is_reported_with_the_division() -> None:
    task = bars(subjects=2)
    with pytest.raises(LearningError) as stated:
        experiment(dataclasses.replace(task, codes=task.subject - 1))
    assert str(stated.value) == (
        "without subject 1: cannot learn from one class: every row is 'flat'"
    )


def test_settings_are_not_chosen_where_subjects_are_not_known() -> None:
    task = dataclasses.replace(bars(), subject=np.zeros(0, np.int64))
    with pytest.raises(TableError) as stated:
        experiment(task, choose=CANDIDATES)
    assert str(stated.value) == (
        "bars: settings are chosen by leaving subjects out twice, which needs 3 at "
        "least, not 0"
    )


@has_sklearn
def test_peers_are_paired_by_subject_or_by_press() -> None:
    task = bars()
    by_subject = experiment(task, peers=["LDA", "GaussianNB"]).study.peers
    assert [peer.name for peer in by_subject] == ["LDA", "GaussianNB"]
    for peer in by_subject:
        assert peer.pairing.better + peer.pairing.worse + peer.pairing.equal == 3
    presses = dataclasses.replace(task, subject=np.zeros(0, np.int64))
    (peer,) = experiment(presses, peers=["LDA"]).study.peers
    assert peer.pairing.better + peer.pairing.worse + peer.pairing.equal == 24


@has_sklearn
def test_frames_that_a_peer_gives_no_class_are_counted() -> None:
    random = np.random.default_rng(0)
    codes = np.tile([0, 1], 6)
    same = codes[None].astype(np.float64)
    assert peer_answers("LDA", same, codes, random.normal(size=(1, 3))).tolist() == (
        [-1, -1, -1]
    )


@has_sklearn
@pytest.mark.parametrize("name", PEERS)
def test_every_peer_distinguishes_two_heaps(name: str) -> None:
    codes = np.tile([0, 1], 20)
    values = np.random.default_rng(0).normal(0.0, 1.0, (2, 40)) + 1e6 * codes
    values = np.vstack([values, np.ones(40)])
    found = peer_answers(name, values, codes, values)
    assert found.tolist() == codes.tolist()


def test_without_the_extra_a_peer_says_what_is_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(peers, "are_there", lambda: False)
    with pytest.raises(MissingExtraError) as stated:
        peer_answers("LDA", np.ones((1, 2)), np.array([0, 1]), np.ones((1, 1)))
    assert str(stated.value) == (
        "comparing with other learners needs scikit-learn: "
        "pip install 'scikit-learn>=1.6'"
    )


@pytest.mark.heavy
def test_a_part_of_the_mat_is_recognised_better_than_by_its_commonest_class() -> None:
    task = known_task("postures")
    few = np.flatnonzero(task.subject <= 4)
    subject = task.subject[few]
    task = dataclasses.replace(
        task,
        frames=task.frames[few],
        codes=task.codes[few],
        subject=subject,
        splits=leave_one_out(subject)[:1],
        is_whole=False,
    )
    study = experiment(task, features="blocks:8x4 / force").study
    assert study.accuracy > 0.75
    assert study.clipped > 0
