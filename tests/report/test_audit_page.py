"""The page of an audit: all of it is there, nothing of a name becomes markup."""

from __future__ import annotations

import base64
import hashlib
import itertools
import re
from html.parser import HTMLParser
from typing import Any

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree.auditing.decide.states import Declined, Proved
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.checking.stability.results import Stability, Trial
from fuzzytree.model.agreement import Agreement, Comparison
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.report import audit_findings, audit_page
from fuzzytree.report.audit_page import page
from fuzzytree.report.audit_states import STATES
from fuzzytree.testing import random_system, random_tree
from tests.report.page_audits import EVIL, answers, audit_of, rows_of, rule_base

_VOID = {"meta", "br"}


class Outline(HTMLParser):
    """What a browser would make of a page: elements, words, links and ids."""

    def __init__(self, content: str) -> None:
        super().__init__()
        self.counts: dict[str, int] = {}
        self.attributes: set[str] = set()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.headings: list[int] = []
        self.words: list[str] = []
        self._open: list[str] = []
        self.feed(content)
        self.close()
        assert not self._open, self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.counts[tag] = self.counts.get(tag, 0) + 1
        for name, value in attrs:
            self.attributes.add(name)
            if name == "id":
                self.ids.append(value or "")
            if name == "href":
                self.links.append(value or "")
        if re.fullmatch("h[1-6]", tag):
            self.headings.append(int(tag[1]))
        if tag not in _VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        assert self._open.pop() == tag

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not self._open or self._open[-1] not in ("style", "script"):
            self.words.append(data)

    @property
    def text(self) -> str:
        """All words, one space between them."""
        return " ".join(" ".join(self.words).split())


def shown(model: RuleBase | None = None, **fields: Any) -> Outline:
    rules = rule_base() if model is None else model
    return Outline(page(audit_of(rules, **fields), rules, rows=rows_of(rules)))


def test_the_verdict_counts_findings_by_severity() -> None:
    text = shown().text
    assert "4 findings: 1 error, 1 warning, 2 notes" in text
    assert "10 questions, 1 open and 1 declined" in text


def test_an_audit_without_findings_says_so() -> None:
    clean = tuple(one for one in answers() if not one.is_finding)
    rules = rule_base()
    text = Outline(page(audit_of(rules, clean[:1]), rules)).text
    assert "Nothing found 1 question answered" in text
    assert "There is no finding" in text
    text = Outline(page(audit_of(rules, clean), rules)).text
    assert "Nothing found 6 questions, 1 declined" in text


def test_an_audit_that_decided_nothing_does_not_look_calm() -> None:
    declined = tuple(one for one in answers() if isinstance(one.state, Declined))
    rules = rule_base()
    content = page(audit_of(rules, declined), rules)
    assert "all declined: nothing is known" in content
    assert 'class="said calm"' not in content


def test_an_audit_that_found_nothing_so_far_does_not_look_calm() -> None:
    rules = rule_base()
    clean = tuple(one for one in answers() if not one.is_finding)
    content = page(audit_of(rules, clean[:1], is_complete=False), rules)
    assert "Nothing found" in content
    assert 'class="said calm"' not in content


def test_an_audit_that_was_cut_short_says_so_and_what_was_not_asked() -> None:
    unasked = ("FT501 complexity: not run: the budget of 1 s is spent",)
    text = shown(is_complete=False, unasked=unasked).text
    assert "Incomplete: the budget is spent" in text
    assert unasked[0] in text
    by_hand = ("FT501 complexity: not run: interrupted",)
    text = shown(is_complete=False, unasked=by_hand).text
    assert "Interrupted: what is proved is kept" in text


def test_an_accepted_finding_is_shown_but_not_counted() -> None:
    text = shown(accepted=("FT101-9f2c11ab",)).text
    assert "3 findings: 1 warning, 2 notes beside 1 accepted" in text
    assert "rule 4 never wins" in text


