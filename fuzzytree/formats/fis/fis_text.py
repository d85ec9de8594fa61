"""FIS text as sections of keys and values that know their line and column."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

import msgspec

from fuzzytree.errors import ReadError
from fuzzytree.formats.positions import PositionGroup, Positions
from fuzzytree.formats.text_files import (
    LONGEST_NAME,
    FileMistake,
    Position,
    ReaderNotes,
    check_characters,
    decoded,
    number_of,
    split_lines,
)

MOST_BYTES: Final = 4 * 2**20
MOST_LINES: Final = 60_000

TERM: Final = re.compile(r"MF([0-9]{1,6})")
"""The key of a term."""

_FORBIDDEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_NUMBERED = re.compile(r"(input|output)\s*([0-9]{1,6})")
_TOKEN = re.compile(r"[^\s,;]+")


class FisEntry(msgspec.Struct, frozen=True):
    """A key and its value; line and column of the value, from 1."""

    key: str
    value: str
    line: int
    column: int

    @property
    def position(self) -> Position:
        """Where the value stands."""
        return self.line, self.column


class FisSection(msgspec.Struct, frozen=True):
    """A section: `system`, `rules`, or a numbered `input` or `output`."""

    kind: str
    number: int
    line: int
    entries: list[FisEntry]


class FisFile(msgspec.Struct, frozen=True):
    """A file: its sections in their order, and the comments between them."""

    sections: tuple[FisSection, ...]
    comments: tuple[str, ...]


def read_page(content: bytes, name: str, notes: ReaderNotes) -> FisFile:
    """Return the sections of a file.

    Raises:
        ReadError: If it is too large.
    """
    text, remarks = decoded(content, name, MOST_BYTES, reads_utf16=True)
    notes.remarks.extend(remarks)
    result = notes.mistakes
    check_characters(text, name, _FORBIDDEN)
    sections: list[FisSection] = []
    comments: list[str] = []
    earlier: dict[tuple[str, int], int] = {}
    lines = split_lines(text)
    if len(lines) > MOST_LINES:
        raise ReadError(
            f"{name}: {len(lines):,} lines are more than the {MOST_LINES:,} "
            "that are read"
        )
    for number, line in enumerate(lines, 1):
        plain = line.strip()
        if plain.startswith(("#", "%", "//")):
            comments.append(plain.lstrip("#%/").strip())
        elif plain.startswith("["):
            _start_section(
                (sections, earlier), plain, number, line.index("[") + 1, result
            )
        elif plain and not sections:
            what = f"{plain[:40]!r} stands before the first section, [System]"
            result.append((number, 1, what))
        elif plain:
            _add_entry(sections[-1], line, number, result)
    return FisFile(tuple(sections), tuple(comments))


def _start_section(
    so_far: tuple[list[FisSection], dict[tuple[str, int], int]],
    plain: str,
    line: int,
    column: int,
    mistakes: list[FileMistake],
) -> None:
    sections, earlier = so_far
    inside = plain[1:].partition("]")[0].strip().lower()
    numbered = _NUMBERED.fullmatch(inside)
    kind, number = inside, 0
    if numbered:
        kind, number = numbered.group(1), int(numbered.group(2))
    elif kind not in ("system", "rules"):
        what = f"no section [{inside[:40]}]; there is System, Input1, Output1, Rules"
        mistakes.append((line, column, what))
    first = earlier.setdefault((kind, number), line)
    if first != line:
        what = f"section [{inside[:40]}] stands twice; the first is in line {first}"
        mistakes.append((line, column, what))
    sections.append(FisSection(kind, number, line, []))


def _add_entry(
    section: FisSection, line: str, number: int, mistakes: list[FileMistake]
) -> None:
    start = len(line) - len(line.lstrip())
    if section.kind == "rules":
        cut = min((at for at in map(line.find, "%#") if at >= 0), default=len(line))
        section.entries.append(FisEntry("", line[:cut].rstrip(), number, 1))
        return
    key, sign, value = line.partition("=")
    if not sign:
        what = f"{line.strip()[:40]!r} is no key and value, such as Name='tip'"
        mistakes.append((number, start + 1, what))
        return
    column = len(key) + 2 + len(value) - len(value.lstrip())
    section.entries.append(FisEntry(key.strip(), value.strip(), number, column))


def numbers_of(
    text: str, line: int, column: int, mistakes: list[FileMistake]
) -> list[float]:
    """Return the numbers of a text, parted by blanks or commas."""
    numbers: list[float] = []
    for token in _TOKEN.finditer(text):
        value = number_of(token.group())
        if value is None:
            what = f"{token.group()[:40]!r} is no number"
            mistakes.append((line, column + token.start(), what))
        else:
            numbers.append(value)
    return numbers


def unquoted(entry: FisEntry, mistakes: list[FileMistake]) -> str:
    """Return the text between the quotes of a value."""
    value = entry.value
    if value.find("'", 1) > LONGEST_NAME + 1:
        what = f"{entry.key} has more than {LONGEST_NAME} characters"
        mistakes.append((entry.line, entry.column, what))
    if len(value) >= 2 and value[0] == "'":
        end = value.find("'", 1)
        rest = value[end + 1 :].strip() if end > 0 else ""
        if end > 0 and (not rest or rest[0] in "%#"):
            return value[1:end]
        if value[-1] == "'":
            return value[1:-1]  # a quote within the quotes
    what = f"{entry.key} must stand in quotes, such as 'tip', not {value[:40]!r}"
    mistakes.append((entry.line, entry.column, what))
    return value.strip("'")


class FisTerm(msgspec.Struct, frozen=True):
    """`'name' : 'kind', [numbers]`, and the column where the numbers start."""

    name: str
    kind: str
    inside: str
    column: int


def term_of(entry: FisEntry, mistakes: list[FileMistake]) -> FisTerm | None:
    """Return the parts of a term; the last quotes are the kind's."""
    value = entry.value
    open_, close = value.rfind("["), value.rfind("]")
    last = value.rfind("'", 0, open_ if open_ >= 0 else len(value))
    first = value.rfind("'", 0, last) if last > 0 else -1
    head = value[:first].rstrip() if first > 0 else ""
    name = head[:-1].rstrip() if head.endswith(":") else ""
    between = value[last + 1 : open_].strip()
    is_whole = len(name) >= 2 and name[0] == "'" and name[-1] == "'"
    if not is_whole or open_ < last or close < open_ or between not in (",", ""):
        what = f"{entry.key} must be like 'low':'trimf',[0 1 2], not {value[:60]!r}"
        mistakes.append((entry.line, entry.column, what))
        return None
    kind = value[first + 1 : last].strip()
    column = entry.column + open_ + 1
    return FisTerm(name[1:-1], kind, value[open_ + 1 : close], column)


def positions_of(
    inputs: Sequence[FisSection],
    outputs: Sequence[FisSection],
    rules: Sequence[FisEntry],
) -> Positions:
    """Return where the parts of a system stand."""
    lines = [(one.line, one.value) for one in rules]
    begins = tuple((n, len(line) - len(line.lstrip()) + 1) for n, line in lines)
    block = PositionGroup(begins[0] if begins else (1, 1), begins)
    return Positions(tuple(map(_group, inputs)), tuple(map(_group, outputs)), (block,))


def _group(section: FisSection) -> PositionGroup:
    terms = sorted(
        (int(entry.key[2:]), entry.position)
        for entry in section.entries
        if TERM.fullmatch(entry.key)
    )
    return PositionGroup((section.line, 1), tuple(position for _, position in terms))
