"""FCL files of all dialects as systems."""

from __future__ import annotations

import random

import pytest

from fuzzytree.errors import ReadError
from fuzzytree.formats import condition_sentence
from fuzzytree.formats.fcl.fcl_dialects import Dialect
from fuzzytree.formats.fcl.fcl_reader import read_fcl
from fuzzytree.model import (
    And,
    Bell,
    Call,
    Cosine,
    Curve,
    Defuzzifier,
    Formula,
    FuzzySystem,
    Gaussian,
    Name,
    Not,
    Number,
    Or,
    Proposition,
    SCurve,
    Sigmoid,
    SigmoidDifference,
    Singleton,
    Trapezoid,
    TwoGaussians,
)
from fuzzytree.model.contracts import Loss, Reading
from fuzzytree.model.rulebase import Points
from fuzzytree.semantics.inference import curve_degree, infer
from tests.work import at_most

STANDARD = """\
(* A file in the manner of the standard *)
FUNCTION_BLOCK Washer
  VAR_INPUT
    dirt, load : REAL;
  END_VAR
  VAR_OUTPUT minutes : REAL; END_VAR
  FUZZIFY dirt
    TERM little := (0, 1) (10, 0);
    TERM much := (0, 0)
                 (10, 1);
  END_FUZZIFY
  FUZZIFY load TERM full := (2, 0) (6, 1); END_FUZZIFY
  DEFUZZIFY minutes
    TERM short := 20; TERM long := 60;
    METHOD : COGS;
    DEFAULT := 5;
    RANGE := (0..90);
  END_DEFUZZIFY
  RULEBLOCK first
    AND: MIN;
    ACCU: MAX;
    RULE 1 : IF dirt IS little THEN minutes IS short;
    RULE 2 : IF dirt IS much AND
                load IS NOT full THEN minutes IS short;
    RULE 3 : IF (dirt IS much) AND load IS full THEN minutes IS long WITH 0.5;
  END_RULEBLOCK
END_FUNCTION_BLOCK
"""

FUZZYLITE = """\
//Code automatically generated with fuzzylite 6.0.
% another comment
FUNCTION_BLOCK dimmer of mine
VAR_INPUT
  light: REAL
END_VAR
VAR_OUTPUT
  power: REAL;
END_VAR
FUZZIFY light # a comment
  ENABLED : TRUE;
  RANGE := (0.000 .. inf);
  TERM dark := Triangle 0.000 0.250 0.500 0.75;
  TERM bright := ZShape 0.500 0.750;
END_FUZZIFY
DEFUZZIFY power
  RANGE := (0.000 .. 1.000);
  TERM low := (0.000, 0.000) (0.250, 1.000) (0.500, 0.000);
  TERM high := Gaussian 0.800 0.100;
  METHOD : COG;
  ACCU : ESUM;
  DEFAULT := nan | NC;
  LOCK : PREVIOUS | RANGE;
END_DEFUZZIFY
RULEBLOCK a
  AND : EPROD;
  ACT : PROD;
  RULE 1 : if light is very dark or light is not bright then power is high
  RULE x : if light is any then power is low with 0.5
END_RULEBLOCK
END_FUNCTION_BLOCK
"""

JFUZZYLOGIC = """\
/* A file in the manner of jFuzzyLogic */
FUNCTION_BLOCK tip   // what to give
VAR_INPUT
  food : REAL; RANGE := (0 .. 10);
END_VAR
VAR_OUTPUT tip : REAL; END_VAR
FUZZIFY food
  TERM bad := TRIAN 0 2 4;
  TERM fair := TRAPE 2 4 6 8;
  TERM good := SIGM 4 7;
END_FUZZIFY
DEFUZZIFY tip
  TERM small := GAUSS 5 1;
  TERM large := TRIAN 10 15 20;
  METHOD : COG;
  DEFAULT := 0;
END_DEFUZZIFY
RULEBLOCK No1
  OR : ASUM;
  RULE 1 : IF food IS bad OR food IS fair AND NOT food IS good THEN tip IS small;
  RULE 2 : IF NOT (food IS bad OR food IS fair) THEN tip IS large WITH 0.5;
END_RULEBLOCK
END_FUNCTION_BLOCK
FUNCTION_BLOCK other
END_FUNCTION_BLOCK
"""

