"""The first part of every graph: input columns to guarded values of the variables."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
from onnx import numpy_helper

from fuzzytree.contracts import Model
from fuzzytree.exporters.onnx_graph import Sheet
from fuzzytree.exporters.onnx_numbers import Numbers, Real, RealArray, rounded
from fuzzytree.rulebase import Part, Variable


class Axes(msgspec.Struct, frozen=True):
    """The values of the variables, features first.

    Attributes:
        block: Their name, of shape (variables, rows); empty if there is no variable.
        order: The row of each variable in the block.
        guard: 0 where all values of a row are finite, otherwise NaN; of shape
            (1, rows), or (rows,) if asked for flat.
    """

    block: str
    order: dict[str, int]
    guard: str


def axes(
    sheet: Sheet,
    model: Model,
    numbers: Numbers,
    columns: Sequence[str],
    *,
    is_flat: bool = False,
) -> Axes:
    """Add the values of all variables of a model and the guard over them.

    Args:
        sheet: Where the nodes go; `inputs` is its input, of shape (rows, columns).
        model: Whose variables.
        numbers: The types to compute in.
        columns: What the columns of the input are, in order.
        is_flat: Whether the guard has one axis only.
    """
    if not model.variables:
        return Axes("", {}, _no_guard(sheet, numbers.axis, is_flat=is_flat))
    block = sheet.node("Transpose", "inputs", perm=[1, 0])
    if tuple(columns) != model.inputs:
        block = sheet.take(block, [columns.index(name) for name in model.inputs])
    order = {name: row for row, name in enumerate(model.inputs)}
    derived = sorted(
        (v for v in model.variables if v.parts), key=lambda v: len(v.parts)
    )
    if derived:
        sums = _combinations(sheet, derived, block, order, numbers.axis)
        order |= {v.name: len(order) + row for row, v in enumerate(derived)}
        block = sheet.node("Concat", block, *sums, axis=0)
    # 0 * x is 0 for a finite x and NaN otherwise, and NaN survives every addition.
    zeros = sheet.node("Mul", block, scalar(sheet, 0.0, numbers.axis))
    if len(order) > 1 or is_flat:
        zeros = sheet.total(zeros, axis=0, keepdims=0 if is_flat else 1)
    return Axes(block, order, zeros)


def is_known(sheet: Sheet, frame: Axes, numbers: Numbers) -> str:
    """Return whether all values of a row are finite, in the guard's shape."""
    return sheet.node("Equal", frame.guard, scalar(sheet, 0.0, numbers.axis))


def scalar(sheet: Sheet, value: float, kind: type[Real]) -> str:
    """Return the name of a constant number."""
    return sheet.constant(np.array(value, kind), "number")


def column(sheet: Sheet, values: RealArray, hint: str) -> str:
    """Return the name of a constant with one number for each row of a block."""
    return sheet.constant(values.reshape(-1, 1), hint)


def _no_guard(sheet: Sheet, kind: type[Real], *, is_flat: bool) -> str:
    """Return 0 for each row, where no variable could be missing."""
    size = sheet.take(sheet.node("Shape", "inputs"), [0])
    if not is_flat:
        size = sheet.node("Concat", sheet.numbers([1], "one"), size, axis=0)
    zero = numpy_helper.from_array(np.zeros(1, kind))
    return sheet.node("ConstantOfShape", size, value=zero)


def _combinations(
    sheet: Sheet,
    derived: Sequence[Variable],
    block: str,
    order: dict[str, int],
    kind: type[Real],
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
            done.append(_rows(sheet, total, 0, ready - finished))
            total = _rows(sheet, total, ready - finished, len(derived) - finished)
            finished = ready
        parts = [v.parts[position] for v in derived[finished:]]
        term = _summand(sheet, parts, block, order, kind)
        total = sheet.node("Add", total, term) if total else term
    return [*done, total]


def _summand(
    sheet: Sheet,
    parts: Sequence[Part],
    block: str,
    order: dict[str, int],
    kind: type[Real],
) -> str:
    value = sheet.take(block, [order[part.input] for part in parts])
    if any(part.centre for part in parts):  # x - 0.0 is x
        centres = rounded([part.centre for part in parts], kind)
        value = sheet.node("Sub", value, column(sheet, centres, "centres"))
    weights = rounded([part.weight for part in parts], kind)
    return sheet.node("Mul", value, column(sheet, weights, "weights"))


def _rows(sheet: Sheet, block: str, start: int, end: int) -> str:
    first, last = sheet.numbers([start], "start"), sheet.numbers([end], "end")
    return sheet.node("Slice", block, first, last, sheet.numbers([0], "axes"))
