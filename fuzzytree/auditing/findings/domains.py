"""The domain of a model: its ranges, its curves, spreads around its sets, or rows."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Literal

import msgspec
import numpy as np

from fuzzytree.auditing.decide.domain import Domain, DomainSide, whole_side
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.auditing.findings.table_words import read_value
from fuzzytree.model import (
    LR,
    Band,
    Curve,
    Document,
    FloatArray,
    Formula,
    FuzzyTree,
    Linear,
    Points,
    Variable,
    name_choice,
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
    """Return the domain of a model, a side for each input.

    Raises:
        ValueError: If an input has no such values; the sentence says what to give.
    """
    if spreads is not None and not (math.isfinite(spreads) and spreads > 0.0):
        raise ValueError(f"spreads must be above 0 and finite, not {spreads!r}")
    if within == "data" and spreads is None and rows is None:
        raise ValueError("limits from data need rows (--data TABLE)")
    left_out = set(limited)
    sides: list[DomainSide] = []
    faults: list[str] = []
    for position, axis in enumerate(_axes(model)):
        values = None if rows is None else rows.values[position]
        if axis.name in left_out:
            continue
        try:
            if axis.categories and (within == "model" or spreads is not None):
                sides.append(DomainSide(axis.name, 0.0, axis.categories - 1.0, "model"))
            elif spreads is not None:
                sides.append(_around(axis, spreads, values))
            elif within == "data":
                sides.append(_seen(axis, values))
            else:
                sides.append(_declared(axis, values))
        except ValueError as error:
            if axis.is_used:
                faults.append(str(error))
            else:
                value = (row or {}).get(axis.name, 0.0)
                ends = (0.0, 1.0, value if math.isfinite(value) else 0.0)
                sides.append(DomainSide(axis.name, min(ends), max(ends), "unused"))
        if sides and sides[-1].variable == axis.name:
            sides[-1] = _with_values(sides[-1], axis, values)
    if faults:
        more = [f"and {len(faults) - _MOST_FAULTS} more such inputs"]
        raise ValueError(
            "\n".join(faults[:_MOST_FAULTS] + (more if faults[_MOST_FAULTS:] else []))
        )
    return Domain(tuple(sides))


def limited(domain: Domain, limits: Limits, model: Document) -> Domain:
    """Return a domain with other ends for some variables.

    A stand-in for missing values stays where it lies between the ends, or is named.

    Raises:
        ValueError: If a variable or a value is unknown, or ends are swapped or not
            finite.

    Example:
        >>> from fuzzytree.model import Rule, RuleBase, Variable
        >>> city = Variable("city", categories=("Bern", "Oslo", "Rom"))
        >>> model = RuleBase("m", ("a",), (city,), (Rule((), "a"),))
        >>> limited(domain_of(model), {"city": "Rom,Bern"}, model).sides[0].values
        (0.0, 2.0)
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
            sides[variable.name] = _limited_side(variable, limits[variable.name])
    return Domain(tuple(sides[name] for name in names if name in sides))


def _limited_side(variable: Variable, limits: tuple[float, float] | str) -> DomainSide:
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


def _with_values(side: DomainSide, axis: _Axis, rows: FloatArray | None) -> DomainSide:
    """Return a side with the values that rows can have, or that these rows have."""
    seen = (
        rows[np.isfinite(rows)] if side.origin == "data" and rows is not None else None
    )
    values: tuple[float, ...] = ()
    if axis.categories:
        codes = np.arange(axis.categories) if seen is None else np.unique(seen)
        values = tuple(map(float, codes))
    has_missing = seen is None or rows is None or len(seen) < len(rows)
    missing = axis.missing if has_missing else None
    side = msgspec.structs.replace(side, values=values, missing=missing)
    return whole_side(side) if axis.is_whole else side


def _declared(axis: _Axis, values: FloatArray | None) -> DomainSide:
    """Return the range of an input, or the span of its curves, or of its rows.

    Raises:
        ValueError: If it has none.
    """
    name, low, high = axis.name, axis.low, axis.high
    if low is not None and high is not None:
        return DomainSide(name, low, high, "model")
    ends = [*axis.ends, *(one for one in (low, high) if one is not None)]
    if not axis.ends and values is not None:
        return _seen(axis, values)
    if not axis.ends:
        raise ValueError(
            f"input {name!r} has neither a range nor a curve to take its limits from; "
            f"give {_limits_of(name)}, or rows (--data TABLE)"
        )
    width = 0.0
    if axis.is_open or max(ends) == min(ends):
        width = max(ends) - min(ends) or max(abs(ends[0]), 1.0)
    low = min(ends) - width if low is None else low
    high = max(ends) + width if high is None else high
    if not (math.isfinite(low) and math.isfinite(high)):
        raise ValueError(
            f"the curves of input {name!r} span more than doubles hold; "
            f"give {_limits_of(name)}"
        )
    return DomainSide(name, low, high, "curves")


