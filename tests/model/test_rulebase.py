import pytest

from fuzzytree.errors import InvalidModelError
from fuzzytree.model.rulebase import (
    LR,
    Band,
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
    fingerprint,
    name_choice,
    sentence,
)

LOW = Term("low", Band(high=1.0, right=3.0))
HIGH = Term("high", Band(low=1.0, left=-1.0))
FORCE = Variable("force", (LOW, HIGH), unit="N", low=0.0, high=9.0)
RULES = (
    Rule((Proposition("force", ("low",)),), "soft"),
    Rule((Proposition("force", ("high",)),), "firm", support=3),
)


def rule_base(
    *,
    name: str = "grip",
    classes: tuple[str, ...] = ("soft", "firm"),
    variables: tuple[Variable, ...] = (FORCE,),
    rules: tuple[Rule, ...] = RULES,
    semantics: Semantics | None = None,
    columns: tuple[str, ...] = (),
) -> RuleBase:
    return RuleBase(
        name, classes, variables, rules, semantics or Semantics(), columns=columns
    )


def test_a_rule_reads_as_a_sentence() -> None:
    rule = Rule(
        (
            Proposition("force", ("low", "high")),
            Proposition("slip", ("some",), ("not",)),
        ),
        "a",
    )
    assert sentence(rule) == "IF force is low or high AND slip is not some THEN a"


def test_a_rule_without_propositions_always_holds() -> None:
    assert sentence(Rule((), "soft")) == "ALWAYS soft"


def test_a_rule_base_shows_its_rules_with_their_numbers() -> None:
    assert (
        str(rule_base())
        == "1. IF force is low THEN soft\n2. IF force is high THEN firm"
    )


def test_inputs_are_the_variables_that_combine_nothing() -> None:
    mix = Variable("mix", (LOW,), parts=(Part("force", 2.0),))
    rules = (Rule((Proposition("mix", ("low",)),), "soft"),)
    assert rule_base(variables=(FORCE, mix), rules=rules).inputs == ("force",)


def test_equal_models_have_equal_fingerprints() -> None:
    assert fingerprint(rule_base()) == fingerprint(rule_base())


def test_one_ulp_changes_the_fingerprint() -> None:
    moved = Term("low", Band(high=1.0000000000000002, right=3.0))
    other = rule_base(variables=(Variable("force", (moved, HIGH)),))
    same = rule_base(variables=(Variable("force", (LOW, HIGH)),))
    assert fingerprint(other) != fingerprint(same)


def test_all_mistakes_of_a_rule_base_are_reported_at_once() -> None:
    with pytest.raises(InvalidModelError) as caught:
        RuleBase(
            "",
            ("soft", "soft"),
            (Variable("force", (LOW, LOW)),),
            (
                Rule(
                    (Proposition("froce", ("low",)), Proposition("force", ("lwo",))),
                    "firm",
                ),
                Rule((Proposition("force", ()),), "soft", support=-1),
            ),
            Semantics(uncovered="sotf"),
        )
    assert str(caught.value).splitlines() == [
        "a model needs a name",
        "class 'soft' stands twice",
        "the answer for uncovered is no class: 'sotf'; "
        "there is soft (did you mean 'soft'?)",
        "term of 'force' 'low' stands twice",
        "rule 1: no class 'firm'; there is soft",
        "rule 1: no variable 'froce'; there is force (did you mean 'force'?)",
        "rule 1: 'force' has no term 'lwo'; there is low (did you mean 'low'?)",
        "rule 2: the support cannot be below 0",
        "rule 2: the proposition on 'force' names no term",
    ]
    assert caught.value.mistakes[4][0] == ("rules", 0, "then")


