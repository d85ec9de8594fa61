"""Compiled C: the search for the winner, and what it says when it cannot run."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from fuzzytree.errors import LossError, MissingExtraError
from fuzzytree.model.rulebase import Points, Proposition, Rule, RuleBase, Term, Variable
from fuzzytree.runtimes.c import load, load_best_first
from fuzzytree.runtimes.table import find_runtime, is_installed, needed_by
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import probe_values, random_tree

needs_compiler = pytest.mark.skipif(
    not is_installed(find_runtime("c")), reason="no C compiler is installed"
)


@pytest.mark.heavy
@needs_compiler
@pytest.mark.parametrize("kind", ["relative", "raw"])
@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_the_search_finds_the_winner_among_many_rules(
    kind: str, conjunction: str
) -> None:
    tree = random_tree(5, leaves=150, inputs=3)
    rules = rules_from_tree(
        tree,
        "relative" if kind == "relative" else "raw",
        conjunction="minimum" if conjunction == "minimum" else "product",
    )
    values = probe_values(rules, 2_000)
    result, expected = load_best_first(rules)(values), load(rules)(values)
    assert result.strengths is None
    assert result.rule.tolist() == expected.rule.tolist()
    assert result.status.tolist() == expected.status.tolist()
    assert len(set(expected.rule.tolist())) > 30


def grid_rules(count: int) -> RuleBase:
    """Return rules for all combinations of triangles on three inputs."""
    terms = tuple(
        Term(f"t{n}", Points((n - 1.0, float(n), n + 1.0), (0.0, 1.0, 0.0)))
        for n in range(count)
    )
    variables = tuple(Variable(name, terms) for name in "abc")
    rules: list[Rule] = []
    for three in itertools.product(range(count), repeat=3):
        pairs = zip("abc", three, strict=True)
        rules.append(Rule(tuple(Proposition(v, (f"t{n}",)) for v, n in pairs), "x"))
    return RuleBase("grid", ("x",), variables, tuple(rules))


@pytest.mark.heavy
@needs_compiler
def test_the_first_of_rules_that_tie_is_found_by_search() -> None:
    rules = grid_rules(5)
    chance = np.random.default_rng(0)
    values = np.round(chance.uniform(-1.0, 5.0, (3, 4_000)) * 4.0) / 4.0
    result, expected = load_best_first(rules)(values), load(rules)(values)
    native = find_runtime("native").load(rules)(values)
    assert np.count_nonzero(native.status == 1) > 100
    for one in (result, expected):
        assert one.rule.tolist() == native.rule.tolist()
        assert one.status.tolist() == native.status.tolist()


@needs_compiler
def test_rows_and_columns_keep_their_order() -> None:
    rules = rules_from_tree(random_tree(6, leaves=9, inputs=4))
    values = probe_values(rules, 300)
    result = load(rules)(values)
    assert result.strengths is not None
    for row in (0, 7, 299):
        one = load(rules)(values[:, row : row + 1])
        assert one.rule[0] == result.rule[row]
        assert one.strengths is not None
        np.testing.assert_array_equal(one.strengths[:, 0], result.strengths[:, row])


def test_a_tree_is_not_searched() -> None:
    with pytest.raises(LossError, match="this is a tree"):
        load_best_first(random_tree(0))


def test_a_missing_compiler_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    runtime = find_runtime("c")
    assert not is_installed(runtime)
    assert needed_by(runtime) == "one of the programs gcc, cc, clang"
    with pytest.raises(MissingExtraError) as caught:
        load(random_tree(17))
    assert str(caught.value) == "the runtime 'c' needs one of gcc, cc, clang"
