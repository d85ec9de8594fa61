"""ONNX: one graph from the raw frame to what lies on the sensor.

The cells become exact sums by one product of matrices, these become the features by
the steps of their program, and the model's own graph decides. All numbers up to the
sums are whole and below 2^53 (`frame_program` refuses other sensors), so in whatever
order a library adds, the sums have the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from fuzzytree.exporters import check_outputs, check_versions, facts_of, require
from fuzzytree.model import FuzzyTree, Model, Written, kind_of
from fuzzytree.tactile.features import FrameProgram, Sum, frame_program
from fuzzytree.tactile.features.plain import State, check_reject
from fuzzytree.tactile.sensor import Sensor, offsets

if TYPE_CHECKING:
    from fuzzytree.exporters import InputBlock, OnnxGraph

Output = Literal["label", "state", "rule", "features", "strengths"]

USUAL: tuple[Output, ...] = ("label", "state", "rule")

_NUMBERS_AT_ONCE = 2**16  # of the cells of frames that are best run together


def write_frames(
    model: Model,
    sensor: Sensor,
    *,
    outputs: Sequence[Output] = USUAL,
    reject: float = 0.0,
    opset: int = 17,
    ir: int = 8,
    plain: bool = False,
) -> Written:
    """Write a graph that takes raw frames and gives what lies on the sensor.

    The input is `frames`, of shape (frames, rows, columns), uint8, or uint16 for a
    sensor of 16 bits. The outputs, each with one entry per frame: `label`, the class,
    or "" where nothing presses or nothing known; `state`, a
    `fuzzytree.tactile.features.plain.State`; `rule`, the number of the rule or leaf
    that decides, from 1, or 0; `features`, of shape (frames, features); `strengths` of
    a rule base, of shape (frames, rules), 0 where nothing presses. The same model,
    sensor and options give the same bytes.

    Args:
        model: A tree or a rule base whose inputs are names of features.
        sensor: Whose frames come.
        outputs: Which outputs, in this order.
        reject: Of raw rules: what is weaker in the rule that decides is unknown.
        opset: The version of the operators, 12 to 26.
        ir: The version of the file, 4 to 13.
        plain: Whether a tree does without the operators of ai.onnx.ml.

    Raises:
        TableError: If an input of the model is no feature of a frame.
        InvalidModelError: If a feature is beyond the sensor.
        MissingExtraError: If onnx is not installed.
        ValueError: If an option is not one of those above.

    Example:
        >>> from fuzzytree import learn, table
        >>> areas = np.array([[4.0], [5.0], [16.0], [15.0]])
        >>> tree = learn(table(areas, columns=["area"]), target=["s", "s", "l", "l"])
        >>> write_frames(tree, Sensor(4, 4)).losses
        ()
    """
    check_outputs(model, outputs, get_args(Output))
    if plain and model.rules:
        raise ValueError("plain is for trees: rules never need ai.onnx.ml")
    check_versions(opset, ir)
    check_reject(model, reject)
    require("onnx", "writing onnx needs")
    from onnx import TensorProto

    from fuzzytree.exporters import OnnxGraph, model_proto

    made, sheet = frame_program(sensor, model.inputs), OnnxGraph(opset)
    _fill(sheet, made, model, outputs, reject, plain=plain)
    sheet.tensors = sheet.used()
    rules = len(model.rules)
    kinds: dict[Output, tuple[int, list[str | int]]] = {
        "label": (TensorProto.STRING, ["frames"]),
        "state": (TensorProto.INT64, ["frames"]),
        "rule": (TensorProto.INT64, ["frames"]),
        "features": (TensorProto.DOUBLE, ["frames", len(made.features)]),
        "strengths": (TensorProto.DOUBLE, ["frames", rules]),
    }
    kind = TensorProto.UINT8 if sensor.bits == 8 else TensorProto.UINT16
    proto = model_proto(
        sheet,
        "frames",
        ("frames", kind, ["frames", sensor.rows, sensor.columns]),
        {name: kinds[name] for name in outputs},
        ir=ir,
        text=_in_words(sensor, model),
        facts=_facts(sensor, model, outputs, reject),
    )
    return Written(proto.SerializeToString(deterministic=True))


def frames_at_once(sensor: Sensor) -> int:
    """Return how many frames are best run together, so that they stay in the cache."""
    return max(_NUMBERS_AT_ONCE // (sensor.rows * sensor.columns), 1)


def _facts(
    sensor: Sensor, model: Model, outputs: Sequence[Output], reject: float
) -> dict[str, str]:
    """Return the metadata: plain words where possible, JSON for lists and records."""
    import msgspec

    records: dict[str, object] = {
        "sensor": msgspec.to_builtins(sensor),
        "features": list(model.inputs),
        "classes": list(model.classes),
        "states": [state.name.lower() for state in State],
        "reject": reject,
        "outputs": list(outputs),
        "chunk": frames_at_once(sensor),
    }
    return facts_of(model, "frames", records, model=kind_of(model), dtype="float64")


def _in_words(sensor: Sensor, model: Model) -> str:
    what = "rule base" if model.rules else "tree"
    return (
        f"Frames of {sensor.rows} x {sensor.columns} cells, row 0 at the top, to the "
        f"classes of the fuzzy {what} {model.name!r}: a cell counts where it reads "
        f"more than {sensor.threshold} over its baseline. State 0 is an object, 1 "
        "nothing on the sensor, 2 none of the known objects."
    )


# --- the graph


def _fill(
    sheet: OnnxGraph,
    made: FrameProgram,
    model: Model,
    outputs: Sequence[Output],
    reject: float,
    *,
    plain: bool,
) -> None:
    """Add all nodes of a graph to a sheet."""
    from fuzzytree.exporters import add_steps, add_strengths, is_known, side_by_side

    with sheet.about("sums"):
        columns = _sums(sheet, made)
    *features, pressed = add_steps(sheet, made.program, columns)
    zero = sheet.number(0.0)
    is_pressed = sheet.node("Less", zero, pressed, hint="is_pressed")
    if features:
        side_by_side(sheet, features, "features")
        sheet.source = "features"
    elif "features" in outputs:  # a model that looks at nothing
        none = sheet.numbers([], "none")
        sheet.node("Gather", sheet.source, none, axis=1, named="features")
    needed = [name for name in outputs if name != "features"]
    if not needed:
        return
    strengths = ""
    if isinstance(model, FuzzyTree):
        from fuzzytree.exporters import needs_plain, tree_graph

        is_plain = plain or needs_plain(model)
        axes = tree_graph(sheet, model, model.inputs, is_plain=is_plain, named="winner")
    else:
        from fuzzytree.exporters import add_winner, rules_graph

        axes, strengths = rules_graph(sheet, model, model.inputs)
        add_winner(sheet, strengths, "winner")
    answered = _is_answer(sheet, model, axes)
    known = sheet.node("And", is_pressed, answered, hint="is_known")
    if reject:
        is_strong = _is_strong(sheet, strengths, reject)
        known = sheet.node("And", known, is_strong, hint="is_known")
    _ends(sheet, model, is_pressed, known, outputs)
    if "strengths" in outputs and model.rules:
        finite = is_known(sheet, axes, is_flat=True)
        finite = sheet.node("And", is_pressed, finite, hint="is_finite")
        add_strengths(sheet, len(model.rules), strengths, finite, 0.0)


def _sums(sheet: OnnxGraph, made: FrameProgram) -> list[str]:
    """Add the sums as the sheet's source, shape (frames, sums); return their names."""
    from fuzzytree.exporters import np_to_onnx

    sensor = made.sensor
    double, size = int(np_to_onnx(np.float64)), sensor.rows * sensor.columns
    shape = sheet.numbers([-1, size], "shape")
    values = sheet.node("Reshape", "frames", shape, hint="cells")
    values = sheet.node("Cast", values, hint="cells", to=double)
    if sensor.full != sensor.largest:
        full = sheet.number(float(sensor.full))
        values = sheet.node("Min", values, full, hint="cells")
    taken = offsets(sensor)
    if taken:
        offset = sheet.constant(np.array([taken], np.float64), "baseline")
        values = sheet.node("Sub", values, offset, hint="cells")
    is_pressed, is_cut = "", bool(taken or sensor.threshold)
    if is_cut or any(one.of == "count" for one in made.sums):
        threshold = sheet.number(float(sensor.threshold))
        is_pressed = sheet.node("Less", threshold, values, hint="is_cell_pressed")
    if is_cut:
        zero = sheet.number(0.0)
        values = sheet.node("Where", is_pressed, values, zero, hint="pressures")
    return _taken(sheet, made.sums, values, is_pressed)


