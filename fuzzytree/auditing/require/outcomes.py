"""Whether claims are true of a model on a box: classes, their order, and outputs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from fractions import Fraction

import numpy as np

from fuzzytree.auditing.decide import (
    Answer,
    Boxes,
    Budget,
    NotBoundedError,
    OutputBounds,
    Point,
    Proved,
    Question,
    scale_of,
    search_boxes,
)
from fuzzytree.auditing.decide.domain import DomainSide
from fuzzytree.auditing.decide.regions import (
    EVERYWHERE,
    Region,
    Union,
    common,
    cut_side,
    regions,
)
from fuzzytree.auditing.require.claims import (
    Claim,
    ClassClaim,
    ConstancyClaim,
    CoverageClaim,
    NumberClaim,
    OrderClaim,
)
from fuzzytree.auditing.require.search import (
    Loss,
    Outcome,
    Rows,
    Search,
    prediction_texts,
)
from fuzzytree.model import BoolArray, FloatArray, Linear
from fuzzytree.runtimes import baseline
from fuzzytree.semantics import Status

ROUNDING = 1e-9
"""The share of an output's scale by which rounding may change what is claimed of it."""

_WEAKER = tuple(2.0**k for k in (-10, -7, -5, -3, -1, 1, 4, 8))
"""The shares of an output's scale by which an open claim is weakened, in this order."""


def outcome_of(claim: Claim, search: Search) -> Outcome:
    """Return whether a claim is true of a model on a box."""
    model = search.model
    try:
        match claim:
            case ClassClaim(labels=labels):
                return class_outcome(search, labels)
            case OrderClaim():
                return order_outcome(search, claim)
            case ConstancyClaim(columns=columns):
                return constancy_outcome(search, columns)
            case CoverageClaim() if model.outputs:
                return coverage_outcome(search)
            case NumberClaim() if model.outputs:
                return number_outcome(search, claim)
            case _:
                raise TypeError(f"{claim} is a claim about a fuzzy system")
    except NotBoundedError as error:
        return Outcome("OPEN", str(error))


# --- classes


def class_outcome(search: Search, labels: Sequence[str | None]) -> Outcome:
    """Return whether the class is always among some.

    A rule of another class decides where it is as strong as each rule of these classes
    that stands behind it, and stronger than those before it.
    """
    model, rules = search.model, search.base.rules
    right = [k for k, rule in enumerate(rules) if rule.then in labels]
    questions = [
        Question(
            (k,), tuple(j for j in right if j < k), tuple(j for j in right if j > k)
        )
        for k, rule in enumerate(rules)
        if rule.then not in labels
    ]
    if model.rules and search.base.uncovered not in labels:
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
    ranks = np.array([*map(labels.index, model.classes), np.nan])

    def loss(rows: Rows) -> FloatArray:
        first, second = ranks[search.predict(rows)[0].astype(int)]
        return np.where(first > second, first - second, -1.0)

    rows = search.worst(loss, [claim.input])
    if rows is not None:
        return Outcome("REFUTED", "an earlier class follows", rows)
    if model.leaves:
        return _of_leaves(
            search,
            [claim.input],
            lambda first, second: labels.index(first) > labels.index(second),
            rises=True,
        )
    return Outcome("OPEN", "an order of classes is proved of trees only")


def constancy_outcome(search: Search, columns: tuple[str, ...]) -> Outcome:
    """Return whether no prediction depends on some inputs."""
    model, rules, axes = search.model, search.base.rules, search.base.axes
    scales = [scale_of(model, output.name) for output in model.outputs]
    allowed = ROUNDING * np.array(scales or [0.5])  # or of the position of a class

    def loss(rows: Rows) -> FloatArray:
        first, second = np.moveaxis(search.predict(rows), 1, 0)
        is_far = np.abs(first - second) > allowed[:, None]
        is_far |= np.isnan(first) != np.isnan(second)
        return np.where(is_far.any(0), 1.0, -1.0)

    pair = search.worst(loss, columns) if columns else None
    if pair is not None:
        return Outcome("REFUTED", "the rows differ in nothing else", pair)
    if model.leaves:
        return _of_leaves(search, columns, str.__ne__, rises=False)
    rest: set[int] = set() if model.outputs else {*range(len(rules))}
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
    search: Search,
    changes: Collection[str],
    is_wrong: _IsWrong,
    *,
    rises: bool,
) -> Outcome:
    """Return whether the classes of no two leaves of a tree are wrong together.

    A leaf is a product of unions of intervals, so two rows with the same values of all
    other inputs can reach two leaves exactly if these share a value of each.
    """
    tree = search.model
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


