"""What rows say about rules, and which share of the domain something takes.

Every answer to a row is the exact one (`fuzzytree.numerics.oracle.decide`): only which
rows there are is left to chance, and the interval says how much that may change.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from statistics import NormalDist
from typing import Final, NamedTuple

import numpy as np

from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import Declined, Sampled
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, FactValue, Measure
from fuzzytree.auditing.findings.subject import AuditRows, Subject
from fuzzytree.model import (
    BoolArray,
    FloatArray,
    IntArray,
    Proposition,
    RuleBase,
    shapes_of,
)
from fuzzytree.numerics import (
    MISSING,
    UNCOVERED,
    Decisions,
    Enclosure,
    axis_value,
    decide,
    degree_enclosure,
    exact_answer,
    exact_axis,
    outwards,
    proposition_enclosure,
)

CONFIDENCE: Final = 0.95  # of every interval
_NEAR = 1e-12  # doubles that are so near are compared in fractions
_STEP = 4096  # rows between two looks at the clock
_MOST_DEGREES = 1 << 24  # of all propositions at points that are drawn
_LEAST_ROWS = 1000  # that are drawn however many propositions there are


def wilson(hits: int, rows: int) -> tuple[float, float]:
    """Return Wilson's score interval of a share, of at least 1 row.

    With z the quantile of the normal distribution and p = hits / rows its ends are
    `(p + z^2 / 2n -+ z sqrt(p (1 - p) / n + z^2 / 4n^2)) / (1 + z^2 / n)`
    (E. B. Wilson, 1927).

    Example:
        >>> [round(end, 4) for end in wilson(0, 20)]
        [0.0, 0.1611]
    """
    z = NormalDist().inv_cdf((1.0 + CONFIDENCE) / 2.0)
    p, bottom = hits / rows, 1.0 + z * z / rows
    middle = (p + z * z / (2.0 * rows)) / bottom
    root = math.sqrt(p * (1.0 - p) / rows + z * z / (4.0 * rows * rows))
    half = z * root / bottom
    low = 0.0 if hits == 0 else max(middle - half, 0.0)
    return low, 1.0 if hits == rows else min(middle + half, 1.0)


def share_in_sample(of: str, hits: int, rows: int, how: str) -> Sampled:
    """Return a share that was counted in a sample, with its interval."""
    return Sampled(of, hits, rows, *wilson(hits, rows), CONFIDENCE, how)


def sample_points(rules: RuleBase, domain: Domain, rows: int, seed: int) -> FloatArray:
    """Return points drawn evenly from a domain, of shape (inputs, points).

    They are fewer than `rows`, perhaps none, where the domain limits combinations.
    """
    chance = np.random.default_rng(seed)
    sides = {side.variable: side for side in domain.sides}
    columns = [values_at(sides[name], chance.random(rows)) for name in rules.inputs]
    table = np.array(columns).reshape(len(rules.inputs), rows)
    return table[:, ~rows_outside(rules, domain, table)]


def values_at(side: DomainSide, shares: FloatArray) -> FloatArray:
    """Return values of rows, spread evenly as shares from 0 to 1 are.

    Example:
        >>> from fuzzytree.auditing.decide.domain import DomainSide
        >>> doors = DomainSide("doors", 1.0, 4.0, is_whole=True)
        >>> values_at(doors, np.array([0.0, 0.3, 0.99])).tolist()
        [1.0, 2.0, 4.0]
    """
    if side.values:
        values = np.array(side.points)
        return np.asarray(values[(shares * len(values)).astype(np.int64)])
    if side.is_whole:
        return side.low + np.floor(shares * (side.high - side.low + 1.0))
    return np.clip(side.low * (1.0 - shares) + side.high * shares, side.low, side.high)


def rows_outside(rules: RuleBase, domain: Domain, values: FloatArray) -> BoolArray:
    """Return which rows have a finite value beyond a side; combinations exactly."""
    beyond: BoolArray = np.zeros(values.shape[1], np.bool_)
    is_finite = np.isfinite(values).all(axis=0)
    for variable in rules.variables:
        side = domain.side(variable.name)
        if side is None:
            continue
        if not variable.parts:
            x = values[rules.inputs.index(variable.name)]
            is_own = ~((x < side.low) | (x > side.high))
            if side.values:
                is_own &= np.isin(x, side.values) | ~np.isfinite(x)
            if side.is_whole:
                is_own &= ~(np.floor(x) < x)
            if side.missing is not None:
                is_own |= x == side.missing
            beyond |= ~is_own
            continue
        for row in np.flatnonzero(is_finite & ~beyond).tolist():
            named = dict(zip(rules.inputs, values[:, row].tolist(), strict=True))
            beyond[row] = not side.low <= exact_axis(variable, named) <= side.high
    return beyond


class RuleCounts(NamedTuple):
    """What the rules say about some rows.

    Attributes:
        rows: How many there are; on how many a value is `missing`, or `outside` of the
            domain; of those without a missing value: how many are `known`, on how many
            no rule fires (`uncovered`) or reaches epsilon (`weak`), and on how many the
            strongest classes tie (`tied`) or differ by at most the margin (`close`).
        fired, won, right: On how many known rows each rule fires; how many it wins, as
            the first of the strongest; how many of those have its class.
    """

    rows: Counter[str]
    fired: IntArray
    won: IntArray | None = None
    right: IntArray | None = None


def _row_counts(
    outside: BoolArray, complete: BoolArray, **others: BoolArray
) -> Counter[str]:
    masks = {"all": complete | True, "known": complete}
    masks |= {"outside": outside, "missing": ~complete}
    masks |= {name: complete & mask for name, mask in others.items()}
    return Counter({name: int(mask.sum()) for name, mask in masks.items()})


def count_rows(
    subject: Subject, values: FloatArray, codes: IntArray | None = None
) -> RuleCounts:
    """Count what rules say of which the strongest decides, of (inputs, rows)."""
    rules, settings, rows = subject.rules, subject.settings, Counter[str]()
    count = len(rules.rules)
    fired, won, right = (np.zeros(count, np.int64) for _ in range(3))
    owner = np.array([rules.classes.index(rule.then) for rule in rules.rules])
    for start in range(0, values.shape[1], _STEP):
        subject.budget.check()
        part = values[:, start : start + _STEP]
        decisions = decide(rules, part)
        fires, is_weak, margin = _exact_parts(subject, part, decisions)
        is_known = decisions.status != MISSING
        is_covered = decisions.status != UNCOVERED
        fired += (fires & is_known).sum(axis=1)
        won += np.bincount(decisions.rule, minlength=count + 1)[1:]
        if codes is not None:
            is_won = decisions.rule > 0
            own = decisions.rule[is_won] - 1
            is_right = codes[start : start + _STEP][is_won] == owner[own]
            right += np.bincount(own[is_right], minlength=count)
        rows += _row_counts(
            rows_outside(rules, subject.domain, part),
            is_known,
            uncovered=~is_covered,
            weak=is_weak,
            tied=is_covered & (margin == 0.0),
            close=is_covered & (margin <= settings.margin),
        )
    return RuleCounts(rows, fired, won, None if codes is None else right)


def _exact_parts(
    subject: Subject, values: FloatArray, decisions: Decisions
) -> tuple[BoolArray, BoolArray, FloatArray]:
    """Settle by fractions what the doubts of some answers leave open.

    Returns:
        Shape (rules, rows): whether a rule is above 0. Shape (rows,): whether all of
        them are below epsilon. Shape (rows,): a margin that is 0 only where the exact
        one is, and on the same side of the settings' margin.
    """
    rules, settings = subject.rules, subject.settings
    assert decisions.strengths is not None  # the default
    best = decisions.strengths.max(axis=0)
    fires, may_fire = _fire_bounds(rules, values)
    is_weak = best < settings.epsilon
    margin = decisions.margin.copy()
    is_open = (fires != may_fire).any(axis=0)
    is_open |= np.abs(best - settings.epsilon) <= decisions.doubt
    for limit in (0.0, settings.margin):
        is_open |= (decisions.margin <= limit) & (decisions.margin_high > limit)
    is_open &= decisions.status != MISSING
    for row in np.flatnonzero(is_open).tolist():
        subject.budget.check()
        named = dict(zip(rules.inputs, values[:, row].tolist(), strict=True))
        answer = exact_answer(rules, named)
        fires[:, row] = [strength > 0 for strength in answer.strengths]
        is_weak[row] = max(answer.strengths) < Fraction(settings.epsilon)
        low, high = outwards(answer.margin)
        is_within = answer.margin <= Fraction(settings.margin)
        margin[row] = low if is_within and (low or not answer.margin) else high
    return fires, is_weak, margin


def _fire_bounds(rules: RuleBase, values: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return which rules are above 0 for sure, and which may be."""
    named = dict(zip(rules.inputs, values, strict=True))
    shapes = shapes_of(rules.variables)
    bounds: dict[Proposition, Enclosure] = {}
    fires: BoolArray = np.ones((len(rules.rules), values.shape[1]), np.bool_)
    may_fire = fires.copy()
    with np.errstate(all="ignore"):
        axes = {v.name: axis_value(v, named) for v in rules.variables}
        for position, rule in enumerate(rules.rules):
            for proposition in rule.when:
                if proposition not in bounds:
                    name = proposition.variable
                    curves = [shapes[name, term] for term in proposition.terms]
                    degrees = [degree_enclosure(curve, axes[name]) for curve in curves]
                    bounds[proposition] = proposition_enclosure(proposition, degrees)
                fires[position] &= bounds[proposition].low > 0.0
                may_fire[position] &= bounds[proposition].high > 0.0
    return fires, may_fire


