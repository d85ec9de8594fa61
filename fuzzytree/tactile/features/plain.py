"""Frame to class in plain Python, the reference of graphs and C code."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

from fuzzytree.model import Model, Value
from fuzzytree.semantics import Status, answer_of
from fuzzytree.semantics import evaluate_program as run
from fuzzytree.tactile.features import FrameProgram
from fuzzytree.tactile.sensor import Cells, pressed


class State(IntEnum):
    """What a frame shows."""

    OBJECT = 0
    """An object of one of the classes."""

    NOTHING = 1
    """Nothing presses: there is no centre of pressure, and no answer."""

    UNKNOWN = 2
    """Something that is none of the known objects."""


class Shown(Value, frozen=True):
    """What a frame shows.

    Attributes:
        features: The values of the features, in order.
        state: As a number.
        code: The place of the class among the classes, -1 for none.
        rule: The number of the rule or leaf that decides, from 1; 0 for none.
        strengths: Of every rule of a rule base; empty for a tree.
    """

    features: tuple[float, ...]
    state: State
    code: int
    rule: int
    strengths: tuple[float, ...] = ()


def plain_features(made: FrameProgram, frame: Cells) -> tuple[tuple[float, ...], bool]:
    """Return the features of one frame (rows, columns), and whether anything presses.

    Raises:
        TableError: If the frame is of another size, or holds no whole numbers.

    Example:
        >>> import numpy as np
        >>> from fuzzytree.tactile.features import frame_program
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> made = frame_program(Sensor(1, 3), ["area", "S1"])
        >>> plain_features(made, np.array([[255, 0, 255]]))
        ((2.0, 2.0), True)
    """
    cells: list[int] = pressed(made.sensor, frame)[0].reshape(-1).tolist()
    sums: dict[str, float] = {}
    for one in made.sums:
        match one.of:
            case "count":
                found = sum(value > 0 for value in cells)
            case "peak":
                found = max(cells)
            case _:
                pairs = zip(cells, one.weights, strict=True)
                found = sum(value * weight for value, weight in pairs if value)
        sums[one.name] = float(found)
    *features, is_pressed = run(made.program, sums).values
    return tuple(features), is_pressed > 0.0


def plain_shown(
    made: FrameProgram, model: Model, frame: Cells, reject: float = 0.0
) -> Shown:
    """Return what one frame shows, by `plain_features` and `plain_answer`."""
    values, is_pressed = plain_features(made, frame)
    return plain_answer(model, values, is_pressed=is_pressed, reject=reject)


def check_reject(model: Model, reject: float) -> None:
    """Refuse a floor that a model has no strengths for.

    Raises:
        ValueError: If it is no number in 0 to 1, or the model is a tree, or its rules
            are relative: one of them always has the strength 1.
    """
    if not 0.0 <= reject <= 1.0:
        raise ValueError(f"reject lies in 0 to 1, not {reject!r}")
    if not reject:
        return
    if not model.rules:
        raise ValueError(
            f"{model.name}: a tree has no strengths to reject by; give its raw rules"
        )
    if model.kind == "relative":
        raise ValueError(
            f"{model.name}: relative rules reject nothing, for one of them always has "
            "the strength 1; give the raw rules"
        )


def plain_answer(
    model: Model, values: Sequence[float], *, is_pressed: bool, reject: float = 0.0
) -> Shown:
    """Return what a frame shows, from the values of the model's inputs in their order.

    A class whose rule is weaker than `reject` is none of the known objects.
    """
    given = tuple(values)
    if not is_pressed:
        fired = (0.0,) * len(model.rules)
        return Shown(given, State.NOTHING, -1, 0, fired)
    answer = answer_of(model, dict(zip(model.inputs, given, strict=True)))
    is_weak = reject and answer.rule and answer.strengths[answer.rule - 1] < reject
    if is_weak or answer.label is None or answer.status == Status.MISSING:
        return Shown(given, State.UNKNOWN, -1, 0, answer.strengths)
    code = model.classes.index(answer.label)
    return Shown(given, State.OBJECT, code, answer.rule, answer.strengths)