@pytest.mark.parametrize(
    ("shape", "sentence"),
    [
        (Band(low=float("nan")), "low must be finite or left out, not nan"),
        (
            Band(low=2.0, high=2.0),
            "the plateau starts at 2.0 and must end above it, not at 2.0",
        ),
        (
            Band(high=1.0, right=0.5),
            "the right flank must end above 1.0, not at 0.5",
        ),
        (
            Band(low=1.0, left=1.0),
            "the left flank must end below 1.0, not at 1.0",
        ),
        (
            Band(right=2.0),
            "a plateau that is open on the right has no right flank",
        ),
        (
            Band(high=1.0, right=float("inf")),
            "the right flank must end at a finite value, not inf",
        ),
        (
            LR(0.0, Side(0.0, (0.4,)), Side(1.0, (0.4,))),
            "the left spread must be finite and above 0, not 0.0",
        ),
        (
            LR(0.0, Side(1.0, (0.4,)), Side(1.0, (0.4,), 1.0)),
            "the right reach must be finite and above 1, not 1.0",
        ),
        (
            LR(float("inf"), Side(1.0, (0.4,)), Side(1.0, (0.4,))),
            "the mean must be finite, not inf",
        ),
        (Points((), ()), "a shape needs 1 to 4096 points, not 0"),
        (
            Points(tuple(map(float, range(4097))), (0.5,) * 4097),
            "a shape needs 1 to 4096 points, not 4097",
        ),
        (
            Points((0.0, 1.0), (0.5,)),
            "2 values of points need as many degrees, not 1",
        ),
        (
            Points((0.0, float("inf")), (0.0, 1.0)),
            "the values of points must be finite, not inf",
        ),
        (
            Points((0.0, 2.0, 1.5), (0.0, 1.0, 0.0)),
            "the values of points must not decrease: 1.5 stands behind 2.0",
        ),
        (
            Points((2.0, 2.0, 2.0), (0.0, 1.0, 0.0)),
            "three points at 2.0; two make a step",
        ),
        (
            Points((-1e308, 1e308), (0.0, 1.0)),
            "the points at -1e+308 and 1e+308 are too far apart",
        ),
        (
            Points((0.0, 1.0), (0.0, 1.5)),
            "the degree at 1.0 must lie in [0, 1], not 1.5",
        ),
        (
            Points((0.0, 1.0), (float("nan"), 1.0)),
            "the degree at 0.0 must lie in [0, 1], not nan",
        ),
    ],
)
def test_an_impossible_shape_is_refused(shape: Shape, sentence: str) -> None:
    variable = Variable("force", (Term("low", shape),))
    rules = (Rule((Proposition("force", ("low",)),), "soft"),)
    with pytest.raises(InvalidModelError) as caught:
        rule_base(variables=(variable,), rules=rules)
    assert str(caught.value) == f"term 'low' of 'force': {sentence}"


@pytest.mark.parametrize(
    ("variable", "sentence"),
    [
        (
            Variable("mix", (LOW,), parts=(Part("slip", 1.0),)),
            "combination 'mix' needs input 'slip', which does not stand before it; "
            "there is force",
        ),
        (
            Variable("mix", (LOW,), parts=(Part("force", 0.0),)),
            "the weight of 'force' in 'mix' must be finite and not 0, not 0.0",
        ),
        (
            Variable("mix", (LOW,), parts=(Part("force", 1.0, float("nan")),)),
            "the centre of 'force' in 'mix' must be finite",
        ),
        (
            Variable("mix", (LOW,), low=2.0, high=1.0),
            "the range of 'mix' starts at 2.0 and ends below it, at 1.0",
        ),
    ],
)
def test_an_impossible_variable_is_refused(variable: Variable, sentence: str) -> None:
    with pytest.raises(InvalidModelError) as caught:
        rule_base(variables=(FORCE, variable))
    assert str(caught.value) == sentence


def test_an_input_must_be_one_of_the_columns() -> None:
    with pytest.raises(InvalidModelError) as caught:
        rule_base(columns=("Force", "slip"))
    assert str(caught.value) == (
        "input 'force' is not among the columns; "
        "there is Force, slip (did you mean 'Force'?)"
    )


def test_a_name_that_no_file_can_hold_is_refused() -> None:
    with pytest.raises(InvalidModelError) as caught:
        rule_base(name="\ud800", classes=("soft", "firm", "\udfff"))
    assert str(caught.value) == (
        "the name '\\ud800' cannot be written as UTF-8\n"
        "class '\\udfff' cannot be written as UTF-8"
    )


def test_a_choice_of_names_stands_in_one_line() -> None:
    assert name_choice("b", ["a\nb", "c"]) == "there is 'a\\nb', c"


@pytest.mark.parametrize(
    ("counts", "sentence"),
    [
        ((3,), "rule 1: the counts are one of each class, none below 0"),
        ((4, -1), "rule 1: the counts are one of each class, none below 0"),
        ((3, 1), "rule 1: the counts sum to 4, not to the support"),
    ],
)
def test_counts_by_class_sum_to_the_support(
    counts: tuple[int, ...], sentence: str
) -> None:
    with pytest.raises(InvalidModelError) as caught:
        RuleBase("x", ("a", "b"), (), (Rule((), "a", support=3, counts=counts),))
    assert str(caught.value) == sentence
    assert RuleBase("x", ("a", "b"), (), (Rule((), "a", 3, counts=(1, 2)),)).rules
