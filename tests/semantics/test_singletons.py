"""Terms without width in outputs whose range is sampled, and systems without rules."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.checking.converting import read_content
from fuzzytree.checking.representations import check
from fuzzytree.errors import InvalidModelError, LossError, ReadError
from fuzzytree.exporters.table import find_format
from fuzzytree.model import (
    Conclusion,
    Defuzzifier,
    DefuzzifierMethod,
    FuzzySystem,
    Proposition,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
    sampled_values,
)
from fuzzytree.model.rulebase import Points
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.programs.evaluate import evaluate_program
from fuzzytree.semantics.programs.system_program import from_system

SHAPES = {
    "singletonShape": 'param1="{}"',
    "rectangularShape": 'param1="{0}" param2="{0}"',
    "triangularShape": 'param1="{0}" param2="{0}" param3="{0}"',
    "trapezoidShape": 'param1="{0}" param2="{0}" param3="{0}" param4="{0}"',
}


def fml(method: str, shape: str = "singletonShape") -> bytes:
    """Return a classifier of three classes as JFML writes it."""
    ends = {"low": (0, 1, 4), "mid": (1, 4, 6), "high": (4, 6, 7)}
    terms = "".join(
        f'<fuzzyTerm name="{name}"><triangularShape param1="{a}" param2="{b}" '
        f'param3="{c}"/></fuzzyTerm>'
        for name, (a, b, c) in ends.items()
    )
    numbers = {"setosa": 0.1, "versicolor": 0.2, "virginica": 0.7}
    classes = "".join(
        f'<fuzzyTerm name="{name}"><{shape} {SHAPES[shape].format(value)}/></fuzzyTerm>'
        for name, value in numbers.items()
    )
    proposition = "<clause><variable>{}</variable><term>{}</term></clause>"
    rules = "".join(
        f'<rule name="of {then}" connector="and" weight="1"><antecedent>'
        f"{proposition.format('petal', when)}</antecedent><consequent><then>"
        f"{proposition.format('class', then)}</then></consequent></rule>"
        for when, then in zip(ends, numbers, strict=True)
    )
    return (
        '<fuzzySystem xmlns="http://www.ieee1855.org" name="iris"><knowledgeBase>'
        '<fuzzyVariable name="petal" domainleft="0" domainright="7" type="input">'
        f'{terms}</fuzzyVariable><fuzzyVariable name="class" domainleft="0" '
        f'domainright="1" type="output" accumulation="MAX" defuzzifier="{method}" '
        f'defaultValue="-1">{classes}</fuzzyVariable></knowledgeBase>'
        '<mamdaniRuleBase name="rules" activationMethod="MIN" andMethod="MIN" '
        f'orMethod="MAX">{rules}</mamdaniRuleBase></fuzzySystem>'
    ).encode()


def system_of(content: bytes, name: str) -> FuzzySystem:
    model = read_content(content, find_format(name), name=f"iris.{name}").model
    assert isinstance(model, FuzzySystem)
    return model


ROWS = {0.5: 0.1, 3.0: 0.2, 6.0: 0.7, 9.0: -1.0}
"""The class that JFML answers: that of the strongest rule, else the default."""


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("method", ["LM", "RM", "MOM"])
def test_a_classifier_of_singletons_answers_the_class_of_the_strongest_rule(
    method: str, shape: str
) -> None:
    system = system_of(fml(method, shape), "fml")
    for petal, expected in ROWS.items():
        assert infer(system, {"petal": petal}).outputs == (expected,)


def test_ties_between_singletons_are_decided_as_the_method_says() -> None:
    row = {"petal": 2.5}  # low and mid have the degree 1/2
    found = {
        method: infer(system_of(fml(method), "fml"), row).outputs[0]
        for method in ("LM", "RM", "MOM", "COG")
    }
    assert found == pytest.approx({"LM": 0.1, "RM": 0.2, "MOM": 0.15, "COG": 0.15})


def test_a_center_of_area_of_singletons_is_refused() -> None:
    with pytest.raises(ReadError) as caught:
        system_of(fml("COA"), "fml")
    assert str(caught.value).endswith(
        "output 'class': the bisector measures an area, and the singleton 'setosa' has "
        "none"
    )


def mixed(method: DefuzzifierMethod) -> FuzzySystem:
    """Return a system with an output of one singleton and one trapezoid."""
    ramps = (
        Term("low", Points((0.0, 4.0), (1.0, 0.0))),
        Term("high", Points((0.0, 4.0), (0.0, 1.0))),
    )
    terms = (
        Term("one", Singleton(0.123)),
        Term("wide", Trapezoid(0.4, 0.5, 0.7, 1)),
    )
    output = SystemOutput("y", terms, 0.0, 1.0, Defuzzifier(method, 7), "maximum")
    rules = (
        SystemRule(Proposition("x", ("low",)), (Conclusion("y", "one"),)),
        SystemRule(Proposition("x", ("high",)), (Conclusion("y", "wide"),)),
    )
    block = RuleBlock(rules, implication="minimum")
    return FuzzySystem("mixed", (Variable("x", ramps),), (output,), (block,))


METHODS = [
    one
    for one in get_args(DefuzzifierMethod)
    if one != "bisector" and not one.startswith("weighted")
]


@pytest.mark.parametrize("method", METHODS)
def test_the_value_of_a_singleton_is_a_sample_among_those_of_the_range(
    method: DefuzzifierMethod,
) -> None:
    system = mixed(method)
    assert len(sampled_values(system.outputs[0])) == 8
    assert infer(system, {"x": 0.0}).outputs == (0.123,)
    program = from_system(system)
    for x in (0.0, 1.0, 2.0, 3.5, 4.0, 5.0):
        assert (
            evaluate_program(program, {"x": x}).of("output")
            == infer(system, {"x": x}).outputs
        )


@pytest.mark.one_in(2)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("count", [1, 2])
def test_every_runtime_answers_singletons_like_the_inference(
    method: DefuzzifierMethod, count: int
) -> None:
    system = mixed(method)
    labels = (
        Term("one", Singleton(0.5)),
        Term("wide", Singleton(0.25 * count)),
    )
    output = replace(system.outputs[0], terms=labels)
    found = check(replace(system, outputs=(output,)), limit=100)
    assert found.ok
    assert {one.representation for one in found.comparisons} >= {"native"}


@pytest.mark.parametrize("to", ["fll", "fis", "fcl"])
def test_a_format_whose_engines_sample_ranges_refuses_singletons(to: str) -> None:
    with pytest.raises(LossError) as caught:
        ft.export(system_of(fml("LM"), "fml"), to, allow_loss=True)
    assert str(caught.value) == (
        f"cannot write iris as {to}: its engines sample the range of 'class' and miss "
        "the singleton 'setosa'; fml and yaml keep it"
    )


@pytest.mark.parametrize("to", ["fml", "yaml"])
def test_singletons_are_written_and_read_back(to: str) -> None:
    system = system_of(fml("LM"), "fml")
    assert ft.convert(system, to).proof.verdict in ("equal", "alike")


FIS = """\
[System]
Name='y'
Type='mamdani'
NumInputs=1
NumOutputs=1
NumRules=1
AndMethod='min'
OrMethod='max'
ImpMethod='min'
AggMethod='max'
DefuzzMethod='mom'

