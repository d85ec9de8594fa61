"""How far rounding can take a strength, and which decisions it leaves open.

`fuzzytree.numerics.rounding` bounds the error of each degree in a number type. The
minimum and the maximum pass the largest error of their operands on; a product at most
adds the errors of its factors and a rounding for each multiplication, for
|a b - a' b'| <= |a - a'| + |b - b'| in [0, 1]. The result is delta, the largest error
of a strength, and with it the statement for which all this is made:

**Where the margin between the two strongest classes exceeds 2 delta, no decision can
differ.** For each of the two strengths has moved by at most delta, so their order is
the same as in exact arithmetic.

A tree weighs nothing. It takes the exact path wherever each value that it tests is
farther from the cuts than its own rounding and that of the cuts.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.model import (
    BoolArray,
    Dtype,
    FloatArray,
    Model,
    ModelKind,
    Proposition,
    Result,
    Variable,
)
from fuzzytree.numerics.enclosures import axis_value, filled_values
from fuzzytree.numerics.rounding import (
    FLOAT32_MAX,
    MORE,
    TYPES,
    UNIT,
    DegreeBound,
    degree_bound,
    degree_errors,
    value_error,
)

if TYPE_CHECKING:
    from fuzzytree.numerics.rounding import Reals

__all__ = [
    "FLOAT32_MAX",
    "UNIT",
    "Certificate",
    "DegreeBound",
    "TermBound",
    "ValueBound",
    "certify",
    "degree_bound",
    "open_paths",
    "strength_bounds",
]

_BLOCK = 1 << 13  # rows that are bounded together


def strength_bounds(
    rules: Model, dtype: Dtype, values: FloatArray
) -> tuple[FloatArray, str]:
    """Return the largest difference of any strength from the exact one, for each row.

    Args:
        rules: The rule base.
        dtype: The type in which degrees and strengths are computed.
        values: Shape (inputs, rows).

    Returns:
        The bounds, each at most 1, and a sentence that says where they come from. The
        bound is 1 where there is none: at a value that is beyond the type's range, or
        so close to a step that rounding can put it on the other side. Rows with
        missing values have the bound 0: there is nothing to compute.
    """
    values = filled_values(rules.variables, values)
    bounds = _term_bounds(rules, dtype)
    found = np.zeros(values.shape[1])
    with np.errstate(all="ignore"):
        for start in range(0, len(found), _BLOCK):
            part = slice(start, start + _BLOCK)
            errors = _term_errors(rules, dtype, bounds, values[:, part])
            found[part] = _joined(rules, dtype, errors)
    found[(np.abs(values) > TYPES[dtype].largest).any(axis=0)] = 1.0
    found[~np.isfinite(values).all(axis=0)] = 0.0
    return found, _origin(rules, dtype)


def _origin(rules: Model, dtype: Dtype) -> str:
    if rules.semantics.conjunction == "product":
        return f"largest sum of derived errors of a rule's degrees in {dtype}"
    return f"largest derived error of a degree in {dtype}"


Key = tuple[str, str]


def _term_bounds(rules: Model, dtype: Dtype) -> dict[Key, DegreeBound]:
    """Return the bound of each term that a rule names."""
    shapes = {(v.name, t.name): t.shape for v in rules.variables for t in v.terms}
    propositions = (proposition for rule in rules.rules for proposition in rule.when)
    keys = dict.fromkeys((c.variable, term) for c in propositions for term in c.terms)
    return {key: degree_bound(shapes[key], dtype) for key in keys}


def _term_errors(
    rules: Model,
    dtype: Dtype,
    bounds: Mapping[Key, DegreeBound],
    values: FloatArray,
) -> dict[Key, Reals]:
    """Return the largest error of each term's degree in each row."""
    named = dict(zip(rules.inputs, values, strict=True))
    ranges = {name: (line, line) for name, line in named.items()}
    used = {variable for variable, _ in bounds}
    variables = {v.name: v for v in rules.variables if v.name in used}
    axes = {
        name: (axis_value(v, named).x, value_error(v, dtype, ranges))
        for name, v in variables.items()
    }
    return {
        key: degree_errors(bound, *axes[key[0]], is_input=not variables[key[0]].parts)
        for key, bound in bounds.items()
    }


