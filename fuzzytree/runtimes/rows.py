"""Checks of the rows that a runtime gets, values of all variables, and winners.

A combination is a chain of single operations in the stored order of its parts, each
rounded once. All combinations advance together, one part at a time, so that the
operations are few and wide; the longer ones stand first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.errors import FuzzyTreeError
from fuzzytree.model import (
    Document,
    Outcome,
    Variable,
    stand_ins,
)
from fuzzytree.numerics import rounded

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray, IntArray

    Reals = npt.NDArray[np.floating[Any]]
    Real = np.dtype[np.floating[Any]]


Chain = tuple[tuple[int, float, float], ...]
Chains = tuple[Chain, ...]
"""Of each combination: line, weight and centre of each part."""

_SAFE = 1e300  # what sums of a row may reach: far from overflow


def checked(values: npt.ArrayLike, inputs: Sequence[str]) -> FloatArray:
    """Return values as doubles of shape (inputs, rows), copied only if need be.

    Raises:
        ValueError: If there is not one line for each input, or text among the values.

    Example:
        >>> checked([[1, 2, 3]], ["force"]).shape
        (1, 3)
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"the values must be numbers: {error}") from error
    if array.ndim != 2 or array.shape[0] != len(inputs):
        shape = " x ".join(map(str, array.shape)) or "a single number"
        raise ValueError(
            f"the values must have one line for each of the {len(inputs)} inputs "
            f"({_shown(inputs)}) and one column for each row, not the shape {shape}"
        )
    return array


def winners(
    strengths: npt.NDArray[np.floating[Any]], missing: npt.NDArray[np.bool_]
) -> IntArray:
    """Return rule numbers and status codes as the two lines of one array.

    `strengths` has shape (rules, rows) and no NaN; a missing row has rule 0 and status
    3.

    Example:
        >>> winners(np.array([[0.5, 0.0], [0.5, 0.0]]), np.array([False, False]))
        array([[1, 0],
               [1, 2]])
    """
    best = strengths.max(axis=0)
    equal = strengths == best
    result = np.empty((2, strengths.shape[1]), np.int64)
    np.add(equal.argmax(axis=0), 1, out=result[0])
    np.greater(np.count_nonzero(equal, axis=0), 1, out=result[1], casting="unsafe")
    uncovered = best == 0.0
    result[0, uncovered], result[1, uncovered] = 0, 2
    result[0, missing], result[1, missing] = 0, 3
    return result


def outcome_of(
    model: Document,
    rows: Sequence[Sequence[float | None]],
    *,
    has_probabilities: bool = False,
) -> Outcome:
    """Return rows of numbers, None for NaN, as an outcome.

    A row is a rule, or the outputs of a system; a status; any strengths; and the
    probabilities of all classes if there are some.

    Raises:
        FuzzyTreeError: If there are more or fewer strengths than rules.
    """
    first, count = len(model.outputs) or 1, len(model.rules)
    rated = len(model.classes) if has_probabilities else 0
    width = len(rows[0]) if rows else first + 1 + count + rated
    whole = np.array(rows, np.float64).reshape(len(rows), width)
    table, probabilities = whole[:, : width - rated].T, whole[:, width - rated :].T
    if len(table) - first - 1 not in (0, count):
        raise FuzzyTreeError(
            f"it gives {len(table) - first - 1} strengths, not {count}"
        )
    outputs, strengths = table[:first], table[first + 1 :]
    rule = np.zeros_like(outputs[0]) if model.outputs else outputs[0]
    last = len(model.leaves) or len(model.rules)
    for what, numbers, most in (("rule", rule, last), ("status", table[first], 3)):
        is_known = (numbers >= 0) & (numbers <= most) & (numbers == np.floor(numbers))
        if not is_known.all():
            raise FuzzyTreeError(f"it answers a {what} that is none of 0 to {most}")
    return Outcome(
        rule.astype(np.int64),
        table[first].astype(np.int64),
        strengths if len(strengths) else None,
        probabilities if rated else None,
        outputs if model.outputs else None,
    )


def _shown(names: Sequence[str]) -> str:
    shown = ", ".join(names[:12])
    return shown + (", ..." if len(names) > 12 else "")


@dataclass(frozen=True, slots=True)
class PartsAt:
    """The parts at one position of all combinations that are long enough."""

    inputs: IntArray
    weights: Reals
    centres: Reals


@dataclass(frozen=True, slots=True)
class Axes:
    """How to compute the value of every variable of a model.

    Attributes:
        line: The line of each variable, by name: inputs first, in their order.
        inputs: How many inputs there are.
        steps: The parts of the combinations, position by position.
        chains: The combinations again, for a single row: (line, weight, centre) of
            each part.
        dtype: In what the chain is computed.
        limit: If no input is larger, all variables are finite.
        stand_ins: What replaces a value that is not finite, for each input, of shape
            (inputs, 1); NaN where nothing does. None if no input has one.
    """

    line: dict[str, int]
    inputs: int
    steps: tuple[PartsAt, ...]
    chains: Chains
    dtype: Real
    limit: float
    stand_ins: Reals | None = None

    @property
    def count(self) -> int:
        """The number of variables."""
        return len(self.line)


