"""Each defect is found by a whole audit where it is planted, and gone without it.

Two codes cannot be planted in a model: FT601 and FT602 compare an audit's own
representations of the model, and these are made of it as it stands. Damaged graphs and
runtimes are planted in `test_representations`. FT204, FT205 and FT501 are never
findings: their measures change with the model.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.auditing.decide.states import (
    Bracket,
    Computed,
    Proved,
    Sampled,
    State,
    Witness,
)
from fuzzytree.auditing.findings.codes import AUDITED
from fuzzytree.auditing.findings.records import AuditAnswer, Severity
from fuzzytree.model import (
    LR,
    Conclusion,
    Defuzzifier,
    Document,
    FuzzySystem,
    FuzzyTree,
    Points,
    Proposition,
    Rule,
    RuleBase,
    RuleBlock,
    Semantics,
    Side,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
)
from tests.auditing.findings.small_trees import one_cut, two_cuts

LOW = Term("low", Points((0.0, 1.0, 2.5), (1.0, 1.0, 0.0)))
HIGH = Term("high", Points((1.5, 3.0, 4.0), (0.0, 1.0, 1.0)))
CLEAN = RuleBase(
    "grip",
    ("soft", "hard", "other"),
    (Variable("force", (LOW, HIGH), unit="N", low=0.0, high=4.0),),
    (
        Rule((Proposition("force", ("low",)),), "soft"),
        Rule((Proposition("force", ("high",)),), "hard"),
    ),
)
FAINT = Term("faint", Points((0.5, 1.0, 1.25), (0.0, 0.75, 0.0)))  # below low
ROWS = np.array([[0.5], [1.9], [3.5]])


def with_terms(*terms: Term) -> RuleBase:
    """Return the clean rules with more terms, or others of the same names."""
    (force,) = CLEAN.variables
    every = {term.name: term for term in (*force.terms, *terms)}
    return replace(CLEAN, variables=(replace(force, terms=tuple(every.values())),))


def with_rule(term: str, then: str, *terms: Term) -> RuleBase:
    """Return the clean rules with one more at the end."""
    rule = Rule((Proposition("force", (term,)),), then)
    return replace(with_terms(*terms), rules=(*CLEAN.rules, rule))


def with_proposition(term: Term) -> RuleBase:
    """Return the clean rules, the first of which has one more proposition."""
    first, *others = CLEAN.rules
    wide = replace(first, when=(*first.when, Proposition("force", (term.name,))))
    return replace(with_terms(term), rules=(wide, *others))


class Planted(NamedTuple):
    """A defect, and how its finding should read."""

    code: str
    model: Document
    severity: Severity
    state: type[State]
    about: tuple[int | str, ...] = ()  # rules or terms
    clean: Document = CLEAN
    says: str = ""  # where a code has several sentences: a part of this one


def points(*of: tuple[float, float]) -> Points:
    """Return a curve through some points."""
    values, degrees = zip(*of, strict=True)
    return Points(values, degrees)


EDGE = Term("edge", points((1.75, 0.0), (2.0, 0.335), (2.25, 0.0)))  # 1/3 is there
ALL = Term("all", points((0.0, 1.0)))
BEYOND = Term("beyond", points((120.0, 0.0), (130.0, 1.0)))
PEAKS = Term("low", points((0.0, 1.0), (0.5, 1.0), (1.0, 0.5), (1.2, 0.75), (2.5, 0.0)))
ALIKE = Term("alike", Points((0.0, 1.0, 2.6), (1.0, 1.0, 0.0)))
WIDE = Term("low", Points((0.0, 2.0, 3.0), (1.0, 1.0, 0.0)))

TWO_SOFT = with_rule("high", "soft")
NARROW = with_terms(
    Term("low", points((0.0, 1.0), (1.0, 1.0), (2.0, 0.0))),
    Term("high", points((1.9, 0.0), (3.0, 1.0), (4.0, 1.0))),
)
OVER = Side(2.0, (0.0, 1.0), 1.5)  # 1 - t (2 t - 1) is above 1 up to the middle
OUTSIDE = Term("beyond", points((3.5, 0.0), (4.0, 1.0), (20.0, 0.0)))
SPARE = replace(
    CLEAN, variables=(*CLEAN.variables, Variable("spare", (LOW,), low=0.0, high=1.0))
)


def multiplied(rules: RuleBase) -> RuleBase:
    """Return rules that join their propositions by the product."""
    return replace(rules, semantics=Semantics("product"))


PLANTED = (
    Planted("FT101", with_rule("faint", "other", FAINT), "error", Proved, (3,)),
    Planted("FT101", two_cuts(0.25), "error", Proved, (2,), clean=two_cuts(0.75)),
    Planted("FT102", with_rule("edge", "other", EDGE), "warning", Bracket, (3,)),
    Planted(
        "FT101", with_rule("low", "hard"), "warning", Witness, (1,), says="by its place"
    ),
    Planted(
        "FT101",
        with_rule("beyond", "hard", BEYOND),
        "error",
        Proved,
        (3,),
        says="never fires",
    ),
    Planted(
        "FT101",
        multiplied(with_rule("faint", "other", FAINT)),
        "error",
        Proved,
        (3,),
        multiplied(CLEAN),
    ),
    Planted(
        "FT102",
        multiplied(with_rule("edge", "other", EDGE)),
        "warning",
        Bracket,
        (3,),
        multiplied(CLEAN),
    ),
    Planted("FT103", with_rule("faint", "soft", FAINT), "info", Proved, (3,)),
    Planted(
        "FT104", with_rule("faint", "soft", FAINT), "warning", Proved, (3, 1), TWO_SOFT
    ),
    Planted("FT105", with_rule("faint", "hard", FAINT), "error", Proved, (3, 1)),
    Planted("FT106", with_rule("low", "soft"), "warning", Proved, (1, 3)),
    Planted("FT106", with_rule("low", "hard"), "error", Proved, (1, 3)),
    Planted("FT107", with_proposition(ALL), "info", Proved, (1, "all")),
    Planted("FT201", with_terms(WIDE), "info", Witness, (1, 2)),
    Planted("FT202", with_rule("low", "hard"), "warning", Witness, (1, 3)),
    Planted("FT203", one_cut(0.25), "warning", Witness, (1, 2), clean=one_cut(0.5)),
    Planted("FT301", replace(CLEAN, rules=CLEAN.rules[:1]), "warning", Witness),
    Planted("FT301", NARROW, "warning", Witness, says="no rule has a strength of 0.1"),
    Planted("FT401", with_rule("beyond", "hard", BEYOND), "error", Proved, ("beyond",)),
    Planted("FT402", with_terms(PEAKS), "warning", Proved, ("low",)),
    Planted(
        "FT402",
        with_terms(Term("high", LR(3.5, OVER, OVER))),
        "warning",
        Computed,
        ("high",),
        says="is clipped",
    ),
    Planted(
        "FT402",
        with_rule("faint", "soft", FAINT),
        "warning",
        Proved,
        ("faint",),
        says="no point of degree 1",
    ),
    Planted(
        "FT402",
        with_rule("beyond", "hard", OUTSIDE),
        "warning",
        Proved,
        ("beyond",),
        says="outside of the domain",
    ),
    Planted(
        "FT403", with_rule("alike", "soft", ALIKE), "info", Proved, ("low", "alike")
    ),
    Planted("FT404", with_terms(FAINT), "info", Proved, ("faint",)),
    Planted("FT404", SPARE, "info", Proved, ("low",), says="variable 'spare'"),
    Planted("FT701", replace(CLEAN, rules=CLEAN.rules[:1]), "info", Sampled),
)


def system(
    *others: tuple[str, str, float],
    falls: tuple[float, float] = (1.0, 2.5),
    more: tuple[Term, ...] = (),
) -> FuzzySystem:
    """Return the clean rules as a system, with more rules: term, conclusion, weight."""
    low = Term("low", Trapezoid(None, 0.0, *falls))
    high = Term("high", Trapezoid(1.5, 3.0, 4.0, None))
    entries = (("low", "weak", 1.0), ("high", "strong", 1.0), *others)
    rules = tuple(
        SystemRule(Proposition("force", (term,)), (Conclusion("grip", then),), weight)
        for term, then, weight in entries
    )
    ends = Term("weak", Singleton(0.0)), Term("strong", Singleton(1.0))
    output = SystemOutput("grip", ends, None, None, Defuzzifier("weighted average"))
    force = Variable("force", (low, high, *more), low=0.0, high=4.0)
    return FuzzySystem("grip", (force,), (output,), (RuleBlock(rules),))


FAR = Term("far", Trapezoid(120.0, 130.0, 140.0, 150.0))
LIKE = Term("like", Trapezoid(None, 0.0, 1.0, 2.6))
OF_SYSTEMS = (
    Planted("FT101", system(("low", "strong", 0.0)), "error", Proved),
    Planted("FT106", system(("low", "strong", 1.0)), "info", Proved, (1, 3)),
    Planted("FT201", system(falls=(2.0, 3.0)), "info", Witness, (1, 2)),
    Planted("FT301", system(falls=(0.5, 1.0)), "warning", Witness),
    Planted(
        "FT401", system(("far", "weak", 1.0), more=(FAR,)), "error", Proved, ("far",)
    ),
    Planted("FT403", system(more=(LIKE,)), "info", Proved, ("low", "like")),
    Planted("FT404", system(more=(LIKE,)), "info", Proved, ("like",)),
)
NEVER_FOUND = {"FT204", "FT205", "FT501"}
OF_FORMS = {"FT601", "FT602"}


@functools.cache
def answers(model: Document, code: str = "") -> tuple[AuditAnswer, ...]:
    """Return what a whole audit, without representations, answers; or of one code."""
    data, columns, limits = None, None, {}
    match model:
        case RuleBase(inputs=inputs):
            data, columns = np.repeat(ROWS, len(inputs), axis=1), inputs
        case FuzzyTree(inputs=inputs):
            limits = dict.fromkeys(inputs, (0.0, 1.0))
        case FuzzySystem():
            pass
    found = ft.audit(
        model,
        data=None if data is None else ft.table(data, columns=columns),
        domain=ft.AuditDomain(limits=limits),
        selection=ft.AuditSelection(select=[code] if code else (), skip=["FT6"]),
    )
    assert found.is_complete
    return found.answers


def answers_for(model: Document, code: str) -> list[AuditAnswer]:
    """Return what a whole audit answers to one kind of question."""
    is_on_request = code == "FT203"
    every = answers(model, code if is_on_request else "")
    return [one for one in every if one.code == code]


def test_every_code_of_an_audit_is_planted_or_said_why_not() -> None:
    assert {one.code for one in PLANTED} | NEVER_FOUND | OF_FORMS == AUDITED


@pytest.mark.one_in(6)
@pytest.mark.parametrize(
    "planted",
    [*PLANTED, *(one._replace(clean=system()) for one in OF_SYSTEMS)],
    ids=lambda one: f"{one.code}-{type(one.model).__name__}",
)
def test_a_planted_defect_is_found_and_gone_without_it(planted: Planted) -> None:
    found = [one for one in answers_for(planted.model, planted.code) if one.is_finding]
    first = next(one for one in found if planted.says in one.sentence)
    assert first.severity == planted.severity
    assert isinstance(first.state, planted.state)
    assert (*first.rules, *(one.term for one in first.terms)) == planted.about
    clean = answers_for(planted.clean, planted.code)
    assert clean
    assert not [one for one in clean if one.is_finding]


def test_an_audit_counts_what_the_model_has() -> None:
    for model, count in ((CLEAN, 2.0), (with_rule("low", "soft"), 3.0)):
        (facts,) = answers_for(model, "FT501")
        assert not facts.is_finding
        assert {one.name: one.value for one in facts.measures}["rules"] == count


def test_the_nearest_other_decision_and_the_regions_move_with_a_cut() -> None:
    for cut in (0.625, 0.75):
        found = ft.audit(
            two_cuts(cut),
            domain=ft.AuditDomain(
                limits={"x": (0.0, 1.0), "y": (0.0, 1.0)}, row={"x": 0.6, "y": 0.5}
            ),
            selection=ft.AuditSelection(select=["FT204", "FT205"]),
        )
        assert not found.findings
        radius = next(one for one in found.answers if one.measures)
        assert radius.code == "FT204"
        assert radius.measures[0].value == pytest.approx(min(cut - 0.6, 0.1), 1e-2)
        (last,) = (one for one in found.answers if one.subject == "leaf 3")
        (span,) = last.region
        assert span.low == cut


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        ([[0.5], [9.0]], "on 1 of 2 rows a value is outside the domain"),
        ([[0.5], [np.nan]], "on 1 of 2 rows a value is missing"),
    ],
)
def test_a_planted_row_is_found_and_gone_without_it(
    rows: list[list[float]], text: str
) -> None:
    for data, count in ((rows, 1), ([[0.5], [3.5]], 0)):
        found = ft.audit(
            CLEAN,
            data=ft.table(np.array(data), columns=["force"]),
            selection=ft.AuditSelection(select=["FT7"]),
        )
        results = [one.sentence for one in found.findings]
        assert results.count(text) == count
