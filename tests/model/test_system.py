"""A system that contradicts itself is refused, with every mistake and its place."""

from __future__ import annotations

import math

import pytest
from msgspec.structs import replace

from fuzzytree.errors import InvalidModelError
from fuzzytree.model import (
    FUNCTIONS,
    MOST_LEVELS,
    MOST_SAMPLES,
    Activation,
    And,
    Arc,
    Bell,
    Call,
    Concave,
    Conclusion,
    Condition,
    Curve,
    Defuzzifier,
    Expression,
    Formula,
    FuzzySystem,
    Gaussian,
    Linear,
    Name,
    Not,
    Number,
    Or,
    PiCurve,
    Proposition,
    RuleBlock,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidProduct,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
    names_in,
    questions,
)
from fuzzytree.model.rulebase import Part, Points
from fuzzytree.semantics.inference import value_of

LOW = Term("low", Trapezoid(None, 0.0, 1.0, 2.0))
INPUT = Variable("a", (LOW,))
WEIGHTED = SystemOutput(
    "y", (Term("one", Singleton(1.0)),), None, None, Defuzzifier("weighted sum")
)
CENTROID = SystemOutput("y", (LOW,), 0.0, 1.0, Defuzzifier("centroid"), "maximum")
RULE = SystemRule(Proposition("a", ("low",)), (Conclusion("y", "one"),))
WHOLE = FuzzySystem("whole", (INPUT,), (WEIGHTED,), (RuleBlock((RULE,)),))


def concluding(label: str) -> tuple[RuleBlock, ...]:
    """Return a block of one rule, which always fires."""
    rule = SystemRule(None, (Conclusion("y", label),))
    return (RuleBlock((rule,), implication="minimum"),)


def mistakes(**changes: object) -> list[tuple[tuple[str | int, ...], str]]:
    """Return what is wrong with a system when parts of it are changed."""
    with pytest.raises(InvalidModelError) as caught:
        replace(WHOLE, **changes)
    return list(caught.value.mistakes)


def test_a_whole_system_names_its_columns_variables_and_rules() -> None:
    mix = Variable("mix", parts=(Part("a", 2.0),))
    found = replace(WHOLE, variables=(INPUT, mix))
    assert found.inputs == ("a",)
    assert [one.name for one in found.all_variables] == ["a", "mix", "y"]
    assert found.rules == (RULE,)


def test_all_mistakes_of_a_system_are_reported_at_once() -> None:
    assert mistakes(
        name="",
        variables=(
            replace(INPUT, low=2.0, high=1.0),
            Variable("", (LOW, LOW), clips=True),
            Variable("mix", parts=(Part("b", 0.0),)),
        ),
        outputs=(
            replace(WEIGHTED, clips=True, default=math.inf),
            replace(CENTROID, name="a", aggregation=None, low=1.0),
        ),
    ) == [
        (("name",), "a system needs a name"),
        (("outputs", 1), "variable 'a' stands twice"),
        (("variables", 1, "name"), "a variable needs a name"),
        (
            ("variables", 0, "low"),
            "the range of 'a' starts at 2.0 and ends below it, at 1.0",
        ),
        (("variables", 1, "terms", 1), "term of '' 'low' stands twice"),
        (("variables", 1), "input '' is clipped to a range that it lacks"),
        (
            ("variables", 2, "parts", 0, "input"),
            "combination 'mix' needs input 'b', which does not stand before it; there "
            "is a, ",
        ),
        (
            ("variables", 2, "parts", 0, "weight"),
            "the weight of 'b' in 'mix' must be finite and not 0, not 0.0",
        ),
        (("outputs", 0, "default"), "the default of 'y' must be finite"),
        (("outputs", 0), "output 'y' is clipped to a range that it lacks"),
        (("outputs", 1), "output 'a' needs a range for its centroid"),
        (("outputs", 1), "output 'a' needs an aggregation for its centroid"),
    ]


@pytest.mark.parametrize(
    ("rule", "place", "text"),
    [
        (
            replace(RULE, when=Proposition("a", ("lo",))),
            "when",
            "'a' has no term 'lo'; there is low (did you mean 'low'?)",
        ),
        (
            replace(RULE, when=Proposition("b", ("low",))),
            "when",
            "no variable 'b'; there is a, y",
        ),
        (
            replace(RULE, when=Proposition("a", ())),
            "when",
            "'a' is used without a term",
        ),
        (
            replace(RULE, when=Proposition("a", (), ("any", "very"))),
            "when",
            "'a' is used without a term",
        ),
        (
            replace(RULE, when=Proposition("b", (), ("any",))),
            "when",
            "no variable 'b'; there is a, y",
        ),
        (
            replace(RULE, when=Not(And(()))),
            "when",
            "it joins fewer than two conditions",
        ),
        (
            replace(RULE, when=Or((Proposition("a", ("low",)),))),
            "when",
            "it joins fewer than two conditions",
        ),
        (replace(RULE, then=()), "then", "it concludes nothing"),
        (
            replace(RULE, then=(Conclusion("a", "low"),)),
            "then",
            "no variable 'a'; there is y",
        ),
        (
            replace(RULE, then=(Conclusion("y", "two"),)),
            "then",
            "'y' has no term 'two'; there is one",
        ),
        (
            replace(RULE, weight=1.5),
            "weight",
            "the weight must lie in [0, 1], not 1.5",
        ),
        (
            replace(RULE, weight=math.nan),
            "weight",
            "the weight must lie in [0, 1], not nan",
        ),
    ],
    ids=repr,
)
def test_a_rule_that_is_wrong_is_refused(
    rule: SystemRule, place: str, text: str
) -> None:
    found = mistakes(blocks=(RuleBlock((RULE, rule)),))
    assert found == [(("blocks", 0, "rules", 1, place), f"rule 2: {text}")]


