"""Settings of verbs stand beside their other keywords, with their types."""

from __future__ import annotations

from typing import Any, get_type_hints

import pytest

import fuzzytree as ft
from fuzzytree.api.settings import (
    AuditArguments,
    BenchArguments,
    CheckArguments,
    DrawArguments,
)
from fuzzytree.testing import random_tree

TREE = random_tree(1, combinations=0)
AUDIT = (ft.AuditSettings, ft.AuditDomain, ft.AuditSelection)


@pytest.mark.parametrize(
    ("arguments", "structs"),
    [
        (AuditArguments, AUDIT),
        (CheckArguments, (ft.CheckSettings,)),
        (BenchArguments, (ft.BenchSettings,)),
    ],
)
def test_every_field_is_a_keyword_of_its_type(
    arguments: type, structs: tuple[type, ...]
) -> None:
    fields: dict[str, Any] = {}
    for struct in structs:
        hints = get_type_hints(struct)
        assert not hints.keys() & fields.keys()
        fields |= hints
    assert get_type_hints(arguments) == fields


def test_a_comparison_takes_the_settings_about_rows_that_are_drawn() -> None:
    hints = get_type_hints(ft.AuditSettings)
    assert get_type_hints(DrawArguments).items() <= hints.items()
    difference = ft.diff(TREE, TREE, rows=50, seed=3, budget=2.0)
    assert difference.settings == ft.AuditSettings(rows=50, seed=3, budget=2.0)


def test_an_audit_takes_the_fields_of_its_three_objects() -> None:
    name = TREE.inputs[0]
    audit = ft.audit(
        TREE, select=["FT101"], budget=3.0, limits={name: (0.0, 1.0)}, level=0.25
    )
    assert audit.settings == ft.AuditSettings(budget=3.0, level=0.25)
    assert {answer.code for answer in audit.answers} == {"FT101"}
    [side] = [side for side in audit.domain.sides if side.variable == name]
    assert (side.low, side.high) == (0.0, 1.0)


def test_a_keyword_goes_before_the_same_field_of_an_object() -> None:
    few = ft.CheckSettings(limit=50)
    assert ft.check(TREE, runtimes=["native"], settings=few).probes <= 50
    result = ft.check(TREE, runtimes=["native"], settings=few, limit=20)
    assert result.probes <= 20
    study = ft.bench(TREE, select=["native"], rows=(9,), threads=(1,), budget_s=5)
    assert {timing.rows for point in study.points for timing in point.timings} == {9}


@pytest.mark.parametrize(
    ("verb", "name", "near"),
    [
        (ft.audit, "budge", "budget"),
        (ft.audit, "domian", "domain"),
        (ft.check, "tolerence", "tolerance"),
        (ft.bench, "budget", "budget_s"),
    ],
)
def test_a_wrong_keyword_is_refused_with_the_nearest(
    verb: Any, name: str, near: str
) -> None:
    with pytest.raises(TypeError) as caught:
        verb(TREE, **{name: 1})
    text = str(caught.value)
    assert text.startswith(f"{verb.__name__} has no setting {name!r}; there is ")
    assert text.endswith(f" (did you mean {near!r}?)")


def test_a_learner_takes_settings_by_name() -> None:
    assert ft.Learner("size", leaves=4).settings == ft.LearningSettings(leaves=4)
    wrong: Any = {"max_leaf_nodes": 4}
    with pytest.raises(TypeError) as caught:
        ft.Learner("size", **wrong)
    text = "Learner has no setting 'max_leaf_nodes'; it is called 'leaves' here"
    assert str(caught.value) == text


def test_one_number_of_rows_is_refused_in_a_sentence() -> None:
    wrong: Any = 9
    with pytest.raises(TypeError) as caught:
        ft.bench(TREE, rows=wrong)
    assert str(caught.value) == "rows: takes several numbers, such as (9,)"
