"""A model in other units: scaled by powers of two, or moved away from zero."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import TypeVar, assert_never

import msgspec

from fuzzytree.errors import LossError
from fuzzytree.model import (
    LR,
    Band,
    Dtype,
    FuzzyTree,
    Model,
    Part,
    Points,
    Shape,
    Side,
    Term,
    Variable,
)

AnyModel = TypeVar("AnyModel", bound=Model)

Change = Callable[[str, float], float]
"""What becomes of a number in the unit of a variable, by the variable's name."""

NORMAL: Mapping[Dtype, tuple[int, int]] = {
    "float64": (-1021, 1022),
    "mixed": (-1021, 1022),
    "float32": (-125, 126),
}
"""Binary exponents of normal numbers, two doublings below the largest."""


class UnitChange(msgspec.Struct, frozen=True):
    """How the numbers of a model change with the units of its variables.

    Attributes:
        place: A value of a variable: cuts, ends, means, ranges.
        length: A distance on it: spreads.
        part: A summand of a combination.
    """

    place: Change
    length: Change
    part: Callable[[Variable, Part], Part]


def scaled(model: AnyModel, exponents: Mapping[str, int]) -> AnyModel:
    """Return a model whose variables are measured in units 2**-k as large.

    Every stored number is multiplied by a power of two, which rounds nothing. So rows
    multiplied likewise must get the same answers, bit for bit: differences, their
    quotients and the products `weight * (input - centre)` are the same numbers times
    a power of two.

    Args:
        model: A tree or a rule base.
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

    def part(variable: Variable, one: Part) -> Part:
        outer, inner = exponents.get(variable.name, 0), exponents.get(one.input, 0)
        weight = exactly_scaled(one.weight, outer - inner, variable.name)
        return Part(one.input, weight, change(one.input, one.centre))

    return in_units(model, UnitChange(change, change, part))


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

    def length(_: str, value: float) -> float:
        return value

    def part(_: Variable, one: Part) -> Part:
        return Part(one.input, one.weight, place(one.input, one.centre))

    return in_units(model, UnitChange(place, length, part))


def in_units(model: AnyModel, units: UnitChange) -> AnyModel:
    """Return a model with every number in the unit of a variable changed."""
    variables = tuple(_variable(variable, units) for variable in model.variables)
    if not isinstance(model, FuzzyTree):
        return msgspec.structs.replace(model, variables=variables)
    nodes = tuple(
        msgspec.structs.replace(
            node, cuts=tuple(units.place(node.variable, cut) for cut in node.cuts)
        )
        for node in model.nodes
    )
    sets = tuple(
        msgspec.structs.replace(group, terms=_terms(group.variable, group.terms, units))
        for group in model.sets
    )
    return msgspec.structs.replace(model, variables=variables, nodes=nodes, sets=sets)


def _variable(variable: Variable, units: UnitChange) -> Variable:
    name = variable.name
    return msgspec.structs.replace(
        variable,
        terms=_terms(name, variable.terms, units),
        low=None if variable.low is None else units.place(name, variable.low),
        high=None if variable.high is None else units.place(name, variable.high),
        parts=tuple(units.part(variable, part) for part in variable.parts),
        missing=None
        if variable.missing is None
        else units.place(name, variable.missing),
        is_whole=variable.is_whole
        and all(units.place(name, value).is_integer() for value in (0.0, 1.0)),
    )


def _terms(name: str, terms: tuple[Term, ...], units: UnitChange) -> tuple[Term, ...]:
    return tuple(Term(term.name, _shape(name, term.shape, units)) for term in terms)


def _shape(name: str, shape: Shape, units: UnitChange) -> Shape:
    def place(value: float | None) -> float | None:
        return None if value is None else units.place(name, value)

    def side(one: Side) -> Side:
        return msgspec.structs.replace(one, spread=units.length(name, one.spread))

    match shape:
        case Band(low=low, high=high, left=left, right=right):
            return Band(place(low), place(high), place(left), place(right))
        case LR(mean=mean, left=below, right=above):
            return LR(units.place(name, mean), side(below), side(above))
        case Points(values=values, degrees=degrees):
            return Points(tuple(units.place(name, v) for v in values), degrees)
    assert_never(shape)


def numbers_in_units(model: Model) -> Iterator[tuple[str, int, float]]:
    """Yield each number that has a unit: its variable, its power of it, its value.

    The power is 1 for places and lengths, and -1 for weights, which divide by it. The
    lengths between two places are among them, for runtimes divide by those.
    """
    numbers: list[tuple[str, int, float]] = []

    def keep(name: str, value: float) -> float:
        numbers.append((name, 1, value))
        return value

    def part(_: Variable, one: Part) -> Part:
        numbers.append((one.input, -1, one.weight))
        keep(one.input, one.centre)
        return one

    in_units(model, UnitChange(keep, keep, part))
    yield from numbers
    groups = [(variable.name, variable.terms) for variable in model.variables]
    if isinstance(model, FuzzyTree):
        groups += [(group.variable, group.terms) for group in model.sets]
    for name, terms in groups:
        for term in terms:
            yield from ((name, 1, length) for length in _lengths(term.shape))


def _lengths(shape: Shape) -> list[float]:
    """Return the lengths of flanks and of the lines between points."""
    match shape:
        case Band():
            return [start - end for start, end in shape.flanks]
        case Points(values=values):
            return [b - a for a, b in itertools.pairwise(values)]
        case LR():
            return []
    assert_never(shape)


def exponent_range(model: Model, dtype: Dtype) -> tuple[int, int]:
    """Return by which powers of two all inputs can be scaled: lowest and highest.

    Within the range every number with the unit of an input, multiplied, is a normal
    number of the type, so that nothing but the exponents changes.

    Example:
        >>> from fuzzytree.model.rulebase import Proposition, Rule, RuleBase
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
