"""What leaving out saves, measured on the same model in three stages.

*all columns* looks at every column of the table that it was learnt from, as a model
does that declares them all; *as it is* is the model; *pruned* is what is left of it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, get_args

import msgspec
import numpy as np
from msgspec.structs import replace

from fuzzytree.benchmarking.clock import time_calls
from fuzzytree.benchmarking.records import Timing
from fuzzytree.checking import Needs, needs, prove
from fuzzytree.errors import FuzzyTreeError, LossError, MissingExtraError
from fuzzytree.exporters import contents, find_format
from fuzzytree.exporters import write_onnx as write_onnx
from fuzzytree.model import (
    Agreement,
    Document,
    Dtype,
    Progress,
    Result,
    Use,
    Variable,
    summary,
)
from fuzzytree.runtimes import baseline, open_onnx
from fuzzytree.semantics import Pruned, Removed, forms, probe_values
from fuzzytree.tables import batches, path_of

if TYPE_CHECKING:
    from fuzzytree.benchmarking.clock import Call
    from fuzzytree.exporters import Output
    from fuzzytree.model import FloatArray

ALL_COLUMNS, AS_IT_IS, PRUNED = "all columns", "as it is", "pruned"

BATCH = 10_000
"""Rows of the larger of the two timed calls."""

_LARGEST_VALUE = 1e30  # of a row that is timed: no overflow, no subnormal numbers


class File(msgspec.Struct, frozen=True):
    """One file that a model makes.

    Attributes:
        representation: `tree`, `relative rules`, `raw rules`, `rules` or `system`.
        format: Its name.
        dtype: The number type; None where the format has none.
        bytes: The size.
        nodes: Of the graph; None if there is none.
        constants: Of the graph; None if there is none.
    """

    representation: str
    format: str
    dtype: Dtype | None
    bytes: int
    nodes: int | None = None
    constants: int | None = None


class Size(msgspec.Struct, frozen=True):
    """How large a model is in one stage.

    Attributes:
        stage: `all columns`, `as it is` or `pruned`.
        inputs: The columns that are read.
        row_bytes: What a row of doubles takes.
        terms: How many terms and fitted sets there are.
        files: What it makes.
    """

    stage: str
    inputs: int
    row_bytes: int
    terms: int
    files: tuple[File, ...]


class Cost(msgspec.Struct, frozen=True):
    """How long one thing takes in one stage.

    Attributes:
        stage: As in `Size`.
        representation: As in `File`; empty for reading a table.
        runtime: What ran; empty for reading a table.
        what: `open`, `one row`, `10,000 rows` or `read the table`.
        timing: Of one call.
    """

    stage: str
    representation: str
    runtime: str
    what: str
    timing: Timing


class Footprint(Result, msgspec.Struct, frozen=True):
    """What a model needs, what was left out, what that saves, and the proof.

    Attributes:
        needs: What the model needs.
        removed: What was left out.
        rules: For each rule that is left its number before.
        sizes: Before and after.
        costs: Before and after, where they were measured.
        proof: The comparison of the pruned model with the model.
        omissions: What could not be measured, and why.
    """

    needs: Needs
    removed: tuple[Removed, ...]
    rules: tuple[int, ...]
    sizes: tuple[Size, ...]
    costs: tuple[Cost, ...]
    proof: Agreement
    omissions: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Show how many inputs are needed, and how many things were left out."""
        return summary(
            "Footprint", inputs=len(self.needs.inputs), removed=len(self.removed)
        )

    @property
    def ok(self) -> bool:
        """Whether the pruned model was proved to be the model."""
        return self.proof.ok

    def to_json(self) -> str:
        """Return the same facts for programs, as indented JSON."""
        facts = {"ok": self.ok, **msgspec.to_builtins(self)}
        return msgspec.json.format(msgspec.json.encode(facts), indent=2).decode()


def report(
    model: Document,
    remainder: Pruned,
    *,
    uses: Collection[Use] = ("tree", "relative"),
    data: FloatArray | None = None,
    table: object = None,
    budget_s: float = 0.0,
    progress: Progress | None = None,
) -> Footprint:
    """Return what a model needs, prove its pruned form, and what that saves.

    Args:
        model: The model.
        remainder: Its pruned form.
        uses: What a tree serves, as when it was pruned.
        data: Rows of one's own for the proof, in the order of the model's inputs.
        table: The path of a table; reading it is timed.
        budget_s: For all timings together; 0 for none.
        progress: Called with the current step and the share that is done.
    """
    models = stages(model, remainder.model)
    taken, omissions = sizes(models, uses)
    timed, untimed = (
        ((), ())
        if budget_s <= 0
        else costs(models, uses, table=table, seconds=budget_s, progress=progress)
    )
    return Footprint(
        needs(model, uses=uses),
        remainder.removed,
        remainder.rules,
        taken,
        timed,
        prove(model, remainder, uses=uses, data=data),
        (*omissions, *untimed),
    )


def stages(model: Document, left: Document) -> dict[str, Document]:
    """Return the model in its stages; without the first if it has no more columns."""
    models = {AS_IT_IS: model, PRUNED: left}
    if set(model.columns) > set(model.inputs):
        return {ALL_COLUMNS: with_all_columns(model), **models}
    return models


def with_all_columns(model: Document) -> Document:
    """Return a model that needs a value in every column of its training table.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> with_all_columns(random_tree(1, leaves=2, inputs=3)).inputs
        ('x1', 'x2', 'x3')
    """
    known = {v.name: v for v in model.variables}
    declared = [known.get(name, Variable(name)) for name in model.columns]
    combined = [v for v in model.variables if v.parts]
    return replace(model, variables=(*declared, *combined))


