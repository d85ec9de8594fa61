"""The exact answers of a model, for one row or for many.

`exact_answer` computes one row in fractions. `decide` first encloses every strength of
every row in an interval (`fuzzytree.numerics.enclosures`, where the proof is) and gives
to fractions what the intervals leave open:

- The strongest rules are among those whose upper end reaches the largest lower end. If
  there is one, it wins. If all intervals there are points, the first of them wins.
- No rule fires if all upper ends are 0, and some rule does if a lower end is above 0.
- Under the minimum, rules of a tree often tie because they share their weakest
  proposition. Where all the strongest have the same term as their weakest, for sure,
  they are equal in exact arithmetic too, whatever its degree above 0 is.
- A tree takes the same path exactly as in doubles wherever no value that a node tests
  is as close to one of its cuts as its slack.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

import msgspec
import numpy as np

from fuzzytree.model import (
    BoolArray,
    FloatArray,
    IntArray,
    Model,
    Proposition,
)
from fuzzytree.numerics.enclosures import (
    EnclosedValue,
    Enclosure,
    U,
    axis_value,
    degree_enclosure,
    filled_values,
    proposition_enclosure,
    strength_enclosure,
)
from fuzzytree.numerics.exact import (
    CAP,
    DECIDED,
    MISSING,
    TIE,
    UNCOVERED,
    Exact,
    exact_answer,
    exact_axis,
    exact_degree,
    outwards,
)

__all__ = [
    "CAP",
    "DECIDED",
    "MISSING",
    "SHARPENED",
    "TIE",
    "UNCOVERED",
    "Decisions",
    "Exact",
    "decide",
    "exact_answer",
    "exact_axis",
    "exact_degree",
    "outwards",
    "strength_errors",
]

_NUMBERS = 1 << 21  # of a chunk's intervals: 32 MB for both ends
_FEWEST, _MOST = 64, 1 << 13  # rows of a chunk


class Decisions(msgspec.Struct, frozen=True):
    """The exact answers to many rows.

    Attributes:
        rule: The number of the winning rule or leaf of each row, from 1; 0 for none.
        label: The number of its class; -1 for no class.
        status: `DECIDED`, `TIE`, `UNCOVERED` or `MISSING`.
        strengths: Shape (rules, rows): doubles near the exact strengths; NaN in rows
            with missing values. None for a tree, or if not computed.
        doubt: At most so far is any strength of a row from the exact one.
        margin: At least so far the strongest class is ahead of the next (see `Exact`).
        margin_high: At most so far.
        by_fractions: How many rows needed fractions.
        fractions: Exact strengths of rows by their number, kept once they are needed.
    """

    rule: IntArray
    label: IntArray
    status: IntArray
    strengths: FloatArray | None
    doubt: FloatArray
    margin: FloatArray
    margin_high: FloatArray
    by_fractions: int
    fractions: dict[int, tuple[Fraction, ...]] = {}


def decide(
    model: Model, values: FloatArray, *, with_strengths: bool = True
) -> Decisions:
    """Return the exact answer to each row: what is left open is settled by fractions.

    Args:
        model: A rule base or a tree.
        values: Shape (inputs, rows), in the order of the model's inputs.
        with_strengths: Whether to keep the strengths, which take most of the memory.

    Raises:
        ValueError: If the values have another shape.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> found = decide(rules_from_tree(random_tree(0)), np.zeros((4, 2)))
        >>> found.rule.tolist(), found.by_fractions
        ([1, 1], 0)
    """
    width = len(model.inputs)
    if values.ndim != 2 or values.shape[0] != width:
        raise ValueError(f"values must have shape ({width}, rows), not {values.shape}")
    parts: list[Decisions] = []
    for part in _chunks(model, values.shape[1]):
        if model.rules:
            found = _decide_rules(model, values[:, part])
            if not with_strengths:
                found = msgspec.structs.replace(found, strengths=None)
        else:
            found = _decide_tree(model, values[:, part])
        parts.append(found)
    return _concatenated(parts)


def _chunks(model: Model, rows: int) -> Iterator[slice]:
    """Yield parts of the rows, at least one, that need a bounded memory each."""
    size = len(model.variables) + 1
    propositions = {proposition for rule in model.rules for proposition in rule.when}
    size += len(model.rules) + sum(
        len(proposition.terms) + 1 for proposition in propositions
    )
    step = min(max(_NUMBERS // size, _FEWEST), _MOST)
    for start in range(0, max(rows, 1), step):
        yield slice(start, start + step)


def _concatenated(parts: Sequence[Decisions]) -> Decisions:
    strengths = [part.strengths for part in parts if part.strengths is not None]
    return Decisions(
        np.concatenate([part.rule for part in parts]),
        np.concatenate([part.label for part in parts]),
        np.concatenate([part.status for part in parts]),
        np.hstack(strengths) if strengths else None,
        np.concatenate([part.doubt for part in parts]),
        np.concatenate([part.margin for part in parts]),
        np.concatenate([part.margin_high for part in parts]),
        sum(part.by_fractions for part in parts),
    )


# --- rules


class _Enclosed(msgspec.Struct, frozen=True):
    """Rows in intervals: degrees of terms and propositions, strengths of rules."""

    missing: BoolArray
    terms: dict[tuple[str, str], Enclosure]
    propositions: dict[Proposition, Enclosure]
    rules: Enclosure


def _decide_rules(rules: Model, values: FloatArray) -> Decisions:
    with np.errstate(all="ignore"):
        enclosed = _enclosed(rules, values)
        low, high = enclosed.rules
        best = low.max(axis=0)
        contends = high >= best
        is_tie = contends.sum(axis=0) > 1
        is_bare = high.max(axis=0) == 0.0
        is_open = ~is_bare & (is_tie | (best == 0.0)) & ~enclosed.missing
        is_open &= (contends & (low < high)).any(axis=0)
        is_shared = _share_weakest(rules, enclosed, contends, is_open & (best > 0.0))
        is_open &= ~is_shared
        rule = np.where(is_bare, 0, contends.argmax(axis=0) + 1)
        margin, margin_high = _margins(rules, low, high, rule)
        strengths = low + (high - low) * 0.5
        doubt = ((high - low) * 0.5 + U * (high > low)).max(axis=0)
    status = np.where(is_bare, UNCOVERED, np.where(is_tie, TIE, DECIDED))
    gone = enclosed.missing
    rule[gone], status[gone] = 0, MISSING
    strengths[:, gone], doubt[gone] = np.nan, 0.0
    margin[gone] = margin_high[gone] = 1.0
    rows = np.flatnonzero(is_open)
    for row in rows.tolist():
        named = dict(zip(rules.inputs, values[:, row].tolist(), strict=True))
        answer = exact_answer(rules, named)
        rule[row], status[row] = answer.rule, answer.status
        strengths[:, row] = [float(strength) for strength in answer.strengths]
        doubt[row] = U
        margin[row], margin_high[row] = outwards(answer.margin)
    label = _labels(rules, [r.then for r in rules.rules], rule, status)
    return Decisions(
        rule, label, status, strengths, doubt, margin, margin_high, len(rows)
    )


def _axes(
    model: Model, values: FloatArray
) -> tuple[dict[str, EnclosedValue], BoolArray]:
    """Return the value of each variable, and which rows miss one."""
    values = filled_values(model.variables, values)
    named = dict(zip(model.inputs, values, strict=True))
    axes = {v.name: axis_value(v, named) for v in model.variables}
    missing: BoolArray = np.zeros(values.shape[1], np.bool_)
    for value in axes.values():
        missing |= ~np.isfinite(value.x)
    return axes, missing


def _enclosed(rules: Model, values: FloatArray) -> _Enclosed:
    axes, missing = _axes(rules, values)
    shapes = {(v.name, t.name): t.shape for v in rules.variables for t in v.terms}
    propositions = dict.fromkeys(
        proposition for rule in rules.rules for proposition in rule.when
    )
    keys = dict.fromkeys((c.variable, term) for c in propositions for term in c.terms)
    terms = {key: degree_enclosure(shapes[key], axes[key[0]]) for key in keys}
    degrees = {
        c: proposition_enclosure(c, [terms[c.variable, term] for term in c.terms])
        for c in propositions
    }
    count = values.shape[1]
    low, high = (np.empty((len(rules.rules), count)) for _ in range(2))
    for position, found in enumerate(_strengths(rules, degrees, count)):
        low[position], high[position] = found
    return _Enclosed(missing, terms, degrees, Enclosure(low, high))


def _strengths(
    rules: Model, degrees: Mapping[Proposition, Enclosure], rows: int
) -> Iterator[Enclosure]:
    """Yield the strength of each rule; what it shares with the last one is kept."""
    is_product = rules.semantics.conjunction == "product"
    path: list[Proposition] = []
    stack = [Enclosure(np.ones(rows), np.ones(rows))]
    for rule in rules.rules:
        shared = 0
        for old, new in zip(path, rule.when, strict=False):
            if old != new:
                break
            shared += 1
        del stack[shared + 1 :]
        path = list(rule.when)
        for proposition in rule.when[shared:]:
            found = strength_enclosure(
                stack[-1], degrees[proposition], is_product=is_product
            )
            stack.append(found)
        yield stack[-1]


def _margins(
    rules: Model, low: FloatArray, high: FloatArray, rule: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return bounds of how far the winner's class is ahead of any other."""
    numbers = {label: number for number, label in enumerate(rules.classes)}
    owner = np.array([-1, *(numbers[r.then] for r in rules.rules)])
    count = low.shape[1]
    lows, highs = (np.zeros((len(rules.classes), count)) for _ in range(2))
    for position, number in enumerate(owner[1:]):
        np.maximum(lows[number], low[position], out=lows[number])
        np.maximum(highs[number], high[position], out=highs[number])
    winner, every = owner[rule], np.arange(count)
    best_low, best_high = lows[winner, every], highs[winner, every]
    lows[winner, every] = highs[winner, every] = 0.0
    next_low, next_high = lows.max(axis=0), highs.max(axis=0)
    is_tied = (next_high >= best_low) | (rule == 0)
    least = _difference(best_low, next_high, 0.0)
    most = _difference(best_high, next_low, 2.0)
    return np.where(is_tied, 0.0, least), np.where(is_tied, 0.0, most)


