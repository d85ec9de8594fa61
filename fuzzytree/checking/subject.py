"""A model in a check: its forms, its rows, and what each representation may differ by.

The native runtime stands for each form of the model. Other runtimes and files compute
its results with its bits, but for the last ones of functions of libraries
(`fuzzytree.semantics.programs.bounds`); the native runtimes of other number types may
differ by what rounding can change, and a runtime with a bound of its own by that.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from typing import cast, get_args

import numpy as np

from fuzzytree import semantics
from fuzzytree.checking.certificates import compare_exact
from fuzzytree.checking.comparing import (
    Allow,
    Finding,
    ModelRun,
    RowSet,
    by_libraries,
    compare,
    counted,
    equal_bits,
    excused,
    row_set,
    within,
)
from fuzzytree.errors import LossError
from fuzzytree.exporters import FixedSteps
from fuzzytree.model import (
    MOST_PROBES,
    MOST_SYSTEM_PROBES,
    BoolArray,
    Certified,
    Comparison,
    Coverage,
    Document,
    Dtype,
    FloatArray,
    FuzzySystem,
    FuzzyTree,
    Kind,
    Model,
    RuleBase,
    Run,
    Runtime,
    kind_of,
)
from fuzzytree.numerics import decide, open_paths, strength_bounds
from fuzzytree.runtimes import baseline, definition, run_system
from fuzzytree.semantics import (
    Aim,
    Program,
    Status,
    float32_rounding,
    forms,
    probe_values,
    program_of,
    range_rows,
    row_values,
    rules_from_tree,
    spreads,
)

GRID_LIMIT = 1 << 21
"""The most points at which all cells are tried one by one; the proof needs no limit."""

_DEGREES_AND_SHARES = 400_000_000  # in all probes of rules that have probabilities
_SLOW_STEPS = 8_000_000  # of a program, by a slow runtime
_SINGLE_EDGE = 1e-3  # share of the largest number; a wider bound says little
_FEW = 200  # probes of a coverage alone
_AT_ONCE = 256  # rules that probes are aimed at, before it is seen which others fire
_DRAWN = 1_000  # rows drawn from the ranges


class Subject:
    """A model in a check, with the native results of each of its forms.

    Attributes:
        model: The model.
        terms: Whether raw rules of a tree may stand in a file.
        tolerance: The largest error of a degree where a file has points for a curve.
        noun: What to call the model.
        base: What to call its native results beside those of files.
        forms: What can be made of it, by title.
        runs: Their native results.
        rows: The rows.
        tree: The model, if it is a tree.
        cells: How many cells a tree has.
        coverage: Which rules of a system fire in them.
    """

    def __init__(
        self,
        model: Document,
        data: FloatArray | None,
        limit: int | None,
        *,
        terms: Kind,
        tolerance: float,
    ) -> None:
        self.model, self.terms, self.tolerance = model, terms, tolerance
        self.tree: FuzzyTree | None = None
        self.cells: int | None = None
        self.coverage: Coverage | None = None
        self.noun = self.base = "the model"
        self.forms: dict[str, Document] = dict(forms(model).items())
        if model.outputs:
            self.noun, self.base = "the system", baseline().name
            system = cast("FuzzySystem", model)
            probes, self.coverage = _aimed_probes(system, limit or MOST_SYSTEM_PROBES)
        else:
            if not model.rules:
                self.tree = cast("FuzzyTree", model)
                self.cells = semantics.cell_count(self.tree)
            probes = probe_values(model, limit or _most_probes(model))
        self.rows = row_set(model.inputs, probes, data)
        self.runs = {
            title: self.native(form, title=self.title(title))
            for title, form in self.forms.items()
        }
        self._programs: list[tuple[Document, Program]] = []
        self._bases: dict[str, ModelRun] = {}

    def title(self, form: str, runtime: Runtime | None = None) -> str:
        """Return what to call a form, in a runtime; of a system, the runtime alone."""
        if self.model.outputs:
            return (runtime or baseline()).name
        return form if runtime is None else f"{runtime.name}: {form}"

    def native(
        self,
        form: Document,
        dtype: Dtype = "float64",
        *,
        title: str | None = None,
        rows: RowSet | None = None,
    ) -> ModelRun:
        """Return the native results of a form in a number type, for all rows or some.

        Raises:
            LossError: If the type cannot hold it.
        """
        run = baseline(dtype).load(form)
        values = (self.rows if rows is None else rows).values
        return ModelRun(title or self.base, form, run(values))

    def program(self, form: Document) -> Program:
        """Return the program of a form, which is made once."""
        for model, program in self._programs:
            if model is form:
                return program
        self._programs.append((form, program_of(form)))
        return self._programs[-1][1]

    def exactly(self, form: Document) -> Allow:
        """Allow what functions of libraries may differ by, and nothing else."""
        return by_libraries(lambda: self.program(form))

    def share(self, form: str) -> RowSet:
        """Return the rows that a slow runtime gets, so that it ends in seconds."""
        return self.rows.share(
            max(_SLOW_STEPS // self.program(self.forms[form]).size, 50)
        )

    def own(self) -> Iterator[Finding]:
        """Compare the forms: a system with its definition, a tree with its rules."""
        if self.model.outputs:
            some, native = self.share("system"), self.runs["system"]
            right = definition().load(self.model)(some.values)
            inference = ModelRun("the inference", self.model, right)
            actual = native.part(some.numbers)
            yield compare(actual, inference, some, self.exactly(self.model))
        if self.tree is not None:
            yield from _equivalence(self.tree, [*self.runs.values()], self.rows)

    def compared(
        self, form: str, runtime: Runtime, run: Run, rows: RowSet
    ) -> Iterator[Finding]:
        """Compare a form in a runtime with the native one of its number type."""
        is_base = runtime.is_baseline and runtime.dtype == "float64"
        if is_base or (self.model.outputs and runtime.is_definition):
            return
        model, base = self.forms[form], self.runs[form]
        actual = ModelRun(self.title(form, runtime), model, run(rows.values))
        allow = self.exactly(model)
        if runtime.bound is not None:
            allow = _constant(*runtime.bound(cast("Model", model)))
        elif runtime.is_baseline:
            allow = rounding(model, runtime.dtype)
        elif runtime.dtype != "float64":
            key = self.title(form, baseline(runtime.dtype))
            if key not in self._bases:
                self._bases[key] = self.native(model, runtime.dtype, title=key)
            base = self._bases[key]
        yield compare(actual, base.part(rows.numbers), rows, allow)

    def certificates(self, runtimes: Sequence[Runtime]) -> Iterator[Certified]:
        """Compare each number type that was run with exact arithmetic, for classes.

        The native runtime of a type stands for all of it: the others equal its bits.
        Of a system nothing is certain for all inputs.
        """
        if self.model.outputs:
            return
        ran = [one for one in runtimes if one.bound is None]
        for title, form in self.forms.items():
            kind = kind_of(form)
            truth = decide(cast("Model", form), self.rows.values, with_strengths=False)
            for dtype in get_args(Dtype):
                if all(one.dtype != dtype or kind not in one.runs for one in ran):
                    continue
                try:
                    actual = self.native(form, dtype, title=f"{title} in {dtype}")
                except LossError:  # listed among what was not examined
                    continue
                yield compare_exact(actual, truth, self.rows, dtype=dtype)


def _most_probes(model: Document) -> int:
    """Return how many probes a model gets: fewer of very many rules and classes."""
    if model.outputs or not model.rules:
        return MOST_PROBES
    rules = cast("RuleBase", model).rules
    numbers = sum(len(rule.when) + len(rule.probabilities or ()) for rule in rules)
    return min(MOST_PROBES, max(1, _DEGREES_AND_SHARES // max(1, numbers)))


def single_bounds(program: Program, values: FloatArray) -> FloatArray:
    """Return how far float32 can be from double, of shape (results, rows).

    The `values` are of float32; a row with one that is not finite allows nothing.
    """
    every = spreads(program, values, values, float32_rounding(program))
    count = values.shape[1]
    ends = [np.broadcast_to(every[r.step].error * 1.0, count) for r in program.results]
    return np.where(np.isfinite(values).all(axis=0), np.array(ends), 0.0)


def _constant(bound: float, origin: str) -> Allow:
    """Allow the same difference of strengths in every row."""

    def bounds(values: FloatArray) -> tuple[FloatArray, str]:
        return np.full(values.shape[1], bound), origin

    return within(bounds)


def rounding(model: Document, dtype: Dtype) -> Allow:
    """Allow what a number type can change, against double."""
    if model.outputs:
        return by_libraries(
            lambda: program_of(model),
            single_bounds,
            "each step is rounded to float32",
            edge=_SINGLE_EDGE,
        )
    rules = cast("RuleBase", model)
    if not model.rules:
        if dtype != "float32":
            return equal_bits  # a path has comparisons alone
        near = functools.partial(open_paths, cast("FuzzyTree", model), dtype)
        return excused(near, "equal answers but within float32 rounding of a cut")

    def bounds(values: FloatArray) -> tuple[FloatArray, str]:
        amounts, origin = strength_bounds(rules, dtype, values)
        return amounts + strength_bounds(rules, "float64", values)[0], origin

    return within(bounds)


def fixed_errors(fixed: FixedSteps) -> Allow:
    """Allow the worst errors that a file in fixed point states of each result."""

    def bounds(program: Program, values: FloatArray) -> FloatArray:
        return np.tile(fixed.worst.errors.reshape(-1, 1), values.shape[1])

    cause = "the worst error of its whole numbers, for inputs in their ranges"
    return by_libraries(lambda: fixed.program, bounds, cause, edge=math.inf)


# --- trees


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
    yield compare(relative, path, rows)
    # Probes lie where the two part; how often they do so in use, only data shows.
    own = slice(rows.probes if len(rows.numbers) > rows.probes else 0, None)
    for other in raw:
        actual, expected = other.part(own), path.part(own)
        yield compare(
            actual, expected, rows.part(own), kinds=("class",), by_design=True
        )


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


# --- coverage of systems


def coverage_of(system: FuzzySystem) -> Coverage:
    """Return which rules of a system fire in probes, and how much is uncovered.

    Example:
        >>> from fuzzytree.semantics.samples import all_samples
        >>> coverage_of(all_samples()["Mamdani, singletons"]).unfired
        ()
    """
    return _aimed_probes(system, _FEW)[1]


def _aimed_probes(system: FuzzySystem, limit: int) -> tuple[FloatArray, Coverage]:
    """Return probes, with more of them aimed at the rules that do not fire in these."""
    run = run_system(system)
    tables = [probe_values(system, limit)]
    fired = np.asarray(_fired(run, tables[0]).any(axis=1))
    aim = Aim(system)
    missed = np.flatnonzero(~fired).tolist()
    for start in range(0, len(missed), _AT_ONCE):
        numbers = [one for one in missed[start : start + _AT_ONCE] if not fired[one]]
        if not numbers:
            continue
        table = row_values(system, [aim.row(system.rules[one]) for one in numbers])
        fires = _fired(run, table)
        tables.append(table[:, fires[~fired].any(axis=0)])
        fired |= fires.any(axis=1)
    drawn = run(row_values(system, range_rows(system, _DRAWN)))
    coverage = Coverage(
        len(system.rules),
        tuple(one + 1 for one in np.flatnonzero(~fired).tolist()),
        _DRAWN,
        int((drawn.status == Status.UNCOVERED).sum()),
    )
    return np.concatenate(tables, axis=1), coverage


def _fired(run: Run, values: FloatArray) -> BoolArray:
    """Return which rules fire in which rows, of shape (rules, rows)."""
    degrees = run(values).strengths
    assert degrees is not None  # systems give them
    fires: BoolArray = degrees > 0.0
    return fires
