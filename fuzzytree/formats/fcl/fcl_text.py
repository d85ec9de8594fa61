"""The text of an FCL file as statements, each with its place.

The text is cut into tokens, the tokens into statements, and each statement is parsed
alone by the grammar in `fcl.lark`: so a mistake in one hides none in another. A
statement ends at `;`, at the end of the line in a block's first line, and where a new
line begins with a word that can only begin another one (fuzzylite writes no `;` behind
rules).
"""

from __future__ import annotations

import difflib
import itertools
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

import msgspec
from lark import Token
from lark.exceptions import UnexpectedInput

from fuzzytree.errors import ReadError
from fuzzytree.formats.fcl.fcl_statements import Statement, grammar, place
from fuzzytree.formats.yaml.layout import LONGEST_NAME
from fuzzytree.formats.yaml.nodes import Found, report

MOST_BYTES: Final = 16 * 2**20
MOST_TOKENS: Final = 300_000
MOST_LEVELS: Final = 50
"""How deep parentheses and `not` can be nested in one rule."""


class FclText(msgspec.Struct, frozen=True):
    """What an FCL file says.

    Attributes:
        text: The text; its lines end with LF.
        tokens: All of it but blanks and comments.
        statements: The statements that have no mistake.
        found: The mistakes of the others.
        encoding: `UTF-8`, or what else the bytes were taken for.
    """

    text: str
    tokens: tuple[Token, ...]
    statements: tuple[Statement, ...]
    found: tuple[Found, ...]
    encoding: str


def parsed(content: bytes, name: str) -> FclText:
    """Return the statements of an FCL file.

    Args:
        content: The file.
        name: What messages call it.

    Raises:
        ReadError: If it is too large, or no text.
    """
    text, encoding = _decoded(content, name)
    tokens, found = _tokens(text, name)
    statements: list[Statement] = []
    for group in _groups(tokens):
        given = _statement(group)
        if isinstance(given, tuple):
            found.append(given)
        else:
            statements.append(given)
    return FclText(text, tuple(tokens), tuple(statements), tuple(found), encoding)


def _decoded(content: bytes, name: str) -> tuple[str, str]:
    if len(content) > MOST_BYTES:
        raise ReadError(
            f"{name}: {len(content):,} bytes are more than the {MOST_BYTES:,} "
            "that are read"
        )
    encoding = "UTF-8"
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        is_wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
        encoding = "UTF-16" if is_wide else "Latin-1"
        text = content.decode(encoding, "replace")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    wrong = re.search("[\x00-\x08\x0e-\x1f\ufffd]", text)
    if wrong:
        before = text[: wrong.start()]
        line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
        sentence = (
            f"character U+{ord(wrong.group()):04X} may not stand in an FCL file; "
            "it may be damaged, or no text"
        )
        raise report(name, [(line, column, sentence)])
    return text, encoding


_BLOCKS: Final = {
    "FUNCTION_BLOCK": "END_FUNCTION_BLOCK",
    "VAR_INPUT": "END_VAR",
    "VAR_OUTPUT": "END_VAR",
    "FUZZIFY": "END_FUZZIFY",
    "DEFUZZIFY": "END_DEFUZZIFY",
    "RULEBLOCK": "END_RULEBLOCK",
}
ENDINGS: Final = dict(_BLOCKS)
"""Which word ends a block that begins with another."""

_EDGES = {*_BLOCKS, *_BLOCKS.values()}
_SETTINGS = {"METHOD", "ACCU", "ACT", "AND", "OR", "ENABLED", "LOCK"}
_ASSIGNED = {"RANGE", "DEFAULT"}
_LEADERS = {*_EDGES, *_SETTINGS, *_ASSIGNED, "TERM", "RULE"}
_EVERYWHERE = {"IF", "THEN", "IS", "AND", "OR", "NOT", "WITH"}


def _tokens(text: str, name: str) -> tuple[list[Token], list[Found]]:
    """Return the tokens of a text that some statement can hold, and the others."""
    tokens: list[Token] = []
    found: list[Found] = []
    for token in itertools.islice(grammar().lex(text), MOST_TOKENS + 1):
        if token.type == "STRANGE":
            if len(found) < 1000:
                found.append((*place(token), f"{str(token)!r} has no meaning here"))
        elif token.type == "OPEN_COMMENT":
            found.append((*place(token), f"the comment {token[:2]} is never closed"))
        else:
            if len(token) > LONGEST_NAME:
                sentence = f"a word of more than {LONGEST_NAME} characters"
                found.append((*place(token), sentence))
            tokens.append(token)
    if len(tokens) > MOST_TOKENS:
        raise ReadError(f"{name}: more than the {MOST_TOKENS:,} words that are read")
    return tokens, found


def _groups(tokens: Sequence[Token]) -> Iterator[list[Token]]:
    """Yield the tokens of each statement, typed."""
    group: list[Token] = []
    in_variables = False
    line = 0
    for index, token in enumerate(tokens):
        is_first = token.line != line
        line = token.end_line or token.line or 0
        if token.type == "SEMICOLON":
            if group:
                yield _typed(group, in_variables=in_variables)
            group = []
            continue
        if group and (
            _is_whole(group, is_first=is_first)
            or _starts(
                tokens,
                index,
                in_variables=in_variables,
                may_lead=_leads(group, is_first),
            )
        ):
            yield _typed(group, in_variables=in_variables)
            group = []
        if not group and token.upper() in _EDGES:
            in_variables = token.upper() in ("VAR_INPUT", "VAR_OUTPUT")
        group.append(token)
    if group:
        yield _typed(group, in_variables=in_variables)


