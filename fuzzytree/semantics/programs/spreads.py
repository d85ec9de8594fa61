"""How far a program in rounded numbers is from exact numbers, wherever its inputs lie.

The inputs lie in boxes. For each step a box has the least and the largest exact number
of the step, and the largest error of a number that is computed for it: the errors of
its arguments carried on, and one rounding. What a step rounds is a function that is
given: so one pass serves floats and fixed point. The ends are doubles; what is given
as rounded must include what these round.

Where a comparison of rounded numbers may differ from that of the exact ones, both
answers count. A quotient has no bound where its divisor may be 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fuzzytree.semantics.programs.evaluate import StepValue, still_results
from fuzzytree.semantics.programs.operations import INEXACT
from fuzzytree.semantics.programs.steps import Program, Step

Array = npt.NDArray[Any]

ARRAYS: Mapping[str, Callable[..., Array]] = {
    "add": np.add,
    "subtract": np.subtract,
    "multiply": np.multiply,
    "divide": np.divide,
    "minimum": np.minimum,
    "maximum": np.maximum,
    "negate": np.negative,
    "absolute": np.absolute,
    "floor": np.floor,
    "ceiling": np.ceil,
    "round": np.rint,
    "square_root": np.sqrt,
    "exponential": np.exp,
    "logarithm": np.log,
    "logarithm_10": np.log10,
    "logarithm_1p": np.log1p,
    "sine": np.sin,
    "cosine": np.cos,
    "tangent": np.tan,
    "arc_sine": np.arcsin,
    "arc_cosine": np.arccos,
    "arc_tangent": np.arctan,
    "hyperbolic_sine": np.sinh,
    "hyperbolic_cosine": np.cosh,
    "hyperbolic_tangent": np.tanh,
    "area_sine": np.arcsinh,
    "area_cosine": np.arccosh,
    "area_tangent": np.arctanh,
    "power": np.power,
    "remainder": np.fmod,
    "arc_tangent_2": np.arctan2,
    "less": np.less,
    "at_most": np.less_equal,
    "equal": np.equal,
    "is_finite": np.isfinite,
    "and": np.logical_and,
    "or": np.logical_or,
    "not": np.logical_not,
}
"""The operations on arrays, but for those over samples, tables and `where`."""

_LIPSCHITZ: Mapping[str, float] = {
    "sine": 1.0,
    "cosine": 1.0,
    "hyperbolic_tangent": 1.0,
    "arc_tangent": 1.6,
}
"""How steep functions are at most, all between -1.6 and 1.6."""

Rounding = Callable[[int, Array], Array]
"""Return by how much a step's result of at most some sizes is rounded, by its place."""


class Spread(NamedTuple):
    """The exact numbers of a step, and the largest error of a computed one, by box.

    Of truths `low` and `high` are whether it is surely true and may be true, and
    `error` whether the computed one may differ. Both ends are NaN of what is surely no
    number.
    """

    low: Array
    high: Array
    error: Array

    def __neg__(self) -> Spread:
        return Spread(-self.high, -self.low, self.error)

    @property
    def size(self) -> Array:
        """The largest distance of a computed number from 0."""
        size: Array = np.maximum(np.abs(self.low), np.abs(self.high)) + self.error
        return size

    @property
    def is_none(self) -> Array:
        """Where it is surely no number."""
        is_none: Array = np.isnan(self.low) & np.isnan(self.high)
        return is_none


def spreads(
    program: Program, low: Array, high: Array, rounding: Rounding
) -> list[Spread]:
    """Return what each step of a program can be, of inputs in boxes.

    Args:
        program: The program.
        low: The least value of each input in each box, of shape (inputs, boxes).
        high: The largest ones.
        rounding: By how much a step's result is rounded; of constants and tables the
            largest error of the numbers themselves.

    Returns:
        Spreads of shape (boxes,) or (samples, boxes), or what broadcasts to that.

    Example:
        >>> from fuzzytree.semantics.programs.steps import Maker, result_of
        >>> make = Maker()
        >>> half = make.input("x") / 2.0
        >>> program = make.program("p", ("x",), (result_of("output", "y", half),))
        >>> box = np.array([[1.0]]), np.array([[3.0]])
        >>> *_, end = spreads(program, *box, lambda place, size: 2.0**-24 * size)
        >>> end.low.tolist(), end.high.tolist(), bool(0 < end.error[0] < 2e-7)
        ([0.5], [1.5], True)
    """
    every: list[Spread] = []
    with np.errstate(all="ignore"):
        for place, still in enumerate(still_results(program)):
            if program.steps[place].operation == "input":
                line = program.inputs.index(program.steps[place].name)
                every.append(Spread(low[line], high[line], np.zeros(1)))
            elif still is None:
                every.append(_moving(program, every, place, rounding))
            else:
                every.append(_still(program, every, place, still, rounding))
    return every


