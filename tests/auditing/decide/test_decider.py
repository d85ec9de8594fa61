"""The decider against z3 and against grids, on random rule bases."""

from __future__ import annotations

import itertools
import random
from fractions import Fraction

import pytest

from fuzzytree.auditing.decide import (
    Base,
    Budget,
    Decider,
    Open,
    OutOfStepsError,
    Point,
    Proved,
    Question,
)
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.levels import by_levels
from fuzzytree.auditing.decide.solver import Solver
from fuzzytree.model import (
    Band,
    Conjunction,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Term,
    Variable,
)
from fuzzytree.testing import random_tree
from tests.auditing.decide.bases import Kind, random_base

z3 = pytest.importorskip("z3")


def questions(base: Base, seed: int) -> list[Question]:
    """Return questions of every kind about a base."""
    chance = random.Random(seed)
    every = range(base.count)
    result = []
    for i in every:
        others = tuple(j for j in every if base.rules[j].then != base.rules[i].then)
        result.append(Question((i,), others))
        before = tuple(j for j in others if j < i)
        result.append(Question((i,), before, tuple(j for j in others if j > i)))
        result.append(Question((i,)))
    for i, j in itertools.combinations(every, 2):
        result.append(Question((i,), (j,)))
        result.append(Question((i, j), level=Fraction(chance.choice([1, 2, 3]), 4)))
    result.append(Question(weak=tuple(every), level=Fraction(0)))
    result.append(Question(rivals=tuple(every), level=Fraction(1, 5)))
    return result


def strengths_at_points(base: Base, seed: int) -> list[list[Fraction]]:
    """Return exact strengths at points of the domain, knots among them."""
    chance = random.Random(seed)
    result = []
    for _ in range(200):
        point = {}
        for name, axis in base.inputs.items():
            knots = base.axes[name].knots if name in base.axes else ()
            places = [*axis.values, *axis.extra, *knots]
            x = axis.low + (axis.high - axis.low) * Fraction(chance.randint(0, 64), 64)
            if axis.values or (places and chance.random() < 0.6):
                x = chance.choice(places)
            point[name] = x
        low, high = base.strengths(point)
        if base.contains(point) and low == high:
            result.append(low)
    return result


CASES: list[tuple[Kind, Conjunction, int, int]] = [
    ("steps", "minimum", 0, 60),
    ("curves", "minimum", 0, 20),
    ("steps", "product", 0, 20),
    ("categories", "minimum", 0, 20),
    ("steps", "minimum", 2, 10),
]


@pytest.mark.heavy
@pytest.mark.parametrize(("kind", "norm", "sums", "count"), CASES)
def test_no_point_and_no_solver_disagree(
    kind: Kind, norm: Conjunction, sums: int, count: int
) -> None:
    decided = asked = 0
    for seed in range(count):
        base = Base.of(*random_base(seed, kind, norm, sums))
        decider, solver = Decider(base), Solver(base, z3)
        everywhere = strengths_at_points(base, seed)
        for question in questions(base, seed):
            answer = decider.ask(question, Budget())
            asked += 1
            decided += not isinstance(answer, Open)
            if isinstance(answer, Point):
                assert base.contains(answer.values)
                assert question.holds(*base.strengths(answer.values))
            if isinstance(answer, Proved):
                assert not any(question.holds(one, one) for one in everywhere)
            if kind == "curves" or isinstance(answer, Point):
                continue
            fewer = question
            if isinstance(answer, Proved) and answer.rivals:
                fewer = question._replace(
                    rivals=tuple(j for j in question.rivals if j in answer.rivals),
                    weak=tuple(j for j in question.weak if j in answer.rivals),
                )
            other = solver.ask(fewer, Budget())
            assert not isinstance(other, Point), (seed, question, answer, other)
    is_exact = kind != "curves" and norm == "minimum"
    assert decided >= asked * (1 if is_exact else 0.97)


def test_levels_alone_decide_lines() -> None:
    for seed in range(6):
        base = Base.of(*random_base(seed))
        solver = Solver(base, z3)
        for question in questions(base, seed)[::3]:
            answer = by_levels(base, question, None, Budget())
            other = solver.ask(question, Budget())
            assert type(answer) is type(other), (seed, question, answer, other)


def test_a_step_beside_a_slope_lets_a_rule_win() -> None:
    terms = (
        Term("t0", Band(0.8, 2.6)),
        Term("t2", Points((0.2, 1.5, 3.4), (0.0, 1.0, 0.0))),
    )
    texts = [("t2", "b"), ("t0", "a"), ("t0", "c"), ("not t0", "b"), ("t0", "c")]
    rules = tuple(
        Rule((Proposition("x0", (text[-2:],), ("not",) if " " in text else ()),), then)
        for text, then in texts
    )
    model = RuleBase("step", ("a", "b", "c"), (Variable("x0", terms),), rules)
    base = Base.of(model, Domain((DomainSide("x0", 0.0, 4.0),)))
    answer = by_levels(base, Question((0,), (1, 2, 4)), None, Budget())
    assert isinstance(answer, Point)
    assert answer.values["x0"] <= Fraction(0.8)


def test_no_gap_lies_between_categories() -> None:
    terms = tuple(
        Term(f"t{n}", Points((n - 0.4, n, n + 0.4), (0, 1, 0))) for n in (0, 1)
    )
    variable = Variable("colour", terms, categories=("blue", "red"))
    rules = tuple(Rule((Proposition("colour", (t.name,)),), "a") for t in terms)
    model = RuleBase("two", ("a",), (variable,), rules)
    side = DomainSide("colour", 0.0, 1.0, values=(0.0, 1.0))
    gap = Question(weak=(0, 1), level=Fraction(0))
    assert isinstance(
        Decider(Base.of(model, Domain((side,)))).ask(gap, Budget()), Proved
    )
    numbers = Domain((DomainSide("colour", 0.0, 1.0),))
    assert isinstance(Decider(Base.of(model, numbers)).ask(gap, Budget()), Point)


def test_a_smaller_budget_ends_the_same_way_each_time() -> None:
    ends = set()
    for _ in range(2):
        base = Base.of(*random_base(3))
        budget = Budget(3_000)
        answers: list[str] = []
        try:
            for question in questions(base, 3):
                answers.append(type(Decider(base).ask(question, budget)).__name__)
        except OutOfStepsError:
            answers.append("out of steps")
        ends.add((*answers, budget.left))
    assert len(ends) == 1
    assert "out of steps" in ends.pop()


def test_a_question_whose_budget_ends_leaves_no_facts_behind() -> None:
    solver = Solver(Base.of(*random_base(2, sums=1)), z3)
    with pytest.raises(OutOfStepsError):
        solver.ask(Question((2, 3), level=Fraction(9, 10)), Budget(50))
    answer = solver.ask(Question((2, 3), level=Fraction(7, 10)), Budget())
    assert isinstance(answer, Point)


def test_trees_with_sums_are_decided() -> None:
    for seed in range(4):
        tree = random_tree(seed)
        sides = tuple(DomainSide(name, -3.0, 3.0) for name in tree.inputs)
        base = Base.of(tree, Domain(sides))
        decider = Decider(base)
        for i in range(base.count):
            others = tuple(
                j for j in range(base.count) if base.rules[j].then != base.rules[i].then
            )
            answer = decider.ask(Question((i,), others), Budget())
            assert not (base.is_exact and isinstance(answer, Open)), (seed, i)
