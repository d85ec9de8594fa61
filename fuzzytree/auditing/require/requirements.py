"""Whether a model meets requirements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.require.claims import (
    Box,
    Claim,
    ClassClaim,
    Compliance,
    CoveredClaim,
    LevelClaim,
    OrderClaim,
    Requirement,
    RequirementAnswer,
    SlopeClaim,
    UnchangedClaim,
)
from fuzzytree.auditing.require.classes import (
    class_outcome,
    order_outcome,
    unchanged_outcome,
)
from fuzzytree.auditing.require.numbers import (
    covered_outcome,
    level_outcome,
    slope_outcome,
)
from fuzzytree.auditing.require.outputs import ROUNDING, scale_of
from fuzzytree.auditing.require.search import (
    Outcome,
    Search,
    prediction_texts,
    rows_text,
)
from fuzzytree.auditing.require.slopes import NotBoundedError
from fuzzytree.model import Document, FuzzySystem, fingerprint, version

STEPS: Final = 4_000_000
"""The budget of each question of a requirement; a step is about a microsecond."""


def comply(
    model: Document,
    requirements: Sequence[Requirement],
    domain: Domain,
    *,
    steps: int = STEPS,
    title: str = "",
    source: str = "",
) -> Compliance:
    """Return which requirements a model meets.

    Args:
        model: The model.
        requirements: What it must do.
        domain: The rows that the conditions of each requirement choose from.
        steps: The budget of each question.
        title: The file of the model, if it has one.
        source: The file of the requirements.

    Raises:
        ValueError: If no row meets the conditions of a requirement.
    """
    if steps < 1:
        raise ValueError(f"the budget must be 1 step or more, not {steps}")
    parts = [
        [_part(model, domain, one, box) for box in one.boxes] for one in requirements
    ]
    return Compliance(
        version(),
        title or model.name,
        fingerprint(model),
        source,
        steps,
        tuple(
            _answer(model, requirement, boxes, steps)
            for requirement, boxes in zip(requirements, parts, strict=True)
        ),
    )


def _answer(
    model: Document, requirement: Requirement, boxes: Sequence[Domain], steps: int
) -> RequirementAnswer:
    """Return what is known of a requirement, by its worst box."""
    outcomes: list[Outcome] = []
    for box in boxes:
        outcomes.append(_outcome(model, requirement.claim, box, steps))
        if outcomes[-1].verdict == "REFUTED":
            break
    worst = max(
        outcomes, key=lambda one: ("PROVED", "OPEN", "REFUTED").index(one.verdict)
    )
    rows = worst.rows
    return RequirementAnswer(
        requirement.text,
        requirement.name,
        requirement.why,
        requirement.line,
        requirement.column,
        worst.verdict,
        worst.sentence,
        worst.bound,
        "" if rows is None else rows_text(model, rows),
        () if rows is None else prediction_texts(model, rows),
    )


def _outcome(model: Document, claim: Claim, domain: Domain, steps: int) -> Outcome:
    if isinstance(claim, OrderClaim | SlopeClaim):  # a missing value has no place in it
        sides = [
            replace(side, missing=None) if side.variable == claim.input else side
            for side in domain.sides
        ]
        domain = Domain(tuple(sides))
    search = Search(model, domain, steps)
    try:
        match claim:
            case ClassClaim(labels=labels):
                return class_outcome(search, labels)
            case OrderClaim():
                return order_outcome(search, claim)
            case UnchangedClaim(columns=columns):
                allowed = [0.5]  # of the position of a class
                if isinstance(model, FuzzySystem):
                    allowed = [ROUNDING * scale_of(model, one) for one in model.outputs]
                return unchanged_outcome(search, columns, np.array(allowed))
            case CoveredClaim():
                return covered_outcome(search)
            case LevelClaim():
                return level_outcome(search, claim)
            case SlopeClaim():
                return slope_outcome(search, claim)
    except NotBoundedError as error:
        return Outcome("OPEN", str(error))


def _part(
    model: Document, domain: Domain, requirement: Requirement, box: Box
) -> Domain:
    """Return the rows of a domain in a box, whose ends replace those of the domain.

    Raises:
        ValueError: If there is none.
    """
    sides: list[DomainSide] = []
    columns = {variable.name: variable for variable in model.variables}
    for side in domain.sides:
        if columns[side.variable].parts:
            raise ValueError(f"{side.variable!r} is a sum; limits are for its inputs")
        if side.variable in box:
            ends = f"{side.low:g} to {side.high:g}"
            low, high = box[side.variable]
            low = side.low if math.isinf(low) else low
            high = side.high if math.isinf(high) else high
            if columns[side.variable].clips:
                low, high = max(low, side.low), min(high, side.high)
            if side.is_whole:
                low, high = math.ceil(low), math.floor(high)
            values = tuple(value for value in side.values if low <= value <= high)
            if low > high or (side.values and not values):
                raise ValueError(
                    f"{requirement.text!r}: no row meets the conditions, as the values "
                    f"of {side.variable!r} are {ends}; --limits sets others"
                )
            side = replace(side, low=low, high=high, values=values, missing=None)
        sides.append(side)
    return Domain(tuple(sides))
