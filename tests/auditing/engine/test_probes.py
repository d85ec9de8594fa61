"""What points show of rules is true in fractions, and never too much."""

from __future__ import annotations

from fractions import Fraction

import pytest

from fuzzytree.auditing.engine.arrangement import arrange, strength_above, strengths_at
from fuzzytree.auditing.engine.probes import RandomProbes
from fuzzytree.auditing.engine.questions import wins
from fuzzytree.auditing.engine.states import Witness, point_of
from fuzzytree.model.rulebase import Conjunction
from tests.auditing.engine.bases import random_base, unit_domain, with_hidden_rule


@pytest.mark.one_in(2)
@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_a_rule_that_is_seen_to_win_does_so_in_fractions(
    conjunction: Conjunction,
) -> None:
    seen = reported = 0
    for seed in range(6):
        base = random_base(seed, 9, 3, conjunction, "mixed", odd=0.3, combinations=1)
        given = arrange(base, unit_domain(base))
        glimpses = RandomProbes(given)
        for rule in range(1, 10):
            label = base.rules[rule - 1].then
            rivals = [n for n in range(1, 10) if base.rules[n - 1].then != label]
            others = [n for n in range(1, 10) if n != rule]
            pairs = (
                (glimpses.wins(rule, rivals), rivals),
                (
                    glimpses.wins_alone(rule, others),
                    others,
                ),
            )
            for found, rest in pairs:
                reported += 1
                if found is None:
                    continue
                seen += 1
                strengths = strengths_at(given, point_of(found.point))
                assert strengths[rule - 1] > max(strengths[n - 1] for n in rest)
                assert found.claims[0].rivals == tuple(rest)
                assert found.claims[1].level == str(strengths[rule - 1])
    assert reported // 2 < seen < reported


def test_a_rule_that_never_wins_is_not_seen_to() -> None:
    base = with_hidden_rule(random_base(0, 7, 4))
    number = len(base.rules)
    label = base.rules[-1].then
    rivals = [n for n, rule in enumerate(base.rules, 1) if rule.then != label]
    glimpses = RandomProbes(arrange(base, unit_domain(base)))
    assert not glimpses.is_ahead(number)
    assert glimpses.wins(number, rivals) is None


@pytest.mark.heavy
def test_a_rule_that_is_not_seen_may_win_in_a_sliver() -> None:
    base = with_hidden_rule(random_base(0, 7, 4), 0.7 - 1e-6)
    number = len(base.rules)
    label = base.rules[-1].then
    rivals = [n for n, rule in enumerate(base.rules, 1) if rule.then != label]
    given = arrange(base, unit_domain(base))
    assert RandomProbes(given).wins(number, rivals) is None
    assert isinstance(wins(given, number, rivals), Witness)


def test_no_proposition_is_evaluated_after_the_stronger_rule_is_known() -> None:
    base = random_base(4, 8, 3)
    given = arrange(base, unit_domain(base))
    point = {name: Fraction(3, 8) for name in base.inputs}
    strengths = strengths_at(given, point)
    first = strengths.index(max(strengths)) + 1
    others = [n for n in range(1, 9) if n != first]
    assert strength_above(given, point, first, others) == max(strengths) > 0
    assert strength_above(given, point, others[0], [first]) is None
