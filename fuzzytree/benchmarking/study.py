"""A study: every candidate tried, judged against the exact answer, and timed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import msgspec

from fuzzytree.benchmarking import trial
from fuzzytree.benchmarking.candidates import chosen, gather, questions, title
from fuzzytree.benchmarking.clock import (
    SURE,
    Call,
    CallTimings,
    TimeSource,
    system_clock,
    time_calls,
)
from fuzzytree.benchmarking.front import advice, fronts
from fuzzytree.benchmarking.judging import CandidateJudge, made_rows, repeated
from fuzzytree.benchmarking.machine import after, machine, noise
from fuzzytree.benchmarking.records import (
    Candidate,
    Error,
    LoadedCandidate,
    Machine,
    Omission,
    Point,
    Study,
    Timing,
)
from fuzzytree.model import (
    Document,
    FloatArray,
    Progress,
    as_names,
    fingerprint,
    noticed,
)
from fuzzytree.runtimes import baseline

ROWS = (1, 1_000, 1_000_000)
THREADS = (1, 2)
BUDGET_S = 300.0

_MADE = 100_000  # rows that are made where there is no table; more are these again
_TRIED = 16  # rows that a child process answers
_MOST_BYTES = 6 * 2**30  # for all layouts of the rows of a study
_MOST_THREADS = 256  # thousands of them do nothing but wait for each other
_SHARE = 0.1  # of the time: what a single candidate may take at most


class BenchSettings(msgspec.Struct, frozen=True):
    """What a study shall do.

    Attributes:
        rows: Rows in a call, each a column of the study.
        threads: Threads that a candidate is allowed, one number after another.
        most: The largest error of a strength that the user allows, if any.
        budget_s: The time for the study, beside that for loading peers; see `bench`.
        rounds: The most samples of each timing.
        seed: Of made rows, and of the order of the rounds.
        peers: The path of a Python module or package, which is run, and whose function
            `peers(model, bounds)` returns further candidates and omissions.

    Raises:
        ValueError: If one of them cannot be.
    """

    rows: tuple[int, ...] = ROWS
    threads: tuple[int, ...] = THREADS
    most: float | None = None
    budget_s: float = BUDGET_S
    rounds: int = 15
    seed: int = 0
    peers: str | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be done, before any work."""
        for name, values in (("rows", self.rows), ("threads", self.threads)):
            if isinstance(values, int):  # pyright: ignore[reportUnnecessaryIsInstance]
                raise TypeError(f"{name}: takes several numbers, such as ({values},)")
            if not values:
                raise ValueError(f"{name}: name at least one number")
            for value in values:
                if value < 1:
                    raise ValueError(f"{name}: 1 is the least, not {value}")
        if max(self.threads) > _MOST_THREADS:
            raise ValueError(
                f"threads: {_MOST_THREADS} is the most, not {max(self.threads)}"
            )
        if not 0 < self.budget_s < math.inf:
            raise ValueError(
                f"the budget must be a number of seconds above 0, not {self.budget_s:g}"
            )
        if self.most is not None and not 0 <= self.most <= 1:
            raise ValueError(
                f"an error of a strength lies in [0, 1], not at {self.most:g}"
            )
        for name, value, least in (("rounds", self.rounds, 1), ("seed", self.seed, 0)):
            if value < least:
                raise ValueError(f"{name}: {least} is the least, not {value}")


def bench(
    model: Document,
    *,
    values: FloatArray | None = None,
    data: str = "",
    select: Sequence[str] = (),
    skip: Sequence[str] = (),
    plan: BenchSettings | None = None,
    progress: Progress | None = None,
) -> Study:
    """Measure error against run time for every way of running a model.

    Args:
        model: A tree, a rule base or a fuzzy system.
        values: Rows of shape (inputs, rows), in the order of `model.inputs`; repeated
            where a call has more. Rows are made of the declared ranges if None.
        data: What to call them.
        select: Names of candidates, or the part before the colon, or a question, or a
            kind (`runtime`, `variant`, `peer`, `floor`): the others are left out.
        skip: The same, for what is left out.
        plan: How many rows, threads, seconds.
        progress: Called with the current step and the share that is done.

    Returns:
        The study. What cannot be run is among its omissions. Ctrl-C ends it early and
        keeps what was measured.

    Raises:
        ValueError: If the values have no row or another shape, or a name is unknown.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> few = BenchSettings(rows=(10,), threads=(1,), rounds=6, budget_s=5.0)
        >>> study = bench(random_tree(1), select=["native"], plan=few)
        >>> [point.name for point in study.points]
        ['native: tree', 'native: relative rules', 'native: raw rules']
    """
    plan = plan or BenchSettings()
    if values is None:
        count = min(max(plan.rows), _MADE)
        values, origin = made_rows(model, count, seed=plan.seed)
        text = _data_text(f"{_rows(count)} {origin}", count, plan)
    else:
        width = len(model.inputs)
        if values.ndim != 2 or values.shape[0] != width:
            text = f"values must have shape ({width}, rows), not {values.shape}"
            raise ValueError(text)
        count = values.shape[1]
        if not count:
            raise ValueError("there are no rows to answer; give at least one")
        text = _data_text(f"{data or 'a table'}, {_rows(count)}", count, plan)
    candidates, omitted = gather(model, values, plan.peers)
    kept, left = chosen(candidates, as_names(select), as_names(skip))
    return run_study(
        model,
        kept,
        values=values,
        data=text,
        omissions=[*omitted, *left],
        plan=plan,
        progress=progress,
    )


