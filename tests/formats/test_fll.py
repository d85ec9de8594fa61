"""FLL files as systems."""

from __future__ import annotations

import random

import pytest

from fuzzytree.errors import ReadError
from fuzzytree.formats.fll.fll_reader import Dialect, read_fll
from fuzzytree.model import (
    Activation,
    And,
    Arc,
    Bell,
    Binary,
    Call,
    Concave,
    Conclusion,
    Cosine,
    Curve,
    Defuzzifier,
    Formula,
    FuzzySystem,
    Gaussian,
    Linear,
    Name,
    Number,
    Or,
    PiCurve,
    Proposition,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    Spike,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    TwoGaussians,
    Variable,
)
from fuzzytree.model.contracts import Loss
from fuzzytree.model.rulebase import Points
from fuzzytree.semantics.inference import curve_degree, infer
from tests.work import at_most

TIPPER = """\
# A comment
Engine: tipper
  description: what to give
InputVariable: service
  enabled: true
  range: 0.000 10.000
  lock-range: true
  term: poor Triangle -inf 0.000 5.000
  term: good Trapezoid 0.000 5.000 inf inf 0.500   # with a height
InputVariable: food
  range: -inf inf
  term: fine Discrete 0.000 0.000 2.500 1.000
OutputVariable: tip
  range: 0.000 30.000
  lock-range: false
  aggregation: Maximum
  defuzzifier: Centroid 200
  default: 7.500
  lock-previous: false
  term: cheap Ramp 10.000 0.000
  term: generous Ramp 10.000 30.000
OutputVariable: share
  aggregation: none
  defuzzifier: WeightedAverage TakagiSugeno
  default: nan
  term: flat Constant 0.100
  term: fair Linear 0.010 0.020 0.050
RuleBlock: all
  conjunction: Minimum
  disjunction: AlgebraicSum
  implication: AlgebraicProduct
  activation: Highest 2
  rule: if service is poor or service is not good and food is very fine then tip is cheap
  rule: if (service is poor or food is any) and food is fine then tip is extremely generous and share is fair with 0.500
  rule: if food is any then share is flat
"""  # noqa: E501


def with_rule(text: str, conclusion: str) -> str:
    """Return a file with a block of one rule, `any` of input a."""
    return f"{text}\nRuleBlock: r\n  rule: if a is any then {conclusion}"


def system_of(text: str) -> FuzzySystem:
    model = read_fll(text.encode(), "tipper.fll").model
    assert isinstance(model, FuzzySystem)
    return model


@pytest.mark.parametrize("mark", ["\x0b", "\x0c", "\x85", "\u2028", "\u2029"])
def test_only_cr_and_lf_end_a_comment(mark: str) -> None:
    hidden = f"# A comment{mark}OutputVariable: more"
    assert system_of(TIPPER.replace("# A comment", hidden)) == system_of(TIPPER)


def test_the_words_of_fuzzylite_5_are_read_as_fuzzylite_6_takes_them() -> None:
    old = TIPPER.replace("  aggregation: Maximum", "  accumulation: Maximum")
    old = old.replace("lock-previous: false", "lock-valid: false")
    old = old.replace("  implication: Alg", "  activation: Alg").replace(
        "Highest 2", ""
    )
    reading = read_fll(old.replace("  activation: \n", "").encode(), "tipper.fll")
    new = TIPPER.replace("Highest 2", "General")
    assert reading.model == system_of(new)
    assert [one for one in reading.remarks if "fuzzylite 5" in one] == [
        f"line {line}: {was!r} of fuzzylite 5 is read as {now!r}, as in fuzzylite 6"
        for line, was, now in (
            (16, "accumulation", "aggregation"),
            (19, "lock-valid", "lock-previous"),
            (31, "activation", "implication"),
        )
    ]


