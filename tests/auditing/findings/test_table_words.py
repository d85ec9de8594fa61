"""No audit, diff or text shows a value that no row of the table can have."""

from __future__ import annotations

import datetime
import json
import random
import re
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.auditing import AuditDomain, AuditSelection
from fuzzytree.auditing.findings.domains import domain_of, read_value
from fuzzytree.auditing.findings.support import sample_points
from fuzzytree.model import DATE_UNIT, FuzzyTree, RuleBase, Variable
from fuzzytree.report import audit_lines, diff_lines, page
from fuzzytree.semantics import rules_from_tree

CITIES = ("Bern", "Oslo", "Rom", "Wien")
FIRST = datetime.date(2024, 1, 1)
ROW = {"city": "Rom", "day": "2024-03-01", "doors": "3", "member": "True", "mass": "4"}
NUMBERS = {
    "day": set(range(19700, 20000)),
    "doors": set(range(1, 9)),
    "member": {-1, 0, 1},
    "city": {-1, 0, 1, 2, 3},
}
WORDS = {
    "day": r"missing|2024-\d\d-\d\d( to 2024-\d\d-\d\d)?",
    "doors": r"missing|[1-8]( to [1-8])?",
    "member": r"(False|True|missing)(( or |, )(False|True|missing))*",
    "city": rf"({'|'.join(CITIES)}|missing)(( or |, )({'|'.join(CITIES)}|missing))*",
}


def table(path: Path) -> Path:
    """Write a table of dates, whole numbers, truth values, categories and gaps."""
    draw = random.Random(1)
    lines = ["day,doors,member,city,mass,label"]
    for _ in range(240):
        day = FIRST + datetime.timedelta(draw.randrange(200))
        doors, is_member = draw.randrange(1, 9), draw.random() < 0.5
        city, mass = draw.choice(CITIES), round(draw.uniform(1, 9), 2)
        label = "b" if mass > 5 else "c"
        if (city in CITIES[:2] and doors > 4) or (is_member and day.month > 3):
            label = "a"
        cells = [day, doors, is_member, city, mass]
        shown = ["" if draw.random() < 0.1 else str(cell) for cell in cells]
        lines.append(",".join([*shown, label]))
    path.write_text("\n".join(lines), "utf-8")
    return path


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> FuzzyTree:
    path = table(tmp_path_factory.mktemp("table") / "t.csv")
    settings = ft.LearningSettings(columns_per_node=1, leaves=5)
    return ft.learn(str(path), target="label", settings=settings)


def models(tree: FuzzyTree) -> dict[str, FuzzyTree | RuleBase]:
    relative = rules_from_tree(tree)
    fewer = replace(relative, rules=relative.rules[:-3], kind="")
    return {"tree": tree, "raw": rules_from_tree(tree, "raw"), "fewer": fewer}


def records(value: Any) -> Iterator[dict[str, Any]]:
    if isinstance(value, dict):
        yield value
    parts = value.values() if isinstance(value, dict) else value
    if isinstance(value, dict | list):
        for part in parts:
            yield from records(part)


def wrong_values(facts: Any) -> list[Any]:
    """Return the records of a JSON that hold a value which no row can have."""
    result: list[Any] = []
    for one in records(facts):
        name = one.get("input", one.get("variable"))
        if name not in NUMBERS:
            continue
        values = [one[key] for key in ("low", "high") if one.get(key) is not None]
        values += [one["exact"]] if "exact" in one else []
        is_right = {Fraction(value) for value in values} <= NUMBERS[name]
        is_right &= re.fullmatch(WORDS[name], one.get("word", "missing")) is not None
        if not is_right:
            result.append(one)
    return result


def wrong_words(text: str) -> list[str]:
    """Return the places of a text that show another value of an input."""
    flat, result = " ".join(text.split()), list[str]()
    for name, words in WORDS.items():
        for match in re.finditer(rf"'{name}' is (?!hardly|empty)|\b{name} = ", flat):
            if not re.match(rf"({words})\b", flat[match.end() :]):
                result.append(flat[match.start() : match.end() + 30])
    return result


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["tree", "raw", "fewer"])
def test_an_audit_shows_values_of_rows_alone(tree: FuzzyTree, name: str) -> None:
    model = models(tree)[name]
    result = ft.audit(
        model,
        domain=AuditDomain(row={name: ROW[name] for name in model.inputs}),
        selection=AuditSelection(skip=["FT6"]),
    )
    text = "\n".join(audit_lines(result, [], is_verbose=True, is_whole=True))
    assert wrong_values(json.loads(result.to_json())) == []
    assert wrong_words(text) == []
    assert wrong_words(page(result, model)) == []
    assert "city" in text


@pytest.mark.heavy
def test_a_diff_shows_values_of_rows_alone(tree: FuzzyTree) -> None:
    other = models(tree)["fewer"]
    result = ft.diff(rules_from_tree(tree), other)
    assert wrong_values(json.loads(result.to_json())) == []
    assert wrong_words("\n".join(diff_lines(result, is_verbose=True))) == []


def test_drawn_points_are_values_of_rows(tree: FuzzyTree) -> None:
    rules = rules_from_tree(tree)
    points = sample_points(rules, domain_of(tree), 500, 1)
    for name, values in zip(rules.inputs, points, strict=True):
        drawn = set(np.unique(values).tolist())
        assert drawn <= NUMBERS.get(name, drawn)
        assert len(drawn) > 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Paris", "'city' cannot be 'Paris'; it is one of 'Bern', 'Rom'"),
        ("", "'city' cannot be ''; it is one of 'Bern', 'Rom'"),
    ],
)
def test_a_word_of_no_category_is_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=f"^{message}$"):
        read_value(Variable("city", categories=("Bern", "Rom")), text)


def test_words_are_read_as_the_table_is() -> None:
    member = Variable("member", categories=("False", "True"), missing=-1.0)
    day = Variable("day", unit=DATE_UNIT)
    assert [read_value(member, one) for one in ("true", "", "missing")] == [1, -1, -1]
    assert [read_value(day, one) for one in ("1970-01-02", "5")] == [1, 5]
    assert read_value(Variable("mass", unit="kg"), "3 kg") == 3
    with pytest.raises(ValueError, match="it is a date such as 2024-03-01"):
        read_value(day, "tomorrow")
