"""The regions of the leaves of a tree."""

from __future__ import annotations

import pytest

from fuzzytree.auditing.decide.states import Declined, Proved, Witness
from fuzzytree.auditing.findings import leaves
from fuzzytree.auditing.findings.leaves import answers, too_many_boxes
from fuzzytree.auditing.findings.records import AuditAnswer
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.numerics.exact import exact_answer
from fuzzytree.testing import random_tree
from tests.auditing.findings.small_trees import one_cut, subject_of, two_cuts


def _findings(subject: Subject) -> list[AuditAnswer]:
    return [answer for answer in answers(subject) if answer.is_finding]


def test_a_leaf_that_no_value_reaches_is_found_and_its_absence_too() -> None:
    [found] = _findings(subject_of(two_cuts(0.25)))
    assert (found.code, found.severity, found.rules) == ("FT101", "error", (2,))
    assert found.sentence == (
        "leaf 2 (rule 2) is never reached: "
        "the nodes for 'x' on its path exclude each other"
    )
    assert isinstance(found.state, Proved)
    assert _findings(subject_of(two_cuts(0.75))) == []


def test_a_leaf_beyond_the_domain_is_found() -> None:
    [found] = _findings(subject_of(two_cuts(0.75), limits={"x": (0.0, 0.7)}))
    assert found.sentence == (
        "leaf 3 (rule 3) is never reached: "
        "its path needs 'x' above 0.75, and the domain is 0 to 0.7"
    )


def test_a_leaf_beyond_what_a_combination_reaches_is_found() -> None:
    [found] = _findings(subject_of(two_cuts(0.25, combined=True)))
    assert found.sentence == (
        "leaf 2 (rule 2) is never reached: "
        "no input of the domain meets what its path needs of 'sum'"
    )
    assert _findings(subject_of(two_cuts(0.75, combined=True))) == []


def test_a_leaf_reached_at_one_value_alone_is_reached() -> None:
    subject = subject_of(two_cuts(0.75), limits={"x": (0.75, 1.0)})
    assert [found.rules for found in _findings(subject)] == [(1,)]
    at_edge = next(one for one in answers(subject) if one.rules == (2,))
    assert isinstance(at_edge.state, Witness)
    assert at_edge.state.point[0].exact == "3/4"


def test_each_leaf_has_its_region_as_a_sentence_a_box_and_a_share() -> None:
    results = [
        one for one in answers(subject_of(two_cuts(0.75))) if one.code == "FT205"
    ]
    assert [one.sentence for one in results] == [
        "leaf 1 decides 'a' where 'x' is at most 0.5",
        "leaf 2 decides 'b' where 'x' is above 0.5 and at most 0.75",
        "leaf 3 decides 'c' where 'x' is above 0.75",
    ]
    assert [one.measures[0].value for one in results] == [0.5, 0.25, 0.25]
    [span] = results[1].region
    assert (span.variable, span.low, span.high) == ("x", 0.5, 0.75)


def test_a_region_of_a_combination_has_no_share_of_volume() -> None:
    results = [*answers(subject_of(two_cuts(0.75, combined=True)))]
    second = next(one for one in results if one.subject == "leaf 2")
    assert second.sentence == (
        "leaf 2 decides 'b' where 'x' is above 0.5 and 'sum' is at most 0.75"
    )
    assert second.measures == ()


def test_the_shares_of_all_leaves_add_up_to_one() -> None:
    tree = random_tree(8, combinations=0.0)
    subject = subject_of(tree, limits=dict.fromkeys(tree.inputs, (-5.0, 5.0)))
    results = [one for one in answers(subject) if one.code == "FT205"]
    assert abs(sum(one.measures[0].value for one in results) - 1.0) < 1e-12


def test_the_point_of_a_region_is_decided_by_its_leaf_in_doubles_too() -> None:
    tree = random_tree(5, combinations=0.5)
    subject = subject_of(tree, limits=dict.fromkeys(tree.inputs, (-9.0, 9.0)))
    for one in answers(subject):
        if isinstance(one.state, Witness):
            point = {at.input: float(at.decimal) for at in one.state.point}
            assert (exact_answer(tree, point).rule,) == one.rules


def test_a_tree_of_one_leaf_decides_everywhere() -> None:
    tree = random_tree(1, leaves=1, inputs=1)
    results = [*answers(subject_of(tree))]
    assert results[0].sentence == "leaf 1 decides 'class 3' everywhere"


def test_rules_without_a_tree_have_no_leaves() -> None:
    assert [*answers(subject_of(subject_of(one_cut()).rules))] == []


def test_leaves_of_too_many_boxes_are_declined(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(leaves, "MOST_BOXES", 1)
    declined = too_many_boxes(two_cuts(0.75))
    assert isinstance(declined, Declined)
    assert declined.reason == "the leaves are made of 3 boxes, more than 1"


def test_many_regions_are_not_listed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(leaves, "MOST_LISTED", 1)
    results = [*answers(subject_of(two_cuts(0.25)))]
    assert [one.code for one in results] == ["FT205", "FT101", "FT101"]
    assert results[0].state == Declined(
        "FTD05", "the leaves are made of 2 boxes, more than 1"
    )
