"""The re-checker's arithmetic and proofs are its own, and agree with ours."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest

from fuzzytree.auditing.engine import states
from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.auditing.recheck import model_records
from fuzzytree.auditing.recheck.grid import Grid, Line, crossings
from fuzzytree.auditing.recheck.meaning import answer_of, strengths
from fuzzytree.auditing.recheck.polynomials import times
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.numerics.exact import MISSING, exact_answer
from fuzzytree.semantics.probing import probes
from tests.auditing.engine.bases import random_base
from tests.auditing.recheck.reading import models, read


def test_its_answers_and_strengths_are_exactly_ours() -> None:
    for model in models(0):
        found = read(model)
        rows = list(probes(model))
        for row in random.Random(0).sample(rows, min(12, len(rows))):
            ours = exact_answer(model, row)
            if ours.status == MISSING:
                continue
            point = {name: Fraction(value) for name, value in row.items()}
            assert answer_of(found, point) == ours.label
            if isinstance(found, model_records.Rules):
                assert tuple(strengths(found, point)) == ours.strengths


def wins_of(base: RuleBase) -> tuple[model_records.Rules, list[bool]]:
    """Return a rule base as read, and which rules win somewhere in the unit box."""
    found = read(base)
    assert isinstance(found, model_records.Rules)
    line = Line(Fraction(0), Fraction(1))
    grid = Grid(
        found,
        dict.fromkeys((v.name for v in found.variables), line),
        [],
        [Fraction(1)] * len(found.rules),
    )
    return found, [
        grid.wins(
            grid.of[number],
            [
                of
                for of, r in zip(grid.of, found.rules, strict=True)
                if r.then != rule.then
            ],
        )
        for number, rule in enumerate(found.rules)
    ]


@pytest.mark.heavy
def test_a_rule_that_wins_at_a_random_point_is_never_called_dead() -> None:
    dead = 0
    for seed in (0, 3):
        base = random_base(seed, 5, 2, kind="mixed", odd=0.3, shared=0.5)
        found, wins = wins_of(base)
        dead += wins.count(False)
        chance = random.Random(seed)
        for _ in range(60):
            point = {name: Fraction(chance.random()) for name in base.inputs}
            every = strengths(found, point)
            best = max(every)
            labels = {
                rule.then
                for rule, one in zip(found.rules, every, strict=True)
                if one == best
            }
            if best > 0 and len(labels) == 1:
                assert all(
                    won for won, one in zip(wins, every, strict=True) if one == best
                )
    assert dead > 0


@pytest.mark.heavy
def test_its_proofs_agree_with_the_engine() -> None:
    from fuzzytree.auditing.engine.arrangement import arrange
    from fuzzytree.auditing.engine.domain import DomainSide
    from fuzzytree.auditing.engine.duels import wins

    for seed in range(16):
        base = random_base(seed, 5, 2, kind="mixed", odd=0.3, shared=0.5)
        given = arrange(
            base, Domain(tuple(DomainSide(n, 0.0, 1.0) for n in base.inputs))
        )
        for number, mine in enumerate(wins_of(base)[1]):
            rule = base.rules[number]
            rivals = [k for k, r in enumerate(base.rules, 1) if r.then != rule.then]
            found = wins(given, number + 1, rivals)
            assert mine == isinstance(found, states.Witness), (seed, number)


def test_roots_are_isolated_and_distinguished() -> None:
    two = (Fraction(-2), Fraction(0), Fraction(1))  # x**2 - 2
    four = times(two, two)
    cubic = times(two, (Fraction(-3, 2), Fraction(1)))
    met = crossings([two, (), four, cubic], Fraction(1, 2), Fraction(9))
    near = [float(root.low + root.high) / 2 for root in met]
    assert near == sorted(set(near))
    zeros = [r for r in met if r.low**2 <= 2 <= r.high**2]
    assert len(zeros) == 1  # one root of three polynomials
