"""A model in other units: scaled by powers of two, or moved away from zero."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeVar, cast

import msgspec

from fuzzytree.errors import LossError
from fuzzytree.model import (
    Bell,
    Call,
    Document,
    Dtype,
    Expression,
    Formula,
    Linear,
    Name,
    Node,
    Number,
    Part,
    Sets,
    SystemOutput,
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
) | {"missing", "right", "start", "value"}
_LENGTHS = frozenset(
    ("deviation", "left_deviation", "right_deviation", "spread", "width")
)


class UnitChange(msgspec.Struct, frozen=True):
    """How the numbers of a model change with the units of its variables."""

    place: Change  # of a value of a variable: cuts, ends, means, ranges
    length: Change  # of a distance on it: spreads
    part: Callable[[str, Part], Part]
    """Of a summand, by its combination; of a linear conclusion or slope, by no name."""
    name: Callable[[str, Name], Expression] = lambda _, name: name
    """What a formula uses for a value in the unit of a variable."""


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
    return cast("AnyModel", _in_units(model, "", model.inputs, units))


def _in_units(old: Any, name: str, inputs: Sequence[str], units: UnitChange) -> Any:
    """Return a part of a model, of the variable of a name, by the names of fields."""
    match old:
        case tuple():
            return tuple(_in_units(one, name, inputs, units) for one in old)
        case Part():
            return units.part(name, old)
        case Formula(expression=expression):
            return Formula(_expression(name, expression, units))
        case Linear(weights=weights, offset=offset):
            pairs = zip(inputs, weights, strict=True)
            parts = [units.part("", Part(one, weight, 0.0)) for one, weight in pairs]
            offset -= sum(part.weight * part.centre for part in parts)
            return Linear(tuple(part.weight for part in parts), offset)
        case Variable() | SystemOutput():
            name = old.name
        case Node() | Sets():
            name = old.variable
        case Value():
            pass
        case _:
            return old
    changes: dict[str, object] = {}
    for field in old.__struct_fields__:
        value = getattr(old, field)
        if field in ("cuts", "values"):
            changes[field] = tuple(units.place(name, one) for one in value)
        elif field in _PLACES and isinstance(value, float):
            changes[field] = units.place(name, value)
        elif field in _LENGTHS:
            changes[field] = units.length(name, value)
        elif field == "slope" and not isinstance(old, Bell):
            changes[field] = units.part("", Part(name, value, 0.0)).weight
        elif field == "is_whole":
            ends = (units.place(name, value) for value in (0.0, 1.0))
            changes[field] = value and all(end.is_integer() for end in ends)
        else:
            changes[field] = _in_units(value, name, inputs, units)
    return msgspec.structs.replace(old, **changes)


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
    places: list[float] = []

    def length(name: str, value: float) -> float:
        numbers.append((name, 1, value))
        return value

    def place(name: str, value: float) -> float:
        places.append(value)
        return length(name, value)

    def part(_: str, one: Part) -> Part:
        numbers.append((one.input, -1, one.weight))
        length(one.input, one.centre)
        return one

    units = UnitChange(place, length, part)
    in_units(model, units)
    groups = [(variable.name, variable.terms) for variable in model.variables]
    groups += [(group.variable, group.terms) for group in model.sets]
    for name, terms in groups:
        for term in terms:
            places.clear()
            _in_units(term, name, model.inputs, units)
            pairs = itertools.pairwise(sorted(places))
            numbers += [(name, 1, b - a) for a, b in pairs]
    yield from numbers


def exponent_range(model: Document, dtype: Dtype) -> tuple[int, int]:
    """Return by which powers of two all inputs can be scaled: lowest and highest.

    Within the range every number with the unit of an input, multiplied, is a normal
    number of the type, so that nothing but the exponents changes.

    Example:
        >>> from fuzzytree.model.rulebase import (
        ...     Band, Proposition, Rule, RuleBase, Term
        ... )
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
