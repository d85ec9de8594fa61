"""Do all representations of a model give its answers?

No representation is trusted: each is loaded and run. Kinds of evidence are kept
apart: *file* (two contents are equal), *proof* and *all cells* (statements about every
input), *rows* (probes aimed at every clause, and the user's data: a sample, however
well aimed) and *calls* (ways of calling that break programs).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, get_args

import msgspec
import numpy as np

from fuzzytree import semantics
from fuzzytree.checking.comparing import (
    BoolArray,
    ModelRun,
    RowSet,
    compare_answers,
    compare_bits,
    compare_exact,
    compare_excused,
    compare_labels,
    compare_within,
    counted,
    judged,
    probed,
    same_bits,
    without_status,
)
from fuzzytree.checking.programs import ProgramFile, check_program
from fuzzytree.errors import FuzzyTreeError, LossError
from fuzzytree.model import (
    Agreement,
    Certified,
    Comparison,
    Count,
    Dtype,
    FuzzyTree,
    Kind,
    Model,
    Outcome,
    Progress,
    RuleBase,
    Run,
    Runtime,
    Use,
    checkpoint,
    fingerprint,
)
from fuzzytree.numerics import decide, open_paths, strength_bounds
from fuzzytree.runtimes import baseline, chosen_runtimes, is_installed, needed_by
from fuzzytree.semantics import Status, forms, proof_faults, pruned, rules_from_tree

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray
    from fuzzytree.runtimes import OnnxModel

GRID_LIMIT = 1 << 21
"""The most points at which all cells are tried one by one; the proof needs no limit."""

_FLOAT32_TREE = "equal answers but within float32 rounding of a cut"
_SLOW_STEPS = 3_000_000  # degrees that a slow runtime computes in one comparison
_SERVICES: Mapping[Use, str] = {
    "tree": "path",
    "relative": "relative rules",
    "raw": "raw rules",
}
_SERVED: tuple[tuple[Use, ...], ...] = (
    ("tree", "relative", "raw"),
    ("tree", "relative"),
    ("tree", "raw"),
    ("tree",),
)
"""What a pruned tree may serve, the most first."""

Finding = Comparison | str
"""A comparison, or a sentence about what was skipped."""


def check(
    model: Model,
    *others: Model | OnnxModel | ProgramFile,
    data: FloatArray | None = None,
    names: Sequence[str] = (),
    runtimes: Sequence[str] | None = None,
    limit: int = 20_000,
    rows_only: bool = False,
    progress: Progress | None = None,
) -> Agreement:
    """Compare every representation of a model with the model itself.

    Args:
        model: A tree or a rule base.
        others: Files that were made of it: trees, rule bases, opened ONNX files
            (`fuzzytree.runtimes.onnxruntime.open_onnx`), programs.
        data: Rows of one's own, shape (inputs, rows), in the order of `model.inputs`.
        names: What to call each of the others; `file 1`, `file 2` unless given.
        runtimes: The names of the runtimes to run; all that are installed if None.
        limit: The most probes.
        rows_only: Whether files whose rows agree are accepted with other content.
        progress: Called with what is compared next and the share that is done.

    Returns:
        What was compared, on what, and with which result.

    Raises:
        ValueError: If `data` is not of shape (inputs, rows), or a runtime is unknown.
    """
    rows = probed(model, data, limit)
    chosen = chosen_runtimes(runtimes)
    representations = _representations(model, rows)
    findings: list[Finding] = []
    if isinstance(model, FuzzyTree):
        findings += _equivalence(model, representations, rows)
    certificates: list[Certified] = []
    parts = len(representations) + len(others)
    for number, representation in enumerate(representations):
        if progress:
            progress(f"comparing {representation.title}", number / parts)
        findings += _runtimes(representation, chosen, rows)
        certificates += _certificates(representation, chosen, rows)
    for number, other in enumerate(others):
        title = names[number] if number < len(names) else f"file {number + 1}"
        if progress:
            progress(f"comparing {title}", (len(representations) + number) / parts)
        findings += _shipped(title, other, model, rows)
    return Agreement(
        model.name,
        fingerprint(model),
        tuple(f for f in findings if isinstance(f, Comparison)),
        tuple(map(_count, representations)),
        tuple(dict.fromkeys(f for f in findings if isinstance(f, str))),
        semantics.cell_count(model) if isinstance(model, FuzzyTree) else None,
        rows.probes,
        tuple(certificates),
        rows_only,
    )


def _native(title: str, model: Model, rows: RowSet) -> ModelRun:
    return ModelRun(title, model, baseline().load(model)(rows.values))


def _representations(model: Model, rows: RowSet) -> tuple[ModelRun, ...]:
    """Return what can be made of a model, each with the native runtime's answers."""
    return tuple(_native(title, form, rows) for title, form in forms(model).items())


