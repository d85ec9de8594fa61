"""Branch and bound proves, finds and brackets, and never claims too much."""

import itertools
import random
from collections.abc import Iterator
from fractions import Fraction

import pytest
from msgspec.structs import replace

from fuzzytree.auditing.engine.arrangement import arrange
from fuzzytree.auditing.engine.bounding import (
    below_by_boxes,
    highest_by_boxes,
    largest_lead_by_boxes,
    least_cover_by_boxes,
    wins_by_boxes,
)
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.questions import wins
from fuzzytree.auditing.engine.states import (
    Bracket,
    Coordinate,
    Proved,
    Witness,
    point_of,
)
from fuzzytree.model.rulebase import (
    Band,
    Conjunction,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.numerics.exact import exact_answer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree
from tests.auditing.engine.bases import (
    cpu_clock,
    random_base,
    unit_domain,
    with_hidden_rule,
)

CONJUNCTIONS: tuple[Conjunction, ...] = ("minimum", "product")


def _strengths(rules: RuleBase, point: tuple[Coordinate, ...]) -> tuple[Fraction, ...]:
    row = {name: float(value) for name, value in point_of(point).items()}
    assert all(Fraction(row[one.input]) == Fraction(one.exact) for one in point)
    return exact_answer(rules, row).strengths


def _rivals(rules: RuleBase, rule: int) -> tuple[int, ...]:
    own = rules.rules[rule - 1].then
    return tuple(n for n, one in enumerate(rules.rules, 1) if one.then != own)


def _rows(rules: RuleBase, count: int, seed: int = 0) -> Iterator[dict[str, float]]:
    draw = random.Random(seed)
    for _ in range(count):
        yield {name: draw.random() for name in rules.inputs}


def _small_bases(conjunction: Conjunction) -> Iterator[RuleBase]:
    for seed in (2, 5, 7):
        yield random_base(
            seed,
            5,
            3,
            conjunction,
            "mixed",
            shared=0.2 * (seed % 4),
            odd=0.3 * (seed % 2),
            combinations=seed % 3 == 2,
        )


@pytest.mark.one_in(2)
@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
def test_every_witness_holds_and_no_sampled_row_contradicts_a_proof(
    conjunction: Conjunction,
) -> None:
    states = set()
    for rules in _small_bases(conjunction):
        answers = [exact_answer(rules, row).strengths for row in _rows(rules, 25)]
        for rule in range(1, 6):
            rivals = _rivals(rules, rule)
            state = wins_by_boxes(
                rules, unit_domain(rules), rule, rivals, cpu_clock(5.0)
            )
            states.add(type(state))
            if isinstance(state, Witness):
                strengths = _strengths(rules, state.point)
                assert all(strengths[rule - 1] > strengths[n - 1] for n in rivals)
                assert all(0 <= Fraction(one.exact) <= 1 for one in state.point)
            else:
                assert isinstance(state, Proved)
                assert not any(
                    all(one[rule - 1] > one[n - 1] for n in rivals) for one in answers
                )
    assert Witness in states


def _check_against_cells(rules: RuleBase) -> None:
    box = unit_domain(rules)
    given = arrange(rules, box)
    for rule in range(1, 6):
        rivals = _rivals(rules, rule)
        one = wins_by_boxes(rules, box, rule, rivals, cpu_clock(5.0))
        other = wins(given, rule, rivals)
        # Where rules tie at irrational levels, cells alone cannot tell.
        if not isinstance(other, Bracket):
            assert type(one) is type(other), (rules.name, rule)


def test_boxes_and_cells_agree_under_the_minimum() -> None:
    _check_against_cells(random_base(2, 5, 2, "minimum", "mixed", shared=0.4))


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(8))
def test_boxes_and_cells_agree_on_many_bases(seed: int) -> None:
    _check_against_cells(
        random_base(seed, 5, 3, "minimum", "mixed", shared=0.2 * (seed % 4))
    )


