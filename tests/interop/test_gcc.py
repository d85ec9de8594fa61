"""Compilers take our C without a warning, and what they make of it tests itself."""

from __future__ import annotations

import itertools
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.errors import LossError
from fuzzytree.exporters.c import write_c
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
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import system_probes
from fuzzytree.semantics.reference import evaluate
from fuzzytree.semantics.samples import all_samples
from fuzzytree.tables import read_table
from fuzzytree.testing import random_system, random_tree, with_points

Need = Callable[[str], str]
WINE = Path(__file__).parents[2] / "examples" / "wine" / "wine.csv"
TIPPER = WINE.parents[1] / "tipper.fll"
STRICT = [
    *("-std=c99", "-pedantic", "-trigraphs", "-Wall", "-Wextra", "-Werror"),
    *("-Wconversion", "-Wshadow", "-Wundef", "-Wtrigraphs"),
    *("-Wmissing-prototypes", "-Wstrict-prototypes"),
]
COMPILERS = {
    "gcc": ["gcc -O0", "gcc -O2", "gcc -O3 -march=native", "gcc -Os"],
    "clang": ["clang -O0", "clang -O3 -march=native"],
    "tcc": ["tcc"],
}
Dtype = Literal["float64", "float32"]


def hostile_rules() -> RuleBase:
    names = (
        "*/ int x; /*",
        "??/ #error",
        '"; system("',
        "\\",
        "int",
        "é ☂",
        "A",
    )
    terms = tuple(Term(name, Band(high=1.0, right=2.0)) for name in names)
    inputs = tuple(Variable(name, terms, unit=name) for name in names)
    mix = Variable("mix */\\", terms, parts=tuple(Part(n, 0.5) for n in names[:3]))
    rules = tuple(
        Rule(
            (Proposition(name, (name,)), Proposition(mix.name, names[:2], ("not",))),
            name,
        )
        for name in names
    )
    semantics = Semantics("product", names[0], names[1])
    return RuleBase("*/ ??/ \\", names, (*inputs, mix), rules, semantics)


def one_rule() -> RuleBase:
    """Return a rule base without inputs, whose rule always holds."""
    return RuleBase("always", ("x",), (), (Rule((), "x"),))


def models() -> dict[str, Document]:
    tree = random_tree(3, leaves=12, combinations=0.5)
    plain = random_tree(2, leaves=9, combinations=0.0)
    wide = random_tree(4, leaves=300, inputs=5)
    return {
        "one leaf": random_tree(0, leaves=1),
        "no inputs": one_rule(),
        "tree": plain,
        "combined tree": tree,
        "wide tree": wide,
        "relative": rules_from_tree(plain),
        "raw product": rules_from_tree(tree, "raw", conjunction="product"),
        "points": with_points(rules_from_tree(tree), 7),
        "wide relative": rules_from_tree(wide),
        "wide raw": rules_from_tree(random_tree(5, leaves=40), "raw"),
        "hostile": hostile_rules(),
        "system tipper": ft.load(TIPPER),
        **{f"system {seed}": random_system(seed) for seed in range(6)},
    }


MODELS = models()


def compiled(source: Path, command: str, *options: str) -> Path:
    target = source.with_suffix(".out")
    words = [*command.split(), *options, str(source), "-o", str(target), "-lm"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, ""), command
    return target


