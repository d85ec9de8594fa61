"""Points in the place of curves: never further off than they say."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterator

import pytest

from fuzzytree.errors import LossError
from fuzzytree.model import (
    Arc,
    Band,
    Bell,
    Concave,
    Conclusion,
    Cosine,
    Curve,
    Defuzzifier,
    Formula,
    FuzzySystem,
    Gaussian,
    Name,
    PiCurve,
    Points,
    Proposition,
    RuleBlock,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    Spike,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    TwoGaussians,
    Variable,
)
from fuzzytree.numerics.approximation import by_points
from fuzzytree.semantics import pointed
from fuzzytree.semantics.conversion.points import points_for
from fuzzytree.semantics.inference.degrees import curve_degree
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import degree
from fuzzytree.testing import random_tree

TOLERANCES = (0.3, 1e-2, 1e-4)


def curves(seed: int) -> Iterator[Curve]:
    """Every curve that has a formula, with numbers from a seed."""
    chance = random.Random(seed)
    u = chance.uniform
    s = 10.0 ** u(-4, 4)
    a, b, c, d = sorted(u(-3, 3) * s for _ in range(4))
    yield Gaussian(a, s)
    yield TwoGaussians(a, s * u(0.1, 2), d, s * u(0.1, 2))
    yield TwoGaussians(d, s * u(0.1, 2), a, s * u(0.1, 2))
    yield TwoGaussians(d, s * 0.01, a, s * 0.01)
    yield Bell(a, s, chance.choice((0.3, 0.4, 0.5, 1, 2.5, 10, -1, -0.3, 3, 0)))
    yield Sigmoid(a, u(-3, 3) / s)
    yield Sigmoid(a, 0.0)
    yield SigmoidDifference(Sigmoid(a, u(-3, 3) / s), Sigmoid(d, u(-3, 3) / s))
    yield SigmoidDifference(Sigmoid(a, 1 / s), Sigmoid(d, 1 / s))
    yield SigmoidProduct(Sigmoid(a, u(-3, 3) / s), Sigmoid(d, u(-30, 30) / s))
    yield SigmoidProduct(Sigmoid(a, 0.0), Sigmoid(d, 0.0))
    yield from (SCurve(a, b), SCurve(b, a), SCurve(a, a))
    yield from (PiCurve(a, b, c, d), PiCurve(a, a, c, d), PiCurve(a, b, b, b))
    yield from (PiCurve(a, b, d, d), PiCurve(a, a, a, d), PiCurve(a, a, a, a))
    yield from (Cosine(a, s), Spike(a, s), SemiEllipse(a, b), SemiEllipse(b, a))
    yield from (Concave(a, b), Concave(b, a), Concave(a, a), Arc(a, b), Arc(b, a))


@pytest.mark.one_in(10)
@pytest.mark.parametrize("tolerance", TOLERANCES)
@pytest.mark.parametrize("seed", range(8))
def test_points_are_no_further_off_than_they_say(seed: int, tolerance: float) -> None:
    chance = random.Random(seed)
    for curve in curves(seed):
        points, bound, _ = points_for(curve, tolerance)
        assert bound <= tolerance
        values = points.values
        low, high = values[0], values[-1]
        width = (high - low) or 1.0
        rows = [low - 100 * width, high + 100 * width, *values]
        rows += [chance.uniform(low - width, high + width) for _ in range(100)]
        for p, q in itertools.pairwise(values):
            rows += [p + (q - p) / 2, chance.uniform(p, q)]
        worst = max(abs(degree(points, x) - curve_degree(curve, x)) for x in rows)
        assert worst <= bound + 2.0**-50, curve


@pytest.mark.parametrize(
    ("curve", "most"),
    [
        (Gaussian(0.0, 1.0), 18),
        (Bell(0.0, 1.0, 2.0), 30),
        (Sigmoid(0.0, 1.0), 10),
        (SCurve(0.0, 1.0), 10),
        (Cosine(0.0, 1.0), 18),
        (SemiEllipse(0.0, 1.0), 28),
        (Spike(0.0, 1.0), 18),
    ],
    ids=str,
)
def test_few_points_are_within_a_hundredth_of_a_curve(curve: Curve, most: int) -> None:
    assert len(points_for(curve, 0.01).points.values) <= most


def test_curves_that_end_are_exactly_0_beyond() -> None:
    for curve in (Cosine(0.1, 0.7), SemiEllipse(0.1, 0.7), SCurve(0.1, 0.7)):
        points = points_for(curve, 0.01).points
        assert points.degrees[0] == 0.0
        assert degree(points, -10.0) == 0.0


def test_a_tail_without_end_is_named_and_stays_above_0() -> None:
    found = points_for(Gaussian(0.0, 1.0), 0.01)
    assert 0.0 < degree(found.points, 1e9) <= 0.01
    assert found.tail == "before them it stays at 0.0099, after them at 0.0099"


def test_a_curve_that_is_narrower_than_doubles_is_refused() -> None:
    with pytest.raises(LossError, match="doubles around it are too coarse"):
        points_for(Gaussian(1e20, 1.0), 0.01)


def test_a_tolerance_below_rounding_is_refused() -> None:
    with pytest.raises(LossError, match="too coarse"):
        points_for(Gaussian(0.0, 1.0), 1e-15)


@pytest.mark.heavy
def test_too_many_points_are_refused() -> None:
    with pytest.raises(LossError, match="more than 4096 points"):
        points_for(Gaussian(0.0, 1.0), 1e-9)


@pytest.mark.parametrize(
    "curve",
    [
        Gaussian(0.0, 5e-324),
        Gaussian(0.0, 1e308),
        Gaussian(-1e308, 1e308),
        Bell(0.0, 1e308, 0.1),
        Bell(0.0, 1.0, 1e300),
        Bell(0.0, 1.0, 1e-300),
        Sigmoid(0.0, 5e-324),
        Sigmoid(1e308, 1e308),
        SigmoidProduct(Sigmoid(0.0, 1e-320), Sigmoid(0.0, 1e300)),
        SigmoidDifference(Sigmoid(1e308, 1.0), Sigmoid(-1e308, 2.0)),
        TwoGaussians(1e308, 1e-300, -1e308, 1e300),
        SCurve(-1e308, 1e308),
        PiCurve(-1e308, 0.0, 1.0, 1e308),
        Cosine(0.0, 5e-324),
        Concave(1e308, -1e308),
        Spike(0.0, 1e-320),
        Arc(-1e308, 1e308),
        SemiEllipse(-1e308, 1e308),
        Arc(0.0, 5e-324),
        SemiEllipse(0.0, 5e-324),
        SCurve(0.0, 5e-324),
    ],
    ids=str,
)
def test_extreme_curves_become_points_or_are_refused(curve: Curve) -> None:
    try:
        found = points_for(curve, 0.01)
    except LossError:
        return
    assert found.bound <= 0.01
    for x in (0.0, 1.0, -1.0, 5e-324, 1e300, *found.points.values):
        difference = abs(degree(found.points, x) - curve_degree(curve, x))
        assert difference <= found.bound + 2.0**-50


def washer(curve: Curve, output: Curve, method: str) -> FuzzySystem:
    how = Defuzzifier(method)  # type: ignore[arg-type]
    rule = SystemRule(Proposition("dirt", ("high",)), (Conclusion("time", "long"),))
    return FuzzySystem(
        "washer",
        (Variable("dirt", (Term("high", curve, 0.5),)),),
        (SystemOutput("time", (Term("long", output),), 0.0, 1.0, how, "maximum"),),
        (RuleBlock((rule,), implication="minimum"),),
    )


def test_terms_of_inputs_and_of_looked_at_outputs_become_points() -> None:
    system = washer(Gaussian(0.0, 1.0), Trapezoid(0.0, 0.5, 0.5, 1.0), "centroid")
    found, losses = pointed(system, 1e-3)
    label = found.variables[0].terms[0]
    assert isinstance(label.function, Points)
    assert label.height == 0.5
    expected = Points((0.0, 0.5, 1.0), (0.0, 1.0, 0.0))
    assert found.outputs[0].terms[0].function == expected
    (loss,) = losses
    assert loss.where == "term 'high' of 'dirt'"
    assert loss.what == (
        "it becomes 51 points joined by lines; "
        "before them it stays at 0.00099, after them at 0.00099"
    )
    assert loss.bound is not None
    assert 9e-4 < loss.bound <= 1e-3


def test_weighted_numbers_stay() -> None:
    system = washer(Trapezoid(0.0, 1.0, 1.0, 2.0), Singleton(4.0), "weighted average")
    found, losses = pointed(system, 1e-3)
    assert losses == ()
    assert found.outputs == system.outputs


def test_allowed_curves_stay() -> None:
    system = washer(Gaussian(0.0, 1.0), Singleton(4.0), "weighted average")
    assert pointed(system, 1e-3, keeps=lambda *_: True) == (system, ())


def test_what_cannot_become_points_is_listed() -> None:
    system = washer(Formula(Name("x")), Gaussian(1e20, 1.0), "centroid")
    with pytest.raises(LossError) as caught:
        pointed(system, 1e-3)
    assert str(caught.value) == (
        "cannot write the curves of washer as points:\n"
        "  term 'high' of 'dirt': it is a formula, of which nothing is known between "
        "points\n"
        "  term 'long' of 'time': doubles around it are too coarse"
    )


@pytest.mark.parametrize("tolerance", [0.0, -1.0, 1.0, math.nan, math.inf])
def test_a_tolerance_must_be_above_0_and_below_1(tolerance: float) -> None:
    with pytest.raises(ValueError, match="tolerance: must be above 0"):
        pointed(washer(Singleton(0.0), Singleton(0.0), "weighted sum"), tolerance)
    with pytest.raises(ValueError, match="tolerance: must be above 0 and below 1"):
        points_for(Gaussian(0.0, 1.0), tolerance)


def test_rules_become_the_points_of_the_rule_bases_own_approximation() -> None:
    rules = rules_from_tree(random_tree(5), "raw")
    found, losses = pointed(rules, 1e-3)
    expected = by_points(rules, 1e-3)
    assert found == expected.model
    bounds = [bound for bound in expected.terms.values() if bound > 1e-9]
    assert [loss.bound for loss in losses if loss.bound > 1e-9] == bounds  # type: ignore[operator]


def test_points_that_differ_by_rounding_alone_are_no_loss() -> None:
    tree = random_tree(0, leaves=2, combinations=0.0)
    rules = rules_from_tree(tree)
    band = Band(0.0, 1.0, -1.0, 2.0)
    (variable,) = rules.variables
    terms = tuple(type(t)(t.name, band) for t in variable.terms)
    straight = type(rules)(
        rules.name, rules.classes, (Variable(variable.name, terms),), rules.rules
    )
    found, losses = pointed(straight, 1e-3)
    assert losses == ()
    assert isinstance(found.variables[0].terms[0].shape, Points)