def _difference(a: FloatArray, b: FloatArray, towards: float) -> FloatArray:
    """Return a - b, moved towards a number unless it is exact."""
    found = a - b
    is_exact = (b == 0.0) | (a <= 2.0 * b)  # the latter by Sterbenz, for a >= b
    return np.where(is_exact, found, np.nextafter(found, towards))


def _share_weakest(
    rules: Model, enclosed: _Enclosed, contends: BoolArray, is_open: BoolArray
) -> BoolArray:
    """Return in which open rows all the strongest rules have one weakest term."""
    found = np.zeros_like(is_open)
    if rules.semantics.conjunction == "product" or not is_open.any():
        return found
    rows = np.flatnonzero(is_open)
    sources = _Sources(enclosed, rows)
    strongest = contends[:, rows]
    weakest = np.full(strongest.shape, -1)
    for position in np.flatnonzero(strongest.any(axis=1)).tolist():
        weakest[position] = sources.weakest(rules.rules[position].when)
    first = np.take_along_axis(weakest, strongest.argmax(axis=0)[np.newaxis], axis=0)
    is_same = (first >= 0) & ((weakest == first) | ~strongest).all(axis=0)
    found[rows] = is_same[0]
    return found


class _Sources:
    """Which term gives a proposition its degree, and a rule its strength, for sure."""

    def __init__(self, enclosed: _Enclosed, rows: IntArray) -> None:
        self.enclosed = enclosed
        self.rows = rows
        self.number = {key: 2 * k for k, key in enumerate(enclosed.terms)}
        start = 2 * len(self.number)
        self.joined = {
            proposition: start + k
            for k, proposition in enumerate(enclosed.propositions)
        }
        self.known: dict[Proposition, IntArray] = {}

    def weakest(self, when: Sequence[Proposition]) -> IntArray:
        """Return the source of the smallest degree; -1 if unsure."""
        if not when:
            return np.full(self.rows.shape, -1)
        low, high = self._ends(
            [self.enclosed.propositions[proposition] for proposition in when]
        )
        source = np.stack([self.of(proposition) for proposition in when])
        top, mine = self._at(high.argmin(axis=0), high, source)
        is_sure = ((low >= top) | (source == mine)).all(axis=0)
        return np.where(is_sure, mine, -1)

    def of(self, proposition: Proposition) -> IntArray:
        """Return the number of the largest of some terms, or of their proposition."""
        if proposition not in self.known:
            keys = [(proposition.variable, term) for term in proposition.terms]
            low, high = self._ends([self.enclosed.terms[key] for key in keys])
            numbers = np.array(
                [[self.number[key] + proposition.negated] for key in keys]
            )
            bottom, mine = self._at(low.argmax(axis=0), low, numbers + 0 * self.rows)
            is_sure = ((high <= bottom) | (numbers == mine)).all(axis=0)
            self.known[proposition] = np.where(is_sure, mine, self.joined[proposition])
        return self.known[proposition]

    def _ends(self, parts: Sequence[Enclosure]) -> tuple[FloatArray, FloatArray]:
        low = np.stack([part.low[self.rows] for part in parts])
        return low, np.stack([part.high[self.rows] for part in parts])

    def _at(
        self, place: IntArray, ends: FloatArray, sources: IntArray
    ) -> tuple[FloatArray, IntArray]:
        every = np.arange(len(self.rows))
        return ends[place, every], sources[place, every]


