"""What a model needs, and the proof that the rest may go."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING, cast

import msgspec
import numpy as np
from msgspec.structs import replace

from fuzzytree.checking.certificates import missing_rows
from fuzzytree.checking.comparing import (
    ModelRun,
    RowSet,
    compare,
    counted,
    row_set,
)
from fuzzytree.exporters import write_onnx as write_onnx
from fuzzytree.model import (
    Agreement,
    Comparison,
    Document,
    FloatArray,
    FuzzyTree,
    ModelKind,
    Outcome,
    Runtime,
    Use,
    fingerprint,
    kind_of,
)
from fuzzytree.runtimes import baseline, find_runtime
from fuzzytree.semantics import (
    Pruned,
    Removed,
    forms,
    probe_values,
    proof_faults,
    pruned,
    unguarded,
)

if TYPE_CHECKING:
    pass


class Needs(msgspec.Struct, frozen=True):
    """What a model needs and what it does not.

    Attributes:
        model: Its name.
        fingerprint: The SHA-256 of its content.
        representation: Whether it is a tree, a rule base or a fuzzy system.
        columns: How many columns the training table had; None if unknown.
        inputs: The inputs that an answer depends on.
        idle_inputs: The inputs that matter only where their value is missing.
        combinations: The combinations that the model uses.
        terms: How many terms there are.
        sets: How many fitted sets there are; only a tree has them.
        rules: How many rules or leaves there are.
        idle: All that could go; what that would change is said with it.
        outputs: Those of a fuzzy system.
    """

    model: str
    fingerprint: str
    representation: ModelKind
    columns: int | None
    inputs: tuple[str, ...]
    idle_inputs: tuple[str, ...]
    combinations: tuple[str, ...]
    terms: int
    sets: int
    rules: int
    idle: tuple[Removed, ...]
    outputs: tuple[str, ...] = ()


def needs(model: Document, *, uses: Collection[Use] = ("tree", "relative")) -> Needs:
    """Return what a model needs, and all that could be left out of it.

    Args:
        model: A tree, a rule base or a fuzzy system.
        uses: As in `pruned`.

    Raises:
        ValueError: As `pruned`.
    """
    used = pruned(model, uses=uses, inputs=True).model
    left = pruned(model, uses=uses, inputs=True, rules=True)
    return Needs(
        model=model.name,
        fingerprint=fingerprint(model),
        representation=kind_of(model),
        columns=len(model.columns) or None,
        inputs=used.inputs,
        idle_inputs=tuple(n for n in model.inputs if n not in used.inputs),
        combinations=tuple(v.name for v in used.variables if v.parts),
        terms=sum(len(variable.terms) for variable in model.variables)
        + sum(len(output.terms) for output in model.outputs),
        sets=sum(len(group.terms) for group in model.sets),
        rules=len(model.rule_labels) or len(model.rules),
        idle=left.removed,
        outputs=tuple(output.name for output in model.outputs),
    )


# --- the proof


def prove(
    model: Document,
    remainder: Pruned,
    *,
    uses: Collection[Use] = ("tree", "relative"),
    data: FloatArray | None = None,
    runtimes: Sequence[str] = (),
    limit: int = 5_000,
) -> Agreement:
    """Compare a pruned model with the model: by proof, and by running both.

    Strengths are compared bit for bit, those of rules that are gone with 0. Rows in
    which a value is missing that only the whole model looks at are answered by the
    pruned one; they are counted, and differ by design.

    Args:
        model: The model before.
        remainder: What `pruned` made of it, or what somebody says it did.
        uses: What a tree serves, as when it was pruned.
        data: Rows of one's own, of shape (inputs, rows), in the order of the inputs
            of `model`.
        runtimes: The names of what runs both; the native runtime if none.
        limit: The most probes.

    Raises:
        ValueError: If a runtime is unknown, or `data` has another shape.
    """
    whole, left = forms(model, uses), forms(remainder.model, uses)
    faults = [*proof_faults(model, remainder.model, uses=uses, rules=remainder.rules)]
    size = len(model.rules or cast("FuzzyTree", model).nodes)
    proof = counted("proof", "pruned", "the model", size, faults)
    comparisons = [replace(proof, origin="equal operations on equal numbers")]
    rows = row_set(model.inputs, probe_values(model, limit), data)
    for title, representation in whole.items():
        other = left.get(title)
        if other is None or not set(other.inputs) <= set(model.inputs):
            continue
        for name in runtimes or [baseline().name]:
            comparisons += _compared(
                title, find_runtime(name), representation, other, model, remainder, rows
            )
    return Agreement(
        model.name, fingerprint(model), tuple(comparisons), probes=rows.probes
    )


def _compared(
    title: str,
    runtime: Runtime,
    model: Document,
    left: Document,
    whole: Document,
    remainder: Pruned,
    rows: RowSet,
) -> Iterator[Comparison]:
    if kind_of(model) not in runtime.runs:
        return
    unseen = unguarded(whole, remainder.model)  # what only the whole model looks at
    is_seen = ~missing_rows(whole, rows.values, runtime.dtype, unseen)
    order = [model.inputs.index(one) for one in left.inputs]
    outcome = runtime.load(left)(np.ascontiguousarray(rows.values[order]))
    numbered = _in_old_numbers(outcome, model, remainder.rules)
    pair = [
        ModelRun(f"pruned {title} in {runtime.name}", model, numbered),
        ModelRun(title, model, runtime.load(model)(rows.values)),
    ]
    parts = [(is_seen, False), (~is_seen, True)]
    for chosen, is_by_design in parts:
        numbers = np.flatnonzero(chosen)
        if not is_by_design or numbers.size:
            one, two = (answers.part(numbers) for answers in pair)
            compared = compare(one, two, rows.part(numbers))
            if is_by_design and compared.differing:
                compared = replace(compared, verdict="differs by design", detail=())
            yield compared


def _in_old_numbers(
    outcome: Outcome, model: Document, numbers: Sequence[int]
) -> Outcome:
    """Return an outcome as if the rules that are gone were there, with strength 0."""
    if not (model.rules and numbers):
        return outcome
    old = np.array([0, *numbers], np.int64)[outcome.rule]
    strengths = None
    if outcome.strengths is not None:
        zeros = np.zeros((len(model.rules), outcome.rule.size))
        strengths = np.where(np.isnan(outcome.strengths[:1]), np.nan, zeros)
        strengths[np.array(numbers) - 1] = outcome.strengths
    return replace(outcome, rule=old, strengths=strengths)
