"""Every written file gives the probabilities of the reference, bit for bit."""

from __future__ import annotations

import ctypes
import shutil
import sqlite3
import subprocess
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from fuzzytree.checking.comparing import ModelRun, compare, row_set
from fuzzytree.checking.files import ProgramFile, check_program
from fuzzytree.checking.subject import Subject
from fuzzytree.exporters import c, javascript, pmml, sql
from fuzzytree.exporters.onnx import write_onnx
from fuzzytree.model.agreement import Comparison
from fuzzytree.runtimes import native
from fuzzytree.runtimes.mixing import class_probabilities
from fuzzytree.runtimes.onnxruntime import open_onnx, prepare
from fuzzytree.runtimes.written import numbers_of
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import probe_values
from fuzzytree.testing import random_tree, rated

if TYPE_CHECKING:
    from pathlib import Path

    from fuzzytree.model.contracts import Dtype, FloatArray
    from fuzzytree.model.rulebase import RuleBase

SEEDS = pytest.mark.parametrize("seed", range(5))


def rules_of(seed: int) -> RuleBase:
    return rules_from_tree(rated(random_tree(seed), seed))


def expected(
    rules: RuleBase, values: FloatArray, dtype: Dtype = "float64"
) -> FloatArray:
    outcome = native.load(rules, dtype)(values)
    assert outcome.strengths is not None
    result = class_probabilities(rules, outcome.strengths, outcome.rule)
    assert result is not None
    return result


def rows_for(rules: RuleBase) -> FloatArray:
    return probe_values(rules, 120)


@SEEDS
@pytest.mark.parametrize("readable", [False, True])
@pytest.mark.parametrize("opset", [12, 13, 18, 26])
def test_onnx_has_them_as_an_output(seed: int, readable: bool, opset: int) -> None:
    rules = rules_of(seed)
    content = write_onnx(
        rules,
        outputs=("probabilities", "rule", "label"),
        readable=readable,
        opset=opset,
        ir=8 if opset < 24 else 12,
    ).content
    values = rows_for(rules)
    result = open_onnx(content, "rules.onnx").run(values).probabilities
    assert result is not None
    assert np.array_equal(result, expected(rules, values), equal_nan=True)


@SEEDS
@pytest.mark.parametrize("dtype", ["float64", "mixed", "float32"])
def test_onnxruntime_mixes_what_the_native_runtime_mixes(
    seed: int, dtype: Dtype
) -> None:
    rules = rules_of(seed)
    values = np.random.default_rng(seed).normal(0.0, 2.0, (len(rules.inputs), 300))
    result = prepare(rules, dtype=dtype, probabilities=True).run(values).probabilities
    assert result is not None
    assert np.array_equal(result, expected(rules, values, dtype))


@SEEDS
def test_a_comparison_finds_other_probabilities(seed: int) -> None:
    rules = rules_of(seed)
    rows = row_set(rules.inputs, probe_values(rules, 50), None)
    base = ModelRun("native", rules, native.load(rules)(rows.values))
    run = prepare(rules, probabilities=True).run
    found = ModelRun("onnx", rules, run(rows.values))
    assert compare(found, base, rows).verdict == "agrees"
    other = rated(rules, seed + 10)
    wrong = ModelRun("onnx", rules, prepare(other, probabilities=True).run(rows.values))
    result = compare(wrong, base, rows)
    assert result.verdict == "DISAGREES"
    assert any("probability of " in one for one in result.detail)


