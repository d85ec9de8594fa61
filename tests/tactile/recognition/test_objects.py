"""Several objects on a sensor: regions, their answers, and votes over time."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt
import pytest
from press_physics import press
from press_shapes import OBJECTS

from fuzzytree import table
from fuzzytree.api.verbs import learn
from fuzzytree.tactile.link.recording import FrameRecord
from fuzzytree.tactile.recognition.live import Live
from fuzzytree.tactile.recognition.objects import Tracker, regions
from fuzzytree.tactile.recognition.recogniser import State
from fuzzytree.tactile.rest import RestEvent
from fuzzytree.tactile.sensor import Counters, Frame, Sensor
from tests.tactile.frame_models import pressed_tree
from tests.tactile.replays import first_label, replayed


def squares(
    *places: tuple[int, int], size: int = 2, side: int = 12
) -> npt.NDArray[np.int64]:
    cells = np.zeros((side, side), np.int64)
    for row, column in places:
        cells[row : row + size, column : column + size] = 50
    return cells


def test_cells_that_touch_at_a_corner_are_one_region() -> None:
    found, left_out = regions(np.eye(4, dtype=np.int64))
    assert [one.area for one in found] == [4]
    assert left_out == 0


def test_what_is_too_small_is_counted() -> None:
    cells = squares((1, 1), (6, 6))
    cells[11, 0] = 99
    found, left_out = regions(cells, 2)
    assert [one.box for one in found] == [(1, 1, 3, 3), (6, 6, 8, 8)]
    assert left_out == 1
    assert len(regions(cells, 1)[0]) == 3
    assert regions(cells, 5) == ([], 3)


def test_the_cells_of_regions_add_up_to_the_frame() -> None:
    random = np.random.default_rng(0)
    for _ in range(100):
        cells = random.integers(0, 9, (9, 7)) * (random.random((9, 7)) < 0.3)
        found, _ = regions(cells, 1)
        if len(found) < 16:
            total = sum((one.cells for one in found), np.zeros_like(cells))
            assert np.array_equal(total, cells)
        assert [one.force for one in found] == sorted(
            (int(one.cells.sum()) for one in found), reverse=True
        )


def test_objects_keep_their_numbers_while_they_move() -> None:
    tracker = Tracker()
    numbers = []
    for step in range(6):
        found, _ = regions(squares((1, step), (8, 9 - step)))
        answers = tracker(0.1 * step, found, [0] * len(found))
        boxes = {
            one.box[0]: number for one, (number, _) in zip(found, answers, strict=True)
        }
        numbers.append((boxes[1], boxes[8]))
    assert numbers == [(1, 2)] * 6


def test_an_object_that_comes_back_after_a_while_is_a_new_one() -> None:
    tracker, (found, _) = Tracker(), regions(squares((1, 1)))
    assert tracker(0.0, found, [0]) == [(1, 0)]
    assert tracker(0.1, (), ()) == []
    assert tracker(0.4, found, [0]) == [(1, 0)]
    assert tracker(1.0, found, [0]) == [(2, 0)]


def test_a_vote_needs_more_than_half_to_change() -> None:
    tracker, (found, _) = Tracker(1.0), regions(squares((1, 1)))
    answers = [0] * 11 + [1, 0] * 10 + [1] * 11
    shown = [
        tracker(0.1 * number, found, [code])[0][1]
        for number, code in enumerate(answers)
    ]
    assert shown[:10] == [-1] * 10
    assert shown[10:31] == [0] * 21
    assert shown[-1] == 1
    assert shown.index(1) > 31


@pytest.mark.heavy
def test_nine_of_ten_objects_are_right_where_two_lie_there() -> None:
    tree, random = pressed_tree(60), np.random.default_rng(0)
    names = list(OBJECTS)
    fresh = {name: press(name, 30, 99).frames for name in names}
    pairs = [random.choice(names, 2).tolist() for _ in range(200)]
    frames = []
    for left, right in pairs:
        both = np.zeros((16, 32), np.uint8)
        for place, name in ((0, left), (16, right)):
            both[:, place : place + 16] = fresh[name][random.integers(30)]
        frames.append(both)
    records = (
        FrameRecord(Frame(cells, 10.0 * number, number), Counters(frames=number + 1))
        for number, cells in enumerate(frames)
    )
    live = Live(
        tree, Sensor(16, 32, threshold=6), replayed(records, 0.0), "two", reject=0.001
    )
    right = 0
    for pair, answer in zip(pairs, live.answers(), strict=True):
        placed = sorted(answer.objects, key=lambda one: one.x)
        right += sum(a.label == b for a, b in zip(placed, pair, strict=False))
    assert right / 400 >= 0.9


def test_each_object_has_its_own_place_and_answer() -> None:
    areas = np.array([[4.0], [5.0], [16.0], [15.0]])
    tree = learn(table(areas, columns=["area"]), target=["s", "s", "l", "l"])
    cells = squares((1, 1)) + squares((5, 6), size=4)
    record = FrameRecord(Frame(cells, 0.0, 0), Counters(frames=1))
    (answer,) = Live(tree, Sensor(12, 12), replayed([record], 0.0), "two").answers()
    large, small = answer.objects
    assert (large.label, small.label) == ("l", "s")
    assert (large.x, large.y) == (2.0, -1.0)
    assert (small.x, small.y) == (-4.0, 4.0)
    assert sum(large.probabilities) == pytest.approx(1.0)
    assert first_label(answer) == "l"
    assert answer.state is State.OBJECT


def test_a_vote_is_unknown_before_its_time() -> None:
    areas = np.array([[4.0], [5.0], [16.0], [15.0]])
    tree = learn(table(areas, columns=["area"]), target=["s", "s", "l", "l"])
    records = (
        FrameRecord(Frame(squares((1, 1)), 0.1 * k, k), Counters(frames=k + 1))
        for k in itertools.count()
    )
    live = Live(tree, Sensor(12, 12), replayed(records, 0.0), "one", vote_s=0.5)
    answers = list(live.answers(9))
    assert [first_label(one) for one in answers] == [""] * 5 + ["s"] * 4


def test_objects_that_touch_are_reported_once() -> None:
    areas = np.array([[4.0], [5.0], [16.0], [15.0]])
    tree = learn(table(areas, columns=["area"]), target=["s", "s", "l", "l"])
    shown = [squares((1, 1), (1, 6 - step), size=3) for step in range(3)]
    shown += [shown[-1]] * 3
    records = (
        FrameRecord(Frame(cells, 0.1 * k, k), Counters(frames=k + 1))
        for k, cells in enumerate(shown)
    )
    answers = list(Live(tree, Sensor(12, 12), replayed(records, 0.0), "two").answers())
    assert [len(one.objects) for one in answers] == [2, 2, 1, 1, 1, 1]
    events = [(k, event) for k, one in enumerate(answers) for event in one.events]
    assert events == [(2, RestEvent("merged", objects=(1, 2)))]
    assert events[0][1].text == (
        "the objects 1 and 2 touch: they are one region, and one object"
    )


def test_a_tare_that_a_pulled_plug_interrupts_begins_anew() -> None:
    areas = np.array([[4.0], [5.0], [16.0], [15.0]])
    tree = learn(table(areas, columns=["area"]), target=["s", "s", "l", "l"])
    records = (
        FrameRecord(
            Frame(squares((1, 1)) * (k >= 5), 0.1 * k, k),
            Counters(frames=k + 1, reconnects=int(k >= 5)),
        )
        for k in range(22)
    )
    live = Live(tree, Sensor(12, 12), replayed(records, 0.0), "one")
    live.tare()
    answers = list(live.answers())
    events = [(k, event.kind) for k, one in enumerate(answers) for event in one.events]
    assert events == [(6, "interrupted"), (15, "tare")]
    assert answers[10].objects
    assert not answers[-1].objects  # what lay there after the pause is the baseline
