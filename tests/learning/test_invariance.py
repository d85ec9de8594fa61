"""What must not change a tree: units, offsets, the order of rows, chunks."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from fractions import Fraction
from typing import Any, Literal

import msgspec
import numpy as np
import pytest
from sklearn import datasets

from fuzzytree.exporters import yaml
from fuzzytree.learning import ArrayLearner, LearningSettings, Learnt, learn_arrays
from fuzzytree.learning.units import FloatArray, IntArray
from fuzzytree.model.functions import LR
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.semantics.reference import descend

Mode = Literal["default", "paper"]
MODES: tuple[Mode, ...] = ("default", "paper")
Table = tuple[FloatArray, IntArray]


def public(name: str) -> Table:
    values, labels = getattr(datasets, f"load_{name}")(return_X_y=True)
    return values, labels


def blobs(rows: int, *, step: float = 0.0, seed: int = 0) -> Table:
    """Return three overlapping classes, rounded to a step if there is one."""
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 3, rows)
    values = rng.normal(size=(rows, 4)) + 1.5 * rng.normal(size=(3, 4))[labels]
    return np.round(values / step) * step if step else values, labels


def ridges() -> Table:
    """Return three classes that a combination of columns alone separates."""
    rng = np.random.default_rng(0)
    labels = np.repeat([0, 1, 2], 150)
    along = 5.0 * rng.normal(size=450)
    across = 4.0 * labels + rng.normal(size=450)
    return np.column_stack([along, along + across, rng.normal(size=450)]), labels


TABLES: dict[str, Callable[[], Table]] = {
    "iris": lambda: public("iris"),
    "wine": lambda: public("wine"),
    "sampled": lambda: blobs(1_500),
    "sampled whole numbers": lambda: blobs(1_500, step=1.0),
    "ridges": ridges,
}
ROWS_PER_CLASS = 100
"""Fewer than the rows of a class in the tables that are sampled."""


def learner(table: Table, settings: LearningSettings | None = None) -> ArrayLearner:
    values, labels = table
    columns = [f"x{k}" for k in range(values.shape[1])]
    classes = [f"c{k}" for k in range(int(labels.max()) + 1)]
    return ArrayLearner(columns, classes, settings=settings or LearningSettings())


def learn(table: Table, settings: LearningSettings | None = None) -> Learnt:
    empty = learner(table, settings)
    return learn_arrays(
        *table,
        columns=empty.columns,
        classes=empty.classes,
        settings=empty.settings,
    )


class Unit(msgspec.Struct, frozen=True):
    """Another unit of a column: x becomes `x * 2**exponent + offset`."""

    exponent: int = 0
    offset: float = 0.0

    def value(self, x: float) -> float:
        return float(Fraction(x) * Fraction(2) ** self.exponent + Fraction(self.offset))

    def length(self, x: float) -> float:
        return math.ldexp(x, self.exponent)


def in_units(tree: FuzzyTree, units: dict[str, Unit]) -> FuzzyTree:
    """Return a tree whose numbers in the unit of a column are in another unit."""
    plain: Any = msgspec.to_builtins(tree)
    for variable in plain["variables"]:
        unit = units.get(variable["name"], Unit())
        variable["is_whole"] = False  # numbers are whole in some units alone
        for part in variable.get("parts", ()):
            own = units[part["input"]]
            part["weight"] = math.ldexp(part["weight"], -own.exponent)
            part["centre"] = own.value(part.get("centre", 0.0))
        _convert(variable, ("low", "high", "missing"), unit.value)
        for term in variable["terms"]:
            _convert(term["function"], ("low", "high", "left", "right"), unit.value)
    for node in plain["nodes"]:
        unit = units.get(node["variable"], Unit())
        node["cuts"] = [unit.value(cut) for cut in node["cuts"]]
    for sets in plain["sets"]:
        unit = units.get(sets["variable"], Unit())
        for term in sets["terms"]:
            _convert(term["function"], ("mean",), unit.value)
            for side in ("left", "right"):
                _convert(term["function"][side], ("spread",), unit.length)
    return msgspec.convert(plain, FuzzyTree)


def _convert(
    holder: dict[str, Any], names: tuple[str, ...], turn: Callable[[float], float]
) -> None:
    for name in names:
        if holder.get(name) is not None:
            holder[name] = turn(holder[name])


def narrowest(tree: FuzzyTree) -> float:
    """Return the smallest spread of the patterns' curves."""
    curves = [term.function for sets in tree.sets for term in sets.terms]
    assert all(isinstance(curve, LR) for curve in curves)
    return min(min(c.left.spread, c.right.spread) for c in curves if isinstance(c, LR))


