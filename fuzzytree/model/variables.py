"""Variables and their terms, of rule bases, trees and systems alike."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from fuzzytree.model.curves import Curve
from fuzzytree.model.functions import LR, Band, Points, Shape
from fuzzytree.model.mistakes import (
    Mistake,
    Path,
    name_choice,
    name_mistakes,
    text_fault,
)
from fuzzytree.model.values import Value

DATE_UNIT = "days since 1970-01-01"
"""The unit of a column of dates (UTC); it says that cells may be dates."""


class Term(Value, frozen=True):
    """A label of a variable, and what it means.

    Attributes:
        name: Unique within its variable.
        function: The degree of membership of each value.
        height: What the degree is multiplied by; above 0, at most 1.
    """

    name: str
    function: Curve
    height: float = 1.0

    @property
    def shape(self) -> Shape:
        """The function, which in rule bases and trees is one of three.

        Raises:
            TypeError: If it is another.
        """
        if not isinstance(self.function, Band | LR | Points):
            raise TypeError(f"{self.name!r} has no function of rule bases")
        return self.function


class Part(Value, frozen=True):
    """One summand of a combination: `weight * (input - centre)`."""

    input: str
    weight: float
    centre: float = 0.0


class Variable(Value, frozen=True):
    """An input column, or a linear combination of input columns.

    Attributes:
        name: Unique in its model.
        terms: The labels; names are unique within the variable.
        unit: The unit of its values, for people.
        low: The smallest value seen or allowed; None if unknown.
        high: The largest value seen or allowed; None if unknown.
        parts: Empty for an input column. Otherwise the summands of a combination,
            added in this order, each operation rounded once to double.
        clips: Whether values are first moved into the range, of which one end may be
            open; only in fuzzy systems.
        categories: The texts of a categorical input; the value of each is its
            position, from 0. Empty for numbers.
        missing: The value that stands for one that is missing, not finite or no
            category: a point of the input space like any other. None if such a row
            is answered by the policy of the model (`Semantics.missing`). Only rule
            bases and trees have it, for input columns.
        is_whole: Whether the values of an input column are whole numbers, of dates
            whole days. Predictions do not depend on it; an audit does.
    """

    name: str
    terms: tuple[Term, ...] = ()
    unit: str = ""
    low: float | None = None
    high: float | None = None
    parts: tuple[Part, ...] = ()
    clips: bool = False
    categories: tuple[str, ...] = ()
    missing: float | None = None
    is_whole: bool = False


def stand_ins(variables: Iterable[Variable]) -> dict[str, float]:
    """Return the value that stands for a missing one, by input.

    Example:
        >>> stand_ins([Variable("age", missing=30.0), Variable("mass")])
        {'age': 30.0}
    """
    return {v.name: v.missing for v in variables if v.missing is not None}


def shapes_of(variables: Iterable[Variable]) -> dict[tuple[str, str], Shape]:
    """Return the shape of each term, by variable and name."""
    return {(v.name, t.name): t.shape for v in variables for t in v.terms}


def variable_mistakes(
    variables: tuple[Variable, ...], columns: tuple[str, ...] = ()
) -> Iterator[Mistake]:
    """Yield what is wrong with the variables of a rule base or tree."""
    yield from name_mistakes(("variables",), "variable", [v.name for v in variables])
    yield from name_mistakes(("columns",), "column", columns)
    named = set(columns)
    known: dict[str, bool] = {}
    for position, variable in enumerate(variables):
        path: Path = ("variables", position)
        if not variable.name:
            yield (*path, "name"), "a variable needs a name"
        if columns and not variable.parts and variable.name not in named:
            yield (
                (*path, "name"),
                f"input {variable.name!r} is not among the columns; "
                f"{name_choice(variable.name, columns)}",
            )
        yield from input_mistakes(path, variable, known)
        for index, term in enumerate(variable.terms):
            is_shape = isinstance(term.function, Band | LR | Points)
            if not is_shape or term.height != 1.0:
                where = f"term {term.name!r} of {variable.name!r}"
                text = "only a fuzzy system has such a function or height"
                yield (*path, "terms", index), f"{where}: {text}"
        if variable.clips:
            yield (
                path,
                f"only a fuzzy system clips its inputs, such as {variable.name!r}",
            )
        yield from _column_mistakes(path, variable)


def _column_mistakes(path: Path, variable: Variable) -> Iterator[Mistake]:
    """Yield what is wrong with categories and with what stands for a missing value."""
    name, missing, last = variable.name, variable.missing, len(variable.categories) - 1
    yield from name_mistakes(
        (*path, "categories"), f"category of {name!r}", variable.categories
    )
    if variable.is_whole and (variable.parts or variable.categories):
        yield path, f"only an input of numbers is whole, not {name!r}"
    if variable.parts and (variable.categories or missing is not None):
        yield path, f"only an input has categories or stand-ins, not the sum {name!r}"
    if missing is None:
        return
    if not math.isfinite(missing):
        yield (*path, "missing"), f"what stands for a missing {name!r} must be finite"
    elif variable.categories and missing not in range(-1, last + 1):
        yield (
            (*path, "missing"),
            f"what stands for a missing {name!r} is -1 or the position of a category, "
            f"up to {last}, not {missing!r}",
        )


def input_mistakes(
    path: Path, variable: Variable, known: dict[str, bool]
) -> Iterator[Mistake]:
    """Yield what is wrong with an input: its unit, range, terms and combination.

    `known` has the variables before it, and whether each is a combination itself; this
    one is added.
    """
    name = variable.name
    yield from unit_mistakes(path, name, variable.unit)
    yield from range_mistakes(path, name, variable.low, variable.high)
    yield from part_mistakes(path, name, variable.parts, known)
    yield from term_mistakes(path, name, variable.terms)
    known[name] = bool(variable.parts)


def term_mistakes(path: Path, name: str, terms: tuple[Term, ...]) -> Iterator[Mistake]:
    """Yield what is wrong with the terms of a variable."""
    names = [term.name for term in terms]
    yield from name_mistakes((*path, "terms"), f"term of {name!r}", names)
    for index, term in enumerate(terms):
        place = (*path, "terms", index)
        where = f"term {term.name!r} of {name!r}"
        if not term.name:
            yield place, f"a term of {name!r} has no name"
        if not 0.0 < term.height <= 1.0:
            yield place, f"{where}: the height must lie in (0, 1], not {term.height!r}"
        for text in term.function.mistakes():
            yield (*place, "function"), f"{where}: {text}"


def unit_mistakes(path: Path, name: str, unit: str) -> Iterator[Mistake]:
    """Yield why the unit of a variable is none."""
    fault = text_fault(unit)
    if fault:
        yield (*path, "unit"), f"the unit {unit!r} of {name!r} {fault}"


def range_mistakes(
    path: Path, name: str, low: float | None, high: float | None
) -> Iterator[Mistake]:
    """Yield what is wrong with the range of a variable."""
    for field, value in (("low", low), ("high", high)):
        if value is not None and not math.isfinite(value):
            yield (*path, field), f"the range of {name!r} must be finite"
            return
    if low is not None and high is not None and low > high:
        yield (
            (*path, "low"),
            f"the range of {name!r} starts at {low!r} and ends below it, at {high!r}",
        )


def part_mistakes(
    path: Path, name: str, parts: tuple[Part, ...], known: Mapping[str, bool]
) -> Iterator[Mistake]:
    """Yield what is wrong with a combination.

    `known` has the variables before it, and whether each is a combination itself.
    """
    for index, part in enumerate(parts):
        where = (*path, "parts", index)
        if known.get(part.input, True):
            inputs = [one for one, combined in known.items() if not combined]
            yield (
                (*where, "input"),
                f"combination {name!r} needs input {part.input!r}, "
                f"which does not stand before it; {name_choice(part.input, inputs)}",
            )
        if not math.isfinite(part.weight) or part.weight == 0.0:
            yield (
                (*where, "weight"),
                f"the weight of {part.input!r} in {name!r} must be finite "
                f"and not 0, not {part.weight!r}",
            )
        if not math.isfinite(part.centre):
            yield (
                (*where, "centre"),
                f"the centre of {part.input!r} in {name!r} must be finite",
            )


def term_names(variables: Iterable[Variable]) -> dict[str, dict[str, None]]:
    """Return the names of each variable's terms, in order and quick to look up."""
    return {v.name: dict.fromkeys(term.name for term in v.terms) for v in variables}
