"""Audits of one question each: the re-checker accepts them, and a grid agrees."""

from __future__ import annotations

import itertools
import random
from collections import Counter
from collections.abc import Sequence
from fractions import Fraction

import msgspec
import numpy as np
import numpy.typing as npt
import pytest

from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.states import Proved
from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.codes import AUDITED
from fuzzytree.auditing.findings.locations import model_file
from fuzzytree.auditing.findings.records import Audit, AuditAnswer, AuditSelection
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.auditing.recheck import recheck
from fuzzytree.exporters import yaml
from fuzzytree.model import (
    And,
    Conclusion,
    Condition,
    Conjunction,
    Defuzzifier,
    FuzzySystem,
    Is,
    Not,
    Or,
    Points,
    Proposition,
    Rule,
    RuleBase,
    RuleBlock,
    Semantics,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
    proposition_text,
    shapes_of,
)
from fuzzytree.numerics.exact import exact_degree

Numbers = npt.NDArray[np.int64]

CODES = sorted(AUDITED - {"FT601", "FT602"})  # these two run programs
"""The questions, each of which is selected alone."""

TOP, STEPS = 4, 12  # inputs go from 0 to 4; the grid has 12 places to each number
WHOLE = STEPS * 24  # degrees there are multiples of the 24 STEPSth part of 1


def random_points(chance: random.Random) -> Points:
    """Return points at whole numbers, with degrees 0, 1/2 and 1."""
    values = sorted(chance.sample(range(TOP + 1), chance.randint(1, 4)))
    degrees = (chance.choice((0.0, 0.0, 0.5, 1.0, 1.0)) for _ in values)
    return Points(tuple(map(float, values)), tuple(degrees))


def random_rules(seed: int) -> RuleBase:
    """Return a few rules, some of which are equal, contradict or never fire."""
    chance = random.Random(seed)
    norm: Conjunction = chance.choice(("minimum", "product"))
    names = ("x", "y")[: chance.randint(1, 2)]
    shapes = [random_points(chance) for _ in range(3)]
    terms = tuple(
        Term(name, chance.choice(shapes)) for name in ("low", "mid", "high", "spare")
    )
    rules: list[Rule] = []
    for _ in range(chance.randint(2, 4)):
        when = [
            Proposition(name, (chance.choice(terms[:3]).name,), chance.random() < 0.15)
            for name in (*names, *names)  # at most four propositions
            if chance.random() < 0.5
        ]
        if rules and chance.random() < 0.4:  # the antecedent of another one
            when = [*chance.choice(rules).when]
            chance.shuffle(when)
        rules.append(Rule(tuple(when), chance.choice("ab")))
    variables = tuple(Variable(name, terms, "", 0.0, float(TOP)) for name in names)
    uncovered = chance.choice((None, "a"))
    return RuleBase(
        "r", ("a", "b"), variables, tuple(rules), Semantics(norm, uncovered=uncovered)
    )


def random_numeric_system(seed: int) -> FuzzySystem:
    """Return a system with rules that are equal, weigh nothing or hold in two ways."""
    chance = random.Random(seed)
    curves = tuple(
        Term(name, random_points(chance)) for name in ("low", "mid", "high", "spare")
    )
    inputs = tuple(
        Variable(name, curves, low=0.0, high=float(TOP))
        for name in ("x", "y")[: chance.randint(1, 2)]
    )
    labels = tuple(Term(name, Singleton(x)) for name, x in (("s", 1.0), ("l", 2.0)))
    how = Defuzzifier("weighted average")
    outputs = tuple(
        SystemOutput(name, labels, None, None, how)
        for name in ("u", "v")[: chance.randint(1, 2)]
    )

    def question() -> Condition:
        one = Is(chance.choice(inputs).name, chance.choice(curves[:3]).name)
        return Not(one) if chance.random() < 0.15 else one

    rules: list[SystemRule] = []
    for _ in range(chance.randint(2, 4)):
        when: Condition = question()
        if chance.random() < 0.4:
            when = chance.choice((And, Or))((when, question()))
        if rules and chance.random() < 0.4:
            when = chance.choice([r.when for r in rules if r.when is not None])
        then = tuple(
            Conclusion(one.name, chance.choice("sl"))
            for one in outputs
            if one is outputs[0] or chance.random() < 0.5
        )
        weight = chance.choice((1.0, 1.0, 1.0, 0.5, 0.0))
        rules.append(SystemRule(when, then, weight))
    return FuzzySystem("s", inputs, outputs, (RuleBlock(tuple(rules)),))


