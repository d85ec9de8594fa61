"""Runtimes of fuzzy systems: the bits of the inference, or what libraries allow."""

import math

import numpy as np
import pytest

from fuzzytree.checking.representations import check
from fuzzytree.errors import LossError
from fuzzytree.model import (
    Call,
    Conclusion,
    Defuzzifier,
    Expression,
    Formula,
    FuzzySystem,
    Name,
    RuleBlock,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.model.contracts import FloatArray, Outcome, Runtime
from fuzzytree.runtimes.programs import run_system
from fuzzytree.runtimes.reference import load as infer_rows
from fuzzytree.runtimes.table import all_runtimes, find_runtime, is_installed
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.probing import system_probes
from fuzzytree.semantics.programs.bounds import error_bounds
from fuzzytree.semantics.programs.system_program import from_system
from fuzzytree.testing import random_rows, random_system

RUNTIMES = [one for one in all_runtimes() if "system" in one.runs and is_installed(one)]


def values_of(system: FuzzySystem, rows: list[dict[str, float]]) -> np.ndarray:
    table = [[row[name] for row in rows] for name in system.inputs]
    return np.array(table, np.float64).reshape(len(system.inputs), len(rows))


def formula_system(expression: Expression) -> FuzzySystem:
    """Return a system whose output is a formula of x."""
    label = Term("f", Formula(expression))
    output = SystemOutput("y", (label,), None, None, Defuzzifier("weighted sum"))
    rule = SystemRule(None, (Conclusion("y", "f"),))
    return FuzzySystem("f", (Variable("a"),), (output,), (RuleBlock((rule,)),))


def outputs_of(outcome: Outcome) -> FloatArray:
    assert outcome.outputs is not None
    return outcome.outputs


def test_these_runtimes_run_systems() -> None:
    names = [one.name for one in all_runtimes() if "system" in one.runs]
    assert {"reference", "native", "onnxruntime float64"} <= set(names)


@pytest.mark.one_in(4)
@pytest.mark.parametrize("seed", range(30))
def test_numpy_is_as_near_to_the_inference_as_its_library_allows(seed: int) -> None:
    system = random_system(seed, formulas="wild" if seed % 2 else "tame")
    rows = random_rows(system, seed, 9)
    rows += system_probes(system, limit=24, seed=seed)
    values = values_of(system, rows)
    result = run_system(system)(values)
    right = infer_rows(system)(values)
    bounds = error_bounds(from_system(system, activations=True), values)
    assert within(result, right, bounds)
    assert outputs_of(right)[:, 0].tolist() == pytest.approx(
        list(infer(system, rows[0]).outputs), rel=0, abs=0, nan_ok=True
    )


def within(one: Outcome, two: Outcome, bounds: np.ndarray) -> bool:
    tables = []
    for outcome in (one, two):
        assert outcome.strengths is not None
        lines = (outputs_of(outcome), outcome.strengths, outcome.status[np.newaxis])
        tables.append(np.vstack(lines))
    a, b = tables
    is_same = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore"):
        return bool((is_same | (np.abs(a - b) <= bounds) | np.isinf(bounds)).all())


@pytest.mark.parametrize("runtime", RUNTIMES, ids=lambda one: one.name)
def test_chunks_and_single_rows_do_not_change_bits(runtime: Runtime) -> None:
    # Without library functions every way of calling gives the same bits.
    system = random_system(4, formulas="none", defuzzifier="of curves")
    program = from_system(system)
    run = runtime.load(system)
    values = values_of(system, random_rows(system, 1, 40))
    many = np.tile(values, 1 if runtime.is_slow else 30)
    whole = outputs_of(run(many))
    bounds = error_bounds(program, many)[:2]
    single = np.hstack([outputs_of(run(values[:, k : k + 1])) for k in range(40)])
    single = np.tile(single, many.shape[1] // 40)
    is_same = (single == whole) | (np.isnan(single) & np.isnan(whole))
    with np.errstate(invalid="ignore"):
        assert (is_same | (np.abs(single - whole) <= bounds)).all()
    assert outputs_of(run(np.empty((3, 0)))).shape == (2, 0)


@pytest.mark.parametrize("runtime", RUNTIMES, ids=lambda one: one.name)
def test_missing_rows_are_nan_and_have_that_status(runtime: Runtime) -> None:
    system = random_system(5, formulas="none")
    values = np.array([[0.0, math.nan], [0.0, 1.0], [math.inf, 0.0]])
    result = runtime.load(system)(values)
    assert result.status.tolist() == [3, 3]
    assert np.isnan(outputs_of(result)).all()
    assert result.strengths is not None
    assert np.isnan(result.strengths).all()


@pytest.mark.parametrize("runtime", RUNTIMES, ids=lambda one: one.name)
def test_values_of_a_wrong_shape_are_refused(runtime: Runtime) -> None:
    run = runtime.load(random_system(5, formulas="none"))
    with pytest.raises(ValueError, match="one line for each of the 3 inputs"):
        run(np.zeros((2, 5)))


def test_what_onnxruntime_lacks_in_double_is_a_loss() -> None:
    load = find_runtime("onnxruntime float64").load
    system = formula_system(Call("atan", (Name("a"),)))
    with pytest.raises(LossError) as caught:
        load(system)
    assert str(caught.value) == (
        "cannot write f as onnx: a formula needs atan, which onnxruntime computes in "
        "float32 only"
    )
    names = ["native", "onnxruntime float64"]
    assert check(system, limit=60, runtimes=names).skipped == (
        f"onnxruntime float64: {caught.value}",
    )


@pytest.mark.one_in(4)
@pytest.mark.parametrize(
    "function", ["exp", "log", "sin", "cos", "tanh", "sqrt", "floor", "ceil", "round"]
)
def test_functions_of_one_number_are_within_their_units(function: str) -> None:
    # Bits or the stated units, over signs, sizes, halves, zeros and what overflows.
    system = formula_system(Call(function, (Name("a"),)))
    chance = np.random.default_rng(7)
    sizes = 10.0 ** chance.uniform(-300, 300, 400)
    values = np.concatenate(
        [chance.normal(size=2000), chance.normal(size=2000) * 300, sizes, -sizes]
    )
    values = np.concatenate([values, [0.5, 1.5, 2.5, -0.5, 0.0, -0.0, 709.8, -745.2]])
    result = check(system, data=values.reshape(1, -1), limit=50)
    assert result.ok, [one.detail for one in result.comparisons]


@pytest.mark.one_in(2)
@pytest.mark.parametrize("function", ["^", "fmod", "%", "min", "max", "/"])
def test_functions_of_two_numbers_are_within_their_units(function: str) -> None:
    label = Term("f", Formula(Call(function, (Name("a"), Name("b")))))
    output = SystemOutput("y", (label,), None, None, Defuzzifier("weighted sum"))
    rule = SystemRule(None, (Conclusion("y", "f"),))
    inputs = (Variable("a"), Variable("b"))
    system = FuzzySystem("f", inputs, (output,), (RuleBlock((rule,)),))
    chance = np.random.default_rng(8)
    values = chance.normal(size=(2, 3000)) * [[5.0], [3.0]]
    values[:, ::7] = np.round(values[:, ::7])
    result = check(system, data=values, limit=50)
    assert result.ok, [one.detail for one in result.comparisons]
