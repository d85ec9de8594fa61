from __future__ import annotations

import math
import random
import sqlite3
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pytest

from fuzzytree.errors import LossError
from fuzzytree.exporters.sql import write
from fuzzytree.exporters.sql_text import LIMITS, Dialect, Limit
from fuzzytree.model.contracts import Model, Outcome
from fuzzytree.model.rulebase import (
    Band,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.model.rules import Conclusion, RuleBlock, SystemRule
from fuzzytree.model.system import Defuzzifier, FuzzySystem, SystemOutput
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import probe_values, random_system, random_tree, with_points

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray


def answered(model: Model, values: FloatArray) -> tuple[list[tuple[object, ...]], int]:
    """Return what SQLite answers to rows, and how many inputs stand before it."""
    is_rules = isinstance(model, RuleBase)
    text = write(model, keep=["row"], strengths=is_rules).content.decode()
    connection = sqlite3.connect(":memory:")
    columns = "".join(f", `{name}`" for name in model.inputs)
    connection.execute(f"CREATE TABLE data (row{columns})")
    marks = ",".join("?" * (len(model.inputs) + 1))
    rows = [[number, *row] for number, row in enumerate(values.T.tolist())]
    connection.executemany(f"INSERT INTO data VALUES ({marks})", rows)
    return sorted(connection.execute(text).fetchall()), len(rows)


def same(found: Sequence[tuple[object, ...]], right: Outcome) -> None:
    assert [row[2] for row in found] == right.rule.tolist()
    assert [row[3] for row in found] == right.status.tolist()
    if right.strengths is not None:
        given = [[math.nan if s is None else s for s in row[4:]] for row in found]
        strengths = np.array(given, np.float64).T
        np.testing.assert_array_equal(strengths, right.strengths)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", range(8))
def test_sqlite_answers_with_the_bits_of_the_reference(seed: int) -> None:
    semantics = Semantics(
        "product" if seed % 2 else "minimum", missing="class 1" if seed % 3 else None
    )
    tree = random_tree(seed, leaves=2 + seed, semantics=semantics)
    rules = rules_from_tree(tree)
    for model in (tree, rules, rules_from_tree(tree, "raw"), with_points(rules, seed)):
        values = probe_values(model, 300)
        found, _ = answered(model, values)
        same(found, find_runtime("reference").load(model)(values))


def test_classes_follow_from_the_rule_and_the_policies() -> None:
    low = Term("low", Band(high=1.0))
    variable = Variable("force", (low,))
    when = (Proposition("force", ("low",)),)
    for uncovered, missing in ((None, None), ("it's", "b\\c")):
        rules = RuleBase(
            "grip",
            ("it's", "b\\c"),
            (variable,),
            (Rule(when, "b\\c"),),
            Semantics(uncovered=uncovered, missing=missing),
        )
        found, _ = answered(rules, np.array([[0.5, 2.0, math.nan]]))
        assert [row[1] for row in found] == ["b\\c", uncovered, missing]


def test_a_text_in_a_column_of_numbers_is_missing_and_not_zero() -> None:
    tree = random_tree(3, inputs=1, combinations=0.0)
    text = write(tree).content.decode()
    connection = sqlite3.connect(":memory:")
    connection.execute("CREATE TABLE data (x1)")
    connection.execute("INSERT INTO data VALUES ('soft'), ('1.5'), (NULL), (1)")
    status = [row[3] for row in connection.execute(text)]
    assert sorted(status) == [0, 3, 3, 3]


def test_a_column_that_the_table_lacks_is_an_error_and_not_a_text() -> None:
    tree = random_tree(3, inputs=1, combinations=0.0)
    connection = sqlite3.connect(":memory:")
    connection.execute("CREATE TABLE data (other)")
    with pytest.raises(sqlite3.OperationalError, match="no such column"):
        connection.execute(write(tree).content.decode())


def test_every_number_reaches_sqlite_with_its_bits() -> None:
    chance = random.Random(0)
    connection = sqlite3.connect(":memory:")
    for value in [0.1, -2.0625, 5e-324, 1.797693134862315e308, 1e300, 3e-310] + [
        chance.uniform(-1, 1) * 10.0 ** chance.randint(-300, 300) for _ in range(200)
    ]:
        rules = _one_cut(value)
        found = connection.execute(
            write(rules, table="cuts").content.decode().replace("FROM cuts", _FROM),
            (math.nextafter(value, -math.inf), value, math.nextafter(value, math.inf)),
        ).fetchall()
        assert sorted(row[2] for row in found) == [1, 1, 2]


_FROM = "FROM (SELECT ? AS x UNION ALL SELECT ? UNION ALL SELECT ?)"


def _one_cut(cut: float) -> RuleBase:
    low, high = Term("low", Band(high=cut)), Term("high", Band(low=cut))
    rules = tuple(Rule((Proposition("x", (n,)),), n) for n in ("low", "high"))
    return RuleBase("cut", ("low", "high"), (Variable("x", (low, high)),), rules)


def test_odd_names_are_quoted_and_comments_stay_comments() -> None:
    name = 'a`b" -- ]; DROP TABLE data'
    variable = Variable(name, (Term("t' 1", Band(high=1.0)),))
    rules = RuleBase(
        "n */ ;", ("c",), (variable,), (Rule((Proposition(name, ("t' 1",)),), "c"),)
    )
    text = write(rules).content.decode()
    connection = sqlite3.connect(":memory:")
    quoted = name.replace("`", "``")
    connection.execute(f"CREATE TABLE data (`{quoted}`)")
    connection.execute("INSERT INTO data VALUES (0.5)")
    assert connection.execute(text).fetchall() == [(0.5, "c", 1, 0)]


def test_a_rule_base_without_inputs_answers_each_row() -> None:
    rules = RuleBase("always", ("c",), (), (Rule((), "c"),))
    connection = sqlite3.connect(":memory:")
    connection.execute("CREATE TABLE data (x)")
    connection.execute("INSERT INTO data VALUES (1), (2)")
    found = connection.execute(write(rules).content.decode()).fetchall()
    assert found == [("c", 1, 0)] * 2


def test_the_same_model_gives_the_same_bytes() -> None:
    for dialect in ("sqlite", "duckdb", "postgresql", "spark"):
        one = write(rules_from_tree(random_tree(5)), dialect=dialect)
        assert one == write(rules_from_tree(random_tree(5)), dialect=dialect)


def test_what_engines_do_not_hold_is_refused() -> None:
    terms = tuple(Term(f"to {k}", Band(high=k, right=k + 1.0)) for k in range(2_000))
    rules = tuple(Rule((Proposition("x", (one.name,)),), "c") for one in terms)
    many = RuleBase("many", ("c",), (Variable("x", terms),), rules)
    with pytest.raises(LossError) as refused:
        write(many)
    assert str(refused.value) == (
        "cannot write many as sql for sqlite: a step of it has 2003 columns, and "
        "SQLite takes 2000; take fewer samples or rules, or write C, JavaScript or "
        "Python"
    )
    assert len(write(many, dialect="duckdb").content) > 100_000


def fan(samples: int) -> FuzzySystem:
    """Return a system of one output, whose curve is looked at so many times."""
    ends = (0.0, 10.0)
    terms = (
        Term("low", Points(ends, (1.0, 0.0))),
        Term("middle", Points((0.0, 5.0, 10.0), (0.0, 1.0, 0.0))),
        Term("high", Points(ends, (0.0, 1.0))),
    )
    output = SystemOutput(
        "speed", terms, *ends, Defuzzifier("centroid", samples), "maximum"
    )
    rules = tuple(
        SystemRule(Proposition("heat", (one.name,)), (Conclusion("speed", one.name),))
        for one in terms
    )
    return FuzzySystem(
        "fan",
        (Variable("heat", terms),),
        (output,),
        (RuleBlock(rules, implication="minimum"),),
    )


def test_a_system_gives_its_outputs_and_the_status_and_its_activations() -> None:
    connection = sqlite3.connect(":memory:")
    connection.execute("CREATE TABLE data (heat)")
    connection.execute("INSERT INTO data VALUES (2.5), (NULL), (1e300), ('warm')")
    cursor = connection.execute(write(fan(100), strengths=True).content.decode())
    names = ["heat", "speed", "status", *(f"activation_{k}" for k in (1, 2, 3))]
    assert [column[0] for column in cursor.description] == names
    rows = [[*row[1:]] for row in cursor]
    right = infer(fan(100), {"heat": 2.5})
    assert rows[0] == [right.outputs[0], 0, 0.75, 0.5, 0.25]
    assert rows[1] == rows[3] == [None, 3, *[None] * 3]
    assert rows[2][1] == 0


def test_too_many_samples_are_refused_with_the_number_that_is_needed() -> None:
    with pytest.raises(LossError) as refused:
        write(fan(2_500))
    assert str(refused.value) == (
        "cannot write fan as sql for sqlite: a step of it has 2502 columns, and SQLite "
        "takes 2000; take fewer samples or rules, or write C, JavaScript or Python"
    )
    assert write(fan(1_900)).content
    with pytest.raises(
        LossError, match="1702 columns, and PostgreSQL takes 1664; take"
    ):
        write(fan(1_700), dialect="postgresql")
    assert write(fan(2_500), dialect="duckdb").content


def test_a_query_that_is_too_long_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("sqlglot")
    monkeypatch.setitem(LIMITS, "clickhouse", Limit("ClickHouse", length=5_000))
    with pytest.raises(
        LossError, match="bytes, and ClickHouse takes 5,000; take fewer"
    ):
        write(fan(20), dialect="clickhouse")


@pytest.mark.parametrize(
    "dialect", ["bigquery", "snowflake", "tsql", "clickhouse", "trino"]
)
def test_translated_dialects_are_marked_and_parsed(dialect: Dialect) -> None:
    sqlglot = pytest.importorskip("sqlglot")
    rules = rules_from_tree(random_tree(2))
    for model in (random_tree(2), rules, random_system(2), fan(20)):
        written = write(model, dialect=dialect, keep=["row"])
        text = written.content.decode()
        assert "-- Not executed by fuzzytree: sqlglot translated" in text
        assert "did not execute it" in written.remarks[0]
        (query,) = sqlglot.parse(text, read=dialect)
        names = [one.alias_or_name for one in query.selects]
        shown = (
            [one.name for one in model.outputs]
            if isinstance(model, FuzzySystem)
            else ["class", "rule"]
        )
        assert names == ["row", *shown, "status"]


def test_a_wrong_option_is_a_sentence() -> None:
    with pytest.raises(ValueError, match="no dialect 'oracle'; there is sqlite, "):
        write(random_tree(0), dialect="oracle")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="table: must name a table or a view, not ''"):
        write(random_tree(0), table="")
    with pytest.raises(ValueError, match="a tree has no strengths"):
        write(random_tree(0), strengths=True)
