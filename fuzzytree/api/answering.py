"""Models made ready to answer tables, whatever holds them and whatever runs them."""

from __future__ import annotations

import contextlib
import math
import os
import threading
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from typing import TypedDict, TypeVar, Unpack, overload

import msgspec
import numpy as np

from fuzzytree.checking import CALLED, as_model
from fuzzytree.errors import LossError, MissingExtraError, ReadError
from fuzzytree.files import read_bounded
from fuzzytree.model import (
    Document,
    Fitted,
    FloatArray,
    FuzzySystem,
    Model,
    ModelSource,
    Run,
    Runtime,
    Variable,
    kind_of,
)
from fuzzytree.runtimes import (
    OnnxModel,
    Outputs,
    Predictions,
    answers_of,
    baseline,
    find_runtime,
    is_installed,
    joined,
    mix,
    needed_by,
    open_onnx,
    outputs_of,
    rules_only,
    run_of,
)
from fuzzytree.semantics import rules_of
from fuzzytree.tables import Batch, TableSource, batches, in_order

T = TypeVar("T")

Carried = ModelSource | OnnxModel | bytes
"""A model, an ONNX file opened or as bytes, or the path of a file of either."""

_BLOCK = 1 << 16  # rows answered at a time
_SHORT = "best-first"  # gives the same classes, rules and statuses, no strengths


def opened(source: Carried, *, allow_loss: bool = False) -> Document | OnnxModel:
    """Return a model as it is, and whatever a file or bytes hold ready to run.

    Args:
        source: A model, an ONNX file opened or as bytes, or the path of a file.
        allow_loss: As in `load`.

    Raises:
        ReadError: If the file cannot be read, or is not ours.
        LossError: As `load`.
        MissingExtraError: If it is an ONNX file and onnxruntime is not installed.
    """
    match source:
        case bytes():
            return open_onnx(source, "the bytes")
        case str() | os.PathLike():
            if Path(source).suffix.lower() == ".onnx":
                return open_onnx(read_bounded(source), os.fspath(source))
            return as_model(source, allow_loss=allow_loss)
        case OnnxModel():
            return source
        case _:
            return as_model(source)


class RunArguments(TypedDict, total=False):
    """The keywords of `run`."""

    runtime: str | None
    columns: Sequence[str] | None
    with_strengths: bool
    with_probabilities: bool
    allow_loss: bool


@overload
def run(
    model: FuzzySystem, table: object, **options: Unpack[RunArguments]
) -> Outputs: ...


@overload
def run(
    model: Model | Fitted, table: object, **options: Unpack[RunArguments]
) -> Predictions: ...


@overload
def run(
    model: Carried, table: object, **options: Unpack[RunArguments]
) -> Predictions | Outputs: ...


def run(
    model: Carried,
    table: object,
    *,
    runtime: str | None = None,
    columns: Sequence[str] | None = None,
    with_strengths: bool = True,
    with_probabilities: bool = False,
    allow_loss: bool = False,
) -> Predictions | Outputs:
    """Answer the rows of a table: classes, or the numbers of a fuzzy system.

    Classes are numbers, booleans or text, as the labels that the model was learnt from.
    Native runtimes and onnxruntime use all processors, or as many as `OMP_NUM_THREADS`
    says, with the same bits for any number.

    Args:
        model: The model; see `Carried`.
        table: A path, a pandas, polars or arrow table, or an array of shape
            (rows, columns). Columns are found by name.
        runtime: What executes the model: `native` unless given, or `best-first` for
            rules without strengths; an ONNX file is always executed by onnxruntime.
        columns: The names of an array's columns; unless given those of the table
            that the model was learnt from.
        with_strengths: Whether to keep the strengths of the rules, 8 bytes for each
            rule and row.
        with_probabilities: Whether to return the probability of each class; a tree is
            then run as its relative rules.
        allow_loss: As in `load`.

    Raises:
        TableError: If a column is absent or holds text.
        MissingExtraError: If the runtime is not installed.
        LossError: If the runtime cannot carry the model, or as `load`.
        ValueError: If there is no such runtime, or the model has no probabilities.
    """
    result = opened(model, allow_loss=allow_loss)
    ready = prepare_answering(
        result,
        runtime,
        with_strengths=with_strengths,
        with_probabilities=with_probabilities,
    )
    source = TableSource(table, columns)
    return joined([*ready(source, lambda _, one: one)])


