r"""What converters make of trees: nine ways to differ, and conversions that are right.

    pip install skl2onnx onnxmltools lightgbm xgboost treelite m2cgen skops
    python benchmarks/conversions.py [--only D1,D5] [--page]

Each case fits a model and converts it. `fuzzytree.check` judges an ONNX file; what
writes none is run on rows at and beside the cuts, with and without missing values, in
both number types. The script fails if a conversion of the second table is not proved.
`--page` writes the tables into docs/how-to/why-your-converted-tree-differs.md, and all
figures into conversions.json beside it; cases whose packages are missing say so.
"""

from __future__ import annotations

import argparse
import ctypes
import importlib
import json
import os
import re
import shutil
import subprocess
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from sklearn import datasets, ensemble, tree

import fuzzytree as ft
from fuzzytree import ensembles
from fuzzytree.files import write_atomically

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs/how-to/why-your-converted-tree-differs.md"
FIGURES = PAGE.with_name("conversions.json")
PACKAGES = (
    *("scikit-learn", "skl2onnx", "onnx", "onnxruntime", "onnxmltools", "xgboost"),
    *("lightgbm", "treelite", "m2cgen", "protobuf", "hummingbird-ml"),
)
TYPES = ("float32", "float64")
KINDS = {f"D{number}" for number in range(1, 10)}
QUESTIONS = ("routes", "scores", "labels", "missing values")
COUNT = 2_000  # rows at and beside cuts
ROUNDING = 1e-4  # of a probability or a number; beyond it a row differs
HEADS = {
    "kinds": ("kind", "model", "converter", "PROVED", *TYPES),
    "right": ("model", "converter", "leaves", *QUESTIONS),
}
WORDS = {
    "other classes": "labels",
    "other numbers": "scores",
    "other answers with missing values": "with missing values",
}
COUNTED = re.compile(rf"({'|'.join(WORDS)}) in ([\d,]+)")

Figures = dict[str, Any]
Predict = Callable[[Any], Any]


class Case(NamedTuple):
    """A conversion; `kind` is some of `D1` to `D9`, or empty where it must be right."""

    kind: str
    model: str
    converter: str
    package: str
    judge: Callable[[Path], Figures]


