"""The page that runs a model, in a real browser: its numbers, its keys, its looks."""

from __future__ import annotations

import math
import shlex
import struct
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pandas
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.cli.audit_options import row_of
from fuzzytree.model import Document
from fuzzytree.testing import random_tree
from tests.interop.matrix_models import write_model
from tests.interop.test_audit_page import CONTRAST, FAINT, LARGE, Seen
from tests.report.page_audits import EVIL, rule_base

pytestmark = pytest.mark.heavy

_ROWS = 1000
_WINE = Path(__file__).parents[2] / "examples" / "wine" / "wine.csv"
_SYSTEM = """
Engine: {method}
InputVariable: level
  range: 0 10
  term: low Trapezoid 0 0 2 5
  term: middle Triangle 2 5 8
  term: high Trapezoid 5 8 10 10
InputVariable: flow
  range: -1 1
  term: falling Ramp 0.5 -1
  term: rising Ramp -0.5 1
OutputVariable: power
  range: 0 100
  {output}
RuleBlock:
  conjunction: {conjunction}
  disjunction: Maximum
  implication: {implication}
  activation: General
  rule: if level is low then power is off
  rule: if level is middle and flow is falling then power is half
  rule: if level is middle and flow is rising then power is full with 0.8
  rule: if level is high or flow is very rising then power is full
"""
_MAMDANI = """aggregation: Maximum
  defuzzifier: Centroid 100
  default: nan
  term: off Triangle 0 0 30
  term: half Triangle 20 50 80
  term: full Triangle 70 100 100"""
_TSK = """aggregation: none
  defuzzifier: WeightedAverage TakagiSugeno
  default: nan
  term: off Constant 1
  term: half Linear 2.5 -3 7
  term: full Constant 99"""


def system(output: str, implication: str, conjunction: str) -> Callable[[], Document]:
    """Return what reads a small system."""

    def read() -> Document:
        text = _SYSTEM.format(
            method="pump",
            output=output,
            implication=implication,
            conjunction=conjunction,
        )
        Path("pump.fll").write_text(text)
        return ft.load("pump.fll")

    return read


MODELS: dict[str, Callable[[], Document]] = {
    "tree": lambda: ft.learn(_WINE, target="cultivar", leaves=5),
    "rules": rule_base,
    "mamdani": system(_MAMDANI, "Minimum", "Minimum"),
    "tsk": system(_TSK, "none", "AlgebraicProduct"),
}


