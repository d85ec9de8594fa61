"""A tree of scikit-learn and ours answer alike, at every double that was tried."""

from __future__ import annotations

import itertools
import math
import struct
import subprocess
import sys
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fuzzytree
from fuzzytree.errors import LossError
from fuzzytree.formats.sklearn import from_sklearn
from fuzzytree.model.rulebase import Band
from fuzzytree.numerics import cuts_of_rounded
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import Status, descend, evaluate

ensemble = pytest.importorskip("sklearn.ensemble")
trees = pytest.importorskip("sklearn.tree")
pipelines = pytest.importorskip("sklearn.pipeline")
scaling = pytest.importorskip("sklearn.preprocessing")
base = pytest.importorskip("sklearn.base")


def single(value: float) -> float:
    """Round to 32 bits, by the C library and not by numpy."""
    try:
        return float(struct.unpack("f", struct.pack("f", value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)


FLOATS = st.floats(allow_nan=False, allow_infinity=False)
SINGLES = st.floats(width=32, allow_nan=False, allow_infinity=False)


@given(FLOATS | SINGLES)
def test_a_cut_is_the_last_double_that_is_rounded_to_the_threshold_or_below(
    threshold: float,
) -> None:
    cut = float(cuts_of_rounded(np.array([threshold]))[0])
    assert single(cut) <= threshold
    assert single(math.nextafter(cut, math.inf)) > threshold


@given(SINGLES)
def test_a_cut_between_two_floats_is_right_for_either_parity(value: float) -> None:
    following = single(value + 2.0**-149 + abs(value) * 2.0**-24 * 1.5)
    if value < following < math.inf:
        threshold = value / 2 + following / 2
        cut = float(cuts_of_rounded(np.array([threshold]))[0])
        assert single(cut) <= threshold < single(math.nextafter(cut, math.inf))


def grown(seed: int, *, scale: float = 1.0, classes: int = 3, **options: Any) -> Any:
    chance = np.random.default_rng(seed)
    values = chance.normal(size=(200, 4)) * scale
    values[:, 1] = np.round(values[:, 1] / scale) * scale
    labels = chance.integers(0, classes, 200) + 10
    options.setdefault("max_leaf_nodes", 30)
    tree = trees.DecisionTreeClassifier(random_state=seed, **options)
    return tree.fit(values, labels)


def near(value: float) -> list[float]:
    """The doubles around a threshold, and around the floats beside it."""
    found: list[float] = []
    below = np.float32(value)
    floats = [np.nextafter(below, np.float32(way)) for way in (-np.inf, np.inf)]
    ends = [float(one) for one in (floats[0], below, floats[1])]
    middles = [a / 2 + b / 2 for a, b in itertools.pairwise(ends)]
    for place in (value, *ends, *middles):
        found += [place, *(math.nextafter(place, way) for way in (-math.inf, math.inf))]
    return found


def rows_of(tree: Any, chance: np.random.Generator) -> np.ndarray[Any, Any]:
    """Rows whose values stand at or beside the thresholds of the columns."""
    arrays = tree.tree_
    marks: list[list[float]] = [[0.0, 1.0, -1.0] for _ in range(tree.n_features_in_)]
    for column, threshold in zip(arrays.feature, arrays.threshold, strict=True):
        if column >= 0 and math.isfinite(threshold):
            marks[column] += near(float(threshold))
    return np.column_stack([chance.choice(one, 400) for one in marks])


OPTIONS: list[dict[str, Any]] = [
    {},
    {"max_leaf_nodes": None, "max_depth": 4},
    {"scale": 1e-3},
    {"scale": 1e37},
    {"class_weight": {10: 1.0, 11: 5.0, 12: 0.5}},
    {"splitter": "random"},
    {"max_leaf_nodes": 2},
]


@pytest.mark.one_in(4)
@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize("seed", range(3))
def test_the_tree_answers_as_predict_does_at_and_beside_every_threshold(
    seed: int, options: dict[str, Any]
) -> None:
    tree = grown(seed, **options)
    ours = from_sklearn(tree)
    rules = rules_from_tree(ours)
    rows = rows_of(tree, np.random.default_rng(seed))
    expected = [str(label) for label in tree.predict(rows).tolist()]
    reached = tree.apply(rows)
    counts = tree.tree_.n_node_samples
    for row, label, node in zip(rows.tolist(), expected, reached, strict=True):
        given_row = dict(zip(ours.columns, row, strict=True))
        answer = descend(ours, given_row)
        assert answer.label == label
        assert ours.leaves[answer.rule - 1].support == counts[node]
        found = evaluate(rules, given_row)
        assert (found.label, found.rule) == (label, answer.rule)
        assert sorted(found.strengths)[-2:] == [0.0, 1.0]


def test_classes_of_equal_weight_are_decided_as_predict_does() -> None:
    stump = trees.DecisionTreeClassifier(max_depth=1)
    stump.fit([[0.0], [0.0], [1.0], [1.0]], ["b", "a", "b", "a"])
    ours = from_sklearn(stump)
    assert descend(ours, {"x1": 0.0}).label == stump.predict([[0.0]])[0] == "a"


def test_soft_flanks_change_no_decision_and_fall_over_the_width() -> None:
    tree = grown(0, max_leaf_nodes=6)
    spreads = [1.0, 1.0, 2.0, 1.0]
    crisp = from_sklearn(tree)
    ours = from_sklearn(tree, soft=0.25, spreads=spreads)
    assert ours.nodes == crisp.nodes
    rules = rules_from_tree(ours)
    for row in rows_of(tree, np.random.default_rng(1)).tolist():
        given_row = dict(zip(ours.columns, row, strict=True))
        answer = evaluate(rules, given_row)
        assert answer.rule == descend(crisp, given_row).rule
        assert answer.status == Status.DECIDED
    for variable in ours.variables:
        width = 0.25 * spreads[ours.columns.index(variable.name)]
        for term in variable.terms:
            assert isinstance(term.shape, Band)
            ((start, end),) = term.shape.flanks
            assert abs(end - start) == pytest.approx(width)


def test_widths_can_be_given_for_each_column() -> None:
    tree = trees.DecisionTreeClassifier().fit([[0.0], [1.0]], [0, 1])
    ours = from_sklearn(tree, columns=["force"], soft={"force": 2.0})
    rules = rules_from_tree(ours)
    strengths = evaluate(rules, {"force": 1.5}).strengths
    assert list(strengths) == pytest.approx([0.5, 1.0])


def test_names_of_the_table_are_kept() -> None:
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame({"grip force": [0.0, 1.0], "unused": [0.0, 0.0]})
    tree = trees.DecisionTreeClassifier().fit(table, ["soft", "firm"])
    named: dict[str, Any] = {"classes": ["fest", "weich"], "name": "grip"}
    ours = from_sklearn(tree, **named)
    assert from_sklearn(tree, soft=1.0, spreads=table.std(), **named) != ours
    assert ours.columns == ("grip force", "unused")
    assert ours.inputs == ("grip force",)
    assert ours.classes == ("fest", "weich")
    assert ours.name == "grip"
    assert [leaf.label for leaf in ours.leaves] == ["weich", "fest"]


def test_a_tree_without_a_question_has_one_leaf() -> None:
    tree = trees.DecisionTreeClassifier().fit([[0.0], [1.0]], [1, 1])
    ours = from_sklearn(tree)
    assert ours.nodes == ()
    assert descend(ours, {}).label == "1"


@pytest.mark.one_in(4)
@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize("classes", [2, 3])
def test_probabilities_are_those_of_predict_proba(
    classes: int, options: dict[str, Any]
) -> None:
    tree = grown(4, classes=classes, **{"max_leaf_nodes": 8, **options})
    rows = rows_of(tree, np.random.default_rng(4))
    result = fuzzytree.run(from_sklearn(tree), rows, with_probabilities=True)
    assert result.probabilities is not None
    off = np.abs(result.probabilities.T - tree.predict_proba(rows)).max()
    assert off < (0.5e-6 + 1e-9 if classes == 2 else 1e-6)


def test_a_probability_with_six_digits_is_kept_and_the_rest_is_rounded() -> None:
    labels = ["a"] * 29 + ["b"] * 71
    tree = trees.DecisionTreeClassifier().fit([[0.0]] * 100, labels)
    assert from_sklearn(tree).leaves[0].probabilities == (0.29, 0.71)
    tree.fit([[0.0]] * 3, ["a", "b", "c"])
    vector = (0.333334, 0.333333, 0.333333)
    assert from_sklearn(tree).leaves[0].probabilities == vector


def test_soft_flanks_mix_the_probabilities_of_the_leaves() -> None:
    tree = trees.DecisionTreeClassifier().fit([[0.0], [1.0]], ["a", "b"])
    ours = from_sklearn(tree, soft={"x1": 1.0})
    rows = np.array([[-1.0], [0.0], [0.5], [0.75], [2.0]])
    result = fuzzytree.run(ours, rows, with_probabilities=True)
    assert [*result.classes] == [*tree.predict(rows)]
    assert result.probabilities is not None
    mixed = [1.0, 1 / 1.5, 0.5, 0.75 / 1.75, 0.0]
    assert result.probabilities[0].tolist() == pytest.approx(mixed, abs=2e-5)


def test_a_tree_beyond_the_limits_or_of_negative_weights_has_no_probabilities(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tree = trees.DecisionTreeClassifier(max_depth=1)
    tree.fit([[0.0], [0.0], [2.0]], ["a", "b", "b"], sample_weight=[-1.0, 2.0, 2.0])
    ours = from_sklearn(tree)
    assert {leaf.probabilities for leaf in ours.leaves} == {msgspec.UNSET}
    tree.fit([[0.0], [2.0]], ["a", "b"])
    assert from_sklearn(tree).semantics.sharpness == 1
    monkeypatch.setattr("fuzzytree.formats.sklearn.MOST_MIXED", 1)
    assert from_sklearn(tree).semantics.sharpness is msgspec.UNSET


def test_a_missing_value_has_the_prediction_of_the_caller() -> None:
    tree = trees.DecisionTreeClassifier().fit([[0.0], [1.0]], ["a", "b"])
    answer = descend(from_sklearn(tree, missing="b"), {"x1": math.nan})
    assert (answer.label, answer.status) == ("b", Status.MISSING)


def with_gaps(seed: int, columns: int, **options: Any) -> Any:
    """A tree that was fitted with missing values in some of its columns."""
    chance = np.random.default_rng(seed)
    values = chance.normal(size=(120, 4))
    gaps = chance.random(values.shape) < 0.25
    gaps[:, columns:] = False
    labels = np.nan_to_num(values[:, 0]) + values[:, 3] + gaps[:, 1] > 0.3
    values[gaps] = math.nan
    return trees.DecisionTreeClassifier(random_state=seed, **options).fit(
        values, labels.astype(int) + gaps[:, 0]
    )


@pytest.mark.parametrize("columns", range(5))
def test_a_row_with_missing_values_is_answered_as_predict_does(columns: int) -> None:
    read = whole = 0
    for seed, leaves in itertools.product(range(12), (3, 8)):
        tree = with_gaps(seed, columns, max_leaf_nodes=leaves)
        try:
            ours = from_sklearn(tree)
        except LossError:
            continue
        rows = rows_of(tree, np.random.default_rng(seed))[:48].repeat(16, axis=0)
        gaps = np.array([*itertools.product([False, True], repeat=4)] * 48)
        rows[gaps] = math.nan
        habit = [
            ours.columns.index(v.name) for v in ours.variables if v.missing is None
        ]
        answered = ~gaps[:, habit].any(axis=1)
        result = fuzzytree.run(ours, rows)
        expected = np.where(answered, result.rule, 0)
        assert result.rule.tolist() == expected.tolist()
        found = [label for label in result.classes if label is not None]
        assert found == tree.predict(rows[answered]).tolist()
        read, whole = read + 1, whole + (not habit)
    assert read >= 12
    assert whole >= 3


def test_a_tree_that_tests_for_missing_values_has_them_above_all_others() -> None:
    tree = trees.DecisionTreeClassifier()
    tree.fit([[math.nan], [math.nan], [1.0], [1.0]], ["a", "a", "b", "b"])
    ours = from_sklearn(tree, columns=["force"], soft={"force": 1.0})
    assert str(ours) == (
        "force? (cut at 1.70141e+38)\n  present: b [1]\n  missing: a [2]"
    )
    for value, label in ((math.nan, "a"), (-1e38, "b"), (1.7e38, "b"), (0.0, "b")):
        assert descend(ours, {"force": value}).label == label == tree.predict([[value]])
    (force,) = ours.variables
    assert force.missing == np.float32(force.missing) == 1.5 * 2.0**127


def both_ways(*gaps: tuple[float, float, str]) -> Any:
    """A tree that sends a missing force right where mass is 0, and left where it is 1.

    Gaps are further rows; two of them turn both directions round.
    """
    rows = [(0.0, 0.0, "a")] * 4 + [(0.0, 2.0, "b")] * 5 + [(0.0, 2.0, "a")]
    rows += [(1.0, 0.0, "c")] * 6 + [(1.0, 2.0, "d")] * 4
    table = np.array([row[:2] for row in (*rows, *gaps)])
    tree = trees.DecisionTreeClassifier(random_state=0, max_depth=2)
    return tree.fit(table, [row[2] for row in (*rows, *gaps)])


def test_directions_of_habit_that_no_single_value_takes_give_no_class() -> None:
    ours = from_sklearn(both_ways(), columns=["mass", "force"])
    mass, force = ours.variables
    assert mass.missing == pytest.approx(0.75)
    assert force.missing is None
    answer = descend(ours, {"mass": 1.0, "force": math.nan})
    assert answer.status == Status.MISSING


def test_learnt_directions_that_no_single_value_takes_are_refused() -> None:
    tree = both_ways((0.0, math.nan, "a"), (1.0, math.nan, "d"))
    with pytest.raises(LossError) as caught:
        from_sklearn(tree, columns=["mass", "force"])
    assert str(caught.value) == (
        "cannot read a tree that learnt where missing values of 'force' go: no single "
        "value goes there at all nodes; missing= gives rows with missing values a "
        "class instead"
    )
    answer = descend(from_sklearn(tree, missing="c"), {"x1": 0.0, "x2": math.nan})
    assert (answer.label, answer.status) == ("c", Status.MISSING)


def test_several_outputs_are_refused() -> None:
    tree = trees.DecisionTreeClassifier().fit([[0.0], [1.0]], [[0, 1], [1, 0]])
    with pytest.raises(LossError) as caught:
        from_sklearn(tree)
    assert str(caught.value) == (
        "cannot read a DecisionTreeClassifier with 2 outputs: a tree has one"
    )


SCALERS: dict[str, list[Any]] = {
    "standard": [scaling.StandardScaler()],
    "without mean": [scaling.StandardScaler(with_mean=False, copy=False)],
    "minmax": [scaling.MinMaxScaler(feature_range=(-3, 7), copy=False)],
    "maxabs": [scaling.MaxAbsScaler()],
    "robust": [scaling.RobustScaler(with_centering=False), "passthrough"],
    "unscaled": [None, scaling.RobustScaler(with_scaling=False)],
    "two": [scaling.RobustScaler(), scaling.MinMaxScaler()],
}


def pipeline(steps: list[Any], **options: Any) -> tuple[Any, np.ndarray[Any, Any]]:
    """A pipeline, and the table that it was fitted on."""
    chance = np.random.default_rng(5)
    values = chance.normal(size=(200, 4)) * [1e-5, 1.0, 1e6, 30.0] + [0, 1, 1e8, -4]
    tree = trees.DecisionTreeClassifier(random_state=0, **options)
    fitted = pipelines.make_pipeline(*(base.clone(s, safe=False) for s in steps), tree)
    return fitted.fit(values.copy(), chance.integers(0, 3, 200)), values


@pytest.mark.parametrize("name", SCALERS)
def test_a_pipeline_is_answered_as_its_predict_at_and_beside_every_cut(
    name: str,
) -> None:
    grown, values = pipeline(SCALERS[name], max_leaf_nodes=40)
    ours = from_sklearn(grown)
    marks = [column.tolist() for column in values.T]
    for node in ours.nodes:
        (cut,) = node.cuts
        beside = [math.nextafter(cut, way) for way in (-math.inf, math.inf)]
        marks[ours.columns.index(node.variable)] += [cut, *beside] * 10
    chance = np.random.default_rng(0)
    rows = np.column_stack([chance.choice(column, 4000) for column in marks])
    assert fuzzytree.run(grown, rows).classes == grown.predict(rows.copy()).tolist()
    assert len(ours.leaves) == 40


def test_a_pipeline_keeps_the_names_of_its_table_and_where_missing_values_go() -> None:
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame({"force": [1.0, 2.0, math.nan, 9.0], "b": [0.0] * 4})
    grown = pipelines.make_pipeline("passthrough", *SCALERS["two"])
    grown.steps.append(("tree", trees.DecisionTreeClassifier(max_depth=2)))
    grown.set_output(transform="pandas").fit(table, ["a", "b", "b", "b"])
    ours = from_sklearn(grown, soft={"force": 0.1})
    assert ours.columns == ("force", "b")
    assert list(ours.nodes[0].cuts) == pytest.approx([1.5])
    assert descend(ours, {"force": math.nan}).label == grown.predict(table)[2] == "b"


def test_a_pipeline_may_have_one_leaf() -> None:
    grown, _ = pipeline(SCALERS["two"], min_samples_leaf=200)
    ours = from_sklearn(grown)
    assert (ours.nodes, len(ours.leaves)) == ((), 1)


STANDING = "StandardScaler, MinMaxScaler, MaxAbsScaler, RobustScaler"


# A class of somebody else, whose transform may be anything.
Scaler = type("Scaler", (scaling.StandardScaler,), {})


@pytest.mark.parametrize(
    ("step", "text"),
    [
        (
            scaling.PowerTransformer(),
            f"a PowerTransformer: before a tree stand {STANDING}",
        ),
        (Scaler(), f"a Scaler: before a tree stand {STANDING}"),
        (
            scaling.MinMaxScaler(clip=True),
            "a MinMaxScaler that clips: it needs clip=False",
        ),
    ],
)
def test_other_steps_of_a_pipeline_are_refused(step: Any, text: str) -> None:
    grown, _ = pipeline([step], max_depth=1)
    with pytest.raises(LossError) as caught:
        from_sklearn(grown)
    name = grown.steps[0][0]
    assert str(caught.value) == f"cannot read a Pipeline with the step {name!r}, {text}"


def test_a_scaler_that_turns_a_column_round_is_refused() -> None:
    grown, _ = pipeline([scaling.StandardScaler()], max_depth=1)
    grown[0].scale_ = -grown[0].scale_
    with pytest.raises(LossError) as caught:
        from_sklearn(grown)
    assert str(caught.value) == (
        "cannot read a Pipeline whose step 'standardscaler' does not increase with a "
        "column: its scale_ must be above 0"
    )


def test_a_pipeline_that_is_not_fitted_or_ends_otherwise_is_refused() -> None:
    tree = trees.DecisionTreeClassifier()
    with pytest.raises(ValueError, match="the StandardScaler is not fitted"):
        from_sklearn(pipelines.make_pipeline(scaling.StandardScaler(), tree))
    with pytest.raises(TypeError) as caught:
        from_sklearn(pipelines.make_pipeline(ensemble.RandomForestClassifier()))
    assert str(caught.value) == (
        "from_sklearn reads a DecisionTreeClassifier, and not a RandomForestClassifier"
    )


@pytest.mark.parametrize(
    "wrong",
    [
        trees.DecisionTreeRegressor(),
        ensemble.RandomForestClassifier(),
        "tree",
        type("DecisionTreeClassifier", (), {})(),
    ],
    ids=lambda wrong: type(wrong).__name__,
)
def test_what_is_no_such_tree_is_refused(wrong: object) -> None:
    with pytest.raises(TypeError) as caught:
        from_sklearn(wrong)
    assert str(caught.value) == (
        f"from_sklearn reads a DecisionTreeClassifier, and not a {type(wrong).__name__}"
    )


def test_a_tree_that_is_not_fitted_is_refused() -> None:
    with pytest.raises(ValueError, match="the DecisionTreeClassifier is not fitted"):
        from_sklearn(trees.DecisionTreeClassifier())


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"columns": ["a"]}, "1 names for 2 columns"),
        ({"classes": ["a", "b", "c"]}, "3 names for 2 classes"),
        (
            {"soft": 1.0},
            "soft is a number of spreads: give spreads=X.std(axis=0) too, or a width "
            "for each column",
        ),
        ({"soft": 1.0, "spreads": [1.0]}, "1 spreads for 2 columns"),
        (
            {"soft": 0.0, "spreads": [1.0, 1.0]},
            "the width beside a cut of 'x1' must be above 0, not 0.0",
        ),
        ({"soft": {}}, "soft: no width for 'x1', which the tree tests"),
        (
            {"soft": {"x": 1.0}},
            "soft: no column 'x'; there is x1, x2 (did you mean 'x2'?)",
        ),
        (
            {"soft": {"x1": 1e-30}},
            "a width of 1e-30 beside the cut of 'x1' at 0.5000000298023224 is no flank "
            "in doubles",
        ),
    ],
)
def test_names_and_widths_that_do_not_fit_are_refused(
    options: dict[str, Any], text: str
) -> None:
    tree = trees.DecisionTreeClassifier().fit([[0.0, 0.0], [1.0, 0.0]], [0, 1])
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        from_sklearn(tree, **options)
    assert str(caught.value) == text


def test_the_reader_does_not_import_the_library() -> None:
    code = "import sys, fuzzytree.formats.sklearn; print('sklearn' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout == "False\n"
    assert fuzzytree.from_sklearn is from_sklearn
