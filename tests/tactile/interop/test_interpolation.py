"""Bilinear values of OpenCV and SciPy, and how far fuzzy interpolation is from them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import interpolation
import numpy as np
import numpy.typing as npt
import pytest

from fuzzytree.tactile.interpolation import interpolated

FRAMES = np.random.default_rng(4).integers(0, 256, (20, 9, 7), dtype=np.uint8)
BOUND = 0.10472  # of the range, derived in docs/explanation/interpolation.md
ROUNDING = 1e-4  # OpenCV computes in float32, of numbers up to 255

Floats = npt.NDArray[np.float64]


def by_opencv(cells: npt.NDArray[np.uint8], times: int) -> Floats:
    import cv2

    found: Any = cv2.resize(cells.astype(np.float32), None, fx=times, fy=times)
    return np.asarray(found, np.float64)


def by_scipy(cells: npt.NDArray[np.uint8], times: int) -> Floats:
    from scipy import ndimage

    found: Any = ndimage.zoom(
        cells.astype(float), times, order=1, mode="nearest", grid_mode=True
    )
    return np.asarray(found, np.float64)


WITNESSES = {"cv2": by_opencv, "scipy": by_scipy}


@pytest.mark.parametrize("name", WITNESSES)
@pytest.mark.parametrize("times", [2, 3, 5, 7])
def test_bilinear_values_are_those_of_others(
    library: Callable[[str], str], name: str, times: int
) -> None:
    library(name)
    for cells in FRAMES:
        found = WITNESSES[name](cells, times)
        ours = interpolation.bilinear(cells, times)
        assert np.abs(found - ours).max() < ROUNDING


@pytest.mark.parametrize("name", WITNESSES)
@pytest.mark.parametrize("times", [3, 5, 7])
def test_fuzzy_values_equal_bilinear_ones_on_lines_of_centres_and_stay_near_elsewhere(
    library: Callable[[str], str], name: str, times: int
) -> None:
    library(name)
    half = times // 2
    for cells in FRAMES:
        difference = np.abs(interpolated(cells, times) - WITNESSES[name](cells, times))
        assert difference[half::times].max() < ROUNDING
        assert difference[:, half::times].max() < ROUNDING
        spread = float(cells.max()) - float(cells.min())
        assert 0.0 < difference.max() < BOUND * spread + ROUNDING
