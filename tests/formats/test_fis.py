"""Reading FIS: dialects, meanings, and every mistake at its place."""

from __future__ import annotations

import math

import pytest

from fuzzytree.errors import ReadError
from fuzzytree.formats.fis.fis_reader import read_fis
from fuzzytree.formats.fis.fis_words import FIS_KINDS, Dialect, curve_of
from fuzzytree.formats.shapes import FAR
from fuzzytree.model import (
    And,
    Bell,
    Binary,
    Concave,
    Conclusion,
    Cosine,
    Curve,
    Defuzzifier,
    Formula,
    FuzzySystem,
    Gaussian,
    Linear,
    Or,
    PiCurve,
    Points,
    Proposition,
    SCurve,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    Spike,
    Trapezoid,
    TwoGaussians,
)
from fuzzytree.semantics.inference import curve_degree, infer
from fuzzytree.semantics.reference import Status
from tests.work import at_most

SUGENO = """\
% a comment
[System]
Name='tip'
Type='sugeno'
Version=2.0
NumInputs=2
NumOutputs=1
NumRules=2
AndMethod='prod'
OrMethod='probor'
ImpMethod='prod'
AggMethod='sum'
DefuzzMethod='wtaver'

[Input1]
Name='food'
Range=[0 10]
NumMFs=2
MF1='bad':'trapmf',[-1 0 2 4]
MF2='good':'linsmf',[2 4]

[Input2]
Name='service'
Range=[0 10]
NumMFs=1
MF1='slow':'zmf',[3 6]

[Output1]
Name='tip %'
Range=[0 30]
NumMFs=2
MF1='small':'constant',[5]
MF2='fair':'linear',[1 0.5 2]

[Rules]
1 1, 1 (1) : 1
2 -1, 2 (0.5) : 2
"""


def read(text: str, dialect: Dialect | None = None) -> FuzzySystem:
    model = read_fis(text.encode(), "tip.fis", dialect=dialect).model
    assert isinstance(model, FuzzySystem)
    return model


@pytest.mark.parametrize("mark", ["\x85", "\u2028", "\u2029"])
def test_only_cr_and_lf_end_a_comment(mark: str) -> None:
    hidden = f"% a comment{mark}[Output2]"
    assert read(SUGENO.replace("% a comment", hidden)) == read(SUGENO)


def test_a_sugeno_system_is_read_whole() -> None:
    system = read(SUGENO)
    assert system.inputs == ("food", "service")
    assert system.variables[0].terms[0].function == Trapezoid(-1.0, 0.0, 2.0, 4.0)
    assert system.variables[1].terms[0].function == SCurve(6.0, 3.0)
    (output,) = system.outputs
    assert output.terms[1].function == Linear((1.0, 0.5), 2.0)
    assert output.defuzzifier == Defuzzifier("weighted average")
    assert output.aggregation is None
    (block,) = system.blocks
    assert (block.conjunction, block.disjunction) == ("product", "algebraic sum")
    first, second = block.rules
    assert first.when == And(
        (Proposition("food", ("bad",)), Proposition("service", ("slow",)))
    )
    assert second.when == Or(
        (Proposition("food", ("good",)), Proposition("service", ("slow",), ("not",)))
    )
    assert second.weight == 0.5
    assert infer(system, {"food": 0.0, "service": 0.0}).outputs == (5.0,)