def _joined(rules: Model, dtype: Dtype, errors: Mapping[Key, Reals]) -> Reals:
    """Return the largest error of a strength from those of the terms' degrees."""
    unit = TYPES[dtype].degree
    propositions = dict.fromkeys(
        proposition for rule in rules.rules for proposition in rule.when
    )
    if not propositions:
        return np.zeros(())
    degrees = {c: _proposition_error(c, unit, errors) for c in propositions}
    if rules.semantics.conjunction == "minimum":
        worst = _largest(degrees.values())
    else:
        paths = dict.fromkeys(rule.when for rule in rules.rules if rule.when)
        worst = _largest(_summed(degrees[c] + unit for c in when) for when in paths)
    return np.minimum(worst * MORE, 1.0)


def _proposition_error(
    proposition: Proposition, unit: float, errors: Mapping[Key, Reals]
) -> Reals:
    worst = _largest(errors[proposition.variable, term] for term in proposition.terms)
    return worst + unit if proposition.negated else worst


def _largest(parts: Iterable[Reals]) -> Reals:
    return functools.reduce(np.maximum, parts)


def _summed(parts: Iterable[Reals]) -> Reals:
    return functools.reduce(np.add, parts)


# --- certificates


class TermBound(msgspec.Struct, frozen=True):
    """The largest error of the degree of a term.

    Attributes:
        variable: The variable.
        term: The term.
        degree: What the arithmetic on the curve can cost.
        from_value: What the rounding of the value can cost besides.
    """

    variable: str
    term: str
    degree: float
    from_value: float


class ValueBound(msgspec.Struct, frozen=True):
    """The largest error of the value of a variable, in its unit."""

    variable: str
    error: float


class Certificate(Result, msgspec.Struct, frozen=True):
    """What a number type can change about a model's answers, at most.

    Attributes:
        dtype: The number type; None for a file that holds the model and computes
            nothing.
        representation: `rules` or `tree`.
        delta: The largest error of a strength; None for a tree that computes, and
            where there is no bound below 1.
        origin: What it is derived from, and for which values it holds.
        terms: The largest error of each term's degree.
        values: The largest error of each value that is rounded at all.
        reasons: Why there is no bound, or none in some of the rows, in sentences.
        rows: How many rows it holds for; None if for every value in the ranges.
        unbounded: In how many rows a strength has no bound.
    """

    dtype: Dtype | None
    representation: ModelKind = msgspec.field(name="carrier")
    delta: float | None
    origin: str
    terms: tuple[TermBound, ...] = ()
    values: tuple[ValueBound, ...] = ()
    reasons: tuple[str, ...] = ()
    rows: int | None = None
    unbounded: int = 0

    def __repr__(self) -> str:
        """Show the number type, and the largest error of a strength."""
        return f"Certificate({self.dtype}, {self.representation}, delta={self.delta})"

    @property
    def sentence(self) -> str:
        """Return what it says about decisions, for people."""
        if self.dtype is None:
            return "the class cannot change: every number is written in full, error 0"
        if self.delta is None:
            return self._of_paths()
        if self.delta >= 0.5:
            return f"any class can change: a strength can be off by {self.delta:.1e}"
        text = "the class cannot change: every strength is exact"
        if self.delta > 0.0:
            text = (
                "the class cannot change unless the two strongest classes differ by "
                f"{short_above(2.0 * self.delta)} or less"
            )
        return "; ".join([text, *self.reasons])

    def _of_paths(self) -> str:
        if self.reasons:
            return f"no bound: {'; '.join(self.reasons)}"
        if not self.values:
            return "the class cannot change: no value is rounded before it meets a cut"
        worst = max(self.values, key=lambda value: value.error)
        return (
            "the class cannot change for values farther than "
            f"{short_above(worst.error)} from a cut ({worst.variable})"
        )


def short_above(value: float) -> str:
    """Return a number with two digits that is not below it.

    Example:
        >>> short_above(1.21e-6), short_above(0.0)
        ('1.3e-06', '0')
    """
    if value == 0.0:
        return "0"
    for step in range(2):
        text = f"{value * (1.0 + 0.05 * step):.1e}"
        if float(text) >= value:
            return text
    return f"{value * 1.1:.1e}"


