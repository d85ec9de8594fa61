"""N4: terms of no width, columns of one value, tables of none, one and two rows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.checking.stability.carriers import Ready, made_ready, ready, unequal
from fuzzytree.checking.stability.results import Criterion, judged
from fuzzytree.checking.stability.terms import asked, collapsed, held
from fuzzytree.errors import FuzzyTreeError
from fuzzytree.model.contracts import Model, Outcome, Runtime
from fuzzytree.model.rulebase import LR, Band, Points, RuleBase, Shape
from fuzzytree.semantics.lowering import forms

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

_COPIES = 50  # rows of a table whose columns are all constant
_FEW = 8  # units in the last place: a spread below is that of a single sample
_ADVICE = (
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
    faults: list[str] = []
    skipped: list[str] = []
    cases = 0
    for representation, form in forms(model).items():
        question = asked(form, shape=collapsed) if isinstance(form, RuleBase) else None
        if question is None:
            continue
        for runtime in runtimes:
            one = made_ready(
                f"{representation}, collapsed", question.rules, runtime, skipped
            )
            if one is not None:
                told = held(one, question, skipped)
                cases += told.cases
                faults += told.faults
    for one in ready(model, runtimes, skipped):
        for said, is_wrong in _small_tables(one, one.some(values)):
            cases += 1
            faults += [f"{one.title}: {said}"] if is_wrong else []
    facts = [*_thin_terms(model), *_constant_columns(model)]
    return judged("N4", cases, faults, facts=facts, advice=_ADVICE, skipped=skipped)


def _small_tables(one: Ready, values: FloatArray) -> Iterator[tuple[str, bool]]:
    """Yield what was tried with small tables, and whether it went wrong."""
    width, count = values.shape
    for row in range(min(count, 3)):
        column = values[:, row : row + 1]
        alone = one.run(np.ascontiguousarray(column))
        many = one.run(np.broadcast_to(column, (width, _COPIES)))
        is_other = bool(unequal(many, repeated(alone, _COPIES)).any())
        yield f"{_COPIES} equal rows are not answered like one of them", is_other
    for size in (0, 1, 2):
        try:
            found = one.run(np.ascontiguousarray(values[:, :size]))
        except FuzzyTreeError as error:
            yield f"a table of {size} rows is refused: {error}", True
            continue
        shape = (min(size, count),)
        wrong = found.rule.shape != shape or found.status.shape != shape
        yield f"a table of {size} rows gets {found.rule.shape[0]} answers", wrong


def repeated(alone: Outcome, count: int) -> Outcome:
    """Return the answer to one row, so many times."""
    strengths = alone.strengths
    return Outcome(
        np.repeat(alone.rule, count),
        np.repeat(alone.status, count),
        None if strengths is None else np.repeat(strengths, count, axis=1),
    )


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
        case Band(left=left, right=right):
            widths = [
                abs(flank.start - flank.end) / math.ulp(flank.start)
                for flank in (left, right)
                if flank is not None
            ]
        case LR(mean=mean, left=below, right=above):
            widths = [side.spread / math.ulp(mean) for side in (below, above)]
        case Points():
            widths = []
    return min(widths, default=math.inf)


def _constant_columns(model: Model) -> Iterator[str]:
    for variable in model.variables:
        if variable.low is not None and variable.low == variable.high:
            yield f"{variable.name} was {variable.low!r} wherever it was seen"
