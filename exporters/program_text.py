"""What writers of programs share: numbers, comments, steps and examples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fuzzytree.model import FuzzySystem, FuzzyTree, Model
from fuzzytree.numerics import rounded
from fuzzytree.semantics import (
    Answer,
    Program,
    Row,
    Step,
    StepValue,
    descend,
    error_bounds,
    evaluate,
    from_system,
    infer,
    still_results,
)


@dataclass(frozen=True, slots=True)
class NumberType:
    """A number type of a language: its name there, and its type in numpy."""

    name: str
    kind: type[np.float64] | type[np.float32]

    @property
    def below_one(self) -> float:
        """The largest number below 1."""
        return float(np.nextafter(self.kind(1), self.kind(0)))

    @property
    def largest(self) -> float:
        """The largest number."""
        return float(np.finfo(self.kind).max)

    def rounded(
        self, values: Sequence[float], *, is_divisor: bool = False
    ) -> list[float]:
        """Return numbers of the type, never infinite; a divisor is never 0."""
        result: list[float] = rounded(values, self.kind, is_divisor=is_divisor).tolist()
        return result


def one_line(text: str, pairs: Sequence[str]) -> str:
    """Return text as a line of ASCII, its pairs of characters separated by a space."""
    plain = text.encode("unicode_escape").decode("ascii")
    for pair in pairs:
        while pair in plain:
            plain = plain.replace(pair, f"{pair[0]} {pair[1]}")
    return plain


class StepText:
    """The steps of a program as text; those that no input enters are computed here.

    Attributes:
        program: The program.
        still: The results of steps that no input enters, None for the others.
        needs: The operations that the steps call as functions.
    """

    signs: ClassVar[Mapping[str, str]] = {
        "add": "+",
        "subtract": "-",
        "multiply": "*",
        "divide": "/",
        "less": "<",
        "at_most": "<=",
        "equal": "==",
        "and": "&&",
        "or": "||",
    }

    def __init__(self, program: Program) -> None:
        self.program = program
        self.still: tuple[StepValue | None, ...] = still_results(program)
        self.needs: set[str] = set()

    def value(self, place: int) -> str:
        """Return a step's result as an expression; of samples, the i-th."""
        raise NotImplementedError

    def called(self, step: Step, operands: Sequence[str]) -> str:
        """Return a step as the call of a function."""
        raise NotImplementedError

    def expression(self, step: Step) -> str:
        """Return a step as an expression of C or JavaScript."""
        operands = [self.value(argument) for argument in step.arguments]
        match step.operation:
            case "input":
                return f"x[{self.program.inputs.index(step.name)}]"
            case "where":
                return f"{operands[0]} ? {operands[1]} : {operands[2]}"
            case "not" | "negate":
                return f"{'!' if step.operation == 'not' else '-'}{operands[0]}"
            case operation if operation in self.signs:
                return f"{operands[0]} {self.signs[operation]} {operands[1]}"
            case _:
                return self.called(step, operands)


def answer_of(model: Model, row: Row) -> Answer:
    """Return the reference's prediction for a row."""
    return descend(model, row) if isinstance(model, FuzzyTree) else evaluate(model, row)


def digest_of(words: Sequence[int]) -> int:
    """Return 32 bits that change if any bit of some words of 32 bits does."""
    digest = 2166136261
    for word in words:
        digest = (digest ^ word) * 16777619 & 0xFFFFFFFF
    return digest


SystemExample = tuple[list[float], tuple[float, ...], list[float], int]
"""Inputs, numbers, how far each of these may be off, and the status."""


def system_examples(
    system: FuzzySystem, rows: Sequence[Row], *, activations: bool = False
) -> Iterator[SystemExample]:
    """Yield what the inference answers to rows: outputs, and activations if wanted."""
    program = from_system(system, activations=activations)
    table = np.array([[row[name] for row in rows] for name in program.inputs])
    values = table.reshape(len(program.inputs), len(rows)).astype(np.float64)
    every: list[list[float]] = error_bounds(program, values)[:-1].T.tolist()
    for row, bounds in zip(rows, every, strict=True):
        answer = infer(system, row)
        result = answer.outputs + (answer.activations if activations else ())
        operands = [row[name] for name in system.columns]
        yield operands, result, bounds, int(answer.status)
