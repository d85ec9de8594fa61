"""Is a shipped file the one that would be written now?

A graph that equals a fresh one to the last bit is the same function on every input:
no row has to be run to know it.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from fuzzytree.contracts import Model
from fuzzytree.exporters.onnx import write
from fuzzytree.exporters.onnx_graph import DOMAIN, TREES
from fuzzytree.system import FuzzySystem

if TYPE_CHECKING:
    import onnx


def graph_difference(content: bytes, model: Model | FuzzySystem) -> str | None:
    """Return how a file's graph differs from a fresh one; None if they are equal.

    The fresh graph is written with the options that the file itself states. Metadata
    and texts are not compared.

    Args:
        content: An ONNX file that fuzzytree wrote (`open_onnx` accepts it).
        model: The model that it should hold.

    Raises:
        ValueError: If the file states an option that this version does not know.
    """
    import onnx

    found = onnx.load_model_from_string(content)
    facts = {p.key.removeprefix("fuzzytree."): p.value for p in found.metadata_props}
    versions = {entry.domain: entry.version for entry in found.opset_import}
    columns = json.loads(facts["columns"])
    needed = model.columns if isinstance(model, FuzzySystem) else model.inputs
    fresh = write(
        model,
        allow_loss=True,
        dtype=facts["dtype"],
        opset=versions.get("", 0),
        ir=found.ir_version,
        signature="needed" if columns == list(needed) else "all",
        outputs=json.loads(facts["outputs"]),
        readable=DOMAIN in versions,
        plain=facts["carrier"] == "tree" and TREES not in versions,
        verify=False,
    )
    return proto_difference(onnx.load_model_from_string(fresh.content), found)


def proto_difference(fresh: onnx.ModelProto, found: onnx.ModelProto) -> str | None:
    """Return how a file differs from a fresh one, metadata and texts left out."""
    for what, one, two in (
        ("node", fresh.graph.node, found.graph.node),
        ("constant", fresh.graph.initializer, found.graph.initializer),
        ("input", fresh.graph.input, found.graph.input),
        ("output", fresh.graph.output, found.graph.output),
        ("function", fresh.functions, found.functions),
        ("operator set", fresh.opset_import, found.opset_import),
    ):
        if len(one) != len(two):
            return f"{len(two)} {what}s where {len(one)} are right"
        for number, (right, entry) in enumerate(zip(one, two, strict=True), 1):
            if _bytes(right) != _bytes(entry):
                name = getattr(entry, "name", "") or str(number)
                return f"{what} {name} differs from the one that would be written"
    return None


def _bytes(message: onnx.NodeProto) -> bytes:
    content: bytes = message.SerializeToString(deterministic=True)
    return content
