"""The models on which `tests.interop.matrix` tries every verb and every target."""

from __future__ import annotations

import contextlib
import csv
import datetime
import io
import itertools
import random
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final, NamedTuple

import fuzzytree as ft
from fuzzytree.cli.program import main

DAY = datetime.date(2024, 1, 1)
Row = Iterable[object]

RULES = """format: fuzzytree/1
kind: rule base
name: hand
classes: [no, maybe, yes]
variables:
- name: heat
  range: {from: 0, to: 10}
  terms:
  - {name: low, points: [[2, 1], [4, 0]]}
  - {name: mid, points: [[3, 0], [4, 1], [5, 0]]}
  - {name: high, points: [[6, 0], [8, 1]]}
- name: damp
  range: {from: 0, to: 1}
  terms: [{name: dry, points: [[0.2, 1], [0.6, 0]]},
    {name: wet, points: [[0.5, 0], [0.9, 1]]}]
rules:
- {if: [heat is low or mid, damp is not wet], then: no}
- {if: [heat is high], then: yes}
- {if: [heat is not high, damp is wet], then: maybe}
semantics: {and: minimum, or: maximum, not: 1 - degree, uncovered: no class,
  missing: class maybe, answer: the class of the first of the strongest rules}
"""
WOODS = """format: fuzzytree/1
kind: rule base
name: woods
classes: [no, maybe, yes]
variables:
- name: heat
  range: {from: 0, to: 10}
  terms:
  - {name: low, points: [[2, 1], [4, 0]]}
  - {name: high, points: [[6, 0], [8, 1]]}
- name: wood
  categories: [oak, fir, elm]
  terms:
  - {name: oak, points: [[0, 1], [0.5, 0]]}
  - {name: soft, points: [[0.5, 0], [1, 1]]}
rules:
- {if: [wood is oak, heat is low], then: no}
- {if: [wood is soft], then: yes}
- {if: [heat is high], then: maybe}
semantics: {and: minimum, or: maximum, not: 1 - degree, uncovered: no class,
  missing: class maybe, answer: the class of the first of the strongest rules}
"""
SYSTEM = """Engine: m
InputVariable: a
  range: 0.0 10.0
  lock-range: false
  term: low {low}
  term: high {high}
InputVariable: b
  range: 0.0 10.0
  term: low Triangle -1.0 0.0 6.0
  term: high Triangle 4.0 10.0 11.0
OutputVariable: z
  range: {range}
  aggregation: {aggregation}
  defuzzifier: {defuzzifier}
  default: nan
  term: small {small}
  term: large {large}
{more}RuleBlock: one
  conjunction: {conjunction}
  disjunction: Maximum
  implication: {implication}
  activation: General
  rule: if a is low or b is low then z is small
  rule: if a is high and b is not low then z is large with 0.5
"""
MORE = """OutputVariable: y
  range: 0.0 30.0
  aggregation: Maximum
  defuzzifier: MeanOfMaximum 100
  default: 4.0
  term: small Triangle 0.0 5.0 15.0
  term: large Triangle 10.0 25.0 30.0
"""
FIS = """[System]
Name='f'
Type='mamdani'
Version=2.0
NumInputs=2
NumOutputs=1
NumRules=3
AndMethod='min'
OrMethod='max'
ImpMethod='min'
AggMethod='max'
DefuzzMethod='centroid'
[Input1]
Name='a'
Range=[0 10]
NumMFs=2
MF1='low':'gaussmf',[2 1]
MF2='high':'trapmf',[4 8 10 12]
[Input2]
Name='b'
Range=[0 10]
NumMFs=2
MF1='low':'zmf',[2 6]
MF2='high':'gbellmf',[2 3 8]
[Output1]
Name='z'
Range=[0 30]
NumMFs=2
MF1='small':'trimf',[0 5 15]
MF2='large':'trimf',[10 25 30]
[Rules]
1 0, 1 (1) : 1
2 -1, 2 (0.5) : 1
0 2, 2 (1) : 1
"""
FCL = """FUNCTION_BLOCK f
VAR_INPUT a : REAL; b : REAL; END_VAR
VAR_OUTPUT z : REAL; END_VAR
FUZZIFY a TERM low := (2, 1) (6, 0); TERM high := (3, 0) (8, 1); END_FUZZIFY
FUZZIFY b TERM low := (0, 1) (5, 0); TERM high := (4, 0) (9, 1); END_FUZZIFY
DEFUZZIFY z
  RANGE := (0 .. 30);
  TERM small := (0, 0) (5, 1) (15, 0);
  TERM large := (10, 0) (25, 1) (30, 0);
  METHOD : COG; ACCU : MAX; DEFAULT := 12;
END_DEFUZZIFY
RULEBLOCK one AND : MIN; OR : MAX; ACT : MIN;
RULE 1 : IF a IS low OR b IS low THEN z IS small;
RULE 2 : IF a IS high AND b IS NOT low THEN z IS large WITH 0.5;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""
FLL = """Engine: f
InputVariable: a
  range: 0.0 10.0
  term: low Ramp 6.0 2.0
  term: high Sigmoid 6.0 2.0
