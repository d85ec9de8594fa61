"""onnxruntime: models through the graphs that `fuzzytree.exporters.onnx` writes.

`open_onnx` runs such a file with nothing else at hand. One thread, rows in chunks that
fit the cache, nothing on stderr.
"""

from __future__ import annotations

import functools
import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from fuzzytree import exporters
from fuzzytree.errors import LossError, ReadError
from fuzzytree.exporters import FORMAT_VERSION, OPERATORS, Output, write_onnx
from fuzzytree.model import (
    Document,
    Dtype,
    FloatArray,
    ModelKind,
    Outcome,
    Prepared,
    Run,
    Runtime,
    Semantics,
    Variable,
    text_fault,
)
from fuzzytree.runtimes.onnx_sizes import graph_size
from fuzzytree.runtimes.rows import checked

if TYPE_CHECKING:
    import numpy.typing as npt
    import onnx

    Outputs = dict[str, npt.NDArray[Any]]

_LARGEST_FILE = 128 * 2**20
_MOST_NUMBERS = 2**28  # that the nodes of a graph compute in one call
_ANEW = "export the model anew"
_CACHE_BYTES = 2**18
_FIELDS: Mapping[str, str] = {
    "ModelProto": "ir_version producer_name producer_version domain model_version "
    "doc_string graph opset_import metadata_props",
    "GraphProto": "node name initializer doc_string input output value_info",
    "NodeProto": "input output name op_type domain attribute doc_string",
    "AttributeProto": "name doc_string type f i s t floats ints strings tensors",
    "TensorProto": "dims data_type name doc_string raw_data float_data int32_data "
    "string_data int64_data double_data uint64_data",
    "TypeProto": "tensor_type denotation",
}
"""The fields of messages that a graph without functions, graphs within, sparse
constants and data elsewhere can have; other messages have no other fields."""

Labels = tuple[str | None, ...]


