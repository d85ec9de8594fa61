"""Bytes that are no frames are told in words; silence and time-outs need no clock."""

from __future__ import annotations

import numpy as np
import pytest
from simulated_board import encoded

from fuzzytree.tactile.boards import Board, Marker, Protocol, Request, Sentinel, Text
from fuzzytree.tactile.link.watching import (
    Watch,
    described,
    frame_time,
)
from fuzzytree.tactile.sensor import Sensor


def _board(protocol: Protocol, rows: int = 4, columns: int = 6) -> Board:
    return Board("mat", Sensor(rows, columns, full=200), protocol)


def _sent(protocol: Protocol, rows: int, columns: int, count: int = 20) -> bytes:
    random = np.random.default_rng(2)
    board = _board(protocol, rows, columns)
    return b"".join(
        encoded(board, random.integers(0, 160, (rows, columns)), number)
        for number in range(count)
    )


CASES: list[tuple[Protocol, Protocol, tuple[int, int], str]] = [
    (
        Marker("FE FF"),
        Marker("FE FF"),
        (4, 5),
        "the marker FE FF came 20 times, mostly 22 bytes apart, "
        "which is 4 x 5 and not 4 x 6",
    ),
    (
        Marker("FE FF"),
        Marker("FE FF"),
        (3, 6),
        "the marker FE FF came 20 times, mostly 20 bytes apart, "
        "which is 3 x 6 and not 4 x 6",
    ),
    (
        Marker("FE FF"),
        Marker("FE FF"),
        (5, 7),
        "the marker FE FF came 20 times, mostly 37 bytes apart, "
        "which is 35 cells and not 4 x 6",
    ),
    (
        Marker("FE FF"),
        Marker("FE FF", bits=16),
        (4, 6),
        "the marker FE FF came 20 times, mostly 50 bytes apart, "
        "which is 4 x 6 cells of 16 bits and not 8",
    ),
    (
        Marker("FE FF", bits=16),
        Marker("FE FF", tail="0D"),
        (4, 6),
        "the marker FE FF came 20 times, mostly 27 bytes apart, "
        "which is no number of cells of 16 bits",
    ),
    (
        Marker("FE FF", checksum="sum8", tail="0D"),
        Marker("FE FF", checksum="xor8", tail="0D"),
        (4, 6),
        "the marker FE FF came 20 times, mostly 28 bytes apart, as expected, "
        "but the checksum or the tail or the cells did not fit",
    ),
    (
        Marker("AB BA"),
        Marker("FE FF"),
        (4, 6),
        "the marker AB BA came 0 times: is the baud rate right?",
    ),
    (
        Marker("AB BA"),
        Text(),
        (4, 6),
        "nearly all is text; the marker AB BA came 0 times: is the baud rate right?",
    ),
    (
        Sentinel(),
        Sentinel(),
        (4, 4),
        "the end 255 came 20 times, mostly behind 16 values, "
        "which is 4 x 4 and not 4 x 6",
    ),
    (
        Sentinel(end=254),
        Sentinel(),
        (4, 4),
        "the end 254 came 0 times: is the baud rate right?",
    ),
    (
        Text(),
        Text(),
        (2, 6),
        "the end of a line came 20 times, mostly behind 12 numbers with space between, "
        "which is 2 x 6 and not 4 x 6",
    ),
    (
        Text(frame="block"),
        Text(frame="block"),
        (4, 5),
        "the end of a line came 100 times, mostly behind 5 numbers with space between, "
        "which is 4 x 5 and not 4 x 6",
    ),
    (
        Text(separator="comma"),
        Text(),
        (4, 6),
        "the end of a line came 20 times, mostly behind 0 numbers with comma between, "
        "which is 0 cells and not 4 x 6",
    ),
    (
        Text(prefix="F"),
        Text(),
        (4, 6),
        "the end of a line came 20 times, mostly behind 24 numbers with space between, "
        "as expected, but the prefix or the cells did not fit",
    ),
    (Text(), Sentinel(), (4, 6), "it is no text: is the baud rate right?"),
    (
        Request("41"),
        Request("41"),
        (9, 6),
        "a request was sent 20 times, mostly for 54 bytes, "
        "which is 9 x 6 and not 4 x 6",
    ),
]


