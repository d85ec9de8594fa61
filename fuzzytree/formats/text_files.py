"""What readers share: text with positions, numbers, and notes on what a file says.

Lines end with LF, CR or both. Lines and columns count from 1.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final

import msgspec

from fuzzytree.errors import ReadError
from fuzzytree.model import Document, Locate, Loss, Mistake, Path, Reading, name_choice
from fuzzytree.semantics import numbers_of, places_of

MOST_BYTES: Final = 4 * 2**20
MOST_SHOWN: Final = 100
LONGEST_MISTAKE: Final = 1_500
LONGEST_NAME: Final = 1000

Position = tuple[int, int]
"""A line and a column."""

FileMistake = tuple[int, int, str]
"""A line, a column, and a sentence."""

CONTROL: Final = re.compile("[\x00-\x08\x0e-\x1f\x7f]")
_LINE_END = re.compile(r"\r\n|\r|\n")
_NUMBER = re.compile(
    r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?", re.ASCII
)
_UNLIMITED = re.compile("[-+]?(?:inf|infinity|nan)", re.IGNORECASE | re.ASCII)


class PartError(ReadError):
    """A part of a file, such as a rule or a term, that cannot be read."""

    def __init__(self, *mistakes: FileMistake) -> None:
        self.mistakes = mistakes
        super().__init__("; ".join(sentence for _, _, sentence in mistakes))


class ReaderNotes(msgspec.Struct, frozen=True):
    """The mistakes, losses and remarks that a reader collects, and other dialects."""

    mistakes: list[FileMistake] = msgspec.field(default_factory=list)
    losses: list[Loss] = msgspec.field(default_factory=list)
    remarks: list[str] = msgspec.field(default_factory=list)
    rivals: list[str] = msgspec.field(default_factory=list)
    dialect: str = ""  # as named by the caller

    def mistake(self, position: Position, sentence: str) -> None:
        """Add a mistake."""
        self.mistakes.append((*position, sentence))

    def loss(self, where: str, what: str) -> None:
        """Add a loss."""
        self.losses.append(Loss(where, what))

    def remark(self, sentence: str) -> None:
        """Add a remark."""
        self.remarks.append(sentence)

    @property
    def is_full(self) -> bool:
        """Whether there are so many mistakes that the reader looks for no more."""
        return len(self.mistakes) >= MOST_SHOWN

    def reading(self, model: Document, locate: Locate, dialect: str = "") -> Reading:
        """Return a model with the losses and remarks."""
        losses, remarks = tuple(self.losses), tuple(self.remarks)
        return Reading(model, losses, remarks, locate, dialect, tuple(self.rivals))


def report(name: str, mistakes: Sequence[FileMistake]) -> ReadError:
    """Return the error that lists mistakes by line, a hundred at most.

    A sentence that quotes more than it should loses its middle.

    Example:
        >>> len(str(report("x.yaml", [(1, 1, "no term " + "n" * 1_000_000)])))
        1517
    """
    result = sorted(set(mistakes))
    lines = [
        f"{name}:{line}:{column}: {_shortened(text)}" for line, column, text in result
    ]
    if len(lines) > MOST_SHOWN:
        rest = len(lines) - MOST_SHOWN
        more = "1 more mistake" if rest == 1 else f"{rest} more mistakes"
        lines[MOST_SHOWN:] = [f"{name}: and at least {more}"]
    return ReadError("\n".join(lines))


def _shortened(sentence: str) -> str:
    if len(sentence) <= LONGEST_MISTAKE:
        return sentence
    half = LONGEST_MISTAKE // 2
    return f"{sentence[:half]} ... {sentence[-half:]}"


class Word(msgspec.Struct, frozen=True, gc=False):
    """A text without blanks, and its position."""

    text: str
    line: int
    column: int

    @property
    def position(self) -> Position:
        """Its line and column."""
        return self.line, self.column

    def mistake(self, sentence: str) -> FileMistake:
        """Return a mistake at this word."""
        return self.line, self.column, sentence


def check_size(content: bytes, name: str, most: int) -> None:
    """Refuse a file of more than `most` bytes.

    Raises:
        ReadError: If it is larger.
    """
    if len(content) > most:
        raise ReadError(
            f"{name}: {len(content):,} bytes are more than the {most:,} that are read"
        )


def decoded(
    content: bytes, name: str, most: int = MOST_BYTES, *, reads_utf16: bool = False
) -> tuple[str, tuple[str, ...]]:
    """Return the text of a file, and a remark if it is not UTF-8.

    Raises:
        ReadError: If it is larger than `most` bytes, or UTF-16 that is not wanted.
    """
    check_size(content, name, most)
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        sentence = "a file of UTF-16; it must be saved as UTF-8"
        if reads_utf16:
            try:
                return content.decode("utf-16"), (
                    "the file is not UTF-8; read as UTF-16",
                )
            except UnicodeDecodeError:
                sentence = "the UTF-16 text of the file is incomplete"
        raise report(name, [(1, 1, sentence)])
    try:
        return content.decode("utf-8-sig"), ()
    except UnicodeDecodeError:
        return content.decode("latin-1"), ("the file is not UTF-8; read as Latin-1",)


def check_characters(
    text: str,
    name: str,
    forbidden: re.Pattern[str],
    why: str = "is not allowed here; the file may be damaged",
) -> None:
    """Refuse a text with a character that no such file has.

    Raises:
        ReadError: With the first of them.
    """
    match = forbidden.search(text)
    if match:
        sentence = f"the character U+{ord(match.group()):04X} {why}"
        raise report(name, [(*position_behind(text[: match.start()]), sentence)])


def position_behind(text: str) -> Position:
    """Return the line and column of what follows a text."""
    lines = split_lines(text)
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

    A word that is longer than any name ends in dots.

    Example:
        >>> [word.text for word in words("if (a is b)", 1, 1, "()")]
        ['if', '(', 'a', 'is', 'b', ')']
    """
    marked = re.escape(signs)
    pattern = rf"[{marked}]|[^\s{marked}]+" if signs else r"\S+"
    for match in re.finditer(pattern, text):
        word = match.group()
        if len(word) > LONGEST_NAME:
            word = f"{word[:LONGEST_NAME]}..."
        yield Word(word, line, column + match.start())


