"""Frames, classes and divisions, from files of the project and of one's own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from experiment_tasks import (
    CHOSEN_ON,
    KNOWN,
    data_folder,
    file_task,
    known_task,
)

from fuzzytree.errors import ReadError, TableError
from fuzzytree.tactile.presses import labelled
from fuzzytree.tactile.sensor import Sensor
from tests.tactile.archives import write_presses


def saved(path: Path, *, subject: list[int] | None, names: str = "ab") -> Path:
    """Write four frames of two classes."""
    frames = np.zeros((4, 2, 2), np.uint8)
    frames[:, 0, 0] = [9, 8, 200, 210]
    write_presses(
        path,
        labelled(
            frames,
            Sensor(2, 2),
            np.array([0, 0, 1, 1]),
            tuple(names),
            np.array(subject or [], np.int64),
        ),
    )
    return path


@pytest.mark.parametrize("name", KNOWN)
def test_a_task_of_the_project_leaves_each_person_out(name: str) -> None:
    task = known_task(name)
    assert len(task.splits) == len(np.unique(task.subject))
    assert set(np.unique(task.codes).tolist()) == set(range(len(task.classes)))
    assert set(CHOSEN_ON[KNOWN[name].file]) < set(task.subject.tolist())


def test_the_classes_are_those_of_the_task() -> None:
    assert known_task("postures").classes == ("supine", "left", "right")
    assert known_task("touch").classes == ("thumb", "other finger")
    task = known_task("postures-17")
    assert len(task.classes) == 17
    assert task.classes[0] == "supine_1"


def test_the_license_stands_beside_the_frames() -> None:
    text = (data_folder() / "README.md").read_text("utf-8")
    for known in KNOWN.values():
        assert f"`{known.file}` {known.sha256}" in text
    assert "ODC-By" in text
    assert "Copyright (c) 2018 Interaction Lab" in text


def test_an_unknown_task_is_reported_with_those_there_are() -> None:
    with pytest.raises(ValueError, match="there is no task 'hands'") as stated:
        known_task("hands")
    assert str(stated.value) == (
        "there is no task 'hands'; there is postures, postures-17, touch, touch-fingers"
    )


def test_frames_that_are_not_there_are_reported_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(ReadError) as stated:
        known_task("touch", tmp_path)
    assert str(stated.value) == (
        f"{tmp_path}/capfinger_27x15.npz: is not there: the frames of 'touch' lie in "
        "examples/tactile/data; name the folder with --data"
    )


def test_another_file_of_that_name_is_refused(tmp_path: Path) -> None:
    saved(tmp_path / "capfinger_27x15.npz", subject=None)
    with pytest.raises(ReadError, match="is not the file that belongs to 'touch'"):
        known_task("touch", tmp_path)


def test_frames_without_subjects_are_not_divided_at_random(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.npz", subject=None)
    with pytest.raises(TableError) as stated:
        file_task(path)
    assert str(stated.value) == (
        f"{path}: has no array 'subject', and frames that follow one another are "
        "nearly alike, so they are not divided at random\n  name other frames to test "
        "on with --test, or add the subjects"
    )


def test_other_frames_are_tested_on(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.npz", subject=None)
    other = saved(tmp_path / "b.npz", subject=[1, 2, 3, 4])
    task = file_task(path, test=other)
    (split,) = task.splits
    assert split.train.tolist() == [0, 1, 2, 3]
    assert split.test.tolist() == [4, 5, 6, 7]
    assert not task.is_whole


def test_other_frames_of_the_same_subject_are_refused(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.npz", subject=[1, 2, 1, 2])
    other = saved(tmp_path / "b.npz", subject=[2, 3, 2, 3])
    with pytest.raises(TableError, match="subject 2 is both in"):
        file_task(path, test=other)


def test_other_frames_with_other_classes_are_refused(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.npz", subject=None)
    other = saved(tmp_path / "b.npz", subject=None, names="ac")
    with pytest.raises(TableError) as stated:
        file_task(path, test=other)
    assert str(stated.value) == f"{other}: has other classes than {path}"


def test_an_unknown_array_of_classes_is_reported(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.npz", subject=[1, 2, 1, 2])
    with pytest.raises(TableError) as stated:
        file_task(path, label="kind")
    assert str(stated.value) == (
        f"{path}: no class is known; name the array with --label"
    )
