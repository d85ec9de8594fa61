"""Rules of a file: propositions as sentences, and names that nothing declares."""

from __future__ import annotations

import itertools
import operator
import re
from collections.abc import Iterable, Mapping
from typing import Final

import msgspec

from fuzzytree.formats.text_files import LONGEST_NAME
from fuzzytree.formats.yaml import layout
from fuzzytree.formats.yaml.binding import shortened
from fuzzytree.model import (
    And,
    Condition,
    Mistake,
    Or,
    Path,
    Proposition,
    Rule,
    RuleBlock,
    SNorm,
    SystemRule,
    TNorm,
    Variable,
)

_IS: Final = " is "
_OR: Final = " or "
_NOT: Final = "not "
_MOST_ORS: Final = 8  # keeps the search linear; names with more are written out


class TermWords(msgspec.Struct, frozen=True):
    """The terms of a variable: their names, and the most ` or ` within one name."""

    terms: frozenset[str]
    most_ors: int


Vocabulary = Mapping[str, TermWords]


def words(terms: Iterable[str]) -> TermWords:
    """Return what `readings` needs to know about a variable's terms."""
    names = frozenset(terms)
    return TermWords(names, max((len(_places(name)) for name in names), default=0))


def vocabulary_of(variables: Iterable[Variable]) -> Vocabulary:
    """Return the words of each variable."""
    return {v.name: words(term.name for term in v.terms) for v in variables}


def readings(text: str, vocabulary: Vocabulary) -> tuple[Proposition, ...]:
    """Return the propositions that a sentence can mean: none, one, or two of several.

    Example:
        >>> readings("grip is not firm", {"grip": words(["soft", "firm"])})
        (Proposition(variable='grip', terms=('firm',), hedges=('not',)),)
    """
    results: list[Proposition] = []
    end = text.find(_IS)
    while 0 <= end <= LONGEST_NAME and len(results) < 2:
        variable = text[:end]
        known = vocabulary.get(variable)
        if known is not None and known.most_ors <= _MOST_ORS:
            rest = text[end + len(_IS) :]
            results += [Proposition(variable, terms) for terms in _lists(rest, known)]
            if rest.startswith(_NOT):
                lists = _lists(rest[len(_NOT) :], known)
                results += [
                    Proposition(variable, terms, hedges=("not",)) for terms in lists
                ]
        end = text.find(_IS, end + 1)
    return tuple(results[:2])


def guess(text: str, vocabulary: Vocabulary) -> Proposition | None:
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
    return Proposition(
        text[:best], tuple(terms.split(_OR)), ("not",) if negated else ()
    )


def _lists(text: str, known: TermWords) -> list[tuple[str, ...]]:
    """Return the lists of terms, joined by OR, that a text can mean: two at most."""
    if not known.most_ors and " or or " not in text:
        terms = tuple(text.split(_OR))
        return [terms] if known.terms.issuperset(terms) else []
    ors = _places(text)
    starts, ends = [0, *(place + len(_OR) for place in ors)], [*ors, len(text)]
    # rests[i]: two lists at most that the rest from starts[i] can mean.
    rests: list[list[tuple[str, ...]]] = [[] for _ in starts]
    rests.append([()])
    for start in range(len(starts) - 1, -1, -1):
        # A term can share a blank with the ` or ` before it and with the one behind.
        furthest = min(start + known.most_ors + 2, len(ends) - 1)
        for end in range(start, furthest + 1):
            term = text[starts[start] : ends[end]]
            if term in known.terms:
                rests[start] += [(term, *rest) for rest in rests[end + 1]]
        del rests[start][2:]
    return rests[0]


def _places(text: str) -> list[int]:
    """Return where ` or ` stands, also where one begins with the end of another."""
    return [match.start() for match in re.finditer("(?= or )", text)]


def read_rules(
    bound: list[layout.RuleOfModel | None],
    any_class: str,
    vocabulary: Vocabulary,
    mistakes: list[Mistake],
) -> tuple[Rule, ...]:
    """Return the rules, with one that is always right in the place of a broken one."""
    cache: dict[str | layout.WrittenOut, Proposition | None] = {}
    rules: list[Rule] = []
    for position, one in enumerate(bound):
        if one is None:
            rules.append(Rule((), any_class))
            continue
        propositions: list[Proposition] = []
        for index, proposition in enumerate(one.if_):
            path: Path = ("rules", position, "when", index)
            if proposition not in cache:
                meaning = _proposition(proposition, vocabulary)
                cache[proposition] = (
                    meaning if isinstance(meaning, Proposition) else None
                )
                if isinstance(meaning, str):
                    mistakes.append((path, f"rule {position + 1}: {meaning}"))
            read_proposition = cache[proposition]
            if read_proposition is not None:
                propositions.append(read_proposition)
        rules.append(Rule(tuple(propositions), one.then, one.support))
    return tuple(rules)


def _proposition(
    value: str | layout.WrittenOut, vocabulary: Vocabulary
) -> Proposition | str:
    """Return a proposition, or why the sentence cannot be one."""
    if isinstance(value, layout.WrittenOut):
        terms = value.is_ if value.is_ is not None else value.is_not or ()
        return Proposition(
            value.variable, terms, hedges=("not",) if value.is_ is None else ()
        )
    result = readings(value, vocabulary)
    if len(result) == 1:
        return result[0]
    if result:
        either = " or ".join(map(_written_out, result))
        return f"{shortened(value)} can be read in two ways; write {either}"
    meaning = guess(value, vocabulary)
    known = None if meaning is None else vocabulary.get(meaning.variable)
    if meaning is None or (known and known.terms.issuperset(meaning.terms)):
        return (
            f"{shortened(value)} is no proposition; a proposition is 'VARIABLE is TERM "
            "or TERM', or the same with 'is not'"
        )
    return meaning


def _written_out(proposition: Proposition) -> str:
    verb = "is not" if proposition.negated else "is"
    terms = ", ".join(map(repr, proposition.terms))
    return f"{{variable: {proposition.variable!r}, {verb}: [{terms}]}}"


def joined(join: type[And] | type[Or], left: Condition, right: Condition) -> Condition:
    """Return two conditions joined, without parentheses that change only rounding.

    Example:
        >>> from fuzzytree.model import Proposition
        >>> a, b, c = (Proposition("force", (term,)) for term in "abc")
        >>> joined(Or, a, joined(Or, b, c)) == Or((a, b, c))
        True
    """
    first, last = (
        one.parts if isinstance(one, join) else (one,) for one in (left, right)
    )
    return join((*first, *last))


def blocks_of(
    rules: Iterable[tuple[SystemRule, TNorm, SNorm]], implication: TNorm | None
) -> tuple[RuleBlock, ...]:
    """Return blocks of rules in their order, a new one where the operators change."""
    groups = itertools.groupby(rules, key=operator.itemgetter(1, 2))
    return tuple(
        RuleBlock(
            tuple(rule for rule, *_ in some), conjunction, disjunction, implication
        )
        for (conjunction, disjunction), some in groups
    )
