"""What rows say about rules: exact counts, and shares with their intervals."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree.auditing.decide import Budget, OutOfStepsError
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import Declined, Sampled
from fuzzytree.auditing.findings import support
from fuzzytree.auditing.findings.domains import domain_of
from fuzzytree.auditing.findings.records import AuditAnswer, AuditSettings
from fuzzytree.auditing.findings.subject import AuditRows, Subject, view
from fuzzytree.auditing.findings.subject import subject_of as ready
from fuzzytree.auditing.findings.support import (
    answers,
    count_rows,
    sample_points,
    share_in_sample,
    wilson,
)
from fuzzytree.model import (
    Document,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    SCurve,
    Term,
    Variable,
)
from fuzzytree.numerics.exact import MISSING, TIE, UNCOVERED, exact_answer
from tests.auditing.decide.old_bases import random_base
from tests.auditing.findings.test_views import A_LOW, block_of, system_of

LOW = Term("low", Points((0.0, 1.0), (1.0, 0.0)))
HIGH = Term("high", Points((1.0, 3.0), (0.0, 1.0)))
RULES = RuleBase(
    "grip",
    ("soft", "hard"),
    (Variable("force", (LOW, HIGH), low=0.0, high=4.0),),
    (
        Rule((Proposition("force", ("low",)),), "soft"),
        Rule((Proposition("force", ("high",)),), "hard"),
    ),
)
FORCES = np.array([[0.0, 0.25, 1.0, 1.1, 3.0, 5.0, np.nan]])
CODES = np.array([0, 1, 0, 1, 1, -1, 0])


def subject_of(
    model: Document,
    rows: AuditRows | None = None,
    settings: AuditSettings | None = None,
) -> Subject:
    found = view(model, domain_of(model))
    return ready(found, settings or AuditSettings(rows=500), rows=rows)


def queries(subject: Subject) -> dict[str, AuditAnswer]:
    found = {one.subject: one for one in answers(subject)}
    assert {one.code for one in found.values()} == {"FT701"}
    return found


def sentences(found: dict[str, AuditAnswer], *names: str) -> list[str]:
    return [found[name].sentence for name in names]


@pytest.mark.parametrize(
    ("hits", "rows", "low", "high"),
    [
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_gives_the_intervals_of_newcombe_1998(
    hits: int, rows: int, low: float, high: float
) -> None:
    assert wilson(hits, rows) == pytest.approx((low, high), abs=5e-5)
    assert wilson(rows - hits, rows) == pytest.approx((1.0 - high, 1.0 - low), abs=5e-5)


def test_an_interval_holds_its_share_and_ends_at_certainty() -> None:
    assert wilson(0, 7)[0] == 0.0
    assert wilson(7, 7)[1] == 1.0
    for hits in range(8):
        low, high = wilson(hits, 7)
        assert low <= hits / 7 <= high


def test_rows_are_reported_rule_by_rule_and_together() -> None:
    found = queries(subject_of(RULES, AuditRows("grips.csv", FORCES, CODES)))
    assert sentences(
        found,
        *("rows with a missing value", "rows outside the domain", "uncovered rows"),
        *("weak rows", "tied rows", "close rows", "rule 1", "rule 2"),
    ) == [
        "on 1 of 7 rows a value is missing",
        "on 1 of 7 rows a value is outside the domain",
        "on 1 of 6 rows no rule fires",
        "on 2 of 6 rows no rule reaches 0.1",
        "on 0 of 6 rows rules of two classes tie",
        "on 0 of 6 rows the two strongest classes are at most 0.01 apart",
        "rule 1 fires on 2 of 6 rows and wins 2; 1 of these have its class 'soft'",
        "rule 2 fires on 3 of 6 rows and wins 3; 2 of these have its class 'hard'",
    ]
    state = found["rule 2"].state
    assert state == share_in_sample(
        "rows that rule 2 wins and that have its class",
        2,
        3,
        "of every row of grips.csv without a missing value, those that it wins",
    )
    findings = [one.subject for one in found.values() if one.is_finding]
    assert findings == [
        "rows with a missing value",
        "rows outside the domain",
        "uncovered rows",
        "weak rows",
    ]


def test_a_rule_without_rows_is_found_and_gone_when_it_is_removed() -> None:
    far = Term("far", Points((3.5, 4.0), (0.0, 1.0)))
    planted = replace(
        RULES,
        variables=(replace(RULES.variables[0], terms=(LOW, HIGH, far)),),
        rules=(*RULES.rules, Rule((Proposition("force", ("far",)),), "soft")),
    )
    values = np.array([[0.5, 2.0, 3.0]])
    found = queries(subject_of(planted, AuditRows("grips.csv", values)))
    assert found["rule 3"].is_finding
    assert found["rule 3"].sentence == "rule 3 fires on 0 of 3 rows and wins 0"
    assert found["rule 3"].rules == (3,)
    clean = queries(subject_of(RULES, AuditRows("grips.csv", values)))
    assert not any(one.is_finding for one in clean.values())


def test_a_rule_that_fires_and_never_wins_is_found() -> None:
    planted = replace(RULES, rules=(*RULES.rules, RULES.rules[0]))
    values = np.array([[0.5, 2.0]])
    found = queries(subject_of(planted, AuditRows("grips.csv", values)))["rule 3"]
    assert found.is_finding
    assert found.sentence == "rule 3 fires on 1 of 2 rows and wins 0"
    assert [(one.name, one.value) for one in found.measures] == [
        ("rows fired", 1),
        ("rows won", 0),
    ]


@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_counts_are_those_of_answers_in_fractions(conjunction: str) -> None:
    rules = random_base(3, 7, 4, conjunction, shared=0.5)  # type: ignore[arg-type]
    subject = subject_of(rules)
    values = sample_points(subject.rules, subject.domain, 60, 1)
    values[0, :3] = (np.nan, np.inf, 1e9)
    found = count_rows(subject, values)
    rows = [dict(zip(rules.inputs, row, strict=True)) for row in values.T.tolist()]
    exact = [exact_answer(rules, row) for row in rows]
    known = [one for one in exact if one.status != MISSING]
    covered = [one for one in known if one.status != UNCOVERED]
    settings = subject.settings
    assert found.rows["known"] == len(known)
    assert found.rows["uncovered"] == len(known) - len(covered)
    level, margin = Fraction(settings.epsilon), Fraction(settings.margin)
    assert found.rows["weak"] == sum(max(one.strengths) < level for one in known)
    assert found.rows["tied"] == sum(not one.margin for one in covered)
    assert found.rows["close"] == sum(one.margin <= margin for one in covered)
    assert found.won is not None
    for k in range(len(rules.rules)):
        assert found.fired[k] == sum(one.strengths[k] > 0 for one in known)
        assert found.won[k] == sum(one.rule == k + 1 for one in known)


def test_rows_exactly_at_an_end_a_level_and_a_margin_are_counted_exactly() -> None:
    rising = Points((0.0, 3.0), (0.0, 1.0))
    falling = Points((0.0, 3.0), (1.0, 0.0))
    terms = (Term("up", rising), Term("down", falling))
    rules = replace(
        RULES,
        variables=(Variable("force", terms, low=-1.0, high=4.0),),
        rules=(
            Rule((Proposition("force", ("up",)),), "soft"),
            Rule((Proposition("force", ("down",)),), "hard"),
        ),
    )
    tiny = 5e-324
    values = np.array([[0.0, tiny, 3.0, np.nextafter(3.0, 0.0), 1.5]])
    exact = [exact_answer(rules, {"force": float(x)}) for x in values[0]]
    found = count_rows(subject_of(rules), values)
    assert found.fired.tolist() == [4, 4]
    assert found.rows["tied"] == 1
    assert [one.status == TIE for one in exact] == [False] * 4 + [True]
    narrow = AuditSettings(epsilon=0.5, margin=float(exact[3].margin))
    again = count_rows(subject_of(rules, settings=narrow), values)
    assert again.rows["weak"] == 0
    assert again.rows["close"] == sum(
        one.margin <= Fraction(narrow.margin) for one in exact
    )


def test_points_are_drawn_within_the_domain_and_alike_for_a_seed() -> None:
    mix = Variable("mix", parts=(Part("force", 1.0), Part("slip", 1.0)))
    rules = replace(RULES, variables=(*RULES.variables, Variable("slip"), mix))
    box = Domain(
        (
            DomainSide("force", 0.0, 1.0),
            DomainSide("slip", 2.0, 2.0),
            DomainSide("mix", 2.5, 9),
        )
    )
    points = sample_points(rules, box, 400, 7)
    assert 150 < points.shape[1] < 250
    assert points[0].min() >= 0.5
    assert (points[1] == 2.0).all()
    assert np.array_equal(points, sample_points(rules, box, 400, 7))
    assert not np.array_equal(points[:, :9], sample_points(rules, box, 400, 8)[:, :9])


def test_shares_of_the_domain_are_reported_without_rows() -> None:
    found = queries(subject_of(RULES, settings=AuditSettings(rows=4000, seed=3)))
    assert isinstance(found["rows"].state, Declined)
    assert found["rows"].sentence == (
        "what rows say about the rules is not known: rows are needed (--data TABLE)"
    )
    state = found["weak points"].state
    assert isinstance(state, Sampled)
    assert state.low <= 0.3 / 4.0 <= state.high  # from 0.9 to 1.2 of 0 to 4
    assert state.how == "points drawn evenly from the domain, seed 3"
    assert not any(one.is_finding for one in found.values())


def test_a_domain_that_no_point_meets_is_declined() -> None:
    mix = Variable("mix", parts=(Part("force", 1.0),))
    rules = replace(RULES, variables=(*RULES.variables, mix))
    subject = subject_of(rules)
    box = Domain((*subject.domain.sides, DomainSide("mix", 50.0, 60.0)))
    found = queries(replace(subject, domain=box))["domain"]
    assert found.state == Declined(
        "FTD04", "no drawn point lies within the sides of the combinations"
    )


def test_of_a_system_only_firing_is_counted_and_gaps_only_if_it_is_whole() -> None:
    values = np.array([[0.0, 3.5], [0.0, 0.0]])
    whole = queries(subject_of(system_of(block_of(A_LOW)), AuditRows("pump", values)))
    assert whole["rule 1"].sentence == "rule 1 fires on 1 of 2 rows"
    assert whole["uncovered rows"].is_finding
    assert "tied rows" not in whole
    part = system_of(block_of(A_LOW, Proposition("power", ("big",))))
    found = queries(subject_of(part, AuditRows("pump", values)))
    assert "uncovered rows" not in found
    assert found["covered rows"].sentence == (
        "the number of covered rows is not known: rules are left out, and they may "
        "cover what the others do not"
    )


def test_counts_for_a_curve_between_lines_are_exact() -> None:
    system = system_of(block_of(A_LOW), low=SCurve(0.0, 4.0))
    clear, near = (
        np.array([[0.0, 3.0], [0.0, 0.0]]),
        np.array([[0.01, 3.0], [0.0, 0.0]]),
    )
    found = queries(subject_of(system, AuditRows("pump", clear)))
    assert found["rule 1"].sentence == "rule 1 fires on 1 of 2 rows"
    assert found["uncovered rows"].sentence == "on 1 of 2 rows no rule fires"
    found = queries(subject_of(system, AuditRows("pump", near)))
    assert found["rule 1"].sentence == "rule 1 fires on 2 of 2 rows"
    assert found["uncovered rows"].sentence == "on 0 of 2 rows no rule fires"


def test_a_spent_budget_stops_the_count() -> None:
    with pytest.raises(OutOfStepsError):
        count_rows(replace(subject_of(RULES), budget=Budget(1)), FORCES)


def test_of_a_model_of_many_propositions_fewer_points_are_drawn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(support, "_MOST_DEGREES", 1)
    subject = subject_of(RULES, settings=AuditSettings(rows=5000))
    found = queries(subject)["uncovered points"]
    assert isinstance(found.state, Sampled)
    assert found.state.rows == 1000
