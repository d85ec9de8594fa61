"""Gaps in cover are found where they are planted, and gone without."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import Declined, Proved, Witness
from fuzzytree.auditing.findings.deciding import cover_answers as answers
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    AuditSelection,
    AuditSettings,
)
from fuzzytree.auditing.findings.subject import AuditRows, subject_of, view
from fuzzytree.model import (
    Bell,
    Conclusion,
    Defuzzifier,
    FuzzySystem,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
)
from fuzzytree.model.rulebase import (
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)


def _asked(
    *peaks: float,
    width: float = 1.0,
    uncovered: str | None = None,
    rows: AuditRows | None = None,
    is_whole: bool = True,
) -> list[AuditAnswer]:
    terms = tuple(
        Term(f"t{n}", Points((p - width, p, p + width), (0.0, 1.0, 0.0)))
        for n, p in enumerate(peaks)
    )
    rules = tuple(
        Rule((Proposition("x", (t.name,)),), "ab"[n % 2]) for n, t in enumerate(terms)
    )
    semantics = Semantics(uncovered=uncovered)
    base = RuleBase("b", ("a", "b"), (Variable("x", terms),), rules, semantics)
    box = Domain((DomainSide("x", 0.0, 4.0),))
    viewed = replace(view(base, box), is_whole=is_whole)
    subject = subject_of(viewed, AuditSettings(), rows=rows)
    return [*answers(subject)]


def test_full_cover_is_proved_and_its_least_strength_known() -> None:
    cover, weak = _asked(0.0, 1.0, 2.0, 3.0, 4.0)
    assert isinstance(cover.state, Proved)
    assert isinstance(weak.state, Proved)
    assert [one.value for one in weak.measures] == [0.5, 0.5]


def test_every_gap_is_reported_with_its_ends() -> None:
    given = _asked(0.0, 2.5, width=1.0)
    ends = sorted((one.region[0].low, one.region[0].high) for one in given)
    assert ends == [(1.0, 1.5), (3.5, 4.0)]
    assert all(one.is_finding and one.severity == "warning" for one in given)
    assert sorted(one.sentence for one in given) == [
        "no rule fires where 'x' is 1 to 1.5: the answer is no class",
        "no rule fires where 'x' is 3.5 to 4: the answer is no class",
    ]


def test_a_gap_with_a_declared_answer_is_no_warning() -> None:
    given = _asked(0.0, 2.5, uncovered="b")
    assert {one.severity for one in given} == {"info"}
    assert given[0].sentence.endswith("to 1.5: the answer is 'b'")


def test_the_gap_nearest_to_a_row_comes_first() -> None:
    rows = AuditRows("rows", np.array([[3.4, 2.0]]))
    first, second = _asked(0.0, 2.5, rows=rows)
    assert first.region[0].low == 3.5
    assert second.region[0].low == 1.0
    assert first.subject == "gap 1"


def test_weak_cover_is_reported_with_the_least_strength() -> None:
    cover, weak = _asked(0.0, 1.9, 3.8, width=1.0)
    assert isinstance(cover.state, Proved)
    assert isinstance(weak.state, Witness)
    assert weak.is_finding
    assert weak.sentence == (
        "no rule has a strength of 0.1 where 'x' is 0.9 to 1; where it is least, "
        "the strongest rule has 0.05"
    )
    assert 0.049 < weak.measures[0].value <= weak.measures[1].value < 0.051


def test_cover_by_rules_that_are_not_all_there_is_declined() -> None:
    (only,) = _asked(0.0, 2.5, is_whole=False)
    assert isinstance(only.state, Declined)
    assert not only.is_finding


def test_the_least_strength_of_curves_is_that_of_the_curves() -> None:
    terms = (Term("high", Bell(8.0, 2.0, 3.0)),)
    how = Defuzzifier("weighted average")
    output = SystemOutput("z", (Term("n", Singleton(1.0)),), 0.0, 2.0, how)
    rule = SystemRule(Proposition("b", ("high",)), (Conclusion("z", "n"),))
    inputs = (Variable("b", terms, low=0.0, high=10.0),)
    system = FuzzySystem("f", inputs, (output,), (RuleBlock((rule,)),))
    result = ft.audit(system, selection=AuditSelection(select=["FT301"]))
    (weak,) = [answer for answer in result.answers if answer.message == "FT301.weak"]
    low, high = (measure.value for measure in weak.measures)
    assert low <= 1 / 4097 <= high  # the bell at 0, farthest from its center
    assert high - low < 1e-5
