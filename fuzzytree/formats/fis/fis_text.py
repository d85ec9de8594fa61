"""FIS text as sections of keys and values that know their line and column."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

import msgspec

from fuzzytree.errors import ReadError
from fuzzytree.formats.text_files import LONGEST_NAME, Found
from fuzzytree.formats.yaml.spots import Group, Spots
from fuzzytree.model.contracts import Loss

MOST_BYTES: Final = 4 * 2**20
MOST_LINES: Final = 60_000

TERM: Final = re.compile(r"MF([0-9]{1,6})")
"""The key of a term."""

_LINE_END = re.compile(r"\r\n|\r|\n")
_FORBIDDEN = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_NUMBERED = re.compile(r"(input|output)\s*([0-9]{1,6})")
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"[-+]?inf(?:inity)?|nan", re.IGNORECASE)
_TOKEN = re.compile(r"[^\s,;]+")


class Entry(msgspec.Struct, frozen=True):
    """A key and its value; line and column of the value, from 1."""

    key: str
    value: str
    line: int
    column: int


class Section(msgspec.Struct, frozen=True):
    """A section: `system`, `rules`, or a numbered `input` or `output`."""

    kind: str
    number: int
    line: int
    entries: list[Entry]


class Notes(msgspec.Struct, frozen=True):
    """What is found on the way: mistakes, losses and remarks are added to the lists."""

    found: list[Found]
    losses: list[Loss]
    remarks: list[str]


class Page(msgspec.Struct, frozen=True):
    """A file: its sections in their order, and the comments between them."""

    sections: tuple[Section, ...]
    comments: tuple[str, ...]
    remarks: tuple[str, ...]


def read_page(content: bytes, name: str, found: list[Found]) -> Page:
    """Return the sections of a file.

    Raises:
        ReadError: If it is too large.
    """
    text, remarks = _decoded(content, name)
    sections: list[Section] = []
    comments: list[str] = []
    seen: dict[tuple[str, int], int] = {}
    lines = _LINE_END.split(text)
    if len(lines) > MOST_LINES:
        raise ReadError(
            f"{name}: {len(lines):,} lines are more than the {MOST_LINES:,} "
            "that are read"
        )
    for number, line in enumerate(lines, 1):
        wrong = _FORBIDDEN.search(line)
        if wrong:
            what = f"character U+{ord(wrong.group()):04X} may not stand in a FIS file"
            found.append((number, wrong.start() + 1, f"{what}; it may be damaged"))
            continue
        plain = line.strip()
        if plain.startswith(("#", "%", "//")):
            comments.append(plain.lstrip("#%/").strip())
        elif plain.startswith("["):
            _start_section((sections, seen), plain, number, line.index("[") + 1, found)
        elif plain and not sections:
            what = f"{plain[:40]!r} stands before the first section, [System]"
            found.append((number, 1, what))
        elif plain:
            _add_entry(sections[-1], line, number, found)
    return Page(tuple(sections), tuple(comments), remarks)


def _decoded(content: bytes, name: str) -> tuple[str, tuple[str, ...]]:
    if len(content) > MOST_BYTES:
        raise ReadError(
            f"{name}: {len(content):,} bytes are more than the {MOST_BYTES:,} "
            "that are read"
        )
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        try:
            return content.decode("utf-16"), ("the file is UTF-16",)
        except UnicodeDecodeError as error:
            raise ReadError(f"{name}:1:1: the file is no whole UTF-16") from error
    try:
        return content.decode("utf-8-sig"), ()
    except UnicodeDecodeError:
        return content.decode("latin-1"), ("the file is not UTF-8; read as Latin-1",)


def _start_section(
    so_far: tuple[list[Section], dict[tuple[str, int], int]],
    plain: str,
    line: int,
    column: int,
    found: list[Found],
) -> None:
    sections, seen = so_far
    inside = plain[1:].partition("]")[0].strip().lower()
    numbered = _NUMBERED.fullmatch(inside)
    kind, number = inside, 0
    if numbered:
        kind, number = numbered.group(1), int(numbered.group(2))
    elif kind not in ("system", "rules"):
        what = f"no section [{inside[:40]}]; there is System, Input1, Output1, Rules"
        found.append((line, column, what))
    first = seen.setdefault((kind, number), line)
    if first != line:
        what = f"section [{inside[:40]}] stands twice; the first is in line {first}"
        found.append((line, column, what))
    sections.append(Section(kind, number, line, []))


def _add_entry(section: Section, line: str, number: int, found: list[Found]) -> None:
    start = len(line) - len(line.lstrip())
    if section.kind == "rules":
        cut = min((at for at in map(line.find, "%#") if at >= 0), default=len(line))
        section.entries.append(Entry("", line[:cut].rstrip(), number, 1))
        return
    key, sign, value = line.partition("=")
    if not sign:
        what = f"{line.strip()[:40]!r} is no key and value, such as Name='tip'"
        found.append((number, start + 1, what))
        return
    column = len(key) + 2 + len(value) - len(value.lstrip())
    section.entries.append(Entry(key.strip(), value.strip(), number, column))


def number_of(text: str) -> float | None:
    """Return a number, `inf` and `nan` included; None if it is none.

    Example:
        >>> number_of("-.5e2"), number_of("1_0"), number_of("1e999")
        (-50.0, None, None)
    """
    if _NUMBER.fullmatch(text):
        value = float(text)
        return value if abs(value) != float("inf") else None
    return float(text) if _INFINITE.fullmatch(text) else None


def numbers_of(text: str, line: int, column: int, found: list[Found]) -> list[float]:
    """Return the numbers of a text, parted by blanks or commas."""
    numbers: list[float] = []
    for token in _TOKEN.finditer(text):
        value = number_of(token.group())
        if value is None:
            what = f"{token.group()[:40]!r} is no number"
            found.append((line, column + token.start(), what))
        else:
            numbers.append(value)
    return numbers


def unquoted(entry: Entry, found: list[Found]) -> str:
    """Return the text between the quotes of a value."""
    value = entry.value
    if value.find("'", 1) > LONGEST_NAME + 1:
        what = f"{entry.key} has more than {LONGEST_NAME} characters"
        found.append((entry.line, entry.column, what))
    if len(value) >= 2 and value[0] == "'":
        end = value.find("'", 1)
        rest = value[end + 1 :].strip() if end > 0 else ""
        if end > 0 and (not rest or rest[0] in "%#"):
            return value[1:end]
        if value[-1] == "'":
            return value[1:-1]  # a quote within the quotes
    what = f"{entry.key} must stand in quotes, such as 'tip', not {value[:40]!r}"
    found.append((entry.line, entry.column, what))
    return value.strip("'")


class Written(msgspec.Struct, frozen=True):
    """`'name' : 'kind', [numbers]`, and the column where the numbers start."""

    name: str
    kind: str
    inside: str
    column: int


def term_of(entry: Entry, found: list[Found]) -> Written | None:
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
        found.append((entry.line, entry.column, what))
        return None
    kind = value[first + 1 : last].strip()
    column = entry.column + open_ + 1
    return Written(name[1:-1], kind, value[open_ + 1 : close], column)


def spots_of(
    inputs: Sequence[Section], outputs: Sequence[Section], rules: Sequence[Entry]
) -> Spots:
    """Return where the parts of a system stand."""
    lines = [(one.line, one.value) for one in rules]
    begins = tuple((n, len(line) - len(line.lstrip()) + 1) for n, line in lines)
    block = Group(begins[0] if begins else (1, 1), begins)
    return Spots(tuple(map(_group, inputs)), tuple(map(_group, outputs)), (block,))


def _group(section: Section) -> Group:
    terms = sorted(
        (int(entry.key[2:]), (entry.line, entry.column))
        for entry in section.entries
        if TERM.fullmatch(entry.key)
    )
    return Group((section.line, 1), tuple(spot for _, spot in terms))
