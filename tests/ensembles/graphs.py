"""ONNX graphs of trees that tests make: random ones, and of estimators."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper
from skl2onnx import to_onnx

MODES = ("LEQ", "LT", "GTE", "GT", "EQ", "NEQ")


def written(model: Any, width: int, path: Path) -> Path:
    """Convert an estimator with skl2onnx."""
    proto = to_onnx(model, np.zeros((1, width), np.float32))
    path.write_bytes(proto.SerializeToString())
    return path


def node_of(proto: onnx.ModelProto) -> onnx.NodeProto:
    """Return the node of trees."""
    nodes = [n for n in proto.graph.node if n.op_type.startswith("TreeEnsemble")]
    node: onnx.NodeProto = nodes[0]
    return node


def attribute(proto: onnx.ModelProto, name: str) -> Any:
    """Return a list of the node of trees, to be changed in place."""
    found = next(a for a in node_of(proto).attribute if a.name == name)
    return found.floats if len(found.floats) else found.ints or found.strings


def changed(path: Path, **lists: dict[int, Any]) -> Path:
    """Change places of lists of a file's trees."""
    proto = onnx.load(path)
    for name, values in lists.items():
        target = attribute(proto, name)
        for place, value in values.items():
            target[place] = value
    other = path.with_name(f"changed-{path.name}")
    other.write_bytes(proto.SerializeToString())
    return other


def with_routes(path: Path, model: Any) -> Path:
    """Say in a file of one tree where missing values go, as the estimator has it."""
    proto = onnx.load(path)
    node = node_of(proto)
    kept = [a for a in node.attribute if "missing_value" not in a.name]
    del node.attribute[:]
    ways = model.tree_.missing_go_to_left.astype(int).tolist()
    kept.append(helper.make_attribute("nodes_missing_value_tracks_true", ways))
    node.attribute.extend(kept)
    other = path.with_name(f"routes-{path.name}")
    other.write_bytes(proto.SerializeToString())
    return other


def random_graph(
    seed: int,
    *,
    kind: int = TensorProto.FLOAT,
    trees: int = 2,
    columns: int = 2,
    classes: int = 0,
    modes: tuple[str, ...] = MODES,
    **graph: Any,
) -> bytes:
    """Return random trees of depth 2 over small numbers."""
    draw = np.random.default_rng(seed)
    lists: dict[str, list[Any]] = {
        f"nodes_{name}": []
        for name in (
            *("treeids", "nodeids", "featureids", "values", "modes", "truenodeids"),
            *("falsenodeids", "missing_value_tracks_true"),
        )
    }
    word = "class" if classes else "target"
    ends: dict[str, list[Any]] = {
        f"{word}_{name}": [] for name in ("treeids", "nodeids", "ids", "weights")
    }
    for tree in range(trees):
        for node in range(7):
            is_leaf = node > 2
            mode = "LEAF" if is_leaf else f"BRANCH_{draw.choice(modes)}"
            cut = 0.0 if is_leaf else float(draw.choice([0.0, 0.5, 1.0]))
            row = (
                *(tree, node, int(draw.integers(columns)), cut, mode),
                *(0 if is_leaf else 2 * node + 1, 0 if is_leaf else 2 * node + 2),
                int(draw.integers(2)),
            )
            for values, value in zip(lists.values(), row, strict=True):
                values.append(value)
            for score in range(max(1, classes)) if is_leaf else ():
                weight = float(draw.integers(1, 9)) / 8
                for values, value in zip(
                    ends.values(), (tree, node, score, weight), strict=True
                ):
                    values.append(value)
    about = {"classlabels_int64s": [*range(classes)]} if classes else {"n_targets": 1}
    operator = "TreeEnsembleClassifier" if classes else "TreeEnsembleRegressor"
    outputs = ["label", "scores"] if classes else ["scores"]
    attributes: dict[str, Any] = {**lists, **ends, **about, **graph}
    node = helper.make_node(operator, ["X"], outputs, domain="ai.onnx.ml", **attributes)
    return of_node(node, kind, columns, is_classifier=bool(classes))


def of_node(
    node: onnx.NodeProto, kind: int, columns: int, *, is_classifier: bool
) -> bytes:
    """Return a graph of one node."""
    ends = [helper.make_tensor_value_info("scores", TensorProto.FLOAT, None)]
    if is_classifier:
        ends.insert(0, helper.make_tensor_value_info("label", TensorProto.INT64, None))
    entrance = helper.make_tensor_value_info("X", kind, [None, columns])
    graph = helper.make_graph([node], "trees", [entrance], ends)
    operators = [helper.make_opsetid("", 18), helper.make_opsetid("ai.onnx.ml", 1)]
    proto = helper.make_model(graph, opset_imports=operators, ir_version=9)
    content: bytes = proto.SerializeToString()
    return content


def run(content: bytes, rows: Any) -> list[Any]:
    """Run a graph in onnxruntime."""
    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    results: list[Any] = session.run(None, {"X": rows})
    return results
