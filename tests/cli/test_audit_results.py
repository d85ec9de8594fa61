"""`fuzzytree audit --results`: what other verbs found stands beside the findings."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import pytest

import fuzzytree as ft
from fuzzytree.auditing.findings.records import digest_of
from fuzzytree.auditing.findings.results import read_results
from fuzzytree.checking.stability.results import Stability, Trial
from fuzzytree.model.agreement import Agreement, Comparison
from fuzzytree.model.rulebase import fingerprint
from tests.cli.conftest import Call, grip

ROOT = Path(__file__).resolve().parents[2]
SELECTED = ("audit", "grip.yaml", "--select", "FT501")


@pytest.fixture(autouse=True)
def _results(folder: Path) -> None:
    """Write a check and a study of the tree, in which something is wrong."""
    model = fingerprint(grip())
    compared = (
        Comparison("x.onnx", "tree", "rows", 9, "DISAGREES", 2, float("inf"), 0.0),
        Comparison("native", "tree", "rows", 9, "agrees"),
    )
    criteria = (Trial("N3", cases=12).result(), Trial("N7", cases=3).result())
    agreement = Agreement("grip", model, compared, skipped=("no C compiler",))
    stability = Stability("grip", model, 40, 0, 0, ("native",), criteria)
    (folder / "check.json").write_text(agreement.to_json(), "utf-8")
    (folder / "stability.json").write_text(stability.to_json(), "utf-8")


def test_results_are_reported_in_the_text_the_json_and_on_the_page(call: Call) -> None:
    words = ("--results", "check.json", "--results", "stability.json")
    code, out, _ = call(*SELECTED, *words, "--page", "audit.html")
    assert code == 0
    assert (
        "\nresults  check.json: 1 of 2 comparisons and bounds disagrees\n"
        "results  stability.json: none of 2 criteria fails\n"
    ) in out
    page = Path("audit.html").read_text("utf-8")
    for part in (
        '<section id="agreement" ',
        '<section id="stability" ',
        '<a href="#agreement">1 of 2 comparisons and bounds disagrees</a>',
        "no C compiler",
        "the check&#x27;s file",
    ):
        assert part in page, part
    found = json.loads(call(*SELECTED, *words, "--json", "--quiet")[1])
    schema = json.loads((ROOT / "schemas" / "audit.schema.json").read_text("utf-8"))
    jsonschema.Draft202012Validator(schema).validate(found)
    said = [(r["verb"], r["parts"], r["wrong"]) for r in found["results"]]
    assert said == [("check", 2, 1), ("stability", 2, 0)]
    audit = ft.audit(
        ft.material("grip.yaml", results=["check.json"]),
        selection=ft.AuditSelection(select=["FT501"]),
    )
    assert digest_of(audit) == audit.digest


def test_a_page_without_results_has_no_place_for_them(call: Call) -> None:
    call(*SELECTED, "--page", "audit.html")
    page = Path("audit.html").read_text("utf-8")
    assert 'id="agreement"' not in page
    assert 'id="stability"' not in page


def test_what_the_verbs_print_fits_its_schema_and_is_read(call: Call) -> None:
    native = ("--runtime", "native", "--json", "--quiet")
    for name, words in (
        ("check", ("--generate", "50", *native)),
        ("stability", ("--select", "N3", *native)),
    ):
        _, out, _ = call(name, "grip.yaml", *words)
        schema = json.loads((ROOT / f"schemas/{name}.schema.json").read_text("utf-8"))
        jsonschema.Draft202012Validator(schema).validate(json.loads(out))
        Path("own.json").write_text(out, "utf-8")
        (given,) = read_results(["own.json"], grip())
        assert given.result.verb == name
        assert given.result.wrong == 0
        assert given.record.to_json() == out.removesuffix("\n")


def changed(edit: Callable[[Any], object]) -> None:
    """Edit the facts of the check."""
    facts = json.loads(Path("check.json").read_text("utf-8"))
    edit(facts)
    Path("check.json").write_text(json.dumps(facts), "utf-8")


LEAD = "check.json: is no result that `fuzzytree check` or `stability` --json wrote: "


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (
            {"fingerprint": "0" * 64},
            "check.json: is a result of another model: its fingerprint is "
            f"000000000000..., and that of 'grip' is {fingerprint(grip())[:12]}...; "
            "run `fuzzytree check` again",
        ),
        (
            {"version": "0.0.1"},
            "check.json: is a result of fuzzytree 0.0.1, and this is "
            f"{ft.__version__}; run it again",
        ),
        (
            {"format": "fuzzytree-audit/1"},
            f"{LEAD}its format is none of fuzzytree-check/1, fuzzytree-stability/1",
        ),
        (
            {"format": ["fuzzytree-check/1"]},
            f"{LEAD}its format is none of fuzzytree-check/1, fuzzytree-stability/1",
        ),
        (
            {"comparisons": 3},
            f"{LEAD}Expected 'array', got 'int' - at '$.comparisons'",
        ),
        ({"ok": True}, f"{LEAD}what it says does not fit together"),
        ({"more": True}, f"{LEAD}what it says does not fit together"),
    ],
    ids=lambda one: " ".join(one) if isinstance(one, dict) else "",
)
def test_a_result_of_something_else_is_one_sentence(
    call: Call, edit: dict[str, object], message: str
) -> None:
    changed(lambda facts: facts.update(edit))
    assert call(*SELECTED, "--results", "check.json") == (2, "", f"{message}\n")


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "Input data was truncated"),
        (b"[]", "Expected 'object', got 'array'"),
        (b"\xff", "JSON is malformed: invalid character (byte 0)"),
        (b'{"a":' * 100_000, "maximum recursion depth exceeded while deserializing"),
    ],
    ids=["empty", "a list", "bytes", "deep"],
)
def test_a_damaged_result_is_one_sentence(call: Call, content: bytes, why: str) -> None:
    Path("check.json").write_bytes(content)
    code, out, err = call(*SELECTED, "--results", "check.json")
    assert (code, out) == (2, "")
    assert err.startswith(f"{LEAD}{why}")
    assert err.count("\n") == 1


def test_two_results_of_one_verb_are_one_too_many(call: Call) -> None:
    words = ("--results", "check.json", "--results", "./check.json")
    assert call(*SELECTED, *words) == (
        2,
        "",
        "./check.json: is a result of check, and so is check.json; give one of them\n",
    )


def test_a_page_does_not_overwrite_a_result(call: Call) -> None:
    words = ("--results", "check.json", "--page", "check.json")
    message = "check.json: cannot be written: it is read as well\n"
    assert call(*SELECTED, *words) == (2, "", message)
