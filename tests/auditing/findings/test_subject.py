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
    """Work with a clock that is not asked."""
    while clock.left_s < 1e9:
        checkpoint()
    return "never"


def test_a_question_without_end_leaves_time_for_the_others() -> None:
    turns = TimeSlices(ticking(), 0.5)
    found = [turns.ask(1, forever), *(turns.ask(9 - n, str) for n in range(9))]
    assert found[0] is None
    assert None not in found[1:]


def test_many_questions_without_end_each_take_a_small_part() -> None:
    turns = TimeSlices(ticking(), 1.0)
    left: list[float] = []
    for place in range(40):
        left.append(turns.clock.left_s)
        assert turns.ask(40 - place, forever) is None
    assert left[0] - left[1] < 13.0
    assert left[10] > 20.0
    assert left[20] > 0.0


def test_what_is_left_open_is_told_in_one_answer() -> None:
    turns = TimeSlices(ticking(), 0.5)
    assert not [*turns.rest("FT101", "rule", "whether they ever win")]
    turns.left_out = 12
    (answer,) = turns.rest("FT101", "rule", "whether they ever win")
    assert answer.sentence == (
        "whether they ever win is not known of 12 rules: the budget was spent"
    )
    assert answer.state == Declined("FTD03", "the budget was spent")
    assert not answer.is_finding
