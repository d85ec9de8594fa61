"""A decision tree of scikit-learn as a tree of ours: the same answer at every double.

Scikit-learn rounds every value to a float of 32 bits before it compares it with a
threshold of 64: it goes left where `float32(x) <= threshold`. That is `x <= cut` for
one double, the largest that is still rounded to a float that is not above the threshold
(`numerics.cuts_of_rounded`). So our tree needs no rounding, and answers alike.

Each node has a direction for missing values. Our tree has a value for each column that
stands for a missing one, and reads directions that one value takes (`_stand_ins`). A
node that separates missing values from all others has the threshold infinity; ours has
a cut at 2**127 instead, below which all other values are.

Scalers before the tree are folded into its cuts: a cut becomes the largest double that
they bring to it or below (`_folded`).

The library itself is not imported: what is read are the arrays of a fitted tree.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np

from fuzzytree.errors import LossError
from fuzzytree.model import (
    MOST_MIXED,
    MOST_PROBABILITIES,
    PARTS,
    Band,
    Branch,
    FloatArray,
    FuzzyTree,
    IntArray,
    LabelType,
    Leaf,
    Node,
    Probabilities,
    Semantics,
    Term,
    Variable,
    interval_names,
    label_type_of,
    name_choice,
)
from fuzzytree.numerics import cuts_of_rounded

_LARGEST = np.finfo(np.float64).max
_SCALERS = ("StandardScaler", "MinMaxScaler", "MaxAbsScaler", "RobustScaler")
_MISSING = 2.0**127  # the cut above which a value counts as missing


def from_sklearn(
    classifier: object,
    *,
    columns: Sequence[str] | None = None,
    classes: Sequence[str] | None = None,
    soft: float | Mapping[str, float] | None = None,
    spreads: Iterable[float] | None = None,
    name: str = "scikit-learn tree",
    missing: str | None = None,
) -> FuzzyTree:
    """Return a fitted `DecisionTreeClassifier`, alone or after scalers, as a tree.

    Its answers are those of `predict` at every finite double; a node that tests
    whether a value is missing takes those above 2**127 (1.7e38) for missing too. Rules
    made from it (`fuzzytree.rules_from_tree`) are crisp, with strengths of 0 and 1;
    `soft` gives them flanks, which changes no decision.

    Its probabilities are those of `predict_proba`, weights of classes included, in
    whole millionths: each is less than a millionth off. With `soft` they are the mean
    of all leaves, weighted by strength, so they change smoothly beside a cut. A tree of
    more than 16,384 leaves, or of more than 1,048,576 leaves times classes, has none.

    A row with missing values is answered as `predict` does, along the directions of
    the nodes, in each column where one value takes the same directions: that value
    stands for a missing one. A column where no value does so answers "no class" if
    its directions are the library's habit, the child with more rows at each node, and
    is refused if they were learnt.

    A `Pipeline` may have scalers before the tree: StandardScaler, MinMaxScaler,
    MaxAbsScaler and RobustScaler. The cuts are in the columns' own units then, and the
    answers those of the pipeline for rows of doubles.

    Args:
        classifier: A fitted tree with one output, or a pipeline that ends with it.
        columns: The name of each column that it was fitted on; its own names unless
            given, and without those x1, x2, ...
        classes: The name of each class, in the order of `classes_`; as they are
            written unless given.
        soft: Over what width beside a cut the degree falls in a line from 1 to 0: a
            number of spreads of each column, or a width for each column that the tree
            tests, in the column's own unit.
        spreads: The spread of each column, such as `X.std(axis=0)`, if `soft` is a
            number.
        name: The tree's name.
        missing: The class of each row with a missing value, instead of directions.

    Raises:
        TypeError: If it is no decision tree for classes, such as a forest or a
            regressor.
        ValueError: If it is not fitted, or names or widths do not fit.
        LossError: If it has several outputs, or has learnt directions of missing
            values that no single value takes; if a pipeline has another step, or a
            scaler that clips.

    Example:
        >>> from sklearn.tree import DecisionTreeClassifier
        >>> grown = DecisionTreeClassifier().fit([[0.0], [1.0]], ["soft", "firm"])
        >>> print(from_sklearn(grown, columns=["force"]))
        force? (cut at 0.5)
          low: soft [1]
          high: firm [2]
    """
    last, scalers = _last_step(classifier)
    grown = _grown(last)
    named = _Names.of(grown, [*scalers.values(), grown][0], columns, classes)
    arrays = _Arrays.of(grown.tree_, len(named.classes))
    used = arrays.used(named)
    if scalers:
        arrays = _folded(arrays, scalers, len(named.columns))
    widths = _widths(used, named, soft, spreads)
    instead = {} if missing is not None else _stand_ins(arrays, named)
    nodes, leaves = _nodes(arrays, named)
    terms = _with_terms(nodes, widths)
    inputs = [column for column in named.columns if column in terms]
    return FuzzyTree(
        name=name,
        classes=named.classes,
        variables=tuple(
            Variable(column, terms[column], missing=instead.get(used[column]))
            for column in inputs
        ),
        nodes=tuple(_named(nodes)),
        leaves=leaves,
        semantics=Semantics(
            missing=missing,
            sharpness=1 if arrays.shares else msgspec.UNSET,
            label_type=named.label_type,
        ),
        columns=named.columns,
    )


def _kinds(thing: object) -> list[str]:
    """Return the names of the library's classes that an object belongs to."""
    parents = [c for c in type(thing).__mro__ if c.__module__.startswith("sklearn.")]
    return [parent.__name__ for parent in parents]


