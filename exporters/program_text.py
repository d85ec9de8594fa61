"""What writers of programs share: numbers, comments, steps, tables and examples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fuzzytree.model import (
    LR,
    Band,
    Document,
    Flank,
    FuzzySystem,
    FuzzyTree,
    Model,
    Node,
    Points,
    RuleBase,
    Shape,
    Side,
    Variable,
    intervals,
    shapes_of,
)
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


def title_of(model: Document, name: str) -> str:
    """Return what a file is of, with the model's name as the file may write it."""
    kinds = {FuzzyTree: "tree", RuleBase: "rule base", FuzzySystem: "system"}
    return f"A fuzzy {kinds[type(model)]}, named {name}"


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
        steps: Its steps.
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
        self.program, self.steps = program, program.steps
        self.still: tuple[StepValue | None, ...] = still_results(program)
        self.needs: set[str] = set()

    def value(self, place: int) -> str:
        """Return a step's result as an expression; of samples, the i-th."""
        raise NotImplementedError

    def call(self, step: Step, operands: Sequence[str]) -> str:
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
                return self.call(step, operands)


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


TableRow = tuple[object, ...]


def places_of(variables: Sequence[Variable]) -> dict[str, int]:
    """Return the place of each variable's value: inputs first, then combinations."""
    inputs = [variable.name for variable in variables if not variable.parts]
    mixed = [variable.name for variable in variables if variable.parts]
    return {name: place for place, name in enumerate([*inputs, *mixed])}


def combination_row(variable: Variable, places: dict[str, int]) -> TableRow:
    """Return the place of an input, weight and centre of each part."""
    return tuple((places[p.input], p.weight, p.centre) for p in variable.parts)


def targets_of(node: Node) -> tuple[int, ...]:
    """Return, for each interval, the place of the next node or -k for leaf k."""
    ends = [
        -branch.leaf if branch.leaf is not None else (branch.node or 0) - 1
        for branch in node.branches
    ]
    return tuple(ends[owner] for owner in node.owners)


def node_rows(
    tree: FuzzyTree, places: dict[str, int]
) -> Iterator[tuple[TableRow, Node, list[str]]]:
    """Yield each node's place of the value, cuts and targets; and its terms' names."""
    for node in tree.nodes:
        counts = [0] * len(node.branches)
        names: list[str] = []
        for owner, _ in zip(node.owners, intervals(node), strict=True):
            names.append(node.branches[owner].terms[counts[owner]])
            counts[owner] += 1
        yield (places[node.variable], node.cuts, targets_of(node)), node, names


class RuleRows:
    """A rule base as rows.

    Attributes:
        clauses: The place of the value, the places of terms, and if it is negated.
        rules: The places of each rule's clauses.
        terms: Variable and name of each term, and its kind and numbers.
    """

    def __init__(self, rules: RuleBase, places: dict[str, int]) -> None:
        shapes = shapes_of(rules.variables)
        clauses = list(dict.fromkeys(c for rule in rules.rules for c in rule.when))
        keys = dict.fromkeys((c.variable, term) for c in clauses for term in c.terms)
        term = {key: place for place, key in enumerate(keys)}
        clause = {one: place for place, one in enumerate(clauses)}
        self.clauses: list[TableRow] = [
            (
                places[one.variable],
                tuple(term[one.variable, name] for name in one.terms),
                one.negated,
            )
            for one in clauses
        ]
        self.rules = [tuple(clause[one] for one in rule.when) for rule in rules.rules]
        self.terms = [(*key, _shape_row(shapes[key])) for key in keys]


def _shape_row(shape: Shape) -> TableRow:
    match shape:
        case Band(low=low, high=high, left=left, right=right):
            return "band", low, high, _flank(left), _flank(right)
        case LR(mean=mean, left=left, right=right):
            return "lr", mean, _side(left), _side(right)
        case Points(values=values, degrees=degrees):
            return "points", values, degrees


def _flank(flank: Flank | None) -> TableRow | None:
    return None if flank is None else (flank.start, flank.end, flank.curve)


def _side(side: Side) -> TableRow:
    return side.spread, side.reach, side.curve
