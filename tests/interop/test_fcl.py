"""Fuzzylite 6 and PyIT2FLS run our FCL files."""

from __future__ import annotations

import csv
import importlib
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pytest
from msgspec.structs import replace

from fuzzytree import LearningSettings, learn
from fuzzytree.errors import LossError
from fuzzytree.exporters.fcl import write
from fuzzytree.exporters.fcl_dialects import Dialect
from fuzzytree.exporters.fll import write as write_fll
from fuzzytree.formats.fcl.fcl_reader import read_fcl
from fuzzytree.model import And, Condition, Defuzzifier, FuzzySystem, Or
from fuzzytree.model.rulebase import Kind, Points
from fuzzytree.semantics import as_system, pointed
from fuzzytree.semantics.conversion.scores import winner
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import evaluate
from fuzzytree.semantics.samples import all_samples
from fuzzytree.testing import (
    exporter_models,
    random_rows,
    random_system,
    random_tree,
    with_points,
)
from tests.exporters.fcl_systems import tamed
from tests.interop.corpus_rows import EXACT
from tests.interop.fuzzylite_engine import file_rows, largest_difference, run_program

WINE = Path(__file__).parents[2] / "examples" / "wine" / "wine.csv"

NEAR = 1e-5
"""How far fuzzylite 6 moves answers by taking values within 1e-6 for equal."""

Row = Mapping[str, float]
Need = Callable[[str], str]


def _wine_rows(inputs: Sequence[str]) -> list[Row]:
    with WINE.open(newline="", encoding="utf-8") as file:
        return [
            {name: float(row[name]) for name in inputs} for row in csv.DictReader(file)
        ]


def _mixes(condition: Condition | None) -> bool:
    """Return whether a condition has an OR in an AND, or the other way round."""
    match condition:
        case And(parts=parts) | Or(parts=parts):
            return any(isinstance(part, And | Or) for part in parts)
        case _:
            return False


@pytest.mark.heavy
@pytest.mark.parametrize(("columns", "is_mixed"), [(None, True), (1, False)])
@pytest.mark.parametrize("kind", ["relative", "raw"])
@pytest.mark.parametrize("dialect", ["portable", "fuzzylite"])
def test_the_wine_rules_decide_alike_on_every_row(
    program: Need,
    tmp_path: Path,
    columns: int | None,
    is_mixed: bool,
    kind: Kind,
    dialect: Dialect,
) -> None:
    tree = learn(
        WINE, target="cultivar", settings=LearningSettings(columns_per_node=columns)
    )
    assert any(v.parts for v in tree.variables) == is_mixed
    rules = rules_from_tree(tree, kind)
    rows = _wine_rows(rules.inputs)
    assert len(rows) == 178
    written = write(rules, allow_loss=True, dialect=dialect, tolerance=1e-4)
    given = file_rows(rules, rows)
    path = program("fuzzylite")
    answers = run_program(path, written.content, given, tmp_path, kind="fcl")
    count = len(rules.rules)
    meant, _ = pointed(rules, 1e-4)
    system = as_system(meant)
    # Rules are counted in a format that has no place for OR within AND.
    if not any(_mixes(rule.when) for rule in system.rules):
        assert answers.rules == count + (count if dialect == "portable" else 1)
    ours = [infer(system, row).outputs for row in rows]
    assert all(any(scores) for scores in zip(*ours, strict=True))
    assert largest_difference(ours, answers.outputs) < NEAR
    model = rules if kind == "relative" else meant
    for row, outputs in zip(rows, answers.outputs, strict=True):
        assert winner(rules, outputs) == evaluate(model, row).label


@pytest.mark.heavy
@pytest.mark.parametrize("dialect", ["portable", "fuzzylite"])
@pytest.mark.parametrize("seed", range(3))
def test_scores_are_those_of_fuzzylite(
    program: Need, tmp_path: Path, seed: int, dialect: Dialect
) -> None:
    rules = rules_from_tree(random_tree(seed, leaves=6, combinations=0.0))
    rules = with_points(rules, seed, share=1.0)
    system = as_system(rules)
    rows = random_rows(system, seed, 60)
    written = write(rules, dialect=dialect)
    given = [list(row.values()) for row in rows]
    path = program("fuzzylite")
    answers = run_program(path, written.content, given, tmp_path, kind="fcl")
    ours = [infer(system, row).outputs for row in rows]
    assert largest_difference(ours, answers.outputs) < NEAR


SYSTEMS = (
    *("Sugeno, numbers", "Sugeno, linear", "Sugeno, formulas", "weighted sum"),
    *("Mamdani, centroid", "weights of rules", "hedges", "OR", "NOT"),
    *("gaussian curves", "sigmoid curves", "S curves", "several outputs"),
    *("several rule blocks", "product and algebraic sum", "Hamacher norms"),
    *("a default answer", "a conclusion without a condition"),
)


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_system_answers_alike_in_fuzzylite(
    program: Need, tmp_path: Path, name: str
) -> None:
    system = all_samples()[name]
    assert isinstance(system, FuzzySystem)
    rows = random_rows(system, 3, 40)
    written = write(system, dialect="fuzzylite")
    assert written.losses == ()
    given = [list(row.values()) for row in rows]
    path = program("fuzzylite")
    answers = run_program(path, written.content, given, tmp_path, kind="fcl")
    is_mixed = any(_mixes(rule.when) for rule in system.rules)
    assert answers.rules == len(system.rules) or is_mixed
    ours = [infer(system, row).outputs for row in rows]
    assert largest_difference(ours, answers.outputs) < NEAR


