"""Audits that were edited fail the re-check, also where the digest was made again."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.auditing.recheck import CannotRunError, recheck
from fuzzytree.auditing.recheck.head import LIMITS, digest_of
from fuzzytree.model.rulebase import (
    Conjunction,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree
from tests.auditing.engine.bases import Kind, random_base
from tests.auditing.recheck.audits import audited, small

Facts = dict[str, Any]
Way = tuple[str | int, ...]

FREE = (
    r"version|rows|data\..*|file\.name|file",  # whose truth is elsewhere
    r"settings\.(budget_s|seed|rows|epsilon|margin|lead|level|overlap)",
    r"domain\.sides\.(low|high|origin)",  # another domain, on which it all holds too
    r"unasked",  # the reason, in words
    r"answers\.severity",  # of what is no finding; of a finding one of two, for some
    r"answers\.state\.claims",  # one that the answer does not need is gone
    r"answers\.state\.(how|of|why|reason|low|high|hits|rows|confidence)",
    r"answers\.measures(\..*)?",
    r"answers\.(state\.)?region(\..*)?",  # a smaller one, or none
)
"""What an edit of need not be reported once the digest is computed again."""

UNSURE = ("FT102", "FT103", "FT106", "FT203", "FT204", "FT301", "FT402", "FT6", "FT7")
"""Codes some of whose answers are not decided again, so that one may be missing."""


def wrong_with(facts: Facts, content: bytes) -> list[str]:
    """Return what does not hold of an audit's facts."""
    text = json.dumps(facts, ensure_ascii=False).encode()
    try:
        found = recheck(text, content, ("audit.json", "grip.yaml"))
    except CannotRunError as error:
        return [str(error)]
    return found.wrong + [why for state, why in found.undecided if state == "SENTENCE"]


def ways(value: Any, way: Way = ()) -> Iterator[Way]:
    """Yield the place of each number, text and list."""
    if isinstance(value, dict):
        for key, one in value.items():
            yield from ways(one, (*way, key))
        return
    if isinstance(value, list):
        for place, one in enumerate(value):
            yield from ways(one, (*way, place))
    if value != []:
        yield way


def edited(facts: Facts, way: Way, chance: random.Random) -> str:
    """Change one place, and return its name without numbers."""
    holder: Any = facts
    for key in way[:-1]:
        holder = holder[key]
    value = holder[way[-1]]
    name = ".".join(str(key) for key in way if not isinstance(key, int))
    if isinstance(value, list):
        del value[chance.randrange(len(value))]
    elif isinstance(value, bool):
        holder[way[-1]] = not value
    elif value is None:
        holder[way[-1]] = chance.choice(["x", 1.0, "0"])
    elif isinstance(value, int | float):
        holder[way[-1]] = value + chance.choice([1, -1])
    else:
        words = ["1/3", "rule 1", "PROVED", "FT101", "info", "error", f"{value}x"]
        holder[way[-1]] = chance.choice([one for one in words if one != value])
    return name


def is_free(name: str, facts: Facts, way: Way) -> bool:
    """Return whether an edit of a place may stay unreported."""
    if any(re.fullmatch(pattern, name) for pattern in FREE):
        return True
    if way[0] != "answers" or len(way) < 2:
        return name == "answers"  # which one is gone decides
    code = facts["answers"][way[1]]["code"]
    return code.startswith(UNSURE) and name == "answers.is_finding"


def test_a_real_audit_holds() -> None:
    found = recheck(*small(), ("audit.json", "grip.yaml"))
    assert found.wrong == []
    assert found.counts["answers PROVED, decided again"] > 4
    assert found.counts["answers with a WITNESS, evaluated again"] > 8


@pytest.mark.heavy
@pytest.mark.parametrize("kind", ["tree", "relative", "raw", "base", "product"])
def test_audits_of_every_form_hold(kind: str) -> None:
    tree = random_tree(4, leaves=4)
    model: RuleBase | FuzzyTree = tree
    if kind == "relative" or kind == "raw":
        model = rules_from_tree(tree, "raw" if kind == "raw" else "relative")
    elif kind != "tree":
        norm: Conjunction = "product" if kind == "product" else "minimum"
        model = random_base(3, 4, 2, norm, "points", shared=0.5)
    found = recheck(*audited(model, ignore=["FT6", "FT204"]), ("a.json", "m.yaml"))
    assert found.wrong == []


UP, DOWN = Points((0.0, 4.0), (0.0, 1.0)), Points((0.0, 4.0), (1.0, 0.0))
LATE = Points((4.0, 6.0), (0.0, 1.0))
X = Variable(
    "x", (Term("up", UP), Term("down", DOWN), Term("late", LATE)), "", 0.0, 4.0
)


def wrong_of(model: RuleBase | FuzzyTree, **options: Any) -> list[str]:
    """Return what does not hold of the audit of a model, as it was made."""
    return recheck(*audited(model, **options), ("a.json", "m.yaml")).wrong


