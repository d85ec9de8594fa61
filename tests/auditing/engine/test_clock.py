"""A budget is kept where nobody holds the clock, in every thread."""

from __future__ import annotations

import threading
from fractions import Fraction

import msgspec
import pytest

from fuzzytree.auditing.diff import decisions
from fuzzytree.auditing.engine.clock import GRACE_S, Clock, OutOfTimeError, enforced
from fuzzytree.auditing.engine.pieces import RuleCurve
from fuzzytree.auditing.engine.states import Bracket
from fuzzytree.auditing.findings.records import AuditSettings
from fuzzytree.model.interrupts import checkpoint
from fuzzytree.model.rulebase import Points
from tests.auditing.engine.bases import random_base, unit_domain


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


def test_a_comparison_ends_within_a_box_that_holds_no_clock(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def endless(*_: object) -> None:
        forever()

    monkeypatch.setattr(decisions, "equivalence", endless)
    old = random_base(1, 3, 2)
    first, *_, last = old.rules
    narrower = msgspec.structs.replace(last, when=(*last.when, first.when[0]))
    new = msgspec.structs.replace(old, rules=(*old.rules, narrower))
    pair = decisions.RulePair(old, new, old.inputs, unit_domain(old))
    (answer, *_), _ = decisions.decisions(
        pair, None, AuditSettings(rows=10), Clock(0.05)
    )
    assert isinstance(answer.state, Bracket)
    assert answer.state.why == "the budget was spent within a box"
