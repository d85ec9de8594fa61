"""What `docs/reference/boards.md` shows is what the reader reads."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from fuzzytree.tactile.board_file import load_board, read_board

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "reference" / "boards.md").read_text("utf-8")
BLOCKS = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_every_file_of_the_page_is_a_board(number: int) -> None:
    read_board(BLOCKS[number].encode(), "boards.md")


def test_the_page_shows_every_family() -> None:
    found = {
        type(read_board(block.encode(), "boards.md").protocol).__name__
        for block in BLOCKS
    }
    assert found == {"Marker", "Sentinel", "Request", "Text"}


def test_the_page_names_every_key_and_every_choice() -> None:
    schema = json.loads((ROOT / "schemas" / "board.schema.json").read_text("utf-8"))
    for part in [schema, *schema["$defs"].values()]:
        for key, value in part["properties"].items():
            assert f"`{key}`" in PAGE, key
            for choice in value.get("enum", ()):
                assert str(choice) in PAGE, choice


def test_the_page_lists_every_example() -> None:
    files = {path.name for path in (ROOT / "examples/tactile/boards").glob("*.yaml")}
    assert set(re.findall(r"`([\w-]+\.yaml)`", PAGE)) == files


def test_the_first_board_of_the_page_is_the_example_with_a_threshold() -> None:
    shown = read_board(BLOCKS[0].encode(), "boards.md")
    board = load_board(ROOT / "examples/tactile/boards/flexitac-12x32.yaml")
    assert (shown.protocol, shown.port) == (board.protocol, board.port)
