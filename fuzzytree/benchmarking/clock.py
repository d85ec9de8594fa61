"""How long calls take: interleaved rounds, medians, and how sure they are.

All calls are timed in every round, each round in another order, so that a slow minute
of the machine slows all of them alike. A sample is as many calls as the clock's grain
needs. The garbage collector is off meanwhile. Wall time counts, for it is what users
wait; the processor's time beside it shows how much other processes took.
"""

from __future__ import annotations

import contextlib
import gc
import math
import random
import statistics
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from itertools import repeat

import msgspec

from fuzzytree.benchmarking.records import Timing
from fuzzytree.model import Progress

CONFIDENCE = 0.95
"""Of all intervals."""

SURE = 6
"""Samples from which an interval reaches that: 1 - 2 / 2**6 is 96.9 %."""

Call = Callable[[], object]

_SAMPLE_NS = 2_000_000  # a sample: much longer than the clock's grain and a switch
_MOST_CALLS = 1 << 20
_FINE_S = 1e-4  # a processor clock coarser than this measures no sample


class TimeSource(msgspec.Struct, frozen=True):
    """Where the time comes from.

    Attributes:
        wall: Nanoseconds that pass.
        cpu: Nanoseconds that the process ran, on all its threads; None where the
            system's clock is too coarse.
    """

    wall: Callable[[], int]
    cpu: Callable[[], int] | None


class Interval(msgspec.Struct, frozen=True):
    """A median, and where it lies.

    Attributes:
        median: Of the samples.
        low: Lower end of the confidence interval.
        high: Upper end of it.
        confidence: How surely the true median is between them, exactly.
    """

    median: float
    low: float
    high: float
    confidence: float


class CallTimings(msgspec.Struct, frozen=True):
    """What was measured, whole or up to an interruption.

    Attributes:
        timings: By name, of every call with at least one sample.
        failures: What a call raised, before or after some samples.
        is_complete: False if the user or the time limit ended it early.
        is_interrupted: Whether the user did.
    """

    timings: dict[str, Timing]
    failures: dict[str, Exception]
    is_complete: bool = True
    is_interrupted: bool = False


def system_clock() -> TimeSource:
    """Return the clocks of this system."""
    is_fine = time.get_clock_info("process_time").resolution <= _FINE_S
    return TimeSource(time.perf_counter_ns, time.process_time_ns if is_fine else None)


def time_calls(
    calls: Mapping[str, Call],
    *,
    rows: int,
    threads: int = 1,
    rounds: int = 15,
    seconds: float = math.inf,
    seed: int = 0,
    progress: Progress | None = None,
    clock: TimeSource | None = None,
) -> CallTimings:
    """Time calls in interleaved rounds.

    Args:
        calls: By name. Each is called at least twice: once to warm up, at its own
            cost, and once for a sample.
        rows: Rows that each call answers, for the record.
        threads: Threads that each may use, for the record.
        rounds: The most samples of each call. From six on the interval of the median
            reaches 95 %.
        seconds: The time for all of it, shared as `shared_rounds` says; when it is
            over, no further sample begins.
        seed: Of the order within the rounds.
        progress: Called with the current step and the share that is done.
        clock: Where the time comes from; the system unless given.

    Returns:
        The timings. A call that raises an error is listed with it.

    Raises:
        ValueError: If there is nothing to do: no round, no row, no time.

    Example:
        >>> found = time_calls({"a sum": lambda: sum(range(9))}, rows=9, rounds=6)
        >>> len(found.timings["a sum"].samples_ns)
        6
    """
    _check(rows, threads, rounds, seconds)
    run = _Run(
        clock or system_clock(), seconds, progress or (lambda _text, _share: None)
    )
    interrupted = False
    with _no_garbage():
        try:
            for name, call in calls.items():
                run.warm_up(name, call)
            run.sample(calls, rounds, seed)
        except KeyboardInterrupt:
            interrupted = True
    timings = {
        name: _timing(samples, rows, threads)
        for name, samples in run.samples.items()
        if samples.walls
    }
    is_complete = not interrupted and not run.is_late
    return CallTimings(timings, run.failures, is_complete, interrupted)