class Facts(msgspec.Struct, frozen=True, kw_only=True):
    """What an ONNX file of ours says about itself.

    Attributes:
        name: Of the model.
        representation: Whether its graph follows a tree's path or fires rules.
        kind: `descent`, `relative`, `raw`, or `rules` for rules from no tree.
        dtype: The number type.
        fingerprint: Of the model that was written
            (`fuzzytree.model.rulebase.fingerprint`).
        version: Of the fuzzytree that wrote it.
        columns: The columns of the graph's input.
        inputs: Those of them that matter.
        units: The unit of each column, "" if unknown.
        classes: The possible answers.
        rules: The number of rules or leaves.
        outputs: Of the graph, in its order.
        semantics: What an answer depends on beside rules or tree.
        names: Of the numbers in the output `outputs` of a fuzzy system.
        chunk: How many rows are best run together; 0 if unknown.
        categories: Those of inputs that are their positions.
        stand_ins: What the graph puts in the place of missing values, by input.
    """

    name: str
    representation: ModelKind = msgspec.field(name="carrier")
    kind: str
    dtype: Dtype
    fingerprint: str
    version: str
    columns: tuple[str, ...]
    inputs: tuple[str, ...]
    units: tuple[str, ...]
    classes: tuple[str, ...]
    rules: int
    outputs: tuple[Output, ...]
    semantics: Semantics
    names: tuple[str, ...] = ()
    chunk: int = 0
    categories: dict[str, tuple[str, ...]] = {}
    stand_ins: dict[str, float] = {}

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The inputs, which say what cells mean."""
        units = dict(zip(self.columns, self.units, strict=False))
        return tuple(
            Variable(
                name,
                unit=units.get(name, ""),
                categories=self.categories.get(name, ()),
                missing=self.stand_ins.get(name),
            )
            for name in self.inputs
        )

    def known(self, values: FloatArray) -> npt.NDArray[np.bool_]:
        """Return which rows, of shape (inputs, rows), have all values."""
        replaced = np.array([[name in self.stand_ins] for name in self.inputs])
        known = np.isfinite(values) | replaced
        rows: npt.NDArray[np.bool_] = np.logical_and.reduce(known, axis=0)
        return rows


class OnnxModel(Facts, frozen=True, kw_only=True):
    """An ONNX file, ready to run: what it says about itself, and its answers.

    Attributes:
        run: Answers to values of shape (inputs, rows), in the order of `inputs`.
            A file without the output `status` reports no ties, and an overflow as an
            uncovered row; of a fuzzy system it does not distinguish a default from a
            number.
        run_labelled: The same with the file's own labels, None for "no class"; None in
            place of the function if the file has no output `label`.
        content: What runs: the file, written anew of what was read.
    """

    run: Run
    run_labelled: Callable[[FloatArray], tuple[Outcome, Labels]] | None
    content: bytes


def open_onnx(content: bytes, name: str) -> OnnxModel:
    """Open an ONNX file that `fuzzytree.exporters.onnx` wrote.

    Returns:
        What it says about itself, and how to run it.

    Raises:
        ReadError: If it is not such a file, or onnxruntime does not load it.
        MissingExtraError: If onnx or onnxruntime is not installed.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> content = write_onnx(random_tree(1)).content
        >>> open_onnx(content, "random.onnx").kind
        'descent'
    """
    proto = parsed(content, name)
    facts = _facts(proto, name)
    _check_signature(proto, facts, name)

    bare = open_session(proto, name, _rows_at_once(facts))
    return OnnxModel(
        **msgspec.structs.asdict(facts),
        run=_runner(bare, facts),
        run_labelled=(
            _labelled_runner(bare, facts) if "label" in facts.outputs else None
        ),
        content=proto.SerializeToString(),
    )


def prepare(
    model: Document,
    *,
    dtype: Dtype = "float64",
    readable: bool = False,
    plain: bool = False,
    net: bool = False,
    threads: int = 1,
    strengths: bool = False,
    probabilities: bool = False,
) -> Prepared:
    """Write a model as ONNX, in memory, and open it.

    A `readable` graph of rules has a node for each operation, for people; a `plain` one
    of a tree has no tree operators, and a `net` of a tree has layers. One call uses at
    most `threads` threads. `strengths` are returned of the rules of a system, too, and
    `probabilities` of rules that have them.

    Raises:
        LossError: If the number type or the kind of graph cannot hold the model.
        MissingExtraError: If onnx or onnxruntime is not installed.
    """
    if readable and not model.rules:
        raise LossError("onnxruntime readable runs rules, and this is a tree")
    if (plain or net) and model.rules:
        name = "net" if net else "plain"
        raise LossError(f"onnxruntime {name} runs trees, and these are rules")
    _require_packages("running")

    outputs: list[Output] = ["rule", "status"]
    if model.outputs:
        outputs = ["outputs", "status"]
    if model.rules and (strengths or not model.outputs):
        outputs.append("activations" if model.outputs else "strengths")
    if probabilities and model.rules and model.semantics.sharpness:
        outputs.append("probabilities")
    content = write_onnx(
        model,
        dtype=dtype,
        outputs=outputs,
        readable=readable,
        plain=plain,
        net=net,
        verify=False,
    ).content
    facts = _facts(_decoded(content, model.name), model.name)
    bare = exporters.open_bare(content, threads)
    names: list[str] = [*facts.outputs]
    rows = _rows_at_once(facts)

    def call(table: npt.NDArray[np.generic]) -> None:
        for start in range(0, len(table), rows):
            bare(names, {"inputs": table[start : start + rows]})

    return Prepared(_runner(bare, facts), _tabulator(facts), call, content, dtype)


def _require_packages(doing: str) -> None:
    for package in ("onnx", "onnxruntime"):
        exporters.require(package, f"{doing} onnx files needs")


def _caller(
    bare: exporters.Bare, facts: Facts, names: Sequence[str]
) -> Callable[[FloatArray], Outputs]:
    """Return a function from values to some outputs by name, rows last.

    What one row needs stands ready, for it takes longer than the session's call.
    """
    names, size, tabulated = list(names), _rows_at_once(facts), _tabulator(facts)
    widths = {"strengths": facts.rules, "activations": facts.rules}
    widths["outputs"] = len(facts.names)
    widths["probabilities"] = len(facts.classes)
    kinds = dict.fromkeys(widths, np.dtype(np.float64)) | {"label": np.dtype(object)}
    lasts = {"rule": facts.rules, "status": 3}
    results = [
        (
            name,
            (widths[name],) if name in widths else (),
            kinds.get(name, np.dtype(np.int64)),
            lasts.get(name),
        )
        for name in names
    ]

    def run(values: FloatArray) -> Outputs:
        rows = values.shape[1]
        if rows > size:
            return in_chunks(values)
        table = tabulated(values)
        try:
            arrays = bare(names, {"inputs": table})
        except exporters.RUNTIME_ERRORS as error:
            text = f"onnxruntime cannot run {facts.name}: {exporters.first_line(error)}"
            raise LossError(text) from error
        outputs: Outputs = {}
        for (name, width, kind, last), result in zip(results, arrays, strict=True):
            array = np.asarray(result, kind)
            if array.shape != (rows, *width) or not _is_within(array, last):
                raise LossError(
                    f"{facts.name}: the ONNX file gives answers without meaning"
                )
            outputs[name] = array.T if width else array
        return outputs

    def in_chunks(values: FloatArray) -> Outputs:
        count = values.shape[1]
        outputs = {name: np.empty((*w, count), kind) for name, w, kind, _ in results}
        for start in range(0, count, size):
            part = slice(start, start + size)
            for name, array in run(values[:, part]).items():
                outputs[name][..., part] = array
        return outputs

    return run


def _is_within(array: npt.NDArray[Any], last: int | None) -> bool:
    """Return whether all numbers lie in 0 to `last`, if there is one."""
    if last is None or not array.size:
        return True
    if array.size == 1:  # the ufuncs would take as long as the rest
        return bool(0 <= array.item() <= last)
    return bool(array.min() >= 0 and array.max() <= last)


def _runner(bare: exporters.Bare, facts: Facts) -> Run:
    names = [name for name in facts.outputs if name != "label"]
    call = _caller(bare, facts, names)

    def run(values: FloatArray) -> Outcome:
        values = checked(values, facts.inputs)
        return _outcome(call(values), facts, values)

    return run


def _labelled_runner(
    bare: exporters.Bare, facts: Facts
) -> Callable[[FloatArray], tuple[Outcome, Labels]]:
    call = _caller(bare, facts, facts.outputs)

    def run(values: FloatArray) -> tuple[Outcome, Labels]:
        values = checked(values, facts.inputs)
        outputs = call(values)
        labels = tuple([label or None for label in outputs["label"].tolist()])
        return _outcome(outputs, facts, values), labels

    return run


def _outcome(answers: Outputs, facts: Facts, values: FloatArray) -> Outcome:
    outputs, status = answers.get("outputs"), answers.get("status")
    if outputs is None:
        rule, lacks_answer = answers["rule"], answers["rule"] == 0
    else:
        rule = np.zeros(outputs.shape[1], np.int64)
        lacks_answer = np.isnan(outputs).any(axis=0)
    if status is None:
        status = np.zeros(len(rule), np.int64)
        if lacks_answer.item() if len(rule) == 1 else lacks_answer.any():
            none = np.where(facts.known(values), 2, 3)
            status = np.where(lacks_answer, none, 0)
    strengths = answers.get("strengths", answers.get("activations"))
    return Outcome(rule, status, strengths, answers.get("probabilities"), outputs)


def _rows_at_once(facts: Facts) -> int:
    """Return how many rows are answered together, so that they stay in the cache."""
    if facts.kind == "descent":
        return max(2**12, min(2**16, 2**22 // facts.rules))
    if facts.names:
        return min(max(facts.chunk, 1), 2**16)
    degree = 8 if facts.dtype == "float64" else 4
    return max(128, min(2**13, _CACHE_BYTES // (degree * facts.rules)))


def _tabulator(facts: Facts) -> Callable[[FloatArray], npt.NDArray[np.generic]]:
    """Return what makes values of shape (inputs, rows) the graph's input."""
    width, is_single = len(facts.columns), facts.dtype == "float32"
    kind = np.dtype(np.float32 if is_single else np.float64)
    places = [facts.columns.index(name) for name in facts.inputs]
    is_whole, at = places == [*range(width)], np.array(places, np.int64)

    def tabulated(values: FloatArray) -> npt.NDArray[np.generic]:
        if is_whole:
            return values.T.astype(kind, "C", copy=False)
        table = np.zeros((values.shape[1], width), kind)
        if len(table) == 1:
            table.put(at, values)  # in half the time
        else:
            table[:, at] = values.T
        return table

    # A value beyond float32 is missing in float32.
    return np.errstate(over="ignore")(tabulated) if is_single else tabulated


