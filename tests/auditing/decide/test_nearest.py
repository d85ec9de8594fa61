"""No change of a row is cheaper than the one that is certified."""

from __future__ import annotations

import random
import sys
from fractions import Fraction

import pytest
from msgspec.structs import replace

from fuzzytree.auditing.decide import Base, Budget
from fuzzytree.auditing.decide.contest import decision
from fuzzytree.auditing.decide.costs import Costs, Nearest
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.nearest import nearest
from fuzzytree.auditing.decide.polytopes import Leaves
from fuzzytree.model import Conjunction, FuzzyTree
from fuzzytree.testing import random_tree
from tests.auditing.decide.bases import Kind, random_base

POINTS = 120


def some_seeds(count: int, quick: int = 1) -> list[object]:
    """Return seeds, all but the first few of which are for the long run."""
    heavy = [pytest.param(n, marks=pytest.mark.heavy) for n in range(quick, count)]
    return [*range(quick), *heavy]


def draw_value(side: DomainSide, chance: random.Random) -> Fraction:
    """Return a value that rows can have, often a plain one."""
    values = [*side.points]
    if not values:
        number = chance.uniform(side.low, side.high)
        values = [float(round(number)) if side.is_whole else number]
        if not side.is_whole and chance.random() < 0.5:
            values = [min(max(round(number * 4) / 4, side.low), side.high)]
        if side.missing is not None and chance.random() < 0.2:
            values = [side.missing]
    return Fraction(chance.choice(values))


def draw_row(
    domain: Domain, inputs: tuple[str, ...], chance: random.Random
) -> dict[str, Fraction]:
    """Return a row of the domain."""
    sides = {side.variable: side for side in domain.sides}
    return {name: draw_value(sides[name], chance) for name in inputs}


def check(
    source: Base | Leaves,
    result: Nearest,
    row: dict[str, Fraction],
    chance: random.Random,
    wanted: str | None = None,
    costs: Costs | None = None,
) -> None:
    """Compare bounds with many points, most of them about as near as the bounds."""
    inputs = tuple(source.inputs)
    sides = {side.variable: side for side in source.domain.sides}
    costs = costs or Costs(source.domain, inputs)

    def label(point: dict[str, Fraction]) -> str | None:
        return (
            source.decision(point)[0]
            if isinstance(source, Leaves)
            else decision(source, point)[0]
        )

    def is_sought(point: dict[str, Fraction]) -> bool:
        return label(point) == wanted if wanted else label(point) != label(row)

    if result.point is not None:
        assert is_sought(result.point)
        assert all(sides[name].has(result.point[name]) for name in inputs)
        assert costs.distance(row, result.point) == result.high
        assert all(result.point[name] == row[name] for name in costs.fixed)
        assert result.high is not None
        assert result.low <= result.high
    for _ in range(POINTS):
        point = dict(row)
        share = chance.choice([1, chance.random(), chance.random() ** 3])
        for name in inputs:
            if name in costs.fixed or chance.random() < 0.3:
                continue
            value = draw_value(sides[name], chance)
            if not sides[name].points and chance.random() < 0.8:
                value = sides[name].nearest(
                    row[name] + (value - row[name]) * Fraction(share)
                )
            point[name] = value
        if is_sought(point):
            assert not result.is_none
            assert costs.distance(row, point) >= result.low


@pytest.mark.parametrize(
    ("kind", "conjunction", "sums"),
    [
        ("steps", "minimum", 0),
        ("categories", "minimum", 0),
        pytest.param("steps", "product", 0, marks=pytest.mark.heavy),
        pytest.param("curves", "minimum", 0, marks=pytest.mark.heavy),
        pytest.param("steps", "minimum", 2, marks=pytest.mark.heavy),
    ],
)
@pytest.mark.parametrize("seed", some_seeds(4))
def test_no_cheaper_change_of_rules_exists(
    kind: Kind, conjunction: Conjunction, sums: int, seed: int
) -> None:
    rules, domain = random_base(seed, kind, conjunction, sums)
    base, chance = Base.of(rules, domain), random.Random(seed)
    for _ in range(3):
        row = draw_row(domain, rules.inputs, chance)
        check(base, nearest(base, row), row, chance)


