"""What is shipped must answer as what was audited, and conventions hold everywhere."""

from __future__ import annotations

import itertools
import math
import re

import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree.auditing.decide.states import (
    Bracket,
    Computed,
    Declined,
    Sampled,
)
from fuzzytree.auditing.findings.records import AuditAnswer
from fuzzytree.auditing.findings.representations import (
    Result,
    agreement,
    agreement_answers,
    answers,
    convention_answers,
)
from fuzzytree.auditing.findings.subject import AuditRows, Subject
from fuzzytree.auditing.findings.support import sample_points
from fuzzytree.exporters.onnx import Output, write_onnx
from fuzzytree.model.agreement import Agreement, Comparison
from fuzzytree.model.contracts import Model
from fuzzytree.model.rulebase import Points, RuleBase, Term
from fuzzytree.runtimes.onnxruntime import OnnxModel, open_onnx
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree
from tests.auditing.findings.test_support import RULES, subject_of
from tests.auditing.findings.test_views import A_LOW, block_of, system_of

TREE = random_tree(9, leaves=6, inputs=3, combinations=0.0)  # each leaf is reached
OTHER = random_tree(4, leaves=6, inputs=3, combinations=0.0)
ALL: tuple[Output, ...] = ("label", "rule", "strengths", "status")
POINTS = np.array([[0.1, 0.9], [0.4, 0.2], [0.5, 0.5]])


def shipped(model: Model) -> OnnxModel:
    return open_onnx(write_onnx(model).content, "m.onnx")


def findings(subject: Subject, *others: Model | OnnxModel) -> list[AuditAnswer]:
    points = sample_points(subject.rules, subject.domain, 200, 0)
    result = agreement(subject, points, *others)
    every = agreement_answers(result.agreement), convention_answers(subject, result)
    return [one for one in itertools.chain(*every) if one.is_finding]


def test_all_forms_of_a_tree_answer_alike_in_all_runtimes() -> None:
    found = [*answers(subject_of(TREE))]
    assert not any(one.is_finding for one in found)
    by_name = {one.subject: one for one in found}
    assert by_name["representations, by proof"].sentence == (
        "2 representations are equal on every input"
    )
    assert isinstance(by_name["representations, by rows"].state, Computed)
    assert (
        "onnxruntime float32: raw rules"
        in by_name["representations, by rows"].state.how
    )
    assert {one.code for one in found} == {"FT601", "FT602"}


@pytest.mark.heavy
def test_a_damaged_graph_is_found_and_a_right_one_is_not() -> None:
    subject = subject_of(TREE)
    assert findings(subject, shipped(TREE)) == []
    found = findings(subject, shipped(OTHER))
    assert {one.code for one in found} == {"FT601", "FT602"}
    by_rows = next(one for one in found if "rows" in one.sentence)
    assert by_rows.severity == "error"
    assert by_rows.sentence.startswith("file 1 disagrees with the model in ")
    assert {one.name: one.value for one in by_rows.measures}["rows of another class"]


def test_shipped_rules_that_part_from_the_model_are_found() -> None:
    rules = rules_from_tree(TREE)
    assert findings(subject_of(rules), rules) == []
    damaged = replace(rules, rules=rules.rules[:-1])
    assert findings(subject_of(rules), damaged)


def test_what_a_number_type_can_change_is_bounded_and_how_often_is_sampled() -> None:
    rows = AuditRows("grips.csv", np.array([np.linspace(0.0, 4.0, 50)]))
    found = {one.subject: one for one in answers(subject_of(RULES, rows))}
    facts = found["rules in float32"]
    assert facts.sentence.startswith(
        "rules in float32: the class cannot change unless the two strongest "
    )
    assert isinstance(facts.state, Computed)
    assert facts.state.how.endswith("for values in the domain")
    names = {one.name: one.value for one in facts.measures}
    assert 0.0 < names["largest error seen"] <= names["certified error of a strength"]
    assert (
        names["margin that is certain"] == 2.0 * names["certified error of a strength"]
    )
    band = found["rules in float32, its band"].state
    assert isinstance(band, Sampled)
    assert band.rows == 50
    assert band.how == "every row of grips.csv"


