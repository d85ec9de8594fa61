"""The terms of a model one by one, and what must hold for each without any tolerance.

With one rule for each term every runtime returns the degree of each term: it is the
strength of its rule.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any, assert_never, cast

import msgspec
import numpy as np

from fuzzytree.checking.stability.results import Criterion, Trial
from fuzzytree.checking.stability.runs import (
    LoadedForm,
    allowed_errors,
    exact_check,
    forms_of,
    loaded_form,
    loaded_forms,
    run_with_warning,
    share,
    truth,
)
from fuzzytree.errors import FuzzyTreeError
from fuzzytree.model import (
    LR,
    Activation,
    Band,
    Curve,
    Document,
    Dtype,
    FloatArray,
    Outcome,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Runtime,
    Shape,
    Side,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.numerics import BELOW_ONE, exact_degree
from fuzzytree.semantics import landmarks_of, neighbours

MOST_TERMS = 240
"""Terms that are tested one by one; of more, evenly drawn ones."""

_END_SLACK: dict[Dtype, float] = {
    "float64": 2.0**-50,
    "mixed": 2.0**-22,
    "float32": 2.0**-20,
}
"""Relative to the end of an LR set: within it the tail is 0 up to the fourth power."""

Range = tuple[float, float]
_ONE, _ZERO, _BELOW_ONE, _ANY = (1.0, 1.0), (0.0, 0.0), (0.0, BELOW_ONE), (0.0, 1.0)
_WORDS = {_ONE: "one", _ZERO: "zero", _BELOW_ONE: "below one"}


class TermProbes(msgspec.Struct, frozen=True):
    """A model whose strengths are degrees, and the rows to run.

    Attributes:
        model: It has one rule for each term.
        values: Shape (inputs, rows).
        places: For each rule: what it tests, its input's line, the function, and the
            rows that hold its own edges.
        left_out: How many terms are not tested, for there are too many.
    """

    model: Document
    values: FloatArray
    places: tuple[tuple[str, int, Curve, slice], ...]
    left_out: int


def term_probes(
    form: Document, change: Callable[[Shape], Shape] | None = None
) -> TermProbes | None:
    """Return the terms of a model as rules, and their edges as rows.

    `change` gives what is tested in place of each membership function.

    Returns:
        The rows and rules; None if no rule tests a term. A tree has no rules. The
        combinations of a rule base count as inputs, those of a system are left out.
    """
    is_system = bool(form.outputs)
    sources = [v for v in form.variables if form.rules and not (is_system and v.parts)]
    step = -(-sum(len(v.terms) for v in sources) // MOST_TERMS) or 1
    numbers = itertools.count()
    variables: list[Variable] = []
    lines: list[list[float]] = []
    places: list[tuple[str, int, Curve, slice]] = []
    propositions: list[Proposition] = []
    for source in sources:
        line: list[float] = []
        terms: list[Term] = []
        for term in source.terms:
            if next(numbers) % step:
                continue
            if change is not None and isinstance(term.function, Band | LR | Points):
                term = msgspec.structs.replace(term, function=change(term.function))
            terms.append(term)
            edges = [
                near for x in landmarks_of(term.function) for near in neighbours(x)
            ]
            rows = slice(len(line), len(line) + len(dict.fromkeys(edges)))
            line += dict.fromkeys(edges)
            name = f"{source.name} is {term.name}"
            places.append((name, len(lines), term.function, rows))
            propositions.append(Proposition(source.name, (term.name,)))
        if terms or is_system:
            kept = source if is_system else Variable(source.name)
            variables.append(msgspec.structs.replace(kept, terms=tuple(terms)))
            lines.append(line or [0.0])
    if not propositions:
        return None
    longest = max(map(len, lines))
    values = np.array([(line * longest)[:longest] for line in lines], np.float64)
    model: Document
    if is_system:
        blocks: Any = form.blocks
        then = blocks[0].rules[0].then[:1]
        rules = tuple(SystemRule(one, then) for one in propositions)
        block = msgspec.structs.replace(blocks[0], rules=rules, activation=Activation())
        others = [v for v in form.variables if v.parts]
        every = (*variables, *others)
        model = msgspec.structs.replace(form, variables=every, blocks=(block,))
    else:
        tests = tuple(Rule((one,), "true") for one in propositions)
        model = RuleBase(form.name, ("true",), tuple(variables), tests)
    left_out = sum(len(v.terms) for v in sources) - len(propositions)
    return TermProbes(model, values, tuple(places), left_out)


def collapsed(shape: Shape) -> Shape:
    """Return the narrowest shape at the same place: what one sample would leave.

    Plateaus that are closed on both sides hold one double, flanks end at the next
    double, spreads are one unit in the last place of the mean.
    """

    def narrow(end: float | None, edge: float | None) -> float | None:
        if end is None or edge is None:
            return end
        return math.nextafter(edge, math.copysign(math.inf, end - edge))

    def thin(side: Side, mean: float) -> Side:
        spread = max(math.ulp(mean), 2.0**-1000)
        return msgspec.structs.replace(side, spread=spread)

    match shape:
        case Band(low=low, high=high, left=left, right=right):
            if low is not None and high is not None:
                high = math.nextafter(low, math.inf)
            return Band(low, high, narrow(left, low), narrow(right, high))
        case LR(mean=mean, left=below, right=above):
            return LR(mean, thin(below, mean), thin(above, mean))
        case Points():
            return shape
    assert_never(shape)


def demanded(shape: Shape, value: float, dtype: Dtype) -> Range:
    """Return between which numbers a degree must lie, whatever its bound is.

    float32 rounds the value and every stored number once; the demand is on those.

    Example:
        >>> demanded(Band(high=1.0, right=2.0), 1.0, "float64")
        (1.0, 1.0)
        >>> demanded(Band(high=1.0, right=2.0), 2.0, "float64")
        (0.0, 0.0)
    """

    def to(number: float) -> float:
        with np.errstate(over="ignore"):
            return float(np.float32(number)) if dtype == "float32" else number

    x = to(value)
    match shape:
        case Band(low=low, high=high, left=left, right=right):
            if low is not None and x <= to(low):
                is_out = left is None or x <= to(left)
            elif high is not None and x > to(high):
                is_out = right is None or x >= to(right)
            else:
                return _ONE
            return _ZERO if is_out else _BELOW_ONE
        case LR(mean=mean, left=below, right=above):
            if x == to(mean):
                return _ONE
            side = below if x < to(mean) else above
            end = side.reach * side.spread
            rounding = _END_SLACK[dtype] * (end + abs(mean))
            return _ZERO if abs(x - to(mean)) > end + rounding else _ANY
        case Points(values=values, degrees=degrees):
            place = next((k for k, v in enumerate(values) if x <= to(v)), None)
            known = degrees[-1] if place is None else None
            if place is not None and (place == 0 or x == to(values[place])):
                known = degrees[place]
            return _ONE if known == 1.0 else _ZERO if known == 0.0 else _ANY
    assert_never(shape)


def _try_terms(
    trial: Trial,
    model: Document,
    runtimes: Sequence[Runtime],
    title: str,
    change: Callable[[Shape], Shape] | None = None,
) -> None:
    """Compare the degrees of all terms in all runtimes with what must be.

    `title` names the terms of a form, with `{}` for its name; `change` gives what is
    tested in place of each membership function, and then not against exact degrees.
    """
    for representation, form in forms_of(model).items():
        terms = term_probes(form, change)
        if terms is None:
            continue
        if terms.left_out:
            trial.skipped.append(f"{terms.left_out} of the terms: there are too many")
        right = truth(terms.model, terms.values) if form.outputs else None
        exact = None if change or form.outputs else _exact_degrees(terms)
        name = title.format(representation)
        for runtime in runtimes:
            one = loaded_form(name, terms.model, runtime, trial.skipped)
            if one is not None and isinstance(right, Outcome):
                values = one.some(terms.values)
                some = share(values) if runtime.is_slow else slice(None)
                check = exact_check(one, values, right.part(some))
                trial.add(check.rows, *check.faults, worst=check.worst)
            elif one is not None:
                _try_degrees(trial, one, terms, exact)


def _exact_degrees(terms: TermProbes) -> list[dict[float, Fraction]]:
    return [
        {
            value: exact_degree(cast("Shape", curve), Fraction(value))
            for value in terms.values[line, rows].tolist()
        }
        for _, line, curve, rows in terms.places
    ]


def _try_degrees(
    trial: Trial,
    one: LoadedForm,
    terms: TermProbes,
    exact: list[dict[float, Fraction]] | None,
) -> None:
    outcome, warning = run_with_warning(one, terms.values)
    trial.add(0, warning and f"{one.title}: it warns: {warning}")
    if outcome.strengths is None:
        trial.skipped.append(f"{one.runtime.name} returns no degrees")
        return
    if one.runtime.bound is not None:  # it promises nothing at a single value
        trial.skipped.append(f"{one.runtime.name} promises a bound, and no edge")
        return
    limits = allowed_errors(one, terms.values)
    for number, (name, line, curve, rows) in enumerate(terms.places):
        columns = (terms.values[line], outcome.strengths[number], limits)
        cells = zip(*(column[rows].tolist() for column in columns), strict=True)
        for value, degree, allowed in cells:
            trial.cases += 1
            low, high = demanded(cast("Shape", curve), value, one.runtime.dtype)
            fault = None
            if not low <= degree <= high:
                fault = f"not {_WORDS.get((low, high), 'between 0 and 1')}"
            elif exact is not None:
                gap = float(abs(Fraction(degree) - exact[number][value]))
                trial.add(0, worst=gap if allowed < 1.0 else None)
                if not gap <= allowed:
                    fault = f"{gap:.3g} from the exact one, {allowed:.3g} is allowed"
            if fault:
                where = f"{one.title}: {name} at {value!r}"
                trial.add(0, f"{where}: degree {degree!r}, {fault}")


_ADVICE = (
    "compare with <= where the model says <=, clip before evaluating, and make the end "
    "of a term a comparison and not a cancellation"
)


def edges(model: Document, runtimes: Sequence[Runtime]) -> Criterion:
    """Test each term at its mean, its edges and its ends, and beside them (N5).

    Every landmark comes with the neighbouring floats, in double and in float32. On a
    plateau, at a mean and at a point the degree is exactly what is stored; off a
    plateau it is below 1; at an end and beyond exactly 0; elsewhere within the bound
    of the exact one. The degrees of a system are those of its definition.
    """
    trial = Trial("N5", _ADVICE, worst=0.0)
    _try_terms(trial, model, runtimes, "terms of {}")
    return trial.result()


_COPIES = 50  # rows of a table whose columns are all constant
_ADVICE_DEGENERATE = (
    "a set made from one value must keep degree 1 at that value: compare values with "
    "the mean before dividing by the spread"
)


def degenerate(
    model: Document, runtimes: Sequence[Runtime], values: FloatArray
) -> Criterion:
    """Collapse every term to its narrowest and every table to its smallest (N4).

    A collapsed set keeps degree exactly 1 at its mean or on its plateau, is exactly 0
    from its end on, and no runtime warns. A table of equal rows, given without copies
    (its columns have no stride), is answered like one of them; so are tables of two,
    one and no rows.
    """
    trial = Trial("N4", _ADVICE_DEGENERATE)
    _try_terms(trial, model, runtimes, "{}, collapsed", collapsed)
    for one in loaded_forms(model, runtimes, trial.skipped):
        for fault in _small_tables(one, one.some(values)):
            trial.add(1, fault)
    return trial.result()


def _small_tables(one: LoadedForm, values: FloatArray) -> Iterator[str | None]:
    """Try small tables; yield for each what went wrong, if anything."""
    width, count = values.shape
    for row in range(min(count, 3)):
        column = values[:, row : row + 1]
        table = np.broadcast_to(column, (width, _COPIES))
        alone = one.run(np.ascontiguousarray(column)).part(np.zeros(_COPIES, np.int64))
        fault = f": {_COPIES} equal rows are not answered like one of them"
        yield one.fault(fault, table, one.run(table), alone)[1]
    for size in (0, 1, 2):
        try:
            outcome = one.run(np.ascontiguousarray(values[:, :size]))
        except FuzzyTreeError as error:
            yield f"{one.title}: a table of {size} rows is refused: {error}"
            continue
        shape = (min(size, count),)
        is_wrong = outcome.rule.shape != shape or outcome.status.shape != shape
        answers = f"a table of {size} rows gets {outcome.rule.shape[0]} answers"
        yield f"{one.title}: {answers}" if is_wrong else None
