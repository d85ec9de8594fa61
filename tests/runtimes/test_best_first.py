"""The bounds that best-first searches by, and its answers where they are tight."""

from __future__ import annotations

import itertools
import random
from typing import TYPE_CHECKING

import numpy as np
import pytest

from fuzzytree.model.rulebase import (
    LR,
    Band,
    Conjunction,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Shape,
    Side,
    Term,
    Variable,
)
from fuzzytree.runtimes import best_first
from fuzzytree.runtimes.envelope import (
    AxisCells,
    Envelope,
    cell_ends,
    cells_of,
    plan_envelope,
)
from fuzzytree.runtimes.native import load, load_best_first
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import degree
from fuzzytree.testing import probe_values, random_tree

if TYPE_CHECKING:
    from fuzzytree.model.contracts import BoolArray, FloatArray, IntArray
    from fuzzytree.runtimes.best_first import Net

LARGEST = float(np.finfo(np.float64).max)
STEEP = (1.4, -3.0, 2.5, -4.0, 5.0)  # a body that overshoots at both ends


def sided(mean: float, spread: float, curve: tuple[float, ...] = (0.6, 0.1)) -> LR:
    side = Side(spread, curve)
    return LR(mean, side, side)


def random_shape(chance: random.Random, middle: float, unit: float) -> Shape:
    def curve() -> tuple[float, ...]:
        return tuple(chance.uniform(-2.0, 3.0) for _ in range(chance.randint(1, 8)))

    def side() -> Side:
        spread = unit * chance.choice((0.01, 0.3, 1.0, 4.0))
        return Side(spread, curve(), chance.choice((1.001, 2.0, 5.0)))

    at = middle + unit * chance.uniform(-2.0, 2.0)
    if chance.random() < 0.7:
        return LR(at, side(), side())
    high = at + unit * chance.uniform(0.1, 1.0)
    left = at - unit
    right = high + 0.1 * unit
    low, below = chance.choice(((None, None), (at, None), (at, left)))
    return Band(low, high, below, chance.choice((None, right)))


def families() -> dict[str, list[Shape]]:
    chance = random.Random(0)
    result: dict[str, list[Shape]] = {
        "one": [sided(0.0, 1.0)],
        "duplicates": [*[sided(0.25, 1.0)] * 5, *[sided(0.5, 1.0)] * 2],
        "nested": [sided(0.0, 2.0**power) for power in range(-8, 8)],
        "flat": [sided(place, 1e9) for place in (-1.0, 0.0, 1.0)],
        "curve of zeros": [sided(place, 0.5, (0.0,)) for place in (-1.0, 0.0, 0.1)],
        "steep": [sided(place / 7.0, 0.4, STEEP) for place in range(-7, 8)],
        "many": [sided(place / 50.0, 0.03) for place in range(-50, 50)],
        "needles": [sided(place * 1e-9, 1e-12) for place in range(20)],
        "far from 0": [sided(1e9 + place / 7.0, 0.2) for place in range(9)],
        "steps": [Band(low, low + 1.0) for low in (-2.0, -1.0, 0.5)],
        "open": [Band(None, 0.0), Band(0.0, None, -1.0), Band(None, None)],
        "largest": [sided(-1e308, 1e300), sided(1e308, 1e307), sided(1e308, 1e305)],
    }
    for seed, (middle, unit) in enumerate([(0.0, 1.0), (1e6, 3.0), (-5.0, 1e-6)]):
        shapes = [random_shape(chance, middle, unit) for _ in range(40)]
        result[f"random {seed}"] = shapes
    return result


FAMILIES = families()


def rules_of(shapes: list[Shape], conjunction: Conjunction = "minimum") -> RuleBase:
    """Return rules that ask a variable for all, some, one, and none of its terms."""
    names = tuple(f"t{number}" for number in range(len(shapes)))
    propositions = [
        Proposition("x", names),
        Proposition("x", names, hedges=("not",)),
        *(Proposition("x", names[start::3]) for start in range(min(3, len(names)))),
        *(Proposition("x", (name,)) for name in names[:5]),
        Proposition("x", names[:1], hedges=("not",)),
    ]
    terms = tuple(Term(name, shape) for name, shape in zip(names, shapes, strict=True))
    rules = [Rule((proposition,), "y") for proposition in propositions]
    rules += [
        Rule((propositions[0], proposition), "z") for proposition in propositions[1:]
    ]
    return RuleBase(
        "x", ("y", "z"), (Variable("x", terms),), tuple(rules), Semantics(conjunction)
    )


def envelope_of(rules: RuleBase) -> tuple[Envelope, list[Proposition]]:
    propositions = list(dict.fromkeys(c for rule in rules.rules for c in rule.when))
    return plan_envelope(rules, propositions, {"x": 0}), propositions


