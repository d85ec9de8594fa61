"""Exact answers, against values worked by hand."""

import math
from decimal import Decimal, localcontext
from fractions import Fraction

import pytest

from fuzzytree.model.rulebase import (
    LR,
    Band,
    Conjunction,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Shape,
    Side,
    Term,
    Variable,
)
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.numerics.exact import (
    CAP,
    DECIDED,
    MISSING,
    TIE,
    UNCOVERED,
    exact_answer,
    exact_axis,
    exact_degree,
    outwards,
)
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import probes
from fuzzytree.semantics.reference import axis_values, descend
from fuzzytree.testing import random_tree

RAMP = Band(high=1.0, right=4.0)
HALF = Side(2.0, (0.5,))
BENT = Side(2.0, (0.5, 0.25))
TINY = 5e-324
ABOVE_ONE = math.nextafter(1.0, 2.0)


@pytest.mark.parametrize(
    ("shape", "value", "degree"),
    [
        (RAMP, 2.0, Fraction(2, 3)),  # (2 - 4) / (1 - 4)
        (RAMP, 3.0, Fraction(1, 3)),
        (RAMP, 1.0, Fraction(1)),  # the plateau's upper end is closed
        (RAMP, ABOVE_ONE, CAP),  # 1 - 2**-52 / 3 is above the cap
        (RAMP, 4.0, Fraction(0)),
        (RAMP, math.nextafter(4.0, 0.0), Fraction(1, 3 * 2**51)),
        (RAMP, 1e300, Fraction(0)),
        (Band(low=1.0), 1.0, Fraction(0)),  # its lower end is open
        (Band(low=1.0), ABOVE_ONE, Fraction(1)),
        (Band(high=0.0, right=4 * TINY), TINY, Fraction(3, 4)),
        (
            Band(high=2.0**1000, right=2.0**1002),
            2.0**1001,
            Fraction(2, 3),
        ),
        (LR(0.0, HALF, HALF), 0.0, Fraction(1)),
        (LR(0.0, HALF, HALF), 1.0, Fraction(3, 4)),  # 1 - 1/2 * 1/2
        (LR(0.0, HALF, HALF), -2.0, Fraction(1, 2)),  # a spread away: 1 - 1/2
        (LR(0.0, HALF, HALF), 6.0, Fraction(1, 32)),  # 1/2 * ((5 - 3) / 4)**4
        (LR(0.0, HALF, HALF), 10.0, Fraction(0)),  # at its reach
        (
            LR(0.0, HALF, HALF),
            10.0 - 2.0**-49,
            Fraction(1, 2**209),
        ),
        (LR(0.0, BENT, BENT), 0.5, Fraction(29, 32)),  # 1 - 1/4 (1/2 - 1/2 * 1/4)
        (LR(0.0, Side(1.0, (2.0,)), HALF), -0.75, Fraction(0)),  # 1 - 3/2, clamped
        (Points((0.0, 3.0), (1.0, 0.0)), 1.0, Fraction(2, 3)),
        (Points((0.0, 3.0), (0.25, 0.75)), -7.0, Fraction(1, 4)),
        (Points((0.0, 3.0), (0.25, 0.75)), 7.0, Fraction(3, 4)),
        (
            Points((2.0, 2.0), (1.0, 0.0)),
            2.0,
            Fraction(1),
        ),  # a step belongs to the left
        (Points((2.0, 2.0), (1.0, 0.0)), math.nextafter(2.0, 3.0), Fraction(0)),
    ],
)
def test_a_degree_worked_by_hand(shape: Shape, value: float, degree: Fraction) -> None:
    assert exact_degree(shape, Fraction(value)) == degree


def test_a_combination_that_cancels_keeps_every_digit() -> None:
    # The doubles next to 0.1 and 0.2 are too large by 0.4 and 0.8 of 2**-56 * 1.6, that
    # next to 0.3 is too small: what remains is 2**-55. Rounded sums leave twice that.
    parts = (Part("a", 1.0), Part("b", 1.0), Part("c", -1.0))
    row = {"a": 0.1, "b": 0.2, "c": 0.3}
    mix = Variable("mix", parts=parts)
    assert exact_axis(mix, row) == Fraction(1, 2**55)
    assert axis_values((mix,), row)["mix"] == 2.0**-54


def test_a_path_follows_the_exact_value_and_not_the_rounded_one() -> None:
    # As above: 2**-55 is below the cut, the rounded 2**-54 above it.
    cut = 1.5 * 2.0**-55
    terms = (
        Term("low", Band(high=cut, right=1.0)),
        Term("high", Band(low=cut, left=-1.0)),
    )
    parts = (Part("a", 1.0), Part("b", 1.0), Part("c", -1.0))
    branches = Branch(("low",), leaf=1), Branch(("high",), leaf=2)
    tree = FuzzyTree(
        "thirds",
        ("left", "right"),
        (*map(Variable, "abc"), Variable("mix", terms, parts=parts)),
        (Node("mix", (cut,), (0, 1), branches),),
        (Leaf("left"), Leaf("right")),
    )
    row = {"a": 0.1, "b": 0.2, "c": 0.3}
    assert exact_answer(tree, row).label == "left"
    assert descend(tree, row).label == "right"