def _still(
    program: Program,
    every: list[Spread],
    place: int,
    still: StepValue,
    rounding: Rounding,
) -> Spread:
    """Return what no input enters; it may be a constant, or computed all the same."""
    step = program.steps[place]
    numbers = np.array(still, np.float64)
    numbers = numbers.reshape(-1, 1) if isinstance(still, list) else numbers[None]
    if step.kind == "truth":
        return Spread(numbers > 0, numbers > 0, np.zeros(numbers.shape, np.bool_))
    error = np.zeros(numbers.shape)
    if step.samples and step.arguments:
        error = _number(program, every, step).error
    return _rounded(place, Spread(numbers, numbers, error), rounding)


def _moving(
    program: Program, every: list[Spread], place: int, rounding: Rounding
) -> Spread:
    step = program.steps[place]
    operands = [every[one] for one in step.arguments]
    if step.kind == "truth":
        if step.operation not in ("less", "at_most", "equal"):
            return truth_spread(step.operation, operands)
        is_same = len(set(step.arguments)) == 1
        return _compared(step.operation, *operands, is_same=is_same)
    number = _number(program, every, step)
    if step.operation not in ("total", "running"):
        return _rounded(place, number, rounding)
    (terms,) = operands
    sums = terms.size.cumsum(axis=0)
    return _rounded(
        place, number, rounding, sums if step.operation == "running" else sums[-1]
    )


def _rounded(
    place: int, spread: Spread, rounding: Rounding, size: Array | None = None
) -> Spread:
    low, high, error = spread
    is_none = spread.is_none
    size = spread.size if size is None else size
    error = error + rounding(place, size)
    is_open = np.isnan(error) | np.isnan(low) | np.isinf(low) | np.isinf(high)
    error = np.where(is_none, 0.0, np.where(is_open, np.inf, error))
    low = np.where(np.isnan(low) & ~is_none, -np.inf, low)
    return Spread(low, np.where(np.isnan(high) & ~is_none, np.inf, high), error)


def truth_spread(operation: str, operands: Sequence[Spread]) -> Spread:
    """Return what `is_finite`, `not`, `and` or `or` is."""
    a, b = operands[0], operands[-1]
    match operation:
        case "is_finite":
            is_finite = np.isfinite(a.low) & np.isfinite(a.high)
            is_never = a.is_none | (np.isinf(a.low) & (a.low == a.high))
            return Spread(is_finite, ~is_never, np.isinf(a.error))
        case "not":
            return Spread(~a.high, ~a.low, a.error)
        case "and":
            unsure = (a.error & (b.high | b.error)) | (b.error & (a.high | a.error))
            return Spread(a.low & b.low, a.high & b.high, unsure)
        case _:
            unsure = (a.error & (~b.low | b.error)) | (b.error & (~a.low | a.error))
            return Spread(a.low | b.low, a.high | b.high, unsure)


def _compared(operation: str, a: Spread, b: Spread, *, is_same: bool) -> Spread:
    """Compare; nothing is less than, or equal to, what is no number."""
    both = a.error + b.error
    is_none = a.is_none | b.is_none
    match operation:
        case "less":
            low, high = a.high < b.low, a.low < b.high
            near = (a.high + both >= b.low) & (a.low - both < b.high)
        case "at_most":
            low, high = a.high <= b.low, a.low <= b.high
            near = (a.high + both > b.low) & (a.low - both <= b.high)
        case _:
            low = (a.low == a.high) & (b.low == b.high) & (a.low == b.low)
            high = (a.low <= b.high) & (b.low <= a.high)
            near = (a.low - both <= b.high) & (b.low - both <= a.high)
    if is_same:
        low = high = np.full(near.shape, operation != "less")
        near = np.isinf(both)  # it may be no number
        low = low & ~near
    unsure = near & (both > 0.0) & ~is_none
    return Spread(low & ~is_none, high & ~is_none, unsure)


def _number(program: Program, every: list[Spread], step: Step) -> Spread:
    """Return a number before it is rounded."""
    number = number_spread(step, [every[place] for place in step.arguments])
    is_quotient = step.operation == "divide"
    return _mean(program, every, step, number) if is_quotient else number


