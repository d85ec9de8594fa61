"""What writers of programs share: numbers, comments, steps, tables and examples."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple
from urllib.parse import quote, unquote

import numpy as np
from msgspec.structs import replace

from fuzzytree.model import (
    Document,
    FuzzyTree,
    Node,
    RuleBase,
    Variable,
    Written,
    fingerprint,
    intervals,
    kind_of,
)
from fuzzytree.numerics import rounded
from fuzzytree.semantics import (
    Answer,
    Program,
    ResultKind,
    Row,
    Step,
    StepValue,
    answer_of,
    error_bounds,
    from_rules,
    program_of,
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


def rated_rules(model: Document, form: str) -> RuleBase:
    """Return a rule base that has probabilities.

    Raises:
        ValueError: If the model is no such rule base.
    """
    if isinstance(model, RuleBase) and model.semantics.sharpness:
        return model
    if model.outputs:
        raise ValueError(f"{form}: a fuzzy system has no probabilities of classes")
    if not model.semantics.sharpness:
        raise ValueError(f"{form}: {model.name!r} has no probabilities")
    text = "a tree's path gives no probabilities; write its rules to have them"
    raise ValueError(f"{form}: {text}")


def title_of(model: Document, name: str) -> str:
    """Return what a file is of, with the model's name as the file may write it."""
    kind = {"rules": "rule base"}.get(kind_of(model), kind_of(model))
    return f"A fuzzy {kind}, named {name}"


def class_number(label: str | None, model: Document) -> int:
    """Return the place of a class, -1 for none."""
    return -1 if label is None else model.classes.index(label)


def source_of(
    write: Callable[..., Written], model: Document, options: Mapping[str, Any]
) -> str:
    """Return what a file is written of: the fingerprint, and unusual options.

    Values are quoted as in a URL, so that they end no comment of any language.
    `options` are the arguments of `write`, others among them.
    """
    texts: list[str] = []
    for name, usual in (write.__kwdefaults__ or {}).items():
        value = options[name]
        if value != usual and name != "allow_loss":
            text = ",".join(value) if isinstance(value, list | tuple) else str(value)
            texts.append(f"{name}={quote(text, '')}")
    return fingerprint(model) + (f" Options: {';'.join(texts)}" if texts else "")


def stated_options(content: bytes) -> dict[str, str]:
    """Return the options that a file states, as `convert --set` takes them.

    Example:
        >>> stated_options(b"9" * 64 + b" Options: table=my%20rows;dialect=spark")
        {'table': 'my rows', 'dialect': 'spark'}
    """
    line = re.search(rb"[0-9a-f]{64} Options: ([\w.%~=;-]+)", content)
    parts = line[1].decode("ascii", "replace").split(";") if line else ()
    pairs = (part.partition("=") for part in parts)
    return {name: unquote(text) for name, _, text in pairs}


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
        "not": "!",
        "where": "{} ? {} : {}",
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
        """Return a step as an expression."""
        operands = [self.value(argument) for argument in step.arguments]
        match step.operation:
            case "input":
                return f"x[{self.program.inputs.index(step.name)}]"
            case "where":
                return self.signs["where"].format(*operands)
            case "not":
                return f"{self.signs['not']}{operands[0]}"
            case "negate":
                return f"-{operands[0]}"
            case operation if operation in self.signs:
                return f"{operands[0]} {self.signs[operation]} {operands[1]}"
            case _:
                return self.call(step, operands)


def strengths_of(rules: RuleBase) -> tuple[Program, list[int]]:
    """Return a program that computes strengths where all values are known.

    Combinations are inputs of it: they are computed before, where it is known what is
    missing. So are inputs whose missing values are replaced.

    Returns:
        The program, and the place of each rule's strength.
    """
    plain = tuple(replace(v, parts=(), missing=None) for v in rules.variables)
    program = from_rules(replace(rules, variables=plain, columns=()))
    # What is shown is the strength where all values are known, else NaN.
    shown = [(place, program.steps[place]) for place in program.of("strength")]
    places = [
        step.arguments[1] if step.operation == "where" else place
        for place, step in shown
    ]
    return program, places


