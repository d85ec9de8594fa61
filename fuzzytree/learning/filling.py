"""What stands for missing values, and what the tree says of its columns.

Growing needs a number in each cell. A text becomes the position of its category, and a
missing cell the stand-in of its column, which the tree then has as data: a row with a
missing value is a point of the input space like any other, in training and afterwards.

The stand-in of a column of numbers is its lower median where no value was missing. Else
it is the decile that predicts the classes of the rows without a value best, or a place
of its own below the column, if the classes of these rows are so different from those of
any decile that a number more pays (Bayesian information criterion). A column of text
has the place -1 for what was missing, or its most common category.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from fuzzytree.columns import is_missing_code, positions, text_codes
from fuzzytree.learning.orders import category_orders
from fuzzytree.learning.sampling import Sample
from fuzzytree.learning.statistics import Statistics
from fuzzytree.learning.units import BoolArray, FloatArray, IntArray
from fuzzytree.model import Band, FuzzyTree, Term, Variable

MISSING = "missing"
"""The name of an interval that holds missing values and nothing else."""

_DECILES = 10
_SHOWN = 12  # categories in the name of a term


@dataclass(frozen=True)
class FilledStatistics:
    """A table without missing cells and without texts.

    Attributes:
        statistics: Of the rows with what stands for missing cells; where a cell was
            missing or a text, those of the sample.
        sample: Rows of it.
        stand_ins: What stands for a missing value, by column; NaN for nothing.
        categories: The categories of each column, none of numbers.
        sizes: How many categories each column has; 0 for numbers, and for categories
            that came in an order.
        combinable: Which columns may enter combinations.
    """

    statistics: Statistics
    sample: Sample
    stand_ins: FloatArray
    categories: tuple[tuple[str, ...], ...]
    sizes: IntArray
    combinable: BoolArray

    def without_last_column(self) -> tuple[FilledStatistics, FloatArray]:
        """Return the table without its last column, and this of the sample."""
        statistics = self.statistics.of_columns(range(len(self.categories) - 1))
        sample, last = self.sample.without_last_column()
        columns = self.stand_ins[:-1], self.categories[:-1]
        kinds = self.sizes[:-1], self.combinable[:-1]
        return FilledStatistics(statistics, sample, *columns, *kinds), last


def filled(
    statistics: Statistics,
    categories: Sequence[tuple[str, ...]],
    *,
    is_ordered: Sequence[bool],
    drops: bool,
    is_apart: bool = False,
) -> FilledStatistics:
    """Return a table whose cells are all numbers, and what stands for missing ones.

    Args:
        statistics: Of the table, with the codes of texts.
        categories: Of each column, empty for numbers.
        is_ordered: Which columns have categories that came in an order, which they
            keep; others get one (see `fuzzytree.learning.orders`).
        drops: Whether rows with a missing value are left out, as in the paper; nothing
            stands for a missing value then.
        is_apart: Whether what stands for a missing value is no value of the column.
    """
    none = np.full(len(categories), math.nan)
    names = [*categories]
    sizes = np.where(is_ordered, 0, [len(one) for one in names]).astype(np.int64)
    combinable = sizes <= 2
    if drops and not any(names):
        kept = statistics.complete() if statistics.dropped else statistics
        return FilledStatistics(kept, kept.sample(), none, (*names,), sizes, combinable)
    raw = statistics.sample()
    if drops:
        is_whole = ~is_missing_code(raw.rows).any(axis=1)
        raw = raw.at(np.flatnonzero(is_whole))
    rows = raw.rows.copy()
    for column in np.flatnonzero([len(one) > 0 for one in names]).tolist():
        rows[:, column] = positions(rows[:, column], names[column])
    orders = category_orders(rows, raw.codes, sizes.tolist())
    for column, (order, adds) in orders.items():
        names[column] = tuple(names[column][place] for place in order.tolist())
        rows[:, column] = positions(raw.rows[:, column], names[column])
        combinable[column] = adds
    stand_ins = np.array(
        [
            _category(values, is_apart=is_apart)
            if texts
            else _number(values, raw.codes, is_apart=is_apart)
            for values, texts in zip(rows.T, names, strict=True)
        ]
    )
    if statistics.dropped or any(names):
        rows = np.where(np.isnan(rows), np.nan_to_num(stand_ins), rows)
        statistics = Statistics(statistics.classes, statistics.features, len(rows) or 1)
        statistics.update(rows, raw.codes)
        raw = statistics.sample()
        stand_ins = none if drops else stand_ins
    return FilledStatistics(statistics, raw, stand_ins, (*names,), sizes, combinable)


def _category(values: FloatArray, *, is_apart: bool) -> float:
    """Return -1 where a category is missing, else the most common one's position."""
    if is_apart or np.isnan(values).any() or not len(values):
        return -1.0
    return float(np.bincount(values.astype(np.int64)).argmax())


