"""Files of XGBoost and LightGBM: read as the libraries predict, or refused."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fuzzytree.ensembles.boosters import (
    from_lightgbm,
    from_xgboost,
    run_lightgbm,
    run_xgboost,
)
from fuzzytree.ensembles.trees import Ensemble, Rows
from fuzzytree.errors import ReadError
from fuzzytree.model import FloatArray, IntArray

ROUNDS, ROWS = 8, 1_000
ZERO = float(np.float32(1e-35))  # of LightGBM
KINDS: tuple[Rows, ...] = ("float32", "float64")
PLACES = (0.0, ZERO, -ZERO, 1e-36, -1e-36, 1.1e-35, -1.1e-35, 1.0, -1.0, 3e38, -3e38)

XGBOOST: list[dict[str, Any]] = [
    {"objective": "reg:squarederror"},
    {"objective": "reg:squarederror", "base_score": 1e3},
    *({"objective": f"reg:{name}error"} for name in ("absolute", "pseudohuber")),
    {"objective": "reg:squaredlogerror"},
    {"objective": "reg:quantileerror", "quantile_alpha": [0.1, 0.9]},
    {"objective": "rank:ndcg"},
    {"objective": "binary:logistic"},
    {"objective": "binary:logistic", "base_score": 0.4999},
    {"objective": "binary:logistic", "booster": "dart", "rate_drop": 0.5},
    {"objective": "multi:softprob", "num_class": 4},
    {"objective": "multi:softmax", "num_class": 4, "booster": "dart", "rate_drop": 0.3},
    {"objective": "reg:squarederror", "num_parallel_tree": 3, "subsample": 0.5},
    {"objective": "reg:squarederror", "tree_method": "exact", "gamma": 1},
]
FOREST = {"boosting": "rf", "bagging_fraction": 0.5, "bagging_freq": 1}
LIGHTGBM: list[dict[str, Any]] = [
    {"objective": "regression"},
    {"objective": "regression", "zero_as_missing": True},
    {"objective": "regression", "use_missing": False},
    {"objective": "regression", "min_data_in_leaf": 1_000},
    {"objective": "regression", "boosting": "dart"},
    *({"objective": name} for name in ("regression_l1", "huber", "fair", "quantile")),
    *({"objective": name} for name in ("mape", "lambdarank", "rank_xendcg")),
    {"objective": "binary"},
    {"objective": "binary", "zero_as_missing": True},
    {"objective": "binary", "sigmoid": 2.5, **FOREST},
    {"objective": "multiclass", "num_class": 4},
    {"objective": "multiclass", "num_class": 4, **FOREST},
]


def table() -> tuple[FloatArray, FloatArray]:
    """Return columns of one decimal, some missing and some mostly 0, and numbers."""
    draw = np.random.default_rng(1)
    rows = np.round(draw.normal(size=(400, 5)), 1)
    rows[:, 4] = np.where(draw.random(400) < 0.7, 0.0, rows[:, 4])
    rows[:, :3][draw.random((400, 3)) < 0.15] = np.nan
    full = np.nan_to_num(rows)
    numbers = full[:, 0] + np.abs(full[:, 4]) + np.isnan(rows[:, 1])
    return rows, numbers + draw.normal(size=400) * 0.3


def targets(objective: str, numbers: FloatArray) -> FloatArray | IntArray:
    if "binary" in objective:
        return (numbers > 1).astype(np.float64)
    if "multi" in objective or "rank" in objective:
        return np.digitize(numbers, [0.0, 0.7, 1.5])
    return np.abs(numbers)


def xgboost_file(**options: Any) -> bytes:
    xgboost = pytest.importorskip("xgboost", reason="xgboost is not installed")
    rows, numbers = table()
    data = xgboost.DMatrix(
        rows, label=targets(options["objective"], numbers), nthread=1
    )
    if "rank" in options["objective"]:
        data.set_group([100] * 4)
    trained = xgboost.train({"nthread": 1, "max_depth": 4, **options}, data, ROUNDS)
    return bytes(trained.save_raw("json"))


def lightgbm_file(**options: Any) -> bytes:
    lightgbm = pytest.importorskip("lightgbm", reason="lightgbm is not installed")
    rows, numbers = table()
    group = [100] * 4 if "rank" in options["objective"] else None
    options = {"num_leaves": 15, "min_data_in_leaf": 5, **options}
    data = lightgbm.Dataset(
        rows, label=targets(options["objective"], numbers), group=group
    )
    trained = lightgbm.train({"num_threads": 1, "verbose": -1, **options}, data, ROUNDS)
    return str(trained.model_to_string()).encode()


def rows_at_cuts(ensemble: Ensemble, kind: Rows) -> FloatArray:
    """Return rows at the cuts, one float beside them, around 0 and missing."""
    draw = np.random.default_rng(3)
    number: Any = np.dtype(kind).type
    columns = []
    for column in range(ensemble.width or 0):
        cuts = [tree.cuts[tree.columns == column] for tree in ensemble.trees]
        at = np.concatenate([*cuts, PLACES]).astype(kind)
        beside = [np.nextafter(at, number(way)) for way in (np.inf, -np.inf)]
        values = np.concatenate([at, *beside])
        if not ensemble.takes_infinite:
            values = values[np.isfinite(values)]
        columns.append(draw.choice(values, ROWS))
    rows = np.stack(columns, axis=1).astype(np.float64)
    rows[draw.random(rows.shape) < 0.15] = np.nan
    return rows


def assert_same(
    ensemble: Ensemble, raw: Any, rows: FloatArray, scale: float = 1.0
) -> None:
    scores = ensemble.scores(rows)
    apart = np.abs(scores - np.asarray(raw, np.float64).reshape(scores.shape) * scale)
    assert (apart <= ensemble.rounding()).all()


def classes_of(ensemble: Ensemble, rows: FloatArray) -> list[int] | None:
    scores = ensemble.scores(rows)
    if ensemble.decides == "not":
        return None
    is_above = scores[:, 0] > 0
    classes = is_above if ensemble.decides == "above" else scores.argmax(axis=1)
    return [int(each) for each in classes]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("options", XGBOOST, ids=str)
def test_a_file_of_xgboost_has_its_margins(options: dict[str, Any], kind: Rows) -> None:
    content = xgboost_file(**options)
    import xgboost

    ensemble = from_xgboost(content, "m.json")
    rows = rows_at_cuts(ensemble, kind)
    booster = xgboost.Booster({"nthread": 1}, model_file=bytearray(content))
    assert_same(
        ensemble, booster.predict(xgboost.DMatrix(rows), output_margin=True), rows
    )
    program, run = run_xgboost(content, ensemble)
    assert program == f"xgboost {xgboost.__version__}"
    assert run is not None
    answers = run(rows, kind)
    width = 2 if ensemble.decides == "above" else len(ensemble.base)
    assert answers.numbers.shape == (ROWS, width)
    shown = None if answers.classes is None else answers.classes.tolist()
    assert shown == classes_of(ensemble, rows)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("options", LIGHTGBM, ids=str)
def test_a_file_of_lightgbm_has_its_raw_scores(
    options: dict[str, Any], kind: Rows
) -> None:
    content = lightgbm_file(**options)
    import lightgbm

    ensemble = from_lightgbm(content, "m.txt")
    rows = rows_at_cuts(ensemble, kind)
    raw = lightgbm.Booster(model_str=content.decode()).predict(
        rows.astype(kind), raw_score=True, num_threads=1
    )
    # The raw score of a forest is the sum, though its prediction is the mean.
    share = 1 / ROUNDS if options.get("boosting") == "rf" else 1.0
    assert_same(ensemble, raw, rows, share * options.get("sigmoid", 1.0))
    program, run = run_lightgbm(content, ensemble)
    assert program == f"lightgbm {lightgbm.__version__}"
    assert run is not None
    answers = run(rows, kind)
    shown = None if answers.classes is None else answers.classes.tolist()
    assert shown == classes_of(ensemble, rows)
    scores = ensemble.scores(rows)
    if ensemble.link == "logistic":
        likely = 1 / (1 + np.exp(-scores))
        scores = np.concatenate([1 - likely, likely], axis=1)
    elif ensemble.link == "softmax":
        scores = np.exp(scores) / np.exp(scores).sum(axis=1, keepdims=True)
    assert answers.numbers == pytest.approx(scores, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_any_threshold_and_any_way_of_missing_values_is_read(kind: Rows) -> None:
    draw = np.random.default_rng(0)
    near = [
        float(np.nextafter(way * ZERO, to)) for way in (1, -1) for to in (-1.0, 1.0)
    ]
    thresholds = [*PLACES, *near, -0.0, 5e-324, -5e-324, np.inf, -np.inf]
    text = re.sub("tree_sizes=.*\n", "", lightgbm_file(objective="regression").decode())
    text = re.sub(
        "threshold=(.*)",
        lambda line: (
            "threshold="
            + " ".join(repr(float(draw.choice(thresholds))) for _ in line[1].split())
        ),
        text,
    )
    text = re.sub(
        "decision_type=(.*)",
        lambda line: (
            "decision_type="
            + " ".join(str(draw.choice([0, 2, 4, 6, 8, 10])) for _ in line[1].split())
        ),
        text,
    )
    ensemble = from_lightgbm(text.encode(), "m.txt")
    _, run = run_lightgbm(text.encode(), ensemble)
    assert run is not None
    rows = rows_at_cuts(ensemble, kind)
    assert_same(ensemble, run(rows, kind).numbers, rows)


def test_files_of_old_versions_of_xgboost_are_read() -> None:
    model = json.loads(xgboost_file(objective="binary:logistic"))
    model["version"] = [1, 4, 0]
    model["learner"]["learner_model_param"] = {
        "base_score": "2.5E-1",
        "num_class": "0",
        "num_feature": "5",
    }
    for tree in model["learner"]["gradient_booster"]["model"]["trees"]:
        tree["default_left"] = [way == 1 for way in tree["default_left"]]
        del tree["split_type"]
    ensemble = from_xgboost(json.dumps(model).encode(), "m.json")
    assert ensemble.base == pytest.approx([-np.log(3.0)], rel=1e-7)
    first = from_xgboost(xgboost_file(objective="binary:logistic"), "m.json")
    rows = rows_at_cuts(first, "float32")
    apart = (ensemble.scores(rows) - first.scores(rows)).ravel()
    assert apart == pytest.approx(np.full(ROWS, ensemble.base - first.base), abs=1e-12)


def test_the_last_of_two_keys_counts_as_in_xgboost() -> None:
    content = xgboost_file(objective="reg:squarederror")
    twice = content.replace(b'"base_score":', b'"base_score":"[9E0]","base_score":')
    assert len(twice) > len(content)
    ensemble = from_xgboost(twice, "m.json")
    rows = rows_at_cuts(ensemble, "float32")
    _, run = run_xgboost(twice, ensemble)
    assert run is not None
    assert_same(ensemble, run(rows, "float32").numbers, rows)


def test_a_round_at_which_xgboosts_classes_stop_is_remarked() -> None:
    model = json.loads(xgboost_file(objective="reg:squarederror"))
    model["learner"]["attributes"]["best_iteration"] = "3"
    model["learner"]["feature_names"] = list("abcde")
    ensemble = from_xgboost(json.dumps(model).encode(), "m.json")
    assert ensemble.columns == list("abcde")
    assert ensemble.remarks == [
        "m.json: all rounds are compared; XGBoost's scikit-learn classes stop after "
        "round 3, counted from 0"
    ]


@pytest.mark.parametrize("power", range(-60, -15))
@pytest.mark.parametrize("sign", [1, -1])
def test_a_class_changes_at_most_the_slack_away_from_its_tie(
    power: int, sign: int
) -> None:
    score = sign * 2.0**power
    text = lightgbm_file(objective="binary", min_data_in_leaf=1_000).decode()
    text = re.sub("tree_sizes=.*\n", "", text)
    text = re.sub("leaf_value=.*", f"leaf_value={score!r}", text)
    model = json.loads(xgboost_file(objective="binary:logistic", gamma=1e9))
    model["learner"]["learner_model_param"]["base_score"] = "[5E-1]"
    for tree in model["learner"]["gradient_booster"]["model"]["trees"]:
        assert tree["left_children"] == [-1]
        tree["split_conditions"] = [score / ROUNDS]
    pairs = (
        (text.encode(), from_lightgbm, run_lightgbm),
        (json.dumps(model).encode(), from_xgboost, run_xgboost),
    )
    for content, read, runs in pairs:
        ensemble = read(content, "m")
        _, run = runs(content, ensemble)
        assert run is not None
        classes = run(np.zeros((1, 5)), "float64").classes
        assert classes is not None
        is_near = abs(score) <= ensemble.label_slack
        assert is_near or classes.tolist() == [int(score > 0)]


# Files that contradict themselves, written without the libraries


def small_xgboost(**changes: Any) -> bytes:
    """Return a file of one split; a change is a path with dots, and its value."""
    model: dict[str, Any] = {
        "learner": {
            "attributes": {},
            "feature_names": [],
            "gradient_booster": {
                "name": "gbtree",
                "model": {
                    "tree_info": [0],
                    "trees": [
                        {
                            "left_children": [1, -1, -1],
                            "right_children": [2, -1, -1],
                            "split_indices": [0, 0, 0],
                            "split_conditions": [0.5, -1.0, 1.0],
                            "default_left": [0, 0, 0],
                            "split_type": [0, 0, 0],
                            "tree_param": {"size_leaf_vector": "1"},
                        }
                    ],
                },
            },
            "learner_model_param": {"base_score": "[0E0]", "num_feature": "2"},
            "objective": {"name": "reg:squarederror"},
        }
    }
    learner = model["learner"]
    places = {
        "objective": learner["objective"],
        "booster": learner["gradient_booster"],
        "model": learner["gradient_booster"]["model"],
        "tree": learner["gradient_booster"]["model"]["trees"][0],
        "param": learner["learner_model_param"],
        "learner": learner,
    }
    for path, value in changes.items():
        place, _, key = path.partition("__")
        places[place][key] = value
    return json.dumps(model).encode()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"objective__name": "reg:gamma"}, "the objective 'reg:gamma' is not read"),
        ({"booster__name": "gblinear"}, "the booster 'gblinear' is not read"),
        (
            {"objective__name": "multi:softprob"},
            "'multi:softprob' with 1 outputs is not read",
        ),
        (
            {"objective__name": "binary:logistic", "param__num_target": "3"},
            "'binary:logistic' with 3 outputs is not read",
        ),
        (
            {"booster__name": "dart", "booster__gbtree": None},
            "the booster 'dart' is not read",
        ),
        (
            {"model__tree_info": [0, 0]},
            "has 1 trees, 2 numbers of scores and 1 weights; there must be as many of "
            "each, and a tree",
        ),
        (
            {"model__trees": [], "model__tree_info": []},
            "has 0 trees, 0 numbers of scores and 0 weights; there must be as many of "
            "each, and a tree",
        ),
        ({"model__tree_info": [1]}, "a tree adds to score 1 of 1, counted from 0"),
        ({"learner__feature_names": ["a"]}, "has 1 names of 2 columns"),
        (
            {"param__num_feature": "1000000000000"},
            "a model of 1,000,000,000,000 columns and 1 scores is not read",
        ),
        (
            {"param__num_target": "1000000000000"},
            "a model of 2 columns and 1,000,000,000,000 scores is not read",
        ),
        (
            {"param__base_score": "[1E0,2E0]"},
            "the base_score '[1E0,2E0]' does not fit 'reg:squarederror' with 1 outputs",
        ),
        (
            {"param__base_score": "1E300"},
            "the base_score '1E300' does not fit 'reg:squarederror' with 1 outputs",
        ),
        (
            {"param__base_score": "1E0", "objective__name": "binary:logistic"},
            "the base_score '1E0' does not fit 'binary:logistic' with 1 outputs",
        ),
        (
            {"param__base_score": "NaN"},
            "is no JSON model of XGBoost: JSON is malformed",
        ),
        (
            {"tree__left_children": [1, -1]},
            "the lists of a tree are empty or not equally long",
        ),
        (
            {"tree__left_children": [7, -1, -1]},
            "a tree leads to node 7 of 3, counted from 0",
        ),
        (
            {"tree__right_children": [-2, -1, -1]},
            "a tree leads to node -2 of 3, counted from 0",
        ),
        ({"tree__left_children": [0, -1, -1]}, "a path of a tree comes back to node 0"),
        ({"tree__left_children": [1 << 70, -1, -1]}, "an index in a tree is too large"),
        (
            {"tree__split_indices": [2, 0, 0]},
            "a tree tests column 2 of 2, counted from 0",
        ),
        (
            {"tree__split_conditions": [0.5, 1e39, 1.0]},
            "a leaf adds a number that is not finite",
        ),
        ({"tree__split_type": [1, 0, 0]}, "a tree that tests categories is not read"),
        (
            {"tree__tree_param": {"size_leaf_vector": "2"}},
            "a tree whose leaves are vectors is not read",
        ),
        (
            {"tree__default_left": [2, 0, 0]},
            "is no JSON model of XGBoost: Expected `bool`, got `int`",
        ),
    ],
)
def test_a_file_of_xgboost_that_is_not_read_is_one_sentence(
    changes: dict[str, Any], message: str
) -> None:
    assert from_xgboost(small_xgboost(), "m.json").leaf_count == 2
    with pytest.raises(ReadError) as refusal:
        from_xgboost(small_xgboost(**changes), "m.json")
    shown = str(refusal.value)
    if "JSON" in message:  # the rest is msgspec's
        shown = shown[: len("m.json: ") + len(message)]
    assert shown == f"m.json: {message}"


SMALL = """tree
version=v4
num_class=1
num_tree_per_iteration=1
max_feature_idx=1
objective=regression
feature_names=a b

