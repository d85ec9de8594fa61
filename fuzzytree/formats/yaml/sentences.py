"""Clauses as sentences, such as `petal width is not low or medium`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

import msgspec

from fuzzytree.formats.yaml.layout import LONGEST_NAME
from fuzzytree.model.rulebase import Clause, Variable

_IS: Final = " is "
_OR: Final = " or "
_NOT: Final = "not "
_MOST_ORS: Final = 8  # keeps the search linear; names with more are written out


class Words(msgspec.Struct, frozen=True):
    """The terms of a variable: their names, and the most ` or ` within one name."""

    terms: frozenset[str]
    most_ors: int


Vocabulary = Mapping[str, Words]


def words(terms: Iterable[str]) -> Words:
    """Return what `readings` needs to know about a variable's terms."""
    names = frozenset(terms)
    return Words(names, max((len(_places(name)) for name in names), default=0))


def vocabulary_of(variables: Iterable[Variable]) -> Vocabulary:
    """Return the words of each variable."""
    return {v.name: words(term.name for term in v.terms) for v in variables}


def readings(text: str, vocabulary: Vocabulary) -> tuple[Clause, ...]:
    """Return the clauses that a sentence can mean: none, one, or two of several.

    Args:
        text: `VARIABLE is TERM or TERM`, or `VARIABLE is not TERM or TERM`.
        vocabulary: The words of each variable.

    Example:
        >>> readings("grip is not firm", {"grip": words(["soft", "firm"])})
        (Clause(variable='grip', terms=('firm',), negated=True),)
    """
    found: list[Clause] = []
    end = text.find(_IS)
    while 0 <= end <= LONGEST_NAME and len(found) < 2:
        variable = text[:end]
        known = vocabulary.get(variable)
        if known is not None and known.most_ors <= _MOST_ORS:
            rest = text[end + len(_IS) :]
            found += [Clause(variable, terms) for terms in _lists(rest, known)]
            if rest.startswith(_NOT):
                lists = _lists(rest[len(_NOT) :], known)
                found += [Clause(variable, terms, negated=True) for terms in lists]
        end = text.find(_IS, end + 1)
    return tuple(found[:2])


def guess(text: str, vocabulary: Vocabulary) -> Clause | None:
    """Return what a sentence without a reading comes closest to, None if it is none."""
    end = text.find(_IS)
    best = end
    while 0 <= end <= LONGEST_NAME:
        if text[:end] in vocabulary:
            best = end
        end = text.find(_IS, end + 1)
    if best < 0:
        return None
    rest = text[best + len(_IS) :]
    negated = rest.startswith(_NOT)
    terms = rest[len(_NOT) :] if negated else rest
    return Clause(text[:best], tuple(terms.split(_OR)), negated)


def _lists(text: str, known: Words) -> list[tuple[str, ...]]:
    """Return the lists of terms, joined by OR, that a text can mean: two at most."""
    if not known.most_ors and " or or " not in text:
        terms = tuple(text.split(_OR))
        return [terms] if known.terms.issuperset(terms) else []
    ors = _places(text)
    starts, ends = [0, *(place + len(_OR) for place in ors)], [*ors, len(text)]
    # steps[i]: the pairs (term, next i) with which the rest from starts[i] can be read.
    steps: list[list[tuple[str, int]]] = [[] for _ in starts]
    for start in range(len(starts) - 1, -1, -1):
        # A term can share a blank with the ` or ` before it and with the one behind.
        furthest = min(start + known.most_ors + 2, len(ends) - 1)
        for end in range(start, furthest + 1):
            term = text[starts[start] : ends[end]]
            is_last = end == len(ends) - 1
            if term in known.terms and (is_last or steps[end + 1]):
                steps[start].append((term, end + 1))
    return [*_two_walks(steps)] if steps[0] else []


def _places(text: str) -> list[int]:
    """Return where ` or ` stands, also where one begins with the end of another."""
    return [match.start() for match in re.finditer("(?= or )", text)]


def _two_walks(steps: list[list[tuple[str, int]]]) -> Iterator[tuple[str, ...]]:
    """Yield the first list of terms, and one that turns off where that is possible."""
    first: list[str] = []
    turn: list[str] | None = None
    position = 0
    while position < len(steps):
        if turn is None and len(steps[position]) > 1:
            turn = [*first, *_walk(steps, *steps[position][1])]
        term, position = steps[position][0]
        first.append(term)
    yield tuple(first)
    if turn is not None:
        yield tuple(turn)


def _walk(steps: list[list[tuple[str, int]]], term: str, position: int) -> list[str]:
    terms = [term]
    while position < len(steps):
        term, position = steps[position][0]
        terms.append(term)
    return terms