def _last_step(classifier: Any) -> tuple[object, dict[str, Any]]:
    """Return the last step of a pipeline, and the scalers before it by name."""
    if "Pipeline" not in _kinds(classifier):
        return classifier, {}
    *before, (_, last) = classifier.steps
    scalers = {n: step for n, step in before if step not in (None, "passthrough")}
    for name, step in scalers.items():
        kind = type(step).__name__
        where = f"cannot read a Pipeline with the step {name!r}, a {kind}"
        if kind not in _SCALERS or kind not in _kinds(step):
            raise LossError(f"{where}: before a tree stand {', '.join(_SCALERS)}")
        if getattr(step, "clip", False):
            raise LossError(f"{where} that clips: it needs clip=False")
        if not hasattr(step, "n_features_in_"):
            raise ValueError(f"the {kind} is not fitted")
    return last, scalers


def _grown(classifier: object) -> Any:
    """Return a classifier that can be read, or say why it cannot."""
    kind = type(classifier).__name__
    if "DecisionTreeClassifier" not in _kinds(classifier):
        raise TypeError(
            f"from_sklearn reads a DecisionTreeClassifier, and not a {kind}"
        )
    if not hasattr(classifier, "tree_"):
        raise ValueError(f"the {kind} is not fitted")
    grown: Any = classifier
    if grown.n_outputs_ != 1:
        raise LossError(
            f"cannot read a {kind} with {grown.n_outputs_} outputs: a tree has one"
        )
    return grown


class _Names(NamedTuple):
    """What columns and classes are called."""

    columns: tuple[str, ...]
    classes: tuple[str, ...]
    label_type: LabelType | msgspec.UnsetType

    @staticmethod
    def of(
        grown: Any,
        first_step: Any,
        columns: Sequence[str] | None,
        classes: Sequence[str] | None,
    ) -> _Names:
        count = int(grown.n_features_in_)
        own = getattr(first_step, "feature_names_in_", None)
        if columns is None and own is not None:
            columns = [str(one) for one in own]
        if columns is None:
            columns = [f"x{number}" for number in range(1, count + 1)]
        labels = grown.classes_.tolist()
        results = [str(one) for one in labels]
        for what, value, needed in (
            ("columns", columns, count),
            ("classes", classes or results, len(results)),
        ):
            if len(value) != needed:
                raise ValueError(f"{len(value)} names for {needed} {what}")
        if classes is not None:
            return _Names(tuple(columns), tuple(classes), msgspec.UNSET)
        return _Names(tuple(columns), tuple(results), label_type_of(labels))


