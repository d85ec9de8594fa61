"""The bounds between two runners are wide enough, and no wider than they must be."""

import math
import random
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from fuzzytree.model import (
    Conclusion,
    Defuzzifier,
    DefuzzifierMethod,
    FuzzySystem,
    Gaussian,
    Points,
    Proposition,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.semantics import probing
from fuzzytree.semantics.programs import evaluate
from fuzzytree.semantics.programs.bounds import error_bounds
from fuzzytree.semantics.programs.operations import INEXACT, NUMERIC
from fuzzytree.semantics.programs.steps import Maker, Program, result_of
from fuzzytree.semantics.programs.system_program import from_system
from fuzzytree.semantics.random_systems import random_rows
from fuzzytree.testing import random_system

UNITS = 2  # units in the last place by which the other library is off, at most


def another_library(seed: int) -> dict[str, Callable[..., float]]:
    """Return functions that differ in their last bits from those of Python."""

    def other(operation: str) -> Callable[..., float]:
        def function(*given: float) -> float:
            value = NUMERIC[operation](*given)
            chance = random.Random(f"{seed} {operation} {given}")
            if not math.isfinite(value) or given[0] == 0.0:
                return value
            if operation == "exponential" and given[0] < -746.0:
                return value
            if operation == "power" and (given[0] == 1.0 or given[1] in (0.0, 1.0)):
                return value
            for _ in range(chance.randint(0, UNITS)):
                value = math.nextafter(value, chance.choice((-math.inf, math.inf)))
            lowest = 0.0 if operation in ("exponential", "power") else -math.inf
            return max(value, lowest) if NUMERIC[operation](*given) >= 0.0 else value

        return function

    return {name: other(name) if name in INEXACT else NUMERIC[name] for name in NUMERIC}


def answers(
    program: Program, row: dict[str, float], stills: Sequence[Any]
) -> list[float]:
    found: list[Any] = []
    for step, still in zip(program.steps, stills, strict=True):
        given = [found[place] for place in step.arguments]
        found.append(evaluate._result(step, given, row) if still is None else still)
    return [float(found[one.step]) for one in program.results]


@pytest.mark.one_in(4)
@pytest.mark.parametrize("seed", range(24))
def test_another_library_stays_within_the_bounds(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind = ("none", "tame", "wild")[seed % 3]
    system = random_system(seed, formulas=kind)  # type: ignore[arg-type]
    rows = random_rows(system, seed, 6)
    rows += probing.system_probes(system, limit=24, seed=seed)
    program = from_system(system, activations=True)
    values = np.array([[row[name] for row in rows] for name in program.inputs])
    bounds = error_bounds(program, values)
    stills = evaluate.still_results(program)
    plain = [answers(program, row, stills) for row in rows]
    monkeypatch.setattr(evaluate, "NUMERIC", another_library(seed))
    other = [answers(program, row, stills) for row in rows]
    a, b = np.array(plain).T, np.array(other).T
    is_same = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore"):
        is_within = is_same | (np.abs(a - b) <= bounds) | np.isinf(bounds)
    assert is_within.all(), np.argwhere(~is_within)[:3]


def tank(
    method: DefuzzifierMethod, curves: dict[str, Points | Singleton]
) -> FuzzySystem:
    low, high = (
        Term("low", Gaussian(0.0, 1.5)),
        Term("high", Gaussian(10.0, 1.5)),
    )
    level = Variable("level", (low, high), low=0.0, high=10.0)
    labels = tuple(Term(name, curve) for name, curve in curves.items())
    output = SystemOutput(
        "valve", labels, 0.0, 30.0, Defuzzifier(method, 20), "maximum", default=7.0
    )
    rules = (
        SystemRule(Proposition("level", ("low",)), (Conclusion("valve", "open"),)),
        SystemRule(Proposition("level", ("high",)), (Conclusion("valve", "shut"),)),
    )
    block = RuleBlock(rules, implication="minimum")
    return FuzzySystem("tank", (level,), (output,), (block,))


TRIANGLES: dict[str, Points | Singleton] = {
    "open": Points((0.0, 5.0, 12.0), (0.0, 1.0, 0.0)),
    "shut": Points((10.0, 20.0, 30.0), (0.0, 1.0, 0.0)),
}
NUMBERS: dict[str, Points | Singleton] = {
    "open": Singleton(5.0),
    "shut": Singleton(25.0),
}


@pytest.mark.parametrize(
    ("method", "most"),
    [
        ("centroid", 1e-12),
        ("weighted average", 1e-13),
        ("smallest of maximum", 0.0),
        ("largest of maximum", 0.0),
        ("mean of maximum", 0.0),
    ],
)
def test_ordinary_rows_have_narrow_bounds(
    method: DefuzzifierMethod, most: float
) -> None:
    system = tank(method, NUMBERS if method == "weighted average" else TRIANGLES)
    program = from_system(system, activations=True)
    bounds = error_bounds(program, np.array([np.linspace(0.1, 4.8, 200)]))
    assert bounds[-1].tolist() == [0.0] * 200  # the status is certain
    assert bounds[0].max() <= most
    assert (bounds[1:-1] > 0.0).any()  # and the degrees are not equal in bits


def test_rules_that_are_as_strong_as_nothing_keep_an_answer_certain() -> None:
    # e to the power -800 is 0 everywhere, and so the default answers everywhere.
    far = np.array([[80.0]])
    program = from_system(tank("weighted average", NUMBERS))
    assert error_bounds(program, far).tolist() == [[0.0], [0.0]]


def test_a_row_on_an_edge_has_no_bound() -> None:
    make = Maker()
    x = make("exponential", make.input("x"))
    is_above = make("less", make.constant(math.exp(1.0)), x)
    jump = make("where", is_above, make.constant(math.inf), make.constant(0.0))
    program = make.program("p", ("x",), (result_of("output", "y", jump),))
    assert error_bounds(program, np.array([[1.0, 1.1]])).tolist() == [[math.inf, 0.0]]


def test_a_copy_is_equal_and_a_number_computed_twice_is_not() -> None:
    make = Maker()
    x = make.input("x")
    root, power = make("exponential", x), make("power", make.constant(math.e), x)
    smaller = make("minimum", root, make.constant(100.0))
    results = (
        result_of(
            "output", "copy", make("where", make("equal", root, smaller), x, root)
        ),
        result_of(
            "output", "twice", make("where", make("equal", root, power), x, root)
        ),
        result_of(
            "output",
            "sums",
            make(
                "where",
                make("equal", make("add", root, x), make("add", smaller, x)),
                x,
                root,
            ),
        ),
    )
    program = make.program("p", ("x",), results)
    copy, twice, sums = error_bounds(program, np.array([[1.0]]))[:, 0].tolist()
    assert (copy, sums) == (0.0, 0.0)
    assert twice > 1.0


def test_a_small_change_of_a_consequent_is_seen_in_an_ordinary_row() -> None:
    right = tank("weighted average", NUMBERS)
    moved = tank("weighted average", {**NUMBERS, "open": Singleton(5.0 * (1.0 + 1e-9))})
    row = {"level": 3.0}
    one, two = (
        evaluate.evaluate_program(from_system(s), row).values[0] for s in (right, moved)
    )
    bound = error_bounds(from_system(right), np.array([[3.0]]))[0, 0]
    assert abs(one - two) > 1000 * bound > 0.0
