"""From frames to what lies on the sensor."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

import msgspec
import numpy as np

from fuzzytree.api import opened
from fuzzytree.errors import TableError
from fuzzytree.files import PathLike
from fuzzytree.model import (
    USUAL_FLOOR,
    FloatArray,
    FuzzyTree,
    IntArray,
    Model,
    Outcome,
    RuleBase,
    Run,
)
from fuzzytree.runtimes import class_probabilities, load
from fuzzytree.semantics import Status, rules_from_tree, rules_of
from fuzzytree.tactile.features.names import feature_of, has_unit
from fuzzytree.tactile.features.plain import State as State
from fuzzytree.tactile.features.plain import check_reject
from fuzzytree.tactile.runtimes.frames import Features, FramePlan
from fuzzytree.tactile.sensor import Cells, Sensor

FEW = 10
"""Rows of a class below which a tree rejects nothing by itself."""


@dataclass(frozen=True, slots=True)
class Recognition:
    """The answers to some frames.

    Attributes:
        classes: The names of the classes.
        codes: Shape (frames,): the place of the class in `classes`; -1 for none.
        states: Shape (frames,): a `State` each.
        rules: Shape (frames,): the number of the rule or leaf that decides; 0 for none.
        strengths: Shape (classes, frames), in [0, 1]: the strongest rule of each
            class; 0 where nothing presses.
        features: The features of the frames.
    """

    classes: tuple[str, ...]
    codes: IntArray
    states: IntArray
    rules: IntArray
    strengths: FloatArray
    features: Features

    def label(self, frame: int = 0) -> str:
        """Return the class of a frame, `nothing` or `unknown`."""
        state = State(int(self.states[frame]))
        if state is State.OBJECT:
            return self.classes[int(self.codes[frame])]
        return state.name.lower()


class Recogniser:
    """A model and a sensor, ready for frames.

    A tree decides by its path; its strengths are those of its raw rules (of its
    relative rules where it carries no fitted sets). What is weaker than `reject` in
    the rule that decides is none of the known objects.

    Args:
        model: A tree or a rule base whose inputs are names of features.
        sensor: Whose frames will come.
        reject: The floor of the strength, 0 to 1; 0 rejects only what no rule covers.

    Raises:
        TableError: If an input of the model is no feature of a frame, or one of
            pressure is in another unit than the sensor's.
        InvalidModelError: If a feature is beyond the sensor.
        ValueError: If `reject` is no number in 0 to 1, or if the rules are relative:
            one of them always has the strength 1.

    Example:
        >>> from fuzzytree import learn, table
        >>> small, large = np.eye(4, dtype=np.uint8), np.full((4, 4), 9, np.uint8)
        >>> sensor = Sensor(4, 4)
        >>> areas = np.array([[4.0], [5.0], [16.0], [15.0]])
        >>> tree = learn(table(areas, columns=["area"]), target=["s", "s", "l", "l"])
        >>> found = Recogniser(tree, sensor)(np.array([small, large, 0 * small]))
        >>> [found.label(frame) for frame in range(3)]
        ['s', 'l', 'nothing']
    """

    def __init__(self, model: Model, sensor: Sensor, reject: float = 0.0) -> None:
        check_inputs(model, sensor)
        rules = strength_rules(model)
        check_reject(rules, reject)
        self.model, self.sensor, self.reject = model, sensor, reject
        self.plan = FramePlan(sensor, model.inputs)
        self._place = FramePlan(sensor, ("x", "y", "angle"))
        self._decide: Run = load(model)
        self._fire: Run | None = load(rules) if rules is not model else None
        code = {label: place for place, label in enumerate(model.classes)}
        codes = [code[label] for label in model.rule_labels]
        self._class_of = np.array(codes, np.int64)
        other = model.semantics.uncovered
        self._uncovered = -1 if other is None else code[other]
        self._rated: RuleBase | None = None  # what mixes the model's probabilities
        if model.semantics.sharpness is not msgspec.UNSET:
            self._rated = rules_of(model)
            self._rate: Run = load(self._rated)

    def __call__(self, frames: Cells) -> Recognition:
        """Return what frames show, of shape (frames, rows, columns) or one frame.

        Raises:
            TableError: If the frames are of another size, or no whole numbers.
        """
        features = self.plan(frames)
        outcome = self._decide(features.values)
        fired = outcome if self._fire is None else self._fire(features.values)
        strengths = _strengths(fired)
        rules, is_none = outcome.rule, outcome.rule == 0
        codes = np.where(is_none, self._uncovered, self._class_of[rules - 1])
        own = strengths[np.maximum(rules - 1, 0), np.arange(len(rules))]
        is_unknown = (codes < 0) | (~is_none & (own < self.reject))
        states = np.where(is_unknown, State.UNKNOWN, State.OBJECT)
        states = np.where(features.is_pressed, states, State.NOTHING)
        is_missing = outcome.status == Status.MISSING  # a feature beyond doubles
        states = np.where(is_missing & features.is_pressed, State.UNKNOWN, states)
        by_class = np.zeros((len(self.model.classes), len(rules)))
        np.fmax.at(by_class, self._class_of, strengths)  # NaN, missing, counts 0
        is_object = states == State.OBJECT
        return Recognition(
            self.model.classes,
            np.where(is_object, codes, -1),
            states.astype(np.int64),
            np.where(is_object, rules, 0),
            np.where(features.is_pressed, by_class, 0.0),
            features,
        )

    def probabilities(self, frame: Cells) -> tuple[float, ...]:
        """Return the probability of each class for one frame.

        Empty where the model has none, and where no rule fires.
        """
        if self._rated is None:
            return ()
        outcome = self._rate(self.plan(frame).values)
        found = class_probabilities(self._rated, _strengths(outcome), outcome.rule)
        row = [] if found is None else found[:, 0].tolist()
        return () if any(map(math.isnan, row)) else tuple(row)

    def place(self, frame: Cells) -> tuple[float, float, float]:
        """Return x and y of the centre of pressure of a frame, and its angle."""
        x, y, angle = self._place(frame).values[:, 0].tolist()
        return x, y, angle


def _strengths(outcome: Outcome) -> FloatArray:
    assert outcome.strengths is not None  # rules that are fired have them
    return outcome.strengths


def usual_floor(model: Model) -> float:
    """Return the floor of strength below which one usually rejects.

    It is 0 for relative rules, and for a tree that was taught a class with fewer than
    `FEW` rows: its sets end where these few end. A model that was learnt with groups
    left out states its own; any other has the usual one.

    Example:
        >>> from fuzzytree import learn, table
        >>> areas = np.array([[4.0], [5.0], [16.0], [15.0]])
        >>> tree = learn(table(areas, columns=["area"]), target=["s", "s", "l", "l"])
        >>> usual_floor(tree), usual_floor(rules_from_tree(tree))
        (0.0, 0.0)
        >>> many = learn(table(np.tile(areas, (5, 1)), columns=["area"]),
        ...     target=["s", "s", "l", "l"] * 5)
        >>> usual_floor(many)
        0.001
    """
    if strength_rules(model).kind == "relative":
        return 0.0
    if model.semantics.floor is not msgspec.UNSET:
        return model.semantics.floor
    taught = dict.fromkeys(model.classes, 0.0)
    for leaf in model.leaves:
        taught[leaf.label] += FEW if leaf.support is None else leaf.support
    has_few = any(0 < count < FEW for count in taught.values())
    return 0.0 if has_few else USUAL_FLOOR


def strength_rules(model: Model) -> RuleBase:
    """Return the rules whose firing strengths measure the certainty of a model."""
    is_raw = model.leaves and (model.sets or not model.nodes)
    return rules_from_tree(model, "raw") if is_raw else rules_of(model)


def check_inputs(model: Model, sensor: Sensor | None = None) -> None:
    """Refuse a model with inputs that frames do not have, or not in its units.

    Raises:
        TableError: If an input is no feature, or a pressure in another unit than that
            of a sensor; it names the model.
    """
    units = {variable.name: variable.unit for variable in model.variables}
    for name in model.inputs:
        try:
            feature = feature_of(name)
        except TableError as error:
            raise TableError(f"{model.name} uses other features: {error}") from error
        if sensor is None or not has_unit(feature) or name not in units:
            continue
        if units[name] != sensor.unit:
            own, other = (one or "shares of full" for one in (units[name], sensor.unit))
            text = f"{name!r} is in {own}, and the frames are in {other}"
            raise TableError(f"{model.name}: {text}")


def frames_model(source: Model | PathLike) -> Model:
    """Return the model of a file, which must be a tree or a rule base, or a model.

    Raises:
        TableError: If it is something else; it begins with the path.
    """
    model = opened(source)
    if not isinstance(model, FuzzyTree | RuleBase):
        name = (
            os.fspath(source) if isinstance(source, str | os.PathLike) else model.name
        )
        raise TableError(f"{name}: a model of frames is a tree or a rule base")
    return model
