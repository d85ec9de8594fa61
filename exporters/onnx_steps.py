"""The steps of a program as nodes of a graph: one step, one to four plain operators.

One number for each row is a block of shape (rows,), samples are one of shape
(samples, rows). What no input enters is a constant, computed here with the numbers of
Python's own library.

A long program becomes wide nodes: all equal operations of a level at once. A rule base
of thousands of rules repeats a few operations. Those that need only results of lower
levels are one node on blocks of shape (steps, rows), so the graph grows with the depth
of the program and not with its rules. Each number is computed by the same operation on
the same operands, so its bits are the same.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence

import msgspec
import numpy as np

from fuzzytree.errors import LossError
from fuzzytree.exporters.onnx_graph import (
    Constant,
    OnnxGraph,
    Precision,
    identifier,
    np_to_onnx,
)
from fuzzytree.model import Document
from fuzzytree.numerics import RealArray, RealKind, rounded
from fuzzytree.semantics import (
    BELOW_ONE,
    Program,
    ResultKind,
    Step,
    StepValue,
    still_results,
)

NODES: Mapping[str, str] = {
    "add": "Add",
    "subtract": "Sub",
    "multiply": "Mul",
    "divide": "Div",
    "minimum": "Min",
    "maximum": "Max",
    "negate": "Neg",
    "absolute": "Abs",
    "floor": "Floor",
    "ceiling": "Ceil",
    "round": "Round",
    "square_root": "Sqrt",
    "exponential": "Exp",
    "logarithm": "Log",
    "sine": "Sin",
    "hyperbolic_tangent": "Tanh",
    "power": "Pow",
    "less": "Less",
    "at_most": "LessOrEqual",
    "equal": "Equal",
    "and": "And",
    "or": "Or",
    "not": "Not",
    "where": "Where",
}
"""Operations that are one operator, in double in onnxruntime too."""

CHAINS: Mapping[str, str] = {"minimum": "Min", "maximum": "Max", "add": "Sum"}
"""Operations of which an operator takes many arguments, and joins them in order."""

_WORDS: Mapping[str, str] = {
    "tangent": "tan",
    "arc_sine": "asin",
    "arc_cosine": "acos",
    "arc_tangent": "atan",
    "arc_tangent_2": "atan2",
    "hyperbolic_sine": "sinh",
    "hyperbolic_cosine": "cosh",
    "area_sine": "asinh",
    "area_cosine": "acosh",
    "area_tangent": "atanh",
    "logarithm_10": "log10",
    "logarithm_1p": "log1p",
}
"""Operations that no operator computes in double, by the names of C."""


def missing_functions(program: Program) -> tuple[str, ...]:
    """Return the functions of a program that no operator computes in double.

    Example:
        >>> from fuzzytree.semantics.programs.steps import Maker, result_of
        >>> make = Maker()
        >>> angle = result_of("output", "y", make("arc_tangent", make.input("x")))
        >>> missing_functions(make.program("angle", ("x",), (angle,)))
        ('atan',)
    """
    still = still_results(program)
    pairs = zip(program.steps, still, strict=True)
    used = [
        _WORDS[s.operation] for s, r in pairs if r is None and s.operation in _WORDS
    ]
    return tuple(dict.fromkeys(used))


def add_steps(graph: OnnxGraph, program: Program, columns: Sequence[str]) -> list[str]:
    """Add the steps of a program to a graph and return the names of its results.

    Returns:
        A block of shape (rows,) for each result.
    """
    source = graph.node("Transpose", graph.source, hint="columns", perm=[1, 0])
    still = still_results(program)
    kinds = _number_types(program, still, graph.types)
    names: dict[int, str] = {}
    links = {one: list[str]() for one in chain_links(program, still, CHAINS)}

    def named(place: int, kind: type[RealKind], *, is_divisor: bool = False) -> str:
        known = still[place]
        if known is None:
            return names[place]
        return number_constant(graph, known, kind, is_divisor=is_divisor)

    for place, step in enumerate(program.steps):
        if still[place] is not None:
            continue
        title = program.titles[place] if program.titles else step.name
        graph.topic = identifier(title) if title else ""
        if step.operation == "input":
            row = graph.whole(columns.index(step.name))
            names[place] = graph.node("Gather", source, row, hint=graph.topic)
            continue
        first = step.arguments[0]
        moving = [a for a in step.arguments if still[a] is None]
        kind = next((kinds[a] for a in moving if _is_number(program, a)), kinds[place])
        operands = [
            named(argument, kind, is_divisor=number > 0 and step.operation == "divide")
            for number, argument in enumerate(step.arguments)
            if argument not in links
        ]
        operands = links.get(first, []) + operands
        if place in links:
            links[place] = operands
        elif len(operands) > 2 and step.operation in CHAINS:
            chain = CHAINS[step.operation]
            names[place] = graph.node(chain, *operands, hint=graph.topic)
        else:
            name = add_step(graph, step, operands, program, kind, kinds[place])
            if step.operation == "divide" and kind is not kinds[place]:
                name = graph.node("Cast", name, to=np_to_onnx(kinds[place]))
            names[place] = name
    graph.topic = ""
    places = [result.step for result in program.results]
    return [
        names[place]
        if still[place] is None
        else spread(graph, source, named(place, kinds[place]))
        for place in places
    ]


def _is_number(program: Program, place: int) -> bool:
    return program.steps[place].kind == "number"


def _number_types(
    program: Program, still: Sequence[StepValue | None], types: Precision
) -> list[type[RealKind]]:
    """Return the type of each step's number.

    What is computed with inputs has the type of the axes up to a quotient, which is
    cast to that of degrees. Numbers that an operation joins are of one type.
    """
    if not types.is_mixed:
        return [types.degree] * len(program.steps)
    group = list(range(len(program.steps)))

    def first(place: int) -> int:
        while group[place] != place:
            place = group[place]
        return place

    for place, step in enumerate(program.steps):
        joined = [
            a for a in step.arguments if still[a] is None and _is_number(program, a)
        ]
        if step.kind == "number" and step.operation not in ("divide", "below", "pick"):
            joined.append(place)
        for other in joined[1:]:
            group[first(other)] = first(joined[0])
    inputs = {
        first(k) for k, one in enumerate(program.steps) if one.operation == "input"
    }
    return [
        types.axis if first(place) in inputs else types.degree
        for place in range(len(program.steps))
    ]


def chain_links(
    program: Program, still: Sequence[StepValue | None], operations: Container[str]
) -> set[int]:
    """Return the steps that are taken only as the beginning of a chain like them.

    Such a chain, `a + b + c + ...` from left to right, is one operator.
    """
    steps = program.steps
    uses = [0] * len(steps)
    for result in program.results:
        uses[result.step] += 2
    for step in steps:
        for argument in step.arguments:
            uses[argument] += 1
    return {
        step.arguments[0]
        for step in steps
        if step.operation in operations
        and steps[step.arguments[0]].operation == step.operation
        and steps[step.arguments[0]].samples == step.samples
        and uses[step.arguments[0]] == 1
        and still[step.arguments[0]] is None
    }


def number_constant(
    graph: OnnxGraph,
    known_value: StepValue,
    kind: type[RealKind] = np.float64,
    *,
    is_divisor: bool = False,
) -> str:
    """Return the name of what no input enters: a number, a truth, or samples."""
    first = known_value[0] if isinstance(known_value, list) else known_value
    if isinstance(first, bool):
        value: Constant = np.array(known_value, np.bool_)
    elif kind is np.float32 and known_value == BELOW_ONE:
        value = np.array(graph.types.below_one, kind)
    else:
        value = as_kind(known_value, kind, is_divisor=is_divisor)
    if isinstance(known_value, list):
        value = value.reshape(-1, 1)
    return graph.constant(value, "number")


def as_kind(
    values: StepValue | Sequence[float],
    kind: type[RealKind],
    *,
    is_divisor: bool = False,
) -> RealArray:
    """Return numbers of a type, finite ones finite and divisors never 0."""
    exact = np.array(values, np.float64)
    near = rounded(exact.reshape(-1).tolist(), kind, is_divisor=is_divisor).reshape(
        exact.shape
    )
    return np.where(np.isfinite(exact), near, exact.astype(kind))


def spread(graph: OnnxGraph, source: str, name: str) -> str:
    """Return a constant once for each row of a source of shape (columns, rows)."""
    shape = graph.take(graph.node("Shape", source), [1])
    return graph.node("Expand", name, shape)


def add_step(
    graph: OnnxGraph,
    step: Step,
    operands: Sequence[str],
    program: Program,
    takes: type[RealKind] = np.float64,
    gives: type[RealKind] = np.float64,
) -> str:
    """Add the nodes of a step, given its arguments, and return the result's name.

    `takes` and `gives` are the types of its numbers.
    """
    if step.operation in NODES:
        return graph.node(NODES[step.operation], *operands, hint=graph.topic)
    match step.operation:
        case "is_finite":
            size = graph.node("Abs", *operands)
            return graph.node("Less", size, graph.number(np.inf, takes))
        case "cosine":
            return _cosine(graph, operands[0])
        case "remainder":
            return graph.node("Mod", *operands, fmod=1)
        case "below":
            # One row of truths for each number of the table, which are counted.
            ranks = [-1] + [1] * (2 if step.samples else 1)
            table = graph.constant(as_kind(step.table, takes).reshape(ranks), "table")
            is_below = graph.node("Less", table, operands[0])
            ones = graph.node("Cast", is_below, to=np_to_onnx(gives))
            return graph.total(ones, axis=0, keepdims=0)
        case "pick":
            # Places outside, and NaN, take the first number of the table.
            zero = graph.number(0.0, takes)
            last = graph.number(float(len(step.table) - 1), takes)
            inside = graph.node("LessOrEqual", zero, operands[0])
            is_last = graph.node("LessOrEqual", operands[0], last)
            inside = graph.node("And", inside, is_last)
            place = graph.node("Where", inside, operands[0], zero)
            place = graph.node("Cast", place, to=np_to_onnx(np.int64))
            table = graph.constant(as_kind(step.table, gives), "table")
            return graph.node("Gather", table, place)
        case "running":
            return graph.node("CumSum", *operands, graph.whole(0))
        case "total":
            count = program.steps[step.arguments[0]].samples
            return _total(graph, operands[0], count)
        case "last":
            count = program.steps[step.arguments[0]].samples
            return graph.node("Gather", operands[0], graph.whole(count - 1))
        case "highest":
            return reduced(graph, "ReduceMax", operands[0])
        case "lowest":
            return reduced(graph, "ReduceMin", operands[0])
        case _:
            raise ValueError(f"no operator computes {step.operation} in double")


def _cosine(graph: OnnxGraph, angle: str) -> str:
    """Return 1 - 2 sin^2(a / 2), for many an onnxruntime has no cosine in double."""
    sine = graph.node("Sin", graph.node("Mul", angle, graph.number(0.5)))
    square = graph.node("Mul", sine, sine)
    twice = graph.node("Mul", square, graph.number(2.0))
    return graph.node("Sub", graph.number(1.0), twice)


def _total(graph: OnnxGraph, samples: str, count: int) -> str:
    """Add the second half of the samples to the first until one is left."""
    size = 1 << (count - 1).bit_length()
    if size > count:
        pads = graph.numbers([0, 0, size - count, 0], "pads")
        samples = graph.node("Pad", samples, pads)
    zero, axis = graph.numbers([0], "start"), graph.numbers([0], "axes")
    while size > 1:
        half, whole = (
            graph.numbers([size // 2], "end"),
            graph.numbers([size], "end"),
        )
        first = graph.node("Slice", samples, zero, half, axis)
        second = graph.node("Slice", samples, half, whole, axis)
        samples = graph.node("Add", first, second)
        size //= 2
    return graph.node("Reshape", samples, graph.numbers([-1], "flat"))


def reduced(
    graph: OnnxGraph,
    operator: str,
    source: str,
    *,
    axis: int = 0,
    keepdims: int = 0,
) -> str:
    """Return the largest or smallest along an axis, in the form the opset knows."""
    if graph.opset >= 18:
        axes = graph.numbers([axis], "axes")
        return graph.node(operator, source, axes, keepdims=keepdims)
    return graph.node(operator, source, axes=[axis], keepdims=keepdims)


MOST_SINGLE = 2_000
"""Steps up to which each is a node of its own, with a name of its own."""

_SHORTEST_CHAIN = 32  # operands from which a chain is one node, and no level each

_TRUTHS = {"or": "ReduceMax", "and": "ReduceMin"}


def is_wide(program: Program) -> bool:
    """Return whether a program is written as wide nodes."""
    return len(program.steps) > MOST_SINGLE


class _Unit(msgspec.Struct, frozen=True):
    """A step, or a chain of steps, with the places that it takes."""

    place: int
    operation: str
    arguments: tuple[int, ...]
    is_chain: bool


class Blocks:
    """The results of a program in a graph: single rows, and rows of blocks.

    Attributes:
        graph: Where the nodes go.
        program: The program.
    """

    def __init__(
        self, graph: OnnxGraph, program: Program, columns: Sequence[str]
    ) -> None:
        self.graph = graph
        self.program = program
        self._still = still_results(program)
        self._source = graph.node(
            "Transpose", graph.source, hint="columns", perm=[1, 0]
        )
        self._columns = columns
        self._names: dict[int, str] = {}
        self._rows: dict[int, tuple[str, int]] = {}
        self._sizes: dict[str, int] = {}
        for level in self._levels():
            for group in self._groups(level):
                self._add(group)
        graph.topic = ""

    def single(self, place: int) -> str:
        """Return the name of a result, of shape (rows,) or of a constant."""
        if place not in self._names:
            known_value = self._still[place]
            if known_value is not None:
                self._names[place] = number_constant(self.graph, known_value)
            else:
                block, row = self._rows[place]
                at = self.graph.constant(np.array(row, np.int64), "whole")
                self._names[place] = self.graph.node("Gather", block, at, axis=0)
        return self._names[place]

    def flat(self, place: int) -> str:
        """Return the name of a result, of shape (rows,)."""
        name = self.single(place)
        if self._still[place] is not None:
            name = spread(self.graph, self._source, name)
        return name

    def stacked(self, places: Sequence[int]) -> str:
        """Return results as one block, of shape (places, rows) or (places, 1)."""
        if all(self._still[place] is not None for place in places):
            values = np.array([self._still[place] for place in places])
            return self.graph.constant(values.reshape(-1, 1), "numbers")
        return self.rows(places)

    def rows(self, places: Sequence[int]) -> str:
        """Return results as one block, of shape (places, rows)."""
        wanted: dict[str, dict[int, None]] = {}
        homes = [self._home(place) for place in places]
        for block, row in homes:
            wanted.setdefault(block, {})[row] = None
        pieces: list[str] = []
        order: dict[tuple[str, int], int] = {}
        for block, chosen in wanted.items():
            rows = list(chosen)
            is_whole = rows == list(range(self._sizes[block]))
            pieces.append(block if is_whole else self.graph.take(block, rows))
            for row in rows:
                order[block, row] = len(order)
        whole = pieces[0]
        if len(pieces) > 1:
            whole = self.graph.node("Concat", *pieces, axis=0)
        rows = [order[home] for home in homes]
        return (
            whole if rows == list(range(len(order))) else self.graph.take(whole, rows)
        )

    def _home(self, place: int) -> tuple[str, int]:
        """Return the block in which a result is a row, and which row."""
        if place not in self._rows:
            name = self.flat(place)
            axis = self.graph.numbers([0], "axes")
            if self.graph.opset >= 13:
                block = self.graph.node("Unsqueeze", name, axis)
            else:
                block = self.graph.node("Unsqueeze", name, axes=[0])
            self._rows[place], self._sizes[block] = (block, 0), 1
        return self._rows[place]

    def _levels(self) -> Iterable[list[_Unit]]:
        """Return the steps that an input enters, by what they need before them."""
        still, chains = self._still, self._chains()
        inner = {one for _, links in chains.values() for one in links}
        levels: dict[int, list[_Unit]] = {}
        depth: dict[int, int] = {}
        for place, step in enumerate(self.program.steps):
            if still[place] is not None or place in inner:
                continue
            operands, _ = chains.get(place, (step.arguments, ()))
            depth[place] = 1 + max((depth.get(one, 0) for one in operands), default=0)
            unit = _Unit(place, step.operation, tuple(operands), place in chains)
            levels.setdefault(depth[place], []).append(unit)
        return [levels[number] for number in sorted(levels)]

    def _chains(self) -> dict[int, tuple[list[int], list[int]]]:
        """Return the operands of each long chain by its last step, and its others."""
        links = chain_links(self.program, self._still, {*CHAINS, *_TRUTHS})
        chains: dict[int, tuple[list[int], list[int]]] = {}
        for place, step in enumerate(self.program.steps):
            if step.arguments and step.arguments[0] in links:
                first, *rest = step.arguments
                start = [*self.program.steps[first].arguments]
                operands, inner = chains.pop(first, (start, []))
                operands += rest
                inner.append(first)
                chains[place] = (operands, inner)
        return {
            place: chain
            for place, chain in chains.items()
            if len(chain[0]) >= _SHORTEST_CHAIN
            and not self.program.steps[place].samples
        }

    def _groups(self, level: Sequence[_Unit]) -> Iterable[list[_Unit]]:
        """Return the steps of a level that can be one node."""
        groups: dict[object, list[_Unit]] = {}
        for unit in level:
            step = self.program.steps[unit.place]
            is_plain = unit.operation in NODES and not (unit.is_chain or step.samples)
            key: object = unit.place
            if is_plain:
                kinds = [self._still[one] is not None for one in unit.arguments]
                key = (unit.operation, *kinds)
            groups.setdefault(key, []).append(unit)
        return groups.values()

    def _add(self, group: Sequence[_Unit]) -> None:
        """Add one step or chain, or equal operations as one node."""
        graph, unit = self.graph, group[0]
        graph.topic = self._title(group)
        if len(group) > 1:
            operands = [
                self.single(places[0]) if len({*places}) == 1 else self.stacked(places)
                for places in zip(*(one.arguments for one in group), strict=True)
            ]
            block = graph.node(NODES[unit.operation], *operands, hint=graph.topic)
            self._sizes[block] = len(group)
            self._rows |= {one.place: (block, row) for row, one in enumerate(group)}
        elif unit.is_chain:
            self._names[unit.place] = self._chain(unit)
        elif unit.operation == "input":
            step = self.program.steps[unit.place]
            at = np.array(self._columns.index(step.name), np.int64)
            column = graph.constant(at, "whole")
            name = graph.node("Gather", self._source, column, hint=graph.topic)
            self._names[unit.place] = name
        else:
            names = [self.single(place) for place in unit.arguments]
            step = self.program.steps[unit.place]
            self._names[unit.place] = add_step(graph, step, names, self.program)

    def _chain(self, unit: _Unit) -> str:
        """Join many results from left to right; of truths the order is no matter."""
        graph = self.graph
        block = self.stacked(unit.arguments)
        if unit.operation in _TRUTHS:
            number = graph.node("Cast", block, to=np_to_onnx(np.int32))
            number = reduced(graph, _TRUTHS[unit.operation], number)
            return graph.node("Cast", number, to=np_to_onnx(np.bool_))
        parts = graph.split(block, len(unit.arguments))
        joined = graph.node(CHAINS[unit.operation], *parts)
        flat = graph.numbers([-1], "flat")
        return graph.node("Reshape", joined, flat, hint=graph.topic)

    def _title(self, group: Sequence[_Unit]) -> str:
        """Return the words that the titles of steps have in common, as a name."""
        titles = [self.program.titles[one.place].split() for one in group]
        words = [words[0] for words in zip(*titles, strict=False) if len({*words}) == 1]
        return identifier(" ".join(words)) if words else ""


_BLOCKS: Mapping[str, ResultKind] = {
    "outputs": "output",
    "activations": "activation",
    "strengths": "strength",
    "probabilities": "probability",
}
_WHOLE: Mapping[str, ResultKind] = {"status": "status", "rule": "rule"}


def program_graph(
    graph: OnnxGraph,
    program: Program,
    columns: Sequence[str],
    outputs: Container[str],
    classes: Sequence[str] = (),
) -> None:
    """Add the program of a system, or of rules, and the outputs that are wanted.

    Raises:
        LossError: If it needs a function that onnxruntime lacks in double.
    """
    missing = missing_functions(program)
    if missing:
        raise LossError(
            f"cannot write {program.name} as onnx: a formula needs "
            f"{', '.join(missing)}, which onnxruntime computes in float32 only"
        )
    if is_wide(program) and graph.types.degree is np.float64:
        blocks = Blocks(graph, program, columns)
        single: Callable[[int], str] = blocks.flat
    else:
        names = add_steps(graph, program, columns)
        places = (one.step for one in program.results)
        single, blocks = dict(zip(places, names, strict=True)).__getitem__, None
    for name, kind in _BLOCKS.items():
        if name in outputs and blocks is not None:
            block = blocks.rows(program.of(kind))
            graph.node("Transpose", block, perm=[1, 0], named=name)
        elif name in outputs:
            side_by_side(graph, [single(place) for place in program.of(kind)], name)
    whole = np_to_onnx(np.int64)
    for name, kind in _WHOLE.items():
        if name in outputs:
            graph.node("Cast", single(program.of(kind)[0]), named=name, to=whole)
    if "label" in outputs:
        place = graph.node("Cast", single(program.of("class")[0]), to=whole)
        table = graph.texts([*classes, ""], "labels")  # -1 is the last of them
        graph.node("Gather", table, place, axis=0, named="label")


def side_by_side(graph: OnnxGraph, names: Sequence[str], named: str) -> None:
    """Put blocks of shape (rows,) side by side."""
    if len(names) == 1:
        graph.node("Reshape", names[0], graph.numbers([-1, 1], "shape"), named=named)
        return
    block = graph.node("Concat", *names, hint=named, axis=0)
    shape = graph.numbers([len(names), -1], "shape")
    block = graph.node("Reshape", block, shape, hint=named)
    graph.node("Transpose", block, perm=[1, 0], named=named)


def rows_at_once(model: Document, program: Program) -> int:
    """Return how many rows are best run together, so that they stay in the cache."""
    samples = [
        output.defuzzifier.samples
        for output in model.outputs
        if not output.defuzzifier.is_weighted
    ]
    if is_wide(program):
        samples.append(len(model.rules))
    return max(2**17 // max(samples, default=8), 64)
