"""Files that do not say which engine they are for: both answers at a point."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.checking import read_content, reading_format
from fuzzytree.errors import ReadError
from fuzzytree.model import FuzzySystem, ModelPath, Reading
from fuzzytree.semantics import infer

FCL = """\
FUNCTION_BLOCK e
VAR_INPUT a : REAL; c : REAL; d : REAL; END_VAR
VAR_OUTPUT y : REAL; END_VAR
FUZZIFY a TERM p := (0, 0) (1, 1); END_FUZZIFY
FUZZIFY c TERM p := (0, 0) (1, 1); END_FUZZIFY
FUZZIFY d TERM p := (0, 0) (1, 1); TERM n := (0, 1) (1, 0); END_FUZZIFY
DEFUZZIFY y
  TERM lo := {lo}; TERM hi := {hi};
  METHOD : {method}; DEFAULT := 0; RANGE := (0 .. 100);
END_DEFUZZIFY
RULEBLOCK r AND : MIN; {accu}
  RULE 1 : IF {condition} THEN y IS hi;
  RULE 2 : IF d IS n THEN y IS lo;
  RULE 3 : IF d IS p THEN y IS lo;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""
CURVES = {"lo": "(0, 1) (60, 0)", "hi": "(40, 0) (100, 1)", "method": "COG"}
NUMBERS = {"lo": "0", "hi": "100", "method": "COGS"}

FIS = """\
[System]
Name='tip'
Type='sugeno'
Version=2.0
NumInputs=1
NumOutputs=1
NumRules=3
AndMethod='min'
OrMethod='max'
ImpMethod='min'
AggMethod='max'
DefuzzMethod='wtaver'

[Input1]
Name='food'
Range=[0 10]
NumMFs=2
MF1='low':'trimf',[-1 0 10]
MF2='high':'smf',[0 10]

[Output1]
Name='tip'
Range=[0 30]
NumMFs=2
MF1='small':'constant',[5]
MF2='large':'constant',[25]

[Rules]
1, 1 (1) : 1
2, 2 (1) : 1
{rule}
"""
MAMDANI = (
    FIS.replace("sugeno", "mamdani")
    .replace("wtaver", "centroid")
    .replace("'constant',[5]", "'trimf',[-9 0 15]")
    .replace("'constant',[25]", "'trimf',[10 25 30]")
    .format(rule="1, 1 (0.5) : 1")
)
FLL = """\
Engine: tip
InputVariable: food
  range: 0 10
  term: low Ramp 10 0
  term: high Ramp 0 10
OutputVariable: tip
  range: 0 1
  defuzzifier: WeightedAverage
  term: large Ramp 0 1
RuleBlock:
  rule: if food is low then tip is large
  rule: if food is high then tip is large
"""


def reading(text: str, form: str) -> Reading:
    return read_content(text.encode(), reading_format(form), name="e")


def of_fcl(accu: str, condition: str, terms: dict[str, str]) -> str:
    return FCL.format(accu=accu, condition=condition, **terms)


CASES = {
    "a OR b AND c": (
        of_fcl("ACCU : MAX;", "a IS p OR c IS p AND d IS p", NUMBERS),
        ["fcl:iec", "fcl:jfuzzylogic"],
    ),
    "no ACCU": (of_fcl("", "a IS p", CURVES), ["fcl:iec", "fcl:jfuzzylogic"]),
    "rules of one term": (
        FIS.format(rule="1, 1 (1) : 1"),
        ["fis:matlab", "fis:octave"],
    ),
    "a difference of sigmoids": (
        FIS.replace("'smf',[0 10]", "'dsigmf',[1 8 1 2]").format(rule="2, 2 (1) : 1"),
        ["fis:matlab", "fis:octave"],
    ),
    "an S curve without width": (
        FIS.replace("[0 10]\n\n[Out", "[6 4]\n\n[Out").format(rule="1, 2 (1) : 1"),
        ["fis:matlab", "fis:fuzzylite"],
    ),
    "Tsukamoto": (FLL, ["fll:fuzzylite", "fll:pyfuzzylite"]),
}
POINT = re.compile(
    r"(\w+) is (\S+) in (\S+) and (\S+) in (\S+) at ([^;]*); "
    r"pass --from (\S+) or --from (\S+)"
)


