"""Points that satisfy linear inequalities, decided in fractions.

Pivots follow Bland's rule, so that none comes back.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.decide.domain import linear_form
from fuzzytree.model import Variable, checkpoint

ZERO, ONE = Fraction(0), Fraction(1)

_MOST_DIGITS = 17  # these distinguish every double from its neighbours


class Row(NamedTuple):
    """An inequality: `low <= sum of weights[i] x_i <= high`."""

    weights: Mapping[int, Fraction]  # by the number of the variable, from 0
    low: Fraction | None = None  # the lower bound; None if there is none
    high: Fraction | None = None  # the upper bound; None if there is none
    is_open_low: bool = False  # whether the sum must be strictly above `low`
    is_open_high: bool = False  # whether the sum must be strictly below `high`


Range = tuple[Fraction, Fraction]
"""The least and the largest value of a variable."""

_Bound = tuple[Fraction | None, Fraction | None]


def row_of(
    variable: Variable,
    number: Mapping[str, int],
    ends: Sequence[Fraction],
    *,
    is_open_low: bool = False,
    is_open_high: bool = False,
) -> Row:
    """Return that a variable lies between two ends, as a row of the inputs."""
    weights, constant = linear_form(variable, number)
    low, high = ends
    return Row(weights, low - constant, high - constant, is_open_low, is_open_high)


def feasible(ranges: Sequence[Range], rows: Sequence[Row]) -> list[Fraction] | None:
    """Return a point that satisfies all inequalities, or None if there is none.

    The point lies deep inside those that are strict: the least of their slacks, in
    shares of what the row can reach, is at least half of the largest possible one. Its
    coordinates are doubles of few digits where that leaves it inside.

    Example:
        >>> unit = (Fraction(0), Fraction(1))
        >>> both = Row({0: Fraction(1), 1: Fraction(1)}, low=Fraction(2))
        >>> feasible([unit, unit], [both])
        [Fraction(1, 1), Fraction(1, 1)]
        >>> feasible([unit, unit], [both._replace(is_open_low=True)]) is None
        True
    """
    if any(low > high for low, high in ranges):
        return None
    reaches = [_reach(ranges, row) for row in rows]
    tableau = _Tableau(ranges, rows, reaches)
    if not tableau.repair():
        return None
    slack = ZERO
    if any(row.is_open_low or row.is_open_high for row in rows):
        slack = tableau.raise_slack()
        if slack <= 0:
            return None
    point = tableau.values[: len(ranges)]
    kept = [
        _close(row, slack / 2 * reach) for row, reach in zip(rows, reaches, strict=True)
    ]
    return _simplify(point, ranges, kept)


def least_radius(
    centre: Sequence[Fraction],
    widths: Sequence[Fraction | None],
    limits: Sequence[Range],
    rows: Sequence[Row],
    low: Fraction,
) -> Fraction | None:
    """Return the least radius of a box around a centre that satisfies all inequalities.

    Where a box does not, a sum of the rows says so, which gives the next radius.

    Args:
        centre: The middle of the box.
        widths: How far each variable moves for a radius of 1; None if freely.
        limits: Within which variables move; boxes from `low` on reach into them.
        rows: The inequalities; open ends count as closed ones.
        low: The least radius that counts.

    Returns:
        None if nothing within the limits satisfies the inequalities.

    Example:
        >>> unit = (Fraction(0), Fraction(1))
        >>> both = Row({0: Fraction(1), 1: Fraction(2)}, low=Fraction(2))
        >>> str(least_radius([ZERO, ZERO], [ONE, ONE], [unit, unit], [both], ZERO))
        '2/3'
    """
    closed = [_close(row, ZERO) for row in rows]
    while True:
        box = [
            ends
            if width is None
            else (max(ends[0], x - low * width), min(ends[1], x + low * width))
            for ends, x, width in zip(limits, centre, widths, strict=True)
        ]
        tableau = _Tableau(box, closed, [ONE] * len(closed))
        if tableau.repair():
            return low
        weights, goal = tableau.conflict()
        room: list[tuple[Fraction, Fraction]] = []  # the radius that spends it, per 1
        for place, weight in weights.items():
            end, x, width = limits[place][weight > 0], centre[place], widths[place]
            if width is None or (end - x) * weight <= 0:
                goal -= weight * end
            else:
                goal -= weight * x
                room.append((abs(end - x) / width, abs(weight) * width))
        slope = sum((rate for _, rate in room), ZERO)
        for radius, rate in sorted(room):
            if slope * radius >= goal:
                break
            goal -= rate * radius
            slope -= rate
        if not slope:
            return None
        low = goal / slope


def holds(row: Row, values: Sequence[Fraction]) -> bool:
    """Return whether an inequality holds for some values of the variables."""
    total = sum((w * values[i] for i, w in row.weights.items()), ZERO)
    if row.low is not None and (
        total < row.low or (row.is_open_low and total == row.low)
    ):
        return False
    return row.high is None or not (
        total > row.high or (row.is_open_high and total == row.high)
    )


def _reach(ranges: Sequence[Range], row: Row) -> Fraction:
    """Return how far a row's sum varies within the ranges; 1 if it does not."""
    spans = (abs(w) * (ranges[i][1] - ranges[i][0]) for i, w in row.weights.items())
    return sum(spans, ZERO) or ONE


