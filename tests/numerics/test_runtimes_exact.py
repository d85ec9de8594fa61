"""Every runtime, compared with exact arithmetic within what is certified for it."""

import numpy as np
import pytest

from fuzzytree.errors import LossError
from fuzzytree.model.contracts import Runtime
from fuzzytree.model.rulebase import Conjunction, Kind
from fuzzytree.numerics.bounds import open_paths, strength_bounds
from fuzzytree.numerics.oracle import decide, strength_errors
from fuzzytree.runtimes.table import all_runtimes, is_installed
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import probe_values
from fuzzytree.testing import random_tree

RUNTIMES = [runtime for runtime in all_runtimes() if is_installed(runtime)]


@pytest.mark.one_in(8)
@pytest.mark.parametrize(
    "runtime", [r for r in RUNTIMES if "rules" in r.runs], ids=lambda r: r.name
)
@pytest.mark.parametrize("kind", ["relative", "raw"])
@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_no_strength_of_a_runtime_is_farther_off_than_certified(
    runtime: Runtime, kind: Kind, conjunction: Conjunction
) -> None:
    tree = random_tree(21, leaves=5, inputs=3)
    rules = rules_from_tree(tree, kind, conjunction=conjunction)
    try:
        run = runtime.load(rules)
    except LossError as error:
        pytest.skip(str(error))
    values = probe_values(rules, 150)
    found = run(values)
    allowed, _ = strength_bounds(rules, runtime.dtype, values)
    if runtime.bound is not None:
        allowed = np.minimum(allowed + runtime.bound(rules)[0], 1.0)
    exact = decide(rules, values)
    flips = found.rule != exact.rule
    ties = exact.margin <= 2 * allowed
    if found.strengths is not None:
        low, _ = strength_errors(rules, values, found.strengths)
        assert (low <= allowed).all()
    labels = np.array([-1, *(rules.classes.index(rule.then) for rule in rules.rules)])
    assert not ((labels[found.rule] != exact.label) & flips & ~ties).any()


@pytest.mark.parametrize(
    "runtime", [r for r in RUNTIMES if "tree" in r.runs], ids=lambda r: r.name
)
def test_no_path_of_a_runtime_leaves_the_exact_one_but_where_it_is_open(
    runtime: Runtime,
) -> None:
    tree = random_tree(22, leaves=7, inputs=3, combinations=0.5)
    values = probe_values(tree, 150)
    differs = runtime.load(tree)(values).rule != decide(tree, values).rule
    assert not (differs & ~open_paths(tree, runtime.dtype, values)).any()
