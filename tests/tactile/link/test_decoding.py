"""Every family of boards: frames come back, whole or not at all, and are counted."""

from __future__ import annotations

import tracemalloc
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from simulated_board import banner, encoded

from fuzzytree.tactile.boards import Board, Marker, Request, Sentinel, Text
from fuzzytree.tactile.link import decoder_of
from fuzzytree.tactile.sensor import Cells, Counters, Sensor
from tests.tactile.families import FAMILIES, check_account, frames_of_file, stream_of

CUT_HERE = st.lists(st.integers(0, 10_000), max_size=12)


def decoded(board: Board, *pieces: bytes) -> tuple[list[list[list[int]]], Counters]:
    """Return the frames of a whole stream as lists, and what was counted."""
    decoder = decoder_of(board)
    frames: list[Cells] = []
    for piece in pieces:
        frames += decoder.feed(piece)
        check_account(decoder)
    frames += decoder.flush()
    check_account(decoder)
    assert decoder.pending == 0
    for frame in frames:
        assert frame.shape == (board.sensor.rows, board.sensor.columns)
        assert frame.dtype == (np.uint8 if board.sensor.full <= 255 else np.uint16)
        assert frame.max() <= (255 if board.sensor.full <= 255 else 65535)
    return [frame.tolist() for frame in frames], decoder.counters


def cut(data: bytes, places: list[int]) -> list[bytes]:
    ends = sorted({0, len(data), *(place % (len(data) + 1) for place in places)})
    return [data[start:end] for start, end in pairwise(ends)]


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("size", [1, 100_000])
def test_frames_come_back_whole_and_nothing_else_is_counted(
    name: str, size: int
) -> None:
    board = FAMILIES[name]
    frames = frames_of_file(board, 9)
    data = stream_of(board, frames)
    pieces = [data[start : start + size] for start in range(0, len(data), size)]
    found, counters = decoded(board, *pieces)
    assert found == [frame.tolist() for frame in frames]
    skipped = len(banner(board))
    assert counters == Counters(bytes=len(data), frames=9, skipped=skipped)


@settings(max_examples=100, deadline=None)
@given(
    st.sampled_from(sorted(FAMILIES)),
    st.booleans(),
    st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 3), st.integers(0, 3))),
    CUT_HERE,
)
def test_how_a_stream_is_cut_into_pieces_changes_nothing(
    name: str, is_still: bool, faults: list[tuple[int, int, int]], places: list[int]
) -> None:
    board = FAMILIES[name]
    data = bytearray(stream_of(board, frames_of_file(board, 7, seed=3)))
    if is_still:
        # A picture that does not change, with the marker among its cells.
        one = bytearray(encoded(board, frames_of_file(board, 1)[0]))
        one[7:9] = one[:2]
        data += one * 20
    for fault, lost, copied in faults:
        place = fault % len(data)
        data[place : place + lost] = data[place // 2 : place // 2 + copied]
    whole = decoded(board, bytes(data))
    assert decoded(board, *cut(bytes(data), places)) == whole


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(sorted(FAMILIES)), st.binary(max_size=3000), CUT_HERE)
def test_any_bytes_give_whole_frames_or_none(
    name: str, data: bytes, places: list[int]
) -> None:
    decoded(FAMILIES[name], *cut(data, places))


def faults(data: bytes, place: int) -> dict[str, bytes]:
    """Return a stream with one fault of each kind at a place."""
    before, byte, behind = data[:place], data[place : place + 1], data[place + 1 :]
    turned = bytes([byte[0] ^ (1 << place % 8)])
    return {
        "turned": before + turned + behind,
        "lost": before + behind,
        "doubled": before + byte + byte + behind,
        "added": before + b"\xa5" + byte + behind,
    }


def touched(board: Board, ends: list[int], place: int, fault: str) -> set[int]:
    """Return the frames that a fault at a place of the stream can harm."""
    frame = int(np.searchsorted(ends, place, side="right")) - 1
    found = {frame}
    if isinstance(board.protocol, Sentinel | Text):
        # What ends a frame begins the next one.
        found |= {frame + 1} if place >= ends[frame + 1] - 4 else set()
        found |= {frame - 1} if place == ends[frame] else set()
    elif place == ends[frame] and fault != "turned":
        found |= {frame - 1}
    return found