def _labels(
    model: Model, ends: Sequence[str], rule: IntArray, status: IntArray
) -> IntArray:
    numbers: dict[str | None, int] = {name: k for k, name in enumerate(model.classes)}
    numbers[None] = -1
    label = np.array([-1, *(numbers[end] for end in ends)])[rule]
    label[status == UNCOVERED] = numbers[model.semantics.uncovered]
    label[status == MISSING] = numbers[model.semantics.missing]
    return label


# --- trees


def _decide_tree(tree: Model, values: FloatArray) -> Decisions:
    with np.errstate(all="ignore"):
        axes, missing = _axes(tree, values)
        rule, is_open = _followed(tree, axes, missing)
    rows = np.flatnonzero(is_open)
    for row in rows.tolist():
        named = dict(zip(tree.inputs, values[:, row].tolist(), strict=True))
        rule[row] = exact_answer(tree, named).rule
    status = np.where(missing, MISSING, DECIDED)
    label = _labels(tree, [leaf.label for leaf in tree.leaves], rule, status)
    sure = np.ones(len(rule))
    return Decisions(rule, label, status, None, 0.0 * sure, sure, sure, len(rows))


def _followed(
    tree: Model, axes: Mapping[str, EnclosedValue], missing: BoolArray
) -> tuple[IntArray, BoolArray]:
    """Return each row's leaf by doubles, and where they may err on the way."""
    leaf = np.zeros(missing.shape, np.int64)
    is_open: BoolArray = np.zeros_like(missing)
    known = np.flatnonzero(~missing)
    if not tree.nodes:
        leaf[known] = 1
        return leaf, is_open
    waiting: dict[int, IntArray] = {1: known}
    for number, node in enumerate(tree.nodes, 1):  # a node stands before those below
        rows = waiting.pop(number)
        x, slack = axes[node.variable]
        interval = np.searchsorted(node.cuts, x[rows], side="left")
        if slack is not None:
            near, far = x[rows] - slack[rows], x[rows] + slack[rows]
            first = np.searchsorted(node.cuts, near, side="left")
            is_open[rows] |= first < np.searchsorted(node.cuts, far, side="right")
        taken = np.array(node.owners)[interval]
        for position, branch in enumerate(node.branches):
            here = rows[taken == position]
            if branch.node is not None:
                waiting[branch.node] = here
            else:
                leaf[here] = branch.leaf or 0
    return leaf, is_open


