"""Rules and terms for FLL: conditions, conclusions and curves as words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType

from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.formats import (
    FLL_HEDGES,
    fuzzylite_text_of,
    parse,
    term_in_words,
)
from fuzzytree.model import (
    LR,
    And,
    Band,
    Call,
    Condition,
    Expression,
    Hedge,
    Loss,
    Name,
    Not,
    Number,
    Or,
    Points,
    Proposition,
    RuleBlock,
    SystemOutput,
    SystemRule,
    Term,
    condition_text,
    conditions_in,
    curves,
    joints,
    questions,
)
from fuzzytree.semantics import value_at

_WORDS: Mapping[Hedge, str] = MappingProxyType(
    {**{hedge: word for word, hedge in FLL_HEDGES.items()}, "very very": "very very"}
)

WordsOf = Callable[[str, str | None], tuple[str, str]]
"""Gives the words for a variable and one of its labels."""


def speakable(block: RuleBlock) -> RuleBlock:
    """Return a block whose conditions have no NOT but the hedge.

    A NOT of an AND is the OR of NOTs, exactly, where AND is the minimum and OR the
    maximum: `1 - min(a, b)` and `max(1 - a, 1 - b)` are the same double.

    Raises:
        LossError: If a rule has a NOT that other norms keep where it is.
    """
    joined = (And, Or, Not)
    if not any(has_not(rule.when, of=joined) for rule in block.rules):
        return block
    kinds = {kind for rule in block.rules for kind in joints(rule.when)}
    conjunction = block.conjunction if And in kinds else "minimum"
    disjunction = block.disjunction if Or in kinds else "maximum"
    is_exact = (conjunction, disjunction) == ("minimum", "maximum")
    rules: list[SystemRule] = []
    for number, rule in enumerate(block.rules, 1):
        if rule.when is not None and has_not(rule.when, of=joined):
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


def has_not(
    condition: Condition | None, *, of: type | tuple[type, ...] = object
) -> bool:
    """Return whether a condition has a NOT that is no hedge, of a kind of condition."""
    return any(
        isinstance(one, Not) and isinstance(one.part, of)
        for one in conditions_in(condition)
    )


def _pushed(condition: Condition, nots: int) -> Condition:
    """Return a condition behind some NOTs, which move to its propositions."""
    match condition:
        case Proposition(hedges=hedges):
            return replace(condition, hedges=(*("not",) * nots, *hedges))
        case Not(part=part):
            return _pushed(part, nots + 1)
        case And(parts=parts):
            kind = Or if nots % 2 else And
            return kind(tuple(_pushed(part, nots) for part in parts))
        case Or(parts=parts):
            kind = And if nots % 2 else Or
            return kind(tuple(_pushed(part, nots) for part in parts))


def rule_text(rule: SystemRule, words_of: WordsOf, always: str) -> str:
    """Return a rule as fuzzylite reads it."""

    def said(one: Proposition) -> str:
        label, hedges = one.term, one.hedges
        if "any" in hedges:  # whatever stands behind it makes no difference
            label, hedges = None, hedges[: hedges.index("any") + 1]
        return _statement(one.variable, label, hedges, words_of)

    condition = rule.when and _pushed(rule.when, 0)
    when = condition_text(condition, said) if condition else always
    then = " and ".join(
        _statement(one.output, one.term, one.hedges, words_of) for one in rule.then
    )
    weight = "" if rule.weight == 1.0 else f" with {float(rule.weight)!r}"
    return f"if {when} then {then}{weight}"


def _statement(
    variable: str, label: str | None, hedges: Sequence[Hedge], words_of: WordsOf
) -> str:
    name, term = words_of(variable, label)
    words = [_WORDS[hedge] for hedge in hedges if hedge in _WORDS]
    return " ".join([name, "is", *words, *([term] if label is not None else [])])


def hedge_losses(rules: Sequence[SystemRule]) -> Iterator[Loss]:
    """Yield the hedges that FLL does not have, rule by rule."""
    for number, rule in enumerate(rules, 1):
        used = [hedge for one in rule.then for hedge in one.hedges]
        used += [hedge for one in questions(rule.when) for hedge in one.hedges]
        unknown = sorted({hedge for hedge in used if hedge not in _WORDS})
        if unknown:
            names = ", ".join(map(repr, unknown))
            yield Loss(f"rule {number}", f"FLL has no {names}: left out")


def degree_text(label: Term, names: Mapping[str, str]) -> str | None:
    """Return the class and numbers of a term; None if FLL has no such term."""
    match label.function:
        case curves.Formula(expression=expression):
            if label.height != 1.0:
                expression = Call("*", (Number(label.height), expression))
            return f"Function {fuzzylite_text_of(_renamed(expression, names))}"
        case curves.Linear() | Band() | LR():
            return None
        case Points():
            parts = _points(label.function)
        case curve:
            parts = term_in_words(curve)
    if label.height != 1.0:
        parts = (*parts, label.height)
    kind, *numbers = parts
    return " ".join([str(kind), *(number(float(one)) for one in numbers)])


def weighted_type(output: SystemOutput) -> str:
    """Return how a weighted output takes its terms: all of them in one way.

    `Tsukamoto` if it inverts each of them at a degree, else `TakagiSugeno`.
    """
    functions = [label.function for label in output.terms]
    is_inverse = [value_at(one, 0.5) is not None for one in functions]
    return "Tsukamoto" if is_inverse and all(is_inverse) else "TakagiSugeno"


def number_text(label: Term, kind: str, names: Mapping[str, str]) -> str | None:
    """Return the class and numbers of a term of a weighted output, or None."""
    match label.function:
        case curves.Singleton(value=value):
            return f"Constant {number(value)}"
        case curves.Linear(weights=weights, offset=offset):
            return " ".join(["Linear", *map(number, (*weights, offset))])
        case curves.Formula(expression=expression):
            return f"Function {fuzzylite_text_of(_renamed(expression, names))}"
        case curve if kind == "TakagiSugeno" and value_at(curve, 0.5) is not None:
            return f"Function {fuzzylite_text_of(_inverse(label))}"
        case _:
            return degree_text(label, names)


def number(value: float) -> str:
    """Return a number in the fewest digits that read back as the same double."""
    return repr(float(value))


def _points(points: Points) -> tuple[str | float, ...]:
    pairs = list(_pairs(points))
    values, degrees = zip(*pairs, strict=True)
    if degrees == (0.0, 1.0):
        return "Ramp", *values
    if degrees == (1.0, 0.0):
        return "Ramp", *reversed(values)
    return "Discrete", *(number for pair in pairs for number in pair)


def _pairs(points: Points) -> Iterator[tuple[float, float]]:
    """Yield values and degrees; the second point of a step stands one double higher.

    So fuzzylite 6 and pyfuzzylite, which take the degrees at the step itself from
    different sides, and the formula of points agree at every double.
    """
    last: tuple[float, float] | None = None
    pairs = [*zip(points.values, points.degrees, strict=True)]
    for place, (value, degree) in enumerate(pairs):
        if last is not None and value == last[0]:
            value = math.nextafter(value, math.inf)
            is_hidden = place + 1 < len(pairs) and pairs[place + 1][0] == value
            if degree == last[1] or is_hidden or math.isinf(value):
                continue
        last = (pairs[place][0], degree)
        yield value, degree


def _renamed(expression: Expression, names: Mapping[str, str]) -> Expression:
    match expression:
        case Name(name=name):
            return Name(names.get(name, name))
        case Call(function=function, arguments=arguments):
            return Call(function, tuple(_renamed(one, names) for one in arguments))
        case Number():
            return expression


def _inverse(label: Term) -> Expression:
    """Return where a monotone label has the degree `x`, as a formula."""
    d = "x" if label.height == 1.0 else f"(x / {label.height!r})"
    match label.function:
        case Points(values=(first, last), degrees=(low, _)):
            start, end = (first, last) if low == 0.0 else (last, first)
            return parse(f"{start!r} + {end - start!r} * {d}")
        case curves.Sigmoid(inflection=inflection, slope=slope):
            return parse(f"{inflection!r} - log(1 / {d} - 1) / {slope!r}")
        case curves.SCurve(start=start, end=end):
            low_part = f"{start!r} + {end - start!r} * sqrt(0.5 * {d})"
            high_part = f"{end!r} - {end - start!r} * sqrt(0.5 * (1 - {d}))"
            return parse(f"le({d}, 0.5) * ({low_part}) + gt({d}, 0.5) * ({high_part})")
        case curves.Concave(inflection=inflection, end=end):
            return parse(f"{end!r} - {end - inflection!r} * (1 / {d} - 1)")
        case curves.Arc(start=start, end=end):
            root = f"sqrt((1 - {d}) * (1 + {d}))"
            return parse(f"{end!r} - {end - start!r} * {root}")
        case curve:
            raise TypeError(f"{type(curve).__name__} is not monotone")
