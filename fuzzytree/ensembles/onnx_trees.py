"""Graphs of ONNX around one node of trees, read as onnxruntime computes them.

What onnxruntime does where the standard is silent was tried with graphs of one split,
for each number of classes, base values and signs of weights.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fuzzytree.ensembles.trees import (
    DOUBLE,
    MOST_NUMBERS,
    MOST_SCORES,
    SINGLE,
    Ensemble,
    Rows,
    Tree,
)
from fuzzytree.errors import MissingExtraError, ReadError, install_hint
from fuzzytree.model import FloatArray
from fuzzytree.numerics import cuts_of_rounded

if TYPE_CHECKING:
    import onnx

_TREES = ("TreeEnsemble", "TreeEnsembleClassifier", "TreeEnsembleRegressor")
_SILENT = ("Cast", "Identity", "ZipMap")  # after the trees; no number changes
_RUN = (
    *("Abs", "Add", "ArgMax", "ArrayFeatureExtractor", "Concat", "Div", "Exp"),
    *("Flatten", "Gather", "Greater", "Less", "MatMul", "Mul", "Neg", "Normalizer"),
    *("Reshape", "Sigmoid", "Slice", "Softmax", "Squeeze", "Sub", "Unsqueeze", "Where"),
)  # after the trees; they are run, and not read
_MODES = ["LEQ", "LT", "GTE", "GT", "EQ", "NEQ", "MEMBER"]  # of TreeEnsemble, by number


class NotOnnxError(ReadError):
    """A file of other content, or a part of one."""


class OnnxTrees(NamedTuple):
    """A graph that was read.

    Attributes:
        ensemble: What its trees compute.
        content: The file.
        entrance: The name of its input.
        label, output: The outputs with labels and with numbers, if there are such.
        unread: The nodes after the trees that are not part of the ensemble.
    """

    ensemble: Ensemble
    content: bytes
    entrance: str
    label: str | None
    output: str | None
    unread: Sequence[str]


def from_onnx(content: bytes, name: str) -> OnnxTrees:
    """Read a graph whose input goes to trees.

    Raises:
        ReadError: If it is no such graph, or does what is not read here; the message
            names the node.
        MissingExtraError: If onnx is not installed.
    """
    try:
        return _read(content, name)
    except ReadError:
        raise
    except (IndexError, KeyError, OverflowError, TypeError, ValueError) as error:
        # What onnx and numpy raise of parts that do not fit each other.
        raise ReadError(f"{name}: is no whole graph of trees: {error}") from error


def _read(content: bytes, name: str) -> OnnxTrees:
    """Read a graph whose parts fit each other."""
    graph = _graph(content, name)
    nodes = list(graph.node)
    ensembles = [node for node in nodes if node.op_type in _TREES]
    if len(ensembles) != 1 or len(graph.input) != 1:
        raise ReadError(
            f"{name}: {len(ensembles)} nodes of trees and {len(graph.input)} inputs; "
            "a graph with one of each is read"
        )
    node = ensembles[0]
    results = [result for each in nodes for result in each.output]
    if len(set(results)) < len(results):
        raise ReadError(f"{name}: two results have the same name")
    takes = _entrance(graph, node, name)
    after = [each for each in nodes if each is not node and not _is_before(each, graph)]
    for each in after:
        if each.op_type not in _SILENT and each.op_type not in _RUN:
            raise ReadError(
                f"{name}: the node {each.op_type!r} beside the trees is not read"
            )
    attributes = _attributes(node, name)
    if node.op_type == "TreeEnsemble":
        ensemble = _version_5(attributes, takes, name)
    else:
        ensemble = _versions_1_to_3(attributes, node.op_type, takes, name)
    ones = _ones(graph)
    unread = [
        each.op_type
        for each in after
        if each.op_type not in _SILENT
        and not (each.op_type == "Mul" and ones.intersection(each.input))
    ]
    label, output = _ends(graph)
    width = graph.input[0].type.tensor_type.shape.dim
    columns = width[1].dim_value if len(width) == 2 else 0
    ensemble = replace(ensemble, width=columns or None)
    if columns and ensemble.highest_column >= columns:
        raise ReadError(f"{name}: a tree tests column {ensemble.highest_column + 1} of "
                        f"{columns}")  # fmt: skip
    return OnnxTrees(ensemble, content, graph.input[0].name, label, output, unread)


def _graph(content: bytes, name: str) -> onnx.GraphProto:
    try:
        import onnx
    except ImportError as error:
        text = f"{name}: reading ONNX needs {install_hint('onnx')}"
        raise MissingExtraError(text) from error
    try:
        proto = onnx.load_from_string(content)
    except Exception as error:  # DecodeError of protobuf, which has no types
        raise NotOnnxError(f"{name}: is not an ONNX file") from error
    if proto.functions or any(
        each.data_location == onnx.TensorProto.EXTERNAL
        for each in proto.graph.initializer
    ):
        raise ReadError(f"{name}: functions and data in other files are not read")
    return proto.graph


def _ones(graph: onnx.GraphProto) -> set[str]:
    """Return the constants that are 1, by which onnxmltools multiplies."""
    from onnx import numpy_helper

    return {
        each.name
        for each in graph.initializer
        if list(each.dims) in ([], [1]) and numpy_helper.to_array(each) == 1
    }


def _is_before(node: onnx.NodeProto, graph: onnx.GraphProto) -> bool:
    return node.op_type == "Identity" and list(node.input) == [graph.input[0].name]


def _entrance(graph: onnx.GraphProto, node: onnx.NodeProto, name: str) -> Rows:
    """Return the number type of the rows, which go to the trees as they are."""
    from onnx import TensorProto

    start = graph.input[0]
    makers = {result: each for each in graph.node for result in each.output}
    at = node.input[0]
    if at in makers and _is_before(makers[at], graph):
        at = makers[at].input[0]
    if at != start.name:
        maker = makers[at].op_type if at in makers else "constant"
        raise ReadError(f"{name}: the node {maker!r} before the trees is not read")
    kind = start.type.tensor_type.elem_type
    if kind not in (TensorProto.FLOAT, TensorProto.DOUBLE):
        shown = TensorProto.DataType.Name(kind).lower() if kind else "no tensor"
        raise ReadError(f"{name}: its input is {shown}; float and double are read")
    return "float32" if kind == TensorProto.FLOAT else "float64"


def _attributes(node: onnx.NodeProto, name: str) -> dict[str, Any]:
    """Return what a node says, with lists of numbers as arrays."""
    from onnx import AttributeProto, numpy_helper

    values: dict[str, Any] = {}
    for each in node.attribute:
        if each.name in values:
            raise ReadError(f"{name}: {each.name} stands twice")
        if each.type == AttributeProto.TENSOR:
            values[each.name] = numpy_helper.to_array(each.t)
        elif each.type == AttributeProto.FLOATS:
            values[each.name] = np.array(each.floats, np.float32)
        elif each.type == AttributeProto.INTS:
            values[each.name] = np.array(each.ints, np.int64)
        elif each.type == AttributeProto.STRINGS:
            values[each.name] = [
                text.decode("utf-8", "replace") for text in each.strings
            ]
        elif each.type == AttributeProto.STRING:
            values[each.name] = each.s.decode("utf-8", "replace")
        elif each.type == AttributeProto.INT:
            values[each.name] = each.i
        else:
            raise ReadError(f"{name}: {each.name} is not read")
    return values


def _ends(graph: onnx.GraphProto) -> tuple[str | None, str | None]:
    """Return the outputs with labels and with numbers."""
    from onnx import TensorProto

    label = output = None
    for end in graph.output:
        kind = end.type.tensor_type.elem_type
        if kind in (TensorProto.INT64, TensorProto.INT32, TensorProto.STRING):
            label = label or end.name
        else:
            output = output or end.name
    return label, output


class _Splits(NamedTuple):
    """The nodes of all trees of a graph; children are `~leaf` or a node.

    Attributes:
        columns, values, modes, missing, yes, no: For each node; `values` as in the
            file, `missing` says whether NaN takes the way of `yes`.
    """

    columns: Any
    values: Any
    modes: Sequence[str]
    missing: Any
    yes: Any
    no: Any


class _Builder:
    """Nodes with `x <= cut`, of the nodes of a file.

    A node of a file is one here, but for tests of equality, which are two: `x <= t`,
    and on its left `x <= the number below t`.
    """

    def __init__(self, splits: _Splits, takes: Rows) -> None:
        # onnxruntime compares in the type of the rows.
        single = takes == "float32"
        kind: Any = np.float32 if single else np.float64
        with np.errstate(over="ignore"):
            values = np.asarray(splits.values).astype(kind)
        below = np.nextafter(values, kind(-np.inf)).astype(np.float64)
        values = values.astype(np.float64)
        self._high = cuts_of_rounded(values) if single else values
        self._low = cuts_of_rounded(below) if single else below
        self.columns: list[int] = []
        self.cuts: list[float] = []
        self.missing: list[bool] = []
        self.left: list[int] = []
        self.right: list[int] = []
        count = len(splits.modes)
        equal = [mode in ("EQ", "NEQ") for mode in splits.modes]
        second = count
        for place, mode in enumerate(splits.modes):
            yes, no = int(splits.yes[place]), int(splits.no[place])
            way = bool(splits.missing[place])
            column = int(splits.columns[place])
            if equal[place]:
                if mode == "NEQ":
                    # NaN differs from each number, with or without a way of its own.
                    yes, no, way = no, yes, False
                self._add(column, self._high[place], way, second, no)
                second += 1
            elif mode in ("LEQ", "LT"):
                cut = self._high if mode == "LEQ" else self._low
                self._add(column, cut[place], way, yes, no)
            else:
                cut = self._high if mode == "GT" else self._low
                self._add(column, cut[place], not way, no, yes)
        for place in np.flatnonzero(equal).tolist():
            yes, no = int(splits.yes[place]), int(splits.no[place])
            if splits.modes[place] == "NEQ":
                yes, no = no, yes
            # NaN comes here only on its way to `yes`.
            column = int(splits.columns[place])
            self._add(column, self._low[place], False, no, yes)

    def _add(self, column: int, cut: float, way: bool, left: int, right: int) -> None:
        self.columns.append(column)
        self.cuts.append(float(cut))
        self.missing.append(way)
        self.left.append(left)
        self.right.append(right)

    def tree(self, root: int, values: FloatArray, name: str) -> Tree:
        """Return what hangs below a node, with the vectors of all leaves."""
        return Tree.of(
            self.columns,
            self.cuts,
            self.missing,
            self.left,
            self.right,
            values,
            root,
            name=name,
        )


def _check_modes(modes: Sequence[str], name: str) -> None:
    for mode in set(modes) - set(_MODES[:-1]):
        raise ReadError(f"{name}: a node with the test {mode!r} is not read")


def _lengths(name: str, **arrays: Any) -> None:
    """Refuse lists of different lengths."""
    sizes = {key: len(value) for key, value in arrays.items()}
    if len(set(sizes.values())) > 1:
        shown = ", ".join(f"{key} {size}" for key, size in sizes.items())
        raise ReadError(f"{name}: lists must be equally long: {shown}")


def _version_5(values: Mapping[str, Any], takes: Rows, name: str) -> Ensemble:
    """Read a TreeEnsemble: scores and no labels."""
    try:
        modes = [_MODES[int(mode)] for mode in values["nodes_modes"]]
        splits = values["nodes_splits"]
        columns = values["nodes_featureids"]
        yes, no = values["nodes_truenodeids"], values["nodes_falsenodeids"]
        yes_leaf, no_leaf = values["nodes_trueleafs"], values["nodes_falseleafs"]
        targets, weights = values["leaf_targetids"], values["leaf_weights"]
        roots = values["tree_roots"].tolist()
    except (KeyError, IndexError) as error:
        raise ReadError(f"{name}: the TreeEnsemble lacks {error}") from error
    missing = values.get("nodes_missing_value_tracks_true", [0] * len(modes))
    _lengths(name, modes=modes, splits=splits, columns=columns, yes=yes, no=no,
             yes_leaf=yes_leaf, no_leaf=no_leaf, missing=missing)  # fmt: skip
    _lengths(name, targets=targets, weights=weights)
    _check_modes(modes, name)
    count = int(values.get("n_targets", 1))
    vectors = _vectors(
        np.arange(len(targets)), targets, weights, len(targets), count, name
    )
    builder = _Builder(
        _Splits(
            columns,
            splits,
            modes,
            missing,
            np.where(yes_leaf, ~yes, yes),
            np.where(no_leaf, ~no, no),
        ),
        takes,
    )
    aggregate = int(values.get("aggregate_function", 1))
    if aggregate > 1 or int(values.get("post_transform", 0)):
        raise ReadError(f"{name}: the smallest, the largest or a link is not read")
    share = 1.0 / len(roots) if aggregate == 0 else 1.0
    trees = [builder.tree(int(root), vectors * share, name) for root in roots]
    return Ensemble(name, "TreeEnsemble", trees, np.zeros(count), takes=takes,
                    unit=SINGLE if takes == "float32" else DOUBLE)  # fmt: skip


def _vectors(
    leaves: Any, scores: Any, weights: Any, rows: int, count: int, name: str
) -> FloatArray:
    """Return what each leaf adds, shape (rows, count)."""
    if not 0 < count <= MOST_SCORES or rows * count > MOST_NUMBERS:
        raise ReadError(f"{name}: {count} scores of {rows} leaves are too many")
    if len(scores) and not 0 <= scores.min() <= scores.max() < count:
        raise ReadError(f"{name}: a leaf adds to a score that is not there")
    vectors = np.zeros((rows, count))
    np.add.at(vectors, (leaves, scores), np.asarray(weights, np.float64))
    return vectors


def _versions_1_to_3(
    values: Mapping[str, Any], operator: str, takes: Rows, name: str
) -> Ensemble:
    """Read a TreeEnsembleClassifier or a TreeEnsembleRegressor."""
    is_classifier = operator == "TreeEnsembleClassifier"
    word = "class" if is_classifier else "target"
    try:
        numbers, trees = values["nodes_nodeids"], values["nodes_treeids"]
        columns = values["nodes_featureids"]
        modes = [mode.removeprefix("BRANCH_") for mode in values["nodes_modes"]]
        yes, no = values["nodes_truenodeids"], values["nodes_falsenodeids"]
        cuts = _either(values, "nodes_values")
        weights = _either(values, f"{word}_weights")
        owners, places = values[f"{word}_treeids"], values[f"{word}_nodeids"]
        scores = values[f"{word}_ids"]
    except KeyError as error:
        raise ReadError(f"{name}: the {operator} lacks {error}") from error
    missing = values.get("nodes_missing_value_tracks_true", np.zeros(len(modes)))
    missing = missing if len(missing) else np.zeros(len(modes))
    _lengths(name, numbers=numbers, trees=trees, columns=columns, modes=modes, yes=yes,
             no=no, cuts=cuts, missing=missing)  # fmt: skip
    _lengths(name, weights=weights, owners=owners, places=places, scores=scores)
    if values.get("aggregate_function", "SUM") not in ("SUM", "AVERAGE"):
        raise ReadError(f"{name}: the smallest or the largest of trees is not read")
    where: dict[tuple[int, int], int] = {}
    ends: dict[tuple[int, int], int] = {}
    inner: list[int] = []
    keys = list(zip(trees.tolist(), numbers.tolist(), strict=True))
    for place, (key, mode) in enumerate(zip(keys, modes, strict=True)):
        if key in where:
            raise ReadError(f"{name}: node {key[1]} of tree {key[0]} stands twice")
        if mode == "LEAF":
            where[key] = ~len(ends)
            ends[key] = len(ends)
        else:
            where[key] = len(inner)
            inner.append(place)
    _check_modes([modes[place] for place in inner], name)
    children: set[int] = set()
    ways: list[list[int]] = [[], []]
    for place in inner:
        for side, child in zip(ways, (int(yes[place]), int(no[place])), strict=True):
            target = where.get((keys[place][0], child))
            if target is None:
                raise ReadError(f"{name}: tree {keys[place][0]} has no node {child}")
            side.append(target)
            children.add(target)
    labels = values.get("classlabels_int64s", values.get("classlabels_strings", ()))
    classes = list(labels.tolist() if isinstance(labels, np.ndarray) else labels)
    count = len(classes) if is_classifier else int(values.get("n_targets", 1))
    kept = scores
    is_binary = is_classifier and count == 2 and len(np.unique(scores)) == 1
    if is_binary:
        kept, count = np.zeros_like(scores), 1
    try:
        leaves = [
            ends[key] for key in zip(owners.tolist(), places.tolist(), strict=True)
        ]
    except KeyError as error:
        raise ReadError(f"{name}: {error} has weights and is no leaf") from error
    vectors = _vectors(leaves, kept, weights, len(ends), count, name)
    builder = _Builder(
        _Splits(
            columns[inner],
            np.asarray(cuts)[inner],
            [modes[place] for place in inner],
            np.asarray(missing)[inner],
            np.array(ways[0], np.int64),
            np.array(ways[1], np.int64),
        ),
        takes,
    )
    roots: dict[int, int] = {}
    for key in keys:
        if (
            where[key] not in children
            and roots.setdefault(key[0], where[key]) != where[key]
        ):
            raise ReadError(f"{name}: tree {key[0]} has two roots")
    for number, size in Counter(trees.tolist()).items():
        if number not in roots or (roots[number] < 0 and size > 1):
            raise ReadError(f"{name}: tree {number} has no root")
    if values.get("aggregate_function") == "AVERAGE":
        vectors = vectors / len(roots)
    grown = [builder.tree(root, vectors, name) for root in roots.values()]
    decision: dict[str, Any] = {}
    base = np.asarray(_either(values, "base_values", ()), np.float64)
    if is_classifier:
        decision = _decision(values, classes, scores, weights, base, name)
        if is_binary and int(scores[0]) == 1:
            base = base[:0]
        _check_scored(grown, count, weights, base, name)
    if len(base) not in (0, count):
        raise ReadError(f"{name}: {len(base)} base values for {count} scores")
    return Ensemble(
        name,
        operator,
        grown,
        base if len(base) else np.zeros(count),
        takes=takes,
        unit=SINGLE if takes == "float32" else DOUBLE,
        **decision,
    )


def _either(values: Mapping[str, Any], key: str, default: Any = None) -> Any:
    """Return a list of floats, or the tensor that may stand for it."""
    for name in (key, f"{key}_as_tensor"):
        if name in values and len(values[name]):
            return values[name]
    if default is None:
        raise KeyError(key)
    return default


def _decision(
    values: Mapping[str, Any],
    classes: Sequence[object],
    scores: Any,
    weights: Any,
    base: FloatArray,
    name: str,
) -> dict[str, Any]:
    """Return how onnxruntime makes labels and outputs of scores.

    With two classes and weights of one of them, the second class wins above .5 if no
    weight is negative, and above 0 otherwise; with weights of both, the second wins
    where its own score is above 0. A base value beside weights of class 1 alone is not
    added.
    """
    link = values.get("post_transform", "NONE").lower()
    if link not in ("none", "logistic", "softmax"):
        raise ReadError(f"{name}: the link {link!r} is not read")
    decision: dict[str, Any] = {"classes": classes, "link": link}
    if len(classes) < 2:
        raise ReadError(f"{name}: {len(classes)} classes; at least two are read")
    if len(classes) > 2:
        return {**decision, "decides": "largest"}
    if len(base) > 1:
        raise ReadError(
            f"{name}: two base values of two classes, which onnxruntime does not add "
            "as the standard says"
        )
    one_score = len(np.unique(scores)) == 1
    bar = 0.5 if one_score and bool((np.asarray(weights) >= 0).all()) else 0.0
    if len(base) and one_score and int(scores[0]) == 1 and base.any():
        text = "onnxruntime does not add the base value"
        decision["remarks"] = (text,)
    return {**decision, "decides": "above", "bar": bar}


def _check_scored(
    trees: Sequence[Tree],
    count: int,
    weights: Any,
    base: FloatArray,
    name: str,
) -> None:
    """Refuse negative weights where a row may leave a class without any.

    Onnxruntime leaves such a class out, and does not take its score for 0.
    """
    if count == 1 or len(base) == count or bool((np.asarray(weights) > 0).all()):
        return
    if bool((np.asarray(weights) >= 0).all()) and count > 2:
        return
    always = np.zeros(count, np.bool_)
    for tree in trees:
        always |= (tree.values != 0).all(axis=0)
    if not always.all():
        raise ReadError(
            f"{name}: a row may give a class no weight, which onnxruntime does not "
            "take for 0; such a file is not read"
        )
