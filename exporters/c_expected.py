"""What generated C answers, computed from the tables that it holds.

Each operation is one of numpy's on a number of the table's type, in the order in which
C performs it. In double the reference says the same, and a test holds them together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fuzzytree.exporters.c_tables import (
    HIGH_END,
    LOW_END,
    POINTS,
    Tables,
)
from fuzzytree.exporters.c_text import Numbers
from fuzzytree.exporters.c_tree import Question
from fuzzytree.model.rulebase import Variable

Real = np.float64 | np.float32


@np.errstate(all="ignore")
def axis_values(
    variables: Sequence[Variable],
    line: Mapping[str, int],
    row: Sequence[float],
    numbers: Numbers,
) -> list[Real] | None:
    """Return the value of each variable; None if one is not finite."""
    given = [numbers.kind(value) for value in row]
    found = list(given)
    for variable in variables:
        total: Real | None = None
        for part in variable.parts:
            (weight,) = numbers.nearest([part.weight], is_divisor=True)
            (centre,) = numbers.nearest([part.centre])
            one = numbers.kind(weight) * (
                given[line[part.input]] - numbers.kind(centre)
            )
            total = one if total is None else total + one
        if total is not None:
            found.append(total)
    return found if all(map(np.isfinite, found)) else None


def leaf(asked: Sequence[Question], values: Sequence[Real], numbers: Numbers) -> int:
    """Return the number of the leaf that a walk arrives at, from 1."""
    place = 0
    while place < len(asked):
        one = asked[place]
        (cut,) = numbers.nearest([one.cut])
        place = one.yes if values[one.line] > numbers.kind(cut) else one.no
    return place - len(asked) + 1


@np.errstate(all="ignore")
def strengths(
    tables: Tables, values: Sequence[Real], numbers: Numbers, *, is_product: bool
) -> tuple[float, ...]:
    """Return the strength of each rule."""
    one = numbers.kind(1)
    path = [one] * (max(tables.places.depth) + 1)
    found = [one] * len(tables.label)
    degrees: dict[int, Real] = {}
    places = tables.places
    for clause, depth, rule in zip(
        places.clause, places.depth, places.rule, strict=True
    ):
        if clause not in degrees:
            degrees[clause] = _clause(tables, clause, values, numbers)
        degree, before = degrees[clause], path[depth - 1]
        path[depth] = before * degree if is_product else min(before, degree)
        if rule:
            found[rule - 1] = path[depth]
    return tuple(map(float, found))


def _clause(
    tables: Tables, clause: int, values: Sequence[Real], numbers: Numbers
) -> Real:
    first, last = tables.clause_first[clause : clause + 2]
    one = numbers.kind(1)
    if first == last:
        return one
    x = values[tables.clause_line[clause]]
    degrees: list[Real] = []
    for term in tables.clause_term[first:last]:
        atoms = range(*tables.term_first[term : term + 2])
        degrees.append(min((_atom(tables, a, x, numbers) for a in atoms), default=one))
    return one - max(degrees) if tables.negated[clause] else max(degrees)


def _atom(tables: Tables, atom: int, x: Real, numbers: Numbers) -> Real:
    kind, count, first = tables.kind[atom], tables.count[atom], tables.first[atom]
    after = tables.first[atom + 1] if atom + 1 < len(tables.first) else None
    n = [numbers.kind(value) for value in tables.number[first:after]]
    zero, one = numbers.kind(0), numbers.kind(1)
    if kind in (LOW_END, HIGH_END):
        if (x > n[0]) == (kind == LOW_END):
            return one
        if count == 0:
            return zero
        q = _held((x - n[1]) / n[2], zero, one)
        return _held(_curve(n[3:], q) * q, zero, numbers.kind(numbers.below_one))
    if kind == POINTS:
        return _line(n[:count], n[count:], x, numbers)
    u = _held((x - n[0]) / n[1], zero, n[2])
    t = min(u, one)
    body = _held(one - t * _curve(n[4:], numbers.kind(2) * t - one), zero, one)
    w = _held((n[2] - u) / n[3], zero, one)
    square = w * w
    return body * (square * square)


def _line(
    values: Sequence[Real], degrees: Sequence[Real], x: Real, numbers: Numbers
) -> Real:
    low = sum(1 for value in values if x > value)
    if low in (0, len(values)):
        return degrees[low and -1]
    near, far = (low, low - 1) if degrees[low - 1] > 0 else (low - 1, low)
    if degrees[near] == degrees[far]:
        return degrees[near]
    largest = numbers.kind(numbers.largest)
    width = _held(values[far] - values[near], -largest, largest)
    found = degrees[near] + (x - values[near]) / width * (degrees[far] - degrees[near])
    return _held(found, *sorted((degrees[near], degrees[far])))


def _curve(coefficients: Sequence[Real], x: Real) -> Real:
    total = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        total = total * x + coefficient
    return total


def _held(value: Real, low: Real, high: Real) -> Real:
    return min(max(value, low), high)
