"""Faults happen as often as asked, are counted, and are the same for a seed."""

from __future__ import annotations

import numpy as np
import pytest
from serial_faults import ConnectionFaults, Receiver, damaged, noise, with_marker
from simulated_board import encoded

from fuzzytree.errors import InvalidModelError
from fuzzytree.tactile.boards import Board, Marker, Port, Protocol, Text
from fuzzytree.tactile.sensor import Sensor

DATA = np.random.default_rng(1).bytes(100_000)


def test_each_fault_comes_as_often_as_its_chance_says() -> None:
    faults = ConnectionFaults(flip=0.01, lose=0.002, double=0.005)
    after = damaged(DATA, faults, np.random.default_rng(0))
    counts = np.array([after.flipped, after.lost, after.doubled])
    expected = np.array([1000.0, 200.0, 500.0])
    assert np.all(np.abs(counts - expected) < 5 * np.sqrt(expected))
    assert len(after.touched) == counts.sum()
    assert len(after.data) == len(DATA) - after.lost + after.doubled


def test_a_flip_turns_one_bit_and_touches_no_other_byte() -> None:
    after = damaged(DATA, ConnectionFaults(flip=0.01), np.random.default_rng(0))
    sent, came = np.frombuffer(DATA, np.uint8), np.frombuffer(after.data, np.uint8)
    assert np.flatnonzero(sent != came).tolist() == after.touched.tolist()
    turned = (sent ^ came)[after.touched]
    assert set(turned.tolist()) == {1 << bit for bit in range(8)}


def test_faults_of_a_seed_are_the_same_again() -> None:
    faults = ConnectionFaults(flip=0.01, lose=0.01, noise=0.5)
    first, second = np.random.default_rng(7), np.random.default_rng(7)
    for _ in range(20):
        assert noise(faults, first) == noise(faults, second)
        assert damaged(DATA[:500], faults, first).data == (
            damaged(DATA[:500], faults, second).data
        )


def test_without_faults_nothing_changes_and_no_number_is_drawn() -> None:
    random = np.random.default_rng(0)
    assert damaged(DATA, ConnectionFaults(), random).data == DATA
    assert noise(ConnectionFaults(), random) == b""
    assert random.random() == np.random.default_rng(0).random()


@pytest.mark.parametrize(
    "protocol",
    [
        Marker("AA 55"),
        Marker("AA 55 AA", bits=16, byte_order="big", checksum="crc16"),
        Marker("01 02", bits=16, tail="0D"),
    ],
)
@pytest.mark.parametrize("order", ["rows", "columns"])
@pytest.mark.parametrize("pressure", ["rises", "falls"])
def test_a_frame_can_be_made_to_hold_the_marker(
    protocol: Marker, order: str, pressure: str
) -> None:
    full = 255 if protocol.bits == 8 else 65535
    sensor = Sensor(3, 5, full=full)
    board = Board("mat", sensor, protocol, order=order, pressure=pressure)  # type: ignore[arg-type] # the words are those of the types
    marker = bytes.fromhex(protocol.marker)
    random = np.random.default_rng(3)
    before = random.integers(1, 4, (3, 5))
    after = with_marker(board, before, random)
    assert encoded(board, after).count(marker) == 2
    assert encoded(board, before).count(marker) == 1
    assert np.sum(before != after) <= len(marker)


@pytest.mark.parametrize(
    ("protocol", "full", "text"),
    [
        (Text(), 255, "the board 'mat' has no marker that cells could hold"),
        (Marker("AA 55", bits=16), 1023, "the cells of 'mat' can never hold AA 55"),
        (Marker("AA AA AA AA AA"), 255, "the cells of 'mat' can never hold "),
    ],
)
def test_cells_that_can_hold_no_marker_are_reported(
    protocol: Protocol, full: int, text: str
) -> None:
    board = Board("mat", Sensor(2, 2, full=full), protocol)
    with pytest.raises(ValueError, match="hold") as caught:
        with_marker(board, np.zeros((2, 2), np.int64), np.random.default_rng(0))
    assert str(caught.value).startswith(text)


@pytest.mark.parametrize(
    "chances",
    [{"flip": -1.0}, {"noise": 2.0}, {"flip": 0.5, "lose": 0.6}, {"baud": -1}],
)
def test_impossible_faults_are_refused(chances: dict[str, float]) -> None:
    with pytest.raises(InvalidModelError):
        ConnectionFaults(**chances)  # type: ignore[arg-type] # a baud is one of them


PORTS = [
    Port(baud=115200),
    Port(baud=9600, data_bits=7, parity="even", stop_bits=2),
    Port(baud=9600, parity="odd"),
]


@pytest.mark.parametrize("port", PORTS)
@pytest.mark.parametrize("share", [0.97, 1.0, 1.03])
def test_a_receiver_that_is_three_percent_off_hears_every_byte(
    port: Port, share: float
) -> None:
    data = bytes(byte & ((1 << port.data_bits) - 1) for byte in DATA[:500])
    receiver = Receiver(port, round(port.baud * share))
    assert receiver.heard(data) + receiver.idle() == data
    assert (receiver.framing_errors, receiver.parity_errors) == (0, 0)


@pytest.mark.parametrize("baud", [9600, 57600, 230400, 2_000_000])
def test_what_is_heard_at_a_wrong_rate_does_not_depend_on_the_pieces(baud: int) -> None:
    whole, pieces = Receiver(Port(), baud), Receiver(Port(), baud)
    found = whole.heard(DATA[:700]) + whole.idle()
    parts = [pieces.heard(DATA[start : start + 7]) for start in range(0, 700, 7)]
    assert b"".join([*parts, pieces.idle()]) == found != DATA[:700]
    assert pieces.framing_errors == whole.framing_errors > 0


def test_a_byte_at_twice_the_rate_is_what_is_worked_out_by_hand() -> None:
    # On the line, twice each: 0 1000 0010 1; then it rests. Seen: 0 01100000 0, whose
    # stop bit is 0, and behind the next fall 0 01111111 1.
    receiver = Receiver(Port(baud=9600), 19200)
    assert receiver.heard(b"A") + receiver.idle() == b"\x06\xfe"
    assert receiver.framing_errors == 1


def test_a_byte_takes_as_many_bits_as_its_port_says() -> None:
    assert [port.bits_of_a_byte for port in PORTS] == [10, 11, 11]
