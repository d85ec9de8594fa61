"""Random systems without what FCL has no place for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import get_args

from msgspec.structs import replace

from fuzzytree.exporters.fcl_dialects import Dialect
from fuzzytree.formats.fcl.fcl_dialects import DEFUZZIFIERS
from fuzzytree.model import (
    Activation,
    And,
    Arc,
    Bell,
    Concave,
    Condition,
    Cosine,
    Defuzzifier,
    FuzzySystem,
    Gaussian,
    Not,
    Or,
    Proposition,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    Singleton,
    SystemCurve,
    SystemOutput,
    Term,
    Trapezoid,
    TwoGaussians,
    questions,
)
from fuzzytree.model.rulebase import Points

PLAIN = Trapezoid(-1.0, 0.0, 1.0, 2.0)


def tamed(system: FuzzySystem, dialect: Dialect) -> FuzzySystem:
    """Return a system without what FCL has no place for, whatever the dialect."""
    inputs = tuple(
        replace(one, clips=False, terms=_curved(one.terms, dialect))
        for one in system.variables
        if not one.parts
    )
    known = {one.name for one in inputs} | {one.name for one in system.outputs}
    outputs = tuple(_tamed_output(one, dialect) for one in system.outputs)
    blocks = tuple(
        replace(
            block,
            activation=Activation(),
            rules=tuple(
                replace(
                    rule,
                    when=None if rule.when is None else _spoken(rule.when),
                    then=tuple(replace(one, hedges=()) for one in rule.then),
                )
                for rule in block.rules
                if {one.variable for one in questions(rule.when)} <= known
            ),
        )
        for block in system.blocks
    )
    return FuzzySystem(system.name, inputs, outputs, blocks)


CURVES: Mapping[Dialect, set[type]] = {
    "fuzzylite": {*get_args(SystemCurve)} - {Arc, SemiEllipse},
    "jfuzzylogic": {
        *(Trapezoid, Gaussian, TwoGaussians, Bell, Sigmoid, Cosine),
        *(SigmoidDifference, Singleton),
    },
}


def _curved(labels: tuple[Term, ...], dialect: Dialect) -> tuple[Term, ...]:
    kept = {Points, *CURVES.get(dialect, ())}
    return tuple(
        one if type(one.function) in kept else replace(one, function=PLAIN)
        for one in labels
    )


def _tamed_output(output: SystemOutput, dialect: Dialect) -> SystemOutput:
    how = DEFUZZIFIERS[dialect]
    if output.defuzzifier.is_weighted:
        how = Defuzzifier("weighted average")
    is_odd = {type(one.function) for one in output.terms} & {SCurve, Concave, Arc}
    labels = output.terms
    if how.is_weighted and is_odd:
        labels = tuple(replace(one, function=Singleton(2.5)) for one in labels)
    if not how.is_weighted:
        labels = _curved(labels, dialect)
    aggregation = None if how.is_weighted else output.aggregation
    return replace(
        output,
        terms=labels,
        defuzzifier=how,
        aggregation=aggregation,
        default=0.5,
        clips=False,
    )


def _spoken(condition: Condition) -> Condition:
    """Return a condition whose hedges fuzzylite knows."""
    match condition:
        case Proposition(hedges=hedges):
            kept = tuple(one for one in hedges if one in SPOKEN)
            return replace(condition, hedges=kept)
        case And(parts=parts):
            return And(tuple(map(_spoken, parts)))
        case Or(parts=parts):
            return Or(tuple(map(_spoken, parts)))
        case Not(part=part):
            return Not(_spoken(part))


SPOKEN = ("any", "not", "very", "somewhat", "extremely", "seldom")