Tree=0
num_leaves=2
num_cat=0
split_feature=0
threshold=0.5
decision_type=2
left_child=-1
right_child=-2
leaf_value=-1 1
is_linear=0

end of trees
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("tree\nversion", "forest\nversion", None),
        ("\nend of trees", "", None),
        ("\nTree=0", "", None),
        ("a b", "a b\ntree_sizes=17", "its trees are not as long as tree_sizes says"),
        ("version=v4", "num_class=1", "'num_class' stands twice"),
        ("num_cat=0", "num_leaves=2", "'num_leaves' stands twice"),
        ("=regression", "=poisson", "the objective 'poisson' is not read"),
        (
            "=regression",
            "=regression sqrt",
            "the objective 'regression sqrt' is not read",
        ),
        (
            "=regression",
            "=multiclass num_class:1",
            "'multiclass' with 1 trees in each round is not read",
        ),
        ("=regression", "=binary sigmoid:x", "sigmoid has a word that is no number"),
        ("=regression", "=binary margin:1", "sigmoid has 0 numbers; 1 would be right"),
        (
            "num_class=1",
            "num_class=7",
            "1 trees are no rounds of 1, one for each of '7' classes or outputs",
        ),
        (
            "max_feature_idx=1",
            "max_feature_idx=99999999",
            "a model of 100,000,000 columns and 1 scores is not read",
        ),
        (
            "idx=1",
            "idx=1" + "0" * 5_000,
            "max_feature_idx has a word that is no number",
        ),
        ("names=a b", "names=a", "has 1 names of 2 columns"),
        ("num_cat=0", "num_cat=1", "a tree that tests categories is not read"),
        ("is_linear=0", "is_linear=1", "a tree with linear leaves is not read"),
        (
            "num_leaves=2",
            "num_leaves=1000000000000",
            "leaf_value has 2 numbers; 1000000000000 would be right",
        ),
        (
            "num_leaves=2",
            "num_leaves=-2",
            "leaf_value has 2 numbers; -2 would be right",
        ),
        ("-1 1", "-1 nan", "a leaf adds a number that is not finite"),
        ("-1 1", "-1 1_0", "leaf_value has a word that is no number"),
        ("=0.5", "=nan", "a cut is NaN"),
        ("=0.5", "=0x10", "threshold has a word that is no number"),
        ("feature=0", "feature=2", "a tree tests column 2 of 2, counted from 0"),
        (
            "feature=0",
            "feature=" + "9" * 30,
            "split_feature has a word that is no number",
        ),
        ("left_child=-1", "left_child=0", "a path of a tree comes back to node 0"),
        ("=-2", "=-3", "a child of a node, -3, is not in the tree"),
        (
            "type=2",
            "type=1",
            "a decision_type that is not 0, 2, 4, 6, 8 or 10 is not read",
        ),
    ],
)
def test_a_file_of_lightgbm_that_is_not_read_is_one_sentence(
    old: str, new: str, message: str | None
) -> None:
    assert from_lightgbm(SMALL.encode(), "m.txt").columns == ["a", "b"]
    assert SMALL.count(old) == 1
    with pytest.raises(ReadError) as refusal:
        from_lightgbm(SMALL.replace(old, new).encode(), "m.txt")
    lines = "the lines 'tree', 'Tree=0' and 'end of trees'"
    no_model = f"is no whole text model of LightGBM, which has {lines}"
    assert str(refusal.value) == f"m.txt: {message or no_model}"