def named_steps(program: Program, places: Sequence[int]) -> dict[int, str]:
    """Return the steps that need a name where steps are written within each other.

    They are the degrees of terms, and what is used twice and is more than one
    operation on names and numbers.

    Returns:
        Their titles, or "", by their places, in order.
    """
    uses: dict[int, int] = dict.fromkeys(places, 2)
    for place in range(len(program.steps) - 1, -1, -1):
        if place in uses:
            for argument in program.steps[place].arguments:
                uses[argument] = uses.get(argument, 0) + 1
    named: dict[int, str] = {}
    sizes: dict[int, int] = {}
    for place in sorted(uses):
        step = program.steps[place]
        inner = [sizes[one] for one in step.arguments if one not in named]
        sizes[place] = sum(inner) + bool(step.arguments)
        title = program.titles[place]
        is_part = title.endswith(f" {step.operation.replace('_', ' ')}")
        is_term = " is " in title and not is_part
        is_long = uses[place] > 1 and sizes[place] > 1 and place not in places
        if step.arguments and (is_term or is_long):
            named[place] = title if is_term else ""
    return named


DECISION: tuple[ResultKind, ...] = ("class", "rule", "status", "strength")
INFERENCE: tuple[ResultKind, ...] = ("output", "status", "activation")
"""What functions of generated scripts return, in order."""


class ScriptSteps(StepText):
    """The steps as statements of a language without types: first `body`, then the rest.

    Attributes:
        variable: The name of a step's result, for its place.
        statement: What sets it to an expression.
        comment: What begins a comment.
        setting: How a table is set, with its name and numbers.
        opening: How the function `numbers` begins, with its results in words.
        result: A line of a result, with its comment.
        ending: What stands before and behind these lines.
        functions: The text of each function that a program may need.
        tables: The name of each table, by its numbers as text.
    """

    variable = "v{}"
    statement: str
    comment: ClassVar[str]
    setting: ClassVar[str]
    opening: ClassVar[str]
    result: ClassVar[str]
    ending: ClassVar[tuple[str, str]]
    functions: ClassVar[Mapping[str, str]]

    def __init__(self, program: Program) -> None:
        super().__init__(program)
        self.tables: dict[str, str] = {}

    def literal(self, value: object) -> str:
        """Return a number, a text or a tuple as source."""
        raise NotImplementedError

    def body(self) -> Iterator[str]:
        """Yield a statement for each step that an input enters."""
        for place, step in enumerate(self.steps):
            if self.still[place] is None:
                name, text = self.variable.format(place), self.expression(step)
                title = self.program.titles[place]
                is_part = title.endswith(f" {step.operation.replace('_', ' ')}")
                is_named = title and not is_part
                comment = f" {self.comment} {self.literal(title)}" if is_named else ""
                yield f"{self.statement.format(name, text)}{comment}\n"

    def value(self, place: int) -> str:
        """Return a step's result as an expression; of samples, the i-th."""
        result = self.still[place]
        if result is None:
            name = self.variable.format(place)
        elif isinstance(result, list):
            name = self.table([float(one) for one in result])
        else:
            return self.literal(result)
        return f"{name}[i]" if self.steps[place].samples else name

    def table(self, numbers: Sequence[float]) -> str:
        """Return the name of a table."""
        return self.tables.setdefault(
            self.literal(tuple(numbers)), f"TABLE_{len(self.tables)}"
        )

    def function(
        self, kinds: Sequence[ResultKind], comments: Sequence[str] = ()
    ) -> Iterator[str]:
        """Yield the function `numbers`, and the tables and functions that it needs."""
        body = list(self.body())
        results = [x for kind in kinds for x in self.program.results if x.kind == kind]
        comments = comments or [one.title for one in results]
        lines = [
            self.result.format(self.value(one.step), self.literal(comment))
            for one, comment in zip(results, comments, strict=True)
        ]
        for numbers, name in self.tables.items():
            yield self.setting.format(name, numbers)
        *others, last = kinds
        yield self.opening.format(f"{', '.join(others)} and {last}")
        before, behind = self.ending
        yield from (*body, before, *lines, behind, *self.helpers())

    def helpers(self) -> Iterator[str]:
        """Yield the functions that the body needs."""
        yield from (text for name, text in self.functions.items() if name in self.needs)