# --- outputs of fuzzy systems


def coverage_outcome(search: Search) -> Outcome:
    """Return whether every output of a system has a number that rules conclude."""
    system = search.model
    run = baseline().load(system, with_strengths=False)

    def loss(rows: Rows) -> FloatArray:
        return np.where(run(rows[:, 0]).status == Status.UNCOVERED, 1.0, -1.0)

    rows = search.worst(loss)
    if rows is not None:
        return Outcome("REFUTED", "no rule fires", rows)
    questions = [
        gap(OutputBounds(search.base, system, output.name).rules)
        for output in system.outputs
    ]
    proof = "some rule fires everywhere"
    return search.rule_out(questions, "no rule fires", proof, loss)


def number_outcome(search: Search, claim: NumberClaim) -> Outcome:
    """Return whether an output has a number everywhere, and it or its slope is right.

    Both ends of a claim are moved outwards by what rounding may change.
    """
    system = search.model
    place = [output.name for output in system.outputs].index(claim.output)
    line = search.model.inputs.index(claim.input) if claim.input else None
    allowed = ROUNDING * scale_of(system, claim.output)

    def loss(rows: Rows) -> FloatArray:
        y = search.predict(rows)[place]
        if line is None:
            lost = np.maximum(claim.low - y[0], y[0] - claim.high) - allowed
            return np.where(np.isnan(y[0]), np.inf, lost)
        rise, far = y[1] - y[0], rows[line, 1] - rows[line, 0]
        with np.errstate(invalid="ignore"):  # infinite ends of rows that are equal
            lost = np.maximum(claim.low * far - rise, rise - claim.high * far)
        return np.where((far > 0.0) & np.isfinite(rise), lost - allowed, -1.0)

    rows = search.worst(loss, [claim.input] if claim.input else ())
    outcome = Outcome("REFUTED", "", rows)
    if rows is None:
        outcome = _proof(search, claim, loss)
        rows = outcome.rows
    if rows is None:
        return outcome
    first, *more = search.predict(rows)[place, :, 0].tolist()
    text = f"it is {first:.6g}" if math.isfinite(first) else "no rule fires"
    for second in more:
        far = float(np.ptp(rows[line]))
        text = f"as {claim.input} rises by {far:.6g}, it changes by "
        text += f"{second - first:.6g}"
    return outcome._replace(sentence=text)


def _proof(search: Search, claim: NumberClaim, loss: Loss) -> Outcome:
    """Return what bounds on boxes prove, or the row of a box that refutes it."""
    system = search.model
    base, unit, of = search.base.fine, scale_of(system, claim.output), "it"
    if claim.input:
        axis = base.inputs[claim.input]
        unit, of = unit / (float(axis.high - axis.low) or 1.0), "its slope"
    bounds = OutputBounds(base, system, claim.output)
    default = bounds.output.default
    is_default = default is not None and claim.low <= default <= claim.high
    if claim.input or bounds.output.clips or not is_default:
        row_loss = None if claim.input else loss
        outcome = search.rule_out([gap(bounds.rules)], "no rule fires", "", row_loss)
        if outcome.verdict != "PROVED":
            return outcome

    def accepts(point: Mapping[str, Fraction]) -> bool:
        return not claim.input and loss(search.row(point))[0] > 0.0

    def prove(slack: float, steps: int) -> Answer:
        low, high = (
            end + sign * (slack + ROUNDING * unit)
            for end, sign in ((claim.low, -1), (claim.high, 1))
        )

        def is_excluded(boxes: Boxes) -> BoolArray:
            name = claim.input
            ends = bounds.slopes(boxes, name) if name else bounds.numbers(boxes)
            return np.array((ends.low >= low) & (ends.high <= high))

        steps //= bounds.work
        with np.errstate(all="ignore"):
            return search_boxes(base, is_excluded, accepts, Budget(2 * steps), steps)

    answer = prove(0.0, search.steps)
    if isinstance(answer, Point):
        return Outcome("REFUTED", "", search.row(answer.values))
    if isinstance(answer, Proved):
        where = "the whole domain" if answer.how == "1 boxes" else answer.how
        return Outcome("PROVED", f"bounds of {of} on {where}")
    open_ends = [math.isinf(claim.low), math.isinf(claim.high)]
    for share in _WEAKER if any(open_ends) or claim.low == -claim.high else ():
        slack = share * unit
        if isinstance(prove(slack, search.steps // 8), Proved):
            bound = claim.low - slack if open_ends[1] else claim.high + slack
            return Outcome("OPEN", answer.why, bound=bound)
    return Outcome("OPEN", answer.why)