def main() -> None:
    """Judge every case, and print or write the result."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", help="kinds with commas between them, such as D1,D5")
    parser.add_argument("--page", action="store_true", help="write the page")
    options = parser.parse_args()
    only = options.only.split(",") if options.only else None
    if only and (unknown := set(only) - KINDS):
        parser.error(f"--only: no kind {min(unknown)}; there are D1 to D9")
    if only and options.page:
        parser.error("--page is written of all kinds, not of --only")
    lines = []
    for case in CASES:
        if only is None or {*case.kind.split(", ")} & {*only}:
            lines.append(judged(case))
            print(*cells(lines[-1]), sep=" | ", flush=True)
    if options.page:
        write({"versions": versions(), "lines": lines})


def judged(case: Case) -> Figures:
    """Return what is known of a case after it ran; it may lack its package."""
    line: Figures = {"kind": case.kind, "model": case.model}
    line["converter"] = case.converter
    if case.package == "m2cgen" and not shutil.which("gcc"):
        return {**line, "remark": "not run: gcc is not installed"}
    if not is_installed(case.package):
        return {**line, "remark": f"not run: {case.package} is not installed"}
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of names of columns, and of other versions
        line |= case.judge(Path(folder))
    if not case.kind:
        for question in ("routes", "scores"):
            assert line["answers"][question] == ["PROVED", "PROVED"], line
        assert "DIFFER" not in line["answers"]["labels"], line
    return line


def is_installed(package: str) -> bool:
    """Return whether a package is there."""
    try:
        return bool(version(package))
    except PackageNotFoundError:
        return False


def versions() -> dict[str, str]:
    """Return the versions of all packages that are installed."""
    return {name: version(name) for name in PACKAGES if is_installed(name)}


# --- judged by check


def checked(model: Any, graph: Any, folder: Path) -> Figures:
    """Return the answers of `check` on a model and its graph."""
    path = folder / "model.onnx"
    path.write_bytes(graph.SerializeToString())
    agreement = ft.check(model, path)
    assert isinstance(agreement, ft.model.TreeAgreement)
    answers: dict[str, list[str]] = {}
    for answer in agreement.answers:
        answers.setdefault(answer.question, []).append(answer.verdict)
    differing = {
        answer.rows: {
            WORDS[word]: int(count.replace(",", ""))
            for word, count in COUNTED.findall(answer.sentence)
        }
        for answer in agreement.answers
        if answer.question == "programs"
    }
    return {"answers": answers, "leaves": agreement.leaves[0], "differing": differing}


def by_skl2onnx(fit: Callable[[], Any], folder: Path) -> Figures:
    """Judge a model of scikit-learn that skl2onnx converts."""
    from skl2onnx import to_onnx
    from skl2onnx.common import tree_ensemble

    model = fit()
    options = {"zipmap": False} if hasattr(model, "classes_") else None
    add_node = tree_ensemble.add_node

    def add(*arguments: Any, **named: Any) -> None:
        # protobuf 7 takes no boolean here, which stops HistGradientBoosting.
        way = int(named.pop("nodes_missing_value_tracks_true", 0))
        add_node(*arguments, nodes_missing_value_tracks_true=way, **named)

    tree_ensemble.add_node = add
    try:
        row = np.zeros((1, model.n_features_in_), np.float32)
        return checked(model, to_onnx(model, row, options=options), folder)
    finally:
        tree_ensemble.add_node = add_node


def as_it_is(fit: Callable[[], Any], _folder: Path) -> Figures:
    """Return whether skl2onnx converts a model beside the protobuf of today."""
    from skl2onnx import to_onnx

    model = fit()
    try:
        to_onnx(model, np.zeros((1, model.n_features_in_), np.float32))
    except ValueError as error:
        return {"remark": f"does not convert: {error.__cause__}".rstrip(".")}
    return {"remark": "converts"}


def by_onnxmltools(fit: Callable[[], Any], folder: Path) -> Figures:
    """Judge a model of LightGBM or XGBoost that onnxmltools converts."""
    import onnxmltools
    from onnxmltools.convert.common.data_types import FloatTensorType

    model = fit()
    types = [("X", FloatTensorType([None, model.n_features_in_]))]
    if hasattr(model, "booster_"):
        path = folder / "model.txt"
        model.booster_.save_model(path)
        is_classifier = hasattr(model, "classes_")
        options = {"zipmap": False} if is_classifier else {}
        graph = onnxmltools.convert_lightgbm(model, initial_types=types, **options)
    else:
        path = folder / "model.json"
        model.save_model(path)
        graph = onnxmltools.convert_xgboost(model, initial_types=types)
    return checked(path, graph, folder)


# --- judged by rows


def at_cuts(columns: Sequence[Any], kind: Any) -> Any:
    """Return rows of a number type at and beside cuts, and far from them.

    Example:
        >>> float(abs(at_cuts([np.array([0.5])], np.float64) - 0.5).min())
        0.0
    """
    draw = np.random.default_rng(0)
    table = np.zeros((COUNT, len(columns)), kind)
    for column, cuts in enumerate(columns):
        at = cuts.astype(kind)
        sides = [np.nextafter(at, kind(end)) for end in (-np.inf, np.inf)]
        far = draw.uniform(at.min(initial=0) - 1, at.max(initial=0) + 1, COUNT)
        table[:, column] = draw.choice(np.concatenate([at, *sides, far[: 1 + len(at)]]),
                                       COUNT)  # fmt: skip
    return table


def by_rows(fit: Callable[[], Any], convert: Callable[[Any, Path], Predict],
            folder: Path) -> Figures:  # fmt: skip
    """Run a model and what was made of it, on rows of both types and with holes."""
    model = fit()
    converted = convert(model, folder)
    source: object = model
    if hasattr(model, "booster_"):
        source = folder / "model.txt"
        model.booster_.save_model(source)
    elif hasattr(model, "get_booster"):
        source = folder / "model.json"
        model.save_model(source)
    opened = ensembles.opened(source)
    assert opened is not None
    columns = [
        np.concatenate(
            [each.cuts[each.columns == column] for each in opened.ensemble.trees]
        )
        for column in range(opened.width)
    ]
    predict = getattr(model, "predict_proba", model.predict)
    differing: dict[str, dict[str, int]] = {}
    largest = 0.0
    for kind in (np.float32, np.float64):
        table = at_cuts(columns, kind)
        holes = np.random.default_rng(1).random(table.shape) < 0.1
        with_holes = np.where(holes, np.asarray(np.nan, kind), table)
        counts = differing.setdefault(kind.__name__, {})
        for what, rows in (("scores", table), ("with missing values", with_holes)):
            apart = np.abs(last(predict(rows)) - last(converted(rows)))
            counts[what] = int((apart > ROUNDING).sum())
            largest = max(largest, float(apart.max()))
    return {"differing": differing, "rows": COUNT, "largest": largest}


def last(numbers: Any) -> Any:
    """Return the last number of each row: of two classes, that of the second."""
    numbers = np.asarray(numbers, np.float64)
    return numbers.reshape(len(numbers), -1)[:, -1]


def by_m2cgen(model: Any, folder: Path) -> Predict:
    """Return what runs the C that m2cgen writes, compiled with gcc."""
    import m2cgen

    source, library = folder / "model.c", folder / "model.so"
    code = m2cgen.export_to_c(model)
    source.write_text(code, "utf-8")
    subprocess.run(["gcc", "-O1", "-shared", "-fPIC", "-o", library, source, "-lm"],
                   check=True)  # fmt: skip
    score = ctypes.CDLL(str(library)).score
    is_vector = "void score" in code
    score.restype = None if is_vector else ctypes.c_double
    numbers = ctypes.c_double * 64

    def run(rows: Any) -> Any:
        results = []
        for row in rows.astype(np.float64):
            values, output = (ctypes.c_double * len(row))(*row), numbers()
            alone = score(values, output) if is_vector else score(values)
            results.append(output[1] if is_vector else alone)
        return np.array(results)

    return run


def by_treelite(model: Any, _folder: Path) -> Predict:
    """Return what runs a model in treelite's own interpreter."""
    import treelite

    if hasattr(model, "booster_"):
        forest = treelite.frontend.from_lightgbm(model.booster_)
    elif hasattr(model, "get_booster"):
        forest = treelite.frontend.from_xgboost(model.get_booster())
    else:
        forest = treelite.sklearn.import_model(model)
    return lambda rows: treelite.gtil.predict(forest, rows)