@pytest.mark.parametrize("end", ["\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_line_ends_and_encodings_change_nothing(end: str, encoding: str) -> None:
    text = SUGENO.replace("a comment", "façade").replace("\n", end)
    assert read_fis(text.encode(encoding), "tip.fis").model == read(SUGENO)


def test_sections_and_terms_may_stand_in_any_order() -> None:
    head, *parts = SUGENO.split("\n[")
    turned = "\n[".join([head, *reversed(parts)]) + "\n"
    swapped = turned.replace("MF1='small'", "MF3").replace(
        "MF2='fair':'linear',[1 0.5 2]\n",
        "MF2='fair':'linear',[1 0.5 2]\nMF1='small':'constant',[5]\n",
    )
    swapped = swapped.replace("MF3:'constant',[5]\n", "")
    assert read(swapped) == read(SUGENO)


@pytest.mark.parametrize(
    ("kind", "numbers", "curve"),
    [
        ("trimf", (1, 2, 4), Trapezoid(1.0, 2.0, 2.0, 4.0)),
        ("trapmf", (1, 1, 2, 4), Trapezoid(1.0, 1.0, 2.0, 4.0)),
        ("trapmf", (-2 * FAR, -FAR, 2, 4), Trapezoid(None, 2.0, 2.0, 4.0)),
        ("trapmf", (1, 2, FAR, 2 * FAR), Trapezoid(1.0, 2.0, 2.0, None)),
        ("trapmf", (-float("inf"), -float("inf"), 2, 4), Trapezoid(None, 2, 2, 4)),
        ("linzmf", (1, 2), Points((1.0, 2.0), (1.0, 0.0))),
        ("linsmf", (1, 2), Points((1.0, 2.0), (0.0, 1.0))),
        ("gaussmf", (-2, 3), Gaussian(3.0, 2.0)),
        ("gauss2mf", (1, 2, 3, 4), TwoGaussians(2.0, 1.0, 4.0, 3.0)),
        ("gbellmf", (2, 3, 4), Bell(4.0, 2.0, 3.0)),
        ("sigmf", (2, 3), Sigmoid(3.0, 2.0)),
        ("dsigmf", (1, 2, 3, 4), SigmoidDifference(Sigmoid(2, 1), Sigmoid(4, 3))),
        ("psigmf", (1, 2, 3, 4), SigmoidProduct(Sigmoid(2, 1), Sigmoid(4, 3))),
        ("smf", (1, 2), SCurve(1.0, 2.0)),
        ("smf", (2, 2), Binary(2.0)),
        ("zmf", (1, 2), SCurve(2.0, 1.0)),
        ("zmf", (2, 2), Binary(2.0, is_above=False)),
        ("pimf", (1, 2, 3, 4), PiCurve(1.0, 2.0, 3.0, 4.0)),
        ("rampmf", (4, 1), Points((1.0, 4.0), (1.0, 0.0))),
        ("rectmf", (1, 2), Trapezoid(1.0, 1.0, 2.0, 2.0)),
        ("cosinemf", (1, 2), Cosine(1.0, 2.0)),
        ("spikemf", (1, 2), Spike(1.0, 2.0)),
        ("concavemf", (1, 2), Concave(1.0, 2.0)),
        ("binarymf", (1, -float("inf")), Binary(1.0, is_above=False)),
        ("discretemf", (1, 0, 2, 1), Points((1.0, 2.0), (0.0, 1.0))),
    ],
)
def test_every_kind_of_curve(
    kind: str, numbers: tuple[float, ...], curve: Curve
) -> None:
    assert curve_of(kind, [*map(float, numbers)]) == curve
    assert kind in FIS_KINDS or kind == "discretemf"


@pytest.mark.parametrize(
    ("dialect", "text", "curve"),
    [
        ("matlab", "smf 3 1", Binary(2.0)),
        ("matlab", "zmf 3 1", Binary(2.0, is_above=False)),
        ("matlab", "linsmf 2 2", Binary(2.0)),
        ("matlab", "linzmf 2 2", Binary(math.nextafter(2.0, 0.0), is_above=False)),
        ("octave", "smf 3 1", "Octave takes no curve from 3.0 to 1.0"),
        ("matlab", "linsmf 3 1", "the line ends at 1.0, before its start 3.0"),
        ("fuzzylite", "smf 3 1", Points((3.0, 3.0), (0.0, 1.0))),
        ("fuzzylite", "zmf 3 1", Points((3.0, 3.0), (1.0, 0.0))),
        ("fuzzylite", "rectmf 3 1", Trapezoid(1.0, 1.0, 3.0, 3.0)),
        ("octave", "dsigmf 1 2 1 4", SigmoidDifference(Sigmoid(2, 1), Sigmoid(4, 1))),
    ],
)
def test_numbers_out_of_order_mean_what_the_engine_makes_of_them(
    dialect: Dialect, text: str, curve: Curve | str
) -> None:
    kind, *numbers = text.split()
    assert curve_of(kind, [*map(float, numbers)], dialect) == curve


def test_octave_cuts_a_difference_of_sigmoids_off_at_0() -> None:
    numbers = [2.0, 5.0, 2.0, 1.0]
    octave, matlab = (curve_of("dsigmf", numbers, d) for d in ("octave", "matlab"))
    assert isinstance(octave, Formula)
    assert isinstance(matlab, SigmoidDifference)
    assert curve_degree(octave, 3.0) == 0.0
    assert curve_degree(matlab, 3.0) == pytest.approx(0.964, abs=1e-3)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("'zmf',[3 6]", "'zmf',[3 6 0.5]"),
        ("'trapmf',[-1 0 2 4]", "'trapmf',[-1 0 2 4 0.5]"),
        ("'trapmf',[-1 0 2 4]", "'discretemf',[0 1 2 0 0.5]"),
    ],
)
def test_one_number_more_is_a_height_of_fuzzylite_and_refused_elsewhere(
    old: str, new: str
) -> None:
    text = SUGENO.replace("a comment", "from fuzzylite").replace(old, new)
    inputs = read(text).variables
    heights = [term.height for one in inputs for term in one.terms]
    assert sorted(heights) == [0.5, 1.0, 1.0]
    if "discretemf" in new:  # only fuzzylite has it
        return
    with pytest.raises(ReadError) as caught:
        read(text, "matlab")
    assert str(caught.value).endswith(
        "; one more is a height in fuzzylite's files (--from fis:fuzzylite)"
    )


