"""Tables at the edge of what can be learnt from: what is promised of each.

Warnings are errors in all tests, so each of these is learnt without one.
"""

from __future__ import annotations

import itertools
from typing import Literal

import msgspec
import numpy as np
import pytest

from fuzzytree.errors import LearningError
from fuzzytree.learning import ArrayLearner, LearningSettings, Learnt, learn_arrays
from fuzzytree.learning.units import FloatArray
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import degree, descend, evaluate

Mode = Literal["default", "paper"]
MODES: tuple[Mode, ...] = ("default", "paper")
PLACES = [0.0, 1.0, -0.3, 1e12, 1e-300, -1e300, 3e-310]


def learn(values: FloatArray, labels: list[int], mode: Mode) -> Learnt:
    return learn_arrays(
        values,
        np.array(labels, np.int64),
        columns=[f"x{k}" for k in range(values.shape[1])],
        classes=[f"c{k}" for k in range(max(labels) + 1)],
        settings=LearningSettings(mode=mode),
    )


def labels_of(tree: FuzzyTree, values: FloatArray) -> list[str | None]:
    rows = [dict(zip(tree.columns, row, strict=True)) for row in values.tolist()]
    found = [descend(tree, row).label for row in rows]
    relative = rules_from_tree(tree)
    assert found == [evaluate(relative, row).label for row in rows]
    return found


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("place", PLACES)
def test_two_rows_of_two_classes_are_separated_and_have_degree_1(
    place: float, mode: Mode
) -> None:
    other = place + max(abs(place), 1e-310)
    values = np.array([[place], [other]])
    found = learn(values, [0, 1], mode)
    assert labels_of(found.tree, values) == ["c0", "c1"]
    assert found.report.single_rows == found.report.zero_spreads == 2
    (sets,) = found.tree.sets
    for term, value in zip(sets.terms, (place, other), strict=True):
        assert degree(term.shape, value) == 1.0


@pytest.mark.parametrize("mode", MODES)
def test_neighbouring_floats_are_separated(mode: Mode) -> None:
    for place in (0.1, 1e12, -7e200, 0.0):
        values = np.array([[place], [np.nextafter(place, np.inf)]])
        found = learn(values, [0, 1], mode)
        assert labels_of(found.tree, values) == ["c0", "c1"]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("place", PLACES)
def test_equal_rows_of_a_class_keep_degree_1(place: float, mode: Mode) -> None:
    other = place + max(abs(place), 1e-310)
    values = np.array([[place]] * 9 + [[other]] * 4)
    found = learn(values, [0] * 9 + [1] * 4, mode)
    assert labels_of(found.tree, values) == ["c0"] * 9 + ["c1"] * 4
    assert found.report.zero_spreads == 2
    assert found.report.single_rows == 0
    (sets,) = found.tree.sets
    for term, value in zip(sets.terms, (place, other), strict=True):
        assert degree(term.shape, value) == 1.0


@pytest.mark.parametrize("mode", MODES)
def test_two_valued_columns_are_learnt(mode: Mode) -> None:
    values = np.array(list(itertools.product([0.0, 1.0], repeat=3)) * 4)
    labels = [int(row[1]) for row in values]
    found = learn(values, labels, mode)
    assert labels_of(found.tree, values) == [f"c{label}" for label in labels]


@pytest.mark.one_in(4)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("constant", [0.0, 0.1, 1e12, -1e300, 5e-324])
def test_a_constant_column_is_ignored_and_changes_nothing(
    constant: float, mode: Mode
) -> None:
    rng = np.random.default_rng(0)
    labels = [0] * 30 + [1] * 30
    values = rng.normal(size=(60, 2)) + 3.0 * np.array(labels)[:, None]
    base = learn(values, labels, mode)
    wider = np.column_stack([values, np.full(60, constant)])
    found = learn(wider, labels, mode)
    assert found.report.features_ignored == ("x2",)
    assert found.tree.nodes == base.tree.nodes
    assert found.tree.variables == base.tree.variables


@pytest.mark.parametrize("mode", MODES)
def test_a_column_whose_range_overflows_is_ignored_and_one_that_fits_is_not(
    mode: Mode,
) -> None:
    labels = [0] * 5 + [1] * 5
    ends = np.where(np.array(labels) == 0, -1.0, 1.0) * (1.0 - np.arange(10) / 64)
    found = learn(np.column_stack([ends * 1.7e308, ends * 8e307]), labels, mode)
    assert found.report.features_ignored == ("x0",)
    assert found.tree.inputs == ("x1",)
    assert found.tree.nodes[0].cuts[0] == pytest.approx(0.0, abs=3e307)


