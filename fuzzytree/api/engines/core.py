"""What the adapters of all engines share, and what calls them.

A `Fold` makes the state of a partition, `merge_states` makes one state of several, and
a `Predictor` predicts a batch of rows. All are pickled and sent to the workers of an
engine. An adapter has two functions: `states` returns the states of a frame, and
`predictions` a lazy frame with the columns of a `Predictor` beside its own.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, cast

import msgspec
import narwhals as nw
import numpy as np
import pyarrow as pa

from fuzzytree import errors
from fuzzytree.api.answering import Answering, prepare_answering
from fuzzytree.api.engines import Engine, engine_of
from fuzzytree.errors import FuzzyTreeError, TableError
from fuzzytree.learning import Learner, LearningSettings
from fuzzytree.model import Model, label_of
from fuzzytree.runtimes import Predictions, joined

if TYPE_CHECKING:
    import pandas as pd

_STATE: Final = b"ARROW1"
"""How a state begins; the sentence of an error begins otherwise."""


def _names_of(frame: Any) -> list[str]:
    kind = type(frame)  # frames of Spark and Dask have their columns as attributes
    if hasattr(kind, "collect_schema"):
        return [*frame.collect_schema().names()]
    is_arrow = hasattr(kind, "column_names")
    return [*map(str, frame.column_names if is_arrow else frame.columns)]


def _without_rows(names: Iterable[str]) -> pa.Table:
    return pa.schema([(name, pa.null()) for name in names]).empty_table()


class Fold:
    """Makes the state of a partition; workers call it.

    Args:
        names: The columns of the frame, as they are written there.
        target: The column of the classes.
        ignore: Columns that are no input.
        settings: How to learn.

    Attributes:
        target: As the argument, without blanks around it.
        columns: The columns to learn from, in the order of the frame.
        selected: The columns that a partition needs, as they are written in the frame.

    Raises:
        TableError: If the target or an ignored column is absent, a column has no name
            or that of another one, or no column is left.
    """

    def __init__(
        self,
        names: Sequence[str],
        target: str,
        *,
        ignore: Sequence[str] = (),
        settings: LearningSettings | None = None,
    ) -> None:
        self.target = target.strip()
        self.settings = settings or LearningSettings()
        for number, name in enumerate(names, 1):
            if not name.strip() and f"column {number}" not in ignore:
                raise TableError(
                    f"the table: column {number} has no name; name it, or leave it out "
                    f"with ignore=['column {number}']"
                )
        probe = Learner(self.target, ignore=ignore)
        probe.update(_without_rows(names))
        self.columns = probe.columns or ()
        wanted = {self.target, *self.columns}
        self.selected = tuple(name for name in names if name.strip() in wanted)

    def __call__(
        self, rows: Iterable[pa.RecordBatch] | pd.DataFrame, name: str
    ) -> bytes:
        """Return the state of a partition that messages call so, empty without rows.

        An error of ours comes back as bytes as well, for the driver to raise: an engine
        would try again and bury its sentence.
        """
        learner = Learner(self.target, columns=self.columns, settings=self.settings)
        try:
            if hasattr(rows, "columns"):
                learner.update(rows, name=name)
                rows = ()
            batches = iter(rows)
            for first in batches:
                rest = itertools.chain([first], batches)
                reader = pa.RecordBatchReader.from_batches(first.schema, rest)
                learner.update(reader, name=name)
            has_rows = learner.rows or learner.dropped or learner.unlabelled
            return learner.to_bytes() if has_rows else b""
        except FuzzyTreeError as error:
            return msgspec.json.encode((type(error).__name__, str(error)))


def merge_states(states: Iterable[bytes]) -> bytes:
    """Return one state of several; the first error among them, if there is any."""
    total: Learner | None = None
    for state in states:
        if state and not state.startswith(_STATE):
            return state
        if state:
            learner = Learner.from_bytes(state)
            # partitions of equal rows have equal digests, and all of them count
            total = total.merge(learner, repeated=True) if total else learner
    return total.to_bytes() if total else b""


def collect_frame(
    frame: object,
    engine: Engine,
    target: object,
    *,
    ignore: Sequence[str] = (),
    settings: LearningSettings | None = None,
) -> Learner:
    """Return a learner of all rows of a lazy frame; see `fuzzytree.learn`."""
    if not isinstance(target, str):
        raise TableError(
            f"the target of a {engine.type_name} of {engine.package} is one of its "
            "columns: pass the name of the column"
        )
    adapter = engine.load()
    fold = Fold(_names_of(frame), target, ignore=ignore, settings=settings)
    state = merge_states(adapter.states(frame, fold))
    if not state:
        raise TableError("the table has no rows")
    if not state.startswith(_STATE):
        kind, text = msgspec.json.decode(state, type=tuple[str, str])
        raise getattr(errors, kind)(text)
    return Learner.from_bytes(state, name="the table", settings=fold.settings)


class Predictor:
    """Predicts batches of rows; workers call it.

    Attributes:
        inputs: The columns that it needs, without blanks around them.
        schema: The columns that are added: `class`, of the type of the labels, `rule`,
            `status` and `strength`.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.inputs = frozenset(name.strip() for name in model.inputs)
        label_type = model.semantics.label_type
        labels = pa.array([label_of(name, label_type) for name in model.classes])
        self.schema = pa.schema(
            [
                ("class", labels.type),
                ("rule", pa.int32()),
                ("status", pa.string()),
                ("strength", pa.float64()),
            ]
        )

    def __reduce__(self) -> tuple[type[Predictor], tuple[Model]]:
        """Leave out what each process prepares for itself."""
        return Predictor, (self.model,)

    @cached_property
    def _ready(self) -> Answering:
        return prepare_answering(self.model, with_strengths=bool(self.model.rules))

    def __call__(self, batch: pa.RecordBatch) -> pa.RecordBatch:
        """Return a batch with the predictions beside its columns."""
        more = self.predictions(batch)
        return pa.RecordBatch.from_arrays(
            [*batch.columns, *more.columns],
            schema=pa.schema([*batch.schema, *self.schema]),
        )

    def predictions(self, rows: object) -> pa.RecordBatch:
        """Return the predictions for the rows of a frame, without its columns.

        The class is null where the model gives none, the strength where no rule fires.

        Raises:
            TableError: If a column is absent or holds text.
        """
        parts = self._ready(rows, lambda _, one: one, name="a batch")
        result = cast("Predictions", joined([*parts]))
        places, all_strengths = np.flatnonzero(result.rule), result.strengths
        # of a tree's relative rules the winner has a strength of exactly 1
        strengths = np.ones(len(result))
        if all_strengths is not None:
            strengths[places] = all_strengths[result.rule[places] - 1, places]
        column = pa.array(strengths, mask=result.rule < 1)
        table = result.to_arrow().append_column("strength", column).cast(self.schema)
        columns = [one.combine_chunks() for one in table.columns]
        return pa.RecordBatch.from_arrays(columns, schema=self.schema)


def predict_frame(frame: object, predictor: Predictor) -> object:
    """Return a frame of the same kind with predictions; see `fuzzytree.predict`."""
    engine = engine_of(frame)
    eager: Any = None
    if engine is None:
        try:
            eager = nw.from_native(cast("Any", frame), eager_only=True)
        except TypeError as error:
            text = f"{type(frame).__name__} is no frame; `run` takes paths and arrays"
            raise TypeError(text) from error
    names = _names_of(frame)
    is_blind = engine is not None and engine.ignores_case
    own = {name.lower() if is_blind else name: name for name in names}
    clashes = [own[name] for name in predictor.schema.names if name in own]
    if clashes:
        raise TableError(
            f"the table has a column {clashes[0]!r} of its own, and predict adds one "
            "of this name; rename the column"
        )
    predictor.predictions(_without_rows(names))  # are all inputs there?
    if engine is not None:
        return engine.load().predictions(frame, predictor, predictor.schema)
    added = pa.Table.from_batches([predictor.predictions(frame)])
    more = nw.from_arrow(added, backend=eager.implementation)
    return eager.with_columns(*(more[name] for name in more.columns)).to_native()
