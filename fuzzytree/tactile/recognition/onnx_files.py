"""Check of ONNX files of frames against their model."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING

import msgspec

from fuzzytree.checking import counted, judged
from fuzzytree.errors import InvalidModelError, ReadError
from fuzzytree.model import Agreement, Comparison, FuzzyTree, Model, fingerprint
from fuzzytree.runtimes import parsed, texts_of
from fuzzytree.tactile.exporters.onnx_frames import Output, write_frames
from fuzzytree.tactile.recognition.agreement import compared, proving_rows
from fuzzytree.tactile.recognition.recogniser import check_inputs
from fuzzytree.tactile.recognition.runners import PLAIN, graph_runner, plain_runner
from fuzzytree.tactile.sensor import Cells, Sensor

if TYPE_CHECKING:
    from fuzzytree.exporters import Differences

_RECORDS = ("sensor", "features", "classes", "outputs", "reject")
_MOST_CELLS = 2**22  # of frames for plain Python, about a minute


class FramesFile(msgspec.Struct, frozen=True, kw_only=True):
    """What an ONNX file of frames says about itself.

    Attributes:
        name: Of the model.
        version: Of the fuzzytree that wrote it.
        fingerprint: Of the model.
        sensor: Whose frames it takes.
        features: What it computes of them.
        classes: The possible answers.
        outputs: What it gives.
        reject: What is weaker in the rule that decides is unknown.
    """

    name: str
    version: str
    fingerprint: str
    sensor: Sensor
    features: tuple[str, ...]
    classes: tuple[str, ...]
    outputs: tuple[Output, ...]
    reject: float = 0.0


def frames_file(content: bytes, name: str) -> FramesFile:
    """Return what an ONNX file of frames says about itself.

    Raises:
        ReadError: If it is no such file.
        MissingExtraError: If onnx or onnxruntime is not installed.
    """
    proto = parsed(content, name)
    texts = texts_of(proto, name)
    if texts.get("carrier") != "frames":
        raise ReadError(
            f"{name}: the file takes rows, and not frames of a sensor; "
            "`fuzzytree check` checks it"
        )
    try:
        known = {k: json.loads(v) if k in _RECORDS else v for k, v in texts.items()}
        found = msgspec.convert(known, FramesFile)
    except (json.JSONDecodeError, msgspec.ValidationError, RecursionError) as error:
        raise ReadError(f"{name}: the file's metadata is broken: {error}") from error
    except InvalidModelError as error:
        raise ReadError(f"{name}: the file's sensor is none: {error}") from error
    given = [entry.name for entry in proto.graph.input]
    outputs = tuple(entry.name for entry in proto.graph.output)
    if given != ["frames"] or outputs != found.outputs:
        raise ReadError(
            f"{name}: the graph's inputs and outputs are not those of its metadata"
        )
    return found


def check_onnx_files(
    model: Model,
    files: Mapping[str, bytes],
    frames: Cells | None = None,
    *,
    sensor: Sensor | None = None,
    reject: float = 0.0,
    rows_only: bool = False,
) -> Agreement:
    """Compare ONNX files of frames with a model: metadata, graph and predictions.

    Args:
        model: A tree or a rule base whose inputs are names of features.
        files: The files by name; each may be of a sensor of its own.
        frames: Shape (frames, rows, columns); beside the aimed ones.
        sensor: The one that each file must state; any if None.
        reject: The reject that each file must state.
        rows_only: Whether files whose answers agree are accepted with another graph.

    Raises:
        ReadError: If a file is no graph of frames, or does not run.
        TableError: If an input of the model is no feature, or frames do not fit.
        MissingExtraError: If onnx or onnxruntime is not installed.

    Example:
        >>> import numpy as np
        >>> from fuzzytree import learn, table
        >>> areas = np.array([[4.0], [5.0], [16.0], [15.0]])
        >>> tree = learn(table(areas, columns=["area"]), target=["s", "s", "l", "l"])
        >>> content = write_frames(tree, Sensor(4, 4)).content
        >>> check_onnx_files(tree, {"tree.onnx": content}).ok
        True
    """
    check_inputs(model)
    comparisons: list[Comparison] = []
    skipped: list[str] = []
    probes = 0
    for name, content in files.items():
        known = frames_file(content, name)
        if sensor is None:
            skipped.append(
                f"{name}: its sensor, which is {_sensor_text(known.sensor)}; "
                "name the right one with --sensor or --board"
            )
        if known.features != model.inputs or known.classes != model.classes:
            features, classes = ", ".join(known.features), ", ".join(known.classes)
            text = f"it uses {features}, and has the classes {classes}"
            against = "the model's features and classes"
            comparisons.append(counted("file", name, against, 1, (text,)))
            continue
        rows, aimed = proving_rows(model, known.sensor, frames)
        some = rows[: _MOST_CELLS // rows[0].size]
        if len(some) < len(rows):
            skipped.append(f"{name}: {len(rows) - len(some)} frames, to save time")
        probes += aimed
        stated: list[str] = []
        if sensor is not None and known.sensor != sensor:
            own, other = _sensor_text(known.sensor), _sensor_text(sensor)
            stated.append(f"its sensor is {own}, not {other}")
        if known.reject != reject:
            stated.append(f"its reject is {known.reject!r}, not {reject!r}")
        graph, metadata = _differences(model, known, content)
        run = graph_runner(content, name, known.sensor)
        right = plain_runner(model, known.sensor, known.reject)(some)
        answers = compared(name, run(some), PLAIN, right, model)
        comparisons += [
            counted("file", name, "the model's metadata", 1, (*metadata, *stated)),
            judged(name, "a freshly written graph", graph, [answers]),
            answers,
        ]
    return Agreement(
        model.name,
        fingerprint(model),
        tuple(comparisons),
        skipped=tuple(skipped),
        probes=probes,
        rows_only=rows_only,
    )


def _sensor_text(sensor: Sensor) -> str:
    text = f"{sensor.rows} x {sensor.columns} cells up to {sensor.full}"
    text += f", threshold {sensor.threshold}"
    extras = (("baseline", sensor.baseline), ("masked cells", sensor.masked))
    return text + "".join(f", with {name}" for name, value in extras if value)


def _differences(model: Model, known: FramesFile, content: bytes) -> Differences:
    """Compare the file with the one that the model gives now."""
    import onnx

    from fuzzytree.exporters import TREES, Differences, proto_differences

    proto = onnx.load_model_from_string(content)
    versions = {one.domain: one.version for one in proto.opset_import}
    try:
        fresh = write_frames(
            model,
            known.sensor,
            outputs=known.outputs,
            reject=known.reject,
            opset=versions.get("", 0),
            ir=proto.ir_version,
            plain=isinstance(model, FuzzyTree) and TREES not in versions,
        ).content
    except ValueError as error:
        return Differences((str(error),), ())
    return proto_differences(onnx.load_model_from_string(fresh), proto)
