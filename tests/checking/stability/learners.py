"""N1 to N5 for a learner: the same tree from the same facts, whatever their units.

A learner is any function from values of shape (rows, columns) and a class for each
row to a tree; so a test can hand in one with a known defect.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.checking.stability.results import Criterion, Trial
from fuzzytree.checking.stability.runs import first_line
from fuzzytree.checking.stability.transforms import scaled
from fuzzytree.errors import FuzzyTreeError
from fuzzytree.model.rulebase import LR
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.runtimes.table import baseline
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import axis_values, degree

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray, IntArray

Learn = Callable[["FloatArray", Sequence[str]], FuzzyTree]
"""Values of shape (rows, columns) and classes to a tree over columns x1, x2, ..."""

Count = Callable[["FloatArray", int], Sequence[int]]
"""Values and n to the counts of the 2n + 1 windows around their own mean."""

_EXPONENTS = (-200, -40, -3, 3, 40, 200)
_SHIFTS = tuple(2.0**k for k in (10, 20, 30, 40))
_GRID = 2.0**-10  # numbers that many shifts leave exact


def learner_criteria(
    learn: Learn, values: FloatArray, classes: Sequence[str]
) -> tuple[Criterion, ...]:
    """Apply N1 to N4 to a learner.

    Args:
        learn: The learner.
        values: A table that it can learn from, shape (rows, columns).
        classes: A class for each row.
    """
    return (
        learner_scaling(learn, values, classes),
        learner_offsets(learn, values, classes),
        learner_order(learn, values, classes),
        learner_degenerate(learn),
    )


def learner_scaling(
    learn: Learn, values: FloatArray, classes: Sequence[str]
) -> Criterion:
    """Multiply columns by 2**k; demand the tree in those units, bit for bit (N1)."""
    tree = learn(values, classes)
    width = values.shape[1]
    plans: list[list[int]] = [[k] * width for k in _EXPONENTS]
    plans.append([(-1) ** column * 17 * (column + 1) for column in range(width)])
    faults: list[str] = []
    for ks in plans:
        result = learn(np.ldexp(values, np.array(ks)), classes)
        exponents = {f"x{n}": k for n, k in enumerate(ks, 1)}
        if result != scaled(tree, exponents):
            faults.append(f"columns times 2**k, k {ks[:8]}, give another tree")
    trial = Trial("N1", "look for fixed thresholds", faults, cases=len(plans))
    return trial.result()


def learner_order(
    learn: Learn, values: FloatArray, classes: Sequence[str]
) -> Criterion:
    """Shuffle the rows; demand the same tree (N3)."""
    tree = learn(values, classes)
    faults: list[str] = []
    orders = [np.arange(len(values))[::-1], np.argsort(values[:, 0], kind="stable")]
    orders += [np.random.default_rng(s).permutation(len(values)) for s in range(4)]
    labels = np.array(classes, np.str_)
    for order in orders:
        if learn(values[order], labels[order].tolist()) != tree:
            faults.append("the same rows in another order give another tree")
    return Trial("N3", "make the sums exact", faults, cases=len(orders)).result()


def learner_offsets(
    learn: Learn, values: FloatArray, classes: Sequence[str]
) -> Criterion:
    """Add 2**10 to 2**40 to every column; demand the same answers (N2).

    The values are first put on a grid of 2**-10, in units of each column's spread, so
    that the shifted ones are exact: the table says the same as before.
    """
    unit = values.std(axis=0)
    grid = np.rint(values / np.where(unit > 0, unit, 1.0) / _GRID) * _GRID
    expected = _answers(learn(grid, classes), grid)
    faults: list[str] = []
    for shift in _SHIFTS:
        moved = grid + shift
        wrong = int((_answers(learn(moved, classes), moved) != expected).sum())
        if wrong:
            faults.append(
                f"columns plus {shift:g}: {wrong} of {len(grid)} training rows are "
                "answered differently"
            )
    cases = len(_SHIFTS) * len(grid)
    advice = "subtract a value of the column"
    return Trial("N2", advice, faults, cases=cases).result()


def learner_degenerate(learn: Learn) -> Criterion:
    """Learn from the smallest tables; demand an answer or an error of ours (N4).

    No warning leaks, every training row reaches a rule of strength 1, and the set of a
    pattern made of equal values has degree exactly 1 at them.
    """
    faults: list[str] = []
    refused: list[str] = []
    cases = 0
    for said, values, classes in small_tables():
        cases += 1
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                tree = learn(values, classes)
            except FuzzyTreeError as error:
                refused.append(f"{said}: refused: {first_line(error)}")
                continue
        faults += [f"{said}: it warns: {one.message}" for one in caught[:1]]
        faults += [f"{said}: {fault}" for fault in _weak_rows(tree, values)]
    trial = Trial("N4", "ask max == min first", faults, cases=cases)
    return trial.result(*refused)


def small_tables() -> Iterator[tuple[str, FloatArray, list[str]]]:
    """Yield a name, values and classes of tables at the edge of being one."""
    ramp = np.arange(12.0)
    two = ["a"] * 6 + ["b"] * 6
    for constant in (0.1, 1e12, 3.3e-7):
        column = np.full(12, constant)
        yield f"a column of {constant:g}", np.stack([column, ramp], axis=1), two
        yield f"only a column of {constant:g}", column[:, np.newaxis], two
    yield "one row", np.array([[1.0, 2.0]]), ["a"]
    yield "two rows", np.array([[1.0, 2.0], [1.5, 0.1]]), ["a", "b"]
    yield "two rows of one class", np.array([[1.0], [1.5]]), ["a", "a"]
    yield "two values", np.repeat([[0.1], [0.3]], 6, axis=0), two
    yield "two values, mixed", np.resize([0.1, 0.3], (12, 1)), two
    yield "copies of one row", np.repeat([[0.1, 0.7]], 12, axis=0), two
    yield "one class", np.stack([ramp, ramp**2], axis=1), ["a"] * 12
    yield "one row of a class", ramp[:, np.newaxis], ["a"] * 11 + ["b"]


def window_counts(count: Count, *, delta: int = 1) -> Criterion:
    """Count values in windows; demand the counts of rational arithmetic (N5).

    Window k around M + (k / n) SD is closed at both ends and reaches SD / n to each
    side (paper, 2.2.1). M and SD are those of the values themselves, without rounding:
    two values, balanced values and lattices lie on edges exactly.

    Args:
        count: What counts.
        delta: The variance is the sum of squares divided by (rows - delta).
    """
    faults: list[str] = []
    tables = list(edge_tables())
    for said, values in tables:
        for n in (2, 3, 5):
            expected = rational_counts(values.tolist(), n, delta=delta)
            result = [int(one) for one in count(values, n)]
            if result != expected:
                faults.append(f"{said}, n {n}: {result}, and {expected} is right")
    advice = "compare exactly near an edge"
    return Trial("N5", advice, faults, cases=3 * len(tables)).result()


def edge_tables() -> Iterator[tuple[str, FloatArray]]:
    """Yield a name and values that lie on edges of their own windows."""
    for low, high in ((0.0, 1.0), (0.1, 0.3), (1e12, 1e12 + 3.0), (1e-9, 1.1e-9)):
        yield f"{low!r} and {high!r}", np.array([low, high])
        yield f"{low!r} and {high!r}, four each", np.repeat([low, high], 4)
        yield f"{low!r} and {high!r}, one and seven", np.repeat([low, high], (1, 7))
    for step in (1.0, 0.1, 1e-3):
        lattice = step * np.arange(-6.0, 7.0)
        yield f"a lattice of {step!r}", lattice
        yield f"a lattice of {step!r} at 1e6", lattice + 1e6


def rational_counts(values: Sequence[float], n: int, *, delta: int = 1) -> list[int]:
    """Return how many values each closed window holds, by rational arithmetic.

    With t = (x - M) n the window k is (k - 1) SD <= t <= (k + 1) SD; SD is the root of
    a rational number, so both sides are compared by their signed squares.

    Example:
        >>> rational_counts([-1.0, 1.0], 1, delta=0)
        [1, 2, 1]
    """
    exact = [Fraction(value) for value in values]
    mean = sum(exact, Fraction(0)) / len(exact)
    squares = sum(((x - mean) * (x - mean) for x in exact), Fraction(0))
    variance = squares / (len(exact) - delta)
    steps = [((x - mean) * n) * abs((x - mean) * n) for x in exact]

    def at_most(step: Fraction, k: int) -> bool:
        return step <= k * abs(k) * variance

    return [
        sum(at_most(step, k + 1) and at_most(-step, 1 - k) for step in steps)
        for k in range(-n, n + 1)
    ]


def _answers(tree: FuzzyTree, values: FloatArray) -> IntArray:
    """Return the class number of each row, -1 for none."""
    columns = [int(name.removeprefix("x")) - 1 for name in tree.inputs]
    result = baseline().load(tree)(values[:, columns].T)
    numbers = [-1, *(tree.classes.index(leaf.label) for leaf in tree.leaves)]
    return np.array(numbers, np.int64)[result.rule]


def _weak_rows(tree: FuzzyTree, values: FloatArray) -> Iterator[str]:
    """Yield training rows without a rule of strength 1, and sets that miss a value."""
    columns = [int(name.removeprefix("x")) - 1 for name in tree.inputs]
    rows = values[:, columns].T
    fired = baseline().load(rules_from_tree(tree))(rows)
    if fired.strengths is None or not (fired.strengths.max(axis=0) == 1.0).all():
        yield "a training row has no rule of strength 1"
    axes = {v.name: v for v in tree.variables}
    for group in tree.sets:
        variable = axes[group.variable]
        met = [
            axis_values(tree.variables, dict(zip(tree.inputs, row, strict=True)))
            for row in rows.T.tolist()
        ]
        levels = {row[variable.name] for row in met}
        for term in group.terms:
            shape = term.shape
            if isinstance(shape, LR) and len(levels) == 1:
                value = next(iter(levels))
                if degree(shape, value) != 1.0:
                    yield (
                        f"{group.variable} is {term.name} has degree "
                        f"{degree(shape, value)!r} at {value!r}, its only value"
                    )
