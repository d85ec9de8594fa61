"""Questions about terms: are they reached, used, well shaped, and distinguished?

The ranges of variables serve other questions too.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType
from typing import Final, NamedTuple

from msgspec.structs import replace

from fuzzytree.auditing.decide import measures, states
from fuzzytree.auditing.decide.answers import ONE, ZERO
from fuzzytree.auditing.decide.axes import function_lines
from fuzzytree.auditing.decide.domain import span
from fuzzytree.auditing.decide.lines import Between, Lines, combined, constant, lines_of
from fuzzytree.auditing.decide.measures import Bounds
from fuzzytree.auditing.decide.states import Bracket, Computed, Proved, State, counted
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, Measure, TermName
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model import (
    LR,
    MembershipFunction,
    Points,
    RuleBase,
    Shape,
    Term,
    Variable,
    questions,
)
from fuzzytree.numerics import exact_degree, outwards
from fuzzytree.rechecking import listed

_NEAR: Final = Fraction(1, 10**9)  # bounds of a height that are shown as one number
_INEXACT: Final = "curves are known between functions of lines"


class VariableRange(NamedTuple):
    """A variable with its terms and its values on the domain.

    Attributes:
        curves: The functions of the terms that have no exact shape.
        is_open: Whether the least value is left out.
        values: Those of rows, one by one; empty of numbers.
    """

    variable: Variable
    low: Fraction
    high: Fraction
    curves: Mapping[str, MembershipFunction] = MappingProxyType({})
    is_open: bool = False
    values: Sequence[Fraction] = ()

    @property
    def terms(self) -> list[Term]:
        """The terms with an exact shape."""
        return [one for one in self.variable.terms if one.name not in self.curves]

    def lines(self, shape: Shape) -> Between:
        """Return a curve as lines; of single values each is level for a length of 1.

        Where the least value is left out the limit stands for it.
        """
        if self.values:
            degrees = tuple(exact_degree(shape, x) for x in self.values)
            x = tuple(map(Fraction, range(len(degrees) + 1)))
            lines = Lines(x, (*degrees, degrees[-1]), degrees, degrees)
            return Between(lines, lines)
        result = lines_of(shape, self.low, self.high)
        if self.is_open:
            lower, upper = (
                one._replace(at=one.after[:1] + one.at[1:]) for one in result
            )
            result = Between(lower, lower if result.is_exact else upper)
        return result


def ranges(subject: Subject) -> tuple[VariableRange, ...]:
    """Return the range of each variable that has terms; none if the domain is empty.

    Terms without an exact shape, of a system, come with their function.
    """
    result: list[VariableRange] = []
    for variable in subject.rules.variables:
        name, side = variable.name, subject.domain.side(variable.name)
        low, high = span(variable, subject.domain)
        if low > high:
            return ()
        curves = {label: f for (of, label), f in subject.curves.items() if of == name}
        inexact = {label for of, label in subject.inexact if of == name} - {*curves}
        terms = [term for term in variable.terms if term.name not in inexact]
        if terms:
            variable = replace(variable, terms=tuple(terms))
            is_open = side is not None and side.is_open and low == side.low < high
            row = variable, low, high, curves, is_open, listed(side)
            result.append(VariableRange(*row))
    return tuple(result)


def _terms(variables: Sequence[Variable]) -> list[tuple[str, str]]:
    return [(one.name, term.name) for one in variables for term in one.terms]


def measure(name: str, value: Bounds) -> Measure:
    """Return a number between bounds as a measure: their middle."""
    exact = str(value.low) if value.low == value.high else None
    return Measure(name, float((value.low + value.high) / 2), exact)


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether terms are reached, and used."""
    yield from _unused(subject)
    yield from _heights(subject)


# --- FT401: is the term reached?


