import itertools

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fuzzytree.errors import InvalidModelError
from fuzzytree.model.rulebase import Band, Term, Variable
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node, interval_names
from fuzzytree.testing import random_tree

LOW = Term("low", Band(high=1.0, right=2.0))
HIGH = Term("high", Band(low=1.0, left=0.0))
NODE = Node("x", (1.0,), (0, 1), (Branch(("low",), leaf=1), Branch(("high",), leaf=2)))
LEAVES = (Leaf("a"), Leaf("b"))


def tree(node: Node = NODE, leaves: tuple[Leaf, ...] = LEAVES) -> FuzzyTree:
    return FuzzyTree("t", ("a", "b"), (Variable("x", (LOW, HIGH)),), (node,), leaves)


def refused(node: Node, leaves: tuple[Leaf, ...] = LEAVES) -> str:
    with pytest.raises(InvalidModelError) as caught:
        tree(node, leaves)
    return str(caught.value)


def test_a_tree_shows_its_questions_and_answers() -> None:
    assert str(tree()) == "x? (cut at 1)\n  low: a [1]\n  high: b [2]"


def test_cuts_must_increase() -> None:
    node = msgspec.structs.replace(NODE, cuts=(1.0, 1.0), owners=(0, 1, 0))
    assert refused(node) == "node 1: the cuts must be finite and increase"


def test_every_interval_has_an_owner_and_every_branch_an_interval() -> None:
    assert refused(msgspec.structs.replace(NODE, owners=(0, 1, 0))) == (
        "node 1: 1 cuts make 2 intervals, but 3 have an owner"
    )
    assert refused(msgspec.structs.replace(NODE, owners=(0, 0))) == (
        "node 1: a cut lies within one branch\n"
        "node 1: every branch must own an interval"
    )


def test_a_cut_that_is_not_the_edge_of_the_plateaus_is_found() -> None:
    assert refused(msgspec.structs.replace(NODE, cuts=(1.0000000000000002,))) == (
        "node 1: the plateaus of branch 1 are not the intervals that it owns\n"
        "node 1: the plateaus of branch 2 are not the intervals that it owns"
    )


def test_swapped_branches_are_found() -> None:
    swapped = (Branch(("high",), leaf=1), Branch(("low",), leaf=2))
    assert "the plateaus of branch 1" in refused(
        msgspec.structs.replace(NODE, branches=swapped)
    )


def test_leaves_are_numbered_as_a_walk_meets_them() -> None:
    swapped = (Branch(("low",), leaf=2), Branch(("high",), leaf=1))
    assert refused(msgspec.structs.replace(NODE, branches=swapped)) == (
        "leaf 2 stands where leaf 1 should"
    )


def test_a_node_cannot_lead_back_to_itself() -> None:
    loop = (Branch(("low",), node=1), Branch(("high",), leaf=1))
    assert refused(msgspec.structs.replace(NODE, branches=loop)) == (
        "node 1 stands where node 2 should"
    )


def test_a_leaf_that_nothing_reaches_is_found() -> None:
    assert refused(NODE, (*LEAVES, Leaf("a"))) == (
        "the root reaches 1 of 1 nodes and 2 of 3 leaves"
    )


def test_a_branch_leads_to_exactly_one_place() -> None:
    nowhere = (Branch(("low",)), Branch(("high",), leaf=1))
    assert "node 1: a branch leads to one node or to one leaf" in refused(
        msgspec.structs.replace(NODE, branches=nowhere)
    )


def test_an_unknown_class_at_a_leaf_is_found() -> None:
    assert refused(NODE, (Leaf("a"), Leaf("c"))) == "leaf 2: no class 'c'"


def test_a_big_tree_is_made_and_checked_without_recursion_limits() -> None:
    assert len(random_tree(0, leaves=400, inputs=8).leaves) == 400


@given(
    st.lists(
        st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=5, unique=True).map(sorted),
        min_size=2,
        max_size=4,
    )
)
def test_names_of_intervals_tell_different_intervals_apart(
    nodes: list[list[float]],
) -> None:
    named: dict[str, tuple[float | None, float | None]] = {}
    for cuts, names in zip(nodes, interval_names(nodes), strict=True):
        ends = itertools.pairwise([None, *cuts, None])
        for name, interval in zip(names, ends, strict=True):
            assert named.setdefault(name, interval) == interval
