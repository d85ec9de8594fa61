"""The crisp regions of a tree: which part of the inputs each leaf decides.

A branch is taken where its variable lies in one of the intervals that it owns, open
below and closed above. So a leaf's region is a product of unions of intervals, one for
each variable on its path, and nothing of it is rounded. Where a variable is a
combination, its interval is a linear condition on the inputs.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from fractions import Fraction

from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import (
    Domain,
    DomainSide,
    snap,
    span,
    variable_value,
)
from fuzzytree.auditing.decide.linear import Row, feasible, row_of
from fuzzytree.model import Branch, Document, Value, Variable, intervals, root_of
from fuzzytree.numerics import outwards

Interval = tuple[float | None, float | None]
"""An open lower and a closed upper end; None is no end."""

Union = tuple[Interval, ...]
"""Intervals in order, apart from each other."""

EVERYWHERE: Union = ((None, None),)


class Region(Value, frozen=True):
    """What a leaf decides."""

    leaf: int  # the leaf's number, from 1
    label: str  # its class
    # the variables of its path, in that order, each with the values that lead on; none
    # if no value does
    sides: tuple[tuple[str, Union], ...]


def regions(tree: Document) -> tuple[Region, ...]:
    """Return the region of each leaf, in the order of the leaves."""
    todo: list[tuple[Branch, dict[str, Union]]] = [(root_of(tree), {})]
    result: list[Region] = []
    while todo:
        branch, sides = todo.pop()
        if branch.leaf is not None:
            label = tree.leaves[branch.leaf - 1].label
            result.append(Region(branch.leaf, label, tuple(sides.items())))
        elif branch.node is not None:
            node = tree.nodes[branch.node - 1]
            before = sides.get(node.variable, EVERYWHERE)
            for index in reversed(range(len(node.branches))):
                owned = tuple(
                    interval
                    for owner, interval in zip(
                        node.owners, intervals(node), strict=True
                    )
                    if owner == index
                )
                step = {**sides, node.variable: common(before, owned)}
                todo.append((node.branches[index], step))
    return tuple(result)


def common(first: Union, second: Union) -> Union:
    """Return what two unions of intervals have in common.

    Example:
        >>> common(((None, 1.0), (2.0, None)), ((0.0, 3.0),))
        ((0.0, 1.0), (2.0, 3.0))
    """
    met = (
        (_later(a, b), _earlier(c, d))
        for (a, c), (b, d) in itertools.product(first, second)
    )
    return tuple(
        (low, high) for low, high in met if low is None or high is None or low < high
    )


def _later(a: float | None, b: float | None) -> float | None:
    return b if a is None else a if b is None else max(a, b)


def _earlier(a: float | None, b: float | None) -> float | None:
    return b if a is None else a if b is None else min(a, b)


def box_count(region: Region) -> int:
    """Return of how many boxes a region is made, without looking at a domain."""
    return math.prod(len(union) for _, union in region.sides)


def boxes(region: Region, tree: Document, domain: Domain) -> Iterator[Domain]:
    """Yield the boxes of a region within a domain; those that are empty are left out.

    A box has a side for each side of the domain and for each combination on the path.
    Whether the inputs can meet the sides of combinations is left to `point_in`.
    """
    variables = {variable.name: variable for variable in tree.variables}
    sides = {side.variable: side for side in domain.sides}
    choices: list[list[DomainSide]] = []
    for name, union in region.sides:
        whole = sides.pop(name, None) or _whole(variables[name], domain)
        choices.append([met for met in (cut_side(whole, of) for of in union) if met])
    order = {name: place for place, name in enumerate(variables)}
    for chosen in itertools.product(*choices):
        sides_of_box = (*sides.values(), *chosen)
        yield Domain(tuple(sorted(sides_of_box, key=lambda side: order[side.variable])))


def _whole(variable: Variable, domain: Domain) -> DomainSide:
    """Return all values of a combination on a domain, rounded outwards."""
    low, high = span(variable, domain)
    return DomainSide(variable.name, outwards(low)[0], outwards(high)[1])


def cut_side(side: DomainSide, interval: Interval) -> DomainSide | None:
    """Return the part of a side within an interval, None if there is none.

    Example:
        >>> cut_side(DomainSide("x", 0.0, 2.0), (None, 0.0)).high
        0.0
        >>> cut_side(DomainSide("x", 0.0, 2.0), (2.0, None)) is None
        True
    """
    below, above = interval
    missing = side.missing
    if missing is not None and not _is_in(missing, interval):
        missing = None
    low, is_open = side.low, side.is_open
    if below is not None and below >= low:
        low, is_open = below, True
    high = side.high if above is None else min(side.high, above)
    values = tuple(value for value in side.values if _is_in(value, interval))
    if side.is_whole:
        low, is_open = float(math.floor(low) + is_open), False
        high = float(math.floor(high))
    elif values:
        low, high, is_open = values[0], values[-1], False
    if (
        not low > high
        and not (low == high and is_open)
        and bool(values) == bool(side.values)
    ):
        return replace(
            side, low=low, high=high, is_open=is_open, values=values, missing=missing
        )
    if missing is None:
        return None
    return DomainSide(side.variable, missing, missing, side.origin, values=(missing,))


def _is_in(value: float, interval: Interval) -> bool:
    below, above = interval
    return (below is None or value > below) and (above is None or value <= above)


def point_in(box: Domain, tree: Document) -> dict[str, Fraction] | None:
    """Return a point of the inputs in a box, deep inside it; None if there is none.

    Its coordinates have few digits.
    """
    number = {name: place for place, name in enumerate(tree.inputs)}
    variables = {variable.name: variable for variable in tree.variables}
    ranges: dict[str, tuple[Fraction, Fraction]] = {}
    rows: list[Row] = []
    for side in box.sides:
        ranges[side.variable] = side.ends
        variable = variables[side.variable]
        rows.append(row_of(variable, number, side.ends, is_open_low=side.is_open))
    wanted = [ranges[name] for name in tree.inputs]
    inner = [
        row
        if row.low == row.high
        else row._replace(is_open_low=True, is_open_high=True)
        for row in rows
    ]
    result = feasible(wanted, inner) or feasible(wanted, rows)
    if result is None:
        return None
    point = dict(zip(tree.inputs, result, strict=True))
    return snap(box, tree.variables, point)


def leaf_at(tree: Document, point: Mapping[str, Fraction]) -> int:
    """Return the number of the leaf that a point of the inputs reaches, exactly."""
    variables = {variable.name: variable for variable in tree.variables}
    number = 1 if tree.nodes else None
    leaf = 1
    while number is not None:
        node = tree.nodes[number - 1]
        value = variable_value(variables[node.variable], point)
        passed = sum(1 for cut in node.cuts if value > cut)
        branch = node.branches[node.owners[passed]]
        number, leaf = branch.node, branch.leaf or leaf
    return leaf
