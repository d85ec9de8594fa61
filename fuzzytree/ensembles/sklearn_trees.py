"""Fitted trees and forests of scikit-learn; the library itself is not imported."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from fuzzytree.ensembles.trees import Ensemble, Tree
from fuzzytree.errors import LossError, ReadError
from fuzzytree.model import FloatArray
from fuzzytree.numerics import cuts_of_rounded

_FORESTS = ("RandomForest", "ExtraTrees")
_SINGLE_TREES = ("DecisionTree", "ExtraTree")
_AT_ZERO = -5e-324  # a score of 0 is above it


def is_sklearn(model: object) -> bool:
    """Return whether an object is an estimator of scikit-learn, and no model here."""
    if hasattr(model, "__fuzzytree__"):
        return False
    parents = inspect.getmro(type(model))
    if any(parent.__name__ == "Pipeline" for parent in parents):
        return False  # of scalers and a tree: `from_sklearn` folds them
    return any(parent.__module__.startswith("sklearn.") for parent in parents)


def from_estimator(model: Any, name: str = "the estimator") -> Ensemble:
    """Return a fitted tree, forest or boosted trees of scikit-learn.

    Raises:
        LossError: If it is something else, has several outputs, or tests categories.
        ValueError: If it is not fitted.
    """
    kind = next(
        (
            parent.__name__
            for parent in inspect.getmro(type(model))
            if parent.__module__.startswith("sklearn.")
        ),
        type(model).__name__,
    )
    family = kind.removesuffix("Classifier").removesuffix("Regressor")
    reader = _READERS.get(family)
    if reader is None:
        known = ", ".join(f"{each}Classifier and Regressor" for each in _READERS)
        raise LossError(f"{name}: a {kind} is no tree that is read here: {known}")
    if not hasattr(model, "n_features_in_"):
        raise ValueError(f"{name}: the {kind} is not fitted")
    if getattr(model, "n_outputs_", 1) != 1:
        raise LossError(f"{name}: a {kind} with {model.n_outputs_} outputs is not read")
    classes = None
    if kind.endswith("Classifier"):
        classes = np.ravel(model.classes_).tolist()
    ensemble = reader(model, kind, name, classes)
    if ensemble.highest_column >= int(model.n_features_in_):
        raise LossError(f"{name}: tests column {ensemble.highest_column + 1}, of "
                        f"{model.n_features_in_}")  # fmt: skip
    names = getattr(model, "feature_names_in_", None)
    return replace(ensemble, columns=None if names is None else names.tolist())


def _tree(tree: Any, values: FloatArray, name: str) -> Tree:
    """Return a tree of `sklearn.tree`, given the vectors of all its nodes."""
    return _from_nodes(
        tree.children_left,
        tree.children_right,
        tree.children_left < 0,
        tree.feature,
        cuts_of_rounded(np.where(tree.children_left < 0, 0.0, tree.threshold)),
        tree.missing_go_to_left,
        values,
        name,
    )


def _from_nodes(
    left: Any,
    right: Any,
    is_leaf: Any,
    columns: Any,
    cuts: FloatArray,
    missing: Any,
    values: FloatArray,
    name: str,
) -> Tree:
    """Return a tree of arrays in which leaves are nodes too.

    Raises:
        ReadError: If a child is not in them, as in a file that was changed.
    """
    inner = np.flatnonzero(~is_leaf)
    for child in (left[inner], right[inner]):
        if len(child) and not 0 <= child.min() <= child.max() < len(is_leaf):
            raise ReadError(f"{name}: a child of a node is not in the tree")
    numbers = np.empty(len(is_leaf), np.int64)
    numbers[inner] = np.arange(len(inner))
    numbers[is_leaf] = ~np.arange(int(is_leaf.sum()))
    return Tree.of(
        columns[inner],
        cuts[inner],
        np.asarray(missing)[inner] != 0,
        numbers[left[inner].astype(np.int64)],
        numbers[right[inner].astype(np.int64)],
        values[is_leaf],
        int(numbers[0]),
        name=name,
    )


def _accepts_missing(tree: Any) -> bool:
    """Return whether `predict` of a tree, or of a forest of such trees, takes NaN."""
    tags = tree.__sklearn_tags__()
    return bool(tags.input_tags.allow_nan) and tree.monotonic_cst is None


def _single(model: Any, kind: str, name: str, classes: Any) -> Ensemble:
    values = model.tree_.value[:, 0, :].astype(np.float64)
    return Ensemble(
        name,
        kind,
        [_tree(model.tree_, values, name)],
        np.zeros(values.shape[1]),
        decides="largest" if classes else "not",
        classes=classes,
        takes="float32",
        takes_missing=_accepts_missing(model),
        takes_infinite=False,
        width=int(model.n_features_in_),
    )


def _forest(model: Any, kind: str, name: str, classes: Any) -> Ensemble:
    count = len(model.estimators_)
    trees = [
        _tree(each.tree_, each.tree_.value[:, 0, :] / count, name)
        for each in model.estimators_
    ]
    return Ensemble(
        name,
        kind,
        trees,
        np.zeros(trees[0].values.shape[1]),
        decides="largest" if classes else "not",
        classes=classes,
        takes="float32",
        takes_missing=_accepts_missing(model.estimators_[0]),
        takes_infinite=False,
        width=int(model.n_features_in_),
    )


def _boosted(model: Any, kind: str, name: str, classes: Any) -> Ensemble:
    trees = []
    for stage in model.estimators_:
        for score, each in enumerate(stage):
            values = np.zeros((each.tree_.node_count, len(stage)))
            values[:, score] = each.tree_.value[:, 0, 0] * model.learning_rate
            trees.append(_tree(each.tree_, values, name))
    if getattr(model, "loss", "") == "exponential":
        raise LossError(f"{name}: a {kind} with the loss 'exponential' is not read")
    start = model._raw_predict_init(np.zeros((1, model.n_features_in_)))
    if not isinstance(model.init_, str) and not _is_constant(model.init_):
        raise LossError(f"{name}: a {kind} that starts from another model is not read")
    return Ensemble(
        name,
        kind,
        trees,
        np.ravel(start).astype(np.float64),
        takes="float32",
        takes_missing=False,
        takes_infinite=False,
        width=int(model.n_features_in_),
        **_decision(classes, model.estimators_.shape[1], bar=_AT_ZERO),
    )


def _is_constant(start: Any) -> bool:
    return type(start).__name__ in ("DummyClassifier", "DummyRegressor")


def _histogram(model: Any, kind: str, name: str, classes: Any) -> Ensemble:
    trees = []
    width = int(model.n_trees_per_iteration_)
    if getattr(model, "_preprocessor", None) is not None:
        raise LossError(f"{name}: a {kind} of columns with categories is not read")
    for stage in model._predictors:
        for score, predictor in enumerate(stage):
            nodes = predictor.nodes
            is_leaf = nodes["is_leaf"] != 0
            if nodes["is_categorical"][~is_leaf].any():
                raise LossError(f"{name}: a {kind} that tests categories is not read")
            values = np.zeros((len(nodes), width))
            values[:, score] = nodes["value"]
            trees.append(
                _from_nodes(
                    nodes["left"],
                    nodes["right"],
                    is_leaf,
                    nodes["feature_idx"].astype(np.int64),
                    np.where(is_leaf, 0.0, nodes["num_threshold"]),
                    nodes["missing_go_to_left"],
                    values,
                    name,
                )
            )
    link = getattr(model, "loss", "")
    if classes is None and link not in ("squared_error", "absolute_error", "quantile"):
        raise LossError(f"{name}: a {kind} with the loss {link!r} is not read")
    return Ensemble(
        name,
        kind,
        trees,
        np.ravel(model._baseline_prediction).astype(np.float64),
        width=int(model.n_features_in_),
        **_decision(classes, width),
    )


def _decision(classes: Any, scores: int, bar: float = 0.0) -> dict[str, Any]:
    """Return how boosted trees make outputs of scores."""
    if classes is None:
        return {}
    if scores == 1:
        return {
            "link": "logistic",
            "decides": "above",
            "classes": classes,
            "bar": bar,
        }
    return {"link": "softmax", "decides": "largest", "classes": classes}


_READERS: dict[str, Callable[[Any, str, str, Any], Ensemble]] = {
    **dict.fromkeys(_SINGLE_TREES, _single),
    **dict.fromkeys(_FORESTS, _forest),
    "GradientBoosting": _boosted,
    "HistGradientBoosting": _histogram,
}
