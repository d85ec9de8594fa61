"""Rules for people, with one proposition for each variable."""

import math

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from fuzzytree.model import (
    DATE_UNIT,
    Band,
    Branch,
    FuzzyTree,
    Leaf,
    Node,
    Proposition,
    Rule,
    Term,
    Variable,
    sentence,
)
from fuzzytree.report.merged_rules import joint_band, with_merged_propositions
from fuzzytree.report.models import model_lines
from fuzzytree.semantics import curve_degree

ENDS = st.integers(-6, 6).map(float)


@st.composite
def bands(draw: st.DrawFn) -> Band:
    low, high = sorted([draw(ENDS), draw(ENDS)])
    low, high = low, high + (low == high)
    has_low, has_high = draw(st.booleans()), draw(st.booleans())
    left, right = (draw(st.none() | st.floats(0.1, 4.0)) for _ in range(2))
    return Band(
        low if has_low else None,
        high if has_high else None,
        low - left if has_low and left else None,
        high + right if has_high and right else None,
    )


@given(bands(), bands(), st.floats(-9.0, 9.0))
def test_the_degree_of_an_interval_is_that_of_both_bit_for_bit(
    first: Band, second: Band, value: float
) -> None:
    joint = joint_band(first, second)
    assert joint == joint_band(second, first)
    if joint is None:
        return
    for x in (value, *joint.knots(), *first.knots(), *second.knots()):
        for at in (math.nextafter(x, -math.inf), x, math.nextafter(x, math.inf)):
            degrees = [curve_degree(band, at) for band in (first, second)]
            assert curve_degree(joint, at) == min(degrees) == math.prod(degrees)


def words(variable: Variable, *names: str) -> str:
    rule = Rule(tuple(Proposition(variable.name, (name,)) for name in names), "yes")
    return sentence(with_merged_propositions(rule, [variable]))


def test_three_propositions_on_one_variable_are_one() -> None:
    age = Variable(
        "age",
        (
            Term("above 20", Band(low=20.0, left=18.0)),
            Term("above 30", Band(low=30.0, left=25.0)),
            Term("up to 50", Band(high=50.0, right=55.0)),
            Term("above 31", Band(low=31.0, left=24.0)),
        ),
    )
    assert (
        words(age, "above 20", "up to 50", "above 30") == "IF age is 30 to 50 THEN yes"
    )
    assert words(age, "above 20", "above 30") == "IF age is above 30 THEN yes"
    overlapping = "IF age is above 30 AND age is above 31 THEN yes"
    assert words(age, "above 30", "above 31") == overlapping


def test_dates_and_categories_have_their_words() -> None:
    ends = Term("late", Band(low=18628.0)), Term("early", Band(high=18659.0))
    day = Variable("day", ends, DATE_UNIT, is_whole=True)
    assert words(day, "late", "early") == "IF day is 2021-01-01 to 2021-02-01 THEN yes"
    sets = Term("S or M", Band(high=1.5)), Term("M or L", Band(low=0.5))
    size = Variable("size", sets, categories=("S", "M", "L"))
    assert words(size, "S or M", "M or L") == "IF size is M THEN yes"


def test_show_has_a_proposition_for_each_variable_of_a_tree() -> None:
    x = Variable("x", (Term("low", Band(high=4.0)), Term("high", Band(low=4.0))))
    more = Term("up to 9", Band(high=9.0)), Term("above 9", Band(low=9.0))
    x = msgspec.structs.replace(x, terms=(*x.terms, *more))
    y = Variable("y", (Term("small", Band(high=1.0)), Term("large", Band(low=1.0))))
    ways = (
        (Branch(("low",), leaf=1), Branch(("high",), node=2)),
        (Branch(("small",), leaf=2), Branch(("large",), node=3)),
        (Branch(("up to 9",), leaf=3), Branch(("above 9",), leaf=4)),
    )
    cuts = (("x", 4.0), ("y", 1.0), ("x", 9.0))
    nodes = tuple(
        Node(name, (cut,), (0, 1), way)
        for (name, cut), way in zip(cuts, ways, strict=True)
    )
    tree = FuzzyTree("t", ("a", "b"), (x, y), nodes, tuple(map(Leaf, "abab")))
    shown = [line for line in model_lines(tree) if " IF " in line]
    assert shown[2:] == [
        "3. IF x is 4 to 9 AND y is large THEN a",
        "4. IF x is above 9 AND y is large THEN b",
    ]
