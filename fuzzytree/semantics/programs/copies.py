"""Which numbers of a program are equal in every runner, whatever their last bits are.

Runners differ in the last bits of a function, and each of them still finds a number
equal to its copy. The smaller of two numbers is a copy of one of them, and so are a
choice and the largest of many; arithmetic makes the same number of the same numbers.
With a conclusion that is cut off at a height, all samples at that height are copies
of it, so that the mean of the maximum is certain.

A number's mark tells its copies: 64 bits that are mixed from where it comes from, of
which two that differ are equal by chance once in 10^19.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from fuzzytree.semantics.programs.operations import OPERATIONS
from fuzzytree.semantics.programs.steps import Step

Array = npt.NDArray[Any]
Pair = tuple[Array, Array]

_ARITHMETIC: Final = frozenset(
    ("add", "subtract", "multiply", "divide", "negate", "absolute", "square_root")
)
"""What has one result in every runner, alone or among many."""


def same(one: Array, two: Array) -> Array:
    """Return where two numbers are copies of the same number."""
    return np.equal(one, two)


def marks_of(
    step: Step, place: int, found: Pair, given: Sequence[Pair], marks: Sequence[Array]
) -> Array:
    """Return a mark for each number of a step; copies of a number share its mark.

    Args:
        step: The step.
        place: Its place in the program.
        found: Its values and the largest errors of them.
        given: Those of its arguments; of truths, whether they are unsure.
        marks: The marks of its arguments.

    Returns:
        Marks of the shape of the values; of no meaning for truths.

    Example:
        >>> error = np.full(1, 1e-9)
        >>> pairs = (np.array([0.2]), error), (np.array([0.7]), error)
        >>> both = [np.array([11], np.uint64), np.array([12], np.uint64)]
        >>> marks_of(Step("minimum", (0, 1)), 2, pairs[0], pairs, both).tolist()
        [11]
    """
    value, error = np.broadcast_arrays(*found)
    if step.kind == "truth":
        return np.zeros(1, np.uint64)
    bits = np.asarray(value, np.float64, order="C").view(np.uint64)
    if not error.any():
        return _mixed(bits)
    own = _own_marks(step, place, value.shape, marks)
    match step.operation:
        case "minimum" | "maximum":
            (a, error_a), (b, error_b) = given
            is_first = a < b if step.operation == "minimum" else a > b
            is_sure = (np.abs(a - b) > error_a + error_b) | same(*marks)
            made = np.where(is_sure, np.where(is_first, *marks), own)
        case "where":
            condition, unsure = given[0]
            is_sure = ~unsure | same(marks[1], marks[2])
            made = np.where(is_sure, np.where(condition, marks[1], marks[2]), own)
        case "highest" | "lowest":
            made = _of_many(value, given[0], marks[0], own)
        case "last":
            made = marks[0][-1]
        case _:
            made = own
    return np.where(error == 0.0, _mixed(bits), made)


def _own_marks(
    step: Step, place: int, shape: tuple[int, ...], marks: Sequence[Array]
) -> Array:
    """Return marks of what is new; the same arithmetic on copies gives copies."""
    if step.operation in _ARITHMETIC:
        kind = np.array([[*OPERATIONS].index(step.operation)], np.uint64)
        mixed = _mixed(kind if step.samples else kind[0], *marks)
        return np.broadcast_to(mixed, shape)
    samples = np.arange(step.samples or 1, dtype=np.uint64)
    own = _mixed(np.full(1, place + len(OPERATIONS), np.uint64), samples)
    return np.broadcast_to(own.reshape(-1, 1) if step.samples else own, shape)


def _mixed(*parts: Array) -> Array:
    """Return 64 bits that each of the parts, and their order, enter."""
    state: Array = np.full(1, 0x9E3779B97F4A7C15, np.uint64)
    shift = np.uint64(29)
    for part in parts:
        state = (state ^ part) * np.uint64(0xBF58476D1CE4E5B9)
        state = (state ^ (state >> shift)) * np.uint64(0x94D049BB133111EB)
        state = state ^ (state >> shift)
    return state


def _of_many(end: Array, samples: Pair, marks: Array, own: Array) -> Array:
    """Return the mark of an end of many, if all that may be it are copies."""
    values, errors = samples
    widest = np.max(np.where(values == end, errors, 0.0), axis=0)
    may_be = ~(np.abs(values - end) > errors + widest)
    marks = np.broadcast_to(marks, may_be.shape)
    largest = np.where(may_be, marks, np.uint64(0)).max(axis=0)
    is_one = (~may_be | (marks == largest)).all(axis=0)
    return np.where(is_one, largest, own)