def _equivalence(
    tree: FuzzyTree, representations: Sequence[ModelRun], rows: RowSet
) -> Iterator[Finding]:
    """Show that the relative rules are the tree, and how far the raw rules are not."""
    path, relative, *raw = representations
    faults = tuple(semantics.node_faults(tree))
    points = sum(map(len, map(semantics.node_points, tree.nodes)))
    yield counted("proof", relative.title, path.title, points, faults)
    size = semantics.grid_size(tree)
    if size <= GRID_LIMIT:
        yield _all_cells(tree, relative.title, path.title, size)
    else:
        yield f"all cells one by one ({size:.3g} points): the proof covers them"
    yield compare_bits(relative, path, rows)
    # Probes lie where the two part; how often they do so in use, only data shows.
    own = slice(rows.probes if len(rows.numbers) > rows.probes else 0, None)
    for other in raw:
        found, expected = other.part(own), path.part(own)
        yield compare_answers(found, expected, rows.part(own), by_design=True)


def _all_cells(
    tree: FuzzyTree, representation: str, against: str, size: int
) -> Comparison:
    free = semantics.free_axes(tree)
    native = baseline()
    descend, fire = native.load(free), native.load(rules_from_tree(free))
    faults: list[str] = []
    for points in semantics.grid(tree):
        path, fired = descend(points), fire(points)
        for row in np.flatnonzero(path.rule != fired.rule).tolist():
            values = zip(free.inputs, points[:, row].tolist(), strict=True)
            where = ", ".join(f"{name} {value!r}" for name, value in values)
            faults.append(f"{where}: leaf {path.rule[row]}, rule {fired.rule[row]}")
    return counted("all cells", representation, against, size, tuple(faults))


def _runtimes(
    representation: ModelRun, runtimes: Sequence[Runtime], rows: RowSet
) -> Iterator[Finding]:
    """Run one representation in every runtime that can, against the native one."""
    kind = "rules" if isinstance(representation.model, RuleBase) else "tree"
    bases: dict[Dtype, ModelRun] = {"float64": representation}
    for runtime in runtimes:
        if kind not in runtime.runs:
            continue
        title = f"{runtime.name}: {representation.title}"
        if not is_installed(runtime):
            yield f"{runtime.name} is not installed ({needed_by(runtime)})"
            continue
        checkpoint()
        try:
            run = runtime.load(representation.model)
        except LossError as error:
            yield f"{title}: {error}"
            continue
        step = _stride(representation.model, rows) if runtime.is_slow else 1
        share = slice(None, None, step)
        some = rows.part(share)
        checkpoint()
        found = ModelRun(title, representation.model, run(some.values))
        checkpoint()
        if not (runtime.is_baseline and runtime.dtype == "float64"):
            base = _base(runtime, representation, bases, rows)
            yield _contract(runtime, found, base.part(share), some)
        yield _calls(title, run, some)


