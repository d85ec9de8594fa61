from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import fuzzytree as ft
from fuzzytree.rechecking.sentences import LIMITS
from tests.auditing.diff.test_numbers import tipper

CODES = ("--select", "FT1,FT301,FT404")

pytestmark = pytest.mark.usefixtures("folder")

Call = Callable[..., tuple[int, str, str]]


@pytest.fixture
def audit(call: Call) -> dict[str, object]:
    """Write the audit of the tree as audit.json, and return its facts."""
    _, out, _ = call("audit", "grip.yaml", "--select", "FT205,FT404", "--json")
    Path("audit.json").write_text(out, "utf-8")
    facts: dict[str, object] = json.loads(out)
    return facts


def test_an_audit_that_is_right_is_reported_with_what_was_checked(
    call: Call, audit: dict[str, object]
) -> None:
    code, out, err = call("recheck", "audit.json", "grip.yaml")
    assert (code, err) == (0, "")
    verdict, *counts, nothing = out.splitlines()
    lines = [re.split("  +", re.sub(r" z3 .*?  ", " z3  ", line)) for line in counts]
    assert lines == [
        ["answers PROVED, read and evaluated again", "1"],
        ["answers with a WITNESS, evaluated again", "3"],
        ["bounds of other answers, confirmed by z3", "3"],
    ]
    assert nothing.startswith(
        "read, and compared with nothing: the version, the hash of "
    )
    assert verdict == "the audit is right as far as it was checked again"


def test_an_audit_whose_panel_was_cut_fails(
    call: Call, audit: dict[str, object]
) -> None:
    Path("audit.json").write_text(json.dumps(audit | {"limits": LIMITS[1:]}), "utf-8")
    code, out, _ = call("recheck", "audit.json", "grip.yaml")
    assert code == 1
    lines = out.splitlines()
    assert lines[0] == "2 points are wrong"
    assert lines[1].startswith("WRONG: the digest is ")
    assert lines[2] == "WRONG: the panel of limits is not the fixed one"


def test_a_file_that_is_no_audit_is_one_sentence(call: Call) -> None:
    code, out, err = call("recheck", "grip.yaml", "grip.yaml")
    assert (code, out) == (2, "")
    assert err == "grip.yaml: not JSON: Expecting value: line 1 column 1 (char 0)\n"


def test_a_file_that_is_not_there_is_one_sentence(call: Call) -> None:
    code, out, err = call("recheck", "none.json", "grip.yaml")
    assert (code, out, err) == (2, "", "none.json: No such file or directory\n")


def test_a_solver_that_is_missing_is_one_sentence(
    call: Call, audit: dict[str, object]
) -> None:
    code, out, err = call("recheck", "audit.json", "grip.yaml", "--solver", "no/such")
    assert (code, out, err) == (2, "", "no/such: no such program\n")


def test_what_is_proved_is_written_for_solvers(call: Call) -> None:
    assert call("export", "grip.yaml", "-o", "grip.smt2")[0] == 0
    call("audit", "rules.yaml", "--smt", "claims.smt2", "--select", "FT201,FT301")
    model, claims = (Path(f"{n}.smt2").read_text("utf-8") for n in ("grip", "claims"))
    assert "(define-fun |rule 1| () Real ; if " in model
    assert claims.count("(check-sat)") > 0


def test_the_module_is_the_same_program(call: Call, audit: dict[str, object]) -> None:
    ran = subprocess.run(
        [sys.executable, "-m", "fuzzytree.rechecking", "audit.json", "grip.yaml"],
        capture_output=True,
        text=True,
        check=False,
    )
    code, out, err = call("recheck", "audit.json", "grip.yaml")
    assert (ran.returncode, ran.stdout, ran.stderr) == (code, out, err)


RIGHT = "the audit is right as far as it was checked again"


def remark(name: str) -> str:
    text = "was read by fuzzytree itself, whose YAML of it was checked"
    return f"{name} {text}; lines and columns were compared with nothing"


@pytest.mark.parametrize("form", ["fis", "fcl", "fll", "fml"])
def test_an_audit_of_another_format_is_checked_as_its_yaml(
    call: Call, form: str
) -> None:
    name = f"tip it.{form}"
    ft.save(tipper(), name, allow_loss=True)
    out = call("audit", name, *CODES, "--json")[1]
    assert '"line":' in out
    Path("audit.json").write_text(out)
    code, out, err = call("recheck", "audit.json", name)
    lines = out.splitlines()
    assert (code, err, lines[0], lines[-1]) == (0, "", RIGHT, remark(name))
    assert any("confirmed by z3" in line for line in lines)


def test_edits_of_an_audit_and_a_file_that_is_no_yaml_are_noticed(call: Call) -> None:
    ft.save(tipper(), "tip.fll", allow_loss=True)
    out = call("audit", "tip.fll", *CODES, "--json")[1]
    Path("audit.json").write_text(out.replace('"level": 0.5', '"level": 0.25'))
    code, out, _ = call("recheck", "audit.json", "tip.fll")
    assert code == 1
    assert out.splitlines()[1].startswith("WRONG: the digest is ")
    call("audit", "tip.fll", *CODES, "--json", "-o", "audit.json")
    Path("tip.fll").write_text(Path("tip.fll").read_text() + "\n")
    code, out, _ = call("recheck", "audit.json", "tip.fll")
    assert code == 1
    assert out.splitlines()[1].startswith("WRONG: the SHA-256 of tip.fll is ")


def test_a_file_of_another_model_than_the_audited_is_refused(call: Call) -> None:
    ft.save(tipper(), "tip.fll", allow_loss=True)
    Path("audit.json").write_text(call("audit", "grip.yaml", *CODES, "--json")[1])
    code, out, err = call("recheck", "audit.json", "tip.fll")
    sentence = "tip.fll: not the audited model, or read by another --from\n"
    assert (code, out, err) == (2, "", sentence)


def test_yaml_that_the_re_checker_does_not_read_is_checked_as_we_write_it(
    call: Call,
) -> None:
    text = Path("grip.yaml").read_text("utf-8")
    name = re.search(r"^name: (.*)$", text, re.MULTILINE)
    assert name is not None
    folded = text.replace(name[0], f"name: >-\n  {name[1]}")
    Path("folded.yaml").write_text(folded, "utf-8")
    call("audit", "folded.yaml", *CODES, "--json", "-o", "audit.json")
    code, out, _ = call("recheck", "audit.json", "folded.yaml")
    lines = out.splitlines()
    assert (code, lines[0], lines[-1]) == (0, RIGHT, remark("folded.yaml"))
