"""Frames with faults through every decoder, against the truth; and through a port."""

from __future__ import annotations

import itertools
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import soak
import soak_line
import soak_verdicts
from msgspec.structs import replace
from serial_faults import ConnectionFaults
from simulated_board import Pause, banner, blob, encoded

from fuzzytree.tactile.board_file import load_board
from fuzzytree.tactile.boards import Board, Marker, Request, Sentinel, Text
from fuzzytree.tactile.link import decoder_of
from fuzzytree.tactile.sensor import Sensor

ROOT = Path(__file__).parents[2]
BOARDS = sorted((ROOT / "examples" / "tactile" / "boards").glob("*.yaml"))
# Where two bytes or more of a frame prove it, a wrong frame needs luck of 1 in 65536.
PROVEN = "marker, sizes, crc16"


@pytest.mark.parametrize("name", soak.CASES)
def test_without_faults_every_frame_comes(name: str) -> None:
    count = soak.soak(soak.CASES[name], 100, faults=ConnectionFaults())
    assert count.right == count.given == count.frames == 100
    assert count.touched == count.damaged == 0


@pytest.mark.parametrize("path", BOARDS, ids=lambda path: path.stem)
def test_the_boards_of_the_examples_send_what_is_read(path: Path) -> None:
    board = load_board(path)
    frames = [*itertools.islice(blob(board), 12)]
    decoder = decoder_of(board)
    given = decoder.feed(banner(board)) if board.banner else []
    for number, cells in enumerate(frames):
        decoder.requested()
        given += decoder.feed(encoded(board, cells, number))
    given += decoder.flush()
    assert [cells.tolist() for cells in given] == [cells.tolist() for cells in frames]


@pytest.mark.parametrize("name", soak.CASES)
def test_no_wrong_frame_comes_that_its_bytes_could_reveal(name: str) -> None:
    _check(name, soak.soak(soak.CASES[name], 300))


@pytest.mark.heavy
@pytest.mark.parametrize("name", soak.CASES)
def test_a_long_soak_keeps_the_laws(name: str) -> None:
    count = soak.soak(soak.CASES[name], 5500, seed=1)
    _check(name, count)
    assert count.touched > 200


@pytest.mark.heavy
@pytest.mark.parametrize("name", soak.CASES)
def test_many_faults_keep_the_laws(name: str) -> None:
    faults = ConnectionFaults(flip=2e-3, lose=1e-3, double=1e-3, noise=0.3, marker=0.5)
    count = soak.soak(soak.CASES[name], 3000, seed=2, faults=faults)
    assert count.unexplained == 0
    assert count.touched > 1000


def _check(name: str, count: soak.Count) -> None:
    """Hold a count against the laws; `soak` itself checks those of the bytes."""
    assert (count.unexplained, count.missed) == (0, 0)
    assert count.right >= count.frames - count.touched - count.alone
    assert count.late <= count.doubtful + count.resyncs
    if name == PROVEN:
        assert count.right == count.given


@pytest.mark.heavy
@pytest.mark.parametrize("name", soak.CASES)
def test_the_memory_of_a_decoder_does_not_grow(name: str) -> None:
    board = soak.CASES[name]
    random = np.random.default_rng(0)
    pool = soak.pool_of(board, soak.FAULTS, random)
    decoder = decoder_of(board)
    stream = b"".join(pool.sent[:60])
    tracemalloc.start()
    sizes: list[int] = []
    for _ in range(30):
        decoder.requested()
        decoder.feed(stream[: int(random.integers(len(stream)))])
        sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert max(sizes[10:]) < max(sizes[:10]) + 20_000


@pytest.mark.heavy
@pytest.mark.parametrize("name", soak_line.NAMES)
def test_a_line_reads_a_board_with_faults_through_a_port(name: str) -> None:
    faults = replace(soak_line.LINE_FAULTS, unplug=Pause(0.05, every=400))
    heard = soak_line.soak_line(soak.CASES[name], 0.5, least=300, faults=faults)
    truth, counters = heard.truth, heard.counters
    assert truth.frames > 200
    # What waits in the system is thrown away with the port.
    gone = 2 * (truth.bytes - counters.bytes) // (truth.bytes // truth.frames)
    gaps = 3 * (truth.unplugs + 1)
    lost = truth.frames - heard.right - counters.dropped
    assert lost <= truth.touched + counters.damaged + counters.resyncs + gone + gaps
    if name == PROVEN:
        assert heard.wrong == 0


# What the judge itself can tell.


def test_a_frame_that_stands_nowhere_is_unexplained() -> None:
    board = Board("mat", Sensor(2, 2), Marker("AA", checksum="sum8"))
    first, second = np.array([[1, 2], [3, 4]]), np.array([[5, 6], [7, 8]])
    data = encoded(board, first) + encoded(board, second)
    assert soak_verdicts.explained(board, data, first) == "untold"
    assert soak_verdicts.explained(board, data, second) == "untold"
    assert soak_verdicts.explained(board, data, first + second) == "unexplained"
    wrong = data.replace(b"\x0a", b"\x0b")  # a wrong checksum
    assert soak_verdicts.explained(board, wrong, first) == "unexplained"


def test_a_frame_is_late_if_only_the_next_marker_could_reveal() -> None:
    board = Board("mat", Sensor(2, 2), Marker("AA"))
    cells = np.array([[1, 2], [3, 4]])
    lost = np.array([[1, 2], [4, 0xAA]])
    sent = encoded(board, cells)
    data = sent + sent.replace(b"\x03", b"") + sent
    assert soak_verdicts.explained(board, data, cells) == "untold"
    assert soak_verdicts.explained(board, data, lost) == "late"
    # Out of step nobody may believe it.
    assert soak_verdicts.explained(board, b"\x00" + data[5:], lost) == "unexplained"


def test_an_answer_that_was_too_long_is_late_and_doubtful() -> None:
    board = Board("mat", Sensor(2, 2), Request("41"))
    cells = np.array([[1, 2], [3, 4]])
    decoder = decoder_of(board)
    for answer, verdict, doubtful in (
        (b"\1\2\3\4", "untold", 0),
        (b"\1\2\3\4\4", "late", 1),
    ):
        decoder.requested()
        assert [one.tolist() for one in decoder.feed(answer)] == [cells.tolist()]
        assert soak_verdicts.explained(board, answer, cells) == verdict
        decoder.requested()
        assert decoder.counters.doubtful == doubtful


def test_the_judge_unpacks_runs_and_lines_by_itself() -> None:
    assert soak_verdicts.unpacked(Sentinel(), b"\x05\x00\x02\x07") == [5, 0, 0, 7]
    assert soak_verdicts.unpacked(Sentinel(), b"\x05\x00") is None
    assert soak_verdicts.unpacked(Sentinel(), b"\x05\x00\x00") is None
    lines = Text(separator="comma", prefix="F", skip=1)
    assert soak_verdicts.numbers(lines, b"F,9,1, 2\r") == [1, 2]
    assert soak_verdicts.numbers(lines, b"G,9,1,2\r") is None
    assert soak_verdicts.numbers(lines, b"F,9,1,x\r") is None


def test_only_spaces_and_tabs_are_blanks_between_numbers() -> None:
    board = Board("mat", Sensor(1, 3), Text())
    decoder = decoder_of(board)
    frames = decoder.feed(b"1 2 3\r\n4\t 5 6\r\n1 2\f3\r\n1 2 3\v\r\n7 8 9\n")
    assert [cells.tolist() for cells in frames] == [
        [[1, 2, 3]],
        [[4, 5, 6]],
        [[7, 8, 9]],
    ]
    assert decoder.counters.damaged == 2
