"""The second pass counts every row of a table in parts in the leaf that predicts it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import fuzzytree as ft
from fuzzytree.errors import ReadError, TableError
from fuzzytree.learning import COUNTS_MAGIC, open_state, state_content
from fuzzytree.model import FuzzyTree, fingerprint

ROWS = 1_500


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    """Return a table with three classes that overlap."""
    random = np.random.default_rng(3)
    codes = random.integers(0, 3, ROWS)
    values = random.normal(size=(ROWS, 3)) + codes[:, None] * [1.5, 0.8, 0.0]
    rows = pd.DataFrame(values, columns=["a", "b", "c"])
    rows["kind"] = np.array(["soft", "firm", "hard"])[codes]
    return rows


@pytest.fixture(scope="module")
def tree(table: pd.DataFrame) -> FuzzyTree:
    """Return a tree whose supports are estimated."""
    return ft.learn(
        table,
        target="kind",
        settings=ft.LearningSettings(rows_per_class=40, missing="drop"),
    )


def counts_of(tree: FuzzyTree, rows: pd.DataFrame) -> ft.LeafCounts:
    """Return the counts of some rows."""
    counts = ft.LeafCounts(tree, "kind")
    counts.update(rows)
    return counts


@pytest.mark.parametrize("count", [1, 7])
def test_parts_give_the_supports_and_the_confusion_of_all_rows(
    count: int, table: pd.DataFrame, tree: FuzzyTree, tmp_path: Path
) -> None:
    order = np.random.default_rng(count).permutation(count)
    merged = ft.LeafCounts(tree, "kind")
    for part in order.tolist():
        counts_of(tree, table.iloc[part::count]).save(tmp_path / "p.state")
        merged = merged.merge(ft.LeafCounts.load(tmp_path / "p.state", tree))
    found = ft.run(tree, table)
    result = merged.learn()
    expected = np.bincount(found.rule, minlength=len(tree.leaves) + 1)[1:]
    assert [leaf.support for leaf in result.leaves] == expected.tolist()
    assert fingerprint(result) != fingerprint(tree)
    crossed = pd.crosstab(table["kind"], np.array(found.classes))
    assert merged.confusion() == {
        kind: {name: n for name, n in row.items() if n}
        for kind, row in crossed.to_dict("index").items()
    }
    right = float(np.mean(np.array(found.classes) == table["kind"]))
    assert merged.accuracy() == pytest.approx(right, abs=1e-15)
    assert merged.rows == ROWS


@pytest.mark.heavy
def test_supports_that_are_exact_already_stay(table: pd.DataFrame) -> None:
    tree = ft.learn(table, target="kind")
    assert fingerprint(counts_of(tree, table).learn()) == fingerprint(tree)


def test_rows_count_as_they_are_predicted(table: pd.DataFrame, tree: FuzzyTree) -> None:
    rows = table.copy()
    rows.loc[:9, tree.inputs[0]] = np.nan
    rows.loc[20:24, "kind"] = None
    rows.loc[30, "kind"] = "new"
    facts = counts_of(tree, rows).facts()
    found = ft.run(tree, rows.drop(index=range(20, 25)))
    assert facts["rows"] == ROWS - 5
    assert facts["rows_without_class"] == 5
    assert [facts["ties"], facts["no_rule"], facts["missing"]] == [
        found.count(status) for status in (1, 2, 3)
    ]
    assert facts["missing"] == 10
    assert facts["classes"] == 4
    confusion = counts_of(tree, rows).confusion()
    assert sum(confusion["new"].values()) == 1
    assert sum(row.get("", 0) for row in confusion.values()) == 10


def test_files_are_counted_piece_by_piece(
    table: pd.DataFrame,
    tree: FuzzyTree,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("fuzzytree.tables.PIECE", 100)
    table.to_csv(tmp_path / "t.csv", index=False)
    table.to_parquet(tmp_path / "t.parquet", index=False)
    expected = counts_of(tree, table)
    for name in ("t.csv", "t.parquet"):
        counts = ft.LeafCounts(tree, "kind")
        texts: list[str] = []
        counts.update(tmp_path / name, progress=lambda text, _: texts.append(text))  # noqa: B023
        assert counts.learn() == expected.learn()
        assert counts.confusion() == expected.confusion()
        assert f": {ROWS:,} rows, " in texts[-1]


def test_a_part_with_a_fault_leaves_the_counts_as_they_were(
    table: pd.DataFrame, tree: FuzzyTree
) -> None:
    counts = counts_of(tree, table)
    with pytest.raises(TableError, match=r"^part 3 has no column 'a', which the model"):
        counts.update(table.drop(columns="a"), name="part 3")
    with pytest.raises(TableError, match=r"^part 4 has no column 'kind'; it has a, b"):
        counts.update(table.drop(columns="kind"), name="part 4")
    text = r"^part 5, row 1: column '\w' holds text where a number is needed: 'x'"
    with pytest.raises(TableError, match=text):
        counts.update(table.assign(a="x", b="x", c="x"), name="part 5")
    assert counts.rows == ROWS


@pytest.mark.heavy
def test_counts_of_another_model_target_or_part_are_refused(
    table: pd.DataFrame, tree: FuzzyTree, tmp_path: Path
) -> None:
    path = tmp_path / "a.state"
    counts_of(tree, table).save(path)
    other = ft.learn(table, target="kind", name="other")
    with pytest.raises(ReadError) as caught:
        ft.LeafCounts.load(path, other)
    assert str(caught.value) == (
        f"{path}: counts the leaves of another model, with the fingerprint "
        f"{fingerprint(tree)[:12]}, and other has {fingerprint(other)[:12]}"
    )
    loaded = ft.LeafCounts.load(path, tree)
    with pytest.raises(ValueError, match="is part of both"):
        loaded.merge(loaded)
    assert loaded.merge(loaded, repeated=True).rows == 2 * ROWS
    with pytest.raises(ValueError, match="another target: kind, and type"):
        loaded.merge(ft.LeafCounts(tree, "type"))
    with pytest.raises(ValueError, match="of another model, with the fingerprint"):
        loaded.merge(ft.LeafCounts(other, "kind"))
    with pytest.raises(ReadError, match="is no tree, whose leaves have supports"):
        ft.LeafCounts(ft.rules_from_tree(tree), "kind")


def test_states_of_the_first_pass_are_refused_in_the_second(
    table: pd.DataFrame, tree: FuzzyTree, tmp_path: Path
) -> None:
    learner = ft.Learner("kind")
    learner.update(table)
    learner.save(tmp_path / "a.state")
    needed = "a.state: is a state of `fuzzytree collect`, and one of `fuzzytree collect"
    with pytest.raises(ReadError, match=f"{needed} --for` is needed"):
        ft.LeafCounts.load(tmp_path / "a.state", tree)
    counts_of(tree, table).save(tmp_path / "b.state")
    with pytest.raises(ReadError, match=r"--for`, and one of `fuzzytree collect` is"):
        ft.Learner.load(tmp_path / "b.state")


def test_a_file_that_is_cut_or_changed_is_refused(
    table: pd.DataFrame, tree: FuzzyTree, tmp_path: Path
) -> None:
    path, whole = tmp_path / "a.state", counts_of(tree, table)
    whole.save(path)
    content = path.read_bytes()
    header, arrays = open_state(content, COUNTS_MAGIC)
    ends, codes, counts = (
        arrays[name].astype(np.int64) for name in ("ends", "codes", "counts")
    )
    spoilt = [content[:size] for size in range(0, len(content), 101)]
    spoilt += [
        state_content(header, {**arrays, name: array})[0]
        for name, array in (
            ("ends", ends + len(tree.leaves)),
            ("codes", codes - 1),
            ("counts", counts * 0),
            ("counts", counts[:-1]),
            ("counts", counts.astype(np.float64)),
        )
    ]
    spoilt.append(state_content(header, {"ends": ends})[0])
    for one in spoilt:
        path.write_bytes(one)
        with pytest.raises(ReadError, match=r"^.*a\.state: (is|counts) [^\n]*$"):
            ft.LeafCounts.load(path, tree)


def test_numbers_of_any_type_are_counted_alike(tree: FuzzyTree) -> None:
    rows = pa.table({"a": [1, 2], "b": [1, 2], "c": [0, 0], "kind": ["soft", "hard"]})
    floats = rows.cast(
        pa.schema([(name, pa.float64()) for name in "abc"] + [("kind", pa.string())])
    )
    counts = [ft.LeafCounts(tree, "kind") for _ in range(2)]
    counts[0].update(rows)
    counts[1].update(floats)
    assert counts[0].confusion() == counts[1].confusion()
