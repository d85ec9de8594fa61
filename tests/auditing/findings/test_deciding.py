"""Defects in what rules decide are found where they are planted, and gone without."""

from __future__ import annotations

from msgspec.structs import replace

from fuzzytree.auditing.decide import Budget
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import Bracket, Declined, Proved, Witness
from fuzzytree.auditing.findings.deciding import answers
from fuzzytree.auditing.findings.records import AuditAnswer, AuditSettings
from fuzzytree.auditing.findings.subject import subject_of, view
from fuzzytree.model.rulebase import (
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from tests.auditing.decide.old_bases import random_base, unit_domain, with_hidden_rule

LOW = Term("low", Points((0.0, 1.0), (1.0, 0.0)))
HIGH = Term("high", Points((0.0, 1.0), (0.0, 1.0)))
MIDDLE = Term("middle", Points((0.25, 0.5, 0.75), (0.0, 1.0, 0.0)))
FLAT = Term("flat", Points((0.25, 0.5, 0.75), (0.0, 0.505, 0.0)))
SMALL = Term("small", Points((0.25, 0.5, 0.75), (0.0, 0.25, 0.0)))
NEVER = Term("never", Points((2.0, 3.0, 4.0), (0.0, 1.0, 0.0)))
TERMS = (LOW, HIGH, MIDDLE, FLAT, SMALL, NEVER)


def _base(*rules: tuple[str, str], conjunction: str = "minimum") -> RuleBase:
    variables = (Variable("x", TERMS), Variable("y", TERMS))
    made: list[Rule] = []
    for terms, label in rules:
        words = terms.split()
        propositions = (Proposition(v, (w,)) for v, w in zip("xy", words, strict=False))
        made.append(Rule(tuple(c for c in propositions if c.terms != ("any",)), label))
    classes = tuple(dict.fromkeys(label for _, label in rules))
    semantics = Semantics(conjunction)  # type: ignore[arg-type]
    return RuleBase("base", classes, variables, tuple(made), semantics)


def _asked(
    *rules: tuple[str, str], conjunction: str = "minimum", decision: str = "strongest"
) -> list[AuditAnswer]:
    base = _base(*rules, conjunction=conjunction)
    box = Domain((DomainSide("x", 0.0, 1.0), DomainSide("y", 0.0, 1.0)))
    viewed = view(base, box)
    policy = replace(viewed.policy, decision=decision)
    return [*answers(subject_of(replace(viewed, policy=policy), AuditSettings()))]


def _found(given: list[AuditAnswer], code: str) -> dict[tuple[int, ...], AuditAnswer]:
    return {one.rules: one for one in given if one.code == code and one.is_finding}


CLEAN = (("low", "a"), ("high", "b"))


def test_clean_rules_have_no_finding_and_every_question_an_answer() -> None:
    given = _asked(*CLEAN)
    assert not [one for one in given if one.is_finding]
    assert [one.code for one in given].count("FT101") == 2
    assert {one.code for one in given} == {"FT101", "FT102", "FT103", "FT202"}


def test_a_rule_below_another_class_never_wins() -> None:
    found = _found(_asked(*CLEAN, ("small", "c")), "FT101")
    assert list(found) == [(3,)]
    assert isinstance(found[3,].state, Proved)
    assert found[3,].severity == "error"
    assert found[3,].sentence == (
        "rule 3 never wins: wherever it fires, a rule of another class is at least as "
        "strong"
    )
    assert not _found(_asked(*CLEAN, ("middle", "c")), "FT101")


def test_a_rule_that_only_a_union_hides_never_wins() -> None:
    # Where x is in the middle, either y is low or y is high.
    rules = (("middle low", "a"), ("middle high", "b"), ("small any", "c"))
    assert list(_found(_asked(*rules), "FT101")) == [(3,)]
    assert not _found(_asked(rules[0], rules[2]), "FT101")


def test_a_rule_out_of_the_domain_never_fires() -> None:
    found = _found(_asked(*CLEAN, ("never", "c")), "FT101")
    assert found[3,].sentence == (
        "rule 3 never fires: no value of the domain makes its condition hold"
    )


def test_a_rule_that_wins_by_its_place_alone_is_reported_as_that() -> None:
    found = _found(_asked(("low", "a"), ("low", "b"), ("high", "b")), "FT101")
    assert "by its place in the list alone" in found[1,].sentence
    assert isinstance(found[1,].state, Witness)
    assert found[2,].sentence.startswith("rule 2 never wins")


def test_a_rule_that_leads_by_next_to_nothing_is_marginal() -> None:
    found = _found(_asked(*CLEAN, ("flat", "c")), "FT102")
    assert list(found) == [(3,)]
    state = found[3,].state
    assert isinstance(state, Bracket)
    assert 0.004 < state.low <= 0.00500001 <= state.high < 0.01
    assert not _found(_asked(*CLEAN, ("middle", "c")), "FT102")


def test_a_rule_below_its_own_class_is_superfluous() -> None:
    found = _found(_asked(*CLEAN, ("small", "a"), ("small", "b")), "FT103")
    assert list(found) == [(3,), (4,)]
    assert not _found(_asked(*CLEAN, ("middle", "a")), "FT103")
    sentence = "rule 3 is superfluous: without it no decision changes"
    assert found[3,].sentence == sentence


def test_a_copy_is_superfluous_and_what_decides_by_place_is_not() -> None:
    copies = _found(_asked(*CLEAN, ("low", "a")), "FT103")
    assert list(copies) == [(3,)]  # where rules 1 and 2 tie, rule 1 goes first
    assert (1,) not in _found(_asked(("low", "a"), ("low", "b")), "FT103")


def test_rules_that_share_their_weakest_proposition_are_ambiguous() -> None:
    rules = (("low low", "a"), ("low high", "b"), ("small any", "c"))
    given = _asked(*rules)
    found = _found(given, "FT202")
    assert list(found) == [(1, 2)]
    assert isinstance(found[1, 2].state, Witness)
    apart = (("low low", "a"), ("high high", "b"), ("high low", "c"))
    assert (1, 2) not in _found(_asked(*apart), "FT202")


def test_products_are_tested_too_and_tie_where_they_are_one_function() -> None:
    given = _asked(*CLEAN, ("small", "c"), conjunction="product")
    assert list(_found(given, "FT101")) == [(3,)]
    (ties,) = [one for one in given if one.code == "FT202"]
    assert isinstance(ties.state, Proved)
    copied = _asked(*CLEAN, ("low", "c"), conjunction="product")
    assert list(_found(copied, "FT202")) == [(1, 3)]


def test_where_all_rules_take_part_only_firing_is_tested() -> None:
    given = _asked(*CLEAN, ("small", "c"), ("never", "c"), decision="all")
    assert {one.code for one in given} == {"FT101"}
    (dead,) = [one for one in given if one.is_finding]
    assert dead.subject == "rule 4"


def test_without_steps_all_is_open_and_nothing_a_finding() -> None:
    base = with_hidden_rule(random_base(0, 7, 4))
    subject = subject_of(view(base, unit_domain(base)), AuditSettings(), Budget(1))
    found = [*answers(subject)]
    assert {one.rules for one in found if one.code == "FT101"} == {
        (n,) for n in range(1, len(base.rules) + 1)
    }
    assert all(isinstance(one.state, Declined) for one in found if one.code < "FT202")
    assert not any(one.is_finding for one in found)