def _check(rows: int, threads: int, rounds: int, seconds: float) -> None:
    for name, value in (("rows", rows), ("threads", threads), ("rounds", rounds)):
        if value < 1:
            raise ValueError(f"{name} must be 1 or more, not {value}")
    if not seconds > 0:
        raise ValueError(f"the time must be more than 0 seconds, not {seconds:g}")


@contextlib.contextmanager
def _no_garbage() -> Generator[None]:
    was_on = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


class _Samples:
    """What is known of one call so far: lists that grow."""

    def __init__(self, calls: int, cost_ns: float) -> None:
        self.calls = calls
        self.cost_ns = cost_ns  # of one sample
        self.walls: list[float] = []
        self.cpus: list[float] = []
        self.rounds: list[int] = []


class _Run:
    """A measurement while it runs: it must keep what it has when it is interrupted."""

    def __init__(self, clock: TimeSource, seconds: float, progress: Progress) -> None:
        self.clock = clock
        self.begin = clock.wall()
        self.limit_ns = seconds * 1e9
        self.progress = progress
        self.samples: dict[str, _Samples] = {}
        self.failures: dict[str, Exception] = {}
        self.is_late = False

    def left_ns(self) -> float:
        """Return the time that is left."""
        return self.limit_ns - (self.clock.wall() - self.begin)

    def warm_up(self, name: str, call: Call) -> None:
        """Call once for the caches, then find how many calls make a sample."""
        if self.left_ns() <= 0:
            self.is_late = True
            return
        try:
            wall, _ = self._time(call, 1)
            count = 1
            while wall < _SAMPLE_NS / 2 and count < _MOST_CALLS:
                step = math.ceil(count * _SAMPLE_NS / max(wall, _SAMPLE_NS / 100))
                count = min(step, _MOST_CALLS)
                wall, _ = self._time(call, count)
        except Exception as error:  # whatever foreign code raises is a finding
            self.failures[name] = error
            return
        self.samples[name] = _Samples(count, max(wall, 1.0))

    def sample(self, calls: Mapping[str, Call], rounds: int, seed: int) -> None:
        """Take the samples, round by round."""
        costs = {name: known.cost_ns for name, known in self.samples.items()}
        shares = shared_rounds(costs, rounds, self.left_ns())
        whole, done = sum(shares.values()), 0
        for number, names in enumerate(orders(shares, rounds, seed)):
            for name in names:
                if self.left_ns() <= 0:
                    self.is_late = True
                    return
                self.progress(f"{name}, round {number + 1} of {rounds}", done / whole)
                done += 1
                if name not in self.failures:
                    self._sample(name, calls[name], number)

    def _sample(self, name: str, call: Call, number: int) -> None:
        known = self.samples[name]
        try:
            wall, cpu = self._time(call, known.calls)
        except Exception as error:  # as above
            self.failures[name] = error
            return
        known.walls.append(wall / known.calls)
        known.cpus.append(cpu / known.calls)
        known.rounds.append(number)

    def _time(self, call: Call, count: int) -> tuple[float, float]:
        """Return the wall time and the processor's time of so many calls, in ns."""
        wall, cpu = self.clock.wall, self.clock.cpu
        before = cpu() if cpu else 0
        start = wall()
        for _ in repeat(None, count):
            call()
        end = wall()
        after = cpu() if cpu else -1
        return float(end - start), float(after - before)


