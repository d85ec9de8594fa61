"""Compare predictions with exact arithmetic: what a number type can change, and did."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import NamedTuple, cast

import numpy as np

from fuzzytree.checking.comparing import ModelRun, RowSet, labels
from fuzzytree.model import (
    BoolArray,
    Certified,
    Document,
    Dtype,
    FloatArray,
    FuzzyTree,
    Model,
    RuleBase,
)
from fuzzytree.numerics import (
    Decisions,
    certify,
    open_paths,
    strength_bounds,
    strength_errors,
)
from fuzzytree.runtimes import axis_lines, plan_axes
from fuzzytree.semantics import Status

_SHOWN = 5  # differing rows listed for each number type


def compare_exact(
    actual: ModelRun, truth: Decisions, rows: RowSet, *, dtype: Dtype
) -> Certified:
    """Compare predictions with the exact ones, within what a number type may change.

    A strength may be off by its bound in that row; a class may differ where the exact
    margin is at most twice that, or where a value lies within its rounding from a cut
    of the tree, and nowhere else.

    Rows of the data are counted if there are any.
    """
    allowed = np.zeros(len(rows.numbers))
    if actual.outcome.strengths is not None:
        rules = cast("RuleBase", actual.model)  # no path has strengths
        allowed, _ = strength_bounds(rules, dtype, rows.values)
    low, flips, close = exact_errors(actual, truth, rows.values, dtype, allowed)
    wrong = flips & ~close
    if low is not None:
        wrong |= (low > allowed) & (allowed < 1.0)
    is_data = len(rows.numbers) > rows.probes
    own = rows.numbers >= (rows.probes if is_data else 0)
    model = cast("Model", actual.model)
    facts = certify(model, dtype, rows.values[:, own] if is_data else None)
    if facts.reasons and not is_data:
        facts = certify(model, dtype, rows.values)
    statuses = actual.outcome.status, truth.status
    weighed = own & (statuses[0] != Status.MISSING) & (statuses[1] != Status.MISSING)
    is_covered, should_be = actual.outcome.rule > 0, truth.rule > 0
    flipped = truth.margin_high[own & flips]
    bounded = own & (allowed < 1.0)
    return Certified(
        actual.title,
        dtype,
        facts.sentence,
        facts.delta,
        facts.origin,
        "data" if is_data else "probes",
        int(own.sum()),
        None if low is None else float(low[bounded].max(initial=0.0)),
        int((own & close).sum()),
        int((own & flips).sum()),
        float(flipped.max()) if low is not None and flipped.size else None,
        int((should_be & ~is_covered & weighed).sum()),
        int((is_covered & ~should_be & weighed).sum()),
        int((own & (allowed >= 1.0)).sum()) if low is not None else 0,
        "DISAGREES" if wrong.any() else "agrees",
        tuple(_exact_texts(actual, truth, rows, wrong, allowed, low)),
    )


class ExactErrors(NamedTuple):
    """How far predictions are from the exact ones, in each row.

    Attributes:
        low: By how much a strength is off at least; None without strengths.
        flips: Whether the class differs.
        close: Whether it may: the exact margin is at most twice what is allowed, or a
            value lies within its rounding from a cut of a tree.
    """

    low: FloatArray | None
    flips: BoolArray
    close: BoolArray


def exact_errors(
    actual: ModelRun,
    truth: Decisions,
    values: FloatArray,
    dtype: Dtype,
    allowed: FloatArray,
) -> ExactErrors:
    """Return the errors of predictions, where a strength may be off by `allowed`."""
    flips = labels(actual) != truth.label
    model, strengths = actual.model, actual.outcome.strengths
    if not model.rules:
        near = open_paths(cast("FuzzyTree", model), dtype, values)
        return ExactErrors(None, flips, near)
    rules = cast("RuleBase", model)
    low = None
    if strengths is not None:
        low, _ = strength_errors(rules, values, strengths, truth.fractions)
    return ExactErrors(low, flips, truth.margin <= 2.0 * allowed)


def missing_rows(
    model: Document,
    values: FloatArray,
    dtype: Dtype,
    names: Collection[str] | None = None,
) -> BoolArray:
    """Return which rows count as missing, by the declared policy.

    A row is missing if the value of a variable, of any or of those with these `names`,
    is not finite in the type of axes: inputs rounded to it, combinations added up in
    their order, each step rounded.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1, inputs=1, leaves=2)
        >>> missing_rows(tree, np.array([[1.0, np.nan, 1e39]]), "float32").tolist()
        [False, True, True]
    """
    plan = plan_axes(
        model.variables, np.dtype("float32" if dtype == "float32" else "float64")
    )
    with np.errstate(all="ignore"):
        lines = axis_lines(plan, values)
    if names is not None:
        lines = lines[np.array([plan.line[name] for name in names], np.intp)]
    return np.asarray(~np.isfinite(lines).all(axis=0))


def _exact_texts(
    actual: ModelRun,
    truth: Decisions,
    rows: RowSet,
    wrong: BoolArray,
    allowed: FloatArray,
    low: FloatArray | None,
) -> Iterator[str]:
    worst = np.flatnonzero(wrong)
    if low is not None:
        worst = worst[np.argsort(-low[worst], kind="stable")]
    classes = [*actual.model.classes, "no class"]
    for row in worst[:_SHOWN].tolist():
        rule, label = int(actual.outcome.rule[row]), classes[labels(actual)[row]]
        text = f"{rows.text(row)}: exactly {classes[truth.label[row]]} "
        text += f"(rule {truth.rule[row]}), {actual.title} {label}"
        text += f" (rule {rule})" if rule else ""
        if low is not None:
            strengths = actual.outcome.strengths
            if strengths is not None and rule:
                text += f" with {float(strengths[rule - 1, row])!r}"
            text += f"; a strength is off by {low[row]:.2g}, and "
            text += f"{allowed[row]:.2g} is allowed"
        yield text
