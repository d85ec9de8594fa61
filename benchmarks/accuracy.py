"""The accuracy of both modes beside three classifiers, on the same folds.

    python benchmarks/accuracy.py [--folds 10] [--tables iris,wine,...]

Ten stratified folds, shuffled, seed 0, on four tables that scikit-learn ships and on
made ones that ask for more than a linear cut. In percent; behind trees stand the mean
numbers of leaves and of features that a node needs, and the seconds of a fit.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from sklearn import datasets
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.model_selection import StratifiedKFold
from sklearn.naive_bayes import GaussianNB
from sklearn.tree import DecisionTreeClassifier

from fuzzytree.estimator import FuzzyTreeClassifier

Array = npt.NDArray[np.float64]
Labels = npt.NDArray[np.int64]
Table = tuple[Array, Labels]


class Score(NamedTuple):
    """What cross-validation found.

    Attributes:
        accuracy: In percent, over all folds.
        spread: The standard deviation over the folds, in points.
        leaves: The mean number of leaves; NaN for those without.
        features: The mean number of features of a node; NaN for those without.
        seconds: The mean time of a fit.
    """

    accuracy: float
    spread: float
    leaves: float
    features: float
    seconds: float


def made_tables() -> dict[str, Callable[[], Table]]:
    """Return tables from generators with fixed seeds, by name."""
    chance = np.random.default_rng(0)
    square = chance.uniform(-1, 1, (600, 2))
    board = chance.uniform(0, 4, (1200, 2))
    skewed = np.exp(1.5 * chance.normal(size=(800, 6)))
    heavy = chance.standard_t(2, (800, 6))
    binary = (chance.random((800, 12)) < 0.4).astype(np.float64)
    votes = binary[:, :6].sum(axis=1) + 0.7 * binary[:, 7] - binary[:, 8]
    return {
        "moons": lambda: datasets.make_moons(600, noise=0.25, random_state=0),
        "circles": lambda: datasets.make_circles(
            600, noise=0.1, factor=0.5, random_state=0
        ),
        "xor": lambda: (square, ((square > 0).sum(axis=1) % 2).astype(np.int64)),
        "checkerboard": lambda: (board, board.astype(np.int64).sum(axis=1) % 2),
        "clusters": lambda: datasets.make_classification(
            1000, 12, n_informative=6, n_classes=4, random_state=1
        ),
        "imbalanced": lambda: datasets.make_classification(
            1500, 8, n_informative=4, weights=[0.93], random_state=5
        ),
        "scales": lambda: (
            skewed * 10.0 ** np.arange(-12, 12, 4),
            (skewed[:, 0] * skewed[:, 1] > 1.2 * skewed[:, 2]).astype(np.int64),
        ),
        "heavy tails": lambda: (
            heavy,
            (heavy[:, 0] + heavy[:, 1] > 0.5 * heavy[:, 2]).astype(np.int64),
        ),
        "binary": lambda: (binary, (votes > 2.3).astype(np.int64)),
        "forty blobs": lambda: datasets.make_blobs(
            2000, n_features=6, centers=40, cluster_std=2.5, random_state=0
        ),
        "shells": lambda: datasets.make_gaussian_quantiles(
            n_samples=900, n_features=4, n_classes=3, random_state=0
        ),
    }


def shipped_tables() -> dict[str, Callable[[], Table]]:
    """Return the tables that come with scikit-learn, by name."""
    return {
        "iris": lambda: datasets.load_iris(return_X_y=True),
        "wine": lambda: datasets.load_wine(return_X_y=True),
        "breast cancer": lambda: datasets.load_breast_cancer(return_X_y=True),
        "digits": lambda: datasets.load_digits(return_X_y=True),
    }


MAKERS: dict[str, Callable[[], object]] = {
    "default": FuzzyTreeClassifier,
    "paper": lambda: FuzzyTreeClassifier(mode="paper"),
    "DecisionTree": lambda: DecisionTreeClassifier(random_state=0),
    "GaussianNB": GaussianNB,
    "LDA": LinearDiscriminantAnalysis,
}


def scored(make: Callable[[], object], table: Table, folds: int) -> Score:
    """Return the cross-validated accuracy of a classifier on a table."""
    values, labels = table
    rights, sizes, leaves, features, seconds = [], [], [], [], []
    split = StratifiedKFold(folds, shuffle=True, random_state=0)
    for train, test in split.split(values, labels):
        model = make()
        start = time.perf_counter()
        model.fit(values[train], labels[train])  # type: ignore[attr-defined]
        seconds.append(time.perf_counter() - start)
        answers = model.predict(values[test])  # type: ignore[attr-defined]
        rights.append(int((answers == labels[test]).sum()))
        sizes.append(len(test))
        if isinstance(model, FuzzyTreeClassifier):
            leaves.append(len(model.tree_.leaves))
            features += list(model.report_.features_per_node)
        elif isinstance(model, DecisionTreeClassifier):
            leaves.append(int(model.get_n_leaves()))
            features.append(1)
    shares = 100.0 * np.array(rights) / np.array(sizes)
    return Score(
        100.0 * sum(rights) / sum(sizes),
        float(shares.std()),
        float(np.mean(leaves)) if leaves else float("nan"),
        float(np.mean(features)) if features else float("nan"),
        float(np.mean(seconds)),
    )


def lines(names: list[str], folds: int) -> Iterator[str]:
    """Yield the table line by line, each as soon as it is measured."""
    tables = shipped_tables() | made_tables()
    head = "  ".join(f"{name:>20}" for name in MAKERS)
    yield f"{'table':<14}{head}"
    for name in names or list(tables):
        table = tables[name]()
        cells = [scored(make, table, folds) for make in MAKERS.values()]
        yield f"{name:<14}" + "  ".join(f"{_cell(cell):>20}" for cell in cells)


def _cell(score: Score) -> str:
    text = f"{score.accuracy:.1f}"
    if not np.isnan(score.leaves):
        text += f" ({score.leaves:.0f}, {score.features:.1f}, {score.seconds:.2f})"
    return text


def main() -> None:
    """Print the table."""
    known = list(shipped_tables() | made_tables())
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folds", type=int, default=10)
    parser.add_argument("--tables", default="", help=", ".join(known))
    chosen = parser.parse_args()
    names = [name.strip() for name in chosen.tables.split(",") if name.strip()]
    for name in names:
        if name not in known:
            parser.error(f"no table {name!r}; there is {', '.join(known)}")
    warnings.simplefilter("ignore")  # LDA tells of collinear columns
    print("accuracy in percent (leaves, features a node, seconds a fit)")
    for line in lines(names, chosen.folds):
        print(line, flush=True)


if __name__ == "__main__":
    main()
