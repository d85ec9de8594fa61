"""The terms of a model one by one, and what must hold for each without any tolerance.

A rule base with one rule for each term, whose inputs are the variables themselves,
makes every runtime return the degree of each term: it is the strength of its rule.
"""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Literal, assert_never

import msgspec
import numpy as np

from fuzzytree.checking.comparing import unequal
from fuzzytree.checking.stability.results import Criterion, Trial
from fuzzytree.checking.stability.runs import (
    LoadedForm,
    allowed_errors,
    loaded_form,
    loaded_forms,
    run_with_warning,
)
from fuzzytree.errors import FuzzyTreeError
from fuzzytree.model import (
    LR,
    Band,
    Dtype,
    FloatArray,
    Model,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Runtime,
    Shape,
    Side,
    Term,
    Variable,
)
from fuzzytree.numerics import exact_degree
from fuzzytree.semantics import forms, landmarks, neighbours

Demand = Literal["one", "below one", "zero"]

MOST_TERMS = 240
"""Terms that are tested one by one; of more, evenly drawn ones."""

_END_SLACK: dict[Dtype, float] = {
    "float64": 2.0**-50,
    "mixed": 2.0**-22,
    "float32": 2.0**-20,
}
"""Relative to the end of an LR set: within it the tail is 0 up to the fourth power."""


class TermProbes(msgspec.Struct, frozen=True):
    """A rule base whose strengths are degrees, and the rows to run.

    Attributes:
        rules: One rule for each term.
        values: Shape (variables, rows).
        places: For each rule: its variable's line, its shape, and the rows that hold
            its own edges.
        left_out: How many terms are not tested, for there are too many.
    """

    rules: RuleBase
    values: FloatArray
    places: tuple[tuple[int, Shape, slice], ...]
    left_out: int