def number_of(text: str) -> float | None:
    """Return the number that a text is, None if it is none; too large gives None.

    Example:
        >>> number_of("-1.5e3"), number_of("inf"), number_of("1_000")
        (-1500.0, inf, None)
    """
    if _UNLIMITED.fullmatch(text):
        return float(text)
    if not _NUMBER.fullmatch(text):
        return None
    value = float(text)
    return None if math.isinf(value) else value


def no_such(what: str, name: str, known: Iterable[str]) -> str:
    """Return the sentence on an unknown name.

    Example:
        >>> no_such("method", "COK", ["COG", "COA"])
        "no method 'COK'; there is COG, COA (did you mean 'COG'?)"
    """
    shown = name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..."
    return f"no {what} {shown!r}; {name_choice(name[:99], known)}"


Positions = dict[Path, Position]
"""Where the parts of a system stand, by their paths."""

PositionGroup = tuple[Position, Iterable[Position]]
"""Where a variable or a block stands, and its terms or rules."""


def positions_of(
    variables: Iterable[PositionGroup],
    outputs: Iterable[PositionGroup],
    blocks: Iterable[PositionGroup],
) -> Positions:
    """Return where the parts of a system stand.

    Example:
        >>> list(positions_of([], [], [((3, 1), [(4, 7)])]))
        [('blocks', 0), ('blocks', 0, 'rules', 0)]
    """
    groups = (("variables", "terms", variables), ("outputs", "terms", outputs))
    positions: Positions = {}
    for field, inner, some in (*groups, ("blocks", "rules", blocks)):
        for k, (head, parts) in enumerate(some):
            positions[field, k] = head
            positions |= {(field, k, inner, j): one for j, one in enumerate(parts)}
    return positions


def _find(positions: Positions, path: Path) -> Position | None:
    """Return where the smallest part stands that contains what is at a path."""
    outer = (path[:size] for size in range(len(path), 0, -1))
    return next((positions[one] for one in outer if one in positions), None)


def placed(positions: Positions, mistakes: Iterable[Mistake]) -> list[FileMistake]:
    """Return what is wrong with a system where it stands."""
    places = ((_find(positions, path) or (1, 1), text) for path, text in mistakes)
    return [(line, column, text) for (line, column), text in places]


def locating(positions: Callable[[], Positions], facts: str | None) -> Locate:
    """Return where parts stand in a file, or in the rule base of its facts."""
    known = functools.cache(positions)
    if facts is None:
        return lambda path: _find(known(), path)
    numbers, places = numbers_of(facts), places_of(facts)

    def locate(path: Path) -> Position | None:
        match path:
            case ("rules", int(number), *_):
                rules = [one for one in known() if one[0] == "blocks" and len(one) > 2]
                path = rules[numbers[number]]
            case ("variables", int(number), *rest):
                place = places[number]
                path = () if place is None else ("variables", place, *rest)
            case _:
                pass
        return _find(known(), path)

    return locate
