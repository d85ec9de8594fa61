"""How the dialects of SQL write names, texts and numbers, and what they hold."""

from __future__ import annotations

import math
import re
from fractions import Fraction
from typing import Literal, NamedTuple

from fuzzytree.columns import BOOLEANS
from fuzzytree.exporters.sql_reach import LARGEST
from fuzzytree.model import Variable

Dialect = Literal[
    "sqlite",
    "duckdb",
    "postgresql",
    "spark",
    "bigquery",
    "snowflake",
    "tsql",
    "clickhouse",
    "trino",
]


class Limit(NamedTuple):
    """What an engine takes as it is installed.

    Attributes:
        engine: Its name.
        columns: The most columns of a step.
        length: The most bytes of a statement.
    """

    engine: str
    columns: float = math.inf
    length: float = math.inf


LIMITS: dict[Dialect, Limit] = {
    # sqlite.org/limits.html
    "sqlite": Limit("SQLite", 2_000, 1_000_000_000),
    # duckdb.org/docs/stable/operations_manual/limits: none of either
    "duckdb": Limit("DuckDB"),
    # postgresql.org/docs/current/limits.html: columns in a result set
    "postgresql": Limit("PostgreSQL", 1_664),
    "spark": Limit("Spark"),
    # cloud.google.com/bigquery/quotas: columns in a table, length of a query
    "bigquery": Limit("BigQuery", 10_000, 1_048_576),
    # docs.snowflake.com/en/user-guide/query-size-limits
    "snowflake": Limit("Snowflake", length=1_048_576),
    # learn.microsoft.com/sql/sql-server/maximum-capacity-specifications-for-sql-server
    "tsql": Limit("SQL Server", 4_096, 268_435_456),
    # clickhouse.com/docs/operations/settings/settings: max_query_size
    "clickhouse": Limit("ClickHouse", length=262_144),
    # trino.io/docs/current/admin/properties-query-management: query.max-length
    "trino": Limit("Trino", length=1_000_000),
}
"""Expressions are at most a few dozen levels deep; SQLite and DuckDB take 1,000."""

TRANSLATED = frozenset(("bigquery", "snowflake", "tsql", "clickhouse", "trino"))
"""Dialects that sqlglot translates the one of PostgreSQL into; none is run here."""

_RESERVED = frozenset(
    """
    all alter analyze and anti any array as asc between both by case cast check class
    collate column constraint create cross current default delete desc describe distinct
    drop else end escape except exists false fetch filter for foreign from full function
    grant group having if in index inner insert intersect interval into is join key
    lateral leading left like limit minus natural not null offset on only or order outer
    overlaps pivot primary qualify range references right rows select semi session set
    show some status rule table then time to trailing true union unique unknown unpivot
    update user using values when where window with
    """.split()  # noqa: SIM905
)


