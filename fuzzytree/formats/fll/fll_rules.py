"""Rules of fuzzylite: `if a is very low or (b is c) then d is e with 0.5`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import msgspec

from fuzzytree.formats.fll.fll_words import FLL_HEDGES
from fuzzytree.formats.text_files import (
    MOST_SHOWN,
    FileMistake,
    PartError,
    Word,
    number_of,
)
from fuzzytree.model import (
    MOST_LEVELS,
    And,
    Conclusion,
    Condition,
    Hedge,
    Or,
    Proposition,
    SystemRule,
    name_choice,
)

RULE_WORDS: Final = ("if", "is", "then", "and", "or", "with", *FLL_HEDGES)


class FllVariable(msgspec.Struct, frozen=True):
    """What a rule can say of a variable."""

    name: str
    terms: Mapping[str, str]
    is_output: bool


Vocabulary = Mapping[str, FllVariable]
"""Variables by the words that stand for them."""


class _Read(msgspec.Struct, frozen=True):
    """What was read, and the place of the word behind it."""

    condition: Condition
    end: int
    depth: int = 1


class _Rule(msgspec.Struct, frozen=True):
    """A rule's words, an empty one behind them, and what they may say.

    `mistakes` collects names that do not exist, so that all of them are reported.
    """

    words: tuple[Word, ...]
    vocabulary: Vocabulary
    mistakes: list[FileMistake]

    def note(self, mistake: FileMistake) -> None:
        """Keep a mistake behind which reading can go on."""
        self.mistakes.append(mistake)
        if len(self.mistakes) >= MOST_SHOWN:
            raise PartError(*self.mistakes)

    def error(self, place: int, wanted: str) -> PartError:
        """Return the error of a word where another must stand."""
        word = self.words[place]
        what = repr(word.text) if word.text else "the end"
        mistake = word.mistake(f"{what} where {wanted} must stand")
        return PartError(*self.mistakes, mistake)


def read_rule(words: Sequence[Word], end: Word, vocabulary: Vocabulary) -> SystemRule:
    """Return the rule that words say.

    A condition that is nothing but `v is any` holds always.

    Raises:
        PartError: If they say none, with all its mistakes.
    """
    rule = _Rule((*words, end), vocabulary, [])
    if rule.words[0].text != "if":
        raise rule.error(0, "'if'")
    read = _any_of(rule, 1, 1)
    if rule.words[read.end].text != "then":
        raise rule.error(read.end, "'and', 'or' or 'then'")
    place = read.end
    then: list[Conclusion] = []
    while not then or rule.words[place].text == "and":
        proposition, place = _statement(rule, place + 1, concludes=True)
        then.append(
            Conclusion(proposition.variable, proposition.term or "", proposition.hedges)
        )
    weight = 1.0
    if rule.words[place].text == "with":
        weight, place = _weight(rule, place + 1), place + 2
    if place < len(words):
        raise rule.error(place, "'and', 'with' or the end")
    if rule.mistakes:
        raise PartError(*rule.mistakes)
    always = isinstance(read.condition, Proposition) and read.condition.hedges == (
        "any",
    )
    return SystemRule(None if always else read.condition, tuple(then), weight)


def _weight(rule: _Rule, place: int) -> float:
    word = rule.words[place]
    value = number_of(word.text)
    if value is None:
        raise rule.error(place, "a weight")
    if not 0.0 <= value <= 1.0:
        sentence = f"the weight must lie in [0, 1], not {word.text}"
        rule.note(word.mistake(sentence))
    return value


def _any_of(rule: _Rule, place: int, level: int) -> _Read:
    parts = [_all_of(rule, place, level)]
    while rule.words[parts[-1].end].text == "or":
        parts.append(_all_of(rule, parts[-1].end + 1, level))
    return _joined(rule, Or, parts)


def _all_of(rule: _Rule, place: int, level: int) -> _Read:
    parts = [_single(rule, place, level)]
    while rule.words[parts[-1].end].text == "and":
        parts.append(_single(rule, parts[-1].end + 1, level))
    return _joined(rule, And, parts)


def _joined(rule: _Rule, kind: type[And | Or], parts: Sequence[_Read]) -> _Read:
    if len(parts) == 1:
        return parts[0]
    depth = 1 + max(part.depth for part in parts)
    if depth > MOST_LEVELS:
        raise _too_deep(rule, parts[0].end)
    return _Read(kind(tuple(part.condition for part in parts)), parts[-1].end, depth)


def _too_deep(rule: _Rule, place: int) -> PartError:
    sentence = f"the condition is nested deeper than {MOST_LEVELS} levels"
    return PartError(rule.words[place].mistake(sentence))


def _single(rule: _Rule, place: int, level: int) -> _Read:
    if rule.words[place].text != "(":
        return _Read(*_statement(rule, place))
    if level > MOST_LEVELS:
        raise _too_deep(rule, place)
    inner = _any_of(rule, place + 1, level + 1)
    if rule.words[inner.end].text != ")":
        raise rule.error(inner.end, "'and', 'or' or ')'")
    return _Read(inner.condition, inner.end + 1, inner.depth)


def _statement(
    rule: _Rule, place: int, *, concludes: bool = False
) -> tuple[Proposition, int]:
    """Read `variable is hedge ... term`, without a term behind the hedge `any`."""
    variable = _variable(rule, place, concludes=concludes)
    place += 1
    if rule.words[place].text != "is":
        raise rule.error(place, "'is'")
    place += 1
    hedges: list[Hedge] = []
    while rule.words[place].text in FLL_HEDGES:
        hedges.append(FLL_HEDGES[rule.words[place].text])
        place += 1
        if hedges[-1] == "any" and not concludes:
            return Proposition(variable.name, (), tuple(hedges)), place
    return Proposition(
        variable.name, (_term(rule, place, variable),), tuple(hedges)
    ), place + 1


def _variable(rule: _Rule, place: int, *, concludes: bool) -> FllVariable:
    word = rule.words[place]
    if word.text in ("", "(", ")", *RULE_WORDS):
        wanted = "an output" if concludes else "a variable or '('"
        raise rule.error(place, wanted)
    known = rule.vocabulary.get(word.text)
    if known is None or (concludes and not known.is_output):
        names = {
            one.name: None
            for one in rule.vocabulary.values()
            if one.is_output or not concludes
        }
        what = "output" if concludes else "variable"
        sentence = f"no {what} {word.text!r}; {name_choice(word.text, names)}"
        rule.note(word.mistake(sentence))
        return FllVariable(word.text, {}, concludes) if known is None else known
    return known


def _term(rule: _Rule, place: int, variable: FllVariable) -> str:
    word = rule.words[place]
    if word.text in ("", "(", ")", *RULE_WORDS):
        raise rule.error(place, f"a term of {variable.name!r}")
    result = variable.terms.get(word.text)
    if result is None:
        if variable.name in {one.name for one in rule.vocabulary.values()}:
            choice = name_choice(word.text, dict.fromkeys(variable.terms.values()))
            sentence = f"{variable.name!r} has no term {word.text!r}; {choice}"
            rule.note(word.mistake(sentence))
        return word.text
    return result
