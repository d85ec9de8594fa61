"""Which rules may win on a box: bounds of their strengths, and which beat which.

A rule is *beaten* on a box if another one is preferred to it wherever it fires there:
certainly stronger, or as strong and before it. At a point this is an order of the
rules, so the winner is never beaten.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from fuzzytree.auditing.engine.stretches import (
    ALWAYS,
    NEVER,
    Axis,
    Numbered,
    Seen,
    Stretch,
)
from fuzzytree.model.interrupts import checkpoint
from fuzzytree.model.rulebase import Conjunction, RuleBase

Box = tuple[Stretch, ...]
"""A stretch of each axis."""

_MOST_PAIRED = 12  # rules that may win, of which each two are compared


class Contender(NamedTuple):
    """A rule on a box.

    Attributes:
        then: Its class.
        form: The forms of its clauses that say something; rules of equal forms are
            equally strong at every point of the box.
        clauses: These clauses.
        bounds: The least and the largest degree of each.
        low: At most its strength.
        high: At least its strength.
        is_below: Whether its strength is below `high` at every point.
        place: Where it stands among the rules.
    """

    then: str
    form: tuple[Numbered, ...]
    clauses: tuple[Numbered, ...]
    bounds: Mapping[Numbered, tuple[float, float]]
    low: float
    high: float
    is_below: bool
    place: int


class Left(NamedTuple):
    """What is left of a rule base on a box.

    Attributes:
        rules: Those that may win, in order.
        is_sure: Whether some rule fires at every point.
        margin: At least the largest margin of the strongest class.
    """

    rules: list[Contender]
    is_sure: bool
    margin: float


def left_on(
    rules: RuleBase,
    asked: Sequence[tuple[Numbered, ...]],
    axes: Sequence[Axis],
    box: Box,
    among: Iterable[int] | None = None,
) -> Left:
    """Return which rules may win on a box.

    Args:
        rules: The rules.
        asked: The clauses of each of them; see
            `fuzzytree.auditing.engine.stretches.laid`.
        axes: The axes.
        box: A stretch of each.
        among: The places of the rules that may win on a box around this one, in order;
            all unless given.
    """
    conjunction = rules.semantics.conjunction
    seen = [axis.seen(s) for axis, s in zip(axes, box, strict=True)]
    made: list[Contender] = []
    for place in range(len(asked)) if among is None else among:
        checkpoint()
        then = rules.rules[place].then
        found = _on_box(then, asked[place], seen, conjunction, place)
        if found is not None and found.high > 0.0:
            made.append(found)
    top = max((rule.low for rule in made), default=0.0)
    first = next((rule.place for rule in made if rule.low == top), 0)
    may_win = [
        rule
        for rule in made
        if rule.high > top
        or (rule.high == top and rule.place <= first and not rule.is_below)
    ]
    if len(may_win) <= _MOST_PAIRED:
        may_win = [
            rule
            for rule in may_win
            if not any(
                _beats(other, rule, axes, box, conjunction)
                for other in may_win
                if other is not rule
            )
        ]
    else:
        may_win = _first_of_equals(may_win)
    margin = _margin(made)
    if len(may_win) <= _MOST_PAIRED:
        margin = min(margin, _paired_margin(may_win, conjunction))
    return Left(may_win, top > 0.0, margin)


def _on_box(
    then: str,
    clauses: tuple[Numbered, ...],
    seen: Sequence[Sequence[Seen]],
    conjunction: Conjunction,
    place: int,
) -> Contender | None:
    """Return a rule on a box, None if it never fires there."""
    form: list[Numbered] = []
    kept: list[Numbered] = []
    bounds: dict[Numbered, tuple[float, float]] = {}
    short: list[float] = []
    for axis, number in clauses:
        kind, low, high, is_short = seen[axis][number]
        if kind == NEVER:
            return None
        if kind == ALWAYS or (conjunction == "min" and (axis, kind) in form):
            continue
        form.append((axis, kind))
        kept.append((axis, number))
        bounds[axis, number] = (low, high)
        short.append(high if is_short else 2.0)
    lows = [bounds[clause][0] for clause in kept]
    highs = [bounds[clause][1] for clause in kept]
    high = _joined(highs, conjunction, up=True)
    return Contender(
        then,
        tuple(form),
        tuple(kept),
        bounds,
        _joined(lows, conjunction, up=False),
        high,
        high in short,
        place,
    )


def _joined(degrees: Sequence[float], conjunction: Conjunction, *, up: bool) -> float:
    """Return a bound of a strength; each product is moved outwards by its rounding."""
    lowest = min(degrees, default=1.0)
    if conjunction == "min" or len(degrees) < 2:
        return lowest
    found = 1.0
    for degree in degrees:
        found = math.nextafter(found * degree, math.inf if up else -math.inf)
    return min(found, lowest) if up else max(found, 0.0)


def _beats(
    one: Contender,
    other: Contender,
    axes: Sequence[Axis],
    box: Box,
    conjunction: Conjunction,
) -> bool:
    """Return whether one rule is preferred to another wherever that one fires.

    Clauses that both have cancel. Of two rules at most one is found to beat the
    other, so the winner at a point is never left out.
    """
    if conjunction == "product" and not (_is_plain(one) and _is_plain(other)):
        return False
    mine, theirs, shared = _split(one, other)
    common = min((one.bounds[c][1] for c in shared), default=1.0)
    least = _joined([one.bounds[c][0] for c in mine], conjunction, up=False)
    most = _joined([other.bounds[c][1] for c in theirs], conjunction, up=True)
    if one.place < other.place:
        if conjunction == "min":
            most = min(most, common)
        return least >= most or _is_above(mine, theirs, axes, box, conjunction)
    floor = min((one.bounds[c][0] for c in shared), default=1.0)
    return least > most and (conjunction == "product" or floor > most)


def _is_above(
    mine: Sequence[Numbered],
    theirs: Sequence[Numbered],
    axes: Sequence[Axis],
    box: Box,
    conjunction: Conjunction,
) -> bool:
    """Return whether each of some clauses has one of others below it."""
    checkpoint()
    free = list(theirs)
    for axis, clause in mine:
        below = next(
            (
                (place, number)
                for place, number in free
                if place == axis and axes[axis].is_above(clause, number, box[axis])
            ),
            None,
        )
        if below is None:
            return False
        if conjunction == "product":
            free.remove(below)
    return True


def _is_plain(rule: Contender) -> bool:
    """Return whether no two clauses of a rule have one form."""
    return len({*rule.form}) == len(rule.form)


def _split(
    one: Contender, other: Contender
) -> tuple[list[Numbered], list[Numbered], list[Numbered]]:
    """Return the clauses of one rule alone, of the other alone, and of both."""
    mine = dict(zip(one.form, one.clauses, strict=True))
    theirs = dict(zip(other.form, other.clauses, strict=True))
    return (
        [c for f, c in mine.items() if f not in theirs],
        [c for f, c in theirs.items() if f not in mine],
        [c for f, c in mine.items() if f in theirs],
    )


def _paired_margin(rules: Sequence[Contender], conjunction: Conjunction) -> float:
    """Return at least the largest margin, by the rules that may win taken in pairs."""
    return max(
        (
            min(
                (_gap(one, q, conjunction) for q in rules if q.then != one.then),
                default=one.high,
            )
            for one in rules
        ),
        default=0.0,
    )


def _gap(one: Contender, other: Contender, conjunction: Conjunction) -> float:
    """Return at least how much stronger one rule is than another.

    What both share is at most 1 under the product, and under the minimum it brings
    no two numbers further apart; so it can be left out.
    """
    if not (_is_plain(one) and _is_plain(other)):
        return max(one.high - other.low, 0.0)
    mine, theirs, _ = _split(one, other)
    most = _joined([one.bounds[c][1] for c in mine], conjunction, up=True)
    least = _joined([other.bounds[c][0] for c in theirs], conjunction, up=False)
    return max(math.nextafter(min(most - least, one.high - other.low), math.inf), 0.0)


def _first_of_equals(rules: Sequence[Contender]) -> list[Contender]:
    """Return rules without those that are as strong as an earlier one everywhere."""
    kept: dict[object, Contender] = {}
    for rule in rules:
        kept.setdefault(tuple(sorted(rule.form)), rule)
    return list(kept.values())


def _margin(rules: Sequence[Contender]) -> float:
    """Return at least the largest margin of the strongest class on a box."""
    low: dict[str, float] = {}
    high: dict[str, float] = {}
    for rule in rules:
        low[rule.then] = max(low.get(rule.then, 0.0), rule.low)
        high[rule.then] = max(high.get(rule.then, 0.0), rule.high)
    return max(
        (
            most - max((low[other] for other in low if other != label), default=0.0)
            for label, most in high.items()
        ),
        default=0.0,
    )


def same(one: Left, other: Left, conjunctions: Sequence[Conjunction]) -> bool:
    """Return whether the same rules are left of both, in an order that says the same.

    The order of neighbours of one class says nothing.
    """
    first, second = (
        [
            (then, frozenset(_strength(rule, conjunction) for rule in run))
            for then, run in itertools.groupby(left.rules, lambda rule: rule.then)
        ]
        for left, conjunction in zip((one, other), conjunctions, strict=True)
    )
    return first == second


def _strength(rule: Contender, conjunction: Conjunction) -> object:
    """Return what is equal for rules of equal strength at every point of a box."""
    if len(rule.form) < 2:
        return rule.form
    return conjunction, tuple(sorted(rule.form))
