"""The usual floor of strength: it keeps what was learnt, and rejects what was not."""

from __future__ import annotations

import numpy as np
import pytest

from fuzzytree import table
from fuzzytree.api.verbs import learn
from fuzzytree.tactile.features.names import names_of
from fuzzytree.tactile.recognition.recogniser import Recogniser, State, usual_floor
from fuzzytree.tactile.runtimes.frames import features_of
from fuzzytree.tactile.simulation.objects import OBJECTS
from fuzzytree.tactile.simulation.physics import press


@pytest.mark.heavy
def test_the_usual_floor_reports_blobs_from_presses_of_known_objects() -> None:
    known = {name: press(name, 60, seed=0) for name in OBJECTS}
    sensor = known["circle"].sensor
    frames = np.concatenate([found.frames for found in known.values()])
    names = names_of("paper,orientation")
    values = features_of(sensor, frames, names).values.T
    labels = [name for name in OBJECTS for _ in range(60)]
    tree = learn(table(values, columns=names), target=labels)
    recognise = Recogniser(tree, sensor, usual_floor(tree))

    new = np.concatenate([press(name, 100, seed=7).frames for name in OBJECTS])
    states = recognise(new).states
    assert np.count_nonzero(states == State.UNKNOWN) == 0  # of 700

    random = np.random.default_rng(0)
    place = random.uniform(3, 13, (300, 2, 1, 1))
    width = random.uniform(0.5, 5, (300, 1, 1))
    height = 255 * random.uniform(0.2, 1, (300, 1, 1))
    y, x = np.mgrid[:16, :16]
    squares = (x - place[:, 0]) ** 2 + (y - place[:, 1]) ** 2
    blobs = (height * np.exp(-squares / width**2)).astype(np.uint8)
    states = recognise(blobs).states
    assert np.count_nonzero(states == State.UNKNOWN) > 250  # of 300
