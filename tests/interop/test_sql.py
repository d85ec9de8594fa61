"""Databases answer the rows of the wine table with our queries."""

from __future__ import annotations

import csv
import importlib
import io
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.checking.comparing import same_bits
from fuzzytree.exporters.sql import write
from fuzzytree.exporters.sql_text import Dialect
from fuzzytree.model.contracts import Model, Outcome
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import system_probes
from fuzzytree.tables import read_table
from fuzzytree.testing import probe_values, random_system
from tests.runtimes.test_written_systems import within

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

WINE = Path(__file__).parents[2] / "examples" / "wine" / "wine.csv"


def _models() -> Iterator[tuple[str, Model]]:
    for name, entry in (("plain", 2.0), ("combined", 25.0)):
        tree = ft.learn(
            WINE, target="cultivar", settings=ft.LearningSettings(entry=entry)
        )
        yield f"{name} tree", tree
        yield f"{name} relative rules", rules_from_tree(tree)
        yield f"{name} raw rules", rules_from_tree(tree, "raw")
        product = rules_from_tree(tree, "raw", conjunction="product")
        yield f"{name} product rules", product


MODELS = dict(_models())


def _rows(model: Model) -> FloatArray:
    """Return the wine table, and the rows that matter for the model."""
    table = read_table(WINE, target="cultivar")
    columns = [table.columns.index(name) for name in model.inputs]
    data = np.asarray(table.values[columns], np.float64)
    assert data.shape[1] == 178
    return np.hstack([data, probe_values(model, 300)])


def _assert_equal(found: list[list[float | None]], right: Outcome) -> None:
    """Compare rows of rule, status and strengths; an unknown strength is None."""
    assert [row[0] for row in found] == right.rule.tolist()
    assert [row[1] for row in found] == right.status.tolist()
    if right.strengths is not None:
        given = [[math.nan if s is None else s for s in row[2:]] for row in found]
        assert same_bits(np.array(given).T, right.strengths).all()


def _query(model: Model, dialect: Dialect) -> str:
    is_rules = isinstance(model, RuleBase)
    return write(
        model, dialect=dialect, table="wine", keep=["row"], strengths=is_rules
    ).content.decode()


@pytest.mark.one_in(6)
@pytest.mark.parametrize("name", MODELS)
def test_duckdb_answers_with_our_bits(name: str, library: Callable[[str], str]) -> None:
    duckdb = importlib.import_module(library("duckdb"))
    model = MODELS[name]
    values = _rows(model)
    connection = duckdb.connect()
    columns = "".join(f', "{column}" DOUBLE' for column in model.inputs)
    connection.execute(f"CREATE TABLE wine (row INTEGER{columns})")
    marks = ",".join("?" * (len(values) + 1))
    rows = [[number, *row] for number, row in enumerate(values.T.tolist())]
    connection.executemany(f"INSERT INTO wine VALUES ({marks})", rows)
    found = sorted(connection.execute(_query(model, "duckdb")).fetchall())
    right = find_runtime("reference").load(model)(values)
    _assert_equal([list(row[2:]) for row in found], right)


@pytest.fixture(scope="module")
def postgresql() -> Iterator[list[str]]:
    """Start a server of our own behind a socket, and return how to call psql."""
    folders = sorted(Path("/usr/lib/postgresql").glob("*/bin"))
    if not folders or shutil.which("runuser") is None:
        if os.environ.get("FUZZYTREE_WITNESSES") == "all":
            pytest.fail("PostgreSQL is not installed")
        pytest.skip("PostgreSQL is not installed")
    # No other user may enter the folders of pytest.
    home = Path(tempfile.mkdtemp(prefix="postgresql-"))
    shutil.chown(home, "postgres")
    user = ["runuser", "-u", "postgres", "--"]
    tool = str(folders[-1])
    data = str(home / "data")
    subprocess.run(
        [*user, f"{tool}/initdb", "-D", data, "-A", "trust", "--locale=C"],
        check=True, capture_output=True, cwd="/", timeout=120,
    )  # fmt: skip
    start = [*user, f"{tool}/pg_ctl", "-D", data, "-w"]
    options = f"-c listen_addresses='' -c unix_socket_directories='{home}'"
    subprocess.run(
        [*start, "-l", str(home / "log"), "-o", options, "start"],
        check=True, capture_output=True, cwd="/", timeout=120,
    )  # fmt: skip
    try:
        yield [*user, f"{tool}/psql", "-h", str(home), "-X", "-q", "-v",
               "ON_ERROR_STOP=1", "--csv", "-t", "postgres"]  # fmt: skip
    finally:
        subprocess.run([*start, "-m", "immediate", "stop"], check=False, cwd="/")
        shutil.rmtree(home)


def _answers(
    psql: list[str], names: Sequence[str], values: FloatArray, query: str
) -> list[list[str]]:
    """Return the rows of a query, in order, to a table with these values."""
    columns = "".join(f', "{name}" DOUBLE PRECISION' for name in names)
    lines = [
        f"{number}," + ",".join(map(repr, row))
        for number, row in enumerate(values.T.tolist())
    ]
    script = "\n".join(
        [
            f"CREATE TEMP TABLE wine (row INTEGER{columns});",
            "COPY wine FROM STDIN WITH (FORMAT csv);",
            *lines,
            "\\.",
            query + "ORDER BY row;",
        ]
    )
    done = subprocess.run(
        psql, input=script, capture_output=True, text=True, cwd="/", timeout=300
    )
    assert done.stderr == ""
    return [row for row in csv.reader(io.StringIO(done.stdout)) if row]


@pytest.mark.heavy
def test_postgresql_has_the_numbers_of_systems_and_no_row_fails_another(
    postgresql: list[str],
) -> None:
    for seed in range(24):
        system = random_system(seed)
        rows = system_probes(system, limit=80)
        values = np.array([[row[name] for name in system.inputs] for row in rows]).T
        assert (np.abs(values) == 1.7976931348623157e308).any()
        query = write(
            system, dialect="postgresql", table="wine", keep="row", strengths=True
        ).content.decode()
        cells = _answers(postgresql, system.inputs, values, query)
        numbers = [[float(x or "nan") for x in row[1:]] for row in cells]
        within(system, values, np.array(numbers).T)


@pytest.mark.heavy
@pytest.mark.parametrize("name", MODELS)
def test_postgresql_answers_with_our_bits(name: str, postgresql: list[str]) -> None:
    model = MODELS[name]
    values = _rows(model)
    right = find_runtime("reference").load(model)(values)
    rows = _answers(postgresql, model.inputs, values, _query(model, "postgresql"))
    found = [[None if x == "" else float(x) for x in row[2:]] for row in rows]
    _assert_equal(found, right)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("dialect", ["sqlite", "duckdb", "postgresql", "spark"])
def test_a_parser_of_each_dialect_takes_every_query(
    dialect: Dialect, library: Callable[[str], str]
) -> None:
    sqlglot = importlib.import_module(library("sqlglot"))
    word = {"postgresql": "postgres"}.get(dialect, dialect)
    for model in MODELS.values():
        assert len(sqlglot.parse(_query(model, dialect), read=word)) == 1
