"""The picture of a tree shows its questions, terms, leaves and combinations."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import msgspec
import numpy as np
import pandas as pd
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.model.tree import FuzzyTree, Leaf
from fuzzytree.report.audit_model import tree_section
from fuzzytree.report.svg_tree import MOST_LEAVES, boxes_of, draw_tree
from fuzzytree.testing import random_tree
from tests.report.drawn_texts import assert_apart, texts_of

if TYPE_CHECKING:
    from pathlib import Path


def learnt(classes: int, **settings: Any) -> FuzzyTree:
    """Return a tree of that many classes on three columns."""
    chance = np.random.default_rng(1)
    label = np.repeat(np.arange(classes), 12)
    table = chance.normal(size=(len(label), 3))
    table[:, 0] += 9.0 * (label % 5)
    table[:, 1] += 9.0 * (label // 5)
    target = [f"class {k}" for k in label]
    return ft.learn(
        ft.table(table, columns=["a", "b", "c"]),
        target=target,
        name="grid",
        settings=ft.LearningSettings(**settings),
    )


def slanted() -> FuzzyTree:
    """Return a tree of two classes that only a combination of columns tells apart."""
    chance = np.random.default_rng(2)
    along, across = chance.normal(0.0, 9.0, 80), chance.normal(0.0, 0.3, 80)
    across[40:] += 4.0
    target = ["one"] * 40 + ["two"] * 40
    table = np.column_stack([along + across, along - across])
    return ft.learn(ft.table(table, columns=["a", "b"]), target=target)


def written(tree: FuzzyTree) -> set[str]:
    """Return the words of a picture, which must be well-formed XML."""
    parts = ElementTree.fromstring(draw_tree(tree).svg).iter()
    return {one.text or "" for one in parts if one.tag.endswith("}text")} - {""}


def test_a_tree_shows_its_questions_terms_and_leaves() -> None:
    tree = learnt(4, mode="paper")
    found = written(tree)
    assert {f"{node.variable}?" for node in tree.nodes} <= found
    assert {leaf.label for leaf in tree.leaves} <= found
    rows = {f"rule {k}, {leaf.support} rows" for k, leaf in enumerate(tree.leaves, 1)}
    assert rows <= found
    terms = {" or ".join(b.terms) for node in tree.nodes for b in node.branches}
    assert terms <= {text.partition(":")[0] for text in found}
    assert "grid: 1 node, 4 leaves" in found


def test_a_tree_of_one_leaf_is_that_leaf() -> None:
    tree = FuzzyTree("all", ("a",), (), (), (Leaf("a", support=1),))
    assert written(tree) == {"all: 0 nodes, 1 leaf", "a", "rule 1, 1 row"}


def test_a_node_has_the_rows_of_all_that_is_below_it() -> None:
    boxes = boxes_of(learnt(7), None)
    assert boxes[0].rows == 7 * 12
    for box in (node for node in boxes if node.below):
        assert box.rows == sum(below.rows or 0 for below in box.below)


def test_a_box_shows_the_training_rows_that_reach_it_by_class() -> None:
    tree = slanted()
    picture = draw_tree(tree).svg
    assert "combination 1?; 80 rows; rows by class: 40, 40" in picture
    parts = ElementTree.fromstring(picture).iter()
    bars = [one for one in parts if "bar" in one.get("class", "").split()]
    assert len(bars) == 2 + 2 + 2  # of the legend, the node and the leaves
    leaves = tuple(replace(leaf, counts=()) for leaf in tree.leaves)
    bare = replace(tree, leaves=leaves)
    assert "rows by class" not in draw_tree(bare).svg
    assert 'class="bar' not in draw_tree(bare).svg


def test_a_page_says_that_bars_are_training_rows_where_no_table_is_given() -> None:
    caption = "The bar in a box shows the training rows that reach it, by their class"
    assert caption in tree_section(slanted(), None)
    leaves = tuple(replace(leaf, counts=()) for leaf in slanted().leaves)
    assert caption not in tree_section(replace(slanted(), leaves=leaves), None)


def test_a_tree_without_known_rows_is_drawn_without_them() -> None:
    tree = learnt(3)
    bare = replace(
        tree,
        leaves=tuple(replace(leaf, support=None, counts=()) for leaf in tree.leaves),
    )
    assert not any("row" in text for text in written(bare))


def test_a_class_has_one_colour_in_every_picture() -> None:
    tree = learnt(12)
    codes = {box.code for box in boxes_of(tree, None) if box.title == "class 3"}
    assert codes == {tree.classes.index("class 3")}


def test_combinations_are_written_below_the_tree() -> None:
    tree = slanted()
    wanted = {node.variable for node in tree.nodes}
    made = [v for v in tree.variables if v.parts and v.name in wanted]
    assert made
    notes = [text for text in written(tree) if " = " in text]
    assert {note.split(" = ")[0] for note in notes} == {v.name for v in made}


def test_names_with_signs_of_markup_or_many_letters_do_no_harm() -> None:
    name = "<b>&" + "x" * 1000
    tree = ft.learn(
        ft.table(np.array([[0.0], [0.1], [5.0], [5.1]]), columns=["<x>"]),
        target=["&a", "&a", name, name],
    )
    assert "<x>?" in written(tree)
    assert float(ElementTree.fromstring(draw_tree(tree).svg).get("width", "")) < 1200


def test_branches_of_categories_have_their_names_alone() -> None:
    table = pd.DataFrame({"city": ["Bern", "Rom", "Oslo"] * 20})
    tree = ft.learn(table, target=["a", "b", "c"] * 20)
    branches = {box.branch for box in boxes_of(tree, None)} - {""}
    assert branches
    assert not any(":" in branch for branch in branches)


def test_names_of_forty_leaves_are_whole_and_apart() -> None:
    content = msgspec.json.encode(random_tree(5, leaves=40)).decode()
    content = re.sub(r'"x(\d)"', r'"size \1 of the <worst> nucleus & cell"', content)
    long = msgspec.json.decode(content, type=FuzzyTree)
    long = replace(long, name="n" * 300)
    texts = texts_of(draw_tree(long).svg)
    assert_apart(texts)
    whole = " ".join(text.words for text in texts)
    for node in long.nodes:
        assert f"{node.variable}?" in whole
    assert "…" not in whole


def test_a_tree_of_too_many_leaves_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    assert MOST_LEAVES == 200
    monkeypatch.setattr("fuzzytree.report.svg_tree.MOST_LEAVES", 2)
    with pytest.raises(ValueError, match="at most") as caught:
        draw_tree(learnt(3))
    assert str(caught.value) == (
        "a picture shows at most 2 leaves, and grid has 3; "
        "learn a smaller tree, or read its rules"
    )


def test_the_same_tree_is_the_same_picture_wherever_it_is_shown(tmp_path: Path) -> None:
    picture = draw_tree(learnt(3))
    assert picture == draw_tree(learnt(3))
    picture.save(tmp_path / "tree.SVG")
    assert (tmp_path / "tree.SVG").read_text("utf-8") == picture.svg
    assert picture._repr_svg_() == picture.svg
