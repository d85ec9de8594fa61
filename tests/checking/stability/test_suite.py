"""All criteria hold for our runtimes, on generated models and on the wine table."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.checking.stability.results import TITLES, Stability
from fuzzytree.checking.stability.sensitivity import stiffness
from fuzzytree.checking.stability.suite import examine
from fuzzytree.exporters.table import all_formats
from fuzzytree.learning.shapes import window_counts as counted
from fuzzytree.learning.sums import totals_of
from fuzzytree.model.contracts import Model
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Points,
    RuleBase,
    Semantics,
    Shape,
    Side,
    Term,
)
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.runtimes.table import all_runtimes, find_runtime
from fuzzytree.testing import random_tree
from tests.checking.stability.defects import learning_table, one_rule, small_rules
from tests.checking.stability.learners import learner_criteria, window_counts

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

ROOT = Path(__file__).resolve().parents[3]
SCHEMA = json.loads((ROOT / "schemas" / "stability.schema.json").read_bytes())
FAST = [find_runtime(name) for name in ("native", "native float32", "best-first")]


@cache
def wine() -> FuzzyTree:
    table = ROOT / "examples" / "wine" / "wine.csv"
    return ft.learn(
        str(table),
        target="cultivar",
        settings=ft.LearningSettings(columns_per_node=1, leaves=4),
    )


@cache
def small_examined() -> Stability:
    return examine(small_rules(), runtimes=FAST, formats=all_formats())


def verdicts(result: Stability) -> dict[str, str]:
    return {one.code: one.verdict for one in result.criteria}


def failures(result: Stability) -> list[str]:
    return [
        text for one in result.criteria if one.verdict == "FAILS" for text in one.detail
    ]


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(2))
def test_all_criteria_hold_for_generated_trees(seed: int) -> None:
    tree = random_tree(seed, leaves=2 + 2 * seed, inputs=2 + seed)
    result = examine(tree, runtimes=FAST, formats=all_formats())
    assert failures(result) == []
    assert result.ok


@pytest.mark.heavy
@pytest.mark.parametrize("seed", [2])
def test_all_criteria_hold_in_every_runtime_for_generated_trees(seed: int) -> None:
    semantics = Semantics("product" if seed % 2 else "minimum")
    tree = random_tree(seed, leaves=3 + seed, combinations=0.5, semantics=semantics)
    result = examine(tree, runtimes=all_runtimes(), formats=all_formats())
    assert failures(result) == []


@pytest.mark.heavy
@pytest.mark.parametrize("kind", ["tree", "raw"])
def test_all_criteria_hold_for_the_wine_tree_and_its_raw_rules(kind: str) -> None:
    model: Model = wine() if kind == "tree" else ft.rules_from_tree(wine(), "raw")
    result = examine(model, runtimes=FAST, formats=all_formats())
    assert failures(result) == []
    assert verdicts(result)["N10"] == "not applicable"


@pytest.mark.heavy
def test_all_criteria_hold_in_every_runtime_for_the_wine_tree() -> None:
    result = ft.stability(wine(), data=str(ROOT / "examples" / "wine" / "wine.csv"))
    assert failures(result) == []
    assert result.rows == 178


def test_rules_of_every_kind_of_term_hold() -> None:
    assert failures(small_examined()) == []
    ramp = Points((0.0, 1.0, 1.0, 4.0), (0.0, 1.0, 0.5, 0.5))
    result = examine(
        one_rule(Term("ramp", ramp), Term("step", Band(low=1.0))),
        runtimes=FAST,
        formats=all_formats(),
    )
    assert failures(result) == []
    assert verdicts(result)["N7"] == "not applicable"


def test_a_tree_of_one_leaf_can_be_examined() -> None:
    result = examine(random_tree(0, leaves=1), runtimes=FAST, formats=all_formats())
    assert failures(result) == []


def test_a_model_without_inputs_can_be_examined() -> None:
    from fuzzytree.model.rulebase import Rule

    rules = RuleBase("always", ("yes",), (), (Rule((), "yes"),))
    assert failures(examine(rules, runtimes=FAST, formats=all_formats())) == []


EXTREME: dict[str, Shape] = {
    "a subnormal width": Band(high=5e-324, right=1e-323),
    "a huge width": Band(high=1e308, right=1.7e308),
    "a huge mean": LR(1e308, Side(1e300, (1.0,)), Side(1.0, (1.0,))),
    "a wide reach": LR(0.0, Side(1.0, (1.0,), 1e300), Side(1.0, (1.0,), 1.0 + 2e-16)),
    "points all over": Points((1e-320, 2e-320, 2e-320, 1e300), (0.0, 1.0, 0.5, 0.25)),
    "everything": Band(),
}


@pytest.mark.one_in(3)
@pytest.mark.parametrize("name", EXTREME)
def test_numbers_at_the_ends_of_double_can_be_examined(name: str) -> None:
    model = one_rule(Term("t", EXTREME[name]))
    result = examine(model, runtimes=FAST, formats=all_formats())
    assert failures(result) == []
    jsonschema.validate(json.loads(result.to_json()), SCHEMA)


def test_only_selected_checks_are_applied() -> None:
    result = examine(small_rules(), runtimes=FAST, formats=(), select=["n3", "N2"])
    assert [one.code for one in result.criteria] == ["N2", "N3"]
    assert set(TITLES) >= {one.code for one in result.criteria}


def test_an_unknown_criterion_is_refused() -> None:
    with pytest.raises(ValueError, match="no criterion") as caught:
        examine(small_rules(), runtimes=FAST, formats=(), select=["N11"])
    assert str(caught.value) == (
        "no criterion 'N11'; there is N1, N2, N3, N4, N5, N6, N7, N8, N9, N10"
    )


def test_data_of_another_width_are_refused() -> None:
    with pytest.raises(ValueError, match="shape") as caught:
        examine(small_rules(), runtimes=FAST, formats=(), data=np.zeros((5, 2)))
    assert str(caught.value) == "data must have shape (2, rows), not (5, 2)"


@pytest.mark.heavy
def test_the_same_model_gives_the_same_report() -> None:
    again = examine(small_rules(), runtimes=FAST, formats=all_formats())
    assert small_examined() == again


def test_the_json_fits_the_schema() -> None:
    jsonschema.validate(json.loads(small_examined().to_json()), SCHEMA)


# --- stiffness


def far_away(distance: float) -> RuleBase:
    term = Term("low", Band(high=distance, right=distance + 1.0))
    return one_rule(term)


def test_an_input_near_zero_is_safe_in_float32() -> None:
    values = np.linspace(0.0, 4.0, 50)[np.newaxis]
    (result,) = stiffness(far_away(2.0), values, is_data=True)
    assert result.advice == "float32 is safe"
    assert result.ratio == pytest.approx(1.0 / 3.0)


def test_an_input_far_from_zero_gets_a_value_to_subtract() -> None:
    values = 1e9 + np.linspace(-1.0, 2.0, 50)[np.newaxis]
    (result,) = stiffness(far_away(1e9), values, is_data=True)
    assert result.advice == "use mixed, or subtract 1e+09 first"
    assert result.offset is not None
    assert abs(result.offset - 1e9) <= 2.0
    assert result.predicted == 1.0
    assert result.observed > 0.1


def test_what_rounding_costs_is_never_above_what_was_predicted() -> None:
    for seed in range(6):
        tree = random_tree(seed, leaves=5, combinations=0.0)
        values = np.random.default_rng(seed).normal(size=(len(tree.inputs), 500))
        for one in stiffness(tree, values, is_data=True):
            assert one.observed <= one.predicted or one.flips


def test_an_input_whose_terms_only_step_has_no_spread() -> None:
    rules = one_rule(Term("step", Band(high=1.0)))
    (result,) = stiffness(rules, np.array([[0.5, 1.0, 1.5]]), is_data=True)
    assert (result.spread, result.ratio) == (None, None)
    assert result.advice == "float32 is safe"
    study = examine(rules, runtimes=FAST, formats=(), select=["N3"])
    jsonschema.validate(json.loads(study.to_json()), SCHEMA)


def test_a_distance_at_which_doubles_are_too_coarse_is_reported() -> None:
    values = 1e14 + np.arange(4.0)[np.newaxis]
    (result,) = stiffness(far_away(1e14), values, is_data=True)
    assert result.advice == "use mixed, and subtract 1e+14 where the values are made"


# --- the learner of this package


@pytest.mark.heavy
def test_the_learner_holds() -> None:
    def learn(values: FloatArray, classes: Sequence[str]) -> FuzzyTree:
        return ft.learn(values, target=list(classes))

    result = learner_criteria(learn, *learning_table())
    assert [(one.code, one.verdict) for one in result] == [
        (code, "holds") for code in ("N1", "N2", "N3", "N4")
    ]


def test_the_learner_counts_windows_exactly() -> None:
    def count(values: FloatArray, n: int) -> list[int]:
        groups = np.zeros(len(values), np.int64)
        totals = totals_of(values, groups, 1)
        return [int(k) for k in counted(values, groups, totals, n)[0]]

    assert window_counts(count).verdict == "holds"


def test_a_learnt_tree_passes_with_what_stands_for_missing_values() -> None:
    table = Path(__file__).resolve().parents[3] / "examples" / "wine" / "wine.csv"
    tree = ft.learn(str(table), target="cultivar")
    assert all(variable.missing is not None for variable in tree.variables[:1])
    only = ["N1", "N6"]
    found = ft.stability(tree, select=only, runtimes=["native", "native float32"])
    assert {c.verdict for c in found.criteria if c.code in only} == {"holds"}
