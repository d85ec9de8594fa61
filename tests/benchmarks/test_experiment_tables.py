"""`benchmarks/experiment_tables.py`: the tables that it prints."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest
from commands import run as run_command
from experiment_tables import EFFECTS, FEATURES, command

Call = Callable[..., tuple[int, str, str]]


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Call:
    """Return a function that runs the command: exit code, stdout, stderr."""

    def run(*words: str) -> tuple[int, str, str]:
        code = run_command(command, words)
        out, err = capsys.readouterr()
        return code, out, err

    return run


def test_means_stand_beside_the_papers(call: Call) -> None:
    code, out, err = call("circle", "--count", "5", "--means")
    assert code == 0
    lines = out.splitlines()
    assert [line.split()[0] for line in lines] == ["feature", *FEATURES]
    mean, ratio = lines[1].split()[1:]
    assert float(mean) / 6.72 == pytest.approx(float(ratio[1:]), rel=0.02)
    assert err.splitlines()[-1].startswith("x: times Table 2's mean; ")


@pytest.mark.heavy
def test_effects_are_switched_off_one_by_one(call: Call) -> None:
    words = ("all", "--count", "20", "--effects")
    code, out, _ = call(*words)
    assert code == 0
    lines = out.splitlines()
    assert [line[:18].rstrip() for line in lines] == ["without", *EFFECTS]
    code, out, _ = call(*words, "--json")
    facts = json.loads(out)["effects"]
    assert [one["name"] for one in facts] == [*EFFECTS]
    for one, line in zip(facts, lines[1:], strict=True):
        assert line.endswith(f" {one['within_2']}")
        assert f" {100 * one['all']:.0f} % " in line


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("circle",), "choose --means or --effects"),
        (("circle", "--effects"), "--effects needs all objects, and 2 presses of each"),
        (("foot", "--means"), "no object 'foot'; there is rectangle-0, "),
    ],
)
def test_a_wrong_command_is_refused(
    call: Call, words: tuple[str, ...], sentence: str
) -> None:
    code, _, err = call(*words)
    assert code == 2
    assert err.startswith(sentence)
