"""Audits hold when they are checked again; edited ones do not, with any digest."""

from __future__ import annotations

import json
import random
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from fuzzytree import learn, load
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.locations import model_file
from fuzzytree.auditing.findings.records import AuditSelection, AuditSettings
from fuzzytree.auditing.findings.subject import AuditRows, Material
from fuzzytree.exporters import yaml
from fuzzytree.model import FuzzySystem
from fuzzytree.model.rulebase import (
    Conjunction,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.rechecking import CannotRunError, recheck
from fuzzytree.rechecking.checks import digest_of
from fuzzytree.rechecking.sentences import LIMITS
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree
from tests.auditing.decide.old_bases import Kind, random_base
from tests.auditing.findings.test_mutations import PLANTED, ROWS, Planted
from tests.rechecking.audits import audited, small

Facts = dict[str, Any]
Way = tuple[str | int, ...]

HERE = {
    "no solver of lines and polynomials is asked for it",
    "the shapes of terms",
    "ties on more than a surface",
    "areas of terms",
    "curves that are no lines, and too near to each other",
}
"""Why some proofs are decided by the audit only."""

FREE = {
    r"version|fingerprint|rows|data\..*|file\.name|file": "its truth is elsewhere",
    r"settings\.(budget|seed|rows|epsilon|margin|lead|level|overlap)": "all is true "
    "with another value as well",
    r"domain\.sides\.(low|high|origin)": "all is true on another domain as well",
    r"answers\.repeat": "a command",
    r"unasked": "why something is left out, in words",
    r"answers\.state\.(how|of|why|reason|confirmed)": "how it was made, in words",
    r"answers\.state\.rivals": "others that suffice prove it as well",
    r"answers\.state\.(low|high|hits|rows|confidence)": "of samples and brackets",
    r"answers\.state\.claims|answers\.(state\.)?region(\..*)?": "it says less",
    r"answers (FTD|.*declined|FT30.*more).*": "of what is declined or left open",
    r"answers\.id": "it names a finding for baselines, and nothing else",
    r"answers\.places": "it says less",
    r"answers\.measures\.name": "of a bracket, or of the shape of a term",
    r"answers\.facts\..*": "of a sample, a bracket or the place of a defect",
    r"answers\.measures(\.value|\.unit)?": "of a bracket, a crossing or a possibility",
}
"""What an edit of need not be reported once the digest is computed again, and why."""


def wrong_with(facts: Facts, content: bytes) -> list[str]:
    """Return what does not hold of an audit's facts."""
    text = json.dumps(facts, ensure_ascii=False).encode()
    try:
        return recheck(text, content, ("audit.json", "grip.yaml")).wrong
    except CannotRunError as error:
        return [str(error)]


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


def name_of(way: Way) -> str:
    """Return the name of a place without numbers."""
    return ".".join(str(key) for key in way if not isinstance(key, int))


def edit(facts: Facts, way: Way, chance: random.Random) -> None:
    """Change one place."""
    holder: Any = facts
    for key in way[:-1]:
        holder = holder[key]
    value = holder[way[-1]]
    if isinstance(value, list):
        del value[chance.randrange(len(value))]
    elif isinstance(value, bool):
        holder[way[-1]] = not value
    elif value is None:
        holder[way[-1]] = chance.choice(["x", 1.0, "7"])
    elif isinstance(value, int | float):
        holder[way[-1]] = value + chance.choice([1, -1])
    else:
        words = ["1/3", "rule 1", "PROVED", "FT101", "info", "error", f"{value}x"]
        holder[way[-1]] = chance.choice([one for one in words if one != value])


def missed(text: bytes, content: bytes, seed: int, many: int) -> list[str]:
    """Edit some fields of an audit, each with a new digest; return what is missed."""
    facts, chance = json.loads(text), random.Random(seed)
    every = defaultdict[str, list[Way]](list)
    for way in ways(facts):
        every[name_of(way)].append(way)
    result: list[str] = []
    for name in chance.sample(sorted(every.keys() - {"digest"}), many):
        way, edited = chance.choice(every[name]), json.loads(text)
        edit(edited, way, chance)
        edited["digest"] = digest_of(edited)
        if way == ("answers",):
            rest = [one["id"] for one in edited["answers"]]
            gone = next(one for one in facts["answers"] if one["id"] not in rest)
            name += f" {gone['message']}"
        is_free = any(re.fullmatch(pattern, name) for pattern in FREE)
        if not wrong_with(edited, content) and not is_free:
            result.append(f"{way}: {name}")
    return result


def test_a_real_audit_holds_and_its_proofs_are_confirmed() -> None:
    report = recheck(*small(), ("audit.json", "grip.yaml"))
    assert report.wrong == []
    assert {why for state, why in report.undecided if state == "PROVED"} <= HERE
    assert len(report.confirmed) == 14


@pytest.mark.one_in(2)
@pytest.mark.parametrize("kind", ["tree", "relative", "points", "band", "product"])
def test_audits_of_every_form_hold(kind: str) -> None:
    tree = random_tree(4, leaves=4)
    model: RuleBase | FuzzyTree = tree if kind == "tree" else rules_from_tree(tree)
    if kind not in ("tree", "relative"):
        norm: Conjunction = "product" if kind == "product" else "minimum"
        shapes: Kind = "band" if kind == "band" else "points"
        model = random_base(3, 4, 2, norm, shapes, shared=0.5)
    report = recheck(*audited(model, skip=["FT6", "FT204"]), ("a.json", "m.yaml"))
    assert report.wrong == []


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(12))
def test_audits_of_odd_models_hold(seed: int) -> None:
    chance = random.Random(seed)
    norm: Conjunction = chance.choice(["minimum", "product"])
    kinds: tuple[Kind, ...] = ("lr", "points", "band", "mixed")
    kind, sums = chance.choice(kinds), chance.randrange(2)
    model = random_base(seed, 3, 2, norm, kind, shared=0.7, odd=0.5, combinations=sums)
    text, content = audited(model, settings=AuditSettings(budget=5.0))
    assert recheck(text, content, ("a.json", "m.yaml")).wrong == []


