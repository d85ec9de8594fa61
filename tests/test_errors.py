"""Every error can be caught by its name in `ft`, and by the built-in that fits."""

from __future__ import annotations

import copy
import errno
import pickle
from pathlib import Path

import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree import errors
from fuzzytree.errors import FuzzyTreeError
from fuzzytree.files import open_atomically

ERRORS = [
    kind
    for kind in vars(errors).values()
    if isinstance(kind, type) and issubclass(kind, FuzzyTreeError)
]


@pytest.mark.parametrize("kind", ERRORS)
def test_an_error_stands_in_the_package(kind: type[FuzzyTreeError]) -> None:
    assert getattr(ft, kind.__name__) is kind


@pytest.mark.parametrize("kind", ERRORS)
def test_an_error_is_the_same_after_a_pickle_and_a_copy(
    kind: type[FuzzyTreeError],
) -> None:
    mistakes = ((("rules", 2), "no rule 3"), ((), "no name"))
    error = kind(mistakes) if kind is ft.InvalidModelError else kind("a: no b")
    for same in (pickle.loads(pickle.dumps(error)), copy.copy(error)):
        assert type(same) is kind
        assert (str(same), same.args) == (str(error), error.args)
        assert vars(same) == vars(error)


def test_a_file_that_is_not_there_is_an_error_of_the_system(tmp_path: Path) -> None:
    path = tmp_path / "none.yaml"
    with pytest.raises(OSError, match="cannot be read") as caught:
        ft.load(path)
    error: BaseException = caught.value
    assert str(error) == f"{path}: cannot be read: no such file or directory"
    assert isinstance(error, ft.ReadError)
    assert isinstance(error, ValueError)
    assert (error.errno, error.filename) == (None, None)
    assert isinstance(error.__cause__, FileNotFoundError)
    assert error.__cause__.errno == errno.ENOENT


def test_a_file_that_cannot_be_understood_is_one_too(tmp_path: Path) -> None:
    path = tmp_path / "bad.fcl"
    path.write_text("nothing\n", "utf-8")
    with pytest.raises(OSError, match=r"bad\.fcl:1:1: "):
        ft.load(path)


def test_an_error_while_a_file_is_written_keeps_its_kind(tmp_path: Path) -> None:
    path = tmp_path / "new.csv"
    with pytest.raises(ft.ReadError, match="a: no b"), open_atomically(path):
        raise ft.ReadError("a: no b")
    assert not path.exists()


def test_a_wrong_table_is_none_of_the_system() -> None:
    with pytest.raises(ft.TableError) as caught:
        ft.learn(np.zeros((2, 1)), target="no column")
    assert not isinstance(caught.value, OSError)
