"""FIS: written files are read back alike, and every loss is reported."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from typing import get_args

import pytest
from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.exporters.fis import write
from fuzzytree.exporters.fis_terms import term_of
from fuzzytree.exporters.table import find_format
from fuzzytree.formats.fis.fis_reader import DEFAULTS, always_concluded, read_fis
from fuzzytree.formats.fis.fis_words import (
    CONCLUDING_HEDGES,
    DIALECTS,
    FIS_HEDGES,
    Dialect,
)
from fuzzytree.model import (
    And,
    Bell,
    Binary,
    Conclusion,
    Condition,
    Curve,
    Defuzzifier,
    FuzzySystem,
    Gaussian,
    Hedge,
    Linear,
    Not,
    Or,
    PiCurve,
    Proposition,
    RuleBlock,
    SCurve,
    Sigmoid,
    SigmoidProduct,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    TNorm,
    Trapezoid,
    TwoGaussians,
    Variable,
)
from fuzzytree.model.contracts import Written
from fuzzytree.model.rulebase import Points, RuleBase
from fuzzytree.semantics import as_system, canonical_form, flattened, pointed
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import evaluate
from fuzzytree.testing import probes, random_tree


def random_curve(chance: random.Random) -> Curve:
    a, b, c, d = sorted(chance.uniform(-5.0, 5.0) for _ in range(4))
    curves: Sequence[Curve] = (
        Trapezoid(a, b, c, d),
        Trapezoid(a, b, b, d),
        Trapezoid(b, b, c, c),
        Trapezoid(None, b, b, c),
        Trapezoid(a, b, b, None),
        Trapezoid(a, b, c, c),
        Points((a, b, b, d), (0.0, 0.25, 1.0, 0.5)),
        Points((a, b), (0.0, 1.0)),
        Points((a, b, c), (1.0, 0.0, 0.5)),
        Gaussian(a, d - a),
        TwoGaussians(a, 1.5, c, 0.25),
        Bell(b, 1.25, 2.0),
        Sigmoid(c, -2.5),
        SigmoidProduct(Sigmoid(a, 2.0), Sigmoid(d, -3.0)),
        SCurve(a, b),
        SCurve(d, c),
        PiCurve(a, b, c, d),
        Singleton(c),
        Binary(b),
        Binary(b, is_above=False),
    )
    return chance.choice(curves)


def random_fis(seed: int, dialect: Dialect) -> FuzzySystem:
    """Return a system that FIS can hold."""
    chance = random.Random(seed)
    is_weighted = chance.random() < 0.5
    inputs = tuple(
        Variable(
            f"x{k}",
            tuple(Term(f"t{n}", random_curve(chance)) for n in range(3)),
            low=-5.0,
            high=5.0,
        )
        for k in range(3)
    )
    how = Defuzzifier("weighted average") if is_weighted else DEFAULTS[dialect]
    numbers: tuple[Curve, ...] = (
        Singleton(0.1),
        Linear((1.0, -2.0, 0.3), 1e-9),
        Singleton(1e-300),
    )
    outputs = tuple(
        SystemOutput(
            f"y{k}",
            tuple(
                Term(f"t{n}", numbers[n] if is_weighted else _wide_curve(chance))
                for n in range(3)
            ),
            -5.0,
            5.0,
            how,
            None if is_weighted else "maximum",
        )
        for k in range(2)
    )
    rules = tuple(_random_rule(chance, dialect, is_weighted) for _ in range(6))
    if dialect == "matlab":  # there the middle of the range answers
        always = always_concluded(rules)
        outputs = tuple(
            one if one.name in always else replace(one, default=0.0) for one in outputs
        )
    norms: tuple[TNorm, TNorm] = ("minimum", "product")
    implication = None if is_weighted else chance.choice(norms)
    block = RuleBlock(rules, chance.choice(norms), "maximum", implication)
    return FuzzySystem("s", inputs, outputs, (block,))


def _wide_curve(chance: random.Random) -> Curve:
    curve = random_curve(chance)
    return Gaussian(curve.value, 1.0) if isinstance(curve, Singleton) else curve


def _random_rule(
    chance: random.Random, dialect: Dialect, is_weighted: bool
) -> SystemRule:
    def hedges(known: Sequence[tuple[Hedge, ...]]) -> tuple[Hedge, ...]:
        first: Sequence[tuple[Hedge, ...]] = ((), ("not",))
        return (*chance.choice(first), *chance.choice(known))

    known = [*FIS_HEDGES[dialect].values()]

    def question(name: str) -> Proposition:
        found = hedges(known)
        is_any = found[-1:] == ("any",)  # which tests no term
        return Proposition(name, () if is_any else (f"t{chance.randrange(3)}",), found)

    parts = [question(f"x{k}") for k in range(3) if chance.random() < 0.7]
    parts = parts or [Proposition("x0", ("t0",))]
    kind = chance.choice((And, Or))
    when: Condition = kind(tuple(parts)) if len(parts) > 1 else parts[0]
    concluded: Sequence[tuple[Hedge, ...]] = [()]
    if dialect == "octave" and is_weighted:
        concluded = [*CONCLUDING_HEDGES.values()]
    if dialect == "fuzzylite":
        concluded = [one for one in known if one != ("any",)]
    then = (
        Conclusion(
            f"y{chance.randrange(2)}",
            f"t{chance.randrange(3)}",
            chance.choice(concluded),
        ),
    )
    return SystemRule(when, then, chance.choice((1.0, 0.3)))


def test_any_tests_no_term_in_fuzzylite_which_would_not_load_the_rule() -> None:
    system = random_fis(2, "fuzzylite")
    question = Proposition("x0", ("t1",), ("not", "any"))
    then = (Conclusion("y0", "t0"),)
    block = replace(system.blocks[0], rules=(SystemRule(question, then),))
    text = write(replace(system, blocks=(block,)), dialect="fuzzylite").content.decode()
    assert text.partition("[Rules]\n")[2].startswith("-0.99 0 0, 1 0 (1.0) : 1\n")
    rule = "1 1 1, 1 1 (1.0) : 1\n"
    text = text.replace("-0.99", "-2.99").replace("NumRules=1", "NumRules=2") + rule
    found = read_fis(text.encode(), "s.fis")
    assert [(loss.where, loss.what) for loss in found.losses] == [
        (
            "rule 1",
            "it uses 'any' (.99) with a term, which fuzzylite does not load; left out",
        )
    ]


@pytest.mark.one_in(4)
@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("seed", range(25))
def test_a_system_is_read_back_alike(seed: int, dialect: Dialect) -> None:
    system = random_fis(seed, dialect)
    written = write(system, dialect=dialect)
    assert written.losses == ()
    found = read_fis(written.content, "s.fis")
    assert found.losses == ()
    assert canonical_form(found.model) == canonical_form(system)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("kind", ["relative", "raw"])
def test_rules_of_points_are_read_back_equal_where_no_input_is_tested_twice(
    seed: int, kind: str
) -> None:
    tree = random_tree(seed, leaves=3, combinations=0.0)
    rules, _ = pointed(rules_from_tree(tree, kind), 1e-3)  # type: ignore[arg-type]
    written = write(rules, allow_loss=True)
    if not written.losses:
        assert read_fis(written.content, "r.fis").model == rules


@pytest.mark.one_in(8)
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", ["relative", "raw"])
def test_scores_read_back_are_within_the_bounds_of_the_losses(
    seed: int, kind: str
) -> None:
    rules = rules_from_tree(random_tree(seed, combinations=0.0), kind)  # type: ignore[arg-type]
    written = write(rules, allow_loss=True, tolerance=1e-4)
    bounds = [loss.bound for loss in written.losses if loss.bound is not None]
    again = read_fis(written.content, "r.fis").model
    system = as_system(again) if isinstance(again, RuleBase) else again
    assert isinstance(system, FuzzySystem)
    for row in probes(rules, limit=60):
        if not all(map(math.isfinite, row.values())):
            continue
        renamed = {
            new: row[old]
            for new, old in zip(
                system.inputs, (v.name for v in rules.variables), strict=True
            )
        }
        expected = evaluate(rules, row)
        scores = infer(system, renamed).outputs
        for score, strength in zip(scores, expected.strengths, strict=True):
            meant = strength / (1.0 + strength)
            assert abs(score - meant) <= 2.0 * max(bounds, default=0.0) + 1e-15
        if kind == "relative":
            assert scores.index(max(scores)) + 1 == expected.rule


def test_every_line_of_a_small_file() -> None:
    low = Term("low", Trapezoid(0.0, 1.0, 1.0, 2.5))
    system = FuzzySystem(
        "tip %1",
        (Variable("food", (low,), low=0.0, high=10.0),),
        (
            SystemOutput(
                "tip",
                (Term("small", Singleton(0.1)),),
                0.0,
                30.0,
                Defuzzifier("weighted average"),
            ),
        ),
        (
            RuleBlock(
                (
                    SystemRule(
                        Proposition("food", ("low",), ("not", "very")), (_small(),), 0.5
                    ),
                )
            ),
        ),
    )
    written = write(system)
    assert written.content.decode().splitlines() == [
        "# Written by fuzzytree.",
        "# dialect: octave",
        "",
        "[System]",
        "Name='tip_1'",
        "Type='sugeno'",
        "Version=2.0",
        "NumInputs=1",
        "NumOutputs=1",
        "NumRules=1",
        "AndMethod='min'",
        "OrMethod='max'",
        "ImpMethod='prod'",
        "AggMethod='sum'",
        "DefuzzMethod='wtaver'",
        "",
        "[Input1]",
        "Name='food'",
        "Range=[0.0 10.0]",
        "NumMFs=1",
        "MF1='low':'trimf',[0.0 1.0 2.5]",
        "",
        "[Output1]",
        "Name='tip'",
        "Range=[0.0 30.0]",
        "NumMFs=1",
        "MF1='small':'constant',[0.1]",
        "",
        "[Rules]",
        "-1.20, 1 (0.5) : 1",
    ]
    assert written.remarks == (
        "names were changed: 'tip %1' is tip_1",
        "Octave refuses rows with a value outside the Range of its input",
    )


def test_a_curve_that_octave_lacks_is_remarked() -> None:
    system = _sugeno(SystemRule(Proposition("a", ("low",)), (_small(),)))
    step = Points((1.0, math.nextafter(1.0, 2.0), 2.0), (1.0, 0.5, 0.0))
    first, second = system.variables
    first = replace(first, terms=(Term("low", step),))
    written = write(replace(system, variables=(first, second)))
    assert (
        "term 'low' of 'a': it is a discretemf, which MATLAB and Octave do not "
        "have; terms that need a function of docs/reference/fis.md: 1; "
        "--set curves=standard counts them as losses"
    ) in written.remarks
    assert not any(
        "discretemf" in remark
        for remark in write(system, dialect="fuzzylite", allow_loss=True).remarks
    )


def _small() -> Conclusion:
    return Conclusion("tip", "small")


def _sugeno(*rules: SystemRule, block: RuleBlock | None = None) -> FuzzySystem:
    labels = (
        Term("low", Trapezoid(None, 1.0, 1.0, 2.0)),
        Term("high", Trapezoid(1.0, 2.0, 2.0, None)),
    )
    output = SystemOutput(
        "tip", (Term("small", Singleton(1.0)),), None, None, _AVERAGE, None
    )
    inputs = (
        Variable("a", labels, low=0.0, high=3.0),
        Variable("b", labels, low=0.0, high=3.0),
    )
    return FuzzySystem("s", inputs, (output,), (block or RuleBlock(rules),))


_AVERAGE = Defuzzifier("weighted average")


def rows(written: Written) -> list[str]:
    _, _, text = written.content.decode().partition("[Rules]\n")
    return text.splitlines()


@pytest.mark.parametrize(
    ("when", "line"),
    [
        (Proposition("b", ("high",)), "0 2, 1 (1.0) : 1"),
        (Not(Proposition("b", ("high",))), "0 -2, 1 (1.0) : 1"),
        (
            Or((Proposition("b", ("low",)), Proposition("a", ("high",)))),
            "2 1, 1 (1.0) : 2",
        ),
        (
            And((Proposition("a", ("low",)), Proposition("b", ("low",)))),
            "1 1, 1 (1.0) : 1",
        ),
        (
            And((Proposition("a", (), ("any",)), Proposition("b", ("low",)))),
            "0 1, 1 (1.0) : 1",
        ),
    ],
)
def test_a_condition_is_a_number_for_each_input(when: Condition, line: str) -> None:
    assert rows(write(_sugeno(SystemRule(when, (_small(),))))) == [line]


def test_a_rule_without_a_condition_tests_a_term_that_always_holds() -> None:
    system = _sugeno(SystemRule(None, (_small(),)))
    written = write(system)
    assert "MF3='always':'trapmf',[-2e+300 -1e+300 1e+300 2e+300]" in (
        written.content.decode()
    )
    assert rows(written) == ["3 0, 1 (1.0) : 1"]
    assert rows(write(system, dialect="matlab")) == ["0 0, 1 (1.0) : 1"]
    assert rows(write(system, dialect="fuzzylite")) == ["0.99 0, 1 (1.0) : 1"]


def test_an_input_that_is_tested_twice_becomes_a_term_with_a_bound() -> None:
    both = And(
        (
            Proposition("a", ("low",)),
            Proposition("b", ("low",)),
            Proposition("a", ("high",)),
        )
    )
    system = _sugeno(SystemRule(both, (_small(),)))
    with pytest.raises(LossError, match="low and high of 'a': the rules test it"):
        write(system)
    written = write(system, allow_loss=True)
    assert rows(written) == ["3 1, 1 (1.0) : 1"]
    assert [(loss.where, loss.bound) for loss in written.losses] == [
        ("low and high of 'a'", 0.0)
    ]
    again = read_fis(written.content, "s.fis").model
    assert isinstance(again, FuzzySystem)
    assert again.variables[0].terms[2].function == Points(
        (1.0, 1.5, 2.0), (0.0, 0.5, 0.0)
    )


@pytest.mark.parametrize(
    ("rule", "reason"),
    [
        (
            SystemRule(
                Or(
                    (
                        And((Proposition("a", ("low",)), Proposition("b", ("low",)))),
                        Proposition("a", ("high",)),
                    )
                ),
                (_small(),),
            ),
            "rule 1: it mixes and, or and not over several inputs",
        ),
        (
            SystemRule(Proposition("tip", ("small",)), (_small(),)),
            "rule 1: it tests the output 'tip'",
        ),
        (
            SystemRule(Proposition("a", ("low",), ("seldom",)), (_small(),)),
            "rule 1: octave has no way to say 'seldom'",
        ),
    ],
)
def test_a_rule_without_a_place_in_fis_is_refused(
    rule: SystemRule, reason: str
) -> None:
    with pytest.raises(LossError) as caught:
        write(_sugeno(rule), allow_loss=True)
    assert str(caught.value) == f"cannot write s as fis:\n  {reason}"


def test_what_the_one_set_of_methods_cannot_say_is_lost_by_name() -> None:
    one = SystemOutput(
        "y", (Term("t", Gaussian(0.0, 1.0)),), 0.0, 1.0,
        Defuzzifier("centroid", 200, "middle"), "maximum", default=0.25, clips=True,
    )  # fmt: skip
    rule = SystemRule(Proposition("x", ("t",)), (Conclusion("y", "t"),))
    system = FuzzySystem(
        "s",
        (Variable("x", (Term("t", Gaussian(0.0, 1.0)),), low=0.0, high=1.0),),
        (one,),
        (
            RuleBlock((rule,), "minimum", "maximum", "minimum"),
            RuleBlock((rule,), "product", "maximum", "minimum"),
        ),
    )
    with pytest.raises(LossError) as caught:
        write(system)
    assert str(caught.value).splitlines() == [
        "cannot write s as fis without loss:",
        "  output 'y': its curve is sampled at 200 values (middle), and FIS does not "
        "say so; octave takes 101 (half ends)",
        "  variable 'y': values are not moved into the range",
        "  block 2 of rules: the file has one set of norms, those of the first block",
        "  output 'y': FIS has no default, 0.25, where no rule fires",
        "  pass allow_loss=True to write it as stated",
    ]


def test_what_matlab_answers_where_no_rule_fires_is_a_loss_if_the_model_differs() -> (
    None
):
    rule = SystemRule(Proposition("a", ("low",)), (Conclusion("tip", "small"),))
    system = _sugeno(rule)
    with pytest.raises(LossError) as caught:
        write(system, dialect="matlab")
    assert str(caught.value).splitlines() == [
        "cannot write s as fis without loss:",
        "  output 'tip': where no rule fires, MATLAB answers 1.0, not no number",
        "  pass allow_loss=True to write it as stated",
    ]
    (output,) = system.outputs
    carried = replace(system, outputs=(replace(output, default=1.0),))
    written = write(carried, dialect="matlab")
    assert written.losses == ()
    assert canonical_form(read_fis(written.content, "s.fis").model) == canonical_form(
        carried
    )


def test_terms_of_one_number_are_a_loss_where_octave_joins_their_rules() -> None:
    number = Singleton(5.0)
    output = SystemOutput(
        "tip",
        (Term("small", number), Term("tiny", number)),
        0.0,
        9.0,
        _AVERAGE,
        "maximum",
    )
    rules = [
        SystemRule(Proposition("a", (term,)), (Conclusion("tip", then),))
        for term, then in (("low", "small"), ("high", "tiny"))
    ]
    system = replace(
        _sugeno(SystemRule(Proposition("a", ("low",)), (_small(),))),
        outputs=(output,),
        blocks=(RuleBlock(tuple(rules), "minimum"),),
    )
    with pytest.raises(LossError) as caught:
        write(system)
    assert str(caught.value).splitlines() == [
        "cannot write s as fis without loss:",
        "  terms 'small' and 'tiny' of 'tip': they are one number, and rules of both "
        "are joined by maximum; here each term counts",
        "  pass allow_loss=True to write it as stated",
    ]


def test_combinations_become_inputs_and_linear_conclusions_give_them_no_weight() -> (
    None
):
    rules = rules_from_tree(random_tree(4, combinations=1.0))
    with pytest.raises(LossError, match="combination 'mix 1': it is an input"):
        write(rules)
    flat, _ = flattened(as_system(rules))
    written = write(rules, allow_loss=True)
    again = read_fis(written.content, "r.fis").model
    if isinstance(again, FuzzySystem):
        assert len(again.inputs) == len(flat.inputs)


def test_points_are_a_loss_where_standard_curves_are_required() -> None:
    curve = Points((0.0, 1.0, 2.0), (0.0, 0.5, 1.0))
    system = FuzzySystem(
        "s",
        (Variable("x", (Term("t", curve),), low=0.0, high=2.0),),
        (SystemOutput("y", (Term("t", Singleton(1.0)),), 0.0, 1.0, _AVERAGE),),
        (RuleBlock((SystemRule(Proposition("x", ("t",)), (Conclusion("y", "t"),)),)),),
    )
    assert write(system).losses == ()
    with pytest.raises(LossError, match="it is a discretemf, which MATLAB and Octave"):
        write(system, curves="standard")


@pytest.mark.parametrize(
    "curve", [Trapezoid(0.5, 0.5, 1.0, 1.0), Binary(2.0), Singleton(0.0)]
)
def test_steps_have_corners_that_rise_for_octave(curve: Curve) -> None:
    term = term_of(curve, "octave")
    assert term is not None
    corners = [*map(float, term[1].split())]
    assert corners[0] < corners[1] <= corners[-2] < corners[-1]


@pytest.mark.heavy
def test_the_same_model_gives_the_same_bytes() -> None:
    rules = rules_from_tree(random_tree(3))
    one, other = write(rules, allow_loss=True), write(rules, allow_loss=True)
    assert one == other


def test_fis_is_in_the_table_of_formats() -> None:
    assert find_format(".fis").read is not None
    assert get_args(Dialect) == DIALECTS


def test_a_dialect_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="no dialect 'scilab'; there is matlab"):
        write(rules_from_tree(random_tree(0)), dialect="scilab")  # type: ignore[arg-type]


def test_a_rule_that_mixes_and_and_or_becomes_several_under_maximum() -> None:
    mixed = And(
        (
            Or((Proposition("a", ("low",)), Proposition("b", ("low",)))),
            Proposition("a", ("high",)),
        )
    )
    system = _sugeno(SystemRule(mixed, (_small(),)))
    (output,) = system.outputs
    system = replace(system, outputs=(replace(output, aggregation="maximum"),))
    with pytest.raises(LossError, match="it is 2 rules, joined by maximum"):
        write(system)
    written = write(system, allow_loss=True)
    assert rows(written) == ["3 0, 1 (1.0) : 1", "2 1, 1 (1.0) : 1"]
    with pytest.raises(LossError, match="rule 1: it mixes and, or and not"):
        write(system, allow_loss=True, dialect="fuzzylite")
