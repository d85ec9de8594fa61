"""Formulas as text, such as `2 * dirt + max(x, 0.5) ^ 2`.

The grammar is that of fuzzylite's Function terms, widened: `-a` as well as `~a`, names
in quotes. From the loosest to the closest: `or`; `and`; `+` and `-`; `*`, `/` and `%`;
`-a`; `^` (or `**`), which joins from the right; `~a` and `!a`. All others join from the
left. So `-2 ^ 2` is -4, and `~2 ^ 2` is 4.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Final

import msgspec

from fuzzytree.errors import ReadError
from fuzzytree.formats.text_files import LONGEST_NAME
from fuzzytree.model import (
    FUNCTIONS,
    MOST_LEVELS,
    Call,
    Expression,
    Name,
    Number,
    name_choice,
)

MOST_CHARACTERS: Final = 20_000
_LONGEST: Final = 2 * LONGEST_NAME + 2  # a name of quotes, in quotes

_BINARY: Mapping[str, tuple[int, int]] = {
    "or": (1, 2),
    "and": (3, 4),
    "+": (5, 6),
    "-": (5, 6),
    "*": (7, 8),
    "/": (7, 8),
    "%": (7, 8),
    "^": (12, 11),
}
"""How closely an operator binds what is to its left and what is to its right."""


class Operators(msgspec.Struct, frozen=True):
    """How closely each operator binds, and which function `%` stands for."""

    binary: Mapping[str, tuple[int, int]]
    remainder: str = "%"


FUZZYLITE: Final = Operators(_BINARY)
JFUZZYLOGIC: Final = Operators({**_BINARY, "^": (9, 10), "%": (9, 10)}, "fmod")
"""`^` and `%` bind alike, from the left, and a sign belongs to its number."""

_SIGN, _CLOSEST = 10, 13
_NEGATE, _NOT = "negate", "not"
_PREFIX: Mapping[str, tuple[str, int]] = {
    "-": (_NEGATE, _SIGN),
    ".-": (_NEGATE, _SIGN),
    "+": ("", _SIGN),
    ".+": ("", _SIGN),
    "~": (_NEGATE, _CLOSEST),
    "!": (_NOT, _CLOSEST),
}
"""The function of a sign in front, and how closely it binds; no function for plus."""

_CONSTANTS = {"pi": math.pi, "inf": math.inf, "nan": math.nan}
_OTHER_NAMES = {"fabs": "abs", "pow": "^"}
_SIGNS = {_NEGATE: "-", _NOT: "!"}
_CALLED = frozenset({*FUNCTIONS, *_OTHER_NAMES}) - {*_BINARY, *_SIGNS}
_WORDS = _CALLED | {*_CONSTANTS, *_BINARY, _NOT}
_PLAIN_NAME = re.compile(r"[^\W0-9](?:[\w.]*\w)?")

_TOKEN = re.compile(
    r"""
    (?P<blank>\s+)
  | (?P<number>(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)
  | (?P<name>[^\W0-9](?:[\w.]*\w)?)
  | (?P<quoted>'(?:[^']|'')*')
  | (?P<sign>\*\*|\.-|\.\+|[-+*/%^~!(),])
    """,
    re.VERBOSE,
)


class FormulaError(ReadError):
    """A text that is no formula."""

    def __init__(self, column: int, sentence: str) -> None:
        self.column = column
        self.sentence = sentence
        super().__init__(f"column {column}: {sentence}")


class _Token(msgspec.Struct, frozen=True):
    kind: str
    text: str
    column: int

    def is_sign(self, text: str) -> bool:
        return self.kind == "sign" and self.text == text


class _Text(msgspec.Struct, frozen=True):
    """The tokens of a formula, an end behind them, and the variables it may use."""

    tokens: tuple[_Token, ...]
    names: Collection[str] | None
    operators: Operators


class _Grown(msgspec.Struct, frozen=True):
    """A part of a formula: the place of the token behind it, and its depth.

    `is_literal` marks a bare number, which takes a sign in front into itself.
    """

    expression: Expression
    end: int
    depth: int = 1
    is_literal: bool = False


def parse(
    text: str, names: Collection[str] | None = None, operators: Operators = FUZZYLITE
) -> Expression:
    """Return the expression of a formula.

    Args:
        text: The formula.
        names: The variables that it may use beside `x`; None allows any.
        operators: What its operators mean.

    Raises:
        FormulaError: If it is none, is too long, or is nested too deeply.

    Example:
        >>> parse("2 * dirt")
        Call(function='*', arguments=(Number(value=2.0), Name(name='dirt')))
    """
    if len(text) > MOST_CHARACTERS:
        sentence = (
            f"a formula of {len(text):,} characters; there may be {MOST_CHARACTERS:,}"
        )
        raise FormulaError(1, sentence)
    tokens = (*_tokens(text), _Token("end", "", len(text) + 1))
    grown = _part(_Text(tokens, names, operators), 0, 0, 1)
    behind = tokens[grown.end]
    if behind.kind != "end":
        raise _unexpected(behind, "an operator or the end")
    return grown.expression


def text_of(expression: Expression) -> str:
    """Return a formula as people read it; `parse` gives back the equal expression.

    Example:
        >>> text_of(parse("~(a+b)*max(c,1e-5)"))
        '-(a + b) * max(c, 1e-05)'
    """
    return _written(expression, sign="-", number=repr)[0]


def fuzzylite_text_of(expression: Expression) -> str:
    """Return a formula as fuzzylite and pyfuzzylite read it.

    They know `~a` but not `-a`, and no number with an exponent.

    Example:
        >>> fuzzylite_text_of(parse("-(a + b) * max(c, 1e-5)"))
        '~(a + b) * max(c, 0.00001)'
    """
    return _written(expression, sign="~", number=_positional)[0]


def _part(text: _Text, place: int, closeness: int, level: int) -> _Grown:
    """Read on as long as operators bind more closely than what stands before."""
    left = _operand(text, place, level)
    while True:
        token = text.tokens[left.end]
        word = "^" if token.text == "**" else token.text
        binds = None if token.kind == "quoted" else text.operators.binary.get(word)
        if binds is None or binds[0] < closeness:
            return left
        right = _part(text, left.end + 1, binds[1], level + 1)
        function = text.operators.remainder if word == "%" else word
        left = _joined(token, function, (left, right), right.end)


def _operand(text: _Text, place: int, level: int) -> _Grown:
    token = text.tokens[place]
    if level > MOST_LEVELS:
        raise _too_deep(token)
    match token.kind:
        case "number":
            return _Grown(Number(_number(token)), place + 1, is_literal=True)
        case "quoted":
            return _variable(text, place, token.text[1:-1].replace("''", "'"))
        case "name":
            return _named(text, place, level)
        case "sign" if token.text == "(":
            inner = _part(text, place + 1, 0, level + 1)
            return _Grown(
                inner.expression, _closed(text, place, inner.end), inner.depth
            )
        case "sign" if token.text in _PREFIX:
            return _signed(text, place, level)
        case _:
            raise _unexpected(token, "a number, a name or '('")


def _signed(text: _Text, place: int, level: int) -> _Grown:
    token = text.tokens[place]
    function, closeness = _PREFIX[token.text]
    operand = _part(text, place + 1, closeness, level + 1)
    if not function:
        return operand
    if function == _NEGATE and operand.is_literal:
        assert isinstance(operand.expression, Number)  # what is_literal says
        return _Grown(Number(-operand.expression.value), operand.end)
    return _joined(token, function, (operand,), operand.end)


def _named(text: _Text, place: int, level: int) -> _Grown:
    token = text.tokens[place]
    if text.tokens[place + 1].is_sign("("):
        return _call(text, place, level)
    if token.text in _CONSTANTS:
        is_literal = token.text != "pi"
        return _Grown(Number(_CONSTANTS[token.text]), place + 1, is_literal=is_literal)
    if token.text in _BINARY:
        raise _unexpected(token, "a number, a name or '('")
    return _variable(text, place, token.text)


def _variable(text: _Text, place: int, name: str) -> _Grown:
    if text.names is not None and name != "x" and name not in text.names:
        sentence = f"no variable {name!r}; {name_choice(name, text.names)}"
        if name in _CALLED:
            sentence = f"the function {name!r} needs its arguments in parentheses"
        raise FormulaError(text.tokens[place].column, sentence)
    return _Grown(Name(name), place + 1)


def _call(text: _Text, place: int, level: int) -> _Grown:
    token = text.tokens[place]
    arguments: list[_Grown] = []
    end = place + 2
    if not (token.text == "pi" and text.tokens[end].is_sign(")")):
        arguments.append(_part(text, end, 0, level + 1))
        while text.tokens[arguments[-1].end].is_sign(","):
            arguments.append(_part(text, arguments[-1].end + 1, 0, level + 1))
        end = arguments[-1].end
    end = _closed(text, place + 1, end)
    if not arguments:
        return _Grown(Number(math.pi), end)
    if token.text not in _CALLED:
        sentence = (
            f"no function {token.text!r}; {name_choice(token.text, sorted(_CALLED))}"
        )
        raise FormulaError(token.column, sentence)
    name = _OTHER_NAMES.get(token.text, token.text)
    value, needed = len(arguments), FUNCTIONS[name]
    if value != needed:
        count = f"{needed} argument" + "s" * (needed != 1)
        sentence = f"the function {token.text!r} takes {count}, not {value}"
        raise FormulaError(token.column, sentence)
    return _joined(token, name, arguments, end)


def _closed(text: _Text, opening: int, end: int) -> int:
    """Return the place behind the parenthesis that closes what opens at a place."""
    token = text.tokens[end]
    if token.is_sign(")"):
        return end + 1
    if token.kind == "end":
        sentence = "the parenthesis that opens here is not closed"
        raise FormulaError(text.tokens[opening].column, sentence)
    raise _unexpected(token, "an operator or ')'")


def _joined(token: _Token, function: str, parts: Sequence[_Grown], end: int) -> _Grown:
    depth = 1 + max(part.depth for part in parts)
    if depth > MOST_LEVELS:
        raise _too_deep(token)
    arguments = tuple(part.expression for part in parts)
    return _Grown(Call(function, arguments), end, depth)


def _tokens(text: str) -> Iterator[_Token]:
    place = 0
    while place < len(text):
        token_match = _TOKEN.match(text, place)
        if token_match is None:
            what = f"{text[place]!r} does not belong into a formula"
            if text[place] == "'":
                what = "the quote that opens here is not closed"
            raise FormulaError(place + 1, what)
        if token_match.end() - place > _LONGEST and token_match.lastgroup != "blank":
            sentence = f"a word of {token_match.end() - place:,} characters"
            raise FormulaError(place + 1, sentence)
        if token_match.lastgroup != "blank":
            yield _Token(token_match.lastgroup or "", token_match.group(), place + 1)
        place = token_match.end()


def _number(token: _Token) -> float:
    value = float(token.text)
    if math.isinf(value):
        raise FormulaError(token.column, f"{token.text} is too large for a number")
    return value


def _unexpected(token: _Token, wanted: str) -> FormulaError:
    result = "the end" if token.kind == "end" else repr(token.text)
    return FormulaError(token.column, f"{result} where {wanted} must stand")


def _too_deep(token: _Token) -> FormulaError:
    sentence = f"the formula is nested deeper than {MOST_LEVELS} levels"
    return FormulaError(token.column, sentence)


def _written(
    expression: Expression, sign: str, number: Callable[[float], str]
) -> tuple[str, int]:
    """Return a formula, and how closely its outermost operator binds."""

    def inner(part: Expression, closeness: int) -> str:
        text, binds = _written(part, sign, number)
        return text if binds >= closeness else f"({text})"

    match expression:
        case Number(value=value):
            if math.copysign(1.0, value) < 0.0:
                return f"{sign}{number(-value)}", _PREFIX[sign][1]
            return number(value), _CLOSEST + 1
        case Name(name=name):
            return _name_text(name), _CLOSEST + 1
        case Call(function=function, arguments=(left, right)) if function in _BINARY:
            before, behind = _BINARY[function]
            text = f"{inner(left, before)} {function} {inner(right, behind)}"
            return text, min(before, behind)
        case Call(function=function, arguments=(part,)) if function in _SIGNS:
            mark = sign if function == _NEGATE else _SIGNS[function]
            closeness = _PREFIX[mark][1]
            # A bare number would take the sign into itself.
            least = _CLOSEST + 2 if isinstance(part, Number) else closeness
            return f"{mark}{inner(part, least)}", closeness
        case Call(function=function, arguments=arguments):
            parts = ", ".join(inner(part, 0) for part in arguments)
            return f"{function}({parts})", _CLOSEST + 1


def _name_text(name: str) -> str:
    if _PLAIN_NAME.fullmatch(name) and name not in _WORDS:
        return name
    quoted = name.replace("'", "''")
    return f"'{quoted}'"


def _positional(value: float) -> str:
    return format(Decimal(repr(value)), "f") if math.isfinite(value) else repr(value)
