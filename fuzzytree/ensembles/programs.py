"""What runs a tree ensemble: scikit-learn, onnxruntime, XGBoost, LightGBM or ours."""

from __future__ import annotations

import contextlib
import functools
import inspect
import io
import os
import warnings
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fuzzytree.ensembles.boosters import (
    from_lightgbm,
    from_xgboost,
    run_lightgbm,
    run_xgboost,
)
from fuzzytree.ensembles.onnx_trees import NotOnnxError, OnnxTrees, from_onnx
from fuzzytree.ensembles.sklearn_trees import from_estimator, is_sklearn
from fuzzytree.ensembles.trees import Ensemble, Rows, Tree
from fuzzytree.errors import LossError, MissingExtraError, ReadError, install_hint
from fuzzytree.exporters import tree_tests
from fuzzytree.files import read_bounded
from fuzzytree.model import FloatArray, FuzzyTree, IntArray, stand_ins
from fuzzytree.model import version as own_version

_MOST_UNPACKED = 1 << 30  # bytes of a .skops file
_MOST_MEMBERS = 100_000
_TRUSTED = ("sklearn.ensemble.", "sklearn.tree.", "sklearn._loss.")
_PICKLE = (
    "is a pickle, which runs what it holds when it is loaded; write the estimator as "
    ".skops: skops.io.dump(model, 'model.skops')"
)
_OTHER_FILES = {
    **dict.fromkeys((".joblib", ".pickle", ".pkl"), _PICKLE),
    ".ubj": "is XGBoost's binary format; write JSON: booster.save_model('model.json')",
}
_TREES = b"TreeEnsemble"
_OWN_KEY = b"fuzzytree.format"  # in ONNX files that fuzzytree wrote


class Answers(NamedTuple):
    """What a program answers for some rows.

    Attributes:
        numbers: Probabilities or values, shape (rows, outputs).
        classes: The number of the class of each row; None of a regression.
    """

    numbers: FloatArray
    classes: IntArray | None


class Opened(NamedTuple):
    """A tree ensemble, and how the program that it is for runs it.

    Attributes:
        ensemble: What was read.
        program: The name and the version of what runs it, or which package is missing.
        run: Runs rows of a number type; None if the package is not installed.
        unread: What happens after the trees and is run, but not read.
        is_ours: Whether it can be a model here as well.
    """

    ensemble: Ensemble
    program: str
    run: Callable[[FloatArray, Rows], Answers] | None
    unread: Sequence[str] = ()
    is_ours: bool = False

    @property
    def width(self) -> int:
        """How many columns it takes, at least."""
        return max(self.ensemble.width or 0, self.ensemble.highest_column + 1)

    def named(self, name: str) -> Opened:
        """Return the same by another name."""
        return self._replace(ensemble=replace(self.ensemble, name=name))


def opened(source: object) -> Opened | None:
    """Return a tree ensemble; None if a source is none, or is ours.

    Args:
        source: A fitted estimator of scikit-learn, XGBoost or LightGBM, or the path of
            an ONNX or `.skops` file or of a model of XGBoost or LightGBM.

    Raises:
        ReadError: If a file cannot be read.
        LossError: If an estimator is of a kind that is not read.
        MissingExtraError: If what reads it is not installed.
    """
    saved = _saved_booster(source)
    if saved is not None:
        return _of_booster(*saved, type(source).__name__)
    if is_sklearn(source):
        result = _of_estimator(source, type(source).__name__)
        is_ours = result.ensemble.kind == "DecisionTreeClassifier"
        return result._replace(is_ours=is_ours)
    if not isinstance(source, str | os.PathLike):
        return None
    name, suffix = str(os.fspath(source)), Path(source).suffix.lower()
    if suffix in _OTHER_FILES:
        raise ReadError(f"{name}: {_OTHER_FILES[suffix]}")
    if suffix == ".skops":
        model = _unpacked(read_bounded(source), name)
        try:
            return _of_estimator(model, name)
        except (AttributeError, IndexError, KeyError, TypeError) as error:
            # Another type or another shape than scikit-learn gives an attribute.
            kind = type(model).__name__
            raise ReadError(f"{name}: holds no whole {kind}: {error}") from error
    if suffix == ".onnx":
        content = read_bounded(source)
        if _OWN_KEY in content or _TREES not in content:
            return None
        with contextlib.suppress(NotOnnxError):  # which other readers report
            return _of_onnx(content, name)
    if suffix in (".json", ".txt"):
        content = read_bounded(source)
        if suffix == ".txt" and not content.startswith(b"tree\n"):
            return None
        return _of_booster(content, suffix, name)
    return None


def _saved_booster(model: Any) -> tuple[bytes, str] | None:
    """Return what XGBoost or LightGBM saves of a fitted object, and the suffix."""
    packages = {
        parent.__module__.partition(".")[0] for parent in inspect.getmro(type(model))
    }
    if "xgboost" in packages:
        booster = model.get_booster() if hasattr(model, "get_booster") else model
        if hasattr(booster, "save_raw"):
            return bytes(booster.save_raw("json")), ".json"
    if "lightgbm" in packages:
        booster = model.booster_ if hasattr(type(model), "booster_") else model
        if hasattr(booster, "model_to_string"):
            return booster.model_to_string().encode(), ".txt"
    return None


def _of_booster(content: bytes, suffix: str, name: str) -> Opened:
    if suffix == ".json":
        ensemble = from_xgboost(content, name)
        return Opened(ensemble, *run_xgboost(content, ensemble))
    ensemble = from_lightgbm(content, name)
    return Opened(ensemble, *run_lightgbm(content, ensemble))


