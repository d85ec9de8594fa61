"""What ends or blocks a process ends or blocks a child, and is told."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
import pytest

from fuzzytree.benchmarking.trial import error_text, tried
from fuzzytree.model.contracts import Model
from fuzzytree.testing import random_tree

MAKER = """
import ctypes, os, signal, sys, time
from fuzzytree.benchmarking.records import Candidate, Found, Loaded

def well(threads):
    print("a library that prints")
    return Loaded(lambda values: Found(values[0]), lambda values: lambda: None)

def crash(threads):
    os.kill(os.getpid(), signal.SIGSEGV)

def leave(threads):
    sys.stderr.write("no licence\\n")
    sys.stderr.flush()
    os._exit(3)

def hang(threads):
    time.sleep(60)

def fail(threads):
    raise RuntimeError("it does not\\nlike this model")

def late(threads):
    def call(values):
        return lambda: os.kill(os.getpid(), signal.SIGKILL)
    return Loaded(lambda values: Found(values[0]), call)

def make(model):
    loads = (well, crash, leave, hang, fail, late)
    return [Candidate(one.__name__, "tree", "peer", one) for one in loads]
"""


@pytest.fixture
def maker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (tmp_path / "planted_peers.py").write_text(textwrap.dedent(MAKER), "utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    return "planted_peers:make"


def model() -> Model:
    return random_tree(1)


def rows() -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.zeros((len(model().inputs), 2))


def test_what_works_is_not_named(maker: str) -> None:
    assert tried(model(), ["well"], rows(), maker=maker) == {}
    assert tried(model(), [], rows(), maker=maker) == {}


def test_crashes_and_errors_are_told_and_the_others_go_on(maker: str) -> None:
    names = ["crash", "well", "leave", "fail", "late", "unheard of"]
    assert tried(model(), names, rows(), maker=maker) == {
        "crash": "it crashed the process (SIGSEGV)",
        "leave": "it ended the process (exit code 3): no licence",
        "fail": "it does not",
        "late": "it crashed the process (SIGKILL)",
        "unheard of": "it could not be made again in a child process",
    }


@pytest.mark.heavy
def test_what_hangs_is_ended(maker: str) -> None:
    found = tried(model(), ["hang", "well"], rows(), maker=maker, seconds=4.0)
    assert found == {"hang": "it did not answer within 4 s"}


def test_what_the_budget_leaves_no_time_for_is_told(maker: str) -> None:
    late = "a third of the budget was over before it was tried; a larger one helps"
    names = ["hang", "well"]
    found = tried(model(), names, rows(), maker=maker, left=lambda: 0.0)
    assert found == dict.fromkeys(names, late)
    times = iter([1.0, 0.5, 0.0])  # as the first begins, while it hangs, and then
    found = tried(model(), names, rows(), maker=maker, left=lambda: next(times))
    assert found == dict.fromkeys(names, late)


def test_a_maker_that_is_not_there_is_the_fault_of_every_candidate() -> None:
    found = tried(model(), ["a"], rows(), maker="no_such_module_at_all:make")
    assert found == {
        "a": "it ended the process (exit code 1): "
        "ModuleNotFoundError: No module named 'no_such_module_at_all'"
    }


def test_an_error_without_words_is_named_by_its_type() -> None:
    assert error_text(ValueError()) == "ValueError"
    assert error_text(ValueError("first.\nsecond")) == "first"
