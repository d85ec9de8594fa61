"""A model in other units: scaled by powers of two, or moved away from zero."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar, cast

import msgspec

from fuzzytree.errors import LossError
from fuzzytree.model import (
    Bell,
    Call,
    Curve,
    Document,
    Dtype,
    Expression,
    Formula,
    FuzzyTree,
    Linear,
    Name,
    Number,
    Part,
    Term,
    Value,
    Variable,
)

AnyModel = TypeVar("AnyModel", bound=Document)

Change = Callable[[str, float], float]
"""What becomes of a number in the unit of a variable, by the variable's name."""

NORMAL: Mapping[Dtype, tuple[int, int]] = {
    "float64": (-1021, 1022),
    "mixed": (-1021, 1022),
    "float32": (-125, 126),
}
"""Binary exponents of normal numbers, two doublings below the largest."""

_PLACES = frozenset(
    ("a", "b", "c", "center", "d", "end", "high", "inflection", "left", "low", "mean")
) | {"right", "start", "value", "values"}
_LENGTHS = frozenset(
    ("deviation", "left_deviation", "right_deviation", "spread", "width")
)


class UnitChange(msgspec.Struct, frozen=True):
    """How the numbers of a model change with the units of its variables.

    Attributes:
        place: A value of a variable: cuts, ends, means, ranges.
        length: A distance on it: spreads.
        part: A summand of a combination, by the combination's name; of a linear
            conclusion, and a slope, by no name.
        name: What a formula uses for a value in the unit of a variable.
    """

    place: Change
    length: Change
    part: Callable[[str, Part], Part]
    name: Callable[[str, Name], Expression] = lambda _, name: name


def scaled(model: AnyModel, exponents: Mapping[str, int]) -> AnyModel:
    """Return a model whose variables are measured in units 2**-k as large.

    Every stored number is multiplied by a power of two, which rounds nothing. So rows
    multiplied likewise must get the same answers, bit for bit: differences, their
    quotients and the products `weight * (input - centre)` are the same numbers times
    a power of two.

    Args:
        model: Any model.
        exponents: k by the name of a variable; 0 for those not named. A combination
            keeps its unit unless it is named: its weights take up the change.

    Raises:
        LossError: If a number would leave the normal range of doubles.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1)
        >>> back = {name: -3 for name in tree.inputs}
        >>> scaled(scaled(tree, {name: 3 for name in tree.inputs}), back) == tree
        True
    """

    def change(name: str, value: float) -> float:
        return exactly_scaled(value, exponents.get(name, 0), name)

    def part(name: str, one: Part) -> Part:
        outer, inner = exponents.get(name, 0), exponents.get(one.input, 0)
        weight = exactly_scaled(one.weight, outer - inner, name or one.input)
        return Part(one.input, weight, change(one.input, one.centre))

    def in_formula(variable: str, name: Name) -> Expression:
        k = exponents.get(variable, 0)
        return Call("*", (Number(math.ldexp(1.0, -k)), name)) if k else name

    return in_units(model, UnitChange(change, change, part, in_formula))


def exactly_scaled(value: float, exponent: int, name: str) -> float:
    """Return `value * 2**exponent`, which must be exact.

    Raises:
        LossError: If it overflows, or is not a normal number.
    """
    if value == 0.0 or exponent == 0:
        return value
    low, high = NORMAL["float64"]
    if not low <= math.frexp(value)[1] + exponent <= high + 2:
        raise LossError(
            f"cannot scale {name!r} by 2**{exponent}: {value!r} would leave the "
            "normal range of doubles"
        )
    return math.ldexp(value, exponent)


def moved(model: AnyModel, offsets: Mapping[str, float]) -> AnyModel:
    """Return a model whose inputs have moved away from zero.

    Every place is added to its input's offset and rounded once; spreads stay. It is a
    model of its own, close to the original as far as doubles allow at that distance.

    Inputs that `offsets` do not name stay.

    Raises:
        InvalidModelError: If places that differ become one.
    """

    def place(name: str, value: float) -> float:
        return value + offsets.get(name, 0.0)

    def part(_: str, one: Part) -> Part:
        return Part(one.input, one.weight, place(one.input, one.centre))

    def in_formula(variable: str, name: Name) -> Expression:
        offset = offsets.get(variable, 0.0)
        return Call("-", (name, Number(offset))) if offset else name

    return in_units(model, UnitChange(place, lambda _, v: v, part, in_formula))


