"""Frames to learn from and to test on never share a subject."""

from __future__ import annotations

import numpy as np
import pytest
from experiment_splits import check_apart, in_groups, leave_one_out

from fuzzytree.errors import TableError


def test_no_subject_is_on_both_sides_and_every_frame_is_tested_once() -> None:
    subject = np.random.default_rng(0).integers(3, 9, 60)
    splits = leave_one_out(subject)
    for split in splits:
        assert not np.intersect1d(subject[split.train], subject[split.test]).size
        assert len(split.train) + len(split.test) == 60
        assert split.name == f"subject {subject[split.test[0]]}"
    tested = np.concatenate([split.test for split in splits])
    assert sorted(tested.tolist()) == list(range(60))


def test_groups_hold_whole_subjects() -> None:
    subject = np.repeat([9, 4, 7, 1, 2], 3)
    splits = in_groups(subject, 2)
    assert [set(subject[one.test].tolist()) for one in splits] == [{1, 4, 9}, {2, 7}]


def test_there_are_no_more_groups_than_subjects() -> None:
    assert len(in_groups(np.array([1, 2, 1]), 4)) == 2


def test_one_subject_cannot_be_left_out() -> None:
    with pytest.raises(TableError) as stated:
        leave_one_out(np.array([3, 3]))
    assert str(stated.value) == (
        "all frames are of one subject; leaving one out needs two at least"
    )


@pytest.mark.parametrize(
    ("test", "who"), [([2, 9], "subject 2 is"), ([2, 1], "2 subjects are")]
)
def test_a_subject_on_both_sides_is_refused(test: list[int], who: str) -> None:
    with pytest.raises(TableError) as stated:
        check_apart(np.array([1, 2]), np.array(test), ("a.npz", "b.npz"))
    assert str(stated.value) == (
        f"{who} both in a.npz and in b.npz: frames of one subject are nearly alike, "
        "and what is tested must not have been learnt from"
    )


def test_unknown_subjects_are_not_compared() -> None:
    check_apart(np.array([1, 2]), np.zeros(0, np.int64), ("a.npz", "b.npz"))
