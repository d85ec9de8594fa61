"""A sensor as a stream of answers: from a port or a recording."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fuzzytree.tactile.board_file import load_board
from fuzzytree.tactile.boards import Board
from fuzzytree.tactile.link import Connection, open_connection, room, start
from fuzzytree.tactile.link.recording import Recorder
from fuzzytree.tactile.presses import open_frames
from fuzzytree.tactile.recognition.frame_sources import Recorded, Replayed
from fuzzytree.tactile.recognition.live import Live, LiveResult
from fuzzytree.tactile.recognition.objects import LEAST_AREA
from fuzzytree.tactile.recognition.recogniser import frames_model, usual_floor

if TYPE_CHECKING:
    from fuzzytree.files import PathLike
    from fuzzytree.model import Model
    from fuzzytree.tactile.sensor import Counters, Frame, Sensor

MOST_WAITING: Final = 4
"""Frames that wait for an answer before older ones are dropped: the newest count."""

_PATIENCE_S = 2.0  # for a first frame


class TactileSensor(contextlib.AbstractContextManager["TactileSensor"]):
    """A sensor and a model: iterating gives what each frame shows, as it comes.

    `fuzzytree.tactile.open` makes one. It must be closed: it is a context manager.

    Attributes:
        live: Recognition, which displays can look at.
        board: What the frames come from, as measured.
        remarks: What is odd about the sensor at rest, in sentences.
        recorded: The recording; None without one.
    """

    def __init__(
        self,
        live: Live,
        board: Board,
        remarks: list[str],
        recorded: Recorded | None,
        closing: contextlib.ExitStack,
    ) -> None:
        self.live, self.board, self.remarks = live, board, remarks
        self.recorded, self._closing = recorded, closing

    def __iter__(self) -> Iterator[LiveResult]:
        """Give what each frame shows, until no more come.

        Raises:
            PortError: If the port cannot be used any more.
        """
        return self.live.answers()

    @property
    def classes(self) -> tuple[str, ...]:
        """The names of the classes, in the order of strengths and probabilities."""
        return self.live.recogniser.model.classes

    @property
    def sensor(self) -> Sensor:
        """The sensor with its baseline and masked cells as of now."""
        return self.live.rest.sensor

    @property
    def counters(self) -> Counters:
        """What came in, and what was wrong with it."""
        return self.live.source.counters

    def tare(self) -> None:
        """Take what the next 10 frames read for the baseline; from any thread."""
        self.live.tare()

    def close(self) -> None:
        """Release the port, and end the recording."""
        self._closing.close()

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()


def open(
    source: str,
    *,
    model: Model | PathLike,
    board: Board | PathLike | None = None,
    reject: float | None = None,
    vote_s: float = 0.0,
    least_area: int = LEAST_AREA,
    record: PathLike | None = None,
    speed: float = 1.0,
    say: Callable[[str, str], None] | None = None,
) -> TactileSensor:
    """Open a sensor: iterating gives what each frame shows, as it comes.

    Each frame has its `time` in seconds, its `cells` (what presses on each, whole
    numbers of shape (rows, columns), without the baseline) and its `objects`, the
    largest force first, each with `label`, `strengths`, `probabilities`, `box`, `x`
    and `y`. `tare()` takes what the cells read next for their baseline.

    Args:
        source: A serial port, a recording, or an archive (.npz) or a table (.csv) of
            frames.
        model: A tree or a rule base whose inputs are names of features, or its file.
        board: What is connected to the port, or sent the frames of an archive or a
            table, or its file; none for a recording.
        reject: The strength below which an object is unknown; the usual one if None.
        vote_s: How many seconds the answers to an object vote; 0 for each frame's own.
        least_area: The fewest cells of an object.
        record: A recording to write every frame to.
        speed: Of frames that are recorded; 0 for no pauses.
        say: Called with a word and a sentence on what is waited for.

    Returns:
        The sensor. It must be closed: it is a context manager.

    Raises:
        ValueError: If source and board do not go together, or a number is out of
            range.
        TableError: If the model's inputs are no features of frames.
        PortError: If the port cannot be used, or frames stop before the baseline is
            measured.
        ReadError: If a file is none of its kind.
        WriteError: If the recording cannot be made.

    Example:
        >>> import tempfile
        >>> import numpy as np
        >>> import fuzzytree as ft
        >>> areas = np.array([[12.0], [18.0], [60.0], [70.0]])
        >>> tree = ft.learn(
        ...     ft.table(areas, columns=["area"]), target=["bar", "bar", "hand", "hand"]
        ... )
        >>> cells = np.zeros((1, 4, 6), np.uint8)
        >>> cells[:, 1:, 2:] = 99
        >>> path = tempfile.mkdtemp() + "/bar.npz"
        >>> np.savez(path, frames=cells)
        >>> with ft.tactile.open(path, model=tree) as sensor:
        ...     frame = next(iter(sensor))
        >>> frame.cells.shape, [thing.label for thing in frame.objects]
        ((4, 6), ['bar'])
    """
    model = frames_model(model)
    is_recorded = record is not None
    with contextlib.ExitStack() as stack:
        line, used, remarks = _source(
            stack, source, board, speed, say, is_recorded=is_recorded
        )
        recorded: Recorded | None = None
        if record is not None:
            most = MOST_WAITING if isinstance(line, Connection) else 0
            recorded = Recorded(line, Recorder(record, used), most)
            stack.callback(recorded.close)
        live = Live(
            model,
            used.sensor,
            recorded or line,
            source,
            reject=usual_floor(model) if reject is None else reject,
            follow_s=used.start.follow_s,
            calibration=used.calibration,
            vote_s=vote_s,
            least=least_area,
        )
        return TactileSensor(live, used, remarks, recorded, stack.pop_all())
    raise AssertionError  # an exit stack swallows nothing


def _source(
    stack: contextlib.ExitStack,
    source: str,
    board: Board | PathLike | None,
    speed: float,
    say: Callable[[str, str], None] | None,
    *,
    is_recorded: bool,
) -> tuple[Connection | Replayed, Board, list[str]]:
    """Return where frames come from, the board that they fit, and remarks on it."""
    known = load_board(board) if isinstance(board, str | os.PathLike) else board
    if Path(source).is_file():
        file = open_frames(source, known)
        stack.enter_context(file)
        replayed = Replayed(file, speed)
        stack.callback(replayed.close)
        return replayed, file.board, []
    if known is None:
        text = f"{source} is no recording; for a port, name its board"
        raise ValueError(text)
    most = room(known) if is_recorded else MOST_WAITING
    line = stack.enter_context(open_connection(known, source, most_waiting=most))
    count = known.start.frames
    if count and say:
        what = f"the baseline in {count} frames: nothing may lie on the sensor"
        say("measures", what)
    began = start(known, _coming(line, say))
    return line, began.board, began.remarks


def _coming(
    line: Connection, say: Callable[[str, str], None] | None
) -> Iterator[Frame]:
    """Give the frames of a line; say once that none comes."""
    is_late = False
    while line.state != "ended":
        frame = line.take(_PATIENCE_S)
        if frame is not None:
            yield frame
        elif not is_late and say:
            is_late = True
            say("waits", "no frame comes; Ctrl-C ends")
