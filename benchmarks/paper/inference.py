"""The statistics of the page: two classifiers on the same rows, and laws of growth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist

import msgspec

CONFIDENCE = 0.95


class Power(msgspec.Struct, frozen=True):
    """A law `value = factor * size ** exponent`, fitted.

    Attributes:
        exponent: The slope in logarithms.
        low: Lower end of its 95 % confidence interval.
        high: Upper end of it.
        factor: The value that the law gives to size 1.
    """

    exponent: float
    low: float
    high: float
    factor: float


def mcnemar(first: int, second: int) -> float:
    """Return the exact two-sided p-value of McNemar's test (a sign test).

    If neither is right more often, each row on which exactly one is right falls to
    either with probability 1/2, so the smaller count is binomial.

    Args:
        first: Rows on which only the first is right.
        second: Rows on which only the second is right.

    Example:
        >>> mcnemar(1, 5)  # 2 * (1 + 6) / 2**6
        0.21875
    """
    total, few = first + second, min(first, second)
    tail = ways = 1  # to choose at most so many rows, and to choose exactly so many
    for count in range(few):
        ways = ways * (total - count) // (count + 1)
        tail += ways
    # Whole numbers are divided exactly, however many rows there are.
    return min(1.0, 2 * tail / (1 << total))


def wilson(share: float, trials: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a probability.

    Args:
        share: The observed share, in [0, 1].
        trials: Independent trials behind it; none gives (0, 1).

    Example:
        >>> tuple(round(end, 4) for end in wilson(0.5, 10))
        (0.2366, 0.7634)
    """
    if trials == 0:
        return 0.0, 1.0
    z = NormalDist().inv_cdf(0.5 + CONFIDENCE / 2)
    room = z * z / trials
    centre = (share + room / 2) / (1 + room)
    half = z * math.sqrt(share * (1 - share) / trials + room / trials / 4) / (1 + room)
    return max(0.0, centre - half), min(1.0, centre + half)


def holm(values: Sequence[float]) -> tuple[float, ...]:
    """Return p-values corrected for how many tests there are (Holm, 1979).

    The smallest of m is multiplied by m, the next by m - 1, and so on, and none falls
    below one before it. At a level of 5 %, the chance of any false finding is 5 %.

    Example:
        >>> holm([0.01, 0.5, 0.02])
        (0.03, 0.5, 0.04)
    """
    order = sorted(range(len(values)), key=values.__getitem__)
    found = [1.0] * len(values)
    highest = 0.0
    for rank, place in enumerate(order):
        highest = max(highest, min(1.0, values[place] * (len(values) - rank)))
        found[place] = highest
    return tuple(found)


def power(sizes: Sequence[float], values: Sequence[float]) -> Power:
    """Return the power law through points, by least squares in logarithms.

    The interval is Student's, from how far the points lie off the line; it knows
    nothing of a line that is in truth a curve. Two points leave nothing to judge by:
    their interval has no ends.

    Raises:
        ValueError: If there are fewer than two points.

    Example:
        >>> law = power([1, 10, 100], [3, 30, 300])
        >>> round(law.exponent, 9), round(law.factor, 9)
        (1.0, 3.0)
    """
    if len(sizes) < 2:
        raise ValueError("a power law needs two points or more")
    xs, ys = [math.log(size) for size in sizes], [math.log(value) for value in values]
    count = len(xs)
    mean_x, mean_y = math.fsum(xs) / count, math.fsum(ys) / count
    spread = math.fsum((x - mean_x) ** 2 for x in xs)
    pairs = zip(xs, ys, strict=True)
    slope = math.fsum((x - mean_x) * (y - mean_y) for x, y in pairs) / spread
    start = mean_y - slope * mean_x
    if count == 2:
        return Power(slope, -math.inf, math.inf, math.exp(start))
    left = math.fsum((y - start - slope * x) ** 2 for x, y in zip(xs, ys, strict=True))
    from scipy.stats import t

    reach = float(t.ppf(0.5 + CONFIDENCE / 2, count - 2))
    half = reach * math.sqrt(left / (count - 2) / spread)
    return Power(slope, slope - half, slope + half, math.exp(start))


def overhead(sizes: Sequence[float], times: Sequence[float]) -> tuple[float, float]:
    """Return what a call costs at least, and what each rule adds.

    The line `time = fixed + each * size` is fitted to make relative errors small, so
    that the small sizes, where the fixed part shows, count as much as the large ones.
    Neither part is below 0.

    Example:
        >>> fixed, each = overhead([10, 100, 1000], [25.0, 70.0, 520.0])
        >>> round(fixed, 6), round(each, 6)
        (20.0, 0.5)
    """
    # In units of the time: fixed * (1 / t) + each * (n / t) = 1.
    a = [1.0 / time for time in times]
    b = [size / time for size, time in zip(sizes, times, strict=True)]
    aa, bb = math.fsum(x * x for x in a), math.fsum(x * x for x in b)
    ab = math.fsum(x * y for x, y in zip(a, b, strict=True))
    one, two = math.fsum(a), math.fsum(b)
    base = aa * bb - ab * ab
    if base <= 0.0:
        raise ValueError("two different sizes at least are needed")
    fixed, each = (one * bb - two * ab) / base, (two * aa - one * ab) / base
    if fixed < 0.0:
        return 0.0, two / bb
    return (fixed, each) if each >= 0.0 else (one / aa, 0.0)
