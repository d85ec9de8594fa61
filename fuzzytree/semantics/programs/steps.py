r"""Programs: a model as a fixed sequence of operations on numbers.

A program is a list of steps, each an operation on the results of steps before it, so
that it can be run, or written down in another language, by one loop. What each
operation means stands in `fuzzytree.semantics.programs.operations`. Some steps have one
result for a row; others have one for each of a fixed number of samples (the values at
which an output's range is looked at), and mixing the two spreads the single result over
all samples.

Example:
    A writer of C-like text, whole:

    >>> SIGNS = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/"}
    >>> def written(program):
    ...     for place, step in enumerate(program.steps):
    ...         names = [f"v{argument}" for argument in step.arguments]
    ...         if step.operation == "constant":
    ...             yield f"v{place} = {step.number!r}"
    ...         elif step.operation == "input":
    ...             yield f"v{place} = {step.name}"
    ...         elif step.operation in SIGNS:
    ...             yield f"v{place} = {names[0]} {SIGNS[step.operation]} {names[1]}"
    ...         else:
    ...             yield f"v{place} = {step.operation}({', '.join(names)})"
    ...     for result in program.results:
    ...         yield f"{result.kind} {result.name}: v{result.step}"
    >>> make = Maker()
    >>> x = make.input("x")
    >>> tripled = make("multiply", x, make.constant(3.0))
    >>> made = make.program("triple", ("x",), (Result("output", "y", tripled),))
    >>> print("\n".join(written(made)))
    v0 = x
    v1 = 3.0
    v2 = v0 * v1
    output y: v2
"""

from __future__ import annotations

import contextlib
import math
import struct
from collections.abc import Generator, Iterable, Iterator, Sequence
from typing import Literal

from fuzzytree.model import Value
from fuzzytree.semantics.programs.operations import (
    NUMERIC,
    OPERATIONS,
    OVER_SAMPLES,
    Kind,
    Numbers,
    of_table,
)

ResultKind = Literal["output", "activation", "strength", "rule", "class", "status"]

_LEAVES = ("constant", "input", "index")


class Step(Value, frozen=True):
    """One operation; its result is known by its place in the program.

    Attributes:
        operation: A key of `fuzzytree.semantics.programs.operations.OPERATIONS`.
        arguments: The places of earlier steps.
        number: Of a constant.
        name: Of an input.
        table: Of `below` and `pick`.
        samples: How many samples it has a result for; 0 if it has one for a row.
    """

    operation: str
    arguments: tuple[int, ...] = ()
    number: float = 0.0
    name: str = ""
    table: tuple[float, ...] = ()
    samples: int = 0

    @property
    def kind(self) -> Kind:
        """Whether the result is a number or a truth."""
        return OPERATIONS[self.operation].gives


class Result(Value, frozen=True):
    """A number that a program is run for.

    Attributes:
        kind: `output`: of a system's output. `activation`, `strength`: of a rule, 0 to
            1. `rule`: the winner's number from 1, or 0. `class`: the place of the
            answer among the classes, or -1. `status`: a
            `fuzzytree.semantics.reference.Status` as a number.
        name: Of the output; the rule's number, from 1, for activations and strengths.
        step: The place of the step that it is the result of.
    """

    kind: ResultKind
    name: str
    step: int

    @property
    def title(self) -> str:
        """What it is, in words."""
        if self.kind in ("activation", "strength"):
            return f"rule {self.name} {self.kind}"
        return self.name