def test_a_height_above_1_is_refused_with_its_place() -> None:
    text = SUGENO.replace("a comment", "from fuzzylite").replace("[3 6]", "[3 6 7]")
    with pytest.raises(ReadError) as caught:
        read(text)
    assert str(caught.value) == (
        "tip.fis:26:5: term 'slow' of 'service': the height must lie in (0, 1], not 7.0"
    )


HEDGED = SUGENO.replace("1 1, 1 (1) : 1", "1.30 -1.20, 1.30 (1) : 1")


def test_hundredths_are_hedges_and_mean_other_things_in_octave_and_fuzzylite() -> None:
    octave, fuzzylite = read(HEDGED), read(HEDGED, "fuzzylite")
    rules = octave.rules[0], fuzzylite.rules[0]
    assert rules[0].when == And(
        (
            Proposition("food", ("bad",), ("cubed",)),
            Proposition("service", ("slow",), ("not", "very")),
        )
    )
    assert rules[0].then == (Conclusion("tip %", "small", ("cube root",)),)
    assert rules[1].when == And(
        (
            Proposition("food", ("bad",), ("extremely",)),
            Proposition("service", ("slow",), ("not", "very")),
        )
    )
    assert rules[1].then == (Conclusion("tip %", "small", ("extremely",)),)


@pytest.mark.parametrize(
    ("change", "remark"),
    [
        (("", ""), "read as matlab's: nothing says otherwise"),
        (
            ("a comment", "dialect: octave"),
            "read as octave's: the file says that it is",
        ),
        (("a comment", "by fuzzylite 6"), "read as fuzzylite's: a comment names it"),
        (
            ("'prod'\nOr", "'einstein_product'\nOr"),
            "read as octave's: 'einstein_product' in line 9 is no word of MATLAB",
        ),
        (
            ("NumMFs=1\n", "NumMFs=1\nEnabled=1\n"),
            "read as fuzzylite's: Enabled in line 26 is only fuzzylite's",
        ),
        (("2 -1, 2", "2.2 -1, 2"), "read as octave's: line 37 has hedges, which"),
    ],
)
def test_the_dialect_is_detected_and_reported(
    change: tuple[str, str], remark: str
) -> None:
    text = SUGENO.replace(*change, 1) if change[0] else SUGENO
    assert read_fis(text.encode(), "tip.fis").remarks[0].startswith(remark)


