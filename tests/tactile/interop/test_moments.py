"""OpenCV and scikit-image on the same frames."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fuzzytree.tactile.features.names import PAPER
from fuzzytree.tactile.runtimes.frames import FramePlan
from fuzzytree.tactile.sensor import Cells, Sensor

SENSOR = Sensor(16, 16)
HU = [(0, 1, 2), (1, 1, 4), (2, 1, 5), (3, 1, 5), (4, 2, 10), (5, 2, 7)]
"""Which of Hu's seven S1 to S6 are, their factor, and the power of the mass."""


def frames() -> Cells:
    cells = np.random.default_rng(11).integers(0, 256, (20, 16, 16))
    cells[cells < 120] = 0
    return cells


def ours() -> Any:
    return FramePlan(SENSOR, PAPER)(frames()).values.T


@pytest.mark.heavy
def test_opencv_has_the_same_first_six(library: Callable[[str], str]) -> None:
    library("cv2")
    import cv2

    for frame, found in zip(frames(), ours(), strict=True):
        moments = cv2.moments((frame / 255).astype(np.float32))  # float32 inside
        hu = cv2.HuMoments(moments)[:, 0]
        wanted = [f * hu[k] * moments["m00"] ** power for k, f, power in HU]
        assert found[:6] == pytest.approx(wanted, rel=1e-4)


@pytest.mark.heavy
def test_scikit_image_has_the_same_eleven(library: Callable[[str], str]) -> None:
    library("skimage")
    measure: Any = importlib.import_module("skimage.measure")

    for frame, found in zip(frames(), ours(), strict=True):
        central = measure.moments_central(frame / 255, order=4)
        hu = measure.moments_hu(measure.moments_normalized(central))
        mass = central[0, 0]
        wanted = [f * hu[k] * mass**power for k, f, power in HU]
        assert found[:6] == pytest.approx(wanted, rel=1e-8)
        m = central  # by row and column: a mirror image of ours, with the same S
        c40 = complex(m[4, 0] - 6 * m[2, 2] + m[0, 4], 4 * (m[3, 1] - m[1, 3]))
        c31 = complex(m[4, 0] - m[0, 4], 2 * (m[3, 1] + m[1, 3]))
        c22 = m[4, 0] + 2 * m[2, 2] + m[0, 4]
        c20 = complex(m[2, 0] - m[0, 2], 2 * m[1, 1])
        higher = [
            abs(c40) ** 2, abs(c31) ** 2, c22,
            2 * (c40.conjugate() * c31**2).real, 2 * (c31 * c20.conjugate()).real,
        ]  # fmt: skip
        assert found[6:] == pytest.approx(higher, rel=1e-10)
