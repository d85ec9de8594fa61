"""Questions about terms: are they reached, used, well shaped, and distinguished?

The ranges of variables serve other questions too.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Final, NamedTuple

from msgspec.structs import replace

from fuzzytree.auditing.decide.answers import ONE, ZERO
from fuzzytree.auditing.decide.lines import (
    Between,
    Lines,
    combined,
    constant,
    lines_of,
)
from fuzzytree.auditing.decide.measures import (
    Bounds,
    Overlap,
    area,
    dips,
    height,
    most_shared,
    overlap,
    walk,
)
from fuzzytree.auditing.engine.domain import span
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
from fuzzytree.model import (
    LR,
    Points,
    RuleBase,
    Shape,
    Side,
    Term,
    Variable,
    checkpoint,
    questions,
)
from fuzzytree.numerics import exact_degree, outwards
from fuzzytree.rechecking import listed


class VariableRange(NamedTuple):
    """The values of a variable on the domain; of an open range without the least."""

    variable: Variable
    low: Fraction
    high: Fraction
    is_open: bool
    values: Sequence[Fraction] = ()  # of rows, one by one; empty of numbers

    def lines(self, shape: Shape) -> Between:
        """Return a curve as lines; of single values each is level for a length of 1.

        Where the least value is left out the limit stands for it.
        """
        if self.values:
            degrees = tuple(exact_degree(shape, x) for x in self.values)
            x = tuple(map(Fraction, range(len(degrees) + 1)))
            lines = Lines(x, (*degrees, degrees[-1]), degrees, degrees)
            return Between(lines, lines)
        lower, upper = result = lines_of(shape, self.low, self.high)
        if not self.is_open:
            return result
        opened = lower._replace(at=(*lower.after[:1], *lower.at[1:]))
        if result.is_exact:
            return Between(opened, opened)
        return Between(opened, upper._replace(at=(*upper.after[:1], *upper.at[1:])))

    def value(self, place: Fraction) -> Fraction:
        """Return the value at a place of the lines."""
        return self.values[int(place)] if self.values else place


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


def measure(name: str, value: Bounds) -> Measure:
    """Return a number between bounds as a measure: their middle."""
    exact = str(value.low) if value.low == value.high else None
    return Measure(name, float((value.low + value.high) / 2), exact)


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
            (low, high), at = height(of.lines(term.shape))
            if lines is not None:
                high = height(of.lines(lines.upper))[0].high
            if low >= level:
                clean, lowest = clean + 1, min(lowest, low)
            elif high and (lines is not None or low < high):
                yield _low_curve(of, term, Bounds(low, high), is_low=high < level)
            else:
                yield _low_term(of, term, Bounds(low, high), of.value(at))
    if clean:
        proof = Proved(f"the height of {clean} terms was found")
        measures = (Measure("lowest height", float(lowest), str(lowest)),)
        facts = {"count": clean, "level": float(level)}
        yield audit_answer(
            "FT401.reached", "terms", proof, measures=measures, facts=facts
        )


def _low_term(of: VariableRange, term: Term, most: Bounds, at: Fraction) -> AuditAnswer:
    proof = Proved("its degree was evaluated wherever it may be largest")
    message = "FT401.low" if most.high else "FT401.empty"
    facts = {"at": float(at)}
    return _of_term(message, of, term, proof, facts, measure("height", most))


def _low_curve(
    of: VariableRange, term: Term, most: Bounds, *, is_low: bool
) -> AuditAnswer:
    """Return that a curve between bounds is hardly reached, or may be."""
    name = term_name(of.variable, term)
    low, high = outwards(most.low)[0], outwards(most.high)[1]
    why = "its curve is known between two functions of lines"
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


def _along(
    message: str,
    of: VariableRange,
    term: Term,
    state: State,
    ends: tuple[Fraction, Fraction],
    facts: Mapping[str, FactValue],
    measures: Sequence[Measure],
) -> AuditAnswer:
    """Return an answer about a term on a part of its range."""
    low, high = map(float, ends)
    facts = {"low": low, "high": high, **facts}
    answer = _of_term(message, of, term, state, facts, *measures)
    return replace(answer, region=(Span(of.variable.name, low, high),))


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
        yield from _excesses(of, term)
        yield from _dips(of, term)
    if isinstance(term.shape, Points) and max(term.shape.degrees) < 1.0:
        yield _subnormal(of, term, max(term.shape.degrees))
    share = None if of.values else share_inside(term.shape, of)
    if share is not None and 0 < share.high < Fraction(1, 2):
        yield _outlying(of, term, share)


_SAMPLES: Final = 256  # of the polynomial of a side


def _excesses(of: VariableRange, term: Term) -> Iterator[AuditAnswer | None]:
    """Yield where the polynomials of an LR set leave [0, 1] before they are clipped."""
    if not isinstance(term.shape, LR):
        return
    mean = Fraction(term.shape.mean)
    for side, sign in ((term.shape.left, -1), (term.shape.right, 1)):
        spread = sign * Fraction(side.spread)
        ends = sorted((mean, mean + spread))
        low, high = max(ends[0], of.low), min(ends[1], of.high)
        if low >= high:
            continue
        checkpoint()
        x = tuple(low + (high - low) * n / _SAMPLES for n in range(_SAMPLES + 1))
        values = [_polynomial(side, (one - mean) / spread) for one in x]
        above, below = [value - 1 for value in values], [-value for value in values]
        for message, over in (("FT402.above", above), ("FT402.below", below)):
            lines = Lines(x, (*over,), (*over[:-1],), (*over[1:],))
            cut = combined([lines, constant(ZERO, low, high)], max)
            for depth, run in itertools.groupby(cut.pieces(), lambda one: any(one[2:])):
                if depth:
                    yield _excess(of, term, message, [*run])


def _polynomial(side: Side, t: Fraction) -> Fraction:
    """Return the degree of a side up to its spread, as if it were not clipped."""
    total = ZERO
    for coefficient in reversed(side.curve):
        total = total * (2 * t - 1) + Fraction(coefficient)
    return 1 - t * total


def _excess(
    of: VariableRange, term: Term, message: str, run: Sequence[tuple[Fraction, ...]]
) -> AuditAnswer | None:
    depth, at = max((most, -x) for a, b, p, q in run for most, x in ((p, a), (q, b)))
    if depth < SHALLOW:
        return None
    how = Computed("the polynomial was evaluated in fractions")
    measures = (
        Measure("excess", float(depth)),
        Measure("place of the excess", float(-at), unit=of.variable.unit),
    )
    return _along(message, of, term, how, (run[0][0], run[-1][1]), {}, measures)


def _dips(of: VariableRange, term: Term) -> Iterator[AuditAnswer | None]:
    walked = walk(of.lines(term.shape))
    deep = dips(walked, SHALLOW)
    yield from [None] * (len(dips(walked, Fraction(1, 10**12))) - len(deep))
    if not deep:
        return
    depths = [min(a.low, c.low) - b.high for (a, _), (b, _), (c, _) in deep]
    depth = max(depths)
    (_, left), (bottom, valley), (_, right) = deep[depths.index(depth)]
    how = Proved("its curve was evaluated at the ends of all its lines")
    measures = (
        Measure("peaks", len(deep) + 1),
        Measure("depth of the deepest dip", float(depth)),
        Measure("place of the deepest dip", float(valley), unit=of.variable.unit),
    )
    facts = {"bottom": float((bottom.low + bottom.high) / 2)}
    yield _along("FT402.peaks", of, term, how, (left, right), facts, measures)


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
    knots = [Fraction(knot) for knot in shape.knots()]
    if len(set(knots)) < 2 or of.low == of.high:
        return None
    first, last = min(knots), max(knots)
    if any(exact_degree(shape, beyond) for beyond in (first - 1, last + 1)):
        return None
    part, (low, high) = Bounds(ZERO, ZERO), area(lines_of(shape, first, last))
    if first < of.high and of.low < last:
        inside = lines_of(shape, max(first, of.low), min(last, of.high))
        part = area(inside)
    return Bounds(part.low / high, min(part.high / low, ONE)) if low > 0 else None


MOST_SHOWN: Final = 20
"""The most pairs of terms that are listed one by one."""

_MOST_KNOTS: Final = 4_000  # of two curves whose overlap is computed


def overlap_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer which terms share so much area that they are hard to distinguish."""
    limit = Fraction(subject.settings.overlap)
    overlaps: list[tuple[Fraction, AuditAnswer]] = []
    apart = points = 0
    for of in ranges(subject):
        curves = [(term, of.lines(term.shape)) for term in of.variable.terms]
        most = most_shared([lines for _, lines in curves])
        for a, b in itertools.combinations(range(len(curves)), 2):
            if most[a, b] < limit:
                apart += 1
                continue
            subject.clock.check()
            (one, mine), (other, theirs) = curves[a], curves[b]
            if len(one.shape.knots()) + len(other.shape.knots()) > _MOST_KNOTS:
                yield _too_large(of, one, other)
                continue
            shared = overlap(mine, theirs)
            if shared is None:
                points += 1
            elif shared.jaccard.high < limit:
                apart += 1
            else:
                answer = _overlapping(of, one, other, shared, limit)
                overlaps.append((-shared.jaccard.low, answer))
    overlaps.sort(key=lambda pair: pair[0])
    yield from (answer for _, answer in overlaps[:MOST_SHOWN])
    if overlaps or apart or points:
        yield _other_pairs(len(overlaps), apart, points, float(limit))