@pytest.mark.parametrize(("stated", "true", "size", "text"), CASES)
def test_what_came_is_reported_beside_what_was_expected(
    stated: Protocol, true: Protocol, size: tuple[int, int], text: str
) -> None:
    assert described(_board(stated), _sent(true, *size), requests=20) == text


def test_two_bytes_are_enough_to_say_something() -> None:
    for protocol in (Marker("AA"), Sentinel(), Request("41"), Text()):
        for content in (
            b"\xaa",
            b"\xff\xff",
            b"\n\n",
            b"\x00" * 999,
            bytes(range(256)),
        ):
            assert described(_board(protocol), content)


@pytest.mark.parametrize(
    ("protocol", "count"),
    [
        (
            Marker(
                "AA 55",
                bits=16,
                sizes="rows and columns",
                skip=3,
                checksum="crc16",
                tail="0D",
            ),
            60,
        ),
        (Sentinel(), 25),
        (Request("41", checksum="xor8"), 25),
        (Text(), 96),
    ],
)
def test_a_frame_on_the_line_has_a_length(protocol: Protocol, count: int) -> None:
    assert frame_time(_board(protocol)) == pytest.approx(count * 10 / 115200)


def test_a_board_may_be_silent_for_ten_of_its_own_frame_times() -> None:
    watch = Watch(_board(Marker("AA")), 0.0)
    now = 0.0
    for _ in range(200):
        now += 0.1
        assert not watch.is_silent(now)
        watch.came(b"x", 1, now)
    assert watch.stall_s == pytest.approx(1.0)
    assert not watch.is_silent(now + 0.99)
    assert watch.is_silent(now + 1.01)
    assert watch.is_quiet(now + 1.01)
    watch.came(b"y", 0, now + 1.5)
    assert not watch.is_silent(now + 9)  # told already
    assert not watch.is_quiet(now + 2)


def test_the_pace_of_a_board_reports_more_than_its_baud_rate() -> None:
    watch = Watch(_board(Text()), 0.0)
    assert watch.stall_s == 3.0
    watch.came(b"x", 1, 0.0)
    assert watch.stall_s == pytest.approx(max(10 * frame_time(_board(Text())), 0.25))
    watch.came(b"x", 4, 0.2)
    assert watch.stall_s == pytest.approx(0.5)
    watch.came(b"x", 8, 0.24)
    assert watch.stall_s == pytest.approx(10 * (0.05 + (0.005 - 0.05) / 8))


def test_bytes_are_reported_once_in_each_time_of_patience() -> None:
    watch = Watch(_board(Marker("AA")), 0.0)
    stated = []
    for tick in range(100):
        watch.came(b"\x01\x02", 0, tick / 10)
        if text := watch.contradiction(tick / 10):
            stated.append((tick, text))
    text = "the marker AA came 0 times: is the baud rate right?"
    head = "for 3 s bytes came but no frame of 'mat'"
    assert stated == [(tick, f"{head}: {text}") for tick in (31, 63, 95)]


def test_noise_that_is_over_contradicts_nothing() -> None:
    watch = Watch(_board(Marker("AA")), 0.0)
    watch.came(b"\x01", 0, 0.1)
    assert watch.contradiction(4.0) is None
    watch.came(b"\x01", 0, 4.0)
    watch.came(b"\x01", 1, 5.0)
    assert watch.contradiction(9.0) is None


def test_a_late_answer_is_waited_for_until_it_is_over() -> None:
    questions = Watch(_board(Request("41", timeout_s=0.5)), 0.0)
    assert questions.is_due(0.0)
    questions.sent(0.0)
    assert not questions.is_due(0.4)
    assert not questions.is_overdue(0.4)
    assert questions.is_overdue(0.6)
    assert not questions.is_overdue(0.6)
    questions.came(b"x", 0, 0.62)
    assert not questions.is_due(0.66)
    assert questions.is_due(0.68)
    questions.sent(0.68)
    questions.came(b"x", 1, 0.7)
    assert questions.is_due(0.7)


def test_a_board_that_speaks_by_itself_is_never_requested() -> None:
    assert not Watch(_board(Text()), 0.0).is_due(9.0)
