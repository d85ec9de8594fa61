"""Files are read within bounds, and the old file survives a failed writing."""

from __future__ import annotations

import contextlib
import os
import stat
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

import fuzzytree as ft
from fuzzytree.errors import ReadError, WriteError
from fuzzytree.files import (
    check_place,
    check_places,
    open_atomically,
    read_bounded,
    write_atomically,
)
from fuzzytree.learning.parts import Learner
from fuzzytree.tactile.presses import read_frames


def test_a_file_is_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "grip.yaml"
    path.write_bytes(b"12345")
    assert read_bounded(path, 5) == b"12345"


def test_a_file_larger_than_the_limit_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "grip.yaml"
    path.write_bytes(b"12345")
    with pytest.raises(ReadError) as caught:
        read_bounded(path, 4)
    assert str(caught.value) == f"{path}: is larger than 4 bytes, too large to be read"


def peak_of_reading(read: Callable[[], object]) -> tuple[int, str]:
    """Return the most bytes that a refused reading holds, and the refusal."""
    tracemalloc.start()
    try:
        with pytest.raises(ReadError) as caught:
            read()
        return tracemalloc.get_traced_memory()[1], str(caught.value)
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("name", "begin", "size", "fault"),
    [
        (
            "s.state",
            b"",
            4,
            "is no state that `fuzzytree collect` wrote, or is cut short",
        ),
        (
            "s.state",
            b"ARROW1",
            20,
            "is larger than 8589934592 bytes, too large to be read",
        ),
        ("a.npz", b"", 1, "is no numpy archive (.npz): File is not a zip file"),
        ("a.npz", b"PK", 20, "is larger than 1073741824 bytes, too large to be read"),
        ("m.yaml", b"", 20, "is larger than 268435456 bytes, too large to be read"),
    ],
)
def test_a_huge_file_is_refused_by_its_size_or_its_beginning(
    tmp_path: Path, name: str, begin: bytes, size: int, fault: str
) -> None:
    readers: dict[str, Callable[[Path], object]]
    readers = {"s": Learner.load, "a": read_frames, "m": ft.load}
    read = readers[name[0]]
    path = tmp_path / name
    with path.open("wb") as file:
        file.write(begin)
        file.truncate(size * 2**30)  # a hole, which takes no place on the disk
    with contextlib.suppress(ReadError):
        read(tmp_path / f"absent{path.suffix}")  # so that what it imports is there
    peak, text = peak_of_reading(lambda: read(path))
    assert text == f"{path}: {fault}"
    assert peak < 2**24  # what is imported as well


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("absent.yaml", "no such file or directory"),
        ("folder", "is a directory"),
        ("nul\0", "embedded null byte"),
    ],
)
def test_a_file_that_cannot_be_read_says_why(
    tmp_path: Path, name: str, why: str
) -> None:
    (tmp_path / "folder").mkdir()
    path = str(tmp_path / name)
    with pytest.raises(ReadError) as caught:
        read_bounded(path)
    assert str(caught.value) == f"{path}: cannot be read: {why}"


def test_writing_replaces_the_content_and_keeps_the_mode(tmp_path: Path) -> None:
    path = tmp_path / "grip.yaml"
    path.write_bytes(b"old")
    path.chmod(0o640)
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert _names(tmp_path) == ["grip.yaml"]