def _rows(count: int) -> str:
    return f"{count:,} row{'' if count == 1 else 's'}"


def _data_text(text: str, count: int, plan: BenchSettings) -> str:
    more = [f"{rows:,}" for rows in sorted(plan.rows) if rows > count]
    return f"{text}, repeated to make {' and '.join(more)}" if more else text


def run_study(
    model: Document,
    candidates: Sequence[Candidate],
    *,
    values: FloatArray,
    data: str,
    omissions: Sequence[Omission] = (),
    plan: BenchSettings | None = None,
    progress: Progress | None = None,
    clock: TimeSource | None = None,
) -> Study:
    """Try, judge and time candidates; see `bench`, which finds them.

    The candidates have unique names; `values` have shape (inputs, rows), with at least
    one row, and `data` says what they are. `omissions` were made before.
    """
    with noticed() as check:

        def step(text: str, share: float) -> None:
            check()
            if progress:
                progress(text, share)

        run = _Run(
            model, values, plan or BenchSettings(), step, clock or system_clock()
        )
        run.omissions += omissions
        before = machine(module for one in candidates for module in one.modules)
        try:
            run.try_foreign(candidates)
            run.judge(candidates)
            run.time()
            check()
        except KeyboardInterrupt:
            run.is_complete, run.is_interrupted = False, True
            run.warnings.append("interrupted: this is what was measured by then")
    return run.study(data, before)


class _Draft(msgspec.Struct):
    """A point in the making."""

    candidate: Candidate
    loaded: LoadedCandidate
    load_ms: float
    error: Error | None
    probes: Error | None
    row_ns: float
    timings: list[Timing] = []
    threaded: dict[int, LoadedCandidate] = {}


