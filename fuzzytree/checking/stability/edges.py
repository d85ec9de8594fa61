"""N5: exactly 1, exactly 0 and exactly the right side, at every edge of every term."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from fuzzytree.checking.stability.carriers import made_ready
from fuzzytree.checking.stability.judging import allowed_errors
from fuzzytree.checking.stability.results import Criterion, judged
from fuzzytree.checking.stability.terms import Asked, asked, held
from fuzzytree.model.contracts import Model, Runtime
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.numerics.oracle import exact_degree
from fuzzytree.semantics.lowering import forms

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

_ADVICE = (
    "compare with <= where the model says <=, clip before evaluating, and make the end "
    "of a term a comparison and not a cancellation"
)


def edges(model: Model, runtimes: Sequence[Runtime]) -> Criterion:
    """Ask each term at its mean, its edges and its ends, and beside them (N5).

    Every landmark comes with the neighbouring floats, in double and in float32. On a
    plateau, at a mean and at a point the degree is exactly what is stored; off a
    plateau it is below 1; at an end and beyond exactly 0; elsewhere within the bound
    of the exact one.
    """
    faults: list[str] = []
    skipped: list[str] = []
    cases, worst = 0, 0.0
    for representation, form in forms(model).items():
        question = asked(form) if isinstance(form, RuleBase) else None
        if question is None:
            continue
        exact = _Exact(question)
        for runtime in runtimes:
            one = made_ready(
                f"terms of {representation}", question.rules, runtime, skipped
            )
            if one is None:
                continue
            allowed = allowed_errors(one, question.values)
            tell = exact.difference(allowed, question.values)
            told = held(one, question, skipped, difference=tell)
            cases += told.cases
            worst = max(worst, told.worst)
            faults += told.faults
    return judged("N5", cases, faults, worst=worst, advice=_ADVICE, skipped=skipped)


class _Exact:
    """The exact degrees of a question's terms, each computed once."""

    def __init__(self, question: Asked) -> None:
        self.degrees = [
            {
                value: exact_degree(shape, Fraction(value))
                for value in question.values[line, rows].tolist()
            }
            for line, shape, rows in question.places
        ]
        self.lines = [line for line, _, _ in question.places]

    def difference(
        self, allowed: FloatArray, values: FloatArray
    ) -> Callable[[int, float, float], tuple[float, float]]:
        """Return what tells the error of a degree and the allowed one in its row."""
        limits = [
            dict(zip(reversed(line.tolist()), reversed(allowed.tolist()), strict=True))
            for line in values
        ]

        def tell(number: int, value: float, degree: float) -> tuple[float, float]:
            gap = abs(Fraction(degree) - self.degrees[number][value])
            return float(gap), limits[self.lines[number]][value]

        return tell
