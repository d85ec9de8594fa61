"""How far two runners of a program may be apart, derived step by step.

Arithmetic, comparisons and square roots have one result each. The other functions
differ between libraries by a few units in the last place; that difference is propagated
through the steps behind it. Where a comparison could fall either way for it, both ways
count, and where nothing is known the bound is infinite.

Runners differ in the last bits of a function, and each of them still finds a number
equal to its copy. The smaller of two numbers is a copy of one of them, and so are a
choice and the largest of many; arithmetic makes the same number of the same numbers.
With a conclusion that is cut off at a height, all samples at that height are copies of
it, so that the mean of the maximum is certain. Copies of a number share its mark: 64
bits that are mixed from where it comes from, of which two different ones are equal by
chance once in 10^19.

A number of a row is a box of no width, so what truths, sums and ends of two numbers do
to errors is what they do on boxes (`spreads`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from fuzzytree.semantics.programs.evaluate import still_results
from fuzzytree.semantics.programs.operations import INEXACT, OPERATIONS
from fuzzytree.semantics.programs.spreads import (
    ARRAYS,
    Array,
    Spread,
    number_spread,
    times,
    truth_spread,
)
from fuzzytree.semantics.programs.steps import Program, Step

Pair = tuple[Array, Array]
"""Values and the largest difference of two runners; of truths, whether it is unsure."""

ORIGIN = "units in the last place of exp, pow and the like, carried through the steps"

_WORKING_SET = 1 << 21  # numbers of which values and bounds are kept together

PAIR_ULPS: Mapping[str, float] = {
    "exponential": 4.0,
    "logarithm": 4.0,
    "power": 4.0,
    "sine": 4.0,
    "cosine": 12.0,
    "hyperbolic_tangent": 16.0,
}
"""Units in the last place by which two libraries may differ; 8 for others. Measured
against exact values: at most 1.5 (exp, log, pow), 6.4 (tanh), of the C library, numpy
and onnxruntime. Of sines and cosines the units are those of 1: at most 1.3 and 7.3, as
graphs compute a cosine from a sine."""

_SURELY_0 = -750.0
"""Below it e to a power is 0 in every library: half the least double is at -745.1."""

_COMPARISONS = frozenset(("less", "at_most", "equal"))
_WAVES = frozenset(("sine", "cosine"))
_UNROUNDED = frozenset(
    ("where", "minimum", "maximum", "negate", "absolute", "floor", "ceiling", "round")
) | {"below", "pick", "last", "highest", "lowest"}
_OF_BOXES = frozenset(
    ("add", "subtract", "minimum", "maximum", "negate", "absolute", "below")
)
"""Operations whose errors are those on boxes."""
_ROUGH = frozenset(("tangent", "hyperbolic_cosine", "arc_tangent_2", "remainder"))
"""Functions of which nothing is known unless their arguments are the same."""


def error_bounds(
    program: Program, values: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Return how far two runners of a program may be apart in each number.

    Returns:
        Bounds of shape (results, rows): 0 demands equal bits, infinity nothing.

    Example:
        >>> from fuzzytree.semantics.programs.steps import Maker, result_of
        >>> make = Maker()
        >>> x = make.input("x")
        >>> results = result_of("output", "sum", make("add", x, x)), result_of(
        ...     "output", "power", make("exponential", x))
        >>> error_bounds(make.program("p", ("x",), results), np.ones((1, 1))).tolist()
        [[0.0], [1.7763568394002505e-15]]
    """
    rows = values.shape[1]
    if not rows:
        return np.empty((len(program.results), 0))
    some = max(_WORKING_SET // max(program.size, 1), 1)
    result = np.empty((len(program.results), rows))
    with np.errstate(all="ignore"):
        for start in range(0, rows, some):
            part = slice(start, start + some)
            for line, bound in enumerate(_bounds(program, values[:, part])):
                result[line, part] = bound
    return result


def _bounds(program: Program, values: npt.NDArray[np.float64]) -> list[Array]:
    pairs: list[Pair] = []
    marks: list[Array] = []
    stills = still_results(program)
    for place, (step, still) in enumerate(zip(program.steps, stills, strict=True)):
        operands = [pairs[one] for one in step.arguments]
        given_marks = [marks[one] for one in step.arguments]
        if still is not None:  # computed once, by the same functions
            value = np.array(still)
            value = value.reshape(-1, 1) if isinstance(still, list) else value
            pairs.append((value, np.zeros(value.shape, value.dtype)))
        elif step.operation == "input":
            line = values[program.inputs.index(step.name)]
            pairs.append((line, np.zeros(line.shape)))
        elif step.operation in _COMPARISONS:
            (one, two), copied = operands, same(*given_marks)
            pairs.append(_compared(step.operation, one, two, copied))
        else:
            pairs.append(_pair(step, operands))
        marks.append(marks_of(step, place, pairs[-1], operands, given_marks))
    return [pairs[one.step][1] for one in program.results]


def _pair(step: Step, operands: Sequence[Pair]) -> Pair:
    if step.kind == "truth":
        truth = truth_spread(step.operation, [_spread(one) for one in operands])
        return truth.low, truth.error
    value, error = _number(step, operands)
    is_exact = np.ones(value.shape, np.bool_)
    for place, (_, other) in enumerate(operands):
        if not (step.operation == "where" and place == 0):
            is_exact = is_exact & _all_exact(step, other, value)
    error = np.where(np.isnan(error), np.inf, error)
    if step.operation in _UNROUNDED:
        return value, error
    is_exact = is_exact | _is_certain(step.operation, operands)
    own = _own_error(step.operation, value, [one for one, _ in operands])
    rounding = np.where(np.isfinite(value), np.spacing(np.abs(value) + error), 0.0)
    moved = error + rounding
    moved = np.where(np.isnan(moved), np.inf, moved)
    return value, np.where(is_exact, 0.0, moved) + own


def _is_certain(operation: str, operands: Sequence[Pair]) -> Array:
    """Return where a sure 0, infinity or NaN decides for the result, error or not."""
    certain: Array = np.zeros(1, np.bool_)
    if operation not in ("add", "subtract", "multiply", "divide"):
        return certain
    (a, error_a), (b, error_b) = operands
    for one, error in operands:
        certain = certain | (np.isnan(one) & (error == 0.0))
    if operation == "multiply":
        for (one, error), (other, unsure) in (operands, operands[::-1]):
            is_sure = error == 0.0
            certain = certain | (is_sure & (one == 0.0) & np.isfinite(other + unsure))
            certain = certain | (is_sure & np.isinf(one) & (np.abs(other) > unsure))
    if operation == "divide":
        is_sure = (error_a == 0.0) & (np.abs(b) > error_b)
        certain = certain | (is_sure & (a == 0.0))
    return certain


def _all_exact(step: Step, error: Array, value: Array) -> Array:
    if step.operation in ("total", "running", "last", "highest", "lowest"):
        exact: Array = (error == 0.0).all(axis=0)
        return np.broadcast_to(exact, value.shape)
    return np.equal(error, 0.0)


def _own_error(operation: str, value: Array, operands: Sequence[Array]) -> Array:
    """Return by how much two libraries differ for the same arguments."""
    if operation not in INEXACT:
        return np.zeros(value.shape)
    size = np.ones(value.shape) if operation in _WAVES else np.abs(value)
    units: Array = np.array(PAIR_ULPS.get(operation, 8.0) * np.spacing(size))
    is_one: Array = ~np.isfinite(value)  # what all libraries agree on
    if operation == "exponential":
        is_one = is_one | (operands[0] < _SURELY_0)
    if operation == "power":
        base, exponent = operands
        is_one = is_one | (base == 0.0) | (base == 1.0)
        is_one = is_one | (exponent == 0.0) | (exponent == 1.0)
    else:
        is_one = is_one | (operands[0] == 0.0)
    units[is_one] = 0.0
    return units


def _compared(operation: str, one: Pair, two: Pair, is_same: Array) -> Pair:
    """Compare; a number and its copy are equal, unless either may be NaN."""
    (a, error_a), (b, error_b) = one, two
    both = error_a + error_b
    is_near = (both > 0.0) & ~(np.abs(a - b) > both)
    is_nan = (np.isnan(a) & (error_a == 0.0)) | (np.isnan(b) & (error_b == 0.0))
    unsure = is_near & ~is_nan & (~is_same | np.isinf(both))
    return ARRAYS[operation](a, b), unsure


def _number(step: Step, operands: Sequence[Pair]) -> Pair:
    operation = step.operation
    if operation in _WAVES:
        a, error = operands[0]
        return ARRAYS[operation](a), np.minimum(error, 2.0)
    if operation in _ROUGH:
        value = ARRAYS[operation](*[one for one, _ in operands])
        unsure = sum(error for _, error in operands)
        return value, np.where(unsure == 0.0, 0.0, np.inf)
    if operation in _OF_BOXES:
        error = number_spread(step, [_spread(one) for one in operands]).error
        if operation == "below":
            return np.searchsorted(step.table, operands[0][0]).astype(np.float64), error
        return ARRAYS[operation](*[one for one, _ in operands]), error
    if operation == "pick":
        return _table_number(step, *operands[0])
    if operation in ("total", "running", "last", "highest", "lowest"):
        return _over_samples(operation, *operands[0])
    if operation == "where":
        return _where(*operands)
    if len(operands) == 1:
        return _monotone(ARRAYS[operation], *operands[0])
    return _of_two(operation, *operands[0], *operands[1])


def _spread(pair: Pair) -> Spread:
    """Return a number as a box of no width."""
    return Spread(pair[0], *pair)


def _monotone(function: Callable[..., Array], a: Array, error: Array) -> Pair:
    value, low, high = function(a), function(a - error), function(a + error)
    is_none = np.isnan(value) & np.isnan(low) & np.isnan(high) & (error < 1.0)
    gap = np.where((low == high) | is_none, 0.0, np.abs(high - low))
    return value, gap


def _table_number(step: Step, a: Array, error: Array) -> Pair:
    table = np.array(step.table)
    place = np.where((a >= 0) & (a < len(table)), a, 0).astype(np.intp)
    widest = float(table.max() - table.min())
    return table[place], np.where(error == 0.0, 0.0, widest)


def _over_samples(operation: str, a: Array, error: Array) -> Pair:
    size, unit = np.abs(a) + error, np.spacing(1.0)
    match operation:
        case "total":
            slack = len(a).bit_length() * unit * size.sum(axis=0)
            return _halved(a), error.sum(axis=0) + slack
        case "running":
            slack = len(a) * unit * size.cumsum(axis=0)
            return a.cumsum(axis=0), error.cumsum(axis=0) + slack
        case "last":
            return a[-1], error[-1]
        case "highest":
            return a.max(axis=0), _end_error(a, error)
        case _:
            return a.min(axis=0), _end_error(-a, error)


def _end_error(a: Array, error: Array) -> Array:
    """Return the largest error of those that may be the highest."""
    may_be = ~(a + error < (a - error).max(axis=0))
    kept: Array = np.where(may_be, error, 0.0).max(axis=0)
    return kept


def _halved(samples: Array) -> Array:
    size = 1 << (len(samples) - 1).bit_length()
    current = np.zeros((size, *samples.shape[1:]))
    current[: len(samples)] = samples
    while len(current) > 1:
        half = len(current) // 2
        current = current[:half] + current[half:]
    total: Array = current[0]
    return total


def _where(condition: Pair, one: Pair, two: Pair) -> Pair:
    (c, unsure), (a, error_a), (b, error_b) = condition, one, two
    gap = np.where(a == b, 0.0, np.abs(a - b)) + np.maximum(error_a, error_b)
    gap = np.where(np.isnan(a) & np.isnan(b), 0.0, gap)
    value = np.where(c, a, b)
    return value, np.where(unsure, gap, np.where(c, error_a, error_b))


def _of_two(operation: str, a: Array, error_a: Array, b: Array, error_b: Array) -> Pair:
    size_a, size_b = np.abs(a) + error_a, np.abs(b) + error_b
    match operation:
        case "multiply":
            return a * b, times(size_a, error_b) + times(size_b, error_a)
        case "divide":
            least = np.abs(b) - error_b
            turned = error_a + times(np.abs(a / b), error_b)
            error = np.where(least > 0.0, turned / least, np.inf)
            fixed = np.where(error_a == 0.0, 0.0, error_a / np.abs(b))
            return a / b, np.where(error_b == 0.0, fixed, error)
        case _:
            return _power(a, error_a, b, error_b)


def _power(a: Array, error_a: Array, b: Array, error_b: Array) -> Pair:
    """Bound a power by its corners: above 0 it is monotone in either number."""
    bases, exponents = (a - error_a, a + error_a), (b - error_b, b + error_b)
    corners = np.array([np.power(x, y) for x in bases for y in exponents])
    low, high = corners.min(axis=0), corners.max(axis=0)
    gap = np.where(low == high, 0.0, high - low)
    is_unsure = (a - error_a < 0.0) & ((error_a > 0.0) | (error_b > 0.0))
    return np.power(a, b), np.where(is_unsure, np.inf, gap)


_ARITHMETIC: Final = frozenset(
    ("add", "subtract", "multiply", "divide", "negate", "absolute", "square_root")
)
"""What has one result in every runner, alone or among many."""


def same(one: Array, two: Array) -> Array:
    """Return where two numbers are copies of the same number."""
    return np.equal(one, two)


def marks_of(
    step: Step,
    place: int,
    result: Pair,
    operands: Sequence[Pair],
    marks: Sequence[Array],
) -> Array:
    """Return a mark for each number of a step; copies of a number share its mark.

    Returns:
        Marks of the shape of the values; of no meaning for truths.

    Example:
        >>> error = np.full(1, 1e-9)
        >>> pairs = (np.array([0.2]), error), (np.array([0.7]), error)
        >>> both = [np.array([11], np.uint64), np.array([12], np.uint64)]
        >>> marks_of(Step("minimum", (0, 1)), 2, pairs[0], pairs, both).tolist()
        [11]
    """
    value, error = np.broadcast_arrays(*result)
    if step.kind == "truth":
        return np.zeros(1, np.uint64)
    bits = np.asarray(value, np.float64, order="C").view(np.uint64)
    if not error.any():
        return _mixed(bits)
    own = _own_marks(step, place, value.shape, marks)
    match step.operation:
        case "minimum" | "maximum":
            (a, error_a), (b, error_b) = operands
            is_first = a < b if step.operation == "minimum" else a > b
            is_sure = (np.abs(a - b) > error_a + error_b) | same(*marks)
            new_marks = np.where(is_sure, np.where(is_first, *marks), own)
        case "where":
            condition, unsure = operands[0]
            is_sure = ~unsure | same(marks[1], marks[2])
            new_marks = np.where(is_sure, np.where(condition, marks[1], marks[2]), own)
        case "highest" | "lowest":
            new_marks = _of_many(value, operands[0], marks[0], own)
        case "last":
            new_marks = marks[0][-1]
        case _:
            new_marks = own
    return np.where(error == 0.0, _mixed(bits), new_marks)


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
