"""Pairs of rules and propositions: what is planted is found, and gone when removed."""

from __future__ import annotations

from fractions import Fraction

import pytest
from msgspec.structs import replace

from fuzzytree.auditing.decide.states import (
    Declined,
    Proved,
    Witness,
    point_of,
)
from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    AuditSelection,
    AuditSettings,
)
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.model import (
    Conclusion,
    Conjunction,
    Or,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    RuleBlock,
    Semantics,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.numerics.exact import exact_answer
from tests.auditing.decide.old_bases import random_base
from tests.auditing.findings.test_views import A_LOW, block_of, system_of

LOW = Term("low", Points((0.0, 2.0, 4.0), (1.0, 1.0, 0.0)))
HIGH = Term("high", Points((2.0, 4.0), (0.0, 1.0)))
WIDE = Term("wide", Points((1.0, 2.0), (0.0, 1.0)))
NONE = Term("none", Points((0.0, 1.0), (1.0, 0.0)))
UP = Term("up", Points((0.0, 4.0), (0.0, 1.0)))
DOWN = Term("down", Points((0.0, 4.0), (1.0, 0.0)))
TERMS = (LOW, HIGH, WIDE, NONE)
CONJUNCTIONS: tuple[Conjunction, ...] = ("minimum", "product")


def proposition(text: str) -> Proposition:
    variable, _, term = text.split()
    return Proposition(variable, (term,))


def base(
    *rules: tuple[str, str],
    conjunction: Conjunction = "minimum",
    more: tuple[Term, ...] = (),
    high: float = 4.0,
) -> RuleBase:
    """Return rules such as `("force is low, slip is none", "soft")`."""
    terms = (*TERMS, *more)
    return RuleBase(
        "grip",
        ("soft", "hard"),
        tuple(Variable(name, terms, low=0.0, high=high) for name in ("force", "slip")),
        tuple(
            Rule(tuple(proposition(one) for one in when.split(", ") if one), then)
            for when, then in rules
        ),
        Semantics(conjunction),
    )


def answers_for(
    rules: RuleBase, code: str, settings: AuditSettings | None = None
) -> list[AuditAnswer]:
    settings = settings or AuditSettings()
    return [
        *audit(
            Material(rules), settings=settings, selection=AuditSelection(select=[code])
        ).answers
    ]


def results(rules: RuleBase, code: str) -> list[str]:
    return [one.sentence for one in answers_for(rules, code) if one.is_finding]


CLEAN = (("force is low", "soft"), ("force is high, slip is high", "hard"))


@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
@pytest.mark.parametrize("code", ["FT104", "FT105", "FT106", "FT201", "FT107"])
def test_a_clean_model_has_no_finding_about_pairs(
    code: str, conjunction: Conjunction
) -> None:
    rules = base(*CLEAN, conjunction=conjunction)
    settings = AuditSettings(level=0.6)
    assert not any(one.is_finding for one in answers_for(rules, code, settings))


# --- FT104


@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
def test_a_narrower_rule_of_the_same_class_is_subsumed(
    conjunction: Conjunction,
) -> None:
    narrow = ("force is high, slip is high, force is low", "hard")
    rules = base(*CLEAN, narrow, conjunction=conjunction)
    assert results(rules, "FT104") == [
        "rule 3 is subsumed by rule 2: wherever it fires, rule 2 of the same class "
        "is at least as strong"
    ]
    other = ("force is high, slip is none, slip is wide", "hard")
    assert not results(base(*CLEAN, other, conjunction=conjunction), "FT104")


@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
def test_a_rule_with_another_curve_below_is_subsumed(conjunction: Conjunction) -> None:
    rules = base(
        ("force is high", "hard"), ("force is wide", "hard"), conjunction=conjunction
    )
    (answer,) = [one for one in answers_for(rules, "FT104") if one.is_finding]
    assert answer.rules == (1, 2)
    assert isinstance(answer.state, Proved)


def test_under_min_another_proposition_may_hold_a_rule_below() -> None:
    # `slip is faint` is at most 1/4, where `force is high` is not below it.
    faint = Term("faint", Points((0.0, 4.0), (0.25, 0.25)))
    quarter = Term("quarter", Points((1.0, 4.0), (0.25, 1.0)))
    rules = base(
        ("force is quarter", "hard"),
        ("force is low, slip is faint", "hard"),
        more=(faint, quarter),
    )
    assert results(rules, "FT104")
    product = replace(rules, semantics=Semantics("product"))
    assert results(product, "FT104")  # there 1/4 low is below quarter as well
    stronger = replace(
        rules,
        rules=(rules.rules[0], Rule((Proposition("force", ("low",)),), "hard")),
    )
    assert not results(stronger, "FT104")


def test_rules_that_never_fire_are_not_reported_as_subsumed() -> None:
    never = ("force is none, force is high", "hard")
    rules = base(*CLEAN, never, ("slip is none", "hard"))
    assert not results(rules, "FT104")
    (answer,) = answers_for(rules, "FT104")
    assert answer.measures[-1].name == "rules that never fire"
    assert answer.measures[-1].value == 1


def test_with_inputs_that_depend_on_each_other_pairs_are_decided_too() -> None:
    mix = Variable("mix", TERMS, parts=(Part("force", 1.0), Part("slip", 1.0)))
    rules = base(("force is low", "soft"), ("force is high", "soft"))
    rules = replace(
        rules,
        variables=(*rules.variables, mix),
        rules=(*rules.rules, Rule((Proposition("mix", ("high",)),), "soft")),
    )
    assert results(rules, "FT104") == [
        "rule 2 is subsumed by rule 3: wherever it fires, rule 3 of the same class is "
        "at least as strong"
    ]


@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
def test_a_rule_with_the_antecedent_of_another_is_subsumed_or_masked(
    conjunction: Conjunction,
) -> None:
    twice = ("slip is high, force is high", "hard")
    assert results(base(*CLEAN, twice, conjunction=conjunction), "FT104") == [
        "rule 3 is subsumed by rule 2: wherever it fires, rule 2 of the same class "
        "is at least as strong"
    ]
    other = ("slip is high, force is high", "soft")
    assert results(base(*CLEAN, other, conjunction=conjunction), "FT105") == [
        "rule 3 is never answered: wherever it fires, rule 2 of class 'hard' "
        "is at least as strong and stands before it"
    ]


# --- FT105


@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
def test_a_rule_behind_one_of_another_class_that_is_as_strong_is_masked(
    conjunction: Conjunction,
) -> None:
    special = ("force is high, slip is high, force is low", "soft")
    rules = base(*CLEAN, special, conjunction=conjunction)
    assert results(rules, "FT105") == [
        "rule 3 is never answered: wherever it fires, rule 2 of class 'hard' "
        "is at least as strong and stands before it"
    ]


def test_the_special_case_that_stands_first_is_not_masked() -> None:
    special = ("force is high, slip is high, force is low", "soft")
    assert not results(base(special, *CLEAN), "FT105")
    # Its product is smaller wherever it fires: `low` is below 1 where `high` is not 0.
    (weaker,) = results(base(special, *CLEAN, conjunction="product"), "FT105")
    assert weaker.endswith("rule 3 of class 'hard' is stronger")


@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
def test_a_rule_before_a_stronger_one_is_masked(conjunction: Conjunction) -> None:
    half = Term("half", Points((2.0, 4.0), (0.0, 0.5)))
    rules = base(
        ("force is half", "soft"),
        ("force is high", "hard"),
        conjunction=conjunction,
        more=(half,),
    )
    assert results(rules, "FT105") == [
        "rule 1 is never answered: wherever it fires, "
        "rule 2 of class 'hard' is stronger"
    ]


def test_a_rule_that_comes_near_a_stronger_one_only_at_0_is_never_answered() -> None:
    # The first is `down` times the second: it comes near it at 0, where both are 0.
    rules = base(
        ("force is up, force is down", "soft"),
        ("force is up", "hard"),
        conjunction="product",
        more=(UP, DOWN),
    )
    assert results(rules, "FT105") == [
        "rule 1 is never answered: wherever it fires, rule 2 of class 'hard' is "
        "stronger"
    ]


def test_a_rule_that_ties_somewhere_before_the_other_is_answered_there() -> None:
    # Both are 1 from 2 on: the first one is answered there.
    rules = base(("force is wide, force is high", "soft"), ("force is wide", "hard"))
    assert not results(rules, "FT105")
    assert exact_answer(rules, {"force": 4.0, "slip": 0.0}).label == "soft"


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(n, marks=pytest.mark.heavy) for n in range(1, 8))]
)
def test_a_masked_rule_is_never_answered_on_a_grid(seed: int) -> None:
    rules = random_base(seed, 6, 2, kind="points", shared=0.7)
    masked = {a.rules[0] for a in answers_for(rules, "FT105") if a.is_finding}
    grid = [n / 16 for n in range(17)]
    answered = {
        exact_answer(rules, {"x1": a, "x2": b}).rule for a in grid for b in grid
    }
    assert not masked & answered