def _seen(axis: _Axis, values: FloatArray | None) -> DomainSide:
    """Return the smallest and the largest value of the rows.

    Raises:
        ValueError: If there is none.
    """
    finite = np.empty(0) if values is None else values[np.isfinite(values)]
    if not finite.size:
        raise ValueError(
            f"the rows have no value of input {axis.name!r}; "
            f"give {_limits_of(axis.name)}"
        )
    return DomainSide(axis.name, float(finite.min()), float(finite.max()), "data")


def _around(axis: _Axis, spreads: float, values: FloatArray | None) -> DomainSide:
    """Return the span of some spreads around the sets of an input, or its rows' mean.

    Raises:
        ValueError: If it has no sets, and there are no rows.
    """
    ends = [
        end
        for one in axis.sets
        for end in (
            one.mean - spreads * one.left.spread,
            one.mean + spreads * one.right.spread,
        )
    ]
    if not ends:
        finite = np.empty(0) if values is None else values[np.isfinite(values)]
        if not finite.size:
            raise ValueError(
                f"input {axis.name!r} has no fitted sets to count spreads from; "
                f"give rows (--data TABLE), or {_limits_of(axis.name)}"
            )
        mean, spread = float(np.mean(finite)), float(np.std(finite))
        ends = [mean - spreads * spread, mean + spreads * spread]
    if not all(map(math.isfinite, ends)):
        raise ValueError(
            f"{spreads!r} spreads of input {axis.name!r} span more than doubles hold"
        )
    return DomainSide(axis.name, min(ends), max(ends), "spreads")


def _limits_of(name: str) -> str:
    return f"its limits (--limits {f'{name}=LOW:HIGH'!r})"


class _Axis(msgspec.Struct, frozen=True):
    """What a model says about the values of an input."""

    name: str
    low: float | None
    high: float | None
    ends: tuple[float, ...]
    is_open: bool
    sets: tuple[LR, ...]
    is_used: bool
    categories: int
    missing: float | None
    is_whole: bool


def _axes(model: Document) -> Iterator[_Axis]:
    """Yield the inputs of a model, in its order."""
    curves: dict[str, list[Curve]] = {}
    for one in model.variables:
        curves[one.name] = [term.function for term in one.terms]
    for fitted in model.sets if isinstance(model, FuzzyTree) else ():
        curves[fitted.variable] += [term.function for term in fitted.terms]
    summed = {part.input for one in model.variables for part in one.parts}
    every = itertools.chain.from_iterable(curves.values())
    if any(isinstance(curve, Formula | Linear) for curve in every):
        summed = {*curves}  # which they may name
    for one in model.variables:
        if not one.parts:
            own = curves[one.name]
            ends = tuple(end for curve in own for end in _ends(curve))
            sets = tuple(curve for curve in own if isinstance(curve, LR))
            is_used = one.name in summed or any(curve != Band() for curve in own)
            is_open = any(map(_is_open, own))
            rows = len(one.categories), one.missing, one.is_whole
            facts = is_open, sets, is_used, *rows
            yield _Axis(one.name, one.low, one.high, ends, *facts)


def _is_open(curve: Curve) -> bool:
    """Return whether a curve stays above 0 without end."""
    match curve:
        case Band(low=low, high=high):
            return low is None or high is None
        case Points(degrees=degrees):
            return degrees[0] > 0.0 or degrees[-1] > 0.0
        case LR():
            return False
        case _:
            return curve.is_open


def _ends(curve: Curve) -> Iterator[float]:
    """Yield the values between which a curve changes; of formulas, none."""
    match curve:
        case Band(low=low, high=high, left=left, right=right):
            yield from (one for one in (low, high, left, right) if one is not None)
        case LR(mean=mean, left=left_side, right=right_side):
            yield mean - left_side.spread * left_side.reach
            yield mean + right_side.spread * right_side.reach
        case Points(values=values):
            yield from (values[0], values[-1])
        case _:
            yield from curve.extent or ()
