"""YAML text as a tree of nodes that know their line and column.

The tree is built from events, without recursion and within limits, by the rules of
YAML 1.2's core schema: `off`, `no`, `12:30` and `1_000` are text, `1e-05` is a number.
Tags, anchors, aliases and several documents are refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final, Literal

import msgspec
import yaml
from yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    Event,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

from fuzzytree.formats.text_files import (
    FileMistake,
    check_characters,
    check_size,
    position_behind,
    report,
)

MOST_BYTES: Final = 64 * 2**20
MOST_NODES: Final = 1_000_000
MOST_LEVELS: Final = 32


class Scalar(msgspec.Struct, frozen=True, gc=False):
    """A text, or a number or word that is not quoted; `line` and `column` from 1."""

    text: str
    is_plain: bool
    line: int
    column: int


class ListNode(msgspec.Struct, frozen=True):
    """A list."""

    items: tuple[Node, ...]
    line: int
    column: int


class MappingNode(msgspec.Struct, frozen=True):
    """Pairs of a key and a value, in order, repeated keys included."""

    pairs: tuple[tuple[Node, Node], ...]
    line: int
    column: int


class Refused(msgspec.Struct, frozen=True):
    """A node that was refused when it was met: an alias."""

    line: int
    column: int


Node = Scalar | ListNode | MappingNode | Refused
Meaning = Literal["text", "an integer", "a number", "a truth value", "nothing"]

_WORDS: dict[str, Meaning] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), "nothing"),
    **dict.fromkeys(
        ("true", "True", "TRUE", "false", "False", "FALSE"), "a truth value"
    ),
}
_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_NUMBER = re.compile(
    r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
    r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)"
)
_FORBIDDEN = re.compile(
    "[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
)
_OLD_LINE_ENDS = re.compile("[\x85\u2028\u2029]")
"""PyYAML ends a line, and a comment, at them; YAML 1.2 does not."""


def meaning(scalar: Scalar) -> Meaning:
    """Return what a scalar is by the core schema of YAML 1.2.

    Example:
        >>> [meaning(Scalar(text, True, 1, 1)) for text in ("no", "1e-05", "1_000")]
        ['text', 'a number', 'text']
    """
    if not scalar.is_plain:
        return "text"
    text = scalar.text
    if text in _WORDS:
        return _WORDS[text]
    if text[0] not in "+-.0123456789":
        return "text"
    if _INTEGER.fullmatch(text):
        return "an integer"
    return "a number" if _NUMBER.fullmatch(text) else "text"


def compose(content: bytes, name: str) -> tuple[Node, list[FileMistake]]:
    """Return the only document of a YAML file, and the tags and anchors refused.

    Raises:
        ReadError: If it is no UTF-8, no YAML, empty, too large or too deep.
    """
    text = _decoded(content, name)
    # Commas and lines part entries: twice as many as may be are seen without parsing.
    if text.count(",") + text.count("\n") > 2 * MOST_NODES:
        raise report(name, [(1, 1, f"more than {MOST_NODES:,} entries")])
    root: list[Node] = []
    mistakes: list[FileMistake] = []
    open_: list[tuple[Event, list[Node]]] = []
    count = 0
    for event in _events(text, name):
        siblings = open_[-1][1] if open_ else root
        match event:
            case DocumentStartEvent():
                mistakes += _document_mistakes(event, is_first=not root)
                if root:
                    raise report(name, mistakes)
                continue
            case ScalarEvent():
                siblings.append(
                    Scalar(event.value, event.style in (None, ""), *_start(event))
                )
            case AliasEvent():
                siblings.append(Refused(*_start(event)))
            case MappingStartEvent() | SequenceStartEvent():
                open_.append((event, []))
            case MappingEndEvent() | SequenceEndEvent():
                node = _closed(*open_.pop())
                (open_[-1][1] if open_ else root).append(node)
                continue
            case _:
                continue
        mistakes += _refused(event)
        count += 1
        too_much = _limit_passed(count, len(open_))
        if too_much:
            raise report(name, [*mistakes, (*_start(event), too_much)])
    if not root:
        raise report(name, [(1, 1, "the file is empty")])
    return root[0], mistakes


def _limit_passed(count: int, levels: int) -> str:
    if levels > MOST_LEVELS:
        return f"more than {MOST_LEVELS} levels of nesting"
    return f"more than {MOST_NODES:,} entries" if count > MOST_NODES else ""


def _start(event: Event) -> tuple[int, int]:
    mark = event.start_mark
    return (1, 1) if mark is None else (mark.line + 1, mark.column + 1)


def _decoded(content: bytes, name: str) -> str:
    check_size(content, name, MOST_BYTES)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = content[: error.start].decode("utf-8", "replace")
        byte = f"byte 0x{content[error.start]:02x} is not UTF-8"
        sentence = f"{byte}; the file must be saved as UTF-8"
        raise report(name, [(*position_behind(before), sentence)]) from error
    check_characters(text, name, _FORBIDDEN)
    why = (
        "ends a line in YAML 1.1 and not in YAML 1.2; leave it out, or write it as an "
    )
    check_characters(text, name, _OLD_LINE_ENDS, f"{why}escape in double quotes")
    return text


def _events(text: str, name: str) -> Iterator[Event]:
    """Yield the events of a YAML text; libyaml is used where it is built in."""
    loader: type[yaml.CSafeLoader] | type[yaml.SafeLoader]
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        yield from yaml.parse(text, Loader=loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        what = ", ".join(filter(None, (error.context, error.problem)))
        raise report(name, [(line, column, f"not YAML: {what}")]) from error
    except yaml.YAMLError as error:
        what = " ".join(str(error).split())
        raise report(name, [(1, 1, f"not YAML: {what}")]) from error


def _document_mistakes(
    event: DocumentStartEvent, *, is_first: bool
) -> list[FileMistake]:
    if not is_first:
        return [(*_start(event), "a second document; a file holds one model")]
    if event.version not in (None, (1, 2)):
        version = ".".join(map(str, event.version))
        text = f"a file of YAML {version}; files are read as YAML 1.2"
        return [(*_start(event), text)]
    return []


def _refused(event: Event) -> Iterator[FileMistake]:
    if isinstance(event, AliasEvent):
        yield *_start(event), "aliases are not read; repeat the value"
    elif isinstance(event, ScalarEvent | MappingStartEvent | SequenceStartEvent):
        if event.anchor is not None:
            yield *_start(event), f"anchors are not read; leave out '&{event.anchor}'"
        if event.tag is not None:
            yield *_start(event), f"tags are not read; leave out {event.tag!r}"


def _closed(start: Event, items: list[Node]) -> Node:
    if isinstance(start, MappingStartEvent):
        pairs = zip(items[::2], items[1::2], strict=True)
        return MappingNode(tuple(pairs), *_start(start))
    return ListNode(tuple(items), *_start(start))
