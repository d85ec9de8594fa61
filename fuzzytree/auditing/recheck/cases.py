"""An audit beside its model: what every question needs, and claims of points."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property

from fuzzytree.auditing.recheck.audit_records import (
    Answer,
    Audit,
    Claim,
    Coordinate,
    Label,
    Measure,
    Span,
    fraction,
)
from fuzzytree.auditing.recheck.enclosing import Between, bounds
from fuzzytree.auditing.recheck.grid import Grid, Line, RuleBits, Ties, height, shared
from fuzzytree.auditing.recheck.meaning import (
    Point,
    Steps,
    View,
    answer_of,
    paths,
    rules_of,
    strengths,
    value_of,
)
from fuzzytree.auditing.recheck.model_records import Model, Rules, Tree, Variable
from fuzzytree.auditing.recheck.models import Place, Places, Whole
from fuzzytree.auditing.recheck.outcomes import (
    DoesNotHoldError,
    Report,
    UndecidedError,
    require,
)
from fuzzytree.auditing.recheck.polynomials import ONE, ZERO

NEAR = Fraction(1, 10**6)
"""How far a highest common level that is one number may be above it."""

LEVELS = (
    *("highest common level", "highest common level at most"),
    *("strength where it is least, at least", "strength where it is least, at most"),
)
"""The measures that are degrees which rules reach, or do not."""


def level_of(measure: Measure) -> Fraction:
    """Return the number of a measure."""
    return Fraction(measure.value) if measure.exact is None else fraction(measure.exact)


def end_of(measure: Measure) -> Fraction:
    """Return the most that a measure can mean: one that is not exact is near."""
    is_near = measure.name == "highest common level" and measure.exact is None
    return level_of(measure) + (NEAR if is_near else 0)


class Case:
    """An audit and its model in every form.

    Attributes:
        rules: The rules of the model; of a tree, its relative ones; of a system, the
            ways of its conditions.
        view: A system as it is audited; None for what is none.
        weights: What the strength of each rule is multiplied by.
        terms: The terms of the audit.
        representations: Everything that a claim can be of, by name.
        variables: The variables of the model by name.
        sides: The sides of the domain by name.
        is_free: Whether no variable is a combination of others.
        numbers: The numbers of the rules, from 1.
    """

    def __init__(
        self, audit: Audit, model: Whole, places: Places | None = None
    ) -> None:
        self.places = places or Places({})
        self.has_places = places is not None and any(a.places for a in audit.answers)
        self.view: View | None = None
        if not isinstance(model, Rules | Tree):
            self.view = View(model, audit)
            model = self.view.rules
        self.audit, self.model = audit, model
        self.representations: dict[str, Model] = {}
        if isinstance(model, Tree):
            self.rules = rules_of(model, "relative")
            self.representations = {"tree": model}
            if model.sets:
                self.representations["raw rules"] = rules_of(model, "raw")
        else:
            self.rules = model
        self.representations["rules"] = self.rules
        self.variables = {v.name: v for v in model.variables}
        self.sides = {side.variable: side for side in audit.domain.sides}
        self.is_free = not any(v.parts for v in model.variables)
        self.numbers = range(1, len(self.rules.rules) + 1)
        self.weights = [ONE] * len(self.numbers)
        self.terms = [
            Label(v.name, t.name) for v in self.rules.variables for t in v.terms
        ]
        if self.view is not None:
            self.weights = [owner.weight for owner in self.view.owners]
            self.terms = self.view.labels

    @property
    def grid(self) -> Grid:
        """The rules in cells.

        Raises:
            UndecidedError: If there are too many, or a rule has no propositions.
        """
        if isinstance(self._grid, UndecidedError):
            raise self._grid
        return self._grid

    @cached_property
    def _grid(self) -> Grid | UndecidedError:
        when = zip(self.rules.rules, self.weights, strict=True)
        if not all(weight == 1 or rule.when for rule, weight in when):
            return UndecidedError("a rule without propositions is not weighted here")
        if self.view is not None and not self.view.is_plain:
            return UndecidedError("a condition does not hold by its ways")
        settings = self.audit.settings
        lines = {v.name: self.line(v) for v in self.rules.variables}
        levels = [Fraction(settings.epsilon), Fraction(settings.level)]
        used = (*self.coded("FT201"), *self.coded("FT301"))
        entries = (one for answer in used for one in answer.measures)
        levels += [end_of(m) for m in entries if m.name in LEVELS and 0 <= m.value <= 1]
        try:
            return Grid(self.rules, lines, levels, self.weights)
        except UndecidedError as error:  # known once, for every question
            return error

    @cached_property
    def ties(self) -> Ties:
        """The pairs of rules that tie."""
        if self.rules.semantics.conjunction != "minimum":
            raise UndecidedError("ties under product are not decided again here")
        return Ties(self.grid)

    @cached_property
    def paths(self) -> dict[int, Steps]:
        """The path to each leaf."""
        return dict(paths(self.model)) if isinstance(self.model, Tree) else {}

    @cached_property
    def heights(self) -> dict[Label, Fraction]:
        """The largest degree of each term on the domain."""
        level = Fraction(self.audit.settings.level)
        return {
            Label(v.name, term.name): height(term.function, self.line(v), level)
            for v in self.rules.variables
            for term in v.terms
            if Label(v.name, term.name) in self.terms
        }

    @cached_property
    def shares(self) -> dict[tuple[Label, ...], tuple[Fraction, Fraction] | None]:
        """The shared area of each pair of terms of a variable; None without area."""
        return {
            (Label(v.name, a.name), Label(v.name, b.name)): shared(
                a.function, b.function, self.line(v)
            )
            for v in self.rules.variables
            for a, b in itertools.combinations(v.terms, 2)
            if {Label(v.name, a.name), Label(v.name, b.name)} <= {*self.terms}
        }

    def line(self, variable: Variable) -> Line:
        """Return a variable's values in the domain; of a combination, at most these."""
        side = self.sides.get(variable.name)
        if not variable.parts and side is not None:
            return Line(Fraction(side.low), Fraction(side.high))
        low = high = ZERO
        weights = dict.fromkeys((part.input for part in variable.parts), ZERO)
        for part in variable.parts:  # an input may stand several times
            weight = Fraction(part.weight)
            weights[part.input] += weight
            low, high = (end - weight * Fraction(part.centre) for end in (low, high))
        for name, weight in weights.items():
            one = self.sides.get(name)
            if one is None:
                text = f"the domain has no side {name!r}, which {variable.name!r} needs"
                raise DoesNotHoldError(text)
            ends = [weight * Fraction(end) for end in (one.low, one.high)]
            low, high = low + min(ends), high + max(ends)
        if side is not None:
            low, high = max(low, Fraction(side.low)), min(high, Fraction(side.high))
        return Line(low, high)

    def coded(self, code: str) -> list[Answer]:
        """Return the answers of a code."""
        return [one for one in self.audit.answers if one.code == code]

    def then(self, number: int) -> str:
        """Return the class of a rule."""
        return self.rules.rules[number - 1].then

    def placed(self, answer: Answer) -> list[Place]:
        """Return where the rules and terms of an answer stand, in that order."""
        owners = self.view.owners if self.view else ()
        numbers = [owners[n - 1].number if owners else n - 1 for n in answer.rules]
        if self.view and not numbers:
            numbers = self.view.absent(answer.subject)
        result = [self.places.rules[number] for number in numbers]
        result += [self.places.terms[label] for label in answer.terms]
        return [*dict.fromkeys(result)]

    def name(self, number: int) -> str:
        """Return what answers call a rule."""
        return self.view.names[number - 1] if self.view else f"rule {number}"

    def bits_of(self, number: int) -> RuleBits:
        """Return the functions that a rule uses on each axis, as bits."""
        return self.grid.of[number - 1]

    def pairs(self, *, alike: bool) -> list[tuple[int, int]]:
        """Return the pairs of rules of one class, or of two."""
        pairs = itertools.combinations(self.numbers, 2)
        result = [p for p in pairs if (self.then(p[0]) == self.then(p[1])) is alike]
        owners = self.view.owners if self.view else [*self.numbers]  # not two ways
        return [p for p in result if owners[p[0] - 1] != owners[p[1] - 1]]

    def strengths(
        self, rules: Rules, point: Point, numbers: Iterable[int]
    ) -> dict[int, Between]:
        """Return between which numbers the strengths of some rules lie."""
        if self.view is not None:
            return self.view.strengths(point, numbers)
        known = [*dict.fromkeys(numbers)]
        some = tuple(rules.rules[number - 1] for number in known)
        result = strengths(rules._replace(rules=some), point)
        return {n: (one, one) for n, one in zip(known, result, strict=True)}

    def fire(self, *numbers: int) -> bool:
        """Return whether each of some rules fires somewhere."""
        return all(self.grid.fires(self.bits_of(n)) for n in numbers)

    def rivals(self, number: int) -> list[int]:
        """Return the rules of other classes."""
        return [n for n in self.numbers if self.then(n) != self.then(number)]

    def beats(self, rule: int | RuleBits, numbers: Iterable[int]) -> bool:
        """Return whether a rule is somewhere stronger than each of some others."""
        mine = self.bits_of(rule) if isinstance(rule, int) else rule
        rivals = [self.bits_of(number) for number in numbers]
        if self.rules.semantics.conjunction == "minimum":
            return self.grid.wins(mine, rivals)
        if any(self.grid.is_below(mine, rival) for rival in rivals):
            return False
        text = "under product only one rule that hides another is recognised here"
        raise UndecidedError(text)

    def tie(self, one: int, other: int) -> bool:
        """Return whether two rules tie as the strongest, on more than a surface."""
        rivals = [self.bits_of(n) for n in self.numbers if n not in (one, other)]
        return self.ties.tie(self.bits_of(one), self.bits_of(other), rivals)

    def never(self, is_so: bool, otherwise: str) -> None:
        """Refuse what happens although it never should, if inputs are free."""
        if is_so and not self.is_free:
            text = "combinations share inputs, which needs more than cells"
            raise UndecidedError(text)
        require(not is_so, otherwise)


