"""A tree as a network of three layers, an entropy net (Sethi 1990; [7] of the paper).

The partition layer has a unit for each cut: 1 where the value is above it. The AND
layer has a unit for each path: 1 where all units of the path are as it needs them. The
OR layer joins the paths of a leaf to the leaf's number. All numbers behind the first
layer are small whole ones, so sums in any order are exact; a combination of inputs is
computed before the first layer, by the steps that the other graphs have.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import onnx

from fuzzytree.errors import LossError
from fuzzytree.exporters.onnx_ends import InputBlock, axes, is_known
from fuzzytree.exporters.onnx_graph import OnnxGraph
from fuzzytree.exporters.onnx_tree import tree_graph
from fuzzytree.exporters.program_text import TreeTest, tree_tests
from fuzzytree.model import FuzzyTree
from fuzzytree.numerics import rounded

_MOST_LEAVES = 64
_MOST_PATHS = 512

Path = tuple[tuple[int, bool], ...]
"""The tests on a path, each with the answer that it needs."""


def net_graph(graph: OnnxGraph, tree: FuzzyTree, columns: Sequence[str]) -> InputBlock:
    """Add a tree as layers, up to the leaf's number, or 0 where a value is missing.

    Returns:
        The values of the variables, with a flat guard.

    Raises:
        LossError: If the tree has too many leaves, or too many paths to them.
    """
    tests = tree_tests(tree)
    paths = _paths(tests)
    if len(tree.leaves) > _MOST_LEAVES or len(paths) > _MOST_PATHS:
        count = f"{len(tree.leaves)} leaves"
        if len(paths) > _MOST_PATHS:
            count += f" on more than {_MOST_PATHS} paths"
        raise LossError(
            f"cannot write {tree.name} as a net: it has {count}, and a net of more "
            f"than {_MOST_LEAVES} leaves or {_MOST_PATHS} paths would be slow\n"
            "  pass plain=True (--plain), whose graph has standard operators too"
        )
    if not tests:
        return tree_graph(graph, tree, columns, is_plain=True)
    frame, kind = axes(graph, tree, columns, is_flat=True), graph.types.axis
    choice = np.zeros((len(frame.order), len(tests)), kind)
    choice[[frame.order[test.variable] for test in tests], range(len(tests))] = 1
    cuts = rounded([test.cut for test in tests], kind)
    answers = np.zeros((len(tests), len(paths)), kind)
    for number, (_, path) in enumerate(paths):
        for test, is_above in path:
            answers[test, number] = 1 if is_above else -1
    spare = (1 - (answers > 0).sum(axis=0)).astype(kind)
    leaves = np.array([[leaf] for leaf, _ in paths], kind)
    with graph.about("net"):
        layer = [graph.constant(choice, "choice"), graph.constant(-cuts, "cuts")]
        above = graph.node("Gemm", frame.block, *layer, hint="above_cut", transA=1)
        unit = graph.node("Relu", graph.node("Sign", above), hint="partition")
        layer = [graph.constant(answers, "answers"), graph.constant(spare, "spare")]
        # Older versions of onnxruntime join Gemm and Relu, which they cannot in double.
        taken = graph.node("Sign", graph.node("Gemm", unit, *layer))
        taken = graph.node("Relu", taken, hint="and")
        leaf = graph.node("MatMul", taken, graph.constant(leaves, "leaves"), hint="or")
        leaf = graph.node("Reshape", leaf, graph.numbers([-1], "flat"))
        zero = graph.number(0.0, kind)
        leaf = graph.node("Where", is_known(graph, frame), leaf, zero)
    graph.node("Cast", leaf, named="rule", to=onnx.TensorProto.INT64)
    return frame


def _paths(tests: Sequence[TreeTest]) -> list[tuple[int, Path]]:
    """Return the leaves, from 1, and the paths to them; one too many at most."""
    paths: list[tuple[int, Path]] = []
    todo: list[tuple[int, Path]] = [(0, ())]
    while todo and len(paths) <= _MOST_PATHS:
        place, path = todo.pop()
        if place >= len(tests):
            paths.append((place - len(tests) + 1, path))
            continue
        test = tests[place]
        todo += [(test.yes, (*path, (place, True))), (test.no, (*path, (place, False)))]
    return paths