PYIT2FLS = """\
FUNCTION_BLOCK fans
VAR_INPUT
    heat : REAL;
END_VAR
VAR_OUTPUT
    fan : REAL;
    vent : REAL;
END_VAR
FUZZIFY heat
    TERM cold := (0,1) (40,0);
    TERM hot := (30,0) (100,1);
END_FUZZIFY
DEFUZZIFY fan
    TERM slow := (0,1) (60,0);
    TERM fast := (40,0) (100,1);
    METHOD : COG;
    DEFAULT := 0;
END_DEFUZZIFY
DEFUZZIFY vent
    TERM open := (0,0) (1,1);
    METHOD : COG;
    DEFAULT := 0;
END_DEFUZZIFY
RULEBLOCK rules
    AND : MIN;
    ACT : MIN;
    ACCU : MAX;
    RULE 1 : IF heat IS cold THEN fan IS slow;
    RULE 2 : IF heat IS hot THEN (fan IS fast AND vent IS open);
END_RULEBLOCK
END_FUNCTION_BLOCK
"""


def _read(text: str) -> Reading:
    return read_fcl(text.encode(), "file.fcl")


def _system(text: str) -> FuzzySystem:
    model = _read(text).model
    assert isinstance(model, FuzzySystem)
    return model


def _mistakes(text: str) -> list[str]:
    with pytest.raises(ReadError) as caught:
        _read(text)
    return str(caught.value).splitlines()


@pytest.mark.parametrize("method", ["COGS", "COGF"])
@pytest.mark.parametrize(("accu", "minutes"), [("MAX", 8.0), ("SUM", 7.4)])
def test_accu_joins_the_rules_of_terms_with_one_number(
    method: str, accu: str, minutes: float
) -> None:
    text = STANDARD.replace(
        "TERM short := 20; TERM long := 60;",
        "TERM short := 5; TERM brief := 5; TERM long := 9;",
    )
    text = text.replace("METHOD : COGS", f"METHOD : {method}").replace("MAX", accu)
    rules = text.index("    RULE 1")
    text = (
        text[:rules]
        + """\
    RULE 1 : IF dirt IS little THEN minutes IS short;
    RULE 2 : IF dirt IS little THEN minutes IS brief;
    RULE 3 : IF dirt IS much THEN minutes IS long;
"""
        + text[text.index("  END_RULEBLOCK") :]
    )
    (found,) = infer(_system(text), {"dirt": 7.5, "load": 0.0}).outputs
    assert found == pytest.approx(minutes)


def test_a_file_in_the_manner_of_the_standard_is_read_over_several_lines() -> None:
    reading = _read(STANDARD)
    system = reading.model
    assert isinstance(system, FuzzySystem)
    assert system.name == "Washer"
    assert system.inputs == ("dirt", "load")
    assert system.variables[0].terms[1].function == Points((0.0, 10.0), (0.0, 1.0))
    minutes = system.outputs[0]
    assert minutes.terms[0].function == Singleton(20.0)
    assert (minutes.low, minutes.high, minutes.default) == (0.0, 90.0, 5.0)
    assert minutes.aggregation == "maximum"
    second, third = system.rules[1:]
    assert second.when == And(
        (Proposition("dirt", ("much",)), Proposition("load", ("full",), ("not",)))
    )
    assert third.weight == 0.5
    assert reading.losses == ()
    assert reading.remarks[0] == (
        "the dialect is IEC 61131-7: ACCU in RULEBLOCK (line 21), comments (* (line 1)"
        "; jFuzzyLogic would have ACCU in RULEBLOCK (line 21)"
    )


def test_accu_joins_the_numbers_of_one_term_as_the_standard_says() -> None:
    # short: max(0.5, min(0.5, 1 - 0.25)) = 0.5; long: 0.5 * min(0.5, 0.25) = 0.125
    answer = infer(_system(STANDARD), {"dirt": 5.0, "load": 3.0}).outputs
    assert answer == ((0.5 * 20 + 0.125 * 60) / 0.625,)


def test_numbers_are_summed_where_accu_is_missing() -> None:
    text = STANDARD.replace("    ACCU: MAX;\n", "")
    answer = infer(_system(text), {"dirt": 5.0, "load": 3.0}).outputs
    assert answer == ((1.0 * 20 + 0.125 * 60) / 1.125,)


def test_fuzzylite_sums_whatever_accu_says() -> None:
    text = STANDARD.replace("    ACCU: MAX;\n", "").replace(
        "METHOD : COGS;", "METHOD : COGS; ACCU : MAX;"
    )
    reading = _read(text)
    assert isinstance(reading.model, FuzzySystem)
    assert reading.model.outputs[0].aggregation is None
    assert any("fuzzylite ignores ACCU" in one for one in reading.remarks)