def rules_of(*when: tuple[Proposition, ...], norm: Conjunction = "minimum") -> RuleBase:
    """Return rules of one class on `x` and a sum in which it stands twice."""
    parts = (Part("x", 1.0), Part("x", -0.5, 1.0))
    terms = (Term("up", UP), Term("late", LATE))
    half = Variable("half", terms, parts=parts)
    made = tuple(Rule(one, "a") for one in when)
    return RuleBase("r", ("a",), (X, half), made, Semantics(norm))


def test_the_audit_of_a_rule_that_never_fires_holds() -> None:
    late = Proposition("x", ("late",)), Proposition("x", ("up",))
    rules = rules_of(late, (Proposition("x", ("up",)),))
    assert wrong_of(rules) == []
    facts = json.loads(audited(rules)[0])
    of = next(one for one in facts["answers"] if (one["code"], one["rules"]) == SILENT)
    of["rules"] = [2]  # which does fire
    facts["digest"] = digest_of(facts)
    wrong = wrong_with(facts, audited(rules)[1])
    assert any(text.endswith("the rule fires somewhere") for text in wrong)


SILENT = ("FT107", [1])


@pytest.mark.one_in(2)
@pytest.mark.parametrize("terms", [("up",), ("up", "down")])
def test_the_audit_of_a_rule_with_a_proposition_and_its_opposite_holds(
    terms: tuple[str, ...],
) -> None:
    both = Proposition("x", terms), Proposition("x", terms, negated=True)
    assert wrong_of(rules_of(both, (Proposition("x", ("up",)),))) == []
    swapped = Proposition("x", ("up", "down")), Proposition("x", ("down", "up"))
    assert wrong_of(rules_of(swapped)) == []


def test_the_audit_of_a_sum_in_which_an_input_stands_twice_holds() -> None:
    rules = rules_of((Proposition("half", ("up",)),), (Proposition("half", ("late",)),))
    assert wrong_of(rules) == []


def test_a_proposition_that_stands_twice_weakens_a_product() -> None:
    up = Proposition("x", ("up",))
    assert wrong_of(rules_of((up, up), (up,), norm="product")) == []


def test_the_audit_of_a_tree_whose_leaves_are_not_all_reached_holds() -> None:
    for seed in (6, 12):
        rest = {"domain": unit(random_tree(seed, leaves=4)), "select": ["FT1"]}
        assert wrong_of(random_tree(seed, leaves=4), **rest) == []


def unit(tree: FuzzyTree) -> Domain:
    """Return -1 to 1 for each input of a tree."""
    return Domain(tuple(DomainSide(name, -1.0, 1.0) for name in tree.inputs))


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(16))
def test_audits_of_odd_models_hold(seed: int) -> None:
    chance = random.Random(seed)
    norm: Conjunction = chance.choice(["minimum", "product"])
    kinds: tuple[Kind, ...] = ("lr", "points", "band", "mixed")
    kind, sums = chance.choice(kinds), chance.randrange(2)
    model = random_base(seed, 3, 2, norm, kind, shared=0.7, odd=0.5, combinations=sums)
    assert wrong_of(model, clock=Clock(2.0)) == []


def test_the_digest_shows_any_edit() -> None:
    audit_, content = small()
    chance = random.Random(1)
    every = [way for way in ways(json.loads(audit_)) if way != ("digest",)]
    for way in chance.sample(every, 8):
        facts = json.loads(audit_)
        name = edited(facts, way, chance)
        assert wrong_with(facts, content), name


def reported(seeds: range) -> tuple[int, list[str]]:
    """Make edits with new digests; return how many are reported, and which must be."""
    audit_, content = small()
    count, missed = 0, list[str]()
    for seed in seeds:
        chance = random.Random(seed)
        facts = json.loads(audit_)
        way = chance.choice([w for w in ways(facts) if w != ("digest",)])
        before = json.loads(audit_)
        name = edited(facts, way, chance)
        facts["digest"] = digest_of(facts)
        if wrong_with(facts, content):
            count += 1
        elif not is_free(name, before, way):
            missed.append(f"{way}: {name}")
    return count, missed


@pytest.mark.heavy
def test_edits_with_a_new_digest_are_reported_too() -> None:
    count, missed = reported(range(12))
    assert missed == []
    assert count > 6


@pytest.mark.heavy
def test_hundreds_of_edits_with_a_new_digest_are_reported_too() -> None:
    count, missed = reported(range(1000, 1400))
    assert missed == []
    assert count > 250


def changed(**changes: Any) -> list[str]:
    """Return what does not hold once some facts are replaced, with a new digest."""
    audit_, content = small()
    facts = json.loads(audit_) | changes
    facts["digest"] = digest_of(facts)
    return wrong_with(facts, content)


