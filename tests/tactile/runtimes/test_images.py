"""Features of images whose cells are no whole numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fuzzytree.errors import TableError
from fuzzytree.tactile.features.names import FEATURES
from fuzzytree.tactile.runtimes.frames import features_of
from fuzzytree.tactile.runtimes.images import features_of_images
from fuzzytree.tactile.sensor import Sensor

TABLE_2 = {
    "S1": 27.55, "S2": 512.47, "S7": 7088.0, "S8": 1.35e4, "S9": 129.68, "S11": 5260.1
}  # fmt: skip
"""The paper's rectangle in 0 degrees; S3 to S6 are noise of its sensor."""


def bar(length: float, width: float, points: int) -> np.ndarray:
    """Return a bar along x with so many points for each cell, its border shared."""
    side = (math.ceil(length) + 2) * points
    places = (np.arange(side) - (side - 1) / 2) / points

    def inside(extent: float) -> np.ndarray:
        return np.clip((extent / 2 - np.abs(places)) * points + 0.5, 0.0, 1.0)

    return np.outer(inside(width), inside(length))


def test_a_bar_has_the_moments_of_its_integrals() -> None:
    a, b = 5.55, 1.735
    mass = a * b
    c11, c20 = mass * (a * a + b * b) / 12, mass * (a * a - b * b) / 12
    m40, m22, m04 = mass * a**4 / 80, mass * a * a * b * b / 144, mass * b**4 / 80
    c40, c31, c22 = m40 - 6 * m22 + m04, m40 - m04, m40 + 2 * m22 + m04
    wanted = {"S1": c11, "S2": c20**2, "S7": c40**2, "S8": c31**2, "S9": c22}
    wanted |= {"S10": 2 * c40 * c31**2, "S11": 2 * c31 * c20}
    names = list(wanted)
    found = features_of_images(bar(a, b, 60), names, spacing=1 / 60).values[:, 0]
    assert found == pytest.approx(list(wanted.values()), rel=1e-3)


def test_a_bar_comes_near_the_papers_rectangle() -> None:
    image = bar(5.55, 1.735, 60)
    names = list(TABLE_2)
    found = features_of_images(image, names, spacing=1 / 60).values[:, 0]
    ratios = found / np.array(list(TABLE_2.values()))
    assert ratios.min() > 0.85
    assert ratios.max() < 1.0


def test_a_bar_has_exactly_no_odd_moments_in_any_place() -> None:
    image = np.zeros((40, 50))
    image[3:6, 11:32] = 0.7
    assert not features_of_images(image, ["S3", "S4", "S5", "S6"]).values.any()
    image[5, 30] += 1e-6
    assert features_of_images(image, ["S3"]).values[0, 0] > 0.0


def test_whole_frames_and_images_have_the_same_features() -> None:
    frames = np.random.default_rng(0).integers(0, 256, (5, 16, 12))
    names = list(FEATURES)
    one = features_of(Sensor(16, 12), frames, names).values
    two = features_of_images(frames / 255.0, names).values
    assert two == pytest.approx(one, rel=1e-11)


def test_where_nothing_presses_there_is_nothing() -> None:
    found = features_of_images(np.zeros((3, 3)), list(FEATURES))
    assert not found.values.any()
    assert not found.is_pressed.any()


@pytest.mark.parametrize(
    ("image", "text"),
    [
        (np.full((2, 2), np.nan), "an image holds pressures from 0 on, none missing "
                                  "or infinite"),
        (np.full((2, 2), -1.0), "an image holds pressures from 0 on, none missing or "
                                "infinite"),
        (np.zeros(4), "images have the shape (images, rows, columns), not (4,)"),
    ],
)  # fmt: skip
def test_an_image_that_is_none_is_refused(image: np.ndarray, text: str) -> None:
    with pytest.raises(TableError) as caught:
        features_of_images(image, ["S1"])
    assert str(caught.value) == text


def test_an_image_has_no_cells() -> None:
    with pytest.raises(TableError) as caught:
        features_of_images(np.ones((2, 2)), ["cell r0 c0"])
    text = "'cell r0 c0' is a feature of frames, not of images"
    assert str(caught.value) == text
