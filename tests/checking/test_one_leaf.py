"""A tree of one leaf asks for no input: every way of carrying and checking it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import pytest

import fuzzytree as ft
from fuzzytree.exporters.onnx import Output, write_onnx
from fuzzytree.model.tree import FuzzyTree, Leaf
from fuzzytree.semantics.lowering import rules_from_tree

TREE = FuzzyTree(
    "leaf", ("x", "y"), (), (), (Leaf("x", support=3),), columns=("a", "b")
)
DATA = np.array([[1.0, 3.0], [2.0, 4.0], [np.nan, 5.0]])


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("path", "options"),
    [
        ("m.yaml", {}),
        ("m.onnx", {}),
        ("m.sql", {}),
        ("m.sql", {"dialect": "duckdb"}),
        ("m.py", {}),
        ("m.mjs", {}),
        ("m.c", {}),
        pytest.param("m.pmml", {}, marks=pytest.mark.heavy),
    ],
)
def test_a_file_of_one_leaf_agrees_with_it(path: str, options: dict[str, Any]) -> None:
    ft.save(TREE, path, **options)
    agreement = ft.check(
        TREE, path, data=ft.table(DATA, columns=["a", "b"]), runtimes=["native"]
    )
    assert agreement.ok
    rows = [c for c in agreement.comparisons if c.representation == path]
    assert {c.basis for c in rows} == {"file", "rows"}


def test_a_tree_of_one_leaf_is_stable_on_rows() -> None:
    assert ft.stability(TREE, data=ft.table(DATA, columns=["a", "b"])).model == "leaf"


@pytest.mark.parametrize("model", [TREE, rules_from_tree(TREE)], ids=["tree", "rules"])
@pytest.mark.parametrize("signature", ["needed", "all"])
def test_the_graph_of_a_model_without_inputs_takes_the_columns_of_its_table(
    model: Any, signature: Any
) -> None:
    outputs: tuple[Output, ...] = ("label", "rule", "status")
    content = write_onnx(model, outputs=outputs, signature=signature).content
    session = onnxruntime.InferenceSession(content)
    width = "columns" if signature == "needed" else 2
    assert session.get_inputs()[0].shape == ["rows", width]
    rows = np.array([[1.0, np.nan], [np.inf, 2.0], [3.0, 4.0]])
    label, rule, status = session.run(None, {"inputs": rows})
    assert (list(label), list(rule), list(status)) == (["x"] * 3, [1] * 3, [0] * 3)
    assert session.run(["rule"], {"inputs": rows[:0]})[0].shape == (0,)
