"""Frames aimed at where computations part: nothing, bounds, symmetry, and cuts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from fuzzytree.model import FuzzyTree, Model
from fuzzytree.semantics import axis_values, landmarks
from fuzzytree.tactile.features import FrameProgram
from fuzzytree.tactile.features.plain import plain_features
from fuzzytree.tactile.sensor import Cells, Sensor

Features = Callable[[Cells], npt.NDArray[np.float64]]
"""Gives features of shape (features, frames)."""

Whole = npt.NDArray[np.int64]

_MOST_CUTS = 40
_HALVINGS = 20  # 16 bits are done after them


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
    base = np.zeros((sensor.rows, sensor.columns), np.int64)
    if sensor.baseline:
        base += np.array(sensor.baseline, np.int64).reshape(base.shape)
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


def edge_frames(
    frames: Cells, cuts: Sequence[tuple[int, float]], features: Features
) -> Cells:
    """Return pairs of frames that lie next to a cut on either side.

    Between a frame below a cut and one above it, both given, all cells go over from
    one to the other, and then one cell after another: halving finds where the feature
    passes the cut. The two frames that are left differ by one in one cell.

    Args:
        frames: Shape (frames, rows, columns).
        cuts: The line of a feature and its cut, each.
        features: Computes the features of such frames.

    Returns:
        Two frames for each cut that lies between two of the frames' own values.
    """
    values = features(frames)
    found: list[Cells] = []
    for line, cut in dict.fromkeys(cuts):
        is_above = values[line] > cut
        if is_above.any() and not is_above.all():
            below = np.where(is_above, -np.inf, values[line]).argmax()
            above = np.where(is_above, values[line], np.inf).argmin()
            pair = frames[below].astype(np.int64), frames[above].astype(np.int64)

            def feature(frame: Whole, line: int = line) -> float:
                return float(features(frame[np.newaxis])[line, 0])

            found += _parted(pair, cut, feature)
    if not found:
        return frames[:0]
    return np.array(found, np.int64).astype(frames.dtype)


def _parted(
    pair: tuple[Whole, Whole], cut: float, feature: Callable[[Whole], float]
) -> tuple[Whole, Whole]:
    """Bring a frame below a cut and one above it next to each other."""
    below, above = pair
    for _ in range(_HALVINGS):
        middle = (below + above) // 2
        if np.array_equal(middle, below) or np.array_equal(middle, above):
            break
        if feature(middle) > cut:
            above = middle
        else:
            below = middle
    changed = np.flatnonzero(below != above)
    low, high = 0, len(changed)
    while high - low > 1:
        count = (low + high) // 2
        if feature(_mixed(below, above, changed[:count])) > cut:
            high = count
        else:
            low = count
    ends = [_mixed(below, above, changed[:count]) for count in (low, high)]
    return ends[0], ends[1]


def _mixed(one: Whole, two: Whole, places: npt.NDArray[np.intp]) -> Whole:
    """Return a frame whose cells at some places are another frame's."""
    found = one.copy()
    found.flat[places] = two.flat[places]
    return found


def proving_frames(made: FrameProgram, model: Model, presses: int = 12) -> Cells:
    """Return what a written file is tried with: aimed frames, and pairs at its cuts."""
    frames = aimed_frames(made.sensor, presses)

    def values(some: Cells) -> npt.NDArray[np.float64]:
        """Return the values of the model's variables, combinations among them."""
        rows = [plain_features(made, frame)[0] for frame in some]
        named = [dict(zip(model.inputs, row, strict=True)) for row in rows]
        axes = [axis_values(model.variables, row) for row in named]
        return np.array([[*one.values()] for one in axes]).T

    pairs = edge_frames(frames, cuts_of(model)[:_MOST_CUTS], values)
    return np.concatenate([frames, pairs])


def cuts_of(model: Model) -> list[tuple[int, float]]:
    """Return where a model changes its mind: the place of a variable, and a value."""
    if isinstance(model, FuzzyTree):
        place = {one.name: line for line, one in enumerate(model.variables)}
        pairs = [(place[one.variable], cut) for one in model.nodes for cut in one.cuts]
    else:
        pairs = [
            (line, value)
            for line, variable in enumerate(model.variables)
            for term in variable.terms
            for value in landmarks(term.shape)
        ]
    return list(dict.fromkeys(pairs))
