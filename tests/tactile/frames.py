"""Frames that are hard on moments."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fuzzytree.tactile.sensor import Cells, Sensor


def hard_frames(sensor: Sensor, seed: int, count: int = 40) -> Iterator[Cells]:
    """Yield frames: sparse, full, nearly symmetric, of one or two cells, in a corner.

    Args:
        sensor: Whose frames.
        seed: Of the draws.
        count: How many.
    """
    draw = np.random.default_rng(seed)
    shape = (sensor.rows, sensor.columns)
    for number in range(count):
        cells = draw.integers(0, sensor.full + 1, shape)
        match number % 8:
            case 0:
                cells[cells < 0.8 * sensor.full] = 0
            case 1:  # symmetric about a point, but for one count
                cells = np.maximum(cells, cells[::-1, ::-1])
                cells[0, 0] = max(int(cells[0, 0]) - 1, 0)
            case 2:
                cells[:] = 0
                cells[tuple(draw.integers(0, side) for side in shape)] = sensor.full
            case 3:
                cells[:] = 0
                for value in (1, sensor.full):
                    cells[tuple(draw.integers(0, side) for side in shape)] = value
            case 4:  # a bar in a corner
                cells[:] = 0
                cells[: max(sensor.rows // 3, 1), -2:] = sensor.full
            case 5:
                cells[:] = sensor.full
                cells[-1, -1] -= 1
            case 6:
                cells[draw.random(shape) < 0.9] = 0
            case _:
                pass
        yield cells
