"""Categories and stand-ins: a missing value is a point of the input space."""

from __future__ import annotations

import math
import sqlite3
from pathlib import Path
from typing import Any, Literal

import duckdb
import narwhals as nw
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.errors import InvalidModelError
from fuzzytree.exporters import sql, yaml
from fuzzytree.formats import read_yaml
from fuzzytree.model import (
    Band,
    Branch,
    FuzzyTree,
    Leaf,
    Node,
    Part,
    RuleBase,
    Term,
    Variable,
    fingerprint,
    leaf_paths,
)
from fuzzytree.numerics import decide, exact_answer, strength_bounds
from fuzzytree.runtimes import native
from fuzzytree.semantics import (
    descend,
    evaluate,
    evaluate_program,
    from_rules,
    rules_from_tree,
)

ROWS = np.array([[0.0, 2.0, math.nan, 1.0], [3.0, math.nan, 1.0, math.inf]])


def _everyday_tree() -> FuzzyTree:
    """Return a tree of a column of text, and one whose missing values have a place."""
    west = Term("Biscoe or Dream", Band(high=1.5, right=2.0))
    east = Term("Torgersen", Band(low=1.5, left=1.0))
    short = Term("low", Band(high=2.0, right=4.0))
    long = Term("high", Band(low=2.0, left=0.0))
    first = (Branch((west.name,), node=2), Branch((east.name,), leaf=3))
    second = (Branch(("low",), leaf=1), Branch(("high",), leaf=2))
    names = ("Biscoe", "Dream", "Torgersen")
    return FuzzyTree(
        "penguins",
        ("Adelie", "Gentoo"),
        (
            Variable(
                "island", (west, east), "", 0.0, 2.0, categories=names, missing=1.0
            ),
            Variable("bill", (short, long), "mm", 0.0, 5.0, missing=-1.0),
        ),
        (
            Node("island", (1.5,), (0, 1), first),
            Node("bill", (2.0,), (0, 1), second),
        ),
        (Leaf("Adelie"), Leaf("Gentoo"), Leaf("Adelie")),
    )


@pytest.fixture
def tree() -> FuzzyTree:
    return _everyday_tree()


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
    tree = _everyday_tree()
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


@pytest.mark.parametrize(
    ("kind", "cells"),
    [
        ("DOUBLE", [1.0, 2.5, 17.0, math.inf, math.nan, None]),
        ("DECIMAL(10, 2)", [1, 2.5, 0, None]),
        ("BOOLEAN", [True, False, None]),
        ("VARCHAR", ["1.0", " x", "017", "0.50", "true", "yes", "0", "", None]),
        ("ENUM ('1', 'true', 'x')", ["1", "true", "x", None]),
    ],
)
@pytest.mark.parametrize(
    "categories", [("False", "True"), ("0.5", "017", "1", "2.5", "True", "x")], ids=len
)
def test_a_query_finds_the_categories_that_run_finds(
    kind: str, cells: list[object], categories: tuple[str, ...]
) -> None:
    names = tuple(f"c{k}" for k in range(len(categories)))
    places = [k + 0.5 for k in range(len(categories) - 1)]
    edges = [None, *places, None]
    terms = tuple(
        Term(name, Band(low=low, high=high))
        for name, low, high in zip(names, edges[:-1], edges[1:], strict=True)
    )
    ways = tuple(Branch((name,), leaf=k) for k, name in enumerate(names, 1))
    tree = FuzzyTree(
        "t",
        names,
        (Variable("z", terms, categories=categories),),
        (Node("z", tuple(places), tuple(range(len(names))), ways),),
        tuple(map(Leaf, names)),
    )
    with duckdb.connect() as connection:
        connection.execute(f"CREATE TABLE t (z {kind})")
        connection.executemany("INSERT INTO t VALUES (?)", [[cell] for cell in cells])
        rows = connection.table("t")
        expected = ft.run(tree, rows.to_arrow_table()).rule.tolist()
        found = ft.predict(rows, tree).fetchall()
    assert [row[2] for row in found] == expected


@pytest.mark.parametrize("dialect", ["duckdb", "sqlite"])
def test_sql_compares_texts(dialect: Literal["duckdb", "sqlite"]) -> None:
    cells = [("Biscoe", 1.0), ("Dream", 3.0), ("Mars", 1.0), (None, None)]
    query = sql.write(_everyday_tree(), dialect=dialect, table="t").content.decode()
    is_duckdb = dialect == "duckdb"
    rows: Any = duckdb.connect() if is_duckdb else sqlite3.connect(":memory:")
    rows.execute("CREATE TABLE t (island VARCHAR, bill DOUBLE)")
    rows.executemany("INSERT INTO t VALUES (?, ?)", cells)
    found = [row[2] for row in rows.execute(query).fetchall()]
    assert found == ["Adelie", "Gentoo", "Adelie", "Adelie"]


def test_every_representation_agrees_on_missing_and_unknown_cells() -> None:
    rows = pd.DataFrame({"island": ["Biscoe", "Mars", None], "bill": [None, 3.0, 9.0]})
    report = ft.check(_everyday_tree(), data=rows)
    assert report.ok
    examined = {one.representation for one in report.comparisons}
    assert {"c", "native", "onnxruntime"} <= {one.split()[0] for one in examined}


