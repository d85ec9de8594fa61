"""The values of each variable on the domain, and names for what has terms there."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import NamedTuple

from msgspec.structs import replace

from fuzzytree.auditing.engine.domain import span
from fuzzytree.auditing.engine.measures import Bounds, Line, line
from fuzzytree.auditing.findings.records import Label, Measure
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model.rulebase import Term, Variable


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
    """Return the range of each variable that has terms; none if the domain is empty.

    Terms that are held between two lines are left out.
    """
    held = subject.held.terms if subject.held else {}
    found: list[Range] = []
    for of in whole_ranges(subject):
        name, terms = of.variable.name, of.variable.terms
        plain = tuple(term for term in terms if (name, term.name) not in held)
        if plain:
            found.append(of._replace(variable=replace(of.variable, terms=plain)))
    return tuple(found)


def whole_ranges(subject: Subject) -> tuple[Range, ...]:
    """Return the same with all terms; of those that are held the lower line.

    Terms that only the view has, such as `very high`, are left out.
    """
    found: list[Range] = []
    for variable in subject.rules.variables:
        if subject.held is not None:
            variable = replace(variable, terms=tuple(_own_terms(subject, variable)))
        low, high = span(variable, subject.domain)
        if low > high:
            return ()
        side = subject.domain.side(variable.name)
        if variable.terms:
            is_open = side is not None and side.is_open and low == side.low < high
            found.append(Range(variable, low, high, is_open))
    return tuple(found)


def _own_terms(subject: Subject, variable: Variable) -> Iterator[Term]:
    """Yield the terms of a variable that the system has."""
    assert subject.system is not None  # nothing else is held
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


def labels_of(of: Range, *terms: Term) -> tuple[Label, ...]:
    """Return terms of a variable as answers name them."""
    return tuple(Label(of.variable.name, term.name) for term in terms)