def by_hummingbird(model: Any, _folder: Path) -> Predict:
    """Return what runs a model as tensors of PyTorch."""
    converted = importlib.import_module("hummingbird.ml").convert(model, "pytorch")
    predict: Predict = getattr(converted, "predict_proba", converted.predict)
    return predict


# --- models


def sample(name: str) -> tuple[Any, Any]:
    """Return a table of scikit-learn in floats of 32 bits, and its labels."""
    values, labels = getattr(datasets, f"load_{name}")(return_X_y=True)
    return values.astype(np.float32), labels


def of_sklearn(name: str, table: str, **options: Any) -> Any:
    """Return a fitted model of scikit-learn."""
    kind = getattr(tree, name, None) or getattr(ensemble, name)
    return kind(random_state=0, **options).fit(*sample(table))


def of_lightgbm(values: Any = None, labels: Any = None, **options: Any) -> Any:
    """Return a fitted classifier of LightGBM; of breast cancer, if of nothing else."""
    import lightgbm

    if values is None:
        values, labels = sample("breast_cancer")
    model = lightgbm.LGBMClassifier(verbose=-1, n_jobs=1, **options)
    return model.fit(values, labels)


def of_xgboost(name: str, table: str, **options: Any) -> Any:
    """Return a fitted model of XGBoost."""
    import xgboost

    return getattr(xgboost, name)(n_jobs=1, **options).fit(*sample(table))


