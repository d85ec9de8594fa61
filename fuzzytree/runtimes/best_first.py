"""The winner of a rule base by search, without firing every rule.

Rules that begin with the same clauses form a tree, and a T-norm never grows along a
path: in floating point too, neither the minimum nor a product of numbers in [0, 1]
exceeds its smallest operand. So whatever lies below a strength that is already
exceeded need not be looked at; what is equal must be, for a tie is part of the answer.

1. Each row first follows its best branches down to a rule: the strength of that rule
   is a lower bound of the best. The strongest branch that it left aside bounds all
   other rules; where that is smaller, the row is done.
2. For the other rows, the tree is walked once in order, at each node with the rows
   whose strength so far is not below their bound.

Where the plateaus of each node's branches are disjoint and cover the axis (relative
rules), the bound is 1 after the first step and no other branch can reach it: the second
step has nothing to do, and the first is a descent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.contracts import Outcome, Run
from fuzzytree.rulebase import Band, Clause, RuleBase, Shape
from fuzzytree.runtimes.axes import axis_lines, missing_rows, plan_axes
from fuzzytree.runtimes.degrees import NUMBERS
from fuzzytree.runtimes.descent import Split, plan_descent
from fuzzytree.runtimes.native_rules import Degrees, clause_degrees, plan_degrees
from fuzzytree.runtimes.native_tree import descend_by
from fuzzytree.runtimes.rows import checked

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.contracts import FloatArray, IntArray

    Reals = npt.NDArray[np.floating[Any]]

_CHUNK = 1 << 17  # rows: a node's few operations shall be wide
_CELLS, _FEWEST = 1 << 17, 256  # degrees and rows that go through a fork together


@dataclass(slots=True)
class Fork:
    """A common beginning of rules.

    Attributes:
        clauses: What may follow.
        targets: The fork behind each clause.
        rules: The rules that end here, from 1.
    """

    clauses: list[Clause] = field(default_factory=list[Clause])
    targets: list[int] = field(default_factory=list[int])
    rules: list[int] = field(default_factory=list[int])


@dataclass(frozen=True, slots=True)
class Look:
    """How to compute the degrees of a fork's clauses."""

    lines: IntArray
    degrees: Degrees
    places: IntArray


@dataclass(slots=True)
class Found:
    """What is known of each row.

    Attributes:
        rule: The winner so far.
        status: Its status.
        best: Its strength.
        bound: What the winner's strength is at least.
        rival: What any rule off the row's best branches is at most.
    """

    rule: IntArray
    status: IntArray
    best: Reals
    bound: Reals
    rival: Reals


def search(rules: RuleBase) -> Run:
    """Return a function that finds the winning rule of every row.

    Args:
        rules: Any rule base. The more its rules share, the more is saved.

    Returns:
        A function from values of shape (inputs, rows) to an outcome with the rule and
        the status that firing gives, to the bit, and without strengths.

    Example:
        >>> from fuzzytree.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(0), "raw")
        >>> search(rules)(np.zeros((len(rules.inputs), 2))).rule.shape
        (2,)
    """
    forks = _forks(rules)
    axes = plan_axes(rules.variables)
    splits = _splits(rules, forks, axes.line)
    if splits is not None:
        return descend_by(axes, plan_descent(splits, axes.dtype), rules.inputs)
    looks = [_look(rules, fork, axes.line) for fork in forks]
    is_product = rules.semantics.conjunction == "product"

    def run(values: FloatArray) -> Outcome:
        array = checked(values, rules.inputs)
        answer = np.zeros((2, array.shape[1]), np.int64)
        with np.errstate(all="ignore"):
            for start in range(0, array.shape[1], _CHUNK):
                lines = axis_lines(axes, array[:, start : start + _CHUNK])
                missing = missing_rows(lines)
                found = _search(forks, looks, lines, is_product=is_product)
                found.status[found.best == 0] = 2
                if missing is not None:
                    found.rule[missing], found.status[missing] = 0, 3
                answer[0, start : start + _CHUNK] = found.rule
                answer[1, start : start + _CHUNK] = found.status
        return Outcome(answer[0], answer[1])

    return run


def _forks(rules: RuleBase) -> list[Fork]:
    """Return the tree of the rules' beginnings; the first fork is the empty one."""
    forks = [Fork()]
    known: dict[tuple[int, Clause], int] = {}
    for number, rule in enumerate(rules.rules, 1):
        here = 0
        for clause in rule.when:
            key = (here, clause)
            if key not in known:
                known[key] = len(forks)
                forks[here].clauses.append(clause)
                forks[here].targets.append(len(forks))
                forks.append(Fork())
            here = known[key]
        forks[here].rules.append(number)
    return forks


def _splits(
    rules: RuleBase, forks: Sequence[Fork], line: dict[str, int]
) -> list[Split] | None:
    """Return the forks as splits if the plateaus of each divide its axis, or None."""
    shapes = {(v.name, t.name): t.shape for v in rules.variables for t in v.terms}
    inner = [number for number, fork in enumerate(forks) if fork.clauses]
    place = {number: position for position, number in enumerate(inner)}
    splits: list[Split] = []
    for number, fork in enumerate(forks):
        if len(fork.rules) != (number not in place):
            return None
        if number not in place:
            continue
        plateaus = _plateaus(fork, shapes)
        if plateaus is None:
            return None
        targets = tuple(
            place[target] if target in place else -forks[target].rules[0]
            for _, target in plateaus
        )
        cuts = tuple(high for high, _ in plateaus if high is not None)
        splits.append(Split(line[fork.clauses[0].variable], cuts, targets))
    return splits


