"""The numbers of a fuzzy system as answers: columns, counts, words."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.api.answering import prepare_answering
from fuzzytree.errors import LossError
from fuzzytree.model import FuzzySystem
from fuzzytree.report.models import model_lines, system_reasons
from fuzzytree.runtimes.predictions import Outputs, joined
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.random_systems import random_rows, random_system
from fuzzytree.semantics.reference import Status
from fuzzytree.semantics.samples import all_samples

FOUND = Outputs(
    ("fan", "status"),
    np.array([[1.0, math.nan, 2.5], [0.0, 0.0, math.nan]]),
    status=np.array([Status.DECIDED, Status.UNCOVERED, Status.MISSING]),
    strengths=np.array([[0.5, 0.0, math.nan]]),
)
TIPPER = Path(__file__).resolve().parents[2] / "examples" / "tipper.fll"
SYSTEMS = [one for one in all_samples().values() if isinstance(one, FuzzySystem)]


def test_no_number_is_an_empty_cell() -> None:
    assert FOUND.to_csv("rule") == (
        "fan,status,status_,strength of rule 1\n"
        "1.0,0.0,decided,0.5\n"
        ",0.0,uncovered,0.0\n"
        "2.5,,missing,\n"
    )


def test_outputs_become_frames_with_nothing_where_there_is_no_number() -> None:
    frame = FOUND.to_pandas("rule")
    assert frame["fan"].isna().tolist() == [False, True, False]
    assert frame["strength of rule 1"].dtype == np.float64
    assert FOUND.to_arrow().to_pydict() == {
        "fan": [1.0, None, 2.5],
        "status": [0.0, 0.0, None],
        "status_": ["decided", "uncovered", "missing"],
    }


def test_an_output_is_found_by_its_name() -> None:
    assert FOUND["fan"][2] == 2.5
    with pytest.raises(ValueError, match="no output 'heat'; there is fan, status"):
        FOUND["heat"]


def test_outputs_are_a_sequence_of_the_numbers_of_each_row() -> None:
    assert FOUND[0] == (1.0, 0.0)
    assert [row[1] for row in FOUND if isinstance(row, tuple)][:2] == [0.0, 0.0]
    assert FOUND[:1]["fan"].tolist() == [1.0]
    assert np.asarray(FOUND).shape == (3, 2)
    one = Outputs(("y",), np.array([[1.0, 2.0]]), status=np.array([0, 0]))
    assert ([*one], one[1]) == ([1.0, 2.0], 2.0)
    assert np.asarray(one).tolist() == [1.0, 2.0]
    with pytest.raises(IndexError):
        one[2]


def test_what_was_out_of_the_ordinary_is_counted() -> None:
    assert str(FOUND) == (
        "3 rows: fan 1 to 2.5, status 0 to 0; 1 uncovered; 1 with missing values"
    )
    assert FOUND.spans() == {"fan": (1.0, 2.5), "status": (0.0, 0.0)}


def test_activations_are_absent_unless_requested() -> None:
    bare = Outputs(("y",), np.array([[1.0]]), status=np.array([0]))
    with pytest.raises(ValueError, match="there are no strengths by rule"):
        bare.columns("rule")
    assert joined([bare, bare]).strengths is None
    assert len(joined([bare, bare])) == 2


@pytest.mark.parametrize("seed", range(4))
def test_every_runtime_gives_the_numbers_of_the_inference(seed: int) -> None:
    system = random_system(seed, formulas="none")
    rows = random_rows(system, seed, count=20)
    table = np.array([[row[name] for name in system.inputs] for row in rows])
    right = np.array([infer(system, row).outputs for row in rows]).T
    result = ft.run(system, table, columns=system.inputs, runtime="reference")
    assert np.array_equal(result.values, right, equal_nan=True)
    native = ft.run(system, table, columns=system.inputs)
    assert np.allclose(native.values, right, rtol=1e-9, equal_nan=True)
    assert native.strengths is not None
    assert native.strengths.shape == (len(system.rules), 20)


def test_a_runtime_that_runs_no_systems_says_so() -> None:
    with pytest.raises(LossError) as caught:
        prepare_answering(SYSTEMS[0], "best-first")
    assert str(caught.value) == (
        "cannot run fan in best-first: it runs rules, not a fuzzy system"
    )


@pytest.mark.parametrize("seed", range(8))
def test_every_part_of_a_system_is_shown(seed: int) -> None:
    system = random_system(seed)
    shown = "\n".join(model_lines(system))
    for one in system.all_variables:
        assert f"\n{one.name}" in shown
        for label in one.terms:
            assert f"  {label.name}" in shown
    for number in range(1, len(system.rules) + 1):
        assert f"{number}. " in shown


def test_reasons_tell_what_fired_and_what_did_not() -> None:
    system = SYSTEMS[0]
    table = np.array([[1.0, 1.0], [5.0, 9.9], [math.nan, 1.0], [3.0, 20.0]])
    result = ft.run(system, table, columns=system.inputs)
    reasons = system_reasons(system, result)
    assert reasons[0] == ("rule 1 (1): IF heat is low and damp is dry THEN fan is slow")
    assert reasons[1].startswith("rule 2 (0.25): IF heat is high")
    assert reasons[2] == "a value is missing or not finite"
    assert reasons[3] == "no rule fires"


def test_an_array_as_wide_as_a_system_has_its_columns() -> None:
    tipper = ft.load(TIPPER)
    result = ft.run(tipper, np.array([[3.0, 8.0], [9.0, 2.0]]))
    named = ft.run(
        tipper, np.array([[8.0, 3.0], [2.0, 9.0]]), columns=["food", "service"]
    )
    assert isinstance(result, ft.Outputs)
    assert isinstance(named, ft.Outputs)
    assert result.values.tolist() == named.values.tolist()
    with pytest.raises(ft.FuzzyTreeError) as caught:
        ft.run(tipper, np.zeros((1, 3)))
    assert str(caught.value) == (
        "the array has 3 columns without names, and the model needs 2: service, food"
    )
