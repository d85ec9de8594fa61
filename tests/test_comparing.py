import math

import numpy as np

from fuzzytree.comparing import (
    Answers,
    Rows,
    compare_answers,
    compare_bits,
    compare_excused,
    compare_within,
    labels,
    margins,
)
from fuzzytree.contracts import Outcome
from fuzzytree.rulebase import (
    Band,
    Clause,
    Flank,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)

LOW = Term("low", Band(high=1.0, right=Flank(1.0, 3.0)))
CLAUSE = Clause("x", ("low",))
RULES = RuleBase(
    "r",
    ("a", "b"),
    (Variable("x", (LOW,)),),
    (Rule((CLAUSE,), "a"), Rule((CLAUSE,), "b"), Rule((CLAUSE,), "a")),
    Semantics(uncovered="b"),
)
ROWS = Rows(("x",), np.array([[1.0, 2.0, 3.0]]), np.arange(3), 1)


def answers(
    title: str, rule: list[int], status: list[int], strengths: list[list[float]]
) -> Answers:
    outcome = Outcome(np.array(rule), np.array(status), np.array(strengths))
    return Answers(title, RULES, outcome)


BASE = answers(
    "base",
    [1, 2, 0],
    [0, 0, 2],
    [[0.9, 0.2, 0.0], [0.5, 0.4, 0.0], [0.8, 0.1, 0.0]],
)


def test_equal_answers_agree() -> None:
    found = compare_bits(BASE, BASE, ROWS)
    assert (found.verdict, found.differing, found.flips) == ("agrees", 0, 0)


def test_one_ulp_of_a_strength_disagrees_with_equal_bits() -> None:
    moved = answers(
        "moved",
        [1, 2, 0],
        [0, 0, 2],
        [[math.nextafter(0.9, 1), 0.2, 0.0], [0.5, 0.4, 0.0], [0.8, 0.1, 0.0]],
    )
    found = compare_bits(moved, BASE, ROWS)
    assert (found.verdict, found.differing) == ("DISAGREES", 1)
    assert found.largest_difference == math.nextafter(0.9, 1) - 0.9
    assert found.detail == (
        "probe 1: x 1.0: base answers a (rule 1) with 0.9, "
        "moved a (rule 1) with 0.9000000000000001",
    )


def test_another_rule_of_the_same_class_disagrees_with_equal_bits() -> None:
    other = answers("other", [3, 2, 0], [0, 0, 2], [[0.9, 0.2, 0.0]] * 3)
    assert compare_bits(other, BASE, ROWS).verdict == "DISAGREES"


def test_nan_equals_nan_and_nothing_else() -> None:
    nothing = answers("nothing", [0, 0, 0], [3, 3, 3], [[math.nan] * 3] * 3)
    assert compare_bits(nothing, nothing, ROWS).verdict == "agrees"
    assert compare_bits(nothing, BASE, ROWS).largest_difference == math.inf


def test_classes_may_differ_only_within_twice_the_bound() -> None:
    # Row 2: b leads by 0.4 - 0.2; a carrier that answers a there needs a bound of 0.1.
    flipped = answers(
        "flipped",
        [1, 1, 0],
        [0, 0, 2],
        [[0.9, 0.3, 0.0], [0.5, 0.3, 0.0], [0.8, 0.1, 0.0]],
    )
    wide = compare_within(flipped, BASE, ROWS, allowed=np.full(3, 0.11), origin="test")
    assert (wide.verdict, wide.flips) == ("agrees", 1)
    assert wide.largest_flip_margin == 0.4 - 0.2
    narrow = compare_within(
        flipped, BASE, ROWS, allowed=np.full(3, 0.09), origin="test"
    )
    assert (narrow.verdict, narrow.differing) == ("DISAGREES", 1)


def test_a_difference_by_design_is_told_and_no_fault() -> None:
    other = answers("other", [2, 2, 0], [0, 0, 2], [[0.9, 0.2, 0.0]] * 3)
    told = compare_answers(other, BASE, ROWS, by_design=True)
    assert (told.verdict, told.flips) == ("differs by design", 1)
    assert compare_answers(other, BASE, ROWS).verdict == "DISAGREES"


def test_an_excused_row_may_differ_and_no_other() -> None:
    other = answers("other", [2, 2, 0], [0, 0, 2], [[0.9, 0.2, 0.0]] * 3)
    first = np.array([True, False, False])
    last = np.array([False, False, True])
    origin = "test"
    assert compare_excused(other, BASE, ROWS, excused=first, origin=origin).verdict == (
        "agrees"
    )
    assert compare_excused(other, BASE, ROWS, excused=last, origin=origin).verdict == (
        "DISAGREES"
    )


def test_labels_follow_the_rule_or_the_declared_answer() -> None:
    assert labels(BASE).tolist() == [0, 1, 1]


def test_a_margin_lies_between_classes_and_not_between_rules() -> None:
    found = margins(BASE)
    assert found is not None
    assert found.tolist() == [0.9 - 0.5, 0.4 - 0.2, 0.0]


def test_data_rows_are_numbered_from_one_behind_the_probes() -> None:
    assert [ROWS.name(0), ROWS.name(1), ROWS.name(2)] == ["probe 1", "row 1", "row 2"]
    assert ROWS.part(slice(None, None, 2)).name(1) == "row 2"
