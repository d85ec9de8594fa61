"""FCL text as statements with positions, and statements as blocks.

The text is split into tokens, the tokens into statements, and the grammar in `fcl.lark`
parses each statement alone: a mistake in one hides none in another. A statement ends at
`;`, at the end of the line in a block's first line, and where a new line begins with a
word that can only begin another one (fuzzylite writes no `;` behind rules).
"""

from __future__ import annotations

import difflib
import functools
import itertools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import resources
from typing import Any, Final, Literal

import msgspec
from lark import Lark, Token, Transformer
from lark.exceptions import UnexpectedInput

from fuzzytree.errors import ReadError
from fuzzytree.formats.text_files import (
    LONGEST_NAME,
    FileMistake,
    ReaderNotes,
    check_characters,
    decoded,
)

Connective = Literal["and", "or"]


class FclProposition(msgspec.Struct, frozen=True, gc=False):
    """`variable is word ... word`: hedges and a label."""

    variable: Token
    verb: Token
    words: tuple[Token, ...]


class FclChain(msgspec.Struct, frozen=True):
    """Conditions as they stand, and the word between each two."""

    parts: tuple[FclProposition | FclChain | FclNegation, ...]
    words: tuple[Connective, ...]


class FclNegation(msgspec.Struct, frozen=True):
    """NOT in front of a condition."""

    part: FclProposition | FclChain | FclNegation


FclCondition = FclProposition | FclChain | FclNegation


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


class FclRange(msgspec.Struct, frozen=True):
    """The range of a variable."""

    keyword: Token
    low: Token
    high: Token


class Setting(msgspec.Struct, frozen=True):
    """A keyword and the words that it is set to."""

    keyword: Token
    words: tuple[Token, ...]


class TermStatement(msgspec.Struct, frozen=True):
    """A term: its name, and the tokens of its curve."""

    name: Token
    kind: Literal["number", "points", "shape"]
    tokens: tuple[Token, ...]


class RuleStatement(msgspec.Struct, frozen=True):
    """A rule; `has_comma`: whether `,` joins its conclusions."""

    keyword: Token
    label: tuple[Token, ...]
    condition: FclCondition
    conclusions: tuple[FclProposition, ...]
    weight: Token | None
    is_grouped: bool
    has_comma: bool


