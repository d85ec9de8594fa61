"""What a person relies on when a tree is learnt."""

import numpy as np
import numpy.typing as npt
import pytest
from sklearn import datasets
from sklearn.model_selection import StratifiedKFold

from fuzzytree.cells import node_faults
from fuzzytree.errors import LearningError
from fuzzytree.learning import Learner, LearningReport, Settings, learn_arrays
from fuzzytree.runtimes import find_runtime
from fuzzytree.tree import FuzzyTree

Values = npt.NDArray[np.float64]
Codes = npt.NDArray[np.int64]


def learnt(values: Values, codes: Codes, **changes: object) -> FuzzyTree:
    return both(values, codes, **changes)[0]


def both(
    values: Values, codes: Codes, **changes: object
) -> tuple[FuzzyTree, LearningReport]:
    found = learn_arrays(
        values,
        codes,
        columns=[f"x{number}" for number in range(values.shape[1])],
        classes=[str(number) for number in range(int(codes.max()) + 1)],
        settings=Settings(**changes),  # type: ignore[arg-type]
    )
    return found.tree, found.report


def answers(tree: FuzzyTree, values: Values) -> Codes:
    columns = [int(name.removeprefix("x")) for name in tree.inputs]
    rules = find_runtime("native").load(tree)(values.T[columns]).rule
    return np.array([int(leaf.label) for leaf in tree.leaves])[rules - 1]


def blobs(rows: int = 300, classes: int = 3) -> tuple[Values, Codes]:
    chance = np.random.default_rng(1)
    codes = np.arange(rows) % classes
    values = (
        chance.normal(size=(rows, 4)) + 2.5 * chance.normal(size=(classes, 4))[codes]
    )
    return values, codes


def accuracy(values: Values, codes: Codes, **changes: object) -> tuple[float, float]:
    """Return percent right over 10 folds, and the spread over the folds."""
    shares = []
    right = 0
    folds = StratifiedKFold(10, shuffle=True, random_state=0)
    for train, test in folds.split(values, codes):
        tree = learnt(values[train], codes[train], **changes)
        hits = answers(tree, values[test]) == codes[test]
        right += int(hits.sum())
        shares.append(100 * hits.mean())
    return 100 * right / len(codes), float(np.std(shares))


TABLES = {
    "iris": datasets.load_iris,
    "wine": datasets.load_wine,
    "breast cancer": datasets.load_breast_cancer,
    "digits": datasets.load_digits,
}


@pytest.mark.parametrize(
    ("name", "published"),
    [("iris", 95.3), ("wine", 87.6), ("breast cancer", 87.0), ("digits", 32.4)],
)
def test_paper_mode_reproduces_the_paper_within_a_folds_spread(
    name: str, published: float
) -> None:
    found, spread = accuracy(*TABLES[name](return_X_y=True), mode="paper")
    assert abs(found - published) <= spread


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("iris", 96.5),
        ("wine", 97.5),
        ("breast cancer", 96.0),
        pytest.param("digits", 95.0, marks=pytest.mark.heavy),
    ],
)
def test_the_default_mode_is_as_accurate_as_promised(name: str, least: float) -> None:
    found, _ = accuracy(*TABLES[name](return_X_y=True))
    assert found >= least


@pytest.mark.parametrize("name", ["iris", "wine", "breast cancer"])
@pytest.mark.parametrize("mode", ["paper", "default"])
def test_there_is_at_most_one_leaf_for_a_pattern(name: str, mode: str) -> None:
    tree, report = both(*TABLES[name](return_X_y=True), mode=mode)
    assert len(tree.leaves) <= sum(report.patterns.values())
    assert len(report.features_per_node) == len(tree.nodes)
    assert not list(node_faults(tree))


def test_paper_mode_asks_one_feature_in_each_node() -> None:
    tree = learnt(*TABLES["wine"](return_X_y=True), mode="paper")
    assert not any(variable.parts for variable in tree.variables)


@pytest.mark.parametrize("sizes", [(1,), (7, 100, 3), (299,), (64, 64)])
def test_the_tree_does_not_depend_on_the_chunks(sizes: tuple[int, ...]) -> None:
    values, codes = blobs()
    whole = learnt(values, codes)
    learner = Learner(
        columns=[f"x{k}" for k in range(4)], classes=[str(k) for k in range(3)]
    )
    start, turn = 0, 0
    while start < len(values):
        end = start + sizes[turn % len(sizes)]
        learner.partial_fit(values[start:end], codes[start:end])
        start, turn = end, turn + 1
    assert learner.finish().tree == whole


def test_the_tree_does_not_depend_on_the_memory_order() -> None:
    values, codes = blobs()
    assert learnt(np.asfortranarray(values), codes) == learnt(values, codes)


def test_the_same_table_gives_the_same_tree() -> None:
    values, codes = blobs()
    assert learnt(values, codes) == learnt(values, codes)


def test_merged_learners_count_what_both_have_seen() -> None:
    values, codes = blobs()
    halves = []
    for part in (slice(0, 150), slice(150, 300)):
        learner = Learner(columns=list("abcd"), classes=list("012"))
        learner.partial_fit(values[part], codes[part])
        halves.append(learner)
    assert halves[0].merge(halves[1]).finish().report.rows == 300


@pytest.mark.parametrize("power", [-300, -40, 40, 200])
def test_powers_of_two_change_no_answer(power: int) -> None:
    values, codes = blobs()
    plain = learnt(values, codes, mode="paper")
    moved = learnt(values * 2.0**power, codes, mode="paper")
    assert [node.variable for node in moved.nodes] == [
        node.variable for node in plain.nodes
    ]
    found = answers(moved, values * 2.0**power)
    assert found.tolist() == answers(plain, values).tolist()


