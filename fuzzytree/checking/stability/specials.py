"""N6: missing, infinite, subnormal and huge values, alike in every runtime."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.checking.stability.carriers import (
    Ready,
    answered,
    ready,
    row_text,
    unequal,
)
from fuzzytree.checking.stability.results import Criterion, judged
from fuzzytree.model.contracts import Dtype, Model, Outcome, Runtime
from fuzzytree.semantics.reference import Status

if TYPE_CHECKING:
    from fuzzytree.checking.stability.carriers import BoolArray
    from fuzzytree.model.contracts import FloatArray

SPECIALS = (
    math.nan,
    math.inf,
    -math.inf,
    0.0,
    -0.0,
    5e-324,
    -5e-324,
    2.225073858507201e-308,
    1e-310,
    1e-45,
    1e-40,
    3.4028234663852886e38,
    3.5e38,
    -3.5e38,
    1e39,
    1e300,
    -1e300,
    1.7976931348623157e308,
)
"""No number, no finite one, both zeros, subnormal in double and in float32, the largest
float32 and beyond, and the largest double."""

_BASES = 4  # rows in which a value is replaced
_ADVICE = (
    "ask for missing values before anything is compared: NaN answers every comparison "
    "with no, and each minimum in its own way"
)


def specials(
    model: Model, runtimes: Sequence[Runtime], values: FloatArray
) -> Criterion:
    """Put each special value into each input; demand the declared answer (N6).

    A row is missing exactly where an input, or a combination computed step by step in
    the runtime's type of axes, is not finite; then there is no rule, and no strength is
    a number. -0.0 is answered like 0.0. Runtimes of one number type that promise equal
    bits give each other's rules.

    Args:
        model: A tree or a rule base.
        runtimes: What to run.
        values: Shape (inputs, rows); some of them are changed.
    """
    if not model.inputs:
        return judged("N6", 0, (), skipped=("the model has no input",))
    rows = _with_specials(values)
    faults: list[str] = []
    skipped: list[str] = []
    cases = 0
    first: dict[tuple[str, Dtype, bool], tuple[str, Outcome]] = {}
    for one in ready(model, runtimes, skipped):
        asked = one.some(rows)
        found, warning = answered(one, asked)
        cases += asked.shape[1]
        faults += [f"{one.title}: it warns: {warning}"] if warning else []
        faults += _broken_policy(one, asked, found)
        is_zero = asked == 0.0
        if is_zero.any():
            turned = np.where(is_zero, -asked, asked)
            wrong = unequal(one.run(turned), found)
            if wrong.any():
                faults.append(f"{one.title}: 0.0 and -0.0 are not answered alike")
        if one.runtime.bound is None:
            key = (one.representation, one.runtime.dtype, one.runtime.is_slow)
            title, other = first.setdefault(key, (one.title, found))
            faults += _disagreement(one, asked, found, title, other)
    return judged("N6", cases, faults, advice=_ADVICE, skipped=skipped)


def missing_rows(model: Model, values: FloatArray, dtype: Dtype) -> BoolArray:
    """Return which rows count as missing, by the declared policy.

    A row is missing if the value of any variable is not finite in the type of axes:
    inputs rounded to it, combinations added up in their order, each step rounded.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1, inputs=1, leaves=2)
        >>> missing_rows(tree, np.array([[1.0, math.nan, 1e39]]), "float32").tolist()
        [False, True, True]
    """
    kind = np.dtype(np.float32 if dtype == "float32" else np.float64)
    with np.errstate(all="ignore"):
        axes = dict(zip(model.inputs, values.astype(kind), strict=True))
        known = np.ones(values.shape[1], np.bool_)
        for variable in model.variables:
            total = axes.get(variable.name)
            for part in variable.parts:
                weight, centre = (kind.type(n) for n in (part.weight, part.centre))
                step = weight * (axes[part.input] - centre)
                total = step if total is None else total + step
            if total is not None:
                known &= np.isfinite(total)
    missing: BoolArray = ~known
    return missing


def _with_specials(values: FloatArray) -> FloatArray:
    """Return rows in which one input at a time has each special value, and all have."""
    plain = values[:, np.isfinite(values).all(axis=0)]
    if not plain.shape[1]:
        plain = np.zeros((values.shape[0], 1))
    bases = plain[:, :: -(-plain.shape[1] // _BASES)]
    made = [bases]
    for value in SPECIALS:
        for line in range(len(bases)):
            changed = bases.copy()
            changed[line] = value
            made.append(changed)
        made.append(np.full_like(bases[:, :1], value))
    return np.concatenate(made, axis=1)


def _broken_policy(one: Ready, rows: FloatArray, found: Outcome) -> Iterator[str]:
    expected = missing_rows(one.model, rows, one.runtime.dtype)
    is_missing = found.status == Status.MISSING
    wrong = is_missing != expected
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        verb = "is not" if expected[row] else "is"
        yield (
            f"{one.title}: {int(wrong.sum())} rows break the policy on missing values; "
            f"{row_text(one.model.inputs, rows, row)} {verb} taken as missing"
        )
    if (found.rule[is_missing] != 0).any():
        yield f"{one.title}: a row with a missing value has a rule"
    if found.strengths is not None:
        if not np.isnan(found.strengths[:, is_missing]).all():
            yield f"{one.title}: a strength of a row with a missing value is a number"
        told = found.strengths[:, ~is_missing]
        if not ((told >= 0.0) & (told <= 1.0)).all():
            yield f"{one.title}: a strength is not between 0 and 1"


def _disagreement(
    one: Ready, rows: FloatArray, found: Outcome, title: str, other: Outcome
) -> Iterator[str]:
    wrong = unequal(found, other)
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        yield (
            f"{one.title}: {int(wrong.sum())} rows are answered differently from "
            f"{title}, first {row_text(one.model.inputs, rows, row)}"
        )