Statement = (
    Header | Ending | Declaration | FclRange | Setting | TermStatement | RuleStatement
)


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

    def range(self, children: list[Token]) -> FclRange:
        low, high = _words(children)
        return FclRange(children[0], low, high)

    def setting(self, children: list[Token]) -> Setting:
        return Setting(children[0], _words(children[1:]))

    default = lock = setting

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

    def term(self, children: list[Any]) -> TermStatement:
        kind, tokens = children[-1]
        return TermStatement(children[1], kind, tokens)

    def label(self, children: list[Token]) -> tuple[Token, ...]:
        return tuple(children)

    def weight(self, children: list[Token]) -> Token:
        return children[-1]

    def proposition(self, children: list[Token]) -> FclProposition:
        return FclProposition(children[0], children[1], tuple(children[2:]))

    def condition(self, children: list[Any]) -> FclChain:
        words = tuple(one.type.lower() for one in children[1::2])
        return FclChain(tuple(children[::2]), words)

    def negation(self, children: list[Any]) -> FclNegation:
        return FclNegation(children[-1])

    def conclusions(self, children: list[Any]) -> tuple[list[Any], bool, bool]:
        """Return the conclusions, whether `,` joins some, and if any is in brackets."""
        results: list[Any] = []
        has_comma = any(_is_token(one) and one.type == "COMMA" for one in children)
        is_grouped = False
        for one in children:
            if isinstance(one, tuple):
                inner, comma, _ = one
                results += inner
                has_comma, is_grouped = has_comma or comma, True
            elif not _is_token(one):
                results.append(one)
        return results, has_comma, is_grouped

    def grouped(self, children: list[Any]) -> Any:
        (inner,) = (one for one in children if not _is_token(one))
        return inner

    def rule(self, children: list[Any]) -> RuleStatement:
        label: tuple[Token, ...] = ()
        rest = list(children[1:])
        if isinstance(rest[0], tuple):
            label = rest.pop(0)
        weight = rest.pop() if _is_token(rest[-1]) else None
        inner, has_comma, is_grouped = rest.pop()
        condition = next(one for one in rest if not _is_token(one))
        return RuleStatement(
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
    for match in _PART.finditer(point):
        before = point[: match.start()]
        breaks = before.count("\n")
        start = len(before) - before.rfind("\n") if breaks else column + len(before)
        text = match.group()
        yield Token(_KINDS.get(text, "NUMBER"), text, line=line + breaks, column=start)


def _words(children: Iterable[Token]) -> tuple[Token, ...]:
    return tuple(one for one in children if one.type in ("WORD", "NUMBER"))


def _is_token(value: object) -> bool:
    return isinstance(value, Token)


MOST_BYTES: Final = 16 * 2**20
MOST_TOKENS: Final = 300_000
_FORBIDDEN = re.compile("[\x00-\x08\x0e-\x1f\ufffd]")
MOST_LEVELS: Final = 50
"""How deep parentheses and `not` can be nested in one rule."""


class FclText(msgspec.Struct, frozen=True):
    """What an FCL file says: statements without mistakes, and mistakes of the others.

    Lines of the text end with LF; the tokens are all but blanks and comments.
    """

    text: str
    tokens: tuple[Token, ...]
    statements: tuple[Statement, ...]
    mistakes: tuple[FileMistake, ...]
    remarks: tuple[str, ...]


def parsed(content: bytes, name: str) -> FclText:
    """Return the statements of an FCL file.

    Raises:
        ReadError: If it is too large, or no text.
    """
    text, remarks = decoded(content, name, MOST_BYTES, reads_utf16=True)
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    check_characters(text, name, _FORBIDDEN)
    tokens, result = _tokens(text, name)
    statements: list[Statement] = []
    for group in _groups(tokens):
        value = _statement(group)
        if isinstance(value, tuple):
            result.append(value)
        else:
            statements.append(value)
    return FclText(text, tuple(tokens), tuple(statements), tuple(result), remarks)


ENDINGS: Final = {
    "FUNCTION_BLOCK": "END_FUNCTION_BLOCK",
    "VAR_INPUT": "END_VAR",
    "VAR_OUTPUT": "END_VAR",
    "FUZZIFY": "END_FUZZIFY",
    "DEFUZZIFY": "END_DEFUZZIFY",
    "RULEBLOCK": "END_RULEBLOCK",
}
"""Which word ends a block that begins with another."""

_EDGES = {*ENDINGS, *ENDINGS.values()}
_SETTINGS = {"METHOD", "ACCU", "ACT", "AND", "OR", "ENABLED", "LOCK"}
_ASSIGNED = {"RANGE", "DEFAULT"}
_LEADERS = {*_EDGES, *_SETTINGS, *_ASSIGNED, "TERM", "RULE"}
_EVERYWHERE = {"IF", "THEN", "IS", "AND", "OR", "NOT", "WITH"}


def _tokens(text: str, name: str) -> tuple[list[Token], list[FileMistake]]:
    """Return the tokens of a text that some statement can hold, and the others."""
    tokens: list[Token] = []
    mistakes: list[FileMistake] = []
    for token in itertools.islice(grammar().lex(text), MOST_TOKENS + 1):
        if token.type == "STRANGE":
            if len(mistakes) < 1000:
                mistakes.append((*place(token), f"{str(token)!r} has no meaning here"))
        elif token.type == "OPEN_COMMENT":
            mistakes.append((*place(token), f"the comment {token[:2]} is never closed"))
        else:
            if len(token) > LONGEST_NAME:
                sentence = f"a word of more than {LONGEST_NAME} characters"
                mistakes.append((*place(token), sentence))
            tokens.append(token)
    if len(tokens) > MOST_TOKENS:
        raise ReadError(f"{name}: more than the {MOST_TOKENS:,} words that are read")
    return tokens, mistakes


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
                may_lead=is_first or group[0].upper() in _EDGES,
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


def _statement(group: list[Token]) -> Statement | FileMistake:
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


def _misspelt(group: Sequence[Token], token: Token) -> FileMistake | None:
    """Return a keyword of a rule, wrongly written, that was taken for a name."""
    index = next(k for k, one in enumerate(group) if one is token)
    for one in group[max(1, index - 2) : index]:
        if one.type == "WORD" and group[0].type == "RULE":
            hint = _hint(one, ("THEN", "AND", "WITH", "NOT"), closeness=0.7)
            if hint:
                return (*place(one), f"found {str(one)!r} before {str(token)!r}{hint}")
    return None


def _unexpected(group: list[Token], token: Token, accepted: set[str]) -> FileMistake:
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


_ALLOWED: Mapping[str, tuple[str, ...]] = {
    "VAR_INPUT": (),
    "VAR_OUTPUT": (),
    "FUZZIFY": ("ENABLED",),
    "DEFUZZIFY": ("METHOD", "ACCU", "DEFAULT", "ENABLED", "LOCK"),
    "RULEBLOCK": ("AND", "OR", "ACT", "ACCU", "ENABLED"),
}
"""What the settings of each kind of block are."""


class FclBlock(msgspec.Struct, frozen=True):
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
    def terms(self) -> tuple[TermStatement, ...]:
        """Its terms."""
        return tuple(one for one in self.statements if isinstance(one, TermStatement))

    @property
    def rules(self) -> tuple[RuleStatement, ...]:
        """Its rules."""
        return tuple(one for one in self.statements if isinstance(one, RuleStatement))

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


def blocks_of(text: FclText, notes: ReaderNotes) -> tuple[str, list[FclBlock]]:
    """Return the name of the first function block, and the blocks within.

    What stands in a wrong place, or is not closed, is noted.
    """
    blocks: list[FclBlock] = []
    heads: list[Header] = []
    current: FclBlock | None = None
    for one in text.statements:
        if isinstance(one, Header):
            if current is not None:
                _note_unclosed(current, one.keyword, notes)
            current = None
            if one.keyword.type == "FUNCTION_BLOCK":
                heads.append(one)
                continue
            current = FclBlock(one, [])
            if len(heads) < 2:
                blocks.append(current)
        elif isinstance(one, Ending):
            wanted = ENDINGS[current.kind] if current else "END_FUNCTION_BLOCK"
            if one.keyword.type != wanted:
                sentence = f"found {str(one.keyword)!r}; expected {wanted}"
                notes.mistake(place(one.keyword), sentence)
            current = None
        elif current is None:
            sentence = "it stands in no block; expected VAR_INPUT or another block"
            notes.mistake(place_of(one), sentence)
        else:
            current.statements.append(one)
    if current is not None:
        _note_unclosed(current, text.tokens[-1], notes)
    if not heads:
        notes.mistake((1, 1), "the file has no FUNCTION_BLOCK")
    if len(heads) > 1:
        what = f"only the first of {len(heads)} function blocks is read"
        notes.loss("the other function blocks", what)
    for block in blocks:
        _check(block, notes)
    return (raw(heads[0].words) if heads else ""), blocks


def _note_unclosed(block: FclBlock, token: Token, notes: ReaderNotes) -> None:
    sentence = f"found {str(token)!r}; expected {ENDINGS[block.kind]} before it"
    notes.mistake(place(token), sentence)


def place_of(one: Statement) -> tuple[int, int]:
    """Return where a statement begins, or the name within it."""
    match one:
        case Declaration(names=names):
            return place(names[0])
        case TermStatement(name=name):
            return place(name)
        case _:
            return place(one.keyword)


def _check(block: FclBlock, notes: ReaderNotes) -> None:
    """Note what cannot stand in a block, or stands twice."""
    earlier: set[str] = set()
    for one in block.statements:
        if not _belongs(one, block.kind):
            sentence = f"{_shown(one)} cannot stand in {block.kind}"
            notes.mistake(place_of(one), sentence)
        elif isinstance(one, Setting):
            if one.keyword.type in earlier:
                sentence = f"a second {one.keyword.type} in one block"
                notes.mistake(place(one.keyword), sentence)
            earlier.add(one.keyword.type)


def _belongs(one: Statement, kind: str) -> bool:
    match one:
        case Setting(keyword=keyword):
            return keyword.type in _ALLOWED[kind]
        case TermStatement():
            return kind in ("FUZZIFY", "DEFUZZIFY")
        case RuleStatement():
            return kind == "RULEBLOCK"
        case Declaration():
            return kind.startswith("VAR")
        case FclRange():
            return kind != "RULEBLOCK"
        case _:
            return False


def _shown(one: Statement) -> str:
    match one:
        case Declaration():
            return "a variable"
        case TermStatement():
            return "TERM"
        case _:
            return one.keyword.upper()
