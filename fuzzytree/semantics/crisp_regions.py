"""The crisp regions of a tree: finitely many points decide the class of every input.

The cuts on a variable divide its axis into intervals, open below and closed above, and
the tree takes the same branch on all of an interval. With the axes as free coordinates,
a product of intervals is a region; what is true at one point of each region, and at
each cut and the floats beside it, is true for every input.
"""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Iterator
from typing import TypeVar

from msgspec.structs import replace

from fuzzytree.model import (
    Band,
    FloatArray,
    FuzzyTree,
    Node,
    Proposition,
    RuleBase,
    shapes_of,
)
from fuzzytree.semantics.reference import degree, proposition_degree

_Model = TypeVar("_Model", bound=FuzzyTree | RuleBase)


def free_axes(model: _Model) -> _Model:
    """Return a model whose combinations are inputs of their own.

    The inputs that only combinations need are left out, so that a row of the new
    model is a point on the axes that the old one uses.
    """
    used = {variable.name for variable in model.variables if variable.terms}
    variables = tuple(replace(v, parts=()) for v in model.variables if v.name in used)
    return replace(model, variables=variables, columns=())


def cuts_by_variable(tree: FuzzyTree) -> dict[str, tuple[float, ...]]:
    """Return all cuts on each variable that a node tests, in ascending order."""
    cuts: dict[str, set[float]] = {}
    for node in tree.nodes:
        cuts.setdefault(node.variable, set()).update(node.cuts)
    return {name: tuple(sorted(values)) for name, values in cuts.items()}


def axis_points(tree: FuzzyTree) -> dict[str, tuple[float, ...]]:
    """Return, for each variable that a node tests, points that represent its axis.

    They are each cut and the two floats beside it, a point inside each interval, and
    one far beyond either end.
    """
    return {
        name: tuple(_points(list(cuts)))
        for name, cuts in cuts_by_variable(tree).items()
    }


def cell_count(tree: FuzzyTree) -> int:
    """Return the number of cells: the product of the numbers of intervals."""
    return math.prod(len(cuts) + 1 for cuts in cuts_by_variable(tree).values())


def grid_size(tree: FuzzyTree) -> int:
    """Return the number of points that `grid` yields in all."""
    return math.prod(len(points) for points in axis_points(tree).values())


def grid(tree: FuzzyTree, *, chunk: int = 1 << 16) -> Iterator[FloatArray]:
    """Yield all combinations of the axes' points for the tree with free axes.

    Yields:
        Arrays of shape (axes, at most `chunk`), rows in the order of the inputs of
        `free_axes(tree)`.
    """
    import numpy as np

    points = axis_points(tree)
    axes = [np.array(points.get(name, (0.0,))) for name in free_axes(tree).inputs]
    sizes = tuple(axis.size for axis in axes)
    total = math.prod(sizes)
    for start in range(0, total, chunk):
        flat = np.arange(start, min(start + chunk, total))
        where = np.unravel_index(flat, sizes) if sizes else ()
        columns = [axis[index] for axis, index in zip(axes, where, strict=True)]
        yield np.array(columns).reshape(len(axes), flat.size)


def node_faults(tree: FuzzyTree) -> Iterator[str]:
    """Yield each point of each node where its terms do not say what its cuts say.

    At every point of the node's axis the branch that owns it must have degree exactly
    1 and every other branch less. With `fuzzytree.semantics.lowering`'s argument this
    proves that the relative rules equal the tree on every input.
    """
    shapes = shapes_of(tree.variables)
    for number, node in enumerate(tree.nodes, 1):
        points = node_points(node)
        full: list[set[int]] = [set() for _ in points]  # branches of degree 1
        for index, branch in enumerate(node.branches):
            for term in branch.terms:
                shape, start, stop = shapes[node.variable, term], 0, len(points)
                if isinstance(shape, Band):  # below 1 off its plateau
                    if shape.low is not None:
                        start = bisect.bisect_right(points, shape.low)
                    if shape.high is not None:
                        stop = bisect.bisect_right(points, shape.high)
                for place in range(start, stop):
                    if degree(shape, points[place]) == 1.0:
                        full[place].add(index)
        for point, branches in zip(points, full, strict=True):
            owner = node.owners[bisect.bisect_left(node.cuts, point)]
            for index in sorted(branches ^ {owner}):
                proposition = Proposition(node.variable, node.branches[index].terms)
                yield (
                    f"node {number}: at {node.variable} = {point!r} branch {index + 1} "
                    f"has degree {proposition_degree(proposition, shapes, point)!r}, "
                    f"and branch {owner + 1} owns the point"
                )


def node_points(node: Node) -> tuple[float, ...]:
    """Return points that represent the axis of one node."""
    return tuple(_points(list(node.cuts)))


def _points(cuts: list[float]) -> Iterator[float]:
    earlier: set[float] = set()
    inner = [a + (b - a) / 2 for a, b in itertools.pairwise(cuts)]
    reach = max(abs(cuts[0]), abs(cuts[-1]), cuts[-1] - cuts[0], 1e-300)
    ends = [cuts[0] - reach, cuts[-1] + reach]
    near = [math.nextafter(cut, end) for cut in cuts for end in (-math.inf, math.inf)]
    for point in sorted([*cuts, *inner, *ends, *near]):
        if point not in earlier and math.isfinite(point):
            earlier.add(point)
            yield point