def test_the_verdict_names_alike_findings_once() -> None:
    gap = next(one for one in answers() if one.code == "FT301")
    gaps = [msgspec.structs.replace(gap, id=f"FT301-{k}") for k in range(3)]
    found = shown(found=tuple(gaps))
    assert f"{gap.sentence} 3 times FT301" in found.text
    assert found.links.count("#FT301-0") == 1
    assert "#FT301-1" not in found.links


def test_every_part_of_a_finding_is_on_the_page() -> None:
    text = shown().text
    for said in (
        "rule 4 never wins: wherever it fires rule 2 is at least as strong",
        "grip.yaml:58:5",
        "17 levels and 96 cells",
        "fuzzytree audit grip.yaml --select FT101",
        "FT101-9f2c11ab",
        "the common level lies between 0.3 and 0.4; the budget was spent",
        "rules 1, 2, 3, 4 are below 0.1",
        "26/3",
        "8.666666666666666",
        "0x1.6800000000000p+6",
        "rows in both: 3 of 40 rows, 7.5 % (95 % sure: 2 to 20 %)",
        "FTD06, needs rows: no rows were given",
        "from 7.7 kPa; witness 8.667",
        "Where pressure is from 7.7 kPa and area is 88 to 90.5 mm²",
    ):
        assert said in text, said


@pytest.mark.parametrize("state", [*STATES])
def test_a_state_has_its_word_its_sign_and_its_frame(state: str) -> None:
    content = page(audit_of(rule_base()), rule_base())
    badge = f'<span class="state {state.lower()}"><svg class="icon"'
    assert f'{badge} aria-hidden="true" viewBox="0 0 16 16">' in content
    assert f'<use href="#i-{state.lower()}"/></svg>{state}</span>' in content
    assert f'<symbol id="i-{state.lower()}"' in content
    assert f".state.{state.lower()} {{" in content


def test_every_question_and_every_limit_is_on_the_page() -> None:
    audit = audit_of(rule_base())
    text = Outline(page(audit, rule_base())).text
    for answer in audit.answers:
        assert answer.sentence in text
    for limit in audit.limits:
        assert limit in text


def test_the_page_reports_how_to_repeat_the_audit() -> None:
    audit = audit_of(rule_base())
    text = Outline(page(audit, rule_base())).text
    for said in (
        "command fuzzytree audit grip.yaml fuzzytree 0.1.0 the model grip its content",
        audit.fingerprint,
        audit.digest,
        "ab" * 32,
        "cd" * 32,
        "epsilon 0.1",
        "budget 60 The domain",
        "area 0.0 100.0 the model's range",
    ):
        assert said in text, said


def test_the_rules_say_how_often_they_fired_and_link_to_their_findings() -> None:
    found = shown()
    assert "19 85.7 % (50 to 90)" in found.text
    assert "#FT101-9f2c11ab" in found.links
    assert "rule-4" in found.ids


def test_what_else_is_known_is_reported_with_its_numbers() -> None:
    size = AuditAnswer(
        "FT501",
        "the rule base",
        "4 rules with 7 propositions",
        Proved("all were counted"),
        is_finding=False,
        measures=(Measure("propositions", 7.0), Measure("index", 0.5, "1/2")),
    )
    found = shown(found=(size,))
    said = "4 rules with 7 propositions all were counted propositions 7 index 0.5 = 1/2"
    assert said in found.text


def test_links_lead_somewhere_and_no_id_stands_twice() -> None:
    found = shown()
    assert len(set(found.ids)) == len(found.ids)
    assert {link.removeprefix("#") for link in found.links} <= set(found.ids)


def test_headings_skip_no_level() -> None:
    levels = shown().headings
    assert levels[0] == 1
    assert levels.count(1) == 1
    steps = itertools.pairwise(levels)
    assert all(after <= before + 1 for before, after in steps)


def test_no_name_becomes_markup() -> None:
    plain, evil = shown(), shown(rule_base(EVIL[:-2], EVIL[:-2] + "2"))
    assert evil.counts.keys() == plain.counts.keys()
    assert evil.counts["script"] == 1
    assert "img" not in evil.counts
    assert evil.attributes == plain.attributes
    assert "<script>alert(1)</script>" in evil.text


