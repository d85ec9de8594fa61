"""Fuzzy systems as ONNX: what stands in the file, and what is refused."""

import itertools
import json
import re
from pathlib import Path

import numpy as np
import onnx
import pytest

from fuzzytree.checking.converting import read
from fuzzytree.errors import DisagreementError, LossError, ReadError
from fuzzytree.exporters import onnx_blocks, onnx_steps
from fuzzytree.exporters.onnx import OPSETS, Output, write_onnx
from fuzzytree.exporters.onnx_blocks import is_wide
from fuzzytree.exporters.onnx_compare import contents, differences
from fuzzytree.formats.formulas import parse
from fuzzytree.model import (
    And,
    Conclusion,
    Curve,
    Defuzzifier,
    DefuzzifierMethod,
    Formula,
    FuzzySystem,
    Points,
    Proposition,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.model.rulebase import fingerprint
from fuzzytree.runtimes.onnxruntime import open_onnx
from fuzzytree.runtimes.reference import load as infer_rows
from fuzzytree.semantics.programs.system_program import from_system
from fuzzytree.testing import random_rows, random_system

SYSTEM = random_system(3, formulas="none")
TIPPER = read(Path(__file__).parents[2] / "examples" / "tipper.fll").model


def test_the_same_system_gives_the_same_bytes() -> None:
    assert write_onnx(SYSTEM).content == write_onnx(SYSTEM, verify=False).content


def test_the_file_says_what_it_is() -> None:
    found = onnx.load_model_from_string(write_onnx(SYSTEM).content)
    facts = {one.key: one.value for one in found.metadata_props}
    assert facts["fuzzytree.carrier"] == "system"
    assert facts["fuzzytree.fingerprint"] == fingerprint(SYSTEM)
    assert json.loads(facts["fuzzytree.columns"]) == list(SYSTEM.inputs)
    assert json.loads(facts["fuzzytree.names"]) == [o.name for o in SYSTEM.outputs]
    assert {one.domain for one in found.opset_import} == {""}
    assert [one.name for one in found.graph.output] == ["outputs", "status"]
    onnx.checker.check_model(found, full_check=True)


def test_nodes_bear_the_names_of_propositions_rules_and_outputs() -> None:
    found = onnx.load_model_from_string(write_onnx(TIPPER).content)
    names = {node.name for node in found.graph.node}
    assert {"service", "service_is_poor", "food_is_rancid"} <= names
    assert {"rule_1_strength", "rule_3_strength", "tip"} <= names
    constants = {tensor.name for tensor in found.graph.initializer}
    assert {"number_1_5", "number_minus_0_5", "whole_0"} <= constants


def test_a_degree_of_one_by_something_is_rounded_before_it_is_multiplied() -> None:
    # onnxruntime would divide the other degree by it, and round once instead of twice.
    curves: list[Curve] = [
        Formula(parse("1 / (1 + x * x)")),
        Points((0.0, 9.0), (0.0, 1.0)),
    ]
    inputs = tuple(
        Variable(n, (Term("t", c),)) for n, c in zip("ab", curves, strict=True)
    )
    one = Term("o", Singleton(1.0))
    output = SystemOutput("y", (one,), None, None, Defuzzifier("weighted sum"))
    rule = SystemRule(
        And((Proposition("a", ("t",)), Proposition("b", ("t",)))),
        (Conclusion("y", "o"),),
    )
    system = FuzzySystem("s", inputs, (output,), (RuleBlock((rule,), "product"),))
    columns = np.random.default_rng(0).uniform(0.0, 9.0, (2, 500))
    content = write_onnx(system, outputs=("outputs", "activations")).content
    opened = open_onnx(content, "s.onnx")
    right = infer_rows(system)(columns).strengths
    found = opened.run(columns).strengths
    assert found is not None
    np.testing.assert_array_equal(found, right)


def test_hostile_names_become_short_unique_identifiers() -> None:
    hostile = ["outputs", "a; b", "a  b", "\u5ea6" * 40, "x" * 400, "1[2J"]
    half = Term("x; DROP", Points((0.0, 1.0), (0.0, 1.0)))
    rules = [
        SystemRule(Proposition(name, (half.name,)), (Conclusion("status", "o"),))
        for name in hostile
    ]
    one = Term("o", Singleton(1.0))
    output = SystemOutput("status", (one,), None, None, Defuzzifier("weighted sum"))
    inputs = tuple(Variable(name, (half,)) for name in hostile)
    system = FuzzySystem("s", inputs, (output,), (RuleBlock(tuple(rules)),))
    content = write_onnx(system).content
    graph = onnx.load_model_from_string(content).graph
    onnx.checker.check_model(content, full_check=True)
    names = [node.name for node in graph.node]
    names += [tensor.name for tensor in graph.initializer]
    assert len(set(names)) == len(names)
    assert [one for one in names if not re.fullmatch(r"[A-Za-z_]\w*", one, re.A)] == []
    assert max(map(len, names)) <= 64
    assert {"outputs_2", "a_b_is_x_DROP", "a_b_is_x_DROP_2"} <= set(names)


def test_an_opened_file_runs() -> None:
    content = write_onnx(SYSTEM, outputs=("activations", "outputs", "status")).content
    opened = open_onnx(content, "s.onnx")
    assert (opened.representation, opened.names) == ("system", ("y1", "y2"))
    rows = random_rows(SYSTEM, 0, 50)
    values = np.array([[row[name] for row in rows] for name in SYSTEM.inputs])
    found = opened.run(values)
    right = infer_rows(SYSTEM)(values)
    assert found.strengths is not None
    assert found.outputs is not None
    assert right.strengths is not None
    assert right.outputs is not None
    np.testing.assert_allclose(found.outputs, right.outputs, rtol=1e-12)
    np.testing.assert_allclose(found.strengths, right.strengths, rtol=1e-12)
    assert found.status.tolist() == right.status.tolist()


@pytest.mark.one_in(8)
@pytest.mark.parametrize("opset", OPSETS)
def test_every_operator_set_gives_the_same_numbers(opset: int) -> None:
    # Of maxima, bisectors and centroids: reductions and pads changed between sets.
    for seed in (6, 13):
        system = random_system(seed, formulas="none", defuzzifier="of curves")
        write_onnx(system, opset=opset, ir=8 if opset < 20 else 10)


def test_a_file_without_outputs_cannot_be_run() -> None:
    content = write_onnx(SYSTEM, outputs=("status",)).content
    with pytest.raises(ReadError, match="the file has no output 'outputs'"):
        open_onnx(content, "s.onnx")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"outputs": ("label",)}, "outputs: there is outputs, status, activations, "),
        ({"dtype": "float32"}, "dtype: there is float64, not 'float32'"),
        ({"signature": "all"}, "signature: there is needed, not 'all'"),
    ],
)
def test_options_of_trees_and_rules_are_refused(
    options: dict[str, object], text: str
) -> None:
    with pytest.raises(ValueError, match=text):
        write_onnx(SYSTEM, **options)  # type: ignore[arg-type] # wrong on purpose


