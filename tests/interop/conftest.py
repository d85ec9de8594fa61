"""Programs of others that read or run our files.

`.ci/run` installs them and sets FUZZYTREE_WITNESSES=all: there a missing one is a
failure. Elsewhere its tests are skipped, with the reason.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import pytest

Need = Callable[[str], str]


@pytest.fixture
def program() -> Need:
    """Return the path of a program, or skip the test that needs it."""

    def find(name: str) -> str:
        path = shutil.which(name)
        if path is None:
            _missing(f"the program {name} is not installed")
        return path or name

    return find


@pytest.fixture
def library() -> Need:
    """Return the name of a Python module that can be imported, or skip the test."""

    def find(name: str) -> str:
        if importlib.util.find_spec(name) is None:
            _missing(f"the Python module {name} is not installed")
        return name

    return find


@pytest.fixture
def missing() -> Callable[[str], None]:
    """Return a function that skips, or fails, a test for what is not installed."""
    return _missing


def _missing(text: str) -> None:
    if os.environ.get("FUZZYTREE_WITNESSES") == "all":
        pytest.fail(text)
    pytest.skip(text)


@pytest.fixture(scope="module")
def opened() -> Iterator[list[Any]]:
    """Return a list for the one browser of a module, which is closed at the end."""
    found: list[Any] = []
    yield found
    for driver in found:
        driver.quit()


@pytest.fixture
def browser(program: Need, library: Need, opened: list[Any]) -> Any:
    """Return a browser; it is started once, for it takes a second."""
    chromium, driver = program("chromium"), program("chromedriver")
    webdriver = import_module(f"{library('selenium')}.webdriver")
    if not opened:
        options = webdriver.ChromeOptions()
        options.binary_location = chromium
        for word in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage"):
            options.add_argument(word)
        options.set_capability(
            "goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"}
        )
        service = webdriver.ChromeService(driver)
        opened.append(webdriver.Chrome(options=options, service=service))
    return opened[0]