# --- FT106


def test_two_rules_that_ask_the_same_contradict_each_other() -> None:
    copy = ("slip is high, force is high", "soft")
    (answer,) = [
        one for one in answers_for(base(*CLEAN, copy), "FT106") if one.is_finding
    ]
    assert answer.sentence == (
        "rule 2 and rule 3 have the same antecedent and contradict each other: "
        "'hard' and 'soft'"
    )
    assert answer.severity == "error"


def test_two_rules_that_ask_the_same_of_one_class_are_copies() -> None:
    copy = ("slip is high, force is high, force is high", "hard")
    (answer,) = [
        one for one in answers_for(base(*CLEAN, copy), "FT106") if one.is_finding
    ]
    assert answer.sentence == (
        "rule 2 and rule 3 have the same antecedent and the same class 'hard'"
    )
    assert answer.severity == "warning"
    product = base(*CLEAN, copy, conjunction="product")
    assert not results(product, "FT106")  # the degree counts twice there
    assert results(product, "FT104")


def test_curves_that_nearly_agree_are_reported_with_the_place() -> None:
    near = Term("near", Points((2.0, 4.0), (0.0, 1.0 - 2.0**-20)))
    rules = base(*CLEAN, ("force is near, slip is high", "hard"), more=(near,))
    assert results(rules, "FT106") == [
        "rule 2 and rule 3 have nearly the same antecedent and the same class 'hard'; "
        "degrees differ by at most 9.537e-07, at 'force' = 4"
    ]