def said_by(target: Path) -> tuple[int, str]:
    done = subprocess.run([target], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


def all_right(said: str) -> bool:
    found = re.fullmatch(r"(\d+) of (\d+) examples answered as expected\n", said)
    return found is not None and found[1] == found[2] and int(found[1]) >= 8


@pytest.mark.heavy
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_every_model_compiles_without_a_warning_and_tests_itself(
    tmp_path: Path, program: Need, compiler: str, dtype: Dtype
) -> None:
    program(compiler)
    for name, model in MODELS.items():
        if re.match(r"system \d", name) and dtype == "float32":
            continue  # few of their examples have a bound
        source = tmp_path / "model.c"
        try:
            source.write_bytes(write_c(model, dtype=dtype, name="m").content)
        except LossError:
            continue
        strict = STRICT if compiler != "tcc" else ["-std=c99", "-Wall", "-Werror"]
        for command in COMPILERS[compiler]:
            target = compiled(source, command, *strict, "-DM_SELFTEST")
            code, said = said_by(target)
            assert code == 0, (name, command, said)
            assert all_right(said), (name, command)


@pytest.mark.heavy
def test_a_processor_of_32_bits_gives_the_same_bits(
    tmp_path: Path, program: Need
) -> None:
    compiler, empty = program("gcc"), tmp_path / "empty.c"
    empty.write_text("#include <stdio.h>\nint main(void) { return 0; }\n")
    words = [compiler, "-m32", str(empty), "-o", str(tmp_path / "empty")]
    if subprocess.run(words, capture_output=True, check=False).returncode:
        pytest.skip("gcc makes no programs for 32 bits here")
    for name in ("combined tree", "relative", "wide raw", "points", "system 2"):
        source = tmp_path / "model.c"
        source.write_bytes(write_c(MODELS[name], name="m").content)
        command = "gcc -m32 -msse2 -mfpmath=sse -O2"
        code, said = said_by(compiled(source, command, *STRICT, "-DM_SELFTEST"))
        assert code == 0, said
        assert all_right(said)


@pytest.mark.one_in(4)
@pytest.mark.parametrize("name", ["tree", "relative", "raw product", "system tipper"])
def test_a_number_that_was_changed_fails_the_self_test(
    tmp_path: Path, program: Need, name: str
) -> None:
    program("gcc")
    text = write_c(MODELS[name], name="m").content.decode()
    tables, rest = text.split("#ifdef M_SELFTEST")
    source, failed = tmp_path / "model.c", 0
    places = [m.start(1) for m in re.finditer(r"0x1\.([0-9a-f])[0-9a-f]*p", tables)]
    chosen = places[:: max(len(places) // 24, 1)]
    for place in chosen:
        digit = "0" if tables[place] != "0" else "1"
        changed = tables[:place] + digit + tables[place + 1 :]
        source.write_text(f"{changed}#ifdef M_SELFTEST{rest}")
        code, said = said_by(compiled(source, "gcc -std=c99", "-DM_SELFTEST"))
        assert (code == 0) == all_right(said)
        failed += code
    assert failed > len(chosen) / 2


def test_another_answer_fails_the_self_test(tmp_path: Path, program: Need) -> None:
    program("gcc")
    source = tmp_path / "model.c"
    text = write_c(MODELS["tree"], name="m").content.decode()
    wrong = text.replace(
        "value[m_tree.line[place]] > ", "value[m_tree.line[place]] >= "
    )
    assert wrong != text
    source.write_text(wrong)
    code, said = said_by(compiled(source, "gcc -std=c99", "-DM_SELFTEST"))
    assert code == 1
    assert "example " in said
    assert not all_right(said)


def test_declarations_alone_are_a_header_for_c_and_c_plus_plus(
    tmp_path: Path, program: Need
) -> None:
    compiler = program("g++")
    model = rules_from_tree(random_tree(1))
    (tmp_path / "grip.c").write_bytes(write_c(model, name="grip").content)
    use = '#include <stdio.h>\n#define GRIP_HEADER\n#include "grip.c"\n'
    zeros = ", ".join("0" * len(model.inputs))
    use += f"int main(void) {{ grip_real x[GRIP_INPUTS] = {{{zeros}}}; "
    use += 'printf("%ld\\n", grip_decide(x).rule); return 0; }\n'
    (tmp_path / "main.cpp").write_text(use)
    words = ["gcc", "-std=c99", "-c", "grip.c", "-o", "grip.o"]
    subprocess.run(words, cwd=tmp_path, check=True)
    words = [compiler, "main.cpp", "grip.o", "-o", "use"]
    subprocess.run(words, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "use"], capture_output=True, check=True)
    expected = evaluate(model, dict.fromkeys(model.inputs, 0.0)).rule
    assert int(done.stdout) == expected


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("-std=c99 -ffast-math", "compile without -ffast-math"),
        ("-std=gnu99 -mfma", "compile with -std=c99, or with -ffp-contract=off"),
        ("-std=c99 -mfpmath=387", "numbers have other digits here"),
    ],
)
def test_what_would_change_numbers_does_not_compile(
    tmp_path: Path, program: Need, options: str, said: str
) -> None:
    program("gcc")
    source = tmp_path / "model.c"
    source.write_bytes(write_c(MODELS["relative"], name="m").content)
    words = ["gcc", *options.split(), "-c", str(source), "-o", str(tmp_path / "m.o")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert said in done.stderr


def seven_leaves() -> FuzzyTree:
    """Return a tree with seven leaves, each asked for once, over four inputs."""
    for seed in range(100):
        tree = random_tree(seed, leaves=7, combinations=0.0)
        cuts = sum(len(node.cuts) for node in tree.nodes)
        if cuts == 6 and len(tree.inputs) == 4:
            return tree
    raise AssertionError("no such tree")


@pytest.mark.heavy
@pytest.mark.parametrize(("dtype", "most"), [("float32", 160), ("float64", 200)])
def test_the_walk_of_seven_leaves_is_small_on_a_cortex_m0(
    tmp_path: Path, program: Need, dtype: Dtype, most: int
) -> None:
    compiler, size = program("arm-none-eabi-gcc"), program("arm-none-eabi-size")
    source, target = tmp_path / "model.c", tmp_path / "model.o"
    source.write_bytes(write_c(seven_leaves(), dtype=dtype, name="m").content)
    machine = ["-mcpu=cortex-m0", "-mthumb", "-Os", "-c"]
    words = [compiler, *STRICT, *machine, str(source), "-o", str(target)]
    subprocess.run(words, check=True)
    done = subprocess.run([size, target], capture_output=True, text=True, check=True)
    text, data, bss = map(int, done.stdout.splitlines()[1].split()[:3])
    assert 100 < text <= most
    assert data == bss == 0


def ten_thousand_rules() -> RuleBase:
    """Return rules for all combinations of ten ramps on four inputs."""
    inputs = tuple(Variable(name, tuple(map(_ramp, range(10)))) for name in "abcd")
    rules: list[Rule] = []
    for places in itertools.product(range(10), repeat=4):
        pairs = zip("abcd", places, strict=True)
        when = tuple(Proposition(name, (f"t{place}",)) for name, place in pairs)
        rules.append(Rule(when, "odd" if sum(places) % 2 else "even"))
    return RuleBase("grid", ("even", "odd"), inputs, tuple(rules))


def _ramp(place: int) -> Term:
    low = place - 0.1 * place - 0.5
    left, right = low - 0.7, low + 1.1
    return Term(f"t{place}", Band(low, low + 0.3, left, right))


@pytest.mark.heavy
def test_ten_thousand_rules_compile_and_run(tmp_path: Path, program: Need) -> None:
    program("gcc")
    source = tmp_path / "model.c"
    source.write_bytes(write_c(ten_thousand_rules(), name="m").content)
    target = compiled(source, "gcc -O2", "-std=c99", "-DM_SELFTEST")
    code, said = said_by(target)
    assert code == 0
    assert all_right(said)


@pytest.mark.heavy
@pytest.mark.parametrize("columns", [None, 2])
def test_compiled_c_answers_the_wine_table_as_native(
    program: Need, columns: int | None
) -> None:
    program("gcc")
    tree = ft.learn(
        WINE, target="cultivar", settings=ft.LearningSettings(columns_per_node=columns)
    )
    found = ft.check(tree, data=None, runtimes=["native", "c", "c best-first"])
    assert found.ok
    representations = {
        one.representation.partition(":")[0] for one in found.comparisons
    }
    assert {"c", "c best-first"} <= representations


@pytest.mark.heavy
@pytest.mark.parametrize("columns", [None, 1])
def test_compiled_c_has_the_strengths_of_every_rule_on_every_wine(
    program: Need, columns: int | None
) -> None:
    program("gcc")
    tree = ft.learn(
        WINE, target="cultivar", settings=ft.LearningSettings(columns_per_node=columns)
    )
    assert any(v.parts for v in tree.variables) == (columns is None)
    relative, raw = rules_from_tree(tree), rules_from_tree(tree, "raw")
    product = rules_from_tree(tree, "raw", conjunction="product")
    models: list[Model] = [tree, relative, raw, product]
    for model in models:
        table = read_table(WINE, target="cultivar")
        places = [table.columns.index(name) for name in model.inputs]
        values = np.asarray(table.values[places], np.float64)
        assert values.shape[1] == 178
        found = find_runtime("c").load(model)(values)
        right = find_runtime("reference").load(model)(values)
        np.testing.assert_array_equal(found.rule, right.rule)
        np.testing.assert_array_equal(found.status, right.status)
        if isinstance(model, RuleBase):
            assert found.strengths is not None
            assert len(found.strengths) == len(model.rules)
            np.testing.assert_array_equal(found.strengths, right.strengths)


SYSTEMS = {n: m for n, m in all_samples().items() if isinstance(m, FuzzySystem)}


@pytest.mark.heavy
@pytest.mark.parametrize("name", SYSTEMS)
def test_compiled_systems_have_the_references_numbers(program: Need, name: str) -> None:
    program("gcc")
    system = SYSTEMS[name]
    rows = system_probes(system, limit=200)
    assert len(rows) >= 20
    values = np.array([[row[column] for row in rows] for column in system.inputs])
    values = values.reshape(len(system.inputs), len(rows))
    found = find_runtime("c").load(system)(values)
    assert found.strengths is not None
    assert found.outputs is not None
    assert len(found.strengths) == len(system.rules)
    for row, numbers in zip(rows, found.outputs.T, strict=True):
        expected = infer(system, row).outputs
        for ours, theirs in zip(expected, numbers.tolist(), strict=True):
            # the mathematical library's own exp and pow
            is_near = ours == pytest.approx(theirs, rel=1e-12, abs=1e-12, nan_ok=True)
            assert is_near, (name, row)
