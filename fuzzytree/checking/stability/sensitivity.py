"""How stiff each input is, and what giving it in float32 would cost.

An input is stiff if degrees change over a distance that is small beside its values:
float32 keeps 24 bits, so a value x is wrong by up to |x| 2**-24, and a degree by that
times its steepest slope. Whether it happens is tried: one input at a time is rounded to
float32, moved by one unit in the last place, and by a billionth of its range, and the
native answers to the rows before and after are compared.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple, TypeGuard

import numpy as np

from fuzzytree.checking.comparing import ModelRun, labels, strength_gap
from fuzzytree.checking.stability.results import (
    Criterion,
    Move,
    Stiff,
    Trial,
)
from fuzzytree.checking.stability.runs import output_spans, row_text
from fuzzytree.model import (
    LR,
    Band,
    Curve,
    Document,
    FloatArray,
    Formula,
    Linear,
    Outcome,
    Points,
    Shape,
)
from fuzzytree.numerics import UNIT, Conduct, conduct, degree_bound
from fuzzytree.runtimes import baseline
from fuzzytree.semantics import forms, jet, landmarks_of

SAFE = 1e-4
"""The error of a degree, or of an output as a share of its range, that is safe."""

_DOUBLE = 2.0**-29  # a rounding of double, in roundings of float32
_OFFSET_HELPS = 16.0  # times the range of the values, at least, are they from zero
_ROWS = 4_000  # rows tried for each input
_PIECES = 17  # ends of the pieces between knots whose slopes are bounded


class InputScale(NamedTuple):
    """The scale of an input, in its unit."""

    spread: float  # the shortest distance over which a degree changes; infinite if none
    slope: float  # the steepest of a degree
    low: float  # the ends of its range
    high: float
    curves: float  # what evaluating curves in float32 costs, wherever the value is

    @property
    def location(self) -> float:
        """The largest absolute value in the range."""
        return max(abs(self.low), abs(self.high))


def stiffness(
    model: Document, values: FloatArray, *, is_data: bool
) -> tuple[Stiff, ...]:
    """Return what float32 costs each input of a model, the costliest first.

    No answer to data should change; probes lie on edges, where some must.
    """
    scales = input_scales(model, values)
    near = _near(model, values[:, :: max(-(-values.shape[1] // _ROWS), 1)], scales)
    every = [form for form in forms(model).values() if form.rules]
    runs = [baseline().load(form) for form in every]
    answers = [run(near) for run in runs]

    def move(line: int, step: str, value: FloatArray) -> Move:
        """Return the most that a form moves when one input has another value."""
        changed = near.copy()
        changed[line] = value
        moves = [
            _move(form, step, near, before, run(changed))
            for form, run, before in zip(every, runs, answers, strict=True)
        ]
        return max(moves, key=lambda one: (one.changed, one.largest))

    records: list[Stiff] = []
    for line, name in enumerate(model.inputs):
        scale, here = scales[name], near[line]
        reach = 1e-9 * ((scale.high - scale.low) or scale.location)
        with np.errstate(over="ignore"):  # what is beyond a type is missing
            single = move(line, "float32", here.astype(np.float32).astype(np.float64))
            moves = (
                move(line, "1 ulp", np.nextafter(here, np.inf)),
                move(line, "1e-9 of its range", here + reach),
            )
        predicted = scale.slope * scale.location * UNIT
        offset = _offset(scale)
        is_safe = max(predicted, scale.curves) <= SAFE
        is_safe = is_safe and not (is_data and single.changed)
        spread = scale.spread if math.isfinite(scale.spread) else None
        is_known = spread is not None and scale.location > 0.0
        records.append(
            Stiff(
                name,
                spread,
                scale.location,
                scale.spread / scale.location if is_known else None,
                min(predicted, 1.0),
                single.largest,
                single.changed,
                near.shape[1],
                None if is_safe else offset,
                _advice(scale, predicted, offset, is_safe=is_safe),
                moves,
            )
        )
    return tuple(sorted(records, key=lambda one: (-one.predicted, -one.observed)))


def _move(
    model: Document, step: str, rows: FloatArray, before: Outcome, after: Outcome
) -> Move:
    """Return how far the answers of a model move, and the row of the largest jump."""
    if before.outputs is not None and after.outputs is not None:
        spans = output_spans(model, before)
        with np.errstate(invalid="ignore"):
            moves = np.abs(after.outputs - before.outputs) / spans
        is_number = np.isfinite(before.outputs), np.isfinite(after.outputs)
        moves[~is_number[0] & ~is_number[1]] = 0.0
        changed = ~(moves <= SAFE).all(axis=0)
    else:
        first, second = (labels(ModelRun("", model, one)) for one in (before, after))
        moves, changed = strength_gap(after, before)[np.newaxis], first != second
    moves = np.nan_to_num(moves, nan=1.0, posinf=1.0)  # a number comes or goes
    largest = moves.max(axis=0, initial=0.0)
    row = int(np.argmax(np.where(changed, largest, -1.0))) if changed.any() else None
    line = int(np.argmax(moves[:, row])) if row is not None else 0
    return Move(
        step,
        float(largest.max(initial=0.0)),
        int(changed.sum()),
        model.outputs[line].name if model.outputs and row is not None else "",
        "" if row is None else row_text(model.inputs, rows, row),
    )


def input_scales(model: Document, values: FloatArray) -> dict[str, InputScale]:
    """Return the scale of each input, over all forms of a model.

    A combination passes its terms' widths on to its inputs, divided by their weights.
    Where no range is declared, it is that of the landmarks and of finite values.
    """
    widths: dict[str, list[float]] = {name: [] for name in model.inputs}
    slopes: dict[str, list[float]] = {name: [] for name in model.inputs}
    places: dict[str, list[float]] = {name: [] for name in model.inputs}
    curves = dict.fromkeys(model.inputs, 0.0)
    for form in forms(model).values():
        for variable in form.variables:
            curves_of = [term.function for term in variable.terms]
            steep = max(map(_slope, curves_of), default=0.0)
            width = min(map(_width, curves_of), default=math.inf)
            bounds = [degree_bound(c, "mixed") for c in curves_of if _is_shape(c)]
            fixed = max((bound.fixed for bound in bounds), default=0.0)
            parts = [(part.input, abs(part.weight)) for part in variable.parts]
            for name, weight in parts or [(variable.name, 1.0)]:
                curves[name] = max(curves[name], fixed)
                widths[name].append(width / weight)
                slopes[name].append(steep * weight)
            if not variable.parts:
                marks = [mark for curve in curves_of for mark in landmarks_of(curve)]
                places[variable.name] += marks
            for part in variable.parts:
                places[part.input].append(part.centre)
    lines = dict(zip(model.inputs, values, strict=True))
    return {
        name: InputScale(
            min(widths[name], default=math.inf),
            max(slopes[name], default=0.0),
            *_range(model, name, places[name], lines[name]),
            curves[name],
        )
        for name in model.inputs
    }


def _range(
    model: Document, name: str, places: Sequence[float], line: FloatArray
) -> tuple[float, float]:
    """Return the declared range of an input, or one around what is known of it."""
    declared = next(v for v in model.variables if v.name == name)
    if declared.low is not None and declared.high is not None:
        return declared.low, declared.high
    if places:
        return min(places), max(places)
    finite = line[np.isfinite(line) & (np.abs(line) < 1e30)]
    if not finite.size:
        return 0.0, 0.0
    return float(finite.min()), float(finite.max())


def _is_shape(curve: Curve) -> TypeGuard[Shape]:
    return isinstance(curve, Band | LR | Points)


def _slope(curve: Curve) -> float:
    """Return a bound of the slope of a degree; steps show in flips alone."""
    if _is_shape(curve):
        return degree_bound(curve, "float32").per_unit
    if isinstance(curve, Formula | Linear):
        return 0.0  # it has no degree of its own
    knots = sorted({*curve.knots(), *(curve.extent or ())})
    cuts = [np.linspace(*ends, _PIECES).tolist() for ends in itertools.pairwise(knots)]
    pieces = itertools.chain.from_iterable(map(itertools.pairwise, cuts))
    slopes = (jet(curve, a, b).slope.size for a, b in pieces if a < b)
    return max(filter(math.isfinite, slopes), default=0.0)


def _width(curve: Curve) -> float:
    """Return the shortest distance over which a degree goes all the way."""
    match curve:
        case Band():
            return min((abs(a - b) for a, b in curve.flanks), default=math.inf)
        case LR(left=below, right=above):
            return min(below.spread, above.spread)
        case _:
            slope = _slope(curve)
            return 1.0 / slope if slope else math.inf


def _near(
    model: Document, values: FloatArray, scales: dict[str, InputScale]
) -> FloatArray:
    """Return the rows that lie within twice the range of every input."""
    inside = np.isfinite(values).all(axis=0)
    for line, name in enumerate(model.inputs):
        scale = scales[name]
        reach = (scale.high - scale.low) or scale.location or 1.0
        with np.errstate(all="ignore"):
            inside &= values[line] >= scale.low - reach
            inside &= values[line] <= scale.high + reach
    return values[:, inside]


def _offset(scale: InputScale) -> float | None:
    """Return a short value within the range whose subtraction keeps more digits."""
    span = scale.high - scale.low
    if not 0.0 < span < math.inf or scale.location < _OFFSET_HELPS * span:
        return None
    unit = 2.0 ** math.floor(math.log2(span))
    return round((0.5 * scale.low + 0.5 * scale.high) / unit) * unit


def _advice(
    scale: InputScale, predicted: float, offset: float | None, *, is_safe: bool
) -> str:
    if is_safe:
        return "float32 is safe"
    use = "use double" if scale.curves > SAFE else "use mixed"
    if predicted * _DOUBLE > SAFE:
        if offset is None:
            return "use double, and even that is coarse"
        return f"{use}, and subtract {_short(offset)} where the values are made"
    if offset is None or use == "use double":
        return use
    return f"use mixed, or subtract {_short(offset)} first"


def _short(value: float) -> str:
    text = f"{value:g}"
    return text if float(text) == value else repr(value)


LARGEST_SIZE = 64.0
"""Roundings of 1 that an evaluation may cost for each of its steps: six bits."""

LARGEST_OVERSHOOT = 0.05
"""By how much a polynomial may leave [0, 1] before it is clipped."""

LARGEST_RISE = 0.05
"""By how much a clipped degree may rise on its way out."""

_ADVICE = (
    "learn with fewer points on a set (points=2), which gives curves of a lower "
    "degree, or rewrite the named curves"
)
_NEGLIGIBLE = 1e-9  # overshoot and rises below are not reported


def curves(model: Document) -> Criterion:
    """Judge the curve of every term of a model, by proof and not by samples (N7).

    A curve fails beyond `LARGEST_SIZE`, `LARGEST_OVERSHOOT` or `LARGEST_RISE`; below
    them, what it does is a fact.
    """
    trial = Trial("N7", _ADVICE, worst=0.0)
    sides: dict[tuple[str, LR, str], str] = {}
    for title, form in forms(model).items():
        for variable in form.variables if form.rules else ():
            for term in variable.terms:
                if isinstance(curve := term.function, LR):
                    name = (
                        f"{title.removesuffix(' rules')}: {variable.name} {term.name}"
                    )
                    for side in ("left", "right"):
                        sides.setdefault((variable.name, curve, side), name)
    results: list[tuple[float, bool, str]] = []
    for (_, curve, name), lead in sides.items():
        sides_of = {one.side: one for one in conduct(curve)}
        worst, is_wrong, text = _conduct(sides_of[name])
        if text:
            results.append((worst, is_wrong, f"{lead} ({name}): {text}"))
    results.sort(reverse=True)
    trial.add(len(sides), *(text for _, is_wrong, text in results if is_wrong))
    trial.worst = max((worst for worst, _, _ in results), default=0.0)
    if not sides:
        trial.skipped.append("no term of the model has a fitted curve")
    facts = [text for _, is_wrong, text in results if not is_wrong]
    return trial.result(*(f"{text}, within the limits" for text in facts))


def _conduct(side: Conduct) -> tuple[float, bool, str]:
    """Return how far a side leaves [0, 1] or rises, whether it fails, and a sentence.

    A bracket whose lower end is beyond a limit is a proof.
    """
    overshoot = max(side.above.high, side.below.high)
    rise = side.rises[0].height if side.rises else 0.0
    is_wrong = side.size.low > LARGEST_SIZE or rise > LARGEST_RISE
    is_wrong = is_wrong or max(side.above.low, side.below.low) > LARGEST_OVERSHOOT
    parts: list[str] = []
    if side.size.high > LARGEST_SIZE:
        size = f"{side.size.high:.3g}"
        parts.append(f"a step of evaluating costs up to {size} roundings")
    if overshoot > _NEGLIGIBLE:
        parts.append(f"the polynomial leaves [0, 1] by {overshoot:.3g}")
    if rise > _NEGLIGIBLE:
        where = f"from {side.rises[0].start:g} to {side.rises[0].end:g}"
        parts.append(f"the degree rises by {rise:.3g} {where}")
    return max(overshoot, rise), is_wrong, "; ".join(parts)
