"""The verbs in Python: names, lines that run, and mistakes in sentences."""

from __future__ import annotations

import copy
import gc
import os
import pickle
import threading
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.tree import DecisionTreeClassifier

import fuzzytree as ft
from fuzzytree.api import answering
from fuzzytree.errors import LossError, ReadError, TableError
from fuzzytree.exporters.table import TABLE
from fuzzytree.model.contracts import Run, Runtime
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.model.values import remember
from fuzzytree.runtimes.onnxruntime import open_onnx
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.tables import FloatArray
from fuzzytree.testing import random_system, random_tree

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
WINE = EXAMPLES / "wine" / "wine.csv"
TREE = random_tree(3, inputs=3)
ROWS = np.random.default_rng(0).normal(size=(20, 3))
FEW = np.array([[1.0], [1.5], [2.0], [7.0], [7.5], [8.0]])
KINDS = ["soft"] * 3 + ["firm"] * 3


def test_every_public_name_is_there_and_listed() -> None:
    for name in ft.__all__:
        assert getattr(ft, name) is not None
    assert dir(ft) == sorted(ft.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError) as caught:
        ft.lern  # type: ignore[attr-defined] # noqa: B018
    assert str(caught.value) == "module 'fuzzytree' has no attribute 'lern'"


def test_the_lines_of_the_readme_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    table = pd.read_csv(WINE)
    tree = ft.learn(table, target="cultivar", name="wine")
    rules = ft.rules_from_tree(tree)
    assert str(rules).startswith("1. IF ")
    ft.save(rules, "wine.yaml")
    assert ft.load("wine.yaml") == rules
    answers = ft.run(rules, table)
    assert answers.class_strengths is not None
    assert answers.class_strengths.shape == (3, 178)
    onnx = ft.export(rules, "onnx").content
    result = ft.check(
        tree,
        rules,
        onnx,
        data=table,
        runtimes=["native"],
        settings=ft.CheckSettings(limit=500),
    )
    result.raise_if_not_ok()


FITTED = ft.FuzzyTreeClassifier().fit(FEW, KINDS)
VERBS: dict[str, Callable[[Any], object]] = {
    "audit": lambda model: (
        ft.audit(model, selection=ft.AuditSelection(select=["FT501"])).model
    ),
    "bench": lambda model: (
        ft.bench(
            model,
            select=["native"],
            settings=ft.BenchSettings(rows=(9,), budget_s=1),
        ).fingerprint
    ),
    "certify": lambda model: ft.certify(model).sentence,
    "check": lambda model: (
        ft.check(
            FITTED.tree_,
            model,
            runtimes=["native"],
            settings=ft.CheckSettings(limit=99),
        ).comparisons
    ),
    "check first": lambda model: (
        ft.check(
            model, runtimes=["native"], settings=ft.CheckSettings(limit=99)
        ).comparisons
    ),
    "convert": lambda model: ft.convert(model, "fcl", allow_loss=True).written,
    "diff": lambda model: ft.diff(model, model).verdict,
    "draw": lambda model: ft.draw(model).svg,
    "export": lambda model: ft.export(model, "onnx").content,
    "needs": lambda model: ft.needs(model).needs,
    "rules_from_tree": ft.rules_from_tree,
    "run": lambda model: ft.run(model, FEW).classes,
    "save": lambda model: ft.save(model, os.devnull, to="yaml").content,
    "stability": lambda model: (
        ft.stability(model, runtimes=["native"], select=["N3"]).ok
    ),
}


@pytest.mark.one_in(4)
@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_takes_a_fitted_classifier_as_its_tree(verb: str) -> None:
    assert VERBS[verb](FITTED) == VERBS[verb](FITTED.tree_)


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_refuses_a_classifier_that_is_not_fitted(verb: str) -> None:
    with pytest.raises(NotFittedError) as caught:
        VERBS[verb](clone(FITTED))
    assert str(caught.value) == (
        "This FuzzyTreeClassifier instance is not fitted yet. Call 'fit' with "
        "appropriate arguments before using this estimator."
    )


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_refuses_what_is_no_model_with_one_sentence(verb: str) -> None:
    with pytest.raises(TypeError) as caught:
        VERBS[verb]([FITTED])
    assert str(caught.value) == (
        "a model is a FuzzyTree, a RuleBase, a FuzzySystem, a fitted "
        "FuzzyTreeClassifier or DecisionTreeClassifier, a Pipeline that ends with the "
        "latter, a ControlSystem of scikit-fuzzy, a FuzzySystem of simpful, or the "
        "path of a file, and not a value of type list"
    )