# --- the same table in many containers


def _typed_table(seed: int) -> pd.DataFrame:
    """Return a table whose types say more than the look of its cells."""
    rng = np.random.default_rng(seed)
    zips, masses = rng.integers(0, 9, 60), rng.normal(size=60)
    masses[:6] = math.nan, math.inf, -math.inf, 1e300, 0.0, -0.0
    counts = [None if k % 11 == 0 else k for k in rng.integers(0, 50, 60).tolist()]
    flags = [None if k % 13 == 0 else k % 2 == 0 for k in counts if k is not None]
    flags += [None] * (60 - len(flags))
    is_even = (zips % 2 == 0) ^ (masses > 0.5)
    return pd.DataFrame(
        {
            "zip": pd.Categorical(zips, ordered=bool(seed % 2)),
            "code": pd.array(
                rng.choice(["7", "007", "1e1", "x"], 60).tolist(), "string"
            ),
            "flag": pd.array(flags, "boolean"),
            "count": pd.array(counts, "Int64"),
            "mass": masses,
            "kind": np.where(is_even, "even", "odd").tolist(),
        }
    )


def _containers(frame: pd.DataFrame, folder: Path) -> dict[str, Any]:
    """Return a table in everything that `learn` and `run` take."""
    texts = frame.astype({"zip": "str"})
    polars = pl.from_pandas(texts).with_columns(
        pl.col("zip").cast(pl.Enum([str(k) for k in range(9)]))
    )
    arrow = pa.Table.from_pandas(frame, preserve_index=False)
    pq.write_table(polars.to_arrow(), folder / "t.parquet")
    frame.to_csv(folder / "t.csv", index=False)
    objects = frame.astype(object).to_numpy()
    declared = ["zip", "code"]
    names = ", ".join(f"'{k}'" for k in range(9))
    relation = duckdb.from_arrow(pa.Table.from_pandas(texts)).project(
        f"zip::ENUM({names}) AS zip, * EXCLUDE zip"
    )
    return {
        "pandas": frame,
        "pandas of arrow": frame.convert_dtypes(dtype_backend="pyarrow"),
        "polars": polars,
        "lazy polars": polars.lazy(),
        "polars categories": polars.with_columns(pl.col("zip").cast(pl.Categorical)),
        "arrow": arrow,
        "batch": arrow.to_batches()[0],
        "parquet": folder / "t.parquet",
        "duckdb": relation,
        "csv": ft.table(folder / "t.csv", categorical=declared),
        "array": ft.table(objects, columns=[*frame.columns], categorical=declared),
    }


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.filterwarnings("ignore:.*has a category that occurs once")
def test_a_table_has_one_tree_and_one_answer_in_every_container(
    seed: int, tmp_path: Path
) -> None:
    frame = _typed_table(seed)
    tables = _containers(frame, tmp_path)
    few = ft.LearningSettings(columns_per_node=1, leaves=4)
    trees = {
        name: ft.learn(table, target="kind", name="t", settings=few)
        for name, table in tables.items()
    }
    states_order = {"pandas", "pandas of arrow", "arrow", "batch"} if seed else set()
    alike = [one for name, one in trees.items() if name not in states_order]
    stated = [one for name, one in trees.items() if name in states_order]
    for same in (alike, stated):
        assert all(one == same[0] for one in same)
    tree = alike[0]
    assert [*"012345678"] in [sorted(one.categories) for one in tree.variables]

    (tmp_path / "t.onnx").write_bytes(ft.export(tree, "onnx").content)
    expected = ft.run(tree, frame, with_probabilities=True)
    assert expected.probabilities is not None
    rules, classes = expected.rule.tolist(), expected.classes
    counts = ft.LeafCounts(tree, "kind")
    counts.update(frame)
    for name, table in tables.items():
        if name == "duckdb":
            assert ft.predict(tables[name], tree).fetchnumpy()["rule"].tolist() == rules
            continue
        for model in (tree, tmp_path / "t.onnx"):
            found = ft.run(model, table)
            assert isinstance(found, ft.Predictions)
            assert (found.rule.tolist(), found.classes) == (rules, classes), name
        others = ft.LeafCounts(tree, "kind")
        others.update(table)
        assert others.confusion() == counts.confusion(), name
    lazy = ft.predict(tables["lazy polars"], tree).collect()
    assert lazy["rule"].to_list() == rules

    for name in ("pandas", "pandas of arrow", "polars", "arrow"):
        cells = nw.from_native(tables[name], eager_only=True).drop("kind").to_native()
        model = ft.FuzzyTreeClassifier(columns_per_node=1, leaves=4).fit(
            cells, frame["kind"]
        )
        assert model.tree_ == replace(trees[name], name="tree"), name
        answers = ft.run(trees[name], tables[name], with_probabilities=True)
        assert isinstance(answers, ft.Predictions)
        assert model.predict(cells).tolist() == answers.classes
        paths = leaf_paths(trees[name])
        ends = [paths[rule - 1][-1] for rule in answers.rule.tolist()]
        assert model.apply(cells).tolist() == ends
        assert answers.probabilities is not None
        assert np.array_equal(model.predict_proba(cells).T, answers.probabilities)
        passed = model.decision_path(cells).toarray()
        assert passed[range(len(ends)), ends].all()
