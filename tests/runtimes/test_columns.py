"""Categories and stand-ins: a missing value is a point of the input space."""

from __future__ import annotations

import math
import sqlite3
from pathlib import Path
from typing import Any, Literal

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.errors import InvalidModelError
from fuzzytree.exporters import sql, yaml
from fuzzytree.formats import read_yaml
from fuzzytree.model import FuzzyTree, Part, RuleBase, Variable, fingerprint
from fuzzytree.numerics import decide, exact_answer, strength_bounds
from fuzzytree.runtimes import native
from fuzzytree.semantics import (
    descend,
    evaluate,
    evaluate_program,
    from_rules,
    rules_from_tree,
)
from fuzzytree.semantics.samples import everyday_tree

ROWS = np.array([[0.0, 2.0, math.nan, 1.0], [3.0, math.nan, 1.0, math.inf]])


@pytest.fixture
def tree() -> FuzzyTree:
    return everyday_tree()


def test_yaml_gives_back_categories_and_stand_ins(tree: FuzzyTree) -> None:
    text = yaml.write(tree).content
    assert b"categories: [Biscoe, Dream, Torgersen]" in text
    assert read_yaml(text, "penguins.yaml").model == tree


def test_tree_and_rules_answer_rows_with_missing_values(tree: FuzzyTree) -> None:
    rules = rules_from_tree(tree)
    for row in ROWS.T.tolist():
        named = dict(zip(tree.inputs, row, strict=True))
        one, other = descend(tree, named), evaluate(rules, named)
        assert (one.label, one.rule) == (other.label, other.rule)
        assert one.rule > 0
        assert exact_answer(tree, named).label == one.label


def test_native_runtimes_replace_missing_values(tree: FuzzyTree) -> None:
    rules = rules_from_tree(tree)
    expected = [
        descend(tree, dict(zip(tree.inputs, row, strict=True))).rule
        for row in ROWS.T.tolist()
    ]
    for model in (tree, rules):
        run = native.load(model)
        assert run(ROWS).rule.tolist() == expected
        one = [run(ROWS[:, [k]]).rule[0] for k in range(ROWS.shape[1])]
        assert one == expected
        assert decide(model, ROWS).rule.tolist() == expected
    program = from_rules(rules)
    bounds, _ = strength_bounds(rules, "float32", ROWS)
    assert (bounds < 1e-3).all()
    for row, rule in zip(ROWS.T.tolist(), expected, strict=True):
        named = dict(zip(rules.inputs, row, strict=True))
        assert evaluate_program(program, named).of("rule") == (rule,)


def test_fingerprints_of_plain_models_are_as_before() -> None:
    plain = Variable("x")
    assert fingerprint(plain) != fingerprint(replace(plain, missing=0.0))


@pytest.mark.parametrize(
    ("variable", "text"),
    [
        (Variable("a", categories=("x", "x")), "category of 'a' 'x' stands twice"),
        (
            Variable("a", missing=math.inf),
            "what stands for a missing 'a' must be finite",
        ),
        (
            Variable("a", categories=("x", "y"), missing=2.0),
            "what stands for a missing 'a' is -1 or the position of a category, "
            "up to 1, not 2.0",
        ),
    ],
)
def test_wrong_columns_are_refused(variable: Variable, text: str) -> None:
    with pytest.raises(InvalidModelError) as caught:
        RuleBase("r", ("k",), (variable,), ())
    assert text in str(caught.value)


def test_a_sum_has_no_categories() -> None:
    mixed = Variable("s", parts=(Part("a", 1.0),), missing=1.0)
    with pytest.raises(InvalidModelError, match="only an input has categories"):
        RuleBase("r", ("k",), (Variable("a"), mixed), ())


def test_an_onnx_file_and_engines_take_the_texts_of_a_table(tmp_path: Path) -> None:
    table = pd.DataFrame(
        {"island": ["Biscoe", " Dream", "Mars", None], "bill": [1.0, 3.0, 1.0, None]}
    )
    tree = everyday_tree()
    expected = ["Adelie", "Gentoo", "Adelie", "Adelie"]
    assert ft.run(tree, table).classes == expected
    (tmp_path / "p.onnx").write_bytes(ft.export(tree, "onnx").content)
    found_by_onnx = ft.run(tmp_path / "p.onnx", table)
    assert isinstance(found_by_onnx, ft.Predictions)
    assert found_by_onnx.classes == expected
    table.to_csv(tmp_path / "t.csv", index=False)
    assert ft.run(rules_from_tree(tree), tmp_path / "t.csv").classes == expected
    assert ft.predict(duckdb.from_df(table), tree).df()["class"].tolist() == expected
    lazy = ft.predict(pl.from_pandas(table).lazy(), tree).collect()
    assert lazy["class"].to_list() == expected


@pytest.mark.parametrize("dialect", ["duckdb", "sqlite"])
def test_sql_compares_texts(dialect: Literal["duckdb", "sqlite"]) -> None:
    cells = [("Biscoe", 1.0), ("Dream", 3.0), ("Mars", 1.0), (None, None)]
    query = sql.write(everyday_tree(), dialect=dialect, table="t").content.decode()
    is_duckdb = dialect == "duckdb"
    rows: Any = duckdb.connect() if is_duckdb else sqlite3.connect(":memory:")
    rows.execute("CREATE TABLE t (island VARCHAR, bill DOUBLE)")
    rows.executemany("INSERT INTO t VALUES (?, ?)", cells)
    found = [row[2] for row in rows.execute(query).fetchall()]
    assert found == ["Adelie", "Gentoo", "Adelie", "Adelie"]


def test_every_representation_agrees_on_missing_and_unknown_cells() -> None:
    rows = pd.DataFrame({"island": ["Biscoe", "Mars", None], "bill": [None, 3.0, 9.0]})
    report = ft.check(everyday_tree(), data=rows)
    assert report.ok
    examined = {one.representation for one in report.comparisons}
    assert {"c", "native", "onnxruntime"} <= {one.split()[0] for one in examined}
