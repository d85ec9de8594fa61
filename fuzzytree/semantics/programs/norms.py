"""ANDs, ORs and hedges, and the activation of rules as steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from fuzzytree.model import Activation, Hedge, N, Numbers, SNorm, TNorm, square
from fuzzytree.semantics.programs.steps import Maker, Place


class Norm(Protocol):
    """An AND or an OR of two degrees."""

    def __call__(self, n: Numbers[N], a: N, b: N, /) -> N:
        """Return what it makes of two degrees."""
        ...


class _Hedging(Protocol):
    def __call__(self, n: Numbers[N], degree: N, /) -> N: ...


KEEPS_UNIT: frozenset[str] = frozenset(
    (
        "minimum",
        "product",
        "bounded difference",
        "drastic product",
        "nilpotent minimum",
        "maximum",
        "bounded sum",
        "drastic sum",
        "nilpotent maximum",
        "normalized sum",
    )
)
"""Norms whose result lies in [0, 1] if both degrees do, in rounded numbers too."""


def hedged(n: Numbers[N], hedges: Sequence[Hedge], degree: N) -> N:
    """Return what hedges make of a degree, the last first."""
    for hedge in reversed(hedges):
        degree = _HEDGES[hedge](n, degree)
    return degree


def _extremely(n: Numbers[N], d: N) -> N:
    high = 1.0 - 2.0 * square(1.0 - d)
    return n.where(n.at_most(d, 0.5), 2.0 * square(d), high)


def _seldom(n: Numbers[N], d: N) -> N:
    high = 1.0 - n.root(0.5 * (1.0 - d))
    return n.where(n.at_most(d, 0.5), n.root(0.5 * d), high)


def _any(n: Numbers[N], d: N) -> N:
    del d
    return n.constant(1.0)


def _not(n: Numbers[N], d: N) -> N:
    del n
    return 1.0 - d


def _very(n: Numbers[N], d: N) -> N:
    del n
    return square(d)


def _cubed(n: Numbers[N], d: N) -> N:
    del n
    return square(d) * d


def _fourth(n: Numbers[N], d: N) -> N:
    del n
    return square(square(d))


_HEDGES: Mapping[Hedge, _Hedging] = {
    "any": _any,
    "not": _not,
    "very": _very,
    "somewhat": lambda n, d: n.root(d),
    "extremely": _extremely,
    "seldom": _seldom,
    "cubed": _cubed,
    "very very": _fourth,
    "plus": lambda n, d: n.power(d, 1.25),
    "minus": lambda n, d: n.power(d, 0.75),
    "cube root": lambda n, d: n.power(d, 1.0 / 3.0),
}


def _drastic_product(n: Numbers[N], a: N, b: N) -> N:
    is_one = n.equal(n.maximum(a, b), 1.0)
    return n.where(is_one, n.minimum(a, b), 0.0)


def _hamacher_product(n: Numbers[N], a: N, b: N) -> N:
    share = n.divide(a * b, a + b - a * b)
    return n.where(n.equal(a + b, 0.0), 0.0, share)


def _drastic_sum(n: Numbers[N], a: N, b: N) -> N:
    is_zero = n.equal(n.minimum(a, b), 0.0)
    return n.where(is_zero, n.maximum(a, b), 1.0)


def _hamacher_sum(n: Numbers[N], a: N, b: N) -> N:
    share = n.divide(a + b - 2.0 * (a * b), 1.0 - a * b)
    return n.where(n.equal(a * b, 1.0), 1.0, share)


T_NORMS: Mapping[TNorm, Norm] = {
    "minimum": lambda n, a, b: n.minimum(a, b),
    "product": lambda n, a, b: a * b,
    "bounded difference": lambda n, a, b: n.maximum(n.constant(0.0), a + b - 1.0),
    "drastic product": _drastic_product,
    "einstein product": lambda n, a, b: n.divide(a * b, 2.0 - (a + b - a * b)),
    "hamacher product": _hamacher_product,
    "nilpotent minimum": lambda n, a, b: n.where(
        n.less(1.0, a + b), n.minimum(a, b), 0.0
    ),
}

S_NORMS: Mapping[SNorm, Norm] = {
    "maximum": lambda n, a, b: n.maximum(a, b),
    "algebraic sum": lambda n, a, b: a + b - a * b,
    "bounded sum": lambda n, a, b: n.minimum(n.constant(1.0), a + b),
    "drastic sum": _drastic_sum,
    "einstein sum": lambda n, a, b: n.divide(a + b, 1.0 + a * b),
    "hamacher sum": _hamacher_sum,
    "nilpotent maximum": lambda n, a, b: n.where(
        n.less(a + b, 1.0), n.maximum(a, b), 1.0
    ),
    "normalized sum": lambda n, a, b: n.divide(a + b, n.maximum(1.0, a + b)),
    "sum": lambda n, a, b: a + b,
}


def positive(make: Maker, degree: Place) -> Place:
    """Return a degree where it is above 0, else 0."""
    return make.where(make.less(0.0, degree), degree, 0.0)


def passes(n: Numbers[N], how: Activation, degree: N) -> N | None:
    """Return whether a degree stands the block's threshold; None if there is none."""
    limit = how.threshold
    match how.method:
        case "first" | "last":
            return n.at_most(limit, degree)
        case "threshold":
            match how.relation:
                case "<":
                    return n.less(degree, limit)
                case "<=":
                    return n.at_most(degree, limit)
                case "==":
                    return n.equal(degree, limit)
                case "!=":
                    return n("not", n.equal(degree, limit))
                case ">=":
                    return n.at_most(limit, degree)
                case ">":
                    return n.less(limit, degree)
        case _:
            return None


def proportional(make: Maker, degrees: Sequence[Place]) -> list[Place]:
    """Return each positive degree divided by their sum."""
    total = make.chain("add", [positive(make, degree) for degree in degrees])
    return [
        make.where(make.less(0.0, degree), degree / total, 0.0) for degree in degrees
    ]


def ranked(make: Maker, how: Activation, degrees: Sequence[Place]) -> list[Place]:
    """Return the `count` highest or lowest of the positive degrees, 0 for the others.

    One after another is chosen; of equal ones the first.
    """
    if how.count >= len(degrees):
        return [positive(make, degree) for degree in degrees]
    is_highest = how.method == "highest"
    outside = -1.0 if is_highest else float("inf")
    left = [make.less(0.0, degree) for degree in degrees]
    chosen: list[Place | None] = [None] * len(degrees)
    for _ in range(how.count):
        pairs = list(zip(left, degrees, strict=True))
        values = [make.where(free, degree, outside) for free, degree in pairs]
        best = make.chain("maximum" if is_highest else "minimum", values)
        earlier: Place | None = None
        for index, (free, degree) in enumerate(pairs):
            hit = make("and", free, make.equal(degree, best))
            is_first = (
                hit if earlier is None else make("and", hit, make("not", earlier))
            )
            earlier = hit if earlier is None else make("or", earlier, hit)
            before = chosen[index]
            chosen[index] = is_first if before is None else make("or", before, is_first)
            left[index] = make("and", free, make("not", is_first))
    return [
        degree if one is None else make.where(one, degree, 0.0)
        for one, degree in zip(chosen, degrees, strict=True)
    ]