def test_a_verb_takes_a_fitted_decision_tree_of_scikit_learn() -> None:
    grown = DecisionTreeClassifier().fit(FEW, KINDS)
    assert ft.run(grown, FEW).classes == KINDS
    assert ft.export(grown) == ft.export(ft.from_sklearn(grown))


def test_export_takes_the_path_of_a_file(tmp_path: Path) -> None:
    ft.save(TREE, tmp_path / "tree.yaml")
    assert ft.export(tmp_path / "tree.yaml", "onnx") == ft.export(TREE, "onnx")


def test_rules_are_refused_where_a_tree_is_needed() -> None:
    rules = ft.rules_from_tree(TREE)
    with pytest.raises(TypeError) as caught:
        ft.rules_from_tree(rules)
    message = f"rules_from_tree takes a tree, and {rules.name} is a rule base"
    assert str(caught.value) == message


def test_needs_drops_what_is_requested_and_proves_it() -> None:
    result = ft.needs(TREE, data=ROWS, uses=["tree"])
    assert result.ok
    assert result.needs.inputs == TREE.inputs


def test_explain_knows_a_code_and_the_id_of_a_finding() -> None:
    assert ft.explain("ft101-1a2b3c4d") == ft.explain("FT101")
    with pytest.raises(ValueError, match=r"^no code 'FT1O1'; "):
        ft.explain("FT1O1")
    with pytest.raises(TypeError) as caught:
        ft.explain(TREE)  # type: ignore[arg-type]  # what is refused
    message = "explain takes a code such as 'FT101', and not a FuzzyTree"
    assert str(caught.value) == message


def test_recheck_takes_an_audit_and_its_model(tmp_path: Path) -> None:
    model, audit = EXAMPLES / "grip.yaml", tmp_path / "audit.json"
    audit.write_text(
        ft.audit(model, selection=ft.AuditSelection(select=["FT101"])).to_json(),
        "utf-8",
    )
    assert not ft.recheck(audit, model).wrong
    other = tmp_path / "other.yaml"
    ft.save(random_tree(4, inputs=3), other)
    wrong = ft.recheck(audit, other).wrong
    assert wrong[-1] == "the domain has no side 'x1'"
    with pytest.raises(ReadError) as caught:
        ft.recheck(tmp_path / "no.json", model)
    assert str(caught.value).endswith("no.json: No such file or directory")


def test_what_python_shows_of_a_value_is_one_short_line() -> None:
    rules = ft.rules_from_tree(TREE)
    system = random_system(3)
    result = ft.check(
        TREE, rules, runtimes=["native"], settings=ft.CheckSettings(limit=99)
    )
    written = ft.export(TREE, "yaml")
    shown = [
        repr(one)
        for one in (
            TREE,
            rules,
            system,
            ft.run(rules, ROWS),
            ft.run(system, np.zeros((4, len(system.inputs)))),
            result,
            ft.audit(TREE, selection=ft.AuditSelection(select=["FT501"])),
            written,
            ft.needs(TREE, uses=["tree"]),
            ft.diff(TREE, TREE),
        )
    ]
    assert shown == [
        "FuzzyTree(5 nodes, 7 leaves, 3 inputs, 3 classes)",
        "RuleBase(7 rules, 3 inputs, 3 classes)",
        "FuzzySystem(8 rules, 3 inputs, 2 outputs)",
        "Predictions(20 rows, 3 classes)",
        "Outputs(4 rows, 2 outputs)",
        f"Agreement({len(result.comparisons)} comparisons, agrees)",
        "Audit(1 answer, 0 findings)",
        f"Written({len(written.content)} bytes, 0 losses, 0 remarks)",
        "Footprint(3 inputs, 16 removed)",
        "Difference(0 changes, decisions equal)",
    ]


