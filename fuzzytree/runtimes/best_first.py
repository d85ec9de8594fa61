"""The winner of a rule base by search, without firing every rule.

Rules that begin with the same propositions form a tree, and a T-norm never grows along
a
path: in floating point too, neither the minimum nor a product of numbers in [0, 1]
exceeds its smallest operand, and both are monotone. So bounds of the propositions'
degrees in the cells of their axes (`envelope.py`), which are looked up and not
computed, bound the strengths of all rules below a branch.

Each row follows its best branches down to a rule. The lower bounds that it met are a
lower bound of that rule's strength; the largest upper bound left aside bounds all
others. Where that is smaller, the rule is the winner; the other rows are fired.

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
    FloatArray,
    IntArray,
    Outcome,
    Points,
    Proposition,
    RuleBase,
    Run,
    Shape,
    shapes_of,
)
from fuzzytree.runtimes.descent import AxisSplit, descend_by, plan_descent
from fuzzytree.runtimes.envelope import Envelope, cells_of, plan_envelope
from fuzzytree.runtimes.native_rules import fire_plan, firing_cost, plan_rules
from fuzzytree.runtimes.rows import axis_lines, checked, missing_rows, plan_axes

_CHUNK = 1 << 16  # rows: short steps would keep threads waiting for each other
_LEAST_COST = 300.0  # of firing a row, in ns, from which bounds pay
_CALL_COST = 2.5e6  # of firing all rows of a call, in ns, from which a search pays
_CROWD = 0.5  # the share of rows to be fired from which all the others are fired too
_ALWAYS = Proposition("", ())


@dataclass(slots=True)
class PrefixNode:
    """A common beginning of rules.

    Attributes:
        propositions: What may follow.
        targets: The fork behind each proposition.
        rules: The rules that end here, from 1.
    """

    propositions: list[Proposition] = field(default_factory=list[Proposition])
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
        line: The axis of its proposition.
        entry: The first entry of its proposition in the envelope.
        envelope: Bounds of the propositions.
        is_product: Whether degrees are multiplied.
    """

    first: IntArray
    count: IntArray
    rule: IntArray
    target: IntArray
    line: IntArray
    entry: IntArray
    envelope: Envelope
    is_product: bool


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
    forks = forks_of(rules)
    axes = plan_axes(rules.variables)
    splits = splits_of(rules, forks, axes.line)
    if splits is not None:
        return descend_by(axes, plan_descent(splits, axes.dtype), rules.inputs)
    plan = plan_rules(rules)
    fired, cost = fire_plan(plan, rules.inputs, with_strengths=False), firing_cost(plan)
    if cost < _LEAST_COST:
        return fired
    fewest = 1 + int(_CALL_COST / cost)
    pays: bool | None = None  # unknown until some rows were searched

    planned = functools.cache(lambda: _net(rules, forks, axes.line))
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
        left_open: list[IntArray] = []
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
                rule[whole], is_open = _run_down(net, lines)
                left_open.append(whole[is_open])
                pays, size = bool(is_open.sum() <= _CROWD * len(whole)), _CHUNK
                if not pays:
                    break
        many = np.concatenate([*left_open, np.arange(min(stop, count), count)])
        if len(many):
            outcome = fired(array.take(many, axis=1))
            rule[many], status[many] = outcome.rule, outcome.status
        return Outcome(rule, status)

    return run


def forks_of(rules: RuleBase) -> list[PrefixNode]:
    """Return the tree of the rules' beginnings; the first fork is the empty one."""
    forks = [PrefixNode()]
    known: dict[tuple[int, Proposition], int] = {}
    for number, rule in enumerate(rules.rules, 1):
        here = 0
        for proposition in rule.when:
            key = (here, proposition)
            if key not in known:
                known[key] = len(forks)
                forks[here].propositions.append(proposition)
                forks[here].targets.append(len(forks))
                forks.append(PrefixNode())
            here = known[key]
        forks[here].rules.append(number)
    return forks


