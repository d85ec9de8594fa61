"""Tables for the tests of engines, and what pandas makes of them."""

from __future__ import annotations

import decimal
from functools import cache

import numpy as np
import pandas as pd
import pyarrow as pa

import fuzzytree as ft
from fuzzytree.model import FuzzyTree, fingerprint

ROWS = 20_000
_PANDAS = {
    pa.bool_(): pd.BooleanDtype(),
    pa.decimal128(2, 1): pd.ArrowDtype(pa.decimal128(2, 1)),
}


@cache
def random_rows() -> pd.DataFrame:
    """Return rows of far magnitudes in random order, some without a value or a class.

    The class `rare` has one row, and the column `row` counts them.
    """
    random = np.random.default_rng(0)
    codes = random.integers(0, 3, ROWS)
    scales = [1.0, 1e-9, 1e12, 1.0]
    means = codes[:, None] * np.array([2.0, 1.0, 1.0, 0.0])
    values = (random.normal(size=(ROWS, 4)) + means) * scales
    result = pd.DataFrame(values, columns=["a", "b", "c", "d"])
    result["kind"] = np.array(["soft", "firm", "hard"], dtype=object)[codes]
    result["row"] = np.arange(ROWS)
    result.loc[7, "b"] = np.nan
    result.loc[11, "kind"] = None
    result.loc[13, "kind"] = "rare"
    return result


@cache
def random_tree() -> FuzzyTree:
    """Return what pandas learns from the random rows."""
    return ft.learn(random_rows(), target="kind", ignore=["row"])


@cache
def random_predictions() -> pd.DataFrame:
    """Return the predictions of pandas for the random rows: those of `run`."""
    result = ft.predict(random_rows(), random_tree())
    ran = ft.run(random_tree(), random_rows())
    assert arrow_of(result)["class"].to_pylist() == ran.classes
    assert np.array_equal(result["rule"], ran.rule)
    return result


def arrow_of(table: pd.DataFrame) -> pa.Table:
    """Return a table with null where a value is missing."""
    return pa.Table.from_pandas(table, preserve_index=False)


def typed_rows(labels: list[object]) -> pd.DataFrame:
    """Return rows with integers, booleans and decimals, some of them missing."""
    count = 240
    numbers = np.arange(count)
    classes = [labels[k % len(labels)] for k in numbers.tolist()]
    tenth = decimal.Decimal("0.1")
    table = {
        "whole": pa.array((numbers * 7) % 31 + numbers % len(labels) * 2**50),
        "flag": pa.array([None if k % 50 == 9 else k % 3 == 0 for k in numbers]),
        "price": pa.array([tenth * (k % 40) for k in numbers.tolist()]),
        "single": pa.array(((numbers * 11) % 17 / 3).astype(np.float32)),
        "size": pa.array(classes),
    }
    return pa.table(table).to_pandas(types_mapper=_PANDAS.get)


def same_tree(tree: FuzzyTree, other: FuzzyTree) -> bool:
    """Return whether two trees have the same bits."""
    return fingerprint(tree) == fingerprint(other)