def numbers(value: Any) -> list[float]:
    """Return all floats of a tree in order."""
    if isinstance(value, dict):
        return [n for part in value.values() for n in numbers(part)]
    if isinstance(value, list | tuple):
        return [n for part in value for n in numbers(part)]
    return [value] if isinstance(value, float) else []


def written(learnt: Learnt) -> bytes:
    """Return the tree's file and the report, byte by byte."""
    return yaml.write(learnt.tree).content + msgspec.json.encode(learnt.report)


def labels_of(tree: FuzzyTree, values: FloatArray) -> list[str | None]:
    return [
        descend(tree, dict(zip(tree.columns, row, strict=True))).label
        for row in values.tolist()
    ]


@pytest.mark.one_in(8)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", TABLES)
def test_a_column_times_a_power_of_two_gives_the_tree_in_that_unit(
    name: str, mode: Mode
) -> None:
    values, labels = TABLES[name]()
    settings = LearningSettings(mode=mode, rows_per_class=ROWS_PER_CLASS)
    base = learn((values, labels), settings)
    chance = random.Random(1)
    exponents = [chance.randint(-200, 200) for _ in base.tree.columns]
    found = learn((np.ldexp(values, exponents), labels), settings)
    units = {
        column: Unit(k) for column, k in zip(base.tree.columns, exponents, strict=True)
    }
    no_units = {column: Unit() for column in base.tree.columns}
    assert in_units(found.tree, no_units) == in_units(base.tree, units)
    assert found.report == base.report


@pytest.mark.parametrize("exponent", [-1000, -600, 600, 1000])
def test_a_unit_near_the_ends_of_the_floats_keeps_the_questions_of_one_column(
    exponent: int,
) -> None:
    values, labels = public("iris")
    settings = LearningSettings(mode="paper", columns_per_node=1)
    base = learn((values, labels), settings).tree
    found = learn((np.ldexp(values, exponent), labels), settings).tree
    units = {column: Unit(exponent) for column in base.columns}
    assert found == in_units(base, units)


@pytest.mark.one_in(8)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", TABLES)
def test_neither_order_nor_chunks_nor_merging_change_a_bit(
    name: str, mode: Mode
) -> None:
    values, labels = TABLES[name]()
    settings = LearningSettings(mode=mode, rows_per_class=ROWS_PER_CLASS)
    base = written(learn((values, labels), settings))
    rng = np.random.default_rng(2)
    order = rng.permutation(len(labels))
    shuffled = values[order], labels[order]
    assert written(learn(shuffled, settings)) == base
    borders = np.sort(rng.integers(0, len(labels), 9))
    parts: list[ArrayLearner] = []
    in_chunks = learner(shuffled, settings)
    for rows, codes in zip(*(np.split(a, borders) for a in shuffled), strict=True):
        in_chunks.partial_fit(rows, codes)
        parts.append(learner(shuffled, settings))
        parts[-1].partial_fit(rows, codes)
    assert written(in_chunks.finish()) == base
    joined = parts[7]
    for other in [*parts[:7][::-1], *parts[8:]]:
        joined.statistics = other.statistics.merge(joined.statistics)
    assert written(joined.finish()) == base


def test_one_row_at_a_time_gives_the_same_bits() -> None:
    values, labels = public("iris")
    single = learner((values, labels))
    for row, label in zip(values[::-1], labels[::-1], strict=True):
        single.partial_fit(row[None], np.array([label]))
    assert single.finish() == learn((values, labels))


@pytest.mark.heavy
def test_a_negative_zero_is_zero() -> None:
    values, labels = blobs(500, step=1.0)
    negative = np.where(values == 0, -0.0, values)
    positive = np.where(values == 0, 0.0, values)
    assert np.signbit(negative).sum() > np.signbit(positive).sum()
    found = msgspec.json.encode(learn((negative, labels)))
    assert found == msgspec.json.encode(learn((positive, labels)))


@pytest.mark.one_in(3)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("power", [3, 23, 40])
def test_a_column_moved_by_an_offset_gives_the_moved_tree(
    power: int, mode: Mode
) -> None:
    assert_an_offset_moves_the_tree(blobs(300, step=2.0**-10), power, mode)


@pytest.mark.heavy
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("power", range(1, 42, 4))  # SD / mean from 1 to 5e-13
def test_all_offsets_move_the_tree(power: int, mode: Mode) -> None:
    assert_an_offset_moves_the_tree(blobs(600, step=2.0**-8, seed=5), power, mode)


