"""Random systems that FLL can hold without a loss."""

from __future__ import annotations

from msgspec.structs import replace

from fuzzytree.model import (
    And,
    Condition,
    Defuzzifier,
    FuzzySystem,
    Hedge,
    Linear,
    Not,
    Or,
    Proposition,
    RuleBlock,
    Term,
    Trapezoid,
)
from fuzzytree.model.rulebase import LR, Band
from fuzzytree.testing import random_system

_KNOWN: tuple[Hedge, ...] = ("any", "not", "very", "somewhat", "extremely", "seldom")


def plain_system(seed: int, *, outputs: int = 2, rules: int = 8) -> FuzzySystem:
    """Return `random_system(seed)` without what FLL lacks.

    Combinations become columns, unknown hedges and NOTs of several conditions go,
    curves are sampled at the middle of pieces, and bands and LR sets are trapezoids.
    Conclusions lose `any` and `not`, by which the engines mean different things.
    """
    system = random_system(
        seed, outputs=outputs, rules=rules, has_odd_names=seed % 2 == 0
    )
    columns = len(system.variables)
    return replace(
        system,
        variables=tuple(
            replace(one, parts=(), terms=tuple(_label(x, columns) for x in one.terms))
            for one in system.variables
        ),
        outputs=tuple(
            replace(
                one,
                terms=tuple(_label(x, columns) for x in one.terms),
                defuzzifier=Defuzzifier(
                    one.defuzzifier.method, one.defuzzifier.samples
                ),
            )
            for one in system.outputs
        ),
        blocks=tuple(map(_block, system.blocks)),
    )


def _label(label: Term, columns: int) -> Term:
    match label.function:
        case Band() | LR():
            return replace(label, function=Trapezoid(-1.0, -0.5, 0.25, 2.0))
        case Linear(weights=weights):
            wide = (*weights, *(0.5,) * (columns - len(weights)))
            return replace(label, function=replace(label.function, weights=wide))
        case _:
            return label


def _block(block: RuleBlock) -> RuleBlock:
    rules = tuple(
        replace(
            rule,
            when=None if rule.when is None else _said(rule.when),
            then=tuple(
                replace(one, hedges=_known(one.hedges, ("any", "not")))
                for one in rule.then
            ),
        )
        for rule in block.rules
    )
    return replace(block, rules=rules)


def _known(
    hedges: tuple[Hedge, ...], without: tuple[Hedge, ...] = ()
) -> tuple[Hedge, ...]:
    return tuple(one for one in hedges if one in _KNOWN and one not in without)


def _said(condition: Condition) -> Condition:
    match condition:
        case Proposition(hedges=hedges):
            return replace(condition, hedges=_known(hedges))
        case Not(part=Proposition() as part):
            return Not(_said(part))
        case Not(part=part):
            return _said(part)
        case And(parts=parts):
            return And(tuple(map(_said, parts)))
        case Or(parts=parts):
            return Or(tuple(map(_said, parts)))
