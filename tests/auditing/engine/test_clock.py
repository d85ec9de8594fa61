"""A budget is kept where nobody holds the clock, in every thread."""

from __future__ import annotations

import threading
from fractions import Fraction

import pytest

from fuzzytree.auditing.engine.clock import GRACE_S, Clock, OutOfTimeError, enforced
from fuzzytree.auditing.engine.pieces import RuleCurve
from fuzzytree.model.interrupts import checkpoint
from fuzzytree.model.rulebase import Points


def over(by_s: float) -> Clock:
    """Return a clock that is over for some seconds."""
    times = [0.0]
    clock = Clock(1.0, now=lambda: times[0])
    times[0] = 1.0 + by_s
    return clock


def forever() -> None:
    """Work with no clock at hand, step by step."""
    curve = RuleCurve(Points((0.0, 1.0), (0.0, 1.0)))
    while True:
        curve.degree(Fraction(1, 3))


def test_work_that_holds_no_clock_is_ended() -> None:
    with pytest.raises(OutOfTimeError), enforced(over(1.0)):
        forever()
    checkpoint()  # nobody watches any more


def test_work_with_a_clock_has_a_moment_to_return_what_is_known() -> None:
    with enforced(over(GRACE_S / 2)):
        checkpoint()
    with enforced(over(GRACE_S * 2)), pytest.raises(OutOfTimeError):
        checkpoint()


def test_a_clock_within_another_gives_way_to_it_at_its_end() -> None:
    with enforced(over(1.0)):
        with enforced(Clock()):
            checkpoint()
        with pytest.raises(OutOfTimeError):
            checkpoint()


def test_every_thread_has_a_clock_of_its_own() -> None:
    ended: list[str] = []

    def work() -> None:
        checkpoint()  # that of another thread is not asked
        try:
            with enforced(over(1.0)):
                forever()
        except OutOfTimeError:
            ended.append("late")

    with enforced(over(1.0)):
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    assert ended == ["late"]
