"""Large models: within the budget, with bounded memory, and with all that is known."""

from __future__ import annotations

import pytest

from fuzzytree.auditing.decide.states import Witness
from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.records import Audit, AuditSettings
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.model.rulebase import RuleBase
from tests.auditing.decide.old_bases import random_base, unit_domain

BUDGET_S = 2.0
SLACK_S = 1.5  # one step at the end, on a machine that others use too

LARGE: dict[str, RuleBase] = {
    "200 x 60": random_base(1, 200, 60, kind="points", classes=5),
    "500 x 2": random_base(1, 500, 2, kind="points"),
    "500 x 2, product": random_base(1, 500, 2, "product", kind="points"),
    "5 x 1000": random_base(1, 5, 1000, kind="points"),
    "60 classes": random_base(1, 120, 6, kind="points", classes=60, shared=0.9),
}


def queries(name: str, budget: float) -> Audit:
    """Return an audit of a large model."""
    return audit(
        Material(LARGE[name]),
        domain=unit_domain(LARGE[name]),
        settings=AuditSettings(budget=budget),
    )


@pytest.mark.heavy
@pytest.mark.parametrize("name", LARGE)
def test_an_audit_of_a_large_model_keeps_its_budget(name: str) -> None:
    results = queries(name, 2.0)
    assert not results.is_complete
    assert any(": not run: " in one or ": cut short" in one for one in results.unasked)


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["500 x 2", "60 classes"])
def test_most_rules_of_a_large_model_are_seen_to_win(name: str) -> None:
    won = [one for one in queries(name, 20.0).answers if one.code == "FT101"]
    assert sum(isinstance(one.state, Witness) for one in won) > 20
