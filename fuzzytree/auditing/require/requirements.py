"""Whether a model meets requirements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.decide import NotBoundedError, scale_of
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.require.claims import (
    Box,
    Claim,
    ClassClaim,
    Compliance,
    CoveredClaim,
    NumberClaim,
    OrderClaim,
    Requirement,
    RequirementAnswer,
    UnchangedClaim,
)
from fuzzytree.auditing.require.classes import (
    class_outcome,
    order_outcome,
    unchanged_outcome,
)
from fuzzytree.auditing.require.numbers import (
    ROUNDING,
    covered_outcome,
    number_outcome,
)
from fuzzytree.auditing.require.search import Outcome, Search
from fuzzytree.auditing.require.tables import prediction_texts, rows_text
from fuzzytree.model import Document, FuzzySystem, Variable, fingerprint, version

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
    """
    if steps < 1:
        raise ValueError(f"the budget must be 1 step or more, not {steps}")
    boxes = [
        [_part(model, domain, requirement, box) for box in requirement.boxes]
        for requirement in requirements
    ]
    answers = tuple(
        _answer(model, requirement, parts, steps)
        for requirement, parts in zip(requirements, boxes, strict=True)
    )
    title = title or model.name
    return Compliance(version(), title, fingerprint(model), source, steps, answers)


def _answer(
    model: Document, requirement: Requirement, boxes: Sequence[Domain], steps: int
) -> RequirementAnswer:
    """Return what is known of a requirement, by its worst box."""
    worst = Outcome("PROVED", "")
    for box in boxes:
        outcome = _outcome(model, requirement.claim, box, steps)
        if worst.verdict == "PROVED" or outcome.verdict == "REFUTED":
            worst = outcome
        if worst.verdict == "REFUTED":
            break
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
    if name := getattr(claim, "input", ""):  # a missing value has no place in it
        sides = (
            replace(side, missing=None) if side.variable == name else side
            for side in domain.sides
        )
        domain = Domain(tuple(sides))
    search = Search(model, domain, steps)
    try:
        if isinstance(claim, UnchangedClaim):
            scales = [0.5]  # of the position of a class
            if isinstance(model, FuzzySystem):
                scales = [scale_of(model, output.name) for output in model.outputs]
            allowed = ROUNDING * np.array(scales)
            return unchanged_outcome(search, claim.columns, allowed)
        match claim, model:
            case ClassClaim(labels=labels), _:
                return class_outcome(search, labels)
            case OrderClaim(), _:
                return order_outcome(search, claim)
            case CoveredClaim(), FuzzySystem():
                return covered_outcome(search, model)
            case NumberClaim(), FuzzySystem():
                return number_outcome(search, model, claim)
            case _:
                raise TypeError(f"{claim} is a claim about a fuzzy system")
    except NotBoundedError as error:
        return Outcome("OPEN", str(error))


def _part(model: Document, domain: Domain, of: Requirement, box: Box) -> Domain:
    """Return the rows of a domain in a box, whose ends replace those of the domain."""
    columns = {variable.name: variable for variable in model.variables}
    sides: list[DomainSide] = []
    for side in domain.sides:
        variable = columns[side.variable]
        if variable.parts:
            raise ValueError(f"{side.variable!r} is a sum; limits are for its inputs")
        if ends := box.get(side.variable):
            part = _narrowed(side, variable, *ends)
            if part.low > part.high or (side.values and not part.values):
                raise ValueError(
                    f"{of.text!r}: no row meets the conditions, as the values of "
                    f"{side.variable!r} are {side.low:g} to {side.high:g}; "
                    "--limits sets others"
                )
            side = part
        sides.append(side)
    return Domain(tuple(sides))


def _narrowed(
    side: DomainSide, variable: Variable, low: float, high: float
) -> DomainSide:
    """Return the values of a side between two ends, which may lie beyond its own."""
    if variable.clips or math.isinf(low):
        low = max(low, side.low)
    if variable.clips or math.isinf(high):
        high = min(high, side.high)
    if side.is_whole:
        low, high = math.ceil(low), math.floor(high)
    values = tuple(value for value in side.values if low <= value <= high)
    return replace(side, low=low, high=high, values=values, missing=None)
