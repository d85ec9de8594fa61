"""How many times as long a rule base takes as its tree, with the number of rules."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from trees import COLUMNS, grow, multiway_tree, tree_of

from fuzzytree.benchmarking.clock import (
    CallTimings,
    Interval,
    TimeSource,
    time_calls,
    times_faster,
)
from fuzzytree.errors import LossError
from fuzzytree.model.contracts import Run
from fuzzytree.model.rulebase import Kind, RuleBase
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.runtimes.table import find_runtime, is_installed
from fuzzytree.semantics.lowering import rules_from_tree
from paper.records import Family, Price, Size, Times, What

Floats = npt.NDArray[np.float64]
Tell = Callable[[str], None]

SIZES = (7, 20, 50, 100, 300, 1000, 3000, 10_000)
FAMILIES: tuple[Family, ...] = ("multiway", "grown")
KINDS: tuple[Kind, ...] = ("relative", "raw")
FIRING = ("reference", "native", "onnxruntime float64", "scikit-fuzzy")

ROUNDS = 11  # the median lies between the second and the tenth with 98 %
BATCH = 10_000  # rows in one call
MOST_STRENGTHS = 10_000_000  # rows times rules: 80 MB
SLOW_BATCH = 1_000  # of scikit-fuzzy, which walks graphs of Python objects
SINGLES = 64  # rows given one at a time: they take paths of all lengths
SAMPLE_S = 0.02  # firing takes as long for every row, so few of them do
PATIENCE_S = 20.0  # what preparing one rule base may take
SHORT_S = 2.0  # preparing that took less says nothing of larger ones

OWN_TIME = TimeSource(time.thread_time_ns, None)
"""The thread's time, which does not run while a neighbour has the core.

