"""The page of live recognition in a real browser."""

from __future__ import annotations

import dataclasses
import itertools
import json
import queue
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from fuzzytree import table
from fuzzytree.api.verbs import learn
from fuzzytree.tactile.recognition.live import Live, LiveResult
from fuzzytree.tactile.report.page import LivePage
from fuzzytree.tactile.sensor import Cells, Counters, Frame, Sensor
from tests.tactile.replays import first_label

pytestmark = pytest.mark.heavy

EVIL = "<script>alert(1)</script>"
NOTHING = np.zeros((4, 4), np.int64)
SMALL = np.eye(4, dtype=np.int64) * 90
LARGE = np.full((4, 4), 90)
PATIENCE_S = 120.0


class Shown:
    """A source that gives out what a test puts in."""

    def __init__(self) -> None:
        self.counters = Counters()
        self.trouble = ""
        self.sensor = None
        self._begin = time.monotonic()
        self._cells: queue.Queue[Cells | None] = queue.Queue()

    def put(self, cells: Cells | None) -> None:
        """Show a frame; None ends the source."""
        self._cells.put(cells)

    def __iter__(self) -> Iterator[Frame]:
        for number in itertools.count():
            cells = self._cells.get()
            if cells is None:
                return
            self.counters = dataclasses.replace(self.counters, frames=number + 1)
            yield Frame(cells, self.now(), number)

    def now(self) -> float:
        return time.monotonic() - self._begin

    def close(self) -> None:
        self.put(None)


