"""The first and the last part of every graph, and the number types between them.

The first part turns input columns into guarded values of the variables; the last part
turns the winning rule or leaf into the requested outputs.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
from onnx import numpy_helper

from fuzzytree.exporters.onnx_graph import OnnxGraph, np_to_onnx
from fuzzytree.model import (
    WEIGHT_OF_ONE,
    FuzzyTree,
    Model,
    RuleBase,
    Variable,
    parts_of,
    squarings,
    stand_ins,
)
from fuzzytree.numerics import RealKind, rounded
from fuzzytree.semantics import Status


class InputBlock(msgspec.Struct, frozen=True):
    """The values of the variables, features first.

    A combination of which an input is not finite is not finite either, for no weight
    is 0. So an input stands in the block only if it is used, or in no combination.

    Attributes:
        block: Their name, of shape (variables, rows); empty if there is no variable,
            or if the values themselves are not needed.
        order: The row of each variable in the block.
        guard: 0 where all values of a row are finite, otherwise NaN; of shape
            (1, rows), or (rows,) if flat.
    """

    block: str
    order: dict[str, int]
    guard: str


def fill_inputs(graph: OnnxGraph, model: Model, columns: Sequence[str]) -> None:
    """Replace values that are not finite by what stands for missing ones.

    The source of the graph becomes the inputs with the replaced values.
    """
    known = stand_ins(model.variables)
    if not known:
        return
    values = [known.get(name, np.nan) for name in columns]
    with graph.about("missing values"):
        zero = graph.number(0.0, graph.types.axis)
        zeros = graph.node("Mul", graph.source, zero, hint="zero_if_finite")
        is_finite = graph.node("Equal", zeros, zero, hint="is_finite")
        numbers = rounded(values, graph.types.axis)
        stand = graph.constant(numbers.reshape(1, -1), "stand_ins")
        graph.source = graph.node(
            "Where", is_finite, graph.source, stand, hint="filled"
        )


def axes(
    graph: OnnxGraph,
    model: Model,
    columns: Sequence[str],
    *,
    is_flat: bool = False,
) -> InputBlock:
    """Add the values of the variables that matter, and the guard over them.

    The source of the graph is of shape (rows, columns).
    """
    numbers = graph.types
    if not model.variables:
        return InputBlock("", {}, _no_guard(graph, numbers.axis, is_flat=is_flat))
    source = graph.node("Transpose", graph.source, hint="columns", perm=[1, 0])
    direct = _direct(model)
    derived = sorted(
        (v for v in model.variables if v.parts), key=lambda v: len(v.parts)
    )
    pieces: list[str] = []
    if direct == tuple(columns):
        pieces = [source]
    elif direct:
        pieces = [graph.take(source, [columns.index(name) for name in direct])]
    if derived:
        with graph.about("combinations"):
            pieces += _combinations(graph, derived, source, columns, numbers.axis)
    block = pieces[0]
    if len(pieces) > 1:
        block = graph.node("Concat", *pieces, hint="variables", axis=0)
    names = [*direct, *(variable.name for variable in derived)]
    # 0 * x is 0 for a finite x and NaN otherwise, and NaN survives every addition.
    zero = graph.number(0.0, numbers.axis)
    zeros = graph.node("Mul", block, zero, hint="zero_if_finite")
    if len(names) > 1 or is_flat:
        with graph.about("guard"):
            zeros = graph.total(zeros, axis=0, keepdims=0 if is_flat else 1)
    return InputBlock(block, {name: row for row, name in enumerate(names)}, zeros)


def flat_guard(graph: OnnxGraph, model: Model, columns: Sequence[str]) -> InputBlock:
    """Add the guard alone, for a model without combinations; rows stay rows."""
    numbers = graph.types
    if not model.variables:
        return InputBlock("", {}, _no_guard(graph, numbers.axis, is_flat=True))
    source = graph.source
    if model.inputs != tuple(columns):
        chosen = graph.numbers([columns.index(name) for name in model.inputs], "rows")
        source = graph.node("Gather", source, chosen, hint="columns", axis=1)
    zero = graph.number(0.0, numbers.axis)
    zeros = graph.node("Mul", source, zero, hint="zero_if_finite")
    with graph.about("guard"):
        return InputBlock("", {}, graph.total(zeros, axis=1, keepdims=0))


def _direct(model: Model) -> tuple[str, ...]:
    """Return the inputs that are used, or that no combination guards."""
    used = {proposition.variable for rule in model.rules for proposition in rule.when}
    used |= {node.variable for node in model.nodes}
    guarded = {part.input for variable in model.variables for part in variable.parts}
    return tuple(n for n in model.inputs if n in used or n not in guarded)


def is_known(graph: OnnxGraph, frame: InputBlock, *, is_flat: bool = False) -> str:
    """Return whether all values of a row are finite, flat or in the guard's shape."""
    zero = graph.number(0.0, graph.types.axis)
    known = graph.node("Equal", frame.guard, zero, hint="is_row_finite")
    if not is_flat:
        return known
    shape = graph.numbers([-1], "flat")
    return graph.node("Reshape", known, shape, hint="is_row_finite")