def digest_of(words: Sequence[int]) -> int:
    """Return 32 bits that change if any bit of some words of 32 bits does."""
    digest = 2166136261
    for word in words:
        digest = (digest ^ word) * 16777619 & 0xFFFFFFFF
    return digest


class Example(NamedTuple):
    """What a model answers to the values of its inputs.

    Attributes:
        values: Of the inputs, in order.
        answer: The reference's.
        bounds: How far numbers may be off: outputs, and activations if wanted.
    """

    values: list[float]
    answer: Answer
    bounds: list[float]

    @property
    def numbers(self) -> tuple[float, ...]:
        """The numbers that have bounds."""
        return (self.answer.outputs + self.answer.strengths)[: len(self.bounds)]


def examples_of(
    model: Document, rows: Sequence[Row], *, activations: bool = False
) -> Iterator[Example]:
    """Yield what the reference answers to rows, of a system with bounds."""
    every: list[list[float]] = [[] for _ in rows]
    if model.outputs:
        program = program_of(model, with_strengths=activations)
        table = np.array([[row[name] for row in rows] for name in program.inputs])
        values = table.reshape(len(program.inputs), len(rows)).astype(np.float64)
        every = error_bounds(program, values)[:-1].T.tolist()
    for row, bounds in zip(rows, every, strict=True):
        operands = [row[name] for name in model.inputs]
        yield Example(operands, answer_of(model, row), bounds)


def places_of(variables: Sequence[Variable]) -> dict[str, int]:
    """Return the place of each variable's value: inputs first, then combinations."""
    inputs = [variable.name for variable in variables if not variable.parts]
    mixed = [variable.name for variable in variables if variable.parts]
    return {name: place for place, name in enumerate([*inputs, *mixed])}


def targets_of(node: Node) -> tuple[int, ...]:
    """Return, for each interval, the place of the next node or -k for leaf k."""
    ends = [
        -branch.leaf if branch.leaf is not None else (branch.node or 0) - 1
        for branch in node.branches
    ]
    return tuple(ends[owner] for owner in node.owners)


def node_lines(
    tree: FuzzyTree, literal: Callable[[object], str], comment: str
) -> Iterator[str]:
    """Yield each node's place of the value, cuts and targets; and its terms' names."""
    places = places_of(tree.variables)
    for node in tree.nodes:
        counts = [0] * len(node.branches)
        names: list[str] = []
        for owner, _ in zip(node.owners, intervals(node), strict=True):
            names.append(node.branches[owner].terms[counts[owner]])
            counts[owner] += 1
        row = places[node.variable], node.cuts, targets_of(node)
        shown = ", ".join(map(literal, names))
        yield f"{literal(row)},{comment} {literal(node.variable)}: {shown}"


class TreeTest(NamedTuple):
    """Whether a value lies above a cut, and where no and yes lead.

    A place below the number of tests is a test, and k places behind is leaf k + 1.
    """

    variable: str
    cut: float
    no: int
    yes: int


def tree_tests(tree: FuzzyTree) -> list[TreeTest]:
    """Return the tests of a tree; the first is that of the root.

    A node of several cuts becomes several tests, by halves.
    """
    starts, count = [0], 0
    for node in tree.nodes:
        count += len(node.cuts)
        starts.append(count)
    result: list[TreeTest] = []
    for node in tree.nodes:
        targets = [
            count + branch.leaf - 1 if branch.leaf else starts[(branch.node or 1) - 1]
            for branch in node.branches
        ]
        ends = [targets[owner] for owner in node.owners]
        result += _halved(node, ends, len(result))
    return result


def _halved(node: Node, ends: list[int], start: int) -> list[TreeTest]:
    """Return a node's tests, numbered from `start`, each half behind its whole."""

    def arrange(first: int, last: int, place: int) -> list[TreeTest]:
        middle = (first + last) // 2
        left = arrange(first, middle, place + 1) if first < middle else []
        behind = place + 1 + len(left)
        right = arrange(middle + 1, last, behind) if middle + 1 < last else []
        no = place + 1 if left else ends[first]
        yes = behind if right else ends[last]
        return [TreeTest(node.variable, node.cuts[middle], no, yes), *left, *right]

    return arrange(0, len(node.cuts), start)
