"""Real audits, and the files that they are of."""

from __future__ import annotations

import functools
from typing import Any

import msgspec

from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.locations import model_file
from fuzzytree.auditing.findings.records import AuditSelection
from fuzzytree.auditing.findings.subject import AuditRows, Material
from fuzzytree.exporters import yaml
from fuzzytree.model.rulebase import Points, Proposition, Rule, RuleBase, Term, Variable
from fuzzytree.model.tree import FuzzyTree


def grip() -> RuleBase:
    """Return rules with a duplicate proposition, a subsumed rule and conflicts."""
    up = Points((0.0, 4.0), (0.0, 1.0))
    down = Points((0.0, 4.0), (1.0, 0.0))
    middle = Points((1.0, 2.0, 3.0), (0.0, 1.0, 0.0))
    terms = (Term("low", down), Term("mid", middle), Term("high", up))

    def rule(then: str, *asked: tuple[str, str]) -> Rule:
        return Rule(tuple(Proposition(name, (term,)) for name, term in asked), then)

    return RuleBase(
        "grip",
        ("soft", "firm"),
        tuple(Variable(name, terms, "N", 0.0, 4.0) for name in ("force", "slip")),
        (
            rule("soft", ("force", "low"), ("slip", "low")),
            rule("firm", ("force", "high"), ("slip", "high")),
            rule("soft", ("force", "mid"), ("slip", "mid")),
            rule("firm", ("force", "high"), ("slip", "high"), ("slip", "mid")),
        ),
    )


def audited(
    model: RuleBase | FuzzyTree, *, rows: AuditRows | None = None, **options: Any
) -> tuple[bytes, bytes]:
    """Return an audit and the file that it is of."""
    content = yaml.write(model).content
    file = model_file("grip.yaml", content)
    repeat = "fuzzytree audit grip.yaml"
    wanted = AuditSelection(
        select=options.pop("select", ()), skip=options.pop("skip", ["FT6"])
    )
    material = Material(model, file, rows, options.pop("data", None))
    found = audit(material, selection=wanted, repeat=repeat, **options)
    return msgspec.json.encode(found), content


@functools.cache
def small() -> tuple[bytes, bytes]:
    """Return the audit of a small rule base."""
    return audited(grip())