[Input1]
Name='x'
Range=[0 1]
NumMFs=1
MF1='low':'trimf',[0 0.5 1]

[Output1]
Name='y'
Range=[0 1]
NumMFs=1
MF1='third':'trimf',[0.333 0.333 0.333]

[Rules]
1, 1 (1) : 1
"""
FLL = """\
Engine: e
InputVariable: x
  enabled: true
  range: 0 1
  lock-range: false
  term: low Triangle 0 0.5 1
OutputVariable: y
  enabled: true
  range: 0 1
  lock-range: false
  aggregation: Maximum
  defuzzifier: MeanOfMaximum 100
  default: nan
  lock-previous: false
  term: third Triangle 0.333 0.333 0.333
RuleBlock: r
  enabled: true
  conjunction: Minimum
  disjunction: Maximum
  implication: Minimum
  activation: General
  rule: if x is low then y is third
"""


@pytest.mark.parametrize(
    ("text", "place", "count"), [(FIS, "fis:23:5", 101), (FLL, "fll:15:9", 100)]
)
def test_a_term_without_width_that_no_sample_meets_is_refused(
    text: str, place: str, count: int
) -> None:
    name, line, column = place.split(":")
    with pytest.raises(ReadError) as caught:
        system_of(text.encode(), name)
    assert str(caught.value) == (
        f"iris.{name}:{line}:{column}: term 'third' of 'y' has no width, and none of "
        f"the {count} values at which the range is sampled is 0.333; rules that "
        "conclude it would change nothing"
    )


def test_a_term_without_width_on_a_sample_counts_as_in_the_engines() -> None:
    system = system_of(FLL.replace("0.333", "0.335").encode(), "fll")
    assert infer(system, {"x": 0.5}).outputs == pytest.approx((0.335,))


def test_a_term_between_two_samples_is_a_remark() -> None:
    text = FLL.replace("0.333 0.333 0.333", "0.331 0.333 0.334")
    found = read_content(text.encode(), find_format("fll"), name="y.fll")
    assert found.remarks[-1] == (
        "term 'third' of 'y' is 0 at all 100 values at which the range is sampled: "
        "rules that conclude it change nothing"
    )


def test_a_term_without_width_that_no_rule_concludes_is_read() -> None:
    text = FIS.replace("NumMFs=1\nMF1='third'", "NumMFs=2\nMF2='third'")
    text = text.replace("MF2=", "MF1='wide':'trimf',[0 0.5 1]\nMF2=")
    assert len(system_of(text.encode(), "fis").outputs[0].terms) == 2


@pytest.mark.parametrize(("text", "name"), [(FIS, "fis"), (FLL, "fll")])
def test_a_system_without_rules_is_refused_in_one_sentence(
    text: str, name: str
) -> None:
    bare = text.replace("NumRules=1", "NumRules=0").replace("1, 1 (1) : 1\n", "")
    bare = bare.replace("  rule: if x is low then y is third\n", "")
    with pytest.raises(ReadError) as caught:
        system_of(bare.encode(), name)
    assert str(caught.value) == f"iris.{name}:1:1: a system needs at least one rule"
    with pytest.raises(InvalidModelError) as refused:
        replace(mixed("centroid"), blocks=())
    assert str(refused.value) == "a system needs at least one rule"


def test_an_output_that_no_rule_concludes_answers_its_default_everywhere() -> None:
    system = mixed("centroid")
    idle = replace(system.outputs[0], name="idle", default=0.5)
    found = replace(system, outputs=(*system.outputs, idle))
    assert infer(found, {"x": 0.0}).outputs == (0.123, 0.5)
    assert check(found, limit=100).ok
    assert ft.convert(found, "onnx").proof.verdict == "alike"
    assert np.isfinite(sampled_values(idle)).all()
