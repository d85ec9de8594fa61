"""`benchmarks/tactile_bench.py`: run time and error of each way from frame to class."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import numpy as np
import pytest
from commands import run
from tactile_bench import command
from tactile_timing import FramesStudy

from fuzzytree.api.verbs import save
from fuzzytree.schemas.generation import of_result
from fuzzytree.tactile.presses import labelled
from tests.tactile.archives import write_presses
from tests.tactile.frame_models import SMALL, learnt_tree

pytestmark = pytest.mark.usefixtures("few_objects")

ROOT = Path(__file__).resolve().parents[2]
SCHEMA = ROOT / "benchmarks" / "tactile_bench.schema.json"
SIZE = ["--sensor", "6x4", "--full", "100"]
Said = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    save(learnt_tree(SMALL, ("area", "S1")), "tree.yaml")
    cells = np.random.default_rng(0).integers(0, 101, (9, 6, 4)).astype(np.uint8)
    cells[0] = 0
    write_presses("f.npz", labelled(cells, SMALL))


def test_the_schema_is_the_one_that_the_code_generates() -> None:
    assert SCHEMA.read_bytes() == of_result(FramesStudy)


@pytest.mark.heavy
def test_a_bench_reports_time_error_and_floors(capsys: Said) -> None:
    words = ["tree.yaml", *SIZE, "--data", "f.npz", "--quiet"]
    few = ["--rows", "1", "--rows", "2000", "--rounds", "3"]
    assert run(command, [*words, *few]) == 0
    out = capsys.readouterr().out
    for text in (
        "1 frame in a call",
        "2,000 frames in a call",
        "numpy",
        "onnx",
        "c   ",
    ):
        assert text in out
    assert "floor: the frames copied" in out
    assert "left out: plain Python: 2,000 frames in a call" in out
    assert run(command, [*words, "--rows", "1", "--rounds", "3", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    jsonschema.validate(found, json.loads(SCHEMA.read_text("utf-8")))
    assert found["judged"] == 9
    errors = {one["name"]: one["error"] for one in found["points"]}
    assert max(errors[name] for name in ("numpy", "onnx", "c")) < 1e-14
    assert errors["floor: the frames copied"] is None
