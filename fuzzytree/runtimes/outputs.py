"""What a fuzzy system answered to the rows of a table."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.model.rulebase import summary
from fuzzytree.semantics.reference import Status
from fuzzytree.tables import arrow_table, pandas_frame

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

    from fuzzytree.model.contracts import FloatArray, IntArray


class Outputs(msgspec.Struct, frozen=True, eq=False):
    """The numbers that a system answered to some rows.

    Attributes:
        names: The outputs.
        values: Shape (outputs, rows); NaN where a value is missing, and where no rule
            concludes an output that has no default.
        status: A `fuzzytree.semantics.reference.Status` for each row: decided;
            uncovered, if an output got no conclusion and answers its default; or
            missing.
        activations: The degree of activation of each rule, shape (rules, rows); None
            if they were not requested.
    """

    names: tuple[str, ...]
    values: FloatArray
    status: IntArray
    activations: FloatArray | None = None

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.status)

    def __getitem__(self, name: str) -> FloatArray:
        """Return the numbers of an output, one for each row."""
        numbers: FloatArray = self.values[self.names.index(name)]
        return numbers

    def count(self, status: int) -> int:
        """Return how many rows have this `fuzzytree.semantics.reference.Status`."""
        return int(np.count_nonzero(self.status == status))

    def columns(self, *, with_activations: bool = False) -> dict[str, Sequence[object]]:
        """Return the columns that `to_csv` writes, by name.

        Args:
            with_activations: Whether each rule has a column.

        Raises:
            ValueError: If activations are requested that are not there.
        """
        found: dict[str, Sequence[object]] = {
            name: _cells(row) for name, row in zip(self.names, self.values, strict=True)
        }
        words = [status.name.lower() for status in Status]
        title = "status"
        while title in found:  # an output may have that name
            title += "_"
        found[title] = [words[status] for status in self.status.tolist()]
        if not with_activations:
            return found
        if self.activations is None:
            raise ValueError("there are no degrees of activation; ask for them")
        for number, row in enumerate(self.activations, 1):
            found[f"strength of rule {number}"] = _cells(row)
        return found

    def spans(self) -> dict[str, tuple[float, float]]:
        """Return the least and the largest number of each output that has one."""
        known = {
            name: row[~np.isnan(row)]
            for name, row in zip(self.names, self.values, strict=True)
        }
        return {
            name: (float(row.min()), float(row.max()))
            for name, row in known.items()
            if row.size
        }

    def to_csv(self, *, with_activations: bool = False) -> str:
        """Return the answers as CSV: each output and the status; NaN is an empty cell.

        Raises:
            ValueError: If activations are requested that are not there.
        """
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        columns = self.columns(with_activations=with_activations)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
        return text.getvalue()

    def to_arrow(self, *, with_activations: bool = False) -> pa.Table:
        """Return the columns of `to_csv` as a table of pyarrow; needs pyarrow.

        Raises:
            ValueError: If activations are requested that are not there.
        """
        return arrow_table(self.columns(with_activations=with_activations))

    def to_pandas(self, *, with_activations: bool = False) -> pd.DataFrame:
        """Return the columns of `to_csv` as a frame of pandas; needs pandas.

        Raises:
            ValueError: If activations are requested that are not there.
        """
        return pandas_frame(self.columns(with_activations=with_activations))

    def __repr__(self) -> str:
        """Show how many rows there are; `str` shows the range of each output."""
        return summary("Outputs", rows=len(self), outputs=len(self.names))

    def __str__(self) -> str:
        """Show the range of each output, and what was out of the ordinary."""
        found = self.spans().items()
        spans = ", ".join(
            f"{name} {low:.6g} to {high:.6g}" for name, (low, high) in found
        )
        odd = [
            f"{count} {what}"
            for count, what in (
                (self.count(Status.UNCOVERED), "uncovered"),
                (self.count(Status.MISSING), "with missing values"),
            )
            if count
        ]
        return "; ".join([f"{len(self)} rows: {spans or 'no number'}", *odd])


def _cells(row: FloatArray) -> list[object]:
    return ["" if math.isnan(value) else value for value in row.tolist()]


def joined_outputs(parts: Sequence[Outputs]) -> Outputs:
    """Return the answers to several batches of rows, one after another."""
    first = parts[0]
    degrees = [part.activations for part in parts if part.activations is not None]
    return Outputs(
        first.names,
        np.hstack([part.values for part in parts]),
        np.concatenate([part.status for part in parts]),
        np.hstack(degrees) if len(degrees) == len(parts) else None,
    )
