"""What a model answered to the rows of a table, and why."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, TypeVar

import msgspec
import numpy as np

from fuzzytree.model.rulebase import (
    Label,
    LabelType,
    RuleBase,
    Semantics,
    Shape,
    clause_text,
    label_of,
    shapes_of,
    summary,
)
from fuzzytree.semantics.reference import Status, axis_values, clause_degree, evaluate
from fuzzytree.tables import arrow_table, pandas_frame

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

    from fuzzytree.model.contracts import FloatArray, IntArray, Outcome

By = Literal["class", "rule"]
T = TypeVar("T")


class Answers(msgspec.Struct, frozen=True, eq=False):
    """What a model answered to some rows.

    Attributes:
        choices: The classes that the model can answer.
        codes: The position in `choices` of each row's class; -1 for no class.
        rule: The number of the winning rule or leaf of each row, from 1; 0 for none.
        status: A `fuzzytree.semantics.reference.Status` for each row.
        owners: The position in `choices` of each rule's class; empty if not known.
        strengths: Shape (rules, rows), NaN in rows with missing values; None if they
            were not requested or if only one path of a tree was followed.
        label_type: What the names of classes stand for, if not text.
    """

    choices: tuple[str, ...]
    codes: IntArray
    rule: IntArray
    status: IntArray
    owners: tuple[int, ...] = ()
    strengths: FloatArray | None = None
    label_type: LabelType | msgspec.UnsetType = msgspec.UNSET

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.codes)

    @property
    def classes(self) -> list[Label | None]:
        """The class of each row; None for no class.

        They are of the type of the labels that the model was learnt from: numbers,
        booleans or text.
        """
        labels = [label_of(name, self.label_type) for name in self.choices]
        return self._of_rows([*labels, None])

    @property
    def names(self) -> list[str | None]:
        """The name of the class of each row, as files have it; None for no class."""
        return self._of_rows([*self.choices, None])

    def _of_rows(self, labels: list[T]) -> list[T]:
        return [labels[code] for code in self.codes.tolist()]  # -1 is the last one

    @property
    def class_strengths(self) -> FloatArray | None:
        """The strength of each class's strongest rule, shape (classes, rows)."""
        if self.strengths is None or not self.owners:
            return None
        owners = np.array(self.owners)
        nothing = self.strengths[0] * 0.0  # NaN stays NaN
        found = [
            self.strengths[owners == k].max(axis=0) if k in self.owners else nothing
            for k in range(len(self.choices))
        ]
        return np.array(found)

    def count(self, status: int) -> int:
        """Return how many rows have this `fuzzytree.semantics.reference.Status`."""
        return int(np.count_nonzero(self.status == status))

    def class_counts(self) -> dict[str, int]:
        """Return how many rows have each class, and `no class` if any has none."""
        counts = np.bincount(self.codes + 1, minlength=len(self.choices) + 1).tolist()
        found = dict(zip(self.choices, counts[1:], strict=True))
        return found | ({"no class": counts[0]} if counts[0] else {})

    def to_csv(self, strengths: By | None = None) -> str:
        """Return the answers as CSV: class, rule, status and, if requested, strengths.

        No class and an unknown strength are empty cells.

        Raises:
            ValueError: If strengths are requested that are not there.
        """
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        columns = self.columns(strengths)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
        return text.getvalue()

    def columns(self, strengths: By | None = None) -> dict[str, Sequence[object]]:
        """Return the columns that `to_csv` writes, by name.

        Raises:
            ValueError: If strengths are requested that are not there.
        """
        words = [status.name.lower() for status in Status]
        found: dict[str, Sequence[object]] = {
            "class": [name or "" for name in self.names],
            "rule": self.rule.tolist(),
            "status": [words[status] for status in self.status.tolist()],
        }
        if strengths is None:
            return found
        values = self.class_strengths if strengths == "class" else self.strengths
        if values is None:
            raise ValueError(
                f"there are no strengths by {strengths}: "
                "rules have them, and a tree follows one path"
            )
        names = self.choices if strengths == "class" else range(1, len(values) + 1)
        for name, row in zip(names, values.tolist(), strict=True):
            shown = ["" if math.isnan(value) else value for value in row]
            found[f"strength of {strengths} {name}"] = shown
        return found

    def to_arrow(self, strengths: By | None = None) -> pa.Table:
        """Return the columns of `to_csv` as a table of pyarrow; needs pyarrow.

        Classes are of the type of `classes`; what would be an empty cell is null.

        Raises:
            ValueError: If strengths are requested that are not there.
        """
        return arrow_table({**self.columns(strengths), "class": self.classes})

    def to_pandas(self, strengths: By | None = None) -> pd.DataFrame:
        """Return the columns of `to_csv` as a frame of pandas; needs pandas.

        Classes are of the type of `classes`.

        Raises:
            ValueError: If strengths are requested that are not there.
        """
        return pandas_frame({**self.columns(strengths), "class": self.classes})

    def __repr__(self) -> str:
        """Show how many rows there are; `str` shows how many rows got which class."""
        return summary("Answers", rows=len(self), classes=len(self.choices))

    def __str__(self) -> str:
        """Show how many rows got which class, and what was out of the ordinary."""
        found = self.class_counts().items()
        counts = ", ".join(f"{name} {count}" for name, count in found)
        odd = odd_text(self)
        return f"{len(self)} rows: {counts}" + (f"; {odd}" if odd else "")


