"""The last part of every graph: from the winner to what was asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fuzzytree.exporters.onnx_axes import Axes, is_known, scalar
from fuzzytree.exporters.onnx_graph import Sheet
from fuzzytree.exporters.onnx_numbers import Numbers
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.semantics.reference import Status


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