@pytest.mark.parametrize("seed", range(5))
def test_each_field_that_is_edited_is_reported_or_free(seed: int) -> None:
    model = random_base(seed, 3, 2, kind="points", shared=0.5)
    assert missed(*audited(model, skip=["FT6", "FT7"]), seed, 6) == []


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(5, 55))
def test_each_field_of_many_audits_that_is_edited_is_reported_or_free(
    seed: int,
) -> None:
    kind: Kind = "points" if seed % 2 else "band"
    model = random_base(seed, 3, 2, kind=kind, shared=0.5)
    assert missed(*audited(model, skip=["FT6", "FT7"]), seed, 25) == []


def test_the_digest_shows_any_edit() -> None:
    text, content = small()
    chance = random.Random(1)
    every = [way for way in ways(json.loads(text)) if way != ("digest",)]
    for way in chance.sample(every, 6):
        facts = json.loads(text)
        edit(facts, way, chance)
        assert wrong_with(facts, content), way


def changed(**changes: Any) -> list[str]:
    """Return what does not hold once some facts are replaced, with a new digest."""
    text, content = small()
    facts = json.loads(text) | changes
    facts["digest"] = digest_of(facts)
    return wrong_with(facts, content)


def answers_of(message: str) -> tuple[list[Facts], Facts, str]:
    """Return all answers of the small audit, one of a message, and its place."""
    answers = json.loads(small()[0])["answers"]
    place = next(n for n, one in enumerate(answers) if one["message"] == message)
    one = answers[place]
    return answers, one, f"answer {place + 1} ({one['code']}, {one['subject']})"