def test_a_file_of_fuzzylite_is_read_line_by_line() -> None:
    reading = _read(FUZZYLITE)
    system = reading.model
    assert isinstance(system, FuzzySystem)
    assert system.name == "dimmer of mine"
    dark, bright = system.variables[0].terms
    assert (dark.function, dark.height) == (Trapezoid(0.0, 0.25, 0.25, 0.5), 0.75)
    assert bright.function == SCurve(0.75, 0.5)
    assert (system.variables[0].low, system.variables[0].high) == (0.0, None)
    power = system.outputs[0]
    assert power.defuzzifier.samples == 100
    assert (power.aggregation, power.default) == ("einstein sum", None)
    assert power.clips
    block = system.blocks[0]
    assert (block.conjunction, block.disjunction) == (
        "einstein product",
        "einstein sum",
    )
    assert block.implication == "product"
    first, second = block.rules
    assert first.when == Or(
        (
            Proposition("light", ("dark",), ("very",)),
            Proposition("light", ("bright",), ("not",)),
        )
    )
    assert second.when == Proposition("light", (), ("any",))
    assert (second.weight, second.name) == (0.5, "x")


def test_the_dialect_is_reported_with_the_reasons() -> None:
    remark = _read(FUZZYLITE).remarks[0]
    assert remark.startswith("the dialect is fuzzylite: ")
    assert "the term class Triangle (line 13)" in remark
    assert "ENABLED (line 11)" in remark


def test_one_shape_of_jfuzzylogic_is_enough() -> None:
    text = STANDARD.replace("(2, 0) (6, 1)", "TRIAN 2 6 6")
    assert _read(text).remarks[0].startswith("the dialect is jFuzzyLogic: the shape")


def test_small_letters_alone_do_not_make_a_file_of_fuzzylite() -> None:
    reading = _read(STANDARD.replace(" IS ", " is ").replace("IF ", "if "))
    assert reading.model == _system(STANDARD)
    assert reading.remarks[0].startswith("the dialect is IEC 61131-7: ACCU in")
    assert "fuzzylite would have rules in lower case" in reading.remarks[0]


def test_a_comma_between_conclusions_is_that_of_the_standard() -> None:
    text = PYIT2FLS.replace(
        "(fan IS fast AND vent IS open)", "fan IS fast, vent IS open"
    )
    remark = _read(text).remarks[0]
    assert "conclusions with ',' (line 29)" in remark
    assert len(_system(text).rules[1].then) == 2


def test_what_is_kept_between_rows_is_a_loss() -> None:
    losses = [loss.what for loss in _read(FUZZYLITE).losses]
    assert losses == [
        "NC keeps the answer of the row before; here each row stands for itself",
        "LOCK keeps the answer of the row before; each row stands for itself",
    ]


def test_a_file_of_jfuzzylogic_is_read_with_its_shapes_and_defaults() -> None:
    reading = _read(JFUZZYLOGIC)
    system = reading.model
    assert isinstance(system, FuzzySystem)
    curves = [label.function for label in system.variables[0].terms]
    assert curves == [
        Trapezoid(0.0, 2.0, 2.0, 4.0),
        Trapezoid(2.0, 4.0, 6.0, 8.0),
        Sigmoid(7.0, 4.0),
    ]
    assert (system.variables[0].low, system.variables[0].high) == (0.0, 10.0)
    tip = system.outputs[0]
    assert (tip.low, tip.high) == (1.0, 20.0)  # 5 - 4 deviations, and 20
    assert tip.aggregation == "sum"
    assert tip.defuzzifier == Defuzzifier("centroid", 1000, "low ends")
    assert system.blocks[0].conjunction == "product"
    assert system.blocks[0].implication == "minimum"
    assert system.rules[1].when == Not(
        Or((Proposition("food", ("bad",)), Proposition("food", ("fair",))))
    )
    assert [loss.where for loss in reading.losses] == ["the other function blocks"]


def test_jfuzzylogic_samples_the_low_ends_of_a_thousand_pieces() -> None:
    text = JFUZZYLOGIC.replace("TRIAN 10 15 20", "(0, 0) (10, 1)")
    text = text.replace("IF NOT (food IS bad OR food IS fair)", "IF food IS good")
    text = text.replace(" WITH 0.5", "").replace("IF food IS bad", "IF food IS fair")
    text = text.replace("METHOD : COG;", "METHOD : COG; RANGE := (0 .. 10);")
    # One curve, x / 10, whole: sum(x x) / sum(x) of x = 0, 0.01 ... 9.99.
    (answer,) = infer(_system(text), {"food": 100.0}).outputs
    assert answer == pytest.approx(0.01 * (2 * 1000 - 1) / 3, rel=1e-13)


