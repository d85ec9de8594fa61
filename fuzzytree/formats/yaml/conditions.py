"""Conditions and conclusions as sentences, read, written and joined.

`temperature is very hot and (pressure is not low or speed is fast)`. AND binds closer
than OR, and `speed is slow or fast` is one proposition. A name may have several words;
one with a word of the language in it, such as `and` or `very`, or with signs that would
end it, stands in quotes, where a quote is written twice. Between a variable and its
term stand hedges, the words of a hedge joined by `-`. `not (...)` takes the opposite of
a condition. A rule has a list of conditions, all of which must hold.
"""

from __future__ import annotations

import itertools
import operator
import re
from collections.abc import Iterable, Mapping
from typing import Final, get_args

import msgspec

from fuzzytree.model import (
    MOST_LEVELS,
    And,
    Conclusion,
    Condition,
    Hedge,
    Not,
    Or,
    Proposition,
    RuleBlock,
    SNorm,
    SystemRule,
    TNorm,
    combined,
    condition_text,
)

HEDGES: Final[Mapping[str, Hedge]] = {
    hedge.replace(" ", "-"): hedge for hedge in get_args(Hedge)
}
_KEYWORDS: Final = frozenset(["is", "and", "or", "not", *HEDGES])
_TOKEN: Final = re.compile(
    r"""
    (?P<blank>\s+)
  | (?P<quoted>'(?:[^']|'')*'|"(?:[^"]|"")*")
  | (?P<word>\([^\s()'"]+\)|[^\s()'"][^\s()]*(?:\([^\s()]*\))*)
  | (?P<sign>[()])
    """,
    re.VERBOSE,
)


class SentenceError(ValueError):
    """Why a text is no condition, or no conclusion."""


class _Token(msgspec.Struct, frozen=True):
    """A word, a sign or a name in quotes; the last one is an empty word."""

    text: str
    kind: str = "word"

    def is_word(self, *words: str) -> bool:
        return self.kind == "word" and self.text in words

    def is_sign(self, sign: str) -> bool:
        return self.kind == "sign" and self.text == sign

    @property
    def begins_a_name(self) -> bool:
        return self.kind == "quoted" or self.is_of_a_name

    @property
    def is_of_a_name(self) -> bool:
        return self.kind == "word" and bool(self.text) and self.text not in _KEYWORDS


def parse_condition(text: str) -> Condition:
    """Return the condition of a sentence.

    Raises:
        SentenceError: If it is none, or is nested too deeply.

    Example:
        >>> parse_condition("speed is not very high or low")
        Proposition(variable='speed', terms=('high', 'low'), hedges=('not', 'very'))
    """
    sentence = _Sentence(text)
    result = sentence.condition(1)
    sentence.end("'and', 'or' or the end")
    return result


def parse_conclusions(text: str) -> tuple[Conclusion, ...]:
    """Return the conclusions of a sentence, joined by AND.

    Raises:
        SentenceError: If it is none.

    Example:
        >>> parse_conclusions("power is high and fan is off")[1]
        Conclusion(output='fan', term='off', hedges=())
    """
    sentence = _Sentence(text)
    results = [sentence.conclusion()]
    while sentence.takes("and"):
        results.append(sentence.conclusion())
    sentence.end("'and' or the end")
    return tuple(results)


def condition_texts(condition: Condition | None) -> list[str]:
    """Return a sentence for each part of an outermost AND; none for None.

    Example:
        >>> condition_texts(And((Proposition("wall", ("near",)),
        ...     Proposition("is it", ("so", "so-so"), ("very",)))))
        ['wall is near', '"is it" is very so or so-so']
    """
    if isinstance(condition, And):
        return [*map(condition_sentence, condition.parts)]
    return [] if condition is None else [condition_sentence(condition)]


def condition_sentence(condition: Condition) -> str:
    """Return the sentence of a condition; `parse_condition` gives back an equal one."""
    return condition_text(
        condition, lambda one: _proposition(one.variable, one.terms, one.hedges)
    )


def conclusions_text(conclusions: tuple[Conclusion, ...]) -> str:
    """Return the sentence of conclusions; `parse_conclusions` reads it."""
    return " and ".join(
        _proposition(one.output, (one.term,), one.hedges) for one in conclusions
    )


def _proposition(
    variable: str, terms: tuple[str, ...], hedges: tuple[Hedge, ...]
) -> str:
    words = [_quoted(variable), "is", *(hedge.replace(" ", "-") for hedge in hedges)]
    return " ".join([*words, " or ".join(map(_quoted, terms))]).rstrip()


