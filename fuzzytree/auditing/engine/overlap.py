"""How much two curves have in common: areas, their highest common degree, crossings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.auditing.engine.curves import ONE
from fuzzytree.auditing.engine.measures import Bounds, Line, area, local, seen
from fuzzytree.auditing.engine.ranges import shape_ranges
from fuzzytree.model.rulebase import Shape

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

_CELLS = 256  # on which degrees are enclosed before areas are asked exactly


class Overlap(NamedTuple):
    """How much two curves share on a line.

    Attributes:
        shared: The area under both, the integral of their minimum.
        joined: The area under either, the integral of their maximum.
        possibility: The supremum of their minimum.
        at: A point near where it is reached.
        crossings: Points at which they cross, each with the degree there.
        is_within: Whether the first is nowhere above the second.
        is_around: Whether the first is nowhere below the second.
    """

    shared: Bounds
    joined: Bounds
    possibility: Bounds
    at: Fraction
    crossings: tuple[tuple[Fraction, Bounds], ...]
    is_within: bool
    is_around: bool

    @property
    def jaccard(self) -> Bounds | None:
        """The shared area over the joined area; None if that may be 0."""
        if self.joined.low <= 0:
            return None
        high = self.shared.high / self.joined.low
        return Bounds(self.shared.low / self.joined.high, min(high, ONE))


def overlap(of: Line) -> Overlap:
    """Return how much the two curves of a line share, exactly but for slivers.

    Raises:
        ValueError: If the line has not two curves.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> down, up = (Points((0.0, 1.0), ends) for ends in ((1.0, 0.0), (0.0, 1.0)))
        >>> from fuzzytree.auditing.engine.measures import line
        >>> found = overlap(line([down, up], Fraction(0), Fraction(1)))
        >>> found.jaccard.exact, found.possibility.exact
        ('1/3', '1/2')
    """
    if len(of.elements) != 2:
        raise ValueError(f"two curves overlap, not {len(of.elements)}")
    rank = of.cells.rank
    lower = [int(a > b) for a, b in rank]
    shared = area(of, lambda cell, at: local(of.elements[lower[cell]], at))
    joined = area(of, lambda cell, at: local(of.elements[1 - lower[cell]], at))
    met = [
        (
            Bounds(min(a.low, b.low), min(a.high, b.high)),
            at,
        )
        for (a, at), (b, _) in _both(of)
    ]
    low = max(bounds.low for bounds, _ in met)
    high = max(bounds.high for bounds, _ in met)
    start = of.cells.start_rank
    orders = [] if of.is_open and len(rank) else [int(start[0]) - int(start[1])]
    orders += [int(a) - int(b) for a, b in rank]
    return Overlap(
        shared,
        joined,
        Bounds(low, high),
        next(at for bounds, at in met if bounds.low == low),
        tuple(_crossings(of)),
        all(order <= 0 for order in orders),
        all(order >= 0 for order in orders),
    )


def most_shared(shapes: Sequence[Shape], low: float, high: float) -> FloatArray:
    """Return bounds from above of the shared by the joined area of each two curves.

    Degrees are enclosed on each of some cells, so nothing is left to chance; only what
    comes near to an answer is worth the exact areas.

    Returns:
        Shape (shapes, shapes); 1 where nothing is known.
    """
    width = (high - low) / _CELLS
    if not width > 1e-6 * max(abs(low), abs(high)):
        return np.ones((len(shapes), len(shapes)))
    edges = np.linspace(low, high, _CELLS + 1, dtype=np.float64)
    cells = [shape_ranges(shape, edges)[1] for shape in shapes]
    least = np.array([one.low for one in cells])
    most = np.array([one.high for one in cells])
    found = np.ones((len(shapes), len(shapes)))
    for place in range(len(shapes)):
        shared = np.minimum(most, most[place]).sum(axis=1)
        joined = np.maximum(least, least[place]).sum(axis=1)
        # Edges and sums are off by roundings, which are far below this.
        found[place] = (shared + 1e-6) / np.maximum(joined - 1e-6, 1e-12)
    return np.minimum(found, 1.0)


def _both(
    of: Line,
) -> Iterator[tuple[tuple[Bounds, Fraction], tuple[Bounds, Fraction]]]:
    """Yield the values of two curves at the same places, seen from both sides."""
    zones = of.cells.zones
    for number, (a, b) in enumerate(zones):
        at = (a + b) / 2
        for is_after, is_asked in (
            (False, number > 0 or not of.is_open or len(zones) == 1),
            (True, number + 1 < len(zones)),
        ):
            if is_asked:
                one, other = (
                    seen(of, which, number, is_after=is_after) for which in (0, 1)
                )
                yield (one, at), (other, at)


def _crossings(of: Line) -> Iterator[tuple[Fraction, Bounds]]:
    before = 0
    since = 0
    for cell, (a, b) in enumerate(of.cells.rank):
        order = int(a > b) - int(a < b)
        if order and before and order != before:
            low, high = of.cells.zones[since]
            yield (low + high) / 2, seen(of, 0, since)
        if order:
            before, since = order, cell + 1
