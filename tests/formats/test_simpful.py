"""Systems of simpful, and what `inference()` answers, against ours."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sklearn.datasets import load_iris

import fuzzytree as ft
from fuzzytree.errors import LossError
from fuzzytree.model import FuzzySystem
from fuzzytree.tables import FloatArray

simpful: Any = pytest.importorskip("simpful")

EPSILON = float(np.finfo(np.float64).eps)
DEGREE = 64 * EPSILON
"""How far a rule's degree of at most 1 can be off: simpful multiplies by `1 / width`
where we divide, `exp` may differ in the last place, and a condition joins a few."""
SETS: dict[str, Callable[[random.Random], Any]] = {
    "triangle": lambda chance: simpful.TriangleFuzzySet(*corners(chance, 3), ""),
    "trapezoid": lambda chance: simpful.TrapezoidFuzzySet(*corners(chance, 4), ""),
    "left shoulder": lambda _: simpful.TriangleFuzzySet(-1, -1, 2, ""),
    "right shoulder": lambda _: simpful.TrapezoidFuzzySet(0, 2, 3, 3, ""),
    "sigmoid": lambda chance: simpful.SigmoidFuzzySet(chance.random(), 3, ""),
    "falling": lambda chance: simpful.InvSigmoidFuzzySet(chance.random(), 4, ""),
    "gaussian": lambda chance: simpful.GaussianFuzzySet(chance.random(), 0.6, ""),
    "hollow": lambda chance: simpful.InvGaussianFuzzySet(chance.random(), 0.6, ""),
    "flat top": lambda _: simpful.DoubleGaussianFuzzySet(0, 0.5, 1, 0.2, ""),
    "crisp": lambda chance: simpful.CrispSet(*corners(chance, 2), ""),
    "points": lambda chance: simpful.FuzzySet(
        points=[[x, chance.random()] for x in corners(chance, 4)], term="points"
    ),
    "ends": lambda chance: simpful.FuzzySet(
        points=[[x, chance.random()] for x in corners(chance, 3)],
        term="ends",
        boundary_values=[0.25, 0.75],
    ),
}


def corners(chance: random.Random, count: int) -> list[float]:
    return sorted(chance.uniform(-1.0, 3.0) for _ in range(count))


def variable(chance: random.Random) -> Any:
    sets = []
    for term in chance.sample([*SETS], 4):
        one = SETS[term](chance)
        one._term = term.replace(" ", "_")
        sets.append(one)
    return simpful.LinguisticVariable(sets, universe_of_discourse=[-1, 3])


def condition(chance: random.Random, system: Any, depth: int = 2) -> str:
    if depth == 0 or chance.random() < 0.3:
        name = chance.choice(["a", "b"])
        term = chance.choice(system._lvs[name]._FSlist)._term
        text = f"({name} IS {term})"
        return f"(NOT {text})" if chance.random() < 0.2 else text
    parts = [condition(chance, system, depth - 1) for _ in range(2)]
    return f"({parts[0]} {chance.choice(['AND', 'OR'])} {parts[1]})"


def random_system(seed: int, *, is_sugeno: bool) -> Any:
    chance = random.Random(seed)
    operators = ["AND_PRODUCT"] if seed % 2 else None
    system = simpful.FuzzySystem(operators=operators, show_banner=False)
    for name in ("a", "b"):
        system.add_linguistic_variable(name, variable(chance))
    if is_sugeno:
        system.set_crisp_output_value("p", chance.uniform(-5.0, 5.0))
        system.set_output_function("q", "0.5*a - (b - 2)/4 + -1.5")
        system.set_output_function("r", "b*-2")
        ends = ["p", "q", "r"]
    else:
        system.add_linguistic_variable("o", simpful.AutoTriangle(3, ["p", "q", "r"]))
        ends = ["p", "q", "r"]
    while len(system._rules) < 6:
        weight = " WEIGHT 0.5" if len(system._rules) == 3 else ""
        then = f"(o IS {chance.choice(ends)}){weight}"
        # Its parser stumbles over some conditions that begin with NOT.
        with contextlib.suppress(Exception):
            system.add_rules([f"IF {condition(chance, system)} THEN {then}"])
    return system


def answers(system: Any, rows: FloatArray, names: tuple[str, ...]) -> FloatArray:
    found = []
    for row in rows.tolist():
        for name, value in zip(names, row, strict=True):
            system.set_variable(name, value)
        found.append(system.inference(ignore_warnings=True)["o"])
    return np.array(found, np.float64)


def rows_for(system: FuzzySystem, count: int) -> FloatArray:
    draw = np.random.default_rng(0)
    return draw.uniform(-1.5, 3.5, (count, len(system.inputs)))


@pytest.mark.one_in(4)
@pytest.mark.parametrize("seed", range(12))
def test_a_sugeno_system_answers_as_simpful_does(seed: int) -> None:
    theirs = random_system(seed, is_sugeno=True)
    ours = ft.from_simpful(theirs)
    rows = rows_for(ours, 200)
    found = ft.run(ours, rows)
    assert found.strengths is not None
    # An average passes on what its weights are off, divided by their sum.
    degrees = np.maximum(found.strengths.sum(axis=0), 1e-300)
    allowed = 2 * 12.0 * len(ours.rules) * DEGREE / degrees
    off = np.abs(found["o"] - answers(theirs, rows, ours.inputs))
    assert np.all(off <= allowed)
    assert np.median(allowed) < 1e-10  # what is allowed decides something


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", range(6))
def test_a_mamdani_system_answers_as_simpful_does(seed: int) -> None:
    theirs = random_system(seed, is_sugeno=False)
    ours = ft.from_simpful(theirs)
    rows = rows_for(ours, 20)
    found = ft.run(ours, rows)
    assert found.strengths is not None
    highest = np.maximum(found.strengths.max(axis=0), 1e-300)
    # Two sums of 1,000 numbers, and degrees off by DEGREE at each of them.
    allowed = 2_000 * EPSILON + 1_000 * DEGREE / highest
    off = np.abs(found["o"] - answers(theirs, rows, ours.inputs))
    assert np.all(off <= allowed)
    assert np.median(allowed) < 1e-9


def test_a_model_of_pyfume_answers_as_pyfume_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pyfume: Any = pytest.importorskip("pyfume")
    monkeypatch.chdir(tmp_path)  # it writes its text to a file
    values, labels = load_iris(return_X_y=True, as_frame=True)
    columns = ["sepal_length", "sepal_width", "petal_length", "petal_width"]
    table = values.set_axis(columns, axis=1).assign(kind=labels.astype(float))
    # It builds its model as Python text, of the numbers as numpy 1 showed them.
    with np.printoptions(legacy="1.25"):
        made = pyfume.pyFUME(dataframe=table, nr_clus=3, method="Takagi-Sugeno")
    theirs = made.get_model()
    found = ft.run(theirs, table)
    expected = []
    for row in values.to_numpy().tolist():
        for name, value in zip(columns, row, strict=True):
            theirs.set_variable(name, value)
        expected.append(theirs.Sugeno_inference()["OUTPUT"])
    assert found.strengths is not None
    allowed = 2 * 10.0 * 6 * DEGREE / found.strengths.sum(axis=0)
    assert np.all(np.abs(found["OUTPUT"] - expected) <= allowed)
    assert allowed.max() < 1e-9


def test_a_system_of_simpful_goes_wherever_a_model_goes() -> None:
    theirs = random_system(1, is_sugeno=True)
    rows = np.array([[0.5, 1.0]])
    ours = ft.from_simpful(theirs)
    assert ft.export(theirs, "fll") == ft.export(ours, "fll")
    assert ft.run(theirs, rows)["o"] == ft.run(ours, rows)["o"]
    ft.check(
        theirs, runtimes=["native"], settings=ft.CheckSettings(limit=50)
    ).raise_if_not_ok()


def test_no_rule_that_fires_answers_0_as_in_simpful() -> None:
    system = simpful.FuzzySystem(show_banner=False)
    fuzzy_set = simpful.CrispSet(0, 1, "low")
    system.add_linguistic_variable("a", simpful.LinguisticVariable([fuzzy_set]))
    system.set_crisp_output_value("p", 3.0)
    system.add_rules(["IF (a IS low) THEN (o IS p)"])
    found = ft.run(system, np.array([[0.5], [2.0]]))
    assert found["o"].tolist() == [3.0, 0.0]
    assert str(found) == "2 rows: o 0 to 3; 1 uncovered"


def small(rule: str = "IF (a IS low) THEN (o IS p)", function: str = "a") -> Any:
    system = simpful.FuzzySystem(show_banner=False)
    low = simpful.TriangleFuzzySet(0, 1, 2, "low")
    system.add_linguistic_variable("a", simpful.LinguisticVariable([low]))
    system.set_output_function("p", function)
    system.add_rules([rule])
    return system


def with_constant() -> Any:
    system = small()
    system.set_constant("a", 1.0)
    return system


def with_own_function() -> Any:
    system = small()
    own = simpful.FuzzySet(function=lambda value: value * 0.0, term="own")
    system.add_linguistic_variable("b", simpful.LinguisticVariable([own]))
    return system


def without_universe() -> Any:
    system = simpful.FuzzySystem(show_banner=False)
    low = simpful.TriangleFuzzySet(0, 1, 2, "low")
    for name in ("a", "o"):
        system.add_linguistic_variable(name, simpful.LinguisticVariable([low]))
    system.add_rules(["IF (a IS low) THEN (o IS low)"])
    return system


REFUSED: list[tuple[Callable[[], Any], str]] = [
    (with_constant, "'a' is set to a constant"),
    (with_own_function, "term 'own' of 'b' is a function"),
    (without_universe, "the output 'o' has no universe of discourse"),
    (
        lambda: small(function="a * a"),
        "the function 'a * a' of 'p' is no weighted sum of inputs",
    ),
    (
        lambda: small(function="__import__('os').getcwd()"),
        "the function \"__import__('os').getcwd()\" of 'p' is no weighted sum of "
        "inputs",
    ),
    (
        lambda: small("IF (b IS low) THEN (o IS p)"),
        "rule 1 uses 'b', which is no variable",
    ),
    (lambda: small("IF () THEN (o IS p)"), "rule 1 has an empty condition"),
    (
        lambda: small("IF (a IS low) XOR (a IS low) THEN (o IS p)"),
        "rule 1 uses the operator 'XOR'",
    ),
    (
        lambda: small("IF (a IS low) AND ((a IS low) AND_p (a IS low)) THEN (o IS p)"),
        "rule 1 uses both AND and AND_p",
    ),
    (
        lambda: small("IF (a IS low) THEN (o IS q)"),
        "a rule concludes 'q', which has no number",
    ),
    (
        lambda: small("IF (a IS low) THEN (o IS p) AND (r IS p)"),
        "rule 1 does not conclude one term of one output",
    ),
]


@pytest.mark.parametrize(
    ("build", "reason"), REFUSED, ids=[reason for _, reason in REFUSED]
)
def test_what_a_system_of_ours_cannot_hold_is_refused_with_its_reason(
    build: Callable[[], Any], reason: str
) -> None:
    with pytest.raises(LossError) as caught:
        ft.from_simpful(build())
    assert str(caught.value) == f"cannot read a FuzzySystem of simpful: {reason}"


def test_something_else_is_no_system_of_simpful() -> None:
    with pytest.raises(TypeError) as caught:
        ft.from_simpful("tipper")
    assert str(caught.value) == (
        "from_simpful reads a FuzzySystem of simpful, and not a value of type str"
    )
