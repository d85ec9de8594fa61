"""A table in parts gives the tree of the whole table, whatever the parts."""

from __future__ import annotations

import json
from pathlib import Path

import msgspec
import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import fuzzytree as ft
from fuzzytree.errors import LearningError, ReadError, TableError
from fuzzytree.learning import Learner, parts
from fuzzytree.model import fingerprint

ROWS = 2_000


def rows_of(seed: int = 0) -> pd.DataFrame:
    """Return a table with three classes, a missing cell and a row without a class."""
    random = np.random.default_rng(seed)
    codes = random.integers(0, 3, ROWS)
    means = codes[:, None] * np.array([2.0, 1e-9, 1e12, 0.0])
    values = (random.normal(size=(ROWS, 4)) + means) * [1.0, 1e-9, 1e12, 1.0]
    table = pd.DataFrame(values, columns=["a", "b", "c", "d"])
    table["kind"] = np.array(["soft", "firm", "hard"])[codes]
    table.loc[7, "b"] = np.nan
    table.loc[11, "kind"] = None
    return table


def learner_of(table: pd.DataFrame, rows_per_class: int = 5_000) -> Learner:
    """Return a learner that has taken a table."""
    settings = ft.LearningSettings(rows_per_class=rows_per_class)
    learner = Learner("kind", settings=settings)
    learner.update(table)
    return learner


@pytest.mark.parametrize("rows_per_class", [5_000, 50])
@pytest.mark.parametrize("count", [1, 7, 64])
def test_parts_in_any_order_give_the_tree_of_the_whole_table(
    count: int, rows_per_class: int, tmp_path: Path
) -> None:
    table = rows_of()
    settings = ft.LearningSettings(rows_per_class=rows_per_class)
    expected = fingerprint(ft.learn(table, target="kind", settings=settings))
    order = np.random.default_rng(count).permutation(count)
    merged: Learner | None = None
    for part in order.tolist():
        learner_of(table.iloc[part::count], rows_per_class).save(tmp_path / "p.state")
        loaded = Learner.load(tmp_path / "p.state", settings=settings)
        merged = loaded if merged is None else loaded.merge(merged)
    assert merged is not None
    assert fingerprint(merged.learn()) == expected
    counts = (merged.rows, merged.dropped, merged.unlabelled, merged.missing)
    assert counts == (ROWS - 1, 1, 1, 1)


def test_a_class_that_one_part_alone_has_is_learnt() -> None:
    table = rows_of()
    parts = [learner_of(part) for _, part in table.groupby("kind")]
    merged = parts[2].merge(parts[0]).merge(parts[1])
    whole = table.dropna(subset="kind")
    assert fingerprint(merged.learn()) == fingerprint(ft.learn(whole, target="kind"))


@pytest.mark.parametrize(
    "labels",
    [
        [["1", "2"], ["2", "3"]],
        [[1, 2], [2, 3]],
        [[1, 2], [2.0, 3.0]],
        [[1.0, 2.0], [2.5, 3.0]],
        [[True, False], [False, True]],
        [["x", "10"], ["9", "x"]],
    ],
    ids=str,
)
def test_labels_have_the_names_and_types_that_the_whole_table_gives(
    labels: list[list[object]],
) -> None:
    parts: list[pd.DataFrame] = []
    for number, pair in enumerate(labels):
        values = np.arange(20.0) + 7.0 * number
        cells = [pair[int(value) % 2] for value in values]
        parts.append(pd.DataFrame({"x": values, "kind": cells}))
    whole = pd.concat(parts)
    expected = ft.learn(whole, target="kind")
    found = learner_of(parts[1]).merge(learner_of(parts[0])).learn()
    assert found.classes == expected.classes
    assert found.semantics.label_type == expected.semantics.label_type
    assert fingerprint(found) == fingerprint(expected)


def test_files_are_read_piece_by_piece_with_the_same_tree(tmp_path: Path) -> None:
    table = pd.concat([rows_of(seed) for seed in range(10)])
    table.to_csv(tmp_path / "t.csv", index=False)
    table.to_parquet(tmp_path / "t.parquet", index=False)
    expected = fingerprint(ft.learn(str(tmp_path / "t.csv"), target="kind", name="t"))
    for name in ("t.csv", "t.parquet"):
        learner = Learner("kind", name="t")
        learner.update(tmp_path / name)
        assert fingerprint(learner.learn()) == expected


def test_columns_are_found_by_name_in_each_batch() -> None:
    table = rows_of()
    learner = learner_of(table.iloc[:1000])
    learner.update(table.iloc[1000:][["kind", "d", "b", "a", "c"]])
    assert fingerprint(learner.learn()) == fingerprint(ft.learn(table, target="kind"))


