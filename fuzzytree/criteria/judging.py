"""A runtime's answers held against the exact ones, within a bound for each row.

The bound adds two proved ones: of the runtime's number type against the same operations
in double (`numerics.bounds`), and of those against the exact strengths. The latter is
the width of the oracle's intervals (`numerics.enclosures`): they are laid around what
the operations give in double, so they hold those strengths beside the exact ones.

A class may differ where the exact margin is at most twice the bound, and nowhere else;
the path of a tree only in rows within rounding of a cut.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.comparing import Answers, labels
from fuzzytree.contracts import Dtype, Model, Outcome
from fuzzytree.criteria.carriers import Ready, answered, row_text
from fuzzytree.criteria.specials import missing_rows
from fuzzytree.numerics.bounds import UNIT, axis_errors, strength_bounds
from fuzzytree.numerics.enclosures import (
    Enclosure,
    axis_value,
    clause_enclosure,
    degree_enclosure,
    strength_enclosure,
)
from fuzzytree.numerics.oracle import Decided, decide, strength_errors
from fuzzytree.rulebase import RuleBase
from fuzzytree.runtimes.axes import axis_lines, plan_axes
from fuzzytree.tree import FuzzyTree

if TYPE_CHECKING:
    from fuzzytree.contracts import FloatArray
    from fuzzytree.criteria.carriers import BoolArray

_DOUBLE = 2.0**-29  # a rounding of double, in roundings of float32


class Observed(NamedTuple):
    """How far a runtime was from the exact answers.

    Attributes:
        rows: Rows that were asked.
        worst: The largest error of a strength that is certain, in rows with a bound; 0
            for a tree.
        allowed: The bound in the row of that error.
        largest: The same in all rows.
        flips: Rows whose class differs from the exact one.
        unbounded: Rows in which the bound is 1 and proves nothing.
        faults: What is beyond the bound, in sentences.
    """

    rows: int
    worst: float
    allowed: float
    largest: float
    flips: int
    unbounded: int
    faults: tuple[str, ...]


def observed(one: Ready, values: FloatArray, exact: Decided | None = None) -> Observed:
    """Run rows and hold the answers against the exact ones.

    Rows that are missing in the number type and not in double (beyond float32) are
    left to criterion N6.

    Args:
        one: The runtime, with its model.
        values: Shape (inputs, rows).
        exact: The exact answers to these rows, if they are known already.
    """
    truth = decide(one.model, values) if exact is None else exact
    found, warning = answered(one, values)
    dtype = one.runtime.dtype
    known = ~missing_rows(one.model, values, dtype)
    allowed = allowed_errors(one, values)
    flips = (labels(Answers(one.title, one.model, found)) != truth.label) & known
    if isinstance(one.model, RuleBase):
        excused = truth.margin <= 2.0 * allowed
    else:
        excused = near_cut(one.model, values, dtype)
    wrong = flips & ~excused
    low = np.zeros(values.shape[1])
    if found.strengths is not None and isinstance(one.model, RuleBase):
        low = strength_errors(one.model, values, found.strengths)[0]
        low[~known] = 0.0
        wrong |= low > allowed
    bounded = np.where(allowed < 1.0, low, 0.0)
    faults = [f"{one.title}: it warns: {warning}"] if warning else []
    if wrong.any():
        faults.append(_fault(one, values, found, wrong, low, allowed))
    worst = int(np.argmax(bounded)) if low.size else 0
    return Observed(
        values.shape[1],
        float(bounded[worst]) if low.size else 0.0,
        float(allowed[worst]) if low.size else 0.0,
        float(low.max(initial=0.0)),
        int(flips.sum()),
        int((known & (allowed >= 1.0)).sum()),
        tuple(faults),
    )


def allowed_errors(one: Ready, values: FloatArray) -> FloatArray:
    """Return by how much a strength may differ from the exact one, for each row."""
    if not isinstance(one.model, RuleBase):
        return np.zeros(values.shape[1])
    allowed = double_errors(one.model, values)
    if one.runtime.bound is not None:
        allowed = allowed + one.runtime.bound(one.model)[0]
    else:
        allowed = allowed + strength_bounds(one.model, one.runtime.dtype, values)[0]
    return np.minimum(allowed, 1.0)


def double_errors(rules: RuleBase, values: FloatArray) -> FloatArray:
    """Return by how much a strength in double may differ from the exact one, by row.

    Example:
        >>> from fuzzytree.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(0))
        >>> bool(double_errors(rules, np.zeros((4, 1)))[0] < 1e-13)
        True
    """
    named = dict(zip(rules.inputs, values, strict=True))
    widest: FloatArray = np.zeros(values.shape[1])
    start = Enclosure(np.ones_like(widest), np.ones_like(widest))
    is_product = rules.semantics.conjunction == "product"
    with np.errstate(all="ignore"):
        axes = {v.name: axis_value(v, named) for v in rules.variables}
        terms = {
            (v.name, t.name): degree_enclosure(t.shape, axes[v.name])
            for v in rules.variables
            for t in v.terms
        }
        for rule in rules.rules:
            found = start
            for clause in rule.when:
                degrees = [terms[clause.variable, name] for name in clause.terms]
                found = strength_enclosure(
                    found, clause_enclosure(clause, degrees), is_product=is_product
                )
            np.fmax(widest, found.high - found.low, out=widest)
    return widest * (1.0 + 2.0**-50)


def near_cut(tree: Model, values: FloatArray, dtype: Dtype) -> BoolArray:
    """Return the rows in which rounding can put a value on another side of a cut."""
    near = np.zeros(values.shape[1], np.bool_)
    if not isinstance(tree, FuzzyTree):
        return near
    plan = plan_axes(tree.variables)
    variables = {variable.name: variable for variable in tree.variables}
    unit = 1.0 if dtype == "float32" else _DOUBLE
    with np.errstate(all="ignore"):
        lines = axis_lines(plan, values)
        for node in tree.nodes:
            variable = variables[node.variable]
            if not variable.parts and dtype != "float32":
                continue  # nothing is rounded before the comparison
            slack = axis_errors(variable, tree.inputs, values) * unit
            for cut in node.cuts:
                reach = slack + 2.0 * UNIT * unit * abs(cut) + 2.0**-149 * unit
                near |= np.abs(lines[plan.line[node.variable]] - cut) <= reach
    return near


def _fault(
    one: Ready,
    values: FloatArray,
    found: Outcome,
    wrong: BoolArray,
    low: FloatArray,
    allowed: FloatArray,
) -> str:
    row = int(np.flatnonzero(wrong)[np.argmax(low[wrong])])
    text = f"{one.title}: {int(wrong.sum())} of {wrong.size} rows are beyond the bound"
    where = row_text(one.model.inputs, values, row)
    if low[row] > allowed[row]:
        sizes = f"strengths off by {low[row]:.3g}, {allowed[row]:.3g} allowed"
        return f"{text}: {sizes}: {where}"
    return f"{text}: rule {found.rule[row]} wins and another is right: {where}"