def shared_rounds(
    costs: Mapping[str, float], rounds: int, left: float
) -> dict[str, int]:
    """Return how many rounds each call gets, so that all together fit the time.

    Everybody gets the six rounds that an interval needs, if all these fit; what is
    left is shared evenly, and what fast calls do not need of it goes to slower ones.
    If they do not fit, all is shared so. One round is everybody's due.

    Example:
        >>> shared_rounds({"fast": 1.0, "slow": 30.0, "slower": 50.0}, 15, 600.0)
        {'fast': 15, 'slow': 7, 'slower': 7}
    """
    least = min(rounds, SURE)
    if least * sum(costs.values()) > left:
        least = 1
    left -= least * sum(costs.values())
    shares: dict[str, int] = {}
    todo = sorted(costs, key=costs.__getitem__)
    for position, name in enumerate(todo):
        even = left / (len(todo) - position)
        more = rounds if math.isinf(even) else int(max(even, 0.0) // costs[name])
        shares[name] = min(rounds, least + more)
        left -= (shares[name] - least) * costs[name]
    return {name: shares[name] for name in costs}


def orders(
    shares: Mapping[str, int], rounds: int, seed: int
) -> Iterator[tuple[str, ...]]:
    """Yield the names that are timed in each round, in their order.

    The order is drawn anew for each round, so that no candidate always follows
    the same one. A candidate with fewer rounds than there are has them evenly spread.

    Example:
        >>> [sorted(names) for names in orders({"a": 3, "b": 1}, 3, seed=0)]
        [['a'], ['a'], ['a', 'b']]
    """
    chance = random.Random(seed)
    for number in range(rounds):
        names = [
            name
            for name, share in shares.items()
            if (number + 1) * share // rounds > number * share // rounds
        ]
        chance.shuffle(names)
        yield tuple(names)


def _timing(samples: _Samples, rows: int, threads: int) -> Timing:
    span = interval(samples.walls)
    busy, wall = sum(samples.cpus), sum(samples.walls)
    is_known = all(cpu >= 0.0 for cpu in samples.cpus) and wall > 0.0
    return Timing(
        rows,
        threads,
        tuple(samples.walls),
        span.median,
        span.low,
        span.high,
        span.confidence,
        samples.calls,
        tuple(samples.rounds),
        max(0.0, 1.0 - busy / wall) if is_known else None,
    )


def median_ranks(count: int) -> tuple[int, int, float]:
    """Return the ranks, from 1, between which the median lies with 95 % confidence.

    Of n independent samples, the number below the median is binomial with p = 1/2, so
    the k-th smallest and the k-th largest enclose it but for a probability of
    2 P(X < k). The largest k that leaves at most 5 % is taken; whatever the
    distribution, the confidence is exact for a continuous one and a lower bound else.

    Args:
        count: Samples, at least one. Below six even the smallest and the largest do
            not reach 95 %; they are given with the confidence that they have.

    Returns:
        The two ranks, and the confidence.

    Example:
        >>> median_ranks(15)
        (4, 12, 0.96484375)
        >>> median_ranks(3)
        (1, 3, 0.75)
    """
    if count < 1:
        raise ValueError("no samples have no median")
    rank, below = 1, 1  # below: subsets of fewer than `rank` samples, of 2**count
    more = below + count
    while 2 * more <= (1.0 - CONFIDENCE) * 2**count:
        rank, below = rank + 1, more
        more += math.comb(count, rank)
    return rank, count + 1 - rank, 1.0 - below / 2 ** (count - 1)


def interval(samples: Sequence[float]) -> Interval:
    """Return the median of samples and its confidence interval.

    Example:
        >>> interval([3.0, 1.0, 2.0, 5.0, 4.0, 9.0])
        Interval(median=3.5, low=1.0, high=9.0, confidence=0.96875)
    """
    ordered = sorted(samples)
    low, high, confidence = median_ranks(len(ordered))
    return Interval(
        statistics.median(ordered), ordered[low - 1], ordered[high - 1], confidence
    )


def times_faster(slow: Timing, fast: Timing) -> Interval | None:
    """Return how many times faster one is than another, round by round.

    Samples of one round were taken close together, so what slowed one of them slowed
    the other as well; the result is the median of their quotients.

    Returns:
        The median quotient and its interval, or None where they share no round.

    Example:
        >>> slow = Timing(1, 1, (8.0, 10.0), 9.0, 8.0, 10.0)
        >>> fast = Timing(1, 1, (4.0, 5.0), 4.5, 4.0, 5.0)
        >>> times_faster(slow, fast).median
        2.0
    """
    taken = _by_round(fast)
    quotients = [
        sample / taken[number]
        for number, sample in _by_round(slow).items()
        if taken.get(number, 0.0) > 0.0
    ]
    return interval(quotients) if quotients else None


def _by_round(timing: Timing) -> dict[int, float]:
    numbers = timing.rounds or range(len(timing.samples_ns))
    return dict(zip(numbers, timing.samples_ns, strict=True))
