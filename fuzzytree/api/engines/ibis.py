"""Tables of Ibis: states from their record batches, predictions as a query.

The query is that of DuckDB, translated to the dialect of the table's backend.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import ibis
import ibis.expr.operations as ops
import sqlglot

from fuzzytree.api.engines import duckdb

if TYPE_CHECKING:
    import pyarrow as pa
    from ibis.expr.types import Table

    from fuzzytree.api.engines.core import Fold, Predictor


def states(frame: Table, fold: Fold) -> list[bytes]:
    """Return the state of all rows; few batches of them are in memory at a time."""
    selection = frame.select(*fold.selected)
    backend: Any = ibis.get_backend(selection)
    if backend.name != "duckdb":
        return [fold(selection.to_pyarrow_batches(), "the table")]
    # to_pyarrow_batches calls what DuckDB 2 has under another name only
    selection.limit(0).to_pyarrow()  # registers tables in memory
    return duckdb.states(backend.con.sql(str(ibis.to_sql(selection))), fold)


def predictions(frame: Table, predictor: Predictor, schema: pa.Schema) -> Table:
    """Return the table with the predictions beside its columns."""
    before = frame.schema()
    numbers = {
        name: kind.is_decimal() if kind.is_numeric() or kind.is_boolean() else None
        for name, kind in before.items()
    }
    table = next(duckdb.TABLES)
    rows: Any = frame.alias(table)
    query = duckdb.prediction_query(table, numbers, predictor, schema)
    backend: Any = ibis.get_backend(frame)
    [text] = sqlglot.transpile(query, read="duckdb", write=backend.dialect)
    after = ibis.schema({**before, **ibis.Schema.from_pyarrow(schema)})
    return ops.SQLStringView(rows, text, after).to_expr()
