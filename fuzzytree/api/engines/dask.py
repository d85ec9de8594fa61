"""Frames of Dask: its workers make, merge and predict partitions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import pandas as pd
import pyarrow as pa
from dask.base import compute
from dask.dataframe.dispatch import make_meta
from dask.delayed import delayed

from fuzzytree.api.engines.core import Fold, Predictor, merge_states

if TYPE_CHECKING:
    from dask.dataframe import DataFrame

_WIDTH: Final = 8
"""How many states a worker merges at a time, and the most that are returned."""


def states(frame: DataFrame, fold: Fold) -> list[bytes]:
    """Return at most eight states of all partitions, which the workers have merged."""
    chosen = frame[[column for column in frame.columns if str(column) in fold.selected]]
    make, merge = delayed(fold), delayed(merge_states)
    result: list[Any] = [
        make(part, f"partition {number}")
        for number, part in enumerate(chosen.to_delayed())
    ]
    while len(result) > _WIDTH:
        starts = range(0, len(result), _WIDTH)
        result = [merge(result[first : first + _WIDTH]) for first in starts]
    return [*compute(*result)]


def predictions(frame: DataFrame, predictor: Predictor, schema: pa.Schema) -> DataFrame:
    """Return the frame with the predictions beside its columns; nothing runs yet.

    The class of numbers or booleans has a pandas type that may be missing.
    """
    types = {pa.int64(): pd.Int64Dtype(), pa.bool_(): pd.BooleanDtype()}

    def predicted(part: pd.DataFrame) -> pd.DataFrame:
        more = predictor.predictions(part).to_pandas(types_mapper=types.get)
        return part.assign(**{name: more[name].array for name in schema.names})

    return frame.map_partitions(predicted, meta=predicted(make_meta(frame)))