def test_mistakes_name_the_block_of_a_rule() -> None:
    wrong = RuleBlock((replace(RULE, then=()),))
    found = mistakes(blocks=(RuleBlock((RULE,)), wrong))
    assert found == [
        (
            ("blocks", 1, "rules", 0, "then"),
            "rule 1 of block 2: it concludes nothing",
        )
    ]


def test_an_operator_is_needed_where_it_is_used() -> None:
    low = Proposition("a", ("low",))
    both = And((low, Not(Or((low, low)))))
    block = RuleBlock((replace(RULE, when=both),), None, None)
    assert [text for _, text in mistakes(blocks=(block,))] == [
        "rule 1: it needs a conjunction, and its block has none",
        "rule 1: it needs a disjunction, and its block has none",
    ]
    rule = replace(RULE, then=(Conclusion("y", "low"),))
    found = mistakes(outputs=(CENTROID,), blocks=(RuleBlock((rule,)),))
    assert [text for _, text in found] == [
        "rule 1: 'y' needs an implication in its block"
    ]
    cut = RuleBlock((rule,), implication="product")
    assert replace(WHOLE, outputs=(CENTROID,), blocks=(cut,)).rules == (rule,)


def test_conditions_are_nested_as_deeply_as_may_be_and_no_deeper() -> None:
    condition: Condition = Proposition("a", ("low",))
    for _ in range(MOST_LEVELS - 1):
        condition = Not(condition)
    block = RuleBlock((replace(RULE, when=condition),))
    assert replace(WHOLE, blocks=(block,)).blocks == (block,)
    for _ in range(10_000):
        condition = Not(condition)
    found = mistakes(blocks=(RuleBlock((replace(RULE, when=condition),)),))
    assert found[0][1] == f"rule 1: nested deeper than {MOST_LEVELS} levels"


def test_an_activation_that_is_wrong_is_refused() -> None:
    how = Activation("first", 0, 1.5)
    assert mistakes(blocks=(RuleBlock((RULE,), activation=how),)) == [
        (("blocks", 0, "activation"), "at least 1 rule is activated, not 0"),
        (("blocks", 0, "activation"), "the threshold must lie in [0, 1], not 1.5"),
    ]


def test_samples_have_limits() -> None:
    for count in (1, MOST_SAMPLES + 1):
        how = Defuzzifier("bisector", count)
        output = replace(CENTROID, defuzzifier=how)
        text = f"output 'y': {count} samples; there must be 2 to {MOST_SAMPLES}"
        found = mistakes(outputs=(output,), blocks=concluding("low"))
        assert found == [(("outputs", 0), text)]
    how = Defuzzifier("weighted sum", 0)
    output = replace(WEIGHTED, defuzzifier=how)
    assert mistakes(outputs=(output,)) == [(("outputs", 0), "output 'y': 0 samples")]


def test_a_range_that_is_too_wide_to_be_looked_at_is_refused() -> None:
    output = replace(CENTROID, low=-1e308, high=1e308)
    assert mistakes(outputs=(output,), blocks=concluding("low")) == [
        (("outputs", 0), "-1e+308 and 1e+308 are too far apart")
    ]


def deep(levels: int) -> Expression:
    expression: Expression = Number(1.0)
    for _ in range(levels - 1):
        expression = Call("negate", (expression,))
    return expression


