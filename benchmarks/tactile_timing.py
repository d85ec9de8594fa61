"""From frame to class: what each way costs, and how far it is from exact arithmetic."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import partial

import msgspec
import numpy as np
from exact_features import errors, exact_features

from fuzzytree.benchmarking.clock import Call, time_calls
from fuzzytree.benchmarking.machine import after, machine
from fuzzytree.benchmarking.records import Machine, Timing
from fuzzytree.exporters import open_bare
from fuzzytree.model.contracts import Model, Progress
from fuzzytree.model.rulebase import RuleBase, fingerprint
from fuzzytree.runtimes import compiled, load
from fuzzytree.tactile.exporters.c_frames import write_frames_c
from fuzzytree.tactile.exporters.onnx_frames import (
    USUAL,
    frames_at_once,
    write_frames,
)
from fuzzytree.tactile.features import frame_program
from fuzzytree.tactile.features.aimed import aimed_frames
from fuzzytree.tactile.features.plain import plain_answer, plain_shown
from fuzzytree.tactile.recognition.recogniser import Recogniser, check_inputs
from fuzzytree.tactile.recognition.runners import (
    LOOP,
    NUMPY,
    ONNX,
    PLAIN,
    Answers,
    C,
    Runner,
    as_sent,
    plain_runner,
    runners,
)
from fuzzytree.tactile.sensor import Cells, Sensor, pressed

Step = Callable[[Cells], object]
"""Recognises frames; this is timed."""

STRENGTHS = "numpy with strengths"
COPY = "floor: the frames copied"
SESSION = "floor: an empty session call"

_MOST_EXACT = 200
_MOST_PLAIN = 1_000  # frames in a call of plain Python


class Point(msgspec.Struct, frozen=True):
    """A way from frame to class, measured.

    Attributes:
        name: As people read it.
        timings: One for each number of frames in a call.
        bytes: The size of the file that runs; 0 if there is none.
        error: The largest error of a feature, as a share of its scale
            (`exact_features.errors`); None for a floor.
        flips: Frames whose class is not that of the exact features, rounded once.
    """

    name: str
    timings: tuple[Timing, ...]
    bytes: int = 0
    error: float | None = None
    flips: int = 0


class FramesStudy(msgspec.Struct, frozen=True):
    """Error against run time, from frame to class.

    Attributes:
        model: The model's name.
        fingerprint: The SHA-256 of its content.
        features: What it asks for.
        sensor: Whose frames they are.
        data: What the frames are: a file's name, or how they were made.
        judged: How many frames the errors are of.
        machine: Where it was measured.
        points: What was measured, floors at the end.
        omissions: What was left out and why, in sentences.
        seed: Of the order of the rounds.
        seconds: What the whole study took.
        is_complete: False if the time ran out or the user ended it.
    """

    model: str
    fingerprint: str
    features: tuple[str, ...]
    sensor: Sensor
    data: str
    judged: int
    machine: Machine
    points: tuple[Point, ...]
    omissions: tuple[str, ...]
    seed: int
    seconds: float
    is_complete: bool


def time_frames(
    model: Model,
    sensor: Sensor,
    frames: Cells | None = None,
    *,
    data: str = "",
    rows: Sequence[int] = (1, 10_000),
    reject: float = 0.0,
    rounds: int = 15,
    seconds: float = 120.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> FramesStudy:
    """Measure every way from frame to class, in interleaved rounds, on one thread.

    Args:
        model: A tree or a rule base whose inputs are names of features.
        sensor: Whose frames come.
        frames: Shape (frames, rows, columns); made ones if none.
        data: What they are, for the record.
        rows: How many frames there are in a call.
        reject: Of raw rules: what is weaker in the rule that decides is unknown.
        rounds: The most samples of each call.
        seconds: For all of it, about.
        seed: Of the order of the rounds, and of made frames.
        progress: Told how far it is.

    Raises:
        TableError: If the model asks for other features, or frames do not fit.
        ValueError: If there is no frame, or no number of frames.
    """
    begin = time.perf_counter()
    check_inputs(model)
    if frames is None:
        frames, data = aimed_frames(sensor, 200, seed), f"made frames, seed {seed}"
    given = as_sent(sensor, frames)
    if not len(given) or not rows or min(rows) < 1:
        raise ValueError("there is no frame to measure with")
    before = machine(["onnx", "onnxruntime"])
    ways, omissions = runners(model, sensor, reject)
    ways[PLAIN] = plain_runner(model, sensor, reject)
    steps, sizes = _steps(model, sensor, reject, ways)
    judged = _judged(model, sensor, given, ways, reject)
    if STRENGTHS in steps:
        judged[STRENGTHS] = judged[NUMPY]
    timings: dict[str, list[Timing]] = {}
    is_complete = True
    for place, count in enumerate(rows):
        calls, left_out = _calls(steps, given, count)
        omissions += left_out
        share = (seconds - (time.perf_counter() - begin)) / (len(rows) - place)
        found = time_calls(
            calls,
            rows=count,
            rounds=rounds,
            seconds=max(share, 1e-3),
            seed=seed,
            progress=progress,
        )
        for error in found.failures.values():
            raise error
        is_complete = is_complete and found.is_complete
        for name, one in found.timings.items():
            timings.setdefault(name, []).append(one)
    points = tuple(
        Point(name, tuple(own), sizes.get(name, 0), *judged.get(name, (None, 0)))
        for name, own in timings.items()
    )
    return FramesStudy(
        model.name,
        fingerprint(model),
        model.inputs,
        sensor,
        data,
        min(len(given), _MOST_EXACT),
        after(before, [one for point in points for one in point.timings]),
        points,
        tuple(dict.fromkeys(omissions)),
        seed,
        time.perf_counter() - begin,
        is_complete,
    )


def _steps(
    model: Model, sensor: Sensor, reject: float, ways: Iterable[str]
) -> tuple[dict[str, Step], dict[str, int]]:
    """Return what is timed of each way, without its features, and the size of its file.

    A step takes frames as they are sent (`as_sent`), and does not look at them.
    """
    recogniser, decide = Recogniser(model, sensor, reject), load(model)
    made = frame_program(sensor, model.inputs)
    found: dict[str, Step] = {
        NUMPY: lambda frames: decide(recogniser.plan(frames).values)
    }
    sizes: dict[str, int] = {}
    if not isinstance(model, RuleBase):  # rules have no prediction without strengths
        found[STRENGTHS] = recogniser
    if ONNX in ways:
        content = write_frames(model, sensor, reject=reject).content
        bare, size = open_bare(content), frames_at_once(sensor)
        sizes[ONNX] = len(content)

        def graph(frames: Cells) -> None:
            for start in range(0, len(frames), size):
                bare([*USUAL], {"frames": frames[start : start + size]})

        found[ONNX] = graph
    if C in ways:
        content = write_frames_c(model, sensor, name="model", reject=reject).content
        many = compiled(content, LOOP, 4)
        sizes[C] = len(content)

        def loop(frames: Cells) -> None:
            found = np.empty((3, len(frames)), np.int64)  # lives until the loop ended
            ends = [line.ctypes.data for line in found]
            many(frames.ctypes.data, len(frames), None, *ends)

        found[C] = loop
    found[PLAIN] = lambda frames: [
        plain_shown(made, model, frame, reject) for frame in frames
    ]
    return found, sizes


def _calls(
    steps: Mapping[str, Step], frames: Cells, count: int
) -> tuple[dict[str, Call], list[str]]:
    """Return what is timed for so many frames in a call, and what is left out."""
    many = np.ascontiguousarray(frames.take(np.arange(count) % len(frames), axis=0))
    calls: dict[str, Call] = {}
    omissions: list[str] = []
    for name, step in steps.items():
        if name == PLAIN and count > _MOST_PLAIN:
            omissions.append(
                f"{PLAIN}: {count:,} frames in a call; it takes them one by one"
            )
        else:
            calls[name] = partial(step, many)
    calls[COPY] = many.copy
    if all(map(importlib.util.find_spec, ("onnx", "onnxruntime"))):
        calls[SESSION] = _empty_session(many)
    return calls, omissions


def _empty_session(frames: Cells) -> Callable[[], object]:
    """Return the call of a session that hands the same frames back."""
    from onnx import helper

    kind = helper.np_dtype_to_tensor_dtype(frames.dtype)
    shapes = [
        helper.make_tensor_value_info(name, kind, ["frames", "rows", "columns"])
        for name in ("frames", "same")
    ]
    node = helper.make_node("Identity", ["frames"], ["same"])
    graph = helper.make_graph([node], "empty", shapes[:1], shapes[1:])
    imports = [helper.make_opsetid("", 17)]
    made = helper.make_model(graph, ir_version=8, opset_imports=imports)
    bare = open_bare(made.SerializeToString())
    return partial(bare, ["same"], {"frames": frames})


def _judged(
    model: Model,
    sensor: Sensor,
    frames: Cells,
    ways: Mapping[str, Runner],
    reject: float,
) -> dict[str, tuple[float, int]]:
    """Return the largest error and the flips of each way, on some of the frames."""
    some = frames[:_MOST_EXACT]
    exact = [exact_features(sensor, frame, model.inputs) for frame in some]
    labels = [*model.classes, ""]
    right = [
        plain_answer(
            model,
            [float(value) for value in values],
            is_pressed=bool(pressed(sensor, frame).any()),
            reject=reject,
        )
        for frame, values in zip(some, exact, strict=True)
    ]
    wanted = np.array([labels[one.code] for one in right], np.object_)
    found: dict[str, tuple[float, int]] = {}
    for name, run in ways.items():
        answers = run(some)
        largest = _largest(model, sensor, some, answers, exact)
        found[name] = largest, int((answers["label"] != wanted).sum())
    return found


def _largest(
    model: Model,
    sensor: Sensor,
    frames: Cells,
    found: Answers,
    exact: Sequence[Sequence[Fraction]],
) -> float:
    shares = [
        errors(sensor, frame, model.inputs, values, right)
        for frame, values, right in zip(
            frames, found["features"].tolist(), exact, strict=True
        )
    ]
    return max((share for one in shares for share in one), default=0.0)