def test_every_word_of_a_file_is_in_the_system() -> None:
    reading = read_fll(TIPPER.encode(), "tipper.fll")
    system = reading.model
    assert isinstance(system, FuzzySystem)
    assert reading.losses == ()
    assert reading.remarks == (
        "where conclusions have no area the default answers, as in pyfuzzylite; "
        "fuzzylite 6 answers NaN",
    )
    assert (system.name, system.note) == ("tipper", "what to give")
    assert system.variables == (
        Variable(
            "service",
            (
                Term("poor", Trapezoid(None, 0.0, 0.0, 5.0)),
                Term("good", Trapezoid(0.0, 5.0, 5.0, None), 0.5),
            ),
            low=0.0,
            high=10.0,
            clips=True,
        ),
        Variable("food", (Term("fine", Points((0.0, 2.5), (0.0, 1.0))),)),
    )
    assert system.outputs == (
        SystemOutput(
            "tip",
            (
                Term("cheap", Points((0.0, 10.0), (1.0, 0.0))),
                Term("generous", Points((10.0, 30.0), (0.0, 1.0))),
            ),
            0.0,
            30.0,
            Defuzzifier("centroid", 200),
            "maximum",
            7.5,
        ),
        SystemOutput(
            "share",
            (
                Term("flat", Singleton(0.1)),
                Term("fair", Linear((0.01, 0.02), 0.05)),
            ),
            None,
            None,
            Defuzzifier("weighted average"),
        ),
    )


def test_rules_are_conditions_in_their_order_of_precedence() -> None:
    (block,) = system_of(TIPPER).blocks
    assert (block.conjunction, block.disjunction) == ("minimum", "algebraic sum")
    assert (block.implication, block.name) == ("product", "all")
    assert block.activation == Activation("highest", 2)
    poor, fine = Proposition("service", ("poor",)), Proposition("food", ("fine",))
    assert block.rules == (
        SystemRule(
            Or(
                (
                    poor,
                    And(
                        (
                            Proposition("service", ("good",), ("not",)),
                            Proposition("food", ("fine",), ("very",)),
                        )
                    ),
                )
            ),
            (Conclusion("tip", "cheap"),),
        ),
        SystemRule(
            And((Or((poor, Proposition("food", (), ("any",)))), fine)),
            (
                Conclusion("tip", "generous", ("extremely",)),
                Conclusion("share", "fair"),
            ),
            0.5,
        ),
        SystemRule(None, (Conclusion("share", "flat"),)),
    )


