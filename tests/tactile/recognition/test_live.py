"""Live recognition: answers, what displays see of them, and what goes wrong."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Iterable, Iterator

import numpy as np
import pytest

from fuzzytree import table
from fuzzytree.api.verbs import learn
from fuzzytree.tactile.link.recording import FrameRecord
from fuzzytree.tactile.recognition.frame_sources import Replayed
from fuzzytree.tactile.recognition.live import Hold, Live
from fuzzytree.tactile.recognition.recogniser import State
from fuzzytree.tactile.sensor import Cells, Counters, Frame, Sensor
from tests.tactile.replays import first_label, replayed

SENSOR = Sensor(4, 4)
SMALL = np.eye(4, dtype=np.uint8)
LARGE = np.full((4, 4), 99, np.uint8)
NOTHING = np.zeros((4, 4), np.uint8)
AREAS = np.array([[4.0], [5.0], [16.0], [15.0]])


def shown(source: Replayed, **settings: float) -> Live:
    tree = learn(table(AREAS, columns=["area"]), target=["s", "s", "l", "l"])
    return Live(tree, SENSOR, source, "frames", **settings)  # type: ignore[arg-type] # mypy sees no names


def records(frames: Iterable[Cells], **counters: int) -> Iterator[FrameRecord]:
    for number, cells in enumerate(frames):
        counted = Counters(frames=number + 1, **counters if number else {})
        yield FrameRecord(Frame(cells, number / 100, number), counted)


def live(frames: Iterable[Cells], **counters: int) -> Live:
    return shown(replayed(records(frames, **counters), 0.0))


def test_every_frame_is_answered_and_the_last_one_is_seen() -> None:
    found = live([SMALL, NOTHING, LARGE])
    answers = list(found.answers())
    assert [first_label(answer) for answer in answers] == ["s", "", "l"]
    assert [answer.state for answer in answers] == [
        State.OBJECT,
        State.NOTHING,
        State.OBJECT,
    ]
    view = found.view()
    assert view.answer is answers[-1]
    assert answers[-1].cells is not None
    assert answers[-1].cells.tolist() == LARGE.tolist()
    assert view.rate == pytest.approx(100.0)
    assert view.counters["frames"] == 3
    assert view.is_over


def test_the_rate_of_all_is_that_of_the_answers() -> None:
    frames = [Frame(SMALL, number / 100, number) for number in (0, 1, 2, 3, 50, 51)]
    source = replayed([FrameRecord(one, Counters(frames=1)) for one in frames], 0.0)
    found = shown(source)
    assert len(list(found.answers())) == 6
    assert found.view().rate == pytest.approx(5 / 0.51)


def test_before_the_first_frame_there_is_nothing_to_see() -> None:
    view = live([]).view()
    assert (view.answer, view.latency) == (None, None)
    assert (view.rate, view.trouble, view.is_over) == (0.0, "", False)


def test_live_ends_after_as_many_frames_as_are_requested() -> None:
    found = live(itertools.repeat(SMALL))
    assert len(list(found.answers(5))) == 5
    assert found.view().is_over


def test_a_frame_of_another_size_is_said_and_the_next_one_is_answered() -> None:
    found = live([np.zeros((2, 3), np.uint8), SMALL])
    steps = found.answers()
    first = next(steps)
    assert (first.state, first.objects) == (None, ())
    assert first.trouble == "a frame of 2 x 3 cells does not fit a sensor of 4 x 4"
    second = next(steps)
    assert first_label(second) == "s"
    assert found.view().refused == 1
    assert found.view().trouble == first.trouble


def test_a_saturated_frame_is_reported_and_still_answered() -> None:
    full = LARGE.copy()
    full[0, :2] = 255
    found = live([full])
    (answer,) = found.answers()
    assert first_label(answer) == "l"
    assert answer.saturated == 2
    assert found.view().trouble == "2 cells take no more: the frame is saturated"


def test_what_was_damaged_or_dropped_between_frames_is_said() -> None:
    found = live([SMALL, SMALL], damaged=1, dropped=3, reconnects=1)
    list(found.answers())
    assert found.view().trouble == (
        "1 frame was damaged and left out; "
        "3 frames were dropped, for they came too fast; "
        "the port went away and came back"
    )


def test_a_display_that_waits_hears_of_answers_and_of_the_end() -> None:
    found = live([SMALL, LARGE])
    heard: list[tuple[int, bool]] = []

    def display() -> None:
        seen = 0
        while not (heard and heard[-1][1]):
            seen = found.wait(seen, 10.0)
            heard.append((seen, found.view().is_over))

    watcher = threading.Thread(target=display)
    watcher.start()
    list(found.answers())
    watcher.join(10.0)
    assert heard[-1] == (2, True)


def test_waiting_for_news_that_do_not_come_ends_in_time() -> None:
    assert live([SMALL]).wait(0, 0.001) == 0


def test_the_largest_latency_is_that_of_all_and_the_median_of_the_last() -> None:
    found = live(itertools.repeat(SMALL))
    answers = list(found.answers(1100))
    latency = found.view().latency
    assert latency is not None
    assert latency.largest == max(answer.latency_s for answer in answers)
    recent = [answer.latency_s for answer in answers[-1024:]]
    assert latency.median == pytest.approx(float(np.median(recent)))
    assert latency.median <= latency.most <= latency.largest


def test_the_strength_is_that_of_the_class_or_the_largest_one() -> None:
    found = shown(replayed(records([SMALL, LARGE]), 0.0), reject=1.0)
    for answer in found.answers():
        (one,) = answer.objects
        own = one.strengths[one.code] if one.label else max(one.strengths)
        assert one.strength == own


def test_what_flickers_is_not_reported_before_it_holds() -> None:
    is_new = Hold(3)
    assert [is_new(seen) for seen in "abababbb"] == [False] * 7 + [True]
    assert [is_new(seen) for seen in "aabbb"] == [False] * 5


def test_frames_come_at_the_pace_of_their_times() -> None:
    begun = time.monotonic()
    times = [frame.time for frame in replayed(records([SMALL] * 6), 2.0)]
    assert time.monotonic() - begun >= times[-1] / 2.0
    assert times == [0.0, 0.01, 0.02, 0.03, 0.04, 0.05]


def test_a_source_that_is_closed_gives_no_more_frames() -> None:
    source = replayed(records(itertools.repeat(SMALL)), 0.0)
    frames = iter(source)
    next(frames)
    source.close()
    assert next(frames, None) is None


def test_a_speed_below_zero_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^a speed is 0 or more, not -1.0$"):
        replayed([], -1.0)
