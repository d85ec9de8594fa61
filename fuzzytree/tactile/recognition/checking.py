"""Do all implementations from frame to class give the bits and classes of plain Python?

They are numpy, C and ONNX: a graph that is written now, or files that were shipped,
whose metadata and nodes are compared as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import msgspec
import numpy as np

from fuzzytree.checking import counted, judged
from fuzzytree.errors import InvalidModelError, ReadError
from fuzzytree.model import Agreement, Comparison, Model, fingerprint
from fuzzytree.runtimes import parsed, texts_of
from fuzzytree.tactile.exporters.onnx_frames import write_frames
from fuzzytree.tactile.features import frame_program
from fuzzytree.tactile.features.aimed import proving_frames
from fuzzytree.tactile.recognition.recogniser import check_inputs
from fuzzytree.tactile.recognition.runners import (
    PLAIN,
    Answers,
    as_sent,
    plain_runner,
    runners,
)
from fuzzytree.tactile.sensor import Cells, Sensor

_MOST_CELLS = 2**22  # of frames for plain Python, about a minute


def check_frames(
    model: Model,
    sensor: Sensor | None,
    frames: Cells | None = None,
    *,
    files: Mapping[str, bytes] | None = None,
    reject: float = 0.0,
    rows_only: bool = False,
) -> Agreement:
    """Compare every implementation that can run here with plain Python, bit by bit.

    Args:
        model: A tree or a rule base whose inputs are names of features.
        sensor: Whose frames come; the one that the first of the files states if None.
        frames: Shape (frames, rows, columns); beside the aimed ones.
        files: ONNX files of the model by name; one is written now if there are none.
        reject: Of raw rules: what is weaker in the rule that decides is unknown.
        rows_only: Whether files whose answers agree are accepted with another graph.

    Raises:
        TableError: If an input of the model is no feature, or frames do not fit.
        InvalidModelError: If a feature is beyond the sensor.
        ReadError: If a file is no graph of frames, or onnxruntime does not load it.
        MissingExtraError: If there are files, and onnx is not installed.
        ValueError: If the model has no strengths to reject by.

    Example:
        >>> from fuzzytree import learn, table
        >>> areas = np.array([[4.0], [5.0], [16.0], [15.0]])
        >>> tree = learn(table(areas, columns=["area"]), target=["s", "s", "l", "l"])
        >>> content = write_frames(tree, Sensor(4, 4)).content
        >>> check_frames(tree, Sensor(4, 4), files={"tree.onnx": content}).ok
        True
    """
    check_inputs(model)
    files, skipped = files or {}, list[str]()
    stated = {name: _stated_sensor(content, name) for name, content in files.items()}
    if sensor is None:
        name, sensor = next(iter(stated.items()))
        skipped.append(
            f"{name}: its sensor, which is {sensor.rows} x {sensor.columns} cells up "
            f"to {sensor.full}, threshold {sensor.threshold}; name the right one with "
            "--sensor or --board"
        )
    rows = aimed = proving_frames(frame_program(sensor, model.inputs), model)
    if frames is not None:
        rows = np.concatenate([aimed, as_sent(sensor, frames)])
    most = _MOST_CELLS // rows[0].size
    if len(rows) > most:
        skipped.append(f"{len(rows) - most} frames, to save time")
        rows = rows[:most]
    ways, missing = runners(model, sensor, reject, files)
    right = plain_runner(model, sensor, reject)(rows)
    comparisons: list[Comparison] = []
    for name, run in ways.items():
        try:
            faults = [*_faults(run(rows), right)]
        except ReadError as error:  # onnxruntime loads the file, and cannot run it
            faults = [str(error)]
        answers = counted("rows", name, PLAIN, len(rows), faults)
        if name in files:
            from fuzzytree.exporters import differences

            graph, metadata = differences(
                files[name], model, write_frames, sensor=sensor, reject=reject
            )
            comparisons += [
                counted("file", name, "the model's metadata", 1, metadata),
                judged(name, "a freshly written graph", graph, [answers]),
            ]
        comparisons.append(answers)
    return Agreement(
        model.name,
        fingerprint(model),
        tuple(comparisons),
        skipped=(*skipped, *missing),
        probes=min(len(aimed), most),
        rows_only=rows_only,
    )


def _stated_sensor(content: bytes, name: str) -> Sensor:
    """Return the sensor that an ONNX file of frames states.

    Raises:
        ReadError: If it is no such file.
        MissingExtraError: If onnx or onnxruntime is not installed.
    """
    texts = texts_of(parsed(content, name), name)
    if texts.get("carrier") != "frames":
        raise ReadError(
            f"{name}: the file takes rows, and not frames of a sensor; "
            "`fuzzytree check` checks it"
        )
    try:
        return msgspec.json.decode(texts.get("sensor", ""), type=Sensor)
    except (msgspec.MsgspecError, InvalidModelError, RecursionError) as error:
        raise ReadError(f"{name}: the file's sensor is none: {error}") from error


def _faults(found: Answers, right: Answers) -> Iterator[str]:
    """Yield what differs in a frame, a sentence for each frame; 0.0 is not -0.0."""
    one, two = (
        zip(*(a[n].tolist() for n in found), strict=True) for a in (found, right)
    )
    for place, pair in enumerate(zip(one, two, strict=True)):
        if repr(pair[0]) != repr(pair[1]):
            each = zip(found, *pair, strict=True)
            texts = [f"{n} {a!r}, not {b!r}" for n, a, b in each if repr(a) != repr(b)]
            yield f"frame {place}: {'; '.join(texts)}"