def _no_guard(graph: OnnxGraph, kind: type[RealKind], *, is_flat: bool) -> str:
    """Return 0 for each row, where no variable could be missing."""
    size = graph.take(graph.node("Shape", graph.source), [0])
    if not is_flat:
        size = graph.node("Concat", graph.numbers([1], "one"), size, axis=0)
    zero = numpy_helper.from_array(np.zeros(1, kind))
    return graph.node("ConstantOfShape", size, value=zero)


def _combinations(
    graph: OnnxGraph,
    derived: Sequence[Variable],
    source: str,
    columns: Sequence[str],
    kind: type[RealKind],
) -> list[str]:
    """Add the chains `w1 (x1 - c1) + w2 (x2 - c2) + ...`, one position at a time.

    The combinations stand in increasing length: those that are complete leave the
    block at its top, and no chain is changed by another's length.

    Returns:
        Blocks whose rows, one after another, are the combinations in order.
    """
    done: list[str] = []
    total, finished = "", 0
    for position in range(len(derived[-1].parts)):
        ready = sum(1 for v in derived if len(v.parts) <= position)
        if ready > finished:
            done.append(_rows(graph, total, 0, ready - finished))
            total = _rows(graph, total, ready - finished, len(derived) - finished)
            finished = ready
        parts = [v.parts[position] for v in derived[finished:]]
        term = graph.take(source, [columns.index(part.input) for part in parts])
        if any(part.centre for part in parts):  # x - 0.0 is x
            centres = rounded([part.centre for part in parts], kind)
            term = graph.node("Sub", term, graph.column(centres, "centres"))
        weights = rounded([part.weight for part in parts], kind)
        term = graph.node("Mul", term, graph.column(weights, "weights"))
        total = graph.node("Add", total, term) if total else term
    return [*done, total]


def _rows(graph: OnnxGraph, block: str, start: int, end: int) -> str:
    first, last = graph.numbers([start], "start"), graph.numbers([end], "end")
    return graph.node("Slice", block, first, last, graph.numbers([0], "axes"))


def add_tree_outputs(
    graph: OnnxGraph,
    tree: FuzzyTree,
    frame: InputBlock,
    outputs: Sequence[str],
) -> None:
    """Add the outputs of a tree whose leaf numbers are named `rule`."""
    labels = [leaf.label for leaf in tree.leaves]
    if "label" in outputs:
        table = graph.texts([tree.semantics.missing or "", *labels], "labels")
        graph.node("Gather", table, "rule", axis=0, named="label")
    if "status" in outputs:
        decided, missing = (graph.whole(s) for s in (Status.DECIDED, Status.MISSING))
        known = is_known(graph, frame)
        graph.node("Where", known, decided, missing, named="status")


def add_rule_outputs(
    graph: OnnxGraph,
    rules: RuleBase,
    frame: InputBlock,
    strengths: str,
    outputs: Sequence[str],
) -> None:
    """Add the outputs of a rule base, given the strengths of no rule and of all."""
    winner = add_winner(graph, strengths)
    if "label" in outputs:
        _add_label(graph, rules, frame, winner)
    if "status" in outputs:
        _add_status(graph, frame, strengths, winner)
    if "probabilities" in outputs:
        with graph.about("probabilities"):
            _add_probabilities(graph, rules, strengths, winner)
    if "strengths" in outputs:
        with graph.about("strengths"):
            known = is_known(graph, frame)
        add_strengths(graph, len(rules.rules), strengths, known, np.nan)