def _quoted(name: str) -> str:
    """Return a name, in quotes unless each of its words is an ordinary one."""
    words = [match.group() for match in _TOKEN.finditer(name) if match["word"]]
    if words and " ".join(words) == name and _KEYWORDS.isdisjoint(words):
        return name
    doubled = name.replace('"', '""')
    return f'"{doubled}"'


class _Sentence:
    """The tokens of a sentence, and how far it has been read."""

    def __init__(self, text: str) -> None:
        self.tokens: list[_Token] = []
        self.place = 0
        place = 0
        while place < len(text):
            token_match = _TOKEN.match(text, place)
            if token_match is None:
                raise SentenceError(f"the quote {text[place]} is not closed")
            if not token_match["blank"]:
                self.tokens.append(
                    _Token(token_match.group(), token_match.lastgroup or "")
                )
            place = token_match.end()
        self.tokens.append(_Token(""))

    @property
    def next(self) -> _Token:
        return self.tokens[self.place]

    def takes(self, word: str) -> bool:
        """Read a word if it is the next one, and say whether it was."""
        if not self.next.is_word(word):
            return False
        self.place += 1
        return True

    def end(self, wanted: str) -> None:
        """Refuse what stands behind a whole sentence."""
        if self.place < len(self.tokens) - 1:
            raise self.unexpected(wanted)

    def unexpected(self, wanted: str) -> SentenceError:
        """Return that a token stands where another must."""
        result = repr(self.next.text) if self.next.text else "the end"
        before = " ".join(token.text for token in self.tokens[: self.place][-6:])
        behind = f" behind {before!r}" if before else ""
        return SentenceError(f"{result} where {wanted} must stand{behind}")

    def condition(self, level: int) -> Condition:
        """Read parts that are joined by OR."""
        if level > MOST_LEVELS:
            raise SentenceError(f"nested deeper than {MOST_LEVELS} levels")
        parts = [self.conjunction(level)]
        while self.takes("or"):
            parts.append(self.conjunction(level))
        return combined(Or, parts)

    def conjunction(self, level: int) -> Condition:
        """Read parts that are joined by AND."""
        parts = [self.part(level)]
        while self.takes("and"):
            parts.append(self.part(level))
        return combined(And, parts)

    def part(self, level: int) -> Condition:
        """Read a proposition, or a condition in parentheses."""
        if self.takes("not"):
            if not self.next.is_sign("("):
                raise self.unexpected("'('")
            return Not(self.part(level))
        if not self.next.is_sign("("):
            return self.question()
        self.place += 1
        result = self.condition(level + 1)
        if not self.next.is_sign(")"):
            raise self.unexpected("'and', 'or' or ')'")
        self.place += 1
        return result

    def question(self) -> Proposition:
        """Read `variable is hedge ... term or term`."""
        variable, hedges = self.proposition()
        if hedges and hedges[-1] == "any" and not self.next.begins_a_name:
            return Proposition(variable, (), hedges)
        terms = [self.name("a term")]
        place = self.place
        while self.takes("or") and self.next.begins_a_name:
            term = self.name("a term")
            if self.next.is_word("is"):  # it is the variable of another proposition
                break
            terms.append(term)
            place = self.place
        self.place = place
        return Proposition(variable, tuple(terms), hedges)

    def conclusion(self) -> Conclusion:
        """Read `output is hedge ... term`."""
        output, hedges = self.proposition()
        return Conclusion(output, self.name("a term"), hedges)

    def proposition(self) -> tuple[str, tuple[Hedge, ...]]:
        """Read a variable, `is` and hedges."""
        variable = self.name("a variable")
        if not self.takes("is"):
            raise self.unexpected("'is'")
        hedges: list[Hedge] = []
        while self.next.is_word(*HEDGES):
            hedges.append(HEDGES[self.next.text])
            self.place += 1
        return variable, tuple(hedges)

    def name(self, what: str) -> str:
        """Read a name: one in quotes, or words."""
        token = self.next
        if token.kind == "quoted":
            self.place += 1
            mark = token.text[0]
            return token.text[1:-1].replace(mark * 2, mark)
        start = self.place
        while self.next.is_of_a_name:
            self.place += 1
        if self.place == start:
            raise self.unexpected(what)
        return " ".join(token.text for token in self.tokens[start : self.place])


def joined(join: type[And] | type[Or], left: Condition, right: Condition) -> Condition:
    """Return two conditions joined, without parentheses that change only rounding.

    Example:
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
