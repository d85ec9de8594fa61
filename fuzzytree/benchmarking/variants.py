"""Variants of a rule base: its curves as points or lower degrees, in our runtimes.

Each gives up some exactness for something simpler, with a certified bound; whether it
also saves time is what a study shows.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from msgspec.structs import replace

from fuzzytree.benchmarking.candidates import (
    Bounds,
    Layouts,
    load_runtime,
    questions,
    title,
)
from fuzzytree.benchmarking.records import Bound, Candidate, Loaded, Omission, Question
from fuzzytree.model.contracts import Model, Runtime
from fuzzytree.model.rulebase import LR, Band, RuleBase
from fuzzytree.numerics.approximation import Approximated, by_degree, by_points
from fuzzytree.runtimes import all_runtimes, is_installed

TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
"""Of a degree, where curves become points."""

_MOST_TERMS = 400  # their points take seconds

Make = Callable[[RuleBase], Approximated]


class Approximations:
    """Approximated rule bases: each is made once, when it is first loaded."""

    def __init__(self) -> None:
        self._known: dict[tuple[Question, str], Approximated] = {}

    def get(
        self, question: Question, what: str, make: Make, rules: RuleBase
    ) -> Approximated:
        """Return one of them.

        Raises:
            LossError: If the rule base cannot be approximated so.
        """
        key = (question, what)
        if key not in self._known:
            self._known[key] = make(rules)
        return self._known[key]


def variants(
    model: Model, bounds: Bounds, layouts: Layouts
) -> tuple[list[Candidate], list[Omission]]:
    """Return the variants of each rule base that a model gives.

    Args:
        model: A tree or a rule base.
        bounds: Certifies the strengths of a rule base.
        layouts: Where sessions share their tables.

    Returns:
        The candidates, whose bounds are known once they are loaded, and what makes no
        variant of its own.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> found, _ = variants(random_tree(1), lambda rules, dtype: None, Layouts())
        >>> found[0].name
        'native, points 1e-01: relative rules'
    """
    found: list[Candidate] = []
    omitted: list[Omission] = []
    known = Approximations()
    for question, rules in questions(model).items():
        if not isinstance(rules, RuleBase):
            continue
        terms = sum(len(variable.terms) for variable in rules.variables)
        if terms > _MOST_TERMS:
            why = f"{terms:,} terms, and {_MOST_TERMS} are the most to approximate"
            omitted.append(Omission(f"variants: {question}", why))
            continue
        for what, make in _makers(rules).items():
            approximate = partial(known.get, question, what, make, rules)
            for runtime in all_runtimes():
                if runtime.in_variants and is_installed(runtime):
                    load = partial(_load, runtime, approximate, bounds, layouts)
                    one = Candidate(
                        title(f"{runtime.name}, {what}", question),
                        question,
                        "variant",
                        load,
                        is_parallel=runtime.prepare is not None,
                    )
                    found.append(one)
    return found, omitted


def _makers(rules: RuleBase) -> dict[str, Make]:
    """Return what makes each variant: points, and degrees below the largest there is.

    Without curves there is nothing to approximate.
    """
    largest = _largest_degree(rules)
    found: dict[str, Make] = {}
    if largest:
        for tolerance in TOLERANCES:
            found[f"points {tolerance:.0e}"] = partial(by_points, tolerance=tolerance)
    for degree in range(1, largest):
        found[f"degree {degree}"] = partial(by_degree, degree=degree)
    return found


def _largest_degree(rules: RuleBase) -> int:
    largest = 0
    for variable in rules.variables:
        for term in variable.terms:
            match term.shape:
                case Band(left=left, right=right):
                    curves = [side.curve for side in (left, right) if side is not None]
                case LR(left=left, right=right):
                    curves = [left.curve, right.curve]
                case _:
                    curves = []
            largest = max([largest, *map(len, curves)])
    return largest


def _load(
    runtime: Runtime,
    approximate: Callable[[], Approximated],
    bounds: Bounds,
    layouts: Layouts,
    threads: int,
) -> Loaded:
    found = approximate()
    loaded = load_runtime(runtime, found.model, layouts, threads)

    def bound() -> Bound | None:
        certified = bounds(found.model, runtime.dtype)
        if certified is None:
            return None
        error, origin = certified
        return min(found.bound + error, 1.0), f"{found.origin}, and {origin}"

    return replace(loaded, bound=bound)
