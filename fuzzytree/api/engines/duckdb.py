"""Relations of DuckDB: states from their record batches, predictions as a query.

The query is that of `fuzzytree.exporters.sql`, on the relation's own connection, so
that the result joins, aggregates and is stored like any relation.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, cast

from fuzzytree.checking import export
from fuzzytree.errors import TableError
from fuzzytree.model import FuzzyTree

if TYPE_CHECKING:
    import pyarrow as pa
    from duckdb import DuckDBPyRelation

    from fuzzytree.api.engines.core import Answer, Fold

_ROWS: Final = 1 << 16
"""How many rows a record batch has at most."""

TABLE: Final = "fuzzytree_rows"
"""What a query calls the table that it reads."""

_NUMBER = re.compile(r"(U?(HUGE|BIG|SMALL|TINY)?INT(EGER)?|FLOAT|DOUBLE|BOOLEAN)")
_TYPES: Final = {
    "int64": "BIGINT",
    "double": "DOUBLE",
    "bool": "BOOLEAN",
    "uint64": "UBIGINT",
}
_STATUS: Final = (
    "CASE \"status\" WHEN 0 THEN 'decided' WHEN 1 THEN 'tie' "
    "WHEN 2 THEN 'uncovered' ELSE 'missing' END"
)


def states(frame: DuckDBPyRelation, fold: Fold) -> list[bytes]:
    """Return the state of all rows; few batches of them are in memory at a time."""
    chosen = frame.project(", ".join(map(_quoted, fold.selected)))
    return [fold(chosen.to_arrow_reader(_ROWS), "the table")]


def answered(
    frame: DuckDBPyRelation, answer: Answer, schema: pa.Schema
) -> DuckDBPyRelation:
    """Return the relation with the predictions beside its columns.

    Raises:
        TableError: If an input is no column of numbers.
        LossError: If the model has more rules or levels than a query can have.
    """
    kinds = dict(zip(frame.columns, map(str, frame.types), strict=True))
    numbers = {name: _NUMBER.fullmatch(kind) for name, kind in kinds.items()}
    exact = {
        name: kind.startswith("DECIMAL") or "HUGE" in kind
        for name, kind in kinds.items()
        if numbers[name] or kind.startswith("DECIMAL")
    }
    query = prediction_query(answer, kinds, exact, schema)
    return cast("DuckDBPyRelation", frame.query(TABLE, query))  # None is for INSERT


def prediction_query(
    answer: Answer,
    kinds: Mapping[str, str],
    numbers: Mapping[str, bool],
    schema: pa.Schema,
) -> str:
    """Return the query that adds the predictions to the columns of `TABLE`.

    Args:
        answer: The model.
        kinds: The type of each column, as messages name it.
        numbers: Whether a column of numbers has more digits than a double, for each of
            them.
        schema: The columns that are added.

    Raises:
        TableError: If an input is no column of numbers.
        LossError: If the model has more rules or levels than a query can have.
    """
    kept = {name: f"kept {place}" for place, name in enumerate(kinds, 1)}
    columns = [f"{_quoted(name)} AS {_quoted(kept[name])}" for name in kinds]
    for place, (name, kind) in enumerate(kinds.items(), 1):
        title = name.strip() or f"column {place}"
        if title not in answer.inputs:
            continue
        if name not in numbers:
            raise TableError(
                f"the table: column {title!r} is of type {kind}, and the model needs "
                "numbers: cast it to DOUBLE before"
            )
        # engines do not round long decimals to the nearest double; reading text does
        text = f"CAST({_quoted(name)} AS VARCHAR)" if numbers[name] else _quoted(name)
        columns.append(f"CAST({text} AS DOUBLE) AS {_quoted(title)}")
    model, strength = answer.model, "1e0"
    if not isinstance(model, FuzzyTree):
        names = [f"strength_{rule}" for rule in range(1, len(model.rules) + 1)]
        strength = f"GREATEST({', '.join(names)})"
    written = export(
        model,
        "sql",
        dialect="duckdb",
        table="numbers",
        keep=[*kept.values()],
        strengths=not isinstance(model, FuzzyTree),
    )
    # steps that are kept in memory whole would end streaming
    steps = re.sub(r"(?m)^(\w+ AS) MATERIALIZED \($", r"\1 (", written.content.decode())
    kind = _TYPES.get(str(schema.field("class").type), "VARCHAR")
    return (
        f"WITH numbers AS (SELECT {', '.join(columns)} FROM {TABLE}),\n"
        f"predictions AS (\n{steps})\n"
        f"SELECT {', '.join(f'{_quoted(k)} AS {_quoted(n)}' for n, k in kept.items())},"
        f' CAST("class" AS {kind}) AS "class", CAST("rule" AS INTEGER) AS "rule",'
        f' {_STATUS} AS "status",'
        f' CASE WHEN "rule" > 0 THEN {strength} END AS "strength"\nFROM predictions'
    )


def _quoted(name: str) -> str:
    mark = '"'
    return mark + name.replace(mark, mark * 2) + mark
