"""The page about the YAML file: its examples are read, its limits are true."""

from __future__ import annotations

import re
from pathlib import Path

import msgspec

from fuzzytree.formats import text_files
from fuzzytree.formats.yaml import layout, nodes
from fuzzytree.formats.yaml.binding import bind
from fuzzytree.formats.yaml.conditions import parse_condition
from fuzzytree.formats.yaml.nodes import ListNode, MappingNode, Node, Scalar, compose
from fuzzytree.formats.yaml.yaml_reader import read_yaml
from fuzzytree.model.rulebase import Proposition, RuleBase

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "yaml-format.md"
TEXT = PAGE.read_text("utf-8")
BLOCKS = re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL)


def items(block: str, key: str = "") -> tuple[Node, ...]:
    """Return the items of a block's list, or of the list under a key."""
    node, found = compose(block.encode(), "page")
    assert not found
    if isinstance(node, MappingNode):
        pairs = node.pairs
        node = next(v for k, v in pairs if isinstance(k, Scalar) and k.text == key)
    assert isinstance(node, ListNode)
    return node.items


def test_the_first_example_is_a_whole_file() -> None:
    rules = read_yaml(BLOCKS[0].encode(), "page").model
    assert isinstance(rules, RuleBase)
    assert len(rules.rules) == 3


def test_every_other_example_fits_the_layout() -> None:
    _, size, island, points, sentences, rated, nodes_and_leaves, sets = BLOCKS
    bound: list[tuple[Node, type[layout.FileRecord]]] = [
        *((item, layout.VariableOfModel) for item in items(size)),
        *((item, layout.VariableOfModel) for item in items(island)),
        *((item, layout.TermOfVariable) for item in items(points)),
        *((item, layout.RuleOfModel) for item in items(rated, "rules")),
        *((item, layout.NodeOfTree) for item in items(nodes_and_leaves, "nodes")),
        *((item, layout.End) for item in items(nodes_and_leaves, "leaves")),
        *((item, layout.SetsOfVariable) for item in items(sets, "sets")),
    ]
    found: list[text_files.FileMistake] = []
    for item, kind in bound:
        assert bind(item, kind, found) is not None
    assert found == []
    texts = [item.text for item in items(sentences) if isinstance(item, Scalar)]
    assert [*map(parse_condition, texts)] == [
        Proposition("black or white", ("not white", "grey"), ("not",))
    ]


def test_the_page_states_the_limits_of_the_code() -> None:
    text = " ".join(TEXT.split())
    assert f"more than {nodes.MOST_BYTES // 2**20} MiB" in text
    assert f"{nodes.MOST_NODES:,} entries or {nodes.MOST_LEVELS} levels" in text
    assert f"names of more than {text_files.LONGEST_NAME:,} and" in text
    assert f"sentences of more than {layout.LONGEST_SENTENCE:,} characters" in text


def test_the_page_names_every_key() -> None:
    files = [layout.RuleBaseFile, layout.TreeFile]
    records = msgspec.json.schema_components(files)[1].values()
    assert len(records) > 14
    for record in records:
        for name in record["properties"]:
            assert re.search(rf"\b{re.escape(name)}\b", TEXT), name