def _system_counts(
    subject: Subject, values: FloatArray, *, is_each: bool
) -> tuple[RuleCounts, RuleCounts]:
    """Count on which rows conditions of a system hold, at least and at most.

    Where doubles leave it open, or lines around curves end, a row is evaluated exactly.
    """
    base, level = subject.base.fine, subject.settings.epsilon
    outside = rows_outside(subject.rules, subject.domain, values)
    complete = np.asarray(~np.isnan(values).any(axis=0), np.bool_)
    columns = dict(zip(subject.rules.inputs, values, strict=True))
    sides = [base.in_doubles(columns, is_upper=is_upper) for is_upper in (False, True)]
    is_open = outside & np.isfinite(values).all(axis=0)
    low, high = (side if is_each else side.max(axis=0)[None] for side in sides)
    is_near = (low <= 0.0) & (high > 0.0)
    is_near |= (low <= level + _NEAR) & (high >= level - _NEAR)
    is_open |= complete & is_near.any(axis=0)
    for row in np.flatnonzero(is_open).tolist():
        subject.budget.check()
        point = {name: Fraction(float(x[row])) for name, x in columns.items()}
        for side, exact in zip(sides, base.strengths(point), strict=True):
            side[:, row] = [_on_side(strength, level) for strength in exact]
    results: list[RuleCounts] = []
    for side in sides:
        best, fired = side.max(axis=0), ((side > 0.0) & complete).sum(axis=1)
        rows = _row_counts(outside, complete, uncovered=best <= 0.0, weak=best < level)
        results.append(RuleCounts(rows, fired))
    return results[0], results[1]


