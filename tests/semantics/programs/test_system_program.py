"""Programs of systems: their bits are those of the inference."""

import math

import pytest
from msgspec.structs import replace

from fuzzytree.model import (
    Call,
    Conclusion,
    Defuzzifier,
    Formula,
    FuzzySystem,
    Gaussian,
    Number,
    Proposition,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
)
from fuzzytree.model.rulebase import Points
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.probing import SPECIAL
from fuzzytree.semantics.programs.evaluate import evaluate_program
from fuzzytree.semantics.programs.operations import INEXACT
from fuzzytree.semantics.programs.system_program import from_system
from fuzzytree.testing import random_rows, random_system

RAMP = Term("up", Points((0.0, 1.0), (0.0, 1.0)))


def equal(one: float, two: float) -> bool:
    return one == two or (math.isnan(one) and math.isnan(two))


def assert_equal(system: FuzzySystem, rows: list[dict[str, float]]) -> None:
    program = from_system(system, activations=True)
    for row in rows:
        right, found = infer(system, row), evaluate_program(program, row)
        expected = (*right.outputs, *right.strengths, float(right.status))
        numbers = found.of("output") + found.of("activation") + found.of("status")
        assert len(numbers) == len(expected)
        assert all(map(equal, numbers, expected)), (row, numbers, expected)


def a_system(
    *conclusions: str, output: SystemOutput, block: RuleBlock | None = None
) -> FuzzySystem:
    """Return a system that concludes labels if x is up."""
    then = [(Conclusion("y", name),) for name in conclusions]
    rules = tuple(SystemRule(Proposition("x", ("up",)), one) for one in then)
    kept = replace(block or RuleBlock(()), rules=rules, implication="minimum")
    return FuzzySystem("test", (Variable("x", (RAMP,)),), (output,), (kept,))


@pytest.mark.one_in(5)
@pytest.mark.parametrize("seed", range(60))
def test_a_program_has_the_bits_of_the_inference(seed: int) -> None:
    system = random_system(seed, formulas="wild" if seed % 3 == 0 else "tame")
    rows = random_rows(system, seed, 8)
    special = {
        name: SPECIAL[(seed + place) % len(SPECIAL)]
        for place, name in enumerate(system.inputs)
    }
    one = dict(rows[0])
    one[system.inputs[0]] = SPECIAL[seed % len(SPECIAL)]
    assert_equal(system, [*rows, special, one])


def test_a_conclusion_that_is_not_activated_has_no_part_even_if_it_is_nan() -> None:
    nan = Formula(Call("asin", (Number(2.0),)))
    labels = (Term("nan", nan), Term("one", Singleton(1.0)))
    output = SystemOutput("y", labels, None, None, Defuzzifier("weighted average"))
    inputs = (Variable("x", (RAMP, Term("down", Points((0.0, 1.0), (1.0, 0.0))))),)
    rules = (
        SystemRule(Proposition("x", ("up",)), (Conclusion("y", "nan"),)),
        SystemRule(Proposition("x", ("down",)), (Conclusion("y", "one"),)),
    )
    system = FuzzySystem("test", inputs, (output,), (RuleBlock(rules),))
    assert evaluate_program(from_system(system), {"x": -1.0}).of("output") == (1.0,)
    assert math.isnan(evaluate_program(from_system(system), {"x": 0.5}).of("output")[0])


def test_a_curve_that_is_the_same_everywhere_is_sampled_all_the_same() -> None:
    level = Term("level", Points((0.0,), (0.5,)))
    how = Defuzzifier("largest of maximum", samples=5, grid="ends")
    output = SystemOutput("y", (level,), 0.0, 4.0, how, "maximum")
    assert_equal(a_system("level", output=output), [{"x": 0.25}, {"x": 0.0}])


@pytest.mark.parametrize("method", ["smallest of maximum", "largest of maximum"])
def test_samples_between_neighbouring_doubles_need_not_rise(method: str) -> None:
    low = 1.0
    high = low + 3 * math.ulp(low)
    label = Term("level", Points((0.0,), (0.5,)))
    how = Defuzzifier(method, samples=9, grid="ends")  # type: ignore[arg-type] # a name
    output = SystemOutput("y", (label,), low, high, how, "maximum")
    assert_equal(a_system("level", output=output), [{"x": 0.25}])


def test_rules_of_one_label_are_cut_once_where_the_largest_counts() -> None:
    label = Term("hill", Gaussian(0.5, 0.1))
    how = Defuzzifier("centroid", samples=64)
    output = SystemOutput("y", (label,), 0.0, 1.0, how, "maximum")
    once = from_system(a_system("hill", output=output))
    often = from_system(a_system(*["hill"] * 5, output=output))
    assert once == often
    summed = replace(output, aggregation="algebraic sum")
    assert from_system(a_system("hill", "hill", output=summed)).size > once.size


def test_an_activation_that_lies_in_its_range_needs_no_test() -> None:
    output = SystemOutput(
        "y",
        (Term("one", Singleton(1.0)),),
        None,
        None,
        Defuzzifier("weighted sum"),
    )
    program = from_system(a_system("one", output=output), activations=True)
    tests = [step for step in program.steps if step.operation == "less"]
    assert len(tests) <= 2


@pytest.mark.parametrize(
    "curve",
    [
        Trapezoid(0.0, 1.0, 1.0, 3.0),
        Trapezoid(0.0, 0.0, 1.0, 3.0),
        Trapezoid(0.1, 0.3, 0.3, 0.3),
        Trapezoid(None, 0.1, 0.3, 0.7),
        Trapezoid(0.1, 0.3, 0.7, None),
        Trapezoid(0.3, 0.3, 0.3, 0.3),
        Trapezoid(None, 0.1, 0.3, None),
        Trapezoid(-1e300, 0.1, 0.3, 5e-324 + 0.3),
    ],
)
def test_a_trapezoid_is_the_smaller_of_its_slopes(curve: Trapezoid) -> None:
    corners = [one for one in (curve.a, curve.b, curve.c, curve.d) if one is not None]
    values = [near for one in corners for near in _near(one)]
    values += [one for one in SPECIAL if math.isfinite(one)]
    how = Defuzzifier("weighted sum")
    output = SystemOutput("y", (Term("one", Singleton(1.0)),), None, None, how)
    inputs = (Variable("x", (Term("in", curve),)),)
    rule = SystemRule(Proposition("x", ("in",)), (Conclusion("y", "one"),))
    system = FuzzySystem("test", inputs, (output,), (RuleBlock((rule,)),))
    assert_equal(system, [{"x": value} for value in values])


def _near(value: float) -> list[float]:
    return [value, math.nextafter(value, -math.inf), math.nextafter(value, math.inf)]


def test_systems_without_library_functions_have_programs_without_them() -> None:
    output = SystemOutput(
        "y",
        (Term("one", Singleton(1.0)),),
        None,
        None,
        Defuzzifier("weighted sum"),
    )
    program = from_system(a_system("one", output=output))
    assert not {step.operation for step in program.steps} & INEXACT
