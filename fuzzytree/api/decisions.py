"""Why a model answers one row as it does."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from fuzzytree import auditing, checking
from fuzzytree.columns import placer
from fuzzytree.errors import TableError
from fuzzytree.model import Document, Label, ModelSource, name_choice
from fuzzytree.rechecking import MISSING
from fuzzytree.report import counted
from fuzzytree.tables import TableSource, batches, table


def why(
    model: ModelSource,
    row: object,
    *,
    number: int = 1,
    wanted: Label | None = None,
    fixed: Collection[str] = (),
    costs: Mapping[str, float] | None = None,
    limits: auditing.Limits | None = None,
    allow_loss: bool = False,
) -> auditing.Explanation:
    """Explain one decision: the rule, the next one, and the smallest change.

    Args:
        model: A tree, a rule base or a fuzzy system, or the path of one.
        row: A value for each input, by column, as in a table: a number, a text, a date,
            or None, such as a dictionary or a row of a pandas frame; or a table, of
            which one row is taken. Other columns do not count.
        number: Which row of a table, from 1.
        wanted: The class that a change shall give; any other one unless given.
        fixed: Inputs that do not change.
        costs: What a change by 1 costs, or any change of a category, by input; one over
            the range of the input unless given. A change costs as much as that of the
            input that costs most.
        limits: The values that a change may give, by input, as those of `audit`; the
            ranges of the model unless given.
        allow_loss: As in `load`.

    Returns:
        The explanation; `str` of it is what the command prints. Of a fuzzy system it
        has the rules that fire, and the slopes of the outputs.

    Raises:
        ReadError: If the file cannot be read.
        LossError: As `load`.
        TableError: If an input has no value, or one that is no number or category.
        ValueError: If a class or an input is unknown, a cost is not above 0, every
            input is fixed, or an input has no limits.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1)
        >>> explanation = why(tree, dict.fromkeys(tree.inputs, 0.5))
        >>> explanation.change.verdict
        'PROVED'
    """
    document = checking.as_model(model, allow_loss=allow_loss)
    return auditing.explain_row(
        document,
        row_of(document, row, number),
        wanted=None if wanted is None else str(wanted),
        fixed=[fixed] if isinstance(fixed, str) else fixed,
        costs=costs or {},
        limits=limits or {},
    )


def row_of(model: Document, row: object, number: int = 1) -> dict[str, float]:
    """Return a row as numbers for the inputs of a model; NaN where one is missing.

    Args:
        model: Whose inputs they are.
        row: The values by column; or a table, where a cell that is no category is
            missing, as in `run`.
        number: Which row of the table, from 1.

    Raises:
        TableError: If an input has no value, one that is no number, or one that is no
            category; if there is no such row.
    """
    whole = row if isinstance(row, TableSource) else TableSource(row)
    name, cells = None, _cells_of(whole.source)
    if cells is not None:
        _check_categories(model, cells)
        values = np.empty((1, len(cells)), object)
        values[0] = [*cells.values()]
        whole = table(values, columns=[*cells], format=whole.format)
        name, number = "the row", 1
    seen, variables, trained = 0, model.variables, model.columns
    for batch in batches(
        whole, model.inputs, trained=trained, name=name, variables=variables
    ):
        name, count = batch.piece.name, batch.values.shape[1]
        if seen < number <= seen + count:
            numbers = batch.values[:, number - 1 - seen].tolist()
            return dict(zip(model.inputs, numbers, strict=True))
        seen += count
    raise TableError(f"{name} has {counted(seen, 'row')}, and no row {number}")


def _cells_of(row: Any) -> dict[str, object] | None:
    """Return a row's values by column; None of a table."""
    if isinstance(row, Mapping):
        return {str(name): cell for name, cell in row.items()}
    if getattr(row, "ndim", None) == 1 and hasattr(row, "to_dict"):  # of pandas
        return _cells_of(row.to_dict())
    return None


def _check_categories(model: Document, cells: dict[str, object]) -> None:
    """Refuse what is no category; the word `missing` is a missing value."""
    for variable in model.variables:
        cell = cells.get(variable.name)
        if cell == MISSING and MISSING not in variable.categories:
            cells[variable.name] = None
        elif variable.categories and placer(variable.categories)(cell) is None:
            choice = name_choice(str(cell), variable.categories)
            text = f"the row: {variable.name!r} has no category {cell!r}; {choice}"
            raise TableError(text)