@pytest.mark.parametrize(
    "kind", [pa.int8(), pa.uint64(), pa.float32(), pa.bool_(), pa.decimal128(5, 2)]
)
def test_parts_may_have_numbers_of_other_types(kind: pa.DataType) -> None:
    values = pa.array([0.0, 1.0] * 20)
    labels = pa.array(["soft", "firm"] * 20)
    floats = pa.table({"a": values, "b": values, "kind": labels})
    numbers = pa.array([False, True] * 20) if kind == pa.bool_() else values.cast(kind)
    others = pa.table({"kind": labels, "b": values, "a": numbers})
    parts = Learner("kind")
    parts.update(floats)
    parts.update(others)
    whole = pa.concat_tables([floats, floats])
    assert fingerprint(parts.learn()) == fingerprint(ft.learn(whole, target="kind"))


def test_a_state_is_no_part(tmp_path: Path) -> None:
    learner_of(rows_of()).save(tmp_path / "a.state")
    with pytest.raises(
        TableError, match=r"a\.state is a state that `fuzzytree collect`"
    ):
        Learner("kind").update(tmp_path / "a.state")


def test_a_part_with_a_fault_leaves_the_learner_as_it_was() -> None:
    table = rows_of()
    learner = learner_of(table.iloc[:1000])
    before = learner.learn()
    spoilt = table.iloc[1000:].astype({"c": object})
    spoilt.iloc[5, 2] = "heavy"
    other = learner_of(table.iloc[:1000])
    other.update(spoilt, name="part 17")  # other parts may be of text as well
    with pytest.raises(TableError, match=r"part 17, row 6: column 'c' holds text"):
        other.learn()
    with pytest.raises(TableError, match="part 18 has no column 'd'"):
        learner.update(table.drop(columns="d"), name="part 18")
    assert learner.learn() == before


def test_an_empty_part_changes_nothing() -> None:
    table = rows_of()
    learner = learner_of(table)
    expected = fingerprint(learner.learn())
    learner.update(table.iloc[:0])
    assert fingerprint(learner.learn()) == expected
    assert fingerprint(learner_of(table.iloc[:0]).merge(learner).learn()) == expected


def test_a_learner_without_rows_changes_no_byte_of_a_state() -> None:
    table = rows_of()
    learner = learner_of(table, rows_per_class=50)
    merged = learner_of(table.iloc[:0], rows_per_class=50).merge(learner)
    assert merged.to_bytes() == learner.to_bytes()


@pytest.mark.one_in(2)
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_any_number_of_threads_gives_the_same_tree(suffix: str, tmp_path: Path) -> None:
    table = pd.concat([rows_of(seed) for seed in range(30)])
    path = tmp_path / f"t.{suffix}"
    if suffix == "csv":
        table.to_csv(path, index=False)
    else:
        table.to_parquet(path, index=False)
    settings = ft.LearningSettings(rows_per_class=50)
    expected = fingerprint(ft.learn(table, target="kind", settings=settings))
    for threads in (1, 2, 7):
        learner = Learner("kind", settings=settings)
        learner.update(path, threads=threads)
        assert learner.rows == 30 * (ROWS - 1)
        assert fingerprint(learner.learn()) == expected


def test_a_saved_state_counts_once_unless_it_may_count_twice(tmp_path: Path) -> None:
    table = rows_of()
    digest = learner_of(table.iloc[:900]).save(tmp_path / "a.state")
    learner_of(table.iloc[900:]).save(tmp_path / "b.state")
    one, other = (Learner.load(tmp_path / f"{name}.state") for name in "ab")
    both = one.merge(other)
    both.save(tmp_path / "ab.state")
    with pytest.raises(ValueError, match=f"digest {digest[:12]} is part of both"):
        Learner.load(tmp_path / "ab.state").merge(one)
    assert both.merge(one, repeated=True).rows == both.rows + one.rows


def test_states_of_other_tables_do_not_merge() -> None:
    table = rows_of()
    one = learner_of(table)
    with pytest.raises(ValueError, match="order: a, b, c, d, and d, b, a, c; name"):
        one.merge(learner_of(table.reindex(columns=["kind", "d", "b", "a", "c"])))
    with pytest.raises(ValueError, match="other columns: only one of them has d"):
        one.merge(learner_of(table.drop(columns="d")))
    with pytest.raises(ValueError, match="another number of rows per class: 5000, and"):
        one.merge(learner_of(table, 50))
    with pytest.raises(ValueError, match="another target: kind, and type"):
        one.merge(Learner("type"))


