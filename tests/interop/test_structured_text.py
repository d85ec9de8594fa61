"""Our Structured Text as parsers of others see it, and as our own evaluator runs it.

No engine that runs Structured Text can be installed from a registry of packages: so the
grammar is proved by two parsers of others, and the numbers by an evaluator of ours.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.errors import LossError
from fuzzytree.exporters.structured_text import write
from fuzzytree.model import FuzzySystem
from fuzzytree.model.contracts import Document, Model
from fuzzytree.model.rulebase import (
    Band,
    Part,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.model.tree import FuzzyTree, Leaf
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import Row, probes, system_probes
from fuzzytree.semantics.programs.bounds import error_bounds
from fuzzytree.semantics.programs.system_program import from_system
from fuzzytree.semantics.reference import descend, evaluate
from fuzzytree.semantics.samples import all_samples
from fuzzytree.testing import (
    exporter_models,
    random_system,
    random_tree,
    with_points,
)

if TYPE_CHECKING:
    from tests.interop.conftest import Need

WINE = Path(__file__).parents[2] / "examples" / "wine" / "wine.csv"
GRAMMAR = "tree_sitter_iec61131_3_st"
HOSTILE = (
    "*) class_number := 9; (*",
    "IF",
    "if",
    "v3",
    "K",
    "a__b",
    "_a",
    "1st",
    "é ☂ $ {attribute}",
    "strengths",
    "x" * 80,
    "x" * 80 + "y",
)


def hostile_rules() -> RuleBase:
    terms = tuple(Term(name, Band(high=1.0, right=2.0)) for name in HOSTILE)
    inputs = tuple(Variable(name, terms, unit=name) for name in HOSTILE)
    mix = Variable("mix *)", terms, parts=tuple(Part(n, 0.5) for n in HOSTILE[:3]))
    rules = tuple(
        Rule(
            (Proposition(name, (name,)), Proposition(mix.name, HOSTILE[:2], ("not",))),
            name,
        )
        for name in HOSTILE
    )
    semantics = Semantics("product", HOSTILE[0], HOSTILE[1])
    return RuleBase("*) END_IF; (*", HOSTILE, (*inputs, mix), rules, semantics)


def models() -> dict[str, Model]:
    tree = random_tree(3, leaves=12, combinations=0.5)
    return {
        "one leaf": FuzzyTree("one", ("a",), (), (), (Leaf("a"),)),
        "no inputs": RuleBase("always", ("x",), (), (Rule((), "x"),)),
        "tree": random_tree(2, leaves=9, combinations=0.0),
        "combined tree": tree,
        "relative": rules_from_tree(tree),
        "raw product": rules_from_tree(tree, "raw", conjunction="product"),
        "points": with_points(rules_from_tree(tree), 7),
        "hostile": hostile_rules(),
    }


def expected(model: Model, row: Row) -> tuple[int, int, int, tuple[float, ...]]:
    if isinstance(model, FuzzyTree):
        answer = descend(model, row)
    else:
        answer = evaluate(model, row)
    label = -1 if answer.label is None else model.classes.index(answer.label)
    strengths = tuple(0.0 if math.isnan(one) else one for one in answer.strengths)
    return label, answer.rule, int(answer.status), strengths


def compared(model: Model, rows: Sequence[Row]) -> int:
    """Return how many rows a function block answers as the reference, to the bit."""
    from tests.interop.st_evaluator import Block

    block = Block(write(model).content)
    names = block.sections.get("VAR_INPUT", [])
    for row in rows:
        given = dict(zip(names, (row[name] for name in model.inputs), strict=True))
        found = block(**given)
        strengths = tuple(found.get("strengths", {}).values())
        label, rule, status, right = expected(model, row)
        decision = (found["class_number"], found["rule"], found["status"])
        assert decision == (label, rule, status), row
        assert strengths == right, row  # every bit but the sign of a zero
    return len(rows)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("name", models())
def test_our_evaluator_has_the_bits_of_the_reference_on_probes(
    library: Need, name: str
) -> None:
    library(GRAMMAR)
    model = models()[name]
    assert compared(model, probes(model, limit=700)) >= 100


@pytest.mark.parametrize("entry", [2.0, 25.0])
def test_our_evaluator_answers_the_wine_table_as_the_reference(
    library: Need, entry: float
) -> None:
    library(GRAMMAR)
    tree = ft.learn(WINE, target="cultivar", settings=ft.LearningSettings(entry=entry))
    header, *lines = WINE.read_text("utf-8").splitlines()
    names = header.split(",")[:-1]
    table = [
        dict(zip(names, map(float, line.split(",")[:-1]), strict=True))
        for line in lines
    ]
    assert compared(tree, table) == 178
    assert compared(rules_from_tree(tree), table) == 178
    assert compared(rules_from_tree(tree, "raw"), table) == 178


def system_gaps(system: FuzzySystem, rows: Sequence[Row]) -> tuple[int, int]:
    """Return how many numbers were compared, and how many of them to the bit."""
    from tests.interop.st_evaluator import Block

    block = Block(write(system).content)
    inputs = block.sections.get("VAR_INPUT", [])
    *outputs, _, _ = block.sections["VAR_OUTPUT"]
    program = from_system(system)
    values = np.array([[row[name] for row in rows] for name in system.inputs])
    bounds = error_bounds(program, values.reshape(len(system.inputs), len(rows))).T
    count = exact = 0
    for row, allowed in zip(rows, bounds.tolist(), strict=True):
        given = dict(zip(inputs, (row[n] for n in system.inputs), strict=True))
        found, right = block(**given), infer(system, row)
        assert found["status"] == int(right.status) or max(allowed) > 0.0, row
        for number, (name, meant) in enumerate(
            zip(outputs, right.outputs, strict=True), 1
        ):
            most = allowed[number - 1]
            if not found["is_number"][number]:
                assert math.isnan(meant) or most == math.inf, (row, name, meant)
                assert found[name] == 0.0
            else:
                assert found[name] == meant or abs(found[name] - meant) <= most, row
            count += 1
            exact += most == 0.0
    return count, exact


@pytest.mark.parametrize(
    ("kind", "fewest"),
    [("samples", 500), pytest.param("random", 50, marks=pytest.mark.heavy)],
)
def test_our_evaluator_has_the_numbers_of_systems_within_derived_bounds(
    library: Need, kind: str, fewest: int
) -> None:
    library(GRAMMAR)
    systems = {n: m for n, m in all_samples().items() if isinstance(m, FuzzySystem)}
    if kind == "random":
        systems = {f"random {seed}": random_system(seed) for seed in range(60)}
    compared = exact = refused = 0
    for system in systems.values():
        try:
            write(system)
        except LossError:
            refused += 1
            continue
        found = system_gaps(system, system_probes(system, limit=40))
        compared, exact = compared + found[0], exact + found[1]
    assert compared > exact > fewest
    assert refused < len(systems) / (10 if kind == "samples" else 1)


def test_systems_in_real_are_near_those_in_double(library: Need) -> None:
    library(GRAMMAR)
    from tests.interop.st_evaluator import Block

    for name in ("Mamdani, centroid", "Sugeno, linear", "gaussian curves", "S curves"):
        system = all_samples()[name]
        assert isinstance(system, FuzzySystem)
        block = Block(write(system, dtype="float32").content)
        inputs, worst = block.sections["VAR_INPUT"], 0.0
        for number in range(40):
            row = dict.fromkeys(system.inputs, number / 4.0)
            found = block(**dict(zip(inputs, row.values(), strict=True)))
            right = infer(system, row)
            assert found["status"] == right.status
            (meant,) = right.outputs
            if not math.isnan(meant):
                output = found[block.sections["VAR_OUTPUT"][0]]
                worst = max(worst, abs(float(output) - meant))
        assert worst < 1e-5, name


def as_single(value: float) -> float:
    with np.errstate(over="ignore"):
        return float(np.float32(value))


def test_a_tree_in_real_answers_every_real_as_the_tree_in_double(library: Need) -> None:
    library(GRAMMAR)
    from tests.interop.st_evaluator import Block

    tree = random_tree(2, leaves=9, combinations=0.0)
    block = Block(write(tree, dtype="float32").content)
    cuts = {cut for node in tree.nodes for cut in node.cuts}
    rows = [{n: as_single(v) for n, v in r.items()} for r in probes(tree, limit=500)]
    for cut in cuts:  # the two singles beside each cut
        near = np.float32(cut)
        for value in (near, np.nextafter(near, np.float32(np.inf)), -near):
            rows.append(dict.fromkeys(tree.inputs, float(value)))
    for row in rows:
        found = block(**row)
        assert found["rule"] == descend(tree, row).rule, row


def test_rules_in_real_are_near_the_rules_in_double(library: Need) -> None:
    library(GRAMMAR)
    from tests.interop.st_evaluator import Block

    rules = rules_from_tree(random_tree(2, leaves=9, combinations=0.0))
    block = Block(write(rules, dtype="float32").content)
    worst = 0.0
    for row in probes(rules, limit=300)[:200]:
        single = {name: as_single(value) for name, value in row.items()}
        given = evaluate(rules, single)
        found = block(**single)
        if given.status == 3:
            continue
        strengths = np.array(list(found["strengths"].values()), np.float64)
        worst = max(worst, float(np.abs(strengths - given.strengths).max()))
    assert 0.0 < worst < 1e-4  # where flanks are not steep


def test_a_changed_constant_changes_an_answer(library: Need) -> None:
    library(GRAMMAR)
    from tests.interop.st_evaluator import Block

    tree = models()["tree"]
    text = write(tree).content
    rows = probes(tree, limit=500)
    block, changed = (
        Block(text),
        Block(text.replace(b"value_of_node > cut", b"value_of_node >= cut")),
    )
    names = block.sections["VAR_INPUT"]
    given = [dict(zip(names, row.values(), strict=True)) for row in rows]
    answers = [(block(**one)["rule"], changed(**one)["rule"]) for one in given]
    assert any(one != other for one, other in answers)


@pytest.mark.heavy
def test_a_grammar_of_others_takes_every_model(library: Need) -> None:
    library(GRAMMAR)
    from tests.interop.st_evaluator import Block

    refused: list[str] = []
    count = 0
    for title, model in exporter_models():
        try:
            block = Block(write(model).content)
        except LossError:
            refused.append(title)
            continue
        inputs = model.inputs
        assert len(block.sections.get("VAR_INPUT", [])) == len(inputs), title
        if isinstance(model, FuzzySystem):
            assert len(block.sections["VAR_OUTPUT"]) == len(model.outputs) + 2, title
        count += 1
    assert count > 60
    assert len(refused) < 5


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["tree", "combined tree", "hostile"])
def test_blark_parses_it_and_finds_its_variables(library: Need, name: str) -> None:
    library("blark")
    parse_source_code = importlib.import_module("blark.parse").parse_source_code

    every: dict[str, Document] = {**models(), **all_samples()}
    model = every[name]
    found = parse_source_code(write(model).content.decode("ascii"))
    assert found.exception is None
    (block,) = found.transform().items
    declared = [
        str(variable)
        for section in block.declarations
        if type(section).__name__ == "InputDeclarations"
        for item in section.items
        for variable in item.variables
    ]
    inputs = model.inputs
    assert len(declared) == len(inputs)