@pytest.mark.parametrize("end", ["\r\n", "\r", "\n"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_line_ends_and_a_mark_at_the_start_change_nothing(end: str, mark: str) -> None:
    text = mark + TIPPER.replace("\n", end)
    assert system_of(text) == system_of(TIPPER)


CURVES: list[tuple[str, Curve]] = [
    ("Arc 1 2", Arc(1.0, 2.0)),
    ("Bell 0 -2 3", Bell(0.0, 2.0, 3.0)),
    ("Binary 1 inf", Binary(1.0)),
    ("Binary 1 -inf", Binary(1.0, is_above=False)),
    ("Concave 1 2", Concave(1.0, 2.0)),
    ("Constant 3", Formula(Number(3.0))),
    ("Cosine 1 2", Cosine(1.0, 2.0)),
    ("Discrete 0 0 1 1 1 0.5", Points((0.0, 1.0, 1.0), (0.0, 1.0, 0.5))),
    ("Function x * 2", Formula(Call("*", (Name("x"), Number(2.0))))),
    ("Gaussian 1 2", Gaussian(1.0, 2.0)),
    ("GaussianProduct 1 2 3 4", TwoGaussians(1.0, 2.0, 3.0, 4.0)),
    ("PiShape 1 2 3 4", PiCurve(1.0, 2.0, 3.0, 4.0)),
    ("Ramp 1 2", Points((1.0, 2.0), (0.0, 1.0))),
    ("Ramp 2 1", Points((1.0, 2.0), (1.0, 0.0))),
    ("Rectangle 2 1", Trapezoid(1.0, 1.0, 2.0, 2.0)),
    ("SemiEllipse 2 1", SemiEllipse(1.0, 2.0)),
    ("Sigmoid 1 -2", Sigmoid(1.0, -2.0)),
    (
        "SigmoidDifference 1 2 3 4",
        SigmoidDifference(Sigmoid(1.0, 2.0), Sigmoid(4.0, 3.0)),
    ),
    ("SigmoidProduct 1 2 3 4", SigmoidProduct(Sigmoid(1.0, 2.0), Sigmoid(4.0, 3.0))),
    ("Spike 1 2", Spike(1.0, 2.0)),
    ("SShape 1 2", SCurve(1.0, 2.0)),
    ("SShape 2 1", Points((2.0, 2.0), (0.0, 1.0))),
    ("ZShape 1 2", SCurve(2.0, 1.0)),
    ("ZShape 2 2", Points((2.0, 2.0), (1.0, 0.0))),
    ("Trapezoid 1 2 3 4", Trapezoid(1.0, 2.0, 3.0, 4.0)),
    ("Trapezoid -inf -inf inf inf", Trapezoid(None, 0.0, 0.0, None)),
    ("Triangle 1 2 3", Trapezoid(1.0, 2.0, 2.0, 3.0)),
]


@pytest.mark.parametrize(("text", "curve"), CURVES)
def test_every_class_of_terms_has_its_curve(text: str, curve: Curve) -> None:
    assert term_of(text) == Term("t", curve)


def term_of(text: str, head: str = "") -> Term:
    file = f"InputVariable: a\n term: t {text}\nOutputVariable: b\n {head}\n"
    file += "defuzzifier: WeightedSum\n term: one Constant 1"
    return system_of(with_rule(file, "b is one")).variables[0].terms[0]


def output_of(term: str, defuzzifier: str) -> Term:
    lines = ["InputVariable: a", "OutputVariable: b", f"defuzzifier: {defuzzifier}"]
    text = "\n".join([*lines, f"term: t {term}"])
    return system_of(with_rule(text, "b is t")).outputs[0].terms[0]


MONOTONE = [
    "Arc 1 3",
    "Arc 3 1",
    "Concave 1 2",
    "Concave 2 1",
    "Ramp 1 3",
    "Ramp 3 1 0.5",
    "SShape 1 3",
    "Sigmoid 1 2 0.75",
    "ZShape 1 3",
]


@pytest.mark.parametrize("term", MONOTONE)
def test_a_number_after_takagi_and_sugeno_is_the_degree_at_the_activation(
    term: str,
) -> None:
    lines = [
        *("InputVariable: a", "term: one Discrete 0 0 4 1", "OutputVariable: b"),
        *("defuzzifier: WeightedSum TakagiSugeno", f"term: t {term}", "RuleBlock:"),
        *("activation: General", "rule: if a is one then b is t"),
    ]
    system = system_of("\n".join(lines))
    plain = term_of(term)
    for value in (0.5, 1.0, 2.0, 2.5, 4.0):
        degree = value / 4.0
        expected = degree * plain.height * curve_degree(plain.function, degree)
        (found,) = infer(system, {"a": value}).outputs
        assert found == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize(
    ("term", "curve"),
    [("SShape 2 1", SCurve(2.0, 1.0)), ("ZShape 2 1", SCurve(1.0, 2.0))],
)
def test_a_curve_that_ends_before_it_starts_has_degrees_somewhere_all_the_same(
    term: str, curve: Curve
) -> None:
    assert output_of(term, "WeightedAverage").function == curve
    assert isinstance(output_of(term, "WeightedAverage TakagiSugeno").function, Points)


TSUKAMOTO = """\
InputVariable: a
  term: p Ramp 0 1
InputVariable: c
  term: p Ramp 0 1
OutputVariable: y
  aggregation: none
  defuzzifier: WeightedAverage Automatic
  term: up Sigmoid 5 1
RuleBlock: r
  activation: General
  rule: if a is p then y is up
  rule: if c is p then y is up
"""


@pytest.mark.parametrize(
    ("aggregation", "dialect", "answer"),
    [
        ("none", None, 4.540678438567827),
        ("none", "fuzzylite", 4.540678438567827),
        ("none", "pyfuzzylite", 6.09861228866811),
        ("Maximum", None, 4.7993293045378485),
        ("Maximum", "fuzzylite", 4.540678438567827),
        ("Maximum", "pyfuzzylite", 4.7993293045378485),
    ],
)
def test_two_rules_of_one_term_are_joined_as_in_the_named_engine_or_a_loss(
    aggregation: str, dialect: Dialect | None, answer: float
) -> None:
    text = TSUKAMOTO.replace("none", aggregation)
    reading = read_fll(text.encode(), "t.fll", dialect=dialect)
    assert isinstance(reading.model, FuzzySystem)
    found = infer(reading.model, {"a": 0.3, "c": 0.45}).outputs
    assert found == pytest.approx((answer,), rel=1e-12)
    what = {
        "none": "weighted one by one, as in fuzzylite 6; pyfuzzylite adds their "
        "degrees first",
        "Maximum": "joined by the aggregation, as in pyfuzzylite; fuzzylite 6 adds "
        "each",
    }[aggregation]
    loss = Loss(
        "output 'y'",
        f"rules that conclude the same term ('up') are {what}; pass --from "
        "fll:fuzzylite or --from fll:pyfuzzylite",
    )
    assert reading.losses == (() if dialect else (loss,))


def test_only_monotone_terms_are_inverted() -> None:
    ramp = Points((1.0, 3.0), (0.0, 1.0))
    assert output_of("Ramp 1 3", "WeightedAverage Tsukamoto").function == ramp
    assert output_of("Ramp 1 3", "WeightedAverage").function == ramp
    assert output_of("Discrete 1 0 3 1", "WeightedAverage").function != ramp


def test_mixing_numbers_and_monotone_terms_is_a_loss() -> None:
    lines = ["InputVariable: a", "OutputVariable: b", "defuzzifier: WeightedAverage"]
    text = "\n".join([*lines, "term: t Ramp 0 1", "term: u Constant 1"])
    reading = read_fll(with_rule(text, "b is t").encode(), "x.fll")
    assert [loss.where for loss in reading.losses] == ["output 'b'"]


MISTAKES = """\
Engne: x
InputVariable: a
  enabled: yes
  range: 0 1 2
  rang: 0 1
  term: low Triangel 0 1 2
  term: mid Triangle 0 1
  term: high Triangle 2 one 0 two
  term: odd Triangle 3 2 1
  term: big Constant 1e999
  term: sum Function a + dirt
InputVariable: a
OutputVariable: b
  aggregation: Maximun
  defuzzifier: Centroid 1
  default: inf
  term: x Linear 1 2 3 4 5
RuleBlock:
  conjunction: Minimun
  activation: First 1
  rule: if a is lo then b is x
  rule: if a is sum and then b is x
  rule: if c is low or (a is odds then b is y
  rule: if a is sum then a is sum and d is x with 2
  rule: a is sum
  rule: if a is sum then b is x with
nonsense
"""


def test_all_mistakes_are_reported_at_once_with_their_places_and_nearest_names() -> (
    None
):
    with pytest.raises(ReadError) as error:
        read_fll(MISTAKES.encode(), "m.fll")
    assert str(error.value).splitlines() == [
        "m.fll:1:1: no section 'Engne'; there is Engine, InputVariable, "
        "OutputVariable, RuleBlock (did you mean 'Engine'?)",
        "m.fll:3:12: enabled is true or false, not 'yes'",
        "m.fll:4:10: a range has 2 numbers, not 3",
        "m.fll:5:3: InputVariable has no key 'rang'; there is description, enabled, "
        "range, lock-range, term, Engine, InputVariable, OutputVariable, RuleBlock "
        "(did you mean 'range'?)",
        "m.fll:6:13: no term 'Triangel'; there is Constant, Discrete, Function, "
        "Linear, Triangle, Trapezoid, SShape, ZShape, Ramp, Rectangle, Binary, "
        "Arc, ... (did you mean 'Triangle'?)",
        "m.fll:7:13: Triangle takes 3 numbers, or 4 with the height, not 2",
        "m.fll:8:25: 'one' where a number must stand",
        "m.fll:8:31: 'two' where a number must stand",
        "m.fll:9:13: term 'odd' of 'a': the corners must be finite and rise: "
        "3.0, 2.0, 2.0, 1.0",
        "m.fll:10:22: '1e999' where a number must stand",
        "m.fll:11:26: no variable 'dirt'; there is a, b",
        "m.fll:12:16: a second variable 'a'",
        "m.fll:14:16: no aggregation 'Maximun'; there is Maximum, AlgebraicSum, "
        "BoundedSum, DrasticSum, EinsteinSum, HamacherSum, NilpotentMaximum, "
        "NormalizedSum, UnboundedSum, none (did you mean 'Maximum'?)",
        "m.fll:15:25: '1' where a whole number from 2 on must stand",
        "m.fll:16:12: a default cannot be infinite",
        "m.fll:17:11: Linear takes 2 weights, one for each input, and perhaps an "
        "offset, not 5",
        "m.fll:19:16: no conjunction 'Minimun'; there is Minimum, AlgebraicProduct, "
        "BoundedDifference, DrasticProduct, EinsteinProduct, HamacherProduct, "
        "NilpotentMinimum, none (did you mean 'Minimum'?)",
        "m.fll:20:15: First takes a number of rules and a threshold",
        "m.fll:21:17: 'a' has no term 'lo'; there is low, mid, high, odd, big, sum "
        "(did you mean 'low'?)",
        "m.fll:22:25: 'then' where a variable or '(' must stand",
        "m.fll:23:12: no variable 'c'; there is a, b",
        "m.fll:23:30: 'a' has no term 'odds'; there is low, mid, high, odd, big, sum "
        "(did you mean 'odd'?)",
        "m.fll:23:35: 'then' where 'and', 'or' or ')' must stand",
        "m.fll:24:26: no output 'a'; there is b",
        "m.fll:24:39: no output 'd'; there is b",
        "m.fll:24:51: the weight must lie in [0, 1], not 2",
        "m.fll:25:9: 'a' where 'if' must stand",
        "m.fll:26:37: the end where a weight must stand",
        "m.fll:27:1: 'nonsense' where 'key: value' must stand",
    ]


@pytest.mark.heavy
def test_at_most_a_hundred_mistakes_are_reported() -> None:
    with pytest.raises(ReadError) as error:
        read_fll(
            b"InputVariable: a\n" + b" term: t Triangle a b c d e\n" * 200_000, "m.fll"
        )
    assert len(str(error.value).splitlines()) <= 101


def test_names_are_cleaned_as_the_engines_do() -> None:
    lines = [
        *(
            "InputVariable: fore arm",
            "term: 1st.one Ramp 0 1",
            "OutputVariable: out put",
        ),
        *("defuzzifier: WeightedAverage", "term: big Constant 1", "RuleBlock:"),
        *("activation: General", "rule: if forearm is _1stone then output is big"),
    ]
    reading = read_fll("\n".join(lines).encode(), "names.fll")
    assert isinstance(reading.model, FuzzySystem)
    assert reading.model.inputs == ("forearm",)
    assert reading.model.rules[0].when == Proposition("forearm", ("1st.one",))
    assert reading.remarks == (
        "the name 'fore arm' is read as 'forearm', as the engines do",
        "the name 'out put' is read as 'output', as the engines do",
    )


DISABLED = """\
InputVariable: a
  term: low Ramp 1 0
InputVariable: b
  enabled: false
  term: low Ramp 1 0
OutputVariable: y
  defuzzifier: WeightedAverage
  default: -1
  term: one Constant 1
  term: two Constant 2
OutputVariable: z
  enabled: false
  term: one Constant 1
RuleBlock: first
  enabled: false
  rule: if a is low then y is two
RuleBlock: second
  conjunction: Minimum
  disjunction: Maximum
  activation: General
  rule: if b is not low or z is one then y is two
  rule: if a is low or b is low then y is one and z is one
  rule: if a is low then z is one
"""


def test_what_is_disabled_says_nothing_and_is_reported() -> None:
    reading = read_fll(DISABLED.encode(), "off.fll")
    system = reading.model
    assert isinstance(system, FuzzySystem)
    assert (len(system.rules), len(system.outputs)) == (2, 1)
    assert infer(system, {"a": 0.0, "b": 0.0}).outputs == (1.0,)
    assert infer(system, {"a": 2.0, "b": 0.0}).outputs == (-1.0,)
    assert reading.remarks == (
        "line 14: a disabled block is left out",
        "'b' is disabled: nothing concludes it, and it is nothing",
        "'z' is disabled: nothing concludes it, and it is nothing",
    )


def test_an_answer_that_is_remembered_is_a_loss() -> None:
    lines = ["InputVariable: a", "OutputVariable: y", "defuzzifier: WeightedSum"]
    text = "\n".join([*lines, "term: t Constant 1", "lock-previous: true"])
    found = read_fll(with_rule(text, "y is t").encode(), "l.fll")
    assert [one.where for one in found.losses] == ["output 'y'"]


def test_of_two_terms_with_one_name_the_second_counts_and_the_first_is_a_loss() -> None:
    lines = ["InputVariable: a", "OutputVariable: y", "defuzzifier: WeightedSum"]
    text = "\n".join([*lines, "term: t Constant 1", "term: t Constant 2"])
    reading = read_fll(with_rule(text, "y is t").encode(), "t.fll")
    assert isinstance(reading.model, FuzzySystem)
    assert reading.model.outputs[0].terms == (Term("t", Singleton(2.0)),)
    assert [one.where for one in reading.losses] == ["line 4"]


def test_a_file_of_latin_1_is_read_with_a_remark() -> None:
    text = TIPPER.replace("service", "qualité")
    found = read_fll(text.encode("latin-1"), "tipper.fll")
    assert found.model == read_fll(text.encode(), "tipper.fll").model
    assert found.remarks[0] == "the file is not UTF-8; read as Latin-1"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "x.fll:1:1: there is no OutputVariable that is enabled"),
        (
            b"\0",
            "x.fll:1:1: the character U+0000 is not allowed here; "
            "the file may be damaged",
        ),
        ("Engine: a".encode("utf-16"), "a file of UTF-16; it must be saved as UTF-8"),
        (b"a" * (33 * 2**20), "x.fll: 34,603,008 bytes are more than the 33,554,432"),
    ],
)
def test_what_is_no_text_file_is_reported_in_one_sentence(
    content: bytes, message: str
) -> None:
    with pytest.raises(ReadError) as error:
        read_fll(content, "x.fll")
    assert message in str(error.value)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.one_in(8)