def _number(values: FloatArray, codes: IntArray, *, is_apart: bool) -> float:
    """Return what stands for a missing number; NaN if none is known."""
    is_known = np.isfinite(values)
    known = values[is_known]
    if not len(known):
        return math.nan
    ordered = np.sort(known)
    low, high = float(ordered[0]), float(ordered[-1])
    step = math.ldexp(1.0, math.frexp(high - low)[1] - 2) if high > low else 1.0
    below = low - step
    if is_apart:
        return min(below, math.nextafter(low, -math.inf))
    median = float(ordered[(len(ordered) - 1) // 2])
    if is_known.all():
        return median
    gone = codes[~is_known]
    classes = int(codes.max()) + 1
    steps = (np.arange(_DECILES) * 2 + 1) * (len(ordered) - 1) // (2 * _DECILES)
    places = np.unique([median, *ordered[steps].tolist()])
    nearest = np.abs(known[:, np.newaxis] - places).argmin(axis=1)
    likely = [
        _likelihood(codes[is_known][nearest == k], gone, classes)
        for k in range(len(places))
    ]
    best = int(np.argmax(likely))
    own = _likelihood(gone, gone, classes)
    price = 0.5 * (len(np.unique(codes)) - 1) * math.log(len(codes))
    if math.isfinite(below) and own - likely[best] > price:
        return below
    return float(places[best])


def _likelihood(near: IntArray, gone: IntArray, classes: int) -> float:
    """Return the log-likelihood of classes by the shares of others, half a row more."""
    shares = np.bincount(near, minlength=classes) + 0.5
    return float(np.log(shares / shares.sum())[gone].sum())


def described(
    tree: FuzzyTree, columns: Sequence[str], table: FilledStatistics, whole: Statistics
) -> FuzzyTree:
    """Return a tree with categories, stand-ins, and terms that are named by them.

    Args:
        tree: The tree that was grown.
        columns: The names of the columns.
        table: What it was grown from.
        whole: All rows, which say the range of a column.
    """
    place = {name: k for k, name in enumerate(columns)}
    names: dict[tuple[str, str], str] = {}
    variables: list[Variable] = []
    for variable in tree.variables:
        if variable.parts:
            variables.append(variable)
            continue
        k = place[variable.name]
        categories, stand = table.categories[k], float(table.stand_ins[k])
        least, most = (
            whole.extent(k) if not categories else (0.0, len(categories) - 1.0)
        )
        missing = None if math.isnan(stand) else stand
        is_below = missing is not None and missing < least
        shown = [t.name for t in variable.terms]
        if categories:
            first = 0 if missing != -1.0 else -1
            shown = [_category_name(t, categories, first) for t in variable.terms]
        elif is_below:
            shown = [MISSING if _ends(t)[1] < least else t.name for t in variable.terms]
        terms = zip(variable.terms, _unlike(shown), strict=True)
        renamed = {term.name: name for term, name in terms}
        names |= {(variable.name, old): new for old, new in renamed.items()}
        variables.append(
            replace(
                variable,
                terms=tuple(Term(renamed[t.name], t.function) for t in variable.terms),
                low=missing if is_below else least,
                high=most,
                categories=categories,
                missing=missing,
            )
        )
    nodes = tuple(
        replace(
            node,
            branches=tuple(
                replace(
                    branch,
                    terms=tuple(
                        names.get((node.variable, term), term) for term in branch.terms
                    ),
                )
                for branch in node.branches
            ),
        )
        for node in tree.nodes
    )
    return replace(tree, variables=tuple(variables), nodes=nodes)


def _category_name(term: Term, categories: Sequence[str], first: int) -> str:
    low, high = _ends(term)
    inside = [k for k in range(first, len(categories)) if low < k <= high]
    shown = [categories[k] if k >= 0 else MISSING for k in inside[:_SHOWN]]
    if len(inside) > _SHOWN:
        shown.append(f"{len(inside) - _SHOWN} more")
    return " or ".join(shown) or "no category"


def _ends(term: Term) -> tuple[float, float]:
    """Return the open lower and the closed upper end of a term's plateau."""
    band = term.function
    low = band.low if isinstance(band, Band) and band.low is not None else -math.inf
    high = band.high if isinstance(band, Band) and band.high is not None else math.inf
    return low, high


def _unlike(names: Iterable[str]) -> list[str]:
    """Return names of which no two are equal."""
    result: list[str] = []
    for name in names:
        unique, number = name, 1
        while unique in result:
            number += 1
            unique = f"{name} ({number})"
        result.append(unique)
    return result


def codes_of_positions(
    values: FloatArray, columns: Sequence[str], categories: Mapping[str, Sequence[str]]
) -> FloatArray:
    """Return rows, shape (rows, columns), with codes in the place of positions."""
    result = values
    for k, name in enumerate(columns):
        if categories.get(name):
            known = np.append(text_codes(categories[name]), math.nan)
            column = values[:, k]
            is_known = (column >= 0) & (column < len(known) - 1)
            place = np.where(is_known, column, len(known) - 1).astype(np.int64)
            result = result.copy() if result is values else result
            result[:, k] = known[place]
    return result