def add_strengths(
    graph: OnnxGraph, rules: int, strengths: str, known: str, other: float
) -> None:
    """Add the strengths of all rules, and another number in rows that are not known."""
    ends = [graph.numbers([end], "end") for end in (1, 1 + rules)]
    with graph.about("strengths"):
        real = graph.node("Slice", strengths, *ends, graph.numbers([0], "axes"))
        unknown = graph.number(other, graph.types.degree)
        real = graph.node("Where", known, real, unknown)
    graph.node("Transpose", real, perm=[1, 0], named="strengths")


def _add_probabilities(
    graph: OnnxGraph, rules: RuleBase, strengths: str, winner: str
) -> None:
    """Mix the probabilities of all rules: whole numbers, so that sums are exact."""
    end = graph.numbers([1 + len(rules.rules)], "end")
    start, line = graph.numbers([1], "start"), graph.numbers([0], "axes")
    power = graph.node("Slice", strengths, start, end, line)
    if graph.types.degree is not np.float64:
        power = graph.node("Cast", power, to=np_to_onnx(np.float64))
    for _ in range(squarings(rules.semantics.sharpness)):
        power = graph.node("Mul", power, power)
    one, zero = _double(graph, float(WEIGHT_OF_ONE)), _double(graph, 0.0)
    weights = graph.node("Floor", graph.node("Mul", power, one), hint="weights")
    parts = [parts_of(rule.probabilities) for rule in rules.rules]
    table = graph.constant(np.array(parts, np.float64).T.copy(), "parts")
    counts = graph.node("MatMul", table, weights, hint="counts")
    codes = [0, *(rules.classes.index(rule.then) for rule in rules.rules)]
    own = graph.node("Gather", graph.numbers(codes, "classes"), winner, axis=0)
    every = graph.constant(np.arange(len(rules.classes)).reshape(-1, 1), "classes")
    is_own = graph.node("Equal", every, own, hint="is_own")
    others = graph.node("Where", is_own, zero, counts)
    least = graph.node("Add", graph.highest(others, axis=0), _double(graph, 1.0))
    raised = graph.node("Max", counts, least)
    counts = graph.node("Where", is_own, raised, counts, hint="counts")
    shares = graph.node("Div", counts, graph.total(counts, axis=0, keepdims=1))
    is_none = graph.node("Equal", winner, graph.whole(0))
    shares = graph.node("Where", is_none, _double(graph, np.nan), shares)
    graph.node("Transpose", shares, perm=[1, 0], named="probabilities")


def _double(graph: OnnxGraph, value: float) -> str:
    return graph.number(value, np.float64)


def add_winner(graph: OnnxGraph, strengths: str, named: str = "rule") -> str:
    """Add the number of the first of the strongest rules, 0 where none fires."""
    return graph.node(
        "ArgMax", strengths, axis=0, keepdims=0, select_last_index=0, named=named
    )


def _add_label(
    graph: OnnxGraph,
    rules: RuleBase,
    frame: InputBlock,
    winner: str,
) -> None:
    semantics = rules.semantics
    labels = [semantics.uncovered or "", *(rule.then for rule in rules.rules)]
    position = winner
    if semantics.missing != semantics.uncovered:
        missing = graph.whole(len(labels))
        labels.append(semantics.missing or "")
        known = is_known(graph, frame, is_flat=True)
        position = graph.node("Where", known, winner, missing, hint="label_number")
    table = graph.texts(labels, "labels")
    graph.node("Gather", table, position, axis=0, named="label")


def _add_status(
    graph: OnnxGraph,
    frame: InputBlock,
    strengths: str,
    winner: str,
) -> None:
    """Compare the first with the last of the strongest; no rule is number 0."""
    last = graph.node(
        "ArgMax",
        strengths,
        hint="last_winner",
        axis=0,
        keepdims=0,
        select_last_index=1,
    )
    decided, tie, uncovered, missing = (graph.whole(status) for status in Status)
    is_one = graph.node("Equal", winner, last, hint="is_one_winner")
    status = graph.node("Where", is_one, decided, tie, hint="tie_status")
    is_none = graph.node("Equal", winner, graph.whole(0), hint="is_uncovered")
    status = graph.node("Where", is_none, uncovered, status, hint="status_if_known")
    graph.node(
        "Where", is_known(graph, frame, is_flat=True), status, missing, named="status"
    )