def test_every_kind_of_table_gives_the_same_tree() -> None:
    columns = {"x1": FEW[:, 0].tolist(), "grip": KINDS}
    trees = [
        ft.learn(frame, target="grip")
        for frame in (pd.DataFrame(columns), pl.DataFrame(columns), pa.table(columns))
    ]
    trees.append(ft.learn(FEW, target=KINDS))
    assert all(tree == trees[0] for tree in trees)


def test_a_tree_has_the_name_of_its_file(tmp_path: Path) -> None:
    path = tmp_path / "grasps.csv"
    path.write_text(
        "x,grip\n" + "".join(f"{v[0]},{k}\n" for v, k in zip(FEW, KINDS, strict=True))
    )
    assert ft.learn(path, target="grip").name == "grasps"
    assert ft.learn(FEW, target=KINDS).name == "tree"


def test_units_are_kept_and_must_belong_to_a_column() -> None:
    tree = ft.learn(
        ft.table(FEW, columns=["force"]), target=KINDS, units={"force": "N"}
    )
    assert tree.variables[0].unit == "N"
    with pytest.raises(TableError) as caught:
        ft.learn(ft.table(FEW, columns=["force"]), target=KINDS, units={"slip": "mm"})
    message = "a unit for 'slip', which is no column; it has force"
    assert str(caught.value) == message


@pytest.mark.parametrize("rows", [ROWS, ROWS[:0], np.asfortranarray(ROWS)])
def test_every_representation_of_a_tree_predicts_alike(
    tmp_path: Path, rows: FloatArray
) -> None:
    path = tmp_path / "tree.onnx"
    content = ft.save(TREE, path).content
    expected = ft.run(TREE, rows).classes
    for representation in (
        ft.rules_from_tree(TREE),
        content,
        path,
        str(path),
        open_onnx(content, "tree.onnx"),
    ):
        result = ft.run(representation, rows)
        assert isinstance(result, ft.Predictions)
        assert result.classes == expected


def test_many_rows_are_answered_in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = ft.run(ft.rules_from_tree(TREE), ROWS).to_csv("rule")
    monkeypatch.setattr(answering, "_BLOCK", 7)
    assert ft.run(ft.rules_from_tree(TREE), ROWS).to_csv("rule") == expected


def test_strengths_are_left_out_on_request() -> None:
    rules = ft.rules_from_tree(TREE)
    assert ft.run(rules, ROWS, with_strengths=False).strengths is None


def test_an_array_of_another_width_is_refused() -> None:
    with pytest.raises(TableError) as caught:
        ft.run(msgspec.structs.replace(TREE, columns=("x1", "x2", "x3")), ROWS[:, :2])
    assert str(caught.value) == (
        "the array has 2 columns without names, and the model was learnt from 3: "
        "x1, x2, x3"
    )


def test_an_unknown_runtime_is_refused() -> None:
    with pytest.raises(ValueError, match="no runtime 'nativ'"):
        ft.run(TREE, ROWS, runtime="nativ")


@pytest.mark.parametrize("model", [TREE, ft.rules_from_tree(TREE)])
def test_what_was_saved_is_loaded(tmp_path: Path, model: FuzzyTree | RuleBase) -> None:
    path = tmp_path / "model.yaml"
    ft.save(model, path)
    assert ft.load(path) == model


def test_a_format_can_be_named_whatever_the_suffix(tmp_path: Path) -> None:
    path = tmp_path / "model.txt"
    ft.save(TREE, path, to="yaml")
    assert path.read_bytes() == ft.export(TREE, "yaml").content


def test_a_file_without_a_known_suffix_is_no_model(tmp_path: Path) -> None:
    with pytest.raises(ReadError) as caught:
        ft.load("model.txt")
    assert str(caught.value) == (
        "model.txt: no format of a model has the suffix '.txt'; "
        "models are read from yaml, fcl, fll, fis, fml"
    )


