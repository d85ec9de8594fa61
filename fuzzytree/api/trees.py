"""Two tree ensembles in `check`: which sources are such, and rows of a table."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import islice
from typing import TYPE_CHECKING, cast

import numpy as np

from fuzzytree import checking, ensembles
from fuzzytree.errors import LossError, TableError
from fuzzytree.model import FloatArray, TreeAgreement
from fuzzytree.tables import batches, pieces

if TYPE_CHECKING:
    from fuzzytree.api.answering import Carried
    from fuzzytree.model import FuzzyTree, ModelSource


def check_trees(
    model: ModelSource,
    others: Sequence[Carried],
    data: object,
    names: Sequence[str],
    runtimes: Sequence[str] | None,
    limit: int | None,
) -> TreeAgreement | None:
    """Compare two tree ensembles; None if neither of two sources is one of others.

    Args:
        model: As `check` takes it.
        others: As `check` takes them.
        data: A table whose rows are run as well.
        names: What to call each of the others.
        runtimes: None, as these trees run in their own programs.
        limit: The most generated rows.

    Raises:
        LossError: If there are not two, or they cannot be compared.
        ReadError: If a file cannot be read.
        TableError: If the table has too few columns.
        ValueError: If a runtime is named.
    """
    first = ensembles.opened(model)
    second = ensembles.opened(others[0]) if len(others) == 1 else None
    if second is None and (first is None or first.is_ours):
        return None
    if len(others) != 1:
        name = os.fspath(model) if isinstance(model, str | os.PathLike) else "it"
        raise LossError(
            f"{name}: trees of other libraries are compared with one other file or "
            f"estimator, and not with {len(others)}"
        )
    if runtimes is not None:
        raise ValueError("runtimes: trees of other libraries run in their own programs")
    first = first or _of_ours(model)
    second = second or _of_ours(others[0])
    if names:
        second = second.named(names[0])
    rows = None
    if data is not None:
        rows = _rows(data, first.ensemble.columns, max(first.width, second.width))
    return ensembles.judge(first, second, limit=limit, data=rows)


def _of_ours(source: ModelSource | Carried) -> ensembles.Opened:
    """Return a tree of ours, by its path if it has one.

    Raises:
        LossError: If it is no tree, or cuts what no tree of another library cuts.
    """
    model = checking.as_model(cast("ModelSource", source))
    if model.outputs or model.rules:
        raise LossError(f"{model.name}: rules and systems are not compared with trees")
    result = ensembles.opened_tree(cast("FuzzyTree", model))
    if isinstance(source, str | os.PathLike):
        return result.named(str(os.fspath(source)))
    return result


def _rows(data: object, columns: Sequence[str] | None, width: int) -> FloatArray:
    """Return the rows of a table: its named columns, or else its first ones."""
    if columns is None:
        head = next(islice(pieces(data), 1))
        columns = head.columns[:width]
        if len(columns) < width:
            raise TableError(
                f"{head.name}: {len(columns)} columns; the trees take {width}"
            )
    return np.hstack([batch.values for batch in batches(data, columns)]).T