def marks_of(shapes: list[Shape]) -> list[float]:
    result: list[float] = []
    for shape in shapes[:40]:
        if isinstance(shape, LR):
            for side, sign in ((shape.left, -1.0), (shape.right, 1.0)):
                steps = (0.0, 0.5, 1.0, side.reach)
                result += [shape.mean + sign * side.spread * step for step in steps]
            continue
        assert isinstance(shape, Band)
        result += [end for _, end in shape.flanks]
        result += [end for end in (shape.low, shape.high) if end is not None]
    return result


def values_near(shapes: list[Shape], grid: AxisCells) -> FloatArray:
    """Return landmarks, ends of cells, their neighbours, and values far and between."""
    low, high = cell_ends(grid, 0)
    chance = np.random.default_rng(0)
    first, last = (np.clip(end, -LARGEST / 4, LARGEST / 4) for end in (low, high))
    between = first + chance.uniform(size=len(first)) * (last - first)
    ends = np.concatenate([low[1::7], high[:-1:7], marks_of(shapes)])
    ends = ends[np.isfinite(ends)]
    far = [0.0, -0.0, 5e-324, 1e200, -1e200, LARGEST, -LARGEST]
    with np.errstate(over="ignore"):
        beside = np.nextafter(ends, np.inf), np.nextafter(ends, -np.inf)
    result: FloatArray = np.concatenate([ends, *beside, between[::3], far])
    return result[np.isfinite(result)]


@pytest.mark.parametrize("family", FAMILIES)
def test_a_value_lies_between_the_ends_of_its_cell(family: str) -> None:
    grid = envelope_of(rules_of(FAMILIES[family]))[0].grid
    values = values_near(FAMILIES[family], grid)
    with np.errstate(all="ignore"):
        cells = cells_of(grid, values[np.newaxis])[0]
    low, high = cell_ends(grid, 0)
    assert cells.min() >= 0
    assert cells.max() < grid.count
    assert np.all(low[cells] <= values)
    assert np.all(values <= high[cells])


@pytest.mark.one_in(4)
@pytest.mark.parametrize("family", FAMILIES)
def test_the_bounds_of_a_proposition_hold_to_the_bit(family: str) -> None:
    rules = rules_of(FAMILIES[family])
    envelope, propositions = envelope_of(rules)
    values = values_near(FAMILIES[family], envelope.grid)
    degrees = np.array(
        [[degree(shape, x) for x in values.tolist()] for shape in FAMILIES[family]]
    )
    with np.errstate(all="ignore"):
        cells = cells_of(envelope.grid, values[np.newaxis])[0]
    for number, proposition in enumerate(propositions):
        mine = [int(name[1:]) for name in proposition.terms]
        expected = degrees[mine].max(axis=0)
        expected = 1.0 - expected if proposition.negated else expected
        entries = number * envelope.grid.count + cells
        assert np.all(envelope.lower[entries] <= expected)
        assert np.all(envelope.upper[entries] >= expected)


def test_bounds_of_a_proposition_are_close_where_its_terms_are() -> None:
    rules = rules_of([sided(0.0, 1.0)])
    envelope, _ = envelope_of(rules)
    with np.errstate(all="ignore"):
        cells = cells_of(envelope.grid, np.linspace(-1.0, 1.0, 201)[np.newaxis])[0]
    assert np.all(envelope.upper[cells] - envelope.lower[cells] < 0.02)


@pytest.mark.one_in(4)
@pytest.mark.parametrize("conjunction", ["minimum", "product"])
@pytest.mark.parametrize("family", FAMILIES)
def test_the_winner_is_that_of_firing_at_every_landmark(
    family: str, conjunction: Conjunction
) -> None:
    rules = rules_of(FAMILIES[family], conjunction)
    values = values_near(FAMILIES[family], envelope_of(rules)[0].grid)[np.newaxis]
    assert_fired(rules, values)


def assert_fired(rules: RuleBase, values: FloatArray) -> None:
    result, expected = load_best_first(rules)(values), load(rules)(values)
    assert np.array_equal(result.rule, expected.rule)
    assert np.array_equal(result.status, expected.status)


@pytest.mark.one_in(8)
@pytest.mark.parametrize("conjunction", ["minimum", "product"])
@pytest.mark.parametrize("seed", range(3))
def test_raw_rules_of_a_tree_are_won_as_by_firing(
    seed: int, conjunction: Conjunction
) -> None:
    tree = random_tree(seed, leaves=90, inputs=5)
    rules = rules_from_tree(tree, "raw", conjunction=conjunction)
    assert_fired(rules, probe_values(tree, 1500))


