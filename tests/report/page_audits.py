"""What a page is made of: an answer of each state, about a small rule base."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import msgspec
import numpy as np

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
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.model.rulebase import (
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
    fingerprint,
)

EVIL = '"/><script>alert(1)</script><img src=x onerror=alert(1)>&\x1b\u202e'
"""A name that would break out of a page, a picture or an attribute."""


def rule_base(pressure: str = "pressure", firm: str = "firm") -> RuleBase:
    """Return rules about two inputs, of which the last never wins."""
    low = Term("low", Points((2.0, 5.0), (1.0, 0.0)))
    medium = Term("medium", Points((2.0, 5.0, 8.0), (0.0, 1.0, 0.0)))
    small = Term("small", Points((40.0, 60.0), (1.0, 0.0)))
    large = Term("large", Points((45.0, 70.0), (0.0, 1.0)))
    inputs = (
        Variable(pressure, (low, medium), "kPa", 0.0, 10.0),
        Variable("area", (small, large), "mm²", 0.0, 100.0),
    )
    is_medium, is_small = (
        Proposition(pressure, ("medium",)),
        Proposition("area", ("small",)),
    )
    rules = (
        Rule((Proposition(pressure, ("low",)),), "loose", 40),
        Rule((is_medium, is_small), firm, 31),
        Rule((is_medium, Proposition("area", ("large",))), "hard", 22),
        Rule((is_medium, is_small), "loose", 3),
    )
    return RuleBase("grip", ("loose", firm, "hard"), inputs, rules, Semantics())


def answers(pressure: str = "pressure") -> tuple[AuditAnswer, ...]:
    """Return one answer of each state, five of them findings, and rows of each rule."""
    half = coordinates({pressure: Fraction(5), "area": Fraction(50)})
    third = coordinates({pressure: Fraction(26, 3), "area": Fraction(90)})
    return (
        AuditAnswer(
            "FT101",
            "rule 4",
            "rule 4 never wins: wherever it fires rule 2 is at least as strong",
            Proved("17 levels and 96 cells"),
            is_finding=True,
            severity="error",
            rules=(4, 2),
            measures=(Measure("largest lead", 0.0, "0"),),
            places=(FileLocation("grip.yaml", 58, 5),),
            repeat="fuzzytree audit grip.yaml --select FT101",
            id="FT101-9f2c11ab",
        ),
        AuditAnswer(
            "FT101",
            "rule 3",
            "rule 3 wins somewhere",
            Witness(half, (Claim("beats", rules=(3,), rivals=(1, 2)),)),
            is_finding=False,
            rules=(3,),
            repeat="fuzzytree audit grip.yaml --select FT101",
        ),
        AuditAnswer(
            "FT201",
            "rules 2 and 3",
            "rules 2 and 3 both reach about a third",
            Bracket("the common level", 0.3, 0.4, "the budget was spent", half),
            is_finding=True,
            rules=(2, 3),
            repeat="fuzzytree audit grip.yaml --select FT201",
            id="FT201-00000001",
        ),
        AuditAnswer(
            "FT301",
            "the domain",
            f"no rule reaches 0.1 where {pressure!r} is high",
            Witness(third, (Claim("below", rules=(1, 2, 3, 4), level="1/10"),)),
            is_finding=True,
            severity="warning",
            region=(Span(pressure, 7.7, None), Span("area", 88.0, 90.5)),
            repeat="fuzzytree audit grip.yaml --select FT301",
            id="FT301-00000002",
        ),
        AuditAnswer(
            "FT403",
            pressure,
            f"'low' and 'medium' of {pressure!r} are hard to distinguish",
            Sampled("rows in both", 3, 40, 0.02, 0.2, 0.95, "the rows of the table"),
            is_finding=True,
            terms=(TermName(pressure, "low"), TermName(pressure, "medium")),
            repeat="fuzzytree audit grip.yaml --select FT403",
            id="FT403-00000003",
        ),
        AuditAnswer(
            "FT601",
            "the ONNX graph",
            "the rules were not held against their graph",
            Declined("FTD06", "no rows were given"),
            is_finding=False,
            repeat="fuzzytree audit grip.yaml --select FT601",
        ),
        *(
            AuditAnswer(
                "FT701",
                f"rule {k}",
                f"rule {k} won {7 * k} rows",
                Sampled("rows of its class", 6 * k, 7 * k, 0.5, 0.9, 0.95, "the rows"),
                is_finding=False,
                rules=(k,),
                measures=(Measure("rows fired", 19.0 * k),),
                repeat="fuzzytree audit grip.yaml --select FT701",
            )
            for k in range(1, 5)
        ),
    )


def audit_of(
    model: RuleBase, found: tuple[AuditAnswer, ...] | None = None, **fields: Any
) -> Audit:
    """Return an audit with the given answers, or with those of `answers`.

    Args:
        model: The rules.
        found: The answers.
        fields: Others of the audit.
    """
    sides = [
        DomainSide(v.name, v.low or 0.0, v.high or 1.0, "model")
        for v in model.variables
    ]
    made = Audit(
        version="0.1.0",
        model=model.name,
        form="rules",
        fingerprint=fingerprint(model),
        file=SourceFile("grip.yaml", "ab" * 32),
        data=SourceFile("grasps.csv", "cd" * 32),
        rows=40,
        policy=Policy("minimum", "strongest"),
        domain=Domain(tuple(sides)),
        settings=AuditSettings(),
        answers=answers(model.variables[0].name) if found is None else found,
        unasked=(),
        limits=LIMITS,
        is_complete=True,
    )
    made = msgspec.structs.replace(made, **fields)
    return msgspec.structs.replace(made, digest=digest_of(made))


def rows_of(model: RuleBase) -> AuditRows:
    """Return 40 rows: one outside of the domain, one missing, one without a class."""
    random = np.random.default_rng(0)
    values = random.uniform([[0.0], [0.0]], [[10.0], [100.0]], (2, 40))
    values[0, 0], values[1, 1] = 13.0, np.nan
    codes = random.integers(0, len(model.classes), 40)
    codes[2] = -1
    return AuditRows("grasps.csv", values, codes)
