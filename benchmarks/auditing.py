"""How long it takes to prove things about generated rule bases.

    PYTHONPATH=. python benchmarks/auditing.py

A question is whether a rule is anywhere stronger than all rules of other classes.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections import Counter
from collections.abc import Iterator

import numpy as np

from fuzzytree.numerics.oracle import decide
from fuzzytree.proving.bounding import wins_by_boxes
from fuzzytree.proving.clock import Clock
from fuzzytree.proving.ground import _axes, ground
from fuzzytree.proving.wins import wins
from fuzzytree.rulebase import RuleBase
from tests.proving.bases import random_base, unit_domain, with_hidden_rule

BUDGET_S = 2.0


def product_bases(
    rules: int, features: int, count: int
) -> Iterator[tuple[str, RuleBase]]:
    """Yield rule bases under the product, each with what is special about it."""
    for seed in range(count):
        for kind in ("lr", "mixed"):
            plain = random_base(seed, rules, features, "product", kind)
            yield f"{kind}", plain
            yield f"{kind}, one never wins", with_hidden_rule(plain)
            yield f"{kind}, one wins in a sliver", with_hidden_rule(plain, 0.7 - 1e-6)
            shared = random_base(seed, rules, features, "product", kind, shared=0.5)
            yield f"{kind}, shared terms", shared
        odd = random_base(
            seed, rules, features, "product", "mixed", odd=0.3, combinations=2
        )
        yield "mixed, negations, ORs, sums of inputs", odd


def by_boxes(rules: int, features: int, count: int) -> None:
    """Print how many questions branch and bound answers, and how long they take."""
    print(f"product, {rules} x {features}, {BUDGET_S} s for a question")
    states: dict[str, Counter[str]] = {}
    times: dict[str, list[float]] = {}
    for name, base in product_bases(rules, features, count):
        for number, rule in enumerate(base.rules, 1):
            rivals = [n for n, one in enumerate(base.rules, 1) if one.then != rule.then]
            start = time.perf_counter()
            state = wins_by_boxes(
                base, unit_domain(base), number, rivals, Clock(BUDGET_S)
            )
            times.setdefault(name, []).append(time.perf_counter() - start)
            states.setdefault(name, Counter())[type(state).__name__] += 1
    for name, taken in times.items():
        closed = states[name]["Witness"] + states[name]["Proved"]
        print(
            f"  {name:40} {closed:4} of {len(taken):4} closed "
            f"({states[name]['Proved']} proved), median "
            f"{1e3 * statistics.median(taken):.0f} ms, longest {max(taken):.2f} s"
        )


def by_cells(rules: int, features: int, count: int) -> None:
    """Print how long all questions take under the minimum, exactly."""
    print(f"min, {rules} x {features}, all questions about a rule base")
    for kind in ("lr", "points", "mixed"):
        for is_hidden in (False, True):
            laid: list[float] = []
            taken: list[float] = []
            states: Counter[str] = Counter()
            for seed in range(count):
                base = random_base(seed, rules, features, "min", kind)
                base = with_hidden_rule(base) if is_hidden else base
                _axes.cache_clear()
                start = time.perf_counter()
                given = ground(base, unit_domain(base))
                levels = len(given.laid[1].low)
                middle = time.perf_counter()
                for number, rule in enumerate(base.rules, 1):
                    rivals = [
                        n
                        for n, one in enumerate(base.rules, 1)
                        if one.then != rule.then
                    ]
                    states[type(wins(given, number, rivals)).__name__] += 1
                laid.append(middle - start)
                taken.append(time.perf_counter() - middle)
            print(
                f"  {kind:6} {'one never wins' if is_hidden else '':14} "
                f"{levels:6} levels; cut {statistics.median(laid):.3f} s, asked "
                f"{statistics.median(taken):.3f} s (longest {max(taken):.3f}); "
                + ", ".join(f"{n} {state}" for state, n in sorted(states.items()))
            )


def a_sliver(rows: int) -> None:
    """Print how a rule that wins in a sliver is found, and how often rows meet it."""
    base = with_hidden_rule(random_base(0, 7, 4, "min", "lr"), 0.7 - 1e-6)
    number = len(base.rules)
    rivals = [
        n for n, one in enumerate(base.rules, 1) if one.then != base.rules[-1].then
    ]
    start = time.perf_counter()
    given = ground(base, unit_domain(base))
    state = wins(given, number, rivals)
    taken = time.perf_counter() - start
    values = np.random.default_rng(0).random((len(base.inputs), rows))
    hits = int((decide(base, values, with_strengths=False).rule == number).sum())
    print(
        f"a rule that wins in a sliver: {type(state).__name__} in {taken:.3f} s; "
        f"{hits} of {rows} rows drawn at random"
    )


def main() -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bases", type=int, default=10, help="of each kind")
    parser.add_argument("--large", action="store_true", help="20 x 11 too")
    asked = parser.parse_args()
    by_cells(7, 4, asked.bases)
    by_cells(12, 8, max(asked.bases // 2, 1))
    a_sliver(1_000_000)
    if asked.large:
        by_cells(20, 11, max(asked.bases // 5, 1))
        by_cells(40, 11, 1)
    by_boxes(7, 4, asked.bases)
    if asked.large:
        by_boxes(20, 11, max(asked.bases // 5, 1))


if __name__ == "__main__":
    main()
