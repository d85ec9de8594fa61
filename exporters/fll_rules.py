"""Rules for FLL: conditions and conclusions as words."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType

from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.formats.fll.fll_rules import HEDGES
from fuzzytree.model.contracts import Loss
from fuzzytree.model.system import (
    And,
    Condition,
    Hedge,
    Is,
    Not,
    Or,
    RuleBlock,
    SystemRule,
    joints,
)

_WORDS: Mapping[Hedge, str] = MappingProxyType(
    {**{hedge: word for word, hedge in HEDGES.items()}, "very very": "very very"}
)

Speak = Callable[[str, str | None], tuple[str, str]]
"""Gives the words for a variable and one of its labels."""


def speakable(block: RuleBlock) -> RuleBlock:
    """Return a block whose conditions have no NOT but the hedge.

    A NOT of an AND is the OR of NOTs, exactly, where AND is the minimum and OR the
    maximum: `1 - min(a, b)` and `max(1 - a, 1 - b)` are the same double.

    Raises:
        LossError: If a rule has a NOT that other norms keep where it is.
    """
    if not any(_has_joined_not(rule.when) for rule in block.rules):
        return block
    kinds = {kind for rule in block.rules for kind in joints(rule.when)}
    conjunction = block.conjunction if And in kinds else "minimum"
    disjunction = block.disjunction if Or in kinds else "maximum"
    is_exact = (conjunction, disjunction) == ("minimum", "maximum")
    rules: list[SystemRule] = []
    for number, rule in enumerate(block.rules, 1):
        if _has_joined_not(rule.when) and rule.when is not None:
            if not is_exact:
                raise LossError(
                    f"rule {number} has a NOT of several conditions, which FLL can "
                    "only say for the norms minimum and maximum"
                )
            rule = replace(rule, when=_pushed(rule.when, 0))
        rules.append(rule)
    return replace(
        block, rules=tuple(rules), conjunction=conjunction, disjunction=disjunction
    )


def has_not(condition: Condition | None, *, of: type = object) -> bool:
    """Return whether a condition has a NOT that is no hedge, of a kind of condition."""
    match condition:
        case And(parts=parts) | Or(parts=parts):
            return any(has_not(part, of=of) for part in parts)
        case Not(part=part):
            return isinstance(part, of) or has_not(part, of=of)
        case _:
            return False


def _has_joined_not(condition: Condition | None) -> bool:
    return any(has_not(condition, of=kind) for kind in (And, Or, Not))


def _pushed(condition: Condition, nots: int) -> Condition:
    """Return a condition behind so many NOTs, with the NOTs at what it asks."""
    match condition:
        case Is(hedges=hedges):
            return replace(condition, hedges=(*("not",) * nots, *hedges))
        case Not(part=part):
            return _pushed(part, nots + 1)
        case And(parts=parts):
            kind = Or if nots % 2 else And
            return kind(tuple(_pushed(part, nots) for part in parts))
        case Or(parts=parts):
            kind = And if nots % 2 else Or
            return kind(tuple(_pushed(part, nots) for part in parts))


def rule_text(rule: SystemRule, speak: Speak, always: str) -> str:
    """Return a rule as fuzzylite reads it.

    Args:
        rule: The rule; of a `speakable` block.
        speak: The words for variables and labels.
        always: What a rule without a condition says.
    """
    when = always if rule.when is None else _condition_text(rule.when, speak, 0)
    then = " and ".join(
        _statement(one.output, one.label, one.hedges, speak) for one in rule.then
    )
    weight = "" if rule.weight == 1.0 else f" with {float(rule.weight)!r}"
    return f"if {when} then {then}{weight}"


def _condition_text(condition: Condition, speak: Speak, level: int) -> str:
    """Return a condition; at level 1 an OR needs parentheses, at level 2 an AND too."""
    match condition:
        case Is(variable=variable, label=label, hedges=hedges):
            if "any" in hedges:  # whatever stands behind it makes no difference
                label, hedges = None, hedges[: hedges.index("any") + 1]
            return _statement(variable, label, hedges, speak)
        case Not(part=Is() as part):
            return _condition_text(_pushed(part, 1), speak, level)
        case Not():
            raise TypeError("a NOT of several conditions in a block that has been said")
        case And(parts=parts):
            text = " and ".join(_condition_text(part, speak, 2) for part in parts)
            return f"({text})" if level > 1 and len(parts) > 1 else text
        case Or(parts=parts):
            text = " or ".join(
                _condition_text(part, speak, 2 if isinstance(part, Or) else 1)
                for part in parts
            )
            return f"({text})" if level > 0 and len(parts) > 1 else text


def _statement(
    variable: str, label: str | None, hedges: Sequence[Hedge], speak: Speak
) -> str:
    name, term = speak(variable, label)
    words = [_WORDS[hedge] for hedge in hedges if hedge in _WORDS]
    return " ".join([name, "is", *words, *([term] if label is not None else [])])


def hedge_losses(rules: Sequence[SystemRule]) -> Iterator[Loss]:
    """Yield the hedges that FLL does not have, rule by rule."""
    for number, rule in enumerate(rules, 1):
        used = [hedge for one in rule.then for hedge in one.hedges]
        used += _hedges(rule.when)
        unknown = sorted({hedge for hedge in used if hedge not in _WORDS})
        if unknown:
            names = ", ".join(map(repr, unknown))
            yield Loss(f"rule {number}", f"FLL has no {names}: left out")


def _hedges(condition: Condition | None) -> Iterator[Hedge]:
    match condition:
        case Is(hedges=hedges):
            yield from hedges
        case And(parts=parts) | Or(parts=parts):
            for part in parts:
                yield from _hedges(part)
        case Not(part=part):
            yield from _hedges(part)
        case None:
            return
