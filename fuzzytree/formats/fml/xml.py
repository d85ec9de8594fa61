"""XML as elements that know their line and column, without anything that can explode.

A document type, and with it every entity, is refused; depth, size and the number of
elements are limited. Encodings are those that expat knows: UTF-8, UTF-16, Latin-1.
"""

from __future__ import annotations

from typing import Final
from xml.parsers import expat

import msgspec

from fuzzytree.errors import ReadError
from fuzzytree.formats.text_files import Position, check_size, report

MOST_BYTES: Final = 16 * 2**20
MOST_ELEMENTS: Final = 200_000
MOST_LEVELS: Final = 64
LONGEST_TEXT: Final = 100_000


class FmlElement(msgspec.Struct):
    """An element; line and column from 1."""

    name: str
    namespace: str
    attributes: dict[str, str]
    line: int
    column: int
    children: list[FmlElement]
    text: str = ""

    @property
    def position(self) -> Position:
        """Where it starts."""
        return self.line, self.column

    def all(self, name: str) -> list[FmlElement]:
        """Return the children of a name."""
        return [child for child in self.children if child.name == name]


class FmlDocument(msgspec.Struct, frozen=True):
    """A file: its root, and its comments in order."""

    root: FmlElement
    comments: tuple[str, ...]


def parse(content: bytes, name: str) -> FmlDocument:
    """Return what a file holds.

    Raises:
        ReadError: If it is no XML, has a document type, or is too large or too deep.

    Example:
        >>> parse(b'<a x="1"><b>  c </b></a>', "a.xml").root.all("b")[0].text
        'c'
    """
    check_size(content, name, MOST_BYTES)
    building = _Building(name)
    try:
        building.parser.Parse(content, True)
    except expat.ExpatError as error:
        sentence = f"no well-formed XML: {expat.ErrorString(error.code)}"
        raise report(name, [(error.lineno, error.offset + 1, sentence)]) from error
    except ReadError:
        raise
    except (LookupError, ValueError) as error:  # an encoding that Python does not know
        raise report(name, [(1, 1, "the file's encoding is unknown")]) from error
    assert building.root is not None  # a document without a root is not well-formed
    return FmlDocument(building.root, tuple(building.comments))


class _Building:
    """Hears what expat finds."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.root: FmlElement | None = None
        self.comments: list[str] = []
        self.open: list[FmlElement] = []
        self.texts: list[list[str]] = []
        self.count = 0
        parser = expat.ParserCreate(namespace_separator=" ")
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._text
        parser.CommentHandler = self.comments.append
        parser.StartDoctypeDeclHandler = self._doctype
        parser.EntityDeclHandler = self._doctype
        self.parser = parser

    def _refuse(self, sentence: str) -> ReadError:
        line = self.parser.CurrentLineNumber
        return report(
            self.name, [(line, self.parser.CurrentColumnNumber + 1, sentence)]
        )

    def _doctype(self, *_: object) -> None:
        raise self._refuse("a document type (DOCTYPE) and entities are not read")

    def _start(self, full: str, attributes: dict[str, str]) -> None:
        self.count += 1
        if self.count > MOST_ELEMENTS:
            raise self._refuse(f"more than {MOST_ELEMENTS:,} elements")
        if len(self.open) >= MOST_LEVELS:
            raise self._refuse(f"nested deeper than {MOST_LEVELS} levels")
        namespace, _, name = full.rpartition(" ")
        result = FmlElement(
            name,
            namespace,
            {key: value for key, value in attributes.items() if " " not in key},
            self.parser.CurrentLineNumber,
            self.parser.CurrentColumnNumber + 1,
            [],
        )
        if self.open:
            self.open[-1].children.append(result)
        else:
            self.root = result
        self.open.append(result)
        self.texts.append([])

    def _end(self, _: str) -> None:
        text = "".join(self.texts.pop()).strip()
        if len(text) > LONGEST_TEXT:
            raise self._refuse(f"a text of more than {LONGEST_TEXT:,} characters")
        self.open.pop().text = text

    def _text(self, text: str) -> None:
        self.texts[-1].append(text)
