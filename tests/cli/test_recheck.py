from __future__ import annotations

import json
import re
import shlex
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


@pytest.mark.parametrize("form", ["fis", "fcl", "fll", "fml"])
def test_an_audit_of_another_format_is_refused_with_steps_that_work(
    call: Call, form: str
) -> None:
    name = f"tip it.{form}"
    ft.save(tipper(), name, allow_loss=True)
    Path("audit.json").write_text(call("audit", name, *CODES, "--json")[1])
    code, out, err = call("recheck", "audit.json", name)
    step = f"fuzzytree convert '{name}' 'tip it.yaml'"
    assert (code, out) == (2, "")
    assert err.splitlines()[0] == (
        f"{name}: only YAML is checked again; convert it, and audit and check "
        f"'tip it.yaml': {step}"
    )
    assert call(*shlex.split(step)[1:])[0] == 0
    audited = call("audit", "tip it.yaml", *CODES, "--json")[1]
    Path("audit.json").write_text(audited)
    code, out, _ = call("recheck", "audit.json", "tip it.yaml")
    assert (code, out.splitlines()[0]) == (
        0,
        "the audit is right as far as it was checked again",
    )
