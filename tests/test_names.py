"""Names of functions and variables: verbs and nouns, and no participles or pronouns."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import fuzzytree

ROOT = Path(fuzzytree.__file__).parent


class Bounds(NamedTuple):
    """How many names of a room may be vague.

    Attributes:
        participles: Of 1,000 functions, so many that a participle names.
        vague: Of 100 variables, so many that are called `one`, `found` and the like.
        asked: Names with the word `asked`.
    """

    participles: float = 40.0
    vague: float = 1.0
    asked: int = 0


ROOMS = {
    "auditing/decide": Bounds(),
    "auditing/diff": Bounds(),
    "auditing/findings": Bounds(),
    "auditing/require": Bounds(),
    "rechecking": Bounds(),
}
"""Rooms that were rebuilt; names of other rooms are not judged."""

VAGUE = re.compile("_?(asked|each|found|held|known|one|said|taken|told)")
PARTICIPLE = re.compile(
    ".{2,}(ed|ing)|built|chosen|done|drawn|found|given|gone|grown|held|hidden|kept|known"
    "|made|said|seen|sent|shown|sought|taken|thrown|told|written"
)
PLAIN = re.compile(
    "embed|ending|feed|heading|mapping|missing|need|nothing|reading|ring|seed|setting"
    "|something|speed|spring|string|thing|warning"
)
"""Nouns, verbs and adjectives that end as participles do."""

PREDICATES = ("are", "can", "has", "is", "may", "was")
"""First words of names that may end with a participle: `is_closed`."""


def functions(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name


def variables(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name, ctx=ast.Store()):
                yield name
            case ast.Attribute(attr=name, ctx=ast.Store()) | ast.arg(arg=name):
                yield name
            case ast.ExceptHandler(name=str(name)) | ast.MatchAs(name=str(name)):
                yield name
            case ast.MatchStar(name=str(name)):
                yield name
            case _:
                pass


def is_participle(word: str) -> bool:
    return bool(PARTICIPLE.fullmatch(word)) and not PLAIN.fullmatch(word)


def has_participle(name: str) -> bool:
    """Return whether a function is named by a participle: its first or last word."""
    words = name.strip("_").split("_")
    return words[0] not in PREDICATES and any(map(is_participle, (words[0], words[-1])))


@pytest.mark.parametrize("room", ROOMS)
def test_names_of_a_room_are_verbs_and_nouns(room: str) -> None:
    trees = [ast.parse(path.read_text("utf-8")) for path in (ROOT / room).rglob("*.py")]
    named = [name for tree in trees for name in functions(tree)]
    bound = [name for tree in trees for name in variables(tree)]
    participles = sorted(filter(has_participle, named))
    vague = sorted(name for name in bound if VAGUE.fullmatch(name))
    asked = sorted(name for name in named + bound if "asked" in name.split("_"))
    most = ROOMS[room]
    assert 1000 * len(participles) <= most.participles * len(named), participles
    assert 100 * len(vague) <= most.vague * len(bound), vague
    assert len(asked) <= most.asked, asked


@pytest.mark.parametrize(
    ("name", "is_vague"),
    [
        ("solve", False),
        ("_solved", True),
        ("joined_spans", True),
        ("rows_found", True),
        ("is_closed", False),
        ("side_by_string", False),
    ],
)
def test_a_participle_is_the_first_or_the_last_word(name: str, is_vague: bool) -> None:
    assert has_participle(name) is is_vague