def assert_an_offset_moves_the_tree(table: Table, power: int, mode: Mode) -> None:
    """Learn a table at an offset; only what is stored there is rounded there.

    A number of the moved tree is rounded where it lies, one of the expected tree also
    where it was before the move. Curves lie up to one rounding step apart, so degrees
    differ by at most that times their slope, and with them the probabilities.
    """
    values, labels = table
    offset = 2.0**power
    settings = LearningSettings(mode=mode)
    base = learn((values, labels), settings).tree
    moved = values + offset
    assert (moved - offset == values).all()
    found = learn((moved, labels), settings).tree
    expected = in_units(base, {c: Unit(0, offset) for c in base.columns})
    kinds = [msgspec.to_builtins(tree) for tree in (found, expected, base)]
    chances = [
        numbers([leaf.pop("probabilities") for leaf in k["leaves"]]) for k in kinds
    ]
    trios = zip(*map(numbers, kinds), strict=True)
    assert all(abs(a - b) <= math.ulp(b) + math.ulp(c) for a, b, c in trios)
    bound = 1e-6 + 2 * math.ulp(offset) / narrowest(base)
    assert max(abs(a - b) for a, b in zip(*chances[:2], strict=True)) <= bound
    # The decisions are the same ones, bit for bit.
    assert [n.cuts for n in found.nodes] == [n.cuts for n in expected.nodes]
    assert [n.owners for n in found.nodes] == [n.owners for n in expected.nodes]
    assert found.inputs == expected.inputs
    parts = [[v.parts for v in t.variables if v.parts] for t in (found, expected)]
    assert parts[0] == parts[1]
    assert labels_of(found, moved[:200]) == labels_of(base, values[:200])


@pytest.mark.one_in(6)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("offset", [-0.625, 12345.6875, 1e9 + 1.5])
def test_any_offset_without_rounding_keeps_every_answer(
    offset: float, mode: Mode
) -> None:
    values, labels = blobs(300, step=2.0**-10)
    moved = values + offset
    assert (moved - offset == values).all()
    settings = LearningSettings(mode=mode)
    base, found = (learn((v, labels), settings).tree for v in (values, moved))
    # A cut is rounded in the table's unit, to another place between the same rows.
    assert [n.owners for n in found.nodes] == [n.owners for n in base.nodes]
    assert found.leaves == base.leaves
    assert labels_of(found, moved) == labels_of(base, values)


@pytest.mark.heavy
def test_a_column_at_1e12_with_a_spread_of_1_is_as_good_as_one_at_0() -> None:
    values, labels = blobs(600)
    far = values + 1e12
    near = far - 1e12  # exact: what is left of the digits
    assert (near + 1e12 == far).all()
    found, base = learn((far, labels)).tree, learn((near, labels)).tree
    assert labels_of(found, far) == labels_of(base, near)
    assert [len(n.cuts) for n in found.nodes] == [len(n.cuts) for n in base.nodes]


@pytest.mark.heavy
def test_columns_twenty_decades_apart_are_combined_as_if_they_were_alike() -> None:
    values, labels = blobs(600)
    base = learn((values, labels)).tree
    exponents = [-66, 66, 0, 33]
    found = learn((np.ldexp(values, exponents), labels)).tree
    units = {c: Unit(k) for c, k in zip(base.columns, exponents, strict=True)}
    assert any(v.parts for v in base.variables)
    assert found == in_units(base, units)


def test_a_table_taken_twice_counts_twice_and_keeps_means_and_ends() -> None:
    values, labels = public("iris")
    settings = LearningSettings(mode="paper", columns_per_node=1)
    base = learn((values, labels), settings).tree
    twice = learn((np.tile(values, (2, 1)), np.tile(labels, 2)), settings).tree
    assert [leaf.support for leaf in twice.leaves] == [
        2 * (leaf.support or 0) for leaf in base.leaves
    ]
    for mine, other in zip(base.sets, twice.sets, strict=True):
        for a, b in zip(mine.terms, other.terms, strict=True):
            plain_a, plain_b = map(msgspec.to_builtins, (a.shape, b.shape))
            assert plain_a["mean"] == plain_b["mean"]
            # n - 1 of n = 50 becomes 2n - 1: the variance is 98 / 99 of what it was.
            ratio = plain_b["left"]["spread"] / plain_a["left"]["spread"]
            assert ratio == pytest.approx(math.sqrt(98 / 99), rel=1e-15)