@pytest.mark.parametrize("case", CASES)
def test_a_loss_names_both_engines_and_their_answers_at_a_point(case: str) -> None:
    text, names = CASES[case]
    form = names[0].partition(":")[0]
    sentences = [one.what for one in reading(text, form).losses]
    points = [match for one in sentences if (match := POINT.fullmatch(one))]
    [point] = [one for one in points if one.group(5) == names[1]]
    assert [point.group(k) for k in (3, 5, 7, 8)] == [*names, *names]
    row = dict(part.split(" = ") for part in point.group(6).split(", "))
    values = {name: float(value) for name, value in row.items()}
    for name, answer in zip(names, point.group(2, 4), strict=True):
        model = reading(text, name).model
        assert isinstance(model, FuzzySystem)
        [value] = infer(model, values).outputs
        assert value == pytest.approx(float(answer), rel=1e-8)
    assert point.group(2) != point.group(4)


@pytest.mark.parametrize("case", CASES)
def test_a_named_engine_leaves_no_loss(case: str) -> None:
    text, names = CASES[case]
    for name in names:
        assert not any("--from" in one.what for one in reading(text, name).losses)


def test_other_samples_of_a_range_are_a_remark_with_both_answers() -> None:
    found = reading(MAMDANI, "fis")
    assert found.losses == ()
    remarks = [one for one in found.remarks if one.startswith("engines sample")]
    assert len(remarks) == 2
    assert "in fis:matlab and " in remarks[0]
    assert "in fis:octave at food = " in remarks[0]
    assert "in fis:fuzzylite at food = " in remarks[1]


def test_a_resolution_that_a_file_leaves_out_is_that_of_the_named_engine() -> None:
    text = FLL.replace("WeightedAverage", "Centroid\n  aggregation: Maximum")
    text = text.replace("RuleBlock:", "RuleBlock:\n  implication: Minimum")
    for name, samples in (("fll:fuzzylite", 100), ("fll:pyfuzzylite", 1000)):
        model = reading(text, name).model
        assert isinstance(model, FuzzySystem)
        assert model.outputs[0].defuzzifier.samples == samples
    found = reading(text, "fll")
    assert found.losses == ()
    [remark] = [one for one in found.remarks if one.startswith("engines sample")]
    assert "in fll:pyfuzzylite and " in remark
    assert "in fll:fuzzylite at food = " in remark


@pytest.mark.parametrize(
    ("method", "low", "dialect", "sentence"),
    [
        ("bisector", 0, "octave", "Octave's bisector is the number of a sample"),
        ("bisector", 0, "matlab", "MATLAB's bisector is the first sample with half"),
        ("som", -9, "matlab", "MATLAB's som is the value of the smallest size"),
        ("lom", -9, "matlab", "MATLAB's lom is the value of the largest size"),
        ("som", 0, "matlab", ""),
        ("lom", -9, "octave", ""),
        ("mom", -9, "matlab", ""),
        ("bisector", 0, "fuzzylite", "fuzzylite 6's bisector lies between two samples"),
    ],
)
def test_a_method_of_one_engine_alone_is_a_loss(
    method: str, low: int, dialect: str, sentence: str
) -> None:
    text = MAMDANI.replace("centroid", method).replace("[0 30]", f"[{low} 30]")
    found = reading(text, f"fis:{dialect}")
    written = ft.export(found.model, "fis", allow_loss=True, dialect=dialect)
    for losses in (found.losses, written.losses):
        assert len(losses) == bool(sentence)
        assert all(one.what.startswith(sentence) for one in losses)


