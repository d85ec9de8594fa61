"""The page of an audit in a real browser: from a file, in every light, and on paper."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from fuzzytree.report.audit_page import page
from tests.report.page_audits import EVIL, answers, audit_of, rows_of, rule_base

pytestmark = pytest.mark.heavy

CONTRAST = 4.5  # of small letters, after the guidelines for accessible pages
LARGE = 3.0  # of large letters, and of what is drawn


class Seen:
    """A page in a browser."""

    def __init__(self, browser: Any, place: Path) -> None:
        self.browser, self.place = browser, place
        self.open()

    def open(self) -> None:
        """Load the page anew."""
        self.browser.get("about:blank")
        self.browser.get_log("browser"), self.browser.get_log("performance")
        self.browser.get(self.place.as_uri())

    def run(self, script: str, *arguments: object) -> Any:
        return self.browser.execute_script(script, *arguments)

    def command(self, name: str, **arguments: object) -> Any:
        return self.browser.execute_cdp_cmd(name, arguments)

    def errors(self) -> list[str]:
        return [entry["message"] for entry in self.browser.get_log("browser")]

    def asked(self) -> list[str]:
        """Return what the page asked for, itself left out."""
        urls: list[str] = []
        for entry in self.browser.get_log("performance"):
            event = json.loads(entry["message"])["message"]
            if event["method"] == "Network.requestWillBeSent":
                urls.append(event["params"]["request"]["url"])
        own = self.place.as_uri()
        return [url for url in urls if url not in (own, "about:blank")]

    def show(
        self, theme: str = "light", media: str = "screen", wide: int = 1280
    ) -> None:
        feature = {"name": "prefers-color-scheme", "value": theme}
        self.command("Emulation.setEmulatedMedia", media=media, features=[feature])
        self.command(
            "Emulation.setDeviceMetricsOverride",
            width=wide,
            height=900,
            deviceScaleFactor=1,
            mobile=wide < 700,
        )


@pytest.fixture
def seen(browser: Any, tmp_path: Path) -> Iterator[Seen]:
    """Return the page of a hostile audit in a browser."""
    rules = rule_base("pressure", EVIL[:-2])  # a name has no control characters
    place = tmp_path / "audit.html"
    place.write_text(page(audit_of(rules), rules, rows=rows_of(rules)), "utf-8")
    found = Seen(browser, place)
    yield found
    for name, arguments in (
        ("Emulation.setScriptExecutionDisabled", {"value": False}),
        ("Emulation.clearDeviceMetricsOverride", {}),
        ("Emulation.setEmulatedMedia", {"media": "", "features": []}),
    ):
        found.browser.execute_cdp_cmd(name, arguments)


def test_the_page_loads_from_a_file_asks_nobody_and_has_no_error(seen: Seen) -> None:
    assert seen.asked() == []
    assert seen.errors() == []
    assert seen.run("return document.scripts.length") == 1
    assert seen.run("return document.images.length") == 0
    text = seen.run("return document.body.innerText")
    assert "1 error, 1 warning, 2 notes" in text
    assert "<script>alert(1)</script>" in text


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("wide", [320, 700, 1280])
def test_the_page_scrolls_down_and_never_sideways(
    seen: Seen, wide: int, theme: str
) -> None:
    seen.show(theme, wide=wide)
    unfold = "document.querySelectorAll('details').forEach((one) => one.open = true);"
    script = f"{unfold} return document.documentElement.scrollWidth"
    assert seen.run(script) <= wide


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_all_words_stand_out_from_what_is_behind_them(seen: Seen, theme: str) -> None:
    seen.show(theme)
    faint = seen.run(FAINT, CONTRAST, LARGE)
    assert faint == []


FAINT = r"""
const [least, large] = arguments;
const parts = (colour) => {
  const found = colour.match(/[\d.]+/g).map(Number);
  return found.length === 3 ? [...found, 1] : found;
};
const over = (top, below) =>
  [0, 1, 2].map((k) => top[k] * top[3] + below[k] * (1 - top[3]));
