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
    >>> tripled = x * 3.0
    >>> made = make.program("triple", ("x",), (result_of("output", "y", tripled),))
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
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from typing import Literal

from fuzzytree.model import Numbers, Value
from fuzzytree.semantics.programs.operations import (
    NOTHING,
    NUMERIC,
    OPERATIONS,
    OVER_SAMPLES,
    Kind,
    of_table,
)

ResultKind = Literal[
    "output", "activation", "strength", "rule", "class", "status", "probability"
]

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
            `fuzzytree.semantics.reference.Status` as a number. `probability`: of a
            class, NaN without a rule.
        name: Of the output or class; the rule's number, from 1, for activations and
            strengths.
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
        if self.kind == "probability":
            return f"probability of {self.name}"
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


class Place:
    """The place of a step in a program that is being made; operators add steps."""

    __slots__ = ("index", "make")

    def __init__(self, make: Maker, index: int) -> None:
        self.make, self.index = make, index

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Place) and self.index == other.index

    def __hash__(self) -> int:
        return hash(self.index)

    def __neg__(self) -> Place:
        return self.make("negate", self)

    def __abs__(self) -> Place:
        return self.make("absolute", self)

    def __add__(self, other: Place | float, /) -> Place:
        return self.make("add", self, other)

    def __radd__(self, other: float, /) -> Place:
        return self.make("add", other, self)

    def __sub__(self, other: Place | float, /) -> Place:
        return self.make("subtract", self, other)

    def __rsub__(self, other: float, /) -> Place:
        return self.make("subtract", other, self)

    def __mul__(self, other: Place | float, /) -> Place:
        return self.make("multiply", self, other)

    def __rmul__(self, other: float, /) -> Place:
        return self.make("multiply", other, self)

    def __truediv__(self, other: Place | float, /) -> Place:
        return self.make("divide", self, other)

    def __rtruediv__(self, other: float, /) -> Place:
        return self.make("divide", other, self)


def result_of(kind: ResultKind, name: str, place: Place) -> Result:
    """Return what a program is run for, by its place while it is made."""
    return Result(kind, name, place.index)


class Maker(Numbers[Place]):
    """Collects steps; a step that stands there already is not added again.

    Steps on constants alone are computed at once. `x * 1`, `x / 1`, `x - 0` and the
    smaller of x and x are x.

    Attributes:
        names: The values of variables, for formulas.
    """

    def __init__(self, names: Mapping[str, Place] = NOTHING) -> None:
        self.names = names
        self._steps: list[Step] = []
        self._titles: list[str] = []
        self._topic = ""
        self._known: dict[tuple[object, ...], int] = {}

    def chain(self, operation: str, numbers: Sequence[Place], /) -> Place:
        """Return an operation carried along from left to right."""
        total = numbers[0]
        for number in numbers[1:]:
            total = self(operation, total, number)
        return total

    def constant(self, number: float, /) -> Place:
        """Return the place of a constant."""
        return self._added(Step("constant", number=float(number)))

    def input(self, name: str) -> Place:
        """Return the place of an input's value."""
        return self._added(Step("input", name=name))

    def index(self, samples: int) -> Place:
        """Return the place of the numbers 0, 1, ... of as many samples."""
        return self._added(Step("index", samples=samples))

    def table(
        self, operation: str, argument: Place, table: Iterable[float], /
    ) -> Place:
        """Return the place of `below` or `pick`."""
        numbers = tuple(table)
        operands = self._steps[argument.index]
        if operands.operation == "constant":
            return self.constant(of_table(operation, numbers, operands.number))
        step = Step(
            operation, (argument.index,), table=numbers, samples=operands.samples
        )
        return self._added(step)

    def __call__(self, operation: str, /, *arguments: Place | float) -> Place:
        """Return the place of an operation on earlier steps and numbers."""
        places = tuple(
            one if isinstance(one, Place) else self.constant(one) for one in arguments
        )
        operands = [self._steps[place.index] for place in places]
        if all(step.operation == "constant" for step in operands):
            numbers = [step.number for step in operands]
            if operation in NUMERIC:
                return self.constant(NUMERIC[operation](*numbers))
        if _is_neutral(operation, operands):
            return places[0]
        if operation == "multiply" and _is_neutral(operation, operands[::-1]):
            return places[1]
        if operation in ("minimum", "maximum", "where"):
            *_, one, two = places
            if one == two:
                return one
        samples = 0
        if operation not in OVER_SAMPLES:
            samples = max((step.samples for step in operands), default=0)
        taken = tuple(place.index for place in places)
        return self._added(Step(operation, taken, samples=samples))

    @contextlib.contextmanager
    def topic(self, title: str) -> Generator[None]:
        """Title the steps that are added within after what they are part of.

        Example:
            >>> make = Maker()
            >>> with make.topic("force is low"):
            ...     low = -make.input("force")
            >>> strength = result_of("output", "strength", abs(low))
            >>> make.program("p", ("force",), (strength,)).titles
            ('force', 'force is low negate', 'strength')
        """
        before, self._topic = self._topic, title
        yield
        self._topic = before

    def titled(self, place: Place, title: str) -> Place:
        """Title a step, unless it has a title from elsewhere, and return its place."""
        step, index = self._steps[place.index], place.index
        if step.operation not in _LEAVES and self._titles[index] == self._part(step):
            self._titles[index] = title
        return place

    def number(self, place: Place) -> float | None:
        """Return the number of a constant, None if the step is none."""
        step = self._steps[place.index]
        return step.number if step.operation == "constant" else None

    def samples(self, place: Place) -> int:
        """Return how many samples a step has results for."""
        return self._steps[place.index].samples

    def program(
        self, name: str, inputs: tuple[str, ...], results: tuple[Result, ...]
    ) -> Program:
        """Return the steps that some results need, in order, and nothing else."""
        needed = needed_steps(self._steps, results)
        new = {old: place for place, old in enumerate(needed)}
        steps = tuple(_moved(self._steps[old], new) for old in new)
        moved = tuple(Result(one.kind, one.name, new[one.step]) for one in results)
        titles = [self._titles[old] for old in new]
        for one in moved:
            titles[one.step] = titles[one.step] or one.title
        return Program(name, inputs, steps, moved, tuple(titles))

    def _added(self, step: Step) -> Place:
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
        return Place(self, self._known[key])

    def _part(self, step: Step) -> str:
        """Return the title of a step that is part of the topic."""
        if step.operation in _LEAVES or not self._topic:
            return step.name
        return f"{self._topic} {step.operation.replace('_', ' ')}"


def needed_steps(steps: Sequence[Step], results: Iterable[Result]) -> list[int]:
    """Return the places of the steps that some results need, in order."""
    needed: set[int] = set()
    todo = [result.step for result in results]
    while todo:
        place = todo.pop()
        if place not in needed:
            needed.add(place)
            todo += steps[place].arguments
    return sorted(needed)


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