def splits_of(
    rules: RuleBase, forks: Sequence[PrefixNode], line: dict[str, int]
) -> list[AxisSplit] | None:
    """Return the forks as splits if the plateaus of each divide its axis, or None."""
    shapes = shapes_of(rules.variables)
    inner = [number for number, fork in enumerate(forks) if fork.propositions]
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
        splits.append(AxisSplit(line[fork.propositions[0].variable], cuts, targets))
    return splits


def _plateaus(
    fork: PrefixNode, shapes: dict[tuple[str, str], Shape]
) -> list[tuple[float | None, int]] | None:
    """Return where each plateau ends and which fork it leads to.

    None if they do not follow one another from end to end of one axis.
    """
    result: list[tuple[float, float | None, int]] = []
    for proposition, target in zip(fork.propositions, fork.targets, strict=True):
        if proposition.negated or proposition.variable != fork.propositions[0].variable:
            return None
        for term in proposition.terms:
            ends = _plateau(shapes[proposition.variable, term])
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


def _net(rules: RuleBase, forks: Sequence[PrefixNode], at_line: dict[str, int]) -> Net:
    """Return the forks as arrays; rules that end at no leaf get a branch."""
    ends = [list(fork.rules) for fork in forks]
    branches = [list(zip(f.propositions, f.targets, strict=True)) for f in forks]
    for fork in range(len(forks)):
        if fork == 0 or branches[fork] or len(ends[fork]) > 1:
            for rule in ends[fork]:
                branches[fork].append((_ALWAYS, len(branches)))
                branches.append([])
                ends.append([rule])
            ends[fork] = []
    flat = [branch for part in branches for branch in part]
    propositions = list(dict.fromkeys(proposition for proposition, _ in flat))
    number = {
        proposition: position for position, proposition in enumerate(propositions)
    }
    envelope = plan_envelope(rules, propositions, at_line)
    count = np.array([len(part) for part in branches], np.int64)
    place = np.array([number[proposition] for proposition, _ in flat], np.int64)
    return Net(
        np.cumsum(count) - count,
        count,
        np.array([part[0] if part else 0 for part in ends], np.int64),
        np.array([target for _, target in flat], np.int64),
        envelope.line.take(place),
        place * envelope.grid.count,
        envelope,
        rules.semantics.conjunction == "product",
    )


def _run_down(net: Net, lines: FloatArray) -> tuple[IntArray, BoolArray]:
    """Follow each row's best branches to a rule; no value is missing.

    Returns:
        The rule, and whether another one may be as strong.
    """
    join = np.multiply if net.is_product else np.minimum
    upper, lower = net.envelope.upper, net.envelope.lower
    cells = cells_of(net.envelope.grid, lines)
    rule, is_open = np.zeros(lines.shape[1], np.int64), np.ones(lines.shape[1], bool)
    row, fork = np.arange(len(rule)), np.zeros(len(rule), np.int64)
    low, high, rival = np.ones(len(rule)), np.ones(len(rule)), np.zeros(len(rule))
    while len(row):
        first, last = net.first.take(fork), net.count.take(fork) - 1
        branch, entry = first, cells[net.line.take(first), row] + net.entry.take(first)
        best = upper.take(entry)
        for position in range(1, int(last.max()) + 1):
            other = first + np.minimum(last, position)
            cell = cells[net.line.take(other), row] + net.entry.take(other)
            bound = np.where(last < position, 0.0, upper.take(cell))
            is_better = bound > best
            beaten = join(high, np.minimum(best, bound))
            rival = np.maximum(rival, beaten)
            best = np.maximum(best, bound)
            branch = np.where(is_better, other, branch)
            entry = np.where(is_better, cell, entry)
        low, high = join(low, lower.take(entry)), join(high, best)
        fork = net.target.take(branch)
        ended = net.rule.take(fork)
        done = np.flatnonzero(ended)
        rule[row.take(done)] = ended.take(done)
        is_open[row.take(done)] = rival.take(done) >= low.take(done)
        stay = np.flatnonzero(ended == 0)
        row, fork = row.take(stay), fork.take(stay)
        low, high, rival = low.take(stay), high.take(stay), rival.take(stay)
    return rule, is_open
