"""What float32 cannot hold of a model, and numbers rounded to it.

Float32 is another type, not a worse double: constants are rounded to nearest, and only
what rounding destroys is a loss: a number beyond float32, a width or weight that
becomes 0, different bounds that become one.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from fuzzytree.model import (
    LR,
    Band,
    Document,
    Dtype,
    Loss,
    Points,
    Shape,
    Variable,
)

RealKind = np.float64 | np.float32
RealArray = npt.NDArray[np.float64] | npt.NDArray[np.float32]

LARGEST = float(np.finfo(np.float32).max)
_BEYOND = 2.0**128  # where the floats of 32 bits would go on
SMALLEST = float(np.finfo(np.float32).smallest_subnormal)


def rounded(
    values: Sequence[float], kind: type[RealKind], *, is_divisor: bool = False
) -> RealArray:
    """Return values in a type: to nearest, never infinite, a divisor never 0.

    Example:
        >>> rounded([0.1, 1e300], np.float32).tolist()
        [0.10000000149011612, 3.4028234663852886e+38]
    """
    exact = np.array(values, np.float64)
    if kind is np.float64:
        return exact
    single = np.clip(exact, -LARGEST, LARGEST).astype(np.float32)
    if is_divisor:
        least = np.copysign(np.float32(SMALLEST), single)
        single = np.where(single == 0, least, single).astype(np.float32)
    return single


def cuts_of_rounded(thresholds: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the doubles `cut` for which `x <= cut` is `float32(x) <= threshold`.

    With f the largest float of 32 bits that is not above the threshold, all doubles up
    to the middle between f and the next float become f or less; the middle does if the
    last bit of f is 0.

    Example:
        >>> float(cuts_of_rounded(np.array([0.5]))[0])
        0.5000000298023224
    """
    below = floats_below(thresholds)
    with np.errstate(over="ignore"):
        above = np.nextafter(below, np.float32(np.inf))
        low = np.clip(below.astype(np.float64), -_BEYOND, _BEYOND)
        middle = low / 2 + np.clip(above.astype(np.float64), -_BEYOND, _BEYOND) / 2
    is_even = below.view(np.uint32) % 2 == 0
    cuts = np.where(is_even, middle, np.nextafter(middle, -np.inf))
    return np.where(thresholds == np.inf, np.inf, cuts)


def floats_below(numbers: npt.NDArray[np.float64]) -> npt.NDArray[np.float32]:
    """Return the largest float of 32 bits that is not above each number."""
    with np.errstate(over="ignore"):
        singles = np.asarray(numbers, np.float64).astype(np.float32)
        lower = np.nextafter(singles, np.float32(-np.inf))
    return np.where(singles.astype(np.float64) > numbers, lower, singles)


def losses(model: Document, dtype: Dtype) -> tuple[Loss, ...]:
    """Return what a type cannot hold of a model; nothing for double.

    In mixed, only curves, reaches and degrees are float32; a valid model's fit in.
    """
    if dtype != "float32":
        return ()
    found = [loss for v in model.variables for loss in _variable_losses(v, model)]
    for number, node in enumerate(model.nodes, 1):
        where = f"node {number}"
        found += _number_losses(where, [("cut", cut) for cut in node.cuts])
        found += _order_losses(where, "cuts", node.cuts)
    return tuple(found)


def _variable_losses(variable: Variable, model: Document) -> Iterator[Loss]:
    if variable.missing is not None:
        stand_in = ("stand-in of missing values", variable.missing)
        yield from _number_losses(f"variable {variable.name!r}", [stand_in])
    for part in variable.parts:
        where = f"part {part.input!r} of {variable.name!r}"
        yield from _number_losses(
            where, [("weight", part.weight), ("centre", part.centre)]
        )
        yield from _zero_losses(where, "weight", part.weight)
    if not model.rules:
        return  # descent needs no term
    for term in variable.terms:
        yield from _shape_losses(f"term {term.name!r} of {variable.name!r}", term.shape)


def _shape_losses(where: str, shape: Shape) -> Iterator[Loss]:
    match shape:
        case Band(low=low, high=high, left=left, right=right):
            bounds = [("low", low), ("high", high)]
            given = [(name, value) for name, value in bounds if value is not None]
            yield from _number_losses(where, given)
            yield from _order_losses(where, "ends", [value for _, value in given])
            for name, edge, end in (("left", low, left), ("right", high, right)):
                if edge is not None and end is not None:
                    span, width = edge - end, f"{name} flank's width"
                    numbers = [(f"{name} flank's end", end), (width, span)]
                    yield from _number_losses(where, numbers)
                    yield from _zero_losses(where, width, span)
        case LR(mean=mean, left=below, right=above):
            yield from _number_losses(where, [("mean", mean)])
            for name, side in (("left", below), ("right", above)):
                spread, reach = f"{name} spread", f"{name} reach"
                yield from _number_losses(
                    where, [(spread, side.spread), (reach, side.reach)]
                )
                yield from _zero_losses(where, spread, side.spread)
        case Points(values=values):
            ends = [("first point", values[0]), ("last point", values[-1])]
            yield from _number_losses(where, ends)
            yield from _peak_losses(where, shape)


def _peak_losses(where: str, points: Points) -> Iterator[Loss]:
    """Yield where points become one and a degree beyond those at their ends is gone.

    Other points that become one are a step, as steep as float32 can represent.
    """
    single = rounded(points.values, np.float32).tolist()
    pairs = zip(single, points.values, points.degrees, strict=True)
    for _, group in itertools.groupby(pairs, key=lambda pair: pair[0]):
        _, values, degrees = zip(*group, strict=True)
        ends = degrees[0], degrees[-1]
        lost = max(max(degrees) - max(ends), min(ends) - min(degrees))
        if lost > 0:
            text = (
                f"points {values[0]!r} to {values[-1]!r} become one in float32, "
                "and the degrees between them are gone"
            )
            yield Loss(where, text, lost)


def _number_losses(where: str, numbers: Sequence[tuple[str, float]]) -> Iterator[Loss]:
    for what, value in numbers:
        if abs(value) > LARGEST:
            end = LARGEST if value > 0 else -LARGEST
            yield Loss(where, f"{what} {value!r} lies beyond float32; {end!r} stands")


def _zero_losses(where: str, what: str, value: float) -> Iterator[Loss]:
    if abs(value) <= SMALLEST / 2:
        yield Loss(where, f"{what} {value!r} becomes 0 in float32")


def _order_losses(where: str, what: str, values: Sequence[float]) -> Iterator[Loss]:
    single = rounded(values, np.float32).tolist()
    for position in range(len(single) - 1):
        if single[position] == single[position + 1]:
            low, high = values[position], values[position + 1]
            text = f"{what} {low!r} and {high!r} become one number in float32"
            yield Loss(where, text)
