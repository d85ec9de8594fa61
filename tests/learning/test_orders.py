"""Categories in combinations: their order, and who may enter."""

from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import fuzzytree as ft
from fuzzytree import FuzzyTreeClassifier, Learner
from fuzzytree.api.holdout import accuracy
from fuzzytree.learning import LearningSettings
from fuzzytree.learning.orders import category_orders
from fuzzytree.tables import read_table

LINES = ((0, 1, 2), (3, 4, 5), (6, 7, 8), (0, 3, 6), (1, 4, 7), (2, 5, 8))
DIAGONALS = ((0, 4, 8), (2, 4, 6))


def ends_of_tic_tac_toe() -> tuple[pd.DataFrame, np.ndarray]:
    """Return all boards where a game ends that x begins, and whether x has won."""
    boards: dict[tuple[str, ...], bool] = {}

    def play(board: tuple[str, ...], mover: str) -> None:
        lines = [{board[place] for place in line} for line in (*LINES, *DIAGONALS)]
        won = {mark for line in lines if len(line) == 1 for mark in line} - {"b"}
        if won or "b" not in board:
            boards[board] = "x" in won
            return
        for place in range(9):
            if board[place] == "b":
                moved = (*board[:place], mover, *board[place + 1 :])
                if moved not in seen:
                    seen.add(moved)
                    play(moved, "o" if mover == "x" else "x")

    seen: set[tuple[str, ...]] = set()
    play(("b",) * 9, "x")
    names = [f"{row}{column}" for row, column in product("abc", "123")]
    return pd.DataFrame(sorted(boards), columns=names), np.array(
        [boards[board] for board in sorted(boards)]
    )


def test_a_line_through_all_squares_tells_who_won_at_tic_tac_toe() -> None:
    boards, won = ends_of_tic_tac_toe()
    assert (len(won), won.sum()) == (958, 626)
    order = np.random.default_rng(0).permutation(len(won))
    train, test = order[:640], order[640:]
    model = FuzzyTreeClassifier().fit(boards.iloc[train], won[train])
    assert (model.predict(boards.iloc[test]) == won[test]).mean() > 0.97
    assert len(model.tree_.leaves) <= 3
    for variable in model.tree_.variables:
        assert variable.parts or variable.categories[1] == "b"


def test_neither_the_order_of_rows_nor_their_chunks_change_the_order() -> None:
    rng = np.random.default_rng(1)
    values = rng.integers(0, 5, (300, 3)).astype(float)
    values[rng.random((300, 3)) < 0.1] = np.nan
    codes = (np.nan_to_num(values, nan=2.0) @ [3, -2, 1] > 4).astype(np.int64)
    moved = rng.permutation(300)
    first = category_orders(values, codes, [5, 5, 5])
    other = category_orders(values[moved], codes[moved], [5, 5, 5])
    assert len(first) == 3
    for column, (order, adds) in first.items():
        assert (order.tolist(), adds) == (other[column][0].tolist(), other[column][1])


def test_the_order_is_that_of_what_categories_add_to_the_class() -> None:
    rng = np.random.default_rng(2)
    names = np.array(["grey", "red", "blue", "green"])
    kinds = rng.integers(0, 4, 600)
    size, age = rng.normal(size=(2, 600))
    frame = pd.DataFrame({"colour": names[kinds], "size": size, "age": age})
    labels = np.where(kinds + size + age > 1.5, "late", "early")
    tree = FuzzyTreeClassifier().fit(frame, labels).tree_
    [colour] = [v for v in tree.variables if v.name == "colour"]
    assert [*colour.categories] in ([*names], [*names[::-1]])
    assert [{p.input for p in v.parts} for v in tree.variables if v.parts] == [
        {"colour", "size", "age"}
    ]


def test_a_column_that_adds_what_chance_would_enters_no_combination() -> None:
    rng = np.random.default_rng(3)
    kinds = rng.integers(0, 12, (300, 8)).astype(float)
    found = category_orders(kinds, rng.integers(0, 2, 300), [12] * 8)
    assert sum(adds for _, adds in found.values()) <= 1


def test_missing_categories_are_nearer_to_the_begin_of_the_order() -> None:
    kinds = np.repeat([0.0, 1.0, 2.0, np.nan], 40)[:, np.newaxis]
    share = np.repeat([0.2, 0.5, 0.9, 0.95], 40)
    codes = (np.tile(np.arange(40), 4) < 40 * share).astype(np.int64)
    assert category_orders(kinds, codes, [3])[0][0].tolist() == [2, 1, 0]
    assert category_orders(kinds, 1 - codes, [3])[0][0].tolist() == [2, 1, 0]