def audited(model: RuleBase | FuzzySystem, code: str) -> tuple[Audit, list[str]]:
    """Return the audit of one question, and what the re-checker refuses of it."""
    content = yaml.write(model).content
    found = audit(
        Material(model, file=model_file("m.yaml", content)),
        clock=Clock(20.0),
        repeat="fuzzytree audit m.yaml",
        selection=AuditSelection(select=[code]),
    )
    text = msgspec.json.encode(found)
    return found, recheck(text, content, ("a.json", "m.yaml")).wrong


def refused(model: RuleBase | FuzzySystem) -> list[str]:
    """Return what the re-checker refuses of audits of one question each."""
    return [f"{code}: {text}" for code in CODES for text in audited(model, code)[1]]


# --- what a grid shows


class Grid:
    """The strengths of all rules at many points, as whole numbers.

    Attributes:
        rules: The rules.
        strengths: Shape (rules, points): multiples of the least degree that occurs.
        one: What stands for strength 1.
    """

    def __init__(self, rules: RuleBase) -> None:
        self.rules = rules
        self.is_min = rules.semantics.conjunction == "minimum"
        self.one = WHOLE if self.is_min else WHOLE**4
        made = [self.strength(rule.when) for rule in rules.rules]
        self.strengths = np.array(made)

    def strength(self, when: Sequence[Proposition]) -> Numbers:
        """Return the strength of a rule with at most four propositions."""
        places = [Fraction(k, STEPS) for k in range(TOP * STEPS + 1)]
        names = [variable.name for variable in self.rules.variables]
        shapes = shapes_of(self.rules.variables)
        found = np.full([len(places)] * len(names), self.one, np.int64)
        for proposition in when:
            (term,) = proposition.terms
            shape = shapes[proposition.variable, term]
            each = [WHOLE * exact_degree(shape, x) for x in places]
            assert all(degree.denominator == 1 for degree in each)
            degrees = np.array([*map(int, each)])
            degrees = WHOLE - degrees if proposition.negated else degrees
            along = degrees.reshape(
                [-1 if n == proposition.variable else 1 for n in names]
            )
            product = found // WHOLE * along
            found = np.minimum(found, along) if self.is_min else product
        return found.ravel()

    def decided(self, strengths: Numbers) -> list[str | None]:
        """Return the class at each point; rules without strength decide nothing."""
        default = self.rules.semantics.uncovered
        first = strengths.argmax(axis=0).tolist()
        return [
            self.rules.rules[number].then if strengths[number, at] > 0 else default
            for at, number in enumerate(first)
        ]

    def is_hidden(self, weak: int, strong: int) -> bool:
        """Return whether a rule, counted from 1, is nowhere above another one.

        Of two classes, the other one must also go before it in a tie.
        """
        mine, other = self.strengths[weak - 1], self.strengths[strong - 1]
        then = [self.rules.rules[number - 1].then for number in (weak, strong)]
        if then[0] == then[1] or strong < weak:
            return bool((other >= mine).all())
        return bool((other > mine)[mine > 0].all())


def disproved(grid: Grid, found: Audit) -> list[str]:
    """Return the answers, all proved, that the points of a grid contradict."""
    return [
        answer.sentence
        for answer in found.answers
        if isinstance(answer.state, Proved) and not _is_so(grid, found, answer)
    ]


