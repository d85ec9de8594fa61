"""The program of a tree answers what following its path answers."""

import math

import pytest

from fuzzytree.semantics import (
    descend,
    evaluate_program,
    from_tree,
    probe_values,
    program_of,
    rules_from_tree,
)
from fuzzytree.testing import random_system, random_tree


@pytest.mark.parametrize("seed", range(20))
def test_the_program_of_a_tree_is_its_path(seed: int) -> None:
    tree = random_tree(seed)
    program = from_tree(tree)
    classes = [*tree.classes, None]
    rows = probe_values(tree, 200).T.tolist()
    rows += [[math.nan] * len(tree.inputs), [math.inf] * len(tree.inputs)]
    for values in rows:
        row = dict(zip(tree.inputs, values, strict=True))
        right, actual = descend(tree, row), evaluate_program(program, row)
        assert actual.of("rule") == (right.rule,)
        assert actual.of("status") == (right.status,)
        assert classes[int(actual.of("class")[0])] == right.label


def test_every_kind_of_model_has_a_program() -> None:
    kinds = {}
    for model in (random_tree(1), rules_from_tree(random_tree(1)), random_system(1)):
        program = program_of(model)
        kinds[type(model).__name__] = sorted({one.kind for one in program.results})
    assert kinds == {
        "FuzzyTree": ["class", "rule", "status"],
        "RuleBase": ["class", "rule", "status", "strength"],
        "FuzzySystem": ["activation", "output", "status"],
    }
