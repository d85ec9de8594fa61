"""Dates and categories stand in their own words: text, pictures, comments."""

import datetime
import re

import msgspec
import numpy as np
import pandas as pd
import pytest

import fuzzytree as ft
from fuzzytree.formats import read_fcl
from fuzzytree.model import (
    DATE_UNIT,
    Band,
    Branch,
    FuzzyTree,
    Leaf,
    Node,
    Part,
    Term,
    Variable,
)
from fuzzytree.rechecking import interval_word, minute_word, table_word
from fuzzytree.report.drawing import Axis, Scale
from fuzzytree.report.models import model_lines

DAY = Variable(
    "day",
    (Term("early", Band(high=18628.0, right=18659.0)), Term("late", Band(low=18628.0))),
    DATE_UNIT,
    18262.0,
    18992.0,
    is_whole=True,
)
SIZE = Variable(
    "size",
    (
        Term("S or M (2)", Band(high=1.5, right=2.5)),
        Term("L", Band(low=1.5, left=0.5)),
    ),
    low=-1.0,
    high=2.0,
    categories=("S", "M", "L"),
    missing=-1.0,
)
SUM = Variable(
    "sum",
    (Term("low", Band(high=1.0)), Term("high", Band(low=1.0))),
    parts=(Part("day", 0.5, 18628.0), Part("size", -2.0)),
)
TREE = FuzzyTree(
    "shop",
    ("a", "b"),
    (DAY, SIZE, SUM),
    (
        Node(
            "day",
            (18628.0,),
            (0, 1),
            (Branch(("early",), node=2), Branch(("late",), node=3)),
        ),
        Node(
            "size",
            (1.5,),
            (0, 1),
            (Branch(("S or M (2)",), leaf=1), Branch(("L",), leaf=2)),
        ),
        Node(
            "sum", (1.0,), (0, 1), (Branch(("low",), leaf=3), Branch(("high",), leaf=4))
        ),
    ),
    tuple(Leaf(label) for label in "abab"),
)


def test_text_shows_dates_and_categories_in_their_own_words() -> None:
    text = "\n".join(model_lines(TREE))
    assert "├─ early (<= 2021-01-01): size?" in text
    assert "└─ late (> 2021-01-01): sum?" in text
    assert "├─ S or M (2) (missing or S or M): a" in text
    assert "└─ L: b" in text
    assert text.endswith(
        """
day, 2020-01-01 to 2021-12-31
  early  1 up to 2021-01-01, falls to 0 at 2021-02-01
  late   1 above 2021-01-01, 0 beyond 2021-01-01
size, 3 categories
  S or M (2)  1: S, M, missing; 0.5: L
  L           1: L; 0.5: M
sum
  =   0.5 * (day - 2021-01-01)
    - 2 * size
    size: 0 is S, 1 is M, 2 is L
  low   1 up to 1, 0 beyond 1
  high  1 above 1, 0 beyond 1"""
    )


@pytest.mark.parametrize(
    ("low", "high", "word"),
    [
        (None, 0.5, "missing or S"),
        (-0.5, 1.5, "S or M"),
        (1.5, None, "L"),
        (-1.0, None, "S or M or L"),
        (0.2, 0.8, ""),
    ],
)
def test_an_interval_of_categories_has_their_names(
    low: float | None, high: float | None, word: str
) -> None:
    assert interval_word(SIZE, low, high) == word


def test_times_have_minutes_and_whole_days_none() -> None:
    moment = Variable("at", unit=DATE_UNIT)
    assert minute_word(moment, 18628.2501) == "2021-01-01T06:00"
    assert minute_word(DAY, 18628.75) == "2021-01-01"
    assert interval_word(moment, 18628.0, 18628.5) == (
        "> 2021-01-01 to 2021-01-01T12:00"
    )
    assert table_word(moment, 18628.25) == "2021-01-01T06:00:00"
    for value in (np.nan, np.inf, 1e300, -1e9):
        assert minute_word(moment, value) == table_word(moment, value) == ""
    assert table_word(Variable("x"), 3.0) == ""


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (18262, 18992, ["2020-01", "2020-07", "2021-01", "2021-07"]),
        (18262, 18330, ["2020-01", "2020-02", "2020-03"]),
        (18263, 18273, ["2020-01-04", "2020-01-09"]),
        (0, 19000, ["1980-01", "2000-01", "2020-01"]),
        (-1e9, 1e9, ["-1e+09", "0", "1e+09"]),
    ],
)
def test_an_axis_of_dates_has_round_dates(
    low: float, high: float, words: list[str]
) -> None:
    axis = Axis("day", DATE_UNIT, (), (), low, high)
    shown = [word for _, word in axis.ticks(Scale(low, high, 0.0, 300.0))]
    assert shown[: len(words)] == words
    for value, word in axis.ticks(Scale(low, high, 0.0, 300.0)):
        if "-" in word[1:] and "e" not in word:
            day = datetime.date(1970, 1, 1) + datetime.timedelta(days=value)
            assert day.isoformat() in (word, f"{word}-01")


def test_pictures_have_dates_and_categories_on_their_axes() -> None:
    texts = re.findall(r">([^<]+)</text>", ft.draw(ft.rules_from_tree(TREE)).svg)
    assert {"2021-01", "S", "M", "L"} <= {*texts}


def test_a_picture_of_a_learned_tree_shows_no_day_number() -> None:
    rng = np.random.default_rng(0)
    days = pd.Timestamp("2021-01-01") + pd.to_timedelta(rng.integers(0, 700, 90), "D")
    late = days > pd.Timestamp("2021-09-01")
    tree = ft.learn(pd.DataFrame({"day": days}), target=np.where(late, "b", "a"))
    for picture in (ft.draw(tree), ft.draw(tree, row={"day": "2021-05-01"})):
        assert "2021-0" in picture.svg
        assert not re.search(r">[^<]*\b18[0-9]{3}\b[^<]*</text>", picture.svg)


def test_fcl_comments_say_what_numbers_of_dates_and_categories_mean() -> None:
    text = ft.export(ft.rules_from_tree(TREE), to="fcl", allow_loss=True).content
    lines = text.decode().splitlines()
    assert lines[2:4] == [
        "// 'day', days since 1970-01-01: 'early' is up to 2021-01-01; "
        "'late' is after 2021-01-01",
        "// 'size', positions of categories: 0 is S; 1 is M; 2 is L; "
        "'S or M (2)' is missing or S or M; 'L' is L",
    ]


def test_a_category_ends_no_comment_of_fcl() -> None:
    names = ("a", "*) c")
    other = Variable("kind", (Term("x", Band(high=0.5)),), categories=names)
    tree = msgspec.structs.replace(TREE, variables=(*TREE.variables, other))
    for dialect in ("portable", "iec"):
        written = ft.export(
            ft.rules_from_tree(tree), to="fcl", allow_loss=True, dialect=dialect
        )
        assert read_fcl(written.content, "shop").model
