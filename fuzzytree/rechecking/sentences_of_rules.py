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
    |(\([^\s()'"]+\)|[^\s()'"][^\s()]*(?:\([^\s()]*\))*|[()]))  # a word, (cm), f(x)""",
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
    """The words of a sentence that are not read, the next one last.

    A name in quotes is without them, and begins with a blank.
    """

    def __init__(self, text: str) -> None:
        self.rest, place, text = list[str](), 0, text.rstrip()
        while place < len(text):
            token = _TOKEN.match(text, place)
            if token is None:
                raise ValueError("a quote that is not closed")
            quoted, word = token.groups()
            if quoted:
                word = " " + quoted[1:-1].replace(quoted[0] * 2, quoted[0])
            self.rest.insert(0, word)
            place = token.end()

    def takes(self, *words: str) -> str:
        """Read a word if it is the next one, and return it."""
        return self.rest.pop() if self.rest and self.rest[-1] in words else ""

    def needs(self, *words: str) -> None:
        if not self.takes(*words):
            raise ValueError(f"{words[0]!r} is missing")

    def name(self) -> str:
        """Read a name, in quotes or of several words; empty if there is none."""
        if self.rest and self.rest[-1].startswith(" "):
            return self.rest.pop()[1:]
        words: list[str] = []
        while self.rest and self.rest[-1] not in _WORDS and self.rest[-1][0] != " ":
            words.append(self.rest.pop())
        return " ".join(words)

    def proposition(self) -> Is:
        """Read `variable is hedge ... term or term`; behind `any` it may be missing."""
        variable, hedges, others = self.name(), list[str](), list[str]()
        self.needs("is")
        while hedge := self.takes(*_HEDGES):
            hedges.append(_HEDGES[hedge])
        term = self.name() or None
        if not variable or (term is None and hedges[-1:] != ["any"]):
            raise ValueError("a variable or a term is missing")
        rest = [*self.rest]
        while self.takes("or") and (other := self.name()) and not self.takes("is"):
            others.append(other)
            rest = [*self.rest]
        self.rest = rest
        return Is(variable, term, tuple(hedges), tuple(others))

    def condition(self, word: str, level: int) -> Condition:
        """Read parts that OR joins, each of parts that AND joins."""
        if level > MOST_LEVELS:
            raise ValueError(f"more than {MOST_LEVELS} levels")
        parts: list[Condition] = []
        while not parts or self.takes(word):
            is_or = word == "or"
            parts.append(self.condition("and", level) if is_or else self._part(level))
        return parts[0] if len(parts) == 1 else Joint(word, tuple(parts))

    def _part(self, level: int) -> Condition:
        """Read a proposition, or a condition in parentheses."""
        is_negated = bool(self.takes("not"))
        if is_negated or self.rest[-1:] == ["("]:
            self.needs("(")
            result = self.condition("or", level + 1)
            self.needs(")")
            return Joint("not", (result,)) if is_negated else result
        return self.proposition()


def read_condition(sentences: Sequence[str]) -> Condition | None:
    """Return the condition of a rule's sentences; None if there are none.

    Example:
        >>> read_condition(["speed is not very high"])
        Is(variable='speed', term='high', hedges=('not', 'very'), others=())
    """
    results: list[Condition] = []
    for text in sentences:
        words = _Words(text)
        results.append(words.condition("or", 1))
        if words.rest:
            raise ValueError("more behind the condition")
    if len(results) > 1:
        return Joint("and", tuple(results))
    return results[0] if results else None


def read_conclusions(text: str) -> tuple[Is, ...]:
    """Return what a sentence concludes."""
    words, result = _Words(text), list[Is]()
    while not result or words.takes("and"):
        result.append(words.proposition())
    if words.rest or any(part.term is None or part.others for part in result):
        raise ValueError("no conclusions")
    return tuple(result)
