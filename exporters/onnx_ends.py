"""The first and the last part of every graph, and the number types between them.

The first part turns input columns into guarded values of the variables; the last part
turns the winning rule or leaf into the requested outputs.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
from onnx import numpy_helper

from fuzzytree.exporters.onnx_graph import Sheet
from fuzzytree.model.contracts import Dtype, Model
from fuzzytree.model.rulebase import Part, RuleBase, Variable
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.numerics.narrowing import Real, RealArray, rounded
from fuzzytree.semantics.reference import BELOW_ONE, Status


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
    """Add the values of the variables that matter, and the guard over them.

    The source of the sheet is of shape (rows, columns).
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
    """Add the guard alone, for a model without combinations; rows stay rows."""
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


class Numbers(msgspec.Struct, frozen=True):
    """The types in which a graph computes.

    Attributes:
        axis: Of input values and everything up to the cast.
        degree: Of degrees and strengths.
        below_one: The largest number below 1 of the degrees' type.
    """

    axis: type[Real]
    degree: type[Real]
    below_one: float

    @property
    def is_mixed(self) -> bool:
        """Return whether degrees have another type than values."""
        return self.axis is not self.degree


NUMBERS: dict[Dtype, Numbers] = {
    "float64": Numbers(np.float64, np.float64, BELOW_ONE),
    "mixed": Numbers(np.float64, np.float32, 1.0 - 2.0**-24),
    "float32": Numbers(np.float32, np.float32, 1.0 - 2.0**-24),
}


def add_tree_outputs(
    sheet: Sheet,
    tree: FuzzyTree,
    frame: Axes,
    outputs: Sequence[str],
    numbers: Numbers,
) -> None:
    """Add the outputs of a tree whose leaf numbers are named `rule`."""
    labels = [leaf.label for leaf in tree.leaves]
    if "label" in outputs:
        table = sheet.texts([tree.semantics.missing or "", *labels], "labels")
        sheet.node("Gather", table, "rule", axis=0, named="label")
    if "status" in outputs:
        decided, missing = (_whole(sheet, s) for s in (Status.DECIDED, Status.MISSING))
        known = is_known(sheet, frame, numbers)
        sheet.node("Where", known, decided, missing, named="status")


def add_rule_outputs(
    sheet: Sheet,
    rules: RuleBase,
    frame: Axes,
    strengths: str,
    outputs: Sequence[str],
    numbers: Numbers,
) -> None:
    """Add the outputs of a rule base, given the strengths of no rule and of all."""
    winner = add_winner(sheet, strengths)
    if "label" in outputs:
        _add_label(sheet, rules, frame, winner, numbers)
    if "status" in outputs:
        _add_status(sheet, frame, strengths, winner, numbers)
    if "strengths" in outputs:
        ends = [sheet.numbers([end], "end") for end in (1, 1 + len(rules.rules))]
        with sheet.about("strengths"):
            real = sheet.node("Slice", strengths, *ends, sheet.numbers([0], "axes"))
            unknown = scalar(sheet, np.nan, numbers.degree)
            real = sheet.node("Where", is_known(sheet, frame, numbers), real, unknown)
        sheet.node("Transpose", real, perm=[1, 0], named="strengths")


def add_winner(sheet: Sheet, strengths: str, named: str = "rule") -> str:
    """Add the number of the first of the strongest rules, 0 where none fires."""
    return sheet.block("Winner", _winner, {"strengths": strengths}, named=named)


def _winner(sheet: Sheet, inputs: Sequence[str], named: str) -> str:
    return sheet.node(
        "ArgMax", inputs[0], axis=0, keepdims=0, select_last_index=0, named=named
    )


def _add_label(
    sheet: Sheet, rules: RuleBase, frame: Axes, winner: str, numbers: Numbers
) -> None:
    semantics = rules.semantics
    labels = [semantics.uncovered or "", *(rule.then for rule in rules.rules)]
    position = winner
    if semantics.missing != semantics.uncovered:
        missing = _whole(sheet, len(labels))
        labels.append(semantics.missing or "")
        known = _flat(sheet, frame, numbers)
        position = sheet.node("Where", known, winner, missing, hint="label_number")
    table = sheet.texts(labels, "labels")
    sheet.node("Gather", table, position, axis=0, named="label")


def _add_status(
    sheet: Sheet, frame: Axes, strengths: str, winner: str, numbers: Numbers
) -> None:
    """Compare the first with the last of the strongest; no rule is number 0."""
    last = sheet.node(
        "ArgMax",
        strengths,
        hint="last_winner",
        axis=0,
        keepdims=0,
        select_last_index=1,
    )
    decided, tie, uncovered, missing = (_whole(sheet, status) for status in Status)
    is_one = sheet.node("Equal", winner, last, hint="is_one_winner")
    status = sheet.node("Where", is_one, decided, tie, hint="tie_status")
    is_none = sheet.node("Equal", winner, _whole(sheet, 0), hint="is_uncovered")
    status = sheet.node("Where", is_none, uncovered, status, hint="status_if_known")
    sheet.node("Where", _flat(sheet, frame, numbers), status, missing, named="status")


def _flat(sheet: Sheet, frame: Axes, numbers: Numbers) -> str:
    known = is_known(sheet, frame, numbers)
    shape = sheet.numbers([-1], "flat")
    return sheet.node("Reshape", known, shape, hint="is_row_finite")


def _whole(sheet: Sheet, value: int) -> str:
    return sheet.constant(np.array(value, np.int64), "whole")
