"""Agreement of all implementations from frame to class, and files that are checked.

NumPy, ONNX and C must give the bits and classes of plain Python, and plain Python must
give the features of exact rational arithmetic up to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import msgspec
import numpy as np

from fuzzytree.checking import counted
from fuzzytree.errors import TableError
from fuzzytree.model import (
    Agreement,
    Comparison,
    FloatArray,
    Model,
    RuleBase,
    fingerprint,
)
from fuzzytree.tactile.features import frame_program
from fuzzytree.tactile.features.aimed import proving_frames
from fuzzytree.tactile.features.exact import exact_features
from fuzzytree.tactile.features.names import Feature, feature_of
from fuzzytree.tactile.features.plain import State, plain_answer
from fuzzytree.tactile.recognition.recogniser import Recogniser, check_inputs
from fuzzytree.tactile.recognition.runners import (
    NUMPY,
    PLAIN,
    Runner,
    RunnerResult,
    as_sent,
    runners,
)
from fuzzytree.tactile.sensor import Cells, Sensor, pressed, saturated

_ORDERS = ("2", "22", "33", "33", "3333", "332", "44", "44", "4", "444", "42")
"""Of S1 to S11: the orders of the moments that it is a product of."""

_TWICE = (5, 6, 10, 11)  # of the invariants: twice the real part of the product

_DEGREES = 90.0 / math.pi  # of half an angle, for each radian of the whole


def errors(
    sensor: Sensor,
    frame: Cells,
    names: Sequence[str],
    values: Sequence[float],
    exact: Sequence[Fraction],
) -> tuple[float, ...]:
    """Return how far features are from the exact ones, as shares of their scales.

    Example:
        >>> bar = np.array([[0, 255, 255]])
        >>> errors(Sensor(1, 3), bar, ["S1"], [0.75], [Fraction(1, 2)])
        (0.5,)
    """
    cells = pressed(sensor, frame)[0] / sensor.full
    if not cells.any():
        return tuple(0.0 if value == 0.0 else math.inf for value in values)
    sizes = _sizes(cells)
    found: list[float] = []
    every = zip(map(feature_of, names), values, exact, strict=True)
    for feature, value, right in every:
        apart = abs(Fraction(value) - right)
        if feature.base == "angle":
            apart = min(apart, 180 - apart)  # -90 and 90 are one direction
        scale = _scale(feature, sizes, max(cells.shape))
        if feature.is_log:  # an error of v is one of v / (1 + |v|) in log(1 + |v|)
            size = abs(float(right))
            scale = scale / (1.0 + math.expm1(size)) + max(size, 1.0)
        share = float(apart) / scale if scale else math.inf
        found.append(share if apart else 0.0)
    return tuple(found)


def _sizes(cells: FloatArray) -> list[float]:
    """Return the sums of g r^n for n from 0 to 4; |C20| at the end."""
    force = cells.sum()
    down, along = np.mgrid[0 : cells.shape[0], 0 : cells.shape[1]]
    z = (along - (along * cells).sum() / force) + 1j * (
        (down * cells).sum() / force - down
    )
    found = [float((cells * np.abs(z) ** order).sum()) for order in range(5)]
    return [*found, float(abs((cells * z**2).sum()))]


def _scale(feature: Feature, sizes: Sequence[float], side: int) -> float:
    """Return the scale of a feature, of its value itself if it is a logarithm."""
    unit = sizes[0] if feature.per_force else 1.0
    base, direction = feature.base, sizes[2] / (sizes[5] or math.inf)
    if feature.kind != "moment" or base in ("force", "area", "peak"):
        return sizes[0] / unit
    match base:
        case "x" | "y":
            return float(side)
        case "angle":
            return 90.0 + _DEGREES * direction
        case "cos2" | "sin2":
            return 1.0 + direction
        case _ if base[0] == "S":
            number = int(base[1:])
            product = math.prod(sizes[int(n)] / unit for n in _ORDERS[number - 1])
            return 2 * product if number in _TWICE else product
        case _:
            return sizes[int(base[-2]) + int(base[-1])] / unit


EXACT = "exact arithmetic"

ALLOWED = 1e-12
"""The largest error of a feature as a share of its scale: some thousand roundings, and
what the series of angles and logarithms leave out (`docs/explanation/moments.md`)."""

_PLAIN_CELLS, _EXACT_CELLS = 512_000, 51_200  # of frames for the slow ones
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
        largest_error: Of a feature against exact arithmetic, as a share of its scale.
    """

    shown: FrameCounts
    largest_error: float


