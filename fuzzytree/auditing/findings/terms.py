"""Questions about terms: are they reached, used, well shaped, and distinguished?

The ranges of variables serve other questions too.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Final, NamedTuple

from msgspec.structs import replace

from fuzzytree.auditing.decide.lines import lines_of
from fuzzytree.auditing.engine.domain import span
from fuzzytree.auditing.engine.measures import (
    Bounds,
    CurveAxis,
    Excess,
    Overlap,
    area,
    curve_axis,
    dips,
    excesses,
    heights,
    most_shared,
    overlap,
    walk,
)
from fuzzytree.auditing.engine.pieces import pieces
from fuzzytree.auditing.engine.states import (
    Bracket,
    Computed,
    Declined,
    Proved,
    Span,
    State,
    counted,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    FactValue,
    Measure,
    TermName,
)
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model import LR, Points, RuleBase, Shape, Term, Variable, questions
from fuzzytree.numerics import exact_degree, outwards
from fuzzytree.rechecking import listed


class VariableRange(NamedTuple):
    """The values of a variable on the domain; of an open range without the least."""

    variable: Variable
    low: Fraction
    high: Fraction
    is_open: bool
    values: Sequence[Fraction] = ()  # of rows, one by one; empty of numbers

    def line(self, *terms: Term) -> CurveAxis:
        """Return the curves of some terms on the range."""
        shapes = [term.shape for term in terms]
        return curve_axis(shapes, self.low, self.high, is_open=self.is_open)


def ranges(subject: Subject) -> tuple[VariableRange, ...]:
    """Return the range of each variable that has terms; none if the domain is empty.

    Terms whose curves are known between bounds are left out.
    """
    bounds = subject.bounds.terms if subject.bounds else {}
    result: list[VariableRange] = []
    for of in whole_ranges(subject):
        name, terms = of.variable.name, of.variable.terms
        plain = tuple(term for term in terms if (name, term.name) not in bounds)
        if plain:
            result.append(of._replace(variable=replace(of.variable, terms=plain)))
    return tuple(result)


def whole_ranges(subject: Subject) -> tuple[VariableRange, ...]:
    """Return the same with all terms; of inexact ones the lower line.

    Terms that only the view has, such as `very high`, are left out.
    """
    result: list[VariableRange] = []
    for variable in subject.rules.variables:
        if subject.bounds is not None:
            variable = replace(variable, terms=tuple(_own_terms(subject, variable)))
        low, high = span(variable, subject.domain)
        if low > high:
            return ()
        side = subject.domain.side(variable.name)
        if variable.terms:
            is_open = side is not None and side.is_open and low == side.low < high
            values = listed(side)
            result.append(VariableRange(variable, low, high, is_open, values))
    return tuple(result)


def _own_terms(subject: Subject, variable: Variable) -> Iterator[Term]:
    """Yield the terms of a variable that the system has."""
    assert subject.system is not None  # nothing else has bounds
    for one in subject.system.variables:
        if one.name == variable.name:
            names = {label.name for label in one.terms}
            yield from (term for term in variable.terms if term.name in names)


def measure(name: str, value: Bounds, unit: str = "") -> Measure:
    """Return a number between bounds as a measure."""
    return Measure(name, value.nearest, value.exact, unit)


def term_name(variable: Variable, term: Term) -> str:
    """Return how sentences name a term."""
    return f"term {term.name!r} of {variable.name!r}"


def labels_of(of: VariableRange, *terms: Term) -> tuple[TermName, ...]:
    """Return terms of a variable as answers name them."""
    return tuple(TermName(of.variable.name, term.name) for term in terms)


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether terms are reached, and used."""
    yield from _unused(subject)
    yield from _heights(subject, whole_ranges(subject))


# --- FT401: is the term reached?