def _of_estimator(model: Any, name: str) -> Opened:
    ensemble = from_estimator(model, name)

    def run(rows: FloatArray, kind: Rows) -> Answers:
        table = rows.astype(kind)
        with warnings.catch_warnings():  # rows here have no names
            warnings.simplefilter("ignore", UserWarning)
            predicted = np.asarray(model.predict(table))
            if ensemble.classes is None:
                return Answers(predicted.astype(np.float64)[:, None], None)
            numbers = np.asarray(model.predict_proba(table), np.float64)
        return Answers(numbers, np.searchsorted(model.classes_, predicted))

    program = f"scikit-learn {version('scikit-learn')}"
    return Opened(ensemble, program, run)


def opened_tree(tree: FuzzyTree) -> Opened:
    """Return a tree of ours, of whose leaves only the classes are compared.

    Raises:
        LossError: If it cuts sums of columns or tests categories.
    """
    from fuzzytree.runtimes import baseline

    columns = tree.columns or tree.inputs
    places = {column: place for place, column in enumerate(columns)}
    if any(variable.parts or variable.categories for variable in tree.variables):
        raise LossError(
            f"{tree.name}: cuts sums of columns or tests categories, which no tree of "
            "another library does; compare its own files with `fuzzytree check`"
        )
    tests = tree_tests(tree)
    known = stand_ins(tree.variables)
    goes_left = [
        not known[test.variable] > test.cut if test.variable in known else True
        for test in tests
    ]
    labels = np.array([tree.classes.index(leaf.label) for leaf in tree.leaves])
    count = len(tests)
    children = [
        [child if child < count else ~(child - count) for child in (test.no, test.yes)]
        for test in tests
    ]
    grown = Tree.of(
        [places[test.variable] for test in tests],
        [test.cut for test in tests],
        goes_left,
        [pair[0] for pair in children],
        [pair[1] for pair in children],
        np.eye(len(tree.classes))[labels],
        0 if tests else -1,
        name=tree.name,
    )
    ensemble = Ensemble(
        tree.name,
        "FuzzyTree",
        [grown],
        np.zeros(len(tree.classes)),
        decides="largest",
        classes=tree.classes,
        takes_missing=all(name in known for name in tree.inputs),
        takes_infinite=False,
        width=len(columns),
        columns=columns,
    )
    used = [places[name] for name in tree.inputs]
    run_rows = baseline().load(tree)

    def run(rows: FloatArray, _kind: Rows) -> Answers:
        chosen = run_rows(np.ascontiguousarray(rows[:, used].T)).rule
        codes = np.where(chosen > 0, labels[chosen - 1], -1)
        return Answers(np.zeros((len(rows), 0)), codes)

    return Opened(ensemble, f"fuzzytree {own_version()}", run)


def _unpacked(content: bytes, name: str) -> Any:
    """Return the estimator of a `.skops` file, which is no pickle.

    Raises:
        ReadError: If it is none, unpacks to too much, or names what skops does not
            trust.
        MissingExtraError: If skops is not installed.
    """
    try:
        import skops.io
    except ImportError as error:
        text = f"{name}: reading .skops needs {install_hint('skops')}"
        raise MissingExtraError(text) from error
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
            size = sum(member.file_size for member in members)
            if size > _MOST_UNPACKED or len(members) > _MOST_MEMBERS:
                raise ReadError(f"{name}: unpacks to {size:,} bytes, too many to read")
        types = skops.io.get_untrusted_types(data=content)
        strange = [each for each in types if not each.startswith(_TRUSTED)]
        if strange:
            raise ReadError(
                f"{name}: names {', '.join(strange[:3])}, which no file may load"
            )
        return skops.io.loads(content, trusted=types)
    except ReadError:
        raise
    except Exception as error:
        # skops raises what its readers raise: of zip, JSON, types and numpy.
        raise ReadError(f"{name}: skops does not read it: {error}") from error


def _of_onnx(content: bytes, name: str) -> Opened:
    graph = from_onnx(content, name)
    try:
        import onnxruntime
    except ImportError:
        return Opened(graph.ensemble, "onnxruntime, which is not installed", None,
                      graph.unread)  # fmt: skip
    return Opened(
        graph.ensemble,
        f"onnxruntime {onnxruntime.__version__}",
        functools.partial(_run_onnx, _session(graph, name), graph),
        graph.unread,
    )


def _session(graph: OnnxTrees, name: str) -> Any:
    from fuzzytree.exporters import RUNTIME_ERRORS, first_line, open_bare

    try:
        return open_bare(graph.content)
    except RUNTIME_ERRORS as error:
        text = f"{name}: onnxruntime does not load it: {first_line(error)}"
        raise ReadError(text) from error


def _run_onnx(bare: Any, graph: OnnxTrees, rows: FloatArray, kind: Rows) -> Answers:
    """Run rows, which the caller of a graph rounds to the type of its input."""
    with np.errstate(over="ignore"):
        table = rows.astype(kind).astype(graph.ensemble.takes)
    names = [each for each in (graph.label, graph.output) if each is not None]
    results = dict(zip(names, bare(names, {graph.entrance: table}), strict=True))
    classes = graph.ensemble.classes
    numbers: Any = results[graph.output] if graph.output else np.zeros((len(rows), 0))
    if isinstance(numbers, list):  # of a ZipMap
        order = list(classes or numbers[0])
        numbers = [[row[each] for each in order] for row in numbers]
    numbers = np.asarray(numbers, np.float64).reshape(len(rows), -1)
    if graph.label is None or classes is None:
        return Answers(numbers, None)
    places: Mapping[object, int] = {each: place for place, each in enumerate(classes)}
    labels = [places.get(each, -1) for each in np.ravel(results[graph.label]).tolist()]
    return Answers(numbers, np.array(labels, np.int64))
