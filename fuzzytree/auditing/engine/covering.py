"""Choose one option on each axis so that together they cover everything.

An option is a set of what it covers, as the bits of a whole number. That is set cover
with a choice on each axis, solved by a dynamic program over what is covered so far:
one axis after another, keeping only sets that no other contains.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.model.interrupts import checkpoint


def maximal(masks: Iterable[int]) -> tuple[int, ...]:
    """Return the sets that no other one contains, in a fixed order.

    Example:
        >>> maximal([0b011, 0b001, 0b100])
        (3, 4)
    """
    kept: list[int] = []
    for mask in sorted(set(masks), key=lambda one: (-one.bit_count(), one)):
        checkpoint()
        if all(mask | other != other for other in kept):
            kept.append(mask)
    return tuple(kept)


def cover(
    families: Sequence[Sequence[int]], full: int, clock: Clock
) -> tuple[int, ...] | None:
    """Return an option of each family that together cover `full`, or None.

    Args:
        families: The options on each axis, as sets of bits.
        full: What must be covered.
        clock: Asked between two axes.

    Raises:
        OutOfTimeError: If the clock is over.

    Example:
        >>> cover([[0b01, 0b10], [0b01]], 0b11, Clock())
        (2, 1)
    """
    if not all(families):
        return None
    order = sorted(range(len(families)), key=lambda axis: len(families[axis]))
    rest = [0] * (len(order) + 1)
    for place in range(len(order) - 1, -1, -1):
        union = rest[place + 1]
        for mask in families[order[place]]:
            union |= mask
        rest[place] = union & full
    if rest[0] != full:
        return None
    steps: list[dict[int, tuple[int, int]]] = []
    live: Iterable[int] = (0,)
    for place, axis in enumerate(order):
        clock.check()
        reached: dict[int, tuple[int, int]] = {}
        for before in live:
            checkpoint()
            for mask in families[axis]:
                after = (before | mask) & full
                if after | rest[place + 1] == full:
                    reached.setdefault(after, (before, mask))
        if not reached:
            return None
        steps.append(reached)
        live = maximal(reached)
    chosen = [0] * len(order)
    at = full
    for place in range(len(order) - 1, -1, -1):
        at, chosen[order[place]] = steps[place][at]
    return tuple(chosen)