# --- sizes


def sizes(
    models: Mapping[str, Document], uses: Collection[Use]
) -> tuple[tuple[Size, ...], tuple[str, ...]]:
    """Return how large each stage is, and what could not be written and why."""
    omissions: list[str] = []
    records = [
        Size(
            stage,
            len(model.inputs),
            8 * len(model.inputs),
            _term_count(model),
            tuple(_files(model, uses, omissions)),
        )
        for stage, model in models.items()
    ]
    return tuple(records), tuple(dict.fromkeys(omissions))


def _term_count(model: Document) -> int:
    groups = [variable.terms for variable in model.variables]
    groups += [output.terms for output in model.outputs]
    groups += [group.terms for group in model.sets]
    return sum(map(len, groups))


def _files(
    model: Document, uses: Collection[Use], omissions: list[str]
) -> Iterator[File]:
    names = ("yaml", "python", "c") if model.outputs else ("yaml", "python")
    for title, representation in forms(model, uses).items():
        for form in map(find_format, names):
            try:
                written = form.write(representation)
            except LossError as error:
                omissions.append(f"{title} as {form.name}: {error}")
                continue
            yield File(title, form.name, None, len(written.content))
    usual: tuple[Output, ...] = ("label", "rule")
    usual = ("outputs", "status") if model.outputs else usual
    for title, representation in forms(model, uses).items():
        for dtype in _graph_types(representation):
            try:
                written = write_onnx(
                    representation, dtype=dtype, outputs=usual, verify=False
                )
            except (LossError, MissingExtraError) as error:
                omissions.append(f"{title} in {dtype}: {error}")
                continue
            size = contents(written.content)
            yield File(title, "onnx", dtype, size.bytes, size.nodes, size.constants)


def _graph_types(model: Document) -> tuple[Dtype, ...]:
    """Return the number types whose ONNX graphs of a form differ."""
    if model.outputs:
        return ("float64",)
    return get_args(Dtype) if model.rules else ("float64", "float32")


# --- costs

_Key = tuple[str, str, str, str]  # stage, representation, runtime, what


def costs(
    models: Mapping[str, Document],
    uses: Collection[Use],
    *,
    table: object = None,
    seconds: float = 20.0,
    rounds: int = 15,
    progress: Progress | None = None,
) -> tuple[tuple[Cost, ...], tuple[str, ...]]:
    """Time opening, answering and reading in every stage, interleaved.

    Files are opened and run in onnxruntime, models run in the native runtime, both in
    one thread.

    All of it takes `seconds`, with at most `rounds` samples of each call. No table is
    read if `table` is None.

    Returns:
        The costs, and what could not be timed and why.
    """
    omissions: list[str] = []
    groups: dict[int, dict[_Key, Call]] = {1: {}, BATCH: {}}
    for stage, model in models.items():
        rows = _plain_rows(model, BATCH)
        for title, representation in forms(model, uses).items():
            for rows_of, key, call in _calls(
                stage, title, representation, rows, omissions
            ):
                groups[rows_of][key] = call
        if table is not None:
            reading = partial(_read, table, model)
            try:
                reading()
            except FuzzyTreeError as error:
                omissions.append(f"reading {path_of(table)}, {stage}: {error}")
            else:
                groups[1][stage, "", "", "read the table"] = reading
    records: list[Cost] = []
    for size, calls in groups.items():
        named = {" ".join(filter(None, key)): key for key in calls}
        timed = time_calls(
            {name: calls[key] for name, key in named.items()},
            rows=size,
            rounds=rounds,
            seconds=seconds / len(groups),
            progress=progress,
        )
        for failure in timed.failures.values():
            raise failure
        if timed.is_interrupted:
            raise KeyboardInterrupt
        records += [Cost(*named[name], one) for name, one in timed.timings.items()]
        omissions += [
            f"{name}: the time was over" for name in named if name not in timed.timings
        ]
    return tuple(records), tuple(dict.fromkeys(omissions))


def _calls(
    stage: str, title: str, model: Document, rows: FloatArray, omissions: list[str]
) -> Iterator[tuple[int, _Key, Call]]:
    """Yield the calls of one representation, each with its number of rows."""
    base = baseline()
    runs = {base.name: base.load(model)}
    try:
        content = write_onnx(model, verify=False).content
        runs["onnxruntime"] = open_onnx(content, title).run
    except (LossError, MissingExtraError) as error:
        omissions.append(f"{title} in onnxruntime: {error}")
    else:
        key = (stage, title, "onnxruntime", "open")
        yield 1, key, lambda: open_onnx(content, title)
    for name, run in runs.items():
        for count, what in ((1, "one row"), (BATCH, f"{BATCH:,} rows")):
            values = np.ascontiguousarray(rows[:, :count])
            yield count, (stage, title, name, what), partial(run, values)


def _read(table: object, model: Document) -> int:
    pieces = batches(
        table, model.inputs, trained=model.columns, variables=model.variables
    )
    return sum(batch.values.shape[1] for batch in pieces)


def _plain_rows(model: Document, count: int) -> FloatArray:
    """Return probes without extremes, again and again; shape (inputs, count)."""
    values = probe_values(model, 500)
    size = np.abs(values)
    is_plain = (size > 1.0 / _LARGEST_VALUE) & (size < _LARGEST_VALUE) | (size == 0.0)
    kept = values[:, is_plain.all(axis=0)]
    if not kept.shape[1]:
        kept = np.zeros((len(values), 1))
    return np.ascontiguousarray(kept[:, np.arange(count) % kept.shape[1]])
