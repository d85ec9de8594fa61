"""ANDs, ORs and hedges, and the activation of rules as steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from fuzzytree.model import Activation, Hedge, SNorm, TNorm
from fuzzytree.semantics.programs.operations import N, Numbers
from fuzzytree.semantics.programs.steps import Maker


class Norm(Protocol):
    """An AND or an OR of two degrees."""

    def __call__(self, make: Numbers[N], a: N, b: N, /) -> N:
        """Return what it makes of two degrees."""
        ...


class _Hedging(Protocol):
    def __call__(self, make: Numbers[N], degree: N, /) -> N: ...


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


def hedged(make: Numbers[N], hedges: Sequence[Hedge], degree: N) -> N:
    """Return what hedges make of a degree, the last first."""
    for hedge in reversed(hedges):
        degree = _HEDGES[hedge](make, degree)
    return degree


def _one_minus(make: Numbers[N], a: N) -> N:
    return make("subtract", make.constant(1.0), a)


def _twice(make: Numbers[N], a: N) -> N:
    return make("multiply", make.constant(2.0), a)


def _half(make: Numbers[N], a: N) -> N:
    return make("multiply", make.constant(0.5), a)


def _square(make: Numbers[N], a: N) -> N:
    return make("multiply", a, a)


def _cubed(make: Numbers[N], a: N) -> N:
    return make("multiply", _square(make, a), a)


def _fourth(make: Numbers[N], a: N) -> N:
    return _square(make, _square(make, a))


def _in_halves(make: Numbers[N], d: N, low: N, high: N) -> N:
    return make("where", make("at_most", d, make.constant(0.5)), low, high)


def _extremely(make: Numbers[N], d: N) -> N:
    low = _twice(make, _square(make, d))
    high = _one_minus(make, _twice(make, _square(make, _one_minus(make, d))))
    return _in_halves(make, d, low, high)


def _seldom(make: Numbers[N], d: N) -> N:
    low = make("square_root", _half(make, d))
    root = make("square_root", _half(make, _one_minus(make, d)))
    return _in_halves(make, d, low, _one_minus(make, root))


_HEDGES: Mapping[Hedge, _Hedging] = {
    "any": lambda make, d: make.constant(1.0),
    "not": _one_minus,
    "very": _square,
    "somewhat": lambda make, d: make("square_root", d),
    "extremely": _extremely,
    "seldom": _seldom,
    "cubed": _cubed,
    "very very": _fourth,
    "plus": lambda make, d: make("power", d, make.constant(1.25)),
    "minus": lambda make, d: make("power", d, make.constant(0.75)),
    "cube root": lambda make, d: make("power", d, make.constant(1.0 / 3.0)),
}


def _sum_less_product(make: Numbers[N], a: N, b: N) -> N:
    return make("subtract", make("add", a, b), make("multiply", a, b))


def _bounded_difference(make: Numbers[N], a: N, b: N) -> N:
    rest = make("subtract", make("add", a, b), make.constant(1.0))
    return make("maximum", make.constant(0.0), rest)


def _drastic_product(make: Numbers[N], a: N, b: N) -> N:
    is_one = make("equal", make("maximum", a, b), make.constant(1.0))
    return make("where", is_one, make("minimum", a, b), make.constant(0.0))


def _einstein_product(make: Numbers[N], a: N, b: N) -> N:
    below = make("subtract", make.constant(2.0), _sum_less_product(make, a, b))
    return make("divide", make("multiply", a, b), below)


def _hamacher_product(make: Numbers[N], a: N, b: N) -> N:
    zero = make.constant(0.0)
    share = make("divide", make("multiply", a, b), _sum_less_product(make, a, b))
    return make("where", make("equal", make("add", a, b), zero), zero, share)


def _nilpotent_minimum(make: Numbers[N], a: N, b: N) -> N:
    is_above = make("less", make.constant(1.0), make("add", a, b))
    return make("where", is_above, make("minimum", a, b), make.constant(0.0))


def _drastic_sum(make: Numbers[N], a: N, b: N) -> N:
    is_zero = make("equal", make("minimum", a, b), make.constant(0.0))
    return make("where", is_zero, make("maximum", a, b), make.constant(1.0))


def _einstein_sum(make: Numbers[N], a: N, b: N) -> N:
    below = make("add", make.constant(1.0), make("multiply", a, b))
    return make("divide", make("add", a, b), below)


def _hamacher_sum(make: Numbers[N], a: N, b: N) -> N:
    one, product = make.constant(1.0), make("multiply", a, b)
    above = make("subtract", make("add", a, b), _twice(make, product))
    share = make("divide", above, make("subtract", one, product))
    return make("where", make("equal", product, one), one, share)


def _nilpotent_maximum(make: Numbers[N], a: N, b: N) -> N:
    one = make.constant(1.0)
    is_below = make("less", make("add", a, b), one)
    return make("where", is_below, make("maximum", a, b), one)


def _normalized_sum(make: Numbers[N], a: N, b: N) -> N:
    both = make("add", a, b)
    return make("divide", both, make("maximum", make.constant(1.0), both))


T_NORMS: Mapping[TNorm, Norm] = {
    "minimum": lambda make, a, b: make("minimum", a, b),
    "product": lambda make, a, b: make("multiply", a, b),
    "bounded difference": _bounded_difference,
    "drastic product": _drastic_product,
    "einstein product": _einstein_product,
    "hamacher product": _hamacher_product,
    "nilpotent minimum": _nilpotent_minimum,
}

S_NORMS: Mapping[SNorm, Norm] = {
    "maximum": lambda make, a, b: make("maximum", a, b),
    "algebraic sum": _sum_less_product,
    "bounded sum": lambda make, a, b: make(
        "minimum", make.constant(1.0), make("add", a, b)
    ),
    "drastic sum": _drastic_sum,
    "einstein sum": _einstein_sum,
    "hamacher sum": _hamacher_sum,
    "nilpotent maximum": _nilpotent_maximum,
    "normalized sum": _normalized_sum,
    "sum": lambda make, a, b: make("add", a, b),
}


def positive(make: Maker, degree: int) -> int:
    """Return a degree where it is above 0, else 0."""
    zero = make.constant(0.0)
    return make("where", make("less", zero, degree), degree, zero)


def passes(make: Numbers[N], how: Activation, degree: N) -> N | None:
    """Return whether a degree stands the block's threshold; None if there is none."""
    limit = make.constant(how.threshold)
    match how.method:
        case "first" | "last":
            return make("at_most", limit, degree)
        case "threshold":
            match how.relation:
                case "<":
                    return make("less", degree, limit)
                case "<=":
                    return make("at_most", degree, limit)
                case "==":
                    return make("equal", degree, limit)
                case "!=":
                    return make("not", make("equal", degree, limit))
                case ">=":
                    return make("at_most", limit, degree)
                case ">":
                    return make("less", limit, degree)
        case _:
            return None


