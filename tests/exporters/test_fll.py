"""FLL files as they are written."""

from __future__ import annotations

import math
from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.exporters.fll import write
from fuzzytree.formats.fll.fll_reader import read_fll
from fuzzytree.model import (
    Activation,
    And,
    Arc,
    Call,
    Concave,
    Conclusion,
    Condition,
    Curve,
    Defuzzifier,
    Formula,
    FuzzySystem,
    Linear,
    Name,
    Not,
    Number,
    Or,
    Proposition,
    RuleBlock,
    SCurve,
    Sigmoid,
    Singleton,
    SNorm,
    SystemOutput,
    SystemRule,
    Term,
    TNorm,
    Trapezoid,
    Variable,
)
from fuzzytree.model.rulebase import LR, Part, Points, RuleBase, Side
from fuzzytree.semantics import FACTS, Scores, as_system, canonical_form, pointed
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_rows, random_tree
from tests.exporters.fll_systems import plain_system

TANK = FuzzySystem(
    "tank",
    (
        Variable(
            "water level",
            (
                Term("low", Trapezoid(None, 0.0, 1.0, 2.5)),
                Term("high", Arc(0.1, 3.0)),
            ),
            low=0.0,
            high=3.0,
            clips=True,
            unit="m",
        ),
        Variable("is", (Term("big", Sigmoid(1e-7, 2.0), 0.5),)),
    ),
    (
        SystemOutput(
            "valve",
            (Term("shut", Trapezoid(0.0, 0.0, 0.2, 0.2)),),
            0.0,
            1.0,
            Defuzzifier("bisector", 50),
            "maximum",
            0.5,
        ),
        SystemOutput(
            "rate",
            (
                Term("none", Singleton(0.0)),
                Term("some", Linear((0.5, 1.0 / 3.0), -1.0)),
                Term(
                    "most",
                    Formula(Call("negate", (Call("+", (Name("x"), Number(2.0))),))),
                ),
            ),
            None,
            None,
            Defuzzifier("weighted sum"),
        ),
    ),
    (
        RuleBlock(
            (
                SystemRule(
                    And(
                        (
                            Or(
                                (
                                    Proposition("water level", ("low",)),
                                    Proposition("is", ("big",), ("very",)),
                                )
                            ),
                            Not(Proposition("water level", ("high",))),
                        )
                    ),
                    (Conclusion("valve", "shut"), Conclusion("rate", "some", ("not",))),
                    0.1 + 0.2,
                ),
                SystemRule(None, (Conclusion("rate", "none"),)),
            ),
            "minimum",
            "algebraic sum",
            "product",
            Activation("first", 2, 0.25),
            "all",
        ),
    ),
    "A tank.\nSee #3.",
)

WRITTEN = """\
# Written by fuzzytree.
Engine: tank
  description: A tank. See no.3.
InputVariable: water_level
  enabled: true
  range: 0.0 3.0
  lock-range: true
  term: low Trapezoid -inf 0.0 1.0 2.5
  term: high Arc 0.1 3.0
InputVariable: is_
  enabled: true
  range: -inf inf
  lock-range: false
  term: big Sigmoid 1e-07 2.0 0.5
OutputVariable: valve
  enabled: true
  range: 0.0 1.0
  lock-range: false
  aggregation: Maximum
  defuzzifier: Bisector 50
  default: 0.5
  lock-previous: false
  term: shut Rectangle 0.0 0.2
OutputVariable: rate
  enabled: true
  range: -inf inf
  lock-range: false
  aggregation: none
  defuzzifier: WeightedSum TakagiSugeno
  default: nan
  lock-previous: false
  term: none Constant 0.0
  term: some Linear 0.5 0.3333333333333333 -1.0
  term: most Function ~(x + 2.0)
RuleBlock: all
  enabled: true
  conjunction: Minimum
  disjunction: AlgebraicSum
  implication: AlgebraicProduct
  activation: First 2 0.25
  rule: if (water_level is low or is_ is very big) and water_level is not high then \
valve is shut and rate is not some with 0.30000000000000004
  rule: if water_level is any then rate is none
"""


