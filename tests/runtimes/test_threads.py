"""Blocks of rows in threads: the same bits, the limit, and calls that start none."""

from __future__ import annotations

import os
import threading
from typing import TYPE_CHECKING

import numpy as np
import pytest

from fuzzytree import tables
from fuzzytree.api.answering import prepare_answering
from fuzzytree.exporters.onnx import write_onnx
from fuzzytree.runtimes.native import load
from fuzzytree.runtimes.onnxruntime import OnnxModel, open_onnx
from fuzzytree.runtimes.predictions import joined
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_system, random_tree

if TYPE_CHECKING:
    from fuzzytree.model.contracts import Document
    from fuzzytree.runtimes.predictions import Outputs, Predictions

ROWS = 140_000  # three blocks
TREE = random_tree(3, leaves=12, inputs=3)
MODELS: dict[str, tuple[Document | OnnxModel, str | None]] = {
    "tree": (TREE, None),
    "rules": (rules_from_tree(random_tree(1), "raw"), None),
    "best-first": (rules_from_tree(random_tree(1), "raw"), "best-first"),
    "system": (random_system(5), None),
    "onnx": (open_onnx(write_onnx(TREE, verify=False).content, "tree.onnx"), None),
}


def _table(model: Document | OnnxModel) -> np.ndarray[tuple[int, int]]:
    inputs = model.inputs
    table = np.random.default_rng(0).normal(size=(ROWS, len(inputs)))
    table[::97, 0], table[5::89, -1] = np.nan, np.inf
    return table


def _predicted(
    model: Document | OnnxModel, runtime: str | None, table: object
) -> Predictions | Outputs:
    ready = prepare_answering(model, runtime)
    source = tables.table(table, columns=ready.inputs)
    return joined([*ready(source, lambda _, one: one)])


def _refuse(count: int, _: str) -> None:
    raise AssertionError(f"{count} threads were started")


@pytest.mark.parametrize(("model", "runtime"), MODELS.values(), ids=MODELS)
def test_one_thread_and_three_give_the_same_bits_as_few_rows(
    model: Document | OnnxModel, runtime: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = _table(model)
    few = np.r_[0:5, 46_660:46_680, 93_325:93_345, ROWS - 5 : ROWS]
    part, results = _predicted(model, runtime, table[few]), []
    for count in (1, 3):
        monkeypatch.setattr(tables, "THREADS", count)
        results.append(_predicted(model, runtime, table))
    for name in part.__struct_fields__:
        one, many = (getattr(result, name) for result in results)
        if isinstance(one, np.ndarray):
            is_real = one.dtype.kind == "f"
            assert np.array_equal(one, many, equal_nan=is_real)
            assert np.array_equal(one[..., few], getattr(part, name), equal_nan=is_real)


def test_omp_num_threads_lowers_the_number_of_threads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {*range(6)}, raising=False)
    counts = {}
    for text in ("1", "3,2", "64", "0", "many", ""):
        monkeypatch.setenv("OMP_NUM_THREADS", text)
        counts[text] = tables._thread_count()
    assert counts == {"1": 1, "3,2": 3, "64": 6, "0": 6, "many": 6, "": 6}


def test_one_block_and_the_run_of_a_runtime_start_no_thread(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(tables, "THREADS", 2)
    monkeypatch.setattr(tables, "ThreadPoolExecutor", _refuse)
    table = _table(TREE)
    assert len(load(TREE)(table.T).rule) == ROWS
    _predicted(TREE, None, table[: 1 << 16])
    with pytest.raises(AssertionError, match="2 threads were started"):
        _predicted(TREE, None, table)


def test_threads_start_no_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "THREADS", 2)

    def names(_: int) -> set[str]:
        inner = tables.in_order(lambda _: threading.current_thread().name, range(4))
        return {*inner, threading.current_thread().name}

    for one in tables.in_order(names, range(4)):
        assert len(one) == 1