def check_one_fault(name: str, step: int) -> None:
    board = replace(FAMILIES[name], banner=0)
    frames = frames_of_file(board, 8)
    sent = [frame.tolist() for frame in frames]
    parts = [encoded(board, frame, number) for number, frame in enumerate(frames)]
    ends = np.cumsum([0, *map(len, parts)]).tolist()
    proof = getattr(board.protocol, "checksum", "none")
    for place in range(ends[2], ends[5], step):
        for fault, data in faults(b"".join(parts), place).items():
            if isinstance(board.protocol, Request) and fault != "turned":
                continue  # nothing marks where an answer begins
            found, counters = decoded(board, data)
            wrong = [frame for frame in found if frame not in sent]
            lost = {n for n, frame in enumerate(sent) if frame not in found}
            assert lost <= touched(board, ends, place, fault)
            assert len(wrong) <= 1
            if proof != "none" and (fault == "turned" or proof == "crc16"):
                assert not wrong
            if fault != "turned" and isinstance(board.protocol, Marker):
                assert not wrong or counters.doubtful == 1
            if lost and not wrong:
                assert counters.damaged + counters.doubtful > 0


@pytest.mark.parametrize("name", FAMILIES)
def test_one_fault_loses_no_frame_that_it_does_not_touch(name: str) -> None:
    check_one_fault(name, step=11)


@pytest.mark.heavy
@pytest.mark.parametrize("name", FAMILIES)
def test_no_fault_anywhere_loses_a_frame_that_it_does_not_touch(name: str) -> None:
    check_one_fault(name, step=1)


@pytest.mark.parametrize(
    "name", ["marker, sum8", "marker, xor8, sizes", "request, crc16"]
)
def test_a_changed_byte_that_a_checksum_covers_is_never_taken(name: str) -> None:
    board = replace(FAMILIES[name], banner=0)
    frame = frames_of_file(board, 1)[0]
    data = encoded(board, frame)
    for place in range(len(data)):
        for change in (1, 0x80, 0xFF):
            changed = bytearray(data)
            changed[place] ^= change
            found, counters = decoded(board, bytes(changed))
            assert found == []
            assert counters.skipped == len(data)


@pytest.mark.one_in(4)
@pytest.mark.parametrize("name", FAMILIES)
def test_memory_is_bounded_whatever_comes(name: str) -> None:
    board = FAMILIES[name]
    decoder = decoder_of(board)
    tracemalloc.start()
    try:
        for byte in (b"\xaa", b"7", b"a", b"\x02"):
            decoder.feed(byte * 2**17)
            assert decoder.pending < 2000
        assert tracemalloc.get_traced_memory()[1] < 20 * 2**20
    finally:
        tracemalloc.stop()
    check_account(decoder)


def test_a_decoder_begins_again_after_its_end() -> None:
    for board in FAMILIES.values():
        frames = frames_of_file(board, 3)
        decoder = decoder_of(board)
        for _ in range(2):
            got = [*decoder.feed(stream_of(board, frames)), *decoder.flush()]
            assert [frame.tolist() for frame in got] == [f.tolist() for f in frames]


def test_frames_stay_when_others_come() -> None:
    board = FAMILIES["marker"]
    one, two = frames_of_file(board, 2)
    decoder = decoder_of(board)
    decoder.feed(encoded(board, one))
    [first] = decoder.feed(encoded(board, two)[:2])
    decoder.feed(encoded(board, two)[2:])
    assert first.tolist() == one.tolist()


def test_only_boards_that_answer_are_requested() -> None:
    asks = {name: decoder_of(board).ask for name, board in FAMILIES.items()}
    assert asks.pop("request") == b"A"
    assert asks.pop("request, crc16") == b"\x10"
    assert set(asks.values()) == {b""}
    decoder = decoder_of(FAMILIES["marker"])
    decoder.feed(b"\xaa\x55\x01")
    decoder.requested()
    decoder.timed_out()
    assert decoder.pending == 3


def test_a_cell_above_what_the_sensor_can_read_is_damage() -> None:
    few = Board("b", Sensor(1, 2), Marker("AA 55", 16))
    good, bad = bytes.fromhex("AA55 0100 FF00"), bytes.fromhex("AA55 0100 0001")
    found, counters = decoded(few, good + bad + good + good)
    assert (found, counters.damaged) == ([[[1, 255]]] * 3, 1)
    falls = Board("b", Sensor(1, 2, full=200), Sentinel(), pressure="falls")
    found, counters = decoded(falls, bytes([200, 190, 255, 201, 1, 255]))
    assert (found, counters.damaged) == ([[[0, 10]]], 1)
