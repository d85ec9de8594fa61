"""Terms: a defect that is planted is found, and gone when it is removed."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest
from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import Declined, Proved
from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    AuditSelection,
    AuditSettings,
)
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.model.rulebase import (
    LR,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Shape,
    Term,
    Variable,
)
from fuzzytree.model.rulebase import Side as Half
from fuzzytree.numerics import exact_degree
from tests.auditing.findings.test_views import A_LOW, block_of, system_of

LOW = Term("low", Points((0.0, 1.0, 2.0), (1.0, 1.0, 0.0)))
HIGH = Term("high", Points((1.0, 2.0, 4.0), (0.0, 1.0, 1.0)))


def base(*terms: Term, high: float = 4.0) -> RuleBase:
    """Return one rule for each term of `force`, which goes from 0 to 4."""
    return RuleBase(
        "grip",
        ("soft", "hard"),
        (Variable("force", terms, unit="N", low=0.0, high=high),),
        tuple(
            Rule((Proposition("force", (term.name,)),), ("soft", "hard")[number % 2])
            for number, term in enumerate(terms)
        ),
    )


def found(
    rules: RuleBase, code: str, settings: AuditSettings | None = None
) -> list[AuditAnswer]:
    return [
        *audit(
            Material(rules), settings=settings, selection=AuditSelection(select=[code])
        ).findings
    ]


CLEAN = base(LOW, HIGH)


@pytest.mark.parametrize("code", ["FT401", "FT402", "FT403", "FT404"])
def test_a_clean_model_has_no_finding_about_terms(code: str) -> None:
    (answer,) = audit(Material(CLEAN), selection=AuditSelection(select=[code])).answers
    assert not answer.is_finding
    assert isinstance(answer.state, Proved)


def test_a_term_beyond_the_domain_is_empty() -> None:
    far = Term("far", Points((5.0, 6.0), (0.0, 1.0)))
    (answer,) = found(base(LOW, HIGH, far), "FT401")
    assert answer.sentence == (
        "term 'far' of 'force' is empty: its degree is 0 from 0 to 4"
    )
    assert answer.severity == "error"
    assert not found(base(LOW, HIGH, far, high=6.0), "FT401")


def test_a_term_that_is_hardly_reached_is_reported_with_its_height() -> None:
    faint = Term("faint", Points((3.0, 7.0), (0.0, 1.0)))
    (answer,) = found(base(LOW, HIGH, faint), "FT401")
    assert answer.sentence == (
        "term 'faint' of 'force' is hardly reached: "
        "its largest degree from 0 to 4 is 0.25, at 4"
    )
    assert (answer.severity, answer.measures[0].exact) == ("warning", "1/4")
    assert not found(base(LOW, HIGH, faint), "FT401", AuditSettings(level=0.25))


def test_a_step_at_an_open_lower_end_counts_from_above_only() -> None:
    spike = Term("spike", Points((0.0, 0.0), (1.0, 0.0)))
    domain = Domain((DomainSide("force", 0.0, 4.0),))
    rules = base(LOW, HIGH, spike)
    assert not audit(
        Material(rules), domain=domain, selection=AuditSelection(select=["FT401"])
    ).findings
    opened = Domain((DomainSide("force", 0.0, 4.0, is_open=True),))
    (answer,) = audit(
        Material(rules), domain=opened, selection=AuditSelection(select=["FT401"])
    ).findings
    assert "'spike' of 'force' is empty" in answer.sentence


def test_a_term_of_a_combination_is_tested_on_all_its_inputs_allow() -> None:
    mix = Variable(
        "mix",
        (Term("far", Points((3.0, 4.0), (0.0, 1.0))),),
        parts=(Part("a", 1.0), Part("b", -1.0)),
    )
    inputs = tuple(Variable(name, low=0.0, high=2.0) for name in "ab")
    rules = RuleBase(
        "m", ("x",), (*inputs, mix), (Rule((Proposition("mix", ("far",)),), "x"),)
    )
    (answer,) = found(rules, "FT401")
    assert "is empty: its degree is 0 from -2 to 2" in answer.sentence


@pytest.mark.parametrize(
    ("shape", "text"),
    [
        (
            LR(2.0, Half(1.0, (3.0,), 1.5), Half(1.0, (0.5,), 1.5)),
            "is clipped: its polynomial goes 2 below 0 between 1 and 1.668",
        ),
        (
            Points((0.0, 1.0, 2.0, 3.0, 4.0), (0.0, 1.0, 0.25, 0.5, 0.0)),
            "has 2 peaks: between 1 and 3 its degree falls to 0.25, at 2",
        ),
        (
            Points((0.0, 1.0, 2.0), (0.0, 0.75, 0.0)),
            "has no point of degree 1: its largest degree anywhere is 0.75",
        ),
        (
            Points((3.0, 5.0, 7.0), (0.0, 1.0, 0.0)),
            "lies outside of the domain for the most part: "
            "0.125 of its area is from 0 to 4",
        ),
    ],
    ids=["shortfall", "peaks", "subnormal", "outlying"],
)
def test_a_defect_of_shape_is_reported(shape: Shape, text: str) -> None:
    results = found(base(LOW, HIGH, Term("odd", shape)), "FT402")
    assert [answer.sentence for answer in results] == [f"term 'odd' of 'force' {text}"]


def test_a_polynomial_is_outside_only_where_its_curve_is_clipped() -> None:
    chance = random.Random(3)
    seen = {"FT402.above": 0, "FT402.below": 0}
    for _ in range(20):
        halves = (
            Half(0.8, tuple(chance.uniform(-2.0, 2.0) for _ in range(3)), 1.5)
            for _ in "lr"
        )
        shape = LR(chance.uniform(0.0, 4.0), *halves)
        for answer in found(base(LOW, Term("odd", shape)), "FT402"):
            if answer.message in seen:
                seen[answer.message] += 1
                (span,) = answer.region
                assert span.low is not None
                assert span.high is not None
                assert span.low <= answer.measures[1].value <= span.high
                middle = (Fraction(span.low) + Fraction(span.high)) / 2
                goal = 1 if answer.message == "FT402.above" else 0
                assert exact_degree(shape, middle) == goal
    assert min(seen.values()) > 5


def test_two_terms_for_one_thing_are_reported_with_their_shared_area() -> None:
    same = Term("mild", Points((0.0, 1.0, 2.5), (1.0, 1.0, 0.0)))
    (answer,) = found(base(LOW, HIGH, same), "FT403")
    assert answer.sentence == (
        "terms 'low' and 'mild' of 'force' are hard to distinguish: "
        "they share 0.8571 of their area; 'low' is nowhere above 'mild'"
    )
    assert answer.measures[0].exact == "6/7"
    assert not found(base(LOW, HIGH, same), "FT403", AuditSettings(overlap=0.9))


def test_equal_terms_share_all_of_their_area() -> None:
    (answer,) = found(base(LOW, HIGH, Term("same", LOW.shape)), "FT403")
    assert answer.sentence.endswith("they share 1 of their area; they are equal")


def test_terms_that_cross_are_reported_with_the_crossing() -> None:
    near = Term("near", Points((0.0, 0.5, 3.5), (1.0, 1.0, 0.0)))
    (answer,) = found(base(LOW, near), "FT403", AuditSettings(overlap=0.5))
    assert "they cross at 1.25 with degree 0.75" in answer.sentence


def test_many_pairs_are_reported_up_to_a_number_and_counted() -> None:
    terms = tuple(Term(f"t{n}", Points((n / 100, 4.0), (1.0, 0.0))) for n in range(8))
    made = audit(Material(base(*terms)), selection=AuditSelection(select=["FT403"]))
    *results, rest = made.answers
    assert (len(results), rest.is_finding) == (20, True)
    assert rest.sentence == (
        "0 pairs of terms share less than 0.75 of their area; "
        "8 pairs besides those listed share more"
    )


def test_curves_of_very_many_pieces_are_declined() -> None:
    values = tuple(float(n) for n in range(2100))
    many = Points(values, tuple(n % 2 / 1.0 for n in range(2100)))
    rules = base(Term("a", many), Term("b", many), high=1.0)
    answer = audit(Material(rules), selection=AuditSelection(select=["FT403"])).answers[
        0
    ]
    assert isinstance(answer.state, Declined)
    assert answer.state.code == "FTD05"


def test_a_domain_of_one_point_has_no_areas() -> None:
    made = audit(
        Material(CLEAN),
        domain=Domain((DomainSide("force", 1.0, 1.0),)),
        selection=AuditSelection(select=["FT403"]),
    )
    (answer,) = made.answers
    assert answer.sentence == (
        "0 pairs of terms share less than 0.75 of their area; "
        "1 pair have no area on the domain"
    )


def test_what_no_rule_uses_is_reported() -> None:
    idle = Variable("slip", (LOW,), low=0.0, high=4.0)
    forgotten = replace(CLEAN.variables[0], terms=(LOW, HIGH, Term("mid", LOW.shape)))
    rules = replace(CLEAN, variables=(forgotten, idle))
    assert [answer.sentence for answer in found(rules, "FT404")] == [
        "no rule uses variable 'slip'",
        "no rule uses term 'mid' of 'force'",
    ]


def test_an_input_of_a_used_combination_is_used() -> None:
    mix = Variable("mix", (LOW,), parts=(Part("a", 1.0), Part("b", 1.0)))
    inputs = tuple(Variable(name, low=0.0, high=1.0) for name in "ab")
    rules = RuleBase(
        "m", ("x",), (*inputs, mix), (Rule((Proposition("mix", ("low",)),), "x"),)
    )
    assert not found(rules, "FT404")


def test_a_system_is_read_itself_and_not_its_view() -> None:
    system = system_of(block_of(A_LOW))
    made = audit(Material(system), selection=AuditSelection(select=["FT404"]))
    results = [answer.sentence for answer in made.findings]
    assert all(text.startswith("no rule uses") for text in results)
