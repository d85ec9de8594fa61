"""How often raw rules and their tree differ, and which of them is right more often."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from sklearn import datasets
from sklearn.model_selection import StratifiedKFold

from fuzzytree.learning import LearningSettings, learn_arrays
from fuzzytree.model.rulebase import Conjunction
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.runtimes.native import load
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import Status
from paper.records import Comparison, Mode

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Bits = npt.NDArray[np.bool_]
Tell = Callable[[str], None]

FOLDS = 10
MODES: tuple[Mode, ...] = ("default", "paper")
CONJUNCTIONS: tuple[Conjunction, ...] = ("minimum", "product")
LOADERS = {
    "iris": datasets.load_iris,
    "wine": datasets.load_wine,
    "breast cancer": datasets.load_breast_cancer,
    "digits": datasets.load_digits,
}


class Seen(NamedTuple):
    """Facts of each row of a table, in shape (rows,): answers by trees of one seed."""

    tree_right: Bits
    raw_right: Bits
    is_same: Bits
    is_covered: Bits
    is_tie: Bits
    relative_differs: Bits


Case = tuple[str, Mode, Conjunction]


def comparisons(
    tables: Sequence[str], seeds: int, *, seconds: float, tell: Tell
) -> Iterator[Comparison]:
    """Yield a comparison for each table, mode and conjunction.

    Args:
        tables: Names of `LOADERS`.
        seeds: How many times each table is cut into ten folds, with seeds from 0.
        seconds: No further seed begins after so long; one is always whole.
        tell: Told what is done.

    Raises:
        KeyboardInterrupt: If the user ended it, after yielding what whole seeds gave.
    """
    seen: list[dict[Case, Seen]] = []
    leaves: dict[tuple[str, Mode], list[int]] = {}
    begin = time.monotonic()
    is_interrupted = False
    try:
        for seed in range(seeds):
            if seed and time.monotonic() - begin > seconds * seed / (seed + 1):
                break
            facts, sizes = _all_tables(tables, seed, tell)
            seen.append(facts)
            for key, found in sizes.items():
                leaves.setdefault(key, []).extend(found)
    except KeyboardInterrupt:
        is_interrupted = True
    for case in seen[0] if seen else ():
        mean = float(np.mean(leaves[case[:2]]))
        yield compared(case, mean, [facts[case] for facts in seen])
    if is_interrupted:
        raise KeyboardInterrupt


def _all_tables(
    tables: Sequence[str], seed: int, tell: Tell
) -> tuple[dict[Case, Seen], dict[tuple[str, Mode], list[int]]]:
    """Return what is seen with one seed, and the leaves of the trees."""
    facts: dict[Case, Seen] = {}
    leaves: dict[tuple[str, Mode], list[int]] = {}
    for table in tables:
        values, labels = LOADERS[table](return_X_y=True)
        for mode in MODES:
            tell(f"{table}, {mode} mode, seed {seed}")
            found, leaves[table, mode] = _cross_validated(values, labels, mode, seed)
            for conjunction, seen in found.items():
                facts[table, mode, conjunction] = seen
    return facts, leaves


def _cross_validated(
    values: Floats, labels: Integers, mode: Mode, seed: int
) -> tuple[dict[Conjunction, Seen], list[int]]:
    """Return the predictions of each row out of its fold, and the trees' leaves."""
    folds = StratifiedKFold(FOLDS, shuffle=True, random_state=seed)
    found = {
        name: Seen(*(np.zeros(len(labels), np.bool_) for _ in Seen._fields))
        for name in CONJUNCTIONS
    }
    leaves: list[int] = []
    columns = [f"x{number}" for number in range(values.shape[1])]
    classes = [str(label) for label in range(labels.max() + 1)]
    for learn, answer in folds.split(values, labels):
        tree = learn_arrays(
            values[learn],
            labels[learn],
            columns=columns,
            classes=classes,
            settings=LearningSettings(mode=mode),
        ).tree
        leaves.append(len(tree.leaves))
        needed = [columns.index(name) for name in tree.inputs]
        rows = np.ascontiguousarray(values[answer][:, needed].T)
        for conjunction in CONJUNCTIONS:
            facts = answered(tree, conjunction, rows, labels[answer])
            for whole, part in zip(found[conjunction], facts, strict=True):
                whole[answer] = part
    return found, leaves


def answered(
    tree: FuzzyTree, conjunction: Conjunction, rows: Floats, labels: Integers
) -> Seen:
    """Return what a tree and its rules make of rows whose class numbers are known.

    Args:
        tree: Its classes are in the order of their numbers.
        conjunction: The AND of both kinds of rules.
        rows: Shape (inputs, rows).
        labels: The class numbers.
    """
    number = {label: place for place, label in enumerate(tree.classes)}
    class_of = np.array([-1, *(number[leaf.label] for leaf in tree.leaves)])
    by_tree = class_of[load(tree)(rows).rule]
    relative = load(rules_from_tree(tree, "relative", conjunction=conjunction))
    raw = load(rules_from_tree(tree, "raw", conjunction=conjunction))(rows)
    by_raw = class_of[raw.rule]
    return Seen(
        tree_right=by_tree == labels,
        raw_right=by_raw == labels,
        is_same=by_tree == by_raw,
        is_covered=raw.status != Status.UNCOVERED,
        is_tie=raw.status == Status.TIE,
        relative_differs=class_of[relative(rows).rule] != by_tree,
    )


def compared(case: Case, leaves: float, all_facts: Sequence[Seen]) -> Comparison:
    """Return the counts over what was seen with each seed."""
    table, mode, conjunction = case
    tree, raw, same, covered, tie, off = (
        np.stack(facts) for facts in zip(*all_facts, strict=True)
    )
    tree_only, raw_only = covered & tree & ~raw, covered & raw & ~tree
    return Comparison(
        table,
        mode,
        conjunction,
        rows=tree.shape[1],
        leaves=leaves,
        tree_right=int(tree.sum()),
        raw_right=int(raw.sum()),
        both_wrong=int((covered & ~same & ~tree & ~raw).sum()),
        tree_only=int(tree_only.sum()),
        raw_only=int(raw_only.sum()),
        uncovered_tree_right=int((~covered & tree).sum()),
        uncovered_tree_wrong=int((~covered & ~tree).sum()),
        ties=int(tie.sum()),
        ties_that_differ=int((tie & ~same).sum()),
        relative_differs=int(off.sum()),
        votes=_votes(tree_only, raw_only),
        votes_in_all=_votes(tree & ~raw, raw & ~tree),
        of_seeds=tuple(
            (int(a), int(b))
            for a, b in zip(tree_only.sum(axis=1), raw_only.sum(axis=1), strict=True)
        ),
    )


def _votes(first: Bits, second: Bits) -> tuple[int, int]:
    """Return for how many rows the first, and the second, holds with more seeds."""
    balance = first.sum(axis=0, dtype=np.int64) - second.sum(axis=0, dtype=np.int64)
    return int((balance > 0).sum()), int((balance < 0).sum())
