"""An audit beside its model: what every check needs, and claims of points."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import cached_property

from fuzzytree.rechecking.curves import ONE, ZERO, Between, bounds
from fuzzytree.rechecking.models import (
    Model,
    Point,
    Proposition,
    Rule,
    Rules,
    Variable,
    may_conflict,
)
from fuzzytree.rechecking.outcomes import DoesNotHoldError, UndecidedError, require
from fuzzytree.rechecking.records import (
    Answer,
    Audit,
    Claim,
    Coordinate,
    Difference,
    Witness,
    fraction,
)
from fuzzytree.rechecking.smt import Script, all_of
from fuzzytree.rechecking.words import value_word

MOST_POINTS = 16
Pair = tuple[int, int]


class Case:
    """An audit, or a comparison, and a model of it.

    Attributes:
        sides: The sides of the domain by name.
        numbers: The numbers of the rules, from 1.
        has_all_rules: Whether the text for a solver has rules that no claim names.
    """

    has_all_rules = True

    def __init__(self, facts: Audit | Difference, model: Model) -> None:
        self.model, self.rules = model, model.rules
        self.settings, self.answers = facts.settings, facts.answers
        self.file = facts.file if isinstance(facts, Audit) else None
        sides = {side.variable: side for side in facts.domain.sides}
        self.sides = {n: side for n, side in sides.items() if n in model.variables}
        self.numbers = range(1, len(self.rules.rules) + 1)
        self.inputs = [v.name for v in model.variables.values() if not v.parts]
        self._strengths: dict[tuple[object, ...], list[Between]] = {}

    def ends(self, variable: Variable) -> tuple[Fraction, Fraction]:
        """Return the values of a variable in the domain; of a sum, at most."""
        side = self.sides.get(variable.name)
        if variable.parts:
            low = high = ZERO
            for name, weight, centre in variable.parts:
                every = self.ends(self.model.variables[name])
                ends = sorted(weight * (end - centre) for end in every)
                low, high = low + ends[0], high + ends[1]
            if side is None:
                return low, high
            return max(low, Fraction(side.low)), min(high, Fraction(side.high))
        if side is None:
            raise DoesNotHoldError(f"the domain has no side {variable.name!r}")
        values = [Fraction(side.low), Fraction(side.high), *side.points]
        return min(values), max(values)

    # --- the text for a solver

    @cached_property
    def script(self) -> Script:
        """The model as text for a solver."""
        script = Script()
        self.add_to(script)
        return script

    def add_to(self, script: Script, *, is_bounded: bool = True) -> None:
        """Add the model to a text, within the domain or for all numbers."""
        sides = self.sides if is_bounded else {}
        ends = {n: (Fraction(s.low), Fraction(s.high)) for n, s in sides.items()}
        script.add(
            self.model,
            ends,
            {n: side.points for n, side in sides.items()},
            has_rules=self.has_all_rules,
        )

    def reaches(self, number: int, sign: str, level: Fraction) -> str:
        """Return that a rule's strength is `>` or `>=` a level."""
        return self.script.reaches(self.rule(number), self.rules, sign, level)

    def symbol(self, number: int) -> str:
        """Return the strength of a rule."""
        return self.script.add_rule(self.rule(number), self.rules)

    def over(self, number: int, rivals: Iterable[int]) -> str:
        """Return that a rule fires and is above rivals."""
        own = self.symbol(number)
        above = (f"(> {own} {self.symbol(n)})" for n in rivals)
        return all_of([f"(> {own} 0.0)", *above])

    def wins(self, number: int, symbols: Sequence[str], *, is_strict: bool) -> str:
        """Return that a rule decides: as the first of the strongest, or strictly."""
        own = symbols[number - 1]
        formulas = [f"(> {own} 0.0)"]
        for n in self.rivals(number):
            sign = ">" if is_strict or n < number else ">="
            formulas.append(f"({sign} {own} {symbols[n - 1]})")
        return all_of(formulas)

    # --- rules

    def rule(self, number: int) -> Rule:
        """Return a rule."""
        return self.rules.rules[number - 1]

    def then(self, number: int) -> str:
        """Return the class of a rule."""
        return self.rule(number).then

    def name(self, *numbers: int) -> str:
        """Return what answers call rules."""
        return ", ".join(self.rule(number).name for number in numbers)

    def rivals(self, number: int) -> list[int]:
        """Return the rules of other classes."""
        return [n for n in self.numbers if self.then(n) != self.then(number)]

    def pairs(self, *, alike: bool | None = None) -> list[Pair]:
        """Return the pairs of rules, of one class or of two; not ways of one rule."""
        return [
            (a, b)
            for a, b in itertools.combinations(self.numbers, 2)
            if self.rule(a).number != self.rule(b).number
            and alike in (None, self.then(a) == self.then(b))
        ]

    def conflicts(self) -> set[Pair]:
        """Return the pairs of rules that say different things of one output."""
        pairs = self.pairs(alike=False)
        return {(a, b) for a, b in pairs if may_conflict(self.rule(a), self.rule(b))}

    def answers_of(self, *starts: str) -> list[Answer]:
        """Return the answers whose message begins so."""
        return [o for o in self.answers if o.message.startswith(starts)]

    def live(self) -> set[int]:
        """Return the rules that no answer says never to fire."""
        dead = self.answers_of("FT101.never-fires", "FT107.silent")
        numbers = {self.rule(o.rules[0]).number for o in dead if o.rules}
        return {n for n in self.numbers if self.rule(n).number not in numbers}

    def live_pairs(self, *, alike: bool) -> list[Pair]:
        """Return the pairs of rules that may fire, of one class or of two."""
        live = self.live()
        return [pair for pair in self.pairs(alike=alike) if live.issuperset(pair)]

    # --- points

    @cached_property
    def samples(self) -> list[list[Between]]:
        """The strengths of all rules at witnesses and other points of the domain."""
        states = (answer.state for answer in self.answers)
        points = [
            {c.input: fraction(c.exact) for c in state.point}
            for state in states
            if isinstance(state, Witness)
        ]
        chance = random.Random(0)
        for _ in range(MOST_POINTS):
            point: dict[str, Fraction] = {}
            for name in self.inputs:
                low, high = self.ends(self.model.variables[name])
                share = Fraction(chance.randrange(1025), 1024)
                point[name] = low + (high - low) * share
            points.append(point)
        whole = {*self.inputs}
        points = [p for p in points if p.keys() == whole and self.is_within(p)]
        return [strengths(self.rules, point) for point in points]

    def is_within(self, point: Point) -> bool:
        """Return whether a row of the domain can be this point."""
        values = {n: self.model.variables[n].at(point) for n in self.sides}
        return all(side.has(values[n]) for n, side in self.sides.items())

    def point_of(self, coordinates: Sequence[Coordinate]) -> dict[str, Fraction]:
        """Return a point of the domain with a value of every input."""
        point = values_of(coordinates)
        is_whole = point.keys() == {*self.inputs}
        require(is_whole, "the point does not have a value of every input")
        require(self.is_within(point), "the point lies outside the domain")
        for c in coordinates:
            column, value = self.model.variables[c.input], point[c.input]
            word = value_word(column, self.sides.get(c.input), value)
            require(c.word == word, f"{c.input!r} is {word!r}, not {c.word!r}")
        return point

    def check_point(
        self, coordinates: Sequence[Coordinate], claims: Sequence[Claim]
    ) -> Point:
        """Return a point of the domain at which the claims hold."""
        point = self.point_of(coordinates)
        for claim in claims:
            entries = zip(claim._fields, claim, strict=True)
            text = ", ".join(f"{name} {value}" for name, value in entries if value)
            require(self.holds(claim, point), f"not so: {text}")
        return point

    def holds(self, claim: Claim, point: Point) -> bool:
        """Return whether a claim holds at a point, evaluated in fractions."""
        fields = {n for n, value in zip(claim._fields, claim, strict=True) if value}
        alien = fields - {"kind", "of", *FIELDS[claim.kind].split(" ")}
        require(not alien, f"a claim of kind {claim.kind} has no {', '.join(alien)}")
        rules = self.model.raw if claim.of == "raw rules" else self.rules
        is_there = claim.of in ("rules", "raw rules") or self.model.form == claim.of
        if rules is None or not is_there:
            raise DoesNotHoldError(f"there are no {claim.of} to claim something of")
        if claim.kind == "decides":
            if claim.of == "tree":
                return self.model.leaves[self.model.leaf_at(point) - 1] == claim.label
            return class_at(rules, point) == claim.label
        require(claim.of != "tree", "a tree has no strengths")
        is_so = (claim.level is None) is ("level" not in FIELDS[claim.kind])
        require(is_so, "a claim without its level")
        level = ZERO if claim.level is None else fraction(claim.level)
        key = claim.of, *sorted(point.items())
        if key not in self._strengths:
            self._strengths[key] = strengths(rules, point)
        every = self._strengths[key]
        is_there = all(1 <= n <= len(every) for n in (*claim.rules, *claim.rivals))
        require(is_there, "a claim of an unknown rule")
        require(bool(claim.rules), "a claim of no rule")
        ours = [every[n - 1] for n in claim.rules]
        rivals = [(ZERO, ZERO), *(every[n - 1] for n in claim.rivals)]
        least, most, top = _ends(min, ours), _ends(max, ours), _ends(max, rivals)
        match claim.kind:
            case "beats":
                return less(top, least)  # alone: it fires
            case "ties":
                is_tie = least == most and least[0] == least[1]
                return is_tie and (not claim.rivals or less(top, least))
            case "strength":
                return ours[0][0] <= level <= ours[0][1]
            case "below":
                return most[1] == level == 0 or less(most, (level, level))
            case "reaches":
                return least[0] >= level or not less(least, (level, level))


