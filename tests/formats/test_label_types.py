"""Predicted classes have the type of the labels that a model was learnt from."""

from __future__ import annotations

import csv
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from sklearn.tree import DecisionTreeClassifier

import fuzzytree as ft
from fuzzytree.errors import InvalidModelError, ReadError
from fuzzytree.model.rulebase import Semantics, label_of
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.tables import read_table
from fuzzytree.testing import random_tree

VALUES = np.repeat([0.0, 10.0, 20.0], 8)[:, None] + np.tile(np.arange(8.0), 3)[:, None]
LABELS: dict[str, Any] = {
    "integers": np.repeat([0, 1, 2], 8),
    "small integers": np.repeat([-7, 5, 100], 8).astype(np.int8),
    "booleans": np.repeat([True, False, True], 8),
    "whole floats": np.repeat([1.0, 2.0, 3.0], 8),
    "fractions": np.repeat([0.1, 1.0, 2.5], 8),
    "numpy integers in a list": [np.int64(k // 8) for k in range(24)],
    "objects": np.repeat(np.array([3, 1, 2], object), 8),
    "names": np.repeat(["soft", "firm", "hard"], 8),
    "digits as text": np.repeat(["0", "1", "2"], 8),
    "leading zeros": np.repeat(["00", "01", "1"], 8),
    "a nullable series": pd.Series(np.repeat([4, 5, 6], 8), dtype="Int64"),
    "categories": pd.Series(np.repeat([4, 5, 6], 8)).astype("category"),
}


@pytest.mark.one_in(6)
@pytest.mark.parametrize("kind", LABELS)
def test_predictions_equal_the_labels_wherever_the_model_is(
    kind: str, tmp_path: Path
) -> None:
    y = LABELS[kind]
    tree = ft.learn(VALUES, target=y, settings=ft.LearningSettings(columns_per_node=1))
    rules = ft.rules_from_tree(tree)
    ft.save(tree, tmp_path / "tree.yaml")
    ft.save(rules, tmp_path / "rules.fcl", allow_loss=True)
    models: list[Any] = [
        tree,
        rules,
        ft.load(tmp_path / "tree.yaml"),
        ft.load(tmp_path / "rules.fcl"),
        ft.export(tree, "onnx").content,
        ft.export(rules, "onnx").content,
        pickle.loads(pickle.dumps(tree)),
    ]
    for model in models:
        classes = ft.run(model, VALUES).classes
        assert (classes == np.asarray(y)).mean() == 1.0
        assert (np.array(classes) == np.asarray(y)).mean() == 1.0
        assert (pd.Series(classes) == pd.Series(np.asarray(y))).mean() == 1.0


@pytest.mark.parametrize("kind", ["integers", "booleans", "whole floats", "names"])
def test_the_tree_of_a_classifier_predicts_its_labels(kind: str) -> None:
    y = LABELS[kind]
    model = ft.FuzzyTreeClassifier(columns_per_node=1).fit(VALUES, y)
    assert (
        np.array(ft.run(model.tree_, VALUES).classes) == model.predict(VALUES)
    ).all()
    assert (model.predict(VALUES) == y).all()


def test_a_tree_of_scikit_learn_predicts_its_labels_but_for_given_names() -> None:
    grown = DecisionTreeClassifier().fit(VALUES, LABELS["integers"])
    assert ft.run(ft.from_sklearn(grown), VALUES).classes == [*LABELS["integers"]]
    named = ft.from_sklearn(grown, classes=["0", "1", "2"])
    assert ft.run(named, VALUES).classes == [*LABELS["digits as text"]]


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        (["0", "1", "2"], [0, 1, 2]),
        (["1.0", "2.5", "-3"], [1.0, 2.5, -3]),
        (["True", "False", "True"], [True, False, True]),
        (["00", "1", "2"], ["00", "1", "2"]),
        (["1", "2", "x"], ["1", "2", "x"]),
        (["1.50", "2", "3"], ["1.50", "2", "3"]),
    ],
)
@pytest.mark.parametrize("has_quotes", [False, True])
def test_numbers_of_a_csv_file_are_numbers_where_python_writes_them_so(
    tmp_path: Path, labels: list[str], expected: list[object], has_quotes: bool
) -> None:
    path = tmp_path / "t.csv"
    with path.open("w", encoding="utf-8", newline="") as file:
        how: Any = csv.QUOTE_ALL if has_quotes else csv.QUOTE_MINIMAL
        writer = csv.writer(file, quoting=how)
        writer.writerow(["a", "y"])
        names = np.repeat(labels, 8).tolist()
        writer.writerows(zip(VALUES[:, 0], names, strict=True))
    tree = ft.learn(path, target="y", settings=ft.LearningSettings(columns_per_node=1))
    found = ft.run(tree, path)
    assert found.classes == np.repeat(np.array(expected, object), 8).tolist()
    assert [*map(type, found.classes)] == [type(e) for e in expected for _ in range(8)]
    assert found.names == names


