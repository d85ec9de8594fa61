"""Hand-worked values: each expected number was derived on paper from the formulas."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, get_args

import pytest
from msgspec.structs import replace

from fuzzytree.formats.formulas import parse
from fuzzytree.model import (
    Activation,
    And,
    Arc,
    Bell,
    Binary,
    Call,
    Concave,
    Conclusion,
    Condition,
    Cosine,
    Curve,
    Defuzzifier,
    DefuzzifierMethod,
    Formula,
    FuzzySystem,
    Gaussian,
    Grid,
    Hedge,
    Linear,
    Not,
    Number,
    Or,
    PiCurve,
    Proposition,
    RuleBlock,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    SNorm,
    Spike,
    SystemOutput,
    SystemRule,
    Term,
    TNorm,
    Trapezoid,
    TwoGaussians,
    Variable,
    sampled_values,
)
from fuzzytree.model.rulebase import Part, Points
from fuzzytree.semantics.inference import (
    FUNCTIONS,
    curve_degree,
    hedged,
    infer,
    s_norm,
    t_norm,
    value_at,
    value_of,
)
from fuzzytree.semantics.programs.operations import total
from fuzzytree.semantics.reference import Status
from fuzzytree.testing import random_rows, random_system

NAN, INF = math.nan, math.inf
UP = Term("up", Points((0.0, 1.0), (0.0, 1.0)))
DOWN = Term("down", Points((0.0, 1.0), (1.0, 0.0)))
HALF = math.exp(-0.5)


@pytest.mark.parametrize(
    ("curve", "expected"),
    [
        (
            Trapezoid(0.0, 2.0, 3.0, 4.0),
            {-1: 0, 0: 0, 0.5: 0.25, 2: 1, 3: 1, 3.75: 0.25},
        ),
        (Trapezoid(0.0, 2.0, 2.0, 4.0), {1: 0.5, 2: 1, 3: 0.5, 4: 0, 5: 0}),
        (Trapezoid(1.0, 1.0, 2.0, 2.0), {0.5: 0, 1: 1, 2: 1, 2.5: 0}),
        (Trapezoid(None, 1.0, 2.0, 3.0), {-1e300: 1, 2: 1, 2.5: 0.5, 3.5: 0}),
        (Trapezoid(0.0, 1.0, 2.0, None), {-1: 0, 0.25: 0.25, 1e300: 1}),
        (Gaussian(1.0, 2.0), {1: 1, 3: HALF, -1: HALF, 1e300: 0}),
        (Gaussian(1.0, 5e-324), {1: 1, 2: 0}),
        (TwoGaussians(1.0, 2.0, 3.0, 1.0), {-1: HALF, 1: 1, 2: 1, 3: 1, 4: HALF}),
        (Bell(1.0, 2.0, 1.0), {1: 1, 3: 0.5, -1: 0.5, 5: 0.2, 1e300: 0}),
        (Bell(1.0, 2.0, -1.0), {1: 0, 3: 0.5}),
        (Sigmoid(1.0, 2.0), {1: 0.5, 1e300: 1, -1e300: 0}),
        (Sigmoid(1.0, -2.0), {1: 0.5, 1e300: 0, -1e300: 1}),
        (SigmoidDifference(Sigmoid(0.0, 9.0), Sigmoid(0.0, 9.0)), {0: 0, 7: 0}),
        (SigmoidDifference(Sigmoid(9.0, 1e3), Sigmoid(0.0, 1e3)), {5: 1, 0: 0.5}),
        (SigmoidProduct(Sigmoid(0.0, 1.0), Sigmoid(0.0, -1.0)), {0: 0.25}),
        (SCurve(0.0, 4.0), {-1: 0, 0: 0, 1: 0.125, 2: 0.5, 3: 0.875, 4: 1, 5: 1}),
        (SCurve(4.0, 0.0), {-1: 1, 0: 1, 1: 0.875, 2: 0.5, 3: 0.125, 4: 0}),
        (SCurve(2.0, 2.0), {1: 0, 2: 0, 3: 1}),
        (PiCurve(0.0, 4.0, 5.0, 9.0), {1: 0.125, 4: 1, 5: 1, 6: 0.875, 9: 0, 10: 0}),
        (PiCurve(0.0, 1.0, 2.0, 2.0), {2: 1, 2.5: 0}),
        (PiCurve(1.0, 1.0, 2.0, 3.0), {1: 0, 1.5: 1}),
        (Cosine(1.0, 4.0), {1: 1, 2: 0.5, 3: 0, 3.5: 0, -1: 0}),
        (Concave(0.0, 1.0), {1: 1, 2: 1, 0: 0.5, -1: 1 / 3}),
        (Concave(1.0, 0.0), {0: 1, -1: 1, 1: 0.5, 2: 1 / 3}),
        (Concave(1.0, 1.0), {0: 0, 1: 1, 2: 1}),
        (Spike(1.0, 10.0), {1: 1, 2: math.exp(-1), 0: math.exp(-1)}),
        (Arc(0.0, 5.0), {-1: 0, 0: 0, 1: 0.6, 2: 0.8, 5: 1, 6: 1}),
        (Arc(5.0, 0.0), {6: 0, 5: 0, 4: 0.6, 3: 0.8, 0: 1, -1: 1}),
        (SemiEllipse(0.0, 10.0), {-1: 0, 0: 0, 1: 0.6, 5: 1, 8: 0.8, 10: 0, 11: 0}),
        (Binary(1.0), {0.5: 0, 1: 1, 2: 1}),
        (Binary(1.0, is_above=False), {0.5: 1, 1: 1, 2: 0}),
        (Singleton(1.0), {1: 1, 1.5: 0}),
        (Formula(parse("x / 2 + 1")), {-2: 0, 1: 1.5}),
    ],
    ids=repr,
)
def test_a_curve_has_the_degrees_of_its_formula(
    curve: Curve, expected: dict[float, float]
) -> None:
    for value, degree in expected.items():
        found = curve_degree(curve, float(value))
        assert found == pytest.approx(degree, rel=1e-15, abs=0.0), value


@pytest.mark.parametrize(
    ("curve", "degree", "value"),
    [
        (UP.function, 0.25, 0.25),
        (DOWN.function, 0.25, 0.75),
        (Points((2.0, 6.0), (0.0, 1.0)), 0.5, 4.0),
        (UP.function, 2.0, 2.0),
        (Sigmoid(1.0, 2.0), 0.5, 1.0),
        (Sigmoid(1.0, 2.0), 1.0, INF),
        (Sigmoid(1.0, 2.0), 0.0, -INF),
        (Sigmoid(1.0, -2.0), 1.0, -INF),
        (Sigmoid(1.0, 2.0), 1.5, NAN),
        (SCurve(0.0, 4.0), 0.125, 1.0),
        (SCurve(0.0, 4.0), 0.875, 3.0),
        (SCurve(4.0, 0.0), 0.875, 1.0),
        (Concave(0.0, 1.0), 0.5, 0.0),
        (Concave(1.0, 0.0), 0.5, 1.0),
        (Concave(0.0, 1.0), 0.0, -INF),
        (Arc(0.0, 5.0), 0.6, 1.0),
        (Arc(5.0, 0.0), 0.8, 3.0),
        (Arc(5.0, 0.0), 1.5, NAN),
    ],
    ids=repr,
)
def test_a_monotone_curve_has_a_value_for_each_degree(
    curve: Curve, degree: float, value: float
) -> None:
    found = value_at(curve, degree)
    assert found == pytest.approx(value, rel=1e-15, abs=1e-15, nan_ok=True)


@pytest.mark.parametrize(
    "curve",
    [
        Points((0.0, 1.0), (0.0, 0.5)),
        Points((0.0, 0.0), (0.0, 1.0)),
        Points((0.0, 1.0, 2.0), (0.0, 0.5, 1.0)),
        Trapezoid(0.0, 1.0, 2.0, None),
        Binary(1.0),
        Gaussian(0.0, 1.0),
    ],
    ids=repr,
)
def test_other_curves_have_no_value_for_a_degree(curve: Curve) -> None:
    assert value_at(curve, 0.5) is None


@pytest.mark.parametrize("a", [Fraction(k, 8) for k in range(9)])
@pytest.mark.parametrize("b", [Fraction(k, 8) for k in range(9)])
def test_norms_are_those_of_exact_arithmetic(a: Fraction, b: Fraction) -> None:
    one, low, high = Fraction(1), min(a, b), max(a, b)
    expected = {
        "minimum": low,
        "product": a * b,
        "bounded difference": max(Fraction(0), a + b - 1),
        "drastic product": low if high == 1 else 0,
        "einstein product": a * b / (2 - (a + b - a * b)),
        "hamacher product": a * b / (a + b - a * b) if high else 0,
        "nilpotent minimum": low if a + b > 1 else 0,
        "maximum": high,
        "algebraic sum": a + b - a * b,
        "bounded sum": min(one, a + b),
        "drastic sum": high if low == 0 else 1,
        "einstein sum": (a + b) / (1 + a * b),
        "hamacher sum": (a + b - 2 * a * b) / (1 - a * b) if a * b != 1 else 1,
        "nilpotent maximum": high if a + b < 1 else 1,
        "normalized sum": (a + b) / max(one, a + b),
        "sum": a + b,
    }
    assert {*expected} == {*get_args(TNorm), *get_args(SNorm)}
    for name, value in expected.items():
        is_and = name in get_args(TNorm)
        norm: Any = t_norm if is_and else s_norm
        # Eighths have exact sums and products: one division at most is rounded.
        assert norm(name, float(a), float(b)) == float(value), name


@pytest.mark.parametrize(
    ("hedge", "expected"),
    [
        ("any", {0.0: 1.0, NAN: 1.0}),
        ("not", {0.25: 0.75}),
        ("very", {0.25: 0.0625}),
        ("somewhat", {0.25: 0.5, -1.0: NAN}),
        ("extremely", {0.25: 0.125, 0.5: 0.5, 0.75: 0.875}),
        ("seldom", {0.125: 0.25, 0.5: 0.5, 0.875: 0.75, 2.0: NAN}),
        ("cubed", {0.5: 0.125}),
        ("very very", {0.5: 0.0625}),
        ("plus", {0.0625: 2.0**-5, 1.0: 1.0}),
        ("minus", {0.0625: 0.125, 0.0: 0.0}),
        ("cube root", {1.0: 1.0, 0.0: 0.0, -1.0: NAN}),
    ],
)
def test_a_hedge_changes_a_degree(hedge: Hedge, expected: dict[float, float]) -> None:
    for degree, value in expected.items():
        assert hedged([hedge], degree) == pytest.approx(value, rel=1e-15, nan_ok=True)


def test_a_cube_root_is_good_to_the_last_digits() -> None:
    assert hedged(["cube root"], 0.125) == pytest.approx(0.5, rel=1e-15)


def test_norms_pass_nan_on() -> None:
    for name in ("minimum", "product", "bounded difference"):
        assert math.isnan(t_norm(name, NAN, 0.5))
        assert math.isnan(t_norm(name, 0.5, NAN))
    for other in ("maximum", "algebraic sum", "bounded sum", "sum"):
        assert math.isnan(s_norm(other, NAN, 0.5))
        assert math.isnan(s_norm(other, 0.5, NAN))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 / 0", INF),
        ("-1 / 0", -INF),
        ("1 / -0.0", -INF),
        ("0 / 0", NAN),
        ("exp(1000)", INF),
        ("cosh(-1000)", INF),
        ("sinh(-1000)", -INF),
        ("log(0)", -INF),
        ("log(-1)", NAN),
        ("log10(0)", -INF),
        ("log1p(-1)", -INF),
        ("log1p(-2)", NAN),
        ("sqrt(-1)", NAN),
        ("asin(2)", NAN),
        ("acos(-2)", NAN),
        ("acosh(0)", NAN),
        ("atanh(1)", INF),
        ("atanh(-1)", -INF),
        ("atanh(2)", NAN),
        ("sin(exp(1000))", NAN),
        ("tan(exp(1000))", NAN),
        ("0 ^ -1", INF),
        ("(-0.0) ^ -1", -INF),
        ("(-0.0) ^ -2", INF),
        ("(-8) ^ 0.5", NAN),
        ("10 ^ 400", INF),
        ("(-10) ^ 401", -INF),
        ("(-10) ^ 402", INF),
        ("0 ^ 0", 1.0),
        ("-7 % 3", 2.0),
        ("7 % -3", -2.0),
        ("7 % 0", NAN),
        ("fmod(-7, 3)", -1.0),
        ("fmod(7, 0)", NAN),
        ("fmod(exp(1000), 2)", NAN),
        ("round(2.5)", 2.0),
        ("round(-2.5)", -2.0),
        ("round(3.5)", 4.0),
        ("floor(-0.5)", -1.0),
        ("ceil(exp(1000))", INF),
        ("2 and 3", 1.0),
        ("0 or 0", 0.0),
        ("!0", 1.0),
        ("eq(0 / 0, 0 / 0)", 1.0),
        ("neq(0 / 0, 0 / 0)", 0.0),
        ("ge(0 / 0, 0 / 0)", 1.0),
        ("le(0 / 0, 1)", 0.0),
        ("lt(1, 2) + gt(1, 2)", 1.0),
        ("min(0 / 0, 1)", NAN),
        ("max(1, 0 / 0)", NAN),
        ("min(2, 1) + max(2, 1)", 3.0),
        ("atan2(0, -1)", math.pi),
        ("abs(-2) - 2 * -3", 8.0),
    ],
)
def test_a_formula_says_what_ieee_754_says(text: str, expected: float) -> None:
    found = value_of(parse(text), {})
    assert found == pytest.approx(expected, rel=0.0, abs=0.0, nan_ok=True)


def test_a_ceiling_and_a_rounding_keep_the_sign_of_zero() -> None:
    for text in ("ceil(-0.5)", "round(-0.5)", "floor(-0.0)"):
        assert math.copysign(1.0, value_of(parse(text), {})) == -1.0


@pytest.mark.parametrize("function", FUNCTIONS)
def test_no_function_of_a_formula_fails(function: str) -> None:
    values = (0.0, -0.0, 1.0, -1.0, 0.5, 3.0, 1e308, -1e308, 5e-324, INF, -INF, NAN)
    for chosen in itertools.product(values, repeat=FUNCTIONS[function]):
        found = value_of(Call(function, tuple(map(Number, chosen))), {})
        assert isinstance(found, float)


def test_a_sum_adds_halves_and_fills_up_with_zeros() -> None:
    chance = random.Random(0)
    for count in (1, 2, 3, 7, 8, 100):
        values = [chance.uniform(-1.0, 1.0) for _ in range(count)]
        assert total(values) == pytest.approx(math.fsum(values), abs=1e-14)
    big = 2.0**53
    assert total([big, -big, 1.0, 1.0]) == 1.0  # (big + 1) + (1 - big)
    assert total([big, 1.0, -big]) == 1.0  # (big - big) + (1 + 0)


def system(
    rules: Sequence[SystemRule],
    labels: Sequence[Term] = (Term("one", Singleton(1.0)),),
    method: DefuzzifierMethod = "weighted sum",
    *,
    samples: int = 4,
    grid: Grid = "middle",
    aggregation: SNorm | None = None,
    default: float | None = None,
    clips: bool = False,
    block: RuleBlock | None = None,
) -> FuzzySystem:
    """Return a system of inputs a and b, up and down in [0, 1], and an output y."""
    output = SystemOutput(
        "y", tuple(labels), 0.0, 2.0, Defuzzifier(method, samples, grid),
        aggregation, default, clips,
    )  # fmt: skip
    shared = block or RuleBlock((), implication="minimum")
    return FuzzySystem(
        "by hand",
        (Variable("a", (UP, DOWN)), Variable("b", (UP, DOWN))),
        (output,),
        (replace(shared, rules=tuple(rules)),),
    )


def rule(when: Condition | None, label: str = "one", weight: float = 1.0) -> SystemRule:
    return SystemRule(when, (Conclusion("y", label),), weight)


A_UP, A_DOWN, B_UP = (
    Proposition("a", ("up",)),
    Proposition("a", ("down",)),
    Proposition("b", ("up",)),
)


@pytest.mark.parametrize(
    ("when", "expected"),
    [
        (None, 1.0),
        (A_UP, 0.25),
        (Proposition("a", ("up",), ("not",)), 0.75),
        (Proposition("a", ("up",), ("very", "not")), 0.5625),
        (Proposition("a", ("up",), ("not", "very")), 0.9375),
        (Proposition("a", (), ("any",)), 1.0),
        (Proposition("a", (), ("very", "any")), 1.0),
        (Proposition("a", ("up",), ("any",)), 1.0),
        (And((A_UP, B_UP)), 0.25),
        (Or((A_UP, B_UP)), 0.5),
        (Not(And((A_UP, B_UP))), 0.75),
        (And((A_DOWN, B_UP, Not(B_UP))), 0.5),
        (And((Or((A_UP, B_UP)), A_DOWN)), 0.5),
    ],
    ids=repr,
)
def test_a_condition_joins_degrees(when: Condition, expected: float) -> None:
    found = infer(system([rule(when)]), {"a": 0.25, "b": 0.5})
    assert found.strengths == (expected,)
    assert found.outputs == (expected,)
    assert found.status == Status.DECIDED


def test_three_parts_are_joined_from_left_to_right() -> None:
    block = RuleBlock((), "einstein product", "hamacher sum")
    degrees = (0.25, 0.75, 0.5)
    when = (A_UP, A_DOWN, B_UP)
    row = {"a": 0.25, "b": 0.5}
    both = t_norm("einstein product", degrees[0], degrees[1])
    all_three = t_norm("einstein product", both, degrees[2])
    either = s_norm("hamacher sum", degrees[0], degrees[1])
    any_of_three = s_norm("hamacher sum", either, degrees[2])
    found = infer(system([rule(And(when)), rule(Or(when))], block=block), row)
    assert found.strengths == (all_three, any_of_three)


def test_a_weight_multiplies_the_degree_and_a_rule_of_weight_0_never_fires() -> None:
    rules = [rule(B_UP, weight=0.5), rule(B_UP, weight=0.0)]
    found = infer(system(rules), {"a": 0.25, "b": 0.5})
    assert found.strengths == (0.25, 0.0)
    assert found.outputs == (0.25,)


def test_a_height_multiplies_the_degree() -> None:
    low = replace(system([rule(A_UP)]), variables=(
        Variable("a", (replace(UP, height=0.5),)), Variable("b", (UP, DOWN)),
    ))  # fmt: skip
    assert infer(low, {"a": 0.5, "b": 0.0}).strengths == (0.25,)


LABELS = (
    Term("one", Singleton(1.0)),
    Term("three", Singleton(3.0)),
    Term("line", Linear((2.0, -1.0), 0.5)),
    Term("formula", Formula(parse("a + 10 * x"))),
    Term("ramp", Points((4.0, 8.0), (0.0, 1.0))),
    Term("low ramp", Points((4.0, 8.0), (0.0, 1.0)), height=0.5),
    Term("bump", Trapezoid(0.0, 0.5, 0.5, 1.0)),
)


@pytest.mark.parametrize(
    ("label", "number"),
    [
        ("one", 1.0),
        ("three", 3.0),
        ("line", 2.0 * 0.25 - 0.5 + 0.5),
        ("formula", 0.25 + 10 * 0.25),
        ("ramp", 5.0),
        ("low ramp", 6.0),
        ("bump", 0.5),  # the degree that it has at 0.25
    ],
)
def test_a_weighted_conclusion_has_its_number(label: str, number: float) -> None:
    for method, expected in (
        ("weighted average", number),
        ("weighted sum", 0.25 * number),
    ):
        found = infer(
            system([rule(A_UP, label)], LABELS, method),  # type: ignore[arg-type]
            {"a": 0.25, "b": 0.5},
        )
        assert found.outputs == (expected,)


def test_weighted_numbers_are_summed_one_by_one_or_joined_label_by_label() -> None:
    rules = [rule(A_UP), rule(B_UP), rule(A_DOWN, "three")]
    row = {"a": 0.25, "b": 0.5}
    one_by_one = infer(system(rules, LABELS, "weighted average"), row)
    assert one_by_one.outputs == ((0.25 + 0.5 + 0.75 * 3) / 1.5,)
    joined = infer(
        system(rules, LABELS, "weighted average", aggregation="maximum"), row
    )
    assert joined.outputs == ((0.5 + 0.75 * 3) / 1.25,)


def test_tsukamoto_inverts_each_activation_or_that_of_all_rules_together() -> None:
    rules = [rule(A_UP, "ramp"), rule(B_UP, "ramp")]
    row = {"a": 0.25, "b": 0.5}
    assert infer(system(rules, LABELS, "weighted sum"), row).outputs == (
        0.25 * 5.0 + 0.5 * 6.0,
    )
    joined = infer(system(rules, LABELS, "weighted sum", aggregation="sum"), row)
    assert joined.outputs == (0.75 * 7.0,)


def mamdani(degrees: Sequence[float], method: DefuzzifierMethod, grid: Grid) -> float:
    """Return the number of an output whose curve has these degrees at its samples."""
    how = Defuzzifier(method, len(degrees), grid)
    bare = SystemOutput("y", (), 0.0, 2.0, how, "maximum")
    points = Points(tuple(sampled_values(bare)), tuple(degrees))
    found = system(
        [rule(None)], [Term("one", points)], method,
        samples=len(degrees), grid=grid, aggregation="maximum",
    )  # fmt: skip
    return infer(found, {"a": 0.0, "b": 0.0}).outputs[0]


@pytest.mark.parametrize(
    ("method", "grid", "degrees", "expected"),
    [
        # in the middle of four quarters of [0, 2]: 0.25, 0.75, 1.25, 1.75
        ("centroid", "middle", (0.0, 1.0, 1.0, 0.0), 1.0),
        ("centroid", "middle", (0.5, 1.0, 0.0, 0.0), (0.125 + 0.75) / 1.5),
        ("centroid", "ends", (1.0, 0.5, 0.5), (0.5 + 1.0) / 2.0),
        ("centroid", "half ends", (1.0, 0.5, 0.5), (0.5 + 0.5) / 1.25),
        ("bisector", "middle", (1.0, 0.0, 0.0, 1.0), (0.25 + 0.75 + 1.25) / 3),
        ("bisector", "middle", (0.0, 1.0, 0.0, 0.5), (0.75 + 1.25) / 2),
        # areas 1/4, 3/4, 1/2: their sums are 1/4, 1, 3/2, and 1 is nearest to 3/4
        ("bisector", "half ends", (0.5, 0.75, 1.0), 1.0),
        ("bisector", "ends", (1.0, 0.5, 0.25), 0.0),
        ("smallest of maximum", "middle", (0.0, 1.0, 0.5, 1.0), 0.75),
        ("largest of maximum", "middle", (0.0, 1.0, 0.5, 1.0), 1.75),
        ("mean of maximum", "middle", (0.0, 1.0, 0.5, 1.0), 1.25),
        ("mean of maximum", "half ends", (1.0, 0.5, 1.0), 1.0),
    ],
)
def test_a_curve_becomes_a_number(
    method: DefuzzifierMethod, grid: Grid, degrees: Sequence[float], expected: float
) -> None:
    assert mamdani(degrees, method, grid) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize("method", get_args(DefuzzifierMethod))
def test_where_nothing_is_concluded_the_default_answers(
    method: DefuzzifierMethod,
) -> None:
    labels = (Term("one", Trapezoid(0.0, 0.5, 1.0, 2.0)),)
    for default, expected in ((None, NAN), (7.0, 7.0)):
        found = infer(
            system(
                [rule(A_UP)], labels, method, aggregation="maximum", default=default
            ),
            {"a": -1.0, "b": 0.0},
        )
        assert found.outputs[0] == pytest.approx(expected, nan_ok=True)
        assert found.strengths == (0.0,)
        assert found.status == Status.UNCOVERED


def test_a_curve_without_area_answers_the_default_too() -> None:
    labels = (Term("one", Trapezoid(5.0, 6.0, 6.0, 7.0)),)
    subject = system([rule(None)], labels, "centroid", aggregation="sum", default=9.0)
    found = infer(subject, {"a": 0.0, "b": 0.0})
    assert (found.outputs, found.status) == ((9.0,), Status.UNCOVERED)
    assert found.strengths == (1.0,)


def test_implication_cuts_and_aggregation_joins() -> None:
    labels = (
        Term("one", Trapezoid(0.0, 0.0, 1.0, 1.0)),
        Term("two", Trapezoid(0.5, 0.5, 2.0, 2.0)),
    )
    rules = [rule(A_UP, "one"), rule(B_UP, "two")]
    row = {"a": 0.25, "b": 0.5}
    # degrees 1/4, max(1/4, 1/2), 1/2, 1/2 at 0.25, 0.75, 1.25, 1.75
    cut = infer(system(rules, labels, "centroid", aggregation="maximum"), row)
    assert cut.outputs == ((0.0625 + 0.375 + 0.625 + 0.875) / 1.75,)
    # with the sum 1/4, 3/4, 1/2, 1/2
    added = infer(system(rules, labels, "centroid", aggregation="sum"), row)
    assert added.outputs == ((0.0625 + 0.5625 + 0.625 + 0.875) / 2.0,)


def test_hedges_of_a_conclusion_act_on_those_behind_it() -> None:
    then = (Conclusion("y", "one", ("very",)), Conclusion("y", "three", ("not",)))
    found = infer(system([SystemRule(A_UP, then)], LABELS), {"a": 0.5, "b": 0.0})
    assert found.outputs == (0.25 * 1.0 + 0.75 * 3.0,)
    assert found.strengths == (0.5,)


def test_a_conclusion_that_its_hedge_takes_to_0_concludes_nothing() -> None:
    then = (Conclusion("y", "one", ("not",)),)
    found = infer(system([SystemRule(None, then)], default=4.0), {"a": 0.5, "b": 0.0})
    assert (found.outputs, found.strengths) == ((4.0,), (1.0,))
    assert found.status == Status.UNCOVERED


FOUR = [
    rule(A_UP),  # 1/4
    rule(A_DOWN),  # 3/4
    rule(B_UP),  # 3/4
    rule(B_UP, weight=0.0),  # 0
    rule(And((A_UP, B_UP)), weight=0.5),  # 1/8
]


@pytest.mark.parametrize(
    ("how", "expected"),
    [
        (Activation(), (0.25, 0.75, 0.75, 0.0, 0.125)),
        (Activation("first"), (0.25, 0.0, 0.0, 0.0, 0.0)),
        (Activation("first", 2, 0.5), (0.0, 0.75, 0.75, 0.0, 0.0)),
        (Activation("first", 9, 0.75), (0.0, 0.75, 0.75, 0.0, 0.0)),
        (Activation("last"), (0.0, 0.0, 0.0, 0.0, 0.125)),
        (Activation("last", 2, 0.25), (0.0, 0.75, 0.75, 0.0, 0.0)),
        (Activation("highest"), (0.0, 0.75, 0.0, 0.0, 0.0)),
        (Activation("highest", 3), (0.25, 0.75, 0.75, 0.0, 0.0)),
        (Activation("lowest"), (0.0, 0.0, 0.0, 0.0, 0.125)),
        (Activation("lowest", 3), (0.25, 0.75, 0.0, 0.0, 0.125)),
        (Activation("lowest", 9), (0.25, 0.75, 0.75, 0.0, 0.125)),
        (
            Activation("proportional"),
            (0.25 / 1.875, 0.75 / 1.875, 0.75 / 1.875, 0.0, 0.125 / 1.875),
        ),
        (Activation("threshold", 1, 0.25), (0.25, 0.75, 0.75, 0.0, 0.0)),
        (Activation("threshold", 1, 0.25, ">"), (0.0, 0.75, 0.75, 0.0, 0.0)),
        (Activation("threshold", 1, 0.25, "<"), (0.0, 0.0, 0.0, 0.0, 0.125)),
        (Activation("threshold", 1, 0.25, "<="), (0.25, 0.0, 0.0, 0.0, 0.125)),
        (Activation("threshold", 1, 0.25, "=="), (0.25, 0.0, 0.0, 0.0, 0.0)),
        (Activation("threshold", 1, 0.25, "!="), (0.0, 0.75, 0.75, 0.0, 0.125)),
    ],
    ids=repr,
)
def test_an_activation_chooses_rules(
    how: Activation, expected: tuple[float, ...]
) -> None:
    block = RuleBlock((), activation=how)
    found = infer(system(FOUR, block=block), {"a": 0.25, "b": 0.75})
    assert found.strengths == expected
    assert found.outputs[0] == pytest.approx(sum(expected), rel=1e-15)


ECHO = Proposition("y", ("one",))


@pytest.mark.parametrize(
    ("method", "expected"),
    [
        ("general", (0.25, 0.25, 0.0)),
        ("last", (0.25, 0.0, 0.0)),
        ("highest", (0.25, 0.0, 0.0)),
        ("proportional", (1.0, 0.0, 0.0)),
    ],
)
def test_a_rule_may_ask_what_earlier_rules_concluded(
    method: Any, expected: tuple[float, ...]
) -> None:
    rules = [
        rule(A_UP),
        rule(ECHO, "three"),
        rule(Proposition("y", ("line",)), "three"),
    ]
    block = RuleBlock((), activation=Activation(method, 9))
    found = infer(system(rules, LABELS, block=block), {"a": 0.25, "b": 0.0})
    assert found.strengths == expected


@pytest.mark.parametrize(
    ("aggregation", "expected"), [(None, 0.75), ("maximum", 0.5), ("sum", 0.75)]
)
def test_a_later_block_asks_for_the_joined_degrees_of_a_label(
    aggregation: SNorm | None, expected: float
) -> None:
    first = system([rule(A_UP), rule(B_UP)], LABELS, aggregation=aggregation)
    later = RuleBlock((rule(ECHO, "three"),), activation=Activation("highest"))
    found = infer(replace(first, blocks=(*first.blocks, later)), {"a": 0.25, "b": 0.5})
    assert found.strengths == (0.25, 0.5, expected)


def test_a_formula_sees_inputs_and_earlier_outputs() -> None:
    first = SystemOutput(
        "y",
        (Term("one", Singleton(2.0)),),
        None,
        None,
        Defuzzifier("weighted sum"),
    )
    formula = Term("sum", Formula(parse("10 * y + mix")))
    second = replace(first, name="z", terms=(formula,))
    found = FuzzySystem(
        "chain",
        (Variable("a", (UP,)), Variable("mix", parts=(Part("a", 3.0, 0.5),))),
        (first, second),
        (
            RuleBlock(
                (
                    SystemRule(None, (Conclusion("z", "sum"),)),
                    SystemRule(A_UP, (Conclusion("y", "one"),)),
                )
            ),
        ),
    )
    assert infer(found, {"a": 0.25}).outputs == (0.5, 10 * 0.5 + 3.0 * (0.25 - 0.5))


def test_inputs_are_moved_into_their_range_before_anything_else() -> None:
    line = Term("line", Linear((1.0,)))
    output = SystemOutput("y", (line,), None, None, Defuzzifier("weighted sum"))
    clamped = Variable("a", (UP,), low=0.25, high=0.5, clips=True)
    mix = Variable("mix", parts=(Part("a", 2.0),))
    subject = FuzzySystem(
        "clamped", (clamped, mix), (output,),
        (RuleBlock((SystemRule(None, (Conclusion("y", "line"),)),)),),
    )  # fmt: skip
    assert [infer(subject, {"a": a}).outputs[0] for a in (0.0, 0.3, 9.0)] == [
        *(0.25, 0.3, 0.5)
    ]
    open_above = replace(subject, variables=(replace(clamped, high=None), mix))
    assert infer(open_above, {"a": 9.0}).outputs == (9.0,)


def test_an_answer_is_moved_into_its_range_and_so_is_the_default() -> None:
    labels = (Term("one", Singleton(9.0)),)
    high = system([rule(A_UP)], labels, "weighted average", clips=True, default=-5.0)
    assert infer(high, {"a": 1.0, "b": 0.0}).outputs == (2.0,)
    assert infer(high, {"a": 0.0, "b": 0.0}).outputs == (0.0,)
    free = replace(high, outputs=(replace(high.outputs[0], default=None),))
    assert math.isnan(infer(free, {"a": 0.0, "b": 0.0}).outputs[0])


@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_a_row_without_a_value_makes_everything_nan(value: float) -> None:
    subject = system([rule(A_UP)], default=3.0)
    clamped = replace(subject.variables[1], low=0.0, high=1.0, clips=True)
    subject = replace(subject, variables=(subject.variables[0], clamped))
    found = infer(subject, {"a": 0.5, "b": value})
    assert math.isnan(found.outputs[0])
    assert math.isnan(found.strengths[0])
    assert found.status == Status.MISSING


def test_a_combination_that_overflows_is_missing() -> None:
    subject = system([rule(A_UP)])
    mix = Variable("mix", (UP,), parts=(Part("a", 1e300),))
    subject = replace(
        subject, variables=(*subject.variables, mix), outputs=subject.outputs
    )
    assert infer(subject, {"a": 1.0, "b": 0.0}).status == Status.DECIDED
    assert infer(subject, {"a": 1e300, "b": 0.0}).status == Status.MISSING


def test_a_column_without_a_value_is_a_key_error() -> None:
    with pytest.raises(KeyError):
        infer(system([rule(A_UP)]), {"a": 0.5})


def test_a_degree_that_is_nan_activates_nothing() -> None:
    root = Variable("a", (Term("up", Formula(parse("sqrt(x)"))),))
    subject = replace(system([rule(A_UP), rule(B_UP)]), variables=(
        root, Variable("b", (UP,)),
    ))  # fmt: skip
    found = infer(subject, {"a": -1.0, "b": 0.5})
    assert found.strengths == (0.0, 0.5)
    assert found.outputs == (0.5,)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", range(30))
def test_nothing_fails_on_any_system_and_any_row(seed: int) -> None:
    subject = random_system(seed, formulas="wild")
    rows = random_rows(subject, seed, 6)
    chance = random.Random(seed)
    extreme = (1e308, -1e308, 5e-324, -0.0, 0.0, 1e16)
    rows += [
        {name: chance.choice(extreme) for name in subject.inputs} for _ in range(9)
    ]
    for row in rows:
        found = infer(subject, row)
        assert len(found.outputs) == len(subject.outputs)
        assert len(found.strengths) == len(subject.rules)
        assert repr(infer(subject, row)) == repr(found)


def test_random_systems_show_everything_that_a_system_can_have() -> None:
    seen: set[str] = set()
    for seed in range(100):
        subject = random_system(seed)
        for variable in subject.all_variables:
            seen |= {type(label.function).__name__ for label in variable.terms}
        for output in subject.outputs:
            how = output.defuzzifier
            seen |= {how.method, how.grid, f"joined by {output.aggregation}"}
        for block in subject.blocks:
            seen |= {f"and {block.conjunction}", f"or {block.disjunction}"}
            seen |= {f"cut by {block.implication}", block.activation.method}
            seen |= {block.activation.relation}
        seen |= set(repr(subject.rules).split("'"))
    kinds = {kind.__name__ for kind in get_args(Curve)}
    norms = {f"and {name}" for name in get_args(TNorm)}
    norms |= {f"cut by {name}" for name in get_args(TNorm)}
    norms |= {f"or {name}" for name in get_args(SNorm)}
    norms |= {f"joined by {name}" for name in (None, *get_args(SNorm))}
    hedges = set(get_args(Hedge))
    # `lines` needs one method and two operators; `exporter_models` has it.
    others = {*get_args(DefuzzifierMethod), *get_args(Grid)} - {"lines"}
    assert kinds | norms | hedges | others <= seen


def test_a_rule_that_was_not_chosen_concludes_nothing_under_a_hedge() -> None:
    then = (Conclusion("y", "three", ("not",)),)
    rules = [rule(A_UP), SystemRule(A_DOWN, then)]
    for method in ("lowest", "first"):
        block = RuleBlock((), activation=Activation(method))
        found = infer(system(rules, LABELS, block=block), {"a": 0.25, "b": 0.0})
        assert found.strengths == (0.25, 0.0)
        assert found.outputs == (0.25,)


def test_the_last_sample_is_the_end_of_the_range() -> None:
    for grid in ("ends", "half ends"):
        how = Defuzzifier("centroid", 12, grid)
        found = sampled_values(SystemOutput("y", (), 0.1, 0.9, how, "maximum"))
        assert len(found) == 12
        assert found[0] == 0.1
        assert found[-1] == 0.9
    assert 0.1 + 11 * ((0.9 - 0.1) / 11) != 0.9  # without which the test is idle


def test_degrees_above_1_are_bounded_by_the_aggregation_that_joins_them() -> None:
    block = RuleBlock((), disjunction="sum")
    rules = [rule(Or((A_DOWN, B_UP))), rule(ECHO, "three")]
    subject = system(rules, LABELS, aggregation="bounded sum", block=block)
    found = infer(subject, {"a": 0.25, "b": 0.75})
    assert found.strengths == (1.5, 1.0)
    assert found.outputs == (1.0 * 1.0 + 1.0 * 3.0,)


@pytest.mark.parametrize("method", ["general", "last", "highest"])
def test_numbers_are_added_in_the_order_of_the_rules(method: Any) -> None:
    labels = [
        Term(f"n{k}", Singleton(value)) for k, value in enumerate((1e16, -1e16, 1.0))
    ]
    rules = [rule(None, label.name) for label in labels]
    block = RuleBlock((), activation=Activation(method, 3))
    found = infer(system(rules, labels, block=block), {"a": 0.0, "b": 0.0})
    assert found.outputs == (1.0,)  # from the end it would be 0


def test_a_combination_is_of_values_within_their_ranges() -> None:
    clamped = Variable("a", (UP,), low=0.0, high=0.5, clips=True)
    mix = Variable("mix", (UP,), parts=(Part("a", 2.0, 0.25), Part("b", 1.0)))
    subject = system([rule(B_UP)])
    subject = replace(subject, variables=(clamped, Variable("b", (UP,)), mix))
    block = RuleBlock((rule(Proposition("mix", ("up",))),))
    subject = replace(subject, blocks=(block,))
    found = infer(subject, {"a": 9.0, "b": 0.125})
    assert found.strengths == (2.0 * (0.5 - 0.25) + 0.125,)


def test_a_degree_of_an_input_is_computed_once_for_a_row(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls: list[Curve] = []

    def counted(curve: Curve, *rest: Any) -> float:
        calls.append(curve)
        return curve_degree(curve, *rest)

    monkeypatch.setattr("fuzzytree.semantics.inference.curve_degree", counted)
    rules = tuple(
        rule(And((Proposition("a", ("up",)), Proposition("b", ("down",)))))
        for _ in range(50)
    )
    infer(system(rules), {"a": 0.25, "b": 0.5})
    assert calls == [UP.function, DOWN.function]