def _close(row: Row, slack: Fraction) -> Row:
    """Return a row whose strict sides are drawn in by a slack, and closed."""
    low, high = row.low, row.high
    if row.is_open_low and low is not None:
        low += slack
    if row.is_open_high and high is not None:
        high -= slack
    return Row(row.weights, low, high)


def _simplify(
    point: list[Fraction], ranges: Sequence[Range], rows: Sequence[Row]
) -> list[Fraction]:
    """Return a point of few digits that satisfies the rows as well, one by one."""
    result = list(point)
    totals = [
        sum((w * result[i] for i, w in row.weights.items()), ZERO) for row in rows
    ]
    for place, (least, most) in enumerate(ranges):
        low, high = least, most
        touched = [n for n, row in enumerate(rows) if row.weights.get(place)]
        for number in touched:
            row, weight = rows[number], rows[number].weights[place]
            ends = [
                None
                if bound is None
                else result[place] + (bound - totals[number]) / weight
                for bound in (row.low, row.high)
            ]
            below, above = ends if weight > 0 else reversed(ends)
            low = low if below is None else max(low, below)
            high = high if above is None else min(high, above)
        step = simple(low, high) - result[place]
        result[place] += step
        for number in touched:
            totals[number] += rows[number].weights[place] * step
    return result


