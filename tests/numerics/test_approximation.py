"""Models of points and of lower degrees: bounds that hold, decisions that stay."""

from __future__ import annotations

import itertools
import math
import random
from fractions import Fraction

import numpy as np
import pytest

from fuzzytree.errors import LossError
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Conjunction,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Shape,
    Side,
    Term,
    Variable,
    shapes_of,
)
from fuzzytree.numerics.approximation import by_degree, by_points, lower_curve
from fuzzytree.numerics.exact import exact_degree
from fuzzytree.numerics.placing import points_of
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import degree, evaluate
from fuzzytree.testing import probes, random_tree, with_points

SHAPES: dict[str, LR] = {
    "set": LR(0.3, Side(0.1, (0.4, 0.2, -0.1)), Side(0.7, (0.6, 0.1))),
    "set with a roof": LR(0.0, Side(1.0, (-0.2, 0.9)), Side(1.0, (0.0,))),
    "set that ends early": LR(0.0, Side(1.0, (3.0, -8.0, 2.0)), Side(2.0, (1.0,))),
    "set of wild sides": LR(0.0, Side(1.0, (1e6, -1e6, 1e6)), Side(1.0, (9.0,) * 8)),
    "set with a long tail": LR(0.0, Side(1.0, (0.5,), 1e300), Side(1.0, (0.5,), 1.01)),
    "set at 1e9": LR(1e9, Side(1.0, (0.4, 0.1)), Side(1 / 3, (0.4,))),
}
CONJUNCTIONS: tuple[Conjunction, ...] = ("minimum", "product")
TOLERANCES = (0.1, 1e-3, 1e-5)
CASES = [
    pytest.param(shape, tolerance, id=f"{name} {tolerance}")
    for name, shape in SHAPES.items()
    for tolerance in TOLERANCES
]


def places(shape: Points, seed: int = 0) -> list[Fraction]:
    """Return the points, the doubles beside them, and places all over the lines.

    Of a long list of lines some are drawn; the first and last stay.
    """
    chance = random.Random(seed)
    lines = list(itertools.pairwise(shape.values))
    if len(lines) > 40:
        lines = [*lines[:8], *chance.sample(lines, 24), *lines[-8:]]
    found: list[Fraction] = []
    for a, b in lines:
        start, width = Fraction(a), Fraction(b) - Fraction(a)
        shares = [*range(17), Fraction(chance.random()) * 16, Fraction(1, 10**9)]
        found += [start + width * Fraction(share) / 16 for share in shares]
        for end in (a, b):
            near = math.nextafter(end, -math.inf), math.nextafter(end, math.inf)
            found += [Fraction(one) for one in near if math.isfinite(one)]
    return [*found, Fraction(10) ** 320, -(Fraction(10) ** 320), *map(Fraction, (0, 1))]


def largest_error(found: Shape, shape: Shape, at: list[Fraction]) -> Fraction:
    return max(abs(exact_degree(found, x) - exact_degree(shape, x)) for x in at)


def model_of(*shapes: Shape, conjunction: Conjunction = "minimum") -> RuleBase:
    """Return a rule that tests a variable for each shape."""
    variables = tuple(
        Variable(f"x{number}", (Term("t", shape),))
        for number, shape in enumerate(shapes)
    )
    propositions = tuple(Proposition(variable.name, ("t",)) for variable in variables)
    rules = (Rule(propositions, "a"),)
    return RuleBase("one", ("a",), variables, rules, Semantics(conjunction))


@pytest.mark.one_in(4)
@pytest.mark.parametrize(("shape", "tolerance"), CASES)
def test_no_degree_is_further_off_than_certified(shape: LR, tolerance: float) -> None:
    found, bound = points_of(shape, tolerance)
    assert largest_error(found, shape, places(found)) <= Fraction(bound)
    assert bound <= tolerance


@pytest.mark.parametrize("name", ["set", "set at 1e9"])
def test_a_bound_is_close_to_the_error_that_occurs(name: str) -> None:
    shape = SHAPES[name]
    found, bound = points_of(shape, 1e-3)
    assert largest_error(found, shape, places(found)) >= Fraction(bound) * Fraction(
        19, 20
    )


@pytest.mark.parametrize("name", ["set", "set at 1e9"])
def test_a_point_that_moved_breaks_the_bound(name: str) -> None:
    shape = SHAPES[name]
    found, bound = points_of(shape, 1e-3)
    for position in range(1, len(found.values) - 1, 3):
        degrees = list(found.degrees)
        degrees[position] += 3e-3 if degrees[position] < 0.5 else -3e-3
        moved = Points(found.values, tuple(degrees))
        at = [Fraction(found.values[position])]
        assert largest_error(moved, shape, at) > Fraction(bound)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("tolerance", TOLERANCES)