@pytest.mark.parametrize(
    ("curve", "text"),
    [
        (
            Trapezoid(0.0, 2.0, 1.0, 3.0),
            "the corners must be finite and rise: 0.0, 2.0, 1.0, 3.0",
        ),
        (
            Trapezoid(None, 1.0, math.inf, None),
            "the corners must be finite and rise: 1.0, inf",
        ),
        (
            Trapezoid(-1e308, 0.0, 0.0, 1e308),
            "the corners are too far apart: -1e+308, 0.0, 0.0, 1e+308",
        ),
        (Gaussian(0.0, 0.0), "the deviation must be above 0, not 0.0"),
        (Gaussian(math.nan, 1.0), "the mean must be finite, not nan"),
        (Bell(0.0, -1.0, 1.0), "the width must be above 0, not -1.0"),
        (
            SigmoidProduct(Sigmoid(0.0, 1.0), Sigmoid(0.0, math.inf)),
            "the slope must be finite, not inf",
        ),
        (PiCurve(0.0, 2.0, 1.0, 3.0), "the corners must rise: 0.0, 2.0, 1.0, 3.0"),
        (SCurve(-1e308, 1e308), "-1e+308 and 1e+308 are too far apart"),
        (Concave(-1e308, 1e308), "-1e+308 and 1e+308 are too far apart"),
        (
            Arc(1.0, 1.0),
            "an arc must start and end at different values, not at 1.0",
        ),
        (SemiEllipse(1.0, 0.0), "the end must lie above the start 1.0, not at 0.0"),
        (Linear((1.0, math.nan)), "the weights and the offset must be finite"),
        (
            Formula(Number(math.inf)),
            "the numbers of a formula must be finite, not inf",
        ),
        (
            Formula(Call("sine", (Number(1.0),))),
            "no function 'sine'; there is +, -, *, /, %, ^, and, or, lt, le, gt, ge, "
            "... (did you mean 'sin'?)",
        ),
        (Formula(Call("max", (Number(1.0),))), "'max' takes 2 arguments, not 1"),
        (
            Formula(deep(MOST_LEVELS + 1)),
            f"the formula is nested deeper than {MOST_LEVELS} levels",
        ),
        (Points((1.0, 0.0), (0.0, 1.0)), None),
    ],
    ids=lambda one: type(one).__name__ if isinstance(one, Curve) else "",
)
def test_a_curve_that_is_wrong_is_refused(curve: Curve, text: str | None) -> None:
    found = [*curve.mistakes()]
    assert len(found) == 1
    assert text is None or found == [text]


def test_the_deepest_formula_is_accepted() -> None:
    assert [*Formula(deep(MOST_LEVELS)).mistakes()] == []


def labelled(curve: Curve) -> Term:
    return Term("made", curve)


def test_a_formula_names_inputs_earlier_outputs_and_x() -> None:
    def output(name: str, formula: Expression) -> SystemOutput:
        return replace(WEIGHTED, name=name, terms=(labelled(Formula(formula)),))

    fine = (output("y", Name("a")), output("z", Call("+", (Name("y"), Name("x")))))
    blocks = concluding("made")
    assert replace(WHOLE, outputs=fine, blocks=blocks).outputs == fine
    found = mistakes(
        variables=(replace(INPUT, terms=(labelled(Formula(Name("y"))),)),),
        outputs=(output("y", Name("y")), output("z", Name("yy"))),
        blocks=blocks,
    )
    assert [text for _, text in found] == [
        "term 'made' of 'a': no variable 'y'; there is a",
        "term 'made' of 'y': no variable 'y'; there is a",
        "term 'made' of 'z': no variable 'yy'; there is a, y (did you mean 'y'?)",
    ]


def test_x_is_either_a_variable_or_the_value_itself() -> None:
    named = replace(INPUT, name="x")
    assert replace(WHOLE, variables=(named,), blocks=concluding("one")).inputs == ("x",)
    formula = replace(named, terms=(labelled(Formula(Name("x"))),))
    assert mistakes(variables=(formula,), blocks=concluding("one")) == [
        (
            ("variables", 0, "terms", 0),
            "term 'made' of 'x': 'x' is a variable, and in a formula it is the value "
            "itself",
        )
    ]


def test_a_linear_term_is_a_weighted_number_with_a_weight_for_each_column() -> None:
    mix = Variable("mix", parts=(Part("a", 2.0),))
    line = labelled(Linear((1.0,)))
    fine = replace(WEIGHTED, terms=(line,))
    blocks = concluding("made")
    assert replace(WHOLE, variables=(INPUT, mix), outputs=(fine,), blocks=blocks)
    two = replace(WEIGHTED, terms=(labelled(Linear((1.0, 2.0))),))
    curve = replace(CENTROID, name="z", terms=(line,))
    found = mistakes(outputs=(two, curve), blocks=blocks)
    assert [text for _, text in found] == [
        "term 'made' of 'y': it needs a weight for each column: 1, not 2",
        "term 'made' of 'z': only a weighted average or sum takes a linear term",
    ]


@pytest.mark.parametrize("height", [0.0, -1.0, 1.5, math.nan])
def test_a_height_lies_above_0_and_at_most_at_1(height: float) -> None:
    found = mistakes(variables=(replace(INPUT, terms=(replace(LOW, height=height),)),))
    assert found == [
        (
            ("variables", 0, "terms", 0),
            f"term 'low' of 'a': the height must lie in (0, 1], not {height!r}",
        )
    ]


def test_every_function_of_a_formula_has_its_operation() -> None:
    for name, count in FUNCTIONS.items():
        call = Call(name, (Number(1.0),) * count)
        assert isinstance(value_of(call, {}), float), name


def test_questions_and_names_come_from_left_to_right() -> None:
    first, second, third = (
        Proposition("a", ("b",)),
        Proposition("c", ("d",)),
        Proposition("e", ("f",)),
    )
    condition = Or((first, Not(And((second, third)))))
    assert [*questions(condition)] == [first, second, third]
    assert [*questions(None)] == []
    formula = Call("+", (Name("b"), Call("*", (Name("a"), Number(1.0)))))
    assert [*names_in(formula)] == ["b", "a"]