def _covered_by_two(degree: float, conjunction: Conjunction) -> RuleBase:
    """Return rules of which the first is dead by the union of the others.

    Neither of the others suffices: each is at its level on one half of x only.
    """
    x = Variable(
        "x",
        (
            Term("middle", Points((0.2, 0.5, 0.8), (0.0, 0.7, 0.0))),
            Term("left", Points((0.5, 0.6), (degree, 0.0))),
            Term("right", Points((0.4, 0.5), (0.0, degree))),
        ),
    )
    y = Variable(
        "y",
        (
            Term("some", Points((0.1, 0.6, 0.9), (0.0, 0.8, 0.0))),
            Term("more", Points((0.1, 0.5, 0.7, 0.9), (0.0, 0.9, 0.9, 0.0))),
        ),
    )

    def rule(where: str, then: str) -> Rule:
        size = "some" if then == "a" else "more"
        return Rule((Proposition("x", (where,)), Proposition("y", (size,))), then)

    made = (rule("middle", "a"), rule("left", "b"), rule("right", "c"))
    return RuleBase("two", ("a", "b", "c"), (x, y), made, Semantics(conjunction))


@pytest.mark.one_in(4)
@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
@pytest.mark.parametrize("degree", [0.7, 0.71, 0.9])
def test_a_rule_dead_by_the_union_of_two_others_is_proved(
    conjunction: Conjunction, degree: float
) -> None:
    rules = _covered_by_two(degree, conjunction)
    box = unit_domain(rules)
    assert isinstance(wins_by_boxes(rules, box, 1, (2, 3)), Proved)
    assert isinstance(wins_by_boxes(rules, box, 1, (2,)), Witness)
    lead = largest_lead_by_boxes(rules, box, 1, (2, 3))
    assert lead.low == 0.0
    assert lead.high <= 1e-6


def test_a_rule_that_leads_in_a_sliver_is_found() -> None:
    rules = _covered_by_two(0.7 - 1e-9, "product")
    # At y = 0.11 "more" is weaker than "some" is not: so only x = 0.5 leaves a lead.
    y = rules.variables[1]
    alike = replace(y, terms=(y.terms[0], Term("more", y.terms[0].shape)))
    rules = replace(rules, variables=(rules.variables[0], alike))
    state = wins_by_boxes(rules, unit_domain(rules), 1, (2, 3))
    assert isinstance(state, Witness)
    first, *others = _strengths(rules, state.point)
    assert max(others) < first < max(others) + Fraction(1, 10**8)


@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
def test_rules_of_a_tree_that_share_propositions_are_decided(
    conjunction: Conjunction,
) -> None:
    # Rules from one subtree tie wherever a shared proposition is the smallest.
    for seed in range(2):
        rules = rules_from_tree(random_tree(seed, leaves=6), conjunction=conjunction)
        box = Domain(tuple(DomainSide(name, -9.0, 9.0) for name in rules.inputs))
        for rule in range(1, 7):
            state = wins_by_boxes(
                rules, box, rule, _rivals(rules, rule), cpu_clock(5.0)
            )
            assert isinstance(state, Witness | Proved)


@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
def test_the_largest_lead_is_between_its_bounds(conjunction: Conjunction) -> None:
    for rules in itertools.islice(_small_bases(conjunction), 1):
        rivals = _rivals(rules, 2)
        found = largest_lead_by_boxes(
            rules, unit_domain(rules), 2, rivals, cpu_clock(5.0), tolerance=1e-2
        )
        assert 0.0 <= found.low <= found.high <= found.low + 1.1e-2
        strengths = _strengths(rules, found.point)
        lead = strengths[1] - max(strengths[n - 1] for n in rivals)
        assert found.low <= lead <= found.high
        for row in _rows(rules, 50):
            strengths = exact_answer(rules, row).strengths
            lead = strengths[1] - max(strengths[n - 1] for n in rivals)
            assert lead <= found.high


