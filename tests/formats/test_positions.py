"""Rules and terms stand where a file is said to hold them, in every format of systems.

What stands there is compared with the model: the names of a term, the words of a rule
in their order, the numbers of a rule of FIS.
"""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path as File

import pytest

import fuzzytree as ft
from fuzzytree.auditing.findings.locations import model_file, term_path
from fuzzytree.auditing.findings.records import TermName
from fuzzytree.checking.converting import format_of, load_content
from fuzzytree.errors import LossError
from fuzzytree.model import FuzzySystem, SystemRule, questions
from fuzzytree.model.contracts import Document
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.semantics import as_system
from fuzzytree.testing import random_tree
from tests.interop.corpus import ALL

FLL = """\
Engine: tip
# a comment
InputVariable: food
  enabled: true
  range: 0 10
  term: bad Ramp 5 0

  term:   good Ramp 5 10
InputVariable: off
  enabled: false
  term: on Ramp 0 1
OutputVariable: tip
  defuzzifier: WeightedAverage TakagiSugeno
  default: 0
  range: 0 30
  term: little Constant 5
  term: much Constant 25
RuleBlock: never
  enabled: false
  rule: if food is good then tip is little
RuleBlock: first
  conjunction: Minimum
  activation: General
  rule: if food is good then tip is much
RuleBlock: second
  activation: General
    rule:   if food is bad then tip is little
"""
FIS = """\
[System]
Name='tip'
Type='sugeno'
AndMethod='min'
OrMethod='max'
DefuzzMethod='wtaver'
[Input2]
Name='service'
Range=[0 10]
NumMFs=1
MF1='fair':'linsmf',[0 10]
[Input1]
Name='food'
Range=[0 10]
NumMFs=2
MF2 = 'good':'linsmf',[5 10]
MF1='bad':'linzmf',[0 5]
[Output1]
Name='tip'
Range=[0 30]
NumMFs=2
MF1='little':'constant',[5]
MF2='much':'constant',[25]
[Rules]
% nothing
1 0, 1 (1) : 1

  -2 1, 2 (0.5) : 2
"""
FCL = """\
FUNCTION_BLOCK tip
VAR_INPUT food, service : REAL; END_VAR
VAR_OUTPUT tip : REAL; END_VAR
FUZZIFY service TERM fair := (0, 0) (10, 1); END_FUZZIFY
(* two
lines *) FUZZIFY food TERM bad := (0, 1) (5, 0);
  TERM good := (5, 0) (10, 1); END_FUZZIFY
DEFUZZIFY tip TERM little := 5; TERM much := 25; METHOD : COGS; DEFAULT := 0;
END_DEFUZZIFY
RULEBLOCK one AND : MIN;
  RULE 1 : IF food IS bad THEN tip IS little; RULE 2 : IF food IS
    good AND service IS fair THEN tip IS much;
END_RULEBLOCK
RULEBLOCK two AND : MIN;
  RULE 1 : IF service IS fair THEN tip IS much;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""
FML = """\
<?xml version="1.0" encoding="UTF-8"?>
<fuzzySystem name="tip" xmlns="http://www.ieee1855.org"><knowledgeBase>
  <fuzzyVariable name="food" domainleft="0" domainright="10" type="input">
    <fuzzyTerm name="bad"><leftLinearShape param1="0" param2="5"/></fuzzyTerm>
    <fuzzyTerm name="any"><circularDefinition><or><termName>bad</termName>
      <termName>good</termName></or></circularDefinition></fuzzyTerm>
    <fuzzyTerm name="good"><rightLinearShape param1="5" param2="10"/></fuzzyTerm>
  </fuzzyVariable>
  <tskVariable name="tip"><tskTerm name="much" order="0"><tskValue>25</tskValue>
  </tskTerm></tskVariable></knowledgeBase>
  <tskRuleBase name="one"><tskRule name="é" orMethod="PROBOR"><antecedent><clause>
    <variable>food</variable><term>good</term></clause></antecedent><tskConsequent>
    <tskThen><tskClause><variable>tip</variable><term>much</term></tskClause>
    </tskThen></tskConsequent></tskRule><tskRule name="b"><antecedent><clause>
    <variable>food</variable><term>bad</term></clause></antecedent><tskConsequent>
    <tskThen><tskClause><variable>tip</variable><term>much</term></tskClause>
    </tskThen></tskConsequent></tskRule>
  </tskRuleBase></fuzzySystem>
