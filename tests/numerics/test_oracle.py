"""Deciding many rows: equal to one row at a time, and what the filter may not do."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
import pytest

from fuzzytree.model.contracts import Model
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Conjunction,
    Kind,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Shape,
    Side,
    Term,
    Variable,
)
from fuzzytree.numerics import enclosures
from fuzzytree.numerics.enclosures import LEAST, EnclosedValue, degree_enclosure
from fuzzytree.numerics.exact import exact_degree
from fuzzytree.numerics.oracle import (
    DECIDED,
    MISSING,
    TIE,
    UNCOVERED,
    Decisions,
    decide,
    exact_answer,
    strength_errors,
)
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import landmarks, neighbours, probes
from fuzzytree.testing import random_tree, with_points

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

LOW = Term("low", Band(high=1.0, right=4.0))


def values_of(model: Model, limit: int = 200) -> FloatArray:
    rows = probes(model, limit=limit)
    return np.array([[row[name] for row in rows] for name in model.inputs])


def made(seed: int, kind: Kind, conjunction: Conjunction) -> RuleBase:
    tree = random_tree(seed, leaves=2 + seed % 9, inputs=3)
    rules = rules_from_tree(tree, kind, conjunction=conjunction)
    return with_points(rules, seed) if seed % 3 == 0 else rules


def faults(model: Model, values: FloatArray, found: Decisions) -> list[str]:
    """Return where answers to many rows are not those to one row at a time."""
    wrong: list[str] = []
    for row, column in enumerate(values.T.tolist()):
        exact = exact_answer(model, dict(zip(model.inputs, column, strict=True)))
        label = -1 if exact.label is None else model.classes.index(exact.label)
        if (exact.rule, exact.status) != (found.rule[row], found.status[row]):
            wrong.append(f"row {row}: rule {found.rule[row]}, not {exact.rule}")
        if label != found.label[row]:
            wrong.append(f"row {row}: label {found.label[row]}, not {label}")
        if not found.margin[row] <= exact.margin <= found.margin_high[row]:
            wrong.append(f"row {row}: a margin of {float(exact.margin)!r}")
        if found.strengths is not None:
            pairs = zip(found.strengths[:, row].tolist(), exact.strengths, strict=False)
            gaps = [abs(Fraction(given) - right) for given, right in pairs]
            if exact.strengths and max(gaps) > found.doubt[row]:
                wrong.append(f"row {row}: strengths off by {float(max(gaps))!r}")
    return wrong


@pytest.mark.one_in(8)
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("kind", ["relative", "raw"])
@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_many_rows_are_decided_as_one_at_a_time(
    seed: int, kind: Kind, conjunction: Conjunction
) -> None:
    rules = made(seed, kind, conjunction)
    values = values_of(rules)
    assert faults(rules, values, decide(rules, values)) == []


@pytest.mark.parametrize("seed", range(12))
def test_a_tree_is_decided_as_one_row_at_a_time(seed: int) -> None:
    tree = random_tree(seed, leaves=2 + seed % 9, inputs=3, combinations=0.6)
    values = values_of(tree)
    assert faults(tree, values, decide(tree, values)) == []


@pytest.mark.parametrize("seed", range(6))
def test_relative_rules_are_their_tree_in_exact_arithmetic(seed: int) -> None:
    tree = random_tree(seed, leaves=9, inputs=3, combinations=0.6)
    values = values_of(tree)
    rules = decide(rules_from_tree(tree), values)
    assert rules.rule.tolist() == decide(tree, values).rule.tolist()
    assert not (rules.status == TIE).any()


def test_a_tie_that_shares_its_weakest_proposition_needs_no_fractions() -> None:
    # Both rules are as strong as `x is low`, a third; the other propositions hold
    # fully.
    wide = Term("wide", Band(high=9.0))
    variables = (Variable("x", (LOW,)), Variable("y", (wide, Term("all", Band()))))
    shared = Proposition("x", ("low",))
    rules = RuleBase(
        "tie",
        ("a", "b"),
        variables,
        tuple(
            Rule((shared, Proposition("y", (name,))), label)
            for name, label in (("wide", "a"), ("all", "b"))
        ),
    )
    found = decide(rules, np.array([[3.0], [0.0]]))
    assert (found.rule[0], found.status[0], found.by_fractions) == (1, TIE, 0)
    assert (found.margin[0], found.margin_high[0]) == (0.0, 0.0)


def test_a_tie_of_different_curves_is_settled_by_fractions() -> None:
    # (4 - 2) / 3 and (3 - 1) / 3: both 2/3, by roundings of their own.
    other = Term("other", Band(high=0.0, right=3.0))
    variables = (Variable("x", (LOW,)), Variable("y", (other,)))
    rules = RuleBase(
        "tie",
        ("a", "b"),
        variables,
        (
            Rule((Proposition("x", ("low",)),), "a"),
            Rule((Proposition("y", ("other",)),), "b"),
        ),
    )
    above = math.nextafter(1.0, 2.0)
    found = decide(rules, np.array([[2.0, 2.0, 2.0], [1.0, above, 0.5]]))
    assert found.rule.tolist() == [1, 1, 2]
    assert found.status.tolist() == [TIE, DECIDED, DECIDED]
    assert found.by_fractions == 2
    assert found.margin.tolist()[:2] == pytest.approx(
        [0.0, 2.0**-52 / 3], rel=1e-9, abs=0.0
    )


def test_one_wins_by_less_than_doubles_can_tell() -> None:
    # 1/3 against 1/3 + 2**-80 / 3, far below the spacing of doubles there.
    near = Band(high=1.0, right=4.0)
    far = Band(high=2.0**80, right=2.0**82)  # not reached: one more
    ends = Term("near", near), Term("far", far)
    row = np.array([[3.0], [math.nextafter(3.0 * 2.0**80, 0.0)]])
    rules = RuleBase(
        "close",
        ("a", "b"),
        (Variable("x", ends[:1]), Variable("y", ends[1:])),
        (
            Rule((Proposition("x", ("near",)),), "a"),
            Rule((Proposition("y", ("far",)),), "b"),
        ),
    )
    found = decide(rules, row)
    # y is 2**29 below 3 * 2**80, and its flank is 3 * 2**80 wide.
    assert found.rule[0] == 2
    assert found.margin[0] == pytest.approx(2.0**-51 / 3, rel=1e-12, abs=0.0)


def test_cover_is_decided_at_the_very_end_of_a_support() -> None:
    shape = LR(0.0, Side(1.0, (0.4,)), Side(1.0, (0.4,)))
    rules = RuleBase(
        "end",
        ("a",),
        (Variable("x", (Term("t", shape),)),),
        (Rule((Proposition("x", ("t",)),), "a"),),
    )
    rows = [math.nextafter(5.0, 0.0), 5.0, math.nextafter(5.0, 6.0)]
    found = decide(rules, np.array([rows]))
    assert found.status.tolist() == [DECIDED, UNCOVERED, UNCOVERED]


def test_policies_answer_where_nothing_is_weighed() -> None:
    rules = RuleBase(
        "end",
        ("a", "b", "c"),
        (Variable("x", (LOW,)),),
        (Rule((Proposition("x", ("low",)),), "a"),),
        Semantics(uncovered="b", missing="c"),
    )
    found = decide(rules, np.array([[0.0, 5.0, math.nan, -math.inf]]))
    assert found.label.tolist() == [0, 1, 2, 2]
    assert found.status.tolist() == [DECIDED, UNCOVERED, MISSING, MISSING]
    assert found.margin.tolist() == [1.0, 0.0, 1.0, 1.0]


def test_no_rows_give_no_answers() -> None:
    rules = made(1, "raw", "minimum")
    found = decide(rules, np.empty((len(rules.inputs), 0)))
    assert found.rule.shape == (0,)
    assert found.strengths is not None
    assert found.strengths.shape == (len(rules.rules), 0)


def test_chunks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rules = made(4, "raw", "product")
    values = values_of(rules)
    whole = decide(rules, values)
    monkeypatch.setattr("fuzzytree.numerics.oracle._NUMBERS", 1)
    monkeypatch.setattr("fuzzytree.numerics.oracle._FEWEST", 7)
    parts = decide(rules, values)
    assert parts.rule.tolist() == whole.rule.tolist()
    assert parts.margin.tolist() == whole.margin.tolist()
    assert parts.by_fractions == whole.by_fractions


@pytest.mark.parametrize("shape", [(2, 3), (3,), (3, 2, 1)])
def test_values_of_another_shape_are_refused(shape: tuple[int, ...]) -> None:
    tree = random_tree(0, inputs=3, combinations=1)
    sizes = ", ".join(map(str, shape)) + ("," if len(shape) == 1 else "")
    text = rf"^values must have shape \(3, rows\), not \({sizes}\)$"
    with pytest.raises(ValueError, match=text):
        decide(tree, np.zeros(shape))


# --- the filter


def shapes_of(seed: int) -> list[Shape]:
    """Return the shapes of some models made from a seed, and points among them."""
    models = (made(seed, "relative", "minimum"), made(seed, "raw", "minimum"))
    return [t.shape for rules in models for v in rules.variables for t in v.terms]


SHAPES: list[Shape] = [
    *itertools.chain.from_iterable(map(shapes_of, range(6))),
    Band(high=1.0, right=4.0),
    Band(high=0.0, right=2e-323),
    LR(0.0, Side(1e-310, (0.5,)), Side(1e307, (0.5,), 1.0 + 2.0**-50)),
    LR(1e308, Side(1e308, (0.5, 0.1)), Side(1.0, (1e6, -1e6))),
    Points((-1e300, 0.0, 0.0, 1e-320, 1e300), (0.0, 1.0, 0.5, 0.7, 0.1)),
    # slopes that are 0 in doubles, and values off by more than such a slope is small
    Band(low=-1e289, left=-2e289),
    Points((0.0, 1e308), (0.0, 1e-20)),
]


def holes(shape: Shape, *, slack: float = 0.0) -> int:
    """Count values whose exact degree lies outside of its interval."""
    marks = [near for value in landmarks(shape) for near in neighbours(value)]
    marks += [0.0, 1e308, -1e308, 5e-324, 0.3, *np.linspace(-3.0, 3.0, 13).tolist()]
    x = np.array(marks)
    off = np.maximum(np.abs(x) * slack, LEAST) if slack else None
    low, high = degree_enclosure(shape, EnclosedValue(x, off))
    count = 0
    for moved in (-1.0, 0.7, 1.0) if off is not None else (0.0,):
        for row, value in enumerate(marks):
            shift = Fraction(float(off[row])) if off is not None else Fraction(0)
            exact = exact_degree(shape, Fraction(value) + Fraction(moved) * shift)
            count += not low[row] <= exact <= high[row]
    return count


@pytest.mark.one_in(4)
@pytest.mark.parametrize("shape", SHAPES)
def test_an_interval_holds_the_exact_degree(shape: Shape) -> None:
    assert holes(shape) == 0


@pytest.mark.one_in(2)
@pytest.mark.parametrize("slack", [1e-15, 1e-3])
def test_an_interval_holds_the_degree_of_every_value_within_the_slack(
    slack: float,
) -> None:
    assert [holes(shape, slack=slack) for shape in SHAPES] == [0] * len(SHAPES)


def test_intervals_are_narrow_and_exact_where_doubles_are() -> None:
    x = np.array([0.5, 1.0, 2.0, 4.0, 5.0])
    low, high = degree_enclosure(LOW.shape, EnclosedValue(x, None))
    assert (high - low).tolist()[0::3] == [0.0, 0.0]
    assert 0 < (high - low)[2] < 16 * 2.0**-53


def test_a_filter_that_forgets_its_roundings_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(enclosures, "U", 0.0)
    assert sum(holes(shape) for shape in SHAPES) > 100


def test_a_filter_that_forgets_the_slack_of_combinations_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    right = enclosures.axis_value

    def forgetful(variable: Variable, values: dict[str, FloatArray]) -> EnclosedValue:
        return EnclosedValue(right(variable, values).x, None)

    monkeypatch.setattr("fuzzytree.numerics.oracle.axis_value", forgetful)
    found = 0
    for seed in range(8):
        rules = made(seed, "relative", "minimum")
        values = values_of(rules)
        found += len(faults(rules, values, decide(rules, values)))
    assert found > 10


def test_a_filter_that_takes_an_edge_for_the_plateau_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    right = enclosures._band

    def careless(band: Band, value: EnclosedValue) -> enclosures.Enclosure:
        low = None if band.low is None else math.nextafter(band.low, -math.inf)
        return right(Band(low, band.high, band.left, band.right), value)

    monkeypatch.setattr(enclosures, "_band", careless)
    assert sum(holes(shape) for shape in SHAPES) > 0


# --- errors of what others computed


def test_errors_are_bracketed_and_the_largest_is_known_closely() -> None:
    rules = made(1, "raw", "product")
    values = values_of(rules)
    right = decide(rules, values).strengths
    assert right is not None
    given = np.where(right > 0.5, right - 1e-6, right)
    low, high = strength_errors(rules, values, given)
    assert (low <= high).all()
    assert low.max() == pytest.approx(1e-6, rel=1e-2)
    assert high.max() <= 1.01 * low.max()


def test_a_missing_row_on_one_side_alone_is_one_off() -> None:
    rules = RuleBase(
        "one",
        ("a",),
        (Variable("x", (LOW,)),),
        (Rule((Proposition("x", ("low",)),), "a"),),
    )
    values = np.array([[0.0, math.nan, math.nan, 0.0]])
    given = np.array([[1.0, math.nan, 1.0, math.nan]])
    low, high = strength_errors(rules, values, given)
    assert low.tolist() == high.tolist() == [0.0, 0.0, 1.0, 1.0]


def test_strengths_of_another_shape_are_refused() -> None:
    rules = made(1, "raw", "minimum")
    values = np.zeros((len(rules.inputs), 2))
    text = rf"^strengths must have shape \({len(rules.rules)}, 2\), not \(1, 2\)$"
    with pytest.raises(ValueError, match=text):
        strength_errors(rules, values, np.zeros((1, 2)))


@pytest.mark.parametrize("seed", range(6))
def test_the_reference_is_right_to_its_last_digits(seed: int) -> None:
    rules = rules_from_tree(random_tree(seed, combinations=0), "raw")
    values = values_of(rules, 120)
    found = find_runtime("reference").load(rules)(values).strengths
    assert found is not None
    assert strength_errors(rules, values, found)[1].max() < 1e-14


def test_a_part_of_a_combination_is_not_lost_beside_larger_ones() -> None:
    parts = (Part("a", 1.0), Part("b", 1.0), Part("c", 1.0))
    rules = RuleBase(
        "mix",
        ("a",),
        (*map(Variable, "abc"), Variable("mix", (LOW,), parts=parts)),
        (Rule((Proposition("mix", ("low",)),), "a"),),
    )
    # 2**60 + 2 - 2**60 is 0 in doubles and 2 in fact: a degree of 2/3, not of 1.
    found = decide(rules, np.array([[2.0**60], [2.0], [-(2.0**60)]]))
    assert found.strengths is not None
    assert (found.strengths[0, 0], found.by_fractions) == (2 / 3, 1)


@pytest.mark.heavy
@pytest.mark.parametrize("kind", ["relative", "raw"])
@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_many_rows_of_many_models_are_decided_as_one_at_a_time(
    kind: Kind, conjunction: Conjunction
) -> None:
    for seed in range(100, 130):
        rules = made(seed, kind, conjunction)
        values = values_of(rules, 300)
        assert faults(rules, values, decide(rules, values)) == []
