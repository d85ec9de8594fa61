"""Whole files, read within bounds and written so that the old file survives."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import stat
import sys
from collections.abc import Generator, Iterable
from pathlib import Path
from typing import BinaryIO

from fuzzytree.errors import FuzzyTreeError, ReadError, WriteError

LIMIT = 256 * 2**20
"""The most bytes that a model file may have by default."""

_PART = re.compile(r"[0-9a-f]{16}\.part")

PathLike = str | os.PathLike[str]


def check_stream(path: PathLike) -> None:
    """Refuse what is no file and no pipe: a device may never end.

    Raises:
        OSError: If it is a folder, a device or a socket, or is not there.
    """
    mode = Path(path).stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(None, "is a directory")
    if not (stat.S_ISREG(mode) or stat.S_ISFIFO(mode)):
        raise OSError(None, "it is neither a file nor a pipe")


def read_bounded(path: PathLike, limit: int = LIMIT, magic: bytes = b"") -> bytes:
    """Return the content of a file, unless it is larger than the limit.

    Args:
        path: The file.
        limit: In bytes.
        magic: How the file should begin: of another one no more than that is read.

    Raises:
        ReadError: If the file is not there, cannot be read or is too large.
    """
    name = os.fspath(path)
    try:
        check_stream(path)
        with Path(path).open("rb") as file:
            size = os.fstat(file.fileno()).st_size  # 0 of a pipe
            content = file.read(len(magic))
            if content == magic and size <= limit:
                content += file.read(limit + 1 - len(magic))
    except (OSError, ValueError) as error:
        raise ReadError(f"{name}: cannot be read: {reason(error)}") from error
    if content.startswith(magic) and max(len(content), size) > limit:
        raise ReadError(f"{name}: is larger than {limit} bytes, too large to be read")
    return content


def write_atomically(path: PathLike, content: bytes, *, replace: bool = True) -> None:
    """Write a file whole, or leave what stood there as it was.

    The content goes to a new file in the same folder, which is made if it is missing,
    is flushed to the disk and then takes the old file's place and mode. A link is
    followed: its target is replaced. A device or a pipe is written to directly.

    Args:
        path: The file.
        content: All of it.
        replace: Whether a file may be there; without it, the second of two writers
            fails, even if both write at the same time.

    Raises:
        WriteError: If it cannot be written; nothing is left behind.
    """
    with open_atomically(path, replace=replace) as file:
        file.write(content)


def check_place(path: PathLike) -> None:
    """Refuse a place where no file can be, before long work is done for it.

    Raises:
        WriteError: If a file cannot be written there, as far as can be checked before.
    """
    name, target = os.fspath(path), Path(path)
    if target.is_dir():
        raise WriteError(f"{name}: cannot be written: it is a folder")
    needed = [target] if target.exists() else []
    if target.is_file() or not needed:  # a new file takes the old one's place
        needed.append(_nearest_folder(path))
    if not all(os.access(place, os.W_OK) for place in needed):
        raise WriteError(f"{name}: cannot be written: it is write-protected")


def check_places(written: Iterable[PathLike], read: Iterable[PathLike] = ()) -> None:
    """Refuse places as `check_place`, and those that would end what is still needed.

    Raises:
        WriteError: If one cannot be written, is read as well, or stands twice.
    """
    taken = {_identity(path): "it is read as well" for path in read}
    for path in written:
        check_place(path)
        key, name = _identity(path), os.fspath(path)
        if key in taken and (Path(path).is_file() or not Path(path).exists()):
            raise WriteError(f"{name}: cannot be written: {taken[key]}")
        taken[key] = "another output goes there"


def _identity(path: PathLike) -> object:
    """Return what two names of one file share, links among them."""
    try:
        found = Path(path).stat()
    except (OSError, ValueError):
        return os.path.realpath(path)
    return found.st_dev, found.st_ino


@contextlib.contextmanager
def open_atomically(path: PathLike, *, replace: bool = True) -> Generator[BinaryIO]:
    """Open a file that appears under its name only when the block has ended well.

    Raises:
        WriteError: If it cannot be written; nothing is left behind.
    """
    name = os.fspath(path)
    try:
        # Of the path itself: /dev/stdout leads to a pipe that has no name.
        mode = _mode(Path(path))
        target = Path(os.path.realpath(path))
        if mode is None:
            _nearest_folder(path)
        elif not replace:
            raise FileExistsError
        if mode is None or stat.S_ISREG(mode):
            with _appearing(target, mode, replace=replace) as file:
                yield file
        elif stat.S_ISDIR(mode):
            raise IsADirectoryError(None, "it is a folder")
        else:
            with Path(path).open("wb") as device:
                yield device
    except FuzzyTreeError:
        raise
    except FileExistsError as error:
        raise WriteError(f"{name}: is there already") from error
    except OSError as error:
        raise WriteError(f"{name}: cannot be written: {reason(error)}") from error


@contextlib.contextmanager
def _appearing(target: Path, mode: int | None, *, replace: bool) -> Generator[BinaryIO]:
    if mode is not None and not os.access(target, os.W_OK):
        raise PermissionError(None, "it is write-protected")
    _remove_leftovers(target)
    new_folders = [folder for folder in target.parents if not folder.exists()]
    part = f"{_part_prefix(target)}{secrets.token_hex(8)}.part"
    temporary = target.with_name(part)
    try:  # from here on: a Ctrl-C may come as soon as the file is there
        target.parent.mkdir(parents=True, exist_ok=True)
        with _new_part(temporary) as file:
            if mode is not None:
                temporary.chmod(stat.S_IMODE(mode))
            yield file
            file.flush()
            os.fsync(file.fileno())
        if replace:
            temporary.replace(target)
        else:
            _name_anew(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # another process writes there as well
            for folder in new_folders:
                folder.rmdir()
        raise


def _new_part(temporary: Path) -> BinaryIO:
    """Open a new file, locked for as long as it is open."""
    while True:
        # Created with 0o666, so that the kernel applies the user's mask.
        handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        with contextlib.suppress(OSError):  # a file system without locks
            _lock(handle)
        if os.fstat(handle).st_nlink or os.name == "nt":
            return os.fdopen(handle, "wb")
        os.close(handle)  # another process took it for a leftover before the lock


def _remove_leftovers(target: Path) -> None:
    """Remove what processes that were killed have left of the same file."""
    with contextlib.suppress(OSError):
        for path in target.parent.iterdir():
            prefix, end = path.name[:-21], path.name[-21:]
            if prefix != _part_prefix(target) or not _PART.fullmatch(end):
                continue
            with contextlib.suppress(OSError), path.open("r+b") as file:
                _lock(file.fileno(), waits=False)
                path.unlink()


def _part_prefix(target: Path) -> str:
    return f".{target.name[:80]}."


def _lock(handle: int, *, waits: bool = True) -> None:
    """Lock an open file against other processes, until it is closed.

    Raises:
        OSError: If it cannot be locked, or another process has locked it.
    """
    if sys.platform != "win32":  # where an open file cannot be removed
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | (0 if waits else fcntl.LOCK_NB))


def _nearest_folder(path: PathLike) -> Path:
    """Return the folder of a file, or the nearest one above that is there.

    Raises:
        WriteError: If a file stands where a folder is needed.
    """
    target = Path(os.path.realpath(path) if Path(path).is_symlink() else path)
    folder = next(folder for folder in target.parents if os.path.lexists(folder))
    if not folder.is_dir():
        raise WriteError(
            f"{os.fspath(path)}: cannot be written: {os.fspath(folder)!r} is not a "
            "folder"
        )
    return folder


def _name_anew(temporary: Path, target: Path) -> None:
    """Give a file its name, unless another one has it.

    Raises:
        FileExistsError: If another one has it, whenever it came.
    """
    if os.name == "nt":
        temporary.rename(target)  # which there refuses a name that is taken
        return
    try:
        target.hardlink_to(temporary)
    except FileExistsError:
        raise
    except OSError:  # a file system without links, as a memory card's
        os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        temporary.replace(target)
    else:
        temporary.unlink()


def _mode(path: Path) -> int | None:
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None
    except ValueError as error:  # a name that no file can have
        raise OSError(None, str(error)) from error


def reason(error: OSError | ValueError) -> str:
    """Return why a file could not be used, without the path and the error number."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return text[0].lower() + text[1:]
