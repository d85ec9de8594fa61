"""Ways from raw frame to class, alike to call: plain Python, numpy, C and ONNX."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from fuzzytree.errors import ReadError, install_hint
from fuzzytree.model import Model
from fuzzytree.runtimes import COMPILERS, compiled, open_session, parsed
from fuzzytree.tactile.exporters.c_frames import write_frames_c
from fuzzytree.tactile.exporters.onnx_frames import Output, write_frames
from fuzzytree.tactile.features import frame_program
from fuzzytree.tactile.features.plain import plain_shown
from fuzzytree.tactile.recognition.recogniser import Recogniser
from fuzzytree.tactile.sensor import Cells, Sensor, check_frames

if TYPE_CHECKING:
    import numpy.typing as npt

NUMPY, ONNX, C, PLAIN = "numpy", "onnx", "c", "plain Python"

_FRAMES_AT_ONCE = 2**12  # in one call of a graph
_OUTPUTS: tuple[Output, ...] = ("label", "state", "rule", "features")

Answers = Mapping[Output, "npt.NDArray[Any]"]
"""What frames show: some outputs of a graph of frames, each with an entry a frame."""

Runner = Callable[[Cells], Answers]
"""Returns the answers to frames of the sensor's type, which lie in C order."""


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
    model: Model,
    sensor: Sensor,
    reject: float = 0.0,
    files: Mapping[str, bytes] | None = None,
) -> tuple[dict[str, Runner], list[str]]:
    """Return the ways that can run here, by name, and a sentence for each other one.

    Of the ONNX files there is one that is written now unless some are given.

    Raises:
        ReadError: If onnxruntime does not load a file.
    """
    found, missing = {NUMPY: _numpy(model, sensor, reject)}, list[str]()
    if any(map(shutil.which, COMPILERS)):
        found[C] = _c(model, sensor, reject)
    else:
        missing.append(f"c: no compiler is installed ({', '.join(COMPILERS)})")
    if not all(map(importlib.util.find_spec, ("onnx", "onnxruntime"))):
        missing.append(f"onnx: not installed ({install_hint('onnx')})")
    elif not files:
        written = write_frames(model, sensor, outputs=_OUTPUTS, reject=reject)
        files = {ONNX: written.content}
    for name, content in (files or {}).items():
        found[name] = _graph(content, name)
    return found, missing


def plain_runner(model: Model, sensor: Sensor, reject: float) -> Runner:
    """Return the reference of the others."""
    made, labels = frame_program(sensor, model.inputs), _labels(model)

    def run(frames: Cells) -> Answers:
        shown = [plain_shown(made, model, frame, reject) for frame in frames]
        return {
            "label": labels[[one.code for one in shown]],
            "state": np.array([one.state for one in shown], np.int64),
            "rule": np.array([one.rule for one in shown], np.int64),
            "features": np.array([one.features for one in shown], np.float64),
            "strengths": np.array([one.strengths for one in shown], np.float64),
        }

    return run


def _labels(model: Model) -> npt.NDArray[np.object_]:
    """Return the labels of codes; that of -1, the last one, is empty."""
    return np.array([*model.classes, ""], np.object_)


def _numpy(model: Model, sensor: Sensor, reject: float) -> Runner:
    recogniser, labels = Recogniser(model, sensor, reject), _labels(model)

    def run(frames: Cells) -> Answers:
        found = recogniser(frames)
        return {
            "label": labels[found.codes],
            "state": found.states,
            "rule": found.rules,
            "features": found.features.values.T,
        }

    return run


def _graph(content: bytes, name: str) -> Runner:
    """Return what runs an ONNX file of frames, all of its outputs.

    Raises:
        ReadError: If it takes or gives something else, or onnxruntime does not load it;
            the runner raises it if onnxruntime does not run it, or if it has no answer
            for a frame.
    """
    from fuzzytree.exporters import RUNTIME_ERRORS, first_line

    proto = parsed(content, name)
    bare = open_session(proto, name, _FRAMES_AT_ONCE)
    outputs: list[Any] = [entry.name for entry in proto.graph.output]
    is_known = 0 < len(outputs) == len({*outputs} & {*get_args(Output)})
    if not is_known or [entry.name for entry in proto.graph.input] != ["frames"]:
        text = "the graph's inputs and outputs are not those of frames"
        raise ReadError(f"{name}: {text}")

    def run(frames: Cells) -> Answers:
        try:
            starts = range(0, max(len(frames), 1), _FRAMES_AT_ONCE)
            parts = [
                bare(outputs, {"frames": frames[start : start + _FRAMES_AT_ONCE]})
                for start in starts
            ]
        except RUNTIME_ERRORS as error:
            text = f"{name}: onnxruntime does not run it: {first_line(error)}"
            raise ReadError(text) from error
        found = [np.concatenate(arrays) for arrays in zip(*parts, strict=True)]
        if any(one.shape[:1] != (len(frames),) for one in found):
            raise ReadError(f"{name}: it does not give an answer for each frame")
        return dict(zip(outputs, found, strict=True))

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
        features = np.empty((len(frames), len(model.inputs)))
        codes, state, rule = found = np.empty((3, len(frames)), np.int64)
        ends = [array.ctypes.data for array in (features, *found)]
        many(frames.ctypes.data, len(frames), *ends)
        label = labels[codes]
        return {"label": label, "state": state, "rule": rule, "features": features}

    return run
