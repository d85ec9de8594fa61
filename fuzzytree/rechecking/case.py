"""An audit beside its model: what every check needs, and claims of points."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import cached_property

from fuzzytree.rechecking.curves import ONE, ZERO, Between, bounds, is_straight, knots
from fuzzytree.rechecking.models import Model, Point, Proposition, Rule, Rules, Variable
from fuzzytree.rechecking.outcomes import (
    DoesNotHoldError,
    Report,
    UndecidedError,
    require,
)
from fuzzytree.rechecking.records import (
    Answer,
    Audit,
    Claim,
    Coordinate,
    Difference,
    Span,
    Witness,
    fraction,
)
from fuzzytree.rechecking.smt import Script
from fuzzytree.rechecking.words import value_word

MOST_POINTS = 16
_SHOWN = ("FT101", "FT103", "FT201", "FT205")
"""The codes whose witnesses are points at which all rules are evaluated."""
CLOSE = Fraction(1, 2**70)
"""How far beside a point curves that are no lines are evaluated, where many are."""


class Case:
    """An audit, or a comparison, and a model of it.

    Attributes:
        sides: The sides of the domain by name.
        is_free: Whether no variable is a combination of others.
        numbers: The numbers of the rules, from 1.
    """

    def __init__(self, facts: Audit | Difference, model: Model) -> None:
        self.model, self.rules = model, model.rules
        self.settings, self.answers = facts.settings, facts.answers
        self.file = facts.file if isinstance(facts, Audit) else None
        sides = {side.variable: side for side in facts.domain.sides}
        self.sides = {n: side for n, side in sides.items() if n in model.variables}
        self.is_free = not any(v.parts for v in model.variables.values())
        self.numbers = range(1, len(self.rules.rules) + 1)
        self._strengths: dict[tuple[object, ...], list[Between]] = {}

    @cached_property
    def script(self) -> Script:
        """The model as text for a solver."""
        ends = {n: (Fraction(s.low), Fraction(s.high)) for n, s in self.sides.items()}
        values = {name: side.points for name, side in self.sides.items()}
        script = Script()
        script.add(self.model, ends, values=values)
        return script

    def reaches(self, number: int, sign: str, level: Fraction) -> str:
        """Return that a rule's strength is `>` or `>=` a level, for a solver."""
        rule = self.rules.rules[number - 1]
        return self.script.reaches(rule, self.rules, sign, level)

    def symbol(self, number: int) -> str:
        """Return the strength of a rule, in the text for a solver."""
        return self.script.symbol(self.name(number))

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
        require(side is not None, f"the domain has no side {variable.name!r}")
        assert side is not None
        stand_in = side.low if side.missing is None else side.missing
        numbers = side.low, side.high, stand_in
        return Fraction(min(numbers)), Fraction(max(numbers))

    def then(self, number: int) -> str:
        """Return the class of a rule."""
        return self.rules.rules[number - 1].then

    def name(self, number: int) -> str:
        """Return what answers call a rule."""
        return self.model.names[number - 1]

    def rivals(self, number: int) -> list[int]:
        """Return the rules of other classes."""
        return [n for n in self.numbers if self.then(n) != self.then(number)]

    def own(self, label: str | None) -> list[int]:
        """Return the rules of a class."""
        return [n for n in self.numbers if self.then(n) == label]

    def pairs(self, *, alike: bool | None = None) -> list[tuple[int, int]]:
        """Return the pairs of rules, of one class or of two; not ways of one rule."""
        of = self.model.numbers
        return [
            (one, other)
            for one, other in itertools.combinations(self.numbers, 2)
            if of[one - 1] != of[other - 1]
            and alike in (None, self.then(one) == self.then(other))
        ]

    def coded(self, start: str) -> list[Answer]:
        """Return the answers whose message begins so."""
        return [one for one in self.answers if one.message.startswith(start)]

    # --- points that are known

    @cached_property
    def known(self) -> list[tuple[Point, list[Between]]]:
        """Witnesses and other points of the domain, with the strengths of all rules."""
        points = [
            {c.input: fraction(c.exact) for c in one.state.point}
            for one in self.answers
            if isinstance(one.state, Witness) and one.code in _SHOWN
        ]
        points = [p for p in points if p.keys() == {*self.inputs}]
        chance = random.Random(0)
        for _ in range(MOST_POINTS):
            point = {}
            for name in self.inputs:
                low, high = self.ends(self.model.variables[name])
                share = Fraction(chance.randrange(1025), 1024)
                point[name] = low + (high - low) * share
            points.append(point)
        result: list[tuple[Point, list[Between]]] = [
            (p, strengths(self.rules, p)) for p in points if self.is_within(p)
        ]
        for n in self.numbers:
            if not any(every[n - 1][0] for _, every in result):
                best = self.best(n)
                if self.is_within(best):
                    result.append((best, strengths(self.rules, best)))
        return result

    @cached_property
    def _values(self) -> dict[str, list[Fraction]]:
        """The values of each input at which its curves change, and between these."""
        result: dict[str, list[Fraction]] = {}
        for name in self.inputs:
            low, high = self.ends(self.model.variables[name])
            curves = self.rules.variables[name].curves.values()
            inner = {x for one in curves for x in knots(one) if low < x < high}
            ends = sorted({low, high, *inner})
            ends += [(a + b) / 2 for a, b in itertools.pairwise(ends)]
            result[name] = ends
        return result

    def best(self, number: int) -> dict[str, Fraction]:
        """Return a point at which a rule is strong, axis by axis."""
        when, point = self.rules.rules[number - 1].when, {}
        for name, values in self._values.items():
            own = [one for one in when if one.variable == name]
            part = self.rules._replace(rules=(Rule(tuple(own), ""),))
            only = part._replace(variables={name: self.rules.variables[name]})
            least = [strengths(only, {name: x})[0][0] for x in values] if own else [ONE]
            point[name] = values[least.index(max(least))]
        return point

    @cached_property
    def above(self) -> dict[int, set[int]]:
        """For each rule those known to be above it somewhere; for 0 those that fire."""
        result: dict[int, set[int]] = {n: set() for n in (0, *self.numbers)}
        for _, one in self.known:
            for n, (_, most) in enumerate([(ZERO, ZERO), *one]):
                result[n] |= {m for m in self.numbers if one[m - 1][0] > most}
        return result

    # --- points

    @property
    def inputs(self) -> list[str]:
        """The names of the inputs."""
        return [v.name for v in self.model.variables.values() if not v.parts]

    def is_within(self, point: Point) -> bool:
        """Return whether a point is in the domain."""
        values = {n: self.model.variables[n].at(point) for n in self.sides}
        return all(side.has(values[n]) for n, side in self.sides.items())

    def point_of(self, coordinates: Sequence[Coordinate]) -> dict[str, Fraction]:
        """Return a point of the domain with a value of every input."""
        point = values_of(coordinates)
        is_whole = point.keys() == {*self.inputs}
        require(is_whole, "the point does not have a value of every input")
        require(self.is_within(point), "the point lies outside the domain")
        for one in coordinates:
            column, value = self.model.variables[one.input], point[one.input]
            word = value_word(column, self.sides.get(one.input), value)
            require(one.word == word, f"{one.input!r} is {word!r}, not {one.word!r}")
        return point

    def check_point(
        self, report: Report, coordinates: Sequence[Coordinate], claims: Sequence[Claim]
    ) -> Point:
        """Return a point of the domain at which the claims hold."""
        point = self.point_of(coordinates)
        for claim in claims:
            entries = zip(claim._fields, claim, strict=True)
            text = ", ".join(f"{name} {value}" for name, value in entries if value)
            require(self.holds(claim, point), f"not so: {text}")
            report.counts["claims evaluated again"] += 1
        return point

    def corners(self, region: Sequence[Span], point: Point) -> Iterator[Point]:
        """Yield corners and the middle of a region, other inputs at three values.

        A corner lies just above the lower ends, for these may belong to a neighbour.
        """
        spans = {span.variable: span for span in region}
        if not spans or not self.is_free:
            return
        ends: dict[str, tuple[Fraction, Fraction, Fraction]] = {}
        for name, side in self.sides.items():
            span = spans.get(name, Span(name, None, None, ""))
            low = Fraction(side.low if span.low is None else span.low)
            high = Fraction(side.high if span.high is None else span.high)
            middle = (low + high) / 2 if name in spans else point[name]
            ends[name] = low + (high - low) / 2**30, high, middle
        ways = itertools.product((0, 1), repeat=len(spans))
        chosen = [*itertools.islice(ways, 16), (2,) * len(spans)]
        for way, other in itertools.product(chosen, range(3)):
            places = dict.fromkeys(ends, other) | dict(zip(spans, way, strict=True))
            result = {name: ends[name][place] for name, place in places.items()}
            if self.is_within(result):
                yield result

    def holds(self, claim: Claim, point: Point, off: Fraction = ZERO) -> bool:
        """Return whether a claim holds at a point, evaluated in fractions.

        Raises:
            DoesNotHoldError: If it is no claim about this model.
            UndecidedError: If two numbers are too near to distinguish.
        """
        used = {n for n, one in zip(claim._fields, claim, strict=True) if one}
        alien = used - {"kind", "of", *FIELDS[claim.kind].split(" ")}
        require(not alien, f"a claim of kind {claim.kind} has no {', '.join(alien)}")
        rules = self.model.raw if claim.of == "raw rules" else self.rules
        is_known = claim.of in ("rules", "raw rules") or self.model.form == claim.of
        if rules is None or not is_known:
            raise DoesNotHoldError(f"there are no {claim.of} to claim something of")
        if claim.kind == "decides":
            if claim.of == "tree":
                return self.model.leaves[self.model.leaf_at(point) - 1] == claim.label
            return class_at(rules, point) == claim.label
        require(claim.of != "tree", "a tree has no strengths")
        level = None if claim.level is None else fraction(claim.level)
        if claim.kind == "degree":
            known = rules.variables.get(claim.variable or "")
            if known is None or claim.term not in known.curves or level is None:
                raise DoesNotHoldError("a claim of an unknown term")
            x = known.at(point)
            low, high = bounds(known.curves[claim.term], x, x)
            return low <= level <= high
        key = claim.of, *point.values()
        if key not in self._strengths:
            self._strengths[key] = strengths(rules, point, off)
        every = self._strengths[key]
        is_known = all(1 <= n <= len(every) for n in (*claim.rules, *claim.rivals))
        require(is_known, "a claim of an unknown rule")
        ours = [every[n - 1] for n in claim.rules or range(1, len(every) + 1)]
        rivals = [every[n - 1] for n in claim.rivals]
        require(bool(claim.rules) or claim.kind == "covered", "a claim of no rule")
        least, most = (
            tuple(choose(one[end] for one in ours) for end in (0, 1))
            for choose in (min, max)
        )
        top = tuple(max((one[end] for one in rivals), default=ZERO) for end in (0, 1))
        if claim.kind == "covered":
            return less((ZERO, ZERO), most)
        if claim.kind == "beats":
            return less(top, least)  # alone: it fires
        if claim.kind == "ties":
            is_one = least == most and least[0] == least[1]
            return is_one and (not rivals or less(top, least))
        if level is None:
            raise DoesNotHoldError("a claim without its level")
        if claim.kind == "strength":
            return ours[0][0] <= level <= ours[0][1]
        if claim.kind == "below":
            return most[1] == level == 0 or less(most, (level, level))
        return least[0] >= level or not less(least, (level, level))


