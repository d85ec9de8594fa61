"""Which rules of a block are activated (`model.system.Activation`), as steps."""

from __future__ import annotations

from collections.abc import Sequence

from fuzzytree.model.system import Activation
from fuzzytree.semantics.programs.steps import Maker


def positive(make: Maker, degree: int) -> int:
    """Return a degree where it is above 0, else 0."""
    zero = make.constant(0.0)
    return make("where", make("less", zero, degree), degree, zero)


def passes(make: Maker, how: Activation, degree: int) -> int | None:
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
        seen: int | None = None
        for index, (free, degree) in enumerate(pairs):
            hit = make("and", free, make("equal", degree, best))
            is_first = hit if seen is None else make("and", hit, make("not", seen))
            seen = hit if seen is None else make("or", seen, hit)
            before = chosen[index]
            chosen[index] = is_first if before is None else make("or", before, is_first)
            left[index] = make("and", free, make("not", is_first))
    return [
        degree if one is None else make("where", one, degree, zero)
        for one, degree in zip(chosen, degrees, strict=True)
    ]