"""


def spots_of(
    content: bytes, name: str, model: Document
) -> Iterator[tuple[str, object, str]]:
    """Yield each rule and term with what stands from its place on."""
    file = model_file(name, content)
    encoding = "utf-8-sig" if File(name).suffix != ".fcl" else "latin-1"
    lines = re.split("\r\n|\r|\n", content.decode(encoding))
    system = as_system(model, "winner") if isinstance(model, RuleBase) else model
    assert isinstance(system, FuzzySystem)
    parts: list[tuple[str, object, tuple[str | int, ...]]] = [
        ("rule", rule, model.rule_path(number))
        for number, rule in enumerate(system.rules, 1)
    ]
    for one in system.all_variables if system is model else system.variables:
        parts += [
            ("term", label.name, term_path(model, TermName(one.name, label.name)))
            for label in one.terms
        ]
    for kind, part, path in parts:
        place = file.place(path)
        assert place is not None, path
        rest = [lines[place.line - 1][place.column - 1 :], *lines[place.line :]]
        yield kind, part, "\n".join(rest)


def astray(content: bytes, name: str) -> Iterator[str]:
    """Yield what does not stand where it is said to stand."""
    model = load_content(content, name, allow_loss=True)
    kind = File(name).suffix[1:]
    is_ours = isinstance(model, RuleBase)
    seen: list[str] = []
    for what, part, text in spots_of(content, name, model):
        seen.append(text)
        if what == "term":
            begin = {"fis": "'", "fml": '<[a-z]+Term name="([^"]*[.])?'}.get(kind, "")
            name_ = r"[\w.]+" if is_ours else re.escape(str(part))
            if not re.match(rf"{begin}{name_}\b", text, re.IGNORECASE):
                yield f"{part}: {text[:60]}"
        elif isinstance(part, SystemRule) and not said(kind, part, text, model):
            yield f"{part}: {text[:99]}"
    if len({*seen}) < len(seen) and kind != "fis":
        yield "one place of several parts"


def said(kind: str, rule: SystemRule, text: str, model: Document) -> bool:
    """Return whether a rule stands at the beginning of a text."""
    references = [(one.variable, one.term or "any") for one in questions(rule.when)]
    references += [(one.output, one.term) for one in rule.then]
    if kind == "fis":
        numbers = re.findall(r"-?[0-9.]+", text.partition("(")[0])
        assert isinstance(model, FuzzySystem)
        columns = [one.name for one in model.all_variables]
        terms = [
            ["any", *(label.name for label in v.terms)] for v in model.all_variables
        ]
        found = {
            (columns[k], terms[k][int(abs(float(n)))])
            for k, n in enumerate(numbers)
            if float(n)
        }
        return {*references} <= found  # Octave's hedges make several rules of a line
    begin, end = {
        "fll": ("if ", "\n"),
        "fcl": ("rule ", "(?i:;|\n *RULE|\n *END_RULE)"),
        "fml": ("<(tskR|r)ule ", "</(tskR|r)ule>"),
    }[kind]
    whole = re.split(end, text, maxsplit=1)[0]
    if not re.match(begin, whole, re.IGNORECASE):
        return False
    if isinstance(model, RuleBase):  # names became others
        return len(re.findall(r"\bis\b|<variable>", whole, re.IGNORECASE)) > len(
            {one.variable for one in questions(rule.when)}
        )
    at = 0
    for word in itertools.chain.from_iterable(references):
        at = whole.find(word, at) + len(word)
        if at < len(word):
            return False
    return True


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(
    ("name", "text"),
    [("tip.fll", FLL), ("tip.fis", FIS), ("tip.fcl", FCL), ("tip.fml", FML)],
)
def test_each_rule_and_term_stands_where_it_is_said_to(
    name: str, text: str, end: str
) -> None:
    assert [*astray(text.replace("\n", end).encode(), name)] == []


@pytest.mark.parametrize(
    ("name", "text", "path", "place"),
    [
        ("tip.fll", FLL, ("blocks", 1, "rules", 0), (27, 13)),
        ("tip.fll", FLL, ("blocks", 1), (25, 12)),
        ("tip.fll", FLL, ("variables", 0, "terms", 1), (8, 11)),
        ("tip.fis", FIS, ("blocks", 0, "rules", 1), (28, 3)),
        ("tip.fis", FIS, ("variables", 0, "terms", 0), (17, 5)),
        ("tip.fis", FIS, ("variables", 1), (7, 1)),
        ("tip.fcl", FCL, ("blocks", 0, "rules", 1), (11, 47)),
        ("tip.fcl", FCL, ("variables", 0, "terms", 0), (6, 28)),
        ("tip.fcl", FCL, ("outputs", 0), (3, 12)),
        ("tip.fml", FML, ("blocks", 1, "rules", 0), (14, 41)),
        ("tip.fml", FML, ("variables", 0, "terms", 1), (7, 5)),
        ("tip.fml", FML, ("name",), None),
    ],
)
def test_a_part_stands_at_its_line_and_column(
    name: str, text: str, path: tuple[str | int, ...], place: tuple[int, int] | None
) -> None:
    read = format_of(name).read
    assert read is not None
    assert read(text.encode(), name).locate(path) == place


@pytest.mark.one_in(3)
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        *(("fcl", {"scores": scores}) for scores in ("rule", "class")),
        *(("fll", {"scores": scores}) for scores in ("rule", "class", "winner")),
        ("fml", {}),
    ],
)
def test_rules_of_a_rule_base_stand_in_the_file_that_was_made_of_it(
    kind: str, options: dict[str, str]
) -> None:
    rules = ft.rules_from_tree(random_tree(3))
    content = ft.export(rules, kind, allow_loss=True, **options).content
    again = load_content(content, f"a.{kind}", allow_loss=True)
    assert isinstance(again, RuleBase)
    file = model_file(f"a.{kind}", content)
    seen: list[tuple[int, int]] = []
    lines = content.decode().split("\n")
    for number, rule in enumerate(again.rules, 1):
        place = file.place(again.rule_path(number))
        assert place is not None
        text = re.sub(
            "[^a-z0-9]", "", lines[place.line - 1][place.column - 1 :].lower()
        )
        scores = options.get("scores", "none")
        label = re.sub("[^a-z0-9]", "", rule.then)
        assert {
            "rule": f"score{number}{label}is",
            "class": f"score{label}is",
            "winner": f"classis{label}",
            "none": "",
        }[scores] in text
        seen.append((place.line, place.column))
    assert seen == sorted(seen) or options.get("scores") == "class"
    names = [
        (file.place(("variables", k, "terms", t)), term.name)
        for k, variable in enumerate(again.variables)
        for t, term in enumerate(variable.terms)
    ]
    spots = [(place.line, place.column) for place, _ in names if place]
    assert len({*spots}) == len(names)


# --- every file of others


@pytest.mark.heavy
def test_each_rule_and_term_of_every_file_of_others_stands_where_it_is_said_to() -> (
    None
):
    counts = Counter[str]()
    for corpus in ALL:
        for name, path in corpus.files():
            content = path.read_bytes()
            assert [*astray(content, path.name)] == [], name
            counts[corpus.kind] += 1
            if corpus.kind == "fll":  # the same systems, for the most part
                continue
            model = load_content(content, path.name, allow_loss=True)
            try:
                made = ft.export(model, "fml", allow_loss=True).content
            except LossError:  # rules that FML has no words for
                continue
            assert [*astray(made, "made.fml")] == [], name
            counts["fml"] += 1
    if counts:
        assert counts == {"fcl": 18, "fis": 35, "fll": 92, "fml": 34}
