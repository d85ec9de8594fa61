"""Markers: when a beginning is believed, and what happens when it was none."""

from __future__ import annotations

import numpy as np
import pytest
from simulated_board import checksum, encoded

from fuzzytree.tactile.boards import Board, Checksum, Marker, Pressure
from fuzzytree.tactile.link import decoder_of
from fuzzytree.tactile.link.fixed import are_whole, layout_of
from fuzzytree.tactile.sensor import Cells, Sensor

PLAIN = Board("b", Sensor(1, 4), Marker("AA 55"))


def frame(*cells: int) -> bytes:
    return b"\xaa\x55" + bytes(cells)


def lists(frames: list[Cells]) -> list[list[int]]:
    return [one.ravel().tolist() for one in frames]


def test_the_first_frame_waits_for_the_marker_of_the_next() -> None:
    decoder = decoder_of(PLAIN)
    assert decoder.feed(frame(1, 2, 3, 4) + b"\xaa") == []
    assert lists(decoder.feed(b"\x55")) == [[1, 2, 3, 4]]


def test_later_frames_are_given_out_at_their_last_byte() -> None:
    decoder = decoder_of(PLAIN)
    decoder.feed(frame(1, 2, 3, 4) + frame(5, 6, 7, 8))
    assert decoder.feed(frame(9, 9, 9, 9)[:-1]) == []
    assert lists(decoder.feed(b"\x09")) == [[9, 9, 9, 9]]


def test_a_frame_that_proves_itself_waits_for_nothing() -> None:
    for protocol, rest in (
        (Marker("AA 55", tail="0D 0A"), b"\r\n"),
        (Marker("AA 55", checksum="crc16"), bytes.fromhex("A12B")),
    ):
        decoder = decoder_of(Board("b", Sensor(1, 4), protocol))
        assert lists(decoder.feed(frame(1, 2, 3, 4) + rest)) == [[1, 2, 3, 4]]


def test_the_last_frame_of_a_stream_needs_no_next_one() -> None:
    decoder = decoder_of(PLAIN)
    assert decoder.feed(b"noise" + frame(1, 2, 3, 4)) == []
    assert lists(decoder.flush()) == [[1, 2, 3, 4]]
    assert decoder.counters.skipped == 5


def test_a_marker_among_the_cells_is_no_beginning() -> None:
    # The stream begins in the middle of a frame, before a false marker.
    pieces = [frame(7, 7, 0xAA, 0x55)[3:], frame(1, 2, 3, 4), frame(5, 6, 7, 8)]
    decoder = decoder_of(PLAIN)
    assert lists(decoder.feed(b"".join(pieces))) == [[1, 2, 3, 4], [5, 6, 7, 8]]
    assert decoder.counters.skipped == 3


def test_a_false_marker_that_stays_is_found_out_when_the_picture_changes() -> None:
    false = frame(7, 0xAA, 0x55, 7)
    decoder = decoder_of(PLAIN)
    # Beginning behind the true marker, the false one comes first.
    assert decoder.feed(false[2:] + false * 4) == []
    found = lists(decoder.feed(frame(1, 2, 3, 4) + frame(5, 6, 7, 8)))
    assert found == [[7, 0xAA, 0x55, 7]] * 4 + [[1, 2, 3, 4], [5, 6, 7, 8]]


def test_a_picture_that_never_changes_is_taken_at_its_first_marker() -> None:
    false = frame(7, 0xAA, 0x55, 8)
    decoder = decoder_of(PLAIN)
    found = lists(decoder.feed(false[2:] + false * 9))
    assert found[0] == [8, 0xAA, 0x55, 7]
    # The lock is false: the first frame that changes ends it, and is not lost.
    found = lists(decoder.feed(frame(1, 2, 3, 4) * 3))
    assert found[-2:] == [[1, 2, 3, 4]] * 2
    assert decoder.counters.resyncs == 1
    assert decoder.counters.doubtful == 1


def test_a_false_marker_does_not_win_over_the_place_where_a_frame_was_expected() -> (
    None
):
    false = frame(7, 0xAA, 0x55, 8)
    decoder = decoder_of(PLAIN)
    changing = frame(1, 2, 3, 4) + frame(5, 6, 7, 8)
    damaged = b"\xab" + false[1:]
    found = lists(decoder.feed(changing + false * 3 + damaged + false * 12))
    assert found[2:] == [[7, 0xAA, 0x55, 8]] * 15
    assert decoder.counters.damaged == 1
    assert decoder.counters.doubtful == 0


