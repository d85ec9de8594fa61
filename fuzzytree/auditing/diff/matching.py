"""Match parts of two models by what they mean, and not by their order.

Rules are the same if their propositions have equal curves of the same inputs and they
conclude the same, whatever terms are called. Others are matched, the nearest first:
equal propositions and another conclusion; equal words, with curves that changed; some
propositions in common.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, TypeVar

from fuzzytree.auditing.diff.keys import Curves, Keys
from fuzzytree.formats import conclusions_text, condition_sentence, condition_texts
from fuzzytree.model import (
    And,
    Condition,
    FuzzySystem,
    Path,
    Proposition,
    Rule,
    RuleBase,
    RuleBlock,
    SystemRule,
    questions,
    sentence,
)

_MOST_LEFT = 400  # rules on either side, of which each two are compared

Part = TypeVar("Part")


class Matching(NamedTuple):
    """The parts that two models have in common, by their places, and the others.

    Attributes:
        matches: The old place, the new one, and by which key they are matched.
        removed: The places of the old ones that are left.
        added: The places of the new ones.
    """

    matches: list[tuple[int, int, int]]
    removed: list[int]
    added: list[int]


def match_parts(
    old: list[Part], new: list[Part], *keys: Callable[[Part], Hashable]
) -> Matching:
    """Match parts with equal keys, the first with the first, key after key."""
    removed, added = [*range(len(old))], [*range(len(new))]
    matches: list[tuple[int, int, int]] = []
    for number, key in enumerate(keys):
        waiting: defaultdict[Hashable, list[int]] = defaultdict(list)
        for b in reversed(added):
            waiting[key(new[b])].append(b)
        for a in [*removed]:
            if waiting[key(old[a])]:
                b = waiting[key(old[a])].pop()
                matches.append((a, b, number))
                removed.remove(a)
                added.remove(b)
    return Matching(matches, removed, added)


class Operand(NamedTuple):
    """A proposition of a rule, or a condition that it joins by AND."""

    key: Hashable  # what it means
    words: Hashable  # how it reads, whatever the order of its terms
    text: str
    variable: str


class MatchRule(NamedTuple):
    """A rule of either kind of model, as it is matched."""

    path: Path
    text: str
    operands: tuple[Operand, ...]
    label: str  # what it concludes
    then: str  # the same, as the other model calls it
    terms: set[tuple[str, str]]  # of variables, which it names
    weight: float = 1.0
    block: int | None = None  # of a system

    @property
    def antecedent(self) -> Hashable:
        """What rules have in common with the same antecedent."""
        return self.block, frozenset(operand.key for operand in self.operands)

    @property
    def words(self) -> Hashable:
        """What rules have in common with an antecedent that reads the same."""
        return self.block, frozenset(operand.words for operand in self.operands)

    def changes(self, new: MatchRule) -> str:
        """Return what has changed from this rule to a new one."""
        texts: list[str] = []
        gone, come = self.unlike(new), new.unlike(self)
        for operand in gone:
            match = next((o for o in come if o.variable == operand.variable), None)
            if match is None:
                texts.append(f"it no longer has {operand.text!r}")
            else:
                come.remove(match)
                texts.append(f"it has {match.text!r} in place of {operand.text!r}")
        texts += [f"it also has {operand.text!r}" for operand in come]
        if self.then != new.then:
            noun = "class" if self.block is None else "conclusion"
            texts.append(f"its {noun} is {new.label!r}, and was {self.label!r}")
        if self.weight != new.weight:
            texts.append(f"its weight is {new.weight!r}, and was {self.weight!r}")
        return "; ".join(texts)

    def unlike(self, other: MatchRule) -> list[Operand]:
        """Return operands that another rule has neither by curve nor by word."""
        keys = {operand.key for operand in other.operands}
        words = {operand.words for operand in other.operands}
        return [o for o in self.operands if o.key not in keys and o.words not in words]


def rules_to_match(
    model: RuleBase | FuzzySystem,
    curves: Curves,
    names: Mapping[str, str] = MappingProxyType({}),
) -> list[MatchRule]:
    """Return the rules of a model; `names`: what the other one calls its classes."""
    keys = Keys(model, curves=curves)

    def operand(part: Condition, block: RuleBlock) -> Operand:
        key, text = keys.condition(part, block), condition_sentence(part)
        if not isinstance(part, Proposition):
            return Operand(key, text, text, text)
        words = part.variable, part.hedges, frozenset(part.terms)
        return Operand(key, words, text, part.variable)

    def terms(parts: Iterable[Proposition]) -> set[tuple[str, str]]:
        return {(part.variable, term) for part in parts for term in part.terms}

    blocks: list[tuple[int | None, RuleBlock, Sequence[Rule | SystemRule]]]
    blocks = [(k, block, block.rules) for k, block in enumerate(model.blocks)]
    rules: list[MatchRule] = []
    for number, block, members in blocks or [(None, RuleBlock(()), model.rules)]:
        for rule in members:
            path = model.rule_path(len(rules) + 1)
            if isinstance(rule, Rule):
                label, then, weight = rule.then, names.get(rule.then, rule.then), 1.0
                text, users = sentence(rule), terms(rule.when)
                operands = [operand(part, block) for part in rule.when]
            else:
                label = then = conclusions_text(rule.then)
                weight, when = rule.weight, " and ".join(condition_texts(rule.when))
                text = f"IF {when} THEN {then}" if when else f"ALWAYS {then}"
                parts = rule.when.parts if isinstance(rule.when, And) else (rule.when,)
                operands = [operand(part, block) for part in parts if part]
                users = terms(questions(rule.when))
                users |= {(part.output, part.term) for part in rule.then}
            every = tuple(operands)
            rules.append(
                MatchRule(path, text, every, label, then, users, weight, number)
            )
    return rules


SAME, CONCLUSION, CURVES, PROPOSITIONS = range(4)
"""How rules are matched: as the same; another conclusion alone; the same words, of
which some mean other curves; some propositions in common."""


def match_rules(old: list[MatchRule], new: list[MatchRule]) -> tuple[Matching, int]:
    """Match the rules of two models; return how many were too many to be compared."""
    matches, removed, added = match_parts(
        old,
        new,
        lambda rule: (rule.antecedent, rule.then, rule.weight),
        lambda rule: rule.antecedent,
        lambda rule: (rule.words, rule.then, rule.weight),
    )
    is_large = max(len(removed), len(added)) > _MOST_LEFT
    scores: list[tuple[float, int, int]] = []
    for a in () if is_large else removed:
        for b in added:
            was, now = old[a], new[b]
            common = len(was.operands) - len(was.unlike(now))
            score = 2.0 * common / (len(was.operands) + len(now.operands) or 1)
            if common and was.block == now.block:
                scores.append((-score - 0.5 * (was.then == now.then), a, b))
    for _, a, b in sorted(scores):
        if a in removed and b in added:
            matches.append((a, b, PROPOSITIONS))
            removed.remove(a)
            added.remove(b)
    left = len(removed) + len(added) if is_large else 0
    return Matching(sorted(matches), removed, added), left