def test_a_sentence_in_other_words_is_reported() -> None:
    answers, one, where = answers_of("FT102.leads")
    one["sentence"] = "rule 1 leads by 0.75 at least somewhere"
    assert changed(answers=answers) == [f"{where}: its sentence says something else"]


def test_an_edited_panel_is_reported() -> None:
    limits = [*LIMITS[:-1]]
    assert changed(limits=limits) == ["the panel of limits is not the fixed one"]


def test_a_removed_finding_is_reported() -> None:
    answers, one, _ = answers_of("FT104.subsumed")
    answers.remove(one)
    wrong = "answer 13 (FT104, pairs of rules): whether others are listed"
    assert changed(answers=answers) == [wrong]


@pytest.mark.parametrize("code", ["FT101", "FT103", "FT106", "FT107", "FT201", "FT301"])
def test_an_audit_without_one_of_its_answers_is_reported(code: str) -> None:
    content = Path("examples/grip.yaml").read_bytes()
    material = Material(load("examples/grip.yaml"), model_file("grip.yaml", content))
    text = audit(material, selection=AuditSelection(skip=["FT6"])).to_json()
    answers = json.loads(text)["answers"]
    places = [n for n, one in enumerate(answers) if one["code"] == code]
    assert places
    for place in [*places, *([places] if code in ("FT201", "FT301") else [])]:
        gone = place if isinstance(place, list) else [place]
        rest = [one for n, one in enumerate(answers) if n not in gone]
        gaps = [one for one in rest if one["message"].startswith("FT301.gap")]
        for number, one in enumerate(gaps, 1):
            one["subject"] = f"gap {number}"
        facts = json.loads(text) | {"answers": rest}
        facts["digest"] = digest_of(facts)
        assert wrong_with(facts, content), answers[gone[0]]["sentence"]


def test_a_gap_that_is_made_larger_is_reported() -> None:
    content = Path("examples/grip.yaml").read_bytes()
    material = Material(load("examples/grip.yaml"), model_file("grip.yaml", content))
    text = audit(material, selection=AuditSelection(select=["FT301"])).to_json()
    facts = json.loads(text)
    gap = next(o for o in facts["answers"] if o["message"].startswith("FT301.gap"))
    for region in (gap["region"], gap["state"]["region"]):
        region[0]["low"] -= 0.25
    gap["sentence"] = gap["sentence"].replace("0.8 to 1", "0.55 to 1")
    facts["digest"] = digest_of(facts)
    wrong = wrong_with(facts, content)
    assert any("gap 1 is so in all of its region" in why for why in wrong)


def test_a_finding_without_a_cause_is_reported() -> None:
    answers, one, _ = answers_of("FT104.subsumed")
    one |= {"rules": [2, 4], "subject": "rule 2"}
    one["facts"]["by"] = "rule 4"
    one["sentence"] = (
        "rule 2 is subsumed by rule 4: wherever it fires, rule 4 of the same class is "
        "at least as strong"
    )
    one["places"].reverse()
    wrong = changed(answers=answers)
    text = "not so: rule 2 is nowhere stronger than rule 4"
    assert any(text in one for one in wrong)


@pytest.mark.parametrize(
    "state",
    [
        {"state": "WITNESS", "point": [], "claims": [], "region": []},
        {"state": "COMPUTED", "how": "by hand"},
    ],
)
def test_a_proof_that_is_turned_into_another_state_is_reported(state: Facts) -> None:
    answers, one, where = answers_of("FT103.superfluous")
    one["state"] = state
    wrong = f"{where}: it must be PROVED, and is {state['state']}"
    assert wrong in changed(answers=answers)


def test_a_witness_that_is_called_computed_is_reported() -> None:
    answers, one, where = answers_of("FT101.wins")
    one["state"] = {"state": "COMPUTED", "how": "by hand"}
    assert changed(answers=answers) == [f"{where}: it needs a witness"]


