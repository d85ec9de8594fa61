"""Linear inequalities are decided in fractions."""

import itertools
import random
from collections.abc import Mapping, Sequence
from fractions import Fraction

import pytest

from fuzzytree.auditing.decide.linear import Range, Row, feasible, simple

UNIT = (Fraction(0), Fraction(1))
ONE = Fraction(1)


def _holds(row: Row, point: Sequence[Fraction]) -> bool:
    total = sum((w * point[i] for i, w in row.weights.items()), Fraction(0))
    if row.low is not None and (
        total < row.low or (row.is_open_low and total == row.low)
    ):
        return False
    return not (
        row.high is not None
        and (total > row.high or (row.is_open_high and total == row.high))
    )


def _random_problem(seed: int) -> tuple[list[Range], list[Row]]:
    draw = random.Random(seed)
    size = draw.randint(1, 3)
    ranges = [
        (low, low + Fraction(draw.randint(0, 4)))
        for low in (Fraction(draw.randint(-3, 3)) for _ in range(size))
    ]
    rows = []
    for _ in range(draw.randint(0, 4)):
        picked = draw.sample(range(size), draw.randint(1, size))
        weights = {i: Fraction(draw.choice([-2, -1, 1, 2, 3])) for i in picked}
        low = Fraction(draw.randint(-6, 6))
        below, above = draw.choice(
            [(low, None), (None, low), (low, low + draw.randint(0, 3))]
        )
        is_open_low, is_open_high = draw.random() < 0.5, draw.random() < 0.5
        rows.append(Row(weights, below, above, is_open_low, is_open_high))
    return ranges, rows


def _corners(
    ranges: Sequence[Range], rows: Sequence[Row]
) -> list[tuple[Fraction, ...]]:
    """Return all corners of the closed region: where as many planes meet as needed."""
    size = len(ranges)
    planes: list[tuple[Mapping[int, Fraction], Fraction]] = []
    for i, ends in enumerate(ranges):
        planes += [({i: ONE}, end) for end in ends]
    for row in rows:
        planes += [(row.weights, end) for end in (row.low, row.high) if end is not None]
    closed = [Row(row.weights, row.low, row.high) for row in rows]
    found = []
    for chosen in itertools.combinations(planes, size):
        point = _solved(chosen, size)
        if point is not None and all(
            low <= x <= high for x, (low, high) in zip(point, ranges, strict=True)
        ):
            found += [tuple(point)] if all(_holds(row, point) for row in closed) else []
    return found


def _solved(
    planes: Sequence[tuple[Mapping[int, Fraction], Fraction]], size: int
) -> list[Fraction] | None:
    rows = [
        [Fraction(weights.get(i, 0)) for i in range(size)] + [end]
        for weights, end in planes
    ]
    for place in range(size):
        pivot = next((r for r in range(place, size) if rows[r][place]), None)
        if pivot is None:
            return None
        rows[place], rows[pivot] = rows[pivot], rows[place]
        rows[place] = [one / rows[place][place] for one in rows[place]]
        for other in range(size):
            if other != place:
                factor = rows[other][place]
                rows[other] = [
                    a - factor * b
                    for a, b in zip(rows[other], rows[place], strict=True)
                ]
    return [row[-1] for row in rows]


@pytest.mark.heavy
def test_a_point_is_found_exactly_where_the_corners_show_one() -> None:
    # The mean of all corners is inside each strict row, if any point is.
    seen = {True: 0, False: 0}
    for seed in range(250):
        ranges, rows = _random_problem(seed)
        corners = _corners(ranges, rows)
        expected = bool(corners) and all(
            _holds(
                row,
                [
                    sum(xs, Fraction(0)) / len(corners)
                    for xs in zip(*corners, strict=True)
                ],
            )
            for row in rows
        )
        point = feasible(ranges, rows)
        assert (point is not None) is expected, seed
        seen[expected] += 1
        if point is not None:
            assert all(_holds(row, point) for row in rows), seed
            assert all(
                low <= x <= high for x, (low, high) in zip(point, ranges, strict=True)
            )
    assert min(seen.values()) > 50


def test_many_variables_and_rows_are_decided() -> None:
    draw = random.Random(7)
    ranges = [UNIT] * 15
    centre = [Fraction(draw.random()) for _ in ranges]
    rows = []
    for _ in range(10):
        weights = {i: Fraction(draw.uniform(-1.0, 1.0)) for i in range(15)}
        total = sum((w * centre[i] for i, w in weights.items()), Fraction(0))
        rows.append(Row(weights, total - Fraction(1, 1000), total, True, True))
    point = feasible(ranges, rows)
    assert point is not None
    assert all(_holds(row, point) for row in rows)
    against = Row(rows[0].weights, low=rows[0].high)
    assert feasible(ranges, [*rows, against]) is None


def test_swapped_ranges_hold_no_point() -> None:
    assert feasible([(ONE, Fraction(0))], []) is None


def test_a_point_has_few_digits_where_there_is_room() -> None:
    row = Row({0: Fraction(1, 3), 1: ONE}, low=Fraction(1), is_open_low=True)
    point = feasible([UNIT, UNIT], [row])
    assert point is not None
    assert all(len(repr(float(x))) <= 4 for x in point)
    assert point[0] / 3 + point[1] > 1


def test_the_point_lies_deep_inside_what_is_strict() -> None:
    row = Row({0: ONE, 1: ONE}, Fraction(1), Fraction(3, 2), True, True)
    point = feasible([UNIT, UNIT], [row])
    assert point is not None
    assert Fraction(9, 8) <= sum(point) <= Fraction(11, 8)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (-1.0, 1.0, 0.0),
        (0.0, 1.0, 0.5),
        (0.29, 0.31, 0.3),
        (-1003.0, -996.0, -1000.0),
        (9.5, 10.5, 10.0),
        (2.5, 2.5, 2.5),
        (1e-300, 1e300, 5e299),
        (0.0, 5e-324 * 4, 1e-323),
        (1.7e308, 1.79e308, 1.74e308),
    ],
)
def test_the_simplest_double_between_two_numbers(
    low: float, high: float, expected: float
) -> None:
    assert simple(Fraction(low), Fraction(high)) == Fraction(expected)


def test_between_neighbours_there_is_no_double() -> None:
    low, high = Fraction(1), 1 + Fraction(1, 2**52)
    assert simple(low, high) == (low + high) / 2


def test_swapped_ends_are_refused() -> None:
    with pytest.raises(ValueError, match="no number") as caught:
        simple(ONE, Fraction(0))
    assert str(caught.value) == "no number from 1 to 0"
