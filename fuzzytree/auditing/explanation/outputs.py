"""Why a fuzzy system gives its numbers: the rules that fire, and slopes."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.explanation.records import Explanation, FiredRule
from fuzzytree.formats import conclusions_text, condition_sentence
from fuzzytree.model import FuzzySystem, SystemRule
from fuzzytree.semantics import infer

_STEP = 2.0**-16  # of an input's range, to both sides of the row


def explain_outputs(
    system: FuzzySystem, row: Mapping[str, float], domain: Domain, blank: Explanation
) -> Explanation:
    """Return which rules fire at a row, and how the outputs change near it."""
    names = [output.name for output in system.outputs]
    answer = infer(system, row)
    degrees = [*zip(system.rules, answer.strengths, strict=True)]
    ends = [{part.output for part in rule.then} for rule in system.rules]
    totals = {
        name: sum(d for (_, d), own in zip(degrees, ends, strict=True) if name in own)
        for name in names
    }
    fired = [
        FiredRule(
            number,
            _sentence(rule),
            degree,
            {name: degree / totals[name] for name in names if name in ends[number - 1]},
        )
        for number, (rule, degree) in enumerate(degrees, 1)
        if degree > 0.0
    ]
    slopes: dict[str, dict[str, float]] = {name: {} for name in names}
    for side in domain.sides if blank.status != "missing" else ():
        x, step = row[side.variable], (side.high - side.low) * _STEP
        low, high = max(x - step, min(side.low, x)), min(x + step, max(side.high, x))
        if low < high:
            at = [infer(system, {**row, side.variable: end}) for end in (low, high)]
            pairs = zip(names, at[0].outputs, at[1].outputs, strict=True)
            for name, first, last in pairs:
                slopes[name][side.variable] = (last - first) / (high - low)
    return replace(
        blank,
        outputs=dict(zip(names, answer.outputs, strict=True)),
        fired=tuple(sorted(fired, key=lambda rule: -rule.degree)),
        slopes=slopes,
    )


def _sentence(rule: SystemRule) -> str:
    ends = conclusions_text(rule.then)
    if rule.when is None:
        return f"ALWAYS {ends}"
    return f"IF {condition_sentence(rule.when)} THEN {ends}"
