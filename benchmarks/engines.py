"""How fast fuzzy systems run, here and in third-party engines.

    python benchmarks/engines.py [--quick] [--write docs/reference/engines.md]

Two systems: the tipper of examples/tipper.fll, and the relative rules of a tree with
seven leaves and straight flanks, with a number for each rule. Both are measured by
`fuzzytree bench` with the peers beside this file, in interleaved rounds.
"""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

from msgspec.structs import replace
from peers.systems import load_fuzzylite_cpp

import fuzzytree as ft
from fuzzytree.benchmarking import BenchSettings, Point, Study
from fuzzytree.benchmarking.candidates import Layouts, load_runtime
from fuzzytree.benchmarking.clock import time_calls, times_faster
from fuzzytree.benchmarking.judging import made_rows
from fuzzytree.model import (
    And,
    Conclusion,
    Defuzzifier,
    FuzzySystem,
    Proposition,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
)
from fuzzytree.model.rulebase import Band, RuleBase
from fuzzytree.report.bench import machine_rows
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree

ROOT = Path(__file__).resolve().parents[1]
ROWS = 10_000


def main() -> None:
    """Print the tables, and write them on request."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer rounds")
    parser.add_argument("--write", metavar="FILE", help="a page with the tables")
    options = parser.parse_args()
    text = "\n".join(_page(5 if options.quick else 15)) + "\n"
    print(text)
    if options.write:
        Path(options.write).write_text(_HEAD + text, encoding="utf-8")


def _page(rounds: int) -> Iterator[str]:
    tipper = ft.load(ROOT / "examples" / "tipper.fll")
    if not isinstance(tipper, FuzzySystem):
        raise SystemExit("the tipper is read as something else")
    seven = seven_rules()
    settings = BenchSettings(
        rows=(1, ROWS),
        threads=(1,),
        budget_s=60.0 * rounds,
        rounds=rounds,
        peers=str(Path(__file__).with_name("peers")),
    )
    studies = [ft.bench(system, settings=settings) for system in (tipper, seven)]
    for name, fact in machine_rows(studies[0].machine):
        yield f"- {name}: {fact}"
    yield "- fuzzylite of Debian, g++ and gcc -O2"
    for title, study in zip(("The tipper", "Seven rules"), studies, strict=True):
        yield f"\n## {title}\n"
        yield from _table(study)
    yield ""
    yield from _decided(seven, rounds)


def _table(study: Study) -> Iterator[str]:
    """Yield the rows of a table, the fastest for many rows first, and what to know."""
    times = {
        (point.name, timing.rows): timing.median_ns
        for point in study.points
        for timing in point.timings
    }
    many = [point for point in study.points if (point.name, ROWS) in times]
    ours = [times[one.name, ROWS] for one in many if one.kind == "runtime"]
    yield "| engine | one row, us | 10,000 rows, ms | times ours | largest difference |"
    yield "| --- | ---: | ---: | ---: | ---: |"
    for point in sorted(many, key=lambda one: times[one.name, ROWS]):
        batch = times[point.name, ROWS]
        yield (
            f"| {_short(point)} | {times[point.name, 1] / 1e3:.3g} | {batch / 1e6:.3g} "
            f"| {batch / min(ours):.2f} | {_difference(point)} |"
        )
    loops = [f"{name}: system" for name in ("c", "fuzzylite c++")]
    if all((name, ROWS) in times for name in loops):
        mine, other = (times[name, ROWS] for name in loops)
        text = "Row after row, in a loop of C or C++, generated C is"
        yield f"\n{text} {other / mine:.0f} times as fast as fuzzylite's C++."
    yield ""
    yield from (f"- {_short(one)}: {one.note}" for one in many if one.note)
    yield from (f"- {one.name}: {one.why}" for one in study.omissions)


def _short(point: Point) -> str:
    return point.name.removesuffix(f": {point.question}")


def _difference(point: Point) -> str:
    if point.error is None:
        return ""
    numbers = [one.largest for one in point.error.outputs.values()]
    sizes = [number for number in numbers if number is not None]
    if len(sizes) < len(numbers):
        return "other rows have numbers"
    return f"{max(sizes):.1e}" if any(sizes) else "0"


def _decided(system: FuzzySystem, rounds: int) -> Iterator[str]:
    """Say what it costs in C to decide by the tree that the seven rules equal."""
    tree = random_tree(_seed(), leaves=7, combinations=0.0)
    values, _ = made_rows(tree, ROWS)
    right = find_runtime("reference").load(tree)(values).rule
    decide = load_runtime(find_runtime("c"), tree, Layouts(), 1)
    if not (find_runtime("c").load(tree)(values).rule == right).all():
        raise SystemExit("the tree in C decides otherwise")
    calls = {
        "tree": decide.call(values),
        "rules": load_fuzzylite_cpp(system, 1).call(values),
    }
    timings = time_calls(calls, rows=ROWS, rounds=rounds).timings
    ratio = times_faster(timings["rules"], timings["tree"])
    if ratio is None:
        raise SystemExit("the two share no round")
    yield (
        "If you need the decision of these rules and not a number, use the tree that "
        "they equal,\nby proof and on all of these rows: in C "
        f"{timings['tree'].median_ns / ROWS:.1f} ns a row, {ratio.median:.0f} times as "
        "fast as fuzzylite's C++ fires the rules."
    )


def seven_rules() -> FuzzySystem:
    """Return the relative rules of a tree with seven leaves as a weighted average."""
    rules = _straight(_seed())
    curves = {
        (v.name, t.name): _trapezoid(t.shape) for v in rules.variables for t in v.terms
    }
    inputs = tuple(
        Variable(
            v.name,
            tuple(Term(_word(t.name), curves[v.name, t.name]) for t in v.terms),
            low=v.low,
            high=v.high,
        )
        for v in rules.variables
    )
    output = SystemOutput(
        "answer",
        tuple(Term(f"rule{k}", Singleton(float(k))) for k in range(1, 8)),
        0.0,
        8.0,
        Defuzzifier("weighted average"),
    )
    written = tuple(
        SystemRule(
            And(
                tuple(Proposition(c.variable, (_word(c.terms[0]),)) for c in rule.when)
            ),
            (Conclusion("answer", f"rule{number}"),),
        )
        for number, rule in enumerate(rules.rules, 1)
    )
    return FuzzySystem("seven", inputs, (output,), (RuleBlock(written),))


def _seed() -> int:
    """Return the first seed whose rules ask for one term in each proposition."""
    return next(s for s in range(1000) if _is_plain(_straight(s)))


def _straight(seed: int) -> RuleBase:
    """Return the rules of a random tree without its origin."""
    rules = rules_from_tree(random_tree(seed, leaves=7, combinations=0.0))
    return replace(rules, kind=None)


def _is_plain(rules: RuleBase) -> bool:
    propositions = [proposition for rule in rules.rules for proposition in rule.when]
    return len(rules.inputs) == 4 and all(len(c.terms) == 1 for c in propositions)


def _trapezoid(shape: object) -> Trapezoid:
    """Return a straight band as a trapezoid, which differs at its edges alone."""
    if not isinstance(shape, Band):
        raise TypeError("relative rules have bands")
    low, high = shape.low, shape.high
    a = low if shape.left is None else shape.left
    d = high if shape.right is None else shape.right
    inner = [one for one in (low, high) if one is not None]
    return Trapezoid(
        a, inner[0] if low is None else low, inner[-1] if high is None else high, d
    )


def _word(name: str) -> str:
    return re.sub(r"\W", "_", name)


_HEAD = """\
# Our runtimes beside third-party engines

`python benchmarks/engines.py --write docs/reference/engines.md`, on a quiet machine.
Medians of interleaved rounds; one thread, except where noted. *Times ours* compares
10,000 rows with the fastest of our runtimes. *Largest difference* is that of the
outputs from the reference's, on the same rows.

"""


if __name__ == "__main__":
    main()
