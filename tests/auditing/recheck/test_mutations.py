"""Audits of planted defects hold, and edits of such a finding are reported.

What is written in words alone, the sentence, is not decided again: its edit is reported
by the digest only. A finding of a code that is not decided again may be edited to be a
proof; then the report says of it that it is open.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from typing import Any

import pytest

from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.findings.records import SourceFile
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.auditing.recheck import CannotRunError, recheck
from fuzzytree.auditing.recheck.head import digest_of
from fuzzytree.model import FuzzySystem
from fuzzytree.model.tree import FuzzyTree
from tests.auditing.findings.test_mutations import PLANTED, ROWS, Planted
from tests.auditing.recheck.audits import audited

Facts = dict[str, Any]


def reported(facts: Facts, content: bytes, *, is_same: bool = False) -> bool:
    """Return whether the re-checker reports an edit, by default with a new digest."""
    if not is_same:
        facts["digest"] = digest_of(facts)
    text = json.dumps(facts, ensure_ascii=False).encode()
    try:
        return bool(recheck(text, content, ("audit.json", "grip.yaml")).wrong)
    except CannotRunError:
        return True


def is_open(facts: Facts, content: bytes, code: str) -> bool:
    """Return whether proofs of a code are among what is not decided again."""
    text = json.dumps(facts, ensure_ascii=False).encode()
    undecided = recheck(text, content, ("audit.json", "grip.yaml")).undecided
    return any(
        state == "PROVED" and code in codes for (state, _), codes in undecided.items()
    )


def audit_of(planted: Planted) -> tuple[Facts, bytes]:
    """Return the facts of an audit of a planted defect, and the model's file."""
    model = planted.model
    assert not isinstance(model, FuzzySystem)  # these have tests of their own
    options: Facts = {"select": [planted.code]}
    if isinstance(model, FuzzyTree):
        sides = tuple(DomainSide(name, 0.0, 1.0) for name in model.inputs)
        options["domain"] = Domain(sides)
    if planted.code == "FT701":
        options["rows"] = AuditRows("rows.csv", ROWS.T)
        options["data"] = SourceFile("rows.csv", 64 * "0")
    text, content = audited(model, ignore=["FT6"], **options)
    return json.loads(text), content


def edits(finding: Facts) -> Iterator[tuple[str, Facts]]:
    """Yield what is edited of a finding, and the finding that it becomes."""

    def edited(**changes: Any) -> Facts:
        return copy.deepcopy(finding) | changes

    state = finding["state"]
    other: Facts = {"state": "PROVED", "how": "all cells visited"}
    if state["state"] == "PROVED":
        other = {"state": "WITNESS", "point": [], "claims": []}
    yield "state", edited(state=other)
    if finding["rules"]:
        yield "rules", edited(rules=[finding["rules"][0] % 2 + 1])
    if state.get("point"):
        first, *rest = copy.deepcopy(state["point"])
        moved = {"exact": "8", "decimal": "8.0", "hex": (8.0).hex()}  # outside
        yield "point", edited(state=state | {"point": [first | moved, *rest]})
    if state.get("region"):
        first, *rest = copy.deepcopy(state["region"])
        wide = [first | {"low": -1e3, "high": 1e3}, *rest]
        yield "region", edited(state=state | {"region": wide}, region=wide)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("planted", PLANTED, ids=lambda one: one.code)
def test_a_planted_defect_passes_and_each_edit_of_it_is_reported(
    planted: Planted,
) -> None:
    facts, content = audit_of(planted)
    assert not reported(copy.deepcopy(facts), content)
    found = [n for n, one in enumerate(facts["answers"]) if one["is_finding"]]
    finding = facts["answers"][found[0]]
    for name, other in edits(finding):
        changed = copy.deepcopy(facts)
        changed["answers"][found[0]] = other
        is_reported = reported(changed, content)
        assert is_reported or (
            name == "state" and is_open(changed, content, planted.code)
        )
    finding["sentence"] = "all is well"
    assert reported(facts, content, is_same=True)
    panel = audit_of(planted)[0]
    del panel["limits"][0]
    assert reported(panel, content)
