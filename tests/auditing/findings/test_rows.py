"""Rows as exact points, and places in order of how near they are to a row."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import Claim, Proved, Span, Witness, coordinates
from fuzzytree.auditing.findings.records import AuditAnswer
from fuzzytree.auditing.findings.robustness import (
    distance_measure,
    rank_by_distance,
    row_points,
)
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.model.rulebase import Part, Variable
from fuzzytree.numerics.oracle import decide
from tests.auditing.findings.small_trees import subject_of, two_cuts

BOX = Domain((DomainSide("x", 0.0, 4.0), DomainSide("y", 0.0, 1.0)))
XY = (Variable("x"), Variable("y"))
ROWS = AuditRows("rows", np.array([[0.0, 1.0, np.nan], [0.0, 0.5, 0.0]]))


def _gap(name: str, *spans: Span) -> AuditAnswer:
    return AuditAnswer("FT301", name, "", Proved(""), is_finding=True, region=spans)


def test_gaps_are_ranked_by_their_distance_to_the_nearest_row() -> None:
    far, near = _gap("far", Span("x", 3.0, 4.0)), _gap("near", Span("y", 0.75, 1.0))
    first, second = rank_by_distance([far, near], ROWS, BOX, XY)
    assert (first.subject, second.subject) == ("near", "far")
    assert [one.name for one in first.measures] == [
        "distance to the nearest row, in ranges",
        "nearest row",
    ]
    assert [one.value for one in first.measures] == [0.25, 2]
    assert [one.exact for one in second.measures] == ["1/2", None]


def test_a_gap_that_holds_a_row_is_at_distance_zero() -> None:
    [results] = rank_by_distance([_gap("here", Span("x", None, 2.0))], ROWS, BOX, XY)
    assert results.measures[0].value == 0.0


def test_a_gap_of_a_combination_is_as_far_as_its_inputs_must_move() -> None:
    # From row 2, (1, 0.5), both move by r of their ranges: 1 + 4 r + 0.5 + r = 3.
    of = Variable("sum", parts=(Part("x", 1.0), Part("y", 1.0)))
    gap = _gap("sum", Span("sum", 3.0, None))
    [results] = rank_by_distance([gap], ROWS, BOX, [*XY, of])
    assert results.measures[0].exact == "3/10"
    assert results.measures[1].value == 2
    low, high = _gap("low", Span("sum", None, 1.0)), _gap("high", Span("sum", 2.0, 3.0))
    first, second = rank_by_distance([high, low], ROWS, BOX, [*XY, of])
    assert (first.subject, second.subject) == ("low", "high")
    assert first.measures[0].value == 0.0


def test_a_gap_without_a_region_is_measured_at_its_point() -> None:
    point = coordinates({"x": Fraction(3), "y": Fraction(1, 2)})
    state = Witness(point, (Claim("below", rules=(1,), level="0"),))
    gap = AuditAnswer("FT301", "here", "", state, True)
    [results] = rank_by_distance([gap], ROWS, BOX, XY)
    assert results.measures[0].value == pytest.approx(0.5, abs=1e-15)


def test_without_a_complete_row_nothing_is_ranked() -> None:
    empty = AuditRows("rows", np.array([[np.nan], [0.0]]))
    gap = _gap("here", Span("x", 3.0, 4.0))
    assert rank_by_distance([gap], empty, BOX, XY) == (gap,)


def test_a_fixed_input_does_not_count() -> None:
    fixed = Domain((DomainSide("x", 2.0, 2.0), DomainSide("y", 0.0, 1.0)))
    rows = AuditRows("rows", np.array([[0.0], [0.0]]))
    gap = _gap("here", Span("x", 2.0, 2.0), Span("y", 0.5, 1.0))
    [results] = rank_by_distance([gap], rows, fixed, XY)
    assert results.measures[0].value == 0.5


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
