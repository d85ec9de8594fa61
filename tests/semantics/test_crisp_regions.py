import math

import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree.model.rulebase import Band, Semantics, Shape, Term, Variable
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.semantics.crisp_regions import (
    axis_points,
    cell_count,
    free_axes,
    grid,
    grid_size,
    node_faults,
)
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import degree, descend, evaluate
from fuzzytree.testing import random_tree


@pytest.mark.one_in(6)
@pytest.mark.parametrize("seed", range(12))
def test_relative_rules_equal_the_tree_in_every_cell(seed: int) -> None:
    tree = free_axes(random_tree(seed, leaves=2 + seed % 5, inputs=3))
    rules = rules_from_tree(tree)
    for points in grid(tree):
        for column in points.T.tolist():
            row = dict(zip(tree.inputs, column, strict=True))
            assert descend(tree, row).rule == evaluate(rules, row).rule


def test_the_points_hold_each_cut_and_the_floats_beside_it() -> None:
    tree = random_tree(4, leaves=6, inputs=2, combinations=0.0)
    points = axis_points(tree)
    for node in tree.nodes:
        for cut in node.cuts:
            near = {math.nextafter(cut, -math.inf), cut, math.nextafter(cut, math.inf)}
            assert near <= set(points[node.variable])


def test_there_is_a_point_inside_each_interval() -> None:
    tree = random_tree(4, leaves=9, inputs=2, combinations=0.0)
    for name, points in axis_points(tree).items():
        cuts = sorted({c for n in tree.nodes if n.variable == name for c in n.cuts})
        inside = np.searchsorted(cuts, points, side="left")
        assert set(inside.tolist()) == set(range(len(cuts) + 1))


def test_the_grid_has_as_many_points_as_it_says() -> None:
    tree = random_tree(7, leaves=8, inputs=3)
    assert sum(p.shape[1] for p in grid(tree, chunk=100)) == grid_size(tree)
    assert cell_count(tree) <= grid_size(tree)


def test_free_axes_turn_combinations_into_inputs() -> None:
    tree = random_tree(2, leaves=9, combinations=1.0)
    free = free_axes(tree)
    assert set(free.inputs) == {node.variable for node in tree.nodes}
    assert not any(variable.parts for variable in free.variables)


def test_a_tree_of_one_leaf_is_one_cell() -> None:
    tree = FuzzyTree("t", ("a",), (), (), (Leaf("a"),))
    assert (cell_count(tree), grid_size(tree)) == (1, 1)
    assert [points.shape for points in grid(tree)] == [(0, 1)]


def test_a_node_whose_terms_are_right_has_no_fault() -> None:
    assert not list(node_faults(random_tree(3, leaves=40, inputs=5)))


def test_a_term_that_stays_one_beyond_its_plateau_is_a_fault() -> None:
    # Such a tree cannot be made, so the check is given a node that was tampered with.
    low = Term("low", Band(high=1.0, right=2.0))
    high = Term("high", Band(low=1.0, left=0.0))
    branches = (Branch(("low",), leaf=1), Branch(("high",), leaf=2))
    tree = FuzzyTree(
        "t",
        ("a", "b"),
        (Variable("x", (low, high)),),
        (Node("x", (1.0,), (0, 1), branches),),
        (Leaf("a"), Leaf("b")),
        semantics=Semantics(),
    )
    wide = replace(high, function=Band(low=0.5, left=0.0))
    faulty = _without_checks(tree, (Variable("x", (low, wide)),))
    assert list(node_faults(faulty)) == [
        "node 1: at x = 0.9999999999999999 branch 2 has degree 1.0, "
        "and branch 1 owns the point",
        "node 1: at x = 1.0 branch 2 has degree 1.0, and branch 1 owns the point",
    ]


def test_the_terms_of_a_node_are_looked_at_only_where_they_may_be_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cuts = tuple(map(float, range(1000)))
    ends = (-1.0, *cuts, 1000.0)
    terms = tuple(
        Term(
            f"t{k}",
            Band(
                low=None if k == 0 else ends[k],
                high=None if k == 1000 else ends[k + 1],
                left=None if k == 0 else ends[k] - 0.5,
                right=None if k == 1000 else ends[k + 1] + 0.5,
            ),
        )
        for k in range(1001)
    )
    owners = tuple(k % 2 for k in range(1001))
    names = [tuple(f"t{k}" for k in range(own, 1001, 2)) for own in (0, 1)]
    branches = (Branch(names[0], leaf=1), Branch(names[1], leaf=2))
    tree = FuzzyTree(
        "t",
        ("a", "b"),
        (Variable("x", terms),),
        (Node("x", cuts, owners, branches),),
        (Leaf("a"), Leaf("b")),
    )
    calls: list[float] = []

    def counting(shape: Shape, value: float) -> float:
        calls.append(value)
        return degree(shape, value)

    monkeypatch.setattr("fuzzytree.semantics.crisp_regions.degree", counting)
    assert not list(node_faults(tree))
    assert len(calls) <= 2 * len(axis_points(tree)["x"])


def _without_checks(tree: FuzzyTree, variables: tuple[Variable, ...]) -> FuzzyTree:
    class Unchecked(FuzzyTree, frozen=True):
        def __post_init__(self) -> None:
            pass

    return Unchecked(tree.name, tree.classes, variables, tree.nodes, tree.leaves)
