"""An experiment as text: what is left out of it, and what is never left out."""

from __future__ import annotations

import csv
import io

import msgspec
import pytest
from experiment_pairing import paired
from experiment_report import confusion_csv, experiment_lines
from experiment_study import Peer, Study, Trial

STUDY = Study(
    "touch",
    "two people",
    "each is left out",
    "2 x 2 cells",
    "subject",
    frames=9,
    clipped=1,
    negative=2,
    features="area, peak",
    names=("area", "peak"),
    settings="paper mode",
    classes=("a, b", 'the "c"'),
    accuracy=0.5,
    spread=0.1,
    commonest=0.4,
    trials=(
        Trial("subject 1", 5, 1, 4, 2, 0.5, False, 2, 1),
        Trial("subject 2", 4, 0, 5, 3, 0.6, True, 3, 2),
    ),
    confusion=((3, 1, 1, 0), (0, 2, 0, 2)),
    peers=(Peer("LDA", 0.5, paired([1, 2], [0, 2]), 3),),
)


def test_whatever_is_clipped_or_left_out_is_reported() -> None:
    lines = [*experiment_lines(STUDY)]
    assert "clipped   1 reading above what a cell can take, read as that" in lines
    assert "clipped   2 readings below 0, read as 0" in lines
    assert "left out  1 empty frame to learn from" in lines
    assert "learnt    paper mode; 2 to 3 leaves, which ask for 1 to 2 features" in lines
    assert "          60.0 % of the 1 on whom nothing was chosen" in lines
    (lda,) = [line for line in lines if line.startswith("LDA")]
    assert lda.split() == (
        ["LDA", "50.0", "%", "(3", "frames", "unanswered)", "1", "0", "1", "1"]
    )


def test_frames_without_an_answer_have_columns_of_their_own() -> None:
    lines = [*experiment_lines(STUDY)]
    (head,) = [line for line in lines if line.startswith("was")]
    assert head.endswith("(nothing)  (unknown)")


def test_a_table_of_many_classes_is_in_the_file_alone() -> None:
    many = tuple(f"class {k}" for k in range(13))
    table = tuple(tuple(int(k == j) for j in range(15)) for k in range(13))
    study = msgspec.structs.replace(STUDY, classes=many, confusion=table)
    assert not [line for line in experiment_lines(study) if line.startswith("was")]
    assert confusion_csv(study).count("\n") == 14


def test_names_with_commas_and_quotes_come_back_from_the_file() -> None:
    rows = [*csv.reader(io.StringIO(confusion_csv(STUDY)))]
    assert rows == [
        ["class", "a, b", 'the "c"', "(nothing)", "(unknown)"],
        ["a, b", "3", "1", "1", "0"],
        ['the "c"', "0", "2", "0", "2"],
    ]


@pytest.mark.parametrize("count", [12, 13])
def test_many_features_are_reported_by_the_first_and_the_last(count: int) -> None:
    names = tuple(f"cell r0 c{k}" for k in range(count))
    study = msgspec.structs.replace(STUDY, features="cells", names=names)
    (line,) = [line for line in experiment_lines(study) if line.startswith("features")]
    shown = ", ".join(names) if count == 12 else "cell r0 c0, ..., cell r0 c12"
    assert line == f"features  cells ({count}: {shown})"
