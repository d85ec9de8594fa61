"""Every example in a docstring runs and gives what it shows."""

from __future__ import annotations

import doctest
import importlib
import importlib.util
import linecache
import pkgutil
from pathlib import Path

import pytest

import fuzzytree


def _has_examples(module: str) -> bool:
    spec = importlib.util.find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    return ">>> " in Path(spec.origin).read_text("utf-8")


MODULES = [
    module.name
    for module in pkgutil.walk_packages(fuzzytree.__path__, "fuzzytree.")
    if _has_examples(module.name)
]


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_give_what_they_show(name: str) -> None:
    linecache.clearcache()  # or each example looks whether any source file changed
    failed, _ = doctest.testmod(importlib.import_module(name))
    assert failed == 0
