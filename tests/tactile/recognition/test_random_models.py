"""Random sensors, features, frames and models: every way from frame to class agrees."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree import LearningSettings, table
from fuzzytree.api.verbs import learn
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.tactile.features import frame_program
from fuzzytree.tactile.features.aimed import aimed_frames
from fuzzytree.tactile.features.names import FEATURES, LOG, PER_FORCE, feature_of
from fuzzytree.tactile.features.plain import plain_answer, plain_features
from fuzzytree.tactile.recognition.checking import check_frames
from fuzzytree.tactile.recognition.recogniser import Recogniser
from fuzzytree.tactile.runtimes.frames import FramePlan
from fuzzytree.tactile.sensor import Cells, Sensor
from tests.tactile.frames import hard_frames

pytestmark = pytest.mark.heavy

SHAPES = ((1, 2), (1, 23), (31, 1), (2, 2), (3, 3), (8, 5), (16, 16), (13, 18))
MODES: tuple[Literal["default", "paper"], ...] = ("default", "paper")
FULLS = (1, 2, 100, 254, 255, 256, 1023, 65535)


def random_sensor(draw: np.random.Generator) -> Sensor:
    """Return a sensor of any shape, with a baseline and masked cells now and then."""
    rows, columns = SHAPES[draw.integers(len(SHAPES))]
    full, size = int(draw.choice(FULLS)), rows * columns
    most = full if draw.random() < 0.3 else full // 8
    baseline = draw.integers(0, most + 1, size).tolist() if draw.random() < 0.5 else []
    count = int(draw.integers(size // 4 + 1)) if draw.random() < 0.5 else 0
    masked = [divmod(int(place), columns) for place in draw.integers(0, size, count)]
    threshold = int(draw.integers(0, min(full, 9)))
    return Sensor(rows, columns, full, threshold, tuple(baseline), tuple(masked))


def random_names(draw: np.random.Generator, sensor: Sensor) -> list[str]:
    """Return names of features, some as logarithms, some divided by the force."""
    row, column = int(draw.integers(sensor.rows)), int(draw.integers(sensor.columns))
    size = f"{sensor.rows}x{sensor.columns}"
    places = [f"cell r{row} c{column}", f"block r{row} c{column} of {size}"]
    found: list[str] = []
    for base in draw.permutation([*FEATURES, *places])[:7].tolist():
        kind = feature_of(base).kind
        is_scaled = kind != "moment" or base[0] == "S" or " " in base
        name = base + PER_FORCE if is_scaled and draw.random() < 0.4 else base
        found.append(LOG + name if draw.random() < 0.4 else name)
    return found


def random_frames(draw: np.random.Generator, sensor: Sensor) -> Cells:
    """Return aimed frames, hard ones, and noise beyond what a cell should read."""
    aimed = aimed_frames(sensor, 8, int(draw.integers(1000)))
    top, shape = int(np.iinfo(aimed.dtype).max), (6, sensor.rows, sensor.columns)
    hard = [*hard_frames(sensor, int(draw.integers(1000)), 16)]
    noise = draw.integers(0, top + 1, shape)
    return np.concatenate([aimed, np.array(hard), noise]).astype(aimed.dtype)


def random_model(
    draw: np.random.Generator, tree: FuzzyTree
) -> tuple[FuzzyTree | RuleBase, float]:
    """Return a tree, or rules of it, and a floor where rules have one."""
    match int(draw.integers(4)):
        case 0:
            return tree, 0.0
        case 1:
            return rules_from_tree(tree, "relative"), 0.0
        case 2:
            rules = rules_from_tree(tree, "raw")
            semantics = replace(rules.semantics, uncovered=rules.classes[-1])
            return replace(rules, semantics=semantics), 0.3
        case _:
            return rules_from_tree(tree, "raw"), float(draw.choice([0.001, 0.5, 1.0]))


@pytest.mark.parametrize("seed", range(24))
def test_every_way_from_frame_to_class_is_one(seed: int) -> None:
    draw = np.random.default_rng(seed)
    sensor = random_sensor(draw)
    names, frames = random_names(draw, sensor), random_frames(draw, sensor)
    made, plan = frame_program(sensor, names), FramePlan(sensor, names)
    found = plan(frames)
    for place, frame in enumerate(frames):
        plain, is_pressed = plain_features(made, frame)
        assert found.values[:, place].tobytes() == np.array(plain).tobytes()
        assert plan(frame).values.tobytes() == np.array(plain).tobytes()
        assert found.is_pressed[place] == is_pressed
    assert np.isfinite(found.values).all()
    target = [f"class {number}" for number in draw.integers(0, 4, len(frames))]
    mode = MODES[int(draw.random() < 0.3)]
    if np.ptp(found.values, axis=1).any():  # else there is nothing to learn
        tree = learn(
            table(found.values.T, columns=names),
            target=target,
            settings=LearningSettings(mode=mode),
        )
        model, reject = random_model(draw, tree)
        agreement = check_frames(model, sensor, frames, reject=reject)
        assert agreement.ok, agreement
        answers = Recogniser(model, sensor, reject)(frames)
        lines = [names.index(name) for name in model.inputs]
        for place, values in enumerate(found.values[lines].T.tolist()):
            is_pressed = bool(found.is_pressed[place])
            shown = plain_answer(model, values, is_pressed=is_pressed, reject=reject)
            code, state = answers.codes[place], answers.states[place]
            assert (shown.code, shown.state) == (code, state)
