"""A model read back from a file is equal, equivalent or another one."""

from __future__ import annotations

import math

import pytest
from msgspec.structs import replace

from fuzzytree.checking.equivalence import equivalence, is_equivalent
from fuzzytree.model import (
    Band,
    Document,
    FuzzySystem,
    Points,
    Proposition,
    Reading,
    Rule,
    RuleBase,
    Shape,
    Term,
    Trapezoid,
    Variable,
    Written,
)
from fuzzytree.semantics import as_system
from fuzzytree.semantics.conversion.points import straight_points
from fuzzytree.semantics.samples import all_samples

RULES = all_samples()["point lists"]
TREE = all_samples()["tree"]


def _one(shape: Shape) -> RuleBase:
    variable = Variable("force", (Term("low", shape),))
    rule = Rule((Proposition("force", ("low",)),), "soft")
    return RuleBase("one", ("soft",), (variable,), (rule,))


RAMP = _one(Band(high=2.0, right=4.0))


def _seen(model: Document, other: Document, *remarks: str) -> str:
    return equivalence(model, Written(b"", (), remarks), Reading(other))


def test_a_model_is_equal_to_itself() -> None:
    for model in all_samples().values():
        assert _seen(model, model) == "equal"
        assert is_equivalent(model, model)


@pytest.mark.heavy
def test_no_sample_is_like_another() -> None:
    known = list(all_samples().items())
    alike = [
        (name, other_name)
        for name, one in known
        for other_name, other in known
        if name != other_name and is_equivalent(one, other)
    ]
    assert alike == []


def test_a_rule_that_always_holds_is_like_one_that_asks_what_is_always_so() -> None:
    always = all_samples()["a conclusion without a condition"]
    assert isinstance(always, FuzzySystem)
    heat, damp = always.variables
    label = Term("always", Trapezoid(None, 0.0, 0.0, None))
    block = always.blocks[0]

    def asking(label: Term) -> FuzzySystem:
        rules = tuple(
            replace(one, when=one.when or Proposition("heat", (label.name,)))
            for one in block.rules
        )
        return replace(
            always,
            variables=(replace(heat, terms=(*heat.terms, label)), damp),
            blocks=(replace(block, rules=rules),),
        )

    assert is_equivalent(always, asking(label))
    assert not is_equivalent(always, asking(replace(label, height=0.5)))
    assert not is_equivalent(
        always, asking(Term("near", Trapezoid(None, 0.0, 9.0, 10.0)))
    )


def test_another_name_needs_a_remark() -> None:
    assert isinstance(RULES, RuleBase)
    renamed = replace(RULES, name="another")
    assert _seen(RULES, renamed) == "renamed"
    assert _seen(RULES, renamed, "the name was changed") == "alike"


@pytest.mark.parametrize("scores", ["winner", "rule", "class"])
def test_rules_are_like_the_systems_that_decide_as_they_do(scores: str) -> None:
    assert isinstance(RULES, RuleBase)
    for how in ("winner", "rule", "class"):
        if how == scores:
            assert is_equivalent(RULES, as_system(RULES, how))
    other = all_samples()["AND as product"]
    assert isinstance(other, RuleBase)
    assert not is_equivalent(other, as_system(RULES, "winner"))


def test_a_band_is_like_its_points() -> None:
    points = _one(straight_points(Band(high=2.0, right=4.0))[0])
    assert _seen(RAMP, points, "a remark") == "alike"
    assert is_equivalent(points, RAMP)


def test_a_step_is_like_a_line_to_the_next_double() -> None:
    step = _one(Points((1.0, 1.0), (0.0, 1.0)))
    ramp = _one(Points((1.0, math.nextafter(1.0, 2.0)), (0.0, 1.0)))
    assert is_equivalent(step, ramp)
    other = _one(Points((math.nextafter(1.0, 0.0), 1.0), (0.0, 1.0)))
    assert not is_equivalent(step, other)  # at 1 itself they differ


@pytest.mark.parametrize(
    "shape",
    [
        Band(high=2.0, right=math.nextafter(4.0, 5.0) + 1e-12),
        Band(high=math.nextafter(2.0, 3.0), right=4.0),
        Band(high=2.0),
        Points((2.0, 2.0, 3.0, 4.0), (1.0, 1.0, 0.5 + 1e-12, 0.0)),
        Points((1.9, 4.0), (1.0, 0.0)),
    ],
)
def test_another_curve_is_another_model(shape: Shape) -> None:
    assert not is_equivalent(RAMP, _one(shape))
    assert _seen(RAMP, _one(shape), "a remark") == "other"