@SEEDS
@pytest.mark.skipif(not shutil.which("node"), reason="needs node")
def test_javascript_returns_them(seed: int, tmp_path: Path) -> None:
    rules = rules_of(seed)
    content = javascript.write(rules, probabilities=True).content
    values = rows_for(rules)
    result = numbers_of(content, "javascript", values, rules.classes)
    right = expected(rules, values)
    assert np.array_equal(result[:, 3 + len(rules.rules) :].T, right, equal_nan=True)
    path = tmp_path / "model.mjs"
    path.write_bytes(content)
    done = subprocess.run(["node", path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@SEEDS
@pytest.mark.parametrize("dialect", ["sqlite", "duckdb"])
@pytest.mark.parametrize("strengths", [False, True])
def test_sql_gives_a_column_for_each_class(
    seed: int, dialect: Any, strengths: bool
) -> None:
    rules = rules_of(seed)
    text = sql.write(rules, dialect=dialect, probabilities=True, strengths=strengths)
    values = rows_for(rules)
    engine: Any = sqlite3.connect(":memory:")
    if dialect == "duckdb":
        engine = pytest.importorskip("duckdb").connect()
    kind = "DOUBLE" if dialect == "duckdb" else "REAL"
    columns = ", ".join(f'"{name}" {kind}' for name in rules.inputs)
    engine.execute(f"CREATE TABLE data ({columns})")
    marks = ", ".join("?" * len(rules.inputs))
    engine.executemany(f"INSERT INTO data VALUES ({marks})", values.T.tolist())
    found = engine.execute(text.content.decode()).fetchall()
    engine.close()
    last = np.array([row[-len(rules.classes) :] for row in found], np.float64).T
    assert np.array_equal(last, expected(rules, values), equal_nan=True)


@SEEDS
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.skipif(not shutil.which("cc"), reason="needs a C compiler")
def test_c_fills_them_in(seed: int, dtype: Any, tmp_path: Path) -> None:
    rules = rules_of(seed)
    written = c.write_c(
        rules, dtype=dtype, name="it", probabilities=True, allow_loss=True
    )
    (tmp_path / "model.c").write_bytes(written.content)
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    library = tmp_path / "model.so"
    subprocess.run(
        ["cc", *flags, tmp_path / "model.c", "-o", library], check=True, cwd=tmp_path
    )
    real = ctypes.c_double if dtype == "float64" else ctypes.c_float

    class Answer(ctypes.Structure):
        _fields_ = [
            ("label", ctypes.c_int),
            ("rule", ctypes.c_long),
            ("status", ctypes.c_int),
        ]

    code = ctypes.CDLL(str(library))
    code.it_strengths.restype = Answer
    values = np.random.default_rng(seed).normal(0.0, 2.0, (len(rules.inputs), 80))
    values = values.astype(np.float32).astype(np.float64)
    values[0, :2] = np.nan
    right = expected(rules, values, dtype)
    for row, wanted in zip(values.T, right.T, strict=True):
        strengths, shares = (real * len(rules.rules))(), (ctypes.c_double * 9)()
        answer = code.it_strengths((real * len(row))(*row.tolist()), strengths)
        code.it_probabilities(answer, strengths, shares)
        found = [*shares][: len(rules.classes)]
        assert np.array_equal(found, wanted, equal_nan=True)


@pytest.mark.parametrize("write", [c.write_c, javascript.write, pmml.write, sql.write])
def test_what_has_no_probabilities_is_refused(write: Any) -> None:
    bare = rules_from_tree(random_tree(1))
    with pytest.raises(ValueError, match="has no probabilities"):
        write(bare, probabilities=True)
    with pytest.raises(ValueError, match="write its rules to have them"):
        write(rated(random_tree(1), 1), probabilities=True)


@pytest.mark.heavy
@SEEDS
@pytest.mark.skipif(not shutil.which("java"), reason="needs java")
def test_pmml_has_an_output_for_each_class(seed: int) -> None:
    engine = pytest.importorskip("jpmml_evaluator")
    pandas = pytest.importorskip("pandas")
    rules = rules_of(seed)
    content = pmml.write(rules, probabilities=True).content
    values = np.random.default_rng(seed).normal(0.0, 2.0, (len(rules.inputs), 60))
    evaluator = engine.make_evaluator(content).verify()
    table = pandas.DataFrame(dict(zip(rules.inputs, values, strict=True)))
    found = evaluator.evaluateAll(table, error_col=None)[0]
    names = [f"probability of class {name}" for name in rules.classes]
    assert np.array_equal(found[names].to_numpy(np.float64).T, expected(rules, values))


PROGRAMS = [
    ("c", c.write_c, {}),
    ("javascript", javascript.write, {}),
    ("sql", sql.write, {}),
    ("sql", sql.write, {"dialect": "duckdb", "strengths": True}),
    pytest.param("pmml", pmml.write, {}, marks=pytest.mark.heavy),
]


@pytest.mark.parametrize(("name", "write", "options"), PROGRAMS)
def test_check_runs_programs_with_probabilities(
    name: str, write: Any, options: dict[str, Any]
) -> None:
    if name == "pmml":
        pytest.importorskip("jpmml_evaluator")
    rules = rules_of(1)
    content = write(rules, probabilities=True, **options).content
    subject = Subject(rules, None, 40, terms="relative", tolerance=1e-6)
    found = [*check_program(subject, "it", ProgramFile(name, content))]
    assert [one.verdict for one in found if isinstance(one, Comparison)][:2] == [
        "agrees",
        "agrees",
    ]
    other = write(rated(rules, 9), probabilities=True, **options).content
    wrong = [*check_program(subject, "it", ProgramFile(name, other, True))]
    verdicts = [one.verdict for one in wrong if isinstance(one, Comparison)]
    assert verdicts[0] in ("DISAGREES", "rows only")
    if name in ("javascript", "sql"):
        assert "DISAGREES" in verdicts[1:]