def test_a_new_file_obeys_the_users_mask(tmp_path: Path) -> None:
    path = tmp_path / "grip.yaml"
    before = os.umask(0o027)
    try:
        write_atomically(path, b"new")
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_link_stays_a_link_and_its_target_is_replaced(tmp_path: Path) -> None:
    target = tmp_path / "real" / "grip.yaml"
    target.parent.mkdir()
    target.write_bytes(b"old")
    link = tmp_path / "link.yaml"
    link.symlink_to(target)
    write_atomically(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"


def test_a_full_disk_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "grip.yaml"
    path.write_bytes(b"old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(WriteError) as caught:
        write_atomically(path, b"new")
    assert str(caught.value) == f"{path}: cannot be written: no space left on device"
    assert path.read_bytes() == b"old"
    assert _names(tmp_path) == ["grip.yaml"]


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="no /proc")
def test_a_pipe_without_a_name_is_written_to() -> None:
    reading, writing = os.pipe()
    write_atomically(f"/proc/self/fd/{writing}", b"model")
    os.close(writing)
    with os.fdopen(reading, "rb") as file:
        assert file.read() == b"model"


def test_a_full_device_is_reported() -> None:
    with pytest.raises(WriteError) as caught:
        write_atomically("/dev/full", b"new")
    assert str(caught.value) == "/dev/full: cannot be written: no space left on device"


def test_a_read_only_folder_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "grip.yaml"
    path.write_bytes(b"old")

    def refuse(*_: object) -> int:
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(WriteError) as caught:
        write_atomically(path, b"new")
    assert str(caught.value) == f"{path}: cannot be written: read-only file system"
    assert path.read_bytes() == b"old"


def test_a_write_protected_file_is_not_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "grip.yaml"
    path.write_bytes(b"old")
    path.chmod(0o444)
    if os.access(path, os.W_OK):  # the superuser may write everything
        monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(WriteError) as caught:
        write_atomically(path, b"new")
    assert str(caught.value) == f"{path}: cannot be written: it is write-protected"
    assert path.read_bytes() == b"old"


def test_a_folder_is_no_place_to_write_to(tmp_path: Path) -> None:
    with pytest.raises(WriteError) as caught:
        write_atomically(tmp_path, b"new")
    assert str(caught.value) == f"{tmp_path}: cannot be written: it is a folder"


def test_a_folder_is_refused_beforehand(tmp_path: Path) -> None:
    with pytest.raises(WriteError) as caught:
        check_place(tmp_path)
    assert str(caught.value) == f"{tmp_path}: cannot be written: it is a folder"
    check_place(tmp_path / "possible.yaml")


@pytest.mark.parametrize("name", ["old.yaml", "folder/new.yaml"])
def test_a_write_protected_place_is_refused_beforehand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    (tmp_path / "folder").mkdir(mode=0o555)
    (tmp_path / "old.yaml").touch(mode=0o444)
    path = tmp_path / name
    if os.access(tmp_path / "folder", os.W_OK):  # the superuser may write everything
        monkeypatch.setattr(os, "access", lambda one, _: one not in (path, path.parent))
    with pytest.raises(WriteError) as caught:
        check_place(path)
    assert str(caught.value) == f"{path}: cannot be written: it is write-protected"


def test_what_is_read_and_what_is_written_stay_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("in.yaml").touch()
    Path("link.json").symlink_to("in.yaml")
    check_places(["a.json", "b.html", "/dev/null", "/dev/null"], ["in.yaml"])
    for written, why in (
        (["a.json", "link.json"], "link.json: cannot be written: it is read as well"),
        (["a", "./a"], "./a: cannot be written: another output goes there"),
    ):
        with pytest.raises(WriteError) as caught:
            check_places(written, ["in.yaml"])
        assert str(caught.value) == why


def test_an_interrupted_writer_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    path.write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt):
        _interrupted(path)
    assert path.read_bytes() == b"old"
    assert _names(tmp_path) == ["out.csv"]


