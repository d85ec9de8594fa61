"""What a board puts on the line, against bytes worked out by hand."""

from __future__ import annotations

import doctest

import numpy as np
import pytest
import simulated_board
from simulated_board import banner, checksum, encoded

from fuzzytree.errors import TableError
from fuzzytree.tactile.boards import (
    Board,
    Marker,
    Order,
    Protocol,
    Request,
    Sentinel,
    Text,
)
from fuzzytree.tactile.sensor import Sensor

CELLS = np.array([[1, 0, 258], [0, 0, 16]])


def _board(protocol: Protocol, full: int = 1023, order: Order = "rows") -> Board:
    return Board("mat", Sensor(2, 3, full=full), protocol, order=order)


@pytest.mark.parametrize(
    ("protocol", "sent"),
    [
        (Marker("AA 55", bits=16), "aa55 0100 0000 0201 0000 0000 1000"),
        (
            Marker(
                "FE",
                bits=16,
                byte_order="big",
                sizes="rows and columns",
                skip=2,
                tail="0D 0A",
            ),
            "fe 0002 0003 0700 0001 0000 0102 0000 0000 0010 0d0a",
        ),
        (
            Marker("AA", bits=16, checksum="sum8"),
            "aa 0100 0000 0201 0000 0000 1000 14",
        ),
        (
            Request("41", bits=16, skip=1, checksum="xor8"),
            "07 0100 0000 0201 0000 0000 1000 15",
        ),
        (
            Request("41", bits=16, byte_order="big", checksum="crc16"),
            "0001 0000 0102 0000 0000 0010 833e",
        ),
    ],
)
def test_the_bytes_of_a_frame_are_those_worked_out_by_hand(
    protocol: Protocol, sent: str
) -> None:
    assert encoded(_board(protocol), CELLS, number=7).hex() == sent.replace(" ", "")


@pytest.mark.parametrize(
    ("protocol", "sent"),
    [
        (Text(), b"1 0 258 0 0 16\r\n"),
        (Text(separator="comma", prefix="F", skip=1), b"F,7,1,0,258,0,0,16\r\n"),
        (Text(frame="block", separator="semicolon"), b"1;0;258\r\n0;0;16\r\n\r\n"),
    ],
)
def test_text_is_lines_of_numbers(protocol: Text, sent: bytes) -> None:
    assert encoded(_board(protocol), CELLS, number=7) == sent


def test_columns_may_come_first() -> None:
    board = _board(Text(frame="block"), order="columns")
    assert encoded(board, CELLS) == b"1 0\r\n0 0\r\n258 16\r\n\r\n"


def test_runs_of_zeros_are_packed_and_never_hold_the_end() -> None:
    cells = np.zeros((2, 256), np.int64)
    sensor = Sensor(2, 256, full=254)
    board = Board("mat", sensor, Sentinel(end=2, zero=9))
    assert encoded(board, cells).hex(" ") == "09 ff 09 ff 09 01 09 01 02"
    cells[0, :2] = 3, 5
    board = Board("mat", sensor, Sentinel())
    assert encoded(board, cells).hex(" ") == "03 05 00 fe 00 fe 00 02 ff"


def test_the_checksum_of_modbus_is_that_of_its_specification() -> None:
    # The example of "Modbus over serial line" V1.02, 6.2.2: 02 07 gives 41 12.
    assert checksum("crc16", bytes.fromhex("0207")).hex() == "4112"


@pytest.mark.parametrize(
    ("protocol", "cells", "text"),
    [
        (
            Marker("AA"),
            [[1, 2]],
            "a frame of 1 x 2 cells does not fit a sensor of 2 x 3",
        ),
        (Marker("AA"), [[0, 0, 256], [0, 0, 0]], "a cell lies in 0 to 255, not 256"),
        (Marker("AA"), [[0, 0, -1], [0, 0, 0]], "a cell lies in 0 to 255, not -1"),
        (Sentinel(), [[0, 0, 255], [0, 0, 0]], "the board 'mat' has no cells of 255"),
    ],
)
def test_what_cannot_be_sent_is_refused(
    protocol: Protocol, cells: list[list[int]], text: str
) -> None:
    with pytest.raises(TableError) as caught:
        encoded(_board(protocol, 255), np.array(cells))
    assert str(caught.value) == text


def test_a_lone_zero_that_would_end_the_frame_is_refused() -> None:
    board = _board(Sentinel(end=1), 255)
    with pytest.raises(TableError) as caught:
        encoded(board, np.array([[2, 0, 2], [2, 2, 2]]))
    assert str(caught.value) == "a run of 1 zeros would end the frame"


def test_a_banner_has_its_lines_and_no_byte_that_is_no_letter() -> None:
    sensor = Sensor(2, 2)
    assert banner(Board("täst\n", sensor, Text(), banner=2)) == b"tst: ready\r\n" * 2
    assert banner(Board("mat", sensor, Text())) == b""


def test_the_examples_of_the_board_give_what_they_show() -> None:
    assert doctest.testmod(simulated_board).failed == 0