def parsed(content: bytes, name: str) -> onnx.ModelProto:
    """Return an ONNX file as its parts, all of which are understood.

    Raises:
        ReadError: If it is none, too large, of others, or holds what a model does not
            need.
        MissingExtraError: If onnx or onnxruntime is not installed.
    """
    _require_packages("reading")
    if len(content) > _LARGEST_FILE:
        raise ReadError(
            f"{name}: the file has {len(content) >> 20} MiB, "
            f"and {_LARGEST_FILE >> 20} are the most that is read"
        )
    proto = _decoded(content, name)
    for fault in _part_faults(proto):
        raise ReadError(f"{name}: {fault}; {_ANEW}")
    texts_of(proto, name)
    for node in proto.graph.node:  # operators of other domains among them
        if OPERATORS.get(node.op_type) != node.domain:
            whose = f" of {node.domain!r}" if node.domain else ""
            what = f"no graph of fuzzytree has the operator {node.op_type!r}{whose}"
            raise ReadError(f"{name}: {what}; {_ANEW}")
    return proto


def open_session(proto: onnx.ModelProto, name: str, rows: int) -> exporters.Bare:
    """Return what runs a parsed file: its parts, written anew, and no other bytes.

    Args:
        proto: The parts.
        name: What to call the file.
        rows: The most in one call.

    Raises:
        ReadError: If a call would compute too much, or onnxruntime does not load it.
    """
    try:
        size = graph_size(proto, rows)
    except ValueError as error:
        raise ReadError(f"{name}: {error}; {_ANEW}") from error
    if size > _MOST_NUMBERS:
        raise ReadError(
            f"{name}: its nodes compute {size:.2g} numbers in a call of {rows} rows, "
            f"and {_MOST_NUMBERS:.2g} are the most that is run; {_ANEW}"
        )
    try:
        return exporters.open_bare(proto.SerializeToString())
    except exporters.RUNTIME_ERRORS as error:
        text = f"{name}: onnxruntime does not load it: {exporters.first_line(error)}"
        raise ReadError(text) from error


