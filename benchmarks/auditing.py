"""What audits of large models decide within a budget, and what they take.

    python benchmarks/auditing.py --budgets 5 60

A budget is counted in million steps, a model after the other in a process of its own.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import platform
import random
import resource
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # for tests.*

from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.records import AuditSettings
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.model.rulebase import (
    Conjunction,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree
from tests.auditing.decide.old_bases import random_base, unit_domain


def shared(
    rules: int,
    inputs: int,
    terms: int,
    classes: int,
    propositions: int,
    conjunction: Conjunction = "minimum",
) -> RuleBase:
    """Return rules over the same few triangles of each input, on [0, 1]."""
    chance = random.Random(f"{rules} {inputs} {terms} {classes} {propositions}")
    step = 1.0 / (terms - 1)
    of = tuple(
        Term(
            f"t{n}", Points(((n - 1) * step, n * step, (n + 1) * step), (0.0, 1.0, 0.0))
        )
        for n in range(terms)
    )
    names = [f"x{n}" for n in range(inputs)]
    made = [
        Rule(
            tuple(
                Proposition(name, (f"t{chance.randrange(terms)}",))
                for name in sorted(chance.sample(names, propositions))
            ),
            f"c{number % classes}",
        )
        for number in range(rules)
    ]
    return RuleBase(
        "shared",
        tuple(f"c{n}" for n in range(classes)),
        tuple(Variable(name, of, low=0.0, high=1.0) for name in names),
        tuple(made),
        Semantics(conjunction),
    )


def long_curves(points: int) -> RuleBase:
    """Return four rules over curves of many points."""
    chance = random.Random(points)

    def variable(name: str) -> Variable:
        curves = (
            Points(
                tuple(sorted(chance.random() for _ in range(points))),
                tuple(chance.random() for _ in range(points)),
            )
            for _ in "ab"
        )
        terms = tuple(Term(*of) for of in zip("ab", curves, strict=True))
        return Variable(name, terms, low=0.0, high=1.0)

    ways = (("a", "a", "c"), ("a", "b", "d"), ("b", "a", "d"), ("b", "b", "c"))
    rules = tuple(
        Rule((Proposition("x", (a,)), Proposition("y", (b,))), label)
        for a, b, label in ways
    )
    return RuleBase("long", ("c", "d"), (variable("x"), variable("y")), rules)


LARGE: dict[str, Callable[[], RuleBase]] = {
    "20 x 11, curves of their own": lambda: random_base(1, 20, 11),
    "200 x 60, 5 triangles an input": lambda: shared(200, 60, 5, 4, 60),
    "200 x 60, 6 propositions a rule": lambda: shared(200, 60, 5, 4, 6),
    "the same, product": lambda: shared(200, 60, 5, 4, 6, "product"),
    "200 x 60, curves of their own": lambda: random_base(1, 200, 60, classes=5),
    "500 x 2, 25 triangles an input": lambda: shared(500, 2, 25, 3, 2),
    "500 x 2, curves of their own": lambda: random_base(1, 500, 2),
    "1000 rules of one class": lambda: shared(1000, 4, 7, 1, 4),
    "60 classes": lambda: shared(120, 6, 5, 60, 6),
    "5 x 2000": lambda: random_base(1, 5, 2000),
    "a tree of 200 leaves, as rules": lambda: rules_from_tree(
        random_tree(3, leaves=200)
    ),
    "curves of 4000 points": lambda: long_curves(4000),
}


def whole(name: str, budget: float) -> str:
    """Return a line about the audit of one large model; for a process of its own."""
    base = LARGE[name]()
    box = unit_domain(base, -3.0 if "tree" in name else 0.0, 1.0)
    start, wall = time.process_time(), time.perf_counter()
    found = audit(
        Material(base),
        domain=box,
        settings=AuditSettings(budget=budget),
    )
    taken, wall = time.process_time() - start, time.perf_counter() - wall
    states = Counter(type(one.state).__name__ for one in found.answers)
    left = sum(": not run: the budget" in text for text in found.unasked)
    cut = sum(": cut short" in text for text in found.unasked)
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    known = (
        states["Witness"] + states["Proved"] + states["Computed"] + states["Sampled"]
    )
    return (
        f"  {name:32} {budget:6g} {taken:6.1f} {wall:6.1f} {most:6.0f} {known:6} "
        f"{states['Bracket']:6} {states['Declined']:6} {cut:6} {left:6}"
    )


def large(budgets: Sequence[float]) -> None:
    """Print what audits of large models know within a budget, and what they take."""
    print(
        f"\n  {'rules x inputs':32} {'budget':>6} {'cpu s':>6} {'wall s':>6} {'MB':>6} "
        f"{'known':>6} {'open':>6} {'declin':>6} {'cut':>6} {'unasked':>7}"
    )
    fresh = multiprocessing.get_context("spawn")
    for name in LARGE:
        for budget in budgets:
            with fresh.Pool(1) as pool:  # a process each, for its memory
                print(pool.apply(whole, (name, budget)), flush=True)


def main() -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(description="Time audits of large models.")
    parser.add_argument("--budgets", type=float, nargs="+", default=[5.0])
    options = parser.parse_args()
    load = ", ".join(f"{part:.1f}" for part in os.getloadavg())
    print(
        f"{platform.python_implementation()} {platform.python_version()}, numpy "
        f"{np.__version__}, {os.cpu_count()} processors ({platform.machine()}), load "
        f"{load}"
    )
    large(options.budgets)


if __name__ == "__main__":
    main()
