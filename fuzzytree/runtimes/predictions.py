"""The predictions of a model for the rows of a table: classes or numbers, and why."""

from __future__ import annotations

import csv
import io
import math
import operator
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import (
    TYPE_CHECKING,
    Literal,
    Self,
    SupportsIndex,
    TypeVar,
    overload,
)

import msgspec
import numpy as np

from fuzzytree.errors import MissingExtraError, install_hint
from fuzzytree.model import (
    Document,
    FuzzySystem,
    Label,
    LabelType,
    Model,
    Result,
    RuleBase,
    Shape,
    Variable,
    label_of,
    name_choice,
    proposition_text,
    remember,
    shapes_of,
    summary,
)
from fuzzytree.runtimes.mixing import class_probabilities, rule_codes
from fuzzytree.semantics import Status, axis_values, evaluate, proposition_degree
from fuzzytree.tables import pandas_frame

if TYPE_CHECKING:
    import numpy.typing as npt
    import pandas as pd
    import polars as pl
    import pyarrow as pa

    from fuzzytree.model import FloatArray, IntArray, Outcome

By = Literal["class", "rule"]
T = TypeVar("T")
S = TypeVar("S", bound=msgspec.Struct)

_WORDS = [status.name.lower() for status in Status]


class Answers(Result, msgspec.Struct, frozen=True, eq=False, kw_only=True):
    """What a model answers for some rows.

    Attributes:
        status: A `fuzzytree.semantics.reference.Status` for each row.
        strengths: Of each rule, shape (rules, rows), NaN in rows with missing values;
            None if they were not requested or if only one path of a tree was followed.
    """

    status: IntArray
    strengths: FloatArray | None = None

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.status)

    def _slice(self, rows: slice) -> Self:
        arrays = {
            name: value[..., rows]
            for name in self.__struct_fields__
            if isinstance(value := getattr(self, name), np.ndarray)
        }
        return msgspec.structs.replace(self, **arrays)

    def count(self, status: int) -> int:
        """Return how many rows have this `fuzzytree.semantics.reference.Status`."""
        return int(np.count_nonzero(self.status == status))

    def to_csv(self, strengths: By | None = None) -> str:
        """Return them as CSV: the answers, the status and, if requested, strengths.

        No class, no number and an unknown strength are empty cells.

        Raises:
            ValueError: If strengths are requested that are not there.
        """
        columns = self.columns(strengths)
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
        return text.getvalue()

    def columns(self, strengths: By | None = None) -> dict[str, Sequence[object]]:
        """Return the columns that `to_csv` writes, by name.

        Raises:
            ValueError: If strengths are requested that are not there.
        """
        result = self._answers()
        result[_status_title(result)] = [_WORDS[one] for one in self.status.tolist()]
        return result | {k: _cells(row) for k, row in self._rows(strengths).items()}

    def to_arrow(self, strengths: By | None = None) -> pa.Table:
        """Return the columns of `to_csv` as a table of pyarrow; needs pyarrow.

        Classes are of the type of `classes`, rules int32, the status a dictionary of
        text, numbers and strengths float64; what would be an empty cell is null.

        Raises:
            ValueError: If strengths are requested that are not there.
        """
        import pyarrow as pa

        result = self._arrays()
        status = pa.DictionaryArray.from_arrays(self.status.astype(np.int8), _WORDS)
        result[_status_title(result)] = status
        for name, row in self._rows(strengths).items():
            result[name] = pa.array(row, from_pandas=True)  # NaN is null
        return pa.table(result)

    def to_pandas(self, strengths: By | None = None) -> pd.DataFrame:
        """Return the columns of `to_csv` as a frame of pandas; needs pandas.

        Classes are of the type of `classes`.

        Raises:
            ValueError: If strengths are requested that are not there.
        """
        return pandas_frame(self.columns(strengths))

    def to_polars(self, strengths: By | None = None) -> pl.DataFrame:
        """Return the columns of `to_arrow` as a frame of polars; needs polars.

        Raises:
            MissingExtraError: If polars is not installed.
            ValueError: If strengths are requested that are not there.
        """
        try:
            import polars as pl
        except ImportError as error:
            text = f"to_polars needs {install_hint('polars')}"
            raise MissingExtraError(text) from error

        return pl.DataFrame(self.to_arrow(strengths))

    def _answers(self) -> dict[str, Sequence[object]]:
        """Return the columns of the answers alone."""
        raise NotImplementedError

    def _arrays(self) -> dict[str, pa.Array]:
        """Return the same as arrays of pyarrow."""
        raise NotImplementedError

    def _rows(self, strengths: By | None) -> dict[str, FloatArray]:
        """Return a row of strengths for each rule or class, by the title of each."""
        if strengths is None:
            return {}
        values = self.strengths
        if values is None or strengths == "class":
            raise ValueError(
                f"there are no strengths by {strengths}: "
                "rules have them, and a tree follows one path"
            )
        return {f"strength of rule {k}": row for k, row in enumerate(values, 1)}

    def _unusual(self) -> list[str]:
        """Return the counts of ties, uncovered and missing rows that are not 0."""
        names = {
            Status.TIE: "decided by the order of the rules",
            Status.UNCOVERED: "uncovered",
            Status.MISSING: "with missing values",
        }
        counts = {text: self.count(status) for status, text in names.items()}
        return [f"{count} {text}" for text, count in counts.items() if count]


