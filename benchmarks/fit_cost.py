"""What learning costs: beside GaussianNB on a million rows, and with 10,000 classes.

    python benchmarks/fit_cost.py [--rows 1000000] [--repeats 3] [--classes 10000]

The first part gives the ratio to GaussianNB's fit on rows x 11 with 7 classes, both in
this process, in turn, the fastest of each, and the most memory held beside the table.
The second learns classes x 16 features, 10 rows a class, in a process of its own.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from sklearn.naive_bayes import GaussianNB

from fuzzytree.learning import Settings, learn_arrays

FEATURES, CLASSES = 11, 7


def overlapping(
    rows: int, features: int, classes: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Return normal classes around random centres, in a fixed order of rows."""
    chance = np.random.default_rng(0)
    codes = chance.integers(0, classes, rows)
    codes[:classes] = np.arange(classes)
    values = chance.normal(size=(rows, features))
    values += chance.normal(scale=3.0, size=(classes, features))[codes]
    return values, codes


def peak_mib() -> float:
    """Return the largest resident size of this process so far, in MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def fastest(work: Callable[[], object]) -> float:
    """Return the seconds that a piece of work takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def compare(rows: int, repeats: int) -> None:
    """Print the ratio to GaussianNB and the memory above the table."""
    values, codes = overlapping(rows, FEATURES, CLASSES)
    names = [f"x{number}" for number in range(FEATURES)]
    labels = [str(number) for number in range(CLASSES)]

    def learn(**changes: object) -> object:
        settings = Settings(**changes)  # type: ignore[arg-type]
        return learn_arrays(
            values, codes, columns=names, classes=labels, settings=settings
        )

    tracemalloc.start()
    learn()
    above = tracemalloc.get_traced_memory()[1] / 2**20
    tracemalloc.stop()
    ours: dict[str, float] = {}
    peer = float("inf")
    for _ in range(repeats):
        peer = min(peer, fastest(lambda: GaussianNB().fit(values, codes)))
        for name, changes in (
            ("default", {}),
            ("one pattern a class", {"patterns_per_class": 1}),
            ("paper", {"mode": "paper"}),
        ):
            taken = fastest(lambda changes=changes: learn(**changes))  # type: ignore[misc]
            ours[name] = min(ours.get(name, float("inf")), taken)
    print(f"{rows} x {FEATURES}, {CLASSES} classes: GaussianNB {peer:.2f} s")
    for name, seconds in ours.items():
        print(f"  {name:<20} {seconds:6.2f} s  {seconds / peer:5.2f} times GaussianNB")
    size = values.nbytes / 2**20
    print(f"  most memory beside the table of {size:.0f} MiB: {above:.0f} MiB")


def many(classes: int) -> None:
    """Print what a tree of very many classes takes, in a process of its own."""
    values, codes = overlapping(10 * classes, 16, classes)
    names = [f"x{number}" for number in range(16)]
    labels = [f"class {number}" for number in range(classes)]
    start = time.perf_counter()
    found = learn_arrays(values, codes, columns=names, classes=labels)
    seconds = time.perf_counter() - start
    print(
        f"{classes} classes x 16, {len(values)} rows: {seconds:.1f} s, "
        f"{len(found.tree.leaves)} leaves, peak {peak_mib():.0f} MiB"
    )


def main() -> None:
    """Print both parts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--classes", type=int, default=10_000)
    parser.add_argument("--many", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.many:
        many(chosen.classes)
        return
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    print(
        f"Python {platform.python_version()}, numpy {np.__version__}, load {load:.1f}"
    )
    compare(chosen.rows, chosen.repeats)
    command = [sys.executable, __file__, "--many", "--classes", str(chosen.classes)]
    subprocess.run(command, check=True)


if __name__ == "__main__":
    main()
