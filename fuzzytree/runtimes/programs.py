"""Programs on many rows, in numpy: one wide operation for each step.

Rows come features first and go through in chunks that fit the cache. What no input
enters (samples of an output's range, and curves over them) is computed once; a result
is forgotten as soon as no step needs it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.model import FuzzySystem, Outcome, Run, checkpoint
from fuzzytree.runtimes.rows import checked
from fuzzytree.semantics import (
    ARRAYS,
    Program,
    Step,
    StepValue,
    from_system,
    still_results,
)

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray

    Values = npt.NDArray[Any]
    Function = Callable[..., Values]

_WORKING_SET = 1 << 20  # numbers of a chunk that may be known together
_SMALLEST_CHUNK, _LARGEST_CHUNK = 512, 1 << 16


def _total(samples: Values) -> Values:
    """Add the second half of the samples to the first until one is left."""
    size = 1 << (len(samples) - 1).bit_length()
    current = np.zeros((size // 2, *samples.shape[1:]))
    half = len(current)
    current += samples[:half]
    current[: len(samples) - half] += samples[half:]
    while half > 1:
        half //= 2
        current = np.add(current[:half], current[half:], out=current[:half])
    total: Values = current[0]
    return total


def _last(samples: Values) -> Values:
    last: Values = samples[-1]
    return last


_OTHERS: Mapping[str, Function] = {
    "total": _total,
    "last": _last,
    "highest": partial(np.max, axis=0),
    "lowest": partial(np.min, axis=0),
    "running": partial(np.cumsum, axis=0),
    "where": np.where,
}


def _below(table: Sequence[float]) -> Function:
    numbers = np.array(table)

    def below(a: Values) -> Values:
        return np.searchsorted(numbers, a).astype(np.float64)

    return below


def _pick(table: Sequence[float]) -> Function:
    numbers = np.array(table)

    def pick(a: Values) -> Values:
        place = np.where((a >= 0) & (a < len(numbers)), a, 0).astype(np.intp)
        return numbers.take(place, mode="clip")

    return pick


def _function(step: Step) -> Function:
    if step.operation == "below":
        return _below(step.table)
    if step.operation == "pick":
        return _pick(step.table)
    return ARRAYS.get(step.operation) or _OTHERS[step.operation]


@dataclass(frozen=True, slots=True)
class ProgramPlan:
    """A program, ready to be run.

    Attributes:
        still: What no input enters, by step; None for the other steps.
        inputs: The step and the place among the inputs of each input.
        calls: Function, place of the result, places of the arguments, and of what no
            later step needs.
        results: The step of each result.
        rows: How many rows go through together.
    """

    still: tuple[Values | None, ...]
    inputs: tuple[tuple[int, int], ...]
    calls: tuple[tuple[Function, int, tuple[int, ...], tuple[int, ...]], ...]
    results: tuple[int, ...]
    rows: int


def plan_program(program: Program) -> ProgramPlan:
    """Return what running a program needs, computed once."""
    still = tuple(map(_still_value, still_results(program)))
    last: dict[int, int] = {}  # the step that is the last to need another one
    for place, step in enumerate(program.steps):
        last |= dict.fromkeys(step.arguments, place)
    for result in program.results:
        last.pop(result.step, None)
    calls: list[tuple[Function, int, tuple[int, ...], tuple[int, ...]]] = []
    inputs: list[tuple[int, int]] = []
    live = most = widest = 0  # numbers that are known together, for each row
    for place, value in enumerate(still):
        step = program.steps[place]
        if step.operation == "input":
            inputs.append((place, program.inputs.index(step.name)))
        elif value is None:
            checkpoint()
            ended = [k for k in {*step.arguments} if still[k] is None]
            ended = [k for k in ended if last.get(k) == place]
            calls.append((_function(step), place, step.arguments, tuple(ended)))
            live += max(step.samples, 1)
            most, widest = max(most, live), max(widest, step.samples)
            live -= sum(max(program.steps[k].samples, 1) for k in ended)
    rows = _WORKING_SET // max(most, 2 * widest, 1)
    return ProgramPlan(
        still,
        tuple(inputs),
        tuple(calls),
        tuple(result.step for result in program.results),
        min(max(rows, 1 if widest else _SMALLEST_CHUNK), _LARGEST_CHUNK),
    )


def run_program(plan: ProgramPlan, values: FloatArray) -> FloatArray:
    """Return the results for many rows, of shape (results, rows).

    `values` has shape (inputs, rows), in the order of the program's inputs.

    Example:
        >>> from fuzzytree.semantics.programs.steps import Maker, result_of
        >>> make = Maker()
        >>> x = make.input("x")
        >>> twice = result_of("output", "y", make("add", x, x))
        >>> program = make.program("twice", ("x",), (twice,))
        >>> run_program(plan_program(program), np.array([[1.0, 2.5]]))
        array([[2., 5.]])
    """
    count = values.shape[1]
    results = np.empty((len(plan.results), count))
    with np.errstate(all="ignore"):
        for start in range(0, count, plan.rows):
            checkpoint()
            part = values[:, start : start + plan.rows]
            out = results[:, start : start + plan.rows]
            _run_chunk(plan, np.ascontiguousarray(part), out)
    return results


def _run_chunk(plan: ProgramPlan, values: FloatArray, out: FloatArray) -> None:
    known: list[Any] = list(plan.still)
    for place, line in plan.inputs:
        known[place] = values[line]
    for function, place, arguments, ended in plan.calls:
        known[place] = function(*[known[argument] for argument in arguments])
        for argument in ended:
            known[argument] = None
    for line, place in enumerate(plan.results):
        out[line] = known[place]


def _still_value(numbers: StepValue | None) -> Values | None:
    """Return a result that is the same for all rows, samples as a column."""
    if numbers is None:
        return None
    value = np.array(numbers)
    return value.reshape(-1, 1) if isinstance(numbers, list) else value


def run_system(system: FuzzySystem, /, *, with_strengths: bool = True) -> Run:
    """Return a function that runs a system's program in numpy.

    Example:
        >>> import numpy as np
        >>> from fuzzytree.testing import random_system
        >>> run_system(random_system(3))(np.zeros((3, 2))).outputs.shape
        (2, 2)
    """
    plan = plan_program(from_system(system, activations=with_strengths))

    def run(values: FloatArray) -> Outcome:
        numbers = run_program(plan, checked(values, system.inputs))
        outputs, strengths = np.split(numbers[:-1], [len(system.outputs)])
        status = numbers[-1].astype(np.int64)
        fired = strengths if with_strengths else None
        return Outcome(np.zeros_like(status), status, fired, outputs=outputs)

    return run