InputVariable: b
  range: 0.0 10.0
  lock-range: true
  term: low Triangle 0.0 0.0 6.0
  term: high Bell 8.0 2.0 3.0
OutputVariable: z
  range: 0.0 30.0
  aggregation: AlgebraicSum
  defuzzifier: Centroid 100
  default: nan
  term: small Triangle 0.0 5.0 15.0
  term: large Gaussian 25.0 4.0
RuleBlock: one
  conjunction: AlgebraicProduct
  disjunction: AlgebraicSum
  implication: AlgebraicProduct
  activation: General
  rule: if a is low or b is very low then z is small
  rule: if a is high and b is not low then z is large with 0.5
"""
FML_INPUT = """<fuzzyVariable name="{name}" type="input"
 domainleft="0" domainright="10">
<fuzzyTerm name="low"><leftLinearShape param1="2" param2="6"/></fuzzyTerm>
<fuzzyTerm name="high"><gaussianShape param1="8" param2="2"/></fuzzyTerm>
</fuzzyVariable>"""
FML_RULE = """<rule name="{term}" connector="{word}" weight="1.0"><antecedent>
<clause><variable>a</variable><term>{term}</term></clause>
<clause><variable>b</variable><term>{term}</term></clause></antecedent>
<consequent><then><clause><variable>z</variable><term>{then}</term></clause></then>
</consequent></rule>"""
FML = f"""<?xml version="1.0" encoding="UTF-8"?>
<fuzzySystem xmlns="http://www.ieee1855.org" name="f"><knowledgeBase>
{FML_INPUT.format(name="a")}
{FML_INPUT.format(name="b")}
<fuzzyVariable name="z" domainleft="0" domainright="30" type="output"
 accumulation="MAX" defuzzifier="COG" defaultValue="12">