def test_text_of_a_parquet_file_stays_text(tmp_path: Path) -> None:
    frame = pd.DataFrame({"a": VALUES[:, 0], "y": LABELS["digits as text"]})
    frame.to_parquet(tmp_path / "t.parquet")
    tree = ft.learn(tmp_path / "t.parquet", target="y")
    assert ft.run(tree, VALUES).classes == frame["y"].tolist()


def test_a_row_without_a_class_is_none_beside_numbers() -> None:
    settings = ft.LearningSettings(missing="drop")
    tree = ft.learn(VALUES, target=LABELS["integers"], settings=settings)
    found = ft.run(tree, np.array([[1.0], [np.nan]]))
    assert found.classes == [0, None]
    assert found.to_csv() == "class,rule,status\n0,1,decided\n,0,missing\n"


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        ([True, 2, "x"], False),
        ([True, 2], False),
        ([1, None, 2.0], True),
        ([None, "1"], False),
    ],
)
def test_labels_of_several_types_are_text(labels: list[Any], expected: bool) -> None:
    table = read_table(np.arange(float(len(labels)))[:, None], target=labels)
    assert (table.label_type == "number") == expected


def test_the_yaml_file_says_the_type_of_the_labels() -> None:
    tree = ft.learn(VALUES, target=LABELS["integers"])
    text = ft.export(tree, "yaml").content.decode()
    assert '\nclasses: ["0", "1", "2"]\n' in text.replace("'", '"')
    assert "\n  label type: number  # of predicted classes\n" in text
    words = ft.learn(VALUES, target=LABELS["names"])
    assert "label type" not in ft.export(words, "yaml").content.decode()


@pytest.mark.parametrize(
    ("label_type", "name"), [("number", "one"), ("number", "01"), ("boolean", "true")]
)
def test_a_class_name_that_is_no_label_of_its_type_is_refused(
    tmp_path: Path, label_type: Any, name: str
) -> None:
    with pytest.raises(ValueError, match=name):
        label_of(name, label_type)
    tree = random_tree(1)
    first = tree.classes[0]
    with pytest.raises(InvalidModelError) as caught:
        FuzzyTree(
            "t", (name,), (), (), (tree.leaves[0].__class__(name),),
            semantics=Semantics(label_type=label_type),
        )  # fmt: skip
    said = f"the label type is {label_type}, and the class {name!r} is none"
    assert said in str(caught.value)
    text = ft.export(tree, "yaml").content.decode()
    text = text.replace(
        "  cuts: a value", f"  label type: {label_type}\n  cuts: a value"
    )
    (tmp_path / "t.yaml").write_text(text, "utf-8")
    with pytest.raises(ReadError, match=f"and the class '{first}' is none"):
        ft.load(tmp_path / "t.yaml")


def test_diff_says_that_labels_became_text() -> None:
    one = ft.learn(VALUES, target=LABELS["integers"])
    two = ft.learn(VALUES, target=LABELS["digits as text"])
    found = ft.diff(one, two)
    (change,) = found.changes
    assert "the label type is text, and was number" in change.sentence
