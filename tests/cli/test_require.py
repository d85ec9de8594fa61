# ruff: noqa: E501 # whole messages
"""`fuzzytree require`: the verdicts, the exit codes, and what programs read."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import pytest
import yaml

from tests.cli.conftest import Call

ROOT = Path(__file__).resolve().parents[2]
TIPPER = str(ROOT / "examples" / "tipper.fll")
FILE = str(ROOT / "examples" / "tipper-requirements.yaml")


def schema(name: str) -> dict[str, object]:
    """Return a JSON Schema of the project."""
    result: dict[str, object] = json.loads((ROOT / "schemas" / name).read_text("utf-8"))
    return result


def test_a_proved_requirement_is_fine_and_an_open_or_refuted_one_is_not(
    call: Call,
) -> None:
    assert call("require", TIPPER, "--that", "tip is at least 5")[0] == 0
    code, out, _ = call("require", TIPPER, FILE, "--that", "tip is at most 9")
    assert code == 1
    assert out.splitlines()[0].endswith("4 requirements: 2 proved, 2 REFUTED")
    words = ("--that", "tip changes by at most 16 per food", "--steps", "2000")
    code, out, _ = call("require", TIPPER, *words)
    assert code == 1
    assert "1 requirement: 0 proved, 1 OPEN" in out


def test_run_confirms_what_refutes_a_requirement(call: Call, tmp_path: Path) -> None:
    _, out, _ = call("require", TIPPER, FILE, "--json", "--quiet")
    answers = json.loads(out)["answers"]
    jsonschema.validate(json.loads(out), schema("require.schema.json"))
    (refuted,) = (one for one in answers if one["verdict"] == "REFUTED")
    (tmp_path / "rows.csv").write_text(refuted["rows"])
    assert (
        call("run", TIPPER, str(tmp_path / "rows.csv"), "-o", str(tmp_path / "o.csv"))[
            0
        ]
        == 0
    )
    table = (tmp_path / "o.csv").read_text()
    numbers = [f"tip {line.split(',')[0]}" for line in table.splitlines()[1:]]
    assert numbers == refuted["predictions"]


def test_the_shipped_file_of_requirements_fits_its_schema() -> None:
    content = yaml.safe_load(Path(FILE).read_text("utf-8"))
    jsonschema.validate(content, schema("requirements.schema.json"))


def test_code_hosts_get_the_place_of_a_requirement(call: Call) -> None:
    _, out, err = call("require", TIPPER, FILE, "--output-format", "github")
    assert out.startswith(f"::error file={FILE},line=6,col=9::tip rises with service (")
    assert "3 requirements: 2 proved, 1 REFUTED" in err
    _, out, _ = call("require", TIPPER, FILE, "--output-format", "sarif")
    [run] = json.loads(out)["runs"]
    levels = [(result["kind"], result["level"]) for result in run["results"]]
    assert levels == [("pass", "none"), ("pass", "none"), ("fail", "error")]
    place = run["results"][2]["locations"][0]["physicalLocation"]["region"]
    assert place == {"startLine": 6, "startColumn": 9}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "name a FILE of requirements, or one with --that"),
        (("--that", "tip is at least 5 where food > 11"), "'tip is at least 5 where food > 11': no row meets the conditions, as the values of 'food' are 0 to 10; --limits sets others"),
        (("none.yaml",), "none.yaml: cannot be read: no such file or directory"),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence_and_exit_2(
    call: Call, words: tuple[str, ...], message: str
) -> None:
    code, out, err = call("require", TIPPER, *words)
    assert (code, out, err.splitlines()[0]) == (2, "", message)