@pytest.mark.parametrize(
    "line",
    [
        "rule: if " + "(" * 500_000 + "a is low",
        "rule: if a is " + "not " * 500_000 + "low then b is c",
        "rule: if " + "a is lo and " * 200_000 + "a is low then b is c",
        "rule: " + "x" * 2_000_000,
        "y" * 2_000_000,
        "z" * 1_000_000 + ": " + "z" * 1_000_000,
        "activation: " + "z" * 2_000_000,
        "\n".join(f"k{number}: 1" for number in range(200_000)),
        "\n" * 30_000_000,
        ("rule: if " + "(" * 200_000 + "\n") * 30,
        ("term: d Discrete " + "1 " * 100_000 + "\n") * 30,
        "#" * 30_000_000,
        "InputVariable: a\n" * 100_000,
        ("rule: if a is " + "lo or a is " * 5_000 + "low then b is c\n") * 100,
    ],
)
def test_hostile_lines_end_in_a_message_after_bounded_work(line: str) -> None:
    text = "InputVariable: a\nterm: low Ramp 0 1\nOutputVariable: b\nterm: c Ramp 0 1\n"
    with at_most(20_000_000), pytest.raises(ReadError) as error:
        read_fll(f"{text}defuzzifier: Centroid\nRuleBlock:\n{line}".encode(), "x.fll")
    assert len(str(error.value)) < 100_000


