"""Frames of Spark and Spark Connect: its workers make, merge and predict partitions."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, Final

import pyarrow as pa
from pyspark import TaskContext
from pyspark.sql.pandas.types import from_arrow_schema
from pyspark.sql.types import StructType

from fuzzytree.api.engines.core import Fold, Predictor, merge_states

if TYPE_CHECKING:
    from pyspark.sql import DataFrame

_WIDTHS: Final = (64, 8)
"""The most states that are left after each step of merging on the workers."""

_ROW: Final = "part long, state binary"


def states(frame: DataFrame, fold: Fold) -> list[bytes]:
    """Return at most eight states of all partitions, which the workers have merged."""

    def fold_rows(batches: Iterable[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        context: Any = TaskContext.get()
        part = context.partitionId()
        named = (batch.rename_columns(fold.selected) for batch in batches)
        state = fold(named, f"partition {part}")
        yield pa.record_batch({"part": [part], "state": [state]})

    def merge_rows(batches: Iterable[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        rows = (row for batch in batches for row in batch.to_pylist())
        for first in rows:
            contents = (row["state"] for row in itertools.chain([first], rows))
            state = merge_states(contents)
            yield pa.record_batch({"part": [first["part"]], "state": [state]})

    # mapInArrow takes a dot in the name of a column for a path
    numbered = {name: f"c{number}" for number, name in enumerate(frame.columns)}
    chosen = frame.toDF(*numbered.values()).select(
        [numbered[name] for name in fold.selected]
    )
    result = chosen.mapInArrow(fold_rows, _ROW)
    for width in _WIDTHS:
        groups = result.repartition(result["part"] % width)
        result = groups.mapInArrow(merge_rows, _ROW)
    return [bytes(row["state"]) for row in result.collect()]


def predictions(frame: DataFrame, predictor: Predictor, schema: pa.Schema) -> DataFrame:
    """Return the frame with the predictions beside its columns; nothing runs yet."""
    names = frame.columns

    def predicted(batches: Iterable[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        return (predictor(batch.rename_columns(names)) for batch in batches)

    numbered = frame.toDF(*(f"c{number}" for number in range(len(names))))
    fields = [*frame.schema, *from_arrow_schema(schema)]
    return numbered.mapInArrow(predicted, StructType(fields))