def check_frames_agree(
    model: Model, sensor: Sensor, frames: Cells | None = None, *, reject: float = 0.0
) -> FramesAgreement:
    """Compare every implementation with plain Python, and that with exact arithmetic.

    Args:
        model: A tree or a rule base whose inputs are names of features.
        sensor: Whose frames come.
        frames: Shape (frames, rows, columns); beside the aimed ones.
        reject: Of raw rules: what is weaker in the rule that decides is unknown.

    Raises:
        TableError: If an input of the model is no feature, or frames do not fit.
        InvalidModelError: If a feature is beyond the sensor.
        ValueError: If the model has no strengths to reject by.

    Example:
        >>> from fuzzytree import learn, table
        >>> areas = np.array([[4.0], [5.0], [16.0], [15.0]])
        >>> tree = learn(table(areas, columns=["area"]), target=["s", "s", "l", "l"])
        >>> check_frames_agree(tree, Sensor(4, 4)).ok
        True
    """
    check_inputs(model)
    aimed = proving_frames(frame_program(sensor, model.inputs), model)
    every = [aimed] if frames is None else [aimed, as_sent(sensor, frames)]
    rows = np.concatenate(every)
    ways, skipped = runners(model, sensor, reject)
    run_plain = ways.pop(PLAIN)
    found = {name: run(rows) for name, run in ways.items()}
    cells = sensor.rows * sensor.columns
    plain = run_plain(rows[: max(_PLAIN_CELLS // cells, _FEWEST)])
    exact = _against_exact(
        model, sensor, rows[: max(_EXACT_CELLS // cells, _FEWEST)], plain, reject
    )
    for name, count in ((PLAIN, len(plain.codes)), (EXACT, exact.rows)):
        if count < len(rows):
            skipped.append(f"{name}: {len(rows) - count} frames, to save time")
    comparisons = [exact, _compared(NUMPY, found[NUMPY], PLAIN, plain, model)]
    for name, one in found.items():
        if name != NUMPY:
            comparisons += [
                _compared(name, one, NUMPY, found[NUMPY], model),
                _compared(name, one, PLAIN, plain, model),
            ]
    comparisons += [_singly(n, run, rows, found[n]) for n, run in ways.items()]
    return FramesAgreement(
        model.name,
        fingerprint(model),
        tuple(comparisons),
        skipped=tuple(skipped),
        probes=len(aimed),
        shown=_shown(model, sensor, rows, len(aimed), reject),
        largest_error=exact.largest_difference,
    )


def _shown(
    model: Model, sensor: Sensor, frames: Cells, aimed: int, reject: float
) -> FrameCounts:
    found = Recogniser(model, sensor, reject)(frames)
    top = np.sort(np.vstack([np.zeros((2, len(frames))), found.strengths]), axis=0)
    is_tied = (top[-1] == top[-2]) & (top[-1] > 0.0)
    return FrameCounts(
        len(frames),
        aimed,
        int((found.states == State.NOTHING).sum()),
        int((found.states == State.UNKNOWN).sum()),
        int((saturated(sensor, frames) > 0).sum()),
        int(is_tied.sum()) if isinstance(model, RuleBase) else 0,
    )


def _compared(
    name: str, one: RunnerResult, other_name: str, other: RunnerResult, model: Model
) -> Comparison:
    """Compare the answers to some frames with others: bits, states, classes, rules."""
    count = min(one.features.shape[1], other.features.shape[1])
    values, others = (np.ascontiguousarray(f.features[:, :count]) for f in (one, other))
    wrong = (values.view(np.uint64) != others.view(np.uint64)).any(axis=0)
    flips = one.codes[:count] != other.codes[:count]
    wrong = wrong | flips | (one.states[:count] != other.states[:count])
    if one.rules is not None and other.rules is not None:
        wrong = wrong | (one.rules[:count] != other.rules[:count])
    shown = np.flatnonzero(wrong)[:_SHOWN].tolist()
    return Comparison(
        name,
        other_name,
        "rows",
        count,
        "DISAGREES" if wrong.any() else "agrees",
        differing=int(wrong.sum()),
        largest_difference=float(np.abs(values - others).max(initial=0.0)),
        flips=int(flips.sum()),
        detail=tuple(_difference_text(frame, one, other, model) for frame in shown),
    )


def _difference_text(
    frame: int, one: RunnerResult, other: RunnerResult, model: Model
) -> str:
    ends = (found.features[:, frame].tolist() for found in (one, other))
    every = zip(model.inputs, *ends, strict=True)
    shown = [(name, repr(a), repr(b)) for name, a, b in every]  # -0.0 is not 0.0
    texts = [f"{name} {a}, not {b}" for name, a, b in shown if a != b]
    codes = [(int(f.codes[frame]), State(f.states[frame])) for f in (one, other)]
    labels = [model.classes[c] if c >= 0 else state.name.lower() for c, state in codes]
    if labels[0] != labels[1]:
        texts.append(f"{labels[0]}, not {labels[1]}")
    return f"frame {frame}: {'; '.join(texts) or 'another rule'}"


def _singly(name: str, run: Runner, frames: Cells, found: RunnerResult) -> Comparison:
    """Compare calls: no frame, single ones, some, other memory order, wrong width."""
    wrong: list[str] = []
    step = max(len(frames) // 8, 1)
    part = slice(None, None, step)
    if run(frames[:0]).features.shape[1]:
        wrong.append("no frames get an answer")
    for place in range(0, len(frames), step):
        own = run(frames[place : place + 1])
        if not _is_same(own, found, slice(place, place + 1)):
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


def _is_same(one: RunnerResult, all_of: RunnerResult, part: slice) -> bool:
    return (
        np.array_equal(one.features, all_of.features[:, part])
        and np.array_equal(one.codes, all_of.codes[part])
        and np.array_equal(one.states, all_of.states[part])
    )


def _against_exact(
    model: Model, sensor: Sensor, frames: Cells, plain: RunnerResult, reject: float
) -> Comparison:
    """Compare plain Python's features with fractions, and its classes with theirs.

    A class may differ where a feature is within its rounding of a cut.
    """
    largest, flips, detail = 0.0, 0, list[str]()
    wrong = np.zeros(len(frames), np.bool_)
    for place, frame in enumerate(frames):
        exact = exact_features(sensor, frame, model.inputs)
        values = plain.features[:, place].tolist()
        apart = errors(sensor, frame, model.inputs, values, exact)
        largest = max(largest, *apart, 0.0)
        wrong[place] = any(not share <= ALLOWED for share in apart)
        if wrong[place]:
            worst = int(np.argmax(apart))
            detail.append(
                f"frame {place}: {model.inputs[worst]} {values[worst]!r}, not "
                f"{float(exact[worst])!r}"
            )
        shown = plain_answer(
            model,
            [float(value) for value in exact],
            is_pressed=bool(plain.states[place] != State.NOTHING),
            reject=reject,
        )
        flips += shown.code != int(plain.codes[place])
    return Comparison(
        PLAIN,
        EXACT,
        "rows",
        len(frames),
        "DISAGREES" if wrong.any() else "agrees",
        differing=int(wrong.sum()),
        largest_difference=largest,
        allowed=ALLOWED,
        origin="a share of each feature's scale",
        flips=flips,
        detail=tuple(detail[:_SHOWN]),
    )