def _heights(subject: Subject) -> Iterator[AuditAnswer]:
    level = Fraction(subject.settings.level)
    clean, lowest = 0, ONE
    for of in ranges(subject):
        for term in of.variable.terms:
            subject.budget.check()
            curve = of.curves.get(term.name)
            lines = of.lines(term.shape)
            if curve is not None:
                lines = function_lines(curve, of.low, of.high)
            (low, high), at = measures.height(lines)
            if low >= level:
                clean, lowest = clean + 1, min(lowest, low)
            elif high and (curve is not None or high >= level or high - low > _NEAR):
                message = "FT401.low-curve" if high < level else "FT401.open"
                what = f"the largest degree of {_title(of, [term])}"
                state = Bracket(what, outwards(low)[0], outwards(high)[1], _INEXACT)
                ends = {"height at least": state.low, "height at most": state.high}
                numbers = itertools.starmap(Measure, ends.items())
                yield _about(message, of, [term], state, {}, *numbers)
            else:
                message = "FT401.low" if high else "FT401.empty"
                how = Proved("its degree was evaluated wherever it may be largest")
                place = {"at": float(of.values[int(at)] if of.values else at)}
                height = measure("height", Bounds(low, high))
                yield _about(message, of, [term], how, place, height)
    if clean:
        proof = Proved(f"the height of {clean} terms was found")
        least = (measure("lowest height", Bounds(lowest, lowest)),)
        facts = {"count": clean, "level": float(level)}
        yield audit_answer("FT401.reached", "terms", proof, measures=least, facts=facts)


def _title(of: VariableRange, terms: Sequence[Term]) -> str:
    """Return how sentences name a term, or two."""
    noun = "terms" if len(terms) > 1 else "term"
    names = " and ".join(repr(term.name) for term in terms)
    return f"{noun} {names} of {of.variable.name!r}"


def _about(
    message: str,
    of: VariableRange,
    terms: Sequence[Term],
    state: State,
    facts: Mapping[str, str | float],
    *numbers: Measure,
    ends: tuple[Fraction, Fraction] | None = None,
) -> AuditAnswer:
    """Return an answer about terms on their range, or from one end to another."""
    name = of.variable.name
    low, high = map(float, ends or (of.low, of.high))
    return audit_answer(
        message,
        _title(of, terms),
        state,
        terms=tuple(TermName(name, term.name) for term in terms),
        measures=numbers,
        facts={"low": low, "high": high, **facts},
        region=(states.Span(name, low, high),) if ends else (),
    )


# --- FT404: is it used?


def _unused(subject: Subject) -> Iterator[AuditAnswer]:
    system, variables = subject.system, subject.rules.variables
    propositions = [*used_terms(subject.rules)]
    if system is not None and subject.policy.decision == "all":
        variables = system.variables  # the view may lack rules and terms
        rules = (rule for block in system.blocks for rule in block.rules)
        asked = (one for rule in rules for one in questions(rule.when))
        propositions = [(one.variable, one.term or "") for one in asked]
    terms, used = _terms(variables), set(propositions)
    needed = {variable for variable, _ in used}
    for variable in subject.rules.variables:
        if variable.name in needed:
            needed.update(part.input for part in variable.parts)
    idle = [
        (f"variable {one.name!r}", _terms([one]))
        for one in variables
        if one.name not in needed
    ]
    rest = [pair for pair in terms if pair[0] in needed and pair not in used]
    idle += [(f"term {pair[1]!r} of {pair[0]!r}", [pair]) for pair in rest]
    proof = Proved(f"{counted(len(propositions), 'proposition')} of all rules read")
    for title, pairs in idle:
        own = tuple(TermName(*pair) for pair in pairs)
        yield audit_answer("FT404.unused", title, proof, terms=own)
    counts = (
        Measure("variables in use", sum(one.name in needed for one in variables)),
        Measure("terms in use", sum(pair in used for pair in terms)),
    )
    yield audit_answer("FT404.used", "terms and variables", proof, measures=counts)


def used_terms(rules: RuleBase) -> Iterator[tuple[str, str]]:
    """Yield the variables and terms that rules use, as often as they do."""
    for rule in rules.rules:
        for proposition in rule.when:
            yield from ((proposition.variable, term) for term in proposition.terms)


# --- FT402: is it well shaped?

SHALLOW: Final = Fraction(1, 100)
"""Excesses and dips of degrees below this are counted and not listed."""

_SAMPLES: Final = 256  # of the polynomial of a side