@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
def test_the_least_cover_is_below_every_sampled_one(conjunction: Conjunction) -> None:
    rules = random_base(1, 6, 2, conjunction, "lr")
    found = least_cover_by_boxes(
        rules, unit_domain(rules), cpu_clock(5.0), tolerance=1e-4
    )
    assert found.high - found.low <= 1e-4
    assert found.low <= max(_strengths(rules, found.point)) <= found.high
    for row in _rows(rules, 100):
        assert max(exact_answer(rules, row).strengths) >= found.low
    above = below_by_boxes(rules, unit_domain(rules), found.low / 2)
    assert isinstance(above, Proved)
    beneath = below_by_boxes(rules, unit_domain(rules), found.high * 2)
    assert isinstance(beneath, Witness)
    assert max(_strengths(rules, beneath.point)) < found.high * 2


def test_an_input_that_no_rule_covers_is_found() -> None:
    rules = _covered_by_two(0.9, "product")
    state = below_by_boxes(rules, unit_domain(rules), 0)
    assert isinstance(state, Witness)
    assert max(_strengths(rules, state.point)) == 0
    assert state.claims[0].level == "0"
    inner = Domain((DomainSide("x", 0.1, 0.9), DomainSide("y", 0.2, 0.8)))
    assert isinstance(below_by_boxes(rules, inner, 0), Proved)


@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
def test_two_rules_conflict_at_a_level_that_both_reach(
    conjunction: Conjunction,
) -> None:
    rules = random_base(3, 2, 3, conjunction, "mixed")
    found = highest_by_boxes(rules, unit_domain(rules), 1, 2, tolerance=1e-3)
    assert 0.0 < found.low <= found.high <= found.low + 1.1e-3
    level = found.claims[0].level
    assert level is not None
    assert min(_strengths(rules, found.point)) == Fraction(level)
    for row in _rows(rules, 100):
        assert min(exact_answer(rules, row).strengths) <= found.high


def test_a_spent_budget_leaves_a_bracket() -> None:
    rules = random_base(1, 7, 4, "product", "lr")
    moments = iter(range(100))
    clock = Clock(1.0, now=lambda: float(next(moments)))
    found = largest_lead_by_boxes(
        rules, unit_domain(rules), 1, (2, 3), clock, tolerance=0.0
    )
    assert 0.0 <= found.low < found.high <= 1.0
    assert found.why == "the budget was spent: 1 box visited"


def test_a_step_at_the_lower_end_of_the_domain_is_not_missed() -> None:
    # Only at x = 0 itself the first rule is stronger.
    x = Variable(
        "x",
        (
            Term("at", Points((0.0, 0.0), (1.0, 0.2))),
            Term("behind", Points((0.0, 0.0), (0.5, 0.6))),
        ),
    )
    made = (
        Rule((Proposition("x", ("at",)),), "a"),
        Rule((Proposition("x", ("behind",)),), "b"),
    )
    rules = RuleBase("step", ("a", "b"), (x,), made, Semantics("product"))
    state = wins_by_boxes(rules, unit_domain(rules), 1, (2,))
    assert isinstance(state, Witness)
    assert state.point[0].exact == "0"
    behind = Domain((DomainSide("x", 0.0, 1.0, is_open=True),))
    assert isinstance(wins_by_boxes(rules, behind, 1, (2,)), Proved)


def test_limits_of_a_combination_limit_its_inputs_together() -> None:
    up = Term("up", Points((0.0, 1.0), (0.0, 1.0)))
    down = Term("down", Points((0.0, 1.0), (0.6, 0.0)))
    parts = (Part("x", 1.0), Part("y", 1.0))
    variables = (Variable("x", (up, down)), Variable("y"), Variable("sum", parts=parts))
    made = (
        Rule((Proposition("x", ("up",)),), "a"),
        Rule((Proposition("x", ("down",)),), "b"),
    )
    rules = RuleBase("sum", ("a", "b"), variables, made, Semantics("product"))
    sides = (DomainSide("x", 0.0, 1.0), DomainSide("y", 0.0, 1.0))
    assert isinstance(wins_by_boxes(rules, Domain(sides), 1, (2,)), Witness)
    small = Domain((*sides, DomainSide("sum", 0.0, 0.37)))
    assert isinstance(wins_by_boxes(rules, small, 1, (2,)), Proved)
    larger = Domain((*sides, DomainSide("sum", 0.375, 0.38)))
    state = wins_by_boxes(rules, larger, 1, (2,))
    assert isinstance(state, Witness)
    assert Fraction(3, 8) <= sum(point_of(state.point).values()) <= Fraction(0.38)


