"""Generated Python: bits, hostile names, depth, and that it tests itself."""

from __future__ import annotations

import ast
import itertools
import math
import subprocess
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from fuzzytree.checking.comparing import same_bits
from fuzzytree.exporters.python import (
    _START,
    FORMAT,
    PythonSteps,
    parameters,
    write_python,
)
from fuzzytree.model.rulebase import (
    Band,
    Part,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
    fingerprint,
)
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import system_probes
from fuzzytree.semantics.programs.operations import NUMERIC, OPERATIONS
from fuzzytree.semantics.programs.steps import Maker, result_of
from fuzzytree.semantics.reference import descend, evaluate
from fuzzytree.testing import probes, random_system, random_tree

HOSTILE = (
    "import os; os.abort() #",
    '"""',
    "'; raise SystemExit #",
    "class",
    "1st col",
    "\\",
    "answer",
    "coding: utf-16",
    "{0} %s é ☂",
)


def executed(content: bytes) -> dict[str, Any]:
    space: dict[str, Any] = {"__name__": "generated"}
    exec(compile(content, "generated", "exec"), space)
    return space


def hostile_rules() -> RuleBase:
    terms = tuple(Term(name, Band(high=1.0, right=2.0)) for name in HOSTILE)
    inputs = tuple(Variable(name, terms, unit=name) for name in HOSTILE)
    mix = Variable("mix #", terms, parts=tuple(Part(n, 0.5) for n in HOSTILE[:3]))
    rules = tuple(
        Rule(
            (Proposition(name, (name,)), Proposition("mix #", HOSTILE[:2], ("not",))),
            name,
        )
        for name in HOSTILE
    )
    semantics = Semantics("product", HOSTILE[0], HOSTILE[1])
    return RuleBase('coding: latin-1 \'"""', HOSTILE, (*inputs, mix), rules, semantics)


@pytest.mark.parametrize("kind", ["tree", "relative", "raw"])
def test_decide_and_strengths_have_the_bits_of_the_reference(kind: str) -> None:
    tree = random_tree(8, leaves=9)
    rules = rules_from_tree(tree, "raw" if kind == "raw" else "relative")
    model = tree if kind == "tree" else rules
    space = executed(write_python(model).content)
    for row in probes(model, limit=200):
        answer = descend(tree, row) if kind == "tree" else evaluate(rules, row)
        assert space["decide"](**row) == (answer.label, answer.rule, answer.status)
        if kind != "tree":
            found = space["strengths"](**row)
            np.testing.assert_array_equal(found, answer.strengths)


@pytest.mark.parametrize("formulas", ["tame", "wild"])
def test_systems_have_the_bits_of_the_reference(
    formulas: Literal["tame", "wild"],
) -> None:
    for seed in range(24):
        system = random_system(seed, formulas=formulas, has_odd_names=seed % 2 == 0)
        answer = executed(write_python(system).content)["answer"]
        for row in system_probes(system, limit=60):
            right = infer(system, row)
            outputs, status, activations = answer([row[n] for n in system.inputs])
            assert status == right.status
            given = np.array([*outputs, *activations])
            wanted = np.array([*right.outputs, *right.strengths])
            assert same_bits(given, wanted).all(), seed


def test_what_python_fails_at_is_what_c_makes_of_it() -> None:
    numbers = (0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 3.0, -3.0, 1e308, math.inf, math.nan)
    for name, operation in NUMERIC.items():
        make = Maker()
        count = len(OPERATIONS[name].takes)
        inputs = tuple(f"x{k}" for k in range(count))
        if name == "where":
            continue
        place = make(name, *map(make.input, inputs))
        program = make.program("p", inputs, (result_of("output", "y", place),))
        steps = PythonSteps(program)
        space = executed(
            "".join([_START, *steps.function(("output", "status"))]).encode()
        )
        for row in itertools.product(numbers, repeat=count):
            given = np.array(space["numbers"](row))
            assert same_bits(given, np.array([operation(*row)])).all(), (name, row)


