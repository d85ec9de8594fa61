"""The claims about the rules of a base, each as one or a few questions.

Rules are named by their positions in the base, from 0. An answer that is `Proved` says
that there is no point; what that means is said by each claim.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.decide.answers import (
    ONE,
    ZERO,
    Answer,
    Budget,
    Open,
    OutOfStepsError,
    Point,
    Proved,
    Question,
)
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.boxes import Boxes, search_boxes
from fuzzytree.auditing.decide.decider import Decider
from fuzzytree.model import BoolArray, FloatArray

PART = 0.1
"""The share of the steps that are left which a single question may take."""

SPENT = Open("the budget was spent", "FTD03")

_LOOKS = 4  # drawn points that are evaluated in fractions for one claim
_NARROWER = 5  # times that bounds of a lead are halved
_MOST_POINTS = 400  # drawn points that are evaluated in fractions for pairs
_MOST_COMPARED = 200_000_000  # strengths of pairs at drawn points


class Lead(NamedTuple):
    """By how much a rule leads at most: bounds, and a point that shows the lower."""

    low: Fraction
    high: Fraction
    point: Point | None
    is_open: bool = False


class Claims:
    """What is asked of the rules of a base.

    Attributes:
        base: The rules.
        decider: What decides single questions.
        uncovered: The class where no rule fires, if there is one.

    Example:
        >>> from fuzzytree.auditing.decide.domain import Domain, DomainSide
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1)
        >>> box = Domain(tuple(DomainSide(name, -1.0, 1.0) for name in tree.inputs))
        >>> type(Claims(Base.of(tree, box)).fires(0, Budget())).__name__
        'Point'
    """

    def __init__(self, base: Base, uncovered: str | None = None) -> None:
        self.base, self.uncovered = base, uncovered
        self.decider = Decider(base)

    def ask(self, question: Question, budget: Budget) -> Answer:
        """Decide a question within a part of a budget."""
        return within(budget, lambda own: self.decider.ask(question, own))

    def others(self, i: int) -> tuple[int, ...]:
        """Return the rules of other classes."""
        rules = self.base.rules
        return tuple(j for j, rule in enumerate(rules) if rule.then != rules[i].then)

    def same(self, i: int) -> tuple[int, ...]:
        """Return the other rules of its class."""
        rules = self.base.rules
        return tuple(
            j for j, rule in enumerate(rules) if rule.then == rules[i].then and j != i
        )

    # --- one rule

    def fires(self, i: int, budget: Budget) -> Answer:
        """Return whether a rule is somewhere above 0."""
        return self.ask(Question((i,)), budget)

    def wins(self, i: int, budget: Budget) -> Answer:
        """Return whether a rule is somewhere stronger than all of other classes."""
        return self.ask(Question((i,), self.others(i)), budget)

    def decides(self, i: int, budget: Budget) -> Answer:
        """Return whether it wins, or is as strong as rules that stand behind it."""
        rivals = self.others(i)
        before = tuple(j for j in rivals if j < i)
        behind = tuple(j for j in rivals if j > i)
        return self.ask(Question((i,), before, behind), budget)

    def lead(self, i: int, enough: Fraction, budget: Budget) -> Lead:
        """Return how far a rule leads before all of other classes, at most."""
        result = Lead(ZERO, ONE, None)
        rivals = self.others(i)
        drawn = self.base.sample_strengths
        most = drawn[[*rivals]].max(axis=0) if rivals else 0.0
        for number in np.argsort(most - drawn[i], kind="stable")[:_LOOKS].tolist():
            if self.base.contains(self.base.sample(number)):
                result = self._better(i, self.base.sample(number), result)
            if result.low >= enough:
                return result
        by, steps = enough, _NARROWER
        while steps and result.low < enough:
            answer = self.leads(i, by, budget)
            if isinstance(answer, Point):
                result = self._better(i, answer.values, result)
            elif isinstance(answer, Proved):
                result = result._replace(high=by)
            else:
                result = result._replace(is_open=by == enough)
                break
            by, steps = (result.low + result.high) / 2, steps - 1
        return result

    def _better(self, i: int, values: Any, lead: Lead) -> Lead:
        rivals = self.others(i)
        low, high = self.base.strengths(values, (i, *rivals))
        value = low[i] - max((high[j] for j in rivals), default=ZERO)
        is_better = value > lead.low or lead.point is None
        return lead._replace(low=value, point=Point(values)) if is_better else lead

    def leads(self, i: int, by: Fraction, budget: Budget) -> Answer:
        """Return whether a rule is somewhere stronger by so much than other classes."""
        base, rule, rivals = self.base, self.base.rules[i], self.others(i)

        def holds(values: dict[str, Fraction]) -> bool:
            low, high = base.strengths(values, (i, *rivals))
            return low[i] - by >= max((high[j] for j in rivals), default=ZERO)

        if rule.norm == "minimum":
            literals = tuple(
                (name, replace(literal, lowered=literal.lowered + by))
                for name, literal in rule.literals
            )
            lower = rule._replace(literals=literals, factor=rule.factor - by)
            question = Question((base.count,), weak=rivals)
            longer = Decider(base.with_rules([lower]))
            return within(budget, lambda own: longer.ask(question, own))

        def is_excluded(boxes: Boxes) -> BoolArray:
            top = boxes.strength(i, 1) - float(by)
            out: BoolArray = top < -1e-12
            for j in rivals:
                out |= boxes.strength(j, 0) > top + 1e-12
            return out

        def formula(v: Sequence[Any], z3: Any) -> Any:
            number = z3.RealVal(str(by), v[i].ctx)
            return z3.And(v[i] >= number, *(v[i] - number >= v[j] for j in rivals))

        return self._search(is_excluded, formula, (i, *rivals), holds, budget)

    def _search(
        self,
        is_excluded: Callable[[Boxes], BoolArray],
        formula: Callable[[Sequence[Any], Any], Any],
        rules: Sequence[int],
        holds: Callable[[dict[str, Fraction]], bool],
        budget: Budget,
    ) -> Answer:
        """Look for a point on boxes, and then with the solver."""
        base = self.base
        answer: Answer = Open("axes share inputs", "FTD04")
        if not base.is_coupled:
            answer = within(
                budget,
                lambda own: search_boxes(base.fine, is_excluded, holds, own),
            )
        if isinstance(answer, Open):
            return self._solve(formula, rules, holds, budget, answer)
        return answer

    def _solve(
        self,
        formula: Callable[[Sequence[Any], Any], Any],
        rules: Sequence[int],
        holds: Callable[[dict[str, Fraction]], bool],
        budget: Budget,
        last: Open,
    ) -> Answer:
        from fuzzytree.auditing.decide.solver import solver_for, without_solver

        def ask(own: Budget) -> Answer:
            solver = solver_for(self.base, own)
            if solver is None:
                return without_solver(last)
            text = formula(solver.strengths, solver.z3)
            return solver.ask_formula(text, holds, own, rules)

        return within(budget, ask)

    # --- what changes without a rule, or without a proposition

    def matters(self, i: int, budget: Budget) -> Answer:
        """Return whether a decision changes without a rule; `Proved`: none does."""
        return self.changes(i, i, self.same(i), self.others(i), budget)

    def changes(
        self,
        i: int,
        place: int,
        own: Sequence[int],
        rest: Sequence[int],
        budget: Budget,
    ) -> Answer:
        """Return whether a rule decides somewhere, and none of its class would.

        Args:
            i: The rule.
            place: Where it stands among the others.
            own: The other rules of its class.
            rest: The rules of other classes.
            budget: The budget.
        """
        base = self.base
        is_default = base.rules[i].then == self.uncovered
        before = tuple(j for j in rest if j < place)
        behind = tuple(j for j in rest if j > place)
        # As strong as i, such a rule of its class stands behind one of another class.
        level = tuple(k for k in own if any(place < r < k for r in rest))
        strict = tuple(k for k in own if k not in level)

        def holds_at(low: Sequence[Fraction], high: Sequence[Fraction]) -> bool:
            if low == high:
                first = _winner(low, [(i, place), *((j, j) for j in rest)])
                second = _winner(low, [(j, j) for j in (*own, *rest)])
                if second < 0:
                    return first == i and not is_default
                return first == i and second not in own
            least, most = (max((v[j] for j in rest), default=ZERO) for v in (low, high))
            is_below = all(high[k] < least or high[k] <= 0 for k in own)
            return low[i] > most and is_below and (least > 0 or not is_default)

        def holds(values: dict[str, Fraction]) -> bool:
            return holds_at(*base.strengths(values, (i, *own, *rest)))

        drawn = self._change_at_samples(i, own, rest, holds_at, budget)
        if drawn is not None:
            return drawn
        question = Question((i,), (*before, *strict), (*behind, *level))
        answer = self.ask(question, budget)
        if isinstance(answer, Proved | Open):
            return answer
        if holds(dict(answer.values)):
            return answer

        def is_excluded(boxes: Boxes) -> BoolArray:
            none = np.zeros(len(boxes.low))
            top, least = (
                np.max([none, *(boxes.strength(j, side) for j in rest)], axis=0)
                for side in (1, 0)
            )
            out: BoolArray = boxes.strength(i, 1) < least * (1 - 1e-12)
            for k in own:
                out |= (boxes.strength(k, 0) > top) & (boxes.strength(k, 0) > 0)
            return out

        def formula(v: Sequence[Any], z3: Any) -> Any:
            parts = [v[i] > 0, *(v[i] > v[j] for j in before)]
            parts += [v[i] >= v[j] for j in behind]
            for k in own:
                ways = [v[r] >= v[k] if r < k else v[r] > v[k] for r in rest]
                parts.append(z3.Or(v[k] <= 0, *ways))
            if is_default:
                parts.append(z3.Or(*(v[r] > 0 for r in rest)))
            return z3.And(*parts)

        rules = (i, *own, *rest)
        if base.is_lattice and base.is_exact:
            last = Open("no single level decides it")
            return self._solve(formula, rules, holds, budget, last)
        return self._search(is_excluded, formula, rules, holds, budget)

    def _change_at_samples(
        self,
        i: int,
        own: Sequence[int],
        rest: Sequence[int],
        holds: Callable[[Sequence[Fraction], Sequence[Fraction]], bool],
        budget: Budget,
    ) -> Point | None:
        drawn = self.base.sample_strengths
        size = drawn.shape[1]
        most = self._most(rest, size)
        mine = self._most(own, size)
        lead = np.minimum(drawn[i] - most, np.where(mine > 0.0, most - mine, 1.0))
        lead[most <= 0.0] *= 1e-3  # rather one class than another one than none
        lead[drawn[i] <= 0.0] = -1.0
        try:
            budget.spend(len(rest) * size // 500 + 10)
            for number in np.argsort(-lead, kind="stable")[:_LOOKS].tolist():
                if lead[number] < -1e-9:
                    break
                sample = self.base.sample(number)
                rules = (i, *own, *rest)
                if self.base.contains(sample) and holds(
                    *self.decider.exact(number, rules, budget)
                ):
                    return Point(sample, "a point that was drawn")
        except OutOfStepsError:
            return None
        return None

    def _most(self, rules: Sequence[int], size: int) -> FloatArray:
        result: FloatArray = np.zeros(size)
        if rules:
            result = self.base.sample_strengths[[*rules]].max(axis=0)
        return result

    def below(self, level: Fraction, budget: Budget) -> Answer:
        """Return whether all rules are somewhere weaker than a level."""
        every = tuple(range(self.base.count))
        return self.ask(Question((), every, level=level), budget)

    # --- two rules

    def above(self, i: int, j: int, budget: Budget, *, is_tied: bool = False) -> Answer:
        """Return whether a rule is somewhere stronger than another, or as strong."""
        question = Question((i,), weak=(j,)) if is_tied else Question((i,), (j,))
        return self.ask(question, budget)

    def above_at_samples(self, budget: Budget) -> BoolArray:
        """Return of which pairs drawn points show that the first rule is stronger."""
        base, count = self.base, self.base.count
        result = np.zeros((count, count), dtype=bool)
        size = max(_MOST_COMPARED // max(count, 1) ** 2, 64)
        drawn = base.sample_strengths[:, :size]
        first = np.zeros((count, count), dtype=np.int64)
        left = np.zeros((count, count), dtype=bool)
        for i in range(count):
            lead = drawn[i] - drawn
            first[i] = lead.argmax(axis=1)
            left[i] = lead[np.arange(count), first[i]] > 1e-9
        try:
            budget.spend(count * count * drawn.shape[1] // 1000)
            for _ in range(_MOST_POINTS):
                if not left.any():
                    break
                number = int(np.bincount(first[left]).argmax())
                if base.contains(base.sample(number)):
                    least, most = self.decider.exact(number, range(count), budget)
                    low, high = np.array(least, float), np.array(most, float)
                    result |= low[:, None] > high[None, :]
                left &= ~result & (first != number)
        except OutOfStepsError:
            pass
        return result


def within(budget: Budget, work: Callable[[Budget], Answer]) -> Answer:
    """Return what some work with a part of a budget answers, or that it is spent."""
    try:
        return work(budget.share(PART))
    except OutOfStepsError:
        return SPENT


def _winner(strengths: Sequence[Fraction], rules: Sequence[tuple[int, int]]) -> int:
    """Return the first of the strongest rules, -1 if none fires.

    `rules`: each rule, and where it stands.
    """
    best, _ = max(rules, key=lambda at: (strengths[at[0]], -at[1]), default=(-1, 0))
    return best if best >= 0 and strengths[best] > 0 else -1
