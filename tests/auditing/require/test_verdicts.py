# ruff: noqa: E501 # a line for each requirement
"""Requirements on small models, with the verdicts that one can work out by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import fuzzytree as ft
from fuzzytree.auditing.decide import Base, Boxes, OutputBounds
from fuzzytree.auditing.findings.domains import domain_of
from fuzzytree.model import (
    Band,
    Conclusion,
    Defuzzifier,
    Document,
    FuzzySystem,
    Points,
    Proposition,
    Rule,
    RuleBase,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
)

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
GRIP = ft.load(str(EXAMPLES / "grip.yaml"))

REGIONS = ("east", "north", "west")
SHOP = RuleBase(
    "shop",
    ("cheap", "dear"),
    (
        Variable(
            "region",
            (Term("north", Band(low=0.5, high=1.5)), Term("any", Band())),
            categories=REGIONS,
        ),
        Variable("doors", (Term("many", Band(low=2.5)),), low=1.0, high=9.0, is_whole=True),
    ),
    (
        Rule((Proposition("region", ("north",)),), "dear"),
        Rule((Proposition("doors", ("many",)), Proposition("region", ("any",))), "cheap"),
    ),
)  # fmt: skip


def heater(
    function: Any = "weighted average", default: float | None = None
) -> FuzzySystem:
    """Return a heater: 30 below 10 degrees, 10 from 20 to 30, and nothing above 40."""
    cold, mild = (
        Points((10.0, 20.0), (1.0, 0.0)),
        Points((10.0, 20.0, 30.0, 40.0), (0.0, 1.0, 1.0, 0.0)),
    )
    outdoors = Variable(
        "outdoors", (Term("cold", cold), Term("mild", mild)), low=0.0, high=50.0
    )
    wind = Variable(
        "wind", (Term("any", Points((0.0, 1.0), (0.5, 0.5))),), low=0.0, high=1.0
    )
    numbers = (30.0, 10.0)
    if function.startswith("weighted"):
        terms = [Term(f"t{n:g}", Singleton(n)) for n in numbers]
    else:
        terms = [Term(f"t{n:g}", Trapezoid(n - 5, n, n, n + 5)) for n in numbers]
    output = SystemOutput(
        "heat", tuple(terms), 0.0, 40.0, Defuzzifier(function), "maximum", default
    )
    rules = tuple(
        SystemRule(Proposition("outdoors", (name,)), (Conclusion("heat", term.name),))
        for name, term in zip(("cold", "mild"), terms, strict=True)
    )
    return FuzzySystem(
        "heater",
        (outdoors, wind),
        (output,),
        (RuleBlock(rules, implication="minimum"),),
    )


WARM = "where outdoors < 39"


@pytest.mark.parametrize(
    ("model", "text", "verdict"),
    [
        (GRIP, "class is never soft where force < 2", "PROVED"),
        (GRIP, "class is never soft where force < 5.1", "REFUTED"),
        (GRIP, "class is always firm where slip > 1.5", "PROVED"),
        (GRIP, "every input gets a class", "REFUTED"),
        (GRIP, "every input gets a class where slip <= 0.7", "PROVED"),
        (GRIP, "changing force changes nothing where slip > 1", "PROVED"),
        (GRIP, "changing force changes nothing", "REFUTED"),
        (GRIP, "class rises with force in the order soft, open, firm", "REFUTED"),
        (SHOP, "class is always dear where region is north", "PROVED"),
        (SHOP, "class is never dear where region is east or west", "PROVED"),
        (SHOP, "class is never dear", "REFUTED"),
        (SHOP, "changing region changes nothing where doors = 1", "REFUTED"),
        (SHOP, "every input gets a class where doors > 2", "PROVED"),
        (SHOP, "every input gets a class where doors > 1 and region is east", "REFUTED"),
        (heater(), "heat is at least 10", "REFUTED"),
        (heater(), f"heat is at least 10 {WARM}", "PROVED"),
        (heater(default=10.0), "heat is between 10 and 30", "PROVED"),
        (heater(default=9.0), "heat is at least 10", "REFUTED"),
        (heater(), f"heat is at least 10.1 {WARM}", "REFUTED"),
        (heater(), f"heat falls with outdoors {WARM}", "PROVED"),
        (heater(), "heat falls with outdoors", "OPEN"),
        (heater(), f"heat changes by at most 2.1 per outdoors {WARM}", "PROVED"),
        (heater(), f"heat changes by at most 1.9 per outdoors {WARM}", "REFUTED"),
        (heater(), "changing wind changes nothing", "PROVED"),
        (heater(), "every input gets an output", "REFUTED"),
        (heater(), f"every input gets an output {WARM}", "PROVED"),
        (heater("centroid"), f"heat is between 9.9 and 30.1 {WARM}", "PROVED"),
        (heater("centroid"), f"heat is at most 29 {WARM}", "REFUTED"),
        (heater("bisector"), f"heat is at least 5 {WARM}", "OPEN"),
        (heater("bisector"), f"heat is at least 20 {WARM}", "REFUTED"),
    ],
)  # fmt: skip
def test_a_requirement_has_the_verdict_that_one_works_out(
    model: Document, text: str, verdict: str
) -> None:
    (answer,) = ft.require(model, [text]).answers
    assert answer.verdict == verdict, answer
    assert bool(answer.rows) == (verdict == "REFUTED")


def test_an_open_requirement_names_what_is_not_bounded() -> None:
    (answer,) = ft.require(heater("bisector"), [f"heat is at least 5 {WARM}"]).answers
    expected = "the bisector (middle) of output 'heat' is not bounded"
    assert answer.sentence == expected


def test_rows_have_the_words_of_the_table() -> None:
    (answer,) = ft.require(SHOP, ["class is never dear"]).answers
    head, row, _ = answer.rows.split("\n")
    assert (head, row.split(",")[0]) == ("region,doors", "north")
    assert answer.predictions == ("dear",)


def test_a_smaller_budget_opens_what_a_larger_one_decides() -> None:
    system = ft.load(str(EXAMPLES / "tipper.fll"))
    text = "tip changes by at most 17 per food"
    assert ft.require(system, [text]).ok
    (answer,) = ft.require(system, [text], steps=1000).answers
    assert answer.verdict == "OPEN"
    (again,) = ft.require(system, [text], steps=1000).answers
    assert answer == again


def test_outputs_of_two_systems_are_bounded_on_the_same_boxes() -> None:
    old, new = heater(), heater("centroid")
    base = Base.of_both(old, new, domain_of(old)).fine
    boxes = Boxes.whole(base)
    ends = [
        OutputBounds(base, system, "heat", model=place).numbers(boxes)
        for place, system in enumerate((old, new))
    ]
    assert [round(float(end[0]), 6) for end in ends[0]] == [10.0, 30.0]
    assert ends[1].low[0] <= 10.0 < 30.0 <= ends[1].high[0]
