"""Clauses as sentences, such as `petal width is not low or medium`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

import msgspec

from fuzzytree.readers.layout import LONGEST_NAME
from fuzzytree.rulebase import Clause, Variable

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
    return Words(names, max((name.count(_OR) for name in names), default=0))


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
    pieces = text.split(_OR)
    if not known.most_ors:
        return [tuple(pieces)] if known.terms.issuperset(pieces) else []
    # steps[i]: where a term that starts with piece i can end, if the rest can be read.
    steps: list[list[int]] = [[] for _ in pieces]
    for start in range(len(pieces) - 1, -1, -1):
        for end in range(start + 1, min(start + known.most_ors + 1, len(pieces)) + 1):
            is_readable = end == len(pieces) or bool(steps[end])
            if is_readable and _OR.join(pieces[start:end]) in known.terms:
                steps[start].append(end)
    first = _walk(pieces, steps, branch_at=None)
    forks = [start for start in _starts(steps) if len(steps[start]) > 1]
    if not steps[0] or not forks:
        return [first] if steps[0] else []
    return [first, _walk(pieces, steps, branch_at=forks[0])]


def _starts(steps: list[list[int]]) -> list[int]:
    """Return where the terms of the first reading start."""
    starts: list[int] = []
    position = 0
    while position < len(steps) and steps[position]:
        starts.append(position)
        position = steps[position][0]
    return starts


def _walk(
    pieces: list[str], steps: list[list[int]], *, branch_at: int | None
) -> tuple[str, ...]:
    terms: list[str] = []
    start = 0
    while start < len(pieces) and steps[start]:
        end = steps[start][1 if start == branch_at else 0]
        terms.append(_OR.join(pieces[start:end]))
        start = end
    return tuple(terms)
