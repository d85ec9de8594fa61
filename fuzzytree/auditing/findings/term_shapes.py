"""Is each membership function sound, and can two of them be distinguished?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from typing import Final

from fuzzytree.auditing.engine.measures import (
    Bounds,
    Excess,
    Overlap,
    area,
    curve_axis,
    dips,
    excesses,
    local_polynomial,
    most_shared,
    overlap,
    walk,
)
from fuzzytree.auditing.engine.pieces import RuleCurve, pieces
from fuzzytree.auditing.engine.states import (
    Bracket,
    Declined,
    Proved,
    Span,
    State,
    counted,
    short,
)
from fuzzytree.auditing.findings.codes import finding, note
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.auditing.findings.terms import (
    VariableRange,
    labels_of,
    measure,
    ranges,
    term_name,
)
from fuzzytree.model import Points, Shape, Term

SHALLOW: Final = Fraction(1, 100)
"""Excesses and dips of degrees below this are counted and not listed."""


def shape_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether terms are well shaped."""
    sound = shallow = 0
    for of in ranges(subject):
        for term in of.variable.terms:
            subject.clock.check()
            every = [*_defects(of, term)]
            defects = [one for one in every if one is not None]
            shallow += len(every) - len(defects)
            sound += not defects
            yield from defects
    if not sound and not shallow:
        return
    shapes = "1 term has" if sound == 1 else f"{sound} terms have"
    text = f"{shapes} no defect of shape of {short(SHALLOW)} or more"
    how = "turning points and crossings of 0 and 1 were found for each piece"
    measures = (Measure("smaller excesses and dips", shallow),)
    yield note("FT402", "terms", text, Proved(how), measures=measures)


def _defects(of: VariableRange, term: Term) -> Iterator[AuditAnswer | None]:
    """Yield the defects of a term's shape, None for each too small one."""
    for excess in excesses(term.shape, of.low, of.high):
        yield _excess(of, term, excess) if excess.depth >= SHALLOW else None
    yield from _dips(of, term)
    if isinstance(term.shape, Points) and max(term.shape.degrees) < 1.0:
        yield _subnormal(of, term, max(term.shape.degrees))
    share = share_inside(term.shape, of)
    if share is not None and 0 < share.high < Fraction(1, 2):
        yield _outlying(of, term, share)


def _defect(
    of: VariableRange,
    term: Term,
    text: str,
    how: str,
    measures: tuple[Measure, ...],
    region: tuple[Span, ...] = (),
) -> AuditAnswer:
    name, terms = term_name(of.variable, term), labels_of(of, term)
    facts = "FT402", name, f"{name} {text}", Proved(how)
    return finding(*facts, terms=terms, region=region, measures=measures)


def _excess(of: VariableRange, term: Term, excess: Excess) -> AuditAnswer:
    end = "above 1" if excess.is_above else "below 0"
    return _defect(
        of,
        term,
        f"is clipped: its polynomial goes {short(excess.depth)} {end} "
        f"between {short(excess.low)} and {short(excess.high)}",
        "the polynomial's turning points and crossings were isolated",
        (
            Measure("excess", float(excess.depth)),
            Measure("place of the excess", float(excess.at), unit=of.variable.unit),
        ),
        (Span(of.variable.name, float(excess.low), float(excess.high)),),
    )


def _dips(of: VariableRange, term: Term) -> Iterator[AuditAnswer | None]:
    axis = of.line(term)
    walked = [*walk(axis, 0)]
    deep = [*dips(walked, SHALLOW)]
    smaller = [*dips(walked, Fraction(1, 10**12))]
    yield from [None] * (len(smaller) - len(deep))
    if not deep:
        return
    depths = [min(a.low, c.low) - b.high for (a, _), (b, _), (c, _) in deep]
    depth = max(depths)
    (_, left), (bottom, valley), (_, right) = deep[depths.index(depth)]
    yield _defect(
        of,
        term,
        f"has {len(deep) + 1} peaks: between {short(left)} and {short(right)} "
        f"its degree falls to {short(bottom.nearest)}, at {short(valley)}",
        f"its curve was visited in {len(axis.cells.rank)} stretches, in each of which "
        "it is monotone",
        (
            Measure("peaks", len(deep) + 1),
            Measure("depth of the deepest dip", float(depth)),
            Measure("place of the deepest dip", float(valley), unit=of.variable.unit),
        ),
        (Span(of.variable.name, float(left), float(right)),),
    )


def _subnormal(of: VariableRange, term: Term, most: float) -> AuditAnswer:
    return _defect(
        of,
        term,
        f"has no point of degree 1: its largest degree anywhere is {short(most)}",
        "the largest degree of its points",
        (Measure("largest degree", most, str(Fraction(most))),),
    )


def _outlying(of: VariableRange, term: Term, share: Bounds) -> AuditAnswer:
    return _defect(
        of,
        term,
        f"lies outside of the domain for the most part: {short(share.nearest)} of its "
        f"area is from {short(of.low)} to {short(of.high)}",
        "its area was integrated in fractions, on the domain and in all",
        (measure("share of its area on the domain", share),),
    )