def _taken(
    sheet: OnnxGraph, sums: Sequence[Sum], values: str, is_pressed: str
) -> list[str]:
    """Add what the sums take from the cells: a product, single cells, the others."""
    from fuzzytree.exporters import np_to_onnx, reduced

    single = [one for one in sums if one.of == "cells" and sum(one.weights) == 1]
    single = [one for one in single if max(one.weights) == 1 and min(one.weights) == 0]
    mixed = [one for one in sums if one.of == "cells" and one not in single]
    pieces: list[str] = []
    if mixed:
        weights = np.array([one.weights for one in mixed], np.float64).T
        weights = np.ascontiguousarray(weights)
        pieces.append(sheet.node("MatMul", values, sheet.constant(weights, "weights")))
    if single:
        places = sheet.numbers([one.weights.index(1) for one in single], "cells")
        pieces.append(sheet.node("Gather", values, places, axis=1))
    others = [one for one in sums if one.of != "cells"]
    for one in others:
        if one.of == "count":
            ones = sheet.node("Cast", is_pressed, to=int(np_to_onnx(np.float64)))
            pieces.append(sheet.total(ones, axis=1, keepdims=1))
        else:
            pieces.append(reduced(sheet, "ReduceMax", values, axis=1, keepdims=1))
    sheet.source = pieces[0]
    if len(pieces) > 1:
        sheet.source = sheet.node("Concat", *pieces, axis=1)
    return [one.name for one in (*mixed, *single, *others)]


