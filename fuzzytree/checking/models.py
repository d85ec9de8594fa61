"""What a check compares of a tree or a rule base: classes, strengths, and proofs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, get_args

import msgspec
import numpy as np

from fuzzytree import semantics
from fuzzytree.checking.comparing import (
    OTHER_FUNCTION,
    FileAnswers,
    Finding,
    ModelRun,
    RowSet,
    compare_answers,
    compare_bits,
    compare_exact,
    compare_file,
    compare_within,
    counted,
    judged,
    native_base,
    probed,
    unequal,
)
from fuzzytree.checking.equivalence import with_points_once
from fuzzytree.errors import LossError
from fuzzytree.model import (
    TOLERANCE,
    Certified,
    Comparison,
    Conjunction,
    Dtype,
    FuzzyTree,
    Kind,
    Model,
    RuleBase,
    Run,
    Runtime,
    Use,
    kind_of,
)
from fuzzytree.numerics import (
    by_points,
    decide,
    open_paths,
    short_above,
    strength_bounds,
)
from fuzzytree.runtimes import baseline
from fuzzytree.semantics import forms, proof_faults, pruned, rules_from_tree

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray
    from fuzzytree.runtimes import OnnxModel

GRID_LIMIT = 1 << 21
"""The most points at which all cells are tried one by one; the proof needs no limit."""

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


class CheckedModel:
    """A tree or a rule base in a check, with the native answers of each of its forms.

    Bits are compared, or differences of strengths within a bound.
    """

    noun = base = "the model"
    coverage = None

    def __init__(
        self, model: Model, data: FloatArray | None, limit: int, terms: Kind
    ) -> None:
        self.model, self.tolerance = model, TOLERANCE
        self.terms: Kind = terms
        self.rows = probed(model, data, limit)
        native = baseline().load
        self.forms = {str(title): form for title, form in forms(model).items()}
        self._runs = {
            title: ModelRun(title, form, native(form)(self.rows.values))
            for title, form in self.forms.items()
        }
        self.outcomes = {title: run.outcome for title, run in self._runs.items()}
        self.cells = None
        if isinstance(model, FuzzyTree):
            self.cells = semantics.cell_count(model)
        self._bases: dict[tuple[str, str], ModelRun] = {}

    def title(self, form: str, runtime: Runtime) -> str:
        """Return what to call a form in a runtime."""
        return f"{runtime.name}: {form}"

    def load(self, form: str, runtime: Runtime) -> Run:
        """Return a form in a runtime."""
        return runtime.load(self.forms[form])

    def share(self, form: str) -> slice:
        """Return the rows that a slow runtime gets, so that it ends in seconds."""
        model = self.forms[form]
        if isinstance(model, FuzzyTree):
            cost = len(model.nodes)
        else:
            cost = sum(len(c.terms) + 1 for rule in model.rules for c in rule.when)
        cost += sum(len(variable.parts) + 1 for variable in model.variables)
        most = max(_SLOW_STEPS // max(cost, 1), 50)
        return slice(None, None, -(-len(self.rows.numbers) // most))

    def own(self) -> Iterator[Finding]:
        """Compare the forms of a tree: relative rules are the tree, raw rules near."""
        if isinstance(self.model, FuzzyTree):
            yield from _equivalence(self.model, [*self._runs.values()], self.rows)

    def compared(
        self, form: str, runtime: Runtime, run: Run, share: slice
    ) -> Iterator[Finding]:
        """Compare a form in a runtime with the native one of its number type."""
        if runtime.is_baseline and runtime.dtype == "float64":
            return
        some, native = self.rows.part(share), self._runs[form]
        title = self.title(form, runtime)
        actual = ModelRun(title, native.model, run(some.values))
        base = self._base(form, runtime).part(share)
        yield _contract(runtime, actual, base, some)

    def _base(self, form: str, runtime: Runtime) -> ModelRun:
        native, key = self._runs[form], (form, runtime.dtype)
        is_tree = isinstance(native.model, FuzzyTree)
        if runtime.bound is not None or runtime.is_baseline or is_tree:
            return native
        if runtime.dtype != "float64" and key not in self._bases:
            base = baseline(runtime.dtype)
            outcome = base.load(native.model)(self.rows.values)
            self._bases[key] = ModelRun(self.title(form, base), native.model, outcome)
        return self._bases.get(key, native)

    def faults(self, actual: Any, expected: Any, rows: RowSet) -> list[str]:
        """Return the names of rows that are answered differently."""
        return [
            rows.name(row) for row in np.flatnonzero(unequal(actual, expected)).tolist()
        ]

    def certificates(self, runtimes: Sequence[Runtime]) -> Iterator[Certified]:
        """Compare each number type that was run with exact arithmetic.

        The native runtime of a type stands for all of it: the others equal its bits.
        """
        for title, native in self._runs.items():
            kind = kind_of(native.model)
            ran = {r.dtype for r in runtimes if kind in r.runs and r.bound is None}
            truth = decide(native.model, self.rows.values, with_strengths=False)
            for dtype in get_args(Dtype):
                if dtype not in ran:
                    continue
                try:
                    run = baseline(dtype).load(native.model)
                except LossError:  # listed among what was not examined
                    continue
                outcome = run(self.rows.values)
                actual = ModelRun(f"{title} in {dtype}", native.model, outcome)
                yield compare_exact(actual, truth, self.rows, dtype=dtype)

    def shipped(self, title: str, other: Any) -> Iterator[Finding]:
        """Compare a file that is read as a model: its content, then its answers."""
        model, rows = self.model, self.rows
        if isinstance(other, FuzzyTree) and not isinstance(model, FuzzyTree):
            other = _as_rules(other, model) or other
        is_tree = isinstance(other, FuzzyTree)
        kind: Kind | None = None if is_tree else other.kind or "relative"
        expected = self._counterpart(other.semantics.conjunction, kind)
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
        actual = ModelRun(title, other, baseline().load(other)(rows.values))
        base = native_base(expected or model, "float64", rows)
        near = [*self._near(title, actual, base)]
        if near:
            yield from near
            return
        is_like = expected is not None and other.classes == model.classes
        answers = (compare_bits if is_like else compare_answers)(actual, base, rows)
        if expected is None:
            yield judged(title, "the model", (self._no_counterpart(),), [answers])
        else:
            yield _content(title, other, expected, [answers])
        yield answers

    def _near(
        self, title: str, actual: ModelRun, base: ModelRun
    ) -> Iterator[Comparison]:
        """Compare rules that have points for curves of others, within their bound."""
        model, other, values = base.model, actual.model, self.rows.values
        if not (isinstance(model, RuleBase) and isinstance(other, RuleBase)):
            return
        try:
            near = by_points(model, self.tolerance)
        except LossError:
            return
        if near.terms and near.model == other:
            bound = short_above(near.bound)
            against = f"the model within {bound}: curves became points"
            yield counted("file", title, against, 1, ())
            allowed = near.bound + strength_bounds(model, "float64", values)[0]
            allowed += strength_bounds(other, "float64", values)[0]
            yield compare_within(
                actual, base, self.rows, allowed=allowed, origin=near.origin
            )

    def _counterpart(self, conjunction: Conjunction, kind: Kind | None) -> Model | None:
        """Return the tree (kind None) or the rules that a file should hold.

        None if they cannot be made from the model, or are raw where they should not be.
        """
        model = self.model
        if not isinstance(model, FuzzyTree):
            return model if kind else None
        if kind == "raw" and not (model.sets and self.terms == "raw"):
            return None
        return rules_from_tree(model, kind, conjunction=conjunction) if kind else model

    def _no_counterpart(self) -> str:
        if not isinstance(self.model, FuzzyTree):
            return "it is a tree, and no tree can be made of rules"
        if self.terms != "raw":
            return OTHER_FUNCTION
        return "raw rules cannot be made of a tree without fitted sets"

    def foreign(self, file: OnnxModel) -> str | None:
        """Return why an ONNX file cannot be one of this model; None if it can be."""
        if file.representation == "system":
            return "it answers the numbers of a fuzzy system, and the model a class"
        if file.inputs != self.model.inputs or file.classes != self.model.classes:
            return (
                f"it decides for {', '.join(file.classes)} "
                f"from {', '.join(file.inputs)}, which are not the model's"
            )
        return None

    def counterpart(self, file: OnnxModel) -> Model | str:
        """Return the form that an ONNX file should hold, or why there is none."""
        kind: Kind | None = "raw" if file.kind == "raw" else "relative"
        kind = None if file.representation == "tree" else kind
        form = self._counterpart(file.semantics.conjunction, kind)
        return form or self._no_counterpart()

    def file_rows(self, title: str, file: OnnxModel) -> Iterator[Finding]:
        """Compare the answers of an ONNX file with the native ones.

        Raises:
            LossError: If onnxruntime cannot run it.
        """
        form = self.counterpart(file)
        model = self.model if isinstance(form, str) else form
        values = self.rows.values
        base = native_base(model, file.dtype, self.rows)
        run = file.run_labelled
        outcome, labels = (file.run(values), None) if run is None else run(values)
        answers = FileAnswers(
            None if isinstance(form, str) else outcome,
            labels,
            "status" in file.outputs,
        )
        is_float32 = file.dtype == "float32"
        yield from compare_file(title, answers, base, self.rows, is_float32=is_float32)


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
        actual, expected = other.part(own), path.part(own)
        yield compare_answers(actual, expected, rows.part(own), by_design=True)


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


def _contract(
    runtime: Runtime, actual: ModelRun, base: ModelRun, rows: RowSet
) -> Comparison:
    """Compare a runtime with its base by the contract that fits."""
    model = actual.model
    if runtime.bound is not None:
        bound, origin = runtime.bound(model)
        allowed = np.full(rows.numbers.shape, bound)
        return compare_within(actual, base, rows, allowed=allowed, origin=origin)
    if isinstance(model, FuzzyTree):
        if runtime.dtype == "float32":
            excused = open_paths(model, runtime.dtype, rows.values)
            return compare_bits(actual, base, rows, excused=excused)
    elif runtime.is_baseline:
        allowed, origin = strength_bounds(model, runtime.dtype, rows.values)
        allowed += strength_bounds(model, "float64", rows.values)[0]  # of the base
        return compare_within(actual, base, rows, allowed=allowed, origin=origin)
    return compare_bits(actual, base, rows)


def _as_rules(tree: FuzzyTree, model: RuleBase) -> RuleBase | None:
    """Return the rules of a tree that a model made from it should equal."""
    if model.kind is None or (model.kind == "raw" and not tree.sets):
        return None
    return rules_from_tree(tree, model.kind, conjunction=model.semantics.conjunction)


def _content(
    title: str, other: Model, expected: Model, rows: Sequence[Comparison]
) -> Comparison:
    """Compare the content of a file with what it should be: whole, or pruned.

    What `fuzzytree needs` writes is made once more, then compared with the model by
    proof; what is left of a tree need not serve all that the tree does.
    """
    fault = first_difference(with_points_once(expected), with_points_once(other))
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


def first_difference(expected: msgspec.Struct, actual: msgspec.Struct) -> str | None:
    """Return where two models differ first, and how; None if they are equal.

    Example:
        >>> from fuzzytree.model.rulebase import Band
        >>> first_difference(Band(1.0, 2.0), Band(1.0, 3.0))
        'high: 3.0 where 2.0 is right'
    """
    if expected == actual:
        return None
    return _differ((), msgspec.to_builtins(expected), msgspec.to_builtins(actual))


def _differ(path: tuple[str, ...], expected: object, actual: object) -> str | None:
    if isinstance(expected, dict) and isinstance(actual, dict):
        for key in dict.fromkeys([*expected, *actual]):
            text = _differ((*path, str(key)), expected.get(key), actual.get(key))
            if text:
                return text
        return None
    where = ", ".join(path)
    if isinstance(expected, list | tuple) and isinstance(actual, list | tuple):
        for number, (one, two) in enumerate(zip(expected, actual, strict=False), 1):
            text = _differ((*path[:-1], f"{path[-1]} {number}"), one, two)
            if text:
                return text
        if len(expected) != len(actual):
            return f"{where}: {len(actual)} where {len(expected)} are right"
        return None
    if expected == actual:
        return None
    return f"{where}: {actual!r} where {expected!r} is right"