def rows_of(model: Document) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return rows at random, a few of them with a missing value."""
    pick = np.random.default_rng(7)
    inputs = [one for one in model.variables if not one.parts]
    ends = [(one.low or 0.0, one.high or 10.0) for one in inputs]
    values = np.array([pick.uniform(*end, _ROWS) for end in ends])
    values[pick.uniform(size=values.shape) < 0.01] = math.nan
    return values


def opened(browser: Any, folder: Path, page: Any) -> Seen:
    place = folder / "model.html"
    page.save(place)
    return Seen(browser, place)


def wait_until(seen: Seen, is_so: Callable[[], bool]) -> None:
    """Wait some seconds at most."""
    wait = import_module("selenium.webdriver.support.ui").WebDriverWait

    def test(_browser: Any) -> bool:
        return is_so()

    wait(seen.browser, 5).until(test)


def bits(numbers: list[float]) -> list[bytes]:
    return [b"NaN" if n != n else struct.pack("d", n) for n in numbers]


@pytest.mark.parametrize("kind", MODELS)
def test_a_page_answers_with_the_bits_of_run(
    kind: str, browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    model = MODELS[kind]()
    values = rows_of(model)
    seen = opened(browser, tmp_path, ft.page(model))
    script = """
        const rows = arguments[0].map((row) => row.map((x) => x ?? NaN));
        const name = JSON.parse(document.getElementById("facts").textContent).name;
        const words = (x) => typeof x === "number" ? String(x) : x;
        return rows.map((row) => {
          const found = fuzzytree[name].answer(row);
          return [found.label ?? null, found.rule ?? 0, found.status,
            ...(found.outputs ?? found.probabilities ?? [])].map(words);
        });
    """
    rows = [[None if x != x else x for x in row] for row in values.T.tolist()]
    answers = seen.run(script, rows)
    numbers = [[float(word) for word in row[3:]] for row in answers]
    frame = pandas.DataFrame(values.T, columns=[*model.inputs])
    result: Any = ft.run(model, frame, with_probabilities=kind == "tree")
    assert [int(row[2]) for row in answers] == result.status.tolist()
    if model.outputs:
        expected = result.values.T.tolist()
    else:
        assert [row[0] for row in answers] == [*result.classes]
        assert [int(row[1]) for row in answers] == result.rule.tolist()
        expected = [[] for _ in rows]
        if result.probabilities is not None:
            expected = result.probabilities.T.tolist()
    assert [*map(bits, numbers)] == [*map(bits, expected)]
    assert seen.errors() == []


def test_a_page_asks_nobody_and_hostile_names_are_words(
    browser: Any, tmp_path: Path
) -> None:
    rules = rule_base(EVIL[:-2], "\u05d0\u05d1 ' \" <i>")
    seen = opened(browser, tmp_path, ft.page(rules, np.array([[4.0, 80.0]] * 3)))
    assert seen.asked() == []
    assert seen.errors() == []
    assert seen.run("return document.images.length") == 0
    assert "<script>alert(1)</script>" in seen.run("return document.body.innerText")


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("wide", [320, 390, 1200])
@pytest.mark.parametrize("kind", MODELS)
def test_a_page_has_no_faint_words_and_never_scrolls_sideways(
    kind: str,
    wide: int,
    theme: str,
    browser: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    seen = opened(browser, tmp_path, ft.page(MODELS[kind]()))
    seen.show(theme, wide=wide)
    assert seen.run("return document.documentElement.scrollWidth") <= wide
    assert seen.run(FAINT, CONTRAST, LARGE) == []


def test_a_row_comes_from_the_address_and_goes_into_it(
    browser: Any, tmp_path: Path
) -> None:
    seen = opened(browser, tmp_path, ft.page(rule_base()))
    seen.browser.get(f"{seen.place.as_uri()}#pressure=2&area=41")
    seen.browser.refresh()
    answer = "return document.getElementById('answer').innerText"
    assert seen.run(answer) == "loose1.000"
    command = "return document.getElementById('command').textContent"
    assert seen.run(command) == "fuzzytree why MODEL --row pressure=2,area=41"
    keys = import_module("selenium.webdriver.common.keys").Keys
    slider = seen.browser.find_element("css selector", "input[type=range]")
    assert slider.get_attribute("aria-label") == "pressure kPa"
    slider.send_keys(keys.END)
    wait_until(seen, lambda: seen.browser.current_url.endswith("10&area=41"))
    assert seen.run(command) == "fuzzytree why MODEL --row pressure=10,area=41"
    assert "no class" in seen.run(answer)


def test_the_command_has_a_row_of_odd_names_in_json(
    browser: Any, tmp_path: Path
) -> None:
    table = tmp_path / "odd.csv"
    lines = [f'{k // 2},"it\'s, b",{k > 20}' for k in range(40)]
    table.write_text("\n".join(['"size, cm",a=b,y', *lines]))
    seen = opened(browser, tmp_path, ft.page(ft.learn(table, target="y"), table))
    command = seen.run("return document.getElementById('command').textContent")
    row = row_of(shlex.split(command)[-1])
    assert row is not None
    assert row["size, cm"] == "0"


def test_categories_are_chosen_by_name_and_a_missing_value_is_replaced(
    browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = write_model("tree categories")
    model = ft.load(path)
    seen = opened(browser, tmp_path, ft.page(path))
    one = next(v for v in model.variables if v.categories)
    word = one.categories[-1]
    seen.browser.get(f"{seen.place.as_uri()}#{quote(one.name)}={quote(word)}")
    seen.browser.refresh()
    command = "return document.getElementById('command').textContent"
    assert f"{one.name}={word}" in seen.run(command)
    box = seen.browser.find_element("css selector", "input[type=checkbox]")
    box.click()
    wait_until(seen, lambda: f"{one.name}=," in seen.run(command))
    assert seen.browser.find_element("css selector", ".missing").text == (
        f"missing (as {one.categories[int(one.missing or 0)]})"
    )
    assert seen.errors() == []


def test_whole_numbers_go_up_by_one(browser: Any, tmp_path: Path) -> None:
    rules = rule_base()
    inputs = tuple(replace(one, is_whole=True) for one in rules.variables)
    seen = opened(browser, tmp_path, ft.page(replace(rules, variables=inputs)))
    keys = import_module("selenium.webdriver.common.keys").Keys
    for kind in ("range", "number"):
        box = seen.browser.find_element("css selector", f"input[type={kind}]")
        box.send_keys(keys.ARROW_UP)
    command = "return document.getElementById('command').textContent"
    wait_until(seen, lambda: seen.run(command).endswith(" pressure=7,area=50"))


def test_a_click_on_the_surface_moves_there(browser: Any, tmp_path: Path) -> None:
    seen = opened(browser, tmp_path, ft.page(rule_base()))
    seen.show(wide=1200)
    plot = seen.browser.find_element("id", "plot")
    seen.run("arguments[0].scrollIntoView()", plot)
    plot.click()
    command = "return document.getElementById('command').textContent"
    wait_until(seen, lambda: "pressure=5,area=50" in seen.run(command))


def test_a_page_names_the_rule_that_decides(browser: Any, tmp_path: Path) -> None:
    table = ft.table(_WINE)
    tree = ft.learn(table, target="cultivar", leaves=5)
    seen = opened(browser, tmp_path, ft.page(tree, table))
    button = seen.browser.find_element("css selector", "[aria-label='Next row']")
    result: Any = ft.run(tree, table)
    words: list[str] = []
    for _ in range(20):
        text = seen.run("return document.getElementById('why').textContent")
        words.append(text.partition(" decides")[0])
        button.click()
        seen.run("update()")
    assert words == [f"Rule {rule}" for rule in result.rule[:20]]


def test_all_that_moves_has_a_name_and_keys_reach_it(
    browser: Any, tmp_path: Path
) -> None:
    tree = random_tree(3, leaves=30)
    seen = opened(browser, tmp_path, ft.page(tree, rows_of(tree).T))
    script = """
        const all = [...document.querySelectorAll("input, select, button")];
        return all.filter((one) => !(one.labels?.length || one.ariaLabel
          || one.textContent.trim())).map((one) => one.outerHTML);
    """
    assert seen.run(script) == []
    button = seen.browser.find_element("css selector", "[aria-label='Next row']")
    before = seen.run("return document.getElementById('command').textContent")
    keys = import_module("selenium.webdriver.common.keys").Keys
    button.send_keys(keys.ENTER)
    text = "return document.getElementById('command').textContent"
    wait_until(seen, lambda: seen.run(text) != before)
