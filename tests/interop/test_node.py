"""Node runs our JavaScript: the bits of the reference, and files that test themselves.

Doubles go to node and come back as bytes, so that no printing can hide a bit.
"""

from __future__ import annotations

import math
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.exporters.javascript import write
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
from fuzzytree.runtimes.written import numbers_of
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import Row, probes, system_probes
from fuzzytree.semantics.programs.bounds import error_bounds
from fuzzytree.semantics.programs.system_program import from_system
from fuzzytree.semantics.reference import descend, evaluate
from fuzzytree.semantics.samples import all_samples
from fuzzytree.testing import exporter_models, random_system, random_tree, with_points

if TYPE_CHECKING:
    from tests.interop.conftest import Need

WINE = Path(__file__).parents[2] / "examples" / "wine" / "wine.csv"
HOSTILE = (
    "*/ process.exit(3); /*",
    '"]; throw 1; ["',
    "</script><!-- -->",
    "`${process.exit(3)}` \\",
    "__proto__",
    "constructor",
    "é ☂ 😀",
)
Array = np.typing.NDArray[np.float64]


def answered(model: Document, rows: Sequence[Row]) -> Array:
    """Return what node makes of rows: of shape (rows, numbers for each)."""
    inputs = model.inputs
    values = np.array([[row[name] for row in rows] for name in inputs], np.float64)
    values = values.reshape(len(inputs), len(rows))
    classes = () if isinstance(model, FuzzySystem) else model.classes
    return numbers_of(write(model).content, "javascript", values, classes)


def expected(model: Model, row: Row) -> list[float]:
    if isinstance(model, FuzzyTree):
        answer = descend(model, row)
    else:
        answer = evaluate(model, row)
    label = -1 if answer.label is None else model.classes.index(answer.label)
    return [label, answer.rule, int(answer.status), *answer.strengths]


def same_bits(one: Array, other: Array) -> bool:
    """Return whether doubles are the same to the bit; all that is no number is one."""
    return bool(
        one.shape == other.shape
        and np.array_equal(np.isnan(one), np.isnan(other))
        and np.array_equal(
            np.where(np.isnan(one), 0.0, one).view(np.uint64),
            np.where(np.isnan(other), 0.0, other).view(np.uint64),
        )
    )


def hostile_rules() -> RuleBase:
    terms = tuple(Term(name, Band(high=1.0, right=2.0)) for name in HOSTILE)
    inputs = tuple(Variable(name, terms, unit=name) for name in HOSTILE)
    mix = Variable("mix */", terms, parts=tuple(Part(n, 0.5) for n in HOSTILE[:3]))
    rules = tuple(
        Rule(
            (Proposition(name, (name,)), Proposition(mix.name, HOSTILE[:2], ("not",))),
            name,
        )
        for name in HOSTILE
    )
    semantics = Semantics("product", HOSTILE[0], HOSTILE[1])
    return RuleBase("*/ `", HOSTILE, (*inputs, mix), rules, semantics)


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


@pytest.mark.one_in(6)
@pytest.mark.parametrize("name", models())
def test_node_has_the_bits_of_the_reference_on_all_probes(
    program: Need, name: str
) -> None:
    model = models()[name]
    rows = probes(model, limit=3000)
    program("node")
    found = answered(model, rows)
    assert len(rows) >= 100
    assert same_bits(found, np.array([expected(model, row) for row in rows]))


@pytest.mark.one_in(2)
@pytest.mark.parametrize("entry", [2.0, 25.0])
def test_node_answers_the_wine_table_as_the_reference(
    program: Need, entry: float
) -> None:
    program("node")
    tree = ft.learn(WINE, target="cultivar", settings=ft.LearningSettings(entry=entry))
    lines = WINE.read_text("utf-8").splitlines()
    header = lines[0].split(",")[:-1]  # without the class
    table = [
        dict(zip(header, map(float, line.split(",")[: len(header)]), strict=True))
        for line in lines[1:]
    ]
    relative, raw = rules_from_tree(tree, "relative"), rules_from_tree(tree, "raw")
    models: list[Model] = [tree, relative, raw]
    for model in models:
        found = answered(model, table)
        assert len(found) == 178
        assert same_bits(found, np.array([expected(model, row) for row in table]))


def systems(kind: str) -> dict[str, FuzzySystem]:
    if kind == "random":
        return {str(seed): random_system(seed) for seed in range(24)}
    models = {**all_samples(), **dict(exporter_models())}
    chosen = [*all_samples(), "a system with extreme numbers", "a system by lines"]
    return {n: m for n in chosen if isinstance(m := models[n], FuzzySystem)}


@pytest.mark.heavy
@pytest.mark.parametrize(("kind", "fewest"), [("samples", 4_000), ("random", 5_000)])
def test_node_has_the_numbers_of_every_system_within_derived_bounds(
    program: Need, kind: str, fewest: int
) -> None:
    program("node")
    exact = 0
    for name, system in systems(kind).items():
        rows = system_probes(system, limit=60)
        found = answered(system, rows)
        values = np.array([[row[n] for row in rows] for n in system.inputs])
        values = values.reshape(len(system.inputs), len(rows))
        kept = from_system(system, activations=True)
        order = [
            place
            for kind in ("output", "status", "activation")
            for place, one in enumerate(kept.results)
            if one.kind == kind
        ]
        bounds = error_bounds(kept, values)[order].T
        right = [infer(system, row) for row in rows]
        wanted = np.array(
            [[*one.outputs, int(one.status), *one.strengths] for one in right]
        )
        is_exact = bounds == 0.0
        exact += int(is_exact.sum())
        given, meant = found[is_exact], wanted[is_exact]
        assert same_bits(given, meant), name
        with np.errstate(invalid="ignore"):
            gap = np.where(found == wanted, 0.0, np.abs(found - wanted))
        gap[np.isnan(found) & np.isnan(wanted)] = 0.0
        assert (gap <= bounds).all(), name
    assert exact > fewest


