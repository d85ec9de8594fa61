"""The degrees on a cell are all within its range, and the range is no wider."""

import itertools
import random
from fractions import Fraction

import numpy as np
import pytest

from fuzzytree.auditing.engine.pieces import proposition_ranges, shape_ranges
from fuzzytree.model.rulebase import LR, Band, Points, Proposition, Shape, Side
from fuzzytree.numerics.exact import exact_degree
from tests.auditing.engine.bases import random_shape

STEPS = Points((0.2, 0.2, 0.5, 0.7, 0.7), (0.1, 0.9, 0.3, 0.8, 0.0))
RIPPLE = LR(
    0.5, Side(0.3, (0.5, 0.9, -0.8, -2.0, 1.4, 0.9), 2.0), Side(0.1, (2.0,), 9.0)
)
SHAPES: list[Shape] = [
    STEPS,
    RIPPLE,
    Points((0.5,), (0.25,)),
    Points(tuple(i / 9 for i in range(10)), tuple(i * 7 % 11 / 11 for i in range(10))),
    Band(0.3, 0.6),
    Band(0.3, 0.6, 0.1, 0.9),
    Band(),
    *(random_shape(random.Random(seed), "mixed") for seed in range(20)),
]


@pytest.mark.one_in(2)
@pytest.mark.parametrize("shape", SHAPES, ids=range(len(SHAPES)))
def test_every_degree_is_in_the_range_of_its_cell(shape: Shape) -> None:
    draw = random.Random(3)
    marks = [0.2, 0.3, 0.5, 0.7, *(draw.uniform(-0.5, 1.5) for _ in range(10))]
    edges = np.array(sorted([*marks, 0.2, np.nextafter(0.2, 1.0)]))
    at, cells = shape_ranges(shape, edges)
    for number, (a, b) in enumerate(itertools.pairwise(edges)):
        low, high = Fraction(a), Fraction(b)
        shares = [*(Fraction(k, 50) for k in range(50)), 1 - Fraction(1, 2**70)]
        inside = [high - (high - low) * share for share in shares]
        degrees = [exact_degree(shape, x) for x in inside]
        assert cells.low[number] <= min(degrees)
        assert max(degrees) <= cells.high[number]
        assert at.low[number + 1] <= degrees[0] <= at.high[number + 1]
        # The points of a cell are close to all of them.
        size = float(cells.high[number] - cells.low[number])
        assert size <= float(max(degrees) - min(degrees)) * 1.1 + 0.02


def test_a_step_belongs_to_the_cell_that_begins_there() -> None:
    _, cells = shape_ranges(STEPS, np.array([0.1, 0.2, 0.3, 0.7, 0.9]))
    assert cells.high[0] <= 0.1 + 1e-15
    assert cells.low[1] >= 0.7 - 1e-15
    assert cells.high[3] == 0.0


def test_a_cell_without_width_is_its_point() -> None:
    _, cells = shape_ranges(Band(0.3, 0.6), np.array([0.3, 0.3, 0.6, 0.6]))
    assert cells.high.tolist() == [0.0, 1.0, 1.0]
    assert cells.low.tolist() == [0.0, 1.0, 1.0]


def test_a_negated_choice_is_enclosed() -> None:
    shapes = {("x", "a"): SHAPES[-1], ("x", "b"): SHAPES[-2]}
    proposition = Proposition("x", ("a", "b"), hedges=("not",))
    edges = np.linspace(0.0, 1.0, 9)
    _, cells = proposition_ranges(proposition, shapes, edges)
    for number, (a, b) in enumerate(itertools.pairwise(edges)):
        for k in range(1, 20):
            x = Fraction(a) + (Fraction(b) - Fraction(a)) * Fraction(k, 19)
            degree = 1 - max(exact_degree(shape, x) for shape in shapes.values())
            assert cells.low[number] <= degree <= cells.high[number]
