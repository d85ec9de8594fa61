"""A program as a graph: node by node, or if it is long as wide nodes.

A wide node is all equal operations of a level at once. A rule base of thousands of
rules repeats a few operations. Those that need only results of lower levels are one
node on blocks of shape (steps, rows), so the graph grows with the depth of the program
and not with its rules. Each number is computed by the same operation on the same
operands, so its bits are the same.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence

import msgspec
import numpy as np

from fuzzytree.errors import LossError
from fuzzytree.exporters.onnx_graph import (
    OnnxGraph,
    identifier,
    np_to_onnx,
)
from fuzzytree.exporters.onnx_steps import (
    CHAINS,
    NODES,
    add_step,
    add_steps,
    chain_links,
    missing_functions,
    number_constant,
    reduced,
    side_by_side,
    spread,
)
from fuzzytree.model import Document
from fuzzytree.semantics import (
    Program,
    ResultKind,
    still_results,
)

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
