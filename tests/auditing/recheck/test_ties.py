"""Ties are found again from the cells, and agree with the engine's."""

from __future__ import annotations

from fractions import Fraction

import pytest

from fuzzytree.auditing.recheck import model_records
from fuzzytree.auditing.recheck.grid import Grid, Line, Ties
from fuzzytree.model.rulebase import Points, Proposition, Rule, RuleBase, Term, Variable
from tests.auditing.engine.bases import random_base
from tests.auditing.recheck.reading import read

UP, DOWN = Points((0.0, 1.0), (0.0, 1.0)), Points((0.0, 1.0), (1.0, 0.0))
TOP = Points((0.0, 0.25, 1.0), (0.0, 1.0, 1.0))


def pairs_of(base: RuleBase) -> dict[tuple[int, int], bool]:
    """Return which pairs of rules of two classes tie in the unit box."""
    found = read(base)
    assert isinstance(found, model_records.Rules)
    line = Line(Fraction(0), Fraction(1))
    lines = dict.fromkeys((v.name for v in found.variables), line)
    grid = Grid(found, lines, [], [Fraction(1)] * len(found.rules))
    ties, count = Ties(grid), len(found.rules)
    return {
        (a, b): ties.tie(
            grid.of[a],
            grid.of[b],
            [grid.of[k] for k in range(count) if k not in (a, b)],
        )
        for a in range(count)
        for b in range(a + 1, count)
        if found.rules[a].then != found.rules[b].then
    }


def rules(*asked: tuple[str, ...]) -> RuleBase:
    """Return rules of a class each, on two inputs."""
    terms = (Term("up", UP), Term("down", DOWN), Term("top", TOP))
    made = tuple(
        Rule(tuple(Proposition(one[0], (one[2:],)) for one in when), f"class {n}")
        for n, when in enumerate(asked)
    )
    variables = (Variable("x", terms), Variable("y", terms))
    return RuleBase("r", tuple(rule.then for rule in made), variables, made)


@pytest.mark.parametrize(
    ("asked", "is_tie"),
    [
        ([("x up",), ("x down",)], False),  # they cross at one value
        ([("x up", "y up"), ("x up", "y down")], True),  # both are x where y is 1/2
        ([("x top",), ("y top",)], True),  # both are 1
        ([("x top",), ("x up",)], False),  # both are 1 at one value only
        ([("x up",), ("y up",)], False),  # equal on a line
    ],
)
def test_rules_tie_where_one_function_or_one_constant_decides(
    asked: list[tuple[str, ...]], is_tie: bool
) -> None:
    assert pairs_of(rules(*asked)) == {(0, 1): is_tie}


def test_rules_that_a_third_one_hides_do_not_tie() -> None:
    hidden = [("x up", "y up"), ("x up", "y down"), ("x top",)]
    assert pairs_of(rules(*hidden))[0, 1] is False


@pytest.mark.heavy
def test_ties_agree_with_the_engine() -> None:
    from fuzzytree.auditing.engine.arrangement import arrange
    from fuzzytree.auditing.engine.domain import Domain, DomainSide
    from fuzzytree.auditing.engine.states import Proved, Witness
    from fuzzytree.auditing.engine.ties import tie

    seen = {True: 0, False: 0}
    for seed in range(12):
        base = random_base(seed, 5, 2, kind="points", odd=0.3, shared=0.7)
        given = arrange(
            base, Domain(tuple(DomainSide(n, 0.0, 1.0) for n in base.inputs))
        )
        for (one, other), is_tie in pairs_of(base).items():
            ours = tie(given, one + 1, other + 1)
            if isinstance(ours, Proved | Witness):
                assert is_tie == isinstance(ours, Witness), (seed, one, other)
                seen[is_tie] += 1
    assert min(seen.values()) > 0