<fuzzyTerm name="small">
<triangularShape param1="0" param2="5" param3="15"/></fuzzyTerm>
<fuzzyTerm name="large">
<triangularShape param1="10" param2="25" param3="30"/></fuzzyTerm>
</fuzzyVariable></knowledgeBase>
<mamdaniRuleBase name="r" activationMethod="MIN" andMethod="MIN" orMethod="MAX">
{FML_RULE.format(term="low", word="or", then="small")}
{FML_RULE.format(term="high", word="and", then="large")}
</mamdaniRuleBase></fuzzySystem>
"""


class Model(NamedTuple):
    """A kind of model: what it is in words, and what writes its file."""

    what: str
    write: Callable[[], str]


def _table(header: str, rows: Iterable[Row]) -> None:
    with Path("data.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([header.split(","), *rows])


def _learned(
    header: str,
    rows: Callable[[random.Random], Iterable[Row]],
    *options: str,
    rules: tuple[str, ...] = (),
) -> Callable[[], str]:
    """Return what learns a tree of made rows, and perhaps converts it to rules."""

    def write() -> str:
        _table(header, rows(random.Random(5)))
        words = ["learn", "data.csv", "--target", "class", "-o", "model.yaml"]
        if main([*words, *options]):
            raise RuntimeError("a tree could not be learned")
        if not rules:
            return "model.yaml"
        if main(["convert", "model.yaml", "rules.yaml", *rules]):
            raise RuntimeError("rules could not be made")
        return "rules.yaml"

    return write


def _blobs(pick: random.Random) -> Iterable[Row]:
    for number in range(160):
        k, a = number % 3, pick.gauss(0, 1)
        b = round(k - a + pick.gauss(0, 0.4), 3)
        yield round(a + k, 3), b, round(pick.gauss(0, 1), 3), "abc"[k]


def _mixed(pick: random.Random) -> Iterable[Row]:
    for number in range(160):
        k = number % 3
        size = "" if pick.random() < 0.1 else round(pick.gauss(k, 0.5), 3)
        yield pick.choice(["red", "blue"] if k else ["green", "dark"]), size, "xyz"[k]


def _dated(pick: random.Random) -> Iterable[Row]:
    for number in range(160):
        day = DAY + datetime.timedelta(days=pick.randrange(100) + 100 * (number % 2))
        yield day, round(pick.gauss(number % 2, 0.9), 3), number % 2


def _truths(pick: random.Random) -> Iterable[Row]:
    for number in range(160):
        yield round(pick.gauss(number % 2, 0.5), 3), bool(number % 2)


def _tested(pick: random.Random) -> Iterable[Row]:
    for _ in range(500):
        a, b = pick.random() * 6, pick.random() * 6
        yield round(a, 3), round(b, 3), "uvw"[(int(a) + 2 * int(b)) % 3]


def _tactile() -> str:
    """Write frames of two shapes, their features, and a tree of these."""
    pick = random.Random(2)
    places = list(itertools.product(range(8), range(8)))
    for name, tall in (("bar", 2), ("dot", 1)):
        lines = [["time", "number", *(f"r{r}c{c}" for r, c in places)]]
        for number in range(40):
            top, left = pick.randrange(5), pick.randrange(6)
            force = pick.randrange(60, 200)
            cells = [
                force + pick.randrange(20)
                if 0 <= r - top <= tall and 0 <= c - left < 2
                else 0
                for r, c in places
            ]
            lines.append([str(cell) for cell in (number / 10, number, *cells)])
        text = "".join(f"{','.join(line)}\n" for line in lines)
        Path(f"{name}.csv").write_text(text, encoding="utf-8")
    words = ["tactile", "features", "bar=bar.csv", "dot=dot.csv", "-o", "data.csv"]
    if main(words):
        raise RuntimeError("no features could be made")
    if main(["learn", "data.csv", "--target", "class", "-o", "model.yaml"]):
        raise RuntimeError("a tree could not be learned")
    return "model.yaml"


def _sklearn() -> str:
    """Write a tree of scikit-learn."""
    from sklearn.tree import DecisionTreeClassifier

    pick = random.Random(3)
    points = [[pick.random() * 10, pick.random() * 5] for _ in range(200)]
    classes = [int(a > 5) + int(b > 2.5 and a > 2) for a, b in points]
    tree = DecisionTreeClassifier(max_depth=3, random_state=0).fit(points, classes)
    ft.save(ft.from_sklearn(tree, classes=["p", "q", "r"]), "model.yaml")
    return "model.yaml"


def _text(name: str, content: str) -> Callable[[], str]:
    def write() -> str:
        Path(name).write_text(content, encoding="utf-8")
        return name

    return write


def _system(**parts: str) -> Callable[[], str]:
    """Return what writes a system, read from FLL, as YAML."""
    usual = {
        "low": "Ramp 6.0 2.0",
        "high": "Ramp 3.0 8.0",
        "range": "0.0 30.0",
        "aggregation": "Maximum",
        "defuzzifier": "Centroid 100",
        "small": "Triangle 0.0 5.0 15.0",
        "large": "Triangle 10.0 25.0 30.0",
        "more": "",
        "conjunction": "Minimum",
        "implication": "Minimum",
    }
    text = SYSTEM.format(**usual | parts)
    if parts.get("more"):
        text = text.replace("z is large with 0.5", "z is large and y is small")

    def write() -> str:
        Path("m.fll").write_text(text, encoding="utf-8")
        ft.save(ft.read("m.fll").model, "model.yaml")
        return "model.yaml"

    return write


WEIGHTED = {
    "aggregation": "none",
    "implication": "none",
    "range": "-100.0 100.0",
    "defuzzifier": "WeightedAverage",
}
GAUSS = {"low": "Gaussian 1.0 2.0", "high": "Gaussian 8.0 2.0"}
ONE = ("--no-test", "--columns-per-node", "1")
KINDS: Final = {
    "tree": Model("a tree", _learned("p,q r,s,class", _blobs)),
    "tree one input": Model(
        "a tree of one input a node",
        _learned("p,q r,s,class", _blobs, "--columns-per-node", "1"),
    ),
    "tree categories": Model(
        "a tree with categories", _learned("colour,size,class", _mixed, *ONE)
    ),
    "tree dates": Model("a tree with dates", _learned("when,size,class", _dated)),
    "tree truths": Model("a tree of truth values", _learned("p,class", _truths)),
    "tree leaf": Model(
        "a tree of one leaf", _learned("p,q r,s,class", _blobs, "--leaves", "1")
    ),
    "tree large": Model(
        "a tree of 30 leaves",
        _learned("p,q,class", _tested, "--leaves", "30", "--min-rows", "5", *ONE),
    ),
    "tree tactile": Model("a tree of tactile features", _tactile),
    "tree sklearn": Model("a tree of scikit-learn", _sklearn),
    "rules relative": Model(
        "the relative rules of a tree",
        _learned("p,q r,s,class", _blobs, "--no-test", rules=("--as", "rules")),
    ),
    "rules raw": Model(
        "the raw rules of a tree",
        _learned(
            "p,q r,s,class", _blobs, *ONE, rules=("--as", "rules", "--terms", "raw")
        ),
    ),
    "rules product": Model(
        "the raw rules of a tree under the product",
        _learned(
            "p,q r,s,class",
            _blobs,
            "--no-test",
            rules=("--as", "rules", "--terms", "raw", "--conjunction", "product"),
        ),
    ),
    "rules mixed": Model(
        "the relative rules of a tree with categories",
        _learned("colour,size,class", _mixed, *ONE, rules=("--as", "rules")),
    ),
    "rules hand": Model("rules by hand", _text("model.yaml", RULES)),
    "rules categories": Model(
        "rules by hand with categories", _text("model.yaml", WOODS)
    ),
    "mamdani": Model("a Mamdani system", _system()),
    "bisector": Model(
        "a Mamdani system with gaussians and a bisector",
        _system(**GAUSS, defuzzifier="Bisector 100", conjunction="AlgebraicProduct"),
    ),
    "two outputs": Model("a system of two outputs", _system(more=MORE)),
    "sugeno": Model(
        "a Sugeno system",
        _system(
            **GAUSS,
            **WEIGHTED,
            small="Linear 1.0 0.5 2.0",
            large="Linear -1.0 2.0 20.0",
            conjunction="AlgebraicProduct",
        ),
    ),
    "tsukamoto": Model(
        "a Tsukamoto system",
        _system(**WEIGHTED, small="Ramp 15.0 0.0", large="SShape 10.0 30.0"),
    ),
    "fis": Model("a FIS file", _text("model.fis", FIS)),
    "fcl": Model("an FCL file", _text("model.fcl", FCL)),
    "fll": Model("an FLL file", _text("model.fll", FLL)),
    "fml": Model("an FML file", _text("model.fml", FML)),
}
"""The models by name."""


def write_model(kind: str) -> str:
    """Write a kind of model into the current folder, and return its file's name."""
    with contextlib.redirect_stderr(io.StringIO()):
        return KINDS[kind].write()
