"""Many questions share the time, and those that are left open are counted."""

from __future__ import annotations

from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.states import Declined
from fuzzytree.auditing.findings.subject import TimeSlices
from fuzzytree.model.interrupts import checkpoint


def ticking() -> Clock:
    """Return a clock of 100 s on which each look takes 0.01 s."""
    seconds = iter(range(10**6))
    return Clock(100.0, now=lambda: next(seconds) / 100.0)


def forever(clock: Clock) -> str:
    """Work without a look at the clock."""
    while clock.left_s < 1e9:
        checkpoint()
    return "never"


def test_a_question_without_end_leaves_time_for_the_others() -> None:
    slices = TimeSlices(ticking(), 0.5)
    found = [slices.run(1, forever), *(slices.run(9 - n, str) for n in range(9))]
    assert found[0] is None
    assert None not in found[1:]


def test_many_questions_without_end_each_take_a_small_part() -> None:
    slices = TimeSlices(ticking(), 1.0)
    left: list[float] = []
    for place in range(40):
        left.append(slices.clock.left_s)
        assert slices.run(40 - place, forever) is None
    assert left[0] - left[1] < 13.0
    assert left[10] > 20.0
    assert left[20] > 0.0


def test_open_questions_are_reported_in_one_answer() -> None:
    slices = TimeSlices(ticking(), 0.5)
    assert not [*slices.rest("FT101", "rule")]
    slices.left_out = 12
    (answer,) = slices.rest("FT101", "rule")
    assert answer.sentence == (
        "whether they ever win is not known for 12 rules: the budget was spent"
    )
    assert answer.state == Declined("FTD03", "the budget was spent")
    assert not answer.is_finding