def certify(
    model: Model, dtype: Dtype, values: FloatArray | None = None
) -> Certificate:
    """Return how far a number type can take a model from its exact answers.

    Args:
        model: A rule base or a tree.
        dtype: The number type.
        values: Rows for which it shall hold, of shape (inputs, rows). Without them it
            holds for all values within the declared ranges of the inputs. Inputs that
            no combination needs may go without a range.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(0, combinations=0))
        >>> certify(rules, "mixed").sentence.partition(" unless ")[2]
        'the two strongest classes differ by 2.4e-07 or less'
    """
    if not model.rules:
        return _certify_tree(model, dtype, values)
    if values is None:
        return _certify_ranges(model, dtype)
    return _certify_rows(model, dtype, values)


def _certify_rows(rules: Model, dtype: Dtype, values: FloatArray) -> Certificate:
    values = filled_values(rules.variables, values)
    allowed, origin = strength_bounds(rules, dtype, values)
    is_bound = allowed < 1.0
    known = np.isfinite(values).all(axis=0)
    count, unbounded = values.shape[1], int((~is_bound).sum())
    delta = float(allowed[is_bound].max(initial=0.0)) if is_bound.any() else None
    kept = values[:, is_bound & known]
    terms: dict[Key, float] = dict.fromkeys(_term_bounds(rules, dtype), 0.0)
    for start in range(0, kept.shape[1], _BLOCK):
        part = kept[:, start : start + _BLOCK]
        found = _term_errors(rules, dtype, _term_bounds(rules, dtype), part)
        terms = {k: max(e, float(found[k].max(initial=0.0))) for k, e in terms.items()}
    reason = (
        f"no bound in {unbounded} of {count} rows: a value is beyond {dtype}, or "
        "rounding can put it on the other side of a step"
    )
    return Certificate(
        dtype,
        "rules",
        delta,
        f"{origin}, in {count} rows",
        _term_texts(rules, dtype, terms),
        _value_bounds(rules, dtype, _spans(kept, rules.inputs)),
        (reason,) if unbounded else (),
        count,
        unbounded,
    )


def _certify_ranges(rules: Model, dtype: Dtype) -> Certificate:
    ranges = _declared(rules)
    variables = {v.name: v for v in rules.variables}
    terms: dict[Key, float] = {}
    reasons: list[str] = []
    for key, bound in _term_bounds(rules, dtype).items():
        variable = variables[key[0]]
        lost = [part.input for part in variable.parts if part.input not in ranges]
        if lost:
            reasons.append(
                f"input {lost[0]!r} of {variable.name!r} has no declared range"
            )
            continue
        terms[key] = _worst_on(variable, dtype, bound, ranges)
        if terms[key] >= 1.0:
            reasons.append(_why(variable, key[1], bound, dtype))
    delta = None
    if not reasons:
        errors = {key: np.array(error) for key, error in terms.items()}
        delta = float(_joined(rules, dtype, errors))
        if not delta < 1.0:
            delta, reasons = None, ["the errors of a rule's degrees add up to 1"]
    return Certificate(
        dtype,
        "rules",
        delta,
        f"{_origin(rules, dtype)}, for values in the declared ranges",
        _term_texts(rules, dtype, terms),
        _value_bounds(rules, dtype, ranges),
        tuple(dict.fromkeys(reasons)),
    )


Ranges = Mapping[str, "tuple[Reals, Reals]"]


def _declared(model: Model) -> dict[str, tuple[Reals, Reals]]:
    """Return the range of each input that declares one."""
    return {
        v.name: (np.array(v.low), np.array(v.high))
        for v in model.variables
        if not v.parts and v.low is not None and v.high is not None
    }


def _spans(values: FloatArray, inputs: Sequence[str]) -> dict[str, tuple[Reals, Reals]]:
    """Return the range of each input in some rows; none without rows."""
    if not values.shape[1]:
        return {}
    ends = zip(values.min(axis=1), values.max(axis=1), strict=True)
    return {
        name: (np.array(low), np.array(high))
        for name, (low, high) in zip(inputs, ends, strict=True)
    }


def _worst_on(
    variable: Variable, dtype: Dtype, bound: DegreeBound, ranges: Ranges
) -> float:
    """Return the largest error of a degree for all values in the declared ranges."""
    everywhere = (np.array(0.0), np.array(FLOAT32_MAX))
    off = value_error(variable, dtype, {variable.name: everywhere, **ranges})
    places = np.array([*bound.steps.places, np.nan])  # and a place far from all steps
    if not variable.parts and variable.name in ranges:
        low, high = ranges[variable.name]
        near = (0.0 if off is None else off) + bound.steps.blur
        places = places[~((places < low - near) | (places > high + near))]
    offs = None if off is None else np.full(places.shape, off)
    is_input = not variable.parts
    return float(degree_errors(bound, places, offs, is_input=is_input).max())


