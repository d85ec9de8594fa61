"""The winner of a rule base by search, without firing every rule.

Rules that begin with the same clauses form a tree, and a T-norm never grows along a
path: in floating point too, neither the minimum nor a product of numbers in [0, 1]
exceeds its smallest operand, and both are monotone. So whatever lies below a strength
that is already exceeded need not be looked at; what is equal must be, for a tie is part
of the answer. Most of it is decided by bounds of the clauses' degrees in the cells of
their axes (`envelope.py`), which are looked up and not computed:

1. Each row follows its best branches down to a rule. The lower bounds met are a lower
   bound of that rule's strength; the largest upper bound left aside bounds all others.
   Where that is smaller, the rule is the winner.
2. For the other rows all branches are followed whose upper bounds reach that. Where
   only one rule is left, it is the winner.
3. Else the strengths of those rules are computed, from the few terms that can be the
   largest of their clause in the row's cell, and compared. Rows with too many such
   branches are fired.

Where the plateaus of each node's branches are disjoint and cover the axis (relative
rules), nothing can reach the branch with degree 1: the search is a descent.

A search of few rows, or of rules that are fired in less time than their bounds are
looked up, would be slower than firing: such calls fire. So do all rows after some of
which more than half had to be fired.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from fuzzytree.model import (
    LR,
    Band,
    BoolArray,
    Clause,
    FloatArray,
    IntArray,
    Outcome,
    Points,
    RuleBase,
    Run,
    Shape,
    shapes_of,
)
from fuzzytree.runtimes.descent import AxisSplit, descend_by, plan_descent
from fuzzytree.runtimes.envelope import (
    Envelope,
    cells_of,
    exact_degrees,
    plan_envelope,
    spread,
)
from fuzzytree.runtimes.native_rules import fire_plan, firing_cost, plan_rules
from fuzzytree.runtimes.rows import axis_lines, checked, missing_rows, plan_axes

_CHUNK = 1 << 16  # rows: short steps would keep threads waiting for each other
_PAIRS = 1 << 11  # rows and rules whose strengths are computed together
_WIDEST = 1 << 20  # branches that are followed together
_LEAST_COST = 300.0  # of firing a row, in ns, from which bounds pay
_FOLLOW_COST = 1000.0  # from which it pays to follow the rows that bounds leave open
_BRANCH_COST = 150.0  # of following a branch, in ns
_CALL_COST = 2.5e6  # of firing all rows of a call, in ns, from which a search pays
_CROWD = 0.5  # the share of rows to be fired from which all the others are fired too
_ALWAYS = Clause("", ())


@dataclass(slots=True)
class PrefixNode:
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
class Net:
    """The forks as arrays, every rule at an end of its own; fork 0 is the first.

    Attributes:
        first: The first branch of each fork.
        count: The number of its branches.
        rule: The rule that ends there, from 1; 0 at a fork with branches.
        target: The fork behind each branch.
        line: The axis of its clause.
        entry: The first entry of its clause in the envelope.
        paths: The branches to each rule, one after another.
        begin: Where each rule's path begins, from rule 1.
        length: Its length.
        envelope: Bounds and degrees of the clauses.
        is_split: Whether all branches of each fork test the same axis.
        is_product: Whether degrees are multiplied.
        limit: The most branches of a row that are followed at once; rows with more
            are fired.
    """

    first: IntArray
    count: IntArray
    rule: IntArray
    target: IntArray
    line: IntArray
    entry: IntArray
    paths: IntArray
    begin: IntArray
    length: IntArray
    envelope: Envelope
    is_split: bool
    is_product: bool
    limit: int


@dataclass(frozen=True, slots=True)
class CellRows:
    """Values of the variables, and their cells, of some rows without missing ones."""

    lines: FloatArray
    values: FloatArray
    cells: IntArray

    def places(self, net: Net, branch: IntArray, row: IntArray) -> IntArray:
        """Return where the value of each branch's variable stands."""
        result = net.line.take(branch)
        result *= self.lines.shape[1]
        result += row
        return result

    def entries(self, net: Net, branch: IntArray, row: IntArray) -> IntArray:
        """Return the entry of each branch's clause for a row."""
        result = self.cells.take(self.places(net, branch, row))
        result += net.entry.take(branch)
        return result