def test_sentences_places_and_ids_of_a_hostile_audit_do_not_become_markup() -> None:
    evil = AuditAnswer(
        EVIL,
        EVIL,
        EVIL,
        Proved(EVIL),
        is_finding=True,
        severity="error",
        rules=(999, -3, 0),
        repeat=EVIL,
        id=EVIL,
    )
    found = shown(found=(evil, evil))
    assert found.counts["script"] == 1
    assert "img" not in found.counts
    assert len(set(found.ids)) == len(found.ids)


def test_a_long_name_is_cut_and_its_length_is_written() -> None:
    rules = rule_base("p" * 5000)
    content = page(audit_of(rules), rules, rows=rows_of(rules))
    assert "p" * 401 not in content
    assert f"{'p' * 400}… (5000 characters)" in content


def test_only_the_pages_own_style_and_script_may_run() -> None:
    content = page(audit_of(rule_base()), rule_base())
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', content)
    assert policy is not None
    assert policy[1].startswith("default-src 'none'; ")
    for kind in ("script", "style"):
        inner = re.search(f"<{kind}>(.*?)</{kind}>", content, re.DOTALL)
        assert inner is not None
        digest = hashlib.sha256(inner[1].encode()).digest()
        assert f"{kind}-src 'sha256-{base64.b64encode(digest).decode()}'" in policy[1]
    assert not re.search(r'\s(style|onclick|onload)="', content)
    assert "http:" not in content
    assert "https:" not in content


def test_the_same_audit_gives_the_same_bytes() -> None:
    rules = rule_base()
    first = page(audit_of(rules), rules, rows=rows_of(rules))
    assert page(audit_of(rules), rules, rows=rows_of(rules)) == first


def test_a_tree_is_drawn_with_the_rows_that_pass() -> None:
    tree = random_tree(3, leaves=5)
    rules = rule_base()
    values = np.random.default_rng(1).normal(size=(len(tree.inputs), 30))
    values[0, 0] = np.nan
    rows = AuditRows("rows", values, np.zeros(30, np.int64))
    audit = audit_of(rules, (), form="tree")
    text = Outline(page(audit, tree, rows=rows)).text
    assert f"The tree {tree.name}: {len(tree.nodes)} nodes, 5 leaves" in text
    assert "1 row with a missing value left out" in text
    assert "rows by class: 29" in text


def test_the_head_says_that_a_missing_value_is_replaced() -> None:
    tree = random_tree(1, combinations=0)
    first, *others = tree.variables
    filled = replace(tree, variables=(replace(first, missing=0.5), *others))
    words = " ".join(Outline(page(audit_of(rule_base()), filled)).words)
    rest = len(tree.inputs) - 1
    said = f"replaced, see `missing as` of 1 input; no class for {rest}"
    assert f"; a missing value: {said}" in words
    assert "; a missing value: no class" in " ".join(
        Outline(page(audit_of(rule_base()), tree)).words
    )


@pytest.mark.heavy
def test_a_tree_of_many_leaves_is_printed_as_an_outline() -> None:
    tree = random_tree(3, leaves=210)
    text = Outline(page(audit_of(rule_base(), ()), tree)).text
    assert "A picture shows at most 200 leaves, and this tree has 210" in text


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", range(6))
def test_a_system_has_its_terms_and_the_rules_as_they_are_audited(seed: int) -> None:
    system = random_system(seed)
    audit = audit_of(rule_base(), (), form="system")
    text = Outline(page(audit, system)).text
    assert "fuzzytree audit of a fuzzy system" in text
    for one in system.variables:
        assert one.name in text


def test_agreement_and_stability_are_on_the_page_where_they_are_given() -> None:
    rules = rule_base()
    compared = Comparison("onnx", "rules", "rows", 40, "DISAGREES", 1, 0.25, 1e-12)
    agreement = Agreement("grip", "", (compared,), skipped=("no C compiler",))
    criteria = (Trial("N3", "sort", ["row 3 differs"], cases=12).result(),)
    stability = Stability("grip", "", 40, 0, 0, (), criteria)
    found = page(
        audit_of(rules), rules, rows=None, agreement=agreement, stability=stability
    )
    text = Outline(found).text
    assert "1 of 1 comparison disagrees" in text
    assert "no C compiler" in text
    assert "1 of 1 stability check fails: " in text
    assert "N3: row 3 differs" in text
    assert "Agreement" not in Outline(page(audit_of(rules), rules)).text


