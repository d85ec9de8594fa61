"""The rows of a study: a table's, repeated as often as needed, or made of the model."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.model.contracts import Model
from fuzzytree.semantics.probing import landmarks

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

_REACH = 0.1  # of a range that is taken from landmarks: how far beyond rows may lie


def made_rows(model: Model, count: int, *, seed: int = 0) -> tuple[FloatArray, str]:
    """Return rows that are spread evenly over what a model declares.

    Each input is drawn by itself between the `low` and `high` of its variable. One that
    declares none is drawn from where its terms change their formula, and a tenth
    beyond; one that only combinations use, within a unit of each of them.

    Args:
        model: A tree or a rule base.
        count: How many rows.
        seed: The same model, count and seed give the same rows.

    Returns:
        Values of shape (inputs, rows), and a sentence that says what they are.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> values, what = made_rows(random_tree(1), 5)
        >>> values.shape[1]
        5
    """
    chance = np.random.default_rng(seed)
    ranges = {name: _range(model, name) for name in model.inputs}
    lines = [chance.uniform(low, high, count) for low, high, _ in ranges.values()]
    values = np.array(lines, np.float64).reshape(len(ranges), count)
    guessed = [name for name, (_, _, is_declared) in ranges.items() if not is_declared]
    what = f"made from the model's declared ranges, seed {seed}"
    if guessed:
        shown = ", ".join(map(repr, guessed[:4])) + (", ..." if guessed[4:] else "")
        verb = "declares" if len(guessed) == 1 else "declare"
        what += f"; {shown} {verb} none: from terms or combinations"
    return values, what


def _range(model: Model, name: str) -> tuple[float, float, bool]:
    """Return between which values an input is drawn, and whether it declares them."""
    known: list[float] = []
    for variable in model.variables:
        if variable.name == name and not variable.parts:
            low, high = variable.low, variable.high
            if low is not None and high is not None:
                return *_apart(low, high), True
            ends = [end for end in (low, high) if end is not None]
            known += [*ends, *(v for t in variable.terms for v in landmarks(t.shape))]
    if not known:
        for variable in model.variables:
            for part in variable.parts:
                if part.input == name:
                    unit = min(max(1.0 / abs(part.weight), 1e-100), 1e100)
                    known += [part.centre - unit, part.centre + unit]
    low, high = min(known, default=0.0), max(known, default=1.0)
    more = _REACH * (high / 2 - low / 2)
    return *_apart(low - more, high + more), False


def _apart(low: float, high: float) -> tuple[float, float]:
    """Return a range that can be drawn from: its width is finite and not zero."""
    if low == high:
        return low, math.nextafter(high, math.inf)
    half = np.finfo(np.float64).max / 2.0
    return max(low, -half), min(high, half)


def repeated(values: FloatArray, count: int) -> FloatArray:
    """Return so many rows: the first ones, or all of them again and again.

    Args:
        values: Shape (inputs, rows), at least one row.
        count: How many rows.

    Example:
        >>> repeated(np.array([[1.0, 2.0]]), 5).tolist()
        [[1.0, 2.0, 1.0, 2.0, 1.0]]
    """
    return np.ascontiguousarray(values.take(np.arange(count) % values.shape[1], axis=1))