@dataclass(frozen=True, slots=True)
class Frontier:
    """Rows at forks, and bounds of the strength of the way there."""

    row: IntArray
    fork: IntArray
    low: FloatArray
    high: FloatArray

    def take(self, which: IntArray) -> Frontier:
        """Return some of them."""
        return Frontier(
            self.row.take(which),
            self.fork.take(which),
            self.low.take(which),
            self.high.take(which),
        )


def search(rules: RuleBase) -> Run:
    """Return a function that finds the winning rule of every row.

    The more the rules share, the more is saved; it is as fast as firing at least.

    Returns:
        A function from values of shape (inputs, rows) to an outcome with the rule and
        the status that firing gives, to the bit, and without strengths.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
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
    plan = plan_rules(rules)
    fired, cost = fire_plan(plan, rules.inputs, with_strengths=False), firing_cost(plan)
    if cost < _LEAST_COST:
        return fired
    fewest = 1 + int(_CALL_COST / cost)
    limit = int(cost / _BRANCH_COST) if cost >= _FOLLOW_COST else 0
    pays: bool | None = None  # unknown until some rows were searched

    planned = functools.cache(lambda: _net(rules, forks, axes.line, limit))
    planning = threading.Lock()

    def run(values: FloatArray) -> Outcome:
        nonlocal pays
        array = checked(values, rules.inputs)
        count = array.shape[1]
        if count < fewest or (pays is False and count < fewest << 5):
            return fired(array)
        with planning:  # not before: calls of few rows do without it
            net = planned()
        rule, status = np.zeros((2, count), np.int64)
        crowded: list[IntArray] = []
        stop, size = 0, _CHUNK if pays else max(fewest, count >> 5)
        with np.errstate(all="ignore"):
            while stop < count:
                start, stop = stop, stop + size
                part = axis_lines(axes, array[:, start:stop])
                lines = part.astype(np.float64, copy=False)
                whole = np.arange(lines.shape[1])
                missing = missing_rows(lines)
                if missing is not None:
                    status[start:stop][missing] = 3
                    whole = np.flatnonzero(~missing)
                    lines = lines.take(whole, axis=1)
                whole += start
                rule[whole], status[whole], many = _search(net, lines)
                crowded.append(whole[many])
                pays, size = len(many) <= _CROWD * len(whole), _CHUNK
                if not pays:
                    break
        many = np.concatenate([*crowded, np.arange(min(stop, count), count)])
        if len(many):
            outcome = fired(array.take(many, axis=1))
            rule[many], status[many] = outcome.rule, outcome.status
        return Outcome(rule, status)

    return run


def _forks(rules: RuleBase) -> list[PrefixNode]:
    """Return the tree of the rules' beginnings; the first fork is the empty one."""
    forks = [PrefixNode()]
    known: dict[tuple[int, Clause], int] = {}
    for number, rule in enumerate(rules.rules, 1):
        here = 0
        for clause in rule.when:
            key = (here, clause)
            if key not in known:
                known[key] = len(forks)
                forks[here].clauses.append(clause)
                forks[here].targets.append(len(forks))
                forks.append(PrefixNode())
            here = known[key]
        forks[here].rules.append(number)
    return forks


def _splits(
    rules: RuleBase, forks: Sequence[PrefixNode], line: dict[str, int]
) -> list[AxisSplit] | None:
    """Return the forks as splits if the plateaus of each divide its axis, or None."""
    shapes = shapes_of(rules.variables)
    inner = [number for number, fork in enumerate(forks) if fork.clauses]
    place = {number: position for position, number in enumerate(inner)}
    splits: list[AxisSplit] = []
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
        splits.append(AxisSplit(line[fork.clauses[0].variable], cuts, targets))
    return splits