def _certificates(
    representation: ModelRun, runtimes: Sequence[Runtime], rows: RowSet
) -> Iterator[Certified]:
    """Compare each number type that was run with exact arithmetic.

    The native runtime of a type stands for all of it, for the others equal its bits.
    """
    kind = "rules" if isinstance(representation.model, RuleBase) else "tree"
    ran = {r.dtype for r in runtimes if kind in r.runs and r.bound is None}
    truth = decide(representation.model, rows.values, with_strengths=False)
    for dtype in get_args(Dtype):
        if dtype not in ran:
            continue
        try:
            run = baseline(dtype).load(representation.model)
        except LossError:  # listed among what was not examined
            continue
        title = f"{representation.title} in {dtype}"
        found = ModelRun(title, representation.model, run(rows.values))
        yield compare_exact(found, truth, rows, dtype=dtype)


def _base(
    runtime: Runtime,
    representation: ModelRun,
    bases: dict[Dtype, ModelRun],
    rows: RowSet,
) -> ModelRun:
    """Return what a runtime is compared with: the native one of its number type."""
    is_rules = isinstance(representation.model, RuleBase)
    if runtime.bound is not None or runtime.is_baseline or not is_rules:
        return representation
    if runtime.dtype not in bases:
        base = baseline(runtime.dtype)
        run = base.load(representation.model)
        title = f"{base.name}: {representation.title}"
        bases[runtime.dtype] = ModelRun(title, representation.model, run(rows.values))
    return bases[runtime.dtype]


def _contract(
    runtime: Runtime, found: ModelRun, base: ModelRun, rows: RowSet
) -> Comparison:
    """Compare a runtime with its base by the contract that fits."""
    model = found.model
    if runtime.bound is not None:
        bound, origin = runtime.bound(model)
        allowed = np.full(rows.numbers.shape, bound)
        return compare_within(found, base, rows, allowed=allowed, origin=origin)
    if isinstance(model, FuzzyTree):
        if runtime.dtype == "float32":
            excused = open_paths(model, runtime.dtype, rows.values)
            return compare_excused(
                found, base, rows, excused=excused, origin=_FLOAT32_TREE
            )
    elif runtime.is_baseline:
        allowed, origin = strength_bounds(model, runtime.dtype, rows.values)
        allowed += strength_bounds(model, "float64", rows.values)[0]  # of the base
        return compare_within(found, base, rows, allowed=allowed, origin=origin)
    return compare_bits(found, base, rows)


