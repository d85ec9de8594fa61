"""How often do many curves cross? Counted by doubles, before each place is sought."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from fuzzytree.auditing.engine.curves import pieces
from fuzzytree.auditing.engine.elements import Element
from fuzzytree.model.interrupts import checkpoint
from fuzzytree.numerics.enclosures import Value, degree_enclosure

_FEW: Final = 64  # curves, which are not worth counting
_NEAR = 1e-12  # degrees that may be equal, but for rounding
_STEPS = 256  # between the first and the last end of a piece


def crossings(elements: Sequence[Element]) -> int:
    """Return how often curves cross at least, as far as some points show it.

    Pairs that change their order from one point to the next are counted. Few curves are
    not looked at, and give 0.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> lines = [Points((0.0, 1.0), (k / 98, 1.0 - k / 98)) for k in range(99)]
        >>> crossings([Element(line) for line in lines])
        4851
    """
    if len(elements) < _FEW:
        return 0
    ends = {
        float(end)
        for element in elements
        for piece in pieces(element.shape)
        for end in (piece.low, piece.high)
        if end is not None
    }
    if len(ends) < 2:
        return 0
    # Quantiles: where ends are close, curves change fast.
    x = np.quantile(sorted(ends), np.linspace(0.0, 1.0, _STEPS))
    degrees = np.empty((len(elements), len(x)))
    for row, element in enumerate(elements):
        found = degree_enclosure(element.shape, Value(x, None)).low
        degrees[row] = 1.0 - found if element.is_complement else found
    count = 0
    for row in range(1, len(elements)):
        checkpoint()
        apart = degrees[:row] - degrees[row]
        order = np.where(np.abs(apart) < _NEAR, 0.0, np.sign(apart))
        count += int((order[:, 1:] * order[:, :-1] < 0.0).sum())
    return count