def number_spread(step: Step, operands: Sequence[Spread]) -> Spread:
    """Return what an operation makes of numbers before it is rounded."""
    operation, a, b = step.operation, operands[0], operands[-1]
    low, high, error = a
    match operation:
        case "add":
            return Spread(low + b.low, high + b.high, error + b.error)
        case "subtract":
            return Spread(low - b.high, high - b.low, error + b.error)
        case "multiply":
            return _product(a, b)
        case "divide":
            return _quotient(a, b)
        case "minimum":
            return _smaller(a, b)
        case "maximum":
            return -_smaller(-a, -b)
        case "where":
            return _where(*operands)
        case "negate":
            return -a
        case "absolute":
            least = np.maximum(np.maximum(low, -high), 0.0)
            return Spread(least, np.maximum(-low, high), error)
        case "floor" | "ceiling" | "round":
            whole = ARRAYS[operation]
            gap = np.where(error == 0.0, 0.0, error + 1.0)
            return Spread(whole(low), whole(high), gap)
        case "square_root":
            both = np.sqrt(low) + np.sqrt(low - error)
            gap = np.where(error == 0.0, 0.0, error / both)
            return Spread(np.sqrt(low), np.sqrt(high), gap)
        case "exponential":
            return Spread(np.exp(low), np.exp(high), np.exp(high) * np.expm1(error))
        case "below":
            table = np.array(step.table)
            sides = (low, high, low - error, high + error)
            least, most, under, over = (np.searchsorted(table, one) for one in sides)
            gap = np.where(error == 0.0, 0.0, (over - under) * 1.0)
            return Spread(least * 1.0, most * 1.0, gap)
        case "pick":
            return _table_spread(np.array(step.table), a)
        case "total":
            return Spread(low.sum(axis=0), high.sum(axis=0), error.sum(axis=0))
        case "running":
            return Spread(low.cumsum(axis=0), high.cumsum(axis=0), error.cumsum(axis=0))
        case "last":
            return Spread(low[-1], high[-1], error[-1])
        case "highest":
            return Spread(low.max(axis=0), high.max(axis=0), error.max(axis=0))
        case "lowest":
            return Spread(low.min(axis=0), high.min(axis=0), error.max(axis=0))
        case _ if operation in _LIPSCHITZ:
            wide = np.full(low.shape, 1.6)
            return Spread(-wide, wide, np.minimum(_LIPSCHITZ[operation] * error, 3.2))
        case _:
            nothing = np.full(np.broadcast_shapes(low.shape, error.shape), np.inf)
            return Spread(-nothing, nothing, nothing)


def _table_spread(table: Array, place: Spread) -> Spread:
    """Return what numbers of a table can be, between places or, beyond it, anywhere."""
    first, last = place.low - place.error, place.high + place.error
    is_inside = (first >= 0.0) & (last <= len(table) - 1.0)
    ends = np.where(is_inside, first, 0), np.where(is_inside, last, len(table) - 1) + 1
    parts = np.stack(ends, axis=-1).astype(np.intp).ravel()
    longer = np.append(table, table[-1])  # a part ends within it
    low, high = (
        way.reduceat(longer, parts)[::2].reshape(first.shape)
        for way in (np.minimum, np.maximum)
    )
    return Spread(low, high, np.where(place.error == 0.0, 0.0, high - low))


def _product(a: Spread, b: Spread) -> Spread:
    ends = [x * y for x in (a.low, a.high) for y in (b.low, b.high)]
    ends = [np.where(np.isnan(end), 0.0, end) for end in ends]  # 0 infinity
    is_none = a.is_none | b.is_none
    low, high = np.minimum.reduce(ends), np.maximum.reduce(ends)
    exact = np.maximum(np.abs(b.low), np.abs(b.high))
    error = times(a.size, b.error) + times(exact, a.error)
    low = np.where(is_none, np.nan, low)
    return Spread(low, np.where(is_none, np.nan, high), error)


def _smaller(a: Spread, b: Spread) -> Spread:
    """Return the smaller of two; where it is sure which it is, the error is its own."""
    error = np.maximum(a.error, b.error)
    error = np.where(b.high + b.error < a.low - a.error, b.error, error)
    error = np.where(a.high + a.error < b.low - b.error, a.error, error)
    return Spread(np.minimum(a.low, b.low), np.minimum(a.high, b.high), error)