Everything that is timed runs in this thread alone.
"""


class ModelKind(NamedTuple):
    """A model, ready in a runtime."""

    what: What
    kind: Kind | None
    runtime: str
    run: Run

    @property
    def name(self) -> str:
        """What tells it from the others."""
        return " ".join(filter(None, (self.what, self.kind, self.runtime)))


class Bench:
    """The trees, measured one by one, and what had to be left out."""

    def __init__(self, *, rounds: int, tell: Tell) -> None:
        self.rounds = rounds
        self.tell = tell
        self.omissions: list[str] = []
        self.given_up: set[str] = set()
        self.taken: dict[tuple[str, Kind, Family], tuple[int, float]] = {}

    def sizes(self, numbers: Sequence[int], *, seconds: float) -> Iterator[Size]:
        """Yield what was measured of each tree, small trees first.

        No tree is begun after so many seconds; each gets an even share of what is left.
        """
        begin, own = time.monotonic(), time.thread_time()
        todo = [(number, family) for number in numbers for family in FAMILIES]
        for place, (number, family) in enumerate(todo):
            passed = time.monotonic() - begin
            left = seconds - passed
            if left <= 0:
                self.omissions.append(
                    f"{family} trees of {number:,} rules: the time was over"
                )
                continue
            self.tell(f"{family} tree of {number:,} rules")
            # Where neighbours have the core as well, less of what is left is ours.
            share = (time.thread_time() - own) / passed if passed > 1.0 else 1.0
            yield self._size(number, family, left * share / (len(todo) - place))

    def _size(self, number: int, family: Family, seconds: float) -> Size:
        begin = time.thread_time()
        tree = multiway_tree(number) if family == "multiway" else _grown(number)
        rules = {kind: rules_from_tree(tree, kind) for kind in KINDS}
        representations = self._representations(tree, rules, family)
        rows = np.random.default_rng(1).normal(size=(len(COLUMNS), BATCH))
        rows = rows[[COLUMNS.index(name) for name in tree.inputs]]
        path, checked = _verified(representations, tree, rows)
        left = max(seconds - (time.thread_time() - begin), 1.0)
        prices = [
            *self._prices(representations, rows, left / 2, is_batch=False),
            *self._prices(representations, rows, left / 2, is_batch=True),
        ]
        propositions = [
            proposition for rule in rules["raw"].rules for proposition in rule.when
        ]
        return Size(
            family,
            len(tree.leaves),
            path,
            len(propositions),
            # Rules of one tree share the values of their propositions.
            len({id(proposition) for proposition in propositions}),
            checked,
            tuple(prices),
        )

    def _representations(
        self, tree: FuzzyTree, rules: dict[Kind, RuleBase], family: Family
    ) -> list[ModelKind]:
        found: list[ModelKind] = []
        for name in FIRING:
            if not is_installed(find_runtime(name)):
                self._omit(f"{name}: it is not installed")
                continue
            if "tree" in find_runtime(name).runs:
                run = find_runtime(name).load(tree)
                found.append(ModelKind("tree", None, name, run))
            for kind in KINDS:
                loaded = self._loaded(name, kind, rules[kind], family)
                if loaded:
                    found.append(ModelKind("rules", kind, name, loaded))
        for kind in KINDS:
            run = find_runtime("best-first").load(rules[kind])
            found.append(ModelKind("best-first", kind, "native", run))
        return found

    def _loaded(
        self, runtime: str, kind: Kind, rules: RuleBase, family: Family
    ) -> Run | None:
        """Prepare rules, unless they are too many or would take too long."""
        number = len(rules.rules)
        before, seconds = self.taken.get((runtime, kind, family), (number, 0.0))
        expected = seconds * (number / before) ** 2
        if seconds > SHORT_S and expected > PATIENCE_S:
            self._omit(
                f"{runtime}, {kind} rules of the {family} tree, {number:,} of them: "
                f"preparing {before:,} took {seconds:.1f} s, and the square of their "
                f"number is what it may grow with ({expected:.0f} s)"
            )
            return None
        if runtime in self.given_up:
            return None
        begin = time.thread_time()
        try:
            run = find_runtime(runtime).load(rules)
        except LossError as error:
            self.given_up.add(runtime)
            reason = str(error).partition(": ")[2]
            self._omit(f"{runtime}, from {number:,} rules on: {reason}")
            return None
        self.taken[runtime, kind, family] = number, time.thread_time() - begin
        return run

    def _omit(self, sentence: str) -> None:
        if sentence not in self.omissions:
            self.omissions.append(sentence)

    def _prices(
        self,
        representations: Sequence[ModelKind],
        rows: Floats,
        seconds: float,
        *,
        is_batch: bool,
    ) -> Iterator[Price]:
        chosen = [
            c for c in representations if not (is_batch and c.runtime == "reference")
        ]
        counts: dict[str, int] = {}
        calls: dict[str, Callable[[], object]] = {}
        for representation in chosen:
            prepare = _batch if is_batch else _singles
            counts[representation.name], calls[representation.name] = prepare(
                representation, rows
            )
        timed = time_calls(
            calls, rows=1, rounds=self.rounds, seconds=seconds, clock=OWN_TIME
        )
        if timed.is_interrupted:
            raise KeyboardInterrupt
        for error in timed.failures.values():
            raise error
        for representation in chosen:
            if representation.name in timed.timings:
                yield _price(representation, timed, counts, is_batch=is_batch)


def _grown(number: int) -> FuzzyTree:
    return tree_of(grow(number, is_many=False))


def _verified(
    representations: Sequence[ModelKind], tree: FuzzyTree, rows: Floats
) -> tuple[float, int]:
    """Return the questions that a row meets, and how many rows were compared.

    Relative rules must give the tree's answers and best-first those of firing, in every
    runtime; scikit-fuzzy, whose curves are points, is not asked about raw rules.

    Raises:
        RuntimeError: If one answers differently.
    """
    run = {
        representation.name: representation.run for representation in representations
    }
    lengths = [len(rule.when) for rule in rules_from_tree(tree).rules]
    met = np.array([0, *lengths])[run["tree native"](rows).rule]
    checked = min(BATCH, max(MOST_STRENGTHS // len(lengths), 1))
    few = rows[:, :checked]
    by_tree = run["tree native"](few).rule
    by_raw = run["rules raw native"](few).rule
    most = {"reference": 2, "scikit-fuzzy": SLOW_BATCH}
    for representation in representations:
        if representation.runtime == "scikit-fuzzy" and representation.kind == "raw":
            continue
        count = most.get(representation.runtime, checked)
        expected = by_raw if representation.kind == "raw" else by_tree
        if np.any(representation.run(few[:, :count]).rule != expected[:count]):
            raise RuntimeError(
                f"{representation.name} gives other answers than it must"
            )
    return float(met.mean()), checked


def _singles(
    representation: ModelKind, rows: Floats
) -> tuple[int, Callable[[], object]]:
    """Return a call that gives rows one at a time, and how many it gives.

    What a tree and best-first take depends on the row, so they answer many. Firing
    takes as long for each, so that a few tell as much.
    """
    ones = [np.ascontiguousarray(rows[:, k : k + 1]) for k in range(SINGLES)]
    if representation.what == "rules":
        representation.run(ones[0])
        begin = time.perf_counter()
        representation.run(ones[0])
        taken = time.perf_counter() - begin
        ones = ones[: max(1, min(SINGLES, int(SAMPLE_S / taken)))]
    return len(ones), partial(_one_by_one, representation.run, ones)


def _one_by_one(run: Run, ones: Sequence[Floats]) -> None:
    for row in ones:
        run(row)


def _batch(representation: ModelKind, rows: Floats) -> tuple[int, Callable[[], object]]:
    """Return a call that gives all rows at once, and how many they are."""
    count = BATCH
    if representation.what == "rules":
        count = min(BATCH, MOST_STRENGTHS // _rules_of(representation, rows))
    if representation.runtime == "scikit-fuzzy":
        count = min(count, SLOW_BATCH)
    return count, partial(representation.run, np.ascontiguousarray(rows[:, :count]))


def _rules_of(representation: ModelKind, rows: Floats) -> int:
    strengths = representation.run(rows[:, :1]).strengths
    return 1 if strengths is None else len(strengths)


def _price(
    representation: ModelKind,
    timed: CallTimings,
    counts: dict[str, int],
    *,
    is_batch: bool,
) -> Price:
    timing, rows = timed.timings[representation.name], counts[representation.name]
    runs_trees = "tree" in find_runtime(representation.runtime).runs
    tree = f"tree {representation.runtime if runs_trees else 'native'}"
    firing = f"rules {representation.kind} {representation.runtime}"

    def against(slow: str, fast: str) -> Times | None:
        if slow == fast or not {slow, fast} <= set(timed.timings):
            return None
        found = times_faster(timed.timings[slow], timed.timings[fast])
        return _scaled(found, counts[fast] / counts[slow])

    is_search = representation.what == "best-first"
    return Price(
        representation.what,
        representation.kind,
        representation.runtime,
        is_batch,
        rows,
        ns=timing.median_ns / rows,
        low=timing.low_ns / rows,
        high=timing.high_ns / rows,
        rounds=len(timing.samples_ns),
        to_tree=against(representation.name, tree),
        to_firing=against(firing, representation.name) if is_search else None,
    )


def _scaled(found: Interval | None, factor: float) -> Times | None:
    if found is None:
        return None
    return Times(found.median * factor, found.low * factor, found.high * factor)
