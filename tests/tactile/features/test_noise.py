"""Numbers with a bound of their rounding error."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest

from fuzzytree.semantics.programs.evaluate import evaluate_program
from fuzzytree.semantics.programs.steps import Maker, result_of
from fuzzytree.tactile.features.moments import Noisy

Operation = Callable[[Noisy, Noisy], Noisy]
OPERATIONS: dict[str, tuple[Operation, Callable[[Fraction, Fraction], Fraction]]] = {
    "sum": (lambda a, b: a + b, lambda a, b: a + b),
    "difference": (lambda a, b: a - b, lambda a, b: a - b),
    "product": (lambda a, b: a * b, lambda a, b: a * b),
    "times": (lambda a, b: a * -3.0, lambda a, b: -3 * a),
}


@pytest.mark.parametrize("name", OPERATIONS)
def test_the_true_result_lies_within_the_bound_wherever_its_arguments_do(
    name: str,
) -> None:
    make = Maker()
    one, two = (
        Noisy(make.input(k), make.input(f"error {k}")) for k in ("a", "b")
    )  # fmt: skip
    operation, exact = OPERATIONS[name]
    found = operation(one, two)
    assert found.error is not None
    results = [
        result_of("output", "v", found.value),
        result_of("output", "e", found.error),
    ]
    inputs = ("a", "error a", "b", "error b")
    program = make.program(name, inputs, tuple(results))
    draw = np.random.default_rng(5)
    for _ in range(300):
        a, b = draw.normal(size=2) * 2.0 ** draw.integers(-40, 40, 2)
        errors = np.abs([a, b]) * 2.0 ** draw.integers(-60, 1, 2)
        row = dict(zip(inputs, map(float, (a, errors[0], b, errors[1])), strict=True))
        value, bound = evaluate_program(program, row).values
        allowed = Fraction(bound) * (1 + Fraction(2) ** -40)
        for turn in (1, -1):
            for other in (1, -1):
                true = exact(
                    Fraction(a) + turn * Fraction(errors[0]),
                    Fraction(b) + other * Fraction(errors[1]),
                )
                assert abs(Fraction(value) - true) <= allowed


def test_what_is_within_its_bound_is_exactly_0_and_the_rest_is_untouched() -> None:
    make = Maker()
    settled = Noisy(make.input("a"), make.input("e")).settled()
    program = make.program("s", ("a", "e"), (result_of("output", "v", settled),))
    for value, error, wanted in (
        (1e-9, 1e-9, 0.0),
        (-1e-9, 2e-9, 0.0),
        (1e-9, 9e-10, 1e-9),
        (-5.0, 0.0, -5.0),
    ):
        assert evaluate_program(program, {"a": value, "e": error}).values == (wanted,)
