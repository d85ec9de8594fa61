"""An audit as SARIF: rules, results, fingerprints, baselines, hostile names."""

from __future__ import annotations

import json
from typing import Any

import pytest

from fuzzytree.auditing.findings.codes import CODES
from fuzzytree.report.sarif import sarif_text
from tests.report.audits import every_state


def run_of(text: str) -> Any:
    """Return the only run of a SARIF file."""
    whole = json.loads(text)
    assert whole["version"] == "2.1.0"
    (run,) = whole["runs"]
    return run


def test_each_code_is_a_rule_and_each_finding_a_result_of_its_rule() -> None:
    run = run_of(sarif_text(every_state()))
    rules = run["tool"]["driver"]["rules"]
    assert [rule["id"] for rule in rules] == [*CODES]
    assert len(run["results"]) == 3
    for result in run["results"]:
        assert rules[result["ruleIndex"]]["id"] == result["ruleId"]
    levels = [result["level"] for result in run["results"]]
    assert levels == ["error", "warning", "note"]


def test_a_result_has_its_place_its_id_and_its_state() -> None:
    first = run_of(sarif_text(every_state()))["results"][0]
    assert first["locations"] == [
        {
            "physicalLocation": {
                "artifactLocation": {"uri": "grip.yaml"},
                "region": {"startLine": 4, "startColumn": 3},
            }
        }
    ]
    assert first["partialFingerprints"] == {"fuzzytree/v1": "FT101-00000001"}
    assert first["properties"]["state"]["state"] == "PROVED"
    assert "PROVED" in first["message"]["text"]


def test_without_a_place_it_is_the_file() -> None:
    second = run_of(sarif_text(every_state()))["results"][1]
    assert second["locations"] == [
        {"physicalLocation": {"artifactLocation": {"uri": "grip.yaml"}}}
    ]


def test_a_baseline_distinguishes_new_known_and_gone() -> None:
    known = {"FT301-00000003": "a gap", "FT401-00000009": "an empty term"}
    results = run_of(sarif_text(every_state(), known))["results"]
    states = [(one["ruleId"], one["baselineState"]) for one in results]
    assert states == [
        ("FT101", "new"),
        ("FT202", "new"),
        ("FT301", "unchanged"),
        ("FT401", "absent"),
    ]
    assert results[2]["suppressions"] == [{"kind": "external", "status": "accepted"}]
    assert "baselineState" not in run_of(sarif_text(every_state()))["results"][0]


def test_what_was_not_examined_is_reported_and_the_run_did_not_succeed() -> None:
    (invocation,) = run_of(sarif_text(every_state()))["invocations"]
    assert invocation["executionSuccessful"] is False
    notes = [n["message"]["text"] for n in invocation["toolExecutionNotifications"]]
    assert notes == [*every_state().unasked]


@pytest.mark.parametrize(
    ("name", "uri"),
    [
        ("a b/c.yaml", "a%20b/c.yaml"),
        ("grün#1?.yaml", "gr%C3%BCn%231%3F.yaml"),
        ("a:b%.yaml", "a%3Ab%25.yaml"),
        ("a\nb.yaml", "a%0Ab.yaml"),
    ],
    ids=ascii,
)
def test_a_path_is_written_as_a_reference(name: str, uri: str) -> None:
    run = run_of(sarif_text(every_state(name)))
    place = run["results"][0]["locations"][0]["physicalLocation"]
    assert place["artifactLocation"]["uri"] == uri
    assert run["artifacts"][0]["location"]["uri"] == uri


def test_the_same_audit_has_the_same_bytes() -> None:
    assert sarif_text(every_state()) == sarif_text(every_state())
