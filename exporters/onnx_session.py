"""onnxruntime, opened quietly and with few threads, and the proof of a written file."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt
import onnxruntime

from fuzzytree.errors import DisagreementError, LossError
from fuzzytree.exporters.program_text import examples_of, rated_rules
from fuzzytree.model import Document, stand_ins
from fuzzytree.numerics import RealKind
from fuzzytree.semantics import (
    Row,
    few_probes,
    program_of,
    row_probabilities,
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
    options.add_session_config_entry("session.load_model_format", "ONNX")
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


_MOST_ROWS = 24  # on which a written file is run
_MOST_OPERATIONS = 300_000  # of all rows: what the reference does in under a second


def prove(
    content: bytes,
    model: Document,
    columns: Sequence[str],
    names: Sequence[str],
    *,
    kind: type[RealKind] = np.float64,
    is_exact: bool = True,
) -> None:
    """Load a file, run it and compare its predictions with the reference.

    If it is not exact, only rows with a missing value for which nothing stands in are
    compared.

    Raises:
        LossError: If onnxruntime does not load or run the file.
        DisagreementError: If a prediction differs, by more than its bound.
    """
    rows = _rows(model)
    table = [[row.get(name, 0.0) for name in columns] for row in rows]
    with np.errstate(over="ignore"):  # beyond float32 is missing in float32
        values = np.array(table, np.float64).astype(kind)
    values = values.reshape(len(rows), len(columns))
    result = _run(content, model.name, names, values)
    known = stand_ins(model.variables)
    every = zip(rows, _expected(model, rows, names), strict=True)
    for number, (row, (expected, allowed)) in enumerate(every):
        if not is_exact and all(
            math.isfinite(value) or name in known for name, value in row.items()
        ):
            continue
        for name, array in result.items():
            one, right = array[number : number + 1].reshape(-1).tolist(), expected[name]
            if not _is_near(one, right, allowed.get(name, ())):
                shown, wanted = (v[0] if len(v) == 1 else v for v in (one, right))
                raise DisagreementError(
                    f"the onnx file of {model.name} returns another {name} than the "
                    f"model where {dict(row)}: {shown}, not {wanted}"
                )


def _run(
    content: bytes, model: str, names: Sequence[str], values: Array
) -> dict[str, Array]:
    """Return the named outputs of a file for some rows."""
    try:
        result = open_bare(content)(list(names), {"inputs": values})
    except RUNTIME_ERRORS as error:
        raise LossError(
            f"cannot write {model} as onnx: onnxruntime {onnxruntime.__version__} does "
            f"not run it: {first_line(error)}"
        ) from error
    return {name: np.asarray(one) for name, one in zip(names, result, strict=True)}


def _rows(model: Document) -> Sequence[Row]:
    """Return rows on which a file is run, more of a small model."""
    size = program_of(model).size
    limit = max(1, min(_MOST_ROWS, _MOST_OPERATIONS // size))
    return [*few_probes(model, limit), dict.fromkeys(model.inputs, math.nan)]


Values = Mapping[str, Sequence[float | str]]
Bounds = Mapping[str, Sequence[float]]


def _expected(
    model: Document, rows: Sequence[Row], names: Sequence[str]
) -> Iterator[tuple[Values, Bounds]]:
    """Yield the reference's values of each output, and how far they may be off."""
    rated = rated_rules(model, "onnx") if "probabilities" in names else None
    count = len(model.outputs)
    for _, answer, bounds in examples_of(model, rows, activations=True):
        values: Values = {
            "rule": [answer.rule],
            "label": [answer.label or ""],
            "status": [int(answer.status)],
            "strengths": answer.strengths,
            "probabilities": row_probabilities(rated, answer) if rated else (),
            "outputs": answer.outputs,
            "activations": answer.strengths,
        }
        yield values, {"outputs": bounds[:count], "activations": bounds[count:]}


def _is_near(
    values: Sequence[object], right: Sequence[float | str], allowed: Sequence[float]
) -> bool:
    """Return whether values are equal, or as near as allowed; NaN is NaN."""
    if any(isinstance(value, str) for value in right):
        return [*values] == [*right]
    one, two = np.array(values, np.float64), np.array(right, np.float64)
    most = np.array(allowed, np.float64) if allowed else np.zeros(len(two))
    with np.errstate(invalid="ignore"):  # of two infinities
        is_near = (one == two) | (np.abs(one - two) <= most) | np.isinf(most)
    return bool(np.all(is_near | (np.isnan(one) & np.isnan(two))))
