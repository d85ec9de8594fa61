"""Comparisons of two models are checked again, by the models' files alone."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.auditing.decide.states import Proved
from fuzzytree.auditing.diff.differences import difference
from fuzzytree.auditing.diff.records import Difference
from fuzzytree.auditing.findings.domains import domain_of
from fuzzytree.exporters import yaml
from fuzzytree.model import Document, FuzzySystem
from fuzzytree.model.rulebase import Points, RuleBase
from fuzzytree.rechecking import CannotRunError, Report, recheck_difference
from fuzzytree.rechecking.__main__ import main
from tests.auditing.decide.old_bases import random_base

TIPPER = Path(__file__).parents[2] / "examples" / "tipper.fll"


def base() -> RuleBase:
    return random_base(3, 4, 2, kind="points", classes=2)


def compared(old: Document, new: Document) -> tuple[Difference, bytes, bytes]:
    result = difference(old, new, domain=domain_of(old))
    return result, yaml.write(old).content, yaml.write(new).content


def checked(facts: dict[str, Any], old: bytes, new: bytes) -> Report:
    names = "diff.json", "old.yaml", "new.yaml"
    return recheck_difference(json.dumps(facts).encode(), old, new, names)


def renamed(rules: RuleBase) -> RuleBase:
    """Return rules in which a term has another name, and its line one more point."""
    first, *others = rules.variables
    shape = first.terms[0].shape
    assert isinstance(shape, Points)
    (start, *xs), (p, *ys) = shape.values, shape.degrees
    shape = Points((start - 1.0, start, *xs), (p, p, *ys))
    terms = (replace(first.terms[0], name="other", function=shape), *first.terms[1:])
    old = first.terms[0].name
    every = [
        replace(
            rule,
            when=tuple(
                replace(one, terms=("other",))
                if (one.variable, one.terms) == (first.name, (old,))
                else one
                for one in rule.when
            ),
        )
        for rule in rules.rules
    ]
    variables = (replace(first, terms=terms), *others)
    return replace(rules, variables=variables, rules=tuple(every))


def with_a_copy(rules: RuleBase) -> RuleBase:
    return replace(rules, rules=(*rules.rules, rules.rules[-1]))


@pytest.mark.parametrize("change", [lambda rules: rules, renamed, with_a_copy])
def test_rules_that_are_the_same_are_decided_again(
    change: Callable[[RuleBase], RuleBase],
) -> None:
    found, old, new = compared(base(), change(base()))
    assert (found.verdict, type(found.answers[0].state)) == ("equal", Proved)
    report = checked(json.loads(found.to_json()), old, new)
    assert report.wrong == []
    assert [*report.confirmed] == [0]


def test_what_is_alike_by_more_than_its_neighbours_is_confirmed() -> None:
    rules = base()
    first = replace(rules, rules=(rules.rules[1], rules.rules[0], *rules.rules[1:]))
    found, old, new = compared(replace(rules, rules=first.rules[1:]), first)
    if found.verdict == "equal":
        assert isinstance(found.answers[0].state, Proved)
        assert found.answers[0].state.confirmed
    assert checked(json.loads(found.to_json()), old, new).wrong == []


def test_witnesses_are_evaluated_again_and_edits_are_reported() -> None:
    rules = base()
    found, old, new = compared(rules, replace(rules, rules=rules.rules[1:]))
    facts = json.loads(found.to_json())
    report = checked(facts, old, new)
    assert report.wrong == []
    assert report.counts["answers with a WITNESS, evaluated again"]
    facts["answers"][0]["state"]["claims"][0]["label"] = "class 9"
    facts["verdict"] = "open"
    facts["answers"][-1]["sentence"] += "!"
    wrong = checked(facts, old, new).wrong
    assert wrong[0] == "the verdict is changed"
    assert "the models predict " in wrong[1]
    assert wrong[2].endswith("its sentence says something else")


def test_a_system_with_other_names_is_decided_again(tmp_path: Path) -> None:
    system = ft.read(TIPPER).model
    assert isinstance(system, FuzzySystem)
    found, old, new = compared(system, replace(system, name="other", note="new"))
    assert isinstance(found.answers[0].state, Proved)
    names = [str(tmp_path / name) for name in ("diff.json", "old.yaml", "new.yaml")]
    for name, content in zip(names, (found.to_json().encode(), old, new), strict=True):
        Path(name).write_bytes(content)
    assert main(names) == 0


def test_a_comparison_without_a_field_is_refused() -> None:
    found, old, new = compared(base(), base())
    facts = json.loads(found.to_json())
    del facts["verdict"]
    with pytest.raises(CannotRunError) as caught:
        checked(facts, old, new)
    assert str(caught.value) == "diff.json: missing or unknown: verdict"


@pytest.mark.parametrize("model", [base(), ft.read(TIPPER).model])
def test_a_solver_that_fails_is_no_refutation(model: Document) -> None:
    found, old, new = compared(model, model)
    names = "diff.json", "old.yaml", "new.yaml"
    with pytest.raises(CannotRunError, match=r"^no/such: no such program$"):
        recheck_difference(found.to_json().encode(), old, new, names, "no/such")
