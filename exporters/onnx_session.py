"""onnxruntime, opened quietly and with one thread; its errors by name."""

from __future__ import annotations

import onnxruntime
from onnxruntime.capi import onnxruntime_pybind11_state as state

RUNTIME_ERRORS: tuple[type[Exception], ...] = tuple(
    getattr(state, name)
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


def open_session(content: bytes) -> onnxruntime.InferenceSession:
    """Return a session that writes nothing to stderr and starts no thread.

    Raises:
        Exception: One of `RUNTIME_ERRORS`, if onnxruntime refuses the file.
    """
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = _SILENT
    return onnxruntime.InferenceSession(
        content, options, providers=["CPUExecutionProvider"]
    )


def quiet_run() -> onnxruntime.RunOptions:
    """Return options under which a failed run writes nothing to stderr."""
    options = onnxruntime.RunOptions()
    options.log_severity_level = _SILENT
    return options


def first_line(error: Exception) -> str:
    """Return what an error of onnxruntime says, without its code and its path."""
    text = (str(error).strip().splitlines() or [type(error).__name__])[0]
    return text.split(" : ", 3)[-1] if text.startswith("[ONNXRuntimeError]") else text