def test_an_output_without_default_is_written_without_it() -> None:
    text = of_fcl("ACCU : MAX;", "a IS p", NUMBERS).replace("DEFAULT := 0;", "")
    for name in ("fcl:iec", "fcl:jfuzzylogic"):
        model = reading(text, name).model
        written = ft.export(model, "fcl", dialect=name[4:])
        assert "DEFAULT" not in written.content.decode()
        assert any("no DEFAULT is written" in one for one in written.remarks)
        assert reading(written.content.decode(), "fcl").model == model


def test_engines_that_agree_are_no_loss() -> None:
    text = FIS.replace("AggMethod='max'", "AggMethod='sum'")
    found = reading(text.format(rule="2, 2 (1) : 1"), "fis")
    assert found.losses == ()
    assert not any("engines" in one for one in found.remarks)


def test_a_difference_of_many_rules_that_shows_at_once_builds_no_program(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rule = "  RULE 4 : IF c IS p THEN y IS hi;\n"
    text = of_fcl("", "a IS p", CURVES).replace("END_RULEB", 200 * rule + "END_RULEB")
    monkeypatch.delattr("fuzzytree.checking.engines.run_system")
    assert "engines" in [one.where for one in reading(text, "fcl").losses]


def test_numbers_that_only_rounding_sets_apart_from_zero_are_no_loss() -> None:
    """Engines that sum samples in another order agree about 0 up to rounding."""
    text = MAMDANI.replace("[0 30]", "[-0.3 0.3]")
    for curve in ("[-9 0 15]", "[10 25 30]"):
        text = text.replace(curve, "[-0.3 0 0.3]")
    found = reading(text, "fis")
    assert found.losses == ()
    assert not any("engines" in one for one in found.remarks)


CONTRADICTIONS = [
    (
        of_fcl("ACCU : MAX;", "a IS p", NUMBERS),
        "fcl:fuzzylite",
        "e:11:1: ACCU in RULEBLOCK is read by IEC 61131-7, not by fuzzylite; "
        "pass --from fcl:iec",
    ),
    (
        of_fcl("", "a IS p", {**CURVES, "lo": "Ramp 60 0"}),
        "fcl:jfuzzylogic",
        "e:8:1: the term class Ramp is read by fuzzylite, not by jFuzzyLogic; "
        "pass --from fcl:fuzzylite",
    ),
    (
        "// FCL, dialect iec\n" + of_fcl("", "a IS p", NUMBERS),
        "fcl:jfuzzylogic",
        "e:1:1: the first line says that the dialect is iec; pass --from fcl:iec",
    ),
    (
        "# dialect: octave\n" + MAMDANI,
        "fis:matlab",
        "e:1:1: the file says that it is octave's; pass --from fis:octave",
    ),
    (
        FIS.replace("'smf',[0 10]", "'rampmf',[0 10]").format(rule="1, 1 (1) : 1"),
        "fis:octave",
        "e:19:1: rampmf in line 19 is only fuzzylite's; pass --from fis:fuzzylite",
    ),
    (
        FIS.format(rule="1.2, 1 (1) : 1"),
        "fis:matlab",
        "e:31:1: line 31 has hedges, which MATLAB has not; pass --from fis:octave",
    ),
]


@pytest.mark.parametrize(("text", "name", "sentence"), CONTRADICTIONS)
def test_a_named_engine_that_the_file_contradicts_is_refused_where_it_does(
    text: str, name: str, sentence: str
) -> None:
    with pytest.raises(ReadError) as caught:
        reading(text, name)
    assert str(caught.value).splitlines()[0] == sentence


@pytest.mark.parametrize("name", ["fcl:iec", "fcl:jfuzzylogic"])
def test_a_path_carries_its_engine_into_every_function(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = CASES["a OR b AND c"][0]
    Path("e.fcl").write_text(text)
    path = ModelPath("e.fcl", name)
    rows = np.array([[0.9, 0.1, 0.2]])
    model = reading(text, name).model
    answers = [ft.run(one, rows, columns=["a", "c", "d"]) for one in (path, model)]
    assert answers[0].to_csv() == answers[1].to_csv()
    assert ft.convert(path, "yaml").reading.model == model
    assert ft.check(path, model).ok
    assert ft.diff(path, model).verdict == "equal"
