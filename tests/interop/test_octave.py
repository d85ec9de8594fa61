"""Octave's fuzzy-logic-toolkit and fuzzylite 6 run our FIS files."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from sklearn import datasets

from fuzzytree import LearningSettings, learn
from fuzzytree.errors import LossError
from fuzzytree.exporters.fis import write
from fuzzytree.formats.fis.fis_reader import read_fis
from fuzzytree.learning import learn_arrays
from fuzzytree.model import FuzzySystem
from fuzzytree.model.rulebase import Kind, RuleBase
from fuzzytree.semantics import as_system, flattened
from fuzzytree.semantics.conversion.scores import winner
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import evaluate
from fuzzytree.testing import random_rows
from tests.exporters.test_fis import random_fis
from tests.interop.corpus_rows import EXACT
from tests.interop.fuzzylite_engine import file_rows, largest_difference, run_program
from tests.interop.fuzzylite_exact import compiled, exact_answers
from tests.interop.octave_engine import DISCRETEMF, answers

ROOT = Path(__file__).parents[2]
WINE = ROOT / "examples" / "wine" / "wine.csv"

NEAR = 1e-6
"""As far as fuzzylite 6 moves answers by taking values within 1e-6 for equal."""

WEAK = 1e-5
"""A rule of fuzzylite 6 that is weaker than 1e-6 does not fire."""

Need = Callable[[str], str]


def system_of(content: bytes) -> FuzzySystem:
    """Return what a file of ours says, as a system whose combinations are inputs."""
    model = read_fis(content, "model.fis").model
    if isinstance(model, RuleBase):
        model = flattened(as_system(model, always="term"))[0]
    assert isinstance(model, FuzzySystem)
    return model


def ours(content: bytes, rows: Sequence[Sequence[float]]) -> list[tuple[float, ...]]:
    system = system_of(content)
    return [
        infer(system, dict(zip(system.inputs, row, strict=True))).outputs
        for row in rows
    ]


@pytest.mark.heavy
def test_the_wine_rules_have_the_same_scores_in_octave_and_decide_alike(
    program: Need, tmp_path: Path
) -> None:
    octave = program("octave")
    files: dict[str, tuple[bytes, list[list[float]]]] = {}
    told: dict[str, tuple[RuleBase, list[dict[str, float]]]] = {}
    for columns in (None, 1):
        tree = learn(
            WINE, target="cultivar", settings=LearningSettings(columns_per_node=columns)
        )
        assert any(v.parts for v in tree.variables) == (columns is None)
        kinds: tuple[Kind, ...] = ("relative", "raw")
        for kind in kinds:
            rules = rules_from_tree(tree, kind)
            with WINE.open(newline="", encoding="utf-8") as file:
                rows = [
                    {name: float(row[name]) for name in rules.inputs}
                    for row in csv.DictReader(file)
                ]
            given = file_rows(rules, rows)
            written = write(rules, allow_loss=True, tolerance=1e-4)
            name = f"{kind}{columns}"
            files[name] = written.content, given
            told[name] = rules, rows
    found = answers(octave, tmp_path, files)
    for name, (content, given) in files.items():
        rules, rows = told[name]
        assert found[name].rules == len(rules.rules) + 1
        assert len(found[name].rows) == 178
        assert not any(map(math.isnan, (x for row in found[name].rows for x in row)))
        assert largest_difference(ours(content, given), found[name].rows) <= EXACT
        if rules.kind == "relative":
            for row, scores in zip(rows, found[name].rows, strict=True):
                assert winner(rules, scores) == evaluate(rules, row).label


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["iris", "breast_cancer"])
def test_octave_answers_every_row_that_a_tree_of_combinations_was_learnt_from(
    program: Need, tmp_path: Path, name: str
) -> None:
    values, labels = getattr(datasets, f"load_{name}")(return_X_y=True)
    columns = [f"x{k}" for k in range(values.shape[1])]
    classes = [f"c{k}" for k in range(int(labels.max()) + 1)]
    tree = learn_arrays(values, labels, columns=columns, classes=classes).tree
    assert any(one.parts for one in tree.variables)
    rules = rules_from_tree(tree)
    rows = [dict(zip(columns, row, strict=True)) for row in values.tolist()]
    written = write(rules, allow_loss=True, tolerance=1e-4)
    files = {name: (written.content, file_rows(rules, rows))}
    found = answers(program("octave"), tmp_path, files)[name]
    for row, scores in zip(rows, found.rows, strict=True):
        assert winner(rules, scores) == evaluate(rules, row).label


@pytest.mark.heavy
@pytest.mark.parametrize(("columns", "is_mixed"), [(None, True), (1, False)])
@pytest.mark.parametrize("kind", ["relative", "raw"])
def test_the_wine_rules_have_the_same_scores_in_fuzzylite(
    program: Need, tmp_path: Path, kind: Kind, columns: int | None, is_mixed: bool
) -> None:
    fuzzylite = program("fuzzylite")
    tree = learn(
        WINE, target="cultivar", settings=LearningSettings(columns_per_node=columns)
    )
    assert any(v.parts for v in tree.variables) == is_mixed
    rules = rules_from_tree(tree, kind)
    with WINE.open(newline="", encoding="utf-8") as file:
        rows = [
            {name: float(row[name]) for name in rules.inputs}
            for row in csv.DictReader(file)
        ]
    given = file_rows(rules, rows)
    content = write(rules, allow_loss=True, dialect="fuzzylite", tolerance=1e-4).content
    run = run_program(fuzzylite, content, given, tmp_path, kind="fis")
    assert run.rules == len(rules.rules) + 1
    assert len(run.outputs) == 178
    found = ours(content, given)
    assert largest_difference(found, run.outputs) <= NEAR
    for row, mine, scores in zip(rows, found, run.outputs, strict=True):
        assert winner(rules, scores) == winner(rules, mine)
        if kind == "relative":
            assert winner(rules, scores) == evaluate(rules, row).label


@pytest.mark.heavy
def test_random_systems_answer_alike_in_fuzzylite(
    program: Need, tmp_path: Path
) -> None:
    fuzzylite = program("fuzzylite")
    kinds: set[bool] = set()
    compared = close = 0
    exact = compiled(program("g++"), tmp_path)
    for seed in range(30):
        system = random_fis(seed, "fuzzylite")
        try:
            content = write(system, dialect="fuzzylite").content
        except LossError:
            continue
        rows = [[*row.values()] for row in random_rows(system, seed, 25)]
        run = run_program(fuzzylite, content, rows, tmp_path, kind="fis")
        nearly = exact_answers(exact, content, rows, "fis")
        assert run.rules == len(system.rules)
        kinds.add(system.outputs[0].defuzzifier.is_weighted)
        for row, usual, theirs in zip(rows, run.outputs, nearly, strict=True):
            inference = infer(system, dict(zip(system.inputs, row, strict=True)))
            if any(0.0 < one < WEAK for one in inference.strengths):
                continue
            sizes = [1.0, *(x for x in map(abs, inference.outputs) if x == x)]
            difference = largest_difference([inference.outputs], [theirs])
            assert difference <= 1e-9 * max(sizes), (seed, row)
            difference = largest_difference([inference.outputs], [usual])
            close += difference > 1e-9 * max(sizes)  # it takes 1e-6 for nothing
            compared += 1
    assert kinds == {True, False}
    assert compared >= 200
    assert close <= 0.05 * compared


def test_a_difference_of_sigmoids_is_octaves(program: Need, tmp_path: Path) -> None:
    kinds = ["dsigmf 2 5 2 1", "dsigmf 1 1 3 3", "dsigmf 1 1 1 3"]
    head = "[System]\nName='t'\nType='sugeno'\nVersion=2.0\nNumInputs=1\n"
    lines = [f"{head}NumOutputs={len(kinds)}", f"NumRules={2 * len(kinds)}"]
    lines += ["AndMethod='min'", "OrMethod='max'", "ImpMethod='min'"]
    lines += ["AggMethod='sum'", "DefuzzMethod='wtaver'", "", "[Input1]", "Name='heat'"]
    lines += ["Range=[-9 9]", f"NumMFs={len(kinds)}"]
    for k, kind in enumerate(kinds, 1):
        name, numbers = kind.split(" ", 1)
        lines.append(f"MF{k}='t{k}':'{name}',[{numbers}]")
    rules: list[str] = []
    for k in range(1, len(kinds) + 1):
        # A term's degree d answers d from 1 where it holds and 0 where it does not.
        lines += ["", f"[Output{k}]", f"Name='o{k}'", "Range=[0 1]", "NumMFs=2"]
        lines += ["MF1='no':'constant',[0]", "MF2='yes':'constant',[1]"]
        for sign, term in ((k, 2), (-k, 1)):
            then = " ".join(str(term if k == j + 1 else 0) for j in range(len(kinds)))
            rules.append(f"{sign}, {then} (1) : 1")
    content = "\n".join([*lines, "", "[Rules]", *rules, ""]).encode()
    rows = [[x / 4.0] for x in range(-32, 33)]
    result = answers(program("octave"), tmp_path, {"t": (content, rows)})["t"]
    system = read_fis(content, "t.fis", dialect="octave").model
    assert isinstance(system, FuzzySystem)
    own = [infer(system, {"heat": x}).outputs for (x,) in rows]
    assert largest_difference(own, result.rows) <= EXACT


@pytest.mark.heavy
def test_random_systems_answer_alike_in_octave(program: Need, tmp_path: Path) -> None:
    octave = program("octave")
    files: dict[str, tuple[bytes, list[list[float]]]] = {}
    kinds: set[bool] = set()
    for seed in range(30):
        system = random_fis(seed, "octave")
        kinds.add(system.outputs[0].defuzzifier.is_weighted)
        rows = [[*row.values()] for row in random_rows(system, seed, 25)]
        inside = [row for row in rows if all(-5.0 <= x <= 5.0 for x in row)]
        files[f"s{seed}"] = write(system).content, inside
    assert kinds == {True, False}
    found = answers(octave, tmp_path, files)
    compared = 0
    for name, (content, rows) in files.items():
        system = system_of(content)
        assert found[name].rules <= len(system.rules)
        for row, theirs in zip(rows, found[name].rows, strict=True):
            inference = infer(system, dict(zip(system.inputs, row, strict=True)))
            if any(map(math.isnan, inference.outputs)):
                continue  # Octave stops, or answers 0 / 0
            sizes = [1.0, *map(abs, inference.outputs)]
            assert largest_difference([inference.outputs], [theirs]) <= 1e-9 * max(
                sizes
            ), name
            compared += 1
    assert compared >= 200


def test_the_page_shows_the_function_for_points_that_is_tested() -> None:
    page = (ROOT / "docs" / "reference" / "fis.md").read_text(encoding="utf-8")
    assert f"```matlab\n{DISCRETEMF}```" in page
