"""ONNX: a fuzzy system as a graph of plain operators, in double.

The graph is the system's program, step by step (`fuzzytree.semantics.programs`), so it
gives the numbers of the inference, up to the last digits of `exp`, `pow`, `sin` and the
like.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from fuzzytree.errors import DisagreementError, LossError
from fuzzytree.model import FuzzySystem, Written, fingerprint
from fuzzytree.semantics import from_system

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    import onnx

    from fuzzytree.exporters.onnx import Output
    from fuzzytree.exporters.onnx_graph import OnnxGraph
    from fuzzytree.semantics import Program

_MOST_ROWS_TO_VERIFY = 24
_MOST_STEPS_TO_VERIFY = 300_000


def write_system(
    system: FuzzySystem,
    /,
    *,
    opset: int,
    ir: int,
    outputs: Sequence[Output],
    facts: dict[str, str],
    verify: bool,
) -> Written:
    """Write a fuzzy system; `exporters.onnx.write_onnx` documents the options.

    Raises:
        LossError: If it needs a function that onnxruntime lacks in double, or if the
            installed onnxruntime does not load the file.
        DisagreementError: If the file, run in onnxruntime, gives another answer.
    """
    from fuzzytree.exporters.onnx_steps import missing_functions

    program = from_system(system, activations="activations" in outputs)
    missing = missing_functions(program)
    if missing:
        raise LossError(
            f"cannot write {system.name} as onnx: a formula needs {', '.join(missing)},"
            " which onnxruntime computes in float32 only"
        )
    made = _model_proto(system, program, opset, ir, outputs, facts)
    content: bytes = made.SerializeToString(deterministic=True)
    if verify:
        _prove(content, system, outputs)
    return Written(content)


def _model_proto(
    system: FuzzySystem,
    program: Program,
    opset: int,
    ir: int,
    outputs: Sequence[Output],
    facts: dict[str, str],
) -> onnx.ModelProto:
    from onnx import TensorProto

    from fuzzytree.exporters.onnx_graph import OnnxGraph, model_proto

    graph = OnnxGraph(opset)
    _fill(graph, system, program, outputs)
    kinds: dict[Output, tuple[int, list[str | int]]] = {
        "outputs": (TensorProto.DOUBLE, ["rows", len(system.outputs)]),
        "status": (TensorProto.INT64, ["rows"]),
        "activations": (TensorProto.DOUBLE, ["rows", len(system.rules)]),
    }
    return model_proto(
        graph,
        "system",
        (TensorProto.DOUBLE, len(system.columns)),
        {name: kinds[name] for name in outputs},
        ir=ir,
        text=_in_words(system),
        facts=facts | _facts(system, program, outputs),
    )


def _fill(
    graph: OnnxGraph,
    system: FuzzySystem,
    program: Program,
    outputs: Sequence[Output],
) -> None:
    from fuzzytree.exporters.onnx_steps import add_steps, is_wide, np_to_onnx

    count, rules = len(system.outputs), len(system.rules)
    if is_wide(program):
        _fill_wide(graph, system, program, outputs)
        return
    names = add_steps(graph, program, system.columns)
    if "outputs" in outputs:
        _columns(graph, names[:count], "outputs")
    if "activations" in outputs:
        _columns(graph, names[count : count + rules], "activations")
    if "status" in outputs:
        graph.node("Cast", names[-1], named="status", to=np_to_onnx("int64"))


def _fill_wide(
    graph: OnnxGraph,
    system: FuzzySystem,
    program: Program,
    outputs: Sequence[Output],
) -> None:
    from fuzzytree.exporters.onnx_steps import Blocks, np_to_onnx

    blocks = Blocks(graph, program, system.columns)
    places = [result.step for result in program.results]
    count, rules = len(system.outputs), len(system.rules)
    wanted: dict[Output, list[int]] = {
        "outputs": places[:count],
        "activations": places[count : count + rules],
    }
    for name in outputs:
        if name in wanted:
            block = blocks.rows(wanted[name])
            graph.node("Transpose", block, perm=[1, 0], named=name)
    if "status" in outputs:
        status = blocks.single(places[-1])
        graph.node("Cast", status, named="status", to=np_to_onnx("int64"))


def _columns(graph: OnnxGraph, names: Sequence[str], named: str) -> None:
    """Put blocks of shape (rows,) side by side."""
    if len(names) == 1:
        graph.node("Reshape", names[0], graph.numbers([-1, 1], "shape"), named=named)
        return
    line = graph.numbers([0], "axes")
    if graph.opset >= 13:
        lines = [graph.node("Unsqueeze", name, line, hint=name) for name in names]
    else:
        lines = [graph.node("Unsqueeze", name, hint=name, axes=[0]) for name in names]
    block = graph.node("Concat", *lines, hint=named, axis=0)
    graph.node("Transpose", block, perm=[1, 0], named=named)


def _facts(
    system: FuzzySystem, program: Program, outputs: Sequence[Output]
) -> dict[str, str]:
    """Return the metadata: plain words where possible, JSON for lists."""
    units = {one.name: one.unit for one in system.inputs}
    texts = {
        "name": system.name,
        "carrier": "system",
        "kind": "system",
        "dtype": "float64",
        "fingerprint": fingerprint(system),
    }
    records: dict[str, object] = {
        "columns": list(system.columns),
        "inputs": list(system.columns),
        "units": [units[name] for name in system.columns],
        "classes": [],
        "rules": len(system.rules),
        "outputs": list(outputs),
        "semantics": {},
        "names": [one.name for one in system.outputs],
        "chunk": _rows_at_once(system, program),
    }
    return texts | {
        key: json.dumps(value, ensure_ascii=False) for key, value in records.items()
    }


def _rows_at_once(system: FuzzySystem, program: Program) -> int:
    """Return how many rows are best run together, so that they stay in the cache."""
    from fuzzytree.exporters.onnx_steps import is_wide

    samples = [
        one.defuzzifier.samples
        for one in system.outputs
        if not one.defuzzifier.is_weighted
    ]
    if is_wide(program):
        samples.append(len(system.rules))
    return max(2**17 // max(samples, default=8), 64)


def _in_words(system: FuzzySystem) -> str:
    numbers = ", ".join(repr(one.name) for one in system.outputs)
    return (
        f"The fuzzy system {system.name!r} with {len(system.rules)} rules: it computes "
        f"{numbers}. Missing and infinite values give NaN. Numbers: float64."
    )


def _prove(content: bytes, system: FuzzySystem, outputs: Sequence[Output]) -> None:
    """Load a file, run it and compare its outputs with the inference."""
    import numpy as np

    from fuzzytree.exporters.onnx_session import proved_run
    from fuzzytree.semantics import system_probes

    program = from_system(system, activations=True)
    limit = max(1, min(_MOST_ROWS_TO_VERIFY, _MOST_STEPS_TO_VERIFY // program.size))
    rows = system_probes(system, limit=limit)
    table = np.array([[row[name] for name in system.columns] for row in rows])
    table = table.reshape(len(rows), len(system.columns))
    results = proved_run(content, system.name, outputs, table)
    for text in _differences(system, program, rows, table, results):
        raise DisagreementError(text)


def _differences(
    system: FuzzySystem,
    program: Program,
    rows: Sequence[Mapping[str, float]],
    table: npt.NDArray[np.float64],
    results: Mapping[str, npt.NDArray[np.generic]],
) -> Iterator[str]:
    """Yield numbers of a file that differ from the inference by more than allowed."""
    import numpy as np

    from fuzzytree.semantics import error_bounds, infer

    right = [infer(system, row) for row in rows]
    expected = {
        "outputs": np.array([one.outputs for one in right], np.float64),
        "activations": np.array([one.activations for one in right], np.float64),
        "status": np.array([[one.status] for one in right], np.float64),
    }
    bounds = error_bounds(program, table.T).T
    first, last = len(system.outputs), len(system.outputs) + len(system.rules)
    allowed = {
        "outputs": bounds[:, :first],
        "activations": bounds[:, first:last],
        "status": bounds[:, last:],
    }
    for name, array in results.items():
        answers = array.astype(np.float64).reshape(expected[name].shape)
        one = expected[name]
        is_same = (answers == one) | (np.isnan(answers) & np.isnan(one))
        with np.errstate(invalid="ignore"):  # of two infinities
            is_near = is_same | (np.abs(answers - one) <= allowed[name])
        for row, place in np.argwhere(~(is_near | np.isinf(allowed[name]))).tolist():
            yield (
                f"the onnx file of {system.name} gives other {name} than the model "
                f"where {dict(rows[row])}: {answers[row, place]}, not {one[row, place]}"
            )