@pytest.mark.parametrize("seed", some_seeds(4))
def test_sums_and_curves_are_bounded_without_a_solver(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "z3", None)
    for kind in ("steps", "curves"):
        rules, domain = random_base(seed, kind, "product", 2)
        base, chance = Base.of(rules, domain), random.Random(seed)
        row = draw_row(domain, rules.inputs, chance)
        result = nearest(base, row)
        assert result.is_none or result.high == 0 or result.low > 0
        check(base, result, row, chance)


def valued(tree: FuzzyTree, seed: int) -> tuple[FuzzyTree, Domain]:
    """Return a tree with its domain: categories, whole numbers and stand-ins."""
    chance = random.Random(seed)
    reach = 1.0 + 2.0 * max((abs(c) for n in tree.nodes for c in n.cuts), default=1.0)
    sides = []
    for n, name in enumerate(tree.inputs):
        top = float(int(reach) + 1)
        kinds = [
            DomainSide(
                name, -reach, reach, missing=chance.choice([None, -2 * reach, 0.0])
            ),
            DomainSide(
                name, -top, top, is_whole=True, missing=chance.choice([None, 0.5])
            ),
            DomainSide(name, 0.0, 4.0, values=(0.0, 1.0, 2.0, 3.0, 4.0), missing=-1.0),
        ]
        sides.append(kinds[(seed + n) % 3])
    return tree, Domain(tuple(sides))


@pytest.mark.parametrize("seed", some_seeds(10, 3))
def test_no_cheaper_change_of_a_tree_exists(seed: int) -> None:
    tree, domain = valued(
        random_tree(seed, inputs=3, combinations=0.5 * (seed % 2)), seed
    )
    leaves, chance = Leaves(tree, domain), random.Random(seed)
    for _ in range(4):
        row = draw_row(domain, tree.inputs, chance)
        result = nearest(leaves, row)
        assert result.is_narrow
        check(leaves, result, row, chance)


@pytest.mark.parametrize("seed", [2, 4, 6, 11])
def test_bounds_meet_for_sums_of_categories_and_whole_numbers(seed: int) -> None:
    tree, domain = valued(random_tree(seed, inputs=3, combinations=0.8), seed)
    leaves, chance = Leaves(tree, domain), random.Random(seed)
    for _ in range(4):
        row = draw_row(domain, tree.inputs, chance)
        result = nearest(leaves, row)
        assert result.is_narrow
        check(leaves, result, row, chance)


@pytest.mark.parametrize("seed", some_seeds(6))
def test_fixed_columns_stay_and_costs_are_the_unit(seed: int) -> None:
    rules, domain = random_base(seed, "categories")
    base, chance = Base.of(rules, domain), random.Random(seed)
    row = draw_row(domain, rules.inputs, chance)
    given = {name: Fraction(chance.randint(1, 6), 4) for name in rules.inputs}
    fixed = rules.inputs[1:2]
    costs = Costs(domain, rules.inputs, fixed, given)
    for wanted in "abc":
        result = nearest(base, row, wanted, fixed, given)
        check(base, result, row, chance, wanted, costs)


def test_a_small_budget_gives_bounds_that_say_so() -> None:
    rules, domain = random_base(3, "curves", "product")
    base, chance = Base.of(rules, domain), random.Random(3)
    row = draw_row(domain, rules.inputs, chance)
    result = nearest(base, row, budget=Budget(500))
    assert result.why == "the budget was spent"
    check(base, result, row, chance)


def test_what_is_no_input_or_costs_nothing_is_refused() -> None:
    rules, domain = random_base(1)
    base = Base.of(rules, domain)
    row = {side.variable: Fraction(side.low) for side in domain.sides}
    with pytest.raises(ValueError, match="'y' is no input; the inputs are x0"):
        nearest(base, row, fixed=["y"])
    with pytest.raises(ValueError, match="must cost more than 0"):
        nearest(base, row, costs={"x0": Fraction(0)})


def test_a_category_changes_or_does_not() -> None:
    side = DomainSide("city", 0.0, 3.0, values=(0.0, 1.0, 2.0, 3.0))
    costs = Costs(Domain((side,)), ("city",))
    assert costs.of("city", Fraction(0), Fraction(3)) == 1
    assert costs.of("city", Fraction(0), Fraction(1)) == 1
    number = replace(side, values=(), missing=-1.0)
    costs = Costs(Domain((number,)), ("city",))
    assert costs.of("city", Fraction(0), Fraction(1)) == Fraction(1, 3)
    assert costs.of("city", Fraction(0), Fraction(-1)) == 1