def _status_title(taken: Collection[str]) -> str:
    """Return `status`, or what it is called where an output has that name."""
    title = "status"
    while title in taken:
        title += "_"
    return title


class Predictions(Answers, frozen=True, eq=False):
    """The classes that a model predicts for some rows: a sequence of labels.

    It has a length and can be indexed, sliced and iterated; `np.asarray` makes an array
    of it, and metrics of scikit-learn take it. A row without a class is None.

    Attributes:
        choices: The classes that the model can predict.
        codes: The position in `choices` of each row's class; -1 for no class.
        rule: The number of the winning rule or leaf of each row, from 1; 0 for none.
        owners: The position in `choices` of each rule's class; empty if not known.
        label_type: What the names of classes stand for, if not text.
        probabilities: Of each class, shape (classes, rows), NaN in rows without a
            rule; None if they were not requested.
    """

    choices: tuple[str, ...]
    codes: IntArray
    rule: IntArray
    owners: tuple[int, ...] = ()
    label_type: LabelType | msgspec.UnsetType = msgspec.UNSET
    probabilities: FloatArray | None = None

    @overload
    def __getitem__(self, row: SupportsIndex) -> Label | None: ...
    @overload
    def __getitem__(self, row: slice) -> Predictions: ...
    def __getitem__(self, row: SupportsIndex | slice) -> Label | Predictions | None:
        """Return the class of a row, or the predictions of some rows."""
        if isinstance(row, slice):
            return self._slice(row)
        code = self.codes[operator.index(row)]
        return None if code < 0 else label_of(self.choices[code], self.label_type)

    def __iter__(self) -> Iterator[Label | None]:
        """Yield the class of each row."""
        return iter(self.classes)

    def __array__(
        self, dtype: npt.DTypeLike | None = None, copy: bool | None = None
    ) -> npt.NDArray[np.generic]:
        """Return the class of each row; of objects if a row has none."""
        if copy is False:
            raise ValueError("an array of predictions is a copy")
        labels = [label_of(name, self.label_type) for name in self.choices]
        has_none = bool(np.any(self.codes < 0))
        table = np.array([*labels, None] if has_none else labels)
        return table[self.codes].astype(dtype or table.dtype, copy=False)

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
        result = [
            self.strengths[owners == k].max(axis=0) if k in self.owners else nothing
            for k in range(len(self.choices))
        ]
        return np.array(result)

    def class_counts(self) -> dict[str, int]:
        """Return how many rows have each class, and `no class` if any has none."""
        counts = np.bincount(self.codes + 1, minlength=len(self.choices) + 1).tolist()
        result = dict(zip(self.choices, counts[1:], strict=True))
        return result | ({"no class": counts[0]} if counts[0] else {})

    def to_pandas(self, strengths: By | None = None) -> pd.DataFrame:
        """Return the columns of `to_csv` as a frame of pandas; needs pandas.

        Classes are of the type of `classes`.

        Raises:
            ValueError: If strengths are requested that are not there.
        """
        return pandas_frame({**self.columns(strengths), "class": self.classes})

    def _answers(self) -> dict[str, Sequence[object]]:
        names = [name or "" for name in self.names]
        return {"class": names, "rule": self.rule.tolist()}

    def _arrays(self) -> dict[str, pa.Array]:
        import pyarrow as pa

        labels = pa.array([label_of(name, self.label_type) for name in self.choices])
        codes = pa.array(self.codes, mask=self.codes < 0)
        return {"class": labels.take(codes), "rule": pa.array(self.rule, pa.int32())}

    def _rows(self, strengths: By | None) -> dict[str, FloatArray]:
        rows: dict[str, FloatArray] = {}
        values = self.class_strengths if strengths == "class" else None
        if values is None:
            rows = super()._rows(strengths)
        for what, of_classes in (
            ("strength", values),
            ("probability", self.probabilities),
        ):
            if of_classes is not None:
                titles = [f"{what} of class {name}" for name in self.choices]
                rows |= zip(titles, of_classes, strict=True)
        return rows

    def __repr__(self) -> str:
        """Show how many rows there are; `str` shows how many rows got which class."""
        return summary("Predictions", rows=len(self), classes=len(self.choices))

    def __str__(self) -> str:
        """Show how many rows got which class, and what was out of the ordinary."""
        result = self.class_counts().items()
        counts = ", ".join(f"{name} {count}" for name, count in result)
        unusual = ", ".join(self._unusual())
        return f"{len(self)} rows: {counts}" + (f"; {unusual}" if unusual else "")


