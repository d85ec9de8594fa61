"""From readings to pressures: a curve for all cells, and a gain for each."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, ClassVar, Final

import numpy as np
from msgspec import Meta

from fuzzytree.errors import InvalidModelError, TableError
from fuzzytree.formats import FileRecord
from fuzzytree.model import Mistake, Value

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray

STEPS: Final = 16383
"""How many steps a calibrated pressure has, from 0 to the pressure that reads full."""

Positive = Annotated[float, Meta(gt=0.0, le=1e12)]
CalibrationPoint = Annotated[
    tuple[Positive, ...],
    Meta(min_length=2, max_length=2, description="a reading and its pressure"),
]


class Calibration(Value, FileRecord, frozen=True, dict=True):
    """What readings mean.

    A cell that reads `r` over its baseline feels the pressure of the curve at `gain *
    r`. The curve is straight between its points, from 0 at 0 on; behind the last point
    it goes on as before it.

    Attributes:
        unit: Of the pressures, such as kPa or N.
        points: Readings, which rise, each with its pressure, which rises too.
        gains: Of each cell, row by row; empty for 1.

    Raises:
        InvalidModelError: If a reading or a pressure does not rise.

    Example:
        >>> law = Calibration("kPa", ((100.0, 2.0), (200.0, 6.0)))
        >>> law.pressures(np.array([[50, 150, 250]])).tolist()
        [[1.0, 4.0, 8.0]]
    """

    noun: ClassVar[str] = "a calibration"
    unit: Annotated[str, Meta(min_length=1, max_length=20)]
    points: Annotated[tuple[CalibrationPoint, ...], Meta(min_length=1, max_length=1000)]
    gains: Annotated[tuple[Positive, ...], Meta(max_length=65536)] = ()

    def __post_init__(self) -> None:
        """Refuse a curve that falls."""
        mistakes = [*self._mistakes()]
        if mistakes:
            raise InvalidModelError(mistakes)

    def _mistakes(self) -> Iterator[Mistake]:
        if not self.unit.isprintable():
            yield ("unit",), f"the unit {self.unit!r} cannot be printed"
        for place, (before, after) in enumerate(itertools.pairwise(self.points)):
            for what, old, new in zip(
                ("reading", "pressure"), before, after, strict=True
            ):
                if new <= old:
                    text = f"the {what} {new:g} does not rise above {old:g}"
                    yield ("points", place + 1), f"{text}: a calibration never falls"

    @cached_property
    def _curve(self) -> FloatArray:
        found: FloatArray = np.array([(0.0, 0.0), *self.points]).T
        return found

    def pressures(self, readings: npt.ArrayLike) -> FloatArray:
        """Return the pressures of readings over the baseline, without gains."""
        (x, y), values = self._curve, np.asarray(readings, np.float64)
        slope = (y[-1] - y[-2]) / (x[-1] - x[-2])
        over = np.maximum(values - x[-1], 0.0) * slope
        found: FloatArray = np.interp(values, x, y) + over
        return found

    def top(self, full: int) -> float:
        """Return the pressure of a cell that reads full, which is `STEPS`."""
        return float(self.pressures([full])[0])

    def steps(self, pressed: npt.NDArray[np.int64], full: int) -> npt.NDArray[np.int64]:
        """Return pressures of a frame in steps, at least 1 where a cell presses.

        Args:
            pressed: Readings over the baseline, of shape (rows, columns).
            full: What a cell reads that takes no more.
        """
        values = pressed.astype(np.float64)
        if self.gains:
            values = values * np.array(self.gains).reshape(values.shape)
        shares = self.pressures(np.minimum(values, full)) / self.top(full)
        found: npt.NDArray[np.int64] = np.rint(shares * STEPS).astype(np.int64)
        np.maximum(found, pressed > 0, out=found)
        return found


def fit_pressures(
    loads: Sequence[float], readings: Sequence[FloatArray], unit: str
) -> Calibration:
    """Return the calibration of a sensor that was loaded evenly.

    The curve goes through the median reading of the cells at each load. The gain of a
    cell is the least squares solution of `gain * reading = median reading`; a cell that
    reads nothing has 1.

    Args:
        loads: Pressures on every cell, above 0.
        readings: What the cells read over their baseline at each, (rows, columns).
        unit: Of the loads.

    Raises:
        TableError: If there is no load, or one reads less than a smaller one.

    Example:
        >>> flat = np.ones((1, 2))
        >>> found = fit_pressures([2.0, 1.0], [flat * 80, flat * 50], "kPa")
        >>> found.points, found.gains
        (((50.0, 1.0), (80.0, 2.0)), (1.0, 1.0))
    """
    amounts, stack = _ordered(loads, readings)
    middles = [float(np.median(cells[cells > 0])) for cells in stack]
    points = _rising(amounts, middles, unit)
    squares = (stack**2).sum(axis=0)
    products = (stack * np.array(middles)[:, None, None]).sum(axis=0)
    gains = np.where(squares > 0, products / np.where(squares > 0, squares, 1), 1.0)
    return Calibration(unit, points, tuple(gains.reshape(-1).tolist()))


def fit_forces(
    loads: Sequence[float], readings: Sequence[FloatArray], unit: str
) -> Calibration:
    """Return the curve of all cells of a sensor on which known weights lay.

    At each load the forces of the cells that press add up to it. The curve that does
    so with the least squares and never falls is found by non-negative least squares
    (Lawson and Hanson 1974) over as many straight pieces as there are loads.

    Args:
        loads: Total forces, above 0.
        readings: As in `fit_pressures`.
        unit: Of the loads.

    Raises:
        TableError: As `fit_pressures`.
    """
    from scipy.optimize import nnls

    amounts, stack = _ordered(loads, readings)
    _rising(amounts, stack.sum(axis=(1, 2)).tolist(), unit)
    knots = np.linspace(0.0, stack.max(), len(stack) + 1)
    width = knots[1]
    pieces = [np.clip(stack - knot, 0.0, width).sum(axis=(1, 2)) for knot in knots[:-1]]
    weights = 1.0 / np.array(amounts)  # each load counts by its own size
    slopes, _ = nnls(np.array(pieces).T * weights[:, None], np.ones(len(stack)))
    slopes = np.maximum(slopes, 1e-6 * slopes.max())  # it rises everywhere
    pressures = np.cumsum(slopes * width)
    points = zip(knots[1:].tolist(), pressures.tolist(), strict=True)
    return Calibration(unit, tuple((r, p) for r, p in points))


def _ordered(
    loads: Sequence[float], readings: Sequence[FloatArray]
) -> tuple[list[float], FloatArray]:
    """Return loads from the smallest on, and what the cells read at each."""
    if not loads:
        raise TableError("a calibration needs a load above 0 with its frames")
    order = np.argsort(np.array(loads), kind="stable").tolist()
    for place in order:
        if not loads[place] > 0:
            raise TableError(f"a load is above 0, not {loads[place]:g}")
        if not (readings[place] > 0).any():
            raise TableError(f"at the load {loads[place]:g} no cell reads anything")
    return [loads[place] for place in order], np.array([readings[p] for p in order])


def _rising(
    loads: Sequence[float], readings: Sequence[float], unit: str
) -> tuple[tuple[float, float], ...]:
    """Return points of a curve; refuse one that falls."""
    points = tuple(zip(readings, loads, strict=True))
    for (low, less), (high, more) in itertools.pairwise(points):
        if more == less:
            raise TableError(f"the load {more:g} {unit} comes twice")
        if high <= low:
            raise TableError(
                f"at {more:g} {unit} the cells read {high:g}, no more than {low:g} at "
                f"{less:g} {unit}: a calibration never falls"
            )
    return points
