"""The order of a column's categories, in which combinations count them.

A combination has one weight for a column, so its categories stand at equal steps along
an order. The order is that of what each category adds to the classes where the other
columns of categories are equal: the coefficients of one ridge regression of the classes
on indicators. A column that adds no more than chance would enters no combination.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fuzzytree.learning.units import FloatArray, IntArray

_MOST_ORDERED = 16
"""Columns of more categories keep their order, and enter no combination."""

_LEAST_F = 2.0  # chance alone gives 1 in the mean
_MOST_INDICATORS = 512  # of one regression
_MOST_ROWS = 8_000
_RIDGE = 1.0  # rows
_DIGITS = 9
_TILT = 2.0**-6  # between classes, so that no two axes explain equally much


def category_orders(
    values: FloatArray, codes: IntArray, sizes: Sequence[int]
) -> dict[int, tuple[IntArray, bool]]:
    """Return the orders of categories, and whether combinations may use them.

    Only 0s and 1s are added up before the regression is solved, and what it gives is
    rounded, so the order depends neither on the rows' order nor on the machine.

    Args:
        values: Positions of categories, shape (rows, columns); NaN is missing.
        codes: The class of each row.
        sizes: How many categories each column has; 0 for one to leave alone.

    Returns:
        For columns of three categories and more, by number: the positions in the new
        order, missing values nearer to its begin than to its end; and whether the
        column adds more than chance would.

    Example:
        >>> kinds = np.repeat([0.0, 1.0, 2.0], 8)[:, np.newaxis]
        >>> codes = np.array([0, 1] * 4 + [1] * 8 + [0] * 8)
        >>> category_orders(kinds, codes, [3])
        {0: (array([1, 0, 2]), True)}
    """
    step = 1 + len(values) // _MOST_ROWS
    values, codes = values[::step], codes[::step]
    targets = np.equal.outer(codes, np.unique(codes)).astype(np.float64)
    targets *= np.linspace(1.0, 1.0 + _TILT, targets.shape[1])
    narrow = [k for k, n in enumerate(sizes) if 1 < n <= _MOST_ORDERED and len(codes)]
    parts = np.cumsum([sizes[k] + 1 for k in narrow]) // _MOST_INDICATORS
    result: dict[int, tuple[IntArray, bool]] = {}
    for part in np.unique(parts).tolist():
        columns = [k for k, own in zip(narrow, parts, strict=True) if own == part]
        if all(sizes[k] < 3 for k in columns):
            continue
        blocks = [np.ones((len(values), 1))]
        for column in columns:  # a missing value is one category more
            places = np.nan_to_num(values[:, column], nan=float(sizes[column]))
            blocks.append(np.equal.outer(places, np.arange(sizes[column] + 1.0)) + 0.0)
        orders = zip(columns, _orders(blocks, targets), strict=True)
        result |= {column: order for column, order in orders if sizes[column] > 2}
    return result


def _orders(
    blocks: Sequence[FloatArray], targets: FloatArray
) -> Iterator[tuple[IntArray, bool]]:
    """Yield the order of each column's indicators, and whether it adds to the others.

    Args:
        blocks: A column of ones, then the indicators of each column, missing last.
        targets: Indicators of the classes.
    """
    design = np.hstack(blocks)
    scatter = design.T @ design
    inverse = np.linalg.inv(scatter + _RIDGE * np.eye(len(scatter)))
    weights = inverse @ (design.T @ targets)
    freedom = len(design) - len(scatter) + 2 * len(blocks)
    noise = float(((targets - design @ weights) ** 2).sum()) / max(freedom, 1)
    end = 1
    for block in blocks[1:]:
        begin, end = end, end + block.shape[1]
        at = slice(begin, end - 1)
        counts = block[:, :-1].sum(axis=0)[:, np.newaxis]
        moved = weights[at] - (weights[at] * counts).sum(axis=0) / max(counts.sum(), 1)
        moved[counts[:, 0] == 0] = 0.0
        power = float((moved * np.linalg.solve(inverse[at, at], moved)).sum())
        least = _LEAST_F * (len(moved) - 1) * noise
        _, axes = np.linalg.eigh((moved * counts).T @ moved)
        along = np.round(moved @ axes[:, -1], _DIGITS)
        absence = (weights[end - 1] - weights[at].mean(axis=0)) @ axes[:, -1]
        side = float(np.sign(np.round(absence, _DIGITS)) * block[:, -1].any())
        ways = [np.argsort(sign * along, kind="stable") for sign in (1.0, -1.0)]
        far = side > 0, side < 0
        best = min((0, 1), key=lambda way: (far[way], ways[way].tolist()))
        yield ways[best], round(power - least, _DIGITS) > 0
