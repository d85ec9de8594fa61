"""A graph of frames, run in onnxruntime and held against plain Python, bit by bit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import onnxruntime

from fuzzytree.contracts import Model
from fuzzytree.errors import LossError
from fuzzytree.exporters.onnx_session import RUNTIME_ERRORS, first_line, open_bare
from fuzzytree.tactile.features import FrameProgram
from fuzzytree.tactile.features.plain import Shown, plain_answer, plain_features
from fuzzytree.tactile.sensor import Cells

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.exporters.onnx_frames import Output

    Answers = dict[str, npt.NDArray[np.generic]]


def differences(
    content: bytes,
    made: FrameProgram,
    model: Model,
    frames: Cells,
    outputs: Sequence[Output],
    reject: float,
) -> Iterator[str]:
    """Yield where a file gives other answers than plain Python, bit by bit.

    Raises:
        LossError: If onnxruntime does not load or run the file.
    """
    found = _run(content, model, frames, outputs)
    for number, frame in enumerate(frames):
        values, is_pressed = plain_features(made, frame)
        right = plain_answer(model, values, is_pressed=is_pressed, reject=reject)
        for name in outputs:
            given = np.asarray(found[name][number]).tolist()
            wanted = np.asarray(expected(model, right, name)).tolist()
            if given != wanted:
                yield (
                    f"the onnx file of {model.name} gives other {name} than plain "
                    f"Python for aimed frame {number}: {given}, not {wanted}"
                )


def _run(
    content: bytes, model: Model, frames: Cells, outputs: Sequence[Output]
) -> Answers:
    try:
        found = open_bare(content)(list(outputs), {"frames": frames})
    except RUNTIME_ERRORS as error:
        raise LossError(
            f"cannot write {model.name} as onnx: onnxruntime "
            f"{onnxruntime.__version__} does not run it: {first_line(error)}"
        ) from error
    return {name: np.asarray(one) for name, one in zip(outputs, found, strict=True)}


def expected(model: Model, shown: Shown, name: Output) -> object:
    """Return what an output of a graph is for a frame, from plain Python's answer."""
    match name:
        case "label":
            return model.classes[shown.code] if shown.code >= 0 else ""
        case "state":
            return int(shown.state)
        case "rule":
            return shown.rule
        case "features":
            return shown.features
        case "strengths":
            return shown.strengths
