"""What no way of running a model can beat: reading its rows, and an empty session."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.benchmarking.records import Candidate, Found, Loaded, Omission, Question
from fuzzytree.errors import install_hint

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

READING = "floor: the columns read once"
SESSION = "floor: an empty session call"


def floors(question: Question) -> tuple[list[Candidate], list[Omission]]:
    """Return the floors; they answer nothing and have no error.

    Args:
        question: The one to list them under.

    Example:
        >>> found, omitted = floors("tree")
        >>> found[0].name
        'floor: the columns read once'
    """
    found = [
        Candidate(
            READING, question, "floor", _load_reading, note="the sum of each column"
        )
    ]
    if not all(map(importlib.util.find_spec, ("onnx", "onnxruntime"))):
        return found, [Omission(SESSION, f"not installed ({install_hint('onnx')})")]
    note = "onnxruntime hands the same table back"
    session = Candidate(
        SESSION, question, "floor", _load_session, note=note, is_foreign=True
    )
    return [*found, session], []


def _nothing(values: FloatArray) -> Found:
    return Found(np.full(values.shape[1], -1))


def _load_reading(threads: int) -> Loaded:
    def call(values: FloatArray) -> Callable[[], object]:
        return partial(values.sum, axis=1)

    return Loaded(_nothing, call)


def _load_session(threads: int) -> Loaded:
    from onnx import TensorProto, helper

    from fuzzytree.exporters.onnx_session import open_bare

    shapes = [
        helper.make_tensor_value_info(name, TensorProto.DOUBLE, ["rows", "columns"])
        for name in ("inputs", "same")
    ]
    node = helper.make_node("Identity", ["inputs"], ["same"])
    graph = helper.make_graph([node], "empty", shapes[:1], shapes[1:])
    imports = [helper.make_opsetid("", 17)]
    made = helper.make_model(graph, ir_version=8, opset_imports=imports)
    content = made.SerializeToString()
    bare = open_bare(content, threads)

    def call(values: FloatArray) -> Callable[[], object]:
        table = np.ascontiguousarray(values.T)
        return partial(bare, ["same"], {"inputs": table})

    return Loaded(_nothing, call, len(content))
