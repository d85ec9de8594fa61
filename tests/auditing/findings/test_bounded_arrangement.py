"""Weights and curves between lines: answers are true of the system itself."""

from __future__ import annotations

import functools
import math
import random
from collections.abc import Iterator
from fractions import Fraction

import pytest
from msgspec.structs import replace

from fuzzytree.auditing.engine.arrangement import arrange
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.auditing.engine.states import Bracket, Witness
from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.bounded_arrangement import BoundedArrangement
from fuzzytree.auditing.findings.domains import domain_of
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    AuditSelection,
    AuditSettings,
)
from fuzzytree.auditing.findings.rule_bounds import bounded_rules
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.auditing.findings.views import view
from fuzzytree.model import (
    LR,
    And,
    Bell,
    Conclusion,
    Condition,
    Curve,
    Defuzzifier,
    FuzzySystem,
    Gaussian,
    Hedge,
    Not,
    Or,
    Points,
    Proposition,
    Rule,
    RuleBase,
    RuleBlock,
    SCurve,
    Sigmoid,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    TNorm,
    Variable,
    sentence,
)
from fuzzytree.model import Side as Flank
from fuzzytree.numerics.exact import exact_answer
from fuzzytree.semantics.inference import infer
from tests.auditing.findings.grids import check_on_grid

A, B = Proposition("a", ("low",)), Proposition("b", ("low",))
A_HIGH, B_HIGH = Proposition("a", ("high",)), Proposition("b", ("high",))
FLAT_A, LATE_B = Proposition("a", ("flat",)), Proposition("b", ("late",))
ROUNDING = 1e-12
NORMS = ("minimum", pytest.param("product", marks=pytest.mark.heavy))
LOW, HIGH = Gaussian(0.0, 1.0), Gaussian(4.0, 1.0)
Rules = tuple[tuple[Condition | None, str, float], ...]


def system_of(
    rules: Rules,
    *,
    norm: TNorm = "minimum",
    low: Curve = LOW,
    high: Curve = HIGH,
    **others: Curve,
) -> FuzzySystem:
    """Return a system of two inputs from 0 to 4, with one output."""
    labels: tuple[Term, ...] = (Term("low", low), Term("high", high))
    labels += tuple(Term(name, curve) for name, curve in others.items())
    inputs = tuple(Variable(name, labels, low=0.0, high=4.0) for name in ("a", "b"))
    thens = dict.fromkeys(then for _, then, _ in rules)
    output = SystemOutput(
        "power",
        tuple(Term(then, Singleton(float(k))) for k, then in enumerate(thens)),
        None,
        None,
        Defuzzifier("weighted average"),
    )
    block = RuleBlock(
        tuple(SystemRule(w, (Conclusion("power", t),), v) for w, t, v in rules),
        conjunction=norm,
    )
    return FuzzySystem("pump", inputs, (output,), (block,))


def results(system: FuzzySystem, code: str, **settings: float) -> list[AuditAnswer]:
    made = replace(AuditSettings(), **settings)
    answers = audit(
        Material(system), settings=made, selection=AuditSelection(select=[code])
    ).answers
    return [one for one in answers if one.code == code]


def findings(system: FuzzySystem, code: str, **settings: float) -> list[str]:
    return [one.sentence for one in results(system, code, **settings) if one.is_finding]


# --- weights


@pytest.mark.parametrize("norm", ["minimum", "product"])
def test_a_weight_is_part_of_strengths_exactly(norm: TNorm) -> None:
    ramp, tent = (
        Points((0.0, 4.0), (0.0, 1.0)),
        Points((0.0, 1.0, 3.0), (0.0, 1.0, 0.0)),
    )
    conditions = (
        *(A, Not(A), And((A, B_HIGH)), And((Not(A), B))),
        *(Or((A, A_HIGH)), Not(Or((A, A_HIGH))), None),
    )
    rules = tuple((one, "big", w) for one in conditions for w in (0.5, 0.25, 1.0))
    system = system_of(rules, norm=norm, low=ramp, high=tent)
    found = view(system, domain_of(system))
    assert found.bounds is not None
    assert not found.bounds.rules
    assert found.is_whole
    for row in rows(30):
        right = infer(system, row).activations
        exact = exact_answer(found.bounds.lower, row).strengths
        assert [float(one) for one in exact] == list(right)


def rows(count: int) -> Iterator[dict[str, float]]:
    """Yield rows of quarters: products of a few of them are doubles."""
    chance = random.Random(3)
    for _ in range(count):
        yield {name: chance.randrange(17) / 4.0 for name in ("a", "b")}


