"""From the degrees of an output's curve at its samples to a number, as steps."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence

from fuzzytree.model.system import Singleton, SystemOutput, sampled_values
from fuzzytree.semantics.inference import Lines
from fuzzytree.semantics.programs.formulas import as_number
from fuzzytree.semantics.programs.steps import Maker


def samples_of(make: Maker, output: SystemOutput) -> int:
    """Return the values at which an output's curve is sampled."""
    if any(isinstance(label.curve, Singleton) for label in output.labels):
        values = sampled_values(output)
        return make.table("pick", make.index(len(values)), values)
    low, high = output.low or 0.0, output.high or 0.0
    count = output.defuzzifier.samples
    index, start = make.index(count), make.constant(low)
    if output.defuzzifier.grid == "middle":
        step = make.constant((high - low) / count)
        middle = make("add", index, make.constant(0.5))
        return make("add", start, make("multiply", middle, step))
    step = make.constant((high - low) / (count - 1))
    value = make("add", start, make("multiply", index, step))
    is_last = make("equal", index, make.constant(float(count - 1)))
    return make("where", is_last, make.constant(high), value)


def defuzzified(make: Maker, output: SystemOutput, xs: int, degrees: int) -> int:
    """Return an output's number; NaN if the curve is 0 everywhere."""
    method = output.defuzzifier.method
    if method in ("centroid", "bisector"):
        areas = _areas(make, output, degrees)
        if method == "bisector":
            return _bisector(make, xs, areas)
        moments = make("total", make("multiply", xs, areas))
        return make("divide", moments, make("total", areas))
    highest = make("highest", degrees)
    chosen = make("equal", degrees, highest)
    if method == "mean of maximum":
        found = _mean(make, xs, chosen)
    else:
        found = _end(make, output, xs, chosen, is_first=method.startswith("smallest"))
    is_any = make("less", make.constant(0.0), highest)
    return make("where", is_any, found, make.constant(math.nan))


def centroid_of_lines(
    make: Maker, output: SystemOutput, cuts: Sequence[tuple[int, Lines]]
) -> int:
    """Return an output's centroid on the grid `lines`, of its labels' degrees."""
    xs = sampled_values(output)
    index = make.index(len(xs) - 1)

    def row(numbers: Iterable[float]) -> int:
        return make.table("pick", index, [*numbers])

    zero, one = make.constant(0.0), make.constant(1.0)
    sides = [(degree, row(line.left), row(line.rise)) for degree, line in cuts]
    shares: list[int] = []
    for degree, line in cuts:
        above = make("subtract", degree, row(line.level))
        share = make("add", row(line.start), make("multiply", above, row(line.slope)))
        shares.append(make("minimum", make("maximum", share, zero), one))
    shares = [zero, *_sorted(make, shares), one]
    heights: list[int] = []
    for share in shares:
        lines = [
            (cut, make("add", y, make("multiply", share, r))) for cut, y, r in sides
        ]
        heights.append(make.chain("maximum", [make("minimum", *one) for one in lines]))
    areas: list[int] = []
    moments: list[int] = []
    points = itertools.pairwise(zip(shares, heights, strict=True))
    for (share, low), (after, high) in points:
        width, both = make("subtract", after, share), make("add", low, high)
        areas.append(make("multiply", width, both))
        first = make("multiply", share, make("add", low, both))
        second = make("multiply", after, make("add", high, both))
        moments.append(make("multiply", width, make("add", first, second)))
    area, moment = make.chain("add", areas), make.chain("add", moments)
    width = row(right - left for left, right in itertools.pairwise(xs))
    inside = make("divide", make("multiply", width, moment), make.constant(3.0))
    around = make("add", make("multiply", row(xs[:-1]), area), inside)
    total = make("total", make("multiply", width, around))
    return make("divide", total, make("total", make("multiply", width, area)))


def _sorted(make: Maker, numbers: Sequence[int]) -> list[int]:
    """Return numbers in rising order, by exchanging neighbours."""
    found = [*numbers]
    for last in range(len(found) - 1, 0, -1):
        for k in range(last):
            pair = found[k], found[k + 1]
            found[k], found[k + 1] = make("minimum", *pair), make("maximum", *pair)
    return found


def _areas(make: Maker, output: SystemOutput, degrees: int) -> int:
    """Return how much each sample counts: its degree, half of it at `half ends`."""
    if output.defuzzifier.grid != "half ends":
        return degrees
    count = output.defuzzifier.samples
    index, last = make.index(count), make.constant(float(count - 1))
    is_end = make("equal", index, make.constant(0.0))
    is_end = make("or", is_end, make("equal", index, last))
    share = make("where", is_end, make.constant(0.5), make.constant(1.0))
    return make("multiply", share, degrees)


def _bisector(make: Maker, xs: int, areas: int) -> int:
    """Return the mean of the samples that part the area most evenly.

    Where a share is NaN so is the lowest miss, which no miss equals: 0 / 0 then.
    """
    sums = make("running", areas)
    share = make("divide", sums, make("last", sums))
    misses = make("absolute", make("subtract", share, make.constant(0.5)))
    return _mean(make, xs, make("equal", misses, make("lowest", misses)))


def _mean(make: Maker, xs: int, chosen: int) -> int:
    kept = make("where", chosen, xs, make.constant(0.0))
    return make("divide", make("total", kept), make("total", as_number(make, chosen)))


def _end(
    make: Maker, output: SystemOutput, xs: int, chosen: int, *, is_first: bool
) -> int:
    """Return the first or the last of the chosen samples."""
    outside = make.constant(math.inf if is_first else -math.inf)
    find = "lowest" if is_first else "highest"
    numbers = sampled_values(output)
    if all(one <= two for one, two in itertools.pairwise(numbers)):
        return make(find, make("where", chosen, xs, outside))
    # A range of a few neighbouring doubles: its samples need not rise.
    index = make.index(len(numbers))
    return make.table(
        "pick", make(find, make("where", chosen, index, outside)), numbers
    )