def times(size: Array, error: Array) -> Array:
    """Return an error that is magnified; none stays none."""
    return np.where(error == 0.0, 0.0, size * error)


def _quotient(a: Spread, b: Spread) -> Spread:
    """Divide; surely no number where both are surely 0."""
    ends = [x / y for x in (a.low, a.high) for y in (b.low, b.high)]
    low, high = np.minimum.reduce(ends), np.maximum.reduce(ends)
    least = np.maximum(b.low, -b.high)
    size = np.maximum(np.abs(low), np.abs(high))
    error = (a.error + times(size, b.error)) / (least - b.error)
    is_open = least <= b.error
    sure = [(one.low == 0.0) & (one.high == 0.0) & (one.error == 0.0) for one in (a, b)]
    is_none = (sure[0] & sure[1]) | a.is_none
    low, high = np.where(is_open, -np.inf, low), np.where(is_open, np.inf, high)
    error = np.where(is_open, np.inf, error)
    low, high = np.where(is_none, np.nan, low), np.where(is_none, np.nan, high)
    return Spread(low, high, np.where(is_none, 0.0, error))


def _mean(program: Program, every: list[Spread], step: Step, plain: Spread) -> Spread:
    """Return a quotient; of a weighted mean it lies between what is weighted.

    The error of a weight moves such a mean by no more than its share of the distance
    between the mean and the number that it belongs to.
    """
    over, under = step.arguments
    pairs = list(_weighted(program, over, under))
    if not pairs or None in pairs:
        return plain
    one = Spread(np.ones(1), np.ones(1), np.zeros(1))
    columns = [
        (every[w], one if x is None else every[x]) for w, x in filter(None, pairs)
    ]
    weights, numbers = (_stacked([pair[k] for pair in columns]) for k in (0, 1))
    area = every[under]
    low, high = numbers.low.min(axis=0), numbers.high.max(axis=0)
    is_mean = (weights.low >= 0.0).all(axis=0) & np.isfinite(plain.error)
    low = np.where(is_mean, np.maximum(plain.low, low), plain.low)
    high = np.where(is_mean, np.minimum(plain.high, high), plain.high)
    far = np.maximum(high - numbers.low, numbers.high - low)
    size = np.maximum(np.abs(numbers.low), np.abs(numbers.high))
    moment = every[over].error - (size * weights.error).sum(axis=0)
    rest = area.error - weights.error.sum(axis=0)
    moved = (far * weights.error).sum(axis=0) + moment
    moved = moved + np.maximum(np.abs(low), np.abs(high)) * rest
    error = np.where(is_mean, moved / (area.low - area.error), plain.error)
    return Spread(low, high, np.fmin(error, plain.error))


def _weighted(
    program: Program, over: int, under: int
) -> Iterator[tuple[int, int | None] | None]:
    """Yield the weights of a mean and what they weigh, None for 1; None if none is."""
    sum_, weights = program.steps[over], program.steps[under]
    product = sum_.arguments
    if over == under:
        yield under, None
    elif sum_.operation == weights.operation == "add":
        for a, b in zip(sum_.arguments, weights.arguments, strict=True):
            yield from _weighted(program, a, b)
    elif sum_.operation == weights.operation == "total":
        yield from _weighted(program, sum_.arguments[0], weights.arguments[0])
    elif sum_.operation == "multiply" and under in product:
        yield under, product[0] if product[1] == under else product[1]
    else:
        yield None


def _stacked(columns: Sequence[Spread]) -> Spread:
    """Return the numbers of several steps as samples of one."""
    if len(columns) == 1 and columns[0].low.ndim == 2:
        return columns[0]
    ends = zip(*columns, strict=True)
    low, high, error = (np.stack(np.broadcast_arrays(*one)) for one in ends)
    return Spread(low, high, error)


def _where(condition: Spread, a: Spread, b: Spread) -> Spread:
    surely, maybe, unsure = condition
    low = np.where(surely, a.low, np.where(maybe, np.fmin(a.low, b.low), b.low))
    high = np.where(surely, a.high, np.where(maybe, np.fmax(a.high, b.high), b.high))
    has_none = np.isnan(a.low) | np.isnan(b.low)
    most = np.maximum(a.error, b.error)
    gap = np.maximum(a.high, b.high) - np.minimum(a.low, b.low) + most
    gap = np.where(has_none, np.inf, gap)
    error = np.where(surely, a.error, np.where(maybe, most, b.error))
    both = maybe & ~surely & has_none
    return Spread(
        low, high, np.where(unsure | both, np.where(unsure, gap, np.inf), error)
    )


