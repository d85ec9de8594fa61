"""A graph of frames, run in onnxruntime and compared with plain Python bit by bit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import onnxruntime

from fuzzytree.errors import LossError
from fuzzytree.exporters import RUNTIME_ERRORS, first_line, open_bare
from fuzzytree.model import Model
from fuzzytree.tactile.features import FrameProgram
from fuzzytree.tactile.features.plain import Shown, plain_shown
from fuzzytree.tactile.sensor import Cells

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.tactile.exporters.onnx_frames import Output

    Answers = dict[Output, npt.NDArray[np.generic]]


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
    for number, name, text in apart(found, made, model, frames, reject):
        yield (
            f"the onnx file of {model.name} gives other {name} than plain Python for "
            f"aimed frame {number}: {text}"
        )


def apart(
    found: Answers, made: FrameProgram, model: Model, frames: Cells, reject: float
) -> Iterator[tuple[int, Output, str]]:
    """Yield each answer that is not plain Python's: frame, output, and both in words.

    Each output of `found` has an entry for each frame.
    """
    for number, frame in enumerate(frames):
        right = plain_shown(made, model, frame, reject)
        for name, answers in found.items():
            given = np.asarray(answers[number]).tolist()
            wanted = np.asarray(_expected(model, right, name)).tolist()
            if given != wanted:
                yield number, name, f"{given}, not {wanted}"


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


def _expected(model: Model, shown: Shown, name: Output) -> object:
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