def _on_side(strength: Fraction, limit: float) -> float:
    """Return a strength as a double, on its side of a limit."""
    near = float(strength)
    is_below = strength < Fraction(limit) <= near
    return math.nextafter(near, -math.inf) if is_below else near


# --- answers


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Count what the rows show about each rule, and estimate shares of the domain."""
    if subject.rows is None:
        reason = "rows are needed (--data TABLE)"
        yield audit_answer("FT701.needs-rows", "rows", Declined("FTD06", reason))
    else:
        yield from _of_rows(subject, subject.rows)
    yield from _of_domain(subject)


def _of_rows(subject: Subject, rows: AuditRows) -> Iterator[AuditAnswer]:
    """Yield what the user's rows say, of all rules together and of each."""
    codes = None if subject.system else rows.codes  # a view has classes of its own
    lower, most = _counts(subject, rows.values, codes, is_each=True)
    counts, how = lower.rows, f"every row of {rows.name}"
    for word, name in (
        ("missing", "rows with a missing value"),
        ("outside", "rows outside the domain"),
    ):
        state = share_in_sample(name, counts[word], counts["all"], how)
        is_finding = counts[word] > 0
        yield audit_answer(f"FT701.{word}", name, state, is_finding=is_finding)
    if not counts["known"]:
        return
    if counts["missing"]:
        how += " without a missing value"
    yield from _shares(subject, (lower, most), "rows", how)
    for number in range(1, len(subject.rules.rules) + 1):
        least, fired = (int(of.fired[number - 1]) for of in (lower, most))
        if fired == least:
            yield _of_rule(subject, lower, number, how)
            continue
        total = counts["known"]
        why = f"it fires on {least} of {total} at least, and on {fired} at most"
        declined, name = Declined("FTD02", why), subject.rule_name(number)
        yield audit_answer("FT701.rule-open", name, declined)


