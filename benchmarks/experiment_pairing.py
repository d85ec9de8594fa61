"""Two learners on the same units: who is right more often, and could it be chance?"""

from __future__ import annotations

from collections.abc import Sequence

from fuzzytree.model.rulebase import Value


class Pairing(Value, frozen=True):
    """How one learner does beside another.

    Attributes:
        better: In how many units the first is right more often.
        worse: In how many the second is.
        equal: In how many neither is.
        chance: How likely a difference at least as one-sided is if both are equally
            good: the exact sign test, two-sided.
    """

    better: int
    worse: int
    equal: int
    chance: float


def paired(first: Sequence[float], second: Sequence[float]) -> Pairing:
    """Compare two learners unit by unit: subjects, or presses.

    Args:
        first: How often the first is right in each unit.
        second: The same of the second, in the same order.

    Raises:
        ValueError: If they are not as many.

    Example:
        >>> paired([9, 8, 7, 9, 5], [8, 7, 6, 8, 5])
        Pairing(better=4, worse=0, equal=1, chance=0.125)
    """
    pairs = [*zip(first, second, strict=True)]
    better = sum(one > other for one, other in pairs)
    worse = sum(one < other for one, other in pairs)
    return Pairing(better, worse, len(pairs) - better - worse, sign_test(better, worse))


def sign_test(better: int, worse: int) -> float:
    """Return the two-sided chance of a split as uneven under a fair coin, exactly.

    Example:
        >>> sign_test(5, 1)
        0.21875
    """
    count, fewer = better + worse, min(better, worse)
    ways = tail = 1
    for k in range(fewer):
        ways = ways * (count - k) // (k + 1)
        tail += ways
    chance: float = 2 * tail / 2**count
    return min(1.0, chance)