def test_curves_that_agree_on_the_domain_only_are_the_same() -> None:
    beyond = Term("beyond", Points((2.0, 4.0, 5.0), (0.0, 1.0, 0.0)))
    rules = (*CLEAN, ("force is beyond, slip is high", "hard"))
    assert results(base(*rules, more=(beyond,)), "FT106")
    assert not results(base(*rules, more=(beyond,), high=5.0), "FT106")


def test_two_ways_of_one_rule_are_no_pair() -> None:
    system = system_of(
        block_of(
            Or((Proposition("a", ("low",)), Proposition("b", ("low",)))),
            Proposition("a", ("high",)),
        )
    )
    (answer,) = audit(
        Material(system), selection=AuditSelection(select=["FT106"])
    ).answers
    assert answer.sentence == (
        "no two rules have nearly the same antecedent, among 2 pairs"
    )


def test_two_small_distances_under_the_product_are_left_open() -> None:
    # Each degree differs by less than the tolerance, both together by more.
    near = Term("near", Points((2.0, 4.0), (0.0, 1.0 - 2.0**-20)))
    rules = base(
        *CLEAN,
        ("force is near, slip is near", "hard"),
        conjunction="product",
        more=(near,),
    )
    (answer,) = answers_for(rules, "FT106")
    assert isinstance(answer.state, Declined)
    assert answer.sentence == (
        "no two rules are shown to have nearly the same antecedent, among 3 pairs: "
        "1 pair of degrees are too near to compare"
    )


# --- FT201


def test_a_conflict_is_reported_with_its_highest_level() -> None:
    rules = base(*CLEAN, ("slip is wide", "soft"))
    (first,) = [one for one in answers_for(rules, "FT201") if one.rules == (2, 3)]
    assert first.sentence == (
        "rule 2 and rule 3 conflict: both reach 1 at one input, "
        "and say 'hard' and 'soft'"
    )
    assert isinstance(first.state, Witness)


