"""A tree as a graph that follows one path, as `descent` does.

Every cut becomes one test `x <= cut`; the cuts of a node form a balanced cascade.
`TreeEnsemble` of ai.onnx.ml 5 holds them in double, with the leaf's number as value;
the plain form walks all rows one level at a time with ordinary operators.
"""

from __future__ import annotations

from collections.abc import Sequence

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
from fuzzytree.exporters.program_text import TreeTest, tree_tests
from fuzzytree.model import FuzzyTree
from fuzzytree.numerics import rounded

_MOST_QUESTIONS = 1_000_000
_MOST_LEAVES = 2**24  # as float32 counts


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
    tests = tree_tests(tree)
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
            leaf = _walk(graph, tests, frame)
    else:
        place = {name: columns.index(name) for name in tree.inputs}
        values = graph.source
        if not is_direct:
            place = frame.order
            values = graph.node("Transpose", frame.block, hint="values", perm=[1, 0])
        leaf = _ensemble(graph, tests, values, place)
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


def _ensemble(
    graph: OnnxGraph,
    tests: Sequence[TreeTest],
    values: str,
    place: dict[str, int],
) -> str:
    """Add one `TreeEnsemble`; a subtree with two ways to it stands in it twice."""
    numbers = graph.types
    order: list[int] = []
    leaves: list[int] = []
    todo: list[tuple[int, int, bool]] = [(0, -1, False)]
    targets: dict[tuple[int, bool], tuple[int, int]] = {}
    while todo:
        way, parent, is_left = todo.pop()
        if way >= len(tests):
            targets[parent, is_left] = (len(leaves), 1)
            leaves.append(way - len(tests) + 1)
            continue
        targets[parent, is_left] = (len(order), 0)
        number = len(order)
        order.append(way)
        one = tests[way]
        todo += [(one.no, number, True), (one.yes, number, False)]
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
    tests: Sequence[TreeTest],
    frame: InputBlock,
) -> str:
    """Add one step for each level; a row that has reached its leaf stays there."""
    count = len(tests)
    ends = {way for one in tests for way in (one.no, one.yes) if way >= count}
    own = range(count, max(ends) + 1)
    places = [frame.order[one.variable] for one in tests] + [0] * len(own)
    cuts = rounded([one.cut for one in tests] + [0.0] * len(own), graph.types.axis)
    place = graph.numbers(places, "variables")
    cut = graph.constant(cuts, "cuts")
    left = graph.numbers([*(one.no for one in tests), *own], "left")
    right = graph.numbers([*(one.yes for one in tests), *own], "right")
    value = graph.take(frame.block, places[:1])
    here = graph.node("Less", graph.constant(cuts[:1], "cut"), value)
    no, yes = (graph.numbers([way], "way") for way in (tests[0].no, tests[0].yes))
    here = graph.node("Where", here, yes, no)
    for _ in range(_depth(tests) - 1):
        column = graph.node("Gather", place, here, axis=0)
        value = graph.node("GatherElements", frame.block, column, axis=0)
        is_right = graph.node("Less", graph.node("Gather", cut, here, axis=0), value)
        onward = [graph.node("Gather", way, here, axis=0) for way in (right, left)]
        here = graph.node("Where", is_right, *onward)
    flat = graph.node("Reshape", here, graph.numbers([-1], "flat"))
    return graph.node("Sub", flat, graph.constant(np.array(count - 1), "questions"))


def _depth(tests: Sequence[TreeTest]) -> int:
    """Return how many tests the longest path has."""
    level, depth = {0}, 0
    while level:
        depth += 1
        ways = {way for place in level for way in tests[place][2:]}
        level = {way for way in ways if way < len(tests)}
    return depth