def with_zeros() -> Any:
    """Return a classifier of LightGBM to which 0 is a missing value."""
    values, labels = sample("breast_cancer")
    values = np.where(np.random.default_rng(1).random(values.shape) < 0.2, 0.0, values)
    return of_lightgbm(values, labels, n_estimators=20, zero_as_missing=True)


def of_decimals() -> Any:
    """Return boosted trees of a table with one decimal."""
    values = np.round(np.random.default_rng(0).normal(size=(2000, 4)), 1)
    labels = (values[:, 0] + values[:, 1] > 0.05).astype(int)
    model = ensemble.HistGradientBoostingClassifier(max_iter=20, random_state=0)
    return model.fit(values, labels)


TINY = "DecisionTreeClassifier, 2 leaves"
FOREST = "RandomForestClassifier, 20 trees"
BAGGING = {"boosting_type": "rf", "bagging_freq": 1, "bagging_fraction": 0.6}
tiny = partial(tree.DecisionTreeClassifier().fit, [[0.0], [0.0], [1.0]], [0, 0, 1])
halves = partial(tree.DecisionTreeRegressor().fit, [[0.1], [0.2]], [0.0, 1.0])
forest = partial(of_sklearn, "RandomForestClassifier", "breast_cancer", n_estimators=20)
random_forest = partial(of_lightgbm, n_estimators=10, **BAGGING)
lightgbm_20 = partial(of_lightgbm, n_estimators=20)


def onnx_case(kind: str, model: str, fit: Callable[[], Any], judge: Any) -> Case:
    """Return a case that `check` judges."""
    name = {by_skl2onnx: "skl2onnx", as_it_is: "skl2onnx"}.get(judge, "onnxmltools")
    return Case(kind, model, name, name, partial(judge, fit))


def row_case(kind: str, model: str, fit: Callable[[], Any], convert: Any) -> Case:
    """Return a case that is judged by rows."""
    name, package = {
        by_m2cgen: ("m2cgen, C", "m2cgen"),
        by_treelite: ("treelite", "treelite"),
        by_hummingbird: ("hummingbird", "hummingbird-ml"),
    }[convert]
    return Case(kind, model, name, package, partial(by_rows, fit, convert))


def right_cases() -> Iterator[Case]:
    """Yield conversions that are right where no value is missing."""
    for table in ("breast_cancer", "iris", "wine", "digits"):
        yield onnx_case(
            "",
            f"DecisionTreeClassifier, {table}",
            partial(of_sklearn, "DecisionTreeClassifier", table),
            by_skl2onnx,
        )
    for name, table, count in (
        ("RandomForestClassifier", "digits", 128),
        ("GradientBoostingClassifier", "breast_cancer", 50),
        ("GradientBoostingClassifier", "iris", 10),
        ("ExtraTreesRegressor", "diabetes", 10),
        ("RandomForestRegressor", "diabetes", 50),
    ):
        fit = partial(of_sklearn, name, table, n_estimators=count)
        parts = "rounds" if "Boosting" in name else "trees"
        yield onnx_case("", f"{name}, {table}, {count} {parts}", fit, by_skl2onnx)
    for name, table, count in (
        ("XGBClassifier", "breast_cancer", 20),
        ("XGBClassifier", "iris", 10),
        ("XGBClassifier", "wine", 10),
        ("XGBClassifier", "digits", 10),
        ("XGBRegressor", "diabetes", 50),
    ):
        fit = partial(of_xgboost, name, table, n_estimators=count)
        yield onnx_case("", f"{name}, {table}, {count} rounds", fit, by_onnxmltools)