def test_a_weight_whose_products_are_rounded_lies_between_doubles() -> None:
    tent = Points((0.0, 1.0, 3.0), (0.0, 0.7, 0.1))
    system = system_of(((A, "big", 0.3),), low=tent)
    found = view(system, domain_of(system))
    assert found.bounds is not None
    assert found.bounds.rules == {1}
    assert 0.0 < found.bounds.gap < 1e-15
    for row in rows(20):
        low, high = (
            exact_answer(one, row).strengths[0]
            for one in (found.bounds.lower, found.bounds.upper)
        )
        (right,) = exact_answer(rules_of(Term("low", tent)), row).strengths
        assert low <= Fraction(0.3) * right <= high


def rules_of(term: Term) -> RuleBase:
    variables = (Variable("a", (term,)), Variable("b"))
    return RuleBase(
        "pump", ("x",), variables, (Rule((Proposition("a", (term.name,)),), "x"),)
    )


def test_a_weighted_curve_of_polynomials_is_bounded_by_lines() -> None:
    side = Flank(1.0, (0.5,), 2.0)
    term = Term("low", LR(1.0, side, side))
    weighted = bounded_rules(
        rules_of(term), [0.5], {}, {"a": (Fraction(0), Fraction(4)), "b": None}
    )
    assert weighted is not None
    assert weighted.rules == {1}
    for row in rows(20):
        low, high = (
            exact_answer(one, row).strengths[0]
            for one in (weighted.lower, weighted.upper)
        )
        (right,) = exact_answer(rules_of(term), row).strengths
        assert low <= right / 2 <= high


def test_a_weight_on_a_curve_without_points_is_declined() -> None:
    side = Flank(1.0, (0.5,), 2.0)
    rules: Rules = ((A, "big", 0.5), (A, "big", 1.0))
    system = system_of(rules, low=LR(1.0, side, side))
    found = view(system, Domain(()))
    assert found.numbers == (2,)
    assert [one.sentence for one in found.declined if one.code == "FTD07"] == [
        "rule 1 is left out: the curve of 'low' of 'a' has no points to be weighted"
    ]


def test_a_term_that_has_the_name_of_a_weighted_one_stays_itself() -> None:
    ramp, other = Points((0.0, 4.0), (0.0, 1.0)), Points((0.0, 4.0), (1.0, 0.0))
    rules: Rules = ((A, "big", 0.5), (Proposition("a", ("low x 0.5",)), "big", 1.0))
    others: dict[str, Curve] = {"low x 0.5": other}
    system = system_of(rules, norm="minimum", low=ramp, high=HIGH, **others)
    found = view(system, domain_of(system))
    assert found.bounds is not None
    strengths = exact_answer(found.bounds.lower, {"a": 1.0, "b": 0.0}).strengths
    assert strengths == (Fraction(1, 8), Fraction(3, 4))


def test_a_rule_without_weight_is_not_the_copy_of_a_weighted_one() -> None:
    rules: Rules = ((A, "big", 1.0), (A, "big", 0.5))
    assert findings(system_of(rules), "FT106") == []
    (found,) = findings(system_of(rules), "FT104")
    assert found.startswith("rule 2 is subsumed by rule 1")
    (same,) = findings(system_of((rules[0], rules[0])), "FT106")
    assert "have the same antecedent" in same


# --- hedges


HEDGES: tuple[Hedge, ...] = (
    *("very", "somewhat", "extremely", "seldom", "cubed", "very very", "plus"),
    *("minus", "cube root"),
)


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    "curve",
    [
        Points((0.0, 1.0, 3.0), (0.0, 1.0, 0.2)),
        pytest.param(HIGH, marks=pytest.mark.heavy),
    ],
)
def test_hedged_propositions_are_as_strong_as_those_of_the_system(curve: Curve) -> None:
    queries = [Proposition("a", ("low",), (hedge,)) for hedge in HEDGES]
    queries += [
        Proposition("a", ("low",), ("not", "very")),
        Proposition("a", ("low",), ("very", "not")),
    ]
    rules = tuple((one, "big", 0.5) for one in queries)
    system = system_of(rules, low=curve)
    found = view(system, domain_of(system))
    assert found.bounds is not None
    assert found.is_whole
    assert len(found.numbers) == len(rules)
    for row in rows(4):
        right = infer(system, row).activations
        low, high = (
            exact_answer(one, row).strengths
            for one in (found.bounds.lower, found.bounds.upper)
        )
        for below, true, above in zip(low, right, high, strict=True):
            assert below - ROUNDING <= true <= above + ROUNDING
            assert above - below < 0.1  # roots are steep at 0


