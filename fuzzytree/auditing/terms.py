"""Questions about terms: are they reached, well shaped, told apart, and used?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Final, NamedTuple

from fuzzytree.auditing.records import Answer, Label, Measure
from fuzzytree.auditing.subject import Subject
from fuzzytree.proving.axes import Element
from fuzzytree.proving.curves import pieces
from fuzzytree.proving.measures import (
    Bounds,
    Excess,
    Line,
    Overlap,
    area,
    dips,
    heights,
    line,
    local,
    most_shared,
    outside,
    overlap,
    walk,
)
from fuzzytree.proving.states import Bracket, Declined, Proved, Span, State
from fuzzytree.proving.variables import span
from fuzzytree.rulebase import Points, Shape, Term, Variable
from fuzzytree.system import questions

SHALLOW: Final = Fraction(1, 100)
"""Excesses and dips of degrees below this are counted and not told one by one."""

MOST_SHOWN: Final = 20
"""The most pairs of terms that are told one by one."""

_MOST_PIECES = 4_000  # of two curves whose overlap is asked for


class Range(NamedTuple):
    """The values of a variable on the domain.

    Attributes:
        variable: The variable.
        low: The least.
        high: The largest.
        is_open: Whether the least is left out.
    """

    variable: Variable
    low: Fraction
    high: Fraction
    is_open: bool

    def line(self, *terms: Term) -> Line:
        """Return the curves of some terms on the range."""
        shapes = [term.shape for term in terms]
        return line(shapes, self.low, self.high, is_open=self.is_open)


def ranges(subject: Subject) -> tuple[Range, ...]:
    """Return the range of each variable that has terms; none if the domain is empty."""
    found: list[Range] = []
    for variable in subject.rules.variables:
        low, high = span(variable, subject.domain)
        if low > high:
            return ()
        side = subject.domain.side(variable.name)
        if variable.terms:
            is_open = side is not None and side.is_open and low == side.low < high
            found.append(Range(variable, low, high, is_open))
    return tuple(found)


def answers(subject: Subject) -> Iterator[Answer]:
    """Answer whether terms are reached, well shaped, told apart, and used."""
    whole = ranges(subject)
    yield from _heights(subject, whole)
    yield from _shapes(subject, whole)
    yield from _overlaps(subject, whole)
    yield from _unused(subject)


def short(number: float | Fraction) -> str:
    """Return a number with as many digits as a sentence needs.

    Example:
        >>> short(Fraction(1, 3))
        '0.3333'
    """
    return f"{float(number):.4g}"


def measure(name: str, value: Bounds, unit: str = "") -> Measure:
    """Return a number between bounds as a measure."""
    return Measure(name, value.nearest, value.exact, unit)


def _name(variable: Variable, term: Term) -> str:
    return f"term {term.name!r} of {variable.name!r}"


def _label(of: Range, *terms: Term) -> tuple[Label, ...]:
    return tuple(Label(of.variable.name, term.name) for term in terms)


# --- FT401: is the term reached?


def _heights(subject: Subject, whole: Sequence[Range]) -> Iterator[Answer]:
    level = Fraction(subject.settings.level)
    clean, lowest = 0, Fraction(1)
    for of in whole:
        for term in of.variable.terms:
            subject.clock.check()
            made = of.line(term)
            ((height, at),) = heights(made)
            if height.low >= level:
                clean, lowest = clean + 1, min(lowest, height.low)
                continue
            yield _low_term(of, term, height, at, len(made.cells.rank))
    if clean:
        terms = "1 term reaches" if clean == 1 else f"{clean} terms reach"
        yield Answer(
            "FT401",
            "terms",
            f"{terms} a degree of {short(level)} or more",
            Proved(f"the height of {clean} terms was found"),
            is_finding=False,
            measures=(Measure("lowest height", float(lowest), str(lowest)),),
        )


def _low_term(
    of: Range, term: Term, height: Bounds, at: Fraction, cells: int
) -> Answer:
    name = _name(of.variable, term)
    where = f"from {short(of.low)} to {short(of.high)}"
    text = f"its largest degree {where} is {short(height.nearest)}, at {short(at)}"
    sentence = f"{name} is hardly reached: {text}"
    if not height.high:
        sentence = f"{name} is empty: its degree is 0 {where}"
    return Answer(
        "FT401",
        name,
        sentence,
        Proved(
            f"its curve is monotone in each of {cells} stretches, which were visited"
        ),
        is_finding=True,
        severity="warning" if height.high else "error",
        terms=_label(of, term),
        measures=(measure("height", height),),
    )


def _visited(cells: int) -> str:
    return f"its curve is monotone in each of {cells} stretches, which were visited"


# --- FT402: is its shape sound?


def _shapes(subject: Subject, whole: Sequence[Range]) -> Iterator[Answer]:
    sound = shallow = 0
    for of in whole:
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
    name = _name(of.variable, term)
    return Answer(
        "FT402",
        name,
        f"{name} {text}",
        Proved(how),
        is_finding=True,
        severity="warning",
        terms=_label(of, term),
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
        _visited(len(made.cells.rank)),
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


# --- FT403: can two terms be told apart?


def _overlaps(subject: Subject, whole: Sequence[Range]) -> Iterator[Answer]:
    limit = Fraction(subject.settings.overlap)
    found: list[tuple[Fraction, Answer]] = []
    apart = points = 0
    for of in whole:
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
        terms=_label(of, one, other),
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
        terms=_label(of, one, other),
    )


def _other_pairs(found: int, apart: int, points: int, limit: float) -> Answer:
    parts = [f"{_pairs(apart)} of terms share less than {short(limit)} of their area"]
    if found > MOST_SHOWN:
        parts.append(f"{_pairs(found - MOST_SHOWN)} besides those told share more")
    if points:
        parts.append(f"{_pairs(points)} have no area on the domain")
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


def _pairs(count: int) -> str:
    return _count(count, "pair")


# --- FT404: is it used?


def _unused(subject: Subject) -> Iterator[Answer]:
    terms, variables, clauses = _inventory(subject)
    asked = set(clauses)
    needed = {variable for variable, _ in asked}
    for variable in subject.rules.variables:
        if variable.name in needed:
            needed.update(part.input for part in variable.parts)
    proof = Proved(f"{_count(len(clauses), 'question')} of all rules read")
    for name in variables:
        if name not in needed:
            yield Answer(
                "FT404",
                f"variable {name!r}",
                f"no rule asks variable {name!r}",
                proof,
                is_finding=True,
                severity="info",
                terms=tuple(Label(name, term) for of, term in terms if of == name),
            )
    idle = [one for one in terms if one[0] in needed and one not in asked]
    for name, term in idle:
        yield Answer(
            "FT404",
            f"term {term!r} of {name!r}",
            f"no rule asks term {term!r} of {name!r}",
            proof,
            is_finding=True,
            severity="info",
            terms=(Label(name, term),),
        )
    counts = (
        sum(name in needed for name in variables),
        sum(one in asked for one in terms),
    )
    yield Answer(
        "FT404",
        "terms and variables",
        f"rules ask {_count(counts[0], 'variable')} and {_count(counts[1], 'term')}",
        proof,
        is_finding=False,
        measures=(
            Measure("variables in use", counts[0]),
            Measure("terms in use", counts[1]),
        ),
    )


def _inventory(
    subject: Subject,
) -> tuple[list[tuple[str, str]], list[str], list[tuple[str, str]]]:
    """Return all terms, all variables, and what rules ask, question by question.

    Of a system whose rules all take part the system itself is read: its view may lack
    rules and terms.
    """
    system = subject.system
    if system is not None and subject.policy.decision == "all":
        return (
            [(one.name, label.name) for one in system.inputs for label in one.labels],
            [one.name for one in system.inputs],
            [
                (question.variable, question.label or "")
                for block in system.blocks
                for rule in block.rules
                for question in questions(rule.when)
            ],
        )
    return (
        [(v.name, term.name) for v in subject.rules.variables for term in v.terms],
        [v.name for v in subject.rules.variables],
        [
            (clause.variable, term)
            for rule in subject.rules.rules
            for clause in rule.when
            for term in clause.terms
        ],
    )


def _count(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
