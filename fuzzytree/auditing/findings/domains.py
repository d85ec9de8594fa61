"""The domain of a model, and values of its inputs in the words of their table."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Literal

import msgspec
import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain, DomainSide, whole_side
from fuzzytree.auditing.decide.states import Bracket, Coordinate, Span, Witness
from fuzzytree.auditing.findings.records import AuditAnswer
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.columns import days_of, placer
from fuzzytree.model import (
    LR,
    Band,
    Curve,
    Document,
    FloatArray,
    Formula,
    Linear,
    Variable,
    name_choice,
)
from fuzzytree.rechecking import (
    DATE_UNIT,
    MISSING,
    is_plain,
    sentence_of,
    stretch,
    stretch_word,
    value_word,
)

Within = Literal["model", "data"]
Limits = Mapping[str, tuple[float, float] | str]
"""The ends of variables, or their values in words."""


class AuditDomain(msgspec.Struct, frozen=True, kw_only=True):
    """Where a model is audited.

    Attributes:
        within: The ranges that the `model` declares, or those of the `data`.
        spreads: Instead, so many spreads around the fitted sets of each input.
        limits: The ends of some inputs; they take precedence. A text has words of the
            table: `200:300`, `2024-01-01:2024-02-01`, or categories: `Bern,Rom`.
        row: A row whose nearest different decision is searched for; texts are words of
            the table.
    """

    within: Within = "model"
    spreads: float | None = None
    limits: Limits = {}
    row: Mapping[str, float | str] | None = None


_MOST_FAULTS = 10


def domain_of(
    model: Document,
    *,
    within: Within = "model",
    spreads: float | None = None,
    rows: AuditRows | None = None,
    limited: Iterable[str] = (),
    row: Mapping[str, float] | None = None,
) -> Domain:
    """Return the domain of a model, a side for each input that is not `limited`."""
    if spreads is not None and not (math.isfinite(spreads) and spreads > 0.0):
        raise ValueError(f"spreads must be above 0 and finite, not {spreads!r}")
    if within == "data" and spreads is None and rows is None:
        raise ValueError("limits from data need rows (--data TABLE)")
    curves = _curves(model)
    queried = _inputs_in_use(model, curves)
    sides: list[DomainSide] = []
    faults: list[str] = []
    inputs = [variable for variable in model.variables if not variable.parts]
    for position, axis in enumerate(inputs):
        name, codes = axis.name, len(axis.categories)
        if name in set(limited):
            continue
        values = None if rows is None else rows.values[position]
        finite = np.empty(0) if values is None else values[np.isfinite(values)]
        try:
            if codes and (within == "model" or spreads is not None):
                side = DomainSide(name, 0.0, codes - 1.0, "model")
            elif spreads is not None:
                side = _spread_side(axis, curves[name], spreads, finite)
            elif within == "data":
                side = _data_side(axis, finite)
            else:
                side = _default_side(axis, curves[name], values, finite)
        except ValueError as error:
            if name in queried:
                faults.append(str(error))
            value = (row or {}).get(name, 0.0)
            ends = (0.0, 1.0, value if math.isfinite(value) else 0.0)
            side = DomainSide(name, min(ends), max(ends), "unused")
        sides.append(_with_values(side, axis, values, finite))
    if len(faults) > _MOST_FAULTS:
        faults[_MOST_FAULTS:] = [f"and {len(faults) - _MOST_FAULTS} more such inputs"]
    if faults:
        raise ValueError("\n".join(faults))
    return Domain(tuple(sides))


def _curves(model: Document) -> dict[str, list[Curve]]:
    """Return the curves of each variable, with those that were fitted."""
    curves: dict[str, list[Curve]] = {}
    for variable in model.variables:
        curves[variable.name] = [term.function for term in variable.terms]
    for fitted in model.sets:
        curves[fitted.variable] += [term.function for term in fitted.terms]
    return curves


def _inputs_in_use(model: Document, curves: Mapping[str, Sequence[Curve]]) -> set[str]:
    """Return the inputs on which something may depend."""
    every = itertools.chain.from_iterable(curves.values())
    if any(isinstance(curve, Formula | Linear) for curve in every):
        return {*curves}  # which a formula may name
    queried = {part.input for variable in model.variables for part in variable.parts}
    for name, own in curves.items():
        if any(curve != Band() for curve in own):
            queried.add(name)
    return queried


def limit_domain(domain: Domain, limits: Limits, model: Document) -> Domain:
    """Return a domain with other ends for some variables.

    A stand-in for missing values stays where it lies between the ends, or is named.
    """
    names = [variable.name for variable in model.variables]
    for name in limits:
        if name not in names:
            raise ValueError(
                f"limits for {name!r}, which is no variable; {name_choice(name, names)}"
            )
    sides = {side.variable: side for side in domain.sides}
    for variable in model.variables:
        if variable.name in limits:
            sides[variable.name] = _side_within(variable, limits[variable.name])
    return Domain(tuple(sides[name] for name in names if name in sides))


def _side_within(variable: Variable, limits: tuple[float, float] | str) -> DomainSide:
    """Return the values of a variable within limits."""
    name, missing = variable.name, variable.missing
    if variable.categories:
        if not isinstance(limits, str):
            raise ValueError(f"the limits of {name!r} are names of categories")
        codes = sorted({read_value(variable, word) for word in limits.split(",")})
        values = tuple(code for code in codes if code >= 0.0)
        if not values:
            raise ValueError(f"the limits of {name!r} have no category")
        kept = missing if missing in codes and missing not in values else None
        return DomainSide(name, values[0], values[-1], values=values, missing=kept)
    low, high = _read_ends(variable, limits) if isinstance(limits, str) else limits
    if not (math.isfinite(low) and math.isfinite(high)):
        raise ValueError(
            f"the limits of {name!r} must be finite, not {low!r} to {high!r}"
        )
    if low > high:
        raise ValueError(
            f"the limits of {name!r} are swapped: {low!r} to {high!r}; "
            "the smaller one stands first"
        )
    is_within = missing is not None and low <= missing <= high
    side = DomainSide(name, low, high, missing=missing if is_within else None)
    return whole_side(side) if variable.is_whole else side


def _read_ends(variable: Variable, text: str) -> tuple[float, float]:
    """Return the ends that a text such as `1:2` has; a time of day has colons too."""
    fault = ValueError(
        f"the limits of {variable.name!r} must be LOW:HIGH, not {text!r}"
    )
    for place in (k for k, sign in enumerate(text) if sign == ":"):
        try:
            low, high = text[:place], text[place + 1 :]
            return read_value(variable, low), read_value(variable, high)
        except ValueError as error:
            fault = error
    raise fault


def _with_values(
    side: DomainSide, axis: Variable, values: FloatArray | None, finite: FloatArray
) -> DomainSide:
    """Return a side with the values that rows can have, or that these rows have."""
    codes, missing = tuple(map(float, range(len(axis.categories)))), axis.missing
    if side.origin == "data" and values is not None:
        codes = tuple(np.unique(finite).tolist()) if codes else ()
        missing = missing if len(finite) < len(values) else None
    side = replace(side, values=codes, missing=missing)
    return whole_side(side) if axis.is_whole else side


def _default_side(
    axis: Variable,
    curves: Sequence[Curve],
    values: FloatArray | None,
    finite: FloatArray,
) -> DomainSide:
    """Return the range of an input, or the span of its curves, or of its rows."""
    name, low, high = axis.name, axis.low, axis.high
    if low is not None and high is not None:
        return DomainSide(name, low, high, "model")
    ends = [end for curve in curves for end in curve.extent or ()]
    if not ends:
        if values is not None:
            return _data_side(axis, finite)
        raise ValueError(
            f"input {name!r} has neither a range nor a curve to take its limits from; "
            f"give {_limits_of(name)}, or rows (--data TABLE)"
        )
    ends += [end for end in (low, high) if end is not None]
    width = 0.0
    if any(curve.is_open for curve in curves) or max(ends) == min(ends):
        width = max(ends) - min(ends) or max(abs(ends[0]), 1.0)
    low = min(ends) - width if low is None else low
    high = max(ends) + width if high is None else high
    if not (math.isfinite(low) and math.isfinite(high)):
        raise ValueError(
            f"the curves of input {name!r} span more than doubles hold; "
            f"give {_limits_of(name)}"
        )
    return DomainSide(name, low, high, "curves")


def _data_side(axis: Variable, finite: FloatArray) -> DomainSide:
    """Return the smallest and the largest value of the rows."""
    if finite.size:
        return DomainSide(axis.name, float(finite.min()), float(finite.max()), "data")
    fault = f"the rows have no value of input {axis.name!r}"
    raise ValueError(f"{fault}; give {_limits_of(axis.name)}")


def _spread_side(
    axis: Variable, curves: Sequence[Curve], spreads: float, finite: FloatArray
) -> DomainSide:
    """Return some spreads around the sets of an input, or around the mean of rows."""
    sets = [curve for curve in curves if isinstance(curve, LR)]
    ends = [curve.mean - spreads * curve.left.spread for curve in sets]
    ends += [curve.mean + spreads * curve.right.spread for curve in sets]
    if not ends and finite.size:
        mean, spread = float(np.mean(finite)), float(np.std(finite))
        ends = [mean - spreads * spread, mean + spreads * spread]
    if not ends:
        raise ValueError(
            f"input {axis.name!r} has no fitted sets to count spreads from; "
            f"give rows (--data TABLE), or {_limits_of(axis.name)}"
        )
    if not all(map(math.isfinite, ends)):
        raise ValueError(
            f"{spreads!r} spreads of input {axis.name!r} span more than doubles hold"
        )
    return DomainSide(axis.name, min(ends), max(ends), "spreads")


def _limits_of(name: str) -> str:
    return f"its limits (--limits {f'{name}=LOW:HIGH'!r})"


# --- words of the table


class Words:
    """The inputs of a model on a domain, as their table has them."""

    def __init__(self, domain: Domain, variables: Iterable[Variable]) -> None:
        self._columns = {v.name: v for v in variables if not v.parts}
        self._sides = {side.variable: side for side in domain.sides}

    @property
    def domain(self) -> Domain:
        """The domain with its words."""
        spans = {name: self.span(Span(name, None, None)) for name in self._sides}
        sides = self._sides.items()
        return Domain(tuple(replace(s, word=spans[name].word) for name, s in sides))

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

    def _coordinate(self, at: Coordinate) -> Coordinate:
        return replace(at, word=self.value(at.input, Fraction(at.exact)))


def read_value(variable: Variable, text: str) -> float:
    """Return a value of an input from the words of its table.

    An empty text, or `missing`, is what stands for a missing value.
    """
    text = text.strip()
    value: float | None
    if variable.categories:
        value = placer(variable.categories)(text)
        allowed = f"one of {', '.join(map(repr, variable.categories[:20]))}"
    else:
        days = days_of(text) if variable.unit == DATE_UNIT else None
        allowed = (
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
        raise ValueError(f"{variable.name!r} cannot be {text!r}; it is {allowed}")
    return value


def row_values(
    model: Document, row: Mapping[str, float | str], *, is_partial: bool = False
) -> dict[str, float]:
    """Return the values of a row by input, from numbers or the words of its table.

    A partial row may lack inputs; a whole one may have further columns.

    Raises:
        ValueError: If the row lacks an input or a name of a partial one is no input, or
            if a value is not finite or no category.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1, leaves=2)
        >>> row_values(tree, dict.fromkeys(tree.inputs, "0.5")) == dict.fromkeys(
        ...     tree.inputs, 0.5
        ... )
        True
    """
    columns = {one.name: one for one in model.variables if not one.parts}
    absent = [name for name in columns if name not in row]
    values: dict[str, float] = {}
    for name, cell in row.items():
        if name not in columns:
            if not (absent or is_partial):
                continue  # a column of the table that the model does not use
            raise ValueError(
                f"the row has a value of {name!r}, which is no input; "
                f"{name_choice(name, columns)}"
            )
        value = read_value(columns[name], cell) if isinstance(cell, str) else cell
        if not math.isfinite(value):
            raise ValueError(f"the row's {name!r} must be finite, not {value!r}")
        values[name] = float(value)
    if absent and not is_partial:
        raise ValueError(f"the row has no value of {', '.join(map(repr, absent))}")
    return values
