"""Recordings: what is written is read back, and damage costs what is damaged."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
import zlib
from pathlib import Path

import msgspec
import numpy as np
import pytest

from fuzzytree.errors import ReadError, TableError, WriteError
from fuzzytree.tactile.boards import Board, Marker, Protocol, Sentinel, Text
from fuzzytree.tactile.link import recording as records
from fuzzytree.tactile.link.recording import (
    Recorder,
    Recording,
    RecordingFile,
    read_recording,
)
from fuzzytree.tactile.sensor import Cells, Counters, Frame, Sensor

BOARD = Board("mat", Sensor(3, 4), Marker("AA 55"))
RECORD = records.layout_of(BOARD).itemsize


def _frames(count: int, board: Board = BOARD) -> Cells:
    random = np.random.default_rng(5)
    shape = (count, board.sensor.rows, board.sensor.columns)
    return random.integers(0, board.sensor.full + 1, shape)


def _record(path: Path, count: int, board: Board = BOARD) -> bytes:
    with Recorder(path, board, started_ns=1_000) as recorder:
        for number, cells in enumerate(_frames(count, board)):
            counters = Counters(bytes=14 * number, frames=number + 1, dropped=2)
            recorder.write(Frame(cells, number / 8, number), counters)
    return path.read_bytes()


def _read(path: Path, content: bytes) -> Recording:
    path.write_bytes(content)
    return read_recording(path)


@pytest.mark.parametrize(
    ("protocol", "full", "width"),
    [
        (Marker("AA 55"), 255, 1),
        (Marker("AA", bits=16), 1023, 2),
        (Sentinel(), 254, 1),
        (Text(), 4095, 2),
    ],
)
def test_what_is_written_is_read_back(
    tmp_path: Path, protocol: Protocol, full: int, width: int
) -> None:
    sensor = Sensor(3, 4, full=full, threshold=3, baseline=(1,) * 12, masked=((2, 3),))
    board = Board("mat", sensor, protocol, banner=2)
    _record(tmp_path / "a.ftr", 5, board)
    found = read_recording(tmp_path / "a.ftr")
    assert found.board == board
    assert found.frames.dtype.itemsize == width
    assert (found.frames == _frames(5, board)).all()
    assert found.times.tolist() == [0.0, 0.125, 0.25, 0.375, 0.5]
    assert found.numbers.tolist() == [0, 1, 2, 3, 4]
    assert found.counters == Counters(bytes=56, frames=5, dropped=2)
    assert (found.damaged, found.cut_bytes, found.started_ns) == (0, 0, 1_000)


def test_the_layout_is_that_of_the_page(tmp_path: Path) -> None:
    """Read a file with nothing but what `docs/reference/recordings.md` says."""
    content = _record(tmp_path / "a.ftr", 2)
    assert content[:8] == b"\x89FTR\r\n\x1a\n"
    assert np.frombuffer(content, "<u2", 3, 8).tolist() == [2, 3, 4]
    assert list(content[14:16]) == [1, 9]
    record, text = np.frombuffer(content, "<u4", 2, 16).tolist()
    assert int.from_bytes(content[24:32], "little") == 1_000
    board = msgspec.json.decode(content[32 : 32 + text])
    assert board["sensor"]["rows"] == 3
    check = int.from_bytes(content[32 + text : 36 + text], "little")
    assert check == zlib.crc32(content[: 32 + text])
    second = content[36 + text + record :]
    assert len(second) == record == 4 + 8 + 8 + 72 + 12 + 4
    assert second[:4] == b"\xf5fr\n"
    assert int.from_bytes(second[4:12], "little") == 1
    assert int.from_bytes(second[12:20], "little") == 125_000_000
    assert np.frombuffer(second, "<i8", 6, 20).tolist() == [14, 2, 0, 0, 0, 2]
    assert list(second[92:104]) == _frames(2)[1].reshape(-1).tolist()
    assert int.from_bytes(second[104:], "little") == zlib.crc32(second[:104])


def test_the_same_frames_give_the_same_bytes(tmp_path: Path) -> None:
    assert _record(tmp_path / "a.ftr", 3) == _record(tmp_path / "b.ftr", 3)


def test_a_file_cut_anywhere_loses_only_what_was_cut(tmp_path: Path) -> None:
    path = tmp_path / "a.ftr"
    size = len(_record(path, 4))
    for cut in range(1, 2 * RECORD + 1):
        os.truncate(path, size - cut)
        found = read_recording(path)
        whole = 4 - -(-cut // RECORD)
        assert found.numbers.tolist() == list(range(whole))
        assert (found.damaged, found.cut_bytes) == (0, -cut % RECORD)


def test_a_flipped_byte_costs_its_record_or_reports_that_the_header_is_damaged(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.ftr"
    content = _record(path, 3)
    begin = len(content) - 3 * RECORD
    with path.open("r+b", buffering=0) as file:
        for place, byte in enumerate(content):
            os.pwrite(file.fileno(), bytes([byte ^ 0x41]), place)
            if place < begin:
                with pytest.raises(ReadError):
                    read_recording(path)
            else:
                hit = (place - begin) // RECORD
                found = read_recording(path)
                assert found.numbers.tolist() == [n for n in range(3) if n != hit]
                assert (found.damaged, found.cut_bytes) == (1, 0)
            os.pwrite(file.fileno(), bytes([byte]), place)


@pytest.mark.parametrize("count", [1, 7, 90, 200])
def test_bytes_that_are_lost_or_too_many_cost_the_records_they_touch(
    tmp_path: Path, count: int
) -> None:
    content = _record(tmp_path / "a.ftr", 6)
    place = len(content) - 4 * RECORD + 9  # in the third record
    touched = -(-(9 + count) // RECORD)
    found = _read(tmp_path / "b.ftr", content[:place] + content[place + count :])
    after = list(range(2 + touched, 6))
    assert found.numbers.tolist() == [0, 1, *after]
    noise = records.MARK * 100
    found = _read(tmp_path / "b.ftr", content[:place] + noise[:count] + content[place:])
    assert found.numbers.tolist() == [0, 1, 3, 4, 5]
    assert found.damaged >= 1


@pytest.mark.parametrize("seed", range(5))
def test_however_a_file_is_damaged_only_true_frames_come_out(
    tmp_path: Path, seed: int
) -> None:
    random = np.random.default_rng(seed)
    content = _record(tmp_path / "a.ftr", 12)
    begin = len(content) - 12 * RECORD
    known = {number: cells.tolist() for number, cells in enumerate(_frames(12))}
    for _ in range(40):
        damaged = bytearray(content)
        for _ in range(random.integers(1, 6)):
            place = int(random.integers(begin, len(damaged) + 1))
            end = place + int(random.choice([0, 1, 5, 150]))
            damaged[place:end] = random.bytes(int(random.choice([0, 1, 5, 150])))
        found = _read(tmp_path / "b.ftr", bytes(damaged))
        for number, cells in zip(found.numbers.tolist(), found.frames, strict=True):
            assert cells.tolist() == known[number]
        if len(found.frames) < 12:
            assert found.damaged or found.cut_bytes
        assert found.numbers.tolist() == sorted(set(found.numbers.tolist()))


def test_a_file_made_to_be_slow_is_refused(tmp_path: Path) -> None:
    board = Board("mat", Sensor(256, 256), Marker("AA 55"))
    header = records.header(board, 0)
    path = tmp_path / "slow.ftr"
    with pytest.raises(ReadError) as caught:
        _read(path, header + records.MARK * 100_000)
    assert str(caught.value) == f"{path}: is damaged all over"


def test_a_frame_of_a_long_recording_comes_after_the_other(tmp_path: Path) -> None:
    _record(tmp_path / "a.ftr", 4)
    with RecordingFile(tmp_path / "a.ftr") as file:
        assert next(iter(file)).frame.number == 0
        assert [frame.number for frame, _ in file] == [0, 1, 2, 3]


def test_a_recording_too_large_for_memory_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fuzzytree.tactile.link.recording.LARGEST_ARRAY", 30)
    path = tmp_path / "a.ftr"
    with pytest.raises(ReadError) as caught:
        _read(path, _record(tmp_path / "b.ftr", 3))
    assert str(caught.value) == (
        f"{path}: its 3 frames are more than 30 bytes, too many for memory"
    )


def _sealed(content: bytes) -> bytes:
    return content + records.crc(content)


def _header(text: bytes, **changes: int) -> bytes:
    fixed = np.frombuffer(records.fixed_part(BOARD, len(text), 0), records.FIXED).copy()
    for name, value in changes.items():
        fixed[name] = value
    return _sealed(fixed.tobytes() + text)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is no recording of a board"),
        (records.MAGIC, "is no recording of a board"),
        (b"time,number\n" * 9, "is no recording of a board"),
        (
            _header(b"{}", version=3),
            "is a recording of version 3; this program reads versions 1, 2",
        ),
        (_header(b"{}", board_bytes=2**32 - 1), "its header is damaged"),
        (_header(b"{}"), "its board cannot be read: Object missing required field `na"),
        (_header(b"\xff"), "its board cannot be read: "),
        (_header(b"[" * 100_000), "its board cannot be read: "),
        (
            _header(msgspec.json.encode(BOARD).replace(b'"rows":3', b'"rows":0')),
            "its board cannot be read: Expected `int` >= 1 - at `$.sensor.rows`",
        ),
        (_header(msgspec.json.encode(BOARD), rows=4), "its header contradicts its bo"),
        (_header(msgspec.json.encode(BOARD), record_bytes=1), "its header contradic"),
        (_header(msgspec.json.encode(BOARD), counters=11), "its header contradicts i"),
    ],
)
def test_what_is_no_recording_is_one_sentence(
    tmp_path: Path, content: bytes, message: str
) -> None:
    path = tmp_path / "a.ftr"
    with pytest.raises(ReadError) as caught:
        _read(path, content)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert "\n" not in str(caught.value)


def test_a_folder_a_pipe_and_nothing_are_no_recordings(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name, why in (
        ("", "is no file"),
        ("pipe", "is no file"),
        ("none", "cannot be read: no such file or directory"),
    ):
        with pytest.raises(ReadError) as caught:
            read_recording(tmp_path / name)
        assert str(caught.value) == f"{tmp_path / name}: {why}"


def test_a_file_that_is_there_is_kept_unless_reported(tmp_path: Path) -> None:
    path = tmp_path / "a.ftr"
    before = _record(path, 2)
    with pytest.raises(WriteError) as caught:
        Recorder(path, BOARD)
    assert str(caught.value) == f"{path}: is there already"
    assert path.read_bytes() == before
    Recorder(path, BOARD, replace=True).close()
    assert len(read_recording(path).frames) == 0


def test_a_frame_that_has_no_place_is_refused(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.ftr", BOARD) as recorder:
        for cells, message in (
            (np.full((3, 4), 256), "a cell lies in 0 to 255, not 256"),
            (np.full((3, 4), -1), "a cell lies in 0 to 255, not -1"),
            (
                np.zeros((4, 3), int),
                "a frame of 4 x 3 cells does not fit a sensor of 3 x 4",
            ),
        ):
            with pytest.raises(TableError) as caught:
                recorder.write(Frame(cells, 0.0, 0), Counters())
            assert str(caught.value) == message
    assert len(read_recording(tmp_path / "a.ftr").frames) == 0


def test_a_place_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "a" / "a.ftr"
    path.parent.touch()
    with pytest.raises(WriteError) as caught:
        Recorder(path, BOARD)
    message = f"{path}: cannot be written: '{path.parent}' is not a folder"
    assert str(caught.value) == message


@pytest.mark.one_in(3)
@pytest.mark.parametrize("moment", [1, 2, 3])
def test_who_dies_at_the_beginning_leaves_no_file_or_a_recording(
    tmp_path: Path, moment: int
) -> None:
    """It dies when it asks the disk for the n-th time."""
    path = tmp_path / "a.ftr"
    program = (
        "import sys\n"
        "sys.path.insert(0, sys.argv[2])\n"
        "from test_recording import *\n"
        "moments = iter(range(1, 9))\n"
        "def ask(file):\n"
        "    if next(moments) == int(sys.argv[3]):\n"
        "        os.kill(os.getpid(), 9)\n"
        "os.fsync = os.fdatasync = ask\n"
        "with Recorder(sys.argv[1], BOARD) as recorder:\n"
        "    recorder.write(Frame(np.zeros((3, 4), int), 0.0, 0), Counters())\n"
    )
    folder = str(Path(__file__).parent)
    words = [sys.executable, "-c", program, str(path), folder, str(moment)]
    assert subprocess.run(words, check=False).returncode == -9
    if moment == 1:
        assert not path.exists()
    else:
        assert len(read_recording(path).frames) == moment - 2


def test_a_full_disk_is_reported_and_keeps_what_came_before(tmp_path: Path) -> None:
    """A limit on the size of a file stands for the full disk."""
    path = tmp_path / "a.ftr"
    program = (
        "import resource, signal, sys\n"
        "sys.path.insert(0, sys.argv[2])\n"
        "from test_recording import *\n"
        "from test_recording import _record\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1500, 1500))\n"
        "try:\n"
        "    _record(Path(sys.argv[1]), 50)\n"
        "except WriteError as error:\n"
        "    print(error)\n"
    )
    words = [sys.executable, "-c", program, str(path), str(Path(__file__).parent)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout == f"{path}: cannot be written: file too large\n"
    found = read_recording(path)
    assert path.stat().st_size == 1500
    assert len(found.frames) == found.numbers[-1] + 1 >= 5
    assert found.cut_bytes > 0


def test_a_disk_that_keeps_nothing_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.ftr"
    recorder = Recorder(path, BOARD)

    def fail(_file: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr("fuzzytree.tactile.link.recording._to_disk", fail)
    recorder.write(Frame(np.zeros((3, 4), int), 0.0, 0), Counters())
    with pytest.raises(WriteError) as caught:
        recorder.close()
    assert str(caught.value) == f"{path}: cannot be written: input/output error"
    assert len(read_recording(path).frames) == 1


ENDLESS = """
import sys
import numpy as np
from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.sensor import Counters, Frame
from fuzzytree.tactile.link.recording import Recorder
from fuzzytree.tactile.sensor import Sensor