def proportional(make: Maker, degrees: Sequence[int]) -> list[int]:
    """Return each positive degree divided by their sum."""
    zero = make.constant(0.0)
    total = make.chain("add", [positive(make, degree) for degree in degrees])
    return [
        make("where", make("less", zero, degree), make("divide", degree, total), zero)
        for degree in degrees
    ]


def ranked(make: Maker, how: Activation, degrees: Sequence[int]) -> list[int]:
    """Return the `count` highest or lowest of the positive degrees, 0 for the others.

    One after another is chosen; of equal ones the first.
    """
    zero = make.constant(0.0)
    if how.count >= len(degrees):
        return [positive(make, degree) for degree in degrees]
    is_highest = how.method == "highest"
    outside = make.constant(-1.0 if is_highest else float("inf"))
    left = [make("less", zero, degree) for degree in degrees]
    chosen: list[int | None] = [None] * len(degrees)
    for _ in range(how.count):
        pairs = list(zip(left, degrees, strict=True))
        values = [make("where", free, degree, outside) for free, degree in pairs]
        best = make.chain("maximum" if is_highest else "minimum", values)
        earlier: int | None = None
        for index, (free, degree) in enumerate(pairs):
            hit = make("and", free, make("equal", degree, best))
            is_first = (
                hit if earlier is None else make("and", hit, make("not", earlier))
            )
            earlier = hit if earlier is None else make("or", earlier, hit)
            before = chosen[index]
            chosen[index] = is_first if before is None else make("or", before, is_first)
            left[index] = make("and", free, make("not", is_first))
    return [
        degree if one is None else make("where", one, degree, zero)
        for one, degree in zip(chosen, degrees, strict=True)
    ]
