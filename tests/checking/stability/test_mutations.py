"""For each criterion: a planted defect is found, and without it the criterion holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pytest

from fuzzytree.checking.stability.exactness import degenerate, edges, exactness, offsets
from fuzzytree.checking.stability.row_checks import (
    order,
    roundtrips,
    scaling,
    specials,
)
from fuzzytree.checking.stability.sensitivity import curves
from fuzzytree.errors import ReadError
from fuzzytree.exporters.table import find_format
from fuzzytree.model.contracts import Document, Model, Outcome, Run, Runtime
from fuzzytree.model.rulebase import LR, Band, Side, Term
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.probing import probe_values
from fuzzytree.testing import random_tree
from tests.checking.stability import defects, learners

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

RULES = defects.small_rules()


@pytest.fixture(scope="module")
def rows() -> FloatArray:
    return probe_values(RULES, 400)


def test_n1_finds_a_runtime_with_a_fixed_threshold(rows: FloatArray) -> None:
    result = scaling(RULES, [defects.ABSOLUTE], rows)
    assert result.verdict == "FAILS"
    assert result.detail[0].startswith("defective: rules, inputs times 2**-")
    assert scaling(RULES, [defects.NATIVE], rows).verdict == "holds"


def test_n1_finds_a_runtime_with_one_unit_for_all_inputs(rows: FloatArray) -> None:
    assert scaling(RULES, [defects.COMMON_SCALE], rows).verdict == "FAILS"
    assert scaling(RULES, [defects.NATIVE], rows).verdict == "holds"


def test_n3_finds_a_runtime_that_sums_over_the_batch(rows: FloatArray) -> None:
    result = order(RULES, [defects.BATCH_MEAN], rows)
    assert result.verdict == "FAILS"
    assert "answered differently in a batch of 1" in " ".join(result.detail)
    assert order(RULES, [defects.NATIVE], rows).verdict == "holds"


def test_n3_finds_a_runtime_that_refuses_tables_of_no_row(rows: FloatArray) -> None:
    def load(model: Document) -> Run:
        run = defects.NATIVE.load(model)

        def answer(values: FloatArray) -> Outcome:
            if not values.size:
                raise ReadError("the table has no row")
            return run(values)

        return answer

    result = order(RULES, [msgspec.structs.replace(defects.NATIVE, load=load)], rows)
    assert result.detail == (
        "native: rules: rows in a batch of 0 are refused: the table has no row",
    )


def test_n3_finds_a_runtime_that_drops_the_last_of_two_rows(rows: FloatArray) -> None:
    def load(model: Document) -> Run:
        run = defects.NATIVE.load(model)
        return lambda values: run(values[:, :1] if values.shape[1] == 2 else values)

    result = order(RULES, [msgspec.structs.replace(defects.NATIVE, load=load)], rows)
    assert result.detail[0] == "native: rules: 2 rows get 1 answers in a batch of 2"


@pytest.mark.parametrize(
    ("defect", "said"),
    [
        (defects.WARNS, "it warns: divide by zero encountered"),
        (defects.NO_SPREAD, "b is soft at 2.0: degree 0.0, not one"),
    ],
    ids=["warns", "no spread"],
)
def test_n4_finds_a_runtime_that_divides_by_nothing(defect: Runtime, said: str) -> None:
    result = degenerate(RULES, [defect])
    assert result.verdict == "FAILS"
    assert said in result.detail[0]
    for sound in (defects.NATIVE, defects.PLAIN):
        assert degenerate(RULES, [sound]).verdict == "holds"


@pytest.mark.heavy
def test_n2_finds_a_runtime_that_evaluates_in_raw_values() -> None:
    none = np.empty((2, 0))
    result = offsets(RULES, [defects.RAW_POWERS], none)
    assert result.verdict == "FAILS"
    assert "are beyond the bound: strengths off by" in result.detail[0]
    assert offsets(RULES, [defects.PLAIN], none).verdict == "holds"


@pytest.mark.parametrize(
    ("defect", "said"),
    [
        (defects.SWAPPED_EDGE, "a is low at 1.0: degree 0.9999999999999999, not one"),
        (defects.SOFT_ZERO, "degree 1e-17, not zero"),
    ],
    ids=["<= as <", "soft zero"],
)
def test_n5_finds_a_runtime_whose_edges_are_not_exact(
    defect: Runtime, said: str
) -> None:
    result = edges(RULES, [defect])
    assert result.verdict == "FAILS"
    assert said in " ".join(result.detail)
    assert edges(RULES, [defects.PLAIN]).verdict == "holds"


def test_n6_finds_a_runtime_that_takes_nan_for_0(rows: FloatArray) -> None:
    result = specials(RULES, [defects.NAN_IS_ZERO], rows)
    assert result.verdict == "FAILS"
    assert "break the policy on missing values" in result.detail[0]
    assert specials(RULES, [defects.NATIVE], rows).verdict == "holds"


def test_n8_finds_a_runtime_that_is_narrower_than_it_says(rows: FloatArray) -> None:
    result = exactness(RULES, [defects.SINGLE], rows)
    assert result.verdict == "FAILS"
    assert "strengths off by" in result.detail[0]
    assert exactness(RULES, [defects.NATIVE], rows).verdict == "holds"


def test_n8_finds_a_runtime_that_multiplies_by_a_reciprocal() -> None:
    rules = defects.one_rule(Term("third", Band(high=0.0, right=3.0)))
    values = probe_values(rules, 200)
    result = exactness(rules, [defects.NATIVE, defects.RECIPROCAL], values)
    assert result.verdict == "FAILS"
    assert "defective: rules: other bits than native: rules in" in result.detail[0]
    assert exactness(rules, [defects.NATIVE, defects.PLAIN], values).verdict == "holds"


def test_n8_finds_a_bound_that_is_too_small(rows: FloatArray) -> None:
    def tiny(_: Model) -> tuple[float, str]:
        return 1e-18, "a guess"

    narrow = find_runtime("native float32")
    claimed = msgspec.structs.replace(narrow, bound=tiny)
    assert exactness(RULES, [claimed], rows).verdict == "FAILS"
    assert exactness(RULES, [narrow], rows).verdict == "holds"


def test_n8_finds_a_tree_that_turns_at_another_value() -> None:
    tree = random_tree(3, leaves=6, combinations=0.0)
    values = probe_values(tree, 400)
    shifted = defects.on_values(lambda v: np.nextafter(v, np.inf))
    result = exactness(tree, [shifted], values)
    assert result.verdict == "FAILS"
    assert exactness(tree, [defects.NATIVE], values).verdict == "holds"


@pytest.mark.parametrize(
    ("shape", "said"),
    [
        (LR(0.0, Side(1.0, (1.0,)), Side(1.0, (0.0, 1.5))), "leaves [0, 1] by"),
        (LR(0.0, Side(1.0, (1.0,)), Side(1.0, (0.9, 0.4, -0.9))), "rises by"),
        (LR(0.0, Side(1.0, (1e6, -1e6, 1e6)), Side(1.0, (1.0,))), "roundings"),
    ],
    ids=["overshoot", "rise", "size"],
)
def test_n7_finds_a_curve_that_is_no_membership_function(
    shape: LR | Band, said: str
) -> None:
    result = curves(defects.one_rule(Term("odd", shape)))
    assert result.verdict == "FAILS"
    assert said in result.detail[0]
    assert curves(RULES).verdict == "holds"


def test_n9_finds_a_writer_of_six_digits(rows: FloatArray) -> None:
    rules = defects.one_rule(Term("third", Band(high=1 / 3, right=2 / 3)))
    values = probe_values(rules, 50)
    result = roundtrips(rules, [defects.six_digits()], values)
    assert result.verdict == "FAILS"
    assert "the model that comes back is not equal" in result.detail[0]
    assert roundtrips(rules, [find_format("yaml")], values).verdict == "holds"


def test_n1_finds_a_learner_with_a_fixed_threshold() -> None:
    table = defects.learning_table()
    bad = defects.tiny_learner(least=1e-6)
    assert learners.learner_scaling(bad, *table).verdict == "FAILS"
    sound = defects.tiny_learner()
    assert learners.learner_scaling(sound, *table).verdict == "holds"


def test_n2_finds_a_learner_that_subtracts_squares() -> None:
    table = defects.learning_table()
    bad = defects.tiny_learner(spread=defects.one_pass)
    assert learners.learner_offsets(bad, *table).verdict == "FAILS"
    sound = defects.tiny_learner()
    assert learners.learner_offsets(sound, *table).verdict == "holds"


def test_n3_finds_a_learner_whose_sums_have_an_order() -> None:
    table = defects.learning_table()
    bad = defects.tiny_learner(is_sorted=False)
    assert learners.learner_order(bad, *table).verdict == "FAILS"
    sound = defects.tiny_learner()
    assert learners.learner_order(sound, *table).verdict == "holds"


def test_n4_finds_a_learner_that_warns() -> None:
    result = learners.learner_degenerate(defects.tiny_learner(is_loud=True))
    assert result.verdict == "FAILS"
    assert result.detail[0] == "a column of 0.1: it warns: invalid value"
    assert learners.learner_degenerate(defects.tiny_learner()).verdict == "holds"


def test_n5_finds_half_open_windows() -> None:
    def closed(values: FloatArray, n: int) -> list[int]:
        return learners.rational_counts(values.tolist(), n)

    def half_open(values: FloatArray, n: int) -> list[int]:
        counts = closed(values, n)
        at_ends = learners.rational_counts([-v for v in values.tolist()], n)
        return [
            max(count - end % 2, 0) for count, end in zip(counts, at_ends, strict=True)
        ]

    assert learners.window_counts(half_open).verdict == "FAILS"
    assert learners.window_counts(closed).verdict == "holds"