def _plateaus(
    fork: PrefixNode, shapes: dict[tuple[str, str], Shape]
) -> list[tuple[float | None, int]] | None:
    """Return where each plateau ends and which fork it leads to.

    None if they do not follow one another from end to end of one axis.
    """
    result: list[tuple[float, float | None, int]] = []
    for clause, target in zip(fork.clauses, fork.targets, strict=True):
        if clause.negated or clause.variable != fork.clauses[0].variable:
            return None
        for term in clause.terms:
            ends = _plateau(shapes[clause.variable, term])
            if ends is None:
                return None
            result.append((-np.inf if ends[0] is None else ends[0], ends[1], target))
    result.sort(key=lambda plateau: plateau[0])
    starts = [low for low, _, _ in result]
    if [-np.inf, *(high for _, high, _ in result)] != [*starts, None]:
        return None
    return [(high, target) for _, high, target in result]


def _plateau(shape: Shape) -> tuple[float | None, float | None] | None:
    """Return the ends of `low < x <= high` if a degree is 1 there and nowhere else.

    Points do that which reach 1 once, and by steps: a line up to 1 is rounded to it
    somewhat earlier.
    """
    match shape:
        case Band(low=low, high=high):
            return low, high
        case LR():
            return None
        case Points(values=values, degrees=degrees):
            at_one = [place for place, degree in enumerate(degrees) if degree == 1.0]
            if not at_one:
                return None
            first, last = at_one[0], at_one[-1]
            is_step = (
                last - first + 1 == len(at_one)
                and values[first] == values[max(first - 1, 0)]
                and values[last] == values[min(last + 1, len(values) - 1)]
            )
            if not is_step:
                return None
            return (
                values[first] if first > 0 else None,
                values[last] if last < len(values) - 1 else None,
            )


def _net(
    rules: RuleBase, forks: Sequence[PrefixNode], at_line: dict[str, int], limit: int
) -> Net:
    """Return the forks as arrays; rules that end at no leaf get a branch."""
    ends = [list(fork.rules) for fork in forks]
    branches = [list(zip(f.clauses, f.targets, strict=True)) for f in forks]
    for fork in range(len(forks)):
        if fork == 0 or branches[fork] or len(ends[fork]) > 1:
            for rule in ends[fork]:
                branches[fork].append((_ALWAYS, len(branches)))
                branches.append([])
                ends.append([rule])
            ends[fork] = []
    flat = [branch for part in branches for branch in part]
    clauses = list(dict.fromkeys(clause for clause, _ in flat))
    number = {clause: position for position, clause in enumerate(clauses)}
    envelope = plan_envelope(rules, clauses, at_line)
    count = np.array([len(part) for part in branches], np.int64)
    target = np.array([target for _, target in flat], np.int64)
    place = np.array([number[clause] for clause, _ in flat], np.int64)
    ending = np.array([part[0] if part else 0 for part in ends], np.int64)
    paths = _paths(ending, target, np.repeat(np.arange(len(count)), count))
    length = np.array([len(path) for path in paths], np.int64)
    return Net(
        np.cumsum(count) - count,
        count,
        ending,
        target,
        envelope.line.take(place),
        place * envelope.grid.count,
        np.concatenate(paths),
        np.cumsum(length) - length,
        length,
        envelope,
        all(len({c.variable for c, _ in part}) <= 1 for part in branches),
        rules.semantics.conjunction == "product",
        limit,
    )


def _paths(rule: IntArray, target: IntArray, source: IntArray) -> list[IntArray]:
    """Return the branches from the first fork to the end of each rule."""
    into = {int(fork): branch for branch, fork in enumerate(target)}
    result: dict[int, IntArray] = {}
    for fork in np.flatnonzero(rule).tolist():
        path: list[int] = []
        here = fork
        while here:
            path.append(into[here])
            here = int(source[into[here]])
        result[int(rule[fork])] = np.array(path[::-1], np.int64)
    return [result[number] for number in sorted(result)]


