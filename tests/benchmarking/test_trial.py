"""What ends or blocks a process ends or blocks a child, and is reported."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
import pytest

from fuzzytree.benchmarking.trial import error_text, tried
from fuzzytree.model.contracts import Model
from fuzzytree.testing import random_tree

PEERS = """
import ctypes, os, signal, sys, time
from fuzzytree.benchmarking.records import Candidate, CandidateOutput, LoadedCandidate

def well(threads):
    print("a library that prints")
    def answer(values):
        return CandidateOutput(values[0])
    return LoadedCandidate(answer, lambda values: lambda: None)

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
    return LoadedCandidate(lambda values: CandidateOutput(values[0]), call)

def peers(model, bounds):
    loads = (well, crash, leave, hang, fail, late)
    return [Candidate(one.__name__, "tree", "peer", one) for one in loads], []
"""


@pytest.fixture
def planted(tmp_path: Path) -> str:
    path = tmp_path / "planted_peers.py"
    path.write_text(textwrap.dedent(PEERS), "utf-8")
    return str(path)


def model() -> Model:
    return random_tree(1)


def rows() -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.zeros((len(model().inputs), 2))


def test_what_works_is_not_named(planted: str) -> None:
    assert tried(model(), ["well"], rows(), peers=planted) == {}
    assert tried(model(), [], rows(), peers=planted) == {}


@pytest.mark.heavy
def test_crashes_and_errors_are_reported_and_the_others_go_on(planted: str) -> None:
    names = ["crash", "well", "leave", "fail", "late", "unheard of"]
    assert tried(model(), names, rows(), peers=planted) == {
        "crash": "it crashed the process (SIGSEGV)",
        "leave": "it ended the process (exit code 3): no licence",
        "fail": "it does not",
        "late": "it crashed the process (SIGKILL)",
        "unheard of": "it could not be made again in a child process",
    }


@pytest.mark.heavy
def test_what_hangs_is_ended(planted: str) -> None:
    result = tried(model(), ["hang", "well"], rows(), peers=planted, seconds=4.0)
    assert result == {"hang": "it did not answer within 4 s"}


@pytest.mark.heavy
def test_what_the_budget_leaves_no_time_for_is_reported(planted: str) -> None:
    late = "a third of the budget was over before it was tried; a larger one helps"
    names = ["hang", "well"]
    result = tried(model(), names, rows(), peers=planted, left=lambda: 0.0)
    assert result == dict.fromkeys(names, late)
    times = iter([1.0, 0.5, 0.0])  # as the first begins, while it hangs, and then
    result = tried(model(), names, rows(), peers=planted, left=lambda: next(times))
    assert result == dict.fromkeys(names, late)


@pytest.mark.heavy
def test_peers_that_are_missing_are_the_fault_of_every_candidate() -> None:
    result = tried(model(), ["a"], rows(), peers="no_such_module.py")
    assert result == {
        "a": "it ended the process (exit code 1): "
        "ValueError: peers: 'no_such_module.py' is not a Python module or package"
    }


def test_an_error_without_words_is_named_by_its_type() -> None:
    assert error_text(ValueError()) == "ValueError"
    assert error_text(ValueError("first.\nsecond")) == "first"
