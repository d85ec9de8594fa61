"""Points of the domain, and whether what is claimed of them is so."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from fractions import Fraction

from fuzzytree.auditing.recheck.audit_records import Claim, Coordinate, Span, fraction
from fuzzytree.auditing.recheck.cases import Case
from fuzzytree.auditing.recheck.enclosing import Between, bounds
from fuzzytree.auditing.recheck.meaning import Point, answer_of, value_of
from fuzzytree.auditing.recheck.model_records import Model, Rules
from fuzzytree.auditing.recheck.outcomes import (
    DoesNotHoldError,
    Report,
    UndecidedError,
    require,
)
from fuzzytree.auditing.recheck.polynomials import ZERO

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
        return _certain(ZERO, max(every.values()))
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
        return most[1] == level == 0 or _certain(most, level)
    return least[0] >= level or not _certain(least, level)


def _certain(small: Between | Fraction, large: Between | Fraction) -> bool:
    """Return whether one number is below another one, each between two ends.

    Raises:
        UndecidedError: If the ends leave it open.
    """
    one = small if isinstance(small, tuple) else (small, small)
    other = large if isinstance(large, tuple) else (large, large)
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
                return bounds(term.shape, value_of(variable, point))
    raise DoesNotHoldError("a claim of an unknown term")
