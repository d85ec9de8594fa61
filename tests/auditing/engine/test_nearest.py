"""Distances to the nearest point of a kind are bounded on both sides."""

from collections.abc import Mapping
from fractions import Fraction

import pytest

from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.nearest import (
    NARROW,
    Nearest,
    Polytopes,
    ball,
    distance,
    nearest,
    polytope_of,
)
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Proved,
    State,
    Witness,
    coordinates,
)

SQUARE = Domain((DomainSide("x", 0.0, 4.0), DomainSide("y", -1.0, 1.0)))
CENTRE = {"x": Fraction(1), "y": Fraction(0)}
LIMIT = Fraction(29, 10)


def nearest_box(*boxes: Domain) -> Nearest:
    parts = [polytope_of(box, [*CENTRE], {}) for box in boxes]
    return Polytopes(SQUARE, [*CENTRE], parts).nearest(CENTRE, range(len(parts)))


def _is_right(point: Mapping[str, Fraction]) -> bool:
    return point["x"] > LIMIT


def _ask_right(box: Domain) -> State:
    """Whether a box reaches beyond x = 2.9; the witness is its far end."""
    side = box.sides[0]
    if Fraction(side.high) <= LIMIT:
        return Proved("x is at most 2.9")
    point = {"x": Fraction(side.high), "y": Fraction(box.sides[1].high)}
    return Witness(coordinates(point), (Claim("decides", label="right"),))


def test_the_distance_is_bracketed_and_the_point_is_near_and_plain() -> None:
    found = nearest(SQUARE, CENTRE, _ask_right, _is_right)
    exact = (LIMIT - 1) / 4
    assert found.high is not None
    assert found.point is not None
    assert found.low <= exact <= found.high
    assert found.is_narrow
    assert found.high - found.low <= 2 * NARROW * found.high
    assert _is_right(found.point)
    assert found.point["y"] == 0  # what need not change does not
    assert distance(SQUARE, CENTRE, found.point) == found.high


def test_a_domain_without_such_a_point_has_no_nearest_one() -> None:
    found = nearest(SQUARE, CENTRE, lambda _: Proved(""), lambda _: False)
    assert found.is_none
    assert found.is_narrow
    assert found.point is None


def test_a_centre_of_the_kind_has_distance_zero() -> None:
    found = nearest(SQUARE, CENTRE, _ask_right, lambda _: True)
    assert (found.low, found.high, found.point) == (Fraction(0), Fraction(0), CENTRE)


def test_what_is_left_open_widens_the_bounds_and_says_why() -> None:
    def ask(box: Domain) -> State:
        found = _ask_right(box)
        if isinstance(found, Proved) and Fraction(box.sides[0].high) > 2:
            return Bracket("the lead", 0.0, 1.0, "too hard")
        return found

    found = nearest(SQUARE, CENTRE, ask, _is_right)
    assert found.high is not None
    assert found.low <= Fraction(1, 4) < (LIMIT - 1) / 4 <= found.high
    assert not found.is_narrow
    assert found.why == "too hard"


def test_beyond_the_limit_nothing_is_sought() -> None:
    found = nearest(SQUARE, CENTRE, _ask_right, _is_right, within=Fraction(1, 8))
    assert (found.low, found.high, found.is_none) == (Fraction(1, 8), None, False)


def test_a_spent_budget_keeps_what_is_proved() -> None:
    times = iter(range(1000))
    clock = Clock(1.5, now=lambda: float(next(times)))
    found = nearest(SQUARE, CENTRE, _ask_right, _is_right, clock)
    assert found.why == "the budget was spent"
    assert found.low <= (LIMIT - 1) / 4
    assert found.high is None or found.high >= (LIMIT - 1) / 4


def test_a_ball_is_rounded_outwards_and_stays_in_the_domain() -> None:
    box = ball(SQUARE, {"x": Fraction(1, 3), "y": Fraction(0)}, Fraction(1, 10))
    x, y = box.sides
    assert x.low == 0.0
    assert Fraction(x.high) >= Fraction(1, 3) + Fraction(4, 10)
    assert x.high - (1 / 3 + 0.4) < 1e-15
    assert (y.low, y.high) == (-0.2, 0.2)


def test_a_fixed_input_does_not_count_in_a_distance() -> None:
    domain = Domain((DomainSide("x", 0.0, 2.0), DomainSide("y", 5.0, 5.0)))
    one = {"x": Fraction(0), "y": Fraction(5)}
    assert distance(domain, one, {"x": Fraction(1), "y": Fraction(5)}) == Fraction(1, 2)


@pytest.mark.parametrize("is_open", [True, False])
def test_the_distance_to_the_nearest_box_is_exact(is_open: bool) -> None:
    far = Domain((DomainSide("x", 3.0, 4.0), DomainSide("y", -1.0, 1.0)))
    near = Domain(
        (DomainSide("x", 2.0, 4.0, is_open=is_open), DomainSide("y", -1.0, -0.25))
    )
    found = nearest_box(far, near)
    assert found.low == Fraction(1, 4)
    assert found.point is not None
    assert found.high is not None
    assert 2 < found.point["x"] <= Fraction(4002, 2000)
    assert Fraction(-1001, 4000) <= found.point["y"] <= Fraction(-1, 4)
    assert found.low < found.high <= found.low * (1 + NARROW)


def test_a_centre_at_an_open_end_has_distance_zero_and_a_point_beside_it() -> None:
    beside = Domain(
        (DomainSide("x", 1.0, 4.0, is_open=True), DomainSide("y", -1.0, 1.0))
    )
    found = nearest_box(beside)
    assert found.low == 0
    assert found.point is not None
    assert 1 < found.point["x"] < Fraction(1 + 1e-9)
    assert found.is_narrow


def test_without_a_box_there_is_no_nearest_one() -> None:
    assert nearest_box().is_none
