"""The documentation as a reader sees it: built, served and opened in a real browser."""

from __future__ import annotations

import functools
import http.server
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.heavy

ROOT = Path(__file__).resolve().parents[2]
SEARCH_RESULT = ".md-search-result__item > a"


class _Silent(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format: str, *_: object) -> None:
        """Print no line for each request."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Return the address of the documentation, which is built once."""
    pytest.importorskip("mkdocs")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-d"]
    subprocess.run([*command, str(folder)], cwd=ROOT, check=True, capture_output=True)
    handler = functools.partial(_Silent, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_the_copy_button_of_a_session_copies_its_commands(
    browser: Any, site: str
) -> None:
    browser.execute_cdp_cmd(
        "Browser.grantPermissions",
        {"origin": site, "permissions": ["clipboardReadWrite"]},
    )
    browser.get(f"{site}/tutorials/audit/")
    button = "div.highlight[data-copy] button"  # a script adds it
    _soon(lambda: browser.find_elements("css selector", button))[0].click()
    copied = browser.execute_async_script(
        "navigator.clipboard.readText().then(arguments[0])"
    )
    lines = (ROOT / "docs/tutorials/audit.md").read_text("utf-8").splitlines()
    start = lines.index("```console")
    session = lines[start : lines.index("```", start)]
    assert copied.splitlines() == [
        line.removeprefix("$ ") for line in session if line.startswith("$ ")
    ]


@pytest.mark.parametrize(
    ("words", "page"),
    [
        ("why", "how-to/explain-one-decision/"),
        ("counterfactual", "how-to/explain-one-decision/"),
        ("install", "how-to/install/"),
        ("what-if", "how-to/what-if-page/"),
        ("notebook", "how-to/use-results-in-python/"),
        ("microcontroller", "reference/c/"),
        ("missing values", "how-to/everyday-tables/"),
        ("dead rule", "reference/findings/"),
        ("compare tools", "alternatives/"),
        ("learn", "tutorials/first-model/"),
        ("audit", "how-to/audit/"),
        ("export", "reference/formats/"),
    ],
)
def test_the_search_names_the_right_page_first(
    browser: Any, site: str, words: str, page: str
) -> None:
    browser.get(f"{site}/?q={words.replace(' ', '+')}")
    links = _soon(lambda: browser.find_elements("css selector", SEARCH_RESULT))
    assert links[0].get_attribute("href").split("?")[0] == f"{site}/{page}"


def _soon(result: Callable[[], Any], *, seconds: float = 20) -> Any:
    """Return the first true result: scripts of the page take their time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if value := result():
            return value
        time.sleep(0.1)
    raise AssertionError("nothing came in time")
