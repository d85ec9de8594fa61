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
from fuzzytree.auditing.decide.costs import LEAST, NARROW, Costs, Nearest
from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.decide.nearest import nearest
from fuzzytree.auditing.decide.polytopes import Leaves
from fuzzytree.auditing.decide.states import number_text
from fuzzytree.auditing.explanation.records import (
    Cell,
    ClassShare,
    Contribution,
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
    Status,
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


def value_text(words: Words, variable: Variable, value: float) -> str:
    """Return a value of a variable as a table has it: in words, or with six digits."""
    is_between = variable.is_whole and not value.is_integer()
    word = "" if is_between else words.value(variable.name, Fraction(value))
    return word or number_text(value)


class ClassDecision:
    """How a model decides for a class at a row of its inputs.

    Args:
        model: A tree or a rule base.
        row: A number for each input; NaN for one that is missing.
        domain: The values that a change may give, and those of the row.
        blank: What all parts of the explanation start from.
    """

    def __init__(
        self,
        model: Model,
        row: Mapping[str, float],
        domain: Domain,
        blank: Explanation,
    ) -> None:
        self.model, self.row, self.domain, self.blank = model, row, domain, blank
        self.rules, self.answer = rules_of(model), answer_of(model, row)
        self.words = Words(domain, model.variables)
        self.axes = axis_values(self.rules.variables, row)
        self.variables = {variable.name: variable for variable in model.variables}
        self.shapes = shapes_of(self.rules.variables)
        self.point = filled_row(model.variables, row)
        self.fired = evaluate(self.rules, row)
        self.strengths = self.fired.strengths
        self.strongest: dict[str, int] = {}  # the position of each class's rule
        for place, (label, strength) in enumerate(
            zip(self.rules.rule_labels, self.strengths, strict=True)
        ):
            best = self.strongest.get(label)
            if best is None or strength > self.strengths[best]:
                self.strongest[label] = place

    def text(self, name: str, value: float) -> str:
        """Return a value of a variable as a table has it."""
        return value_text(self.words, self.variables[name], value)

    def explanation(
        self,
        wanted: str | None,
        fixed: Collection[str],
        costs: Mapping[str, Fraction],
        budget: Budget,
    ) -> Explanation:
        """Return why the class is decided, and what would change it."""
        own, result = self.answer.label, self.blank
        status = Status(self.answer.status)
        result = replace(result, status=status.name.lower(), label=own, wanted=wanted)
        if status == Status.MISSING:
            gone = [name for name, x in self.axes.items() if not math.isfinite(x)]
            why = f"nothing stands for a missing {', '.join(gone)}"
            return replace(result, change=RowChange("OPEN", why=why))
        winner: Rule | None = None
        if self.answer.rule:
            winner = self.rules.rules[self.answer.rule - 1]
        change, alone = self._changes(wanted, fixed, costs, budget)
        return replace(
            result,
            rule=self.answer.rule,
            classes=tuple(self._classes(winner)),
            because=tuple(self.reasons(winner)) if winner else (),
            runner_up=self._runner_up(change),
            change=change,
            alone=alone,
        )

    # --- the rules

    def _classes(self, winner: Rule | None) -> list[ClassShare]:
        """Return the classes, the predicted one first, then the likeliest."""
        labels, shares = self.model.classes, None
        if winner and self.rules.semantics.sharpness is not msgspec.UNSET:
            shares = row_probabilities(self.rules, self.fired)
        result = [
            ClassShare(
                label,
                shares[k] if shares else None,
                self.strengths[self.strongest[label]]
                if label in self.strongest
                else 0.0,
                winner.counts[k] if winner and winner.counts else None,
            )
            for k, label in enumerate(labels)
        ]
        own = self.answer.label
        return sorted(
            result,
            key=lambda one: (one.label != own, -(one.probability or one.strength)),
        )

    def reasons(self, rule: Rule) -> Iterator[Reason]:
        """Yield what a rule says of each variable, in the order of the rule."""
        for name in dict.fromkeys(part.variable for part in rule.when):
            yield self._reason([part for part in rule.when if part.variable == name])

    def _runner_up(self, change: RowChange | None) -> RunnerUp | None:
        """Return the strongest rule of another class, or what a change leads to."""
        rivals = [
            k for label, k in self.strongest.items() if label != self.answer.label
        ]
        place = max(rivals, key=lambda k: (self.strengths[k], -k), default=None)
        if place is not None and not self.strengths[place] and change is not None:
            moved = {move.new.input: move.new.value or 0.0 for move in change.moves}
            place = answer_of(self.model, {**self.point, **moved}).rule - 1
        if place is None or place < 0:
            return None
        rule = self.rules.rules[place]
        worst = min(self.reasons(rule), key=lambda one: one.degree, default=None)
        return RunnerUp(place + 1, rule.then, self.strengths[place], worst)

    def _reason(self, parts: Sequence[Proposition]) -> Reason:
        """Return what propositions say of one variable, as one of them if they can."""
        parts = self._needed(parts)
        name = parts[0].variable
        variable, value = self.variables[name], self.axes[name]
        common = [t for t in parts[0].terms if all(t in part.terms for part in parts)]
        text = " and ".join(dict.fromkeys(map(proposition_text, parts)))
        if common and not any(part.negated for part in parts):
            text = proposition_text(replace(parts[0], terms=tuple(common)))
        cut = None if variable.categories else self._cut(parts, value)
        return Reason(
            text,
            self.text(name, value),
            value,
            self._degree(parts, value),
            cut,
            None if cut is None else value - cut,
            "" if cut is None else self.text(name, cut),
            "days" if variable.unit == DATE_UNIT else variable.unit,
            self._contributions(variable),
        )

    def _degree(self, parts: Sequence[Proposition], value: float) -> float:
        return min(proposition_degree(part, self.shapes, value) for part in parts)

    def _marks(self, parts: Sequence[Proposition]) -> list[float]:
        """Return where the degrees of propositions may change their formula."""
        shapes = [self.shapes[p.variable, term] for p in parts for term in p.terms]
        return sorted({mark for shape in shapes for mark in landmarks_of(shape)})

    def _needed(self, parts: Sequence[Proposition]) -> list[Proposition]:
        """Return the propositions on a variable that the others do not imply."""
        marks, result = self._marks(parts), [*parts]
        if not marks:
            return result
        middles = [a / 2.0 + b / 2.0 for a, b in pairwise(marks)]
        values = [marks[0] - 1.0, *marks, *middles, marks[-1] + 1.0]
        for part in parts:
            others = [other for other in result if other is not part]
            if others and all(
                self._degree([part], value) == 1.0
                for value in values
                if self._degree(others, value) == 1.0
            ):
                result = others
        return result

    def _cut(self, parts: Sequence[Proposition], value: float) -> float | None:
        """Return the nearest value beside which propositions are true on one side."""
        marks = self._marks(parts)
        step = max(map(abs, marks), default=0.0) * _NEAR or _NEAR
        edges = [
            mark
            for mark in marks
            if (self._degree(parts, mark - step) == 1.0)
            != (self._degree(parts, mark + step) == 1.0)
        ]
        return min(edges, key=lambda edge: abs(edge - value), default=None)

    def _contributions(self, variable: Variable) -> tuple[Contribution, ...]:
        amounts: dict[str, float] = {}
        for part in variable.parts:
            amount = part.weight * (self.point[part.input] - part.centre)
            amounts[part.input] = amounts.get(part.input, 0.0) + amount
        order = sorted(amounts.items(), key=lambda pair: -abs(pair[1]))
        return tuple(
            Contribution(name, self.text(name, self.point[name]), amount)
            for name, amount in order
        )

    # --- the smallest change

    def _changes(
        self,
        wanted: str | None,
        fixed: Collection[str],
        costs: Mapping[str, Fraction],
        budget: Budget,
    ) -> tuple[RowChange | None, RowChange | None]:
        """Return the smallest change, and that of one input if it is another one."""
        if wanted is not None and wanted == self.answer.label:
            return None, None
        search = _Search(self, wanted, costs)
        change = search.change(fixed, budget.share(0.5))
        free = [name for name in self.model.inputs if name not in fixed]
        if len(change.moves) < 2:
            return change, None
        every: list[RowChange] = []
        for name in free:
            others = [other for other in self.model.inputs if other != name]
            every.append(search.change(others, budget.share(0.25)))
        if all(one.verdict == "NONE" for one in every):
            return change, every[0]
        single = [one for one in every if one.cost is not None]
        return change, min(single, key=lambda one: one.cost or 0.0, default=None)


class _Search:
    """The search for changes of a row."""

    def __init__(
        self, decision: ClassDecision, wanted: str | None, costs: Mapping[str, Fraction]
    ) -> None:
        self.decision, self.wanted = decision, wanted
        self.point = {name: Fraction(x) for name, x in decision.point.items()}
        self.domain = decision.domain
        self.costs = costs
        self.sides = {side.variable: side for side in self.domain.sides}
        model = decision.model
        self.base: Base | Leaves
        tree = cast("FuzzyTree", model)  # if it has leaves
        if model.leaves and too_many_boxes(tree) is None:
            self.base = Leaves(tree, self.domain)
        else:
            self.base = Base.of(decision.rules, self.domain)

    def change(self, fixed: Collection[str], budget: Budget) -> RowChange:
        """Return the smallest change of the inputs that are not fixed."""
        near = nearest(self.base, self.point, self.wanted, fixed, self.costs, budget)
        if near.point is None:
            if near.is_none:
                return RowChange("NONE")
            return RowChange("OPEN", low=float(near.low), why=near.why)
        costs = Costs(self.domain, self.decision.model.inputs, fixed, self.costs)
        row = self._confirmed(near, costs)
        if row is None:
            why = "the row lies within rounding of a cut"
            return RowChange("OPEN", low=float(near.low), why=why)
        cost = costs.distance(self.point, _exact(row))
        is_proved = cost - near.low <= max(5 * NARROW * cost, 2 * LEAST)
        moves = [
            self._move(name, row[name], costs)
            for name, old in self.decision.point.items()
            if row[name] != old
        ]
        return RowChange(
            "PROVED" if is_proved else "BOUNDED",
            answer_of(self.decision.model, row).label,
            tuple(sorted(moves, key=lambda move: -round(move.cost / cost, 2))),
            float(cost),
            float(min(near.low, cost)),
            "" if is_proved else near.why or "the search found no nearer row",
        )

    def _move(self, name: str, new: float, costs: Costs) -> Move:
        old, word = self.decision.point[name], self.decision.words.value
        texts = [f"{old:.{digits}g}" for digits in range(6, 18)]
        close = [text for text in texts if abs(float(text) - old) * 99 < abs(new - old)]
        before = Cell(name, old, word(name, Fraction(old)) or close[0])
        text = repr(new).removesuffix(".0")
        after = Cell(name, new, word(name, Fraction(new)) or text)
        return Move(before, after, float(costs.of(name, Fraction(old), Fraction(new))))

    def _confirmed(self, near: Nearest, costs: Costs) -> dict[str, float] | None:
        """Return a row at the point that is decided as is sought, of few digits."""
        assert near.point is not None
        moved = [name for name, x in near.point.items() if x != self.point[name]]
        for beyond in _BEYOND:
            row = dict(self.decision.point)
            for name in moved:
                row[name] = self._reached(name, near.point[name], beyond)
            if self._is_sought(row):
                break
        else:
            return None
        most = costs.distance(self.point, _exact(row)) * (1 + NARROW)
        for name in moved:
            other = {**row, name: self.decision.point[name]}
            if self._is_sought(other):
                row = other
                continue
            for digits in range(1, 17):
                value = float(f"{row[name]:.{digits}g}")
                other = {**row, name: value}
                if costs.of(name, self.point[name], Fraction(value)) > most:
                    continue
                if self.sides[name].has(Fraction(value)) and self._is_sought(other):
                    row = other
                    break
        return row

    def _reached(self, name: str, new: Fraction, beyond: float) -> float:
        """Return a value of an input, a little farther than it has to be."""
        side, old = self.sides[name], self.point[name]
        if side.values or side.is_whole or side.missing in (old, new):
            return float(new)
        far = new + (new - old) * Fraction(beyond)
        return float(min(max(far, Fraction(side.low)), Fraction(side.high)))

    def _is_sought(self, row: Mapping[str, float]) -> bool:
        """Return whether rows can have such values, and `run` decides as is sought."""
        label = answer_of(self.decision.model, row).label
        is_wanted = label == self.wanted
        return (
            is_wanted
            if self.wanted is not None
            else label != self.decision.answer.label
        )


def _exact(row: Mapping[str, float]) -> dict[str, Fraction]:
    return {name: Fraction(value) for name, value in row.items()}
