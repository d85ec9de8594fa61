"""onnxruntime, opened quietly and with few threads; its errors by name."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
import onnxruntime

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
Session = Callable[[Sequence[str], Array], dict[str, Array]]
"""Answers the named outputs to `inputs`; raises one of `RUNTIME_ERRORS`."""

Bare = Callable[[list[str], dict[str, Array]], Sequence[object]]
"""The same as onnxruntime itself has it: names and arrays in, a list of arrays out."""


def open_session(content: bytes) -> Session:
    """Return a session that writes nothing to stderr and starts no thread.

    Raises:
        Exception: One of `RUNTIME_ERRORS`, if onnxruntime refuses the file.
    """
    return named(open_bare(content))


def named(bare: Bare) -> Session:
    """Return a session that gives its outputs by name."""

    def run(names: Sequence[str], inputs: Array) -> dict[str, Array]:
        found = bare(list(names), {"inputs": inputs})
        return {name: np.asarray(f) for name, f in zip(names, found, strict=True)}

    return run


def open_bare(content: bytes, threads: int = 1) -> Bare:
    """Return the call of a silent session, with nothing of ours around it.

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
        found: Sequence[object] = session.run(names, feeds, quiet)
        return found

    return bare


def first_line(error: Exception) -> str:
    """Return what an error of onnxruntime says, without its code and its path."""
    text = (str(error).strip().splitlines() or [type(error).__name__])[0]
    return text.split(" : ", 3)[-1] if text.startswith("[ONNXRuntimeError]") else text
