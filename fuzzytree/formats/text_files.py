"""Text files as lines and words that know their line and column.

For formats that are read line by line. Lines end with LF, CR or both.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import Final

import msgspec

from fuzzytree.errors import ReadError

MOST_BYTES: Final = 4 * 2**20
MOST_SHOWN: Final = 100
LONGEST_MISTAKE: Final = 1_500
LONGEST_NAME: Final = 1000

Found = tuple[int, int, str]
"""A mistake: line and column, both from 1, and a sentence."""

_LINE_END = re.compile(r"\r\n|\r|\n")
_CONTROL = re.compile("[\x00-\x08\x0e-\x1f\x7f]")
_NUMBER = re.compile(
    r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?", re.ASCII
)
_UNLIMITED = {
    f"{sign}{word}": float(f"{sign}{word}")
    for sign in ("", "+", "-")
    for word in ("inf", "infinity", "nan")
}


def report(name: str, found: Sequence[Found]) -> ReadError:
    """Return the error that lists mistakes by line, a hundred at most.

    A sentence that quotes more than it should loses its middle.

    Example:
        >>> len(str(report("x.yaml", [(1, 1, "no term " + "n" * 1_000_000)])))
        1517
    """
    found = sorted(set(found))
    lines = [
        f"{name}:{line}:{column}: {_shortened(text)}" for line, column, text in found
    ]
    if len(lines) > MOST_SHOWN:
        rest = len(lines) - MOST_SHOWN
        more = "1 more mistake" if rest == 1 else f"{rest} more mistakes"
        lines[MOST_SHOWN:] = [f"{name}: and {more}"]
    return ReadError("\n".join(lines))


def _shortened(sentence: str) -> str:
    if len(sentence) <= LONGEST_MISTAKE:
        return sentence
    half = LONGEST_MISTAKE // 2
    return f"{sentence[:half]} ... {sentence[-half:]}"


class Word(msgspec.Struct, frozen=True, gc=False):
    """A text without blanks, and where it stands; both from 1."""

    text: str
    line: int
    column: int

    def mistake(self, sentence: str) -> Found:
        """Return a mistake at this word."""
        return self.line, self.column, sentence


def decoded(
    content: bytes, name: str, most: int = MOST_BYTES
) -> tuple[str, tuple[str, ...]]:
    """Return the text of a file, and a remark if it is not UTF-8.

    Raises:
        ReadError: If it is too large, is UTF-16, or has control characters.
    """
    if len(content) > most:
        text = (
            f"{name}: {len(content):,} bytes are more than the {most:,} that are read"
        )
        raise ReadError(text)
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        sentence = "a file of UTF-16; it must be saved as UTF-8"
        raise report(name, [(1, 1, sentence)])
    remarks: tuple[str, ...] = ()
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
        remarks = ("the file is not UTF-8; read as Latin-1",)
    wrong = _CONTROL.search(text)
    if wrong:
        sentence = f"character U+{ord(wrong.group()):04X}; the file may be damaged"
        raise report(name, [(*_place(text[: wrong.start()]), sentence)])
    return text, remarks


def _place(before: str) -> tuple[int, int]:
    lines = split_lines(before)
    return len(lines), len(lines[-1]) + 1


def split_lines(text: str) -> list[str]:
    r"""Return the lines of a text, without their ends.

    Example:
        >>> split_lines("a\r\nb\rc\n")
        ['a', 'b', 'c', '']
    """
    return _LINE_END.split(text)


def words(text: str, line: int, column: int, signs: str = "") -> Iterator[Word]:
    """Yield the words of a text; each of `signs` is a word of its own.

    Returns:
        The words; one that is longer than any name ends in dots.

    Example:
        >>> [word.text for word in words("if (a is b)", 1, 1, "()")]
        ['if', '(', 'a', 'is', 'b', ')']
    """
    marked = re.escape(signs)
    pattern = rf"[{marked}]|[^\s{marked}]+" if signs else r"\S+"
    for found in re.finditer(pattern, text):
        word = found.group()
        if len(word) > LONGEST_NAME:
            word = f"{word[:LONGEST_NAME]}..."
        yield Word(word, line, column + found.start())


def number_of(text: str) -> float | None:
    """Return the number that a text is, None if it is none; too large gives None.

    Example:
        >>> number_of("-1.5e3"), number_of("inf"), number_of("1_000")
        (-1500.0, inf, None)
    """
    if text.lower() in _UNLIMITED:
        return _UNLIMITED[text.lower()]
    if not _NUMBER.fullmatch(text):
        return None
    value = float(text)
    return None if math.isinf(value) else value
