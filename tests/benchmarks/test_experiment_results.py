"""What the page of experiments states, within what chance allows."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from experiment_peers import peer_answers
from experiment_simulated import IDEAL, paper_task
from experiment_study import Study, experiment
from experiment_tasks import known_task

from fuzzytree.learning import LearningSettings
from fuzzytree.tactile.features.names import names_of
from fuzzytree.tactile.runtimes.frames import FramePlan

pytestmark = pytest.mark.heavy


def is_within(study: Study, stated: float) -> bool:
    """Return whether a study's mean is within three standard errors of a figure."""
    error = study.spread / len(study.trials) ** 0.5
    return bool(abs(study.accuracy - stated) <= 3 * error + 0.001)


@pytest.mark.parametrize(
    ("name", "features", "settings", "stated", "floor"),
    [
        ("touch", None, None, 0.859, 0.8),
    ],
)
def test_people_who_were_left_out_are_recognised(
    name: str,
    features: str | None,
    settings: LearningSettings | None,
    stated: float,
    floor: float,
) -> None:
    task = known_task(name)
    study = experiment(task, features=features, settings=settings).study
    assert is_within(study, stated), study.accuracy
    assert study.accuracy > floor


def test_three_postures_are_recognised_as_the_page_states_beside_others() -> None:
    pytest.importorskip("sklearn")
    study = experiment(known_task("postures"), peers=["random forest", "LDA"]).study
    assert is_within(study, 0.914), study.accuracy
    forest, lda = study.peers
    assert forest.pairing.worse > forest.pairing.better
    assert forest.pairing.chance < 0.01
    assert lda.pairing.better > lda.pairing.worse
    assert lda.pairing.chance > 0.05


def test_what_is_mistaken_on_the_simulated_sensor_is_the_angle() -> None:
    study = experiment(paper_task()).study
    shapes = [name.partition("-")[0] for name in study.classes]
    table = np.array(study.confusion)[:, : len(shapes)]
    is_same = np.array([[one == other for other in shapes] for one in shapes])
    assert table[~is_same].sum() <= 0.02 * table.sum()
    assert 0.8 < study.accuracy < 0.99


def test_orientation_features_distinguish_angles_on_either_sensor() -> None:
    for physics in (paper_task(repeats=2), paper_task(repeats=2, physics=IDEAL)):
        study = experiment(physics, features="log orientation / force").study
        assert study.accuracy > 0.97


def test_on_an_even_sensor_invariants_distinguish_shapes_and_few_angles() -> None:
    task = paper_task(physics=IDEAL)
    plain = experiment(task).study
    assert 4 / 7 - 0.05 < plain.accuracy < 0.75  # 4 / 7: shapes, and no angle
    scaled = experiment(task, features="log paper / force").study
    assert is_within(scaled, 0.846), scaled.accuracy
    assert scaled.accuracy > plain.accuracy + 0.05


def test_the_learner_of_the_paper_exceeds_the_papers_rate() -> None:
    study = experiment(paper_task(), settings=LearningSettings(mode="paper")).study
    assert is_within(study, 0.926), study.accuracy
    assert all(trial.features <= 6 for trial in study.trials)


def test_frames_divided_at_random_would_flatter() -> None:
    pytest.importorskip("sklearn")
    task = known_task("postures-17")
    values = FramePlan(task.sensor, names_of("log paper"))(task.frames).values
    place = np.random.default_rng(0).integers(0, 5, len(task.frames))
    known, new = place > 0, place == 0
    given = peer_answers(
        "random forest", values[:, known], task.codes[known], values[:, new]
    )
    at_random = float(np.mean(given == task.codes[new]))
    few = dataclasses.replace(task, splits=task.splits[:4], is_whole=False)
    study = experiment(few, features="log paper", peers=["random forest"]).study
    assert at_random > 0.8
    assert study.peers[0].accuracy < 0.5
