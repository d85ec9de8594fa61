"""Frames as files of other programs: tables, arrays and pictures."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from array import array
from collections.abc import Callable, Generator, Iterator, Mapping
from itertools import islice
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.errors import MissingExtraError, ReadError, WriteError, install_hint
from fuzzytree.files import PathLike, open_atomically, write_atomically
from fuzzytree.tactile.board_file import board_text
from fuzzytree.tactile.link.recording import FrameFile, write_recording
from fuzzytree.tactile.plots import draw_frames
from fuzzytree.tactile.presses import presses_content
from fuzzytree.tactile.report.live import PALETTE, shades
from fuzzytree.tactile.rest import Rest
from fuzzytree.tactile.sensor import FRAMES_A_SECOND, Sensor, pressed

if TYPE_CHECKING:
    import numpy.typing as npt

_BLOCK = 2**20  # bytes of cells that are written at once
_LONGEST_SIDE = 512  # points, about
_MOST_TIMES = 64  # points of a cell on a side: sums of 16 bits are exact
_GIF_TICKS, _LEAST_GIF_TICKS = 100, 2  # a second; browsers slow shorter ones down
_MOST_TICKS = 2**16 - 1
_LEAST_RATE, _MOST_RATE = 1.0, 60.0  # frames of a video a second


def write_table(path: PathLike, file: FrameFile) -> None:
    """Write a line for each frame: its time, its number, and its cells."""
    sensor = file.board.sensor
    names = [f"r{r}c{c}" for r in range(sensor.rows) for c in range(sensor.columns)]
    with open_atomically(path) as table:
        table.write(",".join(["time", "number", *names]).encode() + b"\n")
        for frame, _counters in file:
            cells = ",".join(map(str, frame.cells.reshape(-1).tolist()))
            table.write(f"{frame.time!r},{frame.number},{cells}\n".encode())


def write_arrays(path: PathLike, file: FrameFile) -> None:
    """Write a numpy archive that the other actions read."""
    write_atomically(path, presses_content(file.whole()))


def write_board(path: PathLike, file: FrameFile) -> None:
    """Write the board, with what was measured, as its file."""
    write_atomically(path, board_text(file.board).encode())


def write_hdf5(path: PathLike, file: FrameFile) -> None:
    """Write frames, times and numbers as HDF5, and the board as its attributes.

    Raises:
        MissingExtraError: If h5py is not installed.
    """
    try:
        import h5py
    except ImportError as error:
        raise MissingExtraError(f"HDF5 needs {install_hint('hdf5')}") from error
    board, sensor = file.board, file.board.sensor
    shape, kind = (sensor.rows, sensor.columns), sensor.dtype
    step = max(_BLOCK // (sensor.rows * sensor.columns * kind.itemsize), 1)
    times, numbers = array("d"), array("q")
    # Of the format of 2008, the oldest whose attributes may be larger than 64 KiB.
    with (
        _copied(path, "frames.h5") as part,
        h5py.File(part, "w", libver=("v108", "v108")) as root,
    ):
        frames = root.create_dataset(
            "frames",
            (0, *shape),
            kind,
            maxshape=(None, *shape),
            chunks=(step, *shape),
            compression="gzip",
            shuffle=True,
        )
        records = iter(file)
        while block := [record.frame for record in islice(records, step)]:
            frames.resize(len(times) + len(block), axis=0)
            frames[len(times) :] = np.array([frame.cells for frame in block])
            times.extend(frame.time for frame in block)
            numbers.extend(frame.number for frame in block)
        root["times"], root["numbers"] = np.array(times), np.array(numbers)
        root.attrs["full"], root.attrs["threshold"] = sensor.full, sensor.threshold
        root.attrs["board"] = board_text(board)
        if sensor.baseline:
            root.attrs["baseline"] = np.array(sensor.baseline, kind).reshape(shape)
        if sensor.masked:
            root.attrs["masked"] = np.array(sensor.masked, np.uint8)


def write_picture(path: PathLike, file: FrameFile, number: int | None = None) -> None:
    """Write what presses in a frame as SVG or PNG, also interpolated.

    Args:
        path: The picture; its name ends in .svg or .png.
        file: The frames.
        number: Of the frame, from 0; the first in which something presses if None.

    Raises:
        MissingExtraError: If a PNG is wanted and the extra is not installed.
        WriteError: If there is no such frame.
    """
    shown = None
    for place, (frame, _counters) in islice(enumerate(file), number or 0, None):
        rest = Rest(file.sensor, 0.0, file.board.calibration)
        shown = place, rest.bare, rest(frame.cells, frame.time)
        if number is not None or shown[2].any():
            break
    if shown is None:
        raise WriteError(f"{path}: cannot be written: there is no frame")
    place, sensor, cells = shown
    title = f"{Path(path).stem}, frame {place}"
    draw_frames(sensor, cells[np.newaxis], [title]).save(path)


def write_gif(path: PathLike, file: FrameFile) -> None:
    """Write what presses as a GIF, as fast as it was recorded.

    Raises:
        MissingExtraError: If Pillow is not installed.
        WriteError: If there is no frame.
    """
    try:
        from PIL import GifImagePlugin, Image
    except ImportError as error:
        raise MissingExtraError(f"a GIF needs {install_hint('video')}") from error
    colours = [part for colour in PALETTE for part in colour]
    with open_atomically(path) as output:
        is_begun = False
        for points, ticks in _pictures(path, file, _GIF_TICKS, _LEAST_GIF_TICKS):
            image = Image.fromarray(points)
            image.putpalette(colours)
            if not is_begun:
                parts, _ = GifImagePlugin.getheader(image, info={"loop": 0})
                output.writelines(parts)
                is_begun = True
            duration_ms = 1000 // _GIF_TICKS * ticks
            output.writelines(GifImagePlugin.getdata(image, duration=duration_ms))
        output.write(b";")


def write_mp4(path: PathLike, file: FrameFile) -> None:
    """Write what presses as a video (H.264), as fast as it was recorded.

    Raises:
        MissingExtraError: If imageio-ffmpeg is not installed.
        WriteError: If there is no frame, or the encoder fails.
    """
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError) as error:
        raise MissingExtraError(f"an MP4 needs {install_hint('video')}") from error
    sensor, rate = file.board.sensor, _rate(file)
    times, written = _times(sensor), 0
    colours = np.array(PALETTE, np.uint8)
    with _copied(path, "frames.mp4") as part:
        video = imageio_ffmpeg.write_frames(
            str(part),
            (times * sensor.columns, times * sensor.rows),
            fps=rate,  # pyright: ignore[reportArgumentType] # it prints two decimals
            quality=8,
            codec="libx264",
            macro_block_size=1,
            ffmpeg_log_level="quiet",
            output_params=["-fflags", "+bitexact"],
        )
        try:
            with contextlib.closing(video):
                for points, ticks in _pictures(path, file, rate, 1):
                    if not written:
                        video.send(None)  # which starts the encoder
                    picture = colours[points]
                    for _ in range(ticks):
                        video.send(picture)
                    written += ticks
            kept, _seconds = imageio_ffmpeg.count_frames_and_secs(str(part))
            if kept != written:
                raise RuntimeError(f"{kept} of {written} frames are there")
        except (ReadError, WriteError):
            raise
        except (OSError, RuntimeError) as error:  # their texts are logs of many lines
            raise WriteError(f"{path}: cannot be written: ffmpeg failed") from error


def _pictures(
    path: PathLike, file: FrameFile, rate: float, least: int
) -> Iterator[tuple[npt.NDArray[np.uint8], int]]:
    """Yield what presses as shades, and for how many ticks, so many a second.

    The ticks add up to the recorded times. A frame that would follow another one by
    less than the least number of ticks is left out.

    Raises:
        WriteError: If there is no frame.
    """
    sensor, times = file.board.sensor, _times(file.board.sensor)
    shown, begin, at, ticks = None, 0.0, 0, least
    for frame, _counters in file:
        if shown is None:
            begin = frame.time
        else:
            now = round((frame.time - begin) * rate)
            if now - at < least:
                continue
            at, ticks = now, min(now - at, _MOST_TICKS)
            yield shades(shown, sensor.full, times), ticks
        shown = pressed(file.sensor, frame.cells)[0]
    if shown is None:
        raise WriteError(f"{path}: cannot be written: there is no frame")
    yield shades(shown, sensor.full, times), ticks


def _times(sensor: Sensor) -> int:
    """Return how many points a cell has on a side: an even number, for the encoder."""
    fits = _LONGEST_SIDE // max(sensor.rows, sensor.columns)
    return min(fits, _MOST_TIMES) // 2 * 2


def _rate(file: FrameFile) -> float:
    """Return how many frames came a second, without the pauses."""
    times = np.fromiter((frame.time for frame, _counters in file), np.float64)
    steps = np.diff(times).clip(0.0)
    usual = 1.0 / FRAMES_A_SECOND
    if len(steps):
        usual = float(steps[steps <= 2.0 * np.quantile(steps, 0.9)].mean())
    rate = 1.0 / max(usual, 1.0 / _MOST_RATE)
    return round(max(rate, _LEAST_RATE), 2)  # as precise as the encoder takes it


@contextlib.contextmanager
def _copied(path: PathLike, name: str) -> Generator[Path]:
    """Give a place for a library to write to; what is there then becomes the file."""
    with open_atomically(path) as output, tempfile.TemporaryDirectory() as folder:
        part = Path(folder, name)
        yield part
        with part.open("rb") as content:
            shutil.copyfileobj(content, output)


WRITERS: Mapping[str, Callable[..., None]] = MappingProxyType(
    {
        ".ftr": write_recording,
        ".csv": write_table,
        ".npz": write_arrays,
        ".h5": write_hdf5,
        ".svg": write_picture,
        ".png": write_picture,
        ".gif": write_gif,
        ".mp4": write_mp4,
        ".yaml": write_board,
    }
)
"""What writes a path and frames, by the end of its name."""
