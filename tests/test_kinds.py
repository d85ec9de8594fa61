"""How often the product asks which kind of model it holds.

A model is its program and its results. Its kind is asked for where a model is read,
mapped to another container, or shown as rules; each such place is counted here, so that
no more of them come without being seen.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
KINDS = {"FuzzyTree", "RuleBase", "FuzzySystem"}
WORDS = {"tree", "rules", "system"}
KIND_NAMES = {"representation", "kind_of"}
MOST = 36


def names(node: ast.AST) -> set[str]:
    """Return the names and attributes in a part of a program."""
    parts = [*ast.walk(node)]
    found = {part.id for part in parts if isinstance(part, ast.Name)}
    return found | {part.attr for part in parts if isinstance(part, ast.Attribute)}


def places(source: str) -> Iterator[int]:
    """Yield the lines at which the kind of a model is asked for."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Call(func=ast.Name(id="isinstance"), args=[_, kind]):
                if names(kind) & KINDS:
                    yield node.lineno
            case ast.Match():
                patterns = [part for case in node.cases for part in ast.walk(case)]
                classes = [p.cls for p in patterns if isinstance(p, ast.MatchClass)]
                if any(names(cls) & KINDS for cls in classes):
                    yield node.lineno
            case ast.Compare():
                parts = [
                    part
                    for side in (node.left, *node.comparators)
                    for part in ast.walk(side)
                ]
                words = {p.value for p in parts if isinstance(p, ast.Constant)}
                if words & WORDS and names(node) & KIND_NAMES:
                    yield node.lineno


def test_few_places_ask_for_the_kind_of_a_model() -> None:
    counts: Counter[str] = Counter()
    for folder in (ROOT / "fuzzytree", ROOT / "exporters"):
        for path in sorted(folder.rglob("*.py")):
            relative = path.relative_to(ROOT)
            if relative.parts[:2] == ("fuzzytree", "exporters"):  # a link
                continue
            count = len([*places(path.read_text("utf-8"))])
            counts[str(relative)] += count
    assert counts.total() <= MOST, counts.most_common(20)


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ("isinstance(model, FuzzyTree)", 1),
        ("isinstance(model, RuleBase | FuzzySystem)", 1),
        ("match model:\n    case FuzzyTree():\n        pass", 1),
        ("kind_of(model) == 'system'", 1),
        ("model.outputs and isinstance(term, Band)", 0),
        ("section.kind == 'rules'", 0),
    ],
)
def test_places_are_recognized(source: str, count: int) -> None:
    assert len([*places(source)]) == count
