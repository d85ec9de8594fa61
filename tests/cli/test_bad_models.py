"""A model file that is not whole, not ours or too new is one sentence and exit 2."""

from __future__ import annotations

from pathlib import Path

import onnx
import pytest
from onnx import helper

from tests.cli.conftest import Call


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    text = (folder / "grip.yaml").read_text("utf-8")
    files = {
        "newer": text.replace("fuzzytree/1", "fuzzytree/9"),
        "half": text[:200],
        "empty": "",
        "bomb": "a: &a [1]\nb: [*a, *a]\n",
        "deep": "[" * 100_000,
        "wrong": text.replace("name: low", "name: lwo").replace("to: 4.0", "to: wet"),
        "twice": text + "name: other\n",
        "binary": "format: fuzzytree/1\x00\n",
    }
    for name, content in files.items():
        (folder / f"{name}.yaml").write_text(content, "utf-8")
    entry = helper.make_tensor_value_info("x", onnx.TensorProto.FLOAT, [1])
    end = helper.make_tensor_value_info("y", onnx.TensorProto.FLOAT, [1])
    node = helper.make_node("Identity", ["x"], ["y"])
    foreign = helper.make_model(helper.make_graph([node], "g", [entry], [end]))
    (folder / "foreign.onnx").write_bytes(foreign.SerializeToString())
    whole = (folder / "grip.onnx").read_bytes()
    (folder / "half.onnx").write_bytes(whole[: len(whole) // 2])


@pytest.mark.parametrize(
    ("path", "start"),
    [
        (
            "newer.yaml",
            "newer.yaml:2:9: a file of format 'fuzzytree/9' needs a newer fuzzytree",
        ),
        ("half.yaml", "half.yaml:"),
        ("empty.yaml", "empty.yaml:1:1: the file is empty\n"),
        ("bomb.yaml", "bomb.yaml:1:1: no 'format: fuzzytree/1' says what this file is"),
        ("deep.yaml", "deep.yaml:"),
        ("wrong.yaml", "wrong.yaml:"),
        ("twice.yaml", "twice.yaml:"),
        ("binary.yaml", "binary.yaml:"),
        (
            "foreign.onnx",
            "foreign.onnx: this ONNX file is not one of fuzzytree: "
            "its metadata has no 'fuzzytree.format'\n",
        ),
        ("half.onnx", "half.onnx: "),
        ("absent.yaml", "absent.yaml: cannot be read: no such file or directory\n"),
        ("/dev/full.yaml", "/dev/full.yaml: cannot be read: "),
    ],
)
@pytest.mark.parametrize("verb", ["show", "run", "check", "export"])
def test_every_verb_refuses_it_alike(
    call: Call, verb: str, path: str, start: str
) -> None:
    more = {"run": ["grasps.csv"], "export": ["-o", "new.yaml"]}.get(verb, [])
    if path.endswith(".onnx") and verb in ("check", "export"):
        stem = "a file in the format onnx is not read back as a model"
        start = f"{path}: {stem}; keep the file that it was made of\n"
    code, out, err = call(verb, path, *more)
    assert (code, out) == (2, "")
    assert err.startswith(start)
    assert "Traceback" not in err


def test_an_onnx_file_that_is_not_ours_is_refused_beside_a_model(call: Call) -> None:
    code, out, err = call("check", "grip.yaml", "foreign.onnx")
    assert (code, out) == (2, "")
    assert err == (
        "foreign.onnx: this ONNX file is not one of fuzzytree: "
        "its metadata has no 'fuzzytree.format'\n"
    )
