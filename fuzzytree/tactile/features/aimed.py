"""Frames aimed at where computations part: nothing, bounds, symmetry, and cuts."""

from __future__ import annotations

import bisect
from collections.abc import Callable, Iterator, Mapping

import numpy as np
import numpy.typing as npt

from fuzzytree.model import Model
from fuzzytree.semantics import axis_values, landmarks
from fuzzytree.tactile.features import FrameProgram
from fuzzytree.tactile.features.plain import plain_features
from fuzzytree.tactile.sensor import Cells, Sensor, baseline_of

Whole = npt.NDArray[np.int64]

_MOST_CUTS = 40


def aimed_frames(sensor: Sensor, random: int = 24, seed: int = 0) -> Cells:
    """Return frames at which computations could part.

    They show nothing, single cells, all cells at the threshold and one above it, all
    at the largest number, symmetric shapes whose invariants are exactly 0, and made
    presses of all sizes.

    Returns:
        Shape (frames, rows, columns), of the sensor's type.

    Example:
        >>> aimed_frames(Sensor(2, 2, threshold=9), 0)[:, 0, 0].tolist()[:4]
        [0, 9, 10, 255]
    """
    base = baseline_of(sensor)
    above = [*_plain(sensor, base), *_symmetric(sensor, base)]
    above += _presses(sensor, base, random, seed)
    frames = np.array([base, *above], np.int64)
    return np.clip(frames, 0, sensor.largest).astype(sensor.dtype)


def _plain(sensor: Sensor, base: Whole) -> Iterator[Whole]:
    yield base + sensor.threshold
    yield base + sensor.threshold + 1
    yield np.full_like(base, sensor.full)
    yield np.full_like(base, sensor.largest)
    yield np.zeros_like(base)
    last, right = sensor.rows - 1, sensor.columns - 1
    for row, column in ((0, 0), (last, 0), (last, right), (last // 2, right // 2)):
        for value in (sensor.threshold + 1, sensor.full):
            one = base.copy()
            one[row, column] += value
            yield one


def _symmetric(sensor: Sensor, base: Whole) -> Iterator[Whole]:
    """Yield a cross, a square, bars and a diagonal, alone and off the middle."""
    half = min(sensor.rows, sensor.columns) // 4
    force = sensor.full // 2 + 1
    for row, column in (
        (sensor.rows // 2, sensor.columns // 2),
        (half, sensor.columns - 1 - half),
    ):
        cross, square = base.copy(), base.copy()
        bar, diagonal = base.copy(), base.copy()
        for step in range(-half, half + 1):
            cross[row + step, column] += force
            cross[row, column + step] += force * (step != 0)
            square[row + step, column - half : column + half + 1] += force
            bar[row, column + step] += force
            diagonal[row + step, column + step] += force
        yield from (cross, square, bar, diagonal)


def _presses(sensor: Sensor, base: Whole, count: int, seed: int) -> Iterator[Whole]:
    """Yield presses of an ellipse each, of any size and slant, with some noise."""
    chance = np.random.default_rng(seed)
    down, along = np.mgrid[0 : sensor.rows, 0 : sensor.columns]
    size = float(max(sensor.rows, sensor.columns))
    for number in range(count):
        if number % 6 == 5:
            yield chance.integers(0, sensor.full + 1, base.shape)
            continue
        x, y = chance.uniform(0, sensor.columns), chance.uniform(0, sensor.rows)
        turn = chance.uniform(0, np.pi)
        long, short = size * chance.uniform(0.05, 0.6, 2)
        u = (along - x) * np.cos(turn) + (down - y) * np.sin(turn)
        v = (down - y) * np.cos(turn) - (along - x) * np.sin(turn)
        height = np.clip(1.5 - (u / long) ** 2 - (v / short) ** 2, 0.0, 1.0)
        height *= chance.uniform(0.2, 1.0) * sensor.full
        yield base + height.astype(np.int64)


def proving_frames(made: FrameProgram, model: Model, presses: int = 12) -> Cells:
    """Return what a written file is tried with: aimed frames, and pairs at its cuts.

    The two frames of a pair differ by one in one cell, and lie on either side of a cut.
    """
    frames = aimed_frames(made.sensor, presses)

    def values(frame: Cells) -> dict[str, float]:
        """Return the values of the model's variables, combinations among them."""
        found, _ = plain_features(made, frame)
        return axis_values(model.variables, dict(zip(model.inputs, found, strict=True)))

    known, found = [*map(values, frames)], [*frames]
    for name, cut in _cuts(model)[:_MOST_CUTS]:
        order = sorted(range(len(known)), key=lambda place: known[place][name])
        above = sum(one[name] <= cut for one in known)
        if 0 < above < len(order):
            pair = frames[[order[above - 1], order[above]]].astype(np.int64)
            found += _edge(pair, values, name, cut)
    return np.array(found, frames.dtype)


def _edge(
    pair: Whole, values: Callable[[Whole], Mapping[str, float]], name: str, cut: float
) -> Iterator[Whole]:
    """Yield two frames next to each other, on the way from one frame to another.

    All cells go over one after another, by one at each step.
    """
    start, turn = pair[0], np.sign(pair[1] - pair[0])
    steps = np.abs(pair[1] - pair[0])
    before = np.cumsum(steps).reshape(steps.shape) - steps

    def frame(step: int) -> Whole:
        found: Whole = start + turn * np.clip(step - before, 0, steps)
        return found

    every = range(int(steps.sum()) + 1)
    first = bisect.bisect(every, cut, key=lambda step: values(frame(step))[name])
    yield from (frame(first - 1), frame(first))


def _cuts(model: Model) -> list[tuple[str, float]]:
    """Return where a model changes its mind: the name of a variable, and a value."""
    cuts = [(node.variable, cut) for node in model.nodes for cut in node.cuts]
    if model.rules:
        cuts = [
            (variable.name, value)
            for variable in model.variables
            for term in variable.terms
            for value in landmarks(term.shape)
        ]
    return list(dict.fromkeys(cuts))