@pytest.mark.parametrize("read", [from_xgboost, from_lightgbm])
@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xff",
        b"null",
        b"[" * 100_000,
        b'{"learner":' * 100_000,
        b"tree\nTree=\xff",
    ],
    ids=lambda content: repr(content[:12]),
)
def test_what_is_no_model_is_one_sentence(
    read: Callable[[bytes, str], Ensemble], content: bytes
) -> None:
    with pytest.raises(ReadError, match=r"\Am: is no [^\n]*\Z"):
        read(content, "m")


@pytest.mark.parametrize("read", [from_xgboost, from_lightgbm])
def test_a_file_that_was_cut_is_refused(read: Callable[[bytes, str], Ensemble]) -> None:
    content = small_xgboost() if read is from_xgboost else SMALL.strip().encode()
    for length in range(0, len(content), 7):
        with pytest.raises(ReadError):
            read(content[:length], "m")


def test_too_many_numbers_in_leaves_are_refused() -> None:
    size = 20_001
    tree = {
        "tree__left_children": [1] + [-1] * (size - 1),
        "param__num_target": "10000",
    }
    with pytest.raises(ReadError) as refusal:
        from_xgboost(small_xgboost(**tree), "m")
    assert str(refusal.value) == (
        "m: a model of 20,001 leaves with 10,000 scores each is not read"
    )


def test_what_the_library_does_not_load_is_one_sentence() -> None:
    pytest.importorskip("xgboost")
    pytest.importorskip("lightgbm")
    content = small_xgboost()
    with pytest.raises(ReadError, match=r"\Am: XGBoost does not load it: [^\n\[]*\Z"):
        run_xgboost(content, from_xgboost(content, "m"))
    with pytest.raises(ReadError) as refusal:
        run_lightgbm(SMALL.encode(), from_lightgbm(SMALL.encode(), "m"))
    assert str(refusal.value) == (
        "m: LightGBM does not load it: Model file doesn't specify the label index"
    )


def test_without_the_library_nothing_is_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xgboost", None)
    monkeypatch.setitem(sys.modules, "lightgbm", None)
    ensemble = from_lightgbm(SMALL.encode(), "m")
    missing = "which is not installed"
    assert run_xgboost(b"", ensemble) == (f"xgboost, {missing}", None)
    assert run_lightgbm(b"", ensemble) == (f"lightgbm, {missing}", None)