def _is_so(grid: Grid, found: Audit, answer: AuditAnswer) -> bool:
    strengths, rules = grid.strengths, grid.rules.rules
    numbers = [number - 1 for number in answer.rules]
    reported = [one.rules for one in found.answers if one.rules]
    fires = [bool((one > 0).any()) for one in strengths]
    if answer.code in ("FT104", "FT105") and numbers:
        weak, *strong = answer.rules
        return fires[weak - 1] and all(grid.is_hidden(weak, one) for one in strong)
    if answer.code in ("FT104", "FT105"):
        pairs = [
            (weak, strong)
            for weak, strong in itertools.permutations(range(1, len(rules) + 1), 2)
            if (rules[weak - 1].then == rules[strong - 1].then)
            is (answer.code == "FT104")
            and fires[weak - 1]
            and fires[strong - 1]
        ]
        hidden = [pair for pair in pairs if grid.is_hidden(*pair)]
        known = {frozenset((one[0], other)) for one in reported for other in one[1:]}
        count = next(m.value for m in answer.measures if m.name == "pairs")
        return count == len(pairs) / 2 and all(frozenset(p) in known for p in hidden)
    if answer.code == "FT101":
        label = rules[numbers[0]].then
        others = [k for k, rule in enumerate(rules) if rule.then != label]
        rivals = strengths[others].max(axis=0, initial=0)
        return not (strengths[numbers[0]] > rivals).any()
    if answer.code == "FT103":
        rest = strengths.copy()
        rest[numbers[0]] = -1
        # Where strengths only touch is left out, and the sentence says so.
        tops = [
            {rules[k].then for k in np.flatnonzero(column == column.max())}
            for column in strengths.T
        ]
        both = zip(grid.decided(strengths), grid.decided(rest), tops, strict=True)
        return all(a == b for a, b, top in both if len(top) == 1)
    if answer.code == "FT106":
        if numbers:
            return bool((strengths[numbers[0]] == strengths[numbers[1]]).all())
        same = [
            (a + 1, b + 1)
            for a, b in itertools.combinations(range(len(rules)), 2)
            if Counter(rules[a].when) == Counter(rules[b].when)
        ]
        return all(pair in reported for pair in same)
    if answer.code == "FT107" and answer.terms:
        when = [*rules[numbers[0]].when]
        ends = [answer.subject.endswith(repr(proposition_text(one))) for one in when]
        del when[ends.index(True)]
        other = strengths.copy()
        other[numbers[0]] = grid.strength(when)
        return grid.decided(strengths) == grid.decided(other)
    if answer.code == "FT201":
        level = grid.one * Fraction(found.settings.level)
        omitted = next(m.value for m in answer.measures if "not listed" in m.name)
        return omitted > 0 or all(
            (a + 1, b + 1) in reported
            or np.minimum(strengths[a], strengths[b]).max() < level
            for a, b in itertools.combinations(range(len(rules)), 2)
            if rules[a].then != rules[b].then
        )
    if answer.code == "FT301":
        is_epsilon = answer.subject != "cover"
        least = grid.one * Fraction(found.settings.epsilon) if is_epsilon else 0
        lowest = int(strengths.max(axis=0).min())
        return lowest >= least if is_epsilon else lowest > 0
    return True


@pytest.mark.one_in(30)
@pytest.mark.parametrize("seed", range(30))
def test_every_audit_of_one_question_is_accepted_unedited(seed: int) -> None:
    assert refused(random_rules(seed)) == []
    assert refused(random_numeric_system(seed)) == []


@pytest.mark.one_in(20)
@pytest.mark.parametrize("seed", range(40))
def test_no_point_of_a_grid_contradicts_what_is_proved(seed: int) -> None:
    rules = random_rules(seed)
    grid = Grid(rules)
    assert [t for code in CODES for t in disproved(grid, audited(rules, code)[0])] == []
