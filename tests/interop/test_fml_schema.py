"""Our FML files are valid by a schema, and lxml reads out of them what we wrote.

The schema `schemas/fml.xsd` is our own: the one that is published with the standard is
not ours to ship, and no package brings it or an engine that reads FML. It is narrower:
it knows what we write, and asks for what XML's IDs ask for.
"""

from __future__ import annotations

import importlib
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fuzzytree import LearningSettings, learn
from fuzzytree.exporters.fml import write
from fuzzytree.formats.fml.fml_reader import read_fml
from fuzzytree.formats.fml.fml_words import NAMESPACE
from fuzzytree.model.rulebase import Kind
from fuzzytree.semantics import pointed
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree
from tests.exporters.test_fml import random_fml
from tests.formats.test_fml import TIPPER

ROOT = Path(__file__).parents[2]
WINE = ROOT / "examples" / "wine" / "wine.csv"

Need = Callable[[str], str]


@pytest.fixture
def lxml(library: Need) -> Any:
    library("lxml")
    return importlib.import_module("lxml.etree")


def validated(lxml: Any, content: bytes) -> Any:
    """Return the root of a file that is valid, or fail with what is not."""
    schema = lxml.XMLSchema(lxml.parse(str(ROOT / "schemas" / "fml.xsd")))
    root = lxml.fromstring(content)
    schema.assertValid(root)
    return root


@pytest.mark.one_in(4)
@pytest.mark.parametrize("seed", range(40))
def test_systems_are_valid(lxml: Any, seed: int) -> None:
    validated(lxml, write(random_fml(seed)).content)


@pytest.mark.one_in(4)
@pytest.mark.parametrize("kind", ["relative", "raw"])
@pytest.mark.parametrize("seed", range(5))
def test_rules_of_random_trees_are_valid(lxml: Any, seed: int, kind: Kind) -> None:
    rules = rules_from_tree(random_tree(seed), kind)
    validated(lxml, write(rules, allow_loss=True, tolerance=1e-3).content)


@pytest.mark.heavy
@pytest.mark.parametrize("columns", [None, 1])
@pytest.mark.parametrize("kind", ["relative", "raw"])
def test_the_wine_rules_are_valid_and_whole(
    lxml: Any, kind: Kind, columns: int | None
) -> None:
    rules = rules_from_tree(
        learn(
            WINE, target="cultivar", settings=LearningSettings(columns_per_node=columns)
        ),
        kind,
    )
    root = validated(lxml, write(rules, allow_loss=True, tolerance=1e-4).content)
    assert len(root.findall(f".//{{{NAMESPACE}}}tskRule")) == len(rules.rules) + 1
    flat, _ = pointed(rules, 1e-4)
    numbers = {float(point.get("x")) for point in root.iter(f"{{{NAMESPACE}}}point")}
    for variable in flat.variables:
        for term in variable.terms:
            if len(term.shape.values) > 2:  # type: ignore[union-attr]
                assert {*term.shape.values} <= numbers  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('name="service"', 'name="food"', "not a valid value of the atomic type"),
        ("<term>slow", "<term>sl ow", "not a valid value of the atomic type"),
        ('order="1"', 'order="2"', "order"),
        ('weight="0.5"', 'weight="2"', "weight"),
        ('param2="4"', "", "param2"),
    ],
)
def test_the_schema_refuses_what_is_wrong(
    lxml: Any, old: str, new: str, reason: str
) -> None:
    text = TIPPER.replace('name="food" d', 'name="food" type="input" d')
    validated(lxml, text.encode())
    with pytest.raises(lxml.DocumentInvalid, match=reason):
        validated(lxml, text.replace(old, new, 1).encode())


def test_numbers_of_32_bits_change_each_number_by_the_share_that_the_remark_says(
    lxml: Any,
) -> None:
    rules, _ = pointed(rules_from_tree(random_tree(1, combinations=0.0), "raw"), 1e-3)
    written = write(rules)
    assert "up to 6e-8 (2^-24)" in " ".join(written.remarks)
    root = lxml.fromstring(written.content)
    xs = [float(point.get("x")) for point in root.iter(f"{{{NAMESPACE}}}point")]
    assert len(xs) > 100
    for x in xs:
        (single,) = struct.unpack("f", struct.pack("f", x))
        assert abs(single - x) <= 2.0**-24 * abs(x)
    assert read_fml(written.content, "r.fml").model == rules
