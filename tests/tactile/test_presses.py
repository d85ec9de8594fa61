"""Labelled frames in numpy archives."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from fuzzytree.errors import ReadError
from fuzzytree.tactile.presses import (
    Presses,
    presses_content,
    read_presses,
)
from fuzzytree.tactile.sensor import Sensor
from tests.tactile.archives import write_presses

FRAMES = np.arange(24, dtype=np.uint16).reshape(2, 3, 4)


def presses() -> Presses:
    label, subject = np.array([1, 0]), np.array([7, 9])
    return Presses(FRAMES, Sensor(3, 4, 1000, 5), label, ("hand", "bär"), subject)


def saved(path: Path, **arrays: object) -> Path:
    np.savez_compressed(path, **arrays)  # type: ignore[arg-type] # arrays of any kind
    return path


def test_what_was_written_reads_back_equal(tmp_path: Path) -> None:
    path = tmp_path / "presses.npz"
    write_presses(path, presses())
    found = read_presses(path)
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
    found = read_presses(saved(tmp_path / "n.npz", frames=frames, other=[0.5]))
    assert found.frames.tolist() == FRAMES.tolist()
    assert (found.sensor.full, found.label_names, len(found.label)) == (255, (), 0)


def test_classes_may_stand_under_another_name(tmp_path: Path) -> None:
    path = saved(
        tmp_path / "n.npz", frames=FRAMES, coarse=[0, 1], coarse_names=["a", "b"]
    )
    assert read_presses(path, label="coarse").label_names == ("a", "b")


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
            "'label' holds places in 'label_names', from 0 to 1, not 0 to 2",
        ),
        (
            {"frames": FRAMES, "label": [0], "label_names": ["a"]},
            "'label' must hold a whole number for each of 2 frames",
        ),
        (
            {"frames": FRAMES, "label_names": ["a", "a"]},
            "'label_names' must be different names, none empty",
        ),
        (
            {"frames": FRAMES, "full": 70000},
            "'full' must be a whole number from 1 to 65535",
        ),
        (
            {"frames": FRAMES, "full": 9, "threshold": 9},
            "'threshold' must be a whole number from 0 to 8",
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
        read_presses(path)
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
            read_presses(path)
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
        read_presses(path)
    assert str(caught.value) == f"{path}: unpacks to more than 1073741824 bytes"


@pytest.mark.parametrize("header", [b"(" * 3000, b"{'descr': '|O', 'shape': (1,)}"])
def test_a_hostile_header_is_refused(tmp_path: Path, header: bytes) -> None:
    path = tmp_path / "n.npz"
    size = len(header).to_bytes(2, "little")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("frames.npy", b"\x93NUMPY\1\0" + size + header)
    with pytest.raises(ReadError):
        read_presses(path)


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
        read_presses(path)
    assert str(caught.value) == f"{path}: is damaged: negative seek value -27"


def test_a_name_that_is_no_text_is_refused(tmp_path: Path) -> None:
    for sign in (0x110000, 0xD800):
        names = np.array([[97], [sign]], "<u4").view("<U1")[:, 0]
        path = saved(
            tmp_path / "n.npz", frames=np.zeros((2, 2, 2), int), label_names=names
        )
        with pytest.raises(ReadError) as caught:
            read_presses(path)
        assert str(caught.value) == f"{path}: 'label_names' holds signs that are none"
