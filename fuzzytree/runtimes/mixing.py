"""The probabilities of classes, mixed from strengths of rules in numpy.

`fuzzytree.model.probabilities` defines them. All counts are whole numbers that a double
holds, so sums in any order give the same bits.

A T-norm never grows along a path. So where the strength of a rule's beginning is below
`least_strength`, the weight of every rule that begins so is 0, and the row goes no
further (`mix`). Of a learned tree with 1,000 leaves a row meets about eleven.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.model import (
    WEIGHT_OF_ONE,
    Model,
    Outcome,
    RuleBase,
    Run,
    least_strength,
    parts_of,
    remember,
    shapes_of,
    squarings,
)
from fuzzytree.runtimes.best_first import forks_of, splits_of
from fuzzytree.runtimes.degrees import NUMBERS
from fuzzytree.runtimes.native_rules import (
    Degrees,
    fire_plan,
    firing_cost,
    plan_degrees,
    plan_rules,
    proposition_degrees,
)
from fuzzytree.runtimes.rows import (
    Axes,
    axis_values,
    checked,
    input_lines,
    known_rows,
)
from fuzzytree.semantics import Status

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray, IntArray
    from fuzzytree.numerics import Reals

_CHUNK = 1 << 14  # rows whose rules are all mixed
_WALK = 1 << 16  # rows that walk together
_BLOCK = 1 << 12  # rows at a node, about
_FEWEST = 2_000  # rows from which a walk pays
_LEAST_COST = 1_000.0  # of firing a row, in ns, from which a walk pays


@dataclass(frozen=True, slots=True)
class MixedFork:
    """A common beginning of rules, ready to be walked on from.

    Attributes:
        line: The line of the variable that is tested.
        degrees: How to compute the degrees of what may follow; None where a rule ends.
        branches: For each: the line of its degree, and the fork behind it.
        rule: The rule that ends here, from 1; 0 for none.
    """

    line: int
    degrees: Degrees | None
    branches: tuple[tuple[int, int], ...]
    rule: int


def class_probabilities(
    rules: Model, strengths: FloatArray, winner: IntArray
) -> FloatArray | None:
    """Return the probability of each class for each row.

    Args:
        rules: The rule base.
        strengths: Of each rule, shape (rules, rows).
        winner: The number of the winning rule of each row, from 1; 0 for none.

    Returns:
        Shape (classes, rows), NaN in rows without a rule; None if the rule base has
        no probabilities.
    """
    if rules.semantics.sharpness is msgspec.UNSET:
        return None
    parts = _parts(rules).T
    result = np.full((len(rules.classes), strengths.shape[1]), np.nan)
    for start in range(0, len(winner), _CHUNK):
        rows = start + np.flatnonzero(winner[start : start + _CHUNK])
        weights = weights_of(strengths[:, rows], rules.semantics.sharpness)
        result[:, rows] = _shares(rules, parts @ weights, winner[rows])
    return result


def _shares(rules: Model, counts: FloatArray, winner: IntArray) -> FloatArray:
    """Return counts, which are changed, as shares; the winner's class has the most."""
    place = rule_codes(rules)[winner], np.arange(len(winner))
    mine = counts[place]
    counts[place] = -1.0
    counts[place] = np.maximum(mine, counts.max(axis=0, initial=0.0) + 1.0)
    counts /= counts.sum(axis=0)
    return counts


def _parts(rules: Model) -> FloatArray:
    """Return the vector of each rule in millionths, of shape (rules, classes)."""

    def parts() -> FloatArray:
        return np.array([parts_of(r.probabilities) for r in rules.rules], np.float64)

    return remember(rules, "parts", parts)


def mix(rules: RuleBase) -> Run:
    """Return a function that gives the rule and the probabilities of each row.

    It is made once for a rule base. The probabilities have the bits that
    `class_probabilities` makes of all strengths. All rules are fired if that takes less
    time: on few rows, or of few rules; or if their beginnings do not divide the inputs,
    as those of a tree do.

    Returns:
        A function from values of shape (inputs, rows) to an outcome without strengths.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree, rated
        >>> rules = rules_from_tree(rated(random_tree(0), 0))
        >>> outcome = mix(rules)(np.zeros((len(rules.inputs), 1)))
        >>> outcome.probabilities.sum(axis=0).round(12).tolist()
        [1.0]
    """
    return remember(rules, "mix", lambda: _plan_mixture(rules))


