"""The data check list of IEC 61131-7: what a controller must be able to do for a model.

The standard requires each vendor to state it, and divides models into three classes:
*Basic*, *Extension* and *Open*.
"""

from __future__ import annotations

from collections.abc import Iterator

from fuzzytree.exporters.fcl_rules import uses
from fuzzytree.exporters.fll_text import has_not
from fuzzytree.model import (
    And,
    Condition,
    FuzzySystem,
    Or,
    Points,
    RuleBase,
    SystemTerm,
    joints,
    questions,
)
from fuzzytree.semantics import as_system

_MOST_BASIC, _MOST_EXTENDED = 3, 4  # points of a term


def check_list(document: RuleBase | FuzzySystem) -> str:
    """Return the data check list of a model, a fact to a line.

    A rule base is described as the system with a score for each rule that is written
    for it.

    Example:
        >>> from fuzzytree.semantics.samples import all_samples
        >>> system = all_samples()["Sugeno, numbers"]
        >>> print(check_list(system).splitlines()[0])
        data check list (IEC 61131-7)
    """
    system = document
    if isinstance(system, RuleBase):
        system = as_system(system, "rule", always="term")
    return "\n".join(_lines(system)) + "\n"


def _lines(system: FuzzySystem) -> Iterator[str]:
    variables = system.variables
    labels = [label for one in variables for label in one.labels]
    rules = system.rules
    yield "data check list (IEC 61131-7)"
    yield f"inputs: {len(system.inputs)}"
    yield f"outputs: {len(system.outputs)}"
    yield f"terms of an input: {_span(len(one.labels) for one in system.inputs)}"
    yield f"terms of an output: {_span(len(one.labels) for one in system.outputs)}"
    points = [len(one.curve.values) for one in labels if isinstance(one.curve, Points)]
    yield f"points of a term: {_span(points)}"
    others = sorted({type(one.curve).__name__ for one in labels} - {"Points"})
    yield f"other terms: {', '.join(others) or 'none'}"
    yield f"rule blocks: {len(system.blocks)}"
    yield f"rules: {len(rules)}"
    conditions = (len([*questions(rule.when)]) for rule in rules)
    yield f"conditions of a rule: {_span(conditions)}"
    yield f"conclusions of a rule: {_span(len(rule.then) for rule in rules)}"
    yield f"weighted rules: {sum(rule.weight != 1.0 for rule in rules)}"
    yield f"operators: {', '.join(_operators(system)) or 'none'}"
    methods = sorted({one.defuzzifier.method for one in system.outputs})
    yield f"methods: {', '.join(methods)}"
    names = [one.name for one in (*variables, *labels)]
    yield f"characters of a name: {_span(map(len, names))}"
    beyond_basic = list(_beyond_basic(system, labels))
    beyond_extension = list(_beyond_extension(system, labels))
    if beyond_extension:
        yield f"class: Open, for {_some(beyond_extension)}"
    elif beyond_basic:
        yield f"class: Extension, for {_some(beyond_basic)}"
    else:
        yield "class: Basic"


def _some(reasons: list[str]) -> str:
    return "; ".join(reasons[:3]) + ("; ..." if len(reasons) > 3 else "")


def _span(counts: Iterator[int] | list[int] | map[int]) -> str:
    result = list(counts)
    if not result:
        return "none"
    low, high = min(result), max(result)
    return str(low) if low == high else f"{low} to {high}"


def _operators(system: FuzzySystem) -> Iterator[str]:
    """Yield the operators that rules use, each once."""
    result: list[str] = []
    is_curved = any(not output.defuzzifier.is_weighted for output in system.outputs)
    for block in system.blocks:
        if any(uses(rule.when, And) for rule in block.rules):
            result.append(f"AND {block.conjunction}")
        if any(uses(rule.when, Or) for rule in block.rules):
            result.append(f"OR {block.disjunction}")
        if is_curved:
            result.append(f"ACT {block.implication}")
    result += [
        f"ACCU {output.aggregation}"
        for output in system.outputs
        if output.aggregation is not None
    ]
    yield from dict.fromkeys(result)


def _beyond_basic(system: FuzzySystem, labels: list[SystemTerm]) -> Iterator[str]:
    if any(_most_points(label) > _MOST_BASIC for label in labels):
        yield f"terms of more than {_MOST_BASIC} points"
    if any(not output.defuzzifier.is_weighted for output in system.outputs):
        yield "outputs with curves"
    for block in system.blocks:
        if block.conjunction not in (None, "minimum"):
            yield f"AND {block.conjunction}"
    if any(_has_or(rule.when) for rule in system.rules):
        yield "OR or NOT"
    if any(len(rule.then) > 1 for rule in system.rules):
        yield "several conclusions of a rule"
    if any(rule.weight != 1.0 for rule in system.rules):
        yield "weighted rules"
    if any(output.aggregation != "maximum" for output in system.outputs):
        yield "numbers that are summed, and not joined by ACCU maximum"


def _beyond_extension(system: FuzzySystem, labels: list[SystemTerm]) -> Iterator[str]:
    if any(_most_points(label) > _MOST_EXTENDED for label in labels):
        yield f"terms of more than {_MOST_EXTENDED} points"
    degrees = {
        degree
        for label in labels
        if isinstance(label.curve, Points)
        for degree in label.curve.degrees
    }
    if degrees - {0.0, 1.0}:
        yield "points of degrees between 0 and 1"
    kinds = {type(label.curve).__name__ for label in labels} - {"Points", "Singleton"}
    if kinds:
        yield f"terms that are no points ({', '.join(sorted(kinds))})"
    hedges = {
        hedge
        for rule in system.rules
        for question in questions(rule.when)
        for hedge in question.hedges
    }
    if hedges - {"not"}:
        yield "hedges"
    if any(one.parts for one in system.inputs):
        yield "inputs that are combined"
    if any(output.defuzzifier.method == "weighted sum" for output in system.outputs):
        yield "weighted sums"


def _most_points(label: SystemTerm) -> int:
    return len(label.curve.values) if isinstance(label.curve, Points) else 0


def _has_or(condition: Condition | None) -> bool:
    return Or in joints(condition) or has_not(condition)