@pytest.mark.parametrize(
    "kind", ["points", pytest.param("lr", marks=pytest.mark.heavy)]
)
def test_no_point_of_a_grid_is_above_the_highest_common_level(kind: str) -> None:
    rules = random_base(3, 5, 2, kind="lr" if kind == "lr" else "points")
    grid = [n / 16 for n in range(17)]
    rows = [
        exact_answer(rules, {"x1": a, "x2": b}).strengths for a in grid for b in grid
    ]
    for answer in answers_for(rules, "FT201", AuditSettings(level=0.1)):
        if len(answer.rules) == 2:
            one, other = (number - 1 for number in answer.rules)
            level = Fraction(answer.measures[0].exact or answer.measures[0].value)
            most = max(min(row[one], row[other]) for row in rows)
            assert most <= level + Fraction(1, 10**9)
            assert isinstance(answer.state, Witness)
            row = exact_answer(
                rules,
                {k: float(v) for k, v in point_of(answer.state.point).items()},
            )
            reached = min(row.strengths[one], row.strengths[other])
            assert abs(reached - level) < Fraction(1, 10**6)


def test_under_the_product_the_highest_common_level_is_closed_in_on() -> None:
    rules = random_base(0, 4, 2, "product", "points")
    found = [
        one
        for one in answers_for(rules, "FT201", AuditSettings(level=0.2))
        if one.rules
    ]
    assert found
    for answer in found:
        assert isinstance(answer.state, Witness)
        least, most = (answer.measures * 2)[:2]
        assert most.value - least.value <= 0.001
        point = {k: float(v) for k, v in point_of(answer.state.point).items()}
        strengths = exact_answer(rules, point).strengths
        reached = min(strengths[number - 1] for number in answer.rules)
        assert float(reached) == pytest.approx(least.value, abs=1e-12)


def test_many_conflicts_are_reported_up_to_a_number_and_counted() -> None:
    rules = base(*(("force is low", ("soft", "hard")[n % 2]) for n in range(12)))
    *found, rest = answers_for(rules, "FT201")
    assert (len(found), rest.is_finding) == (20, True)
    assert rest.sentence == (
        "16 more pairs of rules may reach 0.5, not listed; 0 pairs never do"
    )


def test_pairs_that_cross_at_the_level_itself_conflict() -> None:
    # ramps down and up that cross at 0.1 + 0.2, which is no short fraction
    third = 0.1 + 0.2
    ramps = (
        Term("down", Points((0.0, 2.0 * third), (1.0, 0.0))),
        Term("up", Points((0.0, 2.0 * third), (0.0, 1.0))),
    )
    rules = base(("force is down", "soft"), ("force is up", "hard"), more=ramps)
    (answer,) = answers_for(rules, "FT201")
    assert answer.is_finding
    assert isinstance(answer.state, Witness)
    assert point_of(answer.state.point)["force"] == Fraction(third)
    assert answer.measures[0].value == 0.5
    above = AuditSettings(level=0.5 + 2.0**-53)
    assert not any(one.is_finding for one in answers_for(rules, "FT201", above))


def test_the_conflicts_of_a_combination_are_points_of_the_inputs() -> None:
    mix = Variable("mix", TERMS, parts=(Part("force", 1.0), Part("slip", 1.0)))
    rules = base(("force is wide", "soft"))
    rules = replace(
        rules,
        variables=(*rules.variables, mix),
        rules=(*rules.rules, Rule((Proposition("mix", ("low",)),), "hard")),
    )
    (answer,) = [one for one in answers_for(rules, "FT201") if one.rules]
    assert isinstance(answer.state, Witness)
    point = {k: float(v) for k, v in point_of(answer.state.point).items()}
    strengths = exact_answer(rules, point).strengths
    assert min(strengths) > Fraction(9, 10)
    apart = replace(rules.rules[1], when=(Proposition("mix", ("none",)),))
    assert not results(replace(rules, rules=(rules.rules[0], apart)), "FT201")


