"""The native runtimes at their seams: chunks, walks, ties, types, single rows."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Part,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Shape,
    Side,
    Term,
    Variable,
)
from fuzzytree.runtimes import descent, find_runtime
from fuzzytree.runtimes.degrees import DOUBLE, shape_degrees
from fuzzytree.runtimes.descent import AxisSplit, Desk, descend_row, descend_rows
from fuzzytree.runtimes.native import load, load_best_first
from fuzzytree.runtimes.reference import load as load_reference
from fuzzytree.runtimes.rows import axis_lines, plan_axes
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import degree
from fuzzytree.testing import random_tree

SHAPES: list[Shape] = [
    Band(0.0, 1.0),
    Band(0.0, 1.0, -1.0, 3.0),
    Band(high=1.0, right=2.0),
    Band(),
    LR(0.5, Side(1.0, (0.4,)), Side(1.0, (0.4,))),
    LR(0.5, Side(2.0, (0.5, 0.1), 1.5), Side(0.1, (0.5, -0.2, 0.1))),
]


@pytest.mark.parametrize("shape", SHAPES, ids=repr)
def test_the_degrees_of_a_shape_have_the_bits_of_the_reference(shape: Shape) -> None:
    edges = [0.0, 1.0, 0.5, -1.0, 3.0, 1.5, 1e308, -1e308, 5e-324]
    near = [math.nextafter(x, s * math.inf) for x in edges[:6] for s in (-1, 1)]
    values = np.array([*edges, *near, *np.linspace(-4.0, 6.0, 301).tolist()])
    expected = [degree(shape, value) for value in values.tolist()]
    assert shape_degrees(shape, values).tolist() == expected


def random_splits(seed: int, leaves: int) -> list[AxisSplit]:
    """Return splits of two to five intervals, some of which share a target."""
    chance = random.Random(seed)
    drafts: list[list[int]] = []
    count = 0

    def grow(size: int) -> int:
        nonlocal count
        if size == 1:
            count += 1
            return -count
        place = len(drafts)
        drafts.append([])
        width = min(size, chance.choice((2, 2, 3, 5)))
        marks = sorted(chance.sample(range(1, size), width - 1))
        sizes = [b - a for a, b in zip([0, *marks], [*marks, size], strict=True)]
        targets = [grow(part) for part in sizes]
        drafts[place] = [*targets, targets[0]] if chance.random() < 0.4 else targets
        return place

    grow(leaves)
    return [
        AxisSplit(
            chance.randrange(3),
            tuple(sorted(chance.uniform(-2.0, 2.0) for _ in targets[1:])),
            tuple(targets),
        )
        for targets in drafts
    ]


@pytest.mark.parametrize("leaves", [1, 2, 7, 25, 60, 300, 1500])
def test_many_rows_descend_like_each_alone(leaves: int) -> None:
    splits = random_splits(leaves, leaves)
    lines = np.random.default_rng(leaves).normal(size=(3, 2000))
    cuts = [cut for split in splits for cut in split.cuts][:500]
    lines[:, : len(cuts)] = cuts
    plan = descent.plan_descent(splits, DOUBLE)
    out = np.empty(1500, np.int64)
    descend_rows(plan, lines, 100, out, Desk(1500, DOUBLE))
    rows = lines[:, 100:1600].T.tolist()
    assert out.tolist() == [descend_row(splits, row) for row in rows]


def test_a_nest_of_shared_branches_is_planned_in_little_room() -> None:
    # Each node's first branch owns both ends: as a tree, 2**40 places.
    splits = [
        AxisSplit(
            0, (-1.0 / k, 1.0 / k), (k if k < 40 else -1, -k - 1, k if k < 40 else -1)
        )
        for k in range(1, 41)
    ]
    plan = descent.plan_descent(splits, DOUBLE)
    assert len(plan.walk.line) < 200
    assert len(plan.top) < 255
    lines = np.linspace(-2.0, 2.0, 400).reshape(1, -1)
    out = np.empty(400, np.int64)
    descend_rows(plan, lines, 0, out, Desk(400, DOUBLE))
    assert out.tolist() == [descend_row(splits, [x]) for x in lines[0].tolist()]


def test_rows_beyond_a_chunk_are_answered_alike() -> None:
    tree = random_tree(1, leaves=50, inputs=5)
    rules = rules_from_tree(tree, "raw")
    few = np.random.default_rng(0).normal(size=(len(tree.inputs), 700)) * 1e3
    few[0, 17] = math.nan
    many = np.tile(few, 60)
    for model in (tree, rules_from_tree(tree), rules):
        run = load(model)
        expected, result = run(few), run(many)
        assert result.rule.tolist() == expected.rule.tolist() * 60
        assert result.status.tolist() == expected.status.tolist() * 60


@pytest.mark.parametrize("size", [1.0, 1e150, 1e299, 1e300, 1e308, 1.7e308])
def test_a_single_row_has_the_bits_of_many_up_to_overflow(size: float) -> None:
    for seed in range(6):
        tree = random_tree(seed, leaves=20, inputs=4, combinations=0.8)
        values = np.random.default_rng(seed).normal(size=(len(tree.inputs), 300))
        values = np.clip(values, -1.0, 1.0) * size
        values[0, :20] = [math.nan, math.inf, -math.inf, 5e-324, -0.0] * 4
        run = load(tree)
        many = run(values)
        singles = [run(values[:, k : k + 1]) for k in range(300)]
        assert many.rule.tolist() == [one.rule[0] for one in singles]
        assert many.status.tolist() == [one.status[0] for one in singles]


def test_an_overflowing_combination_is_missing() -> None:
    mix = Variable(
        "mix",
        (Term("low", Band(high=0.0)),),
        parts=(Part("a", 1e300), Part("b", -1e300)),
    )
    rule = Rule((Proposition("mix", ("low",)),), "x")
    rules = RuleBase("r", ("x",), (Variable("a"), Variable("b"), mix), (rule,))
    values = np.array([[1.0, 1e10, 1e10], [2.0, 1e10, 1.0]])
    for name in ("native", "best-first"):
        result = find_runtime(name).load(rules)(values)
        assert result.status.tolist() == [0, 3, 3]


def overlapping(conjunction: str) -> RuleBase:
    """Return rules whose strengths are often equal: steps on a coarse grid."""
    chance = random.Random(5)
    level = 2.0
    terms = (
        Term("low", Band(high=0.0)),
        Term("wide", Band(high=1.0, right=level)),
        Term("high", Band(low=0.0)),
        Term("all", Band()),
    )
    variables = tuple(Variable(name, terms) for name in "abc")
    names = [term.name for term in terms]
    rules = tuple(
        Rule(
            tuple(
                Proposition(
                    name,
                    (chance.choice(names),),
                    ("not",) if chance.random() < 0.2 else (),
                )
                for name in "abc"[: chance.randint(0, 3)]
            ),
            chance.choice("xy"),
        )
        for _ in range(25)
    )
    is_product = conjunction == "product"
    semantics = Semantics("product" if is_product else "minimum")
    return RuleBase("ties", ("x", "y"), variables, rules[1:], semantics)


@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_best_first_finds_ties_and_the_first_of_equals(conjunction: str) -> None:
    rules = overlapping(conjunction)
    grid = np.array([-1.0, 0.0, 0.5, 1.0, 1.25, 1.5, 3.0])
    values = np.array(np.meshgrid(grid, grid, grid)).reshape(3, -1)
    result = load_best_first(rules)(values)
    expected = load_reference(rules)(values)
    assert result.rule.tolist() == expected.rule.tolist()
    assert result.status.tolist() == expected.status.tolist()
    assert 1 in result.status


def test_best_first_sees_a_gap_between_plateaus() -> None:
    low = Term("low", Band(high=0.0))
    high = Term("high", Band(low=1.0, left=0.5))
    x = Variable("x", (low, high))
    model = (
        Rule((Proposition("x", ("low",)),), "l"),
        Rule((Proposition("x", ("high",)),), "h"),
    )
    result = load_best_first(RuleBase("gap", ("l", "h"), (x,), model))(
        np.array([[-1.0, 0.25, 0.75, 2.0]])
    )
    assert result.rule.tolist() == [1, 0, 2, 2]
    assert result.status.tolist() == [0, 2, 0, 0]


def test_float32_refuses_a_tree_whose_cuts_become_one() -> None:
    base = random_tree(0, leaves=2, inputs=1, combinations=0.0)
    close = 1.0 + 2.0**-40
    terms = (
        Term("low", Band(high=1.0)),
        Term("medium", Band(1.0, close)),
        Term("high", Band(low=close)),
    )
    first, second = (branch for branch in base.nodes[0].branches[:2])
    node = type(base.nodes[0])(
        "x1",
        (1.0, close),
        (0, 1, 0),
        (
            type(first)(("low", "high"), leaf=1),
            type(second)(("medium",), leaf=2),
        ),
    )
    tree = type(base)(
        "close", base.classes, (Variable("x1", terms),), (node,), base.leaves
    )
    with pytest.raises(LossError) as caught:
        load(tree, "float32")
    assert str(caught.value) == (
        "cannot run close in float32: node 1: cuts 1.0 and 1.0000000000009095 "
        "become one number in float32"
    )


def test_best_first_refuses_a_tree() -> None:
    tree = random_tree(0)
    with pytest.raises(LossError) as caught:
        load_best_first(tree)
    assert str(caught.value) == (
        f"cannot run {tree.name} as best-first: it searches rule bases, and this is "
        "a tree\n  pass rules_from_tree(tree)"
    )


@pytest.mark.parametrize("leaves", [1, 2, 7, 60, 300])
def test_rows_on_cuts_of_combinations_descend_node_by_node_alike(leaves: int) -> None:
    chance = np.random.default_rng(leaves)
    parts = (Part("x", 0.3, 0.1), Part("y", -1.7, 0.7), Part("z", 1.1, -3.0))
    mixed = (Variable("a", parts=parts), Variable("b", parts=parts[1:]))
    axes = plan_axes([*map(Variable, "xyz"), *mixed])
    values = chance.normal(size=(3, 2000))
    lines = axis_lines(axes, values)
    splits = [
        AxisSplit(
            2 + split.line,
            tuple(np.sort(chance.choice(lines[2 + split.line], len(split.cuts)))),
            split.targets,
        )
        for split in random_splits(leaves, leaves)
    ]
    whole, lazy = np.empty((2, 2000), np.int64)
    plan = descent.plan_descent(splits, DOUBLE)
    descend_rows(plan, lines, 0, whole, Desk(2000, DOUBLE))
    descent.descend_nodes(axes, splits, values, lazy)
    assert lazy.tolist() == whole.tolist()


@pytest.mark.parametrize("size", [1.0, 1e6, 1e300, 1.7e308])
@pytest.mark.parametrize("leaves", [40, 300])
def test_missing_and_large_values_change_no_bit_node_by_node(
    size: float, leaves: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    tree = random_tree(leaves, leaves=leaves, inputs=5, combinations=0.9)
    first, *others = tree.variables
    tree = replace(tree, variables=(replace(first, missing=0.25), *others))
    values = np.random.default_rng(leaves).normal(size=(len(tree.inputs), 3000))
    values = np.clip(values, -1.0, 1.0) * size
    values[:2, :40] = [[math.nan, math.inf, -math.inf, 5e-324] * 10] * 2
    values[1, :20] = 0.5
    monkeypatch.setattr(descent, "_FEW_CHAINS", math.inf)
    whole = load(tree)(values)
    monkeypatch.setattr(descent, "_FEW_CHAINS", 0)
    monkeypatch.setattr(descent, "_NODE_COST", 1)
    monkeypatch.delattr(descent, "axis_lines")
    for run in (load(tree), load_best_first(rules_from_tree(tree))):
        result = run(values)
        assert result.rule.tolist() == whole.rule.tolist()
        assert result.status.tolist() == whole.status.tolist()
