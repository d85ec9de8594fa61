"""An audit by hand, with an answer of every state and a finding of every severity."""

from __future__ import annotations

from fractions import Fraction

from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import (
    Bracket,
    Claim,
    Declined,
    Proved,
    Sampled,
    Span,
    Witness,
    coordinates,
)
from fuzzytree.auditing.findings.records import (
    LIMITS,
    Audit,
    AuditAnswer,
    AuditSettings,
    FileLocation,
    Measure,
    Policy,
    SourceFile,
    TermName,
    digest_of,
)

LINES = (
    "rules:",
    "- if: [force is low]",
    "  then: soft",
    "- if: [force is high]",
    "  then: firm",
)
"""The file that the places are in."""

POINT = coordinates({"force": Fraction(5, 2), "slip": Fraction(1, 3)})
AGAIN = "fuzzytree audit grip.yaml --select "


def every_state(name: str = "grip.yaml", said: str = "rule 2 never wins") -> Audit:
    """Return an audit with all five states, of a file of any name."""
    answers = (
        AuditAnswer(
            "FT101",
            "rule 2",
            said,
            Proved("12 levels and 40 cells were visited"),
            True,
            "error",
            rules=(2,),
            places=(FileLocation(name, 4, 3), FileLocation(name, 2, 3)),
            repeat=f"{AGAIN}FT101",
            id="FT101-00000001",
        ),
        AuditAnswer(
            "FT202",
            "rules 1 and 2",
            "rules 1 and 2 are equally strong on a part of the domain",
            Witness(POINT, (Claim("ties", rules=(1, 2)),)),
            True,
            "warning",
            rules=(1, 2),
            region=(Span("force", 2.0, 3.0), Span("slip", None, 0.5)),
            measures=(Measure("width", 0.25, "1/4", "N"),),
            id="FT202-00000002",
        ),
        AuditAnswer(
            "FT301",
            "coverage",
            "how weak the weakest cover is was not settled",
            Bracket("the least cover", 0.1, 0.2, "the budget was spent", POINT[:1]),
            True,
            "info",
            id="FT301-00000003",
        ),
        AuditAnswer(
            "FT401",
            "term 'low' of 'force'",
            "the term 'low' of 'force' is not decided",
            Declined("FTD02", "its curve (gaussian) has no exact method"),
            False,
            terms=(TermName("force", "low"),),
            id="FT401-00000004",
        ),
        AuditAnswer(
            "FT701",
            "rule 1",
            "rule 1 wins 3 of 4 rows",
            Sampled("rows it wins", 3, 4, 0.3, 0.95, 0.95, "the rows of grasps.csv"),
            False,
            rules=(1,),
            id="FT701-00000005",
        ),
    )
    found = Audit(
        version="0.1.0",
        model="grip",
        form="rules",
        fingerprint="f" * 64,
        file=SourceFile(name, "a" * 64),
        data=SourceFile("grasps.csv", "b" * 64),
        rows=4,
        policy=Policy("minimum", "strongest"),
        domain=Domain(
            (DomainSide("force", 0.0, 5.0, "model"), DomainSide("slip", 0.0, 1.0))
        ),
        settings=AuditSettings(),
        answers=answers,
        unasked=(
            "FT102 marginal rule: cut short: the budget of 60 s is spent",
            "FT103 redundant rule: left out by the user",
            "FT104 subsumed rule: left out by the user",
            "FT107 irrelevant proposition: not run: the budget of 60 s is spent",
        ),
        limits=LIMITS,
        is_complete=False,
        accepted=("FT301-00000003",),
    )
    return replace(found, digest=digest_of(found))
