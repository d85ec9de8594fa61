import math

import numpy as np
import pytest

from fuzzytree.checking.certificates import compare_exact
from fuzzytree.checking.comparing import (
    Allow,
    ModelRun,
    RowSet,
    compare,
    excused,
    labels,
    margins,
    within,
)
from fuzzytree.model.agreement import Certified
from fuzzytree.model.contracts import Dtype, Outcome
from fuzzytree.model.rulebase import (
    Band,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.numerics.oracle import decide
from fuzzytree.testing import random_tree

LOW = Term("low", Band(high=1.0, right=3.0))
PROPOSITION = Proposition("x", ("low",))
RULES = RuleBase(
    "r",
    ("a", "b"),
    (Variable("x", (LOW,)),),
    (Rule((PROPOSITION,), "a"), Rule((PROPOSITION,), "b"), Rule((PROPOSITION,), "a")),
    Semantics(uncovered="b"),
)
ROWS = RowSet(("x",), np.array([[1.0, 2.0, 3.0]]), np.arange(3), 1)


def answers(
    title: str, rule: list[int], status: list[int], strengths: list[list[float]]
) -> ModelRun:
    outcome = Outcome(np.array(rule), np.array(status), np.array(strengths))
    return ModelRun(title, RULES, outcome)


BASE = answers(
    "base",
    [1, 2, 0],
    [0, 0, 2],
    [[0.9, 0.2, 0.0], [0.5, 0.4, 0.0], [0.8, 0.1, 0.0]],
)


def allowed(*limits: float) -> Allow:
    """Allow a difference of strengths in each of `ROWS`."""
    known = dict(zip(ROWS.values[0].tolist(), limits, strict=True))
    return within(lambda values: (np.array([known[x] for x in values[0]]), "test"))


def test_equal_answers_of_other_strengths_name_the_rule_that_differs() -> None:
    assert BASE.outcome.strengths is not None
    strengths = BASE.outcome.strengths.tolist()
    strengths[2][1] = 0.125
    moved = answers("moved", [1, 2, 0], [0, 0, 2], strengths)
    assert compare(moved, BASE, ROWS).detail == (
        "only strengths differ: every row has the same class",
        "row 1: x 2.0: strength of rule 3 0.125 where 0.1 is right",
    )


def test_equal_answers_agree() -> None:
    result = compare(BASE, BASE, ROWS)
    assert (result.verdict, result.differing, result.flips) == ("agrees", 0, 0)


def test_one_ulp_of_a_strength_disagrees_with_equal_bits() -> None:
    moved = answers(
        "moved",
        [1, 2, 0],
        [0, 0, 2],
        [[math.nextafter(0.9, 1), 0.2, 0.0], [0.5, 0.4, 0.0], [0.8, 0.1, 0.0]],
    )
    result = compare(moved, BASE, ROWS)
    assert (result.verdict, result.differing) == ("DISAGREES", 1)
    assert result.largest_difference == math.nextafter(0.9, 1) - 0.9
    assert result.detail == (
        "only strengths differ: every row has the same class",
        "generated row 1: x 1.0: strength of rule 1 0.9000000000000001 where 0.9 is "
        "right",
    )


def test_a_zero_of_the_other_sign_disagrees_with_equal_bits() -> None:
    signed = answers(
        "signed",
        [1, 2, 0],
        [0, 0, 2],
        [[0.9, 0.2, 0.0], [0.5, 0.4, -0.0], [0.8, 0.1, 0.0]],
    )
    result = compare(signed, BASE, ROWS)
    assert (result.verdict, result.differing) == ("DISAGREES", 1)
    assert result.detail == (
        "row 2: x 3.0: strength of rule 2 -0.0 where 0.0 is right",
    )


def test_another_rule_of_the_same_class_disagrees_with_equal_bits() -> None:
    other = answers("other", [3, 2, 0], [0, 0, 2], [[0.9, 0.2, 0.0]] * 3)
    assert compare(other, BASE, ROWS).verdict == "DISAGREES"


def test_nan_equals_nan_and_nothing_else() -> None:
    nothing = answers("nothing", [0, 0, 0], [3, 3, 3], [[math.nan] * 3] * 3)
    assert compare(nothing, nothing, ROWS).verdict == "agrees"
    assert compare(nothing, BASE, ROWS).largest_difference == math.inf


def test_classes_may_differ_only_within_twice_the_bound() -> None:
    # Row 2: b leads by 0.4 - 0.2; a representation that answers a there needs a bound
    # of 0.1.
    flipped = answers(
        "flipped",
        [1, 1, 0],
        [0, 0, 2],
        [[0.9, 0.3, 0.0], [0.5, 0.3, 0.0], [0.8, 0.1, 0.0]],
    )
    wide = compare(flipped, BASE, ROWS, allowed(0.11, 0.11, 0.11))
    assert (wide.verdict, wide.flips) == ("agrees", 1)
    assert wide.largest_flip_margin == 0.4 - 0.2
    narrow = compare(flipped, BASE, ROWS, allowed(0.09, 0.09, 0.09))
    assert (narrow.verdict, narrow.differing) == ("DISAGREES", 1)


def test_the_allowed_difference_is_that_of_the_row_with_the_largest_one() -> None:
    moved = answers(
        "moved",
        [1, 2, 0],
        [0, 0, 2],
        [[0.90625, 0.2, 0.0], [0.5, 0.40625, 0.0], [0.8, 0.1, 0.5]],
    )
    moved.outcome.strengths[0, 1] = 0.25  # type: ignore[index]  # it has strengths
    result = compare(moved, BASE, ROWS, allowed(0.00625000001, 0.2, 1.0))
    assert result.verdict == "agrees"
    assert (result.largest_difference, result.allowed) == (0.25 - 0.2, 0.2)
    assert (result.unbounded, result.largest_unbounded) == (1, 0.5)


def test_a_difference_by_design_is_reported_and_no_fault() -> None:
    other = answers("other", [2, 2, 0], [0, 0, 2], [[0.9, 0.2, 0.0]] * 3)
    result = compare(other, BASE, ROWS, kinds=("class",), by_design=True)
    assert (result.verdict, result.flips) == ("differs by design", 1)
    assert compare(other, BASE, ROWS, kinds=("class",)).verdict == "DISAGREES"


def test_another_rule_needs_two_rules_that_are_near() -> None:
    # Row 1: rule 1 leads rule 3 of its class by 0.1.
    strengths = BASE.outcome.strengths
    assert strengths is not None
    other = answers("other", [3, 2, 0], [0, 0, 2], strengths.tolist())
    assert compare(other, BASE, ROWS, allowed(0.051, 0, 0)).verdict == "agrees"
    narrow = compare(other, BASE, ROWS, allowed(0.049, 0, 0))
    assert narrow.detail == ("generated row 1: x 1.0: rule 3 where 1 is right",)


def test_one_rule_more_disagrees_in_every_row() -> None:
    strengths = BASE.outcome.strengths
    assert strengths is not None
    more = answers("more", [1, 2, 0], [0, 0, 2], [*strengths.tolist(), [0.0] * 3])
    assert compare(more, BASE, ROWS).differing == 3
    assert compare(BASE, more, ROWS).differing == 3


def test_an_excused_row_may_differ_and_no_other() -> None:
    strengths = BASE.outcome.strengths
    assert strengths is not None
    other = answers("other", [2, 2, 0], [0, 0, 2], strengths.tolist())
    first = excused(lambda values: values[0] == 1.0, "test")
    last = excused(lambda values: values[0] == 3.0, "test")
    result = compare(other, BASE, ROWS, first)
    assert (result.verdict, result.flips) == ("agrees", 1)
    assert result.origin == "test; equal bits in 2 rows"
    assert compare(other, BASE, ROWS, last).verdict == "DISAGREES"


def test_labels_follow_the_rule_or_the_declared_answer() -> None:
    assert labels(BASE).tolist() == [0, 1, 1]


def test_a_margin_lies_between_classes_and_not_between_rules() -> None:
    result = margins(BASE)
    assert result is not None
    assert result.tolist() == [0.9 - 0.5, 0.4 - 0.2, 0.0]


def test_data_rows_are_numbered_from_one_behind_the_probes() -> None:
    assert [ROWS.name(0), ROWS.name(1), ROWS.name(2)] == [
        "generated row 1",
        "row 1",
        "row 2",
    ]
    assert ROWS.part(slice(None, None, 2)).name(1) == "row 2"


# --- against exact arithmetic


NARROW = RuleBase(
    "r",
    ("a", "b"),
    (Variable("x", (LOW, Term("high", Band(low=2.0)))),),
    (Rule((PROPOSITION,), "a"), Rule((Proposition("x", ("high",)),), "b")),
)


def certified(
    values: list[float], strengths: list[list[float]], dtype: Dtype
) -> Certified:
    """Hold strengths against the exact ones of `a: low, b: above 2`; one probe."""
    fired = np.array(strengths)
    rows = RowSet(("x",), np.array([values]), np.arange(len(values)), 1)
    rule = np.where(fired.max(axis=0) > 0, fired.argmax(axis=0) + 1, 0)
    status = np.where(rule > 0, 0, 2)
    result = ModelRun("mine", NARROW, Outcome(rule, status, fired))
    return compare_exact(result, decide(NARROW, rows.values), rows, dtype=dtype)


def test_exact_strengths_agree_and_the_data_are_counted() -> None:
    result = certified([9.0, 1.0, 2.0], [[0.0, 1.0, 0.5], [1.0, 0.0, 0.0]], "float64")
    assert (result.verdict, result.on, result.rows) == ("agrees", "data", 2)
    assert (result.largest, result.flips, result.in_band) == (0.0, 0, 0)
    assert result.sentence == (
        "the class cannot change unless the two strongest classes differ by 6.7e-16 "
        "or less"
    )


def test_without_data_the_probes_are_counted() -> None:
    result = certified([1.0], [[1.0], [0.0]], "mixed")
    assert (result.on, result.rows) == ("probes", 1)


def test_a_strength_beyond_its_bound_disagrees_and_is_reported() -> None:
    result = certified([1.0, 2.0], [[1.0, 0.51], [0.0, 0.0]], "mixed")
    assert (result.verdict, result.flips) == ("DISAGREES", 0)
    assert result.detail == (
        "row 1: x 2.0: exactly a (rule 1), mine a (rule 1) with 0.51; a strength is "
        "off by 0.01, and 1.2e-07 is allowed",
    )


def test_a_flip_where_the_margin_is_wide_disagrees() -> None:
    result = certified([1.0, 2.0], [[1.0, 0.0], [0.0, 0.5]], "float64")
    assert (result.verdict, result.flips) == ("DISAGREES", 1)
    assert result.largest_flip_margin == pytest.approx(0.5)


def test_a_flip_beside_a_step_that_float32_cannot_tell_is_allowed() -> None:
    above = math.nextafter(2.0, 3.0)
    values, strengths = [1.0, above], [[1.0, 0.5], [0.0, 0.0]]
    assert certified(values, strengths, "float64").verdict == "DISAGREES"
    result = certified(values, strengths, "float32")
    assert (result.verdict, result.flips, result.in_band) == ("agrees", 1, 1)
    assert result.unbounded == 1


def test_cover_that_is_lost_and_gained_is_counted() -> None:
    near = math.nextafter(3.0, 0.0)
    low = RuleBase("r", ("a",), (Variable("x", (LOW,)),), (Rule((PROPOSITION,), "a"),))
    rows = RowSet(("x",), np.array([[near, 3.0]]), np.arange(2), 0)
    fired = np.array([[0.0, 1e-17]])
    actual = ModelRun("mine", low, Outcome(np.array([0, 1]), np.array([2, 0]), fired))
    result = compare_exact(actual, decide(low, rows.values), rows, dtype="float64")
    assert (result.cover_lost, result.cover_gained, result.verdict) == (1, 1, "agrees")


def test_a_path_that_leaves_the_tree_far_from_its_cuts_disagrees() -> None:
    tree = random_tree(1, leaves=2, inputs=1, combinations=0)
    (cut,) = tree.nodes[0].cuts[:1]
    values = np.array([[cut, math.nextafter(cut, math.inf), cut + abs(cut)]])
    rows = RowSet(tree.inputs, values, np.arange(3), 0)
    truth = decide(tree, values)
    wrong = Outcome(3 - truth.rule, truth.status)
    reading = ModelRun("mine", tree, wrong)
    assert labels(reading).tolist() != truth.label.tolist()
    assert compare_exact(reading, truth, rows, dtype="float64").verdict == "DISAGREES"
    near = RowSet(tree.inputs, values[:, :2], np.arange(2), 0)
    part = reading.part(slice(0, 2))
    result = compare_exact(part, decide(tree, near.values), near, dtype="float32")
    assert (result.verdict, result.flips, result.in_band) == ("agrees", 2, 2)