def test_a_system_is_written_word_by_word() -> None:
    written = write(TANK)
    assert written.content.decode() == WRITTEN
    assert written.losses == ()
    assert written.remarks == (
        "NOT is written as the hedge 'not', with the same numbers",
        "names were changed: 'water level' is water_level, 'is' is is_",
        "names of the system and of blocks, and its note, became single lines",
        "units have no place: of 'water level'",
        "fuzzylite evaluates a row with a missing or infinite value by the rules that "
        "do not test it",
        "a rule of degree 0 concludes nothing, as in fuzzylite 6; in pyfuzzylite 'any' "
        "and 'not' in a conclusion make 1 of 0",
        "Bisector is one of the values that are looked at, as in pyfuzzylite; "
        "fuzzylite 6 takes one between them",
        "where conclusions have no area the default answers, as in pyfuzzylite; "
        "fuzzylite 6 answers NaN",
        "fuzzylite 6 does not know Arc and SemiEllipse; pyfuzzylite does",
    )


def test_a_system_that_is_read_is_written_as_the_same_bytes() -> None:
    model = read_fll(WRITTEN.encode(), "tank.fll").model
    assert isinstance(model, FuzzySystem)
    again = write(model)
    assert again.content == write(TANK).content


@pytest.mark.one_in(3)
@pytest.mark.parametrize("scores", get_args(Scores))
@given(seed=st.integers(0, 10**6), kind=st.sampled_from(["relative", "raw"]))
@settings(max_examples=15, deadline=None)
def test_reading_written_rules_gives_the_equal_rules(
    scores: Scores, seed: int, kind: str
) -> None:
    tree = random_tree(seed, leaves=4, combinations=0.5)
    made = rules_from_tree(tree, "raw" if kind == "raw" else "relative")
    rules, _ = pointed(replace(made, kind=None), 1e-3)
    written = write(rules, scores=scores, allow_loss=True)
    assert read_fll(written.content, "r.fll").model == rules


@pytest.mark.parametrize("scores", get_args(Scores))
def test_without_its_comment_a_file_of_rules_is_their_system(scores: Scores) -> None:
    rules, _ = pointed(rules_from_tree(random_tree(3, combinations=0.0)), 1e-3)
    written = write(rules, scores=scores)
    lines = written.content.decode().splitlines()
    bare = "\n".join(line for line in lines if FACTS not in line)
    model = read_fll(bare.encode(), "r.fll").model
    assert isinstance(model, FuzzySystem)
    assert canonical_form(model) == canonical_form(as_system(rules, scores))


def test_the_file_of_a_changed_comment_is_the_system_that_it_says() -> None:
    rules, _ = pointed(rules_from_tree(random_tree(3, combinations=0.0)), 1e-3)
    text = write(rules).content.decode()
    changed = text.replace("activation: Highest 1", "activation: General")
    assert isinstance(read_fll(text.encode(), "r.fll").model, RuleBase)
    assert isinstance(read_fll(changed.encode(), "r.fll").model, FuzzySystem)


SIDE = Side(1.0, (0.5,))