def test_jfuzzylogic_reads_and_and_or_from_left_to_right() -> None:
    reading = _read(JFUZZYLOGIC)
    assert (
        "line 20: a OR b AND c is read as (a OR b) AND c, as in jFuzzyLogic; the "
        "standard reads a OR (b AND c)"
    ) in reading.remarks
    first = reading.model
    assert isinstance(first, FuzzySystem)
    either = Or((Proposition("food", ("bad",)), Proposition("food", ("fair",))))
    assert first.rules[0].when == And((either, Not(Proposition("food", ("good",)))))


EITHER = """\
FUNCTION_BLOCK either
VAR_INPUT a : REAL; c : REAL; d : REAL; END_VAR
VAR_OUTPUT y : REAL; END_VAR
FUZZIFY a TERM p := (0, 0) (1, 1); END_FUZZIFY
FUZZIFY c TERM p := (0, 0) (1, 1); END_FUZZIFY
FUZZIFY d TERM p := (0, 0) (1, 1); TERM n := (0, 1) (1, 0); END_FUZZIFY
DEFUZZIFY y TERM hi := 100; TERM lo := 0; METHOD : COGS; DEFAULT := 0; END_DEFUZZIFY
RULEBLOCK one
  AND : MIN; ACCU : MAX;
  RULE 1 : IF a IS p OR c IS p AND d IS p THEN y IS hi;
  RULE 2 : IF d IS n THEN y IS lo;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""


@pytest.mark.parametrize(
    ("dialect", "answer"),
    [("jfuzzylogic", 20.0), ("iec", 90.0 / 1.7), (None, 90.0 / 1.7)],
)
def test_where_engines_read_a_rule_otherwise_only_a_named_one_is_no_loss(
    dialect: Dialect | None, answer: float
) -> None:
    reading = read_fcl(EITHER.encode(), "x.fcl", dialect=dialect)
    assert isinstance(reading.model, FuzzySystem)
    row = {"a": 0.9, "c": 0.1, "d": 0.2}
    assert infer(reading.model, row).outputs == pytest.approx((answer,))
    what = (
        "a OR b AND c is read as a OR (b AND c), as in the standard; jFuzzyLogic reads "
        "(a OR b) AND c; write parentheses, or pass --from fcl:iec or --from "
        "fcl:jfuzzylogic"
    )
    assert reading.losses == (() if dialect else (Loss("line 10", what),))


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        ("a IS p AND c IS p OR d IS p", "a and c or d"),
        ("a IS p OR c IS p OR d IS p AND a IS p", "(a or c or d) and a"),
        ("a IS p OR (c IS p OR d IS p) AND a IS p", "(a or (c or d)) and a"),
        ("a IS p AND (c IS p OR d IS p AND a IS p)", "a and ((c or d) and a)"),
    ],
)
def test_what_stands_left_is_joined_first_in_jfuzzylogic(
    rule: str, expected: str
) -> None:
    text = EITHER.replace("a IS p OR c IS p AND d IS p", rule)
    model = read_fcl(text.encode(), "x.fcl", dialect="jfuzzylogic").model
    assert isinstance(model, FuzzySystem)
    when = model.rules[0].when
    assert when is not None
    assert condition_sentence(when).replace(" is p", "") == expected


@pytest.mark.parametrize(
    ("lines", "dialect", "norms"),
    [
        ("AND : PROD; OR : MAX;", "jfuzzylogic", ("minimum", "maximum")),
        ("OR : MAX; AND : PROD;", "jfuzzylogic", ("product", "algebraic sum")),
        ("AND : MIN; OR : EINSTEIN;", None, ("hamacher product", "einstein sum")),
        ("AND : PROD; OR : MAX;", "iec", ("product", "maximum")),
    ],
)
def test_of_two_operators_that_are_no_partners_jfuzzylogic_takes_the_last(
    lines: str, dialect: Dialect | None, norms: tuple[str, str]
) -> None:
    text = EITHER.replace("AND : MIN;", lines)
    reading = read_fcl(text.encode(), "x.fcl", dialect=dialect)
    assert isinstance(reading.model, FuzzySystem)
    (block,) = reading.model.blocks
    assert (block.conjunction, block.disjunction) == norms
    assert reading.losses == ()


def test_operators_that_are_no_partners_are_a_loss_where_no_engine_is_named() -> None:
    text = EITHER.replace("AND : MIN;", "AND : PROD; OR : MAX;")
    assert _read(text).losses[-1] == Loss(
        "line 8",
        "AND and OR are no partners: both are taken, and jFuzzyLogic takes the last "
        "one and its partner; pass --from fcl:iec or --from fcl:jfuzzylogic",
    )


def test_a_missing_accu_is_a_loss_where_no_engine_is_named() -> None:
    text = PYIT2FLS.replace("    ACCU : MAX;\n", "")
    what = (
        "ACCU is missing: MAX is taken, and jFuzzyLogic takes SUM; pass --from fcl:iec "
        "or --from fcl:jfuzzylogic"
    )
    assert _read(text).losses == (
        Loss("output 'fan'", what),
        Loss("output 'vent'", what),
    )
    norms: dict[Dialect, str] = {"iec": "maximum", "jfuzzylogic": "sum"}
    for dialect, norm in norms.items():
        reading = read_fcl(text.encode(), "x.fcl", dialect=dialect)
        assert reading.losses == ()
        assert isinstance(reading.model, FuzzySystem)
        assert {one.aggregation for one in reading.model.outputs} == {norm}
    assert reading.remarks[0] == "the dialect is jFuzzyLogic: as it is asked for"


def test_a_coa_of_jfuzzylogic_that_is_another_one_is_a_remark() -> None:
    text = JFUZZYLOGIC.replace("METHOD : COG;", "METHOD : COA;")
    assert (
        "output 'tip': 1000 values of its range are looked at (low ends); its COA adds "
        "areas from both ends, and can end at another value"
    ) in _read(text).remarks


def test_a_file_of_pyit2fls_is_written_again_in_the_dialect_that_it_reads() -> None:
    assert _read(PYIT2FLS).dialect == "fcl:iec"


def test_a_file_of_pyit2fls_is_read_with_its_hundred_values() -> None:
    reading = _read(PYIT2FLS)
    assert isinstance(reading.model, FuzzySystem)
    assert reading.remarks[0].startswith("the dialect is PyIT2FLS: conclusions with")
    fan = reading.model.outputs[0]
    assert (fan.defuzzifier.samples, fan.defuzzifier.grid) == (100, "ends")
    assert (fan.low, fan.high) == (0.0, 100.0)
    assert len(reading.model.rules[1].then) == 2


@pytest.mark.parametrize(
    ("text", "curve"),
    [
        ("TRIAN 1 2 4", Trapezoid(1.0, 2.0, 2.0, 4.0)),
        ("trape 1 2 3 4", Trapezoid(1.0, 2.0, 3.0, 4.0)),
        ("GAUSS 5 2", Gaussian(5.0, 2.0)),
        ("GAUSS2 5 2 6 3", TwoGaussians(5.0, 2.0, 6.0, 3.0)),
        ("GBELL 2 4 30", Bell(30.0, 2.0, 4.0)),
        ("SIGM -4 3", Sigmoid(3.0, -4.0)),
        ("DSIGM 2 1 2 5", SigmoidDifference(Sigmoid(1.0, 2.0), Sigmoid(5.0, 2.0))),
        ("COSINE 2 5", Cosine(5.0, 4.0)),
        ("Cosine 5 2", Cosine(5.0, 2.0)),
        (
            "Function min(1, 0.5)",
            Formula(Call("min", (Number(1.0), Number(0.5)))),
        ),
        ("Discrete (0, 1) (2, 0)", Points((0.0, 2.0), (1.0, 0.0))),
        ("7.5", Singleton(7.5)),
        ("(.5, 0) (5., 1)", Points((0.5, 5.0), (0.0, 1.0))),
        ("(-1e-5, 0)\n(1E3,1.0)", Points((-1e-05, 1000.0), (0.0, 1.0))),
    ],
)
def test_a_curve_is_read(text: str, curve: Curve) -> None:
    given = STANDARD.replace("(2, 0) (6, 1)", text)
    assert _system(given).variables[1].terms[0].function == curve


def test_functions_of_jfuzzylogic_are_written_in_capitals_and_log_is_to_ten() -> None:
    text = STANDARD.replace(
        "TERM short := 20;", "TERM short := FUNCTION LOG(dirt) + 2;"
    )
    assert _system(text).outputs[0].terms[0].function == Formula(
        Call("+", (Call("log10", (Name("dirt"),)), Number(2.0)))
    )


@pytest.mark.parametrize(
    ("formula", "at_minus_7"),
    [
        ("2 ^ 3 ^ 2", 64.0),  # from the left
        ("-2 ^ 2", 4.0),  # the sign belongs to the number
        ("10 * 7 % 4", 30.0),  # % binds more closely than *
        ("2 ^ 3 % 5", 3.0),
        ("dirt % 4", -3.0),  # the sign of the first, as in Java
    ],
)
def test_a_function_binds_its_operators_as_jfuzzylogic_does(
    formula: str, at_minus_7: float
) -> None:
    text = STANDARD.replace("TERM short := 20;", f"TERM short := FUNCTION {formula};")
    answer = infer(_system(text), {"dirt": -7.0, "load": 9.0}).outputs[0]
    assert answer == at_minus_7


def test_a_curve_that_spans_no_range_demands_one() -> None:
    text = JFUZZYLOGIC.replace("TRIAN 10 15 20", "DSIGM -3 12 -1 18")
    assert _mistakes(text) == [
        "file.fcl:6:12: output 'tip' needs a RANGE for its METHOD"
    ]
    with_range = text.replace("METHOD : COG;", "METHOD : COG; RANGE := (0 .. 30);")
    assert _system(with_range).outputs[0].high == 30.0


def test_a_block_without_accu_sums_in_jfuzzylogic_beside_one_that_says_it() -> None:
    first, rest = JFUZZYLOGIC.split("  OR : ASUM;")
    other = "RULEBLOCK No2 ACCU : MAX; RULE 1 : IF food IS bad THEN tip IS large; "
    text = f"{first}  OR : ASUM;{rest}".replace(
        "END_RULEBLOCK", f"END_RULEBLOCK {other} END_RULEBLOCK", 1
    )
    reading = _read(text)
    assert isinstance(reading.model, FuzzySystem)
    assert reading.model.outputs[0].aggregation == "sum"
    what = "its blocks say different ACCU; sum is taken for all rules"
    assert Loss("output 'tip'", what) in reading.losses


def test_a_step_beside_a_sample_that_jfuzzylogic_adds_up_is_a_loss() -> None:
    # 500 times 0.002 added to -1 ends above 0, and -1 + 500 * 0.002 is 0.
    text = JFUZZYLOGIC.replace("GAUSS 5 1", "TRIAN -0.5 0 0")
    text = text.replace("TRIAN 10 15 20", "TRAPE -1 -1 1 1")
    (_, loss) = _read(text).losses
    assert loss.where == "term 'small' of 'tip'"
    assert loss.what == (
        "it jumps between 0.0 and 8.743006318923108e-16, where jFuzzyLogic looks, "
        "which adds up steps; a side with some width is safe"
    )
    wide = text.replace("TRIAN -0.5 0 0", "TRIAN -0.5 0 0.1")
    assert len(_read(wide).losses) == 1  # the other function block


def test_a_difference_of_sigmoids_is_cut_off_at_0_as_in_jfuzzylogic() -> None:
    reading = _read(STANDARD.replace("(2, 0) (6, 1)", "DSIGM 2 5 2 1"))
    assert reading.losses == ()
    assert isinstance(reading.model, FuzzySystem)
    (term,) = reading.model.variables[1].terms
    assert curve_degree(term.function, 3.0) == 0.0


def test_a_missing_operator_comes_with_its_partner() -> None:
    text = STANDARD.replace("AND: MIN;", "OR: BSUM;")
    assert _system(text).blocks[0].conjunction == "bounded difference"


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_end_as_three_systems_end_them(end: str) -> None:
    assert _system(STANDARD.replace("\n", end)) == _system(STANDARD)
    assert _system(FUZZYLITE.replace("\n", end)) == _system(FUZZYLITE)


@pytest.mark.parametrize("mark", ["\x0b", "\x0c", "\x85", "\u2028", "\u2029"])
def test_only_cr_and_lf_end_a_comment(mark: str) -> None:
    hidden = f"// what to give{mark}; END_VAR"
    text = JFUZZYLOGIC.replace("// what to give", hidden)
    assert _system(text) == _system(JFUZZYLOGIC)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16"])
def test_other_encodings_are_read(encoding: str) -> None:
    text = STANDARD.replace("A file", "Un fichier français")
    reading = read_fcl(text.encode(encoding), "file.fcl")
    assert reading.model == _system(STANDARD)
    has_remark = any("not UTF-8; read as" in one for one in reading.remarks)
    assert has_remark == (encoding in ("latin-1", "utf-16"))


def test_every_mistake_of_a_file_is_reported_with_its_place() -> None:
    text = """\
