"""ANDs, ORs and hedges: their names, and what each makes of degrees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, Protocol

from fuzzytree.model.algebra import N, Numbers, square

TNorm = Literal[
    "minimum",
    "product",
    "bounded difference",
    "drastic product",
    "einstein product",
    "hamacher product",
    "nilpotent minimum",
]
"""An AND. With a and b: min; a b; max(0, a + b - 1); min(a, b) if max(a, b) = 1, else
0; a b / (2 - (a + b - a b)); a b / (a + b - a b), 0 if both are 0; min(a, b) if
a + b > 1, else 0."""

SNorm = Literal[
    "maximum",
    "algebraic sum",
    "bounded sum",
    "drastic sum",
    "einstein sum",
    "hamacher sum",
    "nilpotent maximum",
    "normalized sum",
    "sum",
]
"""An OR. With a and b: max; a + b - a b; min(1, a + b); max(a, b) if min(a, b) = 0,
else 1; (a + b) / (1 + a b); (a + b - 2 a b) / (1 - a b), 1 if a b = 1; max(a, b) if
a + b < 1, else 1; (a + b) / max(1, a + b); a + b."""

Hedge = Literal[
    "any",
    "not",
    "very",
    "somewhat",
    "extremely",
    "seldom",
    "cubed",
    "very very",
    "plus",
    "minus",
    "cube root",
]
"""What is done to a degree d: 1; 1 - d; d d; sqrt(d); 2 d d up to 1/2, then
1 - 2 (1 - d)(1 - d); sqrt(d / 2) up to 1/2, then 1 - sqrt((1 - d) / 2); d d d;
(d d)(d d); d^1.25; d^0.75; d^(1/3)."""


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


def _fourth(n: Numbers[N], d: N) -> N:
    del n
    return square(square(d))


_HEDGES: Mapping[Hedge, _Hedging] = {
    "any": lambda n, _: n.constant(1.0),
    "not": lambda _, d: 1.0 - d,
    "very": lambda _, d: d * d,
    "somewhat": lambda n, d: n.root(d),
    "extremely": _extremely,
    "seldom": _seldom,
    "cubed": lambda _, d: d * d * d,
    "very very": _fourth,
    "plus": lambda n, d: n.power(d, 1.25),
    "minus": lambda n, d: n.power(d, 0.75),
    "cube root": lambda n, d: n.power(d, 1.0 / 3.0),
}


def _hamacher_product(n: Numbers[N], a: N, b: N) -> N:
    share = n.divide(a * b, a + b - a * b)
    return n.where(n.equal(a + b, 0.0), 0.0, share)


def _hamacher_sum(n: Numbers[N], a: N, b: N) -> N:
    share = n.divide(a + b - 2.0 * (a * b), 1.0 - a * b)
    return n.where(n.equal(a * b, 1.0), 1.0, share)


T_NORMS: Mapping[TNorm, Norm] = {
    "minimum": lambda n, a, b: n.minimum(a, b),
    "product": lambda n, a, b: a * b,
    "bounded difference": lambda n, a, b: n.maximum(n.constant(0.0), a + b - 1.0),
    "drastic product": lambda n, a, b: n.where(
        n.equal(n.maximum(a, b), 1.0), n.minimum(a, b), 0.0
    ),
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
    "drastic sum": lambda n, a, b: n.where(
        n.equal(n.minimum(a, b), 0.0), n.maximum(a, b), 1.0
    ),
    "einstein sum": lambda n, a, b: n.divide(a + b, 1.0 + a * b),
    "hamacher sum": _hamacher_sum,
    "nilpotent maximum": lambda n, a, b: n.where(
        n.less(a + b, 1.0), n.maximum(a, b), 1.0
    ),
    "normalized sum": lambda n, a, b: n.divide(a + b, n.maximum(1.0, a + b)),
    "sum": lambda n, a, b: a + b,
}