def shape_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether terms are well shaped."""
    sound = shallow = 0
    is_curved = False
    for of in ranges(subject):
        for term in of.terms:
            subject.budget.check()
            every = [*_defects(of, term)]
            defects = [one for one in every if one is not None]
            shallow += len(every) - len(defects)
            sound += not defects
            is_curved |= isinstance(term.shape, LR)
            yield from defects
    if sound or shallow:
        how = "values and polynomials were evaluated in fractions, along all lines"
        state = Computed(how) if is_curved else Proved(how)
        small = (Measure("smaller excesses and dips", shallow),)
        facts = {"count": sound}
        yield audit_answer("FT402.sound", "terms", state, measures=small, facts=facts)


def _defects(of: VariableRange, term: Term) -> Iterator[AuditAnswer | None]:
    """Yield the defects of a term's shape, None for each too small one."""
    shape, share = term.shape, None
    if not of.values:
        if isinstance(shape, LR):
            yield from _excesses(of, term, shape)
        yield from _dips(of, term)
        share = share_inside(shape, of)
    if isinstance(shape, Points) and max(shape.degrees) < 1.0:
        most = Fraction(max(shape.degrees))
        how = Proved("the largest degree of its points")
        largest = measure("largest degree", Bounds(most, most))
        yield _about("FT402.subnormal", of, [term], how, {}, largest)
    if share is not None and 0 < share.high < Fraction(1, 2):
        how = Proved("its area was integrated in fractions, on the domain and in all")
        inside = measure("share of its area on the domain", share)
        yield _about("FT402.outside", of, [term], how, {}, inside)


def _excesses(of: VariableRange, term: Term, shape: LR) -> Iterator[AuditAnswer | None]:
    """Yield where the polynomials of a set leave [0, 1] before they are clipped."""
    mean = Fraction(shape.mean)
    how = Computed("the polynomial was evaluated in fractions")
    for side, sign in ((shape.left, -1), (shape.right, 1)):
        spread = sign * Fraction(side.spread)
        low, high = sorted((mean, mean + spread))
        low, high = max(low, of.low), min(high, of.high)
        if low >= high:
            continue
        x = tuple(low + (high - low) * n / _SAMPLES for n in range(_SAMPLES + 1))
        first, step = (low - mean) / spread, (high - low) / spread / _SAMPLES
        values = tuple(
            _polynomial(side.curve, first + n * step) for n in range(_SAMPLES + 1)
        )
        lines = Lines(x, values, values[:-1], values[1:])
        for message, over in (("FT402.above", lines), ("FT402.below", lines.negated())):
            if max(over.at) <= 1:
                continue
            cut = combined([over, constant(ONE, low, high)], max)
            runs = itertools.groupby(cut.pieces(), lambda piece: max(piece[2:]) > 1)
            for run in [[*pieces] for is_over, pieces in runs if is_over]:
                ends = run[0][0], run[-1][1]
                most, at = max(
                    (v, -x) for a, b, p, q in run for v, x in ((p, a), (q, b))
                )
                numbers = (
                    Measure("excess", float(most - 1)),
                    Measure("place of the excess", float(-at), unit=of.variable.unit),
                )
                answer = _about(message, of, [term], how, {}, *numbers, ends=ends)
                yield answer if most - 1 >= SHALLOW else None


def _polynomial(curve: Sequence[float], t: Fraction) -> Fraction:
    """Return the degree of a side up to its spread, as if it were not clipped."""
    total = ZERO
    for coefficient in reversed(curve):
        total = total * (2 * t - 1) + Fraction(coefficient)
    return 1 - t * total


def _dips(of: VariableRange, term: Term) -> Iterator[AuditAnswer | None]:
    lines = of.lines(term.shape)
    deep = measures.dips(lines, SHALLOW)
    smaller = measures.dips(lines, Fraction(1, 10**12))
    yield from [None] * (len(smaller) - len(deep))
    if not deep:
        return
    depths = [min(a, c) - b for (_, a), (_, b), (_, c) in deep]
    (left, _), (valley, bottom), (right, _) = deep[depths.index(max(depths))]
    how = Proved("its curve was evaluated at the ends of all its lines")
    numbers = (
        Measure("peaks", len(deep) + 1),
        Measure("depth of the deepest dip", float(max(depths))),
        Measure("place of the deepest dip", float(valley), unit=of.variable.unit),
    )
    facts, ends = {"bottom": float(bottom)}, (left, right)
    yield _about("FT402.peaks", of, [term], how, facts, *numbers, ends=ends)


