"""Claims about every input, compared with all inputs that can differ, in fractions."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import cached_property

import numpy as np
import numpy.typing as npt
import pytest
from msgspec.structs import replace

from fuzzytree.auditing.decide.states import Proved
from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.records import Audit, AuditAnswer, AuditSelection
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.model.rulebase import (
    Band,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Shape,
    Term,
    Variable,
)
from fuzzytree.numerics import exact_degree

LOW, HIGH = 0.0, 4.0
RULES = AuditSelection(select=["FT1", "FT2", "FT3"])
Ranks = npt.NDArray[np.int64]


def random_shape(chance: random.Random) -> Shape:
    """Return a step, a plateau with steps or flanks, a slope or a triangle."""
    places = sorted(chance.sample([k / 10 for k in range(1, 40)], 4))
    a, b, c, d = places
    shapes: list[Shape] = [
        Band(low=b),
        Band(high=b),
        Band(b, c),
        Band(b, c, left=a),
        Band(b, c, right=d),
        Points((a, c), (1.0, 0.0)),
        Points((a, c), (0.0, chance.choice([0.6, 1.0]))),
        Points((a, b, d), (0.0, chance.choice([0.7, 1.0]), 0.0)),
    ]
    return chance.choice(shapes)


def random_rules(seed: int) -> RuleBase:
    """Return rules of three classes on one variable; each fourth base has two."""
    chance = random.Random(seed)
    names = ["x", "y"] if seed % 4 == 0 else ["x"]
    terms = [f"t{k}" for k in range(4 // len(names))]
    variables = tuple(
        Variable(
            name,
            tuple(Term(term, random_shape(chance)) for term in terms),
            low=LOW,
            high=HIGH,
        )
        for name in names
    )

    def proposition(name: str) -> Proposition:
        plain = Proposition(name, (chance.choice(terms),))
        return replace(plain, hedges=("not",)) if chance.random() < 0.2 else plain

    rules = tuple(
        Rule(
            tuple(
                map(proposition, chance.sample(names, chance.randint(1, len(names))))
            ),
            chance.choice("abc"),
        )
        for _ in range(5)
    )
    return RuleBase("random", ("a", "b", "c"), variables, rules)


class Grid:
    """All strengths of rules, as ranks of their degrees.

    Attributes:
        rules: The rule base.
    """

    def __init__(self, rules: RuleBase) -> None:
        self.rules = rules
        self.pieces = [[*_pieces(_shapes(variable))] for variable in rules.variables]
        ends = {
            end
            for pieces in self.pieces
            for *_, lines in pieces
            for line in lines
            for end in line
        }
        ends |= {1 - end for end in ends} | {Fraction(1, 2), Fraction(0.1)}
        order = sorted(ends)
        middles = {(p + q) / 2 for p, q in itertools.pairwise(order)}
        levels = sorted(ends | middles)
        # Shares of their own, so that two inputs have no degree in common by chance.
        shares = Fraction(3, 7), Fraction(5, 11)
        places = [
            [*_places(pieces, levels, share)]
            for pieces, share in zip(self.pieces, shares, strict=False)
        ]
        degrees = [
            [[exact_degree(shape, x) for x in of] for shape in _shapes(variable)]
            for variable, of in zip(rules.variables, places, strict=True)
        ]
        every = {d for of in degrees for row in of for d in row}
        every |= {1 - d for d in every} | ends
        rank = {value: number for number, value in enumerate(sorted(every))}
        self.rank = rank.__getitem__
        self.degrees = [
            {
                (term.name, negated): np.array(
                    [rank[1 - d if negated else d] for d in row]
                )
                for term, row in zip(variable.terms, of, strict=True)
                for negated in (False, True)
            }
            for variable, of in zip(rules.variables, degrees, strict=True)
        ]
        # Each second place of an axis stands for an open part of it.
        inner = tuple(slice(1, None, 2) for _ in places)
        self.inner = inner
        self.shape = tuple(map(len, places))

    def strength(self, when: tuple[Proposition, ...]) -> Ranks:
        """Return the strength of an antecedent on all of the grid."""
        result = np.full(self.shape, self.rank(Fraction(1)))
        for one in when:
            axis = [v.name for v in self.rules.variables].index(one.variable)
            degree = self.degrees[axis][one.terms[0], one.negated]
            shape = [1] * len(self.shape)
            shape[axis] = -1
            result = np.minimum(result, degree.reshape(shape))
        return result

    @cached_property
    def strengths(self) -> Ranks:
        """The strength of each rule."""
        return np.array([self.strength(rule.when) for rule in self.rules.rules])

    def decisions(self, strengths: Ranks) -> npt.NDArray[np.str_]:
        """Return the class on each open part."""
        inner = strengths[:, *self.inner]
        classes = np.array([rule.then for rule in self.rules.rules])
        is_none = inner.max(axis=0) == self.rank(Fraction(0))
        return np.where(is_none, "", classes[inner.argmax(axis=0)])


def _shapes(variable: Variable) -> list[Shape]:
    functions = (term.function for term in variable.terms)
    return [one for one in functions if isinstance(one, Band | Points)]


def _pieces(
    shapes: list[Shape],
) -> Iterator[tuple[Fraction, Fraction, list[tuple[Fraction, Fraction]]]]:
    """Yield parts between which no shape bends, jumps or meets another or its mirror.

    With the limits of each shape at both ends.
    """
    cuts = {Fraction(LOW), Fraction(HIGH)}
    cuts.update(Fraction(x) for shape in shapes for x in shape.knots())
    for a, b in itertools.pairwise(sorted(cuts)):
        lines: list[tuple[Fraction, Fraction]] = []
        for shape in shapes:
            p, q = (exact_degree(shape, a + k * (b - a) / 3) for k in (1, 2))
            lines.append((2 * p - q, 2 * q - p))
        both = lines + [(1 - p, 1 - q) for p, q in lines]
        meet = {Fraction(0), Fraction(1)}
        for (p, q), (r, s) in itertools.combinations(both, 2):
            if (p - r) * (q - s) < 0:
                meet.add((p - r) / (p - r - q + s))
        for u, v in itertools.pairwise(sorted(meet)):
            ends = [(p + u * (q - p), p + v * (q - p)) for p, q in lines]
            yield a + u * (b - a), a + v * (b - a), ends


def _places(
    pieces: list[tuple[Fraction, Fraction, list[tuple[Fraction, Fraction]]]],
    levels: list[Fraction],
    share: Fraction,
) -> Iterator[Fraction]:
    """Yield where a shape or its mirror has one of some levels, and between these."""
    cuts = {end for a, b, _ in pieces for end in (a, b)}
    for a, b, lines in pieces:
        for p, q in [*lines, *((1 - p, 1 - q) for p, q in lines)]:
            for level in levels:
                if (p - level) * (q - level) < 0:
                    cuts.add(a + (b - a) * (level - p) / (q - p))
    order = sorted(cuts)
    for a, b in itertools.pairwise(order):
        yield from (a, a + share * (b - a))
    yield order[-1]


# --- what is claimed, and whether it is so on the grid

Claimed = Callable[[Grid, Audit, AuditAnswer], bool]


def _wins(grid: Grid, number: int, rivals: list[int]) -> bool:
    strengths = grid.strengths
    best = strengths[[n - 1 for n in rivals]].max(
        axis=0, initial=grid.rank(Fraction(0))
    )
    return bool((strengths[number - 1] > best).any())


def _rivals(grid: Grid, number: int) -> list[int]:
    rules = grid.rules.rules
    return [n for n, r in enumerate(rules, 1) if r.then != rules[number - 1].then]


def _never_wins(grid: Grid, _: Audit, answer: AuditAnswer) -> bool:
    return not _wins(grid, answer.rules[0], _rivals(grid, answer.rules[0]))


def _never_fires(grid: Grid, _: Audit, answer: AuditAnswer) -> bool:
    return not _wins(grid, answer.rules[0], [])


def _superfluous(grid: Grid, _: Audit, answer: AuditAnswer) -> bool:
    rest = grid.strengths.copy()
    rest[answer.rules[0] - 1] = grid.rank(Fraction(0))
    return bool((grid.decisions(rest) == grid.decisions(grid.strengths)).all())


def _irrelevant(grid: Grid, _: Audit, answer: AuditAnswer) -> bool:
    number = answer.rules[0]
    when = grid.rules.rules[number - 1].when
    left = [p for p in when if str(p) != answer.facts["proposition"]]
    changed = grid.strengths.copy()
    changed[number - 1] = grid.strength(tuple(left))
    return bool((grid.decisions(changed) == grid.decisions(grid.strengths)).all())


def _hidden(grid: Grid, _: Audit, answer: AuditAnswer) -> bool:
    weak, *strong = (grid.strengths[n - 1] for n in answer.rules)
    return all(bool((one >= weak).all()) for one in strong)


def _no_other_hidden(grid: Grid, found: Audit, answer: AuditAnswer) -> bool:
    listed = [a for a in found.findings if a.code == answer.code]
    known = {frozenset((a.rules[0], n)) for a in listed for n in a.rules[1:]}
    is_alike = answer.code == "FT104"
    fires = [n for n in _numbers(grid) if _wins(grid, n, [])]
    for one, other in itertools.combinations(fires, 2):
        is_same = one not in _rivals(grid, other)
        if is_same is is_alike and frozenset((one, other)) not in known:
            pairs = [(one, other), (other, one)] if is_alike else [(other, one)]
            if not all(_wins(grid, a, [b]) for a, b in pairs):
                return False
    return True


def _no_other_ties(grid: Grid, found: Audit, answer: AuditAnswer) -> bool:
    known = {a.rules for a in found.findings if a.code == "FT202"}
    inner = grid.strengths[:, *grid.inner]
    best = inner.max(axis=0)
    return not any(
        (
            (inner[one - 1] == best)
            & (inner[other - 1] == best)
            & (best > grid.rank(Fraction(0)))
        ).any()
        for one, other in itertools.combinations(_numbers(grid), 2)
        if one in _rivals(grid, other) and (one, other) not in known
    )


def _never_conflict(grid: Grid, found: Audit, answer: AuditAnswer) -> bool:
    known = {a.rules for a in found.answers if a.code == "FT201" and a.rules}
    level = grid.rank(Fraction(1, 2))
    return not any(
        (np.minimum(grid.strengths[one - 1], grid.strengths[other - 1]) >= level).any()
        for one, other in itertools.combinations(_numbers(grid), 2)
        if one in _rivals(grid, other) and (one, other) not in known
    )


def _fires(grid: Grid, _: Audit, answer: AuditAnswer) -> bool:
    return bool((grid.strengths.max(axis=0) > grid.rank(Fraction(0))).all())


def _reaches(grid: Grid, _: Audit, answer: AuditAnswer) -> bool:
    return bool((grid.strengths.max(axis=0) >= grid.rank(Fraction(0.1))).all())


def _numbers(grid: Grid) -> range:
    return range(1, len(grid.rules.rules) + 1)


CLAIMS: dict[str, Claimed] = {
    "FT101.never-wins": _never_wins,
    "FT101.may-decide-by-place": _never_wins,
    "FT101.never-fires": _never_fires,
    "FT103.superfluous": _superfluous,
    "FT104.subsumed": _hidden,
    "FT104.others": _no_other_hidden,
    "FT105.masked": _hidden,
    "FT105.weaker": _hidden,
    "FT105.others": _no_other_hidden,
    "FT107.irrelevant": _irrelevant,
    "FT107.silent": _never_fires,
    "FT201.never": _never_conflict,
    "FT202.others": _no_other_ties,
    "FT301.fires": _fires,
    "FT301.reaches": _reaches,
}


@pytest.mark.parametrize("seed", range(60))
def test_no_claim_about_every_input_is_false_at_one(seed: int) -> None:
    rules = random_rules(seed)
    grid, found = Grid(rules), audit(Material(rules), selection=RULES)
    assert not [a.sentence for a in found.answers if a.code == "FT901"]
    proofs = [
        a for a in found.answers if isinstance(a.state, Proved) and a.message in CLAIMS
    ]
    assert not [a.sentence for a in proofs if not CLAIMS[a.message](grid, found, a)]
    dead = {a.rules[0] for a in found.findings if a.code == "FT101"}
    assert dead == {n for n in _numbers(grid) if not _wins(grid, n, _rivals(grid, n))}