def _plateaus(
    fork: Fork, shapes: dict[tuple[str, str], Shape]
) -> list[tuple[float | None, int]] | None:
    """Return where each plateau ends and which fork it leads to.

    None if they do not follow one another from end to end of one axis.
    """
    bands: list[tuple[float, Band, int]] = []
    for clause, target in zip(fork.clauses, fork.targets, strict=True):
        if clause.negated or clause.variable != fork.clauses[0].variable:
            return None
        for term in clause.terms:
            shape = shapes[clause.variable, term]
            if not isinstance(shape, Band):
                return None
            low = -np.inf if shape.low is None else shape.low
            bands.append((low, shape, target))
    bands.sort(key=lambda band: band[0])
    ends = [None, *(band.high for _, band, _ in bands)]
    starts = [*(band.low for _, band, _ in bands), None]
    if ends != starts or len({low for low, _, _ in bands}) < len(bands):
        return None
    return [(band.high, target) for _, band, target in bands]


def _look(rules: RuleBase, fork: Fork, line: dict[str, int]) -> Look:
    variables = list(dict.fromkeys(clause.variable for clause in fork.clauses))
    at_line = {name: position for position, name in enumerate(variables)}
    numbers = NUMBERS["float64"]
    degrees = plan_degrees(rules, fork.clauses, at_line, numbers, 1 << 12)
    places = [degrees.line[clause] for clause in fork.clauses]
    lines = [line[name] for name in variables]
    return Look(np.array(lines, np.int64), degrees, np.array(places, np.int64))


def _search(
    forks: Sequence[Fork], looks: Sequence[Look], lines: Reals, *, is_product: bool
) -> Found:
    found = _run_down(forks, looks, lines, is_product=is_product)
    rest = np.flatnonzero(found.rival >= found.bound)
    found.rule[rest], found.best[rest] = 0, 0.0
    todo = [(0, rest, np.ones(len(rest)))] if len(rest) else []
    while todo:
        number, here, strength = todo.pop()
        fork = forks[number]
        for rule in fork.rules:
            _meet(found, rule, here, strength)
        if not fork.clauses:
            continue
        degrees = _degrees(looks[number], lines, here)
        floor = found.bound.take(here)
        for target, degree in zip(reversed(fork.targets), degrees[::-1], strict=True):
            total = strength * degree if is_product else np.minimum(strength, degree)
            alive = np.flatnonzero((total >= floor) & (total > 0))
            if len(alive):
                todo.append((target, here.take(alive), total.take(alive)))
    return found


def _run_down(
    forks: Sequence[Fork], looks: Sequence[Look], lines: Reals, *, is_product: bool
) -> Found:
    """Follow each row's best branches to a rule, and note the strongest branch left."""
    rows = lines.shape[1]
    found = Found(
        np.zeros(rows, np.int64),
        np.zeros(rows, np.int64),
        np.zeros(rows),
        np.zeros(rows),
        np.zeros(rows),
    )
    todo = [(0, np.arange(rows), np.ones(rows))]
    while todo:
        number, here, strength = todo.pop()
        fork = forks[number]
        if fork.rules:
            found.bound[here] = np.maximum(found.bound.take(here), strength)
            found.best[here], found.rule[here] = strength, fork.rules[0]
            if fork.clauses or len(fork.rules) > 1:
                found.rival[here] = np.maximum(found.rival.take(here), strength)
        if not fork.clauses:
            continue
        degrees = _degrees(looks[number], lines, here)
        choice = degrees.argmax(axis=0)
        best = degrees.max(axis=0)
        total = strength * best if is_product else np.minimum(strength, best)
        if len(fork.targets) > 1:
            degrees[choice, np.arange(len(here))] = 0.0
            left = degrees.max(axis=0)
            left = strength * left if is_product else np.minimum(strength, left)
            found.rival[here] = np.maximum(found.rival.take(here), left)
        for position, target in enumerate(fork.targets):
            mine = np.flatnonzero(choice == position)
            if len(mine):
                todo.append((target, here.take(mine), total.take(mine)))
    return found


def _degrees(look: Look, lines: Reals, here: IntArray) -> Reals:
    """Return the degree of each clause of a fork in some of the rows."""
    found = np.empty((len(look.places), len(here)))
    size = max(_CELLS // (look.degrees.atoms + look.degrees.count), _FEWEST)
    for start in range(0, len(here), size):
        part = here[start : start + size]
        values = np.array([lines[line].take(part) for line in look.lines])
        degrees = clause_degrees(look.degrees, values)
        found[:, start : start + size] = degrees.take(look.places, axis=0)
    return found


def _meet(found: Found, rule: int, here: IntArray, strength: Reals) -> None:
    """Compare a rule with the best so far of some rows."""
    best = found.best.take(here)
    better = here[strength > best]
    found.best[better] = strength[strength > best]
    found.rule[better], found.status[better] = rule, 0
    equal = here[strength == best]
    found.status[equal] = 1
    found.rule[equal] = np.minimum(found.rule.take(equal), rule)
    found.bound[here] = np.maximum(found.bound.take(here), strength)