class _Arrays(NamedTuple):
    """A fitted tree: for each node its children (-1: none), column, cut and so on."""

    left: list[int]
    right: list[int]
    column: list[int]
    cut: list[float]
    sends_left: list[bool]  # a missing value
    winner: list[int]
    support: list[int]
    shares: list[tuple[float, ...]]  # none without probabilities

    @staticmethod
    def of(tree: Any, classes: int) -> _Arrays:
        left = tree.children_left.tolist()
        values = tree.value[:, 0, :]
        leaves = left.count(-1)
        has_shares = leaves <= MOST_MIXED and leaves * classes <= MOST_PROBABILITIES
        return _Arrays(
            left,
            tree.children_right.tolist(),
            tree.feature.tolist(),
            np.where(
                np.isfinite(tree.threshold), cuts_of_rounded(tree.threshold), _MISSING
            ).tolist(),
            tree.missing_go_to_left.astype(bool).tolist(),
            np.argmax(values, axis=1).tolist(),
            tree.n_node_samples.tolist(),
            # Negative weights of rows, which scikit-learn admits, are no shares.
            _shares(values) if has_shares and values.min() >= 0.0 else [],
        )

    def learnt(self, place: int) -> bool:
        """Return whether a node sends missing values elsewhere than without any."""
        left, right = self.left[place], self.right[place]
        return self.sends_left[place] != (self.support[left] > self.support[right])

    def used(self, named: _Names) -> dict[str, int]:
        """Return the columns that nodes test, and their indices."""
        places = sorted(
            {c for c, start in zip(self.column, self.left, strict=True) if start >= 0}
        )
        return {named.columns[place]: place for place in places}


def _folded(arrays: _Arrays, scalers: Mapping[str, Any], width: int) -> _Arrays:
    """Return a tree with cuts for values before they are scaled.

    A cut becomes the largest double that is not scaled above it. Rounding keeps the
    order of numbers, so all are bisected together, by their places among all doubles.
    """
    nodes = [n for n, start in enumerate(arrays.left) if start >= 0]
    nodes = [n for n in nodes if arrays.cut[n] != _MISSING]
    nodes.sort(key=arrays.column.__getitem__)
    columns = np.array([arrays.column[n] for n in nodes], dtype=np.int64)
    bars = np.array([arrays.cut[n] for n in nodes])
    steps = [_scale(name, scaler, columns) for name, scaler in scalers.items()]
    rows = np.arange(len(nodes)) - np.searchsorted(columns, columns)
    table = np.zeros((int(rows.max(initial=0)) + 1, width))
    high = np.full(len(nodes), _LARGEST).view(np.int64)
    low = -high
    while (low < high).any():
        middle = (low | high) - ((low ^ high) >> 1)
        table[rows, columns] = _doubles(middle)
        values = table
        for step in steps:
            values = step(values)
        is_above = values[rows, columns] > bars
        low = np.where(is_above, low, middle)
        high = np.where(is_above, middle - 1, high)
    cuts = arrays.cut.copy()
    for node, cut in zip(nodes, _doubles(low).tolist(), strict=True):
        cuts[node] = cut
    return arrays._replace(cut=cuts)


def _doubles(places: IntArray) -> FloatArray:
    """Return the doubles at places counted from 0.0."""
    return np.copysign(np.abs(places).view(np.float64), places)


