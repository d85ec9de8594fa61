"""What audits decide, and how long they take, over models of three kinds.

    python benchmarks/audit_states.py [KIND ...]

prints the table of docs/explanation/prover.md: third-party systems (where the programs
that ship them are installed), trees learnt from scikit-learn's tables with their rules,
and generated rule bases. Seconds are of the processor and contain the re-check.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # for tests.*

from sklearn import datasets

import fuzzytree as ft
from tests.auditing.decide.old_bases import Kind, random_base
from tests.interop.corpus_fcl import FCL
from tests.interop.corpus_fis import FIS
from tests.interop.corpus_fll import FLL

Model = ft.RuleBase | ft.FuzzyTree | ft.FuzzySystem

STATES = ("Proved", "Computed", "Witness", "Bracket", "Declined")
BUDGET = 20.0
LEFT_OUT = ("FT6", "FT7")  # they need rows or runtimes


def third_party() -> Iterator[Model]:
    """Yield the systems that fuzzylite, pyfuzzylite and Octave ship."""
    for corpus in (FCL, FIS, FLL):
        for _, path in corpus.files():
            yield corpus.read(path.read_bytes(), path.name).model


def learnt() -> Iterator[Model]:
    """Yield trees, with their relative and their raw rules."""
    for name in ("iris", "wine", "breast_cancer", "digits"):
        values, labels = getattr(datasets, f"load_{name}")(return_X_y=True)
        tree = ft.FuzzyTreeClassifier().fit(values, [str(one) for one in labels]).tree_
        yield tree
        yield ft.rules_from_tree(tree, "relative")
        yield ft.rules_from_tree(tree, "raw")


def generated() -> Iterator[Model]:
    """Yield 40 rule bases of six rules on two inputs."""
    kinds: tuple[Kind, ...] = ("points", "band", "lr", "mixed")
    for seed in range(5):
        for kind in kinds:
            yield random_base(seed, 6, 2, "minimum", kind, odd=0.3, shared=0.4)
            yield random_base(seed, 6, 2, "product", kind, odd=0.3, shared=0.4)


KINDS: Mapping[str, Callable[[], Iterator[Model]]] = {
    "third-party systems": third_party,
    "learnt trees and rules": learnt,
    "generated rule bases": generated,
}


def row(name: str) -> str:
    """Return a row of the table."""
    states: Counter[str] = Counter()
    count, seconds = 0, 0.0
    for model in KINDS[name]():
        start = time.process_time()
        audit = ft.audit(
            model,
            selection=ft.AuditSelection(skip=LEFT_OUT),
            settings=ft.AuditSettings(budget=BUDGET),
        )
        seconds += time.process_time() - start
        states.update(type(one.state).__name__ for one in audit.answers)
        count += 1
    cells = (name, count, *(states[one] for one in STATES), f"{seconds:.0f}")
    return f"| {' | '.join(map(str, cells))} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Count what audits decide.")
    parser.add_argument("kinds", nargs="*", default=[*KINDS], metavar="KIND")
    given = parser.parse_args()
    titles = ("models", "count", *(one.upper() for one in STATES), "s")
    print(f"| {' | '.join(titles)} |")
    print("|---" * len(titles) + "|")
    for name in given.kinds:
        print(row(name), flush=True)


if __name__ == "__main__":
    main()
