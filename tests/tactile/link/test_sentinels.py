"""Frames that a byte ends: as many cells as the sensor has, or nothing."""

from __future__ import annotations

import pytest

from fuzzytree.tactile.boards import Board, Sentinel
from fuzzytree.tactile.link import decoder_of
from fuzzytree.tactile.sensor import Sensor

BOARD = Board("b", Sensor(2, 3, full=254), Sentinel())
GOOD = bytes([1, 2, 0, 4, 255])


def test_runs_of_zeros_are_unpacked() -> None:
    # As the description of the Sensitronics sketch has it for 4 x 4.
    board = Board("b", Sensor(4, 4, full=254), Sentinel())
    decoder = decoder_of(board)
    [empty, loaded] = decoder.feed(bytes([0, 16, 255]) + b"\xfe" * 16 + b"\xff")
    assert empty.tolist() == [[0] * 4] * 4
    assert loaded.tolist() == [[254] * 4] * 4
    assert decoder.counters.skipped == 0


@pytest.mark.parametrize(
    "wrong",
    [
        [1, 2, 0, 3],
        [1, 2, 0, 5],
        [1, 2, 3, 4, 5],
        [1, 2, 3, 4, 5, 6, 7],
        [0, 0, 6, 0],
        [1, 2, 3, 4, 5, 6, 0],
        [0, 0],
        [1, 0, 254],
        [9] * 400,
    ],
)
def test_a_frame_of_another_number_of_cells_is_damaged(wrong: list[int]) -> None:
    for size in (1, 1000):
        data = GOOD + bytes([*wrong, 255]) + GOOD
        decoder = decoder_of(BOARD)
        found = [
            frame.tolist()
            for start in range(0, len(data), size)
            for frame in decoder.feed(data[start : start + size])
        ]
        assert found == [[[1, 2, 0], [0, 0, 0]]] * 2
        assert decoder.counters.damaged == 1
        assert decoder.counters.skipped == len(wrong) + 1


def test_an_end_behind_an_end_is_a_stray_byte() -> None:
    decoder = decoder_of(BOARD)
    assert len(decoder.feed(GOOD + b"\xff\xff" + GOOD)) == 2
    assert (decoder.counters.damaged, decoder.counters.skipped) == (0, 2)


def test_a_length_may_look_like_the_mark_of_a_run() -> None:
    board = Board("b", Sensor(1, 9, full=200), Sentinel(end=255, zero=4))
    decoder = decoder_of(board)
    [frame] = decoder.feed(bytes([4, 4, 4, 4, 7, 255]))
    assert frame.tolist() == [[0] * 8 + [7]]
    [frame] = decoder.feed(bytes([0, 0, 7, 4, 6, 255]))
    assert frame.tolist() == [[0, 0, 7, 0, 0, 0, 0, 0, 0]]


def test_a_frame_without_end_is_dropped_before_it_comes() -> None:
    decoder = decoder_of(BOARD)
    for _ in range(100):
        assert decoder.feed(bytes(50)) == []
        assert decoder.pending <= 12
    assert decoder.counters.damaged == 1
    assert len(decoder.feed(b"\xff" + GOOD)) == 1


def test_a_banner_of_text_is_skipped() -> None:
    board = Board("b", Sensor(2, 3, full=254), Sentinel(), banner=2)
    decoder = decoder_of(board)
    assert len(decoder.feed(b"matrix 2 x 3\r\nready\r\n" + GOOD)) == 1
    assert (decoder.counters.skipped, decoder.counters.damaged) == (21, 0)


def test_a_banner_that_does_not_come_is_not_waited_for() -> None:
    board = Board("b", Sensor(2, 3, full=254), Sentinel(), banner=2)
    for start in (GOOD, bytes([10, 65, 65, 65, 65, 65, 255]), b"A" * 1100):
        decoder = decoder_of(board)
        decoder.feed(start)
        assert len(decoder.feed(b"\xff" + GOOD * 2)) >= 2


def test_the_first_bytes_of_a_joined_stream_are_not_looked_at() -> None:
    # Cut behind the mark of a run, five cells and a length look like six cells.
    cut = bytes([1, 2, 3, 4, 5, 1, 255])
    assert len(decoder_of(BOARD).feed(cut + GOOD)) == 2
    joined = decoder_of(BOARD, is_joined=True)
    assert len(joined.feed(cut + GOOD)) == 1
    assert (joined.counters.skipped, joined.counters.damaged) == (7, 0)


def test_a_joined_stream_that_begins_with_its_banner_loses_nothing() -> None:
    board = Board("b", Sensor(2, 3, full=254), Sentinel(), banner=2)
    decoder = decoder_of(board, is_joined=True)
    assert len(decoder.feed(b"matrix 2 x 3\r\nready\r\n" + GOOD * 2)) == 2
    decoder = decoder_of(board, is_joined=True)
    assert len(decoder.feed(GOOD * 3)) == 2
