"""An engine of others (JPMML, in Java) runs our PMML files, and its schema holds."""

from __future__ import annotations

import importlib
import io
import itertools
import math
import zipfile
from pathlib import Path
from typing import Any

import pytest

from fuzzytree import LearningSettings, learn
from fuzzytree.exporters.pmml import write
from fuzzytree.model import FuzzySystem
from fuzzytree.model.rulebase import Kind, RuleBase, Semantics
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import probes
from fuzzytree.semantics.reference import Answer, descend, evaluate
from fuzzytree.testing import random_rows, random_system, random_tree, with_points

pytestmark = pytest.mark.heavy  # Java takes seconds to start

WINE = Path(__file__).parents[2] / "examples" / "wine" / "wine.csv"
KINDS: tuple[Kind, ...] = ("relative", "raw")


def answer(model: FuzzyTree | RuleBase, row: dict[str, float]) -> Answer:
    return evaluate(model, row) if isinstance(model, RuleBase) else descend(model, row)


def is_alike(found: Any, expected: float) -> bool:
    is_nothing = found is None or math.isnan(found)
    return is_nothing if math.isnan(expected) else bool(found == expected)


def assert_alike(
    model: FuzzyTree | RuleBase, rows: list[dict[str, float]], **options: Any
) -> None:
    """Compare classes, rule numbers and the bits of all strengths, row by row."""
    pandas = importlib.import_module("pandas")
    engine = importlib.import_module("jpmml_evaluator")
    evaluator = engine.make_evaluator(write(model, **options).content).verify()
    found = evaluator.evaluateAll(pandas.DataFrame(rows), error_col=None)[0]
    assert len(found) == len(rows)
    for (_, line), row in zip(found.iterrows(), rows, strict=True):
        expected = answer(model, row)
        given = line["answer"]
        assert (None if given != given else given) == expected.label
        if expected.rule:
            assert line["rule"] == str(expected.rule)
        for k, strength in enumerate(expected.strengths, 1):
            assert is_alike(line[f"strength of rule {k}"], strength)


def wine_rows(model: FuzzyTree | RuleBase) -> list[dict[str, float]]:
    pandas = importlib.import_module("pandas")
    table = pandas.read_csv(WINE)
    return [
        {name: float(row[name]) for name in model.inputs} for _, row in table.iterrows()
    ]


@pytest.mark.parametrize(("columns", "is_mixed"), [(None, True), (1, False)])
def test_the_wine_tree_and_its_rules_answer_alike_on_every_row(
    library: Any, columns: int | None, is_mixed: bool
) -> None:
    library("jpmml_evaluator")
    tree = learn(
        WINE, target="cultivar", settings=LearningSettings(columns_per_node=columns)
    )
    assert any(v.parts for v in tree.variables) == is_mixed
    models: list[FuzzyTree | RuleBase] = [tree]
    models += [rules_from_tree(tree, kind) for kind in KINDS]
    for model in models:
        rows = wine_rows(model)
        assert len(rows) == 178
        assert_alike(model, rows)
        assert_alike(model, [dict(row) for row in probes(model, limit=60)])


@pytest.mark.parametrize("seed", range(4))
def test_models_of_all_kinds_answer_alike_with_missing_and_infinite_values(
    library: Any, seed: int
) -> None:
    library("jpmml_evaluator")
    semantics = Semantics(("minimum", "product")[seed % 2], "class 1", "class 2")
    tree = random_tree(seed, semantics=semantics if seed < 2 else None)
    raw = rules_from_tree(tree, "raw")
    for model in (tree, rules_from_tree(tree), raw, with_points(raw, seed)):
        rows = [dict(row) for row in probes(model, limit=40)]
        for name in model.inputs:
            for value in (math.nan, math.inf, -math.inf):
                rows.append(rows[0] | {name: value})
        for one, other in itertools.product((1e308, math.inf, math.nan), repeat=2):
            signs = itertools.cycle((one, -other, -one, other))
            rows.append(dict(zip(model.inputs, signs, strict=False)))
        assert_alike(model, rows)


def system_rows(system: FuzzySystem) -> list[dict[str, float]]:
    rows = random_rows(system, 1, 40)
    for name in system.inputs:
        for value in (math.nan, math.inf, -math.inf):
            rows.append(rows[0] | {name: value})
    return rows


@pytest.mark.parametrize("seed", range(30))
def test_systems_of_all_kinds_give_the_references_numbers(
    library: Any, seed: int
) -> None:
    pandas = importlib.import_module("pandas")
    engine = importlib.import_module(library("jpmml_evaluator"))
    system = random_system(seed)
    rows = system_rows(system)
    evaluator = engine.make_evaluator(write(system).content).verify()
    found = evaluator.evaluateAll(pandas.DataFrame(rows), error_col=None)[0]
    for (_, line), row in zip(found.iterrows(), rows, strict=True):
        expected = infer(system, row).outputs
        for output, number in zip(system.outputs, expected, strict=True):
            given = line[output.name]
            if math.isnan(number):
                assert given is None or math.isnan(given)
            else:  # the engine's own exp and pow
                assert given == pytest.approx(number, rel=1e-14, abs=1e-300)


def test_relative_rules_written_as_points_decide_alike(library: Any) -> None:
    library("jpmml_evaluator")
    pandas = importlib.import_module("pandas")
    engine = importlib.import_module("jpmml_evaluator")
    rules = rules_from_tree(learn(WINE, target="cultivar"))
    written = write(rules, curves="points", tolerance=1e-3)
    assert written.losses == ()  # relative terms are lines already
    rows = wine_rows(rules) + [dict(row) for row in probes(rules, limit=60)]
    evaluator = engine.make_evaluator(written.content).verify()
    found = evaluator.evaluateAll(pandas.DataFrame(rows), error_col=None)[0]
    for (_, line), row in zip(found.iterrows(), rows, strict=True):
        expected = evaluate(rules, row)
        assert line["answer"] == expected.label
        for k, strength in enumerate(expected.strengths, 1):
            assert abs(line[f"strength of rule {k}"] - strength) <= 1e-12


def test_a_deep_tree_answers_alike(library: Any) -> None:
    library("jpmml_evaluator")
    tree = random_tree(1, leaves=300, inputs=2, combinations=0.0)
    assert_alike(tree, [dict(row) for row in probes(tree, limit=50)])


def test_our_files_are_valid_by_the_published_schema(library: Any) -> None:
    etree = importlib.import_module(f"{library('lxml')}.etree")
    engine = Path(importlib.import_module(library("jpmml_evaluator")).__file__ or "")
    (jar,) = (engine.parent / "dependencies").glob("pmml-model-1*.jar")
    with zipfile.ZipFile(jar) as archive:
        schema = etree.XMLSchema(etree.parse(io.BytesIO(archive.read("pmml.xsd"))))
    tree = random_tree(3, semantics=Semantics("minimum", "class 1", "class 2"))
    raw = rules_from_tree(tree, "raw")
    for model in (
        tree,
        rules_from_tree(tree),
        raw,
        with_points(raw, 1),
        random_system(0),
        random_system(15),
    ):
        schema.assertValid(etree.fromstring(write(model).content))
    points = write(raw, allow_loss=True, curves="points").content
    schema.assertValid(etree.fromstring(points))