def run_alone(node: str, file: Path) -> tuple[int, str]:
    done = subprocess.run(
        [node, str(file)], capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout


Kind = Literal["es", "script"]


@pytest.mark.one_in(6)
@pytest.mark.parametrize(("module", "suffix"), [("es", ".mjs"), ("script", ".js")])
@pytest.mark.parametrize("name", ["raw product", "tree", "system"])
def test_a_file_tests_itself_and_tells_changed_numbers(
    tmp_path: Path, program: Need, name: str, module: Kind, suffix: str
) -> None:
    node = program("node")
    model = all_samples()["Mamdani, centroid"] if name == "system" else models()[name]
    text = write(model, module=module).content.decode("ascii")
    file = tmp_path / f"a model #1{suffix}"
    file.write_text(text)
    code, said = run_alone(node, file)
    match = re.fullmatch(r"(\d+) of (\d+) examples answered as expected\n", said)
    assert code == 0
    assert match is not None
    assert match[1] == match[2]
    assert int(match[1]) >= 8
    body = text.index("EXAMPLES = [")
    table = text.index("const NODES" if name == "tree" else "function numbers")
    places = [
        found.start(1)
        for found in re.finditer(r"\d\.(\d)\d*", text)
        if table < found.start() < body
    ]
    failed = 0
    for place in places[:: max(len(places) // 4, 1)]:
        digit = "7" if text[place] != "7" else "2"
        file.write_text(text[:place] + digit + text[place + 1 :])
        code, said = run_alone(node, file)
        failed += code
        assert (code == 0) == (re.match(r"(\d+) of \1 ", said) is not None)
    assert failed > 0


def test_a_changed_comparison_fails_the_self_test(
    tmp_path: Path, program: Need
) -> None:
    text = write(models()["tree"]).content.decode("ascii")
    wrong = text.replace("table[middle] < a", "table[middle] <= a")
    assert wrong != text
    file = tmp_path / "model.mjs"
    file.write_text(wrong)
    code, said = run_alone(program("node"), file)
    assert code == 1
    assert " instead of " in said


USE = """
const given = Object.fromEntries(INPUTS.map((name) => [name, 0.5]));
const { label, rule } = decide(given);
console.log(JSON.stringify([label, rule, strengths(given).length]));
for (const wrong of [undefined, "1", null]) {
  const row = wrong === undefined ? {} : { ...given, [INPUTS[0]]: wrong };
  try { decide(row); } catch (error) { console.log(String(error)); }
}
try { answer([1]); } catch (error) { console.log(String(error)); }
"""
WAYS = {
    "import": ("es", 'import { INPUTS, answer, decide, strengths } from "./m.mjs";'),
    "require": (
        "script",
        'const { INPUTS, answer, decide, strengths } = require("./m.js");',
    ),
    "script element": (
        "script",
        'require("node:vm").runInThisContext(require("node:fs").readFileSync("m.js"));'
        "const { INPUTS, answer, decide, strengths } = fuzzytree.grip;",
    ),
}


@pytest.mark.parametrize("way", WAYS)
def test_inputs_are_given_by_name_and_what_is_no_number_is_refused(
    tmp_path: Path, program: Need, way: str
) -> None:
    low = Term("low", Band(high=1.0, right=3.0))
    inputs = (Variable("force", (low,)), Variable("__proto__", (low,)))
    rule = Rule(
        (Proposition("force", ("low",)), Proposition("__proto__", ("low",))), "soft"
    )
    rules = RuleBase("grip", ("soft",), inputs, (rule,))
    module, opening = WAYS[way]
    kind: Kind = "es" if module == "es" else "script"
    end = ".mjs" if kind == "es" else ".js"
    (tmp_path / f"m{end}").write_bytes(write(rules, module=kind).content)
    (tmp_path / f"use{end}").write_text(opening + USE)
    words = [program("node"), f"use{end}"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, check=True)
    assert done.stdout.decode().splitlines() == [
        '["soft",1,1]',
        'TypeError: no value for the input "force"',
        'TypeError: the value of the input "force" is no number',
        'TypeError: the value of the input "force" is no number',
        "RangeError: 1 values instead of 2",
    ]


@pytest.mark.heavy
def test_every_model_that_exporters_are_tried_on_tests_itself(
    tmp_path: Path, program: Need
) -> None:
    node, count = program("node"), 0
    for title, model in exporter_models():
        file = tmp_path / "model.mjs"
        file.write_bytes(write(model).content)
        code, said = run_alone(node, file)
        assert code == 0, (title, said)
        assert re.match(r"(\d+) of \1 ", said), (title, said)
        count += 1
    assert count > 60


def test_missing_values_are_told(program: Need) -> None:
    tree = random_tree(5)
    rows = [dict.fromkeys(tree.inputs, math.nan), dict.fromkeys(tree.inputs, math.inf)]
    program("node")
    found = answered(tree, rows)
    assert found.tolist() == [[-1.0, 0.0, 3.0]] * 2