FIELDS = {
    "strength": "rules level",
    "beats": "rules rivals",
    "ties": "rules rivals",
    "below": "rules level",
    "reaches": "rules level",
    "decides": "label",
}
"""What each kind of claim is about."""


def _ends(
    choose: Callable[[Iterable[Fraction]], Fraction], of: list[Between]
) -> Between:
    """Return the least, or the most, of the lower and of the upper ends."""
    return choose(low for low, _ in of), choose(high for _, high in of)


def values_of(coordinates: Sequence[Coordinate]) -> dict[str, Fraction]:
    """Return a point whose digits are one number each."""
    point: dict[str, Fraction] = {}
    for c in coordinates:
        value = fraction(c.exact)
        near = float(value)
        hexed = near.hex() if Fraction(near) == value else None
        text = f"{c.input!r}: the decimal or hexadecimal digits are not {c.exact}"
        require((repr(near), hexed) == (c.decimal, c.hex), text)
        require(c.input not in point, f"{c.input!r} stands twice in the point")
        point[c.input] = value
    return point


def less(lower: Between, upper: Between) -> bool:
    """Return whether a number is below another one, each between two ends."""
    if lower[1] < upper[0]:
        return True
    if lower[0] < upper[1]:
        raise UndecidedError("two strengths are too near to distinguish")
    return False