def odd_text(answers: Answers) -> str:
    """Return the counts of ties, uncovered and missing rows that are not 0."""
    names = {
        Status.TIE: "decided by the order of the rules",
        Status.UNCOVERED: "uncovered",
        Status.MISSING: "with missing values",
    }
    counts = {text: answers.count(status) for status, text in names.items()}
    return ", ".join(f"{count} {text}" for text, count in counts.items() if count)


def joined(parts: Sequence[Answers]) -> Answers:
    """Return the answers to several batches of rows of one model, one after another."""
    first = parts[0]
    strengths = [p.strengths for p in parts if p.strengths is not None]
    return Answers(
        first.choices,
        np.concatenate([p.codes for p in parts]),
        np.concatenate([p.rule for p in parts]),
        np.concatenate([p.status for p in parts]),
        first.owners,
        np.hstack(strengths) if len(strengths) == len(parts) else None,
        first.label_type,
    )


def answers_of(
    outcome: Outcome,
    *,
    choices: tuple[str, ...],
    ends: Sequence[str],
    semantics: Semantics,
    with_strengths: bool,
) -> Answers:
    """Name the classes of an outcome.

    Args:
        outcome: What a runtime found.
        choices: The classes.
        ends: The class of each rule or leaf.
        semantics: The answers where no rule wins, and the type of the labels.
        with_strengths: Whether to keep the strengths.
    """
    position = {name: k for k, name in enumerate(choices)}
    owners = tuple(position[end] for end in ends)
    codes = np.array([-1, *owners], np.int64)[outcome.rule]
    for status, answer in (
        (Status.UNCOVERED, semantics.uncovered),
        (Status.MISSING, semantics.missing),
    ):
        code = -1 if answer is None else position[answer]
        codes[outcome.status == status] = code
    strengths = outcome.strengths if with_strengths else None
    return Answers(
        choices,
        codes,
        outcome.rule,
        outcome.status,
        owners,
        strengths,
        semantics.label_type,
    )


def reasons(rules: RuleBase, values: FloatArray, answers: Answers) -> list[str]:
    """Return, for each row, its rule as a sentence with the degree of each clause.

    Args:
        rules: The rules that answered, or those of the tree that did.
        values: Shape (inputs, rows), in the order of `rules.inputs`.
        answers: The answers to these rows.

    Example:
        >>> from fuzzytree.model.rulebase import Band, Clause, Flank, Rule
        >>> from fuzzytree.model.rulebase import Term, Variable
        >>> low = Term("low", Band(high=1.0, right=Flank(1.0, 3.0)))
        >>> rules = RuleBase(
        ...     "grip", ("soft",), (Variable("force", (low,)),),
        ...     (Rule((Clause("force", ("low",)),), "soft"),),
        ... )
        >>> found = Answers(("soft",), np.array([0]), np.array([1]), np.array([0]))
        >>> reasons(rules, np.array([[2.0]]), found)
        ['IF force is low (0.5) THEN soft']
    """
    shapes = shapes_of(rules.variables)
    found = zip(
        values.T.tolist(), answers.rule.tolist(), answers.status.tolist(), strict=True
    )
    return [
        _reason(rules, shapes, dict(zip(rules.inputs, row, strict=True)), rule, status)
        for row, rule, status in found
    ]


def _reason(
    rules: RuleBase,
    shapes: Mapping[tuple[str, str], Shape],
    row: Mapping[str, float],
    number: int,
    status: int,
) -> str:
    axes = axis_values(rules.variables, row)
    if status == Status.MISSING:
        bad = [name for name, value in axes.items() if not math.isfinite(value)]
        return f"no finite value: {', '.join(bad)}"
    if status == Status.UNCOVERED:
        return "no rule fires"
    rule = rules.rules[number - 1]
    clauses = [
        f"{clause_text(c)} ({_short(clause_degree(c, shapes, axes[c.variable]))})"
        for c in rule.when
    ]
    text = f"IF {' AND '.join(clauses)} THEN " if clauses else "ALWAYS "
    if status == Status.DECIDED:
        return text + rule.then
    strengths = evaluate(rules, row).strengths
    equal = [k for k, s in enumerate(strengths, 1) if s == strengths[number - 1]]
    others = ", ".join(str(k) for k in equal if k != number)
    return f"{text}{rule.then}; as strong: rule {others}"


def _short(degree: float) -> str:
    text = f"{degree:.3g}"
    return "<1" if text == "1" and degree < 1.0 else text
