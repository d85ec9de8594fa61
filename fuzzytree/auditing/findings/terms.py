"""Are terms reached, and used? Also the ranges of variables, for other questions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

from msgspec.structs import replace

from fuzzytree.auditing.engine.domain import span
from fuzzytree.auditing.engine.measures import Bounds, CurveAxis, curve_axis, heights
from fuzzytree.auditing.engine.pieces import RuleCurve, pieces
from fuzzytree.auditing.engine.states import Bracket, Proved, counted, short
from fuzzytree.auditing.findings.codes import finding, note
from fuzzytree.auditing.findings.records import AuditAnswer, Measure, TermName
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model import Term, Variable, questions
from fuzzytree.numerics import outwards


class VariableRange(NamedTuple):
    """The values of a variable on the domain; of an open range without the least."""

    variable: Variable
    low: Fraction
    high: Fraction
    is_open: bool

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
            result.append(VariableRange(variable, low, high, is_open))
    return tuple(result)


def _own_terms(subject: Subject, variable: Variable) -> Iterator[Term]:
    """Yield the terms of a variable that the system has."""
    assert subject.system is not None  # nothing else has bounds
    for one in subject.system.inputs:
        if one.name == variable.name:
            names = {label.name for label in one.labels}
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
            if lines is None and _is_full(of, term):
                clean += 1
                continue
            axis = of.line(term)
            ((height, at),) = heights(axis)
            if lines is not None:
                upper = of.line(Term(term.name, lines.upper))
                height = Bounds(height.low, heights(upper)[0][0].high)
            if height.low >= level:
                clean, lowest = clean + 1, min(lowest, height.low)
            elif lines is not None and height.high:
                yield _low_curve(of, term, height, is_low=height.high < level)
            else:
                yield _low_term(of, term, height, at, len(axis.cells.rank))
    if clean:
        terms = "1 term reaches" if clean == 1 else f"{clean} terms reach"
        text = f"{terms} a degree of {short(level)} or more"
        proof = Proved(f"the height of {clean} terms was found")
        measures = (Measure("lowest height", float(lowest), str(lowest)),)
        yield note("FT401", "terms", text, proof, measures=measures)


def _is_full(of: VariableRange, term: Term) -> bool:
    """Return whether a curve is 1 where one of its pieces ends, or the range does."""
    curve = RuleCurve(term.shape)
    ends = {of.low, of.high}
    for piece in pieces(term.shape):
        ends.update(end for end in (piece.low, piece.high) if end is not None)
    return any(
        curve.degree(end) == 1
        for end in ends
        if of.low <= end <= of.high and not (of.is_open and end == of.low)
    )


def _low_term(
    of: VariableRange, term: Term, height: Bounds, at: Fraction, cells: int
) -> AuditAnswer:
    name = term_name(of.variable, term)
    where = f"from {short(of.low)} to {short(of.high)}"
    text = f"its largest degree {where} is {short(height.nearest)}, at {short(at)}"
    sentence = f"{name} is hardly reached: {text}"
    if not height.high:
        sentence = f"{name} is empty: its degree is 0 {where}"
    how = f"its curve was visited in {counted(cells, 'stretch', 'stretches')}, in each "
    how += "of which it is monotone"
    terms, measures = labels_of(of, term), (measure("height", height),)
    low = finding("FT401", name, sentence, Proved(how), terms=terms, measures=measures)
    return replace(low, severity="warning") if height.high else low


def _low_curve(
    of: VariableRange, term: Term, height: Bounds, *, is_low: bool
) -> AuditAnswer:
    """Return that a curve between bounds is hardly reached, or may be."""
    name = term_name(of.variable, term)
    low, high = outwards(height.low)[0], outwards(height.high)[1]
    where = f"from {short(of.low)} to {short(of.high)}"
    begins = "is hardly reached" if is_low else "may hardly be reached"
    largest = f"its largest degree {where}"
    why = "its curve is known between two lines of points"
    text = f"{name} {begins}: {largest} lies between {short(low)} and {short(high)}"
    state = Bracket(f"the largest degree of {name}", low, high, why)
    measures = Measure("height at least", low), Measure("height at most", high)
    facts = "FT401", name, text, state
    terms = labels_of(of, term)
    return AuditAnswer(*facts, is_low, "warning", terms=terms, measures=measures)


# --- FT404: is it used?


def _unused(subject: Subject) -> Iterator[AuditAnswer]:
    terms, variables, clauses = _inventory(subject)
    used = set(clauses)
    needed = {variable for variable, _ in used}
    for variable in subject.rules.variables:
        if variable.name in needed:
            needed.update(part.input for part in variable.parts)
    proof = Proved(f"{counted(len(clauses), 'proposition')} of all rules read")
    for name in variables:
        if name not in needed:
            title = f"variable {name!r}"
            own = tuple(TermName(name, term) for of, term in terms if of == name)
            yield finding("FT404", title, f"no rule uses {title}", proof, terms=own)
    idle = [one for one in terms if one[0] in needed and one not in used]
    for name, term in idle:
        title, own = f"term {term!r} of {name!r}", (TermName(name, term),)
        yield finding("FT404", title, f"no rule uses {title}", proof, terms=own)
    count = sum(name in needed for name in variables)
    of_terms = sum(one in used for one in terms)
    text = f"rules use {counted(count, 'variable')} and {counted(of_terms, 'term')}"
    measures = Measure("variables in use", count), Measure("terms in use", of_terms)
    yield note("FT404", "terms and variables", text, proof, measures=measures)


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