def test_hedged_terms_are_named_and_used_but_are_no_terms_of_the_system() -> None:
    rules: Rules = (
        (Proposition("a", ("low",), ("very",)), "soft", 1.0),
        (A, "soft", 1.0),
    )
    others: dict[str, Curve] = {"very low": FLAT}
    system = system_of(rules, norm="minimum", low=LOW, high=HIGH, **others)
    seen = view(system, domain_of(system))
    assert seen.rules is not None
    assert sentence(seen.rules.rules[0]) == "IF a is very low' THEN power is soft"
    assert findings(system, "FT104") == []  # what is below is not seen within lines
    assert not any("very low'" in one.sentence for one in results(system, "FT401"))


# --- each finding is planted in a system of curves between lines, and removed

CLEAN: Rules = ((A, "soft", 1.0), (A_HIGH, "hard", 1.0), (B, "soft", 1.0))
FLAT = Gaussian(2.0, 40.0)
LATE = SCurve(4.0, 6.0)  # 0 on all of the domain


@pytest.mark.parametrize("norm", NORMS)
@pytest.mark.parametrize(
    ("code", "rule", "begins"),
    [
        ("FT101", (And((A, LATE_B)), "hard", 1.0), "rule 4 never fires"),
        ("FT104", (And((A, B_HIGH)), "soft", 1.0), "rule 4 is subsumed by rule 1"),
        ("FT104", (And((A, Not(B))), "soft", 0.75), "rule 4 is subsumed by rule 1"),
        ("FT106", (A_HIGH, "hard", 1.0), "rule 2 and rule 4 have the same antecedent"),
        ("FT201", (FLAT_A, "hard", 1.0), "rule 1 and rule 4 conflict"),
        ("FT401", None, "term 'late' of 'a' is empty"),
    ],
)  # fmt: skip
def test_a_defect_is_found_where_it_is_planted_and_only_there(
    norm: TNorm, code: str, rule: tuple[Condition, str, float] | None, begins: str
) -> None:
    planted = CLEAN if rule is None else (*CLEAN, rule)
    curves: dict[str, Curve] = {"flat": FLAT}
    if code in ("FT101", "FT401"):
        curves["late"] = LATE
    assert not any(one.startswith(begins) for one in sound(norm))
    found = findings(system_of(planted, norm=norm, **curves), code)
    assert any(one.startswith(begins) for one in found), found


@functools.cache
def sound(norm: TNorm) -> tuple[str, ...]:
    """Return the findings about the clean system."""
    answers = audit(
        Material(system_of(CLEAN, norm=norm, flat=FLAT)),
        selection=AuditSelection(select=["FT1", "FT2", "FT401"]),
    ).answers
    return tuple(one.sentence for one in answers if one.is_finding)


def test_a_gap_between_curves_that_end_is_found_and_closed() -> None:
    rules: Rules = ((A, "soft", 1.0), (A_HIGH, "hard", 1.0))
    apart = system_of(rules, low=SCurve(1.0, 0.0), high=SCurve(3.0, 4.0))
    (gap,) = findings(apart, "FT301")
    assert gap == (
        "no rule fires where 'a' is 1 to 3: the answer is what the outputs have by "
        "default"
    )
    assert findings(system_of(rules, low=SCurve(3.0, 0.0)), "FT301") == []


def test_weak_cover_is_reported_between_its_two_ends() -> None:
    rules: Rules = ((A, "soft", 1.0), (A_HIGH, "hard", 1.0))
    system = system_of(rules)
    (weak,) = (one for one in results(system, "FT301", epsilon=0.2) if one.is_finding)
    assert isinstance(weak.state, Witness)
    least, most = (one.value for one in weak.measures)
    assert least < 0.1353352832 < most < least + 0.002  # exp(-2), halfway
    (close,) = (
        one
        for one in results(system, "FT301", epsilon=0.1353)
        if one.subject == "cover of 0.1353"
    )
    assert isinstance(close.state, Bracket)
    assert close.state.low <= 0.1353352832 <= close.state.high