def test_missing_values_are_refused_where_they_may_not_be() -> None:
    settings = ft.LearningSettings(missing="refuse")
    learner = Learner("kind", settings=settings)
    with pytest.raises(LearningError, match="part 3: 1 of 2000 rows hold a missing"):
        learner.update(rows_of(), name="part 3")
    assert learner.rows == 0


def test_a_record_batch_is_a_part() -> None:
    table = rows_of()
    learner = Learner("kind")
    for batch in pa.Table.from_pandas(table).to_batches(max_chunksize=700):
        learner.update(batch)
    assert fingerprint(learner.learn()) == fingerprint(learner_of(table).learn())


def test_what_was_not_collected_is_not_learnt() -> None:
    with pytest.raises(LearningError, match="before a part of the table was taken"):
        Learner("kind").learn()
    learner = Learner("kind", units={"z": "N"})
    learner.update(rows_of())
    with pytest.raises(LearningError, match="unit for 'z', which is no column"):
        learner.learn()


def test_a_file_that_is_cut_or_changed_is_refused(tmp_path: Path) -> None:
    path, whole = tmp_path / "a.state", learner_of(rows_of().iloc[:200])
    whole.save(path)
    content = path.read_bytes()
    random = np.random.default_rng(0)
    cuts = [content[:size] for size in random.integers(0, len(content), 10)]
    changed: list[bytes] = []
    for place in random.integers(0, len(content), 25).tolist():
        new = bytes([content[place] ^ int(random.integers(1, 256))])
        changed.append(content[:place] + new + content[place + 1 :])
    messages: list[str] = []
    for spoilt in [b"", b"kind,a\n", *cuts, *changed]:
        path.write_bytes(spoilt)
        try:
            loaded = Learner.load(path)
        except ReadError as error:
            messages.append(str(error))
        else:  # padding, which means nothing
            assert fingerprint(loaded.learn()) == fingerprint(whole.learn())
    assert len(messages) > 30
    assert all(one.startswith(f"{path}: ") and "\n" not in one for one in messages)


def rewritten(path: Path, change: dict[str, object], drop: str = "") -> None:
    """Write a state again with another header, and with a digest that fits."""
    header, arrays = parts.open_state(path.read_bytes(), parts.MAGIC)
    arrays = {name: array for name, array in arrays.items() if name != drop}
    header = msgspec.structs.replace(header, **change)
    path.write_bytes(parts.state_content(header, arrays)[0])


@pytest.mark.parametrize(
    ("change", "drop", "message"),
    [
        ({"magic": "fuzzytree state 4"}, "", "is 'fuzzytree state 4', and 'fuzzytree"),
        ({"magic": "fuzzytree leaf counts 1"}, "", "of `fuzzytree collect --for`, and"),
        ({"columns": ["a", "b", "c"]}, "", "has not the 9 numbers of type float64"),
        ({"columns": ["a", "a", "c", "d"]}, "", "names a column or a class twice"),
        ({"classes": ["x"], "floats": [False]}, "", "has not the 1 numbers of type"),
        ({"dropped": -1}, "", "counts a negative number of rows"),
        ({"columns": ["a"] * 10**6}, "", "names a column or a class twice"),
        ({}, "rows", "'rows' needs"),
        ({}, "squares", "'squares' needs"),
    ],
)
def test_a_state_with_a_fitting_digest_is_checked_all_the_same(
    change: dict[str, object], drop: str, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "a.state"
    learner_of(rows_of().iloc[:200]).save(path)
    rewritten(path, change, drop)
    with pytest.raises(ReadError) as caught:
        Learner.load(path)
    assert message in str(caught.value)


def test_a_state_grows_with_classes_and_columns_and_not_with_rows(
    tmp_path: Path,
) -> None:
    sizes: list[int] = []
    for rows in (2, 4):
        table = pd.concat([rows_of(seed) for seed in range(rows)])
        learner_of(table, rows_per_class=100).save(tmp_path / "a.state")
        sizes.append((tmp_path / "a.state").stat().st_size)
    assert abs(sizes[1] - sizes[0]) < 600


def test_the_header_says_what_was_collected(tmp_path: Path) -> None:
    path = tmp_path / "a.state"
    learner = learner_of(rows_of())
    digest = learner.save(path)
    with pa.ipc.open_file(str(path)) as file:
        header = json.loads(file.schema.metadata[b"fuzzytree"])
    assert header["digest"] == digest
    assert header["classes"] == ["soft", "firm", "hard"] or len(header["classes"]) == 3
    assert repr(learner) == "<Learner of 'kind': 1,999 rows, 4 columns, 3 classes>"