def test_another_model_is_reported() -> None:
    text, content = small()
    other = content.replace(
        b"range: {from: 0.0, to: 4.0}", b"range: {from: 0.0, to: 5}"
    )
    wrong = recheck(text, other, ("a.json", "m.yaml")).wrong
    assert any(one.startswith("the SHA-256 of m.yaml is ") for one in wrong)
    assert "the side of 'force' is not the model's range" in wrong


def test_a_witness_outside_the_domain_is_reported() -> None:
    answers, one, where = answers_of("FT101.wins")
    one["state"]["point"][0] |= {"exact": "9", "decimal": "9.0", "hex": (9.0).hex()}
    text = f"{where}: the point lies outside the domain"
    assert changed(answers=answers) == [text]


def test_a_value_between_two_categories_is_outside_the_domain() -> None:
    term = Term("cold", Points((0.0, 2.0), (0.0, 1.0)))
    colour = Variable("colour", (term,), categories=("blue", "green", "red"))
    rule = Rule((Proposition("colour", ("cold",)),), "a")
    model = RuleBase("colours", ("a",), (colour,), (rule,), Semantics())
    text, content = audited(model, select=["FT101"], skip=[])
    facts = json.loads(text)
    assert wrong_with(facts, content) == []
    (answer,) = facts["answers"]
    half = {"exact": "3/2", "decimal": "1.5", "hex": (1.5).hex(), "word": ""}
    answer["state"]["point"][0] |= half
    facts["digest"] = digest_of(facts)
    (why,) = wrong_with(facts, content)
    assert why.endswith("the point lies outside the domain")


def test_the_audit_with_rows_that_are_no_table_holds() -> None:
    rows = AuditRows("an array", np.array([[0.5, 1.5, 3.5]]))
    model = random_base(1, 2, 1, kind="points")
    assert recheck(*audited(model, rows=rows), ("a.json", "m.yaml")).wrong == []


@pytest.mark.one_in(3)
@pytest.mark.parametrize("planted", PLANTED, ids=lambda one: one.code)
def test_a_planted_defect_holds(planted: Planted) -> None:
    model = planted.model
    options: Facts = {"select": [planted.code]}
    if isinstance(model, FuzzySystem):
        pytest.skip("a system")
    if isinstance(model, FuzzyTree):
        sides = tuple(DomainSide(name, 0.0, 1.0) for name in model.inputs)
        options["domain"] = Domain(sides)
    if planted.code == "FT701":
        options["rows"] = AuditRows("rows.csv", ROWS.T)
    report = recheck(*audited(model, skip=["FT6"], **options), ("a.json", "m.yaml"))
    assert report.wrong == []


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", range(6))
def test_what_is_proved_of_lines_is_confirmed(seed: int) -> None:
    kinds: tuple[Kind, ...] = ("points", "band")
    norm: Conjunction = "product" if seed % 2 else "minimum"
    model = random_base(seed, 3, 2, norm, kinds[seed % 2], shared=0.5)
    report = recheck(*audited(model, skip=["FT6", "FT7"]), ("a.json", "m.yaml"))
    assert report.wrong == []
    assert {why for state, why in report.undecided if state == "PROVED"} <= HERE


@pytest.mark.heavy
def test_what_is_proved_of_the_tipper_and_the_wines_is_decided_again() -> None:
    tipper = load("examples/tipper.fll")
    assert isinstance(tipper, FuzzySystem)
    for model in (learn("examples/wine/wine.csv", target="cultivar"), tipper):
        content = yaml.write(model).content
        material = Material(model, model_file("m.yaml", content))
        found = audit(material, selection=AuditSelection(skip=["FT6", "FT7"]))
        report = recheck(msgspec.json.encode(found), content, ("a.json", "m.yaml"))
        assert report.wrong == []
        assert {why for state, why in report.undecided if state == "PROVED"} <= HERE