def test_what_is_lost_is_listed_and_refused() -> None:
    system = replace(
        TANK,
        variables=(
            Variable("a", (Term("low", LR(0.0, SIDE, SIDE)),)),
            Variable("b", parts=(Part("a", 2.0, 0.5),)),
        ),
        outputs=(
            SystemOutput(
                "y",
                (Term("t", Trapezoid(0.0, 1.0, 1.0, 2.0)),),
                0.0,
                2.0,
                Defuzzifier("centroid", 101, "ends"),
                "maximum",
            ),
        ),
        blocks=(
            RuleBlock(
                (
                    SystemRule(
                        Proposition("a", ("low",), ("cubed",)), (Conclusion("y", "t"),)
                    ),
                ),
                implication="minimum",
            ),
        ),
    )
    with pytest.raises(LossError) as error:
        write(system, tolerance=0.01)
    assert str(error.value).splitlines() == [
        "cannot write tank as fll without loss:",
        "  term 'low' of 'a': it becomes 11 points joined by lines (largest "
        "error 0.0083)",
        "  combination 'b': it is an input, to be given as 2.0 * ('a' - 0.5)",
        "  output 'y': its curve is sampled at 101 values (ends), and FLL knows only "
        "101 (middle)",
        "  rule 1: FLL has no 'cubed': left out",
        "  pass allow_loss=True to write it as stated",
    ]
    written = write(system, tolerance=0.01, allow_loss=True)
    assert len(written.losses) == 4
    bound = written.losses[0].bound
    assert bound is not None
    assert 0.0 < bound <= 0.01


def test_words_are_reserved_in_small_letters_only() -> None:
    inputs = tuple(Variable(name) for name in ("X", "Min", "and", "très", "tres"))
    rule = SystemRule(None, (Conclusion("valve", "shut"),))
    blocks = (replace(TANK.blocks[0], rules=(rule,)),)
    system = replace(TANK, variables=inputs, blocks=blocks, outputs=TANK.outputs[:1])
    lines = write(system).content.decode().splitlines()
    names = [line.split(": ")[1] for line in lines if line.startswith("InputV")]
    assert names == ["X", "Min", "and_", "tres_2", "tres"]


NEVER: list[tuple[Condition, TNorm, SNorm]] = [
    (
        Not(And((Proposition("is", ("big",)), Proposition("is", ("big",))))),
        "product",
        "maximum",
    ),
    (
        And(
            (
                Not(Or((Proposition("is", ("big",)), Proposition("is", ("big",))))),
                Proposition("is", ("big",)),
            )
        ),
        "product",
        "maximum",
    ),
    (
        Or(
            (
                Not(And((Proposition("is", ("big",)), Proposition("is", ("big",))))),
                Proposition("is", ("big",)),
            )
        ),
        "minimum",
        "sum",
    ),
]


@pytest.mark.parametrize(("when", "conjunction", "disjunction"), NEVER)
def test_a_not_that_has_no_words_is_refused_for_good(
    when: Condition, conjunction: TNorm, disjunction: SNorm
) -> None:
    rule = SystemRule(when, (Conclusion("rate", "none"),))
    block = RuleBlock((rule,), conjunction, disjunction)
    with pytest.raises(LossError, match="rule 1 has a NOT of several conditions"):
        write(replace(TANK, blocks=(block,)), allow_loss=True)


def test_a_not_of_several_conditions_moves_to_each_under_minimum_and_maximum() -> None:
    low, big, high = (
        Proposition("water level", ("low",)),
        Proposition("is", ("big",)),
        Proposition("water level", ("high",)),
    )
    when = Not(
        Or((And((low, big)), Not(Not(And((high, Proposition("is", (), ("any",))))))))
    )
    rule = SystemRule(when, (Conclusion("rate", "none"),))
    system = replace(TANK, blocks=(RuleBlock((rule,), implication="minimum"),))
    model = read_fll(write(system).content, "t.fll").model
    assert isinstance(model, FuzzySystem)
    for level in (0.05, 0.4, 1.3, 2.0, 2.9):
        for x in (-2.0, 0.3, 0.9):
            ours = infer(system, {"water level": level, "is": x})
            theirs = infer(model, {"water_level": level, "is_": x})
            assert theirs.strengths == ours.strengths


STEPS = Points((0.0, 1.0, 1.0, 2.0, 2.0), (0.0, 0.5, 1.0, 1.0, 0.0))