def _stride(model: Model, rows: RowSet) -> int:
    """Return which n-th rows a slow runtime gets, so that it ends in seconds."""
    if isinstance(model, RuleBase):
        cost = sum(len(c.terms) + 1 for rule in model.rules for c in rule.when)
    else:
        cost = len(model.nodes)
    cost += sum(len(variable.parts) + 1 for variable in model.variables)
    return -(-len(rows.numbers) // max(_SLOW_STEPS // cost, 50))


def _calls(title: str, run: Run, rows: RowSet) -> Comparison:
    """Call a runtime in the ways that break: no row, one, other order, wrong width."""
    width, total = rows.values.shape
    sample = np.ascontiguousarray(rows.values[:, :: max(total // 24, 1)])
    whole = run(sample)
    faults = [
        f"a row answered alone differs from the same row in a batch, {rows.name(row)}"
        for row in range(sample.shape[1])
        if not _is_same(run(sample[:, row : row + 1]), whole, row)
    ]
    if not np.array_equal(run(np.asfortranarray(sample)).rule, whole.rule):
        faults.append("another memory order changes the answers")
    empty = run(np.empty((width, 0)))
    if empty.rule.shape != (0,) or empty.status.shape != (0,):
        faults.append("no rows do not give empty answers")
    if not _refuses(run, np.zeros((width + 1, 3))):
        faults.append(f"{width + 1} inputs are accepted where {width} are right")
    return counted("calls", title, "itself", sample.shape[1] + 3, tuple(faults))


def _refuses(run: Run, values: FloatArray) -> bool:
    try:
        run(values)
    except (ValueError, FuzzyTreeError):
        return True
    return False


def _is_same(one: Outcome, whole: Outcome, row: int) -> bool:
    if one.rule[0] != whole.rule[row] or one.status[0] != whole.status[row]:
        return False
    if one.strengths is None or whole.strengths is None:
        return one.strengths is whole.strengths
    return bool(same_bits(one.strengths[:, 0], whole.strengths[:, row]).all())


def _shipped(
    title: str, other: Model | OnnxModel | ProgramFile, model: Model, rows: RowSet
) -> Iterator[Finding]:
    """Compare a file that was shipped beside a model: its content, then its answers."""
    if isinstance(other, ProgramFile):
        yield from check_program(title, other, model, rows)
    elif isinstance(other, FuzzyTree | RuleBase):
        yield from _shipped_model(title, other, model, rows)
    else:
        yield from _shipped_onnx(title, other, model, rows)


def _shipped_model(
    title: str, other: Model, model: Model, rows: RowSet
) -> Iterator[Finding]:
    if isinstance(other, FuzzyTree) and isinstance(model, RuleBase):
        other = _as_rules(other, model) or other
    expected = _counterpart(other, model)
    for what, one, two in (
        ("inputs", other.inputs, model.inputs),
        ("classes", sorted(other.classes), sorted(model.classes)),
    ):
        if one != two:
            if expected is not None:
                yield _content(title, other, expected, [])
            fault = f"its {what} are {', '.join(one)}"
            yield counted("file", title, f"the model's {what}", 1, (fault,))
            return
    found = _native(title, other, rows)
    if expected is None:
        answers = compare_answers(found, _native("the model", model, rows), rows)
        yield judged(title, "the model", (_no_counterpart(other, model),), [answers])
        yield answers
        return
    base = _native("the model", expected, rows)
    is_like = other.classes == model.classes
    answers = (compare_bits if is_like else compare_answers)(found, base, rows)
    yield _content(title, other, expected, [answers])
    yield answers


def _as_rules(tree: FuzzyTree, model: RuleBase) -> RuleBase | None:
    """Return the rules of a tree that a model made from it should equal."""
    if model.kind is None or (model.kind == "raw" and not tree.sets):
        return None
    return rules_from_tree(tree, model.kind, conjunction=model.semantics.conjunction)


def _no_counterpart(other: Model | OnnxModel, model: Model) -> str:
    if isinstance(model, FuzzyTree):
        return "raw rules cannot be made of a tree without fitted sets"
    return "it is a tree, and no tree can be made of rules"


def _content(
    title: str, other: Model, expected: Model, rows: Sequence[Comparison]
) -> Comparison:
    """Compare the content of a file with what it should be: whole, or pruned.

    What `fuzzytree needs` writes is made once more, then compared with the model by
    proof; what is left of a tree need not serve all that the tree does.
    """
    fault = first_difference(expected, other)
    for uses in _SERVED if fault else ():
        if "raw" in uses and not (isinstance(expected, FuzzyTree) and expected.sets):
            continue
        if pruned(expected, uses=uses).model == other:
            faults = tuple(proof_faults(expected, other, uses=uses))
            served = "rules"
            if isinstance(expected, FuzzyTree):
                served = " and ".join(_SERVICES[use] for use in uses)
            return counted("proof", title, f"the model's {served}", 1, faults)
    return judged(title, "the model", (fault,) if fault else (), rows)


def _shipped_onnx(
    title: str, other: OnnxModel, model: Model, rows: RowSet
) -> Iterator[Finding]:
    """Compare an ONNX file: what it says of itself, its graph, and its answers."""
    if other.run_system is not None:
        fault = "it answers the numbers of a fuzzy system, and the model a class"
        yield counted("file", title, "the model's facts", 1, (fault,))
        return
    if other.inputs != model.inputs or other.classes != model.classes:
        fault = (
            f"it decides for {', '.join(other.classes)} "
            f"from {', '.join(other.inputs)}, which are not the model's"
        )
        yield counted("file", title, "the model's facts", 1, (fault,))
        return
    from fuzzytree.exporters import Differences, differences

    expected = _onnx_counterpart(other, model)
    if expected is None:
        apart = Differences((_no_counterpart(other, model),), ())
    else:
        apart = differences(other.content, expected)
        yield counted("file", title, "the model's metadata", 1, apart.metadata)
    try:
        found = [*_onnx_rows(title, other, expected, model, rows)]
    except LossError as error:  # the file loads, but onnxruntime cannot run it
        faults = (str(error),)
        found = [counted("rows", title, "the model", len(rows.numbers), faults)]
    yield judged(title, "a freshly written graph", apart.graph, found)
    yield from found


def _onnx_counterpart(other: OnnxModel, model: Model) -> Model | None:
    if other.representation == "tree":
        return model if isinstance(model, FuzzyTree) else None
    if isinstance(model, RuleBase):
        return model
    kind: Kind = "raw" if other.kind == "raw" and model.sets else "relative"
    return rules_from_tree(model, kind, conjunction=other.semantics.conjunction)


def _onnx_rows(
    title: str,
    other: OnnxModel,
    expected: Model | None,
    model: Model,
    rows: RowSet,
) -> Iterator[Comparison]:
    """Compare a file's answers with the native ones, then its labels."""
    compared = expected or model
    is_rules = isinstance(compared, RuleBase)
    native = baseline(other.dtype if is_rules else "float64")
    base = ModelRun("the model", compared, native.load(compared)(rows.values))
    excused: BoolArray = np.full(rows.numbers.shape, fill_value=False)
    is_rounded = isinstance(compared, FuzzyTree) and other.dtype == "float32"
    if isinstance(compared, FuzzyTree) and is_rounded:
        excused = open_paths(compared, "float32", rows.values)
    if expected is not None:
        found, right = ModelRun(title, compared, other.run(rows.values)), base
        if "status" not in other.outputs:
            found, right = without_status(found), without_status(base)
        yield (
            compare_excused(found, right, rows, excused=excused, origin=_FLOAT32_TREE)
            if is_rounded
            else compare_bits(found, right, rows)
        )
    if other.labels is not None:
        texts = other.labels(rows.values)
        yield compare_labels(title, texts, base, rows, excused)


def _counterpart(other: Model, model: Model) -> Model | None:
    """Return what a shipped file should hold, made from the model; None if unknown."""
    if isinstance(other, FuzzyTree):
        return model if isinstance(model, FuzzyTree) else None
    if isinstance(model, RuleBase):
        return model
    kind = other.kind or "relative"
    if kind == "raw" and not model.sets:
        return None
    return rules_from_tree(model, kind, conjunction=other.semantics.conjunction)


def first_difference(expected: msgspec.Struct, found: msgspec.Struct) -> str | None:
    """Return where two models differ first, and how; None if they are equal.

    Example:
        >>> from fuzzytree.model.rulebase import Flank
        >>> first_difference(Flank(1.0, 2.0), Flank(1.0, 3.0))
        'end: 3.0 where 2.0 is right'
    """
    if expected == found:
        return None
    return _differ((), msgspec.to_builtins(expected), msgspec.to_builtins(found))


def _differ(path: tuple[str, ...], expected: object, found: object) -> str | None:
    if isinstance(expected, dict) and isinstance(found, dict):
        for key in dict.fromkeys([*expected, *found]):
            text = _differ((*path, str(key)), expected.get(key), found.get(key))
            if text:
                return text
        return None
    where = ", ".join(path)
    if isinstance(expected, list | tuple) and isinstance(found, list | tuple):
        for number, (one, two) in enumerate(zip(expected, found, strict=False), 1):
            text = _differ((*path[:-1], f"{path[-1]} {number}"), one, two)
            if text:
                return text
        if len(expected) != len(found):
            return f"{where}: {len(found)} where {len(expected)} are right"
        return None
    if expected == found:
        return None
    return f"{where}: {found!r} where {expected!r} is right"


def _count(representation: ModelRun) -> Count:
    status = representation.outcome.status
    return Count(
        representation.title,
        int(status.size),
        *(
            int((status == kind).sum())
            for kind in (Status.TIE, Status.UNCOVERED, Status.MISSING)
        ),
    )
