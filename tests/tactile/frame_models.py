"""Models of a sensor's frames, to write and to run."""

from __future__ import annotations

import functools

import numpy as np
from press_physics import press
from press_shapes import OBJECTS

from fuzzytree import table
from fuzzytree.api.verbs import learn
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.tactile.cli.features import USUAL
from fuzzytree.tactile.features.aimed import aimed_frames
from fuzzytree.tactile.features.names import names_of
from fuzzytree.tactile.runtimes.frames import FramePlan
from fuzzytree.tactile.sensor import Sensor

PLAIN = Sensor(16, 16, threshold=4)
WIDE = Sensor(
    5,
    7,
    full=1000,
    threshold=30,
    baseline=tuple(place % 9 for place in range(35)),
    masked=((1, 2), (4, 6)),
)
SMALL = Sensor(6, 4, full=100)


@functools.cache
def pressed_tree(count: int, features: str = USUAL, seed: int = 1) -> FuzzyTree:
    """Return a tree on so many simulated presses of each of the paper's objects."""
    frames = np.concatenate([press(name, count, seed).frames for name in OBJECTS])
    names, sensor = names_of(features), press("circle", 1).sensor
    values = FramePlan(sensor, names)(frames).values.T
    labels = [name for name in OBJECTS for _ in range(count)]
    return learn(table(values, columns=names), target=labels)


@functools.cache
def learnt_tree(sensor: Sensor, names: tuple[str, ...], classes: int = 3) -> FuzzyTree:
    """Return a tree on features of made presses, that tells how hard they are."""
    frames = aimed_frames(sensor, 60, seed=3)[-60:]
    values = FramePlan(sensor, names)(frames).values
    force = frames.astype(np.int64).sum(axis=(1, 2))
    ends = np.quantile(force, np.arange(1, classes) / classes)
    target = [f"class {place}" for place in np.digitize(force, ends)]
    return learn(table(values.T, columns=list(names)), target=target)


def raw_rules(tree: FuzzyTree) -> RuleBase:
    """Return the raw rules of a tree."""
    return rules_from_tree(tree, "raw")