def share_inside(shape: Shape, of: VariableRange) -> Bounds | None:
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
    curve, parts = RuleCurve(shape), list[Bounds]()
    for low, high in (
        (max(first.high, of.low), min(last.low, of.high)),
        (first.high, last.low),
    ):
        if low >= high:
            parts.append(Bounds(Fraction(0), Fraction(0)))
            continue
        parts.append(
            area(
                curve_axis([shape], low, high),
                lambda _, at: local_polynomial(curve, at),
            )
        )
    part, whole = parts
    if whole.low <= 0:
        return None
    return Bounds(part.low / whole.high, min(part.high / whole.low, Fraction(1)))


MOST_SHOWN: Final = 20
"""The most pairs of terms that are listed one by one."""

_MOST_PIECES = 4_000  # of two curves whose overlap is computed


def overlap_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer which terms share so much area that they are hard to distinguish."""
    limit = Fraction(subject.settings.overlap)
    overlaps: list[tuple[Fraction, AuditAnswer]] = []
    apart = points = 0
    for of in ranges(subject):
        terms = of.variable.terms
        shapes = [term.shape for term in terms]
        most = most_shared(shapes, float(of.low), float(of.high))
        for a, b in itertools.combinations(range(len(terms)), 2):
            if most[a, b] < limit:
                apart += 1
                continue
            subject.clock.check()
            one, other = terms[a], terms[b]
            if len(pieces(one.shape)) + len(pieces(other.shape)) > _MOST_PIECES:
                yield _too_large(of, one, other)
                continue
            shared = overlap(of.line(one, other))
            jaccard = shared.jaccard
            if jaccard is None:
                points += 1
                continue
            if jaccard.high < limit:
                apart += 1
                continue
            overlaps.append(
                (-jaccard.low, _overlapping(of, one, other, shared, jaccard, limit))
            )
    overlaps.sort(key=lambda pair: pair[0])
    yield from (answer for _, answer in overlaps[:MOST_SHOWN])
    if overlaps or apart or points:
        yield _other_pairs(len(overlaps), apart, points, float(limit))


def _overlapping(
    of: VariableRange,
    one: Term,
    other: Term,
    shared: Overlap,
    jaccard: Bounds,
    limit: Fraction,
) -> AuditAnswer:
    name = f"terms {one.name!r} and {other.name!r} of {of.variable.name!r}"
    relation = ""
    if shared.is_within and shared.is_around:
        relation = "; they are equal"
    elif shared.is_within or shared.is_around:
        inner, outer = (one, other) if shared.is_within else (other, one)
        relation = f"; {inner.name!r} is nowhere above {outer.name!r}"
    elif shared.crossings:
        at, height = max(shared.crossings, key=lambda pair: pair[1].low)
        relation = f"; they cross at {short(at)} with degree {short(height.nearest)}"
    state: State = Proved("the areas were integrated in fractions, piece by piece")
    if jaccard.low < limit:
        state = Bracket(
            f"the share of their area that {name} have in common",
            float(jaccard.low),
            float(jaccard.high),
            "the areas end at places that are no fractions",
        )
    measures = [
        measure("shared area by joined area", jaccard),
        measure("possibility", shared.possibility),
    ]
    if shared.crossings:
        at, height = max(shared.crossings, key=lambda pair: pair[1].low)
        measures.append(measure("crossing height", height))
        measures.append(Measure("crossing", float(at), unit=of.variable.unit))
    text = f"{name} are hard to distinguish: they share {_share(jaccard)} of their "
    text += f"area{relation}"
    terms = labels_of(of, one, other)
    return finding("FT403", name, text, state, terms=terms, measures=tuple(measures))


def _share(jaccard: Bounds) -> str:
    text = short(jaccard.nearest)
    return "more than 0.9999" if text == "1" and jaccard.low < 1 else text


def _too_large(of: VariableRange, one: Term, other: Term) -> AuditAnswer:
    name = f"terms {one.name!r} and {other.name!r} of {of.variable.name!r}"
    reason = f"their curves have more than {_MOST_PIECES} pieces"
    text, terms = f"{name} were not compared: {reason}", labels_of(of, one, other)
    return note("FT403", name, text, Declined("FTD05", reason), terms=terms)


def _other_pairs(count: int, apart: int, points: int, limit: float) -> AuditAnswer:
    fewer, more = (counted(n, "pair") for n in (apart, count - MOST_SHOWN))
    parts = [f"{fewer} of terms share less than {short(limit)} of their area"]
    if count > MOST_SHOWN:
        parts.append(f"{more} besides those listed share more")
    if points:
        parts.append(f"{counted(points, 'pair')} have no area on the domain")
    how = "areas were enclosed on cells, and integrated in fractions where near"
    measures = (
        Measure("pairs apart", apart),
        Measure("pairs not listed", max(count - MOST_SHOWN, 0)),
        Measure("pairs without area", points),
    )
    build = finding if count > MOST_SHOWN else note
    return build(
        "FT403", "pairs of terms", "; ".join(parts), Proved(how), measures=measures
    )