class Worst(NamedTuple):
    """The worst of a program over a domain.

    Attributes:
        errors: Of each result: the largest error wherever it has a bound.
        shares: Of each result: the share of the domain without a bound.
        sizes: Of each step: how far from 0 a computed number can be; of a truth 1 or 0
            if it is always or never true, else NaN.
    """

    errors: Array
    shares: Array
    sizes: Array


_BOXES, _NUMBERS = 1 << 14, 1 << 22
_MOST_NUMBERS = 1 << 25  # of all boxes


def worst_over(
    program: Program,
    ranges: Sequence[tuple[float, float]],
    rounding: Rounding,
) -> Worst:
    """Return the worst of a program over all inputs in ranges.

    They are parted into boxes, the same number of parts for each input.
    """
    most = min(_BOXES, _MOST_NUMBERS // max(program.size, 1))
    low, high = _boxes(ranges, most)
    some = max(_NUMBERS // max(program.size, 1), 1)
    errors: list[Array] = []
    sizes = np.zeros((-(-low.shape[1] // some), len(program.steps)))
    for start in range(0, low.shape[1], some):
        part = slice(start, start + some)
        every = spreads(program, low[:, part], high[:, part], rounding)
        count = low[:, part].shape[1]
        ends = [every[one.step].error * 1.0 for one in program.results]
        errors.append(np.array([np.broadcast_to(end, count) for end in ends]))
        for place, spread in enumerate(every):
            sizes[start // some, place] = _size(program.steps[place], spread)
    table = np.hstack(errors)
    is_open = np.isinf(table)
    most = np.where(is_open, 0.0, table).max(axis=1)
    is_same = (sizes == sizes[0]).all(axis=0)
    for place, step in enumerate(program.steps):
        if step.kind == "truth" and not is_same[place]:
            sizes[:, place] = np.nan
    return Worst(most, is_open.mean(axis=1), sizes.max(axis=0))


def _size(step: Step, spread: Spread) -> float:
    """Return a number's distance from 0; of a truth what it surely is, or NaN."""
    if step.kind == "number":
        return float(np.where(spread.is_none, 0.0, spread.size).max())
    is_true, may_be = spread.low.all(), spread.high.any()
    is_sure = (is_true or not may_be) and not spread.error.any()
    return float(is_true) if is_sure else math.nan


def _boxes(ranges: Sequence[tuple[float, float]], most: int) -> tuple[Array, Array]:
    """Return the ends of boxes that fill ranges, of shape (inputs, boxes)."""
    if not ranges:
        return np.empty((0, 1)), np.empty((0, 1))
    count = max(int(most ** (1 / len(ranges)) + 1e-9), 1)
    grids = [np.linspace(*one, count + 1) for one in ranges]
    low = np.meshgrid(*(grid[:-1] for grid in grids), indexing="ij")
    high = np.meshgrid(*(grid[1:] for grid in grids), indexing="ij")
    return np.array([one.ravel() for one in low]), np.array([o.ravel() for o in high])


_EXACT = frozenset(
    ("minimum", "maximum", "negate", "absolute", "floor", "ceiling", "round", "where")
) | {"index", "below", "last", "highest", "lowest"}


_LARGEST = float(np.finfo(np.float32).max)
_HALF_UNIT = 2.0**-24 + 2.0**-48  # and more than doubles round in a step


def float32_rounding(program: Program) -> Rounding:
    """Return by how much steps are rounded in single precision.

    Functions of the C library are taken to be good to four units in the last place.
    """

    def rounding(place: int, size: Array) -> Array:
        step = program.steps[place]
        if step.operation in _EXACT:
            table = np.array(step.table)  # of `below`: rounded, it may count otherwise
            is_exact = (table == table.astype(np.float32)).all()
            return np.zeros(1) if is_exact else np.full(1, np.inf)
        if step.operation == "constant":
            exact: Array = np.abs(size - size.astype(np.float32))
            return exact
        units = 1
        if step.operation in ("total", "running"):
            count = program.steps[step.arguments[0]].samples
            units = count if step.operation == "running" else count.bit_length()
        elif step.operation in INEXACT:
            units = 8
        unit = units * (_HALF_UNIT * size + 2.0**-150)
        return np.where(size < _LARGEST, unit, np.inf)

    return rounding
