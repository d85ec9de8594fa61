"""Angles and logarithms of operations that every runtime rounds alike."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fuzzytree.runtimes.programs import plan_program, run_program
from fuzzytree.semantics.programs.evaluate import evaluate_program
from fuzzytree.semantics.programs.operations import INEXACT
from fuzzytree.semantics.programs.steps import Maker, Program, result_of
from fuzzytree.tactile.features.moments import angle, signed_log


def log_program() -> Program:
    make = Maker()
    found = signed_log(make.input("x"))
    return make.program("log", ("x",), (result_of("output", "y", found),))


def angle_program() -> Program:
    make = Maker()
    found = angle(make.input("y"), make.input("x"))
    return make.program("angle", ("x", "y"), (result_of("output", "a", found),))


@pytest.mark.parametrize("program", [log_program(), angle_program()], ids=str)
def test_no_operation_is_left_to_a_library(program: Program) -> None:
    assert not INEXACT & {step.operation for step in program.steps}


def test_a_signed_logarithm_is_that_of_the_library_within_its_bound() -> None:
    x = np.concatenate([[0.0], np.logspace(-18, 60, 20_001)])
    x = np.concatenate([x, -x])
    found = run_program(plan_program(log_program()), x[np.newaxis])[0]
    wanted = np.sign(x) * np.log1p(np.abs(x))
    assert np.abs(found - wanted).max() <= 1e-12


def test_a_larger_number_never_has_a_clearly_smaller_logarithm() -> None:
    x = np.sort(np.random.default_rng(0).lognormal(0, 20, 20_000))
    found = run_program(plan_program(log_program()), x[np.newaxis])[0]
    assert np.diff(found).min() >= -5e-13


def test_an_angle_is_that_of_the_library_within_its_bound() -> None:
    turn = np.linspace(-math.pi, math.pi, 40_001)
    size = np.random.default_rng(0).lognormal(0, 30, len(turn))
    x, y = size * np.cos(turn), size * np.sin(turn)
    found = run_program(plan_program(angle_program()), np.array([x, y]))[0]
    assert np.abs(found - np.degrees(np.arctan2(y, x))).max() <= 6e-14


@pytest.mark.parametrize(
    ("x", "y", "degrees"),
    [
        (0.0, 0.0, 0.0),
        (3.0, 0.0, 0.0),
        (0.0, 1e-200, 90.0),
        (-1e200, 0.0, 180.0),
        (0.0, -2.0, -90.0),
        (5.0, 5.0, 45.0),
    ],
)
def test_an_angle_is_exact_on_the_axes(x: float, y: float, degrees: float) -> None:
    found = evaluate_program(angle_program(), {"x": x, "y": y}).values[0]
    assert found == pytest.approx(degrees, abs=0 if degrees % 90 == 0 else 1e-14)


def test_the_logarithm_of_less_than_nothing_is_no_negative_zero() -> None:
    make = Maker()
    results = (result_of("output", "v", signed_log(make.input("x"))),)
    program = make.program("log", ("x",), results)
    assert [str(v) for v in evaluate_program(program, {"x": -1e-18}).values] == ["0.0"]
