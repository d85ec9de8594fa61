# ruff: noqa: E501 # whole messages
"""A sentence is a requirement of a model, or one sentence says why it is none."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

import fuzzytree as ft
from fuzzytree.auditing.require.phrases import parse_requirement, read_requirements
from fuzzytree.errors import ReadError
from fuzzytree.model import (
    DATE_UNIT,
    Band,
    Proposition,
    Rule,
    RuleBase,
    Term,
    Variable,
)

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
TIPPER, GRIP = (ft.load(str(EXAMPLES / name)) for name in ("tipper.fll", "grip.yaml"))
PARCEL = RuleBase(
    "parcel",
    ("post", "van"),
    (
        Variable("mass and size", (Term("any", Band()),), low=0.0, high=9.0),
        Variable("object", (Term("any", Band()),), categories=("egg", "glass", "tin")),
        Variable("day", (Term("any", Band()),), unit=DATE_UNIT, low=0.0, high=30000.0),
    ),
    (Rule((Proposition("object", ("any",)),), "post"),),
    columns=("mass and size", "object", "day", "colour"),
)


def test_conditions_are_in_the_words_of_the_table() -> None:
    text = (
        "class is never van where object is egg or tin and 'mass and size' < 3 "
        "and day is between 1970-01-03 and 1970-01-05"
    )
    boxes = parse_requirement(text, PARCEL).boxes
    ends = (-math.inf, math.nextafter(3.0, 0.0))
    assert boxes == tuple(
        {"object": (code, code), "mass and size": ends, "day": (2.0, 4.0)}
        for code in (0.0, 2.0)
    )


def test_if_then_is_the_same_as_where() -> None:
    where = parse_requirement("tip is at most 9 where food >= 2", TIPPER)
    if_then = parse_requirement("if food >= 2 then tip is at most 9", TIPPER)
    assert (where.claim, where.boxes) == (if_then.claim, if_then.boxes)


CLASSES = (
    "class rises (falls) with INPUT in the order CLASS, CLASS; class is never "
    "(always) CLASS or CLASS; every input gets a class (an output); changing INPUT "
    "changes nothing"
)


@pytest.mark.parametrize(
    ("model", "text", "message"),
    [
        (GRIP, "class is firm", f"'class is firm' is no requirement of this model; there is {CLASSES}"),
        (GRIP, "class is never frim", "there is no class 'frim'; there is open, soft, firm (did you mean 'firm'?)"),
        (GRIP, "class is never firm where froce < 2", "there is no input 'froce'; there is force, slip (did you mean 'force'?)"),
        (GRIP, "class is never firm where force < low", "'force' cannot be 'low'; it is a number"),
        (GRIP, "class is never firm where force < 1 and force > 2", "no value of 'force' meets all conditions"),
        (GRIP, "class is never firm where force is between 2 and 1", "the ends 2 and 1 are swapped; the smaller one stands first"),
        (GRIP, "class is never firm where force", "'force' is no condition; there is NAME < 1, NAME >= 1, NAME is A or B and NAME is between 1 and 2, joined by 'and'"),
        (GRIP, "class rises with force in the order open, firm", "the order must name once each of open, soft, firm"),
        (GRIP, "changing force changes nothing where force is 2", "the conditions fix 'force', which has to change"),
        (PARCEL, "class is never van where object is eg", "'object' cannot be 'eg'; it is one of 'egg', 'glass', 'tin'"),
        (PARCEL, "class is never van where object < 2", "'object' has categories, which have no order; write 'object is egg'"),
        (PARCEL, "changing color changes nothing", "there is no column 'color'; there is colour, day, mass and size, object (did you mean 'colour'?)"),
        (TIPPER, "tap is at least 2", "there is no output 'tap'; there is tip (did you mean 'tip'?)"),
        (TIPPER, "tip is between 5 and 3", "the ends 5 and 3 are swapped; the smaller one stands first"),
        (TIPPER, "tip is at least nan", "'nan' must be a number"),
        (TIPPER, "tip changes by at most -1 per food", "the largest change must be 0 or more, not -1"),
    ],
)  # fmt: skip
def test_what_is_no_requirement_is_refused_in_one_sentence(
    model: ft.RuleBase, text: str, message: str
) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        parse_requirement(text, model)


def test_a_file_lists_all_mistakes_with_their_places(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    path.write_text(
        "requirements:\n- that: tip is at least x\n  where: food < 2\n"
        "- {that: tip is at most 3, were: food < 2}\n- that: tip falls with fod\n"
    )
    with pytest.raises(ReadError) as caught:
        read_requirements(path, TIPPER)
    assert str(caught.value).splitlines() == [
        f"{path}:2:9: 'x' must be a number",
        f"{path}:4:28: a requirement has no key 'were'; there is that, where, name, why "
        "(did you mean 'where'?)",
        f"{path}:5:9: there is no input 'fod'; there is service, food (did you mean "
        "'food'?)",
    ]


def test_a_file_without_requirements_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    path.write_text("requirements: []\n")
    with pytest.raises(ReadError, match="needs 1 to 1000 entries, not 0"):
        read_requirements(path, TIPPER)
