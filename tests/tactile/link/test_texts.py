"""Lines of text: frames, titles, and lines that were meant to be frames."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fuzzytree.tactile.boards import Board, Text
from fuzzytree.tactile.link import decoder_of
from fuzzytree.tactile.sensor import Counters, Sensor

LINES = Board("b", Sensor(2, 2, full=1023), Text())
BLOCKS = Board("b", Sensor(2, 2, full=1023), Text("block"))
STAMPED = Board("b", Sensor(2, 2, full=1023), Text("line", "comma", "F", 1), banner=1)


def read(board: Board, text: bytes) -> tuple[list[list[list[int]]], Counters]:
    decoder = decoder_of(board)
    frames = [*decoder.feed(text), *decoder.flush()]
    counters = decoder.counters
    assert counters.bytes == decoder.framed + counters.skipped
    return [frame.tolist() for frame in frames], counters


@pytest.mark.parametrize(
    "line", [b"1 2 3 4\n", b"1 2 3 4\r\n", b"  1\t 02 3   4 \r\n", b"1 2 3 004\n"]
)
def test_a_line_of_numbers_is_a_frame(line: bytes) -> None:
    assert read(LINES, line) == (
        [[[1, 2], [3, 4]]],
        Counters(bytes=len(line), frames=1),
    )


@pytest.mark.parametrize(
    "line",
    [
        b"1 2 3\n",
        b"1 2 3 4 5\n",
        b"1 2 3 x\n",
        b"x 2 3 4\n",
        b"1 2 3 4.0\n",
        b"1 2 3 -4\n",
        b"-1 2 3 4\n",
        b"1 2 3 65536\n",
        b"1 2 3 9999999999999999999999\n",
        b"1 2 3 1_0\n",
        b"1 2 3 0x4\n",
        b"1 2 3 \xd9\xa3\n",
        b"1, 2, 3, 4\n",
        b"9" * 2000 + b"\n",
        b" " * 1_000_000 + b"1 2 3 4\n",
    ],
)
def test_a_line_that_was_to_be_a_frame_is_damaged(line: bytes) -> None:
    frames, counters = read(LINES, line + b"1 2 3 4\n")
    assert frames == [[[1, 2], [3, 4]]]
    assert (counters.damaged, counters.skipped) == (1, len(line))


@pytest.mark.parametrize(
    "line",
    [b"\n", b"\r\n", b"ready\n", b"Center point (8,8) value: 512\n", b"\xff\xfe\n"],
)
def test_other_lines_are_skipped(line: bytes) -> None:
    frames, counters = read(LINES, line + b"1 2 3 4\n")
    assert frames == [[[1, 2], [3, 4]]]
    assert (counters.damaged, counters.skipped) == (0, len(line))


def test_numbers_of_a_banner_are_no_damage() -> None:
    board = Board("b", Sensor(2, 2, full=1023), Text(), banner=2)
    frames, counters = read(board, b"2 2\n1.5 volts\n1 2 3 4\n2 2\n")
    assert frames == [[[1, 2], [3, 4]]]
    assert (counters.damaged, counters.skipped) == (1, 18)


def test_a_board_that_sends_no_banner_loses_no_frame() -> None:
    board = Board("b", Sensor(2, 2, full=1023), Text(), banner=2)
    assert read(board, b"1 2 3 4\n5 6 7 8\n")[1].frames == 2


def test_a_prefix_and_stamps_stand_before_the_cells() -> None:
    text = b"CFG,2,2\nF,1234567,1,2,3,4\nG,1,1,2,3,4\nF,1.5,1, 2,3 ,4,\nF,1,2,3,4\n"
    frames, counters = read(STAMPED, text)
    assert frames == [[[1, 2], [3, 4]]] * 2
    # G has half as many numbers as a frame, and the last line begins like one.
    assert counters.damaged == 2


def test_an_empty_field_is_no_number() -> None:
    text = b"CFG,2,2\nF,0,1,,3,4\nF,0,1,2,3,4,,\n"
    frames, counters = read(STAMPED, text)
    assert (frames, counters.damaged) == ([], 2)


def test_the_cut_last_line_is_no_frame() -> None:
    frames, counters = read(LINES, b"1 2 3 4\n1 2 3 4")
    assert (len(frames), counters.damaged, counters.skipped) == (1, 1, 7)


def test_the_first_line_of_a_joined_stream_is_not_looked_at() -> None:
    text = b"2 2 3 4\n1 2 3 4\n"  # the rest of 12 2 3 4, say
    assert len(decoder_of(LINES).feed(text)) == 2
    decoder = decoder_of(LINES, is_joined=True)
    assert [frame.tolist() for frame in decoder.feed(text)] == [[[1, 2], [3, 4]]]
    assert (decoder.counters.skipped, decoder.counters.damaged) == (8, 0)
    blocks = decoder_of(BLOCKS, is_joined=True)
    assert len(blocks.feed(b"2 2\n3 4\n5 6\n\n1 2\n3 4\n\n")) == 1
    assert blocks.counters.damaged == 0


def test_a_joined_stream_that_begins_with_its_banner_loses_nothing() -> None:
    for board, frame in ((STAMPED, b"F,0,1,2,3,4\n"), (BLOCKS, b"1 2\n3 4\n\n")):
        with_banner = replace(board, banner=2)
        decoder = decoder_of(with_banner, is_joined=True)
        assert len(decoder.feed(b"mat\nready\n" + frame * 2)) == 2
        decoder = decoder_of(with_banner, is_joined=True)
        assert len(decoder.feed(frame * 3)) == 2


def test_a_block_is_a_frame_at_its_last_line() -> None:
    decoder = decoder_of(BLOCKS)
    assert decoder.feed(b"1 2\n") == []
    [frame] = decoder.feed(b"3 4\n")
    assert frame.tolist() == [[1, 2], [3, 4]]
    decoder.feed(b"\n")
    assert (decoder.counters.skipped, decoder.framed) == (0, 9)


@pytest.mark.parametrize("title", [b"\n", b"\r\n", b"Full matrix:\n", b"Frame 12\n"])
def test_an_empty_line_or_a_title_stands_between_blocks(title: bytes) -> None:
    frames, counters = read(BLOCKS, title + (b"1 2\n3 4\n" + title) * 2)
    assert frames == [[[1, 2], [3, 4]]] * 2
    assert (counters.skipped, counters.damaged) == (len(title), 0)


@pytest.mark.parametrize(
    ("text", "damaged", "doubtful"),
    [
        (b"1 2\n\n", 1, 0),
        (b"1 2\n3 4 5\n\n", 1, 0),
        (b"1 2 3\n4 5\n1 2\n\n", 1, 0),
        (b"1 2\ntitle\n3 4\n\n", 2, 0),
        (b"1 2\n3 4\n5 6\n\n", 0, 1),
        (b"1 2\n3 4\n5 6\n7 8\n9\n\n", 0, 1),
        (b"1 2\n3 4\n5 6 7\n\n", 0, 1),
    ],
)
def test_a_block_of_another_size_is_no_frame(
    text: bytes, damaged: int, doubtful: int
) -> None:
    frames, counters = read(BLOCKS, text + b"1 2\n3 4\n\n")
    assert frames == [[[1, 2], [3, 4]]] * (1 + doubtful)
    assert (counters.damaged, counters.doubtful) == (damaged, doubtful)


def test_a_block_that_is_not_ended_is_damaged() -> None:
    frames, counters = read(BLOCKS, b"1 2\n3 4\n\n1 2\n")
    assert (len(frames), counters.damaged, counters.skipped) == (1, 1, 4)


def test_a_line_without_end_is_dropped_before_it_comes() -> None:
    for board, frame in ((LINES, b"1 2 3 4\n"), (BLOCKS, b"1 2\n3 4\n")):
        decoder = decoder_of(board)
        for _ in range(100):
            decoder.feed(b"12 " * 1000)
            assert decoder.pending < 500
        assert decoder.counters.damaged == 1
        assert len(decoder.feed(b"\n\n" + frame)) == 1
