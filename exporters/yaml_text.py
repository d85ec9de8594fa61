"""Entries as the lines of a YAML file.

Words and numbers are written so that readers of YAML 1.1 and of YAML 1.2 read the same.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator
from typing import Final

import msgspec

from fuzzytree.errors import LossError
from fuzzytree.formats import LONGEST_NAME, MOST_BYTES, MOST_NODES
from fuzzytree.model import LR, Band, Loss, Part, Points, Shape, Side

_WIDTH: Final = 88


class Short(msgspec.Struct, frozen=True):
    """A mapping or list that stands in one line if it fits.

    If not, a list of numbers or names runs on in further lines (`is_run_on`), anything
    else has a line for each entry.
    """

    entries: Entries
    is_run_on: bool = False


class Noted(msgspec.Struct, frozen=True):
    """A text or number with a comment behind it."""

    value: str | float
    note: str


Scalar = str | float | int
Entries = dict[str, "Entry"] | list["Entry"]
Entry = Scalar | Noted | Short | dict[str, "Entry"] | list["Entry"]


def joined(name: str, title: str, entries: dict[str, Entry]) -> bytes:
    """Return the file of a model; refuse one that is too large to be read again."""
    size = 0
    lines: list[str] = []
    for line in itertools.chain([title], _block(entries, 0)):
        lines.append(line)
        size += len(line) + 1
        if size > MOST_BYTES:
            break
    content = ("\n".join(lines) + "\n").encode()
    if len(content) > MOST_BYTES or _count(entries) > MOST_NODES:
        raise LossError(
            f"cannot write {name} as yaml: a file of more than {MOST_BYTES:,} bytes "
            f"or {MOST_NODES:,} entries is not read again"
        )
    return content


def _count(entry: Entry) -> int:
    """Return how many nodes of YAML an entry makes."""
    match entry:
        case Short():
            return _count(entry.entries)
        case dict():
            return 1 + len(entry) + sum(map(_count, entry.values()))
        case list():
            return 1 + sum(map(_count, entry))
        case _:
            return 1


def _block(entries: Entries, indent: int) -> Iterator[str]:
    """Yield the lines of a mapping or list, indented."""
    pad = " " * indent
    if isinstance(entries, dict):
        for key, entry in entries.items():
            yield from _pair(f"{pad}{_text(key)}:", entry, indent)
        return
    for entry in entries:
        if isinstance(entry, Short):
            line = f"{pad}- {_flow(entry)}"
            if len(line) <= _WIDTH:
                yield line
                continue
            entry = entry.entries
        if isinstance(entry, dict | list):
            lines = _block(entry, indent + 2)
            yield f"{pad}- {next(lines)[indent + 2 :]}"
            yield from lines
        else:
            yield from _wrapped(f"{pad}- {_scalar(entry)}", indent + 2)


def _pair(head: str, entry: Entry, indent: int) -> Iterator[str]:
    if isinstance(entry, Short):
        line = f"{head} {_flow(entry)}"
        if len(line) <= _WIDTH:
            yield line
            return
        if entry.is_run_on:
            yield from _run_on(head, entry.entries, indent)
            return
        entry = entry.entries
    if isinstance(entry, dict | list):
        yield head
        yield from _block(entry, indent + 2 if isinstance(entry, dict) else indent)
    else:
        yield f"{head} {_scalar(entry)}"


def _run_on(head: str, entries: Iterable[Entry], indent: int) -> Iterator[str]:
    """Yield a list in brackets that fills its lines."""
    line = f"{head} ["
    tokens = [f"{_flow(entry)}," for entry in entries]
    tokens[-1] = f"{tokens[-1][:-1]}]"
    for token in tokens:
        separator = "" if line.endswith("[") else " "
        if separator and len(line) + 1 + len(token) > _WIDTH:
            yield line
            line = " " * (indent + 2) + token
        else:
            line += separator + token
    yield line


def _wrapped(line: str, indent: int) -> Iterator[str]:
    """Yield a line, broken before ` or ` where it is long and a reader joins it."""
    pieces = line.split(" or ")
    is_quoted = line.lstrip(" -")[:1] in "'\""
    if len(line) <= _WIDTH or is_quoted or any(p != p.strip() for p in pieces[1:]):
        yield line
        return
    line = pieces[0]
    for piece in pieces[1:]:
        if len(line) + len(piece) + 4 > _WIDTH:
            yield line
            line = f"{' ' * indent}or {piece}"
        else:
            line += f" or {piece}"
    yield line


def _flow(entry: Entry) -> str:
    """Return an entry in one line."""
    match entry:
        case Short():
            return _flow(entry.entries)
        case dict():
            pairs = [f"{_text(key)}: {_flow(one)}" for key, one in entry.items()]
            return f"{{{', '.join(pairs)}}}"
        case list():
            return f"[{', '.join(map(_flow, entry))}]"
        case _:
            return _scalar(entry)


_PLAIN: Final = re.compile(r"(?:[^\W_]|°)(?:[\w .()/%+*^°²-]*[\w.()/%+*^°²-])?")
_WORDS: Final = frozenset(
    ["y", "n", "yes", "no", "on", "off", "true", "false", "null", "nan", "inf"]
)
_LETTER_AND_SPACE: Final = re.compile(r"(?=.*[^\W\d_]).* ")


def _scalar(value: Scalar | Noted) -> str:
    match value:
        case Noted():
            return f"{_scalar(value.value)}  # {value.note}"
        case float():
            return _number(value)
        case int():
            return str(value)
        case str():
            return _text(value)


def _number(value: float) -> str:
    """Return the shortest digits that give the same number in any version of YAML."""
    text = float.__repr__(value)
    if text.lstrip("-") in ("inf", "nan"):
        return text.replace("inf", ".inf").replace("nan", ".nan")
    mantissa, mark, exponent = text.partition("e")
    return f"{mantissa}.0e{exponent}" if mark and "." not in mantissa else text


def _text(text: str) -> str:
    """Return a text with quotes if any reader could take it for something else."""
    is_plain = _PLAIN.fullmatch(text) and text.lower() not in _WORDS
    if is_plain and (not text[0].isdecimal() or _LETTER_AND_SPACE.match(text)):
        return text
    if text.isprintable():
        return "'" + text.replace("'", "''") + "'"
    return '"' + "".join(map(_escaped, text)) + '"'


def _escaped(character: str) -> str:
    if character in '"\\':
        return f"\\{character}"
    if character.isprintable():
        return character
    code = ord(character)
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def name_losses(names: Iterable[tuple[str, str]]) -> Iterator[Loss]:
    """Yield the names that are too long or no Unicode text.

    Args:
        names: What each is the name of, and the name.
    """
    for where, text in names:
        if len(text) > LONGEST_NAME:
            what = f"{len(text)} characters are more than the {LONGEST_NAME} of a name"
            yield Loss(f"{where} {text[:20]!r}...", what)
        yield from text_losses(where, text)


def text_losses(where: str, text: str) -> Iterator[Loss]:
    """Yield a loss if a text is no Unicode text."""
    try:
        text.encode()
    except UnicodeEncodeError:
        yield Loss(f"{where} {text[:20]!r}", "a lone surrogate is no Unicode text")


def range_ends(low: float | None, high: float | None) -> dict[str, Entry]:
    """Return the known ends of a range."""
    ends: dict[str, Entry] = {}
    if low is not None:
        ends["from"] = float(low)
    if high is not None:
        ends["to"] = float(high)
    return ends


def summand(part: Part) -> Short:
    """Return a summand of a combination."""
    entries: dict[str, Entry] = {"input": part.input, "weight": float(part.weight)}
    if repr(float(part.centre)) != "0.0":
        entries["centre"] = float(part.centre)
    return Short(entries)


def named_shape(name: str, shape: Shape) -> dict[str, Entry]:
    """Return a term."""
    match shape:
        case Band():
            return {"name": name, **_band(shape)}
        case LR(mean, left, right):
            middle: dict[str, Entry] = {"name": name, "mean": float(mean)}
            if repr(left) == repr(right):  # 0.0 and -0.0 differ
                return middle | _side(left)
            return {**middle, "left": Short(_side(left)), "right": Short(_side(right))}
        case Points(values, degrees):
            pairs = zip(values, degrees, strict=True)
            return {
                "name": name,
                "points": Short([*map(numbers, pairs)], is_run_on=True),
            }


def _band(band: Band) -> dict[str, Entry]:
    entries: dict[str, Entry] = {}
    values = {
        "0 up to": band.left,
        "above": band.low,
        "up to": band.high,
        "0 from": band.right,
    }
    for key, value in values.items():
        if value is not None:
            entries[key] = float(value)
    return entries or {"degree": 1}


def _side(side: Side) -> dict[str, Entry]:
    return {
        "spread": float(side.spread),
        "curve": numbers(side.curve),
        "reach": float(side.reach),
    }


def numbers(values: Iterable[float]) -> Short:
    """Return numbers in brackets."""
    return Short([*map(float, values)], is_run_on=True)
