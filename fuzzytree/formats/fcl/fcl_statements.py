"""The statements of FCL as values, and the grammar that makes them."""

from __future__ import annotations

import functools
import itertools
import re
from collections.abc import Iterable, Iterator
from importlib import resources
from typing import Any, Literal

import msgspec
from lark import Lark, Token, Transformer

Connective = Literal["and", "or"]


class Asked(msgspec.Struct, frozen=True, gc=False):
    """`variable is word ... word`: hedges and a label."""

    variable: Token
    verb: Token
    words: tuple[Token, ...]


class Joined(msgspec.Struct, frozen=True):
    """Conditions that AND or OR joins."""

    connective: Connective
    parts: tuple[Asked | Joined | Negated, ...]
    is_grouped: bool = False


class Negated(msgspec.Struct, frozen=True):
    """NOT in front of a condition."""

    part: Asked | Joined | Negated


Condition = Asked | Joined | Negated


class Header(msgspec.Struct, frozen=True):
    """The first line of a block."""

    keyword: Token
    words: tuple[Token, ...]


class Ending(msgspec.Struct, frozen=True):
    """The last line of a block."""

    keyword: Token


class Declaration(msgspec.Struct, frozen=True):
    """Variables and their type."""

    names: tuple[Token, ...]
    kind: Token


class Range(msgspec.Struct, frozen=True):
    """The range of a variable."""

    keyword: Token
    low: Token
    high: Token


class Setting(msgspec.Struct, frozen=True):
    """A keyword and the words that it is set to."""

    keyword: Token
    words: tuple[Token, ...]


class TermText(msgspec.Struct, frozen=True):
    """A term: its name, and the tokens of its curve."""

    name: Token
    kind: Literal["number", "points", "shape"]
    tokens: tuple[Token, ...]


class RuleText(msgspec.Struct, frozen=True):
    """A rule; `has_comma` tells whether `,` joins its conclusions."""

    keyword: Token
    label: tuple[Token, ...]
    condition: Condition
    conclusions: tuple[Asked, ...]
    weight: Token | None
    is_grouped: bool
    has_comma: bool


Statement = Header | Ending | Declaration | Range | Setting | TermText | RuleText


def place(token: Token) -> tuple[int, int]:
    """Return the line and column of a token, from 1."""
    return token.line or 1, token.column or 1


@functools.cache
def grammar() -> Lark:
    """Return the parser of statements; its lexer makes words of all keywords."""
    path = resources.files("fuzzytree.formats.fcl").joinpath("fcl.lark")
    return Lark(
        path.read_text("utf-8"), parser="lalr", lexer="basic", transformer=_Statements()
    )


class _Statements(Transformer[Token, Any]):
    """Makes the values above of what the grammar finds, from the inside out."""

    def start(self, children: list[Any]) -> Statement:
        only: Statement = children[0]
        return only

    def header(self, children: list[Token]) -> Header:
        return Header(children[0], tuple(children[1:]))

    def ending(self, children: list[Token]) -> Ending:
        return Ending(children[0])

    def declaration(self, children: list[Token]) -> Declaration:
        words = [one for one in children if one.type == "WORD"]
        return Declaration(tuple(words[:-1]), words[-1])

    def range(self, children: list[Token]) -> Range:
        low, high = _words(children)
        return Range(children[0], low, high)

    def setting(self, children: list[Token]) -> Setting:
        return Setting(children[0], _words(children[1:]))

    def default(self, children: list[Token]) -> Setting:
        return Setting(children[0], _words(children[1:]))

    def lock(self, children: list[Token]) -> Setting:
        return Setting(children[0], _words(children[1:]))

    def number(self, children: list[Token]) -> tuple[str, tuple[Token, ...]]:
        return "number", tuple(children)

    def points(
        self, children: list[tuple[Token, ...]]
    ) -> tuple[str, tuple[Token, ...]]:
        return "points", tuple(itertools.chain.from_iterable(children))

    def point(self, children: list[Token]) -> tuple[Token, ...]:
        if children[0].type == "POINT":
            return _words(_parts(children[0]))
        return _words(children)

    def shape(self, children: list[Token]) -> tuple[str, tuple[Token, ...]]:
        parts = (_parts(one) if one.type == "POINT" else (one,) for one in children)
        return "shape", tuple(itertools.chain.from_iterable(parts))

    def term(self, children: list[Any]) -> TermText:
        kind, tokens = children[-1]
        return TermText(children[1], kind, tokens)

    def label(self, children: list[Token]) -> tuple[Token, ...]:
        return tuple(children)

    def weight(self, children: list[Token]) -> Token:
        return children[-1]

    def clause(self, children: list[Token]) -> Asked:
        return Asked(children[0], children[1], tuple(children[2:]))

    def condition(self, children: list[Any]) -> Joined:
        return Joined("or", tuple(one for one in children if not _is_token(one)))

    def both(self, children: list[Any]) -> Joined:
        return Joined("and", tuple(one for one in children if not _is_token(one)))

    def part(self, children: list[Any]) -> Condition:
        (inner,) = (one for one in children if not _is_token(one))
        if isinstance(inner, Joined):
            return Joined(inner.connective, inner.parts, is_grouped=True)
        only: Condition = inner
        return only

    def negation(self, children: list[Any]) -> Negated:
        return Negated(children[-1])

    def conclusions(self, children: list[Any]) -> tuple[list[Any], bool, bool]:
        """Return the conclusions, whether `,` joins some, and if any is in brackets."""
        found: list[Any] = []
        has_comma = any(_is_token(one) and one.type == "COMMA" for one in children)
        is_grouped = False
        for one in children:
            if isinstance(one, tuple):
                inner, comma, _ = one
                found += inner
                has_comma, is_grouped = has_comma or comma, True
            elif not _is_token(one):
                found.append(one)
        return found, has_comma, is_grouped

    def grouped(self, children: list[Any]) -> Any:
        (inner,) = (one for one in children if not _is_token(one))
        return inner

    def rule(self, children: list[Any]) -> RuleText:
        label: tuple[Token, ...] = ()
        rest = list(children[1:])
        if isinstance(rest[0], tuple):
            label = rest.pop(0)
        weight = rest.pop() if _is_token(rest[-1]) else None
        inner, has_comma, is_grouped = rest.pop()
        condition = next(one for one in rest if not _is_token(one))
        return RuleText(
            keyword=children[0],
            label=label,
            condition=condition,
            conclusions=tuple(inner),
            weight=weight,
            is_grouped=is_grouped,
            has_comma=has_comma,
        )


_PART = re.compile(r"[(),]|[^(),\s]+")
_KINDS = {"(": "LPAR", ")": "RPAR", ",": "COMMA"}


def _parts(point: Token) -> Iterator[Token]:
    """Yield the words of a point, each with its place."""
    line, column = place(point)
    for found in _PART.finditer(point):
        before = point[: found.start()]
        breaks = before.count("\n")
        start = len(before) - before.rfind("\n") if breaks else column + len(before)
        text = found.group()
        yield Token(_KINDS.get(text, "NUMBER"), text, line=line + breaks, column=start)


def _words(children: Iterable[Token]) -> tuple[Token, ...]:
    return tuple(one for one in children if one.type in ("WORD", "NUMBER"))


def _is_token(value: object) -> bool:
    return isinstance(value, Token)