board = Board("mat", Sensor(64, 64), Marker("AA 55"))
with Recorder(sys.argv[1], board) as recorder:
    for number in range(10**9):
        cells = np.full((64, 64), number % 256)
        recorder.write(Frame(cells, number / 100, number), Counters(frames=number))
        print(number, flush=True)
"""


def _killed(path: Path, after: int, pause: float) -> int:
    """Return the last frame that a recorder had written when it was killed."""
    words = [sys.executable, "-c", ENDLESS, str(path)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if int(line) >= after:
                break
        time.sleep(pause)  # a moment that has nothing to do with its work
        process.send_signal(signal.SIGKILL)
        rest = process.stdout.read().split("\n")
    return max([after, *(int(word) for word in rest[:-1])])


def _check_killed(path: Path, last: int) -> None:
    found = read_recording(path)
    assert found.damaged == 0
    assert len(found.frames) >= last + 1
    assert found.numbers.tolist() == list(range(len(found.frames)))
    assert (found.frames == (found.numbers % 256)[:, None, None]).all()


def test_a_recorder_that_is_killed_has_written_all_it_took(tmp_path: Path) -> None:
    _check_killed(tmp_path / "a.ftr", _killed(tmp_path / "a.ftr", 40, 0.003))


@pytest.mark.heavy
@pytest.mark.parametrize("moment", range(20))
def test_a_recorder_killed_at_any_moment_has_written_all_it_took(
    tmp_path: Path, moment: int
) -> None:
    path = tmp_path / "a.ftr"
    _check_killed(path, _killed(path, moment * 7, moment * 0.0007))


def test_a_recording_of_the_first_layout_is_read(tmp_path: Path) -> None:
    content = bytearray(_record(tmp_path / "a.ftr", 2))
    text = int.from_bytes(content[20:24], "little")
    content[8] = 1
    content[32 + text : 36 + text] = records.crc(bytes(content[: 32 + text]))
    found = _read(tmp_path / "b.ftr", bytes(content))
    assert found.frames.tolist() == _frames(2).tolist()


def test_what_cells_read_at_rest_since_a_frame_is_in_the_recording(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.ftr"
    tared = msgspec.structs.replace(
        BOARD.sensor, baseline=tuple(range(12)), masked=((1, 2), (2, 0))
    )
    counters = Counters(frames=1)
    with Recorder(path, BOARD, started_ns=0) as recorder:
        for number, cells in enumerate(_frames(3)):
            frame = Frame(cells, number / 8, number)
            recorder.write(frame, counters)
            if number == 1:
                recorder.write_rest(tared, frame, counters)
    with records.RecordingFile(path) as file:
        sensors = [file.sensor for _ in file]
        assert (file.damaged, file.cut_bytes) == (0, 0)
    expected = tuple(0 if place in (6, 8) else place for place in range(12))
    assert sensors[:2] == [BOARD.sensor] * 2
    assert (sensors[2].baseline, sensors[2].masked) == (expected, tared.masked)
    with records.RecordingFile(path) as file:
        records.write_recording(tmp_path / "b.ftr", file)
    assert (tmp_path / "b.ftr").read_bytes() == path.read_bytes()
    assert records.read_recording(path).frames.tolist() == _frames(3).tolist()