def test_octave_joins_the_rules_of_a_term_and_matlab_sums_them() -> None:
    text = SUGENO.replace("AggMethod='sum'", "AggMethod='max'").replace(
        "2 -1, 2 (0.5) : 2", "2 -1, 1 (0.5) : 2"
    )
    assert read(text, "octave").outputs[0].aggregation == "maximum"
    found = read_fis(text.encode(), "tip.fis", dialect="matlab")
    assert isinstance(found.model, FuzzySystem)
    assert found.model.outputs[0].aggregation is None


@pytest.mark.parametrize(
    ("dialect", "answer"),
    [("matlab", 15.0), ("octave", math.nan), ("fuzzylite", math.nan)],
)
@pytest.mark.parametrize("is_mamdani", [False, True])
def test_where_no_rule_fires_matlab_answers_the_middle_of_the_range(
    is_mamdani: bool, dialect: Dialect, answer: float
) -> None:
    text = SUGENO.replace("2 -1, 2 (0.5)", "2 1, 2 (0.5)").replace(" : 2\n", " : 1\n")
    if is_mamdani:
        text = text.replace("sugeno", "mamdani").replace("wtaver", "centroid")
        text = text.replace("'constant',[5]", "'trimf',[0 5 9]")
        text = text.replace("'linear',[1 0.5 2]", "'trimf',[5 9 30]")
    found = read_fis(text.encode(), "tip.fis", dialect=dialect)
    assert isinstance(found.model, FuzzySystem)
    inferred = infer(found.model, {"food": 5.0, "service": 9.0})
    assert inferred.status is Status.UNCOVERED
    assert repr(inferred.outputs) == repr((answer,))
    remark = "where no rule fires, an output is the middle of its range, as in MATLAB"
    assert (remark in found.remarks) == (dialect == "matlab")


@pytest.mark.parametrize(("dialect", "tip"), [("octave", 8.0), ("matlab", 7.4)])
def test_octave_joins_the_rules_of_terms_with_one_number(
    dialect: Dialect, tip: float
) -> None:
    text = SUGENO.replace("AggMethod='sum'", "AggMethod='max'")
    for old, new in (
        ("NumMFs=2\nMF1='small'", "NumMFs=3\nMF1='small'"),
        ("'linear',[1 0.5 2]", "'constant',[5]\nMF3='big':'constant',[9]"),
        ("NumRules=2", "NumRules=3"),
        ("'trapmf',[-1 0 2 4]", "'trapmf',[-1 0 0 10]"),
        ("'linsmf',[2 4]", "'linsmf',[0 10]"),
        ("1 1, 1 (1)", "1 0, 1 (1) : 1\n1 0, 2 (1)"),
        ("2 -1, 2 (0.5) : 2", "2 0, 3 (1) : 1"),
    ):
        text = text.replace(old, new)
    found = read_fis(text.encode(), "tip.fis", dialect=dialect)
    assert isinstance(found.model, FuzzySystem)
    assert found.losses == ()
    (number,) = infer(found.model, {"food": 7.5, "service": 0.0}).outputs
    assert number == pytest.approx(tip)


def test_samples_are_the_dialects() -> None:
    text = SUGENO.replace("sugeno", "mamdani").replace("wtaver", "centroid")
    text = text.replace("'constant',[5]", "'trimf',[0 5 9]").replace(
        "'linear',[1 0.5 2]", "'trimf',[5 9 30]"
    )
    grids = {
        dialect: read(text, dialect).outputs[0].defuzzifier.grid
        for dialect in ("matlab", "octave", "fuzzylite")
    }
    assert grids == {"matlab": "ends", "octave": "half ends", "fuzzylite": "middle"}
    assert read(text).blocks[0].implication == "product"
    assert read(text).outputs[0].aggregation == "sum"


