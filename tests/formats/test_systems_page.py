"""The page about fuzzy systems: its example is read, and it names everything."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import msgspec

from fuzzytree.exporters.yaml import write
from fuzzytree.formats.yaml import layout
from fuzzytree.formats.yaml.yaml_reader import read_yaml
from fuzzytree.model import (
    FUNCTIONS,
    ActivationMethod,
    DefuzzifierMethod,
    FuzzySystem,
    Grid,
    Hedge,
    SNorm,
    TNorm,
)
from fuzzytree.semantics.inference import infer

TEXT = (Path(__file__).parents[2] / "docs" / "reference" / "systems.md").read_text(
    "utf-8"
)
[EXAMPLE] = re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL)


def test_the_example_is_a_whole_file_that_comes_back() -> None:
    system = read_yaml(EXAMPLE.encode(), "page").model
    assert isinstance(system, FuzzySystem)
    assert len(system.rules) == 3
    assert read_yaml(write(system).content, "page").model == system
    found = infer(system, {"dirt": 90.0, "load size": 7.0})
    # The second rule holds with 0.8 and soap has 2 * 90 + (minutes - 30) of it,
    # against 0.1 of none.
    minutes, soap = found.outputs
    assert 80.0 < minutes < 95.0
    weight = found.strengths[1]
    assert abs(soap - weight * (180.0 + minutes - 30.0) / (weight + 0.1)) < 1e-9


def test_the_page_names_every_choice() -> None:
    choices = [TNorm, SNorm, Hedge, ActivationMethod, DefuzzifierMethod, Grid]
    for choice in choices:
        for name in get_args(choice):
            assert f"`{name}`" in TEXT, name
    for function in FUNCTIONS:
        if function.isalnum() and function not in ("negate", "not", "and", "or"):
            assert f"`{function}`" in TEXT, function


def test_the_page_names_every_key_of_its_own() -> None:
    records = msgspec.json.schema_components([layout.SystemFile])[1].values()
    pages = msgspec.json.schema_components([layout.RuleBaseFile])[1].values()
    others = {key for record in pages for key in record["properties"]}
    assert len(records) > 10
    for record in records:
        for key in {*record["properties"]} - others:
            assert re.search(rf"\b{re.escape(key)}\b", TEXT), key
