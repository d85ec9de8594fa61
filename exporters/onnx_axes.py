"""The first part of every graph: input columns to guarded values of the variables."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
from onnx import numpy_helper

from fuzzytree.exporters.onnx_graph import Sheet
from fuzzytree.exporters.onnx_numbers import Numbers
from fuzzytree.model.contracts import Model
from fuzzytree.model.rulebase import Part, RuleBase, Variable
from fuzzytree.numerics.narrowing import Real, RealArray, rounded


class Axes(msgspec.Struct, frozen=True):
    """The values of the variables, features first.

    A combination of which an input is not finite is not finite either, for no weight
    is 0. So an input stands in the block only if it is asked, or in no combination.

    Attributes:
        block: Their name, of shape (variables, rows); empty if there is no variable,
            or if the values themselves are not asked for.
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
    """Add the values of the variables of a model that matter, and the guard over them.

    Args:
        sheet: Where the nodes go; its source is of shape (rows, columns).
        model: Whose variables.
        numbers: The types to compute in.
        columns: What the columns of the input are, in order.
        is_flat: Whether the guard has one axis only.
    """
    if not model.variables:
        return Axes("", {}, _no_guard(sheet, numbers.axis, is_flat=is_flat))
    source = sheet.node("Transpose", sheet.source, hint="columns", perm=[1, 0])
    direct = _direct(model)
    derived = sorted(
        (v for v in model.variables if v.parts), key=lambda v: len(v.parts)
    )
    pieces: list[str] = []
    if direct == tuple(columns):
        pieces = [source]
    elif direct:
        pieces = [sheet.take(source, [columns.index(name) for name in direct])]
    if derived:
        with sheet.about("combinations"):
            pieces += _combinations(sheet, derived, source, columns, numbers.axis)
    block = pieces[0]
    if len(pieces) > 1:
        block = sheet.node("Concat", *pieces, hint="variables", axis=0)
    names = [*direct, *(variable.name for variable in derived)]
    # 0 * x is 0 for a finite x and NaN otherwise, and NaN survives every addition.
    zero = scalar(sheet, 0.0, numbers.axis)
    zeros = sheet.node("Mul", block, zero, hint="zero_if_finite")
    if len(names) > 1 or is_flat:
        with sheet.about("guard"):
            zeros = sheet.total(zeros, axis=0, keepdims=0 if is_flat else 1)
    return Axes(block, {name: row for row, name in enumerate(names)}, zeros)


def flat_guard(
    sheet: Sheet, model: Model, numbers: Numbers, columns: Sequence[str]
) -> Axes:
    """Add the guard alone, for a model without combinations; rows stay rows.

    Args:
        sheet: As in `axes`.
        model: As in `axes`.
        numbers: As in `axes`.
        columns: As in `axes`.
    """
    if not model.variables:
        return Axes("", {}, _no_guard(sheet, numbers.axis, is_flat=True))
    source = sheet.source
    if model.inputs != tuple(columns):
        chosen = sheet.numbers([columns.index(name) for name in model.inputs], "rows")
        source = sheet.node("Gather", source, chosen, hint="columns", axis=1)
    zero = scalar(sheet, 0.0, numbers.axis)
    zeros = sheet.node("Mul", source, zero, hint="zero_if_finite")
    with sheet.about("guard"):
        return Axes("", {}, sheet.total(zeros, axis=1, keepdims=0))


def _direct(model: Model) -> tuple[str, ...]:
    """Return the inputs that are asked, or that no combination guards."""
    if isinstance(model, RuleBase):
        asked = {clause.variable for rule in model.rules for clause in rule.when}
    else:
        asked = {node.variable for node in model.nodes}
    guarded = {part.input for variable in model.variables for part in variable.parts}
    return tuple(n for n in model.inputs if n in asked or n not in guarded)


def is_known(sheet: Sheet, frame: Axes, numbers: Numbers) -> str:
    """Return whether all values of a row are finite, in the guard's shape."""
    zero = scalar(sheet, 0.0, numbers.axis)
    return sheet.node("Equal", frame.guard, zero, hint="is_row_finite")


def scalar(sheet: Sheet, value: float, kind: type[Real]) -> str:
    """Return the name of a constant number."""
    return sheet.constant(np.array(value, kind), "number")


def column(sheet: Sheet, values: RealArray, hint: str) -> str:
    """Return the name of a constant with one number for each row of a block."""
    return sheet.constant(values.reshape(-1, 1), hint)


def _no_guard(sheet: Sheet, kind: type[Real], *, is_flat: bool) -> str:
    """Return 0 for each row, where no variable could be missing."""
    size = sheet.take(sheet.node("Shape", sheet.source), [0])
    if not is_flat:
        size = sheet.node("Concat", sheet.numbers([1], "one"), size, axis=0)
    zero = numpy_helper.from_array(np.zeros(1, kind))
    return sheet.node("ConstantOfShape", size, value=zero)


def _combinations(
    sheet: Sheet,
    derived: Sequence[Variable],
    source: str,
    columns: Sequence[str],
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
        term = _summand(sheet, parts, source, columns, kind)
        total = sheet.node("Add", total, term) if total else term
    return [*done, total]


def _summand(
    sheet: Sheet,
    parts: Sequence[Part],
    source: str,
    columns: Sequence[str],
    kind: type[Real],
) -> str:
    value = sheet.take(source, [columns.index(part.input) for part in parts])
    if any(part.centre for part in parts):  # x - 0.0 is x
        centres = rounded([part.centre for part in parts], kind)
        value = sheet.node("Sub", value, column(sheet, centres, "centres"))
    weights = rounded([part.weight for part in parts], kind)
    return sheet.node("Mul", value, column(sheet, weights, "weights"))


def _rows(sheet: Sheet, block: str, start: int, end: int) -> str:
    first, last = sheet.numbers([start], "start"), sheet.numbers([end], "end")
    return sheet.node("Slice", block, first, last, sheet.numbers([0], "axes"))