def test_a_graph_is_readable_and_plain_as_it_is() -> None:
    content = write_onnx(SYSTEM).content
    assert write_onnx(SYSTEM, readable=True, plain=True).content == content


def test_a_system_s_outputs_are_no_model_s() -> None:
    from fuzzytree.testing import random_tree

    with pytest.raises(
        ValueError, match="there is label, rule, strengths, status, probabilities, not"
    ):
        write_onnx(random_tree(1), outputs=("outputs",))


def test_a_graph_is_compared_with_a_fresh_one() -> None:
    content = write_onnx(SYSTEM).content
    assert differences(content, SYSTEM) == ((), ())
    found = differences(content, random_system(4, formulas="none"))
    assert found.graph
    assert found.metadata


@pytest.mark.parametrize(
    ("operation", "operator"),
    [("maximum", "Min"), ("multiply", "Add"), ("less", "Equal")],
)
def test_a_wrong_graph_is_not_returned(
    operation: str, operator: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(onnx_steps, "NODES", {**onnx_steps.NODES, operation: operator})
    with pytest.raises(DisagreementError, match=r"returns another .* where"):
        write_onnx(SYSTEM, outputs=("outputs", "activations"))


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("names", '["y1"]', "gives answers without meaning"),
        ("rules", "3", "gives answers without meaning"),
        ("names", "[]", "metadata contradicts itself"),
        ("carrier", "rules", "metadata contradicts itself"),
        ("chunk", '"x"', "metadata is broken"),
    ],
)
def test_a_file_that_lies_about_itself_is_refused(
    key: str, value: str, text: str
) -> None:
    made = onnx.load_model_from_string(
        write_onnx(SYSTEM, outputs=("outputs", "activations")).content
    )
    for entry in made.metadata_props:
        if entry.key == f"fuzzytree.{key}":
            entry.value = value
    with pytest.raises((ReadError, LossError), match=text):
        _run(made.SerializeToString())