def plan_axes(
    variables: Sequence[Variable],
    dtype: Real | None = None,
) -> Axes:
    """Return how to compute the variables of a model; in double unless given."""
    kind: Real = np.dtype(np.float64) if dtype is None else dtype
    inputs = [v.name for v in variables if not v.parts]
    mixed = [v for v in variables if v.parts]
    mixed.sort(key=lambda v: -len(v.parts))
    line = {name: i for i, name in enumerate([*inputs, *(v.name for v in mixed)])}
    longest = len(mixed[0].parts) if mixed else 0
    steps: list[PartsAt] = []
    for place in range(longest):
        parts = [v.parts[place] for v in mixed if len(v.parts) > place]
        lines = np.array([line[part.input] for part in parts], np.int64)
        weights = np.array([[part.weight] for part in parts], kind)
        steps.append(
            PartsAt(lines, weights, np.array([[p.centre] for p in parts], kind))
        )
    chains = tuple(
        tuple((line[part.input], part.weight, part.centre) for part in v.parts)
        for v in mixed
    )
    known = stand_ins(variables)
    numbers = [known.get(name, np.nan) for name in inputs]
    stand: Reals = rounded(numbers, np.dtype(kind).type).reshape(-1, 1)
    limit = min(map(_chain_limit, chains), default=float(np.finfo(kind).max))
    stand_or_none = stand if known else None
    return Axes(line, len(inputs), tuple(steps), chains, kind, limit, stand_or_none)


def _chain_limit(chain: Chain) -> float:
    """Return a number such that inputs up to it make no double overflow."""
    weight = sum(abs(weight) for _, weight, _ in chain)
    return _SAFE / max(weight, 1.0) - max(abs(centre) for _, _, centre in chain)


def axis_lines(axes: Axes, values: FloatArray) -> Reals:
    """Return the value of every variable, of shape (variables, rows).

    `values` has shape (inputs, rows); it is returned as it is if the plan has no
    combinations and computes in doubles, and nothing is replaced.
    """
    base = input_lines(axes, values)
    if not axes.steps:
        return base
    lines = np.empty((axes.count, values.shape[1]), axes.dtype)
    lines[: axes.inputs] = base
    chains = lines[axes.inputs :]
    for position, step in enumerate(axes.steps):
        term: Reals = base[step.inputs]
        term -= step.centres
        term *= step.weights
        if position == 0:
            chains[:] = term
        else:
            chains[: len(term)] += term
    return lines


def input_lines(axes: Axes, values: FloatArray) -> Reals:
    """Return the inputs of all rows with what stands for missing values."""
    base: Reals = values.astype(axes.dtype, copy=False)
    if axes.stand_ins is not None and not np.isfinite(base.sum()):
        replaced = ~np.isfinite(base) & np.isfinite(axes.stand_ins)
        base = np.where(replaced, axes.stand_ins, base)
    return base


def axis_values(axes: Axes, inputs: Reals, line: int, rows: IntArray) -> Reals:
    """Return the value of one variable in some rows, given all inputs, in double."""
    if line < axes.inputs:
        values: Reals = inputs[line].take(rows, mode="clip")
        return values
    chain = axes.chains[line - axes.inputs]
    columns = {place: inputs[place].take(rows, mode="clip") for place, _, _ in chain}
    total: Reals = chain_value(chain, columns)
    return total


def axis_row(axes: Axes, row: list[float]) -> list[float]:
    """Return the value of every variable for a single row, in double."""
    values = input_row(axes, row)
    return [*values, *(chain_value(chain, values) for chain in axes.chains)]


def input_row(axes: Axes, row: list[float]) -> list[float]:
    """Return a single row with what stands for its missing values."""
    values = row.copy()
    if axes.stand_ins is not None and not math.isfinite(sum(row)):
        for line, stand in enumerate(axes.stand_ins[:, 0].tolist()):
            if not (math.isfinite(row[line]) or math.isnan(stand)):
                values[line] = stand
    return values


def chain_value(chain: Chain, values: Sequence[float] | Mapping[int, Reals]) -> Any:
    """Return a combination of the inputs of a row, or of many, in double."""
    line, weight, centre = chain[0]
    total = weight * (values[line] - centre)
    for line, weight, centre in chain[1:]:
        total = total + weight * (values[line] - centre)
    return total


def missing_rows(lines: Reals) -> npt.NDArray[np.bool_] | None:
    """Return which rows hold a value that is not finite; None if no row does.

    The sum is a fast first look: it is finite only if every summand is.
    """
    if np.isfinite(lines.sum()):
        return None
    missing = ~np.logical_and.reduce(np.isfinite(lines), axis=0)
    return missing if missing.any() else None


def known_rows(axes: Axes, values: FloatArray) -> npt.NDArray[np.bool_]:
    """Return in which rows every variable is finite, in double.

    Combinations are computed only of rows with an input beyond the limit.
    """
    is_small = np.abs(input_lines(axes, values)) <= axes.limit
    is_known: npt.NDArray[np.bool_] = np.logical_and.reduce(is_small, axis=0)
    others = np.flatnonzero(~is_known)
    if len(others):
        missing = missing_rows(axis_lines(axes, values.take(others, axis=1)))
        is_known[others] = True if missing is None else ~missing
    return is_known
