"""Claims about predictions: which classes, in which order, and what they depend on."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Sequence
from fractions import Fraction

import numpy as np

from fuzzytree.auditing.decide import Question
from fuzzytree.auditing.decide.domain import DomainSide
from fuzzytree.auditing.decide.regions import (
    EVERYWHERE,
    Region,
    Union,
    common,
    cut_side,
    regions,
)
from fuzzytree.auditing.require.claims import OrderClaim
from fuzzytree.auditing.require.search import Outcome, Rows, Search
from fuzzytree.auditing.require.tables import prediction_texts
from fuzzytree.model import FloatArray, FuzzySystem, FuzzyTree, Linear


def class_outcome(search: Search, labels: Sequence[str | None]) -> Outcome:
    """Return whether the class is always among some.

    A rule of another class decides where it is as strong as each rule of these classes
    that stands behind it, and stronger than those before it.
    """
    model, rules = search.model, search.base.rules
    assert not isinstance(model, FuzzySystem)
    right = [k for k, rule in enumerate(rules) if rule.then in labels]
    questions = [
        Question(
            (k,), tuple(j for j in right if j < k), tuple(j for j in right if j > k)
        )
        for k, rule in enumerate(rules)
        if rule.then not in labels
    ]
    if not isinstance(model, FuzzyTree) and model.semantics.uncovered not in labels:
        questions.append(gap(range(len(rules))))
    allowed = [k for k, label in enumerate((*model.classes, None)) if label in labels]

    def loss(rows: Rows) -> FloatArray:
        return np.where(np.isin(search.predict(rows)[0, 0], allowed), -1.0, 1.0)

    proof = f"no other rule decides, of {len(questions)}"
    outcome = search.rule_out(questions, "another rule decides", proof, loss)
    if outcome.rows is None:
        return outcome
    (label,) = prediction_texts(model, outcome.rows)
    return outcome._replace(sentence=f"the prediction is {label}")


def gap(rules: Sequence[int]) -> Question:
    """Return the question whether there is a point at which no rule fires."""
    return Question(weak=tuple(rules), level=Fraction(0))


def order_outcome(search: Search, claim: OrderClaim) -> Outcome:
    """Return whether no class follows a later one as an input rises."""
    model, labels = search.model, claim.labels
    assert not isinstance(model, FuzzySystem)
    ranks = np.array([*map(labels.index, model.classes), np.nan])

    def loss(rows: Rows) -> FloatArray:
        first, second = ranks[search.predict(rows)[0].astype(int)]
        return np.where(first > second, first - second, -1.0)

    rows = search.worst(loss, [claim.input])
    if rows is not None:
        return Outcome("REFUTED", "an earlier class follows", rows)
    if isinstance(model, FuzzyTree):
        return _of_leaves(
            search,
            [claim.input],
            lambda first, second: labels.index(first) > labels.index(second),
            rises=True,
        )
    return Outcome("OPEN", "an order of classes is proved of trees only")


def unchanged_outcome(
    search: Search, columns: tuple[str, ...], allowed: FloatArray
) -> Outcome:
    """Return whether no prediction depends on some inputs.

    Args:
        search: The model on a box.
        columns: The inputs.
        allowed: By how much each result may differ.
    """
    model, rules, axes = search.model, search.base.rules, search.base.axes

    def loss(rows: Rows) -> FloatArray:
        first, second = np.moveaxis(search.predict(rows), 1, 0)
        is_far = np.abs(first - second) > allowed[:, None]
        is_far |= np.isnan(first) != np.isnan(second)
        return np.where(is_far.any(0), 1.0, -1.0)

    pair = search.worst(loss, columns) if columns else None
    if pair is not None:
        return Outcome("REFUTED", "the rows differ in nothing else", pair)
    if isinstance(model, FuzzyTree):
        return _of_leaves(search, columns, str.__ne__, rises=False)
    rest: set[int] = {*range(len(rules))}
    if isinstance(model, FuzzySystem):
        rest.clear()
        places = [model.inputs.index(name) for name in columns]
        for term in (term for output in model.outputs for term in output.terms):
            weights = isinstance(term.function, Linear) and term.function.weights
            if weights and any(weights[place] for place in places):
                return Outcome("OPEN", f"the term {term.name!r} adds it")
    if search.base.left_out:
        return Outcome("OPEN", f"{search.base.left_out[0].name} is not bounded")
    tests = [
        k
        for k, rule in enumerate(rules)
        if any({*axes[name].weights} & {*columns} for name, _ in rule.literals)
    ]
    weak = tuple(rest - {*tests})
    return search.rule_out(
        [Question((k,), weak=weak) for k in tests],
        "a rule that tests it decides",
        f"no rule that tests it decides, of {len(tests)}",
    )


_IsWrong = Callable[[str, str], bool]  # of the classes of two rows


def _of_leaves(
    search: Search, changes: Collection[str], is_wrong: _IsWrong, *, rises: bool
) -> Outcome:
    """Return whether the classes of no two leaves of a tree are wrong together.

    A leaf is a product of unions of intervals, so two rows with the same values of all
    other inputs can reach two leaves exactly if these share a value of each.
    """
    tree = search.model
    assert isinstance(tree, FuzzyTree)
    tests = {node.variable for node in tree.nodes}
    for variable in tree.variables:
        sums = {part.input for part in variable.parts} & {*changes}
        if sums and variable.name in tests:
            return Outcome("OPEN", f"{variable.name!r} is a sum with {min(sums)!r}")
    for first, second in itertools.product(regions(tree), repeat=2):
        if not is_wrong(first.label, second.label):
            continue
        rows = _rows_in(search, (first, second), changes, rises=rises)
        if rows is not None and is_wrong(*prediction_texts(tree, rows)):
            return Outcome("REFUTED", "the rows differ in nothing else", rows)
        if rows is not None:
            text = "two leaves contradict it, if sums of inputs are free"
            return Outcome("OPEN", text)
    return Outcome("PROVED", f"no two of {len(tree.leaves)} leaves contradict it")


def _rows_in(
    search: Search,
    pair: tuple[Region, Region],
    changes: Collection[str],
    *,
    rises: bool,
) -> Rows | None:
    """Return two rows in two regions that differ in some inputs; sums are free."""
    free = DomainSide("", -math.inf, math.inf)
    unions = [dict(region.sides) for region in pair]
    columns: list[tuple[float, float]] = []
    for variable in search.model.variables:
        name = variable.name
        side = search.domain.side(name) or free
        first, second = (union.get(name, EVERYWHERE) for union in unions)
        if name in changes:
            starts, ends = _values(side, first), _values(side, second)
        else:
            starts = ends = _values(side, common(first, second))[-1:]
        if not (starts and ends):
            return None
        start, end = min(starts), max(ends)
        if rises and name in changes and start >= end:
            return None
        if not variable.parts:
            columns.append((start, end))
    return np.array(columns)[..., None]


def _values(side: DomainSide, union: Union) -> list[float]:
    """Return values of a side in a union, among them the least and the largest."""
    result: list[float] = []
    for part in (cut for interval in union if (cut := cut_side(side, interval))):
        low = math.nextafter(part.low, math.inf) if part.is_open else part.low
        result += [] if part.missing is None else [part.missing]
        result += [low, part.high]
        if not (part.values or part.is_whole) and math.isfinite(low + part.high):
            result.append((low + part.high) / 2)
    return result
