"""Each defect is found by a whole audit where it is planted, and gone without it.

Two codes cannot be planted in a model: FT601 and FT602 hold an audit's own forms of
the model against each other, and these are made of it as it stands. Damaged graphs and
runtimes are planted in `tests/auditing/test_carriers.py`. FT204, FT205 and FT501 are
never findings: here the facts that they tell move with the model.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.auditing.audit import ASKED
from fuzzytree.auditing.records import Answer, Severity
from fuzzytree.proving.states import Bracket, Proved, Sampled, State, Witness
from fuzzytree.rulebase import Clause, Points, Rule, RuleBase, Term, Variable
from fuzzytree.tree import FuzzyTree
from tests.auditing.small_trees import one_cut, two_cuts

LOW = Term("low", Points((0.0, 1.0, 2.5), (1.0, 1.0, 0.0)))
HIGH = Term("high", Points((1.5, 3.0, 4.0), (0.0, 1.0, 1.0)))
CLEAN = RuleBase(
    "grip",
    ("soft", "hard", "other"),
    (Variable("force", (LOW, HIGH), unit="N", low=0.0, high=4.0),),
    (
        Rule((Clause("force", ("low",)),), "soft"),
        Rule((Clause("force", ("high",)),), "hard"),
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
    rule = Rule((Clause("force", (term,)),), then)
    return replace(with_terms(*terms), rules=(*CLEAN.rules, rule))


def with_clause(term: Term) -> RuleBase:
    """Return the clean rules, the first of which asks one more thing."""
    first, *others = CLEAN.rules
    wide = replace(first, when=(*first.when, Clause("force", (term.name,))))
    return replace(with_terms(term), rules=(wide, *others))


class Planted(NamedTuple):
    """A defect, and how its finding is to be told."""

    code: str
    model: RuleBase | FuzzyTree
    severity: Severity
    state: type[State]
    about: tuple[int | str, ...] = ()  # rules or terms
    clean: RuleBase | FuzzyTree = CLEAN


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

PLANTED = (
    Planted("FT101", with_rule("faint", "other", FAINT), "error", Proved, (3,)),
    Planted("FT101", two_cuts(0.25), "error", Proved, (2,), clean=two_cuts(0.75)),
    Planted("FT102", with_rule("edge", "other", EDGE), "warning", Bracket, (3,)),
    Planted("FT103", with_rule("faint", "soft", FAINT), "info", Proved, (3,)),
    Planted(
        "FT104", with_rule("faint", "soft", FAINT), "warning", Proved, (3, 1), TWO_SOFT
    ),
    Planted("FT105", with_rule("faint", "hard", FAINT), "error", Proved, (3, 1)),
    Planted("FT106", with_rule("low", "soft"), "warning", Proved, (1, 3)),
    Planted("FT106", with_rule("low", "hard"), "error", Proved, (1, 3)),
    Planted("FT107", with_clause(ALL), "info", Proved, (1, "all")),
    Planted("FT201", with_terms(WIDE), "info", Witness, (1, 2)),
    Planted("FT202", with_rule("low", "hard"), "warning", Witness, (1, 3)),
    Planted("FT203", one_cut(0.25), "warning", Witness, (1, 2), clean=one_cut(0.5)),
    Planted("FT301", replace(CLEAN, rules=CLEAN.rules[:1]), "warning", Witness),
    Planted("FT401", with_rule("beyond", "hard", BEYOND), "error", Proved, ("beyond",)),
    Planted("FT402", with_terms(PEAKS), "warning", Proved, ("low",)),
    Planted(
        "FT403", with_rule("alike", "soft", ALIKE), "info", Proved, ("low", "alike")
    ),
    Planted("FT404", with_terms(FAINT), "info", Proved, ("faint",)),
    Planted("FT701", replace(CLEAN, rules=CLEAN.rules[:1]), "info", Sampled),
)
NEVER_FOUND = {"FT204", "FT205", "FT501"}
OF_FORMS = {"FT601", "FT602"}


def limits(model: RuleBase | FuzzyTree) -> Mapping[str, tuple[float, float]]:
    """Return the ends of a tree's inputs, which its variables do not have."""
    return (
        {} if isinstance(model, RuleBase) else dict.fromkeys(model.inputs, (0.0, 1.0))
    )


def asked(model: RuleBase | FuzzyTree, code: str) -> list[Answer]:
    """Return what a whole audit, without carriers, answers to one kind of question."""
    data = ROWS if isinstance(model, RuleBase) else None
    columns = list(model.inputs) if data is not None else None
    found = ft.audit(
        model, data=data, columns=columns, limits=limits(model), ignore=["FT6"]
    )
    assert found.is_complete
    return [one for one in found.answers if one.code == code]


def test_every_code_of_an_audit_is_planted_or_said_why_not() -> None:
    assert {one.code for one in PLANTED} | NEVER_FOUND | OF_FORMS == ASKED


@pytest.mark.parametrize("planted", PLANTED, ids=lambda one: one.code)
def test_a_planted_defect_is_found_and_gone_without_it(planted: Planted) -> None:
    found = [one for one in asked(planted.model, planted.code) if one.is_finding]
    assert found
    first = found[0]
    assert first.severity == planted.severity
    assert isinstance(first.state, planted.state)
    assert (*first.rules, *(one.term for one in first.terms)) == planted.about
    clean = asked(planted.clean, planted.code)
    assert clean
    assert not [one for one in clean if one.is_finding]


def test_an_audit_counts_what_the_model_has() -> None:
    for model, count in ((CLEAN, 2.0), (with_rule("low", "soft"), 3.0)):
        (facts,) = asked(model, "FT501")
        assert not facts.is_finding
        assert {one.name: one.value for one in facts.measures}["rules"] == count


def test_the_nearest_other_decision_and_the_regions_move_with_a_cut() -> None:
    for cut in (0.625, 0.75):
        found = ft.audit(
            two_cuts(cut),
            limits={"x": (0.0, 1.0), "y": (0.0, 1.0)},
            row={"x": 0.6, "y": 0.5},
            select=["FT204", "FT205"],
        )
        assert not found.findings
        radius = next(one for one in found.answers if one.measures)
        assert radius.code == "FT204"
        assert radius.measures[0].value == pytest.approx(min(cut - 0.6, 0.1), 1e-2)
        (last,) = (one for one in found.answers if one.subject == "leaf 3")
        (span,) = last.region
        assert span.low == cut