def values_of(coordinates: Sequence[Coordinate]) -> dict[str, Fraction]:
    """Return a point whose digits are one number each."""
    point: dict[str, Fraction] = {}
    for one in coordinates:
        value = fraction(one.exact)
        near = float(value)
        hexed = near.hex() if Fraction(near) == value else None
        text = f"{one.input!r}: the decimal or hexadecimal digits are not {one.exact}"
        require((repr(near), hexed) == (one.decimal, one.hex), text)
        require(one.input not in point, f"{one.input!r} stands twice in the point")
        point[one.input] = value
    return point


FIELDS = {
    "strength": "rules level",
    "beats": "rules rivals",
    "ties": "rules rivals",
    "below": "rules level",
    "reaches": "rules level",
    "decides": "label",
    "degree": "level variable term",
    "covered": "",
}
"""What each kind of claim is about."""


def less(one: tuple[Fraction, ...], other: tuple[Fraction, ...]) -> bool:
    """Return whether a number is below another one, each between two ends."""
    if one[1] < other[0]:
        return True
    if one[0] < other[1]:
        raise UndecidedError("two strengths are too near to distinguish")
    return False


def strengths(rules: Rules, point: Point, off: Fraction = ZERO) -> list[Between]:
    """Return between which numbers the strength of each rule at a point lies.

    With `off`, those of curves that are no lines also so far beside it.
    """
    values = {name: variable.at(point) for name, variable in rules.variables.items()}
    known: dict[Proposition, Between] = {}
    result: list[Between] = []
    for rule in rules.rules:
        low = high = ONE
        for proposition in rule.when:
            if proposition not in known:
                curves = rules.variables[proposition.variable].curves
                x = values[proposition.variable]
                every = [
                    bounds(curve, x, x if is_straight(curve) else x + off)
                    for curve in (curves[term] for term in proposition.terms)
                ]
                a, b = (max(one[end] for one in every) for end in (0, 1))
                a, b = (1 - b, 1 - a) if proposition.negated else (a, b)
                known[proposition] = proposition.weight * a, proposition.weight * b
            a, b = known[proposition]
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
    first = result.index(best)
    for place, one in enumerate(result):
        is_exact = one == best and one[0] == one[1]
        is_other = rules.rules[place].then != rules.rules[first].then
        if is_other and not is_exact:
            less(one, best)
    return rules.rules[first].then