def joined(parts: Sequence[S]) -> S:
    """Return what was predicted for several batches of rows, one after another.

    An array that one of them lacks is None.
    """
    if len(parts) == 1:
        return parts[0]
    arrays: dict[str, object] = {}
    for name in parts[0].__struct_fields__:
        columns = [getattr(part, name) for part in parts]
        if isinstance(columns[0], np.ndarray):
            is_whole = all(column is not None for column in columns)
            arrays[name] = np.concatenate(columns, axis=-1) if is_whole else None
    return msgspec.structs.replace(parts[0], **arrays)


def answers_of(
    outcome: Outcome,
    model: Document,
    *,
    with_strengths: bool = False,
    with_probabilities: bool = False,
) -> Predictions | Outputs:
    """Name what an outcome answers: classes, or the numbers of a system."""
    names = [output.name for output in model.outputs]
    if isinstance(model, FuzzySystem):
        return outputs_of(outcome, names, with_strengths=with_strengths)
    return predictions_of(
        outcome,
        model,
        with_strengths=with_strengths,
        with_probabilities=with_probabilities,
    )


def outputs_of(
    outcome: Outcome, names: Sequence[str], *, with_strengths: bool = False
) -> Outputs:
    """Name the numbers of an outcome of a fuzzy system."""
    assert outcome.outputs is not None  # every runtime of systems gives them
    strengths = outcome.strengths if with_strengths else None
    return Outputs(
        tuple(names), outcome.outputs, status=outcome.status, strengths=strengths
    )


def predictions_of(
    outcome: Outcome,
    model: Model,
    *,
    with_strengths: bool = False,
    with_probabilities: bool = False,
) -> Predictions:
    """Name the classes of an outcome of a model.

    Probabilities need the strengths of a rule base that has them.
    """
    semantics = model.semantics
    owners = remember(model, "owners", lambda: tuple(rule_codes(model)[1:].tolist()))
    codes = rule_codes(model)[outcome.rule]
    for status, answer in (
        (Status.UNCOVERED, semantics.uncovered),
        (Status.MISSING, semantics.missing),
    ):
        code = -1 if answer is None else model.classes.index(answer)
        codes[outcome.status == status] = code
    probabilities = outcome.probabilities
    if with_probabilities and model.rules and probabilities is None:
        assert outcome.strengths is not None  # `prepare_answering` requests them
        probabilities = class_probabilities(model, outcome.strengths, outcome.rule)
    return Predictions(
        model.classes,
        codes,
        outcome.rule,
        owners,
        semantics.label_type,
        probabilities,
        status=outcome.status,
        strengths=outcome.strengths if with_strengths else None,
    )