def _search(net: Net, lines: FloatArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return rule and status of rows without missing values, and those to be fired."""
    rows = CellRows(lines, lines.ravel(), cells_of(net.envelope.grid, lines).ravel())
    rule, floor, rival = _run_down(net, rows)
    status = np.zeros(lines.shape[1], np.int64)
    unsure = np.flatnonzero(rival >= floor)
    if not net.limit:
        return rule, status, unsure
    vague = unsure[floor.take(unsure) == 0]
    floor[vague] = _strengths(net, rows, vague, rule.take(vague))
    rule[unsure], status[unsure] = 0, 2
    crowded: list[IntArray] = [unsure[:0]]
    size = max(_WIDEST // len(net.length), 1)
    for start in range(0, len(unsure), size):
        part = unsure[start : start + size]
        crowded.append(_follow(net, rows, (rule, status, floor), part))
    return rule, status, np.concatenate(crowded)


def _run_down(net: Net, rows: CellRows) -> tuple[IntArray, FloatArray, FloatArray]:
    """Follow each row's best branches to a rule.

    Returns:
        The rule, a lower bound of its strength, and an upper bound of all others'.
    """
    lower = net.envelope.lower
    rule = np.zeros(rows.lines.shape[1], np.int64)
    floor, rival = np.zeros(len(rule)), np.zeros(len(rule))
    row, fork = np.arange(len(rule)), np.zeros(len(rule), np.int64)
    low, high, other = np.ones(len(rule)), np.ones(len(rule)), np.zeros(len(rule))
    while len(row):
        branch, entry, best, second = _best(net, rows, row, fork)
        np.maximum(other, _join(net, high, second), out=other)
        high = _join(net, high, best)
        low = _join(net, low, lower.take(entry).astype(np.float64))
        fork = net.target.take(branch)
        ended = net.rule.take(fork)
        if ended.any():
            done = np.flatnonzero(ended)
            where = row.take(done)
            rule[where], floor[where] = ended.take(done), low.take(done)
            rival[where] = other.take(done)
            stay = np.flatnonzero(ended == 0)
            row, fork = row.take(stay), fork.take(stay)
            low, high, other = low.take(stay), high.take(stay), other.take(stay)
    return rule, floor, rival


def _best(
    net: Net, rows: CellRows, row: IntArray, fork: IntArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Return the branch with the largest bound, its entry, the bound and the next."""
    upper = net.envelope.upper
    first, last = net.first.take(fork), net.count.take(fork) - 1
    cell = rows.cells.take(rows.places(net, first, row))
    branch, entry = first.copy(), cell + net.entry.take(first)
    best = upper.take(entry).astype(np.float64)
    second = np.zeros(len(row))
    fewest = int(last.min())
    for position in range(1, int(last.max()) + 1):
        other = first + np.minimum(last, position)
        if not net.is_split:
            cell = rows.cells.take(rows.places(net, other, row))
        other_entry = cell + net.entry.take(other)
        bound = upper.take(other_entry)
        if position > fewest:
            bound[last < position] = 0.0
        is_better = bound > best
        np.maximum(second, np.minimum(best, bound), out=second)
        np.maximum(best, bound, out=best)
        np.copyto(branch, other, where=is_better)
        np.copyto(entry, other_entry, where=is_better)
    return branch, entry, best, second


def _join(net: Net, before: FloatArray, degree: FloatArray) -> FloatArray:
    return before * degree if net.is_product else np.minimum(before, degree)


def _follow(
    net: Net,
    rows: CellRows,
    result: tuple[IntArray, IntArray, FloatArray],
    unsure: IntArray,
) -> IntArray:
    """Enter rule and status of some rows; return those to be fired.

    `result` has the rule and the status of each row, and a lower bound of its strength,
    which is raised; `unsure` are the rows to do.
    """
    rule, status, floor = result
    ends, crowded = _reachable(net, rows, floor, unsure)
    np.maximum.at(floor, ends.row, ends.low)
    ends = ends.take(np.flatnonzero(ends.high >= floor.take(ends.row)))
    count = np.bincount(ends.row, minlength=len(floor))
    is_sure = (count.take(ends.row) == 1) & (ends.low > 0)
    sure, others = (ends.take(np.flatnonzero(part)) for part in (is_sure, ~is_sure))
    rule[sure.row], status[sure.row] = net.rule.take(sure.fork), 0
    numbers = net.rule.take(others.fork)
    strength = _strengths(net, rows, others.row, numbers)
    _compare(rule, status, others.row, numbers, strength)
    return crowded


def _reachable(
    net: Net, rows: CellRows, floor: FloatArray, unsure: IntArray
) -> tuple[Frontier, IntArray]:
    """Return the ends that some rows may reach with their floor at least.

    Rows with too many branches at once come second, and are at no end.
    """
    is_crowded = np.zeros(len(floor), np.bool_)
    ones = np.ones(len(unsure))
    here = Frontier(unsure, np.zeros(len(unsure), np.int64), ones, ones)
    ends = [here.take(unsure[:0])]
    while len(here.row):
        owner, offset, _ = spread(net.count.take(here.fork))
        here = here.take(owner)
        branch = net.first.take(here.fork) + offset
        entry = rows.entries(net, branch, here.row)
        high = _join(net, here.high, net.envelope.upper.take(entry).astype(np.float64))
        stay = np.flatnonzero((high >= floor.take(here.row)) & (high > 0))
        low = net.envelope.lower.take(entry.take(stay)).astype(np.float64)
        low = _join(net, here.low.take(stay), low)
        fork = net.target.take(branch.take(stay))
        here = Frontier(here.row.take(stay), fork, low, high.take(stay))
        is_crowded |= np.bincount(here.row, minlength=len(floor)) > net.limit
        is_end = net.rule.take(fork) > 0
        ends.append(here.take(np.flatnonzero(is_end)))
        here = here.take(np.flatnonzero(~is_end & ~is_crowded.take(here.row)))
    joined = Frontier(
        np.concatenate([part.row for part in ends]),
        np.concatenate([part.fork for part in ends]),
        np.concatenate([part.low for part in ends]),
        np.concatenate([part.high for part in ends]),
    )
    stay = np.flatnonzero(~is_crowded.take(joined.row))
    return joined.take(stay), np.flatnonzero(is_crowded)


def _compare(
    rule: IntArray,
    status: IntArray,
    row: IntArray,
    ends: IntArray,
    strength: FloatArray,
) -> None:
    """Enter the strongest rule of each row, the first on a tie; none if all are 0."""
    order = np.lexsort((ends, -strength, row))
    row, ends, strength = row.take(order), ends.take(order), strength.take(order)
    is_first = _begins(row)
    first = np.flatnonzero(is_first & (strength > 0))
    rule[row.take(first)], status[row.take(first)] = ends.take(first), 0
    tied = ~is_first & (strength > 0)
    tied[1:] &= (strength[1:] == strength[:-1]) & is_first[:-1]
    status[row[tied]] = 1


def _strengths(net: Net, rows: CellRows, row: IntArray, rule: IntArray) -> FloatArray:
    """Return the strength of a rule in each row, bit-equal to firing."""
    result = np.empty(len(row))
    for start in range(0, len(row), _PAIRS):
        part = slice(start, start + _PAIRS)
        result[part] = _part_strengths(net, rows, row[part], rule[part] - 1)
    return result


def _part_strengths(
    net: Net, rows: CellRows, row: IntArray, path: IntArray
) -> FloatArray:
    """Return strengths; what is never the smallest degree of a path is left out."""
    envelope = net.envelope
    owner, offset, begin = spread(net.length.take(path))
    branch = net.paths.take(net.begin.take(path).take(owner) + offset)
    row = row.take(owner)
    entry = rows.entries(net, branch, row)
    if not net.is_product:
        highest = np.minimum.reduceat(envelope.upper.take(entry), begin)
        needed = np.flatnonzero(envelope.lower.take(entry) <= highest.take(owner))
        owner, row = owner.take(needed), row.take(needed)
        branch, entry = branch.take(needed), entry.take(needed)
        begin = np.flatnonzero(_begins(owner))
    x = rows.values.take(rows.places(net, branch, row))
    degree = exact_degrees(envelope, entry, x)
    if not net.is_product:
        least: FloatArray = np.minimum.reduceat(degree, begin)
        return least
    result, length = np.ones(len(path)), net.length.take(path)
    for position in range(int(length.max())):
        longer = np.flatnonzero(length > position)
        result[longer] *= degree.take(begin.take(longer) + position)
    return result


def _begins(owner: IntArray) -> BoolArray:
    """Return where a new owner begins among sorted ones."""
    result = np.ones(len(owner), np.bool_)
    np.not_equal(owner[1:], owner[:-1], out=result[1:])
    return result