# --- strengths that somebody computed


SHARPENED = 64
"""The most rows that `strength_errors` computes in fractions."""

_MOST_DEGREES = 10_000  # that it computes so: a second or so; one row at least


def strength_errors(
    model: Model,
    values: FloatArray,
    strengths: FloatArray,
    known: dict[int, tuple[Fraction, ...]] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return how far given strengths are from the exact ones, in each row.

    Args:
        model: A rule base.
        values: Shape (inputs, rows).
        strengths: Shape (rules, rows); NaN where a value is missing.
        known: Exact strengths of rows by their number; those that are computed are
            added, such as `Decisions.fractions` of the same rows.

    Returns:
        A lower and an upper end of the largest distance in each row, by intervals. Rows
        of large upper ends are computed in fractions, so that their two ends are next
        to each other, until the largest of all is known to a hundredth, or `SHARPENED`
        rows are done, or fewer of models with more than 150 terms. A row that is
        missing on one side alone is 1 off.

    Raises:
        ValueError: If the values or the strengths have another shape.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> rules, values = rules_from_tree(random_tree(0)), np.zeros((4, 1))
        >>> given = decide(rules, values).strengths + 2.0**-30
        >>> low, high = strength_errors(rules, values, given)
        >>> bool(low[0] <= 2.0**-30 <= high[0] < 2.0**-29)
        True
    """
    expected = (len(model.rules), values.shape[-1])
    if strengths.shape != expected:
        raise ValueError(f"strengths must have shape {expected}, not {strengths.shape}")
    parts = [
        _errors(model, values[:, part], strengths[:, part])
        for part in _chunks(model, values.shape[1])
    ]
    low, high = (np.concatenate(ends) for ends in zip(*parts, strict=True))
    terms = sum(len(variable.terms) for variable in model.variables)
    most = min(SHARPENED, max(_MOST_DEGREES // max(terms, 1), 1))
    known = {} if known is None else known
    for row in np.argsort(-high, kind="stable")[:most].tolist():
        if high[row] <= 1.01 * low.max():
            break
        if row not in known:
            named = dict(zip(model.inputs, values[:, row].tolist(), strict=True))
            known[row] = exact_answer(model, named).strengths
        if known[row]:
            given = map(Fraction, strengths[:, row].tolist())
            gaps = (abs(a - b) for a, b in zip(given, known[row], strict=True))
            low[row], high[row] = outwards(max(gaps))
    return low, high


def _errors(
    model: Model, values: FloatArray, strengths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    with np.errstate(all="ignore"):
        enclosed = _enclosed(model, values)
        low, high = enclosed.rules
        outside = np.maximum(low - strengths, strengths - high)
        farthest = np.maximum(high - strengths, strengths - low)
        least = np.maximum(outside * (1.0 - 2 * U), 0.0).max(axis=0)
        most = (farthest * (1.0 + 2 * U)).max(axis=0)
    missing = np.isnan(strengths).any(axis=0)
    is_one_sided = missing != enclosed.missing
    least[missing | enclosed.missing] = most[missing | enclosed.missing] = 0.0
    least[is_one_sided] = most[is_one_sided] = 1.0
    return least, most
