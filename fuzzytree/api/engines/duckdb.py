"""Relations of DuckDB: states from their record batches, predictions as a query.

The query is that of `fuzzytree.exporters.sql`, on the relation's own connection, so
that the result joins, aggregates and is stored like any relation.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final, cast

from fuzzytree.cells import number_of
from fuzzytree.checking import export
from fuzzytree.columns import BOOLEANS
from fuzzytree.errors import TableError
from fuzzytree.model import DATE_UNIT, Variable
from fuzzytree.semantics import Status

if TYPE_CHECKING:
    import pyarrow as pa
    from duckdb import DuckDBPyRelation

    from fuzzytree.api.engines.core import Fold, Predictor

_ROWS: Final = 1 << 16
"""How many rows a record batch has at most."""

TABLES = map("fuzzytree_rows_{}".format, itertools.count(1))
"""Names for tables in queries, each of its own."""

_NUMBER = re.compile(r"\w*INT(EGER)?|FLOAT|DOUBLE|BOOLEAN|DECIMAL.*")
_STATUS: Final = 'CASE "status"{} END'.format(
    "".join(f" WHEN {status:d} THEN '{status.name.lower()}'" for status in Status)
)


def states(frame: DuckDBPyRelation, fold: Fold) -> list[bytes]:
    """Return the state of all rows; few batches of them are in memory at a time."""
    selection = frame.project(", ".join(map(_quoted, fold.selected)))
    # DuckDB 1.4 has the old name alone, and DuckDB 2 warns of it
    read = getattr(selection, "to_arrow_reader", None) or selection.fetch_record_batch
    return [fold(read(_ROWS), "the table")]


def predictions(
    frame: DuckDBPyRelation, predictor: Predictor, schema: pa.Schema
) -> DuckDBPyRelation:
    """Return the relation with the predictions beside its columns."""
    numbers = {
        name: "DECIMAL" in str(kind) or "HUGE" in str(kind)
        if _NUMBER.fullmatch(str(kind))
        else None
        for name, kind in zip(frame.columns, frame.types, strict=True)
    }
    table = next(TABLES)
    query = prediction_query(table, numbers, predictor, schema)
    return cast("DuckDBPyRelation", frame.query(table, query))


def prediction_query(
    table: str,
    numbers: Mapping[str, bool | None],
    predictor: Predictor,
    schema: pa.Schema,
) -> str:
    """Return the query that adds the predictions to the columns of a table.

    `numbers` are its columns, each with whether its numbers may have more digits than
    a double; None for a column of anything else.

    Raises:
        TableError: If an input is no column of numbers.
        LossError: If the model has more rules or levels than a query can have.
    """
    columns: list[str] = []
    variables = {one.name.strip(): one for one in predictor.model.variables}
    for place, (name, is_long) in enumerate(numbers.items(), 1):
        cell, title = _quoted(name), name.strip() or f"column {place}"
        columns.append(f'{cell} AS "kept {place}"')
        if title not in predictor.inputs:
            continue
        value = _input(cell, title, is_long, variables[title])
        columns.append(f"{value} AS {_quoted(title)}")
    model = predictor.model
    rules = range(1, len(model.rules) + 1)
    sql = export(
        model,
        "sql",
        dialect="duckdb",
        table="numbers",
        keep=[f"kept {place}" for place in range(1, len(numbers) + 1)],
        strengths=bool(rules),
    ).content.decode()
    # a step that is materialized is in memory whole
    steps = re.sub(r"(?m)^(\w+ AS) MATERIALIZED \($", r"\1 (", sql)
    strengths = ", ".join(f"strength_{rule}" for rule in rules)
    kind = str(schema.field("class").type).upper()
    before = [f'"kept {k}" AS {_quoted(name)}' for k, name in enumerate(numbers, 1)]
    return (
        f"WITH numbers AS (SELECT {', '.join(columns)} FROM {table}),\n"
        f"predictions AS (\n{steps})\n"
        f'SELECT {", ".join(before)}, CAST("class" AS {kind}) AS "class",\n'
        f'CAST("rule" AS INTEGER) AS "rule", {_STATUS} AS "status",\n'
        f'CASE WHEN "rule" > 0 THEN {f"GREATEST({strengths})" if strengths else "1e0"} '
        'END AS "strength" FROM predictions'
    )


def _input(cell: str, title: str, is_long: bool | None, variable: Variable) -> str:
    """Return a column as the query of the model takes it.

    Raises:
        TableError: If it holds something else.
    """
    text = f"CAST({cell} AS VARCHAR)"
    if variable.categories:
        return _category(f"TRIM({text})", variable.categories)
    if is_long is None and variable.unit == DATE_UNIT:
        return f"EPOCH_US(CAST({cell} AS TIMESTAMP)) / 86400000000e0"
    if is_long is None:
        raise TableError(
            f"the table: column {title!r} is no column of numbers, which the model "
            "needs: cast it to DOUBLE before"
        )
    # an engine may not round to the nearest double, unless it reads a text
    return f"CAST({text if is_long else cell} AS DOUBLE)"


def _category(text: str, categories: Sequence[str]) -> str:
    """Return what `placer` makes of a text, as SQL: 2.00 is the category 2."""
    number = f"TRY_CAST({text} AS DOUBLE)"
    is_true, is_false = (f"LOWER({text}) = '{one}'" for one in ("true", "false"))
    if categories == BOOLEANS:
        cases = f"{is_true} OR {number} = 1 THEN TRUE WHEN {is_false} OR {number} = 0"
        return f"CASE WHEN {cases} THEN FALSE END"
    digits = [f"'{one}'" for one in categories if number_of(one) is not None]
    is_whole = f"{number} = FLOOR({number}) AND ABS({number}) < 1e15"
    whole = f"CAST(CAST({number} AS BIGINT) AS VARCHAR)"
    return (
        f"CASE WHEN {is_true} THEN 'True' WHEN {is_false} THEN 'False' "
        f"WHEN {text} IN ({', '.join(digits) or 'NULL'}) THEN {text} "
        f"WHEN {is_whole} THEN {whole} "
        f"ELSE COALESCE(CAST({number} AS VARCHAR), {text}) END"
    )


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'
