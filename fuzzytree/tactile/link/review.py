"""What is in a recording: how much, how regular, and what is missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fuzzytree.tactile.frames import Counters
from fuzzytree.tactile.link.recording import RecordingFile
from fuzzytree.tactile.link.starting import still


@dataclass(frozen=True, slots=True)
class Review:
    """What is in a recording.

    Attributes:
        frames: How many are whole.
        seconds: From the first to the last.
        longest_s: Between two frames, at most.
        gaps: How often numbers of frames are missing.
        missing: How many numbers these are: dropped, or damaged in the file.
        damaged: Records of the file that are damaged.
        cut_bytes: Bytes at the end that are less than a record.
        still: The (row, column) of cells that never move though both neighbours do.
        counters: Of the line, at the last frame.
    """

    frames: int
    seconds: float
    longest_s: float
    gaps: int
    missing: int
    damaged: int
    cut_bytes: int
    still: tuple[tuple[int, int], ...]
    counters: Counters


def review(file: RecordingFile) -> Review:
    """Return what is in a recording, read frame by frame.

    Raises:
        ReadError: If it cannot be read.
    """
    frames = gaps = missing = 0
    longest_s = 0.0
    first = last = None
    extremes = np.zeros((2, 0, 0), np.int64)  # the least and the most of each cell
    for record in file:
        frame = record.frame
        if last is None:
            first, extremes = record, np.array([frame.cells, frame.cells])
        else:
            np.minimum(extremes[0], frame.cells, out=extremes[0])
            np.maximum(extremes[1], frame.cells, out=extremes[1])
            longest_s = max(longest_s, frame.time - last.frame.time)
            left_out = max(frame.number - last.frame.number - 1, 0)
            gaps, missing = gaps + (left_out > 0), missing + left_out
        last = record
        frames += 1
    is_still = still(file.board, extremes) if frames > 1 else np.zeros((0, 0), bool)
    return Review(
        frames,
        last.frame.time - first.frame.time if first and last else 0.0,
        longest_s,
        gaps,
        missing,
        file.damaged,
        file.cut_bytes,
        tuple((int(row), int(column)) for row, column in np.argwhere(is_still)),
        last.counters if last else Counters(),
    )
