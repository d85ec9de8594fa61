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
from fuzzytree.auditing.decide import Literal as Degree
from fuzzytree.auditing.decide.answers import ONE, ZERO
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
        self._below: dict[tuple[str, Degree, Degree], bool] = {}
        self._full: bool | None = None
        self._answers: dict[Question, Answer] = {}
        self._above: dict[int, list[int]] = {}
        self._rivals: dict[tuple[int, bool], tuple[tuple[int, ...], tuple[int, ...]]]
        self._rivals = {}

    # --- at a point

    def predictions(
        self, point: Mapping[str, Fraction]
    ) -> tuple[Prediction, Prediction]:
        """Return what both predict at a point."""
        strengths, _ = self.base.strengths(point)
        return self._predicted(0, strengths), self._predicted(1, strengths)

    def _predicted(self, side: Side, strengths: Sequence[Fraction]) -> Prediction:
        group, rules = self.groups[side], self.base.rules
        best = max(strengths[k] for k in group)
        if not best:
            return Prediction(self.models[side].semantics.uncovered, 0, False, True)
        first, *others = (k for k in group if strengths[k] == best)
        label = rules[first].then
        has_margin = all(rules[k].then == label for k in others)
        return Prediction(label, rules[first].number, bool(others), has_margin)

    def witness(self, point: Mapping[str, Fraction]) -> states.Witness | None:
        """Return a point as a witness that both predict otherwise there, if so."""
        one, other = self.predictions(point)
        if one.label == other.label:
            return None
        return states.Witness(
            states.coordinates(point),
            (
                states.Claim("decides", of="old", label=one.label),
                states.Claim("decides", of="new", label=other.label),
            ),
        )

    def difference(self, point: Mapping[str, Fraction]) -> states.Witness | None:
        """Return a point of the domain as such a witness, or the doubles near it.

        A tie of classes must be one of doubles, which rows have.
        """
        near = {name: Fraction(float(x)) for name, x in point.items()}
        for tried in (near, point):
            is_clear = all(one.has_margin for one in self.predictions(tried))
            if (tried is near or is_clear) and self.base.contains(tried):
                witness = self.witness(tried)
                if witness is not None:
                    return witness
        return None

    # --- everywhere

    def state(self, budget: Budget) -> states.State:
        """Decide whether both predict alike on all of the domain.

        Returns:
            `Proved`: they do. `Witness`: they do not, here. `Bracket`: they can
            differ only where the margin of one of them is at most so large.
        """
        try:
            pairs = self._pairs(budget)
            answer = self._all(pairs, budget.share(1.0 - _LOOSE), is_strict=True)
        except OutOfStepsError:
            return states.Bracket(OF, 0.0, 1.0, "the budget was spent")
        if isinstance(answer, states.Witness):
            return answer
        if isinstance(answer, Open):
            return states.Bracket(OF, 0.0, 1.0, answer.why)
        try:
            answer = self._all(pairs, budget, is_strict=False)
        except OutOfStepsError:
            answer = Open("")
        if isinstance(answer, states.Witness):
            return answer
        if not isinstance(answer, Proved):
            return states.Bracket(OF, 0.0, 0.0, _TIES)
        what = "pairs of rules of other classes none decides at one point"
        return states.Proved(f"of {len(pairs)} {what}")

    def _pairs(self, budget: Budget) -> list[Pair]:
        """Return the pairs of other classes that may decide at one point."""
        if self.base.is_empty:
            return []
        old, new = self.groups
        budget.spend(len(old) * len(new))
        meeting = self._meeting(ONE if self._is_full(budget) else ZERO, budget)
        pairs = [Pair(i, j) for i in old for j in new if meeting[i] >> j & 1]
        if not self._is_full(budget):
            pairs += [Pair(None, j) for j in new]
            pairs += [Pair(i, None) for i in (*old, None)]
        return [one for one in pairs if self._label(0, one) != self._label(1, one)]

    def _label(self, side: Side, pair: Pair) -> str | None:
        place = pair[side]
        if place is None:
            return self.models[side].semantics.uncovered
        return self.base.rules[place].then

    @cached_property
    def is_made_of_lines(self) -> bool:
        """Whether no degree is a curve, so that lines are few and exact."""
        every = (one for rule in self.base.rules for _, one in rule.literals)
        return all(isinstance(f, Band | Points) for one in every for f in one.functions)

    def _is_full(self, budget: Budget) -> bool:
        """Return whether a rule of strength 1 decides everywhere, in both models."""
        if self._full is None:
            queries = (Question(rivals=(*g,), level=ONE) for g in self.groups)
            self._full = self.are_trees or (
                self.is_made_of_lines
                and all(isinstance(self._ask(q, budget), Proved) for q in queries)
            )
        return self._full

    def _meeting(self, level: Fraction, budget: Budget) -> list[int]:
        """Return with which rules each may be above 0, or at 1, on a cell of each axis.

        Returns:
            For each rule the others as bits.
        """
        bits = [self.base.every] * self.base.count
        for axis in self.base.used if self.is_made_of_lines else ():
            cells = [cell.masks for cell in axis.cells_at(level, budget)]
            masks = {one.perhaps if level else one.perhaps_above for one in cells}
            for place in range(self.base.count):
                own = 0
                for mask in masks:
                    own |= mask if mask >> place & 1 else 0
                bits[place] &= own
        return bits

    def _all(
        self, pairs: Sequence[Pair], budget: Budget, *, is_strict: bool
    ) -> states.Witness | Proved | Open:
        """Decide all pairs; ties of classes count unless all comparisons are strict."""
        left: list[Pair] = []
        for pair in pairs:
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
            if not self.is_made_of_lines:
                return Open("where curves tie is not looked for")
            result = self._slow([pair], budget, is_strict=is_strict)
            if not isinstance(result, Proved):
                return result  # one tie is enough
        return self._slow(left, budget, is_strict=is_strict)

    def _slow(
        self, left: Sequence[Pair], budget: Budget, *, is_strict: bool
    ) -> states.Witness | Proved | Open:
        if not left:
            return Proved("")
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

    # --- one pair

    def rivals(
        self, place: int, *, is_strict: bool
    ) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the rules that must be weaker for one to decide, and not stronger."""
        key = place, is_strict
        if key not in self._rivals:
            rules = self.base.rules
            group = self.groups[rules[place].model]
            others = [k for k in group if rules[k].then != rules[place].then]
            before = tuple(k for k in others if is_strict or k < place)
            after = tuple(k for k in others if not is_strict and k > place)
            self._rivals[key] = before, after
        return self._rivals[key]

    def _quick(self, pair: Pair, budget: Budget, *, is_strict: bool) -> Answer:
        """Decide a pair by questions of one level, if they suffice."""
        i, j = pair
        if i is not None and j is not None and self._is_full(budget):
            strict = self.rivals(i, is_strict=is_strict)[0]
            strict += self.rivals(j, is_strict=is_strict)[0]
            return self._ask(Question((i, j), strict, level=ONE), budget)
        if self._is_ruled_out(pair, is_strict=is_strict):
            return Proved("")
        if not (is_strict or self.is_made_of_lines):
            return Open("where curves tie is not looked for")
        if i is None and j is None:
            gap = Question(weak=tuple(range(self.base.count)), level=ZERO)
            return self._ask(gap, budget)
        for side, place in enumerate(pair):
            question = Question(weak=(*self.groups[side],), level=ZERO)
            if place is not None:
                question = Question((place,), *self.rivals(place, is_strict=is_strict))
            answer = self._ask(question, budget)
            if isinstance(answer, Proved):
                return answer
        if i is None or j is None:
            return Open("")
        strict, weak = self.rivals(i, is_strict=is_strict)
        more, others = self.rivals(j, is_strict=is_strict)
        is_first_lower = not self._rules_above(j, i)  # perhaps
        is_second_lower = not self._rules_above(i, j)
        if not (is_first_lower or is_second_lower):  # then they tie
            question = Question((i, j), strict + more, weak + others)
            return self._ask(question, budget)
        answer = Proved("")
        if is_first_lower:
            answer = self._ask(Question((i, j), strict, weak), budget)
        if is_second_lower and isinstance(answer, Proved):
            answer = self._ask(Question((i, j), more, others), budget)
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
        mine, theirs = self._rules_above(j, i), self._rules_above(i, j)
        if is_strict or not (mine and theirs):
            return bool(mine and theirs)
        return min(mine) < i or min(theirs) < j

    def _rules_above(self, place: int, other: int) -> list[int]:
        """Return the rules of another model that are never weaker than a rule.

        They are of the model, but not of the class, of the `other` rule.
        """
        rules = self.base.rules
        if place not in self._above:
            group = self.groups[1 - rules[place].model]
            self._above[place] = [k for k in group if self.is_below(place, k)]
        return [k for k in self._above[place] if rules[k].then != rules[other].then]

    def is_below(self, place: int, other: int) -> bool:
        """Return whether a rule is nowhere stronger than another one, by its parts."""
        one, two = self.base.rules[place], self.base.rules[other]
        if (one.norm, two.norm) == ("minimum", "product") or one.factor > two.factor:
            return False
        left = [*one.literals]
        for key in two.literals:
            name, degree = key
            match = key if key in left else None
            for mine in left if match is None else ():
                if mine[0] == name and self._is_below_degree(name, mine[1], degree):
                    match = mine
            if match is None:
                return False
            if two.norm == "product":
                left.remove(match)
        return True

    def _is_below_degree(self, name: str, one: Degree, other: Degree) -> bool:
        key = name, one, other
        if not self.is_made_of_lines:
            return False
        if key not in self._below:
            bounds = self.base.axes[name].bounds
            mine, theirs = bounds[one].upper, bounds[other].lower
            self._below[key] = all(
                a <= b
                for values, others in zip(mine[1:], theirs[1:], strict=True)
                for a, b in zip(values, others, strict=True)
            )
        return self._below[key]

    # --- several pairs

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
        solver = solver_for(self.base, budget)
        if solver is None:
            return Open("z3 is not installed, which might decide it")
        open_ = 0
        for pair in pairs:
            answer = self._solved(pair, solver, budget, is_strict=is_strict)
            if isinstance(answer, Point):
                if self.difference(answer.values) is not None or not is_strict:
                    return answer
                open_ += 1
            open_ += isinstance(answer, Open)
        if open_:
            return Open(f"{open_} of {len(pairs)} pairs of rules are open")
        return Proved("")

    def _solved(
        self, pair: Pair, solver: Solver, budget: Budget, *, is_strict: bool
    ) -> Answer:
        """Ask z3 for a point of a pair; rivals join when a point needs them."""
        terms, parts = solver.strengths, list[Any]()
        for side, place in enumerate(pair):
            if place is None:
                parts += [terms[k] <= 0 for k in self.groups[side]]
            else:
                parts.append(terms[place] > 0)
        comparisons: set[tuple[int, int]] = set()
        while True:
            formula = solver.z3.And(*parts)
            answer = solver.ask_formula(formula, lambda _: True, budget)
            if not isinstance(answer, Point):
                return answer
            low, high = self.base.strengths(answer.values)
            more: set[tuple[int, int]] = set()
            for place in pair:
                if place is None:
                    continue
                strict, weak = self.rivals(place, is_strict=is_strict)
                stronger = [k for k in strict if high[k] >= low[place]]
                stronger += [k for k in weak if high[k] > low[place]]
                if stronger:
                    more.add((place, max(stronger, key=high.__getitem__)))
            if not more:
                return answer
            if more <= comparisons:
                return Open("lines around a curve are too far apart")
            for place, k in more - comparisons:
                is_before = is_strict or k < place
                mine, theirs = terms[place], terms[k]
                parts.append(mine > theirs if is_before else mine >= theirs)
            comparisons |= more