def texts_of(proto: onnx.ModelProto, name: str) -> dict[str, str]:
    """Return the metadata of a file of ours, which must be of a known version.

    Raises:
        ReadError: If it is a file of others, or of another version.
    """
    prefix = "fuzzytree."
    texts = {
        entry.key.removeprefix(prefix): entry.value
        for entry in proto.metadata_props
        if entry.key.startswith(prefix)
    }
    version = texts.get("format")
    if version is None:
        raise ReadError(
            f"{name}: this ONNX file is not one of fuzzytree: "
            "its metadata has no 'fuzzytree.format'"
        )
    if version != FORMAT_VERSION:
        raise ReadError(
            f"{name}: the file has format {version!r}, and this fuzzytree "
            f"reads format {FORMAT_VERSION!r}; a newer one may help"
        )
    return texts


def _decoded(content: bytes, name: str) -> onnx.ModelProto:
    import onnx
    from google.protobuf.message import (  # type: ignore[import-untyped] # has none
        DecodeError,
    )

    if content[4:8] == b"ORTM":
        raise ReadError(
            f"{name}: this is in onnxruntime's own format, or seems so to it; "
            "export the model as ONNX"
        )
    try:
        return onnx.load_from_string(content)
    except (DecodeError, UnicodeDecodeError) as error:
        text = f"{name}: this is no ONNX file, or only a part of one"
        raise ReadError(text) from error


_OTHER_INPUTS: Mapping[str, str] = {
    "frames": "frames of a sensor, not rows; `fuzzytree tactile check` checks it",
}
"""Graphs of the project that do not take rows: their kind, and a sentence."""