def _is_whole(group: Sequence[Token], *, is_first: bool) -> bool:
    """Return whether the first line of a block, or its last one, ends here."""
    word = group[0].upper()
    if word not in _EDGES:
        return False
    needed = {"FUZZIFY": 2, "DEFUZZIFY": 2, "FUNCTION_BLOCK": 99, "RULEBLOCK": 99}
    return is_first or len(group) >= needed.get(word, 1)


def _leads(group: Sequence[Token], is_first: bool) -> bool:
    """Return whether a statement's first word can stand here without `;` before it."""
    return is_first or group[0].upper() in _EDGES


def _starts(
    tokens: Sequence[Token], index: int, *, in_variables: bool, may_lead: bool
) -> bool:
    """Return whether a token begins a statement, though no `;` stands before it."""
    token = tokens[index]
    word = token.upper()
    if token.type != "WORD" or tokens[index - 1].upper() == "TERM":
        return False
    if word in _EDGES:
        return True
    if not may_lead or tokens[index - 1].type == "COMMA":
        return False
    after = tokens[index + 1].type if index + 1 < len(tokens) else ""
    if word in _SETTINGS or word in _ASSIGNED or in_variables:
        return after in ("COLON", "ASSIGN", "COMMA")
    return word in ("TERM", "RULE")


def _typed(group: list[Token], *, in_variables: bool) -> list[Token]:
    """Return a statement's tokens with the types of their keywords."""
    typed: list[Token] = []
    for index, token in enumerate(group):
        word = token.upper()
        is_leader = index == 0 and word in _LEADERS
        if in_variables and word in _LEADERS - _EDGES - {"RANGE"}:
            is_leader = False
        if token.type == "WORD" and (is_leader or (index and word in _EVERYWHERE)):
            typed.append(Token.new_borrow_pos(word, str(token), token))
        elif index == 0 and not in_variables:
            typed.append(Token.new_borrow_pos("UNKNOWN", str(token), token))
        else:
            typed.append(token)
    return typed


def _statement(group: list[Token]) -> Statement | Found:
    """Return a statement, or its first mistake."""
    deep = _too_deep(group)
    if deep is not None:
        return (*place(deep), f"nested deeper than {MOST_LEVELS} levels")
    parser: Any = grammar().parse_interactive()  # lark does not type all of it
    for token in group:
        try:
            parser.feed_token(token)
        except UnexpectedInput:
            return _misspelt(group, token) or _unexpected(
                group, token, parser.accepts()
            )
    try:
        statement: Statement = parser.feed_eof()
    except UnexpectedInput:
        last = group[-1]
        wanted = _wanted(parser.accepts())
        where = (last.end_line or 1, last.end_column or 1)
        return (*where, f"the statement ends here; expected {wanted}")
    return statement


def _too_deep(group: Iterable[Token]) -> Token | None:
    level = 0
    for token in group:
        if token.type in ("LPAR", "NOT"):
            level += 1
        elif token.type in ("RPAR", "AND", "OR", "THEN"):
            level -= token.type == "RPAR" or level > 0
        if level > MOST_LEVELS:
            return token
    return None


def _misspelt(group: Sequence[Token], token: Token) -> Found | None:
    """Return a keyword of a rule, wrongly written, that was taken for a name."""
    index = next(k for k, one in enumerate(group) if one is token)
    for one in group[max(1, index - 2) : index]:
        if one.type == "WORD" and group[0].type == "RULE":
            hint = _hint(one, ("THEN", "AND", "WITH", "NOT"), closeness=0.7)
            if hint:
                return (*place(one), f"found {str(one)!r} before {str(token)!r}{hint}")
    return None


def _unexpected(group: list[Token], token: Token, accepted: set[str]) -> Found:
    shown = str(token) if len(token) <= 40 else f"{token[:40]}..."
    if token is group[0]:
        words = sorted(_LEADERS - {"VAR"})
        hint = _hint(token, words)
        sentence = f"found {shown!r}, with which no statement begins{hint}"
        return (*place(token), sentence)
    words = [one for one in accepted if one in _LEADERS | _EVERYWHERE]
    wanted = _wanted(accepted)
    sentence = f"found {shown!r}; expected {wanted}{_hint(token, words)}"
    return (*place(token), sentence)


def _hint(token: Token, words: Iterable[str], closeness: float = 0.6) -> str:
    known = list(words)
    close = difflib.get_close_matches(token[:40].upper(), known, n=1, cutoff=closeness)
    return f" (did you mean '{close[0]}'?)" if close else ""


_SHOWN: Final = {
    "WORD": "a name",
    "NUMBER": "a number",
    "SIGN": "",
    "POINT": "",
    "LPAR": "'('",
    "RPAR": "')'",
    "COMMA": "','",
    "ASSIGN": "':='",
    "COLON": "':'",
    "DOTS": "'..'",
    "BAR": "'|'",
    "$END": "';'",
}


def _wanted(accepted: Iterable[str]) -> str:
    """Return what could stand somewhere, such as `IS or ':='`."""
    shown = sorted(filter(None, (_SHOWN.get(one, one) for one in accepted)))
    return " or ".join(filter(None, (", ".join(shown[:-1]), shown[-1]))) or "nothing"