def _run(content: bytes) -> None:
    opened = open_onnx(content, "s.onnx")
    opened.run(np.zeros((3, 2)))


def grid_system(
    terms: int, *, method: DefuzzifierMethod = "weighted average"
) -> FuzzySystem:
    """Return the system of all pairs of the terms of two inputs, a rule each."""
    peaks = [float(place) for place in range(terms)]
    labels = tuple(
        Term(f"t{place}", Points((peak - 1.0, peak, peak + 1.0), (0.0, 1.0, 0.0)))
        for place, peak in enumerate(peaks)
    )
    inputs = Variable("a", labels), Variable("b", labels)
    pairs = list(itertools.product(labels, labels))
    numbers = tuple(
        Term(f"o{place}", Singleton(place / 7.0)) for place in range(len(pairs))
    )
    rules = tuple(
        SystemRule(
            And((Proposition("a", (one.name,)), Proposition("b", (two.name,)))),
            (Conclusion("y", number.name),),
        )
        for (one, two), number in zip(pairs, numbers, strict=True)
    )
    output = SystemOutput("y", numbers, None, None, Defuzzifier(method))
    block = RuleBlock(rules, conjunction="product")
    return FuzzySystem("grid", inputs, (output,), (block,))


ALL: tuple[Output, ...] = ("outputs", "status", "activations")


@pytest.mark.one_in(6)
@pytest.mark.parametrize("method", ["weighted average", "weighted sum"])
@pytest.mark.parametrize("opset", [12, 17, 18])
def test_a_graph_of_many_rules_gives_the_bits_of_the_inference(
    method: DefuzzifierMethod, opset: int
) -> None:
    system = grid_system(24, method=method)
    assert is_wide(from_system(system))
    opened = open_onnx(write_onnx(system, outputs=ALL, opset=opset).content, "g.onnx")
    values = np.array([[0.0, -0.0, 3.25, 23.5, np.nan, 99.0], [7.5, 1.0, 3, 22, 1, 1]])
    right = infer_rows(system)(values)
    found = opened.run(values)
    np.testing.assert_array_equal(found.outputs, right.outputs)
    np.testing.assert_array_equal(found.strengths, right.strengths)
    assert found.status.tolist() == right.status.tolist()


@pytest.mark.heavy
def test_four_times_as_many_rules_need_no_more_nodes() -> None:
    counts = [
        contents(
            write_onnx(grid_system(terms), outputs=ALL, verify=False).content
        ).nodes
        for terms in (30, 60)
    ]
    assert counts[1] <= counts[0]


@pytest.mark.one_in(8)
@pytest.mark.parametrize("seed", range(40))
def test_wide_nodes_give_the_answers_of_single_ones(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    system = random_system(seed, formulas="none")
    monkeypatch.setattr(onnx_blocks, "MOST_SINGLE", 0)
    monkeypatch.setattr(onnx_blocks, "_SHORTEST_CHAIN", 3)
    write_onnx(system, outputs=ALL)  # it is verified