def test_a_lost_byte_makes_a_frame_doubtful_and_loses_no_other() -> None:
    decoder = decoder_of(PLAIN)
    data = frame(1, 1, 1, 1) + frame(2, 2, 2, 2)[:-1] + frame(3, 3, 3, 3) * 2
    assert lists(decoder.feed(data)) == [
        [1, 1, 1, 1],
        [2, 2, 2, 0xAA],  # given out at its last byte: what follows tells too late
        [3, 3, 3, 3],
        [3, 3, 3, 3],
    ]
    counters = decoder.counters
    assert (counters.doubtful, counters.damaged, counters.skipped) == (1, 0, 0)
    assert (decoder.framed, counters.bytes) == (23, 23)


def test_what_a_tail_proves_is_refused_where_a_byte_is_lost() -> None:
    board = Board("b", Sensor(1, 4), Marker("AA 55", tail="0D 0A"))
    whole, cut = frame(1, 2, 3, 4) + b"\r\n", frame(1, 2, 3) + b"\r\n"
    decoder = decoder_of(board)
    assert lists(decoder.feed(whole + cut + whole)) == [[1, 2, 3, 4]] * 2
    counters = decoder.counters
    assert (counters.doubtful, counters.damaged, counters.skipped) == (0, 1, 7)


def test_frames_of_another_size_are_never_given_out() -> None:
    board = Board(
        "b", Sensor(2, 3), Marker("AA", sizes="rows and columns", byte_order="big")
    )
    good = bytes.fromhex("AA 0002 0003 010203040506")
    other = bytes.fromhex("AA 0003 0002 010203040506")
    decoder = decoder_of(board)
    assert len(decoder.feed(other * 9)) == 0
    assert lists(decoder.feed(good)) == [[1, 2, 3, 4, 5, 6]]
    assert decoder.counters.skipped == 99


@pytest.mark.parametrize(
    ("checksum", "expected"), [("sum8", "DD"), ("xor8", "31"), ("crc16", "374B")]
)
def test_checksums_are_those_of_their_names(checksum: Checksum, expected: str) -> None:
    # The values that catalogues of checksums give for "123456789".
    board = Board("b", Sensor(1, 9), Marker("AA 55", checksum=checksum))
    data = b"\xaa\x55123456789" + bytes.fromhex(expected)
    assert lists(decoder_of(board).feed(data * 2)) == [[*b"123456789"]] * 2


def test_columns_become_rows() -> None:
    board = Board("b", Sensor(2, 3), Marker("AA"), order="columns")
    decoder = decoder_of(board)
    [found] = decoder.feed(bytes.fromhex("AA 01 02 03 04 05 06 AA"))
    assert found.tolist() == [[1, 3, 5], [2, 4, 6]]
    assert found.flags.c_contiguous


@pytest.mark.one_in(4)
@pytest.mark.parametrize("kind", ["none", "sum8", "xor8", "crc16"])
@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("pressure", ["rises", "falls"])
def test_many_places_are_judged_together_as_each_by_itself(
    kind: Checksum, bits: int, pressure: Pressure
) -> None:
    random = np.random.default_rng(5)
    full = 200 if bits == 8 else 40_000
    for columns in (1, 2, 7):
        protocol = Marker(
            "AA", bits=8 if bits == 8 else 16, skip=1, checksum=kind, tail="00"
        )
        board = Board("b", Sensor(1, columns, full=full), protocol, pressure=pressure)
        layout = layout_of(board, protocol)
        # Few different bytes, so that many places are whole by chance.
        data = random.choice(np.array([0, 0, 0, 0xAA, 255], np.uint8), 200_000)
        whole = encoded(board, np.full((1, columns), 170), 0)
        data[1000 : 1000 + layout.size] = np.frombuffer(whole, np.uint8)
        places = (data[: -layout.size] == 0xAA).nonzero()[0]
        good = are_whole(layout, data, places)
        assert 0 < good.sum() < len(places)
        for place, is_whole in list(zip(places.tolist(), good, strict=True))[:3000]:
            block = data[place : place + layout.size].tobytes()
            cells = np.frombuffer(block, layout.dtype, columns, layout.cells_from)
            body = block[1 : layout.cells_from + layout.cell_bytes]
            proof = checksum(kind, body) + b"\0"
            fits = block.endswith(proof) and int(cells.max()) <= layout.largest
            assert is_whole == (fits and len(body) + len(proof) + 1 == len(block))


def test_a_long_run_of_markers_is_judged_in_time_that_grows_with_its_bytes() -> None:
    protocol = Marker("AA", bits=16, checksum="crc16")
    board = Board("b", Sensor(256, 256, full=65535), protocol)
    decoder = decoder_of(board)
    good = np.full(2 * 256 * 256, 0xAA, np.uint8)
    whole = b"\xaa" + good.tobytes() + checksum("crc16", good.tobytes())
    found = decoder.feed(b"\xaa" * 70_000 + whole)
    assert [(one == 0xAAAA).all() for one in found] == [True]
    assert decoder.counters.skipped == 70_000
