"""Steps: shared, folded, pruned and refused."""

import math
import re

import pytest

from fuzzytree.semantics.programs.evaluate import evaluate_program
from fuzzytree.semantics.programs.operations import (
    LOGICAL,
    NUMERIC,
    OPERATIONS,
    OVER_SAMPLES,
    divide,
    power,
    total,
)
from fuzzytree.semantics.programs.steps import Maker, Program, Result, Step, result_of


def test_equal_steps_stand_there_once() -> None:
    make = Maker()
    x, y = make.input("x"), make.input("y")
    assert make("add", x, y) == make("add", x, y)
    assert make("add", x, y) != make("add", y, x)


def test_zero_and_minus_zero_are_two_constants() -> None:
    make = Maker()
    assert make.constant(0.0) != make.constant(-0.0)
    assert make.constant(math.nan) == make.constant(math.nan)


def test_steps_on_constants_are_computed_at_once() -> None:
    make = Maker()
    assert make.number(make("add", make.constant(1.0), make.constant(2.0))) == 3.0
    assert make.number(make.table("pick", make.constant(1.0), [5.0, 6.0])) == 6.0


@pytest.mark.parametrize(
    ("operation", "number"), [("multiply", 1.0), ("divide", 1.0), ("subtract", 0.0)]
)
def test_what_changes_nothing_is_left_out(operation: str, number: float) -> None:
    make = Maker()
    x = make.input("x")
    assert make(operation, x, make.constant(number)) == x


def test_x_plus_zero_stays_for_it_turns_minus_zero_to_zero() -> None:
    make = Maker()
    x = make.input("x")
    assert make("add", x, make.constant(0.0)) != x


def test_what_no_result_needs_is_not_there() -> None:
    make = Maker()
    x, y = make.input("x"), make.input("y")
    make("add", x, y)
    program = make.program("p", ("x", "y"), (result_of("output", "z", y),))
    assert program.steps == (Step("input", name="y"),)
    assert program.results == (Result("output", "z", 0),)


def test_samples_spread_over_the_steps_that_use_them() -> None:
    make = Maker()
    scaled = make("multiply", make.index(3), make.input("x"))
    total_ = make("total", scaled)
    running = make("highest", make("running", scaled))
    results = (result_of("output", "a", total_), result_of("output", "b", running))
    program = make.program("p", ("x",), results)
    assert [step.samples for step in program.steps] == [3, 0, 3, 0, 3, 0]
    assert evaluate_program(program, {"x": 2.0}).values == (6.0, 6.0)
    assert program.size == 12


@pytest.mark.parametrize(
    ("step", "text"),
    [
        (Step("addd", (0, 0)), "step 1: no operation 'addd'"),
        (Step("add", (0, 1)), "step 1: add needs steps before it"),
        (Step("add", (0,)), "step 1: add takes number, number"),
        (Step("not", (0,)), "step 1: not takes truth"),
        (Step("input", name="y"), "step 1: no input 'y'"),
        (Step("pick", (0,)), "step 1: pick needs a table"),
        (Step("negate", (0,), samples=2), "step 1: negate mixes different numbers"),
        (Step("total", (0,)), "step 1: total mixes different numbers"),
        (Step("index", samples=2), "the result 'r' has many samples"),
    ],
)
def test_a_program_that_cannot_be_run_is_refused(step: Step, text: str) -> None:
    with pytest.raises(ValueError, match=re.escape(text)):
        Program("p", ("x",), (Step("input", name="x"), step), (Result("rule", "r", 1),))


def test_every_operation_has_a_meaning() -> None:
    special = {"constant", "input", "index", "below", "pick", "running"}
    assert OPERATIONS.keys() == (
        NUMERIC.keys() | LOGICAL.keys() | OVER_SAMPLES | special
    )


def test_operations_answer_where_python_would_raise() -> None:
    assert (divide(1.0, 0.0), divide(-1.0, 0.0)) == (math.inf, -math.inf)
    assert math.isnan(divide(0.0, 0.0))
    assert math.isnan(divide(math.nan, 0.0))
    assert (power(0.0, -1.0), power(-0.0, -1.0)) == (math.inf, -math.inf)
    assert (power(-10.0, 309.0), power(-10.0, 310.0)) == (-math.inf, math.inf)
    assert math.isnan(power(-1.0, 0.5))
    assert NUMERIC["logarithm"](0.0) == -math.inf
    assert math.isnan(NUMERIC["logarithm"](-1.0))
    assert NUMERIC["hyperbolic_sine"](-1e3) == -math.inf
    assert NUMERIC["exponential"](1e3) == math.inf
    assert math.isnan(NUMERIC["sine"](math.inf))
    assert NUMERIC["area_tangent"](-1.0) == -math.inf
    assert math.isnan(NUMERIC["remainder"](1.0, 0.0))
    assert NUMERIC["floor"](-math.inf) == -math.inf


def test_samples_are_summed_by_halves() -> None:
    # In order, 1e16 + 1 + 1 loses both ones; by halves the two meet first.
    assert total([1e16, 1.0, 0.0, 1.0]) == 1e16 + 2.0
    assert total([5.0]) == 5.0