def test_a_file_that_is_there_is_not_replaced_by_who_may_not(tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    write_atomically(path, b"first", replace=False)
    with pytest.raises(WriteError) as caught:
        write_atomically(path, b"second", replace=False)
    assert str(caught.value) == f"{path}: is there already"
    assert (path.read_bytes(), path.stat().st_nlink) == (b"first", 1)
    assert _names(tmp_path) == ["out.csv"]


@pytest.mark.parametrize("links", [True, False])
def test_a_file_that_comes_meanwhile_is_not_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    path = tmp_path / "out.csv"
    if not links:  # as on a memory card
        monkeypatch.setattr(Path, "hardlink_to", _no_links)
    with pytest.raises(WriteError, match="is there already"):
        _overtaken(path)
    assert path.read_bytes() == b"first"
    path.unlink()
    write_atomically(path, b"third", replace=False)
    assert path.read_bytes() == b"third"
    assert _names(tmp_path) == ["out.csv"]


def test_a_name_that_no_file_can_have_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "nul\0"
    with pytest.raises(WriteError) as caught:
        write_atomically(path, b"new")
    assert str(caught.value) == f"{path}: cannot be written: embedded null byte"


def test_an_error_of_the_block_itself_is_not_renamed(tmp_path: Path) -> None:
    with (
        pytest.raises(ReadError, match="the table"),
        open_atomically(tmp_path / "out.csv"),
    ):
        raise ReadError("the table")
    assert _names(tmp_path) == []


def _no_links(path: Path, _: Path) -> None:
    raise PermissionError(path)


def _overtaken(path: Path) -> None:
    with open_atomically(path, replace=False) as file:
        file.write(b"second")
        path.write_bytes(b"first")


def _interrupted(path: Path) -> None:
    with open_atomically(path) as file:
        file.write(b"half")
        raise KeyboardInterrupt


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_what_a_killed_writer_left_is_removed_by_the_next_one(tmp_path: Path) -> None:
    path = tmp_path / "grip.yaml"
    code = (
        "import os, signal\n"
        "from fuzzytree.files import open_atomically\n"
        f"with open_atomically({os.fspath(path)!r}) as file:\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    for _ in range(2):
        subprocess.run([sys.executable, "-c", code], check=False)
        assert [name[-5:] for name in _names(tmp_path)] == [".part"]
    other = tmp_path / ".notes.yaml.0123456789abcdef.part"
    other.touch()
    write_atomically(path, b"new")
    assert _names(tmp_path) == [other.name, "grip.yaml"]


def test_two_writers_of_one_file_do_not_disturb_each_other(tmp_path: Path) -> None:
    path = tmp_path / "grip.yaml"
    with open_atomically(path) as file:
        file.write(b"slow")
        write_atomically(path, b"quick")
        assert path.read_bytes() == b"quick"
    assert path.read_bytes() == b"slow"
    assert _names(tmp_path) == ["grip.yaml"]


def test_a_writer_makes_the_folder_of_its_file(tmp_path: Path) -> None:
    path = tmp_path / "new folder" / "more" / "grip.yaml"
    check_place(path)
    assert _names(tmp_path) == []
    write_atomically(path, b"new", replace=False)
    assert path.read_bytes() == b"new"
    link = tmp_path / "link.yaml"
    link.symlink_to(tmp_path / "elsewhere" / "grip.yaml")
    check_place(link)
    write_atomically(link, b"new")
    assert (tmp_path / "elsewhere" / "grip.yaml").read_bytes() == b"new"


def test_an_interrupted_writer_leaves_no_new_folder(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        _interrupted(tmp_path / "new" / "more" / "out.csv")
    assert _names(tmp_path) == []


@pytest.mark.parametrize("name", ["few.csv/grip.yaml", "few.csv/more/grip.yaml"])
def test_a_file_where_a_folder_is_needed_is_named(tmp_path: Path, name: str) -> None:
    (tmp_path / "few.csv").touch()
    path = tmp_path / name
    text = f"{path}: cannot be written: '{tmp_path / 'few.csv'}' is not a folder"
    with pytest.raises(WriteError) as caught:
        check_place(path)
    assert str(caught.value) == text
    with pytest.raises(WriteError) as caught:
        write_atomically(path, b"new")
    assert str(caught.value) == text


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="there is no such device")
def test_a_device_is_not_read() -> None:
    with pytest.raises(ReadError) as caught:
        read_bounded("/dev/zero")
    assert str(caught.value) == (
        "/dev/zero: cannot be read: it is neither a file nor a pipe"
    )
