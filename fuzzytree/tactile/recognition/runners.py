"""Ways from raw frame to class, alike to call: numpy, ONNX, C and plain Python."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.errors import install_hint
from fuzzytree.model import Model
from fuzzytree.runtimes import COMPILERS, compiled
from fuzzytree.tactile.exporters.c_frames import write_frames_c
from fuzzytree.tactile.features import frame_program
from fuzzytree.tactile.features.aimed import frame_type
from fuzzytree.tactile.features.plain import plain_shown
from fuzzytree.tactile.recognition.recogniser import Recogniser
from fuzzytree.tactile.sensor import Cells, Sensor, check_frames

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray, IntArray
    from fuzzytree.tactile.exporters.onnx_frames import Output

NUMPY, ONNX, C, PLAIN = "numpy", "onnx", "c", "plain Python"

_OUTPUTS: tuple[Output, ...] = ("label", "state", "rule", "features")


@dataclass(frozen=True, slots=True)
class RunnerResult:
    """The answers of a runner to some frames.

    Attributes:
        features: Shape (features, frames).
        codes: Shape (frames,): the place of the class, -1 for none.
        states: Shape (frames,): a `fuzzytree.tactile.features.plain.State` each.
        rules: Shape (frames,): the rule or leaf that decides; None if not
            computed.
    """

    features: FloatArray
    codes: IntArray
    states: IntArray
    rules: IntArray | None


Runner = Callable[[Cells], RunnerResult]
"""Returns all answers to frames. Raises TableError if they do not fit."""


def as_sent(sensor: Sensor, frames: Cells) -> Cells:
    """Return frames as a sensor of 8 or 16 bits sends them, cells in 0 to `full`.

    Raises:
        TableError: If they are of another size, or no whole numbers.

    Example:
        >>> as_sent(Sensor(1, 2), np.array([[300, -1]])).tolist()
        [[[255, 0]]]
    """
    found = check_frames(sensor, frames)
    kind = frame_type(sensor)
    if found.dtype != kind:
        found = np.clip(found, 0, sensor.full).astype(kind)
    return np.ascontiguousarray(found)


def runners(
    model: Model, sensor: Sensor, reject: float = 0.0
) -> tuple[dict[str, Runner], list[str]]:
    """Return the ways that can run here, numpy first, and what is missing for others.

    Args:
        model: A tree or a rule base whose inputs are names of features.
        sensor: Whose frames come.
        reject: As `fuzzytree.tactile.recognition.recogniser.Recogniser`.

    Returns:
        The runners by name, and a sentence for each that cannot run.
    """
    makers = {NUMPY: _numpy}
    missing: list[str] = []
    if all(map(importlib.util.find_spec, ("onnx", "onnxruntime"))):
        makers[ONNX] = _onnx
    else:
        missing.append(f"onnx: not installed ({install_hint('onnx')})")
    if any(map(shutil.which, COMPILERS)):
        makers[C] = _c
    else:
        missing.append(f"c: no compiler is installed ({', '.join(COMPILERS)})")
    makers[PLAIN] = _plain
    found = {name: make(model, sensor, reject) for name, make in makers.items()}
    return {
        name: partial(_checked, run, sensor) for name, run in found.items()
    }, missing


def _checked(run: Runner, sensor: Sensor, frames: Cells) -> RunnerResult:
    return run(as_sent(sensor, frames))


def _numpy(model: Model, sensor: Sensor, reject: float) -> Runner:
    recogniser = Recogniser(model, sensor, reject)

    def run(frames: Cells) -> RunnerResult:
        found = recogniser(frames)
        return RunnerResult(found.features.values, found.codes, found.states, None)

    return run


def _plain(model: Model, sensor: Sensor, reject: float) -> Runner:
    made = frame_program(sensor, model.inputs)

    def run(frames: Cells) -> RunnerResult:
        shown = [plain_shown(made, model, frame, reject) for frame in frames]
        values = np.array([one.features for one in shown], np.float64)
        return RunnerResult(
            values.reshape(len(shown), len(model.inputs)).T,
            np.array([one.code for one in shown], np.int64),
            np.array([one.state for one in shown], np.int64),
            np.array([one.rule for one in shown], np.int64),
        )

    return run


def _onnx(model: Model, sensor: Sensor, reject: float) -> Runner:
    from fuzzytree.exporters import open_bare
    from fuzzytree.tactile.exporters.onnx_frames import frames_at_once, write_frames

    written = write_frames(model, sensor, outputs=_OUTPUTS, reject=reject, verify=False)
    bare, step = open_bare(written.content), frames_at_once(sensor)
    codes = {label: code for code, label in enumerate(model.classes)} | {"": -1}

    def run(frames: Cells) -> RunnerResult:
        pieces = [
            bare([*_OUTPUTS], {"frames": frames[start : start + step]})
            for start in range(0, max(len(frames), 1), step)
        ]
        label, state, rule, features = map(np.concatenate, zip(*pieces, strict=True))
        numbers = np.array([codes[text] for text in label.tolist()], np.int64)
        return RunnerResult(np.ascontiguousarray(features.T), numbers, state, rule)

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
    many = compiled(content, LOOP, 4)

    def run(frames: Cells) -> RunnerResult:
        features = np.empty((len(frames), len(model.inputs)))
        found = np.empty((3, len(frames)), np.int64)
        ends = [array.ctypes.data for array in (features, *found)]
        many(frames.ctypes.data, len(frames), *ends)
        return RunnerResult(np.ascontiguousarray(features.T), *found)

    return run
