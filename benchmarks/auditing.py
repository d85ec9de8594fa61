"""How long audits take: exact questions, branch and bound, and models that are large.

    python benchmarks/auditing.py            questions about small rule bases
    python benchmarks/auditing.py --more     20 x 11 and 40 x 11 too; some minutes
    python benchmarks/auditing.py --large    whole audits of large models in a budget

A question is whether a rule is anywhere stronger than all rules of other classes. Times
are seconds of the processor, so that others on the machine change them little. The
floor is what nobody can do without: one evaluation of all rules in fractions, as it
takes to tell a witness. Each ratio is to it, in the same run.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import platform
import random
import resource
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # for tests.*

from fuzzytree.auditing.engine import arrangement as arrangements
from fuzzytree.auditing.engine.arrangement import arrange, rule_strengths
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.levels import levels_of
from fuzzytree.auditing.engine.questions import wins
from fuzzytree.auditing.decide.states import State
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
from fuzzytree.numerics.oracle import decide
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree
from tests.auditing.decide.old_bases import random_base, unit_domain, with_hidden_rule

BUDGET_S = 2.0  # for one question under the product


class Asked(NamedTuple):
    """All questions about a rule base.

    Attributes:
        states: The answers.
        cut_s: What it took to cut the axes.
        each_s: What each question took.
        floor_s: One evaluation of all rules in fractions.
        levels: How many critical levels there are.
    """

    states: list[State]
    cut_s: float
    each_s: list[float]
    floor_s: float
    levels: int


def asked(base: RuleBase, budget_s: float) -> Asked:
    """Ask of each rule whether it ever wins."""
    arrangements.arrange.cache_clear()
    box = unit_domain(base)
    start = time.process_time()
    arrangement = arrange(base, box)
    is_minimum = base.semantics.conjunction == "minimum"
    levels = len(levels_of(arrangement).levels) if is_minimum else 0
    cut_s = time.process_time() - start
    states: list[State] = []
    each: list[float] = []
    for number, rule in enumerate(base.rules, 1):
        rivals = [n for n, one in enumerate(base.rules, 1) if one.then != rule.then]
        clock = Clock(budget_s, now=time.process_time)
        start = time.process_time()
        states.append(wins(arrangement, number, rivals, clock))
        each.append(time.process_time() - start)
    point = {name: Fraction(3, 8) for name in base.inputs}
    start = time.process_time()
    for _ in range(10):
        rule_strengths(base, point)
    floor = (time.process_time() - start) / 10
    return Asked(states, cut_s, each, floor, levels)


def told(name: str, found: Sequence[Asked]) -> None:
    """Print a line about rule bases of one kind."""
    every = [one for of in found for one in of.each_s]
    states = Counter(type(one).__name__ for of in found for one in of.states)
    floor = statistics.median(of.floor_s for of in found)
    middle = statistics.median(every)
    closed = states["Witness"] + states["Proved"] + states["Computed"]
    cut = statistics.median(of.cut_s for of in found)
    whole = statistics.median(of.cut_s + sum(of.each_s) for of in found)
    levels = f"{found[-1].levels:6}" if found[-1].levels else "     -"
    print(
        f"  {name:40} {levels} {cut:8.3f} {1e3 * middle:9.1f} {max(every):8.2f} "
        f"{whole:8.3f} {1e3 * floor:7.2f} {middle / floor:7.0f}  "
        f"{closed} of {len(every)}, {states['Proved']} proved"
    )


def kinds(
    conjunction: Conjunction, rules: int, features: int, seed: int
) -> Iterator[tuple[str, RuleBase]]:
    """Yield rule bases of a size, each with what is special about it."""
    for kind in ("lr", "points", "mixed"):
        plain = random_base(seed, rules, features, conjunction, kind)
        yield kind, plain
        yield f"{kind}, one never wins", with_hidden_rule(plain)
    sliver = with_hidden_rule(random_base(seed, rules, features, conjunction), 0.699999)
    yield "lr, one wins in a sliver", sliver
    odd = random_base(
        seed, rules, features, conjunction, "mixed", odd=0.3, combinations=2
    )
    yield "mixed, negations, ORs, sums of inputs", odd


def questions(conjunction: Conjunction, rules: int, features: int, count: int) -> None:
    """Print how long questions take about generated rule bases of one size."""
    budget = BUDGET_S if conjunction == "product" else 60.0
    print(f"\n{conjunction}, {rules} x {features}, {budget:g} s for a question at most")
    print(
        f"  {'rule bases':40} {'levels':>6} {'cut s':>8} {'median ms':>9} "
        f"{'max s':>8} {'all s':>8} {'floor':>7} {'ratio':>7}  closed"
    )
    found: dict[str, list[Asked]] = {}
    for seed in range(count):
        for name, base in kinds(conjunction, rules, features, seed):
            found.setdefault(name, []).append(asked(base, budget))
    for name, of in found.items():
        told(name, of)


def a_sliver(rows: int) -> None:
    """Print how a rule that wins in a sliver is found, and how often rows meet it."""
    base = with_hidden_rule(random_base(0, 7, 4, "minimum", "lr"), 0.7 - 1e-6)
    found = asked(base, 60.0)
    start = time.process_time()
    values = np.random.default_rng(0).random((len(base.inputs), rows))
    hits = int(
        (decide(base, values, with_strengths=False).rule == len(base.rules)).sum()
    )
    drawn = time.process_time() - start
    taken = found.cut_s + found.each_s[-1]
    print(
        f"\na rule that wins in a sliver: {type(found.states[-1]).__name__} in "
        f"{taken:.3f} s; {hits} of {rows} random rows meet it, in {drawn:.1f} s"
    )


# --- whole audits of large models


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


def whole(name: str, budget_s: float) -> str:
    """Return a line about the audit of one large model; for a process of its own."""
    base = LARGE[name]()
    box = unit_domain(base, -3.0 if "tree" in name else 0.0, 1.0)
    clock = Clock(budget_s, now=time.process_time)
    start, wall = time.process_time(), time.perf_counter()
    found = audit(
        Material(base),
        domain=box,
        settings=AuditSettings(budget_s=budget_s),
        clock=clock,
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
        f"  {name:32} {budget_s:6g} {taken:6.1f} {wall:6.1f} {most:6.0f} {known:6} "
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
    parser = argparse.ArgumentParser(description="Time audits, and questions of them.")
    parser.add_argument("--bases", type=int, default=5, help="of each kind")
    parser.add_argument("--more", action="store_true", help="20 x 11 and 40 x 11 too")
    parser.add_argument("--large", action="store_true", help="whole audits")
    parser.add_argument("--budgets", type=float, nargs="+", default=[5.0])
    given = parser.parse_args()
    load = ", ".join(f"{one:.1f}" for one in os.getloadavg())
    print(
        f"{platform.python_implementation()} {platform.python_version()}, numpy "
        f"{np.__version__}, {os.cpu_count()} processors ({platform.machine()}), load "
        f"{load}; one process, seeds 0 to {given.bases - 1}"
    )
    if given.large:
        large(given.budgets)
        return
    questions("minimum", 7, 4, given.bases)
    questions("minimum", 12, 8, max(given.bases // 2, 1))
    a_sliver(1_000_000)
    questions("product", 7, 4, given.bases)
    if given.more:
        questions("minimum", 20, 11, max(given.bases // 5, 1))
        questions("minimum", 40, 11, 1)
        questions("product", 20, 11, max(given.bases // 5, 1))


if __name__ == "__main__":
    main()
