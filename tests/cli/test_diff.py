"""`fuzzytree diff` reports changes, and exits with 1 if a decision changes."""

from __future__ import annotations

import json
import os
import threading
from pathlib import Path

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.model.rulebase import Rule
from tests.cli.conftest import Call, grip

SCHEMA = Path(__file__).resolve().parents[2] / "schemas" / "diff.schema.json"


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    rules = ft.rules_from_tree(grip())
    ft.save(replace(rules, rules=rules.rules[::-1], name="turned"), "turned.yaml")
    changed = replace(rules.rules[0], then="loose")
    ft.save(replace(rules, rules=(changed, *rules.rules[1:])), "changed.yaml")


def test_a_tree_and_its_rules_are_proved_equal(call: Call) -> None:
    code, out, err = call("diff", "grip.yaml", "rules.yaml", "--verbose")
    assert code == 0, out
    assert out.splitlines() == [
        "decisions are proved equal, and nothing else has changed",
        "old      grip.yaml: tree 'grip'",
        "new      rules.yaml: rules 'grip'",
        "domain   force 0 to 5, slip -2.5 to 3.5",
        "decisions",
        "  PROVED   both models decide alike",
        "           both take the same curves of the same inputs in the same rules, "
        "on any input",
    ]
    assert err == ""


def test_rules_in_another_order_are_reported_and_break_nothing(call: Call) -> None:
    code, out, _ = call("diff", "rules.yaml", "turned.yaml", "--verbose")
    assert code == 0, out
    assert "  PROVED   both models decide alike everywhere on the domain" in out
    assert "2 rules stand at another place among the others" in out
    assert "               rules.yaml:" in out
    said = "decisions are proved equal; 2 changes: 1 non-breaking, 1 cosmetic"
    assert out.splitlines()[0] == said


def test_a_changed_class_is_shown_with_a_witness_and_its_box(call: Call) -> None:
    code, out, _ = call("diff", "rules.yaml", "changed.yaml", "--data", "grasps.csv")
    assert code == 1
    assert "rows     4 of grasps.csv" in out
    assert (
        "  WITNESS  row 1: the old model answers 'soft' by rule 1, the new one 'loose' "
        "by rule 1\n"
        "           at force = 1.5, slip = 0.0\n"
        "           everywhere in the box of force 0 to 2\n"
    ) in out
    assert "  SAMPLED  1 of 4 rows of grasps.csv are classified differently" in out
    assert (
        "  breaking     rule 1 has changed: its class is 'loose', and was 'soft'" in out
    )
    assert out.startswith("decisions have changed; 1 change: 1 breaking\n")


def test_json_fits_its_schema_and_is_the_same_each_time(call: Call) -> None:
    words = ("diff", "rules.yaml", "changed.yaml", "--json", "--quiet")
    code, out, _ = call(*words)
    facts = json.loads(out)
    assert code == 1
    assert (facts["ok"], facts["verdict"]) == (False, "changed")
    assert facts["changes"][0]["grade"] == "breaking"
    jsonschema.validate(facts, json.loads(SCHEMA.read_text("utf-8")))
    assert call(*words)[1] == out


def test_quiet_says_nothing_of_equal_models_and_the_verdict_of_others(
    call: Call,
) -> None:
    words = ("--json", "--quiet")
    assert call("diff", "grip.yaml", "grip.yaml", *words)[2] == ""
    code, _, err = call("diff", "rules.yaml", "changed.yaml", *words)
    assert (code, err) == (1, "decisions have changed; 1 change: 1 breaking\n")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nothing.yaml",), "nothing.yaml: cannot be read: no such file or directory"),
        (
            ("grip.yaml", "--limits", "force=5:1"),
            "the limits of 'force' are swapped: 5.0 to 1.0; the smaller one stands "
            "first",
        ),
        (
            ("grip.yaml", "--limits", "force"),
            "--limits force: must be NAME=LOW:HIGH, or NAME=CATEGORY,...",
        ),
        (
            ("grip.yaml", "--budget", "0"),
            "the budget must be above 0 million steps, not 0.0",
        ),
        (
            ("grip.yaml", "--data", "nothing.csv"),
            "nothing.csv: cannot be read: no such file or directory",
        ),
    ],
)
def test_what_cannot_run_is_said_in_one_sentence(
    call: Call, words: tuple[str, ...], said: str
) -> None:
    code, out, err = call("diff", "grip.yaml", *words)
    assert (code, out) == (2, "")
    assert err.splitlines()[0] == said


def test_damaged_and_foreign_files_are_refused(call: Call) -> None:
    Path("bad.yaml").write_bytes(b"kind: tree\nname: [")
    code, out, err = call("diff", "grip.yaml", "bad.yaml")
    assert (code, out) == (2, "")
    assert err.startswith("bad.yaml:3:1: not YAML: ")
    other = replace(ft.rules_from_tree(grip()), variables=(), rules=(Rule((), "firm"),))
    slip = replace(grip().variables[1], name="wind")
    ft.save(replace(other, variables=(slip,), columns=()), "other.yaml")
    code, _, err = call("diff", "grip.yaml", "other.yaml")
    assert code == 2
    assert err == (
        "other.yaml: has no input in common with grip.yaml: it uses 'wind', and that "
        "uses 'force', 'slip'\n"
    )


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_rows_may_come_from_a_pipe(call: Call) -> None:
    os.mkfifo("pipe.csv")
    content = Path("grasps.csv").read_bytes()
    feed = Path("pipe.csv").write_bytes
    threading.Thread(target=feed, args=(content,), daemon=True).start()
    code, out, _ = call("diff", "grip.yaml", "rules.yaml", "--data", "pipe.csv")
    assert code == 0
    assert "rows     4 of pipe.csv" in out


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="there is no such device")
@pytest.mark.parametrize("verb", ["audit", "diff"])
def test_a_device_is_refused_before_any_of_it_is_read(verb: str, call: Call) -> None:
    Path("endless.csv").symlink_to("/dev/zero")
    models = ("grip.yaml", "rules.yaml")[: 1 if verb == "audit" else 2]
    code, out, err = call(verb, *models, "--data", "endless.csv")
    assert (code, out) == (2, "")
    assert err == "endless.csv: cannot be read: it is neither a file nor a pipe\n"
