"""Ways from the raw frame to the class: numpy, ONNX, C and plain Python, alike to call.

Each runner is prepared once and takes frames as a sensor of 8 or 16 bits sends them.
"""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.errors import install_hint
from fuzzytree.model import Model
from fuzzytree.runtimes import COMPILERS, compiled, load
from fuzzytree.tactile.exporters.c_frames import write_frames_c
from fuzzytree.tactile.features import frame_program
from fuzzytree.tactile.features.aimed import frame_type
from fuzzytree.tactile.features.plain import Shown, plain_answer, plain_features
from fuzzytree.tactile.recognition.recogniser import Recogniser
from fuzzytree.tactile.sensor import Cells, Sensor, check_frames

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray, IntArray
    from fuzzytree.tactile.exporters.onnx_frames import Output

NUMPY, ONNX, C, PLAIN = "numpy", "onnx", "c", "plain Python"

_ANSWERS: tuple[Output, ...] = ("label", "state", "rule")


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


@dataclass(frozen=True, slots=True)
class Runner:
    """One way from frames to answers.

    Attributes:
        name: As people read it.
        answer: All answers to frames. Raises TableError if they do not fit.
        call: The same without features and without looking at what comes, which must
            be as it is sent (`as_sent`): this is timed.
        bytes: The size of the file that runs; 0 if there is none.
    """

    name: str
    answer: Callable[[Cells], RunnerResult]
    call: Callable[[Cells], object]
    bytes: int = 0


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
) -> tuple[list[Runner], list[str]]:
    """Return the ways that can run here, numpy first, and what is missing for others.

    Args:
        model: A tree or a rule base whose inputs are names of features.
        sensor: Whose frames come.
        reject: As `fuzzytree.tactile.recognition.recogniser.Recogniser`.

    Returns:
        The runners, and a sentence for each that cannot run.
    """
    found, missing = [_numpy(model, sensor, reject)], list[str]()
    if all(map(importlib.util.find_spec, ("onnx", "onnxruntime"))):
        found.append(_onnx(model, sensor, reject))
    else:
        missing.append(f"onnx: not installed ({install_hint('onnx')})")
    if any(map(shutil.which, COMPILERS)):
        found.append(_c(model, sensor, reject))
    else:
        missing.append(f"c: no compiler is installed ({', '.join(COMPILERS)})")
    found.append(_plain(model, sensor, reject))
    return [_looked_at(one, sensor) for one in found], missing


def _looked_at(one: Runner, sensor: Sensor) -> Runner:
    def answer(frames: Cells) -> RunnerResult:
        return one.answer(as_sent(sensor, frames))

    return replace(one, answer=answer)


def _numpy(model: Model, sensor: Sensor, reject: float) -> Runner:
    recogniser = Recogniser(model, sensor, reject)

    def answer(frames: Cells) -> RunnerResult:
        found = recogniser(frames)
        return RunnerResult(found.features.values, found.codes, found.states, None)

    decide = load(model)

    def call(frames: Cells) -> object:
        return decide(recogniser.plan(frames).values)

    return Runner(NUMPY, answer, call)


def _plain(model: Model, sensor: Sensor, reject: float) -> Runner:
    made = frame_program(sensor, model.inputs)

    def call(frames: Cells) -> list[Shown]:
        shown: list[Shown] = []
        for frame in frames:
            values, is_pressed = plain_features(made, frame)
            one = plain_answer(model, values, is_pressed=is_pressed, reject=reject)
            shown.append(one)
        return shown

    def answer(frames: Cells) -> RunnerResult:
        shown = call(frames)
        values = np.array([one.features for one in shown], np.float64)
        return RunnerResult(
            values.reshape(len(shown), len(model.inputs)).T,
            np.array([one.code for one in shown], np.int64),
            np.array([one.state for one in shown], np.int64),
            np.array([one.rule for one in shown], np.int64),
        )

    return Runner(PLAIN, answer, call)


def _onnx(model: Model, sensor: Sensor, reject: float) -> Runner:
    from fuzzytree.exporters import open_bare
    from fuzzytree.tactile.exporters.onnx_frames import frames_at_once, write_frames

    every: tuple[Output, ...] = (*_ANSWERS, "features")
    content = write_frames(
        model, sensor, outputs=every, reject=reject, verify=False
    ).content
    bare, step = open_bare(content), frames_at_once(sensor)
    codes = {label: code for code, label in enumerate(model.classes)} | {"": -1}

    def pieces(names: list[str], frames: Cells) -> Iterator[list[object]]:
        for start in range(0, len(frames), step):
            yield [*bare(names, {"frames": frames[start : start + step]})]

    def answer(frames: Cells) -> RunnerResult:
        found = [*pieces([*every], frames)]
        if not found:
            found = [[*bare([*every], {"frames": frames})]]
        label, state, rule, features = (
            np.concatenate([np.asarray(piece[line]) for piece in found])
            for line in range(4)
        )
        numbers = np.array([codes[text] for text in label.tolist()], np.int64)
        return RunnerResult(np.ascontiguousarray(features.T), numbers, state, rule)

    def call(frames: Cells) -> None:
        for _ in pieces([*_ANSWERS], frames):
            pass

    return Runner(ONNX, answer, call, len(content))


_LOOP = """
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


def _c(model: Model, sensor: Sensor, reject: float) -> Runner:
    content = write_frames_c(model, sensor, name="model", reject=reject).content
    run = compiled(content, _LOOP, 4)

    def numbers(frames: Cells, features: FloatArray | None) -> IntArray:
        found = np.empty((3, len(frames)), np.int64)
        ends = [_at(line) for line in found]
        start = None if features is None else _at(features)
        run(_at(frames), len(frames), start, *ends)
        return found

    def answer(frames: Cells) -> RunnerResult:
        features = np.empty((len(frames), len(model.inputs)))
        codes, states, rules = numbers(frames, features)
        return RunnerResult(np.ascontiguousarray(features.T), codes, states, rules)

    return Runner(C, answer, lambda frames: numbers(frames, None), len(content))


def _at(array: npt.NDArray[np.generic]) -> int:
    return array.ctypes.data
