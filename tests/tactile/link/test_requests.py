"""Answers: short, late, too long, and behind a banner."""

from __future__ import annotations

from fuzzytree.tactile.boards import Board, Request
from fuzzytree.tactile.link import decoder_of
from fuzzytree.tactile.sensor import Sensor

BOARD = Board("b", Sensor(1, 4, full=4095), Request("10", bits=16, skip=2))
ANSWER = bytes.fromhex("EEEE 0100 0200 0300 FF0F")


def test_an_answer_is_a_frame_behind_its_stamps() -> None:
    decoder = decoder_of(BOARD)
    assert decoder.ask == b"\x10"
    assert decoder.feed(ANSWER[:-1]) == []
    [frame] = decoder.feed(ANSWER[-1:])
    assert frame.tolist() == [[1, 2, 3, 4095]]


def test_a_short_answer_is_damaged_when_it_timed_out() -> None:
    decoder = decoder_of(BOARD)
    decoder.requested()
    decoder.feed(ANSWER[:-3])
    decoder.timed_out()
    assert (decoder.counters.damaged, decoder.counters.skipped) == (1, 7)
    decoder.requested()
    assert len(decoder.feed(ANSWER)) == 1


def test_no_answer_at_all_damages_nothing() -> None:
    decoder = decoder_of(BOARD)
    decoder.requested()
    decoder.timed_out()
    assert (decoder.counters.damaged, decoder.counters.skipped) == (0, 0)


def test_what_came_before_the_question_is_no_part_of_the_answer() -> None:
    decoder = decoder_of(BOARD)
    decoder.requested()
    assert len(decoder.feed(ANSWER + b"\x00\x00\x00")) == 1
    decoder.requested()
    [frame] = decoder.feed(ANSWER)
    assert frame.tolist() == [[1, 2, 3, 4095]]
    assert (decoder.counters.damaged, decoder.counters.skipped) == (0, 3)


def test_the_late_rest_of_an_answer_is_skipped_at_the_next_question() -> None:
    decoder = decoder_of(BOARD)
    decoder.requested()
    decoder.feed(ANSWER[:4])
    decoder.timed_out()
    decoder.feed(ANSWER[4:])  # the board goes on while the line waits for silence
    decoder.requested()
    assert len(decoder.feed(ANSWER)) == 1
    assert decoder.counters.skipped == len(ANSWER)


def test_a_banner_does_not_shift_the_first_answer() -> None:
    board = Board("b", Sensor(1, 4), Request("41"), banner=1)
    decoder = decoder_of(board)
    decoder.requested()
    assert decoder.feed(b"Velostat 16x16 Str") == []
    decoder.requested()
    [frame] = decoder.feed(b"eaming Ready\r\n\x01\x02\x03\x04")
    assert frame.tolist() == [[1, 2, 3, 4]]


def test_a_banner_that_does_not_come_ends_with_the_first_time_out() -> None:
    board = Board("b", Sensor(1, 4), Request("41"), banner=1)
    decoder = decoder_of(board)
    decoder.requested()
    assert decoder.feed(b"ABCD") == []  # four cells, or the beginning of a line
    decoder.timed_out()
    decoder.requested()
    assert len(decoder.feed(b"ABCD")) == 1
