"""What we write as SARIF fits the schema that Microsoft ships for SARIF 2.1.0."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import pytest

import fuzzytree as ft
from fuzzytree.report.sarif import sarif_text
from fuzzytree.testing import random_tree
from tests.cli.test_audit_surroundings import NAMES, hostile
from tests.report.audits import every_state

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "@microsoft/jest-sarif"
SCHEMA = f"build/sarif/node_modules/{PACKAGE}/lib/schemas/sarif-2.1.0-rtm.5.json"


@pytest.fixture
def validate(missing: Callable[[str], None]) -> Callable[[str], None]:
    """Return a function that refuses what is no SARIF."""
    path = ROOT / SCHEMA
    if not path.is_file():
        missing(f"npm install --prefix build/sarif {PACKAGE} was not run")
    schema: Any = json.loads(path.read_text("utf-8"))
    checker = jsonschema.validators.validator_for(schema)(schema)

    def check(text: str) -> None:
        checker.validate(json.loads(text))

    return check


def test_every_state_is_sarif_with_and_without_a_baseline(
    validate: Callable[[str], None],
) -> None:
    known = {"FT301-00000003": "a gap", "FT401-00000009": ""}
    validate(sarif_text(every_state()))
    validate(sarif_text(every_state("grün b#\n.yaml", "said\n*'<>"), known))


def test_an_audit_of_a_model_is_sarif(validate: Callable[[str], None]) -> None:
    found = ft.audit(
        random_tree(2), selection=ft.AuditSelection(select=["FT1", "FT4", "FT5"])
    )
    validate(sarif_text(found, {}))


def test_hostile_names_are_sarif(validate: Callable[[str], None]) -> None:
    for name in NAMES.values():
        validate(
            sarif_text(
                ft.audit(
                    hostile(name), selection=ft.AuditSelection(select=["FT1", "FT4"])
                ),
                {"FT101-0": name},
            )
        )


def test_the_schema_refuses_what_is_none(validate: Callable[[str], None]) -> None:
    broken = sarif_text(every_state()).replace('"level": "error"', '"level": "grave"')
    with pytest.raises(jsonschema.ValidationError):
        validate(broken)
