"""Which rules of a block are activated, as steps."""

from __future__ import annotations

from collections.abc import Sequence

from fuzzytree.model import Activation, N, Numbers
from fuzzytree.semantics.programs.steps import Maker, Place


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