def share_inside(shape: Shape, of: VariableRange) -> Bounds | None:
    """Return the share of a curve's area that lies on a range; None of no area."""
    knots = [Fraction(knot) for knot in shape.knots()]
    if len(set(knots)) < 2 or of.low == of.high:
        return None
    first, last = min(knots), max(knots)
    if any(exact_degree(shape, beyond) for beyond in (first - 1, last + 1)):
        return None
    part, (low, high) = Bounds(ZERO, ZERO), measures.area(lines_of(shape, first, last))
    if first < of.high and of.low < last:
        ends = max(first, of.low), min(last, of.high)
        part = measures.area(lines_of(shape, *ends))
    return Bounds(part.low / high, min(part.high / low, ONE)) if low > 0 else None


# --- FT403: is it distinguished from others?

MOST_SHOWN: Final = 20
"""The most pairs of terms that are listed one by one."""

_MOST_KNOTS: Final = 4_000  # of two curves whose overlap is computed


def overlap_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer which terms share so much area that they are hard to distinguish."""
    limit = Fraction(subject.settings.overlap)
    overlaps: list[tuple[Fraction, AuditAnswer]] = []
    apart = points = 0
    for of in ranges(subject):
        terms = of.terms
        curves = [of.lines(term.shape) for term in terms]
        most = measures.most_shared(curves)
        for a, b in itertools.combinations(range(len(terms)), 2):
            if most[a, b] < limit:
                apart += 1
                continue
            subject.budget.check()
            pair = terms[a], terms[b]
            if sum(len(term.shape.knots()) for term in pair) > _MOST_KNOTS:
                why = f"their curves have more than {_MOST_KNOTS} pieces"
                state = states.Declined("FTD05", why)
                yield _about("FT403.declined", of, pair, state, {})
                continue
            shared = measures.overlap(curves[a], curves[b])
            if shared is None:
                points += 1
            elif shared.jaccard.high < limit:
                apart += 1
            else:
                answer = _overlapping(of, pair, shared, limit)
                overlaps.append((-shared.jaccard.low, answer))
    overlaps.sort(key=lambda pair: pair[0])
    yield from (answer for _, answer in overlaps[:MOST_SHOWN])
    more = max(len(overlaps) - MOST_SHOWN, 0)
    counts = {"more": more, "points": points}
    facts = {"overlap": float(limit)} | {name: n for name, n in counts.items() if n}
    if overlaps or apart or points:
        yield audit_answer(
            "FT403.unlisted" if more else "FT403.others",
            "pairs of terms",
            Proved(
                "areas were bounded on cells, and integrated in fractions where near"
            ),
            measures=(
                Measure("pairs apart", apart),
                Measure("pairs not listed", more),
                Measure("pairs without area", points),
            ),
            facts=facts,
        )


def _overlapping(
    of: VariableRange,
    pair: tuple[Term, Term],
    shared: measures.Overlap,
    limit: Fraction,
) -> AuditAnswer:
    message, facts = "FT403.similar", dict[str, str]()
    if shared.is_within and shared.is_around:
        message = "FT403.equal"
    elif shared.is_within or shared.is_around:
        inner, outer = pair if shared.is_within else pair[::-1]
        message, facts = "FT403.within", {"inner": inner.name, "outer": outer.name}
    state: State = Proved("the areas were integrated in fractions, line by line")
    low, high = shared.jaccard
    if low < limit:
        what = f"the share of their area that {_title(of, pair)} have in common"
        state = Bracket(what, float(low), float(high), _INEXACT)
    numbers = [
        measure("shared area by joined area", shared.jaccard),
        measure("possibility", shared.possibility),
    ]
    if shared.crossing and not of.values:
        degree, at = shared.crossing
        numbers.append(measure("crossing height", Bounds(degree, degree)))
        numbers.append(Measure("crossing", float(at), unit=of.variable.unit))
    return _about(message, of, pair, state, facts, *numbers)