def reasons(rules: RuleBase, values: FloatArray, predictions: Predictions) -> list[str]:
    """Return, for each row, its rule as a sentence, with each degree that is below 1.

    A value that stands for a missing one is named after it.

    `values` has shape (inputs, rows), in the order of `rules.inputs`.

    Example:
        >>> from fuzzytree.model.rulebase import Band, Proposition, Rule
        >>> from fuzzytree.model.rulebase import Term, Variable
        >>> low = Term("low", Band(high=1.0, right=3.0))
        >>> rules = RuleBase(
        ...     "grip", ("soft",), (Variable("force", (low,)),),
        ...     (Rule((Proposition("force", ("low",)),), "soft"),),
        ... )
        >>> one, status = np.array([1]), np.array([0])
        >>> found = Predictions(("soft",), np.array([0]), one, status=status)
        >>> reasons(rules, np.array([[2.0]]), found)
        ['IF force is low (0.5) THEN soft']
    """
    shapes = shapes_of(rules.variables)
    result = zip(
        values.T.tolist(),
        predictions.rule.tolist(),
        predictions.status.tolist(),
        strict=True,
    )
    rows = [(dict(zip(rules.inputs, row, strict=True)), *end) for row, *end in result]
    return [
        _reason(rules, shapes, row, rule, status) + _replaced_text(rules.variables, row)
        for row, rule, status in rows
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
    degrees = [proposition_degree(p, shapes, axes[p.variable]) for p in rule.when]
    propositions = [
        proposition_text(one) + (f" ({_short(degree)})" if degree < 1.0 else "")
        for one, degree in zip(rule.when, degrees, strict=True)
    ]
    text = f"IF {' AND '.join(propositions)} THEN " if propositions else "ALWAYS "
    if status == Status.DECIDED:
        return text + rule.then
    strengths = evaluate(rules, row).strengths
    equal = [k for k, s in enumerate(strengths, 1) if s == strengths[number - 1]]
    others = ", ".join(str(k) for k in equal if k != number)
    return f"{text}{rule.then}; as strong: rule {others}"


def _replaced_text(variables: Sequence[Variable], row: Mapping[str, float]) -> str:
    """Return which values of a row were missing, and what stands for each."""
    texts: list[str] = []
    for variable in variables:
        value = variable.missing
        if value is None or math.isfinite(row[variable.name]):
            continue
        names = (*variable.categories, "no category")  # the code of which is -1
        word = names[int(value)] if variable.categories else f"{value:g}"
        texts.append(f"{variable.name} by {word}")
    return f"; missing and replaced: {', '.join(texts)}" if texts else ""


def _short(degree: float) -> str:
    text = f"{degree:.3g}"
    return "<1" if text == "1" and degree < 1.0 else text


class Outputs(Answers, frozen=True, eq=False):
    """The numbers that a fuzzy system computes for some rows: a sequence of them.

    It has a length and can be indexed, sliced and iterated: a row is its number, or a
    tuple of numbers if there are several outputs. `np.asarray` makes an array of it, of
    shape (rows,) or (rows, outputs). The name of an output gives its numbers.

    A row is uncovered if an output got no conclusion and has its default; a rule's
    strength is its degree of activation.

    Attributes:
        names: The outputs.
        values: Shape (outputs, rows); NaN where a value is missing, and where no rule
            concludes an output that has no default.
    """

    names: tuple[str, ...]
    values: FloatArray

    @overload
    def __getitem__(self, row: str) -> FloatArray: ...
    @overload
    def __getitem__(self, row: SupportsIndex) -> float | tuple[float, ...]: ...
    @overload
    def __getitem__(self, row: slice) -> Outputs: ...
    def __getitem__(
        self, row: str | SupportsIndex | slice
    ) -> FloatArray | float | tuple[float, ...] | Outputs:
        """Return the numbers of an output, of a row, or the outputs of some rows.

        Raises:
            ValueError: If there is no output of a name.
        """
        if isinstance(row, slice):
            return self._slice(row)
        if isinstance(row, str):
            if row not in self.names:
                raise ValueError(f"no output {row!r}; {name_choice(row, self.names)}")
            numbers: FloatArray = self.values[self.names.index(row)]
            return numbers
        return _row_numbers(self.values[:, operator.index(row)].tolist())

    def __iter__(self) -> Iterator[float | tuple[float, ...]]:
        """Yield the numbers of each row."""
        return map(_row_numbers, self.values.T.tolist())

    def __array__(
        self, dtype: npt.DTypeLike | None = None, copy: bool | None = None
    ) -> npt.NDArray[np.generic]:
        """Return the numbers, of shape (rows,) or (rows, outputs)."""
        table = self.values[0] if len(self.names) == 1 else self.values.T
        return np.array(table, dtype) if copy else np.asarray(table, dtype)

    def spans(self) -> dict[str, tuple[float, float]]:
        """Return the least and the largest number of each output that has one."""
        known = {
            name: row[~np.isnan(row)]
            for name, row in zip(self.names, self.values, strict=True)
        }
        return {
            name: (float(row.min()), float(row.max()))
            for name, row in known.items()
            if row.size
        }

    def _answers(self) -> dict[str, Sequence[object]]:
        return dict(zip(self.names, map(_cells, self.values), strict=True))

    def _arrays(self) -> dict[str, pa.Array]:
        import pyarrow as pa

        rows = [pa.array(row, from_pandas=True) for row in self.values]  # NaN is null
        return dict(zip(self.names, rows, strict=True))

    def __repr__(self) -> str:
        """Show how many rows there are; `str` shows the range of each output."""
        return summary("Outputs", rows=len(self), outputs=len(self.names))

    def __str__(self) -> str:
        """Show the range of each output, and what was out of the ordinary."""
        result = self.spans().items()
        spans = ", ".join(
            f"{name} {low:.6g} to {high:.6g}" for name, (low, high) in result
        )
        spans = f"{len(self)} rows: {spans or 'no number'}"
        return "; ".join([spans, *self._unusual()])


def _cells(row: FloatArray) -> list[object]:
    return ["" if math.isnan(value) else value for value in row.tolist()]


def _row_numbers(numbers: Sequence[float]) -> float | tuple[float, ...]:
    return numbers[0] if len(numbers) == 1 else tuple(numbers)
