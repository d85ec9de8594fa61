"""Whether a model meets requirements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.require.claims import (
    Box,
    Claim,
    Compliance,
    Requirement,
    RequirementAnswer,
)
from fuzzytree.auditing.require.outcomes import outcome_of
from fuzzytree.auditing.require.search import (
    Outcome,
    Search,
    prediction_texts,
    rows_text,
)
from fuzzytree.model import Document, Variable, fingerprint, version

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

    `domain` has the rows that the conditions of each requirement choose from, `steps`
    is the budget of each question; `title` and `source` name the files, if any.
    """
    if steps < 1:
        raise ValueError(f"the budget must be 1 step or more, not {steps}")
    pairs = [
        (
            requirement,
            [_part(model, domain, requirement, box) for box in requirement.boxes],
        )
        for requirement in requirements
    ]
    answers = tuple(_answer(model, of, boxes, steps) for of, boxes in pairs)
    title = title or model.name
    return Compliance(version(), title, fingerprint(model), source, steps, answers)


def _answer(
    model: Document, requirement: Requirement, boxes: Sequence[Domain], steps: int
) -> RequirementAnswer:
    """Return what is known of a requirement, by its worst box."""
    worst = Outcome("PROVED", "")
    for box in boxes:
        search = Search(model, _without_stand_in(box, requirement.claim), steps)
        outcome = outcome_of(requirement.claim, search)
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


def _without_stand_in(domain: Domain, claim: Claim) -> Domain:
    """Return a domain in which an input that rises has no missing value."""
    name = getattr(claim, "input", "")
    sides = (
        replace(side, missing=None) if side.variable == name else side
        for side in domain.sides
    )
    return Domain(tuple(sides))


def _part(model: Document, domain: Domain, of: Requirement, box: Box) -> Domain:
    """Return the rows of a domain in a box, whose ends replace those of the domain."""
    columns = {variable.name: variable for variable in model.variables}
    sides: list[DomainSide] = []
    for side in domain.sides:
        variable = columns[side.variable]
        if variable.parts:
            raise ValueError(f"{side.variable!r} is a sum; limits are for its inputs")
        if ends := box.get(side.variable):
            part = _narrow(side, variable, *ends)
            if part.low > part.high or (side.values and not part.values):
                raise ValueError(
                    f"{of.text!r}: no row meets the conditions, as the values of "
                    f"{side.variable!r} are {side.low:g} to {side.high:g}; "
                    "--limits sets others"
                )
            side = part
        sides.append(side)
    return Domain(tuple(sides))


def _narrow(
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
