"""YAML without tags, anchors, tabs and what else no model needs."""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from operator import itemgetter
from typing import Any, NamedTuple, NoReturn

from fuzzytree.rechecking.outcomes import CannotRunError

MOST_BYTES = 64 * 2**20
MOST_LEVELS = 32

_QUOTED = re.compile(r"'((?:[^']|'')*)'|\"((?:[^\"\\]|\\.)*)\"")
_KEY = re.compile(
    rf"({_QUOTED.pattern}|(?!-[- ])[^ ,'\"\[\]{{}}?&*!|>%@`].*?) *:(?: +|$)"
)
_NAME = re.compile(
    rf"({_QUOTED.pattern}(?= *:)|[^ ,'\"\[\]{{}}][^,\[\]{{}}]*?(?= *: )) *: *"
)
"""A key in braces, which may be the name of a class."""
_PART = re.compile(
    rf"(?<![^ \[{{,])(?:{_QUOTED.pattern}|(?P<open>['\"]))|(?<![^ ])(?P<comment>#)|."
)
_SIGNS = "&*!|>@%`?,[]{}#"
_ESCAPE = re.compile(r"\\(x[0-9a-fA-F]{2}|u[0-9a-fA-F]{4}|U[0-9a-fA-F]{8}|.)")
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "0": "\0", "\\": "\\", '"': '"', "/": "/"}
_INTEGER = re.compile(r"[-+]?[0-9]{1,300}")
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITE = {".inf": math.inf, "-.inf": -math.inf}
_ALIEN = re.compile(
    r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)|0[ox].*"
    "|~?|null|Null|NULL|true|True|TRUE|false|False|FALSE"
)
_FORBIDDEN = re.compile(
    "[^\n\x20-\x7e\xa0-\u2027\u202a-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
)


class Items(list[Any]):
    """A list, and the line and the column of each item."""

    def __init__(self) -> None:
        self.places: list[tuple[int, int]] = []


class _Line(NamedTuple):
    number: int
    indent: int
    text: str


def read_yaml(content: bytes, name: str) -> Any:
    r"""Return what a file of YAML holds: mappings, lists, texts and numbers.

    Example:
        >>> read_yaml(b"classes: [a, 'b']\nrange: {from: 1.5}\n", "x.yaml")
        {'classes': ['a', 'b'], 'range': {'from': 1.5}}
    """
    return _Reader(content, name).document()