def test_a_damaged_file_is_refused_or_read_and_never_crashes() -> None:
    chance = random.Random(5)
    words = TIPPER.split()
    for _ in range(300):
        text = list(TIPPER)
        for _ in range(chance.randint(1, 4)):
            place = chance.randrange(len(text))
            change = chance.choice(["drop", "swap", "word"])
            if change == "drop":
                del text[place : place + chance.randint(1, 30)]
            elif change == "swap":
                text[place] = chance.choice("():#.\n -0x")
            else:
                text[place:place] = f" {chance.choice(words)} "
        try:
            read_fll("".join(text).encode(), "d.fll")
        except ReadError as error:
            message = str(error)
            assert all(line.startswith("d.fll:") for line in message.splitlines())


def test_a_constant_under_a_centroid_is_a_degree_and_a_remark_says_so() -> None:
    text = """Engine: tip
InputVariable: food
  range: 0 1
  term: good Ramp 0 1
OutputVariable: tip
  range: 0 1
  aggregation: Maximum
  defuzzifier: Centroid
  term: much Constant 0.9
RuleBlock: rules
  conjunction: Minimum
  disjunction: Maximum
  implication: Minimum
  activation: General
  rule: if food is good then tip is much
"""
    remark = (
        "term 'much' of 'tip' has the degree 0.9 everywhere, as in fuzzylite; to "
        "answer numbers, choose a weighted defuzzifier"
    )
    assert remark in read_fll(text.encode(), "tip.fll").remarks
