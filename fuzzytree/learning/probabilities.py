"""The probabilities of the classes at the leaves, from the rows of the sample.

A row's probabilities are a mixture of the leaves' (`fuzzytree.model.probabilities`).
For a given sharpness the vectors are those under which the rows' own classes are most
likely, found by expectation maximisation from the frequencies of the leaves, with some
further rows at each leaf that belong to all classes evenly. The sharpness is the one
with the smallest log-loss where each row is left out of the vectors that rate it.

The tree was grown on these rows, so its leaves rate others less well than these: how
many further rows there are, rows that were held out decide (`choosing`).
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Iterator

import msgspec
import numpy as np

from fuzzytree.learning.sampling import Sample, hashed
from fuzzytree.learning.units import FloatArray, IntArray
from fuzzytree.model import (
    MOST_MIXED,
    MOST_PROBABILITIES,
    PARTS,
    WEIGHT_OF_ONE,
    Band,
    Branch,
    FuzzyTree,
    Variable,
    shapes_of,
    squarings,
    stand_ins,
)

_TRIED = (1, 2, 4, 8, 16, 32, 128, 1024)
_STEPS = 10
_MOST_TO_CHOOSE = 1 << 18  # leaves times rows, to choose the sharpness by
_MOST_TO_FIT = 1 << 21


def with_probabilities(
    tree: FuzzyTree,
    sample: Sample,
    weights: FloatArray,
    columns: dict[str, int],
    *,
    further_rows: float = 2.0,
    sharpness: int | None = None,
) -> FuzzyTree:
    """Return a tree whose leaves have probabilities.

    A tree of too many leaves and classes is returned as it is.

    Args:
        tree: The tree.
        sample: Rows of the table, ordered by class.
        weights: How many rows of the table each row stands for, by its weight.
        columns: The position of each column in the rows.
        further_rows: How many rows at each leaf belong to all classes evenly.
        sharpness: The power of the strengths; None for the best.
    """
    leaves, classes = len(tree.leaves), len(tree.classes)
    if leaves > MOST_MIXED or leaves * classes > MOST_PROBABILITIES:
        return tree
    if sharpness is None:
        few = _thinned(sample, _MOST_TO_CHOOSE // leaves)
        rows = _rated(tree, sample, few, weights, columns)
        sharpness = min((_fitted(rows, k, further_rows)[1], k) for k in _TRIED)[1]
    many = _thinned(sample, _MOST_TO_FIT // leaves)
    rows = _rated(tree, sample, many, weights, columns)
    vectors = in_parts(_fitted(rows, sharpness, further_rows)[0])
    semantics = msgspec.structs.replace(tree.semantics, sharpness=sharpness)
    ends = tuple(
        msgspec.structs.replace(leaf, probabilities=tuple(vector))
        for leaf, vector in zip(tree.leaves, vectors.tolist(), strict=True)
    )
    return msgspec.structs.replace(tree, leaves=ends, semantics=semantics)


class _Rows(msgspec.Struct, frozen=True):
    """Rows with the strength of each leaf.

    Attributes:
        strengths: Shape (leaves, rows).
        codes: The class of each row, in ascending order.
        weights: How many rows of the table each row stands for.
        classes: How many there are.
    """

    strengths: FloatArray
    codes: IntArray
    weights: FloatArray
    classes: int


def _thinned(sample: Sample, most: int) -> IntArray:
    """Return positions of so many rows at most, of each class its share."""
    count = len(sample.codes)
    if count <= most:
        return np.arange(count)
    order = np.lexsort((hashed(np.arange(count)), sample.codes))
    starts = np.searchsorted(sample.codes, sample.codes)
    sizes = np.searchsorted(sample.codes, sample.codes, side="right") - starts
    rank = np.arange(count) - starts
    kept = order[(rank == 0) | (rank * count < most * sizes)]
    return np.sort(kept)


def _rated(
    tree: FuzzyTree,
    sample: Sample,
    places: IntArray,
    weights: FloatArray,
    columns: dict[str, int],
) -> _Rows:
    codes = sample.codes[places]
    if len(places) < len(sample.codes):
        thinning = np.bincount(sample.codes) / np.maximum(np.bincount(codes), 1)
        weights = weights[places] * thinning[codes]
    strengths = leaf_strengths(tree, sample.rows[places].T, columns)
    return _Rows(strengths, codes, weights, len(tree.classes))


def leaf_strengths(
    tree: FuzzyTree, values: FloatArray, columns: dict[str, int]
) -> FloatArray:
    """Return the strength of each leaf's relative rule, of shape (leaves, rows).

    Args:
        tree: The tree.
        values: Of shape (columns, rows).
        columns: The position of each column.
    """
    inputs = {name: values[columns[name]] for name in tree.inputs}
    for name, value in stand_ins(tree.variables).items():
        inputs[name] = np.where(np.isfinite(inputs[name]), inputs[name], value)
    axes = {v.name: _axis(v, inputs) for v in tree.variables}
    shapes = shapes_of(tree.variables)
    result = np.ones((len(tree.leaves), values.shape[1]))
    whole = np.ones(values.shape[1])
    todo = [(Branch((), node=1), whole)] if tree.nodes else []
    while todo:
        branch, above = todo.pop()
        if branch.leaf is not None:
            result[branch.leaf - 1] = above
            continue
        node = tree.nodes[(branch.node or 1) - 1]
        axis = axes[node.variable]
        for way in node.branches:
            bands = [shapes[node.variable, term] for term in way.terms]
            degrees = [_degrees(b, axis) for b in bands if isinstance(b, Band)]
            degree = np.maximum.reduce(degrees)
            is_product = tree.semantics.conjunction == "product"
            join = np.multiply if is_product else np.minimum
            todo.append((way, join(above, degree)))
    return result


def _axis(variable: Variable, inputs: dict[str, FloatArray]) -> FloatArray:
    if not variable.parts:
        return inputs[variable.name]
    summands: Iterator[FloatArray] = (
        part.weight * (inputs[part.input] - part.centre) for part in variable.parts
    )
    return functools.reduce(operator.add, summands)


def _degrees(band: Band, axis: FloatArray) -> FloatArray:
    """Return the degrees of a band: 1 on the plateau, a line or 0 beyond it."""
    degrees = np.ones(len(axis))
    for edge, end, is_beyond in (
        (band.low, band.left, axis <= (band.low or 0.0)),
        (band.high, band.right, axis > (band.high or 0.0)),
    ):
        if edge is None:
            continue
        line = np.zeros(len(axis))
        if end is not None:
            line = np.clip((axis - end) / (edge - end), 0.0, 1.0)
        degrees = np.where(is_beyond, line, degrees)
    return degrees


def _fitted(rows: _Rows, sharpness: int, even: float) -> tuple[FloatArray, float]:
    """Return the likeliest vectors of the leaves, given the further rows of each.

    Returns:
        The vectors, shape (leaves, classes), and the log-loss of the rows, each left
        out of the vectors that rate it.
    """
    powers = rows.strengths
    for _ in range(squarings(sharpness)):
        powers = powers * powers
    powers = np.floor(WEIGHT_OF_ONE * powers)
    shares = np.where(rows.strengths == 1.0, rows.weights, 0.0)
    for _ in range(_STEPS):
        shares = powers * _vectors(shares, rows, even)[0][:, rows.codes]
        shares *= rows.weights / shares.sum(axis=0)
    vectors, totals = _vectors(shares, rows, even)
    likely = vectors[:, rows.codes] * totals
    left_out = (likely - shares) / (totals - shares)
    chances = (powers * left_out).sum(axis=0) / powers.sum(axis=0)
    loss = -(rows.weights * np.log(chances)).sum() / rows.weights.sum()
    return vectors, float(loss)


def _vectors(
    shares: FloatArray, rows: _Rows, even: float
) -> tuple[FloatArray, FloatArray]:
    """Return the vectors of the leaves, and how many rows each leaf has.

    The share of a row in a leaf counts for the row's class.
    """
    present, starts = np.unique(rows.codes, return_index=True)
    counts = np.full((len(shares), rows.classes), even / rows.classes)
    counts[:, present] += np.add.reduceat(shares, starts, axis=1)
    totals = counts.sum(axis=1, keepdims=True)
    return counts / totals, totals


def in_parts(vectors: FloatArray) -> FloatArray:
    """Return probabilities in whole millionths: rounded down, the rest to the largest.

    Example:
        >>> in_parts(np.array([[2 / 3, 1 / 3]])).tolist()
        [[0.666667, 0.333333]]
    """
    parts = np.floor(vectors * PARTS)
    largest = np.arange(len(parts)), parts.argmax(axis=1)
    parts[largest] += PARTS - parts.sum(axis=1)
    return parts / PARTS
