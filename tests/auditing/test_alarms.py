"""A budget is kept where nobody asks the clock, and alarms of others are left alone."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator

import msgspec
import pytest

from fuzzytree.auditing import decisions
from fuzzytree.auditing.alarms import enforced
from fuzzytree.auditing.records import Settings
from fuzzytree.proving.clock import Clock, OutOfTimeError
from fuzzytree.proving.states import Bracket
from tests.proving.bases import random_base, unit_domain


@pytest.fixture(autouse=True)
def _no_alarm() -> Iterator[None]:
    """Take the alarm from whoever runs the tests, and give it back."""
    handler = signal.signal(signal.SIGALRM, signal.SIG_DFL)
    delay, again = signal.setitimer(signal.ITIMER_REAL, 0.0)
    yield
    signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, delay, again)


def forever() -> None:
    """Work without asking any clock."""
    while True:
        pass


def test_work_that_asks_no_clock_is_ended() -> None:
    with pytest.raises(OutOfTimeError), enforced(Clock(0.01)):
        forever()
    assert signal.getsignal(signal.SIGALRM) is signal.SIG_DFL
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_work_in_time_is_left_alone() -> None:
    with enforced(Clock(1000.0)):
        delay, again = signal.getitimer(signal.ITIMER_REAL)
    assert delay > 1000.0
    assert again == 1.0
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_a_program_with_alarms_of_its_own_keeps_them() -> None:
    def own(_number: int, _frame: object) -> None:
        raise AssertionError

    signal.signal(signal.SIGALRM, own)
    try:
        with enforced(Clock(0.01)):
            assert signal.getsignal(signal.SIGALRM) is own
            assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    finally:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)


def test_another_thread_has_no_alarm() -> None:
    seen: list[tuple[float, float]] = []

    def work() -> None:
        with enforced(Clock(0.01)):
            seen.append(signal.getitimer(signal.ITIMER_REAL))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [(0.0, 0.0)]


def test_a_comparison_ends_within_a_box_that_never_asks_the_clock(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(decisions, "alike", lambda *_: forever())
    old = random_base(1, 3, 2)
    new = msgspec.structs.replace(old, rules=old.rules[::-1])
    pair = decisions.Pair(old, new, old.inputs, unit_domain(old))
    (answer, *_), _ = decisions.decisions(pair, None, Settings(rows=10), Clock(0.05))
    assert isinstance(answer.state, Bracket)
    assert answer.state.why == "the budget was spent within a box"
