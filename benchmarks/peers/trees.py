"""Peers that follow a tree's path: our cuts in other people's code."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.benchmarking.records import LoadedCandidate
from fuzzytree.errors import LossError
from fuzzytree.runtimes.rows import Axes, axis_row, plan_axes
from peers.crisp import (
    NodeTable,
    guarded,
    lines_of,
    nodes_of,
    tables,
)

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray, IntArray
    from fuzzytree.model.tree import FuzzyTree
    from peers.crisp import Reals

    Ask = Callable[[Reals], IntArray]

_COMPILE_S = 40.0

_ENSEMBLE_OPSET = 17


def load_scikit_learn(tree: FuzzyTree, threads: int) -> LoadedCandidate:
    """Prepare scikit-learn's `DecisionTreeClassifier.predict` with a tree's cuts."""
    axes, splits = _nodes(tree)
    predict: Ask = classifier(splits, axes, len(tree.classes)).predict

    return _loaded(tree, axes, np.float32, predict)


def load_scikit_learn_core(tree: FuzzyTree, threads: int) -> LoadedCandidate:
    """Prepare `Tree.apply`, which `predict` calls behind its checks."""
    axes, splits = _nodes(tree)
    apply: Ask = classifier(splits, axes, len(tree.classes)).tree_.apply

    def ask(table: Reals) -> IntArray:
        return splits.label.take(apply(table))

    return _loaded(tree, axes, np.float32, ask)


def load_skl2onnx(tree: FuzzyTree, threads: int) -> LoadedCandidate:
    """Prepare what skl2onnx makes of the scikit-learn tree, in onnxruntime.

    It writes the classifier without zipmap, and its output `label` is fetched.
    """
    from skl2onnx import convert_sklearn
    from skl2onnx.common.data_types import FloatTensorType

    from fuzzytree.exporters.onnx_session import open_bare

    axes, splits = _nodes(tree)
    estimator = classifier(splits, axes, len(tree.classes))
    made: Any = convert_sklearn(
        estimator,
        initial_types=[("inputs", FloatTensorType([None, axes.count]))],
        options={"zipmap": False},
        target_opset=_ENSEMBLE_OPSET,
    )
    content: bytes = made.SerializeToString()
    session = open_bare(content, threads)

    def ask(table: Reals) -> IntArray:
        (numbers,) = session(["label"], {"inputs": table})
        return np.asarray(numbers, np.int64)

    return _loaded(tree, axes, np.float32, ask, len(content))


def load_treelite(tree: FuzzyTree, threads: int) -> LoadedCandidate:
    """Prepare a treelite model in double, run by its interpreter GTIL.

    It is put together question by question, because treelite takes no single tree of
    scikit-learn. Its value is the leaf's class number.

    Raises:
        LossError: If it cannot have so many threads.
    """
    from treelite import TreeliteError, gtil
    from treelite.model_builder import (
        Metadata,
        ModelBuilder,
        PostProcessorFunc,
        TreeAnnotation,
    )

    axes, splits = _nodes(tree)
    builder: Any = ModelBuilder(
        threshold_type="float64",
        leaf_output_type="float64",
        metadata=Metadata(
            num_feature=axes.count,
            task_type="kRegressor",
            average_tree_output=False,
            num_target=1,
            num_class=[1],
            leaf_vector_shape=(1, 1),
        ),
        tree_annotation=TreeAnnotation(num_tree=1, target_id=[0], class_id=[0]),
        postprocessor=PostProcessorFunc(name="identity"),
        base_scores=[0.0],
    )
    builder.start_tree()
    for place, (line, cut, left, right, leaf, label) in enumerate(_rows(splits)):
        builder.start_node(place)
        if leaf:
            builder.leaf(float(label))
        else:
            builder.numerical_test(
                feature_id=line,
                threshold=cut,
                default_left=False,
                opname="<=",
                left_child_key=left,
                right_child_key=right,
            )
        builder.end_node()
    builder.end_tree()
    model = builder.commit()
    try:
        gtil.predict(model, np.zeros((1, axes.count)), nthread=threads)
    except TreeliteError as error:  # it takes no more threads than OpenMP has
        raise LossError(
            f"OpenMP gives treelite fewer than {threads} threads; OMP_NUM_THREADS may "
            "say so"
        ) from error

    def ask(table: Reals) -> IntArray:
        scores = gtil.predict(model, table, nthread=threads)
        labels: IntArray = scores.reshape(-1).astype(np.int64)
        return labels

    return _loaded(tree, axes, np.float64, ask, len(model.serialize_bytes()))


def load_m2cgen_python(tree: FuzzyTree, threads: int) -> LoadedCandidate:
    """Prepare the Python function that m2cgen writes, called for one row at a time.

    Raises:
        LossError: If the tree is too deep for m2cgen or for Python.
    """
    import m2cgen

    axes, splits = _nodes(tree)
    text = _written(m2cgen.export_to_python, tree, splits, axes)
    space: dict[str, Any] = {}
    try:
        exec(compile(text, "<generated by m2cgen>", "exec"), space)
    except (IndentationError, RecursionError, MemoryError) as error:
        text = "Python does not take so many ifs within each other"
        raise LossError(f"{_too_deep(tree, splits)}: {text}") from error
    score: Callable[[list[float]], list[float]] = space["score"]

    def each(rows: list[list[float]]) -> list[int]:
        numbers: list[int] = []
        for row in rows:
            scores = score(row)
            numbers.append(scores.index(max(scores)))
        return numbers

    def call(values: FloatArray) -> Callable[[], object]:
        if not axes.steps:
            return partial(each, values.T.tolist())
        if values.shape[1] == 1:
            row = values[:, 0].tolist()
            return lambda: each([axis_row(axes, row)])
        return lambda: each(lines_of(axes, values).T.tolist())

    def ask(values: FloatArray) -> IntArray:
        return np.array(each(lines_of(axes, values).T.tolist()))

    answer = guarded(tree, axes, np.float64, ask)
    return LoadedCandidate(answer, call, len(text.encode()))


_LOOP = """
void answer(const double *table, long rows, long columns, long classes,
            double *scores, long long *labels) {
    for (long row = 0; row < rows; row++) {
        score((double *)table + row * columns, scores);
        long best = 0;
        for (long one = 1; one < classes; one++)
            if (scores[one] > scores[best]) best = one;
        labels[row] = best;
    }
}
"""


def load_m2cgen_c(tree: FuzzyTree, threads: int) -> LoadedCandidate:
    """Prepare the C function that m2cgen writes, compiled by gcc, with a loop of ours.

    Raises:
        LossError: If the tree is too deep for m2cgen, or gcc does not compile it, or
            not within 40 seconds.
    """
    import m2cgen

    axes, splits = _nodes(tree)
    classes = _scores(tree)
    written = _written(m2cgen.export_to_c, tree, splits, axes)
    library, size = _compiled(written + _LOOP)
    answer = library.answer
    address, whole = ctypes.c_void_p, ctypes.c_long
    answer.argtypes = (address, whole, whole, whole, address, address)
    answer.restype = None
    scores = np.zeros(classes)

    def ask(table: Reals) -> IntArray:
        labels = np.empty(len(table), np.int64)
        answer(
            table.ctypes.data,
            len(table),
            axes.count,
            classes,
            scores.ctypes.data,
            labels.ctypes.data,
        )
        return labels

    return _loaded(tree, axes, np.float64, ask, size)


def _scores(tree: FuzzyTree) -> int:
    """Return how many classes a tree must have for m2cgen to write one score each."""
    return max(len(tree.classes), 2)


def _written(
    export: Callable[[Any], str], tree: FuzzyTree, splits: NodeTable, axes: Axes
) -> str:
    """Return the code that m2cgen writes; it walks the tree by recursion."""
    try:
        return export(classifier(splits, axes, _scores(tree)))
    except RecursionError as error:
        text = f"{_too_deep(tree, splits)}: it is written by recursion"
        raise LossError(text) from error


def _too_deep(tree: FuzzyTree, splits: NodeTable) -> str:
    return f"cannot run {tree.name} as m2cgen: a path has {_depth(splits)} nodes"


def _compiled(text: str) -> tuple[ctypes.CDLL, int]:
    """Return a library of some C, loaded, and its size in bytes."""
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder, "tree.c"), Path(folder, "tree.so")
        source.write_text(text)
        command = ["gcc", "-O3", "-ffp-contract=off", "-shared", "-fPIC", "-o"]
        try:
            done = subprocess.run(
                [*command, str(target), str(source)],
                capture_output=True,
                text=True,
                timeout=_COMPILE_S,
            )
        except subprocess.TimeoutExpired as error:
            why = f"gcc did not compile it within {_COMPILE_S:g} s"
            raise LossError(why) from error
        if done.returncode:
            lines = done.stderr.strip().splitlines() or [f"exit {done.returncode}"]
            raise LossError(f"gcc does not compile it: {lines[0]}")
        return ctypes.CDLL(str(target)), target.stat().st_size


def classifier(splits: NodeTable, axes: Axes, classes: int) -> Any:
    """Return a `DecisionTreeClassifier` with the nodes of a tree, not with learnt ones.

    Its cuts are our doubles. It compares them with inputs that it rounds to float32.

    Args:
        splits: The nodes and leaves of the tree.
        axes: The variables; their lines are its columns.
        classes: How many classes there are, 0 ... among them the leaves' labels.
    """
    from sklearn.tree import DecisionTreeClassifier
    from sklearn.tree._tree import Tree

    count = len(splits.leaf)
    core: Any = Tree(axes.count, np.array([classes], np.intp), 1)
    nodes: Any = np.zeros(count, core.__getstate__()["nodes"].dtype)
    nodes["left_child"], nodes["right_child"] = splits.left, splits.right
    nodes["feature"] = np.where(splits.is_leaf, -2, splits.line)
    nodes["threshold"] = np.where(splits.is_leaf, -2.0, splits.cut)
    nodes["n_node_samples"] = nodes["weighted_n_node_samples"] = 1
    values = np.zeros((count, 1, classes))
    values[np.arange(count), 0, splits.label] = 1.0
    state = {
        "max_depth": _depth(splits),
        "node_count": count,
        "nodes": nodes,
        "values": values,
    }
    core.__setstate__(state)
    estimator: Any = DecisionTreeClassifier()
    estimator.tree_ = core
    estimator.classes_ = np.arange(classes)
    estimator.n_classes_ = classes
    estimator.n_features_in_ = axes.count
    estimator.n_outputs_ = 1
    estimator.max_features_ = axes.count
    return estimator


def _depth(splits: NodeTable) -> int:
    depth = np.zeros(len(splits.leaf), np.int64)
    for place, (left, right) in enumerate(zip(splits.left, splits.right, strict=True)):
        if not splits.leaf[place]:
            depth[[left, right]] = depth[place] + 1  # parents come first
    return int(depth.max())


def _rows(splits: NodeTable) -> list[tuple[int, float, int, int, int, int]]:
    return list(zip(*(column.tolist() for column in splits), strict=True))


def _nodes(tree: FuzzyTree) -> tuple[Axes, NodeTable]:
    axes = plan_axes(tree.variables)
    return axes, nodes_of(tree, axes)


def _loaded(
    tree: FuzzyTree,
    axes: Axes,
    dtype: type[np.floating[Any]],
    ask: Ask,
    size: int | None = None,
) -> LoadedCandidate:
    """Return a peer that answers a whole table, in calls and guarded."""

    def call(values: FloatArray) -> Callable[[], object]:
        table = tables(axes, dtype, values)
        return lambda: ask(table())

    def known(values: FloatArray) -> IntArray:
        return ask(tables(axes, dtype, values)())

    return LoadedCandidate(guarded(tree, axes, dtype, known), call, size)
