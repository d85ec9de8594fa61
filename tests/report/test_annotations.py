"""Findings as GitHub's workflow commands, which no name can break out of."""

from __future__ import annotations

from msgspec.structs import replace

from fuzzytree.auditing.decide.states import Declined
from fuzzytree.report.sarif import annotation_lines
from tests.report.audits import every_state


def test_each_open_finding_is_a_command_and_an_incomplete_audit_another() -> None:
    assert [*annotation_lines(every_state())] == [
        "::error file=grip.yaml,line=4,col=3,title=FT101 dead rule::"
        "rule 2 never wins (PROVED, FT101-00000001)",
        "::warning file=grip.yaml,title=FT202 ambiguity::rules 1 and 2 are equally "
        "strong on a part of the domain (WITNESS, FT202-00000002)",
        "::notice title=audit not complete::FT102 marginal rule: cut short: the budget "
        "of 60 s is spent; FT107 irrelevant proposition: not run: the budget of 60 s "
        "is spent",
    ]


def test_hostile_names_stay_where_they_belong() -> None:
    said = "rule\n::error::50% of 'a,b:c'\r \x1b[2J\u202enever"
    first = next(annotation_lines(every_state("a,b:c%\n.yaml", said)))
    assert first == (
        "::error file=a%2Cb%3Ac%25%0A.yaml,line=4,col=3,title=FT101 dead rule::"
        r"rule%0A::error::50%25 of 'a,b:c'%0D \x1b[2J\u202enever "
        "(PROVED, FT101-00000001)"
    )


def test_an_audit_of_no_file_names_none() -> None:
    audit = replace(every_state(), file=None, is_complete=True)
    lines = [*annotation_lines(replace(audit, answers=audit.answers[1:2]))]
    assert len(lines) == 1
    assert lines[0].startswith("::warning title=FT202 ambiguity::rules 1 and 2 are")


def test_an_audit_that_knows_nothing_says_so() -> None:
    audit = every_state()
    declined = [one for one in audit.answers if isinstance(one.state, Declined)]
    silent = replace(audit, answers=tuple(declined), is_complete=True)
    said = f"nothing is known: first, {declined[0].sentence}"
    assert [*annotation_lines(silent)] == [f"::notice title=audit declined::{said}"]
