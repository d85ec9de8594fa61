"""Running a program on one row, in plain Python: what every other runner must match."""

from __future__ import annotations

import functools
from collections.abc import Mapping

import msgspec

from fuzzytree.semantics.programs.operations import (
    LOGICAL,
    NUMERIC,
    maximum,
    minimum,
    of_table,
    total,
)
from fuzzytree.semantics.programs.steps import Program, ResultKind, Step

StepValue = float | bool | list[float] | list[bool]


class ProgramNumbers(msgspec.Struct, frozen=True):
    """The results of a program for one row."""

    program: Program
    values: tuple[float, ...]

    def of(self, kind: ResultKind) -> tuple[float, ...]:
        """Return the numbers of a kind, in order."""
        pairs = zip(self.program.results, self.values, strict=True)
        return tuple(value for result, value in pairs if result.kind == kind)


def evaluate_program(program: Program, row: Mapping[str, float]) -> ProgramNumbers:
    """Run a program on one row.

    Raises:
        KeyError: If an input has no value.

    Example:
        >>> from fuzzytree.semantics.programs.rule_program import from_rules
        >>> from fuzzytree.model.rulebase import (
        ...     Band, Proposition, Rule, RuleBase, Term, Variable
        ... )
        >>> low = Term("low", Band(high=1.0, right=3.0))
        >>> rules = RuleBase(
        ...     "grip", ("soft",), (Variable("force", (low,)),),
        ...     (Rule((Proposition("force", ("low",)),), "soft"),),
        ... )
        >>> evaluate_program(from_rules(rules), {"force": 2.0}).of("strength")
        (0.5,)
    """
    step_values: list[StepValue] = []
    for step in program.steps:
        step_values.append(
            _result(step, [step_values[place] for place in step.arguments], row)
        )
    values: list[float] = []
    for result in program.results:
        value = step_values[result.step]
        if isinstance(value, list):  # a program cannot be made of such results
            raise TypeError(f"{result.name} has many samples")
        values.append(float(value))
    return ProgramNumbers(program, tuple(values))


def still_results(program: Program) -> tuple[StepValue | None, ...]:
    """Return the results that no input enters, by step; None for the other steps.

    Runners compute these once, here, and so with Python's own functions.

    Example:
        >>> from fuzzytree.semantics.programs.steps import Maker, result_of
        >>> make = Maker()
        >>> grid = make("multiply", make.index(3), make.constant(0.5))
        >>> scaled = make("total", make("multiply", make.input("x"), grid))
        >>> program = make.program("p", ("x",), (result_of("output", "y", scaled),))
        >>> still_results(program)
        ([0.0, 1.0, 2.0], 0.5, [0.0, 0.5, 1.0], None, None, None)
    """
    results: list[StepValue | None] = []
    for step in program.steps:
        operands = [results[place] for place in step.arguments]
        known = [value for value in operands if value is not None]
        is_moving = step.operation == "input" or len(known) < len(operands)
        results.append(None if is_moving else _result(step, known, {}))
    return tuple(results)


def _result(
    step: Step, operands: list[StepValue], row: Mapping[str, float]
) -> StepValue:
    match step.operation:
        case "constant":
            return step.number
        case "input":
            return float(row[step.name])
        case "index":
            return [float(place) for place in range(step.samples)]
        case "total" | "running" | "last" | "highest" | "lowest":
            (samples,) = operands
            if not isinstance(samples, list):  # a program cannot be made of such steps
                raise TypeError(f"{step.operation} of a single number")
            return _over_samples(step.operation, list(map(float, samples)))
        case _ if not step.samples:
            return _one(step, operands)
        case _:
            return [
                _one(
                    step, [one[i] if isinstance(one, list) else one for one in operands]
                )
                for i in range(step.samples)
            ]


def _one(step: Step, operands: list[StepValue]) -> float | bool:
    if step.table:
        (value,) = operands
        return of_table(step.operation, step.table, float(value))  # type: ignore[arg-type] # no list
    if step.operation in LOGICAL:
        return LOGICAL[step.operation](*operands)
    return NUMERIC[step.operation](*operands)


def _over_samples(operation: str, samples: list[float]) -> float | list[float]:
    if operation == "total":
        return total(samples)
    if operation == "last":
        return samples[-1]
    if operation == "highest":
        return functools.reduce(maximum, samples)
    if operation == "lowest":
        return functools.reduce(minimum, samples)
    sums: list[float] = []
    for value in samples:
        sums.append(sums[-1] + value if sums else value)
    return sums
