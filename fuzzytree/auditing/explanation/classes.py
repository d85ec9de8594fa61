"""Why a tree or a rule base decides for a class, and what would change it."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import cast

import msgspec
from msgspec.structs import replace

from fuzzytree.auditing.decide.answers import Budget
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.costs import LEAST, NARROW, Costs
from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.decide.nearest import nearest
from fuzzytree.auditing.decide.polytopes import Leaves
from fuzzytree.auditing.decide.states import number_text
from fuzzytree.auditing.explanation.records import (
    Explanation,
    Move,
    Reason,
    RowChange,
    RunnerUp,
)
from fuzzytree.auditing.findings.domains import Words
from fuzzytree.auditing.findings.leaves import too_many_boxes
from fuzzytree.model import (
    DATE_UNIT,
    FuzzyTree,
    Model,
    Proposition,
    Rule,
    Variable,
    proposition_text,
    shapes_of,
)
from fuzzytree.semantics import (
    Answer,
    answer_of,
    axis_values,
    evaluate,
    filled_row,
    landmarks_of,
    proposition_degree,
    row_probabilities,
    rules_of,
)

_NEAR = 2.0**-30  # of a variable's landmarks: beside one of them
_BEYOND = (0.0, *(2.0**power for power in range(-50, -8, 3)))  # a point, in shares

Row = Mapping[str, float]


def value_text(words: Words, variable: Variable, value: float) -> str:
    """Return a value of a variable as a table has it: in words, or with six digits."""
    is_plain = variable.unit != DATE_UNIT and not value.is_integer()
    word = "" if is_plain else words.value(variable.name, Fraction(value))
    return word or number_text(value)


class ClassDecision:
    """How a model, a tree or a rule base, decides at a row for a class.

    `blank` has what is known of the row already.
    """

    def __init__(
        self, model: Model, row: Row, domain: Domain, blank: Explanation
    ) -> None:
        self.model, self.domain, self.blank = model, domain, blank
        self.rules, self.words = rules_of(model), Words(domain, model.variables)
        self.fired = evaluate(self.rules, row)
        self.axes = axis_values(model.variables, row)
        self.row = filled_row(model.variables, row)
        self.variables = {variable.name: variable for variable in model.variables}
        self.shapes = shapes_of(self.rules.variables)

    def explanation(
        self, fixed: Collection[str], costs: Mapping[str, Fraction], budget: Budget
    ) -> Explanation:
        """Return why the class is decided, and what would change it."""
        result, classes = self.blank, self.model.classes
        if result.status == "missing":
            gone = [name for name, x in self.axes.items() if not math.isfinite(x)]
            why = f"nothing stands for a missing {', '.join(gone)}"
            return replace(result, change=RowChange("OPEN", why=why))
        strengths = dict.fromkeys(classes, 0.0)
        for label, strength in zip(
            self.rules.rule_labels, self.fired.strengths, strict=True
        ):
            strengths[label] = max(strengths[label], strength)
        result = replace(result, strengths=strengths)
        if result.rule:
            rule = self.rules.rules[result.rule - 1]
            counts = dict(zip(classes, rule.counts, strict=False))
            because = tuple(self._reasons(rule))
            result = replace(result, because=because, counts=counts)
            if self.rules.semantics.sharpness is not msgspec.UNSET:
                shares = row_probabilities(self.rules, self.fired)
                result = replace(
                    result, probabilities=dict(zip(classes, shares, strict=True))
                )
        change = alone = None
        if result.wanted is None or result.wanted != result.label:
            change, alone = self._changes(fixed, costs, budget)
        runner_up = self._runner_up(change)
        return replace(result, runner_up=runner_up, change=change, alone=alone)

    # --- the rules

    def _runner_up(self, change: RowChange | None) -> RunnerUp | None:
        """Return the strongest rule of another class, or what a change leads to."""
        own, strengths = self.blank.label, self.fired.strengths
        rivals = [k for k, label in enumerate(self.rules.rule_labels) if label != own]
        place = max(rivals, key=lambda k: (strengths[k], -k), default=-1)
        if not strengths[place]:
            place = -1 if change is None else self._answer(change.moves).rule - 1
        if place < 0:
            return None
        rule = self.rules.rules[place]
        worst = min(self._reasons(rule), key=lambda one: one.degree, default=None)
        return RunnerUp(place + 1, rule.then, worst)

    def _reasons(self, rule: Rule) -> Iterator[Reason]:
        """Yield what a rule says of each variable, in its order."""
        for name in dict.fromkeys(part.variable for part in rule.when):
            parts = [part for part in rule.when if part.variable == name]
            yield self._reason(self.variables[name], parts)

    def _reason(self, variable: Variable, parts: Sequence[Proposition]) -> Reason:
        """Return what propositions say of one variable, without what others imply."""
        value, marks = self.axes[variable.name], self._marks(parts)
        middles = [a / 2.0 + b / 2.0 for a, b in pairwise(marks)]
        values = [marks[0] - 1.0, *marks, *middles, marks[-1] + 1.0] if marks else []
        for part in parts:
            others = [other for other in parts if other is not part]
            region = [x for x in values if others and self._degree(others, x) == 1.0]
            if region and all(self._degree([part], x) == 1.0 for x in region):
                parts = others
        step = max(map(abs, marks), default=0.0) * _NEAR or _NEAR
        edges = [
            mark
            for mark in marks
            if (self._degree(parts, mark - step) == 1.0)
            != (self._degree(parts, mark + step) == 1.0)
        ]
        cut = min(edges, key=lambda edge: abs(edge - value), default=None)
        if variable.categories:
            cut = None
        adds: dict[str, float] = {}
        for of in variable.parts:
            amount = of.weight * (self.row[of.input] - of.centre)
            adds[of.input] = adds.get(of.input, 0.0) + amount
        return Reason(
            " and ".join(dict.fromkeys(map(proposition_text, parts))),
            value,
            value_text(self.words, variable, value),
            self._degree(parts, value),
            cut,
            "" if cut is None else value_text(self.words, variable, cut),
            "days" if variable.unit == DATE_UNIT else variable.unit,
            dict(sorted(adds.items(), key=lambda pair: -abs(pair[1]))),
        )

    def _marks(self, parts: Sequence[Proposition]) -> list[float]:
        """Return where the degrees of propositions may change their formula."""
        shapes = [self.shapes[p.variable, term] for p in parts for term in p.terms]
        return sorted({mark for shape in shapes for mark in landmarks_of(shape)})

    def _degree(self, parts: Sequence[Proposition], value: float) -> float:
        return min(proposition_degree(part, self.shapes, value) for part in parts)

    # --- the smallest change

    def _changes(
        self, fixed: Collection[str], costs: Mapping[str, Fraction], budget: Budget
    ) -> tuple[RowChange, RowChange | None]:
        """Return the smallest change, and that of one input if it is another one."""
        base: Base | Leaves
        tree = cast("FuzzyTree", self.model)  # if it has leaves
        if tree.leaves and too_many_boxes(tree) is None:
            base = Leaves(tree, self.domain)
        else:
            base = Base.of(self.rules, self.domain)
        inputs = self.model.inputs
        change = self._change(
            base, Costs(self.domain, inputs, fixed, costs), costs, budget.share(0.5)
        )
        if len(change.moves) < 2:
            return change, None
        every = [
            self._change(
                base,
                Costs(self.domain, inputs, {*inputs} - {name}, costs),
                costs,
                budget.share(0.25),
            )
            for name in inputs
            if name not in fixed
        ]
        if all(one.verdict == "NONE" for one in every):
            return change, every[0]
        known = [one for one in every if one.moves]
        return change, min(known, key=lambda one: one.cost, default=None)

    def _change(
        self,
        base: Base | Leaves,
        costs: Costs,
        rates: Mapping[str, Fraction],
        budget: Budget,
    ) -> RowChange:
        """Return the smallest change of the inputs that are not fixed."""
        old = _exact(self.row)
        near = nearest(base, old, self.blank.wanted, costs.fixed, rates, budget)
        if near.point is None and near.is_none:
            return RowChange("NONE")
        row = None if near.point is None else self._confirmed(near.point, costs)
        if row is None:
            why = near.why or "the row lies within rounding of a cut"
            return RowChange("OPEN", low=float(near.low), why=why)
        new = _exact(row)
        cost = costs.distance(old, new)
        is_proved = cost - near.low <= max(5 * NARROW * cost, 2 * LEAST)
        moves = [
            self._move(name, x, float(costs.of(name, old[name], new[name])))
            for name, x in row.items()
            if x != self.row[name]
        ]
        moves.sort(key=lambda move: -round(move.cost / float(cost), 2))
        return RowChange(
            "PROVED" if is_proved else "BOUNDED",
            self._answer(moves).label,
            tuple(moves),
            float(cost),
            float(min(near.low, cost)),
            "" if is_proved else near.why or "the search found no nearer row",
        )

    def _move(self, name: str, new: float, cost: float) -> Move:
        old = self.row[name]
        texts = [f"{old:.{digits}g}" for digits in range(6, 18)]
        close = [text for text in texts if abs(float(text) - old) * 99 < abs(new - old)]
        words = [self.words.value(name, Fraction(x)) for x in (old, new)]
        last = words[1] or repr(new).removesuffix(".0")
        return Move(name, words[0] or close[0], last, new, cost)

    def _confirmed(
        self, point: Mapping[str, Fraction], costs: Costs
    ) -> dict[str, float] | None:
        """Return a row at a point, of few digits, that `run` decides as is sought."""
        moved = [name for name, x in point.items() if x != Fraction(self.row[name])]
        for beyond in _BEYOND:
            row = dict(self.row)
            for name in moved:
                row[name] = self._beyond(name, point[name], costs, beyond)
            if self._is_sought(row):
                break
        else:
            return None
        most = costs.distance(_exact(self.row), _exact(row)) * (1 + NARROW)
        for name in moved:
            old, x = self.row[name], row[name]
            for value in (old, *(float(f"{x:.{digits}g}") for digits in range(1, 17))):
                is_near = costs.of(name, Fraction(old), Fraction(value)) <= most
                is_value = value == old or costs.sides[name].has(Fraction(value))
                if is_near and is_value and self._is_sought({**row, name: value}):
                    row[name] = value
                    break
        return row

    def _beyond(self, name: str, new: Fraction, costs: Costs, beyond: float) -> float:
        """Return a value of an input, a little farther than it has to be."""
        side, old = costs.sides[name], Fraction(self.row[name])
        if side.values or side.is_whole or side.missing in (old, new):
            return float(new)
        far = new + (new - old) * Fraction(beyond)
        return float(min(max(far, Fraction(side.low)), Fraction(side.high)))

    def _is_sought(self, row: Row) -> bool:
        label, wanted = answer_of(self.model, row).label, self.blank.wanted
        return label != self.blank.label if wanted is None else label == wanted

    def _answer(self, moves: Sequence[Move]) -> Answer:
        return answer_of(
            self.model, {**self.row, **{move.input: move.value for move in moves}}
        )


def _exact(row: Row) -> dict[str, Fraction]:
    return {name: Fraction(value) for name, value in row.items()}
