"""The conditions and conclusions of a fuzzy system, read from sentences.

`dirt is very high and (load is small or not (load is big))`. AND binds closer than OR;
a name of several words stands as it is, one with a word of the language in quotes.
"""

from __future__ import annotations

import re

from fuzzytree.auditing.recheck.model_records import (
    And,
    Conclusion,
    Condition,
    Is,
    Not,
    Or,
)

MOST_LEVELS = 100
HEDGES = (
    *("any", "not", "very", "somewhat", "extremely", "seldom", "cubed", "very very"),
    *("plus", "minus", "cube root"),
)
_HEDGES = {hedge.replace(" ", "-"): hedge for hedge in HEDGES}
_WORDS = {"is", "and", "or", "not", "always", *_HEDGES}
_TOKEN = re.compile(
    r"""\s*(?:('(?:[^']|'')*'|"(?:[^"]|"")*")|([()])|([^\s()'"][^\s()]*)|$)"""
)


class _Sentence:
    """The words of a sentence, from the last to the first one that is not yet read."""

    def __init__(self, text: str) -> None:
        result: list[tuple[str, bool]] = []
        place = 0
        while text[place:].strip():
            token = _TOKEN.match(text, place)
            if token is None:
                raise ValueError("a quote that is not closed")
            quoted, place = token[1], token.end()
            name = quoted[1:-1].replace(quoted[0] * 2, quoted[0]) if quoted else ""
            result.append((name, True) if quoted else (token[2] or token[3], False))
        self.rest = result[::-1]

    def takes(self, *words: str) -> str:
        """Read a word that is the next one, and return it; an empty text if not."""
        if self.rest and not self.rest[-1][1] and self.rest[-1][0] in words:
            return self.rest.pop()[0]
        return ""

    def needs(self, word: str) -> None:
        if not self.takes(word):
            raise ValueError(f"{word!r} is missing")

    def name(self) -> str | None:
        """Read a name, in quotes or of several words; None if there is none."""
        if self.rest and self.rest[-1][1]:
            return self.rest.pop()[0]
        words: list[str] = []
        while self.rest and not self.rest[-1][1]:
            if self.rest[-1][0] in _WORDS | {"(", ")"}:
                break
            words.append(self.rest.pop()[0])
        return " ".join(words) or None

    def clause(self) -> tuple[str, tuple[str, ...], str | None]:
        """Read `variable is hedge ... term`; the term may be missing."""
        variable, hedges = self.name(), list[str]()
        self.needs("is")
        while hedge := self.takes(*_HEDGES):
            hedges.append(_HEDGES[hedge])
        if variable is None:
            raise ValueError("a variable is missing")
        return variable, tuple(hedges), self.name()

    def joined(self, level: int) -> Condition:
        """Read parts that OR joins, each of parts that AND joins."""
        if level > MOST_LEVELS:
            raise ValueError(f"more than {MOST_LEVELS} levels")
        every: list[Condition] = []
        while not every or self.takes("or"):
            parts = [self.part(level)]
            while self.takes("and"):
                parts.append(self.part(level))
            every.append(parts[0] if len(parts) == 1 else And(tuple(parts)))
        return every[0] if len(every) == 1 else Or(tuple(every))

    def part(self, level: int) -> Condition:
        """Read a clause, or a condition in parentheses."""
        if level > MOST_LEVELS:
            raise ValueError(f"more than {MOST_LEVELS} levels")
        if self.takes("not"):
            if self.rest[-1:] != [("(", False)]:
                raise ValueError("'(' is missing")
            return Not(self.part(level + 1))
        if not self.takes("("):
            variable, hedges, label = self.clause()
            if label is None and hedges[-1:] != ("any",):
                raise ValueError("a term is missing")
            return Is(variable, label, hedges)
        word = self.takes("and", "or")
        result = self.part(level + 1) if word else self.joined(level + 1)
        self.needs(")")
        return And((result,)) if word == "and" else Or((result,)) if word else result


def read_condition(text: str) -> Condition | None:
    """Return the condition of a sentence; None for `always`.

    Raises:
        ValueError: If it is none.

    Example:
        >>> read_condition("speed is not very high")
        Is(variable='speed', label='high', hedges=('not', 'very'))
    """
    sentence = _Sentence(text)
    result = None if sentence.takes("always") else sentence.joined(1)
    if sentence.rest:
        raise ValueError("more behind the condition")
    return result


def read_conclusions(text: str) -> tuple[Conclusion, ...]:
    """Return what a sentence concludes.

    Raises:
        ValueError: If it is none.
    """
    sentence, result = _Sentence(text), list[Conclusion]()
    while not result or sentence.takes("and"):
        output, hedges, label = sentence.clause()
        if label is None:
            raise ValueError("a term is missing")
        result.append(Conclusion(output, label, hedges))
    if sentence.rest:
        raise ValueError("more behind the conclusions")
    return tuple(result)
