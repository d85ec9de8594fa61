"""Can two terms of a variable be told apart, by the area that they share?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from typing import Final

from fuzzytree.auditing.engine.measures import Bounds, Overlap, most_shared, overlap
from fuzzytree.auditing.engine.pieces import pieces
from fuzzytree.auditing.engine.states import (
    Bracket,
    Declined,
    Proved,
    State,
    counted,
    short,
)
from fuzzytree.auditing.findings.ranges import Range, labels_of, measure, ranges
from fuzzytree.auditing.findings.records import Answer, Measure
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model.rulebase import Term

MOST_SHOWN: Final = 20
"""The most pairs of terms that are told one by one."""

_MOST_PIECES = 4_000  # of two curves whose overlap is asked for


def answers(subject: Subject) -> Iterator[Answer]:
    """Answer which terms share so much of their area that they are hard to tell."""
    limit = Fraction(subject.settings.overlap)
    found: list[tuple[Fraction, Answer]] = []
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
            found.append(
                (-jaccard.low, _overlapping(of, one, other, shared, jaccard, limit))
            )
    found.sort(key=lambda pair: pair[0])
    yield from (answer for _, answer in found[:MOST_SHOWN])
    if found or apart or points:
        yield _other_pairs(len(found), apart, points, float(limit))


def _overlapping(
    of: Range,
    one: Term,
    other: Term,
    shared: Overlap,
    jaccard: Bounds,
    limit: Fraction,
) -> Answer:
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
    return Answer(
        "FT403",
        name,
        f"{name} are hard to tell apart: they share "
        f"{_share(jaccard)} of their area{relation}",
        state,
        is_finding=True,
        severity="info",
        terms=labels_of(of, one, other),
        measures=tuple(measures),
    )


def _share(jaccard: Bounds) -> str:
    text = short(jaccard.nearest)
    return "more than 0.9999" if text == "1" and jaccard.low < 1 else text


def _too_large(of: Range, one: Term, other: Term) -> Answer:
    name = f"terms {one.name!r} and {other.name!r} of {of.variable.name!r}"
    reason = f"their curves have more than {_MOST_PIECES} pieces"
    return Answer(
        "FT403",
        name,
        f"{name} were not compared: {reason}",
        Declined("FTD05", reason),
        is_finding=False,
        terms=labels_of(of, one, other),
    )


def _other_pairs(found: int, apart: int, points: int, limit: float) -> Answer:
    fewer, more = (counted(n, "pair") for n in (apart, found - MOST_SHOWN))
    parts = [f"{fewer} of terms share less than {short(limit)} of their area"]
    if found > MOST_SHOWN:
        parts.append(f"{more} besides those told share more")
    if points:
        parts.append(f"{counted(points, 'pair')} have no area on the domain")
    return Answer(
        "FT403",
        "pairs of terms",
        "; ".join(parts),
        Proved("areas were enclosed on cells, and integrated in fractions where near"),
        is_finding=found > MOST_SHOWN,
        measures=(
            Measure("pairs apart", apart),
            Measure("pairs not told one by one", max(found - MOST_SHOWN, 0)),
            Measure("pairs without area", points),
        ),
    )
