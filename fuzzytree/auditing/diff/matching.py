"""Match the rules of two rule bases by what they mean, and not by their order.

Rules are the same if their propositions have equal curves of the same inputs and their
classes are equal, whatever terms are called. Others are matched, the nearest first:
equal propositions and another class; equal words, with curves that changed; some
propositions in common.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable, Hashable, Mapping
from fractions import Fraction
from typing import Literal, NamedTuple

from fuzzytree.model import (
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Shape,
    shapes_of,
)
from fuzzytree.semantics import points_once

How = Literal["same", "class", "curves", "propositions"]

_MOST_LEFT = 400  # rules on either side, of which each two are compared

AxisKey = str | tuple[Part, ...]
"""The name of an input, or the summands of a combination."""

PropositionKey = tuple[AxisKey, bool, frozenset[int]]
NamedKey = tuple[str, bool, frozenset[str]]


class Match(NamedTuple):
    """Two rules that are taken for one.

    Attributes:
        old: Its number in the old rule base, from 1.
        new: Its number in the new one.
        how: `same`: it says the same. `class`: another class alone. `curves`: the same
            words, of which some mean other curves. `propositions`: some propositions
            differ.
    """

    old: int
    new: int
    how: How


class Matching(NamedTuple):
    """The rules that two rule bases have in common, and the numbers of the others.

    Attributes:
        left: How many rules were too many to be compared with each other.
    """

    matches: tuple[Match, ...]
    removed: tuple[int, ...]
    added: tuple[int, ...]
    left: int


class Curves:
    """Numbers for curves: equal ones for curves of equal degrees everywhere."""

    def __init__(self) -> None:
        self._numbers: dict[Shape, int] = {}

    def number(self, shape: Shape) -> int:
        """Return the number of a curve."""
        if isinstance(shape, Points):
            shape = _without_bends(points_once(shape))
        return self._numbers.setdefault(shape, len(self._numbers))


def _without_bends(points: Points) -> Points:
    """Return points without those at which the line does not bend."""
    numbers = (map(Fraction, of) for of in (points.values, points.degrees))
    pairs = [*zip(*numbers, strict=True)]
    kept = pairs[:1]
    for (x, y), (u, v) in itertools.pairwise(pairs[1:]):
        a, p = kept[-1]
        if a == x or x == u or (y - p) * (u - x) != (v - y) * (x - a):
            kept.append((x, y))
    kept += pairs[1:][-1:]
    while len(kept) > 1 and kept[0][1] == kept[1][1]:
        del kept[0]
    while len(kept) > 1 and kept[-1][1] == kept[-2][1]:
        del kept[-1]
    values, degrees = zip(*((float(x), float(y)) for x, y in kept), strict=True)
    return Points(values, degrees)


class RuleKeys:
    """Keys of the rules of a rule base, equal for rules that mean the same."""

    def __init__(
        self, rules: RuleBase, curves: Curves, names: Mapping[str, str] | None = None
    ) -> None:
        shapes = shapes_of(rules.variables)
        keys: dict[str, AxisKey] = {v.name: v.parts or v.name for v in rules.variables}
        numbers = {place: curves.number(shape) for place, shape in shapes.items()}
        self.rules = rules.rules
        self.names = names or {}
        self._propositions: dict[Proposition, PropositionKey] = {}
        for proposition in {
            proposition for rule in rules.rules for proposition in rule.when
        }:
            terms = frozenset(
                numbers[proposition.variable, term] for term in proposition.terms
            )
            self._propositions[proposition] = (
                keys[proposition.variable],
                proposition.negated,
                terms,
            )

    def proposition(self, proposition: Proposition) -> PropositionKey:
        """Return the key of a proposition."""
        return self._propositions[proposition]

    def then(self, rule: Rule) -> str:
        """Return the class of a rule, as the other rule base calls it."""
        return self.names.get(rule.then, rule.then)

    def same(self, rule: Rule) -> Hashable:
        """Return what rules have in common that say the same."""
        return self.antecedent(rule), self.then(rule)

    def antecedent(self, rule: Rule) -> Hashable:
        """Return what rules have in common with the same antecedent."""
        return frozenset(map(self.proposition, rule.when))

    def words(self, rule: Rule) -> Hashable:
        """Return what rules have in common that read the same."""
        return frozenset(map(words_of, rule.when)), self.then(rule)


def words_of(proposition: Proposition) -> NamedKey:
    """Return how a proposition reads, whatever the order of its terms."""
    return proposition.variable, proposition.negated, frozenset(proposition.terms)


def matching(one: RuleKeys, other: RuleKeys) -> Matching:
    """Match the rules of two rule bases."""
    old, new = (dict(enumerate(said.rules, 1)) for said in (one, other))
    matches: list[Match] = []
    steps: tuple[tuple[How, Callable[[RuleKeys, Rule], Hashable]], ...] = (
        ("same", RuleKeys.same),
        ("class", RuleKeys.antecedent),
        ("curves", RuleKeys.words),
    )
    for how, key in steps:
        pairs = paired(
            {number: key(one, rule) for number, rule in old.items()},
            {number: key(other, rule) for number, rule in new.items()},
        )
        matches += [Match(a, b, how) for a, b in pairs]
        for a, b in pairs:
            del old[a], new[b]
    left = len(old) + len(new) if max(len(old), len(new)) > _MOST_LEFT else 0
    if not left:
        for a, b in _nearest(one, old, other, new):
            matches.append(Match(a, b, "propositions"))
            del old[a], new[b]
    return Matching(tuple(sorted(matches)), tuple(old), tuple(new), left)


def paired(
    old: Mapping[int, Hashable], new: Mapping[int, Hashable]
) -> list[tuple[int, int]]:
    """Return pairs of equal keys, the first with the first."""
    waiting: defaultdict[Hashable, list[int]] = defaultdict(list)
    for number, key in reversed([*new.items()]):
        waiting[key].append(number)
    return [(n, waiting[key].pop()) for n, key in old.items() if waiting.get(key)]


def _nearest(
    one: RuleKeys, old: Mapping[int, Rule], other: RuleKeys, new: Mapping[int, Rule]
) -> list[tuple[int, int]]:
    """Return pairs of rules with propositions in common, those with the most first."""
    scored: list[tuple[float, int, int]] = []
    keys = {
        n: [(other.proposition(c), words_of(c)) for c in r.when] for n, r in new.items()
    }
    for a, rule in old.items():
        mine = [(one.proposition(c), words_of(c)) for c in rule.when]
        for b, match in new.items():
            common = sum(
                any(x == y or u == v for y, v in keys[b]) for x, u in mine
            )  # either the curves are the same or the words
            score = 2.0 * common / (len(mine) + len(keys[b]) or 1)
            if common:
                score += 0.5 * (one.then(rule) == other.then(match))
                scored.append((-score, a, b))
    pairs: dict[int, int] = {}
    taken: set[int] = set()
    for _, a, b in sorted(scored):
        if a not in pairs and b not in taken:
            pairs[a] = b
            taken.add(b)
    return list(pairs.items())
