"""Candidates answer what the runtimes answer, and are timed on all of the rows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree.benchmarking.candidates import (
    READING,
    SESSION,
    Layouts,
    floors,
    found_of,
    gather,
    load_runtime,
    own,
    questions,
    variants,
)
from fuzzytree.benchmarking.judging import exact_sample, made_rows, measured_error
from fuzzytree.benchmarking.machine import after, machine, noise
from fuzzytree.benchmarking.records import Candidate, Machine
from fuzzytree.benchmarking.study import BenchSettings, bench, faults
from fuzzytree.errors import install_hint
from fuzzytree.model.contracts import Dtype, Outcome, Run, Runtime
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.model.system import Defuzzifier
from fuzzytree.numerics import bounds
from fuzzytree.runtimes.native import load
from fuzzytree.runtimes.onnxruntime import prepare
from fuzzytree.runtimes.table import all_runtimes, find_runtime, is_installed
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_system, random_tree
from tests.benchmarking.studies import error, point, timing

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

TREE = random_tree(4)
VALUES = made_rows(TREE, 60)[0]


def candidates() -> list[Candidate]:
    result, omitted = own(TREE, lambda rules, dtype: None, Layouts())
    names = {runtime.name for runtime in all_runtimes() if not is_installed(runtime)}
    assert {one.name for one in omitted} == names
    return result


@pytest.mark.one_in(3)
@pytest.mark.parametrize("one", candidates(), ids=lambda one: one.name)
def test_a_candidate_answers_its_question(one: Candidate) -> None:
    model = questions(TREE)[one.question]
    loaded = one.load(1)
    result = loaded.answer(VALUES)
    exact = found_of(load(model)(VALUES), model)
    assert np.array_equal(result.labels, exact.labels)
    if result.strengths is not None and exact.strengths is not None:
        assert np.abs(result.strengths - exact.strengths).max() < 1e-2
    loaded.call(VALUES)()
    loaded.call(VALUES[:, :1])()


def test_every_runtime_is_a_candidate_for_each_question_that_it_runs() -> None:
    expected = {
        f"{runtime.name}: {question}"
        for runtime in all_runtimes()
        if is_installed(runtime)
        for question in questions(TREE)
        if ("tree" if question == "tree" else "rules") in runtime.runs
    }
    assert {one.name for one in candidates()} == expected


def test_all_rows_of_a_rule_base_are_timed_block_by_block() -> None:
    rules = rules_from_tree(TREE)
    calls: list[tuple[int, ...]] = []

    def counted(model: object, *, with_strengths: bool = True) -> Run:
        def run(values: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> Outcome:
            calls.append(values.shape)
            return Outcome(np.zeros(1, np.int64), np.zeros(1, np.int64))

        return run

    loaded = load_runtime(Runtime("counted", ("rules",), counted), rules, Layouts(), 1)
    loaded.call(np.zeros((len(rules.inputs), 200_000)))()
    assert len(calls) == 4
    assert sum(rows for _, rows in calls) == 200_000


def test_sessions_share_a_table_until_the_rows_change() -> None:
    pytest.importorskip("onnxruntime")
    layouts, rules = Layouts(), rules_from_tree(TREE)
    double, mixed = prepare(rules), prepare(rules, dtype="mixed")
    single = prepare(rules, dtype="float32")
    table = layouts.table(VALUES, double)
    assert layouts.table(VALUES, mixed) is table
    assert layouts.table(VALUES, single).dtype == np.float32
    other = VALUES + 1.0
    assert np.array_equal(layouts.table(other, double), other.T)


def test_a_prepared_graph_answers_all_rows_of_its_table() -> None:
    pytest.importorskip("onnxruntime")
    one = prepare(TREE, threads=2)
    many = np.tile(VALUES, 2000)
    assert one.table(many).shape == (120_000, len(TREE.inputs))
    one.call(one.table(many))


def test_floors_read_all_rows_and_answer_nothing() -> None:
    result, _ = floors("tree")
    assert [one.name for one in result] == [READING, SESSION]
    for one in result:
        loaded = one.load(1)
        assert loaded.answer(VALUES).labels.tolist() == [-1] * 60
    total = result[0].load(1).call(VALUES)()
    assert isinstance(total, np.ndarray)
    assert np.array_equal(total, VALUES.sum(axis=1))


def test_what_is_not_installed_is_an_omission(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "fuzzytree.benchmarking.candidates.is_installed", lambda one: not one.modules
    )
    result, omitted = own(TREE, lambda rules, dtype: None, Layouts())
    assert not any(one.modules for one in result)
    whys = {one.name: one.why for one in omitted}
    assert whys["scikit-fuzzy"] == f"not installed ({install_hint('skfuzzy')})"
    assert whys["onnxruntime mixed"] == f"not installed ({install_hint('onnx')})"


def test_a_variant_tells_its_bound_once_it_is_loaded() -> None:
    result, _ = variants(TREE, lambda rules, dtype: (1e-15, "doubles"), Layouts())
    names = [one.name for one in result]
    assert "native, points 1e-03: raw rules" in names
    one = result[names.index("native, points 1e-03: raw rules")]
    assert one.bound is None
    certify = one.load(1).bound
    assert certify is not None
    bound = certify()
    assert bound is not None
    assert 1e-6 < bound[0] <= 1e-3 + 1e-15
    assert bound[1].endswith("lines within 0.001 of the curves, and doubles")


def test_a_variant_of_a_system_looks_at_fewer_samples_without_a_bound() -> None:
    system = random_system(4, formulas="none", defuzzifier="of curves")
    output = system.outputs[0]
    sampled = Defuzzifier("centroid", samples=60)
    system = replace(
        system,
        outputs=(replace(output, defuzzifier=sampled), *system.outputs[1:]),
    )
    result, _ = variants(system, lambda _model, _dtype: (1e-15, "doubles"), Layouts())
    named = {one.name: one for one in result}
    coarse = named["native, 20 samples: system"]
    assert "native, 100 samples: system" not in named
    loaded = coarse.load(1)
    assert loaded.bound is not None
    assert loaded.bound() is None
    sample = exact_sample(system, made_rows(system, 200)[0])
    measured = measured_error(loaded.answer(sample.values), sample, None, "")
    assert measured.largest is not None
    assert 1e-6 < measured.largest < 0.5


def test_a_rule_base_without_curves_has_no_variants() -> None:
    from fuzzytree.model.rulebase import Points, Term

    rules = rules_from_tree(TREE)
    flat = tuple(
        msgspec.structs.replace(
            v, terms=tuple(Term(t.name, Points((0.0,), (0.5,))) for t in v.terms)
        )
        for v in rules.variables
    )
    without_curves = msgspec.structs.replace(rules, variables=flat)
    assert variants(without_curves, lambda rules, dtype: None, Layouts()) == ([], [])


def test_nothing_is_certified_before_the_bound_is_used(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    row_counts: list[int] = []

    def certify(
        rules: RuleBase, dtype: Dtype, values: FloatArray
    ) -> bounds.Certificate:
        row_counts.append(values.shape[1])
        return bounds.certify(rules, dtype, values)

    monkeypatch.setattr("fuzzytree.benchmarking.candidates.certify", certify)
    result, _ = gather(TREE, VALUES)
    assert row_counts == []
    bounds_of_raw = [o.bound for o in result if o.bound and o.question == "raw rules"]
    assert len([bound() for bound in bounds_of_raw]) > 10
    assert row_counts == [VALUES.shape[1]] * 3  # once for each number type


def test_every_runtime_that_runs_foreign_code_is_tried_apart() -> None:
    result, _ = gather(TREE, VALUES)
    for one in result:
        runtime = one.name.partition(": ")[0]
        known = {r.name for r in all_runtimes()}
        if one.kind == "runtime" and runtime in known:
            assert one.modules == find_runtime(runtime).modules


# --- the machine


def quiet() -> Machine:
    return msgspec.structs.replace(machine(), cores=2, load_before=(0.3, 0.2, 0.1))


@pytest.mark.heavy
def test_a_quiet_machine_gives_no_doubt() -> None:
    one = point("native", 1000.0, error(0.0))
    result = after(quiet(), one.timings)
    assert result.stolen == 0.0
    assert [*noise(result, [one])] == []


@pytest.mark.heavy
def test_a_noisy_machine_is_reported_in_three_ways() -> None:
    wide = msgspec.structs.replace(timing(1000.0, spread=0.5), stolen=0.25)
    one = msgspec.structs.replace(point("native", 1.0, error(0.0)), timings=(wide,))
    busy = msgspec.structs.replace(quiet(), load_before=(1.9, 1.0, 1.0))
    assert [*noise(after(busy, one.timings), [one])] == [
        "the machine was noisy: for 25% of the time the process was ready and did not "
        "run; times are too high by about as much",
        "the machine was busy: its load was 1.9 on 2 cores before the study began",
        "the times are uncertain: half of the confidence intervals are wider than 57% "
        "of their median",
    ]


@pytest.mark.heavy
def test_stolen_time_is_weighed_by_what_was_measured() -> None:
    short = msgspec.structs.replace(timing(100.0), stolen=1.0)
    long = msgspec.structs.replace(timing(900.0), stolen=0.0)
    assert after(quiet(), [short, long]).stolen == pytest.approx(0.1)
    unknown = msgspec.structs.replace(timing(100.0), stolen=None)
    assert after(quiet(), [unknown]).stolen is None


@pytest.mark.heavy
def test_packages_that_are_not_installed_have_no_version() -> None:
    result = machine(["numpy", "no such package"]).versions
    assert "numpy" in result
    assert "no such package" not in result


@pytest.mark.heavy
@pytest.mark.parametrize("seed", [1])
def test_no_candidate_is_beyond_its_certified_bound(seed: int) -> None:
    tree = random_tree(seed)
    model = tree if seed == 1 else rules_from_tree(tree, "raw", conjunction="product")
    study = bench(model, plan=BenchSettings(rows=(1, 200), rounds=6, budget_s=600.0))
    assert [*faults(study.points)] == []
    assert len(study.points) > 20
    for one in study.points:
        exact = one.error
        if exact is not None and exact.bound is not None and exact.flips:
            assert exact.largest_flip_margin is not None
            assert exact.largest_flip_margin <= 2.0 * exact.bound, one.name
    assert math.isfinite(study.seconds)
