"""The regions of a tree's leaves are exact, and part the domain."""

import random
from fractions import Fraction

import pytest

from fuzzytree.auditing.decide.domain import Domain, DomainSide, contains
from fuzzytree.auditing.decide.regions import (
    boxes,
    common,
    cut_side,
    leaf_at,
    point_in,
    regions,
)
from fuzzytree.model.tree import FuzzyTree, Node
from fuzzytree.testing import random_tree


def _wide(tree: FuzzyTree, reach: float) -> Domain:
    return Domain(tuple(DomainSide(name, -reach, reach) for name in tree.inputs))


def _points(tree: FuzzyTree, domain: Domain, seed: int) -> list[dict[str, Fraction]]:
    """Return points within a domain, many of them just at a cut."""
    draw = random.Random(seed)
    cuts: dict[str, list[float]] = {}
    for node in tree.nodes:
        cuts.setdefault(node.variable, []).extend(node.cuts)
    found = []
    for _ in range(60):
        point = {}
        for name in tree.inputs:
            side = domain.side(name)
            assert side is not None
            near = [cut for cut in cuts.get(name, []) if side.low <= cut <= side.high]
            if near and draw.random() < 0.4:
                point[name] = Fraction(draw.choice(near))
            else:
                point[name] = Fraction(draw.uniform(side.low, side.high))
        found.append(point)
    return found


@pytest.mark.parametrize("seed", range(8))
def test_every_point_lies_in_the_region_of_its_leaf_and_in_no_other(seed: int) -> None:
    tree = random_tree(seed, combinations=0.4)
    domain = _wide(tree, 10.0 ** (seed - 2))
    made = {region.leaf: [*boxes(region, tree, domain)] for region in regions(tree)}
    for point in _points(tree, domain, seed):
        inside = [
            leaf
            for leaf, parts in made.items()
            if any(contains(box, tree.variables, point) for box in parts)
        ]
        assert inside == [leaf_at(tree, point)]


@pytest.mark.parametrize("seed", range(8))
def test_a_point_of_a_box_reaches_its_leaf(seed: int) -> None:
    tree = random_tree(seed, combinations=0.4)
    domain = _wide(tree, 10.0)
    reached = 0
    for region in regions(tree):
        for box in boxes(region, tree, domain):
            point = point_in(box, tree)
            if point is not None:
                reached += 1
                assert leaf_at(tree, point) == region.leaf
                assert contains(box, tree.variables, point)
    assert reached


def test_a_box_that_its_combination_cannot_meet_has_no_point() -> None:
    tree = random_tree(0, combinations=1.0)
    inputs = _wide(tree, 1e-9)  # so near to 0 the combination hardly varies
    far = DomainSide(tree.nodes[0].variable, 1e6, 2e6)
    assert point_in(inputs, tree) is not None
    assert point_in(Domain((*inputs.sides, far)), tree) is None


def test_a_branch_that_owns_two_intervals_makes_two_boxes() -> None:
    tree = next(
        tree
        for tree in map(random_tree, range(50))
        if any(_owns_twice(node) for node in tree.nodes[:1])
    )
    first = regions(tree)[0]
    variable = tree.nodes[0].variable
    assert len(dict(first.sides)[variable]) == 2


def _owns_twice(node: Node) -> bool:
    return node.owners.count(node.owners[0]) == 2 and not node.branches[0].node


def test_intervals_are_open_below_and_closed_above() -> None:
    side = DomainSide("x", 0.0, 2.0)
    assert cut_side(side, (None, 0.0)) == DomainSide("x", 0.0, 0.0)
    assert cut_side(side, (0.0, 1.0)) == DomainSide("x", 0.0, 1.0, is_open=True)
    assert cut_side(side, (2.0, None)) is None
    assert cut_side(DomainSide("x", 0.0, 2.0, is_open=True), (None, 0.0)) is None


def test_what_two_unions_have_in_common_has_no_empty_interval() -> None:
    assert common(((0.0, 1.0),), ((1.0, 2.0),)) == ()
    assert common(((None, 1.0), (3.0, None)), ((0.0, 4.0),)) == ((0.0, 1.0), (3.0, 4.0))
