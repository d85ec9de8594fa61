"""`fuzzytree stability` reports each check, and exits with 1 if one fails."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import fuzzytree as ft
from fuzzytree.model.rulebase import LR, Side, Term
from tests.checking.stability.defects import mamdani, one_rule
from tests.cli.conftest import Call

NATIVE = ("--runtime", "native", "--runtime", "native float32")


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    pass


@pytest.mark.heavy
def test_a_sound_model_holds(call: Call) -> None:
    words = ("stability", "grip.yaml", "--data", "grasps.csv", "--verbose")
    code, out, err = call(*words, *NATIVE)
    assert code == 0, out
    first, second = out.splitlines()[:2]
    said = "grip: 8 of 10 stability checks pass, none fails ("
    assert first.startswith(said)
    assert first.endswith(" generated rows, 4 rows of data; 2 runtimes)")
    assert second == "runtimes: native, native float32"
    assert "FAILS" not in out
    assert err == ""


def test_a_bulging_curve_fails(call: Call) -> None:
    bulge = LR(0.0, Side(1.0, (1.0,)), Side(1.0, (0.0, 1.5)))
    ft.save(one_rule(Term("odd", bulge)), "odd.yaml")
    code, out, err = call("stability", "odd.yaml", "--select", "N7", *NATIVE)
    assert code == 1
    assert out.splitlines()[-1].startswith("what to do: N7: learn with fewer points")
    assert "rules: a odd (right): the polynomial leaves [0, 1] by" in out
    assert out.startswith("one: 1 of 1 stability check fails: N7 (")
    assert err == ""


def test_json_reports_the_same_facts(call: Call) -> None:
    words = ("stability", "rules.yaml", "--json", "--quiet", "--select", "N3", *NATIVE)
    code, out, err = call(*words)
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert facts["ok"] is True
    assert [one["code"] for one in facts["criteria"]] == ["N3"]
    assert facts["runtimes"] == ["native", "native float32"]


def test_a_fuzzy_system_is_examined_like_rules(call: Call) -> None:
    words = ("--select", "N3", "--select", "N5", "--select", "N8", *NATIVE)
    ft.save(mamdani(), "fan.yaml")
    code, out, err = call("stability", "fan.yaml", *words)
    assert (code, err) == (0, "")
    assert out.startswith("fan: 3 of 3 stability checks pass, none fails (")
    assert "float32 is safe for 2 of 2 inputs" in out
    jump = out.splitlines()[-1]  # where the default ends
    assert jump.startswith("heat   1 ulp     ")
    assert " of the range of fan " in jump


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--select", "N99"),
            "no criterion 'N99'; there is N1, N2, N3, N4, N5, N6, N7, N8, N9, N10",
        ),
        (("--runtime", "no"), "no runtime 'no'; there is reference, native"),
    ],
)
def test_a_wrong_option_cannot_run(
    call: Call, words: tuple[str, ...], said: str
) -> None:
    code, out, err = call("stability", "grip.yaml", *words)
    assert (code, out) == (2, "")
    assert err.startswith(said)


def test_a_missing_file_cannot_be_examined(call: Call) -> None:
    code, _, err = call("stability", "none.yaml")
    assert code == 2
    assert err.startswith("none.yaml: cannot be read")


def test_a_table_without_the_columns_cannot_be_tried(call: Call) -> None:
    Path("other.csv").write_text("a,b\n1,2\n", "utf-8")
    code, _, err = call("stability", "grip.yaml", "--data", "other.csv", *NATIVE)
    assert code == 2
    assert "force" in err