@pytest.mark.parametrize("dialect", ["matlab", "octave", "fuzzylite"])
def test_where_fuzzylite_computes_other_numbers_is_a_loss_of_its_files(
    dialect: Dialect,
) -> None:
    text = SUGENO.replace("sugeno", "mamdani").replace("wtaver", "mom")
    text = text.replace("'constant',[5]", "'trimf',[0 5 9]").replace(
        "'linear',[1 0.5 2]", "'trimf',[5 9 30]"
    )
    found = [
        loss.what for loss in read_fis(text.encode(), "tip.fis", dialect=dialect).losses
    ]
    assert found == (
        [
            "the mean of all values of the largest degree answers; fuzzylite 6 takes "
            "the first stretch of such values, and degrees within 1e-6 as equal"
        ]
        if dialect == "fuzzylite"
        else []
    )


def test_where_fuzzylite_inverts_curves_otherwise_is_a_loss_of_its_files() -> None:
    text = SUGENO.replace("'constant',[5]", "'smf',[0 5]").replace(
        "'linear',[1 0.5 2]", "'smf',[5 9]"
    )
    (loss,) = read_fis(text.encode(), "tip.fis", dialect="fuzzylite").losses
    assert loss.what == (
        "where a term has a degree is computed exactly; fuzzylite 6 finds other "
        "values for SShape, ZShape and Concave"
    )


def test_a_rule_without_an_antecedent_is_always_true_or_reported_as_left_out() -> None:
    text = SUGENO.replace("1 1, 1 (1) : 1", "0 0, 1 (1) : 1")
    assert read(text).rules[0].when is None
    found = read_fis(text.encode(), "tip.fis", dialect="fuzzylite")
    assert found.losses[0].where == "rule 1"
    text = SUGENO.replace("2 -1, 2 (0.5) : 2", "0 0, 2 (1) : 2")
    found = read_fis(text.encode(), "tip.fis")
    assert found.losses[0].what == (
        "its antecedent is empty and it never fires (an or of none); left out"
    )


def test_names_that_stand_twice_are_renamed_and_reported() -> None:
    text = SUGENO.replace("'service'", "'food'").replace("'fair'", "'small'")
    found = read_fis(text.encode(), "tip.fis")
    assert found.model.inputs == ("food", "food 2")
    assert found.remarks[1:3] == (
        "input 2 is called 'food' like another; here it is 'food 2'",
        "term MF2 of 'tip %' is called 'small'; here it is 'small 2'",
    )


MISTAKES = [
    (("Type=", "Typo="), "4:1: no key 'Typo'; there is Name, Type, Version"),
    (("Name='food'", f"Name='{'f' * 1001}'"), "16:6: Name has more than 1000 char"),
    (("'prod'\nOr", "'prodd'\nOr"), "9:11: no AndMethod 'prodd'; there is min, prod"),
    (("NumInputs=2", "NumInputs=3"), "6:11: NumInputs says 3, and there are 2"),
    (("NumRules=2", "NumRules=4"), "8:10: NumRules says 4, and there are 2"),
    (("NumMFs=1", "NumMFs=7"), "25:8: NumMFs says 7, and there are 1"),
    (("[0 30]", "[30 0]"), "30:7: the Range must be two rising numbers"),
    (("'zmf'", "'zmff'"), "26:5: no kind of curve 'zmff'; there is trimf"),
    (("[3 6]", "[3 6 7]"), "26:19: a 'zmf' has 2 numbers (start end), not 3"),
    (("[3 6]", "[3 six]"), "26:21: 'six' is no number"),
    (("[-1 0 2 4]", "[-1 0 4 2]"), "19:21: the corners must be finite and rise"),
    (("[5]", "[5 6]"), "32:25: a 'constant' has 1 number, not 2"),
    (("[1 0.5 2]", "[1 2]"), "33:22: a 'linear' has a number for each of 2 inputs"),
    (("1 1, 1 (1)", "1 1 1, 1 (1)"), "36:1: 2 numbers stand before the comma"),
    (
        ("1 1, 1 (1)", "1 2, 1 (1)"),
        "36:1: rule 1: 'service' has 1 terms, and no term 2",
    ),
    (
        ("1 1, 1 (1)", "NaN 1, 1 (1)"),
        "36:1: rule 1: 'food' has 2 terms, and no term nan",
    ),
    (
        ("1 1, 1 (1)", "1 1, -Inf (1)"),
        "36:1: rule 1: 'tip %' has 2 terms, and no term inf",
    ),
    (("1 1, 1 (1)", "1 1, 1 (2)"), "36:9: the weight must lie in [0, 1], not 2.0"),
    (("(0.5) : 2", "(0.5) : 3"), "37:17: the last number is 1 (and) or 2 (or)"),
    (("1 1, 1 (1) : 1", "if food"), "36:1: 'if food' is no rule, such as 1 2, 1"),
    (("'wtaver'", "'centroid'"), "4:6: a 'sugeno' system cannot have the DefuzzMethod"),
    (("[Input2]", "[Input3]"), "22:1: [Input2] is missing before this one"),
    (("[Input2]", "[Input1]"), "22:1: section [input1] stands twice"),
    (("[Input2]", "[Inputs]"), "22:1: no section [inputs]; there is System, Input1"),
    (("Name='tip'", "Name=tip"), "3:6: Name must stand in quotes, such as 'tip'"),
    (("MF1='slow'", "MF2='slow'"), "26:1: MF1 is missing before MF2"),
    (("Version=2.0", "Version"), "5:1: 'Version' is no key and value, such as"),
    (("a comment", "\x00"), "1:3: the character U+0000 is not allowed here"),
]


