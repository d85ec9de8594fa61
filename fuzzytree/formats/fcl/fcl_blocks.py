"""FCL statements as blocks: variables, terms of a variable, rules."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import msgspec
from lark import Token

from fuzzytree.formats.fcl.fcl_statements import (
    Declaration,
    Ending,
    Header,
    Range,
    RuleText,
    Setting,
    Statement,
    TermText,
    place,
)
from fuzzytree.formats.fcl.fcl_text import ENDINGS, FclText
from fuzzytree.formats.fll.fll_words import Notes
from fuzzytree.model.contracts import Loss

_ALLOWED: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "VAR_INPUT": (),
        "VAR_OUTPUT": (),
        "FUZZIFY": ("ENABLED",),
        "DEFUZZIFY": ("METHOD", "ACCU", "DEFAULT", "ENABLED", "LOCK"),
        "RULEBLOCK": ("AND", "OR", "ACT", "ACCU", "ENABLED"),
    }
)
"""What the settings of each kind of block are."""


class Block(msgspec.Struct, frozen=True):
    """A block: its first line, and what stands in it."""

    head: Header
    statements: list[Statement]

    @property
    def kind(self) -> str:
        """The keyword of the block."""
        return self.head.keyword.type

    @property
    def line(self) -> int:
        """Where the block begins."""
        return place(self.head.keyword)[0]

    @property
    def terms(self) -> tuple[TermText, ...]:
        """Its terms."""
        return tuple(one for one in self.statements if isinstance(one, TermText))

    @property
    def rules(self) -> tuple[RuleText, ...]:
        """Its rules."""
        return tuple(one for one in self.statements if isinstance(one, RuleText))

    def words(self, keyword: str) -> tuple[Token, ...]:
        """Return what the block says about a keyword; nothing if it does not."""
        for one in self.statements:
            if isinstance(one, Setting) and one.keyword.type == keyword:
                return one.words
        return ()

    @property
    def is_disabled(self) -> bool:
        """Whether the file says that it does not count."""
        return any(word.upper() == "FALSE" for word in self.words("ENABLED"))


def raw(tokens: Sequence[Token]) -> str:
    """Return words with a blank where there was one, or more."""
    text, end = "", None
    for one in tokens:
        is_apart = end is not None and one.start_pos != end
        text += (" " if is_apart else "") + str(one)
        end = one.end_pos
    return text


def blocks_of(text: FclText, notes: Notes) -> tuple[str, list[Block]]:
    """Return the name of the first function block, and the blocks within.

    What stands in a wrong place, or is not closed, is noted.
    """
    blocks: list[Block] = []
    heads: list[Header] = []
    current: Block | None = None
    for one in text.statements:
        if isinstance(one, Header):
            if current is not None:
                _note_unclosed(current, one.keyword, notes)
            current = None
            if one.keyword.type == "FUNCTION_BLOCK":
                heads.append(one)
                continue
            current = Block(one, [])
            if len(heads) < 2:
                blocks.append(current)
        elif isinstance(one, Ending):
            wanted = ENDINGS[current.kind] if current else "END_FUNCTION_BLOCK"
            if one.keyword.type != wanted:
                sentence = f"found {str(one.keyword)!r}; expected {wanted}"
                notes.found.append((*place(one.keyword), sentence))
            current = None
        elif current is None:
            sentence = "it stands in no block; expected VAR_INPUT or another block"
            notes.found.append((*place_of(one), sentence))
        else:
            current.statements.append(one)
    if current is not None:
        _note_unclosed(current, text.tokens[-1], notes)
    if not heads:
        notes.found.append((1, 1, "the file has no FUNCTION_BLOCK"))
    if len(heads) > 1:
        what = f"only the first of {len(heads)} function blocks is read"
        notes.losses.append(Loss("the other function blocks", what))
    for block in blocks:
        _check(block, notes)
    return (raw(heads[0].words) if heads else ""), blocks


def _note_unclosed(block: Block, token: Token, notes: Notes) -> None:
    sentence = f"found {str(token)!r}; expected {ENDINGS[block.kind]} before it"
    notes.found.append((*place(token), sentence))


def place_of(one: Statement) -> tuple[int, int]:
    """Return where a statement begins, or the name within it."""
    match one:
        case Declaration(names=names):
            return place(names[0])
        case TermText(name=name):
            return place(name)
        case _:
            return place(one.keyword)


def _check(block: Block, notes: Notes) -> None:
    """Note what cannot stand in a block, or stands twice."""
    seen: set[str] = set()
    for one in block.statements:
        if not _belongs(one, block.kind):
            sentence = f"{_shown(one)} cannot stand in {block.kind}"
            notes.found.append((*place_of(one), sentence))
        elif isinstance(one, Setting):
            if one.keyword.type in seen:
                sentence = f"a second {one.keyword.type} in one block"
                notes.found.append((*place(one.keyword), sentence))
            seen.add(one.keyword.type)


def _belongs(one: Statement, kind: str) -> bool:
    match one:
        case Setting(keyword=keyword):
            return keyword.type in _ALLOWED[kind]
        case TermText():
            return kind in ("FUZZIFY", "DEFUZZIFY")
        case RuleText():
            return kind == "RULEBLOCK"
        case Declaration():
            return kind.startswith("VAR")
        case Range():
            return kind != "RULEBLOCK"
        case _:
            return False


def _shown(one: Statement) -> str:
    match one:
        case Declaration():
            return "a variable"
        case TermText():
            return "TERM"
        case _:
            return one.keyword.upper()