class Answering(msgspec.Struct, frozen=True):
    """A model made ready, which answers tables piece by piece.

    Attributes:
        inputs: The columns that it needs, in order.
        trained: The columns of the table that it was learnt from, if any.
        answer: Predicts for values of shape (inputs, rows).
        is_parallel: Whether several threads may call it at the same time.
        variables: Those of the model, which say what cells mean.
    """

    inputs: tuple[str, ...]
    trained: tuple[str, ...]
    answer: Callable[[FloatArray], Predictions | Outputs]
    is_parallel: bool = False
    variables: tuple[Variable, ...] = ()

    def __call__(
        self,
        table: object,
        finish: Callable[[Batch, Predictions | Outputs], T],
        *,
        name: str | None = None,
        with_others: bool = False,
    ) -> Generator[T]:
        """Yield what a function makes of each batch of rows and the answers to it.

        Batches are answered in threads, in which `finish` is called too, and yielded
        in order. The other arguments are those of `fuzzytree.tables.batches`.

        Raises:
            TableError: If a column is absent or holds text.
        """
        turn = contextlib.nullcontext() if self.is_parallel else threading.Lock()

        def answered(batch: Batch) -> T:
            rows = batch.values.shape[1]
            size = math.ceil(rows / max(math.ceil(rows / _BLOCK), 1)) or 1
            starts = range(0, max(rows, 1), size)
            blocks = [batch.values[:, k : k + size] for k in starts]
            over = in_order if self.is_parallel else map
            with turn:
                result = [*over(self.answer, blocks)]
            return finish(batch, joined(result))

        parts = batches(
            table,
            self.inputs,
            trained=self.trained,
            name=name,
            with_others=with_others,
            variables=self.variables,
        )
        return in_order(answered, parts)


def prepare_answering(
    model: Document | OnnxModel,
    runtime: str | None = None,
    *,
    with_strengths: bool = True,
    with_probabilities: bool = False,
) -> Answering:
    """Make a model ready to answer, unless it is.

    What one model needs is kept as long as the model, where threads may share it. With
    probabilities a tree is run as its relative rules.

    Raises:
        MissingExtraError: If the runtime is not installed.
        LossError: If the runtime cannot carry the model.
        ValueError: If there is no such runtime, or another one for an ONNX file, or the
            model has no probabilities.
    """
    if with_probabilities:
        model = _rated(model)
    if isinstance(model, OnnxModel):
        return _answering_onnx(model, runtime, with_strengths=with_strengths)
    is_mixed = with_probabilities and not with_strengths
    is_short = not (with_strengths or with_probabilities)
    if is_short and runtime is None and kind_of(model) in find_runtime(_SHORT).runs:
        runtime = _SHORT
    used = _runtime(runtime or baseline().name, model)
    execute: Run
    if is_mixed and used == baseline():
        execute = mix(rules_only(model, used.name, "mixes"))
    else:
        fires = with_strengths or with_probabilities
        execute = run_of(model, used, with_strengths=fires)

    def answer(values: FloatArray) -> Predictions | Outputs:
        outcome = execute(np.ascontiguousarray(values))
        return answers_of(
            outcome,
            model,
            with_strengths=with_strengths,
            with_probabilities=with_probabilities,
        )

    variables = tuple(one for one in model.variables if not one.parts)
    return Answering(model.inputs, model.columns, answer, used.is_reentrant, variables)


def _rated(model: Document | OnnxModel) -> Document | OnnxModel:
    """Return what computes the probabilities of a model."""
    if isinstance(model, OnnxModel):
        outputs: tuple[str, ...] = model.outputs
        if "probabilities" not in outputs:
            raise ValueError(f"{model.name}: the file has no output 'probabilities'")
        return model
    if not model.semantics.sharpness:
        raise ValueError(f"{model.name} has no probabilities of classes")
    return rules_of(model)


def _answering_onnx(
    model: OnnxModel, runtime: str | None, *, with_strengths: bool
) -> Answering:
    if runtime is not None:
        raise ValueError(
            f"runtime {runtime!r}: an ONNX file runs in onnxruntime; "
            "other runtimes need the YAML file"
        )
    run = model.run_labelled
    if run is None and not model.names:
        raise ReadError(f"{model.name}: the ONNX file has no output 'label'")
    position: dict[str | None, int] = {name: k for k, name in enumerate(model.classes)}

    def answer(values: FloatArray) -> Predictions | Outputs:
        if run is None:
            return outputs_of(
                model.run(values), model.names, with_strengths=with_strengths
            )
        outcome, labels = run(values)
        return Predictions(
            model.classes,
            np.array([position.get(name, -1) for name in labels], np.int64),
            outcome.rule,
            status=outcome.status,
            strengths=outcome.strengths if with_strengths else None,
            label_type=model.semantics.label_type,
            probabilities=outcome.probabilities,
        )

    return Answering(
        model.inputs, model.columns, answer, is_parallel=True, variables=model.variables
    )


def _runtime(name: str, model: Document) -> Runtime:
    runtime = find_runtime(name)
    representation = kind_of(model)
    if representation not in runtime.runs:
        raise LossError(
            f"cannot run {model.name} in {name}: it runs "
            f"{' or '.join(runtime.runs)}, not a {CALLED[representation]}"
        )
    if not is_installed(runtime):
        raise MissingExtraError(f"the runtime {name!r} needs {needed_by(runtime)}")
    return runtime
