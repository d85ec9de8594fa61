"""Answers in the words of the table: categories, dates, whole numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction

from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.decide.states import Bracket, Coordinate, Span, Witness
from fuzzytree.auditing.findings.records import AuditAnswer
from fuzzytree.columns import days_of, placer
from fuzzytree.model import Variable
from fuzzytree.rechecking import (
    DATE_UNIT,
    MISSING,
    is_plain,
    sentence_of,
    stretch,
    stretch_word,
    value_word,
)


class Words:
    """The inputs of a model, as their table has them.

    Args:
        domain: The values that rows can have.
        variables: Those of the model.
    """

    def __init__(self, domain: Domain, variables: Iterable[Variable]) -> None:
        self._columns = {one.name: one for one in variables if not one.parts}
        self._sides = {side.variable: side for side in domain.sides}

    @property
    def domain(self) -> Domain:
        """The domain with its words."""
        spans = {name: self.span(Span(name, None, None)) for name in self._sides}
        sides = self._sides.items()
        return Domain(tuple(replace(one, word=spans[name].word) for name, one in sides))

    def value(self, name: str, value: Fraction) -> str:
        """Return a value of an input in words; empty of a number with a fraction."""
        column = self._columns.get(name)
        return (
            "" if column is None else value_word(column, self._sides.get(name), value)
        )

    def span(self, span: Span) -> Span:
        """Return the values of rows in a span, with their words."""
        column, side = self._columns.get(span.variable), self._sides.get(span.variable)
        if column is None or side is None:
            return span
        low = side.ends[0] if span.low is None else Fraction(span.low)
        high = side.ends[1] if span.high is None else Fraction(span.high)
        ends = None if is_plain(side) else stretch(side, low, high).ends(side)
        if ends is not None:
            span = replace(span, low=float(ends[0]), high=float(ends[1]))
        return replace(span, word=stretch_word(column, side, low, high))

    def answer(self, answer: AuditAnswer) -> AuditAnswer:
        """Return an answer whose points, regions and sentence have words."""
        state, facts = answer.state, dict(answer.facts)
        region = tuple(map(self.span, answer.region))
        if isinstance(state, Witness | Bracket):
            state = replace(state, point=tuple(map(self._coordinate, state.point)))
        if isinstance(state, Witness):
            state = replace(state, region=tuple(map(self.span, state.region)))
        words = {span.variable: span.word for span in region if span.word}
        if isinstance(ends := facts.get("ends"), tuple):
            facts["ends"] = tuple(
                (row[0], words[row[0]])
                if row[0] in words and row[1:] != (None, None)
                else row
                for row in ends
            )
        if isinstance(moved := facts.get("moved"), tuple):
            facts["moved"] = tuple(
                (name, self.value(str(name), Fraction(str(text))) or text)
                for name, text in moved
            )
        if len({term.variable for term in answer.terms}) == 1:
            name = answer.terms[0].variable
            for key in {"low", "high", "at"} & facts.keys():
                value = facts[key]
                if isinstance(value, float):
                    facts[key] = self.value(name, Fraction(value)) or value
        answer = replace(answer, state=state, region=region, facts=facts)
        return replace(answer, sentence=sentence_of(answer))

    def _coordinate(self, one: Coordinate) -> Coordinate:
        return replace(one, word=self.value(one.input, Fraction(one.exact)))


def read_value(variable: Variable, text: str) -> float:
    """Return a value of an input from the words of its table.

    An empty text, or `missing`, is what stands for a missing value.

    Example:
        >>> read_value(Variable("city", categories=("Bern", "Rom")), "Rom")
        1.0
        >>> read_value(Variable("day", unit="days since 1970-01-01"), "1970-01-03")
        2.0
    """
    text = text.strip()
    value: float | None
    if variable.categories:
        value = placer(variable.categories)(text)
        known = f"one of {', '.join(map(repr, variable.categories[:20]))}"
    else:
        days = days_of(text) if variable.unit == DATE_UNIT else None
        known = (
            "a date such as 2024-03-01" if variable.unit == DATE_UNIT else "a number"
        )
        try:
            number = text.removesuffix(variable.unit)
            value = float(number) if days is None else days
        except ValueError:
            value = None
    is_missing = text in ("", MISSING) and text not in variable.categories
    if is_missing and variable.missing is not None:
        return variable.missing
    if value is None or is_missing or math.isnan(value):
        raise ValueError(f"{variable.name!r} cannot be {text!r}; it is {known}")
    return value
