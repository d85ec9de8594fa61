"""What rules reach on boxes: never less than at any point of them."""

from __future__ import annotations

import random
from fractions import Fraction
from typing import TYPE_CHECKING, Literal

import numpy as np
import pytest

from fuzzytree.auditing.engine.arrangement import arrange, strengths_at
from fuzzytree.auditing.engine.decisions import BoxBounds, columns, decision_at
from fuzzytree.auditing.engine.domain import Domain, DomainSide, contains
from fuzzytree.auditing.engine.nearest import distance
from fuzzytree.auditing.engine.probes import drawn_in
from fuzzytree.model.rulebase import Conjunction, RuleBase
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree
from tests.auditing.engine.bases import random_base

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray


def _rules(seed: int, conjunction: Conjunction = "minimum") -> RuleBase:
    tree = random_tree(seed, inputs=3, combinations=0.5)
    terms: Literal["raw", "relative"] = "raw" if tree.sets else "relative"
    return rules_from_tree(tree, terms, conjunction=conjunction)


def _box(rules: RuleBase) -> Domain:
    return Domain(tuple(DomainSide(name, -3.0, 3.0) for name in rules.inputs))


def _within(draw: random.Random, low: FloatArray, high: FloatArray) -> list[Fraction]:
    """Return a point of a box, often at one of its ends."""
    return [
        Fraction(draw.choice([a, b, draw.uniform(a, b)]))
        for a, b in zip(low.tolist(), high.tolist(), strict=True)
    ]


@pytest.mark.parametrize("conjunction", ["minimum", "product"])
@pytest.mark.parametrize("seed", range(4))
def test_no_point_of_a_box_is_outside_the_bounds(
    seed: int, conjunction: Conjunction
) -> None:
    rules = _rules(seed, conjunction)
    given = arrange(rules, _box(rules))
    around = BoxBounds(rules, given.domain)
    draw = random.Random(seed)
    centres = np.array([[draw.uniform(-3, 3) for _ in range(6)] for _ in rules.inputs])
    for radius in (0.0, 0.01, 0.3):
        low, high = around.ball(centres, radius)
        reached = around.reached(low, high)
        for box in range(6):
            for _ in range(4):
                values = _within(draw, low[:, box], high[:, box])
                point = dict(zip(rules.inputs, values, strict=True))
                for number, strength in enumerate(strengths_at(given, point)):
                    assert reached.low[number, box] <= strength
                    assert strength <= reached.high[number, box]


def test_a_ball_holds_all_points_within_its_radius() -> None:
    rules = _rules(0)
    around = BoxBounds(rules, _box(rules))
    centre = Fraction(0.1)
    low, high = around.ball(np.full((len(rules.inputs), 1), 0.1), 1 / 3)
    reach = Fraction(1 / 3) * 6
    assert all(end <= centre - reach for end in low[:, 0].tolist())
    assert all(end >= centre + reach for end in high[:, 0].tolist())


@pytest.mark.parametrize("seed", range(4))
def test_a_clear_box_has_no_other_decision(seed: int) -> None:
    rules = _rules(seed)
    given = arrange(rules, _box(rules))
    around = BoxBounds(rules, given.domain)
    draw = random.Random(seed)
    points = [
        dict(zip(rules.inputs, map(Fraction, row), strict=True))
        for row in ([draw.uniform(-3, 3) for _ in rules.inputs] for _ in range(12))
    ]
    labels = [decision_at(given, point) for point in points]
    low, high = around.ball(columns(points, rules.inputs), 0.01)
    clear = around.is_clear(low, high, labels)
    assert clear.any()
    for box in np.flatnonzero(clear).tolist():
        for _ in range(10):
            values = _within(draw, low[:, box], high[:, box])
            point = dict(zip(rules.inputs, values, strict=True))
            assert decision_at(given, point) == labels[box]
    assert not around.is_clear(low, high, ["another"] * 12).any()


@pytest.mark.parametrize("seed", range(3))
def test_steps_towards_another_class_end_where_it_is_ahead(seed: int) -> None:
    rules = random_base(seed, 6, 3, kind="mixed", shared=0.5)
    given = arrange(rules, Domain(tuple(DomainSide(n, 0.0, 1.0) for n in rules.inputs)))
    around = BoxBounds(rules, given.domain)
    draw = random.Random(seed)
    points = [
        {name: Fraction(draw.random()) for name in rules.inputs} for _ in range(20)
    ]
    labels = [decision_at(given, point) for point in points]
    found, away = around.approached(columns(points, rules.inputs), labels)
    assert (away < np.inf).mean() > 0.8
    others = 0
    for place in np.flatnonzero(away < np.inf).tolist():
        values = map(Fraction, found[:, place].tolist())
        other = dict(zip(rules.inputs, values, strict=True))
        others += decision_at(given, other) != labels[place]
        near = distance(given.domain, points[place], other)
        assert float(near) == pytest.approx(away[place])
    assert others > 10


@pytest.mark.parametrize("seed", range(3))
def test_points_are_drawn_within_the_sides_of_combinations(seed: int) -> None:
    rules = _rules(seed)
    variable = next(one for one in rules.variables if one.parts)
    sides = (*_box(rules).sides, DomainSide(variable.name, 0.0, 0.5))
    given = arrange(rules, Domain(sides))
    drawn = drawn_in(given, 64)
    assert drawn is not None
    for values in drawn.T.tolist():
        point = dict(zip(rules.inputs, map(Fraction, values), strict=True))
        wide = Domain((*sides[:-1], DomainSide(variable.name, -1e-9, 0.5 + 1e-9)))
        assert contains(wide, [variable], point)
    never = Domain((*sides[:-1], DomainSide(variable.name, 1e6, 2e6)))
    assert drawn_in(arrange(rules, never), 64) is None
