"""The steps of a program as nodes of a graph: one step, one to four plain operators.

One number for each row is a block of shape (rows,), samples are one of shape
(samples, rows). What no input enters is a constant, computed here with the numbers of
Python's own library.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

import numpy as np

from fuzzytree.exporters.onnx_graph import (
    Constant,
    OnnxGraph,
    Precision,
    identifier,
    np_to_onnx,
)
from fuzzytree.numerics import RealArray, RealKind, rounded
from fuzzytree.semantics import (
    BELOW_ONE,
    Program,
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


def side_by_side(graph: OnnxGraph, names: Sequence[str], named: str) -> None:
    """Put blocks of shape (rows,) side by side."""
    if len(names) == 1:
        graph.node("Reshape", names[0], graph.numbers([-1, 1], "shape"), named=named)
        return
    block = graph.node("Concat", *names, hint=named, axis=0)
    shape = graph.numbers([len(names), -1], "shape")
    block = graph.node("Reshape", block, shape, hint=named)
    graph.node("Transpose", block, perm=[1, 0], named=named)