@pytest.mark.parametrize("name", SHAPES)
def test_the_doubles_of_degree_zero_and_one_stay(name: str, tolerance: float) -> None:
    shape = SHAPES[name]
    found, _ = points_of(shape, tolerance)
    ends = [found.values[0], found.values[-1], shape.mean]
    near = {math.nextafter(end, far) for end in ends for far in (-math.inf, math.inf)}
    for x in map(Fraction, {*ends, *near}):
        kept, given = exact_degree(found, x), exact_degree(shape, x)
        if given > Fraction(2, 2**53):
            assert kept > 0
        if given == 0:
            assert kept <= Fraction(2, 2**53)


def test_a_set_is_one_at_its_mean_only() -> None:
    found, _ = points_of(SHAPES["set"], 1e-4)
    assert found.values[found.degrees.index(1.0)] == 0.3
    assert found.degrees.count(1.0) == 1


# Lines that are nearly as far from a curve as they may be, on either side of it, need
# half the research's points on each side of a set: it had 9 to 11, 28 to 38, 92 to 126
# and 269 to 384.
@pytest.mark.one_in(4)
@pytest.mark.parametrize(
    ("tolerance", "most"), [(1e-2, 8), (1e-3, 20), (1e-4, 60), (1e-5, 190)]
)
def test_few_points_do_for_a_side_of_a_set(tolerance: float, most: int) -> None:
    found = by_points(rules_from_tree(random_tree(3), "raw"), tolerance)
    shapes = shapes_of(found.model.variables)
    curves = [shapes[term] for term in found.terms]
    counts = [len(curve.values) for curve in curves if isinstance(curve, Points)]
    assert len(counts) == len(found.terms) > 20
    assert max(counts) / 2 <= most


def test_ten_times_the_accuracy_costs_about_three_times_the_points() -> None:
    counts = [
        len(points_of(SHAPES["set"], tolerance)[0].values)
        for tolerance in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
    ]
    for few, many in itertools.pairwise(counts[1:]):
        assert 2.5 < many / few < 3.3


@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
def test_no_strength_is_further_off_than_certified(conjunction: Conjunction) -> None:
    sets = [SHAPES["set"], SHAPES["set with a roof"], SHAPES["set at 1e9"]]
    rules = model_of(*sets, conjunction=conjunction)
    for found in (by_points(rules, 1e-2), by_degree(rules, 1)):
        worst = 0.0
        for row in probes(rules, limit=3000):
            one = evaluate(rules, row).strengths[0]
            other = evaluate(found.model, row).strengths[0]
            if not math.isnan(one):
                worst = max(worst, abs(one - other))
        assert worst <= found.bound
        assert found.bound <= worst * 4.0


def test_the_bound_of_a_product_is_the_sum_over_a_rule() -> None:
    pair = [SHAPES["set at 1e9"], SHAPES["set"]]
    least = by_points(model_of(*pair), 1e-3)
    summed = by_points(model_of(*pair, conjunction="product"), 1e-3)
    bounds = [*summed.terms.values()]
    assert summed.bound == pytest.approx(sum(bounds))
    assert least.bound == max(bounds)
    assert least.origin == (
        "largest certified error of a degree: lines within 0.001 of the curves"
    )
    assert summed.origin == (
        "summed certified error of a degree: lines within 0.001 of the curves"
    )


def test_points_that_are_there_stay_as_they_are() -> None:
    rules = with_points(rules_from_tree(random_tree(1), "raw"), 1, share=1.0)
    for found in (by_points(rules, 1e-9), by_degree(rules, 1)):
        assert (found.model, found.terms, found.bound) == (rules, {}, 0.0)


def test_a_model_that_needs_too_many_points_is_refused() -> None:
    with pytest.raises(LossError) as caught:
        by_points(model_of(SHAPES["set at 1e9"], SHAPES["set"], Band(0.0, 1.0)), 1e-9)
    assert str(caught.value) == (
        "cannot approximate one by lines within 1e-09 of the curves:\n"
        "  term 't' of 'x0': it would need more than 4096 points\n"
        "  term 't' of 'x1': it would need more than 4096 points"
    )


def test_a_set_between_doubles_that_are_far_apart_is_refused() -> None:
    shape = LR(1e12, Side(1e-3, (0.4,)), Side(1e-3, (0.4,)))
    with pytest.raises(LossError) as caught:
        by_points(model_of(shape), 1e-3)
    assert str(caught.value) == (
        "cannot approximate one by lines within 0.001 of the curves:\n"
        "  term 't' of 'x0': doubles around 999999999999.999 are too coarse for them"
    )


def test_a_set_that_is_narrower_than_doubles_at_its_mean_is_refused() -> None:
    level = Side(0.5, (0.0,), 1e6)  # 1 up to a spread, where no double is
    with pytest.raises(LossError, match=r"doubles around 1e\+16 are too coarse"):
        by_points(model_of(LR(1e16, level, level)), 0.01)


