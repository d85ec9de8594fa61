"""The sentences of a model's file: propositions, conditions and conclusions.

A condition of a fuzzy system is such as `dirt is very high and (load is small or not
(load is big))`. AND binds closer than OR; a name of several words stands as it is, one
with a word of the language in quotes.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

MOST_LEVELS = 100
HEDGES = (
    *("any", "not", "very", "somewhat", "extremely", "seldom", "cubed", "very very"),
    *("plus", "minus", "cube root"),
)
_HEDGES = {hedge.replace(" ", "-"): hedge for hedge in HEDGES}
_WORDS = {"is", "and", "or", "not", "always", "(", ")", *_HEDGES}
_TOKEN = re.compile(
    r"""\s*(?:('(?:[^']|'')*'|"(?:[^"]|"")*")|([()])|([^\s()'"][^\s()]*)|$)"""
)
Names = tuple[str, tuple[str, ...], bool]
"""A variable, its terms, and whether the whole is negated."""


class Is(NamedTuple):
    """A proposition; `hedges` from left to right."""

    variable: str
    term: str | None
    hedges: tuple[str, ...]


class Joint(NamedTuple):
    """Parts that `and` or `or` joins; the one part of a `not`."""

    word: str
    parts: tuple[Condition, ...]


Condition = Is | Joint


class _Words:
    """The words of a sentence, from the last to the first one that is not yet read."""

    def __init__(self, text: str) -> None:
        self.rest: list[tuple[str, bool]] = []  # a name in quotes is marked
        place = 0
        while text[place:].strip():
            token = _TOKEN.match(text, place)
            if token is None:
                raise ValueError("a quote that is not closed")
            quoted, place = token[1], token.end()
            name = quoted[1:-1].replace(quoted[0] * 2, quoted[0]) if quoted else ""
            self.rest.append((name, True) if quoted else (token[2] or token[3], False))
        self.rest.reverse()

    def takes(self, *words: str) -> str:
        """Read a word if it is the next one, and return it."""
        if self.rest and not self.rest[-1][1] and self.rest[-1][0] in words:
            return self.rest.pop()[0]
        return ""

    def needs(self, *words: str) -> None:
        if not self.takes(*words):
            raise ValueError(f"{words[0]!r} is missing")

    def name(self) -> str:
        """Read a name, in quotes or of several words; empty if there is none."""
        if self.rest and self.rest[-1][1]:
            return self.rest.pop()[0]
        words: list[str] = []
        while self.rest and not self.rest[-1][1] and self.rest[-1][0] not in _WORDS:
            words.append(self.rest.pop()[0])
        return " ".join(words)

    def proposition(self) -> Is:
        """Read `variable is hedge ... term`; behind `any` the term may be missing."""
        variable, hedges = self.name(), list[str]()
        self.needs("is")
        while hedge := self.takes(*_HEDGES):
            hedges.append(_HEDGES[hedge])
        term = self.name() or None
        if not variable or (term is None and hedges[-1:] != ["any"]):
            raise ValueError("a variable or a term is missing")
        return Is(variable, term, tuple(hedges))

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
            if self.rest[-1:] != [("(", False)]:
                raise ValueError("'(' is missing")
            return Joint("not", (self.joined("part", level + 1),))
        if not self.takes("("):
            return self.proposition()
        word = self.takes("and", "or")
        inner = "part" if word else "or"
        result = self.joined(inner, level + 1)
        self.needs(")")
        return Joint(word, (result,)) if word else result


def read_condition(text: str) -> Condition | None:
    """Return the condition of a sentence; None for `always`.

    Raises:
        ValueError: If it is none.

    Example:
        >>> read_condition("speed is not very high")
        Is(variable='speed', term='high', hedges=('not', 'very'))
    """
    words = _Words(text)
    result = None if words.takes("always") else words.joined("or", 1)
    if words.rest:
        raise ValueError("more behind the condition")
    return result


def read_conclusions(text: str) -> tuple[Is, ...]:
    """Return what a sentence concludes.

    Raises:
        ValueError: If it is none.
    """
    words, result = _Words(text), list[Is]()
    while not result or words.takes("and"):
        result.append(words.proposition())
    if words.rest or any(one.term is None for one in result):
        raise ValueError("no conclusions")
    return tuple(result)


def readings(text: str, known: Mapping[str, Collection[str]]) -> Iterator[Names]:
    """Yield everything that a proposition of a rule base can mean.

    Example:
        >>> list(readings("grip is not firm", {"grip": ["soft", "firm"]}))
        [('grip', ('firm',), True)]
    """
    for place in re.finditer("(?= is )", text):
        variable, rest = text[: place.start()], text[place.start() + 4 :]
        terms = known.get(variable, ())
        yield from ((variable, one, False) for one in _lists(rest, terms))
        if rest.startswith("not "):
            yield from ((variable, one, True) for one in _lists(rest[4:], terms))


def _lists(text: str, known: Collection[str]) -> Iterator[tuple[str, ...]]:
    """Yield every list of terms, joined by ` or `, that a text can mean."""
    todo: list[tuple[int, tuple[str, ...]]] = [(0, ())]
    while todo:
        start, terms = todo.pop()
        for name in known:
            end = start + len(name)
            if text.startswith(name, start) and end == len(text):
                yield (*terms, name)
            elif text.startswith(name, start) and text.startswith(" or ", end):
                todo.append((end + 4, (*terms, name)))