class Query:
    """How a dialect writes things, and how the query names them.

    Attributes:
        is_strict: Whether the engine raises an error where a number overflows,
            underflows or is undefined: nothing in the query may.
    """

    def __init__(self, dialect: Dialect, table: str, keep: tuple[str, ...]) -> None:
        self.target: Dialect = dialect
        self.is_translated = dialect in TRANSLATED
        self.dialect = "postgresql" if self.is_translated else dialect
        self.is_strict = self.dialect == "postgresql"
        self.table = table
        self.keep = keep

    @property
    def double(self) -> str:
        """The type of a double."""
        return {"sqlite": "REAL", "postgresql": "DOUBLE PRECISION"}.get(
            self.dialect, "DOUBLE"
        )

    def step(self, name: str) -> str:
        """Open a step, which is computed once where the dialect can say so."""
        can_say = self.dialect != "spark" and not self.is_translated
        is_once = can_say and name != "columns"
        return f"{name} AS {'MATERIALIZED ' if is_once else ''}("

    def name(self, text: str) -> str:
        """Return a name as an identifier."""
        if re.fullmatch(r"[a-z][a-z0-9_]*", text) and text not in _RESERVED:
            return text
        # SQLite takes an unknown name in double quotes for a text, and goes on.
        mark = "`" if self.dialect in ("spark", "sqlite") else '"'
        return mark + text.replace(mark, mark * 2) + mark

    def column(self, variable: Variable) -> str:
        """Return a column of the table as finite doubles; anything else is NULL.

        SQLite, whose columns hold anything, takes the position of a category as well.
        """
        source = self.name(variable.name)
        number = f"CAST({source} AS {self.double})"
        test = f"{number} BETWEEN -{LARGEST} AND {LARGEST}"
        if self.dialect == "sqlite":  # it would cast any text to 0
            test = f"typeof({source}) IN ('integer', 'real') AND {test}"
        number = f"CASE WHEN {test} THEN {number} END"
        if not variable.categories:
            return number
        places = [self.typed(float(k)) for k in range(len(variable.categories))]
        if variable.categories == BOOLEANS and self.dialect != "sqlite":
            no, yes = places
            return f"CASE WHEN {source} THEN {yes} WHEN NOT {source} THEN {no} END"
        cases = " ".join(
            f"WHEN {self.text(name)} THEN {place}"
            for name, place in zip(variable.categories, places, strict=True)
        )
        own = f" ELSE {number}" if self.dialect == "sqlite" else ""
        return f"CASE {source} {cases}{own} END"

    def text(self, text: str | None) -> str:
        """Return a text as a literal."""
        if text is None:
            return "NULL"
        escaped = text.replace("'", "''")
        if self.dialect == "spark":
            escaped = text.replace("\\", "\\\\").replace("'", "\\'")
        return f"'{escaped}'"

    def typed(self, value: float) -> str:
        """Return a double by itself: PostgreSQL would take it for a decimal."""
        text = self.number(value)
        is_plain = self.is_strict and math.isfinite(value)
        return f"{text}::float8" if is_plain else text

    def number(self, value: float) -> str:
        """Return a double as an expression that gives it exactly; NULL for NaN.

        SQLite does not promise to round decimals right: there a number that is not its
        own decimal is a whole number divided by a power of two.
        """
        if math.isnan(value):
            return "NULL"
        if math.isinf(value):
            sign = "-" if value < 0.0 else ""
            if self.dialect == "sqlite":
                return f"({sign}9e999)"
            if self.target != "tsql":
                return f"CAST('{sign}Infinity' AS {self.double})"
            value = math.copysign(LARGEST, value)  # there is nothing larger
        text = repr(value)
        if "e" not in text:
            text = text.removesuffix(".0") + "e0"
        if self.dialect == "sqlite" and not _is_decimal(value):
            return f"({_ratio(value)})"
        return f"({text})" if text.startswith("-") else text

    def known(self, text: str) -> str:
        """Return an expression with NULL where it is NaN."""
        if self.target in ("sqlite", "tsql"):
            return text  # these know no NaN
        return f"NULLIF({text}, CAST('NaN' AS {self.double}))"


def _is_decimal(value: float) -> bool:
    return Fraction(repr(value)) == Fraction(value) and 1e-15 < abs(value) < 1e15


def _ratio(value: float) -> str:
    """Return a double as a product of whole numbers and powers of two, each exact.

    Example:
        >>> _ratio(0.1)
        'CAST(3602879701896397 AS REAL) / 36028797018963968'
    """
    if value == 0.0:
        return "-0e0" if math.copysign(1.0, value) < 0 else "0e0"
    whole, below = value.as_integer_ratio()
    shift = below.bit_length() - 1
    while whole % 2 == 0:
        whole, shift = whole // 2, shift - 1
    text = f"CAST({whole} AS REAL)"
    while shift:
        # Scaled by at most 2^60 at a time; all but the last step away from 0 is exact.
        step = max(-60, min(60, shift))
        text += f" / {2**step}" if step > 0 else f" * {2**-step}"
        shift -= step
    return text