@pytest.mark.parametrize("mode", MODES)
def test_a_class_without_rows_is_named_and_never_answers(mode: Mode) -> None:
    found = learn(np.array([[1.0], [2.0], [8.0], [9.0]]), [0, 0, 2, 2], mode)
    assert found.report.classes_without_rows == ("c1",)
    assert found.tree.classes == ("c0", "c1", "c2")
    assert {leaf.label for leaf in found.tree.leaves} == {"c0", "c2"}


@pytest.mark.parametrize("mode", MODES)
def test_one_class_is_refused_though_its_rows_differ(mode: Mode) -> None:
    with pytest.raises(LearningError, match="cannot learn from one class"):
        learn(np.array([[1.0], [2.0]]), [0, 0], mode)


def strange_column(rng: np.random.Generator, rows: int) -> FloatArray:
    """Return a column that is constant, discrete, far away, wide or at the ends."""
    columns = (
        rng.normal(size=rows),
        rng.integers(0, 3, rows).astype(np.float64),
        np.exp(60 * rng.normal(size=rows)),
        1e12 + rng.normal(size=rows),
        np.full(rows, 0.1),
        rng.choice([0.0, 5e-324, 1e-310, 1.0, -1e300, 1e300], rows),
    )
    return columns[int(rng.integers(len(columns)))]


def assert_a_strange_table_is_learnt(seed: int) -> None:
    """Learn a random table in two orders, without a warning, or refuse it twice."""
    rng = np.random.default_rng(seed)
    rows, width = int(rng.integers(2, 40)), int(rng.integers(1, 5))
    values = np.column_stack([strange_column(rng, rows) for _ in range(width)])
    labels, order = rng.integers(0, 4, rows), rng.permutation(rows)
    settings = LearningSettings(
        mode=MODES[seed % 2], rows_per_class=[1, 3, 10, 5000][int(rng.integers(4))]
    )
    columns, classes = [f"x{k}" for k in range(width)], [f"c{k}" for k in range(4)]
    found: list[bytes] = []
    for own in (np.arange(rows), order):
        try:
            learnt = learn_arrays(
                values[own],
                labels[own],
                columns=columns,
                classes=classes,
                settings=settings,
            )
            found.append(msgspec.json.encode(learnt))
            assert len(labels_of(learnt.tree, values)) == rows
        except LearningError as error:
            found.append(str(error).encode())
    assert found[0] == found[1]


@pytest.mark.one_in(4)
@pytest.mark.parametrize("seed", range(30))
def test_strange_tables_are_learnt_or_refused(seed: int) -> None:
    assert_a_strange_table_is_learnt(seed)


@pytest.mark.heavy
def test_many_strange_tables_are_learnt_or_refused() -> None:
    for seed in range(100, 300):
        assert_a_strange_table_is_learnt(seed)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("noise", [0.0, 2.0**-40, 2.0**-20, 2.0**-10])
def test_nearly_equal_columns_get_no_weights_out_of_proportion(noise: float) -> None:
    rng = np.random.default_rng(0)
    labels = np.repeat([0, 1], 200)
    first = rng.normal(size=400) + labels
    second = first + noise * rng.normal(size=400)
    other = rng.normal(size=400) + labels
    values = np.column_stack([first, second, other])
    tree = learn_arrays(
        values, labels, columns=["a", "b", "c"], classes=["0", "1"]
    ).tree
    combinations = [v for v in tree.variables if v.parts]
    # Within a class each column has a spread of 1: no weight needs to exceed 2.
    parts = [part for one in combinations for part in one.parts]
    assert all(abs(part.weight) < 4.0 for part in parts)
    right = np.array(labels_of(tree, values)) == labels.astype(str)
    assert right.mean() > 0.7


def test_a_difference_that_tells_all_is_found_beside_what_hides_it() -> None:
    rng = np.random.default_rng(1)
    labels = np.repeat([0, 1], 200)
    first = rng.normal(size=400)
    for power in (0, 5, 10):
        small = np.ldexp(labels + 0.1 * rng.normal(size=400), -power)
        values = np.column_stack([first, first + small])
        tree = learn_arrays(values, labels, columns=["a", "b"], classes=["0", "1"]).tree
        right = np.array(labels_of(tree, values)) == labels.astype(str)
        assert right.mean() > 0.99, power


def test_masked_cells_and_labels_are_missing_to_the_learner() -> None:
    rows = [[1.0], [2.0], [3.0], [7.0], [8.0], [9.0]]
    values = np.ma.MaskedArray(rows, [[True], *[[False]] * 5])
    labels = np.ma.MaskedArray([0, 0, 0, 1, 1, 1], [*[False] * 5, True])
    learner = ArrayLearner(["a"], ["soft", "firm"])
    learner.partial_fit(values, labels)
    report = learner.finish().report
    assert (report.rows_dropped, report.rows_filled) == (1, 1)
    with pytest.raises(ValueError, match=r"^the array holds timedelta64\[s\], and no"):
        learner.partial_fit(np.zeros((1, 1), "m8[s]"), np.array([0]))
