"""A tree as a graph that follows one path, as `descent` does.

Every cut becomes one test `x <= cut`; the cuts of a node form a balanced cascade.
`TreeEnsemble` of ai.onnx.ml 5 holds them in double, with the leaf's number as value;
the plain form walks all rows one level at a time with ordinary operators.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
import onnx
from onnx import numpy_helper

from fuzzytree.exporters.onnx_ends import (
    InputBlock,
    axes,
    flat_guard,
    is_known,
)
from fuzzytree.exporters.onnx_graph import TREES, Constant, OnnxGraph
from fuzzytree.model import FuzzyTree, Node
from fuzzytree.numerics import rounded

_MOST_QUESTIONS = 1_000_000
_MOST_LEAVES = 2**24  # as float32 counts


class OnnxTreeTest(msgspec.Struct, frozen=True):
    """`variable <= cut`: on to the left if so, else to the right.

    A way on is the position of a test, or minus the number of a leaf.
    """

    variable: str
    cut: float
    ways: tuple[int, int]


def tree_graph(
    graph: OnnxGraph,
    tree: FuzzyTree,
    columns: Sequence[str],
    *,
    is_plain: bool,
    named: str = "rule",
) -> InputBlock:
    """Add a tree up to the leaf's number, or 0 where a value is missing.

    Returns:
        The values of the variables, with a flat guard.
    """
    tests = cut_tests(tree)
    is_direct = not (is_plain and tests) and not any(
        variable.parts for variable in tree.variables
    )
    if is_direct:
        frame = flat_guard(graph, tree, columns)
    else:
        frame = axes(graph, tree, columns, is_flat=True)
    if not tests:
        leaf = graph.constant(np.array(1, np.int64), "leaf")
    elif is_plain:
        with graph.about("path"):
            leaf = _walk(graph, tests, frame, start=_root(tree))
    else:
        place = {name: columns.index(name) for name in tree.inputs}
        values = graph.source
        if not is_direct:
            place = frame.order
            values = graph.node("Transpose", frame.block, hint="values", perm=[1, 0])
        leaf = _ensemble(graph, tests, values, place, start=_root(tree))
    zero = graph.constant(np.array(0, np.int64), "nothing")
    known = is_known(graph, frame)
    graph.node("Where", known, leaf, zero, named=named)
    return frame


def needs_plain(tree: FuzzyTree) -> bool:
    """Return whether a tree is beyond `TreeEnsemble`, which cannot share subtrees."""
    sizes: dict[int, int] = {}
    for number in range(len(tree.nodes), 0, -1):
        node = tree.nodes[number - 1]
        below = [sizes.get(node.branches[owner].node or 0, 0) for owner in node.owners]
        sizes[number] = len(node.cuts) + sum(below)
    return sizes.get(1, 0) > _MOST_QUESTIONS or len(tree.leaves) > _MOST_LEAVES


def _root(tree: FuzzyTree) -> int:
    return len(tree.nodes[0].cuts) // 2


def cut_tests(tree: FuzzyTree) -> list[OnnxTreeTest]:
    """Return the cuts of all nodes in order, each with its two ways on.

    A node is entered at its middle cut.
    """
    first = [0]
    for node in tree.nodes:
        first.append(first[-1] + len(node.cuts))

    def way(node: Node, interval: int) -> int:
        branch = node.branches[node.owners[interval]]
        if branch.node is None:
            return -(branch.leaf or 0)
        return first[branch.node - 1] + len(tree.nodes[branch.node - 1].cuts) // 2

    tests: list[OnnxTreeTest] = []
    for start, node in zip(first, tree.nodes, strict=False):
        ways: dict[int, tuple[int, int]] = {}
        todo = [(0, len(node.cuts))]
        while todo:
            low, high = todo.pop()
            middle = (low + high) // 2
            left, right = (low, middle), (middle + 1, high)
            ways[middle] = (
                start + sum(left) // 2 if left[0] < left[1] else way(node, middle),
                start + sum(right) // 2 if right[0] < right[1] else way(node, high),
            )
            todo += [span for span in (left, right) if span[0] < span[1]]
        tests += [
            OnnxTreeTest(node.variable, cut, ways[i]) for i, cut in enumerate(node.cuts)
        ]
    return tests


def _ensemble(
    graph: OnnxGraph,
    tests: Sequence[OnnxTreeTest],
    values: str,
    place: dict[str, int],
    *,
    start: int,
) -> str:
    """Add one `TreeEnsemble`; a subtree with two ways to it stands in it twice."""
    numbers = graph.types
    order: list[int] = []
    leaves: list[int] = []
    todo: list[tuple[int, int, bool]] = [(start, -1, False)]
    targets: dict[tuple[int, bool], tuple[int, int]] = {}
    while todo:
        way, parent, is_left = todo.pop()
        if way < 0:
            targets[parent, is_left] = (len(leaves), 1)
            leaves.append(-way)
            continue
        targets[parent, is_left] = (len(order), 0)
        number = len(order)
        order.append(way)
        left, right = tests[way].ways
        todo += [(left, number, True), (right, number, False)]
    yes = [targets[number, True] for number in range(len(order))]
    no = [targets[number, False] for number in range(len(order))]
    ordered = [tests[position] for position in order]
    cuts = rounded([test.cut for test in ordered], numbers.axis)
    leaf = graph.node(
        "TreeEnsemble",
        values,
        hint="leaf",
        domain=TREES,
        n_targets=1,
        aggregate_function=1,
        post_transform=0,
        tree_roots=[0],
        nodes_featureids=[place[test.variable] for test in ordered],
        nodes_modes=_tensor(np.zeros(len(ordered), np.uint8)),
        nodes_splits=_tensor(cuts),
        nodes_truenodeids=[node for node, _ in yes],
        nodes_trueleafs=[is_leaf for _, is_leaf in yes],
        nodes_falsenodeids=[node for node, _ in no],
        nodes_falseleafs=[is_leaf for _, is_leaf in no],
        leaf_targetids=[0] * len(leaves),
        leaf_weights=_tensor(np.array(leaves, numbers.axis)),
    )
    whole = graph.node("Cast", leaf, hint="leaf", to=onnx.TensorProto.INT64)
    return graph.node("Reshape", whole, graph.numbers([-1], "flat"), hint="leaf")


def _tensor(values: Constant) -> onnx.TensorProto:
    return numpy_helper.from_array(values)


def _walk(
    graph: OnnxGraph,
    tests: Sequence[OnnxTreeTest],
    frame: InputBlock,
    *,
    start: int,
) -> str:
    """Add one step for each level; a row that has reached its leaf stays there."""
    count = len(tests)
    leaves = 1 + max(-way for q in tests for way in q.ways)

    def state(way: int) -> int:
        return way if way >= 0 else count - way

    own = range(count, count + leaves)
    places = [frame.order[q.variable] for q in tests] + [0] * leaves
    cuts = rounded([q.cut for q in tests] + [0.0] * leaves, graph.types.axis)
    place = graph.numbers(places, "variables")
    cut = graph.constant(cuts, "cuts")
    left, right = (
        graph.numbers([*(state(q.ways[k]) for q in tests), *own], name)
        for k, name in enumerate(("left", "right"))
    )
    value = graph.take(frame.block, [places[start]])
    here = graph.node("Less", graph.constant(cuts[[start]], "cut"), value)
    there = [graph.numbers([state(w)], "way") for w in tests[start].ways]
    here = graph.node("Where", here, there[1], there[0])
    for _ in range(_depth(tests, start) - 1):
        column = graph.node("Gather", place, here, axis=0)
        value = graph.node("GatherElements", frame.block, column, axis=0)
        is_right = graph.node("Less", graph.node("Gather", cut, here, axis=0), value)
        onward = [graph.node("Gather", way, here, axis=0) for way in (right, left)]
        here = graph.node("Where", is_right, *onward)
    flat = graph.node("Reshape", here, graph.numbers([-1], "flat"))
    return graph.node("Sub", flat, graph.constant(np.array(count), "questions"))


def _depth(tests: Sequence[OnnxTreeTest], start: int) -> int:
    """Return how many tests the longest path has."""
    level, depth = {start}, 0
    while level:
        depth += 1
        level = {w for p in level for w in tests[p].ways if w >= 0}
    return depth
