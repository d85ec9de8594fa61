"""The page that runs a model: its facts, its size, and what no name can do to it."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.testing import assert_allclose

import fuzzytree as ft
from fuzzytree.model.rulebase import Rule, RuleBase, Variable
from fuzzytree.report.drawing import axis_of
from fuzzytree.report.what_if import MOST_ROWS, what_if_page
from fuzzytree.testing import random_system, random_tree
from tests.report.page_audits import EVIL, rule_base

_MOST_BYTES = 300_000  # of a page of 100 rules
_NEAR = 0.05  # less than three of the 56 points of a curve


def facts_of(html: str) -> Any:
    """Return what a page knows beside its program."""
    match = re.search(r'id="facts">(.*?)</script>', html, re.DOTALL)
    assert match
    return json.loads(match[1])


def input_of(html: str, name: str) -> Any:
    return next(v for v in facts_of(html)["variables"] if v["name"] == name)


def test_the_page_of_a_hundred_rules_is_small() -> None:
    page = what_if_page(random_tree(0, leaves=100, inputs=8))
    assert len(facts_of(page.html)["rules"]) == 100
    assert len(page.html.encode()) <= _MOST_BYTES


def test_the_same_model_gives_the_same_bytes() -> None:
    assert what_if_page(random_system(2)) == what_if_page(random_system(2))


def test_only_the_pages_own_style_and_scripts_may_run() -> None:
    html = what_if_page(rule_base()).html
    policy = re.search('Content-Security-Policy" content="(.*?)"', html)
    assert policy
    assert policy[1].startswith("default-src 'none'; script-src ")
    for kind, count in (("script", 2), ("style", 1)):
        contents = re.findall(f"<{kind}>(.*?)</{kind}>", html, re.DOTALL)
        digests = [hashlib.sha256(text.encode()).digest() for text in contents]
        words = " ".join(f"'sha256-{base64.b64encode(d).decode()}'" for d in digests)
        assert f"{kind}-src {words};" in policy[1]
        assert len(contents) == count
    assert not re.search(r"https?://(?!www\.w3\.org/)|\bstyle=|\bon[a-z]+=", html)


def test_no_name_becomes_markup() -> None:
    html = what_if_page(rule_base(EVIL[:-2], EVIL[:-2])).html
    assert html.count("</script>") == 3
    assert "<img" not in html
    assert input_of(html, EVIL[:-2])["unit"] == "kPa"


def test_the_ends_of_an_input_are_those_of_its_range() -> None:
    pressure = input_of(what_if_page(rule_base()).html, "pressure")
    assert (pressure["from"], pressure["to"]) == (0.0, 10.0)
    assert (pressure["step"], pressure["start"]) == (0.05, 5.0)


def test_the_ends_of_an_input_without_a_range_are_those_of_its_terms() -> None:
    rules = rule_base()
    inputs = tuple(replace(one, low=None, high=None) for one in rules.variables)
    pressure = input_of(what_if_page(replace(rules, variables=inputs)).html, "pressure")
    assert (pressure["from"], pressure["to"]) == (1.82, 8.18)


def test_the_ends_of_an_input_are_those_of_the_rows_where_there_are_some() -> None:
    values = np.array([[3.0, 4.0, np.nan], [1.0, 1.0, 1.0]])
    page = what_if_page(rule_base(), values)
    pressure, area = (input_of(page.html, name) for name in ("pressure", "area"))
    assert (pressure["from"], pressure["to"]) == (3.0, 4.0)
    assert (area["from"], area["to"]) == (0.5, 1.5)
    assert (pressure["start"], page.rows) == (3.0, 3)
    assert facts_of(page.html)["rows"] == [[3.0, 1.0], [4.0, 1.0], [None, 1.0]]


def test_the_first_rows_of_a_long_table_are_in_the_page() -> None:
    page = what_if_page(rule_base(), np.ones((2, 1000)))
    assert (page.rows, page.total) == (MOST_ROWS, 1000)
    assert facts_of(page.html)["total"] == 1000


def test_categories_and_whole_numbers_are_what_they_are() -> None:
    wood = Variable("wood", categories=("elm", "oak"), missing=-1.0)
    count = Variable("count", low=1.0, high=9.0, is_whole=True)
    rules = RuleBase("some", ("yes",), (wood, count), (Rule((), "yes"),))
    html = what_if_page(rules).html
    assert input_of(html, "wood")["categories"] == ["elm", "oak"]
    assert input_of(html, "wood")["start"] == 0.0
    assert (input_of(html, "count")["step"], input_of(html, "count")["start"]) == (1, 5)


def test_an_input_of_a_tree_that_no_node_tests_is_in_its_page() -> None:
    tree = random_tree(1, combinations=0)
    tree = replace(tree, columns=(), variables=(Variable("idle"), *tree.variables))
    html = what_if_page(tree).html
    assert input_of(html, "idle")["start"] == 0.5
    assert 'const INPUTS = [\n  "idle",' in html


@pytest.mark.parametrize("seed", range(6))
def test_lines_between_the_points_of_a_term_are_near_its_degrees(seed: int) -> None:
    system = random_system(seed)
    facts = facts_of(what_if_page(system).html)["variables"]
    for variable, fact in zip(system.variables, facts, strict=True):
        values = np.linspace(fact["from"], fact["to"], 301)
        curves = {curve.name: curve for curve in axis_of(variable).curves}
        for term in (term for term in fact["terms"] if "points" in term):
            places, degrees = np.array(term["points"]).T
            lines = np.interp(values, places, degrees)
            curve = [*map(curves[term["name"]].degree, values.tolist())]
            assert_allclose(lines, curve, atol=_NEAR)


def test_python_gives_a_page_that_a_notebook_shows() -> None:
    page: Any = ft.page(rule_base())
    assert page.html.startswith("<!doctype html>")
    assert page._repr_html_().startswith('<iframe title="what if"')
    assert facts_of(page.html)["command"] == "fuzzytree why MODEL"
