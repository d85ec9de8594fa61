"""Rows as exact points, and places in order of how near they are to a row."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from fuzzytree.auditing.decide.cover import Sides
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.findings.robustness import (
    distance_measure,
    nearest_rows,
    row_points,
)
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.model.rulebase import Part, Variable
from fuzzytree.numerics.oracle import decide
from tests.auditing.findings.small_trees import subject_of, two_cuts

BOX = Domain((DomainSide("x", 0.0, 4.0), DomainSide("y", 0.0, 1.0)))
XY = (Variable("x"), Variable("y"))
ROWS = AuditRows("rows", np.array([[0.0, 1.0, np.nan], [0.0, 0.5, 0.0]]))


def _sides(**ends: tuple[float, float]) -> Sides:
    return {name: (Fraction(low), Fraction(high)) for name, (low, high) in ends.items()}


def test_boxes_have_their_distance_to_the_nearest_row() -> None:
    far, near, here = _sides(x=(3, 4)), _sides(y=(0.75, 1)), _sides(x=(-9, 2))
    results = nearest_rows([far, near, here], ROWS, BOX, XY)
    assert results == [(Fraction(1, 2), 2), (Fraction(1, 4), 2), (Fraction(0), 1)]


def test_a_box_of_a_combination_is_as_far_as_its_inputs_must_move() -> None:
    # From row 2, (1, 0.5), both move by r of their ranges: 1 + 4 r + 0.5 + r = 3.
    of = Variable("sum", parts=(Part("x", 1.0), Part("y", 1.0)))
    box = _sides(sum=(3, 9))
    assert nearest_rows([box], ROWS, BOX, [*XY, of]) == [(Fraction(3, 10), 2)]


def test_without_a_complete_row_nothing_is_near() -> None:
    empty = AuditRows("rows", np.array([[np.nan], [0.0]]))
    assert nearest_rows([_sides(x=(3, 4))], empty, BOX, XY) == []


def test_a_fixed_input_does_not_count() -> None:
    fixed = Domain((DomainSide("x", 2.0, 2.0), DomainSide("y", 0.0, 1.0)))
    rows = AuditRows("rows", np.array([[0.0], [0.0]]))
    box = _sides(x=(2, 2), y=(0.5, 1))
    assert nearest_rows([box], rows, fixed, XY) == [(Fraction(1, 2), 1)]


def test_equal_rows_stand_once_and_those_outside_are_left_out() -> None:
    rows = [[0.5, 0.5], [0.5, 0.5], [2.0, 0.5], [np.nan, 0.5], [0.25, 0.5]]
    subject = subject_of(two_cuts(0.75), rows=rows)
    assert subject.rows is not None
    assert sorted(row_points(subject, subject.rows)) == [1, 5]


def test_close_calls_come_first() -> None:
    rows = [[0.1, 0.5], [0.9, 0.5], [0.74, 0.5], [0.76, 0.5]]
    subject = subject_of(two_cuts(0.75), rows=rows)
    assert subject.rows is not None
    margins = [decide(subject.rules, np.array([row]).T).margin[0] for row in rows]
    wanted = sorted(range(1, 5), key=lambda number: margins[number - 1])
    assert [*row_points(subject, subject.rows)] == wanted


def test_a_long_exact_number_is_left_out_and_its_double_is_no_larger() -> None:
    third = Fraction(1, 3)
    assert distance_measure("d", third).exact == "1/3"
    long = Fraction(10**50 + 1, 3 * 10**50)
    results = distance_measure("d", long)
    assert results.exact is None
    assert Fraction(results.value) < long