FUNCTION_BLOCK f
VAR_INPUT a : REAL; b : REAL; END_VAR
VAR_OUTPUT y : REAL; END_VAR
FUZZIFY a
  TREM low := (0, 1) (1, 0);
  TERM low := (0, 1) (1, 0);
  TERM high (0, 0) (1, 1);
  TERM odd := TRIANGEL 0 1 2;
  TERM back := (2, 0) (1, 1);
END_FUZZIFY
DEFUZZIFY y
  TERM one := 1;
  METHOD : COGZ;
  DEFAULT := 0;
END_DEFUZZIFY
RULEBLOCK r
  AND : MNI;
  RULE 1 : IF a IS lwo THEN y IS one;
  RULE 2 : IF aa IS low THNE y IS one;
  RULE 3 : IF bb IS low THEN y IS two;
  RULE 4 : IF (a IS low THEN y IS one;
  RULE 5 : IF a IS low THEN y IS one WITH 2;
END_RULEBLOCK
"""
    assert _mistakes(text) == [
        "file.fcl:5:3: found 'TREM', with which no statement begins "
        "(did you mean 'TERM'?)",
        "file.fcl:7:13: found '(0, 0)'; expected ':='",
        "file.fcl:8:15: no shape 'TRIANGEL'; there is FUNCTION, TRIAN, TRAPE, GBELL, "
        "GAUSS, SIGM, DSIGM, GAUSS2, COSINE, Constant, Discrete, Function, ... "
        "(did you mean 'TRIAN'?)",
        "file.fcl:9:17: term 'back' of 'a': the values of points must not decrease: "
        "1.0 stands behind 2.0",
        "file.fcl:13:12: no method 'COGZ'; there is COG, COA, BIS, LM, SOM, RM, "
        "LOM, MM, MOM, COGS, COGF, COGSS, ... (did you mean 'COG'?)",
        "file.fcl:17:9: no AND 'MNI'; there is MIN, PROD, BDIF, DPROD, DMIN, EPROD, "
        "HPROD, HAMACHER, NMIN, NIPMIN, MINIMUM, ALGEBRAICPRODUCT, ... "
        "(did you mean 'MIN'?)",
        "file.fcl:18:20: 'a' has no term 'lwo'; there is low, odd, back "
        "(did you mean 'low'?)",
        "file.fcl:19:25: found 'THNE' before 'IS' (did you mean 'THEN'?)",
        "file.fcl:20:15: no variable 'bb'; there is a, b, y (did you mean 'b'?)",
        "file.fcl:20:35: 'y' has no term 'two'; there is one",
        "file.fcl:21:25: found 'THEN'; expected ')'",
        "file.fcl:22:43: the weight must lie in [0, 1], not 2",
    ]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("END_VAR\n  VAR_OUT", "\n  VAR_OUT", "found 'VAR_OUTPUT'; expected END_VAR"),
        (
            "FUZZIFY load",
            "FUZZIFY minutes",
            "no variable 'minutes' in VAR_INPUT; it is an output, whose terms stand in "
            "DEFUZZIFY",
        ),
        ("FUZZIFY load", "FUZZIFY lod", "no variable 'lod' in VAR_INPUT"),
        ("METHOD : COGS", "METHOD : COG", "a number has no area"),
        ("TERM long := 60", "TERM long := (1, 0)", "a curve where METHOD needs"),
        ("(2, 0) (6, 1)", "(low, 0) (6, 1)", "'low' where a number must stand"),
        ("(2, 0) (6, 1)", "SINGLETONS (2, 1)", "no shape 'SINGLETONS'"),
        ("(2, 0) (6, 1)", "TRIAN 1 2", "TRIAN takes 3 numbers, not 2"),
        ("(0..90)", "(90..0)", "the range ends below its start"),
        ("DEFAULT := 5", "DEFAULT := five", "found 'five'; expected a number or NC"),
        ("ACCU: MAX;", "ACCU: MAX; ACCU: BSUM;", "a second ACCU in one block"),
        ("(* A file", "(* (* A file", ""),
        ("manner of the standard *)", "manner", "the comment (* is never closed"),
        ("FUNCTION_BLOCK Washer", "", "the file has no FUNCTION_BLOCK"),
        ("AND: MIN;", "AND: MIN; METHOD : COG;", "METHOD cannot stand in RULEBLOCK"),
        ("TERM much", "TERM little", "a second term 'little'"),
        ("AND: MIN;", "AND: MIN; §;", "has no meaning here"),
    ],
)
def test_a_mistake_is_reported(old: str, new: str, expected: str) -> None:
    text = STANDARD.replace(old, new, 1)
    if not expected:
        assert _system(text) == _system(STANDARD)
        return
    assert expected in "\n".join(_mistakes(text))


def test_an_unknown_type_is_a_loss() -> None:
    (loss,) = _read(STANDARD.replace("load : REAL", "load : INT")).losses
    assert loss.what == "the type INT is read as REAL, without rounding"


def test_an_output_in_an_antecedent_is_a_loss_outside_of_fuzzylite() -> None:
    text = STANDARD.replace("IF dirt IS little", "IF minutes IS long")
    assert [loss.where for loss in _read(text).losses] == ["output 'minutes'"]


@pytest.mark.heavy
@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x00\x01",
        b"\xff\xfe\x00",
        b"(" * 1_000_000,
        b"(*" * 1_000_000,
        b";" * 1_000_000,
        b"FUNCTION_BLOCK " * 100_000,
        b"FUNCTION_BLOCK f\nRULEBLOCK r\nRULE 1 : IF " + b"(" * 100_000,
        b"FUNCTION_BLOCK f\nRULEBLOCK r\nRULE 1 : IF " + b"NOT " * 100_000,
        b"FUNCTION_BLOCK f\nVAR_INPUT\n" + b"x : REAL;\n" * 50_000,
        b"FUNCTION_BLOCK f\nFUZZIFY x\nTERM a := " + b"(0, 1) " * 40_000,
        b"9" * 1_000_000,
        b"x" * 5_000_000,
        b"x " * 9_000_000,
        b"//" * 1_000_000,
        b"\n" * 1_000_000,
        b" " * 4_000_000,
        b"FUNCTION_BLOCK f\nVAR_INPUT\n"
        + b"".join(b"x%d : REAL;\n" % k for k in range(900))
        + b"END_VAR\nRULEBLOCK r\n"
        + b"RULE 1 : IF xx9 IS b THEN c IS d;\n" * 15_000,
    ],
    ids=range(18),
)
def test_hostile_files_end_in_a_short_error_after_bounded_work(
    content: bytes,
) -> None:
    # it would be 50 times as much if it grew with the square
    with at_most(25_000_000), pytest.raises(ReadError) as caught:
        read_fcl(content, "file.fcl")
    assert len(str(caught.value)) < 40_000


def _error(text: str) -> str | None:
    try:
        read_fcl(text.encode(), "file.fcl")
    except ReadError as error:
        return str(error)
    return None


@pytest.mark.one_in(4)
@pytest.mark.parametrize("text", [STANDARD, FUZZYLITE, JFUZZYLOGIC, PYIT2FLS])
def test_a_damaged_file_is_read_or_refused_with_a_reason(text: str) -> None:
    chance = random.Random(7)
    words = text.split(" ")
    for _ in range(150):
        damaged = list(words)
        for _ in range(chance.randint(1, 3)):
            place = chance.randrange(len(damaged))
            match chance.randrange(4):
                case 0:
                    del damaged[place]
                case 1:
                    damaged[place] = chance.choice(words)
                case 2:
                    damaged[place] += chance.choice(";()=:.,-%'\"{}\x00é")
                case _:
                    damaged.insert(place, chance.choice(words))
        error = _error(" ".join(damaged))
        assert error is None or error.startswith("file.fcl:")


def test_a_word_that_is_longer_than_any_name_is_a_mistake() -> None:
    text = f"FUNCTION_BLOCK {'n' * 1001}\nEND_FUNCTION_BLOCK\n".encode()
    with pytest.raises(ReadError, match=r"fcl:1:16: a word of more than 1000"):
        read_fcl(text, "x.fcl")


def test_a_number_that_fuzzylite_takes_for_a_degree_is_a_remark() -> None:
    text = """FUNCTION_BLOCK tip
VAR_INPUT food : REAL; END_VAR
VAR_OUTPUT tip : REAL; END_VAR
FUZZIFY food
    TERM good := (0,0) (1,1);
END_FUZZIFY
DEFUZZIFY tip
    RANGE := (0 .. 1);
    TERM much := 0.9;
    METHOD : COG;
    ACCU : MAX;
    DEFAULT := 0;
END_DEFUZZIFY
RULEBLOCK rules
    AND : MIN;
    ACT : MIN;
    RULE 1 : IF food IS good THEN tip IS much;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""
    remark = (
        "term 'much' of 'tip' has the degree 0.9 everywhere, as in fuzzylite; to "
        "answer numbers, choose a weighted defuzzifier"
    )
    assert remark in _read(text).remarks
