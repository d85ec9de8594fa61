"""z3, where it is there: axes that share inputs, and what no single level can say."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import Any

from fuzzytree.auditing.decide.answers import (
    ZERO,
    Answer,
    Budget,
    Open,
    Point,
    Proved,
    Question,
)
from fuzzytree.auditing.decide.axes import Axis
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.lines import Lines
from fuzzytree.auditing.decide.rules import Literal

RESOURCES = 1_000_000
"""What z3 may use for a question, in its own unit, which no clock changes."""

_PER_STEP = 1  # about so many of its resources take as long as a step


def solver_for(base: Base, budget: Budget) -> Solver | None:
    """Return the solver of a base, which is made once; None without z3.

    Raises:
        OutOfStepsError: If the budget is spent.
    """
    try:
        import z3
    except ImportError:
        return None
    kept: Solver | None = vars(base).get("solver")
    if kept is None:
        budget.spend(100 * base.size)
        kept = vars(base)["solver"] = Solver(base, z3)
    return kept


def without_solver(last: Open) -> Open:
    """Return why something is open, and that z3 is not there to decide it."""
    return Open(f"{last.why}; z3 is not installed, which might decide it", last.code)


class Solver:
    """A base as terms of z3, strengths as variables within what bounds them.

    Attributes:
        z3: The module.
        strengths: A term for each rule.
        inputs: A term for each input.
        values: A term for each axis.
    """

    def __init__(self, base: Base, z3: Any) -> None:
        self.base, self.z3 = base, z3
        self.context = z3.Context()
        self.inputs = {
            name: (z3.Int if axis.is_whole and not axis.extra else z3.Real)(
                f"input {name}", self.context
            )
            for name, axis in base.inputs.items()
        }
        self.facts: list[Any] = [
            self._within(axis, self.inputs[name]) for name, axis in base.inputs.items()
        ]
        self.degrees: dict[tuple[str, Literal], Any] = {}
        degrees = self.degrees
        self._facts: dict[tuple[str, Literal], list[Any]] = {}
        self.values: dict[str, Any] = {}
        for name, axis in base.axes.items():
            x = self.number(axis.constant)
            for of, weight in axis.weights.items():
                x = x + self.number(weight) * self.inputs[of]
            if axis.is_input:
                x = self.inputs[name]
            elif base.domain.side(name) is not None:
                self.facts += [x >= self.number(axis.low), x <= self.number(axis.high)]
            self.values[name] = x
            for n, literal in enumerate(axis.literals):
                degree = z3.Real(f"degree {n} of {name}", self.context)
                degrees[name, literal] = degree
        self.strengths: list[Any] = []
        self.rule_facts: list[Any] = []
        self.is_linear = True
        for place, rule in enumerate(base.rules):
            strength = self.number(rule.factor)
            for key in rule.literals:
                degree = degrees[key]
                if rule.norm == "product":
                    strength = strength * degree
                    self.is_linear = False
                else:
                    strength = z3.If(strength <= degree, strength, degree)
            term = z3.Real(f"rule {place + 1}", self.context)
            self.strengths.append(term)
            self.rule_facts.append(term == strength)
        self._open = self._new()

    def _new(self) -> Any:
        logic = "QF_LRA" if self.is_linear else "QF_NRA"
        is_whole = any(axis.is_whole for axis in self.base.inputs.values())
        solver = (
            self.z3.Solver(ctx=self.context)
            if is_whole
            else self.z3.SolverFor(logic, ctx=self.context)
        )
        solver.add(*self.facts)
        return solver

    def _of_literal(self, key: tuple[str, Literal]) -> list[Any]:
        """Return what a degree is: the largest or least of its functions."""
        if key not in self._facts:
            name, literal = key
            degree, x = self.degrees[key], self.values[name]
            sides = [
                [self.lines(lines, x) for lines in side]
                for side in self.base.axes[name].parts[literal]
            ]
            lower, upper = (
                functools.reduce(
                    lambda a, b: self.z3.If(
                        a <= b if literal.negated else a >= b, a, b
                    ),
                    side,
                )
                for side in sides
            )
            both = self.base.axes[name].parts[literal]
            is_exact = all(a is b for a, b in zip(*both, strict=True))
            self._facts[key] = [degree >= lower, degree <= upper]
            if is_exact:
                self._facts[key] = [degree == lower]
        return self._facts[key]

    def number(self, value: Fraction) -> Any:
        """Return an exact number as a term."""
        return self.z3.RealVal(str(value), self.context)

    def _within(self, axis: Axis, x: Any) -> Any:
        z3 = self.z3
        some = [x == self.number(v) for v in (*axis.values, *axis.extra)]
        if not axis.values:
            low, high = self.number(axis.low), self.number(axis.high)
            some.append(z3.And(x > low if axis.is_open else x >= low, x <= high))
        return z3.Or(*some, self.context) if len(some) > 1 else some[0]

    def lines(self, lines: Lines, x: Any) -> Any:
        """Return the value of lines at a term."""
        plain = without_bends(lines)
        z3, number = self.z3, self.number
        if len(plain.x) == 1:
            return number(plain.at[0])

        def part(first: int, last: int) -> Any:
            if last - first > 1:
                middle = (first + last) // 2
                is_left = x <= number(plain.x[middle])
                return z3.If(is_left, part(first, middle), part(middle, last))
            a, b = plain.x[first], plain.x[last]
            p, q = plain.after[first], plain.before[first]
            slope = (q - p) / (b - a)
            result = number(p) + number(slope) * (x - number(a)) if slope else number(p)
            if plain.at[last] != q:
                result = z3.If(x == number(b), number(plain.at[last]), result)
            if plain.at[first] != p:
                result = z3.If(x == number(a), number(plain.at[first]), result)
            return result

        whole = part(0, len(plain.x) - 1)
        whole = z3.If(x < number(plain.x[0]), number(plain.at[0]), whole)
        return z3.If(x > number(plain.x[-1]), number(plain.at[-1]), whole)

    def ask(
        self, question: Question, budget: Budget, resources: int = RESOURCES
    ) -> Answer:
        """Decide a question.

        Raises:
            OutOfStepsError: If the budget is spent.
        """
        rules = question.rules

        def holds(point: dict[str, Fraction]) -> bool:
            return question.holds(*self.base.strengths(point, rules))

        formula = self.formula(question)
        return self.ask_formula(formula, holds, budget, rules, resources)

    def formula(self, question: Question) -> Any:
        """Return a question as a formula."""
        z3, strengths = self.z3, self.strengths
        level = z3.Real("level", self.context)
        parts = [level > 0]
        if question.level is not None:
            level = self.number(question.level)
            parts = []
        parts += [strengths[i] >= level for i in question.reach]
        parts += [strengths[i] < level for i in question.rivals]
        parts += [strengths[i] <= level for i in question.weak]
        return z3.And(*parts, z3.BoolVal(True, self.context))

    def ask_formula(
        self,
        formula: Any,
        holds: Callable[[dict[str, Fraction]], bool],
        budget: Budget,
        rules: Iterable[int] | None = None,
        resources: int = RESOURCES,
    ) -> Answer:
        """Look for a point at which a formula is true, and something holds exactly.

        `rules`: those that the formula is about; all unless given.

        Raises:
            OutOfStepsError: If the budget is spent.
        """
        z3 = self.z3
        budget.spend(0)
        most = min(resources, _PER_STEP * max(budget.left, 1))
        solver = self._open if self.is_linear else self._new()
        solver.push()
        try:
            solver.set("rlimit", most)
            places = range(self.base.count) if rules is None else dict.fromkeys(rules)
            for place in places:
                solver.add(self.rule_facts[place])
                for key in self.base.rules[place].literals:
                    solver.add(*self._of_literal(key))
            solver.add(formula)
            before = _cost(solver)
            result = solver.check()
            budget.spend(min(max(_cost(solver) - before, 0), most) // _PER_STEP + 100)
            values = []
            if result == z3.sat:
                model, terms = solver.model(), self.inputs.values()
                values = [model.eval(x, model_completion=True) for x in terms]
        finally:  # or the next question would have this one's facts as well
            solver.pop()
        if result == z3.unsat:
            return Proved("z3")
        if result != z3.sat:
            return Open("z3 gave up")
        point = dict(zip(self.inputs, map(_fraction, values), strict=True))
        if self.base.contains(point) and holds(point):
            return Point(point, "z3")
        return Open("lines around a curve are too far apart, or a point is no fraction")

    def highest(self, terms: Sequence[Any]) -> Any:
        """Return the largest of some strengths."""
        result = self.number(ZERO)
        for term in terms:
            result = self.z3.If(result >= term, result, term)
        return result


def _cost(solver: Any) -> int:
    """Return the resources that z3 has used."""
    statistics = solver.statistics()
    keys = [statistics[n][0] for n in range(len(statistics))]
    return (
        int(statistics.get_key_value("rlimit count")) if "rlimit count" in keys else 0
    )


def _fraction(value: Any) -> Fraction:
    if hasattr(value, "as_fraction"):
        result: Fraction = value.as_fraction()
        return result
    if hasattr(value, "as_long"):
        return Fraction(value.as_long())
    return Fraction(value.approx(30).as_fraction())


def without_bends(lines: Lines) -> Lines:
    """Return the same without knots at which nothing changes."""
    last = len(lines.x) - 1
    kept = [0]
    for k in range(1, last):
        a, b = lines.x[k] - lines.x[k - 1], lines.x[k + 1] - lines.x[k]
        v = lines.at[k]
        is_smooth = v == lines.before[k - 1] == lines.after[k]
        if not is_smooth or (v - lines.after[k - 1]) * b != (lines.before[k] - v) * a:
            kept.append(k)
    if not last:
        return lines
    kept.append(last)
    return Lines(
        tuple(lines.x[k] for k in kept),
        tuple(lines.at[k] for k in kept),
        tuple(lines.after[k] for k in kept[:-1]),
        tuple(lines.before[k - 1] for k in kept[1:]),
    )
