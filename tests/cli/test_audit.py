"""`fuzzytree audit` in every form of output, with every option, and its exit codes."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import msgspec
import pytest

import fuzzytree as ft
from fuzzytree.auditing.findings.records import LIMITS, Audit, digest_of
from fuzzytree.model.rulebase import Band, Proposition, Rule, RuleBase, Term, Variable
from fuzzytree.testing import random_tree
from tests.cli.conftest import Call, grip

ROOT = Path(__file__).resolve().parents[2]
FAR = ("--limits", "force=3:5", "--select", "FT101")
"""Where the first leaf of the grip tree is never reached."""


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    pass


def facts(call: Call, *words: str) -> Any:
    """Return the facts that --json prints."""
    _, out, _ = call("audit", "grip.yaml", "--json", "--quiet", *words)
    return json.loads(out)


def test_a_finding_is_reported_at_its_place_and_fails(call: Call) -> None:
    code, out, err = call("audit", "grip.yaml", *FAR, "--verbose")
    assert code == 1
    lines = out.splitlines()
    first = next(line for line in lines if "FT101 error:" in line)
    assert first.startswith("grip.yaml:")
    assert any(line.startswith("  PROVED ") for line in lines)
    assert (
        "  again    fuzzytree audit grip.yaml --limits force=3:5 --select FT101" in out
    )
    assert lines[0] == (
        "1 finding: 1 error; 2 PROVED, 2 confirmed by z3; `fuzzytree "
        "explain FT101` explains the gravest"
    )
    assert err == (
        "limits   'slip' declares no range; audited from -2.5 to 3.5, where its "
        "curves change; --limits NAME=LOW:HIGH sets it\n"
    )


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_the_line_of_a_finding_is_shown_in_other_formats_too(
    call: Call, end: str
) -> None:
    lines = [
        *("Engine: tip", "InputVariable: food", "  range: 0 10"),
        *("  term: good Ramp 5 10", "  term: odd Ramp 20 30"),
        *("OutputVariable: tip", "  defuzzifier: WeightedAverage TakagiSugeno"),
        *("  default: 0", "  term: much Constant 25", "RuleBlock: all"),
        *("  activation: General", "  rule: if food is good then tip is much"),
    ]
    Path("tip.fll").write_bytes(end.join(lines).encode())
    _, out, _ = call("audit", "tip.fll", "--select", "FT401", "--verbose")
    assert "tip.fll:5:9: FT401 error: " in out
    assert "  5 |   term: odd Ramp 20 30\n    |         ^" in out


def test_an_input_on_which_nothing_depends_may_be_any_number(call: Call) -> None:
    high = Term("high", Band(low=2.0))
    inputs = (Variable("free"), Variable("force", (high,), low=0.0, high=5.0))
    rule = Rule((Proposition("force", ("high",)),), "firm")
    ft.save(RuleBase("one", ("firm",), inputs, (rule,)), "one.yaml")
    words = ("--select", "FT204", "--row", "free=57,force=4")
    code, out, err = call("audit", "one.yaml", *words, "--verbose")
    assert code == 0
    assert "\n  free   0 to 57  any number: nothing depends on it\n" in out
    assert err.startswith(
        "limits   'free': no range is known, and nothing depends on it; "
        "any number will do\n"
    )


def test_nothing_found_is_exit_0(call: Call) -> None:
    code, out, _ = call("audit", "grip.yaml", "--select", "FT101")
    assert code == 0
    assert out.startswith("nothing found; ")


def test_what_is_no_finding_is_counted_and_listed_one_by_one_by_all(call: Call) -> None:
    _, out, _ = call("audit", "grip.yaml", "--select", "FT101", "--verbose")
    assert "; --all lists each\n" in out
    assert "answers that are no findings" not in out
    _, out, _ = call("audit", "grip.yaml", "--select", "FT101", "--all")
    assert "answers that are no findings\n  FT101 " in out
    assert "--all" not in out


def test_the_row_that_was_given_is_answered_without_being_a_finding(call: Call) -> None:
    words = ("--row", "force=1,slip=0.1", "--select", "FT204", "--quiet")
    _, out, _ = call("audit", "grip.yaml", *words)
    _, mark, said = out.partition("the row of --row\n  FT204 WITNESS  ")
    assert mark
    assert said.startswith("the row is decided as '")
    assert "\n  FT204 " in said.partition("\n\n")[0]


def test_quiet_says_nothing_unless_something_fails(call: Call) -> None:
    assert call("audit", "grip.yaml", "--select", "FT101", "--quiet")[2] == ""
    words = ("--output-format", "github", "--quiet", *FAR)
    assert call("audit", "grip.yaml", *words)[2].startswith("1 finding: ")


@pytest.mark.parametrize(
    ("least", "code"), [("error", 1), ("warning", 1), ("info", 1), ("never", 0)]
)
def test_the_severity_that_fails_is_chosen(call: Call, least: str, code: int) -> None:
    assert call("audit", "grip.yaml", "--fail-on", least, *FAR)[0] == code


def test_json_fits_its_schema_and_has_the_panel_and_its_digest(call: Call) -> None:
    found = facts(call, *FAR)
    schema = json.loads((ROOT / "schemas" / "audit.schema.json").read_text("utf-8"))
    jsonschema.Draft202012Validator(schema).validate(found)
    assert found["limits"] == [*LIMITS]
    audit = msgspec.convert(found, Audit)
    assert digest_of(audit) == audit.digest
    assert len(audit.findings) == 1


def test_github_gets_annotations_and_nothing_where_nothing_is_found(call: Call) -> None:
    words = ("--output-format", "github", "--quiet")
    out = call("audit", "grip.yaml", *words, *FAR)[1]
    assert out.startswith("::error file=grip.yaml,line=")
    assert out.count("\n") == 1
    assert call("audit", "grip.yaml", "--select", "FT101", *words)[1] == ""


def test_sarif_goes_to_a_file(call: Call) -> None:
    words = ("--output-format", "sarif", "--output", "out.sarif")
    code, out, err = call("audit", "grip.yaml", *words, *FAR)
    assert (code, out) == (1, "")
    assert "wrote    out.sarif\n" in err
    results = json.loads(Path("out.sarif").read_text("utf-8"))["runs"][0]["results"]
    assert [one["ruleId"] for one in results] == ["FT101"]


def test_a_page_is_written_beside(call: Call) -> None:
    words = ("--page", "audit.html", "--data", "grasps.csv", "--target", "grip")
    assert call("audit", "grip.yaml", *words, *FAR)[0] == 1
    text = Path("audit.html").read_text("utf-8")
    assert text.startswith("<!doctype html>")
    assert "FT101" in text


def test_a_baseline_accepts_its_findings_and_reports_what_is_gone(call: Call) -> None:
    assert call("audit", "grip.yaml", "--write-baseline", "known.json", *FAR)[0] == 0
    words = ("--baseline", "known.json", "--verbose")
    code, out, _ = call("audit", "grip.yaml", *words, *FAR)
    assert code == 0
    assert "1 accepted finding of the baseline" in out
    assert out.startswith(
        "nothing found beside 1 accepted; 2 questions answered; 2 PROVED, 2 "
    )
    selected = ("--baseline", "known.json", "--select", "FT101")
    code, out, err = call("audit", "grip.yaml", *selected)
    assert code == 0
    (name,) = json.loads(Path("known.json").read_text("utf-8"))["accepted"]
    assert f"gone     {name} leaf 1 (rule 1) is never reached" in err
    assert "nothing found; 1 accepted finding no longer found, which " in out


def test_a_configuration_here_is_read_and_the_command_line_goes_before_it(
    call: Call,
) -> None:
    text = (
        "select: [FT101]\nlimits: [{variable: force, from: 3, to: 5}]\nfail-on: never\n"
    )
    Path("fuzzytree-audit.yaml").write_text(text, "utf-8")
    code, out, err = call("audit", "grip.yaml")
    assert code == 0
    assert err.startswith("read     fuzzytree-audit.yaml\n")
    assert "FT101 error:" in out
    assert call("audit", "grip.yaml", "--fail-on", "error")[0] == 1
    assert call("audit", "grip.yaml", "--limits", "force=0:5")[0] == 0
    Path("other.yaml").write_text("select: [FT501]\n", "utf-8")
    found = facts(call, "--config", "other.yaml")
    assert {one["code"] for one in found["answers"]} <= {"FT501"}


def test_the_command_of_an_answer_has_the_options_that_matter(call: Call) -> None:
    options = (
        *("--data", "grasps.csv", "--target", "grip", "--within", "data"),
        *("--budget", "30", "--setting", "epsilon=0.2"),
    )
    found = facts(call, *options, "--select", "FT101")
    words = found["answers"][0]["repeat"].split()
    assert words[:3] == ["fuzzytree", "audit", "grip.yaml"]
    assert words[-2:] == ["--select", "FT101"]
    assert {*options} <= {*words}
    again = facts(call, *words[3:])
    assert again["answers"] == [o for o in found["answers"] if o["code"] == "FT101"]


def test_rows_come_from_standard_input_too(call: Call) -> None:
    content = Path("grasps.csv").read_bytes()
    words = ("--data", "-", "--json", "--select", "FT205")
    _, out, _ = call("audit", "grip.yaml", *words, stdin=content)
    assert json.loads(out)["rows"] == 4
    assert json.loads(out)["data"]["name"] == "standard input"


def test_a_point_is_a_domain(call: Call) -> None:
    found = facts(call, "--limits", "force=3:3", "--limits", "slip=0:0", *FAR[2:])
    assert sorted(one["rules"][0] for one in found["answers"] if one["is_finding"]) == [
        1,
        3,
    ]


HELP = "\n  fuzzytree audit --help lists the options\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("--limits", "force=5:3"),
            "the limits of 'force' are swapped: 5.0 to 3.0; the smaller one stands "
            f"first{HELP}",
        ),
        (
            ("--limits", "force=0:inf"),
            f"the limits of 'force' must be finite, not 0.0 to inf{HELP}",
        ),
        (
            ("--limits", "frce=0:1"),
            "limits for 'frce', which is no variable; there is force, slip (did you "
            f"mean 'force'?){HELP}",
        ),
        (
            ("--limits", "force"),
            f"--limits force: must be NAME=LOW:HIGH, or NAME=CATEGORY,...{HELP}",
        ),
        (("--limits", "force=a:1"), f"'force' cannot be 'a'; it is a number{HELP}"),
        (
            ("--limits", "force=0:1", "--limits", "force=0:2"),
            f"--limits force=0:2: 'force' has limits already{HELP}",
        ),
        (
            ("--budget", "0"),
            f"budget must be above 0 and at most 1e9 million steps, not 0.0{HELP}",
        ),
        (
            ("--setting", "epsiln=1"),
            "no setting 'epsiln'; there is epsilon, margin, lead, level, overlap, "
            f"rows, seed (did you mean 'epsilon'?){HELP}",
        ),
        (("--within", "data"), f"limits from data need rows (--data TABLE){HELP}"),
        (
            ("--target", "grip"),
            f"--target names a column of a table; give it with --data{HELP}",
        ),
        (
            ("--data", "grasps.csv", "--target", "gripp"),
            "grasps.csv has no column 'gripp'; there is slip, force, note, grip (did "
            "you mean 'grip'?)\n",
        ),
        (
            ("--data", "few.csv"),
            "few.csv has no column 'slip', which the model needs; it has force\n",
        ),
        (
            ("--data", "none.csv"),
            "none.csv: cannot be read: no such file or directory\n",
        ),
        (("--row", "force"), f"--row force: must be NAME=VALUE,NAME=VALUE,...{HELP}"),
        (("--row", "force=1"), f"the row has no value of 'slip'{HELP}"),
        (
            ("--config", "none.yaml"),
            "none.yaml: cannot be read: no such file or directory\n",
        ),
        (
            ("--baseline", "few.csv"),
            "few.csv: is no baseline that --write-baseline wrote: JSON is malformed: "
            "invalid character (byte 5)\n",
        ),
        (
            ("--page", "few.csv/x.html"),
            "few.csv/x.html: cannot be written: 'few.csv' is not a folder\n",
        ),
    ],
    ids=lambda found: " ".join(found) if isinstance(found, tuple) else "",
)
def test_a_mistake_is_one_sentence_and_exit_2(
    call: Call, words: tuple[str, ...], message: str
) -> None:
    Path("few.csv").write_text("force\n1\n", "utf-8")
    assert call("audit", "grip.yaml", *words) == (2, "", message)


def test_a_file_that_only_others_read_is_one_sentence(call: Call) -> None:
    code, out, err = call("audit", "grip.onnx")
    assert (code, out) == (2, "")
    assert err.startswith("grip.onnx: a file in the format onnx is not read back")


def test_a_file_of_another_format_has_no_lines(call: Call) -> None:
    rules = ft.rules_from_tree(grip())
    ft.save(rules, "grip.fll", allow_loss=True)
    words = ("--select", "FT4", "--json", "--quiet", "--fail-on", "never")
    code, out, _ = call("audit", "grip.fll", *words)
    assert code == 0
    assert all(not one["places"] for one in json.loads(out)["answers"])


def test_a_ctrl_c_keeps_what_is_answered_and_reports_the_rest() -> None:
    said: list[str] = []

    def interrupt(text: str, _: float) -> None:
        said.append(text)
        if len(said) == 3:
            signal.raise_signal(signal.SIGINT)

    found = ft.audit(
        "grip.yaml",
        progress=interrupt,
        domain=ft.AuditDomain(limits={"force": (3.0, 5.0)}),
    )
    assert found.was_interrupted
    assert not found.is_complete
    assert any(text.endswith(": not run: interrupted") for text in found.unasked)
    codes = {one.code for one in found.answers}
    assert codes
    assert codes < {one.code for one in ft.audit("grip.yaml").answers}


@pytest.mark.heavy
def test_a_ctrl_c_at_a_terminal_prints_what_is_known_and_exits_with_130() -> None:
    ft.save(random_tree(9, leaves=60), "large.yaml")
    master, slave = pty.openpty()
    words = [sys.executable, "-m", "fuzzytree", "audit", "large.yaml", "--json"]
    with subprocess.Popen(
        [*words, "--budget", "500"], stdout=subprocess.PIPE, stderr=slave
    ) as run:
        os.close(slave)
        assert os.read(master, 4096)  # the bar: half a second has gone by
        run.send_signal(signal.SIGINT)
        assert run.stdout is not None
        found = msgspec.json.decode(run.stdout.read(), type=Audit)
    os.close(master)
    assert run.returncode == 130
    assert found.was_interrupted
    assert digest_of(found) == found.digest