def counted(answer: Answer, counts: Mapping[str, float], number: int) -> None:
    """Refuse an answer that counts otherwise, or not so many things."""
    entries = {m.name: m.value for m in answer.measures if m.name in counts}
    require(len(entries) == number, "a count is missing")
    wrong = [name for name, value in entries.items() if value != counts[name]]
    require(not wrong, f"counted otherwise here: {', '.join(wrong)}")


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


def point_of(coordinates: Sequence[Coordinate]) -> dict[str, Fraction]:
    """Return a point whose decimal, hexadecimal and exact digits are one number."""
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


def check_point(
    case: Case,
    report: Report,
    coordinates: Sequence[Coordinate],
    claims: Sequence[Claim],
) -> Point:
    """Return a point of the domain at which the claims hold."""
    point = point_of(coordinates)
    inputs = {v.name for v in case.model.variables if not v.parts}
    is_whole = point.keys() == inputs
    require(is_whole, "the point does not have a value of every input")
    require(_is_within(case, point), "the point lies outside the domain")
    for claim in claims:
        entries = zip(claim._fields, claim, strict=True)
        text = ", ".join(f"{name} {value}" for name, value in entries if value)
        require(holds(case, claim, point), f"not so: {text}")
        report.counts["claims evaluated again"] += 1
    return point


