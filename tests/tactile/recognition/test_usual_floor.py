"""What is taught as usual: features and floor keep the known and reject the rest."""

from __future__ import annotations

import functools

import msgspec
import numpy as np
import pytest
from press_physics import press
from press_shapes import OBJECTS

from fuzzytree.model import USUAL_FLOOR
from fuzzytree.semantics import rules_from_tree
from fuzzytree.tactile.cli.features import USUAL
from fuzzytree.tactile.recognition.recogniser import Recogniser, State, usual_floor
from fuzzytree.tactile.sensor import Cells
from tests.tactile.frame_models import pressed_tree


def pressed_frames(count: int, seed: int) -> Cells:
    return np.concatenate([press(name, count, seed).frames for name in OBJECTS])


@functools.cache
def usual_recogniser(count: int, features: str = USUAL) -> Recogniser:
    """Return what recognises as usual, from so many presses of each object."""
    tree, sensor = pressed_tree(count, features), press("circle", 1).sensor
    return Recogniser(tree, sensor, usual_floor(tree))


def share_right(recognise: Recogniser, gain: float) -> float:
    """Return the share of 210 new presses that are recognised, at another gain."""
    cells = np.rint(pressed_frames(30, 99) * gain).clip(0, 255).astype(np.uint8)
    found = recognise(cells)
    right = [
        found.label(30 * code + number) == name
        for code, name in enumerate(OBJECTS)
        for number in range(30)
    ]
    return sum(right) / len(right)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("gain", [0.8, 1.0, 1.3])
def test_the_usual_features_hold_at_another_gain(gain: float) -> None:
    assert share_right(usual_recogniser(60), gain) >= 0.98


@pytest.mark.heavy
def test_features_that_are_not_divided_by_the_force_do_not() -> None:
    raw = usual_recogniser(60, "paper,orientation")
    assert share_right(raw, 0.8) < 0.8
    assert share_right(raw, 1.3) < 0.7


def test_a_floor_that_was_measured_is_the_usual_one() -> None:
    tree = pressed_tree(60)
    semantics = msgspec.structs.replace(tree.semantics, floor=0.0)
    measured = msgspec.structs.replace(tree, semantics=semantics)
    assert usual_floor(tree) == USUAL_FLOOR
    assert usual_floor(measured) == 0.0
    raw = rules_from_tree(measured, "raw")
    assert usual_floor(raw) == 0.0
    assert usual_floor(rules_from_tree(measured)) == 0.0  # relative


def test_few_presses_are_enough_for_the_usual_floor() -> None:
    assert share_right(usual_recogniser(5), 1.0) >= 0.9


@pytest.mark.heavy
def test_the_usual_floor_reports_blobs_from_presses_of_known_objects() -> None:
    recognise = usual_recogniser(60)
    states = recognise(pressed_frames(100, 7)).states
    assert np.count_nonzero(states == State.UNKNOWN) <= 14  # of 700

    random = np.random.default_rng(0)
    place = random.uniform(3, 13, (300, 2, 1, 1))
    width = random.uniform(0.5, 5, (300, 1, 1))
    height = 255 * random.uniform(0.2, 1, (300, 1, 1))
    y, x = np.mgrid[:16, :16]
    squares = (x - place[:, 0]) ** 2 + (y - place[:, 1]) ** 2
    blobs = (height * np.exp(-squares / width**2)).astype(np.uint8)
    states = recognise(blobs).states
    assert np.count_nonzero(states == State.UNKNOWN) > 225  # of 300