def test_features_far_apart_in_scale_are_learnt_alike() -> None:
    values, codes = blobs()
    wide = values * np.array([1e-12, 1.0, 1e6, 1e12])
    right = (answers(learnt(wide, codes), wide) == codes).mean()
    assert right >= (answers(learnt(values, codes), values) == codes).mean() - 0.01


def test_a_narrow_class_inside_a_wide_one_gets_two_cuts() -> None:
    chance = np.random.default_rng(0)
    values = np.concatenate([chance.normal(size=200) * 10, chance.normal(size=200)])
    codes = np.repeat([0, 1], 200)
    tree = learnt(values[:, None], codes)
    assert any(len(node.cuts) == 2 for node in tree.nodes)
    assert (answers(tree, values[:, None]) == codes).mean() > 0.85


def test_a_class_of_two_shapes_is_told_from_what_lies_between() -> None:
    chance = np.random.default_rng(0)
    values = chance.uniform(-1, 1, (600, 2))
    codes = ((values > 0).sum(axis=1) % 2).astype(np.int64)
    tree, report = both(values, codes)
    assert (answers(tree, values) == codes).mean() > 0.95
    assert sum(report.patterns.values()) >= 4


def test_patterns_can_be_set_class_by_class() -> None:
    values, codes = blobs()
    _, report = both(values, codes, patterns_per_class={"1": 3})
    assert report.patterns == {"0": 1, "1": 3, "2": 1}


def test_a_cheap_feature_is_preferred_to_an_equal_one() -> None:
    values, codes = blobs(classes=2)
    twice = np.hstack([values, values])
    costs = {"x0": 5.0, "x1": 5.0, "x2": 5.0, "x3": 5.0}
    tree = learnt(twice, codes, mode="paper", costs=costs)
    assert set(tree.inputs) <= {"x4", "x5", "x6", "x7"}


def test_cuts_of_whole_numbers_lie_between_them() -> None:
    chance = np.random.default_rng(0)
    values = chance.integers(0, 9, (400, 2)).astype(np.float64)
    codes = (values[:, 0] > 4).astype(np.int64)
    tree = learnt(values, codes, mode="paper")
    assert all(cut != round(cut) for node in tree.nodes for cut in node.cuts)


def test_incomplete_rows_are_left_out_and_counted() -> None:
    values, codes = blobs()
    holed = values.copy()
    holed[[3, 50, 51]] = [[np.nan] * 4, [np.inf, 0, 0, 0], [0, 0, 0, -np.inf]]
    tree, report = both(holed, codes)
    kept = np.isfinite(holed).all(axis=1)
    assert report.rows_dropped == 3
    assert tree == learnt(values[kept], codes[kept])


def test_constant_columns_are_left_out_and_named() -> None:
    values, codes = blobs()
    values = np.hstack([values, np.full((300, 1), 0.1)])
    tree, report = both(values, codes)
    assert report.features_ignored == ("x4",)
    assert "x4" not in tree.inputs


def test_a_class_of_one_row_has_a_leaf() -> None:
    values, codes = blobs()
    values = np.vstack([values, np.full((1, 4), 50.0)])
    tree, report = both(values, np.append(codes, 3))
    assert "3" in {leaf.label for leaf in tree.leaves}
    assert report.single_rows == 1


@pytest.mark.parametrize(
    ("values", "codes", "sentence"),
    [
        (np.empty((0, 1)), [], "cannot learn from a table without rows"),
        (
            np.ones((1, 1)),
            [0],
            "cannot learn from one row; two classes need two at least",
        ),
        (
            np.array([[1.0], [2.0]]),
            [1, 1],
            "cannot learn from one class: every row is 'b'",
        ),
        (
            np.ones((4, 1)),
            [0, 1, 0, 1],
            "cannot learn without a column that varies: every column is constant, "
            "or so large that its square overflows",
        ),
        (
            np.full((3, 1), np.nan),
            [0, 1, 0],
            "cannot learn from a table without complete rows: all 3 hold a missing "
            "or infinite value or no class",
        ),
    ],
)
def test_a_table_that_teaches_nothing_is_refused(
    values: Values, codes: list[int], sentence: str
) -> None:
    with pytest.raises(LearningError) as caught:
        learn_arrays(values, np.array(codes, int), columns=["x"], classes=["a", "b"])
    assert str(caught.value) == sentence


def test_missing_values_can_be_refused() -> None:
    values, codes = blobs(classes=2)
    values[5, 1] = np.nan
    with pytest.raises(LearningError) as caught:
        both(values, codes, missing="refuse")
    assert str(caught.value).splitlines()[0] == (
        "1 of 300 rows hold a missing or infinite value or no class"
    )


def test_all_settings_out_of_range_are_told_at_once() -> None:
    with pytest.raises(ValueError, match="alpha") as caught:
        Settings(alpha=2.0, points=9, l_max=-1.0)
    assert str(caught.value).splitlines() == [
        "alpha lies in [0, 1], not 2.0",
        "l_max is above 0, not -1.0",
        "points lies in 1 to 8, not 9",
    ]


@pytest.mark.heavy
def test_ten_thousand_classes_are_learnt() -> None:
    chance = np.random.default_rng(0)
    codes = np.arange(100_000) % 10_000
    values = chance.normal(size=(100_000, 16))
    values += 3 * chance.normal(size=(10_000, 16))[codes]
    tree = learnt(values, codes)
    assert len(tree.leaves) == 10_000