def _of_domain(subject: Subject) -> Iterator[AuditAnswer]:
    """Yield which shares of the domain's volume are uncovered, weak, tied, close."""
    settings = subject.settings
    propositions = sum(len(rule.when) for rule in subject.rules.rules)
    rows = min(settings.rows, max(_MOST_DEGREES // max(propositions, 1), _LEAST_ROWS))
    points = sample_points(subject.rules, subject.domain, rows, settings.seed)
    if not points.shape[1]:
        reason = "no drawn point lies within the sides of the combinations"
        yield audit_answer("FT701.no-points", "domain", Declined("FTD04", reason))
        return
    lower, most = _counts(subject, points)
    how = f"points drawn evenly from the domain, seed {settings.seed}"
    if lower.rows["known"]:  # a combination may overflow everywhere
        yield from _shares(subject, (lower, most), "points", how)


def _counts(
    subject: Subject,
    values: FloatArray,
    codes: IntArray | None = None,
    *,
    is_each: bool = False,
) -> tuple[RuleCounts, RuleCounts]:
    """Count what the rules say from below, and from above; perhaps each of them."""
    if subject.policy.decision == "all":
        return _system_counts(subject, values, is_each=is_each)
    counts = count_rows(subject, values, codes)
    return counts, counts


def _shares(
    subject: Subject, counts: tuple[RuleCounts, RuleCounts], noun: str, how: str
) -> Iterator[AuditAnswer]:
    """Yield in which share of some rows or points the rules are weak or undecided."""
    (lower, *_), (most, *_) = counts
    settings, total, names = subject.settings, lower["known"], list[str]()
    for name in ("uncovered", "weak") if subject.is_whole else ():
        hits, fewest = lower[name], most[name]
        if fewest >= hits:
            names.append(name)
        else:
            reason = f"there are {fewest} at least, and {hits} at most"
            state = Declined("FTD02", reason)
            yield audit_answer("FT701.not-known", f"{name} {noun}", state)
    if not subject.is_whole:
        reason = "rules are left out, and they may cover what the others do not"
        state = Declined("FTD07", reason)
        yield audit_answer("FT701.not-known", f"covered {noun}", state)
    if subject.policy.decision == "strongest":
        names += ["tied", "close"]
    limits = {"epsilon": settings.epsilon, "margin": settings.margin}
    for name in names:
        hits = lower[name]
        yield audit_answer(
            f"FT701.{name}",
            f"{name} {noun}",
            share_in_sample(f"{name} {noun}", hits, total, how),
            is_finding=hits > 0 and noun == "rows",
            facts={"noun": noun, **limits},
        )


def _of_rule(
    subject: Subject, counts: RuleCounts, number: int, how: str
) -> AuditAnswer:
    """Return on how many rows a rule fires, how many it wins, and how many rightly."""
    name, total = subject.rule_name(number), counts.rows["known"]
    fired = int(counts.fired[number - 1])
    facts: dict[str, FactValue] = {"known": total}
    measures = [Measure("rows fired", fired)]
    state = share_in_sample(f"rows on which {name} fires", fired, total, how)
    is_finding = not fired
    if counts.won is not None:
        won = int(counts.won[number - 1])
        is_finding = not won
        measures.append(Measure("rows won", won))
        state = share_in_sample(f"rows that {name} wins", won, total, how)
        if counts.right is not None and won:
            right = int(counts.right[number - 1])
            measures.append(Measure("rows won rightly", right))
            of = f"rows that {name} wins and that have its class"
            state = share_in_sample(of, right, won, f"of {how}, those that it wins")
            facts["then"] = subject.rules.rules[number - 1].then
    return audit_answer(
        "FT701.rule",
        name,
        state,
        *measures,
        facts=facts,
        is_finding=is_finding,
        rules=(number,),
    )
