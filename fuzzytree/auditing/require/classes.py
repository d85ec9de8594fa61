"""Claims about predictions: which classes, in which order, and what they depend on."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fuzzytree.auditing.decide import Answer, Open, Point, Proved, Question
from fuzzytree.auditing.require.claims import OrderClaim
from fuzzytree.auditing.require.leaves import pair_of_rows
from fuzzytree.auditing.require.search import Outcome, Rows, Search, prediction_texts
from fuzzytree.model import BoolArray, FloatArray, FuzzySystem, FuzzyTree, Linear

_PAIRS = 1024  # of rows that differ in some inputs only


def class_outcome(search: Search, labels: Sequence[str | None]) -> Outcome:
    """Return whether the class is always among some.

    A rule of another class decides where it is as strong as each rule of these classes
    that stands behind it, and stronger than those before it.
    """
    model, rules = search.model, search.base.rules
    assert not isinstance(model, FuzzySystem)
    right = [k for k, rule in enumerate(rules) if rule.then in labels]
    answers: list[Answer] = []
    for k, rule in enumerate(rules):
        if rule.then not in labels:
            rivals = tuple(j for j in right if j < k)
            weak = tuple(j for j in right if j > k)
            answers.append(search.ask(Question((k,), rivals, weak)))
    if not isinstance(model, FuzzyTree) and model.semantics.uncovered not in labels:
        answers.append(search.ask_gap(range(len(rules))))

    def loss(row: Rows) -> float:
        code = int(search.predict(row)[0, 0])
        return 1.0 if (*model.classes, None)[code] not in labels else -1.0

    for answer in answers:
        if isinstance(answer, Point):
            row = search.row(answer.values)
            if loss(row) > 0.0:
                row = search.short(row, loss)
                (label,) = prediction_texts(model, row)
                return Outcome("REFUTED", f"the prediction is {label}", row)
    rest = [answer for answer in answers if not isinstance(answer, Proved)]
    if rest:
        return Outcome("OPEN", f"{len(rest)} of {len(answers)}: {_why(rest[0])}")
    return Outcome("PROVED", f"no other rule decides, of {len(answers)}")


def _why(answer: Answer) -> str:
    return answer.why if isinstance(answer, Open) else "no double shows a point"


def order_outcome(search: Search, claim: OrderClaim) -> Outcome:
    """Return whether no class follows a later one as an input rises."""
    model, labels = search.model, claim.labels
    assert not isinstance(model, FuzzySystem)
    ranks = np.array([*map(labels.index, model.classes), np.nan])

    def rank(rows: Rows) -> FloatArray:
        return np.array(ranks[search.predict(rows)[0].astype(int)])

    rows = search.fall(claim.input, rank, 0.5)
    if rows is not None:
        return Outcome("REFUTED", "an earlier class follows", rows)
    if isinstance(model, FuzzyTree):
        return _of_leaves(
            search,
            (claim.input,),
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
    places = [model.inputs.index(name) for name in columns]
    first, other = search.draw(_PAIRS), search.draw(_PAIRS)
    second = first.copy()
    second[places] = other[places]

    def differ(one: Rows, two: Rows) -> BoolArray:
        a, b = search.predict(one), search.predict(two)
        far = np.abs(a - b) > allowed[:, None]
        return np.array((far | (np.isnan(a) != np.isnan(b))).any(0))

    for k in np.flatnonzero(differ(first, second))[:1]:
        rows = np.stack([first[:, k], second[:, k]], axis=1)
        rows = search.short(rows, lambda two: float(differ(two[:, :1], two[:, 1:])[0]))
        return Outcome("REFUTED", "the rows differ in nothing else", rows)
    if isinstance(model, FuzzyTree):
        return _of_leaves(search, columns, lambda one, two: one != two, rises=False)
    for variable in model.outputs if isinstance(model, FuzzySystem) else ():
        for term in variable.terms:
            weights = (
                term.function.weights if isinstance(term.function, Linear) else None
            )
            if weights and any(weights[place] for place in places):
                return Outcome(
                    "OPEN", f"the term {term.name!r} of {variable.name!r} adds it"
                )
    if search.base.left_out:
        return Outcome("OPEN", f"{search.base.left_out[0].name} is not bounded")
    tests = [
        k
        for k, rule in enumerate(rules)
        if any({*axes[name].weights} & {*columns} for name, _ in rule.literals)
    ]
    rest = () if isinstance(model, FuzzySystem) else {*range(len(rules))} - {*tests}
    for k in tests:
        if not isinstance(search.ask(Question((k,), weak=tuple(rest))), Proved):
            return Outcome("OPEN", f"rule {rules[k].number} tests it and may decide")
    return Outcome("PROVED", f"no rule that tests it decides, of {len(tests)}")


def _of_leaves(
    search: Search,
    columns: tuple[str, ...],
    is_wrong: Callable[[str, str], bool],
    *,
    rises: bool,
) -> Outcome:
    """Return whether the classes of no two leaves of a tree are wrong together."""
    tree = search.model
    assert isinstance(tree, FuzzyTree)
    tested = {node.variable for node in tree.nodes}
    for variable in tree.variables:
        summed = {part.input for part in variable.parts} & {*columns}
        if summed and variable.name in tested:
            return Outcome("OPEN", f"{variable.name!r} is a sum with {min(summed)!r}")
    rows = pair_of_rows(tree, search.domain, columns, is_wrong, rises=rises)
    if rows is None:
        return Outcome("PROVED", f"no two of {len(tree.leaves)} leaves contradict it")
    if is_wrong(*prediction_texts(tree, rows)):
        return Outcome("REFUTED", "the rows differ in nothing else", rows)
    return Outcome("OPEN", "two leaves contradict it, if sums of inputs are free")
