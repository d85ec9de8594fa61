"""Programs on many rows, in numpy: one wide operation for each step.

Rows come features first and go through in chunks that fit the cache. What no input
enters (samples of an output's range, and curves over them) is computed once; results
are written into buffers that are used again as soon as nothing needs them.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.model import FuzzySystem, SystemOutcome, SystemRun, checkpoint
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

_WORKING_SET = 1 << 20  # numbers that all buffers of a chunk may hold together
_SMALLEST_CHUNK, _LARGEST_CHUNK = 512, 1 << 16


def _total(samples: Values, *, out: Values) -> Values:
    """Add the second half of the samples to the first until one is left."""
    size = 1 << (len(samples) - 1).bit_length()
    current = np.zeros((size // 2, *samples.shape[1:]))
    half = len(current)
    current += samples[:half]
    current[: len(samples) - half] += samples[half:]
    while half > 1:
        half //= 2
        current = np.add(current[:half], current[half:], out=current[:half])
    out[...] = current[0]
    return out


def _last(samples: Values, *, out: Values) -> Values:
    out[...] = samples[-1]
    return out


def _highest(samples: Values, *, out: Values) -> Values:
    return np.maximum.reduce(samples, axis=0, out=out)


def _lowest(samples: Values, *, out: Values) -> Values:
    return np.minimum.reduce(samples, axis=0, out=out)


def _running(samples: Values, *, out: Values) -> Values:
    return np.cumsum(samples, axis=0, out=out)


_OTHERS: Mapping[str, Function] = {
    "total": _total,
    "last": _last,
    "highest": _highest,
    "lowest": _lowest,
    "running": _running,
}


def _below(table: Sequence[float]) -> Function:
    numbers = np.array(table)

    def below(a: Values, *, out: Values) -> Values:
        out[...] = np.searchsorted(numbers, a)
        return out

    return below


def _pick(table: Sequence[float]) -> Function:
    numbers = np.array(table)

    def pick(a: Values, *, out: Values) -> Values:
        place = np.where((a >= 0) & (a < len(numbers)), a, 0).astype(np.intp)
        return numbers.take(place, out=out, mode="clip")

    return pick


def _function(step: Step) -> Function:
    if step.operation == "below":
        return _below(step.table)
    if step.operation == "pick":
        return _pick(step.table)
    return ARRAYS.get(step.operation) or _OTHERS[step.operation]


@dataclass(frozen=True, slots=True)
class _Shelf:
    """Where results of one type and one number of samples are kept.

    Attributes:
        dtype: The type.
        samples: How many samples; 0 for one number for a row.
        places: The step and the buffer of each result.
        count: How many buffers there are.
    """

    dtype: npt.DTypeLike
    samples: int
    places: tuple[tuple[int, int], ...]
    count: int


@dataclass(frozen=True, slots=True)
class ProgramPlan:
    """A program, ready to be run.

    Attributes:
        still: What no input enters, by step; None for the other steps.
        inputs: The step and the place among the inputs of each input.
        calls: Function, place of the result, places of the arguments. A function of
            three makes a result of its own, the others write into a buffer.
        shelves: The buffers.
        results: The step of each result.
        rows: How many rows go through together.
    """

    still: tuple[Values | None, ...]
    inputs: tuple[tuple[int, int], ...]
    calls: tuple[tuple[Function, int, tuple[int, ...]], ...]
    shelves: tuple[_Shelf, ...]
    results: tuple[int, ...]
    rows: int


def plan_program(program: Program) -> ProgramPlan:
    """Return what running a program needs, computed once."""
    still = _still_values(program)
    moving = [place for place, value in enumerate(still) if value is None]
    calls: list[tuple[Function, int, tuple[int, ...]]] = []
    inputs: list[tuple[int, int]] = []
    for place in moving:
        step = program.steps[place]
        if step.operation == "input":
            inputs.append((place, program.inputs.index(step.name)))
        elif step.operation == "where":
            calls.append((np.where, place, step.arguments))
        else:
            calls.append((_function(step), place, step.arguments))
    shelves = _shelves(
        program, [place for _, place, arguments in calls if len(arguments) < 3]
    )
    size = sum(shelf.count * max(shelf.samples, 1) for shelf in shelves)
    widest = max((program.steps[place].samples for place in moving), default=0)
    rows = _WORKING_SET // max(size, 2 * widest, 1)
    return ProgramPlan(
        still,
        tuple(inputs),
        tuple(calls),
        shelves,
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
    rows = values.shape[1]
    known: list[Any] = list(plan.still)
    for place, line in plan.inputs:
        known[place] = values[line]
    for shelf in plan.shelves:
        shape = (shelf.samples, rows) if shelf.samples else (rows,)
        buffers = [np.empty(shape, shelf.dtype) for _ in range(shelf.count)]
        for place, buffer in shelf.places:
            known[place] = buffers[buffer]
    for function, place, arguments in plan.calls:  # unpacked: for one row it matters
        if len(arguments) == 2:
            one, two = arguments
            function(known[one], known[two], out=known[place])
        elif len(arguments) == 1:
            function(known[arguments[0]], out=known[place])
        else:
            condition, one, two = arguments
            known[place] = function(known[condition], known[one], known[two])
    for line, place in enumerate(plan.results):
        out[line] = known[place]


def _still_values(program: Program) -> tuple[Values | None, ...]:
    """Return the results that are the same for all rows, samples as a column."""
    return tuple(
        None if value is None else _still_value(value)
        for value in still_results(program)
    )


def _still_value(numbers: StepValue) -> Values:
    value = np.array(numbers)
    return value.reshape(-1, 1) if isinstance(numbers, list) else value


def _shelves(program: Program, places: Sequence[int]) -> tuple[_Shelf, ...]:
    """Return buffers for some steps, each free again after its last use."""
    last = {place: place for place in range(len(program.steps))}
    for place, step in enumerate(program.steps):
        for argument in step.arguments:
            last[argument] = place
    for result in program.results:
        last[result.step] = len(program.steps)
    groups: dict[tuple[str, int], list[int]] = {}
    for place in places:
        step = program.steps[place]
        groups.setdefault((step.kind, step.samples), []).append(place)
    return tuple(
        _shelf(kind, samples, group, last) for (kind, samples), group in groups.items()
    )


def _shelf(
    kind: str, samples: int, places: Sequence[int], last: Mapping[int, int]
) -> _Shelf:
    free: list[int] = []
    busy: list[tuple[int, int]] = []  # the place of the last use and the buffer, a heap
    taken: list[tuple[int, int]] = []
    for place in places:
        checkpoint()
        while busy and busy[0][0] < place:
            free.append(heapq.heappop(busy)[1])
        buffer = free.pop() if free else len(busy)
        heapq.heappush(busy, (last[place], buffer))
        taken.append((place, buffer))
    dtype = np.bool_ if kind == "truth" else np.float64
    return _Shelf(dtype, samples, tuple(taken), len(busy) + len(free))


def run_system(system: FuzzySystem, /, *, activations: bool = False) -> SystemRun:
    """Return a function that runs a system's program in numpy.

    Example:
        >>> import numpy as np
        >>> from fuzzytree.testing import random_system
        >>> run_system(random_system(3))(np.zeros((3, 2))).outputs.shape
        (2, 2)
    """
    program = from_system(system, activations=activations)
    plan = plan_program(program)
    outputs, rules = len(system.outputs), len(system.rules)

    def run(values: FloatArray) -> SystemOutcome:
        results = run_program(plan, checked(values, system.columns))
        return SystemOutcome(
            results[:outputs],
            results[-1].astype(np.int64),
            results[outputs : outputs + rules] if activations else None,
        )

    return run