def _heights(subject: Subject, whole: Sequence[VariableRange]) -> Iterator[AuditAnswer]:
    level = Fraction(subject.settings.level)
    bounds = subject.bounds.terms if subject.bounds else {}
    clean, lowest = 0, Fraction(1)
    for of in whole:
        for term in of.variable.terms:
            subject.clock.check()
            lines = bounds.get((of.variable.name, term.name))
            axis = of.line(term)
            ((height, at),) = heights(axis)
            if of.values:
                height, at = _height_of_values(of, term)
            if lines is not None:
                upper = of.line(Term(term.name, lines.upper))
                height = Bounds(height.low, heights(upper)[0][0].high)
            if height.low >= level:
                clean, lowest = clean + 1, min(lowest, height.low)
            elif lines is not None and height.high:
                yield _low_curve(of, term, height, is_low=height.high < level)
            else:
                yield _low_term(of, term, height, at, axis.pieces)
    if clean:
        proof = Proved(f"the height of {clean} terms was found")
        measures = (Measure("lowest height", float(lowest), str(lowest)),)
        facts = {"count": clean, "level": float(level)}
        yield audit_answer(
            "FT401.reached", "terms", proof, measures=measures, facts=facts
        )


def _height_of_values(of: VariableRange, term: Term) -> tuple[Bounds, Fraction]:
    """Return the largest degree of the values of rows, and the first with it."""
    degrees = [exact_degree(term.shape, value) for value in of.values]
    most = max(degrees)
    return Bounds(most, most), of.values[degrees.index(most)]


def _low_term(
    of: VariableRange, term: Term, height: Bounds, at: Fraction, cells: int
) -> AuditAnswer:
    how = f"its curve was visited in {counted(cells, 'stretch', 'stretches')}, in each "
    how += "of which it is monotone"
    message = "FT401.low" if height.high else "FT401.empty"
    facts, height_of = {"at": float(at)}, measure("height", height)
    return _of_term(message, of, term, Proved(how), facts, height_of)


def _low_curve(
    of: VariableRange, term: Term, height: Bounds, *, is_low: bool
) -> AuditAnswer:
    """Return that a curve between bounds is hardly reached, or may be."""
    name = term_name(of.variable, term)
    low, high = outwards(height.low)[0], outwards(height.high)[1]
    why = "its curve is known between two lines of points"
    state = Bracket(f"the largest degree of {name}", low, high, why)
    measures = Measure("height at least", low), Measure("height at most", high)
    message = "FT401.low-curve" if is_low else "FT401.open"
    return _of_term(message, of, term, state, {}, *measures)


def _of_term(
    message: str,
    of: VariableRange,
    term: Term,
    state: State,
    facts: Mapping[str, FactValue],
    *measures: Measure,
) -> AuditAnswer:
    """Return an answer about a term on its range."""
    return audit_answer(
        message,
        term_name(of.variable, term),
        state,
        terms=labels_of(of, term),
        measures=measures,
        facts={"low": float(of.low), "high": float(of.high), **facts},
    )


# --- FT404: is it used?


def _unused(subject: Subject) -> Iterator[AuditAnswer]:
    terms, variables, propositions = _inventory(subject)
    used = set(propositions)
    needed = {variable for variable, _ in used}
    for variable in subject.rules.variables:
        if variable.name in needed:
            needed.update(part.input for part in variable.parts)
    proof = Proved(f"{counted(len(propositions), 'proposition')} of all rules read")
    for name in variables:
        if name not in needed:
            own = tuple(TermName(name, term) for of, term in terms if of == name)
            yield audit_answer("FT404.unused", f"variable {name!r}", proof, terms=own)
    idle = [one for one in terms if one[0] in needed and one not in used]
    for name, term in idle:
        title, own = f"term {term!r} of {name!r}", (TermName(name, term),)
        yield audit_answer("FT404.unused", title, proof, terms=own)
    count = sum(name in needed for name in variables)
    of_terms = sum(one in used for one in terms)
    measures = Measure("variables in use", count), Measure("terms in use", of_terms)
    yield audit_answer("FT404.used", "terms and variables", proof, measures=measures)