def _overlapping(
    of: VariableRange, one: Term, other: Term, shared: Overlap, limit: Fraction
) -> AuditAnswer:
    name = f"terms {one.name!r} and {other.name!r} of {of.variable.name!r}"
    message, facts = "FT403.similar", dict[str, str]()
    if shared.is_within and shared.is_around:
        message = "FT403.equal"
    elif shared.is_within or shared.is_around:
        message = "FT403.within"
        inner, outer = (one, other) if shared.is_within else (other, one)
        facts = {"inner": inner.name, "outer": outer.name}
    state: State = Proved("the areas were integrated in fractions, line by line")
    if shared.jaccard.low < limit:
        state = Bracket(
            f"the share of their area that {name} have in common",
            float(shared.jaccard.low),
            float(shared.jaccard.high),
            "their curves are known between two functions of lines",
        )
    measures = [
        measure("shared area by joined area", shared.jaccard),
        measure("possibility", shared.possibility),
    ]
    if shared.crossing and not of.values:
        degree, at = shared.crossing
        measures.append(measure("crossing height", Bounds(degree, degree)))
        measures.append(Measure("crossing", float(at), unit=of.variable.unit))
    terms = labels_of(of, one, other)
    return audit_answer(
        message, name, state, terms=terms, measures=tuple(measures), facts=facts
    )


def _too_large(of: VariableRange, one: Term, other: Term) -> AuditAnswer:
    name = f"terms {one.name!r} and {other.name!r} of {of.variable.name!r}"
    state = Declined("FTD05", f"their curves have more than {_MOST_KNOTS} pieces")
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
