import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from fuzzytree.errors import InvalidModelError
from fuzzytree.model.rulebase import Conjunction, Kind, Semantics
from fuzzytree.model.tree import FuzzyTree, Leaf
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import Status, descend, evaluate
from fuzzytree.testing import probes, random_tree


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    leaves=st.integers(1, 12),
    inputs=st.integers(1, 5),
    combinations=st.sampled_from([0.0, 0.5, 1.0]),
    conjunction=st.sampled_from(["minimum", "product"]),
)
def test_relative_rules_equal_the_tree_on_every_probe(
    seed: int, leaves: int, inputs: int, combinations: float, conjunction: Conjunction
) -> None:
    tree = random_tree(seed, leaves=leaves, inputs=inputs, combinations=combinations)
    rules = rules_from_tree(tree, conjunction=conjunction)
    for row in probes(tree, limit=150, seed=seed):
        path, fired = descend(tree, row), evaluate(rules, row)
        assert (fired.rule, fired.label, fired.status) == (
            path.rule,
            path.label,
            path.status,
        )
        if path.status is Status.DECIDED:
            assert fired.strengths[path.rule - 1] == 1.0
            assert fired.strengths.count(1.0) == 1


def test_each_leaf_becomes_the_rule_of_its_number() -> None:
    tree = random_tree(3, leaves=9)
    rules = rules_from_tree(tree, "raw")
    assert [rule.then for rule in rules.rules] == [leaf.label for leaf in tree.leaves]


def test_raw_rules_name_the_patterns_below_each_branch() -> None:
    tree = random_tree(5, leaves=4, combinations=0.0)
    rules = rules_from_tree(tree, "raw")
    last = [rule.when[-1].terms for rule in rules.rules]
    assert last == [(f"pattern {number}",) for number in range(1, 5)]


@pytest.mark.parametrize("kind", ["relative", "raw"])
def test_the_rules_keep_the_answers_of_the_tree(kind: Kind) -> None:
    semantics = Semantics("product", "class 1", "class 2")
    tree = random_tree(1, semantics=semantics)
    assert rules_from_tree(tree, kind).semantics == semantics
    assert (
        rules_from_tree(tree, kind, conjunction="minimum").semantics.conjunction
        == "minimum"
    )


def test_a_tree_of_one_leaf_becomes_one_rule_that_always_holds() -> None:
    tree = FuzzyTree("t", ("a",), (), (), (Leaf("a"),))
    assert str(rules_from_tree(tree, "raw")) == "1. ALWAYS a"


def test_a_tree_without_sets_has_no_raw_rules() -> None:
    tree = random_tree(1)
    nodes = tuple(
        replace(node, branches=tuple(replace(b, sets=()) for b in node.branches))
        for node in tree.nodes
    )
    bare = replace(tree, name="bare", nodes=nodes, sets=())
    with pytest.raises(InvalidModelError) as caught:
        rules_from_tree(bare, "raw")
    assert str(caught.value) == (
        "tree 'bare' carries no fitted sets, so it has no raw rules"
    )