def term_probes(
    rules: RuleBase,
    *,
    shape: Callable[[Shape], Shape] = lambda shape: shape,
) -> TermProbes | None:
    """Return the terms of a rule base as rules, and their edges as rows.

    `shape` gives what is tested in place of each membership function.

    Returns:
        The rows and rules; None if no variable has a term.
    """
    total = sum(len(v.terms) for v in rules.variables)
    step = -(-total // MOST_TERMS) or 1
    numbers = itertools.count()
    variables = [
        Variable(v.name, kept)
        for v in rules.variables
        if (
            kept := tuple(
                Term(t.name, shape(t.shape))
                for t in v.terms
                if next(numbers) % step == 0
            )
        )
    ]
    if not variables:
        return None
    tests = [
        Rule((Proposition(v.name, (t.name,)),), "true")
        for v in variables
        for t in v.terms
    ]
    lines: list[list[float]] = [[] for _ in variables]
    places: list[tuple[int, Shape, slice]] = []
    for number, v in enumerate(variables):
        for term in v.terms:
            start = len(lines[number])
            lines[number] += _edges(term.shape)
            places.append((number, term.shape, slice(start, len(lines[number]))))
    longest = max(map(len, lines))
    values = np.array([(line * longest)[:longest] for line in lines], np.float64)
    whole = RuleBase(rules.name, ("true",), tuple(variables), tuple(tests))
    return TermProbes(whole, values, tuple(places), total - len(tests))


def _edges(shape: Shape) -> list[float]:
    values = [value for mark in landmarks(shape) for value in neighbours(mark)]
    return list(dict.fromkeys(values)) or [0.0]


def collapsed(shape: Shape) -> Shape:
    """Return the narrowest shape at the same place: what one sample would leave.

    Plateaus that are closed on both sides hold one double, flanks end at the next
    double, spreads are one unit in the last place of the mean.
    """
    match shape:
        case Band(low=low, high=high, left=left, right=right):
            if low is not None and high is not None:
                high = math.nextafter(low, math.inf)
            return Band(low, high, _narrow(left, low), _narrow(right, high))
        case LR(mean=mean, left=below, right=above):
            return LR(mean, _thin(below, mean), _thin(above, mean))
        case Points():
            return shape
    assert_never(shape)


def _narrow(end: float | None, edge: float | None) -> float | None:
    if end is None or edge is None:
        return end
    return math.nextafter(edge, math.copysign(math.inf, end - edge))


def _thin(side: Side, mean: float) -> Side:
    return msgspec.structs.replace(side, spread=max(math.ulp(mean), 2.0**-1000))


def demanded(shape: Shape, value: float, dtype: Dtype) -> Demand | None:
    """Return what a degree must be exactly; None where a bound is all there is.

    float32 rounds the value and every stored number once; the demand is on those.

    Example:
        >>> demanded(Band(high=1.0, right=2.0), 1.0, "float64")
        'one'
        >>> demanded(Band(high=1.0, right=2.0), 2.0, "float64")
        'zero'
    """
    to = _single if dtype == "float32" else _same
    x = to(value)
    match shape:
        case Band(low=low, high=high, left=left, right=right):
            if low is not None and x <= to(low):
                is_out = left is None or x <= to(left)
            elif high is not None and x > to(high):
                is_out = right is None or x >= to(right)
            else:
                return "one"
            return "zero" if is_out else "below one"
        case LR(mean=mean, left=below, right=above):
            if x == to(mean):
                return "one"
            side = below if x < to(mean) else above
            end = side.reach * side.spread
            rounding = _END_SLACK[dtype] * (end + abs(mean))
            return "zero" if abs(x - to(mean)) > end + rounding else None
        case Points(values=values, degrees=degrees):
            place = next((k for k, v in enumerate(values) if x <= to(v)), None)
            known = degrees[-1] if place is None else None
            if place is not None and (place == 0 or x == to(values[place])):
                known = degrees[place]
            return "one" if known == 1.0 else "zero" if known == 0.0 else None
    assert_never(shape)


def broken(demand: Demand | None, degree: float) -> bool:
    """Return whether a degree is not what is demanded of it, or no degree at all."""
    match demand:
        case "one":
            return degree != 1.0
        case "below one":
            return not 0.0 <= degree < 1.0
        case "zero":
            return degree != 0.0
        case None:
            return not 0.0 <= degree <= 1.0
    assert_never(demand)


def _try_terms(
    trial: Trial,
    model: Model,
    runtimes: Sequence[Runtime],
    title: str,
    shape: Callable[[Shape], Shape] = lambda shape: shape,
    *,
    is_exact: bool = False,
) -> None:
    """Compare the degrees of all terms in all runtimes with what is demanded of them.

    `title` names the terms of a form, with `{}` for its name; `shape` gives what is
    tested in place of each membership function. Degrees are compared with the exact
    ones if `is_exact`.
    """
    for representation, form in forms(model).items():
        rules = form if isinstance(form, RuleBase) else None
        terms = None if rules is None else term_probes(rules, shape=shape)
        if terms is None:
            continue
        exact = _Exact(terms) if is_exact else None
        for runtime in runtimes:
            name = title.format(representation)
            one = loaded_form(name, terms.rules, runtime, trial.skipped)
            if one is not None:
                _try_degrees(trial, one, terms, exact)


def _try_degrees(
    trial: Trial, one: LoadedForm, terms: TermProbes, exact: _Exact | None
) -> None:
    outcome, warning = run_with_warning(one, terms.values)
    trial.add(0, warning and f"{one.title}: it warns: {warning}")
    if terms.left_out:
        trial.skipped.append(f"{terms.left_out} of the terms: there are too many")
    if outcome.strengths is None:
        trial.skipped.append(f"{one.runtime.name} returns no degrees")
        return
    if one.runtime.bound is not None:  # it promises nothing at a single value
        trial.skipped.append(f"{one.runtime.name} promises a bound, and no edge")
        return
    limits = allowed_errors(one, terms.values)
    for number, (line, shape, rows) in enumerate(terms.places):
        proposition = terms.rules.rules[number].when[0]
        name = f"{one.title}: {proposition.variable} is {proposition.terms[0]}"
        columns = (terms.values[line], outcome.strengths[number], limits)
        cells = zip(*(column[rows].tolist() for column in columns), strict=True)
        for value, degree, allowed in cells:
            trial.cases += 1
            demand = demanded(shape, value, one.runtime.dtype)
            fault = None
            if broken(demand, degree):
                fault = f"not {demand or 'between 0 and 1'}"
            elif exact is not None:
                gap = float(abs(Fraction(degree) - exact.degrees[number][value]))
                trial.add(0, worst=gap if allowed < 1.0 else None)
                if not gap <= allowed:
                    fault = f"{gap:.3g} from the exact one, {allowed:.3g} is allowed"
            if fault:
                trial.add(0, f"{name} at {value!r}: degree {degree!r}, {fault}")


def _same(value: float) -> float:
    return value


def _single(value: float) -> float:
    """Return a value rounded to float32; infinite beyond its range."""
    try:
        single: float = struct.unpack("f", struct.pack("f", value))[0]
    except OverflowError:
        return math.copysign(math.inf, value)
    return single


_ADVICE = (
    "compare with <= where the model says <=, clip before evaluating, and make the end "
    "of a term a comparison and not a cancellation"
)


def edges(model: Model, runtimes: Sequence[Runtime]) -> Criterion:
    """Test each term at its mean, its edges and its ends, and beside them (N5).

    Every landmark comes with the neighbouring floats, in double and in float32. On a
    plateau, at a mean and at a point the degree is exactly what is stored; off a
    plateau it is below 1; at an end and beyond exactly 0; elsewhere within the bound
    of the exact one.
    """
    trial = Trial("N5", _ADVICE, worst=0.0)
    _try_terms(trial, model, runtimes, "terms of {}", is_exact=True)
    return trial.result()


class _Exact:
    """The exact degrees of a question's terms, each computed once."""

    def __init__(self, question: TermProbes) -> None:
        self.degrees = [
            {
                value: exact_degree(shape, Fraction(value))
                for value in question.values[line, rows].tolist()
            }
            for line, shape, rows in question.places
        ]


_COPIES = 50  # rows of a table whose columns are all constant
_FEW = 8  # units in the last place: a spread below is that of a single sample
_ADVICE_DEGENERATE = (
    "a set made from one value must keep degree 1 at that value: compare values with "
    "the mean before dividing by the spread"
)


def degenerate(
    model: Model, runtimes: Sequence[Runtime], values: FloatArray
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
        for said, is_wrong in _small_tables(one, one.some(values)):
            trial.add(1, f"{one.title}: {said}" if is_wrong else None)
    return trial.result(*_thin_terms(model), *_constant_columns(model))


def _small_tables(one: LoadedForm, values: FloatArray) -> Iterator[tuple[str, bool]]:
    """Yield what was tried with small tables, and whether it went wrong."""
    width, count = values.shape
    copies = np.zeros(_COPIES, np.int64)
    for row in range(min(count, 3)):
        column = values[:, row : row + 1]
        alone = one.run(np.ascontiguousarray(column))
        many = one.run(np.broadcast_to(column, (width, _COPIES)))
        is_other = bool(unequal(many, alone.part(copies)).any())
        yield f"{_COPIES} equal rows are not answered like one of them", is_other
    for size in (0, 1, 2):
        try:
            outcome = one.run(np.ascontiguousarray(values[:, :size]))
        except FuzzyTreeError as error:
            yield f"a table of {size} rows is refused: {error}", True
            continue
        shape = (min(size, count),)
        wrong = outcome.rule.shape != shape or outcome.status.shape != shape
        yield f"a table of {size} rows gets {outcome.rule.shape[0]} answers", wrong


def _thin_terms(model: Model) -> Iterator[str]:
    """Yield the model's own terms that are as good as made from a single value."""
    for representation, form in forms(model).items():
        for variable in form.variables if isinstance(form, RuleBase) else ():
            for term in variable.terms:
                ulps = width_in_ulps(term.shape)
                if ulps < _FEW:
                    yield (
                        f"{representation}: {variable.name} is {term.name} changes "
                        f"within "
                        f"{ulps:.3g} units in the last place, as if from one value"
                    )


def width_in_ulps(shape: Shape) -> float:
    """Return the shortest change of a degree, in units in the last place."""
    match shape:
        case Band():
            widths = [abs(a - b) / math.ulp(a) for a, b in shape.flanks]
        case LR(mean=mean, left=below, right=above):
            widths = [side.spread / math.ulp(mean) for side in (below, above)]
        case Points():
            widths = []
    return min(widths, default=math.inf)


def _constant_columns(model: Model) -> Iterator[str]:
    for variable in model.variables:
        if variable.low is not None and variable.low == variable.high:
            yield f"{variable.name} was {variable.low!r} wherever it was seen"