def test_many_comparisons_that_agree_are_folded_below_those_that_do_not() -> None:
    rules = rule_base()
    alike = tuple(
        Comparison(f"representation {k}", "tree", "rows", 9, "agrees")
        for k in range(13)
    )
    wrong = Comparison("x.onnx", "tree", "rows", 9, "DISAGREES")
    found = page(audit_of(rules), rules, agreement=Agreement("g", "", (*alike, wrong)))
    text = Outline(found).text
    order = ["1 of 14 comparisons disagrees", "x.onnx", "13 comparisons agree"]
    places = [
        text.index(said) for said in (*order, "representation 0", "representation 12")
    ]
    assert places == sorted(places)


def test_of_many_findings_of_a_code_the_first_are_whole() -> None:
    gap = next(one for one in answers() if one.code == "FT301")
    gaps = tuple(
        msgspec.structs.replace(gap, id=f"FT301-{k}", sentence=f"gap {k}")
        for k in range(5)
    )
    rules = rule_base()
    content = page(audit_of(rules, gaps), rules)
    assert content.count('<div class="rest">') == 2
    whole, folded = (content.split(f'id="FT301-{k}"')[1] for k in (2, 3))
    assert whole.index("8.666666666666666") < whole.index('<div class="rest">')
    assert folded.index('<div class="rest">') < folded.index("8.666666666666666")
    found = Outline(content)
    assert found.text.count("Where it is, and how it is known") == 2
    errors = [msgspec.structs.replace(one, severity="error") for one in gaps]
    assert '<div class="rest">' not in page(audit_of(rules, tuple(errors)), rules)


def test_a_code_of_two_severities_has_two_groups_and_no_id_twice() -> None:
    first, second = answers()[0], answers()[3]
    second = msgspec.structs.replace(second, code="FT101", id="FT101-00000007")
    found = shown(found=(first, second))
    assert found.text.count("What this means and what to do") == 2
    assert len(set(found.ids)) == len(found.ids)


def test_what_was_not_examined_is_gathered_by_its_reason() -> None:
    unasked = ("FT102 marginal rule: left out", "FT103 redundant rule: left out")
    assert "Not examined FT102, FT103: left out" in shown(unasked=unasked).text


def test_what_is_too_much_is_left_out_and_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(audit_findings, "MOST_FINDINGS", 3)
    monkeypatch.setattr(audit_findings, "MOST_PICTURED", 2)
    monkeypatch.setattr(audit_page, "MOST_QUESTIONS", 4)
    found = shown()
    assert "1 more finding: the JSON has all of them" in found.text
    assert "Only the first 2 findings have pictures" in found.text
    assert "Every question, 10 in all; the first 4 are here" in found.text
    assert {link.removeprefix("#") for link in found.links} <= set(found.ids)


def test_a_page_of_many_findings_is_bounded() -> None:
    rules = rule_base()
    some = [msgspec.structs.replace(one, id="") for one in answers() if one.is_finding]
    small = len(page(audit_of(rules, tuple(some * 100)), rules))
    large = len(page(audit_of(rules, tuple(some * 1000)), rules))
    assert large < small + 500_000 < 3_000_000


def test_the_weights_of_a_systems_rules_are_reported() -> None:
    system = random_system(3)
    blocks = [
        replace(one, rules=tuple(replace(rule, weight=0.25) for rule in one.rules))
        for one in system.blocks
    ]
    audit = audit_of(rule_base(), (), form="system")
    said = "The strengths of these are multiplied by their weights: rule 1 by 0.25, "
    plain, weighted = (
        Outline(page(audit, one)).text
        for one in (system, replace(system, blocks=tuple(blocks)))
    )
    assert said in weighted
    assert said not in plain
