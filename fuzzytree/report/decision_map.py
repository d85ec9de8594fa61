"""Which class a rule base decides for on a grid of two axes, exactly."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.model.rulebase import Clause, RuleBase, Shape, shapes_of
from fuzzytree.numerics.exact import exact_degree

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model.contracts import FloatArray, IntArray

Degrees = list[Fraction]

_SAFE = 1e-9  # a lead, relative, that products of rounded degrees cannot turn
_TINY = 1e-280  # below it products may have lost digits


def exact_axes(
    rules: RuleBase, point: Mapping[str, Fraction]
) -> dict[str, Fraction] | None:
    """Return the value of every variable at a point; None if an input has no value.

    Example:
        >>> from fuzzytree.model.rulebase import Part, Rule, Variable
        >>> sums = Variable("sum", parts=(Part("a", 2.0, 1.0),))
        >>> rules = RuleBase("r", ("k",), (Variable("a"), sums), (Rule((), "k"),))
        >>> exact_axes(rules, {"a": Fraction(1, 3)})["sum"]
        Fraction(-4, 3)
    """
    if any(name not in point for name in rules.inputs):
        return None
    axes = {name: point[name] for name in rules.inputs}
    for variable in rules.variables:
        if variable.parts:
            axes[variable.name] = sum(
                (
                    Fraction(part.weight) * (point[part.input] - Fraction(part.centre))
                    for part in variable.parts
                ),
                start=Fraction(0),
            )
    return axes


def decisions(
    rules: RuleBase,
    across: tuple[str, Sequence[float]],
    down: tuple[str, Sequence[float]],
    others: Mapping[str, Fraction],
) -> IntArray:
    """Return the number of the class decided for at each point of a grid, -1 for none.

    Args:
        rules: The rule base.
        across: A variable and its values.
        down: Another variable and its values.
        others: The value of every other variable that the rules ask.

    Returns:
        Shape (values down, values across).

    Example:
        >>> from fuzzytree.model.rulebase import Band, Rule, Term, Variable
        >>> low = Term("low", Band(high=0.0))
        >>> axes = Variable("a", (low,)), Variable("b", (low,))
        >>> both = Rule((Clause("a", ("low",)), Clause("b", ("low",))), "k")
        >>> rules = RuleBase("r", ("k",), axes, (both,))
        >>> decisions(rules, ("a", [-1.0, 1.0]), ("b", [-1.0, 1.0]), {}).tolist()
        [[0, -1], [-1, -1]]
    """
    shapes = shapes_of(rules.variables)
    columns = _along(rules, across, shapes)
    lines = _along(rules, down, shapes)
    named = (across[0], down[0])
    fixed = [
        _folded(
            [
                _clause_degree(clause, shapes, others[clause.variable])
                for clause in rule.when
                if clause.variable not in named
            ],
            rules,
        )
        for rule in rules.rules
    ]
    weigh = _by_product if rules.semantics.conjunction == "product" else _by_rank
    winners = weigh(columns, lines, fixed)
    codes = {label: code for code, label in enumerate(rules.classes)}
    uncovered = rules.semantics.uncovered
    none = -1 if uncovered is None else codes[uncovered]
    classes = np.array([*(codes[rule.then] for rule in rules.rules), none])
    found: IntArray = classes[winners]
    return found


def _along(
    rules: RuleBase,
    axis: tuple[str, Sequence[float]],
    shapes: Mapping[tuple[str, str], Shape],
) -> list[Degrees]:
    """Return what each rule's clauses about an axis make, at each of its values."""
    name, values = axis
    asked = [[c for c in rule.when if c.variable == name] for rule in rules.rules]
    found: list[Degrees] = [[] for _ in rules.rules]
    for value in map(Fraction, values):
        known: dict[Clause, Fraction] = {}  # rules of a tree share clauses
        for when, degrees in zip(asked, found, strict=True):
            for clause in when:
                if clause not in known:
                    known[clause] = _clause_degree(clause, shapes, value)
            degrees.append(_folded([known[clause] for clause in when], rules))
    return found


def _clause_degree(
    clause: Clause, shapes: Mapping[tuple[str, str], Shape], value: Fraction
) -> Fraction:
    highest = max(exact_degree(shapes[clause.variable, t], value) for t in clause.terms)
    return 1 - highest if clause.negated else highest


def _folded(degrees: Degrees, rules: RuleBase) -> Fraction:
    one = Fraction(1)
    if rules.semantics.conjunction == "product":
        return math.prod(degrees, start=one)
    return min(degrees, default=one)


def _by_rank(
    columns: Sequence[Degrees], lines: Sequence[Degrees], fixed: Degrees
) -> IntArray:
    """Return the first of the strongest rules under min; their count for none.

    Only the order of degrees matters, so each one's rank among all stands for it.
    """
    all_degrees = {
        Fraction(0),
        *fixed,
        *(d for line in [*columns, *lines] for d in line),
    }
    rank = {degree: place for place, degree in enumerate(sorted(all_degrees))}
    across = np.array([[rank[d] for d in one] for one in columns])
    down = np.array([[rank[d] for d in one] for one in lines])
    still = np.array([rank[d] for d in fixed])[:, None, None]
    strengths = np.minimum(np.minimum(down[:, :, None], across[:, None, :]), still)
    return _first(strengths, strengths.max(axis=0) == rank[Fraction(0)])


def _by_product(
    columns: Sequence[Degrees], lines: Sequence[Degrees], fixed: Degrees
) -> IntArray:
    """Return the same under product: doubles where their lead is safe, else exactly."""
    across = np.array([[float(d) for d in one] for one in columns])
    down = np.array([[float(d) for d in one] for one in lines])
    still = np.array([float(d) for d in fixed])[:, None, None]
    strengths: FloatArray = down[:, :, None] * across[:, None, :] * still
    best = strengths.max(axis=0)
    close = (strengths >= best * (1.0 - _SAFE)).sum(axis=0) > 1
    found = _first(strengths, best == 0.0)
    for y, x in np.argwhere(close | (best < _TINY)).tolist():
        exact = [
            column[x] * line[y] * constant
            for column, line, constant in zip(columns, lines, fixed, strict=True)
        ]
        highest = max(exact)
        found[y, x] = exact.index(highest) if highest > 0 else len(exact)
    return found


def _first(
    strengths: npt.NDArray[Any], is_uncovered: npt.NDArray[np.bool_]
) -> IntArray:
    winners: IntArray = strengths.argmax(axis=0).astype(np.int64)
    winners[is_uncovered] = len(strengths)
    return winners