def _plan_mixture(rules: RuleBase) -> Run:
    plan = plan_rules(rules)
    fired = fire_plan(plan, rules.inputs)
    fewest = _FEWEST if firing_cost(plan) >= _LEAST_COST else math.inf
    planned = functools.cache(lambda: _plan_walk(rules, plan.axes))

    def run(values: FloatArray) -> Outcome:
        array = checked(values, rules.inputs)
        count = array.shape[1]
        rule, status = np.zeros((2, count), np.int64)
        shares = np.full((len(rules.classes), count), np.nan)
        walk = planned() if count >= fewest else []
        for start in range(0, count, _WALK):
            part = slice(start, start + _WALK)
            if walk:
                with np.errstate(all="ignore"):
                    known = known_rows(plan.axes, array[:, part])
                    lines = input_lines(plan.axes, array[:, part][:, known])
                    rule[part][known], mixed = walk_rows(rules, plan.axes, walk, lines)
                status[part][~known] = Status.MISSING
                shares[:, part][:, known] = mixed
            else:
                outcome = fired(array[:, part])
                assert outcome.strengths is not None  # firing gives them
                rule[part], status[part] = outcome.rule, outcome.status
                shares[:, part] = class_probabilities(
                    rules, outcome.strengths, outcome.rule
                )
        return Outcome(rule, status, probabilities=shares)

    return run


def walk_rows(
    rules: RuleBase, axes: Axes, walk: Sequence[MixedFork], inputs: Reals
) -> tuple[IntArray, FloatArray]:
    """Return the rule of strength 1 of each row, and the shares of the classes."""
    sharpness, parts = rules.semantics.sharpness or 1, _parts(rules)
    least = least_strength(sharpness)
    combine = np.multiply if rules.semantics.conjunction == "product" else np.minimum
    winner = np.zeros(inputs.shape[1], np.int64)
    counts = np.zeros((len(winner), len(rules.classes)))
    todo = [(0, np.arange(len(winner)), np.ones(len(winner)))]
    while todo:
        number, rows, strength = todo.pop()
        fork = walk[number]
        if fork.degrees is None:
            winner[rows[strength == 1.0]] = fork.rule
            weights = weights_of(strength, sharpness)
            counts[rows] += weights[:, np.newaxis] * parts[fork.rule - 1]
            continue
        values = axis_values(axes, inputs, fork.line, rows)
        degrees = proposition_degrees(fork.degrees, values[np.newaxis])
        for line, target in fork.branches:
            behind = combine(strength, degrees[line])
            kept = np.flatnonzero(behind >= least)
            if len(kept):
                todo.append((target, rows.take(kept), behind.take(kept)))
    return winner, _shares(rules, counts.T, winner)


def _plan_walk(rules: RuleBase, axes: Axes) -> list[MixedFork]:
    """Return the beginnings of rules, none if they do not divide the inputs."""
    forks = forks_of(rules)
    if splits_of(rules, forks, axes.line) is None:
        return []
    shapes, numbers = shapes_of(rules.variables), NUMBERS["float64"]
    result: list[MixedFork] = []
    for fork in forks:
        if fork.rules:
            result.append(MixedFork(0, None, (), fork.rules[0]))
            continue
        steps = fork.propositions
        at_line = {steps[0].variable: 0}
        degrees = plan_degrees(shapes, steps, at_line, numbers, _BLOCK)
        lines = [degrees.line[step] for step in steps]
        branches = tuple(zip(lines, fork.targets, strict=True))
        result.append(MixedFork(axes.line[steps[0].variable], degrees, branches, 0))
    return result


def rule_codes(model: Model) -> IntArray:
    """Return the position of each rule's class among the classes; -1 for rule 0."""

    def codes() -> IntArray:
        position = {name: code for code, name in enumerate(model.classes)}
        return np.array([-1, *map(position.__getitem__, model.rule_labels)], np.int64)

    return remember(model, "rule codes", codes)


def weights_of(strengths: FloatArray, sharpness: int) -> FloatArray:
    """Return the weights of rules, whole numbers, given their strengths."""
    powers = strengths
    for _ in range(squarings(sharpness)):
        powers = powers * powers
    return np.floor(WEIGHT_OF_ONE * powers)
