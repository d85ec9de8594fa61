"""Compare audits of systems with what the systems themselves compute on a grid."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from fractions import Fraction

from fuzzytree.auditing.decide.states import Bracket, Proved, Witness, point_of
from fuzzytree.auditing.findings.records import Audit, AuditAnswer
from fuzzytree.auditing.findings.subject import AuditView
from fuzzytree.model import FuzzySystem
from fuzzytree.semantics.inference import infer


def check_on_grid(
    system: FuzzySystem, found: Audit, seen: AuditView, steps: int
) -> int:
    """Compare an audit of a system with its degrees on a grid.

    Args:
        system: The system; every rule that fires is activated.
        found: Its audit.
        seen: Its view.
        steps: How many values of each input the grid has.

    Returns:
        How many answers were compared.
    """
    assert seen.rules is not None
    grid = [*_grid(found, steps)]
    activations = [_strengths(system, seen, row) for row in grid]
    checked = 0
    for answer in found.answers:
        if any(
            seen.rule_names[number - 1].startswith("way ") for number in answer.rules
        ):
            continue  # a way is at most as strong as its rule
        if answer.code == "FT101" and isinstance(answer.state, Proved) and answer.rules:
            number = answer.rules[0]
            assert all(row[number - 1] < 1e-9 for row in activations), answer
            checked += 1
        if answer.code == "FT104" and answer.is_finding:
            weak, *strong = answer.rules
            for row in activations:
                assert row[strong[0] - 1] >= row[weak - 1] - 1e-9, answer
            checked += 1
        if answer.code == "FT201" and len(answer.rules) == 2:
            one, other = answer.rules
            best = max(min(row[one - 1], row[other - 1]) for row in activations)
            most = max(one.value for one in answer.measures)
            assert best <= most + 1e-9, answer
            checked += 1
        if answer.code == "FT301" and isinstance(answer.state, Proved):
            level = 0.1 if answer.measures else 0.0
            assert min(max(row) for row in activations) >= level - 1e-9, answer
            checked += 1
        if isinstance(answer.state, Witness | Bracket) and answer.state.point:
            checked += _claimed(system, seen, answer)
    return checked


def _claimed(system: FuzzySystem, seen: AuditView, answer: AuditAnswer) -> int:
    """Hold the claims at a point against the system's own degrees there."""
    state = answer.state
    assert isinstance(state, Witness | Bracket)
    row = {name: float(value) for name, value in point_of(state.point).items()}
    here = _strengths(system, seen, row)
    for claim in state.claims:
        ours = [here[number - 1] for number in claim.rules]
        level = float(Fraction(claim.level or 0))
        match claim.kind:
            case "beats":
                assert min(ours) > 0.0, answer
            case "reaches":
                assert min(ours) >= level - 1e-9, answer
            case "strength":
                assert abs(ours[0] - level) <= 1e-9, answer
            case "below":
                assert max(ours) <= level + 1e-9, answer
            case _:
                continue
    return 1


def _strengths(
    system: FuzzySystem, seen: AuditView, row: Mapping[str, float]
) -> list[float]:
    """Return the true strength of each rule of a view; a way has its rule's."""
    found = infer(system, row).strengths
    return [found[number - 1] for number in seen.numbers]


def _grid(found: Audit, steps: int) -> Iterator[dict[str, float]]:
    """Yield a grid of the domain."""
    sides = found.domain.sides
    lines = [
        [s.low + (s.high - s.low) * k / (steps - 1) for k in range(steps)]
        for s in sides
    ]
    for values in itertools.product(*lines):
        yield dict(zip((side.variable for side in sides), values, strict=True))
