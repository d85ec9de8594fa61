"""The values that rows can have: categories, whole numbers, stand-ins."""

from __future__ import annotations

from fractions import Fraction

import msgspec
import numpy as np
import pytest

from fuzzytree import learn
from fuzzytree.auditing.decide.domain import Domain, DomainSide, contains, span
from fuzzytree.auditing.decide.regions import cut_side
from fuzzytree.auditing.findings.domains import domain_of, limit_domain
from fuzzytree.auditing.findings.subject import AuditRows
from fuzzytree.checking import load_content
from fuzzytree.exporters import find_format
from fuzzytree.model import (
    DATE_UNIT,
    Band,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)

TOWNS = ("Bern", "Oslo", "Rom")
MODEL = RuleBase(
    "m",
    ("a", "b"),
    (
        Variable(
            "town",
            (Term("low", Band(None, 0.5)),),
            "",
            -1.0,
            2.0,
            (),
            False,
            TOWNS,
            -1.0,
        ),
        Variable(
            "age", (Term("young", Band(None, 30.0)),), "", 0.0, 99.0, missing=-5.5
        ),
    ),
    (
        Rule((Proposition("town", ("low",)),), "a"),
        Rule((Proposition("age", ("young",)),), "b"),
    ),
    Semantics("minimum"),
)
DOORS = Variable("age", (Term("young", Band(None, 3.0)),), "", 1.0, 5.0, is_whole=True)
TOWN = DomainSide("town", 0.0, 2.0, "model", values=(0.0, 1.0, 2.0), missing=-1.0)
AGE = DomainSide("age", 0.0, 99.0, "model", missing=-5.5)


def test_a_domain_has_the_categories_and_stand_ins_of_a_model() -> None:
    assert domain_of(MODEL).sides == (TOWN, AGE)


def test_a_domain_of_rows_has_the_categories_and_stand_ins_that_they_have() -> None:
    rows = AuditRows("rows", np.array([[2.0, 0.0], [np.nan, 7.0]]))
    town, age = domain_of(MODEL, within="data", rows=rows).sides
    assert (town.values, town.missing, age.missing) == ((0.0, 2.0), None, -5.5)


@pytest.mark.parametrize(
    ("town", "age", "is_in"),
    [
        ("0", "0", True),
        ("-1", "-11/2", True),
        ("1/2", "0", False),
        ("3", "0", False),
        ("2", "-5", False),
    ],
)
def test_a_domain_contains_what_rows_can_have(town: str, age: str, is_in: bool) -> None:
    point = {"town": Fraction(town), "age": Fraction(age)}
    assert contains(Domain((TOWN, AGE)), MODEL.variables, point) is is_in


def test_the_span_of_an_input_reaches_to_its_stand_in() -> None:
    assert span(MODEL.variables[1], Domain((TOWN, AGE))) == (
        Fraction("-5.5"),
        Fraction(99),
    )


def test_limits_leave_out_categories_and_stand_ins_beyond_them() -> None:
    town, age = limit_domain(Domain((TOWN, AGE)), {"town": "Oslo,Rom"}, MODEL).sides
    assert (town.values, town.missing, age) == ((1.0, 2.0), None, AGE)


def test_a_cut_keeps_the_values_of_its_interval() -> None:
    upper = cut_side(TOWN, (0.5, None))
    assert upper is not None
    assert (upper.low, upper.values, upper.missing) == (1.0, (1.0, 2.0), None)
    stand_in = cut_side(AGE, (None, -1.0))
    assert stand_in is not None
    assert (stand_in.values, stand_in.low, stand_in.missing) == ((-5.5,), -5.5, None)
    assert cut_side(TOWN, (0.0, 0.5)) is None


def test_a_cut_of_whole_numbers_has_whole_ends() -> None:
    doors = DomainSide("doors", 1.0, 5.0, is_whole=True)
    part = cut_side(doors, (2.0, 4.5))
    assert part is not None
    assert (part.low, part.high, part.is_open) == (3, 4, False)
    assert cut_side(doors, (2.5, 2.9)) is None


@pytest.mark.parametrize(("value", "nearest"), [("-4", -5.5), ("1/3", Fraction(1, 3))])
def test_the_nearest_value_may_be_a_stand_in(value: str, nearest: float) -> None:
    assert AGE.nearest(Fraction(value)) == nearest


def test_the_nearest_category_is_a_category() -> None:
    assert [TOWN.nearest(Fraction(n, 2)) for n in (-9, 1, 2, 9)] == [-1, 0, 1, 2]


def test_limits_of_whole_numbers_are_whole() -> None:
    model = msgspec.structs.replace(MODEL, variables=(MODEL.variables[0], DOORS))
    box = domain_of(model)
    assert box.sides[1] == DomainSide("age", 1.0, 5.0, "model", is_whole=True)
    side = limit_domain(box, {"age": (1.5, 4.5)}, model).sides[1]
    assert (side.low, side.high, side.is_whole) == (2.0, 4.0, True)
    with pytest.raises(
        ValueError, match=r"'age' is a whole number, and 1.5 to 1.6 has"
    ):
        limit_domain(box, {"age": (1.5, 1.6)}, model)


def test_learn_finds_the_columns_of_whole_numbers() -> None:
    chance = np.random.default_rng(1)
    doors, mass = chance.integers(1, 9, 200).astype(float), chance.uniform(0, 9, 200)
    doors[::7] = np.nan
    labels = np.where((doors > 4) | (mass > 6), "a", "b")
    rows = np.column_stack([doors, mass])
    tree = learn(rows, target=labels, columns_per_node=1)
    assert {one.name: one.is_whole for one in tree.variables} == {
        "x1": True,
        "x2": False,
    }
    text = find_format("yaml").write(tree).content
    assert b"numbers: whole" in text
    assert load_content(text, "m.yaml") == tree


@pytest.mark.parametrize(
    ("limits", "values"),
    [
        ({"town": "Rom,Bern"}, (0.0, 2.0, None)),
        ({"town": "Oslo,missing"}, (1.0, -1.0)),
    ],
)
def test_limits_name_categories(
    limits: dict[str, str], values: tuple[float | None, ...]
) -> None:
    town = limit_domain(domain_of(MODEL), limits, MODEL).sides[0]
    assert (*town.values, town.missing) == values


@pytest.mark.parametrize(
    ("limits", "text"),
    [
        ("Paris", "'town' cannot be 'Paris'; it is one of 'Bern', 'Oslo', 'Rom'"),
        ("missing", "the limits of 'town' have no category"),
        ((0.0, 1.0), "the limits of 'town' are names of categories"),
    ],
)
def test_limits_of_no_category_are_refused(limits: str, text: str) -> None:
    with pytest.raises(ValueError, match=f"^{text}$"):
        limit_domain(domain_of(MODEL), {"town": limits}, MODEL)


@pytest.mark.parametrize(
    "text", ["2024-03-01:2024-03-02", "2024-03-01T00:00:2024-03-02T00:00"]
)
def test_limits_of_dates_are_dates(text: str) -> None:
    model = msgspec.structs.replace(
        MODEL,
        variables=(
            MODEL.variables[0],
            msgspec.structs.replace(DOORS, unit=DATE_UNIT),
        ),
    )
    side = limit_domain(domain_of(model), {"age": text}, model).sides[1]
    assert (side.low, side.high) == (19783.0, 19784.0)