def check_spans(case: Case, region: Sequence[Span]) -> None:
    """Refuse a region of unknown variables or with swapped ends."""
    for span in region:
        require(span.variable in case.variables, f"no variable {span.variable!r}")
        is_ordered = span.low is None or span.high is None or span.low <= span.high
        require(is_ordered, f"the region's ends in {span.variable!r} are swapped")


def corners(case: Case, region: Sequence[Span], point: Point) -> Iterator[Point]:
    """Yield corners and the middle of a region, other inputs at three values.

    A corner lies just above the lower ends, for these may belong to a neighbour.
    """
    spans = {span.variable: span for span in region}
    if not spans or not case.is_free:
        return
    ends: dict[str, tuple[Fraction, Fraction, Fraction]] = {}
    for name, side in case.sides.items():
        span = spans.get(name, Span(name, None, None))
        low = Fraction(side.low if span.low is None else span.low)
        high = Fraction(side.high if span.high is None else span.high)
        middle = (low + high) / 2 if name in spans else point[name]
        ends[name] = low + (high - low) / 2**30, high, middle
    ways = itertools.product((0, 1), repeat=len(spans))
    chosen = [*itertools.islice(ways, 32), (2,) * len(spans)]
    for way, other in itertools.product(chosen, range(3)):
        places = dict.fromkeys(ends, other) | dict(zip(spans, way, strict=True))
        result = {name: ends[name][place] for name, place in places.items()}
        if _is_within(case, result):
            yield result