const light = (rgb) => {
  const [r, g, b] = rgb.map((one) => one / 255)
    .map((one) => one <= 0.04045 ? one / 12.92 : ((one + 0.055) / 1.055) ** 2.4);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const behind = (node) => {
  const layers = [];
  for (let one = node; one; one = one.parentElement) {
    layers.push(parts(getComputedStyle(one).backgroundColor));
  }
  return layers.reverse().reduce((below, top) => over(top, below), [255, 255, 255]);
};
document.querySelectorAll("details").forEach((one) => one.open = true);
const faint = new Set();
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const node = walker.currentNode.parentElement;
  if (!walker.currentNode.textContent.trim()) continue;
  if (node.closest("script, style, title, desc, .on-map, .skip")) continue;
  const style = getComputedStyle(node);
  const is_drawn = node instanceof SVGElement;
  const ink = over(parts(is_drawn ? style.fill : style.color), behind(node));
  const [a, b] = [light(ink), light(behind(node))];
  const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  const is_large = parseFloat(style.fontSize) >= 24;
  if (contrast < (is_large ? large : least)) {
    faint.add(`${node.textContent.slice(0, 40)}: ${contrast.toFixed(2)}`);
  }
}
return [...faint];
"""


def test_the_page_works_by_keyboard(seen: Seen) -> None:
    keys = import_module("selenium.webdriver.common.keys").Keys
    seen.show()
    chain = import_module("selenium.webdriver.common.action_chains").ActionChains

    def press(*pressed: str) -> Any:
        for key in pressed:
            chain(seen.browser).send_keys(key).perform()
        return seen.browser.switch_to.active_element

    first = press(keys.TAB)
    assert first.text == "Skip to the content"
    assert first.rect["x"] >= 0
    outline = "return getComputedStyle(document.activeElement).outlineStyle"
    assert seen.run(outline) == "solid"
    assert press(keys.ENTER).get_attribute("id") == "main"
    reached: list[str] = []
    for _ in range(60):
        one = press(keys.TAB)
        reached.append(one.tag_name)
        if one.tag_name == "summary":
            break
    assert reached[-1] == "summary"
    fold = "return document.activeElement.parentElement.open"
    assert seen.run(fold) is False
    press(keys.ENTER)
    assert seen.run(fold) is True


def test_a_link_to_a_folded_finding_unfolds_it(browser: Any, tmp_path: Path) -> None:
    gap = next(one for one in answers() if one.code == "FT301")
    gaps = tuple(replace(gap, id=f"FT301-{k}", sentence=f"gap {k}") for k in range(5))
    rules = rule_base()
    place = tmp_path / "folded.html"
    place.write_text(page(audit_of(rules, gaps), rules), "utf-8")
    seen = Seen(browser, place)
    fold = "return document.querySelector('#FT301-4 > details').open"
    assert seen.run(fold) is False
    seen.run("location.hash = 'FT301-4'")
    seen.run("dispatchEvent(new HashChangeEvent('hashchange'))")
    assert seen.run(fold) is True
    assert seen.errors() == []


def test_a_table_is_sorted_by_its_head(seen: Seen) -> None:
    seen.show()
    column = "#rules tbody tr td:nth-child(3)"
    script = (
        f"return [...document.querySelectorAll('{column}')].map((c) => c.innerText)"
    )
    assert seen.run(script) == ["40", "31", "22", "3"]
    button = seen.browser.find_element("css selector", "#rules th:nth-child(3) button")
    seen.run("arguments[0].click()", button)
    assert seen.run(script) == ["3", "22", "31", "40"]
    head = seen.browser.find_element("css selector", "#rules th:nth-child(3)")
    assert head.get_attribute("aria-sort") == "ascending"
    seen.run("arguments[0].click()", button)
    assert seen.run(script) == ["40", "31", "22", "3"]
    assert seen.errors() == []


def test_without_its_script_the_page_has_the_same_words(seen: Seen) -> None:
    seen.show()
    words = "return document.querySelector('main').innerText.replace(/\\s+/g, ' ')"
    with_script = seen.run(words)
    seen.command("Emulation.setScriptExecutionDisabled", value=True)
    seen.open()
    found = seen.command(
        "Runtime.evaluate", expression=words.removeprefix("return "), returnByValue=True
    )
    assert found["result"]["value"] == with_script
    buttons = seen.command(
        "Runtime.evaluate",
        expression="document.querySelectorAll('thead button').length",
        returnByValue=True,
    )
    assert buttons["result"]["value"] == 0


@pytest.mark.parametrize("has_script", [True, False])
def test_on_paper_all_is_unfolded_and_light(seen: Seen, *, has_script: bool) -> None:
    seen.command("Emulation.setScriptExecutionDisabled", value=not has_script)
    seen.open()
    seen.show("dark", "print", wide=760)
    script = """(() => [
      getComputedStyle(document.body).backgroundColor,
      getComputedStyle(document.querySelector("nav")).display,
      [...document.querySelectorAll("details > :not(summary)")]
        .filter((one) => one.getBoundingClientRect().height === 0).length,
    ])()"""
    found = seen.command("Runtime.evaluate", expression=script, returnByValue=True)
    assert found["result"]["value"] == ["rgb(255, 255, 255)", "none", 0]
    made = seen.command("Page.printToPDF", printBackground=True)
    content = base64.b64decode(made["data"])
    assert content.startswith(b"%PDF-")
    pages = max(map(int, re.findall(rb"/Count (\d+)", content)))
    assert 4 <= pages <= 20
