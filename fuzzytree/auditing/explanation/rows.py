"""Why a model of any kind answers one row as it does."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from fractions import Fraction
from types import MappingProxyType
from typing import cast

from msgspec.structs import replace

from fuzzytree.auditing.decide.answers import Budget
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import number_text
from fuzzytree.auditing.explanation.classes import ClassDecision, value_text
from fuzzytree.auditing.explanation.outputs import explain_outputs
from fuzzytree.auditing.explanation.records import Cell, Explanation
from fuzzytree.auditing.findings.domains import (
    Limits,
    Words,
    domain_of,
    limit_domain,
)
from fuzzytree.model import (
    Document,
    FuzzySystem,
    Model,
    Variable,
    fingerprint,
    name_choice,
    version,
)
from fuzzytree.rechecking import MISSING, value_word

STEPS = 2_000_000
"""The most steps of the search for the smallest change, about 2 s."""


def explain_row(
    model: Document,
    row: Mapping[str, float],
    *,
    wanted: str | None = None,
    fixed: Collection[str] = (),
    costs: Mapping[str, float] = MappingProxyType({}),
    limits: Limits = MappingProxyType({}),
    budget: Budget | None = None,
) -> Explanation:
    """Return why a model answers a row as it does, and what would change the class.

    Args:
        model: A tree, a rule base or a fuzzy system.
        row: A number for each input; NaN for one that is missing.
        wanted: The class that a change shall give; any other one by default.
        fixed: Inputs that do not change.
        costs: What a change by 1 costs, or any change of a category, by input; one
            over the range of the input by default.
        limits: The values that a change may give, by input; the range of the model by
            default.
        budget: How many steps may be taken; `STEPS` by default.

    Raises:
        ValueError: If a class or an input is unknown, a cost is not above 0, every
            input is fixed, or an input has no limits.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1)
        >>> explanation = explain_row(tree, dict.fromkeys(tree.inputs, 0.0))
        >>> explanation.change.verdict
        'PROVED'
    """
    if model.classes:
        _check_choice(model, wanted, fixed, costs)
    elif wanted is not None or fixed or costs:
        raise ValueError(
            f"{model.name!r} is a fuzzy system: it decides for no class, so that no "
            "class is wanted and no input is fixed or has a cost"
        )
    whole = limit_domain(domain_of(model, limited=limits, row=row), limits, model)
    for side in whole.sides:
        x = row.get(side.variable, math.nan)
        if side.variable in limits and math.isfinite(x) and not side.has(Fraction(x)):
            raise ValueError(
                f"the row lies outside the limits: {side.variable!r} is {x!r}, and "
                f"the limits are {side.low!r} to {side.high!r}"
            )
    domain = Domain(tuple(_with_value(side, row) for side in whole.sides))
    words = Words(domain, model.variables)
    blank = Explanation(
        version=version(),
        model=model.name,
        fingerprint=fingerprint(model),
        row=tuple(_cell(words, v, row[v.name]) for v in model.variables if not v.parts),
        filled=tuple(
            _filling(variable, variable.missing)
            for variable in model.variables
            if variable.missing is not None and not math.isfinite(row[variable.name])
        ),
        unit="cost" if costs else "range",
        wanted=wanted,
    )
    if model.outputs:
        system = cast("FuzzySystem", model)  # nothing else has outputs
        return explain_outputs(system, row, domain, blank)
    rates = {
        old.variable: 1 / (Fraction(old.high) - Fraction(old.low))
        for old, new in zip(whole.sides, domain.sides, strict=True)
        if old != new and old.low < old.high
    }
    rates |= {name: Fraction(cost) for name, cost in costs.items()}
    decision = ClassDecision(cast("Model", model), row, domain, blank)
    return decision.explanation(wanted, fixed, rates, budget or Budget(STEPS))


def _check_choice(
    model: Document,
    wanted: str | None,
    fixed: Collection[str],
    costs: Mapping[str, float],
) -> None:
    if wanted is not None and wanted not in model.classes:
        raise ValueError(f"no class {wanted!r}; {name_choice(wanted, model.classes)}")
    for name in (*fixed, *costs):
        if name not in model.inputs:
            raise ValueError(f"no input {name!r}; {name_choice(name, model.inputs)}")
    for name, cost in costs.items():
        if not (math.isfinite(cost) and cost > 0.0):
            raise ValueError(
                f"the cost of {name!r} must be above 0, not {cost!r}; "
                "fix an input that stays"
            )
    if fixed and {*model.inputs} <= {*fixed}:
        raise ValueError("every input is fixed, which leaves nothing to change")


def _with_value(side: DomainSide, row: Mapping[str, float]) -> DomainSide:
    """Return a side that has the value of a row too, wherever it lies."""
    x = row.get(side.variable, math.nan)
    if not math.isfinite(x) or side.values or side.has(Fraction(x)):
        return side
    is_whole = side.is_whole and x.is_integer()
    low, high = min(side.low, x), max(side.high, x)
    return replace(side, low=low, high=high, is_open=False, is_whole=is_whole)


def _cell(words: Words, variable: Variable, value: float) -> Cell:
    if not math.isfinite(value):
        return Cell(variable.name, None, MISSING)
    return Cell(variable.name, value, value_text(words, variable, value))


def _filling(variable: Variable, value: float) -> Cell:
    """Return what stands for a missing value; -1 is a category of its own."""
    if variable.categories:
        text = (*variable.categories, "a category of its own")[int(value)]
    else:
        text = value_word(variable, None, Fraction(value)) or number_text(value)
    return Cell(variable.name, value, text)
