"""Ways from raw frame to class, alike to call: numpy, ONNX, C and plain Python."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.errors import ReadError, install_hint
from fuzzytree.model import Model
from fuzzytree.runtimes import COMPILERS, compiled, loaded
from fuzzytree.tactile.exporters.c_frames import write_frames_c
from fuzzytree.tactile.exporters.onnx_frames import (
    Output,
    frames_at_once,
    write_frames,
)
from fuzzytree.tactile.features import frame_program
from fuzzytree.tactile.features.plain import plain_shown
from fuzzytree.tactile.recognition.recogniser import Recogniser
from fuzzytree.tactile.sensor import Cells, Sensor, check_frames

if TYPE_CHECKING:
    import numpy.typing as npt

NUMPY, ONNX, C, PLAIN = "numpy", "onnx", "c", "plain Python"

_OUTPUTS: tuple[Output, ...] = ("label", "state", "rule", "features")

Answers = Mapping[Output, "npt.NDArray[Any]"]
"""What frames show: some outputs of a graph of frames, each with an entry a frame."""

Runner = Callable[[Cells], Answers]
"""Returns the answers to frames. Raises TableError if they do not fit."""


def as_sent(sensor: Sensor, frames: Cells) -> Cells:
    """Return frames as a sensor of 8 or 16 bits sends them, cells in 0 to `full`.

    Raises:
        TableError: If they are of another size, or no whole numbers.

    Example:
        >>> as_sent(Sensor(1, 2), np.array([[300, -1]])).tolist()
        [[[255, 0]]]
    """
    found = check_frames(sensor, frames)
    if found.dtype != sensor.dtype:
        found = np.clip(found, 0, sensor.full).astype(sensor.dtype)
    return np.ascontiguousarray(found)


def runners(
    model: Model, sensor: Sensor, reject: float = 0.0, *, graph: bytes | None = None
) -> tuple[dict[str, Runner], list[str]]:
    """Return the ways that can run here, numpy first, and what is missing for others.

    Args:
        model: A tree or a rule base whose inputs are names of features.
        sensor: Whose frames come.
        reject: As `fuzzytree.tactile.recognition.recogniser.Recogniser`.
        graph: The ONNX file to run; one that is written now if None.

    Returns:
        The runners by name, and a sentence for each that cannot run.
    """
    found = {NUMPY: _numpy(model, sensor, reject)}
    missing: list[str] = []
    if all(map(importlib.util.find_spec, ("onnx", "onnxruntime"))):
        content = graph
        if content is None:
            written = write_frames(model, sensor, outputs=_OUTPUTS, reject=reject)
            content = written.content
        found[ONNX] = graph_runner(content, f"{model.name} as onnx", sensor)
    else:
        missing.append(f"onnx: not installed ({install_hint('onnx')})")
    if any(map(shutil.which, COMPILERS)):
        found[C] = _c(model, sensor, reject)
    else:
        missing.append(f"c: no compiler is installed ({', '.join(COMPILERS)})")
    found[PLAIN] = plain_runner(model, sensor, reject)
    return found, missing


def _numpy(model: Model, sensor: Sensor, reject: float) -> Runner:
    recogniser, labels = Recogniser(model, sensor, reject), _labels(model)

    def run(frames: Cells) -> Answers:
        found = recogniser(as_sent(sensor, frames))
        return {
            "label": labels[found.codes],
            "state": found.states,
            "rule": found.rules,
            "features": found.features.values.T,
        }

    return run


def plain_runner(model: Model, sensor: Sensor, reject: float) -> Runner:
    """Return the reference of the others."""
    made, labels = frame_program(sensor, model.inputs), _labels(model)

    def run(frames: Cells) -> Answers:
        sent = as_sent(sensor, frames)
        shown = [plain_shown(made, model, frame, reject) for frame in sent]
        codes = np.array([one.code for one in shown], np.int64)
        return {
            "label": labels[codes],
            "state": np.array([one.state for one in shown], np.int64),
            "rule": np.array([one.rule for one in shown], np.int64),
            "features": _table([one.features for one in shown]),
            "strengths": _table([one.strengths for one in shown]),
        }

    return run


def _table(rows: Sequence[tuple[float, ...]]) -> npt.NDArray[np.float64]:
    width = len(rows[0]) if rows else 0
    return np.array(rows, np.float64).reshape(len(rows), width)


def _labels(model: Model) -> npt.NDArray[np.object_]:
    """Return the labels of codes; that of -1, the last one, is empty."""
    return np.array([*model.classes, ""], np.object_)


def graph_runner(content: bytes, name: str, sensor: Sensor) -> Runner:
    """Return what runs an ONNX file of frames, all of its outputs.

    Raises:
        ReadError: If onnxruntime does not load the file; the runner raises it if
            onnxruntime does not run it, or if it has no answer for a frame.
    """
    import onnx

    from fuzzytree.exporters import RUNTIME_ERRORS, first_line

    bare, step = loaded(content, name), frames_at_once(sensor)
    proto = onnx.load_model_from_string(content)
    outputs: list[Any] = [entry.name for entry in proto.graph.output]

    def run(frames: Cells) -> Answers:
        sent = as_sent(sensor, frames)
        parts = [sent[k : k + step] for k in range(0, max(len(sent), 1), step)]
        try:
            found = [bare(outputs, {"frames": part}) for part in parts]
        except RUNTIME_ERRORS as error:
            text = f"{name}: onnxruntime does not run it: {first_line(error)}"
            raise ReadError(text) from error
        pieces = [[*map(np.asarray, one)] for one in found]
        for part, piece in zip(parts, pieces, strict=True):
            if any(one.shape[:1] != (len(part),) for one in piece):
                raise ReadError(f"{name}: it does not give an answer for each frame")
        arrays: list[Any] = list(map(np.concatenate, zip(*pieces, strict=True)))
        return dict(zip(outputs, arrays, strict=True))

    return run


LOOP = """
#include <stddef.h>

extern void model_many(const model_cell *frame, size_t frames, double *features,
    int64_t *label, int64_t *state, int64_t *rule)
{
    size_t place;
    for (place = 0; place < frames; place++) {
        model_recognition found = model_recognise(frame);
        if (features)
            model_features(frame, features + place * MODEL_INPUTS);
        label[place] = found.label;
        state[place] = found.state;
        rule[place] = found.rule;
        frame += MODEL_ROWS * MODEL_COLUMNS;
    }
}
"""
"""C that recognises many frames, for a file whose names begin with `model`."""


def _c(model: Model, sensor: Sensor, reject: float) -> Runner:
    content = write_frames_c(model, sensor, name="model", reject=reject).content
    many, labels = compiled(content, LOOP, 4), _labels(model)

    def run(frames: Cells) -> Answers:
        sent = as_sent(sensor, frames)
        features = np.empty((len(sent), len(model.inputs)))
        codes, state, rule = found = np.empty((3, len(sent)), np.int64)
        ends = [array.ctypes.data for array in (features, *found)]
        many(sent.ctypes.data, len(sent), *ends)
        label = labels[codes]
        return {"label": label, "state": state, "rule": rule, "features": features}

    return run