@pytest.mark.heavy
def test_fuzzylite_answers_random_systems_alike_in_both_of_its_languages(
    program: Need, tmp_path: Path
) -> None:
    path = program("fuzzylite")
    compared = ours_too = 0
    for seed in range(60):
        system = tamed(random_system(seed, formulas="none"), "fuzzylite")
        try:
            contents = {
                "fcl": write(system, dialect="fuzzylite").content,
                "fll": write_fll(system).content,
            }
        except LossError:
            continue
        rows = random_rows(system, seed, 12)
        given = [list(row.values()) for row in rows]
        fcl, fll = (
            run_program(path, content, given, tmp_path, kind=kind).outputs
            for kind, content in contents.items()
        )
        for row, one, other in zip(rows, fcl, fll, strict=True):
            ours = infer(system, row).outputs
            size = max([1.0, *(abs(number) for number in ours if number == number)])
            assert largest_difference([one], [other]) <= 1e-9 * size
            ours_too += largest_difference([one], [ours]) <= NEAR * size
            compared += 1
    assert compared >= 400
    assert ours_too >= 0.85 * compared  # it takes degrees below 1e-6 for none


ODD = [
    (title, model)
    for title, model in exporter_models()
    if isinstance(model, FuzzySystem) and title.startswith("a system named")
]


@pytest.mark.parametrize(("title", "system"), ODD, ids=range(len(ODD)))
def test_names_of_all_sorts_reach_fuzzylite(
    program: Need, tmp_path: Path, title: str, system: FuzzySystem
) -> None:
    written = write(system, dialect="fuzzylite", allow_loss=True)
    rows = random_rows(system, 8, 20)
    given = [list(row.values()) for row in rows]
    path = program("fuzzylite")
    answers = run_program(path, written.content, given, tmp_path, kind="fcl")
    assert answers.rules == len(system.rules), title
    ours = [infer(system, row).outputs for row in rows]
    assert largest_difference(ours, answers.outputs) < NEAR


def test_a_portable_system_answers_alike_in_fuzzylite(
    program: Need, tmp_path: Path
) -> None:
    system = all_samples()["a default answer"]
    assert isinstance(system, FuzzySystem)
    rows = random_rows(system, 4, 60)
    given = [list(row.values()) for row in rows]
    path = program("fuzzylite")
    answers = run_program(path, write(system).content, given, tmp_path, kind="fcl")
    assert answers.rules == len(system.rules)
    ours = [infer(system, row).outputs for row in rows]
    assert largest_difference(ours, answers.outputs) < EXACT


def _mamdani() -> FuzzySystem:
    """Return a system of points as the standard has it."""
    system = all_samples()["Mamdani, centroid"]
    assert isinstance(system, FuzzySystem)
    pointy, _ = pointed(system, 1e-3)
    outputs = tuple(
        replace(one, defuzzifier=Defuzzifier("centroid", 1000), default=0.0)
        for one in pointy.outputs
    )
    blocks = tuple(replace(one, conjunction="minimum") for one in pointy.blocks)
    made = replace(pointy, outputs=outputs, blocks=blocks)
    assert all(
        isinstance(label.function, Points)
        for one in made.all_variables
        for label in one.terms
    )
    return made


def test_a_mamdani_file_of_the_standard_answers_alike_in_pyit2fls(
    library: Need,
) -> None:
    fcl = importlib.import_module(library("pyit2fls")).FCL()
    system = _mamdani()
    (output,) = system.outputs
    assert output.low is not None
    assert output.high is not None
    text = write(system, dialect="iec").content.decode()
    _, variables, rules = fcl.parse_fcl(text)
    assert len(rules["rules"]) == len(system.rules)
    engine = fcl.generate(variables, rules)
    hundred = replace(output, defuzzifier=Defuzzifier("centroid", 100, "ends"))
    alike = replace(system, outputs=(hundred,))
    step = (output.high - output.low) / 99
    count = 0
    for row in random_rows(system, 5, 40):
        ours = infer(alike, row)
        is_covered = ours.outputs != (0.0,) and max(ours.strengths) > 0.0
        ends = zip(system.variables, row.values(), strict=True)
        if not is_covered or not all(_is_within(one, x) for one, x in ends):
            continue
        _, values = engine.evaluate(dict(row))
        (value,) = values.values()
        assert float(value) == pytest.approx(ours.outputs[0], abs=1e-6 * step)
        exact = infer(system, row).outputs[0]
        assert float(value) == pytest.approx(exact, abs=step)
        count += 1
    assert count >= 10


def _is_within(variable: object, value: float) -> bool:
    low, high = getattr(variable, "low", None), getattr(variable, "high", None)
    return (low is None or low <= value) and (high is None or value <= high)


def test_a_file_that_fuzzylite_wrote_of_ours_is_ours(
    program: Need, tmp_path: Path
) -> None:
    system = all_samples()["Mamdani, centroid"]
    assert isinstance(system, FuzzySystem)
    first, second = tmp_path / "ours.fcl", tmp_path / "theirs.fcl"
    first.write_bytes(write(system, dialect="fuzzylite").content)
    files = ("-i", str(first), "-if", "fcl", "-o", str(second), "-of", "fcl")
    command = [program("fuzzylite"), *files, "-decimals", "17"]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    again = read_fcl(second.read_bytes(), "theirs.fcl").model
    assert isinstance(again, FuzzySystem)
    for row in random_rows(system, 6, 30):
        ours, theirs = infer(system, row).outputs, infer(again, row).outputs
        assert largest_difference([ours], [theirs]) < EXACT