def test_the_second_point_of_a_step_stands_one_double_higher() -> None:
    rule = SystemRule(
        Proposition("water level", ("low",)), (Conclusion("rate", "none"),)
    )
    system = replace(
        TANK,
        variables=(
            Variable("water level", (Term("low", STEPS),)),
            TANK.variables[1],
        ),
        blocks=(RuleBlock((rule,)),),
    )
    text = write(system).content.decode()
    points = "0.0 0.0 1.0 0.5 1.0000000000000002 1.0 2.0 1.0 2.0000000000000004 0.0"
    assert f"term: low Discrete {points}\n" in text
    model = read_fll(text.encode(), "s.fll").model
    assert isinstance(model, FuzzySystem)
    assert model.variables[0].terms[0].function == STEPS


MIXED: list[Curve] = [
    Points((1.0, 3.0), (0.0, 1.0)),
    Points((1.0, 3.0), (1.0, 0.0)),
    Sigmoid(1.0, -2.0),
    SCurve(1.0, 3.0),
    SCurve(3.0, 1.0),
    Concave(1.0, 2.0),
    Concave(2.0, 1.0),
    Arc(1.0, 3.0),
    Arc(3.0, 1.0),
]


@pytest.mark.one_in(3)
@pytest.mark.parametrize("curve", MIXED)
@pytest.mark.parametrize("height", [1.0, 0.75])
@pytest.mark.parametrize("is_mixed", [False, True])
def test_where_a_term_has_a_degree_is_kept_among_numbers_too(
    curve: Curve, height: float, is_mixed: bool
) -> None:
    labels = (Term("t", curve, height), Term("n", Singleton(1.0)))
    output = replace(TANK.outputs[1], terms=labels if is_mixed else labels[:1])
    ramp = Term("up", Points((0.0, 4.0), (0.0, 1.0)))
    rule = SystemRule(Proposition("a", ("up",)), (Conclusion("rate", "t"),))
    system = FuzzySystem(
        "s", (Variable("a", (ramp,)),), (output,), (RuleBlock((rule,)),)
    )
    written = write(system)
    kind = "TakagiSugeno" if is_mixed else "Tsukamoto"
    assert f"WeightedSum {kind}\n" in written.content.decode()
    model = read_fll(written.content, "s.fll").model
    assert isinstance(model, FuzzySystem)
    for value in (0.5, 1.0, 2.0, 2.5, 4.0):
        (ours,) = infer(system, {"a": value}).outputs
        (theirs,) = infer(model, {"a": value}).outputs
        assert math.isfinite(ours) or value == 4.0  # no term is as high as that
        assert theirs == pytest.approx(ours, rel=1e-14, nan_ok=True)


def test_bands_and_lr_sets_as_numbers_become_points_of_their_own() -> None:
    shape = LR(0.5, Side(0.25, (1.0,)), Side(0.25, (1.0,)))
    output = replace(TANK.outputs[1], terms=(Term("t", shape),))
    rule = SystemRule(Proposition("is", ("big",)), (Conclusion("rate", "t"),))
    system = replace(TANK, outputs=(output,), blocks=(RuleBlock((rule,)),))
    written = write(system, allow_loss=True)
    assert [loss.where for loss in written.losses] == ["term 't' of 'rate'"]


@pytest.mark.one_in(4)
@pytest.mark.parametrize("seed", range(60))
def test_a_random_system_without_losses_answers_alike_when_it_is_read(
    seed: int,
) -> None:
    system = plain_system(seed)
    written = write(system)
    assert written.losses == ()
    model = read_fll(written.content, "r.fll").model
    assert isinstance(model, FuzzySystem)
    for row in random_rows(system, seed, 5):
        given = dict(zip(model.inputs, row.values(), strict=True))
        ours, theirs = infer(system, row), infer(model, given)
        assert theirs.strengths == ours.strengths
        assert theirs.outputs == pytest.approx(ours.outputs, rel=1e-11, nan_ok=True)
