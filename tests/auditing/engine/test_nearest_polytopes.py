"""The nearest point of a polytope: no nearer one is, and one is all but there."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest

from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.domain import Domain, DomainSide, variable_value
from fuzzytree.auditing.engine.nearest import Nearest, Polytopes, distance, polytope_of
from fuzzytree.model.rulebase import Part, Variable

NONE, ONE = Fraction(0), Fraction(1)
NAMES = ("x", "y", "z")
UNIT = Domain(tuple(DomainSide(name, 0.0, 1.0) for name in NAMES))
SUM = Variable("sum", parts=(Part("x", 1.0), Part("y", 1.0)))
LEAN = Variable("lean", parts=(Part("x", 2.0), Part("y", -1.0), Part("z", 0.5)))
VARIABLES = {one.name: one for one in (*map(Variable, NAMES), SUM, LEAN)}


def _nearest(centre: dict[str, float], *boxes: tuple[DomainSide, ...]) -> Nearest:
    whole = {side.variable: side for side in UNIT.sides}
    parts = [
        polytope_of(
            Domain(tuple((whole | {s.variable: s for s in sides}).values())),
            NAMES,
            VARIABLES,
        )
        for sides in boxes
    ]
    asked = Polytopes(UNIT, NAMES, parts)
    at = {name: Fraction(centre[name]) for name in NAMES}
    return asked.nearest(at, range(len(parts)))


def test_a_half_space_is_as_far_as_its_inputs_must_move_together() -> None:
    found = _nearest({"x": 0.25, "y": 0.25, "z": 0.5}, (DomainSide("sum", 1.0, 2.0),))
    assert found.low == Fraction(1, 4)
    assert found.is_narrow
    assert found.point is not None
    assert found.point["z"] == Fraction(1, 2)  # moves for nothing


def test_an_input_that_is_at_its_end_leaves_the_way_to_the_others() -> None:
    # y is at its end: x alone must bring the sum from 1.25 to 1.75.
    found = _nearest({"x": 0.25, "y": 1.0, "z": 0.5}, (DomainSide("sum", 1.75, 2.0),))
    assert found.low == Fraction(1, 2)


def test_two_half_spaces_are_farther_together_than_either() -> None:
    # The sum may be 1 at 1/4, and lean at most -1/2 at 1/14, but not both at once.
    start = {"x": 0.25, "y": 0.25, "z": 0.0}
    one, two = DomainSide("sum", 1.0, 2.0), DomainSide("lean", -2.0, -0.5)
    alone = max(_nearest(start, (one,)).low, _nearest(start, (two,)).low)
    both = _nearest(start, (one, two))
    assert both.low > alone
    # x + y >= 1 and y >= 2x + z/2 + 1/2 meet at x = 1/6, y = 5/6.
    assert both.low == Fraction(7, 12)
    assert both.is_narrow


def test_an_open_end_is_met_just_behind() -> None:
    found = _nearest(
        {"x": 0.5, "y": 0.5, "z": 0.5}, (DomainSide("sum", 1.0, 2.0, "model", True),)
    )
    assert found.low == 0
    assert found.point is not None
    assert found.point["x"] + found.point["y"] > 1


def test_the_nearest_of_several_counts_and_an_empty_one_does_not() -> None:
    start = {"x": 0.0, "y": 0.0, "z": 0.0}
    empty = (DomainSide("sum", 2.0, 3.0, "model", True),)
    never = (DomainSide("x", 0.5, 1.0), DomainSide("sum", 0.0, 0.25))
    far, near = (DomainSide("sum", 1.0, 2.0),), (DomainSide("x", 0.25, 1.0),)
    assert _nearest(start, empty, never).is_none
    assert _nearest(start, far, empty, near, never).low == Fraction(1, 4)


def test_a_spent_budget_is_reported() -> None:
    asked = Polytopes(UNIT, NAMES, [polytope_of(UNIT, NAMES, VARIABLES)])
    times = iter([0.0, 9.0, 9.0])
    clock = Clock(1.0, now=lambda: next(times))
    found = asked.nearest(dict.fromkeys(NAMES, Fraction(1, 2)), [0], clock)
    assert (found.high, found.why) == (None, "the budget was spent")


@pytest.mark.parametrize("seed", range(6))
def test_no_point_that_is_drawn_is_nearer(seed: int) -> None:
    draw = random.Random(seed)
    variables = dict(VARIABLES)
    sides: list[DomainSide] = []
    for number in range(3):
        parts = tuple(Part(name, draw.uniform(-1.0, 1.0)) for name in NAMES)
        variables[f"v{number}"] = one = Variable(f"v{number}", parts=parts)
        at = {name: Fraction(draw.random()) for name in NAMES}
        value = float(variable_value(one, at))
        sides.append(DomainSide(one.name, value, value + draw.random(), "model", True))
    box = Domain((*UNIT.sides, *sides))
    asked = Polytopes(UNIT, NAMES, [polytope_of(box, NAMES, variables)])
    centre = {name: Fraction(draw.random()) for name in NAMES}
    found = asked.nearest(centre, [0])
    assert found.is_narrow

    def is_inside(point: dict[str, Fraction]) -> bool:
        values = [(s, variable_value(variables[s.variable], point)) for s in box.sides]
        return all(
            s.low <= v <= s.high and not (s.is_open and v == s.low) for s, v in values
        )

    if found.point is not None:
        assert is_inside(found.point)
        assert distance(UNIT, centre, found.point) == found.high
    for _ in range(60):
        point = {
            name: min(max(x + Fraction(draw.uniform(-1, 1)) * found.low, NONE), ONE)
            for name, x in centre.items()
        }
        assert not is_inside(point) or distance(UNIT, centre, point) >= found.low