def test_a_category_without_rows_stands_in_the_middle() -> None:
    kinds = np.repeat([0.0, 1.0, 3.0], 40)[:, np.newaxis]
    codes = np.repeat([0, 1, 0, 1], [40, 20, 20, 40])
    assert category_orders(kinds, codes, [4])[0][0].tolist() == [0, 1, 2, 3]


def test_a_table_without_rows_or_of_one_class_is_left_alone() -> None:
    assert not category_orders(np.empty((0, 1)), np.empty(0, np.int64), [3])
    order, adds = category_orders(np.array([[0.0], [1.0]]), np.zeros(2, np.int64), [3])[
        0
    ]
    assert (order.tolist(), adds) == ([0, 1, 2], False)


def test_very_many_columns_are_ordered_in_parts() -> None:
    rng = np.random.default_rng(4)
    kinds = rng.integers(0, 3, (2000, 400)).astype(float)
    codes = (kinds[:, 0] + kinds[:, 399] > 2).astype(np.int64)
    found = category_orders(kinds, codes, [3] * 400)
    assert [*found] == [*range(400)]
    for column in (0, 399):
        assert found[column][1]
        assert found[column][0].tolist() == [0, 1, 2]


def test_folds_predict_categories_in_the_order_of_each_tree() -> None:
    rng = np.random.default_rng(5)
    names = np.array(["c", "a", "d", "b"])
    kinds = rng.integers(0, 4, 200)
    frame = pd.DataFrame({"kind": names[kinds]})
    frame.loc[::17, "kind"] = None
    labels = np.where(frame["kind"].isin(["c", "a"]), "low", "high")
    found = accuracy(read_table(frame, target=labels), LearningSettings())
    assert found is not None
    assert found.mean == 1.0


def sizes() -> tuple[pd.DataFrame, np.ndarray]:
    """Return rows whose class depends on the order of their size, and the classes."""
    rng = np.random.default_rng(6)
    names = ["XL", "L", "M", "S", "XS"]
    places = rng.integers(0, 4, 200)  # no XS
    column = pd.Categorical.from_codes(places, names, ordered=True)
    return pd.DataFrame({"size": column}), np.where(places < 2, "big", "small")


def test_ordered_categories_keep_their_order_and_are_cut_like_numbers() -> None:
    frame, labels = sizes()
    mixed = np.where(frame["size"].isin(["L", "M"]), "inner", "outer")
    for classes, shown in ((labels, ["XL or L", "M or S or XS"]), (mixed, None)):
        tree = FuzzyTreeClassifier().fit(frame, classes).tree_
        assert tree.variables[0].categories == ("XL", "L", "M", "S", "XS")
        terms = [term.name for term in tree.variables[0].terms]
        assert terms == (shown or ["XL", "L or M", "S or XS"])


@pytest.mark.parametrize("kind", ["pandas", "arrow", "parquet", "state"])
def test_the_order_of_categories_comes_with_each_kind_of_table(
    kind: str, tmp_path: Path
) -> None:
    frame, labels = sizes()
    frame["kind"] = labels
    source: object = frame
    if kind == "arrow":
        source = pa.Table.from_pandas(frame)
    elif kind == "parquet":
        source = tmp_path / "rows.parquet"
        frame.to_parquet(source)
    if kind == "state":
        halves = [Learner("kind"), Learner("kind")]
        for half, rows in zip(halves, (frame[:90], frame[90:]), strict=True):
            half.update(rows)
        tree = Learner.from_bytes(halves[1].merge(halves[0]).to_bytes()).learn()
    else:
        tree = ft.learn(source, target="kind")
    assert tree.variables[0].categories == ("XL", "L", "M", "S", "XS")


def test_parts_that_differ_in_the_order_have_none_whatever_the_order_of_parts() -> None:
    frame, labels = sizes()
    frame["kind"] = labels
    other, plain = frame.copy(), frame.copy()
    other["size"] = other["size"].cat.reorder_categories([*"SML", "XL", "XS"])
    plain["size"] = plain["size"].astype(str)
    empty = frame[:1].assign(size=None)
    trees = []
    for parts in ((frame, other, empty), (empty, other, frame), (frame, plain, frame)):
        learner = Learner("kind")
        for part in parts:
            learner.update(part)
        trees.append(learner.learn())
        assert {*trees[-1].variables[0].categories} == {"XL", "L", "M", "S"}
    assert trees[0] == trees[1]
