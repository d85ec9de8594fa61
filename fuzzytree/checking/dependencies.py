"""What a model needs, what the rest costs, and the proof that it may go.

A graph's operators are listed with what they are there for. No such list is written
by hand: the model is written once more without the thing, a negation say, and
what is missing from that graph was there because of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, cast, get_args

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
from fuzzytree.checking.equivalence import with_functions
from fuzzytree.errors import LossError, MissingExtraError
from fuzzytree.exporters import Contents, contents
from fuzzytree.exporters import write_onnx as write_onnx
from fuzzytree.model import (
    LR,
    Agreement,
    Comparison,
    Curve,
    Document,
    Dtype,
    FloatArray,
    FuzzyTree,
    Model,
    ModelKind,
    Outcome,
    Proposition,
    RuleBase,
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
    free_axes,
    probe_values,
    proof_faults,
    pruned,
    unguarded,
)

if TYPE_CHECKING:
    from fuzzytree.exporters import Output
    from fuzzytree.semantics import Form


class Because(msgspec.Struct, frozen=True):
    """The part of a graph that one feature of a model causes.

    Attributes:
        what: The thing, as people name it.
        operators: How many nodes of each operator fewer there are without it; below 0
            where there are more.
        bytes: How many bytes fewer.
    """

    what: str
    operators: dict[str, int]
    bytes: int


class Graph(msgspec.Struct, frozen=True):
    """The ONNX graph of one representation and number type, with label and rule.

    The causes are listed for `float64`; the other types differ by a cast.

    Attributes:
        representation: `tree`, `relative rules`, `raw rules`, `rules` or `system`.
        dtype: The number type.
        contents: How large it is.
        because: What of it is there on account of what the model has.
        on_request: What further outputs would add, counted alike.
        left_out: What the model does not have, of which the graph has nothing.
    """

    representation: str
    dtype: Dtype
    contents: Contents
    because: tuple[Because, ...] = ()
    on_request: tuple[Because, ...] = ()
    left_out: tuple[str, ...] = ()


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
        graphs: Its ONNX graphs, and what is in them for what.
        omissions: Why there is no graph, where there is none.
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
    graphs: tuple[Graph, ...] = ()
    omissions: tuple[str, ...] = ()
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
    graphs, omissions = _graphs(model)
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
        graphs=graphs,
        omissions=omissions,
        outputs=tuple(output.name for output in model.outputs),
    )


# --- graphs


def _usual(model: Document) -> tuple[Output, ...]:
    return ("outputs", "status") if model.outputs else ("label", "rule")


def sizes_of(
    model: Document, uses: Collection[Use], omissions: list[str]
) -> Iterator[tuple[Form, Dtype, Contents]]:
    """Yield each form of a model and number type with what is in its ONNX graph.

    Args:
        model: A tree, a rule base or a fuzzy system.
        uses: What a tree serves.
        omissions: Gets a sentence for each that cannot be written.
    """
    for title, form in forms(model, uses).items():
        for dtype in get_args(Dtype):
            if not form.rules and dtype == "mixed":
                continue  # a path has comparisons alone: it is float64
            if form.outputs and dtype != "float64":
                continue  # graphs of systems are in double
            try:
                yield title, dtype, _written(form, dtype, _usual(form))
            except (LossError, MissingExtraError) as error:
                omissions.append(f"{title} in {dtype}: {error}")


def _graphs(model: Document) -> tuple[tuple[Graph, ...], tuple[str, ...]]:
    omissions: list[str] = []
    every = forms(model)
    graphs = [
        Graph(title, dtype, whole)
        if dtype != "float64"
        else _explained(title, every[title], whole)
        for title, dtype, whole in sizes_of(model, get_args(Use), omissions)
    ]
    return tuple(graphs), tuple(omissions)


def _explained(title: str, model: Document, whole: Contents) -> Graph:
    """Return a graph in double with what is in it for what."""
    usual = _usual(model)
    more: tuple[Output, ...] = ("status",)
    if model.rules:
        more = ("activations",) if model.outputs else ("status", "strengths")
    on_request = [
        _because(f"output {one}", _written(model, "float64", (*usual, one)), whole)
        for one in more
    ]
    because: list[Because] = []
    left_out: list[str] = []
    others: dict[str, Document] = {}
    if model.classes:
        decider = cast("Model", model)
        has_combinations = any(variable.parts for variable in model.variables)
        others[COMBINATIONS] = free_axes(decider) if has_combinations else model
        if model.rules:
            rules = cast("RuleBase", model)
            others |= {what: without(rules) for what, without in _FEATURES.items()}
    for what, other in others.items():
        if other == model:
            left_out.append(what)
        else:
            because.append(_because(what, whole, _written(other, "float64", usual)))
    reasons = (tuple(because), tuple(on_request), tuple(left_out))
    return Graph(title, "float64", whole, *reasons)


def _written(model: Document, dtype: Dtype, outputs: Sequence[Output]) -> Contents:
    written = write_onnx(model, dtype=dtype, outputs=outputs, verify=False)
    return contents(written.content)


def _because(what: str, whole: Contents, without: Contents) -> Because:
    fewer = Counter(whole.operators)
    fewer.subtract(without.operators)
    operators = {name: count for name, count in sorted(fewer.items()) if count}
    return Because(what, operators, whole.bytes - without.bytes)


def _with_rules(
    rules: RuleBase, change: Callable[[Proposition], Proposition]
) -> RuleBase:
    """Return a rule base with other propositions."""
    changed = [replace(r, when=tuple(map(change, r.when))) for r in rules.rules]
    return replace(rules, rules=tuple(changed))


def _straight(curve: Curve) -> Curve:
    """Return a membership function whose sides have one number."""
    if not isinstance(curve, LR):
        return curve
    sides = [replace(side, curve=side.curve[:1]) for side in (curve.left, curve.right)]
    return replace(curve, left=sides[0], right=sides[1])


COMBINATIONS = "combinations"

_FEATURES: Mapping[str, Callable[[RuleBase], Document]] = MappingProxyType(
    {
        "negation": lambda rules: _with_rules(
            rules, lambda proposition: replace(proposition, hedges=())
        ),
        "OR of terms": lambda rules: _with_rules(
            rules, lambda proposition: replace(proposition, terms=proposition.terms[:1])
        ),
        "product as AND": lambda rules: replace(
            rules, semantics=replace(rules.semantics, conjunction="minimum")
        ),
        "an answer of its own for missing values": lambda rules: replace(
            rules, semantics=replace(rules.semantics, missing=rules.semantics.uncovered)
        ),
        "curves": lambda rules: with_functions(rules, _straight),
    }
)
"""What rules may have, and the rules without it: the same if they have none."""


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
