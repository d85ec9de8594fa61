"""The second pass over a table in parts: the rows of each class in each leaf.

A model that was learnt from states, or from a table larger than memory, has supports of
leaves that are estimated from the rows that were kept. With the model at hand the parts
are read once more, where they lie, and each row is counted. The counts are a state as
well: they are merged in any order, saved and loaded.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping

import msgspec
import numpy as np
import numpy.typing as npt

from fuzzytree.checking import as_model
from fuzzytree.errors import ReadError
from fuzzytree.files import read_bounded, write_atomically
from fuzzytree.learning import (
    COUNTS_MAGIC,
    STATE_BEGIN,
    STATE_LIMIT,
    StateHeader,
    open_state,
    refuse_repeated,
    state_content,
)
from fuzzytree.model import (
    FuzzyTree,
    IntArray,
    Leaf,
    ModelSource,
    Progress,
    fingerprint,
)
from fuzzytree.runtimes import baseline
from fuzzytree.semantics import Status
from fuzzytree.tables import ClassLabels, LearningPiece, LearningRows, in_order


class LeafCounts:
    """Counts the rows of a table by class and by the leaf that predicts them.

    A row counts as `run` predicts it: in a leaf, without one (no rule fires), or with a
    missing value that the tree needs. Rows without a class are left out.

    Args:
        model: The tree, or the path of its file.
        target: The column of the classes.

    Raises:
        ReadError: If the file cannot be read, or holds no tree.

    Example:
        >>> import pandas as pd
        >>> import fuzzytree as ft
        >>> rows = pd.DataFrame({"cm": [1.0, 1.5, 7.0, 8.0], "size": [*"ssbb"]})
        >>> counts = LeafCounts(ft.learn(rows, target="size"), "size")
        >>> counts.update(rows)
        >>> counts.confusion(), counts.accuracy()
        ({'b': {'b': 2}, 's': {'s': 2}}, 1.0)
    """

    def __init__(self, model: ModelSource, target: str) -> None:
        tree = as_model(model)
        if not isinstance(tree, FuzzyTree):
            raise ReadError(f"{tree.name} is no tree, whose leaves have supports")
        self.tree, self.target = tree, target.strip()
        self.unlabelled = self.ties = 0
        self._labels = ClassLabels()
        self._parts: frozenset[str] = frozenset()
        self._counts: Counter[tuple[int, tuple[str, bool]]] = Counter()

    @property
    def rows(self) -> int:
        """How many rows with a class were counted."""
        return self._counts.total()

    def update(
        self,
        table: object,
        *,
        name: str | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Count the rows of one more part.

        Args:
            table: What `fuzzytree.table` takes. Files are read piece by piece.
            name: What messages call the part; its path unless given.
            progress: Called with the number of rows so far, and the share read.

        Raises:
            TableError: If a column is absent or holds text, or a file cannot be read;
                nothing of the part is counted then.
        """
        part = LeafCounts(self.tree, self.target)
        rows = LearningRows(
            table,
            target=self.target,
            name=name,
            chosen=self.tree.inputs,
            variables=[one for one in self.tree.variables if not one.parts],
            labels=part._labels,
            progress=progress,
        )
        execute, missing = baseline().load(self.tree), len(self.tree.leaves) + 1

        def predict(piece: LearningPiece) -> tuple[IntArray, IntArray, int]:
            outcome = execute(piece.values)
            is_missing = outcome.status == Status.MISSING
            ends = np.where(is_missing, missing, outcome.rule).astype(np.int64)
            ties = int(np.count_nonzero(outcome.status == Status.TIE))
            return ends, piece.codes, ties

        counts: Counter[tuple[int, int]] = Counter()
        for ends, codes, ties in in_order(predict, rows):
            part.ties += ties
            size = len(part._labels.keys)
            pairs, numbers = np.unique(ends * size + codes, return_counts=True)
            for pair, number in zip(pairs.tolist(), numbers.tolist(), strict=True):
                counts[divmod(pair, size)] += number
        keys = [*part._labels.keys]
        part._counts.update({(end, keys[k]): n for (end, k), n in counts.items()})
        part.unlabelled = rows.unlabelled
        vars(self).update(vars(self.merge(part)))

    def merge(self, other: LeafCounts, *, repeated: bool = False) -> LeafCounts:
        """Return the counts of the rows of both.

        Args:
            other: Counts for the same tree.
            repeated: Whether a saved state that is part of both counts twice.

        Raises:
            ValueError: If they are for another tree or target, or if one saved state is
                part of both.
        """
        if not repeated:
            refuse_repeated(self._parts, other._parts)
        if self.target != other.target:
            raise ValueError(
                f"the states have another target: {self.target}, and {other.target}"
            )
        _refuse_another(fingerprint(other.tree), self.tree)
        result = LeafCounts(self.tree, self.target)
        result.unlabelled = self.unlabelled + other.unlabelled
        result.ties = self.ties + other.ties
        result._parts = self._parts | other._parts
        result._labels = self._labels.merge(other._labels)
        result._counts = self._counts + other._counts
        return result

    def learn(self) -> FuzzyTree:
        """Return the tree with the number of rows that each leaf predicts."""
        names = dict(zip(self._labels.keys, self._labels.names(), strict=True))
        rows: Counter[tuple[int, str]] = Counter()
        for (end, key), count in self._counts.items():
            rows[end, names[key]] += count
        others = {name for _, name in rows} - {*self.tree.classes}
        leaves: list[Leaf] = []
        for end, leaf in enumerate(self.tree.leaves, 1):
            counts = tuple(rows[end, name] for name in self.tree.classes)
            unknown = sum(rows[end, name] for name in others)
            leaves.append(
                msgspec.structs.replace(
                    leaf,
                    support=sum(counts) + unknown,
                    counts=() if unknown else counts,
                )
            )
        return msgspec.structs.replace(self.tree, leaves=tuple(leaves))

    def confusion(self) -> dict[str, dict[str, int]]:
        """Return, for each class, how many rows the tree predicts to be of which.

        The empty name stands for no class.
        """
        semantics = self.tree.semantics
        labels = [leaf.label for leaf in self.tree.leaves]
        answers = [semantics.uncovered or "", *labels, semantics.missing or ""]
        names = dict(zip(self._labels.keys, self._labels.names(), strict=True))
        result: dict[str, Counter[str]] = {
            name: Counter() for name in self._labels.ordered()[1]
        }
        for (end, key), count in sorted(self._counts.items()):
            result[names[key]][answers[end]] += count
        return {name: dict(row) for name, row in result.items()}

    def accuracy(self) -> float:
        """Return the share of rows that are predicted right; NaN without rows."""
        right = sum(row.get(name, 0) for name, row in self.confusion().items())
        return right / self.rows if self.rows else float("nan")

    def facts(self) -> dict[str, int]:
        """Return how many rows were counted, and how many in no leaf."""
        ends, last = self._counts.items(), len(self.tree.leaves) + 1
        return {
            "rows": self.rows,
            "rows_without_class": self.unlabelled,
            "ties": self.ties,
            "no_rule": sum(count for (end, _), count in ends if not end),
            "missing": sum(count for (end, _), count in ends if end == last),
            "columns": len(self.tree.inputs),
            "classes": len(set(self._labels.names())),
        }

    def save(self, path: str | os.PathLike[str]) -> str:
        """Write the counts to a file whole, and return its digest.

        Raises:
            WriteError: If the file cannot be written.
        """
        header = StateHeader(
            magic=COUNTS_MAGIC,
            target=self.target,
            columns=[*self.tree.inputs],
            classes=[name for name, _ in self._labels.keys],
            floats=[is_float for _, is_float in self._labels.keys],
            kinds=sorted(self._labels.kinds),
            unlabelled=self.unlabelled,
            parts=sorted(self._parts),
            model=fingerprint(self.tree),
            ties=self.ties,
        )
        pairs = sorted((end, self._labels.keys[key]) for end, key in self._counts)
        keys = [*self._labels.keys]
        counts = [self._counts[end, keys[code]] for end, code in pairs]
        ends, codes = np.array(pairs, np.int64).reshape(-1, 2).T
        arrays = {"ends": ends, "codes": codes, "counts": np.array(counts, np.int64)}
        content, digest = state_content(header, arrays)
        write_atomically(path, content)
        return digest

    @classmethod
    def load(cls, path: str | os.PathLike[str], model: ModelSource) -> LeafCounts:
        """Return the counts that a file holds.

        Args:
            path: The file.
            model: The tree that they are for, or its path.

        Raises:
            ReadError: If the file is none, is broken, is of another version, or is for
                another tree.
        """
        try:
            content = read_bounded(path, STATE_LIMIT, STATE_BEGIN)
            header, arrays = open_state(content, COUNTS_MAGIC)
            result = cls(model, header.target)
            _refuse_another(header.model, result.tree)
            result._take(header, arrays)
        except ValueError as error:
            if isinstance(error, ReadError):
                raise
            raise ReadError(f"{os.fspath(path)}: {error}") from error
        return result

    def _take(
        self, header: StateHeader, arrays: Mapping[str, npt.NDArray[np.generic]]
    ) -> None:
        """Take what a file holds.

        Raises:
            ValueError: If it cannot have been counted.
        """
        self._labels = header.labels()
        self.unlabelled, self.ties = header.unlabelled, header.ties
        self._parts = frozenset([*header.parts, header.digest])
        found = [arrays.get(name, np.empty(0)) for name in ("ends", "codes", "counts")]
        ends, codes, counts = (one.tolist() for one in found)
        keys, last = [*self._labels.keys], len(self.tree.leaves) + 1
        if (
            any(one.dtype != np.int64 or len(one) != len(ends) for one in found)
            or not all(0 <= end <= last for end in ends)
            or not all(0 <= code < len(keys) for code in codes)
            or min(counts, default=1) < 1
        ):
            raise ValueError("counts rows that no leaf or class can have")
        for end, code, count in zip(ends, codes, counts, strict=True):
            self._counts[end, keys[code]] += count


def _refuse_another(model: str, tree: FuzzyTree) -> None:
    """Raise a ValueError if counts are for another model than a tree."""
    mine = fingerprint(tree)
    if model != mine:
        raise ValueError(
            f"counts the leaves of another model, with the fingerprint {model[:12]}, "
            f"and {tree.name} has {mine[:12]}"
        )
