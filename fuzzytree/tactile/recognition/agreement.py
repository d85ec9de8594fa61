"""Agreement of all implementations from frame to class: NumPy, ONNX, C, plain Python.

Each must give the bits and classes of the others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from fuzzytree.checking import counted
from fuzzytree.errors import TableError
from fuzzytree.model import (
    Agreement,
    BoolArray,
    Comparison,
    Model,
    RuleBase,
    fingerprint,
)
from fuzzytree.tactile.features import frame_program
from fuzzytree.tactile.features.aimed import proving_frames
from fuzzytree.tactile.features.plain import State
from fuzzytree.tactile.recognition.recogniser import Recogniser, check_inputs
from fuzzytree.tactile.recognition.runners import (
    NUMPY,
    PLAIN,
    Answers,
    Runner,
    as_sent,
    runners,
)
from fuzzytree.tactile.sensor import Cells, Sensor, saturated

if TYPE_CHECKING:
    import numpy.typing as npt

    Array = npt.NDArray[Any]

_PLAIN_CELLS = 512_000  # of frames for plain Python
_FEWEST, _SHOWN = 10, 3


class FrameCounts(msgspec.Struct, frozen=True):
    """What the frames of a check show: nothing of this is hidden in a total.

    Attributes:
        frames: How many there are, aimed ones included.
        aimed: How many are made, at bounds and cuts.
        nothing: On how many nothing presses.
        unknown: How many show none of the known objects.
        saturated: How many have a cell that takes no more.
        ties: In how many two classes are equally strong; 0 for a tree.
    """

    frames: int
    aimed: int
    nothing: int
    unknown: int
    saturated: int
    ties: int


class FramesAgreement(Agreement, frozen=True, kw_only=True):
    """The result of a check of frames.

    Attributes:
        shown: What the frames show.
    """

    shown: FrameCounts


def check_frames_agree(
    model: Model,
    sensor: Sensor,
    frames: Cells | None = None,
    *,
    reject: float = 0.0,
    graph: bytes | None = None,
) -> FramesAgreement:
    """Compare every implementation with every other one.

    Args:
        model: A tree or a rule base whose inputs are names of features.
        sensor: Whose frames come.
        frames: Shape (frames, rows, columns); beside the aimed ones.
        reject: Of raw rules: what is weaker in the rule that decides is unknown.
        graph: An ONNX file of the model; one that is written now if None.

    Raises:
        TableError: If an input of the model is no feature, or frames do not fit.
        InvalidModelError: If a feature is beyond the sensor.
        ReadError: If onnxruntime does not run the graph.
        ValueError: If the model has no strengths to reject by.

    Example:
        >>> from fuzzytree import learn, table
        >>> areas = np.array([[4.0], [5.0], [16.0], [15.0]])
        >>> tree = learn(table(areas, columns=["area"]), target=["s", "s", "l", "l"])
        >>> check_frames_agree(tree, Sensor(4, 4)).ok
        True
    """
    check_inputs(model)
    rows, aimed = proving_rows(model, sensor, frames)
    ways, skipped = runners(model, sensor, reject, graph=graph)
    plain = ways.pop(PLAIN)(rows[: max(_PLAIN_CELLS // rows[0].size, _FEWEST)])
    if left := len(rows) - len(plain["label"]):
        skipped.append(f"{PLAIN}: {left} frames, to save time")
    found = {name: run(rows) for name, run in ways.items()}
    comparisons = [compared(NUMPY, found[NUMPY], PLAIN, plain, model)]
    for name, one in found.items():
        if name != NUMPY:
            comparisons += [
                compared(name, one, NUMPY, found[NUMPY], model),
                compared(name, one, PLAIN, plain, model),
            ]
    comparisons += [_singly(n, run, rows, found[n]) for n, run in ways.items()]
    shown = Recogniser(model, sensor, reject)(rows)
    top = np.sort(np.vstack([np.zeros((2, len(rows))), shown.strengths]), axis=0)
    is_tied = (top[-1] == top[-2]) & (top[-1] > 0.0)
    return FramesAgreement(
        model.name,
        fingerprint(model),
        tuple(comparisons),
        skipped=tuple(skipped),
        probes=aimed,
        shown=FrameCounts(
            len(rows),
            aimed,
            int((shown.states == State.NOTHING).sum()),
            int((shown.states == State.UNKNOWN).sum()),
            int((saturated(sensor, rows) > 0).sum()),
            int(is_tied.sum()) if isinstance(model, RuleBase) else 0,
        ),
    )


def proving_rows(
    model: Model, sensor: Sensor, frames: Cells | None
) -> tuple[Cells, int]:
    """Return aimed frames with others behind them, and how many are aimed."""
    aimed = proving_frames(frame_program(sensor, model.inputs), model)
    every = [aimed] if frames is None else [aimed, as_sent(sensor, frames)]
    return np.concatenate(every), len(aimed)


def compared(
    name: str, one: Answers, against: str, other: Answers, model: Model
) -> Comparison:
    """Compare the answers to some frames with others, each output that both have.

    Features and strengths are compared bit by bit. Where there are answers to more
    frames on one side, the first ones are compared.
    """
    wrong = {key: _apart(one[key], other[key]) for key in one if key in other}
    every = [*wrong.values()]
    is_wrong: BoolArray = np.logical_or.reduce(every)
    flips = [wrong[key] for key in ("label", "state") if key in wrong]
    largest = 0.0
    if "features" in wrong:
        values = one["features"][: len(is_wrong)] - other["features"][: len(is_wrong)]
        largest = float(np.abs(values).max(initial=0.0))
    shown = np.flatnonzero(is_wrong)[:_SHOWN].tolist()
    return Comparison(
        name,
        against,
        "rows",
        len(is_wrong),
        "DISAGREES" if is_wrong.any() else "agrees",
        differing=int(is_wrong.sum()),
        largest_difference=largest,
        flips=int(np.logical_or.reduce(flips).sum()) if flips else 0,
        detail=tuple(_difference_text(row, one, other, model) for row in shown),
    )


def _apart(one: Array, other: Array) -> BoolArray:
    """Return in which of the frames that both have two outputs differ."""
    count = min(len(one), len(other))
    pair = (np.ascontiguousarray(found[:count]) for found in (one, other))
    if one.dtype == np.float64:
        pair = (found.view(np.uint64) for found in pair)
    first, second = pair
    apart: BoolArray = (first != second).reshape(count, -1).any(axis=1)
    return apart


def _difference_text(frame: int, one: Answers, other: Answers, model: Model) -> str:
    texts: list[str] = []
    for key, own in one.items():
        a, b = (np.asarray(f[frame]).tolist() for f in (own, other.get(key, own)))
        if key == "features" and len(a) != len(b):
            texts.append(f"{len(a)} features, not {len(b)}")
        elif key == "features":
            pairs = zip(model.inputs, map(repr, a), map(repr, b), strict=True)
            texts += [f"{name} {x}, not {y}" for name, x, y in pairs if x != y]
        elif a != b:
            texts.append(f"{key} {a!r}, not {b!r}")
    return f"frame {frame}: {'; '.join(texts)}"


def _singly(name: str, run: Runner, frames: Cells, found: Answers) -> Comparison:
    """Compare calls: no frame, single ones, some, other memory order, wrong width."""
    wrong: list[str] = []
    step = max(len(frames) // 8, 1)
    part = slice(None, None, step)
    if any(map(len, run(frames[:0]).values())):
        wrong.append("no frames get an answer")
    for place in range(0, len(frames), step):
        one = slice(place, place + 1)
        if not _is_same(run(frames[one]), found, one):
            wrong.append(f"frame {place} alone gets another answer")
    for given in (frames[part], np.asfortranarray(frames[part])):
        if not _is_same(run(given), found, part):
            wrong.append("some of the frames get other answers")
    try:
        run(frames[:, :, :-1])
        wrong.append("frames of another size get an answer")
    except TableError:
        pass
    calls = len(range(0, len(frames), step)) + 4
    return counted("calls", name, "itself", calls, wrong)


def _is_same(one: Answers, all_of: Answers, part: slice) -> bool:
    return not any(_apart(one[key], all_of[key][part]).any() for key in one)
