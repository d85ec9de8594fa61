"""YAML, as far as fuzzytree writes it."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from typing import NamedTuple

from fuzzytree.auditing.recheck.outcomes import MOST_BYTES, CannotRunError

MOST_LEVELS = 32

Yaml = str | int | float | list["Yaml"] | dict[str, "Yaml"]
_KEY = re.compile(r"((?:0 )?[a-z][a-z ]*):(?: +|$)")
_QUOTED = re.compile(r"'((?:[^']|'')*)'|\"((?:[^\"\\]|\\.)*)\"")
_PART = re.compile(
    rf"(?<![^ \[{{,])(?:{_QUOTED.pattern}|(?P<open>['\"]))|(?<![^ ])(?P<comment>#)|."
)
_ESCAPE = re.compile(r"\\(x[0-9a-fA-F]{2}|u[0-9a-fA-F]{4}|U[0-9a-fA-F]{8}|.)")
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "0": "\0", "\\": "\\", '"': '"', "/": "/"}
_INTEGER = re.compile(r"[-+]?[0-9]{1,300}")
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITE = {".inf": math.inf, "-.inf": -math.inf}
_ALIEN = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)|0[ox].*")
_NOTHING = re.compile("~?|null|Null|NULL|true|True|TRUE|false|False|FALSE")
_FORBIDDEN = re.compile(
    "[^\n\x20-\x7e\xa0-\u2027\u202a-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
)


class Items(list[Yaml]):
    """A list with a line for each item, and the lines and columns of these."""

    def __init__(self) -> None:
        self.places: list[tuple[int, int]] = []


class _Line(NamedTuple):
    number: int
    indent: int
    text: str


def read_yaml(content: bytes, name: str) -> Yaml:
    r"""Return what a file of YAML holds: mappings, lists, texts and numbers.

    Raises:
        CannotRunError: If it is not in the subset that fuzzytree writes.

    Example:
        >>> read_yaml(b"classes: [a, 'b']\nrange: {from: 1.5}\n", "x.yaml")
        {'classes': ['a', 'b'], 'range': {'from': 1.5}}
    """
    return _Blocks(content, name).document()


class _Blocks:
    """The lines of a file, and how far they are read."""

    def __init__(self, content: bytes, name: str) -> None:
        self.name, self.at = name, 0
        if len(content) > MOST_BYTES:
            raise CannotRunError(f"{name}: more than {MOST_BYTES:,} bytes")
        try:
            text = content.decode("utf-8-sig").replace("\r\n", "\n")
        except UnicodeDecodeError as error:
            raise CannotRunError(f"{name}: not UTF-8: {error.reason}") from error
        wrong = _FORBIDDEN.search(text)
        if wrong:
            line = text.count("\n", 0, wrong.start()) + 1
            raise self.error(line, f"character U+{ord(wrong[0]):04X} is not read")
        self.lines: list[_Line] = []
        for number, whole in enumerate(text.split("\n"), 1):
            kept = self._without_comment(whole, number)
            if kept.strip(" "):
                indent = len(kept) - len(kept.lstrip(" "))
                self.lines.append(_Line(number, indent, kept.strip(" ")))

    def error(self, number: int, what: str) -> CannotRunError:
        return CannotRunError(f"{self.name}:{number}: {what:.200}")

    def _without_comment(self, line: str, number: int) -> str:
        """Cut a comment off: a `#` at the start or behind a blank, not in quotes."""
        for part in _PART.finditer(line) if "#" in line else ():
            if part["comment"]:
                return line[: part.start()]
            if part["open"]:
                raise self.error(number, "a quote that does not end on its line")
        return line

    def document(self) -> Yaml:
        if not self.lines:
            raise CannotRunError(f"{self.name}: the file is empty")
        result = self.block(self.lines[0].indent, 1)
        if self.at < len(self.lines):
            line = self.lines[self.at]
            raise self.error(line.number, f"{line.text[:40]!r} is not understood here")
        return result

    def block(self, indent: int, level: int) -> Yaml:
        """Return the list or mapping whose lines begin at this indent."""
        line = self.lines[self.at]
        if level > MOST_LEVELS:
            raise self.error(line.number, f"more than {MOST_LEVELS} levels")
        if line.text == "-" or line.text.startswith("- "):
            return self._list(indent, level)
        if _KEY.match(line.text):
            return self._mapping(indent, level)
        raise self.error(line.number, f"no key and no list: {line.text[:40]!r}")

    def _next(self, indent: int) -> _Line | None:
        line = self.lines[self.at] if self.at < len(self.lines) else None
        return line if line is not None and line.indent == indent else None

    def _list(self, indent: int, level: int) -> list[Yaml]:
        items = Items()
        while line := self._next(indent):
            if not (line.text == "-" or line.text.startswith("- ")):
                break
            rest = line.text[1:].lstrip(" ")
            place = line.number, indent + len(line.text) - len(rest) + 1
            items.places.append(place)
            if _KEY.match(rest) or rest.startswith("- ") or not rest:
                inner = indent + len(line.text) - len(rest)
                if not rest:
                    raise self.error(line.number, "an empty item")
                self.lines[self.at] = _Line(line.number, inner, rest)
                items.append(self.block(inner, level + 1))
            else:
                items.append(self._value(line, rest, indent))
        return items

    def _mapping(self, indent: int, level: int) -> dict[str, Yaml]:
        pairs: dict[str, Yaml] = {}
        while line := self._next(indent):
            key = _KEY.match(line.text)
            if key is None:
                break
            if key[1] in pairs:
                raise self.error(line.number, f"the key {key[1]!r} stands twice")
            rest = line.text[key.end() :]
            if rest:
                pairs[key[1]] = self._value(line, rest, indent)
                continue
            self.at += 1
            below = self.lines[self.at] if self.at < len(self.lines) else line
            is_list = below.indent == indent and below.text.startswith("- ")
            if below.number == line.number or not (below.indent > indent or is_list):
                raise self.error(line.number, f"the key {key[1]!r} has no value")
            pairs[key[1]] = self.block(below.indent, level + 1)
        return pairs

    def _value(self, line: _Line, text: str, indent: int) -> Yaml:
        """Return a text, number, or list or mapping in brackets, over several lines."""
        parts = [text]
        self.at += 1
        while self.at < len(self.lines) and self.lines[self.at].indent > indent:
            parts.append(self.lines[self.at].text)
            self.at += 1
        whole = " ".join(parts)
        if text[0] in "'\"" and len(parts) > 1:
            raise self.error(line.number, "a quoted text over several lines")
        flow = _Flow(whole, lambda what: self.error(line.number, what))
        result = flow.value(0) if text[0] in "[{" else flow.scalar(whole)
        if text[0] in "[{" and flow.at != len(whole):
            raise self.error(
                line.number, f"more behind the bracket: {whole[flow.at :]!r}"
            )
        return result


class _Flow:
    """A value in one line: brackets, braces, quotes, words and numbers."""

    def __init__(self, text: str, error: Callable[[str], CannotRunError]) -> None:
        self.text, self.error, self.at = text, error, 0

    def _skip(self) -> str:
        while self.text[self.at : self.at + 1] == " ":
            self.at += 1
        return self.text[self.at : self.at + 1]

    def value(self, level: int) -> Yaml:
        if level > MOST_LEVELS:
            raise self.error(f"more than {MOST_LEVELS} levels")
        if self._skip() == "[":
            return [item for _, item in self._items("]", level)]
        if self._skip() == "{":
            pairs: dict[str, Yaml] = {}
            for key, item in self._items("}", level):
                if key in pairs:
                    raise self.error(f"the key {key!r} stands twice")
                pairs[key] = item
            return pairs
        quoted = _QUOTED.match(self.text, self.at)
        if quoted:
            self.at = quoted.end()
            return self.scalar(quoted[0])
        word = re.split(r"[,\]}\[{]", self.text[self.at :], maxsplit=1)[0]
        self.at += len(word)
        return self.scalar(word.rstrip(" "))

    def _items(self, close: str, level: int) -> Iterator[tuple[str, Yaml]]:
        self.at += 1
        while self._skip() != close:
            key = _KEY.match(self.text, self.at) if close == "}" else None
            if close == "}":
                if key is None:
                    raise self.error(f"no key: {self.text[self.at : self.at + 40]!r}")
                self.at = key.end()
            yield key[1] if key else "", self.value(level + 1)
            if self._skip() == ",":
                self.at += 1
            elif self._skip() != close:
                raise self.error(f"{close!r} or ',' is missing")
        self.at += 1

    def scalar(self, text: str) -> str | int | float:
        if text[:1] in "'\"" and text:
            return self._unquoted(text)
        if text in _INFINITE:  # an open end of a trapezoid; no number elsewhere
            return _INFINITE[text]
        if _NOTHING.fullmatch(text) or _ALIEN.fullmatch(text):
            raise self.error(f"{text!r} has no place in a model")
        if text[0] in "&*!|>@%`?,[]{}#" or text[:2] in ("- ", "--") or ": " in text:
            raise self.error(f"{text[:40]!r} is not read; quotes make it a text")
        if _INTEGER.fullmatch(text):
            return int(text)
        if _NUMBER.fullmatch(text):
            return float(text)
        return text

    def _unquoted(self, text: str) -> str:
        whole = _QUOTED.fullmatch(text)
        if whole is None:
            raise self.error(f"a quote that does not end: {text[:40]!r}")
        if whole[2] is None:
            return whole[1].replace("''", "'")
        return _ESCAPE.sub(self._escaped, whole[2])

    def _escaped(self, result: re.Match[str]) -> str:
        code = result[1]
        if len(code) == 1:
            if code not in _ESCAPES:
                raise self.error(f"no escape: {result[0]!r}")
            return _ESCAPES[code]
        number = int(code[1:], 16)
        if number > 0x10FFFF or 0xD800 <= number < 0xE000:
            raise self.error(f"no character: {result[0]!r}")
        return chr(number)
