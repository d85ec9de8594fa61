"""The picture of a surface has the colours of what `run` answers."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.model import Band, Proposition, Rule, RuleBase, Term, Variable
from fuzzytree.report.svg_surface import CELLS, surface_of
from fuzzytree.testing import random_system, random_tree
from tests.report.drawn_texts import assert_apart, texts_of


def looks(svg: str) -> list[list[str]]:
    """Return the colour of each cell of a picture, from the lowest row."""
    size = 336.0 / CELLS
    rows: dict[float, list[str]] = {}
    cell = r' y="([\d.]+)" width="([\d.]+)" height="7" class="cell (\w+)"'
    for top, wide, look in re.findall(cell, svg):
        rows.setdefault(-float(top), []).extend([look] * round(float(wide) / size))
    return [rows[top] for top in sorted(rows)]


def test_cells_of_a_class_have_the_class_that_run_answers() -> None:
    tree = random_tree(3, leaves=9)
    across, up, *rest = tree.inputs
    row = dict.fromkeys(rest, 0.2)
    surface = surface_of(tree, (across, up), row)
    grid = looks(ft.draw(tree, surface=(across, up), row=row).svg)
    assert [len(line) for line in grid] == [CELLS] * CELLS
    for j, y in enumerate(surface.ys):
        points = [{**row, across: x, up: y} for x in surface.xs]
        values = np.array([[point[name] for name in tree.inputs] for point in points])
        codes = ft.run(tree, values, columns=tree.inputs).codes
        assert surface.panels[""][j].tolist() == codes.tolist()
        assert grid[j] == [f"k{code % 10}" for code in codes]


@pytest.mark.parametrize("seed", range(6))
def test_numbers_of_a_system_are_those_of_run(seed: int) -> None:
    system = random_system(seed)
    if len(system.inputs) < 2:
        pytest.skip("one input")
    across, up, *rest = system.inputs
    row = dict.fromkeys(rest, 0.25)
    surface = surface_of(system, (across, up), row)
    x, y = np.meshgrid(surface.xs, surface.ys)
    columns: dict[str, Any] = {across: x.ravel(), up: y.ravel()}
    values = np.stack(
        [columns.get(name, np.full(x.size, 0.25)) for name in system.inputs], axis=1
    )
    answers = ft.run(system, values)
    for output in system.outputs:
        np.testing.assert_array_equal(
            surface.panels[output.name].ravel(), answers[output.name]
        )
    texts = texts_of(ft.draw(system, surface=(across, up), row=row).svg)
    assert_apart(texts)


def test_colours_rise_with_the_number_and_the_row_is_marked() -> None:
    tipper = ft.load("examples/tipper.fll")
    surface = surface_of(tipper, ("service", "food"), {})
    svg = ft.draw(tipper, surface=["service", "food"]).svg
    levels = np.array([[int(look[1:]) for look in line] for line in looks(svg)])
    numbers = surface.panels["tip"]
    low, high = numbers.min(), numbers.max()
    expected = ((numbers - low) / (high - low) * 24).astype(int).clip(max=23)
    assert (levels == expected).all()
    assert 'class="witness"' not in svg
    marked = ft.draw(tipper, surface=["service", "food"], row={"service": 3, "food": 8})
    assert 'class="witness"' in marked.svg


def colours() -> RuleBase:
    """Return rules of a number with a range, one without, and a category."""
    low = Term("low", Band(high=1.0, right=2.0))
    red = Term("red", Band(high=0.5))
    variables = (
        Variable("a", (low,), "", 0.0, 4.0),
        Variable("b", (low,)),
        Variable("c", (red,), categories=("green", "red")),
        Variable("d", missing=7.0),
        Variable("e", unit="kg", low=2.0, high=4.0),
        Variable("f"),
    )
    rules = (Rule((Proposition("a", ("low",)), Proposition("c", ("red",))), "k"),)
    return RuleBase("colours", ("k",), variables, rules)


def test_values_of_other_inputs_are_said_with_their_reason() -> None:
    svg = ft.draw(colours(), surface=("a", "b"), row={"f": 5.0}).svg
    said = " ".join(text.words for text in texts_of(svg))
    assert "first categories: c = green" in said
    assert "as where values are missing: d = 7" in said
    assert "in the middle of ranges: e = 3 kg" in said
    assert "of the row: f = 5" in said
    assert "no class" in said


@pytest.mark.parametrize(
    ("names", "row", "message"),
    [
        (["a"], {}, "a surface needs two different inputs, not 'a'"),
        (["a", "a"], {}, "a surface needs two different inputs, not 'a,a'"),
        (
            ["a", "x"],
            {},
            "a surface over 'x', which is no input; there is a, b, c, d, e, f",
        ),
        (
            ["a", "c"],
            {},
            "a surface needs two inputs of numbers, and 'c' has categories",
        ),
        (["a", "d"], {}, "'d' has no range; write its low and high into the model"),
        (["a", "b"], {}, "'f' has no range; write its low and high into the model"),
        (["a", "b"], {"f": float("inf")}, "the row's 'f' must be finite, not inf"),
    ],
)
def test_what_has_no_surface_is_one_sentence(
    names: list[str], row: dict[str, float], message: str
) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        ft.draw(colours(), surface=names, row=row)
    assert str(caught.value) == message


def test_a_sum_of_inputs_is_no_input() -> None:
    wine = ft.learn("examples/wine/wine.csv", target="cultivar")
    with pytest.raises(ValueError, match="which is no input"):
        ft.draw(wine, surface=["combination 1", "hue"])


def test_numbers_keep_their_colours_in_the_dark() -> None:
    system = random_system(1)
    svg = ft.draw(system, surface=(system.inputs[0], system.inputs[1])).svg
    light, dark = svg.split("prefers-color-scheme: dark", 1)
    assert ".cell {" in dark  # which must not win: a level names its element, too
    assert re.search(r"rect\.s\d+ {", light)
