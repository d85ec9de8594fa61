"""Tautologies and contradictions: what is always true, and rules that never fire.

What is reported is certain, in rounded numbers of every type; a proposition that is not
reported may be always true all the same, and a rule may never fire.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial

from fuzzytree.model import (
    LR,
    Band,
    Points,
    Proposition,
    RuleBase,
    Shape,
    proposition_text,
    shapes_of,
)

_SLACK = 1e-6  # relative; more than rounding moves a support's end, in float32 too

Spans = tuple[tuple[float, float], ...]
"""Disjoint intervals in ascending order, each open below and closed above."""

EVERYWHERE: Spans = ((-math.inf, math.inf),)


def always_holds(
    proposition: Proposition, shapes: Mapping[tuple[str, str], Shape]
) -> bool:
    """Return whether a proposition has degree 1 for every value.

    Example:
        >>> always_holds(Proposition("x", ("any",)), {("x", "any"): Band()})
        True
    """
    of = [shapes[proposition.variable, term] for term in proposition.terms]
    if proposition.negated:
        return not _union(span for shape in of for span in _support(shape))
    return _union(span for shape in of for span in _plateau(shape)) == EVERYWHERE


def never_firing(rules: RuleBase) -> dict[int, str]:
    """Return the rules whose strength is 0 for every input, and why.

    A proposition has degree 0 outside its spans, in rounded numbers of every type;
    where the spans of all propositions on one variable have no value in common, min and
    product are 0. That is sufficient: a rule that relations between variables keep from
    firing is not found.

    Example:
        >>> from fuzzytree.model.rulebase import Rule, Term, Variable
        >>> low, high = Term("low", Band(high=1.0)), Term("high", Band(low=1.0))
        >>> both = (Proposition("x", ("low",)), Proposition("x", ("high",)))
        >>> rules = (Rule(both, "a"), Rule((), "a"))
        >>> never_firing(RuleBase("r", ("a",), (Variable("x", (low, high)),), rules))
        {1: 'x is low AND x is high never hold together'}
    """
    holding = functools.cache(partial(_holding, shapes=shapes_of(rules.variables)))
    results: dict[int, str] = {}
    for number, rule in enumerate(rules.rules, 1):
        by_variable: dict[str, list[Proposition]] = {}
        for proposition in rule.when:
            by_variable.setdefault(proposition.variable, []).append(proposition)
        for propositions in by_variable.values():
            left = EVERYWHERE
            for proposition in propositions:
                left = _both(left, holding(proposition))
            if not left:
                texts = " AND ".join(map(proposition_text, propositions))
                verb = (
                    "never holds" if len(propositions) == 1 else "never hold together"
                )
                results[number] = f"{texts} {verb}"
                break
    return results


def _holding(
    proposition: Proposition, shapes: Mapping[tuple[str, str], Shape]
) -> Spans:
    """Return spans outside of which a proposition has degree exactly 0."""
    of = [shapes[proposition.variable, term] for term in proposition.terms]
    if proposition.negated:
        return _others(_union(span for shape in of for span in _plateau(shape)))
    return _union(span for shape in of for span in _support(shape))


def _support(shape: Shape) -> Spans:
    """Return spans outside of which a degree is exactly 0."""
    match shape:
        case Band(low=low, high=high, left=left, right=right):
            first = -math.inf if low is None else low
            last = math.inf if high is None else high
            if left is not None:
                first = min(first, left)
            if right is not None:
                last = max(last, right)
            return ((first, last),)
        case LR(mean=mean, left=below, right=above):
            down, up = below.spread * below.reach, above.spread * above.reach
            slack = _SLACK * (abs(mean) + max(down, up))
            return ((mean - down - slack, mean + up + slack),)
        case Points():
            return _union(_pieces(shape, lambda one, two: one > 0.0 or two > 0.0))


def _plateau(shape: Shape) -> Spans:
    """Return spans within which a degree is exactly 1; not all of them need be."""
    match shape:
        case Band(low=low, high=high):
            first = -math.inf if low is None else low
            return ((first, math.inf if high is None else high),)
        case LR():
            return ()
        case Points():
            return _union(_pieces(shape, lambda one, two: one == two == 1.0))


def _pieces(
    points: Points, is_wanted: Callable[[float, float], bool]
) -> Iterator[tuple[float, float]]:
    """Yield the pieces of a line whose degrees at both ends are as wanted."""
    values = (-math.inf, *points.values, math.inf)
    degrees = (points.degrees[0], *points.degrees, points.degrees[-1])
    ends = zip(itertools.pairwise(values), itertools.pairwise(degrees), strict=True)
    return (span for span, (one, two) in ends if is_wanted(one, two))


def _union(spans: Iterable[tuple[float, float]]) -> Spans:
    """Return all values of some spans as disjoint spans in ascending order.

    Example:
        >>> _union([(2.0, 3.0), (0.0, 1.0), (1.0, 2.0), (5.0, 5.0)])
        ((0.0, 3.0),)
    """
    merged: list[tuple[float, float]] = []
    for low, high in sorted(spans):
        if low >= high:
            continue
        if merged and low <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(high, merged[-1][1]))
        else:
            merged.append((low, high))
    return tuple(merged)


def _others(spans: Spans) -> Spans:
    """Return all values outside of spans."""
    edges = [-math.inf, *itertools.chain.from_iterable(spans), math.inf]
    return _union(zip(edges[::2], edges[1::2], strict=True))


def _both(one: Spans, two: Spans) -> Spans:
    """Return the values that lie in both of two unions of spans."""
    return _union(
        (max(a, c), min(b, d)) for a, b in one for c, d in two if max(a, c) < min(b, d)
    )
