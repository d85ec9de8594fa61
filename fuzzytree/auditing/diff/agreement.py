"""Do two models decide alike everywhere? Questions about their rules side by side.

They differ at a point if a rule `i` decides in the old model, a rule `j` of another
class in the new one. Such a pair is excluded

- if the two never fire together, by the cells of the axes;
- if the new model has a rule that is never weaker than `i`, and the old one such a rule
  for `j`, each of another class: then either would have to be stronger than the other;
- where both models always have a rule of strength 1, as trees do, by the level 1 alone;
- if `i` or `j` never decides in its own model, or not where the weaker one of the two
  leads the rules of its model;
- by boxes, on each of which one of the two is beaten; or by z3.

First all comparisons are strict: what is left then are ties of classes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from fuzzytree.auditing.decide import (
    Answer,
    Base,
    Boxes,
    Budget,
    Decider,
    Open,
    OutOfStepsError,
    Point,
    Proved,
    Question,
    search_boxes,
    states,
)
from fuzzytree.auditing.decide.answers import ONE, ZERO
from fuzzytree.auditing.decide.boxes import Factor
from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.decide.rules import Norm
from fuzzytree.auditing.decide.solver import Solver, solver_for
from fuzzytree.model import Band, BoolArray, Points, RuleBase

OF: Final = "the smaller of both margins where the two answer otherwise"
_TIES = "answers differ only where classes tie, and no such row is known"
_QUICK = 400_000  # steps of a question of one level
_LOOSE = 0.2  # of the budget is for ties of classes

Side = Literal[0, 1]


class Prediction(NamedTuple):
    """What a model predicts at a point, exactly."""

    label: str | None  # the class, or None for no class
    rule: int  # the number of the winning rule, 0 if none fires
    is_tie: bool  # whether another rule is as strong
    has_margin: bool  # whether no other class is as strong


class Pair(NamedTuple):
    """A rule of each model, by its position; None is that no rule fires."""

    old: int | None
    new: int | None


class Agreement:
    """Two models side by side.

    Attributes:
        base: The rules of both, the old ones first.
        groups: The positions of the rules of each.

    Example:
        >>> from fuzzytree.model import Rule
        >>> one, two = (RuleBase(x, ("a", "b"), (), (Rule((), x),)) for x in "ab")
        >>> Agreement(one, one, Domain(())).state(Budget()).how
        'of 0 pairs of rules of other classes none decides at one point'
        >>> Agreement(one, two, Domain(())).state(Budget()).claims[1].label
        'b'
    """

    def __init__(
        self, old: RuleBase, new: RuleBase, domain: Domain, *, are_trees: bool = False
    ) -> None:
        self.models, self.are_trees = (old, new), are_trees
        self.base = Base.of_both(old, new, domain)
        self.decider = Decider(self.base)
        norm: Norm = "minimum"  # as far as a strength of 1 goes, the product is it
        ones = (rule._replace(norm=norm) for rule in self.base.rules)
        self.ones = self.decider
        if not self.base.is_lattice:
            self.ones = Decider(Base([*ones], self.base.variables, domain))
        count = len(old.rules)
        self.groups = range(count), range(count, self.base.count)
        self._is_full: bool | None = None
        self._pairs: list[Pair] | None = None
        self._answers: dict[Question, Answer] = {}
        self._lower: dict[tuple[Factor, Factor], bool] = {}

    # --- at a point

    def predictions(
        self, point: Mapping[str, Fraction]
    ) -> tuple[Prediction, Prediction]:
        """Return what both predict at a point."""
        strengths, _ = self.base.strengths(point)
        return self._predict(0, strengths), self._predict(1, strengths)

    def _predict(self, side: Side, strengths: Sequence[Fraction]) -> Prediction:
        group, rules = self.groups[side], self.base.rules
        best = max(strengths[k] for k in group)
        if not best:
            return Prediction(self.models[side].semantics.uncovered, 0, False, True)
        first, *others = (k for k in group if strengths[k] == best)
        label = rules[first].then
        has_margin = all(rules[k].then == label for k in others)
        return Prediction(label, rules[first].number, bool(others), has_margin)

    def labels(self, point: Mapping[str, Fraction]) -> tuple[str | None, ...]:
        """Return the classes that both predict at a point."""
        return tuple(prediction.label for prediction in self.predictions(point))

    def witness(self, point: Mapping[str, Fraction]) -> states.Witness:
        """Return a point as a witness of what both predict there."""
        old, new = self.labels(point)
        claims = (
            states.Claim("decides", of="old", label=old),
            states.Claim("decides", of="new", label=new),
        )
        return states.Witness(states.coordinates(point), claims)

    def difference(self, point: Mapping[str, Fraction]) -> states.Witness | None:
        """Return a point of the domain, or the doubles near it, if predictions differ.

        A tie of classes must be one of doubles, which rows have.
        """
        near = {name: Fraction(float(x)) for name, x in point.items()}
        for tried in (near, point):
            old, new = self.predictions(tried)
            is_clear = tried is near or (old.has_margin and new.has_margin)
            if old.label != new.label and is_clear and self.base.contains(tried):
                return self.witness(tried)
        return None

    # --- everywhere

    def state(self, budget: Budget) -> states.State:
        """Decide whether both predict alike on all of the domain.

        Returns:
            `Proved`: they do. `Witness`: they do not, here. `Bracket`: they can
            differ only where the margin of one of them is at most so large.
        """
        answer: states.Witness | Proved | Open
        for is_strict in (True, False):
            try:
                share = budget.share(1.0 - _LOOSE) if is_strict else budget
                answer = self._all(share, is_strict=is_strict)
            except OutOfStepsError:
                answer = Open("the budget was spent")
            if isinstance(answer, states.Witness):
                return answer
            if isinstance(answer, Open):
                why = answer.why if is_strict else _TIES
                return states.Bracket(OF, 0.0, float(is_strict), why)
        what = "pairs of rules of other classes none decides at one point"
        return states.Proved(f"of {len(self._pairs or ())} {what}")

    def _all(
        self, budget: Budget, *, is_strict: bool
    ) -> states.Witness | Proved | Open:
        """Decide all pairs; ties of classes count unless all comparisons are strict."""
        if self._pairs is None:
            self._pairs = self._pairs_of_classes(budget)
        left: list[Pair] = []
        for pair in self._pairs:
            answer = self._quick(pair, budget, is_strict=is_strict)
            if isinstance(answer, Point):
                witness = self.difference(answer.values)
                if witness is not None:
                    return witness
            if isinstance(answer, Proved):
                continue
            if is_strict:
                left.append(pair)
                continue
            result = self._slow([pair], budget, is_strict=is_strict)
            if not isinstance(result, Proved):
                return result  # one tie is enough
        return self._slow(left, budget, is_strict=is_strict)

    def _pairs_of_classes(self, budget: Budget) -> list[Pair]:
        """Return the pairs of other classes that may decide at one point."""
        if self.base.is_empty:
            return []
        old, new = self.groups
        budget.spend(len(old) * len(new))
        is_full = self._has_full_rules(budget)
        overlaps = self._overlaps(ONE if is_full else ZERO, budget)
        pairs = [Pair(i, j) for i in old for j in new if overlaps[i] >> j & 1]
        if not is_full:
            pairs += [Pair(None, j) for j in new]
            pairs += [Pair(i, None) for i in (*old, None)]
        return [pair for pair in pairs if self._label(0, pair) != self._label(1, pair)]

    def _label(self, side: Side, pair: Pair) -> str | None:
        place = pair[side]
        if place is None:
            return self.models[side].semantics.uncovered
        return self.base.rules[place].then

    @cached_property
    def is_made_of_lines(self) -> bool:
        """Whether no degree is a curve, so that lines are few and exact."""
        every = (literal for rule in self.base.rules for _, literal in rule.literals)
        functions = (function for literal in every for function in literal.functions)
        return all(isinstance(function, Band | Points) for function in functions)

    def _has_full_rules(self, budget: Budget) -> bool:
        """Return whether a rule of strength 1 decides everywhere, in both models."""
        if self._is_full is None:
            queries = (Question(rivals=(*g,), level=ONE) for g in self.groups)
            self._is_full = self.are_trees or (
                self.is_made_of_lines
                and all(isinstance(self._ask(q, budget), Proved) for q in queries)
            )
        return self._is_full

    def _overlaps(self, level: Fraction, budget: Budget) -> list[int]:
        """Return with which rules each may be above 0, or at 1, on a cell of each axis.

        Returns:
            For each rule the others as bits.
        """
        bits = [self.base.every] * self.base.count
        for axis in self.base.axes_in_use if self.is_made_of_lines else ():
            cells = [cell.masks for cell in axis.cells_at(level, budget)]
            masks = {cell.perhaps if level else cell.perhaps_above for cell in cells}
            for place in range(self.base.count):
                own = 0
                for mask in masks:
                    own |= mask if mask >> place & 1 else 0
                bits[place] &= own
        return bits

    # --- one pair

    def rivals(
        self, place: int, *, is_strict: bool
    ) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the rules that must be weaker for one to decide, and not stronger."""
        rules = self.base.rules
        group = self.groups[rules[place].model]
        others = [k for k in group if rules[k].then != rules[place].then]
        if is_strict:
            return (*others,), ()
        before = tuple(k for k in others if k < place)
        return before, tuple(k for k in others if k > place)

    def _quick(self, pair: Pair, budget: Budget, *, is_strict: bool) -> Answer:
        """Decide a pair by questions of one level, if they suffice."""
        if self._is_ruled_out(pair, is_strict=is_strict):
            return Proved("")
        if not (is_strict or self.is_made_of_lines):
            return Open("where curves tie is not looked for")
        rivals = [
            ((), (*group,))
            if place is None
            else self.rivals(place, is_strict=is_strict)
            for place, group in zip(pair, self.groups, strict=True)
        ]
        reach = tuple(place for place in pair if place is not None)
        if self._is_full:
            strict = rivals[0][0] + rivals[1][0]
            return self._ask(Question(reach, strict, level=ONE), budget)
        if not reach:
            every = (*range(self.base.count),)
            return self._ask(Question(weak=every, level=ZERO), budget)
        for place, (strict, weak) in zip(pair, rivals, strict=True):
            question = Question(weak=weak, level=ZERO)
            if place is not None:
                question = Question((place,), strict, weak)
            answer = self._ask(question, budget)
            if isinstance(answer, Proved):
                return answer
        if None in pair:
            return Open("")
        stronger = zip(rivals, self._stronger(*reach), strict=True)
        lower = [of for of, above in stronger if not above]
        if not lower:  # then they tie
            lower = [(rivals[0][0] + rivals[1][0], rivals[0][1] + rivals[1][1])]
        answer = Proved("")
        for strict, weak in lower:
            if isinstance(answer, Proved):
                answer = self._ask(Question(reach, strict, weak), budget)
        return answer

    def _ask(self, question: Question, budget: Budget) -> Answer:
        """Ask the decider, with a small budget: there are many pairs."""
        few = Budget(min(_QUICK, budget.left), budget)
        decider = self.ones if question.level == ONE else self.decider
        if question not in self._answers:
            try:
                self._answers[question] = decider.ask(question, few)
            except OutOfStepsError:
                if budget.is_spent:
                    raise
                self._answers[question] = Open("the budget of a pair was spent")
        return self._answers[question]

    def _is_ruled_out(self, pair: Pair, *, is_strict: bool) -> bool:
        """Return whether each would have to be stronger than the other."""
        i, j = pair
        if i is None or j is None:
            fires, side = (j, 0) if i is None else (i, 1)
            return fires is not None and any(
                self.is_below(fires, k) for k in self.groups[side]
            )
        mine, theirs = self._stronger(i, j)
        is_either = bool(mine and theirs)
        return is_either and (is_strict or min(mine) < i or min(theirs) < j)

    def _stronger(self, i: int, j: int) -> tuple[list[int], list[int]]:
        """Return the rivals of two rules that are never weaker than the other one."""
        rules = self.base.rules
        return (
            [k for k in self._above[j] if rules[k].then != rules[i].then],
            [k for k in self._above[i] if rules[k].then != rules[j].then],
        )

    @cached_property
    def _above(self) -> list[list[int]]:
        """For each rule those of the other model that are never weaker."""
        return [
            [k for k in self.groups[1 - rule.model] if self.is_below(place, k)]
            for place, rule in enumerate(self.base.rules)
        ]

    def is_below(self, place: int, other: int) -> bool:
        """Return whether a rule is nowhere stronger than another one, by its parts."""
        weak, strong = self.base.rules[place], self.base.rules[other]
        norms = weak.norm, strong.norm
        if norms == ("minimum", "product") or weak.factor > strong.factor:
            return False
        left = [*weak.literals]
        for key in strong.literals:
            matches = [own for own in left if self._is_lower(own, key)]
            if not matches:
                return False
            if strong.norm == "product":
                left.remove(key if key in matches else matches[0])
        return True

    def _is_lower(self, low: Factor, high: Factor) -> bool:
        """Return whether a degree is nowhere above another one."""
        if low == high or low[0] != high[0] or not self.is_made_of_lines:
            return low == high
        key = low, high
        if key not in self._lower:
            bounds = self.base.axes[low[0]].bounds
            mine, theirs = bounds[low[1]].upper, bounds[high[1]].lower
            sides = zip(mine[1:], theirs[1:], strict=True)
            self._lower[key] = all(
                a <= b for side in sides for a, b in zip(*side, strict=True)
            )
        return self._lower[key]

    # --- several pairs

    def _slow(
        self, left: Sequence[Pair], budget: Budget, *, is_strict: bool
    ) -> states.Witness | Proved | Open:
        if not left:
            return Proved("")
        if not (is_strict or self.is_made_of_lines):
            return Open("where curves tie is not looked for")
        steps = [self._by_boxes, self._by_solver]
        if self.base.is_lattice and self.is_made_of_lines:
            steps.reverse()
        whys: list[str] = []
        for step in steps:
            result = step(left, budget, is_strict)
            if isinstance(result, Point):
                witness = self.difference(result.values)
                if witness is not None:
                    return witness
                result = Open("classes tie, or no row is known to have the point")
            if isinstance(result, Proved):
                return result
            whys.append(result.why)
        return Open("; ".join(whys))

    def _by_boxes(
        self, pairs: Sequence[Pair], budget: Budget, is_strict: bool
    ) -> Answer:
        base = self.base
        rivals = {
            k: [[*of] for of in self.rivals(k, is_strict=is_strict)]
            for k in {k for pair in pairs for k in pair if k is not None}
        }

        def is_excluded(boxes: Boxes) -> BoolArray:
            every = range(base.count)
            low = np.array([boxes.strength(k, 0) for k in every])
            may: dict[tuple[int, int | None], BoolArray] = {}
            for side, group in enumerate(self.groups):
                may[side, None] = low[[*group]].max(axis=0) <= 0.0
            for k, (strict, weak) in rivals.items():
                high = boxes.strength(k, 1)
                top = low[strict].max(axis=0, initial=0.0)
                may_decide = (high > top) & (high >= low[weak].max(axis=0, initial=0.0))
                may[base.rules[k].model, k] = may_decide
            excluded = np.ones(len(boxes.low), dtype=bool)
            for i, j in pairs:
                excluded &= ~(may[0, i] & may[1, j])
            return excluded

        def accepts(point: dict[str, Fraction]) -> bool:
            return self.difference(point) is not None

        return search_boxes(base.fine, is_excluded, accepts, budget)

    def _by_solver(
        self, pairs: Sequence[Pair], budget: Budget, is_strict: bool
    ) -> Answer:
        """Ask z3 for a point of a pair at a time."""
        solver = solver_for(self.base, budget)
        if solver is None:
            return Open("z3 is not installed, which might decide it")
        open_ = 0
        for pair in pairs:
            answer = self._solve(pair, solver, budget, is_strict=is_strict)
            if isinstance(answer, Point) and (
                self.difference(answer.values) is not None or not is_strict
            ):
                return answer
            open_ += not isinstance(answer, Proved)
        if open_:
            return Open(f"{open_} of {len(pairs)} pairs of rules are open")
        return Proved("")

    def _solve(
        self, pair: Pair, solver: Solver, budget: Budget, *, is_strict: bool
    ) -> Answer:
        """Ask z3 for a point of a pair; rivals join when a point needs them."""
        terms, parts = solver.strengths, [solver.z3.BoolVal(True, solver.context)]
        rest: dict[tuple[int, int, bool], Any] = {}
        for place, group in zip(pair, self.groups, strict=True):
            if place is None:
                parts += [terms[k] <= 0 for k in group]
                continue
            own = terms[place]
            parts.append(own > 0)
            strict, weak = self.rivals(place, is_strict=is_strict)
            rest |= {(place, k, True): own > terms[k] for k in strict}
            rest |= {(place, k, False): own >= terms[k] for k in weak}
        while True:
            formula = solver.z3.And(*parts)
            answer = solver.ask_formula(formula, lambda _: True, budget)
            if not isinstance(answer, Point):
                return answer
            low, high = self.base.strengths(answer.values)
            more = [
                (place, k, is_less)
                for place, k, is_less in rest
                if high[k] > low[place] or (is_less and high[k] == low[place])
            ]
            if not more:
                return answer
            parts.append(rest.pop(max(more, key=lambda key: high[key[1]])))