def answered(
    x: float, *terms: Shape, then: str, conjunction: Conjunction = "minimum"
) -> tuple[int, str | None, int, Fraction | int]:
    """Ask rules with one proposition each, of one variable, for classes."""
    variable = Variable("x", tuple(Term(str(k), t) for k, t in enumerate(terms)))
    rules = RuleBase(
        "few",
        ("a", "b"),
        (variable,),
        tuple(
            Rule((Proposition("x", (str(k),)),), label) for k, label in enumerate(then)
        ),
        Semantics(conjunction, uncovered="b", missing="a"),
    )
    found = exact_answer(rules, {"x": x})
    return found.rule, found.label, found.status, found.margin


FLAT = Points((0.0,), (0.5,))
LESS = Points((0.0,), (0.25,))
NONE = Points((0.0,), (0.0,))


def test_the_margin_is_to_the_next_class_and_not_to_the_next_rule() -> None:
    assert answered(0.0, FLAT, FLAT, LESS, then="aab") == (1, "a", TIE, Fraction(1, 4))


def test_without_another_class_the_margin_is_to_having_no_rule() -> None:
    assert answered(0.0, FLAT, then="a") == (1, "a", DECIDED, Fraction(1, 2))


def test_a_tie_between_classes_has_no_margin_and_the_first_wins() -> None:
    assert answered(0.0, LESS, FLAT, FLAT, then="aba") == (2, "b", TIE, 0)


def test_no_rule_and_no_value_answer_as_declared() -> None:
    assert answered(0.0, NONE, then="a") == (0, "b", UNCOVERED, 0)
    assert answered(math.nan, FLAT, then="b") == (0, "a", MISSING, 1)
    assert answered(math.inf, FLAT, then="b") == (0, "a", MISSING, 1)


def test_a_rule_without_a_proposition_always_holds() -> None:
    rules = RuleBase("one", ("a",), (), (Rule((), "a"),))
    assert exact_answer(rules, {}).strengths == (Fraction(1),)


def test_is_not_is_one_minus_the_largest_of_the_terms() -> None:
    variable = Variable("x", (Term("low", RAMP), Term("flat", LESS)))
    proposition = Proposition("x", ("low", "flat"), hedges=("not",))
    rules = RuleBase("not", ("a",), (variable,), (Rule((proposition,), "a"),))
    assert exact_answer(rules, {"x": 2.0}).strengths == (Fraction(1, 3),)
    assert exact_answer(rules, {"x": 4.0}).strengths == (Fraction(3, 4),)


def test_a_combination_that_overflows_is_missing_though_it_has_an_exact_value() -> None:
    parts = (Part("a", 1e200), Part("b", -1e200))
    variables = (Variable("a"), Variable("b"), Variable("mix", parts=parts))
    tree = FuzzyTree("one", ("a",), variables, (), (Leaf("a"),))
    row = {"a": 1e200, "b": 1e200}
    assert exact_axis(variables[2], row) == 0
    assert exact_answer(tree, row).status == MISSING
    assert exact_answer(tree, {"a": 1e100, "b": 1e100}).status == DECIDED


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_has_no_exact_value(value: float) -> None:
    with pytest.raises(ValueError, match=f"^'x' has no exact value: it is {value!r}$"):
        exact_axis(Variable("x"), {"x": value})


@pytest.mark.parametrize(
    ("number", "ends"),
    [
        (Fraction(1, 2), (0.5, 0.5)),
        (Fraction(1, 2) + Fraction(1, 2**60), (0.5, math.nextafter(0.5, 1.0))),
        (Fraction(1, 2) - Fraction(1, 2**60), (math.nextafter(0.5, 0.0), 0.5)),
        (Fraction(1, 10**400), (0.0, 5e-324)),
    ],
)
def test_a_fraction_lies_between_its_doubles(
    number: Fraction, ends: tuple[float, float]
) -> None:
    assert outwards(number) == ends


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", ["relative", "raw"])
def test_decimals_of_eighty_digits_say_the_same(seed: int, kind: str) -> None:
    tree = random_tree(seed, leaves=4, inputs=2, combinations=0)
    rules = rules_from_tree(tree, "raw" if kind == "raw" else "relative")
    shapes = [(v.name, term.shape) for v in rules.variables for term in v.terms]
    with localcontext() as context:
        context.prec = 80
        for row in probes(rules, limit=60):
            if not all(map(math.isfinite, row.values())):
                continue
            for name, shape in shapes:
                exact = exact_degree(shape, Fraction(row[name]))
                close = Decimal(exact.numerator) / exact.denominator
                assert abs(_decimal(shape, Decimal(row[name])) - close) < 1e-60


def _decimal(shape: Shape, x: Decimal) -> Decimal:
    """Evaluate in decimals, by powers and not by Horner's rule."""
    if isinstance(shape, Band):
        for edge, end in shape.flanks:
            start, zero = Decimal(edge), Decimal(end)
            if (x > start) if end > edge else (x <= start):
                q = _clamped((x - zero) / (start - zero))
                return min(q, 1 - Decimal(2) ** -53)
        return Decimal(1)
    assert isinstance(shape, LR)
    is_left = x <= Decimal(shape.mean)
    side = shape.left if is_left else shape.right
    u = abs(x - Decimal(shape.mean)) / Decimal(side.spread)
    t = min(u, Decimal(1))
    curve = sum(
        (Decimal(c) * (2 * t - 1) ** k if k else Decimal(c))
        for k, c in enumerate(side.curve)
    )
    reach = Decimal(side.reach)
    return _clamped(1 - t * curve) * _clamped((reach - u) / (reach - 1)) ** 4


def _clamped(value: Decimal) -> Decimal:
    return min(max(value, Decimal(0)), Decimal(1))