@pytest.mark.parametrize(
    ("conclusions", "count"),
    [
        ((("power", "big"), ("fan", "big")), 0),
        ((("power", "big"), ("power", "small")), 1),
        ((("power", "big"), ("power", "big")), 0),
    ],
    ids=["two outputs", "one output", "one conclusion"],
)
def test_only_conclusions_about_one_output_conflict(
    conclusions: tuple[tuple[str, str], ...], count: int
) -> None:
    (power,) = system_of(block_of(A_LOW)).outputs
    labels = (*power.terms, replace(power.terms[0], name="small"))
    outputs = tuple(replace(power, name=n, terms=labels) for n in ("power", "fan"))
    rules = tuple(
        SystemRule(Proposition(name, ("high",)), (Conclusion(output, label),))
        for name, (output, label) in zip("ab", conclusions, strict=True)
    )
    empty = system_of(block_of(A_LOW))
    system = replace(empty, outputs=outputs, blocks=(RuleBlock(rules),))
    assert (
        len(
            audit(Material(system), selection=AuditSelection(select=["FT201"])).findings
        )
        == count
    )
    alike = replace(rules[1], when=rules[0].when)
    system = replace(empty, outputs=outputs, blocks=(RuleBlock((rules[0], alike)),))
    (same,) = audit(
        Material(system), selection=AuditSelection(select=["FT106"])
    ).findings
    is_one = conclusions[0] == conclusions[1]
    assert same.severity == ("warning" if is_one else "info")


# --- FT107


def test_a_proposition_that_is_always_true_is_irrelevant() -> None:
    always = Term("any", Points((0.0, 4.0), (1.0, 1.0)))
    rules = base(CLEAN[0], ("force is high, slip is any", "hard"), more=(always,))
    assert results(rules, "FT107") == ["rule 2 decides the same without 'slip is any'"]


@pytest.mark.heavy
def test_a_proposition_that_only_others_make_irrelevant_is_proved() -> None:
    # Without its proposition rule 3 is as strong as one of the others, which stand
    # first.
    rules = base(
        ("slip is wide, force is low", "soft"),
        ("slip is wide, force is wide", "soft"),
        ("slip is wide, force is none", "hard"),
    )
    found = answers_for(rules, "FT107")
    (answer,) = [one for one in found if one.subject == "rule 3, 'force is none'"]
    assert isinstance(answer.state, Proved)
    assert answer.state.rivals == (1, 2)
    found = answers_for(replace(rules, rules=rules.rules[::-1]), "FT107")
    (answer,) = [one for one in found if one.subject == "rule 1, 'force is none'"]
    assert isinstance(answer.state, Witness)


@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
def test_an_input_where_a_proposition_matters_is_reported(
    conjunction: Conjunction,
) -> None:
    rules = base(*CLEAN, conjunction=conjunction)
    found = {one.subject: one for one in answers_for(rules, "FT107")}
    one = found["rule 2, 'slip is high'"]
    assert one.sentence == (
        "rule 2 needs 'slip is high': without it 'soft' becomes 'hard' at some input"
    )
    assert isinstance(one.state, Witness)
    point = point_of(one.state.point)
    shorter = replace(rules.rules[1], when=rules.rules[1].when[:1])
    assert _class_at(rules, point) == one.state.claims[0].label
    without = replace(rules, rules=(rules.rules[0], shorter))
    assert _class_at(without, point) == "hard"


def test_propositions_of_a_rule_that_never_fires_are_not_tested() -> None:
    rules = base(*CLEAN, ("force is none, force is high", "hard"))
    assert [
        one.sentence for one in answers_for(rules, "FT107") if one.rules == (3,)
    ] == ["rule 3 never fires, so its propositions are not tested one by one"]


def test_a_proposition_that_a_rule_of_the_class_makes_irrelevant_is_proved() -> None:
    rules = base(("force is wide", "hard"), ("force is high, slip is low", "hard"))
    (answer,) = [one for one in answers_for(rules, "FT107") if "slip" in one.subject]
    assert isinstance(answer.state, Proved)


def test_many_propositions_that_matter_are_reported_up_to_a_number_and_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("fuzzytree.auditing.findings.pairs.MOST_PROPOSITIONS", 2)
    answers = answers_for(base(*CLEAN), "FT107")
    assert [isinstance(one.state, Witness) for one in answers] == [True, True, False]
    assert answers[2].sentence == "1 more proposition matters: it decides some input"


def test_what_a_spent_budget_leaves_open_is_a_bracket_or_cut_short() -> None:
    rules = random_base(2, 4, 2, kind="points", odd=0.2, combinations=1)
    made = audit(
        Material(rules),
        settings=AuditSettings(budget=0.005),
        selection=AuditSelection(select=["FT107"]),
    )
    states = {type(one.state) for one in made.answers}
    assert not made.is_complete or Declined in states


def _class_at(rules: RuleBase, point: dict[str, Fraction]) -> str | None:
    return exact_answer(rules, {n: float(x) for n, x in point.items()}).label