def _scale(name: str, scaler: Any, columns: IntArray) -> Callable[..., FloatArray]:
    """Return what a scaler does to rows, with results beyond all doubles clipped."""
    if scaler.scale_ is not None and not (scaler.scale_[columns] > 0.0).all():
        raise LossError(
            f"cannot read a Pipeline whose step {name!r} does not increase with a "
            "column: its scale_ must be above 0"
        )
    nameless = copy.copy(scaler)
    vars(nameless).pop("feature_names_in_", None)  # arrays have none, it would warn

    def scale(values: FloatArray) -> FloatArray:
        with np.errstate(over="ignore"):
            scaled: FloatArray = np.asarray(nameless.transform(values.copy()))
        return scaled.clip(-_LARGEST, _LARGEST)

    return scale


def _shares(values: FloatArray) -> list[tuple[float, ...]]:
    """Return shares in whole millionths, rounded down or up so that their sum is 1."""
    parts = values / values.sum(axis=1, keepdims=True) * PARTS
    whole = np.floor(parts)
    rank = np.argsort(np.argsort(whole - parts, axis=1, kind="stable"), axis=1)
    whole += rank < PARTS - whole.sum(axis=1, keepdims=True)
    return [tuple(row) for row in (whole / PARTS).tolist()]


def _stand_ins(arrays: _Arrays, named: _Names) -> dict[int, float]:
    """Return a value for each column that goes where a missing value goes.

    It must do so at each node that a row without a value of the column can reach: at
    most the cuts of those that send it left, above the cuts of the others.

    Raises:
        LossError: If there is none, and the directions were learnt. A node that saw no
            missing value sends them to the child with more rows. Another direction was
            learnt; one that happens to be the same cannot be distinguished.
    """
    nodes: dict[int, list[int]] = {}
    todo: list[tuple[int, frozenset[int]]] = [(0, frozenset())]
    while todo:
        place, out_of_reach = todo.pop()
        if arrays.left[place] < 0:
            continue
        column, aside = arrays.column[place], out_of_reach
        if column not in out_of_reach:
            nodes.setdefault(column, []).append(place)
            aside = out_of_reach | {column}
        ways = [arrays.left[place], arrays.right[place]]
        if not arrays.sends_left[place]:
            ways.reverse()
        todo.extend(zip(ways, (out_of_reach, aside), strict=True))
    values: dict[int, float] = {}
    for column, places in nodes.items():
        above = [arrays.cut[p] for p in places if not arrays.sends_left[p]]
        below = [arrays.cut[p] for p in places if arrays.sends_left[p]]
        low, high = max(above, default=-math.inf), min(below, default=math.inf)
        value = _between(low, high)
        if low < value <= high:
            values[column] = value
        elif any(arrays.learnt(place) for place in places):
            raise LossError(
                "cannot read a tree that learnt where missing values of "
                f"{named.columns[column]!r} go: no single value goes there at all "
                "nodes; missing= gives rows with missing values a class instead"
            )
    return values


def _between(low: float, high: float) -> float:
    """Return a number above `low`, up to `high`, and not close to either if it can."""
    if math.isinf(low):
        return high - (abs(high) / 2.0 or 1.0)
    if math.isinf(high):
        return low + (abs(low) / 2.0 or 1.0)
    middle = low / 2.0 + high / 2.0
    return middle if low < middle else high


def _widths(
    used: Mapping[str, int],
    named: _Names,
    soft: float | Mapping[str, float] | None,
    spreads: Iterable[float] | None,
) -> dict[str, float | None]:
    """Return how wide the flanks on each column are."""
    if soft is None:
        return dict.fromkeys(used)
    if isinstance(soft, Mapping):
        for column in soft:
            if column not in named.columns:
                choice = name_choice(column, named.columns)
                raise ValueError(f"soft: no column {column!r}; {choice}")
        for column in used:
            if column not in soft:
                raise ValueError(f"soft: no width for {column!r}, which the tree tests")
        widths = {column: float(soft[column]) for column in used}
    elif spreads is None:
        raise ValueError(
            "soft is a number of spreads: give spreads=X.std(axis=0) too, or a width "
            "for each column"
        )
    else:
        listed = [float(spread) for spread in spreads]  # a pandas series has an index
        if len(listed) != len(named.columns):
            raise ValueError(f"{len(listed)} spreads for {len(named.columns)} columns")
        widths = {column: soft * listed[place] for column, place in used.items()}
    for column, width in widths.items():
        if not (math.isfinite(width) and width > 0.0):
            raise ValueError(
                f"the width beside a cut of {column!r} must be above 0, not {width!r}"
            )
    return {**widths}


