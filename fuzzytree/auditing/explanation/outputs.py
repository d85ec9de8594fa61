"""Why a fuzzy system gives its numbers: the rules that fire, and slopes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.explanation.records import (
    Explanation,
    FiredRule,
    Share,
    Slope,
)
from fuzzytree.formats import conclusions_text, condition_sentence
from fuzzytree.model import FuzzySystem, SystemRule
from fuzzytree.semantics import Status, infer

_STEP = 2.0**-16  # of an input's range, to both sides of the row


def explain_outputs(
    system: FuzzySystem, row: Mapping[str, float], domain: Domain, blank: Explanation
) -> Explanation:
    """Return which rules fire at a row, and how the outputs change near it."""
    answer = infer(system, row)
    names = [output.name for output in system.outputs]
    totals = dict.fromkeys(names, 0.0)
    for rule, degree in zip(system.rules, answer.strengths, strict=True):
        for output in {conclusion.output for conclusion in rule.then}:
            totals[output] += degree
    fired = [
        FiredRule(
            number,
            _sentence(rule),
            degree,
            tuple(
                Share(output, degree / totals[output])
                for output in dict.fromkeys(part.output for part in rule.then)
            ),
        )
        for number, (rule, degree) in enumerate(
            zip(system.rules, answer.strengths, strict=True), 1
        )
        if degree > 0.0
    ]
    is_missing = answer.status == Status.MISSING
    return replace(
        blank,
        status=Status(answer.status).name.lower(),
        outputs=tuple(map(Share, names, answer.outputs)),
        fired=tuple(sorted(fired, key=lambda rule: -rule.degree)),
        slopes=() if is_missing else tuple(_slopes(system, row, domain)),
    )


def _sentence(rule: SystemRule) -> str:
    ends = conclusions_text(rule.then)
    if rule.when is None:
        return f"ALWAYS {ends}"
    return f"IF {condition_sentence(rule.when)} THEN {ends}"


def _slopes(
    system: FuzzySystem, row: Mapping[str, float], domain: Domain
) -> Iterator[Slope]:
    """Yield the slope of each output in each input, output by output."""
    slopes: dict[str, tuple[float, ...]] = {}
    for side in domain.sides:
        name, x = side.variable, row.get(side.variable)
        if x is None:
            continue
        step = (side.high - side.low) * _STEP
        low, high = max(x - step, min(side.low, x)), min(x + step, max(side.high, x))
        if not low < high:
            continue
        ends = [infer(system, {**row, name: end}).outputs for end in (low, high)]
        slopes[name] = tuple((b - a) / (high - low) for a, b in zip(*ends, strict=True))
    for place, output in enumerate(system.outputs):
        for name, numbers in slopes.items():
            yield Slope(output.name, name, numbers[place])