def _facts(proto: onnx.ModelProto, name: str) -> Facts:
    """Return the metadata, which must be complete and of a known version."""
    texts = texts_of(proto, name)
    other = _OTHER_INPUTS.get(texts.get("carrier", ""))
    if other is not None:
        raise ReadError(f"{name}: the file takes {other}")
    records = {"columns", "inputs", "units", "classes", "rules", "outputs", "semantics"}
    records |= {"names", "chunk", "categories", "stand_ins"}
    try:
        known = {k: json.loads(v) if k in records else v for k, v in texts.items()}
        facts = msgspec.convert(known, Facts)
    except (json.JSONDecodeError, msgspec.ValidationError) as error:
        raise ReadError(f"{name}: the file's metadata is broken: {error}") from error
    is_system = facts.representation == "system"
    is_possible = (0 if is_system else 1) <= facts.rules <= proto.ByteSize()
    is_possible &= is_system == bool(facts.names)
    if not set(facts.inputs) <= set(facts.columns) or not is_possible:
        raise ReadError(f"{name}: the file's metadata contradicts itself")
    names = (*facts.columns, *facts.units, *facts.classes, *facts.names)
    names += tuple(itertools.chain(*facts.categories.values()))
    for text in (facts.name, facts.kind, facts.fingerprint, facts.version, *names):
        if fault := text_fault(text):
            raise ReadError(f"{name}: the file's metadata: {text!r} {fault}")
    return facts


def _part_faults(message: Any) -> Iterator[str]:
    """Yield the parts of a file that no graph of ours has, and broken texts."""
    from google.protobuf.message import Message
    from google.protobuf.unknown_fields import (  # type: ignore[import-untyped]
        UnknownFieldSet,
    )

    kind = message.DESCRIPTOR.name
    for entry in UnknownFieldSet(message):
        yield f"its {kind} has a field {entry.field_number}, which ONNX does not know"
    for field, value in message.ListFields():
        values = [value] if isinstance(value, str | bytes | Message) else value
        if kind in _FIELDS and field.name not in _FIELDS[kind].split():
            yield f"its {kind} has {field.name!r}, which no graph of fuzzytree has"
        elif field.message_type is not None:
            for part in values:
                yield from _part_faults(part)
        elif field.cpp_type == field.CPPTYPE_STRING and field.name != "raw_data":
            texts = (text for text in values if isinstance(text, bytes))
            if any(text != text.decode(errors="ignore").encode() for text in texts):
                yield f"its {kind} has a {field.name!r} that is no UTF-8"


def _check_signature(proto: onnx.ModelProto, facts: Facts, name: str) -> None:
    """Compare the inputs and outputs that the graph has with the metadata."""
    outputs = tuple(output.name for output in proto.graph.output)
    inputs = [entry.name for entry in proto.graph.input]
    shape = proto.graph.input[0].type.tensor_type.shape if inputs else None
    width = shape.dim[1].dim_value if shape and len(shape.dim) == 2 else None
    if inputs != ["inputs"] or width != len(facts.columns) or outputs != facts.outputs:
        raise ReadError(
            f"{name}: the graph's inputs and outputs are not those of its metadata"
        )
    needed, wanted = "rule", "label and rule"
    if facts.names:
        needed, wanted = "outputs", "outputs and status"
    if needed not in outputs:
        raise ReadError(
            f"{name}: the file has no output {needed!r}, so it cannot be run here; "
            f"write it with the outputs {wanted}"
        )


def _runtime(
    name: str,
    runs: tuple[ModelKind, ...],
    dtype: Dtype,
    *cannot: str,
    readable: bool = False,
    plain: bool = False,
    net: bool = False,
    in_audits: bool = False,
) -> Runtime:
    make = functools.partial(
        prepare, dtype=dtype, readable=readable, plain=plain, net=net
    )

    def load(model: Document, *, with_strengths: bool = True) -> Run:
        return make(model, strengths=with_strengths, probabilities=True).run

    return Runtime(
        name=f"onnxruntime {name}",
        runs=runs,
        load=load,
        dtype=dtype,
        cannot=cannot,
        extra="onnx",
        modules=("onnx", "onnxruntime"),
        in_audits=in_audits,
        is_reentrant=True,
        in_variants=in_audits and dtype == "float64",
        prepare=make,
        note="the session's call alone; the table is laid out before",
    )


_SINGLE = (
    "cuts and bounds are rounded to float32: a value next to one may change sides",
    "a value beyond float32 counts as missing",
)

RUNTIMES = (
    _runtime("float64", ("tree", "rules", "system"), "float64", in_audits=True),
    _runtime("mixed", ("tree", "rules"), "mixed", in_audits=True),
    _runtime("float32", ("tree", "rules"), "float32", *_SINGLE, in_audits=True),
    _runtime("readable", ("rules",), "float64", readable=True),
    _runtime("plain", ("tree",), "float64", plain=True),
    _runtime("net", ("tree",), "float64", "trees of more than 64 leaves", net=True),
)
