"""What is proved of random systems and trees holds at many rows, with their own run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.random import Generator

import fuzzytree as ft
from fuzzytree.auditing.decide import (
    Base,
    Boxes,
    Budget,
    OutputBounds,
    search_boxes,
)
from fuzzytree.auditing.findings.domains import domain_of
from fuzzytree.model import (
    And,
    BoolArray,
    Conclusion,
    Curve,
    Defuzzifier,
    FloatArray,
    FuzzySystem,
    Gaussian,
    Linear,
    Not,
    Or,
    Points,
    Proposition,
    RuleBlock,
    Sigmoid,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
)
from fuzzytree.runtimes import run_system
from fuzzytree.testing import random_tree

ROWS = 2000
FORMS = (
    "y is at least {least!r}",
    "y is at most {most!r}",
    "y rises with x0",
    "y falls with x0",
    "y changes by at most {slope!r} per x0",
    "changing x1 changes nothing",
    "every input gets an output",
)


def curve(chance: Generator, place: float) -> Curve:
    """Return a membership function around a place in [0, 1]."""
    width = float(chance.uniform(0.2, 0.7))
    match chance.integers(5):
        case 0:
            return Gaussian(place, width)
        case 1:
            return Trapezoid(place - width, place - 0.1, place + 0.1, place + width)
        case 2:
            return Sigmoid(place, float(chance.choice([-8.0, 8.0])))
        case 3:  # a step
            return Points((place, place), (0.0, 1.0))
        case _:
            ends = (place - width, place, place + width)
            return Points(ends, (0.25, 1.0, float(chance.choice([0.0, 0.5]))))


def system(seed: int) -> FuzzySystem:
    """Return a system of one output and two inputs, with most of what is bounded."""
    chance = np.random.default_rng(seed)
    names = ("low", "mid", "high")
    inputs = tuple(
        Variable(
            f"x{k}",
            tuple(
                Term(n, curve(chance, p))
                for n, p in zip(names, (0.0, 0.5, 1.0), strict=True)
            ),
            low=0.0,
            high=1.0,
        )
        for k in range(2)
    )
    kind = int(chance.integers(5))
    functions: list[Any]
    aggregation: Any = None
    if kind < 3:
        weights = ((1.0, 0.0), (0.5, -0.5), (0.0, 2.0)) if kind == 1 else ()
        functions = [
            Linear(weights[k], float(k))
            if weights
            else Singleton(float(chance.integers(5)))
            for k in range(3)
        ]
        how = Defuzzifier("weighted sum" if kind == 2 else "weighted average")
    else:
        functions = [
            Trapezoid(p - 0.4, p - 0.05, p + 0.05, p + 0.4) for p in (0.2, 0.5, 0.8)
        ]
        grid: Any = str(chance.choice(["middle", "half ends"]))
        how = Defuzzifier("centroid", samples=20, grid=grid)
        aggregation = str(chance.choice(["maximum", "sum", "algebraic sum"]))
    terms = tuple(Term(f"t{k}", one) for k, one in enumerate(functions))
    output = SystemOutput(
        "y", terms, 0.0, 1.0, how, aggregation, clips=bool(chance.integers(2))
    )

    def proposition(k: int) -> Proposition:
        hedges: Any = (("very",), ("not",), (), ())[chance.integers(4)]
        return Proposition(f"x{k}", (str(chance.choice(names)),), hedges)

    rules: list[SystemRule] = []
    for number in range(4):
        both = (proposition(0), proposition(1))
        when = (And(both), Or(both), both[0], And((both[0], Not(both[1]))))[
            chance.integers(4)
        ]
        then = (Conclusion("y", f"t{number % 3}"),)
        rules.append(SystemRule(when, then, weight=float(chance.choice([1.0, 0.5]))))
    norms: list[Any] = chance.choice(["minimum", "product"], 2).tolist()
    block = RuleBlock(tuple(rules), norms[0], "maximum", norms[1])
    return FuzzySystem("random", inputs, (output,), (block,))


def numbers(model: FuzzySystem, rows: FloatArray) -> FloatArray:
    """Return the output of each row."""
    outputs = run_system(model)(rows).outputs
    assert outputs is not None
    return np.array(outputs[0])


def check(model: FuzzySystem, seed: int) -> list[str]:
    """Compare what is proved of a system with random rows; return all verdicts."""
    chance = np.random.default_rng(seed)
    rows = chance.uniform(0.0, 1.0, (2, ROWS))
    y = numbers(model, rows)
    spread = float(np.ptp(y[np.isfinite(y)]))
    least, most = (
        float(np.nanmin(y)) - 0.02 * spread,
        float(np.nanmax(y)) + 0.1 * spread,
    )
    slope = 4.0 * spread
    texts = [one.format(least=least, most=most, slope=slope) for one in FORMS]
    higher, other = rows.copy(), rows.copy()
    higher[0] += (1.0 - rows[0]) * chance.uniform(0.0, 1.0, ROWS) ** 3
    other[1] = chance.uniform(0.0, 1.0, ROWS)
    rise, far = numbers(model, higher) - y, higher[0] - rows[0]
    truths = (
        np.all(y >= least - 1e-8),
        np.all(y <= most + 1e-8),
        np.all(rise >= -1e-8),
        np.all(rise <= 1e-8),
        np.all(np.abs(rise) <= slope * far + 1e-8),
        np.allclose(numbers(model, other), y),
        np.all(np.isfinite(y)),
    )
    result = ft.require(model, texts, steps=100_000)
    for answer, is_true in zip(result.answers, truths, strict=True):
        assert is_true or answer.verdict != "PROVED", (seed, answer)
    return [answer.verdict for answer in result.answers]


def test_what_is_proved_of_random_systems_holds_at_random_rows() -> None:
    verdicts = [one for seed in (1, 4) for one in check(system(seed), seed)]
    assert {"PROVED", "REFUTED"} <= {*verdicts}


@pytest.mark.heavy
def test_what_is_proved_of_many_random_systems_holds_at_random_rows() -> None:
    verdicts = [one for seed in range(40) for one in check(system(seed), seed)]
    assert verdicts.count("OPEN") < 0.2 * len(verdicts)


def check_bounds(model: FuzzySystem, seed: int) -> int:
    """Compare the bounds on boxes with the model at rows in them; return how many."""
    chance = np.random.default_rng(seed)
    base = Base.of(model, domain_of(model)).fine
    bounds = OutputBounds(base, model, "y")
    seen = 0

    def is_excluded(boxes: Boxes) -> BoolArray:
        nonlocal seen
        with np.errstate(all="ignore"):
            number = bounds.numbers(boxes)
            slope = None
            if model.outputs[0].aggregation != "algebraic sum":
                slope = bounds.slopes(boxes, "x0")
        for k in range(len(boxes.low)):
            first = {
                name: stretch.value(chance.uniform(boxes.low[k, n], boxes.high[k, n]))
                for n, (name, stretch) in enumerate(boxes.stretches.items())
            }
            place = boxes.places["x0"]
            ends = boxes.low[k, place], boxes.high[k, place]
            second = first | {"x0": boxes.stretches["x0"].value(chance.uniform(*ends))}
            rows = np.array(
                [
                    [float(row.get(f"x{n}", 0)) for row in (first, second)]
                    for n in range(2)
                ]
            )
            y = numbers(model, rows)
            is_known = np.isfinite(y)
            assert np.all((y >= number.low[k] - 1e-9) | ~is_known), seed
            assert np.all((y <= number.high[k] + 1e-9) | ~is_known), seed
            far = rows[0, 1] - rows[0, 0]
            if slope is not None and is_known.all() and abs(far) > 1e-6:
                secant = (y[1] - y[0]) / far
                assert slope.low[k] - 1e-6 <= secant <= slope.high[k] + 1e-6, seed
            seen += 1
        return np.array(chance.random(len(boxes.low)) < 0.45)

    search_boxes(base, is_excluded, lambda _point: False, Budget(), 40_000)
    return seen


def test_bounds_of_outputs_and_slopes_hold_at_random_rows() -> None:
    assert sum(check_bounds(system(seed), seed) for seed in range(4)) > 50


@pytest.mark.heavy
def test_bounds_of_many_outputs_and_slopes_hold_at_random_rows() -> None:
    assert sum(check_bounds(system(seed), seed) for seed in range(300)) > 10_000


@pytest.mark.parametrize("seed", range(8))
def test_what_is_proved_of_random_trees_holds_at_random_rows(seed: int) -> None:
    tree = random_tree(seed, leaves=6, combinations=0)
    limits = dict.fromkeys(tree.inputs, (-3.0, 3.0))
    labels, x = ", ".join(tree.classes), tree.inputs[0]
    texts = [
        f"class rises with {x} in the order {labels}",
        f"changing {tree.inputs[-1]} changes nothing",
        f"class is never {tree.classes[0]} where {x} > 1",
    ]
    chance = np.random.default_rng(seed)
    rows = chance.uniform(-3.0, 3.0, (ROWS, len(tree.inputs)))
    higher, other, part = rows.copy(), rows.copy(), rows.copy()
    higher[:, 0] = chance.uniform(rows[:, 0], 3.0)
    other[:, -1] = chance.uniform(-3.0, 3.0, ROWS)
    part[:, 0] = chance.uniform(1.0, 3.0, ROWS)
    a, b, c, d = (
        ft.run(tree, one, columns=tree.inputs).codes
        for one in (rows, higher, other, part)
    )
    truths = (np.all(a <= b), np.all(a == c), np.all(d != 0))
    for answer, is_true in zip(
        ft.require(tree, texts, limits=limits).answers, truths, strict=True
    ):
        assert answer.verdict != "OPEN"
        assert is_true or answer.verdict == "REFUTED", answer
