"""The picture of a row shows the numbers of `run`; names are whole and apart."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.model import (
    Band,
    Conclusion,
    Defuzzifier,
    FuzzySystem,
    Points,
    Proposition,
    Rule,
    RuleBase,
    RuleBlock,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.report import svg_rules
from fuzzytree.report.text import number
from fuzzytree.semantics import answer_of, consequents, infer
from fuzzytree.testing import random_system, random_tree
from tests.report.drawn_texts import assert_apart, texts_of

HOSTILE = "</text><script>alert(1)</script>&\"'"


def words(svg: str) -> list[str]:
    """Return the texts of a picture in order."""
    return [text.words for text in texts_of(svg)]


def titles(svg: str, first: str) -> list[str]:
    """Return what readers of a screen say of the parts that begin with a word."""
    parts = ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}title")
    return [part.text or "" for part in parts if (part.text or "").startswith(first)]


def fan(method: Defuzzifier | None = None) -> FuzzySystem:
    """Return a Mamdani system of one input and three rules."""
    low, high = Points((0.0, 10.0), (1.0, 0.0)), Points((0.0, 10.0), (0.0, 1.0))
    slow = Points((0.0, 10.0, 20.0), (0.0, 1.0, 0.0))
    fast = Points((20.0, 30.0, 40.0), (0.0, 1.0, 0.0))
    rules = (
        SystemRule(Proposition("heat", ("low",)), (Conclusion("speed", "slow"),)),
        SystemRule(Proposition("heat", ("high",)), (Conclusion("speed", "fast"),)),
    )
    output = SystemOutput(
        "speed",
        (Term("slow", slow), Term("fast", fast)),
        0.0,
        40.0,
        method or Defuzzifier("centroid", samples=200),
        "maximum",
        unit="rpm",
    )
    heat = Variable("heat", (Term("low", low), Term("high", high)), "°C", 0.0, 10.0)
    return FuzzySystem(
        "fan", (heat,), (output,), (RuleBlock(rules, implication="minimum"),)
    )


@pytest.mark.parametrize("seed", range(12))
def test_strengths_and_outputs_are_those_of_run(seed: int) -> None:
    system = random_system(seed)
    row = {name: 0.3 + 0.2 * k for k, name in enumerate(system.inputs)}
    svg = ft.draw(system, row=row).svg
    answers = ft.run(system, np.array([[*row.values()]]))
    assert answers.strengths is not None
    ends = [title.split(": ")[0].split()[-1] for title in titles(svg, "rule ")]
    assert ends == [number(value) for value in answers.strengths[:, 0]]
    for output in system.outputs:
        value = number(float(answers[output.name][0]))
        assert f"{output.name} is {value}" in " ".join(words(svg))


@pytest.mark.parametrize("value", [0.0, -1e300, 1e300, 1e-300])
def test_points_are_finite_wherever_the_row_is(value: float) -> None:
    for seed in range(12):
        system = random_system(seed)
        svg = ft.draw(system, row=dict.fromkeys(system.inputs, value)).svg
        assert not re.search(r'="[^"]*\b(nan|inf)\b', svg)


@pytest.mark.parametrize("seed", range(6))
def test_a_tree_is_shown_by_its_relative_rules_and_says_what_run_says(
    seed: int,
) -> None:
    tree = random_tree(seed, leaves=8)
    row = {name: 0.1 * k for k, name in enumerate(tree.inputs)}
    svg = ft.draw(tree, row=row).svg
    rules = ft.rules_from_tree(tree)
    answers = ft.run(rules, np.array([[*row.values()]]), columns=[*row])
    assert answers.strengths is not None
    ends = [title.split(": ")[0].split()[-1] for title in titles(svg, "rule ")]
    assert ends == [number(value) for value in answers.strengths[:, 0]]
    said = f"The class is {answers[0]}, by rule {answers.rule[0]}"
    assert said in " ".join(words(svg))
    assert svg.count('height="0" ') == 0


def test_of_many_variables_cells_have_the_names() -> None:
    terms = (Term("low", Band(high=1.0, right=3.0)),)
    variables = tuple(Variable(f"v{k}", terms) for k in range(9))
    rules = tuple(Rule((Proposition(one.name, ("low",)),), "k") for one in variables)
    many = RuleBase("many", ("k",), variables, rules)
    svg = ft.draw(many, row=dict.fromkeys(many.inputs, 2.0)).svg
    assert [text for text in words(svg) if text.endswith(" is low")] == [
        f"v{k} is low" for k in range(9)
    ]
    assert words(svg).count("0.5") == 18
    assert float(re.findall(r' width="(\d+)', svg)[0]) < 400


def test_degrees_stand_beside_terms_and_areas_reach_up_to_them() -> None:
    svg = ft.draw(fan(), row={"heat": 2.5}).svg
    assert words(svg).count("0.75") == 3  # proposition, conclusion, strength
    assert words(svg).count("0.25") == 3
    areas = re.findall(r'<path d="([^"]+)" class="filled"', svg)
    assert len(areas) == 5  # a proposition and a conclusion of each rule, and all
    heights = [
        [float(dot.split()[1]) for dot in area[1:].split("L")] for area in areas[:4]
    ]
    plots = [max(high) - min(high) for high in heights]
    assert plots == pytest.approx([22.5, 22.5, 7.5, 7.5], abs=0.1)


def test_the_joined_area_is_that_which_is_defuzzified() -> None:
    system = fan()
    own, joined = consequents(system, {"heat": 2.5})["speed"]
    assert [(one.rule, one.term, one.degree) for one in own] == [
        (1, "slow", 0.75),
        (2, "fast", 0.25),
    ]
    area = sum(degree for _, degree in joined)
    centroid = sum(value * degree for value, degree in joined) / area
    answer = infer(system, {"heat": 2.5}).outputs[0]
    assert centroid == pytest.approx(answer)
    assert f"speed = {number(answer)} rpm" in words(
        ft.draw(system, row={"heat": 2.5}).svg
    )


def test_weighted_numbers_are_spikes_as_high_as_their_rules() -> None:
    system = ft.load("examples/tipper.fll")
    svg = ft.draw(system, row={"service": 3, "food": 8}).svg
    assert "cheap: 5" in words(svg)
    spikes = re.findall(r'<line [^>]*y1="([\d.]+)" y2="([\d.]+)" class="line"', svg)
    strengths = answer_of(system, {"service": 3.0, "food": 8.0}).strengths
    high = [float(base) - float(top) for base, top in spikes]
    assert high[:3] == pytest.approx([30 * value for value in strengths], abs=0.1)
    assert consequents(system, {"service": 3.0, "food": 8.0})["tip"][1] == []


def test_a_proposition_about_an_output_is_named_beside_the_strength() -> None:
    system = fan()
    again = SystemRule(Proposition("speed", ("slow",)), (Conclusion("speed", "fast"),))
    blocks = (*system.blocks, RuleBlock((again,), implication="minimum"))
    svg = ft.draw(replace(system, blocks=blocks), row={"heat": 2.5}).svg
    assert "with speed as concluded before" in " ".join(words(svg))


def long_rules(count: int) -> RuleBase:
    """Return a rule base whose names are long and hostile, with so many rules."""
    terms = tuple(
        Term(
            f"term number {k} {HOSTILE}",
            Band(low=k - 0.5, high=k + 0.5, left=k - 2.0, right=k + 2.0),
        )
        for k in range(count)
    )
    name = f"the temperature of the outgoing water {HOSTILE} <b>{'x' * 300}"
    variables = (
        Variable(name, terms, "°C", 0.0, float(count)),
        Variable("b", terms[:2]),
    )
    rules = tuple(
        Rule(
            (Proposition(name, (term.name,)), Proposition("b", (terms[k % 2].name,))),
            f"class {HOSTILE} {k % 7}",
        )
        for k, term in enumerate(terms)
    )
    return RuleBase(
        "long", tuple(f"class {HOSTILE} {k}" for k in range(7)), variables, rules
    )


def test_names_are_whole_apart_and_harmless_at_thirty_rules() -> None:
    rules = long_rules(30)
    row = dict(zip(rules.inputs, (3.3, 0.2), strict=True))
    for picture in (ft.draw(rules, row=row), ft.draw(rules)):
        assert "<script" not in picture.svg
        texts = texts_of(picture.svg)
        assert not any("…" in text.words for text in texts)
        assert_apart(texts)
        whole = "".join(text.words for text in texts).replace(" ", "")
        for variable in rules.variables:
            assert variable.name.replace(" ", "") in whole
            for term in variable.terms:
                assert term.name.replace(" ", "") in whole


def test_a_picture_of_too_many_rules_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(svg_rules, "MOST_RULES", 1)
    with pytest.raises(ValueError, match="at most") as caught:
        ft.draw(fan(), row={"heat": 1.0})
    assert str(caught.value) == (
        "a picture shows at most 1 rules, and fan has 2; draw its terms, or run the row"
    )


def test_a_row_must_fit() -> None:
    for row, message in (
        ({}, "the row has no value of 'heat'"),
        ({"heat": "hot"}, "'heat' cannot be 'hot'; it is a number"),
        (
            {"hat": 1.0},
            "the row has a value of 'hat', which is no input; there is heat "
            "(did you mean 'heat'?)",
        ),
    ):
        with pytest.raises(ValueError, match=r".") as caught:
            ft.draw(fan(), row=row)
        assert str(caught.value) == message


def test_a_row_may_have_columns_that_the_model_does_not_use() -> None:
    picture = ft.draw(fan(), row={"room": "kitchen", "heat": 1.0})
    assert picture == ft.draw(fan(), row={"heat": 1.0})
    assert repr(picture) == f"Picture({len(picture.svg.encode())} bytes)"