def test_hostile_names_stay_text() -> None:
    rules = hostile_rules()
    content = write_python(rules).content
    space = executed(content)
    row = dict.fromkeys(rules.inputs, 0.5)
    answer = evaluate(rules, row)
    assert space["answer"](list(row.values()))[:3] == (
        answer.label,
        answer.rule,
        answer.status,
    )
    names = parameters(rules.inputs)
    given = dict.fromkeys(names, math.nan)
    assert space["decide"](**given) == (HOSTILE[1], 0, 3)
    tree = ast.parse(content)
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import)]
    assert [alias.name for node in imports for alias in node.names] == ["math"]


def test_parameters_are_distinct_identifiers() -> None:
    names = parameters([*HOSTILE, "a b", "a-b", "a_b_2", "", "é"])
    assert len(set(names)) == len(HOSTILE) + 5
    assert all(name.isidentifier() and name.isascii() for name in names)
    assert "answer" not in names


def chain(length: int) -> FuzzyTree:
    """Return a tree as deep as it has nodes."""
    terms: list[Term] = []
    nodes: list[Node] = []
    for number in range(1, length + 1):
        cut = float(number)
        terms.append(Term(f"to {number}", Band(high=cut)))
        terms.append(Term(f"from {number}", Band(low=cut)))
        is_last = number == length
        nodes.append(
            Node(
                "x",
                (cut,),
                (0, 1),
                (
                    Branch((f"to {number}",), leaf=number),
                    Branch(
                        (f"from {number}",),
                        node=None if is_last else number + 1,
                        leaf=number + 1 if is_last else None,
                    ),
                ),
            )
        )
    leaves = tuple(Leaf("a") for _ in range(length + 1))
    return FuzzyTree(
        "deep", ("a",), (Variable("x", tuple(terms)),), tuple(nodes), leaves
    )


def test_a_tree_of_any_depth_can_be_written_and_run() -> None:
    tree = chain(1500)
    run = find_runtime("python").load(tree)
    assert run(np.array([[0.0, 700.5, 1e9]])).rule.tolist() == [1, 701, 1501]


@pytest.mark.parametrize("seed", [1, 4, 9])
def test_a_system_tests_itself(tmp_path: Path, seed: int) -> None:
    file = tmp_path / "system.py"
    content = write_python(random_system(seed)).content
    file.write_bytes(content)
    command = [sys.executable, "-I", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.endswith(" examples answered as expected\n")
    broken = content.replace(b"    return [\n        ", b"    return [\n        1.0 + ")
    file.write_bytes(broken)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "instead of" in done.stderr


def test_the_file_tests_itself_and_reports_a_changed_number(tmp_path: Path) -> None:
    file = tmp_path / "rules.py"
    content = write_python(rules_from_tree(random_tree(3))).content
    file.write_bytes(content)
    command = [sys.executable, "-I", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "7 examples answered as expected\n"
    broken = content.replace(b" == 0.0\n", b" >= 0.0\n")
    assert broken != content
    file.write_bytes(broken)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "instead of" in done.stderr


def test_a_category_is_its_name_or_its_place_and_an_unknown_one_is_missing() -> None:
    terms = (Term("far", Band(low=0.5)),)
    variables = (
        Variable("region", terms, categories=("north", "south")),
        Variable("size", terms),
    )
    rule = Rule((Proposition("region", ("far",)),), "a")
    rules = RuleBase("r", ("a",), variables, (rule,))
    space = executed(write_python(rules).content)
    rows = [["south", 2.0], [1, 2.0], ["north", 2.0], ["west", 2.0]]
    assert [space["answer"](row)[:3] for row in rows] == [
        ("a", 1, 0),
        ("a", 1, 0),
        (None, 0, 2),
        (None, 0, 3),
    ]
    assert space["decide"](region="south", size=2.0) == ("a", 1, 0)
    with pytest.raises(ValueError, match="could not convert string to float: 'big'"):
        space["answer"](["south", "big"])


def test_a_single_leaf_without_inputs_can_be_written() -> None:
    tree = FuzzyTree("one", ("a",), (), (), (Leaf("a"),))
    assert executed(write_python(tree).content)["decide"]() == ("a", 1, 0)


def test_the_same_model_gives_the_same_bytes_with_its_fingerprint() -> None:
    tree = random_tree(3)
    content = write_python(tree).content
    assert write_python(random_tree(3)).content == content
    assert f"# Fingerprint: {fingerprint(tree)}\n".encode() in content
    assert write_python(tree).losses == ()
    assert FORMAT.suffixes == (".py",)
