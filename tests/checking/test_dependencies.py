"""The needs of a model are reported, and a pruned model is compared with it."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from fuzzytree.benchmarking import savings
from fuzzytree.benchmarking.savings import report, stages, with_all_columns
from fuzzytree.checking.dependencies import needs, prove
from fuzzytree.exporters.onnx import write_onnx
from fuzzytree.exporters.onnx_compare import contents
from fuzzytree.model.rulebase import (
    Part,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Variable,
)
from fuzzytree.report.needs import report_lines
from fuzzytree.semantics.lowering import forms, rules_from_tree
from fuzzytree.semantics.simplification import USES, Pruned, pruned
from fuzzytree.testing import random_system, random_tree
from tests.semantics.test_simplification import (
    ALL,
    FORCE,
    HARD,
    PATH,
    SOFT,
    base,
    force,
)

pytestmark = pytest.mark.usefixtures("few_objects")

ROOT = Path(__file__).resolve().parents[2]
OUTCOMES = ("native", "native mixed", "native float32", "best-first")


def operators_of(model: RuleBase) -> dict[str, int]:
    written = write_onnx(model, outputs=("label", "rule"), verify=False)
    return contents(written.content).operators


# --- needs


def test_an_input_that_no_rule_tests_is_listed_as_idle() -> None:
    mix = Variable("mix", (HARD,), parts=(Part("slip", 1.0), Part("speed", 2.0)))
    known = (FORCE, Variable("slip"), Variable("speed"), Variable("heat"), mix)
    rules = base((force("soft"),), (Proposition("mix", ("hard",)),), variables=known)
    result = needs(rules)
    assert result.inputs == ("force", "slip", "speed")
    assert result.idle_inputs == ("heat",)
    assert result.combinations == ("mix",)
    assert [one.where for one in result.idle] == [
        "term 'firm' of 'force'",
        "term 'hard' of 'force'",
        "input 'heat'",
    ]


def test_a_graph_holds_nothing_for_what_the_rules_do_not_have() -> None:
    operators = operators_of(base((force("soft"),), (force("hard"),)))
    assert operators["ArgMax"] == 1
    assert not {"Max", "Concat_2", "Slice"} & operators.keys()


def test_an_or_a_negation_and_a_missing_answer_have_operators_of_their_own() -> None:
    rules = base(
        (force("soft", "hard"),),
        (force("firm", negated=True),),
        semantics=Semantics(missing="a"),
    )
    operators = operators_of(rules)
    plain = operators_of(base((force("soft"),), (force("firm"),)))
    more = {name: operators[name] - plain.get(name, 0) for name in operators}
    assert (more["Max"], more["Sub"], more["Where"]) == (1, 1, 1)


def test_an_input_of_combinations_alone_is_guarded_by_them() -> None:
    """No weight is 0, so the sum is not finite where a part is not."""
    rules = rules_from_tree(random_tree(5, inputs=3, combinations=1.0))
    assert {v.name for v in rules.variables if v.terms}.isdisjoint(rules.inputs)
    native = prove(rules, Pruned(rules, (), ()), runtimes=("onnxruntime float64",))
    assert native.ok


def test_the_carriers_of_a_tree_are_those_it_can_serve() -> None:
    tree = random_tree(1)
    assert list(forms(tree)) == ["tree", "relative rules", "raw rules"]
    assert list(forms(pruned(tree).model)) == ["tree", "relative rules"]
    assert list(forms(tree, ("raw",))) == ["raw rules"]
    assert list(forms(rules_from_tree(tree), ("raw",))) == ["rules"]


# --- the proof

SEEDS = st.integers(0, 10_000)


@pytest.mark.heavy
@given(SEEDS)
@settings(max_examples=12, deadline=None)
def test_a_pruned_model_answers_with_the_same_bits(seed: int) -> None:
    tree = random_tree(seed, leaves=1 + seed % 7, inputs=1 + seed % 4)
    result = prove(
        tree, pruned(tree, uses=USES), uses=USES, runtimes=OUTCOMES, limit=300
    )
    assert result.ok, result
    for kind in ("relative", "raw"):
        rules = rules_from_tree(tree, kind)
        left = pruned(rules, inputs=True, rules=True)
        proof = prove(rules, left, runtimes=OUTCOMES, limit=300)
        assert proof.ok, proof
        assert proof.comparisons[0].basis == "proof"


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(15))
def test_pruned_models_answer_alike_in_every_onnx_type(seed: int) -> None:
    tree = random_tree(seed, leaves=2 + seed % 9, inputs=1 + seed % 5)
    runtimes = ("onnxruntime float64", "onnxruntime mixed", "python", "reference")
    assert prove(tree, pruned(tree, uses=USES), uses=USES, runtimes=runtimes).ok
    raw = rules_from_tree(tree, "raw")
    assert prove(raw, pruned(raw, rules=True), runtimes=runtimes).ok


def test_rows_that_only_the_pruned_model_answers_are_counted_as_a_change() -> None:
    rules = base(*ALL, variables=(FORCE, Variable("slip")))
    data = np.array([[1.0, 1.0], [0.0, np.nan]])
    result = prove(rules, pruned(rules, inputs=True), data=data)
    assert result.ok
    same, changed = result.comparisons[1:]
    assert (same.verdict, same.differing) == ("agrees", 0)
    assert changed.verdict == "differs by design"
    assert changed.differing == changed.rows > 0


def test_the_strength_of_a_rule_that_is_gone_must_be_zero() -> None:
    rules = base((force("soft"),), (force("hard"),))
    one = replace(rules, rules=rules.rules[:1])
    result = prove(rules, Pruned(one, (), (1,)))
    proof, rows = result.comparisons
    assert proof.detail == ("rule 2 may fire and is gone",)
    assert rows.verdict == "DISAGREES"


def test_a_used_term_that_was_dropped_is_caught_by_proof_and_by_rows() -> None:
    rules = base((force("soft", "firm"),), (force("hard"),))
    planted = base((force("soft"),), (force("hard"),))
    result = prove(rules, Pruned(planted, ()))
    assert [c.verdict for c in result.comparisons] == ["DISAGREES", "DISAGREES"]


def test_a_cut_that_was_moved_is_caught() -> None:
    tree = random_tree(2, leaves=2, inputs=1)
    other = random_tree(3, leaves=2, inputs=1)
    assert not prove(tree, Pruned(other, ())).ok


def test_data_of_another_shape_is_one_sentence() -> None:
    rules = base((force("soft"),))
    message = r"^data must have shape \(1, rows\), not \(2, 3\)$"
    with pytest.raises(ValueError, match=message):
        prove(rules, pruned(rules), data=np.zeros((2, 3)))


# --- savings


def test_a_model_with_all_columns_answers_a_complete_row_alike() -> None:
    tree = random_tree(4, inputs=2, combinations=0.0)
    wide = replace(tree, columns=("note", *tree.columns, "weight"))
    declared = with_all_columns(wide)
    assert declared.inputs == ("note", *tree.columns, "weight")
    assert list(stages(wide, wide)) == ["all columns", "as it is", "pruned"]
    result = prove(declared, pruned(declared, inputs=True), limit=400)
    assert result.ok


def test_a_model_that_needs_every_column_has_two_stages() -> None:
    rules = base((force("soft"),))
    assert list(stages(rules, rules)) == ["as it is", "pruned"]


def test_a_pruned_model_is_nowhere_larger() -> None:
    tree = random_tree(6, leaves=6)
    footprint = report(tree, pruned(tree, uses=PATH), uses=PATH)
    before, after = footprint.sizes[-2:]
    for one, two in zip(before.files, after.files, strict=True):
        assert (one.representation, one.format, one.dtype) == (
            two.representation,
            two.format,
            two.dtype,
        )
        assert two.bytes <= one.bytes
    assert after.files[0].bytes < before.files[0].bytes


def test_costs_are_measured_in_every_stage(tmp_path: Path) -> None:
    table = tmp_path / "rows.csv"
    table.write_text("force,slip\n1,2\n3,4\n", "utf-8")
    rules = replace(base((force("soft"),)), columns=("force", "slip"))
    models = stages(rules, pruned(rules).model)
    result, omissions = savings.costs(
        models, PATH, table=str(table), seconds=60.0, rounds=1
    )
    assert omissions == ()
    names = {(c.stage, c.runtime, c.what) for c in result}
    whats = [
        ("native", "one row"),
        ("native", "10,000 rows"),
        ("onnxruntime", "open"),
        ("onnxruntime", "one row"),
        ("onnxruntime", "10,000 rows"),
        ("", "read the table"),
    ]
    assert names == {(stage, *what) for stage in models for what in whats}


@pytest.mark.heavy
def test_a_tree_of_one_leaf_needs_nothing_and_is_timed() -> None:
    tree = random_tree(1, leaves=1)
    footprint = report(tree, pruned(tree), budget_s=600.0)
    assert footprint.proof.ok
    assert footprint.needs.inputs == ()
    assert {cost.what for cost in footprint.costs} == {"open", "one row", "10,000 rows"}
    assert [size.row_bytes for size in footprint.sizes] == [8 * len(tree.columns), 0, 0]


def test_what_the_time_does_not_reach_is_an_omission() -> None:
    result, omissions = savings.costs(
        {"as it is": base((force("soft"),))}, PATH, seconds=1e-9
    )
    assert result == ()
    assert "as it is rules native one row: the time was over" in omissions


def test_an_interruption_ends_the_measuring_and_is_passed_on() -> None:
    def interrupt(text: str, share: float) -> None:
        raise KeyboardInterrupt

    rules = base((force("soft"),))
    with pytest.raises(KeyboardInterrupt):
        savings.costs({"as it is": rules}, (), seconds=60.0, progress=interrupt)


def test_a_table_that_cannot_be_read_is_an_omission() -> None:
    rules = base((force("soft"),))
    _, omissions = savings.costs({"as it is": rules}, (), table="no.csv", seconds=0.05)
    assert omissions[:1] == (
        "reading no.csv, as it is: no.csv: cannot be read: no such file or directory",
    )


def test_what_float32_cannot_hold_is_an_omission() -> None:
    huge = replace(HARD, function=replace(HARD.shape, low=1e300, high=None))
    rules = base((force("hard"),), variables=(Variable("force", (huge,)),))
    footprint = report(rules, pruned(rules))
    assert len(footprint.omissions) == 1
    assert "float32" in footprint.omissions[0]


def test_a_report_fits_its_schema_and_says_the_same_in_words() -> None:
    tree = random_tree(3, leaves=4)
    footprint = report(tree, pruned(tree), budget_s=0.2)
    facts = json.loads(footprint.to_json())
    schema = json.loads((ROOT / "schemas" / "needs.schema.json").read_bytes())
    jsonschema.Draft202012Validator(schema).validate(facts)
    text = "\n".join(report_lines(footprint, is_verbose=True))
    assert facts["needs"]["model"] in text
    for one in footprint.removed:
        assert one.where in text


def test_a_long_list_ends_with_a_count() -> None:
    rule = Rule((force("soft"),), "a")
    terms = tuple(replace(SOFT, name=f"soft {k}") for k in range(20))
    variable = Variable("force", (SOFT, *terms))
    rules = RuleBase("grip", ("a",), (variable,), (rule,))
    lines = list(report_lines(report(rules, pruned(rules))))
    assert "and 14 more parts; --verbose lists all" in lines


# --- fuzzy systems


@pytest.mark.parametrize("seed", range(30))
def test_a_pruned_system_answers_the_same_bits(seed: int) -> None:
    system = random_system(seed)
    rules = [
        replace(rule, weight=0.0 if place % 3 == 1 else rule.weight)
        for place, rule in enumerate(system.rules)
    ]
    order = iter(rules)
    blocks = [
        replace(block, rules=tuple(next(order) for _ in block.rules))
        for block in system.blocks
    ]
    system = replace(system, blocks=tuple(blocks))
    for drops in (False, True):
        left = pruned(system, inputs=drops, rules=drops)
        proof = prove(system, left, limit=300)
        assert proof.ok, [one.detail for one in proof.comparisons]
        bases = [one.basis for one in proof.comparisons]
        assert bases[:2] == ["proof", "rows"]


def test_another_system_is_no_pruned_system() -> None:
    system = random_system(3)
    low, *others = system.outputs
    changed = replace(system, outputs=(replace(low, default=0.125), *others))
    proof = prove(system, Pruned(changed, ()), limit=300)
    assert proof.comparisons[0].verdict == "DISAGREES"


def test_the_needs_of_a_system_count_the_terms_of_its_outputs() -> None:
    system = random_system(3)
    result = needs(system)
    assert result.outputs == ("y1", "y2")
    assert result.rules == len(system.rules)
    assert result.terms == sum(len(one.terms) for one in system.all_variables)
