"""Systems of scikit-fuzzy, and what a simulation computes, against ours."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.errors import InvalidModelError, LossError
from fuzzytree.model import (
    Conclusion,
    Defuzzifier,
    FuzzySystem,
    Proposition,
    RuleBlock,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.model.rulebase import Points
from fuzzytree.tables import FloatArray

pytest.importorskip("skfuzzy")
control: Any = pytest.importorskip("skfuzzy.control")

pytestmark = pytest.mark.filterwarnings(  # of numpy 2.4, about scikit-fuzzy 0.5
    "ignore:Passing more than 2 positional arguments:DeprecationWarning"
)
EPSILON = float(np.finfo(np.float64).eps)


def simulated(system: Any, rows: FloatArray, columns: tuple[str, ...]) -> FloatArray:
    simulation = control.ControlSystemSimulation(system)
    found = []
    for row in rows.tolist():
        for name, value in zip(columns, row, strict=True):
            simulation.input[name] = value
        simulation.compute()
        found.append(simulation.output.get("o", np.nan))
    return np.array(found, np.float64)


def tipper() -> Any:
    quality = control.Antecedent(np.arange(0, 11, 1), "quality")
    service = control.Antecedent(np.arange(0, 11, 1), "service")
    tip = control.Consequent(np.arange(0, 26, 1), "o")
    quality.automf(3)
    service.automf(3)
    tip["low"] = np.interp(tip.universe, [0, 13], [1.0, 0.0])
    tip["medium"] = np.interp(tip.universe, [0, 13, 25], [0.0, 1.0, 0.0])
    tip["high"] = np.interp(tip.universe, [13, 25], [0.0, 1.0])
    return control.ControlSystem(
        [
            control.Rule(quality["poor"] | service["poor"], tip["low"]),
            control.Rule(service["average"], tip["medium"]),
            control.Rule(service["good"] | quality["good"], tip["high"]),
        ]
    )


def degrees(chance: random.Random, universe: FloatArray) -> FloatArray:
    """Return a triangle, a gaussian, a plateau or anything."""
    low, high = universe[0], universe[-1]
    points = sorted(chance.uniform(low, high) for _ in range(4))
    kind = chance.choice(["triangle", "gaussian", "plateau", "free"])
    found: FloatArray = np.array([chance.random() for _ in universe])
    if kind == "triangle":
        found = np.interp(universe, points[:3], [0.0, 1.0, 0.0])
    elif kind == "gaussian":
        found = np.exp(-(((universe - points[1]) / (0.3 * (high - low))) ** 2))
    elif kind == "plateau":
        found = np.interp(universe, points, [0.0, 1.0, 1.0, 0.0])
    return found


def condition(chance: random.Random, inputs: list[Any], depth: int = 2) -> Any:
    if depth == 0 or chance.random() < 0.3:
        variable = chance.choice(inputs)
        term = variable[chance.choice(list(variable.terms))]
        return ~term if chance.random() < 0.2 else term
    left, right = (condition(chance, inputs, depth - 1) for _ in range(2))
    return left & right if chance.random() < 0.5 else left | right


def random_control(seed: int) -> Any:
    chance = random.Random(seed)
    inputs = [
        control.Antecedent(np.linspace(-1.0, 2.0, 31), "a"),
        control.Antecedent(np.arange(0, 8, 1), "b"),
    ]
    output = control.Consequent(np.linspace(-3.0, 5.0, chance.choice([9, 40])), "o")
    for variable in (*inputs, output):
        for term in ("p", "q", "r"):
            variable[term] = degrees(chance, variable.universe)
    rules = []
    for number in range(6):
        then = output[chance.choice("pqr")]
        rules.append(
            control.Rule(
                condition(chance, inputs),
                then % 0.5 if number == 2 else then,
                label=f"rule {number}",
                and_func=np.multiply if seed % 3 == 0 else np.fmin,
            )
        )
    return control.ControlSystem(rules)


def allowed(system: FuzzySystem, found: Any) -> FloatArray:
    """Return how far two evaluations in doubles can be apart.

    Two sums over the points of the curve, each of which adds one rounding of the
    largest value; and cuts that are off by a few roundings of 1, which moves the
    centroid by as much of the range, divided by the highest cut.
    """
    (output,) = system.outputs
    assert output.low is not None
    assert output.high is not None
    points = output.defuzzifier.samples * (2 + len(output.terms))
    highest = np.maximum(found.strengths.max(axis=0), 1e-300)
    size = max(abs(output.low), abs(output.high)) + (output.high - output.low)
    bound: FloatArray = size * EPSILON * (4 * points + 64 * points / highest)
    return bound


@pytest.mark.one_in(8)
@pytest.mark.parametrize("seed", range(12))
def test_a_system_answers_as_its_simulation_does(seed: int) -> None:
    theirs = random_control(seed)
    ours = ft.from_skfuzzy(theirs)
    draw = np.random.default_rng(seed)
    rows = draw.uniform(-2.0, 9.0, (100, len(ours.inputs)))
    found = ft.run(ours, rows)
    off = np.abs(found["o"] - simulated(theirs, rows, ours.inputs))
    bound = allowed(ours, found)
    assert np.all(off <= bound)
    assert np.median(bound) < 1e-9  # what is allowed decides something


def test_the_tipper_gives_the_number_of_its_documentation() -> None:
    theirs = tipper()
    rows = np.array([[6.5, 9.8]])
    assert ft.from_skfuzzy(theirs).inputs == ("quality", "service")
    found = float(ft.run(theirs, rows)["o"][0])
    assert found == pytest.approx(19.847607361963192, abs=26 * 25 * EPSILON)
    simulation = control.ControlSystemSimulation(theirs)
    assert ft.run(simulation, rows)["o"] == found


def test_every_runtime_has_the_bits_of_the_reference_on_a_curve_of_lines() -> None:
    found = ft.check(tipper(), settings=ft.CheckSettings(limit=300))
    found.raise_if_not_ok()
    assert {one.allowed for one in found.comparisons} == {0.0}


def test_a_term_keeps_only_the_points_where_its_curve_bends() -> None:
    (output,) = ft.from_skfuzzy(tipper()).outputs
    assert str(output.terms[1].function) == (
        "Points(values=(0.0, 13.0, 25.0), degrees=(0.0, 1.0, 0.0))"
    )


def test_an_output_can_stand_between_inputs_and_outputs() -> None:
    inner = control.Antecedent(np.arange(0, 11, 1), "a")
    middle = control.Consequent(np.arange(0, 11, 1), "m")
    outer = control.Consequent(np.arange(0, 11, 1), "o")
    for variable in (inner, middle, outer):
        variable.automf(3)
    theirs = control.ControlSystem(
        [
            control.Rule(inner["good"], middle["poor"]),
            control.Rule(inner["poor"] | inner["average"], middle["good"]),
            control.Rule(middle["good"], outer["poor"]),
            control.Rule(middle["poor"], outer["good"]),
        ]
    )
    ours = ft.from_skfuzzy(theirs)
    rows = np.linspace(0.0, 10.0, 41)[:, None]
    found = ft.run(ours, rows)
    off = np.abs(found["o"] - simulated(theirs, rows, ("a",)))
    assert off.max() < 1e-13


def test_where_no_rule_fires_the_answer_is_nan_and_counted() -> None:
    food = control.Antecedent(np.arange(0, 11, 1), "food")
    tip = control.Consequent(np.arange(0, 11, 1), "o")
    food.automf(3)
    tip.automf(3)
    theirs = control.ControlSystem([control.Rule(food["good"], tip["good"])])
    found = ft.run(theirs, np.array([[1.0], [9.0]]))
    assert np.isnan(found["o"]).tolist() == [True, False]
    assert found.count(2) == 1


def changed(change: Callable[[Any, Any], None]) -> Any:
    food = control.Antecedent(np.arange(0, 11, 1), "food")
    tip = control.Consequent(np.arange(0, 11, 1), "o")
    food.automf(3)
    tip.automf(3)
    rule = control.Rule(food["good"] & food["poor"], tip["good"])
    change(rule, tip)
    return control.ControlSystem([rule])


def set_and(rule: Any, _: Any) -> None:
    rule.and_func = lambda a, b: a * b


def set_method(_: Any, tip: Any) -> None:
    tip.defuzzify_method = "mom"


def set_accumulation(_: Any, tip: Any) -> None:
    tip.accumulation_method = np.add


def set_universe(_: Any, tip: Any) -> None:
    tip.universe = np.arange(0, 11, 1) ** 2


def set_falling(_: Any, tip: Any) -> None:
    tip.universe = np.arange(11, 0, -1)


REFUSED = [
    (set_and, "rule 1 takes as AND a function '<lambda>'"),
    (
        set_method,
        "the output 'o' is defuzzified by 'mom'; only 'centroid' does not depend on "
        "how scikit-fuzzy rounds the points that it adds",
    ),
    (set_accumulation, "the output 'o' accumulates by a function 'add'"),
    (set_universe, "the universe of the output 'o' is not evenly spaced"),
    (set_falling, "the universe of 'o' does not rise"),
]


@pytest.mark.parametrize(("change", "reason"), REFUSED)
def test_what_a_system_of_ours_cannot_hold_is_refused_with_its_reason(
    change: Callable[[Any, Any], None], reason: str
) -> None:
    with pytest.raises(LossError) as caught:
        ft.from_skfuzzy(changed(change))
    assert str(caught.value) == (
        f"cannot read a ControlSystem of scikit-fuzzy: {reason}"
    )


def test_something_else_is_no_control_system() -> None:
    with pytest.raises(TypeError) as caught:
        ft.from_skfuzzy(3.0)
    assert str(caught.value) == (
        "from_skfuzzy reads a ControlSystem of scikit-fuzzy, and not a value of type "
        "float"
    )


@pytest.mark.parametrize(
    ("defuzzifier", "aggregation", "implication", "text"),
    [
        (
            ("bisector", 5, "lines"),
            "maximum",
            "minimum",
            "output 'y': the grid 'lines' needs the centroid and the aggregation "
            "maximum",
        ),
        (
            ("centroid", 5, "lines"),
            "sum",
            "minimum",
            "output 'y': the grid 'lines' needs the centroid and the aggregation "
            "maximum",
        ),
        (
            ("centroid", 5, "lines"),
            "maximum",
            "product",
            "rule 1: 'y', by 'lines', needs the implication minimum",
        ),
    ],
)
def test_lines_are_refused_where_they_mean_nothing(
    defuzzifier: Any, aggregation: Any, implication: Any, text: str
) -> None:
    ramp = Term("ramp", Points((0.0, 1.0), (0.0, 1.0)))
    how = Defuzzifier(*defuzzifier)
    output = SystemOutput("y", (ramp,), 0.0, 1.0, how, aggregation)
    rule = SystemRule(Proposition("a", ("ramp",)), (Conclusion("y", "ramp"),))
    block = RuleBlock((rule,), implication=implication)
    with pytest.raises(InvalidModelError) as caught:
        FuzzySystem("s", (Variable("a", (ramp,)),), (output,), (block,))
    assert str(caught.value) == text
