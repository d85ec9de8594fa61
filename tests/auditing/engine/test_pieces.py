"""A shape laid out in pieces is the shape of the exact definition."""

import itertools
from fractions import Fraction

import pytest

from fuzzytree.auditing.engine.pieces import piece_at, pieces
from fuzzytree.model.rulebase import Band, Points, RuleBase
from fuzzytree.numerics.exact import exact_degree
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import landmarks
from fuzzytree.testing import random_tree, with_points


def _bases(seed: int) -> list[RuleBase]:
    tree = random_tree(seed)
    made = [rules_from_tree(tree)]
    if tree.sets:
        made.append(rules_from_tree(tree, kind="raw"))
    return [with_points(rules, seed) for rules in made]


@pytest.mark.parametrize("seed", range(6))
def test_pieces_have_the_exact_degrees_at_their_ends_and_between(seed: int) -> None:
    for rules in _bases(seed):
        for term in (term for v in rules.variables for term in v.terms):
            laid = pieces(term.shape)
            assert laid[0].low is None
            assert laid[-1].high is None
            assert all(a.high == b.low for a, b in itertools.pairwise(laid))
            for mark in map(Fraction, landmarks(term.shape)):
                for x in (mark, mark + Fraction(1, 7), mark * Fraction(3, 2)):
                    assert piece_at(laid, x).degree(x) == exact_degree(term.shape, x)


def test_a_step_has_two_degrees() -> None:
    laid = pieces(Points((1.0, 2.0, 2.0, 3.0), (0.0, 1.0, 0.25, 0.0)))
    two = Fraction(2)
    assert piece_at(laid, two).degree(two) == 1
    assert piece_at(laid, two, is_after=True).degree(two) == Fraction(1, 4)


@pytest.mark.parametrize(("start", "end"), [(1.0, 4.0), (-1.0, 4.0), (3.0, -2.0)])
def test_a_flank_of_any_direction_is_laid_out(start: float, end: float) -> None:
    shape = Band(0.0, 1.0, right=end)
    laid = pieces(shape)
    for x in (Fraction(n, 7) for n in range(-40, 60)):
        assert piece_at(laid, x).degree(x) == exact_degree(shape, x)