def test_a_rule_without_rivals_wins_where_it_fires() -> None:
    rules = _covered_by_two(0.9, "product")
    assert isinstance(wins_by_boxes(rules, unit_domain(rules), 1, ()), Witness)
    away = Domain((DomainSide("x", 0.8, 0.9), DomainSide("y", 0.0, 1.0)))
    assert isinstance(wins_by_boxes(rules, away, 1, ()), Proved)


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(24))
def test_larger_bases_are_decided_without_contradiction(seed: int) -> None:
    rules = random_base(
        seed, 7, 4, "product", "mixed", shared=0.1 * (seed % 6), odd=0.3 * (seed % 2)
    )
    answers = [exact_answer(rules, row).strengths for row in _rows(rules, 300)]
    for rule in range(1, 8):
        rivals = _rivals(rules, rule)
        state = wins_by_boxes(rules, unit_domain(rules), rule, rivals, cpu_clock(2.0))
        leads = [one[rule - 1] - max(one[n - 1] for n in rivals) for one in answers]
        if isinstance(state, Witness):
            strengths = _strengths(rules, state.point)
            assert all(strengths[rule - 1] > strengths[n - 1] for n in rivals)
        elif isinstance(state, Bracket):
            assert max(leads) <= state.high
        else:
            assert max(leads) <= 0


@pytest.mark.heavy
def test_a_rule_hidden_by_two_others_in_four_inputs_is_proved_or_found() -> None:
    rules = random_base(1, 7, 4, "product", "lr")
    for level, expected in ((0.7, Proved), (0.7 - 1e-6, Witness)):
        planted = with_hidden_rule(rules, level)
        rivals = _rivals(planted, 10)
        state = wins_by_boxes(
            planted, unit_domain(planted), 10, rivals, cpu_clock(20.0)
        )
        assert type(state) is expected


@pytest.mark.parametrize("conjunction", CONJUNCTIONS)
def test_rules_of_a_hundred_inputs_are_decided_too(
    conjunction: Conjunction,
) -> None:
    line, names = Points((0.0, 1.0), (0.0, 1.0)), [f"x{n}" for n in range(100)]
    rules = RuleBase(
        "wide",
        ("soft", "hard"),
        tuple(Variable(name, (Term("high", line),)) for name in names),
        (
            Rule(tuple(Proposition(name, ("high",)) for name in names), "soft"),
            Rule((Proposition("x0", ("high",)), Proposition("x1", ("high",))), "hard"),
        ),
        Semantics(conjunction),
    )
    box = unit_domain(rules)
    assert isinstance(wins_by_boxes(rules, box, 1, {2}, cpu_clock(1.0)), Proved)
    assert isinstance(wins_by_boxes(rules, box, 2, {1}, cpu_clock(1.0)), Witness)


def test_a_step_at_the_lower_end_of_many_inputs_is_a_bracket() -> None:
    step, names = Band(0.0, 0.5), [f"x{n}" for n in range(80)]
    rules = RuleBase(
        "wide",
        ("soft",),
        tuple(Variable(name, (Term("low", step),)) for name in names),
        (Rule(tuple(Proposition(name, ("low",)) for name in names), "soft"),),
    )
    found = wins_by_boxes(rules, unit_domain(rules), 1, set())
    assert isinstance(found, Bracket)
    assert (found.low, found.high) == (0.0, 1.0)
    assert isinstance(wins(arrange(rules, unit_domain(rules)), 1, set()), Witness)