@pytest.mark.parametrize(("change", "message"), MISTAKES)
def test_a_mistake_is_reported_with_its_place(
    change: tuple[str, str], message: str
) -> None:
    assert change[0] in SUGENO
    with pytest.raises(ReadError) as caught:
        read(SUGENO.replace(*change, 1), "matlab")
    assert any(
        line.startswith(f"tip.fis:{message}") for line in str(caught.value).splitlines()
    ), caught.value


def test_all_mistakes_are_reported_at_once() -> None:
    text = SUGENO.replace("'zmf'", "'zm'").replace("(0.5)", "(5)")
    with pytest.raises(ReadError) as caught:
        read(text.replace("'prod'\nOr", "'and'\nOr"))
    assert len(str(caught.value).splitlines()) == 3


@pytest.mark.one_in(4)
@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xff\xfea",
        b"[System]",
        b"Name='x'",
        b"[" * 100_000,
        b"[System]\n" + b"A=1\n" * 200_000,
        b"[System]\nName='" + b"'" * 3_000_000,
        b"[System]\n[Output1]\nMF1=" + b"':'" * 1_000_000,
        b"[System]\n[Output1]\n[Rules]\n" + b"1," * 400_000,
        b"x" * (4 * 2**20 + 1),
    ],
    ids=range(10),
)
def test_hostile_files_end_in_a_sentence_after_bounded_work(content: bytes) -> None:
    with at_most(6_000_000), pytest.raises(ReadError) as caught:
        read_fis(content, "x.fis")
    assert len(str(caught.value)) < 40_000


def test_a_system_without_inputs_and_with_a_singleton_is_read() -> None:
    text = "\n".join(
        (
            "[System]",
            "Type='sugeno'",
            "[Output1]",
            "Name='y'",
            "MF1='one':'constant',[1]",
            "[Rules]",
            ", 1 (1) : 1",
        )
    )
    system = read(text)
    assert system.outputs[0].terms[0].function == Singleton(1.0)
    assert infer(system, {}).outputs == (1.0,)


@pytest.mark.heavy
def test_thousands_of_terms_of_one_name_are_read_with_bounded_work() -> None:
    many = "".join(f"MF{k}='a':'trimf',[0 1 2]\n" for k in range(1, 20_001))
    start, _, rest = SUGENO.partition("MF1='slow'")
    text = start.replace("NumMFs=1\n", "") + many + rest.partition("\n")[2]
    with at_most(6_000_000):
        assert len(read(text).variables[1].terms) == 20_000
    with pytest.raises(ReadError, match="lines are more than the 60,000 that are read"):
        read(text + "1 1, 1 (1) : 1\n" * 60_000)
