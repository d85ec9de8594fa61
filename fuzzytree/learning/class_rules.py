"""One rule for each class, where classes are too many for a tree.

A rule says `x1 is A AND x2 is A THEN A`: a class has a fuzzy set of its own on each
column that distinguishes classes, about its mean and as wide as its values spread. AND
is the product, so the strongest rule is that of the class under which the row is
likeliest, if columns do not depend on each other. The degrees of a set are a root of a
normal density, divided by the largest one on the column: a narrow set is higher than a
wide one, and a class of many rows higher than one of few. Far from the mean all sets
end at the same degree, so that some rule always fires, a single strange value decides
nothing, and a missing value, for which a number out there stands, has no say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from fuzzytree.errors import LearningError
from fuzzytree.learning.assembly import TermNames
from fuzzytree.learning.filling import FilledStatistics
from fuzzytree.learning.probabilities import in_parts
from fuzzytree.learning.sampling import Sample
from fuzzytree.learning.statistics import Statistics
from fuzzytree.learning.units import FloatArray, IntArray, tallied
from fuzzytree.model import (
    MOST_PROBABILITIES,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)

_STEPS = np.array([-5.0, -2.5, -1.0, 0.0, 1.0, 2.5, 5.0])  # points of a set, in spreads
_DENSITIES = np.exp(-0.5 * _STEPS**2)
_DIGITS = 6
_ROOT = 4
_COLUMNS_OF_ROOT = 48  # with more the root is a higher one, or strengths vanish
_SURE_COLUMNS = 6  # that count in full as evidence; what more columns say overlaps
_FURTHER_ROWS = 4.0  # with the spread or the shares of all classes, in each class
_FURTHER_CLASSES = 0.1  # rows of all classes evenly, in the probabilities of a rule
_MOST_POOLED = 10.0  # times the usual variance, in that within all classes
_CHANCE = 3.0  # standard errors above the power of a column that says nothing
_LEAST_SHARE = 0.01  # of the spread of all rows, in a set
_ULPS = 8
_MOST_CATEGORIES = 100
_MOST_SETS = 1 << 17

_NO_COLUMN = (
    "cannot learn a rule for each class: every column is constant, of too wide or "
    f"too narrow a range, or has more than {_MOST_CATEGORIES} categories\n"
    "  pass form='tree' to learn a tree"
)


@dataclass(frozen=True)
class _Sets:
    """The sets of the classes on one column.

    Attributes:
        power: How much the column differs between the classes, less what may be chance.
        values: Of the points of each set, shape (classes, points).
        densities: At the points, at most 1.
    """

    power: float
    values: FloatArray
    densities: FloatArray


def class_rules(
    names: TermNames,
    table: FilledStatistics,
    whole: Statistics,
    weights: FloatArray,
    supports: FloatArray,
) -> RuleBase:
    """Return a rule for each class that has rows.

    Args:
        names: Of the rules, the columns and the classes.
        table: The rows, whose missing values no known value is equal to.
        whole: All rows, which say the range of a column.
        weights: Of the rows.
        supports: How many rows of the table each class has.

    Raises:
        LearningError: If no column can have sets.
    """
    sample = table.sample
    present, codes = np.unique(sample.codes, return_inverse=True)
    weights = weights / weights.mean()
    sizes = tallied(codes, weights, len(present))
    is_known = sample.rows != table.stand_ins[: len(names.columns)]
    sets: dict[int, _Sets] = {}
    for place in range(len(names.columns)):
        known = np.flatnonzero(is_known[:, place])
        cells = codes[known], sample.rows[known, place]
        size = len(table.categories[place])
        if not len(known) or cells[1].min() == cells[1].max():
            continue
        if 0 < size <= _MOST_CATEGORIES:
            counts = np.zeros((len(present), size))
            np.add.at(counts, (cells[0], cells[1].astype(np.int64)), weights[known])
            sets[place] = _of_categories(counts)
        elif not size and sample.units.is_combinable[place]:
            sets[place] = _of_numbers(sample, place, codes, weights, known)
    if not sets:
        raise LearningError(_NO_COLUMN)
    order = sorted(sets, key=lambda place: -sets[place].power)
    chosen = [k for k in order if sets[k].power > 0] or order[:1]
    chosen = sorted(chosen[: max(1, _MOST_SETS // len(present))])
    root = _ROOT << _halvings(len(chosen), _COLUMNS_OF_ROOT)
    shares = (sizes / sizes.max()) ** (1 / len(chosen))
    labels = [names.classes[int(code)] for code in present]
    variables: list[Variable] = []
    for place in chosen:
        values, categories = sets[place].values, table.categories[place]
        degrees = np.maximum(sets[place].densities, _DENSITIES[0])
        degrees = np.round((shares[:, None] * degrees) ** (1 / root), _DIGITS)
        points = zip(labels, values.tolist(), degrees.tolist(), strict=True)
        terms = tuple(Term(label, Points((*x,), (*y,))) for label, x, y in points)
        low, high = whole.extent(place) if not categories else (0, len(categories) - 1)
        missing = None if math.isnan(table.stand_ins[place]) else float(values.min())
        if missing is not None and not is_known[:, place].all():
            low = min(missing, low)
        name = names.columns[place]
        variables.append(
            Variable(
                name,
                terms,
                names.units.get(name, ""),
                float(low),
                float(high),
                categories=categories,
                missing=missing,
                is_whole=name in names.whole,
            )
        )
    rules = [
        Rule(tuple(Proposition(v.name, (label,)) for v in variables), label, support)
        for label, support in zip(
            labels, np.rint(supports[present]).astype(int).tolist(), strict=True
        )
    ]
    semantics = Semantics("product")
    if len(rules) * len(names.classes) <= MOST_PROBABILITIES:
        vectors = np.zeros((len(rules), len(names.classes)))
        vectors[:, present] = _FURTHER_CLASSES / len(present)
        vectors[np.arange(len(rules)), present] += sizes
        vectors = in_parts(vectors / vectors.sum(axis=1, keepdims=True))
        pairs = zip(rules, vectors.tolist(), strict=True)
        rules = [replace(rule, probabilities=(*vector,)) for rule, vector in pairs]
        sharpness = max(1, root >> _halvings(len(chosen), _SURE_COLUMNS))
        semantics = Semantics("product", sharpness=sharpness)
    classes, columns = tuple(names.classes), tuple(names.columns)
    parts = (*variables,), (*rules,)
    return RuleBase(names.tree, classes, *parts, semantics, columns=columns)


def _halvings(count: int, most: int) -> int:
    """Return how often a count is halved until it is not above another one."""
    return max(0, math.ceil(math.log2(count / most)))


def _of_numbers(
    sample: Sample, place: int, codes: IntArray, weights: FloatArray, known: IntArray
) -> _Sets:
    """Return the sets on a column of numbers, by the rows in which they are known.

    The spread of a class is drawn towards the usual one, the more the fewer rows it
    has. The usual one is the median, which a few wide classes and strange values leave
    as it is, unless the spread of all rows within their classes is far larger.
    """
    classes = int(codes.max()) + 1
    values, codes, weights = sample.moved[known, place], codes[known], weights[known]
    sizes = tallied(codes, weights, classes)
    mean = float(weights @ values / weights.sum())
    means = tallied(codes, weights * values, classes) / np.where(sizes > 0, sizes, 1.0)
    means = np.where(sizes > 0, means, mean)
    within = tallied(codes, weights * (values - means[codes]) ** 2, classes)
    between = float(sizes @ (means - mean) ** 2) / max(classes - 1, 1)
    freedom = float(sizes.sum()) - classes
    usual, power = between / 4, between
    if freedom >= 1:
        pooled = float(within.sum()) / freedom
        error = math.sqrt(2 / max(classes - 1, 1) + 2 / freedom)
        power = between / max(pooled, 1e-300) - 1 - _CHANCE * error
        free = np.maximum(sizes - 1, 1.0)
        own = within / free / (1 - 2 / (9 * free)) ** 3  # the median of chi squared
        usual = max(float(np.median(own[sizes > 1])), pooled / _MOST_POOLED)
    usual = max(usual, _LEAST_SHARE**2 * between)
    rows = np.maximum(sizes, 1.0)
    variances = (within + _FURTHER_ROWS * usual) / (rows - 1 + _FURTHER_ROWS)
    spreads = np.sqrt(variances * (1 + 1 / rows))
    origin, exponent = sample.units.origins[place], sample.units.exponents[place]
    ulps = np.ldexp(np.spacing(np.abs(origin + np.ldexp(means, exponent))), -exponent)
    spreads = np.maximum(spreads, _ULPS * ulps)
    points = origin + np.ldexp(means[:, None] + _STEPS * spreads[:, None], exponent)
    heights = spreads.min() / spreads
    return _Sets(power, points, heights[:, None] * _DENSITIES)


def _of_categories(counts: FloatArray) -> _Sets:
    """Return the sets on a column of categories, given their weight in each class."""
    classes, categories = counts.shape
    sizes, usual = counts.sum(axis=1, keepdims=True), counts.sum(axis=0) / counts.sum()
    expected = np.maximum(sizes * usual, 1e-300)
    freedom = max((classes - 1) * (categories - 1), 1)
    power = float(((counts - sizes * usual) ** 2 / expected).sum()) / freedom
    likely = (counts + _FURTHER_ROWS * usual) / (sizes + _FURTHER_ROWS)
    densities = np.column_stack([np.zeros(classes), likely / likely.max()])
    values = np.tile(np.arange(-1.0, categories), (classes, 1))
    return _Sets(power - 1 - _CHANCE * math.sqrt(2 / freedom), values, densities)