def test_an_unknown_format_is_refused() -> None:
    with pytest.raises(ValueError, match="no format") as caught:
        ft.export(TREE, "turtle")
    known = ", ".join(TABLE)
    assert str(caught.value) == f"no format 'turtle'; there is {known}"


def test_an_option_that_a_writer_does_not_have_is_refused() -> None:
    with pytest.raises(ValueError, match="no option") as caught:
        ft.export(TREE, "onnx", dtpe="float32")
    assert str(caught.value) == (
        "onnx has no option 'dtpe'; it has dtype, opset, ir, signature, columns, "
        "outputs, readable, plain, net, verify (did you mean 'dtype'?)"
    )


def test_check_takes_files_and_names_them(tmp_path: Path) -> None:
    yaml, onnx = tmp_path / "tree.yaml", tmp_path / "tree.onnx"
    ft.save(TREE, yaml)
    ft.save(TREE, onnx)
    result = ft.check(
        yaml, onnx, data=ROWS, runtimes=["native"], settings=ft.CheckSettings(limit=300)
    )
    assert isinstance(result, ft.Agreement)
    assert result.ok
    assert str(onnx) in {comparison.representation for comparison in result.comparisons}


def test_check_finds_a_file_of_another_model() -> None:
    other = random_tree(4, inputs=3)
    result = ft.check(
        TREE, other, runtimes=["native"], settings=ft.CheckSettings(limit=300)
    )
    assert not result.ok


def test_a_runtime_that_does_not_run_trees_says_so() -> None:
    with pytest.raises(LossError) as caught:
        ft.run(TREE, ROWS, runtime="best-first")
    assert str(caught.value) == (
        f"cannot run {TREE.name} in best-first: it runs rules, not a tree"
    )


def test_a_certificate_for_the_rows_of_a_table_counts_them() -> None:
    tree = random_tree(1, inputs=2, combinations=0)
    table = pd.DataFrame({name: [0.0, 1.0, 2.0] for name in tree.inputs})
    result = ft.certify(ft.rules_from_tree(tree), "mixed", data=table)
    assert (result.rows, result.dtype, result.unbounded) == (3, "mixed", 0)
    assert result.delta is not None


def test_a_number_type_that_does_not_exist_is_refused() -> None:
    text = r"^there is no number type 'float16'; there are float64, mixed, float32$"
    with pytest.raises(ValueError, match=text):
        ft.certify(random_tree(1), "float16")  # type: ignore[arg-type] # the mistake


def test_a_text_is_one_name_in_every_argument_that_takes_names() -> None:
    tree = random_tree(1)
    assert ft.check(tree, runtimes="native", settings=ft.CheckSettings(limit=100)).ok
    assert ft.stability(tree, runtimes="native", select="N3").ok
    assert ft.audit(tree, selection=ft.AuditSelection(select="FT501")).is_complete


def test_a_model_is_made_ready_once(monkeypatch: pytest.MonkeyPatch) -> None:
    loads: list[object] = []
    native = find_runtime("native")

    def load(model: object, *, with_strengths: bool = True) -> Run:
        loads.append(model)
        return native.load(model, with_strengths=with_strengths)

    def choose(name: str, model: object) -> Runtime:
        return msgspec.structs.replace(native, load=load)

    monkeypatch.setattr(answering, "_runtime", choose)
    tree = random_tree(5, inputs=3)
    first = [ft.run(tree, ROWS).names for _ in range(3)]
    assert loads == [tree]
    copies = pickle.loads(pickle.dumps(tree)), copy.copy(tree), copy.deepcopy(tree)
    for other in copies:
        assert other == tree
        assert ft.run(other, ROWS).names == first[0] == first[2]
    assert len(loads) == 4


def test_what_is_made_of_a_model_goes_with_it() -> None:
    tree = random_tree(6, inputs=3)
    ft.run(tree, ROWS, with_probabilities=bool(tree.semantics.sharpness))
    gone = weakref.ref(remember(tree, "token", threading.Event))
    del tree
    gc.collect()
    assert gone() is None