def test_each_sentence_of_a_real_audit_is_compared_with_its_facts() -> None:
    facts = json.loads(small()[0])
    report = recheck(*small(), ("audit.json", "grip.yaml"))
    assert report.counts["sentences compared with facts"] == len(facts["answers"])


def test_a_sentence_that_contradicts_its_facts_is_reported() -> None:
    facts = json.loads(small()[0])
    number, answer = next(
        (n, one) for n, one in enumerate(facts["answers"], 1) if one["code"] == "FT102"
    )
    answer["sentence"] = "rule 1 leads by 0.75 at least somewhere"
    where = f"answer {number} (FT102, rule 1)"
    text = f"{where}: its sentence says other than its facts"
    assert changed(answers=facts["answers"]) == [text]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("sentence", "all is well"),
        ("message", "FT101.none"),
        ("facts", {"rows": 7}),
        ("facts", {"subject": ["rule 2"]}),
    ],
)
def test_a_sentence_that_is_not_of_its_message_and_facts_is_reported(
    field: str, value: object
) -> None:
    answers = json.loads(small()[0])["answers"]
    answers[0][field] = value
    wrong = changed(answers=answers)
    assert any("its sentence says other than its facts" in text for text in wrong)


def test_an_edited_panel_is_reported() -> None:
    limits = [*LIMITS[:-1]]
    assert changed(limits=limits) == ["the panel of limits is not the fixed one"]


def test_a_removed_finding_is_reported() -> None:
    answers = json.loads(small()[0])["answers"]
    kept = [one for one in answers if (one["code"], one["rules"]) != ("FT104", [4, 2])]
    assert len(kept) == len(answers) - 1
    assert any("rule 4 hides behind 2" in text for text in changed(answers=kept))


def test_a_finding_without_a_cause_is_reported() -> None:
    answers = json.loads(small()[0])["answers"]
    made = json.loads(json.dumps(answers))
    reported = next(
        one for one in made if (one["code"], one["rules"]) == ("FT104", [4, 2])
    )
    reported["rules"] = [2, 4]
    wrong = changed(answers=made)
    assert any("rule 2 is somewhere stronger than rule 4" in text for text in wrong)


def test_another_model_is_reported() -> None:
    audit_, content = small()
    other = content.replace(
        b"range: {from: 0.0, to: 4.0}", b"range: {from: 0.0, to: 5}"
    )
    wrong = recheck(audit_, other, ("a.json", "m.yaml")).wrong
    assert any(text.startswith("the SHA-256 of m.yaml is ") for text in wrong)
    assert any(text.startswith("the model's fingerprint is ") for text in wrong)


def test_a_witness_outside_the_domain_is_reported(tmp_path: Path) -> None:
    audit_, content = small()
    facts = json.loads(audit_)
    number, answer = next(
        (n, one)
        for n, one in enumerate(facts["answers"], 1)
        if one["state"]["state"] == "WITNESS"
    )
    point = answer["state"]["point"][0]
    point |= {"exact": "9", "decimal": "9.0", "hex": (9.0).hex()}
    facts["digest"] = digest_of(facts)
    where = f"answer {number} ({answer['code']}, {answer['subject']})"
    assert wrong_with(facts, content) == [f"{where}: the point lies outside the domain"]


def test_an_answer_with_three_rules_for_two_is_reported() -> None:
    answers = json.loads(small()[0])["answers"]
    number, answer = next(
        (n, one)
        for n, one in enumerate(answers, 1)
        if one["code"] == "FT106" and not one["rules"]
    )
    answer["rules"] = [1, 2, 3]
    where = f"answer {number} (FT106, pairs of rules)"
    assert f"{where}: it names what there is not" in changed(answers=answers)


def test_the_audit_with_rows_that_are_no_table_holds() -> None:
    rows = AuditRows("an array", np.array([[0.5, 1.5, 3.5]]))
    assert wrong_of(rules_of((Proposition("x", ("up",)),)), rows=rows) == []


@pytest.mark.heavy
def test_distances_in_sentences_about_rows_are_compared_with_their_measures() -> None:
    tree = random_tree(4, leaves=4)
    values = np.random.default_rng(1).uniform(-1.0, 1.0, (len(tree.inputs), 6))
    options: Facts = {"rows": AuditRows("an array", values), "domain": unit(tree)}
    text, content = audited(tree, select=["FT203", "FT204"], **options)
    assert wrong_with(json.loads(text), content) == []
    edited_of = set[str]()
    for number, answer in enumerate(json.loads(text)["answers"]):
        sentence = answer["sentence"]
        if " of each input's range" not in sentence:
            continue
        facts = json.loads(text)
        other = sentence.replace(" % of each", "1 % of each", 1)
        facts["answers"][number]["sentence"] = other
        facts["digest"] = digest_of(facts)
        (wrong,) = wrong_with(facts, content)
        assert wrong.endswith("its sentence says other than its facts")
        edited_of.add(answer["code"])
    assert edited_of >= {"FT204"}
