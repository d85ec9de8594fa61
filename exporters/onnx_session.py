"""onnxruntime, opened quietly and with few threads, and the proof of a written file."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt
import onnxruntime

from fuzzytree.errors import DisagreementError, LossError
from fuzzytree.exporters.program_text import answer_of
from fuzzytree.model import FuzzySystem, Model, RuleBase
from fuzzytree.numerics import RealKind
from fuzzytree.semantics import (
    Program,
    error_bounds,
    from_system,
    infer,
    landmarks,
    system_probes,
)

_STATE = importlib.import_module("onnxruntime.capi.onnxruntime_pybind11_state")

RUNTIME_ERRORS: tuple[type[Exception], ...] = tuple(
    getattr(_STATE, name)
    for name in (
        "EPFail",
        "EngineError",
        "Fail",
        "InvalidArgument",
        "InvalidGraph",
        "InvalidProtobuf",
        "NoSuchFile",
        "NotImplemented",
        "RuntimeException",
    )
)
"""What onnxruntime raises; its classes have no parent of their own."""

_SILENT = 4


Array = npt.NDArray[np.generic]
Bare = Callable[[list[str], dict[str, Array]], Sequence[object]]
"""From output names and inputs to a list of arrays; raises one of `RUNTIME_ERRORS`."""


def open_bare(content: bytes, threads: int = 1) -> Bare:
    """Return the call of a session that writes nothing to stderr.

    Raises:
        Exception: One of `RUNTIME_ERRORS`, if onnxruntime refuses the file.
    """
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = _SILENT
    session = onnxruntime.InferenceSession(
        content, options, providers=["CPUExecutionProvider"]
    )
    quiet = onnxruntime.RunOptions()
    quiet.log_severity_level = _SILENT

    def bare(names: list[str], feeds: dict[str, Array]) -> Sequence[object]:
        result: Sequence[object] = session.run(names, feeds, quiet)
        return result

    return bare


def first_line(error: Exception) -> str:
    """Return what an error of onnxruntime says, without its code and its path."""
    text = (str(error).strip().splitlines() or [type(error).__name__])[0]
    return text.split(" : ", 3)[-1] if text.startswith("[ONNXRuntimeError]") else text


MOST_ROWS = 24
"""Rows on which a written file is run, at the most."""

_MOST_PROPOSITIONS = 50_000  # what the reference does in well under a second


def prove(
    content: bytes,
    model: Model,
    columns: Sequence[str],
    names: Sequence[str],
    *,
    kind: type[RealKind],
    is_exact: bool,
) -> None:
    """Load a file, run it and compare its predictions with the reference.

    If it is not exact, only rows with a missing value are compared.

    Raises:
        LossError: If onnxruntime does not load or run the file.
        DisagreementError: If an answer differs.
    """
    rows = list(_sample_rows(model))
    table = [[row.get(name, 0.0) for name in columns] for row in rows]
    with np.errstate(over="ignore"):  # beyond float32 is missing in float32
        values = np.array(table, np.float64).astype(kind)
    values = values.reshape(len(rows), len(columns))
    result = proved_run(content, model.name, names, values)
    for number, row in enumerate(rows):
        is_missing = not all(map(math.isfinite, row.values()))
        if is_exact or is_missing:
            outputs = {name: array[number] for name, array in result.items()}
            _compare(model, row, outputs)


def proved_run(
    content: bytes, model: str, names: Sequence[str], values: Array
) -> dict[str, Array]:
    """Return the named outputs of a file for some rows.

    Raises:
        LossError: If onnxruntime does not load or run the file.
    """
    try:
        result = open_bare(content)(list(names), {"inputs": values})
    except RUNTIME_ERRORS as error:
        raise LossError(
            f"cannot write {model} as onnx: onnxruntime {onnxruntime.__version__} does "
            f"not run it: {first_line(error)}"
        ) from error
    return {name: np.asarray(one) for name, one in zip(names, result, strict=True)}


def _sample_rows(model: Model) -> Iterator[dict[str, float]]:
    """Yield rows near a model's landmarks, the last with a missing value."""
    size = 1
    if isinstance(model, RuleBase):
        size = sum(len(c.terms) for rule in model.rules for c in rule.when) or 1
    points = {
        v.name: sorted({point for term in v.terms for point in landmarks(term.shape)})
        or [v.low or 0.0, v.high or 1.0]
        for v in model.variables
        if not v.parts
    }
    for number in range(max(1, min(MOST_ROWS, _MOST_PROPOSITIONS // size))):
        yield {
            name: values[(number * (3 + 2 * position) + position) % len(values)]
            for position, (name, values) in enumerate(points.items())
        }
    if points:
        yield dict.fromkeys(points, math.nan)


def _compare(model: Model, row: dict[str, float], outputs: dict[str, object]) -> None:
    answer = answer_of(model, row)
    expected: dict[str, object] = {
        "rule": answer.rule,
        "label": answer.label or "",
        "status": int(answer.status),
    }
    for name, value in outputs.items():
        if name == "strengths":
            same = np.array_equal(
                np.asarray(value, np.float64), answer.strengths, equal_nan=True
            )
        else:
            same = value == expected[name]
        if not same:
            right = answer.strengths if name == "strengths" else expected[name]
            raise DisagreementError(
                f"the onnx file of {model.name} returns another {name} than the model "
                f"where {row}: {value}, not {right}"
            )


_MOST_STEPS = 300_000  # of all rows


def prove_system(content: bytes, system: FuzzySystem, outputs: Sequence[str]) -> None:
    """Load a file, run it and compare its outputs with the inference.

    Raises:
        LossError: If onnxruntime does not load or run the file.
        DisagreementError: If a number differs by more than its bound.
    """
    program = from_system(system, activations=True)
    limit = max(1, min(MOST_ROWS, _MOST_STEPS // program.size))
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
    results: Mapping[str, Array],
) -> Iterator[str]:
    """Yield numbers of a file that differ from the inference by more than allowed."""
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
