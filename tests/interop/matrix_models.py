"""The models on which `tests.interop.matrix` tries every verb and every target."""

from __future__ import annotations

import contextlib
import csv
import datetime
import io
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
        "a tree with categories", _learned("colour,size,class", _mixed)
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
}
"""The models by name."""


def write_model(kind: str) -> str:
    """Write a kind of model into the current folder, and return its file's name."""
    with contextlib.redirect_stderr(io.StringIO()):
        return KINDS[kind].write()
