"""Programs of others that read or run our files.

`.ci/run` installs them and sets FUZZYTREE_WITNESSES=all: there a missing one is a
failure. Elsewhere its tests are skipped, with the reason.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Callable

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
