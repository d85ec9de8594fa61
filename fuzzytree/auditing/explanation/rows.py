"""Why a model of any kind answers one row as it does."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from fractions import Fraction
from typing import cast

from msgspec.structs import replace

from fuzzytree.auditing.decide.answers import Budget
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.explanation.classes import ClassDecision, value_text
from fuzzytree.auditing.explanation.outputs import explain_outputs
from fuzzytree.auditing.explanation.records import Explanation
from fuzzytree.auditing.findings.domains import Limits, Words, domain_of, limit_domain
from fuzzytree.model import (
    Document,
    FuzzySystem,
    Model,
    fingerprint,
    name_choice,
    version,
)
from fuzzytree.rechecking import MISSING
from fuzzytree.semantics import Status, answer_of, filled_row

_STEPS = 20_000_000  # of the search for the smallest change, at most about 20 s


def explain_row(
    model: Document,
    row: Mapping[str, float],
    *,
    wanted: str | None,
    fixed: Collection[str],
    costs: Mapping[str, float],
    limits: Limits,
) -> Explanation:
    """Return why a model answers a row as it does, as `fuzzytree.why` says.

    Args:
        model: A tree, a rule base or a fuzzy system.
        row: A number for each input; NaN for one that is missing.
        wanted: The class that a change shall give.
        fixed: Inputs that do not change.
        costs: What a change by 1 costs, by input.
        limits: The values that a change may give, by input.

    Raises:
        ValueError: If an argument does not fit the model.
    """
    _check(model, wanted, fixed, costs)
    box = limit_domain(domain_of(model, limited=limits, row=row), limits, model)
    domain = Domain(tuple(_with_value(side, row, limits) for side in box.sides))
    words, filled = Words(domain, model.variables), filled_row(model.variables, row)
    inputs = [variable for variable in model.variables if not variable.parts]
    texts = {
        variable.name: value_text(words, variable, filled[variable.name])
        for variable in inputs
        if math.isfinite(filled[variable.name])
    }
    answer = answer_of(model, row)
    blank = Explanation(
        version=version(),
        model=model.name,
        fingerprint=fingerprint(model),
        row={k: texts[k] if math.isfinite(row[k]) else MISSING for k in model.inputs},
        filled={
            name: "a value of its own" if text == MISSING else text
            for name, text in texts.items()
            if not math.isfinite(row[name])
        },
        status=Status(answer.status).name.lower(),
        rule=answer.rule,
        label=answer.label,
        wanted=wanted,
        unit="cost" if costs else "range",
    )
    if model.outputs:
        system = cast("FuzzySystem", model)  # nothing else has outputs
        return explain_outputs(system, row, domain, blank)
    rates = {
        old.variable: 1 / (Fraction(old.high) - Fraction(old.low))
        for old, new in zip(box.sides, domain.sides, strict=True)
        if (old.low, old.high) != (new.low, new.high) and old.low < old.high
    }
    rates |= {name: Fraction(cost) for name, cost in costs.items()}
    decision = ClassDecision(cast("Model", model), row, domain, blank)
    return decision.explanation(fixed, rates, Budget(_STEPS))


def _check(
    model: Document,
    wanted: str | None,
    fixed: Collection[str],
    costs: Mapping[str, float],
) -> None:
    if not model.classes and (wanted is not None or fixed or costs):
        raise ValueError(
            f"{model.name!r} is a fuzzy system: it decides for no class, so that no "
            "class is wanted and no input is fixed or has a cost"
        )
    if wanted is not None and wanted not in model.classes:
        raise ValueError(f"no class {wanted!r}; {name_choice(wanted, model.classes)}")
    for name in (*fixed, *costs):
        if name not in model.inputs:
            raise ValueError(f"no input {name!r}; {name_choice(name, model.inputs)}")
    for name, cost in costs.items():
        if not (math.isfinite(cost) and cost > 0.0):
            text = f"the cost of {name!r} must be above 0, not {cost!r}"
            raise ValueError(f"{text}; fix an input that stays")
    if fixed and {*model.inputs} <= {*fixed}:
        raise ValueError("every input is fixed, which leaves nothing to change")


def _with_value(
    side: DomainSide, row: Mapping[str, float], limits: Limits
) -> DomainSide:
    """Return a side that has the value of a row too; no change makes one missing."""
    name = side.variable
    x = row.get(name, math.nan)
    if not math.isfinite(x):
        return side
    side = replace(side, missing=None)
    if side.has(Fraction(x)):
        return side
    if name in limits:
        text = f"the row lies outside the limits: {name!r} is {x!r}"
        raise ValueError(f"{text}, and they are {side.low!r} to {side.high!r}")
    is_whole = side.is_whole and x.is_integer()
    low, high = min(side.low, x), max(side.high, x)
    return replace(side, low=low, high=high, is_open=False, is_whole=is_whole)
