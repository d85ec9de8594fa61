"""The second pass over a table in parts: the rows of each class in each leaf.

A model that was learnt from states, or from a table larger than memory, has supports of
leaves that are estimated from the rows that were kept. With the model at hand the parts
are read once more, where they lie, and each row is counted. The counts are a state as
well: they are merged in any order, saved and loaded.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Final

import msgspec
import numpy as np
import numpy.typing as npt

from fuzzytree.checking import as_model
from fuzzytree.errors import ReadError
from fuzzytree.files import read_bounded, write_atomically
from fuzzytree.learning import StateHeader, open_state, refuse_repeated, state_content
from fuzzytree.model import FuzzyTree, IntArray, ModelSource, Progress, fingerprint
from fuzzytree.runtimes import baseline
from fuzzytree.semantics import Status
from fuzzytree.tables import ClassLabels, LearningPiece, LearningRows, in_order

MAGIC: Final = "fuzzytree leaf counts 1"
"""The kind and the version of the file of such a state."""

LIMIT: Final = 1 << 33
"""The largest file that is read, in bytes."""

_WAITING = 64  # pieces whose counts are not added up yet


class LeafCountsHeader(StateHeader, forbid_unknown_fields=True, kw_only=True):
    """What the file says beside.

    Attributes:
        model: The fingerprint of the tree.
        ties: Rows that more than one leaf claims.
    """

    model: str
    ties: int


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
        self._ends = self._codes = self._counts = np.empty(0, np.int64)

    @property
    def rows(self) -> int:
        """How many rows with a class were counted."""
        return int(self._counts.sum())

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
            progress: Called with the number of rows so far, and 0.

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
            chosen_by="the model needs",
            labels=part._labels,
            progress=progress,
        )
        execute, missing = baseline().load(self.tree), len(self.tree.leaves) + 1

        def predict(piece: LearningPiece) -> tuple[IntArray, IntArray, int]:
            outcome = execute(np.ascontiguousarray(piece.values))
            is_missing = outcome.status == Status.MISSING
            ends = np.where(is_missing, missing, outcome.rule).astype(np.int64)
            ties = int(np.count_nonzero(outcome.status == Status.TIE))
            return ends, piece.codes, ties

        waiting: list[tuple[IntArray, IntArray, IntArray]] = []
        for ends, codes, ties in in_order(predict, rows):
            part.ties += ties
            waiting.append(_summed(ends, codes, np.ones(len(ends), np.int64)))
            if len(waiting) > _WAITING:
                waiting = [_summed(*map(np.concatenate, zip(*waiting, strict=True)))]
        part.unlabelled = rows.unlabelled
        part._ends, part._codes, part._counts = _summed(
            *map(np.concatenate, zip(*waiting, strict=True))
        )
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
        keys = other._labels.keys
        places = np.array([result._labels.keys[key] for key in keys], np.int64)
        result._ends, result._codes, result._counts = _summed(
            np.concatenate([self._ends, other._ends]),
            np.concatenate([self._codes, places[other._codes]]),
            np.concatenate([self._counts, other._counts]),
        )
        return result

    def learn(self) -> FuzzyTree:
        """Return the tree with the number of rows that each leaf predicts."""
        size = len(self.tree.leaves) + 2
        support = np.bincount(self._ends, self._counts, size)[1:-1].tolist()
        leaves = [
            msgspec.structs.replace(leaf, support=round(count))
            for leaf, count in zip(self.tree.leaves, support, strict=True)
        ]
        return msgspec.structs.replace(self.tree, leaves=tuple(leaves))

    def confusion(self) -> dict[str, dict[str, int]]:
        """Return, for each class, how many rows the tree predicts to be of which.

        The empty name stands for no class.
        """
        semantics = self.tree.semantics
        labels = [leaf.label for leaf in self.tree.leaves]
        answers = [semantics.uncovered or "", *labels, semantics.missing or ""]
        positions, classes = self._labels.ordered()
        result: dict[str, dict[str, int]] = {name: {} for name in classes}
        found = self._ends, self._codes, self._counts
        for end, code, count in zip(*(one.tolist() for one in found), strict=True):
            row, answer = result[classes[positions[code]]], answers[end]
            row[answer] = row.get(answer, 0) + count
        return result

    def accuracy(self) -> float:
        """Return the share of rows that are predicted right; NaN without rows."""
        right = sum(row.get(name, 0) for name, row in self.confusion().items())
        return right / self.rows if self.rows else float("nan")

    def facts(self) -> dict[str, int]:
        """Return how many rows were counted, and how many in no leaf."""
        missing = self._ends == len(self.tree.leaves) + 1
        return {
            "rows": self.rows,
            "rows_without_class": self.unlabelled,
            "ties": self.ties,
            "no_rule": int(self._counts[self._ends == 0].sum()),
            "missing": int(self._counts[missing].sum()),
            "columns": len(self.tree.inputs),
            "classes": len(set(self._labels.names())),
        }

    def save(self, path: str | os.PathLike[str]) -> str:
        """Write the counts to a file whole, and return its digest.

        Raises:
            WriteError: If the file cannot be written.
        """
        header = LeafCountsHeader(
            magic=MAGIC,
            target=self.target,
            classes=[name for name, _ in self._labels.keys],
            floats=[is_float for _, is_float in self._labels.keys],
            kinds=sorted(self._labels.kinds),
            unlabelled=self.unlabelled,
            parts=sorted(self._parts),
            model=fingerprint(self.tree),
            ties=self.ties,
        )
        arrays = {"ends": self._ends, "codes": self._codes, "counts": self._counts}
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
            header, arrays = open_state(
                read_bounded(path, LIMIT), LeafCountsHeader, MAGIC
            )
            result = cls(model, header.target)
            _refuse_another(header.model, result.tree)
            result._take(header, arrays)
        except ValueError as error:
            if isinstance(error, ReadError):
                raise
            raise ReadError(f"{os.fspath(path)}: {error}") from error
        return result

    def _take(
        self, header: LeafCountsHeader, arrays: Mapping[str, npt.NDArray[np.generic]]
    ) -> None:
        """Take what a file holds.

        Raises:
            ValueError: If it cannot have been counted.
        """
        self._labels = header.labels()
        self.unlabelled, self.ties = header.unlabelled, header.ties
        self._parts = frozenset([*header.parts, header.digest])
        found = [arrays.get(name, np.empty(0)) for name in ("ends", "codes", "counts")]
        ends, codes, counts = (one.astype(np.int64, copy=False) for one in found)
        limits = len(self.tree.leaves) + 2, len(self._labels.keys)
        if (
            any(one.dtype != np.int64 or one.shape != ends.shape for one in found)
            or any(
                (one < 0).any() or (one >= size).any()
                for one, size in zip((ends, codes), limits, strict=True)
            )
            or (counts < 1).any()
        ):
            raise ValueError("counts rows that no leaf or class can have")
        self._ends, self._codes, self._counts = ends, codes, counts


def _refuse_another(model: str, tree: FuzzyTree) -> None:
    """Raise a ValueError if counts are for another model than a tree."""
    mine = fingerprint(tree)
    if model != mine:
        raise ValueError(
            f"counts the leaves of another model, with the fingerprint {model[:12]}, "
            f"and {tree.name} has {mine[:12]}"
        )


def _summed(
    ends: IntArray, codes: IntArray, counts: IntArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return each pair of an end and a class once, with the sum of its counts."""
    pairs, places = np.unique(ends << np.int64(32) | codes, return_inverse=True)
    total = np.zeros(len(pairs), np.int64)
    np.add.at(total, places, counts)
    return pairs >> np.int64(32), pairs & np.int64((1 << 32) - 1), total