def strengths(rules: Rules, point: Point) -> list[Between]:
    """Return between which numbers the strength of each rule at a point lies."""
    values = {name: variable.at(point) for name, variable in rules.variables.items()}
    degrees: dict[Proposition, Between] = {}
    result: list[Between] = []
    for rule in rules.rules:
        low = high = ONE
        for proposition in rule.when:
            if proposition not in degrees:
                x = values[proposition.variable]
                curves = rules.variables[proposition.variable].curves
                every = [bounds(curves[term], x, x) for term in proposition.terms]
                a, b = _ends(max, every)
                a, b = (1 - b, 1 - a) if proposition.negated else (a, b)
                degrees[proposition] = proposition.weight * a, proposition.weight * b
            a, b = degrees[proposition]
            if rules.is_product:
                low, high = low * a, high * b
            else:
                low, high = min(low, a), min(high, b)
            if not high:
                break
        result.append((low, high))
    return result


def class_at(rules: Rules, point: Point) -> str | None:
    """Return the class of the first of the strongest rules; None is no class."""
    result = strengths(rules, point)
    best = max(result)
    if best[1] == 0:
        return rules.uncovered
    then = rules.rules[result.index(best)].then
    for rule, strength in zip(rules.rules, result, strict=True):
        is_exact = strength == best and best[0] == best[1]
        if rule.then != then and not is_exact:
            less(strength, best)
    return then