class _Reader:
    """The lines of a file, and how far they are read."""

    def __init__(self, content: bytes, name: str) -> None:
        self.name, self.at, self.number = name, 0, 1
        if len(content) > MOST_BYTES:
            raise CannotRunError(f"{name}: more than {MOST_BYTES:,} bytes")
        try:
            text = content.decode("utf-8-sig").replace("\r\n", "\n")
        except UnicodeDecodeError as error:
            raise CannotRunError(f"{name}: not UTF-8: {error.reason}") from error
        wrong = _FORBIDDEN.search(text)
        if wrong:
            self.number = text.count("\n", 0, wrong.start()) + 1
            self.fail(f"character U+{ord(wrong[0]):04X} is not read")
        self.lines: list[_Line] = []
        for self.number, whole in enumerate(text.split("\n"), 1):
            kept = self._without_comment(whole).rstrip(" ")
            if kept:
                indent = len(kept) - len(kept.lstrip(" "))
                self.lines.append(_Line(self.number, indent, kept[indent:]))

    def fail(self, what: str) -> NoReturn:
        raise CannotRunError(f"{self.name}:{self.number}: {what:.200}")

    def _without_comment(self, line: str) -> str:
        """Cut a comment off: a `#` at the start or behind a blank, not in quotes."""
        for part in _PART.finditer(line) if "#" in line else ():
            if part["comment"]:
                return line[: part.start()]
            if part["open"]:
                self.fail("a quote that does not end on its line")
        return line

    def document(self) -> Any:
        for mark, place in (("%YAML 1.2", 0), ("---", 0), ("...", -1)):
            if self.lines and self.lines[place].text == mark:
                del self.lines[place]
        if not self.lines:
            raise CannotRunError(f"{self.name}: the file is empty")
        result = self._block(self.lines[0].indent, 1)
        if not isinstance(result, dict | list):
            self.fail(f"no key and no list: {self.lines[0].text[:40]!r}")
        if self.at < len(self.lines):
            self.number = self.lines[self.at].number
            self.fail(f"{self.lines[self.at].text[:40]!r} is not understood here")
        return result

    def _next(self, indent: int) -> _Line | None:
        line = self.lines[self.at] if self.at < len(self.lines) else None
        if line is None or line.indent != indent:
            return None
        self.number = line.number
        return line

    def _block(self, indent: int, level: int) -> Any:
        """Return the list, mapping or value whose lines begin at this indent."""
        line = self._next(indent)
        text = line.text if line else ""
        if level > MOST_LEVELS:
            self.fail(f"more than {MOST_LEVELS} levels")
        if text == "-" or text.startswith("- "):
            return self._list(indent, level)
        if _KEY.match(text):
            return self._mapping(indent, level)
        return self._value(text, indent - 1)

    def _list(self, indent: int, level: int) -> Items:
        items = Items()
        while (line := self._next(indent)) and f"{line.text} ".startswith("- "):
            rest = line.text[1:].lstrip(" ")
            inner = indent + len(line.text) - len(rest)
            items.places.append((line.number, inner + 1))
            if not rest:
                self.fail("an empty item")
            if _KEY.match(rest) or rest.startswith("- "):
                self.lines[self.at] = _Line(line.number, inner, rest)
                items.append(self._block(inner, level + 1))
            else:
                items.append(self._value(rest, indent))
        return items

    def _mapping(self, indent: int, level: int) -> dict[str, Any]:
        pairs: dict[str, Any] = {}
        while (line := self._next(indent)) and (key := _KEY.match(line.text)):
            name = str(self._scalar(key[1]))
            if name in pairs:
                self.fail(f"the key {name!r} stands twice")
            if key.end() < len(line.text):
                pairs[name] = self._value(line.text[key.end() :], indent)
                continue
            self.at += 1
            below = self.lines[self.at] if self.at < len(self.lines) else line
            is_list = below.indent == indent and below.text.startswith("- ")
            if below.number == line.number or not (below.indent > indent or is_list):
                self.fail(f"the key {name!r} has no value")
            pairs[name] = self._block(below.indent, level + 1)
        return pairs

    def _value(self, text: str, indent: int) -> Any:
        """Return a text, number, or list or mapping in brackets, over several lines."""
        first = self.lines[self.at]
        column = first.indent + len(first.text) - len(text) + 1
        parts, starts = [text], [(0, first.number, column)]
        end, depth = len(text), _depth(text) if text[0] in "[{" else 0
        self.at += 1
        while self.at < len(self.lines) and (
            self.lines[self.at].indent > indent or depth > 0
        ):
            line = self.lines[self.at]
            parts.append(line.text)
            starts.append((end + 1, line.number, line.indent + 1))
            end, depth = end + 1 + len(line.text), depth + _depth(line.text)
            self.at += 1
        self.starts, whole = starts, " ".join(parts)
        if text[0] in "'\"" and len(starts) > 1:
            self.fail("a quoted text over several lines")
        if text[0] not in "[{":
            return self._scalar(whole)
        result, end = self._flow(whole, 0, 0)
        if end != len(whole):
            self.fail(f"more behind the bracket: {whole[end:]!r}")
        return result

    def _line_at(self, at: int) -> int:
        """Return which line of a value stands at a position of its text."""
        return bisect_right(self.starts, at, key=itemgetter(0)) - 1

    def _flow(self, text: str, at: int, level: int) -> tuple[Any, int]:
        """Return a value in brackets, braces or quotes, or a word, and its end."""
        if level > MOST_LEVELS:
            self.fail(f"more than {MOST_LEVELS} levels")
        if text[at : at + 1] not in ("[", "{"):
            quoted = _QUOTED.match(text, at)
            if quoted and self._line_at(at) != self._line_at(quoted.end() - 1):
                self.fail("a quoted text over several lines")
            plain = re.split(r"[,\]}\[{]", text[at:], maxsplit=1)
            word = quoted[0] if quoted else plain[0]
            return self._scalar(word.rstrip(" ")), at + len(word)
        is_list, pairs, items = text[at] == "[", dict[str, Any](), Items()
        close, at = "]" if is_list else "}", _behind_blanks(text, at + 1)
        while text[at : at + 1] != close:
            if is_list:
                start, number, column = self.starts[self._line_at(at)]
                items.places.append((number, column + at - start))
                item, at = self._flow(text, at, level + 1)
                items.append(item)
            else:
                key = _NAME.match(text, at)
                if key is None:
                    self.fail(f"no key: {text[at : at + 40]!r}")
                name = str(self._scalar(key[1]))
                if name in pairs:
                    self.fail(f"the key {name!r} stands twice")
                pairs[name], at = self._flow(text, key.end(), level + 1)
            at = _behind_blanks(text, at)
            if text[at : at + 1] == ",":
                at = _behind_blanks(text, at + 1)
            elif text[at : at + 1] != close:
                self.fail(f"{close!r} or ',' is missing")
        return items if is_list else pairs, at + 1

    def _scalar(self, text: str) -> str | int | float:
        if text[:1] in ("'", '"'):
            return self._unquote(text)
        if text in _INFINITE:  # an open end of a trapezoid; no number elsewhere
            return _INFINITE[text]
        if _ALIEN.fullmatch(text):
            self.fail(f"{text!r} has no place in a model")
        if text[0] in _SIGNS or text[:2] in ("- ", "--") or ": " in f"{text} ":
            self.fail(f"{text[:40]!r} is not read; quotes make it a text")
        if _INTEGER.fullmatch(text):
            return int(text)
        return float(text) if _NUMBER.fullmatch(text) else text

    def _unquote(self, text: str) -> str:
        whole = _QUOTED.fullmatch(text)
        if whole is None:
            self.fail(f"a quote that does not end: {text[:40]!r}")
        if whole[2] is None:
            return whole[1].replace("''", "'")
        return _ESCAPE.sub(self._unescape, whole[2])

    def _unescape(self, result: re.Match[str]) -> str:
        code = result[1]
        number = int(code[1:], 16) if len(code) > 1 else -1
        if number > 0x10FFFF or 0xD800 <= number < 0xE000:
            self.fail(f"no character: {result[0]!r}")
        if len(code) == 1 and code not in _ESCAPES:
            self.fail(f"no escape: {result[0]!r}")
        return chr(number) if len(code) > 1 else _ESCAPES[code]


def _depth(text: str) -> int:
    """Return how many more brackets a text opens than it closes, outside quotes."""
    parts = [part[0] for part in _PART.finditer(text)]
    return sum((part in "[{") - (part in "]}") for part in parts)


def _behind_blanks(text: str, at: int) -> int:
    while text[at : at + 1] == " ":
        at += 1
    return at
