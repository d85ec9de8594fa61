"""Lazy frames of Polars: batches come from its streaming engine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import polars as pl

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pyarrow as pa

    from fuzzytree.api.engines.core import Fold, Predictor


def states(frame: pl.LazyFrame, fold: Fold) -> list[bytes]:
    """Return the state of all rows; few batches of them are in memory at a time."""
    selection = frame.select(fold.selected)
    parts = selection.collect_batches(engine="streaming")

    def rows() -> Iterator[pa.RecordBatch]:
        for part in parts:
            yield from part.to_arrow().to_batches()

    return [fold(rows(), "the table")]


def predictions(
    frame: pl.LazyFrame, predictor: Predictor, schema: pa.Schema
) -> pl.LazyFrame:
    """Return the frame with the predictions beside its columns."""
    fields = pl.DataFrame(schema.empty_table()).schema

    def predict(rows: pl.Series) -> pl.Series:
        table = rows.struct.unnest().to_arrow()
        return pl.DataFrame(predictor.predictions(table)).to_struct()

    names = frame.collect_schema().names()
    inputs = [name for name in names if name.strip() in predictor.inputs] or names[:1]
    rows = pl.struct(inputs).map_batches(
        predict, pl.Struct(fields), is_elementwise=True
    )
    return frame.with_columns(rows.alias("class")).unnest("class")
