"""One decider: can rules reach a level, or beat rivals, on a part of the domain?

Points that are drawn come first, then the method that is complete for the rules:

levels  minimum, axes that share no inputs (`levels`); complete where degrees are lines
boxes   products, curves (`boxes`)
solver  sums of inputs, and what the others leave open (`solver`; z3, if it is there)
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from fuzzytree.auditing.decide.answers import (
    Answer,
    Budget,
    Open,
    Point,
    Proved,
    Question,
)
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.boxes import by_boxes
from fuzzytree.auditing.decide.levels import by_levels

_FEW = 200_000  # steps on boxes, before levels are asked about curves
_LOOKS = 3  # sampled points that are evaluated in fractions


class Decider:
    """A base with what its questions have in common.

    Example:
        >>> from fuzzytree.auditing.decide.domain import Domain, DomainSide
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1)
        >>> box = Domain(tuple(DomainSide(name, -1.0, 1.0) for name in tree.inputs))
        >>> decider = Decider(Base.of(tree, box))
        >>> type(decider.ask(Question((0, 1), level=Fraction(2)), Budget())).__name__
        'Proved'
    """

    def __init__(self, base: Base) -> None:
        self.base = base
        self._exact: dict[int, dict[int, tuple[Fraction, Fraction]]] = {}

    def ask(self, question: Question, budget: Budget) -> Answer:
        """Decide a question.

        Raises:
            OutOfStepsError: If the budget is spent.
        """
        base = self.base
        if base.is_empty:
            return Proved("the domain has no point")
        point = self.sample_answer(question, budget)
        if point is not None:
            return point
        rules = [base.rules[i] for i in question.rules]
        answer: Answer = Open("no method applies")
        is_lattice = all(rule.norm == "minimum" for rule in rules)
        is_settled = is_lattice and base.is_exact
        if not base.is_exact and is_lattice and not base.is_coupled:
            answer = by_boxes(base, question, budget, _FEW)
        if isinstance(answer, Open) and is_lattice:
            answer = by_levels(base, question, None, budget)
        if isinstance(answer, Open) and not base.is_coupled and not is_settled:
            answer = by_boxes(base, question, budget)
        is_product = not is_lattice and base.is_exact  # curves leave it no more to say
        if isinstance(answer, Open) and (base.is_coupled or is_product):
            return self._solve(question, budget, answer)
        return answer

    def _solve(self, question: Question, budget: Budget, last: Open) -> Answer:
        from fuzzytree.auditing.decide.solver import solver_for, without_solver

        solver = solver_for(self.base, budget)
        if solver is None:
            return without_solver(last)
        answer = solver.ask(question, budget)
        return last if isinstance(answer, Open) else answer

    # --- sampled points

    def sample_answer(self, question: Question, budget: Budget) -> Point | None:
        """Return a sampled point that answers a question, if there is one."""
        if "sample_strengths" not in vars(self.base):
            budget.spend(60 * self.base.size)
        strengths = self.base.sample_strengths
        size = strengths.shape[1]
        budget.spend(len(question.rules) * size // 500 + 10)
        if question.level is not None:
            lead = np.full(size, 1.0)
            top = np.full(size, float(question.level))
            if question.reach:
                lead = strengths[[*question.reach]].min(axis=0) - top
        else:
            top = strengths[[*question.reach]].min(axis=0)
            lead = np.where(top > 0.0, top, -1.0)
        for j in question.rivals:
            lead = np.minimum(lead, top - strengths[j])
        weak = lead
        for j in question.weak:
            weak = np.minimum(weak, top - strengths[j])
        for number in np.argsort(-weak, kind="stable")[:_LOOKS].tolist():
            if weak[number] < -1e-9:
                break
            point = self.base.sample(number)
            if self.base.contains(point) and question.holds(
                *self.exact(number, question.rules, budget)
            ):
                return Point(point, "a point that was drawn")
        return None

    def exact(
        self, number: int, rules: Sequence[int], budget: Budget
    ) -> tuple[list[Fraction], list[Fraction]]:
        """Return bounds of strengths at a sampled point; each is worked out once."""
        kept = self._exact.setdefault(number, {})
        more = [i for i in dict.fromkeys(rules) if i not in kept]
        if more:
            budget.spend(20 * sum(len(self.base.rules[i].literals) for i in more))
            low, high = self.base.strengths(self.base.sample(number), more)
            kept.update({i: (low[i], high[i]) for i in more})
        low, high = [Fraction(0)] * self.base.count, [Fraction(0)] * self.base.count
        for i in rules:
            low[i], high[i] = kept[i]
        return low, high


def decide(base: Base, question: Question, budget: Budget | None = None) -> Answer:
    """Decide a single question.

    Raises:
        OutOfStepsError: If the budget is spent.
    """
    return Decider(base).ask(question, budget or Budget())
