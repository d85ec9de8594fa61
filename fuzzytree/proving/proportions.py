"""Can two rules be equally strong on a set with an interior, under the product?

Then their strengths are one function there: the quotient of what they ask of a variable
is constant, for each variable by itself. So it is enough to find one variable of which
they ask curves that are nowhere multiples of each other. Curves are piecewise
polynomials, and polynomials are multiples exactly if their coefficients are.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from fuzzytree.proving.curves import ONE, Piece
from fuzzytree.proving.elements import Element
from fuzzytree.proving.ground import Axis, Ground
from fuzzytree.proving.polynomials import Polynomial, monic
from fuzzytree.proving.stretches import spread

_Held = tuple[Fraction, Fraction, Piece, Polynomial]


def may_tie(given: Ground, one: int, other: int) -> bool:
    """Return whether two rules may be equally strong, and fire, on some open set.

    Args:
        given: The rules, joined by the product, and the box.
        one: The number of a rule, from 1.
        other: The number of another one.

    Returns:
        False if they are not; True if it cannot be excluded.
    """
    if given.ends is None:
        return False
    return all(
        _may_be_multiples(axis, one - 1, other - 1, *ends)
        for axis, ends in zip(given.axes, given.ends, strict=True)
    )


def _may_be_multiples(
    axis: Axis, one: int, other: int, low: Fraction, high: Fraction
) -> bool:
    mine, theirs = list(axis.asked[one]), list(axis.asked[other])
    for group in axis.asked[one]:
        if group in theirs:
            mine.remove(group)
            theirs.remove(group)
    if any(len(group) > 1 for group in (*mine, *theirs)):
        return True
    if len(mine) > 1 or len(theirs) > 1 or low == high:
        return True
    # The first element is the curve of a rule that asks nothing: always 1.
    ours = axis.elements[mine[0][0] if mine else 0]
    rival = axis.elements[theirs[0][0] if theirs else 0]
    return any(
        monic(p) == monic(q)
        for a in _held(ours, low, high)
        for b in _held(rival, low, high)
        if max(a[0], b[0]) < min(a[1], b[1])
        for p in _forms(ours, a)
        for q in _forms(rival, b)
    )


def _held(element: Element, low: Fraction, high: Fraction) -> Iterator[_Held]:
    """Yield the pieces of a curve within two ends, and where they hold."""
    for piece, polynomial in element.pieces():
        start = low if piece.low is None else max(low, piece.low)
        end = high if piece.high is None else min(high, piece.high)
        if start < end:
            yield start, end, piece, polynomial


def _forms(element: Element, held: _Held) -> Iterator[Polynomial]:
    """Yield what a curve may be on parts of a piece where it is not 0."""
    low, high, piece, polynomial = held
    least, most = spread(piece.polynomial, low, high)
    if most > 0 and least < piece.cap:
        yield polynomial
    is_held = most > piece.cap or least >= piece.cap
    if is_held or (element.is_complement and (least < 0 or most <= 0)):
        yield (ONE,)
