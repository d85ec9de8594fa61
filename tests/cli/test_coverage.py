"""Rules that no generated row fires, and systems that mostly answer their default."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.conftest import Call
from tests.semantics.test_singletons import FLL

IDLE = """  rule: if x is low and x is high then y is third
"""


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    text = FLL.replace("0.333 0.333 0.333", "0.2 0.333 0.5")
    text = text.replace("low Triangle 0 0.5 1", "low Triangle 0 0.1 0.2")
    text = text.replace(
        "OutputVariable", "  term: high Triangle 0.7 0.8 0.9\nOutputVariable"
    )
    (folder / "s.fll").write_text(text + IDLE, "utf-8")


@pytest.mark.parametrize(
    "verb", [["show", "s.fll"], ["convert", "s.fll", "s.yaml", "--allow-loss"]]
)
def test_a_verb_reports_what_probes_do_not_reach(call: Call, verb: list[str]) -> None:
    code, _, err = call(*verb)
    assert code == 0
    assert "remark   no generated row fires rule 2 of 2\n" in err
    assert "rows drawn evenly from the ranges of the inputs an output has no" in err
    facts = json.loads(call(*verb, "--json")[1])
    assert facts["coverage"]["unfired"] == [2]
    assert facts["coverage"]["uncovered"] > 500


def test_check_reports_what_probes_do_not_reach(call: Call) -> None:
    code, out, _ = call("check", "s.fll", "--runtime", "native")
    assert code == 0
    assert "\nno generated row fires rule 2 of 2\n" in out
    assert "rows drawn evenly from the ranges of the inputs an output has no" in out
    facts = json.loads(call("check", "s.fll", "--runtime", "native", "--json")[1])
    assert facts["coverage"]["unfired"] == [2]