def in_units(model: AnyModel, units: UnitChange) -> AnyModel:
    """Return a model with every number in the unit of a variable changed."""

    def terms(name: str, old: tuple[Term, ...]) -> tuple[Term, ...]:
        curves = [_curve(name, term.function, model, units) for term in old]
        pairs = zip(old, curves, strict=True)
        return tuple(msgspec.structs.replace(t, function=curve) for t, curve in pairs)

    def place(name: str, value: float | None) -> float | None:
        return None if value is None else units.place(name, value)

    def variable(one: Variable) -> Variable:
        name = one.name
        is_whole = one.is_whole and all(
            units.place(name, value).is_integer() for value in (0.0, 1.0)
        )
        return msgspec.structs.replace(
            one,
            terms=terms(name, one.terms),
            low=place(name, one.low),
            high=place(name, one.high),
            parts=tuple(units.part(name, part) for part in one.parts),
            missing=place(name, one.missing),
            is_whole=is_whole,
        )

    changes: dict[str, object] = {"variables": tuple(map(variable, model.variables))}
    for field in ("outputs", "sets"):
        groups: tuple[Any, ...] = getattr(model, field)
        if groups:  # outputs keep their unit, and formulas use inputs
            changes[field] = tuple(
                msgspec.structs.replace(
                    one,
                    terms=terms(getattr(one, "variable", "") or one.name, one.terms),
                )
                for one in groups
            )
    if isinstance(model, FuzzyTree):
        changes["nodes"] = tuple(
            msgspec.structs.replace(
                node, cuts=tuple(units.place(node.variable, cut) for cut in node.cuts)
            )
            for node in model.nodes
        )
    return msgspec.structs.replace(model, **changes)


def _curve(name: str, curve: Any, model: Document, units: UnitChange) -> Any:
    """Return a function, or a part of one, by the names of its fields."""
    if isinstance(curve, Formula):
        return Formula(_expression(name, curve.expression, units))
    if isinstance(curve, Linear):
        pairs = zip(model.inputs, curve.weights, strict=True)
        parts = [units.part("", Part(one, weight, 0.0)) for one, weight in pairs]
        offset = curve.offset - sum(part.weight * part.centre for part in parts)
        return Linear(tuple(part.weight for part in parts), offset)
    changes: dict[str, object] = {}
    for field in curve.__struct_fields__:
        old = getattr(curve, field)
        if isinstance(old, Value):
            changes[field] = _curve(name, old, model, units)
        elif field == "values":
            changes[field] = tuple(units.place(name, value) for value in old)
        elif field in _PLACES and old is not None:
            changes[field] = units.place(name, old)
        elif field in _LENGTHS:
            changes[field] = units.length(name, old)
        elif field == "slope" and not isinstance(curve, Bell):
            changes[field] = units.part("", Part(name, old, 0.0)).weight
    return msgspec.structs.replace(curve, **changes)


def _expression(variable: str, formula: Expression, units: UnitChange) -> Expression:
    match formula:
        case Name(name=name):
            return units.name(variable if name == "x" else name, formula)
        case Call(function=function, arguments=arguments):
            new = (_expression(variable, one, units) for one in arguments)
            return Call(function, tuple(new))
        case Number():
            return formula


def numbers_in_units(model: Document) -> Iterator[tuple[str, int, float]]:
    """Yield each number that has a unit: its variable, its power of it, its value.

    The power is 1 for places and lengths, and -1 for weights, which divide by it. The
    lengths between neighbouring places of a function are among them, for runtimes
    divide by those.
    """
    numbers: list[tuple[str, int, float]] = []

    def keep(name: str, value: float) -> float:
        numbers.append((name, 1, value))
        return value

    def part(_: str, one: Part) -> Part:
        numbers.append((one.input, -1, one.weight))
        keep(one.input, one.centre)
        return one

    in_units(model, UnitChange(keep, keep, part))
    yield from numbers
    groups = [(variable.name, variable.terms) for variable in model.variables]
    groups += [(group.variable, group.terms) for group in model.sets]
    for name, terms in groups:
        for term in terms:
            places = sorted(_places(term.function))
            yield from ((name, 1, b - a) for a, b in itertools.pairwise(places))


def _places(curve: Curve) -> Iterator[float]:
    for field in _PLACES.intersection(curve.__struct_fields__):
        value = getattr(curve, field)
        if field == "values":
            yield from cast("tuple[float, ...]", value)
        elif isinstance(value, float):
            yield value


def exponent_range(model: Document, dtype: Dtype) -> tuple[int, int]:
    """Return by which powers of two all inputs can be scaled: lowest and highest.

    Within the range every number with the unit of an input, multiplied, is a normal
    number of the type, so that nothing but the exponents changes.

    Example:
        >>> from fuzzytree.model.rulebase import Band, Proposition, Rule, RuleBase
        >>> step = Term("low", Band(high=1.0))
        >>> rule = Rule((Proposition("x", ("low",)),), "a")
        >>> rules = RuleBase("one", ("a",), (Variable("x", (step,)),), (rule,))
        >>> exponent_range(rules, "float64")
        (-1022, 1021)
    """
    inputs = set(model.inputs)
    low, high = -2000, 2000
    least, most = NORMAL[dtype]
    for name, power, value in numbers_in_units(model):
        if name not in inputs or value == 0.0 or not math.isfinite(value):
            continue
        exponent = math.frexp(value)[1]
        if power > 0:
            low, high = max(low, least - exponent), min(high, most - exponent)
        else:
            low, high = max(low, exponent - most), min(high, exponent - least)
    return low, high
