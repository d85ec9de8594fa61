"""Boosted trees of XGBoost and LightGBM: their own files, and what runs those.

Reading needs neither library; the rules at the nodes are those of their predictors.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NoReturn

import msgspec
import numpy as np

from fuzzytree.ensembles.trees import (
    MOST_NUMBERS,
    MOST_SCORES,
    SINGLE,
    Ensemble,
    Rows,
    Tree,
)
from fuzzytree.errors import ReadError
from fuzzytree.model import FloatArray, IntArray
from fuzzytree.numerics import cuts_of_rounded

if TYPE_CHECKING:
    from fuzzytree.ensembles.programs import Answers

_MOST_COLUMNS = 1_000_000
_SINGLE_SLACK, _DOUBLE_SLACK = 2.0**-20, 2.0**-49  # of a probability rounded onto .5

# Objectives whose prediction is the sum.
_SUMS_OF_XGBOOST = re.compile(
    "reg:(squarederror|linear|absoluteerror|pseudohubererror|quantileerror|"
    "squaredlogerror)|rank:(pairwise|ndcg|map)"
)
_SUMS_OF_LIGHTGBM = re.compile(
    "custom|regression(_l1)?|huber|fair|quantile|mape|lambdarank|rank_xendcg"
)
_ZERO = float(np.float32(1e-35))  # LightGBM takes what is not larger for 0
_UNDER = float(np.nextafter(-_ZERO, -np.inf))


class _TreeSizes(msgspec.Struct):
    size_leaf_vector: int = 1


class _Nodes(msgspec.Struct):
    left_children: list[int]
    right_children: list[int]
    split_indices: list[int]
    split_conditions: list[float]
    default_left: list[bool]
    split_type: list[int] = []
    tree_param: _TreeSizes = msgspec.field(default_factory=_TreeSizes)


class _Trees(msgspec.Struct):
    trees: list[_Nodes] = []
    tree_info: list[int] = []


class _Booster(msgspec.Struct):
    name: str
    model: _Trees | None = None
    gbtree: _Booster | None = None  # of dart
    weight_drop: list[float] = []


class _Sizes(msgspec.Struct):
    base_score: str
    num_feature: int
    num_class: int = 0
    num_target: int = 1


class _Objective(msgspec.Struct):
    name: str


class _Learner(msgspec.Struct):
    learner_model_param: _Sizes
    gradient_booster: _Booster
    objective: _Objective
    feature_names: list[str] = []
    attributes: dict[str, str] = {}


class _Model(msgspec.Struct):
    learner: _Learner


def from_xgboost(content: bytes, name: str) -> Ensemble:
    """Read a model that XGBoost saved as JSON.

    Raises:
        ReadError: If it is no such file, contradicts itself, or does what is not read
            here.
    """
    try:
        # Sizes are texts in the file, and default_left is of 0 and 1, or of booleans.
        learner = msgspec.json.decode(content, type=_Model, strict=False).learner
        sizes = learner.learner_model_param
        start = msgspec.json.decode(sizes.base_score, type=float | list[float])
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise ReadError(f"{name}: is no JSON model of XGBoost: {error}") from error
    booster, objective = learner.gradient_booster, learner.objective.name
    inner = booster.gbtree if booster.name == "dart" else booster
    if booster.name not in ("gbtree", "dart") or inner is None or inner.model is None:
        _refuse(name, f"the booster {booster.name[:40]!r}")
    trees, scores = inner.model.trees, inner.model.tree_info
    count, width = max(sizes.num_class, sizes.num_target, 1), sizes.num_feature
    is_multiple = objective in ("multi:softprob", "multi:softmax")
    is_binary = objective == "binary:logistic"
    if not (is_binary or is_multiple or _SUMS_OF_XGBOOST.fullmatch(objective)):
        _refuse(name, f"the objective {objective[:60]!r}")
    if (is_multiple and sizes.num_class < 2) or (is_binary and count > 1):
        _refuse(name, f"{objective!r} with {count} outputs")
    weights = booster.weight_drop if booster.name == "dart" else [1.0] * len(trees)
    _check_sizes(name, sum(len(tree.left_children) for tree in trees), count, width)
    if not trees or not len(trees) == len(scores) == len(weights):
        raise ReadError(
            f"{name}: has {len(trees)} trees, {len(scores)} numbers of scores and "
            f"{len(weights)} weights; there must be as many of each, and a tree"
        )
    names = learner.feature_names
    if len(names) not in (0, width):
        raise ReadError(f"{name}: has {len(names)} names of {width} columns")
    with np.errstate(all="ignore"):
        base = np.atleast_1d(np.asarray(start).astype(np.float32))
        if is_binary:
            base = -np.log(np.float32(1.0) / base - np.float32(1.0))
    if len(base) not in (1, count) or not np.isfinite(base).all():
        raise ReadError(
            f"{name}: the base_score {sizes.base_score[:40]!r} does not fit "
            f"{objective!r} with {count} outputs"
        )
    return Ensemble(
        name,
        f"XGBoost {objective}",
        [
            _tree_of_xgboost(tree, score, weight, (count, width), name)
            for tree, score, weight in zip(trees, scores, weights, strict=True)
        ],
        np.zeros(count) + base,
        unit=SINGLE,
        takes="float32",
        takes_infinite=False,
        width=width,
        columns=names or None,
        remarks=[
            f"{name}: all rounds are compared; XGBoost's scikit-learn classes stop "
            f"after round {number[:20]}, counted from 0"
            for key, number in learner.attributes.items()
            if key == "best_iteration"
        ],
        **_decision(is_binary, is_multiple, _SINGLE_SLACK),
    )


def _tree_of_xgboost(
    nodes: _Nodes, score: int, weight: float, shape: tuple[int, int], name: str
) -> Tree:
    """Return a tree; a row goes left if its float of 32 bits is below the condition."""
    count, width = shape
    size = len(nodes.left_children)
    lists = (
        nodes.left_children,
        nodes.right_children,
        nodes.split_indices,
        nodes.split_type or [0] * size,
    )
    others = nodes.split_conditions, nodes.default_left
    if not size or any(len(each) != size for each in (*lists, *others)):
        raise ReadError(f"{name}: the lists of a tree are empty or not equally long")
    if nodes.tree_param.size_leaf_vector > 1:
        _refuse(name, "a tree whose leaves are vectors")
    try:
        left, right, columns, kinds = (np.array(each, np.int64) for each in lists)
    except OverflowError as error:
        raise ReadError(f"{name}: an index in a tree is too large") from error
    is_leaf = left == -1
    left, right, columns = left[~is_leaf], right[~is_leaf], columns[~is_leaf]
    _check_within(np.concatenate([left, right]), size, "leads to node", name)
    _check_within(columns, width, "tests column", name)
    _check_within(np.array([score]), count, "adds to score", name)
    if kinds[~is_leaf].any():
        _refuse(name, "a tree that tests categories")
    with np.errstate(over="ignore", invalid="ignore"):
        numbers = np.array(nodes.split_conditions).astype(np.float32)
        below = np.nextafter(numbers[~is_leaf], np.float32(-np.inf)).astype(np.float64)
        added = numbers[is_leaf].astype(np.float64) * np.float64(np.float32(weight))
    places = np.where(is_leaf, -np.cumsum(is_leaf), np.cumsum(~is_leaf) - 1)
    values = np.zeros((len(added), count))
    values[:, score] = added
    return Tree.of(
        columns,
        cuts_of_rounded(below),
        np.array(nodes.default_left)[~is_leaf],
        places[left],
        places[right],
        values,
        int(places[0]),
        name=name,
    )


def from_lightgbm(content: bytes, name: str) -> Ensemble:
    """Read a model that LightGBM saved as text.

    Raises:
        ReadError: If it is no such file, contradicts itself, or does what is not read
            here.
    """
    try:
        text = content.decode()
    except UnicodeDecodeError as error:
        raise ReadError(f"{name}: is no text model of LightGBM: {error}") from error
    front, end, _ = text.partition("\nend of trees")
    head, *blocks = front.split("\nTree=")
    if not head.startswith("tree\n") or not end or not blocks:
        raise ReadError(
            f"{name}: is no whole text model of LightGBM, which has the lines 'tree', "
            "'Tree=0' and 'end of trees'"
        )
    fields = _fields(head, name)
    lengths = fields.get("tree_sizes", "").split()
    # LightGBM finds trees by these lengths, and not by their first lines.
    if lengths and lengths != [str(len("Tree=\n") + len(block)) for block in blocks]:
        raise ReadError(f"{name}: its trees are not as long as tree_sizes says")
    count = max(1, int(_numbers(fields, "num_tree_per_iteration", 1, int, name)[0]))
    width = int(_numbers(fields, "max_feature_idx", 1, int, name)[0]) + 1
    objective, *options = fields.get("objective", "").split() or ["custom"]
    is_binary, is_multiple = objective == "binary", objective == "multiclass"
    share = 1.0
    if is_binary and len(options) == 1:
        option, _, value = options[0].partition(":")
        share = float(_numbers({option: value}, "sigmoid", 1, float, name)[0])
    elif not is_multiple and (options or not _SUMS_OF_LIGHTGBM.fullmatch(objective)):
        _refuse(name, f"the objective {' '.join([objective, *options])[:60]!r}")
    if (is_multiple and count < 2) or (is_binary and count > 1):
        _refuse(name, f"{objective!r} with {count} trees in each round")
    if fields.get("num_class") != str(count) or len(blocks) % count:
        raise ReadError(
            f"{name}: {len(blocks)} trees are no rounds of {count}, one for each of "
            f"{fields.get('num_class', '')[:20]!r} classes or outputs"
        )
    trees = [_fields(block, name) for block in blocks]
    leaves = sum(1 + tree.get("leaf_value", "").count(" ") for tree in trees)
    _check_sizes(name, leaves, count, width)
    names = fields.get("feature_names", "").split()
    if len(names) != width:
        raise ReadError(f"{name}: has {len(names)} names of {width} columns")
    if "average_output" in fields:
        share /= len(blocks) // count
    is_named = names != [f"Column_{place}" for place in range(width)]
    return Ensemble(
        name,
        f"LightGBM {objective}",
        [
            _tree_of_lightgbm(tree, place % count, share, (count, width), name)
            for place, tree in enumerate(trees)
        ],
        np.zeros(count),
        width=width,
        columns=names if is_named else None,
        **_decision(is_binary, is_multiple, _DOUBLE_SLACK),
    )


def _tree_of_lightgbm(
    fields: Mapping[str, str],
    score: int,
    share: float,
    shape: tuple[int, int],
    name: str,
) -> Tree:
    """Return a tree of LightGBM, whose predictor takes very small numbers for 0.

    Each node says what is missing and takes the default way: nothing (NaN is 0), NaN
    and 0, or NaN. Where 0 takes another way than the numbers on both sides of it, a
    node becomes three.
    """
    if fields.get("is_linear", "0") != "0":
        _refuse(name, "a tree with linear leaves")
    if fields.get("num_cat", "0") != "0":
        _refuse(name, "a tree that tests categories")
    leaves = int(_numbers(fields, "num_leaves", 1, int, name)[0])
    added = _numbers(fields, "leaf_value", leaves, float, name)
    count = leaves - 1
    cuts = _numbers(fields, "threshold", count, float, name)
    columns, kinds, left, right = (
        _numbers(fields, key, count, int, name)
        for key in ("split_feature", "decision_type", "left_child", "right_child")
    )
    _check_within(columns, shape[1], "tests column", name)
    if not np.isin(kinds, (0, 2, 4, 6, 8, 10)).all():
        _refuse(name, "a decision_type that is not 0, 2, 4, 6, 8 or 10")
    is_left, missing = kinds & 2 > 0, kinds >> 2
    small = np.where(cuts >= 0, _ZERO, _UNDER)
    cuts = np.where(np.abs(cuts) <= _ZERO, small, cuts)
    is_split = (missing == 1) & np.where(is_left, cuts < _UNDER, cuts > _ZERO)
    moved = np.where(is_left, np.maximum(cuts, _ZERO), np.minimum(cuts, _UNDER))
    first = np.where(is_split, np.where(is_left, cuts, _UNDER), cuts)
    first = np.where((missing == 1) & ~is_split, moved, first)
    at = np.flatnonzero(is_split)
    second = count + np.arange(len(at))
    third = second + len(at)
    right_or_second = right.copy()
    right_or_second[at] = second
    lower, upper = np.where(is_left, _UNDER, _ZERO), np.where(is_left, _ZERO, cuts)
    values = np.zeros((leaves, shape[0]))
    values[:, score] = added * share
    return Tree.of(
        np.concatenate([columns, columns[at], columns[at]]),
        np.concatenate([first, lower[at], upper[at]]),
        np.concatenate(
            [np.where(missing == 0, cuts >= 0, is_left), ~is_left[at], is_left[at]]
        ),
        np.concatenate([left, right[at], left[at]]),
        np.concatenate([right_or_second, third, right[at]]),
        values,
        0 if count else -1,
        name=name,
    )


def _fields(text: str, name: str) -> dict[str, str]:
    """Return what stands before and after the first = of each line."""
    fields: dict[str, str] = {}
    for line in filter(None, text.split("\n")):
        key, _, value = line.partition("=")
        if key in fields:
            raise ReadError(f"{name}: {key[:40]!r} stands twice")
        fields[key] = value
    return fields


def _numbers(
    fields: Mapping[str, str], key: str, count: int, kind: type[float], name: str
) -> Any:
    """Return an array of so many numbers."""
    words = fields.get(key, "").split()
    if len(words) != count:
        text = f"{name}: {key} has {len(words)} numbers; {count} would be right"
        raise ReadError(text)
    try:
        if "_" in fields.get(key, ""):
            raise ValueError("1_0 is 10 in Python, and 1 in LightGBM")
        return np.array([kind(word) for word in words], np.dtype(kind))
    except (ValueError, OverflowError) as error:
        raise ReadError(f"{name}: {key} has a word that is no number") from error


def _refuse(name: str, what: str) -> NoReturn:
    raise ReadError(f"{name}: {what} is not read")


def _check_within(numbers: IntArray, size: int, what: str, name: str) -> None:
    wrong = numbers[(numbers < 0) | (numbers >= size)]
    if len(wrong):
        raise ReadError(f"{name}: a tree {what} {wrong[0]} of {size}, counted from 0")


def _check_sizes(name: str, leaves: int, count: int, width: int) -> None:
    if not (0 < width <= _MOST_COLUMNS and count <= MOST_SCORES):
        _refuse(name, f"a model of {width:,} columns and {count:,} scores")
    if leaves * count > MOST_NUMBERS:
        _refuse(name, f"a model of {leaves:,} leaves with {count:,} scores each")


def _decision(is_binary: bool, is_multiple: bool, slack: float) -> dict[str, Any]:
    """Return how outputs and classes come from scores."""
    if is_binary:
        return {"link": "logistic", "decides": "above", "label_slack": slack}
    if is_multiple:
        return {"link": "softmax", "decides": "largest", "label_slack": slack}
    return {}


def run_xgboost(
    content: bytes, ensemble: Ensemble
) -> tuple[str, Callable[[FloatArray, Rows], Answers] | None]:
    """Return the name of XGBoost, and what runs rows in it, if it is installed.

    Args:
        content: The file.
        ensemble: What was read of it.

    Raises:
        ReadError: If XGBoost does not load the file.
    """
    try:
        import xgboost
    except ImportError:
        return "xgboost, which is not installed", None
    try:
        booster = xgboost.Booster({"nthread": 1}, model_file=bytearray(content))
    except ValueError as error:
        raise _not_loaded(ensemble.name, "XGBoost", error) from error
    if ensemble.link == "softmax":  # with multi:softmax it answers classes alone
        booster.set_param({"objective": "multi:softprob"})

    def run(rows: FloatArray, kind: Rows) -> Answers:
        table = xgboost.DMatrix(rows.astype(kind), missing=np.nan, nthread=1)
        return _answers(booster.predict(table, validate_features=False), ensemble)

    return f"xgboost {xgboost.__version__}", run


def run_lightgbm(
    content: bytes, ensemble: Ensemble
) -> tuple[str, Callable[[FloatArray, Rows], Answers] | None]:
    """Return the name of LightGBM, and what runs rows in it, if it is installed.

    Args:
        content: The file.
        ensemble: What was read of it.

    Raises:
        ReadError: If LightGBM does not load the file.
    """
    try:
        import lightgbm
    except ImportError:
        return "lightgbm, which is not installed", None
    try:
        booster = lightgbm.Booster(model_str=content.decode())
    except lightgbm.basic.LightGBMError as error:
        raise _not_loaded(ensemble.name, "LightGBM", error) from error

    def run(rows: FloatArray, kind: Rows) -> Answers:
        return _answers(booster.predict(rows.astype(kind), num_threads=1), ensemble)

    return f"lightgbm {lightgbm.__version__}", run


def _not_loaded(name: str, program: str, error: Exception) -> ReadError:
    line = re.sub(r"^\[[\d:]+\] \S+: ", "", str(error).partition("\n")[0])  # a time
    return ReadError(f"{name}: {program} does not load it: {line}")


def _answers(numbers: Any, ensemble: Ensemble) -> Answers:
    """Return probabilities and classes, as the scikit-learn classes decide them."""
    from fuzzytree.ensembles.programs import Answers

    numbers = np.asarray(numbers)
    if ensemble.decides == "not":
        return Answers(numbers.astype(np.float64).reshape(len(numbers), -1), None)
    if ensemble.decides == "above":
        numbers = np.stack([1 - numbers, numbers], axis=1)
        classes: IntArray = (numbers[:, 1] > 0.5).astype(np.int64)
    else:
        classes = numbers.argmax(axis=1)
    return Answers(numbers.astype(np.float64), classes)