def test_a_set_beyond_the_largest_double_is_refused() -> None:
    shape = LR(0.0, Side(1e308, (0.4,)), Side(1.0, (0.4,)))
    with pytest.raises(LossError, match="it reaches beyond the largest double"):
        by_points(model_of(shape), 0.1)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, math.nan, math.inf])
def test_a_tolerance_must_be_above_zero(tolerance: float) -> None:
    with pytest.raises(ValueError, match="the tolerance must be above 0, not"):
        by_points(model_of(SHAPES["set"]), tolerance)


@pytest.mark.parametrize("wanted", [0, 9, -1])
def test_a_degree_must_be_from_one_to_eight(wanted: int) -> None:
    with pytest.raises(ValueError, match=f"must be from 1 to 8, not {wanted}"):
        by_degree(model_of(SHAPES["set"]), wanted)


LONG: dict[str, LR] = {
    **SHAPES,
    "sides": LR(
        1.0, Side(1.0, (0.6, 0.2, 0.1, 0.05)), Side(2.0, (0.9, -0.3, 0.2, 0.1))
    ),
}


def around(shape: Shape) -> list[Fraction]:
    marks = [Fraction(number, 64) for number in range(-320, 321)]
    if isinstance(shape, LR):
        return [Fraction(shape.mean) + Fraction(shape.left.spread) * x for x in marks]
    return [*marks, *map(Fraction, (1e12, 1e12 - 1, 1e12 + 1))]


@pytest.mark.one_in(5)
@pytest.mark.parametrize("wanted", [1, 2, 4, 7])
@pytest.mark.parametrize("name", LONG)
def test_no_lower_curve_is_further_off_than_certified(name: str, wanted: int) -> None:
    shape = LONG[name]
    found = by_degree(model_of(shape), wanted)
    (term,) = found.model.variables[0].terms
    assert largest_error(term.shape, shape, around(shape)) <= Fraction(found.bound)
    assert isinstance(term.shape, LR)
    sides = term.shape.left, term.shape.right
    assert not found.terms or max(len(side.curve) for side in sides) <= wanted


@pytest.mark.parametrize("name", ["sides", "set", "set with a roof"])
def test_a_higher_degree_is_never_further_off(name: str) -> None:
    bounds = [by_degree(model_of(LONG[name]), wanted).bound for wanted in range(1, 8)]
    for low, high in itertools.pairwise(bounds):
        assert high <= low * 1.02


@pytest.mark.one_in(4)
@pytest.mark.parametrize("wanted", range(1, 5))
@pytest.mark.parametrize("name", ["sides", "set"])
def test_a_lower_curve_keeps_its_ends_and_never_falls(name: str, wanted: int) -> None:
    shape = LONG[name]
    (term,) = by_degree(model_of(shape), wanted).model.variables[0].terms
    lowered = term.shape
    assert degree(lowered, shape.mean) == 1.0
    left = [shape.mean - shape.left.spread * n / 500 for n in range(2500, 0, -1)]
    heights = [exact_degree(lowered, Fraction(x)) for x in left]
    assert heights == sorted(heights)
    assert all(0 <= height < 1 for height in heights)


def test_a_square_is_best_followed_by_a_line_of_slope_two_root_two_less_two() -> None:
    # max |q**2 - c q| is least where c**2 / 4 = 1 - c: c = 2 sqrt(2) - 2.
    slope = 2.0 * math.sqrt(2.0) - 2.0
    found = lower_curve(np.array([0.0, 0.0, 1.0]), 1)
    assert found.tolist() == pytest.approx([0.0, slope], abs=1e-4)


def test_curves_that_are_short_enough_stay_as_they_are() -> None:
    rules = model_of(SHAPES["set at 1e9"], SHAPES["set"])
    found = by_degree(rules, 3)
    assert (found.model, found.terms, found.bound) == (rules, {}, 0.0)
    assert [variable for variable, _ in by_degree(rules, 2).terms] == ["x1"]


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(12))
def test_no_random_curve_is_further_off_than_certified(seed: int) -> None:
    chance = random.Random(seed)

    def curve() -> tuple[float, ...]:
        return tuple(chance.uniform(-3.0, 3.0) for _ in range(chance.randint(1, 8)))

    def side() -> Side:
        return Side(10.0 ** chance.uniform(-6, 6), curve(), chance.uniform(1.1, 9.0))

    for _ in range(6):
        mean = chance.uniform(-10.0, 10.0)
        for shape in (LR(mean, side(), side()),):
            for tolerance in (0.1, 1e-2, 1e-4):
                found, bound = points_of(shape, tolerance)
                error = largest_error(found, shape, places(found, seed))
                assert error <= Fraction(bound) <= Fraction(tolerance)
            lowered = by_degree(model_of(shape), chance.randint(1, 4))
            (term,) = lowered.model.variables[0].terms
            at = [Fraction(mean) + Fraction(n, 37) for n in range(-200, 201)]
            assert largest_error(term.shape, shape, at) <= Fraction(lowered.bound)
