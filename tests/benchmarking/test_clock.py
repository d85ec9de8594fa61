"""Times are medians of interleaved rounds, with intervals that are counted exactly."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable
from itertools import combinations

import pytest

from fuzzytree.benchmarking.clock import (
    TimeSource,
    interval,
    median_ranks,
    orders,
    shared_rounds,
    time_calls,
    times_faster,
)
from fuzzytree.benchmarking.records import Timing

pytestmark = pytest.mark.usefixtures("few_objects")

MS = 1_000_000


class FakeTime:
    """A clock that stands still unless a call takes its time."""

    def __init__(self) -> None:
        self.wall = self.cpu = 0

    def clock(self) -> TimeSource:
        return TimeSource(lambda: self.wall, lambda: self.cpu)

    def call(self, ms: float, *, stolen_ms: float = 0.0) -> Callable[[], object]:
        def call() -> None:
            self.cpu += int(ms * MS)
            self.wall += int((ms + stolen_ms) * MS)

        return call


def test_the_ranks_of_fifteen_samples_are_the_fourth_and_the_twelfth() -> None:
    # P(X < 4) for X ~ B(15, 1/2): (1 + 15 + 105 + 455) / 32768 = 576 / 32768 <= 2.5 %;
    # with rank 5 it would be 1941 / 32768 = 5.9 %.
    assert median_ranks(15) == (4, 12, 1 - 2 * 576 / 32768)


@pytest.mark.parametrize("count", range(6, 40))
def test_no_wider_rank_than_needed_reaches_the_confidence(count: int) -> None:
    low, high, confidence = median_ranks(count)
    total: int = 2**count

    def missed(rank: int) -> float:
        ways: int = sum(math.comb(count, k) for k in range(rank))
        return 2 * ways / total

    assert low + high == count + 1
    assert confidence == 1 - missed(low) >= 0.95
    assert 1 - missed(low + 1) < 0.95


def test_few_samples_tell_how_little_is_sure() -> None:
    assert median_ranks(5) == (1, 5, 0.9375)
    assert median_ranks(1) == (1, 1, 0.0)
    with pytest.raises(ValueError, match=r"^no samples have no median$"):
        median_ranks(0)


def test_the_interval_covers_the_median_as_often_as_it_says() -> None:
    # Every outcome of 7 fair coins "above or below the median", counted.
    low, high, confidence = median_ranks(7)
    covered = 0
    for below in range(8):
        ways = sum(1 for _ in combinations(range(7), below))
        covered += ways * (low <= below <= high - 1)
    assert covered / 2**7 == confidence


def test_an_interval_is_made_of_samples() -> None:
    result = interval([float(k) for k in (9, 1, 8, 2, 7, 3, 6, 4, 5)])
    assert (result.median, result.low, result.high) == (5.0, 2.0, 8.0)


def test_a_call_is_repeated_until_the_clock_can_tell() -> None:
    time = FakeTime()
    calls = {"fast": time.call(0.001), "slow": time.call(5.0)}
    result = time_calls(calls, rows=3, rounds=6, clock=time.clock()).timings
    assert result["fast"].calls == 2000
    assert result["slow"].calls == 1
    assert result["fast"].median_ns == pytest.approx(1000.0)
    assert result["slow"].samples_ns == (5.0 * MS,) * 6
    assert result["slow"].rows == 3
    assert result["slow"].rounds == (0, 1, 2, 3, 4, 5)


def test_time_that_other_processes_took_is_reported() -> None:
    time = FakeTime()
    calls = {"alone": time.call(5.0), "robbed": time.call(6.0, stolen_ms=2.0)}
    result = time_calls(calls, rows=1, rounds=6, clock=time.clock()).timings
    assert result["alone"].stolen == 0.0
    assert result["robbed"].stolen == pytest.approx(0.25)
    assert result["robbed"].median_ns == 8.0 * MS


def test_a_coarse_processor_clock_tells_nothing_of_stolen_time() -> None:
    time = FakeTime()
    clock = TimeSource(lambda: time.wall, None)
    result = time_calls({"a": time.call(5.0)}, rows=1, rounds=6, clock=clock)
    assert result.timings["a"].stolen is None


def test_rounds_are_interleaved_and_every_round_has_another_order() -> None:
    time = FakeTime()
    sequence: list[str] = []

    def call(name: str) -> Callable[[], object]:
        def seen_call() -> None:
            sequence.append(name)
            time.call(5.0)()

        return seen_call

    names = "abcd"
    time_calls(
        {name: call(name) for name in names}, rows=1, rounds=8, clock=time.clock()
    )
    rounds = ["".join(sequence[k : k + 4]) for k in range(4, len(sequence), 4)]
    assert len(rounds) == 8
    assert all(sorted(one) == [*names] for one in rounds)
    assert len(set(rounds)) > 4


def test_the_same_seed_gives_the_same_order() -> None:
    shares = dict.fromkeys("abcdef", 5)
    assert [*orders(shares, 5, 1)] == [*orders(shares, 5, 1)]
    assert [*orders(shares, 5, 1)] != [*orders(shares, 5, 2)]


@pytest.mark.parametrize("share", [1, 2, 3, 7, 15])
def test_everybody_has_the_rounds_of_its_share(share: int) -> None:
    rounds = [*orders({"a": 15, "b": share}, 15, 0)]
    assert sum("b" in names for names in rounds) == share
    assert all("a" in names for names in rounds)


def test_fast_calls_keep_their_rounds_when_time_is_short() -> None:
    costs = {"slow": 30.0, "fast": 1.0, "middle": 10.0}
    # Six each are 246; of the other 64 fast takes 4, middle 3 times 10, slow 30.
    assert shared_rounds(costs, 10, 310.0) == {"slow": 7, "fast": 10, "middle": 9}
    assert shared_rounds(costs, 10, 246.0) == {"slow": 6, "fast": 6, "middle": 6}
    assert shared_rounds(costs, 10, 245.0) == {"slow": 4, "fast": 10, "middle": 10}
    assert shared_rounds(costs, 10, 0.0) == {"slow": 1, "fast": 1, "middle": 1}
    assert shared_rounds(costs, 10, math.inf) == dict.fromkeys(costs, 10)


def test_the_time_limit_is_kept_to_one_call() -> None:
    time = FakeTime()
    calls = {name: time.call(100.0) for name in "abc"}
    result = time_calls(calls, rows=1, rounds=15, seconds=1.0, clock=time.clock())
    assert time.wall <= 1.1e9
    assert result.is_complete
    assert sorted(len(one.samples_ns) for one in result.timings.values()) == [2, 2, 3]


def test_what_no_time_is_left_for_is_not_measured() -> None:
    time = FakeTime()
    calls = {"long": time.call(3000.0), "short": time.call(1.0)}
    result = time_calls(calls, rows=1, seconds=1.0, clock=time.clock())
    assert not result.is_complete
    assert not result.is_interrupted
    assert result.timings == {}


def test_an_interrupted_measurement_keeps_its_samples() -> None:
    time = FakeTime()
    left = [20]

    def nervous() -> None:
        left[0] -= 1
        if not left[0]:
            raise KeyboardInterrupt
        time.call(5.0)()

    calls = {"calm": time.call(5.0), "nervous": nervous}
    result = time_calls(calls, rows=1, rounds=30, clock=time.clock())
    assert result.is_interrupted
    assert not result.is_complete
    assert len(result.timings["nervous"].samples_ns) == 18  # one call warmed it up
    assert len(result.timings["calm"].samples_ns) in (18, 19)


@pytest.mark.parametrize("position", [1, 4])
def test_a_call_that_fails_leaves_the_others_alone(position: int) -> None:
    time = FakeTime()
    left = [position]

    def broken() -> None:
        left[0] -= 1
        if not left[0]:
            raise OverflowError("too much")
        time.call(5.0)()

    calls = {"broken": broken, "whole": time.call(5.0)}
    result = time_calls(calls, rows=1, rounds=6, clock=time.clock())
    assert str(result.failures["broken"]) == "too much"
    assert len(result.timings["whole"].samples_ns) == 6


def test_the_garbage_collector_is_off_while_timing_and_on_again() -> None:
    states: list[bool] = []
    time_calls({"look": lambda: states.append(gc.isenabled())}, rows=1, rounds=1)
    assert not any(states)
    assert gc.isenabled()
    gc.disable()
    try:
        time_calls({"look": lambda: None}, rows=1, rounds=1)
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_progress_names_the_call_and_grows() -> None:
    time = FakeTime()
    calls_seen: list[tuple[str, float]] = []
    time_calls(
        {"a": time.call(5.0)},
        rows=1,
        rounds=2,
        clock=time.clock(),
        progress=lambda text, share: calls_seen.append((text, share)),
    )
    assert calls_seen == [("a, round 1 of 2", 0.0), ("a, round 2 of 2", 0.5)]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"rows": 0}, "rows must be 1 or more, not 0"),
        ({"threads": 0}, "threads must be 1 or more, not 0"),
        ({"rounds": -1}, "rounds must be 1 or more, not -1"),
        ({"seconds": 0.0}, "the time must be more than 0 seconds, not 0"),
        ({"seconds": math.nan}, "the time must be more than 0 seconds, not nan"),
    ],
)
def test_a_measurement_of_nothing_is_refused(
    wrong: dict[str, float], message: str
) -> None:
    with pytest.raises(ValueError, match=f"^{message}$"):
        time_calls({}, **{"rows": 1, **wrong})  # type: ignore[arg-type] # the point


def timing(*samples: float, rounds: tuple[int, ...] = ()) -> Timing:
    result = interval(samples)
    return Timing(1, 1, samples, result.median, result.low, result.high, rounds=rounds)


def test_a_slow_minute_does_not_change_a_quotient() -> None:
    slow = timing(10.0, 1000.0, 11.0, 12.0, 10.0, 10.0)
    fast = timing(5.0, 500.0, 5.5, 6.0, 5.0, 5.0)
    result = times_faster(slow, fast)
    assert result is not None
    assert (result.median, result.low, result.high) == (2.0, 2.0, 2.0)


def test_only_rounds_that_both_took_part_in_are_compared() -> None:
    slow = timing(8.0, 9.0, rounds=(3, 7))
    fast = timing(1.0, 2.0, 3.0, rounds=(0, 3, 5))
    result = times_faster(slow, fast)
    assert result is not None
    assert (result.median, result.confidence) == (4.0, 0.0)
    assert times_faster(slow, timing(1.0, rounds=(0,))) is None
