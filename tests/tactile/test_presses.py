"""Labelled frames in numpy archives."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from fuzzytree.errors import ReadError
from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.link.recording import Recording
from fuzzytree.tactile.presses import (
    labelled,
    open_frames,
    presses_content,
    read_frames,
)
from fuzzytree.tactile.sensor import Sensor
from tests.tactile.archives import write_presses

FRAMES = np.arange(24, dtype=np.uint16).reshape(2, 3, 4)


def presses() -> Recording:
    label, subject = np.array([1, 0]), np.array([7, 9])
    return labelled(FRAMES, Sensor(3, 4, 1000, 5), label, ("hand", "bär"), subject)


def saved(path: Path, **arrays: object) -> Path:
    np.savez_compressed(path, **arrays)  # type: ignore[arg-type] # arrays of any kind
    return path


def test_what_was_written_reads_back_equal(tmp_path: Path) -> None:
    path = tmp_path / "presses.npz"
    write_presses(path, presses())
    found = read_frames(path)
    assert found.frames.dtype == np.uint16
    assert found.frames.tolist() == FRAMES.tolist()
    assert (found.sensor.full, found.sensor.threshold) == (1000, 5)
    assert found.label_names == ("hand", "bär")
    assert found.label.tolist() == [1, 0]
    assert found.subject.tolist() == [7, 9]


def test_the_same_frames_give_the_same_bytes() -> None:
    assert presses_content(presses()) == presses_content(presses())


def test_an_archive_of_numpy_itself_is_read(tmp_path: Path) -> None:
    frames = np.asfortranarray(FRAMES.astype(np.uint8))
    found = read_frames(saved(tmp_path / "n.npz", frames=frames, other=[0.5]))
    assert found.frames.tolist() == FRAMES.tolist()
    assert (found.sensor.full, found.label_names, len(found.label)) == (255, (), 0)


def test_classes_may_stand_under_another_name(tmp_path: Path) -> None:
    path = saved(
        tmp_path / "n.npz", frames=FRAMES, coarse=[0, 1], coarse_names=["a", "b"]
    )
    assert read_frames(path, label="coarse").label_names == ("a", "b")


@pytest.mark.parametrize(
    ("arrays", "text"),
    [
        ({"label": [0]}, "has no array 'frames'"),
        (
            {"frames": [[1, 2]]},
            "'frames' must hold whole numbers of shape (frames, rows, columns), "
            "not int64 of shape (1, 2)",
        ),
        ({"frames": [[[0.5]]]}, "'frames' holds float64, not whole numbers or text"),
        ({"frames": np.zeros((0, 2, 2), int)}, "holds no frame"),
        (
            {"frames": np.zeros((1, 2, 300), int)},
            "a frame has 1 to 256 rows and columns, not 2 x 300",
        ),
        (
            {"frames": FRAMES, "label": [0, 2], "label_names": ["a", "b"]},
            "'label' must hold places in 'label_names' from 0 to 1, 2 in all",
        ),
        (
            {"frames": FRAMES, "label": [0], "label_names": ["a"]},
            "'label' must hold places in 'label_names' from 0 to 0, 2 in all",
        ),
        (
            {"frames": FRAMES, "label_names": ["a", "a"]},
            "'label_names' must be different names, none empty",
        ),
        (
            {"frames": FRAMES, "full": 70000},
            "'full' must hold whole numbers from 1 to 65535, 1 in all",
        ),
        (
            {"frames": FRAMES, "full": 9, "threshold": 9},
            "'threshold' must hold whole numbers from 0 to 8, 1 in all",
        ),
        (
            {"frames": FRAMES, "times": [0.0, -1.0]},
            "'times' must hold seconds from 0 to 8589934592, 2 in all",
        ),
        (
            {"frames": FRAMES, "numbers": [0, -1]},
            "'numbers' must hold whole numbers from 0 to 9007199254740991, 2 in all",
        ),
        (
            {"frames": FRAMES, "subject": np.array([{}, {}])},
            "'subject' holds object, not whole numbers or text",
        ),
    ],
    ids=lambda value: "" if isinstance(value, dict) else value[:24],
)
def test_an_archive_that_does_not_fit_is_refused_in_a_sentence(
    tmp_path: Path, arrays: dict[str, object], text: str
) -> None:
    path = saved(tmp_path / "n.npz", **arrays)
    with pytest.raises(ReadError) as caught:
        read_frames(path)
    assert str(caught.value) == f"{path}: {text}"


def test_no_damage_is_answered_by_anything_but_a_read_error(tmp_path: Path) -> None:
    content = presses_content(presses())
    draw = np.random.default_rng(0)
    path = tmp_path / "n.npz"
    refused = 0
    for _ in range(120):
        damaged = bytearray(content)
        for place in draw.integers(0, len(content), draw.integers(1, 4)):
            damaged[place] = draw.integers(0, 256)
        path.write_bytes(damaged[: draw.integers(0, len(content) + 1)])
        try:
            read_frames(path)
        except ReadError:
            refused += 1
    assert refused > 90


def test_an_archive_that_unpacks_to_too_much_is_refused_unpacked(
    tmp_path: Path,
) -> None:
    path = tmp_path / "n.npz"
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("frames.npy", b"\0" * 10_000)
    content = bytearray(file.getvalue())
    place = content.rfind(b"PK\1\2")  # the directory, where the size is told
    content[place + 24 : place + 28] = (2**31).to_bytes(4, "little")
    path.write_bytes(content)
    with pytest.raises(ReadError) as caught:
        read_frames(path)
    assert str(caught.value) == f"{path}: unpacks to more than 1073741824 bytes"


@pytest.mark.parametrize(
    "header",
    [
        b"(" * 3000,
        b"{'descr': '|O', 'shape': (1,)}",
        b"{'descr': '|u1', 'fortran_order': False, 'shape': (True, 0, 2)}",
        b"{'descr': '<U0', 'fortran_order': False, 'shape': (1000000000,)}",
        b"{'descr': '|u1', 'fortran_order': False, 'shape': (%s,)}" % (b"9" * 3000),
    ],
    ids=len,
)
def test_a_hostile_header_is_refused(tmp_path: Path, header: bytes) -> None:
    path = tmp_path / "n.npz"
    size = len(header).to_bytes(2, "little")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("frames.npy", b"\x93NUMPY\1\0" + size + header)
    with pytest.raises(ReadError):
        read_frames(path)


def test_an_array_that_lies_before_the_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "n.npz"
    # The end tells of a directory that is longer than it is: places become negative.
    content = bytearray(presses_content(presses()))
    end = content.rfind(b"PK\5\6")
    size = int.from_bytes(content[end + 12 : end + 16], "little")
    start = int.from_bytes(content[end + 16 : end + 20], "little")
    content[end + 16 : end + 20] = (start + 27).to_bytes(4, "little")
    assert start + size == end
    path.write_bytes(content)
    with pytest.raises(ReadError) as caught:
        read_frames(path)
    assert str(caught.value) == f"{path}: is damaged: negative seek value -27"


def test_a_name_that_is_no_text_is_refused(tmp_path: Path) -> None:
    for sign in (0x110000, 0xD800):
        names = np.array([[97], [sign]], "<u4").view("<U1")[:, 0]
        path = saved(
            tmp_path / "n.npz", frames=np.zeros((2, 2, 2), int), label_names=names
        )
        with pytest.raises(ReadError) as caught:
            read_frames(path)
        assert str(caught.value) == f"{path}: 'label_names' holds signs that are none"


TEXT = ":3: column 'r0c0' holds text where a number is needed: "


def table(path: Path, text: str) -> Path:
    path.write_text(text, "utf-8")
    return path


@pytest.mark.parametrize(
    "text",
    [
        "time,number,r0c0,r0c1,r1c0,r1c1\n0.1,7,1,2,3,4\n0.2,9,5,6,7,300\n",
        '\ufeffr0c1, number,"r0c0",time,r1c1,r1c0\r\n2,7,1,0.1,4,3\r\n\r\n'
        "6,9,5,2e-1,300.0,7",
    ],
)
def test_a_table_is_read_by_its_names(tmp_path: Path, text: str) -> None:
    found = read_frames(table(tmp_path / "a.csv", text))
    assert found.frames.tolist() == [[[1, 2], [3, 4]], [[5, 6], [7, 300]]]
    assert (found.times.tolist(), found.numbers.tolist()) == ([0.1, 0.2], [7, 9])
    assert (found.sensor, found.is_stream) == (Sensor(2, 2, 65535), True)


def test_full_and_threshold_of_a_table_may_be_named(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", "r0c0\n1\n255\n")
    assert read_frames(path).sensor == Sensor(1, 1, 255)
    assert open_frames(path, full=1023, threshold=4).sensor == Sensor(1, 1, 1023, 4)


def test_a_table_is_read_in_blocks(tmp_path: Path) -> None:
    lines = [f"{place % 251},{place % 256}" for place in range(400_000)]
    text = "r0c0,r0c1\n" + "\n".join(lines) + "\n"
    found = read_frames(table(tmp_path / "a.csv", text)).frames
    assert len(text) > 2**21
    assert found[:, 0, 0].tolist() == [place % 251 for place in range(400_000)]
    wrong = table(tmp_path / "b.csv", text + "1,\n")
    with pytest.raises(ReadError) as caught:
        read_frames(wrong)
    whole = "r0c1: a missing cell is no whole number from 0 to 65535"
    assert str(caught.value) == f"{wrong}:400002: {whole}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", " is empty: it needs a line with column names"),
        ("r0c0", ": holds no frame"),
        ("time,number,r0c0\n", ": holds no frame"),
        (
            "r0c0\n1\ncup\n",
            ":3: column 'r0c0' holds text where a number is needed: 'cup'",
        ),
        (
            "r0c0\n1\n1_0\n",
            ":3: column 'r0c0' holds text where a number is needed: '1_0'",
        ),
        ("r0c0,r0c1\n1,2.5\n", ":2: r0c1: 2.5 is no whole number from 0 to 65535"),
        ("r0c0\n-1\n", ":2: r0c0: -1 is no whole number from 0 to 65535"),
        ("r0c0\n\n65536\n", ":3: r0c0: 65536 is no whole number from 0 to 65535"),
        (
            "time,r0c0\nnan,1\n",
            ":2: time: a missing cell is no number from 0 to 8589934592",
        ),
        (
            "number,r0c0\n9007199254740993,1\n",
            ":2: column 'number' holds 9007199254740993, which a double rounds",
        ),
        ("r0c0,r0c1\n1,2\n3\n", ":3: 1 cell, and line 1 names 2 columns"),
        ('r0c0\n"1\n', ":2: broken CSV: a quote is not closed"),
        ("time,number\n0,0\n", ": has no column of a cell such as r0c0"),
        (
            "r0c0,r0c1,r1c0\n1,2,3\n",
            ": has no column 'r1c1', and frames of 2 x 2 cells",
        ),
        ("r0c0,time,r0c0\n1,2,3\n", ": column 'r0c0' stands there more than once"),
        (
            "r0c0,cup\n1,2\n",
            ": the column 'cup' is neither time, number nor a cell such as r0c0",
        ),
        ("r256c0\n1\n", ": a frame has 1 to 256 rows and columns, not 257 x 1"),
    ],
    ids=lambda value: value[:32],
)
def test_a_table_that_does_not_fit_is_refused_in_a_sentence(
    tmp_path: Path, text: str, message: str
) -> None:
    path = table(tmp_path / "a.csv", text)
    with pytest.raises(ReadError) as caught:
        read_frames(path)
    assert str(caught.value) == f"{path}{message}"


def test_a_table_that_is_no_text_or_too_large_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"r0c0\n\xff\n")
    with pytest.raises(ReadError) as caught:
        read_frames(path)
    assert str(caught.value).startswith(f"{path}: is no UTF-8 text; save it as UTF-8")
    with path.open("wb") as file:
        file.truncate(2**30 + 1)
    with pytest.raises(ReadError) as caught:
        read_frames(path)
    text = "is larger than 1073741824 bytes, too large to read"
    assert str(caught.value) == f"{path}: {text}"


def test_an_archive_opens_as_frames_of_a_plain_board(tmp_path: Path) -> None:
    with open_frames(saved(tmp_path / "a.npz", frames=FRAMES, full=1000)) as found:
        board = Board("frames", Sensor(3, 4, 1000), Marker("AA 55", bits=16))
        assert isinstance(found, Recording)
        assert found.board == board
        assert [frame.time for frame, _ in found] == [0.0, 1 / 44]
        assert [frame.number for frame, _ in found] == [0, 1]
        assert [counters.frames for _, counters in found] == [1, 2]
        assert found.frames.tolist() == FRAMES.tolist()


def test_frames_that_do_not_fit_the_board_are_refused(tmp_path: Path) -> None:
    board = Board("mat", Sensor(3, 4), Marker("AA 55"))
    path = saved(tmp_path / "a.npz", frames=FRAMES + 240)
    with pytest.raises(ReadError) as caught:
        open_frames(path, board)
    wrong = "r1c0 of frame 1 is 256, and no whole number from 0 to 255"
    assert str(caught.value) == f"{path}: {wrong}"
    path = table(tmp_path / "a.csv", "time,r0c0\n0,255\n0,256\n")
    with pytest.raises(ReadError) as caught:
        open_frames(path, Board("mat", Sensor(1, 1, 200), Marker("AA 55")))
    wrong = "r0c0: 256 is no whole number from 0 to 255"
    assert str(caught.value) == f"{path}:3: {wrong}"
