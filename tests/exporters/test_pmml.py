"""PMML: what the file says, by an interpreter of the few elements that it uses."""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Callable, Mapping
from typing import Any, Literal
from xml.etree import ElementTree

import pytest
from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.exporters.pmml import write
from fuzzytree.model import (
    Call,
    Conclusion,
    Defuzzifier,
    Formula,
    FuzzySystem,
    FuzzyTree,
    Gaussian,
    Kind,
    Name,
    Number,
    Points,
    Proposition,
    Rule,
    RuleBase,
    RuleBlock,
    Semantics,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import probes
from fuzzytree.semantics.programs.operations import NUMERIC, divide, power
from fuzzytree.semantics.reference import descend, evaluate
from fuzzytree.testing import random_rows, random_system, random_tree, with_points

SPACE = "{http://www.dmg.org/PMML-4_4}"
Fields = dict[str, float | None]


class File:
    """Runs a file: its derived fields, then its tree model."""

    def __init__(self, content: bytes) -> None:
        self.root = ElementTree.fromstring(content)
        self.functions = {
            one.attrib["name"]: one for one in self.root.iter(f"{SPACE}DefineFunction")
        }

    def answer(self, row: Mapping[str, float]) -> tuple[str | None, str | None, Fields]:
        """Return the class, the number of the node and the outputs."""
        fields: Fields = {
            name: None if math.isnan(value) else value for name, value in row.items()
        }
        for one in self.root.iter(f"{SPACE}DerivedField"):
            value = self.value(one[0], fields)
            fields[one.attrib["name"]] = value
            assert value is None or not math.isnan(value)
        outputs: Fields = {
            one.attrib["name"]: self.value(one[0], fields)
            for one in self.root.iter(f"{SPACE}OutputField")
            if one.attrib["feature"] == "transformedValue"
        }
        (model,) = self.root.iter(f"{SPACE}TreeModel")
        node = next(one for one in model if one.tag == f"{SPACE}Node")
        while True:
            inner = [one for one in node if one.tag == f"{SPACE}Node"]
            if not inner:
                return node.attrib["score"], node.attrib["id"], outputs
            found = [one for one in inner if self.holds(predicate_of(one), fields)]
            if not found:
                return None, None, outputs
            assert len(found) == 1
            node = found[0]

    def value(self, one: ElementTree.Element, fields: Fields) -> float | None:
        kind = one.tag.removeprefix(SPACE)
        if kind == "Constant" and one.attrib.get("missing") == "true":
            return None
        if kind == "Constant" and one.attrib["dataType"] == "boolean":
            return float(one.text == "true")
        if kind == "Constant":
            return float(one.text or "")
        if kind == "FieldRef":
            return fields[one.attrib["field"]]
        if kind == "NormContinuous":
            return normed(one, fields[one.attrib["field"]])
        assert kind == "Apply"
        name = one.attrib["function"]
        if name == "isMissing":
            return float(self.value(one[0], fields) is None)
        if name == "if":
            if self.value(one[0], fields):
                return self.value(one[1], fields)
            return self.value(one[2], fields) if len(one) > 2 else None
        given = [self.value(part, fields) for part in one]
        if name in self.functions:
            *parameters, body = self.functions[name]
            names = [parameter.attrib["name"] for parameter in parameters]
            return self.value(body, dict(zip(names, given, strict=True)))
        if None in given:
            return None
        numbers = [number for number in given if number is not None]
        return BUILT_IN[name](*numbers)

    def numbers(self, row: Mapping[str, float]) -> list[float | None]:
        """Return what a regression model hands on, and the outputs."""
        fields: Fields = {
            name: None if math.isnan(value) else value for name, value in row.items()
        }
        for one in self.root.iter(f"{SPACE}DerivedField"):
            fields[one.attrib["name"]] = self.value(one[0], fields)
        (predictor,) = self.root.iter(f"{SPACE}NumericPredictor")
        outputs = [
            self.value(one[0], fields) for one in self.root.iter(f"{SPACE}OutputField")
        ]
        return [fields[predictor.attrib["name"]], *outputs]

    def holds(self, one: ElementTree.Element, fields: Fields) -> bool:
        if one.tag == f"{SPACE}CompoundPredicate":
            joined = {"and": all, "or": any}[one.attrib["booleanOperator"]]
            return joined([self.holds(part, fields) for part in one])
        compare = {
            "equal": operator.eq,
            "lessOrEqual": operator.le,
            "greaterThan": operator.gt,
        }[one.attrib["operator"]]
        value = fields[one.attrib["field"]]
        return value is not None and bool(compare(value, float(one.attrib["value"])))


BUILT_IN: dict[str, Callable[..., float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": divide,
    "min": min,
    "max": max,
    "abs": abs,
    "product": lambda *numbers: math.prod(numbers),
    "equal": operator.eq,
    "notEqual": operator.ne,
    "lessThan": operator.lt,
    "lessOrEqual": operator.le,
    "greaterThan": operator.gt,
    "and": lambda *truths: all(truths),
    "or": lambda *truths: any(truths),
    "not": operator.not_,
    "floor": math.floor,
    "ceil": math.ceil,
    "rint": round,
    "exp": NUMERIC["exponential"],
    "sqrt": math.sqrt,
    "pow": power,
    "ln": NUMERIC["logarithm"],
    "log10": math.log10,
    "cos": math.cos,
    "sin": math.sin,
    "tanh": math.tanh,
    "atan": math.atan,
}


def predicate_of(node: ElementTree.Element) -> ElementTree.Element:
    return next(one for one in node if one.tag.endswith("Predicate"))


def normed(one: ElementTree.Element, x: float | None) -> float | None:
    if x is None:
        return None
    assert one.attrib["outliers"] == "asExtremeValues"
    points = [(float(p.attrib["orig"]), float(p.attrib["norm"])) for p in one]
    assert all(a[0] < b[0] for a, b in itertools.pairwise(points))
    if x <= points[0][0]:
        return points[0][1]
    for (a, p), (b, r) in itertools.pairwise(points):
        if x <= b:
            return p + (x - a) / (b - a) * (r - p)
    return points[-1][1]


def assert_alike(
    model: FuzzyTree | RuleBase, *, count: int = 30, room: float = 0.0, **options: Any
) -> None:
    file = File(write(model, **options).content)
    rows: list[dict[str, float]] = [dict(row) for row in probes(model, limit=count)]
    for name in model.inputs:
        rows += [rows[0] | {name: value} for value in (math.nan, math.inf, -math.inf)]
    for one, other in itertools.product((1e308, math.inf, math.nan), repeat=2):
        signs = itertools.cycle((one, -other, -one, other))
        rows.append(dict(zip(model.inputs, signs, strict=False)))
    for row in rows:
        label, number, outputs = file.answer(row)
        expected = (
            evaluate(model, row) if isinstance(model, RuleBase) else descend(model, row)
        )
        assert label == expected.label
        if expected.rule:
            assert number == str(expected.rule)
        for k, strength in enumerate(expected.strengths, 1):
            found = outputs[f"strength of rule {k}"]
            if math.isnan(strength):
                assert found is None
            else:
                assert found is not None
                assert abs(found - strength) <= room


KINDS: tuple[Kind, ...] = ("relative", "raw")


@pytest.mark.parametrize("seed", range(6))
def test_a_tree_predicts_as_the_reference(seed: int) -> None:
    missing = "class 2" if seed % 2 else None
    assert_alike(random_tree(seed, semantics=Semantics(missing=missing)))


@pytest.mark.one_in(4)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(6))
def test_rules_have_the_references_bits(seed: int, kind: Kind) -> None:
    semantics = Semantics(("minimum", "product")[seed % 2], "class 1", "class 2")
    rules = rules_from_tree(random_tree(seed, semantics=semantics), kind)
    assert_alike(rules)
    assert_alike(with_points(rules, seed))


@pytest.mark.heavy
def test_rules_written_as_points_are_as_near_as_they_say() -> None:
    rules = rules_from_tree(random_tree(2), "raw")
    options: dict[str, Any] = {"curves": "points", "tolerance": 1e-2}
    with pytest.raises(LossError, match="as pmml without loss:\n  term"):
        write(rules, **options)
    written = write(rules, allow_loss=True, **options)
    assert b"<NormContinuous" in written.content
    assert b"<NormContinuous" not in write(rules).content
    bounds = [loss.bound for loss in written.losses if loss.bound is not None]
    assert max(bounds) <= 1e-2
    file = File(written.content)
    for row in probes(rules, limit=40):
        _, _, outputs = file.answer(row)
        expected = evaluate(rules, row)
        for k, strength in enumerate(expected.strengths, 1):
            found = outputs[f"strength of rule {k}"]
            assert found is None or abs(found - strength) <= max(bounds) + 1e-12


@pytest.mark.one_in(2)
@pytest.mark.parametrize("seed", range(4))
def test_points_are_pmmls_own_lists_on_request(seed: int) -> None:
    rules = with_points(rules_from_tree(random_tree(seed)), seed, share=1.0)
    assert write(rules, curves="points").losses == ()
    assert_alike(rules, curves="points", room=1e-12)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", [1, 2, 4, 6, 8, 12, 15, 16])
def test_a_system_has_the_references_bits(seed: int) -> None:
    system = random_system(seed)
    file = File(write(system).content)
    rows = random_rows(system, seed, 6)
    rows.append(rows[0] | {system.inputs[0]: math.nan})
    rows.append(rows[0] | {system.inputs[-1]: math.inf})
    for row in rows:
        expected = infer(system, row).outputs
        for found, number in zip(file.numbers(row), expected, strict=True):
            assert found == number or (found is None and math.isnan(number))


def test_a_system_may_have_any_names() -> None:
    how = Defuzzifier("weighted average")
    names = ("step 1", "step", "result", "number add")
    inputs = tuple(map(Variable, names))
    labels = (Term("four", Singleton(4.0)),)
    output = SystemOutput("a_", labels, None, None, how)
    rule = SystemRule(None, (Conclusion("a_", "four"),))
    written = write(FuzzySystem("s", inputs, (output,), (RuleBlock((rule,)),)))
    assert written.remarks == ()
    row = dict.fromkeys(names, 0.0)
    assert File(written.content).numbers(row) == [4.0]


def test_a_system_of_too_many_steps_is_refused() -> None:
    curve = Gaussian(0.0, 1.0)
    output = SystemOutput(
        "y",
        (Term("all", curve),),
        0.0,
        1.0,
        Defuzzifier("centroid", 50_000),
        "maximum",
    )
    rule = SystemRule(None, (Conclusion("y", "all"),))
    dirt = Variable("dirt", (Term("high", curve),))
    rules = (replace(rule, when=Proposition("dirt", ("high",))),)
    block = RuleBlock(rules, implication="minimum")
    with pytest.raises(
        LossError, match=r"fields, and engines handle no more than 20,000"
    ):
        write(FuzzySystem("s", (dirt,), (output,), (block,)))


def test_functions_that_pmml_lacks_are_named() -> None:
    angle = Formula(Call("atan2", (Name("dirt"), Number(2.0))))
    how = Defuzzifier("weighted average")
    output = SystemOutput("y", (Term("angle", angle),), None, None, how)
    dirt = Variable("dirt")
    block = RuleBlock((SystemRule(None, (Conclusion("y", "angle"),)),))
    with pytest.raises(LossError) as caught:
        write(FuzzySystem("s", (dirt,), (output,), (block,)))
    assert str(caught.value) == "cannot write s as pmml, which has no arc tangent 2"


def odd(*names: str, **semantics: str) -> RuleBase:
    low = Term("low", Points((0.0, 1.0), (1.0, 0.0)))
    high = Term("high", Points((0.0, 1.0), (0.0, 1.0)))
    first, second, label = names
    return RuleBase(
        "odd <&>\"'",
        (label, "class 2"),
        (Variable(first, (low, high)), Variable(second, (low, high))),
        (
            Rule((Proposition(first, ("low", "high"), hedges=("not",)),), "class 2"),
            Rule(
                (Proposition(first, ("low",)), Proposition(second, ("high",))), label, 7
            ),
            Rule((Proposition(second, ("high",), hedges=("not",)),), "class 2"),
            Rule((), label),
        ),
        Semantics(**semantics),  # type: ignore[arg-type]
    )


def test_propositions_of_all_kinds_are_written() -> None:
    assert_alike(odd("a", "b", "class 1"))


def test_names_may_be_those_that_the_file_uses_itself() -> None:
    rules = odd("class", "strength 1", "answer")
    assert_alike(rules)
    assert write(rules).remarks == ()


def test_names_with_blanks_and_signs_come_back_whole() -> None:
    names = ("a b <&>\"'", " ä 度 ", "]]> --")
    assert_alike(odd(*names))


def test_a_model_without_inputs_has_an_answer() -> None:
    assert_alike(random_tree(0, leaves=1))
    assert_alike(rules_from_tree(random_tree(0, leaves=1)))


def test_a_tree_may_be_deep() -> None:
    tree = random_tree(1, leaves=400, inputs=1, combinations=0.0)
    content = write(tree).content
    assert content.count(b"<Node ") == 1 + len(tree.nodes) + len(tree.leaves)


def test_the_same_model_has_the_same_bytes() -> None:
    rules = rules_from_tree(random_tree(4))
    assert write(rules).content == write(rules).content


def test_a_way_to_write_curves_that_does_not_exist_is_refused() -> None:
    wrong: Literal["exact"] = "sampled"  # type: ignore[assignment]
    with pytest.raises(ValueError, match="curves are exact or points, not 'sampled'"):
        write(random_tree(0), curves=wrong)
    with pytest.raises(ValueError, match="curves: points are for rules"):
        write(random_tree(0), curves="points")
