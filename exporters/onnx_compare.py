"""Is a shipped file the one that would be written now?

A graph that equals a fresh one to the last bit is the same function on every input:
no row has to be run to know it. The metadata of a file only choose the options of the
fresh graph, among those that `write` knows; the two are always compared.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec

from fuzzytree.errors import LossError
from fuzzytree.exporters.onnx import write_onnx
from fuzzytree.exporters.onnx_graph import TREES
from fuzzytree.model import Document, Written, fingerprint

if TYPE_CHECKING:
    import onnx

_VERSION = "fuzzytree.version"
_FINGERPRINT = "fuzzytree.fingerprint"
_NUMBERED = (
    ("node", "node"),
    ("initializer", "constant"),
    ("input", "input"),
    ("output", "output"),
)
_SHOWN = 4  # numbers of a constant
_LONGEST = 60  # characters of a text


class Differences(NamedTuple):
    """How a file differs from a freshly written one, in sentences.

    Attributes:
        graph: Operators, constants, wiring and texts.
        metadata: What the file states about itself; its version may be any.
    """

    graph: tuple[str, ...]
    metadata: tuple[str, ...]


def differences(
    content: bytes,
    model: Document,
    write: Callable[..., Written] | None = None,
    **options: Any,
) -> Differences:
    """Return how a file differs from one that is written of a model now.

    Args:
        content: The file.
        model: What it should be of.
        write: Writes it; `write_onnx`, with the options that the file states, if None.
        options: Of `write`, beside outputs, opset, ir and plain.
    """
    import onnx

    result = onnx.load_model_from_string(content)
    facts = {p.key.removeprefix("fuzzytree."): p.value for p in result.metadata_props}
    versions = {entry.domain: entry.version for entry in result.opset_import}
    if write is None:
        write = write_onnx
        options = {
            "allow_loss": True,
            "dtype": facts["dtype"],
            "columns": json.loads(facts["columns"]),
            "readable": facts.get("form") == "readable",
            "net": facts.get("form") == "net",
            "verify": False,
        }
    try:
        fresh = write(
            model,
            outputs=[entry.name for entry in result.graph.output],
            opset=versions.get("", 0),
            ir=result.ir_version,
            plain=not model.rules and TREES not in versions,
            **options,
        )
    except (ValueError, LossError) as error:  # it states what is not written now
        stated, right = facts.get("fingerprint", ""), fingerprint(model)
        faults = [] if stated == right else [_stated(_FINGERPRINT, stated, right)]
        return Differences((str(error),), tuple(faults))
    proto = onnx.load_model_from_string(fresh.content)
    return Differences(tuple(_graph(proto, result)), tuple(_metadata(proto, result)))


def _graph(fresh: onnx.ModelProto, result: onnx.ModelProto) -> Iterator[str]:
    faults = [*_operators(fresh, result), *_constants(fresh, result)]
    faults += _parts(fresh, result, ("graph", "metadata_props", "producer_version"))
    lists = tuple(field for field, _ in _NUMBERED)
    faults += _parts(fresh.graph, result.graph, lists)
    yield from faults
    for field, what in () if faults else _NUMBERED:
        one, two = getattr(fresh.graph, field), getattr(result.graph, field)
        if len(one) != len(two):
            yield f"{len(two)} {what}s where {len(one)} are right"
        for number, (right, entry) in enumerate(zip(one, two, strict=False), 1):
            if _bytes(right) != _bytes(entry):
                name = getattr(entry, "name", "") or str(number)
                yield f"{what} {name!r} differs from the one that would be written"
                break


def _operators(fresh: onnx.ModelProto, result: onnx.ModelProto) -> Iterator[str]:
    """Yield the operators that do not occur as often as in a fresh graph.

    Those that occur more often are listed with the results of the nodes that are new.
    """
    right, stated = _nodes(fresh), _nodes(result)
    for name in sorted(right.keys() | stated.keys()):
        one, two = right.get(name, []), stated.get(name, [])
        if len(one) == len(two):
            continue
        text = f"operator {name!r}: {len(two)} nodes where {len(one)} are right"
        known = {_bytes(node) for node in one}
        new = [node for node in two if _bytes(node) not in known]
        shown = ", ".join(repr(", ".join(node.output)) for node in new[:_SHOWN])
        yield f"{text}; new: {shown}" if len(two) > len(one) else text


def _nodes(proto: onnx.ModelProto) -> dict[str, list[onnx.NodeProto]]:
    """Return the nodes of each operator."""
    nodes: dict[str, list[onnx.NodeProto]] = {}
    for node in proto.graph.node:
        name = f"{node.domain}.{node.op_type}" if node.domain else node.op_type
        nodes.setdefault(name, []).append(node)
    return nodes


def _constants(fresh: onnx.ModelProto, result: onnx.ModelProto) -> Iterator[str]:
    """Yield the constants whose numbers no constant of a fresh graph has left over."""
    from onnx import numpy_helper

    left = Counter(_bytes(_unnamed(one)) for one in fresh.graph.initializer)
    for tensor in result.graph.initializer:
        key = _bytes(_unnamed(tensor))
        left[key] -= 1
        if left[key] < 0:
            try:
                numbers = numpy_helper.to_array(tensor).reshape(-1)
            except (ValueError, TypeError) as error:
                yield f"constant {tensor.name!r} cannot be decoded: {error}"
                continue
            texts = [_short(one) for one in numbers[:_SHOWN].tolist()]
            texts += ["..."] if len(numbers) > _SHOWN else []
            yield f"constant {tensor.name!r} is not the model's: {', '.join(texts)}"


def _unnamed(tensor: onnx.TensorProto) -> onnx.TensorProto:
    import onnx

    copy = onnx.TensorProto()
    copy.CopyFrom(tensor)
    copy.ClearField("name")
    return copy


def _parts(
    fresh: onnx.ModelProto | onnx.GraphProto,
    result: onnx.ModelProto | onnx.GraphProto,
    without: tuple[str, ...],
) -> Iterator[str]:
    """Yield the fields that differ, of those that change what a graph means."""
    for field in fresh.DESCRIPTOR.fields:
        if field.name not in without:
            one, two = getattr(fresh, field.name), getattr(result, field.name)
            if one != two:
                yield f"its {field.name} differs from the one that would be written"


def _metadata(fresh: onnx.ModelProto, result: onnx.ModelProto) -> Iterator[str]:
    right = {entry.key: entry.value for entry in fresh.metadata_props}
    stated: dict[str, str] = {}
    for entry in result.metadata_props:
        if entry.key in stated:
            yield f"it states {entry.key!r} twice"
        stated[entry.key] = entry.value
    for key in dict.fromkeys([_FINGERPRINT, *right, *stated]):
        if key == _VERSION or stated.get(key) == right.get(key):
            continue
        if key not in right:
            yield f"it states {key!r}, which is not written"
        elif key not in stated:
            yield f"it does not state {key!r}"
        else:
            yield _stated(key, stated[key], right[key])


def _stated(key: str, stated: str, right: str) -> str:
    if key == _FINGERPRINT:
        return f"it states fingerprint {stated[:12]}..., and {right[:12]}... is right"
    name = key.removeprefix("fuzzytree.")
    return f"it states {name} {_short(stated)}, and {_short(right)} is right"


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _bytes(message: onnx.NodeProto | onnx.TensorProto) -> bytes:
    content: bytes = message.SerializeToString(deterministic=True)
    return content


class Contents(msgspec.Struct, frozen=True):
    """The size of a graph.

    Attributes:
        bytes: Of the file.
        operators: How many nodes there are of each operator, by name.
        constants: How many constants there are.
    """

    bytes: int
    operators: dict[str, int]
    constants: int

    @property
    def nodes(self) -> int:
        """The number of nodes."""
        return sum(self.operators.values())


def contents(content: bytes) -> Contents:
    """Count what an ONNX file consists of.

    Example:
        >>> from fuzzytree.exporters.onnx import write_onnx
        >>> from fuzzytree.testing import random_tree
        >>> written = write_onnx(random_tree(1), verify=False).content
        >>> contents(written).operators["TreeEnsemble"]
        1
    """
    import onnx

    graph = onnx.load_model_from_string(content)
    counted = Counter(node.op_type for node in graph.graph.node)
    return Contents(
        len(content), dict(sorted(counted.items())), len(graph.graph.initializer)
    )