def _why(variable: Variable, term: str, bound: DegreeBound, dtype: Dtype) -> str:
    where = f"term {term!r} of {variable.name!r}"
    if not 2.0 * bound.active < TYPES[dtype].largest:
        return f"{where} has numbers as large as {dtype} can hold"
    moved = bound.fixed + bound.per_unit * bound.steps.blur
    if moved < 0.5 and bound.steps.places:
        step = bound.steps.places[int(np.argmax(bound.steps.heights))]
        return f"{where} steps at {step!r}, and a value can round across it"
    return f"{where} is not wider than the rounding of its values"


def _term_texts(
    rules: Model, dtype: Dtype, errors: Mapping[Key, float]
) -> tuple[TermBound, ...]:
    bounds = _term_bounds(rules, dtype)
    return tuple(
        TermBound(*key, bounds[key].fixed, max(error - bounds[key].fixed, 0.0))
        for key, error in errors.items()
    )


def _value_bounds(model: Model, dtype: Dtype, ranges: Ranges) -> tuple[ValueBound, ...]:
    """Return the errors of the used variables whose range is known."""
    found: list[ValueBound] = []
    for variable in model.variables:
        needed = [part.input for part in variable.parts] or [variable.name]
        if variable.terms and all(name in ranges for name in needed):
            error = value_error(variable, dtype, ranges)
            if error is not None:
                found.append(ValueBound(variable.name, float(error)))
    return tuple(found)


# --- trees


def _certify_tree(tree: Model, dtype: Dtype, values: FloatArray | None) -> Certificate:
    used = {node.variable for node in tree.nodes}
    if values is None:
        ranges, where, rows = _declared(tree), "for values in the declared ranges", None
    else:
        rows = values.shape[1]
        values = filled_values(tree.variables, values)
        known = values[:, np.isfinite(values).all(axis=0)]
        ranges, where = _spans(known, tree.inputs), f"in {rows} rows"
    largest = {
        v.name: max(
            abs(cut) for n in tree.nodes if n.variable == v.name for cut in n.cuts
        )
        for v in tree.variables
        if v.name in used
    }
    stored = TYPES[dtype].stored
    found = tuple(
        ValueBound(value.variable, value.error + stored * largest[value.variable])
        for value in _value_bounds(tree, dtype, ranges)
        if value.variable in used
    )
    lost = [
        f"input {name!r} has no declared range"
        for v in tree.variables
        if v.name in used and (v.parts or stored)
        for name in ([part.input for part in v.parts] or [v.name])
        if name not in ranges and rows != 0
    ]
    lost += [
        f"{value.variable!r} is beyond {dtype}"
        for value in found
        if not np.isfinite(value.error)
    ]
    origin = f"largest derived error of a value in {dtype}, {where}"
    reasons = tuple(dict.fromkeys(lost))
    return Certificate(
        dtype, "tree", None, origin, values=found, reasons=reasons, rows=rows
    )


def open_paths(tree: Model, dtype: Dtype, values: FloatArray) -> BoolArray:
    """Return the rows in which rounding can change the path of a tree.

    There a value lies no farther from a cut than its rounding and the cut's, or it is
    beyond the number type.

    Args:
        tree: The tree.
        dtype: In what values and cuts are compared.
        values: Shape (inputs, rows).
    """
    kind = TYPES[dtype]
    values = filled_values(tree.variables, values)
    named = dict(zip(tree.inputs, values, strict=True))
    ranges = {name: (line, line) for name, line in named.items()}
    found: BoolArray = np.zeros(values.shape[1], np.bool_)
    with np.errstate(all="ignore"):
        for variable in tree.variables:
            off = value_error(variable, dtype, ranges)
            if off is None:
                continue
            found |= ~np.isfinite(off)
            x = axis_value(variable, named).x
            for node in tree.nodes:
                for cut in node.cuts if node.variable == variable.name else ():
                    blur = kind.stored * abs(cut) + kind.least
                    found |= np.abs(x - cut) <= (off + blur) * MORE
        if kind.stored:
            found |= (np.abs(values) > kind.largest).any(axis=0)
    return found & np.isfinite(values).all(axis=0)
