"""Frames aimed at where computations part: nothing, bounds, symmetry, and cuts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from fuzzytree.tactile.sensor import Cells, Sensor

Features = Callable[[Cells], npt.NDArray[np.float64]]
"""Gives features of shape (features, frames)."""

_HALVINGS = 20  # two frames differ by less than a unit in each cell after them


def frame_type(sensor: Sensor) -> type[np.uint8] | type[np.uint16]:
    """Return the type of numbers that holds what a cell reads."""
    return np.uint8 if sensor.bits == 8 else np.uint16


def aimed_frames(sensor: Sensor, random: int = 24, seed: int = 0) -> Cells:
    """Return frames at which computations could part.

    They show nothing, single cells, all cells at the threshold and one above it, all
    at the largest number, symmetric shapes whose invariants are exactly 0, and made
    presses of all sizes.

    Args:
        sensor: The sensor.
        random: How many presses are drawn.
        seed: Of the presses.

    Returns:
        Shape (frames, rows, columns), of the type of `frame_type`.

    Example:
        >>> aimed_frames(Sensor(2, 2, threshold=9), 0)[:, 0, 0].tolist()[:4]
        [0, 9, 10, 255]
    """
    kind = frame_type(sensor)
    base = np.zeros((sensor.rows, sensor.columns), np.int64)
    if sensor.baseline:
        base += np.array(sensor.baseline, np.int64).reshape(base.shape)
    above = [*_plain(sensor, base), *_symmetric(sensor, base)]
    above += _presses(sensor, base, random, seed)
    frames = np.array([base, *above], np.int64)
    return np.clip(frames, 0, np.iinfo(kind).max).astype(kind)


def _plain(
    sensor: Sensor, base: npt.NDArray[np.int64]
) -> Iterator[npt.NDArray[np.int64]]:
    yield base + sensor.threshold
    yield base + sensor.threshold + 1
    yield np.full_like(base, sensor.full)
    yield np.full_like(base, np.iinfo(frame_type(sensor)).max)
    yield np.zeros_like(base)
    last, right = sensor.rows - 1, sensor.columns - 1
    for row, column in ((0, 0), (last, 0), (last, right), (last // 2, right // 2)):
        for value in (sensor.threshold + 1, sensor.full):
            one = base.copy()
            one[row, column] += value
            yield one


def _symmetric(
    sensor: Sensor, base: npt.NDArray[np.int64]
) -> Iterator[npt.NDArray[np.int64]]:
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


def _presses(
    sensor: Sensor, base: npt.NDArray[np.int64], count: int, seed: int
) -> Iterator[npt.NDArray[np.int64]]:
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

    Between a frame below a cut and one above it, both given, the cells go over from
    one to the other; halving finds where the feature passes the cut.

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
        if is_above.all() or not is_above.any():
            continue
        below, above = _nearest(values[line], cut)
        pair = frames[[below, above]].astype(np.float64)
        for _ in range(_HALVINGS):
            middle = np.rint((pair[0] + pair[1]) / 2).astype(frames.dtype)
            value = features(middle[np.newaxis])[line, 0]
            if any(np.array_equal(middle, one) for one in pair):
                break
            pair[int(value > cut)] = middle
        found.append(pair.astype(frames.dtype))
    return np.concatenate(found) if found else frames[:0]


def _nearest(values: npt.NDArray[np.float64], cut: float) -> tuple[int, int]:
    """Return the places of the nearest value at or below a cut and of that above."""
    below = np.where(values <= cut, values, -np.inf)
    above = np.where(values > cut, values, np.inf)
    return int(below.argmax()), int(above.argmin())
