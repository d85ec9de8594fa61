"""What a notebook shows of models and results, with every name escaped."""

from __future__ import annotations

import re
from typing import Any

import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.testing import random_system, random_tree

HOSTILE = "<script>alert(1)</script>"
TREE = random_tree(3, inputs=3)
NAMED = replace(TREE, name=HOSTILE)


@pytest.mark.parametrize(
    "value",
    [
        NAMED,
        ft.rules_from_tree(NAMED),
        replace(random_system(3), name=HOSTILE),
        ft.check(NAMED, runtimes=["native"], settings=ft.CheckSettings(limit=99)),
        ft.audit(NAMED, selection=ft.AuditSelection(select=["FT501"])),
    ],
    ids=lambda value: type(value).__name__,
)
def test_no_name_becomes_markup(value: Any) -> None:
    shown = value._repr_html_()
    assert "<script" not in shown
    assert re.sub(r"<[^>]*>", "", shown).strip()


def test_a_tree_shows_its_outline_and_its_terms() -> None:
    shown = TREE._repr_html_()
    assert shown.startswith("<pre>")
    assert len(shown.splitlines()) > len(TREE.nodes) + len(TREE.leaves)
    assert "\\n" not in shown
    for variable in TREE.variables:
        assert variable.name in shown
        assert all(term.name in shown for term in variable.terms)


def test_rules_and_comparisons_are_tables() -> None:
    rules = ft.rules_from_tree(TREE)
    found = ft.check(
        TREE, rules, runtimes=["native"], settings=ft.CheckSettings(limit=99)
    )
    assert rules._repr_html_().count("<tr>") == 1 + len(rules.rules)
    assert "<table" in found._repr_html_()