def _is_answer(sheet: OnnxGraph, model: Model, axes: InputBlock) -> str:
    """Return whether the model knows an answer to the features."""
    from fuzzytree.exporters import is_known

    if model.rules and model.semantics.uncovered is not None:
        return is_known(sheet, axes, is_flat=True)
    return sheet.node("Less", sheet.whole(0), "winner", hint="is_answer")


def _is_strong(sheet: OnnxGraph, strengths: str, reject: float) -> str:
    """Return whether the rule that decides is as strong as the floor, or is none."""
    from fuzzytree.exporters import reduced

    with sheet.about("strongest"):
        strongest = reduced(sheet, "ReduceMax", strengths, axis=0, keepdims=0)
        floor = sheet.number(reject)
        is_strong = sheet.node("LessOrEqual", floor, strongest)
        is_none = sheet.node("Equal", "winner", sheet.whole(0))
        return sheet.node("Or", is_none, is_strong)


def _ends(
    sheet: OnnxGraph,
    model: Model,
    is_pressed: str,
    known: str,
    outputs: Sequence[Output],
) -> None:
    """Add label, state and rule."""
    if "state" in outputs:
        seen, unknown, nothing = (
            sheet.whole(state) for state in (State.OBJECT, State.UNKNOWN, State.NOTHING)
        )
        state = sheet.node("Where", known, seen, unknown, hint="state_if_pressed")
        sheet.node("Where", is_pressed, state, nothing, named="state")
    if "rule" in outputs:
        sheet.node("Where", known, "winner", sheet.whole(0), named="rule")
    if "label" in outputs:
        texts = [model.semantics.uncovered or "", *model.rule_labels, ""]
        nothing = sheet.whole(len(texts) - 1)
        place = sheet.node("Where", known, "winner", nothing, hint="label_number")
        table = sheet.texts(texts, "labels")
        sheet.node("Gather", table, place, axis=0, named="label")