def test_an_error_without_a_bound_lies_between_what_was_seen_and_1() -> None:
    found = {o.subject: o for o in answers(subject_of(random_tree(1)))}
    state = found["relative rules in float32"].state
    assert isinstance(state, Bracket)
    assert state.low < state.high == 1.0
    assert "can round across it" in state.why


def test_many_rows_are_drawn_from_by_the_seed() -> None:
    rows = AuditRows("grips.csv", np.array([np.linspace(0.0, 4.0, 9000)]))
    found = {one.subject: one for one in answers(subject_of(RULES, rows))}
    band = found["rules in float64, its band"].state
    assert isinstance(band, Sampled)
    assert (band.rows, band.how) == (500, "rows drawn from grips.csv, seed 0")


def test_what_was_not_compared_is_declined() -> None:
    text = "onnxruntime float64 is not installed (extra 'onnx')"
    other = "native float32: rules: term 'low' of 'force' is not wider than rounding"
    cells = "all cells one by one (1e+09 points): the proof covers them"
    skipped = Agreement("grip", "", (), skipped=(text, other, cells))
    found = [*agreement_answers(skipped)]
    assert [(one.subject, one.state) for one in found] == [
        ("onnxruntime float64", Declined("FTD08", text)),
        ("native float32", Declined("FTD08", other)),
    ]
    assert found[0].sentence == f"onnxruntime float64 is not compared: {text}"


def test_raw_rules_that_differ_from_their_tree_by_design_are_no_finding() -> None:
    one = Comparison("raw rules", "tree", "rows", 5, "differs by design", 3)
    found = Agreement("grip", "", (one,))
    assert [*agreement_answers(found)] == []


def test_a_system_is_compared_in_all_runtimes() -> None:
    found = [*answers(subject_of(system_of(block_of(A_LOW))))]
    assert [one.subject for one in found] == [
        *("representations, by rows", "representations, by calls"),
        *("missing values", "infinite values", "far outside"),
    ]
    assert not any(one.is_finding for one in found)


# --- conventions


def tied_rules() -> RuleBase:
    """Return rules of which two are equally strong wherever they fire."""
    again = replace(RULES.rules[0], then="hard")
    return replace(RULES, rules=(*RULES.rules, again))


def graph(rules: RuleBase) -> OnnxModel:
    return open_onnx(write_onnx(rules, outputs=ALL).content, "m.onnx")


def with_curves(low: Points, high: Points) -> RuleBase:
    terms = (Term("low", low), Term("high", high))
    force = replace(RULES.variables[0], terms=terms)
    return replace(tied_rules(), variables=(force,))


LOW = Points((0.0, 1.0), (1.0, 0.0))
HIGH = Points((1.0, 3.0), (0.0, 1.0))
PLANTED = {
    "ties": replace(tied_rules(), rules=RULES.rules),
    "ends of curves and cuts": with_curves(
        Points((0.0, math.nextafter(1.0, 2.0)), (1.0, 0.0)), HIGH
    ),
    "far outside": with_curves(LOW, Points((1.0, 3.0, 9.0), (0.0, 1.0, 0.0))),
}


@pytest.mark.parametrize("name", PLANTED)
def test_a_graph_that_breaks_a_convention_is_found_and_a_right_one_is_not(
    name: str,
) -> None:
    rules = tied_rules()
    subject = subject_of(rules)
    assert findings(subject, graph(rules)) == []
    answers = findings(subject, graph(PLANTED[name]))
    by_name = {one.subject: one for one in answers if one.code == "FT602"}
    finding = by_name[f"{name}, file 1"]
    assert finding.severity == "error"
    assert finding.sentence.startswith(f"{name}: file 1 differs from the model: ")


def test_each_convention_is_answered_with_its_rows() -> None:
    subject = subject_of(tied_rules())
    result = agreement(subject, POINTS[:1])
    found = {one.subject: one for one in convention_answers(subject, result)}
    assert [*found] == [
        *("missing values", "infinite values", "far outside"),
        *("ties", "ends of curves and cuts"),
    ]
    pattern = r"ties: \d+ representations give the same answers to \d+ generated rows"
    assert re.fullmatch(pattern, found["ties"].sentence)


def test_a_convention_that_no_row_shows_says_so() -> None:
    subject = subject_of(RULES)
    result = Result(Agreement("grip", "", ()), np.empty((1, 0)))
    found = [*convention_answers(subject, result)]
    assert found[0].sentence == "missing values: no generated row shows it"