class Program(Value, frozen=True):
    """Steps in the order in which they are run, and what they are run for.

    Attributes:
        name: Of the model.
        inputs: The names of its inputs, in order, whether used or not.
        steps: The steps; every argument stands before the step that uses it.
        results: What is wanted, of steps with one number for a row.
        titles: What each step computes, in words, or "" for it; () for no words.

    Raises:
        ValueError: If a step is no operation on steps before it; it names the first.
    """

    name: str
    inputs: tuple[str, ...]
    steps: tuple[Step, ...]
    results: tuple[Result, ...]
    titles: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse a program that cannot be run."""
        for text in _mistakes(self):
            raise ValueError(f"{self.name}: {text}")

    def of(self, kind: ResultKind) -> tuple[int, ...]:
        """Return the places of the results of a kind, in order."""
        return tuple(one.step for one in self.results if one.kind == kind)

    @property
    def size(self) -> int:
        """How many numbers are computed for one row."""
        return sum(step.samples or 1 for step in self.steps)


class Maker(Numbers[int]):
    """Collects steps; a step that stands there already is not added again.

    Steps on constants alone are computed at once. `x * 1`, `x / 1`, `x - 0` and the
    smaller of x and x are x.
    """

    def __init__(self) -> None:
        self._steps: list[Step] = []
        self._titles: list[str] = []
        self._topic = ""
        self._known: dict[tuple[object, ...], int] = {}

    def constant(self, number: float, /) -> int:
        """Return the place of a constant."""
        return self._added(Step("constant", number=float(number)))

    def input(self, name: str) -> int:
        """Return the place of an input's value."""
        return self._added(Step("input", name=name))

    def index(self, samples: int) -> int:
        """Return the place of the numbers 0, 1, ... of as many samples."""
        return self._added(Step("index", samples=samples))

    def table(self, operation: str, argument: int, table: Iterable[float]) -> int:
        """Return the place of `below` or `pick`."""
        numbers = tuple(table)
        operands = self._steps[argument]
        if operands.operation == "constant":
            return self.constant(of_table(operation, numbers, operands.number))
        step = Step(operation, (argument,), table=numbers, samples=operands.samples)
        return self._added(step)

    def __call__(self, operation: str, /, *arguments: int) -> int:
        """Return the place of an operation on earlier steps."""
        operands = [self._steps[argument] for argument in arguments]
        if all(step.operation == "constant" for step in operands):
            numbers = [step.number for step in operands]
            if operation in NUMERIC:
                return self.constant(NUMERIC[operation](*numbers))
        if _is_neutral(operation, operands):
            return arguments[0]
        if operation == "multiply" and _is_neutral(operation, operands[::-1]):
            return arguments[1]
        if operation in ("minimum", "maximum", "where"):
            *_, one, two = arguments
            if one == two:
                return one
        samples = 0
        if operation not in OVER_SAMPLES:
            samples = max((step.samples for step in operands), default=0)
        return self._added(Step(operation, arguments, samples=samples))

    @contextlib.contextmanager
    def topic(self, title: str) -> Generator[None]:
        """Title the steps that are added within after what they are part of.

        Example:
            >>> make = Maker()
            >>> with make.topic("force is low"):
            ...     low = make("negate", make.input("force"))
            >>> strength = Result("output", "strength", make("absolute", low))
            >>> make.program("p", ("force",), (strength,)).titles
            ('force', 'force is low negate', 'strength')
        """
        before, self._topic = self._topic, title
        yield
        self._topic = before

    def titled(self, place: int, title: str) -> int:
        """Title a step, unless it has a title from elsewhere, and return its place."""
        step = self._steps[place]
        if step.operation not in _LEAVES and self._titles[place] == self._part(step):
            self._titles[place] = title
        return place

    def number(self, place: int) -> float | None:
        """Return the number of a constant, None if the step is none."""
        step = self._steps[place]
        return step.number if step.operation == "constant" else None

    def samples(self, place: int) -> int:
        """Return how many samples a step has results for."""
        return self._steps[place].samples

    def program(
        self, name: str, inputs: tuple[str, ...], results: tuple[Result, ...]
    ) -> Program:
        """Return the steps that some results need, in order, and nothing else."""
        needed: set[int] = set()
        todo = [result.step for result in results]
        while todo:
            place = todo.pop()
            if place not in needed:
                needed.add(place)
                todo += self._steps[place].arguments
        new = {old: place for place, old in enumerate(sorted(needed))}
        steps = tuple(_moved(self._steps[old], new) for old in new)
        moved = tuple(Result(one.kind, one.name, new[one.step]) for one in results)
        titles = [self._titles[old] for old in new]
        for one in moved:
            titles[one.step] = titles[one.step] or one.title
        return Program(name, inputs, steps, moved, tuple(titles))

    def _added(self, step: Step) -> int:
        key = (
            step.operation,
            step.arguments,
            struct.pack(
                "<d", step.number
            ),  # distinguishes -0.0 from 0.0, and knows NaN
            step.name,
            struct.pack(f"<{len(step.table)}d", *step.table),
            step.samples,
        )
        if key not in self._known:
            self._known[key] = len(self._steps)
            self._steps.append(step)
            self._titles.append(self._part(step))
        return self._known[key]

    def _part(self, step: Step) -> str:
        """Return the title of a step that is part of the topic."""
        if step.operation in _LEAVES or not self._topic:
            return step.name
        return f"{self._topic} {step.operation.replace('_', ' ')}"


def _moved(step: Step, new: dict[int, int]) -> Step:
    places = tuple(new[argument] for argument in step.arguments)
    return Step(
        step.operation, places, step.number, step.name, step.table, step.samples
    )


def _is_neutral(operation: str, operands: Sequence[Step]) -> bool:
    """Return whether an operation gives its first argument as it is."""
    if len(operands) != 2 or operands[1].operation != "constant":
        return False
    number = operands[1].number
    if operation in ("multiply", "divide"):
        return number == 1.0
    return operation == "subtract" and number == 0.0 and math.copysign(1, number) > 0


def _mistakes(program: Program) -> Iterator[str]:
    """Yield what is wrong with a program's steps and results."""
    for place, step in enumerate(program.steps):
        known = OPERATIONS.get(step.operation)
        where = f"step {place}"
        if known is None:
            yield f"{where}: no operation {step.operation!r}"
            return
        if any(not 0 <= argument < place for argument in step.arguments):
            yield f"{where}: {step.operation} needs steps before it"
            return
        operands = [program.steps[argument] for argument in step.arguments]
        if tuple(one.kind for one in operands) != known.takes:
            yield f"{where}: {step.operation} takes {', '.join(known.takes)}"
        if step.operation == "input" and step.name not in program.inputs:
            yield f"{where}: no input {step.name!r}"
        if step.operation in ("below", "pick") and not step.table:
            yield f"{where}: {step.operation} needs a table"
        lengths = {one.samples for one in operands} - {0}
        expected = max(lengths, default=0)
        if step.operation in OVER_SAMPLES:
            expected = 0 if expected else -1
        if len(lengths) > 1 or (step.operation != "index" and expected != step.samples):
            yield f"{where}: {step.operation} mixes different numbers of samples"
    for result in program.results:
        if not 0 <= result.step < len(program.steps):
            yield f"the result {result.name!r} is no step"
        elif program.steps[result.step].samples:
            yield f"the result {result.name!r} has many samples"