def test_more_rows_than_go_through_together_are_answered() -> None:
    rules = rules_from_tree(random_tree(3, leaves=12, combinations=0.0), "raw")
    chance = np.random.default_rng(0)
    values = chance.normal(size=(len(rules.inputs), 20_000)) * 100.0
    values[0, ::7] = np.nan
    assert_fired(rules, values)


@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_a_row_that_many_rules_reach_alike_is_a_tie_of_the_first(
    conjunction: Conjunction,
) -> None:
    side = Side(1.0, (0.5,))
    terms = tuple(Term(f"t{n}", LR(0.0, side, side)) for n in range(60))
    rules = tuple(
        Rule((Proposition("x", (f"t{a}",)), Proposition("x", (f"t{b}",))), "y")
        for a in range(10)
        for b in range(60)
    )
    model = RuleBase(
        "x", ("y",), (Variable("x", terms),), rules, Semantics(conjunction)
    )
    values = np.array([[-9.0, -0.5, 0.0, 0.25, np.nan, 4.0, 5.0]])
    result = load_best_first(model)(values)
    assert result.rule.tolist() == [0, 1, 1, 1, 0, 1, 0]
    assert result.status.tolist() == [2, 1, 1, 1, 3, 1, 2]


def test_a_rule_may_end_where_another_goes_on() -> None:
    shapes: list[Shape] = [sided(0.0, 1.0), sided(1.0, 1.0)]
    terms = tuple(Term(f"t{n}", shape) for n, shape in enumerate(shapes))
    first, second = Proposition("x", ("t0",)), Proposition("x", ("t1",))
    rules = (
        Rule((first, second), "y"),
        Rule((first,), "y"),
        Rule((second, first), "y"),
    )
    model = RuleBase("x", ("y",), (Variable("x", terms),), rules)
    values = np.array([[0.0, 0.5, 1.0, 6.0]])
    result = load_best_first(model)(values)
    assert result.rule.tolist() == [2, 1, 1, 0]
    assert result.status.tolist() == [0, 1, 1, 2]
    assert_fired(model, values)


def grid(size: int, inputs: int) -> RuleBase:
    """Return rules for all combinations of overlapping terms."""
    side = Side(0.8, (0.6, 0.3), 3.0)
    terms = tuple(Term(f"t{k}", LR(float(k), side, side)) for k in range(size))
    variables = tuple(Variable(f"x{k}", terms) for k in range(inputs))
    choices = itertools.product(terms, repeat=inputs)
    rules = tuple(
        Rule(
            tuple(
                Proposition(v.name, (term.name,))
                for v, term in zip(variables, choice, strict=True)
            ),
            "y",
        )
        for choice in choices
    )
    return RuleBase(f"{size}^{inputs}", ("y",), variables, rules)


@pytest.fixture
def searches(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Choose between search and firing as in use; return the rows of each search."""
    monkeypatch.undo()
    rows: list[int] = []
    run_down = best_first._run_down

    def noted(net: Net, lines: FloatArray) -> tuple[IntArray, BoolArray]:
        rows.append(lines.shape[1])
        return run_down(net, lines)

    monkeypatch.setattr(best_first, "_run_down", noted)
    return rows


def test_few_rules_and_few_rows_are_fired_and_many_of_both_searched(
    searches: list[int],
) -> None:
    few, many = grid(3, 2), grid(5, 4)
    near = np.random.default_rng(0).normal(2.0, 1.5, size=(4, 3000))
    assert_fired(few, near[:2])
    assert_fired(many, near[:, :100])
    assert searches == []
    assert_fired(many, near)
    assert sum(searches) == 3000


def test_rows_that_bounds_leave_open_are_fired_after_the_first_of_them(
    searches: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(best_first, "_CALL_COST", 1e5)
    rules = grid(5, 3)
    run, fire = load_best_first(rules), load(rules)
    tied = np.full((3, 8000), 1.5)  # between two terms of every axis
    near = np.random.default_rng(0).normal(2.0, 0.1, size=(3, 8000))
    for values in (tied[:, :2000], near[:, :2000], tied, near):
        result, expected = run(values), fire(values)
        assert np.array_equal(result.rule, expected.rule)
        assert np.array_equal(result.status, expected.status)
    few_tied, many_tied, *all_near = searches
    assert max(few_tied, many_tied) < 300
    assert sum(all_near) == 8000


def test_ties_gaps_and_missing_values_are_found_by_searching_and_by_firing(
    searches: list[int],
) -> None:
    values = np.random.default_rng(1).normal(2.0, 3.0, size=(4, 5000))
    values[:, ::11] = np.rint(values[:, ::11])
    values[0, ::5], values[1, ::7] = np.nan, np.inf
    values[:, 3::13] = 1e9
    assert_fired(grid(5, 4), values)
    assert_fired(grid(3, 4), values)
    assert searches
