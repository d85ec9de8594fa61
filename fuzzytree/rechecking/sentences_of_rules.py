"""The sentences of a model's file: conditions and conclusions.

A condition is such as `dirt is very high and (load is small or big or not (load is
big))`. AND binds closer than OR; a name of several words stands as it is, one with a
word of the language in quotes. A rule has a list of conditions, which AND joins.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

MOST_LEVELS = 100
HEDGES = (
    *("any", "not", "very", "somewhat", "extremely", "seldom", "cubed", "very very"),
    *("plus", "minus", "cube root"),
)
_HEDGES = {hedge.replace(" ", "-"): hedge for hedge in HEDGES}
_WORDS = {"", "is", "and", "or", "not", "(", ")", *_HEDGES}
_TOKEN = re.compile(
    r"""\s*(?:('(?:[^']|'')*'|"(?:[^"]|"")*")  # a name in quotes
    |(\([^\s()'"]+\)|[^\s()'"][^\s()]*(?:\([^\s()]*\))*)  # a word, (cm) or f(x) too
    |([()]))""",
    re.VERBOSE,
)


class Is(NamedTuple):
    """A proposition; `hedges` from left to right. Rule bases alone have `others`."""

    variable: str
    term: str | None
    hedges: tuple[str, ...]
    others: tuple[str, ...] = ()


class Joint(NamedTuple):
    """Parts that `and` or `or` joins; the one part of a `not`."""

    word: str
    parts: tuple[Condition, ...]


Condition = Is | Joint


class _Words:
    """The words of a sentence, and how many are read."""

    def __init__(self, text: str) -> None:
        self.all: list[tuple[str, bool]] = []  # a name in quotes is marked
        self.count = place = 0
        text = text.rstrip()
        while place < len(text):
            token = _TOKEN.match(text, place)
            if token is None:
                raise ValueError("a quote that is not closed")
            quoted, place = token[1], token.end()
            name = quoted[1:-1].replace(quoted[0] * 2, quoted[0]) if quoted else ""
            self.all.append((name, True) if quoted else (token[2] or token[3], False))
        self.all.append(("", False))

    @property
    def next(self) -> tuple[str, bool]:
        """The first word that is not read; at the end an empty one."""
        return self.all[self.count]

    @property
    def is_over(self) -> bool:
        return self.count == len(self.all) - 1

    def takes(self, *words: str) -> str:
        """Read a word if it is the next one, and return it."""
        word, is_quoted = self.next
        if is_quoted or word not in words:
            return ""
        self.count += 1
        return word

    def needs(self, *words: str) -> None:
        if not self.takes(*words):
            raise ValueError(f"{words[0]!r} is missing")

    def name(self) -> str:
        """Read a name, in quotes or of several words; empty if there is none."""
        start, (word, is_quoted) = self.count, self.next
        if is_quoted:
            self.count += 1
            return word
        while not self.next[1] and self.next[0] not in _WORDS:
            self.count += 1
        return " ".join(word for word, _ in self.all[start : self.count])

    def proposition(self) -> Is:
        """Read `variable is hedge ... term or term`; behind `any` it may be missing."""
        variable, hedges = self.name(), list[str]()
        self.needs("is")
        while hedge := self.takes(*_HEDGES):
            hedges.append(_HEDGES[hedge])
        term = self.name() or None
        if not variable or (term is None and hedges[-1:] != ["any"]):
            raise ValueError("a variable or a term is missing")
        others, count = list[str](), self.count
        while self.takes("or") and (other := self.name()) and not self.takes("is"):
            others.append(other)
            count = self.count
        self.count = count
        return Is(variable, term, tuple(hedges), tuple(others))

    def joined(self, word: str, level: int) -> Condition:
        """Read parts that OR joins, each of parts that AND joins."""
        if level > MOST_LEVELS:
            raise ValueError(f"more than {MOST_LEVELS} levels")
        parts: list[Condition] = []
        while not parts or self.takes(word):
            parts.append(
                self.joined("and", level) if word == "or" else self._part(level)
            )
        return parts[0] if len(parts) == 1 else Joint(word, tuple(parts))

    def _part(self, level: int) -> Condition:
        """Read a proposition, or a condition in parentheses."""
        if self.takes("not"):
            if self.next != ("(", False):
                raise ValueError("'(' is missing")
            return Joint("not", (self.joined("part", level + 1),))
        if not self.takes("("):
            return self.proposition()
        result = self.joined("or", level + 1)
        self.needs(")")
        return result


def read_condition(sentences: Sequence[str]) -> Condition | None:
    """Return the condition of a rule's sentences; None if there are none.

    Raises:
        ValueError: If one is none.

    Example:
        >>> read_condition(["speed is not very high"])
        Is(variable='speed', term='high', hedges=('not', 'very'), others=())
    """
    results: list[Condition] = []
    for text in sentences:
        words = _Words(text)
        results.append(words.joined("or", 1))
        if not words.is_over:
            raise ValueError("more behind the condition")
    return (
        Joint("and", tuple(results)) if len(results) > 1 else next(iter(results), None)
    )


def read_conclusions(text: str) -> tuple[Is, ...]:
    """Return what a sentence concludes.

    Raises:
        ValueError: If it is none.
    """
    words, result = _Words(text), list[Is]()
    while not result or words.takes("and"):
        result.append(words.proposition())
    if not words.is_over or any(one.term is None or one.others for one in result):
        raise ValueError("no conclusions")
    return tuple(result)
