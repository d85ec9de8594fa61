"""What learning costs: time beside GaussianNB's, memory, and very many classes.

And what more rows of a class bring: accuracy at a wavy border, by `rows_per_class`.

Run it with `python benchmarks/fit_cost.py`. Times are medians of interleaved runs;
memory is the largest that was allocated beyond the table.
"""

from __future__ import annotations

import multiprocessing
import resource
import statistics
import time
import tracemalloc
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from sklearn.naive_bayes import GaussianNB

import fuzzytree as ft
from fuzzytree.learning import ArrayLearner, LearningSettings, learn_arrays

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
T = TypeVar("T")

ROWS, COLUMNS, CLASSES = 1_000_000, 11, 7
MANY, MANY_COLUMNS, MANY_ROWS = 10_000, 16, 20
REPEATS = 3
WAVE_ROWS = 200_000


def main() -> None:
    """Print the costs."""
    print(f"a wavy border in {WAVE_ROWS:,} rows, by rows of a class")
    for rows in (5_000, 20_000, 100_000):
        share, leaves, seconds = at_a_wave(rows)
        print(f"  {rows:7,}: accuracy {share:.4f}, {leaves} leaves, {seconds:.1f} s")
    for text, gap in (("apart", 2.0), ("overlapping", 0.5), ("noise", 0.0)):
        print(f"{ROWS:,} x {COLUMNS}, {CLASSES} classes, {text}")
        values, labels = gaussian_classes(ROWS, COLUMNS, CLASSES, gap)
        for line in ratios(values, labels):
            print(f"  {line}", flush=True)
    print(f"  memory beyond the table: {memory_of_large():.0f} MB")
    print(f"{MANY:,} classes x {MANY_COLUMNS} features, {MANY_ROWS} rows each")
    for task in (many_default, many_paper):
        mode, seconds, peak_gb = in_a_process(task)
        print(f"  {mode}: {seconds:.1f} s, peak of the process {peak_gb:.2f} GB")


def wave(seed: int) -> tuple[FloatArray, IntArray]:
    """Return rows on both sides of a sine."""
    values = np.random.default_rng(seed).uniform(-1.0, 1.0, (WAVE_ROWS, 2))
    return values, (values[:, 1] > np.sin(4.0 * values[:, 0])).astype(np.int64)


def at_a_wave(rows_per_class: int) -> tuple[float, int, float]:
    """Return accuracy on other rows, leaves, and seconds of processor time."""
    values, labels = wave(0)
    settings = LearningSettings(rows_per_class=rows_per_class)
    start = time.process_time()
    tree = learn_arrays(
        values, labels, columns=["x", "y"], classes=["0", "1"], settings=settings
    ).tree
    seconds = time.process_time() - start
    values, labels = wave(1)
    predicted = np.asarray(ft.run(tree, values).classes).astype(np.int64)
    return float((predicted == labels).mean()), len(tree.leaves), seconds


def ratios(values: FloatArray, labels: IntArray) -> list[str]:
    """Return the time of each way to learn, as a ratio to GaussianNB's fit."""
    ways: dict[str, Callable[[], object]] = {
        "GaussianNB": lambda: GaussianNB().fit(values, labels),
        "default": lambda: learn(values, labels, LearningSettings()),
        "single columns": lambda: learn(
            values, labels, LearningSettings(columns_per_node=1)
        ),
        "paper": lambda: learn(values, labels, LearningSettings(mode="paper")),
        "partial_fit, 100 chunks": lambda: learn_in_chunks(values, labels, 100),
    }
    taken: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(REPEATS):
        for name, run in ways.items():
            start = time.perf_counter()
            run()
            taken[name].append(time.perf_counter() - start)
    base = statistics.median(taken["GaussianNB"])
    return [
        f"{name:24s} {statistics.median(times):6.2f} s "
        f"{statistics.median(times) / base:6.2f} x GaussianNB"
        for name, times in taken.items()
    ]


def names(letter: str, count: int) -> list[str]:
    """Return `a1`, `a2`, ..."""
    return [f"{letter}{k}" for k in range(1, count + 1)]


def learn(values: FloatArray, labels: IntArray, settings: LearningSettings) -> int:
    """Learn at once and return the number of leaves."""
    columns = names("x", values.shape[1])
    classes = names("c", int(labels.max()) + 1)
    found = learn_arrays(
        values, labels, columns=columns, classes=classes, settings=settings
    )
    return len(found.tree.leaves)


def learn_in_chunks(values: FloatArray, labels: IntArray, chunks: int) -> int:
    """Learn chunk by chunk and return the number of leaves."""
    columns = names("x", values.shape[1])
    learner = ArrayLearner(columns, names("c", int(labels.max()) + 1))
    for rows, codes in zip(
        np.array_split(values, chunks), np.array_split(labels, chunks), strict=True
    ):
        learner.partial_fit(rows, codes)
    return len(learner.finish().tree.leaves)


def gaussian_classes(
    rows: int, columns: int, classes: int, gap: float
) -> tuple[FloatArray, IntArray]:
    """Return gaussian classes whose centres have a spread of `gap`."""
    rng = np.random.default_rng(0)
    centres = rng.normal(0, 1, (classes, columns)) * gap
    labels = rng.integers(0, classes, rows)
    return rng.normal(size=(rows, columns)) + centres[labels], labels


def memory_of_large() -> float:
    """Return the largest memory that learning allocates beyond the table, in MB."""
    values, labels = gaussian_classes(ROWS, COLUMNS, CLASSES, 0.5)
    tracemalloc.start()
    learn(values, labels, LearningSettings())
    return tracemalloc.get_traced_memory()[1] / 2**20


def many(settings: LearningSettings) -> tuple[str, float, float]:
    """Return mode, seconds and peak GB of learning very many classes."""
    rng = np.random.default_rng(0)
    centres = rng.normal(size=(MANY, MANY_COLUMNS))
    labels = np.repeat(np.arange(MANY), MANY_ROWS)
    values = centres[labels] + 0.1 * rng.normal(size=(len(labels), MANY_COLUMNS))
    start = time.perf_counter()
    learn(values, labels, settings)
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return settings.mode, seconds, peak / 2**20


def many_default() -> tuple[str, float, float]:
    """Return the cost of very many classes in default mode."""
    return many(LearningSettings())


def many_paper() -> tuple[str, float, float]:
    """Return the cost of very many classes in paper mode."""
    return many(LearningSettings(mode="paper"))


def in_a_process(task: Callable[[], T]) -> T:
    """Return what a task returns, run in a fresh process."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_answer, args=(there, task))
    process.start()
    result: T = here.recv()
    process.join()
    return result


def _answer(pipe: Connection, task: Callable[[], object]) -> None:
    pipe.send(task())


if __name__ == "__main__":
    main()