class _Run:
    """A study while it runs: it must keep what it has when it is interrupted."""

    def __init__(
        self,
        model: Document,
        values: FloatArray,
        plan: BenchSettings,
        progress: Progress,
        clock: TimeSource,
    ) -> None:
        self.model, self.values, self.plan = model, values, plan
        self.progress, self.clock = progress, clock
        self.start = self.begin = clock.wall()
        self.peers: set[str] = set()
        self.drafts: dict[str, _Draft] = {}
        self.omissions: list[Omission] = []
        self.warnings: list[str] = []
        self.faulty: set[str] = set()
        self.is_complete = True
        self.is_interrupted = False

    def spent_s(self) -> float:
        """Return how much of the budget is spent."""
        return (self.clock.wall() - self.begin) / 1e9

    def omit(self, name: str, why: str) -> None:
        """Leave a candidate out, or some rows of it."""
        self.omissions.append(Omission(name, why, is_peer=name in self.peers))

    def try_foreign(self, candidates: Sequence[Candidate]) -> None:
        """Leave out what ends or blocks a child process.

        Peers were asked for: the budget begins after their trial, however long it is.
        """
        self.peers = {c.name for c in candidates if c.kind == "peer"}
        todo = [c for c in candidates if c.modules or c.kind == "peer"]
        limit_s = math.inf if self.peers else self.plan.budget_s / 3
        faults = trial.tried(
            self.model,
            [c.name for c in sorted(todo, key=_rank)],
            self.values[:, :_TRIED],
            peers=self.plan.peers,
            left=lambda: limit_s - self.spent_s(),
            progress=_part(self.progress, 0.0, 0.1),
        )
        if self.peers:
            self.begin = self.clock.wall()
        for name, why in faults.items():
            self.omit(name, why)
        self.faulty |= set(faults)

    def judge(self, candidates: Sequence[Candidate]) -> None:
        """Load each candidate and compare its predictions with the exact ones."""
        judge = CandidateJudge(questions(self.model), self.values, self.clock)
        todo = [c for c in candidates if c.name not in self.faulty]
        progress = _part(self.progress, 0.1, 0.3)
        # If the time is short, what others are compared with is still there.
        for position, one in enumerate(sorted(todo, key=_rank)):
            progress(f"judging {one.name}", position / len(todo))
            is_late = self.spent_s() > self.plan.budget_s / 2
            if is_late and _rank(one) and one.name not in self.peers:
                why = "half of the budget was over before it was judged"
                self.omit(one.name, f"{why}; a larger one helps")
                continue
            start = self.clock.wall()
            try:
                loaded = one.load(min(self.plan.threads))
                load_ms = (self.clock.wall() - start) / 1e6
                judgement = judge.judged(one, loaded)
            except Exception as error:  # whatever foreign code raises is a finding
                self.omit(one.name, trial.error_text(error))
                continue
            self.drafts[one.name] = _Draft(one, loaded, load_ms, *judgement)

    def time(self) -> None:
        """Time all candidates, few rows first: what they leave is for more rows."""
        plan = self.plan
        seconds = max(plan.budget_s / 2, plan.budget_s - self.spent_s())
        end = self.spent_s() + seconds
        blocks = [(r, t) for r in sorted({*plan.rows}) for t in sorted({*plan.threads})]
        for number, (rows, threads) in enumerate(blocks):
            left = max(end - self.spent_s(), 1e-3) / (len(blocks) - number)
            first, last = (0.3 + 0.7 * k / len(blocks) for k in (number, number + 1))
            self._block(rows, threads, left, _part(self.progress, first, last))

    def _block(
        self, rows: int, threads: int, seconds: float, progress: Progress
    ) -> None:
        """Time the candidates that answer so many rows with so many threads in time."""
        names = self._members(threads)
        if not names or self._is_too_large(rows, len(names)):
            return
        names = self._fitting(names, rows, seconds)
        values = repeated(self.values, rows)
        end = self.spent_s() + seconds
        calls = dict(self._calls(names, values, threads, end))
        result = time_calls(
            calls,
            rows=rows,
            threads=threads,
            rounds=self.plan.rounds,
            seconds=max(end - self.spent_s(), 1e-3),
            seed=self.plan.seed,
            progress=progress,
            clock=self.clock,
        )
        self._keep(result, rows, threads, len(calls))

    def _members(self, threads: int) -> list[str]:
        """Return the candidates to time; more threads are for parallel ones."""
        known = {name: draft.candidate for name, draft in self.drafts.items()}
        if threads == min(self.plan.threads):
            return [*known]
        if not any(one.is_parallel and one.kind != "floor" for one in known.values()):
            return []
        return [k for k, one in known.items() if one.is_parallel or _is_measure(one)]

    def _is_too_large(self, rows: int, count: int) -> bool:
        peers = sum(d.candidate.kind == "peer" for d in self.drafts.values())
        size = rows * len(self.model.inputs) * 8 * (4 + peers)
        if size > _MOST_BYTES:
            self.omit(
                f"all {count} candidates",
                f"{rows:,} rows: their layouts take about {size / 2**30:.0f} GiB, "
                f"and {_MOST_BYTES >> 30} are the most",
            )
        return size > _MOST_BYTES

    def _fitting(self, names: Sequence[str], rows: int, seconds: float) -> list[str]:
        """Leave out candidates that cannot have six samples in the time."""
        costs = {name: self.drafts[name].row_ns * rows for name in names}
        ranks = {name: _rank(self.drafts[name].candidate) for name in names}
        if rows == min(self.plan.rows):  # where each peer has a time
            ranks |= dict.fromkeys(self.peers & {*names}, 0)
        kept = fitting(costs, ranks, seconds * 1e9, min(SURE, self.plan.rounds))
        for name in names:
            if name not in kept:
                why = f"{_rows(rows)}: too slow for the budget; a larger one helps"
                self.omit(name, why)
        return [name for name in names if name in kept]

    def _calls(
        self, names: Sequence[str], values: FloatArray, threads: int, end: float
    ) -> Iterator[tuple[str, Call]]:
        for name in names:
            draft = self.drafts[name]
            try:
                loaded = self._threaded(draft, threads, end)
                yield name, loaded.call(values)
            except Exception as error:  # as above
                why = trial.error_text(error)
                self.omit(name, f"{_rows(values.shape[1])}: {why}")

    def _threaded(self, draft: _Draft, threads: int, end: float) -> LoadedCandidate:
        """Return a candidate as it is loaded for a number of threads.

        Raises:
            TimeoutError: If loading it again would take longer than there is time.
        """
        if threads == min(self.plan.threads) or not draft.candidate.is_parallel:
            return draft.loaded
        if threads not in draft.threaded:
            if self.spent_s() + draft.load_ms / 1e3 > end:
                why = f"loading it again for {threads} threads takes too long"
                raise TimeoutError(f"{why} for the budget; a larger one helps")
            draft.threaded[threads] = draft.candidate.load(threads)
        return draft.threaded[threads]

    def _keep(self, result: CallTimings, rows: int, threads: int, count: int) -> None:
        """Take what was measured, whole or not."""
        for name, error in result.failures.items():
            self.omit(name, f"{rows:,} rows: {trial.error_text(error)}")
        for name, timing in result.timings.items():
            draft = self.drafts[name]
            draft.timings.append(timing)
            draft.row_ns = min(draft.row_ns, timing.median_ns / rows)
        if result.is_interrupted:
            raise KeyboardInterrupt
        if len(result.timings) + len(result.failures) < count:
            self.is_complete = False
            self.warnings.append(
                f"the time was over at {_rows(rows)}, {threads} "
                f"thread{'' if threads == 1 else 's'}: {len(result.timings)} of "
                f"{count} candidates have a time there"
            )

    def study(self, data: str, before: Machine) -> Study:
        """Return all that is known by now."""
        drafts = [d for d in self.drafts.values() if d.timings]
        points = tuple(map(_point, drafts))
        timings = [timing for point in points for timing in point.timings]
        facts = after(before, timings)
        return Study(
            self.model.name,
            fingerprint(self.model),
            data,
            facts,
            points,
            tuple(self.omissions),
            warnings=(
                *self.warnings,
                *noise(facts, points),
                *_unsure(points),
                *faults(points),
            ),
            advice=advice(points, self.plan.most),
            is_complete=self.is_complete,
            fronts=fronts(points),
            seed=self.plan.seed,
            seconds=(self.clock.wall() - self.start) / 1e9,
            is_interrupted=self.is_interrupted,
        )


