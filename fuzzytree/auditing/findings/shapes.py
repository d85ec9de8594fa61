"""Is the shape of a term sound? One peak, within 0 and 1, and on the domain."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Final

from fuzzytree.auditing.engine.measures import (
    Bounds,
    Excess,
    area,
    dips,
    line,
    local,
    outside,
    walk,
)
from fuzzytree.auditing.engine.pieces import Element, pieces
from fuzzytree.auditing.engine.states import Proved, Span, short
from fuzzytree.auditing.findings.ranges import (
    Range,
    labels_of,
    measure,
    ranges,
    term_name,
)
from fuzzytree.auditing.findings.records import Answer, Measure
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model.rulebase import Points, Shape, Term

SHALLOW: Final = Fraction(1, 100)
"""Excesses and dips of degrees below this are counted and not told one by one."""


def answers(subject: Subject) -> Iterator[Answer]:
    """Answer whether terms are well shaped."""
    sound = shallow = 0
    for of in ranges(subject):
        for term in of.variable.terms:
            subject.clock.check()
            found = [*_defects(of, term)]
            told = [one for one in found if one is not None]
            shallow += len(found) - len(told)
            sound += not told
            yield from told
    if not sound and not shallow:
        return
    shapes = "1 term has" if sound == 1 else f"{sound} terms have"
    yield Answer(
        "FT402",
        "terms",
        f"{shapes} no defect of shape of {short(SHALLOW)} or more",
        Proved("turning points and crossings of 0 and 1 were found for each piece"),
        is_finding=False,
        measures=(Measure("smaller excesses and dips", shallow),),
    )


def _defects(of: Range, term: Term) -> Iterator[Answer | None]:
    """Yield the defects of a term's shape, None for each that is too small to tell."""
    for excess in outside(term.shape, of.low, of.high):
        yield _excess(of, term, excess) if excess.depth >= SHALLOW else None
    yield from _dips(of, term)
    if isinstance(term.shape, Points) and max(term.shape.degrees) < 1.0:
        yield _subnormal(of, term, max(term.shape.degrees))
    share = inside(term.shape, of)
    if share is not None and 0 < share.high < Fraction(1, 2):
        yield _outlying(of, term, share)


def _defect(
    of: Range,
    term: Term,
    text: str,
    how: str,
    measures: tuple[Measure, ...],
    region: tuple[Span, ...] = (),
) -> Answer:
    name = term_name(of.variable, term)
    return Answer(
        "FT402",
        name,
        f"{name} {text}",
        Proved(how),
        is_finding=True,
        severity="warning",
        terms=labels_of(of, term),
        region=region,
        measures=measures,
    )


def _excess(of: Range, term: Term, found: Excess) -> Answer:
    end = "above 1" if found.is_above else "below 0"
    return _defect(
        of,
        term,
        f"is clipped: its polynomial goes {short(found.depth)} {end} "
        f"between {short(found.low)} and {short(found.high)}",
        "the polynomial's turning points and crossings were isolated",
        (
            Measure("excess", float(found.depth)),
            Measure("place of the excess", float(found.at), unit=of.variable.unit),
        ),
        (Span(of.variable.name, float(found.low), float(found.high)),),
    )


def _dips(of: Range, term: Term) -> Iterator[Answer | None]:
    made = of.line(term)
    walked = [*walk(made, 0)]
    told = [*dips(walked, SHALLOW)]
    smaller = [*dips(walked, Fraction(1, 10**12))]
    yield from [None] * (len(smaller) - len(told))
    if not told:
        return
    depths = [min(a.low, c.low) - b.high for (a, _), (b, _), (c, _) in told]
    depth = max(depths)
    (_, left), (bottom, valley), (_, right) = told[depths.index(depth)]
    yield _defect(
        of,
        term,
        f"has {len(told) + 1} peaks: between {short(left)} and {short(right)} "
        f"its degree falls to {short(bottom.nearest)}, at {short(valley)}",
        f"its curve was visited in {len(made.cells.rank)} stretches, in each of which "
        "it is monotone",
        (
            Measure("peaks", len(told) + 1),
            Measure("depth of the deepest dip", float(depth)),
            Measure("place of the deepest dip", float(valley), unit=of.variable.unit),
        ),
        (Span(of.variable.name, float(left), float(right)),),
    )


def _subnormal(of: Range, term: Term, most: float) -> Answer:
    return _defect(
        of,
        term,
        f"has no point of degree 1: its largest degree anywhere is {short(most)}",
        "the largest degree of its points",
        (Measure("largest degree", most, str(Fraction(most))),),
    )


def _outlying(of: Range, term: Term, share: Bounds) -> Answer:
    return _defect(
        of,
        term,
        f"lies outside of the domain for the most part: {short(share.nearest)} of its "
        f"area is from {short(of.low)} to {short(of.high)}",
        "its area was integrated in fractions, on the domain and in all",
        (measure("share of its area on the domain", share),),
    )


def inside(shape: Shape, of: Range) -> Bounds | None:
    """Return the share of a curve's area that lies on a range.

    Returns:
        None if the curve has no end, or no area, or the range is a point.
    """
    laid = pieces(shape)
    first, last = laid[0], laid[-1]
    if first.high is None or last.low is None or of.low == of.high:
        return None
    if any(first.polynomial) or any(last.polynomial):
        return None
    if first.high == last.low:
        return None
    curve, parts = Element(shape), list[Bounds]()
    for low, high in (
        (max(first.high, of.low), min(last.low, of.high)),
        (first.high, last.low),
    ):
        if low >= high:
            parts.append(Bounds(Fraction(0), Fraction(0)))
            continue
        parts.append(area(line([shape], low, high), lambda _, at: local(curve, at)))
    part, whole = parts
    if whole.low <= 0:
        return None
    return Bounds(part.low / whole.high, min(part.high / whole.low, Fraction(1)))