@pytest.mark.parametrize(
    ("behind", "is_finding"), [(1.19, True), (1.1774, False), (1.16, None)]
)
def test_a_term_that_nearly_reaches_the_level_is_reported_between_its_ends(
    behind: float, is_finding: bool | None
) -> None:
    # exp(-x^2 / 2) is 1/2 at x = 1.17741
    system = system_of(CLEAN, edge=Gaussian(-behind, 1.0))
    found = [one for one in results(system, "FT401") if "edge" in one.sentence]
    assert [one.is_finding for one in found] == [is_finding] * len(found)
    assert all(isinstance(one.state, Bracket) for one in found)
    assert bool(found) is (is_finding is not None)


def test_a_proposition_that_two_rules_share_is_one_degree_in_both() -> None:
    narrow = (And((A, Or((B, B_HIGH)))), "soft", 1.0)
    found = findings(system_of((*CLEAN, narrow), low=Bell(0.0, 1.0, 2.0)), "FT104")
    assert found == [
        "rule 4 is subsumed by rule 1: wherever it fires, rule 1 of the same "
        "conclusion is at least as strong"
    ]
    near = (
        And((Proposition("a", ("near",)), B)),
        "soft",
        1.0,
    )  # a little below, at most 1e-4
    system = system_of((*CLEAN[:2], near), near=Gaussian(0.0, 0.9999))
    (rest,) = results(system, "FT104")
    assert rest.sentence == (
        "no rule is shown to be subsumed, among 1 pair of one conclusion: 1 pair of "
        "strengths are too near to compare"
    )


# --- answers, compared with the system itself


DRAWN: tuple[Condition, ...] = (
    *(A, B, A_HIGH, B_HIGH, Not(A), And((A, B)), And((A_HIGH, Not(B)))),
    And((B_HIGH, A_HIGH)),
)


@functools.cache
def drawn_system(seed: int, norm: TNorm) -> FuzzySystem:
    chance = random.Random(seed)
    curves: tuple[Curve, ...] = (
        Gaussian(chance.uniform(0, 4), chance.uniform(0.2, 2)),
        Bell(chance.uniform(0, 4), chance.uniform(0.3, 2), chance.uniform(0.6, 3)),
        Sigmoid(chance.uniform(0, 4), chance.uniform(-5, 5)),
        SCurve(chance.uniform(0, 2), chance.uniform(2, 5)),
        Points((0.0, chance.uniform(0.5, 3.5), 4.0), (0.0, 1.0, 0.25)),
    )
    low, high = chance.sample(curves, 2)
    rules = tuple(
        (when, chance.choice("xyz"), chance.choice((1.0, 1.0, 0.5, 0.3)))
        for when in chance.sample(DRAWN, 5)
    )
    return system_of(rules, norm=norm, low=low, high=high)


@pytest.mark.parametrize("norm", NORMS)
def test_answers_about_random_systems_are_true_on_a_grid(norm: TNorm) -> None:
    system = drawn_system(0, norm)
    found = audit(
        Material(system), selection=AuditSelection(select=["FT1", "FT2", "FT3"])
    )
    assert check_on_grid(system, found, view(system, found.domain), 9) > 4


@pytest.mark.heavy
@pytest.mark.parametrize("norm", ["minimum", "product"])
def test_answers_about_many_random_systems_are_true_on_a_grid(norm: TNorm) -> None:
    checked = 0
    for seed in range(3, 15):
        system = drawn_system(seed, norm)
        found = audit(
            Material(system), selection=AuditSelection(select=["FT1", "FT2", "FT3"])
        )
        checked += check_on_grid(system, found, view(system, found.domain), 25)
    assert checked > 100


@pytest.mark.parametrize("norm", ["minimum", "product"])
def test_where_rules_do_not_meet_nothing_is_claimed_of_the_upper_ones(
    norm: TNorm,
) -> None:
    system = system_of(((A, "x", 1.0), (A_HIGH, "y", 0.5)), norm=norm)
    seen = view(system, domain_of(system))
    assert seen.bounds is not None
    lower, upper = (
        arrange(one, seen.domain) for one in (seen.bounds.lower, seen.bounds.upper)
    )
    found = BoundedArrangement(lower, upper, seen.bounds).meet(
        1, 2, Fraction(1, 2), Clock()
    )
    assert found.level.high < Fraction(1, 2)
    assert isinstance(found.state, Bracket)
    assert not found.state.point
    assert found.state.low <= max(meeting_on_a_line()) <= found.state.high


def meeting_on_a_line() -> Iterator[float]:
    """Yield the smaller of the two degrees in steps."""
    for step in range(401):
        x = step / 100.0
        yield min(math.exp(-(x**2) / 2.0), 0.5 * math.exp(-((x - 4.0) ** 2) / 2.0))
