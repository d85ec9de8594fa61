"""Accuracy beside DecisionTree, GaussianNB and LDA, on the same ten folds.

Run it with `python benchmarks/accuracy.py`; it takes a minute or two. Our columns show
accuracy in per cent of `descent`, then leaves and features per node, all means over the
folds. Other tables can be named: `python benchmarks/accuracy.py moons xor`.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from typing import Literal

import numpy as np
import numpy.typing as npt
from sklearn import datasets
from sklearn.base import BaseEstimator
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.model_selection import StratifiedKFold, cross_val_score
from sklearn.naive_bayes import GaussianNB
from sklearn.tree import DecisionTreeClassifier

from fuzzytree.estimator import FuzzyTreeClassifier

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Table = tuple[FloatArray, IntArray]

FOLDS = 10
PAPERS = ("iris", "wine", "breast cancer", "digits")


def main() -> None:
    """Print a line for each table."""
    tables = all_tables()
    chosen = sys.argv[1:] or list(tables)
    print(
        "table           tree    nb   lda | paper  leaves | default  leaves  features"
    )
    for name in chosen:
        values, labels = tables[name]()
        peers = [
            DecisionTreeClassifier(random_state=0),
            GaussianNB(),
            LinearDiscriminantAnalysis(),
        ]
        others = " ".join(f"{peer_accuracy(p, values, labels):5.1f}" for p in peers)
        paper = our_accuracy("paper", values, labels)
        default = our_accuracy("default", values, labels)
        print(
            f"{name:14s} {others} | {paper[0]:5.1f} {paper[1]:7.1f} |"
            f" {default[0]:7.1f} {default[1]:7.1f} {default[2]:9.1f}",
            flush=True,
        )


def folds() -> StratifiedKFold:
    """Return the folds that everybody is measured on."""
    return StratifiedKFold(FOLDS, shuffle=True, random_state=0)


def peer_accuracy(peer: BaseEstimator, values: FloatArray, labels: IntArray) -> float:
    """Return the mean accuracy of another classifier in per cent."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # LDA tells of collinear columns
        return float(100 * cross_val_score(peer, values, labels, cv=folds()).mean())


def our_accuracy(
    mode: Literal["default", "paper"], values: FloatArray, labels: IntArray
) -> tuple[float, float, float]:
    """Return accuracy in per cent, leaves and features per node, means over folds."""
    facts: list[tuple[float, float, float]] = []
    for learn, answer in folds().split(values, labels):
        model = FuzzyTreeClassifier(mode=mode).fit(values[learn], labels[learn])
        right = float((model.predict(values[answer]) == labels[answer]).mean())
        report = model.report_
        needed = float(np.mean(report.features_per_node or (0,)))
        facts.append((100 * right, float(report.leaves), needed))
    accuracy, leaves, features = np.mean(facts, axis=0).tolist()
    return accuracy, leaves, features


def all_tables() -> dict[str, Callable[[], Table]]:
    """Return tables by name: four from the issue, the others made here."""
    return {
        "iris": lambda: datasets.load_iris(return_X_y=True),
        "wine": lambda: datasets.load_wine(return_X_y=True),
        "breast cancer": lambda: datasets.load_breast_cancer(return_X_y=True),
        "digits": lambda: datasets.load_digits(return_X_y=True),
        "moons": lambda: datasets.make_moons(600, noise=0.2, random_state=1),
        "circles": lambda: datasets.make_circles(
            600, noise=0.08, factor=0.5, random_state=1
        ),
        "xor": lambda: checkerboard(2, 600),
        "checkerboard": lambda: checkerboard(4, 1200),
        "clusters": lambda: datasets.make_classification(
            1000,
            12,
            n_informative=6,
            n_classes=3,
            n_clusters_per_class=3,
            class_sep=1.5,
            random_state=2,
        ),
        "lognormal": lognormal,
        "binary": binary,
        "imbalanced": imbalanced,
        "same mean": same_mean,
        "heavy tails": heavy_tails,
        "thirty classes": thirty_classes,
        "correlated": correlated,
    }


def checkerboard(side: int, rows: int) -> Table:
    """Return a square of side x side fields of two classes in turn."""
    values = np.random.default_rng(7).uniform(0, side, (rows, 2))
    return values, np.floor(values).sum(axis=1).astype(np.int64) % 2


def lognormal() -> Table:
    """Return skewed features; the class hangs on a sum of their logarithms."""
    rng = np.random.default_rng(8)
    logs = rng.normal(0, 1.2, (800, 5))
    score = logs[:, 0] + logs[:, 1] - logs[:, 2] + 0.5 * rng.normal(size=800)
    return np.exp(logs), (score > 0).astype(np.int64)


def binary() -> Table:
    """Return ten binary columns; two of the first three decide, with 5 % of noise."""
    rng = np.random.default_rng(9)
    values = rng.integers(0, 2, (800, 10)).astype(np.float64)
    is_noise = rng.random(800) < 0.05
    return values, ((values[:, :3].sum(axis=1) >= 2) ^ is_noise).astype(np.int64)


def imbalanced() -> Table:
    """Return 950 rows of one class and 50 of another."""
    rng = np.random.default_rng(10)
    values = np.vstack([rng.normal(0, 1, (950, 4)), rng.normal(1.5, 0.7, (50, 4))])
    return values, np.repeat([0, 1], [950, 50])


def same_mean() -> Table:
    """Return two classes that differ in their spreads only."""
    rng = np.random.default_rng(11)
    values = np.vstack([rng.normal(0, 1, (400, 3)), rng.normal(0, 4, (400, 3))])
    return values, np.repeat([0, 1], 400)


def heavy_tails() -> Table:
    """Return Student's t with 1.5 degrees of freedom, shifted in two columns."""
    values = np.random.default_rng(12).standard_t(1.5, (800, 4))
    values[400:, :2] += 2
    return values, np.repeat([0, 1], 400)


def thirty_classes() -> Table:
    """Return thirty gaussian classes of thirty rows."""
    rng = np.random.default_rng(13)
    labels = np.repeat(np.arange(30), 30)
    centres = rng.normal(0, 3, (30, 8))
    return centres[labels] + rng.normal(size=(900, 8)), labels


def correlated() -> Table:
    """Return twelve columns of rank four, 24 decades apart in scale."""
    rng = np.random.default_rng(14)
    values = rng.normal(size=(600, 4)) @ rng.normal(size=(4, 12))
    score = values[:, 0] - values[:, 1] + 0.3 * rng.normal(size=600)
    values += 1e-3 * rng.normal(size=values.shape)
    scales = 10.0 ** rng.integers(-12, 13, 12)
    return values * scales, (score > 0).astype(np.int64)


if __name__ == "__main__":
    main()