def fitting(
    costs: Mapping[str, float], ranks: Mapping[str, int], left: float, samples: int
) -> set[str]:
    """Return whose warm-up and first samples fit the time.

    What all others are compared with comes first, then ours, then the others, the
    faster ones before the slower ones. None of these may take more than a tenth of
    the time.

    `costs` are those of one call, in the unit of `left`, the time for all of them; the
    lowest of the `ranks` comes first; each needs `samples` beside the warm-up.

    Example:
        >>> costs = {"native": 2.0, "fast": 1.0, "slow": 30.0}
        >>> sorted(fitting(costs, {"native": 0, "fast": 1, "slow": 1}, 200.0, 6))
        ['fast', 'native']
    """
    kept: set[str] = set()
    whole = left
    for name in sorted(costs, key=lambda one: (ranks[one], costs[one])):
        needed = (1 + samples) * costs[name]
        most = whole * _SHARE if ranks[name] else left
        if needed <= min(most, left):
            kept.add(name)
            left -= needed
    return kept


def _rank(one: Candidate) -> int:
    """Return 0 for what others are compared with, then peers, ours, variants."""
    if _is_measure(one):
        return 0
    return {"floor": 0, "peer": 1, "runtime": 2, "variant": 3}[one.kind]


def _is_measure(one: Candidate) -> bool:
    return one.kind == "floor" or one.name == title(baseline().name, one.question)


def _part(progress: Progress, first: float, last: float) -> Progress:
    """Return a function that reports a part of the work as a part of the whole."""
    return lambda text, share: progress(text, first + share * (last - first))


def _point(draft: _Draft) -> Point:
    one = draft.candidate
    return Point(
        one.name,
        one.question,
        one.kind,
        draft.error,
        tuple(draft.timings),
        draft.load_ms,
        draft.loaded.bytes,
        one.note,
        draft.probes,
    )


def faults(points: Sequence[Point]) -> Iterator[str]:
    """Yield where an error is larger than what was certified: that must not be.

    Args:
        points: Of a study.
    """
    for point in points:
        error = point.error
        if error is None:
            continue
        parts = {point.name: (error.largest, error.bound)}
        for name, one in error.outputs.items():
            parts[f"{point.name}, output {name!r}"] = one.largest, one.bound
        for name, (largest, bound) in parts.items():
            if largest is not None and bound is not None and largest > bound:
                yield (
                    f"{name}: an error of {largest:.2g} is larger than the certified "
                    f"{bound:.2g}; this is a fault"
                )


def _unsure(points: Sequence[Point]) -> Iterator[str]:
    few = sum(len(t.samples_ns) < SURE for point in points for t in point.timings)
    if few:
        verb = "time has" if few == 1 else "times have"
        yield f"{few} {verb} fewer than {SURE} samples, and an interval below 95 %"
