"""An explanation names the rule that decides, and no change is smaller than its own."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Mapping

import numpy as np
import pandas as pd
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.auditing.explanation.records import Explanation, RowChange
from fuzzytree.errors import TableError
from fuzzytree.model import (
    Band,
    Branch,
    FuzzyTree,
    Leaf,
    Model,
    Node,
    Part,
    Term,
    Variable,
)
from fuzzytree.semantics import answer_of, rules_from_tree
from fuzzytree.testing import random_tree

GRID = 25  # values of an input


def changed(row: Mapping[str, float], change: RowChange) -> dict[str, float]:
    """Return the row that a change leads to."""
    return {**row, **{move.input: move.value for move in change.moves}}


def cost(old: Mapping[str, float], new: Mapping[str, float], model: Model) -> float:
    """Return the largest change, as a share of the range."""
    return max(
        abs(new[v.name] - old[v.name]) / ((v.high or 0.0) - (v.low or 0.0))
        for v in model.variables
        if not v.parts
    )


def with_ranges(tree: FuzzyTree) -> FuzzyTree:
    variables = tuple(
        replace(v, low=-2.0, high=2.0) if not v.parts else v for v in tree.variables
    )
    return replace(tree, variables=variables)


@pytest.mark.parametrize("seed", range(30))
def test_no_row_of_a_grid_is_a_smaller_change(seed: int) -> None:
    tree = with_ranges(random_tree(seed, inputs=3, leaves=6))
    chance = random.Random(seed)
    row = {name: chance.uniform(-2.0, 2.0) for name in tree.inputs}
    own = answer_of(tree, row).label
    explanation = ft.why(tree, row)
    assert (explanation.label, explanation.rule) == (own, answer_of(tree, row).rule)
    change = explanation.change
    assert change is not None
    values = [-2.0 + 4.0 * k / (GRID - 1) for k in range(GRID)]
    others = [
        cost(row, point, tree)
        for numbers in itertools.product(values, repeat=len(tree.inputs))
        if answer_of(tree, point := dict(zip(tree.inputs, numbers, strict=True))).label
        != own
    ]
    if change.verdict == "NONE":
        assert others == []
        return
    assert change.verdict == "PROVED"
    there = changed(row, change)
    assert answer_of(tree, there).label == change.label != own
    assert ft.run(tree, pd.DataFrame([there])).names == [change.label]
    assert math.isclose(cost(row, there, tree), change.cost, rel_tol=1e-9)
    assert change.low <= change.cost <= change.low * 1.006 + 1e-11
    assert min(others, default=math.inf) >= change.low * (1 - 1e-12)
    if explanation.alone is not None and explanation.alone.moves:
        [move] = explanation.alone.moves
        assert explanation.alone.cost >= change.low
        assert answer_of(tree, changed(row, explanation.alone)).label != own
        assert move.value != row[move.input]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("kind", ["relative", "raw"])
def test_the_change_of_rules_is_confirmed_by_run(seed: int, kind: str) -> None:
    tree = with_ranges(random_tree(seed, inputs=2, leaves=4))
    rules = rules_from_tree(tree, "raw" if kind == "raw" else "relative")
    chance = random.Random(seed)
    row = {name: chance.uniform(-2.0, 2.0) for name in rules.inputs}
    explanation = ft.why(rules, row)
    change = explanation.change
    assert change is not None
    assert explanation.label == answer_of(rules, row).label
    if change.moves:
        there = changed(row, change)
        assert ft.run(rules, pd.DataFrame([there])).names == [change.label]
        assert change.label != explanation.label
        assert change.low <= change.cost


def test_fixed_inputs_do_not_move_and_a_wanted_class_is_reached() -> None:
    tree = with_ranges(random_tree(3, inputs=3, leaves=8))
    row = dict.fromkeys(tree.inputs, 0.25)
    own = answer_of(tree, row).label
    for wanted in (label for label in tree.classes if label != own):
        change = ft.why(tree, row, wanted=wanted).change
        assert change is not None
        assert change.verdict in ("PROVED", "NONE")
        if change.moves:
            assert answer_of(tree, changed(row, change)).label == wanted
    for name in tree.inputs:
        change = ft.why(tree, row, fixed=[name]).change
        assert change is not None
        assert name not in {move.input for move in change.moves}


def mixture() -> FuzzyTree:
    """Return a tree with a sum, a category, a whole number and stand-ins."""
    low = Term("low", Band(high=0.0, right=1.0))
    high = Term("high", Band(low=0.0, left=-1.0))
    few = Term("few", Band(high=2.5, right=3.0))
    many = Term("many", Band(low=2.5, left=2.0))
    cold = Term("blue", Band(high=0.5, right=1.0))
    warm = Term("red or white", Band(low=0.5, left=0.0))
    return FuzzyTree(
        "mixture",
        ("a", "b"),
        (
            Variable("x", low=-4.0, high=4.0, missing=1.0),
            Variable("y", low=0.0, high=2.0),
            Variable("doors", (few, many), low=0.0, high=10.0, is_whole=True),
            Variable("colour", (cold, warm), categories=("blue", "red", "white")),
            Variable("sum", (low, high), parts=(Part("x", 1.0), Part("y", -2.0, 0.5))),
        ),
        (
            Node(
                "sum",
                (0.0,),
                (0, 1),
                (Branch(("low",), leaf=1), Branch(("high",), node=2)),
            ),
            Node(
                "doors",
                (2.5,),
                (0, 1),
                (Branch(("few",), node=3), Branch(("many",), leaf=4)),
            ),
            Node(
                "colour",
                (0.5,),
                (0, 1),
                (Branch(("blue",), leaf=2), Branch(("red or white",), leaf=3)),
            ),
        ),
        (
            Leaf("a", support=3, counts=(2, 1)),
            Leaf("b", support=4, counts=(0, 4)),
            Leaf("a", support=5, counts=(5, 0)),
            Leaf("b"),
        ),
    )


def why(**row: object) -> Explanation:
    return ft.why(mixture(), row)


def test_a_sum_is_explained_by_what_its_inputs_add() -> None:
    explanation = why(x=3.0, y=0.25, doors=1, colour="red")
    first = explanation.because[0]
    assert (first.proposition, first.value, first.cut) == ("sum is high", 3.5, 0.0)
    assert [*first.parts.items()] == [("x", 3.0), ("y", 0.5)]
    assert explanation.counts == {"a": 5, "b": 0}
    runner = explanation.runner_up
    assert runner is not None
    assert (runner.rule, runner.label, explanation.strengths["b"]) == (4, "b", 0.0)


def test_whole_numbers_stay_whole_and_categories_are_named() -> None:
    explanation = why(x=3.0, y=0.25, doors=1, colour="red")
    assert explanation.change is not None
    [move] = explanation.change.moves
    assert (move.input, move.value, move.new) == ("doors", 3.0, "3")
    explanation = ft.why(
        mixture(),
        {"x": 3, "y": 0.25, "doors": 1, "colour": "red"},
        fixed=["x", "y", "doors"],
    )
    assert explanation.change is not None
    [move] = explanation.change.moves
    assert (move.old, move.new, move.cost) == ("red", "blue", 1.0)


def test_a_missing_value_is_filled_in_where_something_stands_for_it() -> None:
    explanation = why(x=None, y=0.25, doors=1, colour="red")
    assert explanation.filled == {"x": "1"}
    assert explanation.row["x"] == "missing"
    explanation = why(x=1.0, y=None, doors=1, colour="red")
    assert (explanation.status, explanation.label) == ("missing", None)
    assert str(explanation) == (
        "mixture: no class, as a value is missing\n"
        "change     no change to another class is known: nothing stands for a missing "
        "y, sum"
    )


def test_a_row_beyond_the_ranges_is_explained_too() -> None:
    explanation = why(x=30.0, y=0.25, doors=1, colour="red")
    assert explanation.label == "a"
    assert explanation.change is not None
    assert explanation.change.verdict == "PROVED"
    explanation = ft.why(
        mixture(), {"x": 30, "y": 0.25, "doors": 1.5, "colour": "blue"}, fixed=["doors"]
    )
    assert explanation.change is not None
    assert explanation.change.label == "a"


def test_a_row_may_be_of_a_frame_or_a_frame() -> None:
    frame = pd.DataFrame(
        {"x": [3.0, -3.0], "y": 0.25, "doors": 1, "colour": "red", "more": "z"}
    )
    assert ft.why(mixture(), frame.iloc[0]).rule == 3
    assert ft.why(mixture(), frame, number=2).rule == 1
    with pytest.raises(TableError, match="has 2 rows, and no row 3"):
        ft.why(mixture(), frame, number=3)


def test_an_array_has_the_columns_that_the_model_was_learnt_from() -> None:
    values = np.array([[0.0, 1.0], [0.0, 1.5], [0.0, 7.0], [0.0, 7.5]])
    tree = ft.learn(values, target=["soft", "soft", "firm", "firm"], leaves=2)
    assert ft.why(tree, values, number=3).label == "firm"


def test_what_is_no_category_is_refused() -> None:
    with pytest.raises(TableError) as error:
        why(x=3.0, y=0.25, doors=1, colour="rod")
    assert str(error.value) == (
        "the row: 'colour' has no category 'rod'; there is blue, red, white "
        "(did you mean 'red'?)"
    )


def test_an_empty_row_is_refused_in_a_sentence() -> None:
    tree = random_tree(1, leaves=2)
    with pytest.raises(TableError) as caught:
        ft.why(tree, {})
    assert str(caught.value).endswith("which the model needs; it has none")


def test_numbers_are_classes_where_labels_are() -> None:
    tree = ft.learn(
        pd.DataFrame({"cm": [1.0, 1.5, 7.0, 7.5]}), target=[0, 0, 1, 1], leaves=2
    )
    change = ft.why(tree, {"cm": 2.0}, wanted=1).change
    assert change is not None
    assert change.label == "1"


def test_a_page_has_at_most_15_lines_and_fits_a_terminal() -> None:
    tree = random_tree(5, inputs=12, leaves=30)
    text = str(ft.why(tree, dict.fromkeys(tree.inputs, 0.1)))
    lines = text.splitlines()
    assert len(lines) <= 15
    assert max(map(len, lines)) <= 100