def _inventory(
    subject: Subject,
) -> tuple[list[tuple[str, str]], list[str], list[tuple[str, str]]]:
    """Return all terms, all variables, and the terms that rules use, one by one.

    Of a system whose rules all take part the system itself is read: its view may lack
    rules and terms.
    """
    system = subject.system
    if system is not None and subject.policy.decision == "all":
        return (
            [(one.name, label.name) for one in system.variables for label in one.terms],
            [one.name for one in system.variables],
            [
                (question.variable, question.term or "")
                for block in system.blocks
                for rule in block.rules
                for question in questions(rule.when)
            ],
        )
    return (
        [(v.name, term.name) for v in subject.rules.variables for term in v.terms],
        [v.name for v in subject.rules.variables],
        [*used_terms(subject.rules)],
    )


def used_terms(rules: RuleBase) -> Iterator[tuple[str, str]]:
    """Yield the variables and terms that rules use, as often as they do."""
    for proposition in (
        proposition for rule in rules.rules for proposition in rule.when
    ):
        for term in proposition.terms:
            yield proposition.variable, term


# --- FT402: is it well shaped?

SHALLOW: Final = Fraction(1, 100)
"""Excesses and dips of degrees below this are counted and not listed."""


def shape_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether terms are well shaped."""
    sound = shallow = 0
    every = ranges(subject)
    for of in every:
        for term in of.variable.terms:
            subject.clock.check()
            found = [*_defects(of, term)]
            defects = [one for one in found if one is not None]
            shallow += len(found) - len(defects)
            sound += not defects
            yield from defects
    if not sound and not shallow:
        return
    how = "values and polynomials were evaluated in fractions, along all pieces"
    measures = (Measure("smaller excesses and dips", shallow),)
    facts = {"count": sound}
    is_curved = any(isinstance(t.shape, LR) for of in every for t in of.variable.terms)
    state = Computed(how) if is_curved else Proved(how)
    yield audit_answer("FT402.sound", "terms", state, measures=measures, facts=facts)


def _defects(of: VariableRange, term: Term) -> Iterator[AuditAnswer | None]:
    """Yield the defects of a term's shape, None for each too small one."""
    if not of.values:
        for excess in excesses(term.shape, of.low, of.high):
            yield _excess(of, term, excess) if excess.depth >= SHALLOW else None
        yield from _dips(of, term)
    if isinstance(term.shape, Points) and max(term.shape.degrees) < 1.0:
        yield _subnormal(of, term, max(term.shape.degrees))
    share = None if of.values else share_inside(term.shape, of)
    if share is not None and 0 < share.high < Fraction(1, 2):
        yield _outlying(of, term, share)


def _excess(of: VariableRange, term: Term, excess: Excess) -> AuditAnswer:
    message = "FT402.above" if excess.is_above else "FT402.below"
    how = Computed("the polynomial was evaluated in fractions, along all pieces")
    depth = Measure("excess", float(excess.depth))
    at = Measure("place of the excess", float(excess.at), unit=of.variable.unit)
    ends = {"low": float(excess.low), "high": float(excess.high)}
    span = Span(of.variable.name, ends["low"], ends["high"])
    return replace(_of_term(message, of, term, how, ends, depth, at), region=(span,))


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
    how = f"its curve was evaluated at the ends of {axis.pieces} parts"
    measures = (
        Measure("peaks", len(deep) + 1),
        Measure("depth of the deepest dip", float(depth)),
        Measure("place of the deepest dip", float(valley), unit=of.variable.unit),
    )
    ends = {"low": float(left), "high": float(right)}
    span = Span(of.variable.name, ends["low"], ends["high"])
    facts = {**ends, "bottom": bottom.nearest}
    answer = _of_term("FT402.peaks", of, term, Proved(how), facts, *measures)
    yield replace(answer, region=(span,))