CASES = (
    onnx_case("D1", TINY, tiny, by_skl2onnx),
    onnx_case("D1, D2", FOREST, forest, by_skl2onnx),
    row_case("D1, D8", FOREST, forest, by_m2cgen),
    row_case("D1, D8", FOREST, forest, by_treelite),
    onnx_case("D3", "HistGradientBoostingClassifier", of_decimals, by_skl2onnx),
    onnx_case("D4", "HistGradientBoostingClassifier", of_decimals, as_it_is),
    onnx_case("D5", "LightGBM, `rf`", random_forest, by_onnxmltools),
    row_case("D5", "LightGBM, `rf`", random_forest, by_treelite),
    onnx_case("D6", "LightGBM, `zero_as_missing`", with_zeros, by_onnxmltools),
    row_case("D6", "LightGBM, `zero_as_missing`", with_zeros, by_treelite),
    onnx_case("D7", "LightGBM, 20 rounds", lightgbm_20, by_onnxmltools),
    row_case("D7", "LightGBM, 20 rounds", lightgbm_20, by_treelite),
    row_case("D8", "DecisionTreeRegressor, 2 leaves", halves, by_m2cgen),
    row_case("D9", FOREST, forest, by_hummingbird),
    *right_cases(),
)


# --- the page


def cells(line: Figures) -> list[str]:
    """Return the cells of a line of a table.

    Example:
        >>> answers = {"routes": ["PROVED", "PROVED"], "scores": ["PROVED", "open"]}
        >>> line = {"model": "m", "converter": "c", "answers": answers}
        >>> cells({**line, "kind": ""})
        ['m', 'c', '', 'PROVED', 'PROVED, open', '', '']
        >>> cells({**line, "kind": "D1", "differing": {"float32": {"labels": 2}}})
        ['D1', 'm', 'c', 'routes', '2 labels', '']
    """
    answers = line.get("answers", {})
    head = [line["model"], line["converter"]]
    if not line["kind"]:
        leaves = f"{line['leaves']:,}" if "leaves" in line else ""
        verdicts = [
            ", ".join(dict.fromkeys(answers.get(each, []))) for each in QUESTIONS
        ]
        return [*head, leaves, *verdicts]
    proved = [each for each in QUESTIONS if {*answers.get(each, [])} == {"PROVED"}]
    shown = ", ".join(proved) or ("nothing" if answers else "")
    differing = line.get("differing", {})
    rows = [in_words(differing[each]) if each in differing else "" for each in TYPES]
    return [
        line["kind"],
        *head,
        shown,
        *([line["remark"], ""] if "remark" in line else rows),
    ]


def in_words(counts: Mapping[str, int]) -> str:
    """Return counts of rows in words.

    Example:
        >>> in_words({"scores": 1200, "with missing values": 0})
        '1,200 scores'
    """
    shown = [f"{count:,} {what}" for what, count in counts.items() if count]
    return ", ".join(shown) or "none"


def write(figures: Figures) -> None:
    """Write all figures, and the tables between their marks in the page."""
    write_atomically(FIGURES, f"{json.dumps(figures, indent=1)}\n".encode())
    text = PAGE.read_text("utf-8")
    names = ", ".join(
        f"{name} {number}" for name, number in figures["versions"].items()
    )
    for name, head in HEADS.items():
        lines = [
            cells(line)
            for line in figures["lines"]
            if bool(line["kind"]) == (name == "kinds")
        ]
        table = [head, ["---"] * len(head), *lines]
        shown = "".join(f"| {' | '.join(line)} |\n" for line in table)
        part = f"<!-- {name} -->\n\n{shown}\nWith {names}.\n\n<!-- end -->\n"
        pattern = rf"<!-- {name} -->\n.*?<!-- end -->\n"
        text = re.sub(pattern, part.replace("\\", r"\\"), text, flags=re.DOTALL)
    write_atomically(PAGE, text.encode())


if __name__ == "__main__":
    main()
