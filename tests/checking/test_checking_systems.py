"""The check of systems: what it compares, and what it says of what is wrong."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree.checking import subject as checking_subject
from fuzzytree.checking.representations import check
from fuzzytree.exporters.onnx import write_onnx
from fuzzytree.model import (
    Activation,
    Conclusion,
    Defuzzifier,
    FuzzySystem,
    Gaussian,
    Outcome,
    Proposition,
    RuleBlock,
    Run,
    Runtime,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.model.agreement import Agreement, Comparison
from fuzzytree.model.rulebase import Points
from fuzzytree.runtimes import run_system
from fuzzytree.runtimes.onnxruntime import OnnxModel, open_onnx
from fuzzytree.semantics.samples import all_samples
from fuzzytree.testing import random_system


def washer(time: float = 60.0, output: str = "time") -> FuzzySystem:
    dirty = Term("dirty", Points((0.0, 10.0), (0.0, 1.0)))
    how = Defuzzifier("weighted sum")
    one = SystemOutput(output, (Term("long", Singleton(time)),), None, None, how)
    rule = SystemRule(Proposition("dirt", ("dirty",)), (Conclusion(output, "long"),))
    inputs = (Variable("dirt", (dirty,)),)
    return FuzzySystem("washer", inputs, (one,), (RuleBlock((rule,)),))


def opened(system: FuzzySystem, **facts: object) -> OnnxModel:
    agreement = open_onnx(write_onnx(system).content, "w.onnx")
    return replace(agreement, **facts)


def about(agreement: Agreement, representation: str, basis: str) -> Comparison:
    (one,) = (
        c
        for c in agreement.comparisons
        if (c.representation, c.basis) == (representation, basis)
        and c.verdict != "agrees"
    )
    return one


def test_every_runtime_is_compared_and_called() -> None:
    names = ["reference", "native", "onnxruntime float64"]
    agreement = check(washer(), limit=100, runtimes=names)
    assert agreement.ok
    assert [(c.representation, c.against, c.basis) for c in agreement.comparisons] == [
        ("native", "the inference", "rows"),
        ("reference", "itself", "calls"),
        ("native", "itself", "calls"),
        ("onnxruntime float64", "native", "rows"),
        ("onnxruntime float64", "itself", "calls"),
    ]
    assert {c.origin for c in agreement.comparisons} == {"equal bits"}
    assert agreement.probes == 100
    (count,) = agreement.counts
    assert count.rows == 100
    assert count.missing > 0


def test_rows_of_one_s_own_stand_behind_the_probes() -> None:
    data = np.array([[1.0, 2.0, 3.0]])
    agreement = check(washer(), data=data, limit=10, runtimes=["native"])
    assert (agreement.counts[0].rows, agreement.probes) == (13, 10)
    with pytest.raises(
        ValueError, match=r"data must have shape \(1, rows\), not \(3,\)"
    ):
        check(washer(), data=np.zeros(3))


def test_files_with_the_system_agree() -> None:
    agreement = check(washer(), washer(), opened(washer()), names=["a.yaml", "b.onnx"])
    assert agreement.ok
    result = [
        (c.representation, c.against)
        for c in agreement.comparisons
        if c.representation == "b.onnx"
    ]
    assert result == [
        ("b.onnx", "the system's metadata"),
        ("b.onnx", "a freshly written graph"),
        ("b.onnx", "native"),
    ]


def test_a_file_with_other_names_agrees() -> None:
    agreement = check(washer(), washer(output="t"), limit=50)
    assert agreement.ok
    result = [
        (c.against, c.basis)
        for c in agreement.comparisons
        if c.representation == "file 1"
    ]
    assert result == [("the system but for names", "file"), ("native", "rows")]


def test_a_file_with_one_more_rule_does_not_agree_by_its_rows_alone() -> None:
    system = washer()
    (dirt,) = system.variables
    key = Term("key", Points((3.12345, 3.12346, 3.12347), (0.0, 1.0, 0.0)))
    (block,) = system.blocks
    rules = (
        *block.rules,
        SystemRule(Proposition("dirt", ("key",)), block.rules[0].then),
    )
    other = replace(
        system,
        variables=(replace(dirt, terms=(*dirt.terms, key)),),
        blocks=(replace(block, rules=rules),),
    )
    agreement = check(system, other, limit=50)
    assert about(agreement, "file 1", "file").verdict == "rows only"
    assert not agreement.ok
    assert check(system, other, limit=50, rows_only=True).ok


def test_a_file_with_another_number_is_found_in_its_rows() -> None:
    agreement = check(washer(), washer(61.0), limit=50, data=np.array([[5.0]]))
    assert not agreement.ok
    one = about(agreement, "file 1", "rows")
    assert one.largest_difference == 1.0
    assert "output 'time'" in one.detail[0]
    assert "generated row" in one.detail[0]


def test_the_worst_row_comes_first_with_its_values() -> None:
    agreement = check(washer(), washer(61.0), limit=1, data=np.array([[5.0]]))
    text = "row 1: dirt 5.0: output 'time' 30.5 where 30.0 is right"
    assert text in about(agreement, "file 1", "rows").detail


def test_a_file_of_another_system_is_reported_by_its_facts() -> None:
    other = random_system(1, formulas="none")
    agreement = check(washer(), other, opened(other), limit=20)
    assert [c.detail for c in agreement.comparisons if c.verdict == "DISAGREES"] == [
        ("it computes 2 outputs from 3 inputs, and the system 1 from 1",),
        ("it computes y1, y2 from x1, x2, x3, which are not the system's",),
    ]


def test_a_wrong_fingerprint_and_a_wrong_graph_are_found() -> None:
    other = opened(washer(61.0))
    agreement = check(washer(), other, limit=20)
    wrong = [c.against for c in agreement.comparisons if c.verdict == "DISAGREES"]
    assert wrong == ["the system's metadata", "a freshly written graph", "native"]


def test_a_file_without_status_is_compared_by_its_numbers() -> None:
    content = write_onnx(washer(), outputs=("outputs",)).content
    assert check(washer(), open_onnx(content, "w.onnx"), limit=60).ok


def test_a_slow_runtime_gets_a_share_of_the_rows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(checking_subject, "_SLOW_STEPS", 100)
    agreement = check(washer(), limit=400, runtimes=["native"])
    assert agreement.comparisons[0].rows == 50


def shifted(system: FuzzySystem, by: float) -> FuzzySystem:
    """Return a washer of which each answer is larger by a share."""
    (output,) = system.outputs
    (label,) = output.terms
    assert isinstance(label.function, Singleton)
    moved = replace(label, function=Singleton(label.function.value * (1.0 + by)))
    return replace(system, outputs=(replace(output, terms=(moved,)),))


def test_a_number_that_is_off_by_a_billionth_is_found_among_unequal_bits() -> None:
    system = washer()
    (soaked,) = system.variables
    bell = replace(soaked, terms=(Term("dirty", Gaussian(0.0, 1.5)),))
    system = replace(system, variables=(bell,))
    data = np.array([[0.3, 1.0, 2.5]])
    agreement = check(system, shifted(system, 1e-9), limit=50, data=data)
    one = about(agreement, "file 1", "rows")
    assert one.verdict == "DISAGREES"
    assert one.differing >= 3
    assert one.allowed < 1e-11 < one.largest_difference


def test_rows_on_an_edge_are_counted_beside_the_table() -> None:
    # The rule passes from the very degree of dirt 1 on.
    system = washer()
    (soaked,) = system.variables
    bell = replace(soaked, terms=(Term("dirty", Gaussian(0.0, 1.5)),))
    edge = math.exp(-0.5 * (1.0 / 1.5) ** 2)
    only = Activation("threshold", threshold=edge)
    (block,) = system.blocks
    blocks = (replace(block, activation=only),)
    system = replace(system, variables=(bell,), blocks=blocks)
    other = shifted(system, 1e-15)
    agreement = check(
        system, other, limit=1, data=np.array([[1.0, 0.5]]), runtimes=["native"]
    )
    (rows,) = (
        c
        for c in agreement.comparisons
        if (c.representation, c.basis) == ("file 1", "rows")
    )
    assert (rows.rows, rows.unbounded) == (3, 1)
    assert rows.allowed < 1e-12


def test_a_check_reports_what_it_compares_next_and_how_far_it_is() -> None:
    system = random_system(2)
    parts: list[tuple[str, float]] = []
    check(
        system,
        system,
        runtimes=["native"],
        limit=20,
        progress=lambda text, share: parts.append((text, share)),
    )
    assert parts == [("comparing native", 0.0), ("comparing file 1", 0.5)]


def moved_outputs(outcome: Outcome) -> Outcome:
    assert outcome.outputs is not None
    return replace(outcome, outputs=outcome.outputs * (1.0 + 1e-12))


def last_status(outcome: Outcome) -> Outcome:
    status = outcome.status.copy()
    status[-1:] = 1
    return replace(outcome, status=status)


def swapped_activations(outcome: Outcome) -> Outcome:
    assert outcome.strengths is not None
    return replace(outcome, strengths=outcome.strengths[::-1])


def one_rule_less(outcome: Outcome) -> Outcome:
    assert outcome.strengths is not None
    return replace(outcome, strengths=outcome.strengths[1:])


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (moved_outputs, "output 'fan'"),
        (last_status, "status tie where"),
        (swapped_activations, "activation of rule"),
        (one_rule_less, "activation of rule"),
    ],
)
def test_a_runtime_of_systems_that_gives_other_results_is_found(
    change: Callable[[Outcome], Outcome],
    fault: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def load(model: FuzzySystem, *, with_strengths: bool = True) -> Run:
        run = run_system(model, with_strengths=with_strengths)
        return lambda values: change(run(values))

    liar = Runtime("liar", ("system",), load)
    monkeypatch.setattr("fuzzytree.runtimes.table.find_runtime", lambda name: liar)
    system = all_samples()["Mamdani, centroid"]
    agreement = check(system, limit=200, runtimes=["liar"])
    one = about(agreement, "liar", "rows")
    assert one.verdict == "DISAGREES"
    assert fault in " ".join(one.detail)