class _Bare(NamedTuple):
    """A node without the names of its terms."""

    variable: str
    cut: float
    ends: list[tuple[int | None, int | None]]


def _nodes(arrays: _Arrays, named: _Names) -> tuple[list[_Bare], tuple[Leaf, ...]]:
    """Return nodes and leaves, numbered in depth-first order from 1."""
    nodes: list[_Bare] = []
    leaves: list[Leaf] = []
    todo: list[tuple[int, _Bare | None]] = [(0, None)]
    while todo:
        place, parent = todo.pop()
        if arrays.left[place] < 0:
            label = named.classes[arrays.winner[place]]
            shares: Probabilities = msgspec.UNSET
            if arrays.shares:
                shares = arrays.shares[place]
            support = arrays.support[place]
            leaves.append(Leaf(label, support=support, probabilities=shares))
            end: tuple[int | None, int | None] = (None, len(leaves))
        else:
            column = named.columns[arrays.column[place]]
            nodes.append(_Bare(column, arrays.cut[place], []))
            todo.append((arrays.right[place], nodes[-1]))
            todo.append((arrays.left[place], nodes[-1]))
            end = (len(nodes), None)
        if parent is not None:
            parent.ends.append(end)
    return nodes, tuple(leaves)


def _cut_names(nodes: Sequence[_Bare]) -> dict[tuple[str, float], tuple[str, str]]:
    """Return the names of the two terms of each cut."""
    names: dict[tuple[str, float], tuple[str, str]] = {}
    cuts: dict[str, list[float]] = {}
    for node in nodes:
        if node.cut == _MISSING:
            names[node.variable, node.cut] = ("present", "missing")
        elif node.cut not in cuts.setdefault(node.variable, []):
            cuts[node.variable].append(node.cut)
    for variable, some in cuts.items():
        for cut, (below, above) in zip(
            some, interval_names([[cut] for cut in some]), strict=True
        ):
            names[variable, cut] = (below, above)
    return names


def _with_terms(
    nodes: Sequence[_Bare], widths: Mapping[str, float | None]
) -> dict[str, tuple[Term, ...]]:
    """Return the terms of each column: two for each of its cuts."""
    terms: dict[str, list[Term]] = {}
    for (variable, cut), (below, above) in _cut_names(nodes).items():
        left = right = None
        width = widths[variable]
        if width is not None and cut != _MISSING:
            left, right = cut - width, cut + width
            if not left < cut < right or math.isinf(right - left):
                raise ValueError(
                    f"a width of {width!r} beside the cut of {variable!r} at {cut!r} "
                    "is no flank in doubles"
                )
        terms.setdefault(variable, []).extend(
            [
                Term(below, Band(high=cut, right=right)),
                Term(above, Band(low=cut, left=left)),
            ]
        )
    return {variable: tuple(some) for variable, some in terms.items()}


def _named(nodes: Sequence[_Bare]) -> list[Node]:
    names = _cut_names(nodes)
    return [
        Node(
            node.variable,
            (node.cut,),
            (0, 1),
            tuple(
                Branch((term,), node=number, leaf=leaf)
                for term, (number, leaf) in zip(
                    names[node.variable, node.cut], node.ends, strict=True
                )
            ),
        )
        for node in nodes
    ]
