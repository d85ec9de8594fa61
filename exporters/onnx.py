"""ONNX: a tree, rules or a fuzzy system as a graph that any ONNX runtime executes.

A tree gives the graph that follows its path, a rule base the graph that fires all its
rules, and a fuzzy system that of all its operations. See `docs/reference/onnx.md` for
the graphs, their cost and the versions that run them.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, get_args

import msgspec

from fuzzytree.errors import MissingExtraError, install_hint
from fuzzytree.exporters.program_text import rated_rules
from fuzzytree.model import (
    Document,
    Dtype,
    Format,
    FuzzySystem,
    FuzzyTree,
    RuleBase,
    Written,
    fingerprint,
    kind_of,
    narrowing_refusal,
    stand_ins,
    text_fault,
)
from fuzzytree.semantics import program_of

if TYPE_CHECKING:
    import onnx


FORMAT_VERSION = "1"
"""Of the meaning of inputs, outputs and metadata."""

Output = Literal[
    "label", "rule", "strengths", "status", "probabilities", "outputs", "activations"
]
Signature = Literal["needed", "all"]

OPSETS = range(12, 27)
"""The operator sets that can be written: in 12, ArgMax began to define ties."""

IRS = range(4, 14)
"""The file versions that can be written; constants need no input from 4 on."""

OPERATORS: Mapping[str, str] = {
    **dict.fromkeys(
        """
        Abs Add And ArgMax Cast Ceil Clip Concat ConstantOfShape CumSum Div Equal Exp
        Expand Floor Gather GatherElements Gemm Greater Less LessOrEqual Log MatMul Max
        Min Mod Mul Neg Not Or Pad Pow ReduceMax ReduceMin ReduceSum Relu Reshape Round
        Shape Sign Sin Slice Split Sqrt Sub Sum Tanh Transpose Unsqueeze Where
        """.split(),  # noqa: SIM905
        "",
    ),
    "TreeEnsemble": "ai.onnx.ml",
}
"""All operators that are written, with their domains."""

OLDEST: Mapping[str, str] = {
    "rules": "1.15.0",
    "plain tree": "1.15.0",
    "net": "1.15.0",
    "readable rules": "1.15.0",
    "system": "1.15.0",
    "tree": "1.21.0",
}
"""The oldest onnxruntime that gave equal predictions in tests, for systems predictions
within their bounds; 1.15 is the oldest there is for Python 3.11, and `TreeEnsemble`
came with 1.21."""

_NO_TREES = (
    "OpenVINO has no TreeEnsemble and computes in float32: write for it with "
    "plain=true and dtype=float32"
)
_OF_MODELS: tuple[Output, ...] = (
    *("label", "rule", "strengths", "status", "probabilities"),
)
_OF_SYSTEMS: tuple[Output, ...] = ("outputs", "status", "activations")


def write_onnx(
    model: Document,
    /,
    *,
    allow_loss: bool = False,
    dtype: Dtype = "float64",
    opset: int = 17,
    ir: int = 8,
    signature: Signature = "needed",
    columns: Sequence[str] = (),
    outputs: Sequence[Output] | None = None,
    readable: bool = False,
    plain: bool = False,
    net: bool = False,
    verify: bool = True,
) -> Written:
    """Write a tree as the graph of its path, rules and systems as that of their rules.

    The input is `inputs`, of shape (rows, columns), double (float32 for `float32`).
    The outputs, each with one entry per row: `label`, the class or "" for none;
    `rule`, the number of the winning rule or leaf from 1, or 0; `status`, a
    `fuzzytree.semantics.reference.Status`; `strengths`, of shape (rows, rules), NaN
    where a value is missing; `probabilities`, of shape (rows, classes), double, NaN
    where no rule decides, of a rule base that has them.

    Of a fuzzy system: `outputs`, of shape (rows, outputs),
    NaN without a number; `status`; `activations`, of shape (rows, rules). The same
    model and options give the same bytes.

    Args:
        model: A tree, a rule base or a fuzzy system.
        allow_loss: Whether to round what float32 cannot represent.
        dtype: The number type; `mixed` compares and divides in double and does the
            rest in float32. A tree has comparisons only: `mixed` is `float64` for it.
            A fuzzy system is always `float64`.
        opset: The version of the operators, 12 to 26.
        ir: The version of the file, 4 to 13.
        signature: `needed` for the model's inputs as columns, `all` for all columns
            of the training table, of which the others are ignored. A model that needs
            no column takes rows of any width.
        columns: The columns of the rows that the graph will get, in their order, the
            model's inputs among them; `signature` says which unless given.
        outputs: Which outputs, in this order: unless given, `label` and `rule`, of a
            system `outputs` and `status`.
        readable: Whether each operation is a node, named after what it computes, such
            as `grip_is_firm` or `rule_1_strength`, for people who look into the file.
            A fuzzy system's always is.
        plain: Whether a tree does without the operators of ai.onnx.ml, as rules and
            systems always do.
        net: Whether a tree is written as layers of a network, of `Gemm`, `Sign` and
            `Relu`, for runtimes that have little else; of at most 64 leaves.
        verify: Whether to load the file in onnxruntime and to compare its predictions.

    Returns:
        The file and what was lost.

    Raises:
        LossError: If float32 cannot represent a number of the model, unless allowed; if
            a system needs a function that onnxruntime lacks in double; if a tree is
            too large for a net; or if the installed onnxruntime does not load the file.
        DisagreementError: If the file, run in onnxruntime, gives another prediction.
        MissingExtraError: If onnx is not installed, or onnxruntime to verify with.
        ValueError: If an option is not one of those above.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> written = write_onnx(random_tree(1), outputs=("label", "status"))
        >>> written.losses
        ()
    """
    usual: Sequence[Output] = ("outputs", "status")
    if not model.outputs:
        usual = ("label", "rule")
    outputs = usual if outputs is None else outputs
    _check_options(model, dtype, opset, ir, signature, outputs)
    if net and (readable or not isinstance(model, FuzzyTree)):
        what = "`readable`" if readable else f"a model of kind {kind_of(model)!r}"
        raise ValueError(f"net: only a tree is written as a net, not {what}")
    columns = _columns(model, signature, columns)
    require("onnx", "writing onnx needs")
    if verify:
        require("onnxruntime", "verifying a written onnx file needs")
    from fuzzytree.numerics import losses

    lost = losses(model, dtype)
    if lost and not allow_loss:
        raise narrowing_refusal(model.name, f"onnx {dtype}", lost)
    proto = _model_proto(
        *(model, dtype, opset, ir, columns, outputs),
        readable=readable,
        plain=plain,
        net=net,
    )
    content: bytes = proto.SerializeToString(deterministic=True)
    if verify:
        from fuzzytree.exporters import onnx_session
        from fuzzytree.exporters.onnx_graph import NUMBERS

        onnx_session.prove(
            content,
            model,
            columns,
            outputs,
            kind=NUMBERS[dtype].axis,
            is_exact=dtype == "float64" or (dtype == "mixed" and not model.rules),
        )
    has_trees = any(entry.domain == "ai.onnx.ml" for entry in proto.opset_import)
    return Written(content, lost, (_NO_TREES,) if has_trees else ())


def _check_options(
    model: Document,
    dtype: Dtype,
    opset: int,
    ir: int,
    signature: Signature,
    outputs: Sequence[Output],
) -> None:
    is_system = bool(model.outputs)
    for name, value, choices in (
        ("dtype", dtype, ("float64",) if is_system else get_args(Dtype)),
        ("signature", signature, ("needed",) if is_system else get_args(Signature)),
    ):
        if value not in choices:
            raise ValueError(f"{name}: there is {', '.join(choices)}, not {value!r}")
    check_outputs(model, outputs, _OF_SYSTEMS if is_system else _OF_MODELS)
    check_versions(opset, ir)
    if signature == "all" and not model.columns:
        raise ValueError(
            f"{model.name!r} does not know the columns of its training table, "
            "so its signature can only be 'needed'"
        )


def check_outputs(
    model: Document, outputs: Sequence[str], known: Sequence[str]
) -> None:
    """Refuse outputs that a graph does not have, or that are named twice."""
    for name in outputs:
        if name not in known:
            raise ValueError(f"outputs: there is {', '.join(known)}, not {name!r}")
    if not outputs or len(set(outputs)) != len(outputs):
        raise ValueError(f"outputs: name each once, at least one, not {outputs!r}")
    if "strengths" in outputs and not model.rules:
        raise ValueError(
            "outputs: a tree has no strengths; write its rules to have them"
        )
    if "probabilities" in outputs:
        rated_rules(model, "outputs")


def check_versions(opset: int, ir: int) -> None:
    """Refuse versions of operators and files that no file is written for."""
    for what, known, value in (("opset", OPSETS, opset), ("ir", IRS, ir)):
        if value not in known:
            text = f"{what}: onnx files are written for {known[0]} to {known[-1]}"
            raise ValueError(f"{text}, not {value}")


def require(package: str, purpose: str) -> None:
    """Refuse to go on without a package of the extra `onnx`."""
    if importlib.util.find_spec(package) is None:
        raise MissingExtraError(f"{purpose} {install_hint('onnx')}")


def _columns(
    model: Document, signature: Signature, columns: Sequence[str]
) -> tuple[str, ...]:
    """Return the columns of the input; none if rows of any width are taken."""
    if columns:
        is_wrong = len(set(columns)) < len(columns) or any(map(text_fault, columns))
        lacking = [repr(name) for name in model.inputs if name not in columns]
        if is_wrong or lacking:
            needed = f"; the model also needs {', '.join(lacking)}" if lacking else ""
            raise ValueError(f"columns: name each once, not {tuple(columns)!r}{needed}")
        return tuple(columns)
    return model.columns if signature == "all" else model.inputs


def _model_proto(
    model: Document,
    dtype: Dtype,
    opset: int,
    ir: int,
    columns: Sequence[str],
    outputs: Sequence[Output],
    *,
    readable: bool,
    plain: bool,
    net: bool,
) -> onnx.ModelProto:
    from onnx import TensorProto

    from fuzzytree.exporters import onnx_ends
    from fuzzytree.exporters.onnx_blocks import program_graph, rows_at_once
    from fuzzytree.exporters.onnx_graph import (
        NUMBERS,
        OnnxGraph,
        model_proto,
        np_to_onnx,
    )
    from fuzzytree.exporters.onnx_net import net_graph
    from fuzzytree.exporters.onnx_rules import rules_graph
    from fuzzytree.exporters.onnx_tree import needs_plain, tree_graph

    numbers = NUMBERS[dtype]
    graph = OnnxGraph(opset, numbers)
    degree, rules = np_to_onnx(numbers.degree), len(model.rules)
    kinds: dict[Output, tuple[int, list[str | int]]] = {
        "label": (TensorProto.STRING, ["rows"]),
        "rule": (TensorProto.INT64, ["rows"]),
        "status": (TensorProto.INT64, ["rows"]),
        "strengths": (degree, ["rows", rules]),
        "activations": (degree, ["rows", rules]),
        "probabilities": (TensorProto.DOUBLE, ["rows", len(model.classes)]),
        "outputs": (degree, ["rows", len(model.outputs)]),
    }
    kind, text = _in_words(model, dtype)
    facts = _facts(model, dtype, columns, outputs, kind)
    match model:
        case FuzzyTree() if not readable:
            onnx_ends.fill_inputs(graph, model, columns)
            if net:
                facts["form"] = "net"
                frame = net_graph(graph, model, columns)
            else:
                is_plain = plain or needs_plain(model)
                frame = tree_graph(graph, model, columns, is_plain=is_plain)
            onnx_ends.add_tree_outputs(graph, model, frame, outputs)
        case RuleBase() if not readable:
            onnx_ends.fill_inputs(graph, model, columns)
            frame, strengths = rules_graph(graph, model, columns)
            onnx_ends.add_rule_outputs(graph, model, frame, strengths, outputs)
        case _:
            program = program_of(
                model,
                with_strengths="activations" in outputs,
                with_probabilities="probabilities" in outputs,
            )
            program_graph(graph, program, columns, outputs, model.classes)
            if model.outputs:
                facts["chunk"] = str(rows_at_once(model, program))
            else:
                facts["form"] = "readable"
    return model_proto(
        graph,
        facts["carrier"],
        ("inputs", np_to_onnx(numbers.axis), ["rows", len(columns) or "columns"]),
        {name: kinds[name] for name in outputs},
        ir=ir,
        text=text,
        facts=facts,
    )


def _facts(
    model: Document,
    dtype: Dtype,
    columns: Sequence[str],
    outputs: Sequence[Output],
    kind: str,
) -> dict[str, str]:
    """Return the metadata: plain words where possible, JSON for lists and records."""
    units = {one.name: one.unit for one in model.variables if one.name in columns}
    records: dict[str, object] = {
        "columns": list(columns),
        "inputs": list(model.inputs),
        "units": [units.get(name, "") for name in columns],
        "classes": list(model.classes),
        "rules": len(model.rule_labels) or len(model.rules),
        "outputs": list(outputs),
        "semantics": {} if model.outputs else msgspec.to_builtins(model.semantics),
    }
    if model.outputs:
        records["names"] = [output.name for output in model.outputs]
    if known := {v.name: v.categories for v in model.variables if v.categories}:
        records["categories"] = known
    if stand := stand_ins(model.variables):
        records["stand_ins"] = stand
    return facts_of(model, kind_of(model), records, kind=kind, dtype=dtype)


def facts_of(
    model: Document,
    holds: str,
    records: Mapping[str, object],
    /,
    **texts: str,
) -> dict[str, str]:
    """Return metadata: what every file states, other texts, and records as JSON."""
    return {
        "format": FORMAT_VERSION,
        "version": version(),
        "name": model.name,
        "carrier": holds,
        **texts,
        "fingerprint": fingerprint(model),
        **{k: json.dumps(v, ensure_ascii=False) for k, v in records.items()},
    }


def _in_words(model: Document, dtype: Dtype) -> tuple[str, str]:
    """Return the kind of a graph, and what it computes, for people."""
    answer = _answer(model.semantics.missing)
    match model:
        case FuzzySystem():
            kind, answer = "system", "NaN"
            numbers = ", ".join(repr(one.name) for one in model.outputs)
            what = (
                f"The fuzzy system {model.name!r} with {len(model.rules)} rules: it "
                f"computes {numbers}."
            )
        case FuzzyTree():
            kind = "descent"
            what = (
                f"The fuzzy decision tree {model.name!r} with {len(model.leaves)} "
                "leaves: one path is followed, a value equal to a cut goes to the left."
            )
        case RuleBase():
            kind = model.kind or "rules"
            what = (
                f"The fuzzy rule base {model.name!r} with {len(model.rules)} rules: AND"
                f" is {model.semantics.conjunction}, the first of the strongest rules "
                "decides, and where none fires the answer is "
                f"{_answer(model.semantics.uncovered)}."
            )
    what += f" Missing and infinite values give {answer}. Numbers: {dtype}."
    return kind, what


def _answer(label: str | None) -> str:
    return "no class" if label is None else repr(label)


def version() -> str:
    """Return the version of fuzzytree that is installed, or `uninstalled`."""
    try:
        return importlib.metadata.version("fuzzytree-toolkit")
    except importlib.metadata.PackageNotFoundError:
        return "uninstalled"


FORMAT = Format(
    name="onnx",
    suffixes=(".onnx",),
    write=write_onnx,
    cannot=(
        "an onnx file runs, but is not read back as a tree, rule base or system",
        "tan, asin, acos, atan, sinh, cosh, log10, log1p and the like of a system's "
        "formulas: onnxruntime has them in float32 only",
        "a tree's terms and fitted sets are left out: its path needs the cuts alone",
    ),
    extra="onnx",
    dtype="float64",
)