def _is_within(case: Case, point: Point) -> bool:
    values = {name: value_of(case.variables[name], point) for name in case.sides}
    return all(side.low <= values[n] <= side.high for n, side in case.sides.items())


def holds(case: Case, claim: Claim, point: Point) -> bool:
    """Return whether a claim holds at a point, evaluated in fractions.

    Raises:
        DoesNotHoldError: If it is no claim about this model.
    """
    model = case.representations.get(claim.of)
    if model is None:
        raise DoesNotHoldError(f"there are no {claim.of} to claim something of")
    coordinates = {n for n, one in zip(claim._fields, claim, strict=True) if one}
    alien = coordinates - {"kind", "of", *FIELDS[claim.kind].split(" ")}
    require(not alien, f"a claim of kind {claim.kind} has no {', '.join(alien)}")
    if claim.kind == "decides":
        return answer_of(model, point) == claim.label
    level = None if claim.level is None else fraction(claim.level)
    if claim.kind == "degree":
        low, high = _degree(model, claim, point)
        return level is not None and low <= level <= high
    if not isinstance(model, Rules):
        raise DoesNotHoldError("a tree has no strengths")
    numbers = [*claim.rules, *claim.rivals]
    is_known = all(1 <= n <= len(model.rules) for n in numbers)
    require(is_known, "a claim of an unknown rule")
    if claim.kind == "covered":
        numbers = [*range(1, len(model.rules) + 1)]
    every = case.strengths(model, point, numbers)
    ours = [every[n] for n in claim.rules]
    rivals = [every[n] for n in claim.rivals]
    require(bool(ours) or claim.kind == "covered", "a claim of no rule")
    if claim.kind == "strength":
        return level is not None and ours[0][0] <= level <= ours[0][1]
    if claim.kind == "covered":
        return _certain((ZERO, ZERO), max(every.values()))
    least = min(low for low, _ in ours), min(high for _, high in ours)
    most = max(low for low, _ in ours), max(high for _, high in ours)
    top = max(rivals, default=(ZERO, ZERO))[0], max([h for _, h in rivals] or [ZERO])
    if claim.kind == "beats":
        return _certain(top, least)  # alone: it fires
    if claim.kind == "ties":
        is_one = least == most and least[0] == least[1]
        return is_one and (not rivals or _certain(top, least))
    if level is None:
        raise DoesNotHoldError("a claim without its level")
    if claim.kind == "below":
        return most[1] == level == 0 or _certain(most, (level, level))
    return least[0] >= level or not _certain(least, (level, level))


def _certain(one: Between, other: Between) -> bool:
    """Return whether one number is below another one, each between two ends."""
    if one[1] < other[0]:
        return True
    if one[0] < other[1]:
        raise UndecidedError("two strengths are too near to distinguish")
    return False


def _degree(model: Model, claim: Claim, point: Point) -> Between:
    """Return the degree of the term that a claim is about."""
    for variable in model.variables:
        for term in variable.terms:
            if (variable.name, term.name) == (claim.variable, claim.term):
                return bounds(term.function, value_of(variable, point))
    raise DoesNotHoldError("a claim of an unknown term")