class _Tableau:
    """Variables, the rows' sums and the slack, some of which are sums of the others.

    Attributes:
        values: Of all variables: those given, one for each side of a row, the slack.
    """

    def __init__(
        self, ranges: Sequence[Range], rows: Sequence[Row], reaches: Sequence[Fraction]
    ) -> None:
        sides = [
            side
            for row, reach in zip(rows, reaches, strict=True)
            for side in _sides(row, reach)
        ]
        self.slack = len(ranges) + len(sides)
        self.bounds: list[_Bound] = [
            *ranges,
            *((ZERO, None) for _ in sides),
            (ZERO, ONE),
        ]
        self.values = [(low + high) / 2 for low, high in ranges]
        self.sums: dict[int, dict[int, Fraction]] = {}
        for number, (weights, constant, share) in enumerate(sides, len(ranges)):
            # The side's number is constant + sum - share * slack >= 0; the constant
            # moves into the bound.
            total = sum((w * self.values[i] for i, w in weights.items()), ZERO)
            self.values.append(total)
            self.bounds[number] = (-constant, None)
            terms = {**weights, self.slack: -share}
            self.sums[number] = {i: w for i, w in terms.items() if w}
        self.values.append(ZERO)

    def repair(self) -> bool:
        """Bring every sum within its bounds; return whether that is possible."""
        while True:
            checkpoint()
            broken = next((n for n in sorted(self.sums) if self._gap(n)), None)
            if broken is None:
                return True
            gap = self._gap(broken)
            entering = self._helpful(broken, is_up=gap > 0)
            if entering is None:
                return False
            step = gap / self.sums[broken][entering]
            self._move(entering, step)
            self._pivot(broken, entering)

    def raise_slack(self) -> Fraction:
        """Make the slack as large as possible, from a point that satisfies all."""
        while True:
            checkpoint()
            if self.slack not in self.sums:
                moving, sign = self.slack, 1
            else:
                result = self._helpful(self.slack, is_up=True)
                if result is None:
                    return self.values[self.slack]
                moving = result
                sign = 1 if self.sums[self.slack][result] > 0 else -1
            room, blocking = self._room(moving, sign)
            self._move(moving, sign * room)
            if blocking is not None:
                self._pivot(blocking, moving)
            elif moving == self.slack:
                return self.values[self.slack]

    def conflict(self) -> tuple[dict[int, Fraction], Fraction]:
        """Return weights of the given variables, and what their sum must reach.

        All points of the rows satisfy it; it is why `repair` failed.
        """
        broken = next(n for n in sorted(self.sums) if self._gap(n))
        sign = 1 if self._gap(broken) > 0 else -1
        weights: dict[int, Fraction] = {}
        goal = ZERO
        for number, weight in {broken: -ONE, **self.sums[broken]}.items():
            low, high = self.bounds[number]
            if high is not None:  # a given variable
                weights[number] = sign * weight
            elif low is not None:
                goal -= sign * weight * low
        return weights, goal

    def _gap(self, number: int) -> Fraction:
        """Return what a variable lacks to its bounds: positive if it must rise."""
        low, high = self.bounds[number]
        value = self.values[number]
        if low is not None and value < low:
            return low - value
        if high is not None and value > high:
            return high - value
        return ZERO

    def _helpful(self, number: int, *, is_up: bool) -> int | None:
        """Return the first variable that can move a sum up or down."""
        for other in sorted(self.sums[number]):
            low, high = self.bounds[other]
            rises = (self.sums[number][other] > 0) is is_up
            end = high if rises else low
            if end is None or self.values[other] != end:
                return other
        return None

    def _room(self, moving: int, sign: int) -> tuple[Fraction, int | None]:
        """Return how far a variable can move, and the first sum that stops it."""
        end = self.bounds[moving][sign > 0]
        room = None if end is None else abs(end - self.values[moving])
        blocking = None
        for number in sorted(self.sums):
            weight = self.sums[number].get(moving, 0) * sign
            end = self.bounds[number][weight > 0]
            if not weight or end is None:
                continue
            free = (end - self.values[number]) / weight
            if room is None or free < room:
                room, blocking = free, number
        assert room is not None  # the slack is at most 1
        return room, blocking

    def _move(self, moving: int, step: Fraction) -> None:
        self.values[moving] += step
        for number, terms in self.sums.items():
            if moving in terms:
                self.values[number] += terms[moving] * step

    def _pivot(self, leaving: int, entering: int) -> None:
        """Express the entering variable by the leaving one, and put it in."""
        terms = self.sums.pop(leaving)
        own = terms.pop(entering)
        way = {leaving: 1 / own, **{i: -w / own for i, w in terms.items()}}
        for row in self.sums.values():
            weight = row.pop(entering, ZERO)
            for i, w in way.items() if weight else ():
                row[i] = row.get(i, ZERO) + weight * w
                if not row[i]:
                    del row[i]
        self.sums[entering] = way


def _sides(
    row: Row, reach: Fraction
) -> Iterator[tuple[dict[int, Fraction], Fraction, Fraction]]:
    """Yield weights, constant and share of the slack of what must be at least 0."""
    weights = {i: w for i, w in row.weights.items() if w}
    if row.low is not None:
        yield weights, -row.low, reach if row.is_open_low else ZERO
    if row.high is not None:
        down = {i: -w for i, w in weights.items()}
        yield down, row.high, reach if row.is_open_high else ZERO


def simple(low: Fraction, high: Fraction) -> Fraction:
    """Return the double of the fewest decimal digits strictly between two numbers.

    Of several it is the one nearest to the middle. Without a double between them it is
    the middle itself; of two equal numbers it is that number.

    Raises:
        ValueError: If `low` is above `high`.

    Example:
        >>> float(simple(Fraction(2, 7), Fraction(1, 3)))
        0.3
        >>> float(simple(Fraction(997), Fraction(1003)))
        1000.0
    """
    if low > high:
        raise ValueError(f"no number from {low} to {high}")
    middle = (low + high) / 2
    if low == high:
        return low
    if low < 0 < high:
        return ZERO
    largest = max(-low, high)
    size = len(str(largest.numerator)) - len(str(largest.denominator))
    for power in range(size, size - _MOST_DIGITS - 2, -1):
        unit = Fraction(10) ** power
        result = round(middle / unit) * unit
        if low < (near := _nearest(result)) < high:
            return near
    near = _nearest(middle)
    return near if low < near < high else middle


def _nearest(number: Fraction) -> Fraction:
    try:
        return Fraction(float(number))
    except OverflowError:
        return number