class Seen:
    """Live recognition, its page, and a browser that shows it."""

    def __init__(self, browser: Any, live: Live, source: Shown, page: LivePage) -> None:
        self.browser, self.live, self.source, self.page = browser, live, source, page
        self.answers: list[LiveResult] = []
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        browser.get(page.url)

    def _run(self) -> None:
        self.answers.extend(self.live.answers())

    def show(self, cells: Cells) -> str:
        """Show a frame; return the headline that the recogniser gives it."""
        count = self.live.wait(0, 0.0)
        self.source.put(cells)
        assert self.live.wait(count, PATIENCE_S) == count + 1
        answer = self.live.view().answer
        assert answer is not None
        return first_label(answer)

    def text(self, name: str) -> str:
        return str(self.browser.find_element("id", name).text)

    def until(self, is_so: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE_S
        while not is_so():
            assert time.monotonic() < end, self.text("label")
            time.sleep(0.02)

    def until_text(self, name: str, text: str) -> None:
        self.until(lambda: self.text(name) == text)

    def colours(self) -> int:
        """Return how many different colours the picture has."""
        script = """
            const found = document.getElementById("picture");
            const data = found.getContext("2d")
                .getImageData(0, 0, found.width, found.height).data;
            return new Set(new Uint32Array(data.buffer)).size;
        """
        return int(self.browser.execute_script(script))

    def errors(self) -> list[str]:
        return [entry["message"] for entry in self.browser.get_log("browser")]

    def hosts(self) -> set[str]:
        """Return the hosts that the browser asked for the page's sake."""
        found: set[str] = set()
        for entry in self.browser.get_log("performance"):
            event = json.loads(entry["message"])["message"]
            if event["method"] == "Network.requestWillBeSent":
                url = event["params"]["request"]["url"]
                if not url.startswith("data:"):
                    found.add(url.split("/")[2])
        return found


@pytest.fixture
def seen(browser: Any) -> Iterator[Seen]:
    areas = np.array([[3.0], [4.0], [5.0], [15.0], [16.0], [17.0]])
    labels = ["s", "s", "s", EVIL, EVIL, EVIL]
    tree = learn(table(areas, columns=["area"]), target=labels, name="sizes")
    source: Any = Shown()
    live = Live(tree, Sensor(4, 4), source, "a board", reject=0.05)
    with LivePage(live) as page:
        found = Seen(browser, live, source, page)
        yield found
        source.close()
        browser.get("about:blank")
    browser.get_log("browser"), browser.get_log("performance")


def test_the_label_on_the_page_is_the_recognisers(seen: Seen) -> None:
    assert seen.text("label") == "waiting for the first frame"
    for cells in (SMALL, LARGE, SMALL):
        label = seen.show(cells)
        assert label in ("s", EVIL)
        seen.until_text("label", label)
    seen.show(NOTHING)
    seen.until_text("label", "nothing there")
    middling = NOTHING.copy()
    middling.flat[:10] = 90
    seen.show(middling)
    seen.until_text("label", "none of the known objects")
    assert seen.errors() == []


def test_the_picture_is_not_blank_and_smooth_between_the_cells(seen: Seen) -> None:
    seen.show(SMALL)
    seen.until_text("label", "s")
    smooth = seen.colours()
    seen.browser.find_element("id", "smooth").click()
    assert smooth > seen.colours() >= 2


def test_the_browser_requests_no_other_host(seen: Seen) -> None:
    seen.show(SMALL)
    seen.until_text("label", "s")
    assert seen.hosts() == {seen.page.url.split("/")[2]}
    assert seen.errors() == []


def test_the_page_says_that_the_source_is_gone(seen: Seen) -> None:
    seen.show(SMALL)
    seen.until_text("status", "frames come in")
    seen.source.put(None)
    gone = "the source is gone: no more frames"
    seen.until_text("status", gone)
    seen.page.close()
    time.sleep(0.3)
    assert seen.text("status") == gone


def test_the_page_comes_back_when_live_is_started_anew(seen: Seen) -> None:
    seen.show(SMALL)
    seen.until_text("label", "s")
    seen.source.put(None)
    seen.until_text("status", "the source is gone: no more frames")
    seen.page.close()
    source: Any = Shown()
    source.put(NOTHING)
    source.put(None)
    live = Live(seen.live.recogniser.model, Sensor(4, 4), source, "another board")
    answers = live.answers()
    next(answers)
    with LivePage(live, int(seen.page.url.strip("/").rpartition(":")[2])):
        seen.until_text("source", "another board")


def test_the_page_says_that_the_board_is_silent(seen: Seen) -> None:
    seen.show(SMALL)
    seen.source.trouble = "the board is silent"
    seen.until(lambda: seen.text("status").startswith("the board is silent; no frame"))


def test_the_page_works_by_keyboard(seen: Seen) -> None:
    seen.show(SMALL)
    seen.until_text("label", "s")
    body = seen.browser.find_element("tag name", "body")
    body.send_keys("p")
    pause = seen.browser.find_element("id", "pause")
    assert pause.get_attribute("aria-pressed") == "true"
    seen.show(LARGE)
    seen.until(lambda: seen.text("status").startswith("paused"))
    assert seen.text("label") == "s"
    body.send_keys("p")
    seen.show(LARGE)
    seen.until_text("label", EVIL)


def test_counters_and_latency_are_on_the_page(seen: Seen) -> None:
    seen.source.counters.damaged = 3
    seen.show(SMALL)
    seen.until(lambda: "counted\n1 frames, 3 damaged" in seen.text("facts"))
    assert "frames/s; answer after " in seen.text("facts")


@pytest.mark.parametrize("width", [320, 400, 1280])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_page_fits_the_window(seen: Seen, width: int, theme: str) -> None:
    command = seen.browser.execute_cdp_cmd
    seen.show(LARGE)
    seen.until_text("label", EVIL)
    feature = {"name": "prefers-color-scheme", "value": theme}
    command("Emulation.setEmulatedMedia", {"features": [feature]})
    size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": True}
    command("Emulation.setDeviceMetricsOverride", size)
    script = "return document.documentElement.scrollWidth"
    is_wide = int(seen.browser.execute_script(script)) > width
    command("Emulation.clearDeviceMetricsOverride", {})
    assert not is_wide