def _subnormal(of: VariableRange, term: Term, most: float) -> AuditAnswer:
    largest = Measure("largest degree", most, str(Fraction(most)))
    how = Proved("the largest degree of its points")
    return _of_term("FT402.subnormal", of, term, how, {}, largest)


def _outlying(of: VariableRange, term: Term, share: Bounds) -> AuditAnswer:
    how = Proved("its area was integrated in fractions, on the domain and in all")
    inside = measure("share of its area on the domain", share)
    return _of_term("FT402.outside", of, term, how, {}, inside)


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
    parts: list[Bounds] = []
    for low, high in (
        (max(first.high, of.low), min(last.low, of.high)),
        (first.high, last.low),
    ):
        is_empty = low >= high
        zero = Bounds(Fraction(0), Fraction(0))
        parts.append(zero if is_empty else area(lines_of(shape, low, high)))
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
            if most[a, b] < limit and not of.values:
                apart += 1
                continue
            subject.clock.check()
            one, other = terms[a], terms[b]
            if len(pieces(one.shape)) + len(pieces(other.shape)) > _MOST_PIECES:
                yield _too_large(of, one, other)
                continue
            if of.values:
                shared = overlap_of_values(one.shape, other.shape, of.values)
            else:
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


def overlap_of_values(one: Shape, other: Shape, values: Sequence[Fraction]) -> Overlap:
    """Return how much two terms share where rows have only some values.

    Each value counts alike: areas are sums over the values.

    Example:
        >>> from fuzzytree.model import Band
        >>> both = Band(None, 1.0), Band(0.5, None)
        >>> overlap_of_values(*both, [*map(Fraction, range(3))]).jaccard
        Bounds(low=Fraction(1, 3), high=Fraction(1, 3))
    """
    pairs = [(exact_degree(one, x), exact_degree(other, x)) for x in values]
    least = [min(pair) for pair in pairs]
    shared, joined = sum(least, Fraction(0)), sum(map(max, pairs), Fraction(0))
    most = max(least)
    return Overlap(
        Bounds(shared, shared),
        Bounds(joined, joined),
        Bounds(most, most),
        values[least.index(most)],
        (),
        all(a <= b for a, b in pairs),
        all(a >= b for a, b in pairs),
    )


def _overlapping(
    of: VariableRange,
    one: Term,
    other: Term,
    shared: Overlap,
    jaccard: Bounds,
    limit: Fraction,
) -> AuditAnswer:
    name = f"terms {one.name!r} and {other.name!r} of {of.variable.name!r}"
    message, facts = "FT403.similar", dict[str, str]()
    if shared.is_within and shared.is_around:
        message = "FT403.equal"
    elif shared.is_within or shared.is_around:
        message = "FT403.within"
        inner, outer = (one, other) if shared.is_within else (other, one)
        facts = {"inner": inner.name, "outer": outer.name}
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
    return audit_answer(
        message,
        name,
        state,
        terms=labels_of(of, one, other),
        measures=tuple(measures),
        facts=facts,
    )


def _too_large(of: VariableRange, one: Term, other: Term) -> AuditAnswer:
    name = f"terms {one.name!r} and {other.name!r} of {of.variable.name!r}"
    state = Declined("FTD05", f"their curves have more than {_MOST_PIECES} pieces")
    terms = labels_of(of, one, other)
    return audit_answer("FT403.declined", name, state, terms=terms)


def _other_pairs(count: int, apart: int, points: int, limit: float) -> AuditAnswer:
    more = max(count - MOST_SHOWN, 0)
    facts = {"overlap": limit} | ({"more": more} if more else {})
    facts |= {"points": points} if points else {}
    how = "areas were enclosed on cells, and integrated in fractions where near"
    measures = (
        Measure("pairs apart", apart),
        Measure("pairs not listed", more),
        Measure("pairs without area", points),
    )
    message, proof = "FT403.unlisted" if more else "FT403.others", Proved(how)
    return audit_answer(
        message, "pairs of terms", proof, measures=measures, facts=facts
    )
